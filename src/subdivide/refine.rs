use glam::{DAffine3, DMat3, DVec3};

use super::Supports;
use super::edges::EdgeTable;
use super::pattern::{self, Pattern};
use crate::math::{BackwardMap, BlockMap};

/// When an edge of the slice's triangles is split.
#[derive(Clone, Copy)]
pub struct Rule<'a> {
    /// How often a triangle is split at most. Without a tolerance every displaced edge is split as often as this.
    pub depth: u32,
    /// The largest error of the interpolated backward map that may stay, in voxels.
    pub tolerance: Option<f64>,
    /// Voxels per world unit along the axes of the volume: `size * texture_from_world`. Only the tolerance uses it.
    pub voxel_from_world: DMat3,
    /// Edges in a box that are not longer than so many of its features stay whole.
    pub features: f64,
    /// Edges that are not longer than this in world units stay whole; a function of the edge's midpoint, for perspective.
    pub smallest: Smallest<'a>,
}

/// The length of edges that stay whole.
#[derive(Clone, Copy)]
pub enum Smallest<'a> {
    /// Everywhere the same, in world units; 0 for no such limit.
    Length(f64),
    /// By the place of an edge's midpoint: so many world units.
    At(&'a (dyn Fn(DVec3) -> f64 + Sync)),
}

impl Smallest<'_> {
    pub(super) fn at(&self, p: DVec3) -> f64 {
        match self {
            Self::Length(l) => *l,
            Self::At(f) => f(p),
        }
    }
}

impl Rule<'_> {
    /// Every displaced edge is split `depth` times.
    pub fn uniform(depth: u32) -> Self {
        Self {
            depth,
            tolerance: None,
            voxel_from_world: DMat3::IDENTITY,
            features: 0.0,
            smallest: Smallest::Length(0.0),
        }
    }

    /// Every displaced edge is split until it is no longer than so many features of the boxes that it passes, `depth` times at
    /// most.
    pub fn by_features(features: f64, depth: u32) -> Self {
        Self { features, ..Self::uniform(depth) }
    }

    /// Edges are split until the error is below `tolerance` voxels, `depth` times at most.
    pub fn within(tolerance: f64, depth: u32, texture_from_world: &DAffine3, size: DVec3) -> Self {
        let voxel_from_world = DMat3::from_diagonal(size) * texture_from_world.matrix3;
        Self { tolerance: Some(tolerance), voxel_from_world, ..Self::uniform(depth) }
    }
}

pub(super) const NONE: u32 = u32::MAX;

#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    pub a: u32,
    pub b: u32,
    /// Vertex in the middle, or `NONE`. While patterns are laid, the first of all vertices between the ends.
    pub mid: u32,
    /// The edge a-mid; mid-b is the next. Only if there is a middle.
    pub child: u32,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    pub v: [u32; 3],
    /// Edge i runs between v\[i\] and v\[i + 1\].
    pub e: [u32; 3],
}

/// Refines the triangles of one slice at a time. Buffers are kept, so that later slices need no memory.
#[derive(Debug, Default)]
pub struct Refiner {
    pub(super) positions: Vec<DVec3>,
    /// Backward image of each vertex, and the map's derivative there; only with a tolerance.
    pub(super) images: Vec<(DVec3, DMat3)>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) edges: Vec<Edge>,
    pub(super) faces: Vec<Face>,
    pub(super) next: Vec<Face>,
    pub(super) table: EdgeTable,
    /// Edges of a level that are judged by the map.
    pub(super) asked: Vec<u32>,
    /// By depth, made when first asked for.
    pub(super) patterns: [Option<Pattern>; pattern::DEEPEST as usize + 1],
}

impl Refiner {
    /// World positions of the refined slice; those of the input come first, in their order.
    pub fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    /// The refined triangles, turned as those of the input.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Refines `triangles` (indices into `points`, world positions) where `map` displaces.
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn refine<M: BackwardMap + BlockMap<f64> + ?Sized>(
        &mut self,
        points: impl IntoIterator<Item = DVec3>,
        triangles: &[[u32; 3]],
        map: &M,
        supports: &Supports,
        rule: &Rule,
    ) {
        self.positions.clear();
        self.positions.extend(points);
        self.images.clear();
        self.triangles.clear();
        if supports.is_empty() || rule.depth == 0 {
            self.triangles.extend_from_slice(triangles);
            return;
        }
        self.connect(triangles);
        let mut fresh = 0;
        if rule.tolerance.is_none() && rule.features == 0.0 && self.split_by_pattern(supports, rule) {
            fresh = self.edges.len();
        }
        if rule.tolerance.is_some() {
            self.images.extend(self.positions.iter().map(|p| map.backward_with_jacobian(*p)));
        }
        for _ in 0..rule.depth {
            let end = self.edges.len();
            self.split_edges(fresh..end, map, supports, rule);
            fresh = end;
            self.split_faces(map, supports, rule);
            if self.faces.is_empty() {
                break;
            }
        }
        self.triangles.extend(self.faces.iter().map(|f| f.v));
    }

    /// Numbers the edges.
    fn connect(&mut self, triangles: &[[u32; 3]]) {
        self.edges.clear();
        self.faces.clear();
        self.table.clear(triangles.len());
        for v in triangles {
            let e = std::array::from_fn(|i| {
                let (a, b) = (v[i], v[(i + 1) % 3]);
                let (edge, new) = self.table.find_or_insert(a, b, self.edges.len() as u32);
                if new {
                    self.edges.push(Edge { a, b, mid: NONE, child: NONE });
                }
                edge
            });
            self.faces.push(Face { v: *v, e });
        }
    }
}

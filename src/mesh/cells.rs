//! Solid cells other than tetrahedra, and how they become tetrahedra.
//!
//! # Theory
//!
//! The exact mode (Gascon et al. 2013) maps tetrahedra by barycentric coordinates; its conclusion names cells with basis
//! functions of their own, such as trilinear hexahedra, as an extension. Here such a cell is split so that the piecewise
//! linear map meets its own at the corners, at the centre and at the centres of its quadrilaterals, which are the averages of
//! corners (as those of a trilinear map are). Each quadrilateral becomes four triangles around its centre, each triangle of
//! the surface one tetrahedron with the cell's centre: 24 for a hexahedron, 14 for a wedge, 8 for a pyramid.
//!
//! The split of a face depends on that face alone, not on how a cell numbers its corners, so cells that share a face are
//! split alike and the tetrahedra conform: between pyramids, wedges, hexahedra and tetrahedra, in any numbering.
//!
//! A trilinear map restricted to an octant of its cell is trilinear again. So halving all hexahedra along their three axes
//! before the split ([`CellMesh::into_tets`] with `levels`) changes nothing about the map that is meant, and the error of the
//! piecewise linear one falls by four with each level.

use std::collections::HashMap;

use glam::DVec3;

use super::tets::{PointVectors, TetMesh, signed_volume};

/// A solid cell. Corners are numbered as in VTK and Gmsh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CellKind {
    Tet,
    /// The base 0 1 2 3, anticlockwise seen from the apex 4.
    Pyramid,
    /// The triangle 0 1 2, and 3 4 5 beside them. Whether 0 1 2 run anticlockwise seen from 3 4 5 (Gmsh) or clockwise (VTK)
    /// is told from the volume of all wedges of a mesh together, since programs do not agree.
    Wedge,
    /// The base 0 1 2 3, anticlockwise seen from the top, and 4 5 6 7 above them.
    Hexahedron,
}

impl CellKind {
    /// Number of corners.
    pub fn corners(self) -> usize {
        match self {
            Self::Tet => 4,
            Self::Pyramid => 5,
            Self::Wedge => 6,
            Self::Hexahedron => 8,
        }
    }

    /// Triangles and quadrilaterals of the surface, anticlockwise seen from outside.
    fn faces(self) -> (&'static [[usize; 3]], &'static [[usize; 4]]) {
        match self {
            Self::Tet => (&super::tets::FACES, &[]),
            Self::Pyramid => (&[[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], &[[0, 3, 2, 1]]),
            Self::Wedge => (&[[0, 2, 1], [3, 4, 5]], &[[0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]]),
            Self::Hexahedron => {
                (&[], &[[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
            }
        }
    }

    /// Tetrahedra that the cell is split into.
    pub fn tets(self) -> usize {
        let (triangles, quads) = self.faces();
        if self == Self::Tet { 1 } else { triangles.len() + 4 * quads.len() }
    }
}

/// A mesh of solid cells.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CellMesh {
    pub points: Vec<DVec3>,
    pub kinds: Vec<CellKind>,
    /// The corners of all cells, one after another: indices into `points`, each below its length.
    pub corners: Vec<u32>,
    /// Region of each cell; empty if the mesh has none.
    pub regions: Vec<i32>,
    pub vectors: Vec<PointVectors>,
}

/// Why cells cannot be split.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CellError {
    #[error("only meshes of hexahedra alone can be refined; split this one without levels of refinement")]
    NotHexahedra,
    #[error("the tetrahedra or their points would be more than 4 billion, too many to index")]
    TooMany,
}

impl CellMesh {
    /// Each cell with its corners.
    pub fn cells(&self) -> impl Iterator<Item = (CellKind, &[u32])> {
        let mut rest = self.corners.as_slice();
        self.kinds.iter().map(move |&kind| {
            let (cell, after) = rest.split_at(kind.corners());
            rest = after;
            (kind, cell)
        })
    }

    /// Splits every cell, after `levels` of halving hexahedra along their axes. Tetrahedra stay as they are; the pieces of
    /// a cell stand in its place and have its region. Points keep their numbers, those that are added follow them with
    /// averaged positions and vectors.
    ///
    /// # Errors
    /// If `levels` is above 0 and there are other cells than hexahedra, or the result cannot be indexed.
    pub fn into_tets(self, levels: u32) -> Result<TetMesh, CellError> {
        if levels > 0 && self.kinds.iter().any(|k| *k != CellKind::Hexahedron) {
            return Err(CellError::NotHexahedra);
        }
        let tets = self.kinds.iter().map(|k| k.tets() as u64).sum::<u64>();
        // a level makes eight cells of one, and a cell adds fewer points than it has tetrahedra
        let most = (levels < 11).then(|| 1u64 << (3 * levels)).and_then(|n| n.checked_mul(tets));
        let indices = most.and_then(|n| n.checked_add(self.points.len() as u64));
        if indices.is_none_or(|n| n >= u64::from(u32::MAX)) {
            return Err(CellError::TooMany);
        }
        let mut mesh = self;
        for _ in 0..levels {
            mesh = mesh.halved();
        }
        Ok(mesh.split())
    }

    fn split(self) -> TetMesh {
        let flip = self.wedges_are_clockwise();
        let mut added = Means::after(self.points.len());
        let mut tets = Vec::with_capacity(self.kinds.iter().map(|k| k.tets()).sum());
        let mut regions = Vec::with_capacity(if self.regions.is_empty() { 0 } else { tets.capacity() });
        for (i, (kind, cell)) in self.cells().enumerate() {
            if let Some(&region) = self.regions.get(i) {
                regions.resize(regions.len() + kind.tets(), region);
            }
            if let (CellKind::Tet, &[a, b, c, d]) = (kind, cell) {
                tets.push([a, b, c, d]);
                continue;
            }
            let turned =
                if kind == CellKind::Wedge && flip { [0, 2, 1, 3, 5, 4, 6, 7] } else { [0, 1, 2, 3, 4, 5, 6, 7] };
            let at = |corner: usize| cell[turned[corner]];
            let centre = added.fresh(cell);
            let (triangles, quads) = kind.faces();
            tets.extend(triangles.iter().map(|&[a, b, c]| [at(b), at(a), at(c), centre]));
            for quad in quads {
                let quad = quad.map(at);
                let middle = added.shared(&quad);
                tets.extend((0..4).map(|e| [quad[(e + 1) % 4], quad[e], middle, centre]));
            }
        }
        let Self { mut points, mut vectors, .. } = self;
        added.extend(&mut points);
        vectors.iter_mut().for_each(|v| added.extend(&mut v.values));
        TetMesh { points, tets, regions, vectors }
    }

    /// Whether the wedges have negative volume, taken together, when read as Gmsh's.
    fn wedges_are_clockwise(&self) -> bool {
        let volume = |cell: &[u32]| {
            let p: Vec<DVec3> = cell.iter().map(|&v| self.points[v as usize]).collect();
            [[0, 1, 2, 3], [1, 2, 3, 4], [2, 5, 3, 4]].map(|t| signed_volume(t.map(|i| p[i]))).iter().sum::<f64>()
        };
        self.cells().filter(|(kind, _)| *kind == CellKind::Wedge).map(|(_, cell)| volume(cell)).sum::<f64>() < 0.0
    }

    /// Eight hexahedra in the place of each.
    fn halved(self) -> Self {
        let mut added = Means::after(self.points.len());
        let mut corners = Vec::with_capacity(8 * self.corners.len());
        for (_, cell) in self.cells() {
            // corner numbers by their place: bits 0, 1, 2 choose the upper side of the three axes
            let by_place = [0, 1, 3, 2, 4, 5, 7, 6].map(|corner: usize| cell[corner]);
            // the 27 points of the refined cell, at 0, 1 or 2 halves along each axis
            let grid: [u32; 27] = std::array::from_fn(|n| {
                let at = [n % 3, n / 3 % 3, n / 9];
                let mut sources: Vec<u32> = (0..8usize)
                    .filter(|place| (0..3).all(|axis| at[axis] == 1 || (place >> axis & 1) * 2 == at[axis]))
                    .map(|place| by_place[place])
                    .collect();
                match sources.len() {
                    1 => sources.remove(0),
                    8 => added.fresh(&sources),
                    _ => added.shared(&sources),
                }
            });
            for octant in 0..8 {
                let low = [octant & 1, octant >> 1 & 1, octant >> 2];
                for [x, y, z] in
                    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
                {
                    corners.push(grid[low[0] + x + 3 * (low[1] + y) + 9 * (low[2] + z)]);
                }
            }
        }
        let Self { mut points, kinds, regions, mut vectors, .. } = self;
        added.extend(&mut points);
        vectors.iter_mut().for_each(|v| added.extend(&mut v.values));
        Self {
            points,
            kinds: vec![CellKind::Hexahedron; 8 * kinds.len()],
            corners,
            regions: regions.iter().flat_map(|&r| [r; 8]).collect(),
            vectors,
        }
    }
}

/// Points in the middle of others.
struct Means {
    first: usize,
    /// Up to eight points that each is the average of, in ascending order; the rest is [`Means::NONE`].
    sources: Vec<[u32; 8]>,
    /// Those that cells share, by the ascending points of their edge or face.
    known: HashMap<[u32; 4], u32>,
}

impl Means {
    const NONE: u32 = u32::MAX;

    /// Points that will be numbered from `first`.
    fn after(first: usize) -> Self {
        Self { first, sources: Vec::new(), known: HashMap::new() }
    }

    /// The middle of up to eight points.
    fn fresh(&mut self, points: &[u32]) -> u32 {
        let mut sorted = [Self::NONE; 8];
        sorted[..points.len()].copy_from_slice(points);
        // one order of adding up, so that the average does not depend on the numbering of a cell
        sorted.sort_unstable();
        self.sources.push(sorted);
        (self.first + self.sources.len() - 1) as u32
    }

    /// The middle of an edge or a face, the same for all cells that have it.
    fn shared(&mut self, points: &[u32]) -> u32 {
        let mut key = [Self::NONE; 4];
        key[..points.len()].copy_from_slice(points);
        key.sort_unstable();
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let index = self.fresh(points);
        self.known.insert(key, index);
        index
    }

    /// Appends the averages of these values.
    fn extend(&self, values: &mut Vec<DVec3>) {
        values.reserve_exact(self.sources.len());
        for sources in &self.sources {
            let used = sources.iter().take_while(|&&s| s != Self::NONE);
            let (sum, n) = used.fold((DVec3::ZERO, 0.0), |(sum, n), &s| (sum + values[s as usize], n + 1.0));
            values.push(sum / n);
        }
    }
}

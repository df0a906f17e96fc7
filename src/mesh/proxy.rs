//! The automatic proxy: a closed, smooth mesh of a few thousand triangles that encloses everything above an isovalue.
//!
//! # Theory
//!
//! The proxy gives the shape in which a volume is shown (Westermann and Rezk-Salama 2001, section 2.1), so whatever shall
//! be seen must lie in it, and slicing wants it closed and small. The paper leaves its making to other modellers. Here:
//!
//! 1. The voxels above the isovalue are gathered in boxes, about 64 along each axis, each as tight as its voxels allow and
//!    grown by a margin. D(p) is the distance from p to the nearest box.
//! 2. A lattice is chosen so coarse that its surface net (`nets.rs`) has the wanted number of triangles. Nodes with
//!    D <= r are inside; r is half the diagonal of a cell at first, so that no box is missed. The set is made well-composed
//!    and its cavities are filled: the net is a closed manifold.
//! 3. Vertices start where D = r along the lattice edges. Those of triangles that touch a box (separating axes) are pushed
//!    away from it; where that does not help, nodes are added.
//! 4. Vertices are relaxed towards the mean of their neighbours, but no nearer to a box than a part of the lattice spacing.
//!    After each round the quadrilaterals that touch a box go back to where they were, so that the net, a membrane that
//!    shrinks onto the boxes, never lets one through.
//! 5. The result is checked, not trusted: no triangle may touch a box, the mesh must wind once about each box, and no
//!    triangle may meet another. Vertices of triangles that do must stay in their cells in the next try. Where nothing helps,
//!    all is done again with a larger r.
//!
//! The last r is the diagonal of a lattice cell, with all vertices in their cells. Then containment holds wherever in their
//! cells they are: each point of the net is at most one cell away, along each axis, from an outside node, thus at most a
//! diagonal, and from there every box is farther. And with all vertices in the middle of their cells the net is a hull of
//! cubes, which does not meet itself. So the method always ends with a sound mesh.
//!
//! # Practice
//!
//! All lengths are in voxel edges times spacing, with 0 at the lower face of the volume; a shear of the frame is left to the
//! last step, the map to the world. The lattice divides the volume evenly, nodes in the middle of its cells, so that the
//! faces of the volume lie in the middle between nodes: there a clipped proxy gets its flat sides.

use std::collections::HashSet;

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use super::TriMesh;
use super::bvh::{Aabb, Bvh};
use super::check::self_intersecting;
use super::locate::Locator;
use super::nets::{Lattice, Net};

/// Boxes along each axis, at most.
const BLOCKS: usize = 64;
/// How far from the boxes nodes are inside at first, in lattice steps: half a diagonal, so that no box is missed.
const FIRST_REACH: f64 = 0.87;
/// How near to a box a vertex may be relaxed, in lattice steps.
const CLEARANCE: f64 = 0.5;
/// Nodes of a lattice, at most.
const MOST_NODES: f64 = 4e6;

/// How the proxy is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProxyOptions {
    /// How far around each voxel's centre the proxy reaches at least, along i, j and k, in voxels. With 1, all that trilinear
    /// interpolation can lift above the isovalue is enclosed.
    pub margin_voxels: f64,
    /// Wanted number of triangles; met within about a quarter where the shape allows.
    pub target_triangles: usize,
    /// Rounds of relaxation; 0 leaves the steps of the lattice.
    pub smoothing: usize,
    /// Whether the proxy ends at the faces of the volume, or goes round what lies at them.
    pub clip: bool,
}

impl Default for ProxyOptions {
    fn default() -> Self {
        Self { margin_voxels: 1.0, target_triangles: 4000, smoothing: 40, clip: true }
    }
}

/// Why there is no proxy.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ProxyError {
    #[error("no voxel is above the isovalue, so there is nothing to enclose; choose a lower isovalue")]
    NothingInside,
    #[error("a grid of {0}x{1}x{2} voxels is empty; every size must be at least 1")]
    EmptyGrid(usize, usize, usize),
    #[error("the margin of {0} voxels must be a number from 0 to 1000")]
    Margin(f64),
    #[error("the voxel axes are not finite or lie in one plane")]
    Singular,
    #[error("the voxel spacing differs so much between the axes that rounding spoils the proxy")]
    Uneven,
}

/// Encloses every voxel of a grid for which `inside` holds; its argument is the linear index, x fastest. The mesh is in the
/// world, closed, manifold, faces outward, does not meet itself, and has no cavities.
///
/// # Errors
/// See [`ProxyError`].
pub fn enclose(
    dims: [usize; 3],
    world_from_voxel: &DAffine3,
    inside: impl Fn(usize) -> bool + Sync,
    options: &ProxyOptions,
) -> Result<TriMesh, ProxyError> {
    if dims.contains(&0) {
        return Err(ProxyError::EmptyGrid(dims[0], dims[1], dims[2]));
    }
    if !(0.0..=1000.0).contains(&options.margin_voxels) {
        return Err(ProxyError::Margin(options.margin_voxels));
    }
    let m = world_from_voxel.matrix3;
    let spacing = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
    if !world_from_voxel.is_finite() || m.determinant() == 0.0 {
        return Err(ProxyError::Singular);
    }
    let frame = Frame { dims, spacing, size: DVec3::from_array(dims.map(|n| n as f64)) * spacing };
    let boxes = gather(&frame, &inside, options);
    let hull = boxes.iter().copied().reduce(|a, b| Aabb::around(&[a.lo, a.hi, b.lo, b.hi]));
    let hull = hull.ok_or(ProxyError::NothingInside)?;
    let solid = Solid { tree: Bvh::new(boxes.clone()), boxes, hull };

    let cells = solid.choose_lattice(&frame, options);
    let mesh = solid.sound_mesh(&cells, options).ok_or(ProxyError::Uneven)?;
    let voxel_from_edges = DAffine3::from_mat3_translation(DMat3::from_diagonal(spacing.recip()), DVec3::splat(-0.5));
    Ok(mesh.transformed(&(*world_from_voxel * voxel_from_edges)))
}

/// The volume without its place in the world: from 0 to `size`.
struct Frame {
    dims: [usize; 3],
    spacing: DVec3,
    size: DVec3,
}

/// Tight boxes around the voxels inside, grown by the margin.
fn gather(frame: &Frame, inside: &(impl Fn(usize) -> bool + Sync), options: &ProxyOptions) -> Vec<Aabb> {
    let [nx, ny, nz] = frame.dims;
    let edge = frame.dims.map(|n| n.div_ceil(BLOCKS));
    let columns = nx.div_ceil(edge[0]);
    let rows: Vec<(usize, usize)> =
        (0..nz).step_by(edge[2]).flat_map(|z| (0..ny).step_by(edge[1]).map(move |y| (y, z))).collect();
    // voxel index ranges, both ends included
    type Range = [[usize; 3]; 2];
    let block_row = |&(y0, z0): &(usize, usize)| -> Vec<Range> {
        let mut tight: Vec<Option<Range>> = vec![None; columns];
        for z in z0..(z0 + edge[2]).min(nz) {
            for y in y0..(y0 + edge[1]).min(ny) {
                let row = nx * (y + ny * z);
                for (block, tight) in tight.iter_mut().enumerate() {
                    let (start, end) = (block * edge[0], ((block + 1) * edge[0]).min(nx));
                    let Some(first) = (start..end).find(|&x| inside(row + x)) else { continue };
                    let last = (first..end).rev().find(|&x| inside(row + x)).unwrap_or(first);
                    let [lo, hi] = tight.get_or_insert([[first, y, z], [last, y, z]]);
                    (lo[0], hi[0]) = (lo[0].min(first), hi[0].max(last));
                    (lo[1], hi[1]) = (lo[1].min(y), hi[1].max(y));
                    hi[2] = z;
                }
            }
        }
        // boxes that continue each other are one
        let mut merged: Vec<Range> = Vec::new();
        for r in tight.into_iter().flatten() {
            match merged.last_mut() {
                Some([lo, hi]) if lo[1..] == r[0][1..] && hi[1..] == r[1][1..] && hi[0] + 1 == r[0][0] => {
                    hi[0] = r[1][0]
                }
                _ => merged.push(r),
            }
        }
        merged
    };
    let ranges: Vec<Range> = rows.par_iter().flat_map_iter(block_row).collect();
    let margin = options.margin_voxels * frame.spacing;
    // a box must not touch the side of a clipped proxy, only come near it
    let inset = frame.spacing * 1e-3;
    ranges
        .iter()
        .map(|[lo, hi]| {
            let center = |v: &[usize; 3]| (DVec3::from_array(v.map(|x| x as f64)) + 0.5) * frame.spacing;
            let (lo, hi) = (center(lo) - margin, center(hi) + margin);
            if options.clip { Aabb { lo: lo.max(inset), hi: hi.min(frame.size - inset) } } else { Aabb { lo, hi } }
        })
        .collect()
}

/// Lattice cells: node i of the volume's own lies at `(i + 1/2) step`, node 0 of the window at `(first + 1/2) step`.
struct Cells {
    step: DVec3,
    first: DVec3,
    dims: [usize; 3],
    /// Sides at which the proxy is cut off.
    clip: Option<DVec3>,
}

impl Cells {
    /// In lattice coordinates of the window to the volume's frame.
    fn place(&self, p: DVec3) -> DVec3 {
        (p + self.first + 0.5) * self.step
    }

    /// Whether a node may be inside.
    fn allowed(&self, node: [usize; 3]) -> bool {
        let p = self.place(DVec3::from_array(node.map(|x| x as f64)));
        (0..3).all(|a| node[a] > 0 && node[a] + 1 < self.dims[a])
            && self.clip.is_none_or(|size| p.cmpgt(DVec3::ZERO).all() && p.cmplt(size).all())
    }
}

impl Cells {
    /// Where the vertex of a cell may be: anywhere in the volume if `free`, else in the cell, and flat on the side of the
    /// volume that leads through it.
    fn range_of(&self, cell: &[usize; 3], free: bool) -> Aabb {
        let lo = DVec3::from_array(cell.map(|x| x as f64));
        let (lo, hi) = (self.place(lo), self.place(lo + 1.0));
        let all = Aabb { lo: DVec3::NEG_INFINITY, hi: DVec3::INFINITY };
        let mut range = if free { all } else { Aabb { lo, hi } };
        if let Some(size) = self.clip {
            range = Aabb { lo: range.lo.max(DVec3::ZERO), hi: range.hi.min(size) };
            for a in 0..3 {
                if !free && lo[a] < 0.0 {
                    range.hi[a] = 0.0;
                } else if !free && hi[a] > size[a] {
                    range.lo[a] = size[a];
                }
            }
        }
        range
    }
}

struct Solid {
    boxes: Vec<Aabb>,
    tree: Bvh,
    hull: Aabb,
}

impl Solid {
    /// A lattice of about `step` spacing that holds everything within one of its diagonals from the boxes.
    fn cells(&self, frame: &Frame, step: f64, clip: bool) -> Cells {
        let n = (frame.size / step).round().max(DVec3::ONE);
        let step = frame.size / n;
        // one more node for the rounding, and one to stay outside
        let first = ((self.hull.lo - step.length()) / step).floor() - 2.0;
        let last = ((self.hull.hi + step.length()) / step).ceil() + 2.0;
        let dims = (last - first + 1.0).to_array().map(|x| x as usize);
        Cells { step, first, dims, clip: clip.then_some(frame.size) }
    }

    /// Nodes within `reach` of a box, made fit for a net; and how far each node is from `reach` (negative inside, and cut
    /// off at `depth`, which is at least 0).
    fn lattice(&self, cells: &Cells, reach: f64, depth: f64) -> (Lattice, Vec<f64>) {
        let [nx, ny, nz] = cells.dims;
        let level: Vec<f64> = (0..nx * ny * nz)
            .into_par_iter()
            .map(|i| {
                let p = cells.place(DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64));
                self.tree.nearest(p, reach + depth).map_or(depth, |q| q.distance(p) - reach)
            })
            .collect();
        let inside =
            (0..level.len()).map(|i| level[i] < 0.0 && cells.allowed([i % nx, i / nx % ny, i / (nx * ny)])).collect();
        let mut lattice = Lattice { dims: cells.dims, inside };
        lattice.make_well_composed();
        lattice.fill_cavities();
        (lattice, level)
    }

    /// The lattice whose net comes near the wanted number of triangles.
    fn choose_lattice(&self, frame: &Frame, options: &ProxyOptions) -> Cells {
        let target = options.target_triangles.clamp(50, 1_000_000) as f64;
        let size = self.hull.hi - self.hull.lo;
        let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        // a net has two triangles for each square of its staircase, whose area is about that of the box
        let mut step = (2.0 * area.max(f64::MIN_POSITIVE) / target).sqrt().max(size.max_element() / 1000.0);
        let mut best: Option<(f64, Cells)> = None;
        for _ in 0..6 {
            let mut cells = self.cells(frame, step, options.clip);
            while cells.dims.iter().map(|&n| n as f64).product::<f64>() > MOST_NODES {
                step *= 1.2;
                cells = self.cells(frame, step, options.clip);
            }
            let (lattice, _) = self.lattice(&cells, FIRST_REACH * cells.step.max_element(), 0.0);
            let ratio = 2.0 * lattice.quad_count() as f64 / target;
            let off = ratio.max(1.0 / ratio);
            if best.as_ref().is_none_or(|b| off < b.0) {
                best = Some((off, cells));
            }
            if off < 1.2 {
                break;
            }
            step *= ratio.sqrt().clamp(0.25, 4.0);
        }
        best.map_or_else(|| self.cells(frame, step, options.clip), |b| b.1)
    }

    /// The net of these cells at the smallest reach, tried in steps, at which it can be made sound. `None` only if rounding
    /// errors are as large as the cells.
    fn sound_mesh(&self, cells: &Cells, options: &ProxyOptions) -> Option<TriMesh> {
        let diagonal = cells.step.length();
        let mut reach = FIRST_REACH * cells.step.max_element();
        while reach < diagonal {
            let (mut lattice, level) = self.lattice(cells, reach, diagonal);
            let mut bound = HashSet::new();
            for _ in 0..6 {
                let mut net = Relaxed::new(self, cells, &lattice, &level, |cell| !bound.contains(cell));
                let result = net.part_from_boxes(self).and_then(|()| {
                    net.smooth(self, options.smoothing);
                    net.untangled(self)
                });
                match result {
                    Ok(mesh) => return Some(mesh),
                    Err(Flaw::Touches(bad)) => {
                        for node in bad.iter().flat_map(|&v| nodes_of(&net.net.cells[v])).filter(|n| cells.allowed(*n))
                        {
                            let i = lattice.index(node);
                            lattice.inside[i] = true;
                        }
                        lattice.make_well_composed();
                        lattice.fill_cavities();
                    }
                    Err(Flaw::Tangled(bad)) => bound.extend(bad.iter().map(|&v| net.net.cells[v])),
                }
            }
            reach += 0.25 * cells.step.max_element();
        }
        let (lattice, level) = self.lattice(cells, diagonal, diagonal);
        let mut net = Relaxed::new(self, cells, &lattice, &level, |_| false);
        net.smooth(self, options.smoothing);
        for _ in 0..30 {
            match net.untangled(self) {
                Ok(mesh) => return Some(mesh),
                Err(Flaw::Tangled(bad)) => bad.iter().for_each(|&v| {
                    let middle = (net.cells[v].lo + net.cells[v].hi) / 2.0;
                    net.points[v] = net.points[v].lerp(middle, 0.5);
                }),
                Err(Flaw::Touches(_)) => return None,
            }
        }
        net.points = net.cells.iter().map(|r| (r.lo + r.hi) / 2.0).collect();
        net.untangled(self).ok()
    }

    /// Triangles that touch a box.
    fn touching(&self, mesh: &TriMesh) -> Vec<u32> {
        let touches = |t: &u32| {
            let corners = mesh.triangles[*t as usize].map(|v| mesh.positions[v as usize]);
            let mut hit = false;
            self.tree.overlapping(&Aabb::around(&corners), |b| {
                hit = hit || triangle_touches(corners, self.tree.bounds_of(b))
            });
            hit
        };
        (0..mesh.triangles.len() as u32).into_par_iter().filter(touches).collect()
    }

    /// The boxes, none of which a triangle touches, that are not inside.
    fn not_wound_once_by(&self, mesh: &TriMesh) -> Vec<Aabb> {
        let locator = Locator::new(mesh);
        let outside = |b: &&Aabb| locator.winding_number((b.lo + b.hi) / 2.0) != 1;
        self.boxes.par_iter().filter(outside).copied().collect()
    }
}

/// What keeps a net from being a proxy, and at which vertices.
enum Flaw {
    Touches(Vec<usize>),
    Tangled(Vec<usize>),
}

/// A net whose vertices are being moved.
struct Relaxed {
    net: Net,
    points: Vec<DVec3>,
    /// The cell of each vertex.
    cells: Vec<Aabb>,
    /// Where each vertex may be.
    ranges: Vec<Aabb>,
    /// Least distance of each vertex from the boxes.
    clearance: Vec<f64>,
}

impl Relaxed {
    fn new(solid: &Solid, cells: &Cells, lattice: &Lattice, level: &[f64], free: impl Fn(&[usize; 3]) -> bool) -> Self {
        let net = lattice.net();
        let start = net.mean_of_crossings(lattice, |i| level[i]).iter().map(|p| cells.place(*p)).collect();
        let mut relaxed = Self {
            points: start,
            ranges: net.cells.iter().map(|c| cells.range_of(c, free(c))).collect(),
            cells: net.cells.iter().map(|c| cells.range_of(c, false)).collect(),
            clearance: vec![CLEARANCE * cells.step.max_element(); net.cells.len()],
            net,
        };
        // flat sides first
        relaxed.points = relaxed.cells.iter().zip(&relaxed.points).map(|(c, p)| c.nearest(*p)).collect();
        relaxed.points = (0..relaxed.points.len()).map(|v| relaxed.held(solid, v, relaxed.points[v])).collect();
        relaxed
    }

    /// The place near `p` where vertex `v` may be. It stays where it is if it would lie in a box.
    fn held(&self, solid: &Solid, v: usize, p: DVec3) -> DVec3 {
        let p = self.ranges[v].nearest(p);
        match solid.tree.nearest(p, self.clearance[v]) {
            Some(q) if q == p => self.ranges[v].nearest(self.points[v]),
            Some(q) => self.ranges[v].nearest(q + (p - q) * (self.clearance[v] / q.distance(p))),
            None => p,
        }
    }

    fn mesh(&self) -> TriMesh {
        TriMesh { positions: self.points.clone(), triangles: self.net.triangles(&self.points) }
    }

    /// The corners of the quadrilaterals that touch a box.
    fn touching(&self, solid: &Solid) -> Vec<usize> {
        self.corners(&solid.touching(&self.mesh()))
    }

    fn corners(&self, triangles: &[u32]) -> Vec<usize> {
        let mut v: Vec<usize> =
            triangles.iter().flat_map(|t| self.net.quads[*t as usize / 2]).map(|v| v as usize).collect();
        v.sort_unstable();
        v.dedup();
        v
    }

    /// Pushes vertices away from the boxes until no triangle touches one and all are inside.
    fn part_from_boxes(&mut self, solid: &Solid) -> Result<(), Flaw> {
        let mut fewest = usize::MAX;
        let mut in_vain = 0;
        loop {
            let bad = self.touching(solid);
            if bad.is_empty() {
                let escaped = solid.not_wound_once_by(&self.mesh());
                let near = |v: &usize| escaped.iter().any(|b| b.overlaps(&self.cells[*v]));
                let bad: Vec<usize> = (0..self.points.len()).filter(near).collect();
                return if escaped.is_empty() { Ok(()) } else { Err(Flaw::Touches(bad)) };
            }
            in_vain = if bad.len() < fewest { 0 } else { in_vain + 1 };
            fewest = fewest.min(bad.len());
            if in_vain == 6 {
                return Err(Flaw::Touches(bad));
            }
            for v in bad {
                self.clearance[v] *= 1.2;
                self.points[v] = self.held(solid, v, self.points[v]);
            }
        }
    }

    /// Moves vertices towards the mean of their neighbours. Where that makes a triangle touch a box, they stay: so what was
    /// parted from the boxes remains so.
    fn smooth(&mut self, solid: &Solid, rounds: usize) {
        for round in 0..rounds {
            if round + 4 == rounds {
                // the last rounds take away the creases where the net begins to lie on the boxes
                self.clearance.iter_mut().for_each(|c| *c *= 0.5);
            }
            let means = self.net.neighbour_means(&self.points);
            let moved = |v: usize| self.held(solid, v, self.points[v].lerp(means[v], 0.5));
            let moved = (0..means.len()).into_par_iter().map(moved).collect();
            let before = std::mem::replace(&mut self.points, moved);
            loop {
                let mut restored = false;
                for v in self.touching(solid) {
                    restored |= self.points[v] != before[v];
                    self.points[v] = before[v];
                }
                if !restored {
                    break;
                }
            }
        }
    }

    /// The mesh, if nothing is wrong with it.
    fn untangled(&self, solid: &Solid) -> Result<TriMesh, Flaw> {
        let mesh = self.mesh();
        let touching = solid.touching(&mesh);
        if !touching.is_empty() || !solid.not_wound_once_by(&mesh).is_empty() {
            return Err(Flaw::Touches(self.corners(&touching)));
        }
        let crossing = self_intersecting(&mesh, &vec![false; mesh.triangles.len()]);
        if crossing.is_empty() { Ok(mesh) } else { Err(Flaw::Tangled(self.corners(&crossing))) }
    }
}

fn nodes_of(cell: &[usize; 3]) -> [[usize; 3]; 8] {
    std::array::from_fn(|c| [cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)])
}

/// By separating axes; what comes nearer than rounding errors counts as touching.
fn triangle_touches(triangle: [DVec3; 3], b: &Aabb) -> bool {
    let (center, half) = ((b.lo + b.hi) / 2.0, (b.hi - b.lo) / 2.0);
    let t = triangle.map(|p| p - center);
    let edges = [t[1] - t[0], t[2] - t[1], t[0] - t[2]];
    let normal = edges[0].cross(edges[1]);
    let crossed = edges.iter().flat_map(|e| [DVec3::X.cross(*e), DVec3::Y.cross(*e), DVec3::Z.cross(*e)]);
    let separates = |axis: DVec3| {
        let d = t.map(|p| p.dot(axis));
        let (lo, hi) = (d[0].min(d[1]).min(d[2]), d[0].max(d[1]).max(d[2]));
        let reach = half.dot(axis.abs());
        let error = 1e-12 * (reach + lo.abs() + hi.abs());
        lo > reach + error || hi < -reach - error
    };
    ![DVec3::X, DVec3::Y, DVec3::Z, normal].into_iter().chain(crossed).any(separates)
}

//! Displacements of a block of voxels, in voxels of the input, for maps that know nothing of grids.
//!
//! Two ways, by what the map allows:
//!
//! * *exact*: the map at every voxel, in `f64`;
//! * *interpolated*: the map, in `f64`, at 4 x 4 x 4 nodes of a cell of 8 x 8 x 8 voxels, tricubic (Lagrange) between them, if the
//!   result agrees with the map at 15 further points; otherwise the cell is exact. The points lie where the error of cubic
//!   interpolation is greatest for a smooth map (near 0.38 and 2.62 of the 3 node distances, and in the middle), one in each of
//!   the three intervals along every axis, so that a kink of the second derivative (a knot of a spline) shows too.

use glam::{DAffine3, DVec3};

use super::grid::{Frame, Span, snap};
use super::kernel::ROW;
use crate::math::{BackwardMap, OrientedBox};
use crate::volume::Grid;

/// Rows of a block along j and k.
pub(super) const EDGE: usize = 8;

/// Greatest error, in voxels, that interpolation of the map may have. It must show a quarter of that at the checks.
pub(super) const TOLERANCE: f64 = 1e-3;

/// A block of output voxels: at most [`ROW`] x [`EDGE`] x [`EDGE`], or a longer one where nothing moves.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    pub lo: [i64; 3],
    pub size: [usize; 3],
}

impl Block {
    pub fn first(&self) -> DVec3 {
        DVec3::new(self.lo[0] as f64, self.lo[1] as f64, self.lo[2] as f64)
    }

    pub fn voxel(&self, i: usize, j: usize, k: usize) -> DVec3 {
        self.first() + DVec3::new(i as f64, j as f64, k as f64)
    }

    /// The block's middle and its half edge lengths between the outermost voxel centres.
    pub fn middle(&self) -> (DVec3, DVec3) {
        let half = 0.5 * DVec3::new(self.size[0] as f64 - 1.0, self.size[1] as f64 - 1.0, self.size[2] as f64 - 1.0);
        (self.first() + half, half)
    }
}

/// A support box as seen from the output's voxels.
struct Support {
    /// The box is `[-1,1]^3`.
    local_from_out: DAffine3,
    bounds: Span,
}

/// The support boxes of a map, ready to be compared with blocks.
pub(super) struct Supports(Vec<Support>);

impl Supports {
    pub fn new(output: &Grid, boxes: &[OrientedBox]) -> Self {
        Self(
            boxes
                .iter()
                .map(|b| {
                    let shrink = glam::DMat3::from_diagonal(b.half.recip()) * b.axes.transpose();
                    let local_from_world = DAffine3::from_mat3_translation(shrink, -(shrink * b.center));
                    Support {
                        local_from_out: local_from_world * output.world_from_voxel,
                        bounds: super::grid::span_of_box(output, b),
                    }
                })
                .collect(),
        )
    }

    /// Whether the map may move a voxel of the block. Never wrongly false.
    pub fn touch(&self, block: &Block) -> bool {
        self.near(block).next().is_some()
    }

    /// Whether all boxes at the block are so much larger than a cell that nothing of them hides between the nodes.
    fn coarse_enough(&self, block: &Block) -> bool {
        self.near(block).all(|s| {
            let m = s.local_from_out.matrix3;
            let cell = EDGE as f64 * (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs());
            cell.max_element() <= 0.75
        })
    }

    fn near(&self, block: &Block) -> impl Iterator<Item = &Support> {
        let (middle, half) = block.middle();
        let block = *block;
        self.0.iter().filter(move |s| {
            let apart =
                (0..3).any(|a| block.lo[a] > s.bounds.hi[a] || block.lo[a] + (block.size[a] as i64) <= s.bounds.lo[a]);
            let m = s.local_from_out.matrix3;
            let reach = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
            let distance = s.local_from_out.transform_point3(middle).abs() - reach;
            // the margin covers rounding; a box with NaN touches everything
            !apart && !(distance.max_element() > 1.0 + 1e-9)
        })
    }
}

/// Displacements of a block: `[row][axis][voxel]`, row `k * EDGE + j`.
pub(super) struct Shifts {
    pub rows: Vec<[[f32; ROW]; 3]>,
    /// `node[axis][z][y][x]` of one cell, and its Lagrange weights at whole voxels.
    node: [[[[f64; 4]; 4]; 4]; 3],
    weights: [[f64; 4]; EDGE],
}

/// Lagrange weights of nodes at 0, 1, 2, 3.
fn lagrange(t: f64) -> [f64; 4] {
    let [a, b, c, d] = [t, t - 1.0, t - 2.0, t - 3.0];
    [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0]
}

/// Voxels from one node of a cell to the next.
const NODE_STEP: f64 = (EDGE - 1) as f64 / 3.0;

/// Where interpolation is compared with the map, in node distances.
const CHECKS: [[f64; 3]; 15] = {
    const L: f64 = 0.382;
    const M: f64 = 1.5;
    const H: f64 = 2.618;
    [
        [L, L, L],
        [H, L, L],
        [L, H, L],
        [H, H, L],
        [L, L, H],
        [H, L, H],
        [L, H, H],
        [H, H, H],
        [M, M, M],
        [M, L, H],
        [L, M, H],
        [L, H, M],
        [M, H, L],
        [H, M, L],
        [H, L, M],
    ]
};

impl Shifts {
    pub fn new() -> Self {
        Self {
            rows: vec![[[0.0; ROW]; 3]; EDGE * EDGE],
            node: [[[[0.0; 4]; 4]; 4]; 3],
            weights: std::array::from_fn(|i| lagrange(i as f64 / NODE_STEP)),
        }
    }

    /// The map at every voxel.
    fn exact(&mut self, frame: &Frame, map: &dyn BackwardMap, block: &Block) {
        self.exact_cell(frame, map, block, 0, block.size[0]);
    }

    fn exact_cell(&mut self, frame: &Frame, map: &dyn BackwardMap, block: &Block, from: usize, to: usize) {
        for k in 0..block.size[2] {
            for j in 0..block.size[1] {
                let row = &mut self.rows[k * EDGE + j];
                for i in from..to {
                    let d = snap(frame.displacement(map, block.voxel(i, j, k)));
                    for a in 0..3 {
                        row[a][i] = d[a] as f32;
                    }
                }
            }
        }
    }

    /// The map interpolated where that is accurate, exact elsewhere.
    pub fn fill(&mut self, frame: &Frame, map: &dyn BackwardMap, supports: &Supports, block: &Block) {
        if !supports.coarse_enough(block) {
            return self.exact(frame, map, block);
        }
        for from in (0..block.size[0]).step_by(EDGE) {
            let to = (from + EDGE).min(block.size[0]);
            let corner = block.voxel(from, 0, 0);
            let at = |x: f64, y: f64, z: f64| snap(frame.displacement(map, corner + NODE_STEP * DVec3::new(x, y, z)));
            let (mut constant, first) = (true, at(0.0, 0.0, 0.0));
            for z in 0..4 {
                for y in 0..4 {
                    for x in 0..4 {
                        let d = at(x as f64, y as f64, z as f64);
                        constant &= d == first;
                        for a in 0..3 {
                            self.node[a][z][y][x] = d[a];
                        }
                    }
                }
            }
            let good = CHECKS.iter().all(|&[x, y, z]| {
                let (wx, wy, wz) = (lagrange(x), lagrange(y), lagrange(z));
                let d = at(x, y, z);
                // NaN is not good
                (0..3).all(|a| (tensor(&self.node[a], &wx, &wy, &wz) - d[a]).abs() <= 0.25 * TOLERANCE)
            });
            if !good {
                self.exact_cell(frame, map, block, from, to);
            } else if constant {
                // as the weights sum to 1 only up to rounding, and a whole number must stay one
                for k in 0..block.size[2] {
                    for j in 0..block.size[1] {
                        for a in 0..3 {
                            self.rows[k * EDGE + j][a][from..to].fill(first[a] as f32);
                        }
                    }
                }
            } else {
                self.fill_cell(block, from, to);
            }
        }
    }

    /// Evaluates the interpolant of the nodes at the voxels of a cell.
    fn fill_cell(&mut self, block: &Block, from: usize, to: usize) {
        for a in 0..3 {
            for k in 0..block.size[2] {
                let wz = &self.weights[k];
                let mut layer = [[0.0; 4]; 4];
                for (y, line) in layer.iter_mut().enumerate() {
                    for (x, v) in line.iter_mut().enumerate() {
                        *v = (0..4).map(|z| wz[z] * self.node[a][z][y][x]).sum();
                    }
                }
                for j in 0..block.size[1] {
                    let wy = &self.weights[j];
                    let line: [f64; 4] = std::array::from_fn(|x| (0..4).map(|y| wy[y] * layer[y][x]).sum());
                    let row = &mut self.rows[k * EDGE + j][a];
                    for (d, w) in row[from..to].iter_mut().zip(&self.weights) {
                        *d = (w[0] * line[0] + w[1] * line[1] + w[2] * line[2] + w[3] * line[3]) as f32;
                    }
                }
            }
        }
    }
}

fn tensor(node: &[[[f64; 4]; 4]; 4], wx: &[f64; 4], wy: &[f64; 4], wz: &[f64; 4]) -> f64 {
    let mut sum = 0.0;
    for z in 0..4 {
        for y in 0..4 {
            for x in 0..4 {
                sum += wz[z] * wy[y] * wx[x] * node[z][y][x];
            }
        }
    }
    sum
}

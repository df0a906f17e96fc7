//! The paper's candidates, for comparison: bounding boxes (section 3) and the cells that culling leaves (section 4).
//!
//! Each tetrahedron has cells of its own, from the lower corner of its bounding box on. The corners of a cell (its outermost
//! voxel centres) are classified against eight half-spaces, `b < 0` and `b > 1` for each barycentric coordinate b; if one
//! of the eight bits is set at all eight corners, no voxel of the cell is in the tetrahedron.

use super::setup::Tet;
use super::{Culling, Warp, WarpError};
use crate::math::parallel;

/// The voxels that are tested against each tetrahedron.
pub struct Candidates<'a> {
    tets: &'a [Tet],
    pub(crate) culling: Culling,
    /// Cells of all bounding boxes; with [`Culling::None`] they have the paper's 8 voxels along an edge.
    pub cells: u64,
    /// Those that were not culled.
    pub cells_kept: u64,
    /// Lower corners of the remaining cells of each tetrahedron, by layer; those of tetrahedron t end at `ends[t]`.
    corners: Vec<[i32; 3]>,
    ends: Vec<usize>,
}

/// The paper's edge of a cell.
pub const CELL: u32 = 8;

impl<'a> Candidates<'a> {
    /// # Errors
    /// If the cells have no size, or an absurd one.
    pub(super) fn new(warp: &'a Warp, culling: Culling) -> Result<Self, WarpError> {
        let tets = &warp.tets[..];
        let size = match culling {
            Culling::Cells { size } if !(1..=1024).contains(&size) => return Err(WarpError::CellSize(size)),
            Culling::Cells { size } => size,
            _ => CELL,
        } as i32;
        let cells = match culling {
            Culling::Exact => 0,
            _ => tets.iter().map(|t| cells_along(t, size).iter().map(|n| *n as u64).product::<u64>()).sum(),
        };
        let (mut corners, mut ends) = (Vec::new(), Vec::new());
        if let Culling::Cells { .. } = culling {
            const PIECE: usize = 256;
            let parts = parallel::map(tets.len().div_ceil(PIECE), &|i| {
                let part = &tets[i * PIECE..tets.len().min((i + 1) * PIECE)];
                part.iter().map(|t| kept(t, size)).collect::<Vec<_>>()
            });
            for cells in parts.iter().flatten() {
                corners.extend_from_slice(cells);
                ends.push(corners.len());
            }
        }
        let cells_kept = corners.len() as u64;
        Ok(Self { tets, culling, cells, cells_kept, corners, ends })
    }

    /// Voxels that were tested, if `met` voxels were in a tetrahedron.
    pub(crate) fn tested(&self, met: u64) -> u64 {
        match self.culling {
            Culling::Exact => met,
            Culling::None => self.tets.iter().map(box_voxels).sum(),
            Culling::Cells { size } => self.cells_kept * u64::from(size).pow(3),
        }
    }

    /// Voxels of all bounding boxes, in whole cells of `size` voxels along an edge.
    pub fn padded(&self) -> u64 {
        let size = if let Culling::Cells { size } = self.culling { size } else { CELL };
        self.cells * u64::from(size).pow(3)
    }

    /// Lower corners of the cells of a (prepared) tetrahedron that were not culled.
    pub fn kept(&self, tet: usize) -> &[[i32; 3]] {
        if self.ends.is_empty() {
            return &[];
        }
        let from = if tet == 0 { 0 } else { self.ends[tet - 1] };
        &self.corners[from..self.ends[tet]]
    }

    /// Tests the candidates of a tetrahedron in layer `z` and hands on each row's first and last voxel inside.
    pub(super) fn runs(&self, tet: usize, z: i32, mut run: impl FnMut(i32, i32, i32)) {
        let t = &self.tets[tet];
        let mut test = |lo: [i32; 3], hi: [i32; 3]| {
            for y in lo[1]..=hi[1] {
                let mut inside = (lo[0]..=hi[0]).filter(|x| t.contains([*x, y, z]));
                if let Some(first) = inside.next() {
                    // a row meets a convex body in one piece
                    run(y, first, inside.next_back().unwrap_or(first));
                }
            }
        };
        let Culling::Cells { size } = self.culling else { return test(t.lo, t.hi) };
        let end = size as i32 - 1;
        for lo in self.kept(tet).iter().filter(|c| (c[2]..=c[2] + end).contains(&z)) {
            test(*lo, std::array::from_fn(|a| (lo[a] + end).min(t.hi[a])));
        }
    }
}

fn box_voxels(t: &Tet) -> u64 {
    (0..3).map(|a| (t.hi[a] - t.lo[a] + 1) as u64).product()
}

/// Cells of the bounding box along each axis.
fn cells_along(t: &Tet, size: i32) -> [i32; 3] {
    std::array::from_fn(|a| (t.hi[a] - t.lo[a]) / size + 1)
}

/// Lower corners of the cells that cannot be ruled out.
fn kept(t: &Tet, size: i32) -> Vec<[i32; 3]> {
    let along = cells_along(t, size);
    // each cell has corners of its own, two along each axis
    let points = along.map(|n| 2 * n as usize);
    let place = |a: usize, i: usize| t.lo[a] + (i / 2) as i32 * size + (i % 2) as i32 * (size - 1);
    let mut masks = Vec::with_capacity(points.iter().product());
    for k in 0..points[2] {
        for j in 0..points[1] {
            for i in 0..points[0] {
                let b = t.barycentric([place(0, i), place(1, j), place(2, k)]);
                let bit = |at: usize, set: bool| u8::from(set) << at;
                masks.push(
                    (0..4).fold(0, |mask, f| mask | bit(f, b[f] < -t.slack) | bit(f + 4, b[f] > 1.0 + 4.0 * t.slack)),
                );
            }
        }
    }
    let mut out = Vec::new();
    for k in 0..along[2] as usize {
        for j in 0..along[1] as usize {
            for i in 0..along[0] as usize {
                let mask = |c: usize| {
                    let (x, y, z) = (2 * i + (c & 1), 2 * j + (c >> 1 & 1), 2 * k + (c >> 2));
                    masks[(z * points[1] + y) * points[0] + x]
                };
                if (0..8).fold(u8::MAX, |all: u8, c| all & mask(c)) == 0 {
                    out.push([place(0, 2 * i), place(1, 2 * j), place(2, 2 * k)]);
                }
            }
        }
    }
    out
}

//! Bricks of the output that the device's limits allow, and what is worked off in them.

use super::fixed::{TooFar, record};
use super::{WarpGpuError, WarpLimits};
use crate::gpu::layout::WarpTet;
use crate::math::lanes::Plain;
use crate::math::parallel;
use crate::warp::cells::Candidates;
use crate::warp::outline::Outline;
use crate::warp::{Culling, Tet, Warp};

/// Voxels along a side of a brick, at most: what the fields of an item hold.
pub const SIDE: usize = 1 << 11;

/// Rows of an item.
pub const ROWS: usize = 8;

/// Voxels along a side of a block, at most.
const BLOCK: i32 = 16;

/// Tetrahedra whose items are listed together.
const PIECE: usize = 64;

/// A box of voxels of the output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Brick {
    pub corner: [i32; 3],
    pub size: [usize; 3],
    /// The prepared tetrahedra whose bounds meet it, ascending.
    pub tets: Vec<u32>,
}

impl Brick {
    pub fn voxels(&self) -> usize {
        self.size.iter().product()
    }

    /// The bricks of a grid, each within the limits.
    ///
    /// # Errors
    /// If more tetrahedra meet in one voxel than the device can hold.
    pub fn all(warp: &Warp, limits: &WarpLimits) -> Result<Vec<Self>, WarpGpuError> {
        let mut made = Vec::new();
        let whole = Self { corner: [0; 3], size: warp.dims(), tets: (0..warp.tets().len() as u32).collect() };
        let mut open = vec![whole];
        while let Some(brick) = open.pop() {
            let side = limits.side.clamp(1, SIDE);
            let tets = limits.tets.max(1);
            let fits = brick.voxels() <= limits.voxels.max(1) && brick.tets.len() <= tets;
            if fits && brick.size.iter().all(|n| *n <= side) {
                made.push(brick);
                continue;
            }
            // layers stay whole if they can: they come back in one piece
            let axis = [0, 1].into_iter().find(|&a| brick.size[a] > side);
            let axis = axis.or_else(|| [2, 1, 0].into_iter().find(|&a| brick.size[a] > 1));
            let Some(axis) = axis else {
                return Err(WarpGpuError::Crowded { tets: brick.tets.len(), limit: tets });
            };
            // the first part is worked off first
            let [first, second] = brick.halves(axis, warp.tets());
            open.extend([second, first]);
        }
        Ok(made)
    }

    fn halves(&self, axis: usize, tets: &[Tet]) -> [Self; 2] {
        let half = self.size[axis].div_ceil(2);
        let part = |from: usize, to: usize| {
            let (mut corner, mut size) = (self.corner, self.size);
            corner[axis] += from as i32;
            size[axis] = to - from;
            let mut part = Self { corner, size, tets: Vec::new() };
            part.tets = self.tets.iter().copied().filter(|t| part.clip(&tets[*t as usize]).is_some()).collect();
            part
        };
        [part(0, half), part(half, self.size[axis])]
    }

    /// The voxels of a tetrahedron's bounds in the brick, both ends included.
    fn clip(&self, tet: &Tet) -> Option<[[i32; 3]; 2]> {
        let lo = std::array::from_fn(|a| tet.lo[a].max(self.corner[a]));
        let hi = std::array::from_fn(|a| tet.hi[a].min(self.corner[a] + self.size[a] as i32 - 1));
        (0..3).all(|a| lo[a] <= hi[a]).then_some([lo, hi])
    }

    /// Records of its tetrahedra.
    ///
    /// # Errors
    /// If one does not fit in fixed point.
    pub fn records(&self, warp: &Warp) -> Result<Vec<WarpTet>, WarpGpuError> {
        let parts = parallel::map(self.tets.len().div_ceil(PIECE), &|piece| {
            let tets = &self.tets[piece * PIECE..self.tets.len().min((piece + 1) * PIECE)];
            let made = tets.iter().filter_map(|t| {
                let tet = &warp.tets()[*t as usize];
                let [lo, hi] = self.clip(tet)?;
                Some(record(tet, self.corner, lo, hi).map_err(|TooFar| WarpGpuError::TooFar(tet.id)))
            });
            made.collect::<Result<Vec<_>, _>>()
        });
        let mut records = Vec::with_capacity(self.tets.len());
        for part in parts {
            records.extend(part?);
        }
        Ok(records)
    }

    /// What is worked off, as `items` of `shaders/warp_claim.wgsl`: with [`Culling::Exact`] a pair for up to [`ROWS`] rows of
    /// a layer of a tetrahedron, else two pairs for a block of voxels to test.
    pub fn items(&self, warp: &Warp, candidates: &Candidates<'_>) -> Vec<[u32; 2]> {
        let parts = parallel::map(self.tets.len().div_ceil(PIECE), &|piece| {
            let range = piece * PIECE..self.tets.len().min((piece + 1) * PIECE);
            let mut items = Vec::new();
            for index in range {
                let t = self.tets[index] as usize;
                let tet = &warp.tets()[t];
                let Some([lo, hi]) = self.clip(tet) else { continue };
                match candidates.culling {
                    Culling::Exact => rows(index as u32, tet, lo, hi, &mut items),
                    Culling::None => blocks(index as u32, lo, lo, hi, &mut items),
                    Culling::Cells { size } => {
                        let end = size as i32 - 1;
                        for cell in candidates.kept(t) {
                            let from = std::array::from_fn(|a| cell[a].max(lo[a]));
                            let to = std::array::from_fn(|a| (cell[a] + end).min(hi[a]));
                            blocks(index as u32, lo, from, to, &mut items);
                        }
                    }
                }
            }
            items
        });
        parts.concat()
    }
}

/// Pairs of an item.
pub fn pairs(culling: Culling) -> usize {
    if culling == Culling::Exact { 1 } else { 2 }
}

fn rows(index: u32, tet: &Tet, lo: [i32; 3], hi: [i32; 3], items: &mut Vec<[u32; 2]>) {
    let outline = Outline::new(Plain, tet);
    for z in lo[2]..=hi[2] {
        let [top, bottom] = outline.layer(z).rows;
        let (top, bottom) = (top.max(lo[1]), bottom.min(hi[1]));
        for y in (top..=bottom).step_by(ROWS) {
            let count = (bottom - y + 1).min(ROWS as i32);
            items.push([index, ((count - 1) << 22 | (z - lo[2]) << 11 | (y - lo[1])) as u32]);
        }
    }
}

/// Blocks of the box `from..=to`; nothing if it is empty.
fn blocks(index: u32, lo: [i32; 3], from: [i32; 3], to: [i32; 3], items: &mut Vec<[u32; 2]>) {
    let along = |a: usize| (from[a]..=to[a]).step_by(BLOCK as usize);
    for z in along(2) {
        for y in along(1) {
            for x in along(0) {
                let at = [x, y, z];
                let size: [i32; 3] = std::array::from_fn(|a| (to[a] - at[a] + 1).min(BLOCK));
                let at: [i32; 3] = std::array::from_fn(|a| at[a] - lo[a]);
                items.push([index, (at[0] | at[1] << 16) as u32]);
                items.push([(at[2] | size[0] << 16) as u32, (size[1] | size[2] << 16) as u32]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DQuat, DVec3};

    use super::*;
    use crate::mesh::tet_lattice::{Split, tet_lattice};
    use crate::volume::Grid;

    fn warp(dims: [usize; 3]) -> Warp {
        let grid = Grid::aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap();
        let mesh = tet_lattice(&DAffine3::from_scale(DVec3::new(20.0, 17.0, 23.0)), [3, 2, 3], Split::Six).unwrap();
        let turn = DQuat::from_rotation_z(0.4) * DQuat::from_rotation_x(0.3);
        let moved: Vec<_> = mesh.points.iter().map(|p| turn * *p + DVec3::new(9.0, 2.0, 3.0)).collect();
        Warp::new(&grid, &grid, &mesh.tets, &mesh.points, &moved).unwrap()
    }

    #[test]
    fn bricks_fill_the_grid_within_the_limits() {
        let dims = [37, 29, 41];
        let warp = warp(dims);
        for (voxels, side, tets) in [(usize::MAX, 4096, 4096), (5000, 4096, 4096), (1 << 20, 11, 4096), (4000, 20, 30)]
        {
            let limits = WarpLimits { voxels, side, tets, ..WarpLimits::of(&wgpu::Limits::default()) };
            let bricks = Brick::all(&warp, &limits).unwrap();
            let mut seen = vec![0u8; dims.iter().product()];
            for b in &bricks {
                assert!(b.voxels() <= voxels && b.size.iter().all(|n| *n <= side) && b.tets.len() <= tets);
                for i in 0..b.voxels() {
                    let [x, y, z] = [i % b.size[0], i / b.size[0] % b.size[1], i / b.size[0] / b.size[1]];
                    let [cx, cy, cz] = b.corner.map(|c| c as usize);
                    seen[((z + cz) * dims[1] + y + cy) * dims[0] + x + cx] += 1;
                }
                assert_eq!(b.records(&warp).unwrap().len(), b.tets.len());
            }
            assert!(seen.iter().all(|n| *n == 1) && (bricks.len() > 1 || voxels == usize::MAX));
            // every tetrahedron is in every brick that it meets
            let met = |b: &Brick| {
                (0..warp.tets().len() as u32).filter(|t| b.clip(&warp.tets()[*t as usize]).is_some()).count()
            };
            assert!(bricks.iter().all(|b| met(b) == b.tets.len()));
        }
        // more than 30 tetrahedra never meet in one voxel, but more than 1 do
        let limits = WarpLimits { tets: 1, ..WarpLimits::of(&wgpu::Limits::default()) };
        assert!(matches!(Brick::all(&warp, &limits), Err(WarpGpuError::Crowded { limit: 1, .. })));
    }

    #[test]
    fn items_hold_every_candidate_once() {
        let warp = warp([37, 29, 41]);
        let limits = WarpLimits { voxels: 9000, ..WarpLimits::of(&wgpu::Limits::default()) };
        let bricks = Brick::all(&warp, &limits).unwrap();
        for culling in [Culling::None, Culling::Cells { size: 5 }, Culling::Cells { size: 40 }, Culling::Exact] {
            let candidates = warp.candidates(culling).unwrap();
            let mut tested = std::collections::HashMap::new();
            for brick in &bricks {
                let records = brick.records(&warp).unwrap();
                for item in brick.items(&warp, &candidates).chunks(pairs(culling)) {
                    let tet = item[0][0];
                    let r = &records[tet as usize];
                    let (lo, size) = if let [[_, at]] = item {
                        ([0, at & 0x7ff, at >> 11 & 0x7ff], [r.size[0], (at >> 22) + 1, 1])
                    } else {
                        let [[_, xy], [zw, hd]] = item else { panic!("two pairs") };
                        ([xy & 0xffff, xy >> 16, zw & 0xffff], [zw >> 16, hd & 0xffff, hd >> 16])
                    };
                    for i in 0..size.iter().product::<u32>() {
                        let n = [i % size[0], i / size[0] % size[1], i / size[0] / size[1]];
                        let voxel: [i32; 3] =
                            std::array::from_fn(|a| (r.lo[a] + lo[a] + n[a]) as i32 + brick.corner[a]);
                        *tested.entry((brick.tets[tet as usize], voxel)).or_insert(0) += 1;
                    }
                }
            }
            assert!(tested.values().all(|n| *n == 1), "{culling:?}");
            let mut inside = 0;
            for (t, tet) in warp.tets().iter().enumerate() {
                for z in tet.lo[2]..=tet.hi[2] {
                    for y in tet.lo[1]..=tet.hi[1] {
                        for x in tet.lo[0]..=tet.hi[0] {
                            let holds = tet.contains([x, y, z]);
                            inside += usize::from(holds);
                            assert!(!holds || tested.contains_key(&(t as u32, [x, y, z])), "{culling:?}");
                        }
                    }
                }
            }
            assert!(inside > 5000 && tested.len() >= inside);
            if culling == Culling::None {
                assert_eq!(tested.len() as u64, candidates.tested(0));
            }
        }
    }
}

//! How much of the surroundings of a point is filled: ambient occlusion and soft shadows.
//!
//! What is at or above an isovalue is counted in cells of 2 x 2 x 2 samples, and in coarser cells of twice the size each (a
//! pyramid). Cones from the surface are walked in steps as wide as themselves, and at each the level whose cells are as wide
//! says how much of the light is lost (Crassin et al., "Interactive indirect illumination using voxel cone tracing", 2011).
//! Cones of ambient light have the directions of an icosahedron's corners, whatever the surface does: no frame along the
//! surface is needed, so there is no seam in it, and the shade stays where it is when the view turns.

use glam::{DAffine3, DVec3, Vec3};

use super::Spline;
use crate::math::parallel;
use crate::volume::Grid;

/// Levels of the pyramid. The first one's cells along each axis are a multiple of what is one cell in the last.
pub const LEVELS: usize = 6;

/// Corners of an icosahedron: `(0, 1, phi)` with all signs and rotations, of unit length.
pub const DIRECTIONS: [[f32; 3]; 12] = {
    const A: f32 = 0.525_731_1;
    const B: f32 = 0.850_650_8;
    [
        [0.0, A, B],
        [0.0, -A, B],
        [0.0, A, -B],
        [0.0, -A, -B],
        [A, B, 0.0],
        [-A, B, 0.0],
        [A, -B, 0.0],
        [-A, -B, 0.0],
        [B, 0.0, A],
        [-B, 0.0, A],
        [B, 0.0, -A],
        [-B, 0.0, -A],
    ]
};

/// Cones begin so many cells off the surface, so that it does not shade itself.
pub const OFFSET: f32 = 1.25;
/// Steps of a cone of ambient light, and by what each lies farther away than the last.
pub const STEPS: usize = 7;
pub const GROWTH: f32 = 1.6;
/// What such a cone meets of a plane it begins on, in the mean of all normals: that is no occlusion.
pub const FLAT: f32 = 0.88;
/// Width of the cone towards the light for each unit of its length, and its most steps.
pub const PENUMBRA: f32 = 0.12;
pub const SHADOW_STEPS: usize = 64;

/// Whether a cell, with its middle in the world, counts: what is cut away fills nothing.
pub type Seen<'a> = &'a (dyn Fn([usize; 3], DVec3) -> bool + Sync);

/// How much of each part of space is filled, for one isovalue or several.
#[derive(Debug, Clone, PartialEq)]
pub struct Occupancy {
    /// Cells of the first level.
    dims: [usize; 3],
    /// 255 is full. Finest first, x fastest; each has half the cells of the one before along each axis.
    levels: Vec<Vec<u8>>,
    /// `[0, 1]^3` over all cells.
    unit_from_world: DAffine3,
    /// Size of a cell of the first level in the world (cubic root of its volume).
    cell: f64,
}

impl Occupancy {
    /// Of a spline over a grid; values at or above each of the isovalues are filled with the opacity beside it, and where
    /// there are several, with the largest.
    ///
    /// # Panics
    /// If the spline is not one over the grid.
    pub fn new(spline: &Spline, grid: &Grid, shells: &[(f64, f32)], seen: Option<Seen<'_>>) -> Self {
        let dims = spline.dims();
        assert_eq!(dims, grid.dims);
        let [width, height] = [dims[0] + 2, dims[1] + 2];
        let values = spline.padded();
        let shells: Vec<(f32, f32)> =
            shells.iter().map(|(iso, opacity)| (super::level::limit(*iso), *opacity)).collect();
        Self::filled(grid, seen, &|j, k, out| {
            let mut sums = vec![0.0f32; dims[0]];
            for (dj, dk) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let (y, z) = (2 * j + dj, 2 * k + dk);
                if y >= dims[1] || z >= dims[2] {
                    continue;
                }
                let row = &values[((z + 1) * height + y + 1) * width + 1..][..dims[0]];
                if let [(iso, opacity)] = shells[..] {
                    sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += if *v >= iso { opacity } else { 0.0 });
                } else {
                    sums.iter_mut().zip(row).for_each(|(sum, v)| {
                        let full = |(iso, opacity): &(f32, f32)| if *v >= *iso { *opacity } else { 0.0 };
                        *sum += shells.iter().map(full).fold(0.0, f32::max);
                    });
                }
            }
            for (two, out) in sums.chunks(2).zip(out) {
                *out = (two.iter().sum::<f32>() * (255.0 / 8.0) + 0.5) as u8;
            }
        })
    }

    /// By a function that fills rows of cells: their place along the second and third axis, and the cells.
    fn filled(grid: &Grid, seen: Option<Seen<'_>>, row: &(dyn Fn(usize, usize, &mut [u8]) + Sync)) -> Self {
        let coarsest = 1 << (LEVELS - 1);
        let used = grid.dims.map(|n| n.div_ceil(2));
        let dims = used.map(|n| n.next_multiple_of(coarsest));
        let mut first = vec![0; dims.iter().product()];
        parallel::chunks_mut(&mut first, dims[0] * dims[1], &|k, plane| {
            if k < used[2] {
                plane.chunks_exact_mut(dims[0]).take(used[1]).enumerate().for_each(|(j, out)| {
                    let out = &mut out[..used[0]];
                    row(j, k, out);
                    if let Some(seen) = seen {
                        for (i, cell) in out.iter_mut().enumerate() {
                            *cell *= u8::from(*cell > 0 && seen([i, j, k], middle(grid, [i, j, k])));
                        }
                    }
                });
            }
        });
        let mut levels = vec![first];
        for level in 1..LEVELS {
            let finer = &levels[level - 1];
            let [nx, ny, nz] = dims.map(|n| n >> level);
            let mut coarser = vec![0; nx * ny * nz];
            parallel::chunks_mut(&mut coarser, nx * ny, &|k, plane| {
                for (n, out) in plane.iter_mut().enumerate() {
                    let (i, j) = (n % nx, n / nx);
                    let mut sum = 0;
                    for (dj, dk) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                        let at = ((2 * k + dk) * 2 * ny + 2 * j + dj) * 2 * nx + 2 * i;
                        sum += u32::from(finer[at]) + u32::from(finer[at + 1]);
                    }
                    *out = ((sum + 4) / 8) as u8;
                }
            });
            levels.push(coarser);
        }
        let size = DVec3::from(dims.map(|n| 2.0 * n as f64));
        let unit_from_voxel = DAffine3::from_scale(size.recip()) * DAffine3::from_translation(DVec3::splat(0.5));
        Self {
            dims,
            levels,
            unit_from_world: unit_from_voxel * grid.voxel_from_world(),
            cell: 2.0 * grid.world_from_voxel.matrix3.determinant().abs().cbrt(),
        }
    }

    /// The same matter where a map has moved it to: each cell of a grid gets what there is at the image of its middle, in the
    /// world.
    pub fn moved(&self, grid: &Grid, backward: &(dyn Fn(DVec3) -> DVec3 + Sync), seen: Option<Seen<'_>>) -> Self {
        Self::filled(grid, seen, &|j, k, out| {
            for (i, out) in out.iter_mut().enumerate() {
                let rest = backward(middle(grid, [i, j, k]));
                *out = (255.0 * self.at(self.unit_from_world.transform_point3(rest).as_vec3(), 0.0) + 0.5) as u8;
            }
        })
    }

    /// Cells of the first level.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// 255 is full. Finest first, x fastest.
    pub fn levels(&self) -> &[Vec<u8>] {
        &self.levels
    }

    /// Size of a cell of the first level in the world.
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// How full space is at a place in `[0, 1]^3` and between two levels; nothing beyond. Linear in all four.
    #[inline]
    fn at(&self, unit: Vec3, level: f32) -> f32 {
        if !(unit.min_element() >= 0.0 && unit.max_element() <= 1.0) {
            return 0.0;
        }
        let level = level.clamp(0.0, (LEVELS - 1) as f32);
        let low = level as usize;
        let between = level - low as f32;
        let fine = self.on_level(unit, low);
        if between > 0.0 { fine + between * (self.on_level(unit, low + 1) - fine) } else { fine }
    }

    #[inline(always)]
    fn on_level(&self, unit: Vec3, level: usize) -> f32 {
        let dims = self.dims.map(|n| n >> level);
        let cells = &self.levels[level];
        let mut from = [0; 3];
        let mut next = [0; 3];
        let mut t = [0.0; 3];
        for a in 0..3 {
            let x = (unit[a] * dims[a] as f32 - 0.5).max(0.0);
            from[a] = (x as usize).min(dims[a] - 1);
            next[a] = (from[a] + 1).min(dims[a] - 1);
            t[a] = x - from[a] as f32;
        }
        let row = |j: usize, k: usize| {
            let row = &cells[(k * dims[1] + j) * dims[0]..][..dims[0]];
            let (a, b) = (f32::from(row[from[0]]), f32::from(row[next[0]]));
            a + t[0] * (b - a)
        };
        let plane = |k: usize| {
            let (a, b) = (row(from[1], k), row(next[1], k));
            a + t[1] * (b - a)
        };
        let (a, b) = (plane(from[2]), plane(next[2]));
        (a + t[2] * (b - a)) / 255.0
    }

    /// The part of the ambient light that reaches a point of a surface, 0 to 1; the unit normal points to where light comes
    /// from.
    pub fn ambient(&self, point: DVec3, normal: DVec3) -> f64 {
        let cell = self.cell as f32;
        let start = self.unit_from_world.transform_point3(point + f64::from(OFFSET) * self.cell * normal).as_vec3();
        let turn = self.unit_from_world.matrix3.as_mat3();
        let n = normal.as_vec3();
        let (mut open, mut all) = (0.0, 0.0);
        for direction in DIRECTIONS.map(Vec3::from) {
            let weight = n.dot(direction);
            if weight <= 0.0 {
                continue;
            }
            let step = turn * (direction * cell);
            let (mut through, mut distance) = (1.0, 1.0f32);
            for k in 0..STEPS {
                // what is far away counts less, or deep hollows would be black
                let near = 1.0 - k as f32 / STEPS as f32;
                through *= 1.0 - near * self.at(start + distance * step, distance.log2());
                distance *= GROWTH;
            }
            open += weight * through;
            all += weight;
        }
        f64::from((open / (all * FLAT)).min(1.0))
    }

    /// The part of a light that reaches a point of a surface, 0 to 1; unit directions to the light and along the normal.
    pub fn light(&self, point: DVec3, normal: DVec3, to_light: DVec3) -> f64 {
        let start = self.unit_from_world.transform_point3(point + f64::from(OFFSET) * self.cell * normal).as_vec3();
        let step = (self.unit_from_world.matrix3 * (to_light * self.cell)).as_vec3();
        let (mut through, mut distance) = (1.0, 1.0f32);
        for _ in 0..SHADOW_STEPS {
            let at = start + distance * step;
            if at.min_element() < 0.0 || at.max_element() > 1.0 || through < 0.01 {
                break;
            }
            let width = (PENUMBRA * distance).max(1.0);
            through *= 1.0 - self.at(at, width.log2());
            distance += 0.7 * width;
        }
        f64::from(through)
    }
}

/// The middle of a cell in the world.
fn middle(grid: &Grid, cell: [usize; 3]) -> DVec3 {
    grid.world_from_voxel.transform_point3(DVec3::from(cell.map(|n| 2.0 * n as f64 + 0.5)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(n: usize, value: impl Fn(DVec3) -> f64) -> Occupancy {
        let grid = Grid::aligned([n; 3], DVec3::splat(0.5), DVec3::new(3.0, -2.0, 1.0)).unwrap();
        let at = |i: usize| DVec3::new((i % n) as f64, (i / n % n) as f64, (i / n / n) as f64);
        let samples: Vec<f32> = (0..n * n * n).map(|i| value(at(i)) as f32).collect();
        Occupancy::new(&Spline::new([n; 3], &samples, 0), &grid, &[(0.0, 1.0)], None)
    }

    fn world(voxel: DVec3) -> DVec3 {
        0.5 * voxel + DVec3::new(3.0, -2.0, 1.0)
    }

    #[test]
    fn counts_are_means_at_every_level() {
        let half = of(64, |p| if p.x < 32.0 { 1.0 } else { -1.0 });
        assert_eq!(half.dims(), [32; 3]);
        for (level, cells) in half.levels().iter().enumerate() {
            let n = 32 >> level;
            assert_eq!(cells.len(), n * n * n);
            let mean = cells.iter().map(|c| f64::from(*c)).sum::<f64>() / cells.len() as f64;
            assert!((mean - 127.5).abs() <= 0.5, "level {level}: {mean}");
        }
        // an edge that is not a multiple of a cell: what is beyond the data is empty
        let odd = of(21, |_| 1.0);
        assert_eq!(odd.dims(), [32; 3]);
        let sum: f64 = odd.levels()[0].iter().map(|c| f64::from(*c) / 255.0).sum();
        assert!((8.0 * sum - 21.0f64.powi(3)).abs() < 21.0 * 21.0 * 0.1, "{sum}");
    }

    #[test]
    fn planes_are_open_and_pits_are_dark() {
        // normals in many directions
        let mut mean = 0.0;
        for i in 0..40 {
            let n = DVec3::new((f64::from(i) * 0.7).sin(), (f64::from(i) * 1.3).cos(), (f64::from(i) * 0.37).sin())
                .normalize();
            let plane = of(96, |p| (DVec3::splat(48.0) - p).dot(n));
            let open = plane.ambient(world(DVec3::splat(48.0)), n);
            let lit = plane.light(world(DVec3::splat(48.0)), n, (n + 0.5 * n.any_orthonormal_vector()).normalize());
            assert!(open > 0.93, "{n}: {open}");
            assert!(lit > 0.98, "{n}: {lit}");
            mean += open / 40.0;
        }
        assert!(mean > 0.97, "{mean}");
        // the bottom of a well, four voxels wide
        let well = of(96, |p| {
            let inside = (p.x - 48.0).hypot(p.y - 48.0) < 6.0 && p.z > 40.0;
            if inside || p.z > 70.0 { -1.0 } else { 1.0 }
        });
        let bottom = well.ambient(world(DVec3::new(48.0, 48.0, 40.0)), DVec3::Z);
        let rim = well.ambient(world(DVec3::new(20.0, 48.0, 70.0)), DVec3::Z);
        assert!(bottom < 0.35 && rim > 0.95, "{bottom} {rim}");
    }

    #[test]
    fn a_ball_throws_a_shadow() {
        let scene = of(96, |p| (20.0 - p.z).max(10.0 - p.distance(DVec3::new(48.0, 48.0, 60.0))));
        let at = |x: f64, y: f64| scene.light(world(DVec3::new(x, y, 20.0)), DVec3::Z, DVec3::Z);
        assert!(at(48.0, 48.0) < 0.02, "{}", at(48.0, 48.0));
        assert!(at(10.0, 48.0) > 0.99, "{}", at(10.0, 48.0));
        // soft at the border
        let border = at(58.0, 48.0);
        assert!((0.1..0.9).contains(&border), "{border}");
    }

    #[test]
    fn matter_moves_with_the_map() {
        let ball = of(64, |p| 12.0 - p.distance(DVec3::new(24.0, 32.0, 32.0)));
        let there = of(64, |p| 12.0 - p.distance(DVec3::new(40.0, 32.0, 32.0)));
        let grid = Grid::aligned([64; 3], DVec3::splat(0.5), DVec3::new(3.0, -2.0, 1.0)).unwrap();
        let moved = ball.moved(&grid, &|p| p - DVec3::new(8.0, 0.0, 0.0), None);
        assert_eq!(moved.dims(), there.dims());
        let worst = moved.levels()[0].iter().zip(&there.levels()[0]).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst <= Some(1), "{worst:?}");
    }
}

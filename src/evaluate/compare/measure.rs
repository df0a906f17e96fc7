//! How far slices and volumes are from the reference.

use glam::DVec3;

use crate::deform::Prepared;
use crate::math::{BackwardMap, parallel};
use crate::render::SliceGeometry;
use crate::volume::{Grid, ScalarType, Volume};

/// The distance between the coordinate that a mode samples and the exact one, in voxels of the input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoordinateError {
    pub max: f64,
    /// Over the area of the slices, or the volume of the lattice.
    pub mean: f64,
    /// Places looked at.
    pub samples: usize,
}

/// Triangles that are looked at, at most.
const TRIANGLES: usize = 400_000;
/// Triangles of a piece of work.
const PIECE: usize = 4096;

/// Of slices: at the middle and the middles of the sides of (every n-th of) their triangles, which are where the error of
/// linear interpolation is largest.
pub fn slice_error(geometry: &SliceGeometry, map: &Prepared, grid: &Grid) -> CoordinateError {
    let stride = (geometry.indices.len() / 3).div_ceil(TRIANGLES).max(1);
    let triangles: Vec<&[u32]> = geometry.indices.chunks_exact(3).step_by(stride).collect();
    let (texture_from_world, size) = (grid.texture_from_world(), grid.size());
    let one = |triangle: &[u32]| {
        let corner = |i: usize| {
            let v = &geometry.vertices[triangle[i] as usize];
            let [p, front] = [v.position, v.front].map(|c| DVec3::from_array(c.map(f64::from)));
            (p + geometry.center, front)
        };
        let [a, b, c] = [corner(0), corner(1), corner(2)];
        let places = [
            ((a.0 + b.0 + c.0) / 3.0, (a.1 + b.1 + c.1) / 3.0),
            ((a.0 + b.0) / 2.0, (a.1 + b.1) / 2.0),
            ((b.0 + c.0) / 2.0, (b.1 + c.1) / 2.0),
            ((c.0 + a.0) / 2.0, (c.1 + a.1) / 2.0),
        ];
        let errors = places.map(|(p, front)| {
            let exact = texture_from_world.transform_point3(map.backward(p));
            ((front - exact) * size).length()
        });
        let area = (b.0 - a.0).cross(c.0 - a.0).length();
        (errors.iter().copied().fold(0.0, f64::max), area * errors.iter().sum::<f64>() / 4.0, area)
    };
    let parts = parallel::map(triangles.len().div_ceil(PIECE), &|piece| {
        let part = &triangles[piece * PIECE..triangles.len().min((piece + 1) * PIECE)];
        part.iter().map(|t| one(t)).fold((0.0, 0.0, 0.0), join)
    });
    let (max, sum, area) = parts.into_iter().fold((0.0, 0.0, 0.0), join);
    let mean = if area > 0.0 { sum / area } else { 0.0 };
    CoordinateError { max, mean, samples: 4 * triangles.len() }
}

fn join(a: (f64, f64, f64), b: (f64, f64, f64)) -> (f64, f64, f64) {
    (a.0.max(b.0), a.1 + b.1, a.2 + b.2)
}

/// The difference of two resampled volumes away from the border of the input, where one has a value and the other, a
/// hair's breadth further out, has none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interior {
    /// Voxels whose value comes from at least half a voxel within the outermost samples.
    pub voxels: u64,
    /// Root mean square and largest difference, as parts of the range of the input.
    pub rms: f64,
    pub max: f64,
    /// Part of the voxels that differ by more than 1/255 of the range (of integers, and by more than the one that rounding
    /// makes).
    pub above: f64,
}

/// One step of an 8-bit grey.
pub const STEP: f64 = 1.0 / 255.0;

/// Of volumes on the same grid; `range` of the input's real values.
pub fn interior(a: &Volume, b: &Volume, map: &Prepared, input: &Grid, range: f64) -> Interior {
    let [nx, ny, nz] = a.grid.dims;
    let to_voxel = input.voxel_from_world();
    let last = input.size() - 1.5;
    let slope = a.rescale.slope.abs() / range;
    let rounding = match a.samples.scalar_type() {
        ScalarType::F32 | ScalarType::F64 => 0.0,
        _ => slope * (1.0 + 1e-9),
    };
    let limit = STEP.max(rounding);
    let layers = parallel::map(nz, &|k| {
        let (mut voxels, mut sum, mut max, mut above) = (0u64, 0.0, 0.0f64, 0u64);
        for j in 0..ny {
            for i in 0..nx {
                let p = a.grid.world_from_voxel.transform_point3(DVec3::new(i as f64, j as f64, k as f64));
                let at = to_voxel.transform_point3(map.backward(p));
                if !(at.cmpge(DVec3::splat(0.5)).all() && at.cmple(last).all()) {
                    continue;
                }
                let first = a.index(i, j, k);
                let difference = |c: usize| (a.samples.get(first + c) - b.samples.get(first + c)).abs() * slope;
                let d = (0..a.channels).map(difference).fold(0.0, f64::max);
                voxels += 1;
                sum += d * d;
                max = max.max(d);
                above += u64::from(d > limit);
            }
        }
        (voxels, sum, max, above)
    });
    let all = layers.into_iter().fold((0, 0.0, 0.0f64, 0), |s, l| (s.0 + l.0, s.1 + l.1, s.2.max(l.2), s.3 + l.3));
    let count = (all.0 as f64).max(1.0);
    Interior { voxels: all.0, rms: (all.1 / count).sqrt(), max: all.2, above: all.3 as f64 / count }
}

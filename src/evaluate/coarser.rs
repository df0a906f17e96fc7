//! The same object at a lower resolution, for where the full one does not fit. Exports never use it.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::load::Object;
use crate::render::Field;
use crate::volume::{Grid, Scalar, Volume};
use crate::with_samples;

/// A volume whose voxels are the means of `factor` voxels along each axis; the last ones of those that are left. They lie where
/// what they stand for lies. Samples that are not numbers are left out.
pub fn coarser(volume: &Volume, factor: usize) -> Volume {
    let factor = factor.max(1);
    let size = volume.grid.dims;
    let dims = size.map(|n| n.div_ceil(factor));
    let f = factor as f64;
    // the middle of the first block of voxels
    let shift = DAffine3::from_translation(DVec3::splat(0.5 * (f - 1.0)));
    let world_from_voxel = volume.grid.world_from_voxel * shift * DAffine3::from_scale(DVec3::splat(f));
    let channels = volume.channels;
    let samples = with_samples!(&volume.samples, v => means(v, size, dims, channels, factor));
    Volume { grid: Grid { dims, world_from_voxel, ..volume.grid }, channels, samples, rescale: volume.rescale }
}

fn means<T: Scalar>(
    samples: &[T],
    [nx, ny, nz]: [usize; 3],
    dims: [usize; 3],
    channels: usize,
    factor: usize,
) -> crate::volume::Samples {
    let mut out = vec![T::from_f64(0.0); dims.iter().product::<usize>() * channels];
    out.par_chunks_mut(dims[0] * channels).enumerate().for_each(|(row, out)| {
        let (j, k) = (row % dims[1], row / dims[1]);
        for (n, value) in out.iter_mut().enumerate() {
            let (i, c) = (n / channels, n % channels);
            let (mut sum, mut count) = (0.0, 0.0);
            for z in k * factor..((k + 1) * factor).min(nz) {
                for y in j * factor..((j + 1) * factor).min(ny) {
                    for x in i * factor..((i + 1) * factor).min(nx) {
                        let v = samples[((z * ny + y) * nx + x) * channels + c].to_f64();
                        if v.is_finite() {
                            sum += v;
                            count += 1.0;
                        }
                    }
                }
            }
            *value = T::from_f64(if count > 0.0 { sum / count } else { 0.0 });
        }
    });
    T::wrap(out)
}

/// The object with another volume and its field, everything else as it was.
pub fn with_volume(object: &Object, volume: Arc<Volume>, field: Field) -> Object {
    Object { volume, field, ..object.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::Samples;

    #[test]
    fn what_is_coarser_lies_in_the_same_place() {
        let grid = Grid::new(
            [9, 6, 7],
            DAffine3::from_cols(
                DVec3::new(0.5, 0.1, 0.0),
                DVec3::new(0.0, 0.7, 0.2),
                DVec3::Z,
                DVec3::new(3.0, 4.0, 5.0),
            ),
            crate::volume::Space::Lps,
        )
        .unwrap();
        // a ramp in the world, and twice the same with another sign
        let ramp = |p: DVec3| p.dot(DVec3::new(2.0, -1.0, 0.5));
        let values = (0..9 * 6 * 7).flat_map(|i| {
            let p =
                grid.world_from_voxel.transform_point3(DVec3::new((i % 9) as f64, (i / 9 % 6) as f64, (i / 54) as f64));
            [ramp(p), -ramp(p)]
        });
        let volume = Volume::new(grid, 2, Samples::F64(values.collect()));
        let half = coarser(&volume, 2);
        assert_eq!((half.grid.dims, half.channels), ([5, 3, 4], 2));
        let Samples::F64(samples) = &half.samples else { panic!("another type") };
        for k in 0..3 {
            for j in 0..3 {
                for i in 0..4 {
                    let p = half.grid.world_from_voxel.transform_point3(DVec3::new(i as f64, j as f64, k as f64));
                    let at = ((k * 3 + j) * 5 + i) * 2;
                    assert!((samples[at] - ramp(p)).abs() < 1e-12 && (samples[at + 1] + ramp(p)).abs() < 1e-12);
                }
            }
        }
        assert_eq!(coarser(&volume, 1), volume);
    }

    #[test]
    fn nothing_comes_of_what_is_no_number() {
        let grid = Grid::new([4, 2, 2], DAffine3::IDENTITY, crate::volume::Space::Unknown).unwrap();
        let mut values = vec![3.0_f32; 16];
        values[0] = f32::NAN;
        values[1] = 5.0;
        let half = coarser(&Volume::new(grid, 1, Samples::F32(values)), 2);
        let Samples::F32(samples) = half.samples else { panic!("another type") };
        assert_eq!(samples.len(), 2);
        assert!((samples[0] - 23.0 / 7.0).abs() < 1e-6 && samples[1] == 3.0);
    }
}

//! The joint histogram of values and how steeply they change.
//!
//! Rows lie at the root of the steepness ([`height_of`]): then another window of values only stretches both axes, and the
//! histogram of the whole range does for all windows.

use super::transfer::height_of;
use super::{Scalar, Volume};
use crate::math::parallel;
use crate::with_samples;

/// Bins along the values.
pub const COLUMNS: usize = 256;
/// Bins along the steepness, of which the last begins just below 1: the range in one voxel.
pub const ROWS: usize = 128;

/// Voxels that are looked at, at most: of larger volumes every other row and layer, or fewer, is left out.
const MOST: usize = 1 << 24;

/// How often values meet steepness.
#[derive(Debug, Clone, PartialEq)]
pub struct JointHistogram {
    /// Real values at the ends of the first axis.
    pub range: [f64; 2],
    /// Rows of [`COLUMNS`], the flattest first; [`ROWS`] of them.
    pub counts: Vec<u64>,
}

/// The joint histogram of one channel: real values between the ends of `range`, and their steepness in parts of that range per
/// voxel, by differences over two voxels along each axis. What is no number or beyond the range is left out.
///
/// # Panics
/// If the volume has no such channel.
pub fn joint(volume: &Volume, channel: usize, range: [f64; 2]) -> JointHistogram {
    assert!(channel < volume.channels, "the volume has {} channels", volume.channels);
    let counts = with_samples!(&volume.samples, samples => count(samples, volume, channel, range));
    JointHistogram { range, counts }
}

fn count<T: Scalar>(samples: &[T], volume: &Volume, channel: usize, [lo, hi]: [f64; 2]) -> Vec<u64> {
    let [nx, ny, nz] = volume.grid.dims;
    let (rescale, channels) = (volume.rescale, volume.channels);
    let scale = if hi > lo { 1.0 / (hi - lo) } else { 0.0 };
    let step = (volume.grid.len() as f64 / MOST as f64).sqrt().ceil().max(1.0) as usize;
    let value = |i: usize| ((rescale.real(samples[i * channels + channel].to_f64()) - lo) * scale) as f32;
    let layers: Vec<usize> = (0..nz).step_by(step).collect();
    // so many that each thread has some, so few that their tables are small beside the samples
    let pieces = layers.len().min(16);
    let tables = parallel::map(pieces, &|piece| {
        let mut table = vec![0u64; COLUMNS * ROWS];
        for &z in layers.iter().skip(piece).step_by(pieces) {
            for y in (0..ny).step_by(step) {
                let row = (z * ny + y) * nx;
                // the same row one voxel to each side, at the edge itself
                let side =
                    |v: usize, n: usize, along: usize| (row - v.min(1) * along, row + usize::from(v + 1 < n) * along);
                let ((y0, y1), (z0, z1)) = (side(y, ny, nx), side(z, nz, nx * ny));
                for x in 0..nx {
                    let here = value(row + x);
                    let (before, after) = (row + x - x.min(1), row + x + usize::from(x + 1 < nx));
                    let d =
                        [value(after) - value(before), value(y1 + x) - value(y0 + x), value(z1 + x) - value(z0 + x)];
                    let steepness = 0.5 * d.iter().map(|d| d * d).sum::<f32>().sqrt();
                    if (0.0..=1.0).contains(&here) && steepness.is_finite() {
                        let column = ((here * COLUMNS as f32) as usize).min(COLUMNS - 1);
                        let row = ((height_of(steepness) * ROWS as f32) as usize).min(ROWS - 1);
                        table[row * COLUMNS + column] += 1;
                    }
                }
            }
        }
        table
    });
    let mut sums = vec![0; COLUMNS * ROWS];
    for table in tables {
        sums.iter_mut().zip(table).for_each(|(a, b)| *a += b);
    }
    sums
}

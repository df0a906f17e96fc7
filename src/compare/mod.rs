//! L2: how much two volumes or pictures differ.
//!
//! # Theory
//!
//! For samples a and b: root mean square error, largest difference, and the peak signal-to-noise ratio
//! `20 log10(peak / rmse)` in decibels, where `peak` is the range the values could span (255 for 8 bits).
//!
//! These say nothing about structure, so there is the structural similarity index as well (Wang, Bovik, Sheikh and
//! Simoncelli, "Image quality assessment: from error visibility to structural similarity", 2004):
//! `(2 ma mb + c1)(2 sab + c2) / ((ma^2 + mb^2 + c1)(sa^2 + sb^2 + c2))` with means, variances and covariance of a window and
//! `c1 = (0.01 peak)^2`, `c2 = (0.03 peak)^2`, averaged over all windows. Here the window is a box of 7 samples along each
//! axis (or the whole axis, if shorter) with equal weights and unbiased variances, as in scikit-image's default; only windows
//! that lie entirely inside count.
//!
//! # Practice
//!
//! Pure functions on slices of samples; any type that widens to `f64`. NaN at the same place in both is no difference; NaN
//! in one only makes RMSE and largest difference NaN. [`picture`] has the same for pictures, and draws where they differ.

pub mod colormap;
mod digits;
pub mod picture;

use crate::math::parallel;
use crate::volume::{Samples, Scalar, Volume};
use crate::with_samples;

/// Differences of two volumes or pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Root mean square, in the unit of the values.
    pub rmse: f64,
    /// Largest absolute difference.
    pub max: f64,
    /// In decibels; infinite if there is no difference.
    pub psnr: f64,
    /// Structural similarity, 1 if there is no difference.
    pub ssim: f64,
}

/// Why there is no comparison.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CompareError {
    #[error("{0} samples cannot be compared with {1}; both must have the same size and channels")]
    Size(usize, usize),
    #[error("{samples} samples do not fill {dims:?} with {channels} channels")]
    Shape { samples: usize, dims: [usize; 3], channels: usize },
    #[error("a peak value of {0} gives no signal-to-noise ratio; it must be positive")]
    Peak(f64),
}

/// Compares samples on a grid of `dims` (a picture has `dims[2] == 1`), x fastest, `channels` interleaved. `peak` is the range
/// the values could span.
///
/// # Errors
/// If the sizes do not agree, there are no samples, or the peak is not positive.
pub fn difference<A: Scalar, B: Scalar>(
    a: &[A],
    b: &[B],
    dims: [usize; 3],
    channels: usize,
    peak: f64,
) -> Result<Difference, CompareError> {
    if a.len() != b.len() {
        return Err(CompareError::Size(a.len(), b.len()));
    }
    let count = dims.iter().try_fold(channels, |n, d| n.checked_mul(*d));
    if a.is_empty() || count != Some(a.len()) {
        return Err(CompareError::Shape { samples: a.len(), dims, channels });
    }
    if !(peak > 0.0 && peak.is_finite()) {
        return Err(CompareError::Peak(peak));
    }
    let (rmse, max) = errors(a, b);
    let per_channel: f64 = (0..channels).map(|c| ssim(a, b, dims, channels, c, peak)).sum();
    Ok(Difference { rmse, max, psnr: 20.0 * (peak / rmse).log10(), ssim: per_channel / channels as f64 })
}

/// Compares the real values of two volumes of the same size; `peak` in real values.
///
/// # Errors
/// As [`difference`].
pub fn volumes(a: &Volume, b: &Volume, peak: f64) -> Result<Difference, CompareError> {
    if a.grid.dims != b.grid.dims || a.channels != b.channels {
        return Err(CompareError::Size(a.samples.len(), b.samples.len()));
    }
    let (dims, channels) = (a.grid.dims, a.channels);
    // the slope alone only scales differences; an intercept would shift the means of the similarity index
    if a.rescale == b.rescale && a.rescale.intercept == 0.0 && a.rescale.slope > 0.0 {
        let slope = a.rescale.slope;
        let stored = with_samples!(&a.samples, x => {
            same_type(x, &b.samples).map(|y| difference(x, y, dims, channels, peak / slope))
        });
        if let Some(stored) = stored {
            let stored = stored?;
            return Ok(Difference { rmse: slope * stored.rmse, max: slope * stored.max, ..stored });
        }
    }
    let real = |v: &Volume| -> Vec<f64> {
        with_samples!(&v.samples, s => s.iter().map(|x| v.rescale.real(x.to_f64())).collect())
    };
    difference(&real(a), &real(b), dims, channels, peak)
}

/// The samples, if they are of the type of the first argument.
fn same_type<'a, T: Scalar>(_: &[T], samples: &'a Samples) -> Option<&'a [T]> {
    (samples.scalar_type() == T::TYPE).then(|| bytemuck::cast_slice(samples.bytes()))
}

/// Samples of one parallel piece; sums are added in order, so that results do not depend on the number of threads.
const PIECE: usize = 1 << 16;

/// Root mean square and largest difference.
fn errors<A: Scalar, B: Scalar>(a: &[A], b: &[B]) -> (f64, f64) {
    let pieces = parallel::map(a.len().div_ceil(PIECE), &|piece| {
        let part = piece * PIECE..a.len().min((piece + 1) * PIECE);
        let (a, b) = (&a[part.clone()], &b[part]);
        let (mut sum, mut max) = (0.0, 0.0f64);
        for (x, y) in a.iter().zip(b) {
            let (x, y) = (x.to_f64(), y.to_f64());
            // infinities of one sign are equal too
            let d = if x == y || (x.is_nan() && y.is_nan()) { 0.0 } else { (x - y).abs() };
            sum += d * d;
            // unlike `f64::max`, this keeps NaN
            max = if d <= max || max.is_nan() { max } else { d };
        }
        (sum, max)
    });
    let (sum, max) = pieces
        .into_iter()
        .fold((0.0, 0.0f64), |(s, m), (sum, max)| (s + sum, if max <= m || m.is_nan() { m } else { max }));
    ((sum / a.len() as f64).sqrt(), max)
}

/// Edge of the window.
const WINDOW: usize = 7;

/// Sums over a window of a, b, a^2, b^2 and a b.
type Moments = [f64; 5];

/// Mean similarity of one channel. The window sums are made axis by axis, with a memory of as many layers as the window has.
fn ssim<A: Scalar, B: Scalar>(a: &[A], b: &[B], dims: [usize; 3], channels: usize, channel: usize, peak: f64) -> f64 {
    let window = dims.map(|n| n.min(WINDOW));
    let places: [usize; 3] = std::array::from_fn(|i| dims[i] - window[i] + 1);
    let count = window.iter().product::<usize>() as f64;
    // a window of one sample has no variance
    let unbiased = if count > 1.0 { count / (count - 1.0) } else { 0.0 };
    let (c1, c2) = ((0.01 * peak).powi(2), (0.03 * peak).powi(2));
    let value = |m: &Moments| {
        let [ma, mb, aa, bb, ab] = m.map(|s| s / count);
        let (va, vb, cov) = (unbiased * (aa - ma * ma), unbiased * (bb - mb * mb), unbiased * (ab - ma * mb));
        (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2))
    };
    // layer k, summed over the window along x and y
    let layer = |k: usize| -> Vec<Moments> {
        let rows: Vec<Vec<Moments>> = (0..dims[1])
            .map(|j| {
                let at = |i: usize| ((k * dims[1] + j) * dims[0] + i) * channels + channel;
                let line: Vec<Moments> = (0..dims[0])
                    .map(|i| {
                        let (x, y) = (a[at(i)].to_f64(), b[at(i)].to_f64());
                        [x, y, x * x, y * y, x * y]
                    })
                    .collect();
                line.windows(window[0]).map(total).collect()
            })
            .collect();
        let mut sums = Vec::with_capacity(places[0] * places[1]);
        for j in 0..places[1] {
            for i in 0..places[0] {
                let mut sum = [0.0; 5];
                for row in &rows[j..j + window[1]] {
                    add(&mut sum, &row[i]);
                }
                sums.push(sum);
            }
        }
        sums
    };
    // slabs of places; each needs the layers of its windows
    const SLAB: usize = 16;
    let slabs = parallel::map(places[2].div_ceil(SLAB), &|slab| {
        let from = slab * SLAB;
        let to = (from + SLAB).min(places[2]);
        let mut ring: std::collections::VecDeque<_> = (from..from + window[2] - 1).map(layer).collect();
        let mut sum = 0.0;
        for k in from..to {
            ring.push_back(layer(k + window[2] - 1));
            for place in 0..places[0] * places[1] {
                let mut m = [0.0; 5];
                ring.iter().for_each(|l| add(&mut m, &l[place]));
                sum += value(&m);
            }
            ring.pop_front();
        }
        sum
    });
    slabs.into_iter().sum::<f64>() / places.iter().product::<usize>() as f64
}

fn add(sum: &mut Moments, more: &Moments) {
    for (s, m) in sum.iter_mut().zip(more) {
        *s += m;
    }
}

fn total(window: &[Moments]) -> Moments {
    let mut sum = [0.0; 5];
    window.iter().for_each(|m| add(&mut sum, m));
    sum
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::volume::{Grid, Rescale};

    fn noise(n: usize, seed: u32) -> Vec<u8> {
        let mut s = seed;
        (0..n)
            .map(|_| {
                s = s.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (s >> 24) as u8
            })
            .collect()
    }

    #[test]
    fn no_difference() {
        let a = noise(20 * 12 * 9 * 2, 1);
        let d = difference(&a, &a, [20, 12, 9], 2, 255.0).unwrap();
        assert_eq!((d.rmse, d.max, d.psnr), (0.0, 0.0, f64::INFINITY));
        assert!((d.ssim - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_known_difference() {
        let a = vec![10u8; 64];
        let mut b = vec![10.0f32; 64];
        b[5] = 14.0;
        b[6] = 7.0;
        let d = difference(&a, &b, [8, 8, 1], 1, 255.0).unwrap();
        assert!((d.rmse - (25.0f64 / 64.0).sqrt()).abs() < 1e-12 && d.max == 4.0);
        assert!((d.psnr - 10.0 * (255.0f64 * 255.0 * 64.0 / 25.0).log10()).abs() < 1e-9);
        // constants: only the means differ
        let c = vec![30u8; 64];
        let d = difference(&a, &c, [8, 8, 1], 1, 255.0).unwrap();
        let c1 = (0.01f64 * 255.0).powi(2);
        assert!((d.ssim - (600.0 + c1) / (1000.0 + c1)).abs() < 1e-12);
    }

    /// The definition, window by window.
    fn plain_ssim(a: &[u8], b: &[u8], dims: [usize; 3], peak: f64) -> f64 {
        let w = dims.map(|n| n.min(7));
        let (mut sum, mut windows) = (0.0, 0.0);
        for z in 0..=dims[2] - w[2] {
            for y in 0..=dims[1] - w[1] {
                for x in 0..=dims[0] - w[0] {
                    let mut pairs = Vec::new();
                    for k in z..z + w[2] {
                        for j in y..y + w[1] {
                            for i in x..x + w[0] {
                                let at = (k * dims[1] + j) * dims[0] + i;
                                pairs.push((f64::from(a[at]), f64::from(b[at])));
                            }
                        }
                    }
                    let n = pairs.len() as f64;
                    let (ma, mb) =
                        (pairs.iter().map(|p| p.0).sum::<f64>() / n, pairs.iter().map(|p| p.1).sum::<f64>() / n);
                    let over = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / (n - 1.0);
                    let va = over(&|p| (p.0 - ma).powi(2));
                    let vb = over(&|p| (p.1 - mb).powi(2));
                    let cov = over(&|p| (p.0 - ma) * (p.1 - mb));
                    let (c1, c2) = ((0.01 * peak).powi(2), (0.03 * peak).powi(2));
                    sum += (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
                    windows += 1.0;
                }
            }
        }
        sum / windows
    }

    #[test]
    fn similarity_is_as_defined_for_pictures_and_volumes() {
        for dims in [[19, 11, 1], [12, 10, 25], [3, 40, 8], [1, 1, 9]] {
            let n = dims.iter().product();
            let (a, other) = (noise(n, 3), noise(n, 9));
            let b: Vec<u8> = a.iter().zip(&other).map(|(a, b)| a / 2 + b / 2).collect();
            let d = difference(&a, &b, dims, 1, 255.0).unwrap();
            assert!((d.ssim - plain_ssim(&a, &b, dims, 255.0)).abs() < 1e-9, "{dims:?}");
            assert!(d.ssim < 0.9);
        }
    }

    #[test]
    fn volumes_are_compared_as_real_values() {
        let grid = Grid::aligned([8, 8, 4], DVec3::ONE, DVec3::ZERO).unwrap();
        let mut a = Volume::new(grid, 1, Samples::U8(noise(256, 1)));
        let mut b = Volume::new(grid, 1, Samples::U8(noise(256, 2)));
        let plain = volumes(&a, &b, 255.0).unwrap();
        for intercept in [0.0, 1e-12] {
            a.rescale = Rescale { slope: 2.0, intercept };
            b.rescale = a.rescale;
            let scaled = volumes(&a, &b, 510.0).unwrap();
            assert!((scaled.rmse - 2.0 * plain.rmse).abs() < 1e-9 && (scaled.max - 2.0 * plain.max).abs() < 1e-9);
            assert!((scaled.psnr - plain.psnr).abs() < 1e-9 && (scaled.ssim - plain.ssim).abs() < 1e-9);
        }
    }

    #[test]
    fn nan_and_bad_sizes() {
        let same = [f32::NAN, 1.0, f32::INFINITY];
        assert_eq!(difference(&same, &same, [3, 1, 1], 1, 1.0).unwrap().rmse, 0.0);
        let d = difference(&same, &[0.0f32, 1.0, 2.0], [3, 1, 1], 1, 1.0).unwrap();
        assert!(d.rmse.is_nan() && d.max.is_nan());
        let a = [1u8, 2];
        assert_eq!(difference(&a, &a[..1], [2, 1, 1], 1, 1.0), Err(CompareError::Size(2, 1)));
        assert!(matches!(difference(&a, &a, [3, 1, 1], 1, 1.0), Err(CompareError::Shape { .. })));
        assert!(matches!(difference::<u8, u8>(&[], &[], [0, 1, 1], 1, 1.0), Err(CompareError::Shape { .. })));
        assert_eq!(difference(&a, &a, [2, 1, 1], 1, 0.0), Err(CompareError::Peak(0.0)));
    }
}

//! Minimum, maximum, mean and histogram of real values.
//!
//! Samples are taken in pieces of a fixed size that are summed in order, so that a result does not depend on the number of
//! threads. NaNs are counted and left out.

use super::{Rescale, Samples, Scalar, Volume};
use crate::math::{lanes, parallel};
use crate::with_samples;

/// Voxels in a piece: the sums of integers of up to 32 bits are exact in it.
const PIECE: usize = 1 << 16;

/// Facts of the real values (after slope and intercept) of a volume or of one of its channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Statistics {
    /// Smallest value; NaN if there is no value.
    pub min: f64,
    /// Largest value; NaN if there is no value.
    pub max: f64,
    /// NaN if there is no value, or infinities of both signs.
    pub mean: f64,
    /// Values that are numbers.
    pub count: u64,
    /// Values that are not.
    pub nan: u64,
}

/// Statistics of all channels together.
pub fn statistics(volume: &Volume) -> Statistics {
    finish(volume, with_samples!(&volume.samples, v => total(v, 1, 0)))
}

/// Statistics of all channels together of the values as stored, without slope and intercept.
pub fn stored_statistics(volume: &Volume) -> Statistics {
    with_samples!(&volume.samples, v => total(v, 1, 0))
}

/// Statistics of one channel.
///
/// # Panics
/// If the volume has no such channel.
pub fn channel_statistics(volume: &Volume, channel: usize) -> Statistics {
    assert!(channel < volume.channels, "the volume has {} channels", volume.channels);
    finish(volume, with_samples!(&volume.samples, v => total(v, volume.channels, channel)))
}

fn finish(volume: &Volume, stored: Statistics) -> Statistics {
    stored.rescaled(volume.rescale)
}

impl Statistics {
    /// Of the real values, from those of the stored ones.
    pub fn rescaled(self, rescale: Rescale) -> Self {
        let (a, b) = (rescale.real(self.min), rescale.real(self.max));
        // a negative slope turns the order round
        let (min, max) = if a > b { (b, a) } else { (a, b) };
        Self { min, max, mean: rescale.real(self.mean), ..self }
    }
}

/// Statistics of stored values: every `step`th, from `first`.
fn total<T: Summed>(samples: &[T], step: usize, first: usize) -> Statistics {
    let length = PIECE * step;
    let pieces = parallel::map(samples.len().div_ceil(length), &|i| {
        let piece = &samples[i * length..samples.len().min((i + 1) * length)];
        match step {
            1 => Part::of(piece),
            _ => Part::of(&piece[first..].iter().step_by(step).copied().collect::<Vec<T>>()),
        }
    });
    let mut all = Part::default();
    for p in &pieces {
        all.nan += p.nan;
        all.count += p.count;
        all.sum += p.sum;
        all.range = match (all.range, p.range) {
            (Some((a, b)), Some((c, d))) => Some((a.min(c), b.max(d))),
            (a, b) => a.or(b),
        };
    }
    let (min, max) = all.range.unwrap_or((f64::NAN, f64::NAN));
    // 0/0 is NaN, as promised
    Statistics { min, max, mean: all.sum / all.count as f64, count: all.count, nan: all.nan }
}

#[derive(Default)]
struct Part {
    range: Option<(f64, f64)>,
    sum: f64,
    count: u64,
    nan: u64,
}

impl Part {
    /// Of at most [`PIECE`] values.
    fn of<T: Summed>(values: &[T]) -> Self {
        lanes::dispatch(Take { values })
    }
}

/// Samples with a type in which [`PIECE`] of them can be summed: whole numbers without rounding, and in vector units.
trait Summed: Scalar {
    type Sum: Copy + Default + std::ops::AddAssign + std::iter::Sum;
    /// 0 for NaN.
    fn summand(self) -> Self::Sum;
    fn real(sum: Self::Sum) -> f64;
}

macro_rules! summed {
    ($($t:ident $sum:ident $summand:expr;)*) => {$(
        impl Summed for $t {
            type Sum = $sum;
            #[inline(always)]
            fn summand(self) -> $sum { $summand(self) }
            fn real(sum: $sum) -> f64 { sum as f64 }
        }
    )*};
}

summed! {
    u8 i32 i32::from;
    i8 i32 i32::from;
    u16 i32 i32::from;
    i16 i32 i32::from;
    u32 i64 i64::from;
    i32 i64 i64::from;
    f32 f64 |v: f32| if v.is_nan() { 0.0 } else { f64::from(v) };
    f64 f64 |v: f64| if v.is_nan() { 0.0 } else { v };
}

/// Values that are taken abreast, so that neither sums nor comparisons wait for each other. So many that the compiler keeps
/// the loop over them, which is the one for vector units.
const LANES: usize = 64;

struct Take<'a, T> {
    values: &'a [T],
}

impl<T: Summed> pulp::WithSimd for Take<'_, T> {
    type Output = Part;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> Part {
        let values = self.values;
        let is_number = |v: &T| v.partial_cmp(v).is_some();
        let Some(&first) = values.iter().find(|v| is_number(v)) else {
            return Part { nan: values.len() as u64, ..Part::default() };
        };
        let (mut lo, mut hi, mut sum, mut nan) =
            ([first; LANES], [first; LANES], [T::Sum::default(); LANES], [0u32; LANES]);
        let mut take = |lane: usize, v: T| {
            // comparisons with a NaN are false
            lo[lane] = if v < lo[lane] { v } else { lo[lane] };
            hi[lane] = if v > hi[lane] { v } else { hi[lane] };
            sum[lane] += v.summand();
            nan[lane] += u32::from(!is_number(&v));
        };
        let (abreast, rest) = values.as_chunks::<LANES>();
        rest.iter().enumerate().for_each(|(lane, v)| take(lane, *v));
        for row in abreast {
            (0..LANES).for_each(|lane| take(lane, row[lane]));
        }
        let lo = lo.into_iter().fold(first, |a, b| if b < a { b } else { a });
        let hi = hi.into_iter().fold(first, |a, b| if b > a { b } else { a });
        let nan = nan.iter().map(|n| u64::from(*n)).sum();
        let sum = T::real(sum.into_iter().sum());
        Part { range: Some((lo.to_f64(), hi.to_f64())), sum, count: values.len() as u64 - nan, nan }
    }
}

/// How often values fall into bins of equal width.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// Lower end of the first bin.
    pub lo: f64,
    /// Upper end of the last bin, which belongs to it.
    pub hi: f64,
    /// Values in each bin: `[lo + i w, lo + (i + 1) w)`.
    pub counts: Vec<u64>,
    /// Values below `lo`.
    pub below: u64,
    /// Values above `hi`.
    pub above: u64,
    pub nan: u64,
}

/// Histogram of the real values of one channel between `lo` and `hi`. Where `lo` equals `hi`, values of just that fall into
/// the first bin.
///
/// # Panics
/// If the volume has no such channel, `bins` is 0, or not `lo <= hi` with both finite: callers choose these.
pub fn histogram(volume: &Volume, channel: usize, lo: f64, hi: f64, bins: usize) -> Histogram {
    assert!(channel < volume.channels, "the volume has {} channels", volume.channels);
    assert!(bins > 0 && lo <= hi && lo.is_finite() && hi.is_finite(), "bad histogram {lo}..{hi} of {bins} bins");
    let scale = if hi > lo { bins as f64 / (hi - lo) } else { 0.0 };
    // of a stored value; behind the bins come: below, above, not a number
    let slot = |stored: f64| {
        let v = volume.rescale.real(stored);
        if v < lo {
            bins
        } else if v > hi {
            bins + 1
        } else if v.is_nan() {
            bins + 2
        } else {
            (((v - lo) * scale) as usize).min(bins - 1)
        }
    };
    let step = volume.channels;
    let mut counts = match &volume.samples {
        // few stored values: count those, and give each its bin once
        Samples::U8(v) => small(v, step, channel, bins, 256, |x| x as usize, |i| slot(i as f64)),
        Samples::I8(v) => small(v, step, channel, bins, 256, |x| (x as i16 + 128) as usize, |i| slot(i as f64 - 128.0)),
        Samples::U16(v) => small(v, step, channel, bins, 65536, |x| x as usize, |i| slot(i as f64)),
        Samples::I16(v) => {
            small(v, step, channel, bins, 65536, |x| (x as i32 + 32768) as usize, |i| slot(i as f64 - 32768.0))
        }
        other => with_samples!(other, v => count(v, step, channel, bins + 3, |x| slot(x.to_f64()))),
    };
    let (below, above, nan) = (counts[bins], counts[bins + 1], counts[bins + 2]);
    counts.truncate(bins);
    Histogram { lo, hi, counts, below, above, nan }
}

fn small<T: Scalar>(
    samples: &[T],
    step: usize,
    first: usize,
    bins: usize,
    values: usize,
    index: impl Fn(T) -> usize + Sync,
    slot: impl Fn(usize) -> usize,
) -> Vec<u64> {
    let mut out = vec![0; bins + 3];
    for (i, n) in count(samples, step, first, values, index).into_iter().enumerate() {
        if n > 0 {
            out[slot(i)] += n;
        }
    }
    out
}

/// Counts of `slots` kinds of every `step`th sample, from `first`.
fn count<T: Scalar>(
    samples: &[T],
    step: usize,
    first: usize,
    slots: usize,
    slot: impl Fn(T) -> usize + Sync,
) -> Vec<u64> {
    // pieces large enough that a table each is a small price
    let piece = (16 * slots).max(PIECE) * step;
    let tables = parallel::map(samples.len().div_ceil(piece), &|i| {
        let piece = &samples[i * piece..samples.len().min((i + 1) * piece)];
        let mut table = vec![0u64; slots];
        match step {
            1 => piece.iter().for_each(|&v| table[slot(v)] += 1),
            _ => piece[first..].iter().step_by(step).for_each(|&v| table[slot(v)] += 1),
        }
        table
    });
    let mut sums = vec![0; slots];
    for table in tables {
        sums.iter_mut().zip(table).for_each(|(a, b)| *a += b);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Grid, Rescale};
    use glam::DVec3;
    use proptest::prelude::*;

    fn line<T: Scalar>(values: Vec<T>, channels: usize) -> Volume {
        let grid = Grid::aligned([values.len() / channels, 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
        Volume::new(grid, channels, T::wrap(values))
    }

    #[test]
    fn nan_is_counted_and_left_out() {
        let v = line(vec![f32::NAN, 2.0, f32::NAN, -1.0, 5.0], 1);
        let s = statistics(&v);
        assert_eq!((s.min, s.max, s.mean, s.count, s.nan), (-1.0, 5.0, 2.0, 3, 2));
        let h = histogram(&v, 0, 0.0, 4.0, 4);
        assert_eq!((h.counts, h.below, h.above, h.nan), (vec![0, 0, 1, 0], 1, 1, 2));
        let nothing = statistics(&line(vec![f64::NAN; 3], 1));
        assert!(nothing.min.is_nan() && nothing.max.is_nan() && nothing.mean.is_nan());
        assert_eq!((nothing.count, nothing.nan), (0, 3));
    }

    #[test]
    fn a_negative_slope_turns_the_range_round() {
        let mut v = line(vec![0u8, 10, 20], 1);
        v.rescale = Rescale { slope: -2.0, intercept: 5.0 };
        let s = statistics(&v);
        assert_eq!((s.min, s.max, s.mean), (-35.0, 5.0, -15.0));
        let h = histogram(&v, 0, -35.0, 5.0, 2);
        assert_eq!(h.counts, [1, 2], "-15 is the lower end of the second bin; 5 belongs to the last");
    }

    #[test]
    fn the_extremes_of_every_integer_type() {
        assert_eq!(statistics(&line(vec![i32::MIN, i32::MAX], 1)).mean, -0.5);
        assert_eq!(statistics(&line(vec![u32::MAX; 3], 1)).mean, f64::from(u32::MAX));
        let s = statistics(&line(vec![i8::MIN, i8::MAX], 1));
        assert_eq!((s.min, s.max), (-128.0, 127.0));
        assert_eq!(histogram(&line(vec![i16::MIN, i16::MAX, 0], 1), 0, -32768.0, 32767.0, 2).counts, [1, 2]);
        let inf = statistics(&line(vec![f64::NEG_INFINITY, 1.0], 1));
        assert_eq!((inf.min, inf.max, inf.mean), (f64::NEG_INFINITY, 1.0, f64::NEG_INFINITY));
    }

    #[test]
    fn channels_apart() {
        let v = line(vec![1u16, 100, 3, 200, 5, 300], 2);
        let s = channel_statistics(&v, 1);
        assert_eq!((s.min, s.max, s.mean, s.count), (100.0, 300.0, 200.0, 3));
        assert_eq!(channel_statistics(&v, 0).mean, 3.0);
        assert_eq!(histogram(&v, 0, 1.0, 1.0, 3).counts, [1, 0, 0]);
    }

    #[test]
    fn the_same_on_any_number_of_threads() {
        let values: Vec<f32> = (0..300_001u32).map(|i| (i.wrapping_mul(2_654_435_761) as f32) * 1e-7).collect();
        let v = line(values, 1);
        let on = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| statistics(&v));
        let (one, four) = (on(1), on(4));
        assert_eq!(one.mean.to_bits(), four.mean.to_bits());
        assert_eq!((one.min, one.max), (four.min, four.max));
    }

    proptest! {
        #[test]
        fn agrees_with_the_definition(values in prop::collection::vec(-1e3f64..1e3, 1..400), bins in 1usize..40, slope in -3.0f64..3.0) {
            prop_assume!(slope != 0.0);
            let mut v = line(values.clone(), 1);
            v.rescale = Rescale { slope, intercept: 1.5 };
            let real: Vec<f64> = values.iter().map(|x| v.rescale.real(*x)).collect();
            let s = statistics(&v);
            prop_assert_eq!(s.min, real.iter().copied().fold(f64::INFINITY, f64::min));
            prop_assert_eq!(s.max, real.iter().copied().fold(f64::NEG_INFINITY, f64::max));
            let mean = real.iter().sum::<f64>() / real.len() as f64;
            prop_assert!((s.mean - mean).abs() < 1e-9);
            let h = histogram(&v, 0, -500.0, 700.0, bins);
            let width = 1200.0 / bins as f64;
            for (i, n) in h.counts.iter().enumerate() {
                let (a, b) = (-500.0 + i as f64 * width, -500.0 + (i + 1) as f64 * width);
                let inside = real.iter().filter(|x| **x > a + 1e-9 && **x < b - 1e-9).count() as u64;
                let touching = real.iter().filter(|x| **x >= a - 1e-9 && **x <= b + 1e-9).count() as u64;
                prop_assert!((inside..=touching).contains(n));
            }
            prop_assert_eq!(h.counts.iter().sum::<u64>() + h.below + h.above, real.len() as u64);
        }
    }
}

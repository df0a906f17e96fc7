//! Which values occur in a volume, and what its sample type can hold.

use std::collections::HashSet;

use crate::volume::{Samples, Scalar, ScalarType, Volume};
use crate::with_samples;

/// A volume of integers with no more values than this, most of which are those of their neighbours, is taken for labels.
const FEW: usize = 64;
const EQUAL: f64 = 0.8;
/// More different values are not gathered.
const MOST: usize = 1 << 20;

/// The values that occur, as bits of `f64`.
pub(super) struct Values {
    set: HashSet<u64>,
}

impl Values {
    /// Of a scalar volume; `None` if there are too many.
    pub fn of(volume: &Volume) -> Option<Self> {
        fn gather<T: Scalar>(samples: &[T]) -> Option<HashSet<u64>> {
            let mut set = HashSet::new();
            let mut last = None;
            for v in samples {
                let bits = v.to_f64().to_bits();
                // neighbours are often equal
                if last != Some(bits) && set.insert(bits) && set.len() > MOST {
                    return None;
                }
                last = Some(bits);
            }
            Some(set)
        }
        with_samples!(&volume.samples, v => gather(v)).map(|set| Self { set })
    }

    pub fn len(&self) -> usize {
        self.set.len()
    }

    pub fn has(&self, v: f64) -> bool {
        self.set.contains(&v.to_bits())
    }

    /// Whether the volume they are from looks like labels.
    pub fn are_labels(&self, volume: &Volume) -> bool {
        fn equal<T: Scalar>(samples: &[T], dims: [usize; 3]) -> f64 {
            let [nx, ny, _] = dims;
            let pairs = |step: usize| samples.iter().zip(samples.iter().skip(step));
            let (mut same, mut all) = (0, 0);
            for step in [1, nx, nx * ny] {
                same += pairs(step).filter(|(a, b)| a == b).count();
                all += pairs(step).len();
            }
            same as f64 / all.max(1) as f64
        }
        let whole = !matches!(volume.samples.scalar_type(), ScalarType::F32 | ScalarType::F64);
        whole && self.len() <= FEW && with_samples!(&volume.samples, v => equal(v, volume.grid.dims)) >= EQUAL
    }

    /// Those that `other` does not have, in rising order.
    pub fn beyond(&self, other: &Self) -> Vec<f64> {
        let mut found: Vec<f64> = self.set.difference(&other.set).map(|bits| f64::from_bits(*bits)).collect();
        found.sort_by(f64::total_cmp);
        found
    }
}

/// What a sample type can hold.
#[derive(Debug, Clone, Copy)]
pub(super) struct Range {
    lo: f64,
    hi: f64,
    whole: bool,
}

impl Range {
    pub fn of(samples: &Samples) -> Self {
        fn ends<T: Scalar>(_: &[T]) -> [f64; 2] {
            [-f64::MAX, f64::MAX].map(|v| T::from_f64(v).to_f64())
        }
        let [lo, hi] = with_samples!(samples, v => ends(v));
        match samples.scalar_type() {
            ScalarType::F32 => Self { lo: f32::MIN.into(), hi: f32::MAX.into(), whole: false },
            ScalarType::F64 => Self { lo, hi, whole: false },
            // what rounds to the ends is held
            _ => Self { lo: lo - 0.5, hi: hi + 0.5, whole: true },
        }
    }

    /// The value as it is stored.
    pub fn stored(&self, v: f64) -> f64 {
        match self.whole {
            true if v.is_nan() => 0.0,
            true => v.round().clamp(self.lo + 0.5, self.hi - 0.5),
            false if self.hi <= f32::MAX.into() => f64::from(v as f32),
            false => v,
        }
    }

    /// Whether a value is changed by more than rounding when it is stored.
    pub fn clips(&self, v: f64) -> bool {
        if v.is_nan() { self.whole } else { v < self.lo || v > self.hi }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_those_of_the_types() {
        let clips = |s: Samples, v: f64| Range::of(&s).clips(v);
        for (v, want) in [(-0.4, false), (-0.6, true), (255.4, false), (255.6, true), (f64::NAN, true)] {
            assert_eq!(clips(Samples::U8(vec![]), v), want, "{v}");
        }
        assert!(clips(Samples::I16(vec![]), 40000.0) && !clips(Samples::I16(vec![]), -32768.0));
        assert!(clips(Samples::F32(vec![]), 1e39) && !clips(Samples::F32(vec![]), 1e38));
        assert!(!clips(Samples::F32(vec![]), f64::NAN) && !clips(Samples::F64(vec![]), 1e300));
        let stored = |s: Samples, v: f64| Range::of(&s).stored(v);
        assert_eq!([-3.0, 7.4, 300.0, f64::NAN].map(|v| stored(Samples::U8(vec![]), v)), [0.0, 7.0, 255.0, 0.0]);
        assert_eq!(stored(Samples::F32(vec![]), 0.1), f64::from(0.1f32));
        assert_eq!(stored(Samples::F64(vec![]), 0.1), 0.1);
    }
}

//! Extremes and sum of a volume, in one pass.

use rayon::prelude::*;

use crate::volume::{Rescale, Scalar};

/// Facts of all finite samples of a volume, all channels together, as real values (after slope and intercept).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Statistics {
    /// `None` if no sample is finite.
    pub range: Option<(f64, f64)>,
    /// Sum of the values times the volume of a voxel (world units cubed).
    pub mass: f64,
    /// NaN and infinite samples, left out above.
    pub not_finite: u64,
}

/// Lowest, highest, sum and number of the finite samples, as stored.
#[derive(Clone, Copy)]
pub(super) struct Partial {
    pub lo: f64,
    pub hi: f64,
    sum: f64,
    pub count: u64,
}

const NOTHING: Partial = Partial { lo: f64::INFINITY, hi: f64::NEG_INFINITY, sum: 0.0, count: 0 };

impl Partial {
    fn join(self, other: Self) -> Self {
        Self {
            lo: self.lo.min(other.lo),
            hi: self.hi.max(other.hi),
            sum: self.sum + other.sum,
            count: self.count + other.count,
        }
    }
}

/// Samples of one parallel piece; fixed, so that the sum does not depend on the number of threads.
const PIECE: usize = 1 << 16;

/// One pass over all samples. The sum is the same on any number of threads.
pub(super) fn stored<T: Scalar>(samples: &[T]) -> Partial {
    // collected in order, so that it is always added up the same way
    let partial: Vec<Partial> = samples.par_chunks(PIECE).map(piece).collect();
    partial.into_iter().fold(NOTHING, Partial::join)
}

fn piece<T: Scalar>(samples: &[T]) -> Partial {
    const W: usize = 8;
    let (mut lo, mut hi, mut sum, mut count) = ([f64::INFINITY; W], [f64::NEG_INFINITY; W], [0.0; W], [0u32; W]);
    let mut eat = |i: usize, v: T| {
        let v = v.to_f64();
        let finite = v.abs() < f64::INFINITY;
        let (l, h, s) = if finite { (v, v, v) } else { (f64::INFINITY, f64::NEG_INFINITY, 0.0) };
        lo[i] = if l < lo[i] { l } else { lo[i] };
        hi[i] = if h > hi[i] { h } else { hi[i] };
        sum[i] += s;
        count[i] += u32::from(finite);
    };
    let chunks = samples.chunks_exact(W);
    let rest = chunks.remainder();
    for chunk in chunks {
        for (i, &v) in chunk.iter().enumerate() {
            eat(i, v);
        }
    }
    for (i, &v) in rest.iter().enumerate() {
        eat(i, v);
    }
    let one = |i: usize| Partial { lo: lo[i], hi: hi[i], sum: sum[i], count: u64::from(count[i]) };
    (0..W).map(one).fold(NOTHING, Partial::join)
}

impl Statistics {
    /// Of a volume of `samples` samples; `voxel` is the volume of a voxel.
    pub(super) fn new(p: Partial, samples: usize, rescale: Rescale, voxel: f64) -> Self {
        let (a, b) = (rescale.real(p.lo), rescale.real(p.hi));
        Self {
            range: (p.count > 0).then(|| (a.min(b), a.max(b))),
            mass: (rescale.slope * p.sum + rescale.intercept * p.count as f64) * voxel,
            not_finite: samples as u64 - p.count,
        }
    }
}

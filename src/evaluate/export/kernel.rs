//! Trilinear look-ups for a row of voxels at a time.
//!
//! A row is worked off in three passes over small arrays: whole and fractional parts of the coordinates, the eight samples
//! of each voxel, their blend. The first and the last are plain loops over arrays of one type, which the compiler turns into
//! vector code, once for any processor and once for those with AVX2 (chosen at run time); only the middle one, which no
//! vector unit without gather can do, goes voxel by voxel.
//!
//! Coordinates are `f32` relative to a whole voxel near the row, so that their rounding stays some 1e-6 of a voxel.

use glam::DVec3;

use crate::volume::fetch::{Blend, Fetch};
use crate::volume::sampling::Sampler;

/// Voxels of a row worked off together.
pub(super) const ROW: usize = 32;

/// The samples as seen from a whole voxel, `base`.
pub(super) struct Window<'a, T> {
    sampler: Sampler<'a, T>,
    /// Index of the first channel of voxel `base`; wraps if `base` is not a voxel.
    start: usize,
    /// Samples from a voxel to the next along i, j and k.
    stride: [usize; 3],
    /// Relative coordinates of the first and the last voxel centre.
    first: [f32; 3],
    last: [f32; 3],
    /// The same as whole numbers.
    first_whole: [i32; 3],
    last_whole: [i32; 3],
}

/// The arrays of one row.
pub(super) struct Scratch<T> {
    fraction: [[f32; ROW]; 3],
    whole: [[i32; ROW]; 3],
    /// Index of the lowest of the eight samples.
    lowest: [usize; ROW],
    /// Neighbours along i, for each of the four lines through the eight samples.
    pair: [[[T; 2]; ROW]; 4],
}

impl<T: Fetch> Scratch<T> {
    pub fn new() -> Self {
        Self { fraction: [[0.0; ROW]; 3], whole: [[0; ROW]; 3], lowest: [0; ROW], pair: [[[T::zeroed(); 2]; ROW]; 4] }
    }
}

/// Samples this far beyond the volume are outside, however large their coordinates.
const BEYOND: i64 = 1 << 16;

impl<'a, T: Fetch> Window<'a, T> {
    /// About the voxel nearest to `base` that is not far from the volume.
    pub fn new(sampler: Sampler<'a, T>, base: DVec3) -> Self {
        let (dims, channels) = (sampler.dims().map(|n| n as i64), sampler.channels());
        // NaN becomes 0
        let base: [i64; 3] = std::array::from_fn(|a| (base[a] as i64).clamp(-BEYOND, dims[a] + BEYOND));
        let stride = [channels, sampler.dims()[0] * channels, sampler.dims()[0] * sampler.dims()[1] * channels];
        let start = (0..3).fold(0usize, |at, a| at.wrapping_add((base[a] as usize).wrapping_mul(stride[a])));
        let narrow = |v: i64| v.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
        let first_whole = base.map(|b| narrow(-b));
        let last_whole = std::array::from_fn(|a| narrow(dims[a] - 1 - base[a]));
        let (first, last) = (first_whole.map(|w| w as f32), last_whole.map(|w| w as f32));
        Self { sampler, start, stride, first, last, first_whole, last_whole }
    }

    /// What coordinates are relative to.
    pub fn base(&self) -> DVec3 {
        DVec3::from(self.first_whole.map(|w| -f64::from(w)))
    }

    /// Trilinear samples at the relative coordinates `at` into `out` (channels interleaved); `outside` beyond the texture
    /// cube. Returns how many were outside.
    pub fn linear(&self, at: &[[f32; ROW]; 3], outside: &[T], scratch: &mut Scratch<T>, out: &mut [T]) -> usize {
        pulp::Arch::new().dispatch(Linear { window: self, at, outside, scratch, out })
    }

    /// Whether all points have both neighbours along each axis.
    #[inline(always)]
    fn interior(&self, at: &[[f32; ROW]; 3]) -> bool {
        let mut out = 0;
        for a in 0..3 {
            let (first, last) = (self.first[a], self.last[a]);
            for x in &at[a] {
                out |= i32::from(!((*x >= first) & (*x < last)));
            }
        }
        out == 0
    }

    /// Indices of the lowest of the eight samples around each point.
    #[inline(always)]
    fn indices(&self, channel: usize, scratch: &mut Scratch<T>) {
        let Scratch { whole: [x, y, z], lowest, .. } = scratch;
        let start = self.start.wrapping_add(channel);
        if self.sampler.samples().len() < i32::MAX as usize {
            let stride = self.stride.map(|s| s as i32);
            for l in 0..ROW {
                let (x, y, z) =
                    (x[l].wrapping_mul(stride[0]), y[l].wrapping_mul(stride[1]), z[l].wrapping_mul(stride[2]));
                let at = (start as i32).wrapping_add(x).wrapping_add(y).wrapping_add(z);
                lowest[l] = at as u32 as usize;
            }
        } else {
            for l in 0..ROW {
                let part = |whole: i32, a: usize| (whole as isize as usize).wrapping_mul(self.stride[a]);
                lowest[l] = start.wrapping_add(part(x[l], 0)).wrapping_add(part(y[l], 1)).wrapping_add(part(z[l], 2));
            }
        }
    }

    /// The eight samples around each point. All of them exist.
    #[inline(always)]
    fn gather(&self, count: usize, scratch: &mut Scratch<T>) {
        let [sx, sy, sz] = self.stride;
        let samples = self.sampler.samples();
        let Scratch { lowest, pair: [p00, p10, p01, p11], .. } = scratch;
        let reach = sy + sz + sx + 1;
        for l in 0..count.min(ROW) {
            // the last channel of the last sample ends the slice
            let around = &samples[lowest[l]..][..reach];
            if sx == 1 {
                // two samples at a time
                p00[l].copy_from_slice(&around[..2]);
                p10[l].copy_from_slice(&around[sy..sy + 2]);
                p01[l].copy_from_slice(&around[sz..sz + 2]);
                p11[l].copy_from_slice(&around[sy + sz..sy + sz + 2]);
            } else {
                p00[l] = [around[0], around[sx]];
                p10[l] = [around[sy], around[sy + sx]];
                p01[l] = [around[sz], around[sz + sx]];
                p11[l] = [around[sy + sz], around[sy + sz + sx]];
            }
        }
    }

    /// The same where the upper neighbour may be missing and is then the voxel itself.
    #[inline(always)]
    fn gather_clamped(&self, count: usize, scratch: &mut Scratch<T>) {
        let samples = self.sampler.samples();
        let Scratch { whole, lowest, pair, .. } = scratch;
        for l in 0..count.min(ROW) {
            let up = |a: usize| if whole[a][l] < self.last_whole[a] { self.stride[a] } else { 0 };
            let (at, [x, y, z]) = (lowest[l], [up(0), up(1), up(2)]);
            for (line, pair) in [0, y, z, y + z].into_iter().zip(pair.iter_mut()) {
                pair[l] = [samples[at + line], samples[at + line + x]];
            }
        }
    }
}

/// One row of look-ups.
struct Linear<'a, 'b, T> {
    window: &'a Window<'b, T>,
    at: &'a [[f32; ROW]; 3],
    outside: &'a [T],
    scratch: &'a mut Scratch<T>,
    out: &'a mut [T],
}

impl<T: Fetch> pulp::WithSimd for Linear<'_, '_, T> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> usize {
        let Self { window, at, outside, scratch, out } = self;
        let channels = window.sampler.channels();
        let count = out.len() / channels;
        if window.interior(at) {
            for a in 0..3 {
                split(&at[a], &mut scratch.whole[a], &mut scratch.fraction[a]);
            }
            for c in 0..channels {
                window.indices(c, scratch);
                window.gather(count, scratch);
                blend(scratch, c, channels, out);
            }
            return 0;
        }
        let mut missed = [0i32; ROW];
        for a in 0..3 {
            let (first, last) = (window.first[a], window.last[a]);
            let mut clamped = [0.0; ROW];
            for l in 0..ROW {
                let x = at[a][l];
                missed[l] |= i32::from(!((x >= first - 0.5) & (x <= last + 0.5)));
                // NaN becomes the first
                let x = if x > first { x } else { first };
                clamped[l] = if x < last { x } else { last };
            }
            split(&clamped, &mut scratch.whole[a], &mut scratch.fraction[a]);
            for whole in &mut scratch.whole[a] {
                // beyond 2^24 voxels the numbers in `f32` are not exact
                *whole = (*whole).max(window.first_whole[a]).min(window.last_whole[a]);
            }
        }
        let outsiders = missed[..count].iter().sum::<i32>() as usize;
        if outsiders < count {
            for c in 0..channels {
                window.indices(c, scratch);
                window.gather_clamped(count, scratch);
                blend(scratch, c, channels, out);
            }
        }
        if outsiders > 0 {
            for (voxel, _) in out.chunks_exact_mut(channels).zip(missed).filter(|(_, missed)| *missed != 0) {
                voxel.copy_from_slice(outside);
            }
        }
        outsiders
    }
}

/// Whole and fractional parts. Not `floor`, which is a call per number where the vector unit lacks it.
#[inline(always)]
fn split(x: &[f32; ROW], whole: &mut [i32; ROW], fraction: &mut [f32; ROW]) {
    for l in 0..ROW {
        let toward_zero = x[l] as i32;
        let w = toward_zero - i32::from(toward_zero as f32 > x[l]);
        whole[l] = w;
        fraction[l] = x[l] - w as f32;
    }
}

#[inline(always)]
fn blend<T: Fetch>(scratch: &Scratch<T>, channel: usize, channels: usize, out: &mut [T]) {
    let mut row = [T::zeroed(); ROW];
    let Scratch { fraction: [fx, fy, fz], pair, .. } = scratch;
    let mix = |a: T::Wide, b: T::Wide, t: f32| {
        let mixed = T::Wide::blend(a, b, t);
        if T::SPECIAL && t == 0.0 { a } else { mixed }
    };
    for l in 0..ROW {
        let line = |n: usize| mix(pair[n][l][0].wide(), pair[n][l][1].wide(), fx[l]);
        row[l] = T::narrow(mix(mix(line(0), line(1), fy[l]), mix(line(2), line(3), fy[l]), fz[l]));
    }
    if channels == 1 {
        let count = out.len().min(ROW);
        out[..count].copy_from_slice(&row[..count]);
    } else {
        for (voxel, v) in out.chunks_exact_mut(channels).zip(row) {
            voxel[channel] = v;
        }
    }
}

/// A row of coordinates: from `start` in equal steps, plus displacements.
pub(super) struct Line<'a> {
    pub start: [f32; 3],
    pub step: [f32; 3],
    pub shift: Option<&'a [[f32; ROW]; 3]>,
    /// Those of the row that count; the others repeat the last of them, so that the row does not seem to leave the volume.
    pub count: usize,
    /// The displacement from which a voxel counts as moved.
    pub threshold: f32,
    pub at: &'a mut [[f32; ROW]; 3],
}

impl Line<'_> {
    /// Fills `at`. Returns how many were moved.
    pub fn fill(self) -> u64 {
        pulp::Arch::new().dispatch(self)
    }
}

impl pulp::WithSimd for Line<'_> {
    type Output = u64;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> u64 {
        let Self { start, step, shift, count, threshold, at } = self;
        let mut far = [0u32; ROW];
        for a in 0..3 {
            for (l, x) in at[a].iter_mut().enumerate() {
                *x = start[a] + step[a] * l as f32;
            }
            if let Some(shift) = shift {
                for ((x, s), far) in at[a].iter_mut().zip(&shift[a]).zip(&mut far) {
                    *x += s;
                    // NaN counts as moved
                    *far |= u32::from(!(s.abs() <= threshold));
                }
            }
            if count < ROW {
                let last = at[a][count - 1];
                at[a][count..].fill(last);
                far[count..].fill(0);
            }
        }
        u64::from(far.iter().sum::<u32>())
    }
}

//! Trilinear look-ups for a row of voxels at a time.
//!
//! A row is worked off in three passes over small arrays: whole and fractional parts of the coordinates, the eight samples
//! of each voxel, their blend. The first and the last are plain loops over arrays of one type, which the compiler turns into
//! vector code; only the middle one, which no vector unit without gather can do, goes voxel by voxel.
//!
//! Coordinates are `f32` relative to a whole voxel near the row, so that their rounding stays some 1e-6 of a voxel.

use crate::volume::{Scalar, sampling::Sampler};

/// Voxels of a row worked off together.
pub(super) const ROW: usize = 32;

/// A number that samples are blended in: wide enough that blending with weights 0 and 1 gives every sample back.
pub trait Blend: Copy + Default + Send + Sync {
    /// `a + t (b - a)`.
    fn blend(a: Self, b: Self, t: f32) -> Self;
}

impl Blend for f32 {
    #[inline(always)]
    fn blend(a: Self, b: Self, t: f32) -> Self {
        a + t * (b - a)
    }
}

impl Blend for f64 {
    #[inline(always)]
    fn blend(a: Self, b: Self, t: f32) -> Self {
        a + f64::from(t) * (b - a)
    }
}

/// How a sample type is blended in the fast look-up.
pub trait Fetch: Scalar {
    type Wide: Blend;
    /// Whether samples may be NaN or infinite, so that a weight of zero does not silence them.
    const SPECIAL: bool;
    fn wide(self) -> Self::Wide;
    /// Rounds to nearest, halves away from zero, and clamps.
    fn narrow(v: Self::Wide) -> Self;
}

macro_rules! fetch {
    ($($t:ident $wide:ident $special:literal $narrow:expr;)*) => {$(
        impl Fetch for $t {
            type Wide = $wide;
            const SPECIAL: bool = $special;
            #[inline(always)]
            fn wide(self) -> $wide { self as $wide }
            #[inline(always)]
            fn narrow(v: $wide) -> Self { $narrow(v) }
        }
    )*};
}

// adding a half and truncating is vector code everywhere, `round` is not
fetch! {
    u8 f32 false |v: f32| (v + 0.5) as u8;
    i8 f32 false |v: f32| (v + 0.5f32.copysign(v)) as i8;
    u16 f32 false |v: f32| (v + 0.5) as u16;
    i16 f32 false |v: f32| (v + 0.5f32.copysign(v)) as i16;
    u32 f64 false |v: f64| (v + 0.5) as u32;
    i32 f64 false |v: f64| (v + 0.5f64.copysign(v)) as i32;
    f32 f32 true |v: f32| v;
    f64 f64 true |v: f64| v;
}

/// The samples as seen from a whole voxel, `base`.
pub(super) struct Window<'a, T> {
    sampler: Sampler<'a, T>,
    /// Index of the first channel of voxel `base`; wraps if `base` is not a voxel.
    start: usize,
    /// Samples from a voxel to the next along j and k.
    stride: [usize; 2],
    /// Relative coordinates of the first and the last voxel centre.
    first: [f32; 3],
    last: [f32; 3],
}

/// The arrays of one row.
pub(super) struct Scratch<T> {
    fraction: [[f32; ROW]; 3],
    whole: [[i32; ROW]; 3],
    corner: [[T; ROW]; 8],
}

impl<T: Fetch> Scratch<T> {
    pub fn new() -> Self {
        Self { fraction: [[0.0; ROW]; 3], whole: [[0; ROW]; 3], corner: [[T::zeroed(); ROW]; 8] }
    }
}

impl<'a, T: Fetch> Window<'a, T> {
    pub fn new(sampler: Sampler<'a, T>, base: [i64; 3]) -> Self {
        let dims = sampler.dims();
        let channels = sampler.channels();
        let stride = [dims[0] * channels, dims[0] * dims[1] * channels];
        let start = (base[2] as usize)
            .wrapping_mul(stride[1])
            .wrapping_add((base[1] as usize).wrapping_mul(stride[0]))
            .wrapping_add((base[0] as usize).wrapping_mul(channels));
        let first = base.map(|b| -b as f32);
        let last = std::array::from_fn(|a| (dims[a] as i64 - 1 - base[a]) as f32);
        Self { sampler, start, stride, first, last }
    }

    /// Trilinear samples at the relative coordinates `at` into `out` (channels interleaved); `outside` beyond the texture
    /// cube. Returns how many were outside.
    #[inline(always)]
    pub fn linear(&self, at: [&[f32; ROW]; 3], outside: &[T], scratch: &mut Scratch<T>, out: &mut [T]) -> usize {
        let channels = self.sampler.channels();
        let count = out.len() / channels;
        for a in 0..3 {
            split(at[a], &mut scratch.whole[a], &mut scratch.fraction[a]);
        }
        if self.interior(at) {
            for c in 0..channels {
                self.gather(count, c, scratch);
                blend(scratch, c, channels, out);
            }
            return 0;
        }
        let mut missed = [false; ROW];
        for l in 0..count {
            missed[l] = (0..3).any(|a| !(at[a][l] >= self.first[a] - 0.5 && at[a][l] <= self.last[a] + 0.5));
            for a in 0..3 {
                let x = at[a][l].max(self.first[a]).min(self.last[a]);
                let whole = x.floor();
                scratch.whole[a][l] = whole as i32;
                scratch.fraction[a][l] = x - whole;
            }
        }
        for c in 0..channels {
            self.gather_clamped(count, c, scratch);
            blend(scratch, c, channels, out);
        }
        let mut outsiders = 0;
        for (voxel, _) in out.chunks_exact_mut(channels).zip(missed).filter(|(_, missed)| *missed) {
            voxel.copy_from_slice(outside);
            outsiders += 1;
        }
        outsiders
    }

    /// Whether all points have both neighbours along each axis.
    #[inline(always)]
    fn interior(&self, at: [&[f32; ROW]; 3]) -> bool {
        let mut all = true;
        for a in 0..3 {
            let (first, last) = (self.first[a], self.last[a]);
            for x in at[a] {
                all &= (*x >= first) & (*x < last);
            }
        }
        all
    }

    /// The eight samples around each point. All of them exist.
    #[inline(always)]
    fn gather(&self, count: usize, channel: usize, scratch: &mut Scratch<T>) {
        let channels = self.sampler.channels();
        let [sy, sz] = self.stride;
        let reach = channels + sy + sz + 1;
        // with these, the constant offsets below need no check per voxel
        assert!(channels + sy < reach && channels + sz < reach && sy + sz < reach && sy < reach && sz < reach);
        let samples = &self.sampler.samples()[channel..];
        let start = self.start;
        let [x, y, z] = &scratch.whole;
        let corner = &mut scratch.corner;
        for l in 0..count.min(ROW) {
            let at = start
                .wrapping_add((x[l] as usize).wrapping_mul(channels))
                .wrapping_add((y[l] as usize).wrapping_mul(sy))
                .wrapping_add((z[l] as usize).wrapping_mul(sz));
            // the last channel of the last sample ends the slice
            let around = &samples[at..][..reach];
            corner[0][l] = around[0];
            corner[1][l] = around[channels];
            corner[2][l] = around[sy];
            corner[3][l] = around[sy + channels];
            corner[4][l] = around[sz];
            corner[5][l] = around[sz + channels];
            corner[6][l] = around[sz + sy];
            corner[7][l] = around[sz + sy + channels];
        }
    }

    /// The same where the upper neighbour may be missing and is then the voxel itself.
    fn gather_clamped(&self, count: usize, channel: usize, scratch: &mut Scratch<T>) {
        let samples = self.sampler.samples();
        let step = [self.sampler.channels(), self.stride[0], self.stride[1]];
        for l in 0..count {
            let mut at = self.start.wrapping_add(channel);
            let mut up = [0; 3];
            for a in 0..3 {
                let whole = scratch.whole[a][l];
                at = at.wrapping_add((whole as isize as usize).wrapping_mul(step[a]));
                up[a] = if (whole as f32) < self.last[a] { step[a] } else { 0 };
            }
            for (n, corner) in scratch.corner.iter_mut().enumerate() {
                corner[l] = samples[at + (n & 1) * up[0] + (n >> 1 & 1) * up[1] + (n >> 2 & 1) * up[2]];
            }
        }
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
    let [fx, fy, fz] = &scratch.fraction;
    let corner = &scratch.corner;
    let mix = |a: T::Wide, b: T::Wide, t: f32| {
        let mixed = T::Wide::blend(a, b, t);
        if T::SPECIAL && t == 0.0 { a } else { mixed }
    };
    for l in 0..ROW {
        let v = |n: usize| corner[n][l].wide();
        let (x, y, z) = (fx[l], fy[l], fz[l]);
        let y0 = mix(mix(v(0), v(1), x), mix(v(2), v(3), x), y);
        let y1 = mix(mix(v(4), v(5), x), mix(v(6), v(7), x), y);
        row[l] = T::narrow(mix(y0, y1, z));
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

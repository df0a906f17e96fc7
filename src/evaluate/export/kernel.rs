//! Trilinear look-ups for some rows of voxels at a time.
//!
//! Points come in blocks of two rows. A block is worked off in passes over small arrays: whole and fractional parts of the coordinates, the eight
//! samples of each voxel, their blend. All but the gathering of samples are plain loops over arrays of one type, which the
//! compiler turns into vector code, once for any processor and once for those with AVX2 (chosen at run time); only the
//! gathering, which no vector unit does without a gather, goes voxel by voxel.
//!
//! Coordinates are `f32` relative to a whole voxel near the block, so that their rounding stays some 1e-6 of a voxel.

use glam::DVec3;

use crate::math::{self, BLOCK, lanes};
use crate::volume::fetch::{Blend, Fetch, WHOLE};
use crate::volume::sampling::Sampler;

/// Voxels of a row worked off together.
pub(super) const ROW: usize = 32;

/// Rows in a block of points.
pub(super) const ROWS: usize = BLOCK / ROW;

/// The coordinates of [`ROWS`] rows of voxels.
pub(super) type Points = math::Block<f32>;

/// The samples as seen from a whole voxel, `base`.
pub(super) struct Window<'a, T> {
    sampler: Sampler<'a, T>,
    /// Index of the first channel of voxel `base`; wraps if `base` is not a voxel.
    start: usize,
    /// Samples from a voxel to the next along i, j and k.
    stride: [usize; 3],
    /// The same for the upper neighbour in interpolation: 0 where there is one layer only.
    up: [usize; 3],
    /// Relative coordinates of the first and the last voxel centre.
    first: [f32; 3],
    last: [f32; 3],
    /// Greatest whole part: the last voxel but one, if there is one.
    highest: [f32; 3],
}

/// The arrays of a block of points.
pub(super) struct Scratch<T> {
    fraction: [[f32; BLOCK]; 3],
    missed: [u32; BLOCK],
    /// Index of the lowest of the eight samples.
    lowest: [u32; BLOCK],
    /// The same for volumes of very many samples.
    lowest_wide: [u64; BLOCK],
    /// Neighbours along i, for each of the four lines through the eight samples.
    pair: [[[T; 2]; BLOCK]; 4],
}

impl<T: Fetch> Scratch<T> {
    pub fn new() -> Self {
        Self {
            fraction: [[0.0; BLOCK]; 3],
            missed: [0; BLOCK],
            lowest: [0; BLOCK],
            lowest_wide: [0; BLOCK],
            pair: [[[T::zeroed(); 2]; BLOCK]; 4],
        }
    }
}

/// Which of the points of some blocks count: the first of each of the first rows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Counted {
    pub rows: usize,
    pub points: usize,
}

impl Counted {
    /// The marks that count in block `block`.
    #[inline(always)]
    fn sum(self, block: usize, marks: &[u32; BLOCK]) -> u64 {
        let rows = self.rows.saturating_sub(block * ROWS).min(ROWS);
        let sum = if self.points == ROW && rows == ROWS {
            marks.iter().sum::<u32>()
        } else {
            marks.chunks_exact(ROW).take(rows).map(|row| row[..self.points].iter().sum::<u32>()).sum()
        };
        u64::from(sum)
    }
}

/// Samples this far beyond the volume are outside, however large their coordinates.
const BEYOND: i64 = 1 << 16;

/// Bytes of a cache line, on most machines.
const LINE: usize = 64;

/// Cache lines read ahead at most: they should fit a small second-level cache.
const MOST_AHEAD: usize = 2048;

/// Edges of larger volumes cannot be looked up here: coordinates must stay below 2^22.
pub(super) const LARGEST_EDGE: usize = 1 << 21;

impl<'a, T: Fetch> Window<'a, T> {
    /// About the voxel nearest to `base` that is not far from the volume.
    pub fn new(sampler: Sampler<'a, T>, base: DVec3) -> Self {
        let (dims, channels) = (sampler.dims(), sampler.channels());
        // NaN becomes 0
        let base: [i64; 3] = std::array::from_fn(|a| (base[a] as i64).clamp(-BEYOND, dims[a] as i64 + BEYOND));
        let stride = [channels, dims[0] * channels, dims[0] * dims[1] * channels];
        let start = (0..3).fold(0usize, |at, a| at.wrapping_add((base[a] as usize).wrapping_mul(stride[a])));
        let relative = |back: usize| std::array::from_fn(|a| (dims[a].saturating_sub(back) as i64 - base[a]) as f32);
        Self {
            sampler,
            start,
            stride,
            up: std::array::from_fn(|a| if dims[a] > 1 { stride[a] } else { 0 }),
            first: base.map(|b| -b as f32),
            last: relative(1),
            highest: std::array::from_fn(|a| if dims[a] > 1 { relative(2)[a] } else { -base[a] as f32 }),
        }
    }

    /// What coordinates are relative to.
    pub fn base(&self) -> DVec3 {
        DVec3::from(self.first.map(|w| -f64::from(w)))
    }

    /// Whether all points between these ends are surely in the texture cube, with room for the rounding of coordinates.
    pub fn contains(&self, ends: &[[f32; 2]; 3]) -> bool {
        (0..3).all(|a| ends[a][0] > self.first[a] - 0.49 && ends[a][1] < self.last[a] + 0.49)
    }

    /// Whether all are surely beyond it.
    pub fn misses(&self, ends: &[[f32; 2]; 3]) -> bool {
        (0..3).any(|a| ends[a][1] < self.first[a] - 0.51 || ends[a][0] > self.last[a] + 0.51)
    }

    /// Reads one sample of each cache line between these ends. The look-ups that follow would wait for the lines one by one;
    /// here nothing depends on what is read, so that many are on their way at a time.
    pub fn read_ahead(&self, ends: &[[f32; 2]; 3]) {
        let dims = self.sampler.dims();
        // within the volume; NaN becomes 0
        let [x, y, z] = std::array::from_fn(|a| {
            let voxel = |at: f32| ((at - self.first[a]) as usize).min(dims[a] - 1);
            let first = voxel(ends[a][0]);
            (first, voxel(ends[a][1] + 1.0).max(first))
        });
        let line = LINE / size_of::<T>();
        let lines = ((x.1 - x.0) * self.stride[0] / line + 1) * (y.1 - y.0 + 1) * (z.1 - z.0 + 1);
        if lines > MOST_AHEAD {
            return;
        }
        let mut zeros = 0usize;
        for k in z.0..=z.1 {
            for j in y.0..=y.1 {
                let row = (k * dims[1] + j) * dims[0];
                let row = &self.sampler.samples()[(row + x.0) * self.stride[0]..(row + x.1 + 1) * self.stride[0]];
                zeros += row.iter().step_by(line).map(|v| usize::from(*v == T::zeroed())).sum::<usize>();
            }
        }
        std::hint::black_box(zeros);
    }

    /// Trilinear samples at the relative coordinates `at` into `out` (channels interleaved); `outside` beyond the texture
    /// cube. Returns how many of the counted points were outside; `contained` promises that none is.
    pub fn linear(
        &self,
        at: &[Points],
        contained: bool,
        counted: Counted,
        outside: &[T],
        scratch: &mut Scratch<T>,
        out: &mut [T],
    ) -> u64 {
        lanes::dispatch(Linear { window: self, at, contained, counted, outside, scratch, out })
    }

    /// The eight samples around each point, for one channel. `lowest` gives the index of the lowest of them.
    #[inline(always)]
    fn gather(&self, pair: &mut [[[T; 2]; BLOCK]; 4], lowest: impl Fn(usize) -> usize) {
        let [sx, sy, sz] = self.up;
        let samples = self.sampler.samples();
        // slices of equal length, so that one comparison serves all four
        let count = samples.len() - sy - sz;
        let line = |at: usize| &samples[at..][..count];
        let (s00, s10, s01, s11) = (line(0), line(sy), line(sz), line(sy + sz));
        let [p00, p10, p01, p11] = pair;
        // unrolled by hand: the compiler leaves a loop that may panic as it is
        for four in (0..BLOCK).step_by(4) {
            for l in four..four + 4 {
                let at = lowest(l);
                if sx == 1 {
                    // two samples at a time
                    p00[l].copy_from_slice(&s00[at..at + 2]);
                    p10[l].copy_from_slice(&s10[at..at + 2]);
                    p01[l].copy_from_slice(&s01[at..at + 2]);
                    p11[l].copy_from_slice(&s11[at..at + 2]);
                } else {
                    p00[l] = [s00[at], s00[at + sx]];
                    p10[l] = [s10[at], s10[at + sx]];
                    p01[l] = [s01[at], s01[at + sx]];
                    p11[l] = [s11[at], s11[at + sx]];
                }
            }
        }
    }
}

/// The look-ups of some blocks.
struct Linear<'a, 'b, T> {
    window: &'a Window<'b, T>,
    at: &'a [Points],
    contained: bool,
    counted: Counted,
    outside: &'a [T],
    scratch: &'a mut Scratch<T>,
    out: &'a mut [T],
}

impl<T: Fetch> pulp::WithSimd for Linear<'_, '_, T> {
    type Output = u64;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> u64 {
        let Self { window, at, contained, counted, outside, scratch, out } = self;
        let channels = outside.len();
        let mut all = 0;
        for (b, (at, out)) in at.iter().zip(out.chunks_exact_mut(BLOCK * channels)).enumerate() {
            let count = if contained { 0 } else { beyond(at, window, &mut scratch.missed) };
            if count > 0 {
                all += counted.sum(b, &scratch.missed);
            }
            if (count as usize) < BLOCK {
                window.block(at, scratch, out);
            }
            if count > 0 {
                for (voxel, _) in out.chunks_exact_mut(channels).zip(&scratch.missed).filter(|(_, m)| **m != 0) {
                    voxel.copy_from_slice(outside);
                }
            }
        }
        all
    }
}

impl<T: Fetch> Window<'_, T> {
    /// One block of look-ups, clamped to the edge.
    #[inline(always)]
    fn block(&self, at: &Points, scratch: &mut Scratch<T>, out: &mut [T]) {
        let Scratch { fraction, lowest, lowest_wide, pair, .. } = scratch;
        let few = self.sampler.samples().len() < i32::MAX as usize;
        let channels = self.sampler.channels();
        for c in 0..channels {
            let start = self.start.wrapping_add(c);
            if few {
                let [sx, sy, sz] = self.stride.map(|s| s as i32);
                locate(at, self, fraction, lowest, |x, y, z| {
                    let (x, y, z) = (x.wrapping_mul(sx), y.wrapping_mul(sy), z.wrapping_mul(sz));
                    (start as i32).wrapping_add(x).wrapping_add(y).wrapping_add(z) as u32
                });
                self.gather(pair, |l| lowest[l] as usize);
            } else {
                let [sx, sy, sz] = self.stride.map(|s| s as i64);
                locate(at, self, fraction, lowest_wide, |x, y, z| {
                    let part = |whole: i32, stride: i64| i64::from(whole).wrapping_mul(stride);
                    (start as i64).wrapping_add(part(x, sx)).wrapping_add(part(y, sy)).wrapping_add(part(z, sz)) as u64
                });
                self.gather(pair, |l| lowest_wide[l] as usize);
            }
            blend(fraction, pair, c, channels, out);
        }
    }
}

// Loops are functions of their own, so that the compiler knows that their arrays do not overlap.

/// Marks the points beyond the texture cube, and counts them.
#[inline(always)]
fn beyond<T>(at: &Points, window: &Window<'_, T>, missed: &mut [u32; BLOCK]) -> u32 {
    let [x, y, z] = std::array::from_fn(|a| (window.first[a] - 0.5, window.last[a] + 0.5));
    let out = |p: f32, (lo, hi): (f32, f32)| !((p >= lo) & (p <= hi));
    let mut count = 0;
    for l in 0..BLOCK {
        missed[l] = u32::from(out(at.x[l], x) | out(at.y[l], y) | out(at.z[l], z));
        count += missed[l];
    }
    count
}

/// The index of the lowest sample around each point, clamped to the edge, and how far the point is beyond it.
#[inline(always)]
fn locate<T, I>(
    at: &Points,
    window: &Window<'_, T>,
    [fx, fy, fz]: &mut [[f32; BLOCK]; 3],
    lowest: &mut [I; BLOCK],
    index: impl Fn(i32, i32, i32) -> I,
) {
    let [x, y, z] = std::array::from_fn(|a| [window.first[a], window.last[a], window.highest[a]]);
    for l in 0..BLOCK {
        let (i, s) = split(at.x[l], x);
        let (j, t) = split(at.y[l], y);
        let (k, u) = split(at.z[l], z);
        (fx[l], fy[l], fz[l]) = (s, t, u);
        lowest[l] = index(i, j, k);
    }
}

/// Whole and fractional part of a coordinate, clamped to the first and the last voxel centre; the whole part is at most
/// `highest`.
#[inline(always)]
fn split(x: f32, [first, last, highest]: [f32; 3]) -> (i32, f32) {
    // NaN becomes the first
    let x = if x > first { x } else { first };
    let x = if x < last { x } else { last };
    let near = (x + WHOLE) - WHOLE;
    let below = if near > x { near - 1.0 } else { near };
    let below = if below < highest { below } else { highest };
    (((below + WHOLE).to_bits() as i32).wrapping_sub(WHOLE.to_bits() as i32), x - below)
}

#[inline(always)]
fn blend<T: Fetch>(
    fraction: &[[f32; BLOCK]; 3],
    pair: &[[[T; 2]; BLOCK]; 4],
    channel: usize,
    channels: usize,
    out: &mut [T],
) {
    let mut row = [T::zeroed(); BLOCK];
    let [fx, fy, fz] = fraction;
    let mix = |a: T::Wide, b: T::Wide, t: f32| {
        let mixed = T::Wide::blend::<false>(a, b, t);
        if !T::SPECIAL {
            mixed
        } else if t == 0.0 {
            a
        } else if t == 1.0 {
            b
        } else {
            mixed
        }
    };
    for l in 0..BLOCK {
        let line = |n: usize| mix(pair[n][l][0].wide(), pair[n][l][1].wide(), fx[l]);
        row[l] = T::narrow(mix(mix(line(0), line(1), fy[l]), mix(line(2), line(3), fy[l]), fz[l]));
    }
    if channels == 1 {
        out[..BLOCK].copy_from_slice(&row);
    } else {
        for (voxel, v) in out.chunks_exact_mut(channels).zip(row) {
            voxel[channel] = v;
        }
    }
}

/// Rows of coordinates before they are displaced: each from its own start, all in the same steps.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a> {
    /// [`ROWS`] for each block of points.
    pub start: &'a [[f32; 3]],
    pub step: [f32; 3],
    pub counted: Counted,
}

impl Rows<'_> {
    /// Writes the coordinates. Behind those that count stand others.
    pub fn fill(self, points: &mut [Points]) {
        lanes::dispatch(Fill { rows: self, points });
    }

    /// How many of the counted points were displaced by more than `threshold` along some axis.
    pub fn moved(self, points: &[Points], threshold: f32) -> u64 {
        lanes::dispatch(Moved { rows: self, points, threshold })
    }
}

struct Fill<'a> {
    rows: Rows<'a>,
    points: &'a mut [Points],
}

impl pulp::WithSimd for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { rows: Rows { start, step, counted }, points } = self;
        // what does not count repeats the last that does, so that blocks do not seem to leave the volume
        let last = counted.points as f32 - 1.0;
        for (points, start) in points.iter_mut().zip(start.as_chunks::<ROWS>().0) {
            for (a, axis) in [&mut points.x, &mut points.y, &mut points.z].into_iter().enumerate() {
                for (row, start) in axis.as_chunks_mut().0.iter_mut().zip(start) {
                    ramp(row, start[a], step[a], last);
                }
            }
        }
    }
}

struct Moved<'a> {
    rows: Rows<'a>,
    points: &'a [Points],
    threshold: f32,
}

impl pulp::WithSimd for Moved<'_> {
    type Output = u64;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> u64 {
        let Self { rows: Rows { start, step, counted }, points, threshold } = self;
        let mut sum = 0;
        for (b, (points, start)) in points.iter().zip(start.as_chunks::<ROWS>().0).enumerate() {
            let mut far = [0; BLOCK];
            for (r, (far, start)) in far.as_chunks_mut().0.iter_mut().zip(start).enumerate() {
                let row = |axis: &'_ [f32; BLOCK]| -> [f32; ROW] { axis.as_chunks().0[r] };
                displaced(&row(&points.x), &row(&points.y), &row(&points.z), *start, step, threshold, far);
            }
            sum += counted.sum(b, &far);
        }
        sum
    }
}

#[inline(always)]
fn displaced(
    x: &[f32; ROW],
    y: &[f32; ROW],
    z: &[f32; ROW],
    start: [f32; 3],
    step: [f32; 3],
    threshold: f32,
    far: &mut [u32; ROW],
) {
    for l in 0..ROW {
        // NaN counts as moved
        let moved = |x: f32, a: usize| !((x - (start[a] + step[a] * l as f32)).abs() <= threshold);
        far[l] = u32::from(moved(x[l], 0) | moved(y[l], 1) | moved(z[l], 2));
    }
}

#[inline(always)]
fn ramp(row: &mut [f32; ROW], start: f32, step: f32, last: f32) {
    for l in 0..ROW {
        let n = l as f32;
        row[l] = start + step * if n < last { n } else { last };
    }
}

/// Adds displacements to a row.
pub(super) fn shift(points: &mut Points, row: usize, by: &[[f32; ROW]; 3]) {
    for (axis, by) in [&mut points.x, &mut points.y, &mut points.z].into_iter().zip(by) {
        axis[row * ROW..][..ROW].iter_mut().zip(by).for_each(|(x, s)| *x += s);
    }
}

//! Look-ups along a straight line through the input: the values of a row of voxels.

use glam::DVec3;

use super::WarpOptions;
use super::setup::Tet;
use crate::volume::fetch::{Blend, Fetch};
use crate::volume::sampling::{Interpolation, Sampler};

/// Rest positions of a row of voxels, in voxels of the input, and the Jacobian's determinant there.
pub(super) struct Line {
    pub from: DVec3,
    pub step: DVec3,
    pub weight: f64,
}

impl Line {
    fn at(&self, i: usize) -> DVec3 {
        self.from + self.step * i as f64
    }
}

/// A part of the input that rows run through: what their coordinates are relative to, small enough for `f32`.
pub(super) struct Place {
    /// A whole voxel at or below all points.
    pub base: [f64; 3],
    /// The last sample along each axis, relative to the base.
    last: [f32; 3],
    step: [f32; 3],
    /// Index of the sample there.
    first: i32,
}

impl Place {
    #[inline(always)]
    fn new<T: Fetch>(lowest: DVec3, step: [f64; 3], reader: &Reader<'_, T>) -> Self {
        let base = lowest.max(DVec3::ZERO).min(reader.last).floor();
        let first = (0..3).map(|a| base[a] as i32 * reader.stride[a] as i32).sum();
        let last = (reader.last - base).as_vec3().to_array();
        Self { base: base.to_array(), last, step: step.map(|s| s as f32), first }
    }
}

/// [`Reader::inside`] as vector code.
struct Inside<'a, 'b, T> {
    reader: &'a Reader<'b, T>,
    place: Place,
    from: [f32; 3],
    out: &'a mut [T],
}

impl<T: Fetch> pulp::WithSimd for Inside<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.reader.inside(&self.place, self.from, self.out);
    }
}

/// What lies no farther outside the first and last samples is drawn as if it lay on them.
pub(super) const EDGE: f64 = 1e-6;

/// What lies no farther from a voxel's centre or face is taken to be there.
pub(crate) const SNAP: f64 = 1e-9;

/// Voxels that are looked up together.
const LANES: usize = 8;

/// Adding this to a number in +-2^22 rounds it to a whole number, which then stands in the low bits.
const MAGIC: f32 = 12_582_912.0;

/// The input and how it is read.
pub(super) struct Reader<'a, T> {
    input: Sampler<'a, T>,
    interpolation: Interpolation,
    density: bool,
    /// Whether the vector code may be used at all.
    fast: bool,
    stride: [usize; 3],
    /// The samples from each of the four lines of a cell on, all of the same length.
    lines: [&'a [T]; 4],
    /// The last samples.
    pub last: DVec3,
}

impl<'a, T: Fetch> Reader<'a, T> {
    pub fn new(input: Sampler<'a, T>, options: &WarpOptions) -> Self {
        let dims = input.dims();
        let channels = input.channels();
        let stride = [channels, dims[0] * channels, dims[0] * dims[1] * channels];
        let samples = input.samples();
        let reach = stride[1] + stride[2];
        let fast = options.interpolation == Interpolation::Linear
            && !options.density
            && !options.reference
            && dims.iter().all(|n| (2..1 << 20).contains(n))
            && samples.len() < i32::MAX as usize;
        let length = if fast { samples.len() - reach } else { 0 };
        let lines = [0, stride[1], stride[2], reach].map(|at| if fast { &samples[at..][..length] } else { samples });
        let last = DVec3::new((dims[0] - 1) as f64, (dims[1] - 1) as f64, (dims[2] - 1) as f64);
        Self { input, interpolation: options.interpolation, density: options.density, fast, stride, lines, last }
    }

    #[inline(always)]
    pub fn channels(&self) -> usize {
        self.stride[0]
    }

    /// Where a tetrahedron's rest positions are counted from, if rows in it may go by [`Reader::inside`].
    #[inline(always)]
    pub fn place(&self, tet: &Tet) -> Option<Place> {
        self.fast.then(|| Place::new(tet.rest_bounds[0], tet.rest.map(|r| r[0]), self))
    }

    /// Fills a row; returns how many of its voxels lie outside the input.
    pub fn read(&self, line: &Line, out: &mut [T]) -> usize {
        let channels = self.channels();
        let count = out.len() / channels;
        let (first, last) = if self.fast { self.interior(line, count) } else { (0, 0) };
        let mut missed = 0;
        for (i, value) in out.chunks_exact_mut(channels).enumerate() {
            if i < first || i >= last {
                missed += usize::from(!self.single(line.at(i), line.weight, value));
            }
        }
        if first < last {
            let (from, to) = (line.at(first), line.at(last - 1));
            let place = Place::new(from.min(to), line.step.to_array(), self);
            let from = std::array::from_fn(|a| (from[a] - place.base[a]) as f32);
            let out = &mut out[first * channels..last * channels];
            pulp::Arch::new().dispatch(Inside { reader: self, place, from, out });
        }
        missed
    }

    /// The first voxel, and that behind the last, whose cells surely exist.
    fn interior(&self, line: &Line, count: usize) -> (usize, usize) {
        let (mut lo, mut hi) = (0.0f64, (count - 1) as f64);
        for a in 0..3 {
            let (from, step) = (line.from[a], line.step[a]);
            let (near, far) = (-EDGE - from, self.last[a] + EDGE - from);
            if step.abs() < 1e-12 {
                hi = if near <= 0.0 && far >= 0.0 { hi } else { -1.0 };
            } else {
                let (enter, leave) = if step > 0.0 { (near / step, far / step) } else { (far / step, near / step) };
                lo = lo.max(enter);
                hi = hi.min(leave);
            }
        }
        if lo <= hi { (lo.ceil() as usize, hi.floor() as usize + 1) } else { (0, 0) }
    }

    fn single(&self, p: DVec3, weight: f64, value: &mut [T]) -> bool {
        // what rounding moved off a voxel's centre goes back, so that samples are copied, and so does what it moved off the
        // face between two voxels or the edge of the input, so that not rounding decides which sample is the nearest
        let near = (p * 2.0).round() * 0.5;
        let p = DVec3::select((p - near).abs().cmplt(DVec3::splat(SNAP)), near, p);
        if self.density {
            let real = match self.interpolation {
                Interpolation::Nearest => self
                    .input
                    .nearest(p)
                    .map(|at| std::array::from_fn(|c| self.input.samples().get(at + c).map_or(0.0, |v| v.to_f64()))),
                Interpolation::Linear => self.input.linear(p),
                Interpolation::Cubic => self.input.cubic(p),
            };
            let Some(real) = real else { return false };
            for (v, r) in value.iter_mut().zip(real) {
                *v = T::from_f64(r / weight.abs());
            }
            return true;
        }
        self.input.sample(self.interpolation, p, value)
    }

    /// A row whose cells all exist: it starts at `from`, relative to the base of its place.
    #[inline(always)]
    pub fn inside(&self, place: &Place, from: [f32; 3], out: &mut [T]) {
        let channels = self.channels();
        let count = out.len() / channels;
        // all of one length, so that one comparison does for four look-ups
        let length = self.lines[3].len();
        let lines = self.lines.map(|line| &line[..length]);
        if channels == 1 {
            let lines = (lines, 1);
            let mut done = 0;
            while done + LANES <= count {
                let v = self.group(place, lines, from, done);
                out[done..done + LANES].copy_from_slice(&v);
                done += LANES;
            }
            if done < count {
                // lanes beyond the end are looked up too, but where the last cell may not exist: not beyond the row
                if done > 0 {
                    let v = self.group(place, lines, from, count - LANES);
                    out[count - LANES..].copy_from_slice(&v);
                } else {
                    let v = self.short(place, lines, from, count, 0);
                    store(out, &v);
                }
            }
        } else {
            for done in (0..count).step_by(LANES) {
                let part = LANES.min(count - done);
                for c in 0..channels {
                    let start = std::array::from_fn(|a| from[a] + done as f32 * place.step[a]);
                    let v = self.short(place, (lines, channels), start, part, c);
                    for l in 0..part {
                        out[(done + l) * channels + c] = v[l];
                    }
                }
            }
        }
        // NaN and infinity must not leak from samples whose weight is zero
        if T::SPECIAL && out.iter().any(|v| !v.to_f64().is_finite()) {
            self.again(place, from, out);
        }
    }

    #[cold]
    #[inline(never)]
    fn again(&self, place: &Place, from: [f32; 3], out: &mut [T]) {
        for (i, value) in out.chunks_exact_mut(self.channels()).enumerate() {
            let p = DVec3::from_array(std::array::from_fn(|a| {
                place.base[a] + f64::from(from[a]) + i as f64 * f64::from(place.step[a])
            }));
            self.single(p, 1.0, value);
        }
    }

    /// The voxels from `first` on.
    #[inline(always)]
    fn group(&self, place: &Place, lines: ([&[T]; 4], usize), from: [f32; 3], first: usize) -> [T; LANES] {
        let s: [f32; LANES] = std::array::from_fn(|l| (first as i32 + l as i32) as f32);
        self.at(place, lines, from, s, 0)
    }

    /// The first voxels, at most `count`; the other lanes repeat the last of them.
    #[inline(always)]
    fn short(
        &self,
        place: &Place,
        lines: ([&[T]; 4], usize),
        from: [f32; 3],
        count: usize,
        channel: usize,
    ) -> [T; LANES] {
        let end = (count - 1) as i32;
        let s: [f32; LANES] = std::array::from_fn(|l| (l as i32).min(end) as f32);
        self.at(place, lines, from, s, channel)
    }

    #[inline(always)]
    fn at(
        &self,
        place: &Place,
        (lines, next): ([&[T]; 4], usize),
        from: [f32; 3],
        s: [f32; LANES],
        channel: usize,
    ) -> [T; LANES] {
        let (ix, fx) = split(from[0], place.step[0], &s, place.last[0]);
        let (iy, fy) = split(from[1], place.step[1], &s, place.last[1]);
        let (iz, fz) = split(from[2], place.step[2], &s, place.last[2]);
        let [sx, sy, sz] = self.stride.map(|s| s as i32);
        let first = place.first + channel as i32;
        let mut at = [0; LANES];
        for l in 0..LANES {
            let (y, z) = (iy[l].wrapping_mul(sy), iz[l].wrapping_mul(sz));
            at[l] = first.wrapping_add(ix[l].wrapping_mul(sx)).wrapping_add(y).wrapping_add(z);
        }
        // through memory: that is one store and eight loads, where the compiler would take the vectors apart before the sums
        let at = std::hint::black_box(at);
        Self::blend(lines, next, &at, [fx, fy, fz])
    }

    /// Trilinear values in the cells that begin at the samples `at`.
    #[inline(always)]
    fn blend(lines: [&[T]; 4], next: usize, at: &[i32; LANES], [fx, fy, fz]: [[f32; LANES]; 3]) -> [T; LANES] {
        let [a, b, c, d] = lines;
        let mut pairs = [[T::Pair::default(); LANES]; 4];
        for l in 0..LANES {
            let at = at[l] as u32 as usize;
            pairs[0][l] = T::pair(a, at, next);
            pairs[1][l] = T::pair(b, at, next);
            pairs[2][l] = T::pair(c, at, next);
            pairs[3][l] = T::pair(d, at, next);
        }
        let [x0, x1, x2, x3] = pairs;
        let near = blend(&blend_pairs::<T>(&x0, &fx), &blend_pairs::<T>(&x1, &fx), &fy);
        let far = blend(&blend_pairs::<T>(&x2, &fx), &blend_pairs::<T>(&x3, &fx), &fy);
        let v = blend(&near, &far, &fz);
        let mut out = [T::zeroed(); LANES];
        for l in 0..LANES {
            out[l] = T::narrow(v[l]);
        }
        out
    }
}

/// The first samples of `v`, fewer than [`LANES`], in pieces of fixed sizes: copies of any length call a function.
#[inline(always)]
fn store<T: Copy>(mut out: &mut [T], v: &[T; LANES]) {
    let mut at = 0;
    for size in [4, 2, 1] {
        if out.len() & size != 0 {
            let (now, later) = out.split_at_mut(size);
            match size {
                4 => now.copy_from_slice(&v[..4]),
                2 => now.copy_from_slice(&v[at..at + 2]),
                _ => now[0] = v[at],
            }
            at += size;
            out = later;
        }
    }
}

/// The cells of the coordinates `from + s * step`, and where in them they are, 0..=1. What is not in 0..=last counts as the
/// nearest that is.
#[inline(always)]
fn split(from: f32, step: f32, s: &[f32; LANES], last: f32) -> ([i32; LANES], [f32; LANES]) {
    let (mut whole, mut fraction) = ([0; LANES], [0.0; LANES]);
    let end = last - 1.0 + MAGIC;
    for l in 0..LANES {
        let v = from + s[l] * step;
        let v = if v > 0.0 { v } else { 0.0 };
        let v = if v < last { v } else { last };
        // rounds down; a whole number may come out as one less, where the fraction is 1
        let cell = (v - 0.5) + MAGIC;
        let cell = if cell < end { cell } else { end };
        whole[l] = cell.to_bits() as i32 - MAGIC.to_bits() as i32;
        fraction[l] = v - (cell - MAGIC);
    }
    (whole, fraction)
}

/// Blends of neighbours.
#[inline(always)]
fn blend_pairs<T: Fetch>(pairs: &[T::Pair; LANES], t: &[f32; LANES]) -> [T::Wide; LANES] {
    let mut out = [T::Wide::default(); LANES];
    for l in 0..LANES {
        out[l] = T::Wide::blend(T::of_pair(pairs[l], 0), T::of_pair(pairs[l], 1), t[l]);
    }
    out
}

#[inline(always)]
fn blend<W: Blend>(a: &[W; LANES], b: &[W; LANES], t: &[f32; LANES]) -> [W; LANES] {
    let mut out = [W::default(); LANES];
    for l in 0..LANES {
        out[l] = W::blend(a[l], b[l], t[l]);
    }
    out
}

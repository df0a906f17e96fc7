//! Rows of voxels as straight lines through the input, and look-ups that may lie outside it.

use glam::DVec3;

use super::WarpOptions;
use super::batch::Row;
use super::setup::Tet;
use crate::volume::fetch::Fetch;
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

/// A part of the input that rows run through.
pub(super) struct Part {
    /// A whole voxel at or below all points: what coordinates are relative to, so that they are small enough for `f32`.
    pub base: [f64; 3],
    pub place: Place,
}

/// What look-ups need to know of a [`Part`].
#[derive(Clone, Copy, Default)]
pub(super) struct Place {
    /// The last sample along each axis, relative to the base.
    pub last: [f32; 3],
    /// From a voxel of a row to the next.
    pub step: [f32; 3],
    /// Index of the sample at the base.
    pub first: i32,
}

impl Part {
    #[inline(always)]
    pub fn new<T: Fetch>(lowest: DVec3, step: [f64; 3], reader: &Reader<'_, T>) -> Self {
        let base = lowest.max(DVec3::ZERO).min(reader.last).floor();
        let first = (0..3).map(|a| base[a] as i32 * reader.stride[a] as i32).sum();
        let last = (reader.last - base).as_vec3().to_array();
        Self { base: base.to_array(), place: Place { last, step: step.map(|s| s as f32), first } }
    }
}

/// What lies no farther outside the first and last samples is drawn as if it lay on them.
pub(super) const EDGE: f64 = 1e-6;

/// What lies this far inside the first and last samples stays there when coordinates are rounded to `f32`.
pub(super) const DEEP: f64 = 1.0 / 16.0;

/// What lies no farther from a voxel's centre or face is taken to be there.
pub(crate) const SNAP: f64 = 1e-9;

/// The input and how it is read.
pub(super) struct Reader<'a, T> {
    input: Sampler<'a, T>,
    interpolation: Interpolation,
    density: bool,
    outside: T,
    /// Whether the vector code may be used at all.
    fast: bool,
    pub stride: [usize; 3],
    /// The samples from each of the four lines of a cell on, all of the same length.
    pub lines: [&'a [T]; 4],
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
            // coordinates of `f32` are good to less than what is taken to be deep
            && dims.iter().all(|n| (2..1 << 18).contains(n))
            && samples.len() < i32::MAX as usize;
        let length = if fast { samples.len() - reach } else { 0 };
        let lines = [0, stride[1], stride[2], reach].map(|at| if fast { &samples[at..][..length] } else { samples });
        let last = DVec3::new((dims[0] - 1) as f64, (dims[1] - 1) as f64, (dims[2] - 1) as f64);
        let outside = T::from_f64(options.outside);
        let WarpOptions { interpolation, density, .. } = *options;
        Self { input, interpolation, density, outside, fast, stride, lines, last }
    }

    #[inline(always)]
    pub fn channels(&self) -> usize {
        self.stride[0]
    }

    pub fn samples(&self) -> &'a [T] {
        self.input.samples()
    }

    /// Where a tetrahedron's rest positions are counted from, if rows in it may go by a batch.
    #[inline(always)]
    pub fn part(&self, tet: &Tet) -> Option<Part> {
        self.fast.then(|| Part::new(tet.rest_bounds[0], tet.rest.map(|r| r[0]), self))
    }

    /// Looks up the voxels of a row one by one, but for those that surely lie inside: returns which those are, and how many
    /// of the others lie outside the input and got the outside value.
    pub fn read(&self, line: &Line, out: &mut [T]) -> (std::ops::Range<usize>, usize) {
        let channels = self.channels();
        let count = out.len() / channels;
        let (first, last) = if self.fast { self.interior(line, count) } else { (0, 0) };
        let mut missed = 0;
        for (i, value) in out.chunks_exact_mut(channels).enumerate() {
            if (i < first || i >= last) && !self.single(line.at(i), line.weight, value) {
                value.fill(self.outside);
                missed += 1;
            }
        }
        (first..last, missed)
    }

    /// A row's voxels `first..last`, none of which lies outside the input, as a row for a batch but for its place in the
    /// output.
    pub fn row(&self, line: &Line, first: usize, last: usize) -> Row {
        let (from, to) = (line.at(first), line.at(last - 1));
        let part = Part::new(from.min(to), line.step.to_array(), self);
        let deep = (from.min(to).cmpge(DVec3::splat(DEEP)) & from.max(to).cmple(self.last - DEEP)).all();
        let from = std::array::from_fn(|a| (from[a] - part.base[a]) as f32);
        Row { place: part.place, from, deep, ..Row::default() }
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

    pub(super) fn single(&self, p: DVec3, weight: f64, value: &mut [T]) -> bool {
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
}

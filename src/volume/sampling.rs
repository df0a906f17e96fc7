//! Values of a volume between its samples: the `f64` reference.
//!
//! # Theory
//!
//! Positions are voxel coordinates: the centre of voxel 0 is at 0, and voxel i reaches from i - 1/2 to i + 1/2. A volume
//! of n samples therefore has values on `[-1/2, n - 1/2]` along each axis, the texture cube; in its outer half voxel the
//! value is that of the nearest edge (clamp to edge), and beyond it there is none. Which value stands there is the caller's
//! choice, so every function says whether the point was inside.
//!
//! * nearest: the sample of the voxel that holds the point; a point on the face between two voxels belongs to the upper one
//!   (`floor(x + 1/2)`), on the last face to the last voxel;
//! * linear: the tensor product of hat functions;
//! * cubic: the tensor product of Catmull-Rom cubics, clamped to the range of the (up to) eight samples around the point.
//!   It interpolates, reproduces linear ramps, and the clamp removes the ringing beside edges, so a volume never gets values
//!   that its neighbourhood does not have.
//!
//! # Practice
//!
//! A sample whose weight is zero is not read: NaN and infinity do not leak onto a point that lies on a neighbouring sample,
//! and at a voxel centre the stored sample comes back as it is.

use glam::DVec3;

use super::{Scalar, Volume};

/// How values between samples are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// For labels: only values that occur.
    Nearest,
    #[default]
    Linear,
    /// Catmull-Rom, clamped to the local range.
    Cubic,
}

impl Interpolation {
    pub const ALL: [Self; 3] = [Self::Nearest, Self::Linear, Self::Cubic];

    /// The word on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nearest => "nearest",
            Self::Linear => "linear",
            Self::Cubic => "cubic",
        }
    }
}

/// Typed samples of a grid, to be read between voxels. Copies are cheap.
#[derive(Debug, Clone, Copy)]
pub struct Sampler<'a, T> {
    samples: &'a [T],
    dims: [usize; 3],
    channels: usize,
}

/// The samples of one axis that a point needs, with their weights; unused entries have weight 0.
struct Taps<const N: usize> {
    index: [usize; N],
    weight: [f64; N],
}

/// Weights of the hat function at `x`, clamped to the edge.
fn linear_taps(x: f64, n: usize) -> Taps<2> {
    let x = x.clamp(0.0, (n - 1) as f64);
    let i = x as usize;
    let t = x - i as f64;
    Taps { index: [i, (i + 1).min(n - 1)], weight: [1.0 - t, t] }
}

/// Weights of the Catmull-Rom cubic at `x`, clamped to the edge; the samples beyond the edge repeat it.
fn cubic_taps(x: f64, n: usize) -> Taps<4> {
    let x = x.clamp(0.0, (n - 1) as f64);
    let i = x as usize;
    let t = x - i as f64;
    let s = 1.0 - t;
    Taps {
        index: [i.saturating_sub(1), i, (i + 1).min(n - 1), (i + 2).min(n - 1)],
        weight: [-0.5 * t * s * s, 1.0 + t * t * (1.5 * t - 2.5), 1.0 + s * s * (1.5 * s - 2.5), -0.5 * s * t * t],
    }
}

impl<'a, T: Scalar> Sampler<'a, T> {
    /// # Panics
    /// If the samples do not fill the grid, or a size is zero: both are promises of [`Volume`].
    pub fn new(samples: &'a [T], dims: [usize; 3], channels: usize) -> Self {
        assert_eq!(samples.len(), dims[0] * dims[1] * dims[2] * channels, "samples do not fill the grid");
        assert!(!samples.is_empty(), "a grid has at least one voxel");
        Self { samples, dims, channels }
    }

    pub fn samples(&self) -> &'a [T] {
        self.samples
    }

    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Whether the voxel coordinate lies in the texture cube, `[-1/2, n - 1/2]` along each axis. False for NaN.
    #[inline]
    pub fn contains(&self, p: DVec3) -> bool {
        let within = |x: f64, n: usize| x >= -0.5 && x <= n as f64 - 0.5;
        within(p.x, self.dims[0]) && within(p.y, self.dims[1]) && within(p.z, self.dims[2])
    }

    /// Index of the first channel of the voxel that holds `p`; `None` outside the texture cube.
    #[inline]
    pub fn nearest(&self, p: DVec3) -> Option<usize> {
        if !self.contains(p) {
            return None;
        }
        let voxel = |x: f64, n: usize| (((x + 0.5).floor()) as usize).min(n - 1);
        Some(self.index(voxel(p.x, self.dims[0]), voxel(p.y, self.dims[1]), voxel(p.z, self.dims[2])))
    }

    /// Trilinear value of each channel; `None` outside the texture cube. Entries beyond the channels are 0.
    pub fn linear(&self, p: DVec3) -> Option<[f64; 4]> {
        if !self.contains(p) {
            return None;
        }
        let [x, y, z] = self.taps(p, linear_taps);
        Some(self.combine(&x, &y, &z))
    }

    /// Tricubic value of each channel; `None` outside the texture cube. Entries beyond the channels are 0.
    pub fn cubic(&self, p: DVec3) -> Option<[f64; 4]> {
        if !self.contains(p) {
            return None;
        }
        let [x, y, z] = self.taps(p, cubic_taps);
        let mut value = self.combine(&x, &y, &z);
        let [nx, ny, nz] = self.taps(p, linear_taps);
        for (c, v) in value.iter_mut().enumerate().take(self.channels) {
            let (lo, hi) = self.range(&nx, &ny, &nz, c);
            // not `clamp`: an empty range (all NaN) must not panic, and NaN stays NaN
            if *v > hi {
                *v = hi;
            } else if *v < lo {
                *v = lo;
            }
        }
        Some(value)
    }

    /// The value of each channel as the stored type into `out` (one entry per channel). False, and `out` untouched, outside
    /// the texture cube. At voxel centres the stored samples are copied bit for bit.
    pub fn sample(&self, interpolation: Interpolation, p: DVec3, out: &mut [T]) -> bool {
        let at_centre = p == p.round();
        if interpolation == Interpolation::Nearest || at_centre {
            let Some(at) = self.nearest(p) else { return false };
            out.copy_from_slice(&self.samples[at..at + self.channels]);
            return true;
        }
        let value = if interpolation == Interpolation::Linear { self.linear(p) } else { self.cubic(p) };
        let Some(value) = value else { return false };
        for (o, v) in out.iter_mut().zip(value) {
            *o = T::from_f64(v);
        }
        true
    }

    #[inline]
    fn index(&self, i: usize, j: usize, k: usize) -> usize {
        ((k * self.dims[1] + j) * self.dims[0] + i) * self.channels
    }

    fn taps<const N: usize>(&self, p: DVec3, of: fn(f64, usize) -> Taps<N>) -> [Taps<N>; 3] {
        [of(p.x, self.dims[0]), of(p.y, self.dims[1]), of(p.z, self.dims[2])]
    }

    fn combine<const N: usize>(&self, x: &Taps<N>, y: &Taps<N>, z: &Taps<N>) -> [f64; 4] {
        let mut sum = [0.0; 4];
        for c in 0..self.channels {
            sum[c] = blend(z, |k| blend(y, |j| blend(x, |i| self.samples[self.index(i, j, k) + c].to_f64())));
        }
        sum
    }

    /// Smallest and largest of the samples with weight, NaN left out.
    fn range(&self, x: &Taps<2>, y: &Taps<2>, z: &Taps<2>, c: usize) -> (f64, f64) {
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        for (&k, &wz) in z.index.iter().zip(&z.weight) {
            for (&j, &wy) in y.index.iter().zip(&y.weight) {
                for (&i, &wx) in x.index.iter().zip(&x.weight) {
                    if wx != 0.0 && wy != 0.0 && wz != 0.0 {
                        let v = self.samples[self.index(i, j, k) + c].to_f64();
                        lo = lo.min(v);
                        hi = hi.max(v);
                    }
                }
            }
        }
        (lo, hi)
    }
}

/// Sum of weight times value over one axis; values of weight 0 are not looked at. Written as a correction of the first
/// value, so that a constant stays exactly constant (the weights sum to 1 only up to rounding).
fn blend<const N: usize>(taps: &Taps<N>, value: impl Fn(usize) -> f64) -> f64 {
    let Some(first) = taps.weight.iter().position(|&w| w != 0.0) else { return f64::NAN };
    let base = value(taps.index[first]);
    let mut sum = base;
    for (&i, &w) in taps.index.iter().zip(&taps.weight).skip(first + 1) {
        if w != 0.0 {
            sum += w * (value(i) - base);
        }
    }
    sum
}

/// The value at voxel coordinate `p` of each channel, as stored (no rescale); `outside` beyond the texture cube. Entries beyond the channels are 0. Slow: for tests
/// and single look-ups.
pub fn value_at(volume: &Volume, interpolation: Interpolation, p: DVec3, outside: f64) -> [f64; 4] {
    crate::with_samples!(&volume.samples, v => {
        let sampler = Sampler::new(v, volume.grid.dims, volume.channels);
        let found = match interpolation {
            Interpolation::Nearest => sampler.nearest(p).map(|at| {
                std::array::from_fn(|c| if c < volume.channels { v[at + c].to_f64() } else { 0.0 })
            }),
            Interpolation::Linear => sampler.linear(p),
            Interpolation::Cubic => sampler.cubic(p),
        };
        found.unwrap_or_else(|| std::array::from_fn(|c| if c < volume.channels { outside } else { 0.0 }))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Grid, Samples};

    fn ramp(dims: [usize; 3], f: impl Fn(f64, f64, f64) -> f64) -> Vec<f64> {
        let [nx, ny, nz] = dims;
        let mut v = Vec::new();
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    v.push(f(i as f64, j as f64, k as f64));
                }
            }
        }
        v
    }

    #[test]
    fn ramps_are_reproduced_inside() {
        let f = |x: f64, y: f64, z: f64| 3.0 * x - 2.0 * y + 0.5 * z + 7.0;
        let dims = [7, 6, 5];
        let v = ramp(dims, f);
        let s = Sampler::new(&v, dims, 1);
        for p in [DVec3::new(2.3, 3.1, 1.9), DVec3::new(1.5, 2.25, 2.0), DVec3::new(4.0, 3.0, 2.5)] {
            assert!((s.linear(p).unwrap()[0] - f(p.x, p.y, p.z)).abs() < 1e-12);
            assert!((s.cubic(p).unwrap()[0] - f(p.x, p.y, p.z)).abs() < 1e-12);
        }
        // a trilinear product is reproduced by linear too
        let g = |x: f64, y: f64, z: f64| x * y * z;
        let w = ramp(dims, g);
        let s = Sampler::new(&w, dims, 1);
        assert!((s.linear(DVec3::new(2.3, 3.1, 1.9)).unwrap()[0] - 2.3 * 3.1 * 1.9).abs() < 1e-12);
    }

    #[test]
    fn the_outer_half_voxel_repeats_the_edge_and_ends() {
        let v = [10u8, 20, 30];
        let s = Sampler::new(&v, [3, 1, 1], 1);
        let at = |x: f64| DVec3::new(x, 0.0, 0.0);
        assert_eq!(s.linear(at(-0.5)).unwrap()[0], 10.0);
        assert_eq!(s.linear(at(2.5)).unwrap()[0], 30.0);
        assert_eq!(s.cubic(at(2.4)).unwrap()[0], 30.0);
        assert!(s.linear(at(-0.500001)).is_none() && s.cubic(at(2.500001)).is_none());
        assert!(s.nearest(at(f64::NAN)).is_none() && s.nearest(at(f64::INFINITY)).is_none());
        assert_eq!(s.linear(DVec3::new(0.5, 0.5, -0.5)).unwrap()[0], 15.0);
    }

    #[test]
    fn ties_of_nearest_go_up_and_the_last_face_is_inside() {
        let v = [1u8, 2, 3];
        let s = Sampler::new(&v, [3, 1, 1], 1);
        for (x, want) in [(-0.5, 0), (0.49, 0), (0.5, 1), (1.5, 2), (2.5, 2)] {
            assert_eq!(s.nearest(DVec3::new(x, 0.0, 0.0)), Some(want), "{x}");
        }
    }

    #[test]
    fn cubic_has_no_overshoot_beside_a_step() {
        let v = [0u8, 0, 0, 100, 100, 100];
        let s = Sampler::new(&v, [6, 1, 1], 1);
        let mut last = 0.0;
        for step in 0..=500 {
            let c = s.cubic(DVec3::new(f64::from(step) * 0.01, 0.0, 0.0)).unwrap()[0];
            assert!((0.0..=100.0).contains(&c) && c >= last, "{step} {c} {last}");
            last = c;
        }
        assert!((s.cubic(DVec3::new(2.25, 0.0, 0.0)).unwrap()[0] - 20.3125).abs() < 1e-12);
    }

    #[test]
    fn nan_stays_with_its_neighbours_and_infinity_survives_at_its_centre() {
        let mut v = vec![1.0f32; 125];
        v[62] = f32::NAN; // voxel (2, 2, 2)
        v[0] = f32::INFINITY;
        let s = Sampler::new(&v, [5, 5, 5], 1);
        for interpolation in Interpolation::ALL {
            let mut out = [0.0];
            assert!(s.sample(interpolation, DVec3::new(1.0, 2.0, 2.0), &mut out));
            assert_eq!(out[0], 1.0);
            assert!(s.sample(interpolation, DVec3::ZERO, &mut out));
            assert_eq!(out[0], f32::INFINITY);
            assert!(s.sample(interpolation, DVec3::splat(2.0), &mut out) && out[0].is_nan());
        }
        assert_eq!(s.linear(DVec3::new(1.0, 2.4, 2.3)).unwrap()[0], 1.0);
        assert!(s.linear(DVec3::new(1.1, 2.4, 2.3)).unwrap()[0].is_nan());
    }

    #[test]
    fn constants_stay_exactly_constant() {
        let v = vec![0.1f64; 64];
        let s = Sampler::new(&v, [4, 4, 4], 1);
        let p = DVec3::new(1.3, 1.7, 2.111);
        assert_eq!(s.linear(p).unwrap()[0], 0.1);
        assert_eq!(s.cubic(p).unwrap()[0], 0.1);
    }

    #[test]
    fn channels_are_independent() {
        let grid = Grid::aligned([2, 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
        let volume = Volume::new(grid, 3, Samples::I16(vec![0, 10, -20, 4, 30, -10]));
        assert_eq!(value_at(&volume, Interpolation::Linear, DVec3::new(0.25, 0.0, 0.0), 0.0), [1.0, 15.0, -17.5, 0.0]);
        assert_eq!(value_at(&volume, Interpolation::Cubic, DVec3::new(3.0, 0.0, 0.0), 9.0), [9.0, 9.0, 9.0, 0.0]);
    }
}

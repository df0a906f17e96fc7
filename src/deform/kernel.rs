//! Displacements in one fixed direction with everything precomputed; the same formulas in `f32` and `f64`.

use glam::{DMat3, DVec3};

use super::Falloff;
use crate::math::bspline::{bump, bump_with_slope, rise_and_fall, rise_and_fall_with_slope};
use crate::math::{BLOCK, Block, JacobianBlock, Real};

/// A displacement `vector * V(p)` with `V` in 0..=1.
pub(super) trait Kernel<T: Real> {
    fn vector(&self) -> [T; 3];

    /// `V` at `p`.
    fn value(&self, p: [T; 3]) -> T;

    /// `V` and its gradient.
    fn value_and_gradient(&self, p: [T; 3]) -> (T, [T; 3]);

    /// `p - vector V(p)` for every point of the block.
    #[inline(always)]
    fn displace(&self, b: &mut Block<T>) {
        let d = self.vector();
        for i in 0..BLOCK {
            let v = self.value([b.x[i], b.y[i], b.z[i]]);
            b.x[i] -= d[0] * v;
            b.y[i] -= d[1] * v;
            b.z[i] -= d[2] * v;
        }
    }

    /// The same; `jacobian` is multiplied from the left by `I - vector (grad V)^T`.
    #[inline(always)]
    fn displace_with_jacobian(&self, b: &mut Block<T>, jacobian: &mut JacobianBlock<T>) {
        let d = self.vector();
        let [j0, j1, j2, j3, j4, j5, j6, j7, j8] = &mut jacobian.entry;
        for i in 0..BLOCK {
            let (v, g) = self.value_and_gradient([b.x[i], b.y[i], b.z[i]]);
            b.x[i] -= d[0] * v;
            b.y[i] -= d[1] * v;
            b.z[i] -= d[2] * v;
            let row = |a: T, b: T, c: T| g[0] * a + g[1] * b + g[2] * c;
            let r = [row(j0[i], j1[i], j2[i]), row(j3[i], j4[i], j5[i]), row(j6[i], j7[i], j8[i])];
            j0[i] -= d[0] * r[0];
            j1[i] -= d[1] * r[0];
            j2[i] -= d[2] * r[0];
            j3[i] -= d[0] * r[1];
            j4[i] -= d[1] * r[1];
            j5[i] -= d[2] * r[1];
            j6[i] -= d[0] * r[2];
            j7[i] -= d[1] * r[2];
            j8[i] -= d[2] * r[2];
        }
    }
}

#[inline(always)]
fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn narrow<T: Real>(v: DVec3) -> [T; 3] {
    v.to_array().map(T::of)
}

fn convert<S: Real, T: Real>(v: [S; 3]) -> [T; 3] {
    v.map(|x| T::of(x.wide()))
}

/// `V = bump(u) bump(v) rise_and_fall(w)` in the frame of a displacement volume.
#[derive(Debug, Clone, Copy)]
pub(super) struct SplineKernel<T> {
    peak: [T; 3],
    /// The axes u, v, w, each divided by its length scale.
    axes: [[T; 3]; 3],
    vector: [T; 3],
}

impl SplineKernel<f64> {
    pub fn new(peak: DVec3, axes: DMat3, scale: DVec3, vector: DVec3) -> Self {
        let axes = [axes.x_axis / scale.x, axes.y_axis / scale.y, axes.z_axis / scale.z];
        Self { peak: peak.to_array(), axes: axes.map(narrow), vector: narrow(vector) }
    }

    /// In another precision and relative to `center`.
    pub fn about<T: Real>(&self, center: DVec3) -> SplineKernel<T> {
        SplineKernel {
            peak: narrow(DVec3::from(self.peak) - center),
            axes: self.axes.map(convert),
            vector: convert(self.vector),
        }
    }
}

impl<T: Real> SplineKernel<T> {
    #[inline(always)]
    fn local(&self, p: [T; 3]) -> [T; 3] {
        let r = [p[0] - self.peak[0], p[1] - self.peak[1], p[2] - self.peak[2]];
        [dot(self.axes[0], r), dot(self.axes[1], r), dot(self.axes[2], r)]
    }
}

impl<T: Real> Kernel<T> for SplineKernel<T> {
    #[inline(always)]
    fn vector(&self) -> [T; 3] {
        self.vector
    }

    #[inline(always)]
    fn value(&self, p: [T; 3]) -> T {
        let [u, v, w] = self.local(p);
        bump(u) * bump(v) * rise_and_fall(w)
    }

    #[inline(always)]
    fn value_and_gradient(&self, p: [T; 3]) -> (T, [T; 3]) {
        let [u, v, w] = self.local(p);
        let ((bu, su), (bv, sv), (bw, sw)) = (bump_with_slope(u), bump_with_slope(v), rise_and_fall_with_slope(w));
        let [a, b, c] = self.axes;
        let (gu, gv, gw) = (su * bv * bw, bu * sv * bw, bu * bv * sw);
        (bu * bv * bw, std::array::from_fn(|i| gu * a[i] + gv * b[i] + gw * c[i]))
    }
}

/// `V = f(|p - center| / radius)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct BallKernel<T> {
    center: [T; 3],
    inverse_radius: T,
    vector: [T; 3],
    falloff: Falloff,
}

impl BallKernel<f64> {
    pub fn new(center: DVec3, radius: f64, vector: DVec3, falloff: Falloff) -> Self {
        Self { center: center.to_array(), inverse_radius: 1.0 / radius, vector: vector.to_array(), falloff }
    }

    /// In another precision and relative to `center`.
    pub fn about<T: Real>(&self, center: DVec3) -> BallKernel<T> {
        BallKernel {
            center: narrow(DVec3::from(self.center) - center),
            inverse_radius: T::of(self.inverse_radius),
            vector: convert(self.vector),
            falloff: self.falloff,
        }
    }
}

impl<T: Real> BallKernel<T> {
    /// From the centre, in units of the radius.
    #[inline(always)]
    fn local(&self, p: [T; 3]) -> [T; 3] {
        std::array::from_fn(|i| (p[i] - self.center[i]) * self.inverse_radius)
    }
}

impl<T: Real> Kernel<T> for BallKernel<T> {
    #[inline(always)]
    fn vector(&self) -> [T; 3] {
        self.vector
    }

    #[inline(always)]
    fn value(&self, p: [T; 3]) -> T {
        let x = self.local(p);
        profile(self.falloff, dot(x, x)).0
    }

    #[inline(always)]
    fn value_and_gradient(&self, p: [T; 3]) -> (T, [T; 3]) {
        let x = self.local(p);
        let (value, slope) = profile(self.falloff, dot(x, x));
        let slope = slope * self.inverse_radius;
        (value, x.map(|c| c * slope))
    }
}

/// `f(t)` and `f'(t) / t` from `t^2`.
#[inline(always)]
fn profile<T: Real>(falloff: Falloff, squared: T) -> (T, T) {
    let (zero, one) = (T::default(), T::of(1.0));
    // keeps f'(t)/t finite at the centre, where f' is 0
    let tiny = T::of(1e-18);
    match falloff {
        Falloff::Smooth => {
            let rest = (one - squared).larger(zero);
            (rest * rest * rest, T::of(-6.0) * rest * rest)
        }
        Falloff::Spline => {
            let t = squared.root();
            let (value, slope) = bump_with_slope(t);
            (value, slope * t.larger(tiny).inverse())
        }
        Falloff::Core(core) => {
            let t = squared.root();
            let width = T::of(1.0 / (1.0 - core));
            let s = ((t - T::of(core)) * width).larger(zero).smaller(one);
            let value = one - s * s * (T::of(3.0) - T::of(2.0) * s);
            (value, T::of(-6.0) * s * (one - s) * width * t.larger(tiny).inverse())
        }
    }
}

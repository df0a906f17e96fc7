//! Displacements in one fixed direction with everything precomputed; the same formulas in `f32` and `f64`.

use glam::{DAffine3, DMat3, DVec3};

use super::Falloff;
use super::framed::Region;
use crate::math::bspline::{bump, bump_range, bump_with_slope, rise_and_fall, rise_and_fall_with_slope, stretched};
use crate::math::{BLOCK, Block, JacobianBlock, Real};

/// A displacement `vector * V(p)` with `V` in 0..=1.
pub(super) trait Kernel<T: Real> {
    fn vector(&self) -> [T; 3];

    /// `V` at `p`.
    fn value(&self, p: [T; 3]) -> T;

    /// `V` and its gradient.
    fn value_and_gradient(&self, p: [T; 3]) -> (T, [T; 3]);

    /// Bounds of `V` over a box in the coordinates of the kernel's region: its middle and its reach on both sides.
    fn range(&self, at: [T; 3], around: [T; 3]) -> [T; 2];

    /// `p - vector V(p)` for every point of the block.
    #[inline(always)]
    fn displace(&self, b: &mut Block<T>) {
        let d = self.vector();
        for i in 0..BLOCK {
            let v = self.value([b.x[i], b.y[i], b.z[i]]);
            subtract(b, i, d, v);
        }
    }

    /// The same; `jacobian` is multiplied from the left by `I - vector (grad V)^T`.
    #[inline(always)]
    fn displace_with_jacobian(&self, b: &mut Block<T>, jacobian: &mut JacobianBlock<T>) {
        let d = self.vector();
        let mut gradient = [[T::default(); BLOCK]; 3];
        for i in 0..BLOCK {
            let (v, g) = self.value_and_gradient([b.x[i], b.y[i], b.z[i]]);
            (gradient[0][i], gradient[1][i], gradient[2][i]) = (g[0], g[1], g[2]);
            subtract(b, i, d, v);
        }
        derive(d, &gradient, jacobian);
    }
}

// loops are written out where they are needed: a closure over what a point needs would not be inlined into vector code

#[inline(always)]
fn subtract<T: Real>(b: &mut Block<T>, i: usize, d: [T; 3], v: T) {
    b.x[i] -= d[0] * v;
    b.y[i] -= d[1] * v;
    b.z[i] -= d[2] * v;
}

/// `jacobian` from the left by `I - d gradient^T`: column by column, so that few arrays are at work at a time.
#[inline(always)]
fn derive<T: Real>(d: [T; 3], gradient: &[[T; BLOCK]; 3], jacobian: &mut JacobianBlock<T>) {
    let [gx, gy, gz] = gradient;
    for column in jacobian.entry.chunks_exact_mut(3) {
        let [x, y, z] = column else { continue };
        for i in 0..BLOCK {
            let along = gx[i] * x[i] + gy[i] * y[i] + gz[i] * z[i];
            x[i] -= d[0] * along;
            y[i] -= d[1] * along;
            z[i] -= d[2] * along;
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

    /// In coordinates of which the world is an affine image.
    pub fn in_frame(&self, world_from_local: &DAffine3) -> Self {
        let local_from_world = world_from_local.inverse();
        let axes_from_local = world_from_local.matrix3.transpose();
        Self {
            peak: local_from_world.transform_point3(self.peak.into()).to_array(),
            axes: self.axes.map(|a| (axes_from_local * DVec3::from(a)).to_array()),
            vector: local_from_world.transform_vector3(self.vector.into()).to_array(),
        }
    }

    pub fn region(&self) -> Region<f64> {
        Region::new(self.axes, self.peak, DVec3::NEG_ONE, DVec3::new(1.0, 1.0, 2.0))
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
    fn range(&self, at: [T; 3], around: [T; 3]) -> [T; 2] {
        let [u, v, w] = std::array::from_fn(|a| [at[a] - around[a], at[a] + around[a]]);
        // the region's origin is its middle
        let w = w.map(|t| stretched(t + T::of(0.5)));
        let [u, v, w] = [u, v, w].map(bump_range);
        [u[0] * v[0] * w[0], u[1] * v[1] * w[1]]
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

/// `V = f(|m (p - center)|)` with an upper triangular matrix `m`: in the world, 1 / radius.
#[derive(Debug, Clone, Copy)]
pub(super) struct BallKernel<T> {
    pub center: [T; 3],
    /// The rows of the matrix, without the zeros: three, two and one number.
    metric: [T; 6],
    vector: [T; 3],
    pub falloff: Falloff,
}

impl BallKernel<f64> {
    pub fn new(center: DVec3, radius: f64, vector: DVec3, falloff: Falloff) -> Self {
        let s = 1.0 / radius;
        Self { center: center.to_array(), metric: [s, 0.0, 0.0, s, 0.0, s], vector: vector.to_array(), falloff }
    }

    pub fn rows(&self) -> [[f64; 3]; 3] {
        let [a, b, c, d, e, f] = self.metric;
        [[a, b, c], [0.0, d, e], [0.0, 0.0, f]]
    }

    /// In coordinates of which the world is an affine image.
    pub fn in_frame(&self, world_from_local: &DAffine3) -> Self {
        let local_from_world = world_from_local.inverse();
        let metric = DMat3::from_cols_array_2d(&self.rows()).transpose() * world_from_local.matrix3;
        // distances are kept by the triangular factor of M^T M (Cholesky)
        let g = metric.transpose() * metric;
        let a = g.x_axis.x.sqrt();
        let (b, c) = (g.y_axis.x / a, g.z_axis.x / a);
        let d = (g.y_axis.y - b * b).sqrt();
        let e = (g.z_axis.y - b * c) / d;
        let f = (g.z_axis.z - c * c - e * e).sqrt();
        Self {
            center: local_from_world.transform_point3(self.center.into()).to_array(),
            metric: [a, b, c, d, e, f],
            vector: local_from_world.transform_vector3(self.vector.into()).to_array(),
            falloff: self.falloff,
        }
    }

    pub fn region(&self) -> Region<f64> {
        Region::new(self.rows(), self.center, DVec3::NEG_ONE, DVec3::ONE)
    }

    /// In another precision and relative to `center`.
    pub fn about<T: Real>(&self, center: DVec3) -> BallKernel<T> {
        BallKernel {
            center: narrow(DVec3::from(self.center) - center),
            metric: self.metric.map(T::of),
            vector: convert(self.vector),
            falloff: self.falloff,
        }
    }
}

impl<T: Real> BallKernel<T> {
    #[inline(always)]
    pub fn offset(&self, p: [T; 3]) -> [T; 3] {
        std::array::from_fn(|i| p[i] - self.center[i])
    }

    /// From the centre, in units of the radius.
    #[inline(always)]
    fn local(&self, p: [T; 3]) -> [T; 3] {
        let [x, y, z] = self.offset(p);
        let [a, b, c, d, e, f] = self.metric;
        [a * x + b * y + c * z, d * y + e * z, f * z]
    }

    #[inline(always)]
    pub fn value_by(&self, p: [T; 3], profile: impl Fn(T) -> (T, T)) -> T {
        let x = self.local(p);
        profile(dot(x, x)).0
    }

    #[inline(always)]
    fn displace_by(&self, b: &mut Block<T>, profile: impl Fn(T) -> (T, T)) {
        for i in 0..BLOCK {
            let v = self.value_by([b.x[i], b.y[i], b.z[i]], &profile);
            subtract(b, i, self.vector, v);
        }
    }

    #[inline(always)]
    fn displace_with_jacobian_by(
        &self,
        b: &mut Block<T>,
        jacobian: &mut JacobianBlock<T>,
        profile: impl Fn(T) -> (T, T),
    ) {
        let mut gradient = [[T::default(); BLOCK]; 3];
        for i in 0..BLOCK {
            let (v, g) = self.value_and_gradient_by([b.x[i], b.y[i], b.z[i]], &profile);
            (gradient[0][i], gradient[1][i], gradient[2][i]) = (g[0], g[1], g[2]);
            subtract(b, i, self.vector, v);
        }
        derive(self.vector, &gradient, jacobian);
    }

    #[inline(always)]
    pub fn value_and_gradient_by(&self, p: [T; 3], profile: impl Fn(T) -> (T, T)) -> (T, [T; 3]) {
        let local = self.local(p);
        let (value, slope) = profile(dot(local, local));
        let [x, y, z] = local.map(|c| c * slope);
        let [a, b, c, d, e, f] = self.metric;
        (value, [a * x, b * x + d * y, c * x + e * y + f * z])
    }
}

impl<T: Real> Kernel<T> for BallKernel<T> {
    #[inline(always)]
    fn vector(&self) -> [T; 3] {
        self.vector
    }

    #[inline(always)]
    fn value(&self, p: [T; 3]) -> T {
        self.value_by(p, profile_of(self.falloff))
    }

    #[inline(always)]
    fn range(&self, at: [T; 3], around: [T; 3]) -> [T; 2] {
        let (mut least, mut most) = (T::default(), T::default());
        for a in 0..3 {
            let (near, far) = ((at[a].magnitude() - around[a]).larger(T::default()), at[a].magnitude() + around[a]);
            least += near * near;
            most += far * far;
        }
        let profile = profile_of(self.falloff);
        // it falls
        [profile(most).0, profile(least).0]
    }

    #[inline(always)]
    fn value_and_gradient(&self, p: [T; 3]) -> (T, [T; 3]) {
        self.value_and_gradient_by(p, profile_of(self.falloff))
    }

    // the falloff is chosen outside the loops, so that each loop is free of branches
    #[inline(always)]
    fn displace(&self, b: &mut Block<T>) {
        match self.falloff {
            Falloff::Smooth => self.displace_by(b, smooth),
            Falloff::Spline => self.displace_by(b, spline),
            Falloff::Core(core) => self.displace_by(b, with_core(core)),
        }
    }

    #[inline(always)]
    fn displace_with_jacobian(&self, b: &mut Block<T>, jacobian: &mut JacobianBlock<T>) {
        match self.falloff {
            Falloff::Smooth => self.displace_with_jacobian_by(b, jacobian, smooth),
            Falloff::Spline => self.displace_with_jacobian_by(b, jacobian, spline),
            Falloff::Core(core) => self.displace_with_jacobian_by(b, jacobian, with_core(core)),
        }
    }
}

// Profiles: f(t) and f'(t) / t from t^2.

/// `(1 - t^2)^3`.
#[inline(always)]
pub(super) fn smooth<T: Real>(squared: T) -> (T, T) {
    let rest = (T::of(1.0) - squared).larger(T::default());
    (rest * rest * rest, T::of(-6.0) * rest * rest)
}

/// The quadratic B-spline.
#[inline(always)]
pub(super) fn spline<T: Real>(squared: T) -> (T, T) {
    let t = squared.root();
    let (value, slope) = bump_with_slope(t);
    (value, slope * t.larger(T::of(TINY)).inverse())
}

/// 1 up to `core`, then smoothstep.
#[inline(always)]
pub(super) fn with_core<T: Real>(core: f64) -> impl Fn(T) -> (T, T) {
    let (core, width) = (T::of(core), T::of(1.0 / (1.0 - core)));
    move |squared| {
        let t = squared.root();
        let s = ((t - core) * width).larger(T::default()).smaller(T::of(1.0));
        let value = T::of(1.0) - s * s * (T::of(3.0) - T::of(2.0) * s);
        (value, T::of(-6.0) * s * (T::of(1.0) - s) * width * t.larger(T::of(TINY)).inverse())
    }
}

/// Keeps `f'(t) / t` finite at the centre, where the slope is 0.
const TINY: f64 = 1e-18;

/// The profile of a falloff, chosen anew at each call: for single points.
#[inline(always)]
pub(super) fn profile_of<T: Real>(falloff: Falloff) -> impl Fn(T) -> (T, T) {
    move |squared| match falloff {
        Falloff::Smooth => smooth(squared),
        Falloff::Spline => spline(squared),
        Falloff::Core(core) => with_core(core)(squared),
    }
}

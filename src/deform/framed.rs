//! A stack in the voxel coordinates of a grid.
//!
//! A deformer is a profile in coordinates of its own, which are affine in the world's, and a vector. It can therefore be
//! written in any affine coordinates at once, and evaluating it for the voxels of a grid needs no way through the world.
//! Bounds of the displacement along each axis tell which deformers can act on a box of voxels, and from where its values
//! can come, before any of them is evaluated.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::kernel::{BallKernel, Kernel, SplineKernel};
use super::lattice_kernel::LatticeKernel;
use crate::math::{Block, Real};

/// A stack as a map of coordinates in which the world is an affine image. Made by [`super::Prepared::in_frame`].
#[derive(Debug, Clone)]
pub struct Framed {
    /// The newest first, as they are applied.
    steps: Vec<Step>,
}

#[derive(Debug, Clone)]
struct Step {
    kernel: Any<f64>,
    region: Region<f64>,
    /// Lowest and highest displacement along each axis; zero is between them.
    range: [DVec3; 2],
}

#[derive(Debug, Clone)]
pub(super) enum Any<T> {
    Spline(SplineKernel<T>),
    Ball(BallKernel<T>),
    /// With its coefficients in `f32`, which all blocks share.
    Lattice(LatticeKernel<T>, Arc<[[f32; 4]]>),
}

/// The points that a deformer can move: where `axes p + offset` is within `half` of 0.
#[derive(Debug, Clone, Copy)]
pub(super) struct Region<T> {
    pub axes: [[T; 3]; 3],
    pub offset: [T; 3],
    pub half: [T; 3],
}

impl Region<f64> {
    /// Where `axes (p - origin)` is between `lo` and `hi`.
    pub fn new(axes: [[f64; 3]; 3], origin: [f64; 3], lo: DVec3, hi: DVec3) -> Self {
        let rows = DMat3::from_cols_array_2d(&axes).transpose();
        let offset = -(rows * DVec3::from(origin)) - 0.5 * (lo + hi);
        Self { axes, offset: offset.to_array(), half: (0.5 * (hi - lo)).to_array() }
    }

    /// In another precision and relative to `center`.
    fn about<T: Real>(&self, center: DVec3) -> Region<T> {
        let rows = DMat3::from_cols_array_2d(&self.axes).transpose();
        Region {
            axes: self.axes.map(|a| a.map(T::of)),
            offset: (rows * center + DVec3::from(self.offset)).to_array().map(T::of),
            half: self.half.map(T::of),
        }
    }
}

impl<T: Real> Region<T> {
    /// Whether no point between these bounds is in the region. False if anything is NaN.
    #[inline(always)]
    fn misses(&self, bounds: &[[T; 2]; 3]) -> bool {
        let middle = bounds.map(|[lo, hi]| T::of(0.5) * (lo + hi));
        let reach = bounds.map(|[lo, hi]| T::of(0.5) * (hi - lo));
        (0..3).any(|a| {
            let [x, y, z] = self.axes[a];
            let at = x * middle[0] + y * middle[1] + z * middle[2] + self.offset[a];
            let around = x.magnitude() * reach[0] + y.magnitude() * reach[1] + z.magnitude() * reach[2];
            at.magnitude() - around > self.half[a]
        })
    }
}

impl Framed {
    pub(super) fn new(kernels: impl Iterator<Item = Any<f64>>) -> Self {
        let along = |v: [f64; 3]| [DVec3::from(v).min(DVec3::ZERO), DVec3::from(v).max(DVec3::ZERO)];
        let step = |kernel: Any<f64>| match &kernel {
            Any::Spline(k) => Step { region: k.region(), range: along(k.vector()), kernel },
            Any::Ball(k) => Step { region: k.region(), range: along(k.vector()), kernel },
            Any::Lattice(k, _) => Step { region: k.region(), range: k.range(), kernel },
        };
        Self { steps: kernels.map(step).collect() }
    }

    /// Corners of a box around the backward images of all points between two corners.
    pub fn sources(&self, lower: DVec3, upper: DVec3) -> (DVec3, DVec3) {
        self.acting(lower, upper, |_| {})
    }

    /// Calls `act` with the steps that may move a point between two corners. Returns where the points may go.
    fn acting<'a>(&'a self, lower: DVec3, upper: DVec3, mut act: impl FnMut(&'a Step)) -> (DVec3, DVec3) {
        self.steps.iter().fold((lower, upper), |(lo, hi), step| {
            if step.region.misses(&std::array::from_fn(|a| [lo[a], hi[a]])) {
                return (lo, hi);
            }
            act(step);
            // what is displaced is subtracted
            (lo - step.range[1], hi - step.range[0])
        })
    }

    /// An evaluator for points between two corners only. Its coordinates are relative to `origin`.
    pub fn near(&self, lower: DVec3, upper: DVec3, origin: DVec3) -> Near {
        let mut steps = Vec::new();
        let sources = self.acting(lower, upper, |step| {
            let kernel = match &step.kernel {
                Any::Spline(k) => Any::Spline(k.about(origin)),
                Any::Ball(k) => Any::Ball(k.about(origin)),
                Any::Lattice(k, narrow) => Any::Lattice(k.about_with(origin, Arc::clone(narrow)), Arc::clone(narrow)),
            };
            let range = step.range.map(|v| v.as_vec3().to_array());
            steps.push(NearStep { kernel, region: step.region.about(origin), range });
        });
        Near { steps, sources }
    }
}

/// A stack for a box of points (see [`Framed::near`]).
#[derive(Debug, Clone)]
pub struct Near {
    steps: Vec<NearStep>,
    sources: (DVec3, DVec3),
}

#[derive(Debug, Clone)]
struct NearStep {
    kernel: Any<f32>,
    region: Region<f32>,
    range: [[f32; 3]; 2],
}

impl Near {
    /// Whether surely no point of the box is moved.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Corners of a box around the backward images of all points; not relative to the origin.
    pub fn sources(&self) -> (DVec3, DVec3) {
        self.sources
    }

    /// Lists the steps that may move a point between these ends along each axis, for [`Near::backward`]. Returns the ends
    /// of a box around the backward images.
    pub fn acting(&self, mut bounds: [[f32; 2]; 3], acting: &mut Vec<usize>) -> [[f32; 2]; 3] {
        acting.clear();
        for (n, step) in self.steps.iter().enumerate() {
            if step.region.misses(&bounds) {
                continue;
            }
            acting.push(n);
            for (a, [lo, hi]) in bounds.iter_mut().enumerate() {
                // what is displaced is subtracted
                *lo -= step.range[1][a];
                *hi -= step.range[0][a];
            }
        }
        bounds
    }

    /// Replaces every point by its backward image. The steps are those listed by [`Near::acting`] for bounds of the points.
    ///
    /// # Panics
    /// If there is no such step.
    pub fn backward(&self, acting: &[usize], points: &mut [Block<f32>]) {
        if !acting.is_empty() {
            pulp::Arch::new().dispatch(Displace { steps: &self.steps, acting, points });
        }
    }
}

/// The steps for some blocks, compiled for what the processor offers.
struct Displace<'a> {
    steps: &'a [NearStep],
    acting: &'a [usize],
    points: &'a mut [Block<f32>],
}

impl pulp::WithSimd for Displace<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        for step in self.acting {
            let kernel = &self.steps[*step].kernel;
            for points in &mut *self.points {
                match kernel {
                    Any::Spline(k) => k.displace(points),
                    Any::Ball(k) => k.displace(points),
                    Any::Lattice(k, _) => k.displace(points),
                }
            }
        }
    }
}

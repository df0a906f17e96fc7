//! A stack in the voxel coordinates of a grid.
//!
//! A deformer is a profile in coordinates of its own, which are affine in the world's, and a vector. It can therefore be
//! written in any affine coordinates at once, and evaluating it for the voxels of a grid needs no way through the world.
//! Bounds of the profile over a box of voxels (interval arithmetic) tell which deformers can act on it, and from where its
//! values can come, before any of them is evaluated.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::brush_kernel::BrushKernel;
use super::kernel::{BallKernel, Kernel, SplineKernel};
use super::lattice_kernel::LatticeKernel;
use crate::math::{Block, Real, lanes};

/// A stack as a map of coordinates in which the world is an affine image. Made by [`super::Prepared::in_frame`].
#[derive(Debug, Clone)]
pub struct Framed {
    /// The newest first, as they are applied.
    steps: Vec<Step<f64>>,
}

#[derive(Debug, Clone)]
struct Step<T> {
    kernel: FramedKernel<T>,
    region: Region<T>,
}

#[derive(Debug, Clone)]
pub(super) enum FramedKernel<T> {
    Spline(SplineKernel<T>),
    Ball(BallKernel<T>),
    Brush(BrushKernel<T>),
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
    /// The middle of a box of points and its reach on both sides, in the region's own coordinates; `None` if no point of the
    /// box is in the region.
    #[inline(always)]
    fn local(&self, bounds: &[[T; 2]; 3]) -> Option<[[T; 3]; 2]> {
        let middle = bounds.map(|[lo, hi]| T::of(0.5) * (lo + hi));
        let reach = bounds.map(|[lo, hi]| T::of(0.5) * (hi - lo));
        let (mut at, mut around) = (self.offset, [T::default(); 3]);
        for a in 0..3 {
            for (n, axis) in self.axes[a].into_iter().enumerate() {
                at[a] += axis * middle[n];
                around[a] += axis.magnitude() * reach[n];
            }
            // not where anything is NaN
            if at[a].magnitude() - around[a] > self.half[a] {
                return None;
            }
        }
        Some([at, around])
    }
}

impl<T: Real> Step<T> {
    /// The ends of a box around the backward images of the points between these ends along each axis; `None` if none of
    /// them is moved.
    #[inline(always)]
    fn images(&self, bounds: &[[T; 2]; 3]) -> Option<[[T; 2]; 3]> {
        let [at, around] = self.region.local(bounds)?;
        let range = match &self.kernel {
            FramedKernel::Spline(k) => along(k.vector(), k.range(at, around)),
            FramedKernel::Ball(k) => along(k.vector(), k.range(at, around)),
            FramedKernel::Brush(k) => k.range(bounds, at, around),
            FramedKernel::Lattice(k, _) => k.range,
        };
        let still = [[T::default(); 2]; 3];
        // what is displaced is subtracted
        (range != still).then(|| std::array::from_fn(|a| [bounds[a][0] - range[a][1], bounds[a][1] - range[a][0]]))
    }
}

/// The ends of a vector's parts from `lo` to `hi` times it.
#[inline(always)]
fn along<T: Real>(vector: [T; 3], [lo, hi]: [T; 2]) -> [[T; 2]; 3] {
    vector.map(|v| [(v * lo).smaller(v * hi), (v * lo).larger(v * hi)])
}

impl Framed {
    pub(super) fn new(kernels: impl Iterator<Item = FramedKernel<f64>>) -> Self {
        let step = |kernel| {
            let region = match &kernel {
                FramedKernel::Spline(k) => k.region(),
                FramedKernel::Ball(k) => k.region(),
                FramedKernel::Brush(k) => k.region(),
                FramedKernel::Lattice(k, _) => k.region(),
            };
            Step { kernel, region }
        };
        Self { steps: kernels.map(step).collect() }
    }

    /// Corners of a box around the backward images of all points between two corners.
    pub fn sources(&self, lower: DVec3, upper: DVec3) -> (DVec3, DVec3) {
        let ends = std::array::from_fn(|a| [lower[a], upper[a]]);
        let ends = self.steps.iter().fold(ends, |ends, step| step.images(&ends).unwrap_or(ends));
        (DVec3::from(ends.map(|e| e[0])), DVec3::from(ends.map(|e| e[1])))
    }

    /// An evaluator for points between two corners only. Its coordinates are relative to `origin`.
    pub fn near(&self, lower: DVec3, upper: DVec3, origin: DVec3) -> Near {
        let mut ends = std::array::from_fn(|a| [lower[a], upper[a]]);
        let mut steps = Vec::new();
        for step in &self.steps {
            let Some(images) = step.images(&ends) else { continue };
            let kernel = match &step.kernel {
                FramedKernel::Spline(k) => FramedKernel::Spline(k.about(origin)),
                FramedKernel::Ball(k) => FramedKernel::Ball(k.about(origin)),
                FramedKernel::Brush(k) => FramedKernel::Brush(k.about(origin)),
                FramedKernel::Lattice(k, narrow) => {
                    FramedKernel::Lattice(k.about_with(origin, Arc::clone(narrow)), Arc::clone(narrow))
                }
            };
            steps.push(Step { kernel, region: step.region.about(origin) });
            ends = images;
        }
        Near { steps }
    }
}

/// A stack for a box of points (see [`Framed::near`]).
#[derive(Debug, Clone)]
pub struct Near {
    steps: Vec<Step<f32>>,
}

impl Near {
    /// Lists the steps that may move a point between these ends along each axis, for [`Near::backward`]. Returns the ends
    /// of a box around the backward images.
    pub fn acting(&self, mut bounds: [[f32; 2]; 3], acting: &mut Vec<usize>) -> [[f32; 2]; 3] {
        acting.clear();
        for (n, step) in self.steps.iter().enumerate() {
            if let Some(images) = step.images(&bounds) {
                acting.push(n);
                bounds = images;
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
            lanes::dispatch(Displace { steps: &self.steps, acting, points });
        }
    }
}

/// The steps for some blocks, compiled for what the processor offers.
struct Displace<'a> {
    steps: &'a [Step<f32>],
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
                    FramedKernel::Spline(k) => k.displace(points),
                    FramedKernel::Ball(k) => k.displace(points),
                    FramedKernel::Brush(k) => k.displace(points),
                    FramedKernel::Lattice(k, _) => k.displace(points),
                }
            }
        }
    }
}

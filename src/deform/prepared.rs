use std::borrow::Cow;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use super::brush_kernel::BrushKernel;
use super::forward::{forward_along, forward_brush, forward_lattice};
use super::framed::{Framed, FramedKernel};
use super::kernel::{BallKernel, Kernel, SplineKernel};
use super::lattice_kernel::LatticeKernel;
use super::stack::{brushed, outer, with_gradient};
use super::{DeformError, Deformer};
use crate::math::{BLOCK, BackwardMap, Block, BlockMap, JacobianBlock, OrientedBox, Real, lanes};

/// A stack ready to be evaluated in `f64`: axes, inverse lengths and boxes worked out.
#[derive(Debug, Clone, Default)]
pub struct Prepared {
    /// The newest first, as they are applied.
    steps: Vec<Step>,
    /// The same for blocks of points in the world.
    blocks: Blocks<f64>,
    /// Around all boxes.
    bounds: Option<(DVec3, DVec3)>,
    feature: f64,
}

#[derive(Debug, Clone)]
struct Step {
    kernel: AnyKernel<f64>,
    support: OrientedBox,
    lower: DVec3,
    upper: DVec3,
    steepness: f64,
}

#[derive(Debug, Clone)]
enum AnyKernel<T> {
    Spline(SplineKernel<T>),
    Ball(BallKernel<T>),
    Brush(BrushKernel<T>),
    Lattice(Arc<LatticeKernel<T>>),
}

impl Prepared {
    /// From deformers, oldest first.
    pub(super) fn new<'a>(deformers: impl DoubleEndedIterator<Item = Cow<'a, Deformer>>) -> Self {
        let mut feature = f64::INFINITY;
        let steps: Vec<Step> = deformers
            .rev()
            .map(|d| {
                feature = feature.min(d.feature_size());
                let kernel = match &*d {
                    Deformer::Displacement(d) => AnyKernel::Spline(d.kernel(DVec3::ZERO)),
                    Deformer::Grab(g) => AnyKernel::Ball(g.kernel(DVec3::ZERO)),
                    Deformer::Brush(b) => AnyKernel::Brush(b.kernel(DVec3::ZERO)),
                    Deformer::Lattice(l) => AnyKernel::Lattice(Arc::new(l.kernel())),
                };
                let support = d.support();
                let (lower, upper) = support.bounds();
                Step { kernel, support, lower, upper, steepness: d.steepness() }
            })
            .collect();
        let bounds = steps.iter().map(|s| (s.lower, s.upper)).reduce(|(al, au), (bl, bu)| (al.min(bl), au.max(bu)));
        Self { blocks: blocks(steps.iter(), DVec3::ZERO), steps, bounds, feature }
    }

    /// Whether nothing is deformed.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Axis-aligned bounds of all boxes; `None` if nothing is deformed.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        self.bounds
    }

    /// The smallest feature of any deformer, in world units; infinite if nothing is deformed.
    pub fn feature_size(&self) -> f64 {
        self.feature
    }

    /// An evaluator of blocks of points relative to `center`.
    pub fn blocks<T: Real>(&self, center: DVec3) -> Blocks<T> {
        blocks(self.steps.iter(), center)
    }

    /// The same map of coordinates of which the world is an affine image, as voxel indices are.
    pub fn in_frame(&self, world_from_local: &DAffine3) -> Framed {
        Framed::new(self.steps.iter().map(|s| match &s.kernel {
            AnyKernel::Spline(k) => FramedKernel::Spline(k.in_frame(world_from_local)),
            AnyKernel::Ball(k) => FramedKernel::Ball(k.in_frame(world_from_local)),
            AnyKernel::Brush(k) => FramedKernel::Brush(k.in_frame(world_from_local)),
            AnyKernel::Lattice(k) => FramedKernel::Lattice(k.in_frame(world_from_local), k.narrow()),
        }))
    }

    /// Where the undeformed point `q` is seen. See [`super::Stack::forward`].
    ///
    /// # Errors
    /// If a deformation folds over there.
    pub fn forward(&self, q: DVec3) -> Result<DVec3, DeformError> {
        // oldest first: each deformer's own inverse, in the order in which they were made
        self.steps.iter().rev().try_fold(q, |q, step| {
            if step.outside(q) {
                return Ok(q);
            }
            match &step.kernel {
                AnyKernel::Spline(k) => forward_along(k, q, step.steepness),
                AnyKernel::Ball(k) => forward_along(k, q, step.steepness),
                AnyKernel::Brush(k) => forward_brush(&k.brush, q),
                AnyKernel::Lattice(k) => forward_lattice(k, q, step.support.half.max_element()),
            }
        })
    }
}

fn blocks<'a, T: Real>(steps: impl Iterator<Item = &'a Step>, center: DVec3) -> Blocks<T> {
    let block_step = |s: &Step| BlockStep {
        kernel: match &s.kernel {
            AnyKernel::Spline(k) => AnyKernel::Spline(k.about(center)),
            AnyKernel::Ball(k) => AnyKernel::Ball(k.about(center)),
            AnyKernel::Brush(k) => AnyKernel::Brush(k.about(center)),
            AnyKernel::Lattice(k) => AnyKernel::Lattice(Arc::new(k.about(center))),
        },
        bounds: std::array::from_fn(|a| [T::of(s.lower[a] - center[a]), T::of(s.upper[a] - center[a])]),
    };
    Blocks { center, steps: steps.map(block_step).collect() }
}

impl Step {
    #[inline(always)]
    fn outside(&self, p: DVec3) -> bool {
        outside(p, self.lower, self.upper)
    }
}

#[inline(always)]
fn outside(p: DVec3, lower: DVec3, upper: DVec3) -> bool {
    p.cmplt(lower).any() || p.cmpgt(upper).any()
}

impl BackwardMap for Prepared {
    fn backward(&self, mut p: DVec3) -> DVec3 {
        if self.bounds.is_none_or(|(lower, upper)| outside(p, lower, upper)) {
            return p;
        }
        for step in &self.steps {
            if !step.outside(p) {
                p -= match &step.kernel {
                    AnyKernel::Spline(k) => DVec3::from(k.vector()) * k.value(p.to_array()),
                    AnyKernel::Ball(k) => DVec3::from(k.vector()) * k.value(p.to_array()),
                    AnyKernel::Brush(k) => DVec3::from(k.displacement(p.to_array())),
                    AnyKernel::Lattice(k) => DVec3::from(k.displacement(p.to_array())),
                };
            }
        }
        p
    }

    fn backward_with_jacobian(&self, mut p: DVec3) -> (DVec3, DMat3) {
        let mut jacobian = DMat3::IDENTITY;
        if self.bounds.is_none_or(|(lower, upper)| outside(p, lower, upper)) {
            return (p, jacobian);
        }
        for step in &self.steps {
            if step.outside(p) {
                continue;
            }
            let along = |d: [f64; 3], (v, g): (f64, [f64; 3])| (DVec3::from(d) * v, outer(d.into(), g.into()));
            let (displacement, gradient) = match &step.kernel {
                AnyKernel::Spline(k) => along(k.vector(), k.value_and_gradient(p.to_array())),
                AnyKernel::Ball(k) => along(k.vector(), k.value_and_gradient(p.to_array())),
                AnyKernel::Brush(k) => brushed(k, p),
                AnyKernel::Lattice(k) => with_gradient(k, p),
            };
            p -= displacement;
            jacobian -= gradient * jacobian;
        }
        (p, jacobian)
    }

    fn supports(&self) -> Vec<OrientedBox> {
        self.steps.iter().rev().map(|s| s.support).collect()
    }
}

/// Blocks of points in the world, in `f64`.
impl BlockMap<f64> for Prepared {
    fn center(&self) -> DVec3 {
        DVec3::ZERO
    }

    fn backward_block(&self, points: &mut Block<f64>) {
        self.blocks.backward_block(points);
    }

    fn backward_block_with_jacobian(&self, points: &mut Block<f64>, jacobian: &mut JacobianBlock<f64>) {
        self.blocks.backward_block_with_jacobian(points, jacobian);
    }
}

/// A stack ready to be evaluated for whole blocks of points (see [`BlockMap`]). Boxes that a block does not touch cost six
/// comparisons.
#[derive(Debug, Clone, Default)]
pub struct Blocks<T> {
    center: DVec3,
    steps: Vec<BlockStep<T>>,
}

#[derive(Debug, Clone)]
struct BlockStep<T> {
    kernel: AnyKernel<T>,
    /// Lower and upper end along each world axis.
    bounds: [[T; 2]; 3],
}

impl<T: Real> BlockStep<T> {
    /// Whether no point within these bounds can be moved.
    #[inline(always)]
    fn misses(&self, bounds: &[[T; 2]; 3]) -> bool {
        self.bounds.iter().zip(bounds).any(|(a, b)| a[1] < b[0] || b[1] < a[0])
    }
}

/// The steps for one block, compiled for what the processor offers.
struct Displace<'a, T> {
    steps: &'a [BlockStep<T>],
    points: &'a mut Block<T>,
}

impl<T: Real> pulp::WithSimd for Displace<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { steps, points } = self;
        let mut bounds = points.bounds();
        for step in steps {
            if step.misses(&bounds) {
                continue;
            }
            match &step.kernel {
                AnyKernel::Spline(k) => {
                    k.displace(points);
                    shifted(&mut bounds, k.vector());
                }
                AnyKernel::Ball(k) => {
                    k.displace(points);
                    shifted(&mut bounds, k.vector());
                }
                AnyKernel::Brush(k) => {
                    k.displace(points);
                    bounds = points.bounds();
                }
                AnyKernel::Lattice(k) => {
                    k.displace(points);
                    bounds = points.bounds();
                }
            }
        }
    }
}

/// The same with derivatives.
struct DisplaceWithJacobian<'a, T> {
    steps: &'a [BlockStep<T>],
    points: &'a mut Block<T>,
    jacobian: &'a mut JacobianBlock<T>,
}

impl<T: Real> pulp::WithSimd for DisplaceWithJacobian<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { steps, points, jacobian } = self;
        let mut bounds = points.bounds();
        for step in steps {
            if step.misses(&bounds) {
                continue;
            }
            match &step.kernel {
                AnyKernel::Spline(k) => k.displace_with_jacobian(points, jacobian),
                AnyKernel::Ball(k) => k.displace_with_jacobian(points, jacobian),
                AnyKernel::Brush(k) => k.displace_with_jacobian(points, jacobian),
                AnyKernel::Lattice(k) => k.displace_with_jacobian(points, jacobian),
            }
            bounds = points.bounds();
        }
    }
}

/// Bounds of points of which each was moved by some part of `-vector`.
#[inline(always)]
fn shifted<T: Real>(bounds: &mut [[T; 2]; 3], vector: [T; 3]) {
    let zero = T::default();
    for ([lower, upper], d) in bounds.iter_mut().zip(vector) {
        *lower -= d.larger(zero);
        *upper -= d.smaller(zero);
    }
}

impl<T: Real> Blocks<T> {
    /// Every point replaced by its backward image; points relative to the centre, any number of them.
    pub fn backward_batch(&self, x: &mut [T], y: &mut [T], z: &mut [T]) {
        let mut block = Block::default();
        for ((x, y), z) in x.chunks_mut(BLOCK).zip(y.chunks_mut(BLOCK)).zip(z.chunks_mut(BLOCK)) {
            let n = x.len().min(y.len()).min(z.len());
            for (to, from) in [(&mut block.x, &*x), (&mut block.y, &*y), (&mut block.z, &*z)] {
                to[..n].copy_from_slice(&from[..n]);
                // the rest of the last block repeats a point, so that its bounds stay tight
                let last = to[n - 1];
                to[n..].fill(last);
            }
            self.backward_block(&mut block);
            x[..n].copy_from_slice(&block.x[..n]);
            y[..n].copy_from_slice(&block.y[..n]);
            z[..n].copy_from_slice(&block.z[..n]);
        }
    }
}

impl<T: Real> BlockMap<T> for Blocks<T> {
    fn center(&self) -> DVec3 {
        self.center
    }

    fn backward_block(&self, points: &mut Block<T>) {
        if !self.steps.is_empty() {
            lanes::dispatch(Displace { steps: &self.steps, points });
        }
    }

    fn backward_block_with_jacobian(&self, points: &mut Block<T>, jacobian: &mut JacobianBlock<T>) {
        jacobian.set_identity();
        if !self.steps.is_empty() {
            lanes::dispatch(DisplaceWithJacobian { steps: &self.steps, points, jacobian });
        }
    }
}

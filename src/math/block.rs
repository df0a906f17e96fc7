use glam::DVec3;

use super::{Identity, Real};

/// Points in a [`Block`]: enough to fill the vector units many times, few enough to stay in the first-level cache.
pub const BLOCK: usize = 64;

/// A run of points as a structure of arrays.
#[derive(Debug, Clone)]
pub struct Block<T> {
    pub x: [T; BLOCK],
    pub y: [T; BLOCK],
    pub z: [T; BLOCK],
}

impl<T: Real> Default for Block<T> {
    fn default() -> Self {
        let zero = [T::default(); BLOCK];
        Self { x: zero, y: zero, z: zero }
    }
}

impl<T: Real> Block<T> {
    /// Lower and upper corner of the points.
    #[inline(always)]
    pub fn bounds(&self) -> [[T; 2]; 3] {
        [extent(&self.x), extent(&self.y), extent(&self.z)]
    }
}

/// Eight running minima and maxima, so that the reduction is as wide as the vector units.
#[inline(always)]
fn extent<T: Real>(values: &[T; BLOCK]) -> [T; 2] {
    const W: usize = 8;
    let mut lo: [T; W] = std::array::from_fn(|i| values[i]);
    let mut hi = lo;
    for chunk in values.chunks_exact(W) {
        for i in 0..W {
            lo[i] = chunk[i].smaller(lo[i]);
            hi[i] = chunk[i].larger(hi[i]);
        }
    }
    let (mut l, mut h) = (lo[0], hi[0]);
    for i in 1..W {
        l = lo[i].smaller(l);
        h = hi[i].larger(h);
    }
    [l, h]
}

/// The derivatives of a map at the points of a [`Block`]: entry `3 * c + r` is row r, column c (as [`glam::DMat3`]'s array).
#[derive(Debug, Clone)]
pub struct JacobianBlock<T> {
    pub entry: [[T; BLOCK]; 9],
}

impl<T: Real> Default for JacobianBlock<T> {
    fn default() -> Self {
        let mut block = Self { entry: [[T::default(); BLOCK]; 9] };
        block.set_identity();
        block
    }
}

impl<T: Real> JacobianBlock<T> {
    pub fn set_identity(&mut self) {
        for (i, entry) in self.entry.iter_mut().enumerate() {
            *entry = [T::of(if i % 4 == 0 { 1.0 } else { 0.0 }); BLOCK];
        }
    }
}

/// A backward map for whole blocks of points, for hot loops.
///
/// Points are relative to [`BlockMap::center`], so that `f32` holds them to about 1e-7 of their distance from it.
pub trait BlockMap<T: Real>: Sync {
    /// World point that coordinates are relative to.
    fn center(&self) -> DVec3;

    /// Replaces every point by the undeformed point whose value is seen there.
    fn backward_block(&self, points: &mut Block<T>);

    /// The same; `jacobian` (whatever it held) becomes the derivative of the map at the points.
    fn backward_block_with_jacobian(&self, points: &mut Block<T>, jacobian: &mut JacobianBlock<T>);
}

impl<T: Real> BlockMap<T> for Identity {
    fn center(&self) -> DVec3 {
        DVec3::ZERO
    }

    fn backward_block(&self, _: &mut Block<T>) {}

    fn backward_block_with_jacobian(&self, _: &mut Block<T>, jacobian: &mut JacobianBlock<T>) {
        jacobian.set_identity();
    }
}

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::error::{check_length, check_vector, direction};
use super::lattice_kernel::LatticeKernel;
use super::{DeformError, Limited};
use crate::math::OrientedBox;

/// Handles along one side of a lattice.
const LEAST: usize = 2;
const MOST: usize = 32;

/// A free-form deformation: a grid of handles in an oriented box, each with a displacement vector.
///
/// With `n` handles along a side, the box has `n + 2` knot intervals there, and handle `i` lies at the middle of interval
/// `i + 1`. The displacement is the tensor product of quadratic B-splines with the handles' vectors as coefficients. As every
/// spline lies within the box, the displacement and its slope vanish at the faces. In the *core*, two intervals from every
/// face (sides of three handles or more have one), the weights sum to 1: equal handles translate it.
///
/// The vectors are those of the backward field: near a handle's place, what is seen comes from that place less the vector.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Plain")]
pub struct Lattice {
    center: DVec3,
    axes: DMat3,
    half: DVec3,
    dims: [usize; 3],
    handles: Vec<DVec3>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Plain {
    center: DVec3,
    axes: DMat3,
    half: DVec3,
    dims: [usize; 3],
    handles: Vec<DVec3>,
}

impl TryFrom<Plain> for Lattice {
    type Error = DeformError;

    fn try_from(p: Plain) -> Result<Self, DeformError> {
        Self::new(OrientedBox { center: p.center, axes: p.axes, half: p.half }, p.dims)?.with_handles(p.handles)
    }
}

impl Lattice {
    /// A lattice at rest that acts inside `support`, with 2 to 32 handles along each of its axes.
    ///
    /// # Errors
    /// If the box is not one (numbers not finite, no size, axes not orthonormal) or the lattice too small or too large.
    pub fn new(support: OrientedBox, dims: [usize; 3]) -> Result<Self, DeformError> {
        let OrientedBox { center, axes, half } = support;
        check_vector("lattice's centre", center)?;
        for h in half.to_array() {
            check_length("lattice's half-length", h)?;
        }
        let sound = axes.is_finite()
            && (axes.transpose() * axes - DMat3::IDENTITY).to_cols_array().iter().all(|e| e.abs() < 1e-6)
            && axes.determinant() > 0.0;
        if !sound {
            return Err(DeformError::Axes);
        }
        if !dims.iter().all(|d| (LEAST..=MOST).contains(d)) {
            return Err(DeformError::LatticeSize { dims, least: LEAST, most: MOST });
        }
        Ok(Self { center, axes, half, dims, handles: vec![DVec3::ZERO; dims.iter().product()] })
    }

    /// The same lattice with these displacement vectors, the first axis fastest.
    ///
    /// # Errors
    /// If there are not as many as handles, or one is not finite.
    pub fn with_handles(mut self, handles: Vec<DVec3>) -> Result<Self, DeformError> {
        let expected = self.handles.len();
        if handles.len() != expected {
            return Err(DeformError::LatticeHandles { expected, got: handles.len() });
        }
        for h in &handles {
            check_vector("lattice's handle vector", *h)?;
        }
        self.handles = handles;
        Ok(self)
    }

    /// Sets every handle's vector from its index and its place at rest.
    ///
    /// # Errors
    /// If a vector is not finite.
    pub fn with_vectors(self, vector: impl Fn([usize; 3], DVec3) -> DVec3) -> Result<Self, DeformError> {
        let handles = self.indices().map(|i| vector(i, self.place(i))).collect();
        self.with_handles(handles)
    }

    /// With all vectors times `scale`.
    ///
    /// # Errors
    /// If a product is too long.
    pub(super) fn scaled(&self, scale: f64) -> Result<Self, DeformError> {
        self.clone().with_handles(self.handles.iter().map(|h| *h * scale).collect())
    }

    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Displacement vectors, the first axis fastest.
    pub fn handles(&self) -> &[DVec3] {
        &self.handles
    }

    /// Indices of the handles in the order of [`Lattice::handles`].
    pub fn indices(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let [nx, ny, nz] = self.dims;
        (0..nx * ny * nz).map(move |i| [i % nx, i / nx % ny, i / (nx * ny)])
    }

    /// World place of a handle at rest.
    pub fn place(&self, index: [usize; 3]) -> DVec3 {
        let step = self.step();
        let local = DVec3::from_array(std::array::from_fn(|a| (index[a] as f64 + 1.5) * step[a])) - self.half;
        self.center + self.axes * local
    }

    /// Knot interval along each axis, in world units.
    pub fn step(&self) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|a| 2.0 * self.half[a] / (self.dims[a] + 2) as f64))
    }

    /// The box outside which nothing moves.
    pub fn support(&self) -> OrientedBox {
        OrientedBox { center: self.center, axes: self.axes, half: self.half }
    }

    /// The box in which equal handles act as a translation; `None` if a side has only two handles.
    pub fn core(&self) -> Option<OrientedBox> {
        let half = self.half - 2.0 * self.step();
        self.dims.iter().all(|d| *d > 2).then_some(OrientedBox { center: self.center, axes: self.axes, half })
    }

    /// The longest handle vector.
    pub fn largest_vector(&self) -> f64 {
        self.handles.iter().map(|h| h.length()).fold(0.0, f64::max)
    }

    /// A bound of the largest eigenvalue of the symmetric part of `grad D`: below 1 the map is injective.
    ///
    /// Along an axis the derivative of the field is a convex combination of the differences of neighbouring handle vectors
    /// (zero beyond the lattice) over the knot interval. So in each knot cell every entry of `grad D` lies between the least
    /// and the largest of the 18 differences that act there. The largest eigenvalue of a symmetric matrix is at most that
    /// of the matrix with the upper bounds on its diagonal and the bounds of the magnitudes elsewhere; the cell with the
    /// largest counts. The bound is sufficient, not sharp: [`Lattice::smallest_determinant`] looks at the map itself.
    pub fn steepness(&self) -> f64 {
        let padded = self.padded();
        let step = self.step();
        let [mx, my, mz] = self.dims.map(|d| d + 4);
        let at = |c: [usize; 3]| padded[(c[2] * my + c[1]) * mx + c[0]];
        let mut worst = 0.0_f64;
        for (cz, cy, cx) in (0..mz - 2).flat_map(|z| (0..my - 2).flat_map(move |y| (0..mx - 2).map(move |x| (z, y, x))))
        {
            // lo and hi of component r of the derivative along axis c
            let mut lo = [[f64::INFINITY; 3]; 3];
            let mut hi = [[f64::NEG_INFINITY; 3]; 3];
            for k in 0..27 {
                let offset = [k % 3, k / 3 % 3, k / 9];
                let here = [cx + offset[0], cy + offset[1], cz + offset[2]];
                for c in 0..3 {
                    if offset[c] == 2 {
                        continue;
                    }
                    let mut next = here;
                    next[c] += 1;
                    let slope = (at(next) - at(here)) / step[c];
                    for r in 0..3 {
                        lo[c][r] = lo[c][r].min(slope[r]);
                        hi[c][r] = hi[c][r].max(slope[r]);
                    }
                }
            }
            let off = |r: usize, c: usize| 0.5 * (hi[c][r] + hi[r][c]).abs().max((lo[c][r] + lo[r][c]).abs());
            worst = worst.max(largest_eigenvalue([hi[0][0], hi[1][1], hi[2][2]], [off(0, 1), off(0, 2), off(1, 2)]));
        }
        worst
    }

    /// The smallest determinant of the map's derivative at `per_cell`^3 points of every knot cell; not positive where it folds.
    pub fn smallest_determinant(&self, per_cell: usize) -> f64 {
        let kernel = self.kernel();
        let n = per_cell.max(1);
        let counts = self.dims.map(|d| (d + 2) * n);
        let mut least = 1.0_f64;
        for z in 0..counts[2] {
            for y in 0..counts[1] {
                for x in 0..counts[0] {
                    let knots = [x, y, z].map(|i| (i as f64 + 0.5) / n as f64);
                    least = least.min((DMat3::IDENTITY - kernel.gradient_at_knots(knots)).determinant());
                }
            }
        }
        least
    }

    /// The same with all vectors scaled so that the steepness is at most `1 - margin`, if it is more.
    pub fn clamp_to_injective(&self, margin: f64) -> Limited<Self> {
        Limited::by_scale(self.steepness(), margin, self.largest_vector(), |s| Self {
            handles: self.handles.iter().map(|h| *h * s).collect(),
            ..self.clone()
        })
    }

    /// The same deformation on the other side of the plane through `origin` across `normal`.
    ///
    /// # Errors
    /// If the normal has no direction.
    pub fn mirrored(&self, origin: DVec3, normal: DVec3) -> Result<Self, DeformError> {
        let n = direction(normal)?;
        let flip = |v: DVec3| v - 2.0 * v.dot(n) * n;
        // the first axis is turned round once more, so that the frame stays right-handed
        let axes = DMat3::from_cols(-flip(self.axes.x_axis), flip(self.axes.y_axis), flip(self.axes.z_axis));
        let [nx, ny, _] = self.dims;
        let handles = self.indices().map(|[i, j, k]| flip(self.handles[(k * ny + j) * nx + nx - 1 - i])).collect();
        Self::new(OrientedBox { center: origin + flip(self.center - origin), axes, half: self.half }, self.dims)?
            .with_handles(handles)
    }

    /// Handle vectors with two layers of zeros all round, in the lattice's own axes.
    fn padded(&self) -> Vec<DVec3> {
        // so that derivatives along its axes are the columns of one matrix
        let to_local = self.axes.transpose();
        let [nx, ny, nz] = self.dims;
        let [mx, my, mz] = self.dims.map(|d| d + 4);
        let mut padded = vec![DVec3::ZERO; mx * my * mz];
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    padded[((k + 2) * my + j + 2) * mx + i + 2] = to_local * self.handles[(k * ny + j) * nx + i];
                }
            }
        }
        padded
    }

    pub(super) fn kernel(&self) -> LatticeKernel<f64> {
        let corner = self.center - self.axes * self.half;
        LatticeKernel::new(corner, self.axes, self.step(), self.dims.map(|d| d + 2), &self.padded())
    }
}

/// The largest eigenvalue of the symmetric matrix with this diagonal and the entries 01, 02, 12.
fn largest_eigenvalue(diagonal: [f64; 3], [xy, xz, yz]: [f64; 3]) -> f64 {
    let [a, b, c] = diagonal;
    let mean = (a + b + c) / 3.0;
    let spread = (a - mean).powi(2) + (b - mean).powi(2) + (c - mean).powi(2) + 2.0 * (xy * xy + xz * xz + yz * yz);
    let p = (spread / 6.0).sqrt();
    if p <= 1e-300 {
        return mean;
    }
    let m = DMat3::from_cols_array(&[a - mean, xy, xz, xy, b - mean, yz, xz, yz, c - mean]) * (1.0 / p);
    let angle = (0.5 * m.determinant()).clamp(-1.0, 1.0).acos() / 3.0;
    mean + 2.0 * p * angle.cos()
}

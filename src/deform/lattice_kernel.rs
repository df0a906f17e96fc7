//! A lattice with everything precomputed; the same formulas in `f32` and `f64`.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use super::framed::Region;
use crate::math::bspline::{basis, basis_slope};
use crate::math::{BLOCK, Block, JacobianBlock, Real};

#[derive(Debug, Clone)]
pub(super) struct LatticeKernel<T> {
    corner: [T; 3],
    /// Knot intervals along u, v, w for a step along each coordinate: the unit axes over the knots' distances.
    knots_from_offset: [[T; 3]; 3],
    /// What a unit vector of the lattice is in coordinates: in the world, the unit axes.
    axes: [[T; 3]; 3],
    /// Knot intervals along each axis.
    cells: [usize; 3],
    /// Vectors in the lattice's own axes, with two layers of zeros all round; the fourth number fills the vector unit.
    coefficients: Arc<[[T; 4]]>,
    /// Bounds of the displacement along each coordinate: it is a convex combination of the coefficients.
    pub range: [[T; 2]; 3],
}

impl LatticeKernel<f64> {
    /// `coefficients`: in the lattice's axes, two more than `cells` along each axis, the first fastest.
    pub fn new(corner: DVec3, axes: DMat3, step: DVec3, cells: [usize; 3], coefficients: &[DVec3]) -> Self {
        let kernel = Self {
            range: [[0.0; 2]; 3],
            corner: corner.to_array(),
            knots_from_offset: (axes * DMat3::from_diagonal(step.recip())).to_cols_array_2d(),
            axes: axes.to_cols_array_2d(),
            cells,
            coefficients: coefficients.iter().map(|c| [c.x, c.y, c.z, 0.0]).collect(),
        };
        kernel.bounded()
    }

    /// With the bounds of its displacement.
    fn bounded(mut self) -> Self {
        let vectors = self.coefficients.iter().map(|c| DVec3::from(self.world(*c)));
        let (lo, hi) = vectors.fold((DVec3::ZERO, DVec3::ZERO), |(lo, hi), v| (lo.min(v), hi.max(v)));
        self.range = std::array::from_fn(|a| [lo[a], hi[a]]);
        self
    }

    /// In another precision and relative to `center`.
    pub fn about<T: Real>(&self, center: DVec3) -> LatticeKernel<T> {
        self.about_with(center, self.coefficients.iter().map(|c| c.map(T::of)).collect())
    }

    /// The same with coefficients that are there already.
    pub fn about_with<T: Real>(&self, center: DVec3, coefficients: Arc<[[T; 4]]>) -> LatticeKernel<T> {
        LatticeKernel {
            corner: (DVec3::from(self.corner) - center).to_array().map(T::of),
            knots_from_offset: self.knots_from_offset.map(|a| a.map(T::of)),
            axes: self.axes.map(|a| a.map(T::of)),
            cells: self.cells,
            coefficients,
            range: self.range.map(|r| r.map(T::of)),
        }
    }

    /// In coordinates of which the world is an affine image.
    pub fn in_frame(&self, world_from_local: &DAffine3) -> Self {
        let local_from_world = world_from_local.inverse();
        let axes_from_local = world_from_local.matrix3.transpose();
        let kernel = Self {
            corner: local_from_world.transform_point3(self.corner.into()).to_array(),
            knots_from_offset: self.knots_from_offset.map(|a| (axes_from_local * DVec3::from(a)).to_array()),
            axes: self.axes.map(|a| local_from_world.transform_vector3(a.into()).to_array()),
            ..self.clone()
        };
        kernel.bounded()
    }

    pub fn narrow(&self) -> Arc<[[f32; 4]]> {
        self.coefficients.iter().map(|c| c.map(|x| x as f32)).collect()
    }

    pub fn region(&self) -> Region<f64> {
        let cells = DVec3::from(self.cells.map(|n| n as f64));
        Region::new(self.knots_from_offset, self.corner, DVec3::ZERO, cells)
    }

    /// The derivative of the displacement in the lattice's own axes, at a place inside given in knot intervals.
    pub fn gradient_at_knots(&self, knots: [f64; 3]) -> DMat3 {
        let [_, u, v, w] = self.sums(knots);
        DMat3::from_cols_array_2d(&[u, v, w].map(|d| [d[0], d[1], d[2]]))
            * DMat3::from_diagonal(self.knots_from_offset.map(|a| DVec3::from(a).length()).into())
    }
}

impl<T: Real> LatticeKernel<T> {
    /// The place in knot intervals; `None` outside.
    #[inline(always)]
    fn knots(&self, p: [T; 3]) -> Option<[T; 3]> {
        let r: [T; 3] = std::array::from_fn(|i| p[i] - self.corner[i]);
        let knots: [T; 3] = std::array::from_fn(|a| {
            let axis = self.knots_from_offset[a];
            axis[0] * r[0] + axis[1] * r[1] + axis[2] * r[2]
        });
        let inside = (0..3).all(|a| knots[a] > T::default() && knots[a] < T::of(self.cells[a] as f64));
        inside.then_some(knots)
    }

    /// From the lattice's axes to the coordinates'.
    #[inline(always)]
    fn world(&self, v: [T; 4]) -> [T; 3] {
        let [a, b, c] = self.axes;
        std::array::from_fn(|i| a[i] * v[0] + b[i] * v[1] + c[i] * v[2])
    }

    #[inline(always)]
    fn cell(&self, knots: [T; 3]) -> ([usize; 3], [T; 3]) {
        let cell = knots.map(T::floor_index);
        (cell, std::array::from_fn(|a| knots[a] - T::of(cell[a] as f64)))
    }

    /// The three coefficients of row j, k that act in `cell`.
    #[inline(always)]
    fn row(&self, cell: [usize; 3], j: usize, k: usize) -> [[T; 4]; 3] {
        let (mx, my) = (self.cells[0] + 2, self.cells[1] + 2);
        let first = ((cell[2] + k) * my + cell[1] + j) * mx + cell[0];
        let c = &self.coefficients[first..first + 3];
        [c[0], c[1], c[2]]
    }

    /// The displacement at `p`.
    #[inline(always)]
    pub fn displacement(&self, p: [T; 3]) -> [T; 3] {
        let Some(knots) = self.knots(p) else { return [T::default(); 3] };
        let (cell, fraction) = self.cell(knots);
        let [bx, by, bz] = fraction.map(basis);
        let mut sum = [T::default(); 4];
        for (k, wz) in bz.into_iter().enumerate() {
            for (j, wy) in by.into_iter().enumerate() {
                let [c0, c1, c2] = self.row(cell, j, k);
                let weight = wy * wz;
                for i in 0..4 {
                    sum[i] += (c0[i] * bx[0] + c1[i] * bx[1] + c2[i] * bx[2]) * weight;
                }
            }
        }
        self.world(sum)
    }

    /// In the lattice's axes: the displacement, and its derivatives by the knot coordinates.
    #[inline(always)]
    fn sums(&self, knots: [T; 3]) -> [[T; 4]; 4] {
        let (cell, fraction) = self.cell(knots);
        let ([bx, by, bz], [sx, sy, sz]) = (fraction.map(basis), fraction.map(basis_slope));
        let mut sums = [[T::default(); 4]; 4];
        let [d, du, dv, dw] = &mut sums;
        for k in 0..3 {
            for j in 0..3 {
                let [c0, c1, c2] = self.row(cell, j, k);
                let (here, across, up) = (by[j] * bz[k], sy[j] * bz[k], by[j] * sz[k]);
                for i in 0..4 {
                    let along = c0[i] * bx[0] + c1[i] * bx[1] + c2[i] * bx[2];
                    d[i] += along * here;
                    du[i] += (c0[i] * sx[0] + c1[i] * sx[1] + c2[i] * sx[2]) * here;
                    dv[i] += along * across;
                    dw[i] += along * up;
                }
            }
        }
        sums
    }

    /// The displacement and its derivative by world position, column by column.
    #[inline(always)]
    pub fn displacement_with_gradient(&self, p: [T; 3]) -> ([T; 3], [[T; 3]; 3]) {
        let Some(knots) = self.knots(p) else { return ([T::default(); 3], [[T::default(); 3]; 3]) };
        let [d, du, dv, dw] = self.sums(knots);
        let [du, dv, dw] = [self.world(du), self.world(dv), self.world(dw)];
        let [a, b, c] = self.knots_from_offset;
        let gradient = std::array::from_fn(|column| {
            std::array::from_fn(|r| du[r] * a[column] + dv[r] * b[column] + dw[r] * c[column])
        });
        (self.world(d), gradient)
    }

    /// `p - D(p)` for every point of the block.
    pub fn displace(&self, b: &mut Block<T>) {
        for i in 0..BLOCK {
            let d = self.displacement([b.x[i], b.y[i], b.z[i]]);
            b.x[i] -= d[0];
            b.y[i] -= d[1];
            b.z[i] -= d[2];
        }
    }

    /// The same; `jacobian` is multiplied from the left by `I - grad D`.
    #[inline(always)]
    pub fn displace_with_jacobian(&self, b: &mut Block<T>, jacobian: &mut JacobianBlock<T>) {
        for i in 0..BLOCK {
            let (d, g) = self.displacement_with_gradient([b.x[i], b.y[i], b.z[i]]);
            b.x[i] -= d[0];
            b.y[i] -= d[1];
            b.z[i] -= d[2];
            for column in jacobian.entry.chunks_exact_mut(3) {
                let before = [column[0][i], column[1][i], column[2][i]];
                for r in 0..3 {
                    column[r][i] -= g[0][r] * before[0] + g[1][r] * before[1] + g[2][r] * before[2];
                }
            }
        }
    }
}

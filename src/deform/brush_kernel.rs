//! A brush with everything precomputed; the same formulas in `f32` and `f64`.

use glam::{DAffine3, DMat3, DVec3};

use super::framed::Region;
use super::kernel::{BallKernel, Kernel, profile_of, smooth, spline, with_core};
use super::{Brush, Falloff};
use crate::math::turn::{turn, turn_slopes};
use crate::math::{BLOCK, Block, JacobianBlock, Real};

/// The displacement `f A r`, or of a twist `sin(angle f) A r - (1 - cos(angle f)) A^2 r`, at `r` from the centre.
#[derive(Debug, Clone, Copy)]
pub(super) struct BrushKernel<T> {
    /// What it is in the world.
    pub brush: Brush,
    /// Centre, metric and falloff; its vector is 0.
    pub ball: BallKernel<T>,
    /// The rows of `A` and of `A^2`.
    first: [[T; 3]; 3],
    second: [[T; 3]; 3],
    /// The angle of a twist in full turns.
    turns: Option<T>,
    /// The rows of `A` and of `A^2` for places in the unit ball instead of `r`.
    unit_first: [[T; 3]; 3],
    unit_second: [[T; 3]; 3],
    /// Half of the ball's bounding box along each coordinate.
    half: [T; 3],
}

fn rows(m: DMat3) -> [[f64; 3]; 3] {
    m.transpose().to_cols_array_2d()
}

#[inline(always)]
fn apply<T: Real>(m: &[[T; 3]; 3], v: [T; 3]) -> [T; 3] {
    let row = |r: [T; 3]| r[0] * v[0] + r[1] * v[1] + r[2] * v[2];
    [row(m[0]), row(m[1]), row(m[2])]
}

impl BrushKernel<f64> {
    pub fn new(brush: &Brush, center: DVec3) -> Self {
        let ball = BallKernel::new(center, brush.radius(), DVec3::ZERO, brush.falloff());
        let (generator, turns) = brush.generator();
        Self::about_ball(brush, ball, generator, turns)
    }

    fn about_ball(brush: &Brush, ball: BallKernel<f64>, generator: DMat3, turns: Option<f64>) -> Self {
        let from_unit = DMat3::from_cols_array_2d(&ball.rows()).transpose().inverse();
        let square = generator * generator;
        let spans = from_unit.transpose();
        Self {
            brush: *brush,
            ball,
            first: rows(generator),
            second: rows(square),
            turns,
            unit_first: rows(generator * from_unit),
            unit_second: rows(square * from_unit),
            half: [spans.x_axis, spans.y_axis, spans.z_axis].map(DVec3::length),
        }
    }

    /// In coordinates of which the world is an affine image.
    pub fn in_frame(&self, world_from_local: &DAffine3) -> Self {
        let generator = DMat3::from_cols_array_2d(&self.first).transpose();
        let generator = world_from_local.matrix3.inverse() * generator * world_from_local.matrix3;
        Self::about_ball(&self.brush, self.ball.in_frame(world_from_local), generator, self.turns)
    }

    /// In another precision and relative to `center`.
    pub fn about<T: Real>(&self, center: DVec3) -> BrushKernel<T> {
        let narrow = |m: [[f64; 3]; 3]| m.map(|row| row.map(T::of));
        BrushKernel {
            brush: self.brush,
            ball: self.ball.about(center),
            first: narrow(self.first),
            second: narrow(self.second),
            turns: self.turns.map(T::of),
            unit_first: narrow(self.unit_first),
            unit_second: narrow(self.unit_second),
            half: self.half.map(T::of),
        }
    }
}

impl<T: Real> BrushKernel<T> {
    /// `f A r`, if `profile` is that of the ball.
    #[inline(always)]
    fn straight(&self, p: [T; 3], profile: impl Fn(T) -> (T, T)) -> [T; 3] {
        let f = self.ball.value_by(p, profile);
        let u = apply(&self.first, self.ball.offset(p));
        [f * u[0], f * u[1], f * u[2]]
    }

    /// The displacement of a twist.
    #[inline(always)]
    fn turned(&self, p: [T; 3], turns: T, profile: impl Fn(T) -> (T, T)) -> [T; 3] {
        let (sin, versed) = turn(turns * self.ball.value_by(p, profile));
        let u = apply(&self.first, self.ball.offset(p));
        let v = apply(&self.first, u);
        [sin * u[0] - versed * v[0], sin * u[1] - versed * v[1], sin * u[2] - versed * v[2]]
    }

    /// `f A r` and its derivative, row by row.
    #[inline(always)]
    fn straight_with_gradient(&self, p: [T; 3], profile: impl Fn(T) -> (T, T)) -> ([T; 3], [[T; 3]; 3]) {
        let (f, slope) = self.ball.value_and_gradient_by(p, profile);
        let u = apply(&self.first, self.ball.offset(p));
        let row = |a: usize| {
            let m = self.first[a];
            [f * m[0] + u[a] * slope[0], f * m[1] + u[a] * slope[1], f * m[2] + u[a] * slope[2]]
        };
        ([f * u[0], f * u[1], f * u[2]], [row(0), row(1), row(2)])
    }

    /// The displacement of a twist and its derivative, row by row.
    #[inline(always)]
    fn turned_with_gradient(&self, p: [T; 3], turns: T, profile: impl Fn(T) -> (T, T)) -> ([T; 3], [[T; 3]; 3]) {
        let (f, slope) = self.ball.value_and_gradient_by(p, profile);
        let both = turn(turns * f);
        let ((sin, versed), (ds, dv)) = (both, turn_slopes(both));
        let u = apply(&self.first, self.ball.offset(p));
        let v = apply(&self.first, u);
        let radians = turns * T::of(std::f64::consts::TAU);
        let row = |a: usize| {
            let (m, q) = (self.first[a], self.second[a]);
            let by_angle = (ds * u[a] - dv * v[a]) * radians;
            let entry = |b: usize| sin * m[b] - versed * q[b] + by_angle * slope[b];
            [entry(0), entry(1), entry(2)]
        };
        let d = [sin * u[0] - versed * v[0], sin * u[1] - versed * v[1], sin * u[2] - versed * v[2]];
        (d, [row(0), row(1), row(2)])
    }

    /// The displacement at `p`.
    pub fn displacement(&self, p: [T; 3]) -> [T; 3] {
        let profile = profile_of(self.ball.falloff);
        self.turns.map_or_else(|| self.straight(p, &profile), |turns| self.turned(p, turns, &profile))
    }

    /// The displacement and its derivative, row by row.
    pub fn displacement_with_gradient(&self, p: [T; 3]) -> ([T; 3], [[T; 3]; 3]) {
        let profile = profile_of(self.ball.falloff);
        match self.turns {
            None => self.straight_with_gradient(p, profile),
            Some(turns) => self.turned_with_gradient(p, turns, profile),
        }
    }

    /// Bounds of the displacement along each coordinate over a box in the coordinates of the region, whose points lie between
    /// `bounds`: by interval arithmetic.
    #[inline(always)]
    pub fn range(&self, bounds: &[[T; 2]; 3], at: [T; 3], around: [T; 3]) -> [[T; 2]; 3] {
        let (zero, one) = (T::default(), T::of(1.0));
        let f = self.ball.range(at, around);
        // beyond the ball nothing moves
        let unit: [[T; 2]; 3] = std::array::from_fn(|a| {
            [(at[a] - around[a]).larger(zero - one).smaller(one), (at[a] + around[a]).smaller(one).larger(zero - one)]
        });
        let first = self.unit_first.map(|row| combined(row, unit));
        let Some(turns) = self.turns else { return first.map(|c| product(f, c)) };
        let half = T::of(0.5);
        let (sin, versed) = turn(turns * (half * (f[0] + f[1])));
        // neither changes faster than the angle
        let slack = turns.magnitude() * T::of(std::f64::consts::TAU) * (half * (f[1] - f[0]));
        let sin = [(sin - slack).larger(zero - one), (sin + slack).smaller(one)];
        let versed = [(versed - slack).larger(zero), (versed + slack).smaller(T::of(2.0))];
        let second = self.unit_second.map(|row| combined(row, unit));
        // every sphere is turned in itself: no image is farther from the centre than the farthest point
        let mut far = zero;
        for [lo, hi] in unit {
            let most = (zero - lo).larger(hi);
            far += most * most;
        }
        let far = far.root().smaller(one);
        std::array::from_fn(|a| {
            let (s, v) = (product(sin, first[a]), product(versed, second[a]));
            let reach = far * self.half[a];
            let least_image = bounds[a][0].smaller(self.ball.center[a] - reach);
            let most_image = bounds[a][1].larger(self.ball.center[a] + reach);
            // images are what is left when the displacement is subtracted
            [(s[0] - v[1]).larger(bounds[a][0] - most_image), (s[1] - v[0]).smaller(bounds[a][1] - least_image)]
        })
    }

    // action and falloff are chosen outside the loops, so that each loop is free of branches

    /// `p - D(p)` for every point of the block.
    #[inline(always)]
    pub fn displace(&self, b: &mut Block<T>) {
        match self.ball.falloff {
            Falloff::Smooth => self.displace_by(b, smooth),
            Falloff::Spline => self.displace_by(b, spline),
            Falloff::Core(core) => self.displace_by(b, with_core(core)),
        }
    }

    #[inline(always)]
    fn displace_by(&self, b: &mut Block<T>, profile: impl Fn(T) -> (T, T)) {
        match self.turns {
            None => {
                for i in 0..BLOCK {
                    let d = self.straight([b.x[i], b.y[i], b.z[i]], &profile);
                    subtract(b, i, d);
                }
            }
            Some(turns) => {
                for i in 0..BLOCK {
                    let d = self.turned([b.x[i], b.y[i], b.z[i]], turns, &profile);
                    subtract(b, i, d);
                }
            }
        }
    }

    /// The same; `jacobian` is multiplied from the left by `I - grad D`.
    #[inline(always)]
    pub fn displace_with_jacobian(&self, b: &mut Block<T>, jacobian: &mut JacobianBlock<T>) {
        match self.ball.falloff {
            Falloff::Smooth => self.displace_with_jacobian_by(b, jacobian, smooth),
            Falloff::Spline => self.displace_with_jacobian_by(b, jacobian, spline),
            Falloff::Core(core) => self.displace_with_jacobian_by(b, jacobian, with_core(core)),
        }
    }

    #[inline(always)]
    fn displace_with_jacobian_by(
        &self,
        b: &mut Block<T>,
        jacobian: &mut JacobianBlock<T>,
        profile: impl Fn(T) -> (T, T),
    ) {
        let mut gradient = [[T::default(); BLOCK]; 9];
        match self.turns {
            None => {
                for i in 0..BLOCK {
                    let (d, g) = self.straight_with_gradient([b.x[i], b.y[i], b.z[i]], &profile);
                    keep(&mut gradient, i, g);
                    subtract(b, i, d);
                }
            }
            Some(turns) => {
                for i in 0..BLOCK {
                    let (d, g) = self.turned_with_gradient([b.x[i], b.y[i], b.z[i]], turns, &profile);
                    keep(&mut gradient, i, g);
                    subtract(b, i, d);
                }
            }
        }
        derive(&gradient, jacobian);
    }
}

#[inline(always)]
fn subtract<T: Real>(b: &mut Block<T>, i: usize, d: [T; 3]) {
    b.x[i] -= d[0];
    b.y[i] -= d[1];
    b.z[i] -= d[2];
}

#[inline(always)]
fn keep<T: Real>(gradient: &mut [[T; BLOCK]; 9], i: usize, rows: [[T; 3]; 3]) {
    for r in 0..3 {
        for c in 0..3 {
            gradient[3 * r + c][i] = rows[r][c];
        }
    }
}

/// `jacobian` from the left by `I - gradient`.
#[inline(always)]
fn derive<T: Real>(gradient: &[[T; BLOCK]; 9], jacobian: &mut JacobianBlock<T>) {
    let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = gradient;
    for column in jacobian.entry.chunks_exact_mut(3) {
        let [x, y, z] = column else { continue };
        for i in 0..BLOCK {
            let before = [x[i], y[i], z[i]];
            x[i] -= xx[i] * before[0] + xy[i] * before[1] + xz[i] * before[2];
            y[i] -= yx[i] * before[0] + yy[i] * before[1] + yz[i] * before[2];
            z[i] -= zx[i] * before[0] + zy[i] * before[1] + zz[i] * before[2];
        }
    }
}

impl BrushKernel<f64> {
    pub fn region(&self) -> Region<f64> {
        self.ball.region()
    }
}

/// Bounds of `row . x` with each part of `x` within its own bounds.
#[inline(always)]
fn combined<T: Real>(row: [T; 3], x: [[T; 2]; 3]) -> [T; 2] {
    let mut sum = [T::default(); 2];
    for a in 0..3 {
        let (p, q) = (row[a] * x[a][0], row[a] * x[a][1]);
        sum[0] += p.smaller(q);
        sum[1] += p.larger(q);
    }
    sum
}

/// Bounds of a product of two numbers within these bounds.
#[inline(always)]
fn product<T: Real>(a: [T; 2], b: [T; 2]) -> [T; 2] {
    let [p, q, r, s] = [a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]];
    [p.smaller(q).smaller(r.smaller(s)), p.larger(q).larger(r.larger(s))]
}

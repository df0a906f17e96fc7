//! Signed distances, smooth set operations, and their simplification over a block of voxels.
//!
//! # Theory
//!
//! A shape is a list of primitives joined by smooth union, difference and intersection (quadratic polynomial smooth minimum,
//! which is exactly the minimum where the operands differ by more than `k`). Evaluating hundreds of primitives in every
//! voxel is slow, and over a small block nearly all of them are decided: with an interval for the distance of each
//! primitive (its value at the centre of the block, plus and minus slope times the block's radius) an operand that cannot
//! win anywhere in the block is left out, and a whole shape that is far from its surface becomes a constant. This is the
//! tape shortening of Keeter, "Massively Parallel Rendering of Complex Closed-Form Implicit Surfaces" (2020), for one level
//! of blocks. The result is the same as without; a test compares both.

use glam::{Mat3, Vec3};

/// A primitive; lengths in millimetres. Distances are negative inside.
#[derive(Debug, Clone, Copy)]
pub enum Solid {
    Ellipsoid {
        c: Vec3,
        inv: Vec3,
        least: f32,
        local: Mat3,
    },
    /// A capsule whose radius runs linearly from `ra` at `a` to `ra + dr` at `a + ab`.
    Cone {
        a: Vec3,
        ab: Vec3,
        inv_len2: f32,
        ra: f32,
        dr: f32,
    },
    /// A box with rounded edges.
    Cuboid {
        c: Vec3,
        half: Vec3,
        local: Mat3,
        round: f32,
    },
    /// A capped cylinder with rounded rims.
    Cylinder {
        c: Vec3,
        axis: Vec3,
        half: f32,
        r: f32,
        round: f32,
    },
    /// A ring around the local z axis.
    Torus {
        c: Vec3,
        local: Mat3,
        major: f32,
        minor: f32,
    },
    /// Everything below the plane.
    Half {
        n: Vec3,
        d: f32,
    },
}

pub fn v(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Rotation by degrees about x, then y, then z.
pub fn turn(x: f32, y: f32, z: f32) -> Mat3 {
    Mat3::from_rotation_z(z.to_radians())
        * Mat3::from_rotation_y(y.to_radians())
        * Mat3::from_rotation_x(x.to_radians())
}

pub fn ellipsoid(c: Vec3, r: Vec3) -> Solid {
    Solid::Ellipsoid { c, inv: r.recip(), least: r.min_element(), local: Mat3::IDENTITY }
}

/// An ellipsoid whose axes are turned by `rot`.
pub fn turned_ellipsoid(c: Vec3, r: Vec3, rot: Mat3) -> Solid {
    Solid::Ellipsoid { c, inv: r.recip(), least: r.min_element(), local: rot.transpose() }
}

pub fn ball(c: Vec3, r: f32) -> Solid {
    cone(c, c, r, r)
}

pub fn cone(a: Vec3, b: Vec3, ra: f32, rb: f32) -> Solid {
    let ab = b - a;
    let len2 = ab.length_squared();
    Solid::Cone { a, ab, inv_len2: if len2 > 0.0 { len2.recip() } else { 0.0 }, ra, dr: rb - ra }
}

pub fn rod(a: Vec3, b: Vec3, r: f32) -> Solid {
    cone(a, b, r, r)
}

pub fn cuboid(c: Vec3, half: Vec3, round: f32) -> Solid {
    turned_cuboid(c, half, round, Mat3::IDENTITY)
}

pub fn turned_cuboid(c: Vec3, half: Vec3, round: f32, rot: Mat3) -> Solid {
    let round = round.min(half.min_element());
    Solid::Cuboid { c, half: half - round, local: rot.transpose(), round }
}

pub fn cylinder(a: Vec3, b: Vec3, r: f32, round: f32) -> Solid {
    let half = 0.5 * a.distance(b);
    let round = round.min(half).min(r);
    Solid::Cylinder { c: 0.5 * (a + b), axis: (b - a).normalize(), half: half - round, r: r - round, round }
}

pub fn torus(c: Vec3, rot: Mat3, major: f32, minor: f32) -> Solid {
    Solid::Torus { c, local: rot.transpose(), major, minor }
}

/// The half space whose surface goes through `p` and whose outside lies along `n`.
pub fn half(p: Vec3, n: Vec3) -> Solid {
    let n = n.normalize();
    Solid::Half { n, d: n.dot(p) }
}

impl Solid {
    #[inline]
    pub fn distance(&self, p: Vec3) -> f32 {
        match *self {
            Self::Ellipsoid { c, inv, least, local } => {
                // first-order distance; cut off below so that it is continuous at the centre
                let q = local * (p - c) * inv;
                let (k0, k1) = (q.length(), (q * inv).length());
                if k1 > 0.0 { (k0 * (k0 - 1.0) / k1).max(-least) } else { -least }
            }
            Self::Cone { a, ab, inv_len2, ra, dr } => {
                let q = p - a;
                let t = (q.dot(ab) * inv_len2).clamp(0.0, 1.0);
                (q - t * ab).length() - (ra + t * dr)
            }
            Self::Cuboid { c, half, local, round } => {
                let q = (local * (p - c)).abs() - half;
                q.max(Vec3::ZERO).length() + q.max_element().min(0.0) - round
            }
            Self::Cylinder { c, axis, half, r, round } => {
                let q = p - c;
                let along = q.dot(axis);
                let (x, y) = ((q - along * axis).length() - r, along.abs() - half);
                x.max(y).min(0.0) + (x.max(0.0).powi(2) + y.max(0.0).powi(2)).sqrt() - round
            }
            Self::Torus { c, local, major, minor } => {
                let q = local * (p - c);
                let x = q.truncate().length() - major;
                (x * x + q.z * q.z).sqrt() - minor
            }
            Self::Half { n, d } => n.dot(p) - d,
        }
    }

    /// A bound on how fast the distance changes.
    fn slope(&self) -> f32 {
        match *self {
            // the first-order distance is steeper the flatter the ellipsoid
            Self::Ellipsoid { inv, least, .. } => (1.0 / (inv.min_element() * least)).max(1.8),
            Self::Cone { inv_len2, dr, .. } => 1.0 + dr.abs() * inv_len2.sqrt(),
            _ => 1.0,
        }
    }
}

/// Smooth minimum: `min` where the operands differ by `k` or more, up to `k / 4` below it where they meet.
#[inline]
pub fn smin(a: f32, b: f32, k: f32) -> f32 {
    let h = (k - (a - b).abs()).max(0.0);
    a.min(b) - if h > 0.0 { h * h / (4.0 * k) } else { 0.0 }
}

/// Smooth maximum.
#[inline]
pub fn smax(a: f32, b: f32, k: f32) -> f32 {
    -smin(-a, -b, k)
}

/// 0 below `lo`, 1 above `hi`, smooth between; `lo > hi` falls instead.
#[inline]
pub fn step(lo: f32, hi: f32, x: f32) -> f32 {
    let t = ((x - lo) / (hi - lo)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The part of a voxel inside: 1 at `-w` and deeper, 0 at `w` and farther, smooth between.
#[inline]
pub fn cover(d: f32, w: f32) -> f32 {
    step(w, -w, d)
}

#[inline]
pub fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + t * (b - a)
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Op {
    Add,
    Cut,
    Keep,
    /// Starts with the primitive, or with its complement, forgetting what came before.
    Set,
    SetOutside,
}

#[derive(Debug, Clone, Copy)]
struct Step {
    solid: Solid,
    op: Op,
    k: f32,
    /// Also on the other side of the plane x = 0, and how far from it the two are folded smoothly into each other.
    pair: Option<f32>,
}

impl Step {
    #[inline]
    fn distance(&self, p: Vec3) -> f32 {
        let Some(fold) = self.pair else { return self.solid.distance(p) };
        let x = p.x.abs();
        let x = if x < fold { (x * x + fold * fold) / (2.0 * fold) } else { x };
        self.solid.distance(Vec3::new(x, p.y, p.z))
    }
}

fn run(steps: &[Step], p: Vec3) -> f32 {
    let mut d = f32::MAX;
    for s in steps {
        let x = s.distance(p);
        d = match s.op {
            Op::Add => smin(d, x, s.k),
            Op::Cut => smax(d, -x, s.k),
            Op::Keep => smax(d, x, s.k),
            Op::Set => x,
            Op::SetOutside => -x,
        };
    }
    d
}

/// Primitives joined in order.
#[derive(Debug, Clone)]
pub struct Shape {
    steps: Vec<Step>,
    deep: f32,
    fold: f32,
}

impl Shape {
    /// `deep` (positive) says to which distance inside the value matters; outside it matters as far as borders reach.
    pub fn new(deep: f32) -> Self {
        Self { steps: Vec::new(), deep, fold: 1.5 }
    }

    /// How far from the plane x = 0 the pairs that follow are smoothly folded into each other, in millimetres.
    pub fn fold(self, fold: f32) -> Self {
        Self { fold, ..self }
    }

    fn push(mut self, op: Op, k: f32, pair: bool, solid: Solid) -> Self {
        let op = if self.steps.is_empty() { Op::Set } else { op };
        let pair = pair.then_some(self.fold);
        self.steps.push(Step { solid, op, k: k.max(1e-3), pair });
        self
    }

    /// Smooth union over the blending width `k`.
    pub fn add(self, k: f32, s: Solid) -> Self {
        self.push(Op::Add, k, false, s)
    }

    /// As [`Shape::add`], and mirrored at x = 0.
    pub fn pair(self, k: f32, s: Solid) -> Self {
        self.push(Op::Add, k, true, s)
    }

    pub fn cut(self, k: f32, s: Solid) -> Self {
        self.push(Op::Cut, k, false, s)
    }

    pub fn cut_pair(self, k: f32, s: Solid) -> Self {
        self.push(Op::Cut, k, true, s)
    }

    pub fn keep(self, k: f32, s: Solid) -> Self {
        self.push(Op::Keep, k, false, s)
    }

    /// A chain of tapered capsules through `points` (position and radius), mirrored if `pair`.
    pub fn chain(mut self, k: f32, pair: bool, points: &[(Vec3, f32)]) -> Self {
        for w in points.windows(2) {
            self = self.push(Op::Add, k, pair, cone(w[0].0, w[1].0, w[0].1, w[1].1));
        }
        self
    }

    #[cfg(test)]
    pub fn distance(&self, p: Vec3) -> f32 {
        run(&self.steps, p)
    }

    /// Whether distance `d` may be told as the far value `told`.
    #[cfg(test)]
    pub fn is_beyond(&self, d: f32, told: f32, border: f32) -> bool {
        if told > 0.0 { d >= border - 1e-3 } else { d <= -self.deep - border + 1e-3 }
    }

    /// Appends the steps that matter within `radius` of `center`.
    fn shorten(&self, center: Vec3, radius: f32, border: f32, out: &mut Vec<Step>) -> State {
        let start = out.len();
        let (mut lo, mut hi) = (f32::MAX, f32::MAX);
        for s in &self.steps {
            let x = s.distance(center);
            let r = s.solid.slope() * radius;
            let (x0, x1) = (x - r, x + r);
            match s.op {
                Op::Add => {
                    if x0 >= hi + s.k {
                        continue;
                    }
                    if x1 + s.k <= lo {
                        out.truncate(start);
                        out.push(Step { op: Op::Set, ..*s });
                        (lo, hi) = (x0, x1);
                        continue;
                    }
                    (lo, hi) = (smin(lo, x0, s.k), smin(hi, x1, s.k));
                }
                Op::Cut | Op::Keep => {
                    let (y0, y1) = if s.op == Op::Cut { (-x1, -x0) } else { (x0, x1) };
                    if y1 <= lo - s.k {
                        continue;
                    }
                    if y0 >= hi + s.k {
                        out.truncate(start);
                        out.push(Step { op: if s.op == Op::Cut { Op::SetOutside } else { Op::Set }, ..*s });
                        (lo, hi) = (y0, y1);
                        continue;
                    }
                    (lo, hi) = (smax(lo, y0, s.k), smax(hi, y1, s.k));
                }
                Op::Set | Op::SetOutside => (lo, hi) = if s.op == Op::Set { (x0, x1) } else { (-x1, -x0) },
            }
            out.push(*s);
        }
        if lo > border {
            out.truncate(start);
            State::Outside
        } else if hi < -self.deep - border {
            out.truncate(start);
            State::Inside
        } else {
            State::Near { start, end: out.len() }
        }
    }
}

#[derive(Debug, Clone, Copy)]
enum State {
    Outside,
    Inside,
    Near { start: usize, end: usize },
}

/// The distance given for a block that lies wholly beyond what matters of a shape; negative inside.
pub const FAR: f32 = 1e4;

/// A model's shapes, shortened for one block.
#[derive(Debug, Default)]
pub struct Block {
    states: Vec<State>,
    steps: Vec<Step>,
}

impl Block {
    /// Prepares for points within `radius` of `center`; borders reach `border` to both sides of a surface.
    pub fn enter(&mut self, shapes: &[Shape], center: Vec3, radius: f32, border: f32) {
        self.states.clear();
        self.steps.clear();
        for s in shapes {
            let state = s.shorten(center, radius, border, &mut self.steps);
            self.states.push(state);
        }
    }

    /// Distance to shape `id` at `p`, or [`FAR`] with the sign of the side where the whole block is beyond what matters.
    #[inline]
    pub fn d(&self, id: usize, p: Vec3) -> f32 {
        match self.states[id] {
            State::Outside => FAR,
            State::Inside => -FAR,
            State::Near { start, end } => run(&self.steps[start..end], p),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn primitives_measure_what_they_say() {
        assert_eq!(ball(v(1.0, 2.0, 3.0), 2.0).distance(v(1.0, 2.0, 8.0)), 3.0);
        assert_eq!(ellipsoid(Vec3::ZERO, v(2.0, 3.0, 4.0)).distance(v(0.0, 0.0, 6.0)), 2.0);
        assert_eq!(ellipsoid(Vec3::ZERO, v(2.0, 3.0, 4.0)).distance(Vec3::ZERO), -2.0);
        assert!((cuboid(Vec3::ZERO, v(2.0, 3.0, 4.0), 0.5).distance(v(5.0, 0.0, 0.0)) - 3.0).abs() < 1e-6);
        assert!(
            (cylinder(v(0.0, 0.0, -2.0), v(0.0, 0.0, 2.0), 1.0, 0.2).distance(v(4.0, 0.0, 0.0)) - 3.0).abs() < 1e-6
        );
        assert!((torus(Vec3::ZERO, Mat3::IDENTITY, 5.0, 1.0).distance(v(0.0, 5.0, 3.0)) - 2.0).abs() < 1e-6);
        assert_eq!(half(v(0.0, 0.0, 1.0), v(0.0, 0.0, 2.0)).distance(v(7.0, 7.0, 3.0)), 2.0);
        // a quarter turn about z takes the long axis from x to y
        let e = turned_ellipsoid(Vec3::ZERO, v(4.0, 1.0, 1.0), turn(0.0, 0.0, 90.0));
        assert!((e.distance(v(0.0, 6.0, 0.0)) - 2.0).abs() < 1e-5);
    }

    #[test]
    fn smooth_minimum_is_the_minimum_away_from_the_seam() {
        assert_eq!(smin(1.0, 5.0, 4.0), 1.0);
        assert_eq!(smin(2.0, 2.0, 4.0), 1.0);
        assert_eq!(smax(1.0, 5.0, 4.0), 5.0);
        assert_eq!(cover(-2.0, 1.0), 1.0);
        assert_eq!(cover(0.0, 1.0), 0.5);
        assert_eq!(cover(2.0, 1.0), 0.0);
    }

    #[test]
    fn pairs_are_mirrored() {
        let s = Shape::new(5.0).add(1.0, ball(Vec3::ZERO, 3.0)).pair(2.0, ball(v(8.0, 1.0, 0.0), 3.0));
        for p in [v(9.0, 2.0, 1.0), v(3.0, 0.0, 0.0), v(0.4, 1.0, 0.0)] {
            assert_eq!(s.distance(p), s.distance(p * v(-1.0, 1.0, 1.0)));
        }
    }
}

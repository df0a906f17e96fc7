//! The inverse of one deformer at a point.

use glam::{DMat3, DVec3};

use super::kernel::{Kernel, profile_of};
use super::lattice_kernel::LatticeKernel;
use super::stack::with_gradient;
use super::{Action, Brush, DeformError};
use crate::math::turn::turn;

/// Of a displacement in one fixed direction: a root along the line through `q`, in a bracket that always holds one.
///
/// `g(s) = s - |d| V(q + s w)` is at most 0 at 0 and at least 0 at `|d|`, because `V` lies in 0..=1.
pub(super) fn forward_along(kernel: &impl Kernel<f64>, q: DVec3, steepness: f64) -> Result<DVec3, DeformError> {
    let vector = DVec3::from(kernel.vector());
    let length = vector.length();
    let w = vector / length;
    let g = |s: f64| {
        let (v, gradient) = kernel.value_and_gradient((q + w * s).to_array());
        (s - length * v, 1.0 - length * DVec3::from(gradient).dot(w))
    };
    if steepness >= 1.0 && crossings(&g, length) > 1 {
        return Err(DeformError::Folded { at: q });
    }
    // without a displacement the answer is q itself
    let s = root(&g, [0.0, length], length * kernel.value(q.to_array()), length);
    if s.is_finite() { Ok(q + w * s) } else { Err(DeformError::NotConverged { at: q }) }
}

/// A root of `g`, which gives value and slope, is at most 0 at `lo` and at least 0 at `hi`: to 1e-15 of `size`.
fn root(g: &impl Fn(f64) -> (f64, f64), [mut lo, mut hi]: [f64; 2], start: f64, size: f64) -> f64 {
    let mut s = start;
    for _ in 0..200 {
        let (value, slope) = g(s);
        if value == 0.0 {
            break;
        }
        if value < 0.0 {
            lo = s;
        } else {
            hi = s;
        }
        let newton = s - value / slope;
        let next = if newton > lo && newton < hi { newton } else { 0.5 * (lo + hi) };
        let step = (next - s).abs();
        s = next;
        if step <= 1e-15 * size || hi - lo <= 1e-15 * size {
            break;
        }
    }
    s
}

/// Of a brush: a twist is turned back; else a root along a ray from the centre, or from the axis across it.
pub(super) fn forward_brush(brush: &Brush, q: DVec3) -> Result<DVec3, DeformError> {
    let ball = brush.kernel(DVec3::ZERO).ball;
    let profile = |p: DVec3| ball.value_and_gradient_by(p.to_array(), profile_of(brush.falloff()));
    let r = q - brush.center();
    let (amount, moving, across) = match brush.action() {
        Action::Twist { axis, degrees } => {
            // the distance from the centre is kept, so the angle is known
            let (sin, versed) = turn(degrees / 360.0 * profile(q).0);
            let n = axis.normalize();
            let (u, v) = (n.cross(r), n.cross(n.cross(r)));
            return Ok(q + u * sin + v * versed);
        }
        Action::Inflate { amount } => (amount, r, DVec3::X),
        Action::Pinch { axis, amount } => {
            let n = axis.normalize();
            (-amount, r - n * r.dot(n), n.any_orthonormal_vector())
        }
    };
    let direction = moving.try_normalize().unwrap_or(across);
    let (base, target) = (q - moving, moving.length());
    let g = |s: f64| {
        let p = base + direction * s;
        let (value, gradient) = profile(p);
        (s - amount * s * value - target, 1.0 - amount * (value + s * DVec3::from(gradient).dot(direction)))
    };
    // beyond the ball nothing moves
    let end = target.max(brush.radius());
    let both_ways = |s: f64| g(s - end);
    if brush.steepness() >= 1.0 && crossings(&both_ways, 2.0 * end) > 1 {
        return Err(DeformError::Folded { at: q });
    }
    let s = root(&g, [0.0, end], target, brush.radius());
    if s.is_finite() { Ok(base + direction * s) } else { Err(DeformError::NotConverged { at: q }) }
}

/// Sign changes of `g` over the bracket, looked for at evenly spaced places.
fn crossings(g: &impl Fn(f64) -> (f64, f64), length: f64) -> usize {
    const SAMPLES: u32 = 512;
    let signs = (0..=SAMPLES).map(|i| g(length * f64::from(i) / f64::from(SAMPLES)).0 > 0.0);
    signs.clone().zip(signs.skip(1)).filter(|(a, b)| a != b).count()
}

/// Of a lattice: Newton's method with steps halved until they help, from the point moved once.
pub(super) fn forward_lattice(kernel: &LatticeKernel<f64>, q: DVec3, size: f64) -> Result<DVec3, DeformError> {
    let miss = |x: DVec3| x - DVec3::from(kernel.displacement(x.to_array())) - q;
    let goal = 1e-14 * (size + q.length());
    let mut x = q + DVec3::from(kernel.displacement(q.to_array()));
    let mut error = miss(x);
    for _ in 0..100 {
        if error.length() <= goal {
            break;
        }
        let jacobian = DMat3::IDENTITY - with_gradient(kernel, x).1;
        let determinant = jacobian.determinant();
        let step = if determinant > 1e-9 { jacobian.inverse() * error } else { error };
        let mut scale = 1.0;
        let better = loop {
            let next = x - step * scale;
            let e = miss(next);
            if e.length() < error.length() {
                break Some((next, e));
            }
            scale *= 0.5;
            if scale < 1e-6 {
                break None;
            }
        };
        match better {
            Some((next, e)) => (x, error) = (next, e),
            None => break,
        }
    }
    if error.is_nan() || error.length() > 100.0 * goal {
        return Err(DeformError::NotConverged { at: q });
    }
    if (DMat3::IDENTITY - with_gradient(kernel, x).1).determinant() <= 0.0 {
        return Err(DeformError::Folded { at: q });
    }
    Ok(x)
}

//! Where a ray meets an isosurface.
//!
//! The ray is cut where it passes from tetrahedron to tetrahedron: at the faces of blocks, of cubes, and at the six diagonal
//! planes of a cube. The pieces are contiguous intervals of the ray, so none of it is left out, whatever rounding does; in
//! each, blossoming gives the univariate cubic, and all its roots are found. On which side of the surface the ray is goes
//! along from interval to interval: crossings alternate between in and out, always.

use std::ops::ControlFlow;

use glam::DVec3;

use super::cubic::{self, Roots};
use super::level::BLOCK;
use super::piece::{Kind, barycentric};
use super::{Level, Spline};

/// `origin + t * direction`, in voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    pub origin: DVec3,
    pub direction: DVec3,
}

impl Ray {
    #[inline(always)]
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }
}

/// How a ray meets the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Crossing {
    /// From below the isovalue to above.
    In,
    /// From above to below.
    Out,
    /// The ray touches the surface and turns back.
    Graze,
    /// The ray comes into the domain where the value is above already.
    Start,
    /// The ray leaves the domain, or ends, where the value is above.
    End,
}

impl Level<'_> {
    /// The first place where a ray has the isovalue, for `t` in `range`: a crossing, a graze, or the border of the domain if
    /// the value there is above.
    pub fn first_hit(&self, ray: &Ray, range: [f64; 2]) -> Option<(f64, Crossing)> {
        let mut first = None;
        self.crossings(ray, range, |t, crossing| {
            first = Some((t, crossing));
            ControlFlow::Break(())
        });
        first
    }

    /// Calls `found` for each place where a ray meets the surface, in order, until it breaks.
    #[inline]
    pub fn crossings(&self, ray: &Ray, range: [f64; 2], mut found: impl FnMut(f64, Crossing) -> ControlFlow<()>) {
        let dims = self.spline.dims();
        let Some([start, end]) = clip_to(ray, dims.map(|n| n as f64), range) else { return };
        let mut walk = Walk::new(self, ray);
        let size = BLOCK as f64;
        let block = Span::of(ray, size);
        let mut at = block.cell(ray.at(start), [0; 3], self.classes.blocks);
        let mut t = start;
        loop {
            let (exit, axis) = block.exit(at);
            let to = exit.clamp(t, end);
            if self.block_is_active(at) {
                if !walk.block(at, t, to, &mut found) {
                    return;
                }
            } else if walk.above.is_none() {
                let inside = self.spline.value(ray.at(t)) >= self.iso();
                if !walk.begin(inside, t, &mut found) {
                    return;
                }
            }
            t = to;
            if exit >= end || !block.advance(&mut at, axis, [0; 3], self.classes.blocks) {
                break;
            }
        }
        if walk.above == Some(true) {
            let _ = found(end, Crossing::End);
        }
    }
}

/// The part of a ray in a box from -1/2 to its size less 1/2.
pub(super) fn clip_to(ray: &Ray, size: [f64; 3], range: [f64; 2]) -> Option<[f64; 2]> {
    let [mut start, mut end] = range;
    for a in 0..3 {
        let (o, d) = (ray.origin[a], ray.direction[a]);
        let (lo, hi) = (-0.5, size[a] - 0.5);
        if d == 0.0 {
            if !(lo..=hi).contains(&o) {
                return None;
            }
        } else {
            let (u, v) = ((lo - o) / d, (hi - o) / d);
            start = start.max(u.min(v));
            end = end.min(u.max(v));
        }
    }
    (start < end && start.is_finite() && end.is_finite()).then_some([start, end])
}

/// A walk through cells of one size.
pub(super) struct Span {
    origin: DVec3,
    inverse: DVec3,
    /// -1, 0 or 1.
    step: [isize; 3],
    size: f64,
}

impl Span {
    #[inline(always)]
    pub(super) fn of(ray: &Ray, size: f64) -> Self {
        let step = ray.direction.to_array().map(|d| if d > 0.0 { 1 } else { -isize::from(d < 0.0) });
        Self { origin: ray.origin, inverse: ray.direction.recip(), step, size }
    }

    /// The cell that holds a point, or the nearest one.
    #[inline(always)]
    pub(super) fn cell(&self, p: DVec3, lo: [usize; 3], hi: [usize; 3]) -> [usize; 3] {
        std::array::from_fn(|a| (((p[a] + 0.5) / self.size).max(0.0) as usize).clamp(lo[a], hi[a] - 1))
    }

    /// Where the ray leaves a cell, and along which axis.
    #[inline(always)]
    pub(super) fn exit(&self, at: [usize; 3]) -> (f64, usize) {
        let mut best = (f64::INFINITY, 0);
        for a in 0..3 {
            if self.step[a] != 0 {
                let face = (at[a] + usize::from(self.step[a] > 0)) as f64 * self.size - 0.5;
                let t = (face - self.origin[a]) * self.inverse[a];
                if t < best.0 {
                    best = (t, a);
                }
            }
        }
        best
    }

    /// Goes to the next cell; `false` if that lies outside.
    #[inline(always)]
    pub(super) fn advance(&self, at: &mut [usize; 3], axis: usize, lo: [usize; 3], hi: [usize; 3]) -> bool {
        let next = at[axis].wrapping_add_signed(self.step[axis]);
        at[axis] = next;
        next >= lo[axis] && next < hi[axis]
    }
}

/// A ray on its way.
pub(super) struct Walk<'a> {
    spline: &'a Spline,
    level: &'a Level<'a>,
    ray: &'a Ray,
    cubes: Span,
    /// Inverse speeds towards the diagonal planes: `x = y`, `y = z`, `z = x`, then with a minus.
    diagonals: [f64; 6],
    /// On which side the ray is; `None` before it has begun.
    pub(super) above: Option<bool>,
}

impl<'a> Walk<'a> {
    pub(super) fn new(level: &'a Level<'_>, ray: &'a Ray) -> Self {
        let d = ray.direction;
        let diagonals = [d.x - d.y, d.y - d.z, d.z - d.x, d.x + d.y, d.y + d.z, d.z + d.x].map(|v| -1.0 / v);
        let cubes = Span::of(ray, 1.0);
        Self { spline: level.spline, level, ray, cubes, diagonals, above: None }
    }

    /// Sets the side the ray begins on; `false` if nothing more is wanted.
    pub(super) fn begin(
        &mut self,
        above: bool,
        t: f64,
        found: &mut impl FnMut(f64, Crossing) -> ControlFlow<()>,
    ) -> bool {
        self.above = Some(above);
        !above || found(t, Crossing::Start).is_continue()
    }

    /// Through the cubes of a block, for `t` from `from` to `end`.
    #[inline(always)]
    pub(super) fn block(
        &mut self,
        block: [usize; 3],
        from: f64,
        end: f64,
        found: &mut impl FnMut(f64, Crossing) -> ControlFlow<()>,
    ) -> bool {
        let lo = block.map(|b| b * BLOCK);
        let dims = self.spline.dims();
        let hi: [usize; 3] = std::array::from_fn(|a| (lo[a] + BLOCK).min(dims[a]));
        let mut at = self.cubes.cell(self.ray.at(from), lo, hi);
        let mut t = from;
        loop {
            let (exit, axis) = self.cubes.exit(at);
            let to = exit.clamp(t, end);
            if (self.level.is_active(at) || self.above.is_none()) && !self.cube(at, t, to, found) {
                return false;
            }
            t = to;
            if exit >= end || !self.cubes.advance(&mut at, axis, lo, hi) {
                // what rounding leaves of the way lies on a face of the last cube
                return true;
            }
        }
    }

    /// Through the tetrahedra of a cube.
    #[inline(always)]
    fn cube(
        &mut self,
        cube: [usize; 3],
        from: f64,
        end: f64,
        found: &mut impl FnMut(f64, Crossing) -> ControlFlow<()>,
    ) -> bool {
        let center = DVec3::from_array(cube.map(|c| c as f64));
        let local = Ray { origin: self.ray.origin - center, ..*self.ray };
        let o = local.origin;
        let distances = [o.x - o.y, o.y - o.z, o.z - o.x, o.x + o.y, o.y + o.z, o.z + o.x];
        let mut cuts = [end; 7];
        let mut count = 0;
        for i in 0..6 {
            let t = distances[i] * self.diagonals[i];
            if t > from && t < end {
                let mut slot = count;
                while slot > 0 && cuts[slot - 1] > t {
                    cuts[slot] = cuts[slot - 1];
                    slot -= 1;
                }
                cuts[slot] = t;
                count += 1;
            }
        }
        cuts[count] = end;
        let mut t = from;
        for &to in &cuts[..=count] {
            let kind = Kind::of(local.at(0.5 * (t + to)));
            let piece = self.spline.piece(cube, kind);
            let [lo, hi] = piece.hull();
            let iso = self.level.iso();
            let scale = 8.0 * f64::EPSILON * (lo.abs() + hi.abs() + iso.abs());
            if self.above.is_none() || (lo - scale <= iso && hi + scale >= iso) {
                let (p, q) = (kind.local(local.at(t)), kind.local(local.at(to)));
                let b = piece.along(barycentric(p), barycentric(q)).map(|v| v - iso);
                if self.above.is_none() && !self.begin(b[0] >= 0.0, t, found) {
                    return false;
                }
                let roots: Roots = cubic::roots(&b, self.above == Some(true), scale);
                for root in roots.iter() {
                    let crossing = match (root.grazes, self.above) {
                        (true, _) => Crossing::Graze,
                        (false, Some(true)) => Crossing::Out,
                        (false, _) => Crossing::In,
                    };
                    if !root.grazes {
                        self.above = self.above.map(|a| !a);
                    }
                    if found(t + (to - t) * root.at, crossing).is_break() {
                        return false;
                    }
                }
            }
            t = to;
        }
        true
    }
}

//! What encloses what.

use glam::DVec2;

use super::walk::shoelace;
use super::{Defect, Slices};

#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Scratch {
    loops: Vec<Outline>,
}

/// A loop of the plane at hand.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Outline {
    index: u32,
    area: f64,
    lo: DVec2,
    hi: DVec2,
    depth: u32,
    /// Position of the smallest enclosing loop among the outlines.
    parent: Option<u32>,
}

/// Where a point lies with respect to a loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Inside,
    Outside,
    On,
}

impl Slices {
    /// Classifies the loops by what encloses them: at even depth outer loops, which are turned anticlockwise, at odd depth
    /// holes, turned clockwise and given to the outer loop around them.
    ///
    /// In sections of a well oriented solid the signs of the areas say the same, and nothing is turned; where they do not,
    /// [`Slices::warnings`] tells.
    pub fn nest(&mut self) {
        self.owner.clear();
        self.owner.resize(self.loops(), Self::NONE);
        let mut scratch = std::mem::take(&mut self.scratch);
        for k in 0..self.planes() {
            let range = self.plane_loops(k);
            match range.len() {
                0 => {}
                1 => {
                    let l = range.start;
                    if !self.is_thin(l) {
                        self.owner[l] = l as u32;
                        if self.area[l] < 0.0 {
                            self.turn(l, k);
                        }
                    }
                }
                _ => self.nest_plane(k, &mut scratch.loops),
            }
        }
        self.scratch = scratch;
    }

    fn nest_plane(&mut self, k: usize, loops: &mut Vec<Outline>) {
        loops.clear();
        for l in self.plane_loops(k) {
            if !self.is_thin(l) {
                let (lo, hi) = bounds(self.loop_points(l));
                loops.push(Outline { index: l as u32, area: self.area[l], lo, hi, depth: 0, parent: None });
            }
        }
        // only a larger loop can enclose a smaller one
        loops.sort_unstable_by(|a, b| b.area.abs().total_cmp(&a.area.abs()).then(a.index.cmp(&b.index)));
        for i in 0..loops.len() {
            let inner = loops[i];
            for j in 0..i {
                let outer = loops[j];
                if outer.lo.cmple(inner.lo).all()
                    && inner.hi.cmple(outer.hi).all()
                    && encloses(self.loop_points(outer.index as usize), self.loop_points(inner.index as usize))
                {
                    loops[i].depth += 1;
                    loops[i].parent = Some(j as u32);
                }
            }
        }
        for i in 0..loops.len() {
            let l = loops[i].index as usize;
            if loops[i].depth.is_multiple_of(2) != (loops[i].area > 0.0) {
                self.settle(k, i, loops);
            }
            // where loops cross, the smallest one around a hole may be a hole itself: both belong to the same outer loop then
            let around = loops[i].parent.map(|p| self.owner[loops[p as usize].index as usize]);
            let owner = around.filter(|o| *o != Self::NONE && !loops[i].depth.is_multiple_of(2));
            self.owner[l] = owner.unwrap_or(l as u32);
            if owner.is_some() == (self.area[l] > 0.0) {
                self.turn(l, k);
            }
        }
    }

    /// Sign and depth of outline `i` disagree. Loops of a surface that intersects itself cross, and one point says
    /// little about them: the outline is inside another only if most of its points are.
    fn settle(&mut self, k: usize, i: usize, loops: &mut [Outline]) {
        let inner = self.loop_points(loops[i].index as usize);
        let (mut depth, mut parent, mut crossing) = (0, None, None);
        for (j, outer) in loops[..i].iter().enumerate() {
            if inner.is_empty() || !(outer.lo.cmple(loops[i].hi).all() && loops[i].lo.cmple(outer.hi).all()) {
                continue;
            }
            let around = self.loop_points(outer.index as usize);
            let (mut inside, mut outside) = (0usize, 0usize);
            for p in inner {
                match side(around, *p) {
                    Side::Inside => inside += 1,
                    Side::Outside => outside += 1,
                    Side::On => {}
                }
            }
            if inside > 0 && outside > 0 {
                crossing = Some(inner[0]);
            }
            // of loops that cross, each stands for itself
            if inside > 0 && outside == 0 {
                depth += 1;
                parent = Some(j as u32);
            }
        }
        (loops[i].depth, loops[i].parent) = (depth, parent);
        if let Some(at) = crossing {
            self.warn(Defect::Crossing, k as u32, at, 1);
        }
    }

    fn turn(&mut self, l: usize, k: usize) {
        let range = self.loop_start[l] as usize..self.loop_start[l + 1] as usize;
        self.points[range.clone()].reverse();
        self.area[l] = -self.area[l];
        let at = self.points[range.start];
        self.warn(Defect::Orientation, k as u32, at, 1);
    }

    fn is_thin(&self, l: usize) -> bool {
        is_thin(self.loop_points(l), self.area[l])
    }
}

/// Whether the area of a loop is no more than the rounding of its coordinates.
pub(super) fn is_thin(points: &[DVec2], area: f64) -> bool {
    if points.len() < 3 {
        return true;
    }
    let area = area.abs();
    let size = points[0].abs().max_element();
    if area > 1e-9 * size * size {
        return false;
    }
    let (lo, hi) = bounds(points);
    let size = lo.abs().max(hi.abs()).max_element();
    let extent = (hi - lo).element_sum();
    debug_assert!((shoelace(points).abs() - area).abs() <= 1e-6 * extent * extent);
    area <= 8.0 * f64::EPSILON * size * (extent + 8.0 * f64::EPSILON * size)
}

fn bounds(points: &[DVec2]) -> (DVec2, DVec2) {
    points.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)))
}

/// Whether `inner` lies inside `outer`, by the first of its points that is not on the other loop.
fn encloses(outer: &[DVec2], inner: &[DVec2]) -> bool {
    for p in inner {
        match side(outer, *p) {
            Side::Inside => return true,
            Side::Outside => return false,
            Side::On => {}
        }
    }
    // the same points: the smaller area decided the order, take it as inside
    true
}

/// Even-odd rule along the ray to the right, with exact signs.
fn side(polygon: &[DVec2], p: DVec2) -> Side {
    let mut inside = false;
    let Some(mut a) = polygon.last().copied() else { return Side::Outside };
    for &b in polygon {
        if (a.y > p.y) != (b.y > p.y) {
            let turn = orient(a, b, p);
            if turn == 0.0 {
                return Side::On;
            }
            inside ^= (turn > 0.0) == (b.y > a.y);
        } else if a.y == p.y && b.y == p.y && (a.x > p.x) != (b.x > p.x) || a == p {
            return Side::On;
        }
        a = b;
    }
    if inside { Side::Inside } else { Side::Outside }
}

fn orient(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let at = |p: DVec2| robust::Coord { x: p.x, y: p.y };
    robust::orient2d(at(a), at(b), at(c))
}

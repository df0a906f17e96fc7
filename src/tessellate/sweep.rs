//! Our own sweep for simple polygons with holes, in `f64`, for outlines with far more points than turns.
//!
//! Sections of meshes are long outlines that turn up and down only a few times. So only the turning points are sorted:
//! between them each loop is a *chain* that rises or falls steadily. The sweep goes from turning point to turning point
//! and keeps the intervals between neighbouring chains that lie inside. In each interval a region monotone in y grows
//! (two while a point where two intervals met waits for the next point above it), and is cut into triangles as its
//! points pass, with a stack of the points that still see the other side (Garey, Johnson, Preparata and Tarjan 1978).
//! With m turns and n points that is O(n + m log m), and a few steps per point.
//!
//! The order of points is lexicographic in (y, x), so no two are level. Signs of areas are exact. If the outline is not
//! simple, the sweep notices as a rule (an event finds no place, or a triangle is turned the wrong way) and gives up. It
//! does not if two loops cross that neither turn inside the other: each is filled on its own, and with it twice what both
//! have in common. So sections that may cross are united before they come here.

use glam::DVec2;

/// What the sweep keeps from polygon to polygon.
#[derive(Debug, Default)]
pub(super) struct Sweep {
    /// All loops, each from its lowest point and with this point again at its end.
    points: Vec<DVec2>,
    ids: Vec<u32>,
    chains: Vec<Chain>,
    events: Vec<Event>,
    intervals: Vec<Interval>,
    regions: Vec<Region>,
    free: Vec<u32>,
    /// The least doubled area that rounding of a correct triangle can give.
    least: f64,
    pub doubled_area: f64,
}

/// A steadily rising run of points, or a falling one read upwards.
#[derive(Debug, Clone, Copy)]
struct Chain {
    /// The next point above the sweep.
    next: DVec2,
    at: u32,
    end: u32,
    /// One upwards in the direction of the loop: then the inside is on the left.
    step: i32,
}

#[derive(Debug, Clone, Copy)]
struct Event {
    at: DVec2,
    point: u32,
    /// The chain that runs down to or from the point, or up from or to it, in the direction of the loop.
    falling: u32,
    rising: u32,
    lowest: bool,
    /// Whether the inside is the smaller side.
    convex: bool,
}

/// A piece of the sweep line inside the polygon.
#[derive(Debug, Clone, Copy)]
struct Interval {
    left: u32,
    right: u32,
    region: u32,
    /// The region at the right of a waiting point; `region` is then at its left.
    second: u32,
}

#[derive(Debug, Default)]
struct Region {
    stack: Vec<u32>,
    right: bool,
}

const NONE: u32 = u32::MAX;

/// The outline is not simple.
#[derive(Debug)]
pub(super) struct NotSimple;

fn before(a: DVec2, b: DVec2) -> bool {
    a.y < b.y || a.y == b.y && a.x < b.x
}

/// Twice the area of the triangle with its exact sign.
#[inline]
fn orient(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let (l, r) = ((a.x - c.x) * (b.y - c.y), (a.y - c.y) * (b.x - c.x));
    let det = l - r;
    // the filter of Shewchuk's predicate, in line
    if det.abs() >= 3.330_669_062_177_372e-16 * (l + r).abs() && det != 0.0 {
        return det;
    }
    let at = |p: DVec2| robust::Coord { x: p.x, y: p.y };
    robust::orient2d(at(a), at(b), at(c))
}

impl Sweep {
    pub fn clear(&mut self) {
        self.points.clear();
        self.ids.clear();
        self.chains.clear();
        self.events.clear();
        self.intervals.clear();
        self.free.clear();
        self.free.extend(0..self.regions.len() as u32);
        self.doubled_area = 0.0;
    }

    /// Adds a loop whose points have the numbers from `first`. Outer loops anticlockwise, holes clockwise.
    pub fn add(&mut self, points: &[DVec2], first: u32) -> Result<(), NotSimple> {
        let Some(low) = (0..points.len()).reduce(|a, b| if before(points[b], points[a]) { b } else { a }) else {
            return Ok(());
        };
        let start = self.points.len();
        let (head, tail) = points.split_at(low);
        for (p, id) in tail.iter().zip(first + low as u32..).chain(head.iter().zip(first..)) {
            if self.points.len() == start || self.points[self.points.len() - 1] != *p {
                self.points.push(*p);
                self.ids.push(id);
            }
        }
        while self.points.len() > start + 1 && self.points[self.points.len() - 1] == points[low] {
            self.points.pop();
            self.ids.pop();
        }
        let n = self.points.len() - start;
        if n < 3 {
            return Err(NotSimple);
        }
        self.points.push(points[low]);
        self.ids.push(first + low as u32);

        // cut at the turns; the loop starts rising, at its lowest point
        let first_chain = self.chains.len() as u32;
        let (mut from, mut rising) = (start, true);
        for i in start + 1..=start + n {
            let turns = i == start + n || before(self.points[i], self.points[i + 1]) != rising;
            if !turns {
                continue;
            }
            let chain = self.chains.len() as u32;
            self.chains.push(if rising {
                Chain { next: self.points[from + 1], at: from as u32 + 1, end: i as u32, step: 1 }
            } else {
                Chain { next: self.points[i - 1], at: i as u32 - 1, end: from as u32, step: -1 }
            });
            let at = self.points[i];
            let next = if i == start + n { self.points[start + 1] } else { self.points[i + 1] };
            let convex = orient(self.points[i - 1], at, next) > 0.0;
            let after = if i == start + n { first_chain } else { chain + 1 };
            let (falling, rising_chain) = if rising { (after, chain) } else { (chain, after) };
            self.events.push(Event { at, point: i as u32, falling, rising: rising_chain, lowest: !rising, convex });
            (from, rising) = (i, !rising);
        }
        Ok(())
    }

    /// Triangulates the loops that were added. Triangles run anticlockwise.
    pub fn run(&mut self, out: &mut Vec<[u32; 3]>) -> Result<(), NotSimple> {
        let (lo, hi) =
            self.points.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
        let extent = (hi - lo).element_sum();
        self.least = -1e-14 * extent * extent;
        self.events.sort_unstable_by(|a, b| {
            a.at.y.total_cmp(&b.at.y).then(a.at.x.total_cmp(&b.at.x)).then(a.point.cmp(&b.point))
        });
        for i in 0..self.events.len() {
            let e = self.events[i];
            match (e.lowest, e.convex) {
                (true, true) => self.start(e, out)?,
                (true, false) => self.split(e, out)?,
                (false, true) => self.end(e, out)?,
                (false, false) => self.merge(e, out)?,
            }
        }
        if self.intervals.is_empty() { Ok(()) } else { Err(NotSimple) }
    }

    fn start(&mut self, e: Event, out: &mut Vec<[u32; 3]>) -> Result<(), NotSimple> {
        let Err(place) = self.find(e.at, out)? else { return Err(NotSimple) };
        let region = self.region(e.point);
        self.intervals.insert(place, Interval { left: e.falling, right: e.rising, region, second: NONE });
        Ok(())
    }

    fn split(&mut self, e: Event, out: &mut Vec<[u32; 3]>) -> Result<(), NotSimple> {
        let Ok(place) = self.find(e.at, out)? else { return Err(NotSimple) };
        let i = self.intervals[place];
        let (left, right) = if i.second != NONE {
            self.push(i.region, e.point, true, out)?;
            self.push(i.second, e.point, false, out)?;
            (i.region, i.second)
        } else {
            // joined to the highest point below, which starts the new region
            let r = &self.regions[i.region as usize];
            let (top, on_right) = (r.stack[r.stack.len() - 1], r.right);
            let new = self.region(top);
            self.push(new, e.point, !on_right, out)?;
            self.push(i.region, e.point, on_right, out)?;
            if on_right { (i.region, new) } else { (new, i.region) }
        };
        self.intervals[place] = Interval { left: i.left, right: e.rising, region: left, second: NONE };
        self.intervals.insert(place + 1, Interval { left: e.falling, right: i.right, region: right, second: NONE });
        Ok(())
    }

    fn end(&mut self, e: Event, out: &mut Vec<[u32; 3]>) -> Result<(), NotSimple> {
        let place = self.intervals.iter().position(|i| i.right == e.rising).ok_or(NotSimple)?;
        self.catch_up(place, e.at, out)?;
        let i = self.intervals[place];
        if i.left != e.falling || !self.is_at(i.left, e.at) || !self.is_at(i.right, e.at) {
            return Err(NotSimple);
        }
        self.finish(i.region, e.point, out)?;
        if i.second != NONE {
            self.finish(i.second, e.point, out)?;
        }
        self.intervals.remove(place);
        Ok(())
    }

    fn merge(&mut self, e: Event, out: &mut Vec<[u32; 3]>) -> Result<(), NotSimple> {
        let place = self.intervals.iter().position(|i| i.right == e.rising).ok_or(NotSimple)?;
        if self.intervals.get(place + 1).is_none_or(|i| i.left != e.falling) {
            return Err(NotSimple);
        }
        self.catch_up(place, e.at, out)?;
        self.catch_up(place + 1, e.at, out)?;
        if !self.is_at(e.rising, e.at) || !self.is_at(e.falling, e.at) {
            return Err(NotSimple);
        }
        self.pass(place, e.point, true, out)?;
        self.pass(place + 1, e.point, false, out)?;
        let right = self.intervals.remove(place + 1);
        let left = &mut self.intervals[place];
        left.right = right.right;
        left.second = right.region;
        Ok(())
    }

    /// Whether the chain has come to its upper end, which is `at`.
    fn is_at(&self, chain: u32, at: DVec2) -> bool {
        let c = &self.chains[chain as usize];
        c.at == c.end && c.next == at
    }

    /// The interval in which a point lies, or the place of a new one.
    fn find(&mut self, at: DVec2, out: &mut Vec<[u32; 3]>) -> Result<Result<usize, usize>, NotSimple> {
        let (mut lo, mut hi) = (0, self.intervals.len());
        while lo < hi {
            let middle = (lo + hi) / 2;
            self.catch_up(middle, at, out)?;
            let i = self.intervals[middle];
            if !self.is_right_of(i.left, at) {
                hi = middle;
            } else if self.is_right_of(i.right, at) {
                lo = middle + 1;
            } else {
                return Ok(Ok(middle));
            }
        }
        Ok(Err(lo))
    }

    /// Whether a point lies right of the chain's edge at its height.
    fn is_right_of(&self, chain: u32, at: DVec2) -> bool {
        let c = &self.chains[chain as usize];
        let below = self.points[(c.at as i32 - c.step) as usize];
        orient(below, c.next, at) < 0.0
    }

    /// Passes all points of an interval's two chains that lie below `limit`.
    fn catch_up(&mut self, place: usize, limit: DVec2, out: &mut Vec<[u32; 3]>) -> Result<(), NotSimple> {
        let i = self.intervals[place];
        loop {
            let (l, r) = (&self.chains[i.left as usize], &self.chains[i.right as usize]);
            let right = before(r.next, l.next);
            let c = if right { r } else { l };
            if !before(c.next, limit) {
                return Ok(());
            }
            let point = c.at;
            if point == c.end {
                return Err(NotSimple);
            }
            let next = (point as i32 + c.step) as u32;
            let to = self.points[next as usize];
            let c = &mut self.chains[if right { i.right } else { i.left } as usize];
            (c.at, c.next) = (next, to);
            self.pass(place, point, right, out)?;
        }
    }

    /// The sweep passes a point on one side of an interval.
    #[inline]
    fn pass(&mut self, place: usize, point: u32, right: bool, out: &mut Vec<[u32; 3]>) -> Result<(), NotSimple> {
        let i = self.intervals[place];
        if i.second == NONE {
            return self.push(i.region, point, right, out);
        }
        // joined to the waiting point: the region between them is complete
        let (done, goes_on) = if right { (i.second, i.region) } else { (i.region, i.second) };
        self.finish(done, point, out)?;
        self.push(goes_on, point, right, out)?;
        self.intervals[place].region = goes_on;
        self.intervals[place].second = NONE;
        Ok(())
    }

    fn region(&mut self, bottom: u32) -> u32 {
        let id = self.free.pop().unwrap_or_else(|| {
            self.regions.push(Region::default());
            self.regions.len() as u32 - 1
        });
        let r = &mut self.regions[id as usize];
        r.stack.clear();
        r.stack.push(bottom);
        id
    }

    /// The region is closed by a point that is on both of its sides.
    fn finish(&mut self, region: u32, point: u32, out: &mut Vec<[u32; 3]>) -> Result<(), NotSimple> {
        let side = self.regions[region as usize].right;
        self.push(region, point, !side, out)?;
        self.free.push(region);
        Ok(())
    }

    /// The next point of a monotone region: cuts off the triangles that it completes.
    #[inline]
    fn push(&mut self, region: u32, point: u32, right: bool, out: &mut Vec<[u32; 3]>) -> Result<(), NotSimple> {
        let Region { stack, right: stack_right } = &mut self.regions[region as usize];
        let p = self.points[point as usize];
        let id = self.ids[point as usize];
        if stack.len() < 2 {
            *stack_right = right;
        } else if *stack_right == right {
            // a chain of points that do not see the other side: cut off those that the new point sees
            while let [.., a, b] = stack[..] {
                let turn = orient(self.points[a as usize], self.points[b as usize], p);
                if turn == 0.0 || (turn > 0.0) != right {
                    break;
                }
                let (a, b) = (self.ids[a as usize], self.ids[b as usize]);
                out.push(if right { [a, b, id] } else { [b, a, id] });
                self.doubled_area += turn.abs();
                stack.pop();
            }
        } else {
            // the new point sees all of the other side
            let mut wrong = false;
            for w in stack.windows(2) {
                let (a, b) = (self.points[w[0] as usize], self.points[w[1] as usize]);
                let turn = (b - a).perp_dot(p - a);
                let turn = if right { -turn } else { turn };
                wrong |= turn < self.least;
                self.doubled_area += turn;
                let (a, b) = (self.ids[w[0] as usize], self.ids[w[1] as usize]);
                out.push(if right { [b, a, id] } else { [a, b, id] });
            }
            if wrong {
                return Err(NotSimple);
            }
            let top = stack[stack.len() - 1];
            stack.clear();
            stack.push(top);
            *stack_right = right;
        }
        stack.push(point);
        Ok(())
    }
}

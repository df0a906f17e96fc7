//! Roots of a cubic on the unit interval, all of them.

/// What is found along an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Root {
    /// In `0..=1`.
    pub at: f64,
    /// The cubic touches zero and turns back.
    pub grazes: bool,
}

/// At most three crossings, and where the cubic touches zero.
#[derive(Debug, Clone, Copy, Default)]
pub struct Roots {
    found: [(f64, bool); 5],
    count: usize,
    /// Whether the cubic is at or above zero at the end.
    pub above: bool,
}

impl Roots {
    pub fn iter(&self) -> impl Iterator<Item = Root> + '_ {
        self.found[..self.count].iter().map(|&(at, grazes)| Root { at, grazes })
    }

    fn push(&mut self, at: f64, grazes: bool) {
        self.found[self.count] = (at, grazes);
        self.count += 1;
    }
}

/// Value by Bernstein coefficients.
#[inline(always)]
pub fn value(b: &[f64; 4], t: f64) -> f64 {
    let s = 1.0 - t;
    s * s * (s * b[0] + 3.0 * t * b[1]) + t * t * (3.0 * s * b[2] + t * b[3])
}

/// Derivative by `t`.
#[inline(always)]
pub fn slope(b: &[f64; 4], t: f64) -> f64 {
    let s = 1.0 - t;
    3.0 * (s * s * (b[1] - b[0]) + 2.0 * s * t * (b[2] - b[1]) + t * t * (b[3] - b[2]))
}

/// All roots, in order. `above` says on which side of zero the cubic starts: what came before an interval decides that, not
/// the rounding of `b[0]`, so that no sign change is lost or found twice between two intervals. A turning point within
/// `graze` of zero that the cubic does not pass counts as a root.
pub fn roots(b: &[f64; 4], above: bool, graze: f64) -> Roots {
    let mut roots = Roots { above, ..Roots::default() };
    let (lowest, highest) = b.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    if (above && lowest > graze) || (!above && highest < -graze) {
        return roots;
    }
    let (turns, count) = turning_points(b);
    let mut from = 0.0;
    for i in 0..=count {
        let to = if i < count { turns[i] } else { 1.0 };
        let end = value(b, to);
        if i < count && end.abs() <= graze && stays(b, turns[..count].get(i + 1), roots.above) {
            roots.push(to, true);
        } else if roots.above != (end >= 0.0) {
            roots.push(crossing(b, from, to, end), false);
            roots.above = end >= 0.0;
        }
        from = to;
    }
    roots
}

/// Whether the cubic is on the same side of zero at its next turning point, or at the end.
#[inline(always)]
fn stays(b: &[f64; 4], next: Option<&f64>, above: bool) -> bool {
    (value(b, next.map_or(1.0, |t| *t)) >= 0.0) == above
}

/// Where the derivative changes its sign within the interval, in order.
#[inline(always)]
fn turning_points(b: &[f64; 4]) -> ([f64; 2], usize) {
    let d = [b[1] - b[0], b[2] - b[1], b[3] - b[2]];
    if (d[0] >= 0.0 && d[1] >= 0.0 && d[2] >= 0.0) || (d[0] <= 0.0 && d[1] <= 0.0 && d[2] <= 0.0) {
        return ([0.0; 2], 0);
    }
    // a t^2 + 2 h t + c
    let (a, h, c) = (d[0] - 2.0 * d[1] + d[2], d[1] - d[0], d[0]);
    let under = h * h - a * c;
    if under < 0.0 {
        return ([0.0; 2], 0);
    }
    // without cancellation
    let q = -(h + under.sqrt().copysign(h));
    let (r, s) = (q / a, c / q);
    let (r, s) = if r <= s { (r, s) } else { (s, r) };
    let inside = |t: f64| t > 0.0 && t < 1.0;
    match (inside(r), inside(s)) {
        (true, true) => ([r, s], 2),
        (true, false) => ([r, 0.0], 1),
        (false, true) => ([s, 0.0], 1),
        (false, false) => ([0.0; 2], 0),
    }
}

/// The root between `from` and `to`, where the cubic is monotone: Newton's method kept within a shrinking bracket.
#[inline(always)]
pub fn crossing(b: &[f64; 4], from: f64, to: f64, end: f64) -> f64 {
    let start = value(b, from);
    // only rounding put the sides of zero in doubt: the root is at the start
    if (start >= 0.0) == (end >= 0.0) {
        return from;
    }
    let (mut lo, mut hi) = (from, to);
    let mut t = from + (to - from) * (start / (start - end));
    for _ in 0..60 {
        let v = value(b, t);
        if v == 0.0 {
            break;
        }
        if (v >= 0.0) == (start >= 0.0) {
            lo = t;
        } else {
            hi = t;
        }
        let next = t - v / slope(b, t);
        let next = if next > lo && next < hi { next } else { 0.5 * (lo + hi) };
        // the error of the next is about the square of the step
        if (next - t).abs() <= 1e-9 || next == lo || next == hi {
            return next;
        }
        t = next;
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bernstein coefficients of `(t - r0) (t - r1) (t - r2)`.
    fn with_roots(r: [f64; 3]) -> [f64; 4] {
        let blossom = |p: [f64; 3]| {
            let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
            orders.iter().map(|o| (0..3).map(|i| p[i] - r[o[i]]).product::<f64>()).sum::<f64>() / 6.0
        };
        [blossom([0.0; 3]), blossom([0.0, 0.0, 1.0]), blossom([0.0, 1.0, 1.0]), blossom([1.0; 3])]
    }

    fn found(r: [f64; 3]) -> Vec<Root> {
        let b = with_roots(r);
        let got = roots(&b, b[0] >= 0.0, 1e-14);
        assert_eq!(got.above, b[3] >= 0.0);
        got.iter().collect()
    }

    #[test]
    fn three_roots_in_order() {
        for r in [[0.2, 0.5, 0.9], [0.1, 0.100001, 0.7], [0.3, 0.31, 0.32], [1e-9, 0.5, 1.0 - 1e-9]] {
            let got = found(r);
            assert_eq!(got.len(), 3, "{r:?} {got:?}");
            got.iter().zip(r).for_each(|(g, r)| assert!(!g.grazes && (g.at - r).abs() < 1e-6, "{g:?} {r}"));
        }
        assert_eq!(found([-1.0, 0.4, 2.0]).len(), 1);
        assert_eq!(found([-3.0, -2.0, 2.0]).len(), 0);
    }

    #[test]
    fn double_roots_graze() {
        for (r, crosses) in [([0.5, 0.5, 2.0], 0), ([0.25, 0.25, 0.75], 1), ([-0.5, 0.125, 0.125], 0)] {
            let got = found(r);
            assert_eq!(got.iter().filter(|g| !g.grazes).count(), crosses, "{r:?} {got:?}");
            let touch = got.iter().find(|g| g.grazes).unwrap();
            assert!((touch.at - if r[0] == r[1] { r[0] } else { r[1] }).abs() < 1e-7);
        }
    }

    #[test]
    fn the_side_before_decides() {
        // starts a rounding error above, but came from below
        let b = [1e-17, 1.0, 2.0, 3.0];
        let got: Vec<_> = roots(&b, false, 0.0).iter().collect();
        assert_eq!(got, [Root { at: 0.0, grazes: false }]);
        assert!(roots(&b, true, 0.0).iter().next().is_none());
        // constant zero
        assert!(roots(&[0.0; 4], true, 0.0).iter().next().is_none());
        assert_eq!(roots(&[0.0; 4], false, 0.0).iter().count(), 1);
    }
}

use glam::{DMat3, DVec3};

use crate::math::BackwardMap;

/// The boxes in which a map displaces, ready for tests of edges and triangles against them. Made once per map.
///
/// The faces of a box count as outside: displacement and its slope are zero there. So an edge on the border of the boxes'
/// union is undisplaced, and the triangles on its other side are left as they are.
#[derive(Debug, Clone, Default)]
pub struct Supports {
    boxes: Vec<Support>,
    feature: f64,
}

#[derive(Debug, Clone)]
struct Support {
    lower: DVec3,
    upper: DVec3,
    center: DVec3,
    /// Takes the open box, less a hair, to the open cube (-1,1)^3.
    local_from_world: DMat3,
    corners: [DVec3; 8],
    /// See [`Supports::with_features`].
    feature: f64,
}

/// What the box is shrunk by before it is tested: there a C1 spline is 1e-18 of its peak.
const HAIR: f64 = 1e-9;

impl Supports {
    /// The supports of `map`. `feature` is the size of the smallest feature of the field, in world units; an edge in a box is
    /// never left longer than that. Without it, a third of the smallest half-length of a box.
    pub fn new(map: &(impl BackwardMap + ?Sized), feature: Option<f64>) -> Self {
        let shapes = map.supports();
        let least = shapes.iter().map(|b| b.half.min_element() / 3.0).fold(f64::INFINITY, f64::min);
        let feature = feature.unwrap_or(least);
        let boxes = shapes
            .into_iter()
            .map(|shape| {
                let (lower, upper) = shape.bounds();
                let scale = DMat3::from_diagonal((1.0 + HAIR) / shape.half);
                let local_from_world = scale * shape.axes.transpose();
                Support { lower, upper, center: shape.center, local_from_world, corners: shape.corners(), feature }
            })
            .collect();
        Self { boxes, feature }
    }

    /// With the size of the smallest feature in each box, in the order of the map's boxes.
    pub fn with_features(mut self, features: impl IntoIterator<Item = f64>) -> Self {
        self.boxes.iter_mut().zip(features).for_each(|(s, feature)| s.feature = feature);
        self
    }

    /// Only the boxes that the plane across `normal` at `height` meets, put into `out`: edges in it touch no other.
    pub fn crossing(&self, normal: DVec3, height: f64, out: &mut Self) {
        out.feature = self.feature;
        out.boxes.clear();
        out.boxes.extend(self.boxes.iter().filter(|s| s.meets(normal, height)).cloned());
    }

    /// Whether nothing is displaced anywhere.
    pub fn is_empty(&self) -> bool {
        self.boxes.is_empty()
    }

    /// The longest edge that may stay in a box.
    pub fn feature(&self) -> f64 {
        self.feature
    }

    /// Whether the segment passes through the inside of a box.
    pub fn touches_segment(&self, a: DVec3, b: DVec3) -> bool {
        let (lower, upper) = (a.min(b), a.max(b));
        self.boxes.iter().any(|s| !s.apart(lower, upper) && s.cuts(a, b))
    }

    /// Whether the segment passes through the inside of a box, and is longer than so many of its features.
    pub fn wants_split(&self, a: DVec3, b: DVec3, features: f64) -> bool {
        let (lower, upper) = (a.min(b), a.max(b));
        let length = a.distance(b);
        self.boxes.iter().any(|s| length > features * s.feature && !s.apart(lower, upper) && s.cuts(a, b))
    }

    /// Whether the plane section of a box lies within the triangle and crosses none of its sides; then no edge tells of it.
    /// Triangles that are not longer than so many features do not count.
    pub fn hidden_in_triangle(&self, t: [DVec3; 3], features: f64) -> bool {
        let (lower, upper) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
        let extent = (upper - lower).length();
        self.boxes.iter().any(|s| {
            let touches = || (0..3).any(|i| s.cuts(t[i], t[(i + 1) % 3]));
            extent > features * s.feature && !s.apart(lower, upper) && !touches() && s.section_in(t)
        })
    }
}

impl Support {
    fn meets(&self, normal: DVec3, height: f64) -> bool {
        let heights = self.corners.map(|c| normal.dot(c));
        let (lo, hi) = heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), h| (lo.min(*h), hi.max(*h)));
        let slack = HAIR * (hi - lo);
        lo - slack <= height && height <= hi + slack
    }

    fn apart(&self, lower: DVec3, upper: DVec3) -> bool {
        upper.cmple(self.lower).any() || lower.cmpge(self.upper).any()
    }

    /// Clips the segment against the slabs of the box.
    fn cuts(&self, a: DVec3, b: DVec3) -> bool {
        let p = self.local_from_world * (a - self.center);
        let q = self.local_from_world * (b - self.center);
        if p.abs().max_element() < 1.0 || q.abs().max_element() < 1.0 {
            return true;
        }
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for axis in 0..3 {
            let (p, step) = (p[axis], q[axis] - p[axis]);
            if step.abs() < 1e-300 {
                if p.abs() >= 1.0 {
                    return false;
                }
                continue;
            }
            let (t0, t1) = ((-1.0 - p) / step, (1.0 - p) / step);
            from = from.max(t0.min(t1));
            to = to.min(t0.max(t1));
        }
        // a touch from outside does not count
        from < to
    }

    /// Whether the middle of the places where edges of the box meet the triangle's plane, a point inside the section, lies in
    /// the triangle. The section may reach up to a side and along it.
    fn section_in(&self, [a, b, c]: [DVec3; 3]) -> bool {
        let normal = (b - a).cross(c - a);
        let corners = &self.corners;
        let height = corners.map(|p| normal.dot(p - a));
        let inside = |p: DVec3| {
            let side = |u: DVec3, v: DVec3| normal.dot((v - u).cross(p - u)) > 0.0;
            side(a, b) && side(b, c) && side(c, a)
        };
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        for i in 0..8 {
            for j in [1, 2, 4].map(|bit| i | bit) {
                if (height[i] < 0.0) != (height[j] < 0.0) {
                    sum += corners[i].lerp(corners[j], height[i] / (height[i] - height[j]));
                    count += 1.0;
                }
            }
        }
        count > 0.0 && inside(sum / count)
    }
}

use glam::{DMat3, DVec3};

use crate::math::{BackwardMap, OrientedBox};

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
    shape: OrientedBox,
}

/// What the box is shrunk by before it is tested: there a C1 spline is 1e-18 of its peak.
const HAIR: f64 = 1e-9;

impl Supports {
    /// The supports of `map`. `feature` is the size of the smallest feature of the field, in world units; an edge in a box is
    /// never left longer than that. Without it, a third of the smallest half-length of a box.
    pub fn new(map: &(impl BackwardMap + ?Sized), feature: Option<f64>) -> Self {
        let shapes = map.supports();
        let smallest = shapes.iter().map(|b| b.half.min_element() / 3.0).fold(f64::INFINITY, f64::min);
        let boxes = shapes
            .into_iter()
            .map(|shape| {
                let (lower, upper) = shape.bounds();
                let scale = DMat3::from_diagonal((1.0 + HAIR) / shape.half);
                Support { lower, upper, center: shape.center, local_from_world: scale * shape.axes.transpose(), shape }
            })
            .collect();
        Self { boxes, feature: feature.unwrap_or(smallest) }
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

    /// Whether the plane section of a box lies within the triangle and crosses none of its sides; then no edge tells of it.
    pub fn hidden_in_triangle(&self, t: [DVec3; 3]) -> bool {
        let (lower, upper) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
        self.boxes.iter().any(|s| {
            let touches = || (0..3).any(|i| s.cuts(t[i], t[(i + 1) % 3]));
            !s.apart(lower, upper) && s.section_in(t) && !touches()
        })
    }
}

impl Support {
    fn apart(&self, lower: DVec3, upper: DVec3) -> bool {
        upper.cmple(self.lower).any() || lower.cmpge(self.upper).any()
    }

    /// Clips the segment against the slabs of the box.
    fn cuts(&self, a: DVec3, b: DVec3) -> bool {
        let p = self.local_from_world * (a - self.center);
        let q = self.local_from_world * (b - self.center);
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
        // a point inside (a segment of no length) counts, a touch from outside does not
        from < to
    }

    /// Whether the middle of the places where edges of the box meet the triangle's plane, a point inside the section, lies in
    /// the triangle. The section may reach up to a side and along it.
    fn section_in(&self, [a, b, c]: [DVec3; 3]) -> bool {
        let normal = (b - a).cross(c - a);
        let corners = self.shape.corners();
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

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
    /// The smallest feature in any of the boxes.
    least: f64,
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
    /// A point inside its section, where the bounds are those of the section with a plane.
    middle: Option<DVec3>,
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
                Support {
                    lower,
                    upper,
                    center: shape.center,
                    local_from_world,
                    corners: shape.corners(),
                    feature,
                    middle: None,
                }
            })
            .collect();
        Self { boxes, feature, least: feature }
    }

    /// With the size of the smallest feature in each box, in the order of the map's boxes.
    pub fn with_features(mut self, features: impl IntoIterator<Item = f64>) -> Self {
        self.boxes.iter_mut().zip(features).for_each(|(s, feature)| s.feature = feature);
        self.least = least(&self.boxes);
        self
    }

    /// Only the boxes that the plane across `normal` at `height` meets, put into `out`: edges in it touch no other.
    pub fn crossing(&self, normal: DVec3, height: f64, out: &mut Self) {
        out.feature = self.feature;
        out.boxes.clear();
        out.boxes.extend(self.boxes.iter().filter_map(|s| s.at_plane(normal, height)));
        out.least = least(&out.boxes);
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
        let length = a.distance(b);
        // most edges of a draft
        if length <= features * self.least {
            return false;
        }
        let (lower, upper) = (a.min(b), a.max(b));
        self.boxes.iter().any(|s| length > features * s.feature && !s.apart(lower, upper) && s.cuts(a, b))
    }

    /// Whether the plane section of a box lies within the triangle and crosses none of its sides; then no edge tells of it.
    /// Triangles that are not longer than so many features do not count.
    pub fn hidden_in_triangle(&self, t: [DVec3; 3], features: f64) -> bool {
        let (lower, upper) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
        let extent = (upper - lower).length();
        if extent <= features * self.least {
            return false;
        }
        self.boxes.iter().any(|s| {
            let touches = || (0..3).any(|i| s.cuts(t[i], t[(i + 1) % 3]));
            extent > features * s.feature && !s.apart(lower, upper) && s.section_in(t) && !touches()
        })
    }
}

fn least(boxes: &[Support]) -> f64 {
    boxes.iter().map(|s| s.feature).fold(f64::INFINITY, f64::min)
}

impl Support {
    /// The same with the bounds of its section with a plane; `None` if they do not meet.
    fn at_plane(&self, normal: DVec3, height: f64) -> Option<Self> {
        let heights = self.corners.map(|c| normal.dot(c) - height);
        let (lo, hi) = heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), h| (lo.min(*h), hi.max(*h)));
        let slack = HAIR * (hi - lo);
        if lo > slack || hi < -slack {
            return None;
        }
        let mut here = self.clone();
        let Some(section) = self.section(heights) else { return Some(here) };
        // what lies in the plane is there up to rounding
        let slack = DVec3::splat(HAIR * (self.upper - self.lower).max_element());
        here.lower = self.lower.max(section.lower - slack);
        here.upper = self.upper.min(section.upper + slack);
        here.middle = Some(section.middle);
        Some(here)
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

    /// The section with a plane, by the heights of the corners above it; `None` if no edge crosses it.
    fn section(&self, heights: [f64; 8]) -> Option<Section> {
        let mut section = Section { lower: DVec3::INFINITY, upper: DVec3::NEG_INFINITY, middle: DVec3::ZERO };
        let mut count = 0.0;
        for [i, j] in OrientedBox::EDGES {
            if (heights[i] < 0.0) != (heights[j] < 0.0) {
                let p = self.corners[i].lerp(self.corners[j], heights[i] / (heights[i] - heights[j]));
                section.lower = section.lower.min(p);
                section.upper = section.upper.max(p);
                section.middle += p;
                count += 1.0;
            }
        }
        section.middle /= count;
        (count > 0.0).then_some(section)
    }

    /// Whether a point inside the section with the triangle's plane lies in the triangle. The section may reach up to a side
    /// and along it.
    fn section_in(&self, [a, b, c]: [DVec3; 3]) -> bool {
        let normal = (b - a).cross(c - a);
        let inside = |p: DVec3| {
            let side = |u: DVec3, v: DVec3| normal.dot((v - u).cross(p - u)) > 0.0;
            side(a, b) && side(b, c) && side(c, a)
        };
        let middle = self.middle.or_else(|| {
            let section = self.section(self.corners.map(|p| normal.dot(p - a)));
            section.map(|s| s.middle)
        });
        middle.is_some_and(inside)
    }
}

/// Where a plane cuts a box.
struct Section {
    lower: DVec3,
    upper: DVec3,
    /// The mean of the places where edges meet the plane.
    middle: DVec3,
}

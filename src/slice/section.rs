use glam::DVec2;

use crate::math::{OrientedBox, PlaneFrame};

/// The section of a box with the plane of `frame` at `height`: a convex polygon in in-plane coordinates, anticlockwise,
/// of 3 to 6 corners, or none. Corners at or above the plane count as above, as for meshes.
pub fn box_section(b: &OrientedBox, frame: &PlaneFrame, height: f64) -> Vec<DVec2> {
    let corners = b.corners();
    let heights = corners.map(|c| frame.height(c) - height);
    let mut points = Vec::with_capacity(6);
    for [from, to] in OrientedBox::EDGES {
        if (heights[from] >= 0.0) == (heights[to] >= 0.0) {
            continue;
        }
        let (lo, hi) = if heights[from] < heights[to] { (from, to) } else { (to, from) };
        let f = -heights[lo] / (heights[hi] - heights[lo]);
        points.push(frame.project(corners[lo]) * (1.0 - f) + frame.project(corners[hi]) * f);
    }
    if points.len() < 3 || points.iter().any(|p| !p.is_finite()) {
        return Vec::new();
    }
    // a section of a convex body is convex: its corners in order of their angle about the middle
    let middle = points.iter().sum::<DVec2>() / points.len() as f64;
    points.sort_by(|a, b| (*a - middle).to_angle().total_cmp(&(*b - middle).to_angle()));
    points.dedup();
    while points.len() > 1 && points.first() == points.last() {
        points.pop();
    }
    if points.len() < 3 {
        points.clear();
    }
    points
}

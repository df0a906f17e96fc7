use glam::DVec2;

use crate::math::{OrientedBox, PlaneFrame};

/// The sections of a box with the planes of one frame.
#[derive(Debug)]
pub struct BoxSections {
    corners: [DVec2; 8],
    heights: [f64; 8],
}

impl BoxSections {
    pub fn new(b: &OrientedBox, frame: &PlaneFrame) -> Self {
        let corners = b.corners();
        Self { corners: corners.map(|c| frame.project(c)), heights: corners.map(|c| frame.height(c)) }
    }

    /// The section with the plane at `height`: a convex polygon in in-plane coordinates, anticlockwise, of 3 to 6 corners, or
    /// none. Corners at or above the plane count as above, as for meshes.
    pub fn at(&self, height: f64) -> Vec<DVec2> {
        let heights = self.heights.map(|h| h - height);
        let mut points = [DVec2::ZERO; 12];
        let mut count = 0;
        for [from, to] in OrientedBox::EDGES {
            if (heights[from] >= 0.0) == (heights[to] >= 0.0) {
                continue;
            }
            let (lo, hi) = if heights[from] < heights[to] { (from, to) } else { (to, from) };
            let f = -heights[lo] / (heights[hi] - heights[lo]);
            points[count] = self.corners[lo] * (1.0 - f) + self.corners[hi] * f;
            count += 1;
        }
        let points = &mut points[..count];
        if points.len() < 3 || points.iter().any(|p| !p.is_finite()) {
            return Vec::new();
        }
        // a section of a convex body is convex: its corners in order of their angle about the middle
        let middle = points.iter().sum::<DVec2>() / points.len() as f64;
        let mut by_angle = [(0.0, DVec2::ZERO); 12];
        by_angle.iter_mut().zip(&*points).for_each(|(a, p)| *a = ((*p - middle).to_angle(), *p));
        by_angle[..count].sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut points: Vec<_> = by_angle[..count].iter().map(|(_, p)| *p).collect();
        points.dedup();
        while points.len() > 1 && points.first() == points.last() {
            points.pop();
        }
        if points.len() < 3 {
            points.clear();
        }
        points
    }
}

//! How far points are from a triangle mesh.

use glam::DVec3;

use super::locate::Locator;

impl Locator<'_> {
    /// The point of the mesh nearest to `p`; `None` if there are no triangles.
    pub fn nearest(&self, p: DVec3) -> Option<DVec3> {
        let corners = |t: u32| self.mesh.triangles[t as usize].map(|v| self.mesh.positions[v as usize]);
        let found = self.tree.nearest_item(p, |t| nearest_in_triangle(corners(t), p).distance_squared(p));
        found.map(|(t, _)| nearest_in_triangle(corners(t), p))
    }

    /// The distance from `p` to the mesh; infinite if there are no triangles.
    pub fn distance(&self, p: DVec3) -> f64 {
        self.nearest(p).map_or(f64::INFINITY, |q| q.distance(p))
    }
}

/// The point of a triangle nearest to `p`, by the region of the triangle's plane in which it lies (Ericson 2005,
/// section 5.1.5). Triangles without area are segments.
fn nearest_in_triangle([a, b, c]: [DVec3; 3], p: DVec3) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    let sum = va + vb + vc;
    if va > 0.0 && vb > 0.0 && vc > 0.0 && sum > 0.0 {
        return a + ab * (vb / sum) + ac * (vc / sum);
    }
    let sides = [(a, b), (b, c), (c, a)].map(|(s, e)| {
        let along = e - s;
        let t = (p - s).dot(along) / along.length_squared();
        // two corners in one place: either
        if t.is_finite() { s + along * t.clamp(0.0, 1.0) } else { s }
    });
    let by_distance = |q: &DVec3, r: &DVec3| q.distance_squared(p).total_cmp(&r.distance_squared(p));
    sides.into_iter().min_by(by_distance).unwrap_or(a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::primitives;

    #[test]
    fn the_nearest_point_of_a_triangle_is_that_of_a_fine_search() {
        let triangles = [
            [DVec3::new(0.1, 0.2, 0.3), DVec3::new(1.1, 0.1, 0.2), DVec3::new(0.4, 0.9, 0.6)],
            // obtuse, a segment, a point
            [DVec3::ZERO, DVec3::X, DVec3::new(-0.9, 0.2, 0.0)],
            [DVec3::ZERO, DVec3::X, DVec3::X * 0.3],
            [DVec3::ONE; 3],
        ];
        for t in triangles {
            for i in 0..125 {
                let p = DVec3::new((i % 5) as f64, (i / 5 % 5) as f64, (i / 25) as f64) - 1.7;
                let found = nearest_in_triangle(t, p).distance(p);
                let n = 60;
                let fine = (0..=n).flat_map(|u| (0..=n - u).map(move |v| (u as f64 / n as f64, v as f64 / n as f64)));
                let least = fine.map(|(u, v)| (t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v).distance(p));
                let least = least.fold(f64::INFINITY, f64::min);
                assert!(found <= least + 1e-12 && found >= least - 0.03, "{found} {least}");
            }
        }
    }

    #[test]
    fn a_box_is_as_far_as_its_sides() {
        let mesh = primitives::aligned_box(DVec3::ZERO, DVec3::new(2.0, 3.0, 4.0));
        let box_ = Locator::new(&mesh);
        assert_eq!(box_.nearest(DVec3::new(1.0, 1.0, 5.0)), Some(DVec3::new(1.0, 1.0, 4.0)));
        assert_eq!(box_.distance(DVec3::new(0.5, 1.0, 2.0)), 0.5);
        assert_eq!(box_.distance(DVec3::new(-3.0, -4.0, 2.0)), 5.0);
        // many triangles: as near as a full search finds
        let mesh = primitives::bumpy_sphere(8);
        let bumps = Locator::new(&mesh);
        for i in 0..60 {
            let p = DVec3::new((i % 4) as f64, (i / 4 % 4) as f64, (i / 16) as f64) * 0.7 - 1.1;
            let each = mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize]));
            let full = each.map(|t| nearest_in_triangle(t, p).distance(p)).fold(f64::INFINITY, f64::min);
            assert_eq!(bumps.distance(p), full);
        }
        let none = crate::mesh::TriMesh::default();
        assert_eq!(Locator::new(&none).distance(DVec3::ZERO), f64::INFINITY);
    }
}

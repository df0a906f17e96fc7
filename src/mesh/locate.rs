//! Where a point lies: inside or outside of a closed mesh.
//!
//! # Theory
//!
//! A ray from the point along +x crosses the surface outward once more than inward exactly if the point is inside. The
//! number of outward less inward crossings is the winding number of the surface about the point: 1 inside a clean solid, 0
//! outside and in a cavity, 2 where two solids overlap.
//!
//! # Practice
//!
//! A ray through an edge or a vertex must count as one crossing, not as two or none. The projection of each triangle along
//! x takes its lower and left border but not its upper and right one, and the signs are exact, so triangles that tile the
//! projection cover each ray once.

use glam::DVec3;

use super::TriMesh;
use super::bvh::{Aabb, Bvh};
use super::exact::{side, turn};

/// Answers for many points of one mesh.
pub struct Locator<'a> {
    pub(super) mesh: &'a TriMesh,
    pub(super) tree: Bvh,
}

impl<'a> Locator<'a> {
    pub fn new(mesh: &'a TriMesh) -> Self {
        let boxes = mesh.triangles.iter().map(|t| Aabb::around(&t.map(|v| mesh.positions[v as usize]))).collect();
        Self { mesh, tree: Bvh::new(boxes) }
    }

    /// How often the mesh winds about `p`: exact for a closed mesh and a point that is not on it.
    pub fn winding_number(&self, p: DVec3) -> i32 {
        let ray = Aabb { lo: p, hi: DVec3::new(f64::INFINITY, p.y, p.z) };
        let mut winding = 0;
        self.tree.overlapping(&ray, |t| {
            let corners = self.mesh.triangles[t as usize].map(|v| self.mesh.positions[v as usize]);
            let covers = covers_along_x(corners, p);
            // outward crossing: the triangle faces +x and the point lies behind it
            if covers != 0 && side(corners, p) * f64::from(covers) < 0.0 {
                winding += covers;
            }
        });
        winding
    }

    /// Whether `p` is inside the closed mesh.
    pub fn contains(&self, p: DVec3) -> bool {
        self.winding_number(p) != 0
    }
}

/// 1 or -1 if the line through `p` along x meets the triangle where it faces +x or -x, 0 if it misses.
fn covers_along_x([a, b, c]: [DVec3; 3], p: DVec3) -> i32 {
    let mut winding = 0;
    for (s, e) in [(a, b), (b, c), (c, a)] {
        if s.z <= p.z && e.z > p.z {
            winding += i32::from(turn(0, s, e, p) > 0.0);
        } else if s.z > p.z && e.z <= p.z {
            winding -= i32::from(turn(0, s, e, p) < 0.0);
        }
    }
    winding
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::primitives;

    #[test]
    fn every_ray_through_vertices_and_edges_counts_once() {
        // all rays of the lattice meet vertices, edges or diagonals of the cube
        let cube = primitives::aligned_box(DVec3::ZERO, DVec3::splat(4.0));
        let inside = Locator::new(&cube);
        for i in 0..1000 {
            let p = DVec3::new((i % 10) as f64 - 2.5, (i / 10 % 10) as f64 - 3.0, (i / 100) as f64 - 3.0)
                + DVec3::new(0.0, 0.5, 0.5) * ((i % 3) / 2) as f64;
            let strictly = p.cmpgt(DVec3::ZERO).all() && p.cmplt(DVec3::splat(4.0)).all();
            let outside = p.cmplt(DVec3::ZERO).any() || p.cmpgt(DVec3::splat(4.0)).any();
            if strictly || outside {
                assert_eq!(inside.winding_number(p), i32::from(strictly), "{p}");
            }
        }
    }

    #[test]
    fn balls_are_inside_by_their_radius_from_any_vertex_ray() {
        let ball = primitives::geodesic_sphere(9);
        let inside = Locator::new(&ball);
        for v in &ball.positions {
            assert_eq!(inside.winding_number(*v * 0.97), 1);
            assert_eq!(inside.winding_number(*v * 1.001), 0);
            // straight through the vertex
            assert_eq!(inside.winding_number(DVec3::new(-2.0, v.y, v.z)), 0);
        }
        let mut turned = ball.clone();
        turned.flip();
        assert_eq!(Locator::new(&turned).winding_number(DVec3::ZERO), -1);
    }

    #[test]
    fn cavities_are_outside_and_overlaps_count_twice() {
        let cavity = primitives::cavity_sphere(8);
        let inside = Locator::new(&cavity);
        assert!(!inside.contains(DVec3::new(0.03, -0.02, 0.04)));
        assert!(inside.contains(DVec3::new(0.6, 0.0, 0.0)));
        let mut two = primitives::geodesic_sphere(4);
        let other = two.transformed(&glam::DAffine3::from_translation(DVec3::new(1.0, 0.0, 0.0)));
        two.append(&other);
        let inside = Locator::new(&two);
        assert_eq!([-0.5, 0.5, 1.5, 2.5].map(|x| inside.winding_number(DVec3::new(x, 0.01, 0.02))), [1, 2, 1, 0]);
    }
}

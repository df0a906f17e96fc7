//! How good the tetrahedra of a mesh are, and how they fit together.
//!
//! # Theory
//!
//! The dihedral angle of a tetrahedron at an edge lies between its two faces there; small ones make the gradient of an
//! interpolated function large, large ones make it wrong (Shewchuk 2002). The radius ratio is three times the radius of
//! the inscribed ball over that of the circumscribed one: 1 for the regular tetrahedron, 0 for a flat one.

use glam::DVec3;
use rayon::prelude::*;

use super::check::MeshReport;
use super::tet_faces::{TetFaces, surface};
use super::tets::{FACES, TetMesh, signed_volume};

/// Facts of a tetrahedral mesh. Of a mesh without tetrahedra, angles and ratios are 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TetQuality {
    pub points: usize,
    pub tets: usize,
    /// Tetrahedra whose volume is not positive.
    pub inverted: usize,
    /// Sum of the signed volumes.
    pub volume: f64,
    /// Smallest and largest dihedral angle, in degrees.
    pub dihedral: [f64; 2],
    /// From 0 (flat) to 1 (regular).
    pub least_radius_ratio: f64,
    pub mean_radius_ratio: f64,
    /// Whether each face belongs to one tetrahedron, or to two on either side.
    pub conforming: bool,
    pub boundary_faces: usize,
    /// Whether the boundary is a closed surface without edges or points at which parts of it only touch.
    pub manifold: bool,
}

impl TetQuality {
    pub fn of(mesh: &TetMesh) -> Self {
        Self::with_faces(mesh, &TetFaces::of(&mesh.tets))
    }

    pub(super) fn with_faces(mesh: &TetMesh, faces: &TetFaces) -> Self {
        let shapes: Vec<Shape> = mesh.tets.par_iter().map(|t| Shape::of(TetMesh::corners(*t, &mesh.points))).collect();
        let none = shapes.is_empty();
        let extreme = |start: f64, pick: fn(f64, f64) -> f64, of: fn(&Shape) -> f64| {
            if none { 0.0 } else { shapes.iter().map(of).fold(start, pick) }
        };
        let outside = MeshReport::of_connectivity(&surface(mesh, &faces.boundary));
        Self {
            points: mesh.points.len(),
            tets: mesh.tets.len(),
            inverted: shapes.iter().filter(|s| !(s.volume > 0.0)).count(),
            volume: shapes.iter().map(|s| s.volume).sum(),
            dihedral: [extreme(f64::INFINITY, f64::min, |s| s.dihedral[0]), extreme(0.0, f64::max, |s| s.dihedral[1])],
            least_radius_ratio: extreme(f64::INFINITY, f64::min, |s| s.radius_ratio),
            mean_radius_ratio: shapes.iter().map(|s| s.radius_ratio).sum::<f64>() / shapes.len().max(1) as f64,
            conforming: faces.is_conforming(),
            boundary_faces: faces.boundary.len(),
            manifold: outside.closed && outside.manifold && outside.oriented,
        }
    }
}

/// Facts of one tetrahedron.
struct Shape {
    volume: f64,
    /// Smallest and largest, in degrees.
    dihedral: [f64; 2],
    radius_ratio: f64,
}

impl Shape {
    fn of(corners: [DVec3; 4]) -> Self {
        let volume = signed_volume(corners);
        // twice the faces' areas long
        let normals = FACES.map(|f| {
            let [p, q, r] = f.map(|c| corners[c]);
            (q - p).cross(r - p)
        });
        let mut dihedral = [180.0, 0.0f64];
        for i in 0..4 {
            for j in 0..i {
                // both look outwards or, in an inverted tetrahedron, both inwards
                let (n, m) = (normals[i], normals[j]);
                let angle = 180.0 - n.cross(m).length().atan2(n.dot(m)).to_degrees();
                dihedral = [dihedral[0].min(angle), dihedral[1].max(angle)];
            }
        }
        let area = normals.iter().map(|n| n.length()).sum::<f64>() / 2.0;
        let [a, b, c] = [1, 2, 3].map(|i| corners[i] - corners[0]);
        let center =
            a.length_squared() * b.cross(c) + b.length_squared() * c.cross(a) + c.length_squared() * a.cross(b);
        // inscribed 3 V / area, circumscribed |center| / (12 V)
        let ratio = 108.0 * volume * volume / (area * center.length());
        Self { volume, dihedral, radius_ratio: if ratio.is_finite() { ratio } else { 0.0 } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_regular_tetrahedron_and_a_corner_of_a_cube() {
        let v = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let regular = Shape::of([v(1.0, 1.0, 1.0), v(1.0, -1.0, -1.0), v(-1.0, 1.0, -1.0), v(-1.0, -1.0, 1.0)]);
        let angle = (1.0f64 / 3.0).acos().to_degrees();
        assert!(regular.dihedral.iter().all(|d| (d - angle).abs() < 1e-12), "{:?}", regular.dihedral);
        assert!((regular.radius_ratio - 1.0).abs() < 1e-14 && (regular.volume.abs() - 8.0 / 3.0).abs() < 1e-15);
        let corner = Shape::of([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        assert!((corner.dihedral[0] - (1.0f64 / 3.0).sqrt().acos().to_degrees()).abs() < 1e-12);
        assert!((corner.dihedral[1] - 90.0).abs() < 1e-12);
        // r = 1 / (3 + sqrt 3), R = sqrt 3 / 2
        let ratio = 6.0 / (3f64.sqrt() * (3.0 + 3f64.sqrt()));
        assert!((corner.radius_ratio - ratio).abs() < 1e-14);
        assert_eq!(Shape::of([DVec3::ZERO; 4]).radius_ratio, 0.0);
    }
}

//! Tetrahedral meshes: points, tetrahedra, regions and named vectors at the points.
//!
//! Corners (a, b, c, d) of a tetrahedron of positive volume: (b - a) x (c - a) . (d - a) > 0. Meshes are kept as they were
//! read: a negative tetrahedron stays negative, so that a rest mesh and its deformed positions keep the same numbering.

use glam::{DAffine3, DVec3};

/// A tetrahedral mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TetMesh {
    pub points: Vec<DVec3>,
    /// Indices into `points`, each below its length.
    pub tets: Vec<[u32; 4]>,
    /// Region (physical group, material) of each tetrahedron; empty if the mesh has none.
    pub regions: Vec<i32>,
    /// Vectors at the points, by name: `deformed` holds absolute deformed positions by custom.
    pub vectors: Vec<PointVectors>,
}

/// A vector at every point of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct PointVectors {
    pub name: String,
    /// One for each point.
    pub values: Vec<DVec3>,
}

/// The faces of a tetrahedron, each opposite to the corner of the same number, anticlockwise seen from outside if the
/// tetrahedron is positive.
pub const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

impl TetMesh {
    pub fn new(points: Vec<DVec3>, tets: Vec<[u32; 4]>) -> Self {
        Self { points, tets, ..Self::default() }
    }

    /// Lower and upper corner; `None` without points.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        bounds(&self.points)
    }

    /// The vectors of this name.
    pub fn vectors(&self, name: &str) -> Option<&[DVec3]> {
        self.vectors.iter().find(|v| v.name == name).map(|v| v.values.as_slice())
    }

    /// Corners of a tetrahedron at these positions of the points.
    pub fn corners(tet: [u32; 4], points: &[DVec3]) -> [DVec3; 4] {
        tet.map(|v| points[v as usize])
    }

    /// Signed volume of one tetrahedron.
    pub fn tet_volume(&self, tet: usize) -> f64 {
        signed_volume(Self::corners(self.tets[tet], &self.points))
    }

    /// Sum of the signed volumes.
    pub fn volume(&self) -> f64 {
        (0..self.tets.len()).map(|t| self.tet_volume(t)).sum()
    }

    /// The points (not the vectors) moved by `map`.
    pub fn transformed(&self, map: &DAffine3) -> Self {
        Self { points: self.points.iter().map(|p| map.transform_point3(*p)).collect(), ..self.clone() }
    }
}

/// Lower and upper corner of points; `None` if there are none.
pub fn bounds(points: &[DVec3]) -> Option<(DVec3, DVec3)> {
    let first = *points.first()?;
    Some(points.iter().fold((first, first), |(lo, hi), p| (lo.min(*p), hi.max(*p))))
}

/// Signed volume of the tetrahedron with these corners.
pub fn signed_volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a) / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_look_outwards() {
        let p = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        assert!((signed_volume(p) - 1.0 / 6.0).abs() < 1e-15);
        for (opposite, face) in FACES.iter().enumerate() {
            let [a, b, c] = face.map(|i| p[i]);
            assert!((b - a).cross(c - a).dot(p[opposite] - a) < 0.0);
        }
    }
}

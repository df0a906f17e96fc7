//! The faces of tetrahedra: which two share one, and which faces bound the whole.

use std::cmp::Ordering;

use rayon::prelude::*;

use super::TriMesh;
use super::tets::{FACES, TetMesh};

/// How the tetrahedra of a mesh meet. Only connectivity is looked at: a point in the middle of a neighbour's face shows
/// as boundary faces inside the body.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TetFaces {
    /// Faces of one tetrahedron only, outwards if it is positive; in the order of their tetrahedra.
    pub boundary: Vec<[u32; 3]>,
    /// Faces of exactly two.
    pub shared: usize,
    /// Faces of more than two.
    pub crowded: usize,
    /// Faces whose two tetrahedra lie on the same side.
    pub overlapping: usize,
}

impl TetFaces {
    pub fn of(tets: &[[u32; 4]]) -> Self {
        // the three corners in order, then the place, whose lowest bit says whether ordering them turned the face round
        let mut sides: Vec<([u32; 3], u64)> = (0..4 * tets.len())
            .into_par_iter()
            .map(|s| {
                let (key, odd) = sorted(face(tets, s));
                (key, 2 * s as u64 + u64::from(odd))
            })
            .collect();
        sides.par_sort_unstable();
        let mut faces = Self::default();
        let mut boundary = Vec::new();
        for group in sides.chunk_by(|a, b| a.0 == b.0) {
            match group.len().cmp(&2) {
                Ordering::Less => boundary.push(group[0].1),
                Ordering::Equal => {
                    faces.shared += 1;
                    faces.overlapping += usize::from(group[0].1 % 2 == group[1].1 % 2);
                }
                Ordering::Greater => faces.crowded += 1,
            }
        }
        boundary.par_sort_unstable();
        faces.boundary = boundary.iter().map(|&s| face(tets, (s / 2) as usize)).collect();
        faces
    }

    /// Whether each face belongs to one tetrahedron, or to two on either side.
    pub fn is_conforming(&self) -> bool {
        self.crowded == 0 && self.overlapping == 0
    }
}

/// Side `s` is the face of tetrahedron `s / 4` opposite to its corner `s % 4`.
fn face(tets: &[[u32; 4]], s: usize) -> [u32; 3] {
    FACES[s % 4].map(|c| tets[s / 4][c])
}

/// The corners in order, and whether an odd number of swaps leads there.
fn sorted(mut f: [u32; 3]) -> ([u32; 3], bool) {
    let mut odd = false;
    for (a, b) in [(0, 1), (1, 2), (0, 1)] {
        if f[a] > f[b] {
            f.swap(a, b);
            odd = !odd;
        }
    }
    (f, odd)
}

/// The surface of a mesh of positive tetrahedra, facing outwards, with only the points that it uses.
pub fn boundary(mesh: &TetMesh) -> TriMesh {
    surface(mesh, &TetFaces::of(&mesh.tets).boundary)
}

pub(super) fn surface(mesh: &TetMesh, faces: &[[u32; 3]]) -> TriMesh {
    let mut new_id = vec![u32::MAX; mesh.points.len()];
    let mut positions = Vec::new();
    let triangles = faces.iter().map(|f| {
        f.map(|v| {
            let id = &mut new_id[v as usize];
            if *id == u32::MAX {
                *id = positions.len() as u32;
                positions.push(mesh.points[v as usize]);
            }
            *id
        })
    });
    let triangles = triangles.collect();
    TriMesh { positions, triangles }
}

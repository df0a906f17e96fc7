//! What a tetrahedral mesh is and what is wrong with it.
//!
//! # Theory
//!
//! A mesh that can carry a deformation has tetrahedra of positive volume that meet in whole faces, each face in one
//! tetrahedron (then it is on the boundary) or in two. The rest mesh of a deformation may be negative throughout: only the
//! sign of a deformed tetrahedron against that at rest tells whether it is turned over.
//!
//! # Practice
//!
//! Faces are told apart by the numbers of their points: two points in one place are two points. The signs of volumes are
//! exact, so that the number of inverted and of degenerate tetrahedra depends on nothing but the positions.

use glam::DVec3;
use rayon::prelude::*;

use super::check::DisjointSets;
use super::exact::side;
use super::tets::{FACES, TetMesh, signed_volume};

/// Facts of a tetrahedral mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct TetReport {
    /// Points, also those that no tetrahedron uses.
    pub nodes: usize,
    pub tets: usize,
    /// Points that no tetrahedron uses.
    pub unused_points: usize,
    /// Tetrahedra of negative volume.
    pub inverted: usize,
    /// Tetrahedra whose corners lie in one plane.
    pub degenerate: usize,
    /// Sum of the absolute volumes: that of the body, whichever way its tetrahedra are numbered.
    pub volume: f64,
    /// Sum of the signed volumes.
    pub signed_volume: f64,
    /// Largest absolute volume of a tetrahedron by the smallest; infinite if that is zero, 1 without tetrahedra.
    pub size_ratio: f64,
    /// Faces of one tetrahedron.
    pub boundary_faces: usize,
    /// V - E + F of the boundary faces: 2 for each closed part without handles, 2 less for each handle, 1 less for each
    /// further time that the boundary passes through one point.
    pub boundary_euler: i64,
    /// Parts of the boundary that are joined by common points; a cavity adds one.
    pub boundary_components: usize,
    /// Parts of the mesh that are joined by common points.
    pub components: usize,
    /// Faces of more than two tetrahedra.
    pub non_conforming_faces: usize,
    /// Different regions; 0 if the mesh has none.
    pub regions: usize,
    /// Lower and upper corner of all points; `None` without points.
    pub bounds: Option<(DVec3, DVec3)>,
}

impl TetReport {
    /// Looks at everything, in time that grows with the sorting of all faces.
    pub fn of(mesh: &TetMesh) -> Self {
        let sign = |t: &[u32; 4]| {
            let [a, b, c, d] = TetMesh::corners(*t, &mesh.points);
            side([a, b, c], d)
        };
        let (inverted, degenerate) = (mesh.tets.par_iter())
            .map(sign)
            .map(|s| (usize::from(s < 0.0), usize::from(s == 0.0)))
            .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        let volumes = || mesh.tets.iter().map(|t| signed_volume(TetMesh::corners(*t, &mesh.points)));
        let (least, most) = volumes().fold((f64::INFINITY, 0.0f64), |(l, m), v| (l.min(v.abs()), m.max(v.abs())));

        let faces = Faces::of(&mesh.tets);
        let used = Parts::of(mesh.points.len(), mesh.tets.iter().map(|t| t.as_slice()));
        let boundary = Parts::of(mesh.points.len(), faces.boundary.iter().map(|f| f.as_slice()));
        let edges = distinct(faces.boundary.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [a, c]]).collect());
        Self {
            nodes: mesh.points.len(),
            tets: mesh.tets.len(),
            unused_points: mesh.points.len() - used.points,
            inverted,
            degenerate,
            volume: volumes().map(f64::abs).sum(),
            signed_volume: volumes().sum(),
            size_ratio: match (mesh.tets.is_empty(), least) {
                (true, _) => 1.0,
                (false, 0.0) => f64::INFINITY,
                (false, _) => most / least,
            },
            boundary_faces: faces.boundary.len(),
            boundary_euler: boundary.points as i64 - edges as i64 + faces.boundary.len() as i64,
            boundary_components: boundary.parts,
            components: used.parts,
            non_conforming_faces: faces.crowded,
            regions: distinct(mesh.regions.clone()),
            bounds: mesh.bounds(),
        }
    }
}

struct Faces {
    /// Those of one tetrahedron, their points ascending.
    boundary: Vec<[u32; 3]>,
    /// Number of those of more than two.
    crowded: usize,
}

impl Faces {
    fn of(tets: &[[u32; 4]]) -> Self {
        let face = |t: &[u32; 4], f: [usize; 3]| {
            let mut face = f.map(|c| t[c]);
            face.sort_unstable();
            face
        };
        let mut all: Vec<[u32; 3]> = tets.iter().flat_map(|t| FACES.map(|f| face(t, f))).collect();
        all.par_sort_unstable();
        let mut out = Self { boundary: Vec::new(), crowded: 0 };
        for same in all.chunk_by(|a, b| a == b) {
            match same.len() {
                1 => out.boundary.push(same[0]),
                2 => {}
                _ => out.crowded += 1,
            }
        }
        out
    }
}

/// Points that cells use, and how many parts they form.
struct Parts {
    points: usize,
    parts: usize,
}

impl Parts {
    fn of<'a>(points: usize, cells: impl Iterator<Item = &'a [u32]>) -> Self {
        let mut sets = DisjointSets::new(points);
        let mut used = vec![false; points];
        for cell in cells {
            for &v in cell {
                used[v as usize] = true;
                sets.join(cell[0], v);
            }
        }
        let numbers = (0..points as u32).filter(|&v| used[v as usize]);
        let parts = numbers.clone().filter(|&v| sets.root(v) == v).count();
        Self { points: numbers.count(), parts }
    }
}

fn distinct<T: Ord + Send>(mut values: Vec<T>) -> usize {
    values.par_sort_unstable();
    values.dedup();
    values.len()
}

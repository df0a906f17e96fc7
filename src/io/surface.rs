//! Surface meshes by file extension, and what their readers share.

use std::path::Path;

use glam::{DVec2, DVec3, Vec3};

use super::tets::extension;
use super::{IoError, glb, obj, ply, stl, vtk};
use crate::mesh::TriMesh;

/// Larger coordinates could overflow in products of three.
pub(super) const LARGEST: f64 = 1e90;
/// Ear clipping takes quadratic time; nobody models a concave face of more corners.
const MOST_CONCAVE_CORNERS: usize = 4096;

/// Whether the name ends in a surface format that is read and written here: `obj`, `stl` or `ply` in any case. A `.vtk` file
/// may be read as a surface, too (see [`super::kind_of`]).
pub fn is_surface_path(path: &Path) -> bool {
    extension(path).is_some_and(|e| matches!(e.as_str(), "obj" | "stl" | "ply"))
}

/// Reads a surface. Polygons become triangles. STL has no indices, so exact copies of a position become one vertex there;
/// OBJ, PLY and VTK keep their vertices as they are (see [`TriMesh::welded`]).
///
/// # Errors
/// If the file cannot be read, is not what its extension says, breaks off, names vertices that it does not have, has
/// coordinates that are not finite, or has no face.
pub fn read_surface(path: &Path) -> Result<TriMesh, IoError> {
    let mesh = read_surface_as_stored(path)?;
    Ok(if extension(path).as_deref() == Some("stl") { mesh.welded() } else { mesh })
}

/// Like [`read_surface`], but with the vertices as they are stored: three for each triangle of an STL file.
///
/// # Errors
/// As [`read_surface`].
pub fn read_surface_as_stored(path: &Path) -> Result<TriMesh, IoError> {
    let parse = match extension(path).as_deref() {
        Some("obj") => obj::parse,
        Some("stl") => stl::parse,
        Some("ply") => ply::parse,
        Some("vtk") => vtk::parse_surface,
        _ => return Err(unknown(path)),
    };
    let bytes = std::fs::read(path).map_err(|e| IoError::system(path, "read", e))?;
    if bytes.is_empty() {
        return Err(IoError::malformed(path, "the file is empty; a surface needs vertices and faces"));
    }
    parse(path, &bytes)
}

/// Whether the name ends in a surface format that is written here: those of [`is_surface_path`], and `glb`.
pub fn is_surface_output(path: &Path) -> bool {
    is_surface_path(path) || extension(path).as_deref() == Some("glb")
}

/// Writes a surface: OBJ and PLY keep positions to the last bit, binary STL and GLB round them to 32 bits.
///
/// # Errors
/// If the extension is none of `obj`, `stl`, `ply`, `glb`, a position cannot be stored, or the file cannot be written.
pub fn write_surface(path: &Path, mesh: &TriMesh) -> Result<(), IoError> {
    write_surface_with_normals(path, mesh, &[])
}

/// The same with a unit normal for each vertex, which STL leaves out.
///
/// # Errors
/// As [`write_surface`].
pub fn write_surface_with_normals(path: &Path, mesh: &TriMesh, normals: &[Vec3]) -> Result<(), IoError> {
    let write = match extension(path).as_deref() {
        Some("obj") => obj::write,
        Some("stl") => |path: &Path, mesh: &TriMesh, _: &[Vec3]| stl::write(path, mesh),
        Some("ply") => ply::write,
        Some("glb") => glb::write,
        _ => {
            let what = "the name does not end in a surface format; use .obj, .stl, .ply or .glb";
            return Err(IoError::unsupported(path, what));
        }
    };
    if let Some(v) = mesh.positions.iter().position(|p| !p.is_finite()) {
        return Err(IoError::unsupported(path, format!("vertex {} is not finite, so it cannot be written", v + 1)));
    }
    write(path, mesh, normals)
}

fn unknown(path: &Path) -> IoError {
    IoError::unsupported(path, "the name does not end in a surface format; use .obj, .stl or .ply")
}

/// Vertices and polygons as they come out of a file, before anything is known to be sound.
#[derive(Default)]
pub(super) struct Polygons {
    pub positions: Vec<DVec3>,
    corners: Vec<u32>,
    /// Where each face ends in `corners`.
    ends: Vec<usize>,
}

impl Polygons {
    pub fn with_capacity(vertices: usize, faces: usize) -> Self {
        Self {
            positions: Vec::with_capacity(vertices),
            corners: Vec::with_capacity(3 * faces),
            ends: Vec::with_capacity(faces),
        }
    }

    pub fn corner(&mut self, vertex: u32) {
        self.corners.push(vertex);
    }

    /// Ends the face made of the corners since the last call; the error says what is wrong with it.
    pub fn end_face(&mut self) -> Result<(), String> {
        let corners = self.corners.len() - self.ends.last().unwrap_or(&0);
        self.ends.push(self.corners.len());
        if corners < 3 {
            let s = if corners == 1 { "" } else { "s" };
            return Err(format!("face {} has {corners} corner{s}; a face needs at least 3", self.ends.len()));
        }
        Ok(())
    }

    /// Checks everything and cuts polygons into triangles: convex ones in a fan, others by ear clipping.
    pub fn finish(self, path: &Path) -> Result<TriMesh, IoError> {
        let Self { positions, corners, ends } = self;
        let fail = |what: String| Err(IoError::malformed(path, what));
        if positions.is_empty() {
            return fail("there is no vertex in it; a surface needs vertices and faces".to_owned());
        }
        if ends.is_empty() {
            let n = positions.len();
            return fail(format!("there are {n} vertices but no face in it; a surface needs faces"));
        }
        if positions.len() >= u32::MAX as usize || corners.len() >= u32::MAX as usize {
            return Err(IoError::unsupported(
                path,
                "it has more than 4 billion vertices or corners, too many to index",
            ));
        }
        if let Some(v) = positions.iter().position(|p| !(p.abs().max_element() <= LARGEST && p.is_finite())) {
            let p = positions[v];
            return fail(format!(
                "vertex {} lies at ({}, {}, {}); coordinates must be finite and below {LARGEST:e}",
                v + 1,
                p.x,
                p.y,
                p.z
            ));
        }
        let mut triangles = Vec::with_capacity(corners.len() - 2 * ends.len());
        let mut start = 0;
        for (f, &end) in ends.iter().enumerate() {
            let face = &corners[start..end];
            start = end;
            if let Some(v) = face.iter().find(|&&v| v as usize >= positions.len()) {
                let n = positions.len();
                return fail(format!("face {} names vertex {} of only {n}", f + 1, u64::from(*v) + 1));
            }
            if !triangulate(face, &positions, &mut triangles) {
                return Err(IoError::unsupported(
                    path,
                    format!(
                        "face {} is concave with {} corners; at most {MOST_CONCAVE_CORNERS} are cut into triangles",
                        f + 1,
                        face.len()
                    ),
                ));
            }
        }
        Ok(TriMesh { positions, triangles })
    }
}

/// Cuts a polygon into `n - 2` triangles; `false` if it is concave and has too many corners.
fn triangulate(face: &[u32], positions: &[DVec3], out: &mut Vec<[u32; 3]>) -> bool {
    if let &[a, b, c] = face {
        out.push([a, b, c]);
        return true;
    }
    let p = |i: usize| positions[face[i] as usize];
    let n = face.len();
    // Newell's normal: right also for concave and slightly bent polygons
    let normal: DVec3 = (0..n).map(|i| (p(i) - p(0)).cross(p((i + 1) % n) - p(0))).sum();
    let (x, y) = normal.try_normalize().unwrap_or(DVec3::Z).any_orthonormal_pair();
    let flat: Vec<DVec2> = (0..n).map(|i| DVec2::new(x.dot(p(i) - p(0)), y.dot(p(i) - p(0)))).collect();
    let area = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp_dot(flat[c] - flat[a]);
    // a polygon without extent has no ears to find; a fan keeps its connectivity
    let fan_works =
        (1..n - 1).all(|i| area(0, i, i + 1) >= 0.0) && (0..n).all(|i| area(i, (i + 1) % n, (i + 2) % n) >= 0.0);
    if fan_works || normal == DVec3::ZERO {
        out.extend((1..n - 1).map(|i| [face[0], face[i], face[i + 1]]));
        return true;
    }
    if n > MOST_CONCAVE_CORNERS {
        return false;
    }
    let mut left: Vec<usize> = (0..n).collect();
    let mut at = 0;
    let mut tried = 0;
    while left.len() > 3 {
        let m = left.len();
        let (a, b, c) = (left[(at + m - 1) % m], left[at % m], left[(at + 1) % m]);
        let inside = |q: DVec2| {
            let side = |s: usize, t: usize| (flat[t] - flat[s]).perp_dot(q - flat[s]);
            side(a, b) >= 0.0 && side(b, c) >= 0.0 && side(c, a) >= 0.0
        };
        let ear = area(a, b, c) > 0.0
            && left.iter().all(|&i| {
                let corner = [a, b, c].iter().any(|&k| face[k] == face[i] || flat[k] == flat[i]);
                corner || !inside(flat[i])
            });
        // where a bad polygon has no ear left, any corner will do
        if ear || tried >= m {
            out.push([face[a], face[b], face[c]]);
            left.remove(at % m);
            tried = 0;
            at = (at + m - 1) % m % left.len();
        } else {
            at = (at + 1) % m;
            tried += 1;
        }
    }
    out.push([face[left[0]], face[left[1]], face[left[2]]]);
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(p: &[DVec3], t: &[[u32; 3]]) -> f64 {
        TriMesh { positions: p.to_vec(), triangles: t.to_vec() }.area()
    }

    fn cut(points: &[[f64; 2]]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        // bent out of the axes so that no projection is favoured
        let p: Vec<DVec3> = points.iter().map(|q| DVec3::new(q[0] * 0.6 + 3.0, q[0] * 0.8, q[1])).collect();
        let mut t = Vec::new();
        assert!(triangulate(&(0..p.len() as u32).collect::<Vec<_>>(), &p, &mut t));
        assert_eq!(t.len(), p.len() - 2);
        (p, t)
    }

    #[test]
    fn concave_faces_keep_their_area() {
        for (shape, expected) in [
            (vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]], 4.0),
            // an arrow head whose fan from the first corner would leave it, both ways round
            (vec![[1.0, 1.0], [0.0, 4.0], [-3.0, -3.0], [4.0, 0.0]], 16.0),
            (vec![[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [3.0, 3.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]], 8.0),
        ] {
            let shoelace: f64 = (0..shape.len())
                .map(|i| (shape[i], shape[(i + 1) % shape.len()]))
                .map(|(a, b)| a[0] * b[1] - a[1] * b[0])
                .sum::<f64>()
                .abs()
                / 2.0;
            assert!((shoelace - expected).abs() < 1e-12);
            for turn in 0..shape.len() {
                for flip in [false, true] {
                    let mut s = shape.clone();
                    s.rotate_left(turn);
                    if flip {
                        s.reverse();
                    }
                    let (p, t) = cut(&s);
                    assert!((area(&p, &t) - shoelace).abs() < 1e-12, "{s:?}");
                    // no triangle is turned over: the vector areas add up to the same
                    let sum: DVec3 =
                        t.iter().map(|t| t.map(|v| p[v as usize])).map(|[a, b, c]| (b - a).cross(c - a)).sum();
                    assert!((sum.length() / 2.0 - shoelace).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn a_comb_of_a_hundred_teeth_and_faces_without_extent_are_cut() {
        let mut comb = vec![[0.0, -1.0], [200.0, -1.0]];
        comb.extend((0..=200).rev().map(|i| [f64::from(i), f64::from(i % 2) * 5.0]));
        let (p, t) = cut(&comb);
        assert!((area(&p, &t) - (200.0 + 100.0 * 5.0)).abs() < 1e-9);
        cut(&[[1.0, 1.0]; 6]);
        cut(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [1.5, 0.0]]);
        cut(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
    }
}

//! STL, ascii and binary. It stores triangles without indices: [`parse`] returns three vertices for each, and
//! [`super::read_surface`] makes exact copies of a position one vertex.
//!
//! The crate `stl_io` is not used: it takes every file that begins with "solid" for ascii, which many binary ones do, and
//! welds by itself, with an error that does not say where a file is wrong.

use std::io::Write;
use std::path::Path;

use glam::DVec3;

use super::surface::Polygons;
use super::words::{Words, show};
use super::{IoError, write_atomic};
use crate::mesh::TriMesh;

const HEADER: usize = 80;
const RECORD: usize = 50;

/// Reads an STL file; `path` is for messages only. A file whose size fits its count of triangles is binary, whatever it
/// begins with. Stored normals are passed over: the order of the corners says which side is out.
///
/// # Errors
/// As [`super::read_surface`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<TriMesh, IoError> {
    let count = bytes.get(HEADER..HEADER + 4).map(|b| u64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])));
    let expected = count.map(|n| (HEADER + 4) as u64 + n * RECORD as u64);
    if expected == Some(bytes.len() as u64) {
        return parse_binary(path, &bytes[HEADER + 4..]);
    }
    if looks_like_text(bytes) {
        return parse_ascii(path, bytes);
    }
    Err(match (count, expected) {
        (Some(n), Some(e)) => {
            let size = bytes.len();
            let what = format!("the header says {n} triangles, which take {e} bytes, but the file has {size}");
            IoError::malformed(path, what)
        }
        _ => IoError::malformed(path, "it is neither binary STL (too short for a header) nor ascii STL (no 'solid')"),
    })
}

fn looks_like_text(bytes: &[u8]) -> bool {
    let start = bytes.trim_ascii_start();
    let head = &start[..start.len().min(1024)];
    head.get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid")) && !head.contains(&0)
}

fn parse_binary(path: &Path, records: &[u8]) -> Result<TriMesh, IoError> {
    let n = records.len() / RECORD;
    let mut polygons = Polygons::with_capacity(3 * n, n);
    for record in records.chunks_exact(RECORD) {
        for corner in record[12..48].chunks_exact(12) {
            let x = |i: usize| f64::from(f32::from_le_bytes([corner[i], corner[i + 1], corner[i + 2], corner[i + 3]]));
            polygons.corner(polygons.positions.len() as u32);
            polygons.positions.push(DVec3::new(x(0), x(4), x(8)));
        }
        polygons.end_face().map_err(|what| IoError::malformed(path, what))?;
    }
    polygons.finish(path)
}

fn parse_ascii(path: &Path, bytes: &[u8]) -> Result<TriMesh, IoError> {
    let fail = |what: String| IoError::malformed(path, what);
    let mut words = Words::new(bytes, 1);
    let mut polygons = Polygons::default();
    let mut open_facet = None;
    while let Some(word) = words.next_word() {
        match word.to_ascii_lowercase().as_slice() {
            b"solid" | b"endsolid" => words.skip_line(),
            b"facet" => {
                if let Some(line) = open_facet.replace(words.line) {
                    return Err(fail(format!("the facet at line {line} has no 'endfacet'")));
                }
                words.skip_line();
            }
            b"vertex" => {
                let mut p = [0.0; 3];
                for x in &mut p {
                    *x = words.number().map_err(fail)?;
                }
                polygons.corner(polygons.positions.len() as u32);
                polygons.positions.push(DVec3::from_array(p));
            }
            b"endfacet" => {
                if open_facet.take().is_none() {
                    return Err(fail(format!("line {} ends a facet that was not begun", words.line)));
                }
                polygons.end_face().map_err(fail)?;
            }
            b"outer" | b"loop" | b"endloop" => {}
            _ => {
                let what = format!("line {} has '{}', which is no word of ascii STL", words.line, show(word));
                return Err(fail(what));
            }
        }
    }
    if let Some(line) = open_facet {
        return Err(fail(format!("the file breaks off in the facet at line {line}")));
    }
    polygons.finish(path)
}

/// Writes binary STL with positions rounded to 32 bits.
///
/// # Errors
/// If a position does not fit 32 bits, or the file cannot be written.
pub fn write(path: &Path, mesh: &TriMesh) -> Result<(), IoError> {
    let count = u32::try_from(mesh.triangles.len())
        .map_err(|_| IoError::unsupported(path, "STL holds at most 4294967295 triangles; write .ply"))?;
    if let Some(v) = mesh.positions.iter().position(|p| !p.as_vec3().is_finite()) {
        let what = format!("vertex {} is too large for the 32-bit numbers of STL; write .ply or .obj", v + 1);
        return Err(IoError::unsupported(path, what));
    }
    write_atomic(path, |w| {
        // must not begin with "solid", or careless readers take it for ascii
        let mut header = [b' '; HEADER];
        header[..19].copy_from_slice(b"binary STL, Voxclay");
        w.write_all(&header)?;
        w.write_all(&count.to_le_bytes())?;
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            for x in [normal, a, b, c].iter().flat_map(|p| p.as_vec3().to_array()) {
                w.write_all(&x.to_le_bytes())?;
            }
            w.write_all(&[0, 0])?;
        }
        Ok(())
    })
}

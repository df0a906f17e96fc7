//! Wavefront OBJ: `v` and `f` statements; texture coordinates, normals, groups and materials are passed over.
//!
//! The crate `tobj` is not used: it renumbers vertices object by object and drops unused ones, so that a file would not
//! come back as it was, and it does not say where a file is wrong.

use std::io::Write;
use std::path::Path;

use glam::{DVec3, Vec3};

use super::surface::Polygons;
use super::words::{number, show};
use super::{IoError, write_atomic};
use crate::mesh::TriMesh;

/// Reads the text of an OBJ file; `path` is for messages only. All objects of the file become one mesh.
///
/// # Errors
/// As [`super::read_surface`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<TriMesh, IoError> {
    let mut polygons = Polygons::default();
    // a backslash at its end continues a line
    let mut joined = Vec::new();
    for (i, line) in bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).split(|&b| b == b'\n').enumerate() {
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        if let Some(part) = line.strip_suffix(b"\\") {
            joined.extend_from_slice(part);
            joined.push(b' ');
            continue;
        }
        let whole;
        let statement = if joined.is_empty() {
            line
        } else {
            joined.extend_from_slice(line);
            whole = std::mem::take(&mut joined);
            &whole
        };
        let fail = |what: String| IoError::malformed(path, format!("line {}: {what}", i + 1));
        add_statement(&mut polygons, statement).map_err(fail)?;
    }
    polygons.finish(path)
}

fn add_statement(polygons: &mut Polygons, line: &[u8]) -> Result<(), String> {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
    match words.next() {
        Some(b"v") => {
            let mut p = [0.0; 3];
            for x in &mut p {
                let word = words.next().ok_or("a vertex needs three coordinates")?;
                *x = number(word).ok_or_else(|| format!("'{}' is not a coordinate", show(word)))?;
            }
            polygons.positions.push(DVec3::from_array(p));
        }
        Some(b"f") => {
            for word in words.take_while(|w| w[0] != b'#') {
                let index = word.split(|&b| b == b'/').next().unwrap_or(word);
                let bad =
                    || format!("'{}' names no vertex; a corner is an index from 1, or from -1 backwards", show(word));
                let index: i64 = std::str::from_utf8(index).ok().and_then(|w| w.parse().ok()).ok_or_else(bad)?;
                let vertex = if index > 0 { index - 1 } else { polygons.positions.len() as i64 + index };
                if index == 0 || vertex < 0 {
                    return Err(bad());
                }
                // what is too large for an index is too large for the list of vertices as well
                polygons.corner(u32::try_from(vertex).unwrap_or(u32::MAX));
            }
            polygons.end_face()?;
        }
        _ => {}
    }
    Ok(())
}

/// Writes positions with as many digits as bring every bit back, and normals if there is one for each.
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, mesh: &TriMesh, normals: &[Vec3]) -> Result<(), IoError> {
    write_atomic(path, |w| {
        for p in &mesh.positions {
            writeln!(w, "v {:?} {:?} {:?}", p.x, p.y, p.z)?;
        }
        let normals = if normals.len() == mesh.positions.len() { normals } else { &[] };
        for n in normals {
            writeln!(w, "vn {:?} {:?} {:?}", n.x, n.y, n.z)?;
        }
        for [a, b, c] in mesh.triangles.iter().map(|t| t.map(|v| u64::from(v) + 1)) {
            if normals.is_empty() {
                writeln!(w, "f {a} {b} {c}")?;
            } else {
                writeln!(w, "f {a}//{a} {b}//{b} {c}//{c}")?;
            }
        }
        Ok(())
    })
}

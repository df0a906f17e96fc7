//! TetGen's pair of text files: `NAME.node` with the points and `NAME.ele` with the tetrahedra. Either may be named.
//!
//! Points are numbered one by one from 0 or 1, whatever the first is. `#` begins a comment. The last attribute of a
//! tetrahedron is its region (TetGen's `-A`), if it is a whole number in all of them; attributes and boundary markers of
//! points are passed over. Tetrahedra of 10 nodes are taken by their corners.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::store::write_pair;
use super::tets::{Solids, TetWriteOptions, read_whole};
use super::words::{Words, show, without_comments};
use super::{IoError, tets};
use crate::mesh::cells::{CellKind, CellMesh};
use crate::mesh::tets::TetMesh;

/// `.node` and `.ele` of either; the second takes over the first's way of capitals.
fn pair(path: &Path) -> (PathBuf, PathBuf) {
    let capitals = path.extension().is_some_and(|e| e.to_string_lossy().chars().all(char::is_uppercase));
    let other = |e: &str| path.with_extension(if capitals { e.to_uppercase() } else { e.to_owned() });
    if tets::extension(path).as_deref() == Some("node") {
        (path.to_owned(), other("ele"))
    } else {
        (other("node"), path.to_owned())
    }
}

/// Reads both files; either may be named.
///
/// # Errors
/// As [`super::read_tets`], or if one of the two is missing.
pub fn read(path: &Path) -> Result<CellMesh, IoError> {
    let (node, ele) = pair(path);
    for p in [&node, &ele] {
        if p != path && !p.exists() && path.exists() {
            let name = super::store::file_name(p);
            return Err(IoError::malformed(
                path,
                format!("has no {name} beside it; TetGen keeps a mesh in both files"),
            ));
        }
    }
    parse([&node, &ele], &read_whole(&node)?, &read_whole(&ele)?)
}

/// Reads the text of a `.node` and an `.ele` file; their paths are for messages only.
///
/// # Errors
/// As [`super::read_tets`].
pub fn parse([node_path, ele_path]: [&Path; 2], node: &[u8], ele: &[u8]) -> Result<CellMesh, IoError> {
    let mut solids = Solids::default();
    nodes(&without_comments(node), &mut solids).map_err(|what| IoError::malformed(node_path, what))?;
    elements(&without_comments(ele), &mut solids).map_err(|what| IoError::malformed(ele_path, what))?;
    solids.finish(ele_path)
}

fn ended(words: &mut Words, things: &str) -> Result<(), String> {
    // a last number without a line end may have been cut
    if words.left() == 0 {
        return Err("ends in the middle of a line; the file is cut off".to_owned());
    }
    match words.next_word() {
        None => Ok(()),
        Some(word) => Err(format!(
            "line {} has '{}' behind the last of its {things}; the file should end there",
            words.line,
            show(word)
        )),
    }
}

fn nodes(text: &[u8], solids: &mut Solids) -> Result<(), String> {
    let mut words = Words::new(text, 1);
    let (count, dimension): (u64, u64) = (words.whole()?, words.whole()?);
    let (attributes, markers): (u64, u64) = (words.whole()?, words.whole()?);
    if dimension != 3 {
        return Err(format!("has points of {dimension} dimensions; a mesh of tetrahedra needs 3"));
    }
    if markers > 1 {
        return Err(format!("says that each point has {markers} boundary markers; it must be 0 or 1"));
    }
    let more = attributes.saturating_add(markers);
    let count = words.room(count, more.saturating_add(4).saturating_mul(2), "points")?;
    solids.points.reserve(count);
    for i in 0..count as u64 {
        let id: u64 = words.whole()?;
        if i == 0 {
            solids.first = id;
        }
        if !(id == solids.first + i && solids.first <= 1) {
            let right = if i == 0 { "0 or 1".to_owned() } else { (solids.first + i).to_string() };
            return Err(format!("line {} has the number {id} for a point where it must be {right}", words.line));
        }
        solids.points.push(DVec3::new(words.number()?, words.number()?, words.number()?));
        for _ in 0..more {
            words.number()?;
        }
    }
    ended(&mut words, "points")
}

fn elements(text: &[u8], solids: &mut Solids) -> Result<(), String> {
    let mut words = Words::new(text, 1);
    let (count, points, attributes): (u64, u64, u64) = (words.whole()?, words.whole()?, words.whole()?);
    if points != 4 && points != 10 {
        return Err(format!("has elements of {points} points; tetrahedra have 4 or 10"));
    }
    let each = attributes.saturating_add(1 + points).saturating_mul(2);
    let count = words.room(count, each, "tetrahedra")?;
    let mut regions: Option<Vec<i32>> = (attributes > 0).then(|| Vec::with_capacity(count));
    let mut tet = Vec::new();
    for _ in 0..count {
        words.whole::<u64>()?;
        tet.clear();
        for _ in 0..points {
            tet.push(words.whole()?);
        }
        solids.cell(CellKind::Tet, &tet);
        let mut last = 0.0;
        for _ in 0..attributes {
            last = words.number()?;
        }
        match &mut regions {
            Some(list) if last == f64::from(last as i32) => list.push(last as i32),
            _ => regions = None,
        }
    }
    solids.regions = regions.unwrap_or_default();
    ended(&mut words, "tetrahedra")
}

/// Writes both files, counting from 0, with as many digits as bring every bit back. The one that is named appears last.
///
/// # Errors
/// As [`super::write_tets`].
pub fn write(path: &Path, mesh: &TetMesh, _: &TetWriteOptions) -> Result<(), IoError> {
    let (node, ele) = pair(path);
    let (named, other) =
        if node == path { (node_text as Text, ele_text as Text) } else { (ele_text as Text, node_text as Text) };
    let mut text = Vec::new();
    named(&mut text, mesh).map_err(|e| IoError::system(path, "write", e))?;
    write_pair(path, &text, if node == path { &ele } else { &node }, |w| other(w, mesh))
}

type Text = fn(&mut dyn Write, &TetMesh) -> io::Result<()>;

fn node_text(w: &mut dyn Write, mesh: &TetMesh) -> io::Result<()> {
    writeln!(w, "{} 3 0 0", mesh.points.len())?;
    mesh.points.iter().enumerate().try_for_each(|(i, p)| writeln!(w, "{i} {:?} {:?} {:?}", p.x, p.y, p.z))
}

fn ele_text(w: &mut dyn Write, mesh: &TetMesh) -> io::Result<()> {
    writeln!(w, "{} 4 {}", mesh.tets.len(), u8::from(!mesh.regions.is_empty()))?;
    for (i, [a, b, c, d]) in mesh.tets.iter().enumerate() {
        write!(w, "{i} {a} {b} {c} {d}")?;
        match mesh.regions.get(i) {
            Some(region) => writeln!(w, " {region}")?,
            None => writeln!(w)?,
        }
    }
    Ok(())
}

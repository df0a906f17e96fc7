//! Medit's `.mesh` (text) and `.meshb` (binary, versions 1 to 4, both byte orders).
//!
//! After the description of libMeshb, version 7. Read: `Vertices`, `Tetrahedra`, `TetrahedraP2`, `Pyramids`, `Prisms` (or
//! `Pentahedra`) and `Hexahedra` with their references, which are the regions; other keywords are passed over with their
//! numbers. `#` begins a comment. The reference 0 stands for none: where all are 0, the mesh has no regions.

use std::io::Write;
use std::path::Path;

use glam::DVec3;

use super::bytes::ByteOrder;
use super::tets::{Solids, TetWriteOptions};
use super::words::{Words, number, show, without_comments};
use super::{IoError, write_atomic};
use crate::mesh::cells::{CellKind, CellMesh};
use crate::mesh::tets::TetMesh;

/// Keyword, its number in binary files, points of the cell, and what it is.
const CELLS: [(&[u8], i64, usize, CellKind); 6] = [
    (b"tetrahedra", 8, 4, CellKind::Tet),
    (b"tetrahedrap2", 30, 10, CellKind::Tet),
    (b"pyramids", 49, 5, CellKind::Pyramid),
    (b"prisms", 9, 6, CellKind::Wedge),
    (b"pentahedra", 9, 6, CellKind::Wedge),
    (b"hexahedra", 10, 8, CellKind::Hexahedron),
];

/// Reads a `.mesh` or `.meshb` file; which of both is told from the content, and `path` is for messages only.
///
/// # Errors
/// As [`super::read_tets`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<CellMesh, IoError> {
    let mut solids = Solids::counted_from(1);
    let mut references = Vec::new();
    let read = match bytes.first_chunk::<4>() {
        Some([1, 0, 0, 0]) => Binary::open(bytes, ByteOrder::Little).read(&mut solids, &mut references),
        Some([0, 0, 0, 1]) => Binary::open(bytes, ByteOrder::Big).read(&mut solids, &mut references),
        _ => read_text(bytes, &mut solids, &mut references),
    };
    read.map_err(|what| IoError::malformed(path, what))?;
    if references.iter().any(|r| *r != 0) {
        solids.regions = references;
    }
    solids.finish(path)
}

fn reference(value: i64) -> Result<i32, String> {
    i32::try_from(value).map_err(|_| format!("there is the reference {value}, which does not fit 32 bits"))
}

fn point_number(value: i64) -> Result<u64, String> {
    u64::try_from(value).map_err(|_| format!("a cell names point {value}; points count from 1"))
}

fn three_dimensions(dimension: i64) -> Result<(), String> {
    if dimension == 3 { Ok(()) } else { Err(format!("has {dimension} dimensions; a mesh of solid cells needs 3")) }
}

fn read_text(bytes: &[u8], solids: &mut Solids, references: &mut Vec<i32>) -> Result<(), String> {
    let text = without_comments(bytes);
    let mut words = Words::new(&text, 1);
    let first = words.next_word().unwrap_or_default();
    if !first.eq_ignore_ascii_case(b"MeshVersionFormatted") {
        return Err("does not begin with MeshVersionFormatted, as files of Medit do".to_owned());
    }
    words.whole::<u32>()?;
    let mut nodes = Vec::new();
    let mut ended = false;
    while let Some(word) = words.next_word() {
        let keyword = word.to_ascii_lowercase();
        let at = |what: String| format!("{what}, in {}", show(word));
        if keyword == b"end" {
            ended = true;
            break;
        } else if keyword == b"dimension" {
            three_dimensions(words.whole().map_err(at)?)?;
        } else if keyword == b"vertices" {
            let count = words.whole::<u64>().map_err(at)?;
            let count = words.room(count, 8, "vertices")?;
            solids.points.reserve(count);
            for _ in 0..count {
                let mut p = [0.0; 3];
                for x in &mut p {
                    *x = words.number().map_err(at)?;
                }
                words.number().map_err(at)?;
                solids.points.push(DVec3::from_array(p));
            }
        } else if let Some((_, _, points, kind)) = CELLS.iter().find(|c| c.0 == keyword) {
            let count = words.whole::<u64>().map_err(at)?;
            for _ in 0..words.room(count, 2 * (1 + *points as u64), "cells")? {
                nodes.clear();
                for _ in 0..*points {
                    nodes.push(point_number(words.whole().map_err(at)?)?);
                }
                solids.cell(*kind, &nodes);
                references.push(reference(words.whole().map_err(at)?)?);
            }
        } else if word[0].is_ascii_alphabetic() {
            // a keyword that says nothing about solid cells: its numbers end at the next one
            while words.peek().is_some_and(|w| number(w).is_some()) {
                words.next_word();
            }
        } else {
            let what =
                format!("line {} has '{}' where a keyword such as Vertices should stand", words.line, show(word));
            return Err(what);
        }
    }
    // some programs leave End out, but then a last number may have been cut
    if ended || bytes.ends_with(b"\n") {
        Ok(())
    } else {
        Err("ends in the middle of a line; the file is cut off".to_owned())
    }
}

/// A binary file.
struct Binary<'a> {
    bytes: &'a [u8],
    at: usize,
    order: ByteOrder,
    version: i64,
}

impl<'a> Binary<'a> {
    fn open(bytes: &'a [u8], order: ByteOrder) -> Self {
        Self { bytes, at: 4, order, version: 1 }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let found = self.bytes.get(self.at..).and_then(|b| b.first_chunk::<N>());
        let mut taken = *found.ok_or("the file breaks off in its data")?;
        self.at += N;
        if self.order == ByteOrder::Big {
            taken.reverse();
        }
        Ok(taken)
    }

    fn int(&mut self, wide: bool) -> Result<i64, String> {
        if wide { self.take().map(i64::from_le_bytes) } else { self.take().map(i32::from_le_bytes).map(i64::from) }
    }

    fn real(&mut self) -> Result<f64, String> {
        if self.version == 1 {
            self.take().map(f32::from_le_bytes).map(f64::from)
        } else {
            self.take().map(f64::from_le_bytes)
        }
    }

    fn room(&self, count: i64, each: usize, things: &str) -> Result<usize, String> {
        let left = self.bytes.len() - self.at;
        let fits = usize::try_from(count).ok().filter(|n| n.saturating_mul(each) <= left);
        fits.ok_or_else(|| format!("it says that it has {count} {things}, but only {left} bytes follow"))
    }

    fn read(mut self, solids: &mut Solids, references: &mut Vec<i32>) -> Result<(), String> {
        self.version = self.int(false)?;
        if !(1..=4).contains(&self.version) {
            return Err(format!("is of version {} of Medit's binary format; it must be 1 to 4", self.version));
        }
        let (wide, wide_place) = (self.version == 4, self.version >= 3);
        let int_bytes = if wide { 8 } else { 4 };
        let mut nodes = Vec::new();
        loop {
            let keyword = self.int(false)?;
            if keyword == 54 {
                return Ok(());
            }
            let next = self.int(wide_place)?;
            if keyword == 3 {
                three_dimensions(self.int(false)?)?;
            } else if keyword == 4 {
                let count = self.int(wide)?;
                let count = self.room(count, if self.version == 1 { 12 } else { 24 } + int_bytes, "vertices")?;
                for _ in 0..count {
                    solids.points.push(DVec3::new(self.real()?, self.real()?, self.real()?));
                    self.int(wide)?;
                }
            } else if let Some((_, _, points, kind)) = CELLS.iter().find(|c| c.1 == keyword) {
                let count = self.int(wide)?;
                for _ in 0..self.room(count, (points + 1) * int_bytes, "cells")? {
                    nodes.clear();
                    for _ in 0..*points {
                        nodes.push(point_number(self.int(wide)?)?);
                    }
                    solids.cell(*kind, &nodes);
                    references.push(reference(self.int(wide)?)?);
                }
            }
            let forward = usize::try_from(next).ok().filter(|n| (self.at..=self.bytes.len()).contains(n));
            self.at = forward.ok_or_else(|| {
                format!("its keyword {keyword} is said to end at byte {next}; that is beyond the file or before its own data")
            })?;
        }
    }
}

/// Writes text with as many digits as bring every bit back.
///
/// # Errors
/// As [`super::write_tets`].
pub fn write(path: &Path, mesh: &TetMesh, _: &TetWriteOptions) -> Result<(), IoError> {
    write_atomic(path, |w| {
        writeln!(w, "MeshVersionFormatted 2\nDimension 3\nVertices\n{}", mesh.points.len())?;
        for p in &mesh.points {
            writeln!(w, "{:?} {:?} {:?} 0", p.x, p.y, p.z)?;
        }
        writeln!(w, "Tetrahedra\n{}", mesh.tets.len())?;
        for (i, [a, b, c, d]) in mesh.tets.iter().map(|t| t.map(|v| v + 1)).enumerate() {
            writeln!(w, "{a} {b} {c} {d} {}", mesh.regions.get(i).copied().unwrap_or(0))?;
        }
        writeln!(w, "End")
    })
}

//! Gmsh's `.msh`, versions 2 (2.0 to 2.2) and 4.1, text and binary of both byte orders.
//!
//! After the reference manual of Gmsh, "MSH file format". Read: `$Nodes` with numbers of any kind, `$Elements`, `$Entities` and
//! `$PartitionedEntities` (for physical groups), and `$NodeData` of three components; all other sections are passed over.
//! The region of a tetrahedron is its first physical group, 0 where it has none; where no tetrahedron has one, it is the
//! entity, if there are several. Points without a value in `$NodeData` get NaN; sections for fewer than one point in 16 are
//! passed over.
//!
//! The crate `mshio` is not used: it reads 4.1 only, and no data at the nodes.

use std::collections::HashMap;
use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;

use super::bytes::ByteOrder;
use super::error::Fault;
use super::tets::{GmshVersion, Numbering, Solids, TetWriteOptions};
use super::volume::Encoding;
use super::words::{Words, show};
use super::{IoError, write_atomic};
use crate::mesh::cells::{CellKind, CellMesh};
use crate::mesh::tets::TetMesh;

/// Reads a `.msh` file; `path` is for messages only.
///
/// # Errors
/// As [`super::read_tets`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<CellMesh, IoError> {
    let fail = |what: String| IoError::malformed(path, what);
    let mut source = Source::open(bytes).map_err(|fault| fault.of(path))?;
    let mut file = File { solids: Solids::counted_from(1), ..File::default() };
    file.read(&mut source).map_err(fail)?;
    file.finish(path)
}

/// Number of nodes of each type of element, by its number from 1; 0 where it is not known.
#[rustfmt::skip]
const NODES: [usize; 137] = [
    2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, 20, 15, 13, 9, 10, 12, 15, 15, 21, 4, 5, 6, 20, 35, 56, 22, 28,
    0, 0, 16, 25, 36, 12, 16, 20, 28, 36, 45, 55, 66, 49, 64, 81, 100, 121, 18, 21, 24, 27, 30, 24, 28, 32, 36, 40,
    7, 8, 9, 10, 11, 0, 0, 0, 0, 84, 120, 165, 220, 286, 0, 0, 0, 34, 40, 46, 52, 58, 1, 1, 1, 0, 0, 0,
    40, 75, 64, 125, 216, 343, 512, 729, 1000, 32, 44, 56, 68, 80, 92, 104, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    30, 55, 91, 140, 204, 285, 385, 21, 29, 37, 45, 53, 61, 69, 0, 0, 0, 0, 0, 16,
];

/// Nodes of a type of element, and the solid cell that its corners make.
fn element(kind: i64) -> Result<(usize, Option<CellKind>), String> {
    let nodes = usize::try_from(kind - 1).ok().and_then(|k| NODES.get(k)).copied().filter(|n| *n > 0);
    let nodes = nodes.ok_or_else(|| format!("there is an element of type {kind}, which Voxclay does not know"))?;
    let solid = match kind {
        4 | 11 | 29..=33 | 71..=75 | 79..=83 | 137 => Some(CellKind::Tet),
        5 | 12 | 17 | 92..=105 => Some(CellKind::Hexahedron),
        6 | 13 | 18 | 90 | 91 => Some(CellKind::Wedge),
        7 | 14 | 19 | 118..=131 => Some(CellKind::Pyramid),
        _ => None,
    };
    Ok((nodes, solid))
}

/// Numbers of a file, be it text or not.
struct Source<'a> {
    words: Words<'a>,
    /// `None` for text.
    binary: Option<ByteOrder>,
    version: GmshVersion,
    /// Bytes of a size in binary files of version 4.1.
    size: usize,
}

impl<'a> Source<'a> {
    /// Reads `$MeshFormat`.
    fn open(bytes: &'a [u8]) -> Result<Self, Fault> {
        let mut words = Words::new(bytes, 1);
        // comments may come before the format
        while words.peek() == Some(b"$Comments") {
            if !words.skip_past(b"$EndComments") {
                return Err("the section $Comments has no $EndComments".into());
            }
        }
        match words.next_word() {
            Some(b"$MeshFormat") => {}
            Some(b"$NOD") => {
                return Err(Fault::Unsupported(
                    "is of version 1 of Gmsh's format; save it as version 2.2 or 4.1".into(),
                ));
            }
            _ => return Err("does not begin with $MeshFormat, as files of Gmsh do".into()),
        }
        let number = words.next_word().unwrap_or_default();
        let version = match number {
            b"2" | b"2.0" | b"2.1" | b"2.2" => GmshVersion::V22,
            b"4.1" => GmshVersion::V41,
            _ => {
                return Err(Fault::Unsupported(format!(
                    "is of version '{}' of Gmsh's format; Voxclay reads 2.2 and 4.1, so save it as one of these",
                    show(number)
                )));
            }
        };
        let kind: i64 = words.whole()?;
        let size: usize = words.whole()?;
        let mut out = Self { words, binary: None, version, size };
        if kind == 1 {
            out.words.rest_of_line();
            out.binary = match out.words.take(4)? {
                [1, 0, 0, 0] => Some(ByteOrder::Little),
                [0, 0, 0, 1] => Some(ByteOrder::Big),
                _ => return Err("its byte order cannot be told: $MeshFormat should hold the number 1".into()),
            };
            if !(size == 8 || size == 4 && version == GmshVersion::V41) {
                return Err(format!("its numbers are said to take {size} bytes; it must be 8").into());
            }
        }
        out.end("MeshFormat")?;
        Ok(out)
    }

    /// Passes the end of a section.
    fn end(&mut self, section: &str) -> Result<(), String> {
        let (line, word) = (self.words.line, self.words.next_word());
        match word {
            Some(word) if word.strip_prefix(b"$End") == Some(section.as_bytes()) => Ok(()),
            Some(word) => {
                Err(format!("line {} has '{}' where $End{section} should stand", self.words.line, show(word)))
            }
            None => Err(format!("the file breaks off at line {line}; $End{section} should follow")),
        }
    }

    /// To the data behind a line of text.
    fn begin_data(&mut self) {
        if self.binary.is_some() {
            self.words.rest_of_line();
        }
    }

    /// An `int`.
    fn int(&mut self) -> Result<i64, String> {
        let Some(order) = self.binary else { return self.words.whole() };
        let b = self.words.take(4)?.try_into().unwrap_or_default();
        Ok(i64::from(if order == ByteOrder::Big { i32::from_be_bytes(b) } else { i32::from_le_bytes(b) }))
    }

    /// Passes over this many.
    fn ints(&mut self, count: u64) -> Result<(), String> {
        (0..count).try_for_each(|_| self.int().map(|_| ()))
    }

    /// A `size_t` of version 4.1.
    fn size(&mut self) -> Result<u64, String> {
        let Some(order) = self.binary else { return self.words.whole() };
        let mut b = [0; 8];
        let big = order == ByteOrder::Big;
        let place = if big { 8 - self.size..8 } else { 0..self.size };
        b[place].copy_from_slice(self.words.take(self.size)?);
        Ok(if big { u64::from_be_bytes(b) } else { u64::from_le_bytes(b) })
    }

    fn real(&mut self) -> Result<f64, String> {
        let Some(order) = self.binary else { return self.words.number() };
        let b = self.words.take(8)?.try_into().unwrap_or_default();
        Ok(if order == ByteOrder::Big { f64::from_be_bytes(b) } else { f64::from_le_bytes(b) })
    }

    fn point(&mut self) -> Result<DVec3, String> {
        Ok(DVec3::new(self.real()?, self.real()?, self.real()?))
    }

    /// A count of things that each take `text` numbers in text or `binary` bytes.
    fn room(&self, count: u64, text: u64, binary: usize, things: &str) -> Result<usize, String> {
        self.words.room(count, if self.binary.is_some() { binary as u64 } else { 2 * text }, things)
    }
}

fn node_number(id: i64) -> Result<u64, String> {
    u64::try_from(id)
        .map_err(|_| format!("there is a node with the number {id}; numbers of nodes must not be negative"))
}

fn agree(said: u64, found: u64, things: &str) -> Result<(), String> {
    let what = || format!("it says that it has {said} {things}, but its blocks hold {found}");
    if said == found { Ok(()) } else { Err(what()) }
}

/// What the sections hold.
#[derive(Default)]
struct File {
    solids: Solids,
    /// First physical group and entity of each solid cell.
    groups: Vec<[i32; 2]>,
    /// First physical group of each volume (4.1).
    volumes: HashMap<i32, i32>,
    /// Name, and the vectors of some nodes.
    data: Vec<(String, Vec<(u64, DVec3)>)>,
}

impl File {
    fn read(&mut self, s: &mut Source) -> Result<(), String> {
        let (mut nodes, mut elements) = (false, false);
        while let Some(word) = s.words.next_word() {
            let at = |what: String| format!("{} in {}", what, show(word));
            match (word, s.version) {
                (b"$Nodes", GmshVersion::V22) => self.nodes_2(s).map_err(at)?,
                (b"$Nodes", GmshVersion::V41) => self.nodes_4(s).map_err(at)?,
                (b"$Elements", GmshVersion::V22) => self.elements_2(s).map_err(at)?,
                (b"$Elements", GmshVersion::V41) => self.elements_4(s).map_err(at)?,
                (b"$Entities", GmshVersion::V41) => self.entities(s, false).map_err(at)?,
                (b"$PartitionedEntities", GmshVersion::V41) => self.entities(s, true).map_err(at)?,
                (b"$NodeData", _) => self.node_data(s).map_err(at)?,
                ([b'$', name @ ..], _) if !name.is_empty() => {
                    if !s.words.skip_past(&[b"$End", name].concat()) {
                        return Err(format!("the section {0} has no $End{1}", show(word), show(name)));
                    }
                    continue;
                }
                _ => {
                    return Err(format!(
                        "line {} has '{}' where a section such as $Nodes should begin",
                        s.words.line,
                        show(word)
                    ));
                }
            }
            nodes |= word == b"$Nodes";
            elements |= word == b"$Elements";
            s.end(&String::from_utf8_lossy(&word[1..]))?;
        }
        let missing = if nodes { "$Elements" } else { "$Nodes" };
        if nodes && elements {
            return Ok(());
        }
        Err(format!("there is no section {missing} in it; the file is cut off or no mesh"))
    }

    fn nodes_2(&mut self, s: &mut Source) -> Result<(), String> {
        let count: u64 = s.words.whole()?;
        s.begin_data();
        let count = s.room(count, 4, 28, "nodes")?;
        self.solids.points.reserve(count);
        self.solids.ids.reserve(count);
        for _ in 0..count {
            self.solids.ids.push(node_number(s.int()?)?);
            self.solids.points.push(s.point()?);
        }
        Ok(())
    }

    fn nodes_4(&mut self, s: &mut Source) -> Result<(), String> {
        s.begin_data();
        let (blocks, all, _, _) = (s.size()?, s.size()?, s.size()?, s.size()?);
        let before = self.solids.points.len();
        for _ in 0..blocks {
            let (dimension, _, parametric) = (s.int()?, s.int()?, s.int()?);
            let count = s.size()?;
            let count = s.room(count, 4, s.size + 24, "nodes")?;
            for _ in 0..count {
                self.solids.ids.push(s.size()?);
            }
            for _ in 0..count {
                self.solids.points.push(s.point()?);
                for _ in 0..if parametric != 0 { dimension } else { 0 } {
                    s.real()?;
                }
            }
        }
        agree(all, (self.solids.points.len() - before) as u64, "nodes")
    }

    fn elements_2(&mut self, s: &mut Source) -> Result<(), String> {
        let count: u64 = s.words.whole()?;
        s.begin_data();
        // in text number, type and tags of each element, in binary files at least number and a node
        let count = s.room(count, 4, 8, "elements")?;
        let mut nodes = Vec::new();
        let mut read = 0;
        while read < count {
            // binary elements come in groups of one type
            let (kind, many, tags) = if s.binary.is_some() {
                (s.int()?, s.int()?, s.int()?)
            } else {
                s.int()?;
                (s.int()?, 1, s.int()?)
            };
            let (number, solid) = element(kind)?;
            let many = usize::try_from(many).ok().filter(|n| (1..=count - read).contains(n));
            let many = many.ok_or_else(|| format!("there are groups of more or fewer elements than {count}"))?;
            for _ in 0..many {
                if s.binary.is_some() {
                    s.int()?;
                }
                let mut group = [0; 2];
                for tag in 0..tags {
                    let value = s.int()?;
                    if let Some(place) = group.get_mut(tag as usize) {
                        *place = value as i32;
                    }
                }
                nodes.clear();
                for _ in 0..number {
                    nodes.push(node_number(s.int()?)?);
                }
                if let Some(solid) = solid {
                    self.solids.cell(solid, &nodes);
                    self.groups.push(group);
                }
            }
            read += many;
        }
        Ok(())
    }

    fn elements_4(&mut self, s: &mut Source) -> Result<(), String> {
        s.begin_data();
        let (blocks, all, _, _) = (s.size()?, s.size()?, s.size()?, s.size()?);
        let mut nodes = Vec::new();
        let mut found = 0u64;
        for _ in 0..blocks {
            let (_, entity, kind) = (s.int()?, s.int()?, s.int()?);
            let count = s.size()?;
            let (number, solid) = element(kind)?;
            let count = s.room(count, 1 + number as u64, (1 + number) * s.size, "elements")?;
            let group = [self.volumes.get(&(entity as i32)).copied().unwrap_or(0), entity as i32];
            for _ in 0..count {
                s.size()?;
                nodes.clear();
                for _ in 0..number {
                    nodes.push(s.size()?);
                }
                if let Some(solid) = solid {
                    self.solids.cell(solid, &nodes);
                    self.groups.push(group);
                }
            }
            found += count as u64;
        }
        agree(all, found, "elements")
    }

    /// Notes the physical groups of volumes.
    fn entities(&mut self, s: &mut Source, partitioned: bool) -> Result<(), String> {
        s.begin_data();
        if partitioned {
            s.size()?;
            let ghosts = s.size()?;
            s.ints(ghosts.saturating_mul(2))?;
        }
        let counts = [s.size()?, s.size()?, s.size()?, s.size()?];
        for (dimension, count) in counts.into_iter().enumerate() {
            for _ in 0..count {
                let tag = s.int()?;
                if partitioned {
                    s.ints(2)?;
                    let parts = s.size()?;
                    s.ints(parts)?;
                }
                for _ in 0..if dimension == 0 { 1 } else { 2 } {
                    s.point()?;
                }
                for i in 0..s.size()? {
                    let group = s.int()?;
                    if dimension == 3 && i == 0 {
                        self.volumes.insert(tag as i32, group as i32);
                    }
                }
                let around = if dimension == 0 { 0 } else { s.size()? };
                s.ints(around)?;
            }
        }
        Ok(())
    }

    fn node_data(&mut self, s: &mut Source) -> Result<(), String> {
        let mut name = String::new();
        for i in 0..s.words.whole::<u64>()? {
            if i == 0 {
                s.words.rest_of_line();
            }
            if s.words.left() == 0 {
                return Err("the file breaks off".to_owned());
            }
            let line = String::from_utf8_lossy(s.words.rest_of_line()).trim().to_owned();
            if i == 0 {
                name = line.strip_prefix('"').and_then(|l| l.strip_suffix('"')).unwrap_or(&line).to_owned();
            }
        }
        for _ in 0..s.words.whole::<u64>()? {
            s.words.number()?;
        }
        // the fourth, of partitions, is of no use here
        let mut tags = [0u64; 4];
        for i in 0..s.words.whole::<u64>()? {
            let tag: i64 = s.words.whole()?;
            tags[i.min(3) as usize] = tag.max(0) as u64;
        }
        let [_, components, count, _] = tags;
        if components == 0 {
            return Err("the number of components, the second of its whole numbers, is missing".to_owned());
        }
        s.begin_data();
        let each = components.saturating_add(1);
        let count = s.room(count, each, each.saturating_mul(8).saturating_sub(4) as usize, "values")?;
        let mut values = Vec::with_capacity(if components == 3 { count } else { 0 });
        for _ in 0..count {
            let id = s.int()?;
            if components == 3 {
                values.push((node_number(id)?, s.point()?));
            } else {
                for _ in 0..components {
                    s.real()?;
                }
            }
        }
        if components == 3 {
            self.data.push((name, values));
        }
        Ok(())
    }

    fn finish(self, path: &Path) -> Result<CellMesh, IoError> {
        let Self { mut solids, groups, data, .. } = self;
        let numbers = Numbering::of(&solids).map_err(|what| IoError::malformed(path, what))?;
        for (name, values) in data {
            // or many small sections would each cost as much memory as all points
            if values.len() < solids.points.len() / 16 {
                continue;
            }
            let mut all = vec![DVec3::NAN; solids.points.len()];
            for (id, value) in values {
                let missing = || format!("the data '{}' name node {id}, which is not there", show(name.as_bytes()));
                let index = numbers.index(id).ok_or_else(|| IoError::malformed(path, missing()))?;
                all[index as usize] = value;
            }
            solids.add_vectors(&name, all);
        }
        let has_groups = groups.iter().any(|g| g[0] != 0);
        let has_entities = groups.iter().any(|g| g[1] != groups[0][1]);
        if has_groups || has_entities {
            solids.regions = groups.iter().map(|g| g[usize::from(!has_groups)]).collect();
        }
        solids.finish(path)
    }
}

/// Writes nodes, tetrahedra, regions as physical groups, and vectors as `$NodeData`.
///
/// # Errors
/// As [`super::write_tets`].
pub fn write(path: &Path, mesh: &TetMesh, options: &TetWriteOptions) -> Result<(), IoError> {
    let text = options.encoding == Encoding::Text;
    write_atomic(path, |w| {
        let mut out = Out { w, text };
        let version = if options.gmsh == GmshVersion::V22 { "2.2" } else { "4.1" };
        writeln!(out.w, "$MeshFormat\n{version} {} 8", u8::from(!text))?;
        if !text {
            out.ints(&[1])?;
        }
        out.end("MeshFormat")?;
        match options.gmsh {
            GmshVersion::V22 => write_2(&mut out, mesh)?,
            GmshVersion::V41 => write_4(&mut out, mesh)?,
        }
        for v in &mesh.vectors {
            writeln!(out.w, "$NodeData\n1\n\"{}\"\n1\n0\n3\n0\n3\n{}", v.name, v.values.len())?;
            for (x, i) in v.values.iter().zip(1..) {
                out.ints(&[i])?;
                out.reals(&x.to_array())?;
                out.end_row()?;
            }
            out.end("NodeData")?;
        }
        Ok(())
    })
}

/// The different regions, ascending; a mesh without regions is one of region 0.
fn regions_of(mesh: &TetMesh) -> Vec<i32> {
    let mut regions = if mesh.regions.is_empty() { vec![0] } else { mesh.regions.clone() };
    regions.sort_unstable();
    regions.dedup();
    regions
}

/// The entity of a region: Gmsh keeps physical groups by entity, so each region needs one of its own.
fn volume_of(regions: &[i32], region: i32) -> i32 {
    regions.partition_point(|r| *r < region) as i32 + 1
}

fn write_2(out: &mut Out<impl Write>, mesh: &TetMesh) -> io::Result<()> {
    writeln!(out.w, "$Nodes\n{}", mesh.points.len())?;
    for (p, i) in mesh.points.iter().zip(1..) {
        out.ints(&[i])?;
        out.reals(&p.to_array())?;
        out.end_row()?;
    }
    out.end("Nodes")?;
    writeln!(out.w, "$Elements\n{}", mesh.tets.len())?;
    if !out.text && !mesh.tets.is_empty() {
        out.ints(&[4, mesh.tets.len() as i32, 2])?;
    }
    let regions = regions_of(mesh);
    for (t, i) in mesh.tets.iter().zip(1..) {
        out.ints(&[i, 4, 2][..if out.text { 3 } else { 1 }])?;
        let region = mesh.regions.get(i as usize - 1).copied().unwrap_or(0);
        out.ints(&[region, volume_of(&regions, region)])?;
        out.ints(&t.map(|v| v as i32 + 1))?;
        out.end_row()?;
    }
    out.end("Elements")
}

fn write_4(out: &mut Out<impl Write>, mesh: &TetMesh) -> io::Result<()> {
    let regions = regions_of(mesh);
    let (lo, hi) = mesh.bounds().unwrap_or_default();
    writeln!(out.w, "$Entities")?;
    out.sizes(&[0, 0, 0, regions.len() as u64])?;
    for (region, volume) in regions.iter().zip(1..) {
        out.end_row()?;
        out.ints(&[volume])?;
        out.reals(&[lo.x, lo.y, lo.z, hi.x, hi.y, hi.z])?;
        out.sizes(&[u64::from(*region != 0)])?;
        out.ints(if *region == 0 { &[] } else { std::slice::from_ref(region) })?;
        out.sizes(&[0])?;
    }
    out.end_row()?;
    out.end("Entities")?;

    let n = mesh.points.len() as u64;
    writeln!(out.w, "$Nodes")?;
    out.sizes(&[1, n, 1, n])?;
    out.end_row()?;
    out.ints(&[3, 1, 0])?;
    out.sizes(&[n])?;
    out.end_row()?;
    for id in 1..=n {
        out.sizes(&[id])?;
        out.end_row()?;
    }
    for p in &mesh.points {
        out.reals(&p.to_array())?;
        out.end_row()?;
    }
    out.end("Nodes")?;

    // a block for each run of one region, so that the order of tetrahedra stays
    let all: Vec<i32> = if mesh.regions.is_empty() { vec![0; mesh.tets.len()] } else { mesh.regions.clone() };
    let n = mesh.tets.len() as u64;
    writeln!(out.w, "$Elements")?;
    out.sizes(&[all.chunk_by(|a, b| a == b).count() as u64, n, 1, n])?;
    out.end_row()?;
    let mut tets = mesh.tets.iter().zip(1..);
    for run in all.chunk_by(|a, b| a == b) {
        out.ints(&[3, volume_of(&regions, run[0]), 4])?;
        out.sizes(&[run.len() as u64])?;
        out.end_row()?;
        for (t, i) in tets.by_ref().take(run.len()) {
            out.sizes(&[i])?;
            out.sizes(&t.map(|v| u64::from(v) + 1))?;
            out.end_row()?;
        }
    }
    out.end("Elements")
}

/// Rows of numbers, in text or little endian.
struct Out<W> {
    w: W,
    text: bool,
}

impl<W: Write> Out<W> {
    fn number(&mut self, x: impl std::fmt::Debug, bytes: &[u8]) -> io::Result<()> {
        if self.text { write!(self.w, "{x:?} ") } else { self.w.write_all(bytes) }
    }

    fn ints(&mut self, list: &[i32]) -> io::Result<()> {
        list.iter().try_for_each(|x| self.number(x, &x.to_le_bytes()))
    }

    fn sizes(&mut self, list: &[u64]) -> io::Result<()> {
        list.iter().try_for_each(|x| self.number(x, &x.to_le_bytes()))
    }

    fn reals(&mut self, list: &[f64]) -> io::Result<()> {
        list.iter().try_for_each(|x| self.number(x, &x.to_le_bytes()))
    }

    fn end_row(&mut self) -> io::Result<()> {
        if self.text { writeln!(self.w) } else { Ok(()) }
    }

    /// Binary data end in a line end, too.
    fn end(&mut self, section: &str) -> io::Result<()> {
        if !self.text {
            writeln!(self.w)?;
        }
        writeln!(self.w, "$End{section}")
    }
}

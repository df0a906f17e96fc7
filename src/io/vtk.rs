//! VTK's legacy format (`.vtk`), versions 1 to 5.1, text and binary: unstructured grids, surfaces and volumes.
//!
//! After "VTK File Formats" and what VTK 9 writes. `UNSTRUCTURED_GRID` is read as a tetrahedral mesh (and written), `POLYDATA`
//! as a surface (polygons and triangle strips), `STRUCTURED_POINTS` as a volume. Of the attributes, arrays of three components at
//! the points become vectors, and an array of the cells by the name of `region` or `material` the regions; at the voxels the
//! first array of 1 to 4 components is the volume, scalars before others. Binary numbers are big endian.
//!
//! The crate `vtkio` is not used: it reads the XML files of VTK 9 as empty, and its errors do not say where a file is wrong.

use std::io::Write;
use std::path::Path;

use glam::{DMat3, DVec3};

use super::bytes::ByteOrder;
use super::error::Fault;
use super::header;
use super::numbers::{Kind, Numbers};
use super::surface::Polygons;
use super::tets::{Solids, TetWriteOptions};
use super::volume::Encoding;
use super::vtk_cells::{Array, Lists, Piece};
use super::words::{Words, show};
use super::{IoError, write_atomic};
use crate::mesh::TriMesh;
use crate::mesh::cells::CellMesh;
use crate::mesh::tets::TetMesh;
use crate::volume::{Grid, Space, Volume};

/// What a file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Dataset {
    UnstructuredGrid,
    PolyData,
    StructuredPoints,
}

impl Dataset {
    fn sentence(self) -> &'static str {
        match self {
            Self::UnstructuredGrid => "holds cells (UNSTRUCTURED_GRID)",
            Self::PolyData => "holds a surface (POLYDATA)",
            Self::StructuredPoints => "holds a volume (STRUCTURED_POINTS)",
        }
    }
}

/// Reads an unstructured grid; `path` is for messages only.
///
/// # Errors
/// As [`super::read_tets`].
pub fn parse_cells(path: &Path, bytes: &[u8]) -> Result<CellMesh, IoError> {
    let mut solids = Solids::default();
    let read = |solids: &mut Solids| -> Result<(), Fault> {
        let mut file = File::read(bytes, Dataset::UnstructuredGrid, "a mesh of solid cells")?;
        let types = std::mem::take(&mut file.types);
        let piece = Piece {
            points: file.points()?,
            cells: file.list(b"CELLS"),
            types,
            point_data: file.point_data,
            cell_data: file.cell_data,
        };
        piece.add_to(solids)
    };
    read(&mut solids).map_err(|fault| fault.of(path))?;
    solids.finish(path)
}

/// Reads a surface: polygons, then triangle strips. `path` is for messages only.
///
/// # Errors
/// As [`super::read_surface`].
pub fn parse_surface(path: &Path, bytes: &[u8]) -> Result<TriMesh, IoError> {
    let mut polygons = Polygons::default();
    let read = |polygons: &mut Polygons| -> Result<(), Fault> {
        let mut file = File::read(bytes, Dataset::PolyData, "a surface")?;
        polygons.positions = file.points()?;
        let corner = |v: i64| u32::try_from(v).map_err(|_| format!("a face names point {v}; points count from 0"));
        for face in file.list(b"POLYGONS").iter() {
            for &v in face {
                polygons.corner(corner(v)?);
            }
            polygons.end_face()?;
        }
        for strip in file.list(b"TRIANGLE_STRIPS").iter() {
            for (i, t) in strip.windows(3).enumerate() {
                // every other triangle runs the other way
                let [a, b] = if i % 2 == 0 { [t[0], t[1]] } else { [t[1], t[0]] };
                for v in [a, b, t[2]] {
                    polygons.corner(corner(v)?);
                }
                polygons.end_face()?;
            }
        }
        Ok(())
    };
    read(&mut polygons).map_err(|fault| fault.of(path))?;
    polygons.finish(path)
}

/// Reads structured points; `path` is for messages only.
///
/// # Errors
/// As [`super::read_volume`].
pub fn parse_volume(path: &Path, bytes: &[u8]) -> Result<Volume, IoError> {
    let file = File::read(bytes, Dataset::StructuredPoints, "a volume").map_err(|fault| fault.of(path))?;
    let (grid, array) = file.voxels(path)?;
    let Some(array) = array else {
        let what = "has no array of 1 to 4 numbers for each point or each cell; a volume needs samples";
        return Err(IoError::malformed(path, what));
    };
    let Some(samples) = array.numbers.samples() else {
        let what = format!("its array '{}' has 64-bit integers; Voxclay reads integers of up to 32 bits", array.name);
        return Err(IoError::unsupported(path, what));
    };
    Ok(Volume::new(grid, array.components, samples))
}

/// The type of data set that a file holds, from its beginning; `None` if it is none that is read here.
pub(super) fn dataset(bytes: &[u8]) -> Option<Dataset> {
    Header::read(&mut Words::new(bytes, 1)).ok()?.dataset.ok()
}

struct Header {
    binary: bool,
    /// Or the name of another.
    dataset: Result<Dataset, String>,
}

impl Header {
    fn read(words: &mut Words) -> Result<Self, Fault> {
        let first = words.rest_of_line().trim_ascii();
        if !first.to_ascii_lowercase().starts_with(b"# vtk datafile version") {
            return Err("does not begin with '# vtk DataFile Version', as legacy files of VTK do".into());
        }
        words.rest_of_line();
        let binary = match words.next_word().map(<[u8]>::to_ascii_uppercase).as_deref() {
            Some(b"ASCII") => false,
            Some(b"BINARY") => true,
            _ => return Err(format!("line {} should be ASCII or BINARY", words.line).into()),
        };
        if words.next_word().is_none_or(|w| !w.eq_ignore_ascii_case(b"DATASET")) {
            return Err(format!("line {} should begin with DATASET", words.line).into());
        }
        let name = words.next_word().unwrap_or_default();
        let dataset = match name.to_ascii_uppercase().as_slice() {
            b"UNSTRUCTURED_GRID" => Ok(Dataset::UnstructuredGrid),
            b"POLYDATA" => Ok(Dataset::PolyData),
            b"STRUCTURED_POINTS" => Ok(Dataset::StructuredPoints),
            _ => Err(show(name)),
        };
        Ok(Self { binary, dataset })
    }
}

/// Which points or cells the arrays that follow belong to.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    Nowhere,
    Points(u64),
    Cells(u64),
}

/// Everything in a file.
struct File<'a> {
    words: Words<'a>,
    binary: bool,
    place: Place,
    points: Option<Numbers>,
    lists: Vec<(Vec<u8>, Lists)>,
    types: Vec<i64>,
    dims: [usize; 3],
    origin: DVec3,
    spacing: DVec3,
    point_data: Vec<Array>,
    cell_data: Vec<Array>,
    /// Whether the first array of the points, and of the cells, is their scalars.
    scalars: [Option<usize>; 2],
}

impl<'a> File<'a> {
    fn read(bytes: &'a [u8], wanted: Dataset, what: &str) -> Result<Self, Fault> {
        let mut words = Words::new(bytes, 1);
        let header = Header::read(&mut words)?;
        match header.dataset {
            Ok(found) if found == wanted => {}
            Ok(found) => {
                return Err(Fault::Unsupported(format!("{}, but {what} is wanted here", found.sentence())));
            }
            Err(name) => {
                return Err(Fault::Unsupported(format!(
                    "holds a data set of type '{name}'; Voxclay reads UNSTRUCTURED_GRID, POLYDATA and STRUCTURED_POINTS"
                )));
            }
        }
        let mut file = Self {
            words,
            binary: header.binary,
            place: Place::Nowhere,
            points: None,
            lists: Vec::new(),
            types: Vec::new(),
            dims: [0; 3],
            origin: DVec3::ZERO,
            spacing: DVec3::ONE,
            point_data: Vec::new(),
            cell_data: Vec::new(),
            scalars: [None; 2],
        };
        while let Some(word) = file.words.next_word() {
            let keyword = word.to_ascii_uppercase();
            file.section(&keyword).map_err(|what| format!("{what}, in {}", show(&keyword)))?;
        }
        Ok(file)
    }

    fn section(&mut self, keyword: &[u8]) -> Result<(), String> {
        match keyword {
            b"POINTS" => {
                let count: u64 = self.words.whole()?;
                let kind = self.kind()?;
                self.points = self.array(kind, count.saturating_mul(3))?;
            }
            b"CELLS" | b"VERTICES" | b"LINES" | b"POLYGONS" | b"TRIANGLE_STRIPS" => self.cells(keyword)?,
            b"CELL_TYPES" => {
                let count: u64 = self.words.whole()?;
                let types = self.array(Some(Kind::I32), count)?.and_then(|n| n.whole());
                self.types = types.unwrap_or_default();
            }
            b"DIMENSIONS" => {
                for i in 0..3 {
                    self.dims[i] = self.words.whole()?;
                }
            }
            b"ORIGIN" => self.origin = self.vector()?,
            b"SPACING" | b"ASPECT_RATIO" => self.spacing = self.vector()?,
            b"POINT_DATA" => self.place = Place::Points(self.words.whole()?),
            b"CELL_DATA" => self.place = Place::Cells(self.words.whole()?),
            b"METADATA" => {
                // to the next empty line
                self.words.rest_of_line();
                while !self.words.rest_of_line().trim_ascii().is_empty() {}
            }
            b"FIELD" => {
                self.words.next_word();
                for _ in 0..self.words.whole::<u64>()? {
                    // between two arrays there may be data about the first
                    while self.words.peek().is_some_and(|w| w == b"METADATA") {
                        self.words.next_word();
                        self.section(b"METADATA")?;
                    }
                    let name = self.name()?;
                    let (components, tuples): (u64, u64) = (self.words.whole()?, self.words.whole()?);
                    self.attribute(name, components, tuples)?;
                }
            }
            b"SCALARS" => {
                let name = self.name()?;
                let kind = self.kind_name()?;
                let components = match self.words.peek() {
                    Some(w) if w.iter().all(u8::is_ascii_digit) => self.words.whole()?,
                    _ => 1,
                };
                if self.words.next_word().is_none_or(|w| !w.eq_ignore_ascii_case(b"LOOKUP_TABLE")) {
                    return Err(format!("line {} should name a LOOKUP_TABLE", self.words.line));
                }
                self.words.next_word();
                let (slot, count) = match self.place {
                    Place::Cells(n) => (1, n),
                    Place::Points(n) => (0, n),
                    Place::Nowhere => return Err("it comes before POINT_DATA or CELL_DATA".to_owned()),
                };
                let there = [&self.point_data, &self.cell_data][slot].len();
                self.values(name, components, count, &kind)?;
                if [&self.point_data, &self.cell_data][slot].len() > there {
                    self.scalars[slot].get_or_insert(there);
                }
            }
            b"VECTORS"
            | b"NORMALS"
            | b"TENSORS"
            | b"TENSORS6"
            | b"GLOBAL_IDS"
            | b"PEDIGREE_IDS"
            | b"EDGE_FLAGS"
            | b"TEXTURE_COORDINATES"
            | b"COLOR_SCALARS"
            | b"LOOKUP_TABLE" => self.named(keyword)?,
            _ => return Err(format!("line {} has '{}', which is no keyword", self.words.line, show(keyword))),
        }
        Ok(())
    }

    /// An attribute of a set number of components.
    fn named(&mut self, keyword: &[u8]) -> Result<(), String> {
        let name = self.name()?;
        let components: u64 = match keyword {
            b"TENSORS" => 9,
            b"TENSORS6" => 6,
            b"GLOBAL_IDS" | b"PEDIGREE_IDS" | b"EDGE_FLAGS" => 1,
            b"TEXTURE_COORDINATES" | b"COLOR_SCALARS" | b"LOOKUP_TABLE" => self.words.whole()?,
            _ => 3,
        };
        let count = match self.place {
            Place::Points(n) | Place::Cells(n) => n,
            Place::Nowhere => return Err("it comes before POINT_DATA or CELL_DATA".to_owned()),
        };
        if matches!(keyword, b"COLOR_SCALARS" | b"LOOKUP_TABLE") {
            // bytes where the file is binary, else numbers from 0 to 1; of a table there are four for each entry
            let count = if keyword == b"LOOKUP_TABLE" {
                components.saturating_mul(4)
            } else {
                components.saturating_mul(count)
            };
            let kind = if self.binary { Kind::U8 } else { Kind::F32 };
            let numbers = self.array(Some(kind), count)?;
            if keyword == b"COLOR_SCALARS" {
                self.keep(name, components, numbers);
            }
            return Ok(());
        }
        let kind = self.kind_name()?;
        // directions and the like are no vectors that a mesh could be moved by
        let name = if keyword == b"VECTORS" { name } else { Vec::new() };
        self.values(name, components, count, &kind)
    }

    /// An array of a field.
    fn attribute(&mut self, name: Vec<u8>, components: u64, tuples: u64) -> Result<(), String> {
        let kind = self.kind_name()?;
        let here = matches!(self.place, Place::Points(n) | Place::Cells(n) if n == tuples);
        self.values(if here { name } else { Vec::new() }, components, tuples, &kind)
    }

    /// Reads an array and keeps it unless its name is empty.
    fn values(&mut self, name: Vec<u8>, components: u64, tuples: u64, kind: &[u8]) -> Result<(), String> {
        let count = components.saturating_mul(tuples);
        if kind == b"string" || kind == b"utf8_string" {
            return self.skip_strings(count);
        }
        let kind = known(kind)?;
        let numbers = self.array(kind, count)?;
        self.keep(name, components, numbers);
        Ok(())
    }

    fn keep(&mut self, name: Vec<u8>, components: u64, numbers: Option<Numbers>) {
        let Some(numbers) = numbers.filter(|_| !name.is_empty()) else { return };
        let array = Array { name: decoded(&name), components: components as usize, numbers };
        match self.place {
            Place::Points(_) => self.point_data.push(array),
            Place::Cells(_) => self.cell_data.push(array),
            Place::Nowhere => {}
        }
    }

    fn name(&mut self) -> Result<Vec<u8>, String> {
        self.words.next_word().map(<[u8]>::to_vec).ok_or_else(|| "the file breaks off; a name should follow".to_owned())
    }

    fn kind_name(&mut self) -> Result<Vec<u8>, String> {
        let word = self.words.next_word().ok_or("the file breaks off; a type should follow")?;
        Ok(word.to_ascii_lowercase())
    }

    fn kind(&mut self) -> Result<Option<Kind>, String> {
        known(&self.kind_name()?)
    }

    fn vector(&mut self) -> Result<DVec3, String> {
        Ok(DVec3::new(self.words.number()?, self.words.number()?, self.words.number()?))
    }

    /// Reads numbers; bits (without a kind) are passed over.
    fn array(&mut self, kind: Option<Kind>, count: u64) -> Result<Option<Numbers>, String> {
        if self.binary {
            self.words.rest_of_line();
            let Some(kind) = kind else {
                let bytes = self.words.room(count.div_ceil(8), 1, "bytes of bits")?;
                return self.words.take(bytes).map(|_| None);
            };
            let count = self.words.room(count, kind.bytes() as u64, "numbers")?;
            let bytes = self.words.take(count * kind.bytes())?;
            return Ok(Some(Numbers::from_bytes(kind, bytes.to_vec(), ByteOrder::Big)));
        }
        let count = self.words.room(count, 2, "numbers")?;
        let numbers = Numbers::from_words(kind.unwrap_or(Kind::U8), &mut self.words, count)?;
        Ok(kind.map(|_| numbers))
    }

    /// Strings in text stand on a line each; in binary files their length comes first, in 1, 2, 4 or 8 bytes.
    fn skip_strings(&mut self, count: u64) -> Result<(), String> {
        self.words.rest_of_line();
        for _ in 0..self.words.room(count, 1, "strings")? {
            if !self.binary {
                self.words.rest_of_line();
                continue;
            }
            let first = self.words.take(1)?[0];
            let more = [7, 3, 1, 0][usize::from(first >> 6)];
            let length = self.words.take(more)?.iter().fold(u64::from(first & 0x3f), |n, b| n << 8 | u64::from(*b));
            let length = self.words.room(length, 1, "characters in a string")?;
            self.words.take(length)?;
        }
        Ok(())
    }

    fn cells(&mut self, keyword: &[u8]) -> Result<(), String> {
        let (cells, size): (u64, u64) = (self.words.whole()?, self.words.whole()?);
        let lists = if self.words.peek() == Some(b"OFFSETS") {
            // since version 5: offsets, one more than cells, and points apart
            self.words.next_word();
            let kind = self.kind()?;
            let mut offsets = self.array(kind, cells)?.and_then(|n| n.whole());
            if self.words.next_word() != Some(b"CONNECTIVITY") {
                return Err(format!("line {} should begin with CONNECTIVITY", self.words.line));
            }
            let kind = self.kind()?;
            let points = self.array(kind, size)?.and_then(|n| n.whole());
            if let Some(list) = &mut offsets
                && !list.is_empty()
                && list.remove(0) != 0
            {
                return Err("the offsets of its cells do not begin at 0".to_owned());
            }
            Lists::from_ends(points, offsets)?
        } else {
            let numbers = self.array(Some(Kind::I32), size)?.and_then(|n| n.whole());
            Lists::from_lengths(numbers.unwrap_or_default(), cells)?
        };
        self.lists.push((keyword.to_vec(), lists));
        Ok(())
    }

    fn points(&mut self) -> Result<Vec<DVec3>, Fault> {
        Ok(self.points.take().ok_or("there are no POINTS in it; the file is cut off or no mesh")?.points())
    }

    fn list(&mut self, keyword: &[u8]) -> Lists {
        let at = self.lists.iter().position(|(k, _)| k == keyword);
        at.map(|i| self.lists.swap_remove(i).1).unwrap_or_default()
    }

    /// The grid of the samples, and the samples. Those of cells lie between the points.
    fn voxels(self, path: &Path) -> Result<(Grid, Option<Array>), IoError> {
        let usable = |a: &Array| (1..=4).contains(&a.components);
        let pick = |mut list: Vec<Array>, scalars: Option<usize>| {
            let at = scalars.filter(|&i| usable(&list[i])).or_else(|| list.iter().position(usable))?;
            Some(list.swap_remove(at))
        };
        let [scalars, cell_scalars] = self.scalars;
        let (array, of_cells) = match pick(self.point_data, scalars) {
            Some(array) => (Some(array), false),
            None => match pick(self.cell_data, cell_scalars) {
                Some(array) => (Some(array), true),
                None => (None, false),
            },
        };
        let (mut dims, mut origin) = (self.dims, self.origin);
        if of_cells {
            origin += 0.5 * self.spacing;
            dims = dims.map(|d| d.saturating_sub(1));
        }
        let grid = header::grid(path, dims, DMat3::from_diagonal(self.spacing), origin, Space::Unknown)?;
        if let Some(a) = &array
            && Some(a.numbers.len()) != grid.len().checked_mul(a.components)
        {
            let (n, samples) = (grid.len(), a.numbers.len());
            return Err(IoError::malformed(
                path,
                format!("the array '{}' has {samples} numbers for {n} voxels of {} channels", a.name, a.components),
            ));
        }
        Ok((grid, array))
    }
}

/// `None` for bits.
fn known(name: &[u8]) -> Result<Option<Kind>, String> {
    Ok(Some(match name {
        b"bit" => return Ok(None),
        b"char" | b"signed_char" | b"vtktypeint8" => Kind::I8,
        b"unsigned_char" | b"vtktypeuint8" => Kind::U8,
        b"short" | b"vtktypeint16" => Kind::I16,
        b"unsigned_short" | b"vtktypeuint16" => Kind::U16,
        // ids are written as 32-bit integers
        b"int" | b"vtkidtype" | b"vtktypeint32" => Kind::I32,
        b"unsigned_int" | b"vtktypeuint32" => Kind::U32,
        b"long" | b"long_long" | b"vtktypeint64" => Kind::I64,
        b"unsigned_long" | b"unsigned_long_long" | b"vtktypeuint64" => Kind::U64,
        b"float" => Kind::F32,
        b"double" => Kind::F64,
        _ => return Err(format!("there are numbers of type '{}', which is none of VTK's", show(name))),
    }))
}

/// A name without the escapes (`%20` for a blank).
fn decoded(name: &[u8]) -> String {
    let mut out = Vec::with_capacity(name.len());
    let mut rest = name;
    while let Some((&first, after)) = rest.split_first() {
        let code = after.get(..2).filter(|_| first == b'%').and_then(|h| std::str::from_utf8(h).ok());
        match code.and_then(|h| u8::from_str_radix(h, 16).ok()) {
            Some(byte) => {
                out.push(byte);
                rest = &after[2..];
            }
            None => {
                out.push(first);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

fn encoded(name: &str) -> String {
    name.bytes()
        .map(|b| if b.is_ascii_graphic() && b != b'%' { char::from(b).to_string() } else { format!("%{b:02X}") })
        .collect()
}

/// Writes version 3.0, which every program reads, with 64-bit positions.
///
/// # Errors
/// As [`super::write_tets`].
pub fn write(path: &Path, mesh: &TetMesh, options: &TetWriteOptions) -> Result<(), IoError> {
    let text = options.encoding == Encoding::Text;
    write_atomic(path, |w| {
        let reals = |w: &mut dyn Write, list: &[DVec3]| -> std::io::Result<()> {
            for p in list {
                if text {
                    writeln!(w, "{:?} {:?} {:?}", p.x, p.y, p.z)?;
                } else {
                    p.to_array().iter().try_for_each(|x| w.write_all(&x.to_be_bytes()))?;
                }
            }
            if text { Ok(()) } else { writeln!(w) }
        };
        let ints = |w: &mut dyn Write, list: &[i32]| -> std::io::Result<()> {
            for x in list {
                if text { write!(w, "{x} ") } else { w.write_all(&x.to_be_bytes()) }?;
            }
            if text { writeln!(w) } else { Ok(()) }
        };
        let (points, tets) = (mesh.points.len(), mesh.tets.len());
        let coding = if text { "ASCII" } else { "BINARY" };
        writeln!(
            w,
            "# vtk DataFile Version 3.0\nVoxclay\n{coding}\nDATASET UNSTRUCTURED_GRID\nPOINTS {points} double"
        )?;
        reals(w, &mesh.points)?;
        writeln!(w, "CELLS {tets} {}", 5 * tets)?;
        for [a, b, c, d] in mesh.tets.iter().map(|t| t.map(|v| v as i32)) {
            ints(w, &[4, a, b, c, d])?;
        }
        writeln!(w, "\nCELL_TYPES {tets}")?;
        for _ in 0..tets {
            ints(w, &[10])?;
        }
        if !mesh.regions.is_empty() {
            writeln!(w, "\nCELL_DATA {tets}\nSCALARS region int 1\nLOOKUP_TABLE default")?;
            for region in &mesh.regions {
                ints(w, &[*region])?;
            }
        }
        if !mesh.vectors.is_empty() {
            writeln!(w, "\nPOINT_DATA {points}")?;
            for v in &mesh.vectors {
                writeln!(w, "VECTORS {} double", encoded(&v.name))?;
                reals(w, &v.values)?;
            }
        }
        writeln!(w)
    })
}

//! VTK's XML format of unstructured grids (`.vtu`), in every encoding that VTK 9 writes: text, inline base64, appended raw and
//! base64, both byte orders, both header types, plain or compressed by zlib.
//!
//! All pieces become one mesh; points that several pieces have stay apart. Arrays of three components at the points become
//! vectors, a cell array by the name of `region` or `material` the regions.

use std::io::{self, Write};
use std::path::Path;

use rayon::prelude::*;

use super::deflate::{Wrapper, write_deflated};
use super::error::Fault;
use super::tets::{Solids, TetWriteOptions};
use super::volume::Encoding;
use super::vtk_cells::{Array, Lists, Piece, is_region};
use super::vtk_xml::{Document, Element};
use super::{IoError, write_atomic};
use crate::mesh::cells::CellMesh;
use crate::mesh::tets::TetMesh;

/// Bytes that are compressed together.
const BLOCK: usize = 1 << 18;

/// Reads a `.vtu` file; `path` is for messages only.
///
/// # Errors
/// As [`super::read_tets`], or if it is compressed by LZ4 or LZMA.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<CellMesh, IoError> {
    let mut solids = Solids::default();
    let read = |solids: &mut Solids| -> Result<(), Fault> {
        let document = Document::parse(bytes, "UnstructuredGrid")?;
        for element in document.body()?.all("Piece") {
            piece(&document, element)?.add_to(solids)?;
        }
        Ok(())
    };
    read(&mut solids).map_err(|fault| fault.of(path))?;
    solids.drop_partial_vectors();
    solids.finish(path)
}

fn piece(document: &Document, element: &Element) -> Result<Piece, Fault> {
    let (points, cells): (u64, u64) = (element.number("NumberOfPoints")?, element.number("NumberOfCells")?);
    let only = |parent: &str, name: Option<&str>| -> Result<Option<Array>, Fault> {
        let found =
            element.child(parent).and_then(|p| p.all("DataArray").find(|a| name.is_none() || a.get("Name") == name));
        found.map_or(Ok(None), |e| document.array(e))
    };
    let list = |name: &str| -> Result<Option<Vec<i64>>, Fault> {
        match only("Cells", Some(name))? {
            Some(array) => Ok(array.numbers.whole()),
            // without cells there may be no arrays
            None if cells == 0 => Ok(Some(Vec::new())),
            None => Err(format!("a piece of {cells} cells has no array '{name}' in Cells").into()),
        }
    };
    let places = match only("Points", None)? {
        Some(array) if array.numbers.len() % 3 == 0 => array.numbers.points(),
        Some(_) => return Err("the coordinates of its points do not come in threes".into()),
        None => Vec::new(),
    };
    if places.len() as u64 != points {
        return Err(format!("a piece says that it has {points} points, but {} are there", places.len()).into());
    }
    let lists = Lists::from_ends(list("connectivity")?, list("offsets")?)?;
    if lists.len() as u64 != cells {
        return Err(format!("a piece says that it has {cells} cells, but {} are there", lists.len()).into());
    }
    Ok(Piece {
        points: places,
        cells: lists,
        types: list("types")?.ok_or("the types of its cells are not whole numbers")?,
        point_data: document.arrays(element.child("PointData"), |_, components| components == 3)?,
        cell_data: document.arrays(element.child("CellData"), |name, components| components == 1 && is_region(name))?,
    })
}

/// One array to be written.
struct Column {
    head: String,
    data: Data,
}

enum Data {
    Reals(Vec<f64>),
    Ints(Vec<i32>),
    Longs(Vec<i64>),
    Bytes(Vec<u8>),
}

impl Column {
    fn new(name: &str, components: usize, data: Data) -> Self {
        let kind = match data {
            Data::Reals(_) => "Float64",
            Data::Ints(_) => "Int32",
            Data::Longs(_) => "Int64",
            Data::Bytes(_) => "UInt8",
        };
        let name = quick_xml::escape::escape(name);
        Self { head: format!("<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\""), data }
    }

    fn points(name: &str, points: &[glam::DVec3]) -> Self {
        Self::new(name, 3, Data::Reals(points.iter().flat_map(|p| p.to_array()).collect()))
    }

    fn text(&self) -> String {
        fn rows<T: std::fmt::Debug>(list: &[T]) -> String {
            let rows = list.chunks(12).map(|row| row.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" "));
            rows.collect::<Vec<_>>().join("\n")
        }
        match &self.data {
            Data::Reals(list) => rows(list),
            Data::Ints(list) => rows(list),
            Data::Longs(list) => rows(list),
            Data::Bytes(list) => rows(list),
        }
    }

    /// The data with the numbers before them, little endian.
    fn bytes(&self, compressed: bool) -> io::Result<Vec<u8>> {
        fn little<T: Copy, const N: usize>(list: &[T], bytes: fn(T) -> [u8; N]) -> Vec<u8> {
            let mut out = vec![0; N * list.len()];
            out.as_chunks_mut::<N>().0.iter_mut().zip(list).for_each(|(to, x)| *to = bytes(*x));
            out
        }
        let plain = match &self.data {
            Data::Reals(list) => little(list, f64::to_le_bytes),
            Data::Ints(list) => little(list, i32::to_le_bytes),
            Data::Longs(list) => little(list, i64::to_le_bytes),
            Data::Bytes(list) => list.clone(),
        };
        let mut out = Vec::new();
        let mut header = |n: usize| out.extend_from_slice(&(n as u64).to_le_bytes());
        if !compressed {
            header(plain.len());
            out.extend_from_slice(&plain);
            return Ok(out);
        }
        let pack = |block: &[u8]| {
            let mut packed = Vec::new();
            write_deflated(&mut packed, &[block], Wrapper::Zlib).map(|()| packed)
        };
        let blocks = plain.par_chunks(BLOCK).map(pack).collect::<io::Result<Vec<_>>>()?;
        header(blocks.len());
        header(BLOCK);
        header(plain.len() % BLOCK);
        blocks.iter().for_each(|b| header(b.len()));
        blocks.iter().for_each(|b| out.extend_from_slice(b));
        Ok(out)
    }
}

/// Writes text, or little-endian bytes appended as they are, by default compressed.
///
/// # Errors
/// As [`super::write_tets`].
pub fn write(path: &Path, mesh: &TetMesh, options: &TetWriteOptions) -> Result<(), IoError> {
    let tets = mesh.tets.len();
    let groups = [
        ("PointData", mesh.vectors.iter().map(|v| Column::points(&v.name, &v.values)).collect()),
        (
            "CellData",
            if mesh.regions.is_empty() {
                vec![]
            } else {
                vec![Column::new("region", 1, Data::Ints(mesh.regions.clone()))]
            },
        ),
        ("Points", vec![Column::points("Points", &mesh.points)]),
        (
            "Cells",
            vec![
                Column::new(
                    "connectivity",
                    1,
                    Data::Longs(mesh.tets.iter().flatten().map(|&v| i64::from(v)).collect()),
                ),
                Column::new("offsets", 1, Data::Longs((1..=tets as i64).map(|i| 4 * i).collect())),
                Column::new("types", 1, Data::Bytes(vec![10; tets])),
            ],
        ),
    ];
    let compressor = match options.encoding {
        Encoding::Compressed => " compressor=\"vtkZLibDataCompressor\"",
        Encoding::Raw | Encoding::Text => "",
    };
    write_atomic(path, |w| {
        writeln!(
            w,
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\"{compressor}>\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{tets}\">",
            mesh.points.len()
        )?;
        let mut appended = Vec::new();
        for (name, columns) in &groups {
            writeln!(w, "<{name}>")?;
            for column in columns {
                if options.encoding == Encoding::Text {
                    writeln!(w, "{} format=\"ascii\">\n{}\n</DataArray>", column.head, column.text())?;
                } else {
                    writeln!(w, "{} format=\"appended\" offset=\"{}\"/>", column.head, appended.len())?;
                    appended.extend(column.bytes(options.encoding == Encoding::Compressed)?);
                }
            }
            writeln!(w, "</{name}>")?;
        }
        writeln!(w, "</Piece>\n</UnstructuredGrid>")?;
        if options.encoding != Encoding::Text {
            write!(w, "<AppendedData encoding=\"raw\">\n_")?;
            w.write_all(&appended)?;
            writeln!(w, "\n</AppendedData>")?;
        }
        writeln!(w, "</VTKFile>")
    })
}

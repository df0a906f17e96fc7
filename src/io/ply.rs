//! PLY, ascii and binary of both byte orders: element `vertex` with `x`, `y`, `z` and element `face` with a list of
//! vertices; all else is passed over.
//!
//! The crate `ply-rs-bw` is not used: it hands every property of every element over by name, which takes many times as
//! long, and its errors do not say what would be right.

use std::io::Write;
use std::path::Path;

use glam::Vec3;

use super::surface::Polygons;
use super::words::{Words, show};
use super::{IoError, write_atomic};
use crate::mesh::TriMesh;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Format {
    Ascii,
    Little,
    Big,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn named(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    fn decode(self, b: &[u8], format: Format) -> f64 {
        macro_rules! number {
            ($t:ty) => {{
                let mut raw = [0; size_of::<$t>()];
                raw.copy_from_slice(b);
                f64::from(if format == Format::Big { <$t>::from_be_bytes(raw) } else { <$t>::from_le_bytes(raw) })
            }};
        }
        match self {
            Self::I8 => number!(i8),
            Self::U8 => number!(u8),
            Self::I16 => number!(i16),
            Self::U16 => number!(u16),
            Self::I32 => number!(i32),
            Self::U32 => number!(u32),
            Self::F32 => number!(f32),
            Self::F64 => number!(f64),
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
struct Property {
    name: Vec<u8>,
    scalar: Scalar,
    /// The type of the length, if it is a list.
    length: Option<Scalar>,
}

#[derive(Debug, Clone, PartialEq)]
struct Element {
    name: Vec<u8>,
    count: u64,
    properties: Vec<Property>,
}

impl Element {
    /// The fewest bytes that one such element can take.
    fn least_bytes(&self, format: Format) -> u64 {
        let binary = |p: &Property| p.length.unwrap_or(p.scalar).size() as u64;
        self.properties.iter().map(|p| if format == Format::Ascii { 1 } else { binary(p) }).sum()
    }
}

/// Reads a PLY file; `path` is for messages only.
///
/// # Errors
/// As [`super::read_surface`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<TriMesh, IoError> {
    let fail = |what: String| IoError::malformed(path, what);
    let (format, elements, body, lines) = header(bytes).map_err(fail)?;
    let find = |name: &[u8]| elements.iter().find(|e| e.name == name);
    let vertex = find(b"vertex").ok_or_else(|| fail("its header has no element 'vertex'".to_owned()))?;
    for axis in ["x", "y", "z"] {
        if !vertex.properties.iter().any(|p| p.name == axis.as_bytes() && p.length.is_none()) {
            return Err(fail(format!("the element 'vertex' has no property '{axis}'")));
        }
    }
    let face =
        find(b"face").ok_or_else(|| fail("its header has no element 'face'; a surface needs faces".to_owned()))?;
    if !face.properties.iter().any(is_corners) {
        return Err(fail("the element 'face' has no list 'vertex_indices'".to_owned()));
    }
    let mut source = match format {
        Format::Ascii => Source::Text(Words::new(body, lines)),
        _ => Source::Binary(body, format),
    };
    // what a header claims must have room in the bytes that are there before it is believed
    for e in &elements {
        if e.count.saturating_mul(e.least_bytes(format)) > body.len() as u64 {
            let (n, name, left) = (e.count, show(&e.name), body.len());
            return Err(fail(format!("the header says {n} of element '{name}', but only {left} bytes follow it")));
        }
    }
    let mut polygons = Polygons::with_capacity(vertex.count as usize, face.count as usize);
    for e in &elements {
        source.element(e, &mut polygons).map_err(fail)?;
    }
    polygons.finish(path)
}

fn is_corners(p: &Property) -> bool {
    p.length.is_some() && (p.name == b"vertex_indices" || p.name == b"vertex_index")
}

type Header<'a> = (Format, Vec<Element>, &'a [u8], usize);

/// Format, elements, the bytes behind the header, and the line they begin in.
fn header(bytes: &[u8]) -> Result<Header<'_>, String> {
    let mut rest = bytes;
    let mut format = None;
    let mut elements: Vec<Element> = Vec::new();
    for line_number in 1.. {
        let end = rest.iter().position(|&b| b == b'\n' || b == b'\r');
        let Some(end) = end else {
            let right =
                if line_number == 1 { "a PLY file begins with the line 'ply'" } else { "it must end in 'end_header'" };
            return Err(format!("the header breaks off at line {line_number}; {right}"));
        };
        let line = &rest[..end];
        // lines end in LF, CR LF or CR; a CR before anything else but LF is the whole end
        let newline = if rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
        rest = &rest[end + newline..];
        let words: Vec<&[u8]> = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).collect();
        let bad = |right: &str| format!("line {line_number} of the header reads '{}'; {right}", show(line));
        match words[..] {
            _ if line_number == 1 => {
                if words[..] != [b"ply"] {
                    return Err(bad("a PLY file begins with the line 'ply'"));
                }
            }
            [b"format", name, b"1.0"] => {
                format = Some(match name {
                    b"ascii" => Format::Ascii,
                    b"binary_little_endian" => Format::Little,
                    b"binary_big_endian" => Format::Big,
                    _ => return Err(bad("it should be ascii, binary_little_endian or binary_big_endian")),
                });
            }
            [b"element", name, count] => {
                let count = std::str::from_utf8(count).ok().and_then(|c| c.parse().ok());
                let count = count.ok_or_else(|| bad("the count should be a whole number"))?;
                elements.push(Element { name: name.to_vec(), count, properties: Vec::new() });
            }
            [b"property", ref property @ ..] => {
                let (length, scalar, name) = match *property {
                    [b"list", length, scalar, name] => (Some(length), scalar, name),
                    [scalar, name] => (None, scalar, name),
                    _ => return Err(bad("it should be 'property TYPE NAME' or 'property list TYPE TYPE NAME'")),
                };
                let typed = |t: &[u8]| Scalar::named(t).ok_or_else(|| bad("that is no type of PLY"));
                let property =
                    Property { name: name.to_vec(), scalar: typed(scalar)?, length: length.map(typed).transpose()? };
                elements.last_mut().ok_or_else(|| bad("no element comes before it"))?.properties.push(property);
            }
            [b"end_header"] => {
                let format = format.ok_or("the header has no line 'format'")?;
                return Ok((format, elements, rest, line_number + 1));
            }
            [] | [b"comment" | b"obj_info", ..] => {}
            _ => return Err(bad("that is no statement of PLY")),
        }
    }
    unreachable!("the loop ends only by return")
}

enum Source<'a> {
    Text(Words<'a>),
    Binary(&'a [u8], Format),
}

impl Source<'_> {
    fn take(&mut self, scalar: Scalar) -> Result<f64, String> {
        match self {
            Self::Text(words) => words.number(),
            Self::Binary(rest, format) => {
                let (value, after) =
                    rest.split_at_checked(scalar.size()).ok_or_else(|| "the file breaks off in its data".to_owned())?;
                *rest = after;
                Ok(scalar.decode(value, *format))
            }
        }
    }

    /// Reads all elements of one kind.
    fn element(&mut self, e: &Element, polygons: &mut Polygons) -> Result<(), String> {
        if e.properties.is_empty() {
            return Ok(());
        }
        let place = |i: u64| format!("{} {}", show(&e.name), i + 1);
        let (is_vertex, is_face) = (e.name == b"vertex", e.name == b"face");
        let axes: Vec<Option<usize>> =
            e.properties.iter().map(|p| [b"x", b"y", b"z"].iter().position(|a| p.name == *a)).collect();
        for i in 0..e.count {
            let mut position = glam::DVec3::ZERO;
            for (p, axis) in e.properties.iter().zip(&axes) {
                let fail = |what: String| format!("at {}: {what}", place(i));
                let Some(length) = p.length else {
                    let x = self.take(p.scalar).map_err(fail)?;
                    if let Some(axis) = *axis {
                        position[axis] = x;
                    }
                    continue;
                };
                let n = self.take(length).map_err(fail)?;
                if !(n >= 0.0 && n.fract() == 0.0) {
                    return Err(fail(format!("a list has the length {n}; it should be a whole number from 0")));
                }
                // the length is not believed: every entry is read, and the bytes end where the file does
                for _ in 0..n as u64 {
                    let v = self.take(p.scalar).map_err(fail)?;
                    if is_face && is_corners(p) {
                        if !(v >= 0.0 && v.fract() == 0.0) {
                            return Err(fail(format!("a corner names vertex {v}; vertices count from 0")));
                        }
                        polygons.corner(v.min(f64::from(u32::MAX)) as u32);
                    }
                }
                if is_face && is_corners(p) {
                    polygons.end_face()?;
                }
            }
            if is_vertex {
                polygons.positions.push(position);
            }
        }
        Ok(())
    }
}

/// Writes little-endian binary PLY with 64-bit positions, and 32-bit normals if there is one for each.
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, mesh: &TriMesh, normals: &[Vec3]) -> Result<(), IoError> {
    // signed indices are what most programs know
    let index = if mesh.positions.len() <= i32::MAX as usize { "int" } else { "uint" };
    let lit = normals.len() == mesh.positions.len();
    let more = if lit { "property float nx\nproperty float ny\nproperty float nz\n" } else { "" };
    write_atomic(path, |w| {
        write!(
            w,
            "ply\nformat binary_little_endian 1.0\ncomment Voxclay\nelement vertex {}\nproperty double x\nproperty double y\n\
             property double z\n{more}element face {}\nproperty list uchar {index} vertex_indices\nend_header\n",
            mesh.positions.len(),
            mesh.triangles.len()
        )?;
        for (i, p) in mesh.positions.iter().enumerate() {
            for x in p.to_array() {
                w.write_all(&x.to_le_bytes())?;
            }
            if lit {
                for x in normals[i].to_array() {
                    w.write_all(&x.to_le_bytes())?;
                }
            }
        }
        for t in &mesh.triangles {
            w.write_all(&[3])?;
            for v in t {
                w.write_all(&v.to_le_bytes())?;
            }
        }
        Ok(())
    })
}

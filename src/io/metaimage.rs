//! MetaImage: header and samples in one file (`.mha`) or in two (`.mhd` and a data file).
//!
//! # Theory
//!
//! After MetaIO's documentation and the files of ITK: lines `Key = Value`, of which `ElementDataFile` is the last; `LOCAL`
//! means that the samples follow. The world is LPS. `TransformMatrix` (older: `Rotation`, `Orientation`) holds the unit
//! direction of each voxel axis as a row, `ElementSpacing` the distance of voxels, `Offset` (also `Position`, `Origin`) the
//! centre of the first voxel.
//!
//! # Practice
//!
//! Read: three dimensions, 1 to 4 channels, raw, zlib or text (`BinaryData = False`), both byte orders, `HeaderSize` to skip
//! (-1: the samples are the end of the file). Refused with a sentence: 64-bit integers, `LIST` and patterns of files.
//!
//! Slope and intercept are `ElementToIntensityFunctionSlope` and `...Offset`. Volumes in RAS are turned to LPS when they are
//! written; of an unknown space they are written as they are.

use std::io::{BufReader, Write};
use std::path::Path;

use glam::{DMat3, DVec3};

use super::bytes::{self, Block, ByteOrder, Coding, Plan, Start, quote};
use super::deflate::Wrapper;
use super::header::{self, Fields, Lines};
use super::steps::Steps;
use super::store::{self, Body};
use super::volume::{Encoding, WriteOptions};
use super::{IoError, write_atomic};
use crate::volume::{Rescale, ScalarType, Space, Volume};

/// Reads a `.mha` or `.mhd` file.
///
/// # Errors
/// If the file cannot be read, is not sound, or holds something else than a volume of 1 to 4 channels.
pub fn read(path: &Path) -> Result<Volume, IoError> {
    plan(path)?.load()
}

/// Reads the header.
pub(super) fn plan(path: &Path) -> Result<Plan, IoError> {
    let (file, _) = bytes::open(path)?;
    let mut lines = Lines::new(path, BufReader::new(file));
    let mut fields = Fields::new(path);
    while fields.get("ElementDataFile").is_none() {
        let Some(line) = lines.next()? else {
            return Err(fields.wrong("its header has no line 'ElementDataFile = ...', which must end it; the file is cut off or not a MetaImage"));
        };
        match line.split_once('=') {
            Some((key, value)) => fields.add(key, value)?,
            None if line.trim().is_empty() => {}
            None => {
                return Err(
                    fields.wrong(format!("has the line {} in its header, which is not 'Key = Value'", quote(&line)))
                );
            }
        }
    }
    if let Some(kind) = fields.get("ObjectType").filter(|k| !k.eq_ignore_ascii_case("image")) {
        return Err(fields.unsupported(format!("holds an object of type {}; Voxclay reads Image", quote(kind))));
    }
    let dimensions: i64 = fields.numbers("NDims", fields.require("NDims")?, 1)?[0];
    if dimensions != 3 {
        return Err(fields.unsupported(format!("has {dimensions} dimensions; Voxclay reads volumes of 3")));
    }
    let dims: Vec<usize> = fields.numbers("DimSize", fields.require("DimSize")?, 3)?;
    let channels = match fields.get("ElementNumberOfChannels") {
        None => 1,
        Some(text) => fields.numbers::<usize>("ElementNumberOfChannels", text, 1)?[0],
    };
    if !(1..=4).contains(&channels) {
        return Err(fields.unsupported(format!("has {channels} values in each voxel; Voxclay reads 1 to 4")));
    }
    let (world, origin) = frame(&fields)?;
    let grid = header::grid(path, [dims[0], dims[1], dims[2]], world, origin, Space::Lps)?;
    let block = block(&fields, lines.taken)?;
    Ok(Plan { grid, channels, channel_stride: 1, rescale: rescale(&fields)?, steps: Steps::ONE, block })
}

fn frame(fields: &Fields) -> Result<(DMat3, DVec3), IoError> {
    let vector = |names: &[&'static str], default: DVec3| -> Result<DVec3, IoError> {
        let Some((name, text)) = fields.any(names) else { return Ok(default) };
        let v: Vec<f64> = fields.numbers(name, text, 3)?;
        Ok(DVec3::new(v[0], v[1], v[2]))
    };
    let origin = vector(&["Offset", "Position", "Origin"], DVec3::ZERO)?;
    let spacing = vector(&["ElementSpacing", "ElementSize"], DVec3::ONE)?;
    if !spacing.cmpgt(DVec3::ZERO).all() {
        return Err(fields.wrong(format!(
            "its voxel spacing is {} {} {}; each must be above 0 (a mirrored axis belongs into TransformMatrix)",
            spacing.x, spacing.y, spacing.z
        )));
    }
    let direction = match fields.any(&["TransformMatrix", "Rotation", "Orientation"]) {
        None => DMat3::IDENTITY,
        // a row is the direction of an axis, and so is a column of ours
        Some((name, text)) => {
            let m: Vec<f64> = fields.numbers(name, text, 9)?;
            DMat3::from_cols_slice(&m)
        }
    };
    Ok((direction * DMat3::from_diagonal(spacing), origin))
}

fn flag(fields: &Fields, names: &[&'static str], default: bool) -> Result<bool, IoError> {
    let Some((name, text)) = fields.any(names) else { return Ok(default) };
    // MetaIO looks at the first letter only
    match text.chars().next().map(|c| c.to_ascii_lowercase()) {
        Some('t' | '1' | 'y') => Ok(true),
        Some('f' | '0' | 'n') => Ok(false),
        _ => Err(fields.bad(name, text, "True or False")),
    }
}

fn scalar(fields: &Fields) -> Result<ScalarType, IoError> {
    let name = fields.require("ElementType")?;
    let upper = name.to_ascii_uppercase();
    Ok(match upper.strip_suffix("_ARRAY").unwrap_or(&upper) {
        "MET_CHAR" => ScalarType::I8,
        "MET_UCHAR" => ScalarType::U8,
        "MET_SHORT" => ScalarType::I16,
        "MET_USHORT" => ScalarType::U16,
        // MetaIO's long has always taken 4 bytes in files
        "MET_INT" | "MET_LONG" => ScalarType::I32,
        "MET_UINT" | "MET_ULONG" => ScalarType::U32,
        "MET_FLOAT" => ScalarType::F32,
        "MET_DOUBLE" => ScalarType::F64,
        _ => {
            return Err(fields.unsupported(format!(
                "its samples are of type {}; Voxclay reads MET_CHAR, MET_UCHAR, MET_SHORT, MET_USHORT, MET_INT, MET_UINT, MET_FLOAT and MET_DOUBLE",
                quote(name)
            )));
        }
    })
}

/// Where the samples lie.
fn block(fields: &Fields, attached: u64) -> Result<Block, IoError> {
    let scalar = scalar(fields)?;
    let binary = flag(fields, &["BinaryData"], true)?;
    let compressed = flag(fields, &["CompressedData"], false)?;
    let big = flag(fields, &["BinaryDataByteOrderMSB", "ElementByteOrderMSB"], false)?;
    let coding = match (binary, compressed) {
        (true, false) => Coding::Raw,
        (true, true) => Coding::Zlib,
        (false, false) => Coding::Text,
        (false, true) => {
            return Err(fields.wrong("says that its data are text and compressed; they must be one of the two"));
        }
    };
    let name = fields.require("ElementDataFile")?;
    let first = name.split_whitespace().next().unwrap_or_default();
    if first.eq_ignore_ascii_case("list") || (name.contains('%') && name.split_whitespace().count() > 1) {
        return Err(fields.unsupported("keeps its samples in several data files; join them into one file first"));
    }
    let local = name.eq_ignore_ascii_case("local");
    let path = if local { fields.path.clone() } else { bytes::detached(&fields.path, name)? };
    let base = if local { attached } else { 0 };
    let header_size: i64 = match fields.get("HeaderSize") {
        None => 0,
        Some(text) => fields.numbers("HeaderSize", text, 1)?[0],
    };
    let start = match (header_size, coding) {
        (0.., _) => Start::At(base.saturating_add(header_size as u64)),
        (-1, Coding::Raw) => Start::Tail(None),
        (-1, Coding::Zlib) => {
            let size = fields.require("CompressedDataSize")?;
            Start::Tail(Some(fields.numbers("CompressedDataSize", size, 1)?[0]))
        }
        _ => {
            return Err(fields.bad(
                "HeaderSize",
                &header_size.to_string(),
                "a number of bytes, or -1 where the data are binary",
            ));
        }
    };
    let order = if big { ByteOrder::Big } else { ByteOrder::Little };
    Ok(Block { path, start, coding, skip: 0, order, scalar })
}

fn rescale(fields: &Fields) -> Result<Rescale, IoError> {
    let number = |name: &str, default: f64| match fields.get(name) {
        None => Ok(default),
        Some(text) => fields.numbers::<f64>(name, text, 1).map(|v| v[0]),
    };
    let slope = number("ElementToIntensityFunctionSlope", 1.0)?;
    let intercept = number("ElementToIntensityFunctionOffset", 0.0)?;
    if slope == 0.0 || !slope.is_finite() || !intercept.is_finite() {
        return Err(fields.wrong("its ElementToIntensityFunctionSlope is zero or not finite; it must be a number by which samples can be scaled"));
    }
    Ok(Rescale { slope, intercept })
}

/// Writes a `.mha`, or a `.mhd` with its samples beside it (`NAME.raw`, `NAME.zraw` or `NAME.txt`).
///
/// # Errors
/// If a file cannot be written (what was there before is left), or text of several channels is asked for.
pub fn write(path: &Path, volume: &Volume, options: &WriteOptions) -> Result<(), IoError> {
    if options.encoding == Encoding::Text && volume.channels > 1 {
        // MetaIO itself reads as many numbers as there are voxels, and leaves the rest of its memory as it was
        return Err(IoError::unsupported(
            path,
            "a MetaImage of several channels cannot be written as text, which other programs misread; use .nrrd, or another encoding",
        ));
    }
    let detached = store::ends_with(path, ".mhd");
    let ending = match options.encoding {
        Encoding::Raw => "raw",
        Encoding::Compressed => "zraw",
        Encoding::Text => "txt",
    };
    let data = store::beside(path, ending)?;
    let body = Body::new(volume, options.encoding, Wrapper::Zlib);
    // other readers want the compressed size in the header, so it must be known first
    let packed = match options.encoding {
        Encoding::Compressed => {
            let mut packed = Vec::new();
            body.write(&mut packed).map_err(|e| IoError::system(path, "write", e))?;
            Some(packed)
        }
        _ => None,
    };
    let name = if detached { store::file_name(&data) } else { "LOCAL".to_owned() };
    let text = header_text(volume, options.encoding, packed.as_ref().map(Vec::len), &name);
    let samples = |w: &mut dyn Write| match &packed {
        Some(packed) => w.write_all(packed),
        None => body.write(w),
    };
    if detached {
        store::write_pair(path, text.as_bytes(), &data, |w| samples(w))
    } else {
        write_atomic(path, |w| {
            w.write_all(text.as_bytes())?;
            samples(w)
        })
    }
}

fn header_text(volume: &Volume, encoding: Encoding, packed: Option<usize>, data: &str) -> String {
    let grid = volume.grid.in_space(Space::Lps);
    let (spacing, direction) = header::spacing_and_direction(&grid);
    let list = |values: &[f64]| values.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(" ");
    let flag = |yes: bool| if yes { "True" } else { "False" };
    let kind = match volume.samples.scalar_type() {
        ScalarType::U8 => "MET_UCHAR",
        ScalarType::I8 => "MET_CHAR",
        ScalarType::U16 => "MET_USHORT",
        ScalarType::I16 => "MET_SHORT",
        ScalarType::U32 => "MET_UINT",
        ScalarType::I32 => "MET_INT",
        ScalarType::F32 => "MET_FLOAT",
        ScalarType::F64 => "MET_DOUBLE",
    };
    let mut text = format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = {}\nBinaryDataByteOrderMSB = False\nCompressedData = {}\n",
        flag(encoding != Encoding::Text),
        flag(encoding == Encoding::Compressed)
    );
    if let Some(size) = packed {
        text.push_str(&format!("CompressedDataSize = {size}\n"));
    }
    let [x, y, z] = grid.dims;
    text.push_str(&format!(
        "TransformMatrix = {}\nOffset = {}\nCenterOfRotation = 0 0 0\nElementSpacing = {}\nDimSize = {x} {y} {z}\n",
        list(&direction.to_cols_array()),
        list(&grid.origin().to_array()),
        list(&spacing.to_array())
    ));
    if volume.channels > 1 {
        text.push_str(&format!("ElementNumberOfChannels = {}\n", volume.channels));
    }
    if volume.rescale != Rescale::default() {
        let Rescale { slope, intercept } = volume.rescale;
        text.push_str(&format!(
            "ElementToIntensityFunctionSlope = {slope:?}\nElementToIntensityFunctionOffset = {intercept:?}\n"
        ));
    }
    text.push_str(&format!("ElementType = {kind}\nElementDataFile = {data}\n"));
    text
}

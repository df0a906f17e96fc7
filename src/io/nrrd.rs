//! NRRD: "nearly raw raster data", header and samples in one file (`.nrrd`) or in two (`.nhdr` and a data file).
//!
//! # Theory
//!
//! After the definition of the format by Kindlmann (teem, "Definition of NRRD File Format", versions 1 to 5): a text header
//! up to an empty line, fields `name: value`, free pairs `key:=value`, then the samples, first axis fastest. The world frame
//! is `space directions` (a vector per axis, `none` for an axis that is no direction in space) and `space origin`; without a
//! space, it is `spacings` and `axis mins`, the latter taken at the edge of the first sample unless `centers` says `node`
//! (as teem does).
//!
//! # Practice
//!
//! Read: three axes in space and at most one other, wherever it stands; encodings raw, gzip, text and hex; both byte orders;
//! `line skip`, `byte skip`. `left-anterior-superior` becomes RAS by turning the first world axis. The other axis holds steps
//! in time if its kind is `time`, or `list` and it is longer than 4; else it holds 1 to 4 channels.
//! Refused with a sentence: bzip2, 64-bit integers, blocks, more axes, data in several files.
//!
//! NRRD has no slope and intercept: they are written as the pairs `rescale slope` and `rescale intercept`, and read back.

use std::fs::File;
use std::io::{BufRead, BufReader, Seek, SeekFrom};
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

/// Reads a `.nrrd` or `.nhdr` file; of a series its first step.
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
    let magic = lines.next()?.unwrap_or_default();
    if !magic.starts_with("NRRD") {
        return Err(IoError::malformed(path, "does not begin with 'NRRD', so it is not a NRRD file"));
    }
    let (mut fields, mut pairs) = (Fields::new(path), Fields::new(path));
    while let Some(line) = lines.next()? {
        if line.is_empty() {
            break;
        }
        if line.starts_with('#') {
            continue;
        }
        let pair = line.find(":=");
        match (pair, line.find(':')) {
            (Some(at), Some(colon)) if at <= colon => {
                // a free pair may come twice; the first counts
                let _ = pairs.add(&line[..at], &line[at + 2..]);
            }
            (_, Some(at)) => {
                fields.add(&line[..at], &line[at + 1..])?;
                if fields.get("data file").is_some_and(|name| name.to_ascii_lowercase().starts_with("list")) {
                    // what follows is no header any more; a list is refused below
                    break;
                }
            }
            _ => {
                return Err(fields.wrong(format!(
                    "has the line {} in its header, which is not 'field: value'; an empty line must come before the data",
                    quote(&line)
                )));
            }
        }
    }
    let data_start = lines.taken;

    let axes = axes(&fields)?;
    let (world, origin, space) = frame(&fields, &axes)?;
    let grid = header::grid(path, axes.dims, world, origin, space)?;
    let scalar = scalar(&fields)?;
    let (coding, needs_order) = match fields.require("encoding")?.to_ascii_lowercase().as_str() {
        "raw" => (Coding::Raw, true),
        "gz" | "gzip" => (Coding::Gzip, true),
        "txt" | "text" | "ascii" => (Coding::Text, false),
        "hex" => (Coding::Hex, true),
        other => {
            return Err(
                fields.unsupported(format!("its encoding is {}; Voxclay reads raw, gzip, text and hex", quote(other)))
            );
        }
    };
    let order = match fields.get("endian").map(str::to_ascii_lowercase).as_deref() {
        Some("little") => ByteOrder::Little,
        Some("big") => ByteOrder::Big,
        None if !needs_order || scalar.bytes() == 1 => ByteOrder::Little,
        None => {
            return Err(fields.wrong(format!(
                "its header has no field 'endian', which samples of type {} need: little or big",
                scalar.name()
            )));
        }
        Some(other) => return Err(fields.bad("endian", other, "little or big")),
    };
    let (path, start, skip) = data(&fields, data_start, coding)?;
    let block = Block { path, start, coding, skip, order, scalar };
    let rescale = rescale(&pairs)?;
    let Axes { channels, stride: channel_stride, steps, .. } = axes;
    Ok(Plan { grid, channels, channel_stride, rescale, steps, block })
}

/// The axes of the array: three in space, and at most one of channels or of time.
struct Axes {
    dims: [usize; 3],
    /// Positions of the three among all.
    spatial: Vec<usize>,
    count: usize,
    channels: usize,
    stride: usize,
    steps: Steps,
}

fn axes(fields: &Fields) -> Result<Axes, IoError> {
    let dimension = fields.require("dimension")?;
    let count: usize = fields.numbers("dimension", dimension, 1)?[0];
    if !(3..=4).contains(&count) {
        return Err(fields.unsupported(format!(
            "has {count} axes; Voxclay reads volumes of 3 axes, or 4 where one holds 1 to 4 channels or steps in time"
        )));
    }
    let sizes: Vec<usize> = fields.numbers("sizes", fields.require("sizes")?, count)?;
    let mut spatial: Vec<usize> = (0..count).collect();
    if count == 4 {
        let other = channel_axis(fields, &sizes)?;
        spatial.remove(other);
        let n = sizes[other];
        let kinds = fields.get("kinds").unwrap_or_default();
        let kind = kinds.split_whitespace().nth(other).map(str::to_ascii_lowercase);
        // lists of up to 4 are vectors to many programs
        let time = kind.is_some_and(|k| k == "time" || (k == "list" && n > 4));
        let stride = sizes[..other].iter().try_fold(1usize, |n, &s| n.checked_mul(s));
        let stride = stride.ok_or_else(|| fields.bad("sizes", fields.get("sizes").unwrap_or_default(), "smaller"))?;
        let dims = std::array::from_fn(|i| sizes[spatial[i]]);
        if time {
            if n == 0 {
                return Err(fields.wrong("has an axis of time without a step; there must be at least one"));
            }
            // of the last axis a step lies in one piece, of others in runs
            let steps = Steps { count: n, run: (other + 1 < count).then_some(stride) };
            return Ok(Axes { dims, spatial, count, channels: 1, stride: 1, steps });
        }
        if !(1..=4).contains(&n) {
            return Err(fields.unsupported(format!(
                "has {n} values in each voxel; Voxclay reads 1 to 4 channels, or steps in time where 'kinds' says time"
            )));
        }
        return Ok(Axes { dims, spatial, count, channels: n, stride, steps: Steps::ONE });
    }
    let colors = ["color", "vector", "normal", "gradient", "complex", "quaternion", "matrix"];
    if let Some(kinds) = fields.get("kinds").map(str::to_ascii_lowercase)
        && colors.iter().any(|c| kinds.contains(c))
    {
        return Err(
            fields.unsupported(format!("has only 2 axes in space ('kinds' is {}); a volume needs 3", quote(&kinds)))
        );
    }
    Ok(Axes { dims: [sizes[0], sizes[1], sizes[2]], spatial, count, channels: 1, stride: 1, steps: Steps::ONE })
}

/// Which of four axes is not one of space: what the header says of directions or kinds, or else the one of at most 4 samples.
fn channel_axis(fields: &Fields, sizes: &[usize]) -> Result<usize, IoError> {
    let only = |found: Vec<usize>| if let [one] = found[..] { Some(one) } else { None };
    let positions = |test: &dyn Fn(usize) -> bool| only((0..sizes.len()).filter(|&i| test(i)).collect());
    if let Some(directions) = fields.get("space directions") {
        let vectors = vectors(fields, directions, sizes.len())?;
        return positions(&|i| vectors[i].is_none()).ok_or_else(|| {
            fields.bad("space directions", directions, "3 vectors of 3 numbers, and 'none' for the axis of channels")
        });
    }
    let kinds: Vec<String> =
        fields.get("kinds").unwrap_or_default().split_whitespace().map(str::to_ascii_lowercase).collect();
    let by_kind = (kinds.len() == sizes.len())
        .then(|| positions(&|i| !matches!(kinds[i].as_str(), "domain" | "space" | "???" | "none")))
        .flatten();
    by_kind.or_else(|| positions(&|i| (1..=4).contains(&sizes[i]))).ok_or_else(|| {
        fields.unsupported(
            "has 4 axes and does not say which one holds channels; 'kinds' must name it, such as 'vector domain domain domain'",
        )
    })
}

/// One entry per axis: a vector, or nothing for `none`.
fn vectors(fields: &Fields, text: &str, count: usize) -> Result<Vec<Option<DVec3>>, IoError> {
    let bad = || fields.bad("space directions", text, &format!("{count} vectors such as (1,0,0), or 'none'"));
    let mut rest = text.trim_start();
    let mut found = Vec::new();
    while !rest.is_empty() && found.len() <= count {
        if let Some(inner) = rest.strip_prefix('(') {
            let (vector, after) = inner.split_once(')').ok_or_else(bad)?;
            found.push(Some(vector3(vector).ok_or_else(bad)?));
            rest = after.trim_start();
        } else {
            let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
            if !rest[..end].eq_ignore_ascii_case("none") {
                return Err(bad());
            }
            found.push(None);
            rest = rest[end..].trim_start();
        }
    }
    if found.len() == count { Ok(found) } else { Err(bad()) }
}

/// Three numbers with commas between.
fn vector3(text: &str) -> Option<DVec3> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    <[f64; 3]>::try_from(numbers?).ok().map(DVec3::from_array)
}

fn frame(fields: &Fields, axes: &Axes) -> Result<(DMat3, DVec3, Space), IoError> {
    let (space, flip) = space(fields)?;
    let Some(directions) = fields.get("space directions") else {
        let (spacing, origin) = plain_frame(fields, axes)?;
        return Ok((DMat3::from_diagonal(flip * spacing), flip * origin, space));
    };
    let vectors = vectors(fields, directions, axes.count)?;
    let column = |i: usize| {
        vectors[axes.spatial[i]]
            .ok_or_else(|| fields.bad("space directions", directions, "a vector of 3 numbers for each axis of space"))
    };
    let world = DMat3::from_cols(column(0)?, column(1)?, column(2)?);
    let origin = match fields.get("space origin") {
        None => DVec3::ZERO,
        Some(text) => text
            .strip_prefix('(')
            .and_then(|t| t.strip_suffix(')'))
            .and_then(vector3)
            .ok_or_else(|| fields.bad("space origin", text, "3 numbers such as (0,0,0)"))?,
    };
    Ok((DMat3::from_diagonal(flip) * world, flip * origin, space))
}

/// The space and the signs that bring coordinates into it.
fn space(fields: &Fields) -> Result<(Space, DVec3), IoError> {
    if let Some(text) = fields.get("space dimension")
        && fields.numbers::<u32>("space dimension", text, 1)? != [3]
    {
        return Err(fields.unsupported(format!("lies in a space of {} dimensions; Voxclay needs 3", quote(text))));
    }
    let Some(name) = fields.get("space") else { return Ok((Space::Unknown, DVec3::ONE)) };
    Ok(match name.to_ascii_lowercase().as_str() {
        "right-anterior-superior" | "ras" => (Space::Ras, DVec3::ONE),
        "left-posterior-superior" | "lps" => (Space::Lps, DVec3::ONE),
        "left-anterior-superior" | "las" => (Space::Ras, DVec3::new(-1.0, 1.0, 1.0)),
        n if n.ends_with("-time") || (n.len() == 4 && n.ends_with('t')) => {
            return Err(
                fields.unsupported(format!("lies in the space {} with time; Voxclay needs one of 3 axes", quote(name)))
            );
        }
        _ => (Space::Unknown, DVec3::ONE),
    })
}

/// Spacing and origin where no directions are given.
fn plain_frame(fields: &Fields, axes: &Axes) -> Result<(DVec3, DVec3), IoError> {
    let list = |names: &[&'static str]| -> Result<Option<Vec<f64>>, IoError> {
        let Some((name, text)) = fields.any(names) else { return Ok(None) };
        let all: Vec<f64> = fields.numbers(name, text, axes.count)?;
        Ok(Some(axes.spatial.iter().map(|&i| all[i]).collect()))
    };
    // NaN stands for "not known"
    let known = |values: &Option<Vec<f64>>, i: usize| values.as_ref().map(|v| v[i]).filter(|v| !v.is_nan());
    let (spacings, mins, maxs) = (list(&["spacings"])?, list(&["axis mins"])?, list(&["axis maxs"])?);
    let centers: Vec<&str> =
        fields.any(&["centers", "centerings"]).map(|(_, t)| t.split_whitespace().collect()).unwrap_or_default();
    let (mut spacing, mut origin) = (DVec3::ONE, DVec3::ZERO);
    for i in 0..3 {
        let node = centers.get(axes.spatial[i]).is_some_and(|c| c.eq_ignore_ascii_case("node"));
        let steps = if node { axes.dims[i].saturating_sub(1).max(1) } else { axes.dims[i].max(1) };
        let from_ends = || Some((known(&maxs, i)? - known(&mins, i)?) / steps as f64);
        spacing[i] = known(&spacings, i).or_else(from_ends).unwrap_or(1.0);
        origin[i] = known(&mins, i).map_or(0.0, |min| if node { min } else { min + 0.5 * spacing[i] });
    }
    Ok((spacing, origin))
}

fn scalar(fields: &Fields) -> Result<ScalarType, IoError> {
    let name = fields.require("type")?;
    let words: Vec<String> = name.split_whitespace().map(str::to_ascii_lowercase).collect();
    Ok(match words.join(" ").as_str() {
        "signed char" | "int8" | "int8_t" => ScalarType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => ScalarType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => ScalarType::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => ScalarType::U16,
        "int" | "signed int" | "int32" | "int32_t" => ScalarType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => ScalarType::U32,
        "float" => ScalarType::F32,
        "double" => ScalarType::F64,
        _ => {
            return Err(fields.unsupported(format!(
                "its samples are of type {}; Voxclay reads 8, 16 and 32-bit integers, float and double",
                quote(name)
            )));
        }
    })
}

/// The data file, where the samples begin in it, and the bytes to skip after decoding.
fn data(fields: &Fields, attached: u64, coding: Coding) -> Result<(std::path::PathBuf, Start, u64), IoError> {
    let path = match fields.get("data file") {
        None => fields.path.clone(),
        Some(name) => {
            let first = name.split_whitespace().next().unwrap_or_default();
            let pattern = name.contains('%') && name.split_whitespace().count() > 1;
            if first.eq_ignore_ascii_case("list") || pattern {
                return Err(
                    fields.unsupported("keeps its samples in several data files; join them into one file first")
                );
            }
            bytes::detached(&fields.path, name)?
        }
    };
    let mut start = if path == fields.path { attached } else { 0 };
    if let Some((name, text)) = fields.any(&["line skip"]) {
        let lines = fields.numbers::<u64>(name, text, 1)?[0];
        start = after_lines(&path, start, lines)?;
    }
    let skip: i64 = match fields.any(&["byte skip"]) {
        Some((name, text)) => fields.numbers(name, text, 1)?[0],
        None => 0,
    };
    match (skip, coding) {
        (-1, Coding::Raw) => Ok((path, Start::Tail(None), 0)),
        (0.., Coding::Text) => Ok((path, Start::At(start.saturating_add(skip as u64)), 0)),
        (0.., _) => Ok((path, Start::At(start), skip as u64)),
        _ => Err(fields.bad("byte skip", &skip.to_string(), "a number of bytes, or -1 where the encoding is raw")),
    }
}

/// The position behind `count` lines that begin at `start`.
fn after_lines(path: &Path, start: u64, count: u64) -> Result<u64, IoError> {
    let fail = |e| IoError::system(path, "read", e);
    let mut file = File::open(path).map_err(fail)?;
    file.seek(SeekFrom::Start(start)).map_err(fail)?;
    let mut reader = BufReader::new(file);
    let mut at = start;
    for _ in 0..count {
        let passed = reader.skip_until(b'\n').map_err(fail)?;
        if passed == 0 {
            return Err(IoError::malformed(
                path,
                format!("has fewer than the {count} lines that 'line skip' passes over"),
            ));
        }
        at += passed as u64;
    }
    Ok(at)
}

fn rescale(pairs: &Fields) -> Result<Rescale, IoError> {
    let mut rescale = Rescale::default();
    for (name, value) in [("rescale slope", &mut rescale.slope), ("rescale intercept", &mut rescale.intercept)] {
        if let Some(text) = pairs.get(name) {
            *value = pairs.numbers(name, text, 1)?[0];
        }
    }
    if rescale.slope == 0.0 || !rescale.slope.is_finite() || !rescale.intercept.is_finite() {
        return Err(pairs.wrong(
            "its pair 'rescale slope' is zero or not finite; it must be a number by which samples can be scaled",
        ));
    }
    Ok(rescale)
}

/// Writes a `.nrrd`, or a `.nhdr` with its samples beside it (`NAME.raw`, `NAME.raw.gz` or `NAME.txt`).
///
/// # Errors
/// If a file cannot be written; what was there before is left.
pub fn write(path: &Path, volume: &Volume, options: &WriteOptions) -> Result<(), IoError> {
    let (encoding, ending) = match options.encoding {
        Encoding::Raw => ("raw", "raw"),
        Encoding::Compressed => ("gzip", "raw.gz"),
        Encoding::Text => ("text", "txt"),
    };
    let detached = store::ends_with(path, ".nhdr");
    let data = store::beside(path, ending)?;
    let mut text = header_text(volume, encoding);
    if detached {
        text.push_str(&format!("data file: {}\n", store::file_name(&data)));
    } else {
        text.push('\n');
    }
    let body = Body::new(volume, options.encoding, Wrapper::Gzip);
    if detached {
        store::write_pair(path, text.as_bytes(), &data, |w| body.write(w))
    } else {
        write_atomic(path, |w| {
            std::io::Write::write_all(w, text.as_bytes())?;
            body.write(w)
        })
    }
}

fn header_text(volume: &Volume, encoding: &str) -> String {
    let grid = &volume.grid;
    let kind = match volume.samples.scalar_type() {
        ScalarType::U8 => "unsigned char",
        ScalarType::I8 => "signed char",
        ScalarType::U16 => "unsigned short",
        ScalarType::I16 => "short",
        ScalarType::U32 => "unsigned int",
        ScalarType::I32 => "int",
        ScalarType::F32 => "float",
        ScalarType::F64 => "double",
    };
    let space = match grid.space {
        Space::Unknown => "space dimension: 3",
        Space::Ras => "space: right-anterior-superior",
        Space::Lps => "space: left-posterior-superior",
    };
    // an axis of channels comes first
    let (dimension, size, none, kinds) = match volume.channels {
        1 => (3, String::new(), "", ""),
        n => (4, format!("{n} "), "none ", if n == 4 { "RGBA-color " } else { "vector " }),
    };
    let vector = |v: DVec3| format!("({:?},{:?},{:?})", v.x, v.y, v.z);
    let m = grid.world_from_voxel.matrix3;
    let [x, y, z] = grid.dims;
    let mut text = format!(
        "NRRD0004\ntype: {kind}\ndimension: {dimension}\n{space}\nsizes: {size}{x} {y} {z}\n\
         space directions: {none}{} {} {}\nkinds: {kinds}domain domain domain\nendian: little\nencoding: {encoding}\n\
         space origin: {}\n",
        vector(m.x_axis),
        vector(m.y_axis),
        vector(m.z_axis),
        vector(grid.origin())
    );
    if volume.rescale != Rescale::default() {
        let Rescale { slope, intercept } = volume.rescale;
        text.push_str(&format!("rescale slope:={slope:?}\nrescale intercept:={intercept:?}\n"));
    }
    text
}

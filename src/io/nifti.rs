//! NIfTI-1: `.nii`, `.nii.gz`, and the pair `.hdr` with `.img`.
//!
//! # Theory
//!
//! After `nifti1.h` (Cox and others, 2007): a binary header of 348 bytes in either byte order, told by its first number.
//! The world is RAS. Voxel to world is, in this order: the `sform`, a matrix, if its code is above 0; the `qform`, a
//! rotation as a quaternion with voxel sizes and `qfac`, if its code is above 0; else the voxel sizes alone, which leaves
//! the space unknown. Real values are `scl_slope * stored + scl_inter` unless the slope is 0.
//!
//! # Practice
//!
//! Read: the eight sample types, RGB24 and RGBA32 as channels of u8, a fifth dimension of 2 to 4 as channels, and a fourth as
//! steps in time. Refused with a sentence: both at once, 64-bit integers, 128-bit floats, complex numbers, NIfTI-2, ANALYZE.
//!
//! Written: `.nii` and `.nii.gz`, little endian, with both forms set where the axes are orthogonal. The format keeps frame,
//! slope and intercept as `f32`, so a frame comes back to 6e-8 of its largest entry; samples are exact. Volumes in LPS are
//! turned to RAS; of an unknown space they are written as they are.

use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;
use glam::{DMat3, DQuat, DVec3};

use super::bytes::{self, Block, ByteOrder, Coding, Plan, Start};
use super::deflate::{Wrapper, write_deflated};
use super::header;
use super::steps::Steps;
use super::store::ends_with;
use super::volume::{Encoding, WriteOptions};
use super::{IoError, write_atomic};
use crate::volume::{Rescale, ScalarType, Space, Volume};

/// Bytes of the header.
const HEADER: usize = 348;
/// Where samples begin in the files written here: the header, and four bytes that say that no extension follows.
const DATA: usize = 352;

/// Whether a file begins like a NIfTI header.
pub(super) fn looks_like(head: &[u8]) -> bool {
    head.len() >= HEADER && matches!(&head[344..348], b"n+1\0" | b"ni1\0")
}

/// Reads a NIfTI-1 file, or a pair named by either of its two; of a series its first step.
///
/// # Errors
/// If the file cannot be read, is not sound, or holds something else than a volume of 1 to 4 channels.
pub fn read(path: &Path) -> Result<Volume, IoError> {
    plan(path)?.load()
}

/// The header in numbers.
struct Header {
    bytes: [u8; HEADER],
    order: ByteOrder,
}

impl Header {
    fn i16(&self, at: usize) -> i16 {
        let b = [self.bytes[at], self.bytes[at + 1]];
        match self.order {
            ByteOrder::Little => i16::from_le_bytes(b),
            ByteOrder::Big => i16::from_be_bytes(b),
        }
    }

    fn f32(&self, at: usize) -> f64 {
        let b = std::array::from_fn(|i| self.bytes[at + i]);
        f64::from(match self.order {
            ByteOrder::Little => f32::from_le_bytes(b),
            ByteOrder::Big => f32::from_be_bytes(b),
        })
    }

    fn vec3(&self, at: usize) -> DVec3 {
        DVec3::new(self.f32(at), self.f32(at + 4), self.f32(at + 8))
    }
}

/// Reads the header.
pub(super) fn plan(path: &Path) -> Result<Plan, IoError> {
    let header_path = other_half(path, ".img", ".hdr").unwrap_or_else(|| path.to_owned());
    let path = header_path.as_path();
    let (header, gzip) = read_header(path)?;
    let single = match &header.bytes[344..348] {
        b"n+1\0" => true,
        b"ni1\0" => false,
        _ => {
            return Err(IoError::unsupported(
                path,
                "has no NIfTI mark in its header, so it may be ANALYZE, which does not say how it lies in space; convert it to NIfTI-1",
            ));
        }
    };
    let (dims, vectors, steps) = dimensions(path, &header)?;
    let (scalar, colors) = scalar(path, header.i16(70))?;
    if vectors > 1 && colors > 1 {
        return Err(IoError::unsupported(path, "has vectors of colours; Voxclay reads 1 to 4 channels in a voxel"));
    }
    let (world, origin, space) = frame(path, &header)?;
    let grid = header::grid(path, dims, world, origin, space)?;

    let offset = header.f32(108);
    let least = if single { DATA as f64 } else { 0.0 };
    if !(offset.is_finite() && offset.fract() == 0.0 && (0.0..1e15).contains(&offset)) {
        return Err(IoError::malformed(
            path,
            format!("its field vox_offset is {offset}; it must be a number of bytes, {least} or more"),
        ));
    }
    // 0 is common, and means that the samples follow the header
    let offset = offset.max(least) as u64;
    let (data_path, gzip) = if single {
        (path.to_owned(), gzip)
    } else {
        let data =
            other_half(path, ".hdr", ".img").filter(|p| p.exists()).or_else(|| other_half(path, ".hdr", ".img.gz"));
        let data = data.filter(|p| p.exists()).ok_or_else(|| {
            IoError::malformed(path, "is the header of a pair, and there is no .img file of the same name beside it")
        })?;
        let gzip = is_gzip(&data)?;
        (data, gzip)
    };
    let (coding, start, skip) =
        if gzip { (Coding::Gzip, Start::At(0), offset) } else { (Coding::Raw, Start::At(offset), 0) };
    let block = Block { path: data_path, start, coding, skip, order: header.order, scalar };
    let channels = vectors.max(colors);
    let channel_stride = if vectors > 1 { grid.len() } else { 1 };
    let rescale = rescale(path, &header, colors > 1)?;
    let steps = Steps { count: steps, run: None };
    Ok(Plan { grid, channels, channel_stride, rescale, steps, block })
}

/// The file of the same name with another ending, if this one ends in `from` (and perhaps `.gz`).
fn other_half(path: &Path, from: &str, to: &str) -> Option<PathBuf> {
    let bare = if ends_with(path, ".gz") { path.with_extension("") } else { path.to_owned() };
    ends_with(&bare, from).then(|| bare.with_extension(&to[1..]))
}

fn is_gzip(path: &Path) -> Result<bool, IoError> {
    let mut start = Vec::new();
    let (file, _) = bytes::open(path)?;
    file.take(2).read_to_end(&mut start).map_err(|e| IoError::system(path, "read", e))?;
    Ok(start == [0x1f, 0x8b])
}

/// The header, and whether the file is compressed (its name does not count).
fn read_header(path: &Path) -> Result<(Header, bool), IoError> {
    let gzip = is_gzip(path)?;
    let file = File::open(path).map_err(|e| IoError::system(path, "open", e))?;
    let mut source: Box<dyn Read> =
        if gzip { Box::new(MultiGzDecoder::new(BufReader::new(file))) } else { Box::new(file) };
    let mut header = Header { bytes: [0; HEADER], order: ByteOrder::Little };
    source.read_exact(&mut header.bytes).map_err(|e| match e.kind() {
        io::ErrorKind::UnexpectedEof => {
            IoError::malformed(path, format!("ends within its header; a NIfTI-1 header takes {HEADER} bytes"))
        }
        io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput => {
            IoError::malformed(path, format!("its compressed data are damaged ({e})"))
        }
        _ => IoError::system(path, "read", e),
    })?;
    let first = [header.bytes[0], header.bytes[1], header.bytes[2], header.bytes[3]];
    header.order = match (u32::from_le_bytes(first), u32::from_be_bytes(first)) {
        (348, _) => ByteOrder::Little,
        (_, 348) => ByteOrder::Big,
        (540, _) | (_, 540) => {
            return Err(IoError::unsupported(path, "is a NIfTI-2 file; Voxclay reads NIfTI-1, so convert it first"));
        }
        _ => return Err(IoError::malformed(path, "does not begin with the number 348, so it is not a NIfTI-1 file")),
    };
    Ok((header, gzip))
}

/// Voxels along i, j, k, values in each voxel, and steps in time.
fn dimensions(path: &Path, header: &Header) -> Result<([usize; 3], usize, usize), IoError> {
    let count = header.i16(40);
    if !(1..=7).contains(&count) {
        return Err(IoError::malformed(path, format!("says that it has {count} dimensions; they must be 1 to 7")));
    }
    let mut sizes = [1usize; 8];
    for (i, size) in sizes.iter_mut().enumerate().take(count as usize + 1).skip(1) {
        let n = header.i16(40 + 2 * i);
        *size = usize::try_from(n).ok().filter(|&n| n > 0).ok_or_else(|| {
            IoError::malformed(path, format!("its dimension {i} is {n}; every size must be at least 1"))
        })?;
    }
    if sizes[5] > 4 || sizes[6] > 1 || sizes[7] > 1 {
        return Err(IoError::unsupported(
            path,
            format!("holds {} values in each voxel; Voxclay reads 1 to 4", sizes[5] * sizes[6] * sizes[7]),
        ));
    }
    if sizes[4] > 1 && sizes[5] > 1 {
        return Err(IoError::unsupported(
            path,
            "is a series in time of vectors; Voxclay reads series of one value or colour in each voxel",
        ));
    }
    Ok(([sizes[1], sizes[2], sizes[3]], sizes[5], sizes[4]))
}

/// The sample type, and how many of it make one value.
fn scalar(path: &Path, code: i16) -> Result<(ScalarType, usize), IoError> {
    let refused = match code {
        2 => return Ok((ScalarType::U8, 1)),
        4 => return Ok((ScalarType::I16, 1)),
        8 => return Ok((ScalarType::I32, 1)),
        16 => return Ok((ScalarType::F32, 1)),
        64 => return Ok((ScalarType::F64, 1)),
        128 => return Ok((ScalarType::U8, 3)),
        256 => return Ok((ScalarType::I8, 1)),
        512 => return Ok((ScalarType::U16, 1)),
        768 => return Ok((ScalarType::U32, 1)),
        2304 => return Ok((ScalarType::U8, 4)),
        1 => "single bits",
        32 | 1792 | 2048 => "complex numbers",
        1024 => "signed 64-bit integers",
        1280 => "unsigned 64-bit integers",
        1536 => "128-bit floats",
        _ => return Err(IoError::malformed(path, format!("its datatype is {code}, which NIfTI-1 does not define"))),
    };
    Err(IoError::unsupported(
        path,
        format!("its samples are {refused}; Voxclay reads 8, 16 and 32-bit integers, float, double, RGB and RGBA"),
    ))
}

fn frame(path: &Path, header: &Header) -> Result<(DMat3, DVec3, Space), IoError> {
    if header.i16(254) > 0 {
        let (x, y, z) = (header.vec3(280), header.vec3(296), header.vec3(312));
        let origin = DVec3::new(header.f32(292), header.f32(308), header.f32(324));
        return Ok((DMat3::from_cols(x, y, z).transpose(), origin, Space::Ras));
    }
    let mut spacing = header.vec3(80);
    // sizes of axes beyond the file's dimensions are not said
    for i in usize::try_from(header.i16(40)).unwrap_or(3)..3 {
        spacing[i] = 1.0;
    }
    if !spacing.cmpgt(DVec3::ZERO).all() {
        return Err(IoError::malformed(
            path,
            format!("its voxel size is {} x {} x {}; each must be above 0", spacing.x, spacing.y, spacing.z),
        ));
    }
    if header.i16(252) <= 0 {
        return Ok((DMat3::from_diagonal(spacing), DVec3::ZERO, Space::Unknown));
    }
    let v = header.vec3(256);
    let rest = 1.0 - v.length_squared();
    // nearly half a turn: a is lost in the rounding of b, c, d
    let q =
        if rest < 1e-7 { DQuat::from_xyzw(v.x, v.y, v.z, 0.0) } else { DQuat::from_xyzw(v.x, v.y, v.z, rest.sqrt()) };
    let qfac = if header.f32(76) < 0.0 { -1.0 } else { 1.0 };
    let rotation = DMat3::from_quat(q.normalize());
    Ok((rotation * DMat3::from_diagonal(spacing * DVec3::new(1.0, 1.0, qfac)), header.vec3(268), Space::Ras))
}

fn rescale(path: &Path, header: &Header, colors: bool) -> Result<Rescale, IoError> {
    let (slope, intercept) = (header.f32(112), header.f32(116));
    if colors || slope == 0.0 || !slope.is_finite() {
        return Ok(Rescale::default());
    }
    if !intercept.is_finite() {
        return Err(IoError::malformed(path, format!("its field scl_inter is {intercept}; it must be a number")));
    }
    Ok(Rescale { slope, intercept })
}

/// Writes a `.nii` or `.nii.gz` file.
///
/// # Errors
/// If a size is above 32767, text is asked for, or the file cannot be written.
pub fn write(path: &Path, volume: &Volume, options: &WriteOptions) -> Result<(), IoError> {
    if options.encoding == Encoding::Text {
        return Err(IoError::unsupported(
            path,
            "NIfTI cannot be written as text; use .nrrd or .mha, or another encoding",
        ));
    }
    // colours have no slope, so a rescaled volume goes as vectors
    let colors =
        volume.channels >= 3 && volume.samples.scalar_type() == ScalarType::U8 && volume.rescale == Rescale::default();
    let header = header_bytes(path, volume, colors)?;
    let turned;
    let samples = if volume.channels > 1 && !colors {
        turned = bytes::planar(&volume.samples, volume.channels);
        &turned
    } else {
        &volume.samples
    };
    let data = bytes::little_endian(samples);
    write_atomic(path, |w| {
        if ends_with(path, ".gz") {
            write_deflated(w, &[&header, &data], Wrapper::Gzip)
        } else {
            w.write_all(&header)?;
            w.write_all(&data)
        }
    })
}

fn header_bytes(path: &Path, volume: &Volume, colors: bool) -> Result<[u8; DATA], IoError> {
    let grid = volume.grid.in_space(Space::Ras);
    let mut h = [0u8; DATA];
    let mut put = |at: usize, bytes: &[u8]| h[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348i32.to_le_bytes());
    put(38, b"r");
    let vectors = if colors { 1 } else { volume.channels };
    let mut dim = [1i16; 8];
    dim[0] = if vectors > 1 { 5 } else { 3 };
    dim[5] = vectors as i16;
    for (d, &n) in dim[1..4].iter_mut().zip(&grid.dims) {
        *d = i16::try_from(n).map_err(|_| {
            IoError::unsupported(
                path,
                format!("NIfTI-1 holds at most 32767 voxels along an axis, not {n}; use .nrrd or .mha"),
            )
        })?;
    }
    for (i, d) in dim.iter().enumerate() {
        put(40 + 2 * i, &d.to_le_bytes());
    }
    if vectors > 1 {
        put(68, &1007i16.to_le_bytes());
    }
    let code: i16 = match (volume.samples.scalar_type(), colors, volume.channels) {
        (_, true, 3) => 128,
        (_, true, _) => 2304,
        (ScalarType::U8, ..) => 2,
        (ScalarType::I16, ..) => 4,
        (ScalarType::I32, ..) => 8,
        (ScalarType::F32, ..) => 16,
        (ScalarType::F64, ..) => 64,
        (ScalarType::I8, ..) => 256,
        (ScalarType::U16, ..) => 512,
        (ScalarType::U32, ..) => 768,
    };
    put(70, &code.to_le_bytes());
    let bits = 8 * volume.samples.scalar_type().bytes() * if colors { volume.channels } else { 1 };
    put(72, &(bits as i16).to_le_bytes());

    let (spacing, mut rotation) = header::spacing_and_direction(&grid);
    let qfac = if rotation.determinant() < 0.0 { -1.0 } else { 1.0 };
    rotation.z_axis *= qfac;
    let sizes = [qfac, spacing.x, spacing.y, spacing.z, 1.0, 1.0, 1.0, 1.0];
    let mut fits = true;
    let mut put_f32 = |at: usize, values: &[f64]| {
        for (i, &v) in values.iter().enumerate() {
            let single = v as f32;
            fits &= single.is_finite() && (single != 0.0 || v.abs() < 1e-300);
            put(at + 4 * i, &single.to_le_bytes());
        }
    };
    put_f32(76, &sizes);
    put_f32(108, &[DATA as f64, volume.rescale.slope, volume.rescale.intercept]);
    let m = grid.world_from_voxel.matrix3.transpose();
    let o = grid.origin();
    let orthogonal = (rotation.transpose() * rotation).abs_diff_eq(DMat3::IDENTITY, 1e-6);
    if orthogonal {
        let q = DQuat::from_mat3(&rotation).normalize();
        let q = if q.w < 0.0 { -q } else { q };
        put_f32(256, &[q.x, q.y, q.z, o.x, o.y, o.z]);
    }
    for (at, row, offset) in [(280, m.x_axis, o.x), (296, m.y_axis, o.y), (312, m.z_axis, o.z)] {
        put_f32(at, &[row.x, row.y, row.z, offset]);
    }
    if !fits {
        return Err(IoError::unsupported(
            path,
            "NIfTI-1 holds the frame and the slope as 32-bit floats, which are too small for this volume; use .nrrd or .mha",
        ));
    }
    // millimetres, as a patient's space is
    put(123, &[if volume.grid.space == Space::Unknown { 0 } else { 2 }]);
    put(148, b"Voxclay");
    // 1: coordinates of the scanner; 2: aligned to something else
    let form = if volume.grid.space == Space::Unknown { 2i16 } else { 1 };
    put(252, &(if orthogonal { form } else { 0 }).to_le_bytes());
    put(254, &form.to_le_bytes());
    put(344, b"n+1\0");
    Ok(h)
}

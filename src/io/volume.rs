//! Volume files of any format, told apart by name and content.

use std::io::Read;
use std::path::Path;

use super::bytes::{self, Plan};
use super::store::{ends_with, file_name};
use super::tets::{extension, read_whole};
use super::{IoError, metaimage, nifti, nrrd, raw, vti, vtk};
use crate::volume::{Grid, Volume};

/// How samples are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Encoding {
    /// As they are in memory, little endian.
    Raw,
    /// Deflated.
    #[default]
    Compressed,
    /// As decimal numbers (NRRD and MetaImage). NaNs lose their payload, nothing else.
    Text,
}

/// Choices for [`write_volume`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct WriteOptions {
    /// For NRRD and MetaImage. NIfTI is compressed where its name ends in `.gz`, `.raw` never.
    pub encoding: Encoding,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Nrrd,
    Nifti,
    MetaImage,
    Raw,
}

const ENDINGS: [(&str, Format); 12] = [
    (".nrrd", Format::Nrrd),
    (".nhdr", Format::Nrrd),
    (".nii", Format::Nifti),
    (".nii.gz", Format::Nifti),
    (".hdr", Format::Nifti),
    (".hdr.gz", Format::Nifti),
    (".img", Format::Nifti),
    (".img.gz", Format::Nifti),
    (".mha", Format::MetaImage),
    (".mhd", Format::MetaImage),
    (".raw", Format::Raw),
    (".json", Format::Raw),
];

fn by_name(path: &Path) -> Option<Format> {
    ENDINGS.iter().find(|(ending, _)| ends_with(path, ending)).map(|(_, format)| *format)
}

/// Whether the name is one that volumes are read and written by: `.nrrd .nhdr .nii .nii.gz .hdr .img .mha .mhd .raw .json`. Of these, `.json`
/// may be something else too: a grid ([`read_grid`]), or no volume at all. VTK's `.vti` and `.vtk` are only read (see
/// [`super::kind_of`]).
pub fn is_volume_path(path: &Path) -> bool {
    by_name(path).is_some()
}

/// What the content shows, for the formats that say so.
fn by_content(path: &Path) -> Result<Option<Format>, IoError> {
    let (file, _) = bytes::open(path)?;
    let mut head = Vec::new();
    file.take(1024).read_to_end(&mut head).map_err(|e| IoError::system(path, "read", e))?;
    if head.starts_with(b"NRRD") {
        return Ok(Some(Format::Nrrd));
    }
    if head.starts_with(&[0x1f, 0x8b]) || nifti::looks_like(&head) {
        return Ok(Some(Format::Nifti));
    }
    let text = String::from_utf8_lossy(&head);
    let metaimage = text.contains("NDims") && text.lines().next().is_some_and(|l| l.contains('='));
    Ok(metaimage.then_some(Format::MetaImage))
}

fn format_of(path: &Path) -> Result<Format, IoError> {
    let named = by_name(path);
    match named {
        // a raw file may begin with any bytes, and half of a pair need not say what it is
        Some(Format::Raw) => return Ok(Format::Raw),
        Some(Format::Nifti) if ends_with(path, ".img") || ends_with(path, ".img.gz") => return Ok(Format::Nifti),
        _ => {}
    }
    by_content(path)?.or(named).ok_or_else(|| {
        IoError::unsupported(
            path,
            "is not a volume that Voxclay knows; it reads .nrrd, .nhdr, .nii, .nii.gz, .hdr with .img, .mha, .mhd, .raw with .json, .vti and .vtk",
        )
    })
}

pub(super) fn plan(path: &Path) -> Result<Plan, IoError> {
    match format_of(path)? {
        Format::Nrrd => nrrd::plan(path),
        Format::Nifti => nifti::plan(path),
        Format::MetaImage => metaimage::plan(path),
        Format::Raw => raw::plan(path),
    }
}

/// Reads a volume of any format; of a series in time its first step (see [`super::Series`]).
///
/// # Errors
/// If the file cannot be read, is not sound, or holds what a [`Volume`] cannot.
pub fn read_volume(path: &Path) -> Result<Volume, IoError> {
    match extension(path).as_deref() {
        Some("vti") => vti::parse(path, &read_whole(path)?),
        Some("vtk") => vtk::parse_volume(path, &read_whole(path)?),
        _ => plan(path)?.load(),
    }
}

/// Reads the grid of a volume, or of a JSON file that describes a grid without data. Samples are not read.
///
/// # Errors
/// As [`read_volume`].
pub fn read_grid(path: &Path) -> Result<Grid, IoError> {
    match extension(path).as_deref() {
        Some("json") => raw::read_grid(path),
        Some("vti") => vti::parse_grid(path, &read_whole(path)?),
        Some("vtk") => Ok(vtk::parse_volume(path, &read_whole(path)?)?.grid),
        _ => Ok(plan(path)?.grid),
    }
}

/// Whether a volume can be written there, as far as the name tells: before work starts.
///
/// # Errors
/// If the name asks for no format that is written, it is a folder, or its folder does not exist.
pub fn check_volume_output(path: &Path) -> Result<(), IoError> {
    if !is_written(path) {
        return Err(unwritten(path));
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let problem = |kind| Err(IoError::system(path, "write", std::io::Error::from(kind)));
    match folder {
        _ if path.is_dir() => problem(std::io::ErrorKind::IsADirectory),
        Some(folder) if !folder.is_dir() => problem(std::io::ErrorKind::NotFound),
        _ => Ok(()),
    }
}

/// Halves of pairs (Analyze, NIfTI) are only read.
fn is_written(path: &Path) -> bool {
    match by_name(path) {
        Some(Format::Nifti) => ends_with(path, ".nii") || ends_with(path, ".nii.gz"),
        Some(Format::Nrrd | Format::MetaImage | Format::Raw) => true,
        None => false,
    }
}

fn unwritten(path: &Path) -> IoError {
    let name = file_name(path);
    let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending);
    IoError::unsupported(
        path,
        format!(
            "cannot be written as a volume; expected a name that ends in .nrrd, .nhdr, .nii, .nii.gz, .mha, .mhd, .raw or .json, not {}",
            bytes::quote(ending)
        ),
    )
}

/// Writes a volume in the format that the file's name asks for.
///
/// # Errors
/// If the name asks for no known format, the format cannot hold the volume, or a file cannot be written; then whatever was
/// there before is left as it was.
pub fn write_volume(path: &Path, volume: &Volume, options: &WriteOptions) -> Result<(), IoError> {
    match by_name(path) {
        Some(Format::Nrrd) => nrrd::write(path, volume, options),
        Some(Format::Nifti) if is_written(path) => nifti::write(path, volume, options),
        Some(Format::MetaImage) => metaimage::write(path, volume, options),
        Some(Format::Raw) => raw::write(path, volume, options),
        Some(Format::Nifti) | None => Err(unwritten(path)),
    }
}

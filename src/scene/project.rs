//! The project file.
//!
//! # Version 2: a zip archive
//!
//! | entry | what |
//! |---|---|
//! | `voxclay.json` | `{"voxclay": 2, "checksum": N, "document": {...}}`; the checksum is [`Volume::checksum`]'s, or absent |
//! | `thumbnail.png` | a small picture of the object, if there is one |
//! | `volume.nrrd` | the samples, if they were embedded |
//!
//! # Version 1: plain JSON
//!
//! `{"voxclay": 1, "document": {...}}`, for scripts; still read.
//!
//! Volumes and meshes are kept by path, relative to the file's folder where they lie below it.

use std::fs::File;
use std::io::{BufReader, Read, Seek, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::{Document, VolumeSource};
use crate::io::{self, IoError};
use crate::volume::Volume;

/// The version this program writes.
const VERSION: u32 = 2;
/// No honest document is larger; volumes are not inside.
const LARGEST: u64 = 64 << 20;
const DOCUMENT: &str = "voxclay.json";
const THUMBNAIL: &str = "thumbnail.png";
const SAMPLES: &str = "volume.nrrd";

/// Why a project could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ProjectError {
    #[error("{}: cannot {action}: {source}", path.display())]
    System { path: PathBuf, action: &'static str, source: std::io::Error },
    #[error("{}: not a Voxclay project: {what}", path.display())]
    Malformed { path: PathBuf, what: String },
    #[error("{}: written by a newer Voxclay (version {found}); this one reads up to version {VERSION}", path.display())]
    Newer { path: PathBuf, found: u32 },
    #[error("{}: the volume is not inside this project, though it says so", path.display())]
    NoSamples { path: PathBuf },
    #[error(transparent)]
    Volume(#[from] IoError),
}

#[derive(Serialize, Deserialize)]
struct Envelope<D> {
    voxclay: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    checksum: Option<u32>,
    document: D,
}

/// What is in a project file, but for the samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Project {
    pub document: Document,
    /// Of the volume that the document was made for; see [`Volume::checksum`].
    pub checksum: Option<u32>,
    /// A PNG file.
    pub thumbnail: Option<Vec<u8>>,
}

/// What goes into a project file beside the document.
#[derive(Debug, Clone, Copy, Default)]
pub struct Kept<'a> {
    pub checksum: Option<u32>,
    /// A PNG file.
    pub thumbnail: Option<&'a [u8]>,
    /// Samples to embed, of a series those of one step; the document in the file then refers to them.
    pub embed: Option<&'a Volume>,
}

/// Reads a project file of any version.
///
/// # Errors
/// If the file cannot be read, is not a project, or is of a newer version.
pub fn read_project(path: &Path) -> Result<Project, ProjectError> {
    let system = |source| ProjectError::System { path: path.to_owned(), action: "read", source };
    let malformed = |what: String| ProjectError::Malformed { path: path.to_owned(), what };
    let mut file = BufReader::new(File::open(path).map_err(system)?);
    let mut start = Vec::new();
    (&mut file).take(4).read_to_end(&mut start).map_err(system)?;
    file.rewind().map_err(system)?;
    if !start.starts_with(b"PK") {
        return Ok(Project { document: parse(path, &limited(path, file)?)?.document, checksum: None, thumbnail: None });
    }
    let mut zip = ZipArchive::new(file).map_err(|e| malformed(e.to_string()))?;
    let text = entry(path, &mut zip, DOCUMENT)?.ok_or_else(|| malformed(format!("there is no {DOCUMENT} in it")))?;
    let Envelope { mut document, checksum, .. } = parse(path, &text)?;
    if let VolumeSource::Embedded(inside) = &mut document.volume {
        // the file may have been renamed since
        *inside = path.file_name().map(PathBuf::from).unwrap_or_default();
    }
    let thumbnail = entry(path, &mut zip, THUMBNAIL)?;
    Ok(Project { document, checksum, thumbnail })
}

/// Reads the samples inside a project file.
///
/// # Errors
/// If there are none, or they cannot be read.
pub fn read_embedded(path: &Path) -> Result<Volume, ProjectError> {
    let system = |source| ProjectError::System { path: path.to_owned(), action: "read", source };
    let malformed = |what: String| ProjectError::Malformed { path: path.to_owned(), what };
    let file = BufReader::new(File::open(path).map_err(system)?);
    let mut zip = ZipArchive::new(file).map_err(|e| malformed(e.to_string()))?;
    let mut samples = match zip.by_name(SAMPLES) {
        Ok(entry) => entry,
        Err(zip::result::ZipError::FileNotFound) => return Err(ProjectError::NoSamples { path: path.to_owned() }),
        Err(e) => return Err(malformed(e.to_string())),
    };
    // through a file, so that a wrong size costs no memory
    let mut beside = tempfile::Builder::new().suffix(".nrrd").tempfile().map_err(system)?;
    std::io::copy(&mut samples, &mut beside).map_err(system)?;
    beside.flush().map_err(system)?;
    Ok(io::read_volume(beside.path())?)
}

/// Writes a project file (beside, then renamed).
///
/// # Errors
/// If the system cannot write it, or the volume to embed cannot be stored.
pub fn write_project(path: &Path, document: &Document, kept: &Kept<'_>) -> Result<(), ProjectError> {
    let mut document = document.clone();
    let mut samples = None;
    if let Some(volume) = kept.embed {
        let beside = tempfile::Builder::new().suffix(".nrrd").tempfile();
        let beside =
            beside.map_err(|source| ProjectError::System { path: path.to_owned(), action: "write", source })?;
        io::write_volume(beside.path(), volume, &io::WriteOptions::default())?;
        samples = Some(beside);
        // of a series, one step is inside
        document.step = 0;
        document.volume = VolumeSource::Embedded(path.file_name().map(PathBuf::from).unwrap_or_default());
    }
    let envelope = Envelope { voxclay: VERSION, checksum: kept.checksum, document: &document };
    let text = serde_json::to_string_pretty(&envelope)
        .map_err(|e| ProjectError::Malformed { path: path.to_owned(), what: e.to_string() })?;
    let write = |w: &mut std::io::BufWriter<&File>| -> std::io::Result<()> {
        let mut zip = ZipWriter::new(w);
        let packed = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
        let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(true);
        zip.start_file(DOCUMENT, packed)?;
        zip.write_all(text.as_bytes())?;
        if let Some(png) = kept.thumbnail {
            zip.start_file(THUMBNAIL, stored)?;
            zip.write_all(png)?;
        }
        if let Some(beside) = &samples {
            // compressed as a NRRD already
            zip.start_file(SAMPLES, stored)?;
            std::io::copy(&mut File::open(beside.path())?, &mut zip)?;
        }
        zip.finish()?;
        Ok(())
    };
    Ok(io::write_atomic(path, write)?)
}

/// An entry of at most [`LARGEST`] bytes, if there is one of this name.
fn entry(path: &Path, zip: &mut ZipArchive<BufReader<File>>, name: &str) -> Result<Option<Vec<u8>>, ProjectError> {
    match zip.by_name(name) {
        Ok(entry) => limited(path, entry).map(Some),
        Err(zip::result::ZipError::FileNotFound) => Ok(None),
        Err(e) => Err(ProjectError::Malformed { path: path.to_owned(), what: e.to_string() }),
    }
}

/// Everything that is left, if it is not too much. The sizes in an archive are not trusted.
fn limited(path: &Path, from: impl Read) -> Result<Vec<u8>, ProjectError> {
    let mut bytes = Vec::new();
    let system = |source| ProjectError::System { path: path.to_owned(), action: "read", source };
    from.take(LARGEST + 1).read_to_end(&mut bytes).map_err(system)?;
    if bytes.len() as u64 > LARGEST {
        let what = format!("it has more than {LARGEST} bytes, which is more than a document can have");
        return Err(ProjectError::Malformed { path: path.to_owned(), what });
    }
    Ok(bytes)
}

fn parse(path: &Path, text: &[u8]) -> Result<Envelope<Document>, ProjectError> {
    let malformed = |what: String| ProjectError::Malformed { path: path.to_owned(), what };
    let text = std::str::from_utf8(text).map_err(|_| malformed("it is not text; a project is JSON".to_owned()))?;
    let envelope: Envelope<serde_json::Value> = serde_json::from_str(text)
        .map_err(|e| malformed(format!("{e}; expected {{\"voxclay\": 1, \"document\": {{...}}}}")))?;
    if envelope.voxclay > VERSION {
        return Err(ProjectError::Newer { path: path.to_owned(), found: envelope.voxclay });
    }
    let document = serde_json::from_value(envelope.document).map_err(|e| malformed(e.to_string()))?;
    Ok(Envelope { voxclay: envelope.voxclay, checksum: envelope.checksum, document })
}

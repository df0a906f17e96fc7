//! L4: from the document to what is derived from it, on the CPU or the GPU.
//!
//! [`load::load`] brings a document's data into memory, of a series in time ([`series`]) one step, [`geometry`] makes slices of
//! it for a view, [`picture`] draws them, [`pick`] finds what a ray meets, [`section`] cuts through, [`resample`] exports the
//! deformed volume, [`tets`] does both through a lattice of tetrahedra, [`surface`] makes meshes of smooth iso-surfaces, and
//! `smooth` pictures. [`certificate`] says what an export is worth, [`compare`] what each mode is.

pub mod certificate;
mod clip;
pub mod coarser;
pub mod compare;
mod error;
pub mod experiments;
pub mod export;
pub mod geometry;
pub mod heat;
pub mod load;
mod mask;
pub mod masked;
pub mod pick;
pub mod picture;
pub mod resample;
pub mod section;
pub mod series;
mod smooth;
pub mod surface;
pub mod tets;

pub use error::EvaluateError;

use std::path::{Path, PathBuf};

use crate::scene::{self, Document};

/// The document that a word on the command line stands for (a project file, a volume file or `phantom:NAME[:SIZE]`), and
/// the folder that its relative paths start from.
///
/// # Errors
/// If a project cannot be read, or a phantom's name is wrong. A volume file is not opened yet.
pub fn open(word: &str) -> Result<(Document, PathBuf), EvaluateError> {
    let path = Path::new(word);
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("voxclay")) {
        let base = path.parent().map(Path::to_path_buf).unwrap_or_default();
        return Ok((scene::read_project(path)?.document, base));
    }
    let source = load::parse_source(word)?;
    let mut document = Document::new(source);
    load::suggest(&mut document);
    Ok((document, PathBuf::new()))
}

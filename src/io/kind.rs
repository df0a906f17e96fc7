use std::io::Read;
use std::path::Path;

use super::tets::extension;
use super::vtk::{self, Dataset};
use super::{IoError, bytes, is_surface_path, is_tets_path, is_volume_path};

/// What a file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    Volume,
    Surface,
    Tets,
}

/// What kind of file this is, by its name; of a `.vtk` file the beginning is read, because it may be of any kind. `None` if
/// the name is none that is known.
///
/// # Errors
/// If a `.vtk` file cannot be read.
pub fn kind_of(path: &Path) -> Result<Option<FileKind>, IoError> {
    let extension = extension(path);
    if extension.as_deref() == Some("vtk") {
        let (file, _) = bytes::open(path)?;
        let mut head = Vec::new();
        file.take(4096).read_to_end(&mut head).map_err(|e| IoError::system(path, "read", e))?;
        return Ok(Some(match vtk::dataset(&head) {
            Some(Dataset::StructuredPoints) => FileKind::Volume,
            Some(Dataset::PolyData) => FileKind::Surface,
            // what it is instead, its reader will say
            Some(Dataset::UnstructuredGrid) | None => FileKind::Tets,
        }));
    }
    let volume = is_volume_path(path) || extension.as_deref() == Some("vti");
    Ok(if is_surface_path(path) {
        Some(FileKind::Surface)
    } else if is_tets_path(path) {
        Some(FileKind::Tets)
    } else {
        volume.then_some(FileKind::Volume)
    })
}

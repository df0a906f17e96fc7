//! The project file: JSON with a version. Volumes and meshes are kept by path, relative to the file's folder.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::Document;

/// The version this program writes.
const VERSION: u32 = 1;
/// No honest document is larger; volumes are not inside.
const LARGEST: u64 = 64 << 20;

/// Why a project could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ProjectError {
    #[error("{}: cannot {action}: {source}", path.display())]
    System { path: PathBuf, action: &'static str, source: std::io::Error },
    #[error("{}: not a Voxclay project: {what}", path.display())]
    Malformed { path: PathBuf, what: String },
    #[error("{}: written by a newer Voxclay (version {found}); this one reads up to version {VERSION}", path.display())]
    Newer { path: PathBuf, found: u32 },
}

#[derive(Serialize, Deserialize)]
struct Envelope<D> {
    voxclay: u32,
    document: D,
}

/// Reads a project file.
///
/// # Errors
/// If the file cannot be read, is not a project, or is of a newer version.
pub fn read_project(path: &Path) -> Result<Document, ProjectError> {
    let system = |source| ProjectError::System { path: path.to_owned(), action: "read", source };
    let malformed = |what: String| ProjectError::Malformed { path: path.to_owned(), what };
    let size = std::fs::metadata(path).map_err(system)?.len();
    if size > LARGEST {
        return Err(malformed(format!("{size} bytes is more than a document can have ({LARGEST})")));
    }
    let text = std::fs::read_to_string(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::InvalidData => malformed("it is not text; a project is JSON".to_owned()),
        _ => system(e),
    })?;
    let envelope: Envelope<serde_json::Value> = serde_json::from_str(&text)
        .map_err(|e| malformed(format!("{e}; expected {{\"voxclay\": 1, \"document\": {{...}}}}")))?;
    if envelope.voxclay > VERSION {
        return Err(ProjectError::Newer { path: path.to_owned(), found: envelope.voxclay });
    }
    serde_json::from_value(envelope.document).map_err(|e| malformed(e.to_string()))
}

/// Writes a project file (beside, then renamed).
///
/// # Errors
/// If the system cannot write it.
pub fn write_project(path: &Path, document: &Document) -> Result<(), ProjectError> {
    let text = serde_json::to_string_pretty(&Envelope { voxclay: VERSION, document })
        .map_err(|e| ProjectError::Malformed { path: path.to_owned(), what: e.to_string() })?;
    crate::io::write_atomic(path, |w| std::io::Write::write_all(w, text.as_bytes())).map_err(|e| match e {
        crate::io::IoError::System { path, action, source } => ProjectError::System { path, action, source },
        other => ProjectError::Malformed { path: path.to_owned(), what: other.to_string() },
    })
}

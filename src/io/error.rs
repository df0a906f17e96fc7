use std::path::{Path, PathBuf};

/// Why a file could not be read or written. The message is one plain sentence: which file, what is wrong, what would be right.
#[derive(Debug, thiserror::Error)]
pub enum IoError {
    /// The file is at fault.
    #[error("{}: {what}", path.display())]
    Malformed { path: PathBuf, what: String },
    /// The file may be sound, but Voxclay does not do this.
    #[error("{}: {what}", path.display())]
    Unsupported { path: PathBuf, what: String },
    /// The system is at fault (missing file, permission, full disk).
    #[error("{}: cannot {action}: {source}", path.display())]
    System { path: PathBuf, action: &'static str, source: std::io::Error },
    /// A step that a series does not have; a volume that is none has one step.
    #[error("{}: there is no step {step}; {}", path.display(), steps_there(*.steps))]
    NoStep { path: PathBuf, step: usize, steps: usize },
}

fn steps_there(steps: usize) -> String {
    match steps {
        1 => "it is one volume and no series in time, so its only step is 0".to_owned(),
        n => format!("its {n} steps in time are counted from 0 to {}", n - 1),
    }
}

impl IoError {
    pub fn malformed(path: &Path, what: impl Into<String>) -> Self {
        Self::Malformed { path: path.to_owned(), what: what.into() }
    }

    pub fn unsupported(path: &Path, what: impl Into<String>) -> Self {
        Self::Unsupported { path: path.to_owned(), what: what.into() }
    }

    pub fn system(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Self::System { path: path.to_owned(), action, source }
    }
}

/// Why the content of a file is refused, before the file is named.
pub(super) enum Fault {
    Malformed(String),
    Unsupported(String),
}

impl Fault {
    pub fn of(self, path: &Path) -> IoError {
        match self {
            Self::Malformed(what) => IoError::malformed(path, what),
            Self::Unsupported(what) => IoError::unsupported(path, what),
        }
    }
}

impl From<String> for Fault {
    fn from(what: String) -> Self {
        Self::Malformed(what)
    }
}

impl From<&str> for Fault {
    fn from(what: &str) -> Self {
        Self::Malformed(what.to_owned())
    }
}

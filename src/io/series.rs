use std::path::{Path, PathBuf};
use std::sync::Mutex;

use super::steps::Stream;
use super::store::ends_with;
use super::tets::extension;
use super::volume::{plan, read_volume};
use super::{IoError, bytes};
use crate::volume::Volume;

/// More files beside each other are not counted.
const MOST: usize = 100_000;

/// The steps in time of a volume, counted from 0.
///
/// They lie inside of one file (NIfTI with a fourth dimension, NRRD with an axis of time), or in numbered files beside each
/// other: `NAME_007.EXT` is step 0 of a series that goes on with `NAME_008.EXT` until a number is missing. The number ends the
/// name; before it stands `_`, `-`, `.` or nothing, or it has 3 digits at least. A volume without any of this is a series of
/// one step.
#[derive(Debug)]
pub struct Series {
    path: PathBuf,
    steps: usize,
    /// How the files are called, if they are several.
    numbered: Option<Numbered>,
    /// Behind the step that was read last, where that saves time.
    stream: Mutex<Option<Stream>>,
}

impl Series {
    /// Finds out how many steps there are. Only the header of the first file is read.
    ///
    /// # Errors
    /// If the file cannot be read or its header is not sound.
    pub fn open(path: &Path) -> Result<Self, IoError> {
        let inside = match extension(path).as_deref() {
            // they hold one volume, and have no header that could be read alone
            Some("vti" | "vtk") => bytes::open(path).map(|_| 1)?,
            _ => plan(path)?.steps.count,
        };
        let new = |steps, numbered| Self { path: path.to_owned(), steps, numbered, stream: Mutex::default() };
        if inside == 1
            && let Some(numbered) = Numbered::of(path)
        {
            let more = (1..MOST).take_while(|step| numbered.path(path, *step).is_some_and(|p| p.is_file())).count();
            if more > 0 {
                return Ok(new(more + 1, Some(numbered)));
            }
        }
        Ok(new(inside, None))
    }

    /// At least 1.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Whether one file holds all steps.
    pub fn is_one_file(&self) -> bool {
        self.numbered.is_none()
    }

    /// The file that holds a step.
    pub fn file(&self, step: usize) -> PathBuf {
        self.numbered.as_ref().and_then(|n| n.path(&self.path, step)).unwrap_or_else(|| self.path.clone())
    }

    /// Reads one step. What lies before it in a file is passed over, without being held in memory; of compressed data only
    /// from the step that was read last, if it was an earlier one.
    ///
    /// # Errors
    /// If there is no such step, or its file cannot be read, is not sound, or holds what a [`Volume`] cannot.
    pub fn read(&self, step: usize) -> Result<Volume, IoError> {
        if step >= self.steps {
            return Err(IoError::NoStep { path: self.path.clone(), step, steps: self.steps });
        }
        match (&self.numbered, self.steps) {
            (Some(_), _) | (None, 1) => read_volume(&self.file(step)),
            // another thread that reads at the same time begins anew
            _ => match self.stream.try_lock() {
                Ok(mut stream) => plan(&self.path)?.load_step(step, &mut stream),
                Err(_) => plan(&self.path)?.load_step(step, &mut None),
            },
        }
    }
}

/// A file name with a number at its end.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Numbered {
    before: String,
    number: u64,
    /// Digits at least.
    width: usize,
    ending: String,
}

impl Numbered {
    fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        // `.nii.gz` is one ending
        let packed = if ends_with(path, ".gz") { 3 } else { 0 };
        let stem = &name[..name[..name.len() - packed].rfind('.')?];
        let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        let before = &stem[..stem.len() - digits];
        let apart = before.is_empty() || before.ends_with(['_', '-', '.']);
        if digits == 0 || !(apart || digits >= 3) {
            return None;
        }
        Some(Self {
            before: before.to_owned(),
            number: stem[before.len()..].parse().ok()?,
            width: digits,
            ending: name[stem.len()..].to_owned(),
        })
    }

    /// The file of a step.
    fn path(&self, first: &Path, step: usize) -> Option<PathBuf> {
        let number = self.number.checked_add(step as u64)?;
        let Self { before, width, ending, .. } = self;
        Some(first.with_file_name(format!("{before}{number:0width$}{ending}")))
    }
}

#[cfg(test)]
mod tests {
    use super::super::store::file_name;
    use super::*;

    #[test]
    fn numbers_at_the_end_of_a_name() {
        let next = |name: &str| {
            let path = Path::new("folder").join(name);
            Numbered::of(&path).and_then(|n| n.path(&path, 1)).map(|p| file_name(&p))
        };
        for (name, after) in [
            ("ball_000.nrrd", Some("ball_001.nrrd")),
            ("ball_099.nii.gz", Some("ball_100.nii.gz")),
            ("ball-9.mha", Some("ball-10.mha")),
            ("ball.999.vti", Some("ball.1000.vti")),
            ("frame0001.vti", Some("frame0002.vti")),
            ("00.raw", Some("01.raw")),
            // more likely a size or a kind than a step
            ("head96.nrrd", None),
            ("t1.nii", None),
            ("ball.nrrd", None),
            ("ball_99999999999999999999.nrrd", None),
            ("12", None),
        ] {
            assert_eq!(next(name).as_deref(), after, "{name}");
        }
    }
}

//! Headers in text: bounded lines, numbers, and the frame of a grid taken apart.

use std::collections::HashMap;
use std::io::{BufRead, Read};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use glam::{DAffine3, DMat3, DVec3};

use super::IoError;
use super::bytes::quote;
use crate::volume::{Grid, Space};

/// Bytes after which a header without an end is given up.
pub(super) const LONGEST: u64 = 1 << 20;

/// The lines of a header, which may be followed by anything.
pub(super) struct Lines<'a, R> {
    path: &'a Path,
    reader: R,
    /// Bytes of the file that the lines so far took.
    pub taken: u64,
}

impl<'a, R: BufRead> Lines<'a, R> {
    pub fn new(path: &'a Path, reader: R) -> Self {
        Self { path, reader, taken: 0 }
    }

    /// The next line without its end; `None` at the end of the file. What is not UTF-8 is replaced: names and comments
    /// of other days must not keep a volume from being read.
    pub fn next(&mut self) -> Result<Option<String>, IoError> {
        let mut line = Vec::new();
        let left = LONGEST.saturating_sub(self.taken);
        self.reader
            .by_ref()
            .take(left)
            .read_until(b'\n', &mut line)
            .map_err(|e| IoError::system(self.path, "read", e))?;
        self.taken += line.len() as u64;
        if self.taken >= LONGEST {
            return Err(IoError::malformed(self.path, "its header does not end within its first 1 MiB"));
        }
        if line.is_empty() {
            return Ok(None);
        }
        if line.ends_with(b"\n") {
            line.pop();
        }
        if line.ends_with(b"\r") {
            line.pop();
        }
        Ok(Some(String::from_utf8_lossy(&line).into_owned()))
    }
}

/// The named entries of a header, with the file they are from.
pub(super) struct Fields {
    pub path: PathBuf,
    entries: HashMap<String, String>,
}

impl Fields {
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_owned(), entries: HashMap::new() }
    }

    /// Adds an entry; names are compared without case and blanks.
    ///
    /// # Errors
    /// If there is one of this name already, other than a comment.
    pub fn add(&mut self, name: &str, value: &str) -> Result<(), IoError> {
        let key = key(name);
        if self.entries.contains_key(&key) && key != "comment" {
            return Err(self.wrong(format!("has the field {} twice; it must be given once", quote(name.trim()))));
        }
        self.entries.insert(key, value.trim().to_owned());
        Ok(())
    }

    pub fn get(&self, name: &str) -> Option<&str> {
        self.entries.get(&key(name)).map(String::as_str)
    }

    /// The first of several names for the same thing that is there.
    pub fn any<'n>(&self, names: &[&'n str]) -> Option<(&'n str, &str)> {
        names.iter().find_map(|n| Some((*n, self.get(n)?)))
    }

    pub fn require(&self, name: &str) -> Result<&str, IoError> {
        self.get(name).ok_or_else(|| self.wrong(format!("its header has no field '{name}', which is needed")))
    }

    /// Exactly `n` numbers separated by white space.
    pub fn numbers<T: FromStr>(&self, name: &str, value: &str, n: usize) -> Result<Vec<T>, IoError> {
        let what = if n == 1 { "one number".to_owned() } else { format!("{n} numbers") };
        let list: Option<Vec<T>> = value.split_whitespace().map(|w| w.parse().ok()).collect();
        list.filter(|l| l.len() == n).ok_or_else(|| self.bad(name, value, &what))
    }

    pub fn wrong(&self, what: impl Into<String>) -> IoError {
        IoError::malformed(&self.path, what)
    }

    /// "the field is so, it must be so".
    pub fn bad(&self, name: &str, value: &str, right: &str) -> IoError {
        self.wrong(format!("its field '{name}' is {}; it must be {right}", quote(value)))
    }

    pub fn unsupported(&self, what: impl Into<String>) -> IoError {
        IoError::unsupported(&self.path, what)
    }
}

fn key(name: &str) -> String {
    name.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_lowercase).collect()
}

/// A grid from what a header says.
pub(super) fn grid(path: &Path, dims: [usize; 3], axes: DMat3, origin: DVec3, space: Space) -> Result<Grid, IoError> {
    let grid = Grid::new(dims, DAffine3::from_mat3_translation(axes, origin), space)
        .map_err(|e| IoError::malformed(path, e.to_string()))?;
    let (lo, hi) = grid.bounds();
    if !(lo.is_finite() && hi.is_finite() && grid.voxel_from_world().is_finite()) {
        return Err(IoError::malformed(path, "its voxel spacing or origin is beyond what numbers can hold"));
    }
    Ok(grid)
}

/// Spacing and unit directions (as columns) whose product is the grid's matrix; exact where an axis of the grid runs along
/// one of the world.
pub(super) fn spacing_and_direction(grid: &Grid) -> (DVec3, DMat3) {
    let part = |axis: DVec3| {
        let exact = DVec3::AXES.iter().find(|a| axis * (DVec3::ONE - **a) == DVec3::ZERO);
        match exact {
            Some(a) => (a.dot(axis).abs(), a * a.dot(axis).signum()),
            None => (axis.length(), axis / axis.length()),
        }
    };
    let m = grid.world_from_voxel.matrix3;
    let ((sx, dx), (sy, dy), (sz, dz)) = (part(m.x_axis), part(m.y_axis), part(m.z_axis));
    (DVec3::new(sx, sy, sz), DMat3::from_cols(dx, dy, dz))
}

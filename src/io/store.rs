//! What the writers of volumes share: the body of samples, file names, and two files that belong together.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::bytes;
use super::deflate::{Wrapper, write_deflated};
use super::volume::Encoding;
use super::{IoError, write_atomic};
use crate::volume::Volume;

/// The samples of a volume as they go to a file, little endian.
pub(super) struct Body<'a> {
    volume: &'a Volume,
    encoding: Encoding,
    wrapper: Wrapper,
}

impl<'a> Body<'a> {
    pub fn new(volume: &'a Volume, encoding: Encoding, wrapper: Wrapper) -> Self {
        Self { volume, encoding, wrapper }
    }

    pub fn write(&self, w: &mut dyn Write) -> io::Result<()> {
        let samples = &self.volume.samples;
        match self.encoding {
            Encoding::Raw => w.write_all(&bytes::little_endian(samples)),
            Encoding::Compressed => write_deflated(w, &[&bytes::little_endian(samples)], self.wrapper),
            Encoding::Text => bytes::write_text(w, samples, self.volume.grid.dims[0] * self.volume.channels),
        }
    }
}

/// Writes a header and its data file; the header appears last, and neither if the other cannot be written.
pub(super) fn write_pair(
    header: &Path,
    text: &[u8],
    data: &Path,
    body: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> Result<(), IoError> {
    let mut data_written = Ok(());
    let header_written = write_atomic(header, |w| {
        w.write_all(text)?;
        w.flush()?;
        data_written = write_atomic(data, body);
        // given up here, the header's temporary file goes away; the data file's own error is the one to tell
        if data_written.is_ok() { Ok(()) } else { Err(io::ErrorKind::Other.into()) }
    });
    data_written?;
    header_written
}

/// Whether a file name ends so, in capitals or not.
pub(super) fn ends_with(path: &Path, ending: &str) -> bool {
    file_name(path).to_lowercase().ends_with(ending)
}

pub(super) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The file of the same name with another ending, for a header to point at.
///
/// # Errors
/// If the name cannot stand in a header of text.
pub(super) fn beside(path: &Path, ending: &str) -> Result<PathBuf, IoError> {
    let stem = path.file_stem().and_then(|s| s.to_str()).filter(|s| {
        // readers trim names, and a line ends at a line end
        !s.is_empty() && s.trim() == *s && !s.contains(char::is_control)
    });
    let stem = stem.ok_or_else(|| {
        IoError::unsupported(path, "cannot be named in a text header; use a name of letters, digits and the like")
    })?;
    Ok(path.with_file_name(format!("{stem}.{ending}")))
}

use std::path::Path;

use super::IoError;

/// Reads a text file of at most `largest` bytes.
///
/// # Errors
/// If it cannot be read, is longer, or is not UTF-8.
pub fn read_text(path: &Path, largest: u64) -> Result<String, IoError> {
    let fail = |e| IoError::system(path, "read", e);
    let size = std::fs::metadata(path).map_err(fail)?.len();
    if size > largest {
        return Err(IoError::malformed(
            path,
            format!("{size} bytes is too long for this kind of text file (at most {largest})"),
        ));
    }
    let bytes = std::fs::read(path).map_err(fail)?;
    String::from_utf8(bytes).map_err(|_| IoError::malformed(path, "the file is not text in UTF-8"))
}

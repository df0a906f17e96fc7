use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use super::IoError;

/// Writes a file beside `path` and renames it into place, so that a failure leaves what was there before.
///
/// # Errors
/// What `body` returns, or the system's error, mapped to [`IoError::System`].
pub fn write_atomic(
    path: &Path,
    body: impl FnOnce(&mut BufWriter<&File>) -> std::io::Result<()>,
) -> Result<(), IoError> {
    let dir = match path.parent() {
        Some(d) if !d.as_os_str().is_empty() => d,
        _ => Path::new("."),
    };
    let fail = |e| IoError::system(path, "write", e);
    let mut builder = tempfile::Builder::new();
    builder.prefix(".voxclay-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // as any program would create it; the umask still applies
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let temp = builder.tempfile_in(dir).map_err(fail)?;
    let mut w = BufWriter::with_capacity(1 << 20, temp.as_file());
    body(&mut w).and_then(|()| w.flush()).map_err(fail)?;
    drop(w);
    temp.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}

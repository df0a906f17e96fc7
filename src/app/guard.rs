//! Work beside the window's thread that may have a bug of ours in it.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs the work; `Err` with a sentence if it panicked, so that its thread goes on. What it was changing is then half made,
/// and the caller is to forget it; the document is the window's, and no work has it.
pub fn guarded<R>(work: impl FnOnce() -> R) -> Result<R, String> {
    catch_unwind(AssertUnwindSafe(work))
        .map_err(|_| "something went wrong inside; the document is as it was".to_owned())
}

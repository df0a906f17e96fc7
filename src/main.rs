//! `voxclay`: dispatch, and where large blocks of memory come from.

#[cfg(target_os = "linux")]
mod memory;

use voxclay::app::{self, Start};

#[cfg(target_os = "linux")]
#[global_allocator]
static ALLOCATOR: memory::LargePages = memory::LargePages;

fn main() -> std::process::ExitCode {
    voxclay::cli::main(|files, backend| app::run(Start { files, backend, ..Start::default() }))
}

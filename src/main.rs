//! `voxclay`: dispatch only.

use voxclay::app::{self, Start};

fn main() -> std::process::ExitCode {
    voxclay::cli::main(|files, backend| app::run(Start { files, backend, ..Start::default() }))
}

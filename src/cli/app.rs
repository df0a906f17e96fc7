//! `voxclay app`: the modeller.

use anyhow::{Result, bail};

use super::view::BackendArg;

/// Open the modeller on a project, a volume, or phantom:NAME[:SIZE]; a surface among the files becomes the shape.
///
/// Example: voxclay app scan.nrrd
#[derive(clap::Args)]
pub struct Args {
    /// What to open (default: the built-in head).
    #[arg(value_name = "FILE")]
    files: Vec<String>,
    /// What draws the pictures.
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendArg,
}

impl Default for Args {
    fn default() -> Self {
        Self { files: Vec::new(), backend: BackendArg::Auto }
    }
}

/// Opens the window and works until it is closed.
pub fn run(args: &Args, open: super::OpenWindow) -> Result<()> {
    if let Err(what) = open(args.files.clone(), args.backend.into()) {
        bail!(what);
    }
    Ok(())
}

//! `voxclay convert`: between formats of one kind.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use serde_json::json;

use super::Answer;
use crate::evaluate::load;
use crate::io;

/// Convert a volume or a surface to another format of its kind, by the file name's ending.
///
/// Example: voxclay convert scan.nii.gz scan.nrrd
#[derive(clap::Args)]
pub struct Args {
    /// A volume, phantom:NAME[:SIZE], or a surface.
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The file to write: .nrrd .nhdr .nii .nii.gz .mha .mhd .raw or .obj .stl .ply.
    #[arg(value_name = "OUT")]
    output: PathBuf,
}

pub fn run(args: &Args) -> Result<Answer> {
    let started = std::time::Instant::now();
    let word = args.input.to_string_lossy();
    let phantom = word.starts_with("phantom:");
    let surface_in = !phantom && io::is_surface_path(&args.input);
    let surface_out = io::is_surface_path(&args.output);
    if !surface_out && !io::is_volume_path(&args.output) {
        bail!(
            "{}: no known format by this name; expected .nrrd .nhdr .nii .nii.gz .mha .mhd .raw for a volume or .obj .stl .ply for a surface",
            args.output.display()
        );
    }
    if surface_in != surface_out {
        let kind = |surface| if surface { "a surface" } else { "a volume" };
        bail!(
            "{} is {} and {} would be {}; convert goes between formats of one kind",
            args.input.display(),
            kind(surface_in),
            args.output.display(),
            kind(surface_out)
        );
    }
    let what = if surface_in {
        let mesh = io::read_surface(&args.input)?;
        io::write_surface(&args.output, &mesh)?;
        format!("{} triangles", mesh.triangles.len())
    } else {
        let volume = load::read_source(&load::parse_source(&word)?, Path::new("."))?;
        io::write_volume(&args.output, &volume, &io::WriteOptions::default())?;
        let [x, y, z] = volume.grid.dims;
        format!("{x} x {y} x {z} {}", volume.samples.scalar_type().name())
    };
    let ms = started.elapsed().as_secs_f64() * 1e3;
    Ok(Answer {
        json: json!({ "output": args.output.to_string_lossy(), "ms": { "total": ms } }),
        text: format!("{}: {what}\n", args.output.display()),
    })
}

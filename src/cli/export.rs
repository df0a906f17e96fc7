//! `voxclay export`: the deformed volume on a grid.

use std::path::PathBuf;

use anyhow::{Result, bail};
use glam::DVec3;
use serde_json::json;

use super::Answer;
use super::view::parse_proxy;
use crate::evaluate::export::{ExportOptions, GridChoice, Precision, export_field, unwatched};
use crate::evaluate::{load, open, resample};
use crate::io;
use crate::volume::sampling::Interpolation;

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum ModeArg {
    /// Slice by slice; the map is interpolated where that is exact enough.
    Slicing,
    /// The backward map for every voxel in f64, on the CPU.
    Reference,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum InterpolationArg {
    /// For labels: no new values.
    Nearest,
    Linear,
    /// Catmull-Rom, clamped to the local range.
    Cubic,
}

impl From<InterpolationArg> for Interpolation {
    fn from(word: InterpolationArg) -> Self {
        match word {
            InterpolationArg::Nearest => Self::Nearest,
            InterpolationArg::Linear => Self::Linear,
            InterpolationArg::Cubic => Self::Cubic,
        }
    }
}

/// Resample the deformed volume into a new grid and write it.
///
/// Example: voxclay export sculpt.voxclay -o sculpt.nrrd
#[derive(clap::Args)]
pub struct Args {
    /// A project (.voxclay), a volume file, or phantom:NAME[:SIZE].
    #[arg(value_name = "PROJECT")]
    project: String,
    /// The volume to write: .nrrd .nhdr .nii .nii.gz .mha .mhd .raw.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    #[arg(long, value_enum, default_value = "slicing")]
    mode: ModeArg,
    /// Isotropic spacing in world units (default: as the volume).
    #[arg(long, value_name = "S")]
    spacing: Option<f64>,
    /// Keep the volume's grid even where something was pulled out of it.
    #[arg(long)]
    same_grid: bool,
    #[arg(long, value_enum, default_value = "linear")]
    interpolation: InterpolationArg,
    /// Value where there is nothing (default: the volume's smallest).
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    outside: Option<f64>,
    /// The mesh that gives the shape: a file, `box`, `auto` or `auto:VALUE`.
    #[arg(long, value_name = "M")]
    mesh: Option<String>,
    /// Also write the displacement field (3 x f32, world units, from the new grid back to the old place).
    #[arg(long, value_name = "F")]
    field: Option<PathBuf>,
}

pub fn run(args: &Args) -> Result<Answer> {
    for path in std::iter::once(&args.output).chain(&args.field) {
        if !io::is_volume_path(path) {
            bail!(
                "{}: no known volume format by this name; expected .nrrd .nhdr .nii .nii.gz .mha .mhd .raw",
                path.display()
            );
        }
    }
    if args.spacing.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
        bail!("--spacing must be above 0");
    }
    let (mut document, base) = open(&args.project)?;
    if let Some(word) = &args.mesh {
        document.proxy = parse_proxy(word)?;
    }
    let object = load::load(&document, &base)?;
    for warning in &object.warnings {
        eprintln!("voxclay: {warning}");
    }
    let options = ExportOptions {
        grid: match (args.spacing, args.same_grid) {
            (Some(s), same) => GridChoice::Spacing { spacing: DVec3::splat(s), grown: !same },
            (None, true) => GridChoice::Same,
            (None, false) => GridChoice::SameGrown,
        },
        interpolation: args.interpolation.into(),
        precision: match args.mode {
            ModeArg::Slicing => Precision::Fast,
            ModeArg::Reference => Precision::Reference,
        },
        outside: args.outside,
        ..ExportOptions::default()
    };
    let outcome = resample::export(&object, &options)?;
    io::write_volume(&args.output, &outcome.volume, &io::WriteOptions::default())?;
    if let Some(path) = &args.field {
        let field = export_field(&outcome.volume.grid, &object.stack.prepared(), &unwatched)?;
        io::write_volume(path, &field, &io::WriteOptions::default())?;
    }
    let [x, y, z] = outcome.volume.grid.dims;
    let mode = match args.mode {
        ModeArg::Slicing => "slicing",
        ModeArg::Reference => "reference",
    };
    let r = &outcome.report;
    let mut text =
        format!("{}: {x} x {y} x {z}, {mode}, {:.0} ms; {} voxels moved\n", args.output.display(), outcome.ms, r.moved);
    if r.clipped > 0 {
        let n = r.clipped;
        text.push_str(&format!(
            "  {n} voxels of the object were pulled out of the grid and are not in the file; leave out --same-grid to keep them\n"
        ));
    }
    Ok(Answer {
        json: json!({
            "output": args.output.to_string_lossy(),
            "dims": [x, y, z],
            "mode": mode,
            "moved": r.moved,
            "outside": r.outside,
            "outside_mesh": outcome.outside_mesh,
            "clipped": r.clipped,
            "mass": { "before": r.mass_before, "after": r.mass_after },
            "ms": { "resample": r.ms, "total": outcome.ms },
        }),
        text,
    })
}

//! `voxclay export`: the deformed volume on a grid.

use std::path::PathBuf;

use anyhow::{Result, bail};
use glam::DVec3;
use serde_json::json;

use super::Answer;
use super::certificate::attach;
use super::render::{lattice_json, unconverged};
use super::view::{BackendArg, checked_tolerance, parse_proxy};
use crate::evaluate::certificate::{self, Certificate, Subject, TetField};
use crate::evaluate::export::{ExportOptions, GridChoice, Precision, export_field, stored_outside, unwatched};
use crate::evaluate::picture::Refinement;
use crate::evaluate::resample::Exported;
use crate::evaluate::{load, open, resample, tets};
use crate::io;
use crate::volume::Volume;
use crate::volume::sampling::Interpolation;

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum ModeArg {
    /// Slice by slice; the map is interpolated where that is exact enough.
    Slicing,
    /// The volume warped through a lattice of tetrahedra.
    Tets,
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
///
/// Through tetrahedra, certified: voxclay export sculpt.voxclay --mode tets --tolerance 0.05 --certificate c.json -o sculpt.nrrd
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
    /// Largest error of the lattice of --mode tets, in voxels (default: 0.1).
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    tolerance: Option<f64>,
    /// Isotropic spacing in world units (default: as the volume).
    #[arg(long, value_name = "S")]
    spacing: Option<f64>,
    /// Keep the volume's grid even where something was pulled out of it.
    #[arg(long)]
    same_grid: bool,
    #[arg(long, value_enum, default_value = "linear")]
    interpolation: InterpolationArg,
    /// Who fills the grid of --mode slicing: the CPU gives the same bytes on every machine, the GPU values that may differ by
    /// a grey level. `auto` takes a real GPU if there is one.
    #[arg(long, value_enum, default_value = "cpu")]
    backend: BackendArg,
    /// Value where there is nothing (default: the volume's smallest).
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    outside: Option<f64>,
    /// Which step of a series in time, counted from 0 (default: the project's, or the first).
    #[arg(long, value_name = "N")]
    step: Option<usize>,
    /// The mesh that gives the shape: a file, `box`, `auto` or `auto:VALUE`.
    #[arg(long, value_name = "M")]
    mesh: Option<String>,
    /// Also write the displacement field (3 x f32, world units, from the new grid back to the old place).
    #[arg(long, value_name = "F")]
    field: Option<PathBuf>,
    /// Also write what the export is worth: holes, overlaps, folds, losses, labels, mass.
    #[arg(long, value_name = "C.json")]
    certificate: Option<PathBuf>,
}

pub fn run(args: &Args) -> Result<Answer> {
    for path in std::iter::once(&args.output).chain(&args.field) {
        io::check_volume_output(path)?;
    }
    if args.tolerance.is_some() && args.mode != ModeArg::Tets {
        bail!("--tolerance goes with --mode tets only");
    }
    if args.mode == ModeArg::Tets && args.backend == BackendArg::Gpu {
        bail!("--backend gpu goes with --mode slicing only; `voxclay warp` warps on the GPU");
    }
    let tolerance = checked_tolerance(args.tolerance)?.unwrap_or(tets::TOLERANCE);
    if args.spacing.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
        bail!("--spacing must be above 0");
    }
    let (mut document, base) = open(&args.project)?;
    if let Some(word) = &args.mesh {
        document.proxy = parse_proxy(word)?;
    }
    document.step = args.step.unwrap_or(document.step);
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
        precision: if args.mode == ModeArg::Reference { Precision::Reference } else { Precision::Fast },
        outside: args.outside,
        ..ExportOptions::default()
    };
    let Made { volume, mut json, mut text, certificate } = match args.mode {
        ModeArg::Tets => through_tets(args, &object, &options, tolerance)?,
        ModeArg::Slicing | ModeArg::Reference => through_map(args, &object, &options)?,
    };
    io::write_volume(&args.output, &volume, &io::WriteOptions::default())?;
    if let Some(path) = &args.field {
        let field = export_field(&volume.grid, &object.stack.prepared(), &unwatched)?;
        io::write_volume(path, &field, &io::WriteOptions::default())?;
    }
    let [x, y, z] = volume.grid.dims;
    json["output"] = json!(args.output.to_string_lossy());
    json["dims"] = json!([x, y, z]);
    text.insert_str(0, &format!("{}: {x} x {y} x {z}, ", args.output.display()));
    let mut answer = Answer { json, text };
    if let (Some(path), Some(certificate)) = (&args.certificate, certificate) {
        attach(&mut answer, &certificate, path, &["mode", "output", "dims", "lattice"])?;
    }
    Ok(answer)
}

/// A volume, and what is to be said about it.
struct Made {
    volume: Volume,
    json: serde_json::Value,
    /// To stand after the name and the size.
    text: String,
    certificate: Option<Certificate>,
}

fn through_map(args: &Args, object: &load::Object, options: &ExportOptions) -> Result<Made> {
    let Exported { volume, report: r, outside_mesh, device, remark, ms } =
        resample::export(object, options, args.backend.into())?;
    let mode = if args.mode == ModeArg::Reference { "reference" } else { "slicing" };
    let on = device.as_ref().map_or(String::new(), |name| format!(" on {name}"));
    let mut text = format!("{mode}, {ms:.0} ms{on}; {} voxels moved\n", r.moved);
    if let Some(remark) = &remark {
        text.push_str(&format!("  {remark}\n"));
    }
    if r.clipped > 0 {
        let n = r.clipped;
        text.push_str(&format!(
            "  {n} voxels of the object were pulled out of the grid and are not in the file; leave out --same-grid to keep them\n"
        ));
    }
    let certificate = match args.certificate {
        Some(_) => {
            let outside = stored_outside(&object.volume, options.outside);
            Some(certificate::of_map(&subject(object, options, &volume, outside), &object.stack.prepared())?)
        }
        None => None,
    };
    let json = json!({
        "mode": mode,
        "backend": if device.is_some() { "gpu" } else { "cpu" },
        "device": device,
        "remark": remark,
        "moved": r.moved,
        "outside": r.outside,
        "outside_mesh": outside_mesh,
        "clipped": r.clipped,
        "mass": { "before": r.mass_before, "after": r.mass_after },
        "ms": { "resample": r.ms, "total": ms },
    });
    Ok(Made { volume, json, text, certificate })
}

fn through_tets(args: &Args, object: &load::Object, options: &ExportOptions, tolerance: f64) -> Result<Made> {
    let made = tets::resample(object, options, Refinement::Tolerance(tolerance))?;
    let lattice = &made.lattice.report;
    if !lattice.converged {
        eprintln!("voxclay: {}", unconverged(lattice, tolerance));
    }
    let text =
        format!("tets, {:.0} ms; {} tetrahedra, right to {:.3} voxels\n", made.ms, lattice.tets, lattice.max_error);
    let certificate = match args.certificate {
        Some(_) => {
            let map = object.stack.prepared();
            let field = TetField {
                tets: &made.lattice.mesh.tets,
                rest: &made.lattice.mesh.points,
                deformed: made.lattice.deformed(),
                fills: true,
                exact: Some(&map),
            };
            let subject = subject(object, options, &made.volume, made.outside);
            Some(certificate::of_lattice(&subject, &field, &object.stack.prepared())?)
        }
        None => None,
    };
    let json = json!({
        "mode": "tets",
        "backend": "cpu",
        "outside": made.volume.grid.len() as u64 - made.tally.written + made.tally.beyond,
        "outside_mesh": made.outside_mesh,
        "lattice": lattice_json(lattice),
        "ms": { "lattice": made.lattice.ms, "warp": made.ms_warp, "total": made.ms },
    });
    Ok(Made { volume: made.volume, json, text, certificate })
}

fn subject<'a>(object: &'a load::Object, options: &ExportOptions, output: &'a Volume, outside: f64) -> Subject<'a> {
    Subject { input: &object.volume, output, interpolation: options.interpolation, outside, density: false }
}

//! `voxclay convert`: between formats of one kind.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use serde_json::json;

use super::Answer;
use crate::evaluate::{load, series};
use crate::io::{self, FileKind};
use crate::scene::VolumeSource;

/// Convert a volume, a surface or a tetrahedral mesh to another format of its kind, by the file name's ending.
///
/// Example: voxclay convert scan.nii.gz scan.nrrd
///
/// One step of a series in time: voxclay convert heart.nii.gz --step 7 heart_007.nrrd
#[derive(clap::Args)]
pub struct Args {
    /// A volume, phantom:NAME[:SIZE], a surface or a tetrahedral mesh.
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The file to write: .nrrd .nhdr .nii .nii.gz .mha .mhd .raw, or .obj .stl .ply .glb, or .vtu .vtk .msh .mesh .node .ele.
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Which step of a series in time, counted from 0 (default: the first).
    #[arg(long, value_name = "N")]
    step: Option<usize>,
}

pub fn run(args: &Args) -> Result<Answer> {
    let started = std::time::Instant::now();
    let word = args.input.to_string_lossy();
    let from = if word.starts_with("phantom:") { Some(FileKind::Volume) } else { io::kind_of(&args.input)? };
    let Some(to) = written(&args.output) else {
        bail!(
            "{}: cannot be written by this name; expected .nrrd .nhdr .nii .nii.gz .mha .mhd .raw for a volume, .obj .stl .ply .glb for a surface or .vtu .vtk .msh .mesh .node .ele for a tetrahedral mesh",
            args.output.display()
        );
    };
    if to == FileKind::Volume {
        io::check_volume_output(&args.output)?;
    }
    // what nobody knows by its name may be a volume by its content
    let from = from.unwrap_or(FileKind::Volume);
    if from != to {
        bail!(
            "{} is {} and {} would be {}; convert goes between formats of one kind",
            args.input.display(),
            kind_name(from),
            args.output.display(),
            kind_name(to)
        );
    }
    if args.step.is_some() && from != FileKind::Volume {
        bail!("{} is {}; --step goes with volumes only", args.input.display(), kind_name(from));
    }
    let what = match from {
        FileKind::Surface => {
            let mesh = io::read_surface(&args.input)?;
            io::write_surface(&args.output, &mesh)?;
            format!("{} triangles", mesh.triangles.len())
        }
        FileKind::Tets => {
            let mut mesh = io::read_tets(&args.input)?;
            let lost = if io::keeps_vectors(&args.output) { Vec::new() } else { std::mem::take(&mut mesh.vectors) };
            io::write_tets(&args.output, &mesh, &io::TetWriteOptions::default())?;
            if !lost.is_empty() {
                let names: Vec<&str> = lost.iter().map(|v| v.name.as_str()).collect();
                eprintln!(
                    "voxclay: {}: this format cannot hold the vectors {}, so they are left out; .vtu, .vtk and .msh can",
                    args.output.display(),
                    names.join(", ")
                );
            }
            format!("{} nodes, {} tetrahedra", mesh.points.len(), mesh.tets.len())
        }
        FileKind::Volume => {
            let source = load::parse_source(&word)?;
            let volume = series::read_step(&source, Path::new("."), args.step.unwrap_or(0))?;
            if args.step.is_none()
                && let VolumeSource::File(path) = &source
                && let series = io::Series::open(path)?
                && series.is_one_file()
                && series.steps() > 1
            {
                eprintln!(
                    "voxclay: {}: of its {} steps in time the first is written; --step N takes another",
                    path.display(),
                    series.steps()
                );
            }
            io::write_volume(&args.output, &volume, &io::WriteOptions::default())?;
            let [x, y, z] = volume.grid.dims;
            format!("{x} x {y} x {z} {}", volume.samples.scalar_type().name())
        }
    };
    let ms = started.elapsed().as_secs_f64() * 1e3;
    Ok(Answer {
        json: json!({ "output": args.output.to_string_lossy(), "ms": { "total": ms } }),
        text: format!("{}: {what}\n", args.output.display()),
    })
}

/// What is written by this name.
fn written(path: &Path) -> Option<FileKind> {
    if io::is_surface_output(path) {
        Some(FileKind::Surface)
    } else if io::is_tets_path(path) {
        Some(FileKind::Tets)
    } else {
        io::is_volume_path(path).then_some(FileKind::Volume)
    }
}

fn kind_name(kind: FileKind) -> &'static str {
    match kind {
        FileKind::Volume => "a volume",
        FileKind::Surface => "a surface",
        FileKind::Tets => "a tetrahedral mesh",
    }
}

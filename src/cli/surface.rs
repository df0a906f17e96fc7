//! `voxclay surface`: an iso-surface as a mesh.

use std::path::PathBuf;

use anyhow::{Result, bail};
use serde_json::json;

use super::Answer;
use super::view::parse_proxy;
use crate::evaluate::surface::{Method, SurfaceOptions, surface};
use crate::evaluate::{load, open};
use crate::io;

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum MethodArg {
    /// The smooth surface of a C1 spline.
    Spline,
    /// The surface of the trilinear function, by marching cubes.
    Cells,
}

/// Make a closed triangle mesh of an iso-surface, such as for printing.
///
/// Example: voxclay surface head.nii.gz --iso 0.3 -o head.stl
///
/// To a tolerance, with normals: voxclay surface sculpt.voxclay --iso 0.3 --refine 0.02 -o sculpt.glb
#[derive(clap::Args)]
pub struct Args {
    /// A volume file, phantom:NAME[:SIZE], or a project (.voxclay), which is resampled first.
    #[arg(value_name = "VOLUME")]
    volume: String,
    /// The mesh to write: .obj .stl .ply .glb.
    #[arg(short, long, value_name = "MESH")]
    output: PathBuf,
    /// Isovalue, in the volume's real values (default: what separates the object from its surroundings).
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    iso: Option<f64>,
    #[arg(long, value_enum, default_value = "spline")]
    method: MethodArg,
    /// Cut edges whose middle is farther than this from the spline, in voxels; contour a lattice twice as fine to begin with.
    #[arg(long, value_name = "L", allow_negative_numbers = true)]
    refine: Option<f64>,
    /// Correction steps of the spline: 0 is smoothest, more keep more detail; at most 16 (default: 4 for floating-point
    /// samples, else 0).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=16))]
    corrections: Option<u32>,
    /// Which step of a series in time, counted from 0 (default: the project's, or the first).
    #[arg(long, value_name = "N")]
    step: Option<usize>,
    /// The mesh that gives the shape: a file, `box`, `auto` or `auto:VALUE`.
    #[arg(long, value_name = "M")]
    mesh: Option<String>,
}

pub fn run(args: &Args) -> Result<Answer> {
    if !io::is_surface_output(&args.output) {
        bail!("{}: no known surface format by this name; expected .obj .stl .ply .glb", args.output.display());
    }
    if args.iso.is_some_and(|v| !v.is_finite()) {
        bail!("--iso must be a finite number");
    }
    if args.refine.is_some_and(|v| !(v.is_finite() && v > 0.0)) {
        bail!("--refine must be above 0 voxels");
    }
    if args.refine.is_some() && args.method == MethodArg::Cells {
        bail!("--refine goes with --method spline only");
    }
    let (mut document, base) = open(&args.volume)?;
    if let Some(word) = &args.mesh {
        document.proxy = parse_proxy(word)?;
    }
    document.step = args.step.unwrap_or(document.step);
    let object = load::load(&document, &base)?;
    for warning in &object.warnings {
        eprintln!("voxclay: {warning}");
    }
    let (method, name) = match args.method {
        MethodArg::Spline => (Method::Spline { corrections: args.corrections }, "spline"),
        MethodArg::Cells => (Method::Cells, "cells"),
    };
    let made = surface(&object, &SurfaceOptions { iso: args.iso, method, tolerance: args.refine })?;
    let mesh = &made.contour.mesh;
    let writing = std::time::Instant::now();
    io::write_surface_with_normals(&args.output, mesh, &made.contour.normals)?;
    let (vertices, triangles) = (mesh.positions.len(), mesh.triangles.len());
    let mut json = json!({
        "output": args.output.to_string_lossy(),
        "method": name,
        "iso": made.iso,
        "vertices": vertices,
        "triangles": triangles,
        "resampled": made.resampled,
        "ms": {
            "resample": made.ms_resample,
            "spline": made.ms_spline,
            "mesh": made.ms_mesh,
            "write": writing.elapsed().as_secs_f64() * 1e3,
            "total": made.ms_total,
        },
    });
    let mut text = format!(
        "{}: {name} at {}, {vertices} vertices, {triangles} triangles, {:.0} ms\n",
        args.output.display(),
        made.iso,
        made.ms_total
    );
    if let Some(r) = &made.refined {
        json["refined"] = json!({ "levels": r.levels, "left": r.left, "worst": r.worst });
        if r.left > 0 {
            text.push_str(&format!(
                "  {} edges could not be refined; the farthest is {:.3} voxels away\n",
                r.left, r.worst
            ));
        }
    }
    Ok(Answer { json, text })
}

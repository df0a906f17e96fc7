//! `voxclay render`: a picture of a project or volume.

use std::path::PathBuf;

use anyhow::Result;
use serde_json::json;

use super::Answer;
use super::view::ViewArgs;
use crate::evaluate::picture::{PictureReport, Refinement, Renderer};
use crate::evaluate::{load, open};
use crate::io;
use crate::mesh::tet_map::MapReport;

/// Draw a project or a volume into a PNG file.
///
/// Example: voxclay render head.nii.gz --transfer ct-bone --yaw 30 -o head.png
///
/// Through tetrahedra: voxclay render sculpt.voxclay --mode tets -o sculpt.png
///
/// A smooth iso-surface: voxclay render sculpt.voxclay --mode spline --iso 0.3 -o sculpt.png
#[derive(clap::Args)]
pub struct Args {
    /// A project (.voxclay), a volume file, or phantom:NAME[:SIZE].
    #[arg(value_name = "FILE")]
    file: String,
    #[command(flatten)]
    view: ViewArgs,
    /// The picture.
    #[arg(short, long, value_name = "PNG")]
    output: PathBuf,
}

pub fn run(args: &Args) -> Result<Answer> {
    let (mut document, base) = open(&args.file)?;
    let options = args.view.apply(&mut document)?;
    let object = load::load(&document, &base)?;
    for warning in &object.warnings {
        eprintln!("voxclay: {warning}");
    }
    let look = document.look.look(object.iso);
    let camera = object.camera(&document.camera);
    let (picture, report) = Renderer::new(options.backend)?.picture(&object, &camera, &look, &options)?;
    for warning in &report.warnings {
        eprintln!("voxclay: {warning}");
    }
    let png = picture.png()?;
    io::write_atomic(&args.output, |w| std::io::Write::write_all(w, &png))?;
    let mut text = format!(
        "{}: {}x{}, {} slices, {} triangles, {:.0} ms on {}\n",
        args.output.display(),
        picture.width,
        picture.height,
        report.slices,
        report.triangles,
        report.ms_total,
        report.device,
    );
    if let Some(t) = &report.tets {
        if let Refinement::Tolerance(tolerance) = options.refinement
            && !t.lattice.converged
        {
            eprintln!("voxclay: {}", unconverged(&t.lattice, tolerance));
        }
        text.push_str(&format!(
            "  {} tetrahedra, right to {:.3} voxels; lattice {:.0} ms, warp {:.0} ms\n",
            t.lattice.tets, t.lattice.max_error, t.ms_lattice, t.ms_warp
        ));
    }
    Ok(Answer { json: report_json(&report), text })
}

/// The JSON keys of the contract.
pub fn report_json(report: &PictureReport) -> serde_json::Value {
    let mut json = json!({
        "slices": report.slices,
        "triangles": report.triangles,
        "fragments": report.fragments,
        "warnings": report.warnings,
        "backend": report.backend,
        "device": report.device,
        "ms": {
            "geometry": report.ms_geometry,
            "draw": report.ms_draw,
            "total": report.ms_total,
        },
    });
    if let Some(t) = &report.tets {
        json["lattice"] = lattice_json(&t.lattice);
        json["ms"]["lattice"] = json!(t.ms_lattice);
        json["ms"]["warp"] = json!(t.ms_warp);
    }
    json
}

/// What to say of a lattice that is not as fine as it should be.
pub fn unconverged(report: &MapReport, tolerance: f64) -> String {
    format!(
        "the lattice is right to {:.3} voxels, not {tolerance}: more than {} tetrahedra are not made",
        report.max_error, report.tets
    )
}

/// A lattice of tetrahedra; errors in voxels.
pub fn lattice_json(report: &MapReport) -> serde_json::Value {
    json!({
        "tets": report.tets,
        "points": report.points,
        "inverted": report.inverted,
        "max_error": report.max_error,
        "mean_error": report.mean_error,
        "converged": report.converged,
    })
}

//! `voxclay render`: a picture of a project or volume.

use std::path::PathBuf;

use anyhow::Result;
use serde_json::json;

use super::Answer;
use super::view::ViewArgs;
use crate::evaluate::picture::{PictureReport, Renderer};
use crate::evaluate::{load, open};
use crate::io;

/// Draw a project or a volume into a PNG file.
///
/// Example: voxclay render head.nii.gz --transfer bone --yaw 30 -o head.png
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
    let png = picture.png()?;
    io::write_atomic(&args.output, |w| std::io::Write::write_all(w, &png))?;
    let text = format!(
        "{}: {}x{}, {} slices, {} triangles, {:.0} ms on {}\n",
        args.output.display(),
        picture.width,
        picture.height,
        report.slices,
        report.triangles,
        report.ms_total,
        report.device,
    );
    Ok(Answer { json: report_json(&report), text })
}

/// The JSON keys of the contract.
pub fn report_json(report: &PictureReport) -> serde_json::Value {
    json!({
        "slices": report.slices,
        "triangles": report.triangles,
        "fragments": report.fragments,
        "backend": report.backend,
        "device": report.device,
        "ms": {
            "geometry": report.ms_geometry,
            "draw": report.ms_draw,
            "total": report.ms_total,
        },
    })
}

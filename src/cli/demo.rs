//! `voxclay demo`: the main job without a window.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use glam::DVec3;
use serde_json::{Value, json};

use super::Answer;
use super::render::report_json;
use super::view::BackendArg;
use crate::compare;
use crate::deform::{Deformation, Deformer, DisplacementVolume, Grab, Limit};
use crate::evaluate::export::ExportOptions;
use crate::evaluate::picture::{Backend, Mode, Refinement, Renderer, ViewOptions};
use crate::evaluate::{load, resample};
use crate::io;
use crate::render::Picture;
use crate::scene::{self, Document, ProxySource, ShadingSpec, VolumeSource};

/// Sculpt the built-in head: three strokes, pictures before and after in each mode, the exported volume, a comparison.
///
/// Example: voxclay demo -o out
#[derive(clap::Args)]
pub struct Args {
    /// Folder for the pictures, the volume, the project and the report; made if missing.
    #[arg(short, long, value_name = "DIR", default_value = "voxclay-demo")]
    output: PathBuf,
    /// Longest side of the phantom in voxels.
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u16).range(32..=1024))]
    size: u16,
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendArg,
}

/// Subdivision depths whose pictures are compared with the exact one.
const DEPTHS: [u8; 5] = [0, 1, 2, 3, 4];

pub fn run(args: &Args) -> Result<Answer> {
    let dir = &args.output;
    std::fs::create_dir_all(dir).with_context(|| format!("{}: cannot make this folder", dir.display()))?;
    let mut job = Job { dir, files: Vec::new(), ms: serde_json::Map::new() };
    let mut document = Document::new(VolumeSource::Phantom { name: "head".into(), size: args.size.into() });
    load::suggest(&mut document);
    document.proxy = ProxySource::Auto { iso: None };
    let mut renderer = Renderer::new(args.backend.into())?;
    let options = ViewOptions {
        size: (768, 768),
        slices: None,
        mode: Mode::Slicing,
        refinement: Refinement::Tolerance(0.1),
        backend: args.backend.into(),
        transparent: false,
        corrections: None,
    };

    let rest = load::load(&document, Path::new(""))?;
    job.pictures(&rest, &document, &mut renderer, &options, "before")?;
    let (strokes, notes) = strokes()?;
    document.stack.items = strokes;
    let sculpted = load::load(&document, Path::new(""))?;
    job.pictures(&sculpted, &document, &mut renderer, &options, "after")?;

    let metrics = job.compare(&sculpted, &document, &options)?;

    let exported = resample::export(&sculpted, &ExportOptions::default(), Backend::Cpu)?;
    job.ms.insert("export".into(), json!(exported.ms));
    let volume = job.path("head-sculpted.nrrd");
    io::write_volume(&volume, &exported.volume, &io::WriteOptions::default())?;
    let project = job.path("head.voxclay");
    scene::write_project(&project, &document, &scene::Kept::default())?;

    let report = report(&notes, &metrics, &exported);
    let path = job.path("report.md");
    io::write_atomic(&path, |w| std::io::Write::write_all(w, report.as_bytes()))?;
    let files: Vec<String> = job.files.iter().map(|f| f.display().to_string()).collect();
    let text = format!("{report}\nThe pictures are in {}:\n  {}\n", dir.display(), files.join("\n  "));
    Ok(Answer { json: json!({ "files": files, "metrics": metrics, "ms": job.ms }), text })
}

/// Pulls the jaw forward, the crown up and the nose out; each is kept from folding.
fn strokes() -> Result<(Vec<Deformation>, Vec<String>)> {
    let drags: [(&str, Deformer); 3] = [
        (
            "jaw forward",
            Deformer::Displacement(DisplacementVolume::from_drag(
                DVec3::new(0.0, -68.0, -70.0),
                DVec3::new(0.0, -30.0, -4.0),
                60.0,
            )?),
        ),
        (
            "crown up",
            Deformer::Displacement(DisplacementVolume::from_drag(
                DVec3::new(0.0, 20.0, 95.0),
                DVec3::new(0.0, 16.0, 38.0),
                100.0,
            )?),
        ),
        (
            "nose out",
            Deformer::Grab(Grab::new(
                DVec3::new(0.0, -100.0, -8.0),
                DVec3::new(0.0, -16.0, 3.0),
                42.0,
                crate::deform::Falloff::default(),
            )?),
        ),
    ];
    let mut notes = Vec::new();
    let items = drags
        .into_iter()
        .map(|(name, deformer)| {
            let limited = deformer.limited(Limit::default());
            notes.push(if limited.held_back() > 0.0 {
                format!("{name}: {:.1} mm of {:.1} mm (longer would fold)", limited.kept, limited.asked)
            } else {
                format!("{name}: {:.1} mm", limited.kept)
            });
            Deformation::new(name, limited.deformer)
        })
        .collect();
    Ok((items, notes))
}

/// Where things are put, and what has been put there.
struct Job<'a> {
    dir: &'a Path,
    files: Vec<PathBuf>,
    ms: serde_json::Map<String, Value>,
}

impl Job<'_> {
    fn path(&mut self, name: &str) -> PathBuf {
        let path = self.dir.join(name);
        self.files.push(path.clone());
        path
    }

    fn save(&mut self, name: &str, picture: &Picture) -> Result<()> {
        let png = picture.png()?;
        let path = self.path(name);
        Ok(io::write_atomic(&path, |w| std::io::Write::write_all(w, &png))?)
    }

    /// Volume, surface and maximum, each to a file.
    fn pictures(
        &mut self,
        object: &load::Object,
        document: &Document,
        renderer: &mut Renderer,
        options: &ViewOptions,
        when: &str,
    ) -> Result<()> {
        let camera = object.camera(&document.camera);
        for (name, shading) in [
            ("volume", ShadingSpec::Volume),
            ("surface", ShadingSpec::Iso { value: None }),
            ("maximum", ShadingSpec::Mip),
        ] {
            let look = scene::LookSpec { shading, ..document.look }.look(object.iso);
            let (picture, report) = renderer.picture(object, &camera, &look, options)?;
            self.save(&format!("{when}-{name}.png"), &picture)?;
            self.ms.insert(format!("{when}-{name}"), report_json(&report)["ms"]["total"].clone());
        }
        Ok(())
    }

    /// Slicing at each subdivision depth against the exact map.
    fn compare(&mut self, object: &load::Object, document: &Document, options: &ViewOptions) -> Result<Vec<Value>> {
        // the reference is the CPU's: one renderer for all, so that only the subdivision differs
        let mut renderer = Renderer::new(Backend::Cpu)?;
        let camera = object.camera(&document.camera);
        let look = document.look.look(object.iso);
        let exact = ViewOptions { mode: Mode::SlicingExact, ..*options };
        let (reference, _) = renderer.picture(object, &camera, &look, &exact)?;
        self.save("after-volume-exact.png", &reference)?;
        let mut rows = Vec::new();
        let depths = DEPTHS.iter().map(|d| (format!("depth {d}"), Refinement::Depth(*d)));
        for (name, refinement) in depths.chain([("0.1 voxel".to_owned(), Refinement::Tolerance(0.1))]) {
            let (picture, report) =
                renderer.picture(object, &camera, &look, &ViewOptions { refinement, ..*options })?;
            let pixels = [&picture, &reference].map(|p| p.pixels.as_flattened());
            let size = [picture.width as usize, picture.height as usize, 1];
            let difference = compare::difference(pixels[0], pixels[1], size, 4, 255.0)?;
            rows.push(json!({
                "subdivision": name,
                "triangles": report.triangles,
                "psnr": difference.psnr,
                "max": difference.max as u8,
                "ms": report_json(&report)["ms"],
            }));
        }
        Ok(rows)
    }
}

fn report(notes: &[String], metrics: &[Value], exported: &resample::Exported) -> String {
    let mut text = String::from("# Voxclay demo\n\nStrokes:\n");
    for note in notes {
        let _ = writeln!(text, "- {note}");
    }
    text.push_str("\nSlicing against the exact map for every fragment:\n\n| subdivision | triangles | PSNR dB | largest difference of 255 | geometry ms | drawing ms |\n|---|---:|---:|---:|---:|---:|\n");
    for row in metrics {
        let _ = writeln!(
            text,
            "| {} | {} | {:.1} | {} | {:.0} | {:.0} |",
            row["subdivision"].as_str().unwrap_or_default(),
            row["triangles"],
            row["psnr"].as_f64().unwrap_or(f64::INFINITY),
            row["max"],
            row["ms"]["geometry"].as_f64().unwrap_or_default(),
            row["ms"]["draw"].as_f64().unwrap_or_default(),
        );
    }
    let r = &exported.report;
    let [x, y, z] = exported.volume.grid.dims;
    let _ = write!(
        text,
        "\nExport: {x} x {y} x {z} voxels, {} of them moved, {} beyond the volume, {} outside the proxy mesh; {:.0} ms.\n",
        r.moved, r.outside, exported.outside_mesh, exported.ms
    );
    text
}

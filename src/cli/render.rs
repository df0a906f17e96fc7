//! `voxclay render`: a picture of a project or volume.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use serde_json::json;

use super::Answer;
use super::view::ViewArgs;
use crate::evaluate::load::Workspace;
use crate::evaluate::picture::{Mode, PictureReport, Refinement, Renderer, SmoothLook, ViewOptions};
use crate::evaluate::{open, series};
use crate::gpu::Coefficients;
use crate::io;
use crate::mesh::tet_map::MapReport;
use crate::render::Picture;
use crate::scene::Document;
use crate::spline::paint::{Curvature, Shell};

/// Draw a project or a volume into a PNG file.
///
/// Example: voxclay render head.nii.gz --transfer ct-bone --yaw 30 -o head.png
///
/// Through tetrahedra: voxclay render sculpt.voxclay --mode tets -o sculpt.png
///
/// A smooth iso-surface: voxclay render sculpt.voxclay --mode spline --iso 0.3 -o sculpt.png
///
/// Every step of a series in time: voxclay render heart.nii.gz --step all -o heart_###.png
#[derive(clap::Args)]
pub struct Args {
    /// A project (.voxclay), a volume file, or phantom:NAME[:SIZE].
    #[arg(value_name = "FILE")]
    file: String,
    #[command(flatten)]
    view: ViewArgs,
    /// Which step of a series in time, counted from 0, or `all` of them (default: the project's, or the first).
    #[arg(long, value_name = "N|all", value_parser = parse_steps)]
    step: Option<Steps>,
    /// Of --mode spline: red where the surface bulges (gaussian: where it is a dome or a cup), blue where it is hollow (a
    /// saddle).
    #[arg(long, value_enum, value_name = "KIND")]
    curvature: Option<CurvatureArg>,
    /// Of --mode spline: what colours the flat caps where clipping cuts.
    #[arg(long, value_enum, default_value = "surface", value_name = "WHAT")]
    caps: CapsArg,
    /// Of --mode spline: 1 is solid, less lets what is behind the surface through.
    #[arg(long, value_name = "0..1")]
    opacity: Option<f32>,
    /// Of --mode spline: one more surface, with its isovalue, colour and opacity; may be given several times.
    #[arg(long, value_parser = shell, value_name = "ISO[,#RRGGBB[,OPACITY]]", allow_hyphen_values = true)]
    shell: Vec<Shell>,
    /// Of --mode spline: the surroundings take away ambient light, so that hollows are darker.
    #[arg(long)]
    occlusion: bool,
    /// Of --mode spline: soft shadows.
    #[arg(long)]
    shadows: bool,
    /// Of --mode spline: find the surface through the strokes, instead of resampling the volume first.
    #[arg(long)]
    direct: bool,
    /// Of --mode spline on the GPU: where the coefficients of tetrahedra come from (default: stored, or what there is room
    /// for).
    #[arg(long, value_enum, value_name = "WAY")]
    coefficients: Option<CoefficientsArg>,
    /// The picture; with --step all a name with `#` where the number of the step goes, such as heart_###.png.
    #[arg(short, long, value_name = "PNG")]
    output: PathBuf,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum CurvatureArg {
    Mean,
    Gaussian,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum CapsArg {
    /// The surface's own colour.
    Surface,
    /// The transfer function.
    Volume,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum CoefficientsArg {
    /// A store of those of each tetrahedron.
    Stored,
    /// A smaller store of those of each cube that determine the others.
    Determining,
    /// The samples, for each view.
    Fly,
}

impl From<CoefficientsArg> for Coefficients {
    fn from(way: CoefficientsArg) -> Self {
        match way {
            CoefficientsArg::Stored => Self::Stored,
            CoefficientsArg::Determining => Self::Determining,
            CoefficientsArg::Fly => Self::OnTheFly,
        }
    }
}

/// Steps of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Steps {
    One(usize),
    All,
}

fn parse_steps(word: &str) -> Result<Steps, String> {
    if word == "all" {
        return Ok(Steps::All);
    }
    word.parse().map(Steps::One).map_err(|_| format!("'{word}' is no step; expected a number from 0 on, or all"))
}

impl Args {
    /// What the document shows, and what is asked for beside it.
    fn smooth_look(&self, mode: Mode, of: &SmoothLook) -> Result<SmoothLook> {
        let mut look = of.clone();
        if let Some(kind) = self.curvature {
            look.curvature = Some(match kind {
                CurvatureArg::Mean => Curvature::Mean,
                CurvatureArg::Gaussian => Curvature::Gaussian,
            });
        }
        look.caps |= self.caps == CapsArg::Volume;
        look.opacity = self.opacity.unwrap_or(look.opacity);
        look.shells.extend(&self.shell);
        look.occlusion |= self.occlusion;
        look.shadows |= self.shadows;
        look.direct |= self.direct;
        if look != *of && mode != Mode::Spline {
            bail!(
                "--curvature, --caps, --opacity, --shell, --occlusion, --shadows and --direct go with --mode spline only"
            );
        }
        if !(0.0..=1.0).contains(&look.opacity) {
            bail!("--opacity is {}, not between 0 and 1", look.opacity);
        }
        Ok(look)
    }
}

/// `ISO[,#RRGGBB[,OPACITY]]`.
fn shell(text: &str) -> Result<Shell, String> {
    let wrong =
        || format!("\"{text}\" is no surface: write ISO, ISO,#RRGGBB or ISO,#RRGGBB,OPACITY, as in 300,#ffcc88,0.4");
    let mut parts = text.split(',').map(str::trim);
    let iso = parts.next().and_then(|v| v.parse::<f64>().ok()).filter(|v| v.is_finite()).ok_or_else(wrong)?;
    let mut color = [0.87, 0.80, 0.70];
    if let Some(hex) = parts.next() {
        let digits = hex.strip_prefix('#').filter(|h| h.len() == 6 && h.is_ascii()).ok_or_else(wrong)?;
        for (c, out) in color.iter_mut().enumerate() {
            *out = f32::from(u8::from_str_radix(&digits[2 * c..2 * c + 2], 16).map_err(|_| wrong())?) / 255.0;
        }
    }
    let opacity = match parts.next() {
        Some(v) => v.parse().ok().filter(|v| (0.0..=1.0).contains(v)).ok_or_else(wrong)?,
        None => 1.0,
    };
    if parts.next().is_some() {
        return Err(wrong());
    }
    Ok(Shell { iso, color, opacity })
}

pub fn run(args: &Args) -> Result<Answer> {
    let (mut document, base) = open(&args.file)?;
    let options = args.view.apply(&mut document)?;
    let smooth_look = args.smooth_look(options.mode, &document.surface)?;
    if args.coefficients.is_some() && options.mode != Mode::Spline {
        bail!("--coefficients goes with --mode spline only");
    }
    let mut renderer = Renderer::new(options.backend)?;
    if args.coefficients.is_some() && !renderer.on_gpu() {
        bail!("--coefficients says what the GPU stores, and the CPU would draw: use --backend gpu");
    }
    renderer.set_coefficients(args.coefficients.map(Coefficients::from));
    renderer.set_smooth_look(smooth_look);
    let mut work = Work { workspace: Workspace::new(&base), renderer, options };
    match args.step {
        Some(Steps::All) => return all_steps(&mut work, document, &base, &args.output),
        Some(Steps::One(step)) => document.step = step,
        None => {}
    }
    let (picture, report) = work.draw(&document, &args.output)?;
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
        if let Refinement::Tolerance(tolerance) = work.options.refinement
            && !t.lattice.converged
        {
            eprintln!("voxclay: {}", unconverged(&t.lattice, tolerance));
        }
        text.push_str(&format!(
            "  {} tetrahedra, right to {:.3} voxels; lattice {:.0} ms, warp {:.0} ms\n",
            t.lattice.tets, t.lattice.max_error, t.ms_lattice, t.ms_warp
        ));
    }
    if let Some((coefficients, load)) = &report.spline {
        text.push_str(&format!(
            "  {} tetrahedra in {} cubes; coefficients: {}, {:.1} MB; all lists {:.1} MB, samples {:.1} MB\n",
            load.tets,
            load.cubes,
            coefficients.name(),
            load.coefficient_bytes as f64 * 1e-6,
            load.list_bytes as f64 * 1e-6,
            load.sample_bytes as f64 * 1e-6,
        ));
    }
    Ok(Answer { json: report_json(&report), text })
}

/// What pictures of several steps share.
struct Work {
    workspace: Workspace,
    renderer: Renderer,
    options: ViewOptions,
}

impl Work {
    fn draw(&mut self, document: &Document, output: &Path) -> Result<(Picture, PictureReport)> {
        let object = self.workspace.object(document)?;
        for warning in &object.warnings {
            eprintln!("voxclay: {warning}");
        }
        let look = document.look.look(object.iso);
        let camera = object.camera(&document.camera);
        let (picture, mut report) = self.renderer.picture(&object, &camera, &look, &self.options)?;
        for warning in &report.warnings {
            eprintln!("voxclay: {warning}");
        }
        // JSON says all that was said
        report.warnings.splice(0..0, object.warnings.iter().cloned());
        let png = picture.png()?;
        io::write_atomic(output, |w| std::io::Write::write_all(w, &png))?;
        Ok((picture, report))
    }
}

/// A picture of every step.
fn all_steps(work: &mut Work, mut document: Document, base: &Path, output: &Path) -> Result<Answer> {
    let started = Instant::now();
    let steps = series::steps(&document.volume, base)?;
    let files: Vec<PathBuf> =
        (0..steps).map(|step| numbered(output, step)).collect::<Option<_>>().with_context(|| {
            format!("{}: --step all needs a name with # where the number goes, such as step_###.png", output.display())
        })?;
    for (step, file) in files.iter().enumerate() {
        document.step = step;
        work.draw(&document, file)?;
    }
    let ms = started.elapsed().as_secs_f64() * 1e3;
    Ok(Answer {
        json: json!({ "files": files, "steps": steps, "ms": { "total": ms } }),
        text: format!("{}: {steps} pictures, {ms:.0} ms\n", output.display()),
    })
}

/// The name with the last `###` in it exchanged for a number of as many digits at least.
fn numbered(path: &Path, number: usize) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let end = name.rfind('#')? + 1;
    let start = name[..end].trim_end_matches('#').len();
    let width = end - start;
    Some(path.with_file_name(format!("{}{number:0width$}{}", &name[..start], &name[end..])))
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
    if let Some((coefficients, load)) = &report.spline {
        json["spline"] = json!({
            "coefficients": coefficients.name(),
            "tets": load.tets,
            "cubes": load.cubes,
            "coefficient_bytes": load.coefficient_bytes,
            "list_bytes": load.list_bytes,
            "sample_bytes": load.sample_bytes,
        });
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

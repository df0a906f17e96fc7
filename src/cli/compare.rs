//! `voxclay compare`: every mode against the reference.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde_json::{Value, json};

use super::Answer;
use super::view::LookArgs;
use crate::compare::Difference;
use crate::evaluate::compare::{Comparison, Pair, Way, compare, html};
use crate::evaluate::export::Precision;
use crate::evaluate::picture::{Refinement, ViewOptions};
use crate::evaluate::{load, open};
use crate::io;
use crate::render::Picture;

/// Draw a project in every mode and compare pictures, volumes, coordinates and times with the 64-bit reference.
///
/// Example: voxclay compare sculpt.voxclay -o compared
///
/// Two modes only: voxclay compare sculpt.voxclay --modes slicing,tets:0.05 --size 1024x1024
#[derive(clap::Args)]
pub struct Args {
    /// A project (.voxclay), a volume file, or phantom:NAME[:SIZE].
    #[arg(value_name = "PROJECT")]
    project: String,
    /// Which step of a series in time, counted from 0 (default: the project's, or the first).
    #[arg(long, value_name = "N")]
    step: Option<usize>,
    /// Modes, between commas: slicing, slicing-exact, export, tets; slicing and tets with all their settings, or with one:
    /// slicing:3 (depth), slicing:0.1 (tolerance in voxels, with a point), tets:2 (level), tets:0.05 (default: all).
    #[arg(long, value_name = "A,B,...")]
    modes: Option<String>,
    #[command(flatten)]
    look: LookArgs,
    /// Folder for the pictures, the report and its numbers; made if missing (default: only the table is printed).
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

pub fn run(args: &Args) -> Result<Answer> {
    let ways = match &args.modes {
        Some(words) => parse_modes(words)?,
        None => Way::all(),
    };
    let (mut document, base) = open(&args.project)?;
    document.step = args.step.unwrap_or(document.step);
    let view = args.look.apply(&mut document)?;
    let object = load::load(&document, &base)?;
    for warning in &object.warnings {
        eprintln!("voxclay: {warning}");
    }
    if object.stack.active().next().is_none() {
        eprintln!("voxclay: {}: nothing is deformed, so that all modes are much the same", args.project);
    }
    if let Some(dir) = &args.output {
        std::fs::create_dir_all(dir).with_context(|| format!("{}: cannot make this folder", dir.display()))?;
    }
    let look = document.look.look(object.iso);
    let camera = object.camera(&document.camera);
    let compared = compare(&object, &camera, &look, &view, &ways, &|next| eprintln!("comparing {next}"))?;
    let facts = facts(&compared, &view, object.stack.active().count());
    let mut json = json!({
        "project": args.project,
        "size": view.size,
        "input": compared.input,
        "output": compared.output,
        "device": compared.device,
        "threads": rayon::current_num_threads(),
        "pairs": compared.pairs.iter().map(pair_json).collect::<Vec<_>>(),
    });
    let mut text = table(&compared);
    if let Some(dir) = &args.output {
        let mut files = pictures(dir, &compared)?;
        let title = Path::new(&args.project).file_name().map_or(args.project.as_str().into(), |n| n.to_string_lossy());
        let page = html(&compared, &title, &facts)?;
        files.push(write(dir.join("report.html"), page.as_bytes())?);
        let numbers = dir.join("report.json");
        files.push(numbers.display().to_string());
        json["files"] = json!(files);
        write(numbers, format!("{json:#}\n").as_bytes())?;
        let _ = writeln!(text, "\nThe report is {}", dir.join("report.html").display());
    }
    Ok(Answer { json, text })
}

/// The modes between commas, each with all its settings or with one.
fn parse_modes(words: &str) -> Result<Vec<Way>> {
    let mut ways: Vec<Way> = Vec::new();
    for word in words.split(',') {
        let (mode, setting) = word.split_once(':').map_or((word, None), |(m, s)| (m, Some(s)));
        let found = match (mode, setting) {
            ("slicing", None) => Way::slicing(),
            ("tets", None) => Way::tets(),
            ("slicing-exact", None) => vec![Way::SlicingExact],
            ("export", None) => vec![Way::Export(Precision::Reference), Way::Export(Precision::Fast)],
            ("slicing", Some(s)) => vec![Way::Slicing(parse_setting(word, s, 8)?)],
            ("tets", Some(s)) => vec![Way::Tets(parse_setting(word, s, 6)?)],
            _ => bail!(
                "--modes: '{word}' is no mode; expected slicing, slicing-exact, export or tets, slicing and tets also with \
                 a setting such as slicing:3 or tets:0.05"
            ),
        };
        let new: Vec<Way> = found.into_iter().filter(|w| !ways.contains(w)).collect();
        ways.extend(new);
    }
    Ok(ways)
}

fn parse_setting(word: &str, setting: &str, deepest: u8) -> Result<Refinement> {
    if setting.contains('.') {
        if let Some(t) = setting.parse::<f64>().ok().filter(|t| t.is_finite() && *t > 0.0) {
            return Ok(Refinement::Tolerance(t));
        }
    } else if let Some(d) = setting.parse::<u8>().ok().filter(|d| *d <= deepest) {
        return Ok(Refinement::Depth(d));
    }
    bail!(
        "--modes {word}: expected a whole number from 0 to {deepest}, or a tolerance in voxels with a point such as 0.05"
    )
}

fn facts(compared: &Comparison, view: &ViewOptions, strokes: usize) -> Vec<(String, String)> {
    let dims = |d: [usize; 3]| format!("{} x {} x {}", d[0], d[1], d[2]);
    [
        ("voxels", dims(compared.input)),
        ("deformed in", dims(compared.output)),
        ("strokes", strokes.to_string()),
        ("picture", format!("{} x {}", view.size.0, view.size.1)),
        ("on", compared.device.clone()),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .to_vec()
}

fn write(path: PathBuf, bytes: &[u8]) -> Result<String> {
    io::write_atomic(&path, |w| std::io::Write::write_all(w, bytes))?;
    Ok(path.display().to_string())
}

/// A name for files: the mode and its setting.
fn stem(way: Way) -> String {
    format!("{}-{}", way.mode(), way.setting()).replace(' ', "-")
}

fn pictures(dir: &Path, compared: &Comparison) -> Result<Vec<String>> {
    let mut files = vec![write(dir.join("reference.png"), &compared.reference.png()?)?];
    for pair in &compared.pairs {
        let name = stem(pair.way);
        files.push(write(dir.join(format!("{name}.png")), &pair.picture.png()?)?);
        let (width, height, pixels) = pair.map.drawn(compared.scale);
        let map = Picture { width, height, pixels };
        files.push(write(dir.join(format!("{name}-difference.png")), &map.png()?)?);
    }
    Ok(files)
}

/// The keys of the contract. No difference has no finite PSNR, and is null.
fn difference_json(d: &Difference) -> Value {
    json!({ "rmse": d.rmse, "psnr": d.psnr, "ssim": d.ssim, "max": d.max })
}

fn pair_json(pair: &Pair) -> Value {
    let mut json = difference_json(&pair.difference);
    json["mode"] = json!(pair.way.mode());
    json["setting"] = json!(pair.way.setting());
    json["triangles"] = json!(pair.triangles);
    json["ms"] = json!({ "frame": pair.ms.frame, "change": pair.ms.change });
    if let Some(tets) = pair.tets {
        json["tets"] = json!(tets);
    }
    if let Some(c) = &pair.coordinate {
        json["coordinate"] = json!({ "max": c.max, "mean": c.mean, "samples": c.samples });
        if let Some([max, mean]) = pair.falls {
            json["coordinate"]["falls"] = json!({ "max": max, "mean": mean });
        }
    }
    if let Some(v) = &pair.volume {
        json["volume"] = difference_json(&v.all);
        let i = &v.interior;
        json["volume"]["interior"] = json!({ "voxels": i.voxels, "rms": i.rms, "max": i.max, "above": i.above });
        json["drawn"] = difference_json(&v.drawn);
    }
    json
}

/// The table for people.
fn table(compared: &Comparison) -> String {
    let mut text = String::from(
        "                                 picture (steps of 255)          coordinates (voxels)                 volume          ms\n\
         mode           setting           RMSE  PSNR dB     SSIM   max       max  fell      mean  fell   inside RMS      frame   change\n",
    );
    for p in &compared.pairs {
        let d = &p.difference;
        let psnr = if d.psnr.is_infinite() { "equal".to_owned() } else { format!("{:.1}", d.psnr) };
        let [max, mean] = p
            .coordinate
            .map_or([None; 2], |c| [Some(c.max), Some(c.mean)])
            .map(|e| e.map_or(String::new(), |e| format!("{e:.4}")));
        let [a, b] = p.falls.map_or([None; 2], |f| f.map(Some)).map(|f| f.map_or(String::new(), |f| format!("{f:.2}")));
        let inside = p.volume.map_or(String::new(), |v| format!("{:.3}/255", v.interior.rms * 255.0));
        let _ = writeln!(
            text,
            "{:<14} {:<15} {:>6.3} {psnr:>8} {:>8.5} {:>5.0} {max:>9} {a:>5} {mean:>9} {b:>5} {inside:>12} {:>10.0} {:>8.0}",
            p.way.mode(),
            p.way.setting(),
            d.rmse,
            d.ssim,
            d.max,
            p.ms.frame,
            p.ms.change,
        );
    }
    text
}

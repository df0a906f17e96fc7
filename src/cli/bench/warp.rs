//! `voxclay bench warp`.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;

use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::super::Answer;
use super::plot::{Line, plot};
use crate::evaluate::experiments::{Measured, TurnedCube, Way};
use crate::io;

#[derive(clap::Args)]
pub struct Args {
    /// Voxels along an edge of the cube, for the experiment with resolutions.
    #[arg(long, value_name = "N,...", value_delimiter = ',', default_value = "128,192,256,320",
          value_parser = clap::value_parser!(u32).range(2..=2048))]
    sizes: Vec<u32>,
    /// Numbers of tetrahedra, for the experiment with lattices.
    #[arg(long, value_name = "N,...", value_delimiter = ',', default_value = "40,135,320,625,1080,2560,5000",
          value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    tets: Vec<u32>,
    /// Voxels along an edge of the cube in the experiment with lattices.
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(2..=2048))]
    size: u32,
    /// Runs of which medians are taken.
    #[arg(long, value_name = "R", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeat: u32,
    /// A folder for the plots, time-resolution.svg and time-tets.svg.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

/// Tetrahedra in the paper's experiment with resolutions.
const TETS: usize = 1080;

pub fn run(args: &Args) -> Result<Answer> {
    let rounds = args.repeat as usize;
    let mut by_size = Vec::new();
    for &size in &args.sizes {
        eprintln!("voxclay: {size}^3 voxels, {TETS} tetrahedra");
        by_size.extend(TurnedCube::new(size as usize)?.measure(TETS, &Way::ALL, rounds)?);
    }
    let cube = TurnedCube::new(args.size as usize)?;
    let mut by_tets = Vec::new();
    for &tets in &args.tets {
        eprintln!("voxclay: {0}^3 voxels, about {tets} tetrahedra", args.size);
        by_tets.extend(cube.measure(tets as usize, &Way::ALL, rounds)?);
    }
    let mut files = Vec::new();
    if let Some(dir) = &args.output {
        std::fs::create_dir_all(dir).with_context(|| format!("{}: cannot make this folder", dir.display()))?;
        let size = args.size;
        for (name, title, axis, rows, x) in [
            (
                "time-resolution.svg",
                format!("Warp of a turned cube, {TETS} tetrahedra"),
                "million voxels of the cube",
                &by_size,
                (|m: &Measured| (m.size as f64).powi(3) / 1e6) as fn(&Measured) -> f64,
            ),
            (
                "time-tets.svg",
                format!("Warp of a turned cube of {size}\u{b3} voxels"),
                "tetrahedra",
                &by_tets,
                |m: &Measured| m.tets as f64,
            ),
        ] {
            let lines: Vec<Line> = Way::ALL
                .iter()
                .map(|way| Line {
                    name: way.name(),
                    points: rows.iter().filter(|m| m.way == *way).map(|m| (x(m), m.total_ms)).collect(),
                })
                .collect();
            let path = dir.join(name);
            io::write_atomic(&path, |w| w.write_all(plot(&title, axis, "ms", &lines).as_bytes()))?;
            files.push(path.to_string_lossy().into_owned());
        }
    }
    let text = format!(
        "{}\n{}",
        table("Time against resolution (figure 5)", &by_size),
        table("Time against the number of tetrahedra (figure 6)", &by_tets)
    );
    let rows = |rows: &[Measured]| rows.iter().map(row).collect::<Vec<Value>>();
    Ok(Answer {
        json: json!({
            "backend": "cpu",
            "threads": rayon::current_num_threads(),
            "resolution": rows(&by_size),
            "tets": rows(&by_tets),
            "files": files,
        }),
        text,
    })
}

fn rate(part: u64, whole: u64) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}

fn row(m: &Measured) -> Value {
    json!({
        "size": m.size,
        "tets": m.tets,
        "voxels": m.voxels,
        "inside": m.written,
        "culling": m.way.name(),
        "candidates": m.candidates,
        "pass_rate": rate(m.written, m.candidates) / 100.0,
        "ms": { "cull": m.cull_ms, "total": m.total_ms },
    })
}

fn table(title: &str, rows: &[Measured]) -> String {
    let mut text =
        format!("{title}\n  voxels   tets  culling  written   of tested  of padded boxes   cull ms   total ms\n");
    for m in rows {
        let padded = if m.way == Way::None { format!("{:.1} %", rate(m.written, m.padded)) } else { String::new() };
        let _ = writeln!(
            text,
            "  {:>4}^3 {:>6}  {:<7} {:>7.2} M  {:>8.1} %  {padded:>15}  {:>8.2}  {:>9.1}",
            m.size,
            m.tets,
            m.way.name(),
            m.written as f64 / 1e6,
            rate(m.written, m.candidates),
            m.cull_ms,
            m.total_ms
        );
    }
    text
}

//! `voxclay bench spline`.

use std::fmt::Write as _;

use anyhow::Result;
use serde_json::json;

use super::super::Answer;
use super::super::view::parse_size;
use crate::evaluate::experiments::spline::{Measured, Volume, measure};
use crate::evaluate::open;
use crate::gpu::SplineLoad;

#[derive(clap::Args)]
pub struct Args {
    /// Volumes: files, or phantom:NAME[:SIZE].
    #[arg(value_name = "FILE", default_values = ["phantom:marschner-lobb:128", "phantom:head:128"])]
    files: Vec<String>,
    /// Size of the pictures in pixels.
    #[arg(long, value_name = "WxH", default_value = "512x512", value_parser = parse_size)]
    size: (u32, u32),
    /// Runs of which medians are taken.
    #[arg(long, value_name = "R", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeat: u32,
}

pub fn run(args: &Args) -> Result<Answer> {
    let mut text = String::new();
    let mut volumes = Vec::new();
    let mut device = None;
    for file in &args.files {
        eprintln!("voxclay: {file}");
        let (document, base) = open(file)?;
        let (volume, gpu) = measure(&document, &base, args.size, args.repeat as usize)?;
        let _ = writeln!(text, "{}", table(file, &volume));
        volumes.push(json!({
            "file": file,
            "dims": volume.dims,
            "cubes": volume.cubes,
            "triangles": volume.triangles,
            "ms": { "spline": volume.spline_ms, "mesh": volume.mesh_ms },
            "ways": volume.ways.iter().map(row).collect::<Vec<_>>(),
        }));
        device = gpu;
    }
    let threads = rayon::current_num_threads();
    let _ = writeln!(text, "cpu: {threads} threads; gpu: {}", device.as_deref().unwrap_or("none"));
    let [width, height] = [args.size.0, args.size.1];
    Ok(Answer {
        json: json!({ "threads": threads, "device": device, "size": [width, height], "volumes": volumes }),
        text,
    })
}

/// Tetrahedra that are found in a second.
fn rate(m: &Measured) -> Option<f64> {
    Some(f64::from(m.load?.tets) / (m.classify_ms? * 1e-3))
}

fn row(m: &Measured) -> serde_json::Value {
    json!({
        "way": m.way.name(),
        "backend": m.way.backend(),
        "ms": { "change": m.change_ms, "frame": m.frame_ms, "classify": m.classify_ms },
        "tets": m.load.map(|l| l.tets),
        "cubes": m.load.map(|l| l.cubes),
        "tets_per_second": rate(m),
        "bytes": m.load.map(|l| l.sample_bytes + l.list_bytes),
        "list_bytes": m.load.map(|l| l.list_bytes),
        "coefficient_bytes": m.load.map(|l| l.coefficient_bytes),
    })
}

fn table(file: &str, v: &Volume) -> String {
    let [nx, ny, nz] = v.dims;
    let mut text = format!(
        "{file}: {nx}x{ny}x{nz} voxels, {} cubes with surface; spline {:.1} ms, mesh {:.1} ms ({} triangles)\n  \
         {:<20} {:>4}  {:>12} {:>10} {:>12} {:>11} {:>9} {:>8} {:>9} {:>9}\n",
        v.cubes,
        v.spline_ms,
        v.mesh_ms,
        v.triangles,
        "",
        "",
        "new isovalue",
        "new view",
        "classify ms",
        "tetrahedra",
        "M tets/s",
        "MB",
        "of lists",
        "of coeff."
    );
    for m in &v.ways {
        let number = |v: Option<f64>, digits: usize| v.map_or(String::new(), |v| format!("{v:.digits$}"));
        let megabytes = |bytes: fn(SplineLoad) -> u64| number(m.load.map(|l| bytes(l) as f64 * 1e-6), 1);
        let _ = writeln!(
            text,
            "  {:<20} {:>4}  {:>9.1} ms {:>7.1} ms {:>12} {:>11} {:>9} {:>8} {:>9} {:>9}",
            m.way.name(),
            m.way.backend(),
            m.change_ms,
            m.frame_ms,
            number(m.classify_ms, 1),
            m.load.map_or(String::new(), |l| l.tets.to_string()),
            number(rate(m).map(|r| r * 1e-6), 2),
            megabytes(|l| l.sample_bytes + l.list_bytes),
            megabytes(|l| l.list_bytes),
            megabytes(|l| l.coefficient_bytes)
        );
    }
    text
}

//! `voxclay slice`: sections of a surface with parallel planes.

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, bail};
use glam::DVec3;
use serde_json::json;

use crate::evaluate::geometry::outlines;
use crate::io::{read_surface, write_atomic};
use crate::math::PlaneFrame;
use crate::mesh::Topology;
use crate::mesh::check::{self, DefectKind};
use crate::slice::{Planes, Slicer, Slices};
use crate::tessellate::{Limits, Method, Tessellator};

/// Cut a surface with parallel planes.
///
/// Plane k of N lies at lo + (k + 1/2) (hi - lo) / N along the direction, lo and hi being the extent of the mesh.
/// Times are medians over the repetitions: `build` is the edge list (once for a mesh), `contours` the slabs and the walk
/// (for each view), then `nesting` and `tessellate`; `total` is all of them.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: voxclay slice bunny.obj --planes 200 --direction 0.31,0.52,0.80")]
pub struct Args {
    /// The surface: OBJ, STL or PLY.
    mesh: PathBuf,
    /// How many planes.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    planes: u32,
    /// The normal of the planes, of any length but zero.
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,1", value_parser = parse_direction, allow_hyphen_values = true)]
    direction: DVec3,
    /// How sections are cut into triangles: fast (our sweep, lyon where outlines cross), well-shaped, or not at all.
    #[arg(long, value_enum, default_value = "lyon")]
    tessellator: Choice,
    /// Do it R times and report medians.
    #[arg(long, value_name = "R", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    repeat: u32,
    /// Write the contours as text: `plane loop n`, then n lines `u v` along the axes in the planes.
    #[arg(long, value_name = "FILE")]
    contours: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Choice {
    Lyon,
    Spade,
    None,
}

fn parse_direction(text: &str) -> Result<DVec3, String> {
    let parts: Vec<f64> = text
        .split(',')
        .map(|x| x.trim().parse().map_err(|_| format!("'{x}' is no number")))
        .collect::<Result<_, _>>()?;
    match parts[..] {
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        _ => Err(format!("{} numbers where X,Y,Z are three", parts.len())),
    }
}

/// Runs the verb.
///
/// # Errors
/// If the mesh cannot be read, the direction has no length, the sections are too large, or the contours cannot be
/// written.
pub fn run(args: &Args) -> anyhow::Result<serde_json::Value> {
    let Some(frame) = PlaneFrame::across(args.direction) else {
        let d = args.direction;
        bail!("--direction {},{},{}: it has no length; give a normal such as 0,0,1", d.x, d.y, d.z);
    };
    let mut mesh = read_surface(&args.mesh)?;
    if !Topology::build(mesh.positions.len(), &mesh.triangles).is_closed() {
        // seams of texture coordinates are no holes
        mesh = mesh.welded();
    }
    let defects = check::slicing_defects(&mesh);
    // the sections tell of all others
    if let Some(defect) = defects.iter().find(|d| d.kind == DefectKind::SelfIntersection) {
        eprintln!("warning: {}: {defect}", args.mesh.display());
    }
    let planes = Planes::across(frame, &mesh.positions, args.planes as usize);
    let method = match args.tessellator {
        Choice::Lyon => Some(Method::Fast),
        Choice::Spade => Some(Method::Quality(Limits::default())),
        Choice::None => None,
    };

    let mut slicer = Slicer { overlaps: check::overlaps(&defects), ..Slicer::default() };
    let mut tessellator = Tessellator::default();
    let mut times: [Vec<f64>; 5] = Default::default();
    for _ in 0..args.repeat {
        let start = Instant::now();
        let topology = Topology::build(mesh.positions.len(), &mesh.triangles);
        let built = Instant::now();
        slicer.index.build(&mesh.positions, &topology, &planes).with_context(|| args.mesh.display().to_string())?;
        slicer.index.contours(&mut slicer.slices);
        let walked = Instant::now();
        slicer.classify();
        let nested = Instant::now();
        if let Some(method) = method {
            tessellator.run(&outlines(&slicer.slices), method);
        }
        let end = Instant::now();
        for (list, (from, to)) in
            times.iter_mut().zip([(start, built), (built, walked), (walked, nested), (nested, end), (start, end)])
        {
            list.push((to - from).as_secs_f64() * 1e3);
        }
    }

    let slices = &slicer.slices;
    for w in slices.warnings() {
        eprintln!("warning: {}: {}", args.mesh.display(), w.sentence(&planes));
    }
    if let Some(path) = &args.contours {
        write_atomic(path, |out| write_contours(slices, out))?;
    }
    let of_planes = 0..slices.planes();
    let counts: Vec<(usize, usize)> = of_planes.clone().map(|k| slices.plane_counts(k)).collect();
    let area: Vec<f64> = match method {
        Some(_) => of_planes.map(|k| tessellator.result().plane_area(&outlines(slices), k)).collect(),
        None => of_planes.map(|k| slices.plane_area(k)).collect(),
    };
    let [build, contours, nesting, tessellate, total] = times.map(median);
    Ok(json!({
        "planes": slices.planes(),
        "area": area,
        "outer": counts.iter().map(|c| c.0).collect::<Vec<_>>(),
        "holes": counts.iter().map(|c| c.1).collect::<Vec<_>>(),
        "triangles": tessellator.result().triangles.len(),
        "ms": { "build": build, "contours": contours, "nesting": nesting, "tessellate": tessellate, "total": total },
    }))
}

fn write_contours(slices: &Slices, out: &mut impl Write) -> std::io::Result<()> {
    writeln!(out, "# plane loop n, then n lines: u v (coordinates along e1, e2)")?;
    for k in 0..slices.planes() {
        for (i, l) in slices.plane_loops(k).enumerate() {
            let points = slices.loop_points(l);
            writeln!(out, "{k} {i} {}", points.len())?;
            for p in points {
                writeln!(out, "{:?} {:?}", p.x, p.y)?;
            }
        }
    }
    Ok(())
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    let n = times.len();
    if n % 2 == 1 { times[n / 2] } else { 0.5 * (times[n / 2 - 1] + times[n / 2]) }
}

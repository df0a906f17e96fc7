//! `voxclay warp`: a volume through a deformed tetrahedral mesh onto a grid.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use glam::{DAffine3, DVec3};
use serde_json::json;

use super::Answer;
use super::certificate::attach;
use super::export::InterpolationArg;
use super::view::BackendArg;
use crate::evaluate::certificate::{self, Subject, TetField};
use crate::evaluate::picture::Backend;
use crate::evaluate::{EvaluateError, load, series};
use crate::gpu::{Gpu, Preference, WarpPass};
use crate::io;
use crate::mesh::tets::TetMesh;
use crate::volume::fetch::Fetch;
use crate::volume::sampling::Sampler;
use crate::volume::{Grid, Volume};
use crate::warp::cells::CELL;
use crate::warp::{Culling, Facts, Tally, Warp, WarpOptions};
use crate::with_samples;

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Units {
    /// The mesh's points are in the volume's world.
    World,
    /// The mesh's points, and a grid's origin and spacing, are in voxel indices of the volume.
    Voxel,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum CullingArg {
    /// The voxels inside are solved for; nothing is tested.
    Exact,
    /// Test the voxels of the cells that culling leaves.
    Cells,
    /// Test all voxels of the bounding boxes.
    None,
}

/// Warp a volume through a deformed tetrahedral mesh onto a grid (exact: every voxel through its tetrahedron).
///
/// Times are medians over the repetitions and do not include files: `setup` prepares the tetrahedra, `cull` makes the
/// candidates, `raster` writes the voxels.
#[derive(clap::Args)]
#[command(
    after_help = "Example: voxclay warp head.nrrd --tets head.vtk --deformed deformed --grid around -o bent.nrrd"
)]
pub struct Args {
    /// The volume: a file, or phantom:NAME[:SIZE].
    #[arg(value_name = "VOLUME")]
    volume: String,
    /// Which step of a series in time, counted from 0.
    #[arg(long, value_name = "N", default_value_t = 0)]
    step: usize,
    /// The tetrahedral mesh; its points are the rest positions.
    #[arg(long, value_name = "MESH")]
    tets: PathBuf,
    /// Point vectors with the absolute deformed positions in the same file, or a second mesh of the same tetrahedra.
    #[arg(long, value_name = "ARRAY|MESH2", default_value = "deformed")]
    deformed: String,
    #[arg(long, value_enum, default_value = "world")]
    units: Units,
    /// The output grid: `like` the volume, `around` the deformed mesh with the volume's spacing, or a file that has one.
    #[arg(long, value_name = "like|around|FILE", default_value = "like")]
    grid: String,
    #[arg(long, value_enum, default_value = "linear")]
    interpolation: InterpolationArg,
    /// Value where there is nothing, as stored.
    #[arg(long, value_name = "V", default_value_t = 0.0, allow_negative_numbers = true)]
    outside: f64,
    #[arg(long, value_enum, default_value = "exact")]
    culling: CullingArg,
    /// Voxels along an edge of the cells of `--culling cells`.
    #[arg(long, value_name = "N", default_value_t = CELL)]
    cell: u32,
    /// Divide values by the local change of volume, so that the total mass stays.
    #[arg(long)]
    density: bool,
    /// `auto` takes the GPU if there is a real one and it can do what is asked.
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendArg,
    /// Do it R times and report medians.
    #[arg(long, value_name = "R", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    repeat: u32,
    /// The volume to write: .nrrd .nhdr .nii .nii.gz .mha .mhd .raw.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Also write what the result is worth: holes, overlaps, turned tetrahedra, losses, labels, mass.
    #[arg(long, value_name = "C.json")]
    certificate: Option<PathBuf>,
}

/// Milliseconds of the parts of a warp.
#[derive(Debug, Clone, Copy, Default)]
struct Times {
    setup: f64,
    cull: f64,
    raster: f64,
}

/// What a warp did.
struct Outcome {
    made: Volume,
    tally: Tally,
    facts: Facts,
    times: Times,
    /// Name of the GPU, if it was one.
    device: Option<String>,
}

pub fn run(args: &Args) -> Result<Answer> {
    io::check_volume_output(&args.output)?;
    let volume = series::read_step(&load::parse_source(&args.volume)?, Path::new("."), args.step)?;
    let (mesh, moved) = positions(args)?;
    // what the mesh's coordinates are in
    let world_from_mesh = match args.units {
        Units::World => DAffine3::IDENTITY,
        Units::Voxel => volume.grid.world_from_voxel,
    };
    let to_world = |points: &[DVec3]| points.iter().map(|p| world_from_mesh.transform_point3(*p)).collect::<Vec<_>>();
    let (rest, moved) = (to_world(&mesh.points), to_world(&moved));
    let output = output_grid(args, &volume.grid, world_from_mesh, &moved)?;
    let options = WarpOptions {
        interpolation: args.interpolation.into(),
        outside: args.outside,
        density: args.density,
        culling: match args.culling {
            CullingArg::Exact => Culling::Exact,
            CullingArg::Cells => Culling::Cells { size: args.cell },
            CullingArg::None => Culling::None,
        },
        reference: false,
    };
    let job = Job { volume: &volume, output: &output, tets: &mesh.tets, rest: &rest, moved: &moved, options: &options };
    let gpu = device(args, &volume, &options)?;
    let outcome = match &gpu {
        Some(gpu) => job.repeat_on(gpu, args.repeat),
        None => with_samples!(&volume.samples, v => job.repeat(v, args.repeat)),
    }
    .with_context(|| format!("{} warped by {}", args.volume, args.tets.display()))?;
    io::write_volume(&args.output, &outcome.made, &io::WriteOptions::default())?;
    let mut answer = answer(args, &outcome);
    if let Some(path) = &args.certificate {
        let subject = Subject {
            input: &volume,
            output: &outcome.made,
            interpolation: options.interpolation,
            outside: options.outside,
            density: options.density,
        };
        // the mesh need not fill the grid, and it is all there is
        let field = TetField { tets: &mesh.tets, rest: &rest, deformed: &moved, fills: false, exact: None };
        let certificate = certificate::of_tets(&subject, &field).map_err(EvaluateError::from)?;
        attach(&mut answer, &certificate, path, &["output", "dims", "tets", "backend"])?;
    }
    Ok(answer)
}

/// The GPU, if it is to be used.
fn device(args: &Args, volume: &Volume, options: &WarpOptions) -> Result<Option<Gpu>> {
    let unsupported = WarpPass::unsupported(volume, options);
    match (args.backend.into(), unsupported) {
        (Backend::Cpu, _) | (Backend::Auto, Some(_)) => Ok(None),
        (Backend::Gpu, Some(reason)) => bail!("--backend gpu: {reason} on the GPU; use --backend cpu"),
        (Backend::Gpu, None) => Ok(Some(Gpu::open(Preference::Any)?)),
        (Backend::Auto, None) => Ok(Gpu::open(Preference::Any).ok().filter(|g| !g.is_software())),
    }
}

/// The mesh, and the deformed position of each of its points.
fn positions(args: &Args) -> Result<(TetMesh, Vec<DVec3>)> {
    let mesh = io::read_tets(&args.tets)?;
    let second = Path::new(&args.deformed);
    if let Some(moved) = mesh.vectors(&args.deformed) {
        let moved = moved.to_vec();
        return Ok((mesh, moved));
    }
    if !io::is_tets_path(second) {
        let names: Vec<_> = mesh.vectors.iter().map(|v| v.name.as_str()).collect();
        let has = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        bail!(
            "{}: no point vectors named {}; the file has {has}, and --deformed may also name a second mesh",
            args.tets.display(),
            args.deformed
        );
    }
    let other = io::read_tets(second)?;
    if other.tets != mesh.tets || other.points.len() != mesh.points.len() {
        bail!(
            "{}: {} points and {} tetrahedra, not the {} and {} of {} with the same numbering; the deformed mesh must differ only in its points",
            second.display(),
            other.points.len(),
            other.tets.len(),
            mesh.points.len(),
            mesh.tets.len(),
            args.tets.display()
        );
    }
    Ok((mesh, other.points))
}

fn output_grid(args: &Args, input: &Grid, world_from_mesh: DAffine3, moved: &[DVec3]) -> Result<Grid> {
    match args.grid.as_str() {
        "like" => Ok(*input),
        "around" => {
            let voxel_from_world = input.voxel_from_world();
            let voxels: Vec<DVec3> = moved.iter().map(|p| voxel_from_world.transform_point3(*p)).collect();
            let Some((lo, hi)) = crate::mesh::tets::bounds(&voxels) else { return Ok(*input) };
            let (lo, hi) = ((lo + 1e-6).floor(), (hi - 1e-6).ceil());
            let size = hi - lo + 1.0;
            if !(size.element_product() < (1u64 << 40) as f64) {
                bail!("the deformed mesh spans {size} voxels; give a --grid");
            }
            let frame = input.world_from_voxel * DAffine3::from_translation(lo);
            Ok(Grid::new(size.to_array().map(|n| n as usize), frame, input.space)?)
        }
        file => {
            let grid = io::read_grid(Path::new(file))?;
            Ok(Grid::new(grid.dims, world_from_mesh * grid.world_from_voxel, input.space)?)
        }
    }
}

struct Job<'a> {
    volume: &'a Volume,
    output: &'a Grid,
    tets: &'a [[u32; 4]],
    rest: &'a [DVec3],
    moved: &'a [DVec3],
    options: &'a WarpOptions,
}

impl Job<'_> {
    /// The same again and again into one output, as in a program that stays open.
    fn repeat<T: Fetch>(&self, samples: &[T], times: u32) -> Result<Outcome> {
        let (output, channels) = (self.output, self.volume.channels);
        let input = Sampler::new(samples, self.volume.grid.dims, channels);
        let mut out: Vec<T> = bytemuck::try_zeroed_vec(output.len() * channels)
            .map_err(|()| anyhow::anyhow!("{} voxels are more than this machine can hold", output.len()))?;
        let mut all = Vec::new();
        let mut result = (Tally::default(), Facts::default());
        for _ in 0..times {
            let started = Instant::now();
            let warp = Warp::new(&self.volume.grid, output, self.tets, self.rest, self.moved)?;
            let setup = started.elapsed();
            let candidates = warp.candidates(self.options.culling)?;
            let cull = started.elapsed() - setup;
            let tally = warp.run(&candidates, input, self.options, &mut out)?;
            let raster = started.elapsed() - setup - cull;
            all.push(Times { setup: ms(setup), cull: ms(cull), raster: ms(raster) });
            result = (tally, *warp.facts());
        }
        let mut made = Volume::new(*output, channels, T::wrap(out));
        made.rescale = self.volume.rescale;
        Ok(Outcome { made, tally: result.0, facts: result.1, times: Times::medians(&all), device: None })
    }

    /// The same on the GPU; what is read back counts as `raster`, and so do the candidates.
    fn repeat_on(&self, gpu: &Gpu, times: u32) -> Result<Outcome> {
        let pass = WarpPass::new(gpu)?;
        let mut all = Vec::new();
        loop {
            let started = Instant::now();
            let warp = Warp::new(&self.volume.grid, self.output, self.tets, self.rest, self.moved)?;
            let setup = started.elapsed();
            let (made, tally) = pass.volume(gpu, &warp, self.volume, self.output, self.options)?;
            let raster = started.elapsed() - setup;
            all.push(Times { setup: ms(setup), cull: 0.0, raster: ms(raster) });
            if all.len() == times as usize {
                let (facts, times) = (*warp.facts(), Times::medians(&all));
                return Ok(Outcome { made, tally, facts, times, device: Some(gpu.name()) });
            }
        }
    }
}

fn ms(d: Duration) -> f64 {
    d.as_secs_f64() * 1e3
}

impl Times {
    fn medians(all: &[Self]) -> Self {
        let median = |part: fn(&Self) -> f64| {
            let mut v: Vec<f64> = all.iter().map(part).collect();
            v.sort_by(f64::total_cmp);
            v[v.len() / 2]
        };
        Self { setup: median(|t| t.setup), cull: median(|t| t.cull), raster: median(|t| t.raster) }
    }
}

fn answer(args: &Args, outcome: &Outcome) -> Answer {
    let Outcome { made, tally, facts, times, device } = outcome;
    let voxels = made.grid.len() as u64;
    let total = times.setup + times.cull + times.raster;
    let rate = if tally.candidates == 0 { 0.0 } else { tally.written as f64 / tally.candidates as f64 };
    let jacobian = facts.jacobian.map(|[min, max]| json!({ "min": min, "max": max }));
    let [x, y, z] = made.grid.dims;
    let mut text = format!(
        "{}: {x} x {y} x {z}, {} voxels written, {:.1} % of those looked at; {total:.1} ms (setup {:.1}, cull {:.1}, raster {:.1})\n",
        args.output.display(),
        tally.written,
        100.0 * rate,
        times.setup,
        times.cull,
        times.raster
    );
    let mut warn = |count: u64, what: &str| {
        if count > 0 {
            text.push_str(&format!("  {count} {what}\n"));
        }
    };
    warn(facts.inverted as u64, "tetrahedra are turned inside out by the deformation");
    warn(facts.degenerate as u64, "tetrahedra without volume were left out");
    warn(tally.covered_twice, "times a voxel lay in a further tetrahedron: the mesh overlaps itself");
    warn(tally.beyond, "voxels come from beyond the volume and got the outside value");
    Answer {
        json: json!({
            "output": args.output.to_string_lossy(),
            "dims": made.grid.dims,
            "tets": facts.tets,
            "voxels": voxels,
            "candidates": tally.candidates,
            "inside": tally.written,
            "pass_rate": rate,
            "cells": tally.cells,
            "cells_kept": tally.cells_kept,
            "uncovered": voxels - tally.written,
            "covered_twice": tally.covered_twice,
            "shared": tally.repeated - tally.covered_twice,
            "beyond": tally.beyond,
            "inverted_tets": facts.inverted,
            "degenerate_tets": facts.degenerate,
            "jacobian": jacobian,
            "backend": if device.is_some() { "gpu" } else { "cpu" },
            "device": device.as_deref().unwrap_or("CPU"),
            "ms": { "setup": times.setup, "cull": times.cull, "raster": times.raster, "total": total },
        }),
        text,
    }
}

//! Export of an object: its deformed volume, cut by its proxy mesh, on a grid of its own.

use std::time::Instant;

use super::EvaluateError;
use super::export::{self, ExportOptions, ExportReport, Filled, Precision, Progress, unwatched};
use super::load::Object;
use super::mask;
use super::picture::{Backend, device};
use crate::gpu::{Gpu, ResampleJob, ResamplePass};
use crate::volume::sampling::Interpolation;
use crate::volume::{Grid, Volume};

/// The exported volume, and what was done.
#[derive(Debug)]
pub struct Exported {
    pub volume: Volume,
    pub report: ExportReport,
    /// Voxels that were set to the outside value because they lie outside the proxy mesh.
    pub outside_mesh: usize,
    /// Name of the GPU that filled the grid, if one did.
    pub device: Option<String>,
    /// A sentence if a GPU was asked for and could not do it.
    pub remark: Option<String>,
    /// Milliseconds, all together.
    pub ms: f64,
}

/// Resamples an object. The GPU only fills the grid; whatever it cannot do exactly is done by the CPU, and said.
///
/// # Errors
/// If the grid makes no sense or is too large, the GPU is asked for and none can be opened, or it fails.
pub fn export(object: &Object, options: &ExportOptions, backend: Backend) -> Result<Exported, EvaluateError> {
    export_watched(object, options, backend, &unwatched)
}

/// The same with progress, which can stop it (not while the GPU fills).
///
/// # Errors
/// As [`export()`], and if it was stopped.
pub fn export_watched(
    object: &Object,
    options: &ExportOptions,
    backend: Backend,
    progress: Progress<'_>,
) -> Result<Exported, EvaluateError> {
    let started = Instant::now();
    let prepared = object.stack.prepared();
    let gpu = device(backend)?;
    let refused = gpu.as_ref().and_then(|gpu| unsupported(gpu, &object.volume, options));
    let gpu = gpu.filter(|_| refused.is_none());
    let (mut volume, report) = match &gpu {
        Some(gpu) => export::export_filled(&object.volume, &prepared, options, |grid, outside| {
            on_gpu(gpu, object, options, grid, outside)
        })?,
        None => export::export(&object.volume, &prepared, options, progress)?,
    };
    let outside_mesh = if object.shaped {
        let value = options.outside.unwrap_or(if volume.channels == 1 { report.before.min } else { 0.0 });
        mask::clear_outside(&mut volume, &object.mesh, &object.topology, object.overlaps, value)?
    } else {
        0
    };
    Ok(Exported {
        volume,
        report,
        outside_mesh,
        device: gpu.map(|g| g.name()),
        remark: refused.map(|why| format!("exported on the CPU: {why}")),
        ms: started.elapsed().as_secs_f64() * 1e3,
    })
}

/// Why the GPU does not do what is asked.
fn unsupported(gpu: &Gpu, volume: &Volume, options: &ExportOptions) -> Option<&'static str> {
    match (options.precision, options.interpolation) {
        (Precision::Reference, _) => Some("the reference is computed in f64"),
        (_, Interpolation::Cubic) => Some("the GPU interpolates linearly or takes the nearest sample"),
        (_, Interpolation::Nearest | Interpolation::Linear) => ResamplePass::unsupported(gpu, volume),
    }
}

fn on_gpu(
    gpu: &Gpu,
    object: &Object,
    options: &ExportOptions,
    grid: &Grid,
    outside: f64,
) -> Result<Filled, EvaluateError> {
    let nearest = options.interpolation == Interpolation::Nearest;
    let job = ResampleJob { stack: &object.stack, output: grid, nearest, outside: outside as f32 };
    let (samples, tally) = ResamplePass::new(gpu)?.samples(gpu, &object.volume, job)?;
    Ok(Filled { samples, moved: tally.moved, outside: tally.outside })
}

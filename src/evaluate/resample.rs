//! Export of an object: its deformed volume, cut by its proxy mesh, on a grid of its own.

use std::time::Instant;

use super::EvaluateError;
use super::export::{self, ExportOptions, ExportReport, Progress, unwatched};
use super::load::Object;
use super::mask;
use crate::volume::Volume;

/// The exported volume, and what was done.
#[derive(Debug)]
pub struct Exported {
    pub volume: Volume,
    pub report: ExportReport,
    /// Voxels that were set to the outside value because they lie outside the proxy mesh.
    pub outside_mesh: usize,
    /// Milliseconds, all together.
    pub ms: f64,
}

/// Resamples an object on the CPU.
///
/// # Errors
/// If the grid makes no sense or is too large.
pub fn export(object: &Object, options: &ExportOptions) -> Result<Exported, EvaluateError> {
    export_watched(object, options, &unwatched)
}

/// The same with progress, which can stop it.
///
/// # Errors
/// As [`export`], and if it was stopped.
pub fn export_watched(
    object: &Object,
    options: &ExportOptions,
    progress: Progress<'_>,
) -> Result<Exported, EvaluateError> {
    let started = Instant::now();
    let prepared = object.stack.prepared();
    let (mut volume, report) = export::export(&object.volume, &prepared, options, progress)?;
    let outside_mesh = if object.shaped {
        let value = options.outside.unwrap_or(if volume.channels == 1 { report.before.min } else { 0.0 });
        mask::clear_outside(&mut volume, &object.mesh, &object.topology, value)?
    } else {
        0
    };
    Ok(Exported { volume, report, outside_mesh, ms: started.elapsed().as_secs_f64() * 1e3 })
}

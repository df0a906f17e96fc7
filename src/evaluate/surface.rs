//! The iso-surface of an object as a mesh.
//!
//! What is deformed, or cut by a mesh, is resampled first: in `f32`, so that nothing is rounded to the sample type, and with
//! cubic interpolation. Strokes then move the data, and the surface is smooth again.

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

use super::EvaluateError;
use super::export::ExportOptions;
use super::load::Object;
use super::picture::Backend;
use super::resample;
use crate::mesh::contour::Contour;
use crate::spline::refine::{self, RefineReport};
use crate::spline::{self, Spline, cells};
use crate::volume::sampling::Interpolation;
use crate::volume::{Samples, Scalar, Volume};
use crate::with_samples;

/// Which surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// Of the C1 spline, after so many corrections; `None`: as many as suit the samples.
    Spline { corrections: Option<u32> },
    /// Of the trilinear function, by marching cubes.
    Cells,
}

/// How a surface is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceOptions {
    /// In real values; `None`: what separates the object from its surroundings.
    pub iso: Option<f64>,
    pub method: Method,
    /// Of the spline: largest distance of an edge's middle from the surface, in voxels.
    pub tolerance: Option<f64>,
}

/// A surface, and how long it took.
#[derive(Debug, Clone)]
pub struct Surface {
    /// In the world.
    pub contour: Contour,
    pub iso: f64,
    pub refined: Option<RefineReport>,
    pub resampled: bool,
    /// Milliseconds: resampling, making the spline, the mesh, all.
    pub ms_resample: f64,
    pub ms_spline: f64,
    pub ms_mesh: f64,
    pub ms_total: f64,
}

pub(super) fn since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Makes the mesh of an object's iso-surface.
///
/// # Errors
/// If there is nothing at or above the isovalue, or the object cannot be resampled.
pub fn surface(object: &Object, options: &SurfaceOptions) -> Result<Surface, EvaluateError> {
    let started = Instant::now();
    let volume = sculpted(object)?;
    let ms_resample = since(started);
    let channel = volume.channels - 1;
    let iso = options.iso.unwrap_or(object.iso);
    let frame = &volume.grid.world_from_voxel;
    let making = Instant::now();
    let mut ms_spline = 0.0;
    let mut refined = None;
    let contour = match options.method {
        Method::Cells => cells::surface(&volume, channel, iso),
        Method::Spline { corrections } => {
            let spline = Spline::of_volume(&volume, channel, steps(object, corrections));
            ms_spline = since(making);
            match options.tolerance {
                None => spline::surface::surface(&spline, iso, frame),
                Some(tolerance) => {
                    let (contour, report) = refine::surface(&spline, iso, frame, tolerance);
                    refined = Some(report);
                    contour
                }
            }
        }
    };
    if contour.mesh.triangles.is_empty() {
        let [lo, hi] = object.field.range;
        return Err(EvaluateError::NoSurface { iso, lo, hi });
    }
    Ok(Surface {
        contour,
        iso,
        refined,
        resampled: matches!(volume, Cow::Owned(_)),
        ms_resample,
        ms_spline,
        ms_mesh: since(making) - ms_spline,
        ms_total: since(started),
    })
}

pub(super) fn steps(object: &Object, asked: Option<u32>) -> u32 {
    asked.unwrap_or_else(|| spline::suggested_steps(&object.volume.samples))
}

/// The volume as it was sculpted: the object's own if nothing was done to it.
pub(super) fn sculpted(object: &Object) -> Result<Cow<'_, Volume>, EvaluateError> {
    if !object.is_sculpted() {
        return Ok(Cow::Borrowed(&object.volume));
    }
    let floats = match object.volume.samples {
        Samples::F32(_) | Samples::F64(_) => None,
        _ => Some(Object { volume: Arc::new(in_floats(&object.volume)), ..object.clone() }),
    };
    let options = ExportOptions { interpolation: Interpolation::Cubic, ..ExportOptions::default() };
    let exported = resample::export(floats.as_ref().unwrap_or(object), &options, Backend::Cpu)?;
    Ok(Cow::Owned(exported.volume))
}

/// The same stored values as `f32`.
fn in_floats(volume: &Volume) -> Volume {
    fn widened<T: Scalar>(values: &[T]) -> Vec<f32> {
        values.iter().map(|v| v.to_f32()).collect()
    }
    Volume { samples: with_samples!(&volume.samples, v => Samples::F32(widened(v))), ..*volume }
}

//! The deformed volume as a new volume: resampled through the backward map.
//!
//! # Theory
//!
//! The paper draws the deformed object slice by slice and reads the pictures back as a new 3D texture (Westermann and
//! Rezk-Salama 2001, section 3). That leaves the accuracy to the picture. Here every voxel centre of the output is taken to
//! the world, through the backward map, and into the voxels of the input, where the volume is sampled: the same picture
//! without its 8 bits, on a grid of any frame.
//!
//! All geometry is in world space in `f64`: frames may be oblique, sheared, flipped and anisotropic, on both sides.
//! [`Precision::Reference`] does exactly this for every voxel. [`Precision::Fast`] gives the same up to a stated error:
//!
//! * blocks that no support box of the map touches are copied (or, between different lattices, sampled along straight rows);
//! * a map that can be written in voxel coordinates, as a stack of deformers can, is evaluated there at every voxel in `f32`
//!   relative to the block, good to 1e-5 of a voxel; bounds of the displacement over a layer of a block leave out the
//!   deformers that do not act on it, and say whether it comes from within the volume;
//! * of other maps, which are smooth, the displacement is evaluated at some points of a block and interpolated if it is within
//!   1/1000 of a voxel there (see `shift.rs`);
//! * samples are looked up by vector code (`kernel.rs`).
//!
//! # Practice
//!
//! * Untouched voxels and shifts by whole voxels are bit-exact for all sample types: displacements are differences in the
//!   world (zero stays zero), and coordinates within 1e-9 of a whole number are that number.
//! * Label volumes want [`Interpolation::Nearest`]: no value appears that was not there.
//! * A value is interpolated as stored; slope and intercept go along unchanged.
//! * Beyond the texture cube of the input stands [`ExportOptions::outside`]. What the chosen grid cannot hold is counted in
//!   [`ExportReport::clipped`]; [`GridChoice::SameGrown`] adds layers until nothing is.
//! * Memory is the output plus some 100 KiB a thread; results do not depend on the number of threads.

mod beyond;
mod grid;
mod kernel;
mod plan;
mod run;
mod shift;

use std::ops::ControlFlow;
use std::time::Instant;

use crate::math::parallel;
use glam::{DAffine3, DVec3};

use crate::deform::{Framed, Prepared};
use crate::math::{BackwardMap, Identity};
use crate::volume::fetch::Fetch;
use crate::volume::sampling::Interpolation;
use crate::volume::statistics::{Statistics, statistics, stored_statistics};
use crate::volume::{Grid, GridError, Samples, Volume};
use crate::with_samples;
pub use grid::GridChoice;
pub use plan::{output_grid, stored_outside};
use run::{Job, Watch};
use shift::{Block, EDGE, Supports};

/// How the map and the samples are evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// Within 1/1000 of a voxel of the reference.
    #[default]
    Fast,
    /// The map at every voxel, all in `f64`.
    Reference,
}

/// What to make.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExportOptions {
    pub grid: GridChoice,
    pub interpolation: Interpolation,
    pub precision: Precision,
    /// The real value (after slope and intercept) beyond the input, rounded to what the sample type can hold. By default the
    /// lowest value of a scalar volume and 0 in every channel of others.
    pub outside: Option<f64>,
    /// The greatest number of voxels of the output.
    pub limit: u64,
}

impl Default for ExportOptions {
    fn default() -> Self {
        Self {
            grid: GridChoice::SameGrown,
            interpolation: Interpolation::Linear,
            precision: Precision::Fast,
            outside: None,
            limit: 1 << 33,
        }
    }
}

/// A deformation that can be exported.
///
/// The export needs nothing beyond [`BackwardMap`]; maps that can be written in voxel coordinates say so here.
pub trait ExportMap: BackwardMap {
    /// The map of coordinates of which the world is an affine image, for many points at once.
    fn in_frame(&self, world_from_local: &DAffine3) -> Option<Framed> {
        let _ = world_from_local;
        None
    }
}

impl ExportMap for Identity {}

impl ExportMap for Prepared {
    fn in_frame(&self, world_from_local: &DAffine3) -> Option<Framed> {
        Some(Self::in_frame(self, world_from_local))
    }
}

/// Called now and then, from any thread, with the done part (0 to 1); `Break` stops the work.
pub type Progress<'a> = &'a (dyn Fn(f64) -> ControlFlow<()> + Sync);

/// For callers who neither show progress nor stop.
pub fn unwatched(_: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// What was made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExportReport {
    /// Of the output.
    pub voxels: u64,
    /// Those whose value comes from elsewhere, by more than 1/1000 voxel.
    pub moved: u64,
    /// Those whose value lies beyond the input and is the outside value.
    pub outside: u64,
    /// Material the grid does not hold: voxels of the output's lattice beyond the output in which the deformed volume has
    /// another value than the outside value. Exact unless support boxes reach over more voxels outside the output than it
    /// has (and a million); then it is estimated from part of them.
    pub clipped: u64,
    /// Of the real values.
    pub before: Statistics,
    pub after: Statistics,
    /// Sum of the real values times the volume of a voxel, in world units.
    pub mass_before: f64,
    pub mass_after: f64,
    /// Wall time, in milliseconds.
    pub ms: f64,
}

/// Why there is no export.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ExportError {
    #[error(transparent)]
    Grid(#[from] GridError),
    #[error("a spacing of {0} makes no grid; all three numbers must be positive")]
    Spacing(DVec3),
    #[error(
        "the exported grid would need {voxels} voxels, more than the limit of {limit}; choose a larger spacing, or a grid that does not grow"
    )]
    TooLarge { voxels: u64, limit: u64 },
    #[error("{bytes} bytes for the exported volume are more than this machine can give")]
    OutOfMemory { bytes: u64 },
    #[error("the export was stopped")]
    Cancelled,
}

fn zeroed<T: bytemuck::Zeroable>(count: usize) -> Result<Vec<T>, ExportError> {
    let bytes = count as u64 * size_of::<T>() as u64;
    bytemuck::try_zeroed_vec(count).map_err(|()| ExportError::OutOfMemory { bytes })
}

fn mass(volume: &Volume, facts: &Statistics) -> f64 {
    let voxel = volume.grid.world_from_voxel.matrix3.determinant().abs();
    if facts.count == 0 { 0.0 } else { facts.mean * facts.count as f64 * voxel }
}

/// The deformed volume on the chosen grid.
///
/// # Errors
/// If the grid makes no sense, is too large, or `progress` stopped the work.
pub fn export(
    volume: &Volume,
    map: &dyn ExportMap,
    options: &ExportOptions,
    progress: Progress<'_>,
) -> Result<(Volume, ExportReport), ExportError> {
    with_samples!(&volume.samples, v => typed(volume, v, map, options, Filler::Here(progress)))
}

/// The samples of an output grid that someone else filled.
#[derive(Debug)]
pub struct Filled {
    /// Of the input's type, as many as voxels times channels.
    pub samples: Samples,
    /// As in [`ExportReport`].
    pub moved: u64,
    pub outside: u64,
}

/// The same with an output filled by `fill`, which gets its grid and the stored outside value, not rounded to the sample type.
/// The grid, what is clipped and all statistics are found here.
///
/// # Errors
/// As [`export`], and what `fill` returns.
pub fn export_filled<E: From<ExportError>>(
    volume: &Volume,
    map: &dyn ExportMap,
    options: &ExportOptions,
    mut fill: impl FnMut(&Grid, f64) -> Result<Filled, E>,
) -> Result<(Volume, ExportReport), E> {
    with_samples!(&volume.samples, v => typed(volume, v, map, options, Filler::Other(&mut fill)))
}

/// Who fills the output.
enum Filler<'a, E> {
    Here(Progress<'a>),
    Other(&'a mut dyn FnMut(&Grid, f64) -> Result<Filled, E>),
}

fn typed<T: Fetch, E: From<ExportError>>(
    volume: &Volume,
    samples: &[T],
    map: &dyn ExportMap,
    options: &ExportOptions,
    filler: Filler<'_, E>,
) -> Result<(Volume, ExportReport), E> {
    let clock = Instant::now();
    let input = &volume.grid;
    let facts = stored_statistics(volume);
    let outside = plan::outside(volume, options.outside, || facts);
    let boxes = map.supports();
    let base = grid::ungrown(input, options.grid)?;
    if base.len() as u64 > options.limit {
        return Err(ExportError::TooLarge { voxels: base.len() as u64, limit: options.limit }.into());
    }
    let framed = map.in_frame(&input.world_from_voxel);
    let mut job = Job::new(volume, samples, (map, framed.as_ref(), &boxes), &base, options, outside);
    let mut output = base;
    if options.grid.grows() {
        output = job.grown(&base, options.limit)?;
        job = job.on(&output);
    }

    let Filled { samples, moved, outside } = match filler {
        Filler::Here(progress) => {
            let mut samples = zeroed::<T>(output.len() * volume.channels)?;
            let tally = job.fill(&output, &mut samples, progress)?;
            Filled { samples: T::wrap(samples), moved: tally.moved, outside: tally.outside }
        }
        Filler::Other(fill) => fill(&output, outside)?,
    };
    let clipped = beyond::clipped(&job, &output, grid::reached(input, &output, &boxes));
    let mut made = Volume::new(output, volume.channels, samples);
    made.rescale = volume.rescale;
    let (before, after) = (facts.rescaled(volume.rescale), statistics(&made));
    let report = ExportReport {
        voxels: output.len() as u64,
        moved,
        outside,
        clipped,
        before,
        after,
        mass_before: mass(volume, &before),
        mass_after: mass(&made, &after),
        ms: clock.elapsed().as_secs_f64() * 1e3,
    };
    Ok((made, report))
}

/// The displacement field on a grid: for each voxel the world vector from its centre to the place its value comes from
/// (3 channels, `f32`). The exact map at every voxel that a support box touches.
///
/// # Errors
/// If memory does not suffice or `progress` stopped the work.
pub fn export_field(grid: &Grid, map: &dyn BackwardMap, progress: Progress<'_>) -> Result<Volume, ExportError> {
    let [nx, ny, nz] = grid.dims;
    let supports = Supports::new(grid, &map.supports());
    let mut field = zeroed::<f32>(grid.len() * 3)?;
    let watch = Watch::new(progress, nz.div_ceil(EDGE));
    parallel::chunks_mut(&mut field, EDGE * nx * ny * 3, &|index, chunk| {
        if watch.stopped() {
            return;
        }
        for (row, vectors) in chunk.chunks_exact_mut(nx * 3).enumerate() {
            let (j, k) = (row % ny, index * EDGE + row / ny);
            let line = Block { lo: [0, j as i64, k as i64], size: [nx, 1, 1] };
            if !supports.touch(&line) {
                continue;
            }
            for (i, vector) in vectors.chunks_exact_mut(3).enumerate() {
                let p = grid.world_from_voxel.transform_point3(line.voxel(i, 0, 0));
                vector.copy_from_slice(&(map.backward(p) - p).as_vec3().to_array());
            }
        }
        watch.step();
    });
    watch.finish()?;
    Ok(Volume::new(*grid, 3, Samples::F32(field)))
}

//! What an export would start from, for those who fill the grid in another way: its grid and its outside value.

use super::grid;
use super::run::Job;
use super::{ExportError, ExportMap, ExportOptions};
use crate::volume::fetch::Fetch;
use crate::volume::statistics::{Statistics, stored_statistics};
use crate::volume::{Grid, Volume};
use crate::with_samples;

/// The grid that [`super::export`] would write on.
///
/// # Errors
/// If the grid makes no sense or is too large.
pub fn output_grid(volume: &Volume, map: &dyn ExportMap, options: &ExportOptions) -> Result<Grid, ExportError> {
    let base = grid::ungrown(&volume.grid, options.grid)?;
    if base.len() as u64 > options.limit {
        return Err(ExportError::TooLarge { voxels: base.len() as u64, limit: options.limit });
    }
    if !options.grid.grows() {
        return Ok(base);
    }
    let outside = stored_outside(volume, options.outside);
    with_samples!(&volume.samples, v => grown(volume, v, map, options, base, outside))
}

fn grown<T: Fetch>(
    volume: &Volume,
    samples: &[T],
    map: &dyn ExportMap,
    options: &ExportOptions,
    base: Grid,
    outside: f64,
) -> Result<Grid, ExportError> {
    let boxes = map.supports();
    let framed = map.in_frame(&volume.grid.world_from_voxel);
    let job = Job::new(volume, samples, (map, framed.as_ref(), &boxes), &base, options, outside);
    job.grown(&base, options.limit)
}

/// The stored value beyond the input, not yet rounded to the sample type: of the given real value, or by default the lowest
/// of a scalar volume and 0 in every channel of others.
pub fn stored_outside(volume: &Volume, real: Option<f64>) -> f64 {
    outside(volume, real, || stored_statistics(volume))
}

/// The same; `facts`, the statistics of the stored values, are asked for only where they matter.
pub(super) fn outside(volume: &Volume, real: Option<f64>, facts: impl FnOnce() -> Statistics) -> f64 {
    if let Some(real) = real {
        return volume.rescale.stored(real);
    }
    let slope = volume.rescale.slope;
    if volume.channels != 1 || slope == 0.0 || slope.is_nan() {
        return 0.0;
    }
    let Statistics { min, max, .. } = facts();
    // the lowest real value is the highest stored one where the slope is negative
    let lowest = if slope < 0.0 { max } else { min };
    if lowest.is_finite() { lowest } else { 0.0 }
}

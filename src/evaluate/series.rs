//! Steps in time of a document's volume.
//!
//! Steps are counted from 0. All of them lie on one grid, and all are shown as the first one is: windows and presets of transfer
//! functions, the isovalue and the camera go by its values, whichever step was opened first. So nothing jumps from step to
//! step, and a picture of a step is the same wherever it is made.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::EvaluateError;
use super::load::read_source;
use crate::io::{IoError, Series};
use crate::scene::VolumeSource;
use crate::volume::{Grid, ScalarType, Volume};

/// What all steps of a series have in common, by the first.
#[derive(Debug)]
pub struct Basis {
    /// The file of the first step, or a name.
    pub(super) path: PathBuf,
    /// Where the others are read, if they are in files.
    pub(super) series: Option<Series>,
    pub grid: Grid,
    pub scalar: ScalarType,
    pub channels: usize,
    /// Smallest and largest real value of the first step.
    pub range: [f64; 2],
    /// How often values between them occur in the first step.
    pub counts: Vec<u64>,
    /// A real value that separates object from surroundings.
    pub iso: f64,
    /// Centre and radius, in the world, of a ball around what stands out from the surroundings in the first step.
    pub focus: (DVec3, f64),
    /// Of the series; 1 if the volume is none.
    pub steps: usize,
}

/// Part of a voxel by which grids of steps may lie apart: headers in text are rounded.
const APART: f64 = 0.01;

impl Basis {
    /// A step as it is compared with the first: on the very same grid.
    pub(super) fn fit(&self, path: &Path, mut volume: Volume) -> Result<Volume, EvaluateError> {
        let kind = |dims: [usize; 3], scalar: ScalarType, channels: usize| {
            let [x, y, z] = dims;
            let channels = if channels == 1 { String::new() } else { format!(" in {channels} channels") };
            format!("{x} x {y} x {z} {}{channels}", scalar.name())
        };
        let first = kind(self.grid.dims, self.scalar, self.channels);
        let this = kind(volume.grid.dims, volume.samples.scalar_type(), volume.channels);
        let differs = |what: String| Err(EvaluateError::StepDiffers { path: path.to_owned(), what });
        if this != first {
            return differs(format!("is {this} and step 0 is {first}"));
        }
        let map = self.grid.voxel_from_world() * volume.grid.world_from_voxel;
        let size = self.grid.size();
        let corner = |i: usize| DVec3::from_array(std::array::from_fn(|a| if i >> a & 1 == 0 { 0.0 } else { size[a] }));
        let apart = (0..8).map(corner).map(|c| (map.transform_point3(c) - c).abs().max_element()).fold(0.0, f64::max);
        if apart > APART || volume.grid.space != self.grid.space {
            return differs("lies elsewhere than step 0".to_owned());
        }
        volume.grid = self.grid;
        Ok(volume)
    }
}

/// How many steps there are: 1 for what is no series.
///
/// # Errors
/// If a file cannot be read or its header is not sound.
pub fn steps(source: &VolumeSource, base: &Path) -> Result<usize, EvaluateError> {
    Ok(files(source, base)?.map_or(1, |series| series.steps()))
}

/// Reads one step as it is in the file.
///
/// # Errors
/// If there is no such step, and as [`read_source`].
pub fn read_step(source: &VolumeSource, base: &Path, step: usize) -> Result<Volume, EvaluateError> {
    match files(source, base)? {
        Some(series) => Ok(series.read(step)?),
        None if step == 0 => read_source(source, base),
        None => Err(no_step(&name(source, base), step, 1)),
    }
}

/// The files of a source, if it is one of files.
pub(super) fn files(source: &VolumeSource, base: &Path) -> Result<Option<Series>, EvaluateError> {
    match source {
        VolumeSource::File(path) => Ok(Some(Series::open(&base.join(path))?)),
        VolumeSource::Embedded(_) | VolumeSource::Phantom { .. } => Ok(None),
    }
}

/// What a source is called in a sentence.
pub(super) fn name(source: &VolumeSource, base: &Path) -> PathBuf {
    match source {
        VolumeSource::File(path) | VolumeSource::Embedded(path) => base.join(path),
        VolumeSource::Phantom { name, .. } => PathBuf::from(format!("phantom:{name}")),
    }
}

pub(super) fn no_step(path: &Path, step: usize, steps: usize) -> EvaluateError {
    IoError::NoStep { path: path.to_owned(), step, steps }.into()
}

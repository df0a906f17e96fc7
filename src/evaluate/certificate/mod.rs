//! What an exported volume is worth: facts that are measured on the result, not promised by the method.
//!
//! # Theory
//!
//! A deformed volume is sound if every voxel has exactly one source (no hole, no overlap), the deformation keeps the
//! orientation everywhere (its determinant is positive, so it does not fold), nothing of the object was left beyond the grid,
//! no value was cut by the sample type, and a volume of labels has no label that it did not have. Beside these stand facts
//! without a verdict: how much is stretched and squeezed, how well the inverse agrees with the forward map, and the total
//! mass (the sum of values times the volume of a voxel) before and after. A deformation changes the mass of what it
//! stretches unless values are divided by the determinant.
//!
//! # Practice
//!
//! [`of_map`] certifies what came through a backward map, [`of_tets`] what came through deformed tetrahedra: a lattice, or any
//! mesh, whoever warped it. Every voxel is visited in `f64`, by code that shares nothing with the export but the
//! deformation. Determinants of a map and residuals of the inverse are taken at every n-th voxel. What lies about the output
//! is searched for clipped material to half the output's size. Memory is a few megabytes a thread; a byte a voxel more if
//! voxels are in no tetrahedron.

mod audit;
mod holes;
mod layers;
mod values;

use glam::DVec3;
use serde::Serialize;

use crate::deform::Prepared;
use crate::math::BackwardMap;
use crate::volume::sampling::Interpolation;
use crate::volume::statistics::statistics;
use crate::volume::{GridError, Volume};
use crate::warp::WarpError;

use audit::{Audit, Tally};
use layers::{Layers, MapLayers, TetLayers, View};
use values::Values;

/// What is certified, and how it was made.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    pub input: &'a Volume,
    /// May have another grid and sample type.
    pub output: &'a Volume,
    pub interpolation: Interpolation,
    /// The stored value where nothing is, before it was rounded to the sample type.
    pub outside: f64,
    /// Whether values were divided by the determinant.
    pub density: bool,
}

/// A deformation by tetrahedra.
#[derive(Debug, Clone, Copy)]
pub struct TetField<'a> {
    pub tets: &'a [[u32; 4]],
    /// World positions of the points.
    pub rest: &'a [DVec3],
    pub deformed: &'a [DVec3],
    /// Whether the mesh is to hold every voxel of the output, as lattices do.
    pub fills: bool,
    /// The map that the mesh stands for: its forward side is then what the inverse is measured against.
    pub exact: Option<&'a Prepared>,
}

/// Where voxels of the output come from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Coverage {
    pub voxels: u64,
    /// Voxels whose value comes from within the input, and the others.
    pub inside_input: u64,
    pub outside_input: u64,
    /// Only of tetrahedra.
    pub tets: Option<TetCoverage>,
}

/// How often voxel centres lie in tetrahedra.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TetCoverage {
    pub none: u64,
    pub once: u64,
    /// In the insides of two or more.
    pub more: u64,
    /// In none, and shut in by others.
    pub enclosed: u64,
    /// Tetrahedra without volume; they hold nothing.
    pub degenerate: u64,
}

/// The determinant of the deformation: the deformed volume over the undeformed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Jacobian {
    /// Tetrahedra, or voxels at which a map was looked at.
    pub samples: u64,
    pub min: Option<f64>,
    pub max: Option<f64>,
    /// Where it is not positive: the deformation folds.
    pub not_positive: u64,
}

/// The distance, in voxels of the output, between a voxel and where the forward map takes its source.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Inverse {
    pub samples: u64,
    pub max: f64,
    pub mean: f64,
    /// Voxels for which there is no single answer, because the deformation folds.
    pub failed: u64,
}

/// Values of a volume of labels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Labels {
    /// Different values of the input and of the output.
    pub before: u64,
    pub after: u64,
    /// Values of the output that the input does not have (16 at most), the outside value aside.
    pub added: Vec<f64>,
    /// Voxels that have one.
    pub added_voxels: u64,
    /// Voxels whose value is none of the samples about the place they come from: interpolation made it, even if it is
    /// the name of another label.
    pub blended_voxels: u64,
}

/// Sum of the real values times the volume of a voxel, in world units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Mass {
    pub before: f64,
    pub after: f64,
}

/// See the module's page.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Certificate {
    /// Whether no fault was found.
    pub sound: bool,
    /// A sentence for each fault.
    pub faults: Vec<String>,
    pub interpolation: &'static str,
    pub coverage: Coverage,
    pub jacobian: Jacobian,
    pub inverse: Inverse,
    /// Voxels with a value that the sample type cannot hold.
    pub values_clipped: u64,
    /// Voxels of the output's lattice beyond the output in which the deformed volume has another value than the outside.
    pub material_clipped: u64,
    /// Of scalar volumes of integers with few values (64) in patches, and wherever the interpolation is to keep values
    /// (unless there are more than a million).
    pub labels: Option<Labels>,
    pub mass: Mass,
}

/// Why nothing can be certified.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CertificateError {
    #[error(transparent)]
    Grid(#[from] GridError),
    #[error(transparent)]
    Warp(#[from] WarpError),
    #[error("a volume of {input} channels does not become one of {output}; both must have the same")]
    Channels { input: usize, output: usize },
}

impl Jacobian {
    fn take(&mut self, d: f64) {
        self.samples += 1;
        if d.is_nan() || d <= 0.0 {
            self.not_positive += 1;
        }
        // where a map is singular the volume is without bound; that is no number for a file
        if d.is_finite() {
            self.stretch(d, d);
        }
    }

    fn stretch(&mut self, lo: f64, hi: f64) {
        self.min = Some(self.min.map_or(lo, |m| m.min(lo)));
        self.max = Some(self.max.map_or(hi, |m| m.max(hi)));
    }

    fn join(&mut self, other: &Self) {
        self.samples += other.samples;
        self.not_positive += other.not_positive;
        if let (Some(lo), Some(hi)) = (other.min, other.max) {
            self.stretch(lo, hi);
        }
    }
}

impl Inverse {
    fn take(&mut self, residual: Result<f64, ()>) {
        let Ok(residual) = residual else {
            self.failed += 1;
            return;
        };
        self.samples += 1;
        self.max = self.max.max(residual);
        self.mean += (residual - self.mean) / self.samples as f64;
    }

    fn join(&mut self, other: &Self) {
        let samples = self.samples + other.samples;
        if samples > 0 {
            self.mean += (other.mean - self.mean) * (other.samples as f64 / samples as f64);
        }
        self.samples = samples;
        self.max = self.max.max(other.max);
        self.failed += other.failed;
    }
}

/// The certificate of a volume that was resampled through a backward map.
///
/// # Errors
/// If input and output do not belong together.
pub fn of_map(subject: &Subject, map: &Prepared) -> Result<Certificate, CertificateError> {
    let supports = map.supports();
    let reached = subject.input.grid.corners().into_iter().chain(supports.iter().flat_map(|b| b.corners()));
    let view = View::around(&subject.output.grid, reached)?;
    let layers = MapLayers::new(&view, &subject.input.grid, map);
    let (tally, labels) = audit(subject, &view, &layers)?;
    let jacobian = tally.jacobian;
    Ok(certificate(subject, tally, labels, jacobian, None))
}

/// The certificate of a volume that was warped through deformed tetrahedra.
///
/// # Errors
/// If input and output do not belong together, or the mesh is none.
pub fn of_tets(subject: &Subject, field: &TetField) -> Result<Certificate, CertificateError> {
    let view = View::around(&subject.output.grid, field.deformed.iter().copied().filter(|p| p.is_finite()))?;
    let layers = TetLayers::new(&view, &subject.input.grid, field)?;
    let facts = *layers.warp.facts();
    let (tally, labels) = audit(subject, &view, &layers)?;
    let jacobian = Jacobian {
        samples: (facts.tets - facts.degenerate) as u64,
        min: facts.jacobian.map(|j| j[0]),
        max: facts.jacobian.map(|j| j[1]),
        not_positive: facts.inverted as u64,
    };
    let voxels = subject.output.grid.len() as u64;
    let coverage = TetCoverage {
        none: tally.uncovered,
        once: voxels - tally.uncovered - tally.more,
        more: tally.more,
        enclosed: match tally.uncovered {
            0 => 0,
            _ => holes::enclosed(subject.output.grid.dims, &tally.holes),
        },
        degenerate: facts.degenerate as u64,
    };
    Ok(certificate(subject, tally, labels, jacobian, Some((coverage, field.fills))))
}

/// The certificate of a volume that was warped through the lattice that a backward map became. The lattice ends with the grid:
/// what lies beyond it is known from the map.
///
/// # Errors
/// As [`of_tets`].
pub fn of_lattice(subject: &Subject, field: &TetField, map: &Prepared) -> Result<Certificate, CertificateError> {
    let mut made = of_tets(subject, field)?;
    made.material_clipped = of_map(subject, map)?.material_clipped;
    made.faults = made.found(field.fills);
    made.sound = made.faults.is_empty();
    Ok(made)
}

fn audit(subject: &Subject, view: &View, layers: &dyn Layers) -> Result<(Tally, Option<Labels>), CertificateError> {
    let Subject { input, output, interpolation, density, .. } = *subject;
    if input.channels != output.channels {
        return Err(CertificateError::Channels { input: input.channels, output: output.channels });
    }
    let kept = interpolation == Interpolation::Nearest;
    let before = Some(input)
        .filter(|v| v.channels == 1 && !density)
        .and_then(Values::of)
        .filter(|values| kept || values.are_labels(input));
    let tally = Audit { subject, view, layers, values: before.as_ref() }.run();
    let labels = before.map(|before| {
        let after = Values::of(output);
        let outside = values::Range::of(&output.samples).stored(subject.outside);
        let mut added = after.as_ref().map(|a| a.beyond(&before)).unwrap_or_default();
        added.retain(|v| *v != outside);
        added.truncate(16);
        Labels {
            before: before.len() as u64,
            after: after.map_or(0, |a| a.len() as u64),
            added,
            added_voxels: tally.added,
            blended_voxels: tally.blended,
        }
    });
    Ok((tally, labels))
}

fn certificate(
    subject: &Subject,
    tally: Tally,
    labels: Option<Labels>,
    jacobian: Jacobian,
    tets: Option<(TetCoverage, bool)>,
) -> Certificate {
    let voxels = subject.output.grid.len() as u64;
    let mut made = Certificate {
        sound: true,
        faults: Vec::new(),
        interpolation: subject.interpolation.name(),
        coverage: Coverage {
            voxels,
            inside_input: tally.inside,
            outside_input: voxels - tally.inside,
            tets: tets.map(|(c, _)| c),
        },
        jacobian,
        inverse: tally.inverse,
        values_clipped: tally.values_clipped,
        material_clipped: tally.material_clipped,
        labels,
        mass: Mass { before: mass(subject.input), after: mass(subject.output) },
    };
    made.faults = made.found(tets.is_some_and(|(_, fills)| fills));
    made.sound = made.faults.is_empty();
    made
}

fn mass(volume: &Volume) -> f64 {
    let facts = statistics(volume);
    let voxel = volume.grid.world_from_voxel.matrix3.determinant().abs();
    if facts.count == 0 { 0.0 } else { facts.mean * facts.count as f64 * voxel }
}

impl Certificate {
    /// A sentence for each fault.
    fn found(&self, fills: bool) -> Vec<String> {
        let mut faults = Vec::new();
        let mut say = |count: u64, sentence: &dyn Fn(u64) -> String| {
            if count > 0 {
                faults.push(sentence(count));
            }
        };
        let Jacobian { samples, not_positive, .. } = self.jacobian;
        match &self.coverage.tets {
            Some(c) => {
                say(not_positive, &|n| format!("the deformation turns {n} of {samples} tetrahedra inside out"));
                say(c.more, &|n| {
                    format!("{n} voxels lie in more than one tetrahedron: the deformed mesh overlaps itself")
                });
                let missing = if fills { c.none } else { c.enclosed };
                say(missing, &|n| {
                    format!("{n} voxels lie in no tetrahedron, though the mesh should hold them: it has a hole")
                });
            }
            None => say(not_positive, &|n| format!("the deformation folds at {n} of {samples} voxels looked at")),
        }
        say(self.inverse.failed, &|n| format!("{n} voxels have no single inverse: the deformation folds there"));
        say(self.material_clipped, &|n| format!("{n} voxels of the deformed volume lie beyond the grid and are lost"));
        say(self.values_clipped, &|n| format!("{n} voxels have values that the sample type cannot hold"));
        if let Some(l) = &self.labels {
            say(l.added_voxels, &|n| format!("{n} voxels have values that the input does not have"));
            say(l.blended_voxels, &|n| {
                format!("{n} voxels have a label that none of the voxels they come from has; use nearest interpolation")
            });
        }
        faults
    }
}

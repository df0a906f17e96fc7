use glam::DVec3;

use super::Falloff;

/// Why a deformer cannot be, or a point cannot be moved by it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DeformError {
    #[error("the displacement vector has no length, so it has no direction; drag it somewhere")]
    NoDirection,
    #[error("the axis has no length, so it has no direction")]
    NoAxis,
    #[error("the {what} holds a number that is not finite")]
    NotFinite { what: &'static str },
    #[error("the {what} is {value}; it must be between {least} and {most}")]
    OutOfRange { what: &'static str, value: f64, least: f64, most: f64 },
    #[error("the lattice's axes must be three unit vectors at right angles, right-handed")]
    Axes,
    #[error("a lattice of {}x{}x{} handles; each side must have {least} to {most}", dims[0], dims[1], dims[2])]
    LatticeSize { dims: [usize; 3], least: usize, most: usize },
    #[error("the lattice needs {expected} handle vectors, but {got} are given")]
    LatticeHandles { expected: usize, got: usize },
    #[error("the deformation folds over at ({:.6}, {:.6}, {:.6}), so the point has no single place to go", at.x, at.y, at.z)]
    Folded { at: DVec3 },
    #[error("no place was found where the deformation takes ({:.6}, {:.6}, {:.6}); it probably folds over there", at.x, at.y, at.z)]
    NotConverged { at: DVec3 },
}

/// Lengths outside this range would overflow or vanish in the arithmetic.
const LEAST: f64 = 1e-12;
const MOST: f64 = 1e12;

/// A length that can be divided by.
pub(super) fn check_length(what: &'static str, value: f64) -> Result<(), DeformError> {
    if value.is_nan() {
        return Err(DeformError::NotFinite { what });
    }
    check_range(what, value, LEAST, MOST)
}

pub(super) fn check_range(what: &'static str, value: f64, least: f64, most: f64) -> Result<(), DeformError> {
    if (least..=most).contains(&value) { Ok(()) } else { Err(DeformError::OutOfRange { what, value, least, most }) }
}

/// A place or a vector that can be calculated with.
pub(super) fn check_vector(what: &'static str, v: DVec3) -> Result<(), DeformError> {
    if !v.is_finite() {
        return Err(DeformError::NotFinite { what });
    }
    check_range(what, v.abs().max_element(), 0.0, MOST)
}

/// The unit direction of a displacement vector.
pub(super) fn direction(vector: DVec3) -> Result<DVec3, DeformError> {
    check_vector("displacement vector", vector)?;
    if vector.length() < LEAST {
        return Err(DeformError::NoDirection);
    }
    Ok(vector.normalize())
}

pub(super) fn check_axis(axis: DVec3) -> Result<(), DeformError> {
    check_vector("axis", axis)?;
    if axis.length() < LEAST { Err(DeformError::NoAxis) } else { Ok(()) }
}

pub(super) fn check_falloff(falloff: Falloff) -> Result<(), DeformError> {
    match falloff {
        Falloff::Core(core) => check_range("core of the falloff", core, 0.0, 0.9),
        Falloff::Smooth | Falloff::Spline => Ok(()),
    }
}

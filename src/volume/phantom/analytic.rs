//! Closed formulas, sampled: for tests, where the right answer must be known everywhere.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::{Phantom, centred, proportions};
use crate::volume::{Scalar, Space, Volume};

/// Side of the cube from the first to the last voxel centre, in millimetres; it spans -50 to 50 along each axis.
pub const SIDE: f64 = 100.0;

/// Cells of the checkerboard along an axis.
const CELLS: f64 = 8.0;

/// Marschner and Lobb (1994) with f_M = 6 and alpha = 0.25, on `[-1,1]^3`; 0 to 1.
pub fn marschner_lobb(p: DVec3) -> f64 {
    let (f_m, alpha) = (6.0, 0.25);
    let r = p.truncate().length();
    let rho = (2.0 * PI * f_m * (0.5 * PI * r).cos()).cos();
    (1.0 - (0.5 * PI * p.z).sin() + alpha * (1.0 + rho)) / (2.0 * (1.0 + alpha))
}

pub fn value(phantom: Phantom, p: DVec3) -> Option<f64> {
    match phantom {
        Phantom::MarschnerLobb => Some(marschner_lobb(p / (0.5 * SIDE))),
        Phantom::Ramp => Some((p.element_sum() / SIDE + 1.5) / 3.0),
        Phantom::Sphere => Some(p.length()),
        Phantom::Gaussian => Some((-p.length_squared() / (2.0 * (SIDE / 6.0).powi(2))).exp()),
        Phantom::Checker => {
            // the label's bits are the parities of the cell, so that face neighbours always differ
            let cell = ((p / SIDE + 0.5) * CELLS).floor().clamp(DVec3::ZERO, DVec3::splat(CELLS - 1.0)).as_uvec3();
            Some(f64::from((cell.x & 1) | (cell.y & 1) << 1 | (cell.z & 1) << 2))
        }
        _ => None,
    }
}

pub fn sample<T: Scalar>(phantom: Phantom, size: usize) -> Volume {
    let (dims, _) = proportions(DVec3::ONE, size);
    // both ends of the interval are samples; a single voxel stands in the middle
    let grid = centred(dims, SIDE / (dims[0].max(2) - 1) as f64, Space::Unknown);
    let [nx, ny, _] = dims;
    let mut samples = vec![T::from_f64(0.0); grid.len()];
    samples.par_chunks_mut(nx * ny).enumerate().for_each(|(k, slice)| {
        for (j, row) in slice.chunks_mut(nx).enumerate() {
            for (i, s) in row.iter_mut().enumerate() {
                let p = grid.world_from_voxel.transform_point3(DVec3::new(i as f64, j as f64, k as f64));
                *s = T::from_f64(value(phantom, p).expect("only analytic phantoms are sampled"));
            }
        }
    });
    Volume::new(grid, 1, T::wrap(samples))
}

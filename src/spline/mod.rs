//! L2: smooth iso-surfaces: C1 cubic splines on the type-6 tetrahedral partition, on the CPU.
//!
//! # Theory
//!
//! Kalbe, Koch and Goesele, "High-quality rendering of varying isosurfaces with cubic trivariate C1-continuous splines",
//! after Sorokina and Zeilfelder's quasi-interpolation. Each sample is the centre of a *data cube*, which its six diagonal
//! planes cut into 24 congruent tetrahedra. On each there is a cubic in Bernstein-Bezier form, whose 20 coefficients are
//! weighted means of the 27 samples around the cube. The weights follow from smoothness alone (`tests/spline.rs` derives
//! them again): values and gradients agree across all faces, linear functions come out exactly, and each piece lies between
//! its smallest and largest coefficient.
//!
//! *Departure.* The spline of the poster smooths: it does not pass through the data. A few correction steps
//! ([`Spline::new`]) change the samples so that it nearly does, and stays as smooth. 0 steps are the poster's spline.
//!
//! # Practice
//!
//! Coordinates are voxel indices, the centre of voxel 0 at 0. The domain is all data cubes, `-1/2 <= x <= n - 1/2`; beyond
//! the border, samples repeat the outermost (in the correction, too), so the spline meets the border without slope, and is
//! exact on linear functions only a voxel away from it (and `2 + steps` with corrections). Coefficients are stored in `f32`,
//! everything is evaluated in `f64`.
//!
//! [`Determining`] is a part of the coefficients of a cube that the others follow from.
//!
//! [`Level`] is one isovalue: which cubes it may pass through, found by the signs of the samples alone, and where rays meet
//! it. [`Through`] is the same seen through a backward map, as the data lie after strokes. [`paint`] colours the surface,
//! [`occupancy`] shades it by what is around. [`surface`] makes meshes of it; [`cells`] is the trilinear alternative.

pub mod cells;
mod correct;
pub mod cubic;
mod determining;
mod level;
pub mod occupancy;
pub mod paint;
mod piece;
mod ray;
pub mod refine;
pub mod surface;
mod through;

use glam::{DMat3, DVec3};

use crate::math::parallel;
use crate::volume::{Samples, Scalar, Volume};
use crate::with_samples;
use correct::{Padded, Rows};

pub use determining::Determining;
pub use level::{Classes, Level};
pub use piece::{DOMAIN, Kind, Piece, VERTICES, barycentric};
pub use ray::{Crossing, Ray};
pub use through::{Through, ThroughLevel, VoxelMap};

/// Correction steps that are taken if nobody asks for another number: 4 for floating-point samples, which are mostly computed
/// and as smooth as what they stand for (on the Marschner-Lobb signal the first four steps bring the surface five times as
/// near, more bring little); none for whole numbers, where corrections would sharpen rounding and noise into terraces.
pub fn suggested_steps(samples: &Samples) -> u32 {
    match samples {
        Samples::F32(_) | Samples::F64(_) => 4,
        _ => 0,
    }
}

/// A C1 cubic spline over a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Spline {
    coefficients: Padded,
}

/// The piece that holds a point, and where in it the point lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    pub cube: [usize; 3],
    pub kind: Kind,
    /// Barycentric.
    pub at: [f64; 4],
}

impl Spline {
    /// The spline of samples, x fastest, after `steps` corrections.
    ///
    /// # Panics
    /// If the samples do not fill a grid of `dims`, or that is empty.
    pub fn new(dims: [usize; 3], samples: &[f32], steps: u32) -> Self {
        let [nx, ny, nz] = dims;
        assert!(nx * ny * nz > 0 && samples.len() == nx * ny * nz, "samples do not fill the grid");
        let row: Rows = &|j, k, row| row.copy_from_slice(&samples[(k * ny + j) * nx..][..nx]);
        Self { coefficients: Padded::from_rows(dims, row, steps) }
    }

    /// The spline of one channel of a volume, in its real values. What is not finite counts as the smallest finite value.
    ///
    /// # Panics
    /// If there is no such channel.
    pub fn of_volume(volume: &Volume, channel: usize, steps: u32) -> Self {
        assert!(channel < volume.channels);
        Self { coefficients: real_values(volume, channel, steps) }
    }

    /// Samples along the axes.
    pub fn dims(&self) -> [usize; 3] {
        self.coefficients.dims
    }

    /// The coefficient that stands for a sample: the sample itself without corrections.
    pub fn sample(&self, at: [usize; 3]) -> f32 {
        self.coefficients.values[self.coefficients.index(at)]
    }

    /// All coefficients that stand for samples, x fastest, with one more sample on every side, which repeats the outermost.
    pub fn padded(&self) -> &[f32] {
        &self.coefficients.values
    }

    /// Where a point lies; points beyond the domain are moved to its border.
    #[inline(always)]
    pub fn locate(&self, p: DVec3) -> Place {
        let mut cube = [0; 3];
        let mut local = DVec3::ZERO;
        for a in 0..3 {
            let n = self.coefficients.dims[a];
            let x = p[a].clamp(-0.5, n as f64 - 0.5);
            cube[a] = ((x + 0.5) as usize).min(n - 1);
            local[a] = x - cube[a] as f64;
        }
        let kind = Kind::of(local);
        Place { cube, kind, at: barycentric(kind.local(local)) }
    }

    /// The piece of a tetrahedron.
    ///
    /// # Panics
    /// If the cube is not in the volume.
    #[inline(always)]
    pub fn piece(&self, cube: [usize; 3], kind: Kind) -> Piece {
        let strides = kind.strides(self.coefficients.strides().map(|s| s as isize));
        Piece::new(&self.coefficients.values, self.coefficients.index(cube), strides)
    }

    pub fn value(&self, p: DVec3) -> f64 {
        let place = self.locate(p);
        self.piece(place.cube, place.kind).value(place.at)
    }

    /// Per voxel.
    pub fn gradient(&self, p: DVec3) -> DVec3 {
        let place = self.locate(p);
        place.kind.cube(self.piece(place.cube, place.kind).gradient(place.at))
    }

    /// Value and gradient at once.
    #[inline(always)]
    pub fn value_and_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let place = self.locate(p);
        let left = self.piece(place.cube, place.kind).step(place.at).step(place.at);
        (left.value(place.at), place.kind.cube(left.gradient()))
    }

    /// Second derivatives, per voxel squared. They jump from piece to piece.
    pub fn hessian(&self, p: DVec3) -> DMat3 {
        let place = self.locate(p);
        let local = self.piece(place.cube, place.kind).hessian(place.at);
        // H = T^t L T with T the map to the local axes
        let columns = [DVec3::X, DVec3::Y, DVec3::Z].map(|e| place.kind.cube(local * place.kind.local(e)));
        DMat3::from_cols(columns[0], columns[1], columns[2])
    }
}

/// The real values of a channel after `steps` corrections; what is not finite is replaced by the smallest finite value.
fn real_values(volume: &Volume, channel: usize, steps: u32) -> Padded {
    let low = if !all_finite(&volume.samples) {
        let values = (channel..volume.samples.len()).step_by(volume.channels);
        let real = values.map(|i| volume.rescale.real(volume.samples.get(i)) as f32);
        Some(real.filter(|v| v.is_finite()).fold(f32::INFINITY, f32::min)).filter(|v| v.is_finite())
    } else {
        None
    };
    let low = low.unwrap_or(0.0);
    with_samples!(&volume.samples, v => typed_values(v, volume, channel, low, steps))
}

fn all_finite(samples: &Samples) -> bool {
    fn all<T: Scalar>(values: &[T]) -> bool {
        let pieces: Vec<_> = values.chunks(1 << 16).collect();
        parallel::map(pieces.len(), &|i| pieces[i].iter().fold(true, |all, v| all & v.to_f64().is_finite()))
            .iter()
            .all(|b| *b)
    }
    match samples {
        Samples::F32(v) => all(v),
        Samples::F64(v) => all(v),
        _ => true,
    }
}

fn typed_values<T: Scalar>(samples: &[T], volume: &Volume, channel: usize, low: f32, steps: u32) -> Padded {
    let [nx, ny, _] = volume.grid.dims;
    let (slope, intercept, channels) = (volume.rescale.slope, volume.rescale.intercept, volume.channels);
    let plain = slope == 1.0 && intercept == 0.0;
    let finite = |v: f32| if v.is_finite() { v } else { low };
    Padded::from_rows(
        volume.grid.dims,
        &|j, k, row| {
            let from = &samples[(k * ny + j) * nx * channels..][..nx * channels];
            if channels == 1 && plain {
                row.iter_mut().zip(from).for_each(|(out, v)| *out = finite(v.to_f32()));
            } else {
                let values = from[channel..].iter().step_by(channels);
                let real = values.map(|v| (slope * v.to_f64() + intercept) as f32);
                row.iter_mut().zip(real).for_each(|(out, v)| *out = finite(v));
            }
        },
        steps,
    )
}

//! Procedural phantoms: volumes made from formulas, to please the eye and to test with.
//!
//! # Theory
//!
//! The pictorial phantoms are solids built from signed distances with smooth set operations (Quilez' quadratic smooth
//! minimum), layered into materials by depth and textured with gradient noise (Perlin 2002) and cellular noise (Worley
//! 1996). Every border is a smooth ramp about two voxels wide, which is what a scanner's point spread does, so that
//! gradients are clean at any size. A block of voxels evaluates only the primitives that can matter in it (`sdf.rs`).
//! The analytic phantoms sample a closed formula; [`Phantom::analytic`] gives its value anywhere.
//!
//! # Practice
//!
//! [`Phantom::generate`] with the voxels of the longest side. Voxels are cubes; the grid's middle is the world's origin;
//! units are millimetres. Body phantoms are in [`Space::Lps`]: the face looks to -y, z is up. The result depends on the
//! phantom and the size only, not on the number of threads.

mod analytic;
mod carp;
mod engine;
mod head;
mod noise;
mod orange;
mod sdf;
mod torso;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::{Grid, Scalar, Space, Volume};
use sdf::{Block, Shape};

/// A built-in volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Phantom {
    Head,
    Engine,
    Orange,
    Carp,
    Torso,
    MarschnerLobb,
    Ramp,
    Sphere,
    Gaussian,
    Checker,
}

/// How a phantom looks good at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Suggested {
    /// Name of a preset of [`TransferFunction`](super::transfer::TransferFunction).
    pub transfer: &'static str,
    /// Real value of a telling iso-surface.
    pub iso: f64,
    /// Camera angles in degrees.
    pub yaw: f64,
    pub pitch: f64,
}

/// The largest number of voxels along a side.
pub const LARGEST: usize = 2048;

impl Phantom {
    pub const ALL: [Self; 10] = [
        Self::Head,
        Self::Engine,
        Self::Orange,
        Self::Carp,
        Self::Torso,
        Self::MarschnerLobb,
        Self::Ramp,
        Self::Sphere,
        Self::Gaussian,
        Self::Checker,
    ];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Head => "head",
            Self::Engine => "engine",
            Self::Orange => "orange",
            Self::Carp => "carp",
            Self::Torso => "torso",
            Self::MarschnerLobb => "marschner-lobb",
            Self::Ramp => "ramp",
            Self::Sphere => "sphere",
            Self::Gaussian => "gaussian",
            Self::Checker => "checker",
        }
    }

    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|p| p.name() == name)
    }

    /// One line for lists.
    pub fn description(self) -> &'static str {
        match self {
            Self::Head => "CT of a head and neck: skin, skull, jaw with teeth, folded brain, airways (HU)",
            Self::Engine => "industrial CT of a two-cylinder engine block: liners, valves, cooling channels, bolts",
            Self::Orange => "an orange: dimpled peel, pith, eleven segments of pulp, seeds",
            Self::Carp => "CT of a carp: scales, fins, spine and ribs, skull, swim bladder",
            Self::Torso => "CT of a chest: ribs, spine, lungs with bronchi, heart, liver (HU)",
            Self::MarschnerLobb => "the Marschner-Lobb test signal, which shows what interpolation loses",
            Self::Ramp => "a linear ramp from 0 to 1 along the diagonal",
            Self::Sphere => "the distance from the middle",
            Self::Gaussian => "a Gaussian bump",
            Self::Checker => "eight labels in a 3D checkerboard",
        }
    }

    pub fn suggested(self) -> Suggested {
        let s = |transfer, iso, yaw, pitch| Suggested { transfer, iso, yaw, pitch };
        match self {
            Self::Head => s("ct-head", -300.0, 32.0, 8.0),
            Self::Engine => s("engine", 90.0, 35.0, 28.0),
            Self::Orange => s("orange", 60.0, 25.0, 30.0),
            Self::Carp => s("carp", 600.0, 70.0, 12.0),
            Self::Torso => s("ct-bone", 250.0, 25.0, 8.0),
            Self::MarschnerLobb => s("grey", 0.5, 30.0, 35.0),
            Self::Ramp => s("grey", 0.5, 30.0, 20.0),
            Self::Sphere => s("grey", 30.0, 30.0, 20.0),
            Self::Gaussian => s("grey", 0.5, 30.0, 20.0),
            Self::Checker => s("grey", 3.5, 30.0, 20.0),
        }
    }

    /// The closed formula of an analytic phantom at a world point, `None` for the pictorial ones. Voxels hold exactly
    /// this value, rounded to their type.
    pub fn analytic(self, p: DVec3) -> Option<f64> {
        analytic::value(self, p)
    }

    /// The phantom with `size` voxels along its longest side (1 to [`LARGEST`], clamped) and in proportion along the others.
    pub fn generate(self, size: usize) -> Volume {
        match self {
            Self::Head => fill::<i16>(&head::Head::new(), size, Space::Lps),
            Self::Engine => fill::<u8>(&engine::Engine::new(), size, Space::Unknown),
            Self::Orange => fill::<u8>(&orange::Orange::new(), size, Space::Unknown),
            Self::Carp => fill::<u16>(&carp::Carp::new(), size, Space::Unknown),
            Self::Torso => fill::<i16>(&torso::Torso::new(), size, Space::Lps),
            Self::Checker => analytic::sample::<u8>(self, size),
            Self::MarschnerLobb | Self::Ramp | Self::Sphere | Self::Gaussian => analytic::sample::<f32>(self, size),
        }
    }
}

/// A solid that knows its value at a point.
trait Model: Sync {
    /// The box it lives in, in millimetres of the model.
    fn bounds(&self) -> [Vec3; 2];

    fn shapes(&self) -> &[Shape];

    /// The value at `p`, where `at` is prepared for a block around `p` and `h` is the size of a voxel. Borders may reach
    /// [`BORDER`] voxels to both sides.
    fn value(&self, p: Vec3, at: &Block, h: f32) -> f32;
}

/// Voxels along the axes and their spacing, so that the longest side of `extent` gets `size`.
fn proportions(extent: DVec3, size: usize) -> ([usize; 3], f64) {
    let size = size.clamp(1, LARGEST);
    let spacing = extent.max_element() / size as f64;
    let dims = (extent / spacing).round().to_array().map(|n| (n as usize).clamp(1, size));
    (dims, spacing)
}

/// A grid of cubic voxels with its middle at the origin.
fn centred(dims: [usize; 3], spacing: f64, space: Space) -> Grid {
    let n = DVec3::from_array(dims.map(|n| n as f64));
    let frame =
        DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::splat(spacing)), -0.5 * spacing * (n - 1.0));
    Grid::new(dims, frame, space).expect("sizes of phantoms are between 1 and LARGEST")
}

/// Voxels that a border may reach to both sides of a surface.
const BORDER: f32 = 2.0;

/// Voxels along the side of a block.
const BLOCK: usize = 8;

fn fill<T: Scalar>(model: &dyn Model, size: usize, space: Space) -> Volume {
    let [lo, hi] = model.bounds();
    let (dims, spacing) = proportions((hi - lo).as_dvec3(), size);
    let grid = centred(dims, spacing, space);
    let shift = 0.5 * (lo + hi) + grid.origin().as_vec3();
    let h = spacing as f32;
    let at = |i: f32, j: f32, k: f32| shift + h * Vec3::new(i, j, k);
    let [nx, ny, _] = dims;
    let shapes = model.shapes();
    let mut samples = vec![T::from_f64(0.0); grid.len()];
    samples.par_chunks_mut(nx * ny * BLOCK).enumerate().for_each_init(Block::default, |block, (slab, out)| {
        let depth = out.len() / (nx * ny);
        for j0 in (0..ny).step_by(BLOCK) {
            for i0 in (0..nx).step_by(BLOCK) {
                let n = [BLOCK.min(nx - i0), BLOCK.min(ny - j0), depth];
                let r = n.map(|n| 0.5 * (n - 1) as f32);
                let k0 = slab * BLOCK;
                let center = at(i0 as f32 + r[0], j0 as f32 + r[1], k0 as f32 + r[2]);
                block.enter(shapes, center, h * Vec3::from_array(r).length(), BORDER * h);
                for k in 0..n[2] {
                    for j in j0..j0 + n[1] {
                        let row = &mut out[(k * ny + j) * nx..][..nx];
                        for (i, sample) in row.iter_mut().enumerate().skip(i0).take(n[0]) {
                            let value = model.value(at(i as f32, j as f32, (k0 + k) as f32), block, h);
                            *sample = T::from_f64(f64::from(value));
                        }
                    }
                }
            }
        }
    });
    Volume::new(grid, 1, T::wrap(samples))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shortened shapes give the same distances, where they matter, as whole ones.
    #[test]
    fn blocks_leave_out_nothing_that_matters() {
        let models: [Box<dyn Model>; 5] = [
            Box::new(head::Head::new()),
            Box::new(engine::Engine::new()),
            Box::new(orange::Orange::new()),
            Box::new(carp::Carp::new()),
            Box::new(torso::Torso::new()),
        ];
        for (m, model) in models.iter().enumerate() {
            let [lo, hi] = model.bounds();
            let mut block = Block::default();
            let mut near = 0;
            for b in 0..1500i32 {
                let u = |q: i32, part| noise::unit(noise::hash(glam::IVec3::new(b, q, m as i32)), part);
                let center = lo + (hi - lo) * Vec3::new(u(0, 0), u(0, 1), u(0, 2));
                let radius = 0.03 * (hi - lo).max_element() * u(1, 0);
                let border = 3.0 * u(1, 1);
                block.enter(model.shapes(), center, radius, border);
                for q in 2..8 {
                    let dir = (Vec3::new(u(q, 0), u(q, 1), u(q, 2)) - 0.5).normalize_or_zero();
                    let p = center + radius * dir;
                    for (id, shape) in model.shapes().iter().enumerate() {
                        let (whole, short) = (shape.distance(p), block.d(id, p));
                        if short.abs() < sdf::FAR {
                            near += 1;
                            assert!((whole - short).abs() < 2e-3, "model {m} shape {id} at {p}: {whole} but {short}");
                        } else {
                            assert!(
                                shape.is_beyond(whole, short, border),
                                "model {m} shape {id} at {p}: {whole} taken as {short}"
                            );
                        }
                    }
                }
            }
            assert!(near > 300, "model {m}: only {near} points were near a surface");
        }
    }
}

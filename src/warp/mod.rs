//! L2: warping a volume through a deformed tetrahedral mesh onto a grid, on the CPU.
//!
//! # Theory
//!
//! Gascon, Espadero, Perez, Torres and Otaduy, "Fast deformation of volume data using tetrahedral mesh rasterization"
//! (2013). Within a tetrahedron the barycentric coordinates of a voxel centre of the output, `b = B1 x1` (their equation 2),
//! lead to the rest position with the same coordinates, `x0 = B0^-1 b`, where the input is sampled. Both are affine, so one
//! affine map a tetrahedron takes output voxels to input voxels.
//!
//! The paper tests the voxels of a bounding box (section 3), or of those of its cells that one of eight half-spaces does not
//! rule out (section 4). Here nothing is tested: along a row of voxels each coordinate is linear, and the interval in which
//! all four are positive is solved for (`outline.rs`). [`Culling`] keeps the paper's ways at hand, for comparison.
//!
//! **Every voxel once.** A voxel belongs to a tetrahedron if no barycentric coordinate is below -1e-9 (a closed tetrahedron,
//! and a little more than rounding can move a face), and among several to that with the lowest number. So neighbours
//! neither leave a crack nor write twice, and the outer faces of the mesh belong to it. A voxel that lies more than
//! [`OVERLAP`] within two tetrahedra is covered twice for good: the mesh overlaps itself there, and it is counted.
//!
//! # Practice
//!
//! [`Warp::new`] prepares the tetrahedra in `f64` for one output grid; [`Warp::run`] writes the samples. The output is worked
//! off in slabs of layers, in parallel and without locks, as each slab owns its voxels; a bit for each says whether it was
//! written. Within a slab the tetrahedra come in the order of their numbers, so the result depends neither on the number of
//! threads nor on timing. Linear look-ups of rows that stay inside the input are vector code (`batch.rs`), chosen
//! at run time (`machine.rs`), and what they read is asked for beforehand (`touch.rs`); all others go through [`Sampler`], the
//! `f64` reference.

mod batch;
pub mod cells;
mod machine;
pub(crate) mod outline;
mod raster;
mod row;
mod setup;
mod touch;

use glam::DVec3;

use crate::math::parallel;
use crate::mesh::tets::TetMesh;
use crate::volume::fetch::Fetch;
use crate::volume::sampling::{Interpolation, Sampler};
use crate::volume::{Grid, Samples, Volume};
use crate::with_samples;

pub use raster::Tally;
pub use setup::{AffineRow, TOLERANCE, Tet};

use cells::Candidates;
use raster::Slab;
pub(crate) use row::SNAP;

/// A voxel with all four barycentric coordinates above this in two tetrahedra is covered twice.
pub const OVERLAP: f64 = 1e-7;

/// Layers of the output that are worked off together: many, so that the part of the input that a tetrahedron's layers come
/// from is read once, but few enough that all threads have work to the end.
fn layers(nz: usize) -> usize {
    (nz / (6 * rayon::current_num_threads())).clamp(2, 32)
}

/// Which voxels are tested against a tetrahedron.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Culling {
    /// Those of its bounding box (section 3 of the paper).
    None,
    /// Those of the cells that remain after culling (section 4).
    Cells {
        /// Voxels along an edge of a cell; the paper found 8 best.
        size: u32,
    },
    /// None: the voxels inside are solved for.
    #[default]
    Exact,
}

/// How a value is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WarpOptions {
    pub interpolation: Interpolation,
    /// The stored value where no tetrahedron is, or its rest position lies outside the input.
    pub outside: f64,
    /// Divides values by the determinant of the deformation's Jacobian, so that what is stretched thins out and the sum
    /// over the volume stays: for densities.
    pub density: bool,
    pub culling: Culling,
    /// Every look-up in `f64`.
    pub reference: bool,
}

impl Default for WarpOptions {
    fn default() -> Self {
        Self {
            interpolation: Interpolation::Linear,
            outside: 0.0,
            density: false,
            culling: Culling::Exact,
            reference: false,
        }
    }
}

/// Why nothing can be warped.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WarpError {
    #[error("the mesh has {rest} points but {deformed} deformed positions; each point needs one")]
    Points { rest: usize, deformed: usize },
    #[error("tetrahedron {tet} names point {point}, but the mesh has {points}")]
    Index { tet: usize, point: u32, points: usize },
    #[error("point {0} has a coordinate that is not a finite number")]
    NotFinite(usize),
    #[error("a mesh without tetrahedra deforms nothing")]
    Empty,
    #[error("{voxels} voxels of {channels} channels are not the {samples} samples of the output")]
    Output { voxels: usize, channels: usize, samples: usize },
    #[error("{bytes} bytes for the warped volume are more than this machine can give")]
    OutOfMemory { bytes: u64 },
    #[error("cells of {0} voxels are no cells; at least 1 and at most 1024 voxels make an edge")]
    CellSize(u32),
}

/// What the tetrahedra are like, before anything is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Facts {
    pub tets: usize,
    /// Tetrahedra that the deformation turns inside out.
    pub inverted: usize,
    /// Tetrahedra without volume, at rest or deformed: they are left out.
    pub degenerate: usize,
    /// Smallest and largest determinant of the Jacobian (deformed against rest volume); `None` if all are degenerate.
    pub jacobian: Option<[f64; 2]>,
}

/// A deformed tetrahedral mesh, prepared for an input and an output grid.
pub struct Warp {
    pub(crate) tets: Vec<Tet>,
    /// Numbers of the prepared tetrahedra that reach into each slab, ascending; those of slab s end at `ends[s]`.
    bins: Vec<u32>,
    ends: Vec<usize>,
    /// Layers of a slab.
    layers: usize,
    dims: [usize; 3],
    facts: Facts,
}

impl Warp {
    /// Prepares the tetrahedra: `rest` and `deformed` are world positions of their points.
    ///
    /// # Errors
    /// If there are no tetrahedra, or indices or positions make no sense.
    pub fn new(
        input: &Grid,
        output: &Grid,
        tets: &[[u32; 4]],
        rest: &[DVec3],
        deformed: &[DVec3],
    ) -> Result<Self, WarpError> {
        let points = rest.len();
        if deformed.len() != points {
            return Err(WarpError::Points { rest: points, deformed: deformed.len() });
        }
        if tets.is_empty() {
            return Err(WarpError::Empty);
        }
        for (tet, corners) in tets.iter().enumerate() {
            if let Some(&point) = corners.iter().find(|v| **v as usize >= points) {
                return Err(WarpError::Index { tet, point, points });
            }
        }
        if let Some(bad) = rest.iter().zip(deformed).position(|(a, b)| !(a.is_finite() && b.is_finite())) {
            return Err(WarpError::NotFinite(bad));
        }
        let (input_from_world, output_from_world) = (input.voxel_from_world(), output.voxel_from_world());
        let rest: Vec<DVec3> = rest.iter().map(|p| input_from_world.transform_point3(*p)).collect();
        let moved: Vec<DVec3> = deformed.iter().map(|p| output_from_world.transform_point3(*p)).collect();
        // from output voxels per input voxel to world per world
        let scale = output.world_from_voxel.matrix3.determinant() / input.world_from_voxel.matrix3.determinant();
        const PIECE: usize = 1024;
        let pieces = parallel::map(tets.len().div_ceil(PIECE), &|piece| {
            let first = piece * PIECE;
            let part = &tets[first..tets.len().min(first + PIECE)];
            let mut made = Vec::with_capacity(part.len());
            let mut facts = Facts { tets: part.len(), ..Facts::default() };
            for (i, corners) in part.iter().enumerate() {
                let corners = |points: &[DVec3]| TetMesh::corners(*corners, points);
                let tet = Tet::new((first + i) as u32, corners(&rest), corners(&moved), scale, output.dims);
                facts.add(&tet);
                made.extend(tet.ok().filter(Tet::reaches_grid));
            }
            (made, facts)
        });
        let mut facts = Facts::default();
        let mut made = Vec::with_capacity(tets.len());
        for (part, f) in pieces {
            made.extend(part);
            facts.join(&f);
        }
        let layers = layers(output.dims[2]);
        let (bins, ends) = bin(&made, output.dims[2], layers);
        Ok(Self { tets: made, bins, ends, layers, dims: output.dims, facts })
    }

    pub fn facts(&self) -> &Facts {
        &self.facts
    }

    /// The prepared tetrahedra that reach into the grid, in the order of their numbers.
    pub fn tets(&self) -> &[Tet] {
        &self.tets
    }

    /// Size of the output grid.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// The voxels to test for each tetrahedron; with [`Culling::Exact`] there are none, and nothing is done.
    ///
    /// # Errors
    /// If cells have an impossible size.
    pub fn candidates(&self, culling: Culling) -> Result<Candidates<'_>, WarpError> {
        Candidates::new(self, culling)
    }

    /// Writes every sample of the output: x fastest, channels interleaved, as many as the input has. `candidates` are this
    /// warp's.
    ///
    /// # Errors
    /// If `out` is not of the output's size.
    pub fn run<T: Fetch>(
        &self,
        candidates: &Candidates<'_>,
        input: Sampler<'_, T>,
        options: &WarpOptions,
        out: &mut [T],
    ) -> Result<Tally, WarpError> {
        let [nx, ny, nz] = self.dims;
        let channels = input.channels();
        if out.len() != nx * ny * nz * channels {
            return Err(WarpError::Output { voxels: nx * ny * nz, channels, samples: out.len() });
        }
        let scratch = parallel::Pool::default();
        let tallies = parallel::chunks_mut(out, self.layers * nx * ny * channels, &|index, samples| {
            let from = if index == 0 { 0 } else { self.ends[index - 1] };
            let tets = &self.bins[from..self.ends[index]];
            scratch.with(Vec::new, |written| {
                let first = (index * self.layers) as i32;
                let height = samples.len() / (nx * ny * channels);
                Slab { warp: self, tets, input, options, first, layers: height, samples, written }.draw(candidates)
            })
        });
        let mut tally = Tally::default();
        tallies.iter().for_each(|t| tally.add(t));
        tally.candidates = candidates.tested(tally.written + tally.repeated);
        (tally.cells, tally.cells_kept) = (candidates.cells, candidates.cells_kept);
        Ok(tally)
    }

    /// The input warped onto the output grid.
    ///
    /// # Errors
    /// If there is no memory for it, or the cell size makes no sense.
    pub fn volume(&self, input: &Volume, output: &Grid, options: &WarpOptions) -> Result<(Volume, Tally), WarpError> {
        with_samples!(&input.samples, v => self.typed(input, v, output, options))
    }

    fn typed<T: Fetch>(
        &self,
        input: &Volume,
        samples: &[T],
        output: &Grid,
        options: &WarpOptions,
    ) -> Result<(Volume, Tally), WarpError> {
        let count = output.len() as u64 * input.channels as u64;
        let no_room = WarpError::OutOfMemory { bytes: count.saturating_mul(size_of::<T>() as u64) };
        let mut out: Vec<T> =
            usize::try_from(count).ok().and_then(|n| bytemuck::try_zeroed_vec(n).ok()).ok_or(no_room)?;
        let input_samples = Sampler::new(samples, input.grid.dims, input.channels);
        let tally = self.run(&self.candidates(options.culling)?, input_samples, options, &mut out)?;
        let samples: Samples = T::wrap(out);
        let mut made = Volume::new(*output, input.channels, samples);
        made.rescale = input.rescale;
        Ok((made, tally))
    }
}

impl Facts {
    fn add(&mut self, tet: &Result<Tet, setup::Degenerate>) {
        let Ok(tet) = tet else {
            self.degenerate += 1;
            return;
        };
        self.inverted += usize::from(tet.jacobian < 0.0);
        self.stretch([tet.jacobian; 2]);
    }

    fn stretch(&mut self, [lo, hi]: [f64; 2]) {
        self.jacobian = Some(self.jacobian.map_or([lo, hi], |[a, b]| [a.min(lo), b.max(hi)]));
    }

    fn join(&mut self, other: &Self) {
        self.tets += other.tets;
        self.inverted += other.inverted;
        self.degenerate += other.degenerate;
        if let Some(range) = other.jacobian {
            self.stretch(range);
        }
    }
}

/// For each slab the tetrahedra that reach into it.
fn bin(tets: &[Tet], nz: usize, layers: usize) -> (Vec<u32>, Vec<usize>) {
    let span = |t: &Tet| t.lo[2] as usize / layers..=t.hi[2] as usize / layers;
    let mut ends = vec![0; nz.div_ceil(layers)];
    for t in tets {
        span(t).for_each(|s| ends[s] += 1);
    }
    let mut sum = 0;
    for end in &mut ends {
        // for now where each slab starts; filling moves it to the end
        (*end, sum) = (sum, sum + *end);
    }
    let mut bins = vec![0; sum];
    for (i, t) in tets.iter().enumerate() {
        for s in span(t) {
            bins[ends[s]] = i as u32;
            ends[s] += 1;
        }
    }
    (bins, ends)
}

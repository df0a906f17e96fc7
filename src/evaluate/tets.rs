//! The deformation as a lattice of tetrahedra in the deformed space, and the volume warped through it.
//!
//! # Theory
//!
//! Each tetrahedron interpolates the backward map linearly between its corners, so the coordinate error falls with the square
//! of the edges (`mesh::tet_map`). The lattice fills the texture cube of the output, so that every voxel has a tetrahedron.
//!
//! # Practice
//!
//! [`Lattice::of`] follows a tolerance in voxels of the input, or halves a uniform lattice a given number of times (for
//! studies of convergence). [`resample`] is the export, [`warped`] an object that renderers draw as one that is not deformed.
//! Memory is the input, the output, and some 500 bytes a tetrahedron.

use std::sync::Arc;
use std::time::Instant;

use super::EvaluateError;
use super::export::{ExportOptions, output_grid, stored_outside};
use super::geometry::Refinement;
use super::load::Object;
use super::mask;
use crate::deform::{Prepared, Stack};
use crate::mesh::tet_lattice::{Split, cells_for};
use crate::mesh::tet_map::{MapOptions, MapReport, from_backward_map, uniform_from_backward_map};
use crate::mesh::tets::TetMesh;
use crate::render::Field;
use crate::volume::{Grid, Volume};
use crate::warp::{Facts, Tally, Warp, WarpOptions};

/// Tolerance where none is given, in voxels of the input.
pub const TOLERANCE: f64 = 0.1;

/// Tetrahedra of a uniform lattice of level 0, about.
const START: usize = 384;

/// A lattice, and how far it is from the map.
#[derive(Debug, Clone)]
pub struct Lattice {
    /// Rest positions; the vectors `deformed` are the deformed ones.
    pub mesh: TetMesh,
    /// Errors in voxels of the input.
    pub report: MapReport,
    /// Milliseconds.
    pub ms: f64,
}

impl Lattice {
    /// The lattice of a map over the texture cube of `output`: to a tolerance in voxels of `input`, or uniform and halved as
    /// often as the depth says.
    ///
    /// # Errors
    /// If the tolerance is impossible, there would be too many tetrahedra, or the map is not finite.
    pub fn of(map: &Prepared, input: &Grid, output: &Grid, fineness: Refinement) -> Result<Self, EvaluateError> {
        let started = Instant::now();
        let region = output.world_from_texture();
        let feature = Some(map.feature_size()).filter(|f| f.is_finite());
        let metric = input.voxel_from_world().matrix3;
        let options = MapOptions { metric, feature, tolerance: TOLERANCE, ..MapOptions::default() };
        let (mesh, report) = match fineness {
            Refinement::Tolerance(tolerance) => from_backward_map(map, &region, &MapOptions { tolerance, ..options })?,
            Refinement::Depth(_) | Refinement::Draft => {
                let level = if let Refinement::Depth(level) = fineness { level } else { 0 };
                let cells = cells_for(&region, START, Split::Six).map_err(crate::mesh::tet_map::MapError::from)?;
                uniform_from_backward_map(map, &region, cells, level.into(), &options)?
            }
        };
        Ok(Self { mesh, report, ms: started.elapsed().as_secs_f64() * 1e3 })
    }

    /// The deformed positions of the mesh's points.
    pub fn deformed(&self) -> &[glam::DVec3] {
        self.mesh.vectors("deformed").unwrap_or(&[])
    }
}

/// The lattice that [`warped`] uses for an object.
///
/// # Errors
/// As [`resample`].
pub fn lattice(object: &Object, fineness: Refinement) -> Result<Lattice, EvaluateError> {
    let map = object.stack.prepared();
    let grid = output_grid(&object.volume, &map, &ExportOptions::default())?;
    Lattice::of(&map, &object.volume.grid, &grid, fineness)
}

/// A volume that went through a lattice.
#[derive(Debug)]
pub struct Resampled {
    pub volume: Volume,
    pub lattice: Lattice,
    pub facts: Facts,
    pub tally: Tally,
    /// Voxels that were set to the outside value because they lie outside the proxy mesh.
    pub outside_mesh: usize,
    /// The stored value where nothing is, before it was rounded to the sample type.
    pub outside: f64,
    /// Milliseconds of the warp, and all together.
    pub ms_warp: f64,
    pub ms: f64,
}

/// Resamples an object through a lattice, on the grid that the options choose (their precision plays no part), and clears
/// what lies outside the proxy mesh, as [`super::resample::export`] does.
///
/// # Errors
/// If the grid makes no sense or is too large, or there is no lattice.
pub fn resample(object: &Object, options: &ExportOptions, fineness: Refinement) -> Result<Resampled, EvaluateError> {
    let started = Instant::now();
    let mut made = through(object, options, fineness)?;
    if object.shaped {
        let real = made.volume.rescale.real(made.outside);
        made.outside_mesh =
            mask::clear_outside(&mut made.volume, &object.mesh, &object.topology, object.overlaps, real)?;
    }
    made.ms = started.elapsed().as_secs_f64() * 1e3;
    Ok(made)
}

/// The same without the proxy mesh's part.
///
/// # Errors
/// As [`resample`].
pub(super) fn through(
    object: &Object,
    options: &ExportOptions,
    fineness: Refinement,
) -> Result<Resampled, EvaluateError> {
    let started = Instant::now();
    let (input, map) = (&object.volume, object.stack.prepared());
    let grid = output_grid(input, &map, options)?;
    let outside = stored_outside(input, options.outside);
    let lattice = Lattice::of(&map, &input.grid, &grid, fineness)?;
    let warping = Instant::now();
    let warp = Warp::new(&input.grid, &grid, &lattice.mesh.tets, &lattice.mesh.points, lattice.deformed())?;
    let options = WarpOptions { interpolation: options.interpolation, outside, ..WarpOptions::default() };
    let (volume, tally) = warp.volume(input, &grid, &options)?;
    Ok(Resampled {
        volume,
        facts: *warp.facts(),
        tally,
        outside_mesh: 0,
        outside,
        ms_warp: warping.elapsed().as_secs_f64() * 1e3,
        ms: started.elapsed().as_secs_f64() * 1e3,
        lattice,
    })
}

/// An object whose volume went through a lattice: nothing is left to be deformed, the proxy mesh is where it was.
#[derive(Debug)]
pub struct Warped {
    pub object: Object,
    pub report: MapReport,
    pub ms_lattice: f64,
    /// Warp and preparation for rendering.
    pub ms_warp: f64,
}

/// Warps an object's volume onto its lattice of voxels, grown to hold what was pulled out.
///
/// # Errors
/// As [`resample`].
pub fn warped(object: &Object, fineness: Refinement) -> Result<Warped, EvaluateError> {
    let started = Instant::now();
    let made = through(object, &ExportOptions::default(), fineness)?;
    let (report, ms_lattice) = (made.lattice.report, made.lattice.ms);
    let object = undeformed(object, made.volume);
    Ok(Warped { object, report, ms_lattice, ms_warp: started.elapsed().as_secs_f64() * 1e3 - ms_lattice })
}

/// The object with a volume that is already deformed. Colours, window and view stay.
pub fn undeformed(object: &Object, volume: Volume) -> Object {
    let volume = Arc::new(volume);
    let field = Field::from_volume(Arc::clone(&volume));
    Object { volume, field, stack: Stack::default(), ..object.clone() }
}

//! An object whose surface is found through its strokes.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DMat4, DVec3};

use super::inside::Inside;
use crate::deform::{Framed, Prepared};
use crate::evaluate::EvaluateError;
use crate::evaluate::export::{ExportOptions, GridChoice, output_grid};
use crate::evaluate::load::Object;
use crate::math::{BackwardMap, parallel};
use crate::spline::occupancy::Occupancy;
use crate::spline::{Spline, Through, VoxelMap};
use crate::volume::Grid;

/// A stack of strokes in the voxels of the undeformed volume.
struct InVoxels {
    map: Prepared,
    framed: Framed,
    world_from_voxel: DAffine3,
    voxel_from_world: DAffine3,
}

impl VoxelMap for InVoxels {
    fn backward(&self, p: DVec3) -> DVec3 {
        self.voxel_from_world.transform_point3(self.map.backward(self.world_from_voxel.transform_point3(p)))
    }

    fn sources(&self, lower: DVec3, upper: DVec3) -> Option<[DVec3; 2]> {
        let (lo, hi) = self.framed.sources(lower, upper);
        (lo != lower || hi != upper).then_some([lo, hi])
    }
}

/// The spline of the undeformed volume seen through the strokes, and the voxels that hold all that is seen.
pub(super) fn through(object: &Object, spline: Arc<Spline>) -> Result<(Through, Grid), EvaluateError> {
    let map = object.stack.prepared();
    let rest = &object.volume.grid;
    // as an export takes it by default, but known: looking for it would cost more than all else here
    let outside = (object.volume.channels == 1).then_some(object.field.range[0]);
    let options = ExportOptions { grid: GridChoice::SameGrown, outside, ..ExportOptions::default() };
    let grid = output_grid(&object.volume, &map, &options)?;
    let voxel_from_world = rest.voxel_from_world();
    let lower = voxel_from_world.transform_point3(grid.world_from_voxel.translation).round().to_array();
    let lower = lower.map(|v| v as isize);
    let upper = std::array::from_fn(|a| lower[a] + grid.dims[a] as isize - 1);
    let world_from_voxel = rest.world_from_voxel;
    let framed = map.in_frame(&world_from_voxel);
    let in_voxels = InVoxels { map, framed, world_from_voxel, voxel_from_world };
    Ok((Through::new(spline, Box::new(in_voxels), lower, upper), grid))
}

/// Image and derivative of the strokes' backward map, in voxels.
pub(super) fn derivative(object: &Object) -> impl Fn(DVec3) -> (DVec3, DMat3) + Sync + use<> {
    let map = object.stack.prepared();
    let world_from_voxel = object.volume.grid.world_from_voxel;
    let voxel_from_world = object.volume.grid.voxel_from_world();
    move |p| {
        let (rest, jacobian) = map.backward_with_jacobian(world_from_voxel.transform_point3(p));
        (voxel_from_world.transform_point3(rest), voxel_from_world.matrix3 * jacobian * world_from_voxel.matrix3)
    }
}

/// How full space is where the strokes moved the volume to, within the mesh.
pub(super) fn occupancy(object: &Object, spline: &Spline, grid: &Grid, shells: &[(f64, f32)]) -> Occupancy {
    let map = object.stack.prepared();
    let rest = Occupancy::new(spline, &object.volume.grid, shells, None);
    let columns = object.shaped.then(|| columns(object, grid));
    let seen = |cell: [usize; 3], middle: DVec3| {
        let uncut = object.clip.iter().all(|plane| plane.beyond(middle) <= 0.0);
        let within = |columns: &Columns| {
            let at = cell[2] as f64;
            columns.spans[cell[1] * columns.across + cell[0]].iter().any(|[from, to]| (from..to).contains(&&at))
        };
        uncut && columns.as_ref().is_none_or(within)
    };
    rest.moved(grid, &|p| map.backward(p), Some(&seen))
}

/// Where columns of cells are within a mesh, in cells along the column.
struct Columns {
    across: usize,
    spans: Vec<Vec<[f64; 2]>>,
}

fn columns(object: &Object, grid: &Grid) -> Columns {
    let [nx, ny, nz] = grid.dims.map(|n| n.div_ceil(2));
    // a picture whose pixels are the columns, seen along them
    let size = DVec3::new(nx as f64, ny as f64, nz as f64);
    let clip_from_cell = DMat4::from_translation(DVec3::new(-1.0, 1.0, 0.0))
        * DMat4::from_scale(DVec3::new(2.0, -2.0, 1.0) / size)
        * DMat4::from_translation(DVec3::new(0.5, 0.5, 0.0));
    let cell_from_voxel = DAffine3::from_scale(DVec3::splat(0.5)) * DAffine3::from_translation(DVec3::splat(-0.5));
    let cell_from_world = cell_from_voxel * grid.voxel_from_world();
    let inside = Inside::new(&object.mesh, &(clip_from_cell * DMat4::from(cell_from_world)), (nx as u32, ny as u32));
    let world_from_cell = cell_from_world.inverse();
    let spans = parallel::map(nx * ny, &|n| {
        let (i, j) = (n % nx, n / nx);
        let origin = world_from_cell.transform_point3(DVec3::new(i as f64, j as f64, 0.0));
        let mut spans = Vec::new();
        inside.spans([i, j], origin, world_from_cell.matrix3.z_axis, [-0.5, size.z], |span, _| {
            spans.push(span);
            ControlFlow::Continue(())
        });
        spans
    });
    Columns { across: nx, spans }
}

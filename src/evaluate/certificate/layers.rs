//! Where each voxel of an output comes from, stripe by stripe: by a backward map, or through tetrahedra.
//!
//! Tetrahedra are rasterized here anew, by the definition and without the warp's devices (claims, vector code): what is
//! certified should not certify itself.

use glam::{DAffine3, DMat3, DVec3};

use crate::deform::Prepared;
use crate::math::BackwardMap;
use crate::mesh::tets::TetMesh;
use crate::volume::{Grid, GridError};
use crate::warp::{OVERLAP, Tet, Warp, WarpError};

use super::TetField;

/// A voxel of the output, or of its lattice beyond it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    /// The voxel coordinate in the input; NaN where no tetrahedron is.
    pub at: DVec3,
    /// Volume of the deformed against the undeformed; only from tetrahedra.
    pub jacobian: f64,
    /// Tetrahedra that hold the voxel centre in their inside.
    pub within: u8,
    /// The tetrahedron that `at` comes from.
    pub tet: u32,
}

impl Spot {
    pub const NOTHING: Self = Self { at: DVec3::NAN, jacobian: f64::NAN, within: 0, tet: u32::MAX };

    pub fn is_covered(&self) -> bool {
        !self.at.x.is_nan()
    }
}

/// The part of the output's lattice that is looked at: the output and what lies about it. Places count from its own first
/// voxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    pub grid: Grid,
    /// Place of the output's first voxel.
    pub first: [usize; 3],
    /// Size of the output.
    pub inner: [usize; 3],
}

impl View {
    /// The output and whatever of `points` (world) lies within half its size (or 32 voxels) about it.
    pub fn around(output: &Grid, points: impl Iterator<Item = DVec3>) -> Result<Self, GridError> {
        let to = output.voxel_from_world();
        let last = output.size() - 1.0;
        let margin = (0.5 * output.size()).max(DVec3::splat(32.0)).ceil();
        let (lo, hi) = points.fold((DVec3::ZERO, last), |(lo, hi), p| {
            let p = to.transform_point3(p);
            (lo.min(p), hi.max(p))
        });
        let (lo, hi) = (lo.floor().max(-margin), hi.ceil().min(last + margin));
        let dims = (hi - lo + 1.0).to_array().map(|n| n as usize);
        let origin = output.world_from_voxel.transform_point3(lo);
        let frame = DAffine3::from_mat3_translation(output.world_from_voxel.matrix3, origin);
        let grid = Grid::new(dims, frame, output.space)?;
        Ok(Self { grid, first: (-lo).to_array().map(|n| n as usize), inner: output.dims })
    }

    /// The voxel of the output at a place, if it is one.
    pub fn voxel(&self, place: [usize; 3]) -> Option<[usize; 3]> {
        let voxel = std::array::from_fn(|a| place[a].wrapping_sub(self.first[a]));
        (0..3).all(|a| voxel[a] < self.inner[a]).then_some(voxel)
    }

    pub fn world(&self, [x, y, z]: [usize; 3]) -> DVec3 {
        self.grid.world_from_voxel.transform_point3(DVec3::new(x as f64, y as f64, z as f64))
    }
}

/// Layers that are worked off together.
pub(super) const SLAB: usize = 8;
/// Rows that are worked off together.
pub(super) const STRIPE: usize = 32;

/// Says where voxels come from.
pub(super) trait Layers: Sync {
    /// The voxels of rows `y`, `y + 1`, ... of layer `z` of the view; as many rows as `spots` holds.
    fn rows(&self, y: usize, z: usize, spots: &mut [Spot]);

    /// Where the deformation takes the place in the input that a voxel comes from: world, near `p`. The error is a fold.
    fn forward(&self, spot: &Spot) -> Result<DVec3, ()>;

    /// Determinant of the deformation at a place of the world; `None` if it is taken from the tetrahedra.
    fn determinant(&self, p: DVec3) -> Option<f64>;
}

/// A coordinate within this of a whole number is that number, as in the export.
const SNAP: f64 = 1e-9;

pub(super) struct MapLayers<'a> {
    view: &'a View,
    map: &'a Prepared,
    input_from_view: DAffine3,
    input_from_world: DMat3,
    world_from_input: DAffine3,
}

impl<'a> MapLayers<'a> {
    pub fn new(view: &'a View, input: &Grid, map: &'a Prepared) -> Self {
        let input_from_world = input.voxel_from_world();
        Self {
            view,
            map,
            input_from_view: input_from_world * view.grid.world_from_voxel,
            input_from_world: input_from_world.matrix3,
            world_from_input: input.world_from_voxel,
        }
    }
}

impl Layers for MapLayers<'_> {
    fn rows(&self, y: usize, z: usize, spots: &mut [Spot]) {
        let nx = self.view.grid.dims[0];
        for (i, spot) in spots.iter_mut().enumerate() {
            let place = [i % nx, y + i / nx, z];
            let p = self.view.world(place);
            let at = self.input_from_view.transform_point3(DVec3::from_array(place.map(|v| v as f64)));
            // a difference in the world, so that what is not moved stays exactly where it is
            let at = at + self.input_from_world * (self.map.backward(p) - p);
            let whole = at.round();
            let near = (at - whole).abs().cmple(DVec3::splat(SNAP));
            *spot = Spot { at: DVec3::select(near, whole, at), within: 1, ..Spot::NOTHING };
        }
    }

    fn forward(&self, spot: &Spot) -> Result<DVec3, ()> {
        self.map.forward(self.world_from_input.transform_point3(spot.at)).map_err(|_| ())
    }

    fn determinant(&self, p: DVec3) -> Option<f64> {
        Some(self.map.backward_with_jacobian(p).1.determinant().recip())
    }
}

pub(super) struct TetLayers<'a> {
    view: &'a View,
    field: &'a TetField<'a>,
    pub warp: Warp,
    /// For each slab of the view the prepared tetrahedra that reach into it, in the order of their numbers.
    bins: Vec<Vec<u32>>,
    input: Grid,
}

impl<'a> TetLayers<'a> {
    pub fn new(view: &'a View, input: &Grid, field: &'a TetField<'a>) -> Result<Self, WarpError> {
        let warp = Warp::new(input, &view.grid, field.tets, field.rest, field.deformed)?;
        let mut bins = vec![Vec::new(); view.grid.dims[2].div_ceil(SLAB)];
        for (i, tet) in warp.tets().iter().enumerate() {
            for bin in &mut bins[tet.lo[2] as usize / SLAB..=tet.hi[2] as usize / SLAB] {
                bin.push(i as u32);
            }
        }
        Ok(Self { view, field, warp, bins, input: *input })
    }
}

/// First and last voxel of a row in a tetrahedron; the last lies before the first if there is none.
fn run(tet: &Tet, y: i32, z: i32) -> (i32, i32) {
    let (mut lo, mut hi) = (f64::from(tet.lo[0] - tet.anchor[0]), f64::from(tet.hi[0] - tet.anchor[0]));
    let (y, z) = (f64::from(y - tet.anchor[1]), f64::from(z - tet.anchor[2]));
    for b in &tet.bary {
        let rest = b[1] * y + b[2] * z + b[3] + tet.slack;
        if b[0].abs() < 1e-12 {
            hi = if rest < 0.0 { f64::NEG_INFINITY } else { hi };
        } else if b[0] > 0.0 {
            lo = lo.max(-rest / b[0]);
        } else {
            hi = hi.min(-rest / b[0]);
        }
    }
    if lo <= hi { (lo.ceil() as i32 + tet.anchor[0], hi.floor() as i32 + tet.anchor[0]) } else { (0, -1) }
}

impl Layers for TetLayers<'_> {
    fn rows(&self, y: usize, z: usize, spots: &mut [Spot]) {
        spots.fill(Spot::NOTHING);
        let nx = self.view.grid.dims[0];
        let (top, bottom, z32) = (y as i32, (y + spots.len() / nx) as i32 - 1, z as i32);
        for &t in &self.bins[z / SLAB] {
            let tet = &self.warp.tets()[t as usize];
            if tet.lo[2] > z32 || tet.hi[2] < z32 {
                continue;
            }
            for row in tet.lo[1].max(top)..=tet.hi[1].min(bottom) {
                let (from, to) = run(tet, row, z32);
                for x in from..=to {
                    let spot = &mut spots[(row - top) as usize * nx + x as usize];
                    let voxel = [x, row, z32];
                    if !spot.is_covered() {
                        let at = tet.rest_position(voxel);
                        let whole = at.round();
                        spot.at = if (at - whole).abs().max_element() < SNAP { whole } else { at };
                        (spot.jacobian, spot.tet) = (tet.jacobian, tet.id);
                    }
                    let inside = tet.barycentric(voxel).iter().all(|b| *b > OVERLAP);
                    spot.within = spot.within.saturating_add(u8::from(inside));
                }
            }
        }
    }

    fn forward(&self, spot: &Spot) -> Result<DVec3, ()> {
        let q = self.input.world_from_voxel.transform_point3(spot.at);
        if let Some(map) = self.field.exact {
            return map.forward(q).map_err(|_| ());
        }
        let corners = self.field.tets[spot.tet as usize];
        let [rest, moved] = [self.field.rest, self.field.deformed].map(|p| TetMesh::corners(corners, p));
        let edges = |p: [DVec3; 4]| DMat3::from_cols(p[1] - p[0], p[2] - p[0], p[3] - p[0]);
        Ok(moved[0] + edges(moved) * (edges(rest).inverse() * (q - rest[0])))
    }

    fn determinant(&self, _: DVec3) -> Option<f64> {
        None
    }
}

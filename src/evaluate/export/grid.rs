//! Which grid the deformed volume is written on, and how its voxels lie to those of the input.

use glam::{DAffine3, DMat3, DVec3};

use super::ExportError;
use crate::math::{BackwardMap, OrientedBox};
use crate::volume::Grid;

/// The grid of the exported volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GridChoice {
    /// The grid of the input.
    Same,
    /// The lattice of the input, with as many layers added on each side as hold what was pulled out. Voxels that did not
    /// move keep their samples bit for bit.
    SameGrown,
    /// The texture cube of the input, filled with voxels of this spacing along its axes (world units), the first voxel
    /// flush with the first face and the last at or just beyond the last; with layers added as in `SameGrown` if `grown`.
    Spacing { spacing: DVec3, grown: bool },
    /// This one, as it is.
    Given(Grid),
}

/// How the voxels of the output lie to those of the input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Link {
    /// Voxel i of the output is voxel i + offset of the input.
    Lattice([i64; 3]),
    /// The input's voxel coordinates from the output's.
    Affine(DAffine3),
}

/// Greatest deviation, in voxels, at which two lattices are the same and at which a coordinate is a whole number. Some
/// hundred times the rounding of `f64` in world coordinates of the size of a volume's grid.
pub(super) const SNAP: f64 = 1e-9;

/// Whole numbers within [`SNAP`] become exact.
#[inline]
pub(super) fn snap(v: DVec3) -> DVec3 {
    let near = v.round();
    DVec3::select((v - near).abs().cmple(DVec3::splat(SNAP)), near, v)
}

/// Everything that leads from a voxel of the output to a coordinate in the input.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub link: Link,
    pub world_from_out: DAffine3,
    /// Turns a world displacement into voxels of the input.
    pub in_from_world: DMat3,
}

impl Frame {
    pub fn new(input: &Grid, output: &Grid) -> Self {
        let affine = input.voxel_from_world() * output.world_from_voxel;
        let offset = affine.translation.round();
        let deviation = (affine.matrix3 - DMat3::IDENTITY).abs() * output.size() + (affine.translation - offset).abs();
        let aligned = deviation.max_element() < 1e3 * SNAP && offset.abs().max_element() < FAR;
        let link = if aligned {
            Link::Lattice([offset.x as i64, offset.y as i64, offset.z as i64])
        } else {
            Link::Affine(affine)
        };
        Self { link, world_from_out: output.world_from_voxel, in_from_world: input.voxel_from_world().matrix3 }
    }

    /// Input coordinate of an output voxel that is not displaced.
    #[inline]
    pub fn undisplaced(&self, out: DVec3) -> DVec3 {
        match self.link {
            Link::Lattice([x, y, z]) => out + DVec3::new(x as f64, y as f64, z as f64),
            Link::Affine(m) => m.transform_point3(out),
        }
    }

    /// Change of the input coordinate with a step along each axis of the output.
    pub fn steps(&self) -> DMat3 {
        match self.link {
            Link::Lattice(_) => DMat3::IDENTITY,
            Link::Affine(m) => m.matrix3,
        }
    }

    /// Displacement, in voxels of the input, of the output voxel `out` under the map. Taken as a difference in the world, so
    /// that a point the map leaves alone stays exactly where it is.
    #[inline]
    pub fn displacement(&self, map: &dyn BackwardMap, out: DVec3) -> DVec3 {
        let p = self.world_from_out.transform_point3(out);
        self.in_from_world * (map.backward(p) - p)
    }

    /// Input coordinate of the output voxel `out` under the map.
    #[inline]
    pub fn source(&self, map: &dyn BackwardMap, out: DVec3) -> DVec3 {
        snap(self.undisplaced(out) + self.displacement(map, out))
    }
}

pub(super) fn vector(v: [i64; 3]) -> DVec3 {
    DVec3::new(v[0] as f64, v[1] as f64, v[2] as f64)
}

/// A box of whole voxels, both ends inside it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span {
    pub lo: [i64; 3],
    pub hi: [i64; 3],
}

impl Span {
    pub fn of(grid: &Grid) -> Self {
        Self { lo: [0; 3], hi: grid.dims.map(|n| n as i64 - 1) }
    }

    pub fn hull(self, other: Self) -> Self {
        Self {
            lo: std::array::from_fn(|a| self.lo[a].min(other.lo[a])),
            hi: std::array::from_fn(|a| self.hi[a].max(other.hi[a])),
        }
    }

    /// With so many layers more on each side.
    pub fn widened(self, by: i64) -> Self {
        Self { lo: self.lo.map(|v| v - by), hi: self.hi.map(|v| v + by) }
    }

    pub fn within(self, other: &Self) -> Self {
        Self {
            lo: std::array::from_fn(|a| self.lo[a].max(other.lo[a])),
            hi: std::array::from_fn(|a| self.hi[a].min(other.hi[a])),
        }
    }

    /// Voxels along each axis.
    pub fn edges(&self) -> [f64; 3] {
        std::array::from_fn(|a| (self.hi[a] - self.lo[a] + 1) as f64)
    }

    /// Whether the boxes share a voxel or touch.
    fn touches(&self, other: &Self) -> bool {
        (0..3).all(|a| self.lo[a] <= other.hi[a] + 1 && other.lo[a] <= self.hi[a] + 1)
    }

    /// `None` if the count does not fit.
    pub fn voxels(&self) -> Option<u64> {
        (0..3).try_fold(1u64, |n, a| n.checked_mul(u64::try_from(self.hi[a] - self.lo[a] + 1).ok()?))
    }
}

/// The voxels of the lattice `output` whose centres may lie in the bounds of an oriented box.
pub(super) fn span_of_box(output: &Grid, support: &OrientedBox) -> Span {
    let to = output.voxel_from_world();
    let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for corner in support.corners() {
        let p = to.transform_point3(corner);
        (lo, hi) = (lo.min(p), hi.max(p));
    }
    Span { lo: whole(lo.ceil()), hi: whole(hi.floor()) }
}

/// Voxel indices are kept within this, so that their differences and sums cannot overflow.
const FAR: f64 = (1u64 << 41) as f64;

/// NaN becomes 0.
fn whole(v: DVec3) -> [i64; 3] {
    let v = v.clamp(DVec3::splat(-FAR), DVec3::splat(FAR));
    [v.x as i64, v.y as i64, v.z as i64]
}

/// The voxels of the lattice of `output` where something of `input` can be: the input's texture cube and every support
/// that touches it, directly or through other supports.
pub(super) fn reached(input: &Grid, output: &Grid, supports: &[OrientedBox]) -> Span {
    let from_input = output.voxel_from_world() * input.world_from_texture();
    let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for corner in 0..8u8 {
        let at = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2 & 1));
        let p = snap(from_input.transform_point3(at));
        (lo, hi) = (lo.min(p), hi.max(p));
    }
    let mut reached = vec![Span { lo: whole(lo.ceil()), hi: whole(hi.floor()) }];
    let mut left: Vec<Span> = supports.iter().map(|b| span_of_box(output, b)).collect();
    loop {
        let (near, far): (Vec<_>, Vec<_>) = left.into_iter().partition(|s| reached.iter().any(|r| r.touches(s)));
        if near.is_empty() {
            break;
        }
        reached.extend(near);
        left = far;
    }
    reached.into_iter().reduce(Span::hull).unwrap_or(Span { lo: [0; 3], hi: [0; 3] })
}

/// The grid of a choice before any growth.
///
/// # Errors
/// If the spacing or the grid makes no sense.
pub(super) fn ungrown(input: &Grid, choice: GridChoice) -> Result<Grid, ExportError> {
    match choice {
        GridChoice::Same | GridChoice::SameGrown => Ok(*input),
        GridChoice::Given(grid) => Ok(Grid::new(grid.dims, grid.world_from_voxel, grid.space)?),
        GridChoice::Spacing { spacing, .. } => {
            if !(spacing.is_finite() && spacing.min_element() > 0.0) {
                return Err(ExportError::Spacing(spacing));
            }
            let ratio = input.spacing() / spacing;
            // a count that is whole up to rounding does not get another layer
            let count = (input.size() * ratio - 1e-6).ceil().max(DVec3::ONE);
            let dims = [count.x as usize, count.y as usize, count.z as usize];
            let matrix = input.world_from_voxel.matrix3 * DMat3::from_diagonal(ratio.recip());
            // the lower faces of both first voxels coincide
            let origin = input.world_from_voxel.transform_point3(0.5 * (ratio.recip() - DVec3::ONE));
            Ok(Grid::new(dims, DAffine3::from_mat3_translation(matrix, origin), input.space)?)
        }
    }
}

impl GridChoice {
    pub(super) fn grows(&self) -> bool {
        matches!(self, Self::SameGrown | Self::Spacing { grown: true, .. })
    }
}

/// The lattice of `grid` from one voxel to another.
pub(super) fn cut(grid: &Grid, span: &Span) -> Result<Grid, ExportError> {
    let dims: [usize; 3] = std::array::from_fn(|a| (span.hi[a] - span.lo[a] + 1) as usize);
    let origin = grid.world_from_voxel.transform_point3(vector(span.lo));
    Ok(Grid::new(dims, DAffine3::from_mat3_translation(grid.world_from_voxel.matrix3, origin), grid.space)?)
}

//! One tetrahedron in the voxels of the output: barycentric coordinates, rest position, bounds.

use glam::DVec3;

use crate::mesh::tets::signed_volume;

/// A voxel belongs to a tetrahedron if no barycentric coordinate is below minus this.
pub const TOLERANCE: f64 = 1e-9;

/// Voxels by which bounds are widened before they are rounded, so that rounding loses no voxel on a face.
pub(super) const PAD: f64 = 1e-6;

/// An affine function `x * at[0] + y * at[1] + z * at[2] + at[3]` of voxel indices relative to a tetrahedron's `anchor`.
pub type AffineRow = [f64; 4];

/// A tetrahedron that has volume, at rest and deformed, in voxel indices of the output.
#[derive(Debug, Clone)]
pub struct Tet {
    /// Its number in the mesh.
    pub id: u32,
    /// The voxel that coordinates are relative to: near the first corner, so that they stay small and exact.
    pub anchor: [i32; 3],
    /// Barycentric coordinates.
    pub bary: [AffineRow; 4],
    /// The rest position in voxels of the input.
    pub rest: [AffineRow; 3],
    /// Lower and upper corner of the voxels it may hold, cut to the grid; empty if any `lo` is above its `hi`.
    pub lo: [i32; 3],
    pub hi: [i32; 3],
    /// Bounds of the rest corners, in voxels of the input.
    pub(crate) rest_bounds: [DVec3; 2],
    /// Its volume at rest, in voxels of the input.
    pub(super) rest_volume: f64,
    /// Determinant of the Jacobian of the deformation, world against world.
    pub jacobian: f64,
    /// The deformed corners, relative to the anchor.
    pub corners: [DVec3; 4],
    /// Slack of the barycentric coordinates: [`TOLERANCE`], or more where slivers make rounding larger.
    pub slack: f64,
}

/// The tetrahedron has no volume, or one that a number cannot hold.
#[derive(Debug, Clone, Copy)]
pub(super) struct Degenerate;

impl Tet {
    /// From rest corners in voxels of the input and deformed corners in voxels of the output; `scale` is the volume of an
    /// output voxel over that of an input voxel.
    pub(super) fn new(
        id: u32,
        rest: [DVec3; 4],
        moved: [DVec3; 4],
        scale: f64,
        dims: [usize; 3],
    ) -> Result<Self, Degenerate> {
        // far beyond any grid, but still whole numbers
        const FAR: f64 = (1 << 28) as f64;
        let base = moved[0].round();
        if !(base.abs().max_element() < FAR) {
            return Err(Degenerate);
        }
        let corners = moved.map(|p| p - base);
        let edges = [corners[1] - corners[0], corners[2] - corners[0], corners[3] - corners[0]];
        let volume = edges[0].cross(edges[1]).dot(edges[2]);
        let jacobian = volume / (6.0 * signed_volume(rest)) * scale;
        let longest = edges.iter().map(|e| e.length()).fold(0.0, f64::max);
        // below this the volume is rounding
        if !(volume.abs() > 1e-14 * longest.powi(3)) || !jacobian.is_finite() || jacobian == 0.0 {
            return Err(Degenerate);
        }
        let gradient =
            [edges[1].cross(edges[2]) / volume, edges[2].cross(edges[0]) / volume, edges[0].cross(edges[1]) / volume];
        let row = |g: DVec3, at: f64| [g.x, g.y, g.z, at - g.dot(corners[0])];
        let others = gradient.map(|g| row(g, 0.0));
        let first = row(-(gradient[0] + gradient[1] + gradient[2]), 1.0);
        let rest_gradient = |a: usize| {
            let side = |i: usize| rest[i + 1][a] - rest[0][a];
            gradient[0] * side(0) + gradient[1] * side(1) + gradient[2] * side(2)
        };
        let bounds = |p: [DVec3; 4]| [p[0].min(p[1]).min(p[2]).min(p[3]), p[0].max(p[1]).max(p[2]).max(p[3])];
        let [lo, hi] = bounds(corners);
        let (lo, hi) = (lo + base - PAD, hi + base + PAD);
        let steepest = gradient.iter().map(|g| g.length()).fold(0.0, f64::max);
        Ok(Self {
            id,
            anchor: base.to_array().map(|v| v as i32),
            bary: [first, others[0], others[1], others[2]],
            rest: std::array::from_fn(|a| row(rest_gradient(a), rest[0][a])),
            // saturating conversions keep what is far away far away
            lo: lo.ceil().to_array().map(|v| (v as i32).max(0)),
            hi: std::array::from_fn(|a| (hi[a].floor() as i32).min(dims[a] as i32 - 1)),
            rest_bounds: bounds(rest),
            rest_volume: signed_volume(rest).abs(),
            jacobian,
            corners,
            slack: TOLERANCE.max(4.0 * f64::EPSILON * steepest * (hi - lo).length()),
        })
    }

    pub(super) fn reaches_grid(&self) -> bool {
        (0..3).all(|a| self.lo[a] <= self.hi[a])
    }

    /// Barycentric coordinates of a voxel centre.
    #[inline(always)]
    pub fn barycentric(&self, voxel: [i32; 3]) -> [f64; 4] {
        let [x, y, z] = self.relative(voxel);
        self.bary.map(|b| b[0] * x + b[1] * y + b[2] * z + b[3])
    }

    /// Whether the voxel centre is in the closed tetrahedron, up to the slack.
    #[inline(always)]
    pub fn contains(&self, voxel: [i32; 3]) -> bool {
        self.barycentric(voxel).iter().all(|b| *b >= -self.slack)
    }

    /// Where in the input the voxel centre comes from.
    #[inline(always)]
    pub fn rest_position(&self, voxel: [i32; 3]) -> DVec3 {
        let [x, y, z] = self.relative(voxel);
        DVec3::from_array(self.rest.map(|r| r[0] * x + r[1] * y + r[2] * z + r[3]))
    }

    #[inline(always)]
    fn relative(&self, voxel: [i32; 3]) -> [f64; 3] {
        std::array::from_fn(|a| f64::from(voxel[a] - self.anchor[a]))
    }
}

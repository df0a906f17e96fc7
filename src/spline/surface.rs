//! A closed triangle mesh of a spline's iso-surface.
//!
//! # Theory
//!
//! The lattice of the samples is contoured ([`crate::mesh::contour`]) by the sides that the spline's own values at the samples
//! are on. On the edge from one sample to the next, the spline is two cubics that meet at the face between the two cubes;
//! the vertex is a root of one of them, so it lies on the spline's surface up to rounding. The gradient there comes from
//! differences of coefficients around the edge: its part along the edge is the derivative of the cubic, its parts across are
//! quadratics, whose three coefficients are slopes of the control net.
//!
//! # Practice
//!
//! Vertices stay [`CLEAR`] of a voxel away from the samples, so that no two of them ever coincide, and that is how far one
//! may be from the surface where a sample has just the isovalue. Where the surface leaves the domain it is closed along the
//! faces of the outermost cubes.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::Spline;
use super::correct::Sums;
use super::cubic;
use super::level::{limit, signs};
use crate::math::parallel::Pool;
use crate::mesh::contour::{Contour, Edge, Placer, Sides, contour};

/// How near to a sample a vertex may come, in voxels.
pub const CLEAR: f64 = 1e-4;

/// From voxels to the world, for places and normals.
pub(super) struct Frame {
    world_from_voxel: DAffine3,
    /// Turns a gradient per voxel into one in the world.
    covariant: DMat3,
    /// Whether the axes of the voxels are left-handed.
    pub mirrors: bool,
}

impl Frame {
    pub fn new(world_from_voxel: &DAffine3) -> Self {
        let m = world_from_voxel.matrix3;
        Self { world_from_voxel: *world_from_voxel, covariant: m.inverse().transpose(), mirrors: m.determinant() < 0.0 }
    }

    #[inline(always)]
    pub fn place(&self, p: DVec3) -> DVec3 {
        self.world_from_voxel.transform_point3(p)
    }

    /// Place and normal of a vertex within the cell between two corners, in the middle of a loop of others.
    pub fn middle(&self, spline: &Spline, iso: f64, cell: [DVec3; 2], ring: &[(DVec3, Vec3)]) -> (DVec3, Vec3) {
        let mean = ring.iter().map(|r| r.0).sum::<DVec3>() / ring.len() as f64;
        let start = self.world_from_voxel.inverse().transform_point3(mean);
        let p = project(spline, iso, start, 0.5).clamp(cell[0], cell[1]);
        (self.place(p), self.normal(spline.gradient(p)))
    }

    /// Down the gradient.
    #[inline(always)]
    pub fn normal(&self, gradient: DVec3) -> Vec3 {
        -(self.covariant * gradient).normalize_or(DVec3::Z).as_vec3()
    }
}

/// The surface where a spline has the value `iso`, in the world; inside is what is at or above. It is closed, manifold and
/// consistently oriented; vertices lie on the spline's surface, normals run down its gradient.
pub fn surface(spline: &Spline, iso: f64, world_from_voxel: &DAffine3) -> Contour {
    let strides = spline.coefficients.strides();
    contour(&sides(spline, iso), &Along { spline, strides, iso, frame: Frame::new(world_from_voxel) })
}

/// The sides of the samples by the spline's values there.
fn sides(spline: &Spline, iso: f64) -> Sides {
    let c = &spline.coefficients;
    let [_, width, layer] = c.strides();
    let at = limit(iso);
    let scratch = Pool::default();
    Sides::new(c.dims, &|j, k, out| {
        let layers = [k, k + 1, k + 2].map(|k| &c.values[k * layer..][..layer]);
        scratch.with(|| Sums::new(width), |sums| signs(sums.row(layers, (j + 1) * width, width), at, out));
    })
}

/// Places vertices along the edges of the lattice.
struct Along<'a> {
    spline: &'a Spline,
    strides: [usize; 3],
    iso: f64,
    frame: Frame,
}

/// The samples around an edge at one of its ends, or one step beyond: at the edge, beside it along both other axes, and at
/// the corners between these.
struct Ring {
    center: f64,
    /// Up, down, front, back.
    lateral: [f64; 4],
    /// Up and front, up and back, down and front, down and back.
    diagonal: [f64; 4],
}

impl Ring {
    #[inline(always)]
    fn at(v: &[f32], center: usize, [y, z]: [isize; 2]) -> Self {
        let get = |offset: isize| f64::from(v[center.wrapping_add_signed(offset)]);
        Self {
            center: get(0),
            lateral: [get(y), get(-y), get(z), get(-z)],
            diagonal: [get(y + z), get(y - z), get(-y + z), get(-y - z)],
        }
    }

    #[inline(always)]
    fn sums(&self) -> [f64; 2] {
        let [u, d, f, b] = self.lateral;
        let [uf, ub, df, db] = self.diagonal;
        [u + d + f + b, uf + ub + df + db]
    }
}

/// The value at the face between the two cubes of an edge, less the isovalue.
#[inline(always)]
fn at_face(first: &Ring, second: &Ring, iso: f64) -> f64 {
    let ([lateral0, diagonal0], [lateralp, diagonalp]) = (first.sums(), second.sums());
    13.0 / 48.0 * (first.center + second.center) + 5.0 / 96.0 * (lateral0 + lateralp) + (diagonal0 + diagonalp) / 192.0
        - iso
}

/// The coefficients along one half of an edge, less the isovalue, and what the gradient needs.
struct Half {
    cubic: [f64; 4],
    /// The parts of the gradient across the edge, by Bernstein coefficients.
    across: [[f64; 3]; 2],
}

impl Half {
    /// From the end that the half begins at; the rings before it, there, and at the other end.
    #[inline(always)]
    fn new(before: &Ring, here: &Ring, beyond: &Ring, iso: f64) -> Self {
        let (cm, c0, cp) = (before.center, here.center, beyond.center);
        let lateralm = before.sums()[0];
        let ([lateral0, diagonal0], [lateralp, _]) = (here.sums(), beyond.sums());
        let cubic = [
            3.0 / 8.0 * c0 + (cm + cp + lateral0) / 12.0 + (lateralm + lateralp + diagonal0) / 96.0 - iso,
            3.0 / 8.0 * c0
                + 7.0 / 48.0 * cp
                + lateral0 / 12.0
                + cm / 48.0
                + lateralp / 64.0
                + diagonal0 / 96.0
                + lateralm / 192.0
                - iso,
            c0 / 3.0 + 5.0 / 24.0 * cp + 7.0 / 96.0 * lateral0 + lateralp / 32.0 + diagonal0 / 96.0 - iso,
            at_face(here, beyond, iso),
        ];
        // slopes of the rings of coefficients around the edge, by differences to both sides
        let slopes = |m: f64, o: f64, p: f64, diagonal0: f64, diagonalp: f64| {
            [
                3.0 / 8.0 * o + (diagonal0 + m + p) / 32.0,
                5.0 / 16.0 * o + p / 8.0 + diagonal0 / 32.0,
                7.0 / 32.0 * (o + p) + (diagonal0 + diagonalp) / 64.0,
            ]
        };
        let up = |r: &Ring| r.lateral[0] - r.lateral[1];
        let front = |r: &Ring| r.lateral[2] - r.lateral[3];
        let up_diagonal = |r: &Ring| {
            let [uf, ub, df, db] = r.diagonal;
            uf - df + ub - db
        };
        let front_diagonal = |r: &Ring| {
            let [uf, ub, df, db] = r.diagonal;
            uf - ub + df - db
        };
        let across = [
            slopes(up(before), up(here), up(beyond), up_diagonal(here), up_diagonal(beyond)),
            slopes(front(before), front(here), front(beyond), front_diagonal(here), front_diagonal(beyond)),
        ];
        Self { cubic, across }
    }
}

impl Placer for Along<'_> {
    fn vertex(&self, edge: Edge, inside: bool) -> (DVec3, Vec3) {
        let c = &self.spline.coefficients;
        let [x, y, z] = [0, 1, 2].map(|i| self.strides[(edge.axis + i) % 3] as isize);
        let at = c.index(edge.node);
        let (one, two) = (Ring::at(&c.values, at, [y, z]), Ring::at(&c.values, at.wrapping_add_signed(x), [y, z]));
        // the half whose ends are on different sides
        let first = (at_face(&one, &two, self.iso) >= 0.0) != inside;
        let half = if first {
            Half::new(&Ring::at(&c.values, at.wrapping_add_signed(-x), [y, z]), &one, &two, self.iso)
        } else {
            Half::new(&Ring::at(&c.values, at.wrapping_add_signed(2 * x), [y, z]), &two, &one, self.iso)
        };
        let u = cubic::crossing(&half.cubic, 0.0, 1.0, half.cubic[3]).max(2.0 * CLEAR);
        let (mut p, mut gradient) = (DVec3::from(edge.node.map(|v| v as f64)), DVec3::ZERO);
        p[edge.axis] += if first { 0.5 * u } else { 1.0 - 0.5 * u };
        let s = 1.0 - u;
        let quadratic = |b: &[f64; 3]| s * s * b[0] + 2.0 * s * u * b[1] + u * u * b[2];
        // the cubic's parameter runs twice as fast as voxels
        gradient[edge.axis] = if first { 2.0 } else { -2.0 } * cubic::slope(&half.cubic, u);
        gradient[(edge.axis + 1) % 3] = quadratic(&half.across[0]);
        gradient[(edge.axis + 2) % 3] = quadratic(&half.across[1]);
        (self.frame.place(p), self.frame.normal(gradient))
    }

    fn border(&self, p: DVec3, outward: DVec3) -> (DVec3, Vec3) {
        (self.frame.place(p), self.frame.normal(-outward))
    }

    fn middle(&self, node: [i64; 3], ring: &[(DVec3, Vec3)]) -> (DVec3, Vec3) {
        let low = DVec3::from(node.map(|v| v as f64));
        self.frame.middle(self.spline, self.iso, [low, low + 1.0], ring)
    }

    fn joined(&self, node: [usize; 3], axis: usize) -> bool {
        // by the value in the middle of the face
        let mut p = DVec3::from(node.map(|v| v as f64 + 0.5));
        p[axis] -= 0.5;
        self.spline.value(p) >= self.iso
    }

    fn mirrors(&self) -> bool {
        self.frame.mirrors
    }
}

/// The nearest place on the surface that a few Newton steps along the gradient lead to, at most `reach` voxels from `start`;
/// `start` itself if they do not settle.
pub fn project(spline: &Spline, iso: f64, start: DVec3, reach: f64) -> DVec3 {
    let mut p = start;
    for _ in 0..12 {
        let (value, gradient) = spline.value_and_gradient(p);
        let square = gradient.length_squared();
        if !(square > 0.0) {
            return start;
        }
        let step = gradient * ((iso - value) / square);
        p += step.clamp_length_max(0.25);
        if (p - start).length_squared() > reach * reach {
            return start;
        }
        if step.length_squared() < 1e-20 {
            return p;
        }
    }
    start
}

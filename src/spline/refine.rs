//! Meshes of the surface to a tolerance.
//!
//! # Theory
//!
//! Between the samples, a spline bends more than edges from sample to sample can follow: crests and thin walls would be cut
//! off before any edge could be refined. So the lattice that is contoured here is finer ([`FINER`]) than the samples.
//!
//! An edge is cut where its middle lies farther from the surface than the tolerance. The new vertex is where the line
//! through the middle, along the mean of the normals at both ends, leaves the inside: so it lies on the same sheet of the
//! surface. Which edges are cut depends on the edges alone, so both triangles of an edge agree, and the mesh stays closed and
//! manifold. A triangle with one, two or three cut edges becomes two, three or four.
//!
//! # Practice
//!
//! Levels follow each other until no edge is cut. Where the line does not meet the surface within half the edge's length, or
//! a triangle would turn over, the edge stays as it is.

use std::ops::ControlFlow;

use glam::{DAffine3, DVec3, Vec3};

use super::surface::{CLEAR, Frame};
use super::{Crossing, Level, Ray, Spline};
use crate::math::parallel;
use crate::mesh::contour::{Contour, Edge, Placer, Sides, contour};
use crate::mesh::{Topology, TriMesh};

/// Nodes of the lattice for each sample along an axis.
pub const FINER: usize = 2;

/// How often an edge may be cut.
pub const LEVELS: u32 = 5;

/// The surface where a spline has the value `iso`, in the world, as [`super::surface::surface`] gives it, but with edges
/// whose middle is within `tolerance` voxels of the spline's surface.
pub fn surface(spline: &Spline, iso: f64, world_from_voxel: &DAffine3, tolerance: f64) -> (Contour, RefineReport) {
    let level = Level::new(spline, iso);
    let fine = Fine { level: &level, frame: Frame::new(world_from_voxel) };
    let mut mesh = contour(&fine.sides(), &fine);
    let report = refine(&level, world_from_voxel, &mut mesh, tolerance, LEVELS);
    (mesh, report)
}

/// Contours a lattice with [`FINER`] nodes for each sample along an axis.
struct Fine<'a> {
    level: &'a Level<'a>,
    frame: Frame,
}

impl Fine<'_> {
    fn sides(&self) -> Sides {
        let spline = self.level.spline();
        let dims = spline.dims().map(|n| (n - 1) * FINER + 1);
        Sides::new(dims, &|j, k, out| {
            for i in 0..dims[0] {
                // a node between two cubes has the value of either
                let cube = [i, j, k].map(|v| (v + FINER / 2) / FINER);
                let inside = if self.level.is_active(cube) {
                    spline.value(voxel([i, j, k].map(|v| v as f64))) >= self.level.iso()
                } else {
                    f64::from(spline.sample(cube)) >= self.level.iso()
                };
                out[i / 64] |= u64::from(inside) << (i % 64);
            }
        })
    }
}

/// Voxel coordinates of a place in the lattice.
fn voxel(node: [f64; 3]) -> DVec3 {
    DVec3::from(node) / FINER as f64
}

impl Placer for Fine<'_> {
    fn vertex(&self, edge: Edge, inside: bool) -> (DVec3, Vec3) {
        let mut direction = DVec3::ZERO;
        direction[edge.axis] = 1.0 / FINER as f64;
        let ray = Ray { origin: voxel(edge.node.map(|v| v as f64)), direction };
        let wanted = if inside { Crossing::Out } else { Crossing::In };
        // where rounding hides the crossing, it is at one end
        let mut at = if inside == (self.level.spline().value(ray.at(0.5)) >= self.level.iso()) { 1.0 } else { 0.0 };
        self.level.crossings(&ray, [0.0, 1.0], |t, crossing| {
            if crossing == wanted {
                at = t;
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        let p = ray.at(at.clamp(CLEAR, 1.0 - CLEAR));
        (self.frame.place(p), self.frame.normal(self.level.spline().gradient(p)))
    }

    fn border(&self, p: DVec3, outward: DVec3) -> (DVec3, Vec3) {
        (self.frame.place(voxel(p.to_array())), self.frame.normal(-outward))
    }

    fn middle(&self, node: [i64; 3], ring: &[(DVec3, Vec3)]) -> (DVec3, Vec3) {
        let low = voxel(node.map(|v| v as f64));
        self.frame.middle(self.level.spline(), self.level.iso(), [low, low + 1.0 / FINER as f64], ring)
    }

    fn joined(&self, node: [usize; 3], axis: usize) -> bool {
        let mut p = node.map(|v| v as f64 + 0.5);
        p[axis] -= 0.5;
        self.level.spline().value(voxel(p)) >= self.level.iso()
    }

    fn mirrors(&self) -> bool {
        self.frame.mirrors
    }
}

/// What a refinement did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RefineReport {
    pub levels: u32,
    /// Edges that are still farther from the surface than the tolerance.
    pub left: usize,
    /// The farthest of them, in voxels.
    pub worst: f64,
}

/// Edges worked off together.
const BATCH: usize = 4096;

/// What becomes of an edge.
#[derive(Clone, Copy)]
enum Cut {
    /// Its middle is near enough.
    No,
    /// Its middle is this far away, but there is no good place for a vertex.
    Stuck(f64),
    At(DVec3, Vec3),
}

/// Cuts edges until the middle of each is within `tolerance` voxels of the spline's surface, at most `levels` times.
pub fn refine(
    level: &Level<'_>,
    world_from_voxel: &DAffine3,
    contour: &mut Contour,
    tolerance: f64,
    levels: u32,
) -> RefineReport {
    let frame = Frame::new(world_from_voxel);
    let voxel_from_world = world_from_voxel.inverse();
    let (spline, iso) = (level.spline(), level.iso());
    let dims = DVec3::from(spline.dims().map(|n| n as f64));
    let mut report = RefineReport::default();
    loop {
        let Contour { mesh, normals } = &*contour;
        let topology = Topology::build(mesh.positions.len(), &mesh.triangles);
        let count = topology.edge_vertices.len();
        let judge = |e: usize| -> Cut {
            let [a, b] = topology.edge_vertices[e].map(|v| v.0 as usize);
            let ends = [a, b].map(|v| voxel_from_world.transform_point3(mesh.positions[v]));
            // what closes the surface along the border is flat
            if ends.iter().any(|p| p.cmplt(DVec3::ZERO).any() || p.cmpgt(dims - 1.0).any()) {
                return Cut::No;
            }
            let middle = 0.5 * (ends[0] + ends[1]);
            let (value, gradient) = spline.value_and_gradient(middle);
            let far = (value - iso).abs() / gradient.length().max(f64::MIN_POSITIVE);
            let reach = 0.5 * ends[0].distance(ends[1]);
            if far <= tolerance || reach <= tolerance {
                return Cut::No;
            }
            let outward = voxel_from_world.transform_vector3((normals[a] + normals[b]).as_dvec3());
            let Some(direction) = outward.try_normalize() else { return Cut::Stuck(far.min(reach)) };
            let ray = Ray { origin: middle, direction };
            let mut nearest = f64::INFINITY;
            level.crossings(&ray, [-reach, reach], |t, crossing| {
                if crossing == Crossing::Out && t.abs() < nearest.abs() {
                    nearest = t;
                }
                ControlFlow::Continue(())
            });
            if nearest.abs() <= tolerance {
                return Cut::No;
            }
            if !nearest.is_finite() {
                return Cut::Stuck(far.min(reach));
            }
            let p = ray.at(nearest);
            let place = frame.place(p);
            let turns = topology.edge_triangles[e].iter().any(|&t| turns_over(mesh, t, [a as u32, b as u32], place));
            if turns { Cut::Stuck(nearest.abs()) } else { Cut::At(place, frame.normal(spline.gradient(p))) }
        };
        let cuts: Vec<Cut> = parallel::map(count.div_ceil(BATCH), &|b| {
            (b * BATCH..((b + 1) * BATCH).min(count)).map(judge).collect::<Vec<_>>()
        })
        .concat();
        if report.levels == levels || !cuts.iter().any(|c| matches!(c, Cut::At(..))) {
            for cut in &cuts {
                match cut {
                    Cut::No => {}
                    Cut::Stuck(far) => {
                        report.left += 1;
                        report.worst = report.worst.max(*far);
                    }
                    Cut::At(..) => report.left += 1,
                }
            }
            return report;
        }
        report.levels += 1;
        let mut vertex = vec![Topology::NONE; count];
        for (slot, cut) in vertex.iter_mut().zip(&cuts) {
            if let Cut::At(p, normal) = cut {
                *slot = contour.mesh.positions.len() as u32;
                contour.mesh.positions.push(*p);
                contour.normals.push(*normal);
            }
        }
        let positions = &contour.mesh.positions;
        let mut triangles = Vec::with_capacity(2 * contour.mesh.triangles.len());
        for (t, edges) in contour.mesh.triangles.iter().zip(&topology.triangle_edges) {
            split(*t, edges.map(|e| vertex[e.0 as usize]), positions, &mut triangles);
        }
        contour.mesh.triangles = triangles;
    }
}

/// Whether one of the halves of a triangle would face away from it if the middle of an edge went to `p`.
fn turns_over(mesh: &TriMesh, t: u32, edge: [u32; 2], p: DVec3) -> bool {
    let Some(corners) = mesh.triangles.get(t as usize) else { return false };
    let at = |v: u32| mesh.positions[v as usize];
    let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
    let whole = normal(corners.map(at));
    edge.iter().any(|&moved| {
        let half = normal(corners.map(|v| if v == moved { p } else { at(v) }));
        half.dot(whole) <= 0.1 * half.length() * whole.length()
    })
}

/// The pieces of a triangle; `cut[c]` is the vertex between corners c and c + 1, if there is one.
fn split(t: [u32; 3], cut: [u32; 3], positions: &[DVec3], out: &mut Vec<[u32; 3]>) {
    const NONE: u32 = Topology::NONE;
    let count = cut.iter().filter(|&&c| c != NONE).count();
    let distance = |a: u32, b: u32| positions[a as usize].distance_squared(positions[b as usize]);
    match count {
        0 => out.push(t),
        1 => {
            let c = cut.iter().position(|&c| c != NONE).unwrap_or(0);
            let (a, b, d, m) = (t[c], t[(c + 1) % 3], t[(c + 2) % 3], cut[c]);
            out.extend([[a, m, d], [m, b, d]]);
        }
        2 => {
            // turned so that the edge opposite to corner a is the whole one
            let c = (cut.iter().position(|&c| c == NONE).unwrap_or(0) + 2) % 3;
            let (a, b, d) = (t[c], t[(c + 1) % 3], t[(c + 2) % 3]);
            let (ab, da) = (cut[c], cut[(c + 2) % 3]);
            out.push([a, ab, da]);
            if distance(ab, d) <= distance(b, da) {
                out.extend([[ab, b, d], [ab, d, da]]);
            } else {
                out.extend([[ab, b, da], [b, d, da]]);
            }
        }
        _ => {
            let [ab, bc, ca] = cut;
            out.extend([[t[0], ab, ca], [ab, t[1], bc], [ca, bc, t[2]], [ab, bc, ca]]);
        }
    }
}

//! One tetrahedral mesh of the inside of a surface at a given lattice spacing: stuffed, or of whole lattice tetrahedra.
//!
//! For theory see [`super::stuffing`].

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use glam::DVec3;
use rayon::prelude::*;

use super::bcc::Bcc;
use super::bvh::Aabb;
use super::exact::{degenerate, segment_meets_triangle, side, triangles_meet};
use super::locate::Locator;
use super::stencils::{LatticeTet, Side};
use super::tets::{FACES, TetMesh, signed_volume};

/// How near to a lattice point, as a part of the edge, a cut point takes it to the surface. This pair makes the
/// smallest angle of all stencils as large as can be (searched numerically); the angles are then between 10.78 and
/// 164.75 degrees, the bounds of the paper.
const ALPHA_LONG: f64 = 0.28512;
const ALPHA_SHORT: f64 = 0.3987;

/// Halvings of an edge on which no crossing was found, though its ends are on different sides.
const HALVINGS: usize = 50;

/// Where an edge of the lattice goes through the surface.
struct Crossing {
    ends: [u32; 2],
    /// From the first end to the second.
    at: f64,
    long: bool,
}

/// The stuffed mesh (Labelle and Shewchuk 2007, section 3).
pub(super) fn stuffed(surface: &Locator, lattice: &Bcc) -> TetMesh {
    let inside = points_inside(surface, lattice);
    let layers = 0..lattice.cells[2];
    let crossings: Vec<Crossing> = (layers.clone().into_par_iter())
        .flat_map_iter(|k| {
            let mut found = Vec::new();
            lattice.edges_of_layer(k, |a, b, long| {
                if inside[a as usize] != inside[b as usize] {
                    let at = surface.crossing(lattice.position(a), lattice.position(b));
                    found.push(Crossing { ends: [a, b], at, long });
                }
            });
            found
        })
        .collect();

    // lattice points go to the nearest of the cut points that are too near
    let mut snapped: HashMap<u32, (f64, DVec3)> = HashMap::new();
    for c in &crossings {
        let [a, b] = c.ends.map(|p| lattice.position(p));
        let alpha = if c.long { ALPHA_LONG } else { ALPHA_SHORT };
        let cut = a.lerp(b, c.at);
        for (end, part) in [(c.ends[0], c.at), (c.ends[1], 1.0 - c.at)] {
            if part < alpha {
                let near = (part * a.distance(b), cut);
                match snapped.entry(end) {
                    Entry::Vacant(place) => drop(place.insert(near)),
                    Entry::Occupied(mut place) if near.0 < place.get().0 => drop(place.insert(near)),
                    Entry::Occupied(_) => {}
                }
            }
        }
    }

    let mut points: Vec<DVec3> = Vec::new();
    let mut cuts: HashMap<[u32; 2], u32> = HashMap::new();
    for c in &crossings {
        if !c.ends.iter().any(|e| snapped.contains_key(e)) {
            cuts.insert(c.ends, points.len() as u32);
            points.push(lattice.position(c.ends[0]).lerp(lattice.position(c.ends[1]), c.at));
        }
    }
    let mut ids = vec![u32::MAX; lattice.point_count()];
    let side_of = |p: u32| match (snapped.contains_key(&p), inside[p as usize]) {
        (true, _) => Side::On,
        (_, true) => Side::Inside,
        _ => Side::Outside,
    };
    let mut tets = Vec::new();
    for k in layers {
        lattice.tets_of_layer(k, |t| {
            let sides = t.map(side_of);
            if !sides.contains(&Side::Inside) {
                return;
            }
            for corner in (0..4).filter(|&c| sides[c] != Side::Outside).map(|c| t[c]) {
                if ids[corner as usize] == u32::MAX {
                    ids[corner as usize] = points.len() as u32;
                    points.push(snapped.get(&corner).map_or_else(|| lattice.position(corner), |s| s.1));
                }
            }
            let tet = LatticeTet { sides, halves: t.map(|p| lattice.halves(p)), points: t.map(|p| ids[p as usize]) };
            let cut = |i: usize, j: usize| match cuts.get(&[t[i], t[j]]) {
                Some(&id) => id,
                None => cuts[&[t[j], t[i]]],
            };
            tet.fill(cut, |p| points[p as usize], |t| tets.push(t));
        });
    }
    for t in &mut tets {
        if signed_volume(TetMesh::corners(*t, &points)) < 0.0 {
            t.swap(2, 3);
        }
    }
    // cut points of edges that lie in no tetrahedron are left out
    with_used_points(tets, points.len(), |p| points[p as usize])
}

/// All lattice tetrahedra that share a point with the surface or its inside: those with a corner inside, and those that
/// a triangle touches. What is left has no corner inside and does not meet the surface, so it lies outside.
pub(super) fn enclosing(surface: &Locator, lattice: &Bcc) -> TetMesh {
    let inside = points_inside(surface, lattice);
    let tets = (0..lattice.cells[2]).into_par_iter().flat_map_iter(|k| {
        let mut kept = Vec::new();
        lattice.tets_of_layer(k, |t| {
            if t.iter().any(|&p| inside[p as usize]) || surface.touches(t.map(|p| lattice.position(p))) {
                kept.push(t);
            }
        });
        kept
    });
    with_used_points(tets.collect(), lattice.point_count(), |p| lattice.position(p))
}

fn points_inside(surface: &Locator, lattice: &Bcc) -> Vec<bool> {
    (0..lattice.point_count() as u32).into_par_iter().map(|p| surface.contains(lattice.position(p))).collect()
}

/// The mesh of tetrahedra that name some of many points.
fn with_used_points(mut tets: Vec<[u32; 4]>, count: usize, position: impl Fn(u32) -> DVec3) -> TetMesh {
    let mut ids = vec![u32::MAX; count];
    let mut points = Vec::new();
    for corner in tets.iter_mut().flatten() {
        let id = &mut ids[*corner as usize];
        if *id == u32::MAX {
            *id = points.len() as u32;
            points.push(position(*corner));
        }
        *corner = *id;
    }
    TetMesh::new(points, tets)
}

impl Locator<'_> {
    /// Where the segment goes through the mesh, from 0 at `p` to 1 at `q`, which lie on different sides of it: of
    /// several crossings the middle one.
    fn crossing(&self, p: DVec3, q: DVec3) -> f64 {
        let mut found = Vec::new();
        self.tree.overlapping(&Aabb::around(&[p, q]), |t| {
            let corners = self.triangle(t);
            let (from, to) = (side(corners, p), side(corners, q));
            // a segment in the triangle's plane meets its neighbours as well
            if from != to && !degenerate(corners) && segment_meets_triangle([p, q], corners) {
                found.push((from / (from - to)).clamp(0.0, 1.0));
            }
        });
        if !found.is_empty() {
            found.sort_unstable_by(f64::total_cmp);
            return found[found.len() / 2];
        }
        let start = self.contains(p);
        let (mut before, mut behind) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = (before + behind) / 2.0;
            if self.contains(p.lerp(q, middle)) == start {
                before = middle;
            } else {
                behind = middle;
            }
        }
        (before + behind) / 2.0
    }

    /// Whether a triangle shares a point with the positive tetrahedron. For triangles without area their boxes decide.
    fn touches(&self, tet: [DVec3; 4]) -> bool {
        let mut hit = false;
        self.tree.overlapping(&Aabb::around(&tet), |t| {
            if hit {
                return;
            }
            let triangle = self.triangle(t);
            let faces = FACES.map(|f| f.map(|c| tet[c]));
            // positive on the outer side
            let outside = faces.map(|f| triangle.map(|p| side(f, p) > 0.0));
            hit = if outside.iter().any(|o| o.iter().all(|&o| o)) {
                false
            } else if degenerate(triangle) || (0..3).any(|c| outside.iter().all(|o| !o[c])) {
                true
            } else {
                faces.iter().any(|&f| triangles_meet(f, triangle))
            };
        });
        hit
    }

    fn triangle(&self, t: u32) -> [DVec3; 3] {
        self.mesh.triangles[t as usize].map(|v| self.mesh.positions[v as usize])
    }
}

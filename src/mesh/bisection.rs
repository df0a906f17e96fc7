//! Refinement of a lattice of boxes of six tetrahedra by bisection, without hanging points.
//!
//! # Theory (Maubach 1995)
//!
//! A tetrahedron is an ordered list v0 v1 v2 v3 with a tag k from 3 to 1. It is cut in the middle z of its edge v0 vk,
//! into v0 .. vk-1 z vk+1 .. and v1 .. vk z vk+1 .., both with the tag k - 1 (3 after 1). After three cuts there are
//! eight of half the size; only three shapes ever appear. In a lattice in which all boxes are cut along the paths from
//! their lowest to their highest corner, neighbours agree: two tetrahedra at the same face cut it in the same way, or
//! the coarser of them does after some cuts of its own. So cutting, again and again, every tetrahedron that has a point
//! in the middle of an edge comes to an end.
//!
//! # Practice
//!
//! Points are in units of boxes, where all halves are exact. Tetrahedra keep their place in the list when they are cut:
//! one half takes it, the other goes to the end.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use super::tet_lattice::{SIX, point_id};

/// A tetrahedron with its state; its sign means nothing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tagged {
    pub corners: [u32; 4],
    tag: u8,
    /// How often it was cut.
    pub level: u8,
}

#[derive(Debug, Clone)]
pub(super) struct Bisection {
    /// In units of boxes.
    pub points: Vec<DVec3>,
    pub tets: Vec<Tagged>,
}

/// What happens during one refinement.
struct Cuts {
    middles: HashMap<[u32; 2], u32>,
    /// Ends of edges that were cut: a quick answer for most tetrahedra.
    ends: Vec<bool>,
}

impl Bisection {
    pub fn new(cells: [usize; 3]) -> Self {
        let [nx, ny, nz] = cells;
        let along = |n: usize| 0..=n;
        let points = along(nz).flat_map(|k| {
            along(ny).flat_map(move |j| along(nx).map(move |i| DVec3::new(i as f64, j as f64, k as f64)))
        });
        let boxes = (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])));
        let tets = boxes.flat_map(|[i, j, k]| {
            let corner = move |c: usize| point_id(cells, [i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)]);
            SIX.iter().map(move |path| Tagged { corners: path.map(corner), tag: 3, level: 0 })
        });
        Self { points: points.collect(), tets: tets.collect() }
    }

    /// Cuts the marked tetrahedra, each named once, and whatever it takes to have no point within an edge. The places
    /// of all tetrahedra that are new, in order; `None`, and nothing is changed, if there would be more than `most` in
    /// all.
    pub fn refine(&mut self, marked: &[u32], most: usize) -> Option<Vec<u32>> {
        let (tets, points) = (self.tets.clone(), self.points.len());
        let mut cuts = Cuts { middles: HashMap::new(), ends: vec![false; points] };
        let mut new = Vec::new();
        let mut queue = marked.to_vec();
        while !queue.is_empty() {
            while let Some(place) = queue.pop() {
                let other = self.tets.len() as u32;
                self.cut(place, &mut cuts);
                if self.tets.len() > most {
                    self.tets = tets;
                    self.points.truncate(points);
                    return None;
                }
                new.extend([place, other]);
                queue.extend([place, other].into_iter().filter(|&p| self.hangs(p, &cuts)));
            }
            queue = (0..self.tets.len() as u32).into_par_iter().filter(|&p| self.hangs(p, &cuts)).collect();
        }
        new.sort_unstable();
        new.dedup();
        Some(new)
    }

    fn cut(&mut self, place: u32, cuts: &mut Cuts) {
        let Tagged { corners: v, tag, level } = self.tets[place as usize];
        let last = tag as usize;
        let (a, b) = (v[0], v[last]);
        let middle = *cuts.middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
            let z = (self.points[a as usize] + self.points[b as usize]) / 2.0;
            self.points.push(z);
            cuts.ends.push(false);
            self.points.len() as u32 - 1
        });
        cuts.ends[a as usize] = true;
        cuts.ends[b as usize] = true;
        let (mut one, mut other) = (v, v);
        one[last] = middle;
        other[..last].copy_from_slice(&v[1..=last]);
        other[last] = middle;
        let tag = if tag == 1 { 3 } else { tag - 1 };
        self.tets[place as usize] = Tagged { corners: one, tag, level: level + 1 };
        self.tets.push(Tagged { corners: other, tag, level: level + 1 });
    }

    /// Whether an edge of the tetrahedron was cut.
    fn hangs(&self, place: u32, cuts: &Cuts) -> bool {
        let v = self.tets[place as usize].corners;
        let ends = v.map(|p| cuts.ends[p as usize]);
        (0..4)
            .any(|i| (0..i).any(|j| ends[i] && ends[j] && cuts.middles.contains_key(&[v[i].min(v[j]), v[i].max(v[j])])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::tet_faces::TetFaces;
    use crate::mesh::tets::signed_volume;
    use std::collections::HashSet;

    /// Conforming, filling the boxes, without a point within an edge or a face.
    fn check(mesh: &Bisection, cells: [usize; 3]) {
        let volumes = mesh.tets.iter().map(|t| signed_volume(t.corners.map(|v| mesh.points[v as usize])).abs());
        let whole: f64 = cells.iter().product::<usize>() as f64;
        assert!((volumes.sum::<f64>() - whole).abs() < 1e-12 * whole);
        let corners: Vec<[u32; 4]> = mesh.tets.iter().map(|t| t.corners).collect();
        let faces = TetFaces::of(&corners);
        assert_eq!(faces.crowded, 0);
        // all faces without a partner lie in an outer side
        for f in &faces.boundary {
            let p = f.map(|v| mesh.points[v as usize]);
            let on = |a: usize, x: f64| p.iter().all(|q| q[a] == x);
            assert!((0..3).any(|a| on(a, 0.0) || on(a, cells[a] as f64)), "{p:?}");
        }
    }

    #[test]
    fn refinement_about_a_point_stays_conforming_and_local() {
        let cells = [2, 3, 1];
        let mut mesh = Bisection::new(cells);
        check(&mesh, cells);
        let target = DVec3::new(0.77, 1.31, 0.42);
        for round in 0..24 {
            let holds = |t: &u32| {
                let p = mesh.tets[*t as usize].corners.map(|v| mesh.points[v as usize]);
                let part = |c: usize| signed_volume(std::array::from_fn(|i| if i == c { target } else { p[i] }));
                (0..4).all(|c| part(c) / signed_volume(p) >= 0.0)
            };
            let around = (0..mesh.tets.len() as u32).find(holds);
            let before = mesh.tets.len();
            let new = mesh.refine(&[around.unwrap()], usize::MAX).unwrap();
            assert!(new.len() >= 2 && mesh.tets.len() > before && mesh.tets.len() < before + 400, "round {round}");
            check(&mesh, cells);
        }
        // a conforming refinement of the same depth everywhere would have 36 * 2^24
        assert!(mesh.tets.iter().any(|t| t.level == 24) && mesh.tets.len() < 5000, "{}", mesh.tets.len());
    }

    #[test]
    fn there_are_three_shapes_at_any_depth() {
        let mut mesh = Bisection::new([1, 1, 1]);
        let mut shapes = HashSet::new();
        for _ in 0..9 {
            let all: Vec<u32> = (0..mesh.tets.len() as u32).collect();
            mesh.refine(&all, usize::MAX).unwrap();
            for t in &mesh.tets {
                let p = t.corners.map(|v| mesh.points[v as usize]);
                let mut edges: Vec<u64> = Vec::new();
                for i in 0..4 {
                    for j in 0..i {
                        // in units in which the longest edges are the same every three levels
                        edges.push((p[i].distance_squared(p[j]) * 4f64.powi(i32::from(t.level) / 3) * 16.0) as u64);
                    }
                }
                edges.sort_unstable();
                shapes.insert(edges);
            }
        }
        check(&mesh, [1, 1, 1]);
        assert_eq!((mesh.tets.len(), shapes.len()), (6 << 9, 3));
    }

    #[test]
    fn a_limit_leaves_everything_as_it_was() {
        let mut mesh = Bisection::new([2, 2, 2]);
        let (tets, points) = (mesh.tets.len(), mesh.points.len());
        assert!(mesh.refine(&[0, 1, 2], tets + 1).is_none());
        assert_eq!((mesh.tets.len(), mesh.points.len()), (tets, points));
        check(&mesh, [2, 2, 2]);
    }
}

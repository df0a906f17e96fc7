//! One level of refinement: first all of its edges, then all triangles.

use std::ops::Range;

use glam::{DMat3, DVec3};

use super::refine::{Edge, Face, NONE};
use super::{Refiner, Rule, Supports};
use crate::math::{BLOCK, BackwardMap, Block, BlockMap, JacobianBlock};

/// For a quadratic map the error inside a triangle is at most 4/3 of the largest at its edges' midpoints.
const INSIDE: f64 = 0.75;

impl Refiner {
    /// Splits those of the edges for which the rule says so; their halves are decided upon at the next level.
    pub(super) fn split_edges<M: BlockMap<f64> + ?Sized>(
        &mut self,
        edges: Range<usize>,
        map: &M,
        supports: &Supports,
        rule: &Rule,
    ) {
        self.asked.clear();
        for i in edges {
            let [p, q] = self.ends(i);
            let length = p.distance(q);
            // not so for NaN
            if length > 0.0 && supports.wants_split(p, q, rule.features) && length > rule.smallest.at(0.5 * (p + q)) {
                if rule.tolerance.is_some() {
                    self.asked.push(i as u32);
                } else {
                    self.split_edge(i);
                }
            }
        }
        let Some(tolerance) = rule.tolerance else { return };
        let (mut block, mut jacobian) = (Block::<f64>::default(), JacobianBlock::<f64>::default());
        let asked = std::mem::take(&mut self.asked);
        for chunk in asked.chunks(BLOCK) {
            for k in 0..BLOCK {
                // the rest of the last block repeats an edge
                let [p, q] = self.ends(chunk[k.min(chunk.len() - 1)] as usize);
                let mid = 0.5 * (p + q) - map.center();
                (block.x[k], block.y[k], block.z[k]) = (mid.x, mid.y, mid.z);
            }
            map.backward_block_with_jacobian(&mut block, &mut jacobian);
            for (k, &edge) in chunk.iter().enumerate() {
                let image = map.center() + DVec3::new(block.x[k], block.y[k], block.z[k]);
                if !self.within(edge as usize, image, supports, rule, INSIDE * tolerance) {
                    self.split_edge(edge as usize);
                    let derivative = DMat3::from_cols_array(&std::array::from_fn(|e| jacobian.entry[e][k]));
                    self.images.push((image, derivative));
                }
            }
        }
        self.asked = asked;
    }

    /// Whether the map may be interpolated along an edge at whose middle it has the value `image`.
    fn within(&self, i: usize, image: DVec3, supports: &Supports, rule: &Rule, error: f64) -> bool {
        let [p, q] = self.ends(i);
        let Edge { a, b, .. } = self.edges[i];
        let [(at_a, slope_a), (at_b, slope_b)] = [self.images[a as usize], self.images[b as usize]];
        let off = |v: DVec3| (rule.voxel_from_world * v).length();
        // a flat middle may hide a double bend; the slopes at the ends tell: a quarter of their difference from the chord is
        // the error of a quadratic
        let (along, chord) = (q - p, at_b - at_a);
        (along.length() <= supports.feature() || !supports.wants_split(p, q, 1.0))
            && off(image - 0.5 * (at_a + at_b)) <= error
            && off(slope_a * along - chord) <= 4.0 * error
            && off(slope_b * along - chord) <= 4.0 * error
    }

    fn ends(&self, edge: usize) -> [DVec3; 2] {
        let Edge { a, b, .. } = self.edges[edge];
        [self.positions[a as usize], self.positions[b as usize]]
    }

    /// Gives the edge a vertex in its middle and two halves.
    fn split_edge(&mut self, i: usize) {
        let Edge { a, b, .. } = self.edges[i];
        let [p, q] = self.ends(i);
        let m = self.positions.len() as u32;
        self.positions.push(0.5 * (p + q));
        let child = self.edges.len() as u32;
        self.edges.push(Edge { a, b: m, mid: NONE, child: NONE });
        self.edges.push(Edge { a: m, b, mid: NONE, child: NONE });
        (self.edges[i].mid, self.edges[i].child) = (m, child);
    }

    /// Replaces every face by its parts; those that no edge splits are done.
    pub(super) fn split_faces<M: BackwardMap + ?Sized>(&mut self, map: &M, supports: &Supports, rule: &Rule) {
        self.next.clear();
        for n in 0..self.faces.len() {
            let face = self.faces[n];
            let mids = face.e.map(|e| self.edges[e as usize].mid);
            match mids.map(|m| m != NONE) {
                [true, true, true] => {
                    let Face { v, .. } = face;
                    let [h0, h1, h2] = [0, 1, 2].map(|i| self.halves(face.e[i], v[i]));
                    let [m0, m1, m2] = mids;
                    let (i0, i1, i2) = (self.inner(m2, m0), self.inner(m0, m1), self.inner(m1, m2));
                    self.next.extend([
                        Face { v: [v[0], m0, m2], e: [h0[0], i0, h2[1]] },
                        Face { v: [m0, v[1], m1], e: [h0[1], h1[0], i1] },
                        Face { v: [m2, m1, v[2]], e: [i2, h1[1], h2[0]] },
                        Face { v: [m0, m1, m2], e: [i1, i2, i0] },
                    ]);
                }
                [false, false, false] => {
                    let corners = face.v.map(|i| self.positions[i as usize]);
                    if supports.hidden_in_triangle(corners, rule.features) {
                        let [a, b, c] = corners;
                        let centroid = (a + b + c) / 3.0;
                        let size = a.distance(b).max(b.distance(c)).max(c.distance(a));
                        if size > rule.smallest.at(centroid) {
                            self.split_at_centroid(face, centroid, map, rule);
                            continue;
                        }
                    }
                    self.triangles.push(face.v);
                }
                [true, false, false] => self.split_one(face, 0),
                [false, true, false] => self.split_one(face, 1),
                [false, false, true] => self.split_one(face, 2),
                [true, true, false] => self.split_two(face, 0),
                [false, true, true] => self.split_two(face, 1),
                [true, false, true] => self.split_two(face, 2),
            }
        }
        std::mem::swap(&mut self.faces, &mut self.next);
    }

    /// Edge `i` of the face is split.
    fn split_one(&mut self, face: Face, i: usize) {
        let (v, e) = (turned(face.v, i), turned(face.e, i));
        let m = self.edges[e[0] as usize].mid;
        let h = self.halves(e[0], v[0]);
        let cut = self.inner(m, v[2]);
        self.next.extend([
            Face { v: [v[0], m, v[2]], e: [h[0], cut, e[2]] },
            Face { v: [m, v[1], v[2]], e: [h[1], e[1], cut] },
        ]);
    }

    /// Edges `i` and `i + 1` of the face are split. The quadrangle that is left is cut along its shorter diagonal.
    fn split_two(&mut self, face: Face, i: usize) {
        let (v, e) = (turned(face.v, i), turned(face.e, i));
        let (m0, m1) = (self.edges[e[0] as usize].mid, self.edges[e[1] as usize].mid);
        let (h0, h1) = (self.halves(e[0], v[0]), self.halves(e[1], v[1]));
        let across = self.inner(m0, m1);
        self.next.push(Face { v: [m0, v[1], m1], e: [h0[1], h1[0], across] });
        let at = |i: u32| self.positions[i as usize];
        if at(v[0]).distance_squared(at(m1)) <= at(m0).distance_squared(at(v[2])) {
            let cut = self.inner(v[0], m1);
            self.next.extend([
                Face { v: [v[0], m0, m1], e: [h0[0], across, cut] },
                Face { v: [v[0], m1, v[2]], e: [cut, h1[1], e[2]] },
            ]);
        } else {
            let cut = self.inner(m0, v[2]);
            self.next.extend([
                Face { v: [v[0], m0, v[2]], e: [h0[0], cut, e[2]] },
                Face { v: [m0, m1, v[2]], e: [across, h1[1], cut] },
            ]);
        }
    }

    /// A displaced region that no side touches: its edges to the centroid will.
    fn split_at_centroid<M: BackwardMap + ?Sized>(&mut self, face: Face, p: DVec3, map: &M, rule: &Rule) {
        let Face { v, e } = face;
        let m = self.positions.len() as u32;
        self.positions.push(p);
        if rule.tolerance.is_some() {
            self.images.push(map.backward_with_jacobian(p));
        }
        let spokes = v.map(|i| self.inner(i, m));
        for i in 0..3 {
            let j = (i + 1) % 3;
            self.next.push(Face { v: [v[i], v[j], m], e: [e[i], spokes[j], spokes[i]] });
        }
    }

    /// The halves of a split edge, the one at vertex `from` first.
    fn halves(&self, edge: u32, from: u32) -> [u32; 2] {
        let Edge { a, child, .. } = self.edges[edge as usize];
        if a == from { [child, child + 1] } else { [child + 1, child] }
    }

    /// A new edge within a face.
    fn inner(&mut self, a: u32, b: u32) -> u32 {
        self.edges.push(Edge { a, b, mid: NONE, child: NONE });
        (self.edges.len() - 1) as u32
    }
}

/// Rotated so that element `i` comes first.
fn turned(t: [u32; 3], i: usize) -> [u32; 3] {
    [t[i], t[(i + 1) % 3], t[(i + 2) % 3]]
}

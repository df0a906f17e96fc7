use glam::{DAffine3, DMat3, DVec3};

use super::Supports;
use super::edges::EdgeTable;
use super::pattern::{self, Pattern};
use crate::math::BackwardMap;

/// When an edge of the slice's triangles is split.
#[derive(Clone, Copy)]
pub struct Rule<'a> {
    /// How often a triangle is split at most. Without a tolerance every displaced edge is split as often as this.
    pub depth: u32,
    /// The largest error of the interpolated backward map that may stay, in voxels.
    pub tolerance: Option<f64>,
    /// Voxels per world unit along the axes of the volume: `size * texture_from_world`. Only the tolerance uses it.
    pub voxel_from_world: DMat3,
    /// Edges that are not longer than this in world units stay whole; a function of the edge's midpoint, for perspective.
    pub smallest: Smallest<'a>,
}

/// The length of edges that stay whole.
#[derive(Clone, Copy)]
pub enum Smallest<'a> {
    /// Everywhere the same, in world units; 0 for no such limit.
    Length(f64),
    /// By the place of an edge's midpoint: so many world units.
    At(&'a (dyn Fn(DVec3) -> f64 + Sync)),
}

impl Smallest<'_> {
    fn at(&self, p: DVec3) -> f64 {
        match self {
            Self::Length(l) => *l,
            Self::At(f) => f(p),
        }
    }
}

impl Rule<'_> {
    /// Every displaced edge is split `depth` times.
    pub fn uniform(depth: u32) -> Self {
        Self { depth, tolerance: None, voxel_from_world: DMat3::IDENTITY, smallest: Smallest::Length(0.0) }
    }

    /// Edges are split until the error is below `tolerance` voxels, `depth` times at most.
    pub fn within(tolerance: f64, depth: u32, texture_from_world: &DAffine3, size: DVec3) -> Self {
        let voxel_from_world = DMat3::from_diagonal(size) * texture_from_world.matrix3;
        Self { depth, tolerance: Some(tolerance), voxel_from_world, smallest: Smallest::Length(0.0) }
    }
}

/// For a quadratic map the error inside a triangle is at most 4/3 of the largest at its edges' midpoints.
const INSIDE: f64 = 0.75;

const NONE: u32 = u32::MAX;

#[derive(Debug, Clone, Copy)]
struct Edge {
    a: u32,
    b: u32,
    /// Vertex in the middle, or `NONE`. While patterns are laid, the first of all vertices between the ends.
    mid: u32,
    /// The edge a-mid; mid-b is the next. Only if there is a middle.
    child: u32,
}

#[derive(Debug, Clone, Copy)]
struct Face {
    v: [u32; 3],
    /// Edge i runs between v\[i\] and v\[i + 1\].
    e: [u32; 3],
}

/// Refines the triangles of one slice at a time. Buffers are kept, so that later slices need no memory.
#[derive(Debug, Default)]
pub struct Refiner {
    positions: Vec<DVec3>,
    /// Backward image of each vertex, and the map's derivative there; only with a tolerance.
    images: Vec<(DVec3, DMat3)>,
    triangles: Vec<[u32; 3]>,
    edges: Vec<Edge>,
    faces: Vec<Face>,
    next: Vec<Face>,
    table: EdgeTable,
    /// By depth, made when first asked for.
    patterns: [Option<Pattern>; pattern::DEEPEST as usize + 1],
}

impl Refiner {
    /// World positions of the refined slice; those of the input come first, in their order.
    pub fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    /// The refined triangles, turned as those of the input.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Refines `triangles` (indices into `points`, world positions) where `map` displaces.
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn refine<M: BackwardMap + ?Sized>(
        &mut self,
        points: impl IntoIterator<Item = DVec3>,
        triangles: &[[u32; 3]],
        map: &M,
        supports: &Supports,
        rule: &Rule,
    ) {
        self.positions.clear();
        self.positions.extend(points);
        self.images.clear();
        self.triangles.clear();
        if supports.is_empty() || rule.depth == 0 {
            self.triangles.extend_from_slice(triangles);
            return;
        }
        self.connect(triangles);
        let mut fresh = 0;
        if rule.tolerance.is_none() && self.split_by_pattern(supports, rule) {
            fresh = self.edges.len();
        }
        if rule.tolerance.is_some() {
            self.images.extend(self.positions.iter().map(|p| map.backward_with_jacobian(*p)));
        }
        for _ in 0..rule.depth {
            let end = self.edges.len();
            for i in fresh..end {
                self.decide(i, map, supports, rule);
            }
            fresh = end;
            self.split_faces(map, supports, rule);
            if self.faces.is_empty() {
                break;
            }
        }
        self.triangles.extend(self.faces.iter().map(|f| f.v));
    }

    /// Numbers the edges.
    fn connect(&mut self, triangles: &[[u32; 3]]) {
        self.edges.clear();
        self.faces.clear();
        self.table.clear(triangles.len());
        for v in triangles {
            let e = std::array::from_fn(|i| {
                let (a, b) = (v[i], v[(i + 1) % 3]);
                let (edge, new) = self.table.find_or_insert(a, b, self.edges.len() as u32);
                if new {
                    self.edges.push(Edge { a, b, mid: NONE, child: NONE });
                }
                edge
            });
            self.faces.push(Face { v: *v, e });
        }
    }

    /// Splits every displaced edge into all its parts at once, and the triangles all of whose edges are displaced by a pattern.
    /// What is left are triangles with displaced and undisplaced edges; those go through the levels. False, with nothing
    /// done, if that cannot be: the pattern would be too large, or some parts would be too small.
    fn split_by_pattern(&mut self, supports: &Supports, rule: &Rule) -> bool {
        if rule.depth > pattern::DEEPEST {
            return false;
        }
        let parts = 1_u32 << rule.depth;
        let limited = !matches!(rule.smallest, Smallest::Length(l) if l <= 0.0);
        for i in 0..self.edges.len() {
            let Edge { a, b, .. } = self.edges[i];
            let (p, q) = (self.positions[a as usize], self.positions[b as usize]);
            let length = p.distance(q);
            let splittable = length > 0.0;
            if !splittable || !supports.touches_segment(p, q) {
                continue;
            }
            if limited {
                let smallest = [p, 0.5 * (p + q), q].map(|x| rule.smallest.at(x)).into_iter().fold(0.0, f64::max);
                // the last split is of parts twice as long as those that are left
                if length * 2.0 / f64::from(parts) <= smallest {
                    self.edges.iter_mut().for_each(|e| e.mid = NONE);
                    return false;
                }
            }
            // marked; numbered below
            self.edges[i].mid = 0;
        }
        let pattern = self.patterns[rule.depth as usize].get_or_insert_with(|| Pattern::new(rule.depth));
        let between = parts - 1;
        let share = 1.0 / f64::from(parts);
        for edge in self.edges.iter_mut().filter(|e| e.mid != NONE) {
            let (p, q) = (self.positions[edge.a as usize], self.positions[edge.b as usize]);
            // the first of its points
            edge.mid = self.positions.len() as u32;
            self.positions.extend((1..parts).map(|s| {
                let t = f64::from(s) * share;
                p * (1.0 - t) + q * t
            }));
        }
        self.next.clear();
        let mut numbers = [0_u32; pattern::VERTICES];
        for face in &self.faces {
            let edges = face.e.map(|e| self.edges[e as usize]);
            if edges.iter().any(|e| e.mid == NONE) {
                self.next.push(*face);
                continue;
            }
            numbers[..3].copy_from_slice(&face.v);
            let (sides, inside) = numbers[3..].split_at_mut(3 * between as usize);
            for ((slots, edge), from) in sides.chunks_exact_mut(between as usize).zip(edges).zip(face.v) {
                if edge.a == from {
                    slots.iter_mut().zip(edge.mid..).for_each(|(slot, m)| *slot = m);
                } else {
                    slots.iter_mut().rev().zip(edge.mid..).for_each(|(slot, m)| *slot = m);
                }
            }
            let first = self.positions.len() as u32;
            let [a, b, c] = face.v.map(|i| self.positions[i as usize]);
            self.positions.extend(pattern.inside.iter().map(|w| a * w[0] + b * w[1] + c * w[2]));
            inside.iter_mut().zip(first..first + pattern.inside.len() as u32).for_each(|(slot, m)| *slot = m);
            let numbers = &numbers;
            self.triangles
                .extend(pattern.triangles.iter().map(|t| t.map(|i| numbers[i as usize & (pattern::VERTICES - 1)])));
        }
        std::mem::swap(&mut self.faces, &mut self.next);
        for n in 0..self.faces.len() {
            for e in self.faces[n].e {
                let Edge { mid, child, .. } = self.edges[e as usize];
                if mid != NONE && child == NONE {
                    self.halve(e, mid, between);
                }
            }
        }
        true
    }

    /// Makes the halves of an edge, and theirs, of `count` points that follow each other from `first` on.
    fn halve(&mut self, edge: u32, first: u32, count: u32) {
        let Edge { a, b, .. } = self.edges[edge as usize];
        let half = count / 2;
        let mid = first + half;
        let child = self.edges.len() as u32;
        self.edges.push(Edge { a, b: mid, mid: NONE, child: NONE });
        self.edges.push(Edge { a: mid, b, mid: NONE, child: NONE });
        (self.edges[edge as usize].mid, self.edges[edge as usize].child) = (mid, child);
        if half > 0 {
            self.halve(child, first, half);
            self.halve(child + 1, mid + 1, half);
        }
    }

    /// Splits edge `i` if the rule says so; its halves are decided upon at the next level.
    fn decide<M: BackwardMap + ?Sized>(&mut self, i: usize, map: &M, supports: &Supports, rule: &Rule) {
        let Edge { a, b, .. } = self.edges[i];
        let (p, q) = (self.positions[a as usize], self.positions[b as usize]);
        let mid = 0.5 * (p + q);
        let length = p.distance(q);
        // also for NaN
        let splittable = length > rule.smallest.at(mid) && length > 0.0;
        if !splittable || !supports.touches_segment(p, q) {
            return;
        }
        if let Some(tolerance) = rule.tolerance {
            let (ends, error) = (0.5 * (self.images[a as usize].0 + self.images[b as usize].0), INSIDE * tolerance);
            let image = map.backward_with_jacobian(mid);
            let off = |v: DVec3| (rule.voxel_from_world * v).length();
            let within = length <= supports.feature() && off(image.0 - ends) <= error && {
                // a flat middle may hide a double bend; the slopes at the ends tell: a quarter of their difference from the
                // chord is the error of a quadratic
                let chord = self.images[b as usize].0 - self.images[a as usize].0;
                let bend = |end: u32| off(self.images[end as usize].1 * (q - p) - chord);
                bend(a).max(bend(b)) <= 4.0 * error
            };
            if within {
                return;
            }
            self.images.push(image);
        }
        let m = self.positions.len() as u32;
        self.positions.push(mid);
        let child = self.edges.len() as u32;
        self.edges.push(Edge { a, b: m, mid: NONE, child: NONE });
        self.edges.push(Edge { a: m, b, mid: NONE, child: NONE });
        self.edges[i].mid = m;
        self.edges[i].child = child;
    }

    /// Replaces every face by its parts; those that no edge splits are done.
    fn split_faces<M: BackwardMap + ?Sized>(&mut self, map: &M, supports: &Supports, rule: &Rule) {
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
                    let [a, b, c] = corners;
                    let centroid = (a + b + c) / 3.0;
                    let size = a.distance(b).max(b.distance(c)).max(c.distance(a));
                    if supports.hidden_in_triangle(corners) && size > rule.smallest.at(centroid) {
                        self.split_at_centroid(face, centroid, map, rule);
                    } else {
                        self.triangles.push(face.v);
                    }
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

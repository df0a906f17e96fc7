//! Surface nets: the surface between the inside and the outside nodes of a lattice.
//!
//! # Theory
//!
//! Each lattice edge with one end inside gives a quadrilateral, whose corners are one vertex in each of the four cells
//! around the edge (Gibson 1998). Before any smoothing this is the hull of the unit cubes about the inside nodes. It is a
//! manifold exactly if the nodes are *well-composed* (Latecki 1997): nowhere do two inside cubes, or two outside ones, touch
//! only in an edge or a corner. [`Lattice::make_well_composed`] adds nodes until that holds.
//!
//! # Practice
//!
//! A vertex may move anywhere in its own cell. Then the quadrilateral of an edge stays in the 2 x 2 x 1 cells around it, at
//! most one cell away from the edge's outer node along each axis: this is what the containment proof in [`super::proxy`]
//! rests on. Two quadrilaterals never have the same diagonal, so cutting them keeps the mesh manifold.

use glam::DVec3;

/// Nodes of a lattice, x fastest. Those on its border must be outside.
pub(super) struct Lattice {
    pub dims: [usize; 3],
    pub inside: Vec<bool>,
}

/// The mesh between inside and outside.
pub(super) struct Net {
    /// The lower node of the cell of each vertex; the cell reaches to the next node along each axis.
    pub cells: Vec<[usize; 3]>,
    /// Anticlockwise from outside.
    pub quads: Vec<[u32; 4]>,
}

impl Lattice {
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.dims[0] * (y + self.dims[1] * z)
    }

    fn strides(&self) -> [usize; 3] {
        [1, self.dims[0], self.dims[0] * self.dims[1]]
    }

    fn node(&self, i: usize) -> [usize; 3] {
        [i % self.dims[0], i / self.dims[0] % self.dims[1], i / (self.dims[0] * self.dims[1])]
    }

    /// Adds nodes until no two inside nodes, and no two outside ones, touch in an edge or a corner only. What is added
    /// lies between inside nodes, so the box around them stays the same.
    pub fn make_well_composed(&mut self) {
        let s = self.strides();
        loop {
            let mut grown = false;
            for i in 0..self.inside.len() {
                let at = self.node(i);
                let room: [bool; 3] = std::array::from_fn(|a| at[a] + 1 < self.dims[a]);
                for (u, v) in [(0, 1), (1, 2), (2, 0)] {
                    if room[u] && room[v] {
                        let square = [i, i + s[u], i + s[v], i + s[u] + s[v]];
                        let [a, b, c, d] = square.map(|n| self.inside[n]);
                        if a == d && b == c && a != b {
                            self.inside[square[if a { 1 } else { 0 }]] = true;
                            grown = true;
                        }
                    }
                }
                if room == [true; 3] {
                    let corner = |c: usize| i + (c & 1) * s[0] + (c >> 1 & 1) * s[1] + (c >> 2) * s[2];
                    let count = (0..8).filter(|&c| self.inside[corner(c)]).count();
                    let opposite = (0..4).find(|&c| {
                        let pair = [self.inside[corner(c)], self.inside[corner(7 - c)]];
                        (count == 2 && pair == [true; 2]) || (count == 6 && pair == [false; 2])
                    });
                    if let Some(c) = opposite {
                        // fill one of the two holes, or a neighbour of one of the two cubes
                        self.inside[corner(if count == 6 { c } else { c ^ 1 })] = true;
                        grown = true;
                    }
                }
            }
            if !grown {
                return;
            }
        }
    }

    /// Makes everything inside that the border cannot be reached from.
    pub fn fill_cavities(&mut self) {
        let mut outside = vec![false; self.inside.len()];
        let mut stack = vec![0];
        outside[0] = true;
        let s = self.strides();
        while let Some(i) = stack.pop() {
            let at = self.node(i);
            for a in 0..3 {
                let below = (at[a] > 0).then(|| i - s[a]);
                let above = (at[a] + 1 < self.dims[a]).then(|| i + s[a]);
                for n in [below, above].into_iter().flatten() {
                    if !self.inside[n] && !outside[n] {
                        outside[n] = true;
                        stack.push(n);
                    }
                }
            }
        }
        self.inside.iter_mut().zip(&outside).for_each(|(inside, outside)| *inside = !outside);
    }

    /// Calls `found(node, axis)` for each lattice edge from `node` to the next along `axis` that leads through the surface.
    fn crossings(&self, mut found: impl FnMut([usize; 3], usize)) {
        let s = self.strides();
        for i in 0..self.inside.len() {
            let at = self.node(i);
            for axis in 0..3 {
                if at[axis] + 1 < self.dims[axis] && self.inside[i] != self.inside[i + s[axis]] {
                    found(at, axis);
                }
            }
        }
    }

    /// Number of quadrilaterals of [`Lattice::net`].
    pub fn quad_count(&self) -> usize {
        let mut n = 0;
        self.crossings(|_, _| n += 1);
        n
    }

    pub fn net(&self) -> Net {
        let mut vertex_of = vec![u32::MAX; self.inside.len()];
        let mut net = Net { cells: Vec::new(), quads: Vec::new() };
        self.crossings(|at, axis| {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut quad = [[1, 1], [0, 1], [0, 0], [1, 0]].map(|[du, dv]| {
                let mut cell = at;
                cell[u] -= du;
                cell[v] -= dv;
                let slot = &mut vertex_of[self.index(cell)];
                if *slot == u32::MAX {
                    *slot = net.cells.len() as u32;
                    net.cells.push(cell);
                }
                *slot
            });
            if !self.inside[self.index(at)] {
                quad.reverse();
            }
            net.quads.push(quad);
        });
        net
    }
}

impl Net {
    /// For each vertex, in lattice coordinates, the mean of the points where the edges of its cell lead through the
    /// surface. `level` at a node is negative inside; where it does not agree with the lattice, the middle is taken.
    pub fn mean_of_crossings(&self, lattice: &Lattice, level: impl Fn(usize) -> f64) -> Vec<DVec3> {
        let point = |cell: &[usize; 3]| {
            let (mut sum, mut n) = (DVec3::ZERO, 0.0);
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                for [du, dv] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
                    let mut at = *cell;
                    at[u] += du;
                    at[v] += dv;
                    let a = lattice.index(at);
                    let mut q = DVec3::from_array(at.map(|x| x as f64));
                    at[axis] += 1;
                    let b = lattice.index(at);
                    if lattice.inside[a] != lattice.inside[b] {
                        let (fa, fb) = (level(a), level(b));
                        let agrees = (fa < 0.0) == lattice.inside[a] && (fb < 0.0) == lattice.inside[b];
                        let t = fa / (fa - fb);
                        q[axis] += if agrees && t.is_finite() { t } else { 0.5 };
                        sum += q;
                        n += 1.0;
                    }
                }
            }
            sum / n
        };
        self.cells.iter().map(point).collect()
    }

    /// For each vertex the mean of those that it has a quadrilateral's side in common with.
    pub fn neighbour_means(&self, points: &[DVec3]) -> Vec<DVec3> {
        // every side belongs to two quadrilaterals, so that each neighbour counts once when followed anticlockwise
        let mut sums = vec![(DVec3::ZERO, 0.0); points.len()];
        for q in &self.quads {
            for c in 0..4 {
                let sum = &mut sums[q[c] as usize];
                sum.0 += points[q[(c + 1) % 4] as usize];
                sum.1 += 1.0;
            }
        }
        sums.iter().map(|(sum, n)| sum / n).collect()
    }

    /// Two triangles for each quadrilateral, cut so that they bulge outward.
    pub fn triangles(&self, points: &[DVec3]) -> Vec<[u32; 3]> {
        let mut out = Vec::with_capacity(2 * self.quads.len());
        for &[a, b, c, d] in &self.quads {
            let [pa, pb, pc, pd] = [a, b, c, d].map(|v| points[v as usize]);
            if (pb - pa).cross(pc - pa).dot(pd - pa) > 0.0 {
                out.extend([[a, b, d], [b, c, d]]);
            } else {
                out.extend([[a, b, c], [a, c, d]]);
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;
    use crate::mesh::check::MeshReport;
    use proptest::prelude::*;

    fn lattice(dims: [usize; 3], inside: impl Fn([usize; 3]) -> bool) -> Lattice {
        let mut l = Lattice { dims, inside: vec![false; dims[0] * dims[1] * dims[2]] };
        for i in 0..l.inside.len() {
            let at = l.node(i);
            let border = (0..3).any(|a| at[a] == 0 || at[a] + 1 == dims[a]);
            l.inside[i] = !border && inside(at);
        }
        l
    }

    fn blocks(l: &Lattice) -> TriMesh {
        let net = l.net();
        assert_eq!(net.quads.len(), l.quad_count());
        let positions: Vec<DVec3> =
            net.cells.iter().map(|c| DVec3::from_array(c.map(|x| x as f64)) + DVec3::splat(0.5)).collect();
        let triangles = net.triangles(&positions);
        TriMesh { positions, triangles }
    }

    #[test]
    fn one_node_is_a_cube_facing_outward() {
        let mesh = blocks(&lattice([3, 3, 3], |_| true));
        let r = MeshReport::of(&mesh);
        assert!(r.is_clean_solid());
        assert_eq!((r.volume, r.area, r.vertices), (1.0, 6.0, 8));
        assert_eq!(r.bounds, Some((DVec3::splat(0.5), DVec3::splat(1.5))));
    }

    #[test]
    fn a_shell_is_filled() {
        let mut l = lattice([7, 7, 7], |at| at != [3, 3, 3]);
        l.fill_cavities();
        assert_eq!(blocks(&l).volume(), 125.0);
    }

    #[test]
    fn crossings_lie_where_the_level_is_zero() {
        let l = lattice([4, 3, 3], |at| at[0] == 1);
        let net = l.net();
        let points = net.mean_of_crossings(&l, |i| if l.inside[i] { -1.0 } else { 3.0 });
        for (c, p) in net.cells.iter().zip(&points) {
            // three edges meet the inside node; each crosses at a quarter of the way from it
            let node = DVec3::ONE;
            let d = (*p - node).abs();
            assert!((d - DVec3::splat(0.25 / 3.0)).abs().max_element() < 1e-12, "{c:?} {p}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn any_nodes_give_a_clean_solid_that_holds_them(bits in proptest::collection::vec(any::<bool>(), 125)) {
            let mut l = lattice([7, 7, 7], |[x, y, z]| bits[(x - 1) + 5 * ((y - 1) + 5 * (z - 1))]);
            prop_assume!(l.inside.iter().any(|&i| i));
            let before = l.inside.clone();
            l.make_well_composed();
            prop_assert!(before.iter().zip(&l.inside).all(|(b, a)| a >= b));
            let volume = l.inside.iter().filter(|&&i| i).count() as f64;
            let r = MeshReport::of(&blocks(&l));
            prop_assert!(r.is_clean_solid(), "{:?}", r.defects());
            prop_assert_eq!(r.volume, volume);
            l.fill_cavities();
            let r = MeshReport::of(&blocks(&l));
            prop_assert!(r.is_clean_solid());
            prop_assert!(r.volume >= volume);
        }
    }
}

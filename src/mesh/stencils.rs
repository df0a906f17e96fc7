//! The stencils of isosurface stuffing: what remains of a tetrahedron of the lattice inside the surface.
//!
//! # Theory (Labelle and Shewchuk 2007, section 3)
//!
//! Each corner of the tetrahedron is inside (+), outside (-) or on the surface (0), and where a + and a - corner are
//! joined, the edge has a cut point. What is kept is the hull of the + and 0 corners and the cut points:
//!
//! | corners | remains |
//! |---|---|
//! | no + | nothing |
//! | no - | the tetrahedron |
//! | one + | one tetrahedron |
//! | ++-0 | a pyramid: two |
//! | ++-- | a wedge: three |
//! | +++- | a wedge: three |
//!
//! The faces ++- leave quadrilaterals, which the tetrahedra on both sides must cut alike. The diagonal starts from the
//! cut point on the face's long edge if that is cut. If both cut edges are short, the two + corners are ends of a long
//! edge, and the diagonal starts from the one that has an even number of coordinates below those of the - corner (the
//! parity rule: the tetrahedra at the long edge never get two diagonals from one end of it).
//!
//! # Practice
//!
//! The fourth side of the wedge ++-- lies on the surface; of its two diagonals the shorter is taken where there is a
//! choice.

use glam::DVec3;

/// Where a lattice point is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Inside,
    On,
    Outside,
}

/// A tetrahedron of the lattice. Corners 0 and 1 are joined by a long edge, 2 and 3 by the other.
pub(super) struct LatticeTet {
    pub sides: [Side; 4],
    /// Places in half steps of the lattice.
    pub halves: [[i64; 3]; 4],
    /// Points of the mesh at the corners.
    pub points: [u32; 4],
}

const WEDGE: [(usize, usize); 3] = [(0, 1), (1, 2), (2, 0)];

impl LatticeTet {
    /// Calls `found` with the tetrahedra inside, of either sign. `cut` gives the point of the mesh on the edge between
    /// an inside and an outside corner.
    pub fn fill(
        &self,
        mut cut: impl FnMut(usize, usize) -> u32,
        position: impl Fn(u32) -> DVec3,
        mut found: impl FnMut([u32; 4]),
    ) {
        let those = |side: Side| (0..4).filter(move |&c| self.sides[c] == side);
        let mut plus = [0; 4];
        let mut minus = [0; 4];
        let pluses = those(Side::Inside).zip(&mut plus).map(|(c, slot)| *slot = c).count();
        let minuses = those(Side::Outside).zip(&mut minus).map(|(c, slot)| *slot = c).count();
        let p = |c: usize| self.points[c];
        match (pluses, minuses) {
            (0, _) => {}
            (_, 0) => found(self.points),
            (1, _) => found(std::array::from_fn(|c| match self.sides[c] {
                Side::Outside => cut(plus[0], c),
                _ => p(c),
            })),
            (2, 1) => {
                let ([a, b, ..], out) = (plus, minus[0]);
                let Some(apex) = those(Side::On).next() else { return };
                let (near_a, near_b) = (cut(a, out), cut(b, out));
                if self.diagonal_start(a, b, out) == a {
                    found([p(a), p(b), near_b, p(apex)]);
                    found([p(a), near_b, near_a, p(apex)]);
                } else {
                    found([p(a), p(b), near_a, p(apex)]);
                    found([p(b), near_b, near_a, p(apex)]);
                }
            }
            (2, _) => {
                let ([a, b, ..], [c, d, ..]) = (plus, minus);
                let (one, other) = ([p(a), cut(a, c), cut(a, d)], [p(b), cut(b, c), cut(b, d)]);
                let first = self.diagonal_start(a, b, c) == a;
                let last = self.diagonal_start(a, b, d) == b;
                let length = |s: u32, e: u32| position(s).distance_squared(position(e));
                // three diagonals that chase each other leave no tetrahedron
                let middle = if first == last { !first } else { length(one[1], other[2]) <= length(one[2], other[1]) };
                fill_wedge(one, other, [first, middle, last], found);
            }
            _ => {
                let out = minus[0];
                let corners = [plus[0], plus[1], plus[2]];
                let forward = WEDGE.map(|(i, j)| self.diagonal_start(corners[i], corners[j], out) == corners[i]);
                fill_wedge(corners.map(p), corners.map(|c| cut(c, out)), forward, found);
            }
        }
    }

    /// From which of the inside corners `a`, `b` the diagonal of the quadrilateral starts that is left of a face.
    fn diagonal_start(&self, a: usize, b: usize, out: usize) -> usize {
        // the other end of a corner's long edge
        let partner = |c: usize| c ^ 1;
        if partner(a) == out {
            b
        } else if partner(b) == out {
            a
        } else {
            let below = (0..3).filter(|&i| self.halves[a][i] < self.halves[out][i]).count();
            if below % 2 == 0 { a } else { b }
        }
    }
}

/// A wedge between the triangles `p` and `q`. The diagonal of side k runs from `p[k]` to `q[k + 1]` if `forward[k]`,
/// from `p[k + 1]` to `q[k]` otherwise; not all three may be the same.
fn fill_wedge(p: [u32; 3], q: [u32; 3], forward: [bool; 3], mut found: impl FnMut([u32; 4])) {
    // the corner at which two diagonals start, and the one at which two end
    let start = (0..3).find(|&k| forward[k] && !forward[(k + 2) % 3]).unwrap_or(0);
    let end = (0..3).find(|&k| !forward[k] && forward[(k + 2) % 3]).unwrap_or(0);
    let rest = 3 - start - end;
    found([p[0], p[1], p[2], q[end]]);
    found([q[0], q[1], q[2], p[start]]);
    found([p[start], p[rest], q[end], q[rest]]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::tets::signed_volume;

    #[test]
    fn wedges_are_filled_for_every_choice_of_diagonals() {
        let place = |v: u32| {
            let corner = [DVec3::ZERO, DVec3::X, DVec3::Y][(v % 3) as usize];
            corner + DVec3::Z * f64::from(v / 3)
        };
        for choice in 1..7 {
            let forward = [0, 1, 2].map(|k| choice >> k & 1 == 1);
            let mut tets = Vec::new();
            fill_wedge([0, 1, 2], [3, 4, 5], forward, |t| tets.push(t));
            let volume: f64 = tets.iter().map(|t| signed_volume(t.map(place)).abs()).sum();
            assert!((volume - 0.5).abs() < 1e-15, "{forward:?}: {tets:?}");
            for k in 0..3u32 {
                let (a, b) = if forward[k as usize] { (k, 3 + (k + 1) % 3) } else { ((k + 1) % 3, 3 + k) };
                assert!(tets.iter().any(|t| t.contains(&a) && t.contains(&b)), "{forward:?}");
            }
        }
    }
}

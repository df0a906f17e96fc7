//! The body-centred cubic lattice: the corners and the centres of cubes, and its tetrahedra.
//!
//! # Theory
//!
//! Between two cubes that share a face there are four tetrahedra: the segment between their centres with each edge of
//! the face. All are alike: two opposite edges as long as the cubes', four shorter ones from a centre to a corner (by
//! the factor sqrt(3) / 2), and dihedral angles of 60 and 90 degrees. There are twelve for each cube.
//!
//! # Practice
//!
//! The tetrahedra lie between cubes, so those that touch the border of the lattice fill only a part of it; whoever
//! needs all tetrahedra of a place must leave a cube's width around it.

use glam::DVec3;

/// A block of cubes. Points are numbered: all corners first, then all centres, x fastest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bcc {
    pub cells: [usize; 3],
    pub origin: DVec3,
    /// Edge of the cubes.
    pub step: f64,
}

impl Bcc {
    /// Cubes about the box from `lo` to `hi` with a cube to spare all around, the block's centre in that of the box.
    pub fn around(lo: DVec3, hi: DVec3, step: f64) -> Self {
        let cells = Self::cells_around(lo, hi, step).map(|n| n as usize);
        let origin = (lo + hi) / 2.0 - DVec3::from_array(cells.map(|n| n as f64)) * (step / 2.0);
        Self { cells, origin, step }
    }

    /// The numbers of cubes, which may be too large for anything else.
    pub fn cells_around(lo: DVec3, hi: DVec3, step: f64) -> [f64; 3] {
        ((hi - lo) / step).to_array().map(|n| n.ceil() + 3.0)
    }

    fn corner_count(&self) -> usize {
        self.cells.iter().map(|n| n + 1).product()
    }

    pub fn point_count(&self) -> usize {
        self.corner_count() + self.cells.iter().product::<usize>()
    }

    fn corner(&self, [i, j, k]: [usize; 3]) -> u32 {
        (i + (self.cells[0] + 1) * (j + (self.cells[1] + 1) * k)) as u32
    }

    fn center(&self, [i, j, k]: [usize; 3]) -> u32 {
        (self.corner_count() + i + self.cells[0] * (j + self.cells[1] * k)) as u32
    }

    /// The place of a point in half steps: even for corners, odd for centres.
    pub fn halves(&self, point: u32) -> [i64; 3] {
        let corners = self.corner_count();
        let (id, odd) = if (point as usize) < corners { (point as usize, 0) } else { (point as usize - corners, 1) };
        let [nx, ny] = [self.cells[0] + 1 - odd, self.cells[1] + 1 - odd];
        [id % nx, id / nx % ny, id / (nx * ny)].map(|i| (2 * i + odd) as i64)
    }

    pub fn position(&self, point: u32) -> DVec3 {
        self.origin + DVec3::from_array(self.halves(point).map(|h| h as f64)) * (self.step / 2.0)
    }

    /// Calls `found` with the two ends of every edge of a layer of cubes (with the corners on its lower side; the
    /// uppermost layer has those on its upper side, too), and whether it is a long one.
    pub fn edges_of_layer(&self, k: usize, mut found: impl FnMut(u32, u32, bool)) {
        let [nx, ny, nz] = self.cells;
        let steps = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
        let inside = |p: [usize; 3], n: [usize; 3]| (0..3).all(|a| p[a] < n[a]);
        let layers = if k + 1 == nz { k..k + 2 } else { k..k + 1 };
        for c in layers.flat_map(|k| (0..=ny).flat_map(move |j| (0..=nx).map(move |i| [i, j, k]))) {
            for d in steps {
                let next = [c[0] + d[0], c[1] + d[1], c[2] + d[2]];
                if inside(next, [nx + 1, ny + 1, nz + 1]) {
                    found(self.corner(c), self.corner(next), true);
                }
                if inside(c, self.cells) && inside(next, self.cells) {
                    found(self.center(c), self.center(next), true);
                }
            }
            if inside(c, self.cells) {
                for bits in 0..8 {
                    let corner = [c[0] + (bits & 1), c[1] + (bits >> 1 & 1), c[2] + (bits >> 2)];
                    found(self.corner(corner), self.center(c), false);
                }
            }
        }
    }

    /// Calls `found` with every tetrahedron between a cube of this layer and the next cubes along the axes. The first
    /// two points are the centres, ends of one long edge; the last two those of the other.
    pub fn tets_of_layer(&self, k: usize, mut found: impl FnMut([u32; 4])) {
        let [nx, ny, _] = self.cells;
        for c in (0..ny).flat_map(|j| (0..nx).map(move |i| [i, j, k])) {
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let mut next = c;
                next[axis] += 1;
                if next[axis] == self.cells[axis] {
                    continue;
                }
                // anticlockwise seen from the next cube
                let ring = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(du, dv)| {
                    let mut corner = next;
                    corner[u] += du;
                    corner[v] += dv;
                    self.corner(corner)
                });
                for side in 0..4 {
                    found([self.center(c), self.center(next), ring[side], ring[(side + 1) % 4]]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::tets::signed_volume;
    use std::collections::HashSet;

    #[test]
    fn tetrahedra_are_positive_alike_and_fill_the_cubes_within() {
        let lattice = Bcc { cells: [3, 4, 5], origin: DVec3::new(1.0, 2.0, 3.0), step: 0.5 };
        let mut volume = 0.0;
        let mut edges = HashSet::new();
        (0..5).for_each(|k| {
            lattice.edges_of_layer(k, |a, b, long| {
                let length = lattice.position(a).distance(lattice.position(b));
                assert!((length - 0.5 * if long { 1.0 } else { 0.75f64.sqrt() }).abs() < 1e-14);
                assert!(edges.insert((a.min(b), a.max(b))), "{a} {b} twice");
            });
        });
        (0..5).for_each(|k| {
            lattice.tets_of_layer(k, |t| {
                let v = signed_volume(t.map(|p| lattice.position(p)));
                assert!((v - 0.125 / 12.0).abs() < 1e-15, "{v}");
                volume += v;
                for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
                    assert!(edges.contains(&(t[i].min(t[j]), t[i].max(t[j]))));
                }
            });
        });
        // a pyramid of a sixth of a cube is missing at each outer face
        let outer = 2.0 * (12.0 + 15.0 + 20.0);
        assert!((volume - 0.125 * (60.0 - outer / 6.0)).abs() < 1e-12, "{volume}");
        let places: HashSet<_> = (0..lattice.point_count() as u32).map(|p| lattice.halves(p)).collect();
        assert_eq!(places.len(), 4 * 5 * 6 + 60);
    }
}

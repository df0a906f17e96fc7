//! The triangles of a lattice cell, by the sides its corners are on.
//!
//! # Theory
//!
//! Marching cubes: where an edge of the cell has its ends on different sides, the surface has a vertex. On each face these
//! are joined by one segment, or, where the four corners alternate, by two, in one of two ways; which one, a bit for each
//! such face says, and both cells of the face are told the same. So the segments of a cell make closed loops, and meet those
//! of its neighbours. A loop is filled by triangles none of whose inner sides lies on a face of the cell (the neighbour
//! could have the same side there, and the mesh would not be a manifold), or, where that cannot be, by a fan around a vertex
//! of its own.
//!
//! Each vertex then has one fan of triangles, each side two triangles: the mesh is closed and manifold by construction.
//!
//! # Practice
//!
//! Corner `c` lies at `(c & 1, c >> 1 & 1, c >> 2)`. Edges 0..4 run along x from the corners with `(y, z)` = `(0,0)`,
//! `(1,0)`, `(0,1)`, `(1,1)`; 4..8 along y from `(x, z)`, 8..12 along z from `(x, y)` alike. Faces are `2 * axis + side`.

use std::sync::OnceLock;

/// Stands for the cell's own vertex in a triangle: the first loop that needs one has this, the next the one above.
pub(super) const OWN: u8 = 12;

/// The triangles of one configuration.
#[derive(Debug, Clone, Default)]
pub(super) struct Case {
    /// A bit for each edge that has a vertex.
    pub edges: u16,
    /// Corners: edges, or a vertex of the cell's own. Anticlockwise seen from the side that is not inside.
    pub triangles: Vec<[u8; 3]>,
    /// The loops that are filled around a vertex of their own.
    pub fans: Vec<Vec<u8>>,
}

/// All configurations, each worked out when it is first met: a surface has few of them.
pub(super) struct Table {
    /// By the corners that are inside, then the faces on which the inside corners are joined (`<< 8`).
    index: Vec<u16>,
    cases: Vec<OnceLock<Case>>,
    /// The faces whose corners alternate, by the corners that are inside.
    pub doubtful: [u8; 256],
}

impl Table {
    pub fn get() -> &'static Self {
        static TABLE: OnceLock<Table> = OnceLock::new();
        TABLE.get_or_init(Self::build)
    }

    #[inline(always)]
    pub fn case(&self, inside: usize, joined: usize) -> &Case {
        self.cases[usize::from(self.index[inside | joined << 8])].get_or_init(|| case(inside, joined))
    }

    fn build() -> Self {
        let mut table = Self { index: vec![0; 1 << 14], cases: Vec::new(), doubtful: [0; 256] };
        for inside in 0..256 {
            let doubtful = (0..6).filter(|&f| alternates(inside, f)).fold(0u8, |m, f| m | 1 << f);
            table.doubtful[inside] = doubtful;
            for joined in 0..64 {
                if joined & !usize::from(doubtful) == 0 {
                    table.index[inside | joined << 8] = table.cases.len() as u16;
                    table.cases.push(OnceLock::new());
                }
            }
        }
        table
    }
}

/// The corners of a face, anticlockwise seen from outside the cell.
pub(super) fn face_corners(face: usize) -> [usize; 4] {
    let axis = face / 2;
    let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    let base = (face % 2) << axis;
    if face % 2 == 1 { [base, base + u, base + u + v, base + v] } else { [base, base + v, base + u + v, base + u] }
}

/// The edge between two corners.
fn edge(a: usize, b: usize) -> u8 {
    let low = a & b;
    match a ^ b {
        1 => (low >> 1) as u8,
        2 => 4 + (low & 1 | low >> 1 & 2) as u8,
        _ => 8 + (low & 3) as u8,
    }
}

/// The two faces of an edge.
fn faces_of(e: u8) -> [usize; 2] {
    let sides = [usize::from(e & 1), usize::from(e >> 1 & 1)];
    let axes = [[1, 2], [0, 2], [0, 1]][usize::from(e / 4)];
    [2 * axes[0] + sides[0], 2 * axes[1] + sides[1]]
}

fn alternates(inside: usize, face: usize) -> bool {
    let [a, b, c, d] = face_corners(face).map(|c| inside >> c & 1);
    a == c && b == d && a != b
}

fn case(inside: usize, joined: usize) -> Case {
    // which edge follows which along a loop
    let mut next = [u8::MAX; 12];
    for f in 0..6 {
        let q = face_corners(f);
        let is_in = |i: usize| inside >> q[i % 4] & 1 == 1;
        let e = |i: usize| edge(q[i % 4], q[(i + 1) % 4]);
        // walking round the face, the boundary is left at one edge and entered at another
        let exits: Vec<usize> = (0..4).filter(|&i| is_in(i) && !is_in(i + 1)).collect();
        for &x in &exits {
            let entry = if exits.len() == 2 {
                // joined: the outside corner after the exit is cut off; else the inside corner before it
                if joined >> f & 1 == 1 { x + 1 } else { x + 3 }
            } else {
                (1..4).map(|d| x + d).find(|&i| !is_in(i) && is_in(i + 1)).expect("what is left is entered again")
            };
            next[usize::from(e(entry))] = e(x);
        }
    }
    let mut case = Case::default();
    let mut seen = [false; 12];
    for first in 0..12u8 {
        if next[usize::from(first)] == u8::MAX || seen[usize::from(first)] {
            continue;
        }
        let mut ring = Vec::new();
        let mut at = first;
        while !seen[usize::from(at)] {
            seen[usize::from(at)] = true;
            case.edges |= 1 << at;
            ring.push(at);
            at = next[usize::from(at)];
        }
        match fill(&ring) {
            Some(triangles) => case.triangles.extend(triangles),
            None => {
                let own = OWN + case.fans.len() as u8;
                let n = ring.len();
                case.triangles.extend((0..n).map(|i| [ring[i], ring[(i + 1) % n], own]));
                case.fans.push(ring);
            }
        }
    }
    case
}

/// Triangles of a loop without an inner side on a face of the cell, if there are any.
fn fill(ring: &[u8]) -> Option<Vec<[u8; 3]>> {
    let n = ring.len();
    if n == 3 {
        return Some(vec![[ring[0], ring[1], ring[2]]]);
    }
    let on_face = |a: u8, b: u8| faces_of(a).iter().any(|f| faces_of(b).contains(f));
    // cut off ears so that what remains stays fillable
    for i in 0..n {
        let (before, after) = (ring[(i + n - 1) % n], ring[(i + 1) % n]);
        if !on_face(before, after) {
            let mut rest = ring.to_vec();
            rest.remove(i);
            if let Some(mut triangles) = fill(&rest) {
                triangles.push([before, ring[i], after]);
                return Some(triangles);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_have_two_faces_and_corners_lie_on_them() {
        for e in 0..12 {
            for f in 0..6 {
                let q = face_corners(f);
                let on = (0..4).any(|i| edge(q[i], q[(i + 1) % 4]) == e);
                assert_eq!(faces_of(e).contains(&f), on, "{e} {f}");
            }
        }
        assert_eq!((edge(0, 1), edge(6, 7), edge(0, 2), edge(5, 7), edge(0, 4), edge(3, 7)), (0, 3, 4, 7, 8, 11));
    }

    #[test]
    fn loops_are_closed_and_use_every_vertex() {
        let table = Table::get();
        let mut fans = 0;
        for inside in 0..256usize {
            for joined in (0..64).filter(|j| j & !usize::from(table.doubtful[inside]) == 0) {
                let case = table.case(inside, joined);
                fans += case.fans.len();
                let mut sides = std::collections::HashMap::new();
                for t in &case.triangles {
                    (0..3).for_each(|c| *sides.entry((t[c], t[(c + 1) % 3])).or_insert(0) += 1);
                }
                for (&(a, b), n) in &sides {
                    assert_eq!(*n, 1);
                    // a side has its opposite, or lies on a face
                    let both = sides.contains_key(&(b, a));
                    let face = a < OWN && b < OWN && faces_of(a).iter().any(|f| faces_of(b).contains(f));
                    assert!(both != face, "{inside} {joined}: {a} {b}");
                }
                for e in 0..12usize {
                    let ends = (0..8usize).flat_map(|a| (0..a).map(move |b| (a, b)));
                    let crossed = ends
                        .filter(|(a, b)| (a ^ b).count_ones() == 1 && usize::from(edge(*a, *b)) == e)
                        .any(|(a, b)| inside >> a & 1 != inside >> b & 1);
                    assert_eq!(crossed, case.edges >> e & 1 == 1);
                }
            }
        }
        assert!(table.cases.len() < 65_536 && fans < 2000, "{} {fans}", table.cases.len());
    }
}

//! The surface between the inside and the outside nodes of a lattice, with a vertex on each edge that it crosses.
//!
//! The result is closed, manifold and consistently oriented by construction (`contour_table.rs`); where the surface would
//! leave the lattice, it is closed along its border. Where vertices lie, and how the nodes of a face are joined whose corners
//! alternate, a [`Placer`] says.
//!
//! # Practice
//!
//! Sides are bits of words, so that whole rows are judged at once, and a vertex's number is that of the crossings before it:
//! a count for each word, and the bits below within it. Layers are worked off in parallel and do not depend on each other.

use std::sync::Mutex;

use glam::{DVec3, Vec3};

use super::TriMesh;
use super::contour_table::{Case, OWN, Table, face_corners};
use crate::math::parallel;

/// A triangle mesh with a normal for each vertex, of unit length, towards the outside.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Contour {
    pub mesh: TriMesh,
    pub normals: Vec<Vec3>,
}

/// The side of each node.
#[derive(Debug, Clone)]
pub struct Sides {
    dims: [usize; 3],
    words: usize,
    /// Rows with one more node at both ends, and rows and layers before and behind: these are outside.
    bits: Vec<u64>,
}

impl Sides {
    /// `row(j, k, out)` sets the bits of a row's nodes that are inside, from bit 0 of the first word.
    pub fn new(dims: [usize; 3], row: &(dyn Fn(usize, usize, &mut [u64]) + Sync)) -> Self {
        let [nx, ny, nz] = dims;
        let words = (nx + 2).div_ceil(64);
        let mut bits = vec![0; words * (ny + 2) * (nz + 2)];
        parallel::chunks_mut(&mut bits, words * (ny + 2), &|k, rows| {
            if k == 0 || k > nz {
                return;
            }
            let mut own = vec![0; words];
            for j in 0..ny {
                own.fill(0);
                row(j, k - 1, &mut own);
                // one node further
                let mut carry = 0;
                for (out, w) in rows[(j + 1) * words..][..words].iter_mut().zip(&own) {
                    *out = w << 1 | carry;
                    carry = w >> 63;
                }
            }
        });
        Self { dims, words, bits }
    }

    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    fn row(&self, j: usize, k: usize) -> &[u64] {
        &self.bits[(k * (self.dims[1] + 2) + j) * self.words..][..self.words]
    }

    /// Bits of the nodes whose edge to the next along an axis crosses the surface.
    #[inline(always)]
    fn crossings(&self, axis: usize, j: usize, k: usize, w: usize) -> u64 {
        let row = (k * (self.dims[1] + 2) + j) * self.words + w;
        let own = self.bits[row];
        let other = match axis {
            0 => own >> 1 | if w + 1 < self.words { self.bits[row + 1] << 63 } else { 0 },
            1 if j <= self.dims[1] => self.bits[row + self.words],
            2 if k <= self.dims[2] => self.bits[row + self.words * (self.dims[1] + 2)],
            _ => own,
        };
        own ^ other
    }
}

/// An edge that the surface crosses, from `node` to the next along `axis`. Both nodes are in the lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    pub node: [usize; 3],
    pub axis: usize,
}

/// Says where the vertices of a contour lie.
pub trait Placer: Sync {
    /// Place and outward unit normal of the vertex on an edge; `inside`: its node is.
    fn vertex(&self, edge: Edge, inside: bool) -> (DVec3, Vec3);

    /// The same where the surface is closed along the border: `p` lies half an edge beyond, in node coordinates, and the
    /// surface faces along `outward`.
    fn border(&self, p: DVec3, outward: DVec3) -> (DVec3, Vec3);

    /// The same for a vertex within the cell whose lowest node is `node`, in the middle of a loop of others.
    fn middle(&self, node: [i64; 3], ring: &[(DVec3, Vec3)]) -> (DVec3, Vec3);

    /// Whether the inside nodes are joined on a face whose corners alternate: those of `node` and of its neighbours along
    /// the two axes that are not `axis`.
    fn joined(&self, node: [usize; 3], axis: usize) -> bool;

    /// Whether places are mirrored against the lattice, so that triangles must be turned round.
    fn mirrors(&self) -> bool {
        false
    }
}

/// Where the vertices of each word of each row begin.
struct Numbers {
    /// For each axis, counted from the first of the layer.
    starts: [Vec<u32>; 3],
    /// First of each layer, and the end.
    layers: Vec<usize>,
}

impl Numbers {
    fn of(sides: &Sides) -> Self {
        let [_, ny, nz] = sides.dims;
        let words = sides.words;
        let size = words * (ny + 2);
        let mut starts: [Vec<u32>; 3] = std::array::from_fn(|_| vec![0u32; size * (nz + 2)]);
        let [x, y, z] = &mut starts;
        let pieces: Vec<_> =
            x.chunks_mut(size).zip(y.chunks_mut(size)).zip(z.chunks_mut(size)).map(Mutex::new).collect();
        let counts = parallel::map(nz + 2, &|k| {
            let mut guard = pieces[k].lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let ((x, y), z) = &mut *guard;
            let mut n = 0u32;
            for j in 0..ny + 2 {
                for (axis, starts) in [&mut **x, &mut **y, &mut **z].into_iter().enumerate() {
                    for w in 0..words {
                        starts[j * words + w] = n;
                        n += sides.crossings(axis, j, k, w).count_ones();
                    }
                }
            }
            n
        });
        let mut layers = vec![0];
        let mut sum = 0;
        for n in counts {
            sum += n as usize;
            layers.push(sum);
        }
        drop(pieces);
        Self { starts, layers }
    }

    #[inline(always)]
    fn id(&self, sides: &Sides, axis: usize, [i, j, k]: [usize; 3]) -> u32 {
        let word = (k * (sides.dims[1] + 2) + j) * sides.words + i / 64;
        let before = sides.crossings(axis, j, k, i / 64) & ((1 << (i % 64)) - 1);
        self.layers[k] as u32 + self.starts[axis][word] + before.count_ones()
    }
}

/// The contour of a lattice.
///
/// # Panics
/// If it has 2^32 vertices or more.
pub fn contour(sides: &Sides, placer: &dyn Placer) -> Contour {
    let numbers = Numbers::of(sides);
    let [_, ny, nz] = sides.dims;
    let total = numbers.layers[nz + 2];
    assert!(total < u32::MAX as usize, "{total} vertices are too many to index");
    // zeros that cost nothing until they are written, by all threads
    let mut positions: Vec<DVec3> = bytemuck::allocation::cast_vec(vec![[0.0f64; 3]; total]);
    let mut normals: Vec<Vec3> = bytemuck::allocation::cast_vec(vec![[0.0f32; 3]; total]);
    let pieces = split(&mut positions, &numbers.layers).into_iter().zip(split(&mut normals, &numbers.layers));
    let pieces: Vec<_> = pieces.map(Mutex::new).collect();
    let table = Table::get();
    let mirrors = placer.mirrors();
    // the vertices of a layer of nodes, and the triangles of the cells above it
    let layers = parallel::map(nz + 2, &|k| {
        let mut guard = pieces[k].lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let (positions, normals) = &mut *guard;
        let mut n = 0;
        for j in 0..ny + 2 {
            for axis in 0..3 {
                for w in 0..sides.words {
                    let mut bits = sides.crossings(axis, j, k, w);
                    while bits != 0 {
                        let i = 64 * w + bits.trailing_zeros() as usize;
                        bits &= bits - 1;
                        (positions[n], normals[n]) = place(sides, placer, [i, j, k], axis);
                        n += 1;
                    }
                }
            }
        }
        drop(guard);
        if k <= nz { Layer::of(sides, &numbers, table, placer, k, mirrors) } else { Layer::default() }
    });
    drop(pieces);
    let mut triangles = vec![[0; 3]; layers.iter().map(|l| l.triangles.len()).sum()];
    let mut ends = vec![0];
    layers.iter().for_each(|l| ends.push(ends[ends.len() - 1] + l.triangles.len()));
    let mut own = vec![total as u32];
    layers.iter().for_each(|l| own.push(own[own.len() - 1] + l.fans.len() as u32));
    let pieces: Vec<_> = split(&mut triangles, &ends).into_iter().map(Mutex::new).collect();
    parallel::each(nz + 2, &|k| {
        let mut out = pieces[k].lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        out.copy_from_slice(&layers[k].triangles);
        // vertices of cells come behind all others
        for &t in &layers[k].with_own {
            for v in &mut out[t as usize] {
                if *v >= FIRST_OWN {
                    *v = own[k] + (*v - FIRST_OWN);
                }
            }
        }
    });
    drop(pieces);
    for (cell, ring) in layers.iter().flat_map(|l| &l.fans) {
        let around: Vec<_> = ring.iter().map(|&v| (positions[v as usize], normals[v as usize])).collect();
        let (p, n) = placer.middle(cell.map(|c| c as i64 - 1), &around);
        positions.push(p);
        normals.push(n);
    }
    Contour { mesh: TriMesh { positions, triangles }, normals }
}

/// A slice cut at `ends`, which starts with 0.
fn split<'a, T>(mut items: &'a mut [T], ends: &[usize]) -> Vec<&'a mut [T]> {
    let mut pieces = Vec::with_capacity(ends.len());
    for pair in ends.windows(2) {
        let (piece, rest) = items.split_at_mut(pair[1] - pair[0]);
        pieces.push(piece);
        items = rest;
    }
    pieces
}

/// Vertex `node` + `axis`, in nodes counted from the extra layers.
#[inline(always)]
fn place(sides: &Sides, placer: &dyn Placer, node: [usize; 3], axis: usize) -> (DVec3, Vec3) {
    let [i, j, k] = node;
    let inside = sides.row(j, k)[i / 64] >> (i % 64) & 1 == 1;
    let lowest = node[axis] == 0;
    if lowest || node[axis] == sides.dims[axis] {
        let mut p = DVec3::from_array(node.map(|v| v as f64 - 1.0));
        p[axis] += 0.5;
        let mut outward = DVec3::ZERO;
        outward[axis] = if lowest { -1.0 } else { 1.0 };
        return placer.border(p, outward);
    }
    placer.vertex(Edge { node: node.map(|v| v - 1), axis }, inside)
}

/// Numbers of the cells' own vertices begin here until it is known how many others there are.
const FIRST_OWN: u32 = u32::MAX - (1 << 24);

/// The triangles of a layer of cells.
#[derive(Default)]
struct Layer {
    triangles: Vec<[u32; 3]>,
    /// The triangles that have a vertex of their cell's own.
    with_own: Vec<u32>,
    /// The cell and the vertices around each such vertex.
    fans: Vec<([usize; 3], Vec<u32>)>,
}

/// For each edge of a cell its axis and where its node lies.
const EDGES: [(usize, [usize; 3]); 12] = [
    (0, [0, 0, 0]),
    (0, [0, 1, 0]),
    (0, [0, 0, 1]),
    (0, [0, 1, 1]),
    (1, [0, 0, 0]),
    (1, [1, 0, 0]),
    (1, [0, 0, 1]),
    (1, [1, 0, 1]),
    (2, [0, 0, 0]),
    (2, [1, 0, 0]),
    (2, [0, 1, 0]),
    (2, [1, 1, 0]),
];

impl Layer {
    fn of(sides: &Sides, numbers: &Numbers, table: &Table, placer: &dyn Placer, k: usize, mirrors: bool) -> Self {
        let words = sides.words;
        let mut layer = Self { triangles: Vec::new(), with_own: Vec::new(), fans: Vec::new() };
        // a surface has about two triangles for each of its vertices
        layer.triangles.reserve(2 * (numbers.layers[k + 1] - numbers.layers[k]) + 16);
        for j in 0..=sides.dims[1] {
            let rows = [sides.row(j, k), sides.row(j + 1, k), sides.row(j, k + 1), sides.row(j + 1, k + 1)];
            for w in 0..words {
                let own = rows.map(|r| r[w]);
                let next = rows.map(|r| r[w] >> 1 | if w + 1 < words { r[w + 1] << 63 } else { 0 });
                let any = own.iter().chain(&next).fold(0, |m, b| m | b);
                let all = own.iter().chain(&next).fold(u64::MAX, |m, b| m & b);
                let mut cells = any & !all;
                while cells != 0 {
                    let bit = cells.trailing_zeros();
                    cells &= cells - 1;
                    let i = 64 * w + bit as usize;
                    let mut inside = 0;
                    for r in 0..4 {
                        inside |= (own[r] >> bit & 1) << (2 * r) | (next[r] >> bit & 1) << (2 * r + 1);
                    }
                    layer.cell(sides, numbers, table, placer, [i, j, k], inside as usize, mirrors);
                }
            }
        }
        layer
    }

    #[inline(always)]
    #[expect(clippy::too_many_arguments)]
    fn cell(
        &mut self,
        sides: &Sides,
        numbers: &Numbers,
        table: &Table,
        placer: &dyn Placer,
        cell: [usize; 3],
        inside: usize,
        mirrors: bool,
    ) {
        let mut joined = 0;
        let doubtful = table.doubtful[inside];
        if doubtful != 0 {
            for face in (0..6).filter(|f| doubtful >> f & 1 == 1) {
                let low = face_corners(face).into_iter().fold(7, |m, c| m & c);
                let node = [cell[0] + (low & 1), cell[1] + (low >> 1 & 1), cell[2] + (low >> 2)];
                // faces between the lattice and the extra nodes never alternate
                let yes = placer.joined(node.map(|v| v - 1), face / 2);
                joined |= usize::from(yes) << face;
            }
        }
        let case: &Case = table.case(inside, joined);
        let mut ids = [0; 12];
        let mut edges = case.edges;
        while edges != 0 {
            let e = edges.trailing_zeros() as usize;
            edges &= edges - 1;
            let (axis, d) = EDGES[e];
            ids[e] = numbers.id(sides, axis, [cell[0] + d[0], cell[1] + d[1], cell[2] + d[2]]);
        }
        for t in &case.triangles {
            let mut corners = t.map(|e| {
                if e >= OWN { FIRST_OWN + self.fans.len() as u32 + u32::from(e - OWN) } else { ids[usize::from(e)] }
            });
            if mirrors {
                corners.swap(1, 2);
            }
            if t[2] >= OWN {
                self.with_own.push(self.triangles.len() as u32);
            }
            self.triangles.push(corners);
        }
        for ring in &case.fans {
            self.fans.push((cell, ring.iter().map(|&e| ids[usize::from(e)]).collect()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::check::MeshReport;
    use proptest::prelude::*;

    /// Vertices a third of the way from the inside node; faces joined by a hash.
    struct Thirds(u64);

    impl Placer for Thirds {
        fn vertex(&self, edge: Edge, inside: bool) -> (DVec3, Vec3) {
            let mut p = DVec3::from_array(edge.node.map(|v| v as f64));
            p[edge.axis] += if inside { 1.0 / 3.0 } else { 2.0 / 3.0 };
            (p, Vec3::Z)
        }

        fn border(&self, p: DVec3, outward: DVec3) -> (DVec3, Vec3) {
            (p, outward.as_vec3())
        }

        fn middle(&self, _: [i64; 3], ring: &[(DVec3, Vec3)]) -> (DVec3, Vec3) {
            (ring.iter().map(|r| r.0).sum::<DVec3>() / ring.len() as f64, Vec3::Z)
        }

        fn joined(&self, [i, j, k]: [usize; 3], axis: usize) -> bool {
            let n = self.0.wrapping_add((i + 37 * (j + 41 * (k + 43 * axis))) as u64);
            n.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 63 == 1
        }
    }

    fn report(dims: [usize; 3], inside: &dyn Fn([usize; 3]) -> bool, seed: u64) -> MeshReport {
        let copy: Vec<bool> = (0..dims.iter().product())
            .map(|n: usize| inside([n % dims[0], n / dims[0] % dims[1], n / (dims[0] * dims[1])]))
            .collect();
        let sides = Sides::new(dims, &|j, k, out| {
            for i in (0..dims[0]).filter(|i| copy[i + dims[0] * (j + dims[1] * k)]) {
                out[i / 64] |= 1 << (i % 64);
            }
        });
        MeshReport::of(&contour(&sides, &Thirds(seed)).mesh)
    }

    #[test]
    fn one_node_is_an_octahedron_facing_outward() {
        let r = report([3, 3, 3], &|p| p == [1, 1, 1], 0);
        assert!(r.is_clean_solid(), "{r:?}");
        assert_eq!((r.vertices, r.triangles), (6, 8));
        assert!((r.volume - 4.0 / 3.0 / 27.0).abs() < 1e-12);
    }

    #[test]
    fn a_full_lattice_is_closed_along_its_border() {
        let r = report([70, 3, 2], &|_| true, 0);
        assert!(r.is_clean_solid(), "{r:?}");
        assert_eq!(r.bounds, Some((DVec3::splat(-0.5), DVec3::new(69.5, 2.5, 1.5))));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(80))]
        #[test]
        fn any_nodes_and_any_joints_make_a_manifold(bits in proptest::collection::vec(any::<bool>(), 216), seed in any::<u64>()) {
            prop_assume!(bits.iter().any(|b| *b));
            let r = report([6, 6, 6], &|[i, j, k]| bits[i + 6 * (j + 6 * k)], seed);
            prop_assert!(r.closed && r.manifold && r.oriented && !r.inside_out, "{:?}", r);
            prop_assert_eq!((r.duplicate_triangles, r.unreferenced_vertices), (0, 0));
        }

        #[test]
        fn long_rows_of_words_too(bits in proptest::collection::vec(any::<bool>(), 900), seed in any::<u64>()) {
            prop_assume!(bits.iter().any(|b| *b));
            let r = report([150, 3, 2], &|[i, j, k]| bits[i + 150 * (j + 3 * k)], seed);
            prop_assert!(r.closed && r.manifold && r.oriented && !r.inside_out, "{:?}", r);
        }
    }
}

//! The edge list with adjacency (Westermann and Rezk-Salama 2001, section 2.4).
//!
//! # Theory
//!
//! Each triangle refers to its three vertices and three edges, each edge to its two vertices and the triangles on both
//! sides. Beside the paper's lists there is the half-edge table: half-edge `3 t + c` runs in triangle `t` from corner `c`
//! to corner `(c + 1) % 3`, and [`Topology::opposite`] leads to the half-edge on the other side, so that a walk needs one
//! look-up per triangle.
//!
//! # Practice
//!
//! Half-edges are sorted by their lower vertex (counting sort), then the handful at each vertex by the upper one, which
//! is linear but for vertices of very high degree. An edge here always has one or two triangles: where more meet, as in
//! meshes that are no clean solid, half-edges of opposite direction are paired first, what remains in order of
//! appearance, and each pair is an edge of its own. So a closed walk stays closed on every mesh in which each edge has an
//! even number of faces. Edges with the same two vertices are neighbours in the list.

/// Index of a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct VertexId(pub u32);
/// Index of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TriangleId(pub u32);
/// Index of an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EdgeId(pub u32);

/// Connectivity of a triangle mesh. It never sees positions.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Topology {
    /// Number of vertices of the mesh; some may be in no triangle.
    pub vertex_count: usize,
    /// The edges of each triangle; edge c runs from corner c to corner `(c + 1) % 3`.
    pub triangle_edges: Vec<[EdgeId; 3]>,
    /// The two vertices of each edge, the lower index first (equal only in a triangle that names a vertex twice).
    pub edge_vertices: Vec<[VertexId; 2]>,
    /// The triangles on both sides of each edge, [`Topology::NONE`] in the second place at a boundary. Where the mesh is
    /// consistently oriented, the first of two runs from the lower to the upper vertex.
    pub edge_triangles: Vec<[u32; 2]>,
    /// For half-edge `3 t + c` the half-edge of the neighbour, [`Topology::NONE`] at a boundary.
    pub opposite: Vec<u32>,
}

impl Topology {
    /// Stands for "nothing there".
    pub const NONE: u32 = u32::MAX;

    /// # Panics
    /// If a triangle names a vertex that is not below `vertex_count`, or there are more than 2^32 / 3 triangles. Readers
    /// check both.
    pub fn build(vertex_count: usize, triangles: &[[u32; 3]]) -> Self {
        let half_edges = triangles.len() * 3;
        assert!(half_edges < Self::NONE as usize, "{} triangles are too many to index", triangles.len());
        // counting sort by the lower vertex: afterwards bucket v is sorted[start[v]..start[v + 1]]
        let mut start = vec![0u32; vertex_count + 1];
        for t in triangles {
            assert!(t.iter().all(|&v| (v as usize) < vertex_count), "triangle {t:?} of {vertex_count} vertices");
            for c in 0..3 {
                let (a, b) = (t[c], t[(c + 1) % 3]);
                start[a.min(b) as usize] += 1;
            }
        }
        let mut sum = 0;
        for s in &mut start {
            sum += *s;
            *s = sum;
        }
        // upper vertex, then half-edge, in one word: sorts by edge and by order of appearance at once
        let mut sorted = vec![0u64; half_edges];
        for (t, tri) in triangles.iter().enumerate().rev() {
            for c in (0..3).rev() {
                let (a, b) = (tri[c], tri[(c + 1) % 3]);
                let slot = &mut start[a.min(b) as usize];
                *slot -= 1;
                sorted[*slot as usize] = u64::from(a.max(b)) << 32 | (3 * t + c) as u64;
            }
        }

        let mut out = Self {
            vertex_count,
            triangle_edges: vec![[EdgeId(Self::NONE); 3]; triangles.len()],
            edge_vertices: Vec::with_capacity(half_edges / 2 + 1),
            edge_triangles: Vec::with_capacity(half_edges / 2 + 1),
            opposite: vec![Self::NONE; half_edges],
        };
        for lo in 0..vertex_count {
            let bucket = &mut sorted[start[lo] as usize..start[lo + 1] as usize];
            sort_small(bucket);
            let mut rest = &*bucket;
            while let Some(&first) = rest.first() {
                let hi = (first >> 32) as u32;
                let len = rest.iter().position(|&w| (w >> 32) as u32 != hi).unwrap_or(rest.len());
                let (group, after) = rest.split_at(len);
                rest = after;
                out.add_group(triangles, lo as u32, hi, group);
            }
        }
        out
    }

    /// Makes the edges between `lo` and `hi` out of all half-edges between them, in order of appearance.
    fn add_group(&mut self, triangles: &[[u32; 3]], lo: u32, hi: u32, group: &[u64]) {
        let rises = |h: u32| triangles[h as usize / 3][h as usize % 3] == lo;
        match *group {
            [a] => self.add_edge(lo, hi, a as u32, None),
            [a, b] if rises(a as u32) => self.add_edge(lo, hi, a as u32, Some(b as u32)),
            [a, b] => self.add_edge(lo, hi, b as u32, Some(a as u32)),
            _ => {
                let (up, down): (Vec<u32>, Vec<u32>) = group.iter().map(|&w| w as u32).partition(|&h| rises(h));
                let pairs = up.len().min(down.len());
                for (&a, &b) in up.iter().zip(&down) {
                    self.add_edge(lo, hi, a, Some(b));
                }
                for same_way in up[pairs..].chunks(2).chain(down[pairs..].chunks(2)) {
                    self.add_edge(lo, hi, same_way[0], same_way.get(1).copied());
                }
            }
        }
    }

    fn add_edge(&mut self, lo: u32, hi: u32, a: u32, b: Option<u32>) {
        let id = EdgeId(self.edge_vertices.len() as u32);
        self.edge_vertices.push([VertexId(lo), VertexId(hi)]);
        self.edge_triangles.push([a / 3, b.map_or(Self::NONE, |b| b / 3)]);
        self.triangle_edges[a as usize / 3][a as usize % 3] = id;
        if let Some(b) = b {
            self.triangle_edges[b as usize / 3][b as usize % 3] = id;
            self.opposite[a as usize] = b;
            self.opposite[b as usize] = a;
        }
    }

    pub fn edge_count(&self) -> usize {
        self.edge_vertices.len()
    }

    pub fn triangle_count(&self) -> usize {
        self.triangle_edges.len()
    }

    /// Whether every edge has a triangle on both sides.
    pub fn is_closed(&self) -> bool {
        self.edge_triangles.iter().all(|t| t[1] != Self::NONE)
    }

    /// Checks everything that [`Topology::build`] promises about `triangles`.
    ///
    /// # Panics
    /// If something does not hold.
    pub fn sanity_check(&self, triangles: &[[u32; 3]]) {
        assert_eq!(self.triangle_edges.len(), triangles.len());
        assert_eq!(self.opposite.len(), 3 * triangles.len());
        assert_eq!(self.edge_vertices.len(), self.edge_triangles.len());
        let mut sides = vec![0usize; self.edge_count()];
        for (t, tri) in triangles.iter().enumerate() {
            for c in 0..3 {
                let (a, b) = (tri[c], tri[(c + 1) % 3]);
                let e = self.triangle_edges[t][c].0 as usize;
                sides[e] += 1;
                assert_eq!(self.edge_vertices[e], [VertexId(a.min(b)), VertexId(a.max(b))], "triangle {t} edge {c}");
                assert!(self.edge_triangles[e].contains(&(t as u32)), "edge {e} does not know triangle {t}");
                let h = (3 * t + c) as u32;
                let o = self.opposite[h as usize];
                if o == Self::NONE {
                    assert_eq!(self.edge_triangles[e], [t as u32, Self::NONE]);
                } else {
                    assert_ne!(o, h);
                    assert_eq!(self.opposite[o as usize], h, "opposite is mutual");
                    assert_eq!(
                        self.triangle_edges[o as usize / 3][o as usize % 3].0 as usize,
                        e,
                        "one edge, two sides"
                    );
                    let mut both = [t as u32, o / 3];
                    let mut listed = self.edge_triangles[e];
                    both.sort_unstable();
                    listed.sort_unstable();
                    assert_eq!(both, listed);
                }
            }
        }
        for (e, &n) in sides.iter().enumerate() {
            assert_eq!(n, if self.edge_triangles[e][1] == Self::NONE { 1 } else { 2 }, "edge {e}");
        }
        // at most one boundary edge per pair of vertices, whatever the number of faces there
        assert!(self.edge_vertices.is_sorted());
        for e in 1..self.edge_count() {
            let open = |e: usize| self.edge_triangles[e][1] == Self::NONE;
            assert!(self.edge_vertices[e] != self.edge_vertices[e - 1] || !open(e) || !open(e - 1));
        }
    }
}

/// Buckets hold about six words, where insertion beats a general sort.
fn sort_small(words: &mut [u64]) {
    if words.len() > 24 {
        words.sort_unstable();
        return;
    }
    for i in 1..words.len() {
        let w = words[i];
        let mut j = i;
        while j > 0 && words[j - 1] > w {
            words[j] = words[j - 1];
            j -= 1;
        }
        words[j] = w;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

    fn build(vertices: usize, triangles: &[[u32; 3]]) -> Topology {
        let t = Topology::build(vertices, triangles);
        t.sanity_check(triangles);
        t
    }

    #[test]
    fn a_tetrahedron_has_six_edges_and_no_boundary() {
        let t = build(4, &TETRAHEDRON);
        assert_eq!((t.edge_count(), t.is_closed()), (6, true));
        let from = |h: u32| TETRAHEDRON[h as usize / 3][h as usize % 3];
        let to = |h: u32| TETRAHEDRON[h as usize / 3][(h as usize % 3 + 1) % 3];
        for h in 0..12 {
            let o = t.opposite[h as usize];
            assert_eq!((from(h), to(h)), (to(o), from(o)));
        }
        for (v, s) in t.edge_vertices.iter().zip(&t.edge_triangles) {
            let first = TETRAHEDRON[s[0] as usize];
            let at = first.iter().position(|&x| x == v[0].0).expect("the edge's triangle has its vertex");
            assert_eq!(first[(at + 1) % 3], v[1].0, "the first triangle runs from the lower to the upper vertex");
        }
    }

    #[test]
    fn one_triangle_and_no_triangle() {
        let t = build(3, &[[2, 0, 1]]);
        assert_eq!(t.edge_count(), 3);
        assert!(t.opposite.iter().all(|&o| o == Topology::NONE) && !t.is_closed());
        assert_eq!(build(0, &[]).edge_count(), 0);
        assert_eq!(build(7, &[]).vertex_count, 7);
    }

    #[test]
    fn four_faces_at_an_edge_are_two_edges_paired_by_direction() {
        // two sheets that cross in the edge 0-1
        let tris = [[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 0, 5]];
        let t = build(6, &tris);
        let at: Vec<_> = (0..t.edge_count()).filter(|&e| t.edge_vertices[e] == [VertexId(0), VertexId(1)]).collect();
        assert_eq!(at.len(), 2);
        assert_eq!([t.edge_triangles[at[0]], t.edge_triangles[at[1]]], [[0, 1], [2, 3]]);
    }

    #[test]
    fn faces_that_run_the_same_way_are_still_paired() {
        let t = build(4, &[[0, 1, 2], [0, 1, 3]]);
        assert_eq!((t.opposite[0], t.opposite[3]), (3, 0));
        // three duplicates of one face: two are paired, the third has a boundary
        let t = build(3, &[[0, 1, 2], [1, 2, 0], [2, 0, 1]]);
        assert_eq!(t.opposite.iter().filter(|&&o| o == Topology::NONE).count(), 3);
        // a face and its mirror image close each other
        assert!(build(3, &[[0, 1, 2], [0, 2, 1]]).is_closed());
    }

    #[test]
    #[should_panic(expected = "of 3 vertices")]
    fn an_index_out_of_range_is_a_bug_of_the_caller() {
        Topology::build(3, &[[0, 1, 3]]);
    }

    proptest! {
        #[test]
        fn any_list_of_triangles_gives_sound_lists(tris in proptest::collection::vec([0u32..9, 0u32..9, 0u32..9], 0..60)) {
            let t = build(9, &tris);
            // an edge is a boundary exactly if an odd number of half-edges join its vertices
            for a in 0..9u32 {
                for b in a..9u32 {
                    let n = tris.iter().flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])])
                        .filter(|&(p, q)| (p.min(q), p.max(q)) == (a, b)).count();
                    let open = (0..t.edge_count()).filter(|&e| {
                        t.edge_vertices[e] == [VertexId(a), VertexId(b)] && t.edge_triangles[e][1] == Topology::NONE
                    }).count();
                    prop_assert_eq!(open, n % 2);
                }
            }
        }
    }
}

//! What a mesh is and what is wrong with it.
//!
//! # Theory
//!
//! A clean solid is closed (each edge has two triangles), manifold (the triangles at each vertex form one fan),
//! consistently oriented (the two triangles run their edge in opposite directions), faces outward, and does not meet
//! itself. Slicing needs the first and takes the rest for granted.
//!
//! # Practice
//!
//! Connectivity is judged after exact welding ([`TriMesh::welded`]), for files without indices and with seams. A triangle
//! counts as self-intersecting if it shares a point with another that has no edge in common with it, beyond a vertex that
//! both have; or if it has a duplicate. The signs behind this are exact, so the number depends on nothing but the
//! positions. Degenerate triangles are left out of it and counted on their own.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use glam::DVec3;
use rayon::prelude::*;

use super::bvh::{Aabb, Bvh};
use super::exact::{degenerate, segment_meets_triangle, side, triangles_meet};
use super::{Topology, TriMesh};

/// Facts of a surface mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshReport {
    /// As stored.
    pub vertices: usize,
    /// As stored.
    pub triangles: usize,
    /// Different positions that a triangle uses.
    pub welded_vertices: usize,
    /// Parts that are joined by common vertices.
    pub components: usize,
    /// Every edge has exactly two triangles.
    pub closed: bool,
    /// No edge has more than two triangles, and the triangles at each vertex form one fan.
    pub manifold: bool,
    /// Triangles on both sides of an edge agree which side is out.
    pub oriented: bool,
    /// Closed and oriented, but the volume is negative.
    pub inside_out: bool,
    /// V - E + F: 2 for each closed part without handles, 2 less for each handle. V is `welded_vertices`.
    pub euler: i64,
    /// Edges with one triangle.
    pub boundary_edges: usize,
    /// Edges with more than two triangles.
    pub non_manifold_edges: usize,
    /// Vertices whose triangles form more than one fan.
    pub non_manifold_vertices: usize,
    /// Edges whose two triangles disagree about which side is out.
    pub misoriented_edges: usize,
    /// Triangles whose corners lie on one line.
    pub degenerate_triangles: usize,
    /// Triangles with the same three vertices as one before them.
    pub duplicate_triangles: usize,
    /// Positions that no triangle uses.
    pub unreferenced_vertices: usize,
    /// Vertices with a coordinate that is infinite or not a number.
    pub non_finite_vertices: usize,
    /// Triangles that meet one that is not their neighbour.
    pub self_intersections: usize,
    /// Signed; of an open mesh it means little, and is taken about the world's origin, as is the custom.
    pub volume: f64,
    pub area: f64,
    /// Lower and upper corner; `None` without vertices.
    pub bounds: Option<(DVec3, DVec3)>,
    defects: Vec<Defect>,
}

/// One way in which a mesh is not a clean solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Defect {
    pub kind: DefectKind,
    /// How many edges, vertices or triangles are concerned.
    pub count: usize,
    /// Where the first of them is.
    pub place: DVec3,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DefectKind {
    /// Vertices that are not finite.
    NonFinite,
    /// Edges with one triangle: the mesh has holes.
    Boundary,
    /// Edges with more than two triangles.
    NonManifoldEdge,
    /// Vertices where separate parts of the surface touch.
    NonManifoldVertex,
    /// Edges whose triangles disagree about which side is out.
    Misoriented,
    /// The triangles face inward.
    InsideOut,
    /// Triangles without area.
    Degenerate,
    /// Triangles that are there twice.
    Duplicate,
    /// Triangles that meet others.
    SelfIntersection,
}

impl DefectKind {
    /// Whether slices through the place may come out open, wrong, or not as the parts were meant (the others are only
    /// worth knowing).
    pub fn spoils_slices(self) -> bool {
        use DefectKind::{Boundary, Misoriented, NonFinite, NonManifoldEdge, SelfIntersection};
        matches!(self, NonFinite | Boundary | NonManifoldEdge | Misoriented | SelfIntersection)
    }
}

impl fmt::Display for Defect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let p = self.place;
        let (n, one) = (self.count, self.count == 1);
        let many = |single: &str, plural: &str| if one { format!("1 {single}") } else { format!("{n} {plural}") };
        let what = match self.kind {
            DefectKind::NonFinite => many("vertex is not finite", "vertices are not finite"),
            DefectKind::Boundary => {
                many("edge has a triangle on one side only (a hole)", "edges have a triangle on one side only (holes)")
            }
            DefectKind::NonManifoldEdge => {
                many("edge has more than two triangles", "edges have more than two triangles")
            }
            DefectKind::NonManifoldVertex => {
                many("vertex joins separate sheets of the surface", "vertices join separate sheets of the surface")
            }
            DefectKind::Misoriented => {
                many("edge has triangles that face opposite ways", "edges have triangles that face opposite ways")
            }
            DefectKind::InsideOut => "the triangles face inward, so the volume is negative".to_owned(),
            DefectKind::Degenerate => many("triangle has no area", "triangles have no area"),
            DefectKind::Duplicate => many("triangle is there twice", "triangles are there twice"),
            DefectKind::SelfIntersection => many(
                "triangle cuts through another part of the surface",
                "triangles cut through other parts of the surface",
            ),
        };
        write!(f, "{what}, {} ({:.6}, {:.6}, {:.6})", if one { "at" } else { "the first at" }, p.x, p.y, p.z)
    }
}

impl MeshReport {
    /// Looks at everything. Most of the time, about a microsecond per triangle, goes into self-intersections.
    pub fn of(mesh: &TriMesh) -> Self {
        Self::look(mesh, true)
    }

    /// All but the self-intersections, which stay 0: several times as fast.
    pub fn of_connectivity(mesh: &TriMesh) -> Self {
        Self::look(mesh, false)
    }

    /// `self_intersections` stays 0 if `crossings` are not looked for.
    fn look(mesh: &TriMesh, crossings: bool) -> Self {
        let welded = mesh.welded();
        let topology = Topology::build(welded.positions.len(), &welded.triangles);
        let at = |v: u32| welded.positions[v as usize];
        let middle = |t: u32| welded.triangles[t as usize].iter().map(|&v| at(v)).sum::<DVec3>() / 3.0;
        let mut defects = Vec::new();
        let mut note = |kind, count: usize, place: Option<DVec3>| {
            if let Some(place) = place {
                defects.push(Defect { kind, count, place });
            }
            count
        };

        let mut bad = welded.positions.iter().filter(|p| !p.is_finite());
        let first = bad.next().copied();
        let non_finite_vertices = note(DefectKind::NonFinite, bad.count() + usize::from(first.is_some()), first);

        let edges = EdgeFacts::of(&topology, &welded.triangles);
        let between = |e: Option<usize>| e.map(|e| topology.edge_vertices[e]).map(|[a, b]| (at(a.0) + at(b.0)) / 2.0);
        let boundary_edges = note(DefectKind::Boundary, edges.boundary.0, between(edges.boundary.1));
        let non_manifold_edges = note(DefectKind::NonManifoldEdge, edges.crowded.0, between(edges.crowded.1));
        let misoriented_edges = note(DefectKind::Misoriented, edges.misoriented.0, between(edges.misoriented.1));

        let fans = Fans::of(&topology, &welded.triangles);
        let first = fans.split.first().map(|&v| at(v));
        let non_manifold_vertices = note(DefectKind::NonManifoldVertex, fans.split.len(), first);

        let (area, bounds) = (mesh.area(), mesh.bounds());
        let closed = boundary_edges == 0 && non_manifold_edges == 0 && !welded.triangles.is_empty();
        let volume = if closed { mesh.volume() } else { volume_about_origin(mesh) };
        let oriented = misoriented_edges == 0;
        let inside_out = closed && oriented && volume < 0.0;
        note(DefectKind::InsideOut, usize::from(inside_out), if inside_out { Some(middle(0)) } else { None });

        let flat: Vec<bool> = welded.triangles.par_iter().map(|t| degenerate(t.map(at))).collect();
        let first = flat.iter().position(|&f| f).map(|t| middle(t as u32));
        let degenerate_triangles = note(DefectKind::Degenerate, flat.iter().filter(|&&f| f).count(), first);

        let copies = duplicates(&welded.triangles);
        let duplicate_triangles = note(DefectKind::Duplicate, copies.len(), copies.first().map(|&t| middle(t)));

        let hits = if crossings && non_finite_vertices == 0 { self_intersecting(&welded, &flat) } else { Vec::new() };
        let self_intersections = note(DefectKind::SelfIntersection, hits.len(), hits.first().map(|&t| middle(t)));

        Self {
            vertices: mesh.positions.len(),
            triangles: mesh.triangles.len(),
            welded_vertices: fans.used,
            components: components(welded.positions.len(), &welded.triangles),
            closed,
            manifold: non_manifold_edges == 0 && non_manifold_vertices == 0,
            oriented,
            inside_out,
            euler: fans.used as i64 - edges.distinct as i64 + welded.triangles.len() as i64,
            boundary_edges,
            non_manifold_edges,
            non_manifold_vertices,
            misoriented_edges,
            degenerate_triangles,
            duplicate_triangles,
            unreferenced_vertices: welded.positions.len() - fans.used,
            non_finite_vertices,
            self_intersections,
            volume,
            area,
            bounds,
            defects,
        }
    }

    /// What keeps the mesh from being a clean solid, each a sentence with its place when displayed; empty for a clean one.
    pub fn defects(&self) -> &[Defect] {
        &self.defects
    }

    /// Closed, manifold, oriented, facing outward and not meeting itself.
    pub fn is_clean_solid(&self) -> bool {
        self.closed && self.defects.is_empty()
    }
}

/// Only those defects that [spoil slices](DefectKind::spoils_slices).
///
/// Every pair of triangles with boxes that overlap is looked at. On one thread it takes two or three times as long as
/// parsing the text of the mesh's file; the work is shared among all threads.
pub fn slicing_defects(mesh: &TriMesh) -> Vec<Defect> {
    MeshReport::of(mesh).defects.into_iter().filter(|d| d.kind.spoils_slices()).collect()
}

/// Whether a mesh with these defects has parts that overlap, and sections that can be united. Where triangles disagree
/// which side is out, directions of contours say nothing, and there is nothing to unite them by.
pub fn overlaps(defects: &[Defect]) -> bool {
    let has = |kind| defects.iter().any(|d| d.kind == kind);
    has(DefectKind::SelfIntersection) && !has(DefectKind::Misoriented)
}

fn volume_about_origin(mesh: &TriMesh) -> f64 {
    let p = |i: u32| mesh.positions[i as usize];
    mesh.triangles.iter().map(|t| p(t[0]).cross(p(t[1])).dot(p(t[2]))).sum::<f64>() / 6.0
}

/// Number of cases, and the first.
type Cases = (usize, Option<usize>);

#[derive(Default)]
struct EdgeFacts {
    distinct: usize,
    boundary: Cases,
    crowded: Cases,
    misoriented: Cases,
}

impl EdgeFacts {
    /// Edges of the topology have at most two triangles each; here those between the same two vertices count as one.
    fn of(topology: &Topology, triangles: &[[u32; 3]]) -> Self {
        let mut facts = Self::default();
        let mut e = 0;
        for group in topology.edge_vertices.chunk_by(|a, b| a == b) {
            let first = e;
            e += group.len();
            if group[0][0] == group[0][1] {
                continue;
            }
            facts.distinct += 1;
            let faces: usize =
                topology.edge_triangles[first..e].iter().map(|t| 1 + usize::from(t[1] != Topology::NONE)).sum();
            let case = match faces {
                1 => &mut facts.boundary,
                2 if same_way(topology, triangles, first) => &mut facts.misoriented,
                2 => continue,
                _ => &mut facts.crowded,
            };
            case.0 += 1;
            case.1.get_or_insert(first);
        }
        facts
    }
}

/// Whether both triangles of edge `e` run it in the same direction.
fn same_way(topology: &Topology, triangles: &[[u32; 3]], e: usize) -> bool {
    let [a, b] = topology.edge_vertices[e];
    let rises = |t: u32| {
        let t = triangles[t as usize];
        (0..3).any(|c| t[c] == a.0 && t[(c + 1) % 3] == b.0)
    };
    let [s, t] = topology.edge_triangles[e];
    // a triangle that names a vertex twice runs the edge both ways
    s != t && rises(s) == rises(t)
}

struct Fans {
    /// Vertices in use.
    used: usize,
    /// Vertices with more than one fan of triangles.
    split: Vec<u32>,
}

impl Fans {
    fn of(topology: &Topology, triangles: &[[u32; 3]]) -> Self {
        // corners joined across edges are in one fan
        let mut sets = DisjointSets::new(3 * triangles.len());
        for (h, &o) in topology.opposite.iter().enumerate() {
            if o == Topology::NONE || (o as usize) < h {
                continue;
            }
            let ends = |h: usize| [h, h - h % 3 + (h % 3 + 1) % 3];
            for a in ends(h) {
                for b in ends(o as usize) {
                    if triangles[a / 3][a % 3] == triangles[b / 3][b % 3] {
                        sets.join(a as u32, b as u32);
                    }
                }
            }
        }
        let mut fan = vec![u32::MAX; topology.vertex_count];
        let mut split = vec![false; topology.vertex_count];
        for corner in 0..3 * triangles.len() {
            let v = triangles[corner / 3][corner % 3] as usize;
            let root = sets.root(corner as u32);
            if fan[v] == u32::MAX {
                fan[v] = root;
            }
            split[v] |= fan[v] != root;
        }
        Self {
            used: fan.iter().filter(|&&f| f != u32::MAX).count(),
            split: (0..topology.vertex_count as u32).filter(|&v| split[v as usize]).collect(),
        }
    }
}

fn components(vertices: usize, triangles: &[[u32; 3]]) -> usize {
    let mut sets = DisjointSets::new(vertices);
    for t in triangles {
        sets.join(t[0], t[1]);
        sets.join(t[1], t[2]);
    }
    let mut roots: Vec<u32> = triangles.iter().map(|t| sets.root(t[0])).collect();
    roots.sort_unstable();
    roots.dedup();
    roots.len()
}

/// Triangles whose three vertices are those of an earlier one.
fn duplicates(triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut sorted: Vec<([u32; 3], u32)> = (triangles.iter().zip(0..))
        .map(|(t, i)| {
            let mut t = *t;
            t.sort_unstable();
            (t, i)
        })
        .collect();
    sorted.par_sort_unstable();
    let mut copies: Vec<u32> = sorted.windows(2).filter(|w| w[0].0 == w[1].0).map(|w| w[1].1).collect();
    copies.sort_unstable();
    copies
}

/// The triangles, in order, that meet another one which is not their neighbour. `flat` ones are passed over.
pub(super) fn self_intersecting(mesh: &TriMesh, flat: &[bool]) -> Vec<u32> {
    let corners = |t: u32| mesh.triangles[t as usize].map(|v| mesh.positions[v as usize]);
    let n = mesh.triangles.len() as u32;
    let tree = Bvh::new((0..n).map(|t| Aabb::around(&corners(t))).collect());
    let hit: Vec<AtomicBool> = flat.iter().map(|_| AtomicBool::new(false)).collect();
    // flags are only ever set, so their order does not matter
    tree.overlapping_pairs(&|s, t| {
        if !flat[s as usize] && !flat[t as usize] && pair_intersects(mesh, s, t) {
            hit[s as usize].store(true, Relaxed);
            hit[t as usize].store(true, Relaxed);
        }
    });
    (0..n).filter(|&t| hit[t as usize].load(Relaxed)).collect()
}

fn pair_intersects(mesh: &TriMesh, s: u32, t: u32) -> bool {
    let (a, b) = (mesh.triangles[s as usize], mesh.triangles[t as usize]);
    let at = |t: [u32; 3]| t.map(|v| mesh.positions[v as usize]);
    let shared = a.iter().filter(|v| b.contains(v)).count();
    match shared {
        0 => triangles_meet(at(a), at(b)),
        1 => {
            // what two triangles share beyond their common corner reaches the opposite side of one of them
            let opposite = |t: [u32; 3], other: [u32; 3]| {
                let c = t.iter().position(|v| other.contains(v)).unwrap_or(0);
                let p = at(t);
                [p[(c + 1) % 3], p[(c + 2) % 3]]
            };
            let (from_a, from_b) = (opposite(a, b), opposite(b, a));
            let (a, b) = (at(a), at(b));
            let near = |segment: [DVec3; 2], t: [DVec3; 3]| Aabb::around(&segment).overlaps(&Aabb::around(&t));
            if !near(from_a, b) && !near(from_b, a) {
                return false;
            }
            // a triangle that rises to one side of the other's plane has nothing but the corner in common with it
            let rises = |[p, q]: [DVec3; 2], t: [DVec3; 3]| {
                let (p, q) = (side(t, p), side(t, q));
                (p > 0.0 && q > 0.0) || (p < 0.0 && q < 0.0)
            };
            if rises(from_a, b) || rises(from_b, a) {
                return false;
            }
            segment_meets_triangle(from_a, b) || segment_meets_triangle(from_b, a)
        }
        2 => false,
        _ => true,
    }
}

/// Union-find with path halving.
pub(super) struct DisjointSets(Vec<u32>);

impl DisjointSets {
    pub fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    pub fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            let up = self.0[self.0[i as usize] as usize];
            self.0[i as usize] = up;
            i = up;
        }
        i
    }

    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        // towards the smaller index, so that the result does not depend on the order
        self.0[a.max(b) as usize] = a.min(b);
    }
}

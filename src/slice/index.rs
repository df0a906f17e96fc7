use std::ops::Range;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::Slices;
use super::walk::Walker;
use crate::math::PlaneFrame;
use crate::mesh::Topology;

/// Parallel planes at equal distances: plane k lies at height `first + k * step` along the normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Planes {
    pub frame: PlaneFrame,
    /// Height of plane 0.
    pub first: f64,
    /// Distance of neighbours, not negative.
    pub step: f64,
    pub count: usize,
}

impl Planes {
    /// Planes in the middle of `count` slabs of equal thickness between two heights.
    pub fn between(frame: PlaneFrame, lo: f64, hi: f64, count: usize) -> Self {
        let step = if count == 0 { 0.0 } else { (hi - lo) / count as f64 };
        Self { frame, first: lo + 0.5 * step, step, count }
    }

    /// The same over the extent of `positions`; no planes if none of them is finite.
    pub fn across(frame: PlaneFrame, positions: &[DVec3], count: usize) -> Self {
        let (lo, hi) = positions
            .iter()
            .map(|p| frame.height(*p))
            .filter(|h| h.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), h| (lo.min(h), hi.max(h)));
        if lo <= hi { Self::between(frame, lo, hi, count) } else { Self::between(frame, 0.0, 0.0, 0) }
    }

    /// Height of plane `k`.
    pub fn height(&self, k: usize) -> f64 {
        self.first + k as f64 * self.step
    }

    /// How many planes lie at or below `height`; none if it is not a number. Exact with respect to [`Planes::height`].
    pub fn below(&self, height: f64) -> u32 {
        if height.is_nan() || height < self.first || self.count == 0 {
            return 0;
        }
        // the guess is off by one at most, unless the step drowns in the heights' rounding
        let guess = (height - self.first) / self.step;
        let mut n = if guess < self.count as f64 { guess as usize + 1 } else { self.count };
        while n < self.count && self.height(n) <= height {
            n += 1;
        }
        while n > 0 && self.height(n - 1) > height {
            n -= 1;
        }
        n as u32
    }
}

/// A vertex as the walk reads it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Projected {
    pub height: f64,
    pub at: DVec2,
}

/// An edge in a bucket list.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Entry {
    /// Its vertices under and above the planes that it crosses.
    pub below: u32,
    pub above: u32,
    /// The plane after the last that it crosses.
    pub end: u32,
    /// The triangles on both sides, the number of triangles where there is none. In a well oriented mesh the contour
    /// leaves the first through this edge and enters the second.
    pub from: u32,
    pub to: u32,
}

/// The bucket lists of a run of edges: one for each plane, with the edges that become active there.
#[derive(Debug, Default)]
pub(super) struct Part {
    /// `entries[start[k]..start[k + 1]]` become active at plane k.
    pub start: Vec<u32>,
    pub entries: Vec<Entry>,
    /// How many edges begin and end at each plane.
    begin: Vec<u32>,
    end: Vec<u32>,
    /// Whether some edge has a triangle on one side only.
    pub open: bool,
}

/// What depends on mesh and view: the vertices seen from it, and which edges each plane crosses.
#[derive(Debug, Default)]
pub struct SlabIndex {
    pub(super) planes: Option<Planes>,
    pub(super) triangles: u32,
    pub(super) projected: Vec<Projected>,
    /// For each vertex the number of planes at or below it: plane k has it above exactly if k is less.
    pub(super) slab: Vec<u32>,
    pub(super) parts: Vec<Part>,
    /// First point of each plane, and the number of points.
    pub(super) first_point: Vec<u32>,
    /// Planes at which runs of consecutive planes begin, and the number of planes.
    pub(super) runs: Vec<u32>,
    /// For each plane where the next run begins.
    next_run: Vec<u32>,
    pub(super) walker: Walker,
}

/// Planes that are let in.
const MOST_PLANES: usize = 1 << 22;
/// Points in all planes together that are let in: 4 GiB of coordinates.
const MOST_POINTS: u64 = 1 << 28;

/// Why a mesh could not be cut.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SliceError {
    #[error("{0} planes are more than the {MOST_PLANES} that can be cut at once; ask for fewer")]
    TooManyPlanes(usize),
    #[error("the sections have {0} points, more than the {MOST_POINTS} that fit; ask for fewer planes")]
    TooManyPoints(u64),
}

/// Meshes and sections below these sizes are not worth waking a second thread.
const VERTICES_PER_TASK: usize = 8192;
const EDGES_PER_PART: usize = 16384;
const POINTS_PER_RUN: usize = 4096;

impl SlabIndex {
    /// Sorts the edges of a mesh into the slabs of a view. Linear in the size of the mesh and the number of planes.
    ///
    /// # Errors
    /// [`SliceError::TooManyPoints`]: then the index is empty.
    ///
    /// # Panics
    /// If `topology` has more vertices than there are positions.
    pub fn build(&mut self, positions: &[DVec3], topology: &Topology, planes: &Planes) -> Result<(), SliceError> {
        assert!(topology.vertex_count <= positions.len(), "the topology has more vertices than there are positions");
        if planes.count > MOST_PLANES {
            return Err(SliceError::TooManyPlanes(planes.count));
        }
        self.planes = Some(*planes);
        self.triangles = topology.triangle_count() as u32;
        self.project(positions, planes);
        let threads = rayon::current_num_threads();

        // count: how many edges begin and end at each plane
        let edges = topology.edge_count();
        let parts = edges.div_ceil(EDGES_PER_PART).clamp(1, threads);
        let per_part = edges.div_ceil(parts);
        self.parts.resize_with(parts, Part::default);
        let slab = &self.slab;
        let of_part = |i: usize| (i * per_part).min(edges)..((i + 1) * per_part).min(edges);
        each(&mut self.parts, |i, part| part.count(topology, of_part(i), slab, planes.count));

        // a contour has a point on each edge that it crosses
        self.first_point.clear();
        self.first_point.push(0);
        let (mut crossings, mut total) = (0u64, 0u64);
        for k in 0..planes.count {
            for p in &self.parts {
                crossings = crossings + u64::from(p.begin[k]) - u64::from(p.end[k]);
            }
            total += crossings;
            self.first_point.push(total.min(u64::from(u32::MAX)) as u32);
        }
        if total > MOST_POINTS {
            *self = Self::default();
            return Err(SliceError::TooManyPoints(total));
        }

        // runs of planes with about equally many points
        let runs = (total as usize / POINTS_PER_RUN).clamp(1, if threads > 1 { 4 * threads } else { 1 });
        self.runs.clear();
        self.runs.push(0);
        for r in 1..runs as u64 {
            let wanted = (total * r / runs as u64) as u32;
            self.runs.push((self.first_point.partition_point(|&p| p <= wanted) - 1) as u32);
        }
        self.runs.push(planes.count as u32);
        self.runs.dedup();
        self.next_run.clear();
        for r in self.runs.windows(2) {
            self.next_run.resize(r[1] as usize, r[1]);
        }
        let (slab, next_run) = (&self.slab, &self.next_run);
        each(&mut self.parts, |i, part| part.fill(topology, of_part(i), slab, next_run));
        Ok(())
    }

    /// The planes that the index was built for.
    pub fn planes(&self) -> Option<&Planes> {
        self.planes.as_ref()
    }

    /// Follows all contours. They are not nested yet.
    pub fn contours(&mut self, out: &mut Slices) {
        let mut walker = std::mem::take(&mut self.walker);
        walker.walk(self, out);
        self.walker = walker;
    }

    fn project(&mut self, positions: &[DVec3], planes: &Planes) {
        self.projected.resize(positions.len(), Projected::default());
        self.slab.resize(positions.len(), 0);
        let frame = planes.frame;
        let one = |p: &DVec3, v: &mut Projected, slab: &mut u32| {
            let height = frame.height(*p);
            *v = Projected { height, at: frame.project(*p) };
            *slab = planes.below(height);
        };
        if positions.len() <= VERTICES_PER_TASK {
            for ((p, v), s) in positions.iter().zip(&mut self.projected).zip(&mut self.slab) {
                one(p, v, s);
            }
        } else {
            (positions.par_iter(), self.projected.par_iter_mut(), self.slab.par_iter_mut())
                .into_par_iter()
                .with_min_len(VERTICES_PER_TASK)
                .for_each(|(p, v, s)| one(p, v, s));
        }
    }
}

/// Runs `work` on each part, in parallel if there are several.
fn each(parts: &mut [Part], work: impl Fn(usize, &mut Part) + Sync) {
    match parts {
        [part] => work(0, part),
        _ => parts.par_iter_mut().enumerate().for_each(|(i, part)| work(i, part)),
    }
}

impl Part {
    fn count(&mut self, topology: &Topology, edges: Range<usize>, slab: &[u32], planes: usize) {
        for counts in [&mut self.begin, &mut self.end] {
            counts.clear();
            counts.resize(planes + 1, 0);
        }
        for [a, b] in &topology.edge_vertices[edges.clone()] {
            let (a, b) = (slab[a.0 as usize], slab[b.0 as usize]);
            let (from, to) = (a.min(b), a.max(b));
            // without a branch: which edges are crossed is hard to foresee
            let crossed = u32::from(from < to);
            self.begin[from as usize] += crossed;
            self.end[to as usize] += crossed;
        }
        self.open = topology.edge_triangles[edges].iter().any(|t| t[1] == Topology::NONE);
    }

    /// An edge that spans several runs is listed in each, so that each run starts in time proportional to its crossings.
    fn fill(&mut self, topology: &Topology, edges: Range<usize>, slab: &[u32], next_run: &[u32]) {
        let planes = next_run.len();
        self.start.clear();
        self.start.resize(planes + 2, 0);
        let (mut active, mut sum) = (0u32, 0u32);
        for k in 0..planes {
            active -= self.end[k];
            sum += self.begin[k];
            if k > 0 && next_run[k - 1] as usize == k {
                sum += active;
            }
            active += self.begin[k];
            // shifted by one: filling moves each start to the place where the next begins
            self.start[k + 2] = sum;
        }
        self.entries.resize(sum as usize, Entry::default());
        let none = topology.triangle_count() as u32;
        let sides = &topology.edge_triangles[edges.clone()];
        for ([a, b], sides) in topology.edge_vertices[edges].iter().zip(sides) {
            let (sa, sb) = (slab[a.0 as usize], slab[b.0 as usize]);
            if sa == sb {
                continue;
            }
            let (left, right) = (sides[0], sides[1].min(none));
            // the first triangle runs from the first vertex to the second
            let (first, entry) = if sa < sb {
                (sa, Entry { below: a.0, above: b.0, end: sb, from: left, to: right })
            } else {
                (sb, Entry { below: b.0, above: a.0, end: sa, from: right, to: left })
            };
            let mut k = first;
            while k < entry.end {
                let slot = &mut self.start[k as usize + 1];
                self.entries[*slot as usize] = entry;
                *slot += 1;
                k = next_run[k as usize];
            }
        }
    }
}

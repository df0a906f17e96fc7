//! The contour walk.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use glam::DVec2;

use super::index::{Entry, Projected};
use super::{Defect, Defects, SlabIndex, Slices, note};

/// What the walk keeps from view to view.
#[derive(Debug, Default)]
pub(super) struct Walker {
    /// For each thread and triangle the two active edges of the triangle, as one number: their positions in the active
    /// list, exclusive-ored. Who comes from one finds the other. Zero between planes.
    links: Vec<Mutex<Vec<u32>>>,
    runs: Vec<Run>,
}

/// The loops of a run of consecutive planes.
#[derive(Debug, Default)]
struct Run {
    planes: Range<usize>,
    active: Vec<Entry>,
    /// Tags of the active edges: the last plane, counted from one, whose contours met them.
    tags: Vec<u32>,
    loop_end: Vec<u32>,
    area: Vec<f64>,
    loops_of_plane: Vec<u32>,
    defects: Defects,
}

impl Walker {
    pub fn walk(&mut self, index: &SlabIndex, out: &mut Slices) {
        self.links.resize_with(rayon::current_num_threads().max(1), Mutex::default);
        self.runs.resize_with(index.runs.len().saturating_sub(1), Run::default);
        for (run, ends) in self.runs.iter_mut().zip(index.runs.windows(2)) {
            run.planes = ends[0] as usize..ends[1] as usize;
        }
        out.points.resize(index.first_point.last().map_or(0, |n| *n as usize), DVec2::ZERO);
        walk_runs(&mut self.runs, &mut out.points, 0, index, &self.links);

        out.loop_start.clear();
        out.plane_start.clear();
        out.area.clear();
        out.owner.clear();
        out.defects = Defects::default();
        out.loop_start.push(0);
        out.plane_start.push(0);
        let mut loops = 0;
        for run in &self.runs {
            out.loop_start.extend_from_slice(&run.loop_end);
            out.area.extend_from_slice(&run.area);
            out.plane_start.extend(run.loops_of_plane.iter().map(|n| {
                loops += n;
                loops
            }));
            for w in run.defects.iter().flatten() {
                note(&mut out.defects, w.defect, w.plane, w.at, w.count);
            }
        }
    }
}

/// Halves the runs, and the points with them, until each thread has one.
fn walk_runs(runs: &mut [Run], points: &mut [DVec2], first: u32, index: &SlabIndex, links: &[Mutex<Vec<u32>>]) {
    match runs {
        [] => {}
        [run] => {
            let slot = rayon::current_thread_index().unwrap_or(0) % links.len();
            let mut links = links[slot].lock().unwrap_or_else(PoisonError::into_inner);
            run.walk(points, first, index, &mut links);
        }
        _ => {
            let (left, right) = runs.split_at_mut(runs.len() / 2);
            let middle = index.first_point[right[0].planes.start];
            let (a, b) = points.split_at_mut((middle - first) as usize);
            rayon::join(|| walk_runs(left, a, first, index, links), || walk_runs(right, b, middle, index, links));
        }
    }
}

#[inline]
fn point(projected: &[Projected], e: &Entry, height: f64) -> DVec2 {
    let (a, b) = (projected[e.below as usize], projected[e.above as usize]);
    let f = (height - a.height) / (b.height - a.height);
    // exact at both ends, so that planes through a vertex give the same point for all its edges
    a.at * (1.0 - f) + b.at * f
}

impl Run {
    /// `points` are those of this run; the first of them is number `first` of all.
    fn walk(&mut self, mut points: &mut [DVec2], mut first: u32, index: &SlabIndex, links: &mut Vec<u32>) {
        self.active.clear();
        self.tags.clear();
        self.loop_end.clear();
        self.area.clear();
        self.loops_of_plane.clear();
        self.defects = Defects::default();
        links.resize(index.triangles as usize + 1, 0);
        for k in self.planes.clone() {
            // what ended at this plane makes room
            let mut kept = 0;
            for i in 0..self.active.len() {
                let entry = self.active[i];
                self.active[kept] = entry;
                kept += usize::from(entry.end > k as u32);
            }
            self.active.truncate(kept);
            for part in &index.parts {
                self.active.extend_from_slice(&part.entries[part.start[k] as usize..part.start[k + 1] as usize]);
            }
            self.tags.resize(self.active.len().max(self.tags.len()), 0);
            let (of_plane, rest) = points.split_at_mut(self.active.len());
            self.plane(k, of_plane, first, index, links);
            first += of_plane.len() as u32;
            points = rest;
        }
    }

    fn plane(&mut self, k: usize, points: &mut [DVec2], first: u32, index: &SlabIndex, links: &mut [u32]) {
        let height = index.planes.as_ref().map_or(0.0, |p| p.height(k));
        let tag = k as u32 + 1;
        let none = index.triangles;
        for (i, e) in self.active.iter().enumerate() {
            links[e.from as usize] ^= i as u32;
            links[e.to as usize] ^= i as u32;
        }
        let loops = self.loop_end.len();
        let mut at = 0;
        // open contours first, from the end where a well oriented mesh is entered if there is one
        if index.parts.iter().any(|p| p.open) {
            for backward in [false, true] {
                for i in 0..self.active.len() {
                    let e = self.active[i];
                    let (outside, into) = if backward { (e.to, e.from) } else { (e.from, e.to) };
                    if outside == none && self.tags[i] != tag {
                        let end = self.follow(i, into, tag, height, &mut points[at..], index, links).0;
                        note(&mut self.defects, Defect::Open, k as u32, points[at], 1);
                        self.close(&mut points[at..at + end], k as u32);
                        at += end;
                        self.loop_end.push(first + at as u32);
                    }
                }
            }
            links[none as usize] = 0;
        }
        for i in 0..self.active.len() {
            if self.tags[i] == tag {
                continue;
            }
            let into = self.active[i].to;
            let (n, area) = self.follow(i, into, tag, height, &mut points[at..], index, links);
            if area.is_finite() {
                self.area.push(area);
            } else {
                self.close(&mut points[at..at + n], k as u32);
            }
            at += n;
            self.loop_end.push(first + at as u32);
        }
        debug_assert_eq!(at, points.len(), "every active edge is in one contour");
        self.loops_of_plane.push((self.loop_end.len() - loops) as u32);
    }

    /// Walks from active edge `start` into `triangle` until the contour closes or leaves the mesh. Returns the number of
    /// points and the signed area.
    #[allow(clippy::too_many_arguments)]
    #[inline]
    fn follow(
        &mut self,
        start: usize,
        mut triangle: u32,
        tag: u32,
        height: f64,
        points: &mut [DVec2],
        index: &SlabIndex,
        links: &mut [u32],
    ) -> (usize, f64) {
        let projected = &index.projected[..];
        let base = point(projected, &self.active[start], height);
        let (mut last, mut area) = (DVec2::ZERO, 0.0);
        let mut slot = start;
        self.tags[slot] = tag;
        points[0] = base;
        let mut n = 1;
        loop {
            if triangle == index.triangles {
                return (n, 0.5 * area);
            }
            let link = &mut links[triangle as usize];
            slot ^= *link as usize;
            *link = 0;
            if slot == start {
                return (n, 0.5 * area);
            }
            let e = &self.active[slot];
            triangle ^= e.from ^ e.to;
            self.tags[slot] = tag;
            let p = point(projected, e, height);
            points[n] = p;
            n += 1;
            area += last.perp_dot(p - base);
            last = p - base;
        }
    }

    /// Measures a loop that needs care: points that are not finite are replaced by a neighbour.
    fn close(&mut self, points: &mut [DVec2], k: u32) {
        let mut last = points.iter().copied().find(|p| p.is_finite()).unwrap_or_default();
        let mut area = shoelace(points);
        if !area.is_finite() {
            for p in points.iter_mut() {
                if !p.is_finite() {
                    *p = last;
                }
                last = *p;
            }
            note(&mut self.defects, Defect::NotFinite, k, last, 1);
            area = shoelace(points);
        }
        if !area.is_finite() {
            // coordinates too large to be multiplied
            points.fill(last);
            area = 0.0;
        }
        self.area.push(area);
    }
}

/// Signed area of a closed polygon.
pub(super) fn shoelace(points: &[DVec2]) -> f64 {
    let Some(&base) = points.first() else { return 0.0 };
    let twice: f64 = points.windows(2).map(|w| (w[0] - base).perp_dot(w[1] - base)).sum();
    0.5 * twice
}

//! L2: plane polygons with holes to triangles.
//!
//! # Theory
//!
//! Westermann and Rezk-Salama 2001, section 2.4, hand every contour with its inner contours to a tessellator; in their
//! measurements that took nine tenths of the time of a frame. Three tessellators do it here:
//!
//! * a sweep of our own ([`Method::Fast`]) that uses that the outlines of sections have many points but few turns; exact
//!   in its decisions, for outlines that do not touch or cross themselves;
//! * lyon ([`Method::Lyon`], and what the sweep cannot do): a general sweep in `f32`;
//! * spade's constrained Delaunay triangulation ([`Method::Quality`], and what the area check takes from lyon): in `f64`,
//!   well-shaped triangles, optionally refined.
//!
//! # Practice
//!
//! Triangles name points of the input by their index, so that no tessellator's rounding gets into the picture; lyon
//! sees coordinates centred and scaled to `[-1, 1]`. Points that had to be added (crossings, refinement) are counted on
//! from there. Whatever lyon makes is measured in `f64`, and triangulated again by spade if its area is off by more than
//! [`AREA_TOLERANCE`] or a triangle is upside down. Planes are shared out over all threads; buffers are kept.

mod cdt;
mod fill;
pub mod regions;
pub mod squares;
mod sweep;

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use glam::DVec2;

/// The largest relative difference between the area of an outline and that of its triangles that is let pass.
pub const AREA_TOLERANCE: f64 = 1e-5;

/// Polygons of many planes, flat, as the sections of a mesh come. Loops of plane k are
/// `plane_start[k]..plane_start[k + 1]`, points of loop l are `loop_start[l]..loop_start[l + 1]`.
#[derive(Debug, Clone, Copy)]
pub struct Outlines<'a> {
    pub points: &'a [DVec2],
    pub loop_start: &'a [u32],
    pub plane_start: &'a [u32],
    /// Signed area of each loop.
    pub area: &'a [f64],
    /// For each loop itself if it is an outer loop (anticlockwise), the outer loop around it if it is a hole (clockwise),
    /// `u32::MAX` if it is to be left out.
    pub owner: &'a [u32],
}

impl Outlines<'_> {
    fn loop_points(&self, l: u32) -> &[DVec2] {
        &self.points[self.loop_start[l as usize] as usize..self.loop_start[l as usize + 1] as usize]
    }

    fn planes(&self) -> usize {
        self.plane_start.len().saturating_sub(1)
    }

    /// The first point of plane `k`.
    fn first_point(&self, k: usize) -> u32 {
        self.loop_start[self.plane_start[k] as usize]
    }
}

/// How to triangulate.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Method {
    /// Our own sweep where the outline is simple, lyon elsewhere: for pictures while something moves.
    #[default]
    Fast,
    /// lyon for everything.
    Lyon,
    /// spade's constrained Delaunay triangulation, refined if a limit is set.
    Quality(Limits),
}

/// Limits on the shape of triangles.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Limits {
    /// Triangles are split until no angle is smaller, in degrees. Above 30 it may not end; zero for no limit.
    pub min_angle: f64,
    /// Triangles are split until none is larger; infinite or zero for no limit.
    pub max_area: f64,
    /// Points are added inside only, so that neighbouring polygons still fit together; by the area alone, and triangles
    /// at the outline may be larger.
    pub keep_outline: bool,
}

/// The triangles of all planes, flat; anticlockwise.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Triangulation {
    /// Indices into the points of the outlines, and beyond their number into `extra`.
    pub triangles: Vec<[u32; 3]>,
    /// First triangle of each plane, and the number of triangles at the end.
    pub plane_start: Vec<u32>,
    /// Points that the outlines do not have.
    pub extra: Vec<DVec2>,
    pub made_by: MadeBy,
}

/// How many polygons (an outer loop with its holes) each tessellator did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct MadeBy {
    pub sweep: u32,
    pub lyon: u32,
    pub spade: u32,
    /// The area could not be met: the outline crosses itself, and its triangles, spade's, cover once what it winds round
    /// anticlockwise.
    pub mismatched: u32,
}

impl Triangulation {
    /// Indices of the triangles of plane `k`.
    pub fn plane_triangles(&self, k: usize) -> Range<usize> {
        self.plane_start[k] as usize..self.plane_start[k + 1] as usize
    }

    /// A corner of a triangle.
    pub fn point(&self, outlines: &Outlines, index: u32) -> DVec2 {
        let i = index as usize;
        if i < outlines.points.len() { outlines.points[i] } else { self.extra[i - outlines.points.len()] }
    }

    /// Area of the triangles of plane `k`.
    pub fn plane_area(&self, outlines: &Outlines, k: usize) -> f64 {
        let triangles = &self.triangles[self.plane_triangles(k)];
        0.5 * triangles.iter().map(|t| doubled_area(t.map(|i| self.point(outlines, i)))).sum::<f64>()
    }
}

fn doubled_area([a, b, c]: [DVec2; 3]) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Triangulates planes, and keeps its buffers from call to call.
#[derive(Debug, Default)]
pub struct Tessellator {
    workers: Vec<Mutex<Worker>>,
    runs: Vec<Run>,
    result: Triangulation,
}

/// The tessellators of one thread.
#[derive(Default)]
struct Worker {
    sweep: sweep::Sweep,
    fill: fill::Fill,
    /// (outer loop, whether it is a hole of that, loop) of the plane at hand.
    groups: Vec<(u32, bool, u32)>,
}

impl std::fmt::Debug for Worker {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Worker").finish_non_exhaustive()
    }
}

/// The triangles of a run of consecutive planes.
#[derive(Debug, Default)]
struct Run {
    planes: Range<usize>,
    triangles: Vec<[u32; 3]>,
    triangles_of_plane: Vec<u32>,
    extra: Vec<DVec2>,
    made_by: MadeBy,
}

/// Fewer points than this are not worth another thread.
const POINTS_PER_RUN: usize = 2048;

impl Tessellator {
    /// Triangulates all planes.
    pub fn run(&mut self, outlines: &Outlines, method: Method) -> &Triangulation {
        let threads = rayon::current_num_threads().max(1);
        self.workers.resize_with(threads, Mutex::default);
        let planes = outlines.planes();
        let points = outlines.points.len();
        let most = if threads > 1 { 8 * threads } else { 1 };
        let runs = (points / POINTS_PER_RUN).clamp(1, most).min(planes.max(1));
        self.runs.resize_with(runs, Run::default);
        let mut plane = 0;
        for (r, run) in self.runs.iter_mut().enumerate() {
            let start = plane;
            let wanted = (points as u64 * (r as u64 + 1) / runs as u64) as u32;
            while plane < planes && (r + 1 == runs || outlines.first_point(plane) < wanted) {
                plane += 1;
            }
            run.planes = start..plane;
        }
        run_all(&mut self.runs, outlines, method, &self.workers);
        self.gather(points as u32);
        &self.result
    }

    /// What the last call made.
    pub fn result(&self) -> &Triangulation {
        &self.result
    }

    fn gather(&mut self, points: u32) {
        let out = &mut self.result;
        out.extra.clear();
        out.plane_start.clear();
        out.plane_start.push(0);
        out.made_by = MadeBy::default();
        let total = self.runs.iter().map(|r| r.triangles.len()).sum();
        out.triangles.resize(total, [0; 3]);
        let mut sum = 0;
        for run in &mut self.runs {
            if !run.extra.is_empty() {
                // counted from the first added point of the run so far
                let shift = out.extra.len() as u32;
                run.triangles.iter_mut().flatten().filter(|i| **i >= points).for_each(|i| *i += shift);
                out.extra.append(&mut run.extra);
            }
            out.plane_start.extend(run.triangles_of_plane.iter().map(|n| {
                sum += n;
                sum
            }));
            out.made_by.sweep += run.made_by.sweep;
            out.made_by.lyon += run.made_by.lyon;
            out.made_by.spade += run.made_by.spade;
            out.made_by.mismatched += run.made_by.mismatched;
        }
        copy_all(&self.runs, &mut out.triangles);
    }
}

fn run_all(runs: &mut [Run], outlines: &Outlines, method: Method, workers: &[Mutex<Worker>]) {
    match runs {
        [] => {}
        [run] => {
            let slot = rayon::current_thread_index().unwrap_or(0) % workers.len();
            let mut worker = workers[slot].lock().unwrap_or_else(PoisonError::into_inner);
            run.run(outlines, method, &mut worker);
        }
        _ => {
            let (a, b) = runs.split_at_mut(runs.len() / 2);
            rayon::join(|| run_all(a, outlines, method, workers), || run_all(b, outlines, method, workers));
        }
    }
}

fn copy_all(runs: &[Run], out: &mut [[u32; 3]]) {
    match runs {
        [] => {}
        [run] => out.copy_from_slice(&run.triangles),
        _ => {
            let (a, b) = runs.split_at(runs.len() / 2);
            let (x, y) = out.split_at_mut(a.iter().map(|r| r.triangles.len()).sum());
            if out_is_small(x, y) {
                copy_all(a, x);
                copy_all(b, y);
            } else {
                rayon::join(|| copy_all(a, x), || copy_all(b, y));
            }
        }
    }
}

fn out_is_small(x: &[[u32; 3]], y: &[[u32; 3]]) -> bool {
    x.len() + y.len() < 32768
}

/// A polygon as the tessellators get it: an outer loop and its holes.
struct Polygon<'a> {
    outlines: &'a Outlines<'a>,
    /// (_, _, loop), the outer loop first.
    loops: &'a [(u32, bool, u32)],
}

impl Polygon<'_> {
    fn area(&self) -> f64 {
        self.loops.iter().map(|l| self.outlines.area[l.2 as usize]).sum()
    }

    /// The loops with the number of their first point.
    fn loops(&self) -> impl Iterator<Item = (&[DVec2], u32)> {
        self.loops.iter().map(|l| (self.outlines.loop_points(l.2), self.outlines.loop_start[l.2 as usize]))
    }

    fn is_finite(&self) -> bool {
        self.loops.iter().all(|l| self.outlines.area[l.2 as usize].is_finite())
            && self.loops().all(|(points, _)| points.iter().all(|p| p.is_finite()))
    }
}

impl Run {
    fn run(&mut self, outlines: &Outlines, method: Method, worker: &mut Worker) {
        self.triangles.clear();
        self.triangles_of_plane.clear();
        self.extra.clear();
        self.made_by = MadeBy::default();
        let mut groups = std::mem::take(&mut worker.groups);
        for k in self.planes.clone() {
            let before = self.triangles.len();
            groups.clear();
            for l in outlines.plane_start[k]..outlines.plane_start[k + 1] {
                let owner = outlines.owner[l as usize];
                if owner != u32::MAX {
                    groups.push((owner, owner != l, l));
                }
            }
            groups.sort_unstable();
            for loops in groups.chunk_by(|a, b| a.0 == b.0) {
                self.polygon(&Polygon { outlines, loops }, method, worker);
            }
            self.triangles_of_plane.push((self.triangles.len() - before) as u32);
        }
        worker.groups = groups;
    }

    fn polygon(&mut self, polygon: &Polygon, method: Method, worker: &mut Worker) {
        let (triangles, extra) = (self.triangles.len(), self.extra.len());
        let area = polygon.area();
        if !polygon.is_finite() {
            self.made_by.mismatched += 1;
            return;
        }
        if method == Method::Fast {
            worker.sweep.clear();
            let swept = polygon
                .loops()
                .try_for_each(|(points, first)| worker.sweep.add(points, first))
                .and_then(|()| worker.sweep.run(&mut self.triangles));
            if swept.is_ok() && agrees(0.5 * worker.sweep.doubled_area, area) {
                self.made_by.sweep += 1;
                return;
            }
            self.triangles.truncate(triangles);
        }
        if !matches!(method, Method::Quality(_)) {
            let done = worker.fill.run(polygon, &mut self.triangles, &mut self.extra);
            if done && self.is_right(polygon.outlines, triangles, area) {
                self.made_by.lyon += 1;
                return;
            }
            self.triangles.truncate(triangles);
            self.extra.truncate(extra);
        }
        let limits = if let Method::Quality(limits) = method { limits } else { Limits::default() };
        cdt::run(polygon, limits, &mut self.triangles, &mut self.extra);
        self.made_by.spade += 1;
        if !self.is_right(polygon.outlines, triangles, area) {
            self.made_by.mismatched += 1;
        }
    }

    /// Whether the triangles from `first` have the area of the outline and none is upside down.
    fn is_right(&self, outlines: &Outlines, first: usize, area: f64) -> bool {
        let points = outlines.points;
        let at = |i: u32| points.get(i as usize).copied().unwrap_or_else(|| self.extra[i as usize - points.len()]);
        let (mut sum, mut wrong) = (0.0, 0.0);
        for t in &self.triangles[first..] {
            let twice = doubled_area(t.map(at));
            sum += twice;
            wrong += twice.min(0.0);
        }
        agrees(0.5 * sum, area) && -wrong <= 1e-9 * sum
    }
}

fn agrees(measured: f64, area: f64) -> bool {
    (measured - area).abs() <= AREA_TOLERANCE * area.abs()
}

//! A section parted in what lies inside and outside of convex polygons (the sections of displacement boxes).
//!
//! # Theory
//!
//! The part inside is refined and displaced, the part outside is drawn as it is (Westermann and Rezk-Salama 2001, section
//! 3.2, where the boxes become inner contours of each slice). The paper leaves open what happens where boxes overlap;
//! here the union of all boxes is taken, so that every point of the section is in exactly one part.
//!
//! # Practice
//!
//! i_overlay splits all edges where they meet, once, on a grid of 2^60 steps across the section, which is finer than
//! `f64`; both parts are read from this one arrangement, so that they have the same points along the cut, bit by bit.

use glam::DVec2;
use i_overlay::core::extract::BooleanExtractionBuffer;
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::core::solver::Solver;
use i_overlay::float::overlay::{FloatOverlay, OverlayOptions};
use rayon::prelude::*;

use super::{MadeBy, Method, Outlines, Run, Worker};

/// Both parts of a section.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Regions {
    pub outside: Region,
    pub inside: Region,
}

/// One part of a section: its polygons, and their triangles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Region {
    pub points: Vec<DVec2>,
    pub loop_start: Vec<u32>,
    /// Signed areas and owners of the loops, as in [`Outlines`].
    pub area: Vec<f64>,
    pub owner: Vec<u32>,
    /// Indices into `points`, and beyond their number into `extra`; anticlockwise.
    pub triangles: Vec<[u32; 3]>,
    pub extra: Vec<DVec2>,
    pub made_by: MadeBy,
}

impl Region {
    /// A corner of a triangle.
    pub fn point(&self, index: u32) -> DVec2 {
        let i = index as usize;
        if i < self.points.len() { self.points[i] } else { self.extra[i - self.points.len()] }
    }

    /// Area by its outline.
    pub fn outline_area(&self) -> f64 {
        self.area.iter().sum()
    }

    /// Area of its triangles.
    pub fn area(&self) -> f64 {
        0.5 * self.triangles.iter().map(|t| super::doubled_area(t.map(|i| self.point(i)))).sum::<f64>()
    }

    fn add(&mut self, points: impl Iterator<Item = DVec2>, owner: u32) {
        if self.loop_start.is_empty() {
            self.loop_start.push(0);
        }
        let start = self.points.len();
        for p in points {
            if self.points.len() == start || self.points[self.points.len() - 1] != p {
                self.points.push(p);
            }
        }
        while self.points.len() > start + 1 && self.points[self.points.len() - 1] == self.points[start] {
            self.points.pop();
        }
        if self.points.len() < start + 3 {
            self.points.truncate(start);
            return;
        }
        self.area.push(shoelace(&self.points[start..]));
        self.loop_start.push(self.points.len() as u32);
        self.owner.push(owner);
    }
}

/// Parts sections; keeps its tessellators from one to the next.
#[derive(Debug, Default)]
pub struct Cutter {
    worker: Worker,
}

impl Cutter {
    /// Parts plane `k` along the union of `convex` polygons (of any orientation).
    ///
    /// A method that adds points ([`Method::Quality`] with limits) keeps to the inside of each part, whatever
    /// [`super::Limits::keep_outline`] says.
    pub fn cut(&mut self, outlines: &Outlines, k: usize, convex: &[Vec<DVec2>], method: Method) -> Regions {
        let mut regions = split(outlines, k, convex);
        let method = match method {
            Method::Quality(limits) => Method::Quality(super::Limits { keep_outline: true, ..limits }),
            other => other,
        };
        for region in [&mut regions.outside, &mut regions.inside] {
            if region.loop_start.is_empty() {
                region.loop_start.push(0);
            }
            let plane_start = [0, region.owner.len() as u32];
            let outlines = Outlines {
                points: &region.points,
                loop_start: &region.loop_start,
                plane_start: &plane_start,
                area: &region.area,
                owner: &region.owner,
            };
            let mut run = Run { planes: 0..1, ..Run::default() };
            run.run(&outlines, method, &mut self.worker);
            (region.triangles, region.extra, region.made_by) = (run.triangles, run.extra, run.made_by);
        }
        regions
    }
}

/// Parts all planes, in parallel. `convex_of` gives the convex polygons in a plane.
pub fn cut_planes(
    outlines: &Outlines,
    convex_of: impl Fn(usize) -> Vec<Vec<DVec2>> + Sync,
    method: Method,
) -> Vec<Regions> {
    (0..outlines.planes())
        .into_par_iter()
        .map_init(Cutter::default, |cutter, k| cutter.cut(outlines, k, &convex_of(k), method))
        .collect()
}

fn split(outlines: &Outlines, k: usize, convex: &[Vec<DVec2>]) -> Regions {
    let mut regions = Regions::default();
    let loops = outlines.plane_start[k]..outlines.plane_start[k + 1];
    let used =
        |l: &u32| outlines.owner[*l as usize] != u32::MAX && outlines.loop_points(*l).iter().all(|p| p.is_finite());
    let (lo, hi) = loops
        .clone()
        .filter(used)
        .flat_map(|l| outlines.loop_points(l))
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
    let tools: Vec<Vec<[f64; 2]>> = convex
        .iter()
        .filter(|c| c.len() >= 3 && c.iter().all(|p| p.is_finite()))
        .filter(|c| {
            let (a, b) = c.iter().fold((c[0], c[0]), |(a, b), p| (a.min(*p), b.max(*p)));
            a.cmplt(hi).all() && lo.cmplt(b).all()
        })
        .map(|c| {
            let mut c: Vec<[f64; 2]> = c.iter().map(|p| p.to_array()).collect();
            if shoelace(&c.iter().map(|p| DVec2::from(*p)).collect::<Vec<_>>()) < 0.0 {
                // opposite windings would cancel
                c.reverse();
            }
            c
        })
        .collect();
    if tools.is_empty() {
        let mut new = vec![u32::MAX; loops.len()];
        let sorted = [true, false]
            .map(|outer| loops.clone().filter(used).filter(move |l| (outlines.owner[*l as usize] == *l) == outer));
        for l in sorted.into_iter().flatten() {
            let owner = outlines.owner[l as usize];
            let at = regions.outside.owner.len() as u32;
            if owner == l {
                new[(l - loops.start) as usize] = at;
            }
            let owner = new[(owner - loops.start) as usize];
            regions.outside.add(outlines.loop_points(l).iter().copied(), owner);
        }
        return regions;
    }
    let section: Vec<Vec<[f64; 2]>> =
        loops.filter(used).map(|l| outlines.loop_points(l).iter().map(|p| p.to_array()).collect()).collect();
    let mut options = OverlayOptions::default();
    options.preserve_input_collinear = true;
    options.preserve_output_collinear = true;
    options.clean_result = false;
    let mut overlay =
        FloatOverlay::<[f64; 2], i64>::from_subj_and_clip_custom(&section, &tools, options, Solver::default());
    if let Some(graph) = overlay.build_graph_view(FillRule::NonZero) {
        let mut buffer = BooleanExtractionBuffer::default();
        let parts = [(&mut regions.outside, OverlayRule::Difference), (&mut regions.inside, OverlayRule::Intersect)];
        for (region, rule) in parts {
            for shape in graph.extract_shapes(rule, &mut buffer) {
                let outer = region.owner.len() as u32;
                for contour in shape {
                    region.add(contour.into_iter().map(DVec2::from), outer);
                    if region.owner.len() as u32 == outer {
                        // the outer loop is thinner than f64 can tell, and so are its holes
                        break;
                    }
                }
            }
        }
    }
    regions
}

pub(super) fn shoelace(points: &[DVec2]) -> f64 {
    let Some(&base) = points.first() else { return 0.0 };
    0.5 * points.windows(2).map(|w| (w[0] - base).perp_dot(w[1] - base)).sum::<f64>()
}

//! What contours wind round together.

use glam::DVec2;
use rayon::prelude::*;

use super::nest::is_thin;
use super::walk::shoelace;
use super::{Defect, Slices};
use crate::math::winding::{FillRule, shapes};

/// The new loops of one plane.
#[derive(Debug, Default)]
struct United {
    points: Vec<DVec2>,
    /// The end of each loop among the points.
    ends: Vec<u32>,
    area: Vec<f64>,
    /// As in [`Slices`], counted from the first loop of the plane.
    owner: Vec<u32>,
    /// How many loops there were, and where the first begins.
    loops: (u32, DVec2),
    /// How many regions are wound round backwards, and where the first is.
    backward: (u32, DVec2),
}

impl Slices {
    /// In place of [`Slices::nest`], for a mesh whose parts overlap: the loops of each plane become the outlines, with
    /// their holes, of all points that they wind round anticlockwise more often than clockwise. So a point in several parts
    /// at once is covered once, and a cavity takes away from one part what it is in.
    ///
    /// Here directions count, other than in the nesting: the triangles of the mesh must agree which side is out. Only if
    /// the sections of all planes together have a negative area is everything taken the other way round. What is wound
    /// round backwards is left out, and [`Slices::warnings`] tells.
    ///
    /// Coordinates are those before within rounding. Costs more than nesting and triangulation together.
    pub fn unite(&mut self) {
        let turned = self.area.iter().sum::<f64>() < 0.0;
        let this = &*self;
        let planes: Vec<United> = (0..self.planes()).into_par_iter().map(|k| this.united(k, turned)).collect();
        self.points.clear();
        self.area.clear();
        self.owner.clear();
        self.loop_start.truncate(1);
        for (k, plane) in planes.into_iter().enumerate() {
            let (first_point, first_loop) = (self.points.len() as u32, self.area.len() as u32);
            self.points.extend(plane.points);
            self.loop_start.extend(plane.ends.iter().map(|end| first_point + end));
            self.area.extend(plane.area);
            self.owner.extend(plane.owner.iter().map(|o| first_loop + o));
            self.plane_start[k + 1] = self.area.len() as u32;
            let wrong = if turned { plane.loops } else { (0, DVec2::ZERO) };
            for (defect, (count, at)) in [(Defect::Orientation, wrong), (Defect::Backward, plane.backward)] {
                if count > 0 {
                    self.warn(defect, k as u32, at, count);
                }
            }
        }
    }

    /// What the loops of plane `k` wind round anticlockwise, clockwise if they are `turned`.
    fn united(&self, k: usize, turned: bool) -> United {
        let mut united = United::default();
        let used: Vec<usize> = self.plane_loops(k).filter(|&l| !is_thin(self.loop_points(l), self.area[l])).collect();
        let Some(&first) = used.first() else { return united };
        united.loops = (used.len() as u32, self.loop_points(first)[0]);
        let loops: Vec<Vec<[f64; 2]>> =
            used.iter().map(|&l| self.loop_points(l).iter().map(|p| p.to_array()).collect()).collect();
        let (forward, backward) = (FillRule::Positive, FillRule::Negative);
        let (forward, backward) = if turned { (backward, forward) } else { (forward, backward) };
        for shape in shapes(&loops, forward) {
            united.add(shape);
        }
        if used.iter().any(|&l| (self.area[l] < 0.0) != turned) {
            // holes, as a rule: then there is nothing
            let mut left_out = United::default();
            shapes(&loops, backward).into_iter().for_each(|shape| left_out.add(shape));
            let count = left_out.owner.iter().zip(0..).filter(|(o, l)| **o == *l).count();
            united.backward = (count as u32, left_out.points.first().copied().unwrap_or_default());
        }
        united
    }
}

impl United {
    /// Adds an outer loop and its holes, but for those that rounding made.
    fn add(&mut self, shape: Vec<Vec<[f64; 2]>>) {
        let outer = self.area.len() as u32;
        for contour in shape {
            let start = self.points.len();
            self.points.extend(contour.into_iter().map(DVec2::from));
            let area = shoelace(&self.points[start..]);
            if is_thin(&self.points[start..], area) {
                self.points.truncate(start);
                if self.area.len() as u32 == outer {
                    return;
                }
                continue;
            }
            self.ends.push(self.points.len() as u32);
            self.area.push(area);
            self.owner.push(outer);
        }
    }
}

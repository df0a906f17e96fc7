//! A section in squares where it is displaced, and in triangles of its outline elsewhere.
//!
//! # Theory
//!
//! What is refined wants triangles of even size. Parted along the boxes (see [`super::regions`]) a section falls into pieces as
//! long and thin as chance has it, more of them the more boxes overlap, and others with every move of a box. But nothing happens
//! at the border of a box: displacement and its slope are zero there. So here a lattice of squares that stays where it is is laid
//! over the plane. Squares that meet a box and lie wholly in the section become two triangles each. What is left of the section
//! has the outline of those squares for holes and is triangulated by the sweep.
//!
//! # Practice
//!
//! Both parts share the corners of the squares, so that there is no crack between them. A square that the outline passes, or may
//! pass within rounding, is left to the sweep. Squares that would touch at a corner only are left out, so that the polygon stays
//! simple.

use glam::DVec2;

use super::{Method, Outlines, Run, Worker};
use crate::math::rows::Rows;

/// The triangles of one plane, and the buffers for the next.
#[derive(Debug, Default)]
pub struct Squares {
    /// Those of the outline first.
    pub points: Vec<DVec2>,
    /// Two for each square; anticlockwise.
    pub inside: Vec<[u32; 3]>,
    /// Of what is left; anticlockwise.
    pub rest: Vec<[u32; 3]>,
    /// The side of a square.
    pub step: f64,
    window: Window,
    /// By square: [`MEETS`] and [`CROSSED`], then whether it is taken.
    states: Vec<u8>,
    /// Where the outline crosses the middle of a row: row, place and how the winding number changes there.
    crossings: Vec<(i32, f64, i32)>,
    /// The reach of a box along each row.
    reach: Vec<[f64; 2]>,
    /// By lattice point: its number, and where the outline of the squares goes on.
    numbers: Vec<u32>,
    next: Vec<u32>,
    loop_start: Vec<u32>,
    area: Vec<f64>,
    owner: Vec<u32>,
    run: Run,
    worker: Worker,
}

/// The squares that come into question: numbers of columns and rows.
#[derive(Debug, Clone, Copy, Default)]
struct Window {
    first: [i32; 2],
    size: [usize; 2],
}

/// A square meets a box.
const MEETS: u8 = 1;
/// The outline passes a square.
const CROSSED: u8 = 2;
const NONE: u32 = u32::MAX;
/// What counts as touching, in squares.
const HAIR: f64 = 1e-6;
/// More squares than this are not laid over a plane; they are made larger instead.
const MOST: f64 = 4096.0;

impl Squares {
    /// Triangulates plane `k`: squares with sides of `step` or more where it meets `convex` polygons.
    pub fn lay(&mut self, outlines: &Outlines, k: usize, convex: &[Vec<DVec2>], step: f64) {
        self.points.clear();
        self.inside.clear();
        self.rest.clear();
        self.loop_start.clear();
        self.loop_start.push(0);
        self.area.clear();
        self.owner.clear();
        for l in outlines.plane_start[k]..outlines.plane_start[k + 1] {
            let points = outlines.loop_points(l);
            if outlines.owner[l as usize] != NONE && points.iter().all(|p| p.is_finite()) {
                self.points.extend_from_slice(points);
                self.end_loop(outlines.area[l as usize]);
            }
        }
        self.find_window(convex, step);
        if self.window.size != [0, 0] {
            self.find_squares(convex);
            self.emit();
        }
        // the sweep takes loops as they come, inside each other or side by side
        self.owner.resize(self.area.len(), 0);
        let outlines = Outlines {
            points: &self.points,
            loop_start: &self.loop_start,
            plane_start: &[0, self.area.len() as u32],
            area: &self.area,
            owner: &self.owner,
        };
        self.run.planes = 0..1;
        self.run.run(&outlines, Method::Fast, &mut self.worker);
        self.rest.append(&mut self.run.triangles);
        self.points.append(&mut self.run.extra);
    }

    fn end_loop(&mut self, area: f64) {
        self.loop_start.push(self.points.len() as u32);
        self.area.push(area);
    }

    /// Around what both the section and the boxes reach.
    fn find_window(&mut self, convex: &[Vec<DVec2>], step: f64) {
        self.window = Window::default();
        let (lo, hi) = bounds(&self.points);
        let (a, b) = bounds(convex.iter().flatten());
        let (lo, hi) = (lo.max(a), hi.min(b));
        if !(lo.cmplt(hi).all() && lo.is_finite() && hi.is_finite() && step > 0.0) {
            return;
        }
        self.step = step;
        while ((hi - lo) / self.step + 2.0).element_product() > MOST {
            self.step *= 2.0;
        }
        let (lo, hi) = ((lo / self.step).floor(), (hi / self.step).floor());
        if lo.abs().max(hi.abs()).max_element() < 1e9 {
            let size = hi - lo + 1.0;
            self.window = Window { first: [lo.x as i32, lo.y as i32], size: [size.x as usize, size.y as usize] };
        }
    }

    /// Squares that meet a box and lie wholly in the section.
    fn find_squares(&mut self, convex: &[Vec<DVec2>]) {
        let Window { size: [across, down], .. } = self.window;
        self.states.clear();
        self.states.resize(across * down, 0);
        for polygon in convex {
            self.reach.clear();
            self.reach.resize(down, [f64::INFINITY, f64::NEG_INFINITY]);
            for [a, b] in sides(polygon) {
                self.window.rows().passed(a / self.step, b / self.step, |row, lo, hi| {
                    let reach = &mut self.reach[row];
                    *reach = [reach[0].min(lo), reach[1].max(hi)];
                });
            }
            for (row, [lo, hi]) in self.reach.iter().enumerate() {
                let columns = self.window.columns(*lo, *hi);
                self.states[row * across..][columns].iter_mut().for_each(|s| *s |= MEETS);
            }
        }
        self.crossings.clear();
        for l in self.loop_start.windows(2) {
            for [a, b] in sides(&self.points[l[0] as usize..l[1] as usize]) {
                let (a, b) = (a / self.step, b / self.step);
                let turn = if b.y > a.y { -1 } else { 1 };
                self.window.rows().passed(a, b, |row, lo, hi| {
                    let columns = self.window.columns(lo, hi);
                    self.states[row * across..][columns].iter_mut().for_each(|s| *s |= CROSSED);
                    let middle = f64::from(self.window.first[1]) + row as f64 + 0.5;
                    if (a.y > middle) != (b.y > middle) {
                        let x = a.x + (b.x - a.x) * ((middle - a.y) / (b.y - a.y));
                        self.crossings.push((row as i32, x - f64::from(self.window.first[0]), turn));
                    }
                });
            }
        }
        self.crossings.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut next = self.crossings.iter().peekable();
        for row in 0..down {
            let mut winding = 0;
            for column in 0..across {
                while let Some(c) = next.next_if(|c| c.0 == row as i32 && c.1 < column as f64 + 0.5) {
                    winding += c.2;
                }
                let state = &mut self.states[row * across + column];
                *state = u8::from(*state == MEETS && winding > 0);
            }
            while next.next_if(|c| c.0 == row as i32).is_some() {}
        }
        self.part_corners();
    }

    /// Takes squares away until none touches another at a corner only.
    fn part_corners(&mut self) {
        let Window { size: [across, down], .. } = self.window;
        loop {
            let mut changed = false;
            for row in 1..down {
                for column in 1..across {
                    let at = row * across + column;
                    let four = [at - across - 1, at - across, at - 1, at].map(|i| self.states[i]);
                    match four {
                        [1, 0, 0, 1] => self.states[at] = 0,
                        [0, 1, 1, 0] => self.states[at - 1] = 0,
                        _ => continue,
                    }
                    changed = true;
                }
            }
            if !changed {
                return;
            }
        }
    }

    /// Adds the squares' triangles, and their outline to that of the section.
    fn emit(&mut self) {
        let Window { first, size: [across, down] } = self.window;
        let wide = across + 1;
        self.numbers.clear();
        self.numbers.resize(wide * (down + 1), NONE);
        self.next.clear();
        self.next.resize(wide * (down + 1), NONE);
        let taken = |states: &[u8], column: usize, row: usize| {
            column < across && row < down && states[row * across + column] != 0
        };
        for row in 0..down {
            for column in 0..across {
                if !taken(&self.states, column, row) {
                    continue;
                }
                let corner = [0, 1, wide, wide + 1].map(|step| row * wide + column + step);
                // the squares lie on the right of their outline, which is a hole
                for (out, from, to) in [
                    (!taken(&self.states, column, row.wrapping_sub(1)), 1, 0),
                    (!taken(&self.states, column + 1, row), 3, 1),
                    (!taken(&self.states, column, row + 1), 2, 3),
                    (!taken(&self.states, column.wrapping_sub(1), row), 0, 2),
                ] {
                    if out {
                        self.next[corner[from]] = corner[to] as u32;
                    }
                }
            }
        }
        let place = |i: usize| {
            let [x, y] = [first[0] + (i % wide) as i32, first[1] + (i / wide) as i32];
            DVec2::new(x.into(), y.into()) * self.step
        };
        for start in 0..self.next.len() {
            let mut at = start;
            let from = self.points.len();
            while self.next[at] != NONE {
                self.numbers[at] = self.points.len() as u32;
                self.points.push(place(at));
                at = std::mem::replace(&mut self.next[at], NONE) as usize;
            }
            if self.points.len() > from {
                let area = super::regions::shoelace(&self.points[from..]);
                self.loop_start.push(self.points.len() as u32);
                self.area.push(area);
            }
        }
        for row in 0..down {
            for column in 0..across {
                if !taken(&self.states, column, row) {
                    continue;
                }
                let [a, b, c, d] = [0, 1, wide, wide + 1].map(|step| {
                    let i = row * wide + column + step;
                    if self.numbers[i] == NONE {
                        self.numbers[i] = self.points.len() as u32;
                        self.points.push(place(i));
                    }
                    self.numbers[i]
                });
                self.inside.extend([[a, b, d], [a, d, c]]);
            }
        }
    }
}

impl Window {
    /// Its rows; places are in units of squares.
    fn rows(&self) -> Rows {
        Rows { bottom: self.first[1].into(), count: self.size[1], hair: HAIR }
    }

    /// The columns between two places.
    fn columns(&self, lo: f64, hi: f64) -> std::ops::Range<usize> {
        let left = f64::from(self.first[0]);
        let start = (lo - HAIR - left).max(0.0) as usize;
        let end = (hi + HAIR - left + 1.0).max(0.0) as usize;
        let end = end.min(self.size[0]);
        start.min(end)..end
    }
}

fn bounds<'a>(points: impl IntoIterator<Item = &'a DVec2>) -> (DVec2, DVec2) {
    points.into_iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)))
}

/// The sides of a closed polygon.
fn sides(polygon: &[DVec2]) -> impl Iterator<Item = [DVec2; 2]> {
    let last = polygon.last().copied();
    polygon.iter().scan(last, |before, p| before.replace(*p).map(|a| [a, *p]))
}

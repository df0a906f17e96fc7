//! Flat slices, drawn by cells of the picture.

use glam::DVec2;

use super::plane::{Plane, View};
use super::rectangles::{COLUMNS, Cost, Rectangle, columns, cover};
use super::visibility::Visibility;
use crate::math::rows::Rows;
use crate::render::SliceVertex;
use crate::volume::pyramid::BLOCK;

/// Pixels along the side of the blocks that software adapters shade at once.
const STAMP: f64 = 4.0;

/// Pixels along the side of the smallest cells. Sides are this times powers of two, as are those of the blocks and tiles
/// that rasterizers go by.
const SIDE: f64 = 16.0;

/// What setting up two triangles costs, in blocks that are shaded.
const SETUP: usize = 16;

/// Pixels that a cell is enlarged by before it is said to be free of edges: as exact as rasterizers are.
const HAIR: f64 = 1.0 / 128.0;

/// What is drawn of a slice.
#[derive(Debug, Default)]
pub struct Drawn {
    /// Three corners each.
    pub triangles: Vec<[SliceVertex; 3]>,
    /// Triangles that are kept, by their number.
    pub kept: Vec<usize>,
}

/// Draws a plane's triangles, whose corners are given in pixels, where anything can be seen. `None` if that is everywhere.
pub fn draw(view: &View, visibility: &Visibility<'_>, plane: &Plane, triangles: &[[DVec2; 3]]) -> Option<Drawn> {
    let mut drawn = Drawn::default();
    let Some(cells) = Cells::around(view, plane, triangles) else { return Some(drawn) };
    let grid = |polygons: &mut dyn Iterator<Item = &[DVec2]>| {
        let (mut rows, mut reach) = (vec![0; cells.rows], Vec::new());
        polygons.for_each(|p| cells.mark(p, &mut reach, &mut rows));
        rows
    };
    let covered = grid(&mut triangles.iter().map(|t| &t[..]));
    let seen = cells.seen(visibility, plane, &covered);
    if seen == covered {
        return None;
    }
    let rim = grid(&mut rim(triangles).iter().map(|e| &e[..]));
    let each = |f: fn(u64, u64) -> u64, a: &[u64], b: &[u64]| -> Vec<u64> {
        a.iter().zip(b).map(|(a, b)| f(*a, *b)).collect()
    };
    let full = each(|covered, rim| covered & !rim, &covered, &rim);
    let mut taken = vec![0; cells.rows];
    let cost = Cost { blocks: (cells.side / STAMP) as usize, setup: SETUP };
    for r in cover(&each(|a, b| a & b, &seen, &full), &each(|full, _| !full, &full, &full), cost) {
        taken[r.y[0]..r.y[1]].iter_mut().for_each(|row| *row |= r.columns());
        let [lo, hi] = cells.corners(&r, view);
        let [a, b, c, d] = [lo, DVec2::new(hi.x, lo.y), hi, DVec2::new(lo.x, hi.y)].map(|p| plane.vertex(p));
        drawn.triangles.extend([[a, b, c], [a, c, d]]);
    }
    for r in cover(&each(|seen, full| seen & !full, &seen, &full), &taken, cost) {
        let corners = cells.corners(&r, view);
        for (i, t) in triangles.iter().enumerate() {
            let lo = t[0].min(t[1]).min(t[2]);
            let hi = t[0].max(t[1]).max(t[2]);
            if lo.cmpge(corners[0]).all() && hi.cmple(corners[1]).all() {
                drawn.kept.push(i);
            } else if lo.cmplt(corners[1]).all() && hi.cmpgt(corners[0]).all() {
                let part: Vec<_> = clip(t, corners).into_iter().map(|p| plane.vertex(p)).collect();
                drawn.triangles.extend((2..part.len()).map(|i| [part[0], part[i - 1], part[i]]));
            }
        }
    }
    Some(drawn)
}

/// Squares of pixels; the grid is the picture's, so that edges between cells lie between pixels.
struct Cells {
    /// Pixels along an edge of a cell.
    side: f64,
    /// Cells left of the first column, and above the first row.
    first: DVec2,
    rows: usize,
    columns: usize,
}

impl Cells {
    /// Cells over what lies in the picture; `None` if that is nothing.
    fn around(view: &View, plane: &Plane, triangles: &[[DVec2; 3]]) -> Option<Self> {
        let points = || triangles.iter().flatten();
        let lo = points().fold(DVec2::INFINITY, |a, p| a.min(*p)).max(DVec2::ZERO);
        let hi = points().fold(DVec2::NEG_INFINITY, |a, p| a.max(*p)).min(view.size);
        if !lo.cmplt(hi).all() {
            return None;
        }
        // half a block, since cells lie across blocks of the volume
        let voxels = 0.5 * BLOCK as f64 / plane.voxels_per_pixel().max(1e-9);
        let fits = (hi - lo).max_element() / (COLUMNS - 1) as f64;
        let least = voxels.min(view.size.max_element()).max(fits);
        let mut side = SIDE;
        while side < least {
            side *= 2.0;
        }
        let (first, end) = ((lo / side).floor(), (hi / side).ceil());
        let count = end - first;
        Some(Self { side, first, rows: count.y as usize, columns: (count.x as usize).min(COLUMNS) })
    }

    /// The upper left and the lower right corner in pixels, as far as they lie in the picture.
    fn corners(&self, r: &Rectangle, view: &View) -> [DVec2; 2] {
        [0, 1].map(|i| ((DVec2::new(r.x[i] as f64, r.y[i] as f64) + self.first) * self.side).min(view.size))
    }

    /// Marks all cells that a convex polygon, or an edge, touches. `reach` is room for a place and another in each row.
    fn mark(&self, polygon: &[DVec2], reach: &mut Vec<[f64; 2]>, rows: &mut [u64]) {
        let hair = HAIR / self.side;
        let local = |i: usize| polygon[i % polygon.len()] / self.side - self.first;
        reach.clear();
        reach.resize(self.rows, [f64::INFINITY, f64::NEG_INFINITY]);
        for i in 0..polygon.len() {
            Rows { bottom: 0.0, count: self.rows, hair }.passed(local(i), local(i + 1), |row, lo, hi| {
                let reach = &mut reach[row];
                *reach = [reach[0].min(lo), reach[1].max(hi)];
            });
        }
        for (row, [lo, hi]) in rows.iter_mut().zip(reach) {
            let [first, last] = [*lo - hair, *hi + hair];
            if first < self.columns as f64 && last >= 0.0 && first <= last {
                let end = (last as usize + 1).min(self.columns);
                *row |= columns([first.max(0.0) as usize, end]);
            }
        }
    }

    /// Those of the covered cells in which anything can be seen.
    fn seen(&self, visibility: &Visibility<'_>, plane: &Plane, covered: &[u64]) -> Vec<u64> {
        let mut seen = vec![0; self.rows];
        let largest = self.rows.max(self.columns).next_power_of_two();
        self.look(visibility, plane, covered, [0, 0, largest], &mut seen);
        seen
    }

    fn look(
        &self,
        visibility: &Visibility<'_>,
        plane: &Plane,
        covered: &[u64],
        [x, y, n]: [usize; 3],
        seen: &mut [u64],
    ) {
        let rows = y..(y + n).min(self.rows);
        let bits = columns([x, x + n]);
        if rows.is_empty() || covered[rows].iter().all(|row| row & bits == 0) {
            return;
        }
        let lo = (DVec2::new(x as f64, y as f64) + self.first) * self.side;
        if !plane.is_visible(visibility, lo, lo + n as f64 * self.side) {
            return;
        }
        if n == 1 {
            seen[y] |= covered[y] & bits;
            return;
        }
        let h = n / 2;
        for part in [[x, y, h], [x + h, y, h], [x, y + h, h], [x + h, y + h, h]] {
            self.look(visibility, plane, covered, part, seen);
        }
    }
}

/// Edges of one triangle only.
fn rim(triangles: &[[DVec2; 3]]) -> Vec<[DVec2; 2]> {
    let key = |p: DVec2| [p.x.to_bits(), p.y.to_bits()];
    let mut edges: Vec<_> = triangles
        .iter()
        .flat_map(|t| (0..3).map(|i| [t[i], t[(i + 1) % 3]]))
        .map(|[a, b]| {
            let (p, q) = (key(a), key(b));
            (p.min(q), p.max(q), [a, b])
        })
        .collect();
    edges.sort_unstable_by_key(|e| (e.0, e.1));
    let once = |group: &[_]| group.len() == 1;
    edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter(|g| once(g)).map(|g| g[0].2).collect()
}

/// The part of a triangle in a rectangle. Points on an edge do not depend on its direction.
fn clip(triangle: &[DVec2; 3], [lo, hi]: [DVec2; 2]) -> Vec<DVec2> {
    let mut polygon = triangle.to_vec();
    for (axis, bound, sign) in [(0, lo.x, 1.0), (0, hi.x, -1.0), (1, lo.y, 1.0), (1, hi.y, -1.0)] {
        let inside = |p: DVec2| sign * (p[axis] - bound);
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, &b) in polygon.iter().enumerate() {
            let a = polygon[(i + polygon.len() - 1) % polygon.len()];
            let (da, db) = (inside(a), inside(b));
            if (da >= 0.0) != (db >= 0.0) {
                let (from, to, f) = if da < 0.0 { (a, b, da / (da - db)) } else { (b, a, db / (db - da)) };
                let mut p = from + (to - from) * f;
                p[axis] = bound;
                kept.push(p);
            }
            if db >= 0.0 {
                kept.push(b);
            }
        }
        polygon = kept;
    }
    polygon
}

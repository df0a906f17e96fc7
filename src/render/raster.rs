//! Which pixels a triangle covers, by the rules of GPUs: corners are rounded to 1/256 pixel, a pixel is covered if its centre
//! lies inside, and a centre on an edge belongs to the triangle for which that edge is a top or left one. Triangles that share
//! corners therefore cover every pixel exactly once.

use std::ops::Range;

use rayon::prelude::*;

use super::{Frame, SliceGeometry};

/// Steps per pixel.
const SUBPIXEL: i64 = 256;

/// Corners are kept within this many pixels of the picture's origin, so that products fit `i64`.
const FAR: f64 = (1 << 21) as f64;

/// A corner on the screen in 1/256 pixels; `None` outside the clip range of depths.
pub type Corner = Option<[i32; 2]>;

/// The corners of all vertices.
pub fn project(geometry: &SliceGeometry, frame: &Frame) -> Vec<Corner> {
    let m = frame.clip_from_local.map(|c| c.map(f64::from));
    let [width, height] = [frame.size[0], frame.size[1]].map(f64::from);
    let corner = |p: [f32; 3]| {
        let p = p.map(f64::from);
        let [x, y, z, w]: [f64; 4] =
            std::array::from_fn(|r| m[0][r] * p[0] + m[1][r] * p[1] + m[2][r] * p[2] + m[3][r]);
        if !(w > 0.0 && z >= 0.0 && z <= w) {
            return None;
        }
        let at = [(0.5 + 0.5 * x / w) * width, (0.5 - 0.5 * y / w) * height];
        at.iter().all(|v| v.is_finite()).then(|| at.map(|v| (v.clamp(-FAR, FAR) * SUBPIXEL as f64).round() as i32))
    };
    geometry.vertices.par_iter().with_min_len(1024).map(|v| corner(v.position)).collect()
}

/// First and one past the last pixel along an axis whose centre may lie between two corner coordinates.
fn pixels(lo: i32, hi: i32, size: u32) -> Range<i64> {
    let first = (i64::from(lo) - SUBPIXEL / 2 + SUBPIXEL - 1).div_euclid(SUBPIXEL).max(0);
    let end = ((i64::from(hi) - SUBPIXEL / 2).div_euclid(SUBPIXEL) + 1).min(i64::from(size));
    first..end
}

fn bounds(c: &[[i32; 2]; 3], axis: usize, size: u32) -> Range<i64> {
    let v = c.map(|c| c[axis]);
    pixels(v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]), size)
}

/// Triangles by the tiles that they may touch.
pub struct Bins {
    /// For each group of triangles in drawing order: where each tile's list begins, and the lists.
    groups: Vec<(Vec<u32>, Vec<u32>)>,
}

impl Bins {
    /// Sorts triangles into tiles of `tile` pixels. Triangles are numbered in the order of the index buffer.
    pub fn new(geometry: &SliceGeometry, corners: &[Corner], frame: &Frame, tile: [usize; 2]) -> Self {
        let [width, height] = [frame.size[0], frame.size[1]];
        let across = (width as usize).div_ceil(tile[0]);
        let tiles = across * (height as usize).div_ceil(tile[1]);
        let count = geometry.indices.len() / 3;
        let group = count.div_ceil(4 * rayon::current_num_threads()).max(256);
        let touched = |t: usize| {
            let c = triangle_corners(geometry, corners, t)?;
            let (x, y) = (bounds(&c, 0, width), bounds(&c, 1, height));
            let range = |r: Range<i64>, side: usize| {
                (!r.is_empty()).then(|| r.start as usize / side..(r.end as usize - 1) / side + 1)
            };
            Some((range(x, tile[0])?, range(y, tile[1])?))
        };
        let groups = (0..count.div_ceil(group)).into_par_iter().map(|g| {
            let members = g * group..((g + 1) * group).min(count);
            let touched: Vec<_> = members.clone().map(touched).collect();
            let mut starts = vec![0u32; tiles + 1];
            let each = |visit: &mut dyn FnMut(usize, usize)| {
                for (t, ranges) in touched.iter().enumerate() {
                    let Some((xs, ys)) = ranges else { continue };
                    ys.clone().for_each(|y| xs.clone().for_each(|x| visit(t + members.start, y * across + x)));
                }
            };
            each(&mut |_, tile| starts[tile + 1] += 1);
            for i in 0..tiles {
                starts[i + 1] += starts[i];
            }
            let mut lists = vec![0u32; starts[tiles] as usize];
            let mut next = starts.clone();
            each(&mut |t, tile| {
                lists[next[tile] as usize] = t as u32;
                next[tile] += 1;
            });
            (starts, lists)
        });
        Self { groups: groups.collect() }
    }

    /// Triangles that may touch a tile, the last one first.
    pub fn front_to_back(&self, tile: usize) -> impl Iterator<Item = usize> {
        self.groups.iter().rev().flat_map(move |(starts, lists)| {
            lists[starts[tile] as usize..starts[tile + 1] as usize].iter().rev().map(|t| *t as usize)
        })
    }
}

fn triangle_corners(geometry: &SliceGeometry, corners: &[Corner], t: usize) -> Option<[[i32; 2]; 3]> {
    let i = geometry.indices.get(3 * t..3 * t + 3)?;
    let corner = |i: u32| *corners.get(i as usize)?;
    Some([corner(i[0])?, corner(i[1])?, corner(i[2])?])
}

/// A triangle ready to be filled: where it covers pixels, and how vertex attributes run over it.
pub struct Setup {
    /// Vertex numbers.
    pub vertices: [usize; 3],
    /// Pixels along x and y that may be covered.
    pub x: Range<i64>,
    pub y: Range<i64>,
    /// `a * X + b * Y + c >= 0` inside, X and Y in subpixels; edge i lies opposite corner i. `c` includes the top-left rule.
    edges: [[i64; 3]; 3],
    /// What the rule took from `c` of edges 1 and 2.
    rule: [i64; 2],
    per_area: f64,
}

impl Setup {
    /// `None` if no pixel's centre can lie inside.
    pub fn new(geometry: &SliceGeometry, corners: &[Corner], t: usize, size: [u32; 2]) -> Option<Self> {
        let c = triangle_corners(geometry, corners, t)?;
        let (x, y) = (bounds(&c, 0, size[0]), bounds(&c, 1, size[1]));
        if x.is_empty() || y.is_empty() {
            return None;
        }
        let [p, q, r] = c.map(|c| c.map(i64::from));
        let area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        if area == 0 {
            return None;
        }
        let sign = area.signum();
        let mut rule = [0; 3];
        let mut edge = |i: usize, u: [i64; 2], v: [i64; 2]| {
            let (a, b) = (-sign * (v[1] - u[1]), sign * (v[0] - u[0]));
            // y runs down: inside lies to the right of a left edge (a > 0) and below a horizontal top edge (b > 0)
            rule[i] = i64::from(!(a > 0 || (a == 0 && b > 0)));
            [a, b, -(a * u[0] + b * u[1]) - rule[i]]
        };
        let edges = [edge(0, q, r), edge(1, r, p), edge(2, p, q)];
        let i = &geometry.indices[3 * t..3 * t + 3];
        Some(Self {
            vertices: [i[0] as usize, i[1] as usize, i[2] as usize],
            x,
            y,
            edges,
            rule: [rule[1], rule[2]],
            per_area: 1.0 / (area.abs() as f64),
        })
    }

    /// The edges that cut a rectangle of pixels; `None` if one of them leaves nothing of it.
    pub fn cutting(&self, x: &Range<i64>, y: &Range<i64>) -> Option<[bool; 3]> {
        let mut cuts = [false; 3];
        for (cut, e) in cuts.iter_mut().zip(&self.edges) {
            let pick = |v: i64, r: &Range<i64>, most: bool| if (v > 0) == most { r.end - 1 } else { r.start };
            let at = |most: bool| value(e, pick(e[0], x, most), pick(e[1], y, most));
            if at(true) < 0 {
                return None;
            }
            *cut = at(false) < 0;
        }
        Some(cuts)
    }

    /// Covered pixels of row `y` within `x`, by the edges that cut.
    pub fn span(&self, y: i64, x: &Range<i64>, cuts: [bool; 3]) -> Range<i64> {
        let (mut first, mut end) = (x.start, x.end);
        for (e, _) in self.edges.iter().zip(cuts).filter(|(_, cut)| *cut) {
            let (step, rest) = (e[0] * SUBPIXEL, value(e, 0, y));
            if step > 0 {
                first = first.max((-rest + step - 1).div_euclid(step));
            } else if step < 0 {
                end = end.min(rest.div_euclid(-step) + 1);
            } else if rest < 0 {
                return first..first;
            }
        }
        first..end
    }

    /// Weights of the second and third corner at a pixel's centre.
    pub fn weights(&self, x: i64, y: i64) -> [f64; 2] {
        let weight = |i: usize| (value(&self.edges[i], x, y) + self.rule[i - 1]) as f64 * self.per_area;
        [weight(1), weight(2)]
    }

    /// Change of those weights from one pixel to the next along x.
    pub fn weight_steps(&self) -> [f64; 2] {
        [self.edges[1][0], self.edges[2][0]].map(|a| (a * SUBPIXEL) as f64 * self.per_area)
    }
}

/// An edge's function at a pixel's centre.
#[inline]
fn value(e: &[i64; 3], x: i64, y: i64) -> i64 {
    e[0] * (x * SUBPIXEL + SUBPIXEL / 2) + e[1] * (y * SUBPIXEL + SUBPIXEL / 2) + e[2]
}

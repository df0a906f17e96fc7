//! One tile of the picture: collects the fragments of its triangles, front to back, and shades them in groups.
//!
//! A pixel has at most one fragment that is not yet shaded. A triangle that covers such a pixel again lies on another slice
//! (or the mesh overlaps itself): then everything collected is shaded first. So small triangles of one slice fill whole groups
//! of [`LANES`], whatever their shape, and the order along each ray is kept.

use glam::{DMat4, DVec3};

use super::raster::Setup;
use super::sampler::{Sampler, Texel};
use super::shade::is_within;
use super::skip::Skip;
use super::{ClassTable, Exact, Frame, SliceGeometry};
use crate::math::lanes::{Best, F8, LANES, Machine, Work};

pub const WIDTH: usize = 32;
pub const HEIGHT: usize = 16;
const AREA: usize = WIDTH * HEIGHT;

/// One value per pixel.
pub type Plane = [f32; AREA];

/// What all tiles share.
pub struct Scene<'a, T: Texel, const C: usize> {
    pub geometry: &'a SliceGeometry,
    pub corners: &'a [Option<[i32; 2]>],
    pub sampler: Sampler<'a, T, C>,
    pub table: &'a ClassTable,
    pub skip: Skip,
    pub frame: &'a Frame,
    pub exact: Option<Exact<'a>>,
    /// Whether fragments need the value at the next slice.
    pub back: bool,
    /// From texture-space differences over two texels to window units per voxel.
    pub per_voxel: [f32; 3],
    pub local_from_clip: DMat4,
    /// What the processor can do, asked once.
    pub best: Best,
}

impl<'a, T: Texel, const C: usize> Scene<'a, T, C> {
    pub fn has_gradient(&self) -> bool {
        self.frame.has(Frame::LIT) && self.frame.size[2] != Frame::MIP
    }
}

/// [`Tile::shade`] on the best machine there is.
struct Shade<'t, 's, T: Texel, const C: usize> {
    tile: &'t mut Tile,
    scene: &'s Scene<'s, T, C>,
}

impl<T: Texel, const C: usize> Work for Shade<'_, '_, T, C> {
    type Output = ();

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) {
        self.tile.shade_rows(machine, self.scene);
    }
}

/// The state of a tile.
pub struct Tile {
    /// Pixels of the picture.
    origin: [i64; 2],
    size: [i64; 2],
    /// Texture coordinates of fragments; `front` holds positions until an exact map is applied.
    pub front: [Plane; 3],
    pub back: [Plane; 3],
    /// The Jacobian of all fragments if it does not vary, else of each.
    pub jacobian: [f32; 9],
    pub jacobians: Option<Box<[Plane; 9]>>,
    pub varies: bool,
    /// Whether all fragments surely lie in the texture.
    pub within: bool,
    /// Bits of pixels with a fragment, and of pixels that are not yet opaque, by row.
    pending: [u32; HEIGHT],
    pub alive: [u32; HEIGHT],
    /// Fragments that were shaded since the tile was started.
    pub fragments: u64,
    /// Premultiplied linear colour and opacity so far; the largest value and 1 for maximum intensity.
    pub sum: [Plane; 4],
    /// Where the last fragment looked for the value at the next slice, and that value.
    pub seen_at: [Plane; 3],
    pub seen: Plane,
    /// Unit direction to the eye, the half vector between it and the light, and 1/cos of the ray with the view axis.
    pub to_eye: [Plane; 3],
    pub half: [Plane; 3],
    pub stretch: Plane,
}

impl Tile {
    pub fn new() -> Box<Self> {
        Box::new(Self {
            origin: [0; 2],
            size: [0; 2],
            front: [[0.0; AREA]; 3],
            back: [[0.0; AREA]; 3],
            jacobian: [0.0; 9],
            jacobians: None,
            varies: false,
            within: false,
            pending: [0; HEIGHT],
            alive: [0; HEIGHT],
            fragments: 0,
            sum: [[0.0; AREA]; 4],
            seen_at: [[0.0; AREA]; 3],
            seen: [0.0; AREA],
            to_eye: [[0.0; AREA]; 3],
            half: [[0.0; AREA]; 3],
            stretch: [1.0; AREA],
        })
    }

    /// Starts at tile (`across`, `down`): nothing drawn, view directions computed.
    pub fn start<T: Texel, const C: usize>(&mut self, scene: &Scene<'_, T, C>, across: usize, down: usize) {
        let frame = scene.frame;
        self.origin = [(across * WIDTH) as i64, (down * HEIGHT) as i64];
        let left = |axis: usize, side: usize| (i64::from(frame.size[axis]) - self.origin[axis]).min(side as i64);
        self.size = [left(0, WIDTH), left(1, HEIGHT)];
        self.pending = [0; HEIGHT];
        self.within = scene.exact.is_none();
        self.fragments = 0;
        self.alive = [0; HEIGHT];
        self.alive[..self.size[1] as usize].fill(bits(0..self.size[0] as usize));
        self.sum = [[0.0; AREA]; 4];
        // no fragment lies there
        self.seen_at[0].fill(f32::INFINITY);
        let [eye, axis, light] =
            [frame.eye, frame.axis, frame.light].map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into()));
        for row in 0..self.size[1] {
            for column in 0..self.size[0] {
                let [x, y] = [self.origin[0] + column, self.origin[1] + row].map(|v| v as f64 + 0.5);
                let ndc =
                    DVec3::new(2.0 * x / f64::from(frame.size[0]) - 1.0, 1.0 - 2.0 * y / f64::from(frame.size[1]), 0.5);
                let p = scene.local_from_clip.project_point3(ndc);
                let to_eye = (eye - f64::from(frame.eye[3]) * p).normalize();
                let half = (to_eye + light).normalize_or_zero();
                let i = row as usize * WIDTH + column as usize;
                for a in 0..3 {
                    self.to_eye[a][i] = to_eye[a] as f32;
                    self.half[a][i] = half[a] as f32;
                }
                self.stretch[i] = (1.0 / axis.dot(to_eye)) as f32;
            }
        }
    }

    /// Whether nothing further back can be seen.
    pub fn is_done(&self) -> bool {
        self.alive.iter().all(|row| *row == 0)
    }

    /// Takes the fragments of a triangle, which lies in front of nothing drawn so far.
    pub fn draw<T: Texel, const C: usize>(&mut self, scene: &Scene<'_, T, C>, t: usize) {
        let size = [scene.frame.size[0], scene.frame.size[1]];
        let Some(setup) = Setup::new(scene.geometry, scene.corners, t, size) else { return };
        let within = |r: &std::ops::Range<i64>, axis: usize| {
            r.start.max(self.origin[axis])..r.end.min(self.origin[axis] + self.size[axis])
        };
        let (xs, ys) = (within(&setup.x, 0), within(&setup.y, 1));
        if xs.is_empty() || ys.is_empty() {
            return;
        }
        let Some(cuts) = setup.cutting(&xs, &ys) else { return };
        let corners = setup.vertices.map(|v| &scene.geometry.vertices[v]);
        let varies = scene.has_gradient()
            && scene.exact.is_none()
            && (corners[1].jacobian != corners[0].jacobian || corners[2].jacobian != corners[0].jacobian);
        if scene.has_gradient()
            && scene.exact.is_none()
            && (varies != self.varies || (!varies && corners[0].jacobian != self.jacobian))
        {
            self.shade(scene);
            self.varies = varies;
            self.jacobian = corners[0].jacobian;
        }
        let lines = Lines::new(corners, scene);
        let within = corners.iter().all(|c| is_within(&c.front));
        // whether some rows may have nothing to see
        let mut gaps = scene.exact.is_none() && !scene.skip.full;
        if gaps {
            let [lo, hi] = lines.texels_over(&setup, &xs, &ys, scene);
            if scene.skip.is_empty(lo, hi) {
                return;
            }
            gaps = !scene.skip.is_full(lo, hi);
        }
        let [step1, step2] = setup.weight_steps();
        for y in ys {
            let span = setup.span(y, &xs, cuts);
            if span.is_empty() {
                continue;
            }
            let row = (y - self.origin[1]) as usize;
            let columns = (span.start - self.origin[0]) as usize..(span.end - self.origin[0]) as usize;
            let covered = bits(columns.clone()) & self.alive[row];
            if covered == 0 {
                continue;
            }
            if covered & self.pending[row] != 0 {
                self.shade(scene);
            }
            let covered = covered & self.alive[row];
            let weights = setup.weights(span.start, y);
            let [start, step] = [lines.at(weights), lines.along([step1, step2])];
            if gaps {
                let [lo, hi] = texels_between(start, step, columns.len() - 1, scene);
                if scene.skip.is_empty(lo, hi) {
                    continue;
                }
            }
            self.pending[row] |= covered;
            self.within &= within;
            let halves = |line: [f32; 6]| {
                let [a, b, c, d, e, f] = line;
                [[a, b, c], [d, e, f]]
            };
            let ([start, back_start], [step, back_step]) = (halves(start), halves(step));
            scene.best.run(Fill { planes: &mut self.front, lines: [start, step], row, columns: columns.clone() });
            if scene.back {
                let lines = [back_start, back_step];
                scene.best.run(Fill { planes: &mut self.back, lines, row, columns: columns.clone() });
            }
            if varies {
                let planes = self.jacobians.get_or_insert_with(|| Box::new([[0.0; AREA]; 9]));
                let lines = jacobian_lines(corners, weights, [step1, step2]);
                scene.best.run(Fill { planes, lines, row, columns });
            }
        }
    }

    /// Shades all collected fragments.
    pub fn shade<T: Texel, const C: usize>(&mut self, scene: &Scene<'_, T, C>) {
        scene.best.run(Shade { tile: self, scene });
        self.within = scene.exact.is_none();
    }

    #[inline(always)]
    fn shade_rows<M: Machine, T: Texel, const C: usize>(&mut self, m: M, scene: &Scene<'_, T, C>) {
        for row in 0..HEIGHT {
            if self.pending[row] == 0 {
                continue;
            }
            let pending = std::mem::take(&mut self.pending[row]);
            self.fragments += u64::from(pending.count_ones());
            if let Some(exact) = &scene.exact {
                self.apply(scene, exact, row, pending);
            }
            let opaque = self.row(m, scene, row, pending);
            self.alive[row] &= !opaque;
        }
    }

    /// Replaces positions by what the exact map says.
    fn apply<T: Texel, const C: usize>(
        &mut self,
        scene: &Scene<'_, T, C>,
        exact: &Exact<'_>,
        row: usize,
        mut pending: u32,
    ) {
        self.varies = true;
        let planes = self.jacobians.get_or_insert_with(|| Box::new([[0.0; AREA]; 9]));
        while pending != 0 {
            let i = row * WIDTH + pending.trailing_zeros() as usize;
            pending &= pending - 1;
            let f = exact.fragment([0, 1, 2].map(|a: usize| self.front[a][i]), scene.geometry.center, scene.frame);
            for a in 0..3 {
                self.front[a][i] = f.front[a] as f32;
                self.back[a][i] = f.back[a] as f32;
            }
            for (plane, v) in planes.iter_mut().zip(f.jacobian.to_cols_array()) {
                plane[i] = v as f32;
            }
        }
    }

    /// Rows of the tile: row and first column in the picture, and sums.
    pub fn rows(&self) -> impl Iterator<Item = (usize, usize, impl Iterator<Item = [f32; 4]>)> {
        (0..self.size[1] as usize).map(|row| {
            let pixels = row * WIDTH..row * WIDTH + self.size[0] as usize;
            let sums = pixels.map(|i| [0, 1, 2, 3].map(|c: usize| self.sum[c][i]));
            (self.origin[1] as usize + row, self.origin[0] as usize, sums)
        })
    }
}

fn bits(columns: std::ops::Range<usize>) -> u32 {
    if columns.is_empty() { 0 } else { (u32::MAX >> (32 - columns.len())) << columns.start }
}

/// Where the Jacobian of a row of fragments begins, and its change from one to the next.
fn jacobian_lines(corners: [&super::SliceVertex; 3], weights: [f64; 2], steps: [f64; 2]) -> [[f32; 9]; 2] {
    let [a, b, c] = corners.map(|c| &c.jacobian);
    let ([w1, w2], [s1, s2]) = (weights.map(|w| w as f32), steps.map(|w| w as f32));
    let mut lines = [[0.0; 9]; 2];
    for i in 0..9 {
        let (along1, along2) = (b[i] - a[i], c[i] - a[i]);
        lines[0][i] = a[i] + (w1 * along1 + w2 * along2);
        lines[1][i] = s1 * along1 + s2 * along2;
    }
    lines
}

/// Writes linear functions into some columns of a row of planes. Rows of triangles are short: eight pixels at a time, what
/// lies beside them stays.
struct Fill<'t, const N: usize> {
    planes: &'t mut [Plane; N],
    /// At the first column, and from one to the next.
    lines: [[f32; N]; 2],
    row: usize,
    columns: std::ops::Range<usize>,
}

impl<const N: usize> Work for Fill<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<M: Machine>(self, m: M) {
        let Self { planes, lines: [starts, steps], row, columns } = self;
        let all = bits(columns.clone());
        let (first, last) = (columns.start / LANES, (columns.end - 1) / LANES);
        let count = F8::load(m, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        for group in first..=last {
            let (at, mask) = (row * WIDTH + group * LANES, all >> (group * LANES) & 0xff);
            let number = count + ((group * LANES) as f32 - columns.start as f32);
            for i in 0..N {
                let line = number * steps[i] + starts[i];
                line.or(mask, F8::at(m, &planes[i], at)).put(&mut planes[i], at);
            }
        }
    }
}

/// Front and back coordinates as linear functions of the corner weights.
struct Lines {
    origin: [f32; 6],
    sides: [[f32; 6]; 2],
}

impl Lines {
    fn new<T: Texel, const C: usize>(corners: [&super::SliceVertex; 3], scene: &Scene<'_, T, C>) -> Self {
        let all = corners.map(|c| {
            let f = if scene.exact.is_some() { c.position } else { c.front };
            [f[0], f[1], f[2], c.back[0], c.back[1], c.back[2]]
        });
        let side = |i: usize| std::array::from_fn(|a| all[i][a] - all[0][a]);
        Self { origin: all[0], sides: [side(1), side(2)] }
    }

    fn along(&self, w: [f64; 2]) -> [f32; 6] {
        let w = w.map(|w| w as f32);
        std::array::from_fn(|a| w[0] * self.sides[0][a] + w[1] * self.sides[1][a])
    }

    fn at(&self, w: [f64; 2]) -> [f32; 6] {
        let along = self.along(w);
        std::array::from_fn(|a| self.origin[a] + along[a])
    }

    /// Texel coordinates between which the fragments of a rectangle lie; more if it sticks out of the triangle.
    fn texels_over<T: Texel, const C: usize>(
        &self,
        setup: &Setup,
        xs: &std::ops::Range<i64>,
        ys: &std::ops::Range<i64>,
        scene: &Scene<'_, T, C>,
    ) -> [[f32; 3]; 2] {
        let at = |x: i64, y: i64| self.at(setup.weights(x, y));
        let (x, y) = (xs.end - 1, ys.end - 1);
        texels(&[at(xs.start, ys.start), at(x, ys.start), at(xs.start, y), at(x, y)], scene)
    }
}

/// Texel coordinates between which the fragments of a span lie.
fn texels_between<T: Texel, const C: usize>(
    start: [f32; 6],
    step: [f32; 6],
    steps: usize,
    scene: &Scene<'_, T, C>,
) -> [[f32; 3]; 2] {
    let end = std::array::from_fn(|a| start[a] + steps as f32 * step[a]);
    texels(&[start, end], scene)
}

/// Texel coordinates of the box around fragments.
#[inline(always)]
fn texels<T: Texel, const C: usize>(points: &[[f32; 6]], scene: &Scene<'_, T, C>) -> [[f32; 3]; 2] {
    // one instruction each, unlike `f32::min`; `texel` makes the best of what is not a number
    let least = |a: f32, b: f32| if a < b { a } else { b };
    let most = |a: f32, b: f32| if a > b { a } else { b };
    // interpolation along the span rounds
    let slack = 1e-5;
    let mut out = [[0.0; 3]; 2];
    for a in 0..3 {
        let (mut lo, mut hi) = (f32::INFINITY, f32::NEG_INFINITY);
        for p in points {
            let (f, b) = (p[a], if scene.back { p[a + 3] } else { p[a] });
            lo = least(least(lo, f), b);
            hi = most(most(hi, f), b);
        }
        out[0][a] = scene.sampler.texel(lo - slack, a);
        out[1][a] = scene.sampler.texel(hi + slack, a);
    }
    out
}

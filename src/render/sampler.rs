//! Trilinear samples of a field, [`LANES`] at a time.
//!
//! Addresses and weights are computed for all lanes at once, texels are fetched lane by lane (two or four neighbours in one
//! load), and the interpolation runs over all lanes again.

use std::borrow::Cow;

use super::{Field, Frame};
use crate::math::lanes::{F8, I8, LANES, Machine};

/// A type of texels, and how those around eight fragments come from memory.
pub trait Texel: Copy + Default + Send + Sync + 'static {
    /// From a stored texel to the sampler's 0..1.
    const UNIT: f32;
    fn value(self) -> f32;
    /// The texels at `at` and `next` on, for each lane.
    fn pair<M: Machine>(m: M, line: &[Self], at: &[usize; LANES], next: usize) -> [F8<M>; 2];
    /// The texels at `at` and three more, each `next` on, for each lane.
    fn row<M: Machine>(m: M, line: &[Self], at: &[usize; LANES], next: usize) -> [F8<M>; 4];
}

/// An array by lanes. Written out, so that texels go from memory to vectors: a loop would put them on the stack first.
macro_rules! by_lane {
    ($at:ident, $i:ident => $texel:expr) => {{
        macro_rules! of {
            ($l:literal) => {{
                let $i = $at[$l];
                $texel
            }};
        }
        [of!(0), of!(1), of!(2), of!(3), of!(4), of!(5), of!(6), of!(7)]
    }};
}

impl Texel for u8 {
    const UNIT: f32 = 1.0 / 255.0;
    #[inline(always)]
    fn value(self) -> f32 {
        f32::from(self)
    }
    #[inline(always)]
    fn pair<M: Machine>(m: M, t: &[u8], at: &[usize; LANES], next: usize) -> [F8<M>; 2] {
        let both = by_lane!(at, i => i32::from(u16::from_le_bytes(texels_from(t, i, next))));
        let both = I8::load(m, both);
        [both.and(I8::splat(m, 0xff)).to_float(), both.shift_right::<8>().to_float()]
    }
    #[inline(always)]
    fn row<M: Machine>(m: M, t: &[u8], at: &[usize; LANES], next: usize) -> [F8<M>; 4] {
        let all = I8::load(m, by_lane!(at, i => i32::from_le_bytes(texels_from(t, i, next))));
        let low = I8::splat(m, 0xff);
        [
            all.and(low).to_float(),
            all.shift_right::<8>().and(low).to_float(),
            all.shift_right::<16>().and(low).to_float(),
            all.shift_right::<24>().to_float(),
        ]
    }
}

/// Texels from `at` on, each `next` from the one before; neighbours in one load. (Of bytes taken one by one, the compiler
/// makes vector code that takes longer.)
#[inline(always)]
fn texels_from<T: Texel, const N: usize>(t: &[T], at: usize, next: usize) -> [T; N] {
    let mut out = [T::default(); N];
    if next == 1 {
        out.copy_from_slice(&t[at..at + N]);
    } else {
        let t = &t[at..=at + (N - 1) * next];
        for i in 0..N {
            out[i] = t[i * next];
        }
    }
    out
}

impl Texel for u16 {
    const UNIT: f32 = 1.0 / 65535.0;
    #[inline(always)]
    fn value(self) -> f32 {
        f32::from(self)
    }
    #[inline(always)]
    fn pair<M: Machine>(m: M, t: &[u16], at: &[usize; LANES], next: usize) -> [F8<M>; 2] {
        let both = by_lane!(at, i => bytemuck::cast::<[u16; 2], i32>(texels_from(t, i, next)));
        let both = I8::load(m, both);
        [both.and(I8::splat(m, 0xffff)).to_float(), both.shift_right::<16>().to_float()]
    }
    #[inline(always)]
    fn row<M: Machine>(m: M, t: &[u16], at: &[usize; LANES], next: usize) -> [F8<M>; 4] {
        let [a, b] = Self::pair(m, t, at, next);
        let [c, d] = Self::pair(m, t, &at.map(|i| i + 2 * next), next);
        [a, b, c, d]
    }
}

impl Texel for f32 {
    const UNIT: f32 = 1.0;
    #[inline(always)]
    fn value(self) -> f32 {
        self
    }
    #[inline(always)]
    fn pair<M: Machine>(m: M, t: &[f32], at: &[usize; LANES], next: usize) -> [F8<M>; 2] {
        [F8::load(m, by_lane!(at, i => t[i])), F8::load(m, by_lane!(at, i => t[i + next]))]
    }
    #[inline(always)]
    fn row<M: Machine>(m: M, t: &[f32], at: &[usize; LANES], next: usize) -> [F8<M>; 4] {
        let [a, b] = Self::pair(m, t, at, next);
        let [c, d] = [F8::load(m, by_lane!(at, i => t[i + 2 * next])), F8::load(m, by_lane!(at, i => t[i + 3 * next]))];
        [a, b, c, d]
    }
}

#[inline(always)]
fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + t * (b - a)
}

/// `max` and `min` that are one instruction each; NaN becomes the lower bound.
#[inline(always)]
fn clamp(v: f32, lo: f32, hi: f32) -> f32 {
    let v = if v > lo { v } else { lo };
    if v < hi { v } else { hi }
}

/// The field as its texels are stored: `C` channels, of which the last is the value.
pub struct Sampler<'a, T: Texel, const C: usize> {
    texels: &'a [T],
    /// From the values of the four rows of a cell on, and from those of the twelve around it; of one length each.
    cell: [&'a [T]; 4],
    around: [&'a [T]; ROWS.len()],
    /// Texels along each axis, as integers and as the scale from texture space; at least 2 stand in memory.
    dims: [i32; 3],
    size: [f32; 3],
    /// Largest texel coordinate, a little below the last texel so that a whole cell lies there.
    last: [f32; 3],
    /// Texels from one to the next along y and z; 32 bits, so that sums of them cannot overflow and bounds are checked once.
    step: [u32; 2],
    /// Rows along x from one to the next along z.
    deep: u32,
    /// Whether the number of a texel takes more than 32 bits.
    wide: bool,
    scale: f32,
    bias: f32,
}

impl<'a, T: Texel, const C: usize> Sampler<'a, T, C> {
    /// The texels as a sampler needs them: a field one texel thin is doubled, so that every cell has eight corners.
    pub fn memory(field: &Field, texels: &'a [T]) -> Cow<'a, [T]> {
        let dims = field.grid.dims;
        let memory = dims.map(|n| n.max(2));
        if memory == dims { Cow::Borrowed(texels) } else { Cow::Owned(doubled(dims, memory, texels, C)) }
    }

    /// `texels` as [`Sampler::memory`] gives them.
    pub fn new(field: &Field, texels: &'a [T], frame: &Frame) -> Self {
        let dims = field.grid.dims;
        let memory = dims.map(|n| n.max(2));
        let step = [memory[0], memory[0] * memory[1]];
        let [sy, sz] = step.map(|s| s * C);
        let offsets = ROWS.map(|(y, z)| (y + 1) as usize * sy + (z + 1) as usize * sz + C - 1);
        let wide = texels.len() / C > u32::MAX as usize;
        Self {
            wide,
            texels,
            cell: lines(texels, [0, sy, sz, sy + sz].map(|at| at + C - 1)),
            around: lines(texels, offsets),
            dims: dims.map(|n| n as i32),
            size: dims.map(|n| n as f32),
            last: dims.map(|n| (n - 1) as f32 * (1.0 - 3e-7)),
            step: step.map(|s| s as u32),
            deep: memory[1] as u32,
            scale: frame.window[0] * T::UNIT,
            bias: frame.window[1],
        }
    }

    #[inline(always)]
    fn in_window<M: Machine>(&self, texel: F8<M>) -> F8<M> {
        texel.times_plus(self.scale, self.bias).clamp(0.0, 1.0)
    }

    /// Texel coordinate along `axis`, at the edge where outside.
    #[inline(always)]
    pub fn texel(&self, texture: f32, axis: usize) -> f32 {
        clamp(texture * self.size[axis] - 0.5, 0.0, self.last[axis])
    }

    /// Where the texels of cells begin.
    #[inline(always)]
    fn starts<M: Machine>(&self, [x, y, z]: [I8<M>; 3]) -> [usize; LANES] {
        let m = x.0;
        let rows = y + z * I8::splat(m, self.deep as i32);
        if self.wide {
            let (rows, x) = (rows.lanes(), x.lanes());
            return std::array::from_fn(|l| (rows[l] as u32 as usize * self.step[0] as usize + x[l] as usize) * C);
        }
        let i = (x + rows * I8::splat(m, self.step[0] as i32)).lanes();
        std::array::from_fn(|l| i[l] as u32 as usize * C)
    }

    /// The cell along an axis, and where in it a coordinate lies.
    #[inline(always)]
    fn cell<M: Machine>(&self, at: F8<M>, axis: usize) -> (I8<M>, F8<M>) {
        let t = at.times_plus(self.size[axis], -0.5).clamp(0.0, self.last[axis]);
        let cell = t.truncate();
        (cell, t - cell.to_float())
    }

    /// Values in the window at texture coordinates.
    #[inline(always)]
    pub fn values<M: Machine>(&self, m: M, at: &[F8<M>; 3]) -> F8<M> {
        let (x, fx) = self.cell(at[0], 0);
        let (y, fy) = self.cell(at[1], 1);
        let (z, fz) = self.cell(at[2], 2);
        let at = self.starts([x, y, z]);
        // all of one length, so that one comparison does for four look-ups
        let [a, b, c, d] = self.cell;
        let n = a.len();
        let (b, c, d) = (&b[..n], &c[..n], &d[..n]);
        let a = pair(m, a, &at, C, fx);
        let b = pair(m, b, &at, C, fx);
        let c = pair(m, c, &at, C, fx);
        let d = pair(m, d, &at, C, fx);
        self.in_window(a.towards(b, fy).towards(c.towards(d, fy), fz))
    }

    /// One more than the cell along an axis, the first of its four texels where all exist, and where in the cell a coordinate
    /// lies. `edge` becomes not 0 if one of the four is missing.
    #[inline(always)]
    fn cell_between<M: Machine>(&self, at: F8<M>, axis: usize, mask: u32, edge: &mut u32) -> (I8<M>, I8<M>, F8<M>) {
        // not kept at the edge: each neighbour is; counted from one texel further out, so that it is not negative
        let size = self.size[axis];
        let t = at.times_plus(size, 0.5).clamp(0.5, size + 0.5);
        let cell = t.truncate();
        *edge |= mask & (t.below(2.0) | !t.below(size - 1.0));
        // lanes that are left out may lie anywhere: they read some texels
        let first = (t - 2.0).clamp(0.0, (size - 4.0).max(0.0)).truncate();
        (cell, first, t - cell.to_float())
    }

    /// Differences of the values one texel to each side along each axis, for the lanes of `mask`.
    #[inline(always)]
    pub fn differences<M: Machine>(&self, m: M, at: &[F8<M>; 3], mask: u32) -> [F8<M>; 3] {
        // whether a neighbour may lie beyond the edge
        let mut edge = u32::from(self.dims.iter().any(|n| *n < 4));
        let (x, kx, fx) = self.cell_between(at[0], 0, mask, &mut edge);
        let (y, ky, fy) = self.cell_between(at[1], 1, mask, &mut edge);
        let (z, kz, fz) = self.cell_between(at[2], 2, mask, &mut edge);
        const N: usize = 4 * ROWS.len();
        let near;
        let (lines, at) = if edge != 0 {
            // a copy that keeps the way from texel to texel
            let mut copy = [T::default(); 4 * N * LANES];
            let cells = [x.lanes(), y.lanes(), z.lanes()];
            for l in (0..LANES).filter(|l| mask >> l & 1 == 1) {
                self.texels_at_edge(cells.map(|c| c[l] - 1), &mut copy[C * N * l..]);
            }
            near = copy;
            (lines(&near, std::array::from_fn(|r| 4 * C * r)), std::array::from_fn(|l| C * N * l))
        } else {
            (self.around, self.starts([kx, ky, kz]))
        };
        self.differences_of(m, lines, &at, [fx, fy, fz])
    }

    /// The same from lines of texels, and where in them the rows of each lane begin.
    #[inline(always)]
    fn differences_of<M: Machine>(
        &self,
        m: M,
        mut lines: [&[T]; ROWS.len()],
        at: &[usize; LANES],
        [fx, fy, fz]: [F8<M>; 3],
    ) -> [F8<M>; 3] {
        // all of one length, so that one comparison does for twelve look-ups
        let n = lines[0].len();
        for line in &mut lines {
            *line = &line[..n];
        }
        let r0 = T::row(m, lines[0], at, C);
        let r1 = T::row(m, lines[1], at, C);
        let r2 = T::row(m, lines[2], at, C);
        let r3 = T::row(m, lines[3], at, C);
        let mut column = r0;
        for i in 0..4 {
            column[i] = r0[i].towards(r1[i], fy).towards(r2[i].towards(r3[i], fy), fz);
        }
        let [x0, x1, x2, x3] = column;
        let dx = self.in_window(x2.towards(x3, fx)) - self.in_window(x0.towards(x1, fx));
        let (x0, x1) = (r0[1].towards(r0[2], fx), r1[1].towards(r1[2], fx));
        let (x2, x3) = (r2[1].towards(r2[2], fx), r3[1].towards(r3[2], fx));
        let inner = by_lane!(at, i => i + C);
        let mut outer = [fx; 8];
        for (outer, line) in outer.iter_mut().zip(&lines[4..]) {
            *outer = pair(m, line, &inner, C, fx);
        }
        let (y0, y1) = (x0.towards(x2, fz), x1.towards(x3, fz));
        let (before, after) = (outer[0].towards(outer[1], fz), outer[2].towards(outer[3], fz));
        let dy = self.in_window(y1.towards(after, fy)) - self.in_window(before.towards(y0, fy));
        let (z0, z1) = (x0.towards(x1, fy), x2.towards(x3, fy));
        let (before, after) = (outer[4].towards(outer[5], fy), outer[6].towards(outer[7], fy));
        let dz = self.in_window(z1.towards(after, fz)) - self.in_window(before.towards(z0, fz));
        [dx, dy, dz]
    }

    /// The texels around a cell, as they lie in memory, those beyond the edge as the last ones.
    fn texels_at_edge(&self, cell: [i32; 3], out: &mut [T]) {
        let at = |v: i32, axis: usize| v.clamp(0, self.dims[axis] - 1) as usize;
        for (r, (y, z)) in ROWS.iter().enumerate() {
            let start = at(cell[1] + y, 1) * self.step[0] as usize + at(cell[2] + z, 2) * self.step[1] as usize;
            for i in 0..4 {
                out[(4 * r + i) * C] = self.texels[(start + at(cell[0] - 1 + i as i32, 0)) * C + C - 1];
            }
        }
    }

    /// sRGB colour of an RGBA field at a texture coordinate, interpolated as stored.
    pub fn color(&self, at: [f32; 3]) -> [f32; 3] {
        let t: [f32; 3] = std::array::from_fn(|axis| self.texel(at[axis], axis));
        // `texel` stays below the last one, so the upper corner exists
        let c = t.map(|t| t as usize);
        let f: [f32; 3] = std::array::from_fn(|axis| t[axis] - c[axis] as f32);
        let step = self.step.map(|s| s as usize);
        let start = c[0] + c[1] * step[0] + c[2] * step[1];
        std::array::from_fn(|channel| {
            let texel = |i: usize| self.texels[i * C + channel].value();
            let x = |i: usize| lerp(texel(i), texel(i + 1), f[0]);
            let y = |i: usize| lerp(x(i), x(i + step[0]), f[1]);
            T::UNIT * lerp(y(start), y(start + step[1]), f[2])
        })
    }
}

/// Offsets along y and z of the rows that differences need: the cell's four, then y - 1, y + 2, z - 1, z + 2.
const ROWS: [(i32, i32); 12] =
    [(0, 0), (1, 0), (0, 1), (1, 1), (-1, 0), (-1, 1), (2, 0), (2, 1), (0, -1), (1, -1), (0, 2), (1, 2)];

/// Between two texels of each lane.
#[inline(always)]
fn pair<M: Machine, T: Texel>(m: M, line: &[T], at: &[usize; LANES], next: usize, part: F8<M>) -> F8<M> {
    let [a, b] = T::pair(m, line, at, next);
    a.towards(b, part)
}

/// Texels from some on, of one length; none where the last begins beyond the end.
fn lines<T, const N: usize>(texels: &[T], from: [usize; N]) -> [&[T]; N] {
    let last = from.into_iter().max().unwrap_or(0);
    let n = texels.len().saturating_sub(last);
    from.map(|at| if n > 0 { &texels[at..at + n] } else { &texels[..0] })
}

fn doubled<T: Copy>(dims: [usize; 3], memory: [usize; 3], texels: &[T], channels: usize) -> Vec<T> {
    let mut out = Vec::with_capacity(memory.iter().product::<usize>() * channels);
    for z in 0..memory[2] {
        for y in 0..memory[1] {
            for x in 0..memory[0] {
                let at = |v: usize, axis: usize| v.min(dims[axis] - 1);
                let i = ((at(z, 2) * dims[1] + at(y, 1)) * dims[0] + at(x, 0)) * channels;
                out.extend_from_slice(&texels[i..i + channels]);
            }
        }
    }
    out
}

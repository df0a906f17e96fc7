//! Trilinear samples of a field, [`LANES`] at a time.
//!
//! Addresses and weights are computed for all lanes at once, texels are fetched lane by lane (two or four neighbours in one
//! load), and the interpolation runs over all lanes again.

use std::borrow::Cow;

use super::{Field, Frame};

/// Fragments that are shaded together.
pub const LANES: usize = 8;

pub type Lanes = [f32; LANES];

/// A type of texels, with two and four neighbours along x packed as they come from one load.
pub trait Texel: Copy + Send + Sync + 'static {
    /// From a stored texel to the sampler's 0..1.
    const UNIT: f32;
    type Pair: Copy + Default;
    type Row: Copy + Default;
    fn value(self) -> f32;
    fn pair(a: Self, b: Self) -> Self::Pair;
    fn of_pair(p: Self::Pair, i: usize) -> f32;
    fn row(t: [Self; 4]) -> Self::Row;
    fn of_row(r: Self::Row, i: usize) -> f32;
}

impl Texel for u8 {
    const UNIT: f32 = 1.0 / 255.0;
    type Pair = u32;
    type Row = u32;
    #[inline(always)]
    fn value(self) -> f32 {
        f32::from(self)
    }
    #[inline(always)]
    fn pair(a: u8, b: u8) -> u32 {
        u32::from(u16::from_le_bytes([a, b]))
    }
    #[inline(always)]
    fn of_pair(p: u32, i: usize) -> f32 {
        // through i32: that is one instruction for four lanes
        (if i == 0 { p & 0xff } else { p >> 8 }) as i32 as f32
    }
    #[inline(always)]
    fn row(t: [u8; 4]) -> u32 {
        u32::from_le_bytes(t)
    }
    #[inline(always)]
    fn of_row(r: u32, i: usize) -> f32 {
        ((r >> (8 * i)) & 0xff) as i32 as f32
    }
}

impl Texel for u16 {
    const UNIT: f32 = 1.0 / 65535.0;
    type Pair = u32;
    type Row = [u32; 2];
    #[inline(always)]
    fn value(self) -> f32 {
        f32::from(self)
    }
    #[inline(always)]
    fn pair(a: u16, b: u16) -> u32 {
        u32::from(a) | u32::from(b) << 16
    }
    #[inline(always)]
    fn of_pair(p: u32, i: usize) -> f32 {
        (if i == 0 { p & 0xffff } else { p >> 16 }) as i32 as f32
    }
    #[inline(always)]
    fn row(t: [u16; 4]) -> [u32; 2] {
        [Self::pair(t[0], t[1]), Self::pair(t[2], t[3])]
    }
    #[inline(always)]
    fn of_row(r: [u32; 2], i: usize) -> f32 {
        Self::of_pair(r[i / 2], i % 2)
    }
}

impl Texel for f32 {
    const UNIT: f32 = 1.0;
    type Pair = [f32; 2];
    type Row = [f32; 4];
    #[inline(always)]
    fn value(self) -> f32 {
        self
    }
    #[inline(always)]
    fn pair(a: f32, b: f32) -> [f32; 2] {
        [a, b]
    }
    #[inline(always)]
    fn of_pair(p: [f32; 2], i: usize) -> f32 {
        p[i]
    }
    #[inline(always)]
    fn row(t: [f32; 4]) -> [f32; 4] {
        t
    }
    #[inline(always)]
    fn of_row(r: [f32; 4], i: usize) -> f32 {
        r[i]
    }
}

/// Adding this to a value in +-2^22 rounds it to the nearest integer, which then stands in the low bits.
pub const MAGIC: f32 = 12_582_912.0;

/// The integer in the low bits of `MAGIC + i`.
#[inline(always)]
pub fn integer(rounded: f32) -> i32 {
    rounded.to_bits() as i32 - MAGIC.to_bits() as i32
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
    texels: Cow<'a, [T]>,
    /// Texels along each axis, as integers and as the scale from texture space; at least 2 stand in memory.
    dims: [i32; 3],
    size: [f32; 3],
    /// Largest texel coordinate, a little below the last texel so that a whole cell lies there.
    last: [f32; 3],
    /// Texels from one to the next along y and z; 32 bits, so that sums of them cannot overflow and bounds are checked once.
    step: [u32; 2],
    /// Rows along x from one to the next along z.
    deep: u32,
    scale: f32,
    bias: f32,
}

impl<'a, T: Texel, const C: usize> Sampler<'a, T, C> {
    pub fn new(field: &Field, texels: &'a [T], frame: &Frame) -> Self {
        let dims = field.grid.dims;
        let memory = dims.map(|n| n.max(2));
        // a field one texel thin is doubled, so that every cell has eight corners
        let texels = if memory == dims { Cow::Borrowed(texels) } else { Cow::Owned(doubled(dims, memory, texels, C)) };
        Self {
            texels,
            dims: dims.map(|n| n as i32),
            size: dims.map(|n| n as f32),
            last: dims.map(|n| (n - 1) as f32 * (1.0 - 3e-7)),
            step: [memory[0] as u32, (memory[0] * memory[1]) as u32],
            deep: memory[1] as u32,
            scale: frame.window[0] * T::UNIT,
            bias: frame.window[1],
        }
    }

    #[inline(always)]
    fn in_window(&self, texel: f32) -> f32 {
        clamp(texel * self.scale + self.bias, 0.0, 1.0)
    }

    /// Texel coordinate along `axis`, at the edge where outside.
    #[inline(always)]
    pub fn texel(&self, texture: f32, axis: usize) -> f32 {
        clamp(texture * self.size[axis] - 0.5, 0.0, self.last[axis])
    }

    #[inline(always)]
    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + y * self.step[0] as usize + z * self.step[1] as usize
    }

    /// Pairs of the four rows of the cell whose first texel is `i`.
    #[inline(always)]
    fn cell(&self, i: usize) -> [T::Pair; 4] {
        let [y, z] = self.step.map(|s| s as usize * C);
        let t = &self.texels[i * C..][..y + z + 2 * C];
        let pair = |i: usize| T::pair(t[i + C - 1], t[i + 2 * C - 1]);
        [pair(0), pair(y), pair(z), pair(y + z)]
    }

    /// The values of four texels.
    #[inline(always)]
    fn row(t: &[T]) -> T::Row {
        T::row([t[C - 1], t[2 * C - 1], t[3 * C - 1], t[4 * C - 1]])
    }

    /// Values in the window at texture coordinates `at[axis][lane]`.
    #[inline(always)]
    pub fn values(&self, at: &[Lanes; 3]) -> Lanes {
        let mut cell = [[0.0f32; LANES]; 3];
        let mut part = [[0.0f32; LANES]; 3];
        for axis in 0..3 {
            for l in 0..LANES {
                let t = self.texel(at[axis][l], axis);
                let rounded = (t - 0.5) + MAGIC;
                cell[axis][l] = rounded;
                part[axis][l] = t - (rounded - MAGIC);
            }
        }
        // written out, so that texels go from memory to vectors: a loop would put them on the stack first, one by one
        let mut row = [0u32; LANES];
        for l in 0..LANES {
            row[l] = (integer(cell[2][l]) as u32).wrapping_mul(self.deep).wrapping_add(integer(cell[1][l]) as u32);
        }
        let c = |l: usize| self.cell(integer(cell[0][l]) as usize + row[l] as usize * self.step[0] as usize);
        let pairs = turned([c(0), c(1), c(2), c(3), c(4), c(5), c(6), c(7)]);
        let mut values = [0.0; LANES];
        for l in 0..LANES {
            let x = |r: usize| lerp(T::of_pair(pairs[r][l], 0), T::of_pair(pairs[r][l], 1), part[0][l]);
            let y0 = lerp(x(0), x(1), part[1][l]);
            let y1 = lerp(x(2), x(3), part[1][l]);
            values[l] = self.in_window(lerp(y0, y1, part[2][l]));
        }
        values
    }

    /// Differences of the values one texel to each side along each axis, for the lanes of `mask`.
    #[inline(always)]
    pub fn differences(&self, at: &[Lanes; 3], mask: u32) -> [Lanes; 3] {
        let mut cell = [[0.0f32; LANES]; 3];
        let mut part = [[0.0f32; LANES]; 3];
        for axis in 0..3 {
            for l in 0..LANES {
                // not kept at the edge: each neighbour is, below
                let t = clamp(at[axis][l] * self.size[axis] - 0.5, -0.5, self.size[axis] - 0.5);
                let rounded = (t - 0.5) + MAGIC;
                cell[axis][l] = rounded;
                part[axis][l] = t - (rounded - MAGIC);
            }
        }
        // rows along x of the cell and its neighbours along y (above, below) and z (above, below)
        let mut edge = self.dims.iter().any(|n| *n < 4);
        for axis in 0..3 {
            for l in 0..LANES {
                let (c, most) = (integer(cell[axis][l]), self.dims[axis] - 3);
                edge |= (mask >> l & 1 == 1) & ((c < 1) | (c > most));
            }
        }
        let mut rows = [[T::Row::default(); LANES]; 12];
        if edge {
            for l in (0..LANES).filter(|l| mask >> l & 1 == 1) {
                let c = [0, 1, 2].map(|axis| integer(cell[axis][l]));
                for (row, (y, z)) in rows.iter_mut().zip(ROWS) {
                    row[l] = self.row_at_edge([c[0] - 1, c[1] + y, c[2] + z]);
                }
            }
        } else {
            let step = self.step.map(|s| s as usize);
            // lanes that are left out may lie anywhere: they read some texels
            let start = |l: usize| {
                let c: [usize; 3] =
                    std::array::from_fn(|axis| integer(cell[axis][l]).clamp(1, self.dims[axis] - 3) as usize - 1);
                &self.texels[self.index(c) * C..][..(3 * (step[0] + step[1]) + 4) * C]
            };
            let t = [start(0), start(1), start(2), start(3), start(4), start(5), start(6), start(7)];
            for (row, (y, z)) in rows.iter_mut().zip(ROWS) {
                let i = ((y + 1) as usize * step[0] + (z + 1) as usize * step[1]) * C;
                let r = |l: usize| Self::row(&t[l][i..i + 4 * C]);
                *row = [r(0), r(1), r(2), r(3), r(4), r(5), r(6), r(7)];
            }
        }
        let mut d = [[0.0; LANES]; 3];
        for l in 0..LANES {
            let t = |r: usize, x: usize| T::of_row(rows[r][l], x);
            let [fx, fy, fz] = [part[0][l], part[1][l], part[2][l]];
            let column = |x: usize| lerp(lerp(t(0, x), t(1, x), fy), lerp(t(2, x), t(3, x), fy), fz);
            let (x0, x1, x2, x3) = (column(0), column(1), column(2), column(3));
            d[0][l] = self.in_window(lerp(x2, x3, fx)) - self.in_window(lerp(x0, x1, fx));
            let x = |r: usize| lerp(t(r, 1), t(r, 2), fx);
            let (y0, y1) = (lerp(x(0), x(2), fz), lerp(x(1), x(3), fz));
            let (before, after) = (lerp(x(4), x(5), fz), lerp(x(6), x(7), fz));
            d[1][l] = self.in_window(lerp(y1, after, fy)) - self.in_window(lerp(before, y0, fy));
            let (z0, z1) = (lerp(x(0), x(1), fy), lerp(x(2), x(3), fy));
            let (before, after) = (lerp(x(8), x(9), fy), lerp(x(10), x(11), fy));
            d[2][l] = self.in_window(lerp(z1, after, fz)) - self.in_window(lerp(before, z0, fz));
        }
        d
    }

    fn row_at_edge(&self, [x, y, z]: [i32; 3]) -> T::Row {
        let at = |v: i32, axis: usize| v.clamp(0, self.dims[axis] - 1) as usize;
        let start = at(y, 1) * self.step[0] as usize + at(z, 2) * self.step[1] as usize;
        T::row(std::array::from_fn(|i| self.texels[(start + at(x + i as i32, 0)) * C + C - 1]))
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

#[inline(always)]
fn turned<P: Copy>(c: [[P; 4]; LANES]) -> [[P; LANES]; 4] {
    let r = |r: usize| [c[0][r], c[1][r], c[2][r], c[3][r], c[4][r], c[5][r], c[6][r], c[7][r]];
    [r(0), r(1), r(2), r(3)]
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

//! Trilinear look-ups of many short rows at a time.
//!
//! A row in a tetrahedron has some ten voxels, fewer than two vectors, and one look-up is a long chain: coordinates, cell,
//! eight samples, seven blends. So rows are collected, as cells and fractions of their voxels, until there are some hundreds
//! of voxels, and then worked off in full vectors over small arrays, with many independent short chains. Only the samples go
//! voxel by voxel, two neighbours at a time.

use std::ops::Range;

use glam::DVec3;

use super::machine::{Machine, WIDEST, Work};
use super::row::{Place, Reader};
use crate::math::prefetch;
use crate::volume::fetch::{Blend, Fetch};

/// Voxels of a full batch.
const FULL: usize = 512;

/// Room for a batch and what the last vector writes behind it.
const ROOM: usize = FULL + WIDEST;

/// Most rows that wait.
const ROWS: usize = 128;

/// Most voxels of a row that waits.
pub(super) const LONGEST: usize = 64;

/// A row of voxels that lie in the input, from the output's voxel `start` on.
#[derive(Clone, Copy, Default)]
pub(super) struct Row {
    pub place: Place,
    /// Where voxel 0 of the row lies, relative to the place.
    pub from: [f32; 3],
    /// The number of its first voxel to look up.
    pub number: f32,
    pub start: usize,
    pub count: u32,
    /// Whether it keeps away from the first and last samples.
    pub deep: bool,
}

/// Rows that wait to be looked up.
pub(super) struct Batch<T: Fetch> {
    /// Where in the output each row starts, and how many voxels it has.
    rows: [(usize, usize); ROWS],
    /// How many rows wait, and how many voxels they have.
    count: usize,
    voxels: usize,
    /// Voxels looked up so far.
    pub done: u64,
    /// Index of the lowest of the eight samples of each voxel.
    at: [i32; ROOM],
    /// Where in its cell each voxel lies.
    fraction: [[f32; ROOM]; 3],
    /// Neighbours along x, for each of the four lines through a cell.
    pairs: [[T::Pair; ROOM]; 4],
    value: [T; ROOM],
}

impl<T: Fetch> Batch<T> {
    pub fn new() -> Self {
        Self {
            rows: [(0, 0); ROWS],
            count: 0,
            voxels: 0,
            done: 0,
            at: [0; ROOM],
            fraction: [[0.0; ROOM]; 3],
            pairs: [[T::Pair::default(); ROOM]; 4],
            value: [T::zeroed(); ROOM],
        }
    }

    /// Adds a row whose voxels lie in the input, at most [`LONGEST`], and looks up what waits if there is no room for it. From
    /// code that is not compiled for the machine, [`Push`] is to be entered.
    #[inline(always)]
    pub fn push<M: Machine>(&mut self, machine: M, reader: &Reader<'_, T>, row: &Row, out: &mut [T]) {
        if self.voxels + row.count as usize > FULL || self.count == ROWS {
            self.flush(machine, reader, out);
        }
        // it is written when the batch is full
        let channels = reader.channels();
        let (mut line, end) = (row.start * channels, (row.start + row.count as usize) * channels - 1);
        prefetch::write(out, line);
        prefetch::write(out, end);
        let step = prefetch::LINE / size_of::<T>();
        while line + step < end {
            line += step;
            prefetch::write(out, line);
        }
        let stride = reader.stride.map(|s| s as i32);
        let [fx, fy, fz] = &mut self.fraction;
        let (mut number, mut first, last) = (row.number, self.voxels, self.voxels + row.count as usize);
        while first < last {
            let to = first..first + M::LANES;
            let fraction = [&mut fx[to.clone()], &mut fy[to.clone()], &mut fz[to.clone()]];
            if row.deep {
                machine.cells::<true>(row, stride, number, &mut self.at[to], fraction);
            } else {
                machine.cells::<false>(row, stride, number, &mut self.at[to], fraction);
            }
            first += M::LANES;
            number += M::LANES as f32;
        }
        self.rows[self.count] = (row.start, row.count as usize);
        self.count += 1;
        self.voxels = last;
    }

    /// Looks up what waits.
    #[inline(always)]
    pub fn flush<M: Machine>(&mut self, machine: M, reader: &Reader<'_, T>, out: &mut [T]) {
        machine.enter(Flush { batch: self, reader, out });
        self.done += self.voxels as u64;
        self.voxels = 0;
        self.count = 0;
    }

    /// Samples and blends, a vector at a time. Fetching keeps a processor's load and store units busy and blending its
    /// arithmetic, so that both together take little longer than one. What is blended was fetched one vector before: what was
    /// stored number by number this moment cannot be loaded as a vector yet.
    #[inline(always)]
    pub fn look_up<const LANES: usize, const FUSED: bool>(&mut self, reader: &Reader<'_, T>, channel: usize) {
        // all of one length, so that one comparison does for four look-ups
        let length = reader.lines[3].len();
        let lines = reader.lines.map(|line| &line[..length]);
        let vectors = self.voxels.div_ceil(LANES);
        for v in 0..=vectors {
            if v < vectors {
                self.fetch::<LANES>(lines, reader.channels(), channel, v * LANES);
            }
            if v > 0 {
                self.blend::<LANES, FUSED>((v - 1) * LANES);
            }
        }
    }

    #[inline(always)]
    fn fetch<const LANES: usize>(&mut self, [a, b, c, d]: [&[T]; 4], next: usize, channel: usize, from: usize) {
        let at = &self.at[from..from + LANES];
        let [pa, pb, pc, pd] = self.pairs.each_mut().map(|p| &mut p[from..from + LANES]);
        for l in 0..LANES {
            // from 32 bits, so that the next one is known not to wrap
            let at = at[l] as u32 as usize;
            if next == 1 {
                pa[l] = T::pair(a, at, 1);
                pb[l] = T::pair(b, at, 1);
                pc[l] = T::pair(c, at, 1);
                pd[l] = T::pair(d, at, 1);
            } else {
                let at = at + channel;
                pa[l] = T::pair(a, at, next);
                pb[l] = T::pair(b, at, next);
                pc[l] = T::pair(c, at, next);
                pd[l] = T::pair(d, at, next);
            }
        }
    }

    #[inline(always)]
    fn blend<const LANES: usize, const FUSED: bool>(&mut self, from: usize) {
        // written out: a closure over these would not be inlined, and run without vector code
        let fx = lanes::<_, LANES>(&self.fraction[0], from);
        let fy = lanes::<_, LANES>(&self.fraction[1], from);
        let fz = lanes::<_, LANES>(&self.fraction[2], from);
        let a = blend_pairs::<T, LANES, FUSED>(&lanes(&self.pairs[0], from), &fx);
        let b = blend_pairs::<T, LANES, FUSED>(&lanes(&self.pairs[1], from), &fx);
        let c = blend_pairs::<T, LANES, FUSED>(&lanes(&self.pairs[2], from), &fx);
        let d = blend_pairs::<T, LANES, FUSED>(&lanes(&self.pairs[3], from), &fx);
        let (ab, cd) = (blend::<_, LANES, FUSED>(&a, &b, &fy), blend::<_, LANES, FUSED>(&c, &d, &fy));
        let value = blend::<_, LANES, FUSED>(&ab, &cd, &fz);
        let mut out = [T::zeroed(); LANES];
        for l in 0..LANES {
            out[l] = T::narrow(value[l]);
        }
        self.value[from..from + LANES].copy_from_slice(&out);
    }

    /// Values to where they belong.
    #[inline(always)]
    fn scatter(&self, reader: &Reader<'_, T>, channel: usize, out: &mut [T]) {
        let channels = reader.channels();
        let mut from = 0;
        for &(start, count) in &self.rows[..self.count] {
            if channels == 1 {
                copy(&self.value, from, &mut out[start..start + count]);
            } else {
                let voxels = out[start * channels..(start + count) * channels].chunks_exact_mut(channels);
                voxels.zip(&self.value[from..from + count]).for_each(|(voxel, v)| voxel[channel] = *v);
            }
            from += count;
        }
    }

    /// Once more one by one where a value is not a finite number: NaN and infinity must not leak from samples whose weight
    /// is zero.
    #[cold]
    fn again(&self, reader: &Reader<'_, T>, out: &mut [T]) {
        let [sx, sy, sz] = reader.stride;
        let mut from = 0;
        for &(start, count) in &self.rows[..self.count] {
            for i in 0..count {
                let at = self.at[from + i] as usize;
                let cell = [at % sy / sx, at % sz / sy, at / sz];
                let p: [f64; 3] = std::array::from_fn(|a| cell[a] as f64 + f64::from(self.fraction[a][from + i]));
                let voxel = &mut out[(start + i) * sx..(start + i + 1) * sx];
                reader.single(DVec3::from_array(p), 1.0, voxel);
            }
            from += count;
        }
    }
}

/// A row of any length, on its way into a batch: it is to fill these voxels of the output.
pub(super) struct Push<'a, 'b, T: Fetch> {
    pub batch: &'a mut Batch<T>,
    pub reader: &'a Reader<'b, T>,
    pub row: Row,
    pub voxels: Range<usize>,
    pub out: &'a mut [T],
}

impl<T: Fetch> Work for Push<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) {
        let Self { batch, reader, row, voxels, out } = self;
        for start in voxels.clone().step_by(LONGEST) {
            let number = row.number + (start - voxels.start) as f32;
            let count = (voxels.end - start).min(LONGEST) as u32;
            batch.push(machine, reader, &Row { number, start, count, ..row }, out);
        }
    }
}

struct Flush<'a, 'b, T: Fetch> {
    batch: &'a mut Batch<T>,
    reader: &'a Reader<'b, T>,
    out: &'a mut [T],
}

impl<T: Fetch> Work for Flush<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) {
        let Self { batch, reader, out } = self;
        // what lies behind is fetched, too
        batch.at[batch.voxels..batch.voxels + WIDEST].fill(0);
        for channel in 0..reader.channels() {
            machine.look_up(batch, reader, channel);
            batch.scatter(reader, channel, out);
            if T::SPECIAL && !batch.value[..batch.voxels].iter().all(|v| v.to_f64().is_finite()) {
                // all channels at once, and they are right then
                batch.again(reader, out);
            }
        }
    }
}

/// One vector; arrays of its size are what the compiler makes vector code of.
#[inline(always)]
fn lanes<V: Copy + Default, const LANES: usize>(values: &[V; ROOM], from: usize) -> [V; LANES] {
    let mut out = [V::default(); LANES];
    out.copy_from_slice(&values[from..from + LANES]);
    out
}

/// Blends of neighbours.
#[inline(always)]
fn blend_pairs<T: Fetch, const LANES: usize, const FUSED: bool>(
    pairs: &[T::Pair; LANES],
    t: &[f32; LANES],
) -> [T::Wide; LANES] {
    let mut out = [T::Wide::default(); LANES];
    for l in 0..LANES {
        out[l] = T::Wide::blend::<FUSED>(T::of_pair(pairs[l], 0), T::of_pair(pairs[l], 1), t[l]);
    }
    out
}

#[inline(always)]
fn blend<W: Blend, const LANES: usize, const FUSED: bool>(
    a: &[W; LANES],
    b: &[W; LANES],
    t: &[f32; LANES],
) -> [W; LANES] {
    let mut out = [W::default(); LANES];
    for l in 0..LANES {
        out[l] = W::blend::<FUSED>(a[l], b[l], t[l]);
    }
    out
}

/// Copies `out.len()` values from `from` on. Short rows go in vectors, that overlap at the end: copies of any length call a
/// function.
#[inline(always)]
fn copy<T: Copy>(values: &[T; ROOM], from: usize, out: &mut [T]) {
    let values = &values[from..from + out.len()];
    let count = out.len();
    if count >= 8 {
        let mut done = 0;
        while done + 8 <= count {
            out[done..done + 8].copy_from_slice(&values[done..done + 8]);
            done += 8;
        }
        out[count - 8..].copy_from_slice(&values[count - 8..]);
    } else if count >= 4 {
        out[..4].copy_from_slice(&values[..4]);
        out[count - 4..].copy_from_slice(&values[count - 4..]);
    } else {
        out.iter_mut().zip(values).for_each(|(o, v)| *o = *v);
    }
}

//! Trilinear look-ups of many short rows at a time.
//!
//! A row in a tetrahedron has some ten voxels, fewer than two vectors, and one look-up is a long chain: coordinates, cell,
//! eight samples, seven blends. So rows are collected until there are some hundreds of voxels, and then worked off in three
//! passes over small arrays (cells and fractions, samples, blends), each with many independent short chains and full
//! vectors. Only the samples go voxel by voxel, two neighbours at a time.

use glam::DVec3;

use super::machine::{Machine, Row, WIDEST, Work};
use super::row::Reader;
use crate::math::prefetch;
use crate::volume::fetch::{Blend, Fetch};

/// Voxels of a full batch.
const FULL: usize = 512;

/// Room for a batch and what the last vector writes behind it.
const ROOM: usize = FULL + WIDEST;

/// Rows that wait to be looked up.
pub(super) struct Batch<T: Fetch> {
    /// Index of the lowest of the eight samples of each voxel.
    at: [i32; ROOM],
    /// Where in its cell each voxel lies.
    fraction: [[f32; ROOM]; 3],
    /// Neighbours along x, for each of the four lines through a cell.
    pairs: [[T::Pair; ROOM]; 4],
    value: [T; ROOM],
    voxels: usize,
    /// Voxel of the output where each row starts, and how many voxels it has.
    rows: Vec<(usize, usize)>,
}

impl<T: Fetch> Batch<T> {
    pub fn new() -> Self {
        Self {
            at: [0; ROOM],
            fraction: [[0.0; ROOM]; 3],
            pairs: [[T::Pair::default(); ROOM]; 4],
            value: [T::zeroed(); ROOM],
            voxels: 0,
            rows: Vec::with_capacity(FULL),
        }
    }

    /// Adds a row whose voxels lie in the input, and looks up what waits if there is no room for it. The row starts at voxel
    /// `start` of the output.
    #[inline(always)]
    pub fn push<M: Machine>(
        &mut self,
        machine: M,
        reader: &Reader<'_, T>,
        row: Row<'_>,
        start: usize,
        count: usize,
        out: &mut [T],
    ) {
        let mut done = 0;
        loop {
            let part = (count - done).min(FULL);
            if self.voxels + part > FULL {
                self.flush(machine, reader, out);
            }
            self.rows.push((start + done, part));
            // it is written when the batch is full
            let (mut line, end) = ((start + done) * reader.channels(), (start + done + part) * reader.channels() - 1);
            while line < end {
                prefetch::write(out, line);
                line += prefetch::LINE / size_of::<T>();
            }
            prefetch::write(out, end);
            let first = self.voxels;
            let [fx, fy, fz] = &mut self.fraction;
            let mut l = 0;
            while l < part {
                let to = first + l..first + l + M::LANES;
                let fraction = [&mut fx[to.clone()], &mut fy[to.clone()], &mut fz[to.clone()]];
                machine.cells(row, done + l, &mut self.at[to], fraction);
                l += M::LANES;
            }
            self.voxels += part;
            done += part;
            if done == count {
                return;
            }
        }
    }

    /// Looks up what waits.
    pub fn flush<M: Machine>(&mut self, machine: M, reader: &Reader<'_, T>, out: &mut [T]) {
        if self.voxels > 0 {
            machine.enter(Flush { batch: self, reader, out });
        }
        self.voxels = 0;
        self.rows.clear();
    }

    #[inline(always)]
    fn gather(&mut self, reader: &Reader<'_, T>, channel: usize) {
        let next = reader.channels();
        // all of one length, so that one comparison does for four look-ups
        let length = reader.lines[3].len();
        let [a, b, c, d] = reader.lines.map(|line| &line[..length]);
        let [pa, pb, pc, pd] = &mut self.pairs;
        let pairs = pa.iter_mut().zip(pb).zip(pc).zip(pd).zip(&self.at).take(self.voxels);
        for ((((pa, pb), pc), pd), at) in pairs {
            // from 32 bits, so that the next one is known not to wrap
            let at = *at as u32 as usize;
            if next == 1 {
                (*pa, *pb, *pc, *pd) = (T::pair(a, at, 1), T::pair(b, at, 1), T::pair(c, at, 1), T::pair(d, at, 1));
            } else {
                let at = at + channel;
                *pa = T::pair(a, at, next);
                *pb = T::pair(b, at, next);
                *pc = T::pair(c, at, next);
                *pd = T::pair(d, at, next);
            }
        }
    }

    #[inline(always)]
    pub fn blend<const LANES: usize, const FUSED: bool>(&mut self) {
        for v in 0..self.voxels.div_ceil(LANES) {
            let from = v * LANES;
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
    }

    /// Values to where they belong.
    #[inline(always)]
    fn scatter(&self, reader: &Reader<'_, T>, channel: usize, out: &mut [T]) {
        let channels = reader.channels();
        let mut from = 0;
        for &(start, count) in &self.rows {
            if channels == 1 {
                copy(&self.value, from, &mut out[start..start + count]);
            } else {
                let rows = out[start * channels..(start + count) * channels].chunks_exact_mut(channels);
                rows.zip(&self.value[from..from + count]).for_each(|(voxel, v)| voxel[channel] = *v);
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
        for &(start, count) in &self.rows {
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

/// A row for a batch, from code that is not compiled for the machine.
pub(super) struct Push<'a, 'b, T: Fetch> {
    pub batch: &'a mut Batch<T>,
    pub reader: &'a Reader<'b, T>,
    pub row: Row<'a>,
    pub start: usize,
    pub count: usize,
    pub out: &'a mut [T],
}

impl<T: Fetch> Work for Push<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) {
        self.batch.push(machine, self.reader, self.row, self.start, self.count, self.out);
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
        for channel in 0..reader.channels() {
            batch.gather(reader, channel);
            machine.blend(batch);
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

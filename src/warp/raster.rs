//! A slab of layers of the output: which voxels each tetrahedron holds, and which of them are its own.

use glam::DVec3;

use super::batch::{Batch, Push};
use super::cells::Candidates;
use super::machine::{self, Machine, Work};
use super::row::{EDGE, Line, Place, Reader};
use super::setup::Tet;
use super::touch;
use super::{Culling, OVERLAP, Warp, WarpOptions};
use crate::volume::fetch::Fetch;
use crate::volume::sampling::Sampler;

/// What was drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tally {
    /// Voxels that got a value from a tetrahedron (also where its rest position lies outside the input).
    pub written: u64,
    /// Voxels met again by a tetrahedron with a higher number; most lie on shared faces.
    pub repeated: u64,
    /// Of these, voxels within both tetrahedra: the mesh overlaps itself. Counted once for each further tetrahedron.
    pub covered_twice: u64,
    /// Written voxels whose rest position lies outside the input: they got the outside value.
    pub beyond: u64,
    /// Voxels that were tested.
    pub candidates: u64,
    /// Cells of all bounding boxes, and those that were not culled.
    pub cells: u64,
    pub cells_kept: u64,
}

impl Tally {
    pub(super) fn add(&mut self, other: &Self) {
        self.written += other.written;
        self.repeated += other.repeated;
        self.covered_twice += other.covered_twice;
        self.beyond += other.beyond;
    }
}

/// Rows of voxels that are solved for together: as many as the widest vector unit takes numbers.
const ROWS: usize = 8;

/// Layers of the output, and what is drawn into them.
pub(super) struct Slab<'a, T> {
    pub warp: &'a Warp,
    /// Which of its tetrahedra reach into the slab.
    pub tets: &'a [u32],
    pub input: Sampler<'a, T>,
    pub options: &'a WarpOptions,
    pub first: i32,
    pub layers: usize,
    pub samples: &'a mut [T],
    /// A bit for each voxel of the slab, set when it is written.
    pub written: &'a mut Vec<u64>,
}

impl<T: Fetch> Slab<'_, T> {
    pub fn draw(self, candidates: &Candidates<'_>) -> Tally {
        machine::run(Draw { slab: self, candidates })
    }
}

struct Draw<'a, 'b, T> {
    slab: Slab<'a, T>,
    candidates: &'b Candidates<'b>,
}

impl<T: Fetch> Work for Draw<'_, '_, T> {
    type Output = Tally;

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) -> Tally {
        let Slab { warp, tets, input, options, first, layers, samples, written } = self.slab;
        let [nx, ny, _] = warp.dims;
        let outside = T::from_f64(options.outside);
        written.clear();
        written.resize((nx * ny * layers).div_ceil(64), 0);
        let reader = Reader::new(input, options);
        let batch = Box::new(Batch::new());
        let mut canvas = Canvas { machine, nx, ny, first, samples, written, reader, batch, tally: Tally::default() };
        let last = first + layers as i32 - 1;
        for &t in tets {
            let tet = &warp.tets[t as usize];
            let place = canvas.reader.place(tet);
            let near = touch::layers::<T>(tet, canvas.reader.channels()).filter(|_| place.is_some());
            let from = tet.lo[2].max(first);
            for z in from..=tet.hi[2].min(last) {
                if let Some(near) = near.filter(|near| (z - from) % near == 0) {
                    touch::touch(tet, &canvas.reader, z, (z + near - 1).min(tet.hi[2]).min(last));
                }
                match self.candidates.culling {
                    Culling::Exact => canvas.solve(tet, &place, z),
                    _ => self.candidates.runs(t as usize, z, |y, from, to| canvas.run(tet, None, [from, y, z], to)),
                }
            }
        }
        canvas.batch.flush(machine, &canvas.reader, canvas.samples);
        canvas.fill(nx * ny * layers, outside);
        canvas.tally
    }
}

struct Canvas<'a, T: Fetch, M> {
    machine: M,
    nx: usize,
    ny: usize,
    first: i32,
    samples: &'a mut [T],
    written: &'a mut [u64],
    reader: Reader<'a, T>,
    batch: Box<Batch<T>>,
    tally: Tally,
}

impl<T: Fetch, M: Machine> Canvas<'_, T, M> {
    /// The voxels of layer `z`: for each row the interval where no barycentric coordinate is negative.
    #[inline(always)]
    fn solve(&mut self, tet: &Tet, place: &Option<Place>, z: i32) {
        let (top, bottom) = tet.rows(z);
        let height = f64::from(z - tet.anchor[2]);
        // crossing = at + y * slope; `side`: the interval begins there (1), ends there (-1), or the row runs along the
        // face (0) and lies inside or outside as a whole
        let mut at = [0.0; 4];
        let mut slope = [0.0; 4];
        let mut side = [0i32; 4];
        for (f, b) in tet.bary.iter().enumerate() {
            let rest = b[2] * height + b[3] + tet.slack;
            // less than this changes a coordinate by no more than the slack across a thousand voxels
            if b[0].abs() < 1e-12 {
                (at[f], slope[f]) = (rest, b[1]);
            } else {
                let inverse = -1.0 / b[0];
                (at[f], slope[f]) = (rest * inverse, b[1] * inverse);
                side[f] = if b[0] > 0.0 { 1 } else { -1 };
            }
        }
        let (left, right) = (f64::from(tet.lo[0] - tet.anchor[0]), f64::from(tet.hi[0] - tet.anchor[0]));
        let mut row = top;
        while row <= bottom {
            let mut lo = [left; ROWS];
            let mut hi = [right; ROWS];
            let y: [f64; ROWS] = std::array::from_fn(|r| f64::from(row - tet.anchor[1]) + r as f64);
            for f in 0..4 {
                let (a, s) = (at[f], slope[f]);
                match side[f] {
                    1 => (0..ROWS).for_each(|r| {
                        let q = a + s * y[r];
                        lo[r] = if q > lo[r] { q } else { lo[r] };
                    }),
                    -1 => (0..ROWS).for_each(|r| {
                        let q = a + s * y[r];
                        hi[r] = if q < hi[r] { q } else { hi[r] };
                    }),
                    _ => (0..ROWS).for_each(|r| hi[r] = if a + s * y[r] >= 0.0 { hi[r] } else { f64::MIN }),
                }
            }
            let lo = lo.map(f64::ceil);
            let hi = hi.map(f64::floor);
            let mut from = [[0.0; ROWS]; 3];
            let mut outside = [i64::from(place.is_none()); ROWS];
            if let Some(place) = place {
                for (a, from) in from.iter_mut().enumerate() {
                    let [rx, ry, rz, r] = tet.rest[a];
                    let r = rz * height + (r - place.base[a]);
                    let first: [f64; ROWS] = std::array::from_fn(|i| rx * lo[i] + ry * y[i] + r);
                    *from = first.map(|v| v as f32);
                    let (near, far) = (-EDGE - place.base[a], self.reader.last[a] + EDGE - place.base[a]);
                    for i in 0..ROWS {
                        let last = first[i] + rx * (hi[i] - lo[i]);
                        outside[i] |= i64::from(!(first[i] >= near));
                        outside[i] |= i64::from(!(first[i] <= far));
                        outside[i] |= i64::from(!(last >= near));
                        outside[i] |= i64::from(!(last <= far));
                    }
                }
            }
            for r in 0..ROWS.min((bottom - row + 1) as usize) {
                if lo[r] <= hi[r] {
                    let voxel = [lo[r] as i32 + tet.anchor[0], row + r as i32, z];
                    let start =
                        place.as_ref().filter(|_| outside[r] == 0).map(|p| (p, [from[0][r], from[1][r], from[2][r]]));
                    self.run(tet, start, voxel, hi[r] as i32 + tet.anchor[0]);
                }
            }
            row += ROWS as i32;
        }
    }

    /// The voxels of a row from `voxel` to index `to`, all in the tetrahedron: those that are not written yet are. `inside`:
    /// where the row starts in the input, if it lies in it.
    #[inline(always)]
    fn run(&mut self, tet: &Tet, inside: Option<(&Place, [f32; 3])>, voxel: [i32; 3], to: i32) {
        let [x, y, z] = voxel;
        let start = ((z - self.first) as usize * self.ny + y as usize) * self.nx + x as usize;
        let count = (to - x + 1) as usize;
        if claim(self.written, start, count) != 0 {
            self.run_in_parts(tet, voxel, start, count);
        } else if let Some((place, from)) = inside {
            self.tally.written += count as u64;
            let row = self.reader.row(place, from);
            self.batch.push(self.machine, &self.reader, row, start, count, self.samples);
        } else {
            self.write(tet, voxel, start, count);
        }
    }

    /// The same where some are written.
    #[cold]
    #[inline(never)]
    fn run_in_parts(&mut self, tet: &Tet, [from, y, z]: [i32; 3], start: usize, count: usize) {
        let mut begin = 0;
        while begin < count {
            let free = (begin..count).take_while(|i| take(self.written, start + i)).count();
            if free > 0 {
                self.write(tet, [from + begin as i32, y, z], start + begin, free);
            }
            begin += free;
            if begin < count {
                let within = tet.barycentric([from + begin as i32, y, z]).iter().all(|b| *b > OVERLAP);
                self.tally.repeated += 1;
                self.tally.covered_twice += u64::from(within);
                begin += 1;
            }
        }
    }

    /// The outside value for the voxels that were not written: once all are, so that no sample is stored twice.
    fn fill(&mut self, count: usize, outside: T) {
        let channels = self.reader.channels();
        let mut from = 0;
        while from < count {
            let word = self.written[from / 64] >> (from % 64);
            if word & 1 == 1 {
                from += word.trailing_ones() as usize;
                continue;
            }
            // zeros, also over many words
            let mut to = from + (word.trailing_zeros() as usize).min(64 - from % 64);
            while to.is_multiple_of(64) && to < count {
                let zeros = self.written[to / 64].trailing_zeros() as usize;
                to += zeros;
                if zeros < 64 {
                    break;
                }
            }
            let to = to.min(count);
            self.samples[from * channels..to * channels].fill(outside);
            from = to;
        }
    }

    #[inline(never)]
    fn write(&mut self, tet: &Tet, voxel: [i32; 3], start: usize, count: usize) {
        self.tally.written += count as u64;
        let channels = self.reader.channels();
        let out = &mut self.samples[start * channels..(start + count) * channels];
        let line = Line {
            from: tet.rest_position(voxel),
            step: DVec3::new(tet.rest[0][0], tet.rest[1][0], tet.rest[2][0]),
            weight: tet.jacobian,
        };
        let (inside, missed) = self.reader.read(&line, out);
        self.tally.beyond += missed as u64;
        if !inside.is_empty() {
            let (place, from) = self.reader.place_of(&line, inside.start, inside.end);
            let (row, start, count) = (self.reader.row(&place, from), start + inside.start, inside.len());
            let Self { batch, reader, samples: out, machine, .. } = self;
            machine.enter(Push { batch, reader, row, start, count, out });
        }
    }
}

/// Sets the bits `start..start + count` if none of them is set; returns whether (not 0) some are, and then sets none.
#[inline(always)]
fn claim(bits: &mut [u64], start: usize, count: usize) -> u64 {
    let (word, shift) = (start / 64, start % 64);
    if shift + count <= 64 {
        let mask = (u64::MAX >> (64 - count)) << shift;
        let taken = bits[word] & mask;
        if taken == 0 {
            bits[word] |= mask;
        }
        return taken;
    }
    let end = start + count;
    let mask = |w: usize| {
        let low = if w == word { u64::MAX << shift } else { u64::MAX };
        if (w + 1) * 64 > end { low & (u64::MAX >> ((w + 1) * 64 - end)) } else { low }
    };
    let words = word..end.div_ceil(64);
    let taken = words.clone().fold(0, |taken, w| taken | (bits[w] & mask(w)));
    if taken == 0 {
        words.for_each(|w| bits[w] |= mask(w));
    }
    taken
}

/// Sets a bit; false if it was set.
fn take(bits: &mut [u64], at: usize) -> bool {
    let bit = 1 << (at % 64);
    let free = bits[at / 64] & bit == 0;
    bits[at / 64] |= bit;
    free
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_claimed_once() {
        let mut state = 1u64;
        let mut next = |n: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % n
        };
        let mut bits = vec![0u64; 8];
        let mut plain = vec![false; 512];
        for _ in 0..300 {
            let start = next(500) as usize;
            let longest = if next(4) == 0 { 300 } else { 12 };
            let count = 1 + next((512 - start as u64).min(longest)) as usize;
            let free = plain[start..start + count].iter().all(|b| !b);
            assert_eq!(claim(&mut bits, start, count) == 0, free);
            if free {
                plain[start..start + count].fill(true);
            }
            for (i, set) in plain.iter().enumerate() {
                assert_eq!(bits[i / 64] >> (i % 64) & 1 == 1, *set);
            }
            if next(9) == 0 {
                bits.fill(0);
                plain.fill(false);
            }
        }
    }
}

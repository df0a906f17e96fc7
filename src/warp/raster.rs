//! A slab of layers of the output: which voxels each tetrahedron holds, and which of them are its own.

use std::ops::Range;

use glam::DVec3;

use super::batch::{Batch, LONGEST, Push, Row};
use super::cells::Candidates;
use super::machine::{self, Machine, Work};
use super::outline::{Layer, Outline, Spans};
use super::row::{DEEP, EDGE, Line, Part, Reader};
use super::setup::Tet;
use super::touch::{self, Ahead};
use super::{Culling, OVERLAP, Warp, WarpOptions};
use crate::math::lanes::{Doubles, LANES};
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
        // rows are claimed in two words
        written.resize((nx * ny * layers).div_ceil(64) + 1, 0);
        let reader = Reader::new(input, options);
        let (batch, tally) = (Box::new(Batch::new()), Tally::default());
        let mut canvas =
            Canvas { machine, nx, ny, first, samples, written, reader, batch, ahead: None, steps: 0, tally };
        let last = first + layers as i32 - 1;
        for &t in tets {
            let tet = &warp.tets[t as usize];
            let part = canvas.reader.part(tet);
            let outline = Outline::new(machine.doubles(), tet);
            let (from, to) = (tet.lo[2].max(first), tet.hi[2].min(last));
            let near = touch::layers::<T>(tet, canvas.reader.channels()).filter(|_| part.is_some());
            for z in from..=to {
                if let Some(near) = near {
                    canvas.prepare(tet, near, from, z, to);
                }
                match self.candidates.culling {
                    Culling::Exact => canvas.solve(tet, &part, z, &outline.layer(z)),
                    _ => {
                        canvas.ask(1);
                        self.candidates.runs(t as usize, z, |y, from, to| {
                            canvas.run(tet, [from, y, z], (to - from + 1) as usize);
                        });
                    }
                }
            }
        }
        canvas.batch.flush(machine, &canvas.reader, canvas.samples);
        canvas.fill(nx * ny * layers, outside);
        canvas.tally.written += canvas.batch.done;
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
    /// What of the input is needed next, and how much of it to ask for while the layer at hand is drawn.
    ahead: Option<Ahead>,
    steps: usize,
    tally: Tally,
}

impl<T: Fetch, M: Machine> Canvas<'_, T, M> {
    /// Before layer `z` of those from `from` to `to` is drawn: asks for what `near` layers need, if they are the first, and
    /// for some of what the next ones do.
    #[inline(always)]
    fn prepare(&mut self, tet: &Tet, near: i32, from: i32, z: i32, to: i32) {
        let done = (z - from) % near;
        if done == 0 {
            if z == from
                && let Some(mut ahead) = Ahead::new(tet, &self.reader, z, (z + near - 1).min(to))
            {
                for _ in 0..ahead.steps() {
                    ahead.step(self.machine.doubles(), &self.reader);
                }
            }
            let next = z + near;
            let more = next <= to;
            self.ahead = more.then(|| Ahead::new(tet, &self.reader, next, (next + near - 1).min(to))).flatten();
        }
        self.steps = self.ahead.as_ref().map_or(0, |ahead| ahead.steps().div_ceil((near - done) as usize));
    }

    /// Asks for some of what is needed next, while one of so many groups of rows is drawn.
    #[inline(never)]
    fn ask(&mut self, groups: usize) {
        let steps = self.steps.div_ceil(groups);
        self.steps -= steps;
        if let Some(ahead) = &mut self.ahead {
            self.machine.enter(Ask { ahead, reader: &self.reader, steps });
        }
    }

    /// The voxels of layer `z`: for each row the interval where no barycentric coordinate is negative.
    #[inline(always)]
    fn solve(&mut self, tet: &Tet, part: &Option<Part>, z: i32, layer: &Layer<M::Doubles>) {
        let m = self.machine.doubles();
        let height = f64::from(z - tet.anchor[2]);
        let first_row = (z - self.first) as usize * self.ny;
        let [mut row, bottom] = layer.rows;
        while row <= bottom {
            let rows = LANES.min((bottom - row + 1) as usize);
            if self.steps > 0 {
                self.ask((bottom - row) as usize / LANES + 1);
            }
            let Spans { y, first, last } = layer.spans(row);
            let mut some = m.up_to(first, last) & (u32::MAX >> (32 - rows));
            let length = m.minus(last, first);
            let (mut inside, mut deep) = (0, 0);
            let mut from = [[0.0; LANES]; 3];
            if let Some(part) = part {
                (inside, deep) = (u32::MAX, u32::MAX);
                for (a, from) in from.iter_mut().enumerate() {
                    let [rx, ry, rz, at] = tet.rest[a];
                    let at = m.all(rz * height + (at - part.base[a]));
                    let start = m.times_plus(m.all(rx), first, m.times_plus(m.all(ry), y, at));
                    let end = m.times_plus(m.all(rx), length, start);
                    let near = m.all(-EDGE - part.base[a]);
                    let far = m.all(self.reader.last[a] + EDGE - part.base[a]);
                    let (least, most) = (m.lesser(start, end), m.greater(start, end));
                    inside &= m.up_to(near, least) & m.up_to(most, far);
                    deep &= m.up_to(m.all(DEEP - part.base[a]), least)
                        & m.up_to(most, m.all(self.reader.last[a] - DEEP - part.base[a]));
                    *from = m.single(start);
                }
            }
            let (first, length) = (m.whole(first), m.whole(length));
            while some != 0 {
                let r = some.trailing_zeros() as usize % LANES;
                some &= some - 1;
                let voxel = [first[r] + tet.anchor[0], row + r as i32, z];
                let start = (first_row + voxel[1] as usize) * self.nx + voxel[0] as usize;
                let count = length[r] as usize + 1;
                let from = [from[0][r], from[1][r], from[2][r]];
                let Some(part) = part.as_ref().filter(|_| inside >> r & 1 == 1) else {
                    self.run(tet, voxel, count);
                    continue;
                };
                let deep = deep >> r & 1 == 1;
                let row = Row { place: part.place, from, number: 0.0, start, count: count as u32, deep };
                if count > LONGEST {
                    self.run_inside(tet, row, voxel);
                    continue;
                }
                let taken = claim(self.written, start, count);
                if taken == 0 {
                    self.batch.push(self.machine, &self.reader, &row, self.samples);
                } else {
                    self.draw(tet, Some(row), voxel, start, count, taken);
                }
            }
            row += LANES as i32;
        }
    }

    /// A row of any length from a voxel on, all in the tetrahedron: those that are not written yet are. They may lie outside
    /// the input.
    #[inline(never)]
    fn run(&mut self, tet: &Tet, [x, y, z]: [i32; 3], count: usize) {
        let start = ((z - self.first) as usize * self.ny + y as usize) * self.nx + x as usize;
        for first in (0..count).step_by(LONGEST) {
            let count = (count - first).min(LONGEST);
            let taken = claim(self.written, start + first, count);
            self.draw(tet, None, [x + first as i32, y, z], start + first, count, taken);
        }
    }

    /// The same if they lie in the input.
    #[inline(never)]
    fn run_inside(&mut self, tet: &Tet, row: Row, [x, y, z]: [i32; 3]) {
        let mut left = row;
        while left.count > 0 {
            let Self { batch, reader, samples: out, written, machine, .. } = self;
            let (part, taken) = machine.enter(Long { batch, reader, left: &mut left, written, out });
            if taken != 0 {
                let voxel = [x + (part.start - row.start) as i32, y, z];
                self.draw(tet, Some(part), voxel, part.start, part.count as usize, taken);
            }
        }
    }

    /// Voxels of the slab from `start` on, which are `voxel` of the output and those behind it, but not those with a bit in
    /// `taken`.
    #[inline(never)]
    fn draw(&mut self, tet: &Tet, inside: Option<Row>, voxel: [i32; 3], start: usize, count: usize, taken: u64) {
        let [x, y, z] = voxel;
        let mut free = !taken & (u64::MAX >> (64 - count));
        while free != 0 {
            let first = free.trailing_zeros();
            let length = (free >> first).trailing_ones();
            free &= !((u64::MAX >> (64 - length)) << first);
            let from = start + first as usize;
            let voxels = from..from + length as usize;
            if let Some(row) = inside {
                let row = Row { number: row.number + first as f32, ..row };
                let Self { batch, reader, samples: out, machine, .. } = self;
                machine.enter(Push { batch, reader, row, voxels, out });
            } else {
                self.write(tet, [x + first as i32, y, z], voxels);
            }
        }
        let mut again = taken;
        while again != 0 {
            let number = again.trailing_zeros() as i32;
            again &= again - 1;
            let within = tet.barycentric([x + number, y, z]).iter().all(|b| *b > OVERLAP);
            self.tally.repeated += 1;
            self.tally.covered_twice += u64::from(within);
        }
    }

    /// The outside value for the voxels that were not written: once all are, so that no sample is stored twice.
    fn fill(&mut self, count: usize, outside: T) {
        let channels = self.reader.channels();
        let mut from = find(self.written, 0, u64::MAX);
        while from < count {
            let to = find(self.written, from, 0).min(count);
            self.samples[from * channels..to * channels].fill(outside);
            from = find(self.written, to, u64::MAX);
        }
    }

    /// A row whose voxels may lie outside the input.
    #[inline(never)]
    fn write(&mut self, tet: &Tet, voxel: [i32; 3], voxels: Range<usize>) {
        let channels = self.reader.channels();
        let line = Line {
            from: tet.rest_position(voxel),
            step: DVec3::new(tet.rest[0][0], tet.rest[1][0], tet.rest[2][0]),
            weight: tet.jacobian,
        };
        let (inside, missed) =
            self.reader.read(&line, &mut self.samples[voxels.start * channels..voxels.end * channels]);
        self.tally.beyond += missed as u64;
        self.tally.written += (voxels.len() - inside.len()) as u64;
        if !inside.is_empty() {
            let row = self.reader.row(&line, inside.start, inside.end);
            let voxels = voxels.start + inside.start..voxels.start + inside.end;
            let Self { batch, reader, samples: out, machine, .. } = self;
            machine.enter(Push { batch, reader, row, voxels, out });
        }
    }
}

/// A long row that lies in the input: its parts are looked up but for the first of which some voxels are written, which is
/// returned with a bit for each of these. `left` is what is left of the row.
struct Long<'a, 'b, T: Fetch> {
    batch: &'a mut Batch<T>,
    reader: &'a Reader<'b, T>,
    left: &'a mut Row,
    written: &'a mut [u64],
    out: &'a mut [T],
}

impl<T: Fetch> Work for Long<'_, '_, T> {
    type Output = (Row, u64);

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) -> (Row, u64) {
        let Self { batch, reader, left, written, out } = self;
        loop {
            let count = (left.count as usize).min(LONGEST);
            let part = Row { count: count as u32, ..*left };
            let taken = claim(written, part.start, count);
            left.number += count as f32;
            left.start += count;
            left.count -= count as u32;
            if taken != 0 {
                return (part, taken);
            }
            batch.push(machine, reader, &part, out);
            if left.count == 0 {
                return (part, 0);
            }
        }
    }
}

struct Ask<'a, 'b, T> {
    ahead: &'a mut Ahead,
    reader: &'a Reader<'b, T>,
    steps: usize,
}

impl<T: Fetch> Work for Ask<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run<M: Machine>(self, machine: M) {
        for _ in 0..self.steps {
            self.ahead.step(machine.doubles(), self.reader);
        }
    }
}

/// Sets the bits `start..start + count`, from 1 to 64; returns those of them that were set, the first one lowest. There must
/// be a word behind that of the last one.
#[inline(always)]
fn claim(bits: &mut [u64], start: usize, count: usize) -> u64 {
    let (word, shift) = (start / 64, start % 64);
    let mask = u64::MAX >> (64 - count);
    let [low, high] = &mut bits[word..word + 2] else { return 0 };
    // by 64 in two steps, where the shift is 0
    let taken = (*low >> shift | *high << 1 << (63 - shift)) & mask;
    *low |= mask << shift;
    *high |= mask >> 1 >> (63 - shift);
    taken
}

/// The first bit from `from` on that differs from those of `other`; that behind the last if none does.
#[inline(always)]
fn find(bits: &[u64], from: usize, other: u64) -> usize {
    let mut at = from / 64;
    let mut differ = bits.get(at).map_or(0, |word| (word ^ other) & u64::MAX << (from % 64));
    while differ == 0 {
        at += 1;
        let Some(word) = bits.get(at) else { return bits.len() * 64 };
        differ = word ^ other;
    }
    at * 64 + differ.trailing_zeros() as usize
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
        let mut bits = vec![0u64; 9];
        let mut plain = vec![false; 576];
        for _ in 0..600 {
            let start = next(512) as usize;
            let longest = if next(4) == 0 { 64 } else { 12 };
            let count = 1 + next((512 - start as u64).min(longest)) as usize;
            let taken = claim(&mut bits, start, count);
            for (i, set) in plain[start..start + count].iter_mut().enumerate() {
                assert_eq!(taken >> i & 1 == 1, *set);
                *set = true;
            }
            assert_eq!(taken.checked_shr(count as u32).unwrap_or(0), 0);
            for (i, set) in plain.iter().enumerate() {
                assert_eq!(bits[i / 64] >> (i % 64) & 1 == 1, *set);
            }
            let later = |set: bool| (start..576).find(|i| plain[*i] == set).unwrap_or(576);
            assert_eq!(find(&bits, start, 0), later(true));
            assert_eq!(find(&bits, start, u64::MAX), later(false));
            if next(9) == 0 {
                bits.fill(0);
                plain.fill(false);
            }
        }
    }
}

//! Brings what a part of a tetrahedron reads near to the processor, before it is read voxel by voxel.
//!
//! Rows of the output run through the input at an angle, so that each step comes upon another line of samples, which no
//! processor foresees: look-ups then wait for memory one after the other. The part of the input behind some layers of a
//! tetrahedron is convex, and is gone through here in the order in which it lies in memory, one sample a line of the cache.
//!
//! A processor passes over what it is asked for too fast, and what was asked for too early is gone when it is needed: of a
//! large tetrahedron the next layers are asked for little by little while those before them are drawn.

use glam::{DMat3, DVec3};

use super::outline::Linear;
use super::row::Reader;
use super::setup::Tet;
use crate::math::lanes::{COUNT, Doubles, LANES};
use crate::math::prefetch;
use crate::volume::fetch::Fetch;

/// Bytes of samples that are brought near at a time: not much more than a core's nearest cache holds.
const ENOUGH: f64 = (48 << 10) as f64;

/// Bytes of a tetrahedron's samples that are not worth it.
const FEW: f64 = (4 << 10) as f64;

/// How many layers of a tetrahedron are brought near together; none if it is so small that it needs no help.
pub(super) fn layers<T>(tet: &Tet, channels: usize) -> Option<i32> {
    let rest = tet.rest_volume * (channels * size_of::<T>()) as f64;
    let deep = f64::from(tet.hi[2] - tet.lo[2] + 1);
    (rest > FEW).then(|| (deep * ENOUGH / rest).clamp(2.0, 1024.0) as i32)
}

/// Faces, two heights, and the bounds.
const PLANES: usize = 7;

/// What layers of a tetrahedron need of the input, to be asked for little by little.
pub(super) struct Ahead {
    /// Where rows of samples cross planes: what is needed lies behind all of these and before all of those.
    begin: [Linear; PLANES],
    begins: usize,
    end: [Linear; PLANES],
    ends: usize,
    /// First row along y and along z, how many there are, and which is next.
    first: [usize; 2],
    rows: [usize; 2],
    next: [usize; 2],
}

impl Ahead {
    /// Layers `from..=to` of the tetrahedron.
    pub fn new<T: Fetch>(tet: &Tet, reader: &Reader<'_, T>, from: i32, to: i32) -> Option<Self> {
        let row = |r: [f64; 4]| DVec3::new(r[0], r[1], r[2]);
        let forward = DMat3::from_cols(row(tet.rest[0]), row(tet.rest[1]), row(tet.rest[2])).transpose();
        let back = forward.inverse().transpose();
        let origin = DVec3::new(tet.rest[0][3], tet.rest[1][3], tet.rest[2][3]);
        let (bottom, top) = (f64::from(from - tet.anchor[2]), f64::from(to - tet.anchor[2]));
        let [lo, hi] = bounds(tet, forward, origin, bottom, top)?;
        let lo = lo.max(DVec3::ZERO).min(reader.last).floor();
        let hi = (hi + 1.0).max(DVec3::ZERO).min(reader.last).floor();
        let first = [lo.y as usize, lo.z as usize];
        let rows = [hi.y as usize + 1 - first[0], hi.z as usize + 1 - first[1]];
        let bound = |at| Linear { at, ..Linear::default() };
        let mut ahead = Self {
            begin: [bound(lo.x); PLANES],
            begins: 1,
            end: [bound(hi.x); PLANES],
            ends: 1,
            first,
            rows,
            next: [0; 2],
        };
        // inside is where none of these is negative: four barycentric coordinates, and the height from below and from above
        let [a, b, c, d] = tet.bary;
        for [x, y, z, at] in [a, b, c, d, [0.0, 0.0, 1.0, -bottom], [0.0, 0.0, -1.0, top]] {
            let normal = back * DVec3::new(x, y, z);
            // samples behind the last voxel are read, too
            let wider = normal.abs().dot(DVec3::ONE);
            // a row along a plane crosses it far away, on the side that leaves it whole or takes it all
            let inverse = -1.0 / if normal.x.abs() < 1e-9 { 1e-9 } else { normal.x };
            let at = normal.y * lo.y + normal.z * lo.z + at - normal.dot(origin) + wider;
            let crossing = Linear { at: at * inverse, rise: normal.z * inverse, slope: normal.y * inverse };
            if normal.x > -1e-9 {
                ahead.begin[ahead.begins] = crossing;
                ahead.begins += 1;
            } else {
                ahead.end[ahead.ends] = crossing;
                ahead.ends += 1;
            }
        }
        Some(ahead)
    }

    /// How often [`Ahead::step`] is still to be called.
    #[inline(always)]
    pub fn steps(&self) -> usize {
        (self.rows[1] - self.next[1]) * self.rows[0].div_ceil(LANES) - self.next[0] / LANES
    }

    /// Asks for the samples of eight rows.
    #[inline(always)]
    pub fn step<M: Doubles, T: Fetch>(&mut self, m: M, reader: &Reader<'_, T>) {
        let z = self.next[1] as f64;
        let y = m.plus(m.all(self.next[0] as f64), m.of(COUNT));
        let (mut left, mut right) = (m.all(0.0), m.all(f64::from(i32::MAX)));
        for c in &self.begin[..self.begins] {
            left = m.greater(left, c.rows(m, y, z));
        }
        for c in &self.end[..self.ends] {
            right = m.lesser(right, c.rows(m, y, z));
        }
        let mut some = m.up_to(left, right) & (u32::MAX >> (32 - LANES.min(self.rows[0] - self.next[0])));
        let (left, right) = (m.whole(left), m.whole(right));
        let [sx, sy, sz] = reader.stride;
        let first = (self.first[1] + self.next[1]) * sz + (self.first[0] + self.next[0]) * sy;
        let line = prefetch::LINE / size_of::<T>();
        let samples = reader.samples();
        while some != 0 {
            let r = some.trailing_zeros() as usize % LANES;
            some &= some - 1;
            let start = first + r * sy;
            let (mut at, end) = (start + left[r] as u32 as usize * sx, start + right[r] as u32 as usize * sx);
            prefetch::read(samples, at);
            prefetch::read(samples, end);
            while at + line < end {
                at += line;
                prefetch::read(samples, at);
            }
        }
        self.next[0] += LANES;
        if self.next[0] >= self.rows[0] {
            self.next = [0, self.next[1] + 1];
        }
    }
}

/// Bounds in the input of the tetrahedron between two heights (of the output, relative to its anchor).
fn bounds(tet: &Tet, forward: DMat3, origin: DVec3, bottom: f64, top: f64) -> Option<[DVec3; 2]> {
    let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut add = |p: DVec3| {
        let p = forward * p + origin;
        (lo, hi) = (lo.min(p), hi.max(p));
    };
    for i in 0..4 {
        let p = tet.corners[i];
        if (bottom..=top).contains(&p.z) {
            add(p);
        }
        for j in i + 1..4 {
            let q = tet.corners[j];
            for height in [bottom, top] {
                let t = (height - p.z) / (q.z - p.z);
                if (0.0..=1.0).contains(&t) {
                    add(p.lerp(q, t));
                }
            }
        }
    }
    lo.cmple(hi).all().then_some([lo, hi])
}

//! Brings what a part of a tetrahedron reads near to the processor, before it is read voxel by voxel.
//!
//! Rows of the output run through the input at an angle, so that each step comes upon another line of samples, which no
//! processor foresees: look-ups then wait for memory one after the other. The part of the input behind some layers of a
//! tetrahedron is convex, and is gone through here in the order in which it lies in memory, one sample a line of the cache.

use glam::{DMat3, DVec3};

use super::row::Reader;
use super::setup::Tet;
use crate::math::prefetch;
use crate::volume::fetch::Fetch;

/// Rows of samples whose ends are computed together.
const ROWS: usize = 16;

/// Bytes of samples that are brought near at a time: well below what a core's cache holds.
const ENOUGH: f64 = (384 << 10) as f64;

/// Bytes of a tetrahedron's samples that are not worth it.
const FEW: f64 = (4 << 10) as f64;

/// How many layers of a tetrahedron to draw before the next are brought near; none if it is so small that it needs no help.
pub(super) fn layers<T>(tet: &Tet, channels: usize) -> Option<i32> {
    let rest = tet.rest_volume * (channels * size_of::<T>()) as f64;
    let deep = f64::from(tet.hi[2] - tet.lo[2] + 1);
    (rest > FEW).then(|| (deep * ENOUGH / rest).clamp(4.0, 1024.0) as i32)
}

/// Asks for each line of samples that layers `from..=to` of the tetrahedron need.
#[inline(always)]
pub(super) fn touch<T: Fetch>(tet: &Tet, reader: &Reader<'_, T>, from: i32, to: i32) {
    let row = |r: [f64; 4]| DVec3::new(r[0], r[1], r[2]);
    let forward = DMat3::from_cols(row(tet.rest[0]), row(tet.rest[1]), row(tet.rest[2])).transpose();
    let back = forward.inverse();
    let origin = DVec3::new(tet.rest[0][3], tet.rest[1][3], tet.rest[2][3]);
    let (bottom, top) = (f64::from(from - tet.anchor[2]), f64::from(to - tet.anchor[2]));
    // inside is where none of these is negative: four barycentric coordinates, and the height from below and from above
    let mut planes = [[0.0f64; 4]; 6];
    for (f, plane) in planes.iter_mut().enumerate() {
        let [x, y, z, at] = match f {
            4 => [0.0, 0.0, 1.0, -bottom],
            5 => [0.0, 0.0, -1.0, top],
            f => tet.bary[f],
        };
        let normal = back.transpose() * DVec3::new(x, y, z);
        // samples behind the last voxel are read, too
        let wider = normal.abs().dot(DVec3::ONE);
        *plane = [normal.x, normal.y, normal.z, at - normal.dot(origin) + wider];
    }
    let Some([lo, hi]) = bounds(tet, forward, origin, bottom, top) else { return };
    let lo = lo.max(DVec3::ZERO).min(reader.last);
    let hi = (hi + 1.0).max(DVec3::ZERO).min(reader.last);
    let step = prefetch::LINE / size_of::<T>();
    let samples = reader.samples();
    let channels = reader.channels();
    let [first, rows] = [lo.y as usize, hi.y as usize + 1 - lo.y as usize];
    for z in lo.z as usize..=hi.z as usize {
        // where the first row of samples crosses each plane, and how far from there the next
        let mut crossing = [[0.0f32; 2]; 6];
        for (p, crossing) in planes.iter().zip(&mut crossing) {
            // a row along a plane crosses it far away, on the side that leaves it whole or takes it all
            let across = if p[0].abs() < 1e-9 { 1e-9 } else { p[0] };
            let value = p[1] * lo.y + p[2] * z as f64 + p[3];
            *crossing = [(-value / across) as f32, (-p[1] / across) as f32];
        }
        let mut row = 0;
        while row < rows {
            let mut left = [lo.x as f32; ROWS];
            let mut right = [hi.x as f32; ROWS];
            for (p, [at, step]) in planes.iter().zip(crossing) {
                let at = at + step * row as f32;
                if p[0] > -1e-9 {
                    for r in 0..ROWS {
                        let at = at + step * r as f32;
                        left[r] = if at > left[r] { at } else { left[r] };
                    }
                } else {
                    for r in 0..ROWS {
                        let at = at + step * r as f32;
                        right[r] = if at < right[r] { at } else { right[r] };
                    }
                }
            }
            for r in 0..ROWS.min(rows - row) {
                if left[r] <= right[r] {
                    let start = z * reader.stride[2] + (first + row + r) * reader.stride[1];
                    let mut at = start + left[r] as u32 as usize * channels;
                    let end = start + right[r] as u32 as usize * channels;
                    prefetch::read(samples, end);
                    while at < end {
                        prefetch::read(samples, at);
                        at += step;
                    }
                }
            }
            row += ROWS;
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

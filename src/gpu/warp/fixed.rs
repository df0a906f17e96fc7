//! Tetrahedra for the GPU: affine functions of voxel indices with whole coefficients of 64 bits.
//!
//! # Theory
//!
//! Which of two neighbours holds a voxel on their common face hangs on a sign, and `f32` cannot tell it. Pairs of `f32` could,
//! but shader compilers may reorder and fuse what makes them exact. Whole numbers they may not: `b(x, y, z) = X x + Y y + Z z
//! + C`, relative to the tetrahedron's lowest voxel in the brick, is exact once X, Y, Z and C are rounded.
//!
//! Only the sign of a barycentric coordinate counts, so each has a scale of its own, a power of two that brings the largest
//! value in the box near 2^61. With at most 2^11 voxels along a side, rounding the coefficients moves it by less than 2^-48
//! of that largest value, about as much as `f64` does. A voxel on a face is 1e-9 away from being lost
//! ([`crate::warp::TOLERANCE`]), so that a tie is one on both sides.
//!
//! Rest positions have 44 bits behind the point, which is 6e-14 voxels, and are relative to a whole voxel of the input near
//! the tetrahedron. Overflow does no harm on the way: sums are right modulo 2^64, and a voxel inside has its rest position
//! near the base.

use crate::gpu::layout::{Affine4, Fixed4, WarpTet};
use crate::warp::{AffineRow, OVERLAP, Tet};

/// Bits behind the point of a rest position.
const REST_BITS: i32 = 44;

/// Voxels of the input that a tetrahedron may reach across at rest, along an axis.
const REST_REACH: f64 = (1 << 18) as f64;

/// Voxels of the input beyond which no whole voxel can be named.
const REST_FAR: f64 = (1 << 30) as f64;

/// The tetrahedron's rest positions do not fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooFar;

/// A tetrahedron for the voxels `lo..=hi` of the output, in a brick that begins at `corner`.
///
/// # Errors
/// If it reaches across more of the input than coordinates can tell apart.
pub fn record(tet: &Tet, corner: [i32; 3], lo: [i32; 3], hi: [i32; 3]) -> Result<WarpTet, TooFar> {
    let size: [u32; 3] = std::array::from_fn(|a| (hi[a] - lo[a] + 1) as u32);
    let origin: [f64; 3] = std::array::from_fn(|a| f64::from(lo[a]) - f64::from(tet.anchor[a]));
    let from_origin = |r: &AffineRow| [r[0], r[1], r[2], r[0] * origin[0] + r[1] * origin[1] + r[2] * origin[2] + r[3]];
    let mut bary = Affine4::default();
    let mut inner = Fixed4::default();
    for (f, row) in tet.bary.iter().enumerate() {
        let [x, y, z, at] = from_origin(row);
        let row = [x, y, z, at + tet.slack];
        let reach = (0..3).map(|a| row[a].abs() * f64::from(size[a])).sum::<f64>() + row[3].abs();
        let scale = power_of_two(60 - exponent(reach.max(1.0)));
        set(&mut bary, f, row.map(|v| (v * scale).round() as i64));
        // b > OVERLAP, for whole numbers
        inner.set(f, -((OVERLAP + tet.slack) * scale).round() as i64 - 1);
    }
    let mut rest = Affine4::default();
    let mut base = [0; 3];
    for (a, row) in tet.rest.iter().enumerate() {
        let [lowest, highest] = tet.rest_bounds.map(|b| b[a]);
        if !(lowest.abs() < REST_FAR && highest - lowest < REST_REACH) {
            return Err(TooFar);
        }
        let floor = lowest.floor();
        base[a] = floor as i32;
        let [x, y, z, at] = from_origin(row);
        // modulo 2^64
        set(&mut rest, a, [x, y, z, at - floor].map(|v| (v * power_of_two(REST_BITS)).round() as i128 as i64));
    }
    Ok(WarpTet {
        bary,
        rest,
        inner,
        lo: std::array::from_fn(|a| (lo[a] - corner[a]) as u32),
        weight: (1.0 / tet.jacobian.abs()) as f32,
        size,
        base,
        ..WarpTet::default()
    })
}

impl Fixed4 {
    fn set(&mut self, lane: usize, v: i64) {
        (self.hi[lane], self.lo[lane]) = ((v >> 32) as u32, v as u32);
    }
}

fn set(to: &mut Affine4, lane: usize, [x, y, z, at]: [i64; 4]) {
    to.x.set(lane, x);
    to.y.set(lane, y);
    to.z.set(lane, z);
    to.at.set(lane, at);
}

/// The largest whole number e with 2^e not above `v`, which is normal and positive.
fn exponent(v: f64) -> i32 {
    (v.to_bits() >> 52) as i32 - 1023
}

fn power_of_two(e: i32) -> f64 {
    f64::from_bits(((e + 1023) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::volume::Grid;
    use crate::warp::Warp;

    fn of(v: &Fixed4, lane: usize) -> i64 {
        (i64::from(v.hi[lane] as i32) << 32) | i64::from(v.lo[lane])
    }

    fn value(f: &Affine4, lane: usize, [x, y, z]: [i64; 3]) -> i64 {
        let [x, y, z] = [(&f.x, x), (&f.y, y), (&f.z, z)].map(|(f, n)| of(f, lane).wrapping_mul(n));
        x.wrapping_add(y).wrapping_add(z).wrapping_add(of(&f.at, lane))
    }

    #[test]
    fn powers_are_exact() {
        assert_eq!([1.0, 1.5, 2.0, 3.9, 1e-3].map(exponent), [0, 0, 1, 1, -10]);
        assert_eq!([-3, 0, 44].map(power_of_two), [0.125, 1.0, 17_592_186_044_416.0]);
    }

    /// Corners on whole and half voxels, slivers among them: whole numbers say what `f64` says, ties included, and rest
    /// positions are those of `f64`.
    #[test]
    fn signs_and_rest_positions_are_those_of_f64() {
        let mut state = 5u64;
        let mut next = |n: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % n) as f64
        };
        let grid = Grid::aligned([40, 40, 40], DVec3::ONE, DVec3::ZERO).unwrap();
        let (mut ties, mut inside, mut slivers) = (0, 0, 0);
        for round in 0..300 {
            let mut corner = || DVec3::new(next(80), next(80), next(80)) * 0.5;
            let rest: Vec<_> = (0..4).map(|_| corner() - 3.0).collect();
            let mut moved: Vec<_> = (0..4).map(|_| corner()).collect();
            if round % 3 == 0 {
                // a thousandth of a voxel thin
                moved[3] = (moved[0] + moved[1] + moved[2]) / 3.0 + 1e-3 * corner() / 40.0;
            }
            let Ok(warp) = Warp::new(&grid, &grid, &[[0, 1, 2, 3]], &rest, &moved) else { continue };
            for tet in warp.tets() {
                let lo = tet.lo.map(|v| v + 1);
                if (0..3).any(|a| lo[a] > tet.hi[a]) {
                    continue;
                }
                let made = record(tet, [1, 0, -2], lo, tet.hi).unwrap();
                assert_eq!(made.lo, [lo[0] - 1, lo[1], lo[2] + 2].map(|v| v as u32));
                slivers += u32::from(round % 3 == 0);
                for i in 0..made.size.iter().product() {
                    let [nx, ny, _] = made.size;
                    let n = [i % nx, i / nx % ny, i / nx / ny];
                    let voxel = std::array::from_fn(|a| lo[a] + n[a] as i32);
                    let n = n.map(i64::from);
                    let b = tet.barycentric(voxel);
                    let holds = (0..4).all(|f| value(&made.bary, f, n) >= 0);
                    assert_eq!(holds, tet.contains(voxel), "{voxel:?} of {tet:?}");
                    ties += u32::from(holds && b.iter().any(|b| b.abs() < 1e-12));
                    if holds {
                        inside += 1;
                        let within = (0..4).all(|f| value(&made.bary, f, n) + of(&made.inner, f) >= 0);
                        assert_eq!(within, b.iter().all(|b| *b > OVERLAP));
                        let p = tet.rest_position(voxel);
                        for a in 0..3 {
                            let q = value(&made.rest, a, n) as f64 / power_of_two(REST_BITS) + f64::from(made.base[a]);
                            assert!((p[a] - q).abs() < 1e-8, "{p} against {q} on axis {a}");
                        }
                    }
                }
            }
        }
        assert!(ties > 300 && inside > 20_000 && slivers > 20, "{ties} {inside} {slivers}");
    }

    #[test]
    fn what_reaches_too_far_is_refused() {
        let grid = Grid::aligned([4, 4, 4], DVec3::ONE, DVec3::ZERO).unwrap();
        let moved = [DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0, DVec3::Z * 4.0];
        for (factor, fits) in [(1.0, true), (50_000.0, true), (100_000.0, false)] {
            let rest = moved.map(|p| p * factor);
            let warp = Warp::new(&grid, &grid, &[[0, 1, 2, 3]], &rest, &moved).unwrap();
            let tet = &warp.tets()[0];
            assert_eq!(record(tet, [0; 3], tet.lo, tet.hi).is_ok(), fits);
        }
        let far = moved.map(|p| p + DVec3::X * 2e9);
        let warp = Warp::new(&grid, &grid, &[[0, 1, 2, 3]], &far, &moved).unwrap();
        let tet = &warp.tets()[0];
        assert_eq!(record(tet, [0; 3], tet.lo, tet.hi), Err(TooFar));
    }
}

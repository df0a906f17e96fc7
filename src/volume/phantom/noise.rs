//! Deterministic noise: an integer hash, gradient noise and cellular noise. The same on every machine, no tables.

use glam::{IVec3, Vec3};

/// A well mixed 32-bit hash of a lattice point (the finisher of Ellis' `lowbias32`).
#[inline]
pub fn hash(p: IVec3) -> u32 {
    let mut h = (p.x as u32).wrapping_mul(0x8da6_b343)
        ^ (p.y as u32).wrapping_mul(0xd816_3841)
        ^ (p.z as u32).wrapping_mul(0xcb1a_b31f);
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

/// 0 to 1 from one of the three bytes-and-a-bit of a hash (`part` 0, 1 or 2).
#[inline]
pub fn unit(h: u32, part: u32) -> f32 {
    ((h >> (10 * part)) & 0x3ff) as f32 * (1.0 / 1023.0)
}

#[inline]
fn gradient(h: u32, d: Vec3) -> f32 {
    // Perlin's twelve cube edges (four of them twice)
    let u = if h & 8 == 0 { d.x } else { d.y };
    let v = if h & 12 == 0 {
        d.y
    } else if h & 13 == 12 {
        d.x
    } else {
        d.z
    };
    (if h & 1 == 0 { u } else { -u }) + if h & 2 == 0 { v } else { -v }
}

/// Gradient noise (Perlin 2002): smooth, zero mean, about -1 to 1, features of size one.
pub fn noise(p: Vec3) -> f32 {
    let base = p.floor();
    let f = p - base;
    let i = base.as_ivec3();
    let t = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let at = |x: i32, y: i32, z: i32| {
        let o = IVec3::new(x, y, z);
        gradient(hash(i + o), f - o.as_vec3())
    };
    let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
    mix(
        mix(mix(at(0, 0, 0), at(1, 0, 0), t.x), mix(at(0, 1, 0), at(1, 1, 0), t.x), t.y),
        mix(mix(at(0, 0, 1), at(1, 0, 1), t.x), mix(at(0, 1, 1), at(1, 1, 1), t.x), t.y),
        t.z,
    )
}

/// Two octaves of [`noise`], for grain that should not look regular.
pub fn grain(p: Vec3) -> f32 {
    0.66 * noise(p) + 0.34 * noise(p * 2.03 + 17.3)
}

/// Cellular noise (Worley 1996): distances to the nearest and second nearest feature point, one jittered point per unit
/// cell, and the nearest one's hash.
pub fn cells(p: Vec3) -> (f32, f32, u32) {
    let base = p.floor();
    let f = p - base;
    let i = base.as_ivec3();
    let (mut a, mut b, mut id) = (f32::MAX, f32::MAX, 0);
    // squared distance to the slab of cells on each side; a cell beyond the second nearest point needs no look
    let gap = |f: f32| {
        let g = [f + 0.1, 0.0, 1.1 - f];
        g.map(|g| g * g)
    };
    let (gx, gy, gz) = (gap(f.x), gap(f.y), gap(f.z));
    for z in [0, -1, 1] {
        for y in [0, -1, 1] {
            for x in [0, -1, 1] {
                if gx[(x + 1) as usize] + gy[(y + 1) as usize] + gz[(z + 1) as usize] >= b {
                    continue;
                }
                let o = IVec3::new(x, y, z);
                let h = hash(i + o);
                let q = o.as_vec3() + 0.1 + 0.8 * Vec3::new(unit(h, 0), unit(h, 1), unit(h, 2));
                let d = q.distance_squared(f);
                if d < a {
                    (a, b, id) = (d, a, h);
                } else if d < b {
                    b = d;
                }
            }
        }
    }
    (a.sqrt(), b.sqrt(), id)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smooth_bounded_and_centred() {
        let (mut sum, mut worst, mut n) = (0.0, 0.0f32, 0);
        for i in 0..4000 {
            let p = Vec3::new(i as f32 * 0.37, i as f32 * 0.11 - 200.0, i as f32 * -0.23);
            let v = noise(p);
            worst = worst.max(v.abs());
            sum += v;
            n += 1;
            let step = (noise(p + Vec3::splat(1e-3)) - v).abs();
            assert!(step < 0.02, "jump of {step} at {p}");
        }
        assert!(worst > 0.5 && worst <= 1.1, "{worst}");
        assert!((sum / n as f32).abs() < 0.03);
        // zero on the lattice, by construction
        assert_eq!(noise(Vec3::new(3.0, -7.0, 11.0)), 0.0);
    }

    #[test]
    fn cells_are_ordered_and_nearest() {
        for i in 0..500 {
            let p = Vec3::new(i as f32 * 0.71, i as f32 * -0.13, i as f32 * 0.29);
            let (a, b, _) = cells(p);
            // the same by looking everywhere
            let mut all = Vec::new();
            let base = p.floor().as_ivec3();
            for n in 0..27 {
                let c = base + IVec3::new(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
                let h = hash(c);
                all.push((c.as_vec3() + 0.1 + 0.8 * Vec3::new(unit(h, 0), unit(h, 1), unit(h, 2))).distance(p));
            }
            all.sort_by(f32::total_cmp);
            assert!((a - all[0]).abs() < 1e-4 && (b - all[1]).abs() < 1e-4, "{a} {b} but {all:?}");
        }
    }
}

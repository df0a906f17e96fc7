//! Shading of a group of fragments, as the contract in the module's page says.

// lanes of several arrays run side by side: an index says it best, and is what vectorises
#![allow(clippy::needless_range_loop)]

use glam::{Mat4, Vec4};

use super::sampler::{LANES, Lanes, MAGIC, Texel, integer};
use super::table::INVISIBLE;
use super::tile::{Scene, Tile, lanes};
use super::{ClassTable, Frame, TABLE_SIZE};
use crate::volume::transfer::linear_from_srgb;

/// A pixel that lets through less than this is finished; [`super::draw`] then takes what lies behind to look like what is in
/// front, which is off by this times the difference of the two.
pub const FINISHED: f32 = 1.0 / 256.0;

/// Behind this, fragments are no longer lit: light would change the pixel by less than a step.
const UNLIT: f32 = 1.0 / 128.0;

/// How far, in texels, the value at the next slice may have been looked up from where that slice's fragment lies.
const SAME: f32 = 1.0 / 256.0;

/// Gradients below this, in window units per voxel, are rounding and have no direction.
const FLAT: f32 = 1e-5;

/// How far outside the texture a fragment may lie, for the rounding of interpolation.
const SLACK: f32 = 1e-5;

/// The mask of all lanes.
const ALL: u32 = (1 << LANES) - 1;

impl Tile {
    /// Shades the fragments of `mask` at pixels `at..at + LANES`; returns those that became opaque.
    #[inline(always)]
    pub fn group<T: Texel, const C: usize>(&mut self, scene: &Scene<'_, T, C>, at: usize, mask: u32) -> u32 {
        let front: [Lanes; 3] = std::array::from_fn(|a| lanes(&self.front[a], at));
        let mask = mask & inside(&front);
        if mask == 0 {
            return 0;
        }
        match scene.frame.size[2] {
            Frame::ISO => self.iso(scene, at, mask, &front),
            Frame::MIP => self.mip(scene, at, mask, &front),
            _ => self.volume(scene, at, mask, &front),
        }
    }

    /// The values in front and, if needed, behind, which are kept for the next slice.
    #[inline(always)]
    fn values<T: Texel, const C: usize>(
        &mut self,
        scene: &Scene<'_, T, C>,
        at: usize,
        mask: u32,
        front: &[Lanes; 3],
    ) -> [Lanes; 2] {
        if !scene.back {
            return [scene.sampler.values(front); 2];
        }
        let mut near = mask;
        for a in 0..3 {
            let tolerance = SAME / scene.frame.dims[a];
            let seen = lanes(&self.seen_at[a], at);
            near &= below(&std::array::from_fn(|l| (front[a][l] - seen[l]).abs()), &[tolerance; LANES]);
        }
        let value = if near == mask { lanes(&self.seen, at) } else { scene.sampler.values(front) };
        let back: [Lanes; 3] = std::array::from_fn(|a| lanes(&self.back[a], at));
        let behind = scene.sampler.values(&back);
        for l in 0..LANES {
            for a in 0..3 {
                self.seen_at[a][at + l] = back[a][l];
            }
            self.seen[at + l] = behind[l];
        }
        [value, behind]
    }

    #[inline(always)]
    fn volume<T: Texel, const C: usize>(
        &mut self,
        scene: &Scene<'_, T, C>,
        at: usize,
        mask: u32,
        front: &[Lanes; 3],
    ) -> u32 {
        let [value, behind] = self.values(scene, at, mask, front);
        let mut rgba = if scene.back { across(scene.table, &value, &behind) } else { along_front(scene.table, &value) };
        let mut sum: [Lanes; 4] = std::array::from_fn(|c| lanes(&self.sum[c], at));
        let mut through: Lanes = std::array::from_fn(|l| 1.0 - sum[3][l]);
        let drawn = mask & below(&[INVISIBLE; LANES], &rgba[3]);
        if drawn == 0 {
            return 0;
        }
        if C == 4 {
            for l in (0..LANES).filter(|l| drawn >> l & 1 == 1) {
                let color = scene.sampler.color([front[0][l], front[1][l], front[2][l]]).map(linear_from_srgb);
                (0..3).for_each(|c| rgba[c][l] = color[c] * rgba[3][l]);
            }
        }
        let mut gain = [1.0; LANES];
        if scene.frame.eye[3] != 0.0 {
            let stretch = lanes(&self.stretch, at);
            gain = longer(&rgba[3], &stretch);
            for l in 0..LANES {
                rgba[3][l] *= gain[l];
            }
        }
        let mut shine = [0.0; LANES];
        if scene.frame.has(Frame::LIT) {
            let lit = drawn & below(&[UNLIT; LANES], &through);
            if lit != 0 {
                let light = self.light(scene, at, lit, front, &value, false);
                for l in 0..LANES {
                    let on = lit >> l & 1 == 1;
                    gain[l] *= if on { light[0][l] } else { 1.0 };
                    shine[l] = if on { light[1][l] * rgba[3][l] } else { 0.0 };
                }
            }
        }
        if drawn != ALL {
            for l in 0..LANES {
                through[l] = if drawn >> l & 1 == 1 { through[l] } else { 0.0 };
            }
        }
        for c in 0..3 {
            for l in 0..LANES {
                sum[c][l] += through[l] * (rgba[c][l] * gain[l] + shine[l]);
            }
        }
        for l in 0..LANES {
            sum[3][l] += through[l] * rgba[3][l];
        }
        for (plane, sum) in self.sum.iter_mut().zip(&sum) {
            plane[at..at + LANES].copy_from_slice(sum);
        }
        drawn & below(&[1.0 - FINISHED; LANES], &sum[3])
    }

    #[inline(always)]
    fn iso<T: Texel, const C: usize>(
        &mut self,
        scene: &Scene<'_, T, C>,
        at: usize,
        mask: u32,
        front: &[Lanes; 3],
    ) -> u32 {
        let [value, behind] = self.values(scene, at, mask, front);
        let iso = scene.frame.window[2];
        let mut hit = 0;
        let mut point = *front;
        for l in 0..LANES {
            if value[l].max(behind[l]) < iso || mask >> l & 1 == 0 {
                continue;
            }
            hit |= 1 << l;
            if value[l] < iso {
                let t = (iso - value[l]) / (behind[l] - value[l]);
                for a in 0..3 {
                    point[a][l] += t * (self.back[a][at + l] - front[a][l]);
                }
            }
        }
        if hit == 0 {
            return 0;
        }
        let mut light = [[1.0; LANES], [0.0; LANES]];
        if scene.frame.has(Frame::LIT) {
            let there = if scene.frame.has(Frame::FORWARD) { scene.sampler.values(&point) } else { value };
            light = self.light(scene, at, hit, &point, &there, true);
        }
        let color = scene.frame.iso_color;
        for l in (0..LANES).filter(|l| hit >> l & 1 == 1) {
            let c = |c: usize| color[c] * light[0][l] + light[1][l];
            for (plane, v) in self.sum.iter_mut().zip([c(0), c(1), c(2), 1.0]) {
                plane[at + l] = v;
            }
        }
        hit
    }

    #[inline(always)]
    fn mip<T: Texel, const C: usize>(
        &mut self,
        scene: &Scene<'_, T, C>,
        at: usize,
        mask: u32,
        front: &[Lanes; 3],
    ) -> u32 {
        let value = scene.sampler.values(front);
        let mut full = 0;
        for l in (0..LANES).filter(|l| mask >> l & 1 == 1) {
            let most = self.sum[0][at + l].max(value[l]);
            self.sum[0][at + l] = most;
            self.sum[3][at + l] = 1.0;
            full |= u32::from(most >= 1.0) << l;
        }
        full
    }

    /// The factor of the fragments' colours and what shines on top, per opacity. `surface`: shaded whatever the gradient.
    #[inline(always)]
    fn light<T: Texel, const C: usize>(
        &self,
        scene: &Scene<'_, T, C>,
        at: usize,
        mask: u32,
        point: &[Lanes; 3],
        value: &Lanes,
        surface: bool,
    ) -> [Lanes; 2] {
        let [ambient, diffuse_weight, specular_weight, shininess] = scene.frame.material;
        let [lx, ly, lz, h] = scene.frame.light;
        let mut jacobian = [[0.0; LANES]; 9];
        match &self.jacobians {
            Some(planes) if self.varies => (0..9).for_each(|i| jacobian[i] = lanes(&planes[i], at)),
            _ => (0..9).for_each(|i| jacobian[i] = [self.jacobian[i]; LANES]),
        }
        let mut factor = [0.0; LANES];
        let mut shine = [0.0; LANES];
        if scene.frame.has(Frame::FORWARD) {
            let mut ahead = *point;
            for a in 0..3 {
                for l in 0..LANES {
                    ahead[a][l] += h * (jacobian[a][l] * lx + jacobian[3 + a][l] * ly + jacobian[6 + a][l] * lz);
                }
            }
            let ahead = scene.sampler.values(&ahead);
            for l in 0..LANES {
                factor[l] = ambient + diffuse_weight * (12.0 * (value[l] - ahead[l])).clamp(0.0, 1.0);
            }
            return [factor, shine];
        }
        let d = scene.sampler.differences(point, mask);
        let to_eye: [Lanes; 3] = std::array::from_fn(|a| lanes(&self.to_eye[a], at));
        let half: [Lanes; 3] = std::array::from_fn(|a| lanes(&self.half[a], at));
        let k = scene.per_voxel;
        for l in 0..LANES {
            let [dx, dy, dz] = [d[0][l] * k[0], d[1][l] * k[1], d[2][l] * k[2]];
            let g = |c: usize| jacobian[3 * c][l] * dx + jacobian[3 * c + 1][l] * dy + jacobian[3 * c + 2][l] * dz;
            let (gx, gy, gz) = (g(0), g(1), g(2));
            let square = gx * gx + gy * gy + gz * gz;
            let flat = square < FLAT * FLAT;
            let length = square.sqrt();
            let facing = gx * to_eye[0][l] + gy * to_eye[1][l] + gz * to_eye[2][l];
            let unit = (if facing < 0.0 { -1.0 } else { 1.0 }) / if flat { 1.0 } else { length };
            let n = [gx * unit, gy * unit, gz * unit];
            let n: [f32; 3] = std::array::from_fn(|a| if flat { to_eye[a][l] } else { n[a] });
            let nl = n[0] * lx + n[1] * ly + n[2] * lz;
            let nh = n[0] * half[0][l] + n[1] * half[1][l] + n[2] * half[2][l];
            let diffuse = if nl > 0.0 { nl } else { 0.0 };
            let nh = if nh > 1e-6 { nh } else { 1e-6 };
            let specular = exp2(shininess * log2(nh));
            let w = length * 12.0;
            let w = if w < 1.0 && !surface { w } else { 1.0 };
            factor[l] = 1.0 + w * (ambient + diffuse_weight * diffuse - 1.0);
            shine[l] = w * specular_weight * specular;
        }
        [factor, shine]
    }
}

/// Lanes in which `a < b`; never those that are not numbers.
#[inline(always)]
fn below(a: &Lanes, b: &Lanes) -> u32 {
    let half = |i: usize| Vec4::from_slice(&a[i..i + 4]).cmplt(Vec4::from_slice(&b[i..i + 4])).bitmask();
    half(0) | half(4) << 4
}

/// Lanes whose coordinates all lie in the texture.
#[inline(always)]
fn inside(at: &[Lanes; 3]) -> u32 {
    let within = |v: &Lanes| below(&[-SLACK; LANES], v) & below(v, &[1.0 + SLACK; LANES]);
    within(&at[0]) & within(&at[1]) & within(&at[2])
}

/// Entry below each value of 0..=1, and how far the value is towards the next.
#[inline(always)]
fn entries_of(values: &Lanes) -> ([usize; LANES], Lanes) {
    let (mut index, mut part) = ([0.0f32; LANES], [0.0; LANES]);
    for l in 0..LANES {
        // below 255, so that there is a next entry
        let f = values[l] * 254.9999;
        let rounded = (f - 0.5) + MAGIC;
        index[l] = rounded;
        part[l] = f - (rounded - MAGIC);
    }
    (index.map(|v| integer(v) as usize & (TABLE_SIZE - 1)), part)
}

/// Look-up in a table that does not depend on the value behind, by channels.
#[inline(always)]
fn along_front(table: &ClassTable, value: &Lanes) -> [Lanes; 4] {
    // one more than the row, so that what follows any index lies in it
    let row = &table.entries[..=TABLE_SIZE];
    let (index, part) = entries_of(value);
    by_channel(|l| mix(Vec4::from_array(row[index[l]]), Vec4::from_array(row[index[l] + 1]), part[l]))
}

/// Bilinear look-up, by channels.
#[inline(always)]
fn across(table: &ClassTable, front: &Lanes, behind: &Lanes) -> [Lanes; 4] {
    let (i, x) = entries_of(front);
    let (j, y) = entries_of(behind);
    by_channel(|l| {
        let e = &table.entries[j[l] * TABLE_SIZE + i[l]..][..TABLE_SIZE + 2];
        let near = mix(Vec4::from_array(e[0]), Vec4::from_array(e[1]), x[l]);
        let far = mix(Vec4::from_array(e[TABLE_SIZE]), Vec4::from_array(e[TABLE_SIZE + 1]), x[l]);
        mix(near, far, y[l])
    })
}

#[inline(always)]
fn mix(a: Vec4, b: Vec4, t: f32) -> Vec4 {
    a + (b - a) * t
}

/// Four-vectors of all lanes, turned into lanes of each component.
#[inline(always)]
fn by_channel(of: impl Fn(usize) -> Vec4) -> [Lanes; 4] {
    let mut out = [[0.0; LANES]; 4];
    for i in (0..LANES).step_by(4) {
        let turned = Mat4::from_cols(of(i), of(i + 1), of(i + 2), of(i + 3)).transpose();
        for (out, c) in out.iter_mut().zip([turned.x_axis, turned.y_axis, turned.z_axis, turned.w_axis]) {
            out[i..i + 4].copy_from_slice(&c.to_array());
        }
    }
    out
}

/// Opacities below this, for rays less than twice as long, are made longer by a series.
const THIN: f32 = 0.25;

/// `(1 - (1 - a)^s) / a`, to 3e-6: what a layer's opacity and colour grow by if the ray through it is `s` times as long.
#[inline(always)]
fn longer(alpha: &Lanes, stretch: &Lanes) -> Lanes {
    let mut gain = [0.0; LANES];
    if below(alpha, &[THIN; LANES]) & below(stretch, &[2.0; LANES]) == ALL {
        // the binomial series, five terms: what follows is below 0.007 a^5
        for l in 0..LANES {
            let (a, s) = (alpha[l], stretch[l]);
            let h = 1.0 + a * (4.0 - s) * 0.2;
            let h = 1.0 + a * (3.0 - s) * 0.25 * h;
            let h = 1.0 + a * (2.0 - s) * (1.0 / 3.0) * h;
            gain[l] = s * (1.0 + a * (1.0 - s) * 0.5 * h);
        }
    } else {
        for l in 0..LANES {
            let a = 1.0 - exp2(stretch[l] * log2(1.0 - alpha[l]));
            gain[l] = a / if alpha[l] > INVISIBLE { alpha[l] } else { 1.0 };
        }
    }
    gain
}

/// Logarithm to base 2 of a value in 0..=1, to 3e-6; below -100 for 0. By `atanh` of the mantissa around 1.
#[inline(always)]
fn log2(x: f32) -> f32 {
    const SQRT_HALF: i32 = 0x3f35_04f3;
    let bits = x.to_bits() as i32;
    let exponent = (bits - SQRT_HALF) >> 23;
    let mantissa = f32::from_bits((bits - (exponent << 23)) as u32);
    let t = (mantissa - 1.0) / (mantissa + 1.0);
    let t2 = t * t;
    exponent as f32 + t * (2.885_39 + t2 * (0.961_796_7 + t2 * 0.577_078_04))
}

/// 2 to the power of a value not above 0, to 1e-6 of it; 2^-126 below that.
#[inline(always)]
fn exp2(y: f32) -> f32 {
    let y = if y > -126.0 { y } else { -126.0 };
    let rounded = y + MAGIC;
    let f = y - (rounded - MAGIC);
    let p = 1.0
        + f * (std::f32::consts::LN_2
            + f * (0.240_226_5 + f * (0.055_504_11 + f * (0.009_618_13 + f * (0.001_333_36 + f * 0.000_154_04)))));
    let scale = f32::from_bits(((integer(rounded) + 127) << 23) as u32);
    p * scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn longer_rays_are_close() {
        for i in 0..=1000 {
            let s = 1.0 + i as f32 * 0.003;
            for k in 0..LANES * 100 {
                // groups of the series, and of the powers
                let alpha = std::array::from_fn(|l| (k / LANES * LANES + l + 1) as f32 / 801.0);
                let (got, a) = (longer(&alpha, &[s; LANES])[k % LANES], f64::from(alpha[k % LANES]));
                let want = (1.0 - (1.0 - a).powf(f64::from(s))) / a;
                assert!((f64::from(got) - want).abs() * a < 5e-6, "{s} {a}: {got}, not {want}");
            }
        }
    }

    #[test]
    fn powers_are_close() {
        for i in 1..=10_000 {
            let x = i as f32 / 10_000.0;
            assert!((f64::from(log2(x)) - f64::from(x).log2()).abs() < 4e-6, "{x}");
            let y = -x * 40.0;
            let want = f64::from(y).exp2();
            assert!((f64::from(exp2(y)) - want).abs() < 1e-6 * want, "{y}");
        }
        assert!(log2(0.0) < -100.0 && log2(1.0) == 0.0 && exp2(0.0) == 1.0 && exp2(-1e30) < 1e-37);
        assert!(exp2(f32::NAN) < 1e-37);
    }
}

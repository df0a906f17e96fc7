//! Shading of a group of fragments, as the contract in the module's page says.

use super::sampler::Texel;
use super::table::INVISIBLE;
use super::tile::{Scene, Tile, WIDTH};
use super::{ClassTable, Frame, Second, TABLE_SIZE};
use crate::math::lanes::{ALL, F8, I8, LANES, Machine};
use crate::volume::transfer::linear_from_srgb;

/// A pixel that lets through less than this is finished: what lies behind is not drawn any more, and taken to look like what is
/// in front, which is off by this times the difference of the two.
pub const FINISHED: f32 = 1.0 / 256.0;

/// Behind this, fragments are no longer lit: light would change the pixel by less than a step.
const UNLIT: f32 = 1.0 / 128.0;

/// How far, in texels, the value at the next slice may have been looked up from where that slice's fragment lies.
const SAME: f32 = 1.0 / 256.0;

/// Gradients below this, in window units per voxel, are rounding and have no direction.
const FLAT: f32 = 1e-5;

/// How far outside the texture a fragment may lie, for the rounding of interpolation.
const SLACK: f32 = 1e-5;

/// Groups of a tile's row.
const GROUPS: usize = WIDTH / LANES;

impl Tile {
    /// Shades the fragments of `pending` in a row of pixels; returns those that became opaque.
    ///
    /// First all values are looked up, then all are shaded: look-ups wait for memory, and those of several groups wait together.
    #[inline(always)]
    pub fn row<M: Machine, T: Texel, const C: usize>(
        &mut self,
        m: M,
        scene: &Scene<'_, T, C>,
        row: usize,
        pending: u32,
    ) -> u32 {
        let mut masks = [0; GROUPS];
        let mut values = [[F8::splat(m, 0.0); 2]; GROUPS];
        for g in 0..GROUPS {
            let at = row * WIDTH + g * LANES;
            let mask = pending >> (g * LANES) & ALL;
            if mask == 0 {
                continue;
            }
            let front = self.front_at(m, at);
            masks[g] = if self.within { mask } else { mask & inside(&front) };
            values[g] = self.values(m, scene, at, mask, &front);
        }
        let mut opaque = 0;
        for g in 0..GROUPS {
            if masks[g] == 0 {
                continue;
            }
            let (at, mask, value) = (row * WIDTH + g * LANES, masks[g], values[g]);
            let done = match scene.frame.size[2] {
                Frame::ISO => self.iso(m, scene, at, mask, value),
                Frame::MIP => self.mip(m, at, mask, value[0]),
                _ => self.volume(m, scene, at, mask, value),
            };
            opaque |= done << (g * LANES);
        }
        opaque
    }

    #[inline(always)]
    fn front_at<M: Machine>(&self, m: M, at: usize) -> [F8<M>; 3] {
        [F8::at(m, &self.front[0], at), F8::at(m, &self.front[1], at), F8::at(m, &self.front[2], at)]
    }

    /// The values in front and, if needed, behind, which are kept for the next slice.
    #[inline(always)]
    fn values<M: Machine, T: Texel, const C: usize>(
        &mut self,
        m: M,
        scene: &Scene<'_, T, C>,
        at: usize,
        mask: u32,
        front: &[F8<M>; 3],
    ) -> [F8<M>; 2] {
        if !scene.back {
            return [scene.sampler.values(m, front); 2];
        }
        let mut near = mask;
        for (a, front) in front.iter().enumerate() {
            let seen = F8::at(m, &self.seen_at[a], at);
            near &= (*front - seen).abs().below(SAME / scene.frame.dims[a]);
        }
        let value = if near == mask { F8::at(m, &self.seen, at) } else { scene.sampler.values(m, front) };
        let back = [F8::at(m, &self.back[0], at), F8::at(m, &self.back[1], at), F8::at(m, &self.back[2], at)];
        let behind = scene.sampler.values(m, &back);
        for (seen, back) in self.seen_at.iter_mut().zip(&back) {
            back.put(seen, at);
        }
        behind.put(&mut self.seen, at);
        [value, behind]
    }

    #[inline(always)]
    fn volume<M: Machine, T: Texel, const C: usize>(
        &mut self,
        m: M,
        scene: &Scene<'_, T, C>,
        at: usize,
        mask: u32,
        [value, behind]: [F8<M>; 2],
    ) -> u32 {
        let one = F8::splat(m, 1.0);
        let [mut r, mut g, mut b, mut a] =
            if scene.back { across(scene.table, value, behind) } else { along_front(scene.table, value) };
        let mut drawn = mask & a.above(INVISIBLE);
        if drawn == 0 {
            return 0;
        }
        let by_steepness = scene.table.second == Second::Steepness;
        if by_steepness || scene.frame.has(Frame::STEEP) {
            let d = scene.sampler.differences(m, &self.front_at(m, at), drawn);
            let steepness = dot(d, d).sqrt() * 0.5;
            if by_steepness {
                // what was looked up before was the most there can be for the value
                [r, g, b, a] = across(scene.table, value, one - steepness.sqrt());
            }
            if scene.frame.has(Frame::STEEP) {
                let part = ((steepness - scene.frame.window[3]) * scene.frame.iso_color[3]).clamp(0.0, 1.0);
                (r, g, b, a) = (r * part, g * part, b * part, a * part);
            }
            drawn &= a.above(INVISIBLE);
            if drawn == 0 {
                return 0;
            }
        }
        let sum_a = F8::at(m, &self.sum[3], at);
        let through = one - sum_a;
        if C == 4 {
            let front = self.front_at(m, at);
            let points = [front[0].lanes(), front[1].lanes(), front[2].lanes()];
            let mut color = [[0.0; LANES]; 3];
            for l in (0..LANES).filter(|l| drawn >> l & 1 == 1) {
                let c = scene.sampler.color(points.map(|p| p[l])).map(linear_from_srgb);
                (0..3).for_each(|i| color[i][l] = c[i]);
            }
            let [cr, cg, cb] = color;
            (r, g, b) = (F8::load(m, cr) * a, F8::load(m, cg) * a, F8::load(m, cb) * a);
        }
        let mut gain = one;
        if scene.frame.eye[3] != 0.0 {
            gain = longer(a, F8::at(m, &self.stretch, at));
            a = a * gain;
        }
        let mut shine = F8::splat(m, 0.0);
        if scene.frame.has(Frame::LIT) {
            let lit = drawn & through.above(UNLIT);
            if lit != 0 {
                let light = self.light(m, scene, at, lit, &self.front_at(m, at), value, false);
                gain = gain * light[0].or(lit, one);
                shine = (light[1] * a).or(lit, shine);
            }
        }
        let through = through.or(drawn, 0.0);
        for (plane, c) in self.sum.iter_mut().zip([r, g, b]) {
            through.times_plus(c.times_plus(gain, shine), F8::at(m, plane, at)).put(plane, at);
        }
        let sum_a = through.times_plus(a, sum_a);
        sum_a.put(&mut self.sum[3], at);
        drawn & sum_a.above(1.0 - FINISHED)
    }

    #[inline(always)]
    fn iso<M: Machine, T: Texel, const C: usize>(
        &mut self,
        m: M,
        scene: &Scene<'_, T, C>,
        at: usize,
        mask: u32,
        [value, behind]: [F8<M>; 2],
    ) -> u32 {
        let iso = F8::splat(m, scene.frame.window[2]);
        let hit = mask & !(value.max(behind).below(iso));
        if hit == 0 {
            return 0;
        }
        let outside = value.below(iso);
        let t = ((iso - value) / (behind - value)).or(outside, 0.0);
        let mut point = self.front_at(m, at);
        for (p, back) in point.iter_mut().zip(&self.back) {
            *p = p.towards(F8::at(m, back, at), t);
        }
        let (mut factor, mut shine) = (F8::splat(m, 1.0), F8::splat(m, 0.0));
        if scene.frame.has(Frame::LIT) {
            let there = if scene.frame.has(Frame::FORWARD) { scene.sampler.values(m, &point) } else { value };
            [factor, shine] = self.light(m, scene, at, hit, &point, there, true);
        }
        for (plane, color) in self.sum.iter_mut().zip(&scene.frame.iso_color[..3]) {
            let c = F8::splat(m, *color).times_plus(factor, shine);
            c.or(hit, F8::at(m, plane, at)).put(plane, at);
        }
        F8::splat(m, 1.0).or(hit, F8::at(m, &self.sum[3], at)).put(&mut self.sum[3], at);
        hit
    }

    #[inline(always)]
    fn mip<M: Machine>(&mut self, m: M, at: usize, mask: u32, value: F8<M>) -> u32 {
        let before = F8::at(m, &self.sum[0], at);
        let most = before.max(value).or(mask, before);
        most.put(&mut self.sum[0], at);
        F8::splat(m, 1.0).or(mask, F8::at(m, &self.sum[3], at)).put(&mut self.sum[3], at);
        mask & !most.below(1.0)
    }

    /// The factor of the fragments' colours and what shines on top, per opacity. `surface`: shaded whatever the gradient.
    #[allow(clippy::too_many_arguments)]
    #[inline(always)]
    fn light<M: Machine, T: Texel, const C: usize>(
        &self,
        m: M,
        scene: &Scene<'_, T, C>,
        at: usize,
        mask: u32,
        point: &[F8<M>; 3],
        value: F8<M>,
        surface: bool,
    ) -> [F8<M>; 2] {
        let (zero, one) = (F8::splat(m, 0.0), F8::splat(m, 1.0));
        let [ambient, diffuse_weight, specular_weight, shininess] = scene.frame.material;
        let light = scene.frame.light;
        let h = F8::splat(m, light[3]);
        let light = [F8::splat(m, light[0]), F8::splat(m, light[1]), F8::splat(m, light[2])];
        let mut jacobian = [one; 9];
        for (i, entry) in jacobian.iter_mut().enumerate() {
            *entry = match &self.jacobians {
                Some(planes) if self.varies => F8::at(m, &planes[i], at),
                _ => F8::splat(m, self.jacobian[i]),
            };
        }
        let j = &jacobian;
        if scene.frame.has(Frame::FORWARD) {
            let mut ahead = *point;
            for a in 0..3 {
                ahead[a] = h.times_plus(dot([j[a], j[3 + a], j[6 + a]], light), ahead[a]);
            }
            let rise = ((value - scene.sampler.values(m, &ahead)) * 12.0).clamp(0.0, 1.0);
            return [rise.times_plus(diffuse_weight, ambient), zero];
        }
        let d = scene.sampler.differences(m, point, mask);
        let to_eye = [F8::at(m, &self.to_eye[0], at), F8::at(m, &self.to_eye[1], at), F8::at(m, &self.to_eye[2], at)];
        let half = [F8::at(m, &self.half[0], at), F8::at(m, &self.half[1], at), F8::at(m, &self.half[2], at)];
        let k = scene.per_voxel;
        let d = [d[0] * k[0], d[1] * k[1], d[2] * k[2]];
        let g = [dot([j[0], j[1], j[2]], d), dot([j[3], j[4], j[5]], d), dot([j[6], j[7], j[8]], d)];
        let square = dot(g, g);
        let length = square.sqrt();
        let facing = dot(g, to_eye);
        let unit = F8::splat(m, -1.0).where_below(facing, 0.0, one) / one.where_below(square, FLAT * FLAT, length);
        let mut n = g;
        for a in 0..3 {
            n[a] = to_eye[a].where_below(square, FLAT * FLAT, g[a] * unit);
        }
        let diffuse = dot(n, light).max(0.0);
        let specular = exp2(log2(dot(n, half).max(1e-6)) * shininess);
        let w = if surface { one } else { (length * 12.0).min(1.0) };
        let lit = diffuse.times_plus(diffuse_weight, ambient - 1.0);
        [w.times_plus(lit, 1.0), w * specular_weight * specular]
    }
}

#[inline(always)]
fn dot<M: Machine>(a: [F8<M>; 3], b: [F8<M>; 3]) -> F8<M> {
    a[0].times_plus(b[0], a[1].times_plus(b[1], a[2] * b[2]))
}

/// Lanes whose coordinates all lie in the texture.
#[inline(always)]
fn inside<M: Machine>(at: &[F8<M>; 3]) -> u32 {
    let mut mask = ALL;
    for v in at {
        mask &= v.above(-SLACK) & v.below(1.0 + SLACK);
    }
    mask
}

/// Whether a texture coordinate, and what rounding makes of it between others, lies in the texture.
pub fn is_within(at: &[f32]) -> bool {
    at.iter().all(|v| (-0.5 * SLACK..=1.0 + 0.5 * SLACK).contains(v))
}

/// Entry below each value of 0..=1, and how far the value is towards the next.
#[inline(always)]
fn entries_of<M: Machine>(value: F8<M>) -> (I8<M>, F8<M>) {
    // below 255, so that there is a next entry
    let f = value * 254.9999;
    let index = f.truncate();
    (index, f - index.to_float())
}

/// Look-up in the first row of a table, by channels.
#[inline(always)]
fn along_front<M: Machine>(table: &ClassTable, value: F8<M>) -> [F8<M>; 4] {
    // one more than the row, so that what follows any index lies in it
    let row = &table.entries[..=TABLE_SIZE];
    let (index, part) = entries_of(value);
    let index = index.lanes();
    let two = |l: usize| {
        let i = index[l] as usize & (TABLE_SIZE - 1);
        [&row[i], &row[i + 1]]
    };
    mixed([two(0), two(1), two(2), two(3), two(4), two(5), two(6), two(7)], part)
}

/// Bilinear look-up, by channels.
#[inline(always)]
fn across<M: Machine>(table: &ClassTable, front: F8<M>, second: F8<M>) -> [F8<M>; 4] {
    let ((i, x), (j, y)) = (entries_of(front), entries_of(second));
    let at = (i + j.shift_left::<8>()).lanes();
    let four = |l: usize| &table.entries[at[l] as usize..][..TABLE_SIZE + 2];
    let e = [four(0), four(1), four(2), four(3), four(4), four(5), four(6), four(7)];
    let two = |l: usize, i: usize| [&e[l][i], &e[l][i + 1]];
    let near = mixed([two(0, 0), two(1, 0), two(2, 0), two(3, 0), two(4, 0), two(5, 0), two(6, 0), two(7, 0)], x);
    const N: usize = TABLE_SIZE;
    let far = mixed([two(0, N), two(1, N), two(2, N), two(3, N), two(4, N), two(5, N), two(6, N), two(7, N)], x);
    let mut out = near;
    for c in 0..4 {
        out[c] = near[c].towards(far[c], y);
    }
    out
}

#[inline(always)]
fn mixed<M: Machine>(rows: [[&[f32; 4]; 2]; LANES], part: F8<M>) -> [F8<M>; 4] {
    let m = part.0;
    let [r, g, b, a] = m.along(rows, part.1);
    [F8(m, r), F8(m, g), F8(m, b), F8(m, a)]
}

/// Opacities below this, for rays less than twice as long, are made longer by a series.
const THIN: f32 = 0.25;

/// `(1 - (1 - a)^s) / a`, to 3e-6: what a layer's opacity and colour grow by if the ray through it is `s` times as long.
#[inline(always)]
fn longer<M: Machine>(a: F8<M>, s: F8<M>) -> F8<M> {
    let one = F8::splat(a.0, 1.0);
    if a.below(THIN) & s.below(2.0) == ALL {
        // the binomial series, five terms: what follows is below 0.007 a^5
        let short = F8::splat(a.0, 4.0) - s;
        let h = (a * short).times_plus(0.2, one);
        let h = (a * (short - 1.0)).times_plus(h * 0.25, one);
        let h = (a * (short - 2.0)).times_plus(h * (1.0 / 3.0), one);
        s * (a * (short - 3.0)).times_plus(h * 0.5, one)
    } else {
        let longer = one - exp2(s * log2(one - a));
        longer / a.or(a.above(INVISIBLE), one)
    }
}

/// Logarithm to base 2 of a value in 0..=1, to 3e-6; below -100 for 0. By `atanh` of the mantissa around 1.
#[inline(always)]
fn log2<M: Machine>(x: F8<M>) -> F8<M> {
    const SQRT_HALF: i32 = 0x3f35_04f3;
    let bits = x.bits();
    let exponent = (bits - I8::splat(x.0, SQRT_HALF)).arithmetic_right::<23>();
    let mantissa = (bits - exponent.shift_left::<23>()).as_float();
    let t = (mantissa - 1.0) / (mantissa + 1.0);
    let t2 = t * t;
    let p = t2.times_plus(t2.times_plus(0.577_078_04, 0.961_796_7), 2.885_39);
    t.times_plus(p, exponent.to_float())
}

/// 2 to the power of a value not above 0, to 1e-6 of it; 2^-126 below that.
#[inline(always)]
fn exp2<M: Machine>(y: F8<M>) -> F8<M> {
    let y = y.max(-126.0);
    let whole = (y - 0.5).truncate();
    let f = y - whole.to_float();
    let p = f.times_plus(0.000_154_04, 0.001_333_36);
    let p = f.times_plus(p, 0.009_618_13);
    let p = f.times_plus(p, 0.055_504_11);
    let p = f.times_plus(p, 0.240_226_5);
    let p = f.times_plus(p, std::f32::consts::LN_2);
    let p = f.times_plus(p, 1.0);
    p * (whole + I8::splat(y.0, 127)).shift_left::<23>().as_float()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lanes::{Lanes, Plain};

    #[test]
    fn longer_rays_are_close() {
        for i in 0..=1000 {
            let s = 1.0 + i as f32 * 0.003;
            for k in 0..100 {
                // groups of the series, and of the powers
                let alpha: Lanes = std::array::from_fn(|l| (k * LANES + l + 1) as f32 / 801.0);
                let got = longer(F8::load(Plain, alpha), F8::splat(Plain, s)).lanes();
                for (a, got) in alpha.map(f64::from).into_iter().zip(got) {
                    let want = (1.0 - (1.0 - a).powf(f64::from(s))) / a;
                    assert!((f64::from(got) - want).abs() * a < 5e-6, "{s} {a}: {got}, not {want}");
                }
            }
        }
    }

    #[test]
    fn powers_are_close() {
        let log2 = |x: f32| log2(F8::splat(Plain, x)).lanes()[3];
        let exp2 = |x: f32| exp2(F8::splat(Plain, x)).lanes()[3];
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

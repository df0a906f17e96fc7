//! Samples in hot loops: what they are blended in, and how the blend becomes a sample again.

use super::Scalar;

/// A number that samples are blended in: wide enough that blending with weights 0 and 1 gives every sample back.
pub trait Blend: Copy + Default + Send + Sync {
    /// `a + t (b - a)`; `FUSED`: rounded once less, which only processors with such an instruction do quickly.
    fn blend<const FUSED: bool>(a: Self, b: Self, t: f32) -> Self;
}

impl Blend for f32 {
    #[inline(always)]
    fn blend<const FUSED: bool>(a: Self, b: Self, t: f32) -> Self {
        if FUSED { (b - a).mul_add(t, a) } else { a + t * (b - a) }
    }
}

impl Blend for f64 {
    #[inline(always)]
    fn blend<const FUSED: bool>(a: Self, b: Self, t: f32) -> Self {
        if FUSED { (b - a).mul_add(f64::from(t), a) } else { a + f64::from(t) * (b - a) }
    }
}

/// How a sample type is blended in the fast look-up.
pub trait Fetch: Scalar {
    type Wide: Blend;
    /// Two samples as they come from memory; for small types, when they are neighbours, with one access.
    type Pair: Copy + Default;
    /// Whether samples may be NaN or infinite, so that a weight of zero does not silence them.
    const SPECIAL: bool;
    fn wide(self) -> Self::Wide;
    /// The samples at `at` and `at + next`.
    fn pair(samples: &[Self], at: usize, next: usize) -> Self::Pair;
    /// The first (0) or second (1) of a pair.
    fn of_pair(pair: Self::Pair, which: usize) -> Self::Wide;
    /// Rounds what was blended from samples, and is therefore in range, to nearest, halves away from zero.
    fn narrow(v: Self::Wide) -> Self;
}

macro_rules! fetch {
    ($($t:ident $wide:ident $special:literal $narrow:expr, $pair:ty, $of_two:expr, $half:expr;)*) => {$(
        impl Fetch for $t {
            type Wide = $wide;
            type Pair = $pair;
            const SPECIAL: bool = $special;
            #[inline(always)]
            fn wide(self) -> $wide { self as $wide }
            #[inline(always)]
            fn pair(samples: &[Self], at: usize, next: usize) -> $pair {
                if next == 1 {
                    let two = &samples[at..at + 2];
                    $of_two([two[0], two[1]])
                } else {
                    $of_two([samples[at], samples[at + next]])
                }
            }
            #[inline(always)]
            fn of_pair(pair: $pair, which: usize) -> $wide { $half(pair, which) as $wide }
            #[inline(always)]
            fn narrow(v: $wide) -> Self { $narrow(v) }
        }
    )*};
}

// Conversions from floating point saturate, which vector units do not, so that they go number by number. Instead a number
// is added so large that the result has no bits behind the point: its low bits are then the whole number, halves to even.

/// 1.5 * 2^23: for numbers below 2^22.
pub const WHOLE: f32 = 12_582_912.0;

/// 1.5 * 2^52.
const WIDE_WHOLE: f64 = 6_755_399_441_055_744.0;

/// Nearest whole number of a number from 0 to 2^22, halves up.
#[inline(always)]
fn nearest(v: f32) -> u32 {
    let near = v + WHOLE;
    near.to_bits() + u32::from(v - (near - WHOLE) == 0.5)
}

/// Nearest whole number of a number between -2^22 and 2^22, halves away from zero.
#[inline(always)]
fn nearest_signed(v: f32) -> u32 {
    let near = v + WHOLE;
    let rest = v - (near - WHOLE);
    near.to_bits() + u32::from((rest == 0.5) & (v > 0.0)) - u32::from((rest == -0.5) & (v < 0.0))
}

#[inline(always)]
fn nearest_wide(v: f64) -> u64 {
    let near = v + WIDE_WHOLE;
    let rest = v - (near - WIDE_WHOLE);
    near.to_bits() + u64::from((rest == 0.5) & (v > 0.0)) - u64::from((rest == -0.5) & (v < 0.0))
}

// numbers of 32 bits become floating point through i32, which is one instruction for many of them
fetch! {
    u8 f32 false |v: f32| nearest(v) as u8,
        u32, |[a, b]: [u8; 2]| u32::from(u16::from_le_bytes([a, b])), |p: u32, i| (p >> (8 * i) & 0xff) as i32;
    i8 f32 false |v: f32| nearest_signed(v) as i8,
        u32, |[a, b]: [i8; 2]| u32::from(u16::from_le_bytes([a as u8, b as u8])), |p: u32, i| (p << (24 - 8 * i)) as i32 >> 24;
    u16 f32 false |v: f32| nearest(v) as u16,
        u32, |[a, b]: [u16; 2]| u32::from(a) | u32::from(b) << 16, |p: u32, i| (p >> (16 * i) & 0xffff) as i32;
    i16 f32 false |v: f32| nearest_signed(v) as i16,
        u32, |[a, b]: [i16; 2]| u32::from(a as u16) | u32::from(b as u16) << 16, |p: u32, i| (p << (16 - 16 * i)) as i32 >> 16;
    u32 f64 false |v: f64| nearest_wide(v) as u32, [u32; 2], |p| p, |p: [u32; 2], i: usize| p[i];
    i32 f64 false |v: f64| nearest_wide(v) as i32, [i32; 2], |p| p, |p: [i32; 2], i: usize| p[i];
    f32 f32 true |v: f32| v, [f32; 2], |p| p, |p: [f32; 2], i: usize| p[i];
    f64 f64 true |v: f64| v, [f64; 2], |p| p, |p: [f64; 2], i: usize| p[i];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_go_away_from_zero() {
        for n in 0..=65535u32 {
            for (part, up) in [(0.0, 0), (0.25, 0), (0.4375, 0), (0.5, 1), (0.5625, 1), (0.75, 1)] {
                let v = n as f32 + part;
                if n + up <= 65535 {
                    assert_eq!(u32::from(u16::narrow(v)), n + up, "{v}");
                }
                if n + up <= 255 {
                    assert_eq!(u32::from(u8::narrow(v)), n + up, "{v}");
                }
                if n + up <= 32767 {
                    let (n, up) = (n as i32, up as i32);
                    assert_eq!(i32::from(i16::narrow(v)), n + up, "{v}");
                    assert_eq!(i32::from(i16::narrow(-v)), -n - up, "{v}");
                }
                if n + up <= 127 {
                    assert_eq!(i32::from(i8::narrow(-v)), -(n as i32 + up as i32), "{v}");
                }
                let large = f64::from(n) * 65536.0 + f64::from(part);
                assert_eq!(u32::narrow(large), n * 65536 + up, "{large}");
                if n < 32768 {
                    assert_eq!(i32::narrow(-large), -((n * 65536 + up) as i32), "{large}");
                }
            }
        }
        // just below a half
        assert_eq!(
            (u16::narrow(0.499_999_97), i16::narrow(-0.499_999_97), u32::narrow(0.499_999_999_999_999_94)),
            (0, 0, 0)
        );
        assert_eq!(
            (i16::narrow(-32768.0), i32::narrow(-2_147_483_648.0), u32::narrow(4_294_967_295.0)),
            (-32768, i32::MIN, u32::MAX)
        );
    }
}

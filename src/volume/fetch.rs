//! Samples in hot loops: what they are blended in, and how the blend becomes a sample again.

use super::Scalar;

/// A number that samples are blended in: wide enough that blending with weights 0 and 1 gives every sample back.
pub trait Blend: Copy + Default + Send + Sync {
    /// `a + t (b - a)`.
    fn blend(a: Self, b: Self, t: f32) -> Self;
}

impl Blend for f32 {
    #[inline(always)]
    fn blend(a: Self, b: Self, t: f32) -> Self {
        a + t * (b - a)
    }
}

impl Blend for f64 {
    #[inline(always)]
    fn blend(a: Self, b: Self, t: f32) -> Self {
        a + f64::from(t) * (b - a)
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

/// The nearest whole number, halves away from zero, of a magnitude below 2^22. Adding 1.5 * 2^23 rounds to a whole number that
/// then stands in the low bits; unlike a conversion, which has to look after NaN and what does not fit, that is vector code
/// everywhere.
#[inline(always)]
fn nearest(v: f32) -> i32 {
    const MAGIC: f32 = 12_582_912.0;
    let up = v.abs() + 0.5;
    let rounded = up + MAGIC;
    let floor = rounded.to_bits() as i32 - MAGIC.to_bits() as i32 - i32::from(rounded - MAGIC > up);
    if v < 0.0 { -floor } else { floor }
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

// numbers of 32 bits become floating point through i32, which is one instruction for many of them
fetch! {
    u8 f32 false |v: f32| nearest(v) as u8,
        u32, |[a, b]: [u8; 2]| u32::from(u16::from_le_bytes([a, b])), |p: u32, i| (p >> (8 * i) & 0xff) as i32;
    i8 f32 false |v: f32| nearest(v) as i8,
        u32, |[a, b]: [i8; 2]| u32::from(u16::from_le_bytes([a as u8, b as u8])), |p: u32, i| (p << (24 - 8 * i)) as i32 >> 24;
    u16 f32 false |v: f32| nearest(v) as u16,
        u32, |[a, b]: [u16; 2]| u32::from(a) | u32::from(b) << 16, |p: u32, i| (p >> (16 * i) & 0xffff) as i32;
    i16 f32 false |v: f32| nearest(v) as i16,
        u32, |[a, b]: [i16; 2]| u32::from(a as u16) | u32::from(b as u16) << 16, |p: u32, i| (p << (16 - 16 * i)) as i32 >> 16;
    u32 f64 false |v: f64| (v + 0.5) as u32, [u32; 2], |p| p, |p: [u32; 2], i: usize| p[i];
    i32 f64 false |v: f64| (v + 0.5f64.copysign(v)) as i32, [i32; 2], |p| p, |p: [i32; 2], i: usize| p[i];
    f32 f32 true |v: f32| v, [f32; 2], |p| p, |p: [f32; 2], i: usize| p[i];
    f64 f64 true |v: f64| v, [f64; 2], |p| p, |p: [f64; 2], i: usize| p[i];
}

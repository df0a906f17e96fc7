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
    /// Whether samples may be NaN or infinite, so that a weight of zero does not silence them.
    const SPECIAL: bool;
    fn wide(self) -> Self::Wide;
    /// Rounds what was blended from samples, and is therefore in range, to nearest, halves away from zero.
    fn narrow(v: Self::Wide) -> Self;
}

macro_rules! fetch {
    ($($t:ident $wide:ident $special:literal $narrow:expr;)*) => {$(
        impl Fetch for $t {
            type Wide = $wide;
            const SPECIAL: bool = $special;
            #[inline(always)]
            fn wide(self) -> $wide { self as $wide }
            #[inline(always)]
            fn narrow(v: $wide) -> Self { $narrow(v) }
        }
    )*};
}

// adding a half and truncating is vector code everywhere, `round` is not; so are conversions between numbers of 32 bits
fetch! {
    u8 f32 false |v: f32| (v + 0.5) as i32 as u8;
    i8 f32 false |v: f32| (v + 0.5f32.copysign(v)) as i32 as i8;
    u16 f32 false |v: f32| (v + 0.5) as i32 as u16;
    i16 f32 false |v: f32| (v + 0.5f32.copysign(v)) as i32 as i16;
    u32 f64 false |v: f64| (v + 0.5) as u32;
    i32 f64 false |v: f64| (v + 0.5f64.copysign(v)) as i32;
    f32 f32 true |v: f32| v;
    f64 f64 true |v: f64| v;
}

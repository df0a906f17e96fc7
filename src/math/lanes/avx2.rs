//! The vector registers of x86 processors with AVX2 and FMA.

use std::arch::x86_64::{__m256, __m256i};

use bytemuck::cast;
use pulp::x86::V3;

use super::{LANES, Lanes, Machine, Work};

/// Work with its machine, on its way into a function compiled for it.
pub struct On<W> {
    pub machine: V3,
    pub work: W,
}

impl<W: Work> pulp::WithSimd for On<W> {
    type Output = W::Output;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> W::Output {
        self.work.run(self.machine)
    }
}

/// From the first towards the second four numbers of two lanes.
#[inline(always)]
fn mix(m: V3, low: [&[f32; 4]; 2], high: [&[f32; 4]; 2], t: __m256) -> __m256 {
    let from = m.avx._mm256_set_m128(cast(*high[0]), cast(*low[0]));
    let to = m.avx._mm256_set_m128(cast(*high[1]), cast(*low[1]));
    m.fma._mm256_fmadd_ps(m.avx._mm256_sub_ps(to, from), t, from)
}

impl Machine for V3 {
    type Float = __m256;
    type Int = __m256i;
    #[inline(always)]
    fn splat(self, v: f32) -> __m256 {
        self.avx._mm256_set1_ps(v)
    }
    #[inline(always)]
    fn load(self, v: Lanes) -> __m256 {
        cast(v)
    }
    #[inline(always)]
    fn store(self, v: __m256) -> Lanes {
        cast(v)
    }
    #[inline(always)]
    fn add(self, a: __m256, b: __m256) -> __m256 {
        self.avx._mm256_add_ps(a, b)
    }
    #[inline(always)]
    fn sub(self, a: __m256, b: __m256) -> __m256 {
        self.avx._mm256_sub_ps(a, b)
    }
    #[inline(always)]
    fn mul(self, a: __m256, b: __m256) -> __m256 {
        self.avx._mm256_mul_ps(a, b)
    }
    #[inline(always)]
    fn div(self, a: __m256, b: __m256) -> __m256 {
        self.avx._mm256_div_ps(a, b)
    }
    #[inline(always)]
    fn mul_add(self, a: __m256, b: __m256, c: __m256) -> __m256 {
        self.fma._mm256_fmadd_ps(a, b, c)
    }
    #[inline(always)]
    fn min(self, a: __m256, b: __m256) -> __m256 {
        self.avx._mm256_min_ps(a, b)
    }
    #[inline(always)]
    fn max(self, a: __m256, b: __m256) -> __m256 {
        self.avx._mm256_max_ps(a, b)
    }
    #[inline(always)]
    fn sqrt(self, v: __m256) -> __m256 {
        self.avx._mm256_sqrt_ps(v)
    }
    #[inline(always)]
    fn below(self, a: __m256, b: __m256) -> u32 {
        self.avx._mm256_movemask_ps(cast(self.cmp_lt_f32x8(cast(a), cast(b)))) as u32
    }
    #[inline(always)]
    fn pick(self, mask: u32, a: __m256, b: __m256) -> __m256 {
        let lane: __m256i = cast([1, 2, 4, 8, 16, 32, 64, 128]);
        let set = self.avx2._mm256_and_si256(self.avx._mm256_set1_epi32(mask as i32), lane);
        self.avx._mm256_blendv_ps(b, a, cast(self.avx2._mm256_cmpeq_epi32(set, lane)))
    }
    #[inline(always)]
    fn pick_below(self, x: __m256, y: __m256, a: __m256, b: __m256) -> __m256 {
        self.avx._mm256_blendv_ps(b, a, cast(self.cmp_lt_f32x8(cast(x), cast(y))))
    }
    #[inline(always)]
    fn truncate(self, v: __m256) -> __m256i {
        self.avx._mm256_cvttps_epi32(v)
    }
    #[inline(always)]
    fn to_float(self, v: __m256i) -> __m256 {
        self.avx._mm256_cvtepi32_ps(v)
    }
    #[inline(always)]
    fn bits(self, v: __m256) -> __m256i {
        cast(v)
    }
    #[inline(always)]
    fn of_bits(self, v: __m256i) -> __m256 {
        cast(v)
    }
    #[inline(always)]
    fn int_splat(self, v: i32) -> __m256i {
        self.avx._mm256_set1_epi32(v)
    }
    #[inline(always)]
    fn int_load(self, v: [i32; LANES]) -> __m256i {
        cast(v)
    }
    #[inline(always)]
    fn int_store(self, v: __m256i) -> [i32; LANES] {
        cast(v)
    }
    #[inline(always)]
    fn int_add(self, a: __m256i, b: __m256i) -> __m256i {
        self.avx2._mm256_add_epi32(a, b)
    }
    #[inline(always)]
    fn int_sub(self, a: __m256i, b: __m256i) -> __m256i {
        self.avx2._mm256_sub_epi32(a, b)
    }
    #[inline(always)]
    fn int_mul(self, a: __m256i, b: __m256i) -> __m256i {
        self.avx2._mm256_mullo_epi32(a, b)
    }
    #[inline(always)]
    fn int_and(self, a: __m256i, b: __m256i) -> __m256i {
        self.avx2._mm256_and_si256(a, b)
    }
    #[inline(always)]
    fn shift_right<const N: i32>(self, v: __m256i) -> __m256i {
        cast(self.shr_const_u32x8::<N>(cast(v)))
    }
    #[inline(always)]
    fn shift_left<const N: i32>(self, v: __m256i) -> __m256i {
        cast(self.shl_const_u32x8::<N>(cast(v)))
    }
    #[inline(always)]
    fn arithmetic_right<const N: i32>(self, v: __m256i) -> __m256i {
        cast(self.shr_const_i32x8::<N>(cast(v)))
    }
    #[inline(always)]
    fn along(self, rows: [[&[f32; 4]; 2]; LANES], part: __m256) -> [__m256; 4] {
        // lanes l and l + 4 side by side, as their parts stand in the two halves of `part`
        let a = mix(self, rows[0], rows[4], self.avx._mm256_permute_ps::<0b00_00_00_00>(part));
        let b = mix(self, rows[1], rows[5], self.avx._mm256_permute_ps::<0b01_01_01_01>(part));
        let c = mix(self, rows[2], rows[6], self.avx._mm256_permute_ps::<0b10_10_10_10>(part));
        let d = mix(self, rows[3], rows[7], self.avx._mm256_permute_ps::<0b11_11_11_11>(part));
        // four times four in each half
        let (ab, cd) = (self.avx._mm256_unpacklo_ps(a, b), self.avx._mm256_unpacklo_ps(c, d));
        let (ab2, cd2) = (self.avx._mm256_unpackhi_ps(a, b), self.avx._mm256_unpackhi_ps(c, d));
        [
            cast(self.avx._mm256_unpacklo_pd(cast(ab), cast(cd))),
            cast(self.avx._mm256_unpackhi_pd(cast(ab), cast(cd))),
            cast(self.avx._mm256_unpacklo_pd(cast(ab2), cast(cd2))),
            cast(self.avx._mm256_unpackhi_pd(cast(ab2), cast(cd2))),
        ]
    }
}

//! Eight numbers of double precision at a time, where what is solved for must be exact.

use super::{LANES, Plain};

/// The number of each lane.
pub const COUNT: [f64; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// What computes with eight numbers of double precision. Masks are bits, lane 0 the lowest.
pub trait Doubles: Copy {
    type Double: Copy;
    fn all(self, v: f64) -> Self::Double;
    fn of(self, v: [f64; LANES]) -> Self::Double;
    fn plus(self, a: Self::Double, b: Self::Double) -> Self::Double;
    fn minus(self, a: Self::Double, b: Self::Double) -> Self::Double;
    /// `a * b + c`, rounded once or twice.
    fn times_plus(self, a: Self::Double, b: Self::Double, c: Self::Double) -> Self::Double;
    fn lesser(self, a: Self::Double, b: Self::Double) -> Self::Double;
    fn greater(self, a: Self::Double, b: Self::Double) -> Self::Double;
    fn ceil(self, v: Self::Double) -> Self::Double;
    fn floor(self, v: Self::Double) -> Self::Double;
    /// Lanes in which `a <= b`.
    fn up_to(self, a: Self::Double, b: Self::Double) -> u32;
    /// `v` where `a <= b`, `other` elsewhere.
    fn where_up_to(self, a: Self::Double, b: Self::Double, v: Self::Double, other: Self::Double) -> Self::Double;
    /// Towards zero; any number where it does not fit.
    fn whole(self, v: Self::Double) -> [i32; LANES];
    fn single(self, v: Self::Double) -> [f32; LANES];
    fn least(self, v: Self::Double) -> f64;
    fn most(self, v: Self::Double) -> f64;
}

#[inline(always)]
fn least(v: [f64; LANES]) -> f64 {
    v.into_iter().fold(f64::INFINITY, |a, b| if b < a { b } else { a })
}

#[inline(always)]
fn most(v: [f64; LANES]) -> f64 {
    v.into_iter().fold(f64::NEG_INFINITY, |a, b| if b > a { b } else { a })
}

impl Doubles for Plain {
    type Double = [f64; LANES];
    fn all(self, v: f64) -> Self::Double {
        [v; LANES]
    }
    fn of(self, v: [f64; LANES]) -> Self::Double {
        v
    }
    fn plus(self, a: Self::Double, b: Self::Double) -> Self::Double {
        std::array::from_fn(|l| a[l] + b[l])
    }
    fn minus(self, a: Self::Double, b: Self::Double) -> Self::Double {
        std::array::from_fn(|l| a[l] - b[l])
    }
    fn times_plus(self, a: Self::Double, b: Self::Double, c: Self::Double) -> Self::Double {
        std::array::from_fn(|l| a[l] * b[l] + c[l])
    }
    fn lesser(self, a: Self::Double, b: Self::Double) -> Self::Double {
        std::array::from_fn(|l| if a[l] < b[l] { a[l] } else { b[l] })
    }
    fn greater(self, a: Self::Double, b: Self::Double) -> Self::Double {
        std::array::from_fn(|l| if a[l] > b[l] { a[l] } else { b[l] })
    }
    fn ceil(self, v: Self::Double) -> Self::Double {
        v.map(f64::ceil)
    }
    fn floor(self, v: Self::Double) -> Self::Double {
        v.map(f64::floor)
    }
    fn up_to(self, a: Self::Double, b: Self::Double) -> u32 {
        (0..LANES).fold(0, |mask, l| mask | u32::from(a[l] <= b[l]) << l)
    }
    fn where_up_to(self, a: Self::Double, b: Self::Double, v: Self::Double, other: Self::Double) -> Self::Double {
        std::array::from_fn(|l| if a[l] <= b[l] { v[l] } else { other[l] })
    }
    fn whole(self, v: Self::Double) -> [i32; LANES] {
        v.map(|v| v as i32)
    }
    fn single(self, v: Self::Double) -> [f32; LANES] {
        v.map(|v| v as f32)
    }
    fn least(self, v: Self::Double) -> f64 {
        least(v)
    }
    fn most(self, v: Self::Double) -> f64 {
        most(v)
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::{
        __m256d, __m512d, _CMP_LE_OQ, _MM_FROUND_NO_EXC, _MM_FROUND_TO_NEG_INF, _MM_FROUND_TO_POS_INF,
    };

    use bytemuck::cast;
    use pulp::x86::{V3, V4};

    use super::{Doubles, LANES, least, most};

    impl Doubles for V4 {
        type Double = __m512d;
        #[inline(always)]
        fn all(self, v: f64) -> __m512d {
            self.avx512f._mm512_set1_pd(v)
        }
        #[inline(always)]
        fn of(self, v: [f64; LANES]) -> __m512d {
            cast(v)
        }
        #[inline(always)]
        fn plus(self, a: __m512d, b: __m512d) -> __m512d {
            self.avx512f._mm512_add_pd(a, b)
        }
        #[inline(always)]
        fn minus(self, a: __m512d, b: __m512d) -> __m512d {
            self.avx512f._mm512_sub_pd(a, b)
        }
        #[inline(always)]
        fn times_plus(self, a: __m512d, b: __m512d, c: __m512d) -> __m512d {
            self.avx512f._mm512_fmadd_pd(a, b, c)
        }
        #[inline(always)]
        fn lesser(self, a: __m512d, b: __m512d) -> __m512d {
            self.avx512f._mm512_min_pd(a, b)
        }
        #[inline(always)]
        fn greater(self, a: __m512d, b: __m512d) -> __m512d {
            self.avx512f._mm512_max_pd(a, b)
        }
        #[inline(always)]
        fn ceil(self, v: __m512d) -> __m512d {
            self.avx512f._mm512_roundscale_pd::<{ _MM_FROUND_TO_POS_INF | _MM_FROUND_NO_EXC }>(v)
        }
        #[inline(always)]
        fn floor(self, v: __m512d) -> __m512d {
            self.avx512f._mm512_roundscale_pd::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(v)
        }
        #[inline(always)]
        fn up_to(self, a: __m512d, b: __m512d) -> u32 {
            self.avx512f._mm512_cmp_pd_mask::<_CMP_LE_OQ>(a, b).into()
        }
        #[inline(always)]
        fn where_up_to(self, a: __m512d, b: __m512d, v: __m512d, other: __m512d) -> __m512d {
            self.avx512f._mm512_mask_blend_pd(self.avx512f._mm512_cmp_pd_mask::<_CMP_LE_OQ>(a, b), other, v)
        }
        #[inline(always)]
        fn whole(self, v: __m512d) -> [i32; LANES] {
            cast(self.avx512f._mm512_cvttpd_epi32(v))
        }
        #[inline(always)]
        fn single(self, v: __m512d) -> [f32; LANES] {
            cast(self.avx512f._mm512_cvtpd_ps(v))
        }
        #[inline(always)]
        fn least(self, v: __m512d) -> f64 {
            self.avx512f._mm512_reduce_min_pd(v)
        }
        #[inline(always)]
        fn most(self, v: __m512d) -> f64 {
            self.avx512f._mm512_reduce_max_pd(v)
        }
    }

    impl Doubles for V3 {
        type Double = [__m256d; 2];
        #[inline(always)]
        fn all(self, v: f64) -> [__m256d; 2] {
            [self.avx._mm256_set1_pd(v); 2]
        }
        #[inline(always)]
        fn of(self, v: [f64; LANES]) -> [__m256d; 2] {
            cast(v)
        }
        #[inline(always)]
        fn plus(self, [a, b]: [__m256d; 2], [c, d]: [__m256d; 2]) -> [__m256d; 2] {
            [self.avx._mm256_add_pd(a, c), self.avx._mm256_add_pd(b, d)]
        }
        #[inline(always)]
        fn minus(self, [a, b]: [__m256d; 2], [c, d]: [__m256d; 2]) -> [__m256d; 2] {
            [self.avx._mm256_sub_pd(a, c), self.avx._mm256_sub_pd(b, d)]
        }
        #[inline(always)]
        fn times_plus(self, [a, b]: [__m256d; 2], [c, d]: [__m256d; 2], [e, f]: [__m256d; 2]) -> [__m256d; 2] {
            [self.fma._mm256_fmadd_pd(a, c, e), self.fma._mm256_fmadd_pd(b, d, f)]
        }
        #[inline(always)]
        fn lesser(self, [a, b]: [__m256d; 2], [c, d]: [__m256d; 2]) -> [__m256d; 2] {
            [self.avx._mm256_min_pd(a, c), self.avx._mm256_min_pd(b, d)]
        }
        #[inline(always)]
        fn greater(self, [a, b]: [__m256d; 2], [c, d]: [__m256d; 2]) -> [__m256d; 2] {
            [self.avx._mm256_max_pd(a, c), self.avx._mm256_max_pd(b, d)]
        }
        #[inline(always)]
        fn ceil(self, [a, b]: [__m256d; 2]) -> [__m256d; 2] {
            [self.avx._mm256_ceil_pd(a), self.avx._mm256_ceil_pd(b)]
        }
        #[inline(always)]
        fn floor(self, [a, b]: [__m256d; 2]) -> [__m256d; 2] {
            [self.avx._mm256_floor_pd(a), self.avx._mm256_floor_pd(b)]
        }
        #[inline(always)]
        fn up_to(self, [a, b]: [__m256d; 2], [c, d]: [__m256d; 2]) -> u32 {
            let low = self.avx._mm256_movemask_pd(self.avx._mm256_cmp_pd::<_CMP_LE_OQ>(a, c));
            let high = self.avx._mm256_movemask_pd(self.avx._mm256_cmp_pd::<_CMP_LE_OQ>(b, d));
            (low | high << 4) as u32
        }
        #[inline(always)]
        fn where_up_to(
            self,
            [a, b]: [__m256d; 2],
            [c, d]: [__m256d; 2],
            v: [__m256d; 2],
            other: [__m256d; 2],
        ) -> [__m256d; 2] {
            let low = self.avx._mm256_cmp_pd::<_CMP_LE_OQ>(a, c);
            let high = self.avx._mm256_cmp_pd::<_CMP_LE_OQ>(b, d);
            [self.avx._mm256_blendv_pd(other[0], v[0], low), self.avx._mm256_blendv_pd(other[1], v[1], high)]
        }
        #[inline(always)]
        fn whole(self, [a, b]: [__m256d; 2]) -> [i32; LANES] {
            cast([self.avx._mm256_cvttpd_epi32(a), self.avx._mm256_cvttpd_epi32(b)])
        }
        #[inline(always)]
        fn single(self, [a, b]: [__m256d; 2]) -> [f32; LANES] {
            cast([self.avx._mm256_cvtpd_ps(a), self.avx._mm256_cvtpd_ps(b)])
        }
        #[inline(always)]
        fn least(self, v: [__m256d; 2]) -> f64 {
            least(cast(v))
        }
        #[inline(always)]
        fn most(self, v: [__m256d; 2]) -> f64 {
            most(cast(v))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Everything once, and what it makes of some numbers.
    fn results<M: Doubles>(m: M) -> ([u32; 2], [[i32; LANES]; 6], [f32; LANES], [f64; 2]) {
        let a = [1.5, -2.25, 3.0, 1e-3, -0.5, 7.75, 100.0, -1e3];
        let b = [1.5, 2.0, -3.0, 0.0, -0.5, 8.0, 1e3, -2e3];
        let (a, b) = (m.of(a), m.of(b));
        let whole = [
            m.whole(m.ceil(m.plus(a, b))),
            m.whole(m.floor(m.minus(a, b))),
            m.whole(m.times_plus(a, b, m.all(0.5))),
            m.whole(m.lesser(a, b)),
            m.whole(m.greater(a, b)),
            m.whole(m.where_up_to(a, b, m.all(4.0), a)),
        ];
        ([m.up_to(a, b), m.up_to(b, a)], whole, m.single(a), [m.least(a), m.most(b)])
    }

    #[test]
    fn every_machine_computes_alike() {
        let wanted = results(Plain);
        assert_eq!(wanted.0, [0b0111_0011, 0b1001_1101]);
        assert_eq!(wanted.1[0], [3, 0, 0, 1, -1, 16, 1100, -3000]);
        assert_eq!(wanted.1[1], [0, -5, 6, 0, 0, -1, -900, 1000]);
        assert_eq!(wanted.1[5], [4, 4, 3, 0, 4, 4, 4, -1000]);
        assert_eq!(wanted.3, [-1e3, 1e3]);
        #[cfg(target_arch = "x86_64")]
        {
            struct Results<M>(M);
            impl<M: Doubles> pulp::WithSimd for Results<M> {
                type Output = ([u32; 2], [[i32; LANES]; 6], [f32; LANES], [f64; 2]);
                #[inline(always)]
                fn with_simd<S: pulp::Simd>(self, _: S) -> Self::Output {
                    results(self.0)
                }
            }
            if let Some(m) = pulp::x86::V3::try_new() {
                assert_eq!(pulp::Simd::vectorize(m, Results(m)), wanted);
            }
            if let Some(m) = pulp::x86::V4::try_new() {
                assert_eq!(pulp::Simd::vectorize(m, Results(m)), wanted);
            }
        }
    }
}

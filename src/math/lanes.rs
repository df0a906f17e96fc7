//! Eight numbers at a time: what hot loops are written in where the compiler's own vector code falls short.
//!
//! [`Machine`] names the operations, [`F8`] and [`I8`] make them read like arithmetic. There are two machines: [`Plain`],
//! arrays that the compiler makes of what it can, and, chosen at run time, the vector registers of x86 processors with AVX2
//! and FMA. Results agree but for the rounding of [`F8::times_plus`].

use std::ops::{Add, Div, Mul, Sub};

/// Numbers of a vector.
pub const LANES: usize = 8;

/// The mask of all lanes.
pub const ALL: u32 = (1 << LANES) - 1;

/// One number per lane.
pub type Lanes = [f32; LANES];

/// What computes with eight numbers at a time. Masks are bits, lane 0 the lowest.
pub trait Machine: Copy + Send + Sync + 'static {
    type Float: Copy;
    type Int: Copy;
    fn splat(self, v: f32) -> Self::Float;
    fn load(self, v: Lanes) -> Self::Float;
    fn store(self, v: Self::Float) -> Lanes;
    fn add(self, a: Self::Float, b: Self::Float) -> Self::Float;
    fn sub(self, a: Self::Float, b: Self::Float) -> Self::Float;
    fn mul(self, a: Self::Float, b: Self::Float) -> Self::Float;
    fn div(self, a: Self::Float, b: Self::Float) -> Self::Float;
    /// `a * b + c`, rounded once or twice.
    fn mul_add(self, a: Self::Float, b: Self::Float, c: Self::Float) -> Self::Float;
    /// The smaller; `b` if one is not a number.
    fn min(self, a: Self::Float, b: Self::Float) -> Self::Float;
    /// The larger; `b` if one is not a number.
    fn max(self, a: Self::Float, b: Self::Float) -> Self::Float;
    fn sqrt(self, v: Self::Float) -> Self::Float;
    /// Lanes in which `a < b`; never those that are not numbers.
    fn below(self, a: Self::Float, b: Self::Float) -> u32;
    /// `a` in the lanes of `mask`, `b` in the others.
    fn pick(self, mask: u32, a: Self::Float, b: Self::Float) -> Self::Float;
    /// `a` where `x < y`, `b` elsewhere.
    fn pick_below(self, x: Self::Float, y: Self::Float, a: Self::Float, b: Self::Float) -> Self::Float;
    /// Towards zero; any number where it does not fit.
    fn truncate(self, v: Self::Float) -> Self::Int;
    fn to_float(self, v: Self::Int) -> Self::Float;
    fn bits(self, v: Self::Float) -> Self::Int;
    fn of_bits(self, v: Self::Int) -> Self::Float;
    fn int_splat(self, v: i32) -> Self::Int;
    fn int_load(self, v: [i32; LANES]) -> Self::Int;
    fn int_store(self, v: Self::Int) -> [i32; LANES];
    fn int_add(self, a: Self::Int, b: Self::Int) -> Self::Int;
    fn int_sub(self, a: Self::Int, b: Self::Int) -> Self::Int;
    fn int_mul(self, a: Self::Int, b: Self::Int) -> Self::Int;
    fn int_and(self, a: Self::Int, b: Self::Int) -> Self::Int;
    /// Shifts in zeros.
    fn shift_right<const N: i32>(self, v: Self::Int) -> Self::Int;
    fn shift_left<const N: i32>(self, v: Self::Int) -> Self::Int;
    /// Shifts in the sign.
    fn arithmetic_right<const N: i32>(self, v: Self::Int) -> Self::Int;
    /// From `from + by * part[lane]` with four numbers of each lane, lanes of each of the four.
    fn along(self, rows: [[&[f32; 4]; 2]; LANES], part: Self::Float) -> [Self::Float; 4];
}

/// Eight floating-point numbers.
#[derive(Clone, Copy)]
pub struct F8<M: Machine>(pub M, pub M::Float);

/// Eight whole numbers; sums and products wrap.
#[derive(Clone, Copy)]
pub struct I8<M: Machine>(pub M, pub M::Int);

/// A vector, or a number that stands in all lanes.
pub trait Operand<M: Machine> {
    fn vector(self, m: M) -> F8<M>;
}

impl<M: Machine> Operand<M> for F8<M> {
    #[inline(always)]
    fn vector(self, _: M) -> Self {
        self
    }
}

impl<M: Machine> Operand<M> for f32 {
    #[inline(always)]
    fn vector(self, m: M) -> F8<M> {
        F8(m, m.splat(self))
    }
}

// Closures that compute are not inlined, and then run without vector code: there are none here, and should be none in work.

impl<M: Machine> F8<M> {
    #[inline(always)]
    pub fn splat(m: M, v: f32) -> Self {
        Self(m, m.splat(v))
    }

    #[inline(always)]
    pub fn load(m: M, v: Lanes) -> Self {
        Self(m, m.load(v))
    }

    /// From eight numbers of `v` at `at`.
    #[inline(always)]
    pub fn at(m: M, v: &[f32], at: usize) -> Self {
        let mut out = [0.0; LANES];
        out.copy_from_slice(&v[at..at + LANES]);
        Self::load(m, out)
    }

    #[inline(always)]
    pub fn lanes(self) -> Lanes {
        self.0.store(self.1)
    }

    /// Into eight numbers of `v` at `at`.
    #[inline(always)]
    pub fn put(self, v: &mut [f32], at: usize) {
        v[at..at + LANES].copy_from_slice(&self.lanes());
    }

    /// `self * b + c`, rounded once or twice.
    #[inline(always)]
    pub fn times_plus(self, b: impl Operand<M>, c: impl Operand<M>) -> Self {
        Self(self.0, self.0.mul_add(self.1, b.vector(self.0).1, c.vector(self.0).1))
    }

    /// From `self` towards `other`.
    #[inline(always)]
    pub fn towards(self, other: Self, t: impl Operand<M>) -> Self {
        (other - self).times_plus(t, self)
    }

    #[inline(always)]
    pub fn min(self, b: impl Operand<M>) -> Self {
        Self(self.0, self.0.min(self.1, b.vector(self.0).1))
    }

    #[inline(always)]
    pub fn max(self, b: impl Operand<M>) -> Self {
        Self(self.0, self.0.max(self.1, b.vector(self.0).1))
    }

    /// NaN becomes `lo`.
    #[inline(always)]
    pub fn clamp(self, lo: impl Operand<M>, hi: impl Operand<M>) -> Self {
        self.max(lo).min(hi)
    }

    #[inline(always)]
    pub fn abs(self) -> Self {
        let kept = I8::splat(self.0, i32::MAX);
        self.bits().and(kept).as_float()
    }

    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self(self.0, self.0.sqrt(self.1))
    }

    /// Lanes in which it is less.
    #[inline(always)]
    pub fn below(self, b: impl Operand<M>) -> u32 {
        self.0.below(self.1, b.vector(self.0).1)
    }

    /// Lanes in which it is more.
    #[inline(always)]
    pub fn above(self, b: impl Operand<M>) -> u32 {
        self.0.below(b.vector(self.0).1, self.1)
    }

    /// Itself in the lanes of `mask`, `other` in the rest.
    #[inline(always)]
    pub fn or(self, mask: u32, other: impl Operand<M>) -> Self {
        Self(self.0, self.0.pick(mask, self.1, other.vector(self.0).1))
    }

    /// Itself where `x < y`, `other` elsewhere.
    #[inline(always)]
    pub fn where_below(self, x: Self, y: impl Operand<M>, other: impl Operand<M>) -> Self {
        let m = self.0;
        Self(m, m.pick_below(x.1, y.vector(m).1, self.1, other.vector(m).1))
    }

    #[inline(always)]
    pub fn truncate(self) -> I8<M> {
        I8(self.0, self.0.truncate(self.1))
    }

    #[inline(always)]
    pub fn bits(self) -> I8<M> {
        I8(self.0, self.0.bits(self.1))
    }
}

impl<M: Machine> I8<M> {
    #[inline(always)]
    pub fn splat(m: M, v: i32) -> Self {
        Self(m, m.int_splat(v))
    }

    #[inline(always)]
    pub fn load(m: M, v: [i32; LANES]) -> Self {
        Self(m, m.int_load(v))
    }

    #[inline(always)]
    pub fn lanes(self) -> [i32; LANES] {
        self.0.int_store(self.1)
    }

    #[inline(always)]
    pub fn and(self, b: Self) -> Self {
        Self(self.0, self.0.int_and(self.1, b.1))
    }

    #[inline(always)]
    pub fn to_float(self) -> F8<M> {
        F8(self.0, self.0.to_float(self.1))
    }

    #[inline(always)]
    pub fn as_float(self) -> F8<M> {
        F8(self.0, self.0.of_bits(self.1))
    }

    #[inline(always)]
    pub fn shift_right<const N: i32>(self) -> Self {
        Self(self.0, self.0.shift_right::<N>(self.1))
    }

    #[inline(always)]
    pub fn shift_left<const N: i32>(self) -> Self {
        Self(self.0, self.0.shift_left::<N>(self.1))
    }

    #[inline(always)]
    pub fn arithmetic_right<const N: i32>(self) -> Self {
        Self(self.0, self.0.arithmetic_right::<N>(self.1))
    }
}

macro_rules! operators {
    ($($op:ident $name:ident $float:ident $($int:ident)?;)*) => {$(
        impl<M: Machine, R: Operand<M>> $op<R> for F8<M> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, b: R) -> Self {
                Self(self.0, self.0.$float(self.1, b.vector(self.0).1))
            }
        }
        $(impl<M: Machine> $op for I8<M> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, b: Self) -> Self {
                Self(self.0, self.0.$int(self.1, b.1))
            }
        })?
    )*};
}

operators! {
    Add add add int_add;
    Sub sub sub int_sub;
    Mul mul mul int_mul;
    Div div div;
}

/// Work that any machine can do.
pub trait Work {
    type Output;
    /// Is to be inlined, with all it calls that computes.
    fn run<M: Machine>(self, machine: M) -> Self::Output;
}

/// The best machine there is, found out once.
#[derive(Debug, Clone, Copy)]
pub struct Best {
    #[cfg(target_arch = "x86_64")]
    avx2: Option<pulp::x86::V3>,
}

impl Best {
    #[cfg(target_arch = "x86_64")]
    pub fn new() -> Self {
        Self { avx2: pulp::x86::V3::try_new() }
    }

    #[cfg(not(target_arch = "x86_64"))]
    pub fn new() -> Self {
        Self {}
    }

    #[inline(always)]
    pub fn run<W: Work>(self, work: W) -> W::Output {
        #[cfg(target_arch = "x86_64")]
        if let Some(machine) = self.avx2 {
            return pulp::Simd::vectorize(machine, avx2::On { machine, work });
        }
        work.run(Plain)
    }
}

impl Default for Best {
    fn default() -> Self {
        Self::new()
    }
}

/// Arrays.
#[derive(Debug, Clone, Copy)]
pub struct Plain;

// Loops without closures or iterators, and calls where the compiler prefers them: all work is compiled for this machine too,
// which should not take longer than for the better one.

macro_rules! by_lane {
    ($l:ident => $of:expr) => {{
        let mut out = [Default::default(); LANES];
        let mut $l = 0;
        while $l < LANES {
            out[$l] = $of;
            $l += 1;
        }
        out
    }};
}

impl Machine for Plain {
    type Float = Lanes;
    type Int = [i32; LANES];
    fn splat(self, v: f32) -> Lanes {
        [v; LANES]
    }
    #[inline]
    fn load(self, v: Lanes) -> Lanes {
        v
    }
    #[inline]
    fn store(self, v: Lanes) -> Lanes {
        v
    }
    fn add(self, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => a[l] + b[l])
    }
    fn sub(self, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => a[l] - b[l])
    }
    fn mul(self, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => a[l] * b[l])
    }
    fn div(self, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => a[l] / b[l])
    }
    fn mul_add(self, a: Lanes, b: Lanes, c: Lanes) -> Lanes {
        // not fused: where there is no instruction for it, that is a function of the system
        by_lane!(l => a[l] * b[l] + c[l])
    }
    fn min(self, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => if a[l] < b[l] { a[l] } else { b[l] })
    }
    fn max(self, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => if a[l] > b[l] { a[l] } else { b[l] })
    }
    fn sqrt(self, v: Lanes) -> Lanes {
        by_lane!(l => v[l].sqrt())
    }
    fn below(self, a: Lanes, b: Lanes) -> u32 {
        let bits: [u32; LANES] = by_lane!(l => u32::from(a[l] < b[l]) << l);
        bits.iter().sum()
    }
    fn pick(self, mask: u32, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => if mask >> l & 1 == 1 { a[l] } else { b[l] })
    }
    fn pick_below(self, x: Lanes, y: Lanes, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => if x[l] < y[l] { a[l] } else { b[l] })
    }
    fn truncate(self, v: Lanes) -> [i32; LANES] {
        by_lane!(l => v[l] as i32)
    }
    fn to_float(self, v: [i32; LANES]) -> Lanes {
        by_lane!(l => v[l] as f32)
    }
    fn bits(self, v: Lanes) -> [i32; LANES] {
        by_lane!(l => v[l].to_bits() as i32)
    }
    fn of_bits(self, v: [i32; LANES]) -> Lanes {
        by_lane!(l => f32::from_bits(v[l] as u32))
    }
    fn int_splat(self, v: i32) -> [i32; LANES] {
        [v; LANES]
    }
    #[inline]
    fn int_load(self, v: [i32; LANES]) -> [i32; LANES] {
        v
    }
    #[inline]
    fn int_store(self, v: [i32; LANES]) -> [i32; LANES] {
        v
    }
    fn int_add(self, a: [i32; LANES], b: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => a[l].wrapping_add(b[l]))
    }
    fn int_sub(self, a: [i32; LANES], b: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => a[l].wrapping_sub(b[l]))
    }
    fn int_mul(self, a: [i32; LANES], b: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => a[l].wrapping_mul(b[l]))
    }
    fn int_and(self, a: [i32; LANES], b: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => a[l] & b[l])
    }
    fn shift_right<const N: i32>(self, v: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => (v[l] as u32 >> N) as i32)
    }
    fn shift_left<const N: i32>(self, v: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => v[l] << N)
    }
    fn arithmetic_right<const N: i32>(self, v: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => v[l] >> N)
    }
    fn along(self, rows: [[&[f32; 4]; 2]; LANES], part: Lanes) -> [Lanes; 4] {
        let mut out = [[0.0; LANES]; 4];
        for (c, out) in out.iter_mut().enumerate() {
            *out = by_lane!(l => rows[l][0][c] + (rows[l][1][c] - rows[l][0][c]) * part[l]);
        }
        out
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
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
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All operations on some numbers.
    struct All;

    impl Work for All {
        type Output = Vec<Lanes>;
        #[inline(always)]
        fn run<M: Machine>(self, m: M) -> Vec<Lanes> {
            let a = F8::load(m, [0.5, -3.25, 7.0, 1e-3, f32::NAN, 9.0, -0.0, 250.75]);
            let b = F8::load(m, [2.0, -4.0, 7.0, 1.0, 1.0, f32::NAN, 0.0, -8.0]);
            let mask = |bits: u32| [bits as f32; LANES];
            let ints = |v: I8<M>| v.lanes().map(|v| v as f32);
            let rows: [[f32; 4]; 2 * LANES] =
                std::array::from_fn(|i| std::array::from_fn(|c| (i * i) as f32 + 10.0 * c as f32));
            let part = F8::load(m, [0.0, 0.25, 0.5, 0.75, 1.0, 0.5, 0.25, 0.125]);
            let turned = m.along(std::array::from_fn(|l| [&rows[2 * l], &rows[2 * l + 1]]), part.1);
            let mut out = vec![
                (a + b).lanes(),
                (a - b).lanes(),
                (a * b).lanes(),
                (a / b).lanes(),
                a.times_plus(b, b).lanes(),
                part.towards(b, part).lanes(),
                a.min(b).lanes(),
                a.max(b).lanes(),
                a.abs().lanes(),
                a.abs().sqrt().lanes(),
                mask(a.below(b)),
                a.or(0b1010_0110, b).lanes(),
                part.where_below(a, b, a).lanes(),
                ints(part.truncate()),
                ints((b.max(part) * b.max(part)).truncate() + I8::splat(m, 3)),
                ints(I8::load(m, [-9, 8, 7, 6, 5, 4, 3, 2]) * I8::splat(m, -70_000)),
                ints(I8::load(m, [-9, 8, 7, 6, 5, 4, 3, 2]) - I8::splat(m, 70_000)),
                ints(I8::load(m, [-9, 8, 7, 6, 5, 4, 3, 2]).and(I8::splat(m, 6))),
                ints(I8::load(m, [-9, 8, 7, 6, 5, 4, 3, 2]).shift_right::<2>()),
                ints(I8::load(m, [-9, 8, 7, 6, 5, 4, 3, 2]).shift_left::<2>()),
                ints(I8::load(m, [-9, 8, 7, 6, 5, 4, 3, 2]).arithmetic_right::<2>()),
                I8::load(m, [-9, 8, 7, 6, 5, 4, 3, 2]).to_float().lanes(),
            ];
            out.extend(turned.map(|v| F8(m, v).lanes()));
            out
        }
    }

    #[test]
    fn machines_agree() {
        let (best, plain) = (Best::new().run(All), All.run(Plain));
        for (i, (best, plain)) in best.iter().zip(&plain).enumerate() {
            for l in 0..LANES {
                let same = best[l] == plain[l] || (best[l].is_nan() && plain[l].is_nan());
                assert!(same, "operation {i}, lane {l}: {} and {}", best[l], plain[l]);
            }
        }
        let turned = &plain[plain.len() - 4..];
        // rows 6 and 7, three quarters of the way: 36 + 0.75 * 13
        assert_eq!([0, 1, 2, 3].map(|c: usize| turned[c][3]), [45.75, 55.75, 65.75, 75.75]);
        assert_eq!(plain[10][0], f32::from(0b1000_1001u8 & !0b1000_0000));
    }
}

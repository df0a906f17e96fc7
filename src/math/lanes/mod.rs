//! Eight numbers at a time: what hot loops are written in where the compiler's own vector code falls short.
//!
//! [`Machine`] names the operations, [`F8`] and [`I8`] make them read like arithmetic. There are two machines: [`Plain`],
//! arrays that the compiler makes of what it can, and, chosen at run time, the vector registers of x86 processors with AVX2
//! and FMA. Results agree but for the rounding of [`F8::times_plus`]. [`Doubles`] are for what must be exact; there is a
//! machine with AVX-512 for these, too.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod doubles;
mod plain;

use std::ops::{Add, Div, Mul, Sub};

pub use doubles::{COUNT, Doubles};
pub use plain::Plain;

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

/// Runs loops over arrays compiled for the processor's vectors of eight numbers, or for what every processor has. (The
/// compiler makes worse of the same loops if it is given vectors of sixteen.)
pub fn dispatch<W: pulp::WithSimd>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    return match pulp::x86::V3::try_new() {
        Some(machine) => pulp::Simd::vectorize(machine, work),
        None => work.with_simd(pulp::Scalar),
    };
    #[cfg(not(target_arch = "x86_64"))]
    pulp::Arch::new().dispatch(work)
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

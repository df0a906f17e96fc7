use std::ops::{Add, AddAssign, Mul, Sub, SubAssign};

/// `f32` or `f64`: formulas of hot loops are written once and run in either.
///
/// The comparisons compile to one instruction per lane; of a NaN and a number they return the second argument.
pub trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + AddAssign
    + SubAssign
    + Send
    + Sync
    + Default
    + 'static
{
    /// The nearest representable number.
    fn of(x: f64) -> Self;
    /// Widened without loss.
    fn wide(self) -> f64;
    fn magnitude(self) -> Self;
    fn root(self) -> Self;
    fn inverse(self) -> Self;
    /// The nearest whole number, of numbers up to some millions.
    fn nearest(self) -> Self;
    /// The largest whole number that is not larger; 0 for negative numbers and NaN.
    fn floor_index(self) -> usize;

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
}

macro_rules! real {
    ($t:ty) => {
        impl Real for $t {
            #[inline(always)]
            fn of(x: f64) -> Self {
                x as $t
            }
            #[inline(always)]
            fn wide(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn magnitude(self) -> Self {
                self.abs()
            }
            #[inline(always)]
            fn root(self) -> Self {
                self.sqrt()
            }
            #[inline(always)]
            fn inverse(self) -> Self {
                1.0 / self
            }
            #[inline(always)]
            fn nearest(self) -> Self {
                // numbers of this size have no digits behind the point; additions are vector instructions everywhere
                const SHIFT: $t = 1.5 / <$t>::EPSILON;
                (self + SHIFT) - SHIFT
            }
            #[inline(always)]
            fn floor_index(self) -> usize {
                self as usize
            }
        }
    };
}

real!(f32);
real!(f64);

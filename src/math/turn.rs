//! Sine and cosine without branches, so that loops over them fill the vector units; the same formulas in `f32` and `f64`.

use super::Real;

/// `sin a` and `1 - cos a` of an angle given in full turns, to some units in the last place of 1.
///
/// A quarter of the angle, less whole turns, lies within `[-pi/4, pi/4]`, where Taylor's series is short; the angle is then
/// doubled twice.
#[inline(always)]
pub fn turn<T: Real>(turns: T) -> (T, T) {
    let (one, two) = (T::of(1.0), T::of(2.0));
    let quarter = turns - turns.nearest();
    let y = quarter * quarter;
    let sin = quarter * series(y, SIN);
    let cos = one + y * series(y, COS);
    let (sin, cos) = (two * sin * cos, one - two * sin * sin);
    (two * sin * cos, two * sin * sin)
}

/// The slopes of both by the angle in radians: `cos a` and `sin a`.
#[inline(always)]
pub fn turn_slopes<T: Real>((sin, versed): (T, T)) -> (T, T) {
    (T::of(1.0) - versed, sin)
}

#[inline(always)]
fn series<T: Real, const N: usize>(y: T, coefficients: [f64; N]) -> T {
    let mut sum = T::default();
    for c in coefficients {
        sum = sum * y + T::of(c);
    }
    sum
}

/// `(sin(pi/2 x) / x)` by `x^2`, the highest power first.
const SIN: [f64; 9] = coefficients(1);
/// `(cos(pi/2 x) - 1) / x^2` by `x^2`, the highest power first.
const COS: [f64; 8] = coefficients(2);

/// `+-(pi/2)^n / n!` for n = `first`, `first + 2`, ..; the sign of the first is that of the series.
const fn coefficients<const N: usize>(first: usize) -> [f64; N] {
    let mut out = [0.0; N];
    let mut term = if first == 1 { 1.0 } else { -1.0 };
    let mut n = 1;
    while n <= first {
        term *= std::f64::consts::FRAC_PI_2 / n as f64;
        n += 1;
    }
    let mut i = N;
    while i > 0 {
        i -= 1;
        out[i] = term;
        term *= -std::f64::consts::FRAC_PI_2 / n as f64 * std::f64::consts::FRAC_PI_2 / (n + 1) as f64;
        n += 2;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_those_of_the_library() {
        for i in -40_000..=40_000 {
            let turns = f64::from(i) / 4000.0 + 0.000_031;
            let angle = turns * std::f64::consts::TAU;
            let (sin, versed) = turn(turns);
            // the angle itself is rounded to its own last place
            let slack = 2e-15 + 3e-16 * angle.abs();
            assert!((sin - angle.sin()).abs() < slack, "{turns}: {sin}");
            assert!((versed - (1.0 - angle.cos())).abs() < slack, "{turns}: {versed}");
            let (sin, versed) = turn(turns as f32);
            let slack = 1e-6 + 2e-7 * angle.abs();
            assert!((f64::from(sin) - angle.sin()).abs() < slack && f64::from(versed) >= 0.0, "{turns}: {sin}");
            assert!((f64::from(versed) - (1.0 - angle.cos())).abs() < slack, "{turns}: {versed}");
        }
        assert_eq!(turn(0.0_f64), (0.0, 0.0));
        assert_eq!(turn(-3.0_f32), (0.0, 0.0));
        assert_eq!(turn_slopes(turn(0.0_f64)), (1.0, 0.0));
    }
}

//! Uniform quadratic B-splines: the bump they make, and their basis in a knot interval.
//!
//! The paper looks the bump up in precomputed arrays. On today's processors the formula, a few vector instructions, is some ten
//! times as fast, so there are none here.
//!
//! The quadratic B-spline is the smoothest piecewise quadratic with three pieces; it and its slope are zero at both ends.
//! [`bump`] is that spline stretched to the support `[-1,1]` and scaled to the peak 1:
//! `1 - 3 t^2` for `|t| <= 1/3`, `3/2 (1 - |t|)^2` beyond, 0 outside.

use super::Real;

/// The steepest slope of [`bump`], at `|t| = 1/3`.
pub const STEEPEST: f64 = 2.0;

/// The largest second derivative of [`bump`], for `|t| < 1/3`.
pub const CURVATURE: f64 = 6.0;

/// The quadratic B-spline with support `[-1,1]` and peak 1 (exactly 1 at 0).
///
/// Written with truncated powers, `3/2 (1-|t|)+^2 - 1/2 (1-3|t|)+^2`, which needs no branch.
#[inline(always)]
pub fn bump<T: Real>(t: T) -> T {
    let (outer, inner) = truncated(t);
    T::of(1.5) * outer * outer - T::of(0.5) * inner * inner
}

/// [`bump`] and its slope.
#[inline(always)]
pub fn bump_with_slope<T: Real>(t: T) -> (T, T) {
    let (outer, inner) = truncated(t);
    let steep = T::of(3.0) * (inner - outer);
    let slope = if t < T::default() { T::default() - steep } else { steep };
    (T::of(1.5) * outer * outer - T::of(0.5) * inner * inner, slope)
}

#[inline(always)]
fn truncated<T: Real>(t: T) -> (T, T) {
    let (zero, one) = (T::default(), T::of(1.0));
    let t = t.magnitude();
    ((one - t).larger(zero), (one - T::of(3.0) * t).larger(zero))
}

/// The profile along a displacement: rises as [`bump`] over `[-1,0]`, falls as a bump of twice the width over `[0,2]`.
/// C1 everywhere, peak 1 at 0, zero with zero slope at -1 and 2.
#[inline(always)]
pub fn rise_and_fall<T: Real>(t: T) -> T {
    bump(stretched(t))
}

/// Where on [`bump`] the profile [`rise_and_fall`] is at `t`.
#[inline(always)]
pub fn stretched<T: Real>(t: T) -> T {
    t.smaller(T::of(0.5) * t)
}

/// The least and the greatest value of [`bump`] between `lo` and `hi`.
#[inline(always)]
pub fn bump_range<T: Real>([lo, hi]: [T; 2]) -> [T; 2] {
    let zero = T::default();
    let nearest = lo.larger(zero) - hi.smaller(zero);
    [bump(lo.magnitude().larger(hi.magnitude())), bump(nearest)]
}

/// [`rise_and_fall`] and its slope: at most 2 where it rises, at least -1 where it falls.
#[inline(always)]
pub fn rise_and_fall_with_slope<T: Real>(t: T) -> (T, T) {
    let (value, slope) = bump_with_slope(stretched(t));
    (value, if t < T::default() { slope } else { T::of(0.5) * slope })
}

/// Weights of the three coefficients that act at `x` in `[0,1]` of a knot interval. They are not negative and sum to 1.
#[inline(always)]
pub fn basis<T: Real>(x: T) -> [T; 3] {
    let (half, y) = (T::of(0.5), T::of(1.0) - x);
    [half * y * y, half + x * y, half * x * x]
}

/// Derivatives of [`basis`] by `x`; they sum to 0.
#[inline(always)]
pub fn basis_slope<T: Real>(x: T) -> [T; 3] {
    let one = T::of(1.0);
    [x - one, one - x - x, x]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The textbook pieces, in the textbook's form.
    fn textbook(t: f64) -> f64 {
        let t = t.abs();
        if t <= 1.0 / 3.0 {
            1.0 - 3.0 * t * t
        } else if t < 1.0 {
            1.5 * (1.0 - t).powi(2)
        } else {
            0.0
        }
    }

    #[test]
    fn the_bump_has_its_pieces_its_peak_and_its_support() {
        for i in -3000..=3000 {
            let t = f64::from(i) / 2000.0;
            assert!((bump(t) - textbook(t)).abs() < 1e-15, "{t}");
            assert!((f64::from(bump(t as f32)) - textbook(t)).abs() < 3e-7, "{t}");
        }
        assert_eq!((bump(0.0), bump(1.0), bump(-1.0), bump(7.5)), (1.0, 0.0, 0.0, 0.0));
        assert_eq!(bump(0.0_f32), 1.0);
    }

    #[test]
    fn slopes_agree_with_differences_and_are_bounded() {
        let h = 1e-6;
        for i in -2500..=2500 {
            let t = f64::from(i) / 1000.0 + 0.000_123;
            let (value, slope) = bump_with_slope(t);
            assert_eq!(value, bump(t));
            assert!(((bump(t + h) - bump(t - h)) / (2.0 * h) - slope).abs() < 1e-5, "{t}");
            assert!(slope.abs() <= STEEPEST);
            let (value, slope) = rise_and_fall_with_slope(t);
            assert_eq!(value, rise_and_fall(t));
            assert!(((rise_and_fall(t + h) - rise_and_fall(t - h)) / (2.0 * h) - slope).abs() < 1e-5, "{t}");
            assert!((-1.0..=STEEPEST).contains(&slope));
        }
        assert!((bump_with_slope(-1.0 / 3.0).1 - STEEPEST).abs() < 1e-15);
    }

    #[test]
    fn the_range_of_a_bump_is_that_of_its_samples() {
        for a in -30..=30 {
            for b in a..=30 {
                let (lo, hi) = (f64::from(a) * 0.05, f64::from(b) * 0.05);
                let samples = (0..=200).map(|i| bump(lo + (hi - lo) * f64::from(i) / 200.0));
                let (least, most) = samples.fold((2.0, -1.0), |(l, m), v: f64| (v.min(l), v.max(m)));
                let [low, high] = bump_range([lo, hi]);
                // between the samples the bump rises by less than its curvature over half a step
                let slack = CURVATURE * (hi - lo).powi(2) / 300_000.0 + 1e-15;
                assert!(low <= least + 1e-15 && low > least - slack, "{lo} {hi}: {low} {least}");
                assert!(high >= most - 1e-15 && high < most + slack, "{lo} {hi}: {high} {most}");
            }
        }
    }

    #[test]
    fn the_basis_is_a_partition_of_unity_and_c1_across_knots() {
        for i in 0..=100 {
            let x = f64::from(i) / 100.0;
            let (b, s) = (basis(x), basis_slope(x));
            assert!((b.iter().sum::<f64>() - 1.0).abs() < 1e-15 && b.iter().all(|w| *w >= 0.0));
            assert!(s.iter().sum::<f64>().abs() < 1e-15);
            // the same spline as the bump, of half-width 3/2 knots and peak 3/4
            for (k, w) in b.iter().enumerate() {
                let from_center = x + 1.0 - k as f64 - 0.5;
                assert!((w - 0.75 * bump(from_center / 1.5)).abs() < 1e-15);
            }
        }
        for k in 0..2 {
            assert_eq!(basis(1.0)[k + 1], basis(0.0)[k]);
            assert_eq!(basis_slope(1.0)[k + 1], basis_slope(0.0)[k]);
        }
        assert_eq!((basis(1.0)[0], basis_slope(1.0)[0]), (0.0, 0.0));
    }
}

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::error::{check_falloff, check_length, check_vector, direction};
use super::kernel::BallKernel;
use super::{DeformError, Limited};
use crate::math::{OrientedBox, bspline};

/// How a grab or a brush fades from its centre (1) to its radius (0); every one is C1 with zero slope at both ends.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Falloff {
    /// `(1 - t^2)^3`: C2, the longest pull for a radius.
    #[default]
    Smooth,
    /// The quadratic B-spline: narrower, for a pointed pull.
    Spline,
    /// The inner part, `core` of the radius (0 to 0.9), moves as a whole; smoothstep beyond.
    Core(f64),
}

impl Falloff {
    /// The steepest slope, by the distance in units of the radius.
    pub fn steepest(self) -> f64 {
        match self {
            // at t = 1/sqrt 5
            Self::Smooth => 96.0 / (25.0 * 5.0_f64.sqrt()),
            Self::Spline => bspline::STEEPEST,
            Self::Core(core) => 1.5 / (1.0 - core),
        }
    }

    /// The largest value of `-(t f(t))'`: how steeply `t f(t)` falls back to 0. `(t f(t))'` itself is nowhere above 1.
    pub fn steepest_return(self) -> f64 {
        match self {
            // (1 - t^2)^2 (7 t^2 - 1), at t^2 = 3/7
            Self::Smooth => 32.0 / 49.0,
            // (1 - t) (9 t - 3) / 2, at t = 2/3
            Self::Spline => 0.5,
            Self::Core(core) => {
                // by x = (t - core) / (1 - core)
                let k = 6.0 * core / (1.0 - core);
                let x = ((9.0 - k) + ((9.0 - k).powi(2) + 24.0 * k).sqrt()) / 24.0;
                -1.0 + x * (k + x * (9.0 - k - 8.0 * x))
            }
        }
    }

    /// The largest value of `t f(t)`.
    pub fn farthest(self) -> f64 {
        match self {
            // at t^2 = 1/7
            Self::Smooth => (6.0_f64 / 7.0).powi(3) / 7.0_f64.sqrt(),
            // at t = 1/3
            Self::Spline => 2.0 / 9.0,
            Self::Core(core) => {
                // where the slope of t f(t), -(1 - x) (8 x^2 - (1 - k) x - 1), is 0
                let k = 6.0 * core / (1.0 - core);
                let x = ((1.0 - k) + ((1.0 - k).powi(2) + 32.0).sqrt()) / 16.0;
                (core + (1.0 - core) * x) * (1.0 - x * x * (3.0 - 2.0 * x))
            }
        }
    }
}

/// The shape tool that takes a ball of clay and moves it: what was at `center` is seen at `center + vector`.
///
/// The displacement is `vector * f(|p - (center + vector)| / radius)`: the ball lies round the displaced position, and an
/// injective grab maps it onto itself. It is injective exactly if `|vector| < radius / steepest slope of f`
/// ([`Grab::largest_pull`]).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Plain")]
pub struct Grab {
    center: DVec3,
    vector: DVec3,
    radius: f64,
    falloff: Falloff,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Plain {
    center: DVec3,
    vector: DVec3,
    radius: f64,
    #[serde(default)]
    falloff: Falloff,
}

impl TryFrom<Plain> for Grab {
    type Error = DeformError;

    fn try_from(p: Plain) -> Result<Self, DeformError> {
        Self::new(p.center, p.vector, p.radius, p.falloff)
    }
}

impl Grab {
    /// # Errors
    /// If a number is not finite, the vector has no length, the radius is not positive or the core is out of its range.
    pub fn new(center: DVec3, vector: DVec3, radius: f64, falloff: Falloff) -> Result<Self, DeformError> {
        check_vector("centre", center)?;
        direction(vector)?;
        check_length("radius", radius)?;
        check_falloff(falloff)?;
        Ok(Self { center, vector, radius, falloff })
    }

    pub fn center(&self) -> DVec3 {
        self.center
    }

    pub fn vector(&self) -> DVec3 {
        self.vector
    }

    pub fn radius(&self) -> f64 {
        self.radius
    }

    pub fn falloff(&self) -> Falloff {
        self.falloff
    }

    /// Where the value of [`Grab::center`] is seen: the middle of the ball.
    pub fn displaced(&self) -> DVec3 {
        self.center + self.vector
    }

    /// The longest vector that does not fold with this radius and falloff.
    pub fn largest_pull(&self) -> f64 {
        self.radius / self.falloff.steepest()
    }

    /// `max d . grad V` over the ball: below 1 the map is injective, at 1 and above it is not.
    pub fn steepness(&self) -> f64 {
        self.vector.length() / self.largest_pull()
    }

    /// The same with the vector shortened to `1 - margin` of the largest that does not fold, if it is longer.
    pub fn clamp_to_injective(&self, margin: f64) -> Limited<Self> {
        Limited::by_scale(self.steepness(), margin, self.vector.length(), |s| Self { vector: self.vector * s, ..*self })
    }

    /// With the vector times `scale`.
    ///
    /// # Errors
    /// If the product has no length or is too long.
    pub(super) fn scaled(&self, scale: f64) -> Result<Self, DeformError> {
        Self::new(self.center, self.vector * scale, self.radius, self.falloff)
    }

    /// The same grab on the other side of the plane through `origin` across `normal`.
    ///
    /// # Errors
    /// If the normal has no direction.
    pub fn mirrored(&self, origin: DVec3, normal: DVec3) -> Result<Self, DeformError> {
        let n = direction(normal)?;
        let flip = |v: DVec3| v - 2.0 * v.dot(n) * n;
        Self::new(origin + flip(self.center - origin), flip(self.vector), self.radius, self.falloff)
    }

    /// The cube round the ball outside which nothing moves.
    pub fn support(&self) -> OrientedBox {
        OrientedBox { center: self.displaced(), axes: DMat3::IDENTITY, half: DVec3::splat(self.radius) }
    }

    pub(super) fn kernel(&self, center: DVec3) -> BallKernel<f64> {
        BallKernel::new(self.displaced() - center, self.radius, self.vector, self.falloff)
    }
}

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::brush_kernel::BrushKernel;
use super::error::{check_axis, check_falloff, check_length, check_range, check_vector, direction};
use super::{DeformError, Falloff, Limited};
use crate::math::OrientedBox;

/// What a [`Brush`] does about its centre.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Action {
    /// Grows the content: at the centre by the factor `1 / (1 - amount)`. A negative amount shrinks it.
    Inflate { amount: f64 },
    /// Draws the content towards the line through the centre along `axis`: at the centre by the factor `1 / (1 + amount)`. A
    /// negative amount spreads it.
    Pinch { axis: DVec3, amount: f64 },
    /// Turns the content about the line through the centre along `axis`, right-handed.
    Twist { axis: DVec3, degrees: f64 },
}

/// Amounts beyond this are mistakes.
const LARGEST_AMOUNT: f64 = 100.0;
/// Ten turns.
const LARGEST_ANGLE: f64 = 3600.0;

/// A ball in which content grows, is pinched or twisted.
///
/// What is seen at `p` comes from `c + M(f) (p - c)` with `f = falloff(|p - c| / radius)`, `c` the centre, and by the action
///
/// - inflate: `M = (1 - amount f) I`;
/// - pinch: `M = I + amount f (I - n n^T)` with the unit axis `n`;
/// - twist: `M` turns about `n` by `-degrees f`.
///
/// *Folding.* An inflation maps every ray from the centre to itself, `t -> t - amount t f(t)` in units of the radius, so it is
/// injective exactly if that rises: `amount (t f)' < 1`. `(t f)'` is 1 at the centre and nowhere more, and its least value is
/// known in closed form ([`Falloff::steepest_return`]): inflation folds from an amount of 1, deflation from one of -1 over
/// that. A pinch moves points on rays across the axis; of all of them those through the centre fold first, so its bounds are
/// those of an inflation by the opposite amount. A twist maps every sphere round the centre to itself by a rotation; it never
/// folds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Plain")]
pub struct Brush {
    center: DVec3,
    radius: f64,
    falloff: Falloff,
    action: Action,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Plain {
    center: DVec3,
    radius: f64,
    #[serde(default)]
    falloff: Falloff,
    action: Action,
}

impl TryFrom<Plain> for Brush {
    type Error = DeformError;

    fn try_from(p: Plain) -> Result<Self, DeformError> {
        Self::new(p.center, p.radius, p.falloff, p.action)
    }
}

impl Brush {
    /// Amounts may be -100 to 100 (see [`Brush::steepness`] for what folds), angles -3600 to 3600 degrees.
    ///
    /// # Errors
    /// If a number is not finite or out of its range, the radius is not positive or an axis has no length.
    pub fn new(center: DVec3, radius: f64, falloff: Falloff, action: Action) -> Result<Self, DeformError> {
        check_vector("centre", center)?;
        check_length("radius", radius)?;
        check_falloff(falloff)?;
        match action {
            Action::Inflate { amount } | Action::Pinch { amount, .. } => {
                check_range("amount", amount, -LARGEST_AMOUNT, LARGEST_AMOUNT)?;
            }
            Action::Twist { degrees, .. } => check_range("angle", degrees, -LARGEST_ANGLE, LARGEST_ANGLE)?,
        }
        if let Action::Pinch { axis, .. } | Action::Twist { axis, .. } = action {
            check_axis(axis)?;
        }
        Ok(Self { center, radius, falloff, action })
    }

    pub fn center(&self) -> DVec3 {
        self.center
    }

    pub fn radius(&self) -> f64 {
        self.radius
    }

    pub fn falloff(&self) -> Falloff {
        self.falloff
    }

    pub fn action(&self) -> Action {
        self.action
    }

    /// Below 1 the map is injective, at 1 and above it is not. A twist has 0.
    pub fn steepness(&self) -> f64 {
        let growth = match self.action {
            Action::Inflate { amount } => amount,
            Action::Pinch { amount, .. } => -amount,
            Action::Twist { .. } => 0.0,
        };
        growth.max(-growth * self.falloff.steepest_return())
    }

    /// No value comes from farther away than this, in world units.
    pub fn reach(&self) -> f64 {
        let strength = match self.action {
            Action::Inflate { amount } | Action::Pinch { amount, .. } => amount.abs(),
            // a chord is shorter than its arc
            Action::Twist { degrees, .. } => degrees.to_radians().abs(),
        };
        let reach = strength * self.falloff.farthest() * self.radius;
        if matches!(self.action, Action::Twist { .. }) { reach.min(2.0 * self.radius) } else { reach }
    }

    /// The size of the smallest feature of the field: the width of the falloff's slope, or of a turn by a radian.
    pub(super) fn feature_size(&self) -> f64 {
        let turned = if let Action::Twist { degrees, .. } = self.action { degrees.to_radians().abs() } else { 0.0 };
        self.radius / self.falloff.steepest() / turned.max(1.0)
    }

    /// With amount or angle times `scale`.
    ///
    /// # Errors
    /// If the product is out of its range.
    pub(super) fn scaled(&self, scale: f64) -> Result<Self, DeformError> {
        let action = match self.action {
            Action::Inflate { amount } => Action::Inflate { amount: amount * scale },
            Action::Pinch { axis, amount } => Action::Pinch { axis, amount: amount * scale },
            Action::Twist { axis, degrees } => Action::Twist { axis, degrees: degrees * scale },
        };
        Self::new(self.center, self.radius, self.falloff, action)
    }

    /// The same with the amount lessened to `1 - margin` of the largest that does not fold, if it is larger. The lengths are
    /// those of [`Brush::reach`].
    pub fn clamp_to_injective(&self, margin: f64) -> Limited<Self> {
        // smaller amounts are always valid
        Limited::by_scale(self.steepness(), margin, self.reach(), |s| self.scaled(s).unwrap_or(*self))
    }

    /// The same stroke on the other side of the plane through `origin` across `normal`.
    ///
    /// # Errors
    /// If the normal has no direction.
    pub fn mirrored(&self, origin: DVec3, normal: DVec3) -> Result<Self, DeformError> {
        let n = direction(normal)?;
        let flip = |v: DVec3| v - 2.0 * v.dot(n) * n;
        let action = match self.action {
            Action::Inflate { .. } => self.action,
            Action::Pinch { axis, amount } => Action::Pinch { axis: flip(axis), amount },
            // the mirror image of a right-handed turn is left-handed
            Action::Twist { axis, degrees } => Action::Twist { axis: flip(axis), degrees: -degrees },
        };
        Self::new(origin + flip(self.center - origin), self.radius, self.falloff, action)
    }

    /// The cube round the ball outside which nothing moves.
    pub fn support(&self) -> OrientedBox {
        OrientedBox { center: self.center, axes: DMat3::IDENTITY, half: DVec3::splat(self.radius) }
    }

    /// What `p - c` is multiplied with: the displacement is `f A (p - c)`, or, if an angle in turns is given,
    /// `sin(angle f) A (p - c) - (1 - cos(angle f)) A^2 (p - c)`.
    pub(crate) fn generator(&self) -> (DMat3, Option<f64>) {
        let scaled = |m: DMat3, s: f64| m * DMat3::from_diagonal(DVec3::splat(s));
        match self.action {
            Action::Inflate { amount } => (scaled(DMat3::IDENTITY, amount), None),
            Action::Pinch { axis, amount } => {
                let cross = cross_with(axis.normalize());
                // n x (n x r) is the part of -r across n
                (scaled(cross * cross, amount), None)
            }
            Action::Twist { axis, degrees } => (cross_with(axis.normalize()), Some(degrees / 360.0)),
        }
    }

    pub(super) fn kernel(&self, center: DVec3) -> BrushKernel<f64> {
        BrushKernel::new(self, self.center - center)
    }
}

/// `v -> n x v`.
fn cross_with(n: DVec3) -> DMat3 {
    DMat3::from_cols(n.cross(DVec3::X), n.cross(DVec3::Y), n.cross(DVec3::Z))
}

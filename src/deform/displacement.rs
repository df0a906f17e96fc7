use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::error::{check_length, check_vector, direction};
use super::kernel::SplineKernel;
use super::{DeformError, Limited};
use crate::math::{OrientedBox, PlaneFrame, bspline};

/// How far a [`DisplacementVolume`] reaches, in world units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Extent {
    /// Half-widths across the vector.
    pub u: f64,
    pub v: f64,
    /// Whole length along the vector. A third lies before the peak, two thirds beyond.
    pub length: f64,
}

/// The paper's displacement volume: what was at `point` is seen at `point + vector`, and its surroundings follow smoothly.
///
/// The displacement is `vector * Bu(u) Bv(v) Bw(w)`. All three splines have their peak 1 at the displaced position
/// `point + vector`, so that `backward(point + vector) = point`. `Bu` and `Bv` are quadratic B-splines with the half-widths of
/// the extent. `Bw` rises over the lower third of the length as such a spline and falls over the upper two thirds as one of
/// twice the support: material before the vector is stretched, material ahead is squeezed gently, like something elastic.
/// The box therefore reaches from `length / 3` before the displaced position to `2 length / 3` beyond it.
///
/// The map is injective exactly if `|vector| < length / 6` ([`DisplacementVolume::largest_pull`]).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Plain")]
pub struct DisplacementVolume {
    point: DVec3,
    vector: DVec3,
    extent: Extent,
    #[serde(skip_serializing_if = "Option::is_none")]
    across: Option<DVec3>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Plain {
    point: DVec3,
    vector: DVec3,
    extent: Extent,
    #[serde(default)]
    across: Option<DVec3>,
}

impl TryFrom<Plain> for DisplacementVolume {
    type Error = DeformError;

    fn try_from(p: Plain) -> Result<Self, DeformError> {
        Self::new(p.point, p.vector, p.extent, p.across)
    }
}

/// A drag's length as a part of the largest one that does not fold: at 0.8 material is stretched fivefold at most.
const DRAG_STEEPNESS: f64 = 0.8;

impl DisplacementVolume {
    /// `across` says which way the u axis lies (the part of it along the vector is taken off); without it, any way.
    ///
    /// # Errors
    /// If a number is not finite, the vector has no length, or an extent is not positive.
    pub fn new(point: DVec3, vector: DVec3, extent: Extent, across: Option<DVec3>) -> Result<Self, DeformError> {
        check_vector("point", point)?;
        direction(vector)?;
        check_length("extent along u", extent.u)?;
        check_length("extent along v", extent.v)?;
        check_length("length of the extent", extent.length)?;
        if let Some(a) = across {
            check_vector("direction across", a)?;
        }
        Ok(Self { point, vector, extent, across })
    }

    /// A pull of a round region: `radius` across, and along the vector `radius` before the displaced position, or as much as
    /// it takes to stretch no more than fivefold, and twice that beyond.
    ///
    /// # Errors
    /// As [`DisplacementVolume::new`].
    pub fn from_drag(point: DVec3, vector: DVec3, radius: f64) -> Result<Self, DeformError> {
        check_length("radius", radius)?;
        direction(vector)?;
        let before = radius.max(bspline::STEEPEST / DRAG_STEEPNESS * vector.length());
        Self::new(point, vector, Extent { u: radius, v: radius, length: 3.0 * before }, None)
    }

    /// The strongest pull of a round region that still looks like clay, stretched no more than fivefold: the vector is 0.4
    /// of the radius long.
    ///
    /// # Errors
    /// As [`DisplacementVolume::new`].
    pub fn strongest(point: DVec3, towards: DVec3, radius: f64) -> Result<Self, DeformError> {
        check_length("radius", radius)?;
        Self::from_drag(point, direction(towards)? * (radius * DRAG_STEEPNESS / bspline::STEEPEST), radius)
    }

    pub fn point(&self) -> DVec3 {
        self.point
    }

    pub fn vector(&self) -> DVec3 {
        self.vector
    }

    pub fn extent(&self) -> Extent {
        self.extent
    }

    /// Where the value of [`DisplacementVolume::point`] is seen: the peak of the displacement.
    pub fn displaced(&self) -> DVec3 {
        self.point + self.vector
    }

    /// The longest vector that does not fold with this extent: `length / 6`.
    pub fn largest_pull(&self) -> f64 {
        self.extent.length / (3.0 * bspline::STEEPEST)
    }

    /// `max d . grad V` over the box: below 1 the map is injective, at 1 and above it is not.
    ///
    /// Attained on the axis `u = v = 0`, a third of the way up the rise.
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
        Self::new(self.point, self.vector * scale, self.extent, self.across)
    }

    /// The same stroke on the other side of the plane through `origin` across `normal`, for symmetrical work.
    ///
    /// # Errors
    /// If the normal has no direction.
    pub fn mirrored(&self, origin: DVec3, normal: DVec3) -> Result<Self, DeformError> {
        let n = direction(normal)?;
        let flip = |v: DVec3| v - 2.0 * v.dot(n) * n;
        let across = flip(self.axes().x_axis);
        Self::new(origin + flip(self.point - origin), flip(self.vector), self.extent, Some(across))
    }

    /// Columns are the unit axes u, v, w; w along the vector.
    pub fn axes(&self) -> DMat3 {
        // a checked vector has a direction
        let w = self.vector.normalize();
        let u = self.across.and_then(|a| {
            let flat = a - a.dot(w) * w;
            (flat.length() > 1e-6 * a.length()).then(|| flat.normalize())
        });
        let u = u.or_else(|| PlaneFrame::across(w).map(|f| f.e1)).unwrap_or(DVec3::X);
        DMat3::from_cols(u, w.cross(u), w)
    }

    /// The box outside which nothing moves.
    pub fn support(&self) -> OrientedBox {
        let axes = self.axes();
        let before = self.extent.length / 3.0;
        OrientedBox {
            center: self.displaced() + axes.z_axis * (0.5 * before),
            axes,
            half: DVec3::new(self.extent.u, self.extent.v, 1.5 * before),
        }
    }

    pub(super) fn kernel(&self, center: DVec3) -> SplineKernel<f64> {
        let scale = DVec3::new(self.extent.u, self.extent.v, self.extent.length / 3.0);
        SplineKernel::new(self.displaced() - center, self.axes(), scale, self.vector)
    }
}

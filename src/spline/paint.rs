//! What colour the surface has where it is not the same everywhere.
//!
//! Curvature comes from the Hessian `H` and the gradient `g`: the surface of a level has the mean curvature
//! `(g' H g - |g|^2 tr H) / (2 |g|^3)` and the Gaussian curvature `g' adj(H) g / |g|^4` (Goldman, "Curvature formulas for
//! implicit curves and surfaces", 2005). Second derivatives of the spline jump from piece to piece, and so do the colours, a
//! little.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::volume::transfer::linear_from_srgb;

/// What colours may stand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Curvature {
    /// Positive where what is inside bulges outwards.
    Mean,
    /// Positive on domes and in cups, negative on saddles.
    Gaussian,
}

impl Curvature {
    /// From gradient and Hessian in the world: 1 / length; of the Gaussian curvature the root, with its sign.
    pub fn of(self, gradient: DVec3, hessian: DMat3) -> f64 {
        let square = gradient.length_squared();
        if !(square > 0.0) {
            return 0.0;
        }
        let [a, b, c] = [hessian.x_axis, hessian.y_axis, hessian.z_axis];
        match self {
            Self::Mean => {
                let trace = a.x + b.y + c.z;
                (gradient.dot(hessian * gradient) - square * trace) / (2.0 * square * square.sqrt())
            }
            Self::Gaussian => {
                let adjugate = DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b));
                let product = gradient.dot(adjugate * gradient);
                product.abs().sqrt().copysign(product) / square
            }
        }
    }
}

/// Linear light where curvature is as strong as colours show, positive and negative.
pub const POSITIVE: [f32; 3] = [0.80, 0.10, 0.02];
pub const NEGATIVE: [f32; 3] = [0.02, 0.14, 0.75];

/// A colour moved towards that of a curvature; -1 and 1 are the strongest.
pub fn tinted(base: [f64; 3], strength: f64) -> [f64; 3] {
    let strength = strength.clamp(-1.0, 1.0);
    let end = if strength > 0.0 { POSITIVE } else { NEGATIVE };
    std::array::from_fn(|c| base[c] + (f64::from(end[c]) - base[c]) * strength.abs())
}

/// Colours by value, in linear light.
#[derive(Debug, Clone, PartialEq)]
pub struct Colors {
    /// Equally spaced over the range; beyond it, the outermost.
    pub table: Vec<[f32; 3]>,
    pub range: [f64; 2],
}

impl Colors {
    /// Entries of a table.
    pub const ENTRIES: usize = 256;

    /// By linear interpolation between entries.
    pub fn at(&self, value: f64) -> [f64; 3] {
        let [lo, hi] = self.range;
        let last = self.table.len() - 1;
        let x = ((value - lo) / (hi - lo)).clamp(0.0, 1.0) * last as f64;
        // what is no number is at the lower end
        let i = (x as usize).min(last - 1);
        let t = if x.is_finite() { x - i as f64 } else { 0.0 };
        std::array::from_fn(|c| {
            let [a, b] = [self.table[i][c], self.table[i + 1][c]].map(f64::from);
            a + (b - a) * t
        })
    }
}

/// One of several surfaces that are shown together.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shell {
    /// A real value.
    pub iso: f64,
    pub color: [f32; 3],
    /// 0 to 1.
    pub opacity: f32,
}

/// What a smooth surface shows beside its shape.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SmoothLook {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curvature: Option<Curvature>,
    /// Whether caps on clipping planes have the transfer function's colours, not the surface's own.
    pub caps: bool,
    /// Of the surface; what lies behind it is seen through the rest.
    pub opacity: f32,
    /// Further surfaces; colours in sRGB.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shells: Vec<Shell>,
    /// Whether the surroundings take away ambient light.
    pub occlusion: bool,
    /// Whether they take away the light.
    pub shadows: bool,
    /// Whether the surface is found through the strokes, not in a volume resampled after them.
    pub direct: bool,
}

impl Default for SmoothLook {
    fn default() -> Self {
        Self {
            curvature: None,
            caps: false,
            opacity: 1.0,
            shells: Vec::new(),
            occlusion: false,
            shadows: false,
            direct: false,
        }
    }
}

impl SmoothLook {
    /// Nothing beside the shape.
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }

    /// All surfaces, the one of the largest isovalue first; colours in linear light. `main` is the isovalue and the (linear)
    /// colour of the surface that is always there.
    pub fn all(&self, main: (f64, [f32; 3])) -> Vec<Shell> {
        let mut all = vec![Shell { iso: main.0, color: main.1, opacity: self.opacity.clamp(0.0, 1.0) }];
        let linear =
            |s: &Shell| Shell { color: s.color.map(linear_from_srgb), opacity: s.opacity.clamp(0.0, 1.0), ..*s };
        all.extend(self.shells.iter().map(linear));
        all.sort_by(|a, b| b.iso.total_cmp(&a.iso));
        all
    }
}

/// Colours of a surface, beside its own.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Paint {
    /// Which curvature shows, and the strength of its colour for each 1 / world unit.
    pub curvature: Option<(Curvature, f64)>,
    /// Colours of flat caps where planes cut.
    pub caps: Option<Colors>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn balls_and_cylinders_have_their_curvature() {
        // 1 - |p|^2, higher inside, at a distance of 2
        let p = DVec3::new(1.2, -1.6, 0.0);
        let hessian = DMat3::from_diagonal(DVec3::splat(-2.0));
        assert!((Curvature::Mean.of(-2.0 * p, hessian) - 0.5).abs() < 1e-12);
        assert!((Curvature::Gaussian.of(-2.0 * p, hessian) - 0.5).abs() < 1e-12);
        // a hollow ball
        assert!((Curvature::Mean.of(2.0 * p, -hessian) + 0.5).abs() < 1e-12);
        assert!((Curvature::Gaussian.of(2.0 * p, -hessian) - 0.5).abs() < 1e-12);
        // a cylinder, and a saddle z = x^2 - y^2 at its middle
        let round = DMat3::from_diagonal(DVec3::new(-2.0, -2.0, 0.0));
        assert!((Curvature::Mean.of(-2.0 * p, round) - 0.25).abs() < 1e-12);
        assert_eq!(Curvature::Gaussian.of(-2.0 * p, round), 0.0);
        let saddle = DMat3::from_diagonal(DVec3::new(2.0, -2.0, 0.0));
        assert_eq!(Curvature::Mean.of(DVec3::NEG_Z, saddle), 0.0);
        assert_eq!(Curvature::Gaussian.of(DVec3::NEG_Z, saddle), -2.0);
        assert_eq!(Curvature::Mean.of(DVec3::ZERO, saddle), 0.0);
    }

    #[test]
    fn colours_are_interpolated_and_end_at_the_ends() {
        let colors = Colors { table: vec![[0.0; 3], [1.0, 0.5, 0.0], [0.0, 0.0, 1.0]], range: [-10.0, 10.0] };
        assert_eq!(colors.at(-99.0), [0.0; 3]);
        assert_eq!(colors.at(-5.0), [0.5, 0.25, 0.0]);
        assert_eq!(colors.at(0.0), [1.0, 0.5, 0.0]);
        assert_eq!(colors.at(99.0), [0.0, 0.0, 1.0]);
        assert_eq!(tinted([0.5; 3], 0.0), [0.5; 3]);
        assert_eq!(tinted([0.5; 3], 9.0), POSITIVE.map(f64::from));
        assert_eq!(tinted([0.5; 3], -1.0), NEGATIVE.map(f64::from));
    }
}

//! What a smooth surface shows beside its shape.

use crate::evaluate::load::Object;
use crate::spline::paint::{Colors, Curvature, Paint, Shell};
use crate::volume::Grid;
use crate::volume::transfer::linear_from_srgb;

/// What a smooth surface shows beside its shape.
#[derive(Debug, Clone, PartialEq)]
pub struct SmoothLook {
    pub curvature: Option<Curvature>,
    /// Whether caps on clipping planes have the transfer function's colours, not the surface's own.
    pub caps: bool,
    /// Of the surface; what lies behind it is seen through the rest.
    pub opacity: f32,
    /// Further surfaces; colours in sRGB.
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
    pub(super) fn paint(&self, object: &Object, grid: &Grid) -> Paint {
        // a ball of four voxels shows the strongest colour
        let curvature = self.curvature.map(|curvature| (curvature, 4.0 * grid.finest()));
        let last = (Colors::ENTRIES - 1) as f32;
        let color = |i: usize| {
            let [r, g, b, _] = object.transfer.classify(i as f32 / last);
            [r, g, b]
        };
        let table = || (0..Colors::ENTRIES).map(color).collect();
        Paint { curvature, caps: self.caps.then(|| Colors { table: table(), range: object.window }) }
    }

    /// All surfaces, the one of the largest isovalue first; colours in linear light. `main` is the isovalue and the (linear)
    /// colour of the surface that is always there.
    pub(super) fn all(&self, main: (f64, [f32; 3])) -> Vec<Shell> {
        let mut all = vec![Shell { iso: main.0, color: main.1, opacity: self.opacity.clamp(0.0, 1.0) }];
        let linear =
            |s: &Shell| Shell { color: s.color.map(linear_from_srgb), opacity: s.opacity.clamp(0.0, 1.0), ..*s };
        all.extend(self.shells.iter().map(linear));
        all.sort_by(|a, b| b.iso.total_cmp(&a.iso));
        all
    }
}

//! Transfer functions: from a value to a colour and an opacity.

/// A control point; colour and opacity are linear between points and constant beyond the first and last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlPoint {
    /// Position in the window, 0 to 1; points are kept in ascending order.
    pub at: f32,
    /// sRGB, 0 to 1.
    pub color: [f32; 3],
    /// Opacity of a layer as thick as the volume's finest voxel spacing, 0 to 1.
    pub opacity: f32,
}

/// Which real values the window `0..1` of the control points stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Window {
    /// The volume's minimum and maximum.
    Auto,
    /// These real values.
    Values { lo: f64, hi: f64 },
}

/// A transfer function.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    pub name: String,
    pub window: Window,
    /// At least one.
    pub points: Vec<ControlPoint>,
}

impl TransferFunction {
    /// Linear-light colour and opacity at `s` in the window (clamped to `[0,1]`). Colours are mixed as sRGB, then linearised.
    pub fn classify(&self, s: f32) -> [f32; 4] {
        let s = s.clamp(0.0, 1.0);
        let after = self.points.partition_point(|p| p.at <= s);
        let (a, b) = (&self.points[after.saturating_sub(1)], &self.points[after.min(self.points.len() - 1)]);
        let t = if b.at > a.at { ((s - a.at) / (b.at - a.at)).clamp(0.0, 1.0) } else { 0.0 };
        let mix = |x: f32, y: f32| x + t * (y - x);
        let c: [f32; 3] = std::array::from_fn(|i| linear_from_srgb(mix(a.color[i], b.color[i])));
        [c[0], c[1], c[2], mix(a.opacity, b.opacity)]
    }
}

/// The sRGB transfer curve, decoded.
pub fn linear_from_srgb(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB transfer curve, encoded.
pub fn srgb_from_linear(v: f32) -> f32 {
    if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

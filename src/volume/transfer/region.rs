//! Opacity over two axes: the value, and how steeply values change.
//!
//! # Theory
//!
//! Borders between materials are where values change. Over the plane of values and gradient magnitudes (the joint
//! histogram) materials lie at the bottom and their borders are arches between them, so that regions of this plane tell borders
//! apart that a curve over values cannot (Levoy 1988; Kindlmann and Durkin 1998; Kniss, Kindlmann and Hansen 2002).
//!
//! # Practice
//!
//! A [`Region`] is a trapezoid with soft sides. Where a function has regions its opacity is theirs alone, and its points
//! give the colour of those regions that have none. Regions that overlap add their extinction, as materials that are mixed would.

use super::{TransferError, TransferFunction, check_part, linear_from_srgb};

/// More regions than anybody can tell apart; bounds what a file can cost.
pub const MOST_REGIONS: usize = 64;

/// Soft edges along the steepness are at most this high, in units of [`height_of`]: high regions begin as others do.
const HIGHEST_EDGE: f32 = 0.25;

/// A trapezoid over values and steepness. A side on the border of the plane is open: it is not soft, and nothing beyond it is
/// left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// From and to at its upper edge, in parts of the window, 0 to 1.
    pub value: [f32; 2],
    /// From and to, in parts of the window per voxel of the undeformed volume, 0 to 1.
    pub steepness: [f32; 2],
    /// Width of its lower edge in parts of the upper one, 0 (a triangle) to 1 (a box).
    pub foot: f32,
    /// Part of the way from its sides to its middle over which opacity rises, 0 to 1.
    pub soft: f32,
    /// Opacity in its middle of a layer as thick as the volume's finest voxel spacing, 0 to 1.
    pub opacity: f32,
    /// sRGB, 0 to 1; `None`: as the points say.
    pub color: Option<[f32; 3]>,
}

/// Where a steepness lies on the axis that regions and tables have: its root, as most borders are faint. 0 to 1.
pub fn height_of(steepness: f32) -> f32 {
    steepness.clamp(0.0, 1.0).sqrt()
}

/// The steepness at a height.
pub fn steepness_at(height: f32) -> f32 {
    let h = height.clamp(0.0, 1.0);
    h * h
}

impl Region {
    pub(super) fn check(&self, line: usize) -> Result<(), TransferError> {
        let [red, green, blue] = self.color.unwrap_or_default();
        for (what, x) in [
            ("lower value", self.value[0]),
            ("upper value", self.value[1]),
            ("lower steepness", self.steepness[0]),
            ("upper steepness", self.steepness[1]),
            ("foot", self.foot),
            ("softness", self.soft),
            ("opacity", self.opacity),
            ("red", red),
            ("green", green),
            ("blue", blue),
        ] {
            check_part(line, what, x)?;
        }
        for (what, [lo, hi]) in [("value", self.value), ("steepness", self.steepness)] {
            if lo >= hi {
                return Err(TransferError::RegionOrder { line, what });
            }
        }
        Ok(())
    }

    /// Half its width at a height, in parts of the half-width at its upper edge.
    pub fn narrowing(&self, height: f32) -> f32 {
        let [from, to] = self.steepness.map(height_of);
        let up = if to > from { ((height - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 };
        self.foot + (1.0 - self.foot) * up
    }

    /// How much of its opacity it has for value `s` at a height, 0 to 1.
    pub fn weight(&self, s: f32, height: f32) -> f32 {
        let ([lo, hi], [from, to]) = (self.value, self.steepness.map(height_of));
        // an open side is as if it were far away
        let above = if from > 0.0 { height - from } else { 1.0 };
        let below = if to < 1.0 { to - height } else { 1.0 };
        let edge = 0.5 * self.soft * (to - from).min(HIGHEST_EDGE);
        let (middle, half) = (0.5 * (lo + hi), 0.5 * (hi - lo) * self.narrowing(height));
        let open = if s < middle { lo <= 0.0 } else { hi >= 1.0 };
        let inside = half - (s - middle).abs();
        let across = if open { 1.0 } else { risen(inside, self.soft * half) };
        across * risen(above, edge) * risen(below, edge)
    }
}

/// From 0 to 1 over `edge`, smoothly; without an edge a step.
fn risen(inside: f32, edge: f32) -> f32 {
    let x = if edge > 0.0 { inside / edge } else { f32::from(u8::from(inside >= 0.0)) };
    // what is no number is nothing
    let x = if x > 0.0 { x.min(1.0) } else { 0.0 };
    x * x * (3.0 - 2.0 * x)
}

impl TransferFunction {
    /// Linear-light colour and opacity at `s` in the window where values change by `steepness`, in parts of the window per voxel.
    /// Without regions as [`TransferFunction::classify`].
    pub fn at(&self, s: f32, steepness: f32) -> [f32; 4] {
        let curve = self.classify(s);
        if self.regions.is_empty() { curve } else { self.over_regions(curve, s, height_of(steepness)) }
    }

    /// As [`TransferFunction::at`], from the curve's colour and a height.
    pub(crate) fn over_regions(&self, [r, g, b, _]: [f32; 4], s: f32, height: f32) -> [f32; 4] {
        let s = s.clamp(0.0, 1.0);
        let (mut color, mut depth, mut through) = ([0.0; 3], 0.0, 1.0);
        for region in &self.regions {
            let opacity = region.opacity * region.weight(s, height);
            if opacity <= 0.0 {
                continue;
            }
            let own = region.color.map_or([r, g, b], |c| c.map(linear_from_srgb));
            // what is opaque counts much, not infinitely
            let part = -(1.0 - opacity.min(0.999_999)).ln();
            color = std::array::from_fn(|i| color[i] + part * own[i]);
            depth += part;
            through *= 1.0 - opacity;
        }
        if depth <= 0.0 {
            return [r, g, b, 0.0];
        }
        let [r, g, b] = color.map(|c| c / depth);
        [r, g, b, 1.0 - through]
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ControlPoint, Window};
    use super::*;

    fn region() -> Region {
        Region { value: [0.3, 0.7], steepness: [0.04, 0.25], foot: 0.5, soft: 0.5, opacity: 0.4, color: None }
    }

    #[test]
    fn a_region_is_a_trapezoid_with_soft_sides() {
        let r = region();
        // heights 0.2 to 0.5; edges along the steepness of 0.5 * 0.5 * 0.25
        let edge = 0.0625;
        assert_eq!(r.weight(0.5, 0.35), 1.0);
        assert_eq!((r.weight(0.5, 0.19), r.weight(0.5, 0.51)), (0.0, 0.0));
        assert!((r.weight(0.5, 0.2 + 0.5 * edge) - 0.5).abs() < 1e-5);
        // half as wide at the foot, three quarters in the middle
        for (height, half) in [(0.35, 0.15), (0.3, 0.2 * (0.5 + 0.5 / 3.0))] {
            assert_eq!((r.weight(0.5 - 1.01 * half, height), r.weight(0.5 + 1.01 * half, height)), (0.0, 0.0));
            // the rise takes half of the way to the middle
            assert!((r.weight(0.5 + 0.75 * half, height) - 0.5).abs() < 1e-4, "{height}");
            assert!(r.weight(0.5 + 0.49 * half, height) > 0.999);
        }
        let triangle = Region { foot: 0.0, ..r };
        assert!(triangle.weight(0.5 + 0.18, 0.43) == 0.0 && r.weight(0.5 + 0.16, 0.43) > 0.0);
        let hard = Region { soft: 0.0, ..r };
        assert_eq!((hard.weight(0.5, 0.201), hard.weight(0.5, 0.199), hard.weight(0.66, 0.43)), (1.0, 0.0, 1.0));
    }

    #[test]
    fn sides_on_the_border_are_open() {
        let r = Region { value: [0.0, 0.4], steepness: [0.0, 1.0], ..region() };
        assert_eq!((r.weight(0.0, 0.0), r.weight(0.0, 1.0), r.weight(0.1, 0.5)), (1.0, 1.0, 1.0));
        assert_eq!(r.weight(0.5, 0.5), 0.0);
        let r = Region { value: [0.6, 1.0], ..r };
        assert_eq!((r.weight(1.0, 0.0), r.weight(0.5, 0.5)), (1.0, 0.0));
    }

    #[test]
    fn overlapping_regions_add_their_extinction() {
        let points = vec![ControlPoint { at: 0.0, color: [1.0, 0.0, 0.0], opacity: 0.9 }];
        let mut tf = TransferFunction { name: "test".into(), window: Window::Auto, points, regions: vec![] };
        assert_eq!(tf.at(0.5, 0.1), tf.classify(0.5));
        tf.regions = vec![Region { opacity: 0.4, ..region() }];
        let one = tf.at(0.5, 0.1225);
        assert!((one[3] - 0.4).abs() < 1e-6 && one[0] == 1.0, "the opacity of the points does not count");
        tf.regions.push(Region { opacity: 0.4, color: Some([0.0, 0.0, 1.0]), ..region() });
        let two = tf.at(0.5, 0.1225);
        assert!((two[3] - 0.64).abs() < 1e-6 && (two[0] - 0.5).abs() < 1e-6 && (two[2] - 0.5).abs() < 1e-6);
        assert_eq!(tf.at(0.5, 0.9)[3], 0.0);
        assert_eq!(tf.at(0.5, f32::NAN)[3], 0.0);
    }
}

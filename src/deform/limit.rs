use serde::{Deserialize, Serialize};

/// What to do with a stroke that would fold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Limit {
    /// Shorten it until its steepness is at most `1 - margin` (margin in 0 to 1).
    Clamp { margin: f64 },
    /// Do as asked.
    LetThrough,
}

impl Default for Limit {
    fn default() -> Self {
        Self::Clamp { margin: 0.05 }
    }
}

/// A deformer after the limit, and how much was held back.
#[derive(Debug, Clone, PartialEq)]
pub struct Limited<T> {
    pub deformer: T,
    /// Length of the displacement (of a lattice: the longest handle vector) that was asked for, in world units.
    pub asked: f64,
    /// The length that is left.
    pub kept: f64,
}

impl<T> Limited<T> {
    /// World units that were held back; 0 if the stroke is as asked.
    pub fn held_back(&self) -> f64 {
        self.asked - self.kept
    }

    /// Scales a displacement of `length` so that `steepness` times the scale is at most `1 - margin`.
    pub(super) fn by_scale(steepness: f64, margin: f64, length: f64, scaled: impl FnOnce(f64) -> T) -> Self {
        let most = 1.0 - margin.clamp(0.0, 0.999);
        // with no margin the last bit still stays below the fold
        let most = most.min(1.0 - 1e-12);
        let scale = if steepness > most { most / steepness } else { 1.0 };
        Self { deformer: scaled(scale), asked: length, kept: length * scale }
    }

    pub(super) fn map<U>(self, wrap: impl FnOnce(T) -> U) -> Limited<U> {
        Limited { deformer: wrap(self.deformer), asked: self.asked, kept: self.kept }
    }
}

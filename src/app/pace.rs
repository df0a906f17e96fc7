//! How coarse a picture has to be to come in time.

use crate::evaluate::picture::PictureReport;

/// Coarser than this nothing can be made out.
const COARSEST: f64 = 0.2;

/// What pictures cost here, learned from those that were made.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// Nanoseconds for a pixel of a slice.
    pixel: f64,
    /// Milliseconds for slices and whatever else does not depend on the number of pixels.
    fixed: f64,
}

impl Default for Pace {
    fn default() -> Self {
        // a slow machine: the first picture is soon there, and tells the truth
        Self { pixel: 4.0, fixed: 8.0 }
    }
}

impl Pace {
    pub fn learn(&mut self, report: &PictureReport, (w, h): (u32, u32)) {
        let work = f64::from(w) * f64::from(h) * report.slices.max(1) as f64;
        let mix = |old: f64, new: f64| 0.6 * old + 0.4 * new;
        self.pixel = mix(self.pixel, report.ms_draw * 1e6 / work.max(1.0)).clamp(1e-4, 1e3);
        self.fixed = mix(self.fixed, report.ms_geometry);
    }

    /// The part of the full resolution that fits into `budget` milliseconds.
    pub fn scale(&self, (w, h): (u32, u32), slices: f64, budget: f64) -> f64 {
        let full = self.pixel * 1e-6 * f64::from(w) * f64::from(h) * slices;
        ((budget - self.fixed).max(0.25 * budget) / full.max(1e-9)).sqrt().clamp(COARSEST, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_slow_is_drawn_coarser() {
        let size = (1000, 800);
        let scale = |pixel: f64, budget: f64| Pace { pixel, fixed: 2.0 }.scale(size, 200.0, budget);
        assert!(scale(4.0, 33.0) < scale(1.0, 33.0));
        assert!(scale(1.0, 33.0) < scale(1.0, 100.0));
        // within bounds, however slow or fast
        assert_eq!((scale(1e3, 33.0), scale(1e-4, 33.0)), (COARSEST, 1.0));
        // the time is kept: pixels times slices times their cost, and what is fixed
        let s = scale(1.0, 33.0);
        let ms = 1e-6 * s * s * 1000.0 * 800.0 * 200.0 + 2.0;
        assert!((ms - 33.0).abs() < 1e-6, "{ms}");
    }
}

//! How coarse a picture has to be to come in time.

use crate::evaluate::picture::PictureReport;

/// Coarser than this nothing can be made out.
const COARSEST: f64 = 0.2;

/// What pictures cost here, learned from those that were made.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// Nanoseconds for a pixel of a slice.
    pixel: f64,
    /// Nanoseconds for a triangle, however small.
    triangle: f64,
    /// Triangles of a slice in the last coarse picture.
    triangles: f64,
    /// Milliseconds for making one slice, whatever its size in pixels.
    slice: f64,
    /// What was taken last for coarse pictures: the part of the full resolution, and the number of slices.
    scale: f64,
    slices: f64,
}

/// Coarse pictures stay as coarse as they are while what fits is within this factor: a picture must not swim under the hand, and
/// slices that stay where they are need not be made again.
const STEADY: f64 = 1.3;
/// The number of slices rises only when so many times as many fit: with another number all of them are made again, and the
/// time of that speaks against it at once.
const RISE: f64 = 2.0;
/// The part of the time in which slices are made; the rest is for their pixels.
const MAKING: f64 = 0.1;
/// A triangle costs about as many pixels of slices: the scale on which what was not foreseen is shared between both.
const TRIANGLE: f64 = 300.0;
/// The part of what was not foreseen that is learned at once.
const LEARNED: f64 = 0.4;
/// Fewer slices tear the object apart.
const FEWEST: f64 = 64.0;

impl Default for Pace {
    fn default() -> Self {
        // a slow machine: the first picture is soon there, and tells the truth
        Self { pixel: 4.0, triangle: 4.0 * TRIANGLE, triangles: 0.0, slice: 0.05, scale: 0.0, slices: 0.0 }
    }
}

impl Pace {
    /// For surfaces, whose pictures are of one layer.
    pub fn of_surfaces() -> Self {
        Self { pixel: 1500.0, ..Self::default() }
    }

    /// `coarse`: whether its slices were roughly split, as those are whose number is chosen.
    pub fn learn(&mut self, report: &PictureReport, (w, h): (u32, u32), coarse: bool) {
        let slices = report.slices.max(1) as f64;
        let (pixels, triangles) = (f64::from(w) * f64::from(h) * slices, report.triangles as f64);
        // pictures with many pixels teach what pixels cost, those of many small triangles what triangles do
        let missed = report.ms_draw * 1e6 - self.pixel * pixels - self.triangle * triangles;
        let weights = [pixels, triangles * TRIANGLE];
        let step = LEARNED * missed / (weights[0] * weights[0] + weights[1] * weights[1]).max(1.0);
        self.pixel = (self.pixel + step * weights[0]).clamp(1e-4, 1e4);
        self.triangle = (self.triangle + step * weights[1] * TRIANGLE).clamp(0.0, 1e6);
        if coarse {
            self.triangles = triangles / slices;
        }
        // where most were kept their time says nothing of what others take
        if coarse && 4 * report.made >= report.slices {
            let made = report.ms_geometry / slices;
            self.slice = (self.slice + LEARNED * (made - self.slice)).clamp(1e-4, 1e3);
        }
    }

    /// The part of the full resolution that fits into `budget` milliseconds.
    pub fn scale(&self, (w, h): (u32, u32), slices: f64, budget: f64) -> f64 {
        let full = self.pixel * 1e-6 * f64::from(w) * f64::from(h) * slices;
        let whatever = (self.slice + self.triangle * 1e-6 * self.triangles) * slices;
        ((budget - whatever).max(0.25 * budget) / full.max(1e-9)).sqrt().clamp(COARSEST, 1.0)
    }

    /// The same for coarse pictures: it changes in steps.
    pub fn coarse(&mut self, size: (u32, u32), slices: f64, budget: f64) -> f64 {
        let scale = self.scale(size, slices, budget);
        steady(&mut self.scale, scale, STEADY)
    }

    /// Of the slices wanted, as many as can be made in a tenth of `budget` milliseconds; this changes in steps, too.
    pub fn slices(&mut self, wanted: f64, budget: f64) -> f64 {
        let slices = wanted.min((MAKING * budget / self.slice).max(FEWEST)).round();
        let few = self.slices < wanted.min(FEWEST);
        steady(&mut self.slices, slices, if few { 1.0 } else { RISE })
    }
}

/// What was taken last, unless what fits now is too far below it, or `rise` times as much.
fn steady(taken: &mut f64, fits: f64, rise: f64) -> f64 {
    if !(*taken / STEADY..=*taken * rise).contains(&fits) {
        *taken = fits;
    }
    *taken
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_slow_is_drawn_coarser() {
        let size = (1000, 800);
        let pace = |pixel: f64| Pace { pixel, slice: 0.01, ..Pace::default() };
        let scale = |pixel: f64, budget: f64| pace(pixel).scale(size, 200.0, budget);
        assert!(scale(4.0, 33.0) < scale(1.0, 33.0));
        assert!(scale(1.0, 33.0) < scale(1.0, 100.0));
        // many small triangles leave less time for pixels
        let many = Pace { triangles: 300.0, triangle: 200.0, ..pace(1.0) };
        let left = many.scale(size, 200.0, 33.0) / scale(1.0, 33.0);
        assert!((left * left - (33.0 - 2.0 - 12.0) / (33.0 - 2.0)).abs() < 1e-6, "{left}");
        // within bounds, however slow or fast
        assert_eq!((scale(1e3, 33.0), scale(1e-4, 33.0)), (COARSEST, 1.0));
        // the time is kept: pixels times slices times their cost, and what is fixed
        let s = scale(1.0, 33.0);
        let ms = 1e-6 * s * s * 1000.0 * 800.0 * 200.0 + 2.0;
        assert!((ms - 33.0).abs() < 1e-6, "{ms}");
    }

    fn report(slices: usize, triangles: usize, ms_draw: f64) -> PictureReport {
        PictureReport {
            slices,
            made: slices,
            triangles,
            fragments: None,
            tets: None,
            spline: None,
            warnings: Vec::new(),
            backend: "cpu",
            device: String::new(),
            ms_geometry: 1.0,
            ms_draw,
            ms_total: 1.0 + ms_draw,
        }
    }

    #[test]
    fn what_pixels_and_triangles_cost_is_told_apart() {
        let (pixel, triangle) = (0.6, 350.0);
        let mut pace = Pace::default();
        for i in 0..200 {
            let coarse = i % 3 != 0;
            let ((w, h), slices, triangles) =
                if coarse { ((200, 160), 100, 40_000) } else { ((980, 800), 400, 250_000) };
            let pixels = f64::from(w) * f64::from(h) * slices as f64;
            let ms_draw = 1e-6 * (pixel * pixels + triangle * triangles as f64);
            pace.learn(&report(slices, triangles, ms_draw), (w, h), coarse);
        }
        assert!((pace.pixel - pixel).abs() < 0.05 * pixel, "{}", pace.pixel);
        assert!((pace.triangle - triangle).abs() < 0.05 * triangle, "{}", pace.triangle);
        assert_eq!(pace.triangles, 400.0);
    }

    #[test]
    fn coarse_pictures_are_steady() {
        let size = (1000, 800);
        let mut pace = Pace { pixel: 0.5, slice: 0.05, ..Pace::default() };
        let first = pace.coarse(size, 200.0, 33.0);
        assert_eq!(first, pace.scale(size, 200.0, 33.0));
        pace.pixel *= 1.2;
        assert_eq!(pace.coarse(size, 200.0, 33.0), first);
        pace.pixel *= 4.0;
        assert!(pace.coarse(size, 200.0, 33.0) < 0.6 * first);
        // as many slices as a tenth of the time allows, never very few, and all if there are no more
        pace.slice = 0.02;
        assert_eq!(pace.slices(1000.0, 33.0), 165.0);
        pace.slice = 0.022;
        assert_eq!(pace.slices(1000.0, 33.0), 165.0);
        pace.slice = 5.0;
        assert_eq!(pace.slices(1000.0, 33.0), FEWEST);
        // less time for each makes no more of them until there may be twice as many
        pace.slice = 0.03;
        assert_eq!(pace.slices(1000.0, 33.0), FEWEST);
        pace.slice = 0.02;
        assert_eq!(pace.slices(1000.0, 33.0), 165.0);
        assert_eq!(pace.slices(40.0, 33.0), 40.0);
        assert_eq!(pace.slices(60.0, 33.0), 60.0);
    }
}

//! Presets, and how they are fitted to a volume.
//!
//! # Theory
//!
//! A CT preset is drawn on the Hounsfield scale (air -1000, fat about -100, soft tissue 40, cortical bone 1000 and more).
//! Files often hold something else: Hounsfield units plus 1024, or bytes stretched over a window. [`Window::for_ct`] finds
//! the straight line from Hounsfield units to the file's values:
//!
//! 1. A range that begins below -200 is taken as Hounsfield units.
//! 2. Otherwise air is the lowest value and soft tissue, 40, the highest peak of the histogram above the lowest eighth of
//!    the range. In the head scans tried (real 0 to 1, and bytes) the second anchor puts fat at its own small peak.
//! 3. Without such a peak the range stands for -1000 to 2000.
//!
//! The other presets are drawn on fractions of the range; the lower end starts above the background noise.

use super::{ControlPoint, TransferFunction, Window, auto};

/// What scale a preset is drawn on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Modality {
    /// Hounsfield units.
    Ct,
    /// Fractions of the volume's range.
    Range,
    /// None: it is made from the histogram.
    Histogram,
}

/// A named transfer function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Preset {
    pub name: &'static str,
    pub description: &'static str,
    pub modality: Modality,
    /// Value on the preset's scale, red, green, blue, opacity.
    points: &'static [[f32; 5]],
}

const PRESETS: [Preset; 13] = [
    Preset {
        name: "auto",
        description: "made from the histogram: what is rare and bright is solid, what is common is veiled",
        modality: Modality::Histogram,
        points: &[],
    },
    Preset {
        name: "ct-head",
        description: "skin as a warm veil over an ivory skull",
        modality: Modality::Ct,
        points: &[
            [-1000.0, 0.80, 0.56, 0.45, 0.0],
            [-520.0, 0.86, 0.62, 0.50, 0.0],
            [-300.0, 0.98, 0.78, 0.66, 0.075],
            [-120.0, 0.94, 0.70, 0.58, 0.010],
            [20.0, 0.86, 0.52, 0.42, 0.0025],
            [120.0, 0.86, 0.56, 0.45, 0.0025],
            [260.0, 0.90, 0.82, 0.68, 0.10],
            [520.0, 0.96, 0.91, 0.79, 0.55],
            [1400.0, 0.99, 0.97, 0.90, 0.85],
            [2200.0, 1.0, 1.0, 0.98, 0.95],
        ],
    },
    Preset {
        name: "ct-bone",
        description: "bone alone, ivory",
        modality: Modality::Ct,
        points: &[
            [-1000.0, 0.55, 0.25, 0.18, 0.0],
            [130.0, 0.62, 0.34, 0.24, 0.0],
            [220.0, 0.80, 0.62, 0.46, 0.10],
            [380.0, 0.93, 0.86, 0.72, 0.55],
            [900.0, 0.98, 0.95, 0.87, 0.85],
            [1800.0, 1.0, 0.99, 0.96, 0.95],
        ],
    },
    Preset {
        name: "ct-skin",
        description: "the body's surface, closed",
        modality: Modality::Ct,
        points: &[
            [-1000.0, 0.80, 0.56, 0.45, 0.0],
            [-480.0, 0.84, 0.60, 0.48, 0.0],
            [-320.0, 0.90, 0.69, 0.57, 0.35],
            [-150.0, 0.92, 0.72, 0.60, 0.75],
            [60.0, 0.88, 0.62, 0.50, 0.9],
            [300.0, 0.95, 0.88, 0.76, 0.95],
            [1500.0, 1.0, 0.98, 0.94, 0.98],
        ],
    },
    Preset {
        name: "ct-muscle",
        description: "flesh and bone without fat and skin",
        modality: Modality::Ct,
        points: &[
            [-1000.0, 0.60, 0.22, 0.18, 0.0],
            [-60.0, 0.86, 0.66, 0.50, 0.0],
            [0.0, 0.76, 0.46, 0.38, 0.03],
            [50.0, 0.70, 0.36, 0.30, 0.14],
            [110.0, 0.74, 0.42, 0.34, 0.14],
            [230.0, 0.90, 0.80, 0.64, 0.30],
            [600.0, 0.97, 0.93, 0.82, 0.75],
            [1800.0, 1.0, 0.99, 0.96, 0.95],
        ],
    },
    Preset {
        name: "ct-airways",
        description: "lungs and airways from within, the body a breath around them",
        modality: Modality::Ct,
        points: &[
            [-1000.0, 0.42, 0.58, 0.68, 0.0],
            [-960.0, 0.45, 0.62, 0.72, 0.0],
            [-900.0, 0.55, 0.70, 0.78, 0.012],
            [-700.0, 0.72, 0.70, 0.70, 0.02],
            [-450.0, 0.90, 0.66, 0.56, 0.07],
            [-250.0, 0.88, 0.60, 0.50, 0.012],
            [0.0, 0.80, 0.40, 0.34, 0.002],
            [200.0, 0.90, 0.80, 0.66, 0.01],
            [700.0, 0.97, 0.93, 0.82, 0.10],
            [1800.0, 1.0, 0.99, 0.96, 0.3],
        ],
    },
    Preset {
        name: "mri",
        description: "MRI of a head: soft skin over the brain's greys",
        modality: Modality::Range,
        points: &[
            [0.0, 0.55, 0.38, 0.32, 0.0],
            [0.09, 0.62, 0.42, 0.35, 0.0],
            [0.16, 0.80, 0.58, 0.47, 0.06],
            [0.30, 0.84, 0.62, 0.52, 0.10],
            [0.42, 0.86, 0.70, 0.62, 0.16],
            [0.60, 0.94, 0.86, 0.78, 0.30],
            [1.0, 1.0, 0.97, 0.90, 0.5],
        ],
    },
    Preset {
        name: "angiography",
        description: "bright vessels in a dark volume",
        modality: Modality::Range,
        points: &[
            [0.0, 0.25, 0.05, 0.05, 0.0],
            [0.15, 0.36, 0.06, 0.06, 0.0],
            [0.28, 0.62, 0.12, 0.09, 0.10],
            [0.45, 0.80, 0.24, 0.14, 0.45],
            [0.75, 0.94, 0.52, 0.30, 0.8],
            [1.0, 1.0, 0.80, 0.58, 0.95],
        ],
    },
    Preset {
        name: "engine",
        description: "industrial CT: translucent aluminium around warm steel",
        modality: Modality::Range,
        points: &[
            [0.0, 0.40, 0.46, 0.52, 0.0],
            [0.18, 0.46, 0.53, 0.60, 0.0],
            [0.28, 0.60, 0.68, 0.75, 0.11],
            [0.40, 0.68, 0.75, 0.81, 0.05],
            [0.52, 0.72, 0.78, 0.83, 0.014],
            [0.65, 0.76, 0.78, 0.78, 0.014],
            [0.74, 0.86, 0.64, 0.40, 0.25],
            [0.86, 0.93, 0.68, 0.38, 0.8],
            [1.0, 1.0, 0.86, 0.60, 0.95],
        ],
    },
    Preset {
        name: "metal",
        description: "industrial CT: a solid casting",
        modality: Modality::Range,
        points: &[
            [0.0, 0.40, 0.46, 0.52, 0.0],
            [0.24, 0.46, 0.53, 0.60, 0.0],
            [0.42, 0.68, 0.72, 0.76, 0.5],
            [0.60, 0.78, 0.81, 0.83, 0.9],
            [0.74, 0.90, 0.72, 0.50, 0.95],
            [1.0, 0.98, 0.84, 0.62, 0.98],
        ],
    },
    Preset {
        name: "orange",
        description: "peel, pith and flesh of the orange",
        modality: Modality::Range,
        points: &[
            [0.0, 0.98, 0.90, 0.74, 0.0],
            [0.10, 0.99, 0.93, 0.80, 0.0],
            [0.22, 0.99, 0.92, 0.78, 0.20],
            [0.34, 0.99, 0.86, 0.62, 0.35],
            [0.46, 0.99, 0.70, 0.28, 0.5],
            [0.62, 0.98, 0.58, 0.12, 0.7],
            [0.80, 0.96, 0.50, 0.07, 0.9],
            [1.0, 0.90, 0.80, 0.60, 0.95],
        ],
    },
    Preset {
        name: "carp",
        description: "a fish: pearly skin as a veil over its bones",
        modality: Modality::Range,
        points: &[
            [0.0, 0.50, 0.56, 0.54, 0.0],
            [0.13, 0.56, 0.62, 0.58, 0.0],
            [0.22, 0.70, 0.74, 0.68, 0.07],
            [0.34, 0.72, 0.68, 0.56, 0.016],
            [0.48, 0.78, 0.64, 0.48, 0.008],
            [0.57, 0.86, 0.76, 0.58, 0.05],
            [0.70, 0.95, 0.89, 0.76, 0.5],
            [0.86, 0.99, 0.96, 0.88, 0.85],
            [1.0, 1.0, 0.98, 0.94, 0.95],
        ],
    },
    Preset {
        name: "grey",
        description: "a straight ramp from nothing to white",
        modality: Modality::Range,
        points: &[[0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0, 0.25]],
    },
];

/// Hounsfield units of the anchors that [`Window::for_ct`] finds.
const AIR: f64 = -1000.0;
const SOFT: f64 = 40.0;

impl Preset {
    /// The preset as drawn, with its window on its own scale. `auto` is a plain ramp without a histogram.
    pub fn plain(&self) -> TransferFunction {
        let (lo, hi) = match (self.points.first(), self.points.last()) {
            (Some(a), Some(b)) if self.modality == Modality::Ct => (a[0], b[0]),
            _ => (0.0, 1.0),
        };
        let window = match self.modality {
            Modality::Ct => Window::Values { lo: f64::from(lo), hi: f64::from(hi) },
            Modality::Range | Modality::Histogram => Window::Auto,
        };
        let points = self.points.iter().map(|&[x, r, g, b, opacity]| ControlPoint {
            at: (x - lo) / (hi - lo),
            color: [r, g, b],
            opacity,
        });
        let mut points: Vec<_> = points.collect();
        if points.is_empty() {
            points = auto::ramp();
        }
        TransferFunction { name: self.name.to_owned(), window, points, regions: Vec::new() }
    }

    /// The preset fitted to a volume with real values in `range` and `counts` in equal bins over it (may be empty).
    pub fn fitted(&self, range: [f64; 2], counts: &[u64]) -> TransferFunction {
        match self.modality {
            Modality::Histogram => auto::from_histogram(counts),
            Modality::Range => self.plain(),
            Modality::Ct => {
                let plain = self.plain();
                let Window::Values { lo, hi } = plain.window else { return plain };
                TransferFunction { window: Window::for_ct(range, counts, [lo, hi]), ..plain }
            }
        }
    }
}

impl Window {
    /// The window that shows Hounsfield units `hu` of a CT volume with real values in `range` and `counts` in equal bins
    /// over it (may be empty); see the module page for how other scales are recognised.
    pub fn for_ct(range: [f64; 2], counts: &[u64], hu: [f64; 2]) -> Self {
        let [lo, hi] = Self::Auto.resolve(range);
        if lo < -200.0 {
            return Self::Values { lo: hu[0], hi: hu[1] };
        }
        let per_unit = match soft_peak(counts) {
            Some(part) => part * (hi - lo) / (SOFT - AIR),
            None => (hi - lo) / 3000.0,
        };
        let value = |h: f64| lo + (h - AIR) * per_unit;
        Self::Values { lo: value(hu[0]), hi: value(hu[1]) }
    }
}

/// Where, as a fraction of the range, the histogram's highest peak above the lowest eighth lies.
fn soft_peak(counts: &[u64]) -> Option<f64> {
    let n = counts.len();
    // the last bin also holds what was clipped
    let (from, to) = (n / 8, n.saturating_sub(1));
    let bin = (from..to).max_by_key(|&i| (counts[i], std::cmp::Reverse(i)))?;
    (n >= 16 && counts[bin] > 0).then(|| (bin as f64 + 0.5) / n as f64)
}

impl TransferFunction {
    /// All presets, the best for an unknown volume first.
    pub fn presets() -> &'static [Preset] {
        &PRESETS
    }

    /// A preset as drawn, on its own scale.
    pub fn by_name(name: &str) -> Option<Self> {
        PRESETS.iter().find(|p| p.name == name).map(Preset::plain)
    }

    /// A preset fitted to a volume with real values in `range` and `counts` in equal bins over it (may be empty).
    pub fn for_volume(name: &str, range: [f64; 2], counts: &[u64]) -> Option<Self> {
        PRESETS.iter().find(|p| p.name == name).map(|p| p.fitted(range, counts))
    }
}

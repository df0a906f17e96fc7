//! Transfer functions: from a value to a colour and an opacity.
//!
//! # Practice
//!
//! [`TransferFunction::for_volume`] turns a name into a function that fits a volume: a preset, moved to where the volume
//! keeps its materials, or `auto`, made from the histogram. [`TransferFunction::parse`] and `Display` are the readable text
//! form; they are each other's inverse.

mod auto;
mod presets;
mod region;
mod text;

pub use presets::{Modality, Preset};
pub use region::{MOST_REGIONS, Region, height_of, steepness_at};

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
    /// If there are any, opacity is theirs, over values and steepness; see [`Region`].
    pub regions: Vec<Region>,
}

/// Why a transfer function cannot be. Lines count from 1.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TransferError {
    #[error("line {line}: the file should begin with `voxclay transfer function 1`, not {found:?}")]
    Header { line: usize, found: String },
    #[error("line {line}: `window` needs two real values, the lower first, or `auto`, not {found:?}")]
    Window { line: usize, found: String },
    #[error("line {line}: `{key}` was given before on line {first}; give it once, above the points")]
    Misplaced { line: usize, key: &'static str, first: usize },
    #[error("line {line}: a point is `value red green blue opacity`, five numbers, but this has {count}")]
    Count { line: usize, count: usize },
    #[error("line {line}: {word:?} is not a finite number")]
    Number { line: usize, word: String },
    #[error("line {line}: the {what} is {value}, but must be between 0 and 1")]
    Range { line: usize, what: &'static str, value: f64 },
    #[error("line {line}: the value {value} lies outside the window {lo} to {hi}")]
    Outside { line: usize, value: f64, lo: f64, hi: f64 },
    #[error("line {line}: the value is smaller than the one before; points must ascend")]
    Unsorted { line: usize },
    #[error("there is no point; at least one line `value red green blue opacity` is needed")]
    Empty,
    #[error("there are more than {0} points, which is the most that is read")]
    TooMany(usize),
    #[error(
        "line {line}: a region is `region`, lower and upper value, lower and upper steepness, foot, softness, opacity and, if it has one, red green blue, but this has {count} numbers"
    )]
    RegionCount { line: usize, count: usize },
    #[error("line {line}: the lower {what} of the region must be below the upper")]
    RegionOrder { line: usize, what: &'static str },
    #[error("there are more than {MOST_REGIONS} regions, which is the most that is read")]
    TooManyRegions,
    #[error("the name {0:?} cannot be written; it must be one line of text without spaces at its ends")]
    Name(String),
}

impl Window {
    /// The window in real values for a volume whose values span `range`; always finite with the first below the second.
    pub fn resolve(&self, range: [f64; 2]) -> [f64; 2] {
        let [lo, hi] = match *self {
            Self::Auto => range,
            Self::Values { lo, hi } => [lo, hi],
        };
        let lo = if lo.is_finite() { lo } else { 0.0 };
        if hi.is_finite() && hi > lo && (hi - lo).is_finite() {
            return [lo, hi];
        }
        // a constant or unusable range: one unit up, or a step that the number can show
        let lo = lo.clamp(-1e300, 1e300);
        [lo, lo + (lo.abs() * 1e-6).max(1.0)]
    }
}

impl TransferFunction {
    /// The window in real values; see [`Window::resolve`].
    pub fn resolve(&self, range: [f64; 2]) -> [f64; 2] {
        self.window.resolve(range)
    }

    /// Checks what [`TransferFunction::classify`] and the text form rely on: a writable name, a finite ascending window, at
    /// least one point, points ascending, everything finite and within 0 to 1, regions not empty. Point and region i count as
    /// line i + 1.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn check(&self) -> Result<(), TransferError> {
        if self.name.trim() != self.name || self.name.chars().any(char::is_control) {
            return Err(TransferError::Name(self.name.clone()));
        }
        if let Window::Values { lo, hi } = self.window
            && !(lo.is_finite() && hi.is_finite() && lo < hi && (hi - lo).is_finite())
        {
            return Err(TransferError::Window { line: 0, found: format!("{lo} {hi}") });
        }
        if self.points.is_empty() {
            return Err(TransferError::Empty);
        }
        if self.points.len() > text::MOST_POINTS {
            return Err(TransferError::TooMany(text::MOST_POINTS));
        }
        let mut before = 0.0;
        for (i, p) in self.points.iter().enumerate() {
            let line = i + 1;
            let parts = [("position", p.at), ("red", p.color[0]), ("green", p.color[1]), ("blue", p.color[2])];
            for (what, x) in parts.into_iter().chain([("opacity", p.opacity)]) {
                check_part(line, what, x)?;
            }
            if p.at < before {
                return Err(TransferError::Unsorted { line });
            }
            before = p.at;
        }
        if self.regions.len() > MOST_REGIONS {
            return Err(TransferError::TooManyRegions);
        }
        (1..).zip(&self.regions).try_for_each(|(line, region)| region.check(line))
    }

    /// Linear-light colour and opacity at `s` in the window (clamped to `[0,1]`). Colours are mixed as sRGB, then linearised.
    pub fn classify(&self, s: f32) -> [f32; 4] {
        if self.points.is_empty() {
            return [0.0; 4];
        }
        let s = s.clamp(0.0, 1.0);
        let after = self.points.partition_point(|p| p.at <= s);
        let (a, b) = (&self.points[after.saturating_sub(1)], &self.points[after.min(self.points.len() - 1)]);
        let t = if b.at > a.at { ((s - a.at) / (b.at - a.at)).clamp(0.0, 1.0) } else { 0.0 };
        let mix = |x: f32, y: f32| x + t * (y - x);
        let c: [f32; 3] = std::array::from_fn(|i| linear_from_srgb(mix(a.color[i], b.color[i])));
        [c[0], c[1], c[2], mix(a.opacity, b.opacity)]
    }
}

/// A number that must be between 0 and 1.
fn check_part(line: usize, what: &'static str, x: f32) -> Result<(), TransferError> {
    // a negative zero would not survive being written as a real value
    if (0.0..=1.0).contains(&x) && !x.is_sign_negative() {
        return Ok(());
    }
    Err(TransferError::Range { line, what, value: f64::from(x) })
}

/// The sRGB transfer curve, decoded.
pub fn linear_from_srgb(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB transfer curve, encoded.
pub fn srgb_from_linear(v: f32) -> f32 {
    if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

//! The readable text form.
//!
//! ```text
//! voxclay transfer function 1
//! name bone
//! window -200 1800
//! # value  red green blue (sRGB, 0 to 1)  opacity of one voxel
//! -200  0.8 0.5 0.4  0.0
//! ```
//!
//! Below the points there may be regions, if opacity goes by value and steepness: values at the upper edge, steepness in parts
//! of the window per voxel, the lower edge's width in parts of the upper one's, softness, opacity and, if it has one, a colour.
//!
//! ```text
//! region 200 900  0.02 1  0.5 0.4  0.3  1 0.9 0.8
//! ```
//!
//! `window auto` stands for the volume's own range; values are then fractions of it, 0 to 1. A value may always be given as
//! a fraction of the window, `@0.25`; the writer does so only where no decimal names the same position exactly.

use std::fmt;

use super::{ControlPoint, MOST_REGIONS, Region, TransferError, TransferFunction, Window};

const HEADER: &str = "voxclay transfer function 1";

/// More points than any editor makes; bounds what a file can cost.
pub const MOST_POINTS: usize = 4096;

fn finite(word: &str, line: usize) -> Result<f64, TransferError> {
    word.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| TransferError::Number { line, word: clip(word) })
}

/// Keeps messages short whatever the file holds.
fn clip(s: &str) -> String {
    let mut out: String = s.chars().take(60).collect();
    if out.len() < s.len() {
        out.push_str("...");
    }
    out
}

fn fraction(word: &str, line: usize, what: &'static str) -> Result<f32, TransferError> {
    let value = finite(word, line)?;
    if !(0.0..=1.0).contains(&value) {
        return Err(TransferError::Range { line, what, value });
    }
    // adding zero turns -0 into 0
    Ok(value as f32 + 0.0)
}

/// Position in the window of a real value.
fn position(value: f64, [lo, hi]: [f64; 2]) -> f32 {
    ((value - lo) / (hi - lo)) as f32 + 0.0
}

impl TransferFunction {
    /// Reads the text form.
    ///
    /// # Errors
    /// With the line, what is wrong with it and what would be right.
    pub fn parse(text: &str) -> Result<Self, TransferError> {
        let mut lines = text
            .trim_start_matches('\u{feff}')
            .lines()
            .enumerate()
            .map(|(i, l)| (i + 1, l.trim()))
            .filter(|(_, l)| !l.is_empty() && !l.starts_with('#'));
        match lines.next() {
            Some((_, l)) if l.split_whitespace().eq(HEADER.split_whitespace()) => {}
            Some((line, l)) => return Err(TransferError::Header { line, found: clip(l) }),
            None => return Err(TransferError::Header { line: 1, found: String::new() }),
        }
        let (mut name, mut window) = (None, None);
        let within = |window: Option<(Window, usize)>| window.map_or(Window::Auto, |(w, _)| w).resolve([0.0, 1.0]);
        let mut points: Vec<ControlPoint> = Vec::new();
        let mut regions: Vec<Region> = Vec::new();
        let mut first_point = None;
        for (line, l) in lines {
            let (key, rest) = l.split_once(char::is_whitespace).map_or((l, ""), |(k, r)| (k, r.trim()));
            match key {
                "name" => {
                    if let Some((_, first)) = name {
                        return Err(TransferError::Misplaced { line, key: "name", first });
                    }
                    name = Some((rest.to_owned(), line));
                }
                "window" => {
                    if let Some((_, first)) = window {
                        return Err(TransferError::Misplaced { line, key: "window", first });
                    }
                    if let Some(first) = first_point {
                        return Err(TransferError::Misplaced { line, key: "window", first });
                    }
                    window = Some((parse_window(rest, line)?, line));
                }
                "region" => {
                    if regions.len() == MOST_REGIONS {
                        return Err(TransferError::TooManyRegions);
                    }
                    regions.push(parse_region(rest, line, within(window))?);
                    first_point.get_or_insert(line);
                }
                _ => {
                    if points.len() == MOST_POINTS {
                        return Err(TransferError::TooMany(MOST_POINTS));
                    }
                    let p = parse_point(l, line, within(window))?;
                    if points.last().is_some_and(|q| q.at > p.at) {
                        return Err(TransferError::Unsorted { line });
                    }
                    first_point.get_or_insert(line);
                    points.push(p);
                }
            }
        }
        let name = name.map(|(n, _)| n).unwrap_or_default();
        let out = Self { name, window: window.map_or(Window::Auto, |(w, _)| w), points, regions };
        out.check()?;
        Ok(out)
    }
}

fn parse_window(rest: &str, line: usize) -> Result<Window, TransferError> {
    if rest == "auto" {
        return Ok(Window::Auto);
    }
    let wrong = || TransferError::Window { line, found: clip(rest) };
    let words: Vec<&str> = rest.split_whitespace().take(3).collect();
    let &[lo, hi] = words.as_slice() else { return Err(wrong()) };
    let (lo, hi) = (finite(lo, line)?, finite(hi, line)?);
    if lo < hi && (hi - lo).is_finite() { Ok(Window::Values { lo, hi }) } else { Err(wrong()) }
}

/// A real value, or a fraction of the window, as a position in the window.
fn parse_value(word: &str, line: usize, window: [f64; 2]) -> Result<f32, TransferError> {
    if let Some(part) = word.strip_prefix('@') {
        return fraction(part, line, "position");
    }
    let value = finite(word, line)?;
    let [lo, hi] = window;
    if !(lo..=hi).contains(&value) {
        return Err(TransferError::Outside { line, value, lo, hi });
    }
    Ok(position(value, window).clamp(0.0, 1.0))
}

fn parse_region(rest: &str, line: usize, window: [f64; 2]) -> Result<Region, TransferError> {
    let words: Vec<&str> = rest.split_whitespace().take(11).collect();
    let part = |i: usize, what| fraction(words[i], line, what);
    if !matches!(words.len(), 7 | 10) {
        return Err(TransferError::RegionCount { line, count: rest.split_whitespace().count() });
    }
    let region = Region {
        value: [parse_value(words[0], line, window)?, parse_value(words[1], line, window)?],
        steepness: [part(2, "lower steepness")?, part(3, "upper steepness")?],
        foot: part(4, "foot")?,
        soft: part(5, "softness")?,
        opacity: part(6, "opacity")?,
        color: if words.len() == 10 { Some([part(7, "red")?, part(8, "green")?, part(9, "blue")?]) } else { None },
    };
    region.check(line)?;
    Ok(region)
}

fn parse_point(l: &str, line: usize, window: [f64; 2]) -> Result<ControlPoint, TransferError> {
    let words: Vec<&str> = l.split_whitespace().take(6).collect();
    let &[at, r, g, b, opacity] = words.as_slice() else {
        return Err(TransferError::Count { line, count: l.split_whitespace().count() });
    };
    let at = parse_value(at, line, window)?;
    let color = [fraction(r, line, "red")?, fraction(g, line, "green")?, fraction(b, line, "blue")?];
    Ok(ControlPoint { at, color, opacity: fraction(opacity, line, "opacity")? })
}

/// The shortest decimal that names position `at` of the window exactly, if there is one.
fn value_name(at: f32, [lo, hi]: [f64; 2]) -> Option<String> {
    let exact = lo + f64::from(at) * (hi - lo);
    let size = exact.abs().max(hi - lo).log10().ceil() as i32;
    (0..18)
        .map(|digits| {
            let places = (digits - size).clamp(0, 17) as usize;
            let s = format!("{exact:.places$}");
            // "-0" and trailing zeros are noise
            let s = if s.contains('.') { s.trim_end_matches('0').trim_end_matches('.') } else { &s };
            if s == "-0" { "0".to_owned() } else { s.to_owned() }
        })
        .find(|s| s.parse::<f64>().is_ok_and(|v| (lo..=hi).contains(&v) && position(v, [lo, hi]) == at))
}

/// The text form; [`TransferFunction::parse`] gives back exactly this function if [`TransferFunction::check`] passes.
impl fmt::Display for TransferFunction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{HEADER}")?;
        if !self.name.is_empty() {
            writeln!(f, "name {}", self.name)?;
        }
        match self.window {
            Window::Auto => writeln!(f, "window auto")?,
            Window::Values { lo, hi } => writeln!(f, "window {lo} {hi}")?,
        }
        writeln!(f, "# value  red green blue (sRGB, 0 to 1)  opacity of one voxel")?;
        let window = self.window.resolve([0.0, 1.0]);
        let value = |at: f32| value_name(at, window).unwrap_or_else(|| format!("@{at}"));
        for p in &self.points {
            let at = value(p.at);
            let [r, g, b] = p.color;
            writeln!(f, "{at}  {r} {g} {b}  {}", p.opacity)?;
        }
        if !self.regions.is_empty() {
            writeln!(f, "# region  values  steepness  foot softness  opacity  red green blue")?;
        }
        for region in &self.regions {
            let ([lo, hi], [from, to]) = (region.value.map(value), region.steepness);
            let Region { foot, soft, opacity, .. } = region;
            write!(f, "region {lo} {hi}  {from} {to}  {foot} {soft}  {opacity}")?;
            match region.color {
                Some([r, g, b]) => writeln!(f, "  {r} {g} {b}")?,
                None => writeln!(f)?,
            }
        }
        Ok(())
    }
}

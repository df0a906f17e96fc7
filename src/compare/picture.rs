//! Where two pictures differ, as a picture in colours with a drawn scale.
//!
//! The scale is logarithmic, `log(1 + d)`: one step of 255 is seen beside a difference of a hundred, and no difference is
//! black. Pictures that are to be compared with each other are drawn with one scale.

use super::colormap::inferno;
use super::{CompareError, Difference, difference, digits};

/// Compares the colours (not the alphas) of two pictures of one size, rows top down.
///
/// # Errors
/// If the pixels do not fill the size.
pub fn pictures(a: &[[u8; 4]], b: &[[u8; 4]], [width, height]: [u32; 2]) -> Result<Difference, CompareError> {
    let colors = |p: &[[u8; 4]]| -> Vec<u8> { p.iter().flat_map(|p| [p[0], p[1], p[2]]).collect() };
    difference(&colors(a), &colors(b), [width as usize, height as usize, 1], 3, 255.0)
}

/// The largest difference of any colour channel at each pixel, in steps of 255.
#[derive(Debug, Clone, PartialEq)]
pub struct DifferenceMap {
    pub width: u32,
    pub height: u32,
    /// Rows top down.
    pub values: Vec<u8>,
}

impl DifferenceMap {
    /// Of two pictures of one size.
    ///
    /// # Errors
    /// If the pixels do not fill the size.
    pub fn new(a: &[[u8; 4]], b: &[[u8; 4]], [width, height]: [u32; 2]) -> Result<Self, CompareError> {
        if a.len() != b.len() {
            return Err(CompareError::Size(a.len(), b.len()));
        }
        let dims = [width as usize, height as usize, 1];
        if dims[0].checked_mul(dims[1]) != Some(a.len()) || a.is_empty() {
            return Err(CompareError::Shape { samples: a.len(), dims, channels: 1 });
        }
        let largest = |(a, b): (&[u8; 4], &[u8; 4])| (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap_or(0);
        Ok(Self { width, height, values: a.iter().zip(b).map(largest).collect() })
    }

    pub fn max(&self) -> u8 {
        self.values.iter().copied().max().unwrap_or(0)
    }

    /// The differences in colours, below them the scale with its numbers: width, height and opaque sRGB pixels.
    pub fn drawn(&self, scale: Scale) -> (u32, u32, Vec<[u8; 4]>) {
        let mut pixels: Vec<[u8; 4]> = self.values.iter().map(|v| scale.color(*v)).collect();
        let strip = Strip::new(self.width as usize, scale);
        let height = strip.height();
        pixels.extend(strip.pixels());
        (self.width, self.height + height as u32, pixels)
    }
}

/// The range of differences that the colours stand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scale {
    /// Powers of two up to the top; the top is 2^n - 1.
    powers: u32,
}

impl Scale {
    /// The smallest that holds a difference; at least up to 7, so that one step of 255 never looks like much.
    pub fn reaching(max: u8) -> Self {
        Self { powers: (u8::BITS - max.leading_zeros()).max(3) }
    }

    /// The largest difference on the scale.
    pub fn top(self) -> u8 {
        ((1u32 << self.powers) - 1) as u8
    }

    /// Differences with a number on the scale, and their places in 0..=1.
    pub fn ticks(self) -> impl Iterator<Item = (u8, f64)> {
        (0..=self.powers).map(move |p| (((1u32 << p) - 1) as u8, f64::from(p) / f64::from(self.powers)))
    }

    /// Where a difference lies, in 0..=1.
    pub fn place(self, v: f64) -> f64 {
        (1.0 + v).log2() / f64::from(self.powers)
    }

    /// The colour of a difference.
    pub fn color(self, v: u8) -> [u8; 4] {
        let [r, g, b] = inferno(self.place(v.into()));
        [r, g, b, 255]
    }
}

/// sRGB of the ground and the numbers.
const GROUND: [u8; 4] = [0x17, 0x19, 0x1c, 255];
const INK: [u8; 4] = [0xd9, 0xdc, 0xdf, 255];

/// The scale below a picture.
struct Strip {
    scale: Scale,
    width: usize,
    /// Pixels of a dot.
    dot: usize,
}

impl Strip {
    fn new(width: usize, scale: Scale) -> Self {
        Self { scale, width, dot: (width / 320).max(1) }
    }

    fn height(&self) -> usize {
        (8 + 8 + 3 + 3 + digits::HEIGHT + 6) * self.dot
    }

    /// Gap, bar, ticks, numbers, gap.
    fn pixels(&self) -> Vec<[u8; 4]> {
        let Self { scale, width, dot } = *self;
        let mut pixels = vec![GROUND; width * self.height()];
        let mut set = |x: usize, y: usize, color: [u8; 4]| {
            if x < width {
                pixels[y * width + x] = color;
            }
        };
        let texts: Vec<(String, f64)> = scale
            .ticks()
            .map(|(v, place)| (if v == scale.top() { format!("{v}/255") } else { v.to_string() }, place))
            .collect();
        let half = |text: &str| digits::width(text) * dot / 2;
        let (left, right) = (8 * dot, half(&texts[texts.len() - 1].0) + 4 * dot);
        let length = width.saturating_sub(left + right).max(1);
        for x in 0..length {
            let [r, g, b] = inferno(x as f64 / (length - 1).max(1) as f64);
            (8 * dot..16 * dot).for_each(|y| set(left + x, y, [r, g, b, 255]));
        }
        let mut free = 0;
        for (text, place) in &texts {
            let at = left + (place * (length - 1) as f64).round() as usize;
            (17 * dot..19 * dot).for_each(|y| (0..dot).for_each(|x| set(at + x, y, INK)));
            let from = at.saturating_sub(half(text));
            // in a narrow picture not every number has room
            if from < free {
                continue;
            }
            free = from + (digits::width(text) + 3) * dot;
            digits::draw(text, |x, y| {
                for sub in 0..dot * dot {
                    set(from + x * dot + sub % dot, (22 + y) * dot + sub / dot, INK);
                }
            });
        }
        pixels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_those_of_the_colours() {
        let a = vec![[10, 20, 30, 255]; 12];
        let mut b = a.clone();
        b[5] = [12, 13, 30, 0];
        let map = DifferenceMap::new(&a, &b, [4, 3]).unwrap();
        assert_eq!((map.max(), map.values[5], map.values.iter().filter(|v| **v > 0).count()), (7, 7, 1));
        let d = pictures(&a, &b, [4, 3]).unwrap();
        assert!((d.rmse - ((4.0f64 + 49.0) / 36.0).sqrt()).abs() < 1e-12 && d.max == 7.0);
        assert!(DifferenceMap::new(&a, &b[..6], [4, 3]).is_err());
        assert!(DifferenceMap::new(&a, &b, [5, 3]).is_err() && pictures(&a, &b, [5, 3]).is_err());
    }

    #[test]
    fn scales_hold_what_they_reach() {
        for (max, top) in [(0, 7), (7, 7), (8, 15), (100, 127), (128, 255), (255, 255)] {
            let scale = Scale::reaching(max);
            assert_eq!(scale.top(), top);
            assert!(scale.place(max.into()) <= 1.0 && scale.place(0.0) == 0.0);
            assert!(scale.ticks().all(|(v, place)| (scale.place(v.into()) - place).abs() < 1e-12));
        }
    }

    #[test]
    fn the_scale_is_drawn_below_the_picture() {
        for width in [1u32, 40, 300, 900] {
            let map = DifferenceMap { width, height: 2, values: vec![0; 2 * width as usize] };
            let (w, h, pixels) = map.drawn(Scale::reaching(200));
            assert_eq!((w, pixels.len()), (width, (w * h) as usize));
            assert_eq!(pixels[0], [0, 0, 4, 255]);
            let strip = &pixels[2 * width as usize..];
            if width > 100 {
                // both ends of the colours, and numbers
                for color in [[0, 0, 4, 255], [252, 255, 164, 255], INK] {
                    assert!(strip.contains(&color), "{color:?} at {width}");
                }
            }
        }
    }
}

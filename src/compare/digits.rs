//! Numbers drawn into pictures: digits of 5 x 7 dots.

/// Rows from the top, the leftmost dot in bit 4: 0 to 9, then `/`.
const GLYPHS: [[u8; 7]; 11] = [
    [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110],
    [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
    [0b01110, 0b10001, 0b00001, 0b00010, 0b00100, 0b01000, 0b11111],
    [0b11111, 0b00010, 0b00100, 0b00010, 0b00001, 0b10001, 0b01110],
    [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010],
    [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110],
    [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110],
    [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000],
    [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110],
    [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100],
    [0b00001, 0b00001, 0b00010, 0b00100, 0b01000, 0b10000, 0b10000],
];

/// Dots from one glyph to the next.
const ADVANCE: usize = 6;
/// Height of a glyph in dots.
pub(super) const HEIGHT: usize = 7;

/// Width of a text in dots.
pub(super) fn width(text: &str) -> usize {
    (text.len() * ADVANCE).saturating_sub(1)
}

/// Calls `dot(x, y)` for every dot of a text, from its upper left. Only digits and `/` have dots.
pub(super) fn draw(text: &str, mut dot: impl FnMut(usize, usize)) {
    for (place, c) in text.chars().enumerate() {
        let glyph = match c {
            '/' => GLYPHS[10],
            _ => c.to_digit(10).map_or([0; 7], |d| GLYPHS[d as usize]),
        };
        for (y, row) in glyph.iter().enumerate() {
            for x in (0..5).filter(|x| row >> (4 - x) & 1 == 1) {
                dot(place * ADVANCE + x, y);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_digit_has_its_own_dots_within_its_width() {
        let dots = |text: &str| {
            let mut dots = Vec::new();
            draw(text, |x, y| dots.push((x, y)));
            dots
        };
        let all: Vec<_> = "0123456789/".chars().map(|c| dots(&c.to_string())).collect();
        for (i, a) in all.iter().enumerate() {
            assert!(a.len() > 5 && all[..i].iter().all(|b| b != a), "{i}");
        }
        let text = "255/255";
        assert!(dots(text).iter().all(|(x, y)| *x < width(text) && *y < HEIGHT));
        assert!(dots("x").is_empty() && width("") == 0);
    }
}

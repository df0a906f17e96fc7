//! Colours for numbers.
//!
//! Inferno (van der Walt and Smith, matplotlib, CC0): from black over purple and orange to a pale yellow, of a lightness
//! that rises evenly, so that equal steps of a number look like equal steps, also in grey and to the colour-blind.

/// sRGB at 0, 1/17, ..., 1.
const INFERNO: [[u8; 3]; 18] = [
    [0, 0, 4],
    [10, 7, 34],
    [30, 12, 69],
    [56, 9, 98],
    [81, 14, 108],
    [105, 22, 110],
    [128, 31, 108],
    [152, 39, 102],
    [176, 49, 91],
    [198, 61, 77],
    [217, 77, 61],
    [233, 97, 43],
    [244, 121, 24],
    [250, 148, 7],
    [252, 176, 20],
    [248, 205, 55],
    [242, 234, 105],
    [252, 255, 164],
];

/// The sRGB colour of a number in 0..=1 (what lies outside gets the nearest end, NaN the lowest).
pub fn inferno(t: f64) -> [u8; 3] {
    let last = INFERNO.len() - 1;
    // false for NaN
    let within = if t > 0.0 { t.min(1.0) } else { 0.0 };
    let at = within * last as f64;
    let i = (at as usize).min(last - 1);
    let part = at - i as f64;
    std::array::from_fn(|c| {
        let (a, b) = (f64::from(INFERNO[i][c]), f64::from(INFERNO[i + 1][c]));
        (a + part * (b - a)).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lightness_rises() {
        let light = |t: f64| {
            let [r, g, b] = inferno(t).map(|v| (f64::from(v) / 255.0).powf(2.2));
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        for i in 0..100 {
            assert!(light(f64::from(i + 1) / 100.0) > light(f64::from(i) / 100.0), "{i}");
        }
    }

    #[test]
    fn values_of_the_published_table_are_met() {
        // entries 64, 128 and 200 of 0..=255
        for (i, want) in [(64, [87, 16, 110]), (128, [188, 55, 84]), (200, [251, 157, 7])] {
            let got = inferno(f64::from(i) / 255.0);
            assert!((0..3).all(|c| got[c].abs_diff(want[c]) <= 3), "{i}: {got:?}");
        }
        assert_eq!((inferno(f64::NAN), inferno(-2.0), inferno(9.0)), ([0, 0, 4], [0, 0, 4], [252, 255, 164]));
    }
}

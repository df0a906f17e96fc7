//! Colours for numbers.
//!
//! Inferno (van der Walt and Smith, matplotlib, CC0): from black over purple and orange to a pale yellow, of a lightness
//! that rises evenly, so that equal steps of a number look like equal steps, also in grey and to the colour-blind.

use crate::volume::transfer::srgb_from_linear;

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

/// The sRGB colour of a number in -1..=1 about a middle: from blue over a pale grey to orange.
///
/// Straight lines in Oklab (Ottosson 2020) from two ends of equal lightness and chroma to the middle, so that equal steps look
/// equal, and as far to either side. What lies outside gets the nearest end, NaN the middle.
pub fn diverging(t: f64) -> [u8; 3] {
    let t = if t.is_nan() { 0.0 } else { t.clamp(-1.0, 1.0) };
    let hue = (if t < 0.0 { BLUE } else { ORANGE }).to_radians();
    let lightness = MIDDLE + (END - MIDDLE) * t.abs();
    let (a, b) = (CHROMA * t.abs() * hue.cos(), CHROMA * t.abs() * hue.sin());
    from_oklab([lightness, a, b])
}

const MIDDLE: f64 = 0.93;
const END: f64 = 0.60;
const CHROMA: f64 = 0.15;
const BLUE: f64 = 255.0;
const ORANGE: f64 = 52.0;

/// sRGB of an Oklab colour; what cannot be shown is cut off.
fn from_oklab([l, a, b]: [f64; 3]) -> [u8; 3] {
    let long = (l + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let medium = (l - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let short = (l - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
    let linear = [
        4.076_741_662_1 * long - 3.307_711_591_3 * medium + 0.230_969_929_2 * short,
        -1.268_438_004_6 * long + 2.609_757_401_1 * medium - 0.341_319_396_5 * short,
        -0.004_196_086_3 * long - 0.703_418_614_7 * medium + 1.707_614_701_0 * short,
    ];
    linear.map(|v| (srgb_from_linear(v.clamp(0.0, 1.0) as f32) * 255.0).round() as u8)
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
            assert!((0..3).all(|c| got[c].abs_diff(want[c]) <= 4), "{i}: {got:?}");
        }
        assert_eq!((inferno(f64::NAN), inferno(-2.0), inferno(9.0)), ([0, 0, 4], [0, 0, 4], [252, 255, 164]));
    }

    #[test]
    fn both_sides_are_alike_and_nothing_is_cut_off() {
        // known colours of Oklab: white, and the red of sRGB
        assert_eq!(from_oklab([1.0, 0.0, 0.0]), [255, 255, 255]);
        let red = from_oklab([0.627_955, 0.224_863, 0.125_846]);
        assert!(red[0] >= 254 && red[1] <= 2 && red[2] <= 2, "{red:?}");
        let [r, g, b] = diverging(0.0);
        assert!(r.abs_diff(g) <= 1 && g.abs_diff(b) <= 1);
        let light = |c: [u8; 3]| {
            let [r, g, b] = c.map(|v| (f64::from(v) / 255.0).powf(2.2));
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        for i in 1..=20 {
            let t = f64::from(i) / 20.0;
            let before = t - 0.05;
            for side in [-1.0, 1.0] {
                assert!(light(diverging(side * t)) < light(diverging(side * before)), "{t}");
            }
            assert!((light(diverging(t)) - light(diverging(-t))).abs() < 0.08, "{t}");
            // no channel reaches an end, where steps would be lost
            assert!([diverging(t), diverging(-t)].as_flattened().iter().all(|v| (1..255).contains(v)), "{t}");
        }
        assert_eq!((diverging(f64::NAN), diverging(7.0)), (diverging(0.0), diverging(1.0)));
    }
}

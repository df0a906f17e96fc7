//! Coarse pictures made smooth before they are stretched over the view.

use eframe::egui::{Color32, ColorImage};

/// Weights, in 32ths, of the quadratic B-spline a quarter of a pixel from the middle: far side, middle, near side.
const WEIGHTS: [u32; 3] = [1, 22, 9];

/// A picture of twice the size, by quadratic B-splines: no steps at edges, where stretching by straight lines leaves them.
pub fn doubled(image: &ColorImage) -> ColorImage {
    let [w, h] = image.size;
    if w == 0 || h == 0 {
        return image.clone();
    }
    let mix = |a: Color32, b: Color32, c: Color32| {
        let (a, b, c) = (a.to_array(), b.to_array(), c.to_array());
        let [x, y, z, t] = std::array::from_fn(|i| {
            let sum = WEIGHTS[0] * u32::from(a[i]) + WEIGHTS[1] * u32::from(b[i]) + WEIGHTS[2] * u32::from(c[i]);
            ((sum + 16) / 32) as u8
        });
        Color32::from_rgba_premultiplied(x, y, z, t)
    };
    // along rows, then along columns
    let mut wide = Vec::with_capacity(2 * w * h);
    for row in image.pixels.chunks_exact(w) {
        for x in 0..w {
            let (left, right) = (row[x.saturating_sub(1)], row[(x + 1).min(w - 1)]);
            wide.push(mix(right, row[x], left));
            wide.push(mix(left, row[x], right));
        }
    }
    let row = |y: usize| &wide[2 * w * y..2 * w * (y + 1)];
    let mut pixels = Vec::with_capacity(4 * w * h);
    for y in 0..h {
        let (above, here, below) = (row(y.saturating_sub(1)), row(y), row((y + 1).min(h - 1)));
        for (first, last) in [(below, above), (above, below)] {
            pixels.extend((0..2 * w).map(|x| mix(first[x], here[x], last[x])));
        }
    }
    ColorImage::new([2 * w, 2 * h], pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_pictures_stay_and_ramps_stay_ramps() {
        let plain = ColorImage::filled([5, 3], Color32::from_rgb(90, 7, 200));
        assert!(doubled(&plain).pixels.iter().all(|p| *p == Color32::from_rgb(90, 7, 200)));
        let ramp = |i: usize| Color32::from_gray((16 * i) as u8);
        let image = ColorImage::new([8, 4], (0..32).map(|i| ramp(i % 8)).collect());
        let fine = doubled(&image);
        assert_eq!(fine.size, [16, 8]);
        // quarters of a step to either side of each pixel's middle, but at the borders
        for x in 2..14 {
            let want = 8.0 * (x as f32 - 0.5);
            assert!((f32::from(fine.pixels[3 * 16 + x].r()) - want).abs() <= 1.0, "{x}");
        }
        // columns as rows
        let turned = ColorImage::new([4, 8], (0..32).map(|i| ramp(i / 4)).collect());
        let fine = doubled(&turned);
        for y in 2..14 {
            assert!((f32::from(fine.pixels[y * 8 + 3].r()) - 8.0 * (y as f32 - 0.5)).abs() <= 1.0, "{y}");
        }
    }
}

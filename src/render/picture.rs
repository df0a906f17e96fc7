use std::sync::OnceLock;

use crate::volume::transfer::srgb_from_linear;

/// A finished picture: 8-bit sRGB RGBA, rows top down. Alpha is straight, not premultiplied.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    pub width: u32,
    pub height: u32,
    pub pixels: Vec<[u8; 4]>,
}

/// Why a picture could not be encoded.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    #[error("the picture could not be encoded as PNG: {0}")]
    Encoding(#[from] png::EncodingError),
}

impl Picture {
    /// A picture of one colour.
    pub fn filled(width: u32, height: u32, pixel: [u8; 4]) -> Self {
        Self { width, height, pixels: vec![pixel; width as usize * height as usize] }
    }

    /// Half the size, each pixel the mean of four (weighted by their opacity); an odd last row or column goes.
    pub fn halved(&self) -> Self {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let at = |x: u32, y: u32| {
            let (x, y) = (x.min(self.width.saturating_sub(1)), y.min(self.height.saturating_sub(1)));
            self.pixels[(y * self.width + x) as usize].map(u32::from)
        };
        let mean = |x: u32, y: u32| {
            let four = [at(2 * x, 2 * y), at(2 * x + 1, 2 * y), at(2 * x, 2 * y + 1), at(2 * x + 1, 2 * y + 1)];
            let opacity: u32 = four.iter().map(|p| p[3]).sum();
            let color = |c: usize| {
                let sum: u32 = four.iter().map(|p| p[c] * p[3]).sum();
                (sum + opacity / 2).checked_div(opacity).unwrap_or(0) as u8
            };
            [color(0), color(1), color(2), ((opacity + 2) / 4) as u8]
        };
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| mean(x, y)).collect();
        Self { width, height, pixels }
    }

    /// The picture as a PNG file: RGB if every pixel is opaque, else RGBA.
    ///
    /// # Errors
    /// If the picture has no pixels, or they do not fill its size.
    pub fn png(&self) -> Result<Vec<u8>, PictureError> {
        let opaque = self.pixels.iter().all(|p| p[3] == 255);
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width, self.height);
        encoder.set_color(if opaque { png::ColorType::Rgb } else { png::ColorType::Rgba });
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        if opaque {
            let rgb: Vec<u8> = self.pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
            writer.write_image_data(&rgb)?;
        } else {
            writer.write_image_data(self.pixels.as_flattened())?;
        }
        writer.finish()?;
        Ok(file)
    }
}

const CODES: usize = 1 << 16;

/// The 8-bit sRGB code of a linear value, clamped to 0..=1. By table: within 0.03 steps of the curve before rounding.
pub(super) fn srgb_code(v: f32) -> u8 {
    static TABLE: OnceLock<Vec<u8>> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        let code = |i: usize| (srgb_from_linear(i as f32 / (CODES - 1) as f32) * 255.0).round() as u8;
        (0..CODES).map(code).collect()
    });
    // `as` turns NaN and what is negative into 0
    table[((v * (CODES - 1) as f32 + 0.5) as usize).min(CODES - 1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_follow_the_curve() {
        for i in 0..=100_000 {
            let v = i as f32 / 100_000.0;
            let want = srgb_from_linear(v) * 255.0;
            assert!((f32::from(srgb_code(v)) - want).abs() < 0.54, "{v}");
        }
        assert_eq!((srgb_code(f32::NAN), srgb_code(-1.0), srgb_code(7.0)), (0, 0, 255));
    }

    #[test]
    fn png_reads_back() {
        for alpha in [255, 128] {
            let mut p = Picture::filled(3, 2, [10, 20, 30, 255]);
            p.pixels[4] = [200, 100, 50, alpha];
            let file = p.png().unwrap();
            let mut reader = png::Decoder::new(std::io::Cursor::new(&file)).read_info().unwrap();
            let mut data = vec![0; reader.output_buffer_size().unwrap()];
            let info = reader.next_frame(&mut data).unwrap();
            assert_eq!((info.width, info.height), (3, 2));
            let n = data.len() / 6;
            assert_eq!(data[4 * n..4 * n + n], [200, 100, 50, alpha][..n]);
        }
        assert!(Picture::filled(0, 5, [0; 4]).png().is_err());
        assert!(Picture { width: 2, height: 2, pixels: vec![[0; 4]; 3] }.png().is_err());
    }
}

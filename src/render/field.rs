use std::sync::Arc;

use crate::math::parallel;
use crate::volume::pyramid::Pyramid;
use crate::volume::{Grid, Samples, Scalar, Volume};
use crate::with_samples;

/// The scalar or RGBA field in the form that renderers sample.
#[derive(Debug, Clone)]
pub struct Field {
    pub grid: Grid,
    /// 1: scalar. 4: RGBA in sRGB, where A takes the place of the scalar and RGB the place of the table's colour.
    pub channels: usize,
    /// Texels, x fastest, channels interleaved.
    pub texels: Texels,
    /// Real value of a texel as the sampler returns it (u8 and u16 as 0..1): `real = texel * scale + offset`.
    pub scale: f64,
    pub offset: f64,
    /// Smallest and largest real value (of the alpha channel for RGBA).
    pub range: [f64; 2],
    /// Bounds of the blocks of the scalar (or alpha) channel, in stored values for u8 and u16, in texel values for f32.
    pub pyramid: Arc<Pyramid>,
}

/// Typed texels. `U8` and `U16` are normalised to 0..1 when sampled. Volumes of u8 and u16 are shared, not copied.
#[derive(Debug, Clone)]
pub enum Texels {
    /// A volume of 1 or 4 channels of u8 or u16.
    Shared(Arc<Volume>),
    F32(Arc<Vec<f32>>),
}

/// The texels as a typed slice.
#[derive(Debug, Clone, Copy)]
pub enum TexelSlice<'a> {
    U8(&'a [u8]),
    U16(&'a [u16]),
    F32(&'a [f32]),
}

impl Texels {
    pub fn slice(&self) -> TexelSlice<'_> {
        match self {
            Self::Shared(v) => match &v.samples {
                Samples::U8(t) => TexelSlice::U8(t),
                Samples::U16(t) => TexelSlice::U16(t),
                // `Field::from_volume` shares nothing else
                _ => TexelSlice::F32(&[]),
            },
            Self::F32(t) => TexelSlice::F32(t),
        }
    }
}

impl Field {
    /// Whether it is the very same field: texels in the same place in memory, and the same grid and scale. What is equal
    /// but in another place counts as different.
    pub fn same_as(&self, other: &Self) -> bool {
        let texels = match (&self.texels, &other.texels) {
            (Texels::Shared(a), Texels::Shared(b)) => Arc::ptr_eq(a, b),
            (Texels::F32(a), Texels::F32(b)) => Arc::ptr_eq(a, b),
            (Texels::Shared(_) | Texels::F32(_), _) => false,
        };
        let numbers = |f: &Self| (f.grid, f.channels, f.scale, f.offset, f.range);
        texels && numbers(self) == numbers(other)
    }

    /// Prepares a volume for rendering.
    ///
    /// - u8 and u16 with 1 or 4 channels are shared.
    /// - Every other scalar type becomes f32 in 0..1 between the smallest and largest stored value, so that a small range far
    ///   from zero keeps its precision; `scale` and `offset` lead back to real values.
    /// - 2 and 3 channels (vectors) become their length, from real components.
    /// - RGBA of other types: RGB is taken as 0..1 for floats and as 0..maximum of the type for integers, and clamped; A is
    ///   treated as a scalar.
    ///
    /// Samples that are not finite count as the smallest finite one.
    pub fn from_volume(volume: Arc<Volume>) -> Self {
        let grid = volume.grid;
        let rescale = volume.rescale;
        let channels = volume.channels;
        if matches!(channels, 1 | 4) {
            let shared = match &volume.samples {
                Samples::U8(t) => Some((Pyramid::build(grid.dims, t, channels, channels - 1), 255.0)),
                Samples::U16(t) => Some((Pyramid::build(grid.dims, t, channels, channels - 1), 65535.0)),
                _ => None,
            };
            if let Some((pyramid, one)) = shared {
                let range = pyramid.bounds().map(|v| rescale.real(f64::from(v)));
                return Self {
                    grid,
                    channels,
                    texels: Texels::Shared(volume),
                    scale: rescale.slope * one,
                    offset: rescale.intercept,
                    range: ordered(range),
                    pyramid: Arc::new(pyramid),
                };
            }
        }
        let (texels, lo, hi, channels) = match channels {
            1 => {
                let (t, lo, hi) = with_samples!(&volume.samples, v => normalised(v, 1, |c| c[0].to_f64()));
                (t, rescale.real(lo), rescale.real(hi), 1)
            }
            4 => {
                let (alpha, lo, hi) = with_samples!(&volume.samples, v => normalised(v, 4, |c| c[3].to_f64()));
                let rgba = with_samples!(&volume.samples, v => colors(v, &alpha));
                (rgba, rescale.real(lo), rescale.real(hi), 4)
            }
            _ => {
                let (t, lo, hi) = with_samples!(&volume.samples, v => normalised(v, channels, |c| {
                    c.iter().map(|x| rescale.real(x.to_f64())).fold(0.0, f64::hypot)
                }));
                (t, lo, hi, 1)
            }
        };
        let pyramid = Pyramid::build(grid.dims, &texels, channels, channels - 1);
        Self {
            grid,
            channels,
            texels: Texels::F32(Arc::new(texels)),
            scale: hi - lo,
            offset: lo,
            range: ordered([lo, hi]),
            pyramid: Arc::new(pyramid),
        }
    }

    /// Scale and bias from a texel, as the sampler returns it, to a window of real values: `s = clamp(texel * scale + bias, 0, 1)`.
    /// A window without width shows nothing: 0 everywhere.
    pub fn window(&self, [lo, hi]: [f64; 2]) -> [f32; 2] {
        let width = hi - lo;
        let (scale, bias) = ((self.scale / width) as f32, ((self.offset - lo) / width) as f32);
        if width > 0.0 && scale.is_finite() && bias.is_finite() { [scale, bias] } else { [0.0; 2] }
    }
}

fn ordered([a, b]: [f64; 2]) -> [f64; 2] {
    [a.min(b), a.max(b)]
}

/// Voxels of one parallel piece.
const PIECE: usize = 1 << 16;

/// One value for each voxel as 0..1 between the smallest and largest finite one, which are returned too.
fn normalised<T: Scalar>(v: &[T], channels: usize, value: impl Fn(&[T]) -> f64 + Sync) -> (Vec<f32>, f64, f64) {
    let count = v.len() / channels;
    let voxels = |piece: usize| {
        let part = piece * PIECE * channels..v.len().min((piece + 1) * PIECE * channels);
        v[part].chunks_exact(channels).map(&value)
    };
    let bounds = parallel::map(count.div_ceil(PIECE), &|piece| {
        let finite = voxels(piece).filter(|x| x.is_finite());
        finite.fold((f64::MAX, f64::MIN), |(lo, hi), x| (lo.min(x), hi.max(x)))
    });
    let (lo, hi) = bounds.into_iter().fold((f64::MAX, f64::MIN), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let mut texels = vec![0.0; count];
    if lo > hi {
        return (texels, 0.0, 0.0);
    }
    // halves, so that the width of a range over all of f64 stays finite
    let half = 0.5 * hi - 0.5 * lo;
    let unit = if half > 0.0 { 1.0 / half } else { 0.0 };
    parallel::chunks_mut(&mut texels, PIECE, &|piece, texels| {
        for (texel, x) in texels.iter_mut().zip(voxels(piece)) {
            *texel = if x.is_finite() { ((0.5 * x - 0.5 * lo) * unit) as f32 } else { 0.0 };
        }
    });
    (texels, lo, hi)
}

/// RGBA as 0..1, with the given alpha.
fn colors<T: Scalar>(v: &[T], alpha: &[f32]) -> Vec<f32> {
    let one = match T::TYPE {
        crate::volume::ScalarType::F32 | crate::volume::ScalarType::F64 => 1.0,
        _ => T::from_f64(f64::MAX).to_f64(),
    };
    let unit = |x: T| {
        let x = x.to_f64() / one;
        if x.is_finite() { x.clamp(0.0, 1.0) as f32 } else { 0.0 }
    };
    let mut texels = vec![0.0; v.len()];
    parallel::chunks_mut(&mut texels, 4 * PIECE, &|piece, texels| {
        let first = piece * PIECE;
        for ((texel, c), &a) in texels.chunks_exact_mut(4).zip(v[4 * first..].chunks_exact(4)).zip(&alpha[first..]) {
            texel.copy_from_slice(&[unit(c[0]), unit(c[1]), unit(c[2]), a]);
        }
    });
    texels
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::volume::Rescale;

    fn field(channels: usize, samples: Samples, rescale: Rescale) -> Field {
        let grid = Grid::aligned([samples.len() / channels, 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
        let mut v = Volume::new(grid, channels, samples);
        v.rescale = rescale;
        Field::from_volume(Arc::new(v))
    }

    fn texels(f: &Field) -> Vec<f64> {
        match f.texels.slice() {
            TexelSlice::U8(t) => t.iter().map(|&v| f64::from(v) / 255.0).collect(),
            TexelSlice::U16(t) => t.iter().map(|&v| f64::from(v) / 65535.0).collect(),
            TexelSlice::F32(t) => t.iter().map(|&v| f64::from(v)).collect(),
        }
    }

    #[test]
    fn texels_lead_back_to_real_values() {
        let rescale = Rescale { slope: -2.5, intercept: 10.0 };
        let stored = [3.0, 7.0, 100.0, 0.0];
        for t in crate::volume::ScalarType::ALL {
            fn make<T: Scalar>(v: &[f64]) -> Samples {
                T::wrap(v.iter().map(|&x| T::from_f64(x)).collect())
            }
            use crate::volume::ScalarType::{F32, F64, I8, I16, I32, U8, U16, U32};
            let samples = match t {
                U8 => make::<u8>(&stored),
                I8 => make::<i8>(&stored),
                U16 => make::<u16>(&stored),
                I16 => make::<i16>(&stored),
                U32 => make::<u32>(&stored),
                I32 => make::<i32>(&stored),
                F32 => make::<f32>(&stored),
                F64 => make::<f64>(&stored),
            };
            let f = field(1, samples, rescale);
            for (texel, v) in texels(&f).iter().zip(stored) {
                assert!((texel * f.scale + f.offset - rescale.real(v)).abs() < 1e-4, "{t:?}");
            }
            assert_eq!(f.range, [-240.0, 10.0], "{t:?}");
            let [a, b] = f.window([-240.0, 10.0]).map(f64::from);
            assert!((texels(&f)[2] * a + b).abs() < 1e-6 && (texels(&f)[3] * a + b - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn what_is_not_finite_is_the_smallest() {
        let f = field(1, Samples::F32(vec![f32::NAN, -4.0, 6.0, f32::INFINITY]), Rescale::default());
        assert_eq!((texels(&f), f.range), (vec![0.0, 0.0, 1.0, 0.0], [-4.0, 6.0]));
        let f = field(1, Samples::F64(vec![f64::NAN; 3]), Rescale::default());
        assert_eq!((texels(&f), f.range), (vec![0.0; 3], [0.0, 0.0]));
        let f = field(1, Samples::F64(vec![-1.7e308, 1.7e308, 0.0]), Rescale::default());
        assert_eq!(texels(&f), [0.0, 1.0, 0.5]);
        assert_eq!(f.window([3.0, 3.0]), [0.0, 0.0]);
    }

    #[test]
    fn vectors_are_lengths_and_colours_stay_colours() {
        let f = field(3, Samples::I16(vec![2, 3, 6, 0, 0, 0]), Rescale { slope: 2.0, intercept: 0.0 });
        assert_eq!((f.channels, texels(&f), f.range), (1, vec![1.0, 0.0], [0.0, 14.0]));
        let f = field(4, Samples::F32(vec![0.5, 2.0, -1.0, 8.0, 0.25, 1.0, 0.0, 4.0]), Rescale::default());
        assert_eq!((f.channels, f.range), (4, [4.0, 8.0]));
        assert_eq!(texels(&f), [0.5, 1.0, 0.0, 1.0, 0.25, 1.0, 0.0, 0.0]);
        let f = field(4, Samples::U8(vec![1, 2, 3, 51, 4, 5, 6, 255]), Rescale::default());
        assert!(matches!(f.texels, Texels::Shared(_)));
        assert_eq!(f.range, [51.0, 255.0]);
    }
}

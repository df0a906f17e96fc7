use rayon::prelude::*;

use super::Grid;

/// The type of a sample as stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScalarType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    F32,
    F64,
}

impl ScalarType {
    pub const ALL: [Self; 8] = [Self::U8, Self::I8, Self::U16, Self::I16, Self::U32, Self::I32, Self::F32, Self::F64];

    /// Bytes of one sample.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The short name used on the command line and in raw headers: `u8`, `i16`, `f32`, ...
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }
}

/// A type that samples are stored as.
pub trait Scalar: bytemuck::Pod + PartialOrd + Send + Sync + std::fmt::Debug + 'static {
    const TYPE: ScalarType;
    fn to_f64(self) -> f64;
    fn to_f32(self) -> f32;
    /// Rounds to nearest (halves away from zero) and clamps to the type's range; NaN becomes 0 for integers.
    fn from_f64(v: f64) -> Self;
    /// Wraps a vector of this type.
    fn wrap(v: Vec<Self>) -> Samples;
}

macro_rules! scalar {
    ($($t:ident $variant:ident $from:expr;)*) => {$(
        impl Scalar for $t {
            const TYPE: ScalarType = ScalarType::$variant;
            #[inline(always)]
            fn to_f64(self) -> f64 { self as f64 }
            #[inline(always)]
            fn to_f32(self) -> f32 { self as f32 }
            #[inline(always)]
            fn from_f64(v: f64) -> Self { $from(v) }
            fn wrap(v: Vec<Self>) -> Samples { Samples::$variant(v) }
        }
    )*};
}

// `as` saturates and maps NaN to 0, which is what the trait promises
scalar! {
    u8 U8 |v: f64| v.round() as u8;
    i8 I8 |v: f64| v.round() as i8;
    u16 U16 |v: f64| v.round() as u16;
    i16 I16 |v: f64| v.round() as i16;
    u32 U32 |v: f64| v.round() as u32;
    i32 I32 |v: f64| v.round() as i32;
    f32 F32 |v: f64| v as f32;
    f64 F64 |v: f64| v;
}

/// Samples of one of the eight types, x fastest, channels interleaved.
#[derive(Debug, Clone, PartialEq)]
pub enum Samples {
    U8(Vec<u8>),
    I8(Vec<i8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    U32(Vec<u32>),
    I32(Vec<i32>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Runs an expression with the typed vector behind a [`Samples`]: `with_samples!(&volume.samples, v => v.len())`.
#[macro_export]
macro_rules! with_samples {
    ($samples:expr, $v:ident => $body:expr) => {
        match $samples {
            $crate::volume::Samples::U8($v) => $body,
            $crate::volume::Samples::I8($v) => $body,
            $crate::volume::Samples::U16($v) => $body,
            $crate::volume::Samples::I16($v) => $body,
            $crate::volume::Samples::U32($v) => $body,
            $crate::volume::Samples::I32($v) => $body,
            $crate::volume::Samples::F32($v) => $body,
            $crate::volume::Samples::F64($v) => $body,
        }
    };
}

impl Samples {
    pub fn scalar_type(&self) -> ScalarType {
        fn of<T: Scalar>(_: &[T]) -> ScalarType {
            T::TYPE
        }
        with_samples!(self, v => of(v))
    }

    /// Number of samples (voxels times channels).
    pub fn len(&self) -> usize {
        with_samples!(self, v => v.len())
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The samples in memory order and native byte order.
    pub fn bytes(&self) -> &[u8] {
        with_samples!(self, v => bytemuck::cast_slice(v))
    }

    /// One sample as `f64`, as stored (no rescale). Slow: for tests and single look-ups.
    pub fn get(&self, index: usize) -> f64 {
        with_samples!(self, v => v[index].to_f64())
    }
}

/// The real value of a stored sample is `slope * stored + intercept` (NIfTI `scl_slope`, `scl_inter`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rescale {
    pub slope: f64,
    pub intercept: f64,
}

impl Default for Rescale {
    fn default() -> Self {
        Self { slope: 1.0, intercept: 0.0 }
    }
}

impl Rescale {
    #[inline]
    pub fn real(&self, stored: f64) -> f64 {
        self.slope * stored + self.intercept
    }

    #[inline]
    pub fn stored(&self, real: f64) -> f64 {
        (real - self.intercept) / self.slope
    }
}

/// A volume: samples on a grid. Scalar (1 channel), vector (2, 3) or RGBA (4).
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    pub grid: Grid,
    /// 1 to 4.
    pub channels: usize,
    pub samples: Samples,
    pub rescale: Rescale,
}

impl Volume {
    /// # Panics
    /// If the number of samples is not voxels times channels, or channels is not 1 to 4: callers check sizes first.
    pub fn new(grid: Grid, channels: usize, samples: Samples) -> Self {
        assert!((1..=4).contains(&channels), "channels must be 1 to 4");
        assert_eq!(samples.len(), grid.len() * channels, "samples do not fill the grid");
        Self { grid, channels, samples, rescale: Rescale::default() }
    }

    /// CRC-32 of size, type, channels and samples, to see whether a volume is the one that was meant. Where it lies does
    /// not matter.
    pub fn checksum(&self) -> u32 {
        let mut crc = flate2::Crc::new();
        crc.update(format!("{:?} {:?} {}", self.grid.dims, self.samples.scalar_type(), self.channels).as_bytes());
        // the checksum of a whole from those of its parts, so that all cores help
        let parts: Vec<flate2::Crc> = self
            .samples
            .bytes()
            .par_chunks(1 << 22)
            .map(|part| {
                let mut crc = flate2::Crc::new();
                crc.update(part);
                crc
            })
            .collect();
        parts.iter().for_each(|part| crc.combine(part));
        crc.sum()
    }

    /// Index of the first channel of voxel (i, j, k).
    #[inline]
    pub fn index(&self, i: usize, j: usize, k: usize) -> usize {
        ((k * self.grid.dims[1] + j) * self.grid.dims[0] + i) * self.channels
    }
}

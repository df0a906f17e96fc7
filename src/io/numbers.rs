//! Arrays of numbers of a type that only the file knows.

use glam::DVec3;

use super::bytes::ByteOrder;
use super::words::Words;
use crate::volume::Samples;

/// The types of numbers in VTK's files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// Runs an expression with the Rust type of a [`Kind`].
macro_rules! with_kind {
    ($kind:expr, $t:ident => $body:expr) => {{
        macro_rules! arm {
            ($rust:ty) => {{
                type $t = $rust;
                $body
            }};
        }
        match $kind {
            Kind::I8 => arm!(i8),
            Kind::U8 => arm!(u8),
            Kind::I16 => arm!(i16),
            Kind::U16 => arm!(u16),
            Kind::I32 => arm!(i32),
            Kind::U32 => arm!(u32),
            Kind::I64 => arm!(i64),
            Kind::U64 => arm!(u64),
            Kind::F32 => arm!(f32),
            Kind::F64 => arm!(f64),
        }
    }};
}

impl Kind {
    /// Bytes of one number.
    pub fn bytes(self) -> usize {
        with_kind!(self, T => size_of::<T>())
    }

    fn name(self) -> &'static str {
        with_kind!(self, T => std::any::type_name::<T>())
    }
}

/// Numbers of one type, in the machine's byte order.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Numbers {
    pub kind: Kind,
    bytes: Vec<u8>,
}

impl Numbers {
    /// Takes numbers as they lie in a file; bytes beyond the last whole number are dropped.
    pub fn from_bytes(kind: Kind, mut bytes: Vec<u8>, order: ByteOrder) -> Self {
        let size = kind.bytes();
        bytes.truncate(bytes.len() / size * size);
        if order != ByteOrder::NATIVE {
            // sizes that are known while compiling become single instructions
            match size {
                2 => bytes.as_chunks_mut::<2>().0.iter_mut().for_each(|b| b.reverse()),
                4 => bytes.as_chunks_mut::<4>().0.iter_mut().for_each(|b| b.reverse()),
                8 => bytes.as_chunks_mut::<8>().0.iter_mut().for_each(|b| b.reverse()),
                _ => {}
            }
        }
        Self { kind, bytes }
    }

    /// Reads `count` numbers, which must have been found to have room.
    pub fn from_words(kind: Kind, words: &mut Words, count: usize) -> Result<Self, String> {
        let mut bytes = Vec::with_capacity(count * kind.bytes());
        let what = if matches!(kind, Kind::F32 | Kind::F64) {
            "a number".to_owned()
        } else {
            format!("a whole number of type {}", kind.name())
        };
        with_kind!(kind, T => for _ in 0..count {
            bytes.extend_from_slice(&words.parse::<T>(&what)?.to_ne_bytes());
        });
        Ok(Self { kind, bytes })
    }

    pub fn len(&self) -> usize {
        self.bytes.len() / self.kind.bytes()
    }

    /// The numbers as they are, or rounded to 64-bit floating point.
    pub fn reals(&self) -> Vec<f64> {
        with_kind!(self.kind, T => self.typed::<T>().map(|x| x as f64).collect())
    }

    /// The numbers as they are, if all are whole and fit.
    pub fn whole(&self) -> Option<Vec<i64>> {
        match self.kind {
            Kind::F32 | Kind::F64 => {
                let fits = |x: f64| x.fract() == 0.0 && x.abs() < i64::MAX as f64;
                self.reals().into_iter().map(|x| fits(x).then_some(x as i64)).collect()
            }
            Kind::U64 => self.typed::<u64>().map(|x| i64::try_from(x).ok()).collect(),
            kind => with_kind!(kind, T => Some(self.typed::<T>().map(|x| x as i64).collect())),
        }
    }

    /// Three numbers each.
    pub fn points(&self) -> Vec<DVec3> {
        let point = |p: &[f64]| DVec3::new(p[0], p[1], p[2]);
        match self.kind {
            // without a copy of all in between
            Kind::F64 => self.bytes.chunks_exact(24).map(|b| point(&bytemuck::pod_collect_to_vec(b))).collect(),
            _ => self.reals().chunks_exact(3).map(point).collect(),
        }
    }

    /// As samples of a volume, which are no 64-bit integers.
    pub fn samples(&self) -> Option<Samples> {
        let b = self.bytes.as_slice();
        Some(match self.kind {
            Kind::I8 => Samples::I8(bytemuck::pod_collect_to_vec(b)),
            Kind::U8 => Samples::U8(b.to_vec()),
            Kind::I16 => Samples::I16(bytemuck::pod_collect_to_vec(b)),
            Kind::U16 => Samples::U16(bytemuck::pod_collect_to_vec(b)),
            Kind::I32 => Samples::I32(bytemuck::pod_collect_to_vec(b)),
            Kind::U32 => Samples::U32(bytemuck::pod_collect_to_vec(b)),
            Kind::F32 => Samples::F32(bytemuck::pod_collect_to_vec(b)),
            Kind::F64 => Samples::F64(bytemuck::pod_collect_to_vec(b)),
            Kind::I64 | Kind::U64 => return None,
        })
    }

    fn typed<T: bytemuck::AnyBitPattern>(&self) -> impl Iterator<Item = T> + '_ {
        self.bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_type_come_out_of_text_and_bytes() {
        for (kind, text, swapped, value) in [
            (Kind::I8, "-3", vec![0xfd], -3.0),
            (Kind::U8, "200", vec![200], 200.0),
            (Kind::I16, "-300", vec![0xfe, 0xd4], -300.0),
            (Kind::U16, "65535", vec![0xff, 0xff], 65535.0),
            (Kind::I32, "-70000", vec![0xff, 0xfe, 0xee, 0x90], -70000.0),
            (Kind::U32, "4294967295", vec![0xff; 4], 4294967295.0),
            (Kind::I64, "-2", vec![0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xfe], -2.0),
            (Kind::U64, "2", vec![0, 0, 0, 0, 0, 0, 0, 2], 2.0),
            (Kind::F32, "1.5e0", vec![0x3f, 0xc0, 0, 0], 1.5),
            (Kind::F64, "-2", vec![0xc0, 0, 0, 0, 0, 0, 0, 0], -2.0),
        ] {
            let read = Numbers::from_words(kind, &mut Words::new(text.as_bytes(), 1), 1).expect(text);
            assert_eq!(read, Numbers::from_bytes(kind, swapped.clone(), ByteOrder::Big));
            let turned: Vec<u8> = swapped.into_iter().rev().collect();
            assert_eq!(read, Numbers::from_bytes(kind, turned, ByteOrder::Little));
            assert_eq!((read.len(), read.reals()), (1, vec![value]));
            assert_eq!(read.whole(), (value.fract() == 0.0).then(|| vec![value as i64]));
            assert_eq!(
                read.samples().map(|s| s.get(0)),
                (!text.is_empty() && !matches!(kind, Kind::I64 | Kind::U64)).then_some(value)
            );
        }
        let wrong = Numbers::from_words(Kind::U8, &mut Words::new(b"1 256", 1), 2).expect_err("refused");
        assert_eq!(wrong, "line 1 has '256' where a whole number of type u8 should stand");
        assert_eq!(Numbers::from_bytes(Kind::F32, vec![0; 11], ByteOrder::Big).len(), 2);
        let huge = Numbers::from_bytes(Kind::U64, vec![0xff; 8], ByteOrder::Big);
        assert_eq!(huge.whole(), None);
    }
}

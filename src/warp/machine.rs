//! Which vectors look-ups are computed in, chosen at run time: sixteen numbers with AVX-512, eight with AVX2, arrays of eight,
//! which the compiler makes NEON or what else there is of.

use super::batch::{Batch, Row};
use super::row::Reader;
use crate::math::lanes::{self, Doubles, Plain};
use crate::volume::fetch::Fetch;

/// Most voxels of a vector.
pub(super) const WIDEST: usize = 16;

/// What computes with some voxels of a row at a time.
pub(super) trait Machine: Copy {
    const LANES: usize;
    /// What spans are solved for with.
    type Doubles: Doubles;
    fn doubles(self) -> Self::Doubles;
    /// Runs the work in code that is compiled for this machine.
    fn enter<W: Work>(self, work: W) -> W::Output;
    /// Cells and fractions of the voxels from the row's number `number` on, a vector of them: index of each cell's first
    /// sample, and where in the cell each voxel lies along x, y and z. Voxels of rows that are not `DEEP` in the input may lie
    /// an edge's slack outside; they are taken to lie on the edge.
    fn cells<const DEEP: bool>(
        self,
        row: &Row,
        stride: [i32; 3],
        number: f32,
        at: &mut [i32],
        fraction: [&mut [f32]; 3],
    );
    /// Samples and blends of a batch.
    fn look_up<T: Fetch>(self, batch: &mut Batch<T>, reader: &Reader<'_, T>, channel: usize);
}

/// Work that any machine can do. Is to be inlined, with all it calls that computes.
pub(super) trait Work {
    type Output;
    fn run<M: Machine>(self, machine: M) -> Self::Output;
}

/// Does it on the widest machine there is.
pub(super) fn run<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(machine) = pulp::x86::V4::try_new() {
            return Sixteen(machine).enter(work);
        }
        if let Some(machine) = pulp::x86::V3::try_new() {
            return Eight(machine).enter(work);
        }
    }
    Eight(Plain).enter(work)
}

#[cfg(target_arch = "x86_64")]
struct On<M, W>(M, W);

#[cfg(target_arch = "x86_64")]
impl<M: Machine, W: Work> pulp::WithSimd for On<M, W> {
    type Output = W::Output;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> W::Output {
        self.1.run(self.0)
    }
}

/// A machine of `math`, eight numbers at a time.
#[derive(Clone, Copy)]
struct Eight<M>(M);

/// What these machines do each in their way.
trait Each: lanes::Machine + Doubles {
    fn enter<W: Work>(self, work: W) -> W::Output;
    fn look_up<T: Fetch>(batch: &mut Batch<T>, reader: &Reader<'_, T>, channel: usize);
}

#[cfg(target_arch = "x86_64")]
impl Each for pulp::x86::V3 {
    #[inline(always)]
    fn enter<W: Work>(self, work: W) -> W::Output {
        pulp::Simd::vectorize(self, On(Eight(self), work))
    }
    #[inline(always)]
    fn look_up<T: Fetch>(batch: &mut Batch<T>, reader: &Reader<'_, T>, channel: usize) {
        batch.look_up::<8, true>(reader, channel);
    }
}

impl Each for Plain {
    #[inline(always)]
    fn enter<W: Work>(self, work: W) -> W::Output {
        work.run(Eight(self))
    }
    #[inline(always)]
    fn look_up<T: Fetch>(batch: &mut Batch<T>, reader: &Reader<'_, T>, channel: usize) {
        batch.look_up::<8, false>(reader, channel);
    }
}

impl<M: Each> Machine for Eight<M> {
    const LANES: usize = lanes::LANES;
    type Doubles = M;

    #[inline(always)]
    fn doubles(self) -> M {
        self.0
    }
    #[inline(always)]
    fn enter<W: Work>(self, work: W) -> W::Output {
        self.0.enter(work)
    }
    #[inline(always)]
    fn cells<const DEEP: bool>(
        self,
        row: &Row,
        stride: [i32; 3],
        number: f32,
        at: &mut [i32],
        fraction: [&mut [f32]; 3],
    ) {
        use lanes::{F8, I8, LANES};
        let m = self.0;
        let k = F8::load(m, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]) + number;
        let mut sum = I8::splat(m, row.place.first);
        for (axis, out) in fraction.into_iter().enumerate() {
            let mut v = k.times_plus(row.place.step[axis], row.from[axis]);
            let cell = if DEEP {
                v.truncate()
            } else {
                v = v.clamp(0.0, row.place.last[axis]);
                // the last sample is the end of the last cell
                v.min(row.place.last[axis] - 1.0).truncate()
            };
            (v - cell.to_float()).put(&mut out[..LANES], 0);
            sum = sum + cell * I8::splat(m, stride[axis]);
        }
        at[..LANES].copy_from_slice(&sum.lanes());
    }
    #[inline(always)]
    fn look_up<T: Fetch>(self, batch: &mut Batch<T>, reader: &Reader<'_, T>, channel: usize) {
        M::look_up(batch, reader, channel);
    }
}

#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
struct Sixteen(pulp::x86::V4);

#[cfg(target_arch = "x86_64")]
impl Machine for Sixteen {
    const LANES: usize = 16;
    type Doubles = pulp::x86::V4;

    #[inline(always)]
    fn doubles(self) -> pulp::x86::V4 {
        self.0
    }

    #[inline(always)]
    fn enter<W: Work>(self, work: W) -> W::Output {
        pulp::Simd::vectorize(self.0, On(self, work))
    }

    #[inline(always)]
    fn cells<const DEEP: bool>(
        self,
        row: &Row,
        stride: [i32; 3],
        number: f32,
        at: &mut [i32],
        fraction: [&mut [f32]; 3],
    ) {
        const COUNT: [f32; 16] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];
        let m = self.0.avx512f;
        let k = m._mm512_add_ps(bytemuck::cast(COUNT), m._mm512_set1_ps(number));
        let mut sum = m._mm512_set1_epi32(row.place.first);
        for (axis, out) in fraction.into_iter().enumerate() {
            let (step, from) = (m._mm512_set1_ps(row.place.step[axis]), m._mm512_set1_ps(row.from[axis]));
            let mut v = m._mm512_fmadd_ps(k, step, from);
            let cell = if DEEP {
                m._mm512_cvttps_epi32(v)
            } else {
                let (last, end) = (row.place.last[axis], row.place.last[axis] - 1.0);
                v = m._mm512_min_ps(m._mm512_max_ps(v, m._mm512_set1_ps(0.0)), m._mm512_set1_ps(last));
                m._mm512_cvttps_epi32(m._mm512_min_ps(v, m._mm512_set1_ps(end)))
            };
            let part: [f32; 16] = bytemuck::cast(m._mm512_sub_ps(v, m._mm512_cvtepi32_ps(cell)));
            out[..16].copy_from_slice(&part);
            sum = m._mm512_add_epi32(sum, m._mm512_mullo_epi32(cell, m._mm512_set1_epi32(stride[axis])));
        }
        at[..16].copy_from_slice(&bytemuck::cast::<_, [i32; 16]>(sum));
    }

    #[inline(always)]
    fn look_up<T: Fetch>(self, batch: &mut Batch<T>, reader: &Reader<'_, T>, channel: usize) {
        batch.look_up::<16, true>(reader, channel);
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::WarpOptions;
    use super::super::batch::{Batch, Push};
    use super::super::row::{Line, Reader};
    use super::*;
    use crate::volume::sampling::{Interpolation, Sampler};

    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    }

    const DIMS: [usize; 3] = [37, 29, 23];

    /// Rows between two random points of the input, corners and faces among them, one after the other.
    struct Rows<'a, 'b, T: Fetch> {
        reader: &'a Reader<'b, T>,
        ends: &'a [([DVec3; 2], usize)],
        out: &'a mut [T],
    }

    impl<T: Fetch> Work for Rows<'_, '_, T> {
        type Output = ();
        fn run<M: Machine>(self, machine: M) {
            let mut batch = Box::new(Batch::new());
            let mut start = 0;
            for ([from, to], count) in self.ends {
                let line = Line { from: *from, step: (*to - *from) / (*count - 1) as f64, weight: 1.0 };
                let row = self.reader.row(&line, 0, *count);
                let voxels = start..start + count;
                machine.enter(Push { batch: &mut batch, reader: self.reader, row, voxels, out: self.out });
                start += count;
            }
            batch.flush(machine, self.reader, self.out);
        }
    }

    /// Every machine of this processor against look-ups in `f64`; `near` is what rounding may change.
    fn check<T: Fetch>(channels: usize, near: f64, value: impl Fn(f64) -> T) {
        let mut state = 7;
        let samples: Vec<T> =
            (0..DIMS.iter().product::<usize>() * channels).map(|_| value(random(&mut state))).collect();
        let input = Sampler::new(&samples, DIMS, channels);
        let options = WarpOptions { interpolation: Interpolation::Linear, ..WarpOptions::default() };
        let reader = Reader::new(input, &options);
        let mut point = || {
            DVec3::from_array(std::array::from_fn(|a| {
                let last = (DIMS[a] - 1) as f64;
                // some on whole voxels, and on the first and last
                match (random(&mut state) * 5.0) as u32 {
                    0 => (random(&mut state) * 2.0).floor() * last,
                    1 => (random(&mut state) * last).round(),
                    _ => random(&mut state) * last,
                }
            }))
        };
        let ends: Vec<_> =
            (0..400).map(|i| ([point(), point()], 2 + i % 67 + 700 * usize::from(i % 50 == 0))).collect();
        let voxels: usize = ends.iter().map(|(_, count)| count).sum();
        let mut wanted = vec![T::zeroed(); voxels * channels];
        let mut values = wanted.chunks_exact_mut(channels);
        for ([from, to], count) in &ends {
            for i in 0..*count {
                let p = from.lerp(*to, i as f64 / (*count - 1) as f64).min(reader.last);
                assert!(reader.single(p, 1.0, values.next().unwrap_or_default()), "{p}");
            }
        }
        let mut checked = 0;
        let mut compare = |name: &str, draw: &dyn Fn(Rows<'_, '_, T>)| {
            let mut out = vec![T::zeroed(); voxels * channels];
            draw(Rows { reader: &reader, ends: &ends, out: &mut out });
            for (i, (a, b)) in out.iter().zip(&wanted).enumerate() {
                let (a, b) = (a.to_f64(), b.to_f64());
                assert!((a - b).abs() <= near, "{name}, sample {i}: {a} instead of {b}");
            }
            checked += 1;
        };
        compare("arrays", &|rows| Eight(Plain).enter(rows));
        #[cfg(target_arch = "x86_64")]
        {
            if let Some(m) = pulp::x86::V3::try_new() {
                compare("AVX2", &|rows| Eight(m).enter(rows));
            }
            if let Some(m) = pulp::x86::V4::try_new() {
                compare("AVX-512", &|rows| Sixteen(m).enter(rows));
            }
        }
        assert!(checked > 0);
    }

    #[test]
    fn every_machine_looks_up_what_the_reference_does() {
        check(1, 1.0, |v| (v * 65535.0) as u16);
        check(3, 1.0, |v| (v * 65535.0 - 32768.0) as i16);
        check(1, 1.0, |v| (v * 255.0) as u8);
        check(2, 1.0, |v| (v * 255.0 - 128.0) as i8);
        check(1, 1e-4, |v| v as f32);
        check(4, 1e-4, |v| v as f32);
        // the place in a cell is known to some 1e-6, whatever the samples are
        check(1, 1e-5 * f64::from(u32::MAX), |v| (v * f64::from(u32::MAX)) as u32);
        check(1, 1e-5, |v| v);
    }
}

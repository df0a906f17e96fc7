//! Buffers and dispatches of one warp.

use std::time::{Duration, Instant};

use super::bricks::{Brick, ROWS, pairs};
use super::input::{Coding, Input, Window};
use super::pace::Pace;
use super::{WarpGpuError, WarpPass};
use crate::gpu::layout::{RESAMPLE_GROUP, WarpTet, WarpUniform, workgroups};
use crate::gpu::slicing::buffer;
use crate::gpu::{Gpu, GpuError};
use crate::volume::sampling::Interpolation;
use crate::volume::{Samples, Volume};
use crate::warp::cells::Candidates;
use crate::warp::{Culling, Tally, Warp, WarpOptions};
use crate::with_samples;

/// Pairs of items sent at once.
const ITEMS: usize = 1 << 18;

/// Units that are sampled at once.
const UNITS: usize = 1 << 24;

/// Bytes of the counters of `shaders/warp.wgsl`: four for each of 64 slots.
const COUNTERS: u64 = 64 * 4 * 4;

/// Flags of `shaders/warp_sample.wgsl`.
const NEAREST: u32 = 1;
const DENSITY: u32 = 2;
const FIRST: u32 = 4;
const FLOAT: u32 = 8;

/// What is to be done.
pub struct Job<'a> {
    pub warp: &'a Warp,
    pub volume: &'a Volume,
    pub options: &'a WarpOptions,
    pub candidates: &'a Candidates<'a>,
    /// The outside value as it is stored.
    pub outside: Vec<u8>,
    pub dispatch: Duration,
}

/// A warp under way.
pub struct Run<'a> {
    gpu: &'a Gpu,
    pass: &'a WarpPass,
    job: Job<'a>,
    coding: Coding,
    /// Voxels that one thread samples, and the words that they fill.
    unit: [u32; 2],
    uniform: wgpu::Buffer,
    tets: wgpu::Buffer,
    counters: wgpu::Buffer,
    items: wgpu::Buffer,
    owner: wgpu::Buffer,
    values: wgpu::Buffer,
    /// Values, and the counters behind them.
    readback: wgpu::Buffer,
    common: wgpu::BindGroup,
    claims: wgpu::BindGroup,
    samples: wgpu::BindGroup,
    claim_pace: Pace,
    sample_pace: Pace,
    pub tally: Tally,
}

impl<'a> Run<'a> {
    /// Buffers for the largest of the bricks.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`].
    pub fn new(gpu: &'a Gpu, pass: &'a WarpPass, job: Job<'a>, bricks: &[Brick]) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as U;
        let coding = Coding::of(job.volume.samples.scalar_type());
        let unit = coding.unit(job.volume.channels);
        let most = |of: &dyn Fn(&Brick) -> usize| bricks.iter().map(of).max().unwrap_or(0).max(1) as u64;
        let units = most(&|b| b.voxels().div_ceil(unit[0] as usize));
        let bytes = units * u64::from(unit[1]) * 4;
        let uniform = buffer(gpu, "warp", size_of::<WarpUniform>() as u64, U::UNIFORM)?;
        let record = size_of::<WarpTet>() as u64;
        let tets = buffer(gpu, "the tetrahedra", most(&|b| b.tets.len()) * record, U::STORAGE)?;
        let counters = buffer(gpu, "counters", COUNTERS, U::STORAGE | U::COPY_SRC)?;
        let items = buffer(gpu, "rows of voxels", (ITEMS * 8) as u64, U::STORAGE)?;
        // only rows have spans
        let spans = if job.options.culling == Culling::Exact { ITEMS * ROWS * 4 } else { 4 };
        let spans = buffer(gpu, "rows of voxels", spans as u64, U::STORAGE)?;
        let owner = buffer(gpu, "owners of voxels", most(&Brick::voxels) * 4, U::STORAGE)?;
        let values = buffer(gpu, "warped values", bytes, U::STORAGE | U::COPY_SRC)?;
        let readback = buffer(gpu, "warped values", bytes + COUNTERS, U::MAP_READ)?;
        let group = |label, layout, buffers: &[&wgpu::Buffer]| {
            let entries: Vec<_> = (0..)
                .zip(buffers)
                .map(|(binding, b)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() })
                .collect();
            let entries = &entries;
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries })
        };
        let common = group("warp", &pass.common_layout, &[&uniform, &tets, &counters]);
        let claims = group("warp claim", &pass.claim_layout, &[&items, &spans, &owner]);
        let samples = group("warp sample", &pass.sample_layout, &[&owner, &values]);
        let most = ITEMS / pairs(job.options.culling);
        let claim_pace = Pace::new(job.dispatch, most);
        let sample_pace = Pace::new(job.dispatch, UNITS);
        Ok(Self {
            gpu,
            pass,
            job,
            coding,
            unit,
            uniform,
            tets,
            counters,
            items,
            owner,
            values,
            readback,
            common,
            claims,
            samples,
            claim_pace,
            sample_pace,
            tally: Tally::default(),
        })
    }

    /// Draws a brick into the samples of the whole output.
    ///
    /// # Errors
    /// What the device reports, or a tetrahedron that does not fit.
    pub fn brick(&mut self, brick: &Brick, input: &mut Input<'_>, out: &mut Samples) -> Result<(), WarpGpuError> {
        let row = brick.size[0] * self.job.volume.channels;
        if brick.tets.is_empty() {
            let outside = &self.job.outside;
            self.rows(brick, out, |_, to| to.chunks_exact_mut(outside.len()).for_each(|v| v.copy_from_slice(outside)));
            return Ok(());
        }
        let record = self.record(brick);
        let records = brick.records(self.job.warp)?;
        self.gpu.queue.write_buffer(&self.tets, 0, bytemuck::cast_slice(&records));
        self.submit(|encoder| {
            encoder.clear_buffer(&self.owner, 0, None);
            encoder.clear_buffer(&self.counters, 0, None);
        })?;
        self.claim(record, &brick.items(self.job.warp, self.job.candidates))?;
        let tets = brick.tets.iter().map(|t| &self.job.warp.tets()[*t as usize]);
        for (i, window) in input.needed(tets).into_iter().enumerate() {
            let view = input.view(self.gpu, window)?;
            self.sample(record, input.window(window), &view, i == 0)?;
        }
        let bytes = brick.voxels().div_ceil(self.unit[0] as usize) as u64 * u64::from(self.unit[1]) * 4;
        self.submit(|encoder| {
            encoder.copy_buffer_to_buffer(&self.values, 0, &self.readback, 0, bytes);
            encoder.copy_buffer_to_buffer(&self.counters, 0, &self.readback, bytes, COUNTERS);
        })?;
        let counts = self.gpu.read(&self.readback, |all| {
            let (values, counters) = all[..(bytes + COUNTERS) as usize].split_at(bytes as usize);
            if let Samples::F64(_) = out {
                let floats: &[f32] = bytemuck::cast_slice(values);
                self.rows(brick, out, |i, to| {
                    let doubles = bytemuck::cast_slice_mut::<u8, f64>(to).iter_mut();
                    doubles.zip(&floats[i * row..]).for_each(|(to, v)| *to = f64::from(*v));
                });
            } else {
                self.rows(brick, out, |i, to| to.copy_from_slice(&values[i * to.len()..][..to.len()]));
            }
            let mut counts = [0u64; 4];
            for slot in bytemuck::cast_slice::<u8, [u32; 4]>(counters) {
                (0..4).for_each(|i| counts[i] += u64::from(slot[i]));
            }
            counts
        })?;
        let [met, repeated, covered_twice, beyond] = counts;
        self.tally.written += met - repeated;
        self.tally.repeated += repeated;
        self.tally.covered_twice += covered_twice;
        self.tally.beyond += beyond;
        Ok(())
    }

    /// What all dispatches of a brick have in common.
    fn record(&self, brick: &Brick) -> WarpUniform {
        let four = |[x, y, z]: [u32; 3], w: u32| [x, y, z, w];
        // an `f64` comes as an `f32`
        let outside = match self.job.outside[..] {
            [a, b, c, d, e, f, g, h] => (f64::from_ne_bytes([a, b, c, d, e, f, g, h]) as f32).to_bits(),
            [a, b, c, d] => u32::from_ne_bytes([a, b, c, d]),
            [a, b] => u32::from(u16::from_ne_bytes([a, b])),
            _ => u32::from(self.job.outside[0]),
        };
        let [least, most] = self.coding.range;
        WarpUniform {
            brick: four(brick.size.map(|n| n as u32), self.job.volume.channels as u32),
            input: four(self.job.volume.grid.dims.map(|n| n as u32), self.unit[0]),
            first: four([0; 3], self.unit[1]),
            end: four([0; 3], self.coding.bits),
            range: [least, most, 0.0, 0.0],
            outside: [outside, brick.voxels() as u32, 0, 0],
            ..WarpUniform::default()
        }
    }

    /// Finds the owners.
    fn claim(&mut self, mut record: WarpUniform, items: &[[u32; 2]]) -> Result<(), GpuError> {
        let pairs = pairs(self.job.options.culling);
        let mut rest = items;
        while !rest.is_empty() {
            let count = self.claim_pace.next().min(rest.len() / pairs);
            let (now, later) = rest.split_at(count * pairs);
            rest = later;
            self.gpu.queue.write_buffer(&self.items, 0, bytemuck::cast_slice(now));
            let wide = self.groups(count * RESAMPLE_GROUP as usize);
            record.chunk = [0, count as u32, wide[0], 0];
            let steps = if let Culling::Exact = self.job.options.culling {
                let narrow = self.groups(count * ROWS);
                vec![(&self.pass.solve, narrow), (&self.pass.claim, wide)]
            } else {
                vec![(&self.pass.test, wide)]
            };
            let mut time = Duration::ZERO;
            for (pipeline, groups) in steps {
                record.chunk[2] = groups[0];
                time += self.dispatch(pipeline, &[&self.common, &self.claims], &record, groups)?;
            }
            self.claim_pace.took(count, time);
        }
        Ok(())
    }

    /// Samples from a window of the input; `first`: what comes from none is written, too.
    fn sample(
        &mut self,
        mut record: WarpUniform,
        window: &Window,
        view: &wgpu::TextureView,
        first: bool,
    ) -> Result<(), GpuError> {
        record.first[..3].copy_from_slice(&window.first);
        record.end[..3].copy_from_slice(&window.end);
        let options = self.job.options;
        let flags = [
            (NEAREST, options.interpolation == Interpolation::Nearest),
            (DENSITY, options.density),
            (FIRST, first),
            (FLOAT, self.coding.texel == crate::gpu::shader::Texel::Float),
        ];
        let flags = flags.iter().filter(|(_, on)| *on).map(|(flag, _)| flag).sum();
        let (layout, pipeline) = &self.pass.kinds[self.coding.texel as usize];
        let texture = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("warp input"),
            layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(view) }],
        });
        let units = record.outside[1].div_ceil(self.unit[0]) as usize;
        let mut done = 0;
        while done < units {
            let count = self.sample_pace.next().min(units - done);
            let groups = self.groups(count);
            record.chunk = [done as u32, count as u32, groups[0], flags];
            let time = self.dispatch(pipeline, &[&self.common, &self.samples, &texture], &record, groups)?;
            self.sample_pace.took(count, time);
            done += count;
        }
        Ok(())
    }

    fn groups(&self, threads: usize) -> [u32; 2] {
        workgroups(threads as u32, self.gpu.limits().max_compute_workgroups_per_dimension)
    }

    /// Runs a pipeline, and says how long it took.
    fn dispatch(
        &self,
        pipeline: &wgpu::ComputePipeline,
        groups: &[&wgpu::BindGroup],
        record: &WarpUniform,
        size: [u32; 2],
    ) -> Result<Duration, GpuError> {
        self.gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(record));
        let begun = Instant::now();
        self.submit(|encoder| {
            let mut pass = encoder
                .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("warp"), timestamp_writes: None });
            pass.set_pipeline(pipeline);
            (0..).zip(groups).for_each(|(i, group)| pass.set_bind_group(i, *group, &[]));
            pass.dispatch_workgroups(size[0], size[1], 1);
        })?;
        self.gpu.wait()?;
        Ok(begun.elapsed())
    }

    fn submit(&self, record: impl FnOnce(&mut wgpu::CommandEncoder)) -> Result<(), GpuError> {
        let mut encoder =
            self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("warp") });
        record(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.check()
    }

    /// Calls `fill` with the number of each row of a brick and its samples in the output.
    fn rows(&self, brick: &Brick, out: &mut Samples, mut fill: impl FnMut(usize, &mut [u8])) {
        let [nx, ny, _] = self.job.warp.dims();
        let voxel = out.scalar_type().bytes() * self.job.volume.channels;
        let bytes: &mut [u8] = with_samples!(out, v => bytemuck::cast_slice_mut(v));
        let [cx, cy, cz] = brick.corner.map(|c| c as usize);
        for z in 0..brick.size[2] {
            for y in 0..brick.size[1] {
                let at = (((cz + z) * ny + cy + y) * nx + cx) * voxel;
                fill(z * brick.size[1] + y, &mut bytes[at..at + brick.size[0] * voxel]);
            }
        }
    }
}

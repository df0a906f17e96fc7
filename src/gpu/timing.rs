//! How long the passes of a frame took on the device, and how much they did.

use super::slicing::PARTS;
use super::{Gpu, GpuError};

/// Times of one frame in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Timings {
    /// From the submission until the picture was read back, by the host's clock.
    pub frame: f64,
    /// The slicing pass by the device's own timestamps, where it has them.
    pub slicing: Option<f64>,
    /// The resolve pass, likewise.
    pub resolve: Option<f64>,
}

const STAMPS: u32 = 4;
const BYTES: u64 = STAMPS as u64 * 8;

/// Timestamps around the two passes.
#[derive(Debug)]
pub struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: wgpu::Buffer,
}

impl Timer {
    /// `None` where the adapter has no timestamps.
    pub fn new(gpu: &Gpu) -> Option<Self> {
        if !gpu.capabilities().timestamps {
            return None;
        }
        let buffer = |usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: BYTES,
                usage,
                mapped_at_creation: false,
            })
        };
        Some(Self {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: STAMPS,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            readback: buffer(wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ),
        })
    }

    /// Stamps for the start and end of pass 0 or 1, of which this is the first part or the last.
    pub fn part(&self, pass: u32, first: bool, last: bool) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        (first || last).then(|| wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: first.then_some(2 * pass),
            end_of_pass_write_index: last.then_some(2 * pass + 1),
        })
    }

    /// Records the copy of the stamps to the host.
    pub fn finish(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.queries, 0..STAMPS, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readback, 0, BYTES);
    }

    /// Milliseconds of both passes, after everything was submitted.
    ///
    /// # Errors
    /// What the device reported.
    pub fn read(&self, gpu: &Gpu) -> Result<[f64; 2], GpuError> {
        let period = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
        gpu.read(&self.readback, |bytes| {
            let stamp = |i: usize| bytemuck::pod_read_unaligned::<u64>(&bytes[8 * i..8 * i + 8]);
            [0, 2].map(|i| stamp(i + 1).saturating_sub(stamp(i)) as f64 * period)
        })
    }
}

/// Counts the fragments of a frame's parts, each a pass of its own.
#[derive(Debug)]
pub struct Counter {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: wgpu::Buffer,
}

impl Counter {
    /// `None` where the adapter has no pipeline statistics.
    pub fn new(gpu: &Gpu) -> Option<Self> {
        if !gpu.capabilities().statistics {
            return None;
        }
        let buffer = |usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("fragments"),
                size: u64::from(PARTS) * 8,
                usage,
                mapped_at_creation: false,
            })
        };
        Some(Self {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("fragments"),
                ty: wgpu::QueryType::PipelineStatistics(wgpu::PipelineStatisticsTypes::FRAGMENT_SHADER_INVOCATIONS),
                count: PARTS,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            readback: buffer(wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ),
        })
    }

    /// Counts from here on, in pass number `number`.
    pub fn begin(&self, pass: &mut wgpu::RenderPass<'_>, number: u32) {
        pass.begin_pipeline_statistics_query(&self.queries, number);
    }

    /// Records the copy of the counts of the first passes to the host.
    pub fn finish(&self, encoder: &mut wgpu::CommandEncoder, passes: u32) {
        encoder.resolve_query_set(&self.queries, 0..passes, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readback, 0, u64::from(passes) * 8);
    }

    /// Fragments that were shaded in the first passes, after everything was submitted.
    ///
    /// # Errors
    /// What the device reported.
    pub fn read(&self, gpu: &Gpu, passes: u32) -> Result<u64, GpuError> {
        gpu.read(&self.readback, |bytes| {
            bytes.as_chunks::<8>().0.iter().take(passes as usize).map(|n| u64::from_ne_bytes(*n)).sum()
        })
    }
}

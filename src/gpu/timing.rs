//! How long the passes of a frame took on the device, and how much they did.

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

    /// Stamps for the start and end of pass 0 or 1.
    pub fn pass(&self, pass: u32) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(2 * pass),
            end_of_pass_write_index: Some(2 * pass + 1),
        }
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

/// Counts the fragments of a pass.
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
                size: 8,
                usage,
                mapped_at_creation: false,
            })
        };
        Some(Self {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("fragments"),
                ty: wgpu::QueryType::PipelineStatistics(wgpu::PipelineStatisticsTypes::FRAGMENT_SHADER_INVOCATIONS),
                count: 1,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            readback: buffer(wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ),
        })
    }

    /// Counts from here on, in this pass.
    pub fn begin(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.begin_pipeline_statistics_query(&self.queries, 0);
    }

    /// Records the copy of the count to the host.
    pub fn finish(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.queries, 0..1, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readback, 0, 8);
    }

    /// Fragments that were shaded, after everything was submitted.
    ///
    /// # Errors
    /// What the device reported.
    pub fn read(&self, gpu: &Gpu) -> Result<u64, GpuError> {
        gpu.read(&self.readback, bytemuck::pod_read_unaligned::<u64>)
    }
}

//! The deformed volume resampled into a new grid, as the paper exports it: slice by slice on the GPU.
//!
//! A compute pass takes each voxel of the output to the world, through the backward map and into the input, where it is
//! sampled by hand in `f32` (the weights of a texture filter have 8 bits). Rows of the output go by in chunks, so that
//! memory stays at the input plus a constant. Displacements are differences, so a voxel that is not moved keeps its value
//! exactly, as long as `f32` holds it: u8, i8, u16, i16 and f32 do, while u32, i32 and f64 lose digits.

use glam::{DAffine3, DMat4};

use super::bind::{SAMPLES, buffer_type, compute_pipelines};
use super::deform::MapBuffers;
use super::layout::{RESAMPLE_GROUP, ResampleUniform, layers_per_chunk, rows_per_chunk, workgroups};
use super::slicing::buffer;
use super::volume::{CHUNK, texture_size, write_layers};
use super::{Gpu, GpuError, shader};
use crate::deform::Stack;
use crate::volume::{Grid, Samples, Scalar, ScalarType, Volume};
use crate::with_samples;

/// Bytes of the output that are worked on at once.
const BUDGET: u64 = 16 << 20;
/// Bytes of the two counts.
const COUNTS: u64 = 8;

/// What to make.
#[derive(Debug, Clone, Copy)]
pub struct ResampleJob<'a> {
    pub stack: &'a Stack,
    pub output: &'a Grid,
    /// The sample of the voxel that holds the point, for labels; else trilinear.
    pub nearest: bool,
    /// The stored value beyond the input.
    pub outside: f32,
}

/// What happened to the voxels of the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ResampleTally {
    /// Those whose value comes from elsewhere, by more than 1/1000 voxel of the input.
    pub moved: u64,
    /// Those whose value lies beyond the input and is the outside value.
    pub outside: u64,
}

/// Why resampling stopped.
#[derive(Debug, thiserror::Error)]
pub enum ResampleError<E> {
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// What the receiver of the values returned.
    #[error("{0}")]
    Receiver(E),
}

/// Resamples volumes.
#[derive(Debug)]
pub struct ResamplePass {
    job_layout: wgpu::BindGroupLayout,
    volume_layout: wgpu::BindGroupLayout,
    pass_layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

impl ResamplePass {
    /// # Errors
    /// [`GpuError::Refusal`].
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let stages = wgpu::ShaderStages::COMPUTE;
        let group = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
        };
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry { binding, visibility: stages, ty, count: None };
        let job_layout = group("job", &[entry(0, buffer_type(wgpu::BufferBindingType::Uniform))]);
        let volume_layout = group("raw volume", &[entry(0, SAMPLES)]);
        let mut pass = MapBuffers::layout(stages).to_vec();
        pass.push(entry(3, buffer_type(wgpu::BufferBindingType::Storage { read_only: false })));
        pass.push(entry(4, buffer_type(wgpu::BufferBindingType::Storage { read_only: false })));
        let pass_layout = group("resample", &pass);
        let groups = [Some(&job_layout), Some(&volume_layout), Some(&pass_layout)];
        let [pipeline] = compute_pipelines(gpu, &shader::resample(), ["resample_main"], &groups)?;
        Ok(Self { job_layout, volume_layout, pass_layout, pipeline })
    }

    /// Resamples `volume`; `receive` gets the index of the first sample of a chunk and its stored values (channels
    /// interleaved, x fastest), in order.
    ///
    /// # Errors
    /// What the device reports, or what `receive` returned, which ends the work.
    pub fn run<E>(
        &self,
        gpu: &Gpu,
        volume: &Volume,
        job: ResampleJob<'_>,
        mut receive: impl FnMut(usize, &[f32]) -> Result<(), E>,
    ) -> Result<ResampleTally, ResampleError<E>> {
        let limits = gpu.limits();
        let (texture, scale) = upload(gpu, volume)?;
        let [nx, ny, nz] = texture_size(job.output.dims, u32::MAX)?;
        let channels = volume.channels;
        let budget = BUDGET.min(limits.max_storage_buffer_binding_size);
        let row = nx as usize * channels;
        if row as u64 * 4 > budget {
            return Err(too_wide(job.output, budget).into());
        }
        let rows = ny as usize * nz as usize;
        let step = rows_per_chunk(nx as usize, channels, budget).min(rows);
        let bytes = (step * row * 4) as u64;

        let values =
            buffer(gpu, "resampled values", bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC)?;
        let counts = buffer(gpu, "counts", COUNTS, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC)?;
        // the values, and the counts behind them
        let readback = buffer(gpu, "resampled values", bytes + COUNTS, wgpu::BufferUsages::MAP_READ)?;
        let uniform = buffer(gpu, "job", size_of::<ResampleUniform>() as u64, wgpu::BufferUsages::UNIFORM)?;
        let mut map = MapBuffers::new(gpu)?;
        let voxel_from_world = volume.grid.voxel_from_world();
        // the deformers are relative to the middle of the output, where `f32` is finest
        let center = job.output.center();
        let linear = DAffine3 { translation: glam::DVec3::ZERO, ..voxel_from_world };
        map.write_local(gpu, job.stack, linear, center)?;

        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let group = |layout, entries: &[wgpu::BindGroupEntry<'_>]| {
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("resample"), layout, entries })
        };
        let job_group =
            group(&self.job_layout, &[wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }]);
        let volume_group = group(
            &self.volume_layout,
            &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) }],
        );
        let mut entries = map.entries().to_vec();
        entries.push(wgpu::BindGroupEntry { binding: 3, resource: values.as_entire_binding() });
        entries.push(wgpu::BindGroupEntry { binding: 4, resource: counts.as_entire_binding() });
        let pass_group = group(&self.pass_layout, &entries);

        let matrix = |m: DAffine3| DMat4::from(m).as_mat4().to_cols_array_2d();
        let input = volume.grid.dims.map(|n| n as u32);
        let world_from_output = job.output.world_from_voxel;
        let mut record = ResampleUniform {
            input_from_output: matrix(voxel_from_world * world_from_output),
            local_from_output: matrix(DAffine3::from_translation(-center) * world_from_output),
            input: [input[0], input[1], input[2], channels as u32],
            output: [nx, ny, nz, u32::from(job.nearest)],
            chunk: [0; 4],
            value: [scale, job.outside, 0.0, 0.0],
        };
        let mut tally = ResampleTally::default();
        for first in (0..rows).step_by(step) {
            let voxels = (step.min(rows - first) * nx as usize) as u32;
            let used = u64::from(voxels) * channels as u64 * 4;
            let groups = workgroups(voxels, limits.max_compute_workgroups_per_dimension);
            debug_assert!(u64::from(groups[0]) * u64::from(groups[1]) * u64::from(RESAMPLE_GROUP) >= u64::from(voxels));
            record.chunk = [first as u32, voxels, groups[0], 0];
            gpu.queue.write_buffer(&uniform, 0, bytemuck::bytes_of(&record));
            let mut encoder =
                gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("resample") });
            encoder.clear_buffer(&counts, 0, None);
            let mut pass = encoder
                .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("resample"), timestamp_writes: None });
            pass.set_pipeline(&self.pipeline);
            [&job_group, &volume_group, &pass_group]
                .into_iter()
                .zip(0..)
                .for_each(|(group, i)| pass.set_bind_group(i, group, &[]));
            pass.dispatch_workgroups(groups[0], groups[1], 1);
            drop(pass);
            encoder.copy_buffer_to_buffer(&values, 0, &readback, 0, used);
            encoder.copy_buffer_to_buffer(&counts, 0, &readback, used, COUNTS);
            gpu.queue.submit([encoder.finish()]);
            let used = used as usize;
            gpu.read(&readback, |bytes| {
                let [moved, outside]: [u32; 2] = bytemuck::pod_read_unaligned(&bytes[used..used + COUNTS as usize]);
                tally.moved += u64::from(moved);
                tally.outside += u64::from(outside);
                receive(first * row, bytemuck::cast_slice(&bytes[..used]))
            })?
            .map_err(ResampleError::Receiver)?;
        }
        Ok(tally)
    }

    /// Why a volume cannot be resampled here without losing digits; `None` if it can.
    pub fn unsupported(gpu: &Gpu, volume: &Volume) -> Option<&'static str> {
        let most = gpu.limits().max_texture_dimension_3d as usize;
        match volume.samples.scalar_type() {
            ScalarType::U32 | ScalarType::I32 => Some("32-bit integers lose digits in its arithmetic"),
            ScalarType::F64 => Some("64-bit numbers lose digits in its arithmetic"),
            _ if volume.channels > 4 => Some("more than four channels do not fit a texel"),
            _ if volume.grid.dims.iter().any(|n| *n > most) => {
                Some("the volume has more voxels along a side than a texture")
            }
            _ => None,
        }
    }

    /// Resamples into samples of the volume's type, rounded to nearest.
    ///
    /// # Errors
    /// What the device reports, and [`GpuError::OutOfMemory`] if the host cannot hold the result.
    pub fn samples(
        &self,
        gpu: &Gpu,
        volume: &Volume,
        job: ResampleJob<'_>,
    ) -> Result<(Samples, ResampleTally), GpuError> {
        let count = job.output.len() * volume.channels;
        with_samples!(&volume.samples, v => self.typed(gpu, volume, job, count, v))
    }

    /// The same as a volume.
    ///
    /// # Errors
    /// As [`ResamplePass::samples`].
    pub fn volume(&self, gpu: &Gpu, volume: &Volume, job: ResampleJob<'_>) -> Result<Volume, GpuError> {
        let (samples, _) = self.samples(gpu, volume, job)?;
        let mut made = Volume::new(*job.output, volume.channels, samples);
        made.rescale = volume.rescale;
        Ok(made)
    }

    fn typed<T: Scalar>(
        &self,
        gpu: &Gpu,
        volume: &Volume,
        job: ResampleJob<'_>,
        count: usize,
        _: &[T],
    ) -> Result<(Samples, ResampleTally), GpuError> {
        let mut out = Vec::new();
        out.try_reserve_exact(count).map_err(|_| GpuError::OutOfMemory {
            what: "the exported volume",
            bytes: (count * size_of::<T>()) as u64,
        })?;
        let made = self.run(gpu, volume, job, |_, values| {
            out.extend(values.iter().map(|&v| T::from_f64(f64::from(v))));
            Ok::<(), std::convert::Infallible>(())
        });
        match made {
            Ok(tally) => Ok((T::wrap(out), tally)),
            Err(ResampleError::Gpu(e)) => Err(e),
            Err(ResampleError::Receiver(never)) => match never {},
        }
    }
}

fn too_wide(output: &Grid, budget: u64) -> GpuError {
    GpuError::TooLarge {
        what: "a grid",
        size: format!("{} voxels in a row", output.dims[0]),
        limit: format!("{budget} bytes a row"),
    }
}

/// The volume's stored values as a texture, and the factor from a texel to them. Three channels are padded to four.
fn upload(gpu: &Gpu, volume: &Volume) -> Result<(wgpu::Texture, f32), GpuError> {
    use wgpu::TextureFormat as F;
    let dims = texture_size(volume.grid.dims, gpu.limits().max_texture_dimension_3d)?;
    let lanes = if volume.channels == 3 { 4 } else { volume.channels };
    let narrow = lanes == volume.channels;
    let pick = |formats: [F; 3]| formats[[1, 2, 4].iter().position(|&n| n == lanes).unwrap_or(2)];
    let (format, scale) = match &volume.samples {
        Samples::U8(_) if narrow => (pick([F::R8Unorm, F::Rg8Unorm, F::Rgba8Unorm]), 255.0),
        Samples::U16(_) if narrow && gpu.capabilities().unorm16 => {
            (pick([F::R16Unorm, F::Rg16Unorm, F::Rgba16Unorm]), 65535.0)
        }
        _ => (pick([F::R32Float, F::Rg32Float, F::Rgba32Float]), 1.0),
    };
    let texel_bytes = format.block_copy_size(None).unwrap_or(16);
    let layer_bytes = u64::from(dims[0]) * u64::from(dims[1]) * u64::from(texel_bytes);
    let texture = super::volume::texture(gpu, "the volume", dims, format, layer_bytes)?;
    let step = layers_per_chunk(layer_bytes, dims[2], CHUNK);
    let layer = dims[0] as usize * dims[1] as usize * volume.channels;
    for z in (0..dims[2]).step_by(step as usize) {
        let depth = step.min(dims[2] - z);
        let range = z as usize * layer..(z + depth) as usize * layer;
        if scale == 1.0 {
            let mut floats = Vec::with_capacity(range.len() / volume.channels * lanes);
            with_samples!(&volume.samples, v => for voxel in v[range].chunks_exact(volume.channels) {
                floats.extend(voxel.iter().map(|s| s.to_f32()));
                floats.resize(floats.len() + lanes - volume.channels, 0.0);
            });
            write_layers(gpu, &texture, z, depth, bytemuck::cast_slice(&floats))?;
        } else {
            let bytes = volume.samples.scalar_type().bytes();
            write_layers(gpu, &texture, z, depth, &volume.samples.bytes()[range.start * bytes..range.end * bytes])?;
        }
    }
    Ok((texture, scale))
}

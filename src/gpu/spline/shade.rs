//! How full space is, on the device.

use crate::gpu::{Gpu, GpuError};
use crate::spline::occupancy::Occupancy;

/// The pyramid of an [`Occupancy`] as a texture.
#[derive(Debug)]
pub struct OccupancyTexture {
    pub view: wgpu::TextureView,
    pub sampler: wgpu::Sampler,
    /// Cells of the first level, and their size in the world.
    pub cells: [usize; 3],
    pub cell: f64,
}

impl OccupancyTexture {
    /// Uploads all levels.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] or [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, occupancy: &Occupancy) -> Result<Self, GpuError> {
        let cells = occupancy.dims();
        let texture = texture(gpu, cells, occupancy.levels().len() as u32)?;
        for (level, values) in (0..).zip(occupancy.levels()) {
            let [width, height, depth_or_array_layers] = cells.map(|n| n as u32 >> level);
            gpu.queue.write_texture(
                wgpu::TexelCopyTextureInfo { mip_level: level, ..texture.as_image_copy() },
                values,
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width), rows_per_image: Some(height) },
                wgpu::Extent3d { width, height, depth_or_array_layers },
            );
        }
        Ok(Self::of(gpu, &texture, cells, occupancy.cell()))
    }

    /// Nothing anywhere.
    ///
    /// # Errors
    /// As [`OccupancyTexture::new`].
    pub fn empty(gpu: &Gpu) -> Result<Self, GpuError> {
        Ok(Self::of(gpu, &texture(gpu, [1; 3], 1)?, [1; 3], 1.0))
    }

    fn of(gpu: &Gpu, texture: &wgpu::Texture, cells: [usize; 3], cell: f64) -> Self {
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("occupancy"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        });
        Self { view: texture.create_view(&wgpu::TextureViewDescriptor::default()), sampler, cells, cell }
    }
}

fn texture(gpu: &Gpu, cells: [usize; 3], levels: u32) -> Result<wgpu::Texture, GpuError> {
    let [width, height, depth_or_array_layers] =
        crate::gpu::volume::texture_size(cells, gpu.limits().max_texture_dimension_3d)?;
    gpu.allocate("occupancy", 2 * cells.iter().map(|n| *n as u64).product::<u64>(), || {
        gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("occupancy"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers },
            mip_level_count: levels,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D3,
            format: wgpu::TextureFormat::R8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        })
    })
}

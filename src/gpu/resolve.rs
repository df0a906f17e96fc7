//! From the accumulated picture to pixels, and back to the host.

use super::bind::{cleared, fullscreen};
use super::layout::padded_row;
use super::slicing::SliceTarget;
use super::{Gpu, GpuError, shader};
use crate::render::Picture;

/// Blends the accumulated picture over the background and encodes it.
#[derive(Debug)]
pub struct ResolvePass {
    pub(super) pass_layout: wgpu::BindGroupLayout,
    /// For shading, and for maximum intensity.
    pipelines: [wgpu::RenderPipeline; 2],
}

/// The pixels of one size of picture, with the buffer that they are read back through.
#[derive(Debug)]
pub struct PixelTarget {
    /// The accumulated picture.
    pub(super) group: wgpu::BindGroup,
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    readback: wgpu::Buffer,
}

impl ResolvePass {
    /// # Errors
    /// [`GpuError::Refusal`].
    pub fn new(gpu: &Gpu, frame: &wgpu::BindGroupLayout) -> Result<Self, GpuError> {
        let pass_layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("resolve"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::FRAGMENT,
                ty: wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Float { filterable: false },
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
                count: None,
            }],
        });
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("resolve"),
            bind_group_layouts: &[Some(frame), None, Some(&pass_layout)],
            immediate_size: 0,
        });
        let pipelines = gpu.allocate("a pipeline", 0, || [false, true].map(|mip| pipeline(gpu, &layout, mip)))?;
        Ok(Self { pass_layout, pipelines })
    }

    /// # Errors
    /// [`GpuError::OutOfMemory`].
    pub fn target(&self, gpu: &Gpu, source: &SliceTarget, width: u32, height: u32) -> Result<PixelTarget, GpuError> {
        let bytes = u64::from(padded_row(width, 4)) * u64::from(height);
        gpu.allocate("a picture", 2 * bytes, || {
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("pixels"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba8Unorm,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            let readback = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("pixels"),
                size: bytes,
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            });
            let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("resolve"),
                layout: &self.pass_layout,
                entries: &[wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&source.color),
                }],
            });
            PixelTarget { group, view: texture.create_view(&wgpu::TextureViewDescriptor::default()), texture, readback }
        })
    }

    /// Records the pass and the copy to the host.
    pub fn run(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        target: &PixelTarget,
        frame: &wgpu::BindGroup,
        mip: bool,
        timestamps: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("resolve"),
            color_attachments: &[Some(cleared(&target.view))],
            timestamp_writes: timestamps,
            ..Default::default()
        });
        pass.set_pipeline(&self.pipelines[usize::from(mip)]);
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(2, &target.group, &[]);
        pass.draw(0..3, 0..1);
        drop(pass);
        encoder.copy_texture_to_buffer(
            target.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &target.readback,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded_row(target.texture.width(), 4)),
                    rows_per_image: None,
                },
            },
            target.texture.size(),
        );
    }
}

impl PixelTarget {
    pub fn width(&self) -> u32 {
        self.texture.width()
    }

    pub fn height(&self) -> u32 {
        self.texture.height()
    }

    /// Waits for what was submitted and reads the pixels.
    ///
    /// # Errors
    /// What the device reported.
    pub fn read(&self, gpu: &Gpu) -> Result<Picture, GpuError> {
        let (width, height) = (self.width(), self.height());
        gpu.read(&self.readback, |bytes| {
            let rows = bytes.chunks_exact(padded_row(width, 4) as usize);
            let pixels = rows.flat_map(|row| row[..width as usize * 4].as_chunks::<4>().0).copied().collect();
            Picture { width, height, pixels }
        })
    }
}

fn pipeline(gpu: &Gpu, layout: &wgpu::PipelineLayout, mip: bool) -> wgpu::RenderPipeline {
    let target = wgpu::TextureFormat::Rgba8Unorm.into();
    fullscreen(gpu, "resolve", layout, (shader::resolve(mip), "resolve_main"), Some(target), None)
}

//! Translucent surfaces: layer behind layer, put together from the front.

use crate::gpu::bind::{UNDER, cleared, fullscreen, group, group_layout};
use crate::gpu::slicing::{ACCUMULATED, SliceTarget};
use crate::gpu::{Gpu, GpuError, shader};

/// What layers are drawn to, in turns.
#[derive(Debug)]
pub struct Layers {
    pub targets: [SliceTarget; 2],
    groups: [wgpu::BindGroup; 2],
    size: [u32; 2],
    pipeline: wgpu::RenderPipeline,
}

/// Most layers of a picture. Surfaces that a ray meets more often are not complete behind the last.
const MOST: u32 = 16;

/// How far behind a layer the next begins, in voxels: more than what depths of 32 bits are rounded by.
pub const BEHIND: f32 = 1e-3;

/// Layers of a picture of so many surfaces: none of what is solid all through.
pub fn count(surfaces: u32, solid: bool) -> u32 {
    if solid { 0 } else { (4 * surfaces).min(MOST) }
}

impl Layers {
    /// # Errors
    /// [`GpuError::OutOfMemory`] or [`GpuError::Refusal`].
    pub fn new(gpu: &Gpu, width: u32, height: u32) -> Result<Self, GpuError> {
        let targets = [SliceTarget::new(gpu, width, height)?, SliceTarget::new(gpu, width, height)?];
        let source = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: false },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let layout = group_layout(gpu, "layer", wgpu::ShaderStages::FRAGMENT, &[source]);
        let groups = targets.each_ref().map(|t| {
            let view = wgpu::BindingResource::TextureView(&t.color);
            group(gpu, "layer", &layout, &[view])
        });
        let pipeline = gpu.allocate("a pipeline", 0, || pipeline(gpu, &layout))?;
        Ok(Self { targets, groups, size: [width, height], pipeline })
    }

    pub fn fits(&self, width: u32, height: u32) -> bool {
        self.size == [width, height]
    }

    /// Records that a layer goes behind what was put together; the first one begins anew.
    pub fn add(&self, encoder: &mut wgpu::CommandEncoder, layer: u32, sum: &SliceTarget) {
        let mut attachment = cleared(&sum.color);
        if layer > 0 {
            attachment.ops.load = wgpu::LoadOp::Load;
        }
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("layer"),
            color_attachments: &[Some(attachment)],
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.groups[layer as usize % 2], &[]);
        pass.draw(0..3, 0..1);
    }
}

/// A depth of zero wherever one looks.
///
/// # Errors
/// [`GpuError::OutOfMemory`].
pub fn nothing_before(gpu: &Gpu) -> Result<wgpu::TextureView, GpuError> {
    Ok(SliceTarget::new(gpu, 1, 1)?.depth)
}

fn pipeline(gpu: &Gpu, layout: &wgpu::BindGroupLayout) -> wgpu::RenderPipeline {
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("layer"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    let target = wgpu::ColorTargetState { format: ACCUMULATED, blend: Some(UNDER), write_mask: wgpu::ColorWrites::ALL };
    fullscreen(gpu, "layer", &layout, (shader::spline_layer(), "layer_main"), Some(target), None)
}

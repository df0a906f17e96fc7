//! Marks pixels behind which nothing can be seen.
//!
//! Blending cannot stop a ray. But slices that are drawn from the nearest on may be drawn in parts, and between two parts
//! the pixels that let through less than [`FINISHED`](crate::render::FINISHED) get the nearest depth there is: the fragments
//! of the parts behind then fail the depth test before they are shaded.

use super::bind::fullscreen;
use super::slicing::{DEPTH, SliceTarget};
use super::{Gpu, GpuError, shader};

/// A pass over the whole picture.
#[derive(Debug)]
pub struct OpaquePass {
    pipeline: wgpu::RenderPipeline,
}

impl OpaquePass {
    /// `accumulated`: layout of the group that holds the picture so far.
    ///
    /// # Errors
    /// [`GpuError::Refusal`].
    pub fn new(gpu: &Gpu, accumulated: &wgpu::BindGroupLayout) -> Result<Self, GpuError> {
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("opaque"),
            bind_group_layouts: &[None, None, Some(accumulated)],
            immediate_size: 0,
        });
        let depth = wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Always),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        };
        let pipeline = gpu.allocate("a pipeline", 0, || {
            fullscreen(gpu, "opaque", &layout, (shader::opaque(), "opaque_main"), None, Some(depth))
        })?;
        Ok(Self { pipeline })
    }

    /// Records the pass over what was drawn into the target, which `accumulated` holds.
    pub fn run(&self, encoder: &mut wgpu::CommandEncoder, target: &SliceTarget, accumulated: &wgpu::BindGroup) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("opaque"),
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(2, accumulated, &[]);
        pass.draw(0..3, 0..1);
    }
}

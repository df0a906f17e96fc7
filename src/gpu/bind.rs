//! What passes need of wgpu in the same words: layouts of bind groups, bind groups, compute pipelines, cleared targets.

use super::{Gpu, GpuError};

pub fn buffer_type(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

/// A 3D texture that is loaded, not filtered.
pub const SAMPLES: wgpu::BindingType = wgpu::BindingType::Texture {
    sample_type: wgpu::TextureSampleType::Float { filterable: false },
    view_dimension: wgpu::TextureViewDimension::D3,
    multisampled: false,
};

/// A layout with bindings from 0 on.
pub fn group_layout(
    gpu: &Gpu,
    label: &str,
    visibility: wgpu::ShaderStages,
    types: &[wgpu::BindingType],
) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = (0..)
        .zip(types)
        .map(|(binding, ty)| wgpu::BindGroupLayoutEntry { binding, visibility, ty: *ty, count: None })
        .collect();
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

/// A group with bindings from 0 on.
pub fn group(gpu: &Gpu, label: &str, layout: &wgpu::BindGroupLayout, all: &[wgpu::BindingResource]) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(all)
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
}

/// Pipelines of the entry points of a shader.
///
/// # Errors
/// [`GpuError::Refusal`].
pub fn compute_pipelines<const N: usize>(
    gpu: &Gpu,
    source: &str,
    entries: [&'static str; N],
    groups: &[Option<&wgpu::BindGroupLayout>],
) -> Result<[wgpu::ComputePipeline; N], GpuError> {
    let label = entries.first().copied();
    gpu.allocate("a pipeline", 0, || {
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: groups,
            immediate_size: 0,
        });
        entries.map(|entry| {
            gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        })
    })
}

/// A target that starts transparent and is kept.
pub fn cleared(view: &wgpu::TextureView) -> wgpu::RenderPassColorAttachment<'_> {
    wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store },
    }
}

/// Blends what lies behind under what is there, both premultiplied.
pub const UNDER: wgpu::BlendState = {
    let part = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::OneMinusDstAlpha,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Add,
    };
    wgpu::BlendState { color: part, alpha: part }
};

/// A pipeline that draws one triangle over the whole of a target, of colours or depths.
pub fn fullscreen(
    gpu: &Gpu,
    label: &str,
    layout: &wgpu::PipelineLayout,
    (source, entry): (String, &str),
    target: Option<wgpu::ColorTargetState>,
    depth: Option<wgpu::DepthStencilState>,
) -> wgpu::RenderPipeline {
    let targets: Vec<_> = target.into_iter().map(Some).collect();
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex_main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: depth,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// Depths that start far away and are not kept.
pub fn cleared_depth(view: &wgpu::TextureView) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Discard }),
        stencil_ops: None,
    }
}

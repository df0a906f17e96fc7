//! The slices, drawn in one call: back to front with premultiplied `over` (Volume), nearest by depth (Iso), or the largest
//! value (Mip).

use std::collections::HashMap;
use std::ops::Range;

use rayon::prelude::*;

use super::bind::{cleared, cleared_depth};
use super::cull::Culled;
use super::layout::grown;
use super::shader::{Mode, Variant};
use super::timing::Counter;
use super::{Gpu, GpuError};
use crate::render::{SliceGeometry, SliceVertex};

/// The accumulated picture: linear light, premultiplied. 16-bit floats hold the sum of many faint slices without banding.
pub const ACCUMULATED: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
pub(super) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Slice geometry on the device. The buffers grow and are used again.
#[derive(Debug)]
pub struct GeometryBuffers {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    /// Index range of each slice, back to front, without gaps.
    slices: Vec<Range<u32>>,
}

impl GeometryBuffers {
    /// # Errors
    /// [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        Ok(Self {
            vertices: buffer(gpu, "slice vertices", 1 << 16, wgpu::BufferUsages::VERTEX)?,
            indices: buffer(gpu, "slice indices", 1 << 16, wgpu::BufferUsages::INDEX)?,
            slices: Vec::new(),
        })
    }

    /// Replaces the geometry by what is left of it: `culled` in place of the geometry's own indices.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] or [`GpuError::OutOfMemory`].
    pub fn upload(&mut self, gpu: &Gpu, geometry: &SliceGeometry, culled: Option<&Culled>) -> Result<(), GpuError> {
        let added = culled.map_or(&[][..], |c| &c.added);
        let parts = [bytemuck::cast_slice(&geometry.vertices), bytemuck::cast_slice(added)];
        fill(gpu, "slice vertices", &mut self.vertices, parts)?;
        let (indices, slices) = culled.map_or((&geometry.indices, &geometry.slices), |c| (&c.indices, &c.slices));
        fill(gpu, "slice indices", &mut self.indices, [bytemuck::cast_slice(indices), &[]])?;
        self.slices.clone_from(slices);
        Ok(())
    }
}

/// The Jacobian, if it is the same at every vertex: nothing is deformed.
pub fn common_jacobian(geometry: &SliceGeometry) -> Option<[f32; 9]> {
    let first = geometry.vertices.first()?.jacobian;
    geometry.vertices.par_iter().with_min_len(1 << 14).all(|v| v.jacobian == first).then_some(first)
}

pub(super) fn buffer(
    gpu: &Gpu,
    what: &'static str,
    size: u64,
    usage: wgpu::BufferUsages,
) -> Result<wgpu::Buffer, GpuError> {
    gpu.allocate(what, size, || {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    })
}

/// Writes both parts of `data` one after the other, into a new buffer if it does not fit.
pub(super) fn fill(gpu: &Gpu, what: &'static str, old: &mut wgpu::Buffer, data: [&[u8]; 2]) -> Result<(), GpuError> {
    let (need, limit) = ((data[0].len() + data[1].len()) as u64, gpu.limits().max_buffer_size);
    if need > limit {
        return Err(GpuError::TooLarge { what, size: format!("{need} bytes"), limit: format!("{limit} bytes") });
    }
    let size = grown(old.size(), need, limit & !255);
    if size != old.size() {
        let usage = old.usage();
        // the old one goes first, or both would be held at once
        old.destroy();
        *old = buffer(gpu, what, size, usage)?;
    }
    gpu.queue.write_buffer(old, 0, data[0]);
    gpu.queue.write_buffer(old, data[0].len() as u64, data[1]);
    Ok(())
}

/// Textures that the slices are drawn into.
#[derive(Debug)]
pub struct SliceTarget {
    pub(crate) color: wgpu::TextureView,
    pub(super) depth: wgpu::TextureView,
}

impl SliceTarget {
    /// # Errors
    /// [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, width: u32, height: u32) -> Result<Self, GpuError> {
        Self::of(gpu, width, height, ACCUMULATED)
    }

    /// The same with another format of colours.
    ///
    /// # Errors
    /// As [`SliceTarget::new`].
    pub fn of(gpu: &Gpu, width: u32, height: u32, format: wgpu::TextureFormat) -> Result<Self, GpuError> {
        let texel = format.block_copy_size(None).unwrap_or(16) + 4;
        let texture = |label, format, usage| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            })
        };
        gpu.allocate("a picture", u64::from(width) * u64::from(height) * u64::from(texel), || {
            let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC;
            let color = texture("accumulated", format, usage);
            let depth = texture("depth", DEPTH, wgpu::TextureUsages::TEXTURE_BINDING);
            Self {
                color: color.create_view(&wgpu::TextureViewDescriptor::default()),
                depth: depth.create_view(&wgpu::TextureViewDescriptor::default()),
            }
        })
    }
}

/// Draws slice geometry.
#[derive(Debug)]
pub struct SlicingPass {
    layout: wgpu::PipelineLayout,
    /// With the backward map.
    exact_layout: wgpu::PipelineLayout,
    pipelines: HashMap<Variant, wgpu::RenderPipeline>,
}

impl SlicingPass {
    pub fn new(gpu: &Gpu, groups: [&wgpu::BindGroupLayout; 3]) -> Self {
        let layout = |count: usize| {
            gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("slicing"),
                bind_group_layouts: &groups.map(Some)[..count],
                immediate_size: 0,
            })
        };
        Self { layout: layout(2), exact_layout: layout(3), pipelines: HashMap::new() }
    }

    /// Compiles the pipeline of a variant the first time it is used.
    ///
    /// # Errors
    /// [`GpuError::Refusal`].
    pub fn prepare(&mut self, gpu: &Gpu, variant: Variant) -> Result<(), GpuError> {
        if !self.pipelines.contains_key(&variant) {
            let pipeline = gpu.allocate("a pipeline", 0, || {
                pipeline(gpu, if variant.exact { &self.exact_layout } else { &self.layout }, variant)
            })?;
            self.pipelines.insert(variant, pipeline);
        }
        Ok(())
    }

    /// Records the draw call of a prepared variant with its bind groups; without one the target is only cleared.
    pub fn run(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        target: &SliceTarget,
        variant: Option<(Variant, [&wgpu::BindGroup; 3])>,
        geometry: &GeometryBuffers,
        timestamps: Option<wgpu::RenderPassTimestampWrites<'_>>,
        counter: Option<&Counter>,
    ) {
        let iso = variant.is_some_and(|(v, _)| v.mode == Mode::Iso);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("slicing"),
            color_attachments: &[Some(cleared(&target.color))],
            depth_stencil_attachment: iso.then(|| cleared_depth(&target.depth)),
            timestamp_writes: timestamps,
            ..Default::default()
        });
        if let Some(counter) = counter {
            counter.begin(&mut pass);
        }
        self.draw(&mut pass, variant, geometry);
        if counter.is_some() {
            pass.end_pipeline_statistics_query();
        }
    }

    fn draw(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        variant: Option<(Variant, [&wgpu::BindGroup; 3])>,
        geometry: &GeometryBuffers,
    ) {
        let Some((variant, groups)) = variant else { return };
        let Some(pipeline) = self.pipelines.get(&variant) else { return };
        if let (Some(far), Some(near)) = (geometry.slices.first(), geometry.slices.last()) {
            pass.set_pipeline(pipeline);
            let count = if variant.exact { 3 } else { 2 };
            groups.into_iter().take(count).zip(0..).for_each(|(group, i)| pass.set_bind_group(i, group, &[]));
            pass.set_vertex_buffer(0, geometry.vertices.slice(..));
            pass.set_index_buffer(geometry.indices.slice(..), wgpu::IndexFormat::Uint32);
            if variant.mode == Mode::Iso {
                // nearest first: what lies behind fails the depth test before it is shaded
                geometry.slices.iter().rev().for_each(|slice| pass.draw_indexed(slice.clone(), 0, 0..1));
            } else {
                pass.draw_indexed(far.start..near.end, 0, 0..1);
            }
        }
    }
}

fn pipeline(gpu: &Gpu, layout: &wgpu::PipelineLayout, variant: Variant) -> wgpu::RenderPipeline {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("slicing"),
        source: wgpu::ShaderSource::Wgsl(variant.source().into()),
    });
    let largest = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Max,
    };
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("slicing"),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex_main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: size_of::<SliceVertex>() as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &wgpu::vertex_attr_array![
                    0 => Float32x3, 1 => Float32x3, 2 => Float32x3, 3 => Float32x3, 4 => Float32x3, 5 => Float32x3
                ],
            })],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: (variant.mode == Mode::Iso).then(|| wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(variant.mode.entry()),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(wgpu::ColorTargetState {
                format: ACCUMULATED,
                blend: match variant.mode {
                    Mode::Volume => Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                    Mode::Iso => None,
                    Mode::Mip => Some(wgpu::BlendState { color: largest, alpha: largest }),
                },
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}

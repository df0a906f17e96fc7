//! The slices, nearest first: each blended under what is there (Volume), nearest by depth (Iso), or the largest value (Mip).

use std::collections::HashMap;
use std::ops::Range;

use rayon::prelude::*;

use super::bind::{UNDER, cleared, cleared_depth};
use super::cull::Culled;
use super::layout::grown;
use super::opaque::OpaquePass;
use super::shader::{Mode, Variant};
use super::timing::{Counter, Timer};
use super::{Gpu, GpuError};
use crate::render::{SliceGeometry, SliceVertex};

/// The accumulated picture: linear light, premultiplied. 16-bit floats hold the sum of many faint slices without banding.
pub const ACCUMULATED: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
pub(super) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Parts that slices are drawn in, so that what lies behind opaque pixels can be left out.
pub(super) const PARTS: u32 = 6;

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

    /// Records the draw calls of a prepared variant with its bind groups, nearest slices first; without one the target is only
    /// cleared. `opaque` marks pixels between parts of the slices, given the accumulated picture. Returns the number of passes
    /// that were counted.
    #[allow(clippy::too_many_arguments)]
    pub fn run(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        target: &SliceTarget,
        variant: Option<(Variant, [&wgpu::BindGroup; 3])>,
        geometry: &GeometryBuffers,
        opaque: Option<(&OpaquePass, &wgpu::BindGroup)>,
        timer: Option<&Timer>,
        counter: Option<&Counter>,
    ) -> u32 {
        let mode = variant.map(|(v, _)| v.mode);
        let opaque = opaque.filter(|_| mode == Some(Mode::Volume));
        let parts = parts(&geometry.slices, if opaque.is_some() { PARTS } else { 1 });
        let last = parts.len() - 1;
        for (i, part) in parts.iter().enumerate() {
            let mut color = cleared(&target.color);
            let mut depth = cleared_depth(&target.depth);
            if i > 0 {
                color.ops.load = wgpu::LoadOp::Load;
                depth.depth_ops = Some(wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store });
            } else if last > 0 {
                depth.depth_ops = depth.depth_ops.map(|ops| wgpu::Operations { store: wgpu::StoreOp::Store, ..ops });
            }
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("slicing"),
                color_attachments: &[Some(color)],
                depth_stencil_attachment: (mode.is_some_and(|m| m != Mode::Mip)).then_some(depth),
                timestamp_writes: timer.and_then(|t| t.part(0, i == 0, i == last)),
                ..Default::default()
            });
            if let Some(counter) = counter {
                counter.begin(&mut pass, i as u32);
            }
            self.draw(&mut pass, variant, geometry, part);
            if counter.is_some() {
                pass.end_pipeline_statistics_query();
            }
            drop(pass);
            if let (Some((opaque, accumulated)), true) = (opaque, i < last) {
                opaque.run(encoder, target, accumulated);
            }
        }
        parts.len() as u32
    }

    fn draw(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        variant: Option<(Variant, [&wgpu::BindGroup; 3])>,
        geometry: &GeometryBuffers,
        slices: &[Range<u32>],
    ) {
        let Some((variant, groups)) = variant else { return };
        let Some(pipeline) = self.pipelines.get(&variant) else { return };
        pass.set_pipeline(pipeline);
        let count = if variant.exact { 3 } else { 2 };
        groups.into_iter().take(count).zip(0..).for_each(|(group, i)| pass.set_bind_group(i, group, &[]));
        pass.set_vertex_buffer(0, geometry.vertices.slice(..));
        pass.set_index_buffer(geometry.indices.slice(..), wgpu::IndexFormat::Uint32);
        for slice in slices.iter().rev().filter(|s| !s.is_empty()) {
            pass.draw_indexed(slice.clone(), 0, 0..1);
        }
    }
}

/// Slices (back to front) in up to `count` parts of about as many triangles, the nearest part first; one part at least.
fn parts(slices: &[Range<u32>], count: u32) -> Vec<&[Range<u32>]> {
    let (first, end) = (slices.first().map_or(0, |s| s.start), slices.last().map_or(0, |s| s.end));
    let mut rest = slices;
    let mut parts: Vec<_> = (1..=count)
        .map(|k| {
            let behind = first + (u64::from(end - first) * u64::from(count - k) / u64::from(count)) as u32;
            let (far, near) = rest.split_at(rest.partition_point(|s| s.end <= behind));
            rest = far;
            near
        })
        .filter(|part| part.iter().any(|s| !s.is_empty()))
        .collect();
    if parts.is_empty() {
        parts.push(&[]);
    }
    parts
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
        depth_stencil: (variant.mode != Mode::Mip).then(|| wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(variant.mode == Mode::Iso),
            // the farthest slice may lie at the depth that stands for nothing
            depth_compare: Some(wgpu::CompareFunction::LessEqual),
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
                    Mode::Volume => Some(UNDER),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_hold_every_slice_once_nearest_first() {
        let many: Vec<Range<u32>> = (0..50)
            .scan(0, |at, i| {
                let start = *at;
                *at += 3 * (i * 7 % 11);
                Some(start..*at)
            })
            .collect();
        for count in [1, 2, 7, 12, 100] {
            let parts = parts(&many, count);
            assert!(!parts.is_empty() && parts.len() <= count as usize);
            let order: Vec<_> = parts.iter().flat_map(|p| p.iter().rev()).filter(|s| !s.is_empty()).collect();
            assert!(order.iter().eq(many.iter().rev().filter(|s| !s.is_empty()).collect::<Vec<_>>().iter()));
            let largest = parts.iter().map(|p| p.iter().map(|s| s.len()).sum::<usize>()).max();
            let all = many.last().map_or(0, |s| s.end as usize);
            assert!(largest <= Some(all / count as usize + 33), "{count}");
        }
        assert_eq!(parts(&[], 8), [&[] as &[Range<u32>]]);
        assert_eq!(parts(&[0..0, 0..0], 8).len(), 1);
    }
}

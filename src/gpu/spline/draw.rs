//! The tetrahedra of a list, drawn, and caps.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::Coefficients;
use super::classify::{DRAW, Lists, Samples};
use super::shade::OccupancyTexture;
use super::size::{BATCH, KINDS};
use crate::gpu::bind::{SAMPLES, buffer_type, cleared, cleared_depth, group, group_layout};
use crate::gpu::layout::SplineViewUniform;
use crate::gpu::shader::SplinePaint;
use crate::gpu::slicing::{ACCUMULATED, DEPTH, SliceTarget};
use crate::gpu::timing::Counter;
use crate::gpu::{Gpu, GpuError, shader};

/// What fragments write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Target {
    Picture,
    /// Normals and depths.
    Probe,
}

impl Target {
    pub fn format(self) -> wgpu::TextureFormat {
        match self {
            Self::Picture => ACCUMULATED,
            Self::Probe => wgpu::TextureFormat::Rgba32Float,
        }
    }

    /// A probe has no colours.
    fn paint(self, paint: SplinePaint) -> SplinePaint {
        match self {
            Self::Picture => paint,
            Self::Probe => SplinePaint::default(),
        }
    }

    fn entry(self) -> &'static str {
        match self {
            Self::Picture => "picture_main",
            Self::Probe => "probe_main",
        }
    }
}

/// Draws lists of tetrahedra.
#[derive(Debug)]
pub struct Drawer {
    view_layout: wgpu::BindGroupLayout,
    layout: wgpu::PipelineLayout,
    indices: wgpu::Buffer,
    /// One for each surface.
    uniforms: Vec<wgpu::Buffer>,
    /// Whether depths are tested before fragments are shaded.
    early: bool,
    /// Of the views that were set.
    paint: SplinePaint,
    /// Made when first used.
    tets: HashMap<(Target, SplinePaint, Coefficients), wgpu::RenderPipeline>,
    caps: HashMap<(Target, SplinePaint), wgpu::RenderPipeline>,
}

/// Faces of a tetrahedron, all turned the same way.
const FACES: [u16; 12] = [0, 1, 2, 2, 1, 3, 2, 3, 0, 0, 3, 1];

impl Drawer {
    pub fn new(gpu: &Gpu, frame: &wgpu::BindGroupLayout) -> Result<Self, GpuError> {
        let read = buffer_type(wgpu::BufferBindingType::Storage { read_only: true });
        let types = [
            buffer_type(wgpu::BufferBindingType::Uniform),
            SAMPLES,
            read,
            read,
            read,
            wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Depth,
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: false,
            },
            wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: true },
                view_dimension: wgpu::TextureViewDimension::D3,
                multisampled: false,
            },
            wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
        ];
        let view_layout = group_layout(gpu, "spline view", wgpu::ShaderStages::VERTEX_FRAGMENT, &types);
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("spline"),
            bind_group_layouts: &[Some(frame), Some(&view_layout)],
            immediate_size: 0,
        });
        let indices: Vec<u16> = (0..BATCH as u16).flat_map(|tet| FACES.map(|corner| 4 * tet + corner)).collect();
        let bytes = bytemuck::cast_slice(&indices);
        let indices = gpu.allocate("a spline's faces", bytes.len() as u64, || {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("spline faces"),
                size: bytes.len() as u64,
                usage: wgpu::BufferUsages::INDEX | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })?;
        gpu.queue.write_buffer(&indices, 0, bytes);
        Ok(Self {
            view_layout,
            layout,
            indices,
            uniforms: Vec::new(),
            early: gpu.capabilities().early_depth,
            paint: SplinePaint::default(),
            tets: HashMap::new(),
            caps: HashMap::new(),
        })
    }

    /// Hands the views of all surfaces to the device, which are painted alike.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`].
    pub fn set_views(&mut self, gpu: &Gpu, views: &[SplineViewUniform], paint: SplinePaint) -> Result<(), GpuError> {
        while self.uniforms.len() < views.len() {
            let size = size_of::<SplineViewUniform>() as u64;
            self.uniforms.push(gpu.allocate("a spline's view", size, || {
                gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("spline view"),
                    size,
                    usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                })
            })?);
        }
        for (buffer, view) in self.uniforms.iter().zip(views) {
            gpu.queue.write_buffer(buffer, 0, bytemuck::bytes_of(view));
        }
        self.paint = paint;
        Ok(())
    }

    /// Compiles what the views that were set need and has not been used before.
    ///
    /// # Errors
    /// [`GpuError::Refusal`].
    pub fn prepare(&mut self, gpu: &Gpu, target: Target, coefficients: Coefficients) -> Result<(), GpuError> {
        let paint = target.paint(self.paint);
        if let Entry::Vacant(tets) = self.tets.entry((target, paint, coefficients)) {
            let source = shader::spline_draw(coefficients, paint, self.early);
            tets.insert(gpu.allocate("a pipeline", 0, || {
                // back faces: those in front may lie behind the eye
                pipeline(gpu, &self.layout, &source, target, Some(wgpu::Face::Front))
            })?);
        }
        if let Entry::Vacant(caps) = self.caps.entry((target, paint)) {
            let source = shader::spline_cap(paint);
            caps.insert(gpu.allocate("a pipeline", 0, || pipeline(gpu, &self.layout, &source, target, None))?);
        }
        Ok(())
    }

    /// Records the draws of all kinds of all surfaces, after their caps if there may be any. The surfaces are those whose views
    /// were set, the one of the largest isovalue first, so that where caps meet it shows.
    pub fn run(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        (kind, target): (Target, &SliceTarget),
        scene: &Scene<'_>,
        surfaces: &[(&Lists, bool)],
        counter: Option<&Counter>,
    ) {
        let groups: Vec<_> = surfaces
            .iter()
            .zip(&self.uniforms)
            .map(|((lists, _), uniform)| {
                let bindings = [
                    uniform.as_entire_binding(),
                    wgpu::BindingResource::TextureView(&scene.samples.view),
                    lists.tets.as_entire_binding(),
                    lists.store.as_entire_binding(),
                    lists.kinds.as_entire_binding(),
                    wgpu::BindingResource::TextureView(scene.before),
                    wgpu::BindingResource::TextureView(&scene.occupancy.view),
                    wgpu::BindingResource::Sampler(&scene.occupancy.sampler),
                ];
                group(gpu, "spline view", &self.view_layout, &bindings)
            })
            .collect();
        let mut depth = cleared_depth(&target.depth);
        if let (true, Some(ops)) = (scene.layered, &mut depth.depth_ops) {
            ops.store = wgpu::StoreOp::Store;
        }
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("spline"),
            color_attachments: &[Some(cleared(&target.color))],
            depth_stencil_attachment: Some(depth),
            ..Default::default()
        });
        if let Some(counter) = counter {
            counter.begin(&mut pass, 0);
        }
        pass.set_bind_group(0, scene.frame, &[]);
        let paint = kind.paint(self.paint);
        if let Some(pipeline) = self.caps.get(&(kind, paint)) {
            pass.set_pipeline(pipeline);
            for ((_, caps), group) in surfaces.iter().zip(&groups) {
                if *caps {
                    pass.set_bind_group(1, group, &[]);
                    pass.draw(0..3, 0..1);
                }
            }
        }
        for ((lists, _), group) in surfaces.iter().zip(&groups) {
            if let Some(pipeline) = self.tets.get(&(kind, paint, lists.room.coefficients)) {
                pass.set_bind_group(1, group, &[]);
                pass.set_pipeline(pipeline);
                pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint16);
                for kind in 0..KINDS {
                    pass.draw_indexed_indirect(&lists.draws, kind * DRAW);
                }
            }
        }
        if counter.is_some() {
            pass.end_pipeline_statistics_query();
        }
    }
}

/// What all surfaces of a picture share.
pub struct Scene<'a> {
    pub frame: &'a wgpu::BindGroup,
    pub samples: &'a Samples,
    /// Depths of the layer before.
    pub before: &'a wgpu::TextureView,
    /// Whether a layer follows, which needs the depths.
    pub layered: bool,
    pub occupancy: &'a OccupancyTexture,
}

fn pipeline(
    gpu: &Gpu,
    layout: &wgpu::PipelineLayout,
    source: &str,
    target: Target,
    cull_mode: Option<wgpu::Face>,
) -> wgpu::RenderPipeline {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("spline"),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("spline"),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex_main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState { cull_mode, ..wgpu::PrimitiveState::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(target.entry()),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(target.format().into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

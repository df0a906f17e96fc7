//! The tetrahedra of a list, drawn, and caps.

use super::classify::{DRAW, Lists, Samples};
use super::size::{BATCH, KINDS};
use crate::gpu::bind::{SAMPLES, buffer_type, cleared, cleared_depth, group, group_layout};
use crate::gpu::layout::SplineViewUniform;
use crate::gpu::slicing::{ACCUMULATED, DEPTH, SliceTarget};
use crate::gpu::timing::Counter;
use crate::gpu::{Gpu, GpuError, shader};

/// What fragments write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
    uniform: wgpu::Buffer,
    /// By target, then without and with stored coefficients; made when first used.
    tets: [[Option<wgpu::RenderPipeline>; 2]; 2],
    caps: [Option<wgpu::RenderPipeline>; 2],
}

/// Faces of a tetrahedron, all turned the same way.
const FACES: [u16; 12] = [0, 1, 2, 2, 1, 3, 2, 3, 0, 0, 3, 1];

impl Drawer {
    pub fn new(gpu: &Gpu, frame: &wgpu::BindGroupLayout) -> Result<Self, GpuError> {
        let read = buffer_type(wgpu::BufferBindingType::Storage { read_only: true });
        let types = [buffer_type(wgpu::BufferBindingType::Uniform), SAMPLES, read, read, read];
        let view_layout = group_layout(gpu, "spline view", wgpu::ShaderStages::VERTEX_FRAGMENT, &types);
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("spline"),
            bind_group_layouts: &[Some(frame), Some(&view_layout)],
            immediate_size: 0,
        });
        let indices: Vec<u16> = (0..BATCH as u16).flat_map(|tet| FACES.map(|corner| 4 * tet + corner)).collect();
        let bytes = bytemuck::cast_slice(&indices);
        let buffer = |label, size, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let (indices, uniform) = gpu.allocate("a spline's view", bytes.len() as u64, || {
            let size = size_of::<SplineViewUniform>() as u64;
            (
                buffer("spline faces", bytes.len() as u64, wgpu::BufferUsages::INDEX),
                buffer("spline view", size, wgpu::BufferUsages::UNIFORM),
            )
        })?;
        gpu.queue.write_buffer(&indices, 0, bytes);
        Ok(Self { view_layout, layout, indices, uniform, tets: Default::default(), caps: Default::default() })
    }

    /// Compiles what has not been used before.
    ///
    /// # Errors
    /// [`GpuError::Refusal`].
    pub fn prepare(&mut self, gpu: &Gpu, target: Target, stored: bool) -> Result<(), GpuError> {
        let layout = &self.layout;
        let tets = &mut self.tets[target as usize][usize::from(stored)];
        if tets.is_none() {
            let source = shader::spline_draw(stored);
            *tets = Some(gpu.allocate("a pipeline", 0, || {
                // back faces: those in front may lie behind the eye
                pipeline(gpu, layout, &source, target, Some(wgpu::Face::Front))
            })?);
        }
        let caps = &mut self.caps[target as usize];
        if caps.is_none() {
            let source = shader::spline_cap();
            *caps = Some(gpu.allocate("a pipeline", 0, || pipeline(gpu, layout, &source, target, None))?);
        }
        Ok(())
    }

    /// Records the draws of all kinds, after the caps if there may be any.
    #[allow(clippy::too_many_arguments)]
    pub fn run(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        (kind, target): (Target, &SliceTarget),
        frame: &wgpu::BindGroup,
        (samples, lists): (&Samples, &Lists),
        view: &SplineViewUniform,
        caps: bool,
        counter: Option<&Counter>,
    ) {
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(view));
        let bindings = [
            self.uniform.as_entire_binding(),
            wgpu::BindingResource::TextureView(&samples.view),
            lists.tets.as_entire_binding(),
            lists.store.as_entire_binding(),
            lists.kinds.as_entire_binding(),
        ];
        let own = group(gpu, "spline view", &self.view_layout, &bindings);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("spline"),
            color_attachments: &[Some(cleared(&target.color))],
            depth_stencil_attachment: Some(cleared_depth(&target.depth)),
            ..Default::default()
        });
        if let Some(counter) = counter {
            counter.begin(&mut pass);
        }
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(1, &own, &[]);
        if caps && let Some(pipeline) = &self.caps[kind as usize] {
            pass.set_pipeline(pipeline);
            pass.draw(0..3, 0..1);
        }
        if let Some(pipeline) = &self.tets[kind as usize][usize::from(lists.room.stored)] {
            pass.set_pipeline(pipeline);
            pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint16);
            for kind in 0..KINDS {
                pass.draw_indexed_indirect(&lists.draws, kind * DRAW);
            }
        }
        if counter.is_some() {
            pass.end_pipeline_statistics_query();
        }
    }
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

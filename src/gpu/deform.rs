//! The stack of deformers on the device, for passes that evaluate the backward map themselves: bindings 0 to 2 of group 2.

use glam::{DAffine3, DMat3, DVec3};

use super::layout::{MapUniform, StepRecord};
use super::slicing::{buffer, fill};
use super::{Gpu, GpuError};
use crate::deform::{Deformer, Falloff, Stack};

/// Steps, newest first, and the coefficients of lattices, as `shaders/deform.wgsl` wants them; relative to `center`.
pub fn records(stack: &Stack, center: DVec3) -> (Vec<StepRecord>, Vec<[f32; 4]>) {
    let mut coefficients = Vec::new();
    let steps = stack.active().rev().map(|d| record(&d, center, &mut coefficients)).collect();
    (steps, coefficients)
}

fn record(deformer: &Deformer, center: DVec3, coefficients: &mut Vec<[f32; 4]>) -> StepRecord {
    let vector = |v: DVec3| v.as_vec3().to_array();
    match deformer {
        Deformer::Displacement(d) => {
            let (axes, e) = (d.axes(), d.extent());
            let axis = axes * DMat3::from_diagonal(DVec3::new(1.0 / e.u, 1.0 / e.v, 3.0 / e.length));
            StepRecord {
                center: vector(d.displaced() - center),
                vector: vector(d.vector()),
                axis_u: vector(axis.x_axis),
                axis_v: vector(axis.y_axis),
                axis_w: vector(axis.z_axis),
                ..StepRecord::default()
            }
        }
        Deformer::Grab(g) => {
            let (falloff, core) = profile(g.falloff());
            StepRecord {
                kind: 1,
                falloff,
                core,
                center: vector(g.displaced() - center),
                inverse_radius: (1.0 / g.radius()) as f32,
                vector: vector(g.vector()),
                ..StepRecord::default()
            }
        }
        Deformer::Brush(b) => {
            let (falloff, core) = profile(b.falloff());
            let (generator, turns) = b.generator();
            StepRecord {
                kind: if turns.is_some() { 4 } else { 3 },
                falloff,
                core,
                center: vector(b.center() - center),
                inverse_radius: (1.0 / b.radius()) as f32,
                turns: turns.unwrap_or(0.0) as f32,
                axis_u: vector(generator.x_axis),
                axis_v: vector(generator.y_axis),
                axis_w: vector(generator.z_axis),
                ..StepRecord::default()
            }
        }
        Deformer::Lattice(l) => {
            let first = coefficients.len();
            let dims = l.dims();
            let [mx, my, mz] = dims.map(|n| n + 4);
            coefficients.resize(first + mx * my * mz, [0.0; 4]);
            for ([i, j, k], h) in l.indices().zip(l.handles()) {
                let h = h.as_vec3();
                coefficients[first + ((k + 2) * my + j + 2) * mx + i + 2] = [h.x, h.y, h.z, 0.0];
            }
            let support = l.support();
            let axis = support.axes * DMat3::from_diagonal(l.step().recip());
            let cells = dims.map(|n| (n + 2) as f32);
            StepRecord {
                kind: 2,
                first: first as u32,
                center: vector(support.center - support.axes * support.half - center),
                axis_u: vector(axis.x_axis),
                cells_u: cells[0],
                axis_v: vector(axis.y_axis),
                cells_v: cells[1],
                axis_w: vector(axis.z_axis),
                cells_w: cells[2],
                ..StepRecord::default()
            }
        }
    }
}

/// Number of a falloff in the shader, and its core.
fn profile(falloff: Falloff) -> (u32, f32) {
    match falloff {
        Falloff::Smooth => (0, 0.0),
        Falloff::Spline => (1, 0.0),
        Falloff::Core(core) => (2, core as f32),
    }
}

/// The buffers behind the bindings. They grow and are used again.
#[derive(Debug)]
pub struct MapBuffers {
    pub(crate) uniform: wgpu::Buffer,
    pub(crate) steps: wgpu::Buffer,
    pub(crate) coefficients: wgpu::Buffer,
}

impl MapBuffers {
    /// # Errors
    /// [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        Ok(Self {
            uniform: buffer(gpu, "backward map", size_of::<MapUniform>() as u64, wgpu::BufferUsages::UNIFORM)?,
            steps: buffer(gpu, "deformers", 1 << 12, wgpu::BufferUsages::STORAGE)?,
            coefficients: buffer(gpu, "lattices", 1 << 12, wgpu::BufferUsages::STORAGE)?,
        })
    }

    /// Writes the stack about `center`, and where its undeformed world leads to.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] or [`GpuError::OutOfMemory`].
    pub fn write(
        &mut self,
        gpu: &Gpu,
        stack: &Stack,
        target_from_world: DAffine3,
        center: DVec3,
    ) -> Result<(), GpuError> {
        self.write_local(gpu, stack, target_from_world * DAffine3::from_translation(center), center)
    }

    /// The same, with the map from the world minus `center`.
    ///
    /// # Errors
    /// As [`MapBuffers::write`].
    pub fn write_local(
        &mut self,
        gpu: &Gpu,
        stack: &Stack,
        target_from_local: DAffine3,
        center: DVec3,
    ) -> Result<(), GpuError> {
        let (steps, coefficients) = records(stack, center);
        let uniform = MapUniform {
            target_from_local: glam::DMat4::from(target_from_local).as_mat4().to_cols_array_2d(),
            count: [steps.len() as u32, 0, 0, 0],
        };
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
        fill(gpu, "deformers", &mut self.steps, [bytemuck::cast_slice(&steps), &[]])?;
        fill(gpu, "lattices", &mut self.coefficients, [bytemuck::cast_slice(&coefficients), &[]])
    }

    /// The layout of the three bindings.
    pub fn layout(stages: wgpu::ShaderStages) -> [wgpu::BindGroupLayoutEntry; 3] {
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: stages,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let storage = wgpu::BufferBindingType::Storage { read_only: true };
        [entry(0, wgpu::BufferBindingType::Uniform), entry(1, storage), entry(2, storage)]
    }

    /// The three bindings.
    pub fn entries(&self) -> [wgpu::BindGroupEntry<'_>; 3] {
        [
            wgpu::BindGroupEntry { binding: 0, resource: self.uniform.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 1, resource: self.steps.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 2, resource: self.coefficients.as_entire_binding() },
        ]
    }
}

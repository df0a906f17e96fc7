use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;

use super::cull::cull;
use super::deform::MapBuffers;
use super::layout::ObjectUniform;
use super::opaque::OpaquePass;
use super::resolve::{PixelTarget, ResolvePass};
use super::shader::{Mode, Variant};
use super::slicing::{GeometryBuffers, SliceTarget, SlicingPass, common_jacobian};
use super::timing::{Counter, Timer, Timings};
use super::volume::VolumeTexture;
use super::{Gpu, GpuError};
use crate::deform::Stack;
use crate::render::{ClassTable, Field, Frame, Picture, SliceGeometry, TABLE_SIZE};

/// The volume on the device: bind group 1.
#[derive(Debug)]
struct Object {
    field: Field,
    uniform: wgpu::Buffer,
    group: wgpu::BindGroup,
}

/// The slices to draw.
#[derive(Debug)]
struct Slices {
    source: Arc<SliceGeometry>,
    /// The Jacobian, where it is the same everywhere.
    jacobian: Option<[f32; 9]>,
    /// `None` if the buffers are out of date.
    culled_for: Option<CulledFor>,
}

/// What slices were culled for.
#[derive(Debug, PartialEq)]
struct CulledFor {
    window: [f32; 4],
    clip_from_local: [[f32; 4]; 4],
    /// Width, height and mode.
    size: [u32; 3],
}

/// Draws slice geometry of a field on the GPU. Everything on the device is kept and used again between pictures.
#[derive(Debug)]
pub struct Renderer {
    gpu: Arc<Gpu>,
    frame_uniform: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    object_layout: wgpu::BindGroupLayout,
    sampler: wgpu::Sampler,
    table_texture: wgpu::Texture,
    table: Option<Arc<ClassTable>>,
    object: Option<Object>,
    slices: Option<Slices>,
    culling: bool,
    stopping: bool,
    map_layout: wgpu::BindGroupLayout,
    map: MapBuffers,
    map_group: wgpu::BindGroup,
    /// The stack that is evaluated per fragment, if it is, and the centre it was uploaded for.
    exact: Option<(Stack, Option<DVec3>)>,
    geometry: GeometryBuffers,
    slicing: SlicingPass,
    opaque: OpaquePass,
    resolve: ResolvePass,
    targets: Option<(SliceTarget, PixelTarget)>,
    timer: Option<Timer>,
    counter: Option<Counter>,
    fragments: Option<u64>,
    timings: Timings,
}

impl Renderer {
    /// # Errors
    /// [`GpuError::OutOfMemory`] or [`GpuError::Refusal`].
    pub fn new(gpu: Arc<Gpu>) -> Result<Self, GpuError> {
        use wgpu::ShaderStages as S;
        let device = &gpu.device;
        let frame_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("frame"),
            entries: &[uniform_entry(0, S::VERTEX_FRAGMENT)],
        });
        let texture = |binding, sample_type, view_dimension| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: S::FRAGMENT,
            ty: wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false },
            count: None,
        };
        let sampler = |binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: S::FRAGMENT,
            ty: wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
            count: None,
        };
        let filtered = wgpu::TextureSampleType::Float { filterable: true };
        let object_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("object"),
            entries: &[
                uniform_entry(0, S::FRAGMENT),
                texture(1, filtered, wgpu::TextureViewDimension::D3),
                sampler(2),
                texture(3, filtered, wgpu::TextureViewDimension::D2),
                sampler(4),
            ],
        });
        let frame_uniform = uniform_buffer(&gpu, "frame", size_of::<Frame>());
        let frame_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &frame_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: frame_uniform.as_entire_binding() }],
        });
        let linear = wgpu::FilterMode::Linear;
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("trilinear, clamped to the edge"),
            mag_filter: linear,
            min_filter: linear,
            ..Default::default()
        });
        let table_texture = gpu.allocate("the transfer function", 1 << 20, || table_texture(&gpu))?;
        let map_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("backward map"),
            entries: &MapBuffers::layout(S::FRAGMENT),
        });
        let map = MapBuffers::new(&gpu)?;
        let map_group = map_group(&gpu, &map_layout, &map);
        let slicing = SlicingPass::new(&gpu, [&frame_layout, &object_layout, &map_layout]);
        let resolve = ResolvePass::new(&gpu, &frame_layout)?;
        let opaque = OpaquePass::new(&gpu, &resolve.pass_layout)?;
        let geometry = GeometryBuffers::new(&gpu)?;
        let timer = Timer::new(&gpu);
        let counter = Counter::new(&gpu);
        gpu.check()?;
        Ok(Self {
            gpu,
            frame_uniform,
            frame_group,
            object_layout,
            sampler,
            table_texture,
            table: None,
            object: None,
            slices: None,
            culling: true,
            stopping: true,
            map_layout,
            map,
            map_group,
            exact: None,
            geometry,
            slicing,
            opaque,
            resolve,
            targets: None,
            timer,
            counter,
            fragments: None,
            timings: Timings::default(),
        })
    }

    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Uploads a field, unless the very same is set. It stays until another one is. Says whether it was uploaded.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] or [`GpuError::OutOfMemory`]; then nothing is set.
    pub fn set_field(&mut self, field: &Field) -> Result<bool, GpuError> {
        if self.object.as_ref().is_some_and(|o| o.field.same_as(field)) {
            return Ok(false);
        }
        // before the new volume, or both would be held at once
        self.object = None;
        let gpu = &self.gpu;
        let volume = VolumeTexture::upload(gpu, field)?;
        let uniform = uniform_buffer(gpu, "object", size_of::<ObjectUniform>());
        let view = |t: &wgpu::Texture| t.create_view(&wgpu::TextureViewDescriptor::default());
        let table = view(&self.table_texture);
        let resources = [
            uniform.as_entire_binding(),
            wgpu::BindingResource::TextureView(&volume.view),
            wgpu::BindingResource::Sampler(&self.sampler),
            wgpu::BindingResource::TextureView(&table),
            wgpu::BindingResource::Sampler(&self.sampler),
        ];
        let entries: Vec<_> = resources
            .into_iter()
            .zip(0..)
            .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("object"),
            layout: &self.object_layout,
            entries: &entries,
        });
        gpu.check()?;
        self.object = Some(Object { field: field.clone(), uniform, group });
        self.stale();
        if let Some((_, uploaded)) = &mut self.exact {
            *uploaded = None;
        }
        Ok(true)
    }

    /// Uploads the table of a transfer function.
    pub fn set_table(&mut self, table: &Arc<ClassTable>) {
        if self.table.as_ref().is_some_and(|t| Arc::ptr_eq(t, table)) {
            return;
        }
        let floats: &[f32] = table.entries.as_flattened();
        let bytes = match self.table_texture.format() {
            wgpu::TextureFormat::Rgba32Float => bytemuck::cast_slice(floats).to_vec(),
            _ => floats.iter().flat_map(|&v| half::f16::from_f32(v).to_ne_bytes()).collect(),
        };
        write_texture(&self.gpu, &self.table_texture, &bytes);
        self.table = Some(table.clone());
        self.stale();
    }

    /// Takes slice geometry, which is uploaded with the next picture. It stays until another one is set.
    pub fn set_geometry(&mut self, geometry: &Arc<SliceGeometry>) {
        if self.slices.as_ref().is_some_and(|s| Arc::ptr_eq(&s.source, geometry)) {
            return;
        }
        let jacobian = common_jacobian(geometry);
        self.slices = Some(Slices { source: geometry.clone(), jacobian, culled_for: None });
    }

    /// Evaluates the stack at every fragment instead of interpolating over the geometry (`slicing-exact`); `None` goes back.
    pub fn set_exact(&mut self, stack: Option<&Stack>) {
        if self.exact.as_ref().map(|(s, _)| s) != stack {
            self.exact = stack.map(|s| (s.clone(), None));
            self.stale();
        }
    }

    /// Whether triangles in which nothing can be seen are left out (they are, unless one wants to know what that saves).
    pub fn set_culling(&mut self, on: bool) {
        if self.culling != on {
            self.culling = on;
            self.stale();
        }
    }

    /// Whether what lies behind opaque pixels is left out (it is, unless one wants to know what that saves).
    pub fn set_stopping(&mut self, on: bool) {
        self.stopping = on;
    }

    /// The slices must be culled again.
    fn stale(&mut self) {
        if let Some(slices) = &mut self.slices {
            slices.culled_for = None;
        }
    }

    /// Culls and uploads the slices if what is on the device is out of date.
    fn update_geometry(&mut self, frame: &Frame) -> Result<(), GpuError> {
        let (Some(slices), Some(object), Some(table)) = (&mut self.slices, &self.object, &self.table) else {
            return Ok(());
        };
        let [width, height, mode, _] = frame.size;
        let (window, clip_from_local) = (frame.window, frame.clip_from_local);
        let culled_for = Some(CulledFor { window, clip_from_local, size: [width, height, mode] });
        if slices.culled_for != culled_for {
            // the texture coordinates of the corners say nothing of the fragments' where the map is evaluated at each
            let culling = self.culling && self.exact.is_none();
            let culled = if culling { cull(&slices.source, &object.field, table, frame) } else { None };
            self.geometry.upload(&self.gpu, &slices.source, culled.as_ref())?;
            slices.culled_for = culled_for;
        }
        if let Some((stack, uploaded)) = &mut self.exact {
            let center = slices.source.center;
            if *uploaded != Some(center) {
                self.map.write(&self.gpu, stack, object.field.grid.texture_from_world(), center)?;
                self.map_group = map_group(&self.gpu, &self.map_layout, &self.map);
                *uploaded = Some(center);
            }
        }
        Ok(())
    }

    /// Draws a picture of what was set. A frame without field or table shows the background.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] or [`GpuError::OutOfMemory`] for the picture, and what the device reports.
    pub fn draw(&mut self, frame: &Frame) -> Result<Picture, GpuError> {
        let [width, height, mode, _] = frame.size;
        self.resize(width, height)?;
        self.gpu.queue.write_buffer(&self.frame_uniform, 0, bytemuck::bytes_of(frame));
        let start = Instant::now();
        self.update_geometry(frame)?;
        let mut variant = None;
        if let (Some(object), Some(table), Some(slices)) = (&self.object, &self.table, &self.slices) {
            object.update(&self.gpu, slices.jacobian);
            let v = Variant {
                mode: match mode {
                    Frame::ISO => Mode::Iso,
                    Frame::MIP => Mode::Mip,
                    _ => Mode::Volume,
                },
                lit: frame.has(Frame::LIT),
                second: table.second,
                steep: frame.has(Frame::STEEP),
                forward: frame.has(Frame::FORWARD),
                perspective: frame.eye[3] != 0.0,
                rgba: object.field.channels == 4,
                affine: slices.jacobian.is_some() && self.exact.is_none(),
                exact: self.exact.is_some(),
            };
            self.slicing.prepare(&self.gpu, v)?;
            variant = Some((v, object));
        }
        let Some((slices, pixels)) = &self.targets else { return Err(GpuError::Refusal("no picture".into())) };
        let mut encoder =
            self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("picture") });
        let passes = self.slicing.run(
            &mut encoder,
            slices,
            variant.map(|(v, o)| (v, [&self.frame_group, &o.group, &self.map_group])),
            &self.geometry,
            self.stopping.then_some((&self.opaque, &pixels.group)),
            self.timer.as_ref(),
            self.counter.as_ref(),
        );
        let stamps = self.timer.as_ref().and_then(|t| t.part(1, true, true));
        self.resolve.run(&mut encoder, pixels, &self.frame_group, mode == Frame::MIP, stamps);
        if let Some(timer) = &self.timer {
            timer.finish(&mut encoder);
        }
        if let Some(counter) = &self.counter {
            counter.finish(&mut encoder, passes);
        }
        self.gpu.queue.submit([encoder.finish()]);
        let picture = pixels.read(&self.gpu)?;
        self.timings = Timings { frame: start.elapsed().as_secs_f64() * 1e3, ..Timings::default() };
        if let Some(timer) = &self.timer {
            let [slicing, resolve] = timer.read(&self.gpu)?;
            (self.timings.slicing, self.timings.resolve) = (Some(slicing), Some(resolve));
        }
        self.fragments = self.counter.as_ref().map(|c| c.read(&self.gpu, passes)).transpose()?;
        Ok(picture)
    }

    /// Fragments that were shaded for the last picture, as the device counts them; `None` where it does not.
    pub fn fragments(&self) -> Option<u64> {
        self.fragments
    }

    /// Times of the last picture.
    pub fn timings(&self) -> Timings {
        self.timings
    }

    fn resize(&mut self, width: u32, height: u32) -> Result<(), GpuError> {
        if self.targets.as_ref().is_some_and(|(_, p)| (p.width(), p.height()) == (width, height)) {
            return Ok(());
        }
        check_size(&self.gpu, width, height)?;
        self.targets = None;
        let slices = SliceTarget::new(&self.gpu, width, height)?;
        let pixels = self.resolve.target(&self.gpu, &slices, width, height)?;
        self.targets = Some((slices, pixels));
        Ok(())
    }
}

impl Object {
    fn update(&self, gpu: &Gpu, jacobian: Option<[f32; 9]>) {
        let [x, y, z] = self.field.grid.dims.map(|n| 1.0 / n as f32);
        let j = jacobian.unwrap_or_default();
        let uniform = ObjectUniform {
            texel: [x, y, z, 0.0],
            jacobian: std::array::from_fn(|c| [j[3 * c], j[3 * c + 1], j[3 * c + 2], 0.0]),
        };
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
    }
}

/// Whether a picture of this size can be drawn.
pub(super) fn check_size(gpu: &Gpu, width: u32, height: u32) -> Result<(), GpuError> {
    let limit = gpu.limits().max_texture_dimension_2d;
    if width == 0 || height == 0 || width.max(height) > limit {
        return Err(GpuError::TooLarge {
            what: "a picture",
            size: format!("{width}x{height} pixels"),
            limit: format!("{limit} pixels along each side (and at least 1)"),
        });
    }
    Ok(())
}

fn map_group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, map: &MapBuffers) -> wgpu::BindGroup {
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("backward map"),
        layout,
        entries: &map.entries(),
    })
}

fn uniform_entry(binding: u32, visibility: wgpu::ShaderStages) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    }
}

fn uniform_buffer(gpu: &Gpu, label: &str, size: usize) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: size as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn table_texture(gpu: &Gpu) -> wgpu::Texture {
    let side = TABLE_SIZE as u32;
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("transfer function"),
        size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: if gpu.capabilities().filter_float32 {
            wgpu::TextureFormat::Rgba32Float
        } else {
            wgpu::TextureFormat::Rgba16Float
        },
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

/// Replaces all of a texture.
fn write_texture(gpu: &Gpu, texture: &wgpu::Texture, bytes: &[u8]) {
    let size = texture.size();
    let rows = size.height * size.depth_or_array_layers;
    gpu.queue.write_texture(
        texture.as_image_copy(),
        bytes,
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(bytes.len() as u32 / rows),
            rows_per_image: Some(size.height),
        },
        size,
    );
}

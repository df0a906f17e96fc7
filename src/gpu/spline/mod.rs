//! The iso-surface of a spline, drawn.
//!
//! # Theory
//!
//! Kalbe, Koch and Goesele's pipeline ([`crate::spline`] has the mathematics). An isovalue is *classified* by compute passes
//! (`classify.rs`): blocks of cubes by the range of their samples, cubes by the signs of the 27 samples around them, their
//! tetrahedra by the hull of the coefficients. Prefix sums make one list of each of the 24 kinds; each list is drawn by one
//! indirect call, whose arguments never leave the device. A fragment of a tetrahedron gets the cubic along its ray by
//! blossoming, and finds the first place where it rises to the isovalue; the gradient there is the normal.
//!
//! Departures from the poster:
//!
//! - Back faces are drawn, not front faces, and no face is cut off by the near plane, so the eye may be anywhere.
//! - The interval of the ray in the tetrahedron is found first, and the cubic is that of the interval: it is well
//!   conditioned, and its roots need no test. Newton's method is kept within a bracket around the first rise.
//! - `f32` is enough because the ray is moved next to each cube: its numbers come in two parts (`view.rs`), so that nothing is
//!   lost far from the origin.
//! - A rasterizer puts corners on a grid of 1/256 of a pixel, so a pixel on a border may go to the wrong tetrahedron. They
//!   are therefore drawn a hundredth of a pixel larger, and each fragment looks itself where its ray is in the tetrahedron.
//! - A fragment writes its own depth, which hides from the hardware what lies behind. Where the adapter can be promised that
//!   fragments lie behind their faces, faces are drawn at the smallest depth of their cube, so that those behind what was drawn
//!   before are never shaded.
//! - Only rises count. Where a ray begins above the isovalue, on a plane that cuts or on the border, there is a flat cap, which
//!   a pass over the whole picture draws, if there can be any.
//! - Where surfaces are translucent they are peeled (Everitt, "Interactive order-independent transparency", 2001): each layer
//!   draws what comes next behind the depths of the one before, rises and falls.
//!
//! # Practice
//!
//! Coefficients are worked out from the 27 samples by the vertex stage, or by the classification, which has them in hand, and
//! stored: all 20 of a tetrahedron, or 56 of a cube, from which the vertex stage gets the others ([`Coefficients`]). Lists have
//! room for surfaces of the usual size; what was missing is known after the picture, and then it is done again with more.

mod classify;
mod draw;
mod layers;
mod shade;
mod size;
mod view;

use std::time::Instant;

use super::bind;
use super::layout::padded_row;
use super::resolve::{PixelTarget, ResolvePass};
use super::slicing::SliceTarget;
use super::timing::Counter;
use super::{Gpu, GpuError};
use crate::render::{Frame, Picture};
use crate::spline::Spline;
use crate::spline::occupancy::Occupancy;
use crate::spline::paint::Shell;
use classify::{Classifier, Lists, Samples};
use draw::{Drawer, Scene, Target};
use layers::{BEHIND, Layers};
use shade::OccupancyTexture;
use size::Room;

pub use view::{Shade, SplineView};

/// Where the coefficients of a tetrahedron come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Coefficients {
    /// The samples, for each corner of each tetrahedron.
    OnTheFly,
    /// A store of all of each tetrahedron (80 bytes), filled whenever the isovalue changes.
    Stored,
    /// A store of the 56 of each cube with tetrahedra that determine the others (224 bytes, the poster's Gamma_Q; see
    /// [`crate::spline::Determining`]), filled as the other.
    Determining,
}

impl Coefficients {
    pub const ALL: [Self; 3] = [Self::OnTheFly, Self::Stored, Self::Determining];

    /// As the command line has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::OnTheFly => "fly",
            Self::Stored => "stored",
            Self::Determining => "determining",
        }
    }
}

/// What is on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SplineLoad {
    /// Tetrahedra that the isosurface may pass through, cubes with such, and blocks of 4 x 4 x 4 cubes that may have some.
    pub tets: u32,
    pub cubes: u32,
    pub blocks: u32,
    /// Bytes of the samples, and of the lists (with the coefficients, and with room that is not used).
    pub sample_bytes: u64,
    pub list_bytes: u64,
    /// Bytes of the coefficients that are stored.
    pub coefficient_bytes: u64,
}

/// Draws isosurfaces of splines. Everything on the device is kept and used again.
#[derive(Debug)]
pub struct SplinePass {
    classifier: Classifier,
    drawer: Drawer,
    frame_uniform: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    resolve: ResolvePass,
    counter: Option<Counter>,
    coefficients: Coefficients,
    /// Bytes of a buffer.
    limit: u64,
    samples: Option<Samples>,
    /// One for each surface.
    levels: Vec<Level>,
    occupancy: OccupancyTexture,
    /// Stands for the layer before the first.
    nothing: wgpu::TextureView,
    layers: Option<Layers>,
    targets: Option<(SliceTarget, PixelTarget)>,
    fragments: Option<u64>,
}

/// Lists of tetrahedra, and what they are for.
#[derive(Debug)]
struct Level {
    lists: Lists,
    /// The isovalue.
    classified: Option<f64>,
    wanted: [u32; 3],
}

/// Where in a picture surfaces are drawn.
#[derive(Clone, Copy)]
struct Place<'a> {
    /// Nothing was drawn before.
    first: bool,
    /// Whether a layer may follow, which needs the depths.
    layered: bool,
    /// Depths of the layer before.
    before: &'a wgpu::TextureView,
}

/// Bytes that a shader can reach of a buffer.
fn binding_limit(gpu: &Gpu) -> u64 {
    gpu.limits().max_storage_buffer_binding_size.min(gpu.limits().max_buffer_size)
}

impl SplinePass {
    /// # Errors
    /// [`GpuError::Refusal`].
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        Self::with_limit(gpu, binding_limit(gpu))
    }

    /// The same with smaller buffers.
    ///
    /// # Errors
    /// As [`SplinePass::new`].
    pub fn with_limit(gpu: &Gpu, limit: u64) -> Result<Self, GpuError> {
        let stages = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let uniform = bind::buffer_type(wgpu::BufferBindingType::Uniform);
        let frame_layout = bind::group_layout(gpu, "frame", stages, &[uniform]);
        let frame_uniform = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("frame"),
            size: size_of::<Frame>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let frame_group = bind::group(gpu, "frame", &frame_layout, &[frame_uniform.as_entire_binding()]);
        let made = Self {
            classifier: Classifier::new(gpu)?,
            drawer: Drawer::new(gpu, &frame_layout)?,
            frame_uniform,
            frame_group,
            resolve: ResolvePass::new(gpu, &frame_layout)?,
            counter: Counter::new(gpu),
            coefficients: Coefficients::Stored,
            limit: limit.min(binding_limit(gpu)),
            samples: None,
            levels: Vec::new(),
            occupancy: OccupancyTexture::empty(gpu)?,
            nothing: layers::nothing_before(gpu)?,
            layers: None,
            targets: None,
            fragments: None,
        };
        gpu.check()?;
        Ok(made)
    }

    /// Uploads a spline. It stays until another one is set.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] or [`GpuError::OutOfMemory`]; then none is set.
    pub fn set_spline(&mut self, gpu: &Gpu, spline: &Spline) -> Result<(), GpuError> {
        // before the new one, or both would be held at once
        self.clear();
        self.samples = Some(Samples::upload(gpu, spline)?);
        Ok(())
    }

    /// Forgets the spline.
    pub fn clear(&mut self) {
        self.samples = None;
        self.levels.clear();
    }

    /// What takes light away from now on, if a view asks for it.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] or [`GpuError::OutOfMemory`]; then nothing does.
    pub fn set_occupancy(&mut self, gpu: &Gpu, occupancy: &Occupancy) -> Result<(), GpuError> {
        // the old one goes first
        self.occupancy = OccupancyTexture::empty(gpu)?;
        self.occupancy = OccupancyTexture::new(gpu, occupancy)?;
        Ok(())
    }

    /// Where coefficients come from; stored ones, unless something else is asked for.
    pub fn set_coefficients(&mut self, coefficients: Coefficients) {
        if self.coefficients != coefficients {
            self.coefficients = coefficients;
            self.levels.clear();
        }
    }

    pub fn coefficients(&self) -> Coefficients {
        self.coefficients
    }

    /// After a picture.
    pub fn load(&self) -> SplineLoad {
        let mut load =
            SplineLoad { sample_bytes: self.samples.as_ref().map_or(0, |s| s.bytes), ..SplineLoad::default() };
        for level in &self.levels {
            let [blocks, tets, cubes] = level.wanted;
            load.blocks += blocks;
            load.tets += tets;
            load.cubes += cubes;
            load.list_bytes += level.lists.bytes;
            load.coefficient_bytes += size::coefficient_bytes(self.coefficients, tets, cubes);
        }
        load
    }

    /// Fragments that were shaded for the last picture, as the device counts them; `None` where it does not.
    pub fn fragments(&self) -> Option<u64> {
        self.fragments
    }

    /// Finds the tetrahedra of an isovalue, and waits for that; milliseconds. A picture does it on its own.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if there are more than buffers hold, and what the device reports.
    pub fn classify(&mut self, gpu: &Gpu, iso: f64) -> Result<f64, GpuError> {
        self.make_lists(gpu, 1)?;
        self.levels.iter_mut().for_each(|level| level.classified = None);
        loop {
            let begun = Instant::now();
            let mut encoder = encoder(gpu);
            let fresh = self.record_lists(gpu, &mut encoder, &[iso]);
            gpu.queue.submit([encoder.finish()]);
            if self.settled(gpu, &[iso], &fresh)? {
                return Ok(begun.elapsed().as_secs_f64() * 1e3);
            }
        }
    }

    /// Draws surfaces: where the spline has one of the isovalues. Colours are in linear light. Without a spline there is only
    /// the background.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] or [`GpuError::OutOfMemory`], and what the device reports.
    pub fn draw(&mut self, gpu: &Gpu, frame: &Frame, view: &SplineView, shells: &[Shell]) -> Result<Picture, GpuError> {
        let [width, height, ..] = frame.size;
        self.resize(gpu, width, height)?;
        gpu.queue.write_buffer(&self.frame_uniform, 0, bytemuck::bytes_of(frame));
        let mut shells = shells.to_vec();
        shells.sort_by(|a, b| b.iso.total_cmp(&a.iso));
        let isos: Vec<f64> = shells.iter().map(|s| s.iso).collect();
        self.make_lists(gpu, shells.len())?;
        let layers = layers::count(shells.len() as u32, shells.iter().all(|s| s.opacity >= 1.0));
        if layers > 0 && self.layers.as_ref().is_none_or(|l| !l.fits(width, height)) {
            self.layers = None;
            self.layers = Some(Layers::new(gpu, width, height)?);
        }
        self.set_views(gpu, view, &shells, layers > 0)?;
        self.drawer.prepare(gpu, Target::Picture, self.coefficients)?;
        loop {
            let Some((target, pixels)) = &self.targets else { return Err(GpuError::Refusal("no picture".into())) };
            let mut encoder = encoder(gpu);
            let fresh = self.record_lists(gpu, &mut encoder, &isos);
            match &self.layers {
                Some(peeled) if layers > 0 => {
                    let mut before = &self.nothing;
                    for layer in 0..layers {
                        let own = &peeled.targets[layer as usize % 2];
                        let place = Place { first: layer == 0, layered: true, before };
                        self.record(gpu, &mut encoder, (Target::Picture, own), &isos, view, place);
                        peeled.add(&mut encoder, layer, target);
                        before = &own.depth;
                    }
                }
                _ => self.record(gpu, &mut encoder, (Target::Picture, target), &isos, view, self.alone()),
            }
            self.resolve.run(&mut encoder, pixels, &self.frame_group, false, None);
            let counter = self.counter.as_ref().filter(|_| layers == 0);
            if let Some(counter) = counter {
                counter.finish(&mut encoder, 1);
            }
            gpu.queue.submit([encoder.finish()]);
            let picture = pixels.read(gpu)?;
            let fragments = counter.map(|c| c.read(gpu, 1)).transpose()?;
            if self.settled(gpu, &isos, &fresh)? {
                self.fragments = fragments;
                return Ok(picture);
            }
        }
    }

    /// The normal (in the world, towards the eye) and the depth (along the ray of [`SplineView::ray`]) of each pixel; all
    /// zero where there is none.
    ///
    /// # Errors
    /// As [`SplinePass::draw`].
    pub fn probe(&mut self, gpu: &Gpu, view: &SplineView, iso: f64) -> Result<Vec<[f32; 4]>, GpuError> {
        let [width, height] = view.size;
        self.make_lists(gpu, 1)?;
        self.set_views(gpu, view, &[Shell { iso, color: [1.0; 3], opacity: 1.0 }], false)?;
        self.drawer.prepare(gpu, Target::Probe, self.coefficients)?;
        let target = SliceTarget::of(gpu, width, height, Target::Probe.format())?;
        let row = padded_row(width, 16);
        let readback = gpu.allocate("a picture", u64::from(row) * u64::from(height), || {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("probe"),
                size: u64::from(row) * u64::from(height),
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            })
        })?;
        loop {
            let mut encoder = encoder(gpu);
            let fresh = self.record_lists(gpu, &mut encoder, &[iso]);
            self.record(gpu, &mut encoder, (Target::Probe, &target), &[iso], view, self.alone());
            encoder.copy_texture_to_buffer(
                target.color.texture().as_image_copy(),
                wgpu::TexelCopyBufferInfo {
                    buffer: &readback,
                    layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
                },
                target.color.texture().size(),
            );
            gpu.queue.submit([encoder.finish()]);
            let probed = gpu.read(&readback, |bytes| {
                let rows = bytes.chunks_exact(row as usize).map(|row| &row[..width as usize * 16]);
                rows.flat_map(|row| row.chunks_exact(16).map(bytemuck::pod_read_unaligned)).collect()
            })?;
            if self.settled(gpu, &[iso], &fresh)? {
                return Ok(probed);
            }
        }
    }

    /// Hands what the shaders know of the view to the device.
    fn set_views(&mut self, gpu: &Gpu, view: &SplineView, shells: &[Shell], layered: bool) -> Result<(), GpuError> {
        let Some(samples) = &self.samples else { return Ok(()) };
        let uniform = |shell| {
            let mut uniform = view.uniform(samples.dims, shell, layered.then_some(BEHIND));
            let [x, y, z] = self.occupancy.cells.map(|n| 0.5 / n as f32);
            uniform.unit = [x, y, z, self.occupancy.cell as f32];
            uniform
        };
        let views: Vec<_> = shells.iter().map(uniform).collect();
        self.drawer.set_views(gpu, &views, view.painted())
    }

    /// Records the classification of isovalues that are new, and says which are.
    fn record_lists(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, isos: &[f64]) -> Vec<usize> {
        let Some(samples) = &self.samples else { return Vec::new() };
        let new = |(n, (level, iso)): (usize, (&Level, &f64))| (level.classified != Some(*iso)).then_some(n);
        let fresh: Vec<usize> = self.levels.iter().zip(isos).enumerate().filter_map(new).collect();
        for n in &fresh {
            self.classifier.run(gpu, encoder, samples, &self.levels[*n].lists, isos[*n]);
        }
        fresh
    }

    /// The place of a picture that has no layers.
    fn alone(&self) -> Place<'_> {
        Place { first: true, layered: false, before: &self.nothing }
    }

    /// Records the draws, and of what comes first, the caps.
    fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        target: (Target, &SliceTarget),
        isos: &[f64],
        view: &SplineView,
        Place { first, layered, before }: Place<'_>,
    ) {
        let Some(samples) = &self.samples else { return };
        let cut = view.cuts_in(samples.dims);
        let capped = |iso: f64| first && (cut || f64::from(samples.border) >= iso);
        let surfaces: Vec<_> = self.levels.iter().zip(isos).map(|(level, iso)| (&level.lists, capped(*iso))).collect();
        let scene = Scene { frame: &self.frame_group, samples, before, layered, occupancy: &self.occupancy };
        let counter = self.counter.as_ref().filter(|_| target.0 == Target::Picture && !layered);
        self.drawer.run(gpu, encoder, target, &scene, &surfaces, counter);
    }

    /// After classifications: whether there was room for all of them. If not, there is now.
    fn settled(&mut self, gpu: &Gpu, isos: &[f64], fresh: &[usize]) -> Result<bool, GpuError> {
        let mut settled = true;
        for &n in fresh {
            let level = &mut self.levels[n];
            level.wanted = level.lists.wanted(gpu)?;
            let room = level.lists.room.grown(level.wanted, self.limit)?;
            if room == level.lists.room {
                level.classified = Some(isos[n]);
                continue;
            }
            settled = false;
            let wanted = level.wanted;
            // the old ones go first, with those behind them: their lists are made again
            self.levels.truncate(n);
            if let Some(samples) = &self.samples {
                let lists = Lists::new(gpu, &self.classifier, samples, room)?;
                self.levels.push(Level { lists, classified: None, wanted });
            }
            break;
        }
        self.make_lists(gpu, isos.len())?;
        Ok(settled)
    }

    /// Lists for so many surfaces.
    fn make_lists(&mut self, gpu: &Gpu, count: usize) -> Result<(), GpuError> {
        self.levels.truncate(count.max(1));
        if let Some(samples) = &self.samples {
            while self.levels.len() < count {
                let room = Room::first(samples.block_count(), self.coefficients, self.limit);
                let lists = Lists::new(gpu, &self.classifier, samples, room)?;
                self.levels.push(Level { lists, classified: None, wanted: [0; 3] });
            }
        }
        Ok(())
    }

    fn resize(&mut self, gpu: &Gpu, width: u32, height: u32) -> Result<(), GpuError> {
        if self.targets.as_ref().is_some_and(|(_, p)| (p.width(), p.height()) == (width, height)) {
            return Ok(());
        }
        super::renderer::check_size(gpu, width, height)?;
        self.targets = None;
        let target = SliceTarget::new(gpu, width, height)?;
        let pixels = self.resolve.target(gpu, &target, width, height)?;
        self.targets = Some((target, pixels));
        Ok(())
    }
}

fn encoder(gpu: &Gpu) -> wgpu::CommandEncoder {
    gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("spline") })
}

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
//! - Only rises count. Where a ray begins above the isovalue, on a plane that cuts or on the border, there is a flat cap, which
//!   a pass over the whole picture draws, if there can be any.
//!
//! # Practice
//!
//! Coefficients are worked out from the 27 samples by the vertex stage, or by the classification, which has them in hand, and
//! stored ([`Coefficients`]). Lists have room for surfaces of the usual size; what was missing is known after the picture,
//! and then it is done again with more.

mod classify;
mod draw;
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
use classify::{Classifier, Lists, Samples};
use draw::{Drawer, Target};
use size::Room;

pub use view::SplineView;

/// Where the coefficients of a tetrahedron come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Coefficients {
    /// The samples, for each corner of each tetrahedron.
    OnTheFly,
    /// A store that is filled whenever the isovalue changes.
    Stored,
}

/// What is on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SplineLoad {
    /// Tetrahedra that the isosurface may pass through, and blocks of 4 x 4 x 4 cubes with such.
    pub tets: u32,
    pub blocks: u32,
    /// Bytes of the samples, and of the lists (with the coefficients).
    pub sample_bytes: u64,
    pub list_bytes: u64,
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
    lists: Option<Lists>,
    /// The isovalue that the lists are for.
    classified: Option<f64>,
    wanted: [u32; 2],
    targets: Option<(SliceTarget, PixelTarget)>,
    fragments: Option<u64>,
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
            lists: None,
            classified: None,
            wanted: [0; 2],
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
        (self.samples, self.lists, self.classified) = (None, None, None);
    }

    /// Where coefficients come from; stored ones, unless something else is asked for.
    pub fn set_coefficients(&mut self, coefficients: Coefficients) {
        if self.coefficients != coefficients {
            self.coefficients = coefficients;
            (self.lists, self.classified) = (None, None);
        }
    }

    pub fn coefficients(&self) -> Coefficients {
        self.coefficients
    }

    /// After a picture.
    pub fn load(&self) -> SplineLoad {
        SplineLoad {
            blocks: self.wanted[0],
            tets: self.wanted[1],
            sample_bytes: self.samples.as_ref().map_or(0, |s| s.bytes),
            list_bytes: self.lists.as_ref().map_or(0, |l| l.bytes),
        }
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
        self.make_lists(gpu)?;
        loop {
            let begun = Instant::now();
            let mut encoder = encoder(gpu);
            if let (Some(samples), Some(lists)) = (&self.samples, &self.lists) {
                self.classifier.run(gpu, &mut encoder, samples, lists, iso);
            }
            gpu.queue.submit([encoder.finish()]);
            if self.settled(gpu, iso)? {
                return Ok(begun.elapsed().as_secs_f64() * 1e3);
            }
        }
    }

    /// Draws the surface where the spline has the value `iso`. Without a spline there is only the background.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] or [`GpuError::OutOfMemory`], and what the device reports.
    pub fn draw(&mut self, gpu: &Gpu, frame: &Frame, view: &SplineView, iso: f64) -> Result<Picture, GpuError> {
        let [width, height, ..] = frame.size;
        self.resize(gpu, width, height)?;
        gpu.queue.write_buffer(&self.frame_uniform, 0, bytemuck::bytes_of(frame));
        self.make_lists(gpu)?;
        self.drawer.prepare(gpu, Target::Picture, self.coefficients == Coefficients::Stored)?;
        loop {
            let Some((target, pixels)) = &self.targets else { return Err(GpuError::Refusal("no picture".into())) };
            let mut encoder = encoder(gpu);
            let fresh = self.record(gpu, &mut encoder, (Target::Picture, target), view, iso);
            self.resolve.run(&mut encoder, pixels, &self.frame_group, false, None);
            if let Some(counter) = &self.counter {
                counter.finish(&mut encoder);
            }
            gpu.queue.submit([encoder.finish()]);
            let picture = pixels.read(gpu)?;
            if fresh && !self.settled(gpu, iso)? {
                continue;
            }
            self.fragments = self.counter.as_ref().map(|c| c.read(gpu)).transpose()?;
            return Ok(picture);
        }
    }

    /// The normal (in the world, towards the eye) and the depth (along the ray of [`SplineView::ray`]) of each pixel; all
    /// zero where there is none.
    ///
    /// # Errors
    /// As [`SplinePass::draw`].
    pub fn probe(&mut self, gpu: &Gpu, view: &SplineView, iso: f64) -> Result<Vec<[f32; 4]>, GpuError> {
        let [width, height] = view.size;
        self.make_lists(gpu)?;
        self.drawer.prepare(gpu, Target::Probe, self.coefficients == Coefficients::Stored)?;
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
            let fresh = self.record(gpu, &mut encoder, (Target::Probe, &target), view, iso);
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
            if !fresh || self.settled(gpu, iso)? {
                return Ok(probed);
            }
        }
    }

    /// Records the classification, if the isovalue is new, and the draws; says whether it was.
    fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        target: (Target, &SliceTarget),
        view: &SplineView,
        iso: f64,
    ) -> bool {
        let (Some(samples), Some(lists)) = (&self.samples, &self.lists) else {
            return false;
        };
        let fresh = self.classified != Some(iso);
        if fresh {
            self.classifier.run(gpu, encoder, samples, lists, iso);
        }
        let caps = f64::from(samples.border) >= iso || view.cuts_in(samples.dims);
        let uniform = view.uniform(samples.dims, iso);
        let counter = self.counter.as_ref().filter(|_| target.0 == Target::Picture);
        self.drawer.run(gpu, encoder, target, &self.frame_group, (samples, lists), &uniform, caps, counter);
        fresh
    }

    /// After a classification: whether there was room for all of it. If not, there is now.
    fn settled(&mut self, gpu: &Gpu, iso: f64) -> Result<bool, GpuError> {
        let Some(lists) = &self.lists else { return Ok(true) };
        self.wanted = lists.wanted(gpu)?;
        let [blocks, tets] = self.wanted;
        let room = lists.room.grown(blocks, tets, self.limit)?;
        if room == lists.room {
            self.classified = Some(iso);
            return Ok(true);
        }
        self.classified = None;
        // the old ones go first
        self.lists = None;
        if let Some(samples) = &self.samples {
            self.lists = Some(Lists::new(gpu, &self.classifier, samples, room)?);
        }
        Ok(false)
    }

    fn make_lists(&mut self, gpu: &Gpu) -> Result<(), GpuError> {
        if let (Some(samples), None) = (&self.samples, &self.lists) {
            let stored = self.coefficients == Coefficients::Stored;
            let room = Room::first(samples.block_count(), stored, self.limit);
            self.lists = Some(Lists::new(gpu, &self.classifier, samples, room)?);
            self.classified = None;
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

//! A picture of an object: slices for the view, drawn on the CPU or the GPU.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use super::EvaluateError;
use super::geometry::{self, GeometryOptions};
use super::load::Object;
use super::{smooth, tets};
use crate::gpu::{self, Coefficients, Gpu, Preference, SplineLoad};
use crate::mesh::tet_map::MapReport;
use crate::render::{self, Camera, ClassTable, Frame, Look, Picture};
use crate::volume::transfer::TransferFunction;

pub use super::geometry::Refinement;
pub use crate::spline::paint::SmoothLook;

/// Which renderer does the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backend {
    /// The GPU if it is a real one, else the CPU: software Vulkan is slower than our own renderer.
    #[default]
    Auto,
    Cpu,
    Gpu,
}

/// How the interior is deformed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Texture coordinates displaced at the corners of an adaptive subdivision (section 3.2.1).
    #[default]
    Slicing,
    /// The backward map for each fragment.
    SlicingExact,
    /// The volume warped through a lattice of tetrahedra first, then drawn as one that is not deformed. The refinement is
    /// the lattice's.
    Tets,
    /// The smooth iso-surface of a C1 spline: by rays on the CPU, by tetrahedra on the GPU.
    Spline,
}

/// How a picture is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewOptions {
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Number of slices; `None`: one per finest voxel.
    pub slices: Option<usize>,
    pub mode: Mode,
    pub refinement: Refinement,
    pub backend: Backend,
    /// Leave the background transparent.
    pub transparent: bool,
    /// Correction steps of [`Mode::Spline`] (see [`crate::spline`]); `None`: as many as suit the samples.
    pub corrections: Option<u32>,
}

/// What was done, and how long it took.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureReport {
    pub slices: usize,
    /// Those of them that were made for this picture; the others were kept from the last.
    pub made: usize,
    pub triangles: usize,
    /// Fragments that were shaded; `None` where the GPU cannot count them. The CPU leaves out those behind opaque ones and
    /// where nothing can be seen, the GPU only cells of the picture and whole triangles of such.
    pub fragments: Option<u64>,
    pub backend: &'static str,
    pub device: String,
    /// Plain sentences on what is wrong with the mesh's sections.
    pub warnings: Vec<String>,
    /// Of [`Mode::Tets`].
    pub tets: Option<TetsReport>,
    /// Of [`Mode::Spline`] on the GPU.
    pub spline: Option<(Coefficients, SplineLoad)>,
    pub ms_geometry: f64,
    pub ms_draw: f64,
    pub ms_total: f64,
}

/// What was warped before it was drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TetsReport {
    pub lattice: MapReport,
    pub ms_lattice: f64,
    pub ms_warp: f64,
}

/// Whether it is worth asking: on Linux, a graphics card shows as a device file.
fn may_have_gpu() -> bool {
    !cfg!(target_os = "linux") || ["/dev/dri", "/dev/nvidia0", "/dev/dxg"].iter().any(|p| Path::new(p).exists())
}

/// The device of a backend; `None` is the CPU.
pub(super) fn device(backend: Backend) -> Result<Option<Gpu>, EvaluateError> {
    Ok(match backend {
        Backend::Cpu => None,
        Backend::Gpu => Some(Gpu::open(Preference::Any)?),
        Backend::Auto if !may_have_gpu() => None,
        Backend::Auto => Gpu::open(Preference::Any).ok().filter(|g| !g.is_software()),
    })
}

/// How slices for a picture are made.
pub(super) fn geometry_options(options: &ViewOptions) -> GeometryOptions {
    GeometryOptions {
        slices: options.slices,
        refinement: options.refinement,
        subdivide: options.mode == Mode::Slicing,
        size: options.size,
    }
}

/// A renderer with its device, kept from picture to picture.
#[derive(Debug)]
pub struct Renderer {
    gpu: Option<gpu::Renderer>,
    /// Of [`Mode::Spline`].
    smooth: smooth::Kept,
    slices: geometry::Keeper,
    /// Of drafts, so that what was made at rest is there when the hand rests again.
    drafts: geometry::Keeper,
    table: Table,
}

/// The last table and what it is of: many pictures in a row need the same.
#[derive(Debug, Default)]
struct Table {
    last: Option<(TransferFunction, f64, bool, Arc<ClassTable>)>,
}

impl Table {
    fn of(&mut self, transfer: &TransferFunction, depth: f64, preintegrated: bool) -> Arc<ClassTable> {
        match &self.last {
            Some((t, d, p, table)) if (t, *d, *p) == (transfer, depth, preintegrated) => table.clone(),
            _ => {
                let table = Arc::new(ClassTable::build(transfer, depth, preintegrated));
                self.last = Some((transfer.clone(), depth, preintegrated, table.clone()));
                table
            }
        }
    }
}

impl Renderer {
    /// # Errors
    /// If the GPU is asked for and none can be opened.
    pub fn new(backend: Backend) -> Result<Self, EvaluateError> {
        Ok(Self {
            gpu: device(backend)?.map(|g| gpu::Renderer::new(Arc::new(g))).transpose()?,
            smooth: smooth::Kept::default(),
            slices: geometry::Keeper::default(),
            drafts: geometry::Keeper::default(),
            table: Table::default(),
        })
    }

    /// Draws an object.
    ///
    /// # Errors
    /// If the view is degenerate or the GPU fails.
    pub fn picture(
        &mut self,
        object: &Object,
        camera: &Camera,
        look: &Look,
        options: &ViewOptions,
    ) -> Result<(Picture, PictureReport), EvaluateError> {
        // nothing stops it, so there is a picture
        self.picture_until(object, camera, look, options, &|| false)?.ok_or(EvaluateError::View)
    }

    /// What the pictures of [`Mode::Spline`] show beside the shape from now on.
    pub fn set_smooth_look(&mut self, look: SmoothLook) {
        self.smooth.look = look;
    }

    /// Whether a draft of [`Mode::Spline`] costs no more than its rays: they find the surface of the undeformed volume through
    /// strokes, and its spline is there.
    pub fn surface_is_ready(&self, object: &Object) -> bool {
        self.smooth.is_ready(object, None)
    }

    /// Makes sure of that.
    ///
    /// # Errors
    /// If the object cannot be deformed.
    pub fn make_surface_ready(&mut self, object: &Object) -> Result<(), EvaluateError> {
        self.smooth.make_ready(object, None)
    }

    /// Where the coefficients of [`Mode::Spline`] come from on the GPU; `None`: as suits the surface.
    pub fn set_coefficients(&mut self, coefficients: Option<Coefficients>) {
        self.smooth.set_coefficients(coefficients);
    }

    /// Whether the GPU draws.
    pub fn on_gpu(&self) -> bool {
        self.gpu.is_some()
    }

    /// What draws.
    pub fn device(&self) -> String {
        match &self.gpu {
            Some(gpu) => gpu.gpu().name(),
            None => format!("cpu, {} threads", rayon::current_num_threads()),
        }
    }

    /// As [`Renderer::picture`], given up soon after `stop` says so: then there is none.
    ///
    /// # Errors
    /// If the view is degenerate or the GPU fails.
    pub fn picture_until(
        &mut self,
        object: &Object,
        camera: &Camera,
        look: &Look,
        options: &ViewOptions,
        stop: render::Stop<'_>,
    ) -> Result<Option<(Picture, PictureReport)>, EvaluateError> {
        let started = Instant::now();
        if options.mode == Mode::Spline {
            let gpu = self.gpu.as_ref().map(gpu::Renderer::gpu);
            return smooth::picture(&mut self.smooth, gpu, object, camera, look, options, stop);
        }
        if options.mode == Mode::Tets {
            let warped = tets::warped(object, options.refinement)?;
            let drawn = ViewOptions { mode: Mode::Slicing, ..*options };
            let Some((picture, report)) = self.picture_until(&warped.object, camera, look, &drawn, stop)? else {
                return Ok(None);
            };
            let tets::Warped { report: lattice, ms_lattice, ms_warp, .. } = warped;
            let tets = Some(TetsReport { lattice, ms_lattice, ms_warp });
            let ms_total = started.elapsed().as_secs_f64() * 1e3;
            return Ok(Some((picture, PictureReport { tets, ms_total, ..report })));
        }
        let keeper = if options.refinement == Refinement::Draft { &mut self.drafts } else { &mut self.slices };
        let (geometry, warnings) = keeper.slices(object, camera, &geometry_options(options))?;
        let made = geometry.slices.len().saturating_sub(keeper.kept());
        let geometry = Arc::new(geometry);
        let ms_geometry = started.elapsed().as_secs_f64() * 1e3;
        if stop() {
            return Ok(None);
        }
        let drawing = Instant::now();
        let look = Look { transparent: options.transparent, ..*look };
        let (width, height) = options.size;
        let frame = Frame::new(camera, &look, &object.field, object.window, &geometry, width, height);
        let reference = object.field.grid.finest();
        let table = self.table.of(&object.transfer, geometry.distance / reference, look.preintegrated);
        let (picture, fragments) = match &mut self.gpu {
            Some(gpu) => {
                gpu.set_field(&object.field)?;
                gpu.set_table(&table);
                gpu.set_exact((options.mode == Mode::SlicingExact).then_some(&object.stack));
                gpu.set_geometry(&geometry);
                let picture = gpu.draw(&frame)?;
                (picture, gpu.fragments())
            }
            None => {
                let prepared = object.stack.prepared();
                let exact = (options.mode == Mode::SlicingExact).then(|| render::Exact {
                    map: &prepared,
                    texture_from_world: object.field.grid.texture_from_world(),
                });
                match render::render_until(&geometry, &object.field, &table, &frame, exact, stop) {
                    Some((picture, fragments)) => (picture, Some(fragments)),
                    None => return Ok(None),
                }
            }
        };
        let report = PictureReport {
            slices: geometry.slices.len(),
            made,
            triangles: geometry.indices.len() / 3,
            fragments,
            tets: None,
            spline: None,
            warnings,
            backend: if self.gpu.is_some() { "gpu" } else { "cpu" },
            device: self.device(),
            ms_geometry,
            ms_draw: drawing.elapsed().as_secs_f64() * 1e3,
            ms_total: started.elapsed().as_secs_f64() * 1e3,
        };
        Ok(Some((picture, report)))
    }
}

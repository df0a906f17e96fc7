//! Smooth iso-surfaces against slices of the same volume: what a new isovalue costs, and a new view; how fast tetrahedra are
//! found, and meshes made.

use std::path::Path;
use std::time::Instant;

use crate::evaluate::EvaluateError;
use crate::evaluate::load::{Object, load};
use crate::evaluate::picture::{Backend, Mode, Refinement, Renderer, ViewOptions};
use crate::evaluate::smooth;
use crate::gpu::{Coefficients, Gpu, GpuError, Preference, SplineLoad, SplinePass};
use crate::render::{Camera, Look, Shading};
use crate::scene::{CameraSpec, Document};
use crate::spline::paint::Shell;
use crate::spline::{self, Level, Spline};

/// One way to a picture of an iso-surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// The spline, by rays on the CPU.
    Rays,
    /// The spline, by tetrahedra on the GPU.
    Tets(Coefficients),
    /// The trilinear function, by slices on the CPU or the GPU.
    Slices { gpu: bool },
}

impl Way {
    pub const ALL: [Self; 6] = [
        Self::Rays,
        Self::Slices { gpu: false },
        Self::Tets(Coefficients::Stored),
        Self::Tets(Coefficients::Determining),
        Self::Tets(Coefficients::OnTheFly),
        Self::Slices { gpu: true },
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Rays => "spline",
            Self::Tets(Coefficients::Stored) => "spline, stored",
            Self::Tets(Coefficients::Determining) => "spline, determining",
            Self::Tets(Coefficients::OnTheFly) => "spline, on the fly",
            Self::Slices { .. } => "slices",
        }
    }

    /// Where the work is done.
    pub fn backend(self) -> &'static str {
        match self {
            Self::Rays | Self::Slices { gpu: false } => "cpu",
            Self::Tets(_) | Self::Slices { gpu: true } => "gpu",
        }
    }
}

/// What one way took. Times in milliseconds, medians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    pub way: Way,
    /// A picture of another isovalue, and one from another side.
    pub change_ms: f64,
    pub frame_ms: f64,
    /// Finding what the surface passes through, alone.
    pub classify_ms: Option<f64>,
    /// What is on the device.
    pub load: Option<SplineLoad>,
}

/// All ways with one volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    pub dims: [usize; 3],
    pub ways: Vec<Measured>,
    /// Making the spline, and a mesh of it.
    pub spline_ms: f64,
    pub mesh_ms: f64,
    pub triangles: usize,
    /// Cubes that the surface may pass through.
    pub cubes: usize,
}

/// Runs of one way.
#[derive(Default)]
struct Times {
    change: Vec<f64>,
    frame: Vec<f64>,
    classify: Vec<f64>,
}

fn timed<R>(into: &mut Vec<f64>, work: impl FnOnce() -> R) -> R {
    let started = Instant::now();
    let made = work();
    into.push(started.elapsed().as_secs_f64() * 1e3);
    made
}

fn median(mut times: Vec<f64>) -> Option<f64> {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied()
}

/// What a way works with.
enum Tool {
    Renderer(Box<Renderer>, Mode),
    Pass(Box<SplinePass>),
}

/// Measures all ways with the volume of a document, the GPU's only if one can be opened.
///
/// # Errors
/// If the volume cannot be loaded, or the GPU fails.
pub fn measure(
    document: &Document,
    base: &Path,
    size: (u32, u32),
    rounds: usize,
) -> Result<(Volume, Option<String>), EvaluateError> {
    let object = load(document, base)?;
    let gpu = match Gpu::open(Preference::Any) {
        Ok(gpu) => Some(gpu),
        Err(GpuError::NoAdapter { .. }) => None,
        Err(e) => return Err(e.into()),
    };
    let steps = spline::suggested_steps(&object.volume.samples);
    let mut spline_times = Vec::new();
    let spline = timed(&mut spline_times, || Spline::of_volume(&object.volume, object.volume.channels - 1, steps));
    let mut ways = Vec::new();
    for way in Way::ALL {
        let tool = match (way, &gpu) {
            (Way::Rays, _) => Tool::Renderer(Box::new(Renderer::new(Backend::Cpu)?), Mode::Spline),
            (Way::Slices { gpu: false }, _) => Tool::Renderer(Box::new(Renderer::new(Backend::Cpu)?), Mode::Slicing),
            (_, None) => continue,
            (Way::Slices { gpu: true }, _) => Tool::Renderer(Box::new(Renderer::new(Backend::Gpu)?), Mode::Slicing),
            (Way::Tets(coefficients), Some(gpu)) => {
                let mut pass = SplinePass::new(gpu)?;
                pass.set_coefficients(coefficients);
                pass.set_spline(gpu, &spline)?;
                Tool::Pass(Box::new(pass))
            }
        };
        ways.push((way, tool, Times::default()));
    }
    let mut mesh_times = Vec::new();
    let mut triangles = 0;
    let (mut iso, mut yaw) = (object.iso, 30.0);
    let [lo, hi] = object.field.range;
    // the first round warms up; then in turns, so that whatever else the machine does meets all ways alike
    for round in 0..rounds.max(1) + 1 {
        let view = |yaw| object.camera(&CameraSpec { yaw, ..CameraSpec::default() });
        let new_iso = object.iso + 0.01 * (hi - lo) * if round % 2 == 0 { 1.0 } else { -1.0 };
        let new_yaw = yaw + 20.0;
        for (_, tool, times) in &mut ways {
            if round == 0 {
                *times = Times::default();
                draw(tool, gpu.as_ref(), &object, &view(yaw), iso, size)?;
            }
            timed(&mut times.change, || draw(tool, gpu.as_ref(), &object, &view(yaw), new_iso, size))?;
            timed(&mut times.frame, || draw(tool, gpu.as_ref(), &object, &view(new_yaw), new_iso, size))?;
            match (&mut *tool, &gpu) {
                (Tool::Pass(pass), Some(gpu)) => times.classify.push(pass.classify(gpu, new_iso)?),
                (Tool::Renderer(_, Mode::Spline), _) => {
                    timed(&mut times.classify, || Level::new(&spline, new_iso));
                }
                _ => {}
            }
            if round == 0 {
                *times = Times::default();
            }
        }
        let made =
            timed(&mut mesh_times, || spline::surface::surface(&spline, new_iso, &object.volume.grid.world_from_voxel));
        triangles = made.mesh.triangles.len();
        (iso, yaw) = (new_iso, new_yaw);
    }
    let measured = ways.into_iter().map(|(way, tool, times)| {
        let load = match &tool {
            Tool::Pass(pass) => Some(pass.load()),
            Tool::Renderer(..) => None,
        };
        Measured {
            way,
            change_ms: median(times.change).unwrap_or_default(),
            frame_ms: median(times.frame).unwrap_or_default(),
            classify_ms: median(times.classify),
            load,
        }
    });
    let volume = Volume {
        dims: object.volume.grid.dims,
        ways: measured.collect(),
        spline_ms: median(spline_times).unwrap_or_default(),
        mesh_ms: median(mesh_times).unwrap_or_default(),
        triangles,
        cubes: Level::new(&spline, iso).active_cubes(),
    };
    Ok((volume, gpu.map(|g| g.name())))
}

fn draw(
    tool: &mut Tool,
    gpu: Option<&Gpu>,
    object: &Object,
    camera: &Camera,
    iso: f64,
    size: (u32, u32),
) -> Result<(), EvaluateError> {
    let look = Look { shading: Shading::Iso { value: iso, color: [0.87, 0.80, 0.70] }, ..Look::default() };
    match (tool, gpu) {
        (Tool::Pass(pass), Some(gpu)) => {
            let (frame, view) = smooth::frame_and_view(object, &object.volume.grid, camera, &look, size)?;
            pass.draw(gpu, &frame, &view, &[Shell { iso, color: [0.7; 3], opacity: 1.0 }])?;
        }
        (Tool::Renderer(renderer, mode), _) => {
            let options = ViewOptions {
                size,
                slices: None,
                mode: *mode,
                refinement: Refinement::Tolerance(crate::evaluate::geometry::TOLERANCE),
                backend: Backend::Auto,
                transparent: false,
                corrections: None,
            };
            renderer.picture(object, camera, &look, &options)?;
        }
        (Tool::Pass(_), None) => {}
    }
    Ok(())
}

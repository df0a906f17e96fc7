//! The iso-surface of an object as a picture: by rays on the CPU, by tetrahedra on the GPU.

mod inside;
mod moved;
mod rays;

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;

use super::EvaluateError;
use super::load::Object;
use super::picture::{PictureReport, Refinement, ViewOptions};
use super::surface::{sculpted, since, steps};
use crate::deform::Stack;
use crate::gpu::{Coefficients, Gpu, GpuError, Shade, SplinePass, SplineView};
use crate::mesh::TriMesh;
use crate::render::{Camera, Frame, Look, Picture, Projection, Shading, SliceGeometry, Stop};
use crate::scene::CutPlane;
use crate::spline::occupancy::{Occupancy, Seen};
use crate::spline::paint::{Colors, Paint, Shell, SmoothLook};
use crate::spline::{Classes, Spline, Through};
use crate::volume::{Grid, Volume};
use inside::Inside;
use rays::{Data, Scene, View};

/// The spline of an object, kept from picture to picture: another view or isovalue needs no new one.
#[derive(Debug)]
struct Smooth {
    made_of: MadeOf,
    /// What is seen lies in its voxels.
    grid: Grid,
    spline: Arc<Spline>,
    /// The strokes, if the spline is that of the undeformed volume.
    through: Option<Through>,
    /// Of the isovalues of the last picture.
    classes: Vec<Arc<Classes>>,
    occupancy: Option<Filled>,
}

/// A spline of an undeformed volume, and what is known of it.
#[derive(Debug, Clone)]
struct Rest {
    spline: Arc<Spline>,
    classes: Vec<Arc<Classes>>,
}

/// How full space is, and for what.
#[derive(Debug)]
struct Filled {
    /// Isovalues, and how much each takes away.
    shells: Vec<(f64, f32)>,
    clip: Vec<CutPlane>,
    /// Where rays look for it themselves.
    mesh: Option<TriMesh>,
    occupancy: Arc<Occupancy>,
}

/// What a spline depends on.
#[derive(Debug, Clone)]
struct MadeOf {
    volume: Arc<Volume>,
    stack: Stack,
    mesh: Option<TriMesh>,
    steps: u32,
    direct: bool,
}

impl MadeOf {
    fn new(object: &Object, corrections: Option<u32>, direct: bool) -> Self {
        Self {
            volume: object.volume.clone(),
            stack: object.stack.clone(),
            // rays look for the mesh themselves
            mesh: (object.shaped && !direct).then(|| object.mesh.clone()),
            steps: steps(object, corrections),
            direct,
        }
    }

    fn same(&self, other: &Self) -> bool {
        self.same_volume(other) && (&self.stack, &self.mesh, self.direct) == (&other.stack, &other.mesh, other.direct)
    }

    /// Whether the spline is that of the volume as it was before all strokes.
    fn is_rest(&self) -> bool {
        self.direct || (self.mesh.is_none() && self.stack.active().next().is_none())
    }

    fn same_volume(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.volume, &other.volume) && self.steps == other.steps
    }
}

impl Smooth {
    /// `rest`: of the undeformed volume, if it is there.
    fn new(object: &Object, made_of: MadeOf, rest: Option<Rest>) -> Result<Self, EvaluateError> {
        let channel = object.volume.channels - 1;
        if made_of.direct {
            let fresh = || Arc::new(Spline::of_volume(&object.volume, channel, made_of.steps));
            let Rest { spline, classes } = rest.unwrap_or_else(|| Rest { spline: fresh(), classes: Vec::new() });
            let (through, grid) = moved::through(object, Arc::clone(&spline))?;
            return Ok(Self { grid, spline, through: Some(through), classes, made_of, occupancy: None });
        }
        let volume = sculpted(object)?;
        let spline = Arc::new(Spline::of_volume(&volume, channel, made_of.steps));
        Ok(Self { grid: volume.grid, spline, through: None, classes: Vec::new(), made_of, occupancy: None })
    }

    /// The spline of the undeformed volume, if it is this one.
    fn rest(&self, made_of: &MadeOf) -> Option<Rest> {
        let own = self.made_of.is_rest() && self.made_of.same_volume(made_of);
        own.then(|| Rest { spline: self.spline.clone(), classes: self.classes.clone() })
    }

    /// Classifications for some surfaces; those of the last picture are used again.
    fn classified(&mut self, shells: &[Shell]) -> Vec<Arc<Classes>> {
        let known = |iso: f64| self.classes.iter().find(|c| c.iso() == iso).cloned();
        let classes =
            shells.iter().map(|s| known(s.iso).unwrap_or_else(|| Arc::new(Classes::new(&self.spline, s.iso))));
        self.classes = classes.collect();
        self.classes.clone()
    }

    /// Finds how full space is, for some surfaces; says whether it was not known.
    fn occupancy(&mut self, object: &Object, shells: &[Shell]) -> bool {
        // a translucent surface is no body: little light is lost behind it
        let key: Vec<_> = shells.iter().map(|s| (s.iso, s.opacity.powi(3))).collect();
        let mesh = (self.through.is_some() && object.shaped).then(|| object.mesh.clone());
        if self.occupancy.as_ref().is_some_and(|o| o.shells == key && o.clip == object.clip && o.mesh == mesh) {
            return false;
        }
        let occupancy = match &self.through {
            None => {
                let seen = |_, middle| object.clip.iter().all(|plane| plane.beyond(middle) <= 0.0);
                let seen: Option<Seen<'_>> = if object.clip.is_empty() { None } else { Some(&seen) };
                Occupancy::new(&self.spline, &self.grid, &key, seen)
            }
            Some(_) => moved::occupancy(object, &self.spline, &self.grid, &key),
        };
        self.occupancy = Some(Filled { shells: key, clip: object.clip.clone(), mesh, occupancy: Arc::new(occupancy) });
        true
    }
}

/// What pictures leave behind for the next one.
#[derive(Debug, Default)]
pub(super) struct Kept {
    smooth: Option<Smooth>,
    /// Stands for it in drafts while strokes change: resampling would take too long.
    passing: Option<Smooth>,
    pass: Option<SplinePass>,
    /// Whether the pass has the spline.
    uploaded: bool,
    /// Whether it has the occupancy.
    shaded: bool,
    /// Where coefficients come from; `None`: as suits the surface.
    coefficients: Option<Coefficients>,
    pub look: SmoothLook,
}

impl Kept {
    /// Where coefficients of pictures on the GPU come from; `None`: as suits the surface.
    pub fn set_coefficients(&mut self, coefficients: Option<Coefficients>) {
        self.coefficients = coefficients;
        if let Some(pass) = &mut self.pass {
            pass.set_coefficients(coefficients.unwrap_or(Coefficients::Stored));
        }
    }

    fn made_of(&self, object: &Object, corrections: Option<u32>) -> MadeOf {
        MadeOf::new(object, corrections, self.look.direct && object.is_sculpted())
    }

    /// The spline of the undeformed volume, wherever it is.
    fn rest(&self, made_of: &MadeOf) -> Option<Rest> {
        [&self.passing, &self.smooth].into_iter().flatten().find_map(|kept| kept.rest(made_of))
    }

    /// Whether a draft is there without making a spline.
    pub fn is_ready(&self, object: &Object, corrections: Option<u32>) -> bool {
        let made_of = self.made_of(object, corrections);
        self.smooth.as_ref().is_some_and(|kept| kept.made_of.same(&made_of)) || self.rest(&made_of).is_some()
    }

    /// Makes sure of that.
    ///
    /// # Errors
    /// If the object cannot be resampled.
    pub fn make_ready(&mut self, object: &Object, corrections: Option<u32>) -> Result<(), EvaluateError> {
        let made_of = MadeOf { direct: true, ..self.made_of(object, corrections) };
        if self.rest(&made_of).is_none() {
            self.passing = Some(Smooth::new(object, made_of, None)?);
        }
        Ok(())
    }

    /// Makes the spline, unless the one that was kept is still right. A draft may be content with what stands for it; returns
    /// whether it is.
    fn renew(&mut self, object: &Object, corrections: Option<u32>, draft: bool) -> Result<bool, EvaluateError> {
        let made_of = self.made_of(object, corrections);
        if self.smooth.as_ref().is_some_and(|kept| kept.made_of.same(&made_of)) {
            return Ok(false);
        }
        // a stroke does not change what lies under it
        let rest = self.rest(&made_of);
        if draft && object.is_sculpted() {
            let made_of = MadeOf { mesh: None, direct: true, ..made_of };
            if self.passing.as_ref().is_none_or(|kept| !kept.made_of.same(&made_of)) {
                self.passing = None;
                self.passing = Some(Smooth::new(object, made_of, rest)?);
            }
            return Ok(true);
        }
        self.smooth = None;
        self.passing.take_if(|kept| !kept.made_of.same_volume(&made_of));
        (self.uploaded, self.shaded) = (false, false);
        self.smooth = Some(Smooth::new(object, made_of, rest)?);
        Ok(false)
    }
}

/// A picture of the spline's iso-surface. Where the look is not that of an iso-surface, the value that separates the object
/// from its surroundings is shown. What was kept is used where it is right.
///
/// # Errors
/// If the view has no direction, the object cannot be resampled, or the GPU fails.
pub(super) fn picture(
    kept: &mut Kept,
    gpu: Option<&Gpu>,
    object: &Object,
    camera: &Camera,
    look: &Look,
    options: &ViewOptions,
    stop: Stop<'_>,
) -> Result<Option<(Picture, PictureReport)>, EvaluateError> {
    let started = Instant::now();
    let look = match look.shading {
        Shading::Iso { .. } => Look { transparent: options.transparent, ..*look },
        _ => Look {
            shading: Shading::Iso { value: object.iso, color: [0.87, 0.80, 0.70] },
            transparent: options.transparent,
            ..*look
        },
    };
    let Shading::Iso { value: iso, .. } = look.shading else { return Err(EvaluateError::View) };
    let stand_in = kept.renew(object, options.corrections, options.refinement == Refinement::Draft)?;
    let Kept { smooth, passing, pass, uploaded, shaded, coefficients, look: smooth_look } = kept;
    // the light of the last picture at rest does for one that passes
    let before = smooth.as_ref().filter(|_| stand_in).and_then(|kept| kept.occupancy.as_ref());
    let before = before.map(|filled| filled.occupancy.clone());
    let Some(smooth) = (if stand_in { passing } else { smooth }) else { return Err(EvaluateError::View) };
    let (frame, mut view) = frame_and_view(object, &smooth.grid, camera, &look, options.size)?;
    view.paint = paint(smooth_look, object, &smooth.grid);
    if stop() {
        return Ok(None);
    }
    let mut report = PictureReport {
        made: 0,
        slices: 0,
        triangles: 0,
        fragments: None,
        tets: None,
        spline: None,
        warnings: Vec::new(),
        backend: "cpu",
        device: format!("cpu, {} threads", rayon::current_num_threads()),
        ms_geometry: 0.0,
        ms_draw: 0.0,
        ms_total: 0.0,
    };
    let [r, g, b, _] = frame.iso_color;
    let shells = smooth_look.all((iso, [r, g, b]));
    view.shade = Shade { ambient: smooth_look.occlusion, light: smooth_look.shadows };
    if (smooth_look.occlusion || smooth_look.shadows) && !stand_in {
        let fresh = smooth.occupancy(object, &shells);
        *shaded &= !fresh;
    }
    let mut drawn = None;
    // what stands in for a moment is drawn on the CPU, without a word about it
    if let Some(gpu) = gpu.filter(|_| !stand_in) {
        if smooth.through.is_some() {
            report.warnings.push("the surface was drawn on the CPU, which alone sees it through strokes".into());
        } else {
            match on_gpu(gpu, (pass, uploaded, shaded), *coefficients, smooth, &mut report, |pass| {
                pass.draw(gpu, &frame, &view, &shells)
            }) {
                Ok(picture) => drawn = Some(picture),
                Err(error) => report.warnings.push(instead(error)?),
            }
        }
    }
    let picture = match drawn {
        Some(picture) => picture,
        None => {
            let classes = smooth.classified(&shells);
            let occupancy = before.as_ref().or(smooth.occupancy.as_ref().map(|kept| &kept.occupancy));
            let occupancy = occupancy.map(|kept| &**kept);
            let inside = (smooth.through.is_some() && object.shaped)
                .then(|| Inside::new(&object.mesh, &view.clip_from_world, options.size));
            let looked = View {
                voxel_from_world: match &smooth.through {
                    Some(_) => object.volume.grid.voxel_from_world(),
                    None => smooth.grid.voxel_from_world(),
                },
                eye: view.eye,
                to_eye: view.to_eye,
                light: (camera.axes() * look.light).try_normalize().unwrap_or(camera.to_eye()),
                clip: &object.clip,
                inside: inside.as_ref(),
                paint: &view.paint,
                occlusion: occupancy.filter(|_| view.shade.ambient),
                shadows: occupancy.filter(|_| view.shade.light),
            };
            let map = moved::derivative(object);
            let data = match &smooth.through {
                Some(through) => Data::Moved(through, &map),
                None => Data::Still(&smooth.spline),
            };
            let scene = Scene::new(&data, &shells, classes, &frame, &looked, view.clip_from_world.inverse());
            report.ms_geometry = since(started);
            let (picture, hits) = scene.picture(stop);
            report.fragments = Some(hits);
            picture
        }
    };
    if stop() {
        return Ok(None);
    }
    report.ms_total = since(started);
    report.ms_draw = report.ms_total - report.ms_geometry;
    Ok(Some((picture, report)))
}

/// Colours of the surfaces of an object.
fn paint(look: &SmoothLook, object: &Object, grid: &Grid) -> Paint {
    // a ball of four voxels shows the strongest colour
    let curvature = look.curvature.map(|curvature| (curvature, 4.0 * grid.finest()));
    let last = (Colors::ENTRIES - 1) as f32;
    let color = |i: usize| {
        let [r, g, b, _] = object.transfer.classify(i as f32 / last);
        [r, g, b]
    };
    let table = || (0..Colors::ENTRIES).map(color).collect();
    Paint { curvature, caps: look.caps.then(|| Colors { table: table(), range: object.window }) }
}

/// What both renderers need of a view of a spline over a grid.
///
/// # Errors
/// If the view has no direction.
pub(super) fn frame_and_view(
    object: &Object,
    grid: &Grid,
    camera: &Camera,
    look: &Look,
    (width, height): (u32, u32),
) -> Result<(Frame, SplineView), EvaluateError> {
    let clip_from_world = camera.clip_from_world(width, height);
    if !clip_from_world.is_finite() || clip_from_world.determinant() == 0.0 {
        return Err(EvaluateError::View);
    }
    // the light, the material and the background are those of slices, whose geometry plays no part
    let geometry = SliceGeometry { center: DVec3::ZERO, distance: grid.finest(), ..SliceGeometry::default() };
    let view = SplineView {
        clip_from_world,
        world_from_voxel: grid.world_from_voxel,
        eye: match camera.projection {
            Projection::Orthographic => None,
            Projection::Perspective { .. } => Some(camera.eye()),
        },
        to_eye: camera.to_eye(),
        cuts: object.clip.iter().map(|plane| [plane.point, plane.normal]).collect(),
        size: [width, height],
        paint: Paint::default(),
        shade: Shade::default(),
    };
    Ok((Frame::new(camera, look, &object.field, object.window, &geometry, width, height), view))
}

/// Draws with a pass; gives it what it does not have of the spline and of what is around.
fn on_gpu(
    gpu: &Gpu,
    (pass, uploaded, shaded): (&mut Option<SplinePass>, &mut bool, &mut bool),
    chosen: Option<Coefficients>,
    smooth: &Smooth,
    report: &mut PictureReport,
    draw: impl Fn(&mut SplinePass) -> Result<Picture, GpuError>,
) -> Result<Picture, GpuError> {
    let started = Instant::now();
    let pass = match pass {
        Some(pass) => pass,
        none => none.insert(SplinePass::new(gpu)?),
    };
    if !*uploaded {
        // a larger surface may have needed another way before
        pass.set_coefficients(chosen.unwrap_or(Coefficients::Stored));
        pass.set_spline(gpu, &smooth.spline)?;
        *uploaded = true;
    }
    if let (Some(filled), false) = (&smooth.occupancy, *shaded) {
        pass.set_occupancy(gpu, &filled.occupancy)?;
        *shaded = true;
    }
    report.ms_geometry = since(started);
    let picture = match draw(pass) {
        // coefficients take 20 times the room of a list; what determines a cube's takes less, but is slower to draw with than
        // the samples
        Err(GpuError::TooLarge { .. }) if chosen.is_none() && pass.coefficients() == Coefficients::Stored => {
            pass.set_coefficients(Coefficients::OnTheFly);
            draw(pass)?
        }
        drawn => drawn?,
    };
    report.backend = "gpu";
    report.device = gpu.name();
    report.fragments = pass.fragments();
    report.triangles = 4 * pass.load().tets as usize;
    report.spline = Some((pass.coefficients(), pass.load()));
    Ok(picture)
}

/// Why the CPU draws what the GPU has no room for.
///
/// # Errors
/// Everything else that may have gone wrong.
fn instead(error: GpuError) -> Result<String, GpuError> {
    match error {
        GpuError::TooLarge { what, size, limit } if what != "a picture" => Ok(format!(
            "the surface was drawn on the CPU: {what} of {size} is larger than the {limit} that the graphics adapter allows"
        )),
        GpuError::OutOfMemory { what, bytes } => Ok(format!(
            "the surface was drawn on the CPU: the graphics adapter has no memory left for {what} ({bytes} bytes)"
        )),
        other => Err(other),
    }
}

//! The iso-surface of an object as a picture: by rays on the CPU, by tetrahedra on the GPU.

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;

use super::EvaluateError;
use super::load::Object;
use super::picture::{PictureReport, ViewOptions};
use super::surface::{sculpted, since, steps};
use crate::deform::Stack;
use crate::gpu::{Coefficients, Gpu, GpuError, SplinePass, SplineView};
use crate::math::parallel;
use crate::mesh::TriMesh;
use crate::render::{Camera, Frame, Look, Picture, Projection, Shading, SliceGeometry, Stop};
use crate::scene::CutPlane;
use crate::spline::paint::{Colors, Curvature, Paint, tinted};
use crate::spline::{Crossing, Level, Ray, Spline};
use crate::volume::transfer::{linear_from_srgb, srgb_from_linear};
use crate::volume::{Grid, Volume};

/// What a smooth surface shows beside its shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SmoothLook {
    pub curvature: Option<Curvature>,
    /// Whether caps on clipping planes have the transfer function's colours, not the surface's own.
    pub caps: bool,
}

impl SmoothLook {
    fn paint(self, object: &Object, grid: &Grid) -> Paint {
        // a ball of four voxels shows the strongest colour
        let curvature = self.curvature.map(|curvature| (curvature, 4.0 * grid.finest()));
        let last = (Colors::ENTRIES - 1) as f32;
        let color = |i: usize| {
            let [r, g, b, _] = object.transfer.classify(i as f32 / last);
            [r, g, b]
        };
        let table = || (0..Colors::ENTRIES).map(color).collect();
        Paint { curvature, caps: self.caps.then(|| Colors { table: table(), range: object.window }) }
    }
}

/// Rows of a picture that are worked off together.
const ROWS: usize = 8;

/// The spline of a sculpted object, kept from picture to picture: another view or isovalue needs no new one.
#[derive(Debug)]
struct Smooth {
    made_of: MadeOf,
    grid: Grid,
    spline: Spline,
}

/// What a spline depends on.
#[derive(Debug, Clone)]
struct MadeOf {
    volume: Arc<Volume>,
    stack: Stack,
    mesh: Option<TriMesh>,
    steps: u32,
}

impl MadeOf {
    fn new(object: &Object, corrections: Option<u32>) -> Self {
        Self {
            volume: object.volume.clone(),
            stack: object.stack.clone(),
            mesh: object.shaped.then(|| object.mesh.clone()),
            steps: steps(object, corrections),
        }
    }

    fn same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.volume, &other.volume)
            && (&self.stack, &self.mesh, self.steps) == (&other.stack, &other.mesh, other.steps)
    }
}

impl Smooth {
    fn new(object: &Object, made_of: MadeOf) -> Result<Self, EvaluateError> {
        let volume = sculpted(object)?;
        let spline = Spline::of_volume(&volume, volume.channels - 1, made_of.steps);
        Ok(Self { grid: volume.grid, spline, made_of })
    }
}

/// What pictures leave behind for the next one.
#[derive(Debug, Default)]
pub(super) struct Kept {
    smooth: Option<Smooth>,
    pass: Option<SplinePass>,
    /// Whether the pass has the spline.
    uploaded: bool,
    pub look: SmoothLook,
}

impl Kept {
    /// Makes the spline, unless the one that was kept is still right.
    fn renew(&mut self, object: &Object, corrections: Option<u32>) -> Result<(), EvaluateError> {
        let made_of = MadeOf::new(object, corrections);
        if self.smooth.as_ref().is_none_or(|kept| !kept.made_of.same(&made_of)) {
            (self.smooth, self.uploaded) = (None, false);
            self.smooth = Some(Smooth::new(object, made_of)?);
        }
        Ok(())
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
    kept.renew(object, options.corrections)?;
    let Kept { smooth: Some(smooth), pass, uploaded, look: smooth_look } = kept else {
        return Err(EvaluateError::View);
    };
    let (frame, mut view) = frame_and_view(object, &smooth.grid, camera, &look, options.size)?;
    view.paint = smooth_look.paint(object, &smooth.grid);
    if stop() {
        return Ok(None);
    }
    let mut report = PictureReport {
        slices: 0,
        triangles: 0,
        fragments: None,
        tets: None,
        warnings: Vec::new(),
        backend: "cpu",
        device: format!("cpu, {} threads", rayon::current_num_threads()),
        ms_geometry: 0.0,
        ms_draw: 0.0,
        ms_total: 0.0,
    };
    let mut drawn = None;
    if let Some(gpu) = gpu {
        match on_gpu(gpu, pass, uploaded, &smooth.spline, &mut report, |pass| pass.draw(gpu, &frame, &view, iso)) {
            Ok(picture) => drawn = Some(picture),
            Err(error) => report.warnings.push(instead(error)?),
        }
    }
    let picture = match drawn {
        Some(picture) => picture,
        None => {
            let level = Level::new(&smooth.spline, iso);
            report.ms_geometry = since(started);
            let scene = Scene {
                level: &level,
                frame: &frame,
                color: frame.iso_color.map(f64::from),
                world_from_clip: view.clip_from_world.inverse(),
                voxel_from_world: smooth.grid.voxel_from_world(),
                eye: view.eye,
                to_eye: view.to_eye,
                light: (camera.axes() * look.light).try_normalize().unwrap_or(camera.to_eye()),
                clip: &object.clip,
                paint: &view.paint,
            };
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
    };
    Ok((Frame::new(camera, look, &object.field, object.window, &geometry, width, height), view))
}

/// Draws with a pass that has the spline.
fn on_gpu(
    gpu: &Gpu,
    pass: &mut Option<SplinePass>,
    uploaded: &mut bool,
    spline: &Spline,
    report: &mut PictureReport,
    draw: impl Fn(&mut SplinePass) -> Result<Picture, GpuError>,
) -> Result<Picture, GpuError> {
    let started = Instant::now();
    let pass = match pass {
        Some(pass) => pass,
        none => none.insert(SplinePass::new(gpu)?),
    };
    if !*uploaded {
        // a larger surface may have needed the other way before
        pass.set_coefficients(Coefficients::Stored);
        pass.set_spline(gpu, spline)?;
        *uploaded = true;
    }
    report.ms_geometry = since(started);
    let picture = match draw(pass) {
        // coefficients take 20 times the room of a list
        Err(GpuError::TooLarge { .. }) if pass.coefficients() == Coefficients::Stored => {
            pass.set_coefficients(Coefficients::OnTheFly);
            draw(pass)?
        }
        drawn => drawn?,
    };
    report.backend = "gpu";
    report.device = gpu.name();
    report.fragments = pass.fragments();
    report.triangles = 4 * pass.load().tets as usize;
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

fn background(frame: &Frame, y: usize) -> [u8; 4] {
    let t = (y as f32 + 0.5) / frame.size[1] as f32;
    let mix = |c: usize| {
        let [top, bottom] = frame.background.map(|b| b[c]);
        // through linear light and back, as slices are drawn, costs no more than rounding
        (srgb_from_linear(linear_from_srgb(top + (bottom - top) * t)) * 255.0).round() as u8
    };
    [mix(0), mix(1), mix(2), 255]
}

/// What a pixel needs.
struct Scene<'a> {
    level: &'a Level<'a>,
    frame: &'a Frame,
    color: [f64; 4],
    world_from_clip: glam::DMat4,
    voxel_from_world: glam::DAffine3,
    /// `None` in a parallel view.
    eye: Option<DVec3>,
    to_eye: DVec3,
    light: DVec3,
    /// What is cut away.
    clip: &'a [CutPlane],
    paint: &'a Paint,
}

impl Scene<'_> {
    /// The picture, and the number of pixels that show the surface.
    fn picture(&self, stop: Stop<'_>) -> (Picture, u64) {
        let [width, height, ..] = self.frame.size;
        let mut picture = Picture::filled(width, height, [0; 4]);
        let hits = parallel::chunks_mut(&mut picture.pixels, ROWS * width as usize, &|piece, pixels| {
            let mut hits = 0;
            if stop() {
                return hits;
            }
            for (n, pixel) in pixels.iter_mut().enumerate() {
                let (x, y) = (n % width as usize, piece * ROWS + n / width as usize);
                *pixel = match self.pixel(x, y) {
                    Some(color) => {
                        hits += 1;
                        let [r, g, b] = color.map(|v| (srgb_from_linear(v as f32) * 255.0).round() as u8);
                        [r, g, b, 255]
                    }
                    None if self.frame.has(Frame::TRANSPARENT) => [0; 4],
                    None => background(self.frame, y),
                };
            }
            hits
        });
        (picture, hits.into_iter().sum())
    }

    /// The linear colour of what a pixel shows, if anything.
    fn pixel(&self, x: usize, y: usize) -> Option<[f64; 3]> {
        let [width, height, ..] = self.frame.size.map(f64::from);
        let at = DVec3::new(2.0 * (x as f64 + 0.5) / width - 1.0, 1.0 - 2.0 * (y as f64 + 0.5) / height, 0.0);
        let [near, far] = [0.0, 1.0].map(|z| self.world_from_clip.project_point3(at.with_z(z)));
        let ray = Ray {
            origin: self.voxel_from_world.transform_point3(near),
            direction: self.voxel_from_world.transform_vector3(far - near),
        };
        let (range, cut_by) = self.unclipped(near, far)?;
        let (t, crossing) = self.level.first_hit(&ray, range)?;
        let p = near + t * (far - near);
        let to_eye = self.eye.map_or(self.to_eye, |eye| (eye - p).normalize());
        // a gradient in the world
        let covariant = self.voxel_from_world.matrix3.transpose();
        let spline = self.level.spline();
        let mut color = [self.color[0], self.color[1], self.color[2]];
        let normal = match (crossing, cut_by) {
            (Crossing::Start, Some(plane)) if t <= range[0] => {
                if let Some(colors) = &self.paint.caps {
                    color = colors.at(spline.value(ray.at(t)));
                }
                plane
            }
            (Crossing::Start, _) => covariant * self.cut(&ray, t),
            _ => {
                let gradient = covariant * spline.gradient(ray.at(t));
                if let Some((curvature, strength)) = self.paint.curvature {
                    let hessian = covariant * spline.hessian(ray.at(t)) * covariant.transpose();
                    color = tinted(color, curvature.of(gradient, hessian) * strength);
                }
                gradient
            }
        };
        let normal = normal.try_normalize().unwrap_or(to_eye);
        let normal = if normal.dot(to_eye) < 0.0 { -normal } else { normal };
        Some(self.shade(color, normal, to_eye))
    }

    /// The part of the way from `near` to `far` that no plane cuts away, and the normal of the plane it begins at.
    fn unclipped(&self, near: DVec3, far: DVec3) -> Option<([f64; 2], Option<DVec3>)> {
        let (mut range, mut normal) = ([0.0, 1.0], None);
        for plane in self.clip {
            let (a, b) = (plane.beyond(near), plane.beyond(far));
            if a > 0.0 && b > 0.0 {
                return None;
            }
            let at = a / (a - b);
            if a > 0.0 && at > range[0] {
                range[0] = at;
                normal = Some(plane.normal);
            } else if b > 0.0 {
                range[1] = at.min(range[1]);
            }
        }
        (range[0] < range[1]).then_some((range, normal))
    }

    /// A gradient where the ray comes into the domain: across the face it comes through, or towards the eye where the eye is
    /// within.
    fn cut(&self, ray: &Ray, t: f64) -> DVec3 {
        let p = ray.at(t);
        let size = DVec3::from(self.level.spline().dims().map(|n| n as f64));
        let mut normal = DVec3::ZERO;
        for a in 0..3 {
            if (p[a] + 0.5).abs().min((p[a] + 0.5 - size[a]).abs()) < 1e-9 * size[a] + 1e-9 {
                normal[a] = ray.direction[a].signum();
            }
        }
        normal
    }

    /// As the surfaces of slices are lit.
    fn shade(&self, color: [f64; 3], n: DVec3, to_eye: DVec3) -> [f64; 3] {
        if !self.frame.has(Frame::LIT) {
            return color;
        }
        let [ambient, diffuse_weight, specular_weight, shininess] = self.frame.material.map(f64::from);
        let half = (self.light + to_eye).normalize_or(to_eye);
        let diffuse = n.dot(self.light).max(0.0);
        let specular = n.dot(half).max(1e-6).powf(shininess);
        color.map(|c| c * (ambient + diffuse_weight * diffuse) + specular_weight * specular)
    }
}

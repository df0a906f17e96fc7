//! The iso-surface of an object: as a mesh, and as a picture by ray casting.
//!
//! What is deformed, or cut by a mesh, is resampled first: in `f32`, so that nothing is rounded to the sample type, and with
//! cubic interpolation. Strokes then move the data, and the surface is smooth again.

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;

use super::EvaluateError;
use super::export::ExportOptions;
use super::load::Object;
use super::picture::{Backend, PictureReport, ViewOptions};
use super::resample;
use crate::deform::Stack;
use crate::math::parallel;
use crate::mesh::TriMesh;
use crate::mesh::contour::Contour;
use crate::render::{Camera, Frame, Look, Picture, Projection, Shading, SliceGeometry, Stop};
use crate::scene::CutPlane;
use crate::spline::refine::{self, RefineReport};
use crate::spline::{self, Crossing, Level, Ray, Spline, cells};
use crate::volume::sampling::Interpolation;
use crate::volume::transfer::{linear_from_srgb, srgb_from_linear};
use crate::volume::{Grid, Samples, Scalar, Volume};
use crate::with_samples;

/// Which surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// Of the C1 spline, after so many corrections; `None`: as many as suit the samples.
    Spline { corrections: Option<u32> },
    /// Of the trilinear function, by marching cubes.
    Cells,
}

/// How a surface is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceOptions {
    /// In real values; `None`: what separates the object from its surroundings.
    pub iso: Option<f64>,
    pub method: Method,
    /// Of the spline: largest distance of an edge's middle from the surface, in voxels.
    pub tolerance: Option<f64>,
}

/// A surface, and how long it took.
#[derive(Debug, Clone)]
pub struct Surface {
    /// In the world.
    pub contour: Contour,
    pub iso: f64,
    pub refined: Option<RefineReport>,
    pub resampled: bool,
    /// Milliseconds: resampling, making the spline, the mesh, all.
    pub ms_resample: f64,
    pub ms_spline: f64,
    pub ms_mesh: f64,
    pub ms_total: f64,
}

fn since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Makes the mesh of an object's iso-surface.
///
/// # Errors
/// If there is nothing at or above the isovalue, or the object cannot be resampled.
pub fn surface(object: &Object, options: &SurfaceOptions) -> Result<Surface, EvaluateError> {
    let started = Instant::now();
    let volume = sculpted(object)?;
    let ms_resample = since(started);
    let channel = volume.channels - 1;
    let iso = options.iso.unwrap_or(object.iso);
    let frame = &volume.grid.world_from_voxel;
    let making = Instant::now();
    let mut ms_spline = 0.0;
    let mut refined = None;
    let contour = match options.method {
        Method::Cells => cells::surface(&volume, channel, iso),
        Method::Spline { corrections } => {
            let spline = Spline::of_volume(&volume, channel, steps(object, corrections));
            ms_spline = since(making);
            match options.tolerance {
                None => spline::surface::surface(&spline, iso, frame),
                Some(tolerance) => {
                    let (contour, report) = refine::surface(&spline, iso, frame, tolerance);
                    refined = Some(report);
                    contour
                }
            }
        }
    };
    if contour.mesh.triangles.is_empty() {
        let [lo, hi] = object.field.range;
        return Err(EvaluateError::NoSurface { iso, lo, hi });
    }
    Ok(Surface {
        contour,
        iso,
        refined,
        resampled: matches!(volume, Cow::Owned(_)),
        ms_resample,
        ms_spline,
        ms_mesh: since(making) - ms_spline,
        ms_total: since(started),
    })
}

fn steps(object: &Object, asked: Option<u32>) -> u32 {
    asked.unwrap_or_else(|| spline::suggested_steps(&object.volume.samples))
}

/// The volume as it was sculpted: the object's own if nothing was done to it.
fn sculpted(object: &Object) -> Result<Cow<'_, Volume>, EvaluateError> {
    if object.stack.active().next().is_none() && !object.shaped {
        return Ok(Cow::Borrowed(&object.volume));
    }
    let floats = match object.volume.samples {
        Samples::F32(_) | Samples::F64(_) => None,
        _ => Some(Object { volume: Arc::new(in_floats(&object.volume)), ..object.clone() }),
    };
    let options = ExportOptions { interpolation: Interpolation::Cubic, ..ExportOptions::default() };
    let exported = resample::export(floats.as_ref().unwrap_or(object), &options, Backend::Cpu)?;
    Ok(Cow::Owned(exported.volume))
}

/// The same stored values as `f32`.
fn in_floats(volume: &Volume) -> Volume {
    fn widened<T: Scalar>(values: &[T]) -> Vec<f32> {
        values.iter().map(|v| v.to_f32()).collect()
    }
    Volume { samples: with_samples!(&volume.samples, v => Samples::F32(widened(v))), ..*volume }
}

/// Rows of a picture that are worked off together.
const ROWS: usize = 8;

/// The spline of a sculpted object, kept from picture to picture: another view or isovalue needs no new one.
#[derive(Debug)]
pub(super) struct Smooth {
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
    /// The one that was kept, if it is still right, else a new one.
    ///
    /// # Errors
    /// If the object cannot be resampled.
    pub fn renewed(kept: Option<Self>, object: &Object, corrections: Option<u32>) -> Result<Self, EvaluateError> {
        let made_of = MadeOf::new(object, corrections);
        if let Some(kept) = kept
            && kept.made_of.same(&made_of)
        {
            return Ok(kept);
        }
        let volume = sculpted(object)?;
        let spline = Spline::of_volume(&volume, volume.channels - 1, made_of.steps);
        Ok(Self { grid: volume.grid, spline, made_of })
    }
}

/// A picture of the spline's iso-surface. Where the look is not that of an iso-surface, the value that separates the object
/// from its surroundings is shown. `kept` is used if it is right, and holds the spline afterwards.
///
/// # Errors
/// If the view has no direction, or the object cannot be resampled.
pub(super) fn picture(
    kept: &mut Option<Smooth>,
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
    let smooth = Smooth::renewed(kept.take(), object, options.corrections)?;
    let Smooth { grid, spline, .. } = kept.insert(smooth);
    let level = Level::new(spline, iso);
    let ms_geometry = since(started);
    let drawing = Instant::now();
    let (width, height) = options.size;
    // the light, the material and the background are those of slices, whose geometry plays no part
    let geometry = SliceGeometry { center: DVec3::ZERO, distance: grid.finest(), ..SliceGeometry::default() };
    let frame = Frame::new(camera, &look, &object.field, object.window, &geometry, width, height);
    let clip = camera.clip_from_world(width, height);
    if !clip.is_finite() || clip.determinant() == 0.0 {
        return Err(EvaluateError::View);
    }
    let scene = Scene {
        level: &level,
        frame: &frame,
        color: frame.iso_color.map(f64::from),
        world_from_clip: clip.inverse(),
        voxel_from_world: grid.voxel_from_world(),
        eye: match camera.projection {
            Projection::Orthographic => None,
            Projection::Perspective { .. } => Some(camera.eye()),
        },
        to_eye: camera.to_eye(),
        light: (camera.axes() * look.light).try_normalize().unwrap_or(camera.to_eye()),
        clip: &object.clip,
    };
    let mut picture = Picture::filled(width, height, [0; 4]);
    let hits = parallel::chunks_mut(&mut picture.pixels, ROWS * width as usize, &|piece, pixels| {
        let mut hits = 0;
        if stop() {
            return hits;
        }
        for (n, pixel) in pixels.iter_mut().enumerate() {
            let (x, y) = (n % width as usize, piece * ROWS + n / width as usize);
            *pixel = match scene.pixel(x, y) {
                Some(color) => {
                    hits += 1;
                    let [r, g, b] = color.map(|v| (srgb_from_linear(v as f32) * 255.0).round() as u8);
                    [r, g, b, 255]
                }
                None if frame.has(Frame::TRANSPARENT) => [0; 4],
                None => background(&frame, y),
            };
        }
        hits
    });
    if stop() {
        return Ok(None);
    }
    let report = PictureReport {
        slices: 0,
        triangles: 0,
        fragments: Some(hits.into_iter().sum()),
        tets: None,
        warnings: Vec::new(),
        backend: "cpu",
        device: format!("cpu, {} threads", rayon::current_num_threads()),
        ms_geometry,
        ms_draw: since(drawing),
        ms_total: since(started),
    };
    Ok(Some((picture, report)))
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
}

impl Scene<'_> {
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
        let normal = match (crossing, cut_by) {
            (Crossing::Start, Some(plane)) if t <= range[0] => plane,
            (Crossing::Start, _) => covariant * self.cut(&ray, t),
            _ => covariant * self.level.spline().gradient(ray.at(t)),
        };
        let normal = normal.try_normalize().unwrap_or(to_eye);
        let normal = if normal.dot(to_eye) < 0.0 { -normal } else { normal };
        Some(self.shade(normal, to_eye))
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
    fn shade(&self, n: DVec3, to_eye: DVec3) -> [f64; 3] {
        let color = [self.color[0], self.color[1], self.color[2]];
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

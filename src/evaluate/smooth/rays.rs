//! A picture of smooth surfaces by rays, on the CPU.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DMat4, DVec3};

use super::inside::Inside;
use crate::math::parallel;
use crate::render::{Frame, Picture, Stop};
use crate::scene::CutPlane;
use crate::spline::occupancy::Occupancy;
use crate::spline::paint::{Paint, Shell, tinted};
use crate::spline::{Classes, Crossing, Level, Ray, Spline, Through, ThroughLevel};
use crate::volume::transfer::{linear_from_srgb, srgb_from_linear};

/// Rows of a picture that are worked off together.
const ROWS: usize = 8;

/// What the surfaces are of.
pub(super) enum Data<'a> {
    /// A spline as it is.
    Still(&'a Spline),
    /// One seen through a map, and the derivative of that map (voxels by voxels).
    Moved(&'a Through, &'a (dyn Fn(DVec3) -> (DVec3, DMat3) + Sync)),
}

/// An isovalue of it.
pub(super) enum Surface<'a> {
    Still(Level<'a>),
    Moved(ThroughLevel<'a>),
}

impl Data<'_> {
    /// At a point in voxels.
    fn value(&self, p: DVec3) -> f64 {
        match self {
            Self::Still(spline) => spline.value(p),
            Self::Moved(through, _) => through.spline().value(through.backward(p)),
        }
    }

    /// Per voxel. Of what moved: by the transposed Jacobian of the map.
    fn gradient(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Still(spline) => spline.gradient(p),
            Self::Moved(through, map) => {
                let (rest, jacobian) = map(p);
                jacobian.transpose() * through.spline().gradient(rest)
            }
        }
    }

    /// Per voxel squared. Of what moved: by central differences, as the map's second derivatives are not known.
    fn hessian(&self, p: DVec3) -> DMat3 {
        const H: f64 = 0.05;
        match self {
            Self::Still(spline) => spline.hessian(p),
            Self::Moved(..) => {
                let along = |e: DVec3| (self.gradient(p + H * e) - self.gradient(p - H * e)) / (2.0 * H);
                let m = DMat3::from_cols(along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
                0.5 * (m + m.transpose())
            }
        }
    }

    fn surface(&self, classes: Arc<Classes>) -> Surface<'_> {
        match self {
            Self::Still(spline) => Surface::Still(Level::of(spline, classes)),
            Self::Moved(through, _) => Surface::Moved(ThroughLevel::of(through, classes)),
        }
    }

    /// Across the border of the domain that a point lies on, per voxel; zero if it lies on none.
    fn border(&self, p: DVec3) -> DVec3 {
        let (rest, turn, dims) = match self {
            Self::Still(spline) => (p, DMat3::IDENTITY, spline.dims()),
            Self::Moved(through, map) => {
                let (rest, jacobian) = map(p);
                (rest, jacobian.transpose(), through.spline().dims())
            }
        };
        let size = DVec3::from(dims.map(|n| n as f64));
        let mut normal = DVec3::ZERO;
        for a in 0..3 {
            let near = 1e-6 * size[a];
            if (rest[a] + 0.5).abs() < near {
                normal[a] = 1.0;
            } else if (rest[a] + 0.5 - size[a]).abs() < near {
                normal[a] = -1.0;
            }
        }
        turn * normal
    }
}

impl Surface<'_> {
    fn crossings(&self, ray: &Ray, range: [f64; 2], found: impl FnMut(f64, Crossing) -> ControlFlow<()>) {
        match self {
            Self::Still(level) => level.crossings(ray, range, found),
            Self::Moved(level) => level.crossings(ray, range, found),
        }
    }
}

/// What a pixel needs.
pub(super) struct Scene<'a> {
    data: &'a Data<'a>,
    /// The one of the largest isovalue first.
    surfaces: Vec<(Shell, Surface<'a>)>,
    frame: &'a Frame,
    view: &'a View<'a>,
    world_from_clip: DMat4,
}

/// What is the same for all kinds of data.
pub(super) struct View<'a> {
    pub voxel_from_world: DAffine3,
    /// `None` in a parallel view.
    pub eye: Option<DVec3>,
    pub to_eye: DVec3,
    pub light: DVec3,
    /// What is cut away.
    pub clip: &'a [CutPlane],
    /// The mesh that limits the object, if it does so here.
    pub inside: Option<&'a Inside>,
    pub paint: &'a Paint,
    pub occlusion: Option<&'a Occupancy>,
    pub shadows: Option<&'a Occupancy>,
}

/// A place where a ray meets one of the surfaces.
struct Met {
    t: f64,
    shell: usize,
    crossing: Crossing,
    /// Of what cuts the surface open here.
    cut: Option<Cut>,
}

/// Where a ray may begin.
#[derive(Clone, Copy)]
struct Cut {
    normal: DVec3,
    /// By a clipping plane, not by the mesh.
    plane: bool,
}

impl<'a> Scene<'a> {
    /// `classes`: of each shell's isovalue.
    pub fn new(
        data: &'a Data<'a>,
        shells: &[Shell],
        classes: Vec<Arc<Classes>>,
        frame: &'a Frame,
        view: &'a View<'a>,
        world_from_clip: DMat4,
    ) -> Self {
        let surfaces = shells.iter().copied().zip(classes.into_iter().map(|c| data.surface(c))).collect();
        Self { data, surfaces, frame, view, world_from_clip }
    }

    /// The picture, and the number of pixels that show a surface.
    pub fn picture(&self, stop: Stop<'_>) -> (Picture, u64) {
        let [width, height, ..] = self.frame.size;
        let mut picture = Picture::filled(width, height, [0; 4]);
        let hits = parallel::chunks_mut(&mut picture.pixels, ROWS * width as usize, &|piece, pixels| {
            let mut hits = 0;
            if stop() {
                return hits;
            }
            let mut met = Vec::new();
            for (row, pixels) in pixels.chunks_exact_mut(width as usize).enumerate() {
                let y = piece * ROWS + row;
                let behind = self.background(y);
                for (x, pixel) in pixels.iter_mut().enumerate() {
                    let [r, g, b, a] = self.pixel(x, y, &mut met);
                    hits += u64::from(a > 0.0);
                    *pixel = self.encoded([r, g, b], a, behind);
                }
            }
            hits
        });
        (picture, hits.into_iter().sum())
    }

    /// Linear light of a row without surfaces.
    fn background(&self, y: usize) -> [f64; 3] {
        let t = (y as f32 + 0.5) / self.frame.size[1] as f32;
        std::array::from_fn(|c| {
            let [top, bottom] = self.frame.background.map(|b| b[c]);
            f64::from(linear_from_srgb(top + (bottom - top) * t))
        })
    }

    /// Premultiplied linear light over what is behind it, as pixels are stored.
    fn encoded(&self, color: [f64; 3], alpha: f64, behind: [f64; 3]) -> [u8; 4] {
        let byte = |v: f64| (srgb_from_linear(v as f32) * 255.0).round() as u8;
        if self.frame.has(Frame::TRANSPARENT) {
            if alpha <= 0.0 {
                return [0; 4];
            }
            let [r, g, b] = color.map(|v| byte(v / alpha));
            return [r, g, b, (alpha * 255.0).round() as u8];
        }
        let [r, g, b] = std::array::from_fn(|c| byte(color[c] + (1.0 - alpha) * behind[c]));
        [r, g, b, 255]
    }

    /// What a pixel shows: premultiplied linear light, and how much of what is behind it hides.
    fn pixel(&self, x: usize, y: usize, met: &mut Vec<Met>) -> [f64; 4] {
        let [width, height, ..] = self.frame.size.map(f64::from);
        let at = DVec3::new(2.0 * (x as f64 + 0.5) / width - 1.0, 1.0 - 2.0 * (y as f64 + 0.5) / height, 0.0);
        let [near, far] = [0.0, 1.0].map(|z| self.world_from_clip.project_point3(at.with_z(z)));
        let voxel = &self.view.voxel_from_world;
        let ray = Ray { origin: voxel.transform_point3(near), direction: voxel.transform_vector3(far - near) };
        let mut sum = [0.0; 4];
        let Some((range, cut)) = self.unclipped(near, far) else { return sum };
        met.clear();
        match self.view.inside {
            None => self.meet(&ray, range, cut, met),
            Some(inside) => {
                inside.spans([x, y], near, far - near, range, |span, normal| {
                    // the mesh, unless a plane cuts it open
                    let cut = if span[0] > range[0] { normal.map(|normal| Cut { normal, plane: false }) } else { cut };
                    self.meet(&ray, span, cut, met);
                    match met.last() {
                        Some(last) if self.surfaces[last.shell].0.opacity >= 1.0 => ControlFlow::Break(()),
                        _ => ControlFlow::Continue(()),
                    }
                });
            }
        }
        if self.surfaces.len() > 1 {
            met.sort_by(|a, b| a.t.total_cmp(&b.t));
        }
        for m in met.iter() {
            let point = near + m.t * (far - near);
            let shell = &self.surfaces[m.shell].0;
            let color = self.color(shell, point, ray.at(m.t), m);
            let part = (1.0 - sum[3]) * f64::from(shell.opacity);
            (0..3).for_each(|c| sum[c] += part * color[c]);
            sum[3] += part;
            if sum[3] > 0.999 {
                break;
            }
        }
        if sum[3] > 0.999 {
            sum[3] = 1.0;
        }
        sum
    }

    /// Finds where a part of a ray meets the surfaces.
    fn meet(&self, ray: &Ray, range: [f64; 2], cut: Option<Cut>, met: &mut Vec<Met>) {
        let mut capped = false;
        for (shell, (look, surface)) in self.surfaces.iter().enumerate() {
            surface.crossings(ray, range, |t, crossing| {
                let at_start = crossing == Crossing::Start && t <= range[0];
                // where the cut is within several, the innermost shows
                if crossing == Crossing::End || (at_start && capped) {
                    return ControlFlow::Continue(());
                }
                capped |= at_start;
                met.push(Met { t, shell, crossing, cut: cut.filter(|_| at_start) });
                if look.opacity >= 1.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
        }
    }

    /// The linear colour of a surface where it is met.
    fn color(&self, shell: &Shell, point: DVec3, voxel: DVec3, met: &Met) -> [f64; 3] {
        let view = self.view;
        let to_eye = view.eye.map_or(view.to_eye, |eye| (eye - point).normalize());
        // a gradient in the world
        let covariant = view.voxel_from_world.matrix3.transpose();
        let mut color = shell.color.map(f64::from);
        let normal = match (met.crossing, met.cut) {
            (Crossing::Start, Some(cut)) => {
                if let (Some(colors), true) = (&view.paint.caps, cut.plane) {
                    color = colors.at(self.data.value(voxel));
                }
                cut.normal
            }
            (Crossing::Start, None) => covariant * self.data.border(voxel),
            _ => {
                let gradient = covariant * self.data.gradient(voxel);
                if let Some((curvature, strength)) = view.paint.curvature {
                    let hessian = covariant * self.data.hessian(voxel) * covariant.transpose();
                    color = tinted(color, curvature.of(gradient, hessian) * strength);
                }
                gradient
            }
        };
        let normal = normal.try_normalize().unwrap_or(to_eye);
        let normal = if normal.dot(to_eye) < 0.0 { -normal } else { normal };
        self.shade(color, point, normal, to_eye)
    }

    /// The part of the way from `near` to `far` that no plane cuts away, and the plane it begins at.
    fn unclipped(&self, near: DVec3, far: DVec3) -> Option<([f64; 2], Option<Cut>)> {
        let (mut range, mut cut) = ([0.0, 1.0], None);
        for plane in self.view.clip {
            let (a, b) = (plane.beyond(near), plane.beyond(far));
            if a > 0.0 && b > 0.0 {
                return None;
            }
            let at = a / (a - b);
            if a > 0.0 && at > range[0] {
                range[0] = at;
                cut = Some(Cut { normal: plane.normal, plane: true });
            } else if b > 0.0 {
                range[1] = at.min(range[1]);
            }
        }
        (range[0] < range[1]).then_some((range, cut))
    }

    /// As the surfaces of slices are lit, less what the surroundings take away.
    fn shade(&self, color: [f64; 3], point: DVec3, n: DVec3, to_eye: DVec3) -> [f64; 3] {
        if !self.frame.has(Frame::LIT) {
            return color;
        }
        let [ambient, diffuse_weight, specular_weight, shininess] = self.frame.material.map(f64::from);
        let light = self.view.light;
        let half = (light + to_eye).normalize_or(to_eye);
        let diffuse = n.dot(light).max(0.0);
        let specular = n.dot(half).max(1e-6).powf(shininess);
        let open = self.view.occlusion.map_or(1.0, |o| o.ambient(point, n));
        let lit = if diffuse > 0.0 { self.view.shadows.map_or(1.0, |o| o.light(point, n, light)) } else { 1.0 };
        // hollows are dark even where the light shines into them, a little: it does not come back out
        let ambient = ambient * open * open;
        let diffuse = diffuse_weight * diffuse * lit * (0.3 + 0.7 * open);
        color.map(|c| c * (ambient + diffuse) + specular_weight * specular * lit)
    }
}

//! What a ray meets in the deformed object: where a hand takes hold.
//!
//! The ray is walked in steps of half the finest voxel; at each the backward map tells which value is there. With the volume's
//! own shading the point is where half of the light is gone, refined within the step; an iso-surface is where the isovalue is
//! crossed; for a maximum intensity picture it is the maximum.

use glam::{DAffine3, DVec2, DVec3};

use super::load::Object;
use crate::deform::Prepared;
use crate::math::BackwardMap;
use crate::mesh::TriMesh;
use crate::render::{Camera, Look, Projection, Shading};
use crate::volume::Volume;
use crate::volume::sampling::Sampler;
use crate::with_samples;

/// A line of sight in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    pub origin: DVec3,
    /// Unit length.
    pub direction: DVec3,
}

/// What is seen at a point of the deformed object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// In the deformed world.
    pub point: DVec3,
    /// Where the material was before any deformation.
    pub rest: DVec3,
    /// Voxel coordinates of `rest`.
    pub voxel: DVec3,
    /// Real value, of the channel that carries the opacity.
    pub value: f64,
    /// Unit normal of the surface, towards the eye.
    pub normal: DVec3,
}

/// More steps than this are not taken: the volume is then walked more coarsely.
const MOST_STEPS: f64 = 4096.0;

impl Ray {
    /// The ray through a point of a picture; `at` in pixels from its upper left corner.
    pub fn through(camera: &Camera, (width, height): (u32, u32), at: DVec2) -> Self {
        let world_from_clip = camera.clip_from_world(width, height).inverse();
        let x = 2.0 * at.x / f64::from(width.max(1)) - 1.0;
        let y = 1.0 - 2.0 * at.y / f64::from(height.max(1));
        let near = world_from_clip.project_point3(DVec3::new(x, y, 0.0));
        match camera.projection {
            Projection::Orthographic => Self { origin: near, direction: -camera.to_eye() },
            Projection::Perspective { .. } => {
                let eye = camera.eye();
                Self { origin: eye, direction: (near - eye).normalize() }
            }
        }
    }

    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    /// Distances at which the ray passes through the triangles of a mesh, ascending.
    pub fn crossings(&self, mesh: &TriMesh) -> Vec<f64> {
        let crossing = |t| mesh.crossing(t, self.origin, self.direction).map(|(at, _)| at);
        let mut found: Vec<f64> = mesh.triangles.iter().filter_map(crossing).collect();
        found.sort_by(f64::total_cmp);
        found
    }
}

/// Reads single values of the deformed volume.
pub struct Probe<'a> {
    object: &'a Object,
    map: Prepared,
    voxel_from_world: DAffine3,
    /// As [`crate::render::Look::gradient_opacity`].
    steep: Option<[f64; 2]>,
}

impl<'a> Probe<'a> {
    pub fn new(object: &'a Object) -> Self {
        let voxel_from_world = object.volume.grid.voxel_from_world();
        Self { object, map: object.stack.prepared(), voxel_from_world, steep: None }
    }

    /// With rays that see only what is steep enough, as the look says.
    #[must_use]
    pub fn seeing(self, look: &Look) -> Self {
        Self { steep: look.gradient_opacity.map(|g| g.map(f64::from)), ..self }
    }

    /// How steeply the undeformed values change at what is at a point of the deformed world, in parts of the window per voxel.
    fn steepness(&self, point: DVec3) -> f64 {
        let volume = &self.object.volume;
        let voxel = self.voxel_from_world.transform_point3(self.map.backward(point));
        let [lo, hi] = self.object.window;
        // what lies beyond the last voxel is like it
        let last = volume.grid.size() - 1.0;
        let value = |v: DVec3| {
            let real = value(volume, v.clamp(DVec3::ZERO, last)).unwrap_or(lo);
            ((real - lo) / (hi - lo)).clamp(0.0, 1.0)
        };
        DVec3::from(DVec3::AXES.map(|e| 0.5 * (value(voxel + e) - value(voxel - e)))).length()
    }

    /// Opacity of a value at a point of the deformed world.
    fn opacity(&self, value: f64, point: DVec3) -> f64 {
        let (transfer, [lo, hi]) = (&self.object.transfer, self.object.window);
        let s = ((value - lo) / (hi - lo)) as f32;
        let by_value = || f64::from(transfer.classify(s)[3]);
        if transfer.regions.is_empty() && (self.steep.is_none() || by_value() <= 0.0) {
            return by_value();
        }
        let steepness = self.steepness(point);
        let part = self.steep.map_or(1.0, |[from, to]| ((steepness - from) / (to - from).max(1e-6)).clamp(0.0, 1.0));
        part * f64::from(transfer.at(s, steepness as f32)[3])
    }

    /// What is at a point of the deformed world; `None` beyond the volume. The normal is along the gradient.
    pub fn at(&self, point: DVec3) -> Option<Hit> {
        let rest = self.map.backward(point);
        let voxel = self.voxel_from_world.transform_point3(rest);
        let value = value(&self.object.volume, voxel)?;
        Some(Hit { point, rest, voxel, value, normal: self.normal(point) })
    }

    /// Real value at a point of the deformed world; `None` beyond the volume.
    pub fn value(&self, point: DVec3) -> Option<f64> {
        let rest = self.map.backward(point);
        value(&self.object.volume, self.voxel_from_world.transform_point3(rest))
    }

    /// How many times larger material is than it was, at a point of the deformed world: 1 / det of the backward map's Jacobian.
    /// Not positive where space is folded.
    pub fn growth(&self, point: DVec3) -> f64 {
        1.0 / self.map.backward_with_jacobian(point).1.determinant()
    }

    /// The first thing seen along a ray.
    pub fn first(&self, ray: &Ray, shading: Shading) -> Option<Hit> {
        let object = self.object;
        let finest = object.volume.grid.finest();
        // a ray through an edge can miss both of its triangles: then the span between the outermost is what counts
        let crossings = ray.crossings(&object.mesh);
        let (first, last) = (crossings.first()?.max(0.0), *crossings.last()?);
        let inside = |t: f64| crossings.len() % 2 == 1 || crossings.partition_point(|c| *c <= t) % 2 == 1;
        let step = (0.5 * finest).max((last - first) / MOST_STEPS);
        let mut through = 1.0;
        let mut before = None;
        let mut best: Option<(f64, f64)> = None;
        // no surface is solid, but what was passed may still be what one means
        let mut most: Option<(f64, f64)> = None;
        let mut t = first + 1e-9 * finest;
        while t <= last {
            let point = ray.at(t);
            let seen = inside(t) && object.clip.iter().all(|plane| plane.beyond(point) <= 0.0);
            let value = if seen { self.value(point) } else { None };
            if let Some(value) = value {
                match shading {
                    Shading::Iso { value: iso, .. } => {
                        if value >= iso {
                            return self.hit(ray, self.crossing(ray, before, t, iso));
                        }
                    }
                    Shading::Mip => {
                        if best.is_none_or(|(_, b)| value > b) {
                            best = Some((t, value));
                        }
                    }
                    Shading::Volume => {
                        let a = self.opacity(value, point);
                        let stepped = 1.0 - (1.0 - a).powf(step / finest);
                        if most.is_none_or(|(_, m)| stepped * through > m) && stepped > 2e-3 {
                            most = Some((t, stepped * through));
                        }
                        through *= 1.0 - stepped;
                        if through < 0.5 {
                            return self.hit(ray, t);
                        }
                    }
                }
                before = Some(t);
            } else {
                before = None;
            }
            t += step;
        }
        self.hit(ray, best.or(most)?.0)
    }

    /// Where the isovalue lies between two steps.
    fn crossing(&self, ray: &Ray, before: Option<f64>, t: f64, iso: f64) -> f64 {
        let Some(mut low) = before else { return t };
        let mut high = t;
        for _ in 0..12 {
            let middle = 0.5 * (low + high);
            match self.value(ray.at(middle)) {
                Some(v) if v >= iso => high = middle,
                _ => low = middle,
            }
        }
        high
    }

    fn hit(&self, ray: &Ray, t: f64) -> Option<Hit> {
        let hit = self.at(ray.at(t))?;
        let towards = if hit.normal.dot(ray.direction) > 0.0 { -hit.normal } else { hit.normal };
        let normal = if towards == DVec3::ZERO { -ray.direction } else { towards };
        Some(Hit { normal, ..hit })
    }

    /// Unit gradient over two voxels to each side; zero where the volume is flat.
    fn normal(&self, point: DVec3) -> DVec3 {
        let h = 2.0 * self.object.volume.grid.finest();
        let here = self.value(point).unwrap_or(0.0);
        let along = |axis: DVec3| {
            let side = |s: f64| self.value(point + axis * s).unwrap_or(here);
            side(h) - side(-h)
        };
        DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)).normalize_or_zero()
    }
}

/// Trilinear real value at voxel coordinates, of the channel that carries the opacity.
fn value(volume: &Volume, voxel: DVec3) -> Option<f64> {
    let channels = volume.channels;
    let found =
        with_samples!(&volume.samples, samples => Sampler::new(samples, volume.grid.dims, channels).linear(voxel));
    found.map(|v| volume.rescale.real(v[channels - 1]))
}

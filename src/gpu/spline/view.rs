//! The view of a spline: the ray of each pixel in voxels, with more digits than `f32` has.

use glam::{DAffine3, DMat4, DVec3, DVec4};

use crate::gpu::layout::{SPLINE_PLANES, SplineViewUniform};
use crate::gpu::shader::SplinePaint;
use crate::spline::paint::{Curvature, NEGATIVE, POSITIVE, Paint, Shell};

/// How a spline is looked at.
#[derive(Debug, Clone)]
pub struct SplineView {
    /// Clip space (depth 0 near to 1 far) from the world; must be invertible.
    pub clip_from_world: DMat4,
    pub world_from_voxel: DAffine3,
    /// `None` in a parallel view.
    pub eye: Option<DVec3>,
    /// Unit direction to the eye along the view axis, in the world.
    pub to_eye: DVec3,
    /// What is cut away: points of planes and their outward normals, in the world.
    pub cuts: Vec<[DVec3; 2]>,
    /// Pixels.
    pub size: [u32; 2],
    pub paint: Paint,
    /// What takes light away, if the pass has it.
    pub shade: Shade,
}

/// Which light the surroundings take away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Shade {
    pub ambient: bool,
    pub light: bool,
}

/// A plane across the view, in voxels.
#[derive(Debug, Clone, Copy)]
struct Screen {
    /// The upper left corner of the picture, and the steps from pixel to pixel.
    origin: DVec3,
    across: DVec3,
    down: DVec3,
    /// The eye, or the unit direction of all rays.
    eye: Result<DVec3, DVec3>,
    /// How far it is from the eye along the view axis, in the world.
    distance: f64,
}

/// A half space that is cut away: outward normal and value at 0, per voxel; the normal of the cut in the world, none where
/// the eye's own near plane cuts.
type Plane = (DVec4, Option<DVec3>);

impl SplineView {
    /// Most planes that cut, beside the near and the far one of the view.
    pub const CUTS: usize = SPLINE_PLANES - 2;

    /// The ray through a pixel: a point on a plane across the view, from which depths are measured, and the unit direction, in
    /// voxels.
    pub fn ray(&self, dims: [usize; 3], x: f64, y: f64) -> [DVec3; 2] {
        let screen = self.screen(dims);
        let origin = screen.origin + x * screen.across + y * screen.down;
        [origin, screen.eye.map_or_else(|direction| direction, |eye| (origin - eye).normalize())]
    }

    fn screen(&self, dims: [usize; 3]) -> Screen {
        let [width, height] = self.size.map(f64::from);
        let voxel_from_world = self.world_from_voxel.inverse();
        let size = DVec3::from(dims.map(|n| n as f64));
        let middle = self.world_from_voxel.transform_point3(0.5 * size - 0.5);
        let at = match self.eye {
            None => middle,
            // never behind the eye
            Some(eye) => {
                let diagonal = self.world_from_voxel.transform_vector3(size).length();
                eye - self.to_eye * (eye - middle).dot(self.to_eye).max(0.1 * diagonal)
            }
        };
        let depth = self.clip_from_world.project_point3(at).z;
        let world_from_clip = self.clip_from_world.inverse();
        let corner = |x, y| voxel_from_world.transform_point3(world_from_clip.project_point3(DVec3::new(x, y, depth)));
        let origin = corner(-1.0, 1.0);
        Screen {
            origin,
            across: (corner(1.0, 1.0) - origin) / width,
            down: (corner(-1.0, -1.0) - origin) / height,
            eye: match self.eye {
                Some(eye) => Ok(voxel_from_world.transform_point3(eye)),
                None => Err(voxel_from_world.transform_vector3(-self.to_eye).normalize()),
            },
            distance: self.eye.map_or(0.0, |eye| (eye - at).dot(self.to_eye)),
        }
    }

    /// What is cut away of the domain. The near and the far plane are left out where they cut nothing.
    fn planes(&self, dims: [usize; 3]) -> Vec<Plane> {
        let clip_from_voxel = self.clip_from_world * DMat4::from(self.world_from_voxel);
        let [near, far] = [-clip_from_voxel.row(2), clip_from_voxel.row(2) - clip_from_voxel.row(3)];
        let mut planes: Vec<Plane> = self
            .cuts
            .iter()
            .map(|[point, normal]| {
                let across = self.world_from_voxel.matrix3.transpose() * *normal;
                let at_zero = (self.world_from_voxel.translation - *point).dot(*normal);
                (across.extend(at_zero), Some(*normal))
            })
            .collect();
        let cuts = |plane: &DVec4| corners(dims).any(|c| plane.dot(c.extend(1.0)) > 0.0);
        planes.extend([near, far].into_iter().filter(cuts).map(|p| (p, None)));
        for (plane, _) in &mut planes {
            let steepness = plane.truncate().length();
            if steepness > 0.0 {
                *plane /= steepness;
            }
        }
        planes.truncate(SPLINE_PLANES);
        planes
    }

    /// Whether rays may begin within the domain.
    pub fn cuts_in(&self, dims: [usize; 3]) -> bool {
        !self.planes(dims).is_empty()
    }

    /// As the shaders read it. `layered`: only what lies so many voxels behind the layer before is drawn.
    pub fn uniform(&self, dims: [usize; 3], shell: &Shell, layered: Option<f32>) -> SplineViewUniform {
        let iso = shell.iso;
        let screen = self.screen(dims);
        let [width, height] = self.size.map(f64::from);
        let clip_from_voxel = self.clip_from_world * DMat4::from(self.world_from_voxel);
        let far_corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)]
            .map(|(x, y)| screen.origin + x * screen.across + y * screen.down);
        let mut largest = DVec3::from(dims.map(|n| n as f64)).max_element();
        for p in far_corners.iter().chain(screen.eye.as_ref().ok()) {
            largest = largest.max(p.abs().max_element());
        }
        // 20 bits for the upper parts: four are left for half pixels and differences
        let quantum = (largest.log2().ceil() - 20.0).exp2();
        let planes = self.planes(dims);
        let m = self.world_from_voxel.matrix3;
        let (eye, eye_low) = match screen.eye {
            Ok(eye) => parts(eye, quantum, 1.0),
            Err(direction) => {
                let upper = direction.as_vec3();
                let low = (direction - upper.as_dvec3()).as_vec3();
                (upper.extend(0.0).to_array(), low.extend(0.0).to_array())
            }
        };
        let (origin, origin_low) = parts(screen.origin, quantum, 0.0);
        let (across, across_low) = parts(screen.across, quantum, 0.0);
        let (down, down_low) = parts(screen.down, quantum, 0.0);
        let [nx, ny, nz] = dims.map(|n| n as u32);
        let upper = iso as f32;
        let w = self.eye.map_or(1.0, |_| screen.distance);
        let pixel = (screen.across.length() + screen.down.length()) / w;
        let mut uniform = SplineViewUniform {
            clip_from_voxel: clip_from_voxel.as_mat4().to_cols_array_2d(),
            world_from_voxel: columns(m),
            covariant: columns(m.inverse().transpose()),
            origin,
            origin_low,
            across,
            across_low,
            down,
            down_low,
            eye,
            eye_low,
            dims: [nx, ny, nz, planes.len() as u32],
            iso: [
                upper,
                (iso - f64::from(upper)) as f32,
                (0.49 / self.reach(dims, &screen, &far_corners)) as f32,
                pixel as f32,
            ],
            ..bytemuck::Zeroable::zeroed()
        };
        for (i, (plane, normal)) in planes.iter().enumerate() {
            uniform.planes[i] = plane.as_vec4().to_array();
            uniform.normals[i] = normal.map_or([0.0; 4], |n| n.as_vec3().extend(1.0).to_array());
        }
        let [r, g, b] = shell.color;
        uniform.shell = [r, g, b, shell.opacity];
        uniform.peel = layered.map_or([0.0; 4], |behind| [1.0, behind, 0.0, 0.0]);
        self.colors(&mut uniform, iso);
        uniform
    }

    /// What fragments do for this view.
    pub fn painted(&self) -> SplinePaint {
        SplinePaint { shade: self.shade, curvature: self.paint.curvature.is_some() }
    }

    fn colors(&self, uniform: &mut SplineViewUniform, iso: f64) {
        let rgb = |[r, g, b]: [f32; 3]| [r, g, b, 1.0];
        (uniform.positive, uniform.negative) = (rgb(POSITIVE), rgb(NEGATIVE));
        if let Some((curvature, strength)) = self.paint.curvature {
            let kind = match curvature {
                Curvature::Mean => 1.0,
                Curvature::Gaussian => 2.0,
            };
            (uniform.tint[0], uniform.tint[1]) = (kind, strength as f32);
        }
        if let Some(colors) = &self.paint.caps {
            let [lo, hi] = colors.range;
            uniform.tint[2] = 1.0;
            uniform.window = [(1.0 / (hi - lo)) as f32, ((iso - lo) / (hi - lo)) as f32, 0.0, 0.0];
            uniform.caps.iter_mut().zip(&colors.table).for_each(|(out, color)| *out = rgb(*color));
        }
    }

    /// The largest depth, to either side, of a point of the domain in the picture, in voxels.
    fn reach(&self, dims: [usize; 3], screen: &Screen, far_corners: &[DVec3; 4]) -> f64 {
        let slant = |p: DVec3| match screen.eye {
            Ok(eye) => p.distance(eye),
            Err(_) => 0.0,
        };
        let depths = |p: DVec3| {
            let world = self.world_from_voxel.transform_point3(p);
            self.eye.map_or_else(|| -world.dot(self.to_eye), |eye| (eye - world).dot(self.to_eye))
        };
        let nearest = corners(dims).map(depths).fold(f64::INFINITY, f64::min);
        let farthest = corners(dims).map(slant).fold(0.0, f64::max);
        match screen.eye {
            Err(direction) => {
                let middle = 0.5 * (DVec3::from(dims.map(|n| n as f64)) - 1.0);
                let step = self.world_from_voxel.transform_vector3(direction).length();
                corners(dims).map(|c| (depths(c) - depths(middle)).abs()).fold(0.0, f64::max) / step
            }
            Ok(_) if nearest > 0.1 * screen.distance => farthest * (screen.distance / nearest - 1.0).abs().max(1.0),
            Ok(_) => farthest + far_corners.iter().copied().map(slant).fold(0.0, f64::max),
        }
    }
}

/// Of the domain.
fn corners(dims: [usize; 3]) -> impl Iterator<Item = DVec3> {
    let size = DVec3::from(dims.map(|n| n as f64));
    (0..8).map(move |i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * size - 0.5)
}

/// Upper bits, multiples of a power of two, and what is left.
fn parts(v: DVec3, quantum: f64, w: f32) -> ([f32; 4], [f32; 4]) {
    let upper = (v / quantum).round() * quantum;
    (upper.as_vec3().extend(w).to_array(), (v - upper).as_vec3().extend(0.0).to_array())
}

fn columns(m: glam::DMat3) -> [[f32; 4]; 3] {
    [m.x_axis, m.y_axis, m.z_axis].map(|c| c.as_vec3().extend(0.0).to_array())
}

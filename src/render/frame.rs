use glam::{DMat4, DVec3};

use super::{Camera, Field, Gradient, Look, Projection, Shading, SliceGeometry};
use crate::volume::transfer::linear_from_srgb;

/// Everything both renderers need for one picture, in `f32`. The layout is that of a uniform block: the GPU gets a copy.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Frame {
    /// Clip space from vertex positions (world minus the geometry's centre), by columns.
    pub clip_from_local: [[f32; 4]; 4],
    /// Perspective: the eye minus the geometry's centre, and 1. Orthographic: the unit direction to the eye, and 0.
    /// `normalize(eye.xyz - eye.w * p)` is the direction from `p` to the eye in both.
    pub eye: [f32; 4],
    /// Unit direction to the eye along the view axis; the distance of two slices.
    pub axis: [f32; 4],
    /// Unit direction to the light in the world; the finest voxel spacing.
    pub light: [f32; 4],
    /// Texels along i, j, k; channels.
    pub dims: [f32; 4],
    /// Scale and bias of `s = clamp(texel * scale + bias, 0, 1)`; the iso-value in the same units; the steepness above which
    /// something is seen, if [`Frame::STEEP`] is set.
    pub window: [f32; 4],
    /// Ambient, diffuse, specular, shininess.
    pub material: [f32; 4],
    /// Linear-light colour of the iso-surface; how fast opacity rises with the steepness.
    pub iso_color: [f32; 4],
    /// sRGB at the top and the bottom of the picture; unused.
    pub background: [[f32; 4]; 2],
    /// Width and height in pixels; one of [`Frame::VOLUME`], [`Frame::ISO`], [`Frame::MIP`]; flags.
    pub size: [u32; 4],
}

impl Frame {
    pub const VOLUME: u32 = 0;
    pub const ISO: u32 = 1;
    pub const MIP: u32 = 2;
    /// Flag: shading by light.
    pub const LIT: u32 = 1;
    /// Flag: forward differences towards the light.
    pub const FORWARD: u32 = 2;
    /// Flag: the background stays transparent.
    pub const TRANSPARENT: u32 = 4;
    /// Flag: the table depends on the value at the back.
    pub const PREINTEGRATED: u32 = 8;
    /// Flag: opacity by the steepness of the values.
    pub const STEEP: u32 = 16;

    /// The frame of a view. `window` holds the real values shown as 0 and 1; an iso-surface takes the field's whole range
    /// instead, so that no value is clamped.
    pub fn new(
        camera: &Camera,
        look: &Look,
        field: &Field,
        window: [f64; 2],
        geometry: &SliceGeometry,
        width: u32,
        height: u32,
    ) -> Self {
        let center = geometry.center;
        let clip = camera.clip_from_world(width, height) * DMat4::from_translation(center);
        let (eye, at) = match camera.projection {
            Projection::Orthographic => (camera.to_eye(), 0.0),
            Projection::Perspective { .. } => (camera.eye() - center, 1.0),
        };
        let axis = camera.to_eye();
        let light = (camera.axes() * look.light).try_normalize().unwrap_or(axis);
        let (mode, iso, color) = match look.shading {
            Shading::Volume => (Self::VOLUME, 0.0, [0.0; 3]),
            Shading::Iso { value, color } => (Self::ISO, value, color),
            Shading::Mip => (Self::MIP, 0.0, [0.0; 3]),
        };
        let window = if mode == Self::ISO { field.range } else { window };
        let [scale, bias] = field.window(window);
        let span = window[1] - window[0];
        let iso = if span > 0.0 { ((iso - window[0]) / span) as f32 } else { f32::INFINITY };
        let steep = look.gradient_opacity.filter(|_| mode == Self::VOLUME);
        let [from, rise] = steep.map_or([0.0; 2], |[lo, hi]| [lo, 1.0 / (hi - lo).max(1e-6)]);
        let [r, g, b, _] = rgb(color.map(linear_from_srgb));
        let mut flags = 0;
        for (set, flag) in [
            (look.lit, Self::LIT),
            (look.gradient == Gradient::Forward, Self::FORWARD),
            (look.transparent, Self::TRANSPARENT),
            (look.preintegrated, Self::PREINTEGRATED),
            (steep.is_some(), Self::STEEP),
        ] {
            flags |= if set { flag } else { 0 };
        }
        let size = field.grid.size().as_vec3();
        Self {
            clip_from_local: clip.as_mat4().to_cols_array_2d(),
            eye: vec4(eye, at),
            axis: vec4(axis, geometry.distance),
            light: vec4(light, field.grid.finest()),
            dims: [size.x, size.y, size.z, field.channels as f32],
            window: [scale, bias, iso, from],
            material: [look.ambient, look.diffuse, look.specular, look.shininess],
            iso_color: [r, g, b, rise],
            background: look.background.map(rgb),
            size: [width, height, mode, flags],
        }
    }

    pub fn has(&self, flag: u32) -> bool {
        self.size[3] & flag != 0
    }
}

fn vec4(v: DVec3, w: f64) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, w as f32]
}

fn rgb(c: [f32; 3]) -> [f32; 4] {
    [c[0], c[1], c[2], 1.0]
}

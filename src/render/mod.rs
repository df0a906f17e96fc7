//! L2: the view, the look, and the CPU renderer of slice geometry.
//!
//! # Theory
//!
//! A picture is made of view-aligned slices (Westermann and Rezk-Salama 2001, section 2.3), drawn back to front with
//! premultiplied `over`. This page is the contract that the CPU renderer here and the GPU passes in [`crate::gpu`] share;
//! both are compared by a test.
//!
//! A fragment lies at `p` on slice k. `q` is the point where the same viewing ray meets the next slice, away from the eye.
//! With `T` the map from the deformed world to texture space, the geometry carries `T(p)` (`front`), `T(q)` (`back`) and the
//! Jacobian `dT/dp`, all interpolated linearly over each triangle; `slicing-exact` evaluates them per fragment instead.
//!
//! - *Value*: `s(x)` is trilinear in texel centres, clamped to the edge, then mapped to the window:
//!   `clamp((real(x) - lo) / (hi - lo), 0, 1)`. A fragment with `front` outside `[0,1]^3` is not drawn.
//! - *Classification*: a 256 x 256 table over `(s(front), s(back))`, bilinear at texel centres `(i + 1/2)/256` where texel i
//!   stands for the value `i/255`: the coordinate of value s is `(s * 255 + 0.5) / 256`. Entries are linear-light, premultiplied,
//!   and already for the distance of two slices along the view axis ([`ClassTable`]). Without pre-integration the table is
//!   constant along its second axis.
//! - *Perspective*: a ray that meets the slices at an angle runs through `1/cos` times the distance:
//!   `a' = 1 - (1 - a)^(1/cos)`, and the colour scales by `a'/a`.
//! - *Gradient*: `g = (dT/dp)^T * grad_texture s(front)` by central differences of one texel to each side (clamped to the edge),
//!   in window units per world unit, then times the finest voxel spacing: window units per voxel. This is the gradient of the *deformed* field (section 3.3).
//!   [`Gradient::Forward`] takes `s(front) - s(T(p + h l))` towards the light instead, h the finest spacing, as the paper does.
//! - *Light*: `n = g / |g|`, turned to the eye; `diffuse = max(n.l, 0)` with `l` the direction to the light,
//!   `specular = max(n.h, 0)^shininess`. `w = min(|g| * 12, 1)`: where there is no surface there is no shading.
//!   `color = color * mix(1, ambient + diffuse_weight * diffuse, w) + alpha * w * specular_weight * specular`.
//! - *Iso*: drawn where `max(s(front), s(back)) >= iso`: if `s(front) >= iso` at `front`, else at `mix(front, back, t)`,
//!   `t = (iso - s(front)) / (s(back) - s(front))`; nearest by depth, opaque, shaded with `w = 1`.
//! - *MIP*: the largest `s(front)` along the ray; shown as grey with opacity 1 where anything was drawn.
//! - *Background*: a vertical gradient between two sRGB colours, mixed as sRGB; the result is encoded to sRGB at the end.

mod camera;
mod look;

pub use camera::{Camera, Projection};
pub use look::{Gradient, Look, Shading};

use std::ops::Range;
use std::sync::Arc;

use crate::volume::{Grid, Volume};

/// A corner of a slice triangle.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct SliceVertex {
    /// World position minus [`SliceGeometry::center`], so that `f32` is enough.
    pub position: [f32; 3],
    /// Texture coordinate of the value here.
    pub front: [f32; 3],
    /// Texture coordinate where the viewing ray meets the next slice away from the eye.
    pub back: [f32; 3],
    /// Derivative of the texture coordinate by world position: column c, for world axis c, at `3c..3c+3`.
    pub jacobian: [f32; 9],
}

/// View-aligned slices as triangles, ready to be drawn.
#[derive(Debug, Clone, Default)]
pub struct SliceGeometry {
    /// World point that vertex positions are relative to.
    pub center: glam::DVec3,
    pub vertices: Vec<SliceVertex>,
    pub indices: Vec<u32>,
    /// Index range of each slice, back to front. Ranges are contiguous, so one draw of all indices is in order.
    pub slices: Vec<Range<u32>>,
    /// Distance of two slices along the view axis, in world units.
    pub distance: f64,
}

/// The scalar or RGBA field in the form that renderers sample.
#[derive(Debug, Clone)]
pub struct Field {
    pub grid: Grid,
    /// 1: scalar. 4: RGBA in sRGB, where A takes the place of the scalar and RGB the place of the table's colour.
    pub channels: usize,
    /// Texels, x fastest, channels interleaved.
    pub texels: Texels,
    /// Real value of a texel as the sampler returns it (u8 and u16 as 0..1): `real = texel * scale + offset`.
    pub scale: f64,
    pub offset: f64,
    /// Smallest and largest real value (of the alpha channel for RGBA).
    pub range: [f64; 2],
}

/// Typed texels. `U8` and `U16` are normalised to 0..1 when sampled. Volumes of u8 and u16 are shared, not copied.
#[derive(Debug, Clone)]
pub enum Texels {
    Shared(Arc<Volume>),
    F32(Arc<Vec<f32>>),
}

/// A finished picture: 8-bit sRGB RGBA, rows top down.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    pub width: u32,
    pub height: u32,
    pub pixels: Vec<[u8; 4]>,
}

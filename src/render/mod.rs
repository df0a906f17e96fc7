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
//!   `clamp((real(x) - lo) / (hi - lo), 0, 1)`. A fragment with `front` outside `[0,1]^3` (by more than 1e-5) is not drawn, nor is a slice
//!   whose depth lies outside the clip range `0..=1`.
//! - *RGBA*: the value is A. RGB is interpolated as stored (sRGB), then made linear; the fragment's colour is that times the
//!   opacity of the table.
//! - *Classification*: a 256 x 256 table over `(s(front), s(back))`, bilinear at texel centres `(i + 1/2)/256` where texel i
//!   stands for the value `i/255`: the coordinate of value s is `(s * 255 + 0.5) / 256`. Entries are linear-light, premultiplied,
//!   and already for the distance of two slices along the view axis ([`ClassTable`]). Without pre-integration the table is
//!   constant along its second axis, and `s(back)` need not be sampled.
//! - *Regions* of the transfer function: opacity goes by the value and the steepness `g = |d| / 2` at `front`, `d` as below. The
//!   table is then over `(s(front), 1 - sqrt(g))`, of the same size, and not pre-integrated; `s(back)` is not sampled, six
//!   more values are, where the value alone does not tell that there is nothing.
//! - *Opacity by steepness* ([`Look::gradient_opacity`]): colour and opacity of the table times
//!   `clamp((|d| / 2 - from) / (to - from), 0, 1)`, `d` the differences of `s` over two texels along each axis at `front`: a property of
//!   the undeformed material, so it does not change when that is stretched.
//! - *Perspective*: a ray that meets the slices at an angle runs through `1/cos` times the distance:
//!   `a' = 1 - (1 - a)^(1/cos)`, and the colour scales by `a'/a`. The cosine is that of the fragment: `axis . v`, with `v` the
//!   unit direction from the fragment to the eye.
//! - *Gradient*: `g = (dT/dp)^T * grad_texture s(front)` by central differences of one texel to each side (clamped to the edge),
//!   in window units per world unit, then times the finest voxel spacing: window units per voxel. This is the gradient of the *deformed* field (section 3.3).
//! - *Light*: `n = g / |g|`, turned to the eye (`n.v >= 0`); `diffuse = max(n.l, 0)` with `l` the direction to the light,
//!   `specular = max(n.h, 0)^shininess` with `h = (l + v) / |l + v|`. `w = min(|g| * 12, 1)`: where there is no surface there is no shading.
//!   `color = color * mix(1, ambient + diffuse_weight * diffuse, w) + alpha * w * specular_weight * specular`.
//! - [`Gradient::Forward`], as in the paper, knows one difference towards the light only:
//!   `d = s(front) - s(front + h (dT/dp) l)`, h the finest spacing; `diffuse = clamp(12 d, 0, 1)`, `w = 1`, no specular.
//! - *Iso*: drawn where `max(s(front), s(back)) >= iso`: if `s(front) >= iso` at `x = front`, else at `x = mix(front, back, t)`,
//!   `t = (iso - s(front)) / (s(back) - s(front))`; nearest by depth, opaque, its colour shaded with `w = 1`, the gradient
//!   taken at `x` and everything else at the fragment. The window is the field's whole range, so nothing is clamped. If
//!   `|g| < 1e-5` (per voxel), that is rounding, and `n = v`.
//! - *MIP*: the largest `s(front)` along the ray, not lit; shown as the sRGB grey `s` with opacity 1 where anything was drawn.
//! - *Background*: a vertical gradient between two sRGB colours, mixed as sRGB at the pixel's centre (`(y + 1/2) / height`);
//!   the linear sum is encoded to sRGB at the end. A transparent picture has straight (not premultiplied) alpha: its colour is
//!   `encode(rgb / a)`, its alpha is linear; where `a = 0` all four are 0.
//!
//! [`Frame`] holds what these formulas take from the view and the look.

mod camera;
mod draw;
mod exact;
mod field;
mod frame;
mod look;
mod picture;
mod raster;
mod sampler;
mod shade;
mod skip;
mod table;
mod tile;

pub use camera::{Camera, Projection};
pub use draw::{Stop, render, render_until};
pub use exact::{Exact, Fragment};
pub use field::{Field, TexelSlice, Texels};
pub use frame::Frame;
pub use look::{Gradient, Look, Shading};
pub use picture::{Picture, PictureError};
pub use shade::FINISHED;
pub use table::{ClassTable, SIZE as TABLE_SIZE, Second};

use std::ops::Range;

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
#[derive(Debug, Clone, Default, PartialEq)]
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

//! L3: drawing and resampling on the GPU, off screen.
//!
//! # Theory
//!
//! The equations of a picture are those of [`crate::render`], which draws the same on the CPU; `tests/cpu_gpu.rs` compares
//! both. What differs is where the work goes: the slices are triangles for the rasterizer, the volume is a 3D texture, the
//! blending is the hardware's, into 16-bit floats (Westermann and Rezk-Salama 2001, sections 2.3 and 3).
//!
//! Departures from the paper: opacity is pre-integrated; an iso-surface is found by depth test, nearest slice first, so that
//! hidden fragments are not shaded; translucent slices, too, come nearest first, in parts between which pixels that became
//! opaque are marked; parts in which nothing can be seen are left out before they are drawn ([`cull`]);
//! export computes samples instead of drawing them ([`ResamplePass`], [`WarpPass`]); smooth iso-surfaces are drawn without slices
//! ([`SplinePass`]).
//!
//! # Practice
//!
//! [`Gpu::open`] picks an adapter, a software one where there is no other. [`Renderer`] keeps everything on the device between
//! pictures: set the field, the table and the geometry when they change, then draw. Bind groups go by how often they
//! change: 0 the frame, 1 the object, 2 the pass. A pass is a struct with `new` and `run`. Shaders are put together in
//! [`shader`], sizes and shared structs are in [`layout`]; both are tested without a GPU. Nothing here panics over what the
//! device does: every failure is a [`GpuError`].

mod bind;
pub mod cull;
mod deform;
mod device;
mod error;
pub mod layout;
mod opaque;
mod renderer;
mod resample;
mod resolve;
pub mod shader;
mod slicing;
pub mod spline;
mod timing;
mod volume;
pub mod warp;

pub use device::{Capabilities, Gpu, Preference};
pub use error::GpuError;
pub use renderer::Renderer;
pub use resample::{ResampleError, ResampleJob, ResamplePass, ResampleTally};
pub use spline::{Coefficients, Shade, SplineLoad, SplinePass, SplineView};
pub use timing::Timings;
pub use warp::{WarpGpuError, WarpLimits, WarpPass};

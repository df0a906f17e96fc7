//! Voxclay sculpts volumes: a CT scan, a simulation or a painted 3D texture is pulled and bent like clay, and keeps its inside.
//!
//! # The one way data flows
//!
//! ```text
//! file -> io -> scene (the document) -> evaluate -> { slice -> tessellate -> subdivide } -> render (CPU) | gpu draws
//!                                                                                         -> io writes
//! ```
//!
//! A closed triangle mesh ([`mesh`]) gives the object its *shape*, a 3D texture ([`volume`]) its *appearance*
//! (Westermann and Rezk-Salama 2001, section 2). [`deform`] answers, for a point of the deformed object, where in the
//! undeformed volume its value comes from. [`app`] and [`cli`] are thin doors: both turn what the user says into
//! [`scene::Edit`]s and ask [`evaluate`] for results.
//!
//! # Layers
//!
//! A module imports only from lower layers, and siblings of L2 do not import each other; `tests/layering.rs` checks it.
//!
//! | layer | modules |
//! |---|---|
//! | L0 | [`math`]: spaces, oriented boxes, quadratic B-splines, winding |
//! | L1 | [`volume`]: grid with its affine frame, sampling, histogram, transfer function, phantoms; [`mesh`]: surface mesh with edge list, checks, primitives; tetrahedral meshes, cells that become such, and how they are made |
//! | L2 | [`io`], [`deform`], [`slice`](mod@slice), [`tessellate`], [`subdivide`], [`render`] (view, shading, the CPU renderer of slice geometry), [`warp`]: tetrahedron rasterization, [`spline`]: smooth iso-surfaces, their rays and meshes, [`compare`]: metrics of pictures and volumes |
//! | L3 | [`scene`]: the document, edits, history, project file; [`gpu`]: device, passes, readback |
//! | L4 | [`evaluate`]: document -> derived data, on CPU or GPU; export |
//! | L5 | [`app`]: the modeller's window; [`cli`]: one file per verb |
//!
//! # Three spaces, one notation
//!
//! World (millimetres or the file's unit) -> texture `[0,1]^3` -> voxel (index, the centre of voxel 0 at 0). A matrix is
//! named `target_from_source`: `texture_from_world * point_in_world`. Start reading at [`evaluate`].
// but for hints to the processor (`math/prefetch.rs`)
#![deny(unsafe_code)]

pub mod app;
pub mod cli;
pub mod compare;
pub mod deform;
pub mod evaluate;
pub mod gpu;
pub mod io;
pub mod math;
pub mod mesh;
pub mod render;
pub mod scene;
pub mod slice;
pub mod spline;
pub mod subdivide;
pub mod tessellate;
pub mod volume;
pub mod warp;

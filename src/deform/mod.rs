//! L2: deformers: where in the undeformed volume the value at a point comes from.
//!
//! # Theory
//!
//! Every deformer is a *backward displacement field* `p -> p - D(p)` in world space, with a box outside which `D` is zero
//! and at whose faces `D` and its slope are zero: content is moved without a seam. The volume itself is never resampled
//! (Westermann and Rezk-Salama 2001, section 3.2).
//!
//! - [`DisplacementVolume`] is the paper's: `D = vector * Bu(u) Bv(v) Bw(w)`, quadratic B-splines in a frame whose w axis is
//!   the vector. [`Grab`] is the same in a ball. [`Lattice`] is a free-form deformation: a grid of handles with tensor
//!   B-spline weights. [`Brush`] inflates, pinches or twists a ball: there `D` is a matrix times the way from the centre.
//! - *Order.* A stack `D1..Dn` composes as `p -> D1(D2(..Dn(p)))`: the newest is undone first. The paper leaves overlapping
//!   volumes open; composition gives what an artist expects, that each stroke acts on what is already there.
//! - *Injectivity.* A deformation must not fold. For a displacement in one fixed direction, `V` along `d`, the determinant
//!   of the map is `1 - d . grad V`, and every line along `d` is mapped to itself; the map is injective exactly if it is
//!   monotone on all of those lines, that is if `max d . grad V < 1`. This maximum is the deformer's
//!   [`steepness`](Deformer::steepness); the steepest slope of the B-spline gives it in closed form. For a lattice
//!   `steepness` bounds the largest eigenvalue of the symmetric part of `grad D`; below 1, `p -> p - D(p)` is strictly
//!   monotone, hence injective. For a brush see [`Brush`]. Injective maps compose to an injective map, so a stack needs no bound of its own.
//! - *Shape* (section 3.1). The paper moves the mesh and leaves texture coordinates behind, which looks different from each
//!   view. Here a deformation that moves the shape is a volumetric map like all others: its inverse moves the vertices
//!   ([`Stack::forward`]), and the interior follows by the map itself.
//!
//! # Practice
//!
//! Deformers are plain values, checked when made or read, with public constructors and readable JSON. A [`Stack`] answers at
//! single points; [`Stack::prepared`] gives an evaluator for many points in `f64`, [`Prepared::blocks`] one for whole blocks
//! in `f32` or `f64`, and [`Prepared::in_frame`] one in the voxel coordinates of a grid, with bounds. A stroke that would fold is shortened by [`Deformer::limited`], which says by how much.

mod brush;
mod brush_kernel;
mod displacement;
mod error;
mod forward;
mod framed;
mod grab;
mod kernel;
mod lattice;
mod lattice_kernel;
mod limit;
mod prepared;
mod stack;

pub use brush::{Action, Brush};
pub use displacement::{DisplacementVolume, Extent};
pub use error::DeformError;
pub use framed::{Framed, Near};
pub use grab::{Falloff, Grab};
pub use lattice::Lattice;
pub use limit::{Limit, Limited};
pub use prepared::{Blocks, Prepared};
pub use stack::{Deformation, Deformer, Stack};

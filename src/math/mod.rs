//! L0: spaces, oriented boxes, B-splines, turns, winding and rows. Everything is `f64`, but for the blocks ([`Block`]) and
//! vectors ([`lanes`]) of hot loops, which may be `f32`.

mod backward;
mod block;
pub mod bspline;
pub mod lanes;
mod oriented_box;
pub mod parallel;
mod plane;
pub mod prefetch;
mod real;
pub mod rows;
pub mod turn;
pub mod winding;

pub use backward::{BackwardMap, Identity};
pub use block::{BLOCK, Block, BlockMap, JacobianBlock};
pub use oriented_box::OrientedBox;
pub use plane::PlaneFrame;
pub use real::Real;

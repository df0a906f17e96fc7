//! L0: spaces, oriented boxes and B-splines. Everything is `f64`, but for the blocks of hot loops ([`Block`]), which may be `f32`.

mod backward;
mod block;
pub mod bspline;
mod oriented_box;
pub mod parallel;
mod plane;
mod real;

pub use backward::{BackwardMap, Identity};
pub use block::{BLOCK, Block, BlockMap, JacobianBlock};
pub use oriented_box::OrientedBox;
pub use plane::PlaneFrame;
pub use real::Real;

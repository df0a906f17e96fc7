//! L0: spaces, oriented boxes and B-splines. Everything here is `f64`.

mod backward;
pub mod bspline;
mod oriented_box;
mod plane;

pub use backward::{BackwardMap, Identity};
pub use oriented_box::OrientedBox;
pub use plane::PlaneFrame;

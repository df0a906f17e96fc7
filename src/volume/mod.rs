//! L1: volumes: a grid with its affine frame, typed samples, and what is derived from them.

pub mod fetch;
mod grid;
pub mod joint;
pub mod phantom;
pub mod pyramid;
mod samples;
pub mod sampling;
pub mod statistics;
pub mod transfer;

pub use grid::{Grid, GridError, Space};
pub use samples::{Rescale, Samples, Scalar, ScalarType, Volume};

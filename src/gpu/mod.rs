//! L3: drawing and resampling on the GPU, off screen.

mod device;
mod error;

pub use device::{Capabilities, Gpu, Preference};
pub use error::GpuError;

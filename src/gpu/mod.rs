//! L3: drawing and resampling on the GPU, off screen.

pub mod cull;
mod deform;
mod device;
mod error;
pub mod layout;
mod renderer;
mod resample;
mod resolve;
pub mod shader;
mod slicing;
mod timing;
mod volume;

pub use device::{Capabilities, Gpu, Preference};
pub use error::GpuError;
pub use renderer::Renderer;
pub use resample::{ResampleError, ResampleJob, ResamplePass};
pub use timing::Timings;

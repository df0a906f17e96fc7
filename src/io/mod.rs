//! L2: files. One file per format, the reader beside the writer.
//!
//! Sizes in headers are never trusted before allocation: they are checked against the bytes that are really there.
//! Writes go to a temporary file beside the target, which is renamed when everything is written.

mod atomic;
mod bytes;
mod deflate;
mod error;
mod header;
mod store;
mod volume;

pub mod metaimage;
pub mod nifti;
pub mod nrrd;
pub mod obj;
pub mod ply;
pub mod raw;
pub mod stl;
mod surface;
mod text;

pub use atomic::write_atomic;
pub use error::IoError;
pub use surface::{is_surface_path, read_surface, read_surface_as_stored, write_surface};
pub use text::read_text;
pub use volume::{Encoding, WriteOptions, is_volume_path, read_grid, read_volume, write_volume};

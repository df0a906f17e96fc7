//! L3: the document: what a user made, small and plain, with large data referred to by name.

mod document;
mod project;

pub use document::{CameraSpec, Document, LookSpec, Placement, ProxySource, ShadingSpec, VolumeSource};
pub use project::{ProjectError, read_project, write_project};

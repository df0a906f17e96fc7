//! L3: the document: what a user made, small and plain, with large data referred to by name.

//!
//! A [`Document`] is changed by [`Edit`]s; a [`History`] keeps what it was before each of them. A project file
//! ([`read_project`], [`write_project`]) is a document with a thumbnail and, if wanted, the samples.

mod document;
mod edit;
mod history;
mod project;

pub use document::{CameraSpec, Clip, CutPlane, Document, LookSpec, Placement, ProxySource, ShadingSpec, VolumeSource};
pub use edit::{Edit, EditError};
pub use history::{History, Step};
pub use project::{Kept, Project, ProjectError, read_embedded, read_project, write_project};

//! L2: files. One file per format, the reader beside the writer.
//!
//! | | by name | formats |
//! |---|---|---|
//! | volumes | [`read_volume`], [`write_volume`] | [`nrrd`], [`nifti`], [`metaimage`], [`raw`]; read only: [`vti`], [`vtk`] |
//! | surfaces | [`read_surface`], [`write_surface`] | [`obj`], [`stl`], [`ply`]; read only: [`vtk`]; written only: [`glb`] |
//! | tetrahedral meshes | [`read_tets`], [`write_tets`] | [`vtu`], [`vtk`], [`gmsh`], [`medit`], [`tetgen`] |
//!
//! A volume may be a series in time, inside of one file or in numbered files beside each other: [`Series`].
//!
//! Sizes in headers are never trusted before allocation: they are checked against the bytes that are really there.
//! Writes go to a temporary file beside the target, which is renamed when everything is written.

mod atomic;
mod bytes;
mod deflate;
mod error;
mod header;
mod kind;
mod numbers;
mod series;
mod steps;
mod store;
mod surface;
mod tets;
mod text;
mod volume;
mod vtk_cells;
mod vtk_xml;
mod words;

pub mod glb;
pub mod gmsh;
pub mod medit;
pub mod metaimage;
pub mod nifti;
pub mod nrrd;
pub mod obj;
pub mod ply;
pub mod raw;
pub mod stl;
pub mod tetgen;
pub mod vti;
pub mod vtk;
pub mod vtu;

pub use atomic::write_atomic;
pub use error::IoError;
pub use kind::{FileKind, kind_of};
pub use series::Series;
pub use surface::{
    is_surface_output, is_surface_path, read_surface, read_surface_as_stored, write_surface, write_surface_with_normals,
};
pub use tets::{GmshVersion, TetWriteOptions, is_tets_path, keeps_vectors, read_cells, read_tets, write_tets};
pub use text::read_text;
pub use volume::{Encoding, WriteOptions, check_volume_output, is_volume_path, read_grid, read_volume, write_volume};

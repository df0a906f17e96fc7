use std::path::PathBuf;

use crate::{gpu, io, mesh, scene, volume};

/// Why a document cannot be evaluated.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    #[error(transparent)]
    Io(#[from] io::IoError),
    #[error(transparent)]
    Project(#[from] scene::ProjectError),
    #[error(transparent)]
    Gpu(#[from] gpu::GpuError),
    #[error(transparent)]
    Proxy(#[from] mesh::proxy::ProxyError),
    #[error(transparent)]
    Grid(#[from] volume::GridError),
    #[error(transparent)]
    Slice(#[from] crate::slice::SliceError),
    #[error(transparent)]
    Export(#[from] super::export::ExportError),
    #[error(transparent)]
    Lattice(#[from] mesh::tet_map::MapError),
    #[error(transparent)]
    Warp(#[from] crate::warp::WarpError),
    #[error(transparent)]
    Certificate(#[from] super::certificate::CertificateError),
    #[error(transparent)]
    Compare(#[from] crate::compare::CompareError),
    #[error(transparent)]
    Picture(#[from] crate::render::PictureError),
    #[error("{}: {what}; all steps of a series must have the same size, place and type", path.display())]
    StepDiffers { path: PathBuf, what: String },
    #[error("there is no phantom named '{0}'; there are: {names}", names = phantom_names())]
    NoSuchPhantom(String),
    #[error("a phantom of {0} voxels along its longest side cannot be made; 1 to 2048 can")]
    PhantomSize(usize),
    #[error("'{0}' is not a phantom; expected phantom:NAME or phantom:NAME:SIZE such as phantom:head:256")]
    PhantomWord(String),
    #[error("there is no transfer function named '{name}' and no file of that name; there are: {presets}")]
    NoSuchTransfer { name: String, presets: String },
    #[error("{}: {source}", path.display())]
    Transfer { path: PathBuf, source: volume::transfer::TransferError },
    #[error("{}: the mesh has no triangles, so it encloses nothing", .0.display())]
    EmptyMesh(PathBuf),
    #[error(
        "the placement scales the mesh by {0}, which leaves nothing of it; every factor must be finite and not zero"
    )]
    FlatPlacement(f64),
    #[error("there is no surface at {iso}: the values reach from {lo} to {hi}, and it must lie between them")]
    NoSurface { iso: f64, lo: f64, hi: f64 },
    #[error("the view has no direction: yaw and pitch must be finite")]
    View,
    #[error("the mesh spans {0} slices of one voxel each; give a number of slices, or a mesh in the volume's units")]
    TooManySlices(f64),
    #[error("the shape tools fold space over a vertex of the mesh, so that it has no single place; shorten the stroke")]
    Folded(#[from] crate::deform::DeformError),
}

fn phantom_names() -> String {
    volume::phantom::Phantom::ALL.iter().map(|p| p.name()).collect::<Vec<_>>().join(", ")
}

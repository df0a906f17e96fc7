//! `voxclay bench`: the papers' experiments on this machine.

mod plot;
mod spline;
mod warp;

use anyhow::Result;

use super::Answer;

/// Repeat the papers' experiments on this machine.
#[derive(clap::Args)]
#[command(after_help = "Example: voxclay bench warp --sizes 128,192,256 -o plots")]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand)]
enum What {
    /// Tetrahedron rasterization: time against resolution and against the number of tetrahedra, with and without culling
    /// (Gascon et al. 2013, figures 5 and 6).
    Warp(warp::Args),
    /// Smooth iso-surfaces against slices of the same volume, on the CPU and the GPU: time of a new isovalue and of a new
    /// view, tetrahedra found per second, time of a mesh.
    Spline(spline::Args),
}

pub fn run(args: &Args) -> Result<Answer> {
    match &args.what {
        What::Warp(args) => warp::run(args),
        What::Spline(args) => spline::run(args),
    }
}

//! The experiments of Gascon et al. (2013), section 5.1: a cube of voxels in a regular tetrahedral lattice, turned by 45
//! degrees about two axes, warped at several resolutions (their figure 5) and with lattices of several sizes (figure 6).

pub mod spline;

use std::time::Instant;

use glam::{DAffine3, DQuat, DVec3};

use crate::mesh::tet_lattice::{Split, TetLatticeError, cells_for, sample_extent, tet_lattice};
use crate::mesh::tets::bounds;
use crate::volume::sampling::Sampler;
use crate::volume::{Grid, GridError};
use crate::warp::cells::CELL;
use crate::warp::{Culling, Warp, WarpError, WarpOptions};

/// Why an experiment was not made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ExperimentError {
    #[error(transparent)]
    Lattice(#[from] TetLatticeError),
    #[error(transparent)]
    Grid(#[from] GridError),
    #[error(transparent)]
    Warp(#[from] WarpError),
    #[error("{0} bytes are more than this machine can give")]
    OutOfMemory(u64),
}

/// One way of finding the voxels of each tetrahedron.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// All voxels of the bounding boxes are tested.
    None,
    /// Those of the cells that culling leaves.
    Cells,
    /// They are solved for.
    Exact,
}

impl Way {
    pub const ALL: [Self; 3] = [Self::None, Self::Cells, Self::Exact];

    /// The word on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Cells => "cells",
            Self::Exact => "exact",
        }
    }

    fn culling(self) -> Culling {
        match self {
            Self::None => Culling::None,
            Self::Cells => Culling::Cells { size: CELL },
            Self::Exact => Culling::Exact,
        }
    }
}

/// What one warp took. Times in milliseconds, medians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Voxels along an edge of the input.
    pub size: usize,
    pub tets: usize,
    /// Voxels of the output, and those of them that were written.
    pub voxels: u64,
    pub written: u64,
    pub way: Way,
    /// Voxels that were looked at.
    pub candidates: u64,
    /// Voxels of all bounding boxes in whole cells of 8 voxels along an edge: what a GPU works through without culling.
    pub padded: u64,
    pub cull_ms: f64,
    /// Preparation, culling and drawing.
    pub total_ms: f64,
}

/// The turned cube.
pub struct TurnedCube {
    size: usize,
    samples: Vec<u16>,
    input: Grid,
}

impl TurnedCube {
    /// A cube of `size` voxels along an edge, filled with waves.
    ///
    /// # Errors
    /// If there is no memory for it, or its size makes no grid.
    pub fn new(size: usize) -> Result<Self, ExperimentError> {
        let input = Grid::aligned([size; 3], DVec3::ONE, DVec3::ZERO)?;
        let mut samples: Vec<u16> =
            bytemuck::try_zeroed_vec(input.len()).map_err(|()| ExperimentError::OutOfMemory(2 * input.len() as u64))?;
        crate::math::parallel::chunks_mut(&mut samples, size * size, &|z, layer| {
            for (i, v) in layer.iter_mut().enumerate() {
                let (x, y, z) = ((i % size) as f32, (i / size) as f32, z as f32);
                *v = (2048.0 + 1000.0 * (0.11 * x + 0.05 * z).sin() * (0.07 * y).cos() + 900.0 * (0.09 * z).sin())
                    as u16;
            }
        });
        Ok(Self { size, samples, input })
    }

    /// Warps the cube through a lattice of about `tets` tetrahedra, five to a box, in each of these ways.
    ///
    /// # Errors
    /// If there is no memory for it, or the lattice makes no sense.
    pub fn measure(&self, tets: usize, ways: &[Way], rounds: usize) -> Result<Vec<Measured>, ExperimentError> {
        let region = sample_extent(self.input.dims, &self.input.world_from_voxel)?;
        let mesh = tet_lattice(&region, cells_for(&region, tets, Split::Five)?, Split::Five)?;
        let center = DVec3::splat(0.5 * (self.size - 1) as f64);
        let turn = DQuat::from_rotation_x(45f64.to_radians()) * DQuat::from_rotation_z(45f64.to_radians());
        let moved: Vec<DVec3> = mesh.points.iter().map(|p| turn * (*p - center) + center).collect();
        let (lo, hi) = bounds(&moved).unwrap_or_default();
        let (lo, hi) = ((lo + 1e-6).floor(), (hi - 1e-6).ceil());
        let dims = (hi - lo + 1.0).to_array().map(|n| n as usize);
        let output = Grid::new(dims, DAffine3::from_translation(lo), self.input.space)?;
        let mut out: Vec<u16> = bytemuck::try_zeroed_vec(output.len())
            .map_err(|()| ExperimentError::OutOfMemory(2 * output.len() as u64))?;
        let sampler = Sampler::new(&self.samples, self.input.dims, 1);
        let mut rows = Vec::new();
        let mut times = vec![Vec::new(); ways.len()];
        // in turns, so that whatever else the machine does meets all ways alike
        for round in 0..rounds.max(1) {
            for (w, way) in ways.iter().enumerate() {
                let started = Instant::now();
                let warp = Warp::new(&self.input, &output, &mesh.tets, &mesh.points, &moved)?;
                let prepared = started.elapsed();
                let candidates = warp.candidates(way.culling())?;
                let culled = started.elapsed() - prepared;
                let tally = warp.run(&candidates, sampler, &WarpOptions::default(), &mut out)?;
                times[w].push((culled.as_secs_f64() * 1e3, started.elapsed().as_secs_f64() * 1e3));
                if round == 0 {
                    rows.push(Measured {
                        size: self.size,
                        tets: mesh.tets.len(),
                        voxels: output.len() as u64,
                        written: tally.written,
                        way: *way,
                        candidates: tally.candidates,
                        padded: candidates.padded(),
                        cull_ms: 0.0,
                        total_ms: 0.0,
                    });
                }
            }
        }
        for (row, times) in rows.iter_mut().zip(&times) {
            let median = |part: fn(&(f64, f64)) -> f64| {
                let mut v: Vec<f64> = times.iter().map(part).collect();
                v.sort_by(f64::total_cmp);
                v[v.len() / 2]
            };
            (row.cull_ms, row.total_ms) = (median(|t| t.0), median(|t| t.1));
        }
        Ok(rows)
    }
}

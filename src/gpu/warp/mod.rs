//! The warp through a deformed tetrahedral mesh, on the GPU.
//!
//! # Theory
//!
//! Gascon et al. (2013), as in [`crate::warp`], in two passes. The first finds the tetrahedron of each voxel: it rasterizes
//! into a buffer of owners, where the lowest number wins (an atomic maximum of the complement, so that 0 is nobody). The
//! second goes through the voxels in their order and samples the input where the owner takes them, so that it reads and
//! writes neighbours together, whatever the mesh.
//!
//! Which voxels are looked at is the caller's choice ([`crate::warp::Culling`]): all of the bounding boxes (section 3), those of the cells
//! that the masks leave (section 4; the tables are made on the CPU in parallel, as in the paper), or none: a thread a row
//! solves for the interval in which all coordinates are positive, and what it finds is written.
//!
//! **Signs are exact.** `f32` cannot tell which of two neighbours holds a voxel on their common face, and the pairs of `f32`
//! that could are at the mercy of the shader compiler. Faces and rest positions are therefore whole numbers of 64 bits
//! (`fixed.rs`), which all devices work out in the same way, and which agree with the CPU's `f64` on every tie. Solving rows
//! on the CPU would agree by construction, but it makes the CPU touch each row of each tetrahedron and sends 8 bytes for it;
//! here it lists 8 rows in 8 bytes.
//!
//! # Practice
//!
//! The output goes by in bricks (`bricks.rs`) that fit in the device's buffers, mostly slabs of whole layers. The input is
//! one texture of its own type, loaded as integers and blended in `f32` (the weights of a texture filter have 8 bits), or
//! several where it is larger than one may be (`input.rs`). Every dispatch is measured, and the next is as large as the time
//! for one allows (`pace.rs`). Values come back packed as they are stored.

mod bricks;
mod fixed;
mod input;
mod pace;
mod run;

use std::time::Duration;

use super::bind::{buffer_type, compute_pipelines, group_layout};
use super::layout::WarpTet;
use super::shader::{self, Texel};
use super::{Gpu, GpuError};
use crate::math::parallel;
use crate::volume::sampling::Interpolation;
use crate::volume::{Grid, Samples, Scalar, Volume};
use crate::warp::{Tally, Warp, WarpError, WarpOptions};
use crate::with_samples;

use bricks::Brick;
use input::Input;
use run::{Job, Run};

/// Why nothing was warped.
#[derive(Debug, Clone, thiserror::Error)]
pub enum WarpGpuError {
    #[error(transparent)]
    Gpu(#[from] GpuError),
    #[error(transparent)]
    Warp(#[from] WarpError),
    /// Known before anything is allocated.
    #[error("{0} on the GPU; use --backend cpu")]
    Unsupported(&'static str),
    #[error(
        "tetrahedron {0} reaches across more of the input than the GPU's coordinates can tell apart (2^18 voxels); \
         use --backend cpu"
    )]
    TooFar(u32),
    #[error("{tets} tetrahedra meet in one voxel, and this graphics adapter holds {limit} at once; use --backend cpu")]
    Crowded { tets: usize, limit: usize },
}

/// What is worked off at once. What is larger goes by in bricks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WarpLimits {
    /// Voxels of a brick of the output.
    pub voxels: usize,
    /// Voxels along its longest side; more than 2048 count as 2048.
    pub side: usize,
    /// Tetrahedra in a brick.
    pub tets: usize,
    /// Samples along a side of a texture.
    pub texture_side: u32,
    pub texture_bytes: u64,
    /// Bytes of all textures of the input that stay on the device.
    pub resident_bytes: u64,
    /// Bytes of a buffer.
    pub buffer_bytes: u64,
    /// What a dispatch may take.
    pub dispatch: Duration,
}

impl WarpLimits {
    /// What a device with these limits can do, and no more memory for the output than is useful.
    pub fn of(limits: &wgpu::Limits) -> Self {
        let buffer_bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        Self {
            voxels: 1 << 24,
            side: bricks::SIDE,
            tets: ((buffer_bytes / size_of::<WarpTet>() as u64) as usize).min(1 << 18),
            texture_side: limits.max_texture_dimension_3d,
            // software adapters refuse 2 GiB
            texture_bytes: 1 << 30,
            resident_bytes: 4 << 30,
            buffer_bytes,
            dispatch: Duration::from_millis(100),
        }
    }
}

/// Warps volumes.
#[derive(Debug)]
pub struct WarpPass {
    limits: WarpLimits,
    common_layout: wgpu::BindGroupLayout,
    claim_layout: wgpu::BindGroupLayout,
    sample_layout: wgpu::BindGroupLayout,
    /// Textures of the three kinds, and the pipelines that read them.
    kinds: [(wgpu::BindGroupLayout, wgpu::ComputePipeline); 3],
    solve: wgpu::ComputePipeline,
    claim: wgpu::ComputePipeline,
    test: wgpu::ComputePipeline,
}

/// Values beyond this are too coarse in `f32` for interpolation to be right to one unit.
const FINE: f64 = (1 << 20) as f64;

impl WarpPass {
    /// # Errors
    /// [`GpuError::Refusal`].
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        Self::with_limits(gpu, WarpLimits::of(gpu.limits()))
    }

    /// The same within narrower limits.
    ///
    /// # Errors
    /// As [`WarpPass::new`].
    pub fn with_limits(gpu: &Gpu, limits: WarpLimits) -> Result<Self, GpuError> {
        let group = |label, types: &[_]| group_layout(gpu, label, wgpu::ShaderStages::COMPUTE, types);
        let uniform = buffer_type(wgpu::BufferBindingType::Uniform);
        let [read, write] = [true, false].map(|read_only| buffer_type(wgpu::BufferBindingType::Storage { read_only }));
        let common_layout = group("warp", &[uniform, read, write]);
        let claim_layout = group("warp claim", &[read, write, write]);
        let sample_layout = group("warp sample", &[read, write]);
        let pipeline = |source: String, entry, groups: &[Option<&wgpu::BindGroupLayout>]| {
            compute_pipelines(gpu, &source, [entry], groups).map(|[pipeline]| pipeline)
        };
        let claims = |entry| pipeline(shader::warp_claim(), entry, &[Some(&common_layout), Some(&claim_layout)]);
        let kind = |texel: Texel| -> Result<_, GpuError> {
            let texture = wgpu::BindingType::Texture {
                sample_type: match texel {
                    Texel::Unsigned => wgpu::TextureSampleType::Uint,
                    Texel::Signed => wgpu::TextureSampleType::Sint,
                    Texel::Float => wgpu::TextureSampleType::Float { filterable: false },
                },
                view_dimension: wgpu::TextureViewDimension::D3,
                multisampled: false,
            };
            let layout = group("warp input", &[texture]);
            let groups = [Some(&common_layout), Some(&sample_layout), Some(&layout)];
            let made = pipeline(shader::warp_sample(texel), "sample_main", &groups)?;
            Ok((layout, made))
        };
        let [unsigned, signed, float] = Texel::ALL.map(kind);
        let kinds = [unsigned?, signed?, float?];
        let [solve, claim, test] = ["solve_main", "claim_main", "test_main"].map(claims);
        let (solve, claim, test) = (solve?, claim?, test?);
        Ok(Self { limits, common_layout, claim_layout, sample_layout, kinds, solve, claim, test })
    }

    /// Why these options or this volume are left to the CPU, if they are.
    pub fn unsupported(volume: &Volume, options: &WarpOptions) -> Option<&'static str> {
        let wide = match &volume.samples {
            Samples::U32(v) => !small(v),
            Samples::I32(v) => !small(v),
            Samples::F64(v) => !small(v) || options.outside.abs() > FINE || options.density,
            _ => false,
        };
        if options.interpolation == Interpolation::Cubic {
            Some("cubic interpolation is not done")
        } else if options.reference {
            Some("look-ups in f64 are not done")
        } else if wide || options.density && matches!(&volume.samples, Samples::U32(_) | Samples::I32(_)) {
            Some("numbers of 32 or 64 bits beyond 1048576, or densities of them, are not told apart finely enough")
        } else {
            None
        }
    }

    /// The input warped onto the output grid, as [`Warp::volume`] does it on the CPU: the same voxels are written, and values
    /// differ by one unit at most (`f32` and `f64` by the rounding of `f32`).
    ///
    /// # Errors
    /// If the options or the values are left to the CPU ([`WarpPass::unsupported`]), if there is no memory, or what the
    /// device reports.
    pub fn volume(
        &self,
        gpu: &Gpu,
        warp: &Warp,
        volume: &Volume,
        output: &Grid,
        options: &WarpOptions,
    ) -> Result<(Volume, Tally), WarpGpuError> {
        let channels = volume.channels;
        if let Some(reason) = Self::unsupported(volume, options) {
            return Err(WarpGpuError::Unsupported(reason));
        }
        if warp.dims() != output.dims {
            return Err(WarpError::Output {
                voxels: warp.dims().iter().product(),
                channels,
                samples: output.len() * channels,
            }
            .into());
        }
        let candidates = warp.candidates(options.culling)?;
        let mut samples = with_samples!(&volume.samples, v => zeroed(v, output.len() * channels))?;
        let outside = with_samples!(&volume.samples, v => bytes_of(v, options.outside));
        let mut limits = self.limits;
        // owners, and values of 4 bytes at most
        limits.voxels = limits.voxels.min((limits.buffer_bytes / (4 * channels as u64)) as usize);
        let bricks = Brick::all(warp, &limits)?;
        let mut input = Input::new(volume, &limits)?;
        let job = Job { warp, volume, options, candidates: &candidates, outside, dispatch: limits.dispatch };
        let mut run = Run::new(gpu, self, job, &bricks)?;
        for brick in &bricks {
            run.brick(brick, &mut input, &mut samples)?;
        }
        let mut tally = run.tally;
        tally.candidates = candidates.tested(tally.written + tally.repeated);
        (tally.cells, tally.cells_kept) = (candidates.cells, candidates.cells_kept);
        let mut made = Volume::new(*output, channels, samples);
        made.rescale = volume.rescale;
        Ok((made, tally))
    }
}

/// Whether all values are small enough; NaN is.
fn small<T: Scalar>(samples: &[T]) -> bool {
    const PIECE: usize = 1 << 16;
    let pieces = parallel::map(samples.len().div_ceil(PIECE), &|i| {
        let piece = &samples[i * PIECE..samples.len().min((i + 1) * PIECE)];
        piece.iter().all(|v| !(v.to_f64().abs() > FINE))
    });
    pieces.into_iter().all(|fine| fine)
}

fn zeroed<T: Scalar>(_: &[T], count: usize) -> Result<Samples, WarpError> {
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    bytemuck::try_zeroed_vec(count).map(T::wrap).map_err(|()| WarpError::OutOfMemory { bytes })
}

fn bytes_of<T: Scalar>(_: &[T], value: f64) -> Vec<u8> {
    bytemuck::bytes_of(&T::from_f64(value)).to_vec()
}

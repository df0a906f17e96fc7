//! The arguments of a picture, shared by the verbs that draw.

use std::path::PathBuf;

use anyhow::{Result, bail};

use crate::evaluate::picture::{Backend, Mode, Refinement, ViewOptions};
use crate::evaluate::{geometry, tets};
use crate::scene::{Document, ProxySource, ShadingSpec};

/// Which renderer or resampler does the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum BackendArg {
    /// The GPU if there is a hardware one, else the CPU.
    Auto,
    Cpu,
    Gpu,
}

impl From<BackendArg> for Backend {
    fn from(b: BackendArg) -> Self {
        match b {
            BackendArg::Auto => Self::Auto,
            BackendArg::Cpu => Self::Cpu,
            BackendArg::Gpu => Self::Gpu,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum ModeArg {
    /// Displaced texture coordinates on an adaptive subdivision of each slice.
    Slicing,
    /// The backward map for every fragment: the reference for the subdivision.
    SlicingExact,
    /// The volume warped through a lattice of tetrahedra, then drawn.
    Tets,
    /// The smooth iso-surface of a C1 spline.
    Spline,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum ShadingArg {
    /// Emission and absorption through the transfer function.
    Volume,
    /// The lit surface of one value.
    Iso,
    /// Maximum intensity.
    Mip,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum GradientArg {
    Central,
    /// Forward differences towards the light.
    Forward,
}

/// How a picture is taken; what is not given comes from the project.
#[derive(Debug, clap::Args)]
pub struct ViewArgs {
    #[command(flatten)]
    look: LookArgs,
    #[arg(long, value_enum, default_value = "slicing")]
    mode: ModeArg,
    /// Fixed depth, 0 to 8, of the 1 -> 4 subdivision inside displacement volumes, or level of a uniform lattice of
    /// tetrahedra (default: by --tolerance).
    #[arg(long, value_name = "D", value_parser = clap::value_parser!(u8).range(0..=8))]
    subdivision: Option<u8>,
    /// Largest error of the displaced coordinate, in voxels (default: 0.25, of tets 0.1).
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    tolerance: Option<f64>,
    /// Correction steps of --mode spline, 0 (smoothest) to 16 (default: 4 for floating-point samples, else 0).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=16))]
    corrections: Option<u32>,
    /// Leave the background transparent.
    #[arg(long)]
    transparent: bool,
}

/// What is seen, from where, and what draws it.
#[derive(Debug, clap::Args)]
pub struct LookArgs {
    /// The mesh that gives the shape: a file, `box`, `auto` or `auto:VALUE` (a hull around all at or above VALUE).
    #[arg(long, value_name = "M")]
    mesh: Option<String>,
    #[arg(long, value_enum)]
    shading: Option<ShadingArg>,
    /// Isovalue, in the volume's real values (implies --shading iso).
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    iso: Option<f64>,
    /// Width and height in pixels.
    #[arg(long, value_name = "WxH", default_value = "768x768", value_parser = parse_size)]
    size: (u32, u32),
    /// Number of slices (default: one per finest voxel).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    slices: Option<u32>,
    /// Degrees round the vertical axis, from the front.
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    yaw: Option<f64>,
    /// Degrees above the horizon.
    #[arg(long, value_name = "B", allow_negative_numbers = true)]
    pitch: Option<f64>,
    /// The picture is turned by this angle about the axis of view, in degrees.
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    roll: Option<f64>,
    #[arg(long, value_name = "Z")]
    zoom: Option<f64>,
    /// Preset (such as ct-bone; a wrong name lists them), file, or `auto`.
    #[arg(long, value_name = "NAME|FILE")]
    transfer: Option<String>,
    /// Without light.
    #[arg(long)]
    unlit: bool,
    #[arg(long, value_enum)]
    gradient: Option<GradientArg>,
    /// Parallel projection.
    #[arg(long)]
    orthographic: bool,
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendArg,
}

impl ViewArgs {
    /// Puts what was given into the document.
    pub fn apply(&self, document: &mut Document) -> Result<ViewOptions> {
        let (mode, usual) = match self.mode {
            ModeArg::Slicing => (Mode::Slicing, geometry::TOLERANCE),
            ModeArg::SlicingExact => (Mode::SlicingExact, geometry::TOLERANCE),
            ModeArg::Tets => (Mode::Tets, tets::TOLERANCE),
            ModeArg::Spline => (Mode::Spline, geometry::TOLERANCE),
        };
        if self.corrections.is_some() && self.mode != ModeArg::Spline {
            bail!("--corrections goes with --mode spline only");
        }
        let tolerance = checked_tolerance(self.tolerance)?.unwrap_or(usual);
        let refinement = self.subdivision.map_or(Refinement::Tolerance(tolerance), Refinement::Depth);
        let view = self.look.apply(document)?;
        if mode == Mode::Spline {
            match document.look.shading {
                ShadingSpec::Iso { .. } => {}
                _ if self.look.shading.is_some() => {
                    bail!("--mode spline shows an iso-surface; it goes with --shading iso only")
                }
                _ => document.look.shading = ShadingSpec::Iso { value: None },
            }
        }
        Ok(ViewOptions { mode, refinement, transparent: self.transparent, corrections: self.corrections, ..view })
    }
}

/// A tolerance in voxels, if one is given.
pub fn checked_tolerance(tolerance: Option<f64>) -> Result<Option<f64>> {
    if tolerance.is_some_and(|t| !(t.is_finite() && t > 0.0)) {
        bail!("--tolerance must be above 0 voxels");
    }
    Ok(tolerance)
}

impl LookArgs {
    /// Puts what was given into the document; mode and refinement of the view are the defaults.
    pub fn apply(&self, document: &mut Document) -> Result<ViewOptions> {
        if let Some(word) = &self.mesh {
            document.proxy = parse_proxy(word)?;
        }
        match (self.shading, self.iso) {
            (None | Some(ShadingArg::Iso), Some(v)) => document.look.shading = ShadingSpec::Iso { value: Some(v) },
            (Some(ShadingArg::Iso), None) => document.look.shading = ShadingSpec::Iso { value: None },
            (Some(ShadingArg::Volume), None) => document.look.shading = ShadingSpec::Volume,
            (Some(ShadingArg::Mip), None) => document.look.shading = ShadingSpec::Mip,
            (None, None) => {}
            (Some(_), Some(_)) => bail!("--iso goes with --shading iso only"),
        }
        let numbers = [
            ("--yaw", self.yaw),
            ("--pitch", self.pitch),
            ("--roll", self.roll),
            ("--zoom", self.zoom),
            ("--iso", self.iso),
        ];
        for (name, v) in numbers {
            if v.is_some_and(|v| !v.is_finite()) {
                bail!("{name} must be a finite number");
            }
        }
        if self.zoom.is_some_and(|z| !(1e-3..=1e3).contains(&z)) {
            bail!("--zoom must lie between 0.001 and 1000");
        }
        let camera = &mut document.camera;
        camera.yaw = self.yaw.unwrap_or(camera.yaw);
        camera.roll = self.roll.unwrap_or(camera.roll);
        camera.pitch = self.pitch.unwrap_or(camera.pitch);
        camera.zoom = self.zoom.unwrap_or(camera.zoom);
        if self.orthographic {
            camera.fov_y = None;
        }
        if let Some(name) = &self.transfer {
            document.transfer.clone_from(name);
        }
        if self.unlit {
            document.look.lit = false;
        }
        if let Some(g) = self.gradient {
            document.look.forward_gradient = g == GradientArg::Forward;
        }
        Ok(ViewOptions {
            size: self.size,
            slices: self.slices.map(|n| n as usize),
            mode: Mode::default(),
            refinement: Refinement::Tolerance(geometry::TOLERANCE),
            backend: self.backend.into(),
            transparent: false,
            corrections: None,
        })
    }
}

/// `box`, `auto`, `auto:VALUE` or a file.
pub fn parse_proxy(word: &str) -> Result<ProxySource> {
    Ok(match word {
        "box" => ProxySource::Box,
        "auto" => ProxySource::Auto { iso: None },
        _ => match word.strip_prefix("auto:") {
            Some(v) => match v.parse::<f64>() {
                Ok(v) if v.is_finite() => ProxySource::Auto { iso: Some(v) },
                _ => bail!("--mesh {word}: expected auto:VALUE with a number, such as auto:0.25"),
            },
            None => ProxySource::Mesh(PathBuf::from(word)),
        },
    })
}

pub(super) fn parse_size(word: &str) -> Result<(u32, u32), String> {
    let wrong = || format!("'{word}' is not a size; expected WIDTHxHEIGHT such as 768x768, each 1 to 16384");
    let (w, h) = word.split_once(['x', 'X']).ok_or_else(wrong)?;
    let side = |s: &str| s.parse::<u32>().ok().filter(|n| (1..=16384).contains(n));
    Ok((side(w).ok_or_else(wrong)?, side(h).ok_or_else(wrong)?))
}

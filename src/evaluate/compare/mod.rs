//! Every mode against the reference, on the same object in the same view.
//!
//! # Theory
//!
//! There are two references. A *picture* is compared with that of `slicing-exact` on the CPU: the backward map in `f64` at
//! every fragment. A resampled *volume* is compared with the export that evaluates the map in `f64` at every voxel. Drawing
//! a resampled volume interpolates twice, so even the reference volume does not give the reference picture; modes that
//! resample are therefore also compared with the picture of the reference volume, in which only their own error is left.
//!
//! Interpolated coordinates are exact to second order: halving the edges takes the error to a quarter, as long as it is
//! not yet as small as the rounding of `f32` (some 1e-4 voxels of slices). So each row of a series has the error of its
//! coordinates, measured in voxels against the exact map, and how it fell from the row before.
//!
//! # Practice
//!
//! [`compare`] works one mode after the other and keeps pictures, not volumes. *Per frame* is a new view of the same
//! deformation; *per change* includes all that a changed stroke makes necessary (the proxy mesh, which is common to all,
//! aside). Both are the best of up to three runs. [`html`] makes a report of it.

mod html;
mod measure;

use std::time::Instant;

use super::EvaluateError;
use super::export::{self, ExportOptions, Precision, unwatched};
use super::geometry;
use super::load::Object;
use super::picture::{Backend, Mode, Refinement, Renderer, ViewOptions, geometry_options};
use super::tets;
use crate::compare::picture::{DifferenceMap, Scale, pictures};
use crate::compare::{self as metrics, Difference};
use crate::render::{Camera, Look, Picture};
use crate::volume::Volume;
use crate::volume::statistics::statistics;

pub use html::html;
pub use measure::{CoordinateError, Interior, STEP};

/// A mode with its setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Way {
    /// Slices subdivided to a depth or a tolerance.
    Slicing(Refinement),
    SlicingExact,
    /// The exported volume, drawn.
    Export(Precision),
    /// Through a lattice, uniform of a level or to a tolerance.
    Tets(Refinement),
}

impl Way {
    /// Subdivision depths, then to the default tolerance.
    pub fn slicing() -> Vec<Self> {
        let depths = (0..=5).map(Refinement::Depth);
        depths.chain([Refinement::Tolerance(geometry::TOLERANCE)]).map(Self::Slicing).collect()
    }

    /// Levels of a uniform lattice, then to the default tolerance.
    pub fn tets() -> Vec<Self> {
        let levels = (0..=4).map(Refinement::Depth);
        levels.chain([Refinement::Tolerance(tets::TOLERANCE)]).map(Self::Tets).collect()
    }

    /// All modes with all settings.
    pub fn all() -> Vec<Self> {
        let single = [Self::SlicingExact, Self::Export(Precision::Reference), Self::Export(Precision::Fast)];
        [Self::slicing(), single.to_vec(), Self::tets()].concat()
    }

    /// The mode's name on the command line.
    pub fn mode(self) -> &'static str {
        match self {
            Self::Slicing(_) => "slicing",
            Self::SlicingExact => "slicing-exact",
            Self::Export(_) => "export",
            Self::Tets(_) => "tets",
        }
    }

    /// The setting in words.
    pub fn setting(self) -> String {
        match self {
            Self::Slicing(Refinement::Depth(d)) => format!("depth {d}"),
            Self::Tets(Refinement::Depth(l)) => format!("level {l}"),
            Self::Slicing(Refinement::Tolerance(t)) | Self::Tets(Refinement::Tolerance(t)) => format!("{t} voxel"),
            Self::Slicing(Refinement::Draft) | Self::Tets(Refinement::Draft) => "draft".to_owned(),
            Self::SlicingExact => "every fragment".to_owned(),
            Self::Export(Precision::Reference) => "reference".to_owned(),
            Self::Export(Precision::Fast) => "slicing".to_owned(),
        }
    }

    /// Whether `next` is the same with edges of half the length.
    fn is_halved_by(self, next: Self) -> bool {
        match (self, next) {
            (Self::Slicing(Refinement::Depth(a)), Self::Slicing(Refinement::Depth(b)))
            | (Self::Tets(Refinement::Depth(a)), Self::Tets(Refinement::Depth(b))) => u32::from(a) + 1 == u32::from(b),
            _ => false,
        }
    }
}

/// How a resampled volume differs from the reference volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VolumeDifference {
    /// In real values.
    pub all: Difference,
    pub interior: Interior,
    /// The picture, against the picture of the reference volume.
    pub drawn: Difference,
}

/// Milliseconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Times {
    /// A new view.
    pub frame: f64,
    /// A new deformation and a view of it.
    pub change: f64,
}

/// One mode against the reference.
#[derive(Debug, Clone)]
pub struct Pair {
    pub way: Way,
    pub picture: Picture,
    pub map: DifferenceMap,
    /// Of the pictures, in steps of 255.
    pub difference: Difference,
    /// Slice triangles of the picture.
    pub triangles: usize,
    pub tets: Option<usize>,
    /// Of modes that interpolate coordinates.
    pub coordinate: Option<CoordinateError>,
    /// By how much the largest and the mean error of the coordinates are smaller than those of the pair before, which has
    /// edges of twice the length.
    pub falls: Option<[f64; 2]>,
    /// Of modes that resample.
    pub volume: Option<VolumeDifference>,
    pub ms: Times,
}

/// What was compared.
#[derive(Debug, Clone)]
pub struct Comparison {
    pub reference: Picture,
    pub pairs: Vec<Pair>,
    /// One for all pictures of differences.
    pub scale: Scale,
    /// Size of the input and of the resampled volumes.
    pub input: [usize; 3],
    pub output: [usize; 3],
    /// Smallest and largest real value of the input.
    pub range: [f64; 2],
    pub device: String,
}

/// What all modes are compared with.
struct Reference<'a> {
    object: &'a Object,
    camera: &'a Camera,
    look: &'a Look,
    view: ViewOptions,
    picture: Picture,
    /// If any mode resamples.
    resampled: Option<(Volume, Picture)>,
    range: f64,
}

/// Compares modes. The view's mode and refinement play no part; `watch` hears what is done next.
///
/// # Errors
/// If the view is degenerate, a tolerance is impossible, there are too many voxels or tetrahedra, or the GPU fails.
pub fn compare(
    object: &Object,
    camera: &Camera,
    look: &Look,
    view: &ViewOptions,
    ways: &[Way],
    watch: &dyn Fn(&str),
) -> Result<Comparison, EvaluateError> {
    let look = Look { transparent: false, ..*look };
    let view = ViewOptions { transparent: false, ..*view };
    watch("the reference");
    let exact = ViewOptions { mode: Mode::SlicingExact, ..view };
    let (picture, _) = Renderer::new(Backend::Cpu)?.picture(object, camera, &look, &exact)?;
    let mut renderer = Renderer::new(view.backend)?;
    let facts = statistics(&object.volume);
    let range = Some(facts.max - facts.min).filter(|r| r.is_finite() && *r > 0.0).unwrap_or(1.0);
    let mut output = object.volume.grid.dims;
    let mut reference = Reference { object, camera, look: &look, view, picture, resampled: None, range };
    if ways.iter().any(|w| matches!(w, Way::Export(_) | Way::Tets(_))) {
        let options = ExportOptions { precision: Precision::Reference, ..ExportOptions::default() };
        let (volume, _) = export::export(&object.volume, &object.stack.prepared(), &options, &unwatched)?;
        output = volume.grid.dims;
        let drawn = tets::undeformed(object, volume.clone());
        let (picture, _) = renderer.picture(&drawn, camera, &look, &plain(&view))?;
        reference.resampled = Some((volume, picture));
    }
    let mut pairs: Vec<Pair> = Vec::with_capacity(ways.len());
    let mut device = String::new();
    for way in ways {
        watch(&format!("{} {}", way.mode(), way.setting()));
        let (mut pair, on) = reference.pair(*way, &mut renderer)?;
        device = on;
        pair.falls = pairs.last().and_then(|last| {
            let (before, now) = (last.coordinate?, pair.coordinate?);
            last.way.is_halved_by(*way).then_some([before.max / now.max, before.mean / now.mean])
        });
        pairs.push(pair);
    }
    let largest = pairs.iter().map(|p| p.map.max()).max().unwrap_or(0);
    Ok(Comparison {
        reference: reference.picture,
        pairs,
        scale: Scale::reaching(largest),
        input: object.volume.grid.dims,
        output,
        range: [facts.min, facts.max],
        device,
    })
}

/// The view of an object that is not deformed any more.
fn plain(view: &ViewOptions) -> ViewOptions {
    ViewOptions { mode: Mode::Slicing, refinement: Refinement::Depth(0), ..*view }
}

impl Reference<'_> {
    /// Compares one mode; also says what drew it.
    fn pair(&self, way: Way, renderer: &mut Renderer) -> Result<(Pair, String), EvaluateError> {
        let (object, view) = (self.object, &self.view);
        let map = object.stack.prepared();
        let input = &object.volume.grid;
        match way {
            Way::Slicing(refinement) => {
                let view = ViewOptions { mode: Mode::Slicing, refinement, ..*view };
                let drawn = self.draw(object, &view, renderer)?;
                let slices = geometry::slices(object, self.camera, &geometry_options(&view))?;
                let coordinate = measure::slice_error(&slices, &map, input);
                let ms = Times { frame: drawn.ms, change: drawn.ms };
                self.finish(way, drawn, Some(coordinate), None, ms)
            }
            Way::SlicingExact => {
                let drawn = self.draw(object, &ViewOptions { mode: Mode::SlicingExact, ..*view }, renderer)?;
                let ms = Times { frame: drawn.ms, change: drawn.ms };
                self.finish(way, drawn, None, None, ms)
            }
            Way::Export(precision) => {
                let options = ExportOptions { precision, ..ExportOptions::default() };
                let (made, ms) = best(|| Ok(export::export(&object.volume, &map, &options, &unwatched)?.0))?;
                self.resampled(way, made, ms, None, renderer)
            }
            Way::Tets(refinement) => {
                let (made, ms) = best(|| tets::through(object, &ExportOptions::default(), refinement))?;
                let r = made.lattice.report;
                let error = CoordinateError { max: r.max_error, mean: r.mean_error, samples: r.samples };
                self.resampled(way, made.volume, ms, Some((r.tets, error)), renderer)
            }
        }
    }

    /// A mode that makes a volume first, in `ms`.
    fn resampled(
        &self,
        way: Way,
        volume: Volume,
        ms: f64,
        lattice: Option<(usize, CoordinateError)>,
        renderer: &mut Renderer,
    ) -> Result<(Pair, String), EvaluateError> {
        let found = match &self.resampled {
            Some((reference, picture)) => {
                let all = metrics::volumes(&volume, reference, self.range)?;
                let (map, input) = (self.object.stack.prepared(), &self.object.volume.grid);
                Some((all, measure::interior(&volume, reference, &map, input, self.range), picture))
            }
            None => None,
        };
        let (object, ms_field) = timed(|| tets::undeformed(self.object, volume));
        let drawn = self.draw(&object, &plain(&self.view), renderer)?;
        let difference = match found {
            Some((all, interior, picture)) => {
                let drawn = pictures(&drawn.picture.pixels, &picture.pixels, self.size())?;
                Some(VolumeDifference { all, interior, drawn })
            }
            None => None,
        };
        let ms = Times { frame: drawn.ms, change: ms + ms_field + drawn.ms };
        let (mut pair, on) = self.finish(way, drawn, lattice.map(|l| l.1), difference, ms)?;
        pair.tets = lattice.map(|l| l.0);
        Ok((pair, on))
    }

    fn draw(&self, object: &Object, view: &ViewOptions, renderer: &mut Renderer) -> Result<Drawn, EvaluateError> {
        let ((picture, report), ms) = best(|| renderer.picture(object, self.camera, self.look, view))?;
        Ok(Drawn { picture, triangles: report.triangles, device: report.device, ms })
    }

    fn size(&self) -> [u32; 2] {
        [self.picture.width, self.picture.height]
    }

    fn finish(
        &self,
        way: Way,
        drawn: Drawn,
        coordinate: Option<CoordinateError>,
        volume: Option<VolumeDifference>,
        ms: Times,
    ) -> Result<(Pair, String), EvaluateError> {
        let (a, b) = (&drawn.picture.pixels, &self.picture.pixels);
        let pair = Pair {
            way,
            map: DifferenceMap::new(a, b, self.size())?,
            difference: pictures(a, b, self.size())?,
            triangles: drawn.triangles,
            tets: None,
            coordinate,
            falls: None,
            volume,
            ms,
            picture: drawn.picture,
        };
        Ok((pair, drawn.device))
    }
}

struct Drawn {
    picture: Picture,
    triangles: usize,
    device: String,
    ms: f64,
}

fn timed<R>(work: impl FnOnce() -> R) -> (R, f64) {
    let clock = Instant::now();
    let made = work();
    (made, clock.elapsed().as_secs_f64() * 1e3)
}

/// Runs of the same work, at most, and milliseconds after which there is no further one.
const RUNS: usize = 3;
const ENOUGH: f64 = 1500.0;

/// The result of the work, and the least time of some runs of it.
fn best<R>(mut work: impl FnMut() -> Result<R, EvaluateError>) -> Result<(R, f64), EvaluateError> {
    let (mut made, mut least) = timed(&mut work);
    let mut spent = least;
    for _ in 1..RUNS {
        if spent > ENOUGH || made.is_err() {
            break;
        }
        // not two results at once
        drop(made);
        let ms;
        (made, ms) = timed(&mut work);
        least = least.min(ms);
        spent += ms;
    }
    Ok((made?, least))
}

//! What the worker makes for the window: pictures beside each other, sections, the triangles of a slice.

use std::sync::Arc;
use std::time::Instant;

use eframe::egui::ColorImage;
use glam::DVec3;

use super::worker::Want;
use crate::compare::Difference;
use crate::compare::picture::{DifferenceMap, Scale, pictures};
use crate::evaluate::load::Object;
use crate::evaluate::picture::{Mode, PictureReport, Refinement};
use crate::evaluate::section::Section;
use crate::evaluate::{EvaluateError, geometry};
use crate::render::Picture;

/// A picture and its other, if there is one.
#[derive(Debug, Clone)]
pub struct Shown {
    pub generation: u64,
    pub image: Arc<ColorImage>,
    pub other: Option<OtherShown>,
    pub report: PictureReport,
    /// Part of the full resolution along each side.
    pub scale: f32,
    pub moving: bool,
    /// Nothing finer will come.
    pub last: bool,
    pub asked: Instant,
}

#[derive(Debug, Clone)]
pub struct OtherShown {
    pub image: Arc<ColorImage>,
    /// In false colours.
    pub difference: Arc<ColorImage>,
    pub scale: Scale,
    pub metrics: Difference,
    pub report: PictureReport,
}

/// Three sections, across i, j and k.
#[derive(Debug, Clone)]
pub struct Sections {
    pub planes: [(Section, Vec<f32>); 3],
    /// How much material has grown, if it was asked for.
    pub growth: Option<[Vec<f32>; 3]>,
    pub point: DVec3,
}

/// More edges than this cannot be told apart.
const MOST_EDGES: usize = 60_000;

/// Figure 7 of the paper: how the slice through the middle is split.
pub(super) fn tessellation(object: &Object, want: &Want) -> Result<Vec<[DVec3; 2]>, EvaluateError> {
    let options = geometry::GeometryOptions {
        slices: Some(1),
        refinement: if want.moving { Refinement::Draft } else { Refinement::Tolerance(geometry::TOLERANCE) },
        subdivide: want.mode == Mode::Slicing,
        size: want.size,
    };
    let slice = geometry::slices(object, &object.camera(&want.document.camera), &options)?;
    let mut edges: Vec<(u32, u32)> = slice
        .indices
        .as_chunks::<3>()
        .0
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .map(|(a, b)| (a.min(b), a.max(b)))
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges.truncate(MOST_EDGES);
    let place = |i: u32| {
        let [x, y, z] = slice.vertices[i as usize].position.map(f64::from);
        slice.center + DVec3::new(x, y, z)
    };
    Ok(edges.into_iter().map(|(a, b)| [place(a), place(b)]).collect())
}

pub(super) fn image(picture: &Picture) -> ColorImage {
    let size = [picture.width as usize, picture.height as usize];
    ColorImage::from_rgba_unmultiplied(size, picture.pixels.as_flattened())
}

pub(super) fn against(a: &Picture, b: &Picture, report: PictureReport) -> Result<OtherShown, EvaluateError> {
    let size = [a.width, a.height];
    let map = DifferenceMap::new(&a.pixels, &b.pixels, size)?;
    let scale = Scale::reaching(map.max());
    let colors: Vec<u8> = map.values.iter().flat_map(|v| scale.color(*v)).collect();
    Ok(OtherShown {
        image: Arc::new(image(b)),
        difference: Arc::new(ColorImage::from_rgba_unmultiplied([a.width as usize, a.height as usize], &colors)),
        scale,
        metrics: pictures(&a.pixels, &b.pixels, size)?,
        report,
    })
}

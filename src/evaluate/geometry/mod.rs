//! Slices of an object for a view: the one place where slicing, tessellation, subdivision and deformation meet.
//!
//! Each plane's section of the proxy mesh is split where it meets the support boxes of the deformation. Outside, texture
//! coordinates are an affine map of position and large triangles are exact. Inside, triangles are refined until the
//! displaced coordinate is, and their union's border is shared by both parts, so that every point is drawn exactly once.
//!
//! A draft for the moving hand does without that border, which changes with every move: squares that stay where they are are
//! laid over what the boxes meet (`tessellate::squares`). To a tolerance those would need twice the triangles.

mod keep;

use std::collections::HashMap;

use glam::{DAffine3, DVec2, DVec3};
use rayon::prelude::*;

use self::keep::{Last, View};
use super::EvaluateError;
use super::clip::clip;
use super::load::Object;
use crate::deform::{Blocks, Deformer, Prepared};
use crate::math::{BackwardMap, OrientedBox, PlaneFrame};
use crate::render::{Camera, Projection, SliceGeometry, SliceVertex};
use crate::slice::{BoxSections, Planes, Slices};
use crate::subdivide::{NextSlice, Refiner, Rule, Smallest, Supports, Texturing, corners};
use crate::tessellate::regions::Cutter;
use crate::tessellate::squares::Squares;
use crate::tessellate::{Limits, Method, Outlines, Triangulation};

pub use self::keep::Keeper;

/// When triangles inside displacement volumes are fine enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refinement {
    /// Split this often, whatever the error.
    Depth(u8),
    /// Split until the displaced coordinate is right to so many voxels.
    Tolerance(f64),
    /// For what moves under the hand: squares, three quarters as long as the smallest feature, that stay where they are.
    Draft,
}

/// Tolerance where none is given, in voxels.
pub const TOLERANCE: f64 = 0.25;

/// Sides of squares, in features.
const SQUARE: f64 = 0.75;
/// The longest edges of a draft, in features: diagonals of squares stay whole.
const LONGEST: f64 = 1.2;

/// Deeper than this no tolerance leads: 4^8 triangles for one.
const DEEPEST: u32 = 8;
/// More slices than this are a mistake.
const MOST_SLICES: f64 = 50_000.0;

/// How slices are made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeometryOptions {
    /// Number of slices; `None`: one per finest voxel.
    pub slices: Option<usize>,
    pub refinement: Refinement,
    /// Whether the deformation is worked into the texture coordinates (else the renderer evaluates it per fragment).
    pub subdivide: bool,
    /// Width and height of the picture: edges below a pixel are not split.
    pub size: (u32, u32),
}

/// The view-aligned slices of an object, back to front.
///
/// # Errors
/// If the view has no direction, or there would be absurdly many slices.
pub fn slices(object: &Object, camera: &Camera, options: &GeometryOptions) -> Result<SliceGeometry, EvaluateError> {
    slices_with_warnings(object, camera, options).map(|(geometry, _)| geometry)
}

/// The same, and a plain sentence for each kind of defect that the mesh's sections show.
///
/// # Errors
/// As [`slices`].
pub fn slices_with_warnings(
    object: &Object,
    camera: &Camera,
    options: &GeometryOptions,
) -> Result<(SliceGeometry, Vec<String>), EvaluateError> {
    Keeper::default().slices(object, camera, options)
}

impl Keeper {
    /// As [`slices_with_warnings`], and the same to the bit. Planes in which nothing changed since the last call are not
    /// triangulated, refined and displaced again.
    ///
    /// # Errors
    /// As [`slices`].
    pub fn slices(
        &mut self,
        object: &Object,
        camera: &Camera,
        options: &GeometryOptions,
    ) -> Result<(SliceGeometry, Vec<String>), EvaluateError> {
        let grid = &object.volume.grid;
        let frame = PlaneFrame::across(camera.to_eye()).ok_or(EvaluateError::View)?;
        let center = grid.center();
        let (lo, hi) = extent(&frame, &object.mesh.positions);
        let count = match options.slices {
            Some(n) => n as f64,
            None => ((hi - lo) / grid.finest()).ceil().max(1.0),
        };
        if !(count <= MOST_SLICES) {
            return Err(EvaluateError::TooManySlices(count));
        }
        let [lo, hi] = if options.refinement == Refinement::Draft { steadied([lo, hi], count) } else { [lo, hi] };
        let planes = Planes::between(frame, lo, hi, count as usize);
        let last = self.last.take();
        // those of the last call take the place of those before
        std::mem::swap(&mut self.slicer.slices, &mut self.before);
        self.slicer.overlaps = object.overlaps;
        let sections = self.slicer.slice(&object.mesh.positions, &object.topology, &planes)?;

        let warnings = sections.warnings().map(|w| w.sentence(&planes)).collect();
        let prepared = object.stack.prepared();
        let boxes = if options.subdivide { prepared.supports() } else { Vec::new() };
        let cuts = cuts(&boxes, &planes, sections);
        let view = View {
            planes,
            eye: camera.eye(),
            projection: camera.projection,
            options: *options,
            pixel: pixel(camera, options.size),
            grid: *grid,
        };
        let deformers = object.stack.active().map(|d| d.into_owned()).collect::<Vec<_>>();
        let mut kept =
            last.map_or_else(Vec::new, |last| last.unchanged(&view, &deformers, &self.before, sections, &cuts));
        kept.resize_with(planes.count, || None);
        self.kept = kept.iter().flatten().count();

        // planes that meet no box are triangulated as they are, all others by region
        let mut owner = sections.owner.clone();
        for (k, _) in kept.iter().zip(&cuts).enumerate().filter(|(_, (kept, c))| kept.is_some() || !c.is_empty()) {
            owner[sections.plane_loops(k)].fill(Slices::NONE);
        }
        // what a deformation does not hide of older ones is seen through it, so that their features count in its box
        let features: Vec<([f64; 2], f64)> = deformers
            .iter()
            .scan(f64::INFINITY, |least, d| {
                *least = least.min(d.feature_size());
                Some((reach(d, &planes), *least))
            })
            .collect();
        let all = outlines(sections);
        let outlines = Outlines { owner: &owner, ..all };
        let maker = Maker {
            planes,
            camera,
            center,
            texture_from_world: grid.texture_from_world(),
            sections,
            all: &all,
            outlines: &outlines,
            plain: self.tessellator.run(&outlines, Method::Fast),
            cuts: &cuts,
            supports: Supports::new(&prepared, Some(prepared.feature_size()))
                .with_features(features.iter().map(|(_, feature)| *feature)),
            features,
            refinement: options.refinement,
            blocks: prepared.blocks(center),
            prepared: &prepared,
            rule: rule(object, options),
            pixel: view.pixel,
        };
        // runs of planes, so that buffers are made once per run and not per plane
        let wanted: Vec<usize> = (0..planes.count).filter(|k| kept[*k].is_none()).collect();
        let run = wanted.len().div_ceil(8 * rayon::current_num_threads()).max(1);
        let made: Vec<Vec<Part>> = wanted
            .par_chunks(run)
            .map(|run| self.scratch.with(Scratch::default, |scratch| maker.parts(run, scratch)))
            .collect();
        let mut made = made.into_iter().flatten();
        let parts: Vec<Part> = kept.into_iter().map(|kept| kept.or_else(|| made.next()).unwrap_or_default()).collect();
        let mut geometry = join(&parts, center, planes.step);
        clip(&mut geometry, &object.clip);
        self.last = Some(Last { view, deformers, cuts, parts });
        Ok((geometry, warnings))
    }
}

/// Sections, classified, as the tessellator takes them.
pub fn outlines(sections: &Slices) -> Outlines<'_> {
    Outlines {
        points: &sections.points,
        loop_start: &sections.loop_start,
        plane_start: &sections.plane_start,
        area: &sections.area,
        owner: &sections.owner,
    }
}

/// For each plane the sections of the boxes that may meet the object there.
fn cuts(boxes: &[OrientedBox], planes: &Planes, sections: &Slices) -> Vec<Vec<Vec<DVec2>>> {
    let boxes: Vec<_> = boxes.iter().map(|b| BoxSections::new(b, &planes.frame)).collect();
    let cut = |k: usize| {
        if boxes.is_empty() || sections.plane_loops(k).is_empty() {
            return Vec::new();
        }
        let height = planes.height(k);
        boxes.iter().map(|b| b.at(height)).filter(|c| !c.is_empty()).collect()
    };
    (0..planes.count).into_par_iter().with_min_len(16).map(cut).collect()
}

/// Heights between which a deformation changes texture coordinates: also those at the next plane.
fn reach(deformer: &Deformer, planes: &Planes) -> [f64; 2] {
    let b = deformer.support();
    let half = (b.axes.transpose() * planes.frame.normal).abs().dot(b.half);
    let middle = planes.frame.height(b.center);
    let margin = half * 1e-9 + 2.0 * planes.step;
    [middle - half - margin, middle + half + margin]
}

/// Smallest and largest height of the mesh along the normal; equal where nothing of it is finite.
fn extent(frame: &PlaneFrame, positions: &[DVec3]) -> (f64, f64) {
    let heights = positions.iter().map(|p| frame.height(*p)).filter(|h| h.is_finite());
    let (lo, hi) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), h| (lo.min(h), hi.max(h)));
    if lo <= hi { (lo, hi) } else { (0.0, 0.0) }
}

/// Widened to multiples of a slice or half of one: planes stay where they are while the mesh moves by less, and what they hold
/// is kept.
fn steadied([lo, hi]: [f64; 2], slices: f64) -> [f64; 2] {
    let unit = ((hi - lo) / slices).log2().floor().exp2();
    if unit.is_normal() { [(lo / unit).floor() * unit, (hi / unit).ceil() * unit] } else { [lo, hi] }
}

/// The size of a pixel in the world at distance 1 from the eye (perspective) or everywhere (orthographic).
fn pixel(camera: &Camera, (width, height): (u32, u32)) -> f64 {
    let side = f64::from(width.min(height).max(1));
    match camera.projection {
        Projection::Orthographic => 2.0 * camera.radius / camera.zoom / side,
        Projection::Perspective { fov_y } => 2.0 * (0.5 * fov_y.to_radians()).tan() / side,
    }
}

fn rule(object: &Object, options: &GeometryOptions) -> Rule<'static> {
    match options.refinement {
        Refinement::Depth(depth) => Rule::uniform(u32::from(depth)),
        Refinement::Draft => Rule::by_features(LONGEST, DEEPEST),
        Refinement::Tolerance(t) => {
            let grid = &object.volume.grid;
            Rule::within(t, DEEPEST, &grid.texture_from_world(), grid.size())
        }
    }
}

/// The triangles of a plane, with indices into its own vertices.
#[derive(Debug, Default)]
struct Part {
    vertices: Vec<SliceVertex>,
    indices: Vec<u32>,
}

fn join(parts: &[Part], center: DVec3, distance: f64) -> SliceGeometry {
    let mut geometry = SliceGeometry { center, distance, ..SliceGeometry::default() };
    geometry.vertices.reserve_exact(parts.iter().map(|p| p.vertices.len()).sum());
    geometry.indices.reserve_exact(parts.iter().map(|p| p.indices.len()).sum());
    for part in parts {
        let base = geometry.vertices.len() as u32;
        let at = geometry.indices.len() as u32;
        geometry.vertices.extend_from_slice(&part.vertices);
        geometry.indices.extend(part.indices.iter().map(|i| i + base));
        geometry.slices.push(at..geometry.indices.len() as u32);
    }
    geometry
}

/// What all planes of a view have in common.
struct Maker<'a> {
    planes: Planes,
    camera: &'a Camera,
    center: DVec3,
    texture_from_world: DAffine3,
    sections: &'a Slices,
    /// The sections of all planes.
    all: &'a Outlines<'a>,
    /// Those of the planes without cuts.
    outlines: &'a Outlines<'a>,
    /// The triangles of the planes without cuts.
    plain: &'a Triangulation,
    /// Sections of the support boxes, for each plane.
    cuts: &'a [Vec<Vec<DVec2>>],
    prepared: &'a Prepared,
    blocks: Blocks<f32>,
    supports: Supports,
    /// For each deformation the heights between which it shows, and the smallest feature of it and all older ones.
    features: Vec<([f64; 2], f64)>,
    refinement: Refinement,
    rule: Rule<'static>,
    /// See [`pixel`].
    pixel: f64,
}

/// Buffers of one thread.
#[derive(Debug, Default)]
struct Scratch {
    cutter: Cutter,
    squares: Squares,
    refiner: Refiner,
    /// Those that the plane at hand meets.
    supports: Supports,
    /// Vertex of each extra point of a triangulation, for the plane at hand.
    extra: HashMap<u32, u32>,
}

impl Maker<'_> {
    fn parts(&self, planes: &[usize], scratch: &mut Scratch) -> Vec<Part> {
        let mut parts = Vec::with_capacity(planes.len());
        for &k in planes {
            let mut part = Part::default();
            let height = self.planes.height(k);
            if let Some(next) = self.next_slice(height)
                && !self.sections.plane_loops(k).is_empty()
            {
                let plane = Plane { k, height, next };
                if self.cuts[k].is_empty() {
                    self.plain(&plane, scratch, &mut part);
                } else {
                    self.supports.crossing(self.planes.frame.normal, height, &mut scratch.supports);
                    match self.refinement {
                        Refinement::Depth(_) => self.cut(&plane, Method::Fast, scratch, &mut part),
                        // well-shaped triangles need fewer splits for the same error
                        Refinement::Tolerance(_) => {
                            self.cut(&plane, Method::Quality(Limits::default()), scratch, &mut part);
                        }
                        Refinement::Draft => self.squares(&plane, scratch, &mut part),
                    }
                }
            }
            parts.push(part);
        }
        parts
    }

    /// Where rays through this plane meet the next one; `None` if the plane lies behind the eye.
    fn next_slice(&self, height: f64) -> Option<NextSlice> {
        let n = self.planes.frame.normal;
        match self.camera.projection {
            Projection::Orthographic => Some(NextSlice::parallel(-n * self.planes.step)),
            Projection::Perspective { .. } => {
                let eye = self.camera.eye();
                let before = self.planes.frame.height(eye) - height;
                (before > 0.5 * self.planes.step.max(f64::MIN_POSITIVE))
                    .then(|| NextSlice::from_eye(eye, before, self.planes.step))
            }
        }
    }

    /// A plane that meets no box.
    fn plain(&self, plane: &Plane, scratch: &mut Scratch, part: &mut Part) {
        let loops = self.sections.plane_loops(plane.k);
        let first = self.sections.loop_start[loops.start] as usize;
        let end = self.sections.loop_start[loops.end] as usize;
        let base = part.vertices.len() as u32;
        self.affine(plane, &self.sections.points[first..end], part);
        scratch.extra.clear();
        for &i in self.plain.triangles[self.plain.plane_triangles(plane.k)].iter().flatten() {
            let vertex = if (i as usize) < self.outlines.points.len() {
                base + i - first as u32
            } else {
                let next = part.vertices.len() as u32;
                let vertex = *scratch.extra.entry(i).or_insert(next);
                if vertex == next {
                    self.affine(plane, &[self.plain.point(self.outlines, i)], part);
                }
                vertex
            };
            part.indices.push(vertex);
        }
    }

    /// A plane that meets boxes, parted along them.
    fn cut(&self, plane: &Plane, method: Method, scratch: &mut Scratch, part: &mut Part) {
        let regions = scratch.cutter.cut(self.all, plane.k, &self.cuts[plane.k], method);
        let base = part.vertices.len() as u32;
        self.affine(plane, &regions.outside.points, part);
        self.affine(plane, &regions.outside.extra, part);
        part.indices.extend(regions.outside.triangles.iter().flatten().map(|i| i + base));
        let inside = &regions.inside;
        let points = inside.points.iter().chain(&inside.extra);
        self.refine(plane, points, &inside.triangles, &scratch.supports, &mut scratch.refiner);
        self.displaced(plane, &scratch.refiner, part);
    }

    /// A plane that meets boxes, in squares where it does.
    fn squares(&self, plane: &Plane, scratch: &mut Scratch, part: &mut Part) {
        let here = self.features.iter().filter(|([lo, hi], _)| (*lo..=*hi).contains(&plane.height));
        let step = SQUARE * here.map(|(_, feature)| *feature).fold(f64::INFINITY, f64::min);
        let Scratch { squares, refiner, supports, .. } = scratch;
        squares.lay(self.all, plane.k, &self.cuts[plane.k], step);
        if squares.step > step {
            // too many would be needed: those in small boxes are split
            squares.rest.append(&mut squares.inside);
        }
        self.refine(plane, &squares.points, &squares.rest, supports, refiner);
        part.indices.reserve_exact(3 * (squares.inside.len() + refiner.triangles().len()));
        part.indices.extend_from_slice(squares.inside.as_flattened());
        self.displaced(plane, refiner, part);
    }

    fn refine<'p>(
        &self,
        plane: &Plane,
        points: impl IntoIterator<Item = &'p DVec2>,
        triangles: &[[u32; 3]],
        supports: &Supports,
        refiner: &mut Refiner,
    ) {
        let eye = self.camera.eye();
        let pixel = |p: DVec3| self.pixel * (p - eye).length();
        let mut rule = self.rule;
        rule.smallest = match self.camera.projection {
            Projection::Orthographic => Smallest::Length(self.pixel),
            Projection::Perspective { .. } => Smallest::At(&pixel),
        };
        let points = points.into_iter().map(|q| self.planes.frame.lift(*q, plane.height));
        refiner.refine(points, triangles, self.prepared, supports, &rule);
    }

    /// Emits what was refined.
    fn displaced(&self, plane: &Plane, refiner: &Refiner, part: &mut Part) {
        let base = part.vertices.len() as u32;
        let texturing = Texturing::new(&self.texture_from_world, Some(plane.next), self.center);
        part.vertices.reserve_exact(refiner.positions().len());
        corners(refiner.positions(), &self.blocks, &texturing, true, |c| {
            part.vertices.push(SliceVertex {
                position: c.position,
                front: c.front,
                back: c.back,
                jacobian: c.jacobian,
            });
        });
        part.indices.extend(refiner.triangles().as_flattened().iter().map(|i| i + base));
    }

    /// Emits vertices whose texture coordinates are an affine map of position.
    fn affine(&self, plane: &Plane, points: &[DVec2], part: &mut Part) {
        let jacobian = self.texture_from_world.matrix3.to_cols_array().map(|v| v as f32);
        let texture = |p: DVec3| self.texture_from_world.transform_point3(p).as_vec3().to_array();
        part.vertices.extend(points.iter().map(|q| {
            let p = self.planes.frame.lift(*q, plane.height);
            SliceVertex {
                position: (p - self.center).as_vec3().to_array(),
                front: texture(p),
                back: texture(plane.next.scale * p + plane.next.shift),
                jacobian,
            }
        }));
    }
}

/// A plane at work.
struct Plane {
    k: usize,
    height: f64,
    next: NextSlice,
}

//! The thread that makes pictures: coarse while something moves, then finer and finer.
//!
//! The window says what it [wants](Want); only the newest wish counts, and its generation number tells a stale answer from a
//! fresh one. A coarse picture is always finished, so that something moves under the hand; finer ones are given up as soon as
//! there is a newer wish. How coarse is chosen from measured times.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Instant;

use eframe::egui::{self, ColorImage};
use glam::DVec3;

use super::guard::guarded;
use super::mailbox::Mailbox;
use super::pace::Pace;
use super::shown::{OtherShown, Sections, Shown, against, image, tessellation};
use super::soften;
use crate::deform::Stack;
use crate::evaluate::heat::{HeatSurface, TetLayer};
use crate::evaluate::load::{Data, Object, Workspace};
use crate::evaluate::picture::{Backend, Mode, PictureReport, Refinement, Renderer, SmoothLook, ViewOptions};
use crate::evaluate::section::Section;
use crate::evaluate::tets::Lattice;
use crate::evaluate::{EvaluateError, coarser, geometry, tets};
use crate::gpu::GpuError;
use crate::render::{Camera, Field, Look, Picture, Shading};
use crate::scene::{CameraSpec, Document, LookSpec, ShadingSpec};
use crate::volume::Volume;

/// What is held against the main picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Other {
    /// The object before any deformation.
    Original,
    Mode(Mode),
}

/// What the window wants to see.
#[derive(Debug, Clone)]
pub struct Want {
    pub data: Arc<Data>,
    pub base: PathBuf,
    pub document: Arc<Document>,
    /// Of the main view, in pixels.
    pub size: (u32, u32),
    pub mode: Mode,
    /// For A/B.
    pub other: Option<Other>,
    /// Something is under way: a coarse picture is enough.
    pub moving: bool,
    /// Milliseconds for a coarse picture.
    pub budget: f32,
    /// Sections through this point, so many pixels along their longer side.
    pub sections: Option<(DVec3, usize)>,
    /// Also how much material has grown, in the sections.
    pub growth: bool,
    /// Also the triangles of the middle slice.
    pub tessellation: bool,
    /// Also the tetrahedra of the lattice at the plane through this point, facing the eye.
    pub tets: Option<DVec3>,
    /// Also the growth on the visible surface.
    pub heat: bool,
    pub ground: [[f32; 3]; 2],
}

impl Want {
    /// Whether the main view would be the same.
    fn same_picture(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.data, &other.data)
            && (Arc::ptr_eq(&self.document, &other.document) || self.document == other.document)
            && self.base == other.base
            && (self.size, self.mode, self.ground) == (other.size, other.mode, other.ground)
            // one that is no longer looked at may stay
            && (other.other.is_none() || self.other == other.other)
    }
}

/// What the worker has to say.
#[derive(Debug)]
pub enum News {
    /// The object of a document, before any picture of it.
    Object(Arc<Document>, Arc<Object>),
    Picture(Box<Shown>),
    Sections(Box<Sections>),
    /// Edges of the triangles of the middle slice, in the world.
    Tessellation(Vec<[DVec3; 2]>),
    Tets(Arc<TetLayer>),
    Heat(Arc<HeatSurface>),
    /// Something to know; the picture came nevertheless.
    Note(String),
    Failed(String),
}

#[derive(Default)]
struct Shared {
    wishes: Mailbox<(u64, Instant, Want)>,
    /// Of the newest wish.
    newest: AtomicU64,
}

/// The window's end.
pub struct Worker {
    shared: Arc<Shared>,
    news: Receiver<News>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Worker {
    /// Starts the thread; `ctx` is woken whenever there is news.
    pub fn new(ctx: &egui::Context, backend: Backend) -> Self {
        let shared = Arc::new(Shared::default());
        let (send, news) = channel();
        let (theirs, ctx) = (shared.clone(), ctx.clone());
        let thread = std::thread::Builder::new()
            .name("pictures".to_owned())
            .spawn(move || Painter::new(theirs, send, ctx, backend).run());
        Self { shared, news, thread: thread.ok() }
    }

    /// Replaces what was wanted before.
    pub fn want(&self, want: Want) -> u64 {
        let generation = self.shared.newest.fetch_add(1, Ordering::SeqCst) + 1;
        self.shared.wishes.put((generation, Instant::now(), want));
        generation
    }

    pub fn news(&self) -> impl Iterator<Item = News> + '_ {
        self.news.try_iter()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.shared.newest.fetch_add(1, Ordering::SeqCst);
        self.shared.wishes.close();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Points of a view at which the growth is measured.
const HEAT_POINTS: f64 = 14_000.0;
/// What the device calls a volume when it is too large.
const VOLUME: &str = "a volume";
/// Coarser than by this factor, a volume is not worth looking at.
const LEAST_OF_A_VOLUME: usize = 16;
/// Milliseconds of a picture between the coarse and the full one.
const BETWEEN: f64 = 160.0;

struct Painter {
    shared: Arc<Shared>,
    send: Sender<News>,
    ctx: egui::Context,
    backend: Backend,
    renderer: Option<Renderer>,
    /// What smooth surfaces show.
    surface: SmoothLook,
    known: Option<Known>,
    /// Of the known object.
    warped: Option<Arc<Object>>,
    /// Of the known object.
    lattice: Option<Arc<Lattice>>,
    /// What the window has a full picture of.
    full: Option<Want>,
    /// A volume that the device does not take, and what is drawn in its stead.
    smaller: Option<Smaller>,
    pace: Pace,
    /// The same for smooth surfaces.
    surfaces: Pace,
}

/// What is drawn where the whole does not fit.
struct Smaller {
    of: Arc<Volume>,
    /// Voxels along each axis that became one.
    factor: usize,
    volume: Arc<Volume>,
    field: Field,
}

/// What the last picture was of.
struct Known {
    data: Arc<Data>,
    base: PathBuf,
    workspace: Workspace,
    made: Option<(Arc<Document>, Arc<Object>)>,
}

impl Painter {
    fn new(shared: Arc<Shared>, send: Sender<News>, ctx: egui::Context, backend: Backend) -> Self {
        Self {
            shared,
            send,
            ctx,
            backend,
            renderer: None,
            surface: SmoothLook::default(),
            known: None,
            warped: None,
            lattice: None,
            full: None,
            smaller: None,
            pace: Pace::default(),
            surfaces: Pace::of_surfaces(),
        }
    }

    fn run(&mut self) {
        while let Some((generation, asked, want)) = self.shared.wishes.wait() {
            self.guarded(|painter| painter.serve(generation, asked, &want));
        }
    }

    /// Does some work. When it fails, says so and is ready for other work.
    fn guarded(&mut self, work: impl FnOnce(&mut Self) -> Result<(), EvaluateError>) {
        match guarded(|| work(self)) {
            Ok(Ok(())) => {}
            Ok(Err(e)) => {
                self.say(News::Failed(e.to_string()));
                if matches!(e, EvaluateError::Gpu(_)) {
                    // the device may be gone for good: the CPU draws from now on
                    self.renderer = None;
                    self.backend = Backend::Cpu;
                }
            }
            Err(what) => {
                self.say(News::Failed(what));
                // nothing half made is kept, but what pictures take stays known
                let new = Self::new(self.shared.clone(), self.send.clone(), self.ctx.clone(), self.backend);
                let old = std::mem::replace(self, new);
                (self.pace, self.surfaces) = (old.pace, old.surfaces);
            }
        }
    }

    fn say(&self, news: News) {
        let _ = self.send.send(news);
        self.ctx.request_repaint();
    }

    fn serve(&mut self, generation: u64, asked: Instant, want: &Want) -> Result<(), EvaluateError> {
        let object = self.object(want)?;
        let slices = |scale: f64| {
            let all = want.document.look.slices.map_or_else(|| across(&object), |n| n as f64);
            // fewer slices in a smaller picture: what a pixel covers is sampled as finely as across
            (all * scale.sqrt()).max(all.min(64.0)).round()
        };
        let shared = self.shared.clone();
        let stale = move || shared.newest.load(Ordering::SeqCst) != generation;
        let factor = if want.other.is_some() { 0.5 } else { 1.0 };
        let budget = f64::from(want.budget) * factor;
        let smooth = want.mode == Mode::Spline && self.surface_is_ready(&object);
        let few = self.pace.slices(slices(0.5), budget);
        let coarse = if smooth {
            self.surfaces.coarse(want.size, 1.0, budget)
        } else {
            self.pace.coarse(want.size, few, budget)
        };
        // an overlay alone needs no new picture: a coarse one would only flicker
        let seen = self.full.as_ref().is_some_and(|full| full.same_picture(want));
        if !seen {
            self.picture(generation, asked, want, &object, coarse, few, want.moving, &|| false)?;
        }
        if let Some((point, longest)) = want.sections
            && !stale()
        {
            let longest = if want.moving { longest / 2 } else { longest };
            let planes = [0, 1, 2].map(|axis| {
                let section = Section::across(&object, axis, point, longest);
                let values = section.values(&object);
                (section, values)
            });
            let growth = want.growth.then(|| [0, 1, 2].map(|axis: usize| planes[axis].0.growth(&object)));
            self.say(News::Sections(Box::new(Sections { planes, growth, point })));
        }
        if want.tessellation && !stale() {
            self.say(News::Tessellation(tessellation(&object, want)?));
        }
        if let Some(point) = want.tets
            && !stale()
        {
            self.tets(want, &object, point)?;
        }
        if want.moving {
            return Ok(());
        }
        let between = if smooth {
            self.surfaces.scale(want.size, 1.0, BETWEEN * factor)
        } else {
            self.pace.scale(want.size, slices(0.7), BETWEEN * factor)
        };
        if !seen && between > 1.3 * coarse && between < 0.8 && !stale() {
            self.picture(generation, asked, want, &object, between, slices(between), false, &stale)?;
        }
        if !seen && coarse < 1.0 {
            self.picture(generation, asked, want, &object, 1.0, slices(1.0), false, &stale)?;
        }
        if want.mode == Mode::Spline
            && !stale()
            && let Some(renderer) = &mut self.renderer
        {
            // for the next stroke
            renderer.make_surface_ready(&object)?;
        }
        if want.heat && !stale() {
            let camera = object.camera(&want.document.camera);
            let look = want.document.look.look(object.iso);
            let pixels = f64::from(want.size.0) * f64::from(want.size.1);
            let step = (pixels / HEAT_POINTS).sqrt().max(3.0);
            if let Some(surface) = HeatSurface::of(&object, &camera, &look, want.size, step, &stale) {
                self.say(News::Heat(Arc::new(surface)));
            }
        }
        Ok(())
    }

    /// A layer of the lattice. While a stroke is under way the one before stays.
    fn tets(&mut self, want: &Want, object: &Object, point: DVec3) -> Result<(), EvaluateError> {
        if self.lattice.is_none() && !want.moving {
            let lattice = tets::lattice(object, Refinement::Tolerance(tets::TOLERANCE))?;
            self.lattice = Some(Arc::new(lattice));
        }
        if let Some(lattice) = &self.lattice {
            let normal = object.camera(&want.document.camera).to_eye();
            self.say(News::Tets(Arc::new(TetLayer::of(lattice, point, normal))));
        }
        Ok(())
    }

    /// The object of the wanted document; nothing is made again that did not change.
    fn object(&mut self, want: &Want) -> Result<Arc<Object>, EvaluateError> {
        if let Some(known) = &mut self.known
            && known.base == want.base
            && Arc::ptr_eq(&known.data.basis, &want.data.basis)
            && !Arc::ptr_eq(&known.data, &want.data)
        {
            // another step of the same series
            known.workspace.go_on_with(want.data.clone());
            (known.data, known.made) = (want.data.clone(), None);
        }
        if self.known.as_ref().is_none_or(|k| !Arc::ptr_eq(&k.data, &want.data) || k.base != want.base) {
            self.known = Some(Known {
                data: want.data.clone(),
                base: want.base.clone(),
                workspace: Workspace::with_data(&want.base, want.document.volume.clone(), want.data.clone()),
                made: None,
            });
        }
        let Some(known) = &mut self.known else { return Err(EvaluateError::View) };
        if let Some((document, object)) = &known.made
            && same_object(document, &want.document)
        {
            return Ok(object.clone());
        }
        let object = Arc::new(known.workspace.object(&want.document)?);
        known.made = Some((want.document.clone(), object.clone()));
        self.warped = None;
        self.lattice = None;
        self.say(News::Object(want.document.clone(), object.clone()));
        Ok(object)
    }

    #[expect(clippy::too_many_arguments, reason = "one picture of one wish")]
    fn picture(
        &mut self,
        generation: u64,
        asked: Instant,
        want: &Want,
        object: &Arc<Object>,
        scale: f64,
        slices: f64,
        moving: bool,
        stop: crate::render::Stop<'_>,
    ) -> Result<(), EvaluateError> {
        // while something moves, slices are few and roughly split even where pixels cost nothing
        let last = scale >= 1.0 && !moving;
        let size = [want.size.0, want.size.1].map(|n| ((f64::from(n) * scale).round() as u32).max(1));
        let options = ViewOptions {
            size: (size[0], size[1]),
            slices: if last { want.document.look.slices } else { Some(slices.max(1.0) as usize) },
            mode: want.mode,
            refinement: if last { Refinement::Tolerance(geometry::TOLERANCE) } else { Refinement::Draft },
            backend: self.backend,
            transparent: false,
            corrections: None,
        };
        let camera = object.camera(&want.document.camera);
        let look = Look {
            background: want.document.look.background.unwrap_or(want.ground),
            ..want.document.look.look(object.iso)
        };
        self.surface = want.document.surface.clone();
        let Some((main, report)) = self.draw(object, &camera, &look, &options, !last, stop)? else { return Ok(()) };
        if report.slices == 0 {
            self.surfaces.learn(&report, options.size, !last);
        } else if want.mode != Mode::Tets || !last {
            self.pace.learn(&report, options.size, !last);
        }
        let other = match want.other {
            None => None,
            Some(other) => {
                let (object, mode) = match other {
                    Other::Original => {
                        let rest = Object { stack: Stack::default(), ..(**object).clone() };
                        (Arc::new(rest), Mode::Slicing)
                    }
                    Other::Mode(mode) => (object.clone(), mode),
                };
                let options = ViewOptions { mode, ..options };
                match self.draw(&object, &camera, &look, &options, !last, stop)? {
                    Some((picture, report)) => Some(against(&main, &picture, report)?),
                    None => return Ok(()),
                }
            }
        };
        self.full = last.then(|| want.clone());
        // what will be stretched is made smooth first
        let smooth = |image: ColorImage| Arc::new(if scale < 0.75 { soften::doubled(&image) } else { image });
        let other = other.map(|o| if scale < 0.75 { OtherShown { image: smooth((*o.image).clone()), ..o } } else { o });
        self.say(News::Picture(Box::new(Shown {
            generation,
            image: smooth(image(&main)),
            other,
            report,
            scale: scale as f32,
            moving,
            last,
            asked,
        })));
        Ok(())
    }

    /// Whether a smooth surface can follow the hand.
    fn surface_is_ready(&self, object: &Object) -> bool {
        self.renderer.as_ref().is_some_and(|r| r.surface_is_ready(object))
    }

    /// One picture. Tetrahedra are too slow for the hand, and so is making a spline: while something moves, slices stand for
    /// them.
    fn draw(
        &mut self,
        object: &Arc<Object>,
        camera: &Camera,
        look: &Look,
        options: &ViewOptions,
        coarse: bool,
        stop: crate::render::Stop<'_>,
    ) -> Result<Option<(Picture, PictureReport)>, EvaluateError> {
        let mut object = object.clone();
        let mut mode = options.mode;
        let mut look = *look;
        if mode == Mode::Spline && coarse && !self.surface_is_ready(&object) {
            mode = Mode::Slicing;
            if !matches!(look.shading, Shading::Iso { .. }) {
                look.shading = LookSpec { shading: ShadingSpec::Iso { value: None }, ..LookSpec::default() }
                    .look(object.iso)
                    .shading;
            }
        }
        if mode == Mode::Tets {
            mode = Mode::Slicing;
            let known = self.known.as_ref().and_then(|k| k.made.as_ref());
            let current = known.is_some_and(|(_, known)| Arc::ptr_eq(known, &object));
            if let Some(warped) = &self.warped
                && current
            {
                object = warped.clone();
            } else if !coarse {
                if stop() {
                    return Ok(None);
                }
                let warped = Arc::new(tets::warped(&object, Refinement::Tolerance(tets::TOLERANCE))?.object);
                if current {
                    self.warped = Some(warped.clone());
                }
                object = warped;
            }
        }
        loop {
            // coarser as soon as it is known that the full one does not fit
            let fitting = match &self.smaller {
                Some(s) if Arc::ptr_eq(&s.of, &object.volume) => {
                    Arc::new(coarser::with_volume(&object, s.volume.clone(), s.field.clone()))
                }
                _ => object.clone(),
            };
            let renderer = match &mut self.renderer {
                Some(renderer) => renderer,
                None => self.renderer.insert(Renderer::new(self.backend)?),
            };
            renderer.set_smooth_look(self.surface.clone());
            let drawn = renderer.picture_until(&fitting, camera, &look, &ViewOptions { mode, ..*options }, stop);
            match drawn {
                Err(EvaluateError::Gpu(GpuError::TooLarge { what: VOLUME, .. } | GpuError::OutOfMemory { .. }))
                    if self.halve(&object.volume) => {}
                drawn => return drawn,
            }
        }
    }

    /// Half the resolution of what is drawn of a volume, and a word about it; false if there is no sense in less.
    fn halve(&mut self, volume: &Arc<Volume>) -> bool {
        let before = self.smaller.take().filter(|s| Arc::ptr_eq(&s.of, volume)).map_or(1, |s| s.factor);
        let factor = 2 * before;
        if factor > LEAST_OF_A_VOLUME {
            return false;
        }
        let small = Arc::new(coarser::coarser(volume, factor));
        let field = Field::from_volume(small.clone());
        self.say(News::Note(format!(
            "The volume is larger than the graphics card takes: it is shown at 1/{factor} of its resolution along each axis. \
             Exports use all of it."
        )));
        self.smaller = Some(Smaller { of: volume.clone(), factor, volume: small, field });
        true
    }
}

/// Slices of one finest voxel that the longest way through the volume takes, about.
fn across(object: &Object) -> f64 {
    let grid = &object.volume.grid;
    let diagonal = (grid.world_from_voxel.matrix3 * grid.size()).length();
    (0.8 * diagonal / grid.finest()).max(1.0)
}

/// Whether two documents make the same object: what is only looked at differently does.
fn same_object(a: &Arc<Document>, b: &Arc<Document>) -> bool {
    let plain =
        |d: &Arc<Document>| Document { camera: CameraSpec::default(), look: LookSpec::default(), ..(**d).clone() };
    Arc::ptr_eq(a, b) || plain(a) == plain(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_said_and_other_work_goes_on() {
        let (send, news) = channel();
        let mut painter = Painter::new(Arc::default(), send, egui::Context::default(), Backend::Cpu);
        let failed = || match news.try_recv() {
            Ok(News::Failed(what)) => Some(what),
            _ => None,
        };
        painter.guarded(|p| {
            p.renderer = Some(Renderer::new(Backend::Cpu).unwrap());
            panic!("as it must not");
        });
        assert!(failed().is_some_and(|what| what.contains("document is as it was")) && painter.renderer.is_none());
        painter.guarded(|_| Err(EvaluateError::View));
        assert_eq!(failed(), Some(EvaluateError::View.to_string()));
        painter.guarded(|_| Ok(()));
        assert_eq!(failed(), None);
    }
}

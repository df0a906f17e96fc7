use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use eframe::egui::{self, Color32, Panel, RichText, TextureHandle, TextureOptions, Vec2};
use glam::DVec3;

use super::asking::Wanted;
use super::desk::{Desk, suggested, thumbnail};
use super::panels::{self, Pane, PanelState};
use super::recovery::{self, Aside, Recovery};
use super::sculpt::{Hand, Made, Stroke, Tool};
use super::settings::{Home, Settings, ThemeChoice};
use super::tasks::{self, Loaded, Outcome, Purpose, Task};
use super::trace::Trace;
use super::turntable::Turntable;
use super::worker::{News, Other, Sections, Shown, Worker};
use super::{keys, menu, questions, theme, view};
use crate::evaluate::picture::{Backend, Mode, Refinement, ViewOptions};
use crate::scene::{Document, Edit, History, VolumeSource};

/// How the modeller begins.
#[derive(Debug, Clone)]
pub struct Start {
    /// Projects, volumes or `phantom:NAME[:SIZE]`; the first is opened, a surface becomes its shape.
    pub files: Vec<String>,
    pub backend: Backend,
    pub home: Home,
}

impl Default for Start {
    fn default() -> Self {
        Self { files: Vec::new(), backend: Backend::Auto, home: Home::find() }
    }
}

/// What is opened when nothing is named.
pub const FIRST: &str = "phantom:head:192";

/// Pause after which a movement counts as over.
pub const REST: Duration = Duration::from_millis(110);

/// How two pictures are laid against each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Layout {
    #[default]
    Wipe,
    SideBySide,
    Difference,
}

/// What is seen, beside the document.
#[derive(Debug, Clone)]
pub struct ViewState {
    pub mode: Mode,
    pub compare: bool,
    pub other: Other,
    pub layout: Layout,
    /// Part of the view left of the wipe.
    pub wipe: f32,
    pub cube: bool,
    pub overlays: bool,
    pub proxy: bool,
    pub boxes: bool,
    pub tessellation: bool,
    /// Growth and folds in the sections.
    pub growth: bool,
    /// World point of the sections.
    pub cursor: DVec3,
    /// Grey window of the sections, real values.
    pub window: [f64; 2],
}

/// A question that must be answered before anything else.
#[derive(Debug, Clone, PartialEq)]
pub enum Question {
    Open {
        word: String,
        wrong: Option<String>,
    },
    Save {
        word: String,
        embed: bool,
        then: After,
    },
    Screenshot {
        word: String,
        transparent: bool,
    },
    Turntable {
        word: String,
        frames: usize,
        seconds: f64,
    },
    /// There is unsaved work.
    Unsaved(After),
    Recover,
    Keys,
    Preferences,
    About,
}

/// What to do once the work is safe.
#[derive(Debug, Clone, PartialEq)]
pub enum After {
    Nothing,
    Open(String),
    Quit,
}

/// What the pointer is doing in the main view.
#[derive(Debug, Clone)]
pub enum Doing {
    Nothing,
    Orbit,
    Pan,
    Stroke { stroke: Box<Stroke>, made: Made },
    Smooth { base: Arc<Document> },
    Handle { item: usize, handle: usize, start: DVec3, scale: f64, drag: Vec2 },
    Arrow { axis: usize, start: DVec3, drag: Vec2, scale: f64 },
    Wipe,
    Radius { start: f64, from: f32 },
    Strength { start: f64, from: f32 },
}

/// A sentence in the corner, for a while.
#[derive(Debug, Clone)]
pub struct Notice {
    pub text: String,
    pub error: bool,
    pub since: Instant,
}

/// The modeller, without its window.
pub struct Modeller {
    pub desk: Option<Desk>,
    pub hand: Hand,
    pub view: ViewState,
    pub doing: Doing,
    pub settings: Settings,
    pub trace: Trace,
    pub show_trace: bool,
    pub notices: Vec<Notice>,
    pub question: Option<Question>,
    pub tasks: Vec<Task>,
    pub shown: Option<Box<Shown>>,
    pub sections: Option<Box<Sections>>,
    pub hover: Option<crate::evaluate::pick::Hit>,
    pub measure: Vec<DVec3>,
    /// Of a pen, 0 to 1; 1 of a mouse.
    pub pressure: f32,
    pub panels: PanelState,
    pub(super) tree: egui_tiles::Tree<Pane>,
    pub(super) textures: Textures,
    pub(super) lost: Vec<(PathBuf, Aside)>,
    /// A pane that another one asked for.
    pub(super) wants_pane: Option<Pane>,
    /// Of all panes, in the last pass.
    pub(super) width: f32,
    /// The Tab of this pass was for the view.
    pub(super) tabbed: bool,
    pub(super) clipboard: Option<crate::deform::Stack>,
    pub(super) backend: Backend,
    home: Home,
    pub(super) worker: Worker,
    pub(super) recovery: Recovery,
    /// When the picture on screen last became out of date.
    pub(super) moved: Instant,
    pub(super) wanted: Option<Wanted>,
    /// Recovery holds this document.
    pub(super) aside: Option<Arc<Document>>,
    pub(super) size: (u32, u32),
    then: After,
    quitting: bool,
    titled: String,
    after_open: Vec<String>,
}

#[derive(Default)]
pub struct Textures {
    pub main: Option<TextureHandle>,
    pub other: Option<TextureHandle>,
    pub difference: Option<TextureHandle>,
    pub sections: [Option<TextureHandle>; 3],
    /// What the sections' textures were coloured with.
    pub window: [f64; 2],
}

impl Modeller {
    /// Everything but the window. Opens what `start` names in the background.
    pub fn new(ctx: &egui::Context, start: Start) -> Self {
        theme::install(ctx);
        let settings = Settings::load(&start.home);
        let lost = recovery::found(&start.home);
        let mut files = start.files.into_iter();
        let first = files.next().unwrap_or_else(|| FIRST.to_owned());
        let mut modeller = Self {
            desk: None,
            hand: Hand::for_size(100.0),
            view: ViewState {
                mode: Mode::Slicing,
                compare: false,
                other: Other::Original,
                layout: Layout::Wipe,
                wipe: 0.5,
                cube: false,
                overlays: true,
                proxy: false,
                boxes: true,
                tessellation: false,
                growth: false,
                cursor: DVec3::ZERO,
                window: [0.0, 1.0],
            },
            doing: Doing::Nothing,
            trace: Trace::default(),
            show_trace: false,
            notices: Vec::new(),
            question: (!lost.is_empty()).then_some(Question::Recover),
            tasks: vec![tasks::open(ctx, &first)],
            shown: None,
            sections: None,
            hover: None,
            measure: Vec::new(),
            pressure: 1.0,
            panels: PanelState::default(),
            tree: panels::tree(),
            textures: Textures::default(),
            lost,
            wants_pane: None,
            width: 1360.0 - theme::TOOL_BAR,
            tabbed: false,
            clipboard: None,
            backend: start.backend,
            worker: Worker::new(ctx, start.backend),
            recovery: Recovery::new(&start.home),
            home: start.home,
            moved: Instant::now(),
            wanted: None,
            aside: None,
            size: (1, 1),
            then: After::Nothing,
            quitting: false,
            titled: String::new(),
            after_open: files.collect(),
            settings,
        };
        modeller.apply_settings(ctx);
        modeller
    }

    pub fn apply_settings(&mut self, ctx: &egui::Context) {
        ctx.set_theme(match self.settings.theme {
            ThemeChoice::Dark => egui::Theme::Dark,
            ThemeChoice::Light => egui::Theme::Light,
        });
        ctx.set_zoom_factor(self.settings.zoom.clamp(0.5, 3.0));
        self.settings.save(&self.home);
    }

    /// Does an edit as a step of the history, and says so if it cannot be done.
    pub fn edit(&mut self, edit: Edit) {
        let Some(desk) = &mut self.desk else { return };
        if let Err(e) = desk.history.apply(edit) {
            self.tell(e.to_string(), true);
        }
    }

    pub fn undo(&mut self) {
        self.cancel_stroke();
        if let Some(desk) = &mut self.desk
            && !desk.history.undo()
        {
            self.tell("There is nothing to undo".to_owned(), false);
        }
    }

    pub fn redo(&mut self) {
        self.cancel_stroke();
        if let Some(desk) = &mut self.desk
            && !desk.history.redo()
        {
            self.tell("There is nothing to redo".to_owned(), false);
        }
    }

    /// What is under way is as if it had not begun.
    pub fn cancel_stroke(&mut self) {
        if let Some(desk) = &mut self.desk {
            desk.preview = None;
        }
        self.doing = Doing::Nothing;
    }

    pub fn tell(&mut self, text: String, error: bool) {
        self.notices.retain(|n| n.text != text);
        self.notices.push(Notice { text, error, since: Instant::now() });
    }

    /// Opens a file, asking first where work would be lost.
    pub fn open(&mut self, ctx: &egui::Context, word: &str) {
        let path = tasks::typed_path(word);
        if crate::io::is_surface_path(&path) && path.is_file() && self.desk.is_some() {
            let path = std::path::absolute(&path).unwrap_or(path);
            self.edit(Edit::SetProxy(crate::scene::ProxySource::Mesh(path)));
            return;
        }
        if let Err(wrong) = tasks::can_open(word) {
            self.question = Some(Question::Open { word: word.to_owned(), wrong: Some(wrong) });
            return;
        }
        if self.desk.as_ref().is_some_and(|d| d.history.is_dirty()) {
            self.question = Some(Question::Unsaved(After::Open(word.to_owned())));
            return;
        }
        self.open_now(ctx, word);
    }

    pub fn open_now(&mut self, ctx: &egui::Context, word: &str) {
        let word = if word.starts_with("phantom:") {
            word.to_owned()
        } else {
            tasks::typed_path(word).to_string_lossy().into_owned()
        };
        self.question = None;
        self.tasks.push(tasks::open(ctx, &word));
    }

    /// Saves; asks for a name where there is none.
    pub fn save(&mut self, ctx: &egui::Context, then: After) {
        match self.desk.as_ref().and_then(|d| d.path.clone()) {
            Some(path) => self.save_as(ctx, path, false, then),
            None => self.ask_save_as(then),
        }
    }

    /// Asks where to save.
    pub fn ask_save_as(&mut self, then: After) {
        self.question = Some(Question::Save { word: self.suggested("voxclay"), embed: false, then });
    }

    /// Asks where a picture is to go.
    pub fn ask_screenshot(&mut self) {
        self.question = Some(Question::Screenshot { word: self.suggested("png"), transparent: false });
    }

    /// A name beside the file that is open.
    pub(super) fn suggested(&self, extension: &str) -> String {
        self.desk.as_ref().map_or_else(String::new, |d| suggested(d, extension))
    }

    pub fn save_as(&mut self, ctx: &egui::Context, path: PathBuf, embed: bool, then: After) {
        let Some(desk) = &self.desk else { return };
        let path = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("voxclay")) {
            path
        } else {
            path.with_added_extension("voxclay")
        };
        let thumbnail = self.shown.as_ref().and_then(|s| thumbnail(&s.image));
        let document = desk.history.document().clone();
        self.tasks.push(tasks::save(ctx, path, document, desk.base.clone(), desk.data.clone(), thumbnail, embed));
        self.then = then;
        self.question = None;
    }

    pub fn export(&mut self, ctx: &egui::Context, job: tasks::ExportJob) {
        let Some(desk) = &self.desk else { return };
        let document = desk.history.document().clone();
        self.tasks.push(tasks::export(ctx, document, desk.base.clone(), desk.data.clone(), job));
    }

    pub fn screenshot(&mut self, ctx: &egui::Context, path: PathBuf, transparent: bool) {
        let Some(desk) = &self.desk else { return };
        let shot = tasks::Screenshot {
            path,
            size: self.size,
            mode: self.view.mode,
            transparent,
            background: theme::view_ground(ctx.theme() == egui::Theme::Dark),
        };
        let document = desk.history.document().clone();
        self.tasks.push(tasks::screenshot(ctx, document, desk.base.clone(), desk.data.clone(), self.backend, shot));
        self.question = None;
    }

    pub fn turntable(&mut self, ctx: &egui::Context, table: Turntable) {
        let Some(desk) = &self.desk else { return };
        let document = desk.history.document().clone();
        // small enough to be sent, large enough to be seen
        let longest = self.size.0.max(self.size.1).max(1);
        let scale = |n: u32| (u64::from(n) * 720 / u64::from(longest.max(720))).max(2) as u32;
        let options = ViewOptions {
            size: (scale(self.size.0), scale(self.size.1)),
            slices: document.look.slices,
            mode: self.view.mode,
            refinement: Refinement::Tolerance(crate::evaluate::geometry::TOLERANCE),
            backend: self.backend,
            transparent: false,
            corrections: None,
        };
        let ground = theme::view_ground(ctx.theme() == egui::Theme::Dark);
        self.tasks.push(tasks::turntable(ctx, document, desk.base.clone(), desk.data.clone(), options, ground, table));
        self.question = None;
    }

    pub fn choose(&mut self, ctx: &egui::Context, purpose: Purpose, start: Option<PathBuf>) {
        self.tasks.push(tasks::choose(ctx, purpose, start));
    }

    /// Work that was put aside by a modeller that is gone.
    pub fn recover(&mut self, ctx: &egui::Context, index: usize) {
        if index < self.lost.len() {
            let (file, aside) = self.lost.remove(index);
            self.tasks.push(tasks::recover(ctx, file, aside));
        }
        self.question = None;
    }

    /// Throws away what was put aside.
    pub fn discard_lost(&mut self) {
        for (file, _) in self.lost.drain(..) {
            let _ = std::fs::remove_file(file);
        }
        self.question = None;
    }

    /// Asks to close, unless nothing would be lost.
    pub fn quit(&mut self, ctx: &egui::Context) {
        if self.desk.as_ref().is_some_and(|d| d.history.is_dirty()) {
            self.question = Some(Question::Unsaved(After::Quit));
        } else {
            self.quit_now(ctx);
        }
    }

    pub fn quit_now(&mut self, ctx: &egui::Context) {
        self.quitting = true;
        ctx.send_viewport_cmd(egui::ViewportCommand::Close);
    }

    /// The window has closed with consent: nothing needs to be recovered.
    pub fn closed(&mut self) {
        self.recovery.clear();
        self.settings.save(&self.home);
    }

    /// The size of the picture that is asked for, in pixels.
    pub fn picture_size(&self) -> (u32, u32) {
        self.size
    }

    pub(super) fn set_picture_size(&mut self, size: (u32, u32)) {
        self.size = size;
    }

    /// One pass of the interface.
    pub fn ui(&mut self, ui: &mut egui::Ui) {
        let started = Instant::now();
        let ctx = ui.ctx().clone();
        self.take_news(&ctx);
        self.take_outcomes(&ctx);
        self.take_drops(&ctx);
        self.take_close(&ctx);
        keys::handle(self, &ctx);

        let bar = |ui: &egui::Ui| egui::Frame::side_top_panel(ui.style()).inner_margin(egui::Margin::symmetric(8, 0));
        Panel::top("top bar").exact_size(theme::TOP_BAR).frame(bar(ui)).show(ui, |ui| menu::top_bar(self, ui));
        Panel::bottom("status bar")
            .exact_size(theme::STATUS_BAR)
            .frame(bar(ui))
            .show(ui, |ui| menu::status_bar(self, ui));
        Panel::left("tools")
            .exact_size(theme::TOOL_BAR)
            .resizable(false)
            .frame(egui::Frame::side_top_panel(ui.style()).inner_margin(0))
            .show(ui, |ui| ui.vertical_centered(|ui| menu::tool_bar(self, ui)));
        egui::CentralPanel::default()
            .frame(egui::Frame::NONE.fill(ui.visuals().extreme_bg_color))
            .show(ui, |ui| panels::show(self, ui));
        if std::mem::take(&mut self.tabbed) {
            ctx.memory_mut(|memory| {
                if let Some(widget) = memory.focused() {
                    memory.surrender_focus(widget);
                }
            });
        }
        questions::show(self, &ctx);
        self.show_notices(&ctx);
        if self.show_trace {
            menu::trace(self, &ctx);
        }
        self.ask(&ctx);
        self.put_aside(&ctx);
        self.retitle(&ctx);
        self.trace.pass.add(started.elapsed());
    }

    fn take_news(&mut self, ctx: &egui::Context) {
        let news: Vec<News> = self.worker.news().collect();
        for news in news {
            match news {
                News::Object(document, object) => {
                    let Some(desk) = &mut self.desk else { continue };
                    // of another volume: the desk was changed meanwhile
                    if !Arc::ptr_eq(&object.volume, &desk.data.volume) {
                        continue;
                    }
                    if desk.object.is_none() {
                        let (center, radius) = object.focus;
                        self.hand = Hand { tool: self.hand.tool, mirror: self.hand.mirror, ..Hand::for_size(radius) };
                        self.view.cursor = center;
                        self.view.window = object.window;
                    }
                    for warning in &object.warnings {
                        if desk.object.as_ref().is_none_or(|(_, o)| !o.warnings.contains(warning))
                            && desk.preview.is_none()
                        {
                            self.notices.push(Notice { text: warning.clone(), error: false, since: Instant::now() });
                        }
                    }
                    desk.object = Some((document, object));
                }
                News::Picture(shown) => {
                    if shown.moving {
                        self.trace.latency.add(shown.asked.elapsed());
                        self.trace.coarse.add(Duration::from_secs_f64(shown.report.ms_total / 1e3));
                    } else if shown.last {
                        self.trace.full.add(Duration::from_secs_f64(shown.report.ms_total / 1e3));
                    }
                    self.trace.geometry.add(Duration::from_secs_f64(shown.report.ms_geometry / 1e3));
                    put(ctx, &mut self.textures.main, "main view", &shown.image);
                    match &shown.other {
                        Some(other) => {
                            put(ctx, &mut self.textures.other, "other view", &other.image);
                            put(ctx, &mut self.textures.difference, "difference", &other.difference);
                        }
                        None => (self.textures.other, self.textures.difference) = (None, None),
                    }
                    self.shown = Some(shown);
                }
                News::Sections(sections) => {
                    self.sections = Some(sections);
                    self.textures.window = [f64::NAN; 2];
                }
                News::Tessellation(edges) => self.panels.tessellation = Some(edges),
                News::Failed(what) => self.tell(what, true),
            }
        }
    }

    fn take_outcomes(&mut self, ctx: &egui::Context) {
        let mut ended = Vec::new();
        self.tasks.retain(|task| match task.poll() {
            Some(outcome) => {
                ended.push(outcome);
                false
            }
            None => true,
        });
        for outcome in ended {
            match outcome {
                Outcome::Loaded(loaded) => self.put_on_desk(ctx, *loaded),
                Outcome::Saved { path, document } => {
                    if let Some(desk) = &mut self.desk {
                        // edits made while it was written are still unsaved
                        if Arc::ptr_eq(desk.history.document(), &document) {
                            desk.history.mark_saved();
                        }
                        desk.path = Some(path.clone());
                    }
                    self.settings.remember(&path);
                    self.settings.save(&self.home);
                    self.tell(format!("Saved {}", path.display()), false);
                    match std::mem::replace(&mut self.then, After::Nothing) {
                        After::Nothing => {}
                        After::Open(word) => self.open_now(ctx, &word),
                        After::Quit => self.quit_now(ctx),
                    }
                }
                Outcome::Exported(done) => {
                    let [x, y, z] = done.dims;
                    let mut text = format!("Exported {} ({x} x {y} x {z}, {:.0} ms)", done.path.display(), done.ms);
                    if let Some(c) = &done.certificate {
                        text.push_str(if c.sound { "; certified sound" } else { "; not sound, see Export" });
                    }
                    self.tell(text, false);
                    self.panels.exported = Some(done);
                }
                Outcome::Written(path) => self.tell(format!("Wrote {}", path.display()), false),
                Outcome::Chosen(purpose, path) => self.chosen(ctx, purpose, &path),
                Outcome::Nothing => {}
                Outcome::Failed(what) => {
                    self.then = After::Nothing;
                    self.tell(what, true);
                }
            }
        }
    }

    fn chosen(&mut self, ctx: &egui::Context, purpose: Purpose, path: &Path) {
        let word = path.to_string_lossy().into_owned();
        match purpose {
            Purpose::Open => self.open(ctx, &word),
            Purpose::Proxy => self.edit(Edit::SetProxy(crate::scene::ProxySource::Mesh(path.to_owned()))),
            Purpose::Export => self.panels.export_path = word,
            Purpose::Save => {
                if let Some(Question::Save { word: typed, .. }) = &mut self.question {
                    *typed = word;
                } else {
                    self.save_as(ctx, path.to_owned(), false, After::Nothing);
                }
            }
            Purpose::Screenshot => {
                if let Some(Question::Screenshot { word: typed, .. }) = &mut self.question {
                    *typed = word;
                }
            }
        }
    }

    fn put_on_desk(&mut self, ctx: &egui::Context, loaded: Loaded) {
        let Loaded { path, base, document, data, warnings, aside } = loaded;
        let mut history = History::new(document, self.settings.undo_megabytes << 20);
        if let Some(file) = aside {
            history.mark_unsaved();
            // it is in our own recovery file from now on
            self.recovery.keep(history.document(), path.as_deref(), &base);
            self.aside = Some(history.document().clone());
            let _ = std::fs::remove_file(file);
        }
        match (&path, &history.document().volume) {
            (Some(p), _) => self.settings.remember(p),
            (None, VolumeSource::File(p)) => self.settings.remember(&base.join(p)),
            _ => {}
        }
        self.settings.save(&self.home);
        self.cancel_stroke();
        self.hover = None;
        self.measure.clear();
        self.sections = None;
        self.panels = PanelState::default();
        self.desk = Some(Desk { history, path, base, data, object: None, preview: None });
        for w in warnings {
            self.tell(w, false);
        }
        for word in std::mem::take(&mut self.after_open) {
            self.open(ctx, &word);
        }
    }

    fn take_drops(&mut self, ctx: &egui::Context) {
        let dropped = ctx.input(|i| i.raw.dropped_files.clone());
        for file in dropped {
            self.open(ctx, &file.path().to_string_lossy());
        }
    }

    fn take_close(&mut self, ctx: &egui::Context) {
        if ctx.input(|i| i.viewport().close_requested())
            && !self.quitting
            && self.desk.as_ref().is_some_and(|d| d.history.is_dirty())
        {
            ctx.send_viewport_cmd(egui::ViewportCommand::CancelClose);
            self.question = Some(Question::Unsaved(After::Quit));
        }
    }

    fn retitle(&mut self, ctx: &egui::Context) {
        let title = self.desk.as_ref().map_or_else(|| "Voxclay".to_owned(), |d| format!("{} – Voxclay", d.title()));
        if title != self.titled {
            ctx.send_viewport_cmd(egui::ViewportCommand::Title(title.clone()));
            self.titled = title;
        }
    }

    fn show_notices(&mut self, ctx: &egui::Context) {
        self.notices.retain(|n| n.since.elapsed() < Duration::from_secs(if n.error { 14 } else { 6 }));
        if self.notices.is_empty() {
            return;
        }
        ctx.request_repaint_after(Duration::from_millis(500));
        let mut closed = None;
        egui::Area::new(egui::Id::unique("notices"))
            .anchor(egui::Align2::LEFT_BOTTOM, [theme::TOOL_BAR + 12.0, -(theme::STATUS_BAR + 12.0)])
            .show(ctx, |ui| {
                for (i, n) in self.notices.iter().enumerate() {
                    let line = if n.error { theme::ERROR } else { Color32::TRANSPARENT };
                    egui::Frame::popup(ui.style()).stroke((1.0, line)).show(ui, |ui| {
                        ui.set_max_width(420.0);
                        ui.horizontal(|ui| {
                            let close = ui
                                .small_button(egui_material_icons::icons::ICON_CLOSE.rich_text().size(12.0))
                                .on_hover_text("Close");
                            if close.clicked() {
                                closed = Some(i);
                            }
                            ui.label(RichText::new(&n.text));
                        });
                    });
                }
            });
        if let Some(i) = closed {
            self.notices.remove(i);
        }
    }

    /// Names the tool by its key; used by tests and the tool bar.
    pub fn set_tool(&mut self, tool: Tool) {
        self.cancel_stroke();
        self.hand.tool = tool;
        if tool == Tool::Place {
            self.view.cube = true;
        }
        if tool == Tool::Lattice {
            view::ensure_lattice(self);
        }
    }
}

fn put(ctx: &egui::Context, slot: &mut Option<TextureHandle>, name: &str, image: &Arc<egui::ColorImage>) {
    match slot {
        Some(texture) => texture.set(image.clone(), TextureOptions::LINEAR),
        None => *slot = Some(ctx.load_texture(name, image.clone(), TextureOptions::LINEAR)),
    }
}

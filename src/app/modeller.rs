//! The modeller itself: what is open, and everything that can be done to it.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use eframe::egui;
use glam::DVec3;

use super::asking::Wanted;
use super::desk::{Desk, suggested, thumbnail};
use super::panels::{self, Pane, PanelState};
use super::recovery::{self, Aside, Recovery};
use super::sculpt::{Hand, Tool};
use super::settings::{Home, Settings, ThemeChoice};
use super::shown::{Sections, Shown};
use super::state::{After, Doing, FIRST, Notice, Question, Start, Textures, ViewState};
use super::steps::{Player, Reader};
use super::tasks::{self, Purpose, Task};
use super::trace::Trace;
use super::turntable::Turntable;
use super::worker::Worker;
use super::{theme, view};
use crate::evaluate::picture::{Backend, Refinement, ViewOptions};
use crate::scene::{Document, Edit};

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
    pub player: Player,
    pub(super) reader: Reader,
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
    pub(super) home: Home,
    pub(super) worker: Worker,
    pub(super) recovery: Recovery,
    /// When the picture on screen last became out of date.
    pub(super) moved: Instant,
    pub(super) wanted: Option<Wanted>,
    /// Recovery holds this document.
    pub(super) aside: Option<Arc<Document>>,
    pub(super) size: (u32, u32),
    pub(super) then: After,
    pub(super) quitting: bool,
    pub(super) titled: String,
    pub(super) after_open: Vec<String>,
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
            view: ViewState::default(),
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
            player: Player::default(),
            reader: Reader::new(ctx),
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
        // it would go on with new steps of the history
        self.player.playing = false;
        if let Some(desk) = &mut self.desk
            && !desk.history.undo()
        {
            self.tell("There is nothing to undo".to_owned(), false);
        }
    }

    pub fn redo(&mut self) {
        self.cancel_stroke();
        self.player.playing = false;
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

//! What comes in from outside a pass: pictures, the ends of tasks, dropped files, the wish to close.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use eframe::egui::{self, TextureHandle, TextureOptions};

use super::desk::Desk;
use super::modeller::Modeller;
use super::panels::PanelState;
use super::sculpt::Hand;
use super::state::{After, Notice, Question};
use super::steps::Player;
use super::tasks::{Loaded, Outcome, Purpose};
use super::worker::News;
use crate::scene::{Edit, History, VolumeSource};

impl Modeller {
    pub(super) fn take_news(&mut self, ctx: &egui::Context) {
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
                        // a mask was of the values of another volume
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
                News::Heat(surface) => self.panels.heat = Some(surface),
                News::Tets(layer) => self.panels.tets = Some(layer),
                News::Tessellation(edges) => self.panels.tessellation = Some(edges),
                News::Note(what) => self.tell(what, false),
                News::Failed(what) => self.tell(what, true),
            }
        }
    }

    pub(super) fn take_outcomes(&mut self, ctx: &egui::Context) {
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
                Outcome::Masked(data, mask) => {
                    if let Some(desk) = &mut self.desk
                        && Arc::ptr_eq(&desk.data, &data)
                    {
                        desk.mask = Some(mask);
                    }
                }
                Outcome::Counted(data, joint) => {
                    if let Some(desk) = &mut self.desk
                        && Arc::ptr_eq(&desk.data, &data)
                    {
                        desk.joint = Some(joint);
                    }
                }
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
        self.player = Player::default();
        self.desk = Some(Desk { history, path, base, data, object: None, preview: None, mask: None, joint: None });
        for w in warnings {
            self.tell(w, false);
        }
        for word in std::mem::take(&mut self.after_open) {
            self.open(ctx, &word);
        }
    }

    pub(super) fn take_drops(&mut self, ctx: &egui::Context) {
        let dropped = ctx.input(|i| i.raw.dropped_files.clone());
        for file in dropped {
            self.open(ctx, &file.path().to_string_lossy());
        }
    }

    pub(super) fn take_close(&mut self, ctx: &egui::Context) {
        if ctx.input(|i| i.viewport().close_requested())
            && !self.quitting
            && self.desk.as_ref().is_some_and(|d| d.history.is_dirty())
        {
            ctx.send_viewport_cmd(egui::ViewportCommand::CancelClose);
            self.question = Some(Question::Unsaved(After::Quit));
        }
    }
}

fn put(ctx: &egui::Context, slot: &mut Option<TextureHandle>, name: &str, image: &Arc<egui::ColorImage>) {
    match slot {
        Some(texture) => texture.set(image.clone(), TextureOptions::LINEAR),
        None => *slot = Some(ctx.load_texture(name, image.clone(), TextureOptions::LINEAR)),
    }
}

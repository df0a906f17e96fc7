//! What the modeller asks of its worker and of the recovery, pass by pass.

use std::sync::Arc;
use std::time::{Duration, Instant};

use eframe::egui;
use glam::DVec3;

use super::modeller::Modeller;
use super::panels::{self, Pane};
use super::state::REST;
use super::worker::{Other, Want};
use super::{tasks, theme};
use crate::evaluate::load::Data;
use crate::evaluate::picture::Mode;
use crate::scene::Document;

/// What was asked of the worker last.
pub struct Wanted {
    key: Key,
    moving: bool,
}

#[derive(Clone)]
struct Key {
    document: Arc<Document>,
    size: (u32, u32),
    mode: Mode,
    other: Option<Other>,
    sections: Option<(DVec3, usize)>,
    growth: bool,
    tessellation: bool,
    tets: Option<DVec3>,
    heat: bool,
    dark: bool,
    data: Arc<Data>,
}

impl Key {
    fn same(&self, k: &Self) -> bool {
        (Arc::ptr_eq(&self.document, &k.document) || self.document == k.document)
            && Arc::ptr_eq(&self.data, &k.data)
            && (self.size, self.mode, self.other, self.sections, self.dark)
                == (k.size, k.mode, k.other, k.sections, k.dark)
            && (self.growth, self.tessellation, self.tets, self.heat) == (k.growth, k.tessellation, k.tets, k.heat)
    }
}

impl Modeller {
    /// Asks the worker for what is to be seen, coarse while it changes.
    pub(super) fn ask(&mut self, ctx: &egui::Context) {
        let Some(desk) = &self.desk else { return };
        let dark = ctx.theme() == egui::Theme::Dark;
        let key = Key {
            document: desk.at_hand(),
            size: self.size,
            mode: self.view.mode,
            other: self.view.compare.then_some(self.view.other),
            sections: panels::is_open(&self.tree, Pane::Slices).then_some((self.view.cursor, 256)),
            growth: self.view.growth,
            tessellation: self.view.tessellation && self.view.overlays,
            tets: (self.view.tets && self.view.overlays).then_some(self.view.cursor),
            heat: self.view.heat && self.view.overlays,
            dark,
            data: desk.data.clone(),
        };
        if key.size.0 < 8 || key.size.1 < 8 {
            return;
        }
        let changed = self.wanted.as_ref().is_none_or(|w| !w.key.same(&key));
        if changed {
            self.moved = Instant::now();
        }
        // what is held still for a moment is worth a better picture, even with the button down
        let held = ctx.input(|i| i.pointer.any_down());
        // what stands for a smooth surface while something moves would only flicker between its steps
        let smooth = self.player.playing && key.mode == Mode::Spline && !held;
        let moving = !smooth && if changed { held || self.wanted.is_some() } else { self.moved.elapsed() < REST };
        let refine = !moving && self.wanted.as_ref().is_some_and(|w| w.moving);
        if changed || refine {
            let stepped = self.wanted.as_ref().is_none_or(|w| !Arc::ptr_eq(&w.key.data, &key.data));
            let generation = self.worker.want(Want {
                data: key.data.clone(),
                base: desk.base.clone(),
                document: key.document.clone(),
                size: key.size,
                mode: key.mode,
                other: key.other,
                moving,
                budget: if smooth { f32::MAX } else { self.settings.preview_ms },
                sections: key.sections,
                growth: key.growth,
                tessellation: key.tessellation,
                tets: key.tets,
                heat: key.heat,
                ground: theme::view_ground(dark),
            });
            if stepped {
                self.player.picture = generation;
            }
            self.wanted = Some(Wanted { key, moving });
        }
        if moving {
            ctx.request_repaint_after(REST);
        }
    }

    /// The mask for the range that is set, as soon as it is.
    pub(super) fn ask_mask(&mut self, ctx: &egui::Context) {
        let (Some(desk), Some(range)) = (&self.desk, self.hand.mask) else { return };
        let known = desk.mask.as_ref().is_some_and(|m| m.range == range);
        if !known && !self.tasks.iter().any(|t| t.name == tasks::MASKING) {
            self.tasks.push(tasks::mask(ctx, desk.data.clone(), range));
        }
    }

    /// Unsaved work is put aside after a short rest.
    pub(super) fn put_aside(&mut self, ctx: &egui::Context) {
        let Some(desk) = &self.desk else { return };
        let document = desk.history.document();
        if self.aside.as_ref().is_some_and(|a| Arc::ptr_eq(a, document)) {
            return;
        }
        if !desk.history.is_dirty() {
            if self.aside.take().is_some() {
                self.recovery.clear();
            }
            return;
        }
        let rest = Duration::from_secs_f32(self.settings.autosave_seconds.clamp(0.2, 600.0));
        if self.moved.elapsed() >= rest {
            self.recovery.keep(document, desk.path.as_deref(), &desk.base);
            self.aside = Some(document.clone());
        } else {
            ctx.request_repaint_after(rest.saturating_sub(self.moved.elapsed()));
        }
    }
}

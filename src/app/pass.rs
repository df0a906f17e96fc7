//! One pass of the interface, from what came in to what is asked for.

use std::time::{Duration, Instant};

use eframe::egui::{self, Color32, Panel, RichText};

use super::modeller::Modeller;
use super::{keys, menu, panels, questions, theme};

impl Modeller {
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
        // a slider that was let go: the next change is a step of its own
        if let Some(desk) = &mut self.desk
            && ctx.input(|i| i.pointer.any_released() || i.key_pressed(egui::Key::Enter))
        {
            desk.history.close_step();
        }
        self.show_notices(&ctx);
        if self.show_trace {
            menu::trace(self, &ctx);
        }
        self.follow_step(&ctx);
        self.ask_mask(&ctx);
        self.ask(&ctx);
        self.put_aside(&ctx);
        self.retitle(&ctx);
        self.trace.pass.add(started.elapsed());
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
}

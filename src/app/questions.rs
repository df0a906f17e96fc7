//! The questions that are asked, over everything else.

use eframe::egui::{self, RichText};

use super::desk::file_name;
use super::keys;
use super::modeller::Modeller;
use super::navigate::Orbit;
use super::settings::ThemeChoice;
use super::state::{After, Question};
use super::tasks::{self, Purpose};
use super::theme;
use super::turntable::Turntable;

/// The question that is open, over everything else.
pub fn show(m: &mut Modeller, ctx: &egui::Context) {
    let Some(question) = m.question.clone() else { return };
    let mut next = Some(question.clone());
    egui::Modal::new(egui::Id::unique("question")).show(ctx, |ui| {
        ui.set_width(460.0);
        match question {
            Question::Open { mut word, mut wrong } => {
                ui.heading("Open");
                ui.label(RichText::new("A project, a volume, a surface for the shape, or phantom:NAME").weak());
                let entered = path_field(ui, "Path", &mut word);
                if let Some(wrong) = &wrong {
                    ui.colored_label(theme::ERROR, wrong);
                }
                buttons(ui, |ui| {
                    let open = ui.button("Open").clicked() || entered;
                    let cancel = ui.button("Cancel").clicked();
                    if ui.button("Browse…").clicked() {
                        m.choose(ctx, Purpose::Open, None);
                    }
                    if open {
                        match tasks::can_open(&word) {
                            Ok(()) => {
                                m.question = None;
                                m.open(ctx, &word);
                                next = m.question.clone();
                                return;
                            }
                            Err(e) => wrong = Some(e),
                        }
                    }
                    next = if cancel { None } else { Some(Question::Open { word: word.clone(), wrong: wrong.clone() }) };
                });
            }
            Question::Save { mut word, mut embed, then } => {
                ui.heading("Save the project");
                let entered = path_field(ui, "Path", &mut word);
                ui.checkbox(&mut embed, "Put the volume into the file")
                    .on_hover_text("Otherwise the project refers to the volume's file");
                if embed && m.steps() > 1 {
                    ui.label(RichText::new("Of the series, the step that is shown: a volume of its own").weak());
                }
                buttons(ui, |ui| {
                    let save = ui.button("Save").clicked() || entered;
                    let cancel = ui.button("Cancel").clicked();
                    if ui.button("Browse…").clicked() {
                        m.choose(ctx, Purpose::Save, Some(tasks::typed_path(&word)));
                    }
                    next = Some(Question::Save { word: word.clone(), embed, then: then.clone() });
                    if save && !word.trim().is_empty() {
                        m.save_as(ctx, tasks::typed_path(&word), embed, then.clone());
                        next = None;
                    } else if cancel {
                        next = None;
                    }
                });
            }
            Question::Screenshot { mut word, mut transparent } => {
                ui.heading("Picture of the view");
                let (w, h) = m.picture_size();
                ui.label(RichText::new(format!("{w} x {h} pixels, supersampled")).weak());
                let entered = path_field(ui, "Path", &mut word);
                ui.checkbox(&mut transparent, "Transparent background");
                buttons(ui, |ui| {
                    let save = ui.button("Write").clicked() || entered;
                    let cancel = ui.button("Cancel").clicked();
                    if ui.button("Browse…").clicked() {
                        m.choose(ctx, Purpose::Screenshot, Some(tasks::typed_path(&word)));
                    }
                    next = Some(Question::Screenshot { word: word.clone(), transparent });
                    if save {
                        m.screenshot(ctx, tasks::typed_path(&word), transparent);
                        next = None;
                    } else if cancel {
                        next = None;
                    }
                });
            }
            Question::Turntable { mut word, mut frames, mut seconds } => {
                ui.heading("Turntable");
                ui.label(RichText::new(".gif, .mp4 (with ffmpeg), or .png for a row of pictures").weak());
                let entered = path_field(ui, "Path", &mut word);
                ui.horizontal(|ui| {
                    let label = ui.label("Frames");
                    ui.add(egui::DragValue::new(&mut frames).range(2..=3600)).labelled_by(label.id);
                    let label = ui.label("Seconds");
                    ui.add(egui::DragValue::new(&mut seconds).range(0.2..=600.0).speed(0.1)).labelled_by(label.id);
                });
                buttons(ui, |ui| {
                    let make = ui.button("Make").clicked() || entered;
                    let cancel = ui.button("Cancel").clicked();
                    next = Some(Question::Turntable { word: word.clone(), frames, seconds });
                    if make {
                        let path = tasks::typed_path(&word);
                        m.turntable(ctx, Turntable { path, frames, seconds });
                        next = None;
                    } else if cancel {
                        next = None;
                    }
                });
            }
            Question::Unsaved(then) => {
                ui.heading("There is unsaved work");
                ui.label("Save it first?");
                buttons(ui, |ui| {
                    if ui.button("Save").clicked() {
                        m.question = None;
                        m.save(ctx, then.clone());
                        next = m.question.clone();
                    }
                    if ui.button("Discard").clicked() {
                        next = None;
                        match &then {
                            After::Open(word) => m.open_now(ctx, word),
                            After::Quit => m.quit_now(ctx),
                            After::Nothing => {}
                        }
                    }
                    if ui.button("Cancel").clicked() {
                        next = None;
                    }
                });
            }
            Question::Recover => {
                ui.heading("Unsaved work was found");
                ui.label("Voxclay did not close properly last time.");
                let names: Vec<String> = m.lost.iter().map(|(_, a)| describe(a)).collect();
                for (i, name) in names.iter().enumerate() {
                    if ui.button(format!("Recover {name}")).clicked() {
                        m.recover(ctx, i);
                        next = None;
                    }
                }
                buttons(ui, |ui| {
                    if ui.button("Later").clicked() {
                        next = None;
                    }
                    if ui.button("Discard").clicked() {
                        m.discard_lost();
                        next = None;
                    }
                });
            }
            Question::Keys => {
                ui.heading("Keys");
                // side by side, so that the whole map fits into a small window
                ui.set_width(KEYS_WIDTH.min(ctx.content_rect().width() - 80.0));
                let most = ctx.content_rect().height() - 180.0;
                egui::ScrollArea::vertical().max_height(most).min_scrolled_height(most).show(ui, |ui| {
                    ui.columns(2, |columns| {
                        for (column, groups) in columns.iter_mut().zip([&["Tools", "Work"][..], &["View"]]) {
                            for group in groups {
                                key_group(column, group);
                            }
                        }
                    });
                });
                buttons(ui, |ui| {
                    if ui.button("Close").clicked() {
                        next = None;
                    }
                });
            }
            Question::Preferences => {
                ui.heading("Preferences");
                let before = m.settings.clone();
                egui::Grid::new("preferences").num_columns(2).spacing([16.0, 8.0]).show(ui, |ui| {
                    ui.label("Theme");
                    ui.horizontal(|ui| {
                        ui.selectable_value(&mut m.settings.theme, ThemeChoice::Dark, "Dark");
                        ui.selectable_value(&mut m.settings.theme, ThemeChoice::Light, "Light");
                    });
                    ui.end_row();
                    ui.label("Orbit");
                    ui.horizontal(|ui| {
                        for orbit in Orbit::ALL {
                            ui.selectable_value(&mut m.settings.orbit, orbit, orbit.name());
                        }
                    });
                    ui.end_row();
                    let label = ui.label("Size of the interface");
                    ui.add(egui::Slider::new(&mut m.settings.zoom, 0.6..=2.0).update_while_editing(false)).labelled_by(label.id);
                    ui.end_row();
                    let label = ui.label("Time for a picture while moving");
                    ui.add(egui::Slider::new(&mut m.settings.preview_ms, 8.0..=200.0).suffix(" ms")).labelled_by(label.id);
                    ui.end_row();
                    let label = ui.label("Put unsaved work aside after");
                    ui.add(egui::Slider::new(&mut m.settings.autosave_seconds, 0.5..=60.0).suffix(" s")).labelled_by(label.id);
                    ui.end_row();
                    let label = ui.label("Memory for undo");
                    ui.add(egui::Slider::new(&mut m.settings.undo_megabytes, 1..=1024).logarithmic(true).suffix(" MB")).labelled_by(label.id);
                    ui.end_row();
                });
                if m.settings != before {
                    m.apply_settings(ctx);
                }
                buttons(ui, |ui| {
                    if ui.button("Close").clicked() {
                        next = None;
                    }
                });
            }
            Question::About => {
                ui.heading(format!("Voxclay {}", env!("CARGO_PKG_VERSION")));
                ui.label("Sculpts volumes: a scan, a simulation, a painted texture, bent like clay without losing its inside.");
                ui.label(RichText::new("After Westermann and Rezk-Salama (2001) and Gascon et al. (2013).").weak());
                buttons(ui, |ui| {
                    if ui.button("Close").clicked() {
                        next = None;
                    }
                });
            }
        }
    });
    m.question = next;
}

/// Of the map of keys.
const KEYS_WIDTH: f32 = 980.0;

/// The keys of one group.
fn key_group(ui: &mut egui::Ui, group: &str) {
    ui.add_space(8.0);
    ui.label(RichText::new(group).strong());
    for (_, key, what) in keys::MAP.iter().filter(|(g, ..)| *g == group) {
        ui.horizontal(|ui| {
            let middle = egui::Layout::left_to_right(egui::Align::Center);
            ui.allocate_ui_with_layout(egui::vec2(176.0, 20.0), middle, |ui| {
                ui.set_min_width(176.0);
                ui.label(RichText::new(*key).monospace().color(theme::accent_text(ui)));
            });
            ui.label(*what);
        });
    }
}

fn describe(aside: &super::recovery::Aside) -> String {
    use crate::scene::VolumeSource;
    let count = aside.document.stack.items.len();
    let name = match (&aside.path, &aside.document.volume) {
        (Some(p), _) | (None, VolumeSource::File(p) | VolumeSource::Embedded(p)) => file_name(p),
        (None, VolumeSource::Phantom { name, .. }) => name.clone(),
    };
    format!("{name} ({count} deformations)")
}

/// A line for a path; true if it was entered.
fn path_field(ui: &mut egui::Ui, name: &str, word: &mut String) -> bool {
    let label = ui.label(RichText::new(name).size(12.0));
    let edit = egui::TextEdit::singleline(word).desired_width(f32::INFINITY);
    let response = ui.add(edit).labelled_by(label.id);
    if !response.has_focus() && !response.lost_focus() && ui.memory(|mem| mem.focused().is_none()) {
        response.request_focus();
    }
    response.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter))
}

fn buttons(ui: &mut egui::Ui, add: impl FnOnce(&mut egui::Ui)) {
    ui.add_space(8.0);
    ui.horizontal(add);
}

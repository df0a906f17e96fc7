//! The brush, and the stack of what was done.

use eframe::egui::{self, RichText};
use egui_material_icons::icons;
use glam::DVec3;

use super::{number, row, title, vector};
use crate::app::menu::icon_button;
use crate::app::modeller::Modeller;
use crate::app::sculpt::{Shape, Tool};
use crate::app::theme;
use crate::deform::{Action, Brush, Deformation, Deformer, DisplacementVolume, Extent, Grab, Stack};
use crate::scene::Edit;

pub fn show(m: &mut Modeller, ui: &mut egui::Ui) {
    let Some(desk) = &m.desk else {
        ui.label(RichText::new("Nothing is open yet.").weak());
        return;
    };
    let unit = desk.unit();
    let focus = desk.data.focus.1;
    brush(m, ui, unit, focus);
    stack(m, ui, unit);
    history(m, ui);
}

fn brush(m: &mut Modeller, ui: &mut egui::Ui, unit: &str, focus: f64) {
    title(ui, m.hand.tool.name());
    if m.hand.tool.is_brush() {
        ball(m, ui, unit, focus);
    } else {
        ui.add(egui::Label::new(RichText::new(m.hand.tool.hint()).color(theme::dim(ui))).wrap());
    }
    let Some(desk) = &m.desk else { return };
    let mut folds = desk.history.document().allow_folds;
    if ui
        .checkbox(&mut folds, "Let strokes fold")
        .on_hover_text("Otherwise a stroke is held back before it folds")
        .changed()
    {
        m.edit(Edit::SetAllowFolds(folds));
    }
}

/// The ball of a brush, and how it fades.
fn ball(m: &mut Modeller, ui: &mut egui::Ui, unit: &str, focus: f64) {
    row(ui, "Radius", |ui, id| {
        let range = 0.01 * focus..=1.5 * focus;
        ui.add(
            egui::Slider::new(&mut m.hand.radius, range)
                .logarithmic(true)
                .fixed_decimals(1)
                .suffix(format!(" {unit}"))
                .clamping(egui::SliderClamping::Never),
        )
        .labelled_by(id)
        .on_hover_text("F, or Ctrl and the wheel");
    });
    row(ui, "Strength", |ui, id| {
        ui.add(egui::Slider::new(&mut m.hand.strength, 0.01..=1.0).fixed_decimals(2))
            .labelled_by(id)
            .on_hover_text("Shift F");
    });
    row(ui, "Falloff", |ui, id| {
        egui::ComboBox::from_id_salt("falloff")
            .selected_text(m.hand.shape.name())
            .width(168.0)
            .show_ui(ui, |ui| {
                for shape in Shape::ALL {
                    ui.selectable_value(&mut m.hand.shape, shape, shape.name());
                }
            })
            .response
            .labelled_by(id);
    });
    if m.hand.tool != Tool::Smooth {
        mask(m, ui);
    }
    if m.hand.tool == Tool::Grab {
        ui.checkbox(&mut m.hand.moves_shape, "The shape follows")
            .on_hover_text("A mesh that is not the box moves along");
    }
}

/// Only some values follow.
fn mask(m: &mut Modeller, ui: &mut egui::Ui) {
    let Some(desk) = &m.desk else { return };
    let ([lo, hi], iso) = (desk.data.basis.range, desk.data.iso);
    let mut on = m.hand.mask.is_some();
    let what = "Values outside this range stay where they are. The edge is soft, and a stroke is held back sooner: \
                what follows cannot tear away from what stays.";
    if ui.checkbox(&mut on, "Only values").on_hover_text(what).changed() {
        m.hand.mask = on.then_some([iso, hi]);
    }
    if let Some([from, to]) = &mut m.hand.mask {
        row(ui, "From, to", |ui, _| {
            for (name, v) in [("Mask, from", from), ("Mask, to", to)] {
                let drag = egui::DragValue::new(v).speed((hi - lo) / 400.0).range(lo..=hi).max_decimals(4);
                let response = ui.add(drag).on_hover_text("Real values of the undeformed data");
                response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, name));
            }
        });
    }
}

fn stack(m: &mut Modeller, ui: &mut egui::Ui, unit: &str) {
    let Some(desk) = &m.desk else { return };
    let items = desk.history.document().stack.items.clone();
    ui.separator();
    title(ui, "Deformations, newest first");
    if items.is_empty() {
        ui.label(RichText::new("None yet: drag on the object.").weak());
    }
    let mut edit = None;
    let mut select = m.panels.selected;
    for (i, item) in items.iter().enumerate().rev() {
        let frame = egui::Frame::NONE
            .fill(if select == Some(i) { ui.visuals().widgets.inactive.bg_fill } else { egui::Color32::TRANSPARENT })
            .corner_radius(4.0)
            .inner_margin(egui::Margin::symmetric(4, 1));
        frame.show(ui, |ui| {
            ui.horizontal(|ui| {
                ui.spacing_mut().item_spacing.x = 2.0;
                let (icon, what) = if item.enabled {
                    (icons::ICON_VISIBILITY, "Switch off")
                } else {
                    (icons::ICON_VISIBILITY_OFF, "Switch on")
                };
                if icon_button(ui, icon, &format!("{what} {}", item.name), true) {
                    edit = Some(Edit::Enable(i, !item.enabled));
                }
                let text = if item.enabled { RichText::new(&item.name) } else { RichText::new(&item.name).weak() };
                let width = ui.available_width() - 4.0 * 28.0;
                let size = egui::vec2(width.max(40.0), 24.0);
                let left = egui::Layout::left_to_right(egui::Align::Center);
                let label = ui.allocate_ui_with_layout(size, left, |ui| {
                    ui.set_min_size(size);
                    ui.add(egui::Button::new(text).frame(false).truncate())
                });
                if label.inner.clicked() {
                    select = if select == Some(i) { None } else { Some(i) };
                }
                if icon_button(ui, icons::ICON_ARROW_UPWARD, &format!("Later: {}", item.name), i + 1 < items.len()) {
                    edit = Some(Edit::Move { from: i, to: i + 1 });
                    select = Some(i + 1);
                }
                if icon_button(ui, icons::ICON_ARROW_DOWNWARD, &format!("Earlier: {}", item.name), i > 0) {
                    edit = Some(Edit::Move { from: i, to: i - 1 });
                    select = Some(i - 1);
                }
                if icon_button(ui, icons::ICON_CONTENT_COPY, &format!("Duplicate {}", item.name), true) {
                    edit = Some(Edit::Duplicate(i));
                }
                if icon_button(ui, icons::ICON_DELETE, &format!("Delete {}", item.name), true) {
                    edit = Some(Edit::Remove(i));
                    select = None;
                }
            });
        });
        if select == Some(i)
            && let Some(changed) = details(ui, item, unit)
        {
            edit = Some(Edit::Replace(i, changed));
        }
    }
    m.panels.selected = select.filter(|i| *i < items.len());
    if let Some(edit) = edit {
        m.edit(edit);
    }
}

/// The numbers of one deformation; the changed one, if it was.
fn details(ui: &mut egui::Ui, item: &Deformation, unit: &str) -> Option<Deformation> {
    let mut new = item.clone();
    let suffix = format!(" {unit}");
    egui::Frame::NONE.inner_margin(egui::Margin { left: 8, ..egui::Margin::ZERO }).show(ui, |ui| {
        row(ui, "Name", |ui, id| {
            ui.add(egui::TextEdit::singleline(&mut new.name).desired_width(160.0)).labelled_by(id);
        });
        row(ui, "Effect", |ui, id| {
            ui.add(egui::Slider::new(&mut new.opacity, 0.0..=1.0).fixed_decimals(2)).labelled_by(id);
        });
        ui.checkbox(&mut new.moves_shape, "Moves the shape");
        if let Some(deformer) = numbers(ui, &item.deformer, &suffix) {
            new.deformer = deformer;
        }
        row(ui, "Steepness", |ui, _| {
            let s = item.deformer.steepness();
            let color = if s >= 1.0 { theme::ERROR } else { theme::dim(ui) };
            ui.colored_label(color, format!("{s:.2}")).on_hover_text("At 1 and above space folds");
        });
    });
    (new != *item).then_some(new)
}

/// A displacement over the unit cube, about its middle.
type Bend = fn(DVec3) -> DVec3;

/// A deformer with the numbers that were typed, if they make one.
fn numbers(ui: &mut egui::Ui, deformer: &Deformer, suffix: &str) -> Option<Deformer> {
    match deformer {
        Deformer::Displacement(d) => {
            let (mut point, mut v, mut e) = (d.point(), d.vector(), d.extent());
            let mut changed = vector(ui, "Point", &mut point, 0.2, "") | vector(ui, "Pull", &mut v, 0.1, "");
            for (name, n) in [("Half-width u", &mut e.u), ("Half-width v", &mut e.v), ("Length", &mut e.length)] {
                changed |= row(ui, name, |ui, id| number(ui, id, n, 0.1, suffix).changed());
            }
            let Extent { u, v: w, length } = e;
            changed
                .then(|| DisplacementVolume::new(point, v, Extent { u, v: w, length }, None).ok())?
                .map(Deformer::Displacement)
        }
        Deformer::Grab(g) => {
            let (mut center, mut v, mut r) = (g.center(), g.vector(), g.radius());
            let mut changed = vector(ui, "Centre", &mut center, 0.2, "") | vector(ui, "Pull", &mut v, 0.1, "");
            changed |= row(ui, "Radius", |ui, id| number(ui, id, &mut r, 0.1, suffix).changed());
            changed.then(|| Grab::new(center, v, r, g.falloff()).ok())?.map(Deformer::Grab)
        }
        Deformer::Brush(b) => {
            let (mut center, mut r, mut action) = (b.center(), b.radius(), b.action());
            let mut changed = vector(ui, "Centre", &mut center, 0.2, "");
            changed |= row(ui, "Radius", |ui, id| number(ui, id, &mut r, 0.1, suffix).changed());
            changed |= match &mut action {
                Action::Inflate { amount } | Action::Pinch { amount, .. } => {
                    row(ui, "Amount", |ui, id| number(ui, id, amount, 0.005, "").changed())
                }
                Action::Twist { degrees, .. } => row(ui, "Angle", |ui, id| number(ui, id, degrees, 0.5, "°").changed()),
            };
            changed.then(|| Brush::new(center, r, b.falloff(), action).ok())?.map(Deformer::Brush)
        }
        Deformer::Lattice(l) => {
            let [x, y, z] = l.dims();
            let largest = l.handles().iter().map(|h| h.length()).fold(0.0, f64::max);
            row(ui, "Handles", |ui, _| ui.label(format!("{x} x {y} x {z}")));
            row(ui, "Largest pull", |ui, _| ui.label(format!("{largest:.1}{suffix}")));
            ui.horizontal(|ui| {
                let mut made = None;
                let shapes: [(&str, Bend); 3] = [
                    ("Bend", |p| DVec3::new(0.35 * (p.z * p.z - 0.3), 0.0, -0.3 * p.x * p.z)),
                    ("Taper", |p| DVec3::new(0.3 * p.x * p.z, 0.3 * p.y * p.z, 0.0)),
                    ("Twist", |p| DVec3::new(-0.35 * p.y * p.z, 0.35 * p.x * p.z, 0.0)),
                ];
                for (name, f) in shapes {
                    if ui.button(name).clicked() {
                        let b = l.support();
                        let scale = 0.5 * b.half.min_element();
                        let add = |i: [usize; 3], at: DVec3| {
                            let n = i[0] + l.dims()[0] * (i[1] + l.dims()[1] * i[2]);
                            let local = (b.axes.transpose() * (at - b.center)) / b.half;
                            l.handles()[n] + b.axes * f(local) * scale
                        };
                        made = l.clone().with_vectors(add).ok();
                    }
                }
                if ui.button("Rest").clicked() {
                    made = l.clone().with_vectors(|_, _| DVec3::ZERO).ok();
                }
                made.map(Deformer::Lattice)
            })
            .inner
        }
    }
}

fn history(m: &mut Modeller, ui: &mut egui::Ui) {
    let Some(desk) = &mut m.desk else { return };
    ui.separator();
    egui::CollapsingHeader::new("History").default_open(false).show(ui, |ui| {
        let at = desk.history.at();
        let names: Vec<String> = desk.history.steps().iter().map(|s| s.name.clone()).collect();
        let mut to = None;
        for (i, name) in names.iter().enumerate().rev() {
            let text = if i > at { RichText::new(name).weak() } else { RichText::new(name) };
            if ui.selectable_label(i == at, text).clicked() {
                to = Some(i);
            }
        }
        if let Some(to) = to {
            desk.history.go(to);
        }
        let kilobytes = desk.history.bytes() as f64 / 1e3;
        ui.label(RichText::new(format!("{} steps, {kilobytes:.0} KB", names.len())).weak().size(11.0));
    });
}

/// Copies the stack as text, for this and other windows.
pub fn copy(m: &mut Modeller, ctx: &egui::Context) {
    let Some(desk) = &m.desk else { return };
    let stack = desk.history.document().stack.clone();
    if let Ok(text) = serde_json::to_string_pretty(&stack) {
        ctx.copy_text(text);
        m.tell(format!("Copied {} deformations", stack.items.len()), false);
        m.clipboard = Some(stack);
    }
}

/// Puts a copied stack on top; other text is none of our business.
pub fn paste(m: &mut Modeller, text: &str) {
    match serde_json::from_str::<Stack>(text) {
        Ok(stack) if !stack.items.is_empty() => push(m, stack),
        _ => m.tell("The clipboard holds no deformations".to_owned(), false),
    }
}

/// The same with what this window copied last.
pub fn paste_own(m: &mut Modeller) {
    match m.clipboard.clone() {
        Some(stack) => push(m, stack),
        None => m.tell("Copy a stack first".to_owned(), false),
    }
}

fn push(m: &mut Modeller, stack: Stack) {
    m.tell(format!("Pasted {} deformations", stack.items.len()), false);
    m.edit(Edit::Push(stack.items));
}

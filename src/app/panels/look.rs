//! How the object looks: transfer function, shading, light, slices.

use eframe::egui::{self, Color32, Pos2, Sense, Stroke as Line, Vec2};
use glam::DVec3;

use super::{row, surface, title, transfer};
use crate::app::modeller::Modeller;
use crate::app::theme;
use crate::evaluate::picture::Mode;
use crate::scene::{Clip, CutPlane, Edit, LookSpec, ShadingSpec};

pub fn show(m: &mut Modeller, ui: &mut egui::Ui) {
    let Some(desk) = &m.desk else { return };
    let document = desk.history.document().clone();
    let data = desk.data.clone();
    let [lo, hi] = data.basis.range;
    let before = document.look;
    let mut look = before;
    title(ui, "Shading");
    row(ui, "Show", |ui, _| {
        let iso = matches!(look.shading, ShadingSpec::Iso { .. });
        if ui.selectable_label(look.shading == ShadingSpec::Volume, "Volume").clicked() {
            look.shading = ShadingSpec::Volume;
        }
        if ui.selectable_label(iso, "Iso").on_hover_text("The surface of one value").clicked() && !iso {
            look.shading = ShadingSpec::Iso { value: None };
        }
        if ui.selectable_label(look.shading == ShadingSpec::Mip, "MIP").on_hover_text("Maximum intensity").clicked() {
            look.shading = ShadingSpec::Mip;
        }
    });
    if let ShadingSpec::Iso { value } = &mut look.shading {
        let mut v = value.unwrap_or(data.iso);
        let changed = row(ui, "Isovalue", |ui, id| {
            ui.add(egui::Slider::new(&mut v, lo..=hi).max_decimals(4)).labelled_by(id).changed()
        });
        if changed {
            *value = Some(v);
        }
    }
    ui.checkbox(&mut look.lit, "Lit");
    let regions = document.transfer_function.as_ref().is_some_and(|t| !t.regions.is_empty());
    ui.add_enabled(!regions, egui::Checkbox::new(&mut look.preintegrated, "Pre-integrated"))
        .on_hover_text("Thin layers between two slices are not missed")
        .on_disabled_hover_text("Not where opacity goes by value and steepness");
    edges(ui, &mut look);
    row(ui, "Light", |ui, _| light(ui, &mut look.light));
    row(ui, "Slices", |ui, id| {
        let mut all = look.slices.is_none();
        if ui.checkbox(&mut all, "one per voxel").labelled_by(id).changed() {
            look.slices = if all { None } else { Some(256) };
        }
        if let Some(n) = &mut look.slices {
            let response = ui.add(egui::DragValue::new(n).range(8..=4096));
            response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, "Number of slices"));
        }
    });
    background(ui, &mut look);
    if look != before {
        m.edit(Edit::SetLook(look));
    }
    // at hand where it shows, out of the way where it does not
    let smooth = m.view.mode == Mode::Spline;
    if smooth {
        surface::show(m, ui, &document.surface, &data);
    }
    clipping(m, ui, document.clip);
    transfer::show(m, ui, &document, &data);
    if !smooth {
        surface::show(m, ui, &document.surface, &data);
    }
}

/// Opacity by the gradient: the inside of what is uniform vanishes.
fn edges(ui: &mut egui::Ui, look: &mut LookSpec) {
    let mut on = look.gradient_opacity.is_some();
    let what = "Opacity by how steeply the values change: the inside of what is uniform vanishes, borders stay";
    ui.add_enabled_ui(look.shading == ShadingSpec::Volume, |ui| {
        if ui.checkbox(&mut on, "Gradient opacity").on_hover_text(what).changed() {
            look.gradient_opacity = on.then_some(STEEP);
        }
        let Some([from, to]) = &mut look.gradient_opacity else { return };
        for (name, what, v) in [
            ("Nothing below", "Steepness below which nothing is seen, in parts of the window per voxel", &mut *from),
            ("All above", "Steepness at which the opacity is that of the curve", &mut *to),
        ] {
            row(ui, name, |ui, id| {
                ui.add(egui::Slider::new(v, 0.0..=0.3).fixed_decimals(3)).labelled_by(id).on_hover_text(what)
            });
        }
        *to = to.max(*from + 0.001);
    });
}

/// Steepness at which borders of tissue show in a scan, in parts of the window per voxel.
const STEEP: [f64; 2] = [0.01, 0.06];

/// A box along the volume's axes, and a plane that faces the eye when it is set.
fn clipping(m: &mut Modeller, ui: &mut egui::Ui, before: Clip) {
    let mut clip = before;
    ui.separator();
    title(ui, "Clipping");
    for (axis, name) in ["Along i", "Along j", "Along k"].into_iter().enumerate() {
        let [lo, hi] = &mut clip.region[axis];
        row(ui, name, |ui, _| {
            let step = |v: &mut f64, range: std::ops::RangeInclusive<f64>, what: &str| {
                let drag = egui::DragValue::new(v).speed(0.004).range(range).fixed_decimals(3);
                let response = ui.add(drag);
                response
                    .widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, format!("{name}, {what}")));
            };
            let mut step = step;
            step(lo, 0.0..=(*hi - 0.002).max(0.0), "from");
            step(hi, (*lo + 0.002).min(1.0)..=1.0, "to");
        });
    }
    row(ui, "Plane", |ui, _| {
        let mut on = clip.plane.is_some();
        if ui.checkbox(&mut on, "facing the eye").on_hover_text("Through the point that was clicked last").changed() {
            let scene = crate::app::view::scene(m);
            clip.plane = scene.filter(|_| on).map(|s| CutPlane { point: m.view.cursor, normal: s.camera.to_eye() });
        }
        if !clip.is_nothing() && ui.button("Reset").on_hover_text("Show everything").clicked() {
            clip = Clip::default();
        }
    });
    if let Some(plane) = &mut clip.plane {
        let radius = m.desk.as_ref().map_or(1.0, |d| d.data.focus.1);
        row(ui, "Depth", |ui, id| {
            let mut shift = 0.0;
            let drag =
                egui::DragValue::new(&mut shift).speed(0.005 * radius).custom_formatter(|_, _| "drag".to_owned());
            if ui.add(drag).labelled_by(id).on_hover_text("Drag to move the plane").changed() {
                plane.point -= plane.normal.normalize_or_zero() * shift;
            }
        });
    }
    if clip != before {
        m.edit(Edit::SetClip(clip));
    }
}

fn background(ui: &mut egui::Ui, look: &mut LookSpec) {
    row(ui, "Background", |ui, _| {
        let mut own = look.background.is_some();
        let usual = theme::view_ground(ui.visuals().dark_mode);
        if ui.checkbox(&mut own, "own colours").changed() {
            look.background = own.then_some(usual);
        }
        if let Some([top, bottom]) = &mut look.background {
            for (name, c) in [("Background, top", top), ("Background, bottom", bottom)] {
                let response = super::color(ui, c);
                response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ColorWell, true, name));
            }
        }
    });
}

/// A ball; where it is dragged, there the light is.
fn light(ui: &mut egui::Ui, direction: &mut DVec3) {
    let (rect, response) = ui.allocate_exact_size(Vec2::splat(64.0), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, true, "Direction of the light"));
    let painter = ui.painter_at(rect);
    let (center, radius) = (rect.center(), 28.0);
    let unit = direction.normalize_or(DVec3::Z);
    if let Some(at) = response.interact_pointer_pos() {
        let p = (at - center) / radius;
        let p = if p.length() > 0.98 { p.normalized() * 0.98 } else { p };
        let (x, y) = (f64::from(p.x), f64::from(-p.y));
        *direction = DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt());
    }
    // shaded as the light says
    for i in 0..14 {
        let t = i as f32 / 14.0;
        let shift = Vec2::new(unit.x as f32, -unit.y as f32) * radius * 0.6 * t;
        painter.circle_filled(center + shift, radius * (1.0 - t) + 1.0, Color32::from_gray((50.0 + 150.0 * t) as u8));
    }
    painter.circle_stroke(center, radius, Line::new(1.0, Color32::from_white_alpha(60)));
    let dot: Pos2 = center + Vec2::new(unit.x as f32, -unit.y as f32) * radius;
    painter.circle(dot, 4.0, theme::ACCENT, Line::new(1.0, Color32::BLACK));
    response.on_hover_text("Drag to move the light");
}

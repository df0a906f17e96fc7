//! The transfer function over the histogram: points to drag, colours, window.

use eframe::egui::{self, Color32, Pos2, Rect, Sense, Stroke as Line, Vec2};

use super::{regions, row, title};
use crate::app::modeller::Modeller;
use crate::app::theme;
use crate::evaluate::load::Data;
use crate::scene::{Document, Edit};
use crate::volume::transfer::{ControlPoint, TransferFunction, Window, srgb_from_linear};

/// Opacities are small in thin layers: the scale is a root, so that a hundredth can be seen and set.
fn height(opacity: f32) -> f32 {
    opacity.clamp(0.0, 1.0).powf(1.0 / 3.0)
}

fn opacity(height: f32) -> f32 {
    height.clamp(0.0, 1.0).powi(3)
}

pub fn show(m: &mut Modeller, ui: &mut egui::Ui, document: &Document, data: &Data) {
    ui.separator();
    title(ui, "Transfer function");
    let range = data.basis.range;
    let Some((_, object)) = m.desk.as_ref().and_then(|d| d.object.as_ref()) else { return };
    let before = document.transfer_function.clone().unwrap_or_else(|| object.transfer.clone());
    let mut function = before.clone();
    let mut preset = None;
    row(ui, "Preset", |ui, id| {
        let name = if document.transfer_function.is_some() { "own" } else { document.transfer.as_str() };
        egui::ComboBox::from_id_salt("preset")
            .selected_text(name)
            .width(168.0)
            .show_ui(ui, |ui| {
                for p in TransferFunction::presets() {
                    if ui.selectable_label(name == p.name, p.name).on_hover_text(p.description).clicked() {
                        preset = Some(p.name.to_owned());
                    }
                }
            })
            .response
            .labelled_by(id);
    });
    let window = function.resolve(range);
    curve(m, ui, &mut function, data, window);
    let mut w = window;
    let speed = (range[1] - range[0]) / 500.0;
    row(ui, "Window", |ui, _| {
        for (name, v) in [("Window, low", 0), ("Window, high", 1)] {
            let response = ui.add(egui::DragValue::new(&mut w[v]).speed(speed).max_decimals(4));
            response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, name));
        }
        if ui.button("Whole").on_hover_text("The volume's own range").clicked() {
            w = range;
        }
    });
    if w != window && w[0] < w[1] && w[0].is_finite() && w[1].is_finite() {
        function.window = Window::Values { lo: w[0], hi: w[1] };
    }
    point(m, ui, &mut function, w);
    ui.checkbox(&mut m.panels.log_histogram, "Logarithmic histogram");
    regions::show(m, ui, &mut function, data, w);
    if function != before && function.check().is_ok() {
        m.edit(Edit::SetTransferFunction(function));
    }
    if let Some(name) = preset {
        m.panels.point = None;
        m.edit(Edit::SetTransfer(name));
    }
}

/// The point that was taken: value, opacity, colour.
fn point(m: &mut Modeller, ui: &mut egui::Ui, function: &mut TransferFunction, [lo, hi]: [f64; 2]) {
    let count = function.points.len();
    let Some(i) = m.panels.point.filter(|i| *i < count) else {
        ui.label(
            egui::RichText::new("Drag points; double-click adds one, right click takes it away.").weak().size(11.0),
        );
        return;
    };
    let (least, most) = (
        if i > 0 { function.points[i - 1].at } else { 0.0 },
        if i + 1 < count { function.points[i + 1].at } else { 1.0 },
    );
    let p = &mut function.points[i];
    row(ui, "Point", |ui, id| {
        let mut value = lo + f64::from(p.at) * (hi - lo);
        if ui.add(egui::DragValue::new(&mut value).speed((hi - lo) / 500.0).max_decimals(4)).labelled_by(id).changed() {
            p.at = (((value - lo) / (hi - lo)) as f32).clamp(least, most);
        }
        let response = ui.add(egui::DragValue::new(&mut p.opacity).speed(0.002).range(0.0..=1.0).max_decimals(4));
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, "Opacity of the point"));
        let response = super::color(ui, &mut p.color);
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ColorWell, true, "Colour of the point"));
    });
}

fn curve(m: &mut Modeller, ui: &mut egui::Ui, function: &mut TransferFunction, data: &Data, [lo, hi]: [f64; 2]) {
    let size = Vec2::new(ui.available_width(), 148.0);
    let (rect, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Group, true, "Curve of the transfer function"));
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 4.0, theme::PLOT);
    let area = Rect::from_min_max(rect.min + Vec2::new(8.0, 8.0), rect.max - Vec2::new(8.0, 20.0));
    let x = |at: f32| area.left() + at * area.width();
    let y = |o: f32| area.bottom() - height(o) * area.height();

    // histogram, in the window
    let h = &data.histogram;
    let scaled = |c: u64| if m.panels.log_histogram { (1.0 + c as f64).ln() } else { c as f64 };
    let most = h.counts.iter().map(|c| scaled(*c)).fold(1e-9, f64::max);
    let bins = h.counts.len() as f64;
    for (i, c) in h.counts.iter().enumerate() {
        let at = |b: f64| ((h.lo + (h.hi - h.lo) * b / bins - lo) / (hi - lo)) as f32;
        let (a, b) = (at(i as f64), at(i as f64 + 1.0));
        if b < 0.0 || a > 1.0 {
            continue;
        }
        let top = area.bottom() - (scaled(*c) / most) as f32 * area.height();
        let bar = Rect::from_min_max(Pos2::new(x(a.max(0.0)), top), Pos2::new(x(b.min(1.0)), area.bottom()));
        painter.rect_filled(bar, 0.0, theme::PLOT_BAR);
    }
    // the curve in its own colours, and the colours alone below it
    let steps = area.width() as usize;
    let sample = |i: usize| {
        let s = i as f32 / steps.max(1) as f32;
        let [r, g, b, a] = function.classify(s);
        let code = |v: f32| (srgb_from_linear(v) * 255.0) as u8;
        (s, Color32::from_rgb(code(r), code(g), code(b)), a)
    };
    let mut before: Option<Pos2> = None;
    for i in 0..=steps {
        let (s, color, a) = sample(i);
        let at = Pos2::new(x(s), y(a));
        painter.vline(at.x, at.y..=area.bottom(), Line::new(1.0, color.gamma_multiply(0.35)));
        painter.vline(at.x, rect.bottom() - 14.0..=rect.bottom() - 6.0, Line::new(1.2, color));
        if let Some(b) = before {
            painter.line_segment([b, at], Line::new(1.5, color));
        }
        before = Some(at);
    }
    // points
    let places: Vec<Pos2> = function.points.iter().map(|p| Pos2::new(x(p.at), y(p.opacity))).collect();
    let nearest = |at: Pos2| {
        let near = places.iter().enumerate().map(|(i, p)| (p.distance(at), i));
        near.filter(|(d, _)| *d < 10.0).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, i)| i)
    };
    let press = ui.input(|i| i.pointer.press_origin());
    if response.drag_started()
        && let Some(at) = press
    {
        m.panels.point = nearest(at);
    }
    if response.clicked()
        && let Some(at) = response.interact_pointer_pos()
    {
        m.panels.point = nearest(at);
    }
    if response.double_clicked()
        && let Some(at) = response.interact_pointer_pos()
        && nearest(at).is_none()
    {
        let s = ((at.x - area.left()) / area.width()).clamp(0.0, 1.0);
        let [r, g, b, _] = function.classify(s);
        let color = [r, g, b].map(|v| srgb_from_linear(v).clamp(0.0, 1.0));
        let o = opacity((area.bottom() - at.y) / area.height());
        let i = function.points.partition_point(|p| p.at <= s);
        function.points.insert(i, ControlPoint { at: s, color, opacity: o });
        m.panels.point = Some(i);
    } else if response.secondary_clicked()
        && function.points.len() > 1
        && let Some(i) = response.interact_pointer_pos().and_then(nearest)
    {
        function.points.remove(i);
        m.panels.point = None;
    } else if response.dragged()
        && let (Some(i), Some(at)) = (m.panels.point, response.interact_pointer_pos())
        && i < function.points.len()
    {
        let least = if i > 0 { function.points[i - 1].at } else { 0.0 };
        let most = function.points.get(i + 1).map_or(1.0, |p| p.at);
        let p = &mut function.points[i];
        p.at = ((at.x - area.left()) / area.width()).clamp(least, most);
        p.opacity = opacity((area.bottom() - at.y) / area.height());
    }
    for (i, p) in function.points.iter().enumerate() {
        let at = Pos2::new(x(p.at), y(p.opacity));
        let [r, g, b] = p.color.map(|c| (c * 255.0) as u8);
        let taken = m.panels.point == Some(i);
        let line = Line::new(if taken { 2.0 } else { 1.0 }, if taken { theme::ACCENT } else { Color32::WHITE });
        painter.circle(at, if taken { 5.5 } else { 4.5 }, Color32::from_rgb(r, g, b), line);
    }
    if response.drag_stopped()
        && let Some(desk) = &mut m.desk
    {
        desk.history.close_step();
    }
}

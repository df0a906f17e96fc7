//! Three sections along the volume's axes, with one cursor.

use eframe::egui::{self, Color32, ColorImage, Pos2, Rect, Sense, Stroke as Line, TextureOptions, Vec2};

use super::modeller::Modeller;
use super::{heat, theme};

const NAMES: [&str; 3] = ["across i", "across j", "across k"];

pub fn show(m: &mut Modeller, ui: &mut egui::Ui) {
    colour(m, ui.ctx());
    let Some(sections) = m.sections.take() else {
        ui.centered_and_justified(|ui| ui.label(egui::RichText::new("Preparing slices…").weak()));
        return;
    };
    let area = ui.available_rect_before_wrap();
    ui.allocate_rect(area, Sense::hover());
    ui.painter().rect_filled(area, 0.0, ui.visuals().extreme_bg_color);
    // side by side where there is width, else below each other
    let wide = area.width() > area.height();
    for (axis, (section, _)) in sections.planes.iter().enumerate() {
        let cell = if wide {
            let w = area.width() / 3.0;
            Rect::from_min_size(area.min + Vec2::new(w * axis as f32, 0.0), Vec2::new(w, area.height()))
        } else {
            let h = area.height() / 3.0;
            Rect::from_min_size(area.min + Vec2::new(0.0, h * axis as f32), Vec2::new(area.width(), h))
        }
        .shrink(4.0);
        let [w, h] = section.size.map(|n| n as f32);
        let scale = (cell.width() / w).min(cell.height() / h).max(0.01);
        let rect = Rect::from_center_size(cell.center(), Vec2::new(w, h) * scale);
        let response = ui.interact(rect, ui.scope_id().with(("section", axis)), Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, format!("Slice {}", NAMES[axis])));
        let painter = ui.painter_at(cell);
        if let Some(texture) = &m.textures.sections[axis] {
            let all = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
            painter.image(texture.id(), rect, all, Color32::WHITE);
        }
        let place = |[x, y]: [f64; 2]| rect.min + Vec2::new((x as f32 + 0.5) * scale, (y as f32 + 0.5) * scale);
        let cross = place(section.pixel(m.view.cursor));
        let [a, b] = [[1, 2], [0, 2], [0, 1]][axis];
        painter.vline(cross.x, rect.y_range(), Line::new(1.0, theme::AXES[a].gamma_multiply(0.7)));
        painter.hline(rect.x_range(), cross.y, Line::new(1.0, theme::AXES[b].gamma_multiply(0.7)));
        painter.text(
            cell.left_top() + Vec2::new(6.0, 4.0),
            egui::Align2::LEFT_TOP,
            NAMES[axis],
            egui::FontId::proportional(11.0),
            theme::AXES[axis],
        );
        let at = response.interact_pointer_pos().or(response.hover_pos());
        let Some(at) = at else { continue };
        let pixel = [f64::from((at.x - rect.min.x) / scale) - 0.5, f64::from((at.y - rect.min.y) / scale) - 0.5];
        let point = section.point(pixel);
        if response.dragged_by(egui::PointerButton::Secondary) {
            // as in every viewer of scans: across the contrast, along the brightness
            let d = ui.input(|i| i.pointer.delta());
            let [lo, hi] = m.view.window;
            let span = (hi - lo).abs().max(1e-12);
            let (mid, width) = (0.5 * (lo + hi) - f64::from(d.y) * span * 0.005, span * (1.0 + f64::from(d.x) * 0.005));
            m.view.window = [mid - 0.5 * width, mid + 0.5 * width];
        } else if response.clicked() || response.dragged_by(egui::PointerButton::Primary) {
            m.view.cursor = point;
        }
        if let Some(desk) = &m.desk
            && let Some((_, object)) = &desk.object
        {
            m.hover = crate::evaluate::pick::Probe::new(object).at(point);
        }
    }
    m.sections = Some(sections);
}

/// Greys for the window, made again when it or the sections change.
fn colour(m: &mut Modeller, ctx: &egui::Context) {
    let Some(sections) = &m.sections else { return };
    if m.textures.window == m.view.window {
        return;
    }
    let [lo, hi] = m.view.window.map(|v| v as f32);
    let scale = 255.0 / (hi - lo).max(f32::MIN_POSITIVE);
    for (axis, (section, values)) in sections.planes.iter().enumerate() {
        let grey = |v: &f32| {
            if v.is_nan() {
                Color32::TRANSPARENT
            } else {
                Color32::from_gray(((v - lo) * scale).clamp(0.0, 255.0) as u8)
            }
        };
        let pixels = match &sections.growth {
            None => values.iter().map(grey).collect(),
            Some(growth) => values.iter().zip(&growth[axis]).map(|(v, g)| tinted(grey(v), *g)).collect(),
        };
        let image = ColorImage::new(section.size, pixels);
        match &mut m.textures.sections[axis] {
            Some(texture) => texture.set(image, TextureOptions::LINEAR),
            slot => *slot = Some(ctx.load_texture(NAMES[axis], image, TextureOptions::LINEAR)),
        }
    }
    m.textures.window = m.view.window;
}

/// The grey with the colour of its growth over it.
fn tinted(grey: Color32, growth: f32) -> Color32 {
    if grey == Color32::TRANSPARENT { grey } else { grey.lerp_to_gamma(heat::color(growth), heat::weight(growth)) }
}

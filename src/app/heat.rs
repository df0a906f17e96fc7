//! Overlays of growth: on the visible surface, on the tetrahedra, and the scale beside them.

use eframe::egui::{self, Align2, Color32, FontId, Painter, Pos2, Rect, Stroke as Line, Vec2};
use glam::DVec3;

use super::modeller::Modeller;
use super::navigate::Projector;
use super::overlay::shadowed;
use super::view::Scene;
use crate::compare::colormap::diverging;
use crate::evaluate::heat::{HeatSurface, TetLayer};

/// Where space is folded: in no scale of growth.
pub const FOLDED: Color32 = Color32::from_rgb(255, 54, 196);
/// More edges than this are not drawn in one pass: it would take too long, and they would only be a blot.
const MOST_EDGES: usize = 16_000;

/// -1 to 1: from half the volume to twice as much.
fn place(growth: f32) -> f32 {
    growth.log2().clamp(-1.0, 1.0)
}

/// The colour of a growth, without regard to how much of it is seen.
pub fn color(growth: f32) -> Color32 {
    if growth <= 0.0 || !growth.is_finite() {
        return FOLDED;
    }
    let [r, g, b] = diverging(f64::from(place(growth)));
    Color32::from_rgb(r, g, b)
}

/// How much of the colour lies over what is as it was: nothing, so that a picture without growth stays itself.
pub fn weight(growth: f32) -> f32 {
    if growth <= 0.0 || !growth.is_finite() { 0.85 } else { (1.3 * place(growth).abs()).min(0.8) }
}

pub fn show(m: &Modeller, ui: &egui::Ui, rect: Rect, scene: &Scene) {
    if !m.view.overlays || !(m.view.heat || m.view.tets) {
        return;
    }
    let painter = ui.painter_at(rect);
    let projector = Projector::new(&scene.camera, rect);
    if let (Some(surface), true) = (&m.panels.heat, m.view.heat) {
        painter.add(mesh(surface, &projector));
    }
    let layer = m.panels.tets.as_ref().filter(|_| m.view.tets);
    if let Some(layer) = layer {
        edges(&painter, &projector, layer, m.view.heat);
    }
    let waiting = (m.view.heat && m.panels.heat.is_none()) || (m.view.tets && m.panels.tets.is_none());
    legend(&painter, rect, m.view.heat, layer.map(std::convert::AsRef::as_ref), waiting);
}

/// The surface as it lies on the screen now; what has turned away from the eye since is left out.
fn mesh(surface: &HeatSurface, projector: &Projector) -> egui::Mesh {
    let mut mesh = egui::Mesh::default();
    mesh.vertices.reserve(surface.points.len());
    let mut seen = Vec::with_capacity(surface.points.len());
    for (p, growth) in surface.points.iter().zip(&surface.growth) {
        let at = projector.project(*p);
        seen.push(at);
        mesh.colored_vertex(at.unwrap_or_default(), color(*growth).gamma_multiply(weight(*growth)));
    }
    for t in &surface.triangles {
        let [a, b, c] = t.map(|i| seen[i as usize]);
        if let (Some(a), Some(b), Some(c)) = (a, b, c) {
            let (ab, ac) = (b - a, c - a);
            // y runs down
            if ab.x * ac.y - ab.y * ac.x < 0.0 {
                mesh.add_triangle(t[0], t[1], t[2]);
            }
        }
    }
    mesh
}

fn edges(painter: &Painter, projector: &Projector, layer: &TetLayer, coloured: bool) {
    for ([a, b], growth) in layer.edges.iter().take(MOST_EDGES) {
        let color = if coloured || *growth <= 0.0 { color(*growth) } else { Color32::from_white_alpha(110) };
        let ends: [Option<Pos2>; 2] = [*a, *b].map(|p: DVec3| projector.project(p));
        if let [Some(a), Some(b)] = ends {
            painter.line_segment([a, b], Line::new(if *growth <= 0.0 { 1.6 } else { 0.7 }, color));
        }
    }
}

/// What the colours mean, at the bottom.
fn legend(painter: &Painter, rect: Rect, heat: bool, layer: Option<&TetLayer>, waiting: bool) {
    let bar = Rect::from_center_size(Pos2::new(rect.center().x, rect.bottom() - 34.0), Vec2::new(200.0, 10.0));
    let font = FontId::proportional(11.0);
    let white = Color32::from_white_alpha(220);
    let mut line = String::new();
    if let Some(layer) = layer {
        line = format!("{} tetrahedra", layer.tets);
        if layer.edges.len() > MOST_EDGES {
            line.push_str(&format!(", {} of {} edges of this layer", MOST_EDGES, layer.edges.len()));
        }
        if layer.folded > 0 {
            line.push_str(&format!(", {} folded", layer.folded));
        }
    }
    if waiting {
        line = "Measuring…".to_owned();
    }
    if !line.is_empty() {
        let at = if heat { bar.center_top() - Vec2::new(0.0, 20.0) } else { bar.center() };
        shadowed(painter, at, Align2::CENTER_BOTTOM, &line);
    }
    if !heat {
        return;
    }
    let ground = Rect::from_min_max(bar.min - Vec2::new(22.0, 16.0), bar.max + Vec2::new(76.0, 16.0));
    painter.rect_filled(ground, 4.0, Color32::from_black_alpha(150));
    let steps = 50;
    for i in 0..steps {
        let t = i as f32 / steps as f32;
        let x = bar.left() + t * bar.width();
        let cell =
            Rect::from_min_max(Pos2::new(x, bar.top()), Pos2::new(x + bar.width() / steps as f32 + 0.5, bar.bottom()));
        painter.rect_filled(cell, 0.0, color((2.0 * (t + 0.5 / steps as f32) - 1.0).exp2()));
    }
    for (text, t) in [("x 0.5", 0.0), ("0.7", 0.25), ("1", 0.5), ("1.4", 0.75), ("x 2", 1.0)] {
        let at = Pos2::new(bar.left() + t * bar.width(), bar.bottom() + 2.0);
        painter.text(at, Align2::CENTER_TOP, text, font.clone(), white);
    }
    painter.text(
        bar.center_top() - Vec2::new(0.0, 1.0),
        Align2::CENTER_BOTTOM,
        "Volume of material",
        font.clone(),
        white,
    );
    let swatch = Rect::from_min_size(bar.right_top() + Vec2::new(20.0, 0.0), Vec2::splat(10.0));
    painter.rect_filled(swatch, 0.0, FOLDED);
    painter.text(swatch.right_center() + Vec2::new(5.0, 0.0), Align2::LEFT_CENTER, "folded", font, white);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_not_grown_keeps_its_picture() {
        assert_eq!(weight(1.0), 0.0);
        assert!(weight(2.0) > 0.7 && (weight(0.5) - weight(2.0)).abs() < 1e-6);
        for folded in [0.0, -2.0, f32::NAN, f32::NEG_INFINITY] {
            assert_eq!(color(folded), FOLDED);
        }
        assert_eq!(color(16.0), color(2.0));
        assert!(color(0.6) != color(1.6));
    }
}

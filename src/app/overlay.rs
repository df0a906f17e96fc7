//! What lies over the picture: brush, arrow, boxes, wireframes, handles, gizmos.

use eframe::egui::{self, Align2, Color32, FontId, Painter, Pos2, Rect, Stroke as Line, Vec2};
use glam::DVec3;

use super::modeller::Modeller;
use super::navigate::{Projector, Standard};
use super::state::Doing;
use super::theme;
use super::view::{Scene, lattice};
use super::worker::Other;
use crate::compare::picture::Scale;
use crate::evaluate::picture::Mode;
use crate::math::OrientedBox;
use crate::math::PlaneFrame;

/// Radius of the axis gizmo, and its distance from the corner.
const GIZMO: f32 = 36.0;
const MARGIN: f32 = 20.0;
/// More edges than this are not drawn: they would only be a blot.
const MOST_EDGES: usize = 30_000;

pub fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::Slicing => "Slicing",
        Mode::SlicingExact => "Exact",
        Mode::Tets => "Tets",
        Mode::Spline => "Surface",
    }
}

pub fn other_name(other: Other) -> &'static str {
    match other {
        Other::Original => "Original",
        Other::Mode(mode) => mode_name(mode),
    }
}

pub fn show(m: &Modeller, ui: &egui::Ui, rect: Rect, scene: &Scene, hovered: bool) {
    let painter = ui.painter_at(rect);
    let projector = Projector::new(&scene.camera, rect);
    let Some(desk) = &m.desk else { return };
    if m.view.overlays {
        if m.view.proxy {
            mesh(&painter, &projector, scene, Color32::from_white_alpha(40));
        }
        if m.view.boxes {
            let selected = m.panels.selected;
            for (i, item) in desk.shown().stack.items.iter().enumerate().filter(|(_, i)| i.enabled) {
                let color = if Some(i) == selected { theme::ACCENT } else { continue };
                cuboid(&painter, &projector, &item.deformer.support(), Line::new(1.0, color.gamma_multiply(0.7)));
            }
        }
        if let Some(edges) = &m.panels.tessellation
            && m.view.tessellation
        {
            for [a, b] in edges {
                segment(
                    &painter,
                    &projector,
                    *a,
                    *b,
                    Line::new(0.7, Color32::from_rgba_unmultiplied(232, 163, 61, 150)),
                );
            }
        }
        if m.hand.tool == super::sculpt::Tool::Lattice {
            handles(m, &painter, &projector);
        }
        measure(m, &painter, &projector, desk.unit());
    }
    if let Doing::Stroke { stroke, made } = &m.doing {
        for item in &made.items {
            let support = item.deformer.support();
            cuboid(&painter, &projector, &support, Line::new(1.0, Color32::from_white_alpha(36)));
        }
        ring(&painter, &projector, stroke.hit.point, stroke.hit.normal, m.hand.radius, Color32::from_white_alpha(70));
        if let (Some((from, to)), true) = (made.arrow, made.asked > 0.0) {
            // what was held back, in the colour of errors
            let asked = from + (to - from) * (made.asked / made.kept.max(1e-12));
            if made.asked > made.kept * 1.001 {
                segment(&painter, &projector, to, asked, Line::new(2.0, theme::ERROR));
            }
            if let (Some(a), Some(b)) = (projector.project(from), projector.project(to)) {
                if (b - a).length() > 2.0 {
                    painter.arrow(a, b - a, Line::new(2.0, theme::ACCENT));
                }
                // beyond the tip, where it hides nothing of the arrow
                let text = format!("{:.1} {}", made.kept, desk.unit());
                let way = if (b - a).length() > 2.0 { (b - a).normalized() } else { Vec2::UP };
                let left = if way.x < 0.0 { Align2::RIGHT_CENTER } else { Align2::LEFT_CENTER };
                shadowed(&painter, b + way * 14.0, left, &text);
            }
        }
    } else if let (Some(hit), true) = (
        m.hover,
        hovered
            && m.hand.tool.is_brush()
            && matches!(m.doing, Doing::Nothing | Doing::Smooth { .. } | Doing::Radius { .. } | Doing::Strength { .. }),
    ) {
        ring(&painter, &projector, hit.point, hit.normal, m.hand.radius, Color32::from_white_alpha(220));
        let inner = m.hand.radius * m.hand.strength * 0.6;
        ring(&painter, &projector, hit.point, hit.normal, inner, theme::ACCENT.gamma_multiply(0.8));
        if let Some(p) = projector.project(hit.point) {
            painter.circle_filled(p, 2.0, Color32::WHITE);
        }
        for (on, axis) in m.hand.mirror.iter().zip([DVec3::X, DVec3::Y, DVec3::Z]) {
            if *on {
                let c = scene.object.volume.grid.center();
                let flip = |v: DVec3| v - 2.0 * v.dot(axis) * axis;
                let point = c + flip(hit.point - c);
                ring(&painter, &projector, point, flip(hit.normal), m.hand.radius, Color32::from_white_alpha(70));
            }
        }
    }
}

/// Text that can be read on any ground.
pub fn shadowed(painter: &Painter, at: Pos2, align: Align2, text: &str) {
    let font = FontId::monospace(12.0);
    let galley = painter.layout_no_wrap(text.to_owned(), font, Color32::WHITE);
    let rect = align.anchor_size(at, galley.size()).expand2(Vec2::new(6.0, 3.0));
    painter.rect_filled(rect, 4.0, Color32::from_black_alpha(150));
    painter.galley(rect.min + Vec2::new(6.0, 3.0), galley, Color32::WHITE);
}

pub fn segment(painter: &Painter, projector: &Projector, a: DVec3, b: DVec3, line: Line) {
    if let (Some(a), Some(b)) = (projector.project(a), projector.project(b)) {
        painter.line_segment([a, b], line);
    }
}

pub fn ring(painter: &Painter, projector: &Projector, at: DVec3, normal: DVec3, radius: f64, color: Color32) {
    let Some(frame) = PlaneFrame::across(normal) else { return };
    let points: Vec<Pos2> = (0..=64)
        .filter_map(|i| {
            let (s, c) = (f64::from(i) / 64.0 * std::f64::consts::TAU).sin_cos();
            projector.project(at + (frame.e1 * c + frame.e2 * s) * radius)
        })
        .collect();
    // a shadow, as the ground may be as bright as the line
    painter.line(points.clone(), Line::new(3.0, Color32::from_black_alpha(color.a() / 3)));
    painter.line(points, Line::new(1.5, color));
}

fn cuboid(painter: &Painter, projector: &Projector, b: &OrientedBox, line: Line) {
    let corners = b.corners();
    for i in 0..8usize {
        for bit in 0..3 {
            let j = i ^ (1 << bit);
            if i < j {
                segment(painter, projector, corners[i], corners[j], line);
            }
        }
    }
}

pub fn mesh(painter: &Painter, projector: &Projector, scene: &Scene, color: Color32) {
    let mesh = &scene.object.mesh;
    if mesh.triangles.len() * 3 / 2 > MOST_EDGES {
        return;
    }
    let at: Vec<Option<Pos2>> = mesh.positions.iter().map(|p| projector.project(*p)).collect();
    let line = Line::new(0.7, color);
    for t in &mesh.triangles {
        for k in 0..3 {
            let (i, j) = (t[k] as usize, t[(k + 1) % 3] as usize);
            // each edge once
            if i < j
                && let (Some(a), Some(b)) = (at[i], at[j])
            {
                painter.line_segment([a, b], line);
            }
        }
    }
}

fn handles(m: &Modeller, painter: &Painter, projector: &Projector) {
    let Some((_, lattice)) = lattice(m) else { return };
    let [nx, ny, nz] = lattice.dims();
    let places: Vec<Option<Pos2>> =
        lattice.indices().zip(lattice.handles()).map(|(i, v)| projector.project(lattice.place(i) + *v)).collect();
    let id = |i: usize, j: usize, k: usize| (k * ny + j) * nx + i;
    let line = Line::new(1.0, Color32::from_white_alpha(46));
    for [i, j, k] in lattice.indices() {
        let next = [
            (i + 1 < nx).then(|| id(i + 1, j, k)),
            (j + 1 < ny).then(|| id(i, j + 1, k)),
            (k + 1 < nz).then(|| id(i, j, k + 1)),
        ];
        for n in next.into_iter().flatten() {
            if let (Some(a), Some(b)) = (places[id(i, j, k)], places[n]) {
                painter.line_segment([a, b], line);
            }
        }
    }
    for (n, p) in places.iter().enumerate() {
        let Some(p) = p else { continue };
        let held = matches!(m.doing, Doing::Handle { handle, .. } if handle == n);
        let color = if held { theme::ACCENT } else { Color32::from_white_alpha(200) };
        painter.circle(*p, if held { 5.0 } else { 3.5 }, color, Line::new(1.0, Color32::from_black_alpha(160)));
    }
}

fn measure(m: &Modeller, painter: &Painter, projector: &Projector, unit: &str) {
    let at: Vec<Pos2> = m.measure.iter().filter_map(|p| projector.project(*p)).collect();
    for p in &at {
        painter.circle(*p, 3.5, theme::ACCENT, Line::new(1.0, Color32::BLACK));
    }
    if let ([a, b], [p, q]) = (&at[..], &m.measure[..]) {
        painter.line_segment([*a, *b], Line::new(1.5, theme::ACCENT));
        let text = format!("{:.2} {unit}", (*p - *q).length());
        shadowed(painter, *a + (*b - *a) * 0.5 + Vec2::new(8.0, -8.0), Align2::LEFT_BOTTOM, &text);
    }
}

fn gizmo_center(rect: Rect) -> Pos2 {
    rect.right_bottom() - Vec2::splat(MARGIN + GIZMO)
}

/// Screen direction of a view axis and how near it is to the eye.
fn seen(scene: &Scene, axis: DVec3) -> (Vec2, f64) {
    let axes = scene.camera.axes();
    (Vec2::new(axis.dot(axes.x_axis) as f32, -axis.dot(axes.y_axis) as f32), axis.dot(axes.z_axis))
}

pub fn axes(m: &Modeller, ui: &egui::Ui, rect: Rect, scene: &Scene) {
    if !m.view.overlays {
        return;
    }
    let painter = ui.painter_at(rect);
    let center = gizmo_center(rect);
    let mut ends: Vec<(f64, Vec2, usize, bool)> = Vec::new();
    for (i, axis) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
        for positive in [true, false] {
            let (at, depth) = seen(scene, if positive { axis } else { -axis });
            ends.push((depth, at, i, positive));
        }
    }
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, at, i, positive) in ends {
        let end = center + at * GIZMO;
        if positive {
            painter.line_segment([center, end], Line::new(2.0, theme::AXES[i]));
            painter.circle_filled(end, 8.0, theme::AXES[i]);
            painter.text(end, Align2::CENTER_CENTER, ["X", "Y", "Z"][i], FontId::proportional(10.0), Color32::BLACK);
        } else {
            painter.circle(end, 5.0, Color32::from_black_alpha(90), Line::new(1.2, theme::AXES[i].gamma_multiply(0.7)));
        }
    }
}

/// The standard view of the gizmo's end under the pointer.
pub fn axis_at(scene: &Scene, rect: Rect, at: Pos2) -> Option<Standard> {
    let center = gizmo_center(rect);
    if center.distance(at) > GIZMO + 10.0 {
        return None;
    }
    // the front of the data is turned for files that say which way a patient looks
    let turned = scene.camera.yaw - scene.spec.yaw;
    let front = DVec3::new(turned.to_radians().sin(), -turned.to_radians().cos(), 0.0);
    let right = DVec3::new(turned.to_radians().cos(), turned.to_radians().sin(), 0.0);
    let ends = [
        (front, Standard::Front),
        (-front, Standard::Back),
        (right, Standard::Right),
        (-right, Standard::Left),
        (DVec3::Z, Standard::Top),
        (DVec3::NEG_Z, Standard::Bottom),
    ];
    let near = ends.into_iter().filter_map(|(axis, standard)| {
        let (p, depth) = seen(scene, axis);
        (at.distance(center + p * GIZMO) < 10.0).then_some((depth, standard))
    });
    near.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, s)| s)
}

/// The colours of a difference picture and their numbers.
pub fn difference_scale(painter: &Painter, rect: Rect, scale: Scale) {
    let bar = Rect::from_min_size(rect.left_bottom() + Vec2::new(12.0, -40.0), Vec2::new(220.0, 10.0));
    let steps = 64;
    for i in 0..steps {
        let t = i as f32 / steps as f32;
        // the scale is logarithmic
        let v = ((f64::from(scale.top()) + 1.0).powf(f64::from(t)) - 1.0).round() as u8;
        let [r, g, b, _] = scale.color(v);
        let x = bar.left() + t * bar.width();
        let cell =
            Rect::from_min_max(Pos2::new(x, bar.top()), Pos2::new(x + bar.width() / steps as f32 + 0.5, bar.bottom()));
        painter.rect_filled(cell, 0.0, Color32::from_rgb(r, g, b));
    }
    painter.rect_stroke(bar, 0.0, Line::new(1.0, Color32::from_white_alpha(120)), egui::StrokeKind::Outside);
    for (v, t) in scale.ticks() {
        let at = Pos2::new(bar.left() + t as f32 * bar.width(), bar.bottom() + 3.0);
        painter.text(at, Align2::CENTER_TOP, v.to_string(), FontId::monospace(10.0), Color32::WHITE);
    }
}

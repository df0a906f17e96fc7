//! The gizmo of the selected deformation in the main view: handles that are drawn, named and dragged.

use std::sync::Arc;

use eframe::egui::{self, Align2, Color32, Painter, PointerButton, Pos2, Rect, Sense, Stroke as Line, Vec2};
use glam::DVec3;

use super::gizmo::{self, Grip, Handle};
use super::modeller::Modeller;
use super::navigate::{Projector, world_per_point};
use super::sculpt::Tool;
use super::state::Doing;
use super::view::{self, Scene};
use super::{cube, overlay, theme};
use crate::deform::{Deformation, Deformer, Limit};
use crate::scene::Edit;

/// A handle under way.
#[derive(Debug, Clone)]
pub struct GripDrag {
    pub item: usize,
    pub handle: Handle,
    pub start: Deformation,
    pub last: Deformation,
    /// World units of a point where the handle was.
    pub scale: f64,
    pub drag: Vec2,
    /// World units as asked for and as kept, where it would fold.
    pub held: Option<[f64; 2]>,
}

/// The deformation whose handles are shown, with its index.
fn selected(m: &Modeller) -> Option<(usize, Deformation)> {
    let i = m.panels.selected.filter(|_| m.view.overlays && m.view.boxes)?;
    let item = m.desk.as_ref()?.shown().stack.items.get(i)?;
    // the lattice tool shows handles of its own
    let own = m.hand.tool == Tool::Lattice && matches!(item.deformer, Deformer::Lattice(_));
    (item.enabled && !own && !matches!(m.doing, Doing::Stroke { .. })).then(|| (i, item.clone()))
}

pub fn show(m: &mut Modeller, ui: &egui::Ui, rect: Rect, scene: &Scene) {
    let Some((i, item)) = selected(m) else { return };
    let painter = ui.painter_at(rect);
    let projector = Projector::new(&scene.camera, rect);
    let unit = m.desk.as_ref().map_or("units", |d| d.unit());
    let handles = gizmo::handles(&item.deformer, &scene.camera);
    let covered = m.view.cube.then(|| cube::inset(m, rect));
    let name = if item.name.is_empty() { format!("stroke {}", i + 1) } else { item.name.clone() };
    lines(&painter, &projector, scene, &item.deformer, &handles);
    for handle in handles {
        let Some(at) = projector.project(handle.at) else { continue };
        // an axis that points at the eye cannot be dragged along
        let seen = handle.along.map(|a| shown(scene, a).length());
        if covered.is_some_and(|c| c.contains(at)) || !rect.shrink(4.0).contains(at) || seen.is_some_and(|l| l < 0.12) {
            continue;
        }
        let id = ui.scope_id().with(("grip", i, handle.grip));
        let response = ui.interact(Rect::from_center_size(at, Vec2::splat(18.0)), id, Sense::drag());
        let label = format!("{} of {name}", handle.grip.name());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, true, &label));
        follow(m, ui, rect, scene, &response, i, handle);
        let held = matches!(&m.doing, Doing::Grip(g) if g.handle.grip == handle.grip);
        draw(&painter, at, handle.grip, held || response.hovered());
        if held {
            let text = gizmo::reading(&item.deformer, handle.grip, unit);
            if !text.is_empty() {
                overlay::shadowed(&painter, at + Vec2::new(12.0, -10.0), Align2::LEFT_BOTTOM, &text);
            }
        } else if matches!(m.doing, Doing::Nothing) {
            let reading = gizmo::reading(&item.deformer, handle.grip, unit);
            response
                .on_hover_cursor(egui::CursorIcon::Grab)
                .on_hover_text(format!("{label}  {reading}\n{}", handle.grip.hint()));
        }
    }
}

/// What the pointer does with one handle.
fn follow(
    m: &mut Modeller,
    ui: &egui::Ui,
    rect: Rect,
    scene: &Scene,
    response: &egui::Response,
    item: usize,
    handle: Handle,
) {
    let (modifiers, delta) = ui.input(|i| (i.modifiers, i.pointer.delta()));
    if response.drag_started() {
        let free = response.drag_started_by(PointerButton::Primary) && !modifiers.alt;
        let start = m.desk.as_ref().and_then(|d| d.history.document().stack.items.get(item)).cloned();
        m.doing = match start {
            Some(start) if free => Doing::Grip(Box::new(GripDrag {
                item,
                handle,
                last: start.clone(),
                start,
                scale: world_per_point(&scene.camera, rect, handle.at),
                drag: Vec2::ZERO,
                held: None,
            })),
            // a handle is no obstacle for who only wants to look from elsewhere
            _ if modifiers.shift => Doing::Pan,
            _ => Doing::Orbit,
        };
    }
    if response.dragged() && delta != Vec2::ZERO {
        if matches!(m.doing, Doing::Grip(_)) {
            pull(m, scene, delta);
        } else {
            view::drag(m, scene, rect, delta, rect.center(), modifiers);
        }
    }
    if response.drag_stopped() {
        view::end(m);
    }
}

/// Direction on the screen of a direction in the world, with its length.
fn shown(scene: &Scene, direction: DVec3) -> Vec2 {
    let axes = scene.camera.axes();
    Vec2::new(direction.dot(axes.x_axis) as f32, -direction.dot(axes.y_axis) as f32)
}

/// The deformation as the hand has it now is what is seen.
fn pull(m: &mut Modeller, scene: &Scene, delta: Vec2) {
    let Doing::Grip(g) = &mut m.doing else { return };
    let Some(desk) = &mut m.desk else { return };
    g.drag += delta;
    let axes = scene.camera.axes();
    let shift = match g.handle.along {
        Some(along) => {
            // along the line as it is seen
            let seen = shown(scene, along);
            along * (f64::from(g.drag.dot(seen)) / f64::from(seen.length_sq()).max(0.02) * g.scale)
        }
        None => (axes.x_axis * f64::from(g.drag.x) - axes.y_axis * f64::from(g.drag.y)) * g.scale,
    };
    let Some(to) = gizmo::moved(&g.start.deformer, &g.handle, shift, &g.last.deformer) else { return };
    let limit = if desk.history.document().allow_folds { Limit::LetThrough } else { Limit::default() };
    let limited = to.limited(limit);
    g.held = (limited.held_back() > 0.0).then_some([limited.asked, limited.kept]);
    g.last = Deformation { deformer: limited.deformer, ..g.start.clone() };
    let mut document = (**desk.history.document()).clone();
    if let Some(item) = document.stack.items.get_mut(g.item) {
        *item = g.last.clone();
        desk.preview = Some(Arc::new(document));
    }
}

/// The drag is over: one step of the history.
pub fn keep(m: &mut Modeller, grip: &GripDrag) {
    if let Some([asked, kept]) = grip.held {
        let part = 100.0 * (asked - kept) / asked.max(1e-12);
        m.tell(format!("Held back by {part:.0} %: more would fold. Widen it, or let strokes fold."), false);
    }
    if grip.last != grip.start {
        m.edit(Edit::Replace(grip.item, grip.last.clone()));
    }
}

/// What joins the handles.
fn lines(painter: &Painter, projector: &Projector, scene: &Scene, deformer: &Deformer, handles: &[Handle]) {
    let accent = theme::ACCENT;
    let faint = Line::new(1.0, accent.gamma_multiply(0.6));
    let place = |grip: Grip| handles.iter().find(|h| h.grip == grip).map(|h| h.at);
    let ball = |center: DVec3, radius: f64| {
        overlay::ring(painter, projector, center, scene.camera.to_eye(), radius, accent.gamma_multiply(0.6));
    };
    match deformer {
        Deformer::Grab(g) => ball(g.displaced(), g.radius()),
        Deformer::Brush(b) => {
            ball(b.center(), b.radius());
            for end in [Grip::Amount, Grip::Angle].into_iter().filter_map(place) {
                overlay::segment(painter, projector, b.center(), end, faint);
            }
        }
        Deformer::Displacement(_) | Deformer::Lattice(_) => {}
    }
    let middle = place(Grip::Tip).or(place(Grip::Point));
    for h in handles {
        if let (Grip::Extent(_), Some(middle)) = (h.grip, middle) {
            overlay::segment(painter, projector, middle, h.at, faint);
        }
    }
    if let (Some(from), Some(to)) = (place(Grip::Point), place(Grip::Tip))
        && let (Some(a), Some(b)) = (projector.project(from), projector.project(to))
        && (b - a).length() > 2.0
    {
        painter.arrow(a, b - a, Line::new(2.0, accent));
    }
}

fn draw(painter: &Painter, at: Pos2, grip: Grip, strong: bool) {
    let dark = Line::new(1.0, Color32::from_black_alpha(180));
    let more = if strong { 2.0 } else { 0.0 };
    match grip {
        Grip::Point => painter.circle(at, 5.0 + more, Color32::WHITE, dark),
        Grip::Tip => painter.circle(at, 5.0 + more, theme::ACCENT, dark),
        Grip::Amount | Grip::Angle => painter.circle(at, 4.5 + more, theme::ACCENT, dark),
        Grip::Extent(_) | Grip::Radius => {
            let square = Rect::from_center_size(at, Vec2::splat(8.0 + 2.0 * more));
            let fill = if strong { theme::ACCENT } else { Color32::from_gray(210) };
            painter.rect(square, 1.0, fill, dark, egui::StrokeKind::Outside)
        }
    };
}

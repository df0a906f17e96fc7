//! Figure 2 of the paper: an inset with the mesh inside the texture cube, and a gizmo that moves, turns and scales it.

use std::sync::Arc;

use eframe::egui::{self, Align2, Color32, FontId, Painter, PointerButton, Pos2, Rect, Sense, Stroke as Line, Vec2};
use glam::DVec3;

use super::modeller::Modeller;
use super::navigate::{Projector, world_per_point};
use super::place::{self, Part};
use super::sculpt::Tool;
use super::state::Doing;
use super::view::{self, Scene};
use super::{overlay, theme};
use crate::math::PlaneFrame;
use crate::render::Camera;
use crate::scene::{Document, Placement};

/// A part under way.
#[derive(Debug, Clone, Copy)]
pub struct Placing {
    pub part: Part,
    pub start: Placement,
    /// Where the hand took it, from the gizmo's middle, in points.
    pub from: Vec2,
    pub drag: Vec2,
    /// World units of a point.
    pub scale: f64,
    /// So far: world units, degrees, or a factor.
    pub by: f64,
}

/// Lengths of the gizmo's parts, in those of its arrows.
const RING: f64 = 0.78;
const BOX: f64 = 0.52;
/// Arrows, as a part of the cube's radius.
const ARROW: f64 = 0.46;
/// Degrees of a step while Ctrl is held.
const STEP: f64 = 15.0;

/// The inset. It is larger while the shape is being placed.
pub fn inset(m: &Modeller, rect: Rect) -> Rect {
    let (part, least, most) = if m.hand.tool == Tool::Place { (0.46, 200.0, 440.0) } else { (0.3, 140.0, 280.0) };
    let side = (part * rect.width().min(rect.height())).clamp(least, most);
    Rect::from_min_size(Pos2::new(rect.left() + 12.0, rect.bottom() - side - 12.0), Vec2::splat(side))
}

/// The camera of the inset: it looks as the main camera does, at the whole texture cube.
fn camera(scene: &Scene) -> Camera {
    let grid = &scene.object.volume.grid;
    let radius = 0.5 * (grid.world_from_voxel.matrix3 * grid.size()).length();
    Camera { target: grid.center(), radius: 1.15 * radius, zoom: 1.0, ..scene.camera }
}

/// The gizmo as it lies on the screen.
struct Gizmo {
    middle: Pos2,
    /// In the world.
    center: DVec3,
    /// World units of a point.
    scale: f64,
    camera: Camera,
    projector: Projector,
    placement: Placement,
}

impl Gizmo {
    fn new(m: &Modeller, scene: &Scene, inset: Rect) -> Option<Self> {
        let placement = m.desk.as_ref()?.shown().placement;
        let camera = camera(scene);
        let projector = Projector::new(&camera, inset);
        let center = scene.object.pivot + placement.translate;
        let middle = projector.project(center)?;
        Some(Self { middle, center, scale: world_per_point(&camera, inset, center), camera, projector, placement })
    }

    fn length(&self) -> f64 {
        ARROW * self.camera.radius
    }

    /// A point of a ring.
    fn ring(&self, k: usize, degrees: f64) -> DVec3 {
        let (s, c) = degrees.to_radians().sin_cos();
        let (u, v) = (place::axis((k + 1) % 3), place::axis((k + 2) % 3));
        self.center + (u * c + v * s) * (RING * self.length())
    }

    /// Where the knob of a part is.
    fn knob(&self, part: Part) -> Option<Pos2> {
        let at = match part {
            Part::Move(k) => self.center + place::axis(k) * self.length(),
            Part::Scale(k) => self.center + self.placement.turn().col(k.min(2)) * (BOX * self.length()),
            Part::ScaleAll => self.center,
            Part::Turn(k) => {
                // in the quarter that is nearest to the eye
                let eye = self.camera.to_eye();
                let toward = |k: usize| eye.dot(place::axis(k % 3)) >= 0.0;
                let degrees = match (toward(k + 1), toward(k + 2)) {
                    (true, true) => 45.0,
                    (false, true) => 135.0,
                    (false, false) => 225.0,
                    (true, false) => 315.0,
                };
                self.ring(k, degrees)
            }
        };
        self.projector.project(at)
    }

    /// What is under the pointer: knobs before lines.
    fn part_at(&self, at: Pos2) -> Option<Part> {
        let near = |part: &Part| self.knob(*part).map(|p| p.distance(at)).filter(|d| *d < 9.0);
        let knob = Part::ALL.iter().rev().filter_map(|p| Some((*p, near(p)?))).min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((part, _)) = knob {
            return Some(part);
        }
        let shaft = |k: usize| {
            let along = self.knob(Part::Move(k))? - self.middle;
            let t = ((at - self.middle).dot(along) / along.length_sq().max(1e-6)).clamp(0.3, 1.05);
            Some((Part::Move(k), (self.middle + along * t).distance(at)))
        };
        let ring = |k: usize| {
            let points = (0..72).filter_map(|i| self.projector.project(self.ring(k, f64::from(i) * 5.0)));
            let d = points.map(|p| p.distance(at)).min_by(f32::total_cmp)?;
            Some((Part::Turn(k), d))
        };
        let lines = (0..3).flat_map(|k| [shaft(k), ring(k)]).flatten();
        lines.filter(|(_, d)| *d < 7.0).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(part, _)| part)
    }

    /// Direction on the screen of a direction in the world, with its length.
    fn seen(&self, direction: DVec3) -> Vec2 {
        let axes = self.camera.axes();
        Vec2::new(direction.dot(axes.x_axis) as f32, -direction.dot(axes.y_axis) as f32)
    }

    /// By how much a part was dragged: world units, degrees, or a factor.
    fn by(&self, p: &Placing) -> f64 {
        match p.part {
            Part::Move(k) => {
                // along the arrow as it is seen
                let seen = self.seen(place::axis(k));
                f64::from(p.drag.dot(seen)) / f64::from(seen.length_sq()).max(0.02) * p.scale
            }
            Part::Turn(k) => self.angle(k, p),
            Part::Scale(k) => {
                let seen = self.seen(p.start.turn().col(k.min(2)));
                let far = BOX * self.length() / p.scale * f64::from(seen.length()).max(0.2);
                1.0 + f64::from(p.drag.dot(seen.normalized())) / far
            }
            // to the right and up is larger
            Part::ScaleAll => (f64::from(p.drag.x - p.drag.y) / 120.0).exp(),
        }
    }

    /// Degrees about an axis, from where the hand took the ring to where it is; it goes on over whole turns.
    fn angle(&self, k: usize, p: &Placing) -> f64 {
        let (axis, view) = (place::axis(k), self.camera.axes());
        let facing = axis.dot(view.z_axis);
        if facing.abs() < 0.2 {
            // seen from its edge: along the ring as it is seen
            let across = self.seen(axis);
            let way = Vec2::new(across.y, -across.x).normalized();
            return f64::from(p.drag.dot(way)) * p.scale / (RING * self.length()) * 180.0 / std::f64::consts::PI;
        }
        let Some(frame) = PlaneFrame::across(axis) else { return 0.0 };
        // the point of the ring's plane that is seen there
        let degrees = |at: Vec2| {
            let flat = view.x_axis * f64::from(at.x) - view.y_axis * f64::from(at.y);
            let q = flat - view.z_axis * (flat.dot(axis) / facing);
            q.dot(frame.e2).atan2(q.dot(frame.e1)).to_degrees()
        };
        let to = degrees(p.from + p.drag) - degrees(p.from);
        to + 360.0 * ((p.by - to) / 360.0).round()
    }
}

/// Draws the inset and takes what the pointer does in it.
pub fn show(m: &mut Modeller, ui: &egui::Ui, rect: Rect, scene: &Scene) {
    if !m.view.cube {
        return;
    }
    let inset = inset(m, rect);
    let response = ui.interact(inset, ui.scope_id().with("texture cube"), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Texture cube"));
    let gizmo = Gizmo::new(m, scene, inset);
    let (modifiers, delta, at) = ui.input(|i| (i.modifiers, i.pointer.delta(), i.pointer.latest_pos()));
    for button in [PointerButton::Primary, PointerButton::Middle] {
        if !response.drag_started_by(button) {
            continue;
        }
        let from = ui.input(|i| i.pointer.press_origin()).or(at).unwrap_or(inset.center());
        let part = gizmo.as_ref().filter(|_| button == PointerButton::Primary && !modifiers.alt);
        m.doing = match part.and_then(|g| Some((g, g.part_at(from)?))) {
            Some((g, part)) => {
                let by = if matches!(part, Part::Scale(_) | Part::ScaleAll) { 1.0 } else { 0.0 };
                let from = from - g.middle;
                Doing::Placing(Placing { part, start: g.placement, from, drag: Vec2::ZERO, scale: g.scale, by })
            }
            None if modifiers.shift => Doing::Pan,
            // elsewhere both views turn together
            None => Doing::Orbit,
        };
    }
    if response.dragged() {
        if let (Doing::Placing(p), Some(g), Some(at)) = (&mut m.doing, &gizmo, at) {
            // from where it was taken, not from where the drag was noticed; the gizmo itself may have moved since
            let moved = ui.input(|i| i.pointer.press_origin()).map_or(Vec2::ZERO, |o| at - o);
            if moved != p.drag {
                p.drag = moved;
                p.by = g.by(p);
                let by = match p.part {
                    Part::Turn(_) if modifiers.command => (p.by / STEP).round() * STEP,
                    _ => p.by,
                };
                let placement = place::dragged(&p.start, p.part, by);
                if let Some(desk) = &mut m.desk {
                    let document = (**desk.history.document()).clone();
                    desk.preview = Some(Arc::new(Document { placement, ..document }));
                }
            }
        } else {
            // as far from the middle as in the main view
            let from_middle = at.map_or(Vec2::ZERO, |at| at - inset.center());
            view::drag(m, scene, rect, delta, rect.center() + from_middle, modifiers);
        }
    }
    if response.drag_stopped() {
        view::end(m);
    }
    let over = at.filter(|_| response.hovered() && matches!(m.doing, Doing::Nothing));
    let held = match &m.doing {
        Doing::Placing(p) => Some(p.part),
        _ => over.and_then(|at| gizmo.as_ref()?.part_at(at)),
    };
    draw(m, ui, inset, scene, gizmo.as_ref(), held);
    // each part has a name, for those who cannot see it
    for part in Part::ALL {
        let Some(at) = gizmo.as_ref().and_then(|g| g.knob(part)) else { continue };
        let id = ui.scope_id().with(("placing", part.name()));
        let response = ui.interact(Rect::from_center_size(at, Vec2::splat(14.0)), id, Sense::hover());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, true, part.name()));
    }
    if let (Some(part), true) = (held, matches!(m.doing, Doing::Nothing)) {
        ui.ctx().set_cursor_icon(egui::CursorIcon::Grab);
        let what = if matches!(part, Part::Turn(_)) { "\nCtrl: in steps of 15°" } else { "" };
        response.on_hover_text_at_pointer(format!("{}{what}", part.name()));
    }
}

fn draw(m: &Modeller, ui: &egui::Ui, inset: Rect, scene: &Scene, gizmo: Option<&Gizmo>, held: Option<Part>) {
    let painter = ui.painter_at(inset);
    let line = Line::new(1.0, Color32::from_white_alpha(30));
    painter.rect(inset, 6.0, Color32::from_black_alpha(120), line, egui::StrokeKind::Inside);
    let projector = Projector::new(&camera(scene), inset);
    let world = scene.object.volume.grid.world_from_texture();
    let corner = |i: usize| {
        let bit = |b: usize| if i >> b & 1 == 1 { 1.0 } else { 0.0 };
        world.transform_point3(DVec3::new(bit(0), bit(1), bit(2)))
    };
    overlay::mesh(&painter, &projector, scene, theme::ACCENT.gamma_multiply(0.4));
    for i in 0..8usize {
        for b in 0..3 {
            let j = i ^ (1 << b);
            if i < j {
                let line = Line::new(1.0, Color32::from_white_alpha(110));
                overlay::segment(&painter, &projector, corner(i), corner(j), line);
            }
        }
    }
    if let Some(gizmo) = gizmo {
        parts(&painter, gizmo, held);
    }
    painter.text(
        inset.left_top() + Vec2::new(8.0, 6.0),
        Align2::LEFT_TOP,
        "Texture cube",
        FontId::proportional(11.0),
        Color32::from_white_alpha(170),
    );
    if let Doing::Placing(p) = &m.doing {
        let unit = m.desk.as_ref().map_or("units", |d| d.unit());
        let text = match p.part {
            Part::Move(_) => format!("{:+.1} {unit}", p.by),
            Part::Turn(_) => format!("{:+.0}°", p.by),
            Part::Scale(_) | Part::ScaleAll => format!("x {:.2}", p.by.max(0.02)),
        };
        overlay::shadowed(&painter, inset.left_bottom() + Vec2::new(8.0, -8.0), Align2::LEFT_BOTTOM, &text);
    }
}

fn parts(painter: &Painter, gizmo: &Gizmo, held: Option<Part>) {
    let eye = gizmo.camera.to_eye();
    for part in Part::ALL {
        let Some(at) = gizmo.knob(part) else { continue };
        let on = held == Some(part);
        let color = part.axis().map_or(Color32::from_gray(220), |k| theme::AXES[k]);
        let width = if on { 3.0 } else { 1.8 };
        let dark = Line::new(1.0, Color32::from_black_alpha(170));
        match part {
            Part::Turn(k) => {
                for i in 0..72 {
                    let [a, b] = [i, i + 1].map(|i| gizmo.ring(k, f64::from(i) * 5.0));
                    let front = (a - gizmo.center).dot(eye) >= 0.0;
                    let shade = if front || on { color } else { color.gamma_multiply(0.3) };
                    overlay::segment(painter, &gizmo.projector, a, b, Line::new(width, shade));
                }
                painter.circle(at, if on { 6.0 } else { 4.5 }, color, dark);
            }
            Part::Move(_) => {
                if (at - gizmo.middle).length() > 4.0 {
                    painter.arrow(gizmo.middle, at - gizmo.middle, Line::new(width, color));
                }
            }
            Part::Scale(_) | Part::ScaleAll => {
                let side = if on { 11.0 } else { 8.0 };
                let square = Rect::from_center_size(at, Vec2::splat(side));
                painter.rect(square, 1.0, color, dark, egui::StrokeKind::Outside);
            }
        }
    }
}

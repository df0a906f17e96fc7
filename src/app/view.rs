//! The main view: the picture, what lies over it, and what the pointer does in it.

use std::sync::Arc;
use std::time::Instant;

use eframe::egui::{self, Color32, CursorIcon, PointerButton, Pos2, Rect, Response, Sense, Stroke as Line, Vec2};
use glam::{DMat3, DVec3};

use super::modeller::Modeller;
use super::navigate::{self, Projector, world_per_point};
use super::sculpt::{Hand, Made, Stroke, Tool, smoothed};
use super::state::{Doing, Layout};
use super::{cube, grips, heat, overlay, theme};
use crate::deform::{Deformation, Deformer, Lattice};
use crate::evaluate::load::Object;
use crate::evaluate::pick::{Hit, Probe, Ray};
use crate::math::OrientedBox;
use crate::render::Camera;
use crate::scene::{CameraSpec, Edit};

/// The object that is seen, and the camera.
pub struct Scene {
    pub object: Arc<Object>,
    pub camera: Camera,
    pub spec: CameraSpec,
}

/// What is on the desk, if it is ready.
pub fn scene(m: &Modeller) -> Option<Scene> {
    let desk = m.desk.as_ref()?;
    let (_, object) = desk.object.as_ref()?;
    let spec = desk.shown().camera;
    Some(Scene { camera: object.camera(&spec), object: object.clone(), spec })
}

pub fn show(m: &mut Modeller, ui: &mut egui::Ui) {
    let rect = ui.available_rect_before_wrap();
    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Main view"));
    let ppp = ui.ctx().pixels_per_point();
    let pixels = |l: f32| ((l * ppp).round() as u32).clamp(1, 4096);
    m.set_picture_size((pixels(rect.width()), pixels(rect.height())));

    ground(ui, rect);
    picture(m, ui, rect);
    let Some(scene) = scene(m) else {
        waiting(m, ui, rect);
        return;
    };
    pointer(m, ui, &response, rect, &scene);
    // the camera may just have moved: what lies over the picture belongs to the picture that is there
    heat::show(m, ui, rect, &scene);
    overlay::show(m, ui, rect, &scene, response.hovered());
    overlay::axes(m, ui, rect, &scene);
    grips::show(m, ui, rect, &scene);
    cube::show(m, ui, rect, &scene);
    menu(m, &response);
}

fn ground(ui: &egui::Ui, rect: Rect) {
    let [top, bottom] = theme::view_ground(ui.visuals().dark_mode)
        .map(|[r, g, b]| Color32::from_rgb((r * 255.0) as u8, (g * 255.0) as u8, (b * 255.0) as u8));
    let mut mesh = egui::Mesh::default();
    for (at, color) in
        [(rect.left_top(), top), (rect.right_top(), top), (rect.right_bottom(), bottom), (rect.left_bottom(), bottom)]
    {
        mesh.colored_vertex(at, color);
    }
    mesh.add_triangle(0, 1, 2);
    mesh.add_triangle(0, 2, 3);
    ui.painter().add(mesh);
}

fn waiting(m: &Modeller, ui: &egui::Ui, rect: Rect) {
    let text = if m.desk.is_some() || !m.tasks.is_empty() {
        "Preparing…"
    } else {
        "Drop a volume here, or open one with Ctrl O"
    };
    ui.painter().text(
        rect.center(),
        egui::Align2::CENTER_CENTER,
        text,
        egui::FontId::proportional(15.0),
        theme::dim(ui),
    );
}

/// The picture, or two of them against each other.
fn picture(m: &Modeller, ui: &egui::Ui, rect: Rect) {
    let Some(main) = &m.textures.main else { return };
    let painter = ui.painter_at(rect);
    let all = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
    let part = |l: f32, r: f32| Rect::from_min_max(Pos2::new(l, 0.0), Pos2::new(r, 1.0));
    let label = |at: Pos2, align: egui::Align2, text: &str| {
        let font = egui::FontId::proportional(12.0);
        painter.text(at + Vec2::splat(1.0), align, text, font.clone(), Color32::from_black_alpha(160));
        painter.text(at, align, text, font, Color32::WHITE);
    };
    let (Some(other), true) = (&m.textures.other, m.view.compare) else {
        painter.image(main.id(), rect, all, Color32::WHITE);
        return;
    };
    let names = (overlay::mode_name(m.view.mode), overlay::other_name(m.view.other));
    match m.view.layout {
        Layout::Wipe => {
            let x = rect.left() + rect.width() * m.view.wipe;
            let (left, right) = (
                Rect::from_min_max(rect.min, Pos2::new(x, rect.bottom())),
                Rect::from_min_max(Pos2::new(x, rect.top()), rect.max),
            );
            painter.image(main.id(), left, part(0.0, m.view.wipe), Color32::WHITE);
            painter.image(other.id(), right, part(m.view.wipe, 1.0), Color32::WHITE);
            painter.vline(x, rect.y_range(), Line::new(1.5, theme::ACCENT));
            painter.circle(Pos2::new(x, rect.center().y), 6.0, theme::ACCENT, Line::new(1.0, Color32::BLACK));
            label(Pos2::new(x - 8.0, rect.top() + 10.0), egui::Align2::RIGHT_TOP, names.0);
            label(Pos2::new(x + 8.0, rect.top() + 10.0), egui::Align2::LEFT_TOP, names.1);
        }
        Layout::SideBySide => {
            let x = rect.center().x;
            let (left, right) = rect.split_left_right_at_x(x);
            painter.image(main.id(), left, part(0.25, 0.75), Color32::WHITE);
            painter.image(other.id(), right, part(0.25, 0.75), Color32::WHITE);
            painter.vline(x, rect.y_range(), Line::new(1.0, Color32::BLACK));
            label(left.left_top() + Vec2::new(12.0, 10.0), egui::Align2::LEFT_TOP, names.0);
            label(right.left_top() + Vec2::new(12.0, 10.0), egui::Align2::LEFT_TOP, names.1);
        }
        Layout::Difference => {
            let Some(difference) = &m.textures.difference else { return };
            painter.image(difference.id(), rect, all, Color32::WHITE);
            label(
                rect.left_top() + Vec2::new(12.0, 10.0),
                egui::Align2::LEFT_TOP,
                &format!("{} against {}", names.0, names.1),
            );
            if let Some(o) = m.shown.as_ref().and_then(|s| s.other.as_ref()) {
                overlay::difference_scale(&painter, rect, o.scale);
            }
        }
    }
}

/// What the pointer does.
fn pointer(m: &mut Modeller, ui: &egui::Ui, response: &Response, rect: Rect, scene: &Scene) {
    let ctx = ui.ctx();
    let (modifiers, delta, at) = ctx.input(|i| (i.modifiers, i.pointer.delta(), i.pointer.latest_pos()));
    let at = at.unwrap_or(rect.center());
    let started = Instant::now();
    // pens report how hard they are pressed as touches
    let force = ctx.input(|i| {
        i.events.iter().rev().find_map(|e| match e {
            egui::Event::Touch { force, .. } => *force,
            _ => None,
        })
    });
    if let Some(force) = force {
        m.pressure = force.clamp(0.05, 1.0);
    } else if !ctx.input(|i| i.pointer.any_down()) {
        m.pressure = 1.0;
    }

    if let Doing::Radius { start, from } = m.doing {
        let scale = m.hover.map_or_else(
            || world_per_point(&scene.camera, rect, scene.camera.target),
            |h| world_per_point(&scene.camera, rect, h.point),
        );
        m.hand.radius = (start + f64::from(at.x - from) * scale).max(0.02 * start).max(1e-6);
        if ctx.input(|i| i.pointer.any_pressed()) {
            m.doing = Doing::Nothing;
        }
        return;
    }
    if let Doing::Strength { start, from } = m.doing {
        m.hand.strength = (start + f64::from(at.x - from) / 200.0).clamp(0.01, 1.0);
        if ctx.input(|i| i.pointer.any_pressed()) {
            m.doing = Doing::Nothing;
        }
        return;
    }

    // wheel: zoom to the pointer, also over handles
    if response.contains_pointer() {
        let scroll = ctx.input(|i| i.smooth_scroll_delta().y);
        let pinch = f64::from(ctx.input(egui::InputState::zoom_delta));
        let factor = (f64::from(scroll) * 0.004).exp() * if scroll == 0.0 { pinch } else { 1.0 };
        if modifiers.ctrl && scroll != 0.0 {
            m.hand.radius = (m.hand.radius * factor).clamp(1e-6, 1e9);
        } else if (factor - 1.0).abs() > 1e-6 {
            let camera = navigate::zoom(&scene.spec, &scene.camera, factor, Some(at - rect.min), rect);
            m.edit(Edit::SetCamera(camera));
        }
    }

    let navigating = |b: PointerButton| b == PointerButton::Middle || (b == PointerButton::Primary && modifiers.alt);
    for button in [PointerButton::Primary, PointerButton::Middle] {
        if !response.drag_started_by(button) {
            continue;
        }
        let from = ctx.input(|i| i.pointer.press_origin()).unwrap_or(at);
        m.doing = if navigating(button) {
            if modifiers.shift { Doing::Pan } else { Doing::Orbit }
        } else {
            begin(m, scene, rect, from, modifiers)
        };
    }
    if response.dragged() {
        drag(m, scene, rect, delta, at, modifiers);
        if matches!(m.doing, Doing::Stroke { .. } | Doing::Smooth { .. }) && delta != Vec2::ZERO {
            m.trace.stroke.add(started.elapsed());
        }
    }
    if response.drag_stopped() {
        end(m);
    }
    if response.clicked() {
        click(m, scene, rect, at);
    }
    if response.hovered() && matches!(m.doing, Doing::Nothing) {
        m.hover = pick(m, scene, rect, at);
        ctx.set_cursor_icon(match (m.hand.tool, m.hover) {
            (t, Some(_)) if t.is_brush() => CursorIcon::None,
            (Tool::Pick | Tool::Measure, Some(_)) => CursorIcon::Crosshair,
            _ => CursorIcon::Default,
        });
    } else if !response.hovered() && matches!(m.doing, Doing::Nothing) {
        m.hover = None;
    }
}

/// The first visible point under the pointer.
pub fn pick(m: &Modeller, scene: &Scene, rect: Rect, at: Pos2) -> Option<Hit> {
    if !rect.contains(at) {
        return None;
    }
    let size = m.picture_size();
    let ray = Ray::through(&scene.camera, size, navigate::pixels(at - rect.min, rect, size));
    let desk = m.desk.as_ref()?;
    let look = desk.shown().look.look(scene.object.iso);
    Probe::new(&scene.object).seeing(&look).first(&ray, look.shading)
}

/// What a drag with the left button is.
fn begin(m: &mut Modeller, scene: &Scene, rect: Rect, from: Pos2, modifiers: egui::Modifiers) -> Doing {
    if m.view.compare && m.view.layout == Layout::Wipe {
        let x = rect.left() + rect.width() * m.view.wipe;
        if (from.x - x).abs() < 8.0 {
            return Doing::Wipe;
        }
    }
    match m.hand.tool {
        Tool::Lattice => {
            if let Some(doing) = handle_at(m, scene, rect, from) {
                return doing;
            }
        }
        Tool::Smooth => {
            if let (Some(desk), Some(_)) = (&m.desk, pick(m, scene, rect, from)) {
                return Doing::Smooth { base: desk.history.document().clone() };
            }
        }
        tool if tool.is_brush() => {
            let ready = |d: &super::desk::Desk| d.mask.as_ref().is_some_and(|k| Some(k.range) == m.hand.mask);
            if m.hand.mask.is_some() && !m.desk.as_ref().is_some_and(ready) {
                m.tell("The mask is being prepared: try again in a moment".to_owned(), false);
                return Doing::Nothing;
            }
            if let Some(hit) = pick(m, scene, rect, from) {
                m.hover = Some(hit);
                let stroke = Stroke {
                    hit,
                    scale: world_per_point(&scene.camera, rect, hit.point),
                    camera: scene.camera,
                    center: scene.object.volume.grid.center(),
                    from,
                    drag: Vec2::ZERO,
                    inverse: modifiers.ctrl || modifiers.command,
                    along: modifiers.shift,
                };
                return Doing::Stroke { stroke: Box::new(stroke), made: Made::default() };
            }
        }
        _ => {}
    }
    // beside the object, the left button turns it
    Doing::Orbit
}

/// A drag in the main view goes on.
pub fn drag(m: &mut Modeller, scene: &Scene, rect: Rect, delta: Vec2, at: Pos2, modifiers: egui::Modifiers) {
    if delta == Vec2::ZERO {
        return;
    }
    let mut doing = std::mem::replace(&mut m.doing, Doing::Nothing);
    match &mut doing {
        Doing::Orbit => m.edit(Edit::SetCamera(navigate::orbit(&scene.spec, m.settings.orbit, at, delta, rect))),
        Doing::Pan => m.edit(Edit::SetCamera(navigate::pan(&scene.spec, &scene.camera, delta, rect))),
        Doing::Wipe => m.view.wipe = ((at.x - rect.left()) / rect.width()).clamp(0.02, 0.98),
        Doing::Stroke { stroke, made } => {
            // from where it took hold, not from where the drag was noticed
            stroke.drag = at - stroke.from;
            stroke.inverse = modifiers.ctrl || modifiers.command;
            stroke.along = modifiers.shift;
            if let Some(desk) = &mut m.desk {
                // numbers that make no deformation leave the last one
                let hand = Hand { strength: m.hand.strength * f64::from(m.pressure), ..m.hand };
                let mask = hand.mask.and(desk.mask.as_deref());
                if let Ok(new) = stroke.make(&hand, desk.history.document(), mask) {
                    *made = new;
                    let mut document = (**desk.history.document()).clone();
                    document.stack.items.extend_from_slice(&made.items);
                    desk.preview = Some(Arc::new(document));
                }
            }
        }
        Doing::Smooth { .. } => {
            if let Some(hit) = pick(m, scene, rect, at) {
                m.hover = Some(hit);
                let (radius, amount) = (m.hand.radius, 0.12 * m.hand.strength * f64::from(m.pressure));
                if let Some(desk) = &mut m.desk
                    && let Some(document) = smoothed(desk.shown(), hit.point, radius, amount)
                {
                    desk.preview = Some(Arc::new(document));
                }
            }
        }
        Doing::Handle { item, handle, start, scale, drag } => {
            *drag += delta;
            let axes = scene.camera.axes();
            let moved = (axes.x_axis * f64::from(drag.x) - axes.y_axis * f64::from(drag.y)) * *scale;
            move_handle(m, *item, *handle, *start + moved);
        }
        Doing::Nothing | Doing::Radius { .. } | Doing::Strength { .. } | Doing::Placing(_) | Doing::Grip(_) => {}
    }
    m.doing = doing;
}

/// The button has gone up: what was done is a step.
pub fn end(m: &mut Modeller) {
    let doing = std::mem::replace(&mut m.doing, Doing::Nothing);
    let preview = m.desk.as_mut().and_then(|d| d.preview.take());
    match doing {
        Doing::Stroke { stroke, made }
            if made.items.is_empty() && m.hand.mask.is_some() && stroke.drag.length() > 4.0 =>
        {
            m.tell("Nothing here has a value within the mask".to_owned(), false);
        }
        Doing::Stroke { made, .. } if !made.items.is_empty() => {
            let back = made.asked - made.kept;
            if back > 1e-3 * made.asked {
                let unit = m.desk.as_ref().map_or("units", |d| d.unit());
                let tool = m.hand.tool;
                let how = if matches!(tool, Tool::Grab | Tool::Push) && m.hand.mask.is_none() {
                    format!("{back:.1} of {:.1} {unit}", made.asked)
                } else {
                    format!("{:.0} %", 100.0 * back / made.asked)
                };
                m.tell(
                    format!("The stroke was held back by {how}: more would fold. A larger radius reaches farther."),
                    false,
                );
            }
            m.edit(Edit::Push(made.items));
        }
        Doing::Smooth { .. } => {
            if let Some(document) = preview {
                m.edit(Edit::ReplaceAll(document.stack.clone()));
            }
        }
        Doing::Handle { .. } => {
            if let Some(document) = preview {
                m.edit(Edit::ReplaceAll(document.stack.clone()));
            }
        }
        Doing::Grip(grip) => grips::keep(m, &grip),
        Doing::Placing(_) => {
            if let Some(document) = preview {
                m.edit(Edit::SetPlacement(document.placement));
            }
        }
        _ => {}
    }
    if let Some(desk) = &mut m.desk {
        desk.history.close_step();
    }
}

fn click(m: &mut Modeller, scene: &Scene, rect: Rect, at: Pos2) {
    if let Some(standard) = overlay::axis_at(scene, rect, at) {
        m.edit(Edit::SetCamera(standard.of(&scene.spec)));
        return;
    }
    let Some(hit) = pick(m, scene, rect, at) else { return };
    match m.hand.tool {
        Tool::Pick => {
            if let Some(desk) = &m.desk {
                let mut look = desk.history.document().look;
                look.shading = crate::scene::ShadingSpec::Iso { value: Some(hit.value) };
                m.edit(Edit::SetLook(look));
                m.tell(format!("Isovalue {:.4}", hit.value), false);
            }
        }
        Tool::Measure => {
            if m.measure.len() >= 2 {
                m.measure.clear();
            }
            m.measure.push(hit.point);
        }
        _ => m.view.cursor = hit.point,
    }
}

/// The small menu of the right button.
fn menu(m: &mut Modeller, response: &Response) {
    response.context_menu(|ui| {
        let mut to = None;
        if ui.button("Frame all").clicked() {
            to = scene(m).map(|s| navigate::frame(&s.spec));
        }
        for standard in navigate::Standard::ALL {
            if ui.button(standard.name()).clicked() {
                to = scene(m).map(|s| standard.of(&s.spec));
            }
        }
        ui.separator();
        if let Some(hit) = m.hover
            && ui.button("Slices through this point").clicked()
        {
            m.view.cursor = hit.point;
            m.wants_pane = Some(super::panels::Pane::Slices);
            ui.close();
        }
        if ui.button("Undo").clicked() {
            m.undo();
            ui.close();
        }
        if let Some(camera) = to {
            m.edit(Edit::SetCamera(camera));
            ui.close();
        }
    });
}

/// A lattice of 4 x 4 x 4 handles over the object, unless the newest deformation is one.
pub fn ensure_lattice(m: &mut Modeller) {
    let Some(scene) = scene(m) else { return };
    let Some(desk) = &m.desk else { return };
    if lattice(m).is_some() {
        return;
    }
    let (center, radius) = scene.object.focus;
    let grid = &scene.object.volume.grid;
    // knots reach two intervals beyond the handles that hold the object
    let axes = DMat3::from_cols(
        grid.world_from_voxel.matrix3.x_axis.normalize(),
        grid.world_from_voxel.matrix3.y_axis.normalize(),
        grid.world_from_voxel.matrix3.z_axis.normalize(),
    );
    let square = (axes.transpose() * axes - DMat3::IDENTITY).to_cols_array().iter().all(|e| e.abs() < 1e-6)
        && axes.determinant() > 0.0;
    let support =
        OrientedBox { center, axes: if square { axes } else { DMat3::IDENTITY }, half: DVec3::splat(radius * 1.15) };
    let name = format!("Lattice {}", desk.history.document().stack.items.len() + 1);
    match Lattice::new(support, [4, 4, 4]) {
        Ok(lattice) => {
            let mut item = Deformation::new(name, Deformer::Lattice(lattice));
            item.moves_shape = true;
            m.edit(Edit::Push(vec![item]));
        }
        Err(e) => m.tell(e.to_string(), true),
    }
}

/// The lattice whose handles are shown: the newest deformation that is one.
pub fn lattice(m: &Modeller) -> Option<(usize, Lattice)> {
    let items = &m.desk.as_ref()?.shown().stack.items;
    let (i, item) =
        items.iter().enumerate().rev().find(|(_, i)| i.enabled && matches!(i.deformer, Deformer::Lattice(_)))?;
    match &item.deformer {
        Deformer::Lattice(l) => Some((i, l.clone())),
        _ => None,
    }
}

fn handle_at(m: &Modeller, scene: &Scene, rect: Rect, at: Pos2) -> Option<Doing> {
    let (item, lattice) = lattice(m)?;
    let projector = Projector::new(&scene.camera, rect);
    let places = lattice.indices().zip(lattice.handles()).map(|(i, v)| (lattice.place(i) + *v, *v));
    let near = places.enumerate().filter_map(|(handle, (p, v))| {
        let d = projector.project(p)?.distance(at);
        let depth = (scene.camera.eye() - p).length();
        (d < 9.0).then_some((handle, p, v, depth))
    });
    let (handle, p, start, _) = near.min_by(|a, b| a.3.total_cmp(&b.3))?;
    let scale = world_per_point(&scene.camera, rect, p);
    Some(Doing::Handle { item, handle, start, scale, drag: Vec2::ZERO })
}

fn move_handle(m: &mut Modeller, item: usize, handle: usize, vector: DVec3) {
    let Some(desk) = &mut m.desk else { return };
    let mut document = (**desk.history.document()).clone();
    let Some(Deformation { deformer: Deformer::Lattice(lattice), .. }) = document.stack.items.get_mut(item) else {
        return;
    };
    let mut handles = lattice.handles().to_vec();
    if let Some(h) = handles.get_mut(handle) {
        *h = vector;
    }
    if let Ok(moved) = lattice.clone().with_handles(handles) {
        *lattice = moved;
        desk.preview = Some(Arc::new(document));
    }
}

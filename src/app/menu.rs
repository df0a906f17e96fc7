//! The bars round the view.

use eframe::egui::{self, Align, Layout as Flow, RichText, Vec2};
use egui_material_icons::{MaterialIcon, icons};

use super::desk::file_name;
use super::modeller::Modeller;
use super::navigate::Orbit;
use super::panels::{self, Pane};
use super::sculpt::Tool;
use super::state::{After, Doing, Question};
use super::theme;
use crate::evaluate::picture::Mode;

/// A button with an icon only; the tooltip is its name.
pub fn icon_button(ui: &mut egui::Ui, icon: MaterialIcon, name: &str, enabled: bool) -> bool {
    let button = egui::Button::new(icon.rich_text().size(18.0)).min_size(Vec2::splat(26.0)).frame(false);
    let response = ui.add_enabled(enabled, button).on_hover_text(name).on_disabled_hover_text(name);
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, enabled, name));
    response.clicked()
}

pub fn top_bar(m: &mut Modeller, ui: &mut egui::Ui) {
    ui.set_height(theme::TOP_BAR);
    egui::MenuBar::new().ui(ui, |ui| {
        ui.set_height(theme::TOP_BAR);
        let ctx = ui.ctx().clone();
        file_menu(m, ui, &ctx);
        edit_menu(m, ui, &ctx);
        view_menu(m, ui);
        ui.menu_button("Help", |ui| {
            if item(ui, "Keys", "?") {
                m.question = Some(Question::Keys);
            }
            if item(ui, "About", "") {
                m.question = Some(Question::About);
            }
        });
        ui.add_space(16.0);
        modes(m, ui);
        ui.with_layout(Flow::right_to_left(Align::Center), |ui| {
            let (at, count) = m.desk.as_ref().map_or((0, 0), |d| (d.history.at(), d.history.steps().len()));
            if icon_button(ui, icons::ICON_REDO, "Redo (Ctrl Shift Z)", at + 1 < count) {
                m.redo();
            }
            if icon_button(ui, icons::ICON_UNDO, "Undo (Ctrl Z)", at > 0) {
                m.undo();
            }
            if let Some(desk) = &m.desk {
                ui.add_space(8.0);
                ui.add(egui::Label::new(RichText::new(desk.title()).color(theme::dim(ui))).truncate());
            }
        });
    });
}

/// How the interior is deformed, and whether two ways are compared.
fn modes(m: &mut Modeller, ui: &mut egui::Ui) {
    for (mode, name, key, what) in [
        (Mode::Slicing, "Slicing", 1, "texture coordinates displaced on a subdivision of each slice"),
        (Mode::SlicingExact, "Exact", 2, "the backward map for every fragment"),
        (Mode::Tets, "Tets", 3, "the volume warped through a lattice of tetrahedra, then drawn"),
        (Mode::Spline, "Surface", 4, "the smooth iso-surface of a C1 spline"),
    ] {
        let button = egui::Button::selectable(m.view.mode == mode, name).frame_when_inactive(true);
        if ui.add(button).on_hover_text(format!("{what} ({key})")).clicked() {
            m.view.mode = mode;
        }
    }
    ui.add_space(8.0);
    let button = egui::Button::selectable(m.view.compare, "A/B").frame_when_inactive(true);
    if ui.add(button).on_hover_text("Compare with another mode or the original (A)").clicked() {
        m.view.compare = !m.view.compare;
        if m.view.compare {
            panels::open(&mut m.tree, Pane::Compare);
        }
    }
}

fn item(ui: &mut egui::Ui, name: &str, key: &str) -> bool {
    let clicked = ui.add(egui::Button::new(name).shortcut_text(key)).clicked();
    if clicked {
        ui.close();
    }
    clicked
}

/// A line of a menu that is on or off, with its key where the others have theirs.
fn toggle(ui: &mut egui::Ui, on: &mut bool, name: &str, key: &str, what: String) {
    let mark = if *on { icons::ICON_CHECK.rich_text() } else { RichText::new("") };
    let width = 14.0;
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 0.0;
        let row = egui::Button::new(name).shortcut_text(key);
        let (mark_at, _) = ui.allocate_exact_size(Vec2::new(width, 24.0), egui::Sense::hover());
        ui.put(mark_at, egui::Label::new(mark.size(14.0).color(theme::accent_text(ui))));
        let size = Vec2::new(ui.available_width(), 24.0);
        let response = ui.add(row.min_size(size)).on_hover_text(what);
        response.widget_info(|| egui::WidgetInfo::selected(egui::Role::MenuItemCheckBox, true, *on, name));
        if response.clicked() {
            *on = !*on;
        }
    });
}

fn file_menu(m: &mut Modeller, ui: &mut egui::Ui, ctx: &egui::Context) {
    ui.menu_button("File", |ui| {
        ui.set_min_width(220.0);
        ui.menu_button("New", |ui| {
            for phantom in crate::volume::phantom::Phantom::ALL {
                if ui.button(phantom.name()).on_hover_text(phantom.description()).clicked() {
                    m.open(ctx, &format!("phantom:{}:192", phantom.name()));
                    ui.close();
                }
            }
        });
        if item(ui, "Open…", "Ctrl O") {
            m.question = Some(Question::Open { word: String::new(), wrong: None });
        }
        ui.menu_button("Open recent", |ui| {
            let recent = m.settings.recent.clone();
            if recent.is_empty() {
                ui.label(RichText::new("Nothing yet").weak());
            }
            for path in recent {
                let name = file_name(&path);
                if ui.button(name).on_hover_text(path.to_string_lossy()).clicked() {
                    m.open(ctx, &path.to_string_lossy());
                    ui.close();
                }
            }
        });
        ui.separator();
        if item(ui, "Save", "Ctrl S") {
            m.save(ctx, After::Nothing);
        }
        if item(ui, "Save as…", "Ctrl Shift S") {
            m.ask_save_as(After::Nothing);
        }
        ui.separator();
        if item(ui, "Export volume…", "Ctrl E") {
            panels::open(&mut m.tree, Pane::Export);
        }
        if item(ui, "Picture…", "Ctrl P") {
            m.ask_screenshot();
        }
        if item(ui, "Turntable…", "") {
            m.question = Some(Question::Turntable { word: m.suggested("gif"), frames: 72, seconds: 6.0 });
        }
        ui.separator();
        if item(ui, "Quit", "Ctrl Q") {
            m.quit(ctx);
        }
    });
}

fn edit_menu(m: &mut Modeller, ui: &mut egui::Ui, ctx: &egui::Context) {
    ui.menu_button("Edit", |ui| {
        ui.set_min_width(200.0);
        if item(ui, "Undo", "Ctrl Z") {
            m.undo();
        }
        if item(ui, "Redo", "Ctrl Shift Z") {
            m.redo();
        }
        ui.separator();
        if item(ui, "Copy the stack", "Ctrl C") {
            panels::deform::copy(m, ctx);
        }
        if item(ui, "Paste a stack", "Ctrl V") {
            panels::deform::paste_own(m);
        }
        ui.separator();
        if item(ui, "Preferences…", "") {
            m.question = Some(Question::Preferences);
        }
    });
}

fn view_menu(m: &mut Modeller, ui: &mut egui::Ui) {
    ui.menu_button("View", |ui| {
        ui.set_width(280.0);
        for pane in Pane::ALL {
            let mut on = panels::is_open(&m.tree, pane);
            if pane != Pane::View && ui.checkbox(&mut on, pane.name()).clicked() {
                panels::toggle(&mut m.tree, pane);
            }
        }
        ui.separator();
        let colours = "blue where material is squeezed, orange where it is stretched, pink where space is folded";
        let view = &mut m.view;
        for (on, name, key, what) in [
            (&mut view.overlays, "Overlays", "H", "Everything that lies over the picture".to_owned()),
            (&mut view.proxy, "Proxy wireframe", "", "The mesh that gives the object its shape".to_owned()),
            (
                &mut view.boxes,
                "Handles of the selected deformation",
                "",
                "Its box, and handles that move, pull and widen it".to_owned(),
            ),
            (&mut view.tessellation, "Tessellation of a slice", "W", "How the slice in the middle is split".to_owned()),
            (
                &mut view.tets,
                "Tetrahedra",
                "K",
                "A layer of the lattice at the point that was clicked last, facing the eye".to_owned(),
            ),
            (&mut view.heat, "Growth and folds", "J", format!("On the surface that is seen: {colours}")),
            (&mut view.growth, "Growth and folds in the slices", "", format!("In the slices: {colours}")),
            (
                &mut view.cube,
                "Texture cube",
                "Tab",
                "The mesh in the texture cube, with a gizmo that places it".to_owned(),
            ),
            (&mut m.show_trace, "Times", "F12", "How long the steps of the window take".to_owned()),
        ] {
            toggle(ui, on, name, key, what);
        }
        ui.separator();
        let before = m.settings.orbit;
        for orbit in Orbit::ALL {
            let name = format!("Orbit: {}", orbit.name());
            ui.radio_value(&mut m.settings.orbit, orbit, name).on_hover_text(orbit.hint());
        }
        if m.settings.orbit != before {
            let ctx = ui.ctx().clone();
            m.apply_settings(&ctx);
        }
        ui.separator();
        if let Some(scene) = super::view::scene(m) {
            if item(ui, "Frame all", "Home") {
                m.edit(crate::scene::Edit::SetCamera(super::navigate::frame(&scene.spec)));
            }
            for standard in super::navigate::Standard::ALL {
                if item(ui, standard.name(), standard.key()) {
                    m.edit(crate::scene::Edit::SetCamera(standard.of(&scene.spec)));
                }
            }
        }
    });
}

fn tool_icon(tool: Tool) -> MaterialIcon {
    match tool {
        Tool::Grab => icons::ICON_PAN_TOOL,
        Tool::Push => icons::ICON_TOUCH_APP,
        Tool::Pinch => icons::ICON_COMPRESS,
        Tool::Inflate => icons::ICON_BUBBLE_CHART,
        Tool::Twist => icons::ICON_CYCLONE,
        Tool::Smooth => icons::ICON_BLUR_ON,
        Tool::Lattice => icons::ICON_GRID_ON,
        Tool::Place => icons::ICON_OPEN_WITH,
        Tool::Pick => icons::ICON_COLORIZE,
        Tool::Measure => icons::ICON_STRAIGHTEN,
    }
}

pub fn tool_bar(m: &mut Modeller, ui: &mut egui::Ui) {
    ui.spacing_mut().item_spacing = Vec2::splat(theme::GAP);
    ui.spacing_mut().button_padding = Vec2::ZERO;
    ui.add_space(6.0);
    for tool in Tool::ALL {
        let on = m.hand.tool == tool;
        if tool == Tool::Lattice || tool == Tool::Pick {
            ui.add_space(theme::GAP);
        }
        let button = egui::Button::new(tool_icon(tool).rich_text().size(20.0)).selected(on).frame_when_inactive(false);
        let name = format!("{} ({})", tool.name(), tool.key());
        let response =
            ui.add_sized(Vec2::splat(theme::TOOL_BUTTON), button).on_hover_text(format!("{name}\n{}", tool.hint()));
        response.widget_info(|| egui::WidgetInfo::selected(egui::Role::RadioButton, true, on, tool.name()));
        if response.clicked() {
            m.set_tool(tool);
        }
    }
    ui.add_space(theme::GAP * 2.0);
    for (axis, name) in ["X", "Y", "Z"].into_iter().enumerate() {
        let on = m.hand.mirror[axis];
        let text = RichText::new(name).color(if on { theme::AXES[axis] } else { theme::dim(ui) }).strong();
        let button = egui::Button::new(text).selected(on).frame_when_inactive(false);
        let response = ui
            .add_sized(Vec2::new(theme::TOOL_BUTTON, 24.0), button)
            .on_hover_text(format!("Mirror strokes across the middle along {name} ({name})"));
        response.widget_info(|| egui::WidgetInfo::selected(egui::Role::CheckBox, true, on, format!("Mirror {name}")));
        if response.clicked() {
            m.hand.mirror[axis] = !on;
        }
    }
}

pub fn status_bar(m: &mut Modeller, ui: &mut egui::Ui) {
    let ctx = ui.ctx().clone();
    ui.horizontal_centered(|ui| {
        ui.style_mut().override_text_style = Some(egui::TextStyle::Small);
        let hint = match m.doing {
            Doing::Orbit => "Release to stop turning",
            Doing::Pan => "Release to stop moving",
            Doing::Stroke { .. } => "Release to keep the stroke; Esc gives it up",
            Doing::Radius { .. } => "Move for the radius, click to keep it",
            Doing::Strength { .. } => "Move for the strength, click to keep it",
            Doing::Grip(_) => "Release to keep it; Esc gives it up",
            Doing::Placing(_) => "Release to keep it; Ctrl turns in steps of 15°",
            Doing::Wipe => "Move the wipe",
            _ => m.hand.tool.hint(),
        };
        ui.label(RichText::new(hint).color(theme::dim(ui)));
        ui.with_layout(Flow::right_to_left(Align::Center), |ui| {
            if let Some(shown) = &m.shown {
                let r = &shown.report;
                let state = if shown.last { "" } else { " …" };
                ui.label(
                    RichText::new(format!(
                        "{:.0} ms  {} slices  {} triangles  {}{state}",
                        r.ms_total,
                        r.slices,
                        thousands(r.triangles),
                        r.backend.to_uppercase()
                    ))
                    .monospace()
                    .size(11.0),
                )
                .on_hover_text(&r.device);
                ui.separator();
            }
            if let (Some(hit), Some(desk)) = (&m.hover, &m.desk) {
                let v = hit.voxel;
                let p = hit.point;
                let text = format!(
                    "{:.5}  voxel {:.0} {:.0} {:.0}  {:.1} {:.1} {:.1} {}",
                    trimmed(hit.value),
                    v.x,
                    v.y,
                    v.z,
                    p.x,
                    p.y,
                    p.z,
                    desk.unit()
                );
                ui.label(RichText::new(text).monospace().size(11.0));
                ui.separator();
            }
            if let Some(desk) = m.desk.as_ref().filter(|d| d.data.basis.steps > 1) {
                let (step, steps) = (desk.history.document().step, desk.data.basis.steps);
                ui.label(RichText::new(format!("step {step} (0 to {})", steps - 1)).monospace().size(11.0));
                if step != desk.data.step {
                    ui.add(egui::Spinner::new().size(12.0)).on_hover_text("It is being read");
                }
                ui.separator();
            }
            for task in &m.tasks {
                if task.can_cancel && icon_button(ui, icons::ICON_CLOSE, "Cancel", true) {
                    task.cancel();
                }
                match task.progress() {
                    Some(p) => {
                        ui.add(egui::ProgressBar::new(p).desired_width(120.0).desired_height(8.0));
                    }
                    None => {
                        ui.add(egui::Spinner::new().size(12.0));
                    }
                }
                ui.label(&task.name);
                // a task that moves is worth looking at
                ctx.request_repaint_after(std::time::Duration::from_millis(100));
            }
        });
    });
}

fn trimmed(v: f64) -> f64 {
    if v.abs() < 1e-12 { 0.0 } else { v }
}

fn thousands(n: usize) -> String {
    if n < 10_000 { n.to_string() } else { format!("{:.0} K", n as f64 / 1e3) }
}

/// How long the steps of the window took.
pub fn trace(m: &Modeller, ctx: &egui::Context) {
    egui::Window::new("Times")
        .anchor(egui::Align2::RIGHT_TOP, [-(theme::INSPECTOR + 16.0), theme::TOP_BAR + 12.0])
        .resizable(false)
        .show(ctx, |ui| {
            egui::Grid::new("trace").num_columns(5).spacing([12.0, 2.0]).show(ui, |ui| {
                for head in ["ms", "median", "95 %", "worst", "count"] {
                    ui.label(RichText::new(head).weak().size(11.0));
                }
                ui.end_row();
                for (name, series) in m.trace.rows() {
                    ui.label(RichText::new(name).size(11.0));
                    let number = |v: Option<f32>| v.map_or_else(|| "–".to_owned(), |v| format!("{v:.2}"));
                    let worst = (series.count > 0).then_some(series.worst);
                    for v in [series.quantile(0.5), series.quantile(0.95), worst] {
                        ui.label(RichText::new(number(v)).monospace().size(11.0));
                    }
                    ui.label(RichText::new(series.count.to_string()).monospace().size(11.0));
                    ui.end_row();
                }
            });
        });
}

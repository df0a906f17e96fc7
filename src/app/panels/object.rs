//! What is open: the volume, its shape, where the shape lies.

use eframe::egui::{self, RichText};
use egui_material_icons::icons;

use super::{number, row, title, vector};
use crate::app::desk::file_name;
use crate::app::menu::icon_button;
use crate::app::modeller::Modeller;
use crate::app::tasks::Purpose;
use crate::scene::{Edit, Placement, ProxySource, VolumeSource};

pub fn show(m: &mut Modeller, ui: &mut egui::Ui) {
    let Some(desk) = &m.desk else {
        ui.label(RichText::new("Nothing is open. Drop a file, or press Ctrl O.").weak());
        return;
    };
    let document = desk.history.document().clone();
    let data = desk.data.clone();
    let unit = desk.unit();
    let triangles = desk.object.as_ref().map(|(_, o)| o.mesh.triangles.len());
    let volume = &data.volume;
    title(ui, "Volume");
    let name = match &document.volume {
        VolumeSource::File(p) => p.to_string_lossy().into_owned(),
        VolumeSource::Embedded(_) => "inside the project".to_owned(),
        VolumeSource::Phantom { name, size } => format!("phantom {name}, {size}"),
    };
    let [x, y, z] = volume.grid.dims;
    let m3 = volume.grid.world_from_voxel.matrix3;
    let [lo, hi] = data.field.range;
    let megabytes = volume.samples.bytes().len() as f64 / 1e6;
    for (what, text) in [
        ("Source", name),
        ("Size", format!("{x} x {y} x {z}, {megabytes:.0} MB")),
        ("Type", format!("{:?}, {} channel(s)", volume.samples.scalar_type(), volume.channels)),
        (
            "Spacing",
            format!("{:.3} x {:.3} x {:.3} {unit}", m3.x_axis.length(), m3.y_axis.length(), m3.z_axis.length()),
        ),
        ("Values", format!("{lo:.4} to {hi:.4}")),
    ] {
        row(ui, what, |ui, _| ui.add(egui::Label::new(text).truncate()));
    }
    if data.basis.steps > 1 {
        series(m, ui, document.step, data.basis.steps);
    }
    let [lo, hi] = data.basis.range;
    title(ui, "Shape");
    let mut edit = None;
    row(ui, "Mesh", |ui, _| {
        if ui.selectable_label(document.proxy == ProxySource::Box, "Box").clicked() {
            edit = Some(Edit::SetProxy(ProxySource::Box));
        }
        let auto = matches!(document.proxy, ProxySource::Auto { .. });
        if ui.selectable_label(auto, "Hull").on_hover_text("A smooth hull round everything above a value").clicked() {
            edit = Some(Edit::SetProxy(ProxySource::Auto { iso: None }));
        }
        let mesh = matches!(document.proxy, ProxySource::Mesh(_));
        if ui.selectable_label(mesh, "File…").on_hover_text("A closed surface: OBJ, STL, PLY").clicked() {
            m.choose(ui.ctx(), Purpose::Proxy, None);
        }
    });
    match &document.proxy {
        ProxySource::Auto { iso } => {
            let mut value = iso.unwrap_or(data.iso);
            let speed = (hi - lo) / 400.0;
            let changed = row(ui, "Above", |ui, id| {
                ui.add(
                    egui::DragValue::new(&mut value)
                        .speed(speed)
                        .range(lo..=hi)
                        .max_decimals(4)
                        .update_while_editing(false),
                )
                .labelled_by(id)
                .changed()
            });
            if changed {
                edit = Some(Edit::SetProxy(ProxySource::Auto { iso: Some(value) }));
            }
        }
        ProxySource::Mesh(path) => {
            let text = file_name(path);
            row(ui, "File", |ui, _| ui.label(text));
        }
        ProxySource::Box => {}
    }
    if let Some(n) = triangles {
        row(ui, "Triangles", |ui, _| ui.label(n.to_string()));
    }
    let now = m.desk.as_ref().map_or(document.placement, |d| d.shown().placement);
    placement(m, ui, now, unit);
    if let Some(edit) = edit {
        m.edit(edit);
    }
}

/// Which step of a series in time is shown.
fn series(m: &mut Modeller, ui: &mut egui::Ui, before: usize, steps: usize) {
    let mut step = before;
    row(ui, "Step", |ui, id| {
        ui.spacing_mut().slider_width = 128.0;
        ui.add(egui::Slider::new(&mut step, 0..=steps - 1)).labelled_by(id).on_hover_text(format!(
            "Of {steps} steps in time, counted from 0; Left and Right go to the one before and the next"
        ))
    });
    if step != before {
        m.player.playing = false;
        m.show_step(step);
    }
    row(ui, "Play", |ui, id| {
        if icon_button(ui, icons::ICON_CHEVRON_LEFT, "The step before (Left)", true) {
            m.player.playing = false;
            m.move_step(-1);
        }
        let (icon, name) = match m.player.playing {
            true => (icons::ICON_PAUSE, "Pause (Space)"),
            false => (icons::ICON_PLAY_ARROW, "Play (Space)"),
        };
        if icon_button(ui, icon, name, true) {
            m.player.playing = !m.player.playing;
        }
        if icon_button(ui, icons::ICON_CHEVRON_RIGHT, "The next step (Right)", true) {
            m.player.playing = false;
            m.move_step(1);
        }
        let rate = egui::DragValue::new(&mut m.player.rate).range(0.5..=60.0).speed(0.1).max_decimals(1).suffix(" /s");
        ui.add(rate).labelled_by(id).on_hover_text("Steps in a second, as far as the machine keeps up");
    });
}

/// Where the mesh lies in the texture cube.
fn placement(m: &mut Modeller, ui: &mut egui::Ui, before: Placement, unit: &str) {
    title(ui, "Placement in the texture cube");
    let mut p = before;
    vector(ui, "Move", &mut p.translate, 0.2, "");
    vector(ui, "Turn", &mut p.rotate, 0.5, "°");
    vector(ui, "Scale", &mut p.scale, 0.005, "");
    p.scale = p.scale.map(|s| if s == 0.0 { 0.01 } else { s });
    let mut uniform = 1.0;
    row(ui, "Scale all", |ui, id| number(ui, id, &mut uniform, 0.005, " x"));
    p.scale *= uniform.clamp(0.01, 100.0);
    ui.horizontal(|ui| {
        if ui.add_enabled(before != Placement::default(), egui::Button::new("Reset")).clicked() {
            p = Placement::default();
        }
        ui.label(RichText::new(format!("in {unit} and degrees")).weak().size(11.0));
    });
    ui.checkbox(&mut m.view.cube, "Show the texture cube");
    ui.checkbox(&mut m.view.proxy, "Show the mesh in the view");
    if p != before {
        m.edit(Edit::SetPlacement(p));
    }
}

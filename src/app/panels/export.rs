//! The deformed volume as a file.

use eframe::egui::{self, RichText};
use glam::DVec3;

use super::{row, title};
use crate::app::desk::suggested;
use crate::app::modeller::Modeller;
use crate::app::tasks::{ExportJob, ExportMode, Purpose, typed_path};
use crate::app::theme;
use crate::evaluate::export::{ExportOptions, GridChoice};
use crate::volume::sampling::Interpolation;

pub fn show(m: &mut Modeller, ui: &mut egui::Ui) {
    let Some(desk) = &m.desk else { return };
    let unit = desk.unit();
    let data = desk.data.clone();
    if m.panels.export_path.is_empty() {
        m.panels.export_path = suggested(desk, "nrrd");
    }
    title(ui, "Export the deformed volume");
    row(ui, "Mode", |ui, _| {
        for (mode, name, what) in [
            (ExportMode::Slicing, "Map", "through the backward map; bounds leave out what does not move"),
            (ExportMode::Tets, "Tets", "warped through a lattice of tetrahedra"),
            (ExportMode::Reference, "Reference", "the map at every voxel in double precision"),
        ] {
            ui.selectable_value(&mut m.panels.export_mode, mode, name).on_hover_text(what);
        }
    });
    row(ui, "Filter", |ui, _| {
        for (filter, name) in
            [(Interpolation::Nearest, "Nearest"), (Interpolation::Linear, "Linear"), (Interpolation::Cubic, "Cubic")]
        {
            ui.selectable_value(&mut m.panels.interpolation, filter, name);
        }
    });
    ui.checkbox(&mut m.panels.grow, "Grow the grid to hold what was pulled out");
    row(ui, "Spacing", |ui, id| {
        let mut as_volume = m.panels.spacing.is_none();
        if ui.checkbox(&mut as_volume, "as the volume").labelled_by(id).changed() {
            m.panels.spacing = if as_volume { None } else { Some(data.volume.grid.finest()) };
        }
        if let Some(s) = &mut m.panels.spacing {
            let finest = data.volume.grid.finest();
            let drag = egui::DragValue::new(s).speed(0.01 * finest).range(0.05 * finest..=100.0 * finest);
            let response = ui.add(drag.suffix(format!(" {unit}")).max_decimals(3));
            response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, "Spacing"));
        }
    });
    ui.checkbox(&mut m.panels.certificate, "Certify what the export is worth");
    let grow = m.panels.grow;
    let grid = match m.panels.spacing {
        Some(s) => GridChoice::Spacing { spacing: DVec3::splat(s), grown: grow },
        None if grow => GridChoice::SameGrown,
        None => GridChoice::Same,
    };
    let options = ExportOptions { grid, interpolation: m.panels.interpolation, ..ExportOptions::default() };
    estimate(m, ui);
    row(ui, "File", |ui, id| {
        ui.add(egui::TextEdit::singleline(&mut m.panels.export_path).desired_width(f32::INFINITY)).labelled_by(id);
    });
    let path = typed_path(&m.panels.export_path);
    let known = crate::io::is_volume_path(&path);
    if !known {
        ui.colored_label(theme::ERROR, "The name must end in .nrrd .nhdr .nii .nii.gz .mha .mhd or .raw");
    }
    ui.horizontal(|ui| {
        if ui.add_enabled(known, egui::Button::new("Export volume")).clicked() {
            let job = ExportJob {
                path: path.clone(),
                mode: m.panels.export_mode,
                options,
                certificate: m.panels.certificate,
            };
            m.panels.exported = None;
            m.export(ui.ctx(), job);
        }
        if ui.button("Browse…").clicked() {
            m.choose(ui.ctx(), Purpose::Export, Some(path));
        }
    });
    result(m, ui);
}

/// How large it will be.
fn estimate(m: &Modeller, ui: &mut egui::Ui) {
    let Some((_, object)) = m.desk.as_ref().and_then(|d| d.object.as_ref()) else { return };
    // a guess that costs no work: the grid without what it grows by, unless it is the volume's own
    let input = &object.volume.grid;
    let factor = m.panels.spacing.map_or(1.0, |s| {
        let cell = input.world_from_voxel.matrix3.determinant().abs();
        cell / (s * s * s)
    });
    let bytes = object.volume.samples.bytes().len() as f64 * factor;
    let more = if m.panels.grow { "or a little more" } else { "" };
    row(ui, "Size", |ui, _| ui.label(format!("{:.0} MB {more}", bytes / 1e6)).on_hover_text("Before compression"));
}

fn result(m: &Modeller, ui: &mut egui::Ui) {
    let Some(done) = &m.panels.exported else { return };
    ui.separator();
    title(ui, "Exported");
    let [x, y, z] = done.dims;
    row(ui, "File", |ui, _| ui.add(egui::Label::new(done.path.to_string_lossy()).truncate()));
    row(ui, "Size", |ui, _| ui.label(format!("{x} x {y} x {z}, {:.0} ms", done.ms)));
    for note in &done.notes {
        ui.label(RichText::new(note).size(12.0));
    }
    let Some(c) = &done.certificate else { return };
    title(ui, "Certificate");
    if c.sound {
        ui.label("Sound: no hole, no overlap, no fold, no label added");
    } else {
        for fault in &c.faults {
            ui.colored_label(theme::ERROR, fault);
        }
    }
    row(ui, "det J", |ui, _| {
        ui.label(match (c.jacobian.min, c.jacobian.max) {
            (Some(a), Some(b)) => format!("{a:.3} to {b:.3}"),
            _ => "nothing moved".to_owned(),
        })
    });
    row(ui, "Residual", |ui, _| ui.label(format!("{:.2e} voxels", c.inverse.max)));
    row(ui, "Mass", |ui, _| ui.label(format!("{:.5} times what it was", c.mass.after / c.mass.before)));
}

//! What the smooth surface shows beside its shape.

use eframe::egui;

use super::{color, row, title};
use crate::app::modeller::Modeller;
use crate::evaluate::load::Data;
use crate::evaluate::picture::Mode;
use crate::scene::Edit;
use crate::spline::paint::{Curvature, Shell, SmoothLook};

/// More surfaces than this are not looked through.
const MOST: usize = 4;

pub fn show(m: &mut Modeller, ui: &mut egui::Ui, before: &SmoothLook, data: &Data) {
    ui.separator();
    title(ui, "Smooth surface");
    let on = m.view.mode == Mode::Spline;
    let mut look = before.clone();
    ui.add_enabled_ui(on, |ui| controls(ui, &mut look, data)).response.on_disabled_hover_text("In mode Surface (4)");
    if look != *before {
        m.edit(Edit::SetSurface(look));
    }
}

fn controls(ui: &mut egui::Ui, look: &mut SmoothLook, data: &Data) {
    row(ui, "Opacity", |ui, id| {
        ui.add(egui::Slider::new(&mut look.opacity, 0.0..=1.0).fixed_decimals(2))
            .labelled_by(id)
            .on_hover_text("What is behind the surface is seen through the rest")
    });
    row(ui, "Shade", |ui, _| {
        ui.checkbox(&mut look.occlusion, "hollows")
            .on_hover_text("Ambient occlusion: the surroundings take light away");
        ui.checkbox(&mut look.shadows, "shadows").on_hover_text("Soft shadows of the light");
    });
    row(ui, "Curvature", |ui, _| {
        for (name, what, kind) in [
            ("none", "The surface has its own colour", None),
            ("mean", "Red where the surface bulges, blue where it is hollow", Some(Curvature::Mean)),
            ("Gaussian", "Red on domes and in cups, blue on saddles", Some(Curvature::Gaussian)),
        ] {
            ui.selectable_value(&mut look.curvature, kind, name).on_hover_text(what);
        }
    });
    ui.checkbox(&mut look.caps, "Cuts show the volume")
        .on_hover_text("Where a clipping plane cuts, the transfer function gives the colour");
    ui.checkbox(&mut look.direct, "Straight through strokes").on_hover_text(
        "The surface is found through the strokes: nothing is resampled, so strokes show sooner and edges stay sharp",
    );
    let [lo, hi] = data.basis.range;
    let mut gone = None;
    for (n, shell) in look.shells.iter_mut().enumerate() {
        row(ui, &format!("Surface {}", n + 2), |ui, id| {
            let drag = egui::DragValue::new(&mut shell.iso).range(lo..=hi).speed((hi - lo) * 2e-3).max_decimals(4);
            ui.add(drag).labelled_by(id).on_hover_text("Isovalue");
            color(ui, &mut shell.color);
            let drag = egui::DragValue::new(&mut shell.opacity).range(0.0..=1.0).speed(0.01).fixed_decimals(2);
            let response = ui.add(drag).on_hover_text("Opacity");
            response.widget_info(|| {
                egui::WidgetInfo::labeled(egui::Role::SpinButton, true, format!("Opacity of surface {}", n + 2))
            });
            if ui.button("x").on_hover_text("Remove this surface").clicked() {
                gone = Some(n);
            }
        });
    }
    if let Some(n) = gone {
        look.shells.remove(n);
    }
    let more = egui::Button::new("Add a surface");
    if ui.add_enabled(look.shells.len() < MOST, more).on_hover_text("Another isovalue, shown with the first").clicked()
    {
        look.shells.push(Shell { iso: data.iso + 0.3 * (hi - data.iso), color: [0.55, 0.72, 0.92], opacity: 1.0 });
    }
}

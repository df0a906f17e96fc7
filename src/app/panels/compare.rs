//! A/B: two modes of the same view against each other, in numbers.

use eframe::egui::{self, RichText};

use super::{row, title};
use crate::app::modeller::Modeller;
use crate::app::overlay::{mode_name, other_name};
use crate::app::state::Layout;
use crate::app::worker::Other;
use crate::evaluate::picture::Mode;

pub fn show(m: &mut Modeller, ui: &mut egui::Ui) {
    title(ui, "Compare");
    ui.checkbox(&mut m.view.compare, "Two pictures (A)");
    row(ui, "A", |ui, _| ui.label(mode_name(m.view.mode)));
    row(ui, "B", |ui, _| {
        ui.vertical(|ui| {
            let modes = [Mode::Slicing, Mode::SlicingExact, Mode::Tets, Mode::Spline].map(Other::Mode);
            for other in std::iter::once(Other::Original).chain(modes) {
                ui.radio_value(&mut m.view.other, other, other_name(other));
            }
        });
    });
    ui.horizontal(|ui| {
        ui.selectable_value(&mut m.view.layout, Layout::Wipe, "Wipe");
        ui.selectable_value(&mut m.view.layout, Layout::SideBySide, "Side by side");
        ui.selectable_value(&mut m.view.layout, Layout::Difference, "Difference");
    });
    ui.separator();
    let Some(shown) = &m.shown else { return };
    title(ui, "This view");
    let a = &shown.report;
    let b = shown.other.as_ref().filter(|_| m.view.compare);
    egui::Grid::new("metrics").num_columns(3).spacing([16.0, 4.0]).striped(true).show(ui, |ui| {
        ui.label("");
        ui.label(RichText::new("A").strong());
        ui.label(RichText::new("B").strong());
        ui.end_row();
        let line = |ui: &mut egui::Ui, name: &str, a: String, b: Option<String>| {
            ui.label(RichText::new(name).size(12.0).weak());
            ui.label(RichText::new(a).monospace());
            ui.label(RichText::new(b.unwrap_or_default()).monospace());
            ui.end_row();
        };
        line(ui, "Slices", a.slices.to_string(), b.map(|b| b.report.slices.to_string()));
        line(ui, "Triangles", a.triangles.to_string(), b.map(|b| b.report.triangles.to_string()));
        line(ui, "Slices, ms", format!("{:.1}", a.ms_geometry), b.map(|b| format!("{:.1}", b.report.ms_geometry)));
        line(ui, "Picture, ms", format!("{:.1}", a.ms_draw), b.map(|b| format!("{:.1}", b.report.ms_draw)));
    });
    let Some(b) = b else {
        ui.label(RichText::new("Switch two pictures on to see\nhow far apart they are.").weak());
        return;
    };
    title(ui, "A against B");
    let psnr =
        if b.metrics.psnr.is_finite() { format!("{:.1} dB", b.metrics.psnr) } else { "no difference".to_owned() };
    for (name, text) in [
        ("RMSE", format!("{:.3} of 255", b.metrics.rmse)),
        ("PSNR", psnr),
        ("SSIM", format!("{:.5}", b.metrics.ssim)),
        ("Largest", format!("{:.0} of 255", b.metrics.max)),
    ] {
        row(ui, name, |ui, _| ui.label(RichText::new(text).monospace()));
    }
    if !shown.last {
        ui.label(RichText::new("A preview: the numbers settle when the view is still.").weak().size(11.0));
    }
}

//! The panes of the window and how they are arranged: they can be moved, closed and brought back.

mod compare;
pub mod deform;
mod export;
mod look;
mod object;
mod regions;
mod surface;
mod transfer;

use std::sync::Arc;

use eframe::egui::{self, RichText};
use egui_tiles::{Behavior, Container, SimplificationOptions, TabState, Tile, TileId, Tiles, Tree, UiResponse};
use glam::DVec3;

use super::modeller::Modeller;
use super::tasks::{ExportMode, Exported};
use super::theme;
use crate::evaluate::heat::{HeatSurface, TetLayer};
use crate::volume::sampling::Interpolation;

/// What a pane shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pane {
    View,
    Slices,
    Object,
    Deform,
    Look,
    Compare,
    Export,
}

impl Pane {
    pub const ALL: [Self; 7] =
        [Self::View, Self::Slices, Self::Object, Self::Deform, Self::Look, Self::Compare, Self::Export];

    pub fn name(self) -> &'static str {
        match self {
            Self::View => "View",
            Self::Slices => "Slices",
            Self::Object => "Object",
            Self::Deform => "Deform",
            Self::Look => "Look",
            Self::Compare => "Compare",
            Self::Export => "Export",
        }
    }
}

/// What the panels keep to themselves.
pub struct PanelState {
    /// Index of the deformation that is being edited.
    pub selected: Option<usize>,
    /// Index of the transfer function's point that is being edited.
    pub point: Option<usize>,
    pub log_histogram: bool,
    pub regions: regions::RegionState,
    pub export_path: String,
    pub export_mode: ExportMode,
    pub interpolation: Interpolation,
    pub grow: bool,
    /// Isotropic spacing; `None`: as the volume.
    pub spacing: Option<f64>,
    pub certificate: bool,
    pub exported: Option<Box<Exported>>,
    /// Edges of one slice's triangles.
    pub tessellation: Option<Vec<[DVec3; 2]>>,
    pub tets: Option<Arc<TetLayer>>,
    pub heat: Option<Arc<HeatSurface>>,
}

impl Default for PanelState {
    fn default() -> Self {
        Self {
            selected: None,
            point: None,
            log_histogram: true,
            regions: regions::RegionState::default(),
            export_path: String::new(),
            export_mode: ExportMode::Slicing,
            interpolation: Interpolation::Linear,
            grow: true,
            spacing: None,
            certificate: true,
            exported: None,
            tessellation: None,
            tets: None,
            heat: None,
        }
    }
}

/// The arrangement at the start: the view, beside it the inspector.
pub fn tree() -> Tree<Pane> {
    let mut tiles = Tiles::default();
    let view = tiles.insert_pane(Pane::View);
    let slices = tiles.insert_pane(Pane::Slices);
    tiles.set_visible(slices, false);
    let tabs = [Pane::Object, Pane::Deform, Pane::Look, Pane::Compare, Pane::Export].map(|p| tiles.insert_pane(p));
    let inspector = tiles.insert_tab_tile(tabs.to_vec());
    if let Some(Tile::Container(Container::Tabs(t))) = tiles.get_mut(inspector) {
        t.set_active(tabs[1]);
    }
    let left = tiles.insert_vertical_tile(vec![view, slices]);
    if let Some(Tile::Container(Container::Linear(l))) = tiles.get_mut(left) {
        l.shares.set_share(view, 2.4);
        l.shares.set_share(slices, 1.0);
    }
    let root = tiles.insert_horizontal_tile(vec![left, inspector]);
    if let Some(Tile::Container(Container::Linear(l))) = tiles.get_mut(root) {
        l.shares.set_share(left, 1360.0 - theme::TOOL_BAR - theme::INSPECTOR);
        l.shares.set_share(inspector, theme::INSPECTOR);
    }
    Tree::new(egui::Id::unique("panes"), root, tiles)
}

fn find(tree: &Tree<Pane>, pane: Pane) -> Option<TileId> {
    tree.tiles.find_pane(&pane)
}

pub fn is_open(tree: &Tree<Pane>, pane: Pane) -> bool {
    find(tree, pane).is_some_and(|id| tree.tiles.is_visible(id))
}

pub fn toggle(tree: &mut Tree<Pane>, pane: Pane) {
    if let Some(id) = find(tree, pane) {
        let on = tree.tiles.is_visible(id);
        tree.tiles.set_visible(id, !on);
    }
}

/// Brings a pane back and to the front.
pub fn open(tree: &mut Tree<Pane>, pane: Pane) {
    if let Some(id) = find(tree, pane) {
        tree.tiles.set_visible(id, true);
        tree.make_active(|tile, _| tile == id);
    }
}

/// When the window gets wider or narrower, the view does, not the inspector.
fn keep_inspector(m: &mut Modeller, width: f32) {
    let before = std::mem::replace(&mut m.width, width);
    if before == width || before <= 0.0 || width < 2.0 * theme::INSPECTOR {
        return;
    }
    let Some(root) = m.tree.root() else { return };
    if let Some(Tile::Container(Container::Linear(linear))) = m.tree.tiles.get_mut(root)
        && let [left, right] = linear.children[..]
    {
        let part = linear.shares[right] / (linear.shares[left] + linear.shares[right]);
        let kept = (part * before).clamp(120.0, 0.5 * width);
        linear.shares.set_share(left, width - kept);
        linear.shares.set_share(right, kept);
    }
}

pub fn show(m: &mut Modeller, ui: &mut egui::Ui) {
    keep_inspector(m, ui.available_width());
    let mut tree = std::mem::replace(&mut m.tree, Tree::empty(egui::Id::unique("panes")));
    let mut panes = Panes { m, commands: Vec::new() };
    tree.ui(&mut panes, ui);
    let commands = std::mem::take(&mut panes.commands);
    // what a pane asked of the arrangement while it was away
    let asked = std::mem::replace(&mut m.tree, tree);
    drop(asked);
    for pane in commands {
        open(&mut m.tree, pane);
    }
}

struct Panes<'a> {
    m: &'a mut Modeller,
    commands: Vec<Pane>,
}

impl Behavior<Pane> for Panes<'_> {
    fn pane_ui(&mut self, ui: &mut egui::Ui, _: TileId, pane: &mut Pane) -> UiResponse {
        match pane {
            Pane::View => super::view::show(self.m, ui),
            Pane::Slices => super::slices::show(self.m, ui),
            Pane::Object => page(ui, |ui| object::show(self.m, ui)),
            Pane::Deform => page(ui, |ui| deform::show(self.m, ui)),
            Pane::Look => page(ui, |ui| look::show(self.m, ui)),
            Pane::Compare => page(ui, |ui| compare::show(self.m, ui)),
            Pane::Export => page(ui, |ui| export::show(self.m, ui)),
        }
        if let Some(pane) = self.m.wants_pane.take() {
            self.commands.push(pane);
        }
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, pane: &Pane) -> egui::WidgetText {
        // small, as all five tabs and their crosses share the inspector's width
        RichText::new(pane.name()).size(12.0).into()
    }

    fn is_tab_closable(&self, tiles: &Tiles<Pane>, id: TileId) -> bool {
        matches!(tiles.get(id), Some(Tile::Pane(p)) if *p != Pane::View)
    }

    fn close_button_outer_size(&self) -> f32 {
        10.0
    }

    fn close_button_inner_margin(&self) -> f32 {
        2.0
    }

    fn tab_title_spacing(&self, _: &egui::Visuals) -> f32 {
        5.0
    }

    fn on_tab_close(&mut self, tiles: &mut Tiles<Pane>, id: TileId) -> bool {
        // it is only hidden, and comes back from the View menu
        tiles.set_visible(id, false);
        false
    }

    fn tab_bar_height(&self, _: &egui::Style) -> f32 {
        28.0
    }

    fn gap_width(&self, _: &egui::Style) -> f32 {
        2.0
    }

    fn min_size(&self) -> f32 {
        120.0
    }

    fn simplification_options(&self) -> SimplificationOptions {
        SimplificationOptions { all_panes_must_have_tabs: false, ..SimplificationOptions::default() }
    }

    fn tab_text_color(&self, visuals: &egui::Visuals, _: &Tiles<Pane>, _: TileId, state: &TabState) -> egui::Color32 {
        if state.active { visuals.strong_text_color() } else { visuals.weak_text_color() }
    }

    fn tab_bg_color(&self, visuals: &egui::Visuals, _: &Tiles<Pane>, _: TileId, state: &TabState) -> egui::Color32 {
        if state.active { visuals.widgets.inactive.bg_fill } else { egui::Color32::TRANSPARENT }
    }

    fn tab_outline_stroke(&self, _: &egui::Visuals, _: &Tiles<Pane>, _: TileId, _: &TabState) -> egui::Stroke {
        egui::Stroke::NONE
    }

    fn tab_bar_color(&self, visuals: &egui::Visuals) -> egui::Color32 {
        visuals.panel_fill
    }
}

/// A page of the inspector.
fn page(ui: &mut egui::Ui, add: impl FnOnce(&mut egui::Ui)) {
    egui::Frame::NONE.fill(ui.visuals().panel_fill).inner_margin(egui::Margin::same(12)).show(ui, |ui| {
        egui::ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            ui.set_width(ui.available_width());
            add(ui);
        });
    });
}

/// The title of a part of a page.
pub(super) fn title(ui: &mut egui::Ui, text: &str) {
    ui.add_space(theme::GAP);
    ui.label(RichText::new(text).strong());
    ui.add_space(theme::GAP / 2.0);
}

/// A name, and a widget at a common place to its right.
pub(super) fn row<R>(ui: &mut egui::Ui, name: &str, add: impl FnOnce(&mut egui::Ui, egui::Id) -> R) -> R {
    ui.horizontal(|ui| {
        let (rect, _) = ui.allocate_exact_size(egui::vec2(92.0, 24.0), egui::Sense::hover());
        let label = ui.put(rect, |ui: &mut egui::Ui| {
            ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                ui.set_min_width(92.0);
                ui.label(RichText::new(name).size(12.0).color(theme::dim(ui)))
            })
            .inner
        });
        add(ui, label.id)
    })
    .inner
}

/// A number with its unit.
pub(super) fn number(ui: &mut egui::Ui, label: egui::Id, value: &mut f64, speed: f64, suffix: &str) -> egui::Response {
    ui.add(egui::DragValue::new(value).speed(speed).max_decimals(3).suffix(suffix)).labelled_by(label)
}

/// A colour. It is only written where it was changed: on its way through other colour spaces it is rounded.
pub(super) fn color(ui: &mut egui::Ui, color: &mut [f32; 3]) -> egui::Response {
    let mut edited = *color;
    let response = ui.color_edit_button_rgb(&mut edited);
    if response.changed() {
        *color = edited;
    }
    response
}

/// Three numbers of a vector, in the colours of the axes.
pub(super) fn vector(ui: &mut egui::Ui, name: &str, v: &mut DVec3, speed: f64, suffix: &str) -> bool {
    let mut changed = false;
    row(ui, name, |ui, _| {
        ui.spacing_mut().item_spacing.x = 4.0;
        ui.spacing_mut().interact_size.x = 58.0;
        for (axis, c) in ["x", "y", "z"].into_iter().zip([&mut v.x, &mut v.y, &mut v.z]) {
            let response = ui.add(egui::DragValue::new(c).speed(speed).max_decimals(2).suffix(suffix));
            response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, format!("{name} {axis}")));
            changed |= response.changed();
        }
    });
    changed
}

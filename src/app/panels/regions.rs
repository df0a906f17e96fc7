//! Opacity by value and steepness: regions to drag over the joint histogram.

use std::sync::Arc;

use eframe::egui::{self, Color32, Pos2, Rect, Sense, Stroke as Line, TextureHandle, Vec2};
use egui_material_icons::icons;

use super::row;
use crate::app::menu::icon_button;
use crate::app::modeller::Modeller;
use crate::app::{tasks, theme};
use crate::evaluate::load::Data;
use crate::volume::joint::{COLUMNS, JointHistogram, ROWS};
use crate::volume::transfer::{MOST_REGIONS, Region, TransferFunction, height_of, steepness_at};

/// What the panel keeps of regions.
#[derive(Default)]
pub struct RegionState {
    /// Index of the region that is being edited.
    selected: Option<usize>,
    /// What a drag has hold of.
    held: Option<Part>,
    /// What opacity by the value alone took away, for the way back.
    put_away: Vec<Region>,
    /// The joint histogram as a picture, and of which.
    picture: Option<(TextureHandle, Arc<JointHistogram>)>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    Inside,
    Left,
    Right,
    Top,
    Bottom,
    Foot,
}

/// Nothing is made smaller than this, in parts of the plot.
const LEAST: f32 = 0.02;
/// How far from a handle one may press, in points.
const NEAR: f32 = 9.0;

pub fn show(m: &mut Modeller, ui: &mut egui::Ui, function: &mut TransferFunction, data: &Data, window: [f64; 2]) {
    row(ui, "Opacity by", |ui, _| {
        let on = !function.regions.is_empty();
        let state = &mut m.panels.regions;
        if ui.selectable_label(!on, "Value").on_hover_text("The curve alone").clicked() && on {
            state.put_away = std::mem::take(&mut function.regions);
        }
        let what = "Regions over value and gradient magnitude: borders of material apart from each other. The curve then gives \
                    only colours, and nothing is pre-integrated";
        if ui.selectable_label(on, "Value and steepness").on_hover_text(what).clicked() && !on {
            function.regions = std::mem::take(&mut state.put_away);
            if function.regions.is_empty() {
                function.regions.push(first(data, window));
            }
            state.selected = Some(0);
        }
    });
    if function.regions.is_empty() {
        return;
    }
    let count = function.regions.len();
    m.panels.regions.selected = m.panels.regions.selected.filter(|i| *i < count);
    count_pairs(m, ui);
    plot(m, ui, function, window);
    // below it, as what hovers would lie over it
    for hint in [
        "Across: the value. Up: how steeply it changes, by its root.",
        "Drag regions; double-click adds one, right click takes it away.",
    ] {
        ui.label(egui::RichText::new(hint).weak().size(11.0));
    }
    list(m, ui, function);
    if let Some(region) = m.panels.regions.selected.and_then(|i| function.regions.get_mut(i)) {
        numbers(ui, region, window);
    }
}

/// A region to begin with: borders of what stands out from the surroundings.
fn first(data: &Data, [lo, hi]: [f64; 2]) -> Region {
    let s = (((data.iso - lo) / (hi - lo)) as f32).clamp(0.1, 0.9);
    Region { value: [0.5 * s, 1.0], steepness: [0.01, 1.0], foot: 0.8, soft: 0.5, opacity: 0.3, color: None }
}

/// Asks for the joint histogram, once for each volume.
fn count_pairs(m: &mut Modeller, ui: &egui::Ui) {
    let Some(desk) = &m.desk else { return };
    if desk.joint.is_none() && !m.tasks.iter().any(|t| t.name == tasks::COUNTING) {
        m.tasks.push(tasks::joint(ui.ctx(), desk.data.clone()));
    }
}

/// Where values and heights lie on the screen.
#[derive(Clone, Copy)]
struct Axes {
    area: Rect,
    /// Height at the upper edge.
    top: f32,
}

impl Axes {
    fn x(&self, s: f32) -> f32 {
        self.area.left() + s * self.area.width()
    }

    fn y(&self, height: f32) -> f32 {
        self.area.bottom() - height / self.top * self.area.height()
    }

    fn value(&self, at: Pos2) -> f32 {
        ((at.x - self.area.left()) / self.area.width()).clamp(0.0, 1.0)
    }

    fn height(&self, at: Pos2) -> f32 {
        ((self.area.bottom() - at.y) / self.area.height() * self.top).clamp(0.0, self.top)
    }

    /// Left and right side of a region at a height.
    fn sides(region: &Region, height: f32) -> [f32; 2] {
        let [lo, hi] = region.value;
        let (middle, half) = (0.5 * (lo + hi), 0.5 * (hi - lo) * region.narrowing(height));
        // an open side is the border
        [if lo <= 0.0 { 0.0 } else { middle - half }, if hi >= 1.0 { 1.0 } else { middle + half }]
    }

    /// Heights of its lower and upper edge that can be seen.
    fn ends(&self, region: &Region) -> [f32; 2] {
        region.steepness.map(|g| height_of(g).min(self.top))
    }

    fn corners(&self, region: &Region) -> [Pos2; 4] {
        let [from, to] = self.ends(region);
        let ([a, b], [c, d]) = (Self::sides(region, from), Self::sides(region, to));
        [
            Pos2::new(self.x(a), self.y(from)),
            Pos2::new(self.x(b), self.y(from)),
            Pos2::new(self.x(d), self.y(to)),
            Pos2::new(self.x(c), self.y(to)),
        ]
    }

    fn handles(&self, region: &Region) -> [(Part, Pos2); 5] {
        let [a, b, c, d] = self.corners(region);
        // the foot has no say on an open side
        let foot = if region.value[1] < 1.0 { b } else { a };
        let between = |p: Pos2, q: Pos2| p + (q - p) * 0.5;
        [
            (Part::Left, d),
            (Part::Right, c),
            (Part::Top, between(c, d)),
            (Part::Bottom, between(a, b)),
            (Part::Foot, foot),
        ]
    }

    fn contains(&self, region: &Region, at: Pos2) -> bool {
        let height = (self.area.bottom() - at.y) / self.area.height() * self.top;
        let [from, to] = self.ends(region);
        let [a, b] = Self::sides(region, height);
        let s = (at.x - self.area.left()) / self.area.width();
        (from..=to).contains(&height) && (a..=b).contains(&s)
    }
}

fn plot(m: &mut Modeller, ui: &mut egui::Ui, function: &mut TransferFunction, window: [f64; 2]) {
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), 148.0), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Group, true, "Regions over value and steepness"));
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 4.0, theme::PLOT);
    let area = rect.shrink(8.0);
    let joint = m.desk.as_ref().and_then(|d| d.joint.clone());
    // how much steeper things are in parts of the window than of the whole range; heights go by the root
    let stretch = joint.as_ref().map_or(1.0, |j| (j.range[1] - j.range[0]) / (window[1] - window[0])).sqrt() as f32;
    let axes = Axes { area, top: joint.as_ref().map_or(1.0, |j| (highest(j) * stretch).clamp(0.1, 1.0)) };
    if let Some(joint) = joint {
        let texture = picture(&mut m.panels.regions, ui, &joint);
        let at = |v: f64| ((v - window[0]) / (window[1] - window[0])) as f32;
        let (lo, hi) = (axes.x(at(joint.range[0])), axes.x(at(joint.range[1])));
        let whole = Rect::from_min_max(Pos2::new(lo, axes.y(stretch)), Pos2::new(hi, area.bottom()));
        let uv = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
        ui.painter_at(area).image(texture, whole, uv, Color32::WHITE);
    } else {
        painter.text(
            area.center(),
            egui::Align2::CENTER_CENTER,
            "Counting…",
            egui::FontId::proportional(12.0),
            theme::PLOT_TEXT,
        );
    }
    touch(m, ui, &response, &axes, function);

    let clipped = ui.painter_at(area.expand(1.0));
    for (i, region) in function.regions.iter().enumerate() {
        let selected = m.panels.regions.selected == Some(i);
        let [r, g, b] = color_of(function, region).map(|c| (c * 255.0) as u8);
        let fill = Color32::from_rgb(r, g, b).gamma_multiply(0.12 + 0.4 * region.opacity);
        let line = if selected { theme::ACCENT } else { Color32::from_rgb(r, g, b) };
        let outline = Line::new(if selected { 2.0 } else { 1.0 }, line);
        clipped.add(egui::Shape::convex_polygon(axes.corners(region).to_vec(), fill, outline));
    }
    if let Some(region) = m.panels.regions.selected.and_then(|i| function.regions.get(i)) {
        for (part, at) in axes.handles(region) {
            let size = if part == Part::Foot { 3.5 } else { 4.5 };
            painter.circle(at, size, theme::ACCENT, Line::new(1.0, Color32::BLACK));
        }
    }
}

/// sRGB of a region: its own, or the curve's in its middle.
fn color_of(function: &TransferFunction, region: &Region) -> [f32; 3] {
    region.color.unwrap_or_else(|| {
        let [r, g, b, _] = function.classify(0.5 * (region.value[0] + region.value[1]));
        [r, g, b].map(|v| crate::volume::transfer::srgb_from_linear(v).clamp(0.0, 1.0))
    })
}

/// What the pointer does to regions.
fn touch(m: &mut Modeller, ui: &egui::Ui, response: &egui::Response, axes: &Axes, function: &mut TransferFunction) {
    let state = &mut m.panels.regions;
    let found = |regions: &[Region], selected: Option<usize>, at: Pos2| {
        let handles = selected.and_then(|i| regions.get(i)).map(|r| axes.handles(r));
        let near = handles.into_iter().flatten().filter(|(_, p)| p.distance(at) < NEAR);
        if let Some((part, _)) = near.min_by(|a, b| a.1.distance(at).total_cmp(&b.1.distance(at))) {
            return selected.map(|i| (i, part));
        }
        // the selected one lies on top
        let order = selected.into_iter().chain((0..regions.len()).rev());
        order.map(|i| (i, Part::Inside)).find(|(i, _)| regions.get(*i).is_some_and(|r| axes.contains(r, at)))
    };
    let press = ui.input(|i| i.pointer.press_origin());
    if response.drag_started()
        && let Some(at) = press
    {
        let hit = found(&function.regions, state.selected, at);
        // beside all of them the selected one stays, or the page would jump
        state.selected = hit.map(|h| h.0).or(state.selected);
        state.held = hit.map(|h| h.1);
    }
    let at = response.interact_pointer_pos();
    if response.clicked()
        && let Some((i, _)) = at.and_then(|at| found(&function.regions, state.selected, at))
    {
        state.selected = Some(i);
    }
    let hit = at.and_then(|at| found(&function.regions, state.selected, at));
    if response.double_clicked()
        && let (Some(at), None) = (at, hit)
        && function.regions.len() < MOST_REGIONS
    {
        function.regions.push(round(axes.value(at), axes.height(at), axes.top));
        state.selected = Some(function.regions.len() - 1);
    } else if response.secondary_clicked()
        && let Some((i, _)) = hit
        && function.regions.len() > 1
    {
        function.regions.remove(i);
        state.selected = Some(0);
    } else if response.dragged()
        && let (Some(region), Some(part), Some(at)) =
            (state.selected.and_then(|i| function.regions.get_mut(i)), state.held, at)
    {
        pull(region, part, axes, at, response.drag_delta());
    }
    if response.drag_stopped() {
        state.held = None;
        if let Some(desk) = &mut m.desk {
            desk.history.close_step();
        }
    }
}

/// A new region round a place.
fn round(s: f32, height: f32, top: f32) -> Region {
    let (lo, hi) = ((s - 0.1).clamp(0.0, 0.9), (s + 0.1).clamp(0.1, 1.0));
    let from = (height - 0.15 * top).clamp(0.0, 0.7 * top);
    let to = (height + 0.15 * top).max(from + 0.3 * top).min(1.0);
    let steepness = [steepness_at(from), steepness_at(to)];
    Region { value: [lo, hi], steepness, foot: 0.7, soft: 0.5, opacity: 0.3, color: None }
}

/// A part of a region follows the pointer.
fn pull(region: &mut Region, part: Part, axes: &Axes, at: Pos2, delta: Vec2) {
    let ([lo, hi], [from, to]) = (region.value, region.steepness.map(height_of));
    let (s, height) = (axes.value(at), axes.height(at));
    let least = LEAST * axes.top;
    // of the upper edge at the handles, which may be that of the plot
    let k = region.narrowing(to.min(axes.top));
    match part {
        Part::Inside => {
            let shift = (delta.x / axes.area.width()).clamp(-lo, 1.0 - hi);
            region.value = [lo + shift, hi + shift];
            // an open edge stays where it is
            let (down, up) = (if from > 0.0 { from } else { 0.0 }, if to < 1.0 { 1.0 - to } else { 1.0 });
            let shift = (-delta.y / axes.area.height() * axes.top).clamp(-down, up);
            let a = if from > 0.0 { from + shift } else { from };
            let b = if to < 1.0 { to + shift } else { to };
            if b.min(axes.top) - a >= least {
                region.steepness = [steepness_at(a), steepness_at(b)];
            }
        }
        Part::Left => {
            let edge = (s - 0.5 * hi * (1.0 - k)) * 2.0 / (1.0 + k);
            region.value[0] = if s <= 0.0 { 0.0 } else { edge.clamp(0.0, hi - LEAST) };
        }
        Part::Right => {
            let edge = (s - 0.5 * lo * (1.0 - k)) * 2.0 / (1.0 + k);
            region.value[1] = if s >= 1.0 { 1.0 } else { edge.clamp(lo + LEAST, 1.0) };
        }
        // beyond the plot there is no upper edge
        Part::Top => {
            let to = if height >= axes.top { 1.0 } else { height.max(from + least) };
            region.steepness[1] = steepness_at(to);
        }
        Part::Bottom => region.steepness[0] = steepness_at(height.min(to.min(axes.top) - least).max(0.0)),
        Part::Foot => region.foot = ((s - 0.5 * (lo + hi)).abs() / (0.5 * (hi - lo))).clamp(0.0, 1.0),
    }
}

/// Which region is edited, and another one or one less.
fn list(m: &mut Modeller, ui: &mut egui::Ui, function: &mut TransferFunction) {
    let state = &mut m.panels.regions;
    row(ui, "Region", |ui, _| {
        ui.spacing_mut().item_spacing.x = 4.0;
        // more are selected in the plot
        for i in 0..function.regions.len().min(5) {
            let response = ui.selectable_label(state.selected == Some(i), (i + 1).to_string());
            let name = format!("Region {}", i + 1);
            response.widget_info(|| {
                egui::WidgetInfo::selected(egui::Role::RadioButton, true, state.selected == Some(i), &name)
            });
            if response.on_hover_text(name).clicked() {
                state.selected = Some(i);
            }
        }
        if icon_button(ui, icons::ICON_ADD, "Add a region", function.regions.len() < MOST_REGIONS) {
            function.regions.push(round(0.5, 0.3, 1.0));
            state.selected = Some(function.regions.len() - 1);
        }
        let more = function.regions.len() > 1 && state.selected.is_some();
        if icon_button(ui, icons::ICON_DELETE, "Delete the region", more)
            && let Some(i) = state.selected.replace(0)
        {
            function.regions.remove(i);
        }
    });
}

/// The region that is selected, in numbers.
fn numbers(ui: &mut egui::Ui, region: &mut Region, [lo, hi]: [f64; 2]) {
    let named = |ui: &mut egui::Ui, drag: egui::DragValue<'_>, name: &str, what: &str| {
        let response = ui.add(drag);
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, name));
        response.on_hover_text(what).changed()
    };
    row(ui, "Values", |ui, _| {
        let what = "Where its upper edge begins and ends; at the ends of the window it is open";
        let [a, b] = region.value;
        let (least, width) = (f64::from(LEAST), hi - lo);
        for (i, name, ends) in [
            (0, "Region, lowest value", [0.0, f64::from(b) - least]),
            (1, "Region, highest value", [f64::from(a) + least, 1.0]),
        ] {
            let mut real = lo + f64::from(region.value[i]) * width;
            let drag = egui::DragValue::new(&mut real).speed(width / 500.0).max_decimals(4);
            if named(ui, drag, name, what) {
                region.value[i] = ((real - lo) / width).clamp(ends[0].max(0.0), ends[1].min(1.0)) as f32 + 0.0;
            }
        }
    });
    row(ui, "Steepness", |ui, _| {
        let what = "From and to, in parts of the window per voxel; 0 and 1 are open";
        let [from, to] = region.steepness;
        for (i, name, range) in [
            (0, "Region, lowest steepness", 0.0..=(to - 0.001).max(0.0)),
            (1, "Region, highest steepness", (from + 0.001).min(1.0)..=1.0),
        ] {
            let drag = egui::DragValue::new(&mut region.steepness[i]).speed(0.001).range(range).fixed_decimals(3);
            named(ui, drag, name, what);
        }
    });
    for (name, what, v) in [
        ("Foot", "Width of the lower edge: 0 makes a triangle, 1 a box", &mut region.foot),
        ("Softness", "How far from its sides the opacity goes on to rise", &mut region.soft),
        ("Opacity", "Of one voxel in its middle", &mut region.opacity),
    ] {
        row(ui, name, |ui, id| {
            ui.add(egui::Slider::new(v, 0.0..=1.0).fixed_decimals(2)).labelled_by(id).on_hover_text(what)
        });
    }
    row(ui, "Colour", |ui, _| {
        let mut own = region.color.is_some();
        if ui.checkbox(&mut own, "its own").on_hover_text("Else the curve gives the colour").changed() {
            region.color = own.then_some([0.9, 0.6, 0.3]);
        }
        if let Some(color) = &mut region.color {
            let response = super::color(ui, color);
            response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ColorWell, true, "Colour of the region"));
        }
    });
}

/// Height of the steepest bin that holds anything, with some room.
fn highest(joint: &JointHistogram) -> f32 {
    let row = joint.counts.chunks(COLUMNS).rposition(|row| row.iter().any(|c| *c > 0)).unwrap_or(0);
    1.1 * (row + 1) as f32 / ROWS as f32
}

/// The joint histogram, logarithmic, as a texture.
fn picture(state: &mut RegionState, ui: &egui::Ui, joint: &Arc<JointHistogram>) -> egui::TextureId {
    if let Some((texture, of)) = &state.picture
        && Arc::ptr_eq(of, joint)
    {
        return texture.id();
    }
    let scaled = |c: u64| (1.0 + c as f64).ln();
    let most = joint.counts.iter().map(|c| scaled(*c)).fold(1e-9, f64::max);
    let ink = Color32::from_gray(215);
    // the steepest row is the uppermost
    let rows = joint.counts.chunks(COLUMNS).rev();
    let pixels = rows.flatten().map(|c| ink.gamma_multiply((scaled(*c) / most) as f32)).collect();
    let image = egui::ColorImage::new([COLUMNS, ROWS], pixels);
    let texture = ui.ctx().load_texture("joint histogram", image, egui::TextureOptions::LINEAR);
    let id = texture.id();
    state.picture = Some((texture, joint.clone()));
    id
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> Axes {
        Axes { area: Rect::from_min_size(Pos2::new(10.0, 20.0), Vec2::new(300.0, 130.0)), top: 0.5 }
    }

    #[test]
    fn handles_follow_the_pointer() {
        let axes = axes();
        let closed =
            Region { value: [0.3, 0.6], steepness: [0.01, 0.09], foot: 0.5, soft: 0.5, opacity: 0.3, color: None };
        let open = Region { steepness: [0.01, 1.0], ..closed };
        for region in [closed, open] {
            for (part, at) in axes.handles(&region) {
                let mut moved = region;
                let way = Vec2::new(7.0, -6.0);
                pull(&mut moved, part, &axes, at + way, way);
                if part == Part::Top && region == open {
                    // there is nothing above
                    assert_eq!(moved, region);
                    continue;
                }
                assert!(moved != region && moved.value[0] < moved.value[1] && moved.steepness[0] < moved.steepness[1]);
                let now = axes.handles(&moved).into_iter().find(|h| h.0 == part).unwrap().1;
                match part {
                    Part::Top | Part::Bottom => assert!((now.y - at.y + 6.0).abs() < 0.1, "{part:?} {now} {at}"),
                    _ => assert!((now.x - at.x - 7.0).abs() < 0.1, "{part:?} {now} {at}"),
                }
            }
        }
    }

    #[test]
    fn a_region_that_is_pushed_against_a_border_keeps_its_size() {
        let axes = axes();
        let region = round(0.5, 0.25, 0.5);
        let mut moved = region;
        pull(&mut moved, Part::Inside, &axes, Pos2::ZERO, Vec2::new(900.0, 0.0));
        assert!((moved.value[1] - 1.0).abs() < 1e-6 && (moved.value[0] - 0.8).abs() < 1e-6);
        assert!((moved.steepness[1] - region.steepness[1]).abs() < 1e-6);
        pull(&mut moved, Part::Inside, &axes, Pos2::ZERO, Vec2::new(0.0, 900.0));
        assert_eq!(moved.steepness[0], 0.0);
        let size = |r: &Region| height_of(r.steepness[1]) - height_of(r.steepness[0]);
        assert!((size(&moved) - size(&region)).abs() < 1e-5);
        // a drag of the top beyond the plot opens it, and it stays open when it is moved
        pull(&mut moved, Part::Top, &axes, Pos2::new(100.0, 0.0), Vec2::ZERO);
        pull(&mut moved, Part::Inside, &axes, Pos2::ZERO, Vec2::new(-30.0, -10.0));
        assert!(moved.steepness[1] == 1.0 && moved.steepness[0] == 0.0);
    }
}

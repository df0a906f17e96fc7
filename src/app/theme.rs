//! Colours, spacing and fonts: neutral, dark or light, one accent.

use eframe::egui::{
    self, Color32, CornerRadius, FontFamily, FontId, Margin, Stroke, TextStyle, Theme, Vec2, Visuals,
    style::WidgetVisuals,
};

pub const ACCENT: Color32 = Color32::from_rgb(0xe8, 0xa3, 0x3d);
pub const ERROR: Color32 = Color32::from_rgb(0xe5, 0x53, 0x4b);
/// Ground and bars of plots, dark in both themes: the colours of materials are mostly bright.
pub const PLOT: Color32 = Color32::from_rgb(0x17, 0x19, 0x1c);
pub const PLOT_BAR: Color32 = Color32::from_rgb(0x2c, 0x30, 0x35);
/// Letters on them.
pub const PLOT_TEXT: Color32 = Color32::from_rgb(0x8b, 0x92, 0x99);
/// World x, y, z.
pub const AXES: [Color32; 3] =
    [Color32::from_rgb(0xe0, 0x55, 0x5b), Color32::from_rgb(0x7f, 0xb0, 0x4b), Color32::from_rgb(0x4b, 0x8b, 0xd6)];

pub const TOP_BAR: f32 = 36.0;
pub const TOOL_BAR: f32 = 44.0;
pub const STATUS_BAR: f32 = 24.0;
pub const INSPECTOR: f32 = 320.0;
/// Side of a tool's button.
pub const TOOL_BUTTON: f32 = 32.0;
pub const GAP: f32 = 4.0;

struct Palette {
    ground: Color32,
    panel: Color32,
    widget: Color32,
    hovered: Color32,
    line: Color32,
    /// Round widgets.
    edge: Color32,
    text: Color32,
    dim: Color32,
}

const DARK: Palette = Palette {
    ground: Color32::from_rgb(0x17, 0x19, 0x1c),
    panel: Color32::from_rgb(0x21, 0x24, 0x28),
    widget: Color32::from_rgb(0x2c, 0x30, 0x35),
    hovered: Color32::from_rgb(0x38, 0x3d, 0x43),
    line: Color32::from_rgb(0x33, 0x38, 0x3e),
    edge: Color32::from_rgb(0x2c, 0x30, 0x35),
    text: Color32::from_rgb(0xd9, 0xdc, 0xdf),
    dim: Color32::from_rgb(0x8b, 0x92, 0x99),
};

const LIGHT: Palette = Palette {
    ground: Color32::from_rgb(0xd4, 0xd7, 0xda),
    panel: Color32::from_rgb(0xec, 0xee, 0xf0),
    widget: Color32::from_rgb(0xdc, 0xdf, 0xe2),
    hovered: Color32::from_rgb(0xcd, 0xd1, 0xd5),
    line: Color32::from_rgb(0xc4, 0xc8, 0xcc),
    edge: Color32::from_rgb(0xb2, 0xb7, 0xbc),
    text: Color32::from_rgb(0x22, 0x26, 0x2a),
    dim: Color32::from_rgb(0x63, 0x6a, 0x71),
};

/// sRGB at the top and the bottom of the view where the document says nothing.
pub fn view_ground(dark: bool) -> [[f32; 3]; 2] {
    if dark { crate::render::Look::default().background } else { [[0.86, 0.875, 0.89], [0.70, 0.72, 0.745]] }
}

/// The accent for letters: on light panels darker, or they are hard to read.
pub fn accent_text(ui: &egui::Ui) -> Color32 {
    accent_on(if ui.visuals().dark_mode { Theme::Dark } else { Theme::Light })
}

fn accent_on(theme: Theme) -> Color32 {
    if theme == Theme::Dark { ACCENT } else { Color32::from_rgb(0x8f, 0x5a, 0x00) }
}

/// Text that is there but not loud.
pub fn dim(ui: &egui::Ui) -> Color32 {
    ui.visuals().weak_text_color()
}

/// Sets fonts and both themes.
pub fn install(ctx: &egui::Context) {
    egui_material_icons::initialize(ctx);
    for (theme, palette) in [(Theme::Dark, &DARK), (Theme::Light, &LIGHT)] {
        ctx.style_mut_of(theme, |style| {
            style.visuals = visuals(theme, palette);
            let size = |s| FontId::new(s, FontFamily::Proportional);
            style.text_styles = [
                (TextStyle::Small, size(11.0)),
                (TextStyle::Body, size(13.0)),
                (TextStyle::Button, size(13.0)),
                (TextStyle::Heading, size(15.0)),
                (TextStyle::Monospace, FontId::new(12.0, FontFamily::Monospace)),
            ]
            .into();
            style.drag_value_text_style = TextStyle::Monospace;
            let spacing = &mut style.spacing;
            spacing.item_spacing = Vec2::new(8.0, 4.0);
            spacing.button_padding = Vec2::new(8.0, 4.0);
            spacing.interact_size = Vec2::new(40.0, 24.0);
            spacing.menu_margin = Margin::same(8);
            spacing.window_margin = Margin::same(16);
            spacing.indent = 12.0;
            spacing.slider_width = 104.0;
            spacing.combo_width = 120.0;
            style.interaction.selectable_labels = false;
            style.interaction.tooltip_delay = 0.4;
        });
    }
}

fn visuals(theme: Theme, p: &Palette) -> Visuals {
    let mut v = if theme == Theme::Dark { Visuals::dark() } else { Visuals::light() };
    let round = CornerRadius::same(4);
    let widget = |fill: Color32, line: Color32, text: Color32| WidgetVisuals {
        bg_fill: fill,
        weak_bg_fill: fill,
        bg_stroke: Stroke::new(1.0, line),
        corner_radius: round,
        fg_stroke: Stroke::new(1.0, text),
        expansion: 0.0,
    };
    v.widgets.noninteractive = widget(p.panel, p.line, p.text);
    // on a light panel a box that is not ticked is hardly seen but by its line
    v.widgets.inactive = widget(p.widget, p.edge, p.text);
    v.widgets.hovered = widget(p.hovered, p.hovered, p.text);
    v.widgets.active = widget(p.hovered, ACCENT, p.text);
    v.widgets.open = widget(p.hovered, p.hovered, p.text);
    v.selection.bg_fill = ACCENT.gamma_multiply(0.55);
    v.selection.stroke = Stroke::new(1.0, if theme == Theme::Dark { Color32::WHITE } else { p.text });
    v.hyperlink_color = accent_on(theme);
    v.weak_text_color = Some(p.dim);
    v.panel_fill = p.panel;
    v.window_fill = p.panel;
    v.window_stroke = Stroke::new(1.0, p.line);
    v.extreme_bg_color = p.ground;
    v.faint_bg_color = p.widget;
    v.error_fg_color = ERROR;
    v.warn_fg_color = accent_on(theme);
    v.window_corner_radius = CornerRadius::same(8);
    v.menu_corner_radius = CornerRadius::same(4);
    v.slider_trailing_fill = true;
    v
}

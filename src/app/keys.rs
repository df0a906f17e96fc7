//! The keyboard.

use eframe::egui::{self, Key, Modifiers};

use super::modeller::Modeller;
use super::navigate::{self, Standard};
use super::panels::{self, Pane};
use super::sculpt::Tool;
use super::state::{After, Doing, FIRST, Layout, Question};
use super::view;
use crate::evaluate::picture::Mode;
use crate::scene::Edit;

/// What the help lists: group, key, what it does.
pub const MAP: &[(&str, &str, &str)] = &[
    ("Tools", "G D P I T S L", "grab, push, pinch, inflate, twist, smooth, lattice"),
    ("Tools", "O V R", "place the shape, pick a value, measure"),
    ("Tools", "F, Shift F", "radius, strength: move, then click"),
    ("Tools", "[ ]", "radius smaller, larger"),
    ("Tools", "X Y Z", "mirror across the middle"),
    ("Tools", "Esc", "give up the stroke"),
    ("View", "Middle, Alt Left", "orbit; with Shift pan"),
    ("View", "Wheel", "zoom to the pointer; with Ctrl the radius"),
    ("View", "Home", "frame all"),
    ("View", "Ctrl 1 3 7", "front, right, top; Shift: back, left, bottom"),
    ("View", "Pad 1 3 7", "the same, without Num Lock"),
    ("View", "5", "perspective or parallel"),
    ("View", "1 2 3 4", "slicing, exact, tets, surface"),
    ("View", "A", "compare with another mode or the original"),
    ("View", "W", "tessellation of a slice"),
    ("View", "K, J", "tetrahedra; growth and folds"),
    ("View", "Tab", "texture cube"),
    ("View", "M", "slices along the axes"),
    ("View", "H", "overlays"),
    ("View", "Space", "play the steps of a series, or pause"),
    ("View", "Left, Right", "the step before, the next"),
    ("View", "F12", "times of the window's steps"),
    ("Work", "Ctrl Z, Ctrl Shift Z", "undo, redo"),
    ("Work", "Ctrl N O S, Ctrl Shift S", "new, open, save, save as"),
    ("Work", "Ctrl E", "export"),
    ("Work", "Ctrl P", "picture"),
    ("Work", "Ctrl C, Ctrl V", "copy, paste the stack"),
    ("Work", "Ctrl Q", "quit"),
    ("Work", "?", "this map"),
];

pub fn handle(m: &mut Modeller, ctx: &egui::Context) {
    if m.question.is_some() {
        if ctx.input(|i| i.key_pressed(Key::Escape)) && m.question != Some(Question::Recover) {
            m.question = None;
        }
        return;
    }
    if ctx.egui_wants_keyboard_input() {
        return;
    }
    // the event's own modifiers count: Shift may be up again by the end of the pass. With Shift comes first, as a pattern
    // without it matches both
    let ctrl = |key: Key, shift: bool| {
        let modifiers = if shift { Modifiers::COMMAND | Modifiers::SHIFT } else { Modifiers::COMMAND };
        ctx.input_mut(|i| i.consume_key(modifiers, key))
    };
    if ctrl(Key::Z, true) || ctrl(Key::Y, false) {
        m.redo();
    }
    if ctrl(Key::Z, false) {
        m.undo();
    }
    if ctrl(Key::S, true) {
        m.ask_save_as(After::Nothing);
    }
    if ctrl(Key::S, false) {
        m.save(ctx, After::Nothing);
    }
    if ctrl(Key::O, false) {
        m.question = Some(Question::Open { word: String::new(), wrong: None });
    }
    if ctrl(Key::N, false) {
        m.open(ctx, FIRST);
    }
    if ctrl(Key::E, false) {
        panels::open(&mut m.tree, Pane::Export);
    }
    if ctrl(Key::P, false) {
        m.ask_screenshot();
    }
    if ctrl(Key::Q, false) {
        m.quit(ctx);
    }
    // egui turns these into events of their own
    let (copied, pasted) = ctx.input(|i| {
        let has = |f: fn(&egui::Event) -> bool| i.events.iter().any(f);
        (
            has(|e| matches!(e, egui::Event::Copy)),
            i.events.iter().find_map(|e| match e {
                egui::Event::Paste(text) => Some(text.clone()),
                _ => None,
            }),
        )
    });
    if copied {
        panels::deform::copy(m, ctx);
    }
    if let Some(text) = pasted {
        panels::deform::paste(m, &text);
    }
    let command = ctx.input(|i| i.modifiers.command);
    let shift = ctx.input(|i| i.modifiers.shift);
    let pressed = |key: Key| ctx.input(|i| i.key_pressed(key));
    // without Num Lock, the numeric pad sends other keys from the places of its digits
    let pad = ctx.input(|i| {
        i.events.iter().find_map(|e| match e {
            egui::Event::Key {
                key: Key::End | Key::PageDown | Key::Home,
                physical_key: Some(digit @ (Key::Num1 | Key::Num3 | Key::Num7)),
                pressed: true,
                ..
            } => Some(*digit),
            _ => None,
        })
    });
    standard_views(m, &pressed, pad, command, shift);
    if command {
        return;
    }
    for tool in Tool::ALL {
        if Key::from_name(tool.key()).is_some_and(pressed) {
            m.set_tool(tool);
        }
    }
    for (axis, key) in [Key::X, Key::Y, Key::Z].into_iter().enumerate() {
        if pressed(key) {
            m.hand.mirror[axis] = !m.hand.mirror[axis];
        }
    }
    if pressed(Key::F) {
        let from = ctx.input(|i| i.pointer.latest_pos()).map_or(0.0, |p| p.x);
        m.doing = if shift {
            Doing::Strength { start: m.hand.strength, from }
        } else {
            Doing::Radius { start: m.hand.radius, from }
        };
    }
    for (key, factor) in [(Key::OpenBracket, 1.0 / 1.1), (Key::CloseBracket, 1.1)] {
        if pressed(key) {
            m.hand.radius *= factor;
        }
    }
    if pressed(Key::Escape) {
        match m.doing {
            Doing::Radius { start, .. } => m.hand.radius = start,
            Doing::Strength { start, .. } => m.hand.strength = start,
            _ => {}
        }
        m.cancel_stroke();
        m.measure.clear();
    }
    for (key, mode) in [
        (Key::Num1, Mode::Slicing),
        (Key::Num2, Mode::SlicingExact),
        (Key::Num3, Mode::Tets),
        (Key::Num4, Mode::Spline),
    ] {
        if pressed(key) {
            m.view.mode = mode;
        }
    }
    if pressed(Key::A) {
        m.view.compare = !m.view.compare;
        m.view.layout = if shift { Layout::SideBySide } else { m.view.layout };
    }
    if pressed(Key::W) {
        m.view.tessellation = !m.view.tessellation;
    }
    if pressed(Key::K) {
        m.view.tets = !m.view.tets;
    }
    if pressed(Key::J) {
        m.view.heat = !m.view.heat;
    }
    if ctx.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Tab)) {
        m.view.cube = !m.view.cube;
        // it is not for the next widget; where one has the focus already, this is not reached
        m.tabbed = true;
    }
    // with the focus on a widget they are for it
    if m.steps() > 1 && ctx.memory(|memory| memory.focused().is_none()) {
        if pressed(Key::Space) {
            m.player.playing = !m.player.playing;
        }
        for (key, by) in [(Key::ArrowLeft, -1), (Key::ArrowRight, 1)] {
            if pressed(key) {
                m.player.playing = false;
                m.move_step(by);
            }
        }
    }
    if pressed(Key::M) {
        panels::toggle(&mut m.tree, Pane::Slices);
    }
    if pressed(Key::H) {
        m.view.overlays = !m.view.overlays;
    }
    if pressed(Key::F12) {
        m.show_trace = !m.show_trace;
    }
    if pressed(Key::Questionmark) || (shift && pressed(Key::Slash)) {
        m.question = Some(Question::Keys);
    }
}

fn standard_views(m: &mut Modeller, pressed: &dyn Fn(Key) -> bool, pad: Option<Key>, command: bool, shift: bool) {
    let Some(scene) = view::scene(m) else { return };
    let mut to = None;
    if pressed(Key::Home) && pad.is_none() {
        to = Some(navigate::frame(&scene.spec));
    }
    let views = [
        (Key::Num1, Standard::Front, Standard::Back),
        (Key::Num3, Standard::Right, Standard::Left),
        (Key::Num7, Standard::Top, Standard::Bottom),
    ];
    for (key, plain, other) in views {
        // the digits alone are modes: those of the numeric pad cannot be told apart while Num Lock is on
        if pressed(key) && command {
            to = Some(if shift { other } else { plain }.of(&scene.spec));
        } else if pad == Some(key) {
            to = Some(if command { other } else { plain }.of(&scene.spec));
        }
    }
    if pressed(Key::Num5) {
        let fov_y = match scene.spec.fov_y {
            Some(_) => None,
            None => Some(28.0),
        };
        to = Some(crate::scene::CameraSpec { fov_y, ..scene.spec });
    }
    if let Some(camera) = to {
        m.edit(Edit::SetCamera(camera));
    }
}

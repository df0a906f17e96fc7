//! A modeller in a window without a screen, for tests that drive it.

use std::path::Path;
use std::time::{Duration, Instant};

use eframe::egui::{self, Key, Modifiers};
use egui_kittest::Harness;
use voxclay::app::settings::Home;
use voxclay::app::{Modeller, Start};
use voxclay::evaluate::picture::Backend;

pub type Bench = Harness<'static, Option<Modeller>>;

/// A modeller on `word`, with a home of its own, its object ready.
pub fn modeller(word: &str, home: &Path) -> Bench {
    let start = Start { files: vec![word.to_owned()], backend: Backend::Cpu, home: Home::at(home) };
    let mut h = Harness::builder().with_size([1200.0, 800.0]).with_step_dt(1.0 / 60.0).build_ui_state(
        move |ui: &mut egui::Ui, m: &mut Option<Modeller>| {
            m.get_or_insert_with(|| Modeller::new(ui.ctx(), start.clone())).ui(ui);
        },
        None,
    );
    until(&mut h, "the object", |m| m.desk.as_ref().is_some_and(|d| d.object.is_some()));
    h
}

pub fn m(h: &mut Bench) -> &mut Modeller {
    h.state_mut().as_mut().unwrap()
}

/// Passes of the interface until something is so.
pub fn until(h: &mut Bench, what: &str, so: impl Fn(&Modeller) -> bool) {
    let started = Instant::now();
    loop {
        h.step();
        if h.state().as_ref().is_some_and(&so) {
            return;
        }
        assert!(started.elapsed() < Duration::from_secs(120), "{what} did not come");
        std::thread::sleep(Duration::from_millis(4));
    }
}

/// Presses a key, and lets the window see it.
pub fn key(h: &mut Bench, modifiers: Modifiers, key: Key) {
    h.key_press_modifiers(modifiers, key);
    h.step();
    h.step();
}

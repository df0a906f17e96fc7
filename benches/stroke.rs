//! Latency of a stroke in the modeller: a 256^3 head in its hull, ten displacement volumes on it, one more being pulled.
//!
//! Prints medians, 95th percentiles and the worst of each kind of step, in milliseconds. `stroke event` is the work of one
//! moved event on the window's thread, `interface pass` a whole pass of the window, `slices` and `picture, moving` the
//! worker's, `latency` from the request to the picture.

use std::time::{Duration, Instant};

use eframe::egui::{self, Modifiers, PointerButton, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::DVec3;
use voxclay::app::settings::Home;
use voxclay::app::trace::Trace;
use voxclay::app::{Modeller, Start};
use voxclay::deform::{Deformation, Deformer, DisplacementVolume};
use voxclay::evaluate::picture::Backend;
use voxclay::scene::{Edit, ProxySource};

fn main() {
    let home = std::env::temp_dir().join(format!("voxclay-bench-{}", std::process::id()));
    let start = Start { files: vec!["phantom:head:256".to_owned()], backend: Backend::Auto, home: Home::at(&home) };
    let mut h = Harness::builder().with_size([1360.0, 860.0]).with_step_dt(1.0 / 60.0).build_ui_state(
        move |ui: &mut egui::Ui, m: &mut Option<Modeller>| {
            m.get_or_insert_with(|| Modeller::new(ui.ctx(), start.clone())).ui(ui);
        },
        None,
    );
    let until = |h: &mut Harness<'static, Option<Modeller>>, so: &dyn Fn(&Modeller) -> bool| {
        let started = Instant::now();
        while !h.state().as_ref().is_some_and(so) && started.elapsed() < Duration::from_secs(120) {
            h.step();
            std::thread::sleep(Duration::from_millis(4));
        }
    };
    until(&mut h, &|m| m.desk.as_ref().is_some_and(|d| d.object.is_some()));
    if let Some(m) = h.state_mut() {
        m.edit(Edit::SetProxy(ProxySource::Auto { iso: None }));
        let (center, radius) = m.desk.as_ref().map_or((DVec3::ZERO, 1.0), |d| d.data.focus);
        let items = (0..10)
            .filter_map(|i| {
                let a = f64::from(i) * 0.628;
                let at = center + radius * DVec3::new(0.5 * a.cos(), 0.5 * a.sin(), 0.4 - 0.08 * f64::from(i));
                let pull = radius * 0.08 * DVec3::new(a.sin(), a.cos(), 0.5);
                DisplacementVolume::from_drag(at, pull, 0.3 * radius).ok()
            })
            .map(|d| Deformation::new("", Deformer::Displacement(d)))
            .collect();
        m.edit(Edit::Push(items));
    }
    until(&mut h, &|m| {
        m.shown.as_ref().is_some_and(|s| s.last)
            && m.desk
                .as_ref()
                .and_then(|d| d.object.as_ref())
                .is_some_and(|(_, o)| o.shaped && o.stack.items.len() == 10)
    });
    let triangles = h.state().as_ref().and_then(|m| Some(m.desk.as_ref()?.object.as_ref()?.1.mesh.triangles.len()));
    let at = h.get_by_label("Main view").rect().center() + Vec2::new(0.0, 40.0);
    if let Some(m) = h.state_mut() {
        m.trace = Trace::default();
    }
    let press = |pressed, pos| egui::Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    h.event(press(true, at));
    h.step();
    let mut pos = at;
    for i in 0..300 {
        let a = i as f32 * 0.05;
        pos = at + 60.0 * Vec2::new(a.sin(), 1.0 - a.cos());
        h.event(egui::Event::PointerMoved(pos));
        h.step();
        // a mouse that reports at 60 Hz
        std::thread::sleep(Duration::from_millis(12));
    }
    h.event(press(false, pos));
    h.step();
    until(&mut h, &|m| m.shown.as_ref().is_some_and(|s| s.last && !s.moving));
    println!("head 256^3, hull of {} triangles, 10 displacement volumes", triangles.unwrap_or(0));
    println!("{:<18} {:>8} {:>8} {:>8} {:>6}", "ms", "median", "95 %", "worst", "count");
    let Some(m) = h.state() else { return };
    for (name, series) in m.trace.rows() {
        let ms = |q: f32| series.quantile(q).unwrap_or(f32::NAN);
        println!("{name:<18} {:>8.2} {:>8.2} {:>8.2} {:>6}", ms(0.5), ms(0.95), series.worst, series.count);
    }
    if let Some(shown) = &m.shown {
        println!("drawn by {}", shown.report.device);
    }
    let _ = std::fs::remove_dir_all(home);
}

//! Latency of a stroke in the modeller: a 256^3 head in a mesh, ten displacement volumes on it, one more being pulled.
//!
//! The mesh is a bumpy sphere of 5120 triangles; with `hull` as an argument it is the head's own hull.
//!
//! Prints medians, 95th percentiles and the worst of each kind of step, in milliseconds. `stroke event` is the work of one
//! moved event on the window's thread, `interface pass` a whole pass of the window, `slices` and `picture, moving` the
//! worker's, `latency` from the request to the picture. Below that, the memory that all threads asked for between the first and
//! the last moved event. Then the same with the smooth surface.

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use eframe::egui::{self, Modifiers, PointerButton, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::DVec3;
use voxclay::app::settings::Home;
use voxclay::app::trace::Trace;
use voxclay::app::{Modeller, Start};
use voxclay::deform::{Deformation, Deformer, DisplacementVolume};
use voxclay::evaluate::picture::{Backend, Mode};
use voxclay::io::write_surface;
use voxclay::mesh::primitives;
use voxclay::scene::{Edit, ProxySource};

/// The system's allocator, which notes what is asked for while it is told to.
struct Counting;

static ON: AtomicBool = AtomicBool::new(false);
static BYTES: AtomicUsize = AtomicUsize::new(0);
static LARGEST: AtomicUsize = AtomicUsize::new(0);

fn count(size: usize) {
    if ON.load(Ordering::Relaxed) {
        BYTES.fetch_add(size, Ordering::Relaxed);
        LARGEST.fetch_max(size, Ordering::Relaxed);
    }
}

// SAFETY: every call is handed on to the system's allocator as it came
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        unsafe { System.dealloc(block, layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size);
        unsafe { System.realloc(block, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const EVENTS: usize = 300;

type Window = Harness<'static, Option<Modeller>>;

fn until(h: &mut Window, so: &dyn Fn(&Modeller) -> bool) {
    let started = Instant::now();
    while !h.state().as_ref().is_some_and(so) && started.elapsed() < Duration::from_secs(120) {
        h.step();
        std::thread::sleep(Duration::from_millis(4));
    }
}

fn rested(m: &Modeller) -> bool {
    m.shown.as_ref().is_some_and(|s| s.last && !s.moving)
}

/// What a stroke took.
struct Pull {
    /// Bytes that were asked for in all, for one event, and the largest block of each event, ascending.
    bytes: usize,
    largest: Vec<usize>,
    /// Slices of the coarse pictures, and the part of the resolution.
    coarse: Vec<(usize, f32)>,
}

/// Pulls what lies at a place around in circles, and lets go.
fn pull(h: &mut Window, at: egui::Pos2) -> Pull {
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
    let mut largest = Vec::with_capacity(EVENTS);
    let mut coarse = Vec::with_capacity(EVENTS);
    BYTES.store(0, Ordering::Relaxed);
    for i in 0..EVENTS {
        let a = i as f32 * 0.05;
        pos = at + 60.0 * Vec2::new(a.sin(), 1.0 - a.cos());
        h.event(egui::Event::PointerMoved(pos));
        h.step();
        // a mouse that reports at 60 Hz
        std::thread::sleep(Duration::from_millis(12));
        if let Some(shown) = h.state().as_ref().and_then(|m| m.shown.as_ref()).filter(|s| s.moving) {
            coarse.push((shown.report.slices, shown.scale));
        }
        // the first event makes what the stroke needs
        if i > 0 {
            largest.push(LARGEST.swap(0, Ordering::Relaxed));
        }
        ON.store(true, Ordering::Relaxed);
    }
    ON.store(false, Ordering::Relaxed);
    let bytes = BYTES.load(Ordering::Relaxed) / largest.len();
    h.event(press(false, pos));
    h.step();
    until(h, &rested);
    largest.sort_unstable();
    Pull { bytes, largest, coarse }
}

fn print(h: &Window, name: &str, pull: &Pull) {
    let Pull { bytes, largest, coarse } = pull;
    println!("\n{name}");
    if let (Some(few), Some(many)) = (coarse.iter().map(|c| c.0).min(), coarse.iter().map(|c| c.0).max()) {
        let scales = || coarse.iter().map(|c| c.1);
        let (small, large) = (scales().fold(1.0, f32::min), scales().fold(0.0, f32::max));
        let slices = if many > 0 { format!("{few} to {many} slices, ") } else { String::new() };
        println!("coarse pictures of {slices}{small:.2} to {large:.2} of the resolution");
    }
    println!("{:<18} {:>8} {:>8} {:>8} {:>6}", "ms", "median", "95 %", "worst", "count");
    let Some(m) = h.state() else { return };
    for (name, series) in m.trace.rows() {
        let ms = |q: f32| series.quantile(q).unwrap_or(f32::NAN);
        println!("{name:<18} {:>8.2} {:>8.2} {:>8.2} {:>6}", ms(0.5), ms(0.95), series.worst, series.count);
    }
    let kib = |bytes: usize| bytes as f64 / 1024.0;
    let volume = m.desk.as_ref().map_or(0, |d| d.data.volume.samples.bytes().len());
    println!(
        "memory asked for, KiB: {:.0} an event; largest block, median of the events {:.0}, worst {:.0}; the volume has {:.0}",
        kib(*bytes),
        kib(largest[largest.len() / 2]),
        kib(largest[largest.len() - 1]),
        kib(volume),
    );
    if let Some(shown) = &m.shown {
        println!("drawn by {}", shown.report.device);
    }
}

/// A mesh with dents and bumps around what the window shows.
fn bumpy(m: &Modeller, folder: &Path) -> Option<ProxySource> {
    let (center, radius) = m.desk.as_ref()?.data.focus;
    let mut mesh = primitives::bumpy_sphere(16);
    let reach = mesh.positions.iter().map(|p| p.length()).fold(0.0, f64::max);
    mesh.positions.iter_mut().for_each(|p| *p = center + *p * (radius / reach));
    std::fs::create_dir_all(folder).ok()?;
    let file = folder.join("bumpy.obj");
    write_surface(&file, &mesh).ok()?;
    Some(ProxySource::Mesh(file))
}

fn main() {
    let home = std::env::temp_dir().join(format!("voxclay-bench-{}", std::process::id()));
    let start = Start { files: vec!["phantom:head:256".to_owned()], backend: Backend::Auto, home: Home::at(&home) };
    let mut h = Harness::builder().with_size([1360.0, 860.0]).with_step_dt(1.0 / 60.0).build_ui_state(
        move |ui: &mut egui::Ui, m: &mut Option<Modeller>| {
            m.get_or_insert_with(|| Modeller::new(ui.ctx(), start.clone())).ui(ui);
        },
        None,
    );
    until(&mut h, &|m| m.desk.as_ref().is_some_and(|d| d.object.is_some()));
    let hull = std::env::args().any(|a| a == "hull");
    if let Some(m) = h.state_mut() {
        let source = if hull { Some(ProxySource::Auto { iso: None }) } else { bumpy(m, &home) };
        m.edit(Edit::SetProxy(source.unwrap_or_default()));
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
    println!("head 256^3, mesh of {} triangles, 10 displacement volumes", triangles.unwrap_or(0));
    let slices = pull(&mut h, at);
    print(&h, "slices", &slices);
    if let Some(m) = h.state_mut() {
        m.view.mode = Mode::Spline;
    }
    until(&mut h, &|m| rested(m) && m.shown.as_ref().is_some_and(|s| s.report.slices == 0));
    // what the next stroke needs is made behind that picture
    std::thread::sleep(Duration::from_secs(1));
    let surface = pull(&mut h, at);
    print(&h, "smooth surface", &surface);
    let _ = std::fs::remove_dir_all(home);
}

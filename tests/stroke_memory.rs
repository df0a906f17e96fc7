//! While the hand moves, nothing as large as the volume is asked for: neither a copy of it nor a picture for each slice.

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use voxclay::deform::{Deformation, Deformer, DisplacementVolume};
use voxclay::evaluate::load::Workspace;
use voxclay::evaluate::picture::{Backend, Mode, Refinement, Renderer, ViewOptions};
use voxclay::scene::{Document, ProxySource, VolumeSource};

/// The largest block that was asked for, in bytes.
static LARGEST: AtomicUsize = AtomicUsize::new(0);

struct Watching;

// SAFETY: every call is handed on to the system's allocator as it came
unsafe impl GlobalAlloc for Watching {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        unsafe { System.dealloc(block, layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        LARGEST.fetch_max(size, Ordering::Relaxed);
        unsafe { System.realloc(block, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Watching = Watching;

#[test]
fn a_stroke_asks_for_no_block_of_the_size_of_the_volume() {
    let mut document = Document::new(VolumeSource::Phantom { name: "sphere".into(), size: 160 });
    document.proxy = ProxySource::Auto { iso: None };
    let mut workspace = Workspace::new(Path::new(""));
    let object = workspace.object(&document).unwrap();
    let (center, radius) = object.focus;
    let volume = object.volume.samples.bytes().len();
    assert!(LARGEST.load(Ordering::Relaxed) >= volume, "the allocator does not watch");
    let camera = object.camera(&document.camera);
    let look = document.look.look(object.iso);
    let mut renderer = Renderer::new(Backend::Cpu).unwrap();
    let options = ViewOptions {
        size: (240, 200),
        slices: Some(64),
        mode: Mode::Slicing,
        refinement: Refinement::Draft,
        backend: Backend::Cpu,
        transparent: false,
        corrections: None,
    };
    for i in 0..8 {
        let pull = radius * DVec3::new(0.1, 0.0, 0.02 * f64::from(i));
        let at = center + 0.5 * radius * camera.to_eye();
        let item = DisplacementVolume::from_drag(at, pull, 0.4 * radius).unwrap();
        document.stack.items =
            vec![Deformation { moves_shape: true, ..Deformation::new("pull", Deformer::Displacement(item)) }];
        LARGEST.store(0, Ordering::Relaxed);
        let object = workspace.object(&document).unwrap();
        let (_, report) = renderer.picture(&object, &camera, &look, &options).unwrap();
        let largest = LARGEST.load(Ordering::Relaxed);
        assert!(report.triangles > 5000);
        assert!(largest < volume / 2, "event {i}: a block of {largest} bytes, the volume has {volume}");
    }
}

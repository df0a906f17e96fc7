//! Refinement keeps its buffers: once they have grown, a slice costs no memory.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use glam::{DAffine3, DVec3};
use voxclay::deform::{Deformation, Deformer, DisplacementVolume, Stack};
use voxclay::subdivide::{Corner, NextSlice, Refiner, Rule, Supports, Texturing, corners};

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is handed on to the system's allocator as it came
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|c| c.set(c.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, p: *mut u8, layout: Layout) {
        unsafe { System.dealloc(p, layout) }
    }

    unsafe fn realloc(&self, p: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        COUNT.with(|c| c.set(c.get() + 1));
        unsafe { System.realloc(p, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_slice_costs_no_memory_once_the_buffers_have_grown() {
    let volume = DisplacementVolume::from_drag(DVec3::ZERO, DVec3::new(3.0, 1.0, 2.0), 12.0).unwrap();
    let map = Stack { items: vec![Deformation::new("", Deformer::Displacement(volume))] }.prepared();
    let supports = Supports::new(&map, Some(map.feature_size()));
    let blocks = map.blocks::<f32>(DVec3::ZERO);
    let texture = DAffine3::from_scale(DVec3::splat(0.01));
    let texturing = Texturing::new(&texture, Some(NextSlice::parallel(DVec3::NEG_Z)), DVec3::ZERO);
    let points = [DVec3::new(-30.0, -30.0, 1.0), DVec3::new(30.0, -30.0, 1.0), DVec3::new(0.0, 40.0, 1.0)];
    let mut refiner = Refiner::default();
    let mut vertices: Vec<Corner> = Vec::new();
    let mut indices: Vec<[u32; 3]> = Vec::new();
    for rule in [Rule::uniform(3), Rule::within(0.05, 10, &texture, DVec3::splat(128.0))] {
        let mut slice = || {
            vertices.clear();
            indices.clear();
            refiner.refine(points, &[[0, 1, 2]], &map, &supports, &rule);
            indices.extend_from_slice(refiner.triangles());
            corners(refiner.positions(), &blocks, &texturing, true, |c| vertices.push(c));
        };
        let before = COUNT.with(Cell::get);
        // buffers change places, so each grows within a few slices
        (0..4).for_each(|_| slice());
        let first = COUNT.with(Cell::get) - before;
        (0..5).for_each(|_| slice());
        assert!(first > 0, "the counter does not count");
        assert_eq!(COUNT.with(Cell::get) - before - first, 0);
        assert!(indices.len() > 3);
    }
}

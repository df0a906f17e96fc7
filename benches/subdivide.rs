//! The paper's load: 6K triangles of slices inside displacement volumes, refined to 96K, on one core.
//!
//! `cargo bench --bench subdivide`

use std::time::Instant;

use glam::{DAffine3, DMat3, DVec3};
use voxclay::deform::{Deformation, Deformer, DisplacementVolume, Extent, Prepared, Stack};
use voxclay::math::{BackwardMap, Block, BlockMap};
use voxclay::subdivide::{Corner, NextSlice, Refiner, Rule, Supports, Texturing, corners};

const SLICES: usize = 60;
/// Cells of a slice along both sides: 2 * 5 * 10 triangles.
const CELLS: (usize, usize) = (5, 10);

/// A slice as triangles; all of it displaced.
fn slice(k: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (nx, ny) = CELLS;
    let height = k as f64 / SLICES as f64 * 40.0 - 20.0;
    let points = (0..=ny)
        .flat_map(|j| (0..=nx).map(move |i| (i, j)))
        .map(|(i, j)| {
            let jitter = ((i * 7 + j * 13 + k) % 5) as f64 * 0.1;
            DVec3::new(i as f64 * 40.0 / nx as f64 - 20.0 + jitter, j as f64 * 40.0 / ny as f64 - 20.0 - jitter, height)
        })
        .collect();
    let at = |i: usize, j: usize| (j * (nx + 1) + i) as u32;
    let triangles = (0..ny)
        .flat_map(|j| (0..nx).map(move |i| (i, j)))
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
        .collect();
    (points, triangles)
}

fn volumes(n: usize) -> Prepared {
    let extent = Extent { u: 60.0, v: 60.0, length: 180.0 };
    let item = |i: usize| {
        let a = i as f64;
        let vector = DVec3::new(a.cos(), a.sin(), 0.4) * 9.0;
        let volume = DisplacementVolume::new(DVec3::new(a, -a, 0.0), vector, extent, None).expect("a sound volume");
        Deformation::new("stroke", Deformer::Displacement(volume))
    };
    Stack { items: (0..n).map(item).collect() }.prepared()
}

/// Median and least of repeated runs, in seconds.
fn time(mut f: impl FnMut()) -> (f64, f64) {
    f();
    let mut runs: Vec<f64> = (0..25)
        .map(|_| {
            let start = Instant::now();
            f();
            start.elapsed().as_secs_f64()
        })
        .collect();
    runs.sort_unstable_by(f64::total_cmp);
    (runs[runs.len() / 2], runs[0])
}

fn row(name: &str, volumes: usize, depth: u32, from: usize, to: usize, (median, least): (f64, f64)) {
    println!(
        "| {name} | {volumes} | {depth} | {from} | {to} | {:.2} | {:.2} | {:.1} | {:.1} |",
        median * 1e3,
        least * 1e3,
        to as f64 / median / 1e6,
        to as f64 / least / 1e6
    );
}

fn main() {
    let slices: Vec<_> = (0..SLICES).map(slice).collect();
    let from: usize = slices.iter().map(|s| s.1.len()).sum();
    let texture =
        DAffine3::from_scale_rotation_translation(DVec3::splat(0.01), glam::DQuat::IDENTITY, DVec3::splat(0.5));
    let size = DVec3::splat(256.0);
    let center = DVec3::ZERO;
    println!("| what | volumes | depth | triangles in | out | ms median | ms least | Mtri/s median | at best |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for n in [1, 4] {
        let map = volumes(n);
        let supports = Supports::new(&map, Some(map.feature_size()));
        let blocks = map.blocks::<f32>(center);
        let front = Texturing::new(&texture, None, center);
        let both = Texturing::new(&texture, Some(NextSlice::parallel(DVec3::NEG_Z * 0.7)), center);
        let mut refiner = Refiner::default();
        let mut vertices: Vec<Corner> = Vec::new();
        let mut indices: Vec<u32> = Vec::new();
        for depth in [1, 2, 3] {
            let rule = Rule::uniform(depth);
            let mut to = 0;
            let t = time(|| {
                to = 0;
                for (points, triangles) in &slices {
                    refiner.refine(points.iter().copied(), triangles, &map, &supports, &rule);
                    to += refiner.triangles().len();
                }
            });
            row("topology and positions", n, depth, from, to, t);
            for (name, texturing, jacobians) in
                [("with displaced coordinates", &front, false), ("with back and Jacobian", &both, true)]
            {
                let t = time(|| {
                    vertices.clear();
                    indices.clear();
                    for (points, triangles) in &slices {
                        refiner.refine(points.iter().copied(), triangles, &map, &supports, &rule);
                        let base = vertices.len() as u32;
                        indices.extend(refiner.triangles().as_flattened().iter().map(|i| i + base));
                        corners(refiner.positions(), &blocks, texturing, jacobians, |c| vertices.push(c));
                    }
                });
                row(name, n, depth, from, to, t);
            }
        }
        for tolerance in [0.5, 0.1, 0.02] {
            let rule = Rule::within(tolerance, 12, &texture, size);
            let mut to = 0;
            let t = time(|| {
                to = 0;
                vertices.clear();
                for (points, triangles) in &slices {
                    refiner.refine(points.iter().copied(), triangles, &map, &supports, &rule);
                    to += refiner.triangles().len();
                    corners(refiner.positions(), &blocks, &both, true, |c| vertices.push(c));
                }
            });
            row(&format!("adaptive to {tolerance} voxel, back and Jacobian"), n, 12, from, to, t);
        }
        let mut block = Block::default();
        for i in 0..voxclay::math::BLOCK {
            block.x[i] = i as f32 * 0.1;
        }
        let t = time(|| {
            for _ in 0..10_000 {
                let mut b = std::hint::black_box(&block).clone();
                blocks.backward_block(&mut b);
                std::hint::black_box(&b);
            }
        });
        println!("map in blocks of f32, {n} volumes: {:.2} ns a point", t.1 * 1e9 / (1e4 * 64.0));
        let t = time(|| {
            for i in 0..100_000 {
                std::hint::black_box(
                    map.backward_with_jacobian(std::hint::black_box(DVec3::splat(f64::from(i) * 1e-4))),
                );
            }
        });
        println!("map at single points in f64 with Jacobian, {n} volumes: {:.2} ns a point", t.1 * 1e9 / 1e5);
    }

    println!("\n| depth | triangles | largest error, voxels | ratio |\n|---|---|---|---|");
    let map = volumes(4);
    let supports = Supports::new(&map, Some(map.feature_size()));
    let mut refiner = Refiner::default();
    let voxels = DMat3::from_diagonal(size) * texture.matrix3;
    let mut last = None;
    for depth in 0..6 {
        let (mut worst, mut count) = (0.0_f64, 0);
        for (points, triangles) in &slices {
            refiner.refine(points.iter().copied(), triangles, &map, &supports, &Rule::uniform(depth));
            count += refiner.triangles().len();
            for t in refiner.triangles() {
                let p = t.map(|i| refiner.positions()[i as usize]);
                let q = p.map(|p| map.backward(p));
                for w in [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [1.0 / 3.0; 3]] {
                    let mix = |v: [DVec3; 3]| v[0] * w[0] + v[1] * w[1] + v[2] * w[2];
                    worst = worst.max((voxels * (map.backward(mix(p)) - mix(q))).length());
                }
            }
        }
        let ratio = last.map_or(String::from("-"), |l: f64| format!("{:.2}", l / worst));
        println!("| {depth} | {count} | {worst:.5} | {ratio} |");
        last = Some(worst);
    }
}

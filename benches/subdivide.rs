//! The paper's load: 6K triangles of slices inside displacement volumes, refined to 96K, on one core.
//!
//! `cargo bench --bench subdivide`

use std::time::Instant;

use glam::{DAffine3, DMat3, DVec3};
use voxclay::deform::{
    Action, Brush, Deformation, Deformer, DisplacementVolume, Extent, Falloff, Grab, Lattice, Prepared, Stack,
};
use voxclay::math::{BLOCK, BackwardMap, Block, BlockMap, JacobianBlock, OrientedBox};
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

/// Seconds for all parts: the median of repeated runs, and the sum of each part's least, which other programs disturb less.
fn time(parts: usize, mut f: impl FnMut(usize)) -> (f64, f64) {
    (0..parts).for_each(&mut f);
    let mut least = vec![f64::INFINITY; parts];
    let mut runs: Vec<f64> = (0..25)
        .map(|_| {
            let mut total = 0.0;
            for (part, least) in least.iter_mut().enumerate() {
                let start = Instant::now();
                f(part);
                let seconds = start.elapsed().as_secs_f64();
                total += seconds;
                *least = seconds.min(*least);
            }
            total
        })
        .collect();
    runs.sort_unstable_by(f64::total_cmp);
    (runs[runs.len() / 2], least.iter().sum())
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

fn lattice() -> Deformer {
    let support = OrientedBox { center: DVec3::ZERO, axes: DMat3::IDENTITY, half: DVec3::splat(60.0) };
    let lattice = Lattice::new(support, [5, 5, 5])
        .and_then(|l| l.with_vectors(|[i, j, k], _| DVec3::new(i as f64, j as f64, k as f64)));
    Deformer::Lattice(lattice.expect("a sound lattice"))
}

/// What a map costs at a point.
fn maps(name: &str, map: &Prepared) {
    let blocks = map.blocks::<f32>(DVec3::ZERO);
    let points = |k: usize, i: usize| DVec3::new(i as f64 * 0.4 - 12.0, (k % 7) as f64 - 3.0, (k % 11) as f64 - 5.0);
    let ns = |t: (f64, f64)| t.1 * 1e9 / (100.0 * 10.0 * BLOCK as f64);
    let narrow = ns(time(100, |k| {
        let mut block = Block::<f32>::default();
        for _ in 0..10 {
            for i in 0..BLOCK {
                let p = points(k, i).as_vec3();
                (block.x[i], block.y[i], block.z[i]) = (p.x, p.y, p.z);
            }
            blocks.backward_block(std::hint::black_box(&mut block));
        }
    }));
    let wide = ns(time(100, |k| {
        let (mut block, mut jacobian) = (Block::<f64>::default(), JacobianBlock::default());
        for _ in 0..10 {
            for i in 0..BLOCK {
                let p = points(k, i);
                (block.x[i], block.y[i], block.z[i]) = (p.x, p.y, p.z);
            }
            map.backward_block_with_jacobian(std::hint::black_box(&mut block), std::hint::black_box(&mut jacobian));
        }
    }));
    let single = ns(time(100, |k| {
        for i in 0..10 * BLOCK {
            std::hint::black_box(map.backward(std::hint::black_box(points(k, i % BLOCK))));
        }
    }));
    println!(
        "map, {name}: {narrow:.2} ns a point in blocks of f32, {wide:.2} in blocks of f64 with Jacobian, {single:.2} singly in f64"
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
        let mut run = |name: &str, depth: u32, rule: &Rule, coordinates: Option<(&Texturing, bool)>| {
            let mut to = vec![0; SLICES];
            let t = time(SLICES, |part| {
                let (points, triangles) = &slices[part];
                refiner.refine(points.iter().copied(), triangles, &map, &supports, rule);
                to[part] = refiner.triangles().len();
                if let Some((texturing, jacobians)) = coordinates {
                    if part == 0 {
                        vertices.clear();
                        indices.clear();
                    }
                    let base = vertices.len() as u32;
                    indices.extend(refiner.triangles().as_flattened().iter().map(|i| i + base));
                    corners(refiner.positions(), &blocks, texturing, jacobians, |c| vertices.push(c));
                }
            });
            row(name, n, depth, from, to.iter().sum(), t);
        };
        for depth in [1, 2, 3] {
            let rule = Rule::uniform(depth);
            run("topology and positions", depth, &rule, None);
            run("with displaced coordinates", depth, &rule, Some((&front, false)));
            run("with back and Jacobian", depth, &rule, Some((&both, true)));
        }
        for tolerance in [0.5, 0.1, 0.02] {
            let rule = Rule::within(tolerance, 12, &texture, size);
            run(&format!("to {tolerance} voxel, with back and Jacobian"), 12, &rule, Some((&both, true)));
        }
        maps(&format!("{n} volumes"), &map);
    }
    let ball = |f| Deformer::Grab(Grab::new(center, DVec3::X, 50.0, f).expect("a sound grab"));
    let brush = |a| Deformer::Brush(Brush::new(center, 50.0, Falloff::Smooth, a).expect("a sound brush"));
    for (name, deformer) in [
        ("grab, smooth", ball(Falloff::Smooth)),
        ("grab, spline", ball(Falloff::Spline)),
        ("grab, core", ball(Falloff::Core(0.3))),
        ("lattice", lattice()),
        ("brush, inflate", brush(Action::Inflate { amount: 0.5 })),
        ("brush, twist", brush(Action::Twist { axis: DVec3::Z, degrees: 90.0 })),
    ] {
        maps(name, &Stack { items: vec![Deformation::new("", deformer)] }.prepared());
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

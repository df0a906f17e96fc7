//! The CPU renderer against its own variants: 512 x 512 of 256^3 at one voxel per slice, the scene of VTK's ray caster in
//! `../shared/peers/job_d_render.py`. `cargo bench --bench render -- [VOLUME.raw] [PICTURE_DIR] [CASE]`; without a volume of 256^3 bytes,
//! a built-in one of the same kind.

use std::sync::Arc;
use std::time::Instant;

use glam::{DAffine3, DMat3, DVec3};
use voxclay::render::{Camera, ClassTable, Field, Frame, Look, Projection, Shading, render};
use voxclay::volume::transfer::{ControlPoint, TransferFunction, Window};
use voxclay::volume::{Grid, Samples, Space, Volume};

#[path = "../tests/render/slices.rs"]
mod slices;

const N: usize = 256;

/// Nested ellipsoids with soft edges and a little texture.
fn built_in() -> Vec<u8> {
    let shells = [
        ([0.0, 0.0, 0.0], [0.92, 0.86, 0.95], 0.35),
        ([0.0, 0.0, 0.0], [0.84, 0.78, 0.88], 0.12),
        ([-0.35, 0.05, 0.1], [0.28, 0.42, 0.5], -0.30),
        ([0.35, 0.05, 0.1], [0.28, 0.42, 0.5], -0.30),
        ([0.0, -0.5, 0.0], [0.14, 0.14, 0.9], 0.45),
        ([0.05, 0.3, -0.45], [0.4, 0.25, 0.2], 0.18f32),
    ];
    let at = |i: usize| (i as f32 + 0.5) / N as f32 * 2.0 - 1.0;
    (0..N * N * N)
        .map(|i| {
            let p = [at(i % N), at(i / N % N), at(i / N / N)];
            let mut v =
                0.05 + 0.03 * (21.0 * p[0] + 5.0 * p[2]).sin() * (17.0 * p[1] - 3.0 * p[2]).sin() * (19.0 * p[2]).sin();
            for (c, r, a) in shells {
                let q = (0..3).map(|a| ((p[a] - c[a]) / r[a]).powi(2)).sum::<f32>().sqrt();
                v += a / (1.0 + ((q - 1.0) * 60.0).min(80.0).exp());
            }
            let noise = ((i as u32).wrapping_mul(2_654_435_761) >> 16) as f32 / 65536.0 - 0.5;
            ((v + 0.035 * noise).clamp(0.0, 1.0) * 255.0 + 0.5) as u8
        })
        .collect()
}

fn transfer() -> TransferFunction {
    let opacity = [(0.0, 0.0), (40.0, 0.0), (80.0, 0.02), (150.0, 0.05), (200.0, 0.3), (255.0, 0.6f32)];
    let colors = [(0.0, [0.0, 0.0, 0.0]), (90.0, [0.9, 0.5, 0.4]), (255.0, [1.0, 1.0, 0.9f32])];
    let color = |at: f32| {
        let i = if at < 90.0 { 0 } else { 1 };
        let ((a, ca), (b, cb)) = (colors[i], colors[i + 1]);
        std::array::from_fn(|c| ca[c] + (at - a) / (b - a) * (cb[c] - ca[c]))
    };
    let mut points: Vec<_> =
        opacity.iter().map(|&(at, opacity)| ControlPoint { at: at / 255.0, color: color(at), opacity }).collect();
    points.insert(3, ControlPoint { at: 90.0 / 255.0, color: color(90.0), opacity: 0.02 + 0.03 / 7.0 });
    TransferFunction { name: "peer".into(), window: Window::Values { lo: 0.0, hi: 255.0 }, points, regions: vec![] }
}

/// Processor time of this process in milliseconds, over all threads, in steps of 10; 0 where the system does not say.
fn processor_ms() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or("").split_whitespace().skip(11).take(2);
    fields.filter_map(|f| f.parse::<f64>().ok()).sum::<f64>() * 10.0
}

fn main() -> anyhow::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let texels = match args.first() {
        Some(path) => std::fs::read(path)?,
        None => built_in(),
    };
    anyhow::ensure!(texels.len() == N * N * N, "the volume must hold 256^3 bytes");
    // the peer's y axis is up, ours is z
    let frame = DAffine3::from_mat3_translation(
        DMat3::from_cols(DVec3::X, DVec3::Z, -DVec3::Y),
        DVec3::new(0.0, N as f64, 0.0),
    );
    let volume = Volume::new(Grid::new([N; 3], frame, Space::Unknown)?, 1, Samples::U8(texels));
    let start = Instant::now();
    let field = Field::from_volume(Arc::new(volume));
    println!("field (bounds of blocks): {:.1} ms", start.elapsed().as_secs_f64() * 1e3);

    let camera = Camera {
        target: field.grid.center(),
        yaw: 37.0,
        pitch: 20.0,
        roll: 0.0,
        radius: 852.0 * (0.5 * 18.75f64).to_radians().sin(),
        zoom: 1.0,
        projection: Projection::Perspective { fov_y: 18.75 },
    };
    let few = slices::box_slices(&field.grid, &camera, 1.0, 0);
    let many = slices::box_slices(&field.grid, &camera, 1.0, 12);
    println!("{} slices, {} or {} triangles", few.slices.len(), few.indices.len() / 3, many.indices.len() / 3);
    let start = Instant::now();
    ClassTable::build(&transfer(), 1.0, true);
    println!("pre-integrated table: {:.2} ms", start.elapsed().as_secs_f64() * 1e3);

    let black = Look { background: [[0.0; 3]; 2], ..Default::default() };
    let iso = Shading::Iso { value: 80.0, color: [0.9, 0.8, 0.7] };
    let looks = [
        ("plain", Look { lit: false, preintegrated: false, ..black }),
        ("plain preintegrated", Look { lit: false, ..black }),
        ("lit", Look { preintegrated: false, ..black }),
        ("lit preintegrated", black),
        ("iso", Look { shading: iso, ..black }),
        ("mip", Look { shading: Shading::Mip, ..black }),
    ];
    let orthographic = Camera { projection: Projection::Orthographic, ..camera };
    let flat = slices::box_slices(&field.grid, &orthographic, 1.0, 0);
    let mut cases: Vec<_> = looks.iter().map(|(name, look)| ((*name).to_owned(), look, &few, &camera, 512)).collect();
    cases.push(("plain, slivers".to_owned(), &looks[0].1, &many, &camera, 512));
    cases.push(("plain, orthographic".to_owned(), &looks[0].1, &flat, &orthographic, 512));
    if let Some(only) = args.get(2) {
        cases.retain(|c| c.0 == *only);
    }
    let mut times = vec![Vec::new(); cases.len()];
    let mut busy = vec![0.0; cases.len()];
    const ROUNDS: usize = 7;
    for round in 0..ROUNDS {
        for ((name, look, geometry, camera, size), (times, busy)) in cases.iter().zip(times.iter_mut().zip(&mut busy)) {
            let (start, before) = (Instant::now(), processor_ms());
            let table = ClassTable::build(&transfer(), 1.0, look.preintegrated);
            let frame = Frame::new(camera, look, &field, [0.0, 255.0], geometry, *size, *size);
            let picture = render(geometry, &field, &table, &frame, None);
            times.push(start.elapsed().as_secs_f64() * 1e3);
            *busy += processor_ms() - before;
            if let (0, Some(dir)) = (round, args.get(1)) {
                std::fs::write(format!("{dir}/{}.png", name.replace([' ', ','], "_")), picture.png()?)?;
            }
        }
    }
    for (((name, ..), times), busy) in cases.iter().zip(&mut times).zip(busy) {
        times.sort_by(f64::total_cmp);
        println!(
            "{name:24} min {:7.1} ms  median {:7.1} ms  processor {:7.1} ms",
            times[0],
            times[times.len() / 2],
            busy / ROUNDS as f64
        );
    }
    Ok(())
}

use glam::DVec3;
use std::sync::Arc;
use voxclay::gpu::{Gpu, Preference, Renderer};
use voxclay::math::Identity;
use voxclay::render::*;
use voxclay::volume::transfer::*;
use voxclay::volume::*;

#[path = "../tests/box_slices/mod.rs"]
mod box_slices;

fn ct_like(n: usize) -> Volume {
    let ells: [([f32; 3], [f32; 3], f32); 6] = [
        ([0.0, 0.0, 0.0], [0.92, 0.86, 0.95], 0.35),
        ([0.0, 0.0, 0.0], [0.84, 0.78, 0.88], 0.12),
        ([-0.35, 0.05, 0.1], [0.28, 0.42, 0.5], -0.30),
        ([0.35, 0.05, 0.1], [0.28, 0.42, 0.5], -0.30),
        ([0.0, -0.5, 0.0], [0.14, 0.14, 0.9], 0.45),
        ([0.05, 0.3, -0.45], [0.4, 0.25, 0.2], 0.18),
    ];
    let at = |i: usize| (i as f32 + 0.5) / n as f32 * 2.0 - 1.0;
    let mut seed = 1u32;
    let mut data = Vec::with_capacity(n * n * n);
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                let (x, y, z) = (at(i), at(j), at(k));
                let mut v = 0.05f32;
                for (c, r, a) in ells {
                    let q = (((x - c[0]) / r[0]).powi(2) + ((y - c[1]) / r[1]).powi(2) + ((z - c[2]) / r[2]).powi(2))
                        .sqrt();
                    v += a / (1.0 + ((q - 1.0) * 60.0).min(80.0).exp());
                }
                v += 0.03 * (21.0 * x + 5.0 * z).sin() * (17.0 * y - 3.0 * z).sin() * (19.0 * z).sin();
                let mut noise = -6.0;
                for _ in 0..12 {
                    seed = seed.wrapping_mul(1664525).wrapping_add(1013904223);
                    noise += (seed >> 8) as f32 / 16777216.0;
                }
                v += 0.01 * noise;
                data.push((v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8);
            }
        }
    }
    Volume::new(Grid::aligned([n; 3], DVec3::ONE, DVec3::ZERO).unwrap(), 1, Samples::U8(data))
}

fn save(p: &Picture, path: &str) {
    let f = std::fs::File::create(path).unwrap();
    let mut e = png::Encoder::new(f, p.width, p.height);
    e.set_color(png::ColorType::Rgba);
    e.set_depth(png::BitDepth::Eight);
    e.write_header().unwrap().write_image_data(p.pixels.as_flattened()).unwrap();
}

fn main() {
    let n = 256;
    let vol = Arc::new(ct_like(n));
    let field = Field::from_volume(vol);
    let pt = |v: f32, c: [f32; 3], o: f32| ControlPoint { at: v / 255.0, color: c, opacity: o };
    let tf = TransferFunction {
        name: "peer".into(),
        window: Window::Values { lo: 0.0, hi: 255.0 },
        points: vec![
            pt(0.0, [0.0; 3], 0.0),
            pt(40.0, [0.4, 0.22, 0.18], 0.0),
            pt(80.0, [0.8, 0.45, 0.36], 0.02),
            pt(150.0, [0.94, 0.68, 0.58], 0.05),
            pt(200.0, [0.97, 0.85, 0.76], 0.3),
            pt(255.0, [1.0, 1.0, 0.9], 0.6),
        ],
    };
    let gpu = Arc::new(Gpu::open(Preference::Any).unwrap());
    println!("{}", gpu.name());
    let mut r = Renderer::new(gpu).unwrap();
    let t = std::time::Instant::now();
    r.set_field(&field).unwrap();
    println!("upload {:?}", t.elapsed());
    let cam = Camera {
        target: field.grid.center(),
        yaw: 30.0,
        pitch: 20.0,
        radius: 221.7,
        zoom: 1.59,
        projection: Projection::Perspective { fov_y: 18.75 },
    };
    let (w, h) = (512, 512);
    let cpu = || {
        let s = std::fs::read_to_string("/proc/self/stat").unwrap();
        let f: Vec<&str> = s.rsplit(')').next().unwrap().split_whitespace().collect();
        (f[11].parse::<f64>().unwrap() + f[12].parse::<f64>().unwrap()) * 10.0
    };
    let only = std::env::args().nth(1).unwrap_or_default();
    for pre in [false, true] {
        let table = Arc::new(ClassTable::build(&tf, 1.0, pre));
        r.set_table(&table);
        for lit in [false, true] {
            if !only.contains(&format!("{}{}", pre as u8, lit as u8)) {
                continue;
            }
            let look = Look { lit, preintegrated: pre, ..Look::default() };
            let g = box_slices::box_slices(&field.grid, &cam, &Identity, 1.0, 0);
            let g = Arc::new(g);
            r.set_geometry(&g);
            let frame = Frame::new(&cam, &look, &field, [0.0, 255.0], &g, w, h);
            let mut times = vec![];
            for _ in 0..4 {
                let c = cpu();
                let p = r.draw(&frame).unwrap();
                times.push((r.timings().frame, cpu() - c));
                save(&p, &format!("/tmp/gpu_{pre}_{lit}.png"));
            }
            println!("pre {pre} lit {lit} slices {} {:?}", g.slices.len(), times);
        }
    }
}

//! Time of a GPU frame: `cargo bench --bench gpu_frame [-- PICTURE_DIR]`.
//!
//! 1. Slices of a volume against the same number of fragments drawn as plain quads by the same shader: what geometry costs.
//! 2. A 512 x 512 picture of 256^3 at one voxel per slice, plain and shaded, the camera turned by 7 degrees each time, from
//!    geometry to pixels on the host: the job of `../shared/peers/job_d_render.py --mapper gpu`. With `PEERS_PYTHON` set to
//!    a Python that has VTK, that is run too.

use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use glam::{DVec3, Mat4, Vec2, Vec3};
use voxclay::gpu::cull::{Culled, cull};
use voxclay::gpu::{Gpu, Preference, Renderer};
use voxclay::math::Identity;
use voxclay::render::{Camera, ClassTable, Field, Frame, Look, Projection, SliceGeometry, SliceVertex};
use voxclay::volume::transfer::{ControlPoint, TransferFunction, Window};
use voxclay::volume::{Grid, Samples, Volume};

#[path = "../tests/box_slices/mod.rs"]
mod box_slices;
use box_slices::box_slices;

const SIDE: u32 = 512;
const ROUNDS: usize = 7;

/// The peers' volume: nested ellipsoids with soft edges, a sinusoidal texture and a little noise.
fn ct_like(n: usize) -> Volume {
    let ellipsoids: [([f32; 3], [f32; 3], f32); 6] = [
        ([0.0, 0.0, 0.0], [0.92, 0.86, 0.95], 0.35),
        ([0.0, 0.0, 0.0], [0.84, 0.78, 0.88], 0.12),
        ([-0.35, 0.05, 0.1], [0.28, 0.42, 0.5], -0.30),
        ([0.35, 0.05, 0.1], [0.28, 0.42, 0.5], -0.30),
        ([0.0, -0.5, 0.0], [0.14, 0.14, 0.9], 0.45),
        ([0.05, 0.3, -0.45], [0.4, 0.25, 0.2], 0.18),
    ];
    let at = |i: usize| (i as f32 + 0.5) / n as f32 * 2.0 - 1.0;
    let mut seed = 1u32;
    let mut uniform = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / (1 << 24) as f32
    };
    let voxels = (0..n * n * n).map(|i| {
        let (x, y, z) = (at(i % n), at(i / n % n), at(i / n / n));
        let mut v = 0.05;
        for (c, r, a) in ellipsoids {
            let q = Vec3::new((x - c[0]) / r[0], (y - c[1]) / r[1], (z - c[2]) / r[2]).length();
            v += a / (1.0 + ((q - 1.0) * 60.0).min(80.0).exp());
        }
        v += 0.03 * (21.0 * x + 5.0 * z).sin() * (17.0 * y - 3.0 * z).sin() * (19.0 * z).sin();
        // a sum of twelve has the variance 1
        v += 0.01 * ((0..12).map(|_| uniform()).sum::<f32>() - 6.0);
        (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
    });
    let grid = Grid::aligned([n; 3], DVec3::ONE, DVec3::ZERO).expect("a grid");
    Volume::new(grid, 1, Samples::U8(voxels.collect()))
}

fn transfer_function() -> TransferFunction {
    let point = |v: f32, color, opacity| ControlPoint { at: v / 255.0, color, opacity };
    TransferFunction {
        name: "peer".into(),
        window: Window::Values { lo: 0.0, hi: 255.0 },
        points: vec![
            point(0.0, [0.0; 3], 0.0),
            point(40.0, [0.4, 0.22, 0.18], 0.0),
            point(80.0, [0.8, 0.45, 0.36], 0.02),
            point(150.0, [0.94, 0.68, 0.58], 0.05),
            point(200.0, [0.97, 0.85, 0.76], 0.3),
            point(255.0, [1.0, 1.0, 0.9], 0.6),
        ],
        regions: vec![],
    }
}

/// VTK's view after `ResetCamera` and `Zoom(1.6)`.
fn camera(field: &Field, yaw: f64) -> Camera {
    Camera {
        target: field.grid.center(),
        yaw,
        pitch: 20.0,
        roll: 0.0,
        radius: 221.7,
        zoom: 1.59,
        projection: Projection::Perspective { fov_y: 18.75 },
    }
}

/// Pixels that the triangles cover within the picture, with repetition.
fn fragments(geometry: &SliceGeometry, culled: &Culled, frame: &Frame) -> f64 {
    let clip = Mat4::from_cols_array_2d(&frame.clip_from_local);
    let pixels = Vec2::new(frame.size[0] as f32, frame.size[1] as f32);
    let given = geometry.vertices.len();
    let corner = |i: u32| {
        let v = geometry.vertices.get(i as usize).unwrap_or_else(|| &culled.added[i as usize - given]);
        (clip.project_point3(v.position.into()).truncate() + 1.0) * 0.5 * pixels
    };
    let area = |t: &[u32; 3]| {
        // clipped against the four sides in turn
        let mut polygon = t.map(corner).to_vec();
        for side in 0..4 {
            let inside = |p: Vec2| match side {
                0 => p.x,
                1 => p.y,
                2 => pixels.x - p.x,
                _ => pixels.y - p.y,
            };
            let mut kept = Vec::new();
            for (i, &b) in polygon.iter().enumerate() {
                let a = polygon[(i + polygon.len() - 1) % polygon.len()];
                let (da, db) = (inside(a), inside(b));
                if (da >= 0.0) != (db >= 0.0) {
                    kept.push(a.lerp(b, da / (da - db)));
                }
                if db >= 0.0 {
                    kept.push(b);
                }
            }
            polygon = kept;
        }
        let doubled: f32 = (0..polygon.len()).map(|i| polygon[i].perp_dot(polygon[(i + 1) % polygon.len()])).sum();
        f64::from(0.5 * doubled.abs())
    };
    culled.indices.as_chunks::<3>().0.iter().map(area).sum()
}

/// As many quads over the whole picture as make up the fragments, through the middle of the volume.
fn quads(fragments: f64, geometry: &SliceGeometry, frame: &Frame) -> SliceGeometry {
    let count = (fragments / f64::from(SIDE * SIDE)).round().max(1.0) as u32;
    let local_from_clip = Mat4::from_cols_array_2d(&frame.clip_from_local).inverse();
    let jacobian = geometry.vertices[0].jacobian;
    let mut all = SliceGeometry { center: geometry.center, distance: geometry.distance, ..SliceGeometry::default() };
    for k in 0..count {
        let depth = 0.25 + 0.5 * (k as f32 + 0.5) / count as f32;
        let first = all.vertices.len() as u32;
        for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            let front = [0.5 + 0.3 * x, depth, 0.5 + 0.3 * y];
            all.vertices.push(SliceVertex {
                position: local_from_clip.project_point3(Vec3::new(x, y, 1.0 - depth)).to_array(),
                front,
                back: [front[0], front[1] + 1.0 / 256.0, front[2]],
                jacobian,
            });
        }
        let start = all.indices.len() as u32;
        all.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        all.slices.push(start..start + 6);
    }
    all
}

fn middle(times: &[f64]) -> (f64, f64) {
    let mut t = times.to_vec();
    t.sort_by(f64::total_cmp);
    (t[t.len() / 2], t[0])
}

fn against_quads(renderer: &mut Renderer, field: &Field, table: &ClassTable, look: &Look) {
    let camera = camera(field, 30.0);
    let geometry = Arc::new(box_slices(&field.grid, &camera, &Identity, 1.0, 0));
    let frame = Frame::new(&camera, look, field, [0.0, 255.0], &geometry, SIDE, SIDE);
    let culled = cull(&geometry, field, table, &frame).expect("a mode that culls");
    let count = fragments(&geometry, &culled, &frame);
    let quads = Arc::new(quads(count, &geometry, &frame));
    let mut times = [Vec::new(), Vec::new()];
    // the quads would hide each other
    renderer.set_stopping(false);
    for round in 0..=ROUNDS {
        for (i, (geometry, culling)) in [(&geometry, true), (&quads, false)].into_iter().enumerate() {
            renderer.set_geometry(geometry);
            renderer.set_culling(culling);
            renderer.draw(&frame).expect("a picture");
            // once more, so that only drawing is measured
            renderer.draw(&frame).expect("a picture");
            if round > 0 {
                let t = renderer.timings();
                times[i].push(t.slicing.unwrap_or(t.frame));
            }
        }
    }
    renderer.set_culling(true);
    renderer.set_stopping(true);
    let ([slices, least], [plain, plain_least]) = {
        let [a, b] = times.each_ref().map(|t| middle(t));
        ([a.0, a.1], [b.0, b.1])
    };
    println!(
        "lit {}: {:.1} M fragments, {} triangles: slices {slices:.0} ms (min {least:.0}), {} quads {plain:.0} ms \
         (min {plain_least:.0}), ratio {:.3} (of minima {:.3})",
        look.lit,
        count * 1e-6,
        culled.indices.len() / 3,
        quads.slices.len(),
        slices / plain,
        least / plain_least,
    );
}

fn turning(renderer: &mut Renderer, field: &Field, look: &Look, pictures: Option<&str>) {
    let mut times = Vec::new();
    let mut device = Vec::new();
    for round in 0..=ROUNDS {
        let camera = camera(field, 30.0 + 7.0 * round as f64);
        let start = Instant::now();
        let geometry = Arc::new(box_slices(&field.grid, &camera, &Identity, 1.0, 0));
        let frame = Frame::new(&camera, look, field, [0.0, 255.0], &geometry, SIDE, SIDE);
        renderer.set_geometry(&geometry);
        let picture = renderer.draw(&frame).expect("a picture");
        if round > 0 {
            times.push(start.elapsed().as_secs_f64() * 1e3);
            device.extend(renderer.timings().slicing);
        }
        if let (Some(dir), ROUNDS) = (pictures, round) {
            let path = format!("{dir}/gpu_frame_lit_{}_pre_{}.png", look.lit, look.preintegrated);
            std::fs::write(path, picture.png().expect("a PNG")).expect("a file");
        }
    }
    let (median, least) = middle(&times);
    print!("lit {}, pre-integrated {}: {median:.0} ms (min {least:.0})", look.lit, look.preintegrated);
    if !device.is_empty() {
        print!(", on the device {:.0} ms (min {:.0})", middle(&device).0, middle(&device).1);
    }
    println!();
}

fn peer(shade: &str) {
    let Some(python) = std::env::var_os("PEERS_PYTHON") else { return };
    let run = Command::new(python)
        .args(["job_d_render.py", "--mapper", "gpu", "--window", "osmesa", "--frames", "5", "--shade", shade])
        .env("PEERS_WAIT", "0")
        .current_dir("../shared/peers")
        .output();
    match run {
        Ok(o) => println!("VTK, shade {shade}: {}", String::from_utf8_lossy(&o.stdout).trim().replace('\n', "\n  ")),
        Err(e) => println!("VTK did not run: {e}"),
    }
}

fn main() {
    let pictures = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    let gpu = match Gpu::open(Preference::Any) {
        Ok(gpu) => Arc::new(gpu),
        Err(e) => return println!("{e}"),
    };
    println!("{}", gpu.name());
    let field = Field::from_volume(Arc::new(ct_like(256)));
    let mut renderer = Renderer::new(gpu).expect("a renderer");
    let start = Instant::now();
    renderer.set_field(&field).expect("an upload");
    println!("upload of 256^3 u8: {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
    for lit in [false, true] {
        for preintegrated in [false, true] {
            let look = Look { lit, preintegrated, ..Look::default() };
            let table = Arc::new(ClassTable::build(&transfer_function(), 1.0, preintegrated));
            renderer.set_table(&table);
            if !preintegrated {
                against_quads(&mut renderer, &field, &table, &look);
            }
            turning(&mut renderer, &field, &look, pictures.as_deref());
        }
        peer(if lit { "1" } else { "0" });
    }
}

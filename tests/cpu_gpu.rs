//! The GPU's pictures and volumes against the CPU's. Any adapter will do, a software one too.
//!
//! Without a graphics driver these tests show as ignored (see `build.rs`); with one that does not open they fail.

use std::sync::{Arc, OnceLock};

use glam::{DAffine3, DMat3, DQuat, DVec3};
use voxclay::deform::{
    Action, Brush, Deformation, Deformer, DisplacementVolume, Extent, Falloff, Grab, Lattice, Stack,
};
use voxclay::gpu::{Gpu, Preference, Renderer, ResampleJob, ResamplePass};
use voxclay::math::{BackwardMap, Identity, OrientedBox};
use voxclay::render::{
    Camera, ClassTable, Exact, Field, Frame, Gradient, Look, Picture, Projection, Shading, SliceGeometry, render,
    render_until,
};
use voxclay::volume::sampling::{Interpolation, Sampler};
use voxclay::volume::transfer::{ControlPoint, Region, TransferFunction, Window};
use voxclay::volume::{Grid, Samples, Scalar, ScalarType, Space, Volume};
use voxclay::with_samples;

mod box_slices;
use box_slices::box_slices;
mod pictures;
use pictures::difference;

fn gpu() -> Arc<Gpu> {
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    GPU.get_or_init(|| Arc::new(Gpu::open(Preference::Any).expect("a graphics driver is installed"))).clone()
}

/// Neither cubic, isotropic nor axis-aligned.
fn grid() -> Grid {
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.2, 0.5));
    let frame = turn * DMat3::from_diagonal(DVec3::new(1.0, 1.2, 1.5));
    let map = DAffine3::from_mat3_translation(frame, DVec3::new(100.0, -50.0, 20.0));
    Grid::new([40, 36, 28], map, Space::Lps).unwrap()
}

/// Nested soft shells with a wavy inside, in 0..=1.
fn shells(x: [f64; 3]) -> f64 {
    let r = x.iter().map(|c| (c - 0.5) * (c - 0.5)).sum::<f64>().sqrt() * 2.0;
    let shell = |at: f64, width: f64| (-((r - at) / width).powi(2)).exp();
    (0.8 * shell(0.75, 0.12) + 0.5 * shell(0.35, 0.15) + 0.08 * (9.0 * x[0]).sin() * (7.0 * x[1] + 4.0 * x[2]).cos())
        .clamp(0.0, 1.0)
}

fn volume(t: ScalarType, channels: usize) -> Volume {
    fn fill<T: Scalar>(grid: &Grid, channels: usize, top: f64) -> Samples {
        let [nx, ny, nz] = grid.dims;
        let mut v = Vec::with_capacity(grid.len() * channels);
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    let x = [i as f64 / nx as f64, j as f64 / ny as f64, k as f64 / nz as f64];
                    for c in 0..channels {
                        let color = 0.5 + 0.5 * (6.0 * x[c % 3] + c as f64).sin();
                        let value = if c + 1 == channels { shells(x) } else { color };
                        v.push(T::from_f64(value * top));
                    }
                }
            }
        }
        T::wrap(v)
    }
    let grid = grid();
    let samples = match t {
        ScalarType::U8 => fill::<u8>(&grid, channels, 255.0),
        ScalarType::U16 => fill::<u16>(&grid, channels, 3000.0),
        ScalarType::I16 => fill::<i16>(&grid, channels, 1500.0),
        _ => fill::<f32>(&grid, channels, 1.0),
    };
    Volume::new(grid, channels, samples)
}

fn tf() -> TransferFunction {
    let p = |at, color, opacity| ControlPoint { at, color, opacity };
    TransferFunction {
        name: "test".into(),
        window: Window::Auto,
        points: vec![
            p(0.0, [0.1, 0.1, 0.3], 0.0),
            p(0.15, [0.9, 0.4, 0.2], 0.0),
            p(0.4, [0.9, 0.7, 0.3], 0.12),
            p(0.6, [0.3, 0.8, 0.9], 0.04),
            p(0.9, [1.0, 1.0, 0.9], 0.7),
        ],
        regions: vec![],
    }
}

/// A border that is faint, and one that is steep.
fn regions() -> Vec<Region> {
    let region = |value, steepness, color| Region { value, steepness, foot: 0.5, soft: 0.6, opacity: 0.3, color };
    vec![region([0.1, 0.6], [0.01, 0.08], None), region([0.3, 1.0], [0.05, 1.0], Some([0.3, 0.7, 1.0]))]
}

/// One deformer of each kind, overlapping; one of them of half its effect.
fn stack() -> Stack {
    let g = grid();
    let at = |x, y, z| g.world_from_texture().transform_point3(DVec3::new(x, y, z));
    let pull = DisplacementVolume::new(
        at(0.5, 0.4, 0.7),
        DVec3::new(2.0, -3.0, 4.0),
        Extent { u: 14.0, v: 11.0, length: 45.0 },
        Some(DVec3::X),
    );
    let brush = |c, f, action| Deformer::Brush(Brush::new(c, 12.0, f, action).unwrap());
    let grab = |c, v, f| Deformer::Grab(Grab::new(c, v, 16.0, f).unwrap());
    let support = OrientedBox { center: at(0.5, 0.5, 0.5), axes: g.direction(), half: DVec3::splat(22.0) };
    let lattice = Lattice::new(support, [4, 3, 5])
        .and_then(|l| {
            l.with_vectors(|i, _| DVec3::new(i[0] as f64 - 1.5, 1.0 - i[1] as f64, 0.5 * (i[2] as f64 - 2.0)) * 0.9)
        })
        .unwrap();
    let items = [
        Deformer::Displacement(pull.unwrap()),
        grab(at(0.3, 0.6, 0.5), DVec3::new(3.0, 1.0, 1.0), Falloff::Smooth),
        Deformer::Lattice(lattice),
        grab(at(0.7, 0.5, 0.4), DVec3::new(-2.0, 2.0, 1.0), Falloff::Core(0.3)),
        grab(at(0.5, 0.3, 0.4), DVec3::new(0.0, -2.0, 1.5), Falloff::Spline),
        brush(at(0.4, 0.4, 0.4), Falloff::Smooth, Action::Inflate { amount: 0.4 }),
        brush(at(0.6, 0.7, 0.6), Falloff::Core(0.2), Action::Pinch { axis: DVec3::new(1.0, 2.0, 0.5), amount: 0.5 }),
        brush(at(0.5, 0.5, 0.4), Falloff::Spline, Action::Twist { axis: DVec3::new(0.0, -1.0, 2.0), degrees: 100.0 }),
    ];
    let mut stack = Stack { items: items.into_iter().map(|d| Deformation::new("", d)).collect() };
    stack.items[1].opacity = 0.5;
    stack
}

fn camera(perspective: bool) -> Camera {
    Camera {
        target: grid().center(),
        yaw: 25.0,
        pitch: 15.0,
        roll: 0.0,
        radius: 36.0,
        zoom: 1.5,
        projection: if perspective { Projection::Perspective { fov_y: 50.0 } } else { Projection::Orthographic },
    }
}

struct Scene {
    what: &'static str,
    volume: Volume,
    look: Look,
    perspective: bool,
    deformed: bool,
    exact: bool,
    /// Opacity by value and steepness.
    regions: bool,
}

fn scene(what: &'static str, volume: Volume) -> Scene {
    Scene { what, volume, look: Look::default(), perspective: false, deformed: false, exact: false, regions: false }
}

fn iso(value: f64) -> Shading {
    Shading::Iso { value, color: [0.9, 0.75, 0.6] }
}

fn pictures(gpu: &Arc<Gpu>, s: &Scene) -> (Picture, Picture) {
    let field = Field::from_volume(Arc::new(s.volume.clone()));
    let camera = camera(s.perspective);
    let stack = stack();
    let map: &dyn BackwardMap = if s.deformed { &stack } else { &Identity };
    let geometry = Arc::new(box_slices(&field.grid, &camera, map, 1.0, if s.deformed { 4 } else { 0 }));
    let transfer = TransferFunction { regions: if s.regions { regions() } else { vec![] }, ..tf() };
    let table = Arc::new(ClassTable::build(&transfer, 1.0, s.look.preintegrated));
    let frame = Frame::new(&camera, &s.look, &field, field.range, &geometry, 120, 100);
    let texture_from_world = field.grid.texture_from_world();
    let exact = s.exact.then_some(Exact { map: &stack, texture_from_world });
    let cpu = render(&geometry, &field, &table, &frame, exact);
    let mut renderer = Renderer::new(gpu.clone()).unwrap();
    renderer.set_field(&field).unwrap();
    renderer.set_table(&table);
    renderer.set_geometry(&geometry);
    renderer.set_exact(s.exact.then_some(&stack));
    (cpu, renderer.draw(&frame).unwrap())
}

/// Share of pixels that differ from the picture's first one.
fn covered(p: &Picture) -> f64 {
    let width = p.width as usize;
    p.pixels.chunks(width).map(|row| row.iter().filter(|q| **q != row[0]).count()).sum::<usize>() as f64
        / p.pixels.len() as f64
}

fn agree_on(gpu: &Arc<Gpu>, scenes: &[Scene], least: f64) {
    for s in scenes {
        let (cpu, picture) = pictures(gpu, s);
        let db = difference(&cpu, &picture).psnr;
        println!("{}: {db:.1} dB, {:.0} % covered", s.what, 100.0 * covered(&cpu));
        if let Some(dir) = std::env::var_os("VOXCLAY_PICTURES") {
            for (who, p) in [("cpu", &cpu), ("gpu", &picture)] {
                let name = format!("{} {who}.png", s.what).replace(' ', "_");
                std::fs::write(std::path::Path::new(&dir).join(name), p.png().unwrap()).unwrap();
            }
        }
        assert!(covered(&cpu) > 0.1, "{}: nothing to compare", s.what);
        assert!(db >= least, "{}: {db:.2} dB", s.what);
    }
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn volume_pictures_agree() {
    use ScalarType::{F32, I16, U8, U16};
    let base = Look::default();
    let scenes = [
        scene("lit u8", volume(U8, 1)),
        Scene { perspective: true, ..scene("lit u16 in perspective", volume(U16, 1)) },
        Scene { deformed: true, ..scene("lit f32 deformed", volume(F32, 1)) },
        Scene {
            deformed: true,
            perspective: true,
            look: Look { gradient: Gradient::Forward, ..base },
            ..scene("forward differences", volume(I16, 1))
        },
        Scene { look: Look { lit: false, preintegrated: false, ..base }, ..scene("plain", volume(U8, 1)) },
        Scene { deformed: true, ..scene("rgba", volume(U8, 4)) },
        Scene {
            deformed: true,
            perspective: true,
            look: Look { gradient_opacity: Some([0.005, 0.04]), ..base },
            ..scene("opacity by steepness", volume(U16, 1))
        },
        Scene {
            look: Look { gradient_opacity: Some([0.005, 0.04]), lit: false, ..base },
            ..scene("opacity by steepness, rgba", volume(U8, 4))
        },
        Scene { look: Look { transparent: true, lit: false, ..base }, ..scene("transparent", volume(U8, 4)) },
        Scene { regions: true, ..scene("regions", volume(U8, 1)) },
        Scene { regions: true, deformed: true, perspective: true, ..scene("regions, deformed", volume(F32, 1)) },
        Scene {
            regions: true,
            look: Look { gradient_opacity: Some([0.005, 0.04]), lit: false, ..base },
            ..scene("regions and opacity by steepness, rgba", volume(U8, 4))
        },
        Scene { regions: true, exact: true, ..scene("regions, exact", volume(U16, 1)) },
    ];
    agree_on(&gpu(), &scenes, 45.0);
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn iso_and_maximum_pictures_agree() {
    use ScalarType::{F32, U8, U16};
    let base = Look::default();
    let mip = Look { shading: Shading::Mip, ..base };
    let scenes = [
        Scene { look: Look { shading: iso(0.4), ..base }, ..scene("iso f32", volume(F32, 1)) },
        Scene {
            look: Look { shading: iso(100.0), ..base },
            deformed: true,
            perspective: true,
            ..scene("iso u8 deformed", volume(U8, 1))
        },
        Scene {
            look: Look { shading: iso(1200.0), gradient: Gradient::Forward, ..base },
            ..scene("iso u16 forward differences", volume(U16, 1))
        },
        Scene { look: Look { shading: iso(110.0), ..base }, ..scene("iso rgba", volume(U8, 4)) },
        Scene { look: mip, perspective: true, ..scene("maximum u8", volume(U8, 1)) },
        Scene { look: mip, deformed: true, ..scene("maximum f32 deformed", volume(F32, 1)) },
    ];
    agree_on(&gpu(), &scenes, 45.0);
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn exact_pictures_agree() {
    let base = Look::default();
    let exact =
        |what, look, perspective| Scene { look, perspective, exact: true, ..scene(what, volume(ScalarType::U8, 1)) };
    let scenes = [
        exact("exact lit", base, false),
        exact("exact iso in perspective", Look { shading: iso(100.0), ..base }, true),
    ];
    agree_on(&gpu(), &scenes, 45.0);
}

/// Without the optional features textures have 8 bits or 16-bit floats, and filters 8 bits.
#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn plain_adapters_draw_the_same() {
    let plain = Arc::new(Gpu::open_plain(Preference::Any).unwrap());
    assert!(!plain.capabilities().unorm16 && !plain.capabilities().filter_float32);
    let unlit = Look { lit: false, ..Look::default() };
    let scenes = [
        Scene { look: unlit, ..scene("plain adapter u16", volume(ScalarType::U16, 1)) },
        Scene { look: unlit, ..scene("plain adapter f32", volume(ScalarType::F32, 1)) },
        Scene { look: unlit, ..scene("plain adapter u8", volume(ScalarType::U8, 1)) },
    ];
    agree_on(&plain, &scenes, 40.0);
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn a_renderer_follows_what_is_set() {
    let field = |t| Field::from_volume(Arc::new(volume(t, 1)));
    let (first, second) = (field(ScalarType::U8), field(ScalarType::F32));
    let look = Look::default();
    let mut renderer = Renderer::new(gpu()).unwrap();
    let nothing = SliceGeometry { distance: 1.0, ..SliceGeometry::default() };
    let empty = Frame::new(&camera(false), &look, &first, first.range, &nothing, 33, 17);
    let background = renderer.draw(&empty).unwrap();
    assert_eq!((background.width, background.height), (33, 17));
    assert!(background.pixels.chunks(33).all(|row| row.iter().all(|p| p == &row[0])), "only the background");

    let table = Arc::new(ClassTable::build(&tf(), 1.0, true));
    renderer.set_table(&table);
    for (field, perspective, size) in [(&first, false, 64), (&second, true, 64), (&first, true, 80)] {
        let camera = camera(perspective);
        let geometry = Arc::new(box_slices(&field.grid, &camera, &Identity, 1.5, 0));
        let frame = Frame::new(&camera, &look, field, field.range, &geometry, size, size);
        renderer.set_field(field).unwrap();
        renderer.set_geometry(&geometry);
        let cpu = render(&geometry, field, &table, &frame, None);
        for _ in 0..2 {
            let db = difference(&cpu, &renderer.draw(&frame).unwrap()).psnr;
            assert!(db >= 45.0, "{db:.1} dB");
        }
        // another window, nothing else: what was culled must come back
        let narrow = Frame::new(&camera, &look, field, [field.range[0], 0.4 * field.range[1]], &geometry, size, size);
        let db = difference(&render(&geometry, field, &table, &narrow, None), &renderer.draw(&narrow).unwrap()).psnr;
        assert!(db >= 45.0, "{db:.1} dB");
    }
    assert!(renderer.timings().frame > 0.0);
    let huge = Frame { size: [1 << 20, 4, 0, 0], ..empty };
    assert!(renderer.draw(&huge).is_err() && renderer.draw(&Frame { size: [0, 4, 0, 0], ..empty }).is_err());
    assert!(renderer.draw(&empty).is_ok(), "a refused picture leaves everything in order");
}

/// Behind opaque pixels nothing is drawn, and the picture is as if it were, up to what such pixels let through.
#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn what_lies_behind_opaque_pixels_changes_nothing() {
    let gpu = gpu();
    let mut renderer = Renderer::new(gpu).unwrap();
    let field = Field::from_volume(Arc::new(volume(ScalarType::U8, 1)));
    renderer.set_field(&field).unwrap();
    for (opacity, perspective) in [(0.002, false), (0.3, true), (1.0, true)] {
        let points = tf().points.into_iter().map(|p| ControlPoint { opacity: p.opacity * opacity, ..p }).collect();
        let table = Arc::new(ClassTable::build(&TransferFunction { points, ..tf() }, 1.0, true));
        let camera = camera(perspective);
        let geometry = Arc::new(box_slices(&field.grid, &camera, &Identity, 1.0, 0));
        renderer.set_table(&table);
        renderer.set_geometry(&geometry);
        for background in [[0.0; 3], [1.0; 3]] {
            let look = Look { lit: true, background: [background; 2], ..Look::default() };
            let frame = Frame::new(&camera, &look, &field, [0.0, 255.0], &geometry, 96, 80);
            let [with, without] = [true, false].map(|on| {
                renderer.set_stopping(on);
                renderer.draw(&frame).unwrap()
            });
            let worst = with.pixels.as_flattened().iter().zip(without.pixels.as_flattened());
            let worst = worst.map(|(a, b)| a.abs_diff(*b)).max();
            // 1/256 of the light is 13 steps of sRGB in the dark; where one part looks like the next it is far less
            assert!(worst <= Some(if opacity < 0.01 { 1 } else { 6 }), "{opacity} {background:?}: {worst:?}");
        }
    }
}

/// Where nothing can be seen nothing is drawn: cells of the picture where slices lie still, parts of triangles elsewhere.
#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn what_cannot_be_seen_changes_nothing() {
    let mut renderer = Renderer::new(gpu()).unwrap();
    // many blocks of the pyramid
    let grid = Grid { dims: grid().dims.map(|n| 3 * n), ..grid() };
    let values = (0..grid.len()).map(|i| {
        let [nx, ny, nz] = grid.dims;
        (255.0
            * shells([(i % nx) as f64 / nx as f64, (i / nx % ny) as f64 / ny as f64, (i / nx / ny) as f64 / nz as f64]))
            as u8
    });
    let field = Field::from_volume(Arc::new(Volume::new(grid, 1, Samples::U8(values.collect()))));
    renderer.set_field(&field).unwrap();
    // only the innermost shell
    let points = tf().points.into_iter().map(|p| ControlPoint { opacity: if p.at > 0.6 { 0.5 } else { 0.0 }, ..p });
    let table = Arc::new(ClassTable::build(&TransferFunction { points: points.collect(), ..tf() }, 1.0, true));
    renderer.set_table(&table);
    let pull = Stack { items: stack().items.into_iter().take(1).collect() };
    let small = |zoom: f64, perspective| Camera { target: grid.center(), radius: 110.0, zoom, ..camera(perspective) };
    for (camera, deformed, [width, height]) in [
        (small(1.5, false), false, [333, 217]),
        (small(1.2, true), false, [400, 300]),
        // more than the picture holds
        (small(6.0, true), false, [257, 411]),
        (small(1.4, true), true, [320, 320]),
    ] {
        let map: &dyn BackwardMap = if deformed { &pull } else { &Identity };
        let geometry = Arc::new(box_slices(&field.grid, &camera, map, 1.0, if deformed { 4 } else { 0 }));
        renderer.set_geometry(&geometry);
        for shading in [Shading::Volume, iso(100.0)] {
            let look = Look { shading, ..Look::default() };
            let frame = Frame::new(&camera, &look, &field, field.range, &geometry, width, height);
            let [with, without] = [true, false].map(|on| {
                renderer.set_culling(on);
                (renderer.draw(&frame).unwrap(), renderer.fragments())
            });
            let pairs = with.0.pixels.as_flattened().iter().zip(without.0.pixels.as_flattened());
            let off = pairs.filter(|(a, b)| a.abs_diff(**b) > 1).count();
            // where a corner lies on another triangle's edge, a pixel may be drawn twice or not at all
            assert!(off as u32 <= width * height / 1000, "{deformed} {width} x {height}: {off}");
            if let (Some(with), Some(without)) = (with.1, without.1) {
                assert!(with < without, "{with} fragments instead of {without}");
            }
        }
    }
}

/// Slices that cover the whole picture, and of which none hides another: as many fragments as slices times pixels.
#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn fragments_are_counted() {
    let grid = Grid::aligned([32, 32, 32], DVec3::ONE, DVec3::ZERO).unwrap();
    let field = Field::from_volume(Arc::new(Volume::new(grid, 1, Samples::U8(vec![128; grid.len()]))));
    let faint = ControlPoint { at: 0.0, color: [1.0; 3], opacity: 0.001 };
    let thin = TransferFunction { points: vec![faint, ControlPoint { at: 1.0, ..faint }], ..tf() };
    let table = Arc::new(ClassTable::build(&thin, 1.0, true));
    let camera = Camera { target: grid.center(), yaw: 0.0, pitch: 0.0, radius: 10.0, zoom: 1.0, ..camera(false) };
    let geometry = Arc::new(box_slices(&grid, &camera, &Identity, 1.0, 0));
    let frame = Frame::new(&camera, &Look::default(), &field, [0.0, 255.0], &geometry, 70, 50);
    let filled = geometry.slices.iter().filter(|s| !s.is_empty()).count() as u64;
    let (_, counted) = render_until(&geometry, &field, &table, &frame, None, &|| false).unwrap();
    assert_eq!(counted, filled * 70 * 50);
    let mut renderer = Renderer::new(gpu()).unwrap();
    renderer.set_field(&field).unwrap();
    renderer.set_table(&table);
    renderer.set_geometry(&geometry);
    renderer.draw(&frame).unwrap();
    assert_eq!(renderer.fragments().is_some(), gpu().capabilities().statistics);
    if let Some(n) = renderer.fragments() {
        // devices shade in blocks and count what of them is not drawn; Mesa's lavapipe has blocks of 16 by 16 pixels
        assert!((counted..counted * 2).contains(&n), "{n} on the GPU, {counted} on the CPU");
    }
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn the_same_volume_is_uploaded_once() {
    let mut renderer = Renderer::new(gpu()).unwrap();
    let table = Arc::new(ClassTable::build(&tf(), 1.0, true));
    renderer.set_table(&table);
    for t in [ScalarType::U8, ScalarType::F32] {
        let shared = Arc::new(volume(t, 1));
        let field = Field::from_volume(shared.clone());
        let geometry = Arc::new(box_slices(&field.grid, &camera(false), &Identity, 1.5, 0));
        renderer.set_geometry(&geometry);
        let frame = Frame::new(&camera(false), &Look::default(), &field, field.range, &geometry, 64, 64);
        assert!(renderer.set_field(&field).unwrap());
        let first = renderer.draw(&frame).unwrap();
        // another handle on the same texels
        assert!(field.same_as(&field.clone()) && !renderer.set_field(&field.clone()).unwrap());
        assert_eq!(renderer.draw(&frame).unwrap().pixels, first.pixels);
        // the same texels elsewhere in the world, and equal ones in another place
        let mut moved = field.clone();
        moved.grid.world_from_voxel.translation.x += 1.0;
        assert!(renderer.set_field(&moved).unwrap());
        let twin = Field::from_volume(Arc::new(shared.as_ref().clone()));
        assert!(!twin.same_as(&field) && renderer.set_field(&twin).unwrap());
        assert_eq!(renderer.draw(&frame).unwrap().pixels, first.pixels);
    }
}

/// The reference: every voxel in `f64`.
fn resampled(volume: &Volume, stack: &Stack, output: &Grid, interpolation: Interpolation, outside: f64) -> Vec<f64> {
    let voxel_from_world = volume.grid.voxel_from_world();
    let [nx, ny, nz] = output.dims;
    let mut values = Vec::new();
    with_samples!(&volume.samples, v => {
        let sampler = Sampler::new(v, volume.grid.dims, volume.channels);
        for i in 0..nx * ny * nz {
            let at = DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / nx / ny) as f64);
            let p = stack.backward(output.world_from_voxel.transform_point3(at));
            let mut sample = v[..volume.channels].to_vec();
            let found = sampler.sample(interpolation, voxel_from_world.transform_point3(p), &mut sample);
            values.extend(sample.iter().map(|s| if found { s.to_f64() } else { outside }));
        }
    });
    values
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn resampled_volumes_agree() {
    let gpu = gpu();
    let pass = ResamplePass::new(&gpu).unwrap();
    let stack = stack();
    // finer, and larger than the input
    let output = Grid::aligned([45, 51, 60], DVec3::splat(1.1), grid().bounds().0 - 3.0).unwrap();
    for (t, channels) in
        [(ScalarType::U8, 1), (ScalarType::U16, 1), (ScalarType::F32, 1), (ScalarType::I16, 3), (ScalarType::U8, 4)]
    {
        let v = volume(t, channels);
        let job = ResampleJob { stack: &stack, output: &output, nearest: false, outside: 7.0 };
        let made = pass.volume(&gpu, &v, job).unwrap();
        assert_eq!((made.samples.scalar_type(), made.channels), (t, channels));
        let want = resampled(&v, &stack, &output, Interpolation::Linear, 7.0);
        let mut off = 0;
        let mut moved = 0;
        for (i, w) in want.iter().enumerate() {
            let error = (made.samples.get(i) - w).abs();
            // one grey level; of 256 where there are more
            let grey = if t == ScalarType::F32 { 1.0 / 255.0 } else { 1.0 };
            // on the faces of the input a rounding decides whether there is a value
            let face = *w == 7.0 || made.samples.get(i) == 7.0;
            if error > grey && !face {
                panic!("{t:?} x{channels}: sample {i} is {} instead of {w}", made.samples.get(i));
            }
            off += usize::from(error > grey);
            moved += usize::from(*w != 7.0);
        }
        assert!(off * 2000 < want.len() && moved * 4 > want.len(), "{t:?}: {off} of {} differ", want.len());
    }
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn what_is_not_moved_is_bit_exact() {
    let gpu = gpu();
    let pass = ResamplePass::new(&gpu).unwrap();
    for t in [ScalarType::U8, ScalarType::U16, ScalarType::I16, ScalarType::F32] {
        let v = volume(t, 1);
        let nothing = Stack::default();
        let run = |output: &Grid, nearest| {
            pass.volume(&gpu, &v, ResampleJob { stack: &nothing, output, nearest, outside: 0.0 }).unwrap()
        };
        for nearest in [false, true] {
            assert_eq!(run(&v.grid, nearest).samples, v.samples, "{t:?}");
        }
        // shifted by whole voxels: the rest is the outside value
        let shift = DAffine3::from_translation(DVec3::new(3.0, -2.0, 5.0));
        let moved = Grid { world_from_voxel: v.grid.world_from_voxel * shift, ..v.grid };
        let made = run(&moved, false);
        let [nx, ny, nz] = v.grid.dims.map(|n| n as i64);
        for i in 0..nx * ny * nz {
            let [x, y, z] = [i % nx + 3, i / nx % ny - 2, i / nx / ny + 5];
            let inside = x < nx && y >= 0 && z < nz;
            let want = if inside { v.samples.get(((z * ny + y) * nx + x) as usize) } else { 0.0 };
            assert_eq!(made.samples.get(i as usize), want, "{t:?} at {x} {y} {z}");
        }
    }
}

/// Labels stay labels, whatever the deformation.
#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn labels_stay_labels() {
    let gpu = gpu();
    let g = grid();
    let labels: Vec<u16> = (0..g.len()).map(|i| [0, 7, 1000, 65535][i / 5 % 4]).collect();
    let v = Volume::new(g, 1, Samples::U16(labels));
    let stack = stack();
    let job = ResampleJob { stack: &stack, output: &g, nearest: true, outside: 7.0 };
    let made = ResamplePass::new(&gpu).unwrap().volume(&gpu, &v, job).unwrap();
    let Samples::U16(values) = &made.samples else { panic!("the type stays") };
    assert!(values.iter().all(|v| [0, 7, 1000, 65535].contains(v)));
    let want = resampled(&v, &stack, &g, Interpolation::Nearest, 7.0);
    let same = values.iter().zip(&want).filter(|(a, b)| f64::from(**a) == **b).count();
    assert!(same as f64 > 0.999 * want.len() as f64, "{same} of {}", want.len());
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn a_receiver_stops_the_work() {
    let gpu = gpu();
    let v = volume(ScalarType::U8, 1);
    let stack = Stack::default();
    let job = ResampleJob { stack: &stack, output: &v.grid, nearest: false, outside: 0.0 };
    let mut next = 0;
    let pass = ResamplePass::new(&gpu).unwrap();
    let stopped = pass.run(&gpu, &v, job, |first, values| {
        assert_eq!(first, next);
        next += values.len();
        Err("full")
    });
    assert_eq!(stopped.unwrap_err().to_string(), "full");
    let all: Result<_, voxclay::gpu::ResampleError<()>> = pass.run(&gpu, &v, job, |first, values| {
        next = first + values.len();
        Ok(())
    });
    assert!(all.is_ok() && next == v.grid.len());
}

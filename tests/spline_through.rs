//! Smooth surfaces seen through strokes, several at once, and their shade.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use voxclay::compare::picture::pictures;
use voxclay::deform::{Deformation, Deformer, DisplacementVolume};
use voxclay::evaluate::load::{Object, load};
use voxclay::evaluate::picture::{Backend, Mode, Refinement, Renderer, SmoothLook, ViewOptions};
use voxclay::render::{Camera, Field, Look, Picture, Projection, Shading};
use voxclay::scene::{CameraSpec, CutPlane, Document, ProxySource, VolumeSource};
use voxclay::spline::paint::Shell;
use voxclay::spline::{Crossing, Level, Ray, Spline, Through, ThroughLevel, VoxelMap};
use voxclay::volume::{Grid, Samples, Volume};

const N: usize = 40;

fn sampled(f: impl Fn(DVec3) -> f64) -> Vec<f32> {
    let at = |n: usize| DVec3::new((n % N) as f64, (n / N % N) as f64, (n / N / N) as f64);
    (0..N * N * N).map(|n| f(at(n)) as f32).collect()
}

/// Balls that run into each other, higher inside.
fn blobs() -> Spline {
    let centers = [(14.0, 18.0, 20.0, 5.0), (24.0, 20.0, 16.0, 6.0), (20.0, 27.0, 25.0, 4.0), (28.0, 12.0, 27.0, 3.0)];
    let samples = sampled(|p| {
        let one =
            |&(x, y, z, r): &(f64, f64, f64, f64)| (-(p - DVec3::new(x, y, z)).length_squared() / (2.0 * r * r)).exp();
        centers.iter().map(one).sum()
    });
    Spline::new([N; 3], &samples, 0)
}

/// Everything is turned about the middle, the more the farther up, within a cylinder; elsewhere it lies still.
struct Twist;

const MIDDLE: DVec3 = DVec3::splat(19.5);

impl Twist {
    fn angle(p: DVec3) -> f64 {
        let r = (p - MIDDLE).truncate().length();
        let t = (1.0 - (r / 14.0).powi(2)).max(0.0);
        0.08 * (p.z - 12.0).max(0.0) * t * t
    }
}

impl VoxelMap for Twist {
    fn backward(&self, p: DVec3) -> DVec3 {
        MIDDLE + DMat3::from_rotation_z(Self::angle(p)) * (p - MIDDLE)
    }

    fn sources(&self, lower: DVec3, upper: DVec3) -> Option<[DVec3; 2]> {
        if upper.z <= 12.0 {
            return None;
        }
        // a turn moves nothing farther from the axis
        let far = [lower, upper].map(|c| (c - MIDDLE).truncate().abs()).into_iter().reduce(|a, b| a.max(b)).unwrap();
        let r = far.length();
        Some([DVec3::new(19.5 - r, 19.5 - r, lower.z), DVec3::new(19.5 + r, 19.5 + r, upper.z)])
    }
}

struct Still;

impl VoxelMap for Still {
    fn backward(&self, p: DVec3) -> DVec3 {
        p
    }

    fn sources(&self, _: DVec3, _: DVec3) -> Option<[DVec3; 2]> {
        None
    }
}

fn rays(count: usize) -> impl Iterator<Item = Ray> {
    let mut seed = 7u64;
    let mut next = move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..count).map(move |_| {
        let mut vector = || DVec3::new(next(), next(), next());
        let origin = MIDDLE + 80.0 * vector().normalize();
        Ray { origin, direction: (MIDDLE + 12.0 * vector() - origin) / 50.0 }
    })
}

fn met(crossings: impl FnOnce(&mut dyn FnMut(f64, Crossing) -> ControlFlow<()>)) -> Vec<(f64, Crossing)> {
    let mut all = Vec::new();
    crossings(&mut |t, crossing| {
        all.push((t, crossing));
        ControlFlow::Continue(())
    });
    all
}

#[test]
fn what_lies_still_is_met_as_without_a_map() {
    let spline = Arc::new(blobs());
    let through = Through::new(spline.clone(), Box::new(Still), [0; 3], [N as isize - 1; 3]);
    let mut hits = 0;
    // the last is above the isovalue at the border
    for iso in [0.5, 0.2, 1e-12] {
        let (level, moved) = (Level::new(&spline, iso), ThroughLevel::new(&through, iso));
        for ray in rays(2000) {
            let expected = met(|f| level.crossings(&ray, [0.0, 100.0], f));
            let ours = met(|f| moved.crossings(&ray, [0.0, 100.0], f));
            assert_eq!(ours.len(), expected.len(), "{iso}: {ours:?} {expected:?}");
            for ((a, k), (b, l)) in ours.iter().zip(&expected) {
                assert!((a - b).abs() < 1e-9 && k == l, "{iso}: {ours:?} {expected:?}");
            }
            hits += ours.len();
        }
    }
    assert!(hits > 5000, "{hits}");
}

#[test]
fn what_moved_is_met_where_its_values_say() {
    let spline = Arc::new(blobs());
    let through = Through::new(spline.clone(), Box::new(Twist), [0; 3], [N as isize - 1; 3]);
    let (mut hits, mut moved) = (0, 0);
    for iso in [0.5, 0.2] {
        let level = ThroughLevel::new(&through, iso);
        for ray in rays(1500) {
            let ours = met(|f| level.crossings(&ray, [0.0, 100.0], f));
            let value = |t: f64| spline.value(Twist.backward(ray.at(t))) - iso;
            for (n, (t, crossing)) in ours.iter().enumerate() {
                assert_eq!(*crossing, [Crossing::In, Crossing::Out][n % 2], "{ours:?}");
                assert!(value(*t).abs() < 1e-9, "{}", value(*t));
                moved += usize::from(Twist.backward(ray.at(*t)).distance(ray.at(*t)) > 0.5);
            }
            // nothing is missed that dense samples see, but what is thinner than half a voxel
            let step = 0.02 / ray.direction.length();
            let mut above = false;
            let mut since = 0.0;
            let mut dense = 0;
            let first = 20.0;
            for i in 0.. {
                let t = first + f64::from(i) * step;
                if t > 80.0 {
                    break;
                }
                if (value(t) >= 0.0) != above {
                    if dense > 0 && t - since < 0.5 / ray.direction.length() {
                        dense = usize::MAX;
                        break;
                    }
                    (above, since) = (!above, t);
                    dense += 1;
                }
            }
            if dense != usize::MAX {
                assert_eq!(ours.len(), dense, "{ours:?}");
            }
            hits += ours.len();
        }
    }
    assert!(hits > 3000 && moved > 1000, "{hits} {moved}");
}

/// A volume of one's own in the place of a phantom.
fn object(samples: Vec<f32>) -> Object {
    let document = Document::new(VolumeSource::Phantom { name: "gaussian".into(), size: 16 });
    let mut object = load(&document, Path::new("")).unwrap();
    let grid = Grid::aligned([N; 3], DVec3::ONE, -MIDDLE).unwrap();
    object.volume = Arc::new(Volume::new(grid, 1, Samples::F32(samples)));
    object.field = Field::from_volume(object.volume.clone());
    object
}

/// From the front, two pixels for each voxel.
fn camera() -> Camera {
    Camera {
        target: DVec3::ZERO,
        yaw: 0.0,
        pitch: 0.0,
        radius: 20.0,
        zoom: 1.0,
        roll: 0.0,
        projection: Projection::Orthographic,
    }
}

const SIZE: u32 = 80;

fn drawn(object: &Object, smooth: SmoothLook, iso: f64, lit: bool, camera: &Camera) -> Picture {
    let options = ViewOptions {
        size: (SIZE, SIZE),
        slices: None,
        mode: Mode::Spline,
        refinement: Refinement::Depth(0),
        backend: Backend::Cpu,
        transparent: true,
        corrections: Some(0),
    };
    let look = Look { shading: Shading::Iso { value: iso, color: [1.0, 0.0, 0.0] }, lit, ..Look::default() };
    let mut renderer = Renderer::new(Backend::Cpu).unwrap();
    renderer.set_smooth_look(smooth);
    renderer.picture(object, camera, &look, &options).unwrap().0
}

fn at(picture: &Picture, x: u32, y: u32) -> [u8; 4] {
    picture.pixels[(y * picture.width + x) as usize]
}

#[test]
fn translucent_surfaces_add_up_in_order() {
    // radii 14, 10 and 6
    let ball = object(sampled(|p| -p.distance(MIDDLE)));
    let green = Shell { iso: -10.0, color: [0.0, 1.0, 0.0], opacity: 0.5 };
    let blue = Shell { iso: -6.0, color: [0.0, 0.0, 1.0], opacity: 1.0 };
    let smooth = SmoothLook { opacity: 0.2, shells: vec![blue, green], ..SmoothLook::default() };
    let picture = drawn(&ball, smooth.clone(), -14.0, false, &camera());
    let byte = |v: f64| {
        let v = if v <= 0.0031308 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
        (v * 255.0).round() as u8
    };
    // how many pixels to a voxel
    let row: Vec<[u8; 4]> = (0..SIZE).map(|x| at(&picture, x, SIZE / 2)).collect();
    let width = row.iter().filter(|p| p[3] > 0).count() as f64;
    let pixels = width / 28.0;
    let expect = |radius: f64, color: [f64; 4], what: &str| {
        for side in [-1.0, 1.0] {
            let ours = at(&picture, (0.5 * f64::from(SIZE) + side * radius * pixels) as u32, SIZE / 2);
            let [r, g, b, a] = color;
            let expected = [byte(r / a), byte(g / a), byte(b / a), (255.0 * a).round() as u8];
            assert!((0..4).all(|c| ours[c].abs_diff(expected[c]) <= 1), "{what}: {ours:?}, not {expected:?}");
        }
    };
    // red in front and behind
    expect(12.0, [0.36, 0.0, 0.0, 0.36], "one");
    // red, green, green, red
    expect(8.0, [0.2 + 0.2 * 0.2, 0.8 * 0.75, 0.0, 1.0 - 0.2 * 0.8], "two");
    // red, green, and blue hides the rest
    expect(3.0, [0.2, 0.4, 0.4, 1.0], "three");
    assert_eq!(at(&picture, 1, 1), [0; 4]);

    // cut through the middle, the innermost shows on the cut
    let mut cut = ball;
    let towards = camera().to_eye();
    cut.clip = vec![CutPlane { point: DVec3::ZERO, normal: towards }];
    let picture = drawn(&cut, smooth, -14.0, false, &camera());
    let middle = |radius: f64| at(&picture, (0.5 * f64::from(SIZE) + radius * pixels) as u32, SIZE / 2);
    assert_eq!(middle(3.0), [0, 0, 255, 255]);
    // the cap of green, green behind it, red behind that
    let [r, g, b, a] = [0.25 * 0.2, 0.75, 0.0, 0.75 + 0.25 * 0.2];
    let expected = [byte(r / a), byte(g / a), byte(b / a), (255.0f64 * a).round() as u8];
    let ours = middle(8.0);
    assert!((0..4).all(|c| ours[c].abs_diff(expected[c]) <= 1), "{ours:?}, not {expected:?}");
}

fn strokes(object: &mut Object) {
    let pull = |p: DVec3, v: DVec3| {
        Deformation::new("", Deformer::Displacement(DisplacementVolume::from_drag(p, v, 9.0).unwrap()))
    };
    object.stack.items = vec![
        pull(DVec3::new(9.0, 0.0, 0.0), DVec3::new(3.0, 1.0, 0.5)),
        pull(DVec3::new(0.0, -6.0, 9.0), DVec3::new(0.0, 1.0, 2.5)),
    ];
}

#[test]
fn drafts_of_strokes_show_the_surface_itself() {
    let rest = object(sampled(|p| -p.distance(MIDDLE)));
    let mut pulled = rest.clone();
    strokes(&mut pulled);
    let look = Look { shading: Shading::Iso { value: -11.0, color: [0.9, 0.8, 0.7] }, ..Look::default() };
    let options = |refinement| ViewOptions {
        size: (SIZE, SIZE),
        slices: None,
        mode: Mode::Spline,
        refinement,
        backend: Backend::Cpu,
        transparent: true,
        corrections: None,
    };
    let take = |renderer: &mut Renderer, object: &Object, direct, refinement| {
        renderer.set_smooth_look(SmoothLook { direct, ..SmoothLook::default() });
        renderer.picture(object, &camera(), &look, &options(refinement)).unwrap()
    };
    let fine = Refinement::Tolerance(0.25);
    let fresh = |object: &Object, direct| take(&mut Renderer::new(Backend::Cpu).unwrap(), object, direct, fine).0;
    let (direct, resampled, still) = (fresh(&pulled, true), fresh(&pulled, false), fresh(&rest, false));
    assert!(direct.pixels != resampled.pixels && direct.pixels != still.pixels);

    // the hand begins to move over an object at rest, rests, and undoes
    let mut renderer = Renderer::new(Backend::Cpu).unwrap();
    assert!(!renderer.surface_is_ready(&rest));
    assert_eq!(take(&mut renderer, &rest, false, fine).0.pixels, still.pixels);
    assert!(renderer.surface_is_ready(&pulled));
    let (draft, report) = take(&mut renderer, &pulled, false, Refinement::Draft);
    assert_eq!(draft.pixels, direct.pixels);
    assert!(report.warnings.is_empty());
    assert_eq!(take(&mut renderer, &pulled, false, fine).0.pixels, resampled.pixels);
    assert_eq!(take(&mut renderer, &pulled, false, Refinement::Draft).0.pixels, resampled.pixels);
    assert_eq!(take(&mut renderer, &rest, false, Refinement::Draft).0.pixels, still.pixels);

    // and begins with an object that was deformed before
    let mut renderer = Renderer::new(Backend::Cpu).unwrap();
    take(&mut renderer, &pulled, false, fine);
    let mut more = pulled.clone();
    more.stack.items.pop();
    assert!(!renderer.surface_is_ready(&more));
    renderer.make_surface_ready(&pulled).unwrap();
    assert!(renderer.surface_is_ready(&more));
    assert_eq!(take(&mut renderer, &more, false, Refinement::Draft).0.pixels, fresh(&more, true).pixels);
    // another volume is another matter
    assert!(!renderer.surface_is_ready(&object(sampled(|p| -p.distance(MIDDLE)))));
}

#[test]
fn straight_through_strokes_is_like_resampling() {
    let mut ball = object(sampled(|p| -p.distance(MIDDLE)));
    strokes(&mut ball);
    for (name, camera) in [("front", camera()), ("side", Camera { yaw: 70.0, pitch: 30.0, ..camera() })] {
        let shaded = |direct| SmoothLook { direct, occlusion: true, shadows: true, ..SmoothLook::default() };
        let [resampled, direct] = [false, true].map(|direct| drawn(&ball, shaded(direct), -11.0, true, &camera));
        let still = drawn(&object(sampled(|p| -p.distance(MIDDLE))), shaded(true), -11.0, true, &camera);
        let psnr = |a: &Picture| pictures(&a.pixels, &direct.pixels, [SIZE; 2]).unwrap().psnr;
        let (close, far) = (psnr(&resampled), psnr(&still));
        assert!(close > 36.0, "{name}: {}", close);
        assert!(far < 28.0, "{name}: {}", far);
    }
}

#[test]
fn the_mesh_cuts_what_is_seen_through_strokes() {
    let mut document = Document::new(VolumeSource::Phantom { name: "gaussian".into(), size: 40 });
    document.proxy = ProxySource::Auto { iso: Some(0.6) };
    let whole = load(&document, Path::new("")).unwrap();
    assert!(whole.shaped);
    let camera = whole.camera(&CameraSpec { fov_y: None, ..CameraSpec::default() });
    let outline = |object: &Object, iso: f64| {
        let picture = drawn(object, SmoothLook { direct: true, ..SmoothLook::default() }, iso, false, &camera);
        picture.pixels.iter().filter(|p| p[3] > 0).count() as f64
    };
    // a surface that lies outside the mesh is cut off where the mesh is
    let by_mesh = outline(&whole, 0.05);
    let corners: Vec<DVec3> = whole.mesh.positions.clone();
    let mut boxed = whole.clone();
    boxed.shaped = false;
    let by_value = outline(&boxed, 0.05);
    assert!(by_mesh < 0.8 * by_value, "{by_mesh} {by_value}");
    // the area of the mesh's outline, a ball's
    let center = corners.iter().sum::<DVec3>() / corners.len() as f64;
    let radius = corners.iter().map(|p| p.distance(center)).sum::<f64>() / corners.len() as f64;
    let clip = camera.clip_from_world(SIZE, SIZE);
    let across = clip.transform_vector3(camera.axes().x_axis * radius).length() * 0.5 * f64::from(SIZE);
    let expected = std::f64::consts::PI * across * across;
    assert!((by_mesh / expected - 1.0).abs() < 0.05, "{by_mesh} {expected}");
}

//! Iso-surfaces of splines on the GPU against rays of the CPU: the same hits, depths and normals.
//!
//! Without a graphics driver these tests show as ignored (see `build.rs`); with one that does not open they fail.

use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock};

use glam::{DAffine3, DMat3, DQuat, DVec3};
use voxclay::deform::{Deformation, Deformer, DisplacementVolume};
use voxclay::evaluate::load::load;
use voxclay::evaluate::picture::{Backend, Mode, Refinement, Renderer, SmoothLook, ViewOptions};
use voxclay::gpu::{Coefficients, Gpu, GpuError, Preference, Shade, SplineLoad, SplinePass, SplineView};
use voxclay::render::{Camera, Field, Look, Projection, Shading};
use voxclay::scene::{CameraSpec, Document, VolumeSource};
use voxclay::spline::paint::{Curvature, Paint, Shell};
use voxclay::spline::{Crossing, Kind, Level, Ray, Spline};
use voxclay::volume::{Grid, Samples, Volume};

fn gpu() -> Arc<Gpu> {
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    GPU.get_or_init(|| Arc::new(Gpu::open(Preference::Any).expect("a graphics driver is installed"))).clone()
}

/// One pass for all tests, which take turns.
fn with_pass<R>(body: impl FnOnce(&Gpu, &mut SplinePass) -> R) -> R {
    static PASS: OnceLock<Mutex<SplinePass>> = OnceLock::new();
    let gpu = gpu();
    let pass = PASS.get_or_init(|| Mutex::new(SplinePass::new(&gpu).unwrap()));
    body(&gpu, &mut pass.lock().unwrap_or_else(std::sync::PoisonError::into_inner))
}

/// Marschner and Lobb's signal over n^3 samples, in 0..=1.
fn marschner_lobb(n: usize) -> Spline {
    let rho = |r: f64| (2.0 * std::f64::consts::PI * 6.0 * (0.5 * std::f64::consts::PI * r).cos()).cos();
    let at = |i: usize| 2.0 * i as f64 / (n - 1) as f64 - 1.0;
    let value = |i: usize| {
        let (x, y, z) = (at(i % n), at(i / n % n), at(i / n / n));
        let (half, alpha) = ((0.5 * std::f64::consts::PI * z).sin(), 0.25);
        ((1.0 - half + alpha * (1.0 + rho(x.hypot(y)))) / (2.0 * (1.0 + alpha))) as f32
    };
    let samples: Vec<f32> = (0..n * n * n).map(value).collect();
    Spline::new([n; 3], &samples, 4)
}

fn random(dims: [usize; 3]) -> Spline {
    let mut state = 7u64;
    let samples: Vec<f32> = (0..dims.iter().product::<usize>())
        .map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        })
        .collect();
    Spline::new(dims, &samples, 0)
}

/// Two balls that grow into each other, off the middle, with values like those of a scan.
fn balls(dims: [usize; 3]) -> Spline {
    let size = DVec3::from(dims.map(|n| n as f64));
    let value = |i: usize| {
        let p = DVec3::new((i % dims[0]) as f64, (i / dims[0] % dims[1]) as f64, (i / dims[0] / dims[1]) as f64) / size;
        let bump = |c: [f64; 3], r: f64| (-(p - DVec3::from(c)).length_squared() / (r * r)).exp();
        (1000.0 * (bump([0.4, 0.45, 0.5], 0.2) + bump([0.65, 0.55, 0.45], 0.15)) - 1000.0) as f32
    };
    let samples: Vec<f32> = (0..dims.iter().product()).map(value).collect();
    Spline::new(dims, &samples, 2)
}

/// Neither cubic, isotropic nor axis-aligned; `mirrored`: left-handed, too.
fn slanted(mirrored: bool) -> DAffine3 {
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.2, 0.5));
    let sizes = DVec3::new(0.8, 1.0, if mirrored { -1.3 } else { 1.3 });
    DAffine3::from_mat3_translation(turn * DMat3::from_diagonal(sizes), DVec3::new(100.0, -50.0, 20.0))
}

struct Shot {
    what: &'static str,
    spline: Spline,
    iso: f64,
    world_from_voxel: DAffine3,
    yaw: f64,
    pitch: f64,
    zoom: f64,
    fov_y: Option<f64>,
    /// Of the target from the middle, as a share of the size.
    offset: DVec3,
    /// In voxels: points and outward normals.
    cuts: Vec<[DVec3; 2]>,
}

fn shot(what: &'static str, spline: Spline, iso: f64) -> Shot {
    Shot {
        what,
        spline,
        iso,
        world_from_voxel: DAffine3::IDENTITY,
        yaw: 30.0,
        pitch: 20.0,
        zoom: 1.0,
        fov_y: Some(28.0),
        offset: DVec3::ZERO,
        cuts: Vec::new(),
    }
}

const SIZE: [u32; 2] = [200, 170];

impl Shot {
    fn view(&self) -> SplineView {
        let size = DVec3::from(self.spline.dims().map(|n| n as f64));
        let to_world = &self.world_from_voxel;
        let middle = 0.5 * size - 0.5;
        let camera = Camera {
            target: to_world.transform_point3(middle + self.offset * size),
            yaw: self.yaw,
            pitch: self.pitch,
            roll: 0.0,
            radius: 0.5 * to_world.transform_vector3(size).length(),
            zoom: self.zoom,
            projection: self.fov_y.map_or(Projection::Orthographic, |fov_y| Projection::Perspective { fov_y }),
        };
        let covariant = to_world.matrix3.inverse().transpose();
        SplineView {
            clip_from_world: camera.clip_from_world(SIZE[0], SIZE[1]),
            world_from_voxel: *to_world,
            eye: self.fov_y.map(|_| camera.eye()),
            to_eye: camera.to_eye(),
            cuts: self
                .cuts
                .iter()
                .map(|[p, n]| [to_world.transform_point3(*p), (covariant * *n).normalize()])
                .collect(),
            size: SIZE,
            paint: Paint::default(),
            shade: Shade::default(),
        }
    }

    /// Depth and normal of each pixel, by rays.
    fn by_rays(&self, view: &SplineView) -> Vec<Option<(f64, DVec3)>> {
        let level = Level::new(&self.spline, self.iso);
        let voxel_from_world = self.world_from_voxel.inverse();
        let covariant = voxel_from_world.matrix3.transpose();
        let dims = self.spline.dims();
        (0..SIZE[0] * SIZE[1])
            .map(|i| {
                let (x, y) = (f64::from(i % SIZE[0]) + 0.5, f64::from(i / SIZE[0]) + 0.5);
                let [origin, direction] = view.ray(dims, x, y);
                let mut range = [-1e4, 1e4];
                let mut cut = None;
                let mut limit = |a: f64, b: f64, normal: Option<DVec3>| {
                    // beyond where a + b t > 0
                    let at = -a / b;
                    if b < 0.0 && at > range[0] {
                        range[0] = at;
                        cut = normal;
                    } else if b > 0.0 {
                        range[1] = range[1].min(at);
                    }
                };
                let at = |t: f64| self.world_from_voxel.transform_point3(origin + t * direction);
                let row = view.clip_from_world.row(2);
                let near = |t: f64| -row.dot(at(t).extend(1.0));
                limit(near(0.0), near(1.0) - near(0.0), None);
                for [p, n] in &view.cuts {
                    let beyond = |t: f64| (at(t) - *p).dot(*n);
                    limit(beyond(0.0), beyond(1.0) - beyond(0.0), Some(*n));
                }
                let ray = Ray { origin, direction };
                let (t, crossing) = level.first_hit(&ray, range)?;
                let to_eye = -(self.world_from_voxel.matrix3 * direction).normalize();
                let normal = match crossing {
                    Crossing::Start if t <= range[0] => cut.unwrap_or(to_eye),
                    Crossing::Start => {
                        let p = ray.at(t);
                        let face = (0..3).min_by(|&a, &b| {
                            let gap = |a: usize| (p[a] + 0.5).abs().min((p[a] + 0.5 - dims[a] as f64).abs());
                            gap(a).total_cmp(&gap(b))
                        });
                        covariant * DVec3::AXES[face.unwrap_or(0)]
                    }
                    _ => covariant * self.spline.gradient(ray.at(t)),
                };
                let normal = normal.normalize();
                Some((t, if normal.dot(to_eye) < 0.0 { -normal } else { normal }))
            })
            .collect()
    }
}

/// What differs between the two.
#[derive(Debug, Default)]
struct Compared {
    hits: usize,
    /// Hit by one of the two only, away from silhouettes and at them.
    holes: usize,
    rim: usize,
    /// Of hits that both have, leaving out `other`: largest differences in voxels and degrees.
    depth: f64,
    degrees: f64,
    /// Hits on another sheet, or where the ray all but touches the surface.
    other: usize,
}

fn compare(view: &SplineView, ours: &[[f32; 4]], rays: &[Option<(f64, DVec3)>], dims: [usize; 3]) -> Compared {
    let [width, height] = SIZE.map(|n| n as usize);
    let mut made = Compared::default();
    for (i, (ours, ray)) in ours.iter().zip(rays).enumerate() {
        let (x, y) = (i % width, i / width);
        let normal = DVec3::from([ours[0], ours[1], ours[2]].map(f64::from));
        // neighbours are missing, or far before or behind
        let rim = || {
            let around = (y.max(1) - 1..(y + 2).min(height))
                .flat_map(|v| (x.max(1) - 1..(x + 2).min(width)).map(move |u| v * width + u));
            let depths: Vec<f64> = around.map(|i| rays[i].map_or(1e9, |r| r.0)).collect();
            let lowest = depths.iter().copied().fold(f64::INFINITY, f64::min);
            depths.iter().any(|d| *d > lowest + 1.5)
        };
        match (normal != DVec3::ZERO, ray) {
            (false, None) => {}
            (true, Some((depth, expected))) => {
                made.hits += 1;
                let [_, direction] = view.ray(dims, x as f64 + 0.5, y as f64 + 0.5);
                let off = (f64::from(ours[3]) - depth).abs();
                let to_eye = -(view.world_from_voxel.matrix3 * direction).normalize();
                // a touching ray: a shift by a ten-thousandth of a voxel moves the hit much farther
                if off > 1e-4 && (expected.dot(to_eye) < 0.03 || normal.dot(to_eye) < 0.03 || rim()) {
                    made.other += 1;
                    continue;
                }
                let angle = expected.cross(normal).length().atan2(expected.dot(normal)).to_degrees();
                made.depth = made.depth.max(off);
                made.degrees = made.degrees.max(angle);
            }
            _ if rim() => made.rim += 1,
            _ => made.holes += 1,
        }
    }
    made
}

fn shots() -> Vec<Shot> {
    let inside = DVec3::new(0.02, 0.6, -0.05);
    let cut = [DVec3::new(17.3, 14.0, 16.0), DVec3::new(0.5, -1.0, 0.3)];
    vec![
        shot("Marschner-Lobb", marschner_lobb(40), 0.5),
        Shot { fov_y: None, yaw: -70.0, ..shot("Marschner-Lobb, parallel", marschner_lobb(40), 0.5) },
        Shot { fov_y: None, yaw: 0.0, pitch: 0.0, ..shot("along the axes", marschner_lobb(24), 0.5) },
        Shot { world_from_voxel: slanted(false), ..shot("balls, slanted", balls([40, 36, 28]), -500.0) },
        Shot { world_from_voxel: slanted(true), pitch: -40.0, ..shot("balls, mirrored", balls([40, 36, 28]), -500.0) },
        Shot { zoom: 30.0, offset: DVec3::new(-0.1, -0.05, 0.0), ..shot("balls, near", balls([40, 36, 28]), -500.0) },
        Shot { zoom: 0.1, ..shot("balls, far", balls([40, 36, 28]), -500.0) },
        shot("random", random([12, 11, 10]), 0.5),
        Shot { fov_y: None, pitch: 50.0, ..shot("random, parallel", random([12, 11, 10]), 0.45) },
        Shot { fov_y: Some(80.0), zoom: 6.0, offset: inside, ..shot("from within", marschner_lobb(40), 0.5) },
        Shot { fov_y: Some(80.0), zoom: 6.0, offset: inside, ..shot("from within, random", random([12, 11, 10]), 0.5) },
        Shot { cuts: vec![cut], ..shot("cut", balls([40, 36, 28]), -500.0) },
        Shot {
            cuts: vec![cut, [DVec3::new(15.0, 0.0, 0.0), DVec3::X]],
            fov_y: None,
            world_from_voxel: slanted(false),
            ..shot("cut twice", balls([40, 36, 28]), -500.0)
        },
    ]
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "no graphics driver is installed")]
fn hits_depths_and_normals_are_those_of_rays() {
    with_pass(|gpu, pass| {
        for shot in shots() {
            let view = shot.view();
            let rays = shot.by_rays(&view);
            for coefficients in Coefficients::ALL {
                pass.set_coefficients(coefficients);
                pass.set_spline(gpu, &shot.spline).unwrap();
                let ours = pass.probe(gpu, &view, shot.iso).unwrap();
                let made = compare(&view, &ours, &rays, shot.spline.dims());
                let what = format!("{}, {coefficients:?}: {made:?}", shot.what);
                assert!(made.hits >= 10 && made.holes == 0, "{what}");
                assert!(made.rim <= 2 && made.other <= 2, "{what}");
                assert!(made.depth < 2e-5 && made.degrees < 2e-3, "{what}");
            }
        }
    });
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "no graphics driver is installed")]
fn another_isovalue_or_view_is_like_a_new_pass() {
    let shot = shot("Marschner-Lobb", marschner_lobb(32), 0.5);
    let turned = Shot { yaw: 100.0, ..shot };
    let view = turned.view();
    with_pass(|gpu, pass| {
        pass.set_spline(gpu, &turned.spline).unwrap();
        for (n, iso) in [0.5, 0.3, 0.6, 7.0, 0.3, 0.5].into_iter().enumerate() {
            let coefficients = if n < 3 { Coefficients::Stored } else { Coefficients::Determining };
            pass.set_coefficients(coefficients);
            let kept = pass.probe(gpu, &view, iso).unwrap();
            let mut fresh = SplinePass::new(gpu).unwrap();
            fresh.set_coefficients(coefficients);
            fresh.set_spline(gpu, &turned.spline).unwrap();
            assert!(fresh.classify(gpu, iso).unwrap() > 0.0);
            let expected = fresh.probe(gpu, &view, iso).unwrap();
            assert_eq!(kept, expected, "{iso}");
            assert_eq!(kept.iter().all(|p| *p == [0.0; 4]), iso > 1.0);
            // lists that have grown stay
            let counts = |p: &SplinePass| SplineLoad { list_bytes: 0, ..p.load() };
            assert_eq!((counts(pass), pass.coefficients()), (counts(&fresh), coefficients));
        }
    });
}

/// Every tetrahedron whose hull holds the isovalue, and no other, up to the rounding of `f32`.
/// What is left out before it is shaded would not have been seen.
#[test]
#[cfg_attr(not(gpu_adapter), ignore = "no graphics driver is installed")]
fn early_depth_changes_nothing() {
    let (fast, plain) = (gpu(), Gpu::open_plain(Preference::Any).unwrap());
    assert!(!plain.capabilities().early_depth);
    for shot in shots() {
        let (view, spline) = (shot.view(), &shot.spline);
        let probed = |gpu: &Gpu| {
            let mut pass = SplinePass::new(gpu).unwrap();
            pass.set_spline(gpu, spline).unwrap();
            pass.probe(gpu, &view, shot.iso).unwrap()
        };
        let (early, late) = (probed(&fast), probed(&plain));
        let different = early.iter().zip(&late).filter(|(a, b)| a != b).count();
        assert_eq!(different, 0, "{}", shot.what);
        assert!(early.iter().any(|p| *p != [0.0; 4]));
    }
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "no graphics driver is installed")]
fn the_tetrahedra_are_those_whose_hull_holds_the_isovalue() {
    with_pass(|gpu, pass| {
        for (spline, iso) in [(random([13, 9, 10]), 0.5), (balls([40, 36, 28]), -500.0), (marschner_lobb(24), 0.4)] {
            let level = Level::new(&spline, iso);
            let [nx, ny, nz] = spline.dims();
            let (mut surely, mut perhaps) = ([0; 2], [0; 2]);
            for at in 0..nx * ny * nz {
                let cube = [at % nx, at / nx % ny, at / nx / ny];
                let mut of_cube = [0; 2];
                for kind in Kind::all().filter(|_| level.is_active(cube)) {
                    let [lo, hi] = spline.piece(cube, kind).hull();
                    let slack = 1e-5 * ((lo - iso).abs() + (hi - iso).abs());
                    of_cube[0] += u32::from(lo + slack <= iso && hi - slack >= iso);
                    of_cube[1] += u32::from(lo - slack <= iso && hi + slack >= iso);
                }
                for (all, tets) in [(&mut surely, of_cube[0]), (&mut perhaps, of_cube[1])] {
                    all[0] += tets;
                    all[1] += tets.min(1);
                }
            }
            pass.set_spline(gpu, &spline).unwrap();
            pass.classify(gpu, iso).unwrap();
            let found = [pass.load().tets, pass.load().cubes];
            for (n, least) in [1000, 100].into_iter().enumerate() {
                let range = surely[n]..=perhaps[n];
                assert!(range.contains(&found[n]) && surely[n] > least, "{surely:?} {found:?} {perhaps:?}");
            }
        }
    });
}

/// Buffers that are too small at first grow; where they may not, that is said.
#[test]
#[cfg_attr(not(gpu_adapter), ignore = "no graphics driver is installed")]
fn what_there_is_no_room_for_is_found() {
    let gpu = gpu();
    // all of its blocks are full of surface
    let shot = shot("random", random([44, 44, 44]), 0.5);
    let view = shot.view();
    for coefficients in [Coefficients::Stored, Coefficients::Determining] {
        let with_limit = |limit| {
            let mut pass = SplinePass::with_limit(&gpu, limit).unwrap();
            pass.set_coefficients(coefficients);
            pass.set_spline(&gpu, &shot.spline).unwrap();
            pass
        };
        let mut wide = with_limit(u64::MAX);
        let expected = wide.probe(&gpu, &view, shot.iso).unwrap();
        let load = wide.load();
        // 64 tetrahedra and 8 cubes a block are expected, so there was no room at first
        assert!(load.blocks == 1331 && load.tets > 100 * load.blocks && load.cubes > 32 * load.blocks, "{load:?}");
        let (each, count) = match coefficients {
            Coefficients::Determining => (224, load.cubes),
            _ => (80, load.tets),
        };
        let bytes = each * u64::from(count);
        assert_eq!(load.coefficient_bytes, bytes);
        let mut enough = with_limit(bytes + each);
        assert_eq!(enough.probe(&gpu, &view, shot.iso).unwrap(), expected);
        let mut narrow = with_limit(bytes - each);
        assert!(matches!(narrow.probe(&gpu, &view, shot.iso), Err(GpuError::TooLarge { .. })));
        narrow.set_coefficients(Coefficients::OnTheFly);
        assert_eq!(narrow.probe(&gpu, &view, shot.iso).unwrap().len(), expected.len());
    }
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "no graphics driver is installed")]
fn pictures_are_those_of_the_cpu() {
    let pull =
        DisplacementVolume::from_drag(DVec3::new(0.0, -12.0, 0.0), DVec3::new(3.0, -9.0, 4.0), 26.0).expect("a stroke");
    let pulled = Deformation::new("pull", Deformer::Displacement(pull));
    let mut gpu = Renderer::new(Backend::Gpu).unwrap();
    for (name, fov_y, deformed, clipped) in [
        ("gaussian", Some(30.0), true, false),
        ("engine", None, false, true),
        ("head", Some(28.0), false, true),
        ("marschner-lobb", Some(20.0), false, false),
    ] {
        let mut document = Document::new(VolumeSource::Phantom { name: name.into(), size: 48 });
        if deformed {
            document.stack.items = vec![pulled.clone()];
        }
        if clipped {
            document.clip.region[0] = [0.0, 0.55];
        }
        let object = load(&document, Path::new("")).unwrap();
        let camera = object.camera(&CameraSpec { fov_y, ..CameraSpec::default() });
        let plain = SmoothLook::default();
        let [lo, hi] = object.field.range;
        let shell =
            |part: f64, opacity| Shell { iso: object.iso + part * (hi - object.iso), color: [0.2, 0.7, 0.9], opacity };
        assert!(hi > lo);
        let shells = vec![shell(0.3, 0.6), shell(0.55, 1.0)];
        let shaded = SmoothLook { occlusion: true, shadows: true, ..plain.clone() };
        for (what, transparent, smooth_look) in [
            ("plain", false, plain.clone()),
            ("transparent", true, plain.clone()),
            ("mean", false, SmoothLook { curvature: Some(Curvature::Mean), caps: true, ..plain.clone() }),
            ("gaussian", false, SmoothLook { curvature: Some(Curvature::Gaussian), ..plain.clone() }),
            ("shaded", false, shaded.clone()),
            ("layers", true, SmoothLook { opacity: 0.4, shells: shells.clone(), ..plain.clone() }),
            ("shaded layers", false, SmoothLook { opacity: 0.4, shells, ..shaded }),
        ] {
            // a dozen layers take their time on a processor
            if !smooth_look.shells.is_empty() && (what == "layers") != (name == "gaussian") {
                continue;
            }
            if what == "shaded layers" && name != "engine" {
                continue;
            }
            let options = ViewOptions {
                size: if smooth_look.shells.is_empty() { (150, 130) } else { (90, 78) },
                slices: None,
                mode: Mode::Spline,
                refinement: Refinement::Tolerance(0.1),
                backend: Backend::Cpu,
                transparent,
                corrections: None,
            };
            let shade = |color| Shading::Iso { value: object.iso, color };
            let look = Look { shading: shade([0.8, 0.6, 0.4]), ..Look::default() };
            let mut cpu = Renderer::new(Backend::Cpu).unwrap();
            cpu.set_smooth_look(smooth_look.clone());
            let several = !smooth_look.shells.is_empty();
            gpu.set_smooth_look(smooth_look);
            let (expected, _) = cpu.picture(&object, &camera, &look, &options).unwrap();
            assert!(expected.pixels.iter().any(|p| *p != expected.pixels[0]));
            // colours are rounded to 16 bits of a float on the way; filters of textures and sums of layers round more
            let step = match what {
                "plain" | "transparent" | "mean" | "gaussian" => 1,
                _ => 3,
            };
            let far = |a: [u8; 4], b: [u8; 4]| (0..4).any(|c| a[c].abs_diff(b[c]) > step);
            // layers that touch are told apart, or not
            let most = if transparent && what == "layers" || what == "shaded layers" { 40 } else { 3 };
            let ways: &[_] = if several { &[None, Some(Coefficients::Determining)] } else { &[None] };
            for chosen in ways {
                gpu.set_coefficients(*chosen);
                let (ours, report) = gpu.picture(&object, &camera, &look, &options).unwrap();
                assert_eq!((report.backend, report.warnings), ("gpu", Vec::<String>::new()));
                assert!(report.triangles > 1000, "{}", report.triangles);
                assert_eq!(report.spline.map(|s| s.0), Some(chosen.unwrap_or(Coefficients::Stored)));
                let off = ours.pixels.iter().zip(&expected.pixels).filter(|(a, b)| far(**a, **b)).count();
                assert!(off <= most, "{name}, {what}, {chosen:?}: {off} pixels");
            }
        }
    }
}

/// What no texture holds is drawn all the same, by the CPU, and that is said.
#[test]
#[cfg_attr(not(gpu_adapter), ignore = "no graphics driver is installed")]
fn what_no_texture_holds_is_drawn_by_the_cpu() {
    let document = Document::new(VolumeSource::Phantom { name: "gaussian".into(), size: 16 });
    let mut object = load(&document, Path::new("")).unwrap();
    let long = gpu().limits().max_texture_dimension_3d as usize;
    let grid = Grid::aligned([long, 5, 5], DVec3::ONE, DVec3::ZERO).unwrap();
    let middle = |i: usize| (i / long % 5 == 2 && i / long / 5 == 2) as u8 as f32;
    let samples = Samples::F32((0..grid.len()).map(middle).collect());
    object.volume = Arc::new(Volume::new(grid, 1, samples));
    object.field = Field::from_volume(object.volume.clone());
    object.focus = (DVec3::new(20.0, 2.0, 2.0), 10.0);
    let camera = object.camera(&CameraSpec::default());
    let options = ViewOptions {
        size: (60, 50),
        slices: None,
        mode: Mode::Spline,
        refinement: Refinement::Tolerance(0.1),
        backend: Backend::Gpu,
        transparent: true,
        corrections: Some(0),
    };
    let look = Look { shading: Shading::Iso { value: 0.2, color: [0.8, 0.6, 0.4] }, ..Look::default() };
    let (picture, report) = Renderer::new(Backend::Gpu).unwrap().picture(&object, &camera, &look, &options).unwrap();
    assert_eq!(report.backend, "cpu");
    assert!(report.warnings.len() == 1 && report.warnings[0].contains("drawn on the CPU"), "{:?}", report.warnings);
    assert!(picture.pixels.iter().any(|p| p[3] == 255));
}

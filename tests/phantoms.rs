//! Phantoms hold what they promise at known places; transfer functions keep their properties and survive any text.

use glam::DVec3;
use proptest::prelude::*;
use voxclay::volume::phantom::{LARGEST, Phantom};
use voxclay::volume::transfer::{ControlPoint, Region, TransferFunction, Window};
use voxclay::volume::{ScalarType, Space, Volume};

/// Nearest sample at a world point.
fn at(v: &Volume, p: DVec3) -> f64 {
    let q = v.grid.voxel_from_world().transform_point3(p).round();
    let n = v.grid.dims;
    let i: Vec<usize> = (0..3).map(|a| (q[a].max(0.0) as usize).min(n[a] - 1)).collect();
    v.samples.get(v.index(i[0], i[1], i[2]))
}

/// World position of the head model's own millimetres: its box is centred on the origin.
fn head(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y + 10.0, z + 24.0)
}

fn values(v: &Volume) -> Vec<f64> {
    (0..v.samples.len()).map(|i| v.samples.get(i)).collect()
}

#[test]
fn every_phantom_has_its_type_range_and_centre() {
    use ScalarType::{F32, I16, U8, U16};
    let expected = [
        (Phantom::Head, I16, -1000.0, 2700.0, 1500.0),
        (Phantom::Engine, U8, 0.0, 255.0, 200.0),
        (Phantom::Orange, U8, 0.0, 255.0, 200.0),
        (Phantom::Carp, U16, 0.0, 2600.0, 1800.0),
        (Phantom::Torso, I16, -1000.0, 1400.0, 500.0),
        (Phantom::MarschnerLobb, F32, 0.0, 1.0, 0.95),
        (Phantom::Ramp, F32, 0.0, 1.0, 1.0),
        (Phantom::Sphere, F32, 0.0, 87.0, 86.0),
        (Phantom::Gaussian, F32, 0.0, 1.0, 0.95),
        (Phantom::Checker, U8, 0.0, 7.0, 7.0),
    ];
    assert_eq!(expected.len(), Phantom::ALL.len());
    for (p, ty, least, most, reached) in expected {
        let v = p.generate(48);
        assert_eq!(v.samples.scalar_type(), ty, "{}", p.name());
        assert_eq!(v.grid.dims.iter().max(), Some(&48), "{}", p.name());
        let all = values(&v);
        let (lo, hi) = all.iter().fold((f64::MAX, f64::MIN), |(a, b), &x| (a.min(x), b.max(x)));
        assert!(lo >= least - 1e-6 && hi <= most + 1e-6 && hi >= reached, "{}: {lo} to {hi}", p.name());
        assert!(v.grid.center().length() < 1e-9, "{} is not centred", p.name());
        let h = v.grid.spacing();
        assert!((h.max_element() - h.min_element()).abs() < 1e-12, "{} has no cubic voxels", p.name());
        let body = matches!(p, Phantom::Head | Phantom::Torso);
        assert_eq!(v.grid.space, if body { Space::Lps } else { Space::Unknown });
    }
}

#[test]
fn names_are_found_again_and_suggestions_exist() {
    for p in Phantom::ALL {
        assert_eq!(Phantom::from_name(p.name()), Some(p));
        assert!(!p.description().is_empty());
        let s = p.suggested();
        assert!(TransferFunction::by_name(s.transfer).is_some(), "{}", s.transfer);
        // the suggested surface is there
        let all = values(&p.generate(32));
        assert!(all.iter().any(|&x| x > s.iso) && all.iter().any(|&x| x < s.iso), "{}", p.name());
    }
    assert_eq!(Phantom::from_name("Head"), None);
}

#[test]
fn the_same_on_any_number_of_threads() {
    for p in Phantom::ALL {
        let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        let one = pool(1).install(|| p.generate(40));
        let three = pool(3).install(|| p.generate(40));
        assert!(one == three, "{}", p.name());
    }
}

#[test]
fn tiny_sizes_work() {
    for p in Phantom::ALL {
        for size in [0, 1, 2, 3, 5] {
            let v = p.generate(size);
            assert_eq!(v.grid.dims.into_iter().max(), Some(size.max(1)));
            assert_eq!(v.samples.len(), v.grid.len());
            assert!(values(&v).iter().all(|x| x.is_finite()));
        }
    }
    assert_eq!(LARGEST, 2048);
}

#[test]
fn bodies_are_closed() {
    // nothing of the object touches the faces of the grid, so that its iso-surfaces close
    for p in [Phantom::Head, Phantom::Engine, Phantom::Orange, Phantom::Carp, Phantom::Torso] {
        let v = p.generate(64);
        let air = values(&v).into_iter().fold(f64::MAX, f64::min);
        let [nx, ny, nz] = v.grid.dims;
        for (i, x) in values(&v).into_iter().enumerate() {
            let (a, b, c) = (i % nx, i / nx % ny, i / (nx * ny));
            if a == 0 || b == 0 || c == 0 || a == nx - 1 || b == ny - 1 || c == nz - 1 {
                assert!(x < p.suggested().iso, "{}: {x} at {a} {b} {c}, air is {air}", p.name());
            }
        }
    }
}

#[test]
fn a_finer_head_is_the_same_head() {
    // a voxel's value must not depend on the size by more than its border
    let (a, b) = (Phantom::Head.generate(64), Phantom::Head.generate(128));
    let (mut same, mut n) = (0, 0);
    let [nx, ny, nz] = a.grid.dims;
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let p = a.grid.world_from_voxel.transform_point3(DVec3::new(i as f64, j as f64, k as f64));
                n += 1;
                same += usize::from((a.samples.get(a.index(i, j, k)) - at(&b, p)).abs() < 120.0);
            }
        }
    }
    assert!(same as f64 > 0.78 * n as f64, "{same} of {n}");
}

#[test]
fn the_head_has_its_organs_in_place() {
    let v = Phantom::Head.generate(128);
    let hu = |x, y, z| at(&v, head(x, y, z));
    let within = |what: &str, x: f64, lo: f64, hi: f64| assert!(x >= lo && x <= hi, "{what}: {x}");
    within("air before the face", hu(0.0, -126.0, 60.0), -1000.0, -1000.0);
    within("trachea", hu(0.0, -4.5, -150.0), -1000.0, -900.0);
    within("throat", hu(0.0, -2.0, -82.0), -1000.0, -800.0);
    within("maxillary sinus", hu(26.0, -66.0, -33.0), -1000.0, -900.0);
    within("body of the mandible", hu(35.0, -58.0, -89.0), 300.0, 1400.0);
    within("chin", hu(0.0, -88.0, -97.0), 300.0, 1400.0);
    within("cranial vault", hu(0.0, 8.0, 108.4), 300.0, 1400.0);
    within("muscle of the nape", hu(18.0, 58.0, -110.0), 25.0, 90.0);
    within("eye", hu(31.5, -76.0, 0.0), 0.0, 40.0);
    within("deep white matter", hu(28.0, 10.0, 52.0), 4.0, 45.0);
    within("lateral ventricle", hu(19.0, 38.0, 34.0), 4.0, 12.0);
    within("vertebra", hu(0.0, 19.0, -107.0), 150.0, 1400.0);
    // teeth are denser than any bone
    let teeth = values(&v).into_iter().filter(|&x| x > 1500.0).count();
    assert!(teeth > 100, "{teeth}");
    let [nx, ny, nz] = v.grid.dims;
    for i in 0..v.grid.len() {
        if v.samples.get(i) > 1400.0 {
            let (a, b, c) = (i % nx, i / nx % ny, i / (nx * ny));
            let p = v.grid.world_from_voxel.transform_point3(DVec3::new(a as f64, b as f64, c as f64))
                - head(0.0, 0.0, 0.0);
            assert!(p.z > -100.0 && p.z < -38.0 && p.y < -25.0 && p.x.abs() < 40.0, "dense at {p}");
        }
    }
    assert!(nz == 128);
}

#[test]
fn the_brain_is_folded() {
    // along a path just under the skull, fluid and grey matter alternate
    let v = Phantom::Head.generate(160);
    let mut crossings = 0;
    let mut before = None;
    for i in 0..400 {
        let a = f64::from(i) / 400.0 * std::f64::consts::PI;
        let p = head(55.0 * a.cos().signum() * a.cos().abs(), 8.0, 42.0 + 54.0 * a.sin());
        let x = at(&v, p);
        assert!(x < 200.0, "bone in the brain at {p}");
        let grey = x > 25.0;
        crossings += usize::from(before.is_some_and(|b| b != grey));
        before = Some(grey);
    }
    assert!(crossings >= 8, "{crossings}");
}

#[test]
fn the_head_is_symmetric_but_for_its_brain_and_grain() {
    let v = Phantom::Head.generate(64);
    let [nx, ny, nz] = v.grid.dims;
    let (mut different, mut n) = (0, 0);
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx / 2 {
                let (a, b) = (v.samples.get(v.index(i, j, k)), v.samples.get(v.index(nx - 1 - i, j, k)));
                // air and not air agree exactly
                assert_eq!(a == -1000.0, b == -1000.0, "{i} {j} {k}");
                n += 1;
                different += usize::from((a - b).abs() > 140.0);
            }
        }
    }
    assert!(different * 100 < n, "{different} of {n}");
}

#[test]
fn the_engine_has_two_cylinders() {
    let v = Phantom::Engine.generate(128);
    // the model's box is centred; its middle lies 3 above the model's origin
    let p = |x: f64, y: f64, z: f64| at(&v, DVec3::new(x, y, z - 3.0));
    // along the row of cylinders: bores are empty and their walls have liners denser than the casting
    let profile: Vec<f64> = (-70..=70).map(|x| p(f64::from(x), 0.0, -10.0)).collect();
    let mut bores = 0;
    let mut run = 0;
    for x in profile.iter().chain([&255.0]) {
        if *x < 20.0 {
            run += 1;
        } else {
            bores += usize::from(run > 30);
            run = 0;
        }
    }
    assert_eq!(bores, 2, "{profile:?}");
    for x in [-34.0, 34.0] {
        assert_eq!(p(x, 0.0, -20.0), 0.0, "bore");
        let densest = (18..25).map(|r| p(x + f64::from(r), 0.0, -10.0)).fold(0.0, f64::max);
        assert!(densest > 160.0, "liner {densest}");
    }
    assert!((p(0.0, 0.0, 40.0) - 135.0).abs() < 12.0, "casting {}", p(0.0, 0.0, 40.0));
    assert!(values(&v).iter().filter(|&&x| x > 220.0).count() > 200, "steel");
}

#[test]
fn the_orange_has_eleven_segments() {
    let v = Phantom::Orange.generate(160);
    // the walls between segments are denser than any pulp, and the thin lines between are found by averaging along z
    let n = 1440;
    let ring: Vec<f64> = (0..n)
        .map(|i| {
            let a = f64::from(i) / f64::from(n) * std::f64::consts::TAU;
            let column = (-40..=40).map(|k| at(&v, DVec3::new(26.0 * a.cos(), 26.0 * a.sin(), 0.3 * f64::from(k))));
            column.fold(f64::MAX, f64::min)
        })
        .collect();
    // pulp is dark somewhere along z; a wall never is
    let wall: Vec<bool> = ring.iter().map(|&x| x > 118.0).collect();
    let starts = (0..wall.len()).filter(|&i| wall[i] && !wall[(i + wall.len() - 1) % wall.len()]).count();
    // a wall may show as two close lines; lines closer than 6 degrees are one wall
    let mut walls = 0;
    let mut since = 1000;
    for i in 0..2 * wall.len() {
        if wall[i % wall.len()] {
            if since > 24 && i >= wall.len() {
                walls += 1;
            }
            since = 0;
        } else {
            since += 1;
        }
    }
    assert_eq!(walls, 11, "{starts} lines");
    assert!(at(&v, DVec3::new(0.0, 0.0, 0.0)) < 110.0, "the core is spongy");
    assert!(at(&v, DVec3::new(37.0, 0.0, 0.0)) > 130.0, "the peel is dense");
}

#[test]
fn the_carp_has_a_bladder_and_a_backbone() {
    let v = Phantom::Carp.generate(160);
    // the box is centred: its middle lies at height 7 of the model
    let p = |x: f64, y: f64, z: f64| at(&v, DVec3::new(x, y, z - 7.0));
    assert!(p(0.0, -34.0, 5.0) < 150.0, "swim bladder {}", p(0.0, -34.0, 5.0));
    assert!((p(8.0, 0.0, -18.0) - 1060.0).abs() < 120.0, "flesh {}", p(8.0, 0.0, -18.0));
    // vertebrae repeat along the tail
    let bone = (40..100).filter(|&y| (-8..24).any(|z| p(0.0, f64::from(y), f64::from(z)) > 1500.0)).count();
    assert!(bone > 40, "{bone}");
    assert_eq!(p(40.0, 100.0, 40.0), 0.0);
}

#[test]
fn the_torso_has_lungs_ribs_and_a_heart() {
    let v = Phantom::Torso.generate(128);
    let p = |x: f64, y: f64, z: f64| at(&v, DVec3::new(x, y, z - 10.0));
    for side in [-70.0, 70.0] {
        let x = p(side, 20.0, 70.0);
        assert!((-1000.0..-600.0).contains(&x), "lung {x}");
    }
    assert!(p(0.0, 5.0, 160.0) < -900.0, "windpipe {}", p(0.0, 5.0, 160.0));
    assert!((120.0..260.0).contains(&p(34.0, -30.0, -4.0)), "left chamber {}", p(34.0, -30.0, -4.0));
    assert!((60.0..140.0).contains(&p(-60.0, 0.0, -92.0)), "liver {}", p(-60.0, 0.0, -92.0));
    // ribs are met one after the other down the side
    let mut ribs = 0;
    let mut inside = false;
    for z in -100..180 {
        let bone = (80..140).any(|x| p(f64::from(x), 10.0, f64::from(z)) > 350.0);
        ribs += usize::from(bone && !inside);
        inside = bone;
    }
    assert!(ribs >= 6, "{ribs}");
}

#[test]
fn analytic_phantoms_are_their_formulas() {
    for p in Phantom::ALL {
        let v = p.generate(17);
        let known = p.analytic(DVec3::ZERO).is_some();
        assert_eq!(known, matches!(p.name(), "marschner-lobb" | "ramp" | "sphere" | "gaussian" | "checker"));
        if !known {
            continue;
        }
        let [nx, ny, nz] = v.grid.dims;
        assert_eq!([nx, ny, nz], [17; 3]);
        for (n, x) in values(&v).into_iter().enumerate() {
            let (i, j, k) = (n % nx, n / nx % ny, n / (nx * ny));
            let w = v.grid.world_from_voxel.transform_point3(DVec3::new(i as f64, j as f64, k as f64));
            assert_eq!(x, f64::from(p.analytic(w).unwrap() as f32), "{} at {w}", p.name());
        }
    }
    // written out once more, independently
    let w = DVec3::new(12.5, -30.0, 7.0);
    assert!((Phantom::Ramp.analytic(w).unwrap() - (12.5 - 30.0 + 7.0 + 150.0) / 300.0).abs() < 1e-15);
    assert!((Phantom::Sphere.analytic(w).unwrap() - (12.5f64 * 12.5 + 900.0 + 49.0).sqrt()).abs() < 1e-12);
    let sigma = 100.0 / 6.0;
    let g = (-(12.5f64 * 12.5 + 900.0 + 49.0) / (2.0 * sigma * sigma)).exp();
    assert!((Phantom::Gaussian.analytic(w).unwrap() - g).abs() < 1e-15);
}

#[test]
fn marschner_lobb_is_the_published_signal() {
    let n = 41;
    let v = Phantom::MarschnerLobb.generate(n);
    let pi = std::f64::consts::PI;
    for (index, got) in values(&v).into_iter().enumerate() {
        let c = |i: usize| -1.0 + 2.0 * i as f64 / (n - 1) as f64;
        let (x, y, z) = (c(index % n), c(index / n % n), c(index / (n * n)));
        let r = (x * x + y * y).sqrt();
        let rho = (2.0 * pi * 6.0 * (pi * r / 2.0).cos()).cos();
        let want = (1.0 - (pi * z / 2.0).sin() + 0.25 * (1.0 + rho)) / (2.0 * (1.0 + 0.25));
        assert!((got - want).abs() < 1e-6, "{got} but {want} at {x} {y} {z}");
    }
}

#[test]
fn checker_cells_differ_from_their_neighbours() {
    let v = Phantom::Checker.generate(64);
    for (axis, bit) in [(DVec3::X, 1), (DVec3::Y, 2), (DVec3::Z, 4)] {
        for cell in 0..7 {
            let p = DVec3::splat(-50.0 + 6.25) + axis * (12.5 * f64::from(cell));
            let (a, b) = (at(&v, p) as u32, at(&v, p + axis * 12.5) as u32);
            assert_eq!(a ^ b, bit);
        }
    }
}

#[test]
fn presets_are_sound_and_unique() {
    let mut names = std::collections::HashSet::new();
    for preset in TransferFunction::presets() {
        assert!(names.insert(preset.name), "{} twice", preset.name);
        let tf = preset.plain();
        assert_eq!(tf.check(), Ok(()), "{}", preset.name);
        assert_eq!(tf.name, preset.name);
        assert_eq!(TransferFunction::parse(&tf.to_string()), Ok(tf));
        // what is least is clear
        assert_eq!(preset.plain().classify(0.0)[3], 0.0);
    }
    assert!(TransferFunction::by_name("no such").is_none());
}

#[test]
fn ct_presets_find_the_scale() {
    let hu = TransferFunction::by_name("ct-bone").unwrap().resolve([0.0, 1.0]);
    // Hounsfield units: as drawn
    let tf = TransferFunction::for_volume("ct-bone", [-1024.0, 3071.0], &[]).unwrap();
    assert_eq!(tf.resolve([-1024.0, 3071.0]), hu);
    // bytes: air at 0, soft tissue peaks in bin 89 of 256, as in a real scan of a head
    let mut counts = vec![100u64; 256];
    counts[0] = 7_000_000;
    counts[89] = 1_700_000;
    counts[163] = 56_000;
    let [lo, hi] = TransferFunction::for_volume("ct-bone", [0.0, 1.0], &counts).unwrap().resolve([0.0, 1.0]);
    // so 40 HU lies on the peak and -1000 on air
    let value = |h: f64| lo + (h - hu[0]) / (hu[1] - hu[0]) * (hi - lo);
    assert!((value(-1000.0)).abs() < 1e-9 && (value(40.0) - 89.5 / 256.0).abs() < 1e-9, "{lo} {hi}");
    // without a histogram the range stands for -1000 to 2000
    let [lo, hi] = TransferFunction::for_volume("ct-bone", [0.0, 3000.0], &[]).unwrap().resolve([0.0, 1.0]);
    assert!((lo - (hu[0] + 1000.0)).abs() < 1e-9 && (hi - (hu[1] + 1000.0)).abs() < 1e-9);
}

#[test]
fn auto_clears_the_background_and_shows_the_core() {
    // background 80 %, a body around bin 100, a core around bin 200
    let counts: Vec<u64> = (0..256)
        .map(|i| {
            let bell = |c: f64, s: f64, n: f64| (n * (-((f64::from(i) - c) / s).powi(2)).exp()) as u64;
            bell(2.0, 3.0, 4e6) + bell(100.0, 12.0, 2e5) + bell(200.0, 12.0, 3e4)
        })
        .collect();
    let tf = TransferFunction::for_volume("auto", [0.0, 255.0], &counts).unwrap();
    assert_eq!(tf.check(), Ok(()));
    let opacity = |bin: f32| tf.classify(bin / 255.0)[3];
    assert_eq!(opacity(2.0), 0.0);
    assert!(opacity(100.0) > 0.005 && opacity(100.0) < 0.4, "{}", opacity(100.0));
    assert!(opacity(200.0) > 2.0 * opacity(100.0) && opacity(200.0) > 0.2, "{}", opacity(200.0));
}

#[test]
fn errors_name_the_line() {
    let parse = |s: &str| TransferFunction::parse(s).unwrap_err().to_string();
    let head = "voxclay transfer function 1\n";
    let cases = [
        ("", "line 1"),
        ("# only a comment\n\nsomething else", "line 3"),
        (&format!("{head}window 3 1\n"), "line 2"),
        (&format!("{head}window nan 1\n"), "line 2"),
        (&format!("{head}window 0 1\nwindow 0 2\n"), "line 3"),
        (&format!("{head}0 0 0 0 0\nwindow 0 2\n"), "line 3"),
        (&format!("{head}0 1 1 1\n"), "line 2"),
        (&format!("{head}0 1 1 1 1 1\n"), "line 2"),
        (&format!("{head}0 1 x 1 1\n"), "line 2"),
        (&format!("{head}0 1 1 1 inf\n"), "line 2"),
        (&format!("{head}0 1 1 2 1\n"), "line 2"),
        (&format!("{head}7 1 1 1 1\n"), "line 2"),
        (&format!("{head}0.5 1 1 1 1\n\n0.4 1 1 1 1\n"), "line 4"),
        (&format!("{head}name empty\n"), "no point"),
    ];
    for (text, expected) in cases {
        let message = parse(text);
        assert!(message.contains(expected), "{text:?}: {message}");
        assert!(!message.contains('\n') && message.len() < 200, "{message}");
    }
    let long = format!("{head}{}", "0.5 1 1 1 1\n".repeat(5000));
    assert!(parse(&long).contains("4096"));
}

#[test]
fn classification_is_linear_between_points_and_constant_beyond() {
    let p = |at, v: f32, opacity| ControlPoint { at, color: [v; 3], opacity };
    let tf = TransferFunction {
        name: String::new(),
        window: Window::Auto,
        points: vec![p(0.25, 0.0, 0.0), p(0.75, 1.0, 0.5), p(0.75, 1.0, 0.9)],
        regions: Vec::new(),
    };
    assert_eq!(tf.classify(0.1), [0.0; 4]);
    assert!((tf.classify(0.5)[3] - 0.25).abs() < 1e-6);
    assert!((tf.classify(0.5)[0] - 0.214_041_14).abs() < 1e-5, "sRGB 0.5, decoded");
    // a step: from its place on, the later point holds
    assert_eq!(tf.classify(0.75)[3], 0.9);
    assert_eq!(tf.classify(9.0)[3], 0.9);
    assert_eq!(tf.classify(f32::NAN)[3], 0.0);
    let none = TransferFunction { points: Vec::new(), ..tf };
    assert_eq!(none.classify(0.5), [0.0; 4]);
}

#[test]
fn windows_are_always_usable() {
    let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, 1.0, 1e300, -1e300, f64::MAX, f64::MIN, 5e-324];
    for a in odd {
        for b in odd {
            for w in [Window::Auto, Window::Values { lo: a, hi: b }] {
                let [lo, hi] = w.resolve([a, b]);
                assert!(lo.is_finite() && hi.is_finite() && lo < hi && (hi - lo).is_finite(), "{a} {b}: {lo} {hi}");
            }
        }
    }
}

fn any_function() -> impl Strategy<Value = TransferFunction> {
    let unit = || prop_oneof![0.0f32..=1.0, Just(0.0), Just(1.0), Just(1e-30f32)];
    let point = (unit(), [unit(), unit(), unit()], unit());
    let window = prop_oneof![
        Just(Window::Auto),
        (-1e9f64..1e9, 1e-6f64..1e9).prop_map(|(lo, w)| Window::Values { lo, hi: lo + w }),
        (-3000i32..3000, 1i32..5000).prop_map(|(lo, w)| Window::Values { lo: lo.into(), hi: (lo + w).into() }),
    ];
    let region =
        ([unit(), unit()], [unit(), unit()], [unit(), unit(), unit()], prop::option::of([unit(), unit(), unit()]))
            .prop_map(|(value, steepness, [foot, soft, opacity], color)| Region {
                value,
                steepness,
                foot,
                soft,
                opacity,
                color,
            });
    let regions = prop::collection::vec(region, 0..3);
    ("([a-zA-Z#][a-zA-Z0-9 #-]{0,12}[a-z#])?", window, prop::collection::vec(point, 1..12), regions).prop_map(
        |(name, window, points, mut regions)| {
            regions.retain(|r| r.value[0] < r.value[1] && r.steepness[0] < r.steepness[1]);
            let mut points: Vec<_> =
                points.into_iter().map(|(at, color, opacity)| ControlPoint { at, color, opacity }).collect();
            points.sort_by(|a, b| a.at.total_cmp(&b.at));
            TransferFunction { name, window, points, regions }
        },
    )
}

proptest! {
    #[test]
    fn text_round_trips_exactly(tf in any_function()) {
        prop_assume!(tf.check().is_ok());
        let text = tf.to_string();
        prop_assert_eq!(TransferFunction::parse(&text), Ok(tf), "{}", text);
    }

    #[test]
    fn any_text_is_read_or_refused(text in "\\PC{0,200}", cut in 0usize..400) {
        let _ = TransferFunction::parse(&text);
        let _ = TransferFunction::parse(&format!("voxclay transfer function 1\n{text}"));
        let sound = TransferFunction::by_name("ct-head").unwrap().to_string();
        let part: String = sound.chars().take(cut).chain(text.chars().take(5)).collect();
        if let Ok(tf) = TransferFunction::parse(&part) {
            prop_assert_eq!(tf.check(), Ok(()));
        }
    }

    #[test]
    fn numbers_in_any_place_are_read_or_refused(n in prop::collection::vec(prop::num::f64::ANY, 7)) {
        let text = format!(
            "voxclay transfer function 1\nwindow {} {}\n{} {} {} {} {}\n", n[0], n[1], n[2], n[3], n[4], n[5], n[6]
        );
        if let Ok(tf) = TransferFunction::parse(&text) {
            prop_assert_eq!(tf.check(), Ok(()));
        }
    }

    #[test]
    fn fitting_survives_any_range_and_histogram(
        lo in prop::num::f64::ANY, hi in prop::num::f64::ANY, counts in prop::collection::vec(any::<u32>(), 0..300)
    ) {
        let counts: Vec<u64> = counts.into_iter().map(u64::from).collect();
        for preset in TransferFunction::presets() {
            let tf = preset.fitted([lo, hi], &counts);
            prop_assert_eq!(tf.check(), Ok(()), "{}", preset.name);
        }
    }
}

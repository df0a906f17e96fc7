//! Brushes against their formulas, the bounds of folding, and the opacity of deformations.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use voxclay::deform::{
    Action, Brush, DeformError, Deformation, Deformer, DisplacementVolume, Falloff, Grab, Lattice, Limit, Stack,
};
use voxclay::math::{BLOCK, BackwardMap, Block, OrientedBox};
use voxclay::mesh::TriMesh;

/// Places in the unit cube `[-1,1]^3`, evenly spread and the same in every run (Roberts' R3 sequence).
fn places(n: usize) -> impl Iterator<Item = DVec3> {
    let step = DVec3::new(0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_2);
    (1..=n).map(move |i| (step * i as f64).fract() * 2.0 - 1.0)
}

const FALLOFFS: [Falloff; 5] =
    [Falloff::Smooth, Falloff::Spline, Falloff::Core(0.0), Falloff::Core(0.4), Falloff::Core(0.9)];

const CENTER: DVec3 = DVec3::new(3.0, -7.0, 11.0);
const RADIUS: f64 = 6.0;
const AXIS: DVec3 = DVec3::new(2.0, -1.0, 0.5);

fn brush(falloff: Falloff, action: Action) -> Brush {
    Brush::new(CENTER, RADIUS, falloff, action).unwrap()
}

fn twist(falloff: Falloff, degrees: f64) -> Brush {
    brush(falloff, Action::Twist { axis: AXIS, degrees })
}

/// Everything that can fold, by `t -> amount` from the amount that grows along its rays.
fn growing(falloff: Falloff, growth: f64) -> [Brush; 2] {
    [brush(falloff, Action::Inflate { amount: growth }), brush(falloff, Action::Pinch { axis: AXIS, amount: -growth })]
}

fn stack(items: impl IntoIterator<Item = Brush>) -> Stack {
    Stack { items: items.into_iter().map(|b| Deformation::new("brush", Deformer::Brush(b))).collect() }
}

/// The falloffs as in their definitions.
fn fade(falloff: Falloff, t: f64) -> f64 {
    match falloff {
        _ if t >= 1.0 => 0.0,
        Falloff::Smooth => (1.0 - t * t).powi(3),
        Falloff::Spline if t <= 1.0 / 3.0 => 1.0 - 3.0 * t * t,
        Falloff::Spline => 1.5 * (1.0 - t) * (1.0 - t),
        Falloff::Core(core) => {
            let x = ((t - core) / (1.0 - core)).max(0.0);
            1.0 - x * x * (3.0 - 2.0 * x)
        }
    }
}

#[test]
fn every_action_is_the_formula() {
    let n = AXIS.normalize();
    for falloff in FALLOFFS {
        for p in places(400).map(|p| CENTER + p * RADIUS) {
            let r = p - CENTER;
            let f = fade(falloff, r.length() / RADIUS);
            let back = |action| Deformer::Brush(brush(falloff, action)).backward(p);
            let inflated = back(Action::Inflate { amount: 0.6 });
            assert!((inflated - (CENTER + (1.0 - 0.6 * f) * r)).length() < 1e-13);
            let pinched = back(Action::Pinch { axis: AXIS, amount: 0.4 });
            assert!((pinched - (CENTER + r + 0.4 * f * (r - n * n.dot(r)))).length() < 1e-13);
            for degrees in [30.0_f64, -200.0, 777.0] {
                // content turns by +degrees: what is seen here comes from where it was before
                let turned = DQuat::from_axis_angle(n, -degrees.to_radians() * f) * r;
                assert!((back(Action::Twist { axis: AXIS, degrees }) - (CENTER + turned)).length() < 1e-12);
            }
        }
    }
    // at the centre content grows by 1 / (1 - amount)
    let d = Deformer::Brush(brush(Falloff::Core(0.5), Action::Inflate { amount: 0.5 }));
    let seen = stack([brush(Falloff::Core(0.5), Action::Inflate { amount: 0.5 })]).forward(CENTER + DVec3::X).unwrap();
    assert!((seen - (CENTER + 2.0 * DVec3::X)).length() < 1e-12 && d.backward(CENTER) == CENTER);
    // and a core is turned by the whole angle, right-handed
    let s = stack([brush(Falloff::Core(0.5), Action::Twist { axis: DVec3::Z, degrees: 90.0 })]);
    assert!((s.forward(CENTER + DVec3::X).unwrap() - (CENTER + DVec3::Y)).length() < 1e-12);
}

#[test]
fn what_is_known_of_a_falloff_in_closed_form_is_so() {
    for falloff in FALLOFFS.into_iter().chain([0.1, 0.6, 0.77].map(Falloff::Core)) {
        let n = 200_000;
        let g = |i: i32| f64::from(i) / f64::from(n) * fade(falloff, f64::from(i) / f64::from(n));
        let slope = |i: i32| (g(i + 1) - g(i)) * f64::from(n);
        let steepest = (0..n).map(|i| -slope(i)).fold(0.0, f64::max);
        assert!((steepest - falloff.steepest_return()).abs() < 1e-7, "{falloff:?}: {steepest}");
        let rise = (0..n).map(slope).fold(0.0, f64::max);
        assert!(rise <= 1.0 + 1e-9 && rise > 1.0 - 1e-9, "{falloff:?}: {rise}");
        let farthest = (0..=n).map(g).fold(0.0, f64::max);
        assert!((farthest - falloff.farthest()).abs() < 1e-9, "{falloff:?}: {farthest}");
    }
}

#[test]
fn the_bounds_of_folding_are_sharp() {
    let n = AXIS.normalize();
    let across = n.any_orthonormal_vector();
    for falloff in FALLOFFS {
        for growing_away in [true, false] {
            let growth = |s: f64| if growing_away { s } else { -s / falloff.steepest_return() };
            for b in growing(falloff, growth(0.999)) {
                assert!((b.steepness() - 0.999).abs() < 1e-12);
                let s = stack([b]);
                for p in places(300).map(|p| CENTER + p * RADIUS) {
                    let (q, jacobian) = s.backward_with_jacobian(p);
                    assert!(jacobian.determinant() > 0.0, "{b:?}");
                    assert!((s.forward(q).unwrap() - p).length() < 1e-9, "{b:?}");
                }
            }
            for b in growing(falloff, growth(1.02)) {
                let d = Deformer::Brush(b);
                // a ray through the centre, across the axis, is mapped to itself and turns back somewhere
                let at = |i: i32| CENTER + across * (RADIUS * f64::from(i) / 500.0);
                let folded = (-499..500).min_by(|a, b| {
                    let along = |i: i32| (d.backward(at(i + 1)) - d.backward(at(i))).dot(across);
                    along(*a).total_cmp(&along(*b))
                });
                let i = folded.unwrap();
                assert!((d.backward(at(i + 1)) - d.backward(at(i))).dot(across) < 0.0, "{b:?}");
                let answer = stack([b]).forward(d.backward(at(i)));
                assert!(matches!(answer, Err(DeformError::Folded { .. })), "{answer:?} {b:?}");
            }
        }
        for b in growing(falloff, 2.0).into_iter().chain(growing(falloff, -7.0)) {
            let d = Deformer::Brush(b);
            let clamped = d.limited(Limit::Clamp { margin: 0.1 });
            assert!((clamped.deformer.steepness() - 0.9).abs() < 1e-12 && clamped.held_back() > 0.0, "{b:?}");
            let free = d.limited(Limit::LetThrough);
            assert_eq!((free.held_back(), &free.deformer), (0.0, &d));
        }
    }
}

#[test]
fn a_twist_never_folds_whatever_its_angle() {
    for (falloff, degrees) in FALLOFFS.into_iter().zip([20.0, -180.0, 360.0, 1000.0, -3600.0]) {
        let b = twist(falloff, degrees);
        let d = Deformer::Brush(b);
        let limited = d.limited(Limit::default());
        assert_eq!((b.steepness(), limited.held_back(), &limited.deformer), (0.0, 0.0, &d));
        let s = stack([b]);
        for p in places(300).map(|p| CENTER + p * RADIUS) {
            let (q, jacobian) = s.backward_with_jacobian(p);
            // it keeps distances from the centre, and volumes
            assert!((q.distance(CENTER) - p.distance(CENTER)).abs() < 1e-12);
            assert!((jacobian.determinant() - 1.0).abs() < 1e-9, "{}", jacobian.determinant());
            assert!((s.forward(q).unwrap() - p).length() < 1e-11);
            assert!((s.backward(s.forward(p).unwrap()) - p).length() < 1e-11);
            assert!((p - q).length() <= b.reach() + 1e-12);
        }
    }
}

#[test]
fn no_value_comes_from_farther_away_than_is_said() {
    for falloff in FALLOFFS {
        for b in growing(falloff, 0.9).into_iter().chain(growing(falloff, -0.9)).chain([twist(falloff, 50.0)]) {
            let moved = |p: DVec3| (Deformer::Brush(b).backward(p) - p).length();
            let most = places(4000).map(|p| moved(CENTER + p * RADIUS)).fold(0.0, f64::max);
            assert!(most <= b.reach() && most > 0.8 * b.reach(), "{most} of {} {b:?}", b.reach());
        }
    }
}

#[test]
fn in_a_skewed_grid_it_is_the_same_map_within_its_bounds() {
    let matrix = DMat3::from_cols(DVec3::new(0.8, 0.3, -0.1), DVec3::new(-0.2, -0.5, 0.1), DVec3::new(0.1, 0.2, 1.7));
    let world_from_local = DAffine3::from_mat3_translation(matrix, DVec3::new(4.0, -7.0, 1.0));
    let local_from_world = world_from_local.inverse();
    let mut acting = Vec::new();
    for falloff in FALLOFFS {
        let all = growing(falloff, 0.9).into_iter().chain(growing(falloff, -0.8));
        for b in all.chain([40.0, -170.0, 720.0].map(|degrees| twist(falloff, degrees))) {
            let s = stack([b]);
            let framed = s.prepared().in_frame(&world_from_local);
            // a steep slope times a large angle makes much of the rounding
            let angle = if let Action::Twist { degrees, .. } = b.action() { degrees.to_radians().abs() } else { 0.0 };
            let slack = 1e-4 + 4e-6 * angle * falloff.steepest();
            let mut moved = 0;
            for (n, place) in places(60).enumerate() {
                let middle = local_from_world.transform_point3(CENTER + place * RADIUS);
                let half = DVec3::splat([0.5, 2.0, 20.0][n % 3]);
                let (lower, upper) = (middle - half, middle + half);
                let origin = lower.floor();
                let near = framed.near(lower, upper, origin);
                let mut block = Block::<f32>::default();
                for (i, p) in places(BLOCK).enumerate() {
                    let p = (middle + p * half - origin).as_vec3();
                    (block.x[i], block.y[i], block.z[i]) = (p.x, p.y, p.z);
                }
                let point = |b: &Block<f32>, i: usize| DVec3::new(b.x[i].into(), b.y[i].into(), b.z[i].into()) + origin;
                let start = block.clone();
                let ends = std::array::from_fn(|a| [(lower - origin)[a] as f32, (upper - origin)[a] as f32]);
                let images = near.acting(ends, &mut acting);
                near.backward(&acting, std::slice::from_mut(&mut block));
                let (lo, hi) = framed.sources(lower, upper);
                for i in 0..BLOCK {
                    let from = point(&start, i);
                    let want = local_from_world.transform_point3(s.backward(world_from_local.transform_point3(from)));
                    let got = point(&block, i);
                    assert!((got - want).length() < slack, "{b:?}: {got} {want}");
                    assert!(want.cmpge(lo - 1e-9).all() && want.cmple(hi + 1e-9).all(), "{b:?}: {want}, {lo} to {hi}");
                    for a in 0..3 {
                        let at = (want - origin)[a] as f32;
                        assert!(images[a][0] - 1e-4 <= at && at <= images[a][1] + 1e-4, "{b:?}: {at} {:?}", images[a]);
                    }
                    moved += usize::from((want - from).length() > 1e-3);
                }
            }
            assert!(moved > 60 * BLOCK / 16, "{moved} {b:?}");
        }
    }
    // bounds of a small box far inside are not those of the whole ball
    for b in [growing(Falloff::Smooth, 0.5)[0], growing(Falloff::Smooth, 0.5)[1], twist(Falloff::Smooth, 60.0)] {
        let framed = stack([b]).prepared().in_frame(&DAffine3::IDENTITY);
        let place = CENTER + DVec3::new(1.5, -1.0, 2.0);
        let (lo, hi) = framed.sources(place - 0.05, place + 0.05);
        assert!((hi - lo).max_element() < 0.35, "{b:?}: {}", hi - lo);
        let away = CENTER + RADIUS;
        assert_eq!(framed.sources(away, away + 1.0), (away, away + 1.0));
    }
}

/// One of each tool.
fn tools() -> Vec<Deformer> {
    let support = OrientedBox { center: DVec3::ZERO, axes: DMat3::IDENTITY, half: DVec3::splat(9.0) };
    let lattice = Lattice::new(support, [3, 3, 3]).unwrap().with_vectors(|_, p| p * 0.1 + DVec3::X).unwrap();
    let mut all = vec![
        Deformer::Displacement(DisplacementVolume::from_drag(DVec3::ZERO, DVec3::X * 3.0, 8.0).unwrap()),
        Deformer::Grab(Grab::new(DVec3::ONE, DVec3::Y * 2.0, 8.0, Falloff::Smooth).unwrap()),
        Deformer::Lattice(lattice),
    ];
    let actions = [
        Action::Inflate { amount: 0.5 },
        Action::Pinch { axis: AXIS, amount: 0.5 },
        Action::Twist { axis: AXIS, degrees: 120.0 },
    ];
    all.extend(actions.map(|a| Deformer::Brush(Brush::new(DVec3::NEG_ONE, 9.0, Falloff::Smooth, a).unwrap())));
    all
}

#[test]
fn an_opacity_scales_what_takes_effect_in_every_evaluator() {
    let mut s = Stack { items: tools().into_iter().map(|d| Deformation::new("", d)).collect() };
    for (i, item) in s.items.iter_mut().enumerate() {
        (item.opacity, item.moves_shape) = ([0.5, 0.25, 0.75][i % 3], true);
    }
    let by_hand: Vec<Deformer> = s.items.iter().map(|i| i.deformer.scaled(i.opacity).unwrap()).collect();
    let scaled = Stack { items: by_hand.into_iter().map(|d| Deformation::new("", d)).collect() };
    let prepared = s.prepared();
    let vertices: Vec<DVec3> = places(500).map(|p| p * 12.0).collect();
    for p in &vertices {
        assert_eq!(s.backward_with_jacobian(*p), scaled.backward_with_jacobian(*p));
        assert!((prepared.backward(*p) - scaled.backward(*p)).length() < 1e-12);
        assert!((s.forward(prepared.backward(*p)).unwrap() - *p).length() < 1e-10);
    }
    assert_eq!(s.supports(), scaled.supports());
    let mesh = TriMesh { positions: vertices.clone(), triangles: Vec::new() };
    for (p, moved) in vertices.iter().zip(s.move_mesh(&mesh).unwrap().positions) {
        assert!((scaled.backward(moved) - *p).length() < 1e-10);
    }
    // half of a twist twice is the whole
    let twist = Deformer::Brush(twist(Falloff::Smooth, 90.0));
    let half = twist.scaled(0.5).unwrap();
    let p = CENTER + DVec3::new(1.0, 2.0, -1.5);
    assert!((half.backward(half.backward(p)) - twist.backward(p)).length() < 1e-12);

    // at 0 there is nothing to do, and out of range is the nearest in it
    for d in tools() {
        assert!(d.scaled(0.0).is_none() && d.scaled(f64::NAN).is_none() && d.scaled(1.0).unwrap() == d);
        let item = |opacity| Deformation { opacity, ..Deformation::new("", d.clone()) };
        let s = Stack { items: vec![item(0.0), item(-3.0), item(f64::NAN)] };
        assert!(s.active().next().is_none() && s.prepared().is_empty() && s.supports().is_empty());
        assert_eq!((s.backward(DVec3::ONE), s.forward(DVec3::ONE)), (DVec3::ONE, Ok(DVec3::ONE)));
        assert!(matches!(item(7.0).effect(), Some(std::borrow::Cow::Borrowed(e)) if *e == d));
        assert!(Deformation { enabled: false, ..item(1.0) }.effect().is_none());
    }
}

#[test]
fn json_is_readable_and_checked_and_old_files_stay_as_they_are() {
    let typed = r#"{"tool": "brush", "center": [0, 1, 2], "radius": 4, "falloff": {"core": 0.5}, "action": ACTION}"#;
    let read = |action: &str| serde_json::from_str::<Deformer>(&typed.replace("ACTION", action));
    for action in [
        r#"{"inflate": {"amount": -0.5}}"#,
        r#"{"pinch": {"axis": [0, 0, 2], "amount": 0.25}}"#,
        r#"{"twist": {"axis": [0, 1, 1], "degrees": 270}}"#,
    ] {
        let d = read(action).unwrap();
        assert_eq!(serde_json::from_str::<Deformer>(&serde_json::to_string(&d).unwrap()).unwrap(), d);
    }
    for (action, says) in [
        (r#"{"inflate": {"amount": 1000}}"#, "the amount is 1000; it must be between -100 and 100"),
        (r#"{"pinch": {"axis": [0, 0, 0], "amount": 0.25}}"#, "the axis has no length"),
        (r#"{"pinch": {"amount": 0.25}}"#, "missing field `axis`"),
        (r#"{"twist": {"axis": [0, 1, 1], "degrees": 27000}}"#, "angle is 27000"),
        (r#"{"inflate": {"amount": 1, "axis": [0, 0, 1]}}"#, "unknown field `axis`"),
        (r#"{"melt": {}}"#, "unknown variant `melt`"),
    ] {
        let error = read(action).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    let inflate = r#"{"inflate": {"amount": 0.5}}"#;
    for (good, bad, says) in [("\"radius\": 4", "\"radius\": 0", "radius"), ("0.5}, \"a", "1.5}, \"a", "core")] {
        let text = typed.replace("ACTION", inflate).replace(good, bad);
        let error = serde_json::from_str::<Deformer>(&text).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    let bad = |center, radius, action| Brush::new(center, radius, Falloff::Smooth, action).unwrap_err();
    let grow = |amount| Action::Inflate { amount };
    assert!(matches!(bad(DVec3::NAN, 1.0, grow(0.5)), DeformError::NotFinite { .. }));
    assert!(matches!(bad(DVec3::ZERO, f64::INFINITY, grow(0.5)), DeformError::OutOfRange { .. }));
    assert!(matches!(bad(DVec3::ZERO, 1.0, grow(f64::NAN)), DeformError::OutOfRange { .. }));
    let nowhere = Action::Twist { axis: DVec3::splat(f64::NAN), degrees: 1.0 };
    assert!(matches!(bad(DVec3::ZERO, 1.0, nowhere), DeformError::NotFinite { .. }));

    // opacities are written where they matter, and read where they are
    let plain = Deformation::new("pull", tools().swap_remove(0));
    let text = serde_json::to_string(&plain).unwrap();
    assert!(!text.contains("opacity"), "{text}");
    assert_eq!(serde_json::from_str::<Deformation>(&text).unwrap(), plain);
    let faint = Deformation { opacity: 0.25, ..plain };
    let text = serde_json::to_string(&faint).unwrap();
    assert_eq!(serde_json::from_str::<Deformation>(&text).unwrap(), faint);
    for bad in ["1.5", "-0.1"] {
        let error = serde_json::from_str::<Deformation>(&text.replace("0.25", bad)).unwrap_err().to_string();
        assert!(error.contains(&format!("the opacity is {bad}; it must be between 0 and 1")), "{error}");
    }
}

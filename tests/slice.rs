//! Sections of meshes against answers that are known otherwise.

use std::f64::consts::PI;

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use proptest::prelude::*;
use voxclay::math::{OrientedBox, PlaneFrame};
use voxclay::mesh::{Topology, TriMesh, primitives};
use voxclay::slice::{BoxSections, Defect, Planes, SliceError, Slicer, Slices};

fn topology(mesh: &TriMesh) -> Topology {
    Topology::build(mesh.positions.len(), &mesh.triangles)
}

fn slice_at(mesh: &TriMesh, planes: &Planes) -> Slices {
    let mut slicer = Slicer::default();
    let slices = slicer.slice(&mesh.positions, &topology(mesh), planes).expect("not too many points").clone();
    check(mesh, planes, &slices);
    slices
}

fn slice(mesh: &TriMesh, direction: DVec3, count: usize) -> (Planes, Slices) {
    let frame = PlaneFrame::across(direction).expect("a direction");
    let planes = Planes::across(frame, &mesh.positions, count);
    let slices = slice_at(mesh, &planes);
    (planes, slices)
}

fn shoelace(points: &[DVec2]) -> f64 {
    (0..points.len()).map(|i| points[i].perp_dot(points[(i + 1) % points.len()])).sum::<f64>() / 2.0
}

/// The signed area of a section as a sum over triangles, with no walk and no topology: each triangle that the plane cuts
/// gives one directed segment, and the moments of all segments add up to the area.
fn area_by_moments(mesh: &TriMesh, planes: &Planes, k: usize) -> f64 {
    let h = planes.height(k);
    let frame = &planes.frame;
    let above = |v: u32| frame.height(mesh.positions[v as usize]) >= h;
    let cut = |u: u32, v: u32| {
        let (a, b) = (mesh.positions[u as usize], mesh.positions[v as usize]);
        let f = (h - frame.height(a)) / (frame.height(b) - frame.height(a));
        frame.project(a).lerp(frame.project(b), f)
    };
    let base = frame.project(mesh.positions[0]);
    let mut sum = 0.0;
    for t in &mesh.triangles {
        let (mut enter, mut leave) = (None, None);
        for (u, v) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            match (above(u), above(v)) {
                (false, true) => leave = Some(cut(u, v)),
                (true, false) => enter = Some(cut(u, v)),
                _ => {}
            }
        }
        if let (Some(a), Some(b)) = (enter, leave) {
            sum += (a - base).perp_dot(b - base) / 2.0;
        }
    }
    sum
}

/// Everything that holds for every mesh: the arrays fit together, loops have the area they say, owners are outer loops of
/// the same plane, and signs say what owners say.
fn check(mesh: &TriMesh, planes: &Planes, s: &Slices) {
    assert_eq!(s.planes(), planes.count);
    assert_eq!(s.loop_start.last().map_or(0, |n| *n as usize), s.points.len());
    assert_eq!(s.plane_start.last().map_or(0, |n| *n as usize), s.loops());
    assert!(s.loop_start.is_sorted() && s.plane_start.is_sorted());
    assert_eq!((s.area.len(), s.owner.len()), (s.loops(), s.loops()));
    assert!(s.points.iter().all(|p| p.is_finite()));
    let size = mesh.bounds().map_or(1.0, |(lo, hi)| lo.abs().max(hi.abs()).max_element());
    for k in 0..s.planes() {
        let loops = s.plane_loops(k);
        for l in loops.clone() {
            let area = shoelace(s.loop_points(l));
            assert!((area - s.area[l]).abs() <= 1e-9 * size * size, "plane {k} loop {l}: {area} is not {}", s.area[l]);
            match s.owner[l] {
                Slices::NONE => assert!(s.area[l].abs() <= 1e-9 * size * size),
                o if o as usize == l => assert!(s.area[l] > 0.0, "plane {k}: outer loop {l} of area {}", s.area[l]),
                o => {
                    assert!(s.area[l] < 0.0, "plane {k}: hole {l} of area {}", s.area[l]);
                    assert!(loops.contains(&(o as usize)) && s.owner[o as usize] == o, "plane {k}: hole {l} in {o}");
                }
            }
        }
    }
}

/// For meshes that are clean solids: no warning, and the area is that of the moments.
fn check_solid(mesh: &TriMesh, planes: &Planes, s: &Slices) {
    assert_eq!(s.warnings().count(), 0, "{:?}", s.warnings().collect::<Vec<_>>());
    let scale = (0..s.planes()).map(|k| s.plane_area(k)).fold(0.0, f64::max);
    for k in 0..s.planes() {
        let expected = area_by_moments(mesh, planes, k);
        assert!((s.plane_area(k) - expected).abs() <= 1e-11 * scale.max(1e-300), "plane {k}");
    }
}

fn directions() -> Vec<DVec3> {
    [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, -2.0, 0.0), (0.31, 0.52, 0.8), (-1.0, 1.0, 1e-9), (0.95, 0.1, -0.3)]
        .map(|(x, y, z)| DVec3::new(x, y, z))
        .to_vec()
}

fn counts(s: &Slices) -> Vec<(usize, usize)> {
    (0..s.planes()).map(|k| s.plane_counts(k)).collect()
}

fn unit_box() -> TriMesh {
    primitives::aligned_box(DVec3::ZERO, DVec3::ONE)
}

fn scaled(mesh: &TriMesh, s: f64) -> TriMesh {
    mesh.transformed(&DAffine3::from_scale(DVec3::splat(s)))
}

fn reversed(mut mesh: TriMesh) -> TriMesh {
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    mesh
}

#[test]
fn a_sphere_has_discs_of_the_right_area() {
    let mesh = primitives::geodesic_sphere(40);
    for d in directions() {
        let (planes, s) = slice(&mesh, d, 50);
        check_solid(&mesh, &planes, &s);
        for k in 0..50 {
            let h = planes.height(k);
            assert_eq!(s.plane_counts(k), (1, 0));
            // the mesh is inscribed, with a sagitta of about 3e-4
            assert!((s.plane_area(k) - PI * (1.0 - h * h)).abs() < 4e-3, "height {h}: {}", s.plane_area(k));
            assert!(s.plane_area(k) < PI * (1.0 - h * h));
        }
    }
}

#[test]
fn a_torus_has_rings_and_pairs_of_ovals() {
    let mesh = primitives::torus(2.0, 0.5, 200, 100);
    let (planes, s) = slice(&mesh, DVec3::Z, 21);
    check_solid(&mesh, &planes, &s);
    for k in 0..21 {
        let h = planes.height(k);
        assert_eq!(s.plane_counts(k), (1, 1));
        let w = (0.25 - h * h).sqrt();
        assert!((s.plane_area(k) - PI * 8.0 * w).abs() < 0.02 * PI * 8.0 * w, "height {h}");
    }
    let (planes, s) = slice(&mesh, DVec3::X, 100);
    check_solid(&mesh, &planes, &s);
    for k in 0..100 {
        let expected = if planes.height(k).abs() < 1.49 { (2, 0) } else { (1, 0) };
        assert!(s.plane_counts(k) == expected || (1.49..1.51).contains(&planes.height(k).abs()), "plane {k}");
    }
}

#[test]
fn the_volume_is_the_sum_of_the_areas() {
    for mesh in [primitives::bumpy_sphere(12), primitives::cavity_sphere(14), primitives::torus(1.0, 0.3, 40, 20)] {
        for d in directions() {
            for n in [20, 80, 320] {
                let (planes, s) = slice(&mesh, d, n);
                check_solid(&mesh, &planes, &s);
                let volume: f64 = (0..n).map(|k| s.plane_area(k)).sum::<f64>() * planes.step;
                let error = (volume / mesh.volume() - 1.0).abs();
                assert!(error < 8.0 / (n * n) as f64 + 1e-4, "{n} planes along {d}: {error}");
            }
        }
    }
}

#[test]
fn a_box_cut_at_its_faces_belongs_to_the_lower_side() {
    let mesh = unit_box();
    let frame = PlaneFrame::across(DVec3::Z).expect("a direction");
    // planes at -0.5, 0, 0.5, 1, 1.5: the plane of the lower face has nothing below it, that of the upper face has the box
    let planes = Planes { frame, first: -0.5, step: 0.5, count: 5 };
    let s = slice_at(&mesh, &planes);
    check_solid(&mesh, &planes, &s);
    assert_eq!((0..5).map(|k| s.plane_area(k)).collect::<Vec<_>>(), [0.0, 0.0, 1.0, 1.0, 0.0]);
    assert_eq!(counts(&s), [(0, 0), (0, 0), (1, 0), (1, 0), (0, 0)]);
}

#[test]
fn lattices_cut_through_vertices_and_edges_lose_nothing() {
    // a solid of unit cubes with a hole through it and a pit, all corners on integer planes
    let filled = |x: i32, y: i32, z: i32| {
        (0..4).contains(&x)
            && (0..4).contains(&y)
            && (0..3).contains(&z)
            && !(x == 1 && y == 1)
            && !(x == 2 && y == 2 && z == 2)
    };
    let mesh = cubes(4, filled);
    for (d, step) in [(DVec3::X, 1.0), (DVec3::Y, 0.5), (DVec3::Z, 0.5), (DVec3::ONE, 1.0 / 3f64.sqrt())] {
        let frame = PlaneFrame::across(d).expect("a direction");
        let planes = Planes { frame, first: -step, step, count: 14 };
        let s = slice_at(&mesh, &planes);
        assert_eq!(s.warnings().filter(|w| w.defect != Defect::Orientation).count(), 0);
        for k in 0..planes.count {
            let expected = area_by_moments(&mesh, &planes, k);
            assert!((s.plane_area(k) - expected).abs() < 1e-9, "along {d}, plane {k}: {} {expected}", s.plane_area(k));
        }
    }
    // through the faces: the layer below counts
    let frame = PlaneFrame::across(DVec3::Z).expect("a direction");
    let s = slice_at(&mesh, &Planes { frame, first: 0.0, step: 1.0, count: 5 });
    assert_eq!((0..5).map(|k| s.plane_area(k).round()).collect::<Vec<_>>(), [0.0, 15.0, 15.0, 14.0, 0.0]);
}

/// The surface of a set of unit cubes, facing outward.
fn cubes(n: i32, filled: impl Fn(i32, i32, i32) -> bool) -> TriMesh {
    let mut mesh = TriMesh::default();
    for (x, y, z) in (0..n * n * n).map(|i| (i % n, i / n % n, i / n / n)) {
        if !filled(x, y, z) {
            continue;
        }
        let at = DVec3::new(x.into(), y.into(), z.into());
        for axis in 0..3 {
            for side in [0, 1] {
                let mut to = [x, y, z];
                to[axis] += 2 * side - 1;
                if filled(to[0], to[1], to[2]) {
                    continue;
                }
                let (u, v) = (DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3]);
                let o = at + DVec3::AXES[axis] * f64::from(side);
                let first = mesh.positions.len() as u32;
                mesh.positions.extend([o, o + u, o + u + v, o + v]);
                let quad = if side == 1 { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
                mesh.triangles.extend(quad.map(|t| t.map(|i| i + first)));
            }
        }
    }
    mesh.welded()
}

#[test]
fn nested_shells_alternate() {
    // six shells: outer, hole, outer in the hole, ...
    let ball = primitives::geodesic_sphere(6);
    let mut mesh = TriMesh::default();
    for i in 0..6 {
        let shell = scaled(&ball, 1.0 - 0.15 * f64::from(i));
        mesh.append(&if i % 2 == 0 { shell } else { reversed(shell) });
    }
    let (planes, s) = slice(&mesh, DVec3::new(0.3, 0.2, 0.9), 101);
    check_solid(&mesh, &planes, &s);
    assert_eq!(s.plane_counts(50), (3, 3));
    for l in s.plane_loops(50) {
        if s.owner[l] as usize != l {
            // a hole belongs to the next larger loop
            let larger = s.plane_loops(50).filter(|&m| s.area[m].abs() > s.area[l].abs());
            let next = larger.min_by(|&a, &b| s.area[a].abs().total_cmp(&s.area[b].abs())).expect("something around");
            assert_eq!(s.owner[l] as usize, next);
        }
    }
    // all facing outward: the same sections by what encloses what, and a word about it
    let mut wrong = TriMesh::default();
    (0..6).for_each(|i| wrong.append(&scaled(&ball, 1.0 - 0.15 * f64::from(i))));
    let t = slice_at(&wrong, &planes);
    assert_eq!(counts(&t), counts(&s));
    for k in 0..101 {
        assert!((t.plane_area(k) - s.plane_area(k)).abs() < 1e-12);
    }
    assert_eq!(t.warnings().map(|w| w.defect).collect::<Vec<_>>(), [Defect::Orientation]);
}

#[test]
fn an_inside_out_mesh_is_cut_like_the_right_one() {
    let mesh = primitives::cavity_sphere(10);
    let (planes, s) = slice(&mesh, DVec3::new(0.31, 0.52, 0.8), 60);
    let t = slice_at(&reversed(mesh.clone()), &planes);
    assert_eq!(counts(&t), counts(&s));
    assert!((0..60).all(|k| (t.plane_area(k) - s.plane_area(k)).abs() < 1e-12));
    let w = t.warnings().next().expect("a warning");
    assert_eq!((w.defect, w.count as usize), (Defect::Orientation, t.loops()));
    assert!(w.sentence(&planes).contains("point the wrong way"));
    // half of the triangles turned: every contour still closes
    let mut mixed = mesh;
    mixed.triangles.iter_mut().step_by(2).for_each(|t| t.swap(1, 2));
    let t = slice_at(&mixed, &planes);
    assert_eq!(counts(&t), counts(&s));
    assert!((0..60).all(|k| (t.plane_area(k) - s.plane_area(k)).abs() < 1e-12));
}

#[test]
fn many_components_beside_each_other() {
    let ball = scaled(&primitives::geodesic_sphere(3), 0.4);
    let mut mesh = TriMesh::default();
    for i in 0..100 {
        mesh.append(&ball.transformed(&DAffine3::from_translation(DVec3::new((i % 10).into(), (i / 10).into(), 0.0))));
    }
    let (planes, s) = slice(&mesh, DVec3::Z, 9);
    check_solid(&mesh, &planes, &s);
    assert!(counts(&s).iter().all(|c| *c == (100, 0)));
}

#[test]
fn spheres_that_overlap_stay_two() {
    let ball = primitives::geodesic_sphere(8);
    let mut mesh = ball.clone();
    mesh.append(&ball.transformed(&DAffine3::from_translation(DVec3::new(1.0, 0.1, 0.05))));
    let (_, s) = slice(&mesh, DVec3::Z, 40);
    assert!((5..35).all(|k| s.plane_counts(k) == (2, 0)), "{:?}", counts(&s));
}

#[test]
fn an_open_mesh_is_closed_by_straight_lines_and_named() {
    let mut mesh = unit_box();
    // without the two triangles of the side x = 1
    mesh.triangles.retain(|t| !t.iter().all(|&v| mesh.positions[v as usize].x == 1.0));
    assert_eq!(mesh.triangles.len(), 10);
    let (planes, s) = slice(&mesh, DVec3::Z, 4);
    for k in 0..4 {
        assert_eq!(s.plane_counts(k), (1, 0));
        assert!((s.plane_area(k) - 1.0).abs() < 1e-12);
    }
    let w = s.warnings().next().expect("a warning");
    assert_eq!((w.defect, w.count, w.plane), (Defect::Open, 4, 0));
    let at = planes.frame.lift(w.at, planes.height(0));
    assert!(at.abs_diff_eq(DVec3::new(1.0, at.y, 0.125), 1e-12) && (at.y == 0.0 || at.y == 1.0), "{at}");
}

#[test]
fn one_triangle_gives_lines_without_area() {
    let mesh = TriMesh { positions: vec![DVec3::ZERO, DVec3::X, DVec3::Z], triangles: vec![[0, 1, 2]] };
    let (_, s) = slice(&mesh, DVec3::Z, 3);
    assert_eq!(s.loops(), 3);
    assert!((0..3).all(|l| s.loop_points(l).len() == 2 && s.owner[l] == Slices::NONE));
    assert_eq!(s.warnings().map(|w| (w.defect, w.count)).collect::<Vec<_>>(), [(Defect::Open, 3)]);
}

#[test]
fn planes_that_miss_and_meshes_of_nothing() {
    let frame = PlaneFrame::across(DVec3::Z).expect("a direction");
    let s = slice_at(&unit_box(), &Planes { frame, first: 5.0, step: 1.0, count: 3 });
    assert_eq!((s.loops(), s.planes(), s.points.len()), (0, 3, 0));
    let s = slice_at(&unit_box(), &Planes { frame, first: 0.5, step: 0.0, count: 2 });
    assert_eq!(counts(&s), [(1, 0), (1, 0)]);
    let s = slice_at(&unit_box(), &Planes { frame, first: 0.5, step: 1.0, count: 0 });
    assert_eq!((s.loops(), s.planes()), (0, 0));
    let (planes, s) = slice(&TriMesh::default(), DVec3::X, 7);
    assert_eq!((planes.count, s.planes()), (0, 0));
    let flat = TriMesh { positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y], triangles: vec![[0, 1, 2], [0, 2, 1]] };
    let (_, s) = slice(&flat, DVec3::Z, 5);
    assert_eq!(s.loops(), 0);
    assert!(PlaneFrame::across(DVec3::ZERO).is_none() && PlaneFrame::across(DVec3::splat(f64::NAN)).is_none());
    let ball = primitives::geodesic_sphere(40);
    let error = |count| {
        let planes = Planes::between(frame, -0.5, 0.5, count);
        Slicer::default().slice(&ball.positions, &topology(&ball), &planes).expect_err("too many")
    };
    assert!(matches!(error(1_000_000), SliceError::TooManyPoints(_)));
    assert_eq!(error(1 << 30), SliceError::TooManyPlanes(1 << 30));
}

#[test]
fn vertices_that_are_no_numbers_are_passed_by() {
    for bad in [DVec3::NAN, DVec3::INFINITY, DVec3::new(f64::NAN, 0.5, 0.5), DVec3::new(0.0, f64::INFINITY, 0.4)] {
        let mut mesh = primitives::geodesic_sphere(4);
        mesh.positions[17] = bad;
        let frame = PlaneFrame::across(DVec3::new(0.1, 0.2, 0.97)).expect("a direction");
        let s = slice_at(&mesh, &Planes::between(frame, -1.0, 1.0, 40));
        assert!((0..40).all(|k| s.plane_area(k) < PI));
        assert!(s.warnings().any(|w| w.defect == Defect::NotFinite), "{bad}");
    }
    let mut mesh = unit_box();
    mesh.positions.iter_mut().for_each(|p| *p *= 1e300);
    let (_, s) = slice(&mesh, DVec3::Z, 3);
    assert!(s.area.iter().all(|a| a.is_finite()));
}

#[test]
fn buffers_are_kept_and_results_do_not_depend_on_what_was_before() {
    let meshes =
        [primitives::bumpy_sphere(20), unit_box(), primitives::cavity_sphere(16), primitives::torus(1.0, 0.4, 9, 7)];
    let mut slicer = Slicer::default();
    for round in 0..3 {
        for mesh in &meshes {
            for d in directions() {
                let frame = PlaneFrame::across(d).expect("a direction");
                let planes = Planes::across(frame, &mesh.positions, 30 + 50 * round);
                let again = slicer.slice(&mesh.positions, &topology(mesh), &planes).expect("not too many").clone();
                let fresh = slice_at(mesh, &planes);
                assert_eq!((again.points, again.owner, again.area), (fresh.points, fresh.owner, fresh.area));
            }
        }
    }
}

#[test]
fn a_second_thread_changes_nothing() {
    let mesh = primitives::cavity_sphere(40);
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads");
    let one = pool(1).install(|| slice(&mesh, DVec3::new(0.3, 0.5, 0.8), 200).1);
    let four = pool(4).install(|| slice(&mesh, DVec3::new(0.3, 0.5, 0.8), 200).1);
    // runs of planes start loops at other points; what they enclose is the same
    assert_eq!(counts(&one), counts(&four));
    assert_eq!(one.points.len(), four.points.len());
    for k in 0..200 {
        assert!((one.plane_area(k) - four.plane_area(k)).abs() < 1e-12);
    }
}

#[test]
fn boxes_are_cut_in_convex_polygons() {
    let mesh_of = |b: &OrientedBox| primitives::cuboid(&b.corners());
    for seed in 0..60 {
        let x = |i: i32| (f64::from(seed * 17 + i) * 12.9898).sin();
        let axes = DMat3::from_quat(DQuat::from_xyzw(x(0), x(1), x(2), x(3)).normalize());
        let half = DVec3::new(x(4).abs() + 0.1, x(5).abs() + 0.1, x(6).abs() + 0.1);
        let b = OrientedBox { center: DVec3::new(x(7), x(8), x(9)), axes, half };
        let mesh = mesh_of(&b);
        let (planes, s) = slice(&mesh, DVec3::new(x(10), x(11), x(12)), 23);
        check_solid(&mesh, &planes, &s);
        for k in 0..23 {
            let polygon = BoxSections::new(&b, &planes.frame).at(planes.height(k));
            assert!((3..=6).contains(&polygon.len()));
            assert!((shoelace(&polygon) - s.plane_area(k)).abs() < 1e-12);
            for i in 0..polygon.len() {
                let (a, b, c) = (polygon[i], polygon[(i + 1) % polygon.len()], polygon[(i + 2) % polygon.len()]);
                assert!((b - a).perp_dot(c - b) > 0.0, "convex");
            }
        }
        assert!(BoxSections::new(&b, &planes.frame).at(planes.height(0) - planes.step).is_empty());
    }
    let b = OrientedBox { center: DVec3::splat(0.5), axes: DMat3::IDENTITY, half: DVec3::splat(0.5) };
    let frame = PlaneFrame::across(DVec3::Z).expect("a direction");
    assert_eq!(BoxSections::new(&b, &frame).at(1.0).len(), 4);
    assert!(BoxSections::new(&b, &frame).at(0.0).is_empty() && BoxSections::new(&b, &frame).at(f64::NAN).is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Star-shaped blobs of random radii, cut in random directions.
    #[test]
    fn random_solids_agree_with_the_moments(
        radii in proptest::collection::vec(0.2..1.0f64, 162),
        d in (-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64),
        n in 1usize..40,
    ) {
        let mut mesh = primitives::geodesic_sphere(4);
        mesh.positions.iter_mut().zip(&radii).for_each(|(p, r)| *p *= *r);
        let d = DVec3::new(d.0, d.1, d.2);
        prop_assume!(d.length() > 1e-3);
        let (planes, s) = slice(&mesh, d, n);
        check_solid(&mesh, &planes, &s);
    }

    /// Integer positions and integer planes: vertices, edges and faces lie in planes all the time.
    #[test]
    fn random_integer_tetrahedra_agree_with_the_moments(
        p in proptest::collection::vec((-3i32..4, -3i32..4, -3i32..4), 4),
        axis in 0usize..3,
    ) {
        let positions = p.iter().map(|&(x, y, z)| DVec3::new(x.into(), y.into(), z.into())).collect();
        let mesh = TriMesh { positions, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]] };
        let mesh = if mesh.volume() < 0.0 { reversed(mesh) } else { mesh };
        let frame = PlaneFrame::across(DVec3::AXES[axis]).expect("a direction");
        let planes = Planes { frame, first: -4.0, step: 1.0, count: 9 };
        let s = slice_at(&mesh, &planes);
        for k in 0..9 {
            prop_assert!((s.plane_area(k) - area_by_moments(&mesh, &planes, k)).abs() < 1e-9);
        }
    }

    /// Any triangles at all: no panic, arrays that fit together.
    #[test]
    fn soups_do_not_matter(
        p in proptest::collection::vec((-2i32..3, -2i32..3, -2i32..3), 3..9),
        t in proptest::collection::vec([0usize..64, 0..64, 0..64], 0..40),
        d in (-2i32..3, -2i32..3, 1i32..3),
    ) {
        let n = p.len();
        let positions = p.iter().map(|&(x, y, z)| DVec3::new(x.into(), y.into(), z.into())).collect();
        let mesh = TriMesh { positions, triangles: t.iter().map(|t| t.map(|v| (v % n) as u32)).collect() };
        slice(&mesh, DVec3::new(d.0.into(), d.1.into(), d.2.into()), 7);
        let frame = PlaneFrame::across(DVec3::Z).expect("a direction");
        slice_at(&mesh, &Planes { frame, first: -2.0, step: 0.5, count: 9 });
    }

    #[test]
    fn the_number_of_planes_below_is_exact(first in -10.0..10.0f64, step in 0.0..1.0f64, n in 0usize..50, k in 0usize..50) {
        let frame = PlaneFrame::across(DVec3::Z).expect("a direction");
        let planes = Planes { frame, first, step, count: n };
        for h in [planes.height(k), planes.height(k).next_up(), planes.height(k).next_down()] {
            let below = planes.below(h) as usize;
            prop_assert_eq!(below, (0..n).filter(|&i| planes.height(i) <= h).count());
        }
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn real_meshes_are_cut_without_complaint() {
    for name in
        ["spot.obj", "bunny.obj", "torus.stl", "three_holes.obj", "fixed_top.ply", "two_balls.obj", "pelvis_f.obj"]
    {
        let path = std::path::Path::new("../shared/data/meshes").join(name);
        let mesh = voxclay::io::read_surface(&path).expect("a surface").welded();
        let (planes, s) = slice(&mesh, DVec3::new(0.31, 0.52, 0.8), 150);
        check_solid(&mesh, &planes, &s);
        let volume: f64 = (0..150).map(|k| s.plane_area(k)).sum::<f64>() * planes.step;
        assert!((volume / mesh.volume() - 1.0).abs() < 2e-3, "{name}: {volume} {}", mesh.volume());
        // along an axis faces and vertices lie in planes
        let (planes, s) = slice(&mesh, DVec3::Y, 100);
        check_solid(&mesh, &planes, &s);
    }
    for name in ["dirty_bunny_open.ply", "dirty_sphere_with_hole.stl"] {
        let path = std::path::Path::new("../shared/data/meshes").join(name);
        let mesh = voxclay::io::read_surface(&path).expect("a surface").welded();
        let (_, s) = slice(&mesh, DVec3::new(0.31, 0.52, 0.8), 150);
        assert!(s.warnings().any(|w| w.defect == Defect::Open && w.count > 0), "{name}");
    }
}

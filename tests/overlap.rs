//! Meshes whose parts overlap: every point of a section is covered once, whoever triangulates it.

use std::path::Path;

use glam::{DAffine3, DQuat, DVec2, DVec3};
use voxclay::deform::{Deformation, Deformer, DisplacementVolume};
use voxclay::evaluate::geometry::{GeometryOptions, Refinement, outlines, slices_with_warnings};
use voxclay::evaluate::load::{Object, load};
use voxclay::evaluate::picture::{Backend, Mode, Renderer, ViewOptions};
use voxclay::io::write_surface;
use voxclay::math::PlaneFrame;
use voxclay::mesh::check::{DefectKind, overlaps, slicing_defects};
use voxclay::mesh::{Topology, TriMesh, primitives};
use voxclay::render::{Look, SliceGeometry};
use voxclay::scene::{CameraSpec, Document, ProxySource, VolumeSource};
use voxclay::slice::{Defect, Planes, Slicer, Slices};
use voxclay::tessellate::regions::Cutter;
use voxclay::tessellate::squares::Squares;
use voxclay::tessellate::{Limits, Method, Outlines, Tessellator};
use voxclay::volume::transfer::{ControlPoint, TransferFunction, Window};

mod pictures;
use pictures::difference;

type Triangle = [DVec2; 3];

fn shoelace(p: &[DVec2]) -> f64 {
    (0..p.len()).map(|i| p[i].perp_dot(p[(i + 1) % p.len()])).sum::<f64>() / 2.0
}

fn moved(mesh: &TriMesh, by: [f64; 3]) -> TriMesh {
    mesh.transformed(&DAffine3::from_translation(by.into()))
}

fn cuboid(lo: [f64; 3], hi: [f64; 3]) -> TriMesh {
    primitives::aligned_box(lo.into(), hi.into())
}

fn joined<'a>(parts: impl IntoIterator<Item = &'a TriMesh>) -> TriMesh {
    let mut all = TriMesh::default();
    parts.into_iter().for_each(|p| all.append(p));
    all
}

fn reversed(mesh: &TriMesh) -> TriMesh {
    let mut mesh = mesh.clone();
    mesh.flip();
    mesh
}

fn directions() -> [DVec3; 5] {
    [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.31, 0.52, 0.8), DVec3::new(-1.0, 1.0, 1e-9)]
}

fn planes(mesh: &TriMesh, direction: DVec3, count: usize) -> Planes {
    Planes::across(PlaneFrame::across(direction).expect("a direction"), &mesh.positions, count)
}

fn sections(mesh: &TriMesh, planes: &Planes, overlaps: bool) -> Slices {
    let mut slicer = Slicer { overlaps, ..Slicer::default() };
    let topology = Topology::build(mesh.positions.len(), &mesh.triangles);
    slicer.slice(&mesh.positions, &topology, planes).expect("few points").clone()
}

/// What lies inside a convex solid.
fn is_inside(part: &TriMesh, p: DVec3) -> bool {
    part.triangles.iter().all(|t| {
        let [a, b, c] = t.map(|v| part.positions[v as usize]);
        (b - a).cross(c - a).dot(p - a) < 0.0
    })
}

/// What two convex polygons, anticlockwise, have in common (Sutherland and Hodgman).
fn common(a: &[DVec2], b: &[DVec2]) -> Vec<DVec2> {
    let mut result = a.to_vec();
    for i in 0..b.len() {
        let (from, along) = (b[i], b[(i + 1) % b.len()] - b[i]);
        if along.length() < 1e-9 {
            // a side of two points in one place, with any direction
            continue;
        }
        let left = |p: DVec2| along.perp_dot(p - from);
        let before = std::mem::take(&mut result);
        for (j, &p) in before.iter().enumerate() {
            let q = before[(j + 1) % before.len()];
            if left(p) >= 0.0 {
                result.push(p);
            }
            if (left(p) >= 0.0) != (left(q) >= 0.0) {
                result.push(p.lerp(q, left(p) / (left(p) - left(q))));
            }
        }
    }
    result
}

/// The area where more of the convex polygons with sign 1 lie over each other than of those with sign -1, by counting for
/// each set of polygons what is in all of them and in no other.
fn covered_area(polygons: &[(Vec<DVec2>, i32)]) -> f64 {
    let sets = 1..1usize << polygons.len();
    let members = |set: usize| (0..polygons.len()).filter(move |i| set >> i & 1 == 1);
    let in_all: Vec<f64> = (0..sets.end)
        .map(|set| {
            let together = members(set).map(|i| polygons[i].0.clone()).reduce(|a, b| common(&a, &b));
            together.map_or(0.0, |p| shoelace(&p))
        })
        .collect();
    let exactly = |set: usize| -> f64 {
        let larger = sets.clone().filter(|s| s & set == set);
        larger.map(|s| if (s ^ set).count_ones().is_multiple_of(2) { in_all[s] } else { -in_all[s] }).sum()
    };
    sets.clone().filter(|&set| members(set).map(|i| polygons[i].1).sum::<i32>() > 0).map(exactly).sum()
}

/// Random numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1u32 << 31)
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

/// Places in a plane, and whether they are inside.
type Samples = Vec<(DVec2, bool)>;

/// Triangles face up, have the area together, and cover each sample once or not at all.
fn check_cover(name: &str, triangles: &[Triangle], area: f64, size: f64, samples: &Samples) {
    let sum: f64 = triangles.iter().map(|t| shoelace(t)).sum();
    assert!((sum - area).abs() <= 1e-9 * size * size, "{name}: {sum}, not {area}");
    assert!(triangles.iter().all(|t| shoelace(t) >= -1e-12 * size * size), "{name}");
    for (p, inside) in samples {
        let holds = |t: &&Triangle| (0..3).all(|i| (t[(i + 1) % 3] - t[i]).perp_dot(*p - t[i]) > 0.0);
        assert_eq!(triangles.iter().filter(holds).count(), usize::from(*inside), "{name}: {p}");
    }
}

/// All ways from sections to triangles.
fn check_ways(name: &str, s: &Slices, k: usize, area: f64, size: f64, samples: &Samples) {
    let outlines = outlines(s);
    for method in [Method::Fast, Method::Lyon, Method::Quality(Limits::default())] {
        let mut tessellator = Tessellator::default();
        let t = tessellator.run(&outlines, method);
        assert_eq!(t.made_by.mismatched, 0, "{name} {method:?}");
        let triangles: Vec<Triangle> =
            t.triangles[t.plane_triangles(k)].iter().map(|t2| t2.map(|i| t.point(&outlines, i))).collect();
        check_cover(&format!("{name} {method:?}"), &triangles, area, size, samples);
    }
    let points = s.plane_loops(k).flat_map(|l| s.loop_points(l));
    let (lo, hi) = points.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
    if !lo.is_finite() {
        return;
    }
    let turned = |at: f64, angle: f64, radius: f64| -> Vec<DVec2> {
        let corner = |i: u32| DVec2::from_angle(angle + std::f64::consts::FRAC_PI_2 * f64::from(i));
        (0..4).map(|i| lo.lerp(hi, at) + radius * (hi - lo).max_element() * corner(i)).collect()
    };
    let convex = [turned(0.4, 0.3, 0.3), turned(0.6, 1.0, 0.25)];
    let regions = Cutter::default().cut(&outlines, k, &convex, Method::Fast);
    let parts = [&regions.outside, &regions.inside];
    let triangles: Vec<Triangle> =
        parts.iter().flat_map(|r| r.triangles.iter().map(|t| t.map(|i| r.point(i)))).collect();
    check_cover(&format!("{name} regions"), &triangles, area, size, samples);
    let mut squares = Squares::default();
    squares.lay(&outlines, k, &convex, 0.07 * (hi - lo).max_element());
    let all = squares.inside.iter().chain(&squares.rest);
    let triangles: Vec<Triangle> = all.map(|t| t.map(|i| squares.points[i as usize])).collect();
    check_cover(&format!("{name} squares"), &triangles, area, size, samples);
}

/// The united sections of convex parts, those with sign -1 facing inward, against areas and samples known otherwise.
fn check(name: &str, parts: &[(TriMesh, i32)], direction: DVec3, count: usize) -> Slices {
    let faced: Vec<TriMesh> = parts.iter().map(|(p, sign)| if *sign < 0 { reversed(p) } else { p.clone() }).collect();
    let mesh = joined(&faced);
    let defects = slicing_defects(&mesh);
    assert!(defects.iter().any(|d| d.kind == DefectKind::SelfIntersection) && overlaps(&defects), "{name}");
    let planes = planes(&mesh, direction, count);
    let s = sections(&mesh, &planes, true);
    let alone: Vec<Slices> = parts.iter().map(|(p, _)| sections(p, &planes, false)).collect();
    let (lo, hi) = mesh.bounds().expect("a mesh");
    let size = (hi - lo).max_element();
    let mut random = Random(7);
    for k in 0..count {
        let polygons: Vec<(Vec<DVec2>, i32)> = (alone.iter().zip(parts))
            .flat_map(|(a, (_, sign))| a.plane_loops(k).map(|l| (a.loop_points(l).to_vec(), *sign)))
            .collect();
        let area = covered_area(&polygons);
        assert!((s.plane_area(k) - area).abs() <= 1e-9 * size * size, "{name} {k}: {}, not {area}", s.plane_area(k));
        let height = planes.height(k);
        let samples = (0..150)
            .map(|_| {
                let p = planes.frame.project(lo + (hi - lo) * random.vector());
                let at = planes.frame.lift(p, height);
                let winding: i32 = parts.iter().filter(|(part, _)| is_inside(part, at)).map(|(_, sign)| sign).sum();
                (p, winding > 0)
            })
            .collect();
        check_ways(&format!("{name}, {direction}, plane {k}"), &s, k, area, size, &samples);
    }
    s
}

#[test]
fn cubes_that_share_planes_of_their_faces_are_one() {
    let cube = cuboid([0.0; 3], [2.0; 3]);
    for by in [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.5, 1.0, 0.25], [0.3, 0.2, 0.1]] {
        for d in directions() {
            let s = check(&format!("cubes by {by:?}"), &[(cube.clone(), 1), (moved(&cube, by), 1)], d, 9);
            assert_eq!(s.warnings().count(), 0);
            assert!((0..9).all(|k| s.plane_counts(k).1 == 0));
        }
    }
    // planes at the heights of faces: these belong to the lower side
    let mesh = joined([&cube, &moved(&cube, [1.0, 0.0, 1.0])]);
    let frame = PlaneFrame::across(DVec3::Z).expect("a direction");
    let s = sections(&mesh, &Planes { frame, first: 0.0, step: 1.0, count: 4 }, true);
    let areas: Vec<f64> = (0..4).map(|k| s.plane_area(k)).collect();
    assert_eq!(areas, [0.0, 4.0, 6.0, 4.0]);
}

#[test]
fn spheres_are_united_also_where_one_section_is_in_the_other() {
    let ball = primitives::geodesic_sphere(6);
    let small = ball.transformed(&DAffine3::from_scale(DVec3::splat(0.7)));
    for other in [moved(&ball, [1.0, 0.1, 0.05]), moved(&small, [0.6, 0.0, 0.0])] {
        for d in directions() {
            let s = check("spheres", &[(ball.clone(), 1), (other.clone(), 1)], d, 15);
            assert!((0..15).all(|k| s.plane_counts(k).1 == 0));
            assert_eq!(s.warnings().count(), 0);
        }
    }
}

#[test]
fn a_cavity_takes_away_what_it_is_in() {
    let cube = cuboid([0.0; 3], [4.0; 3]);
    let within = cuboid([1.0; 3], [2.0; 3]);
    for cavity in [cuboid([2.5, 1.0, 1.0], [5.0, 3.0, 3.0]), cuboid([2.5, 1.0, 0.0], [4.5, 3.0, 3.5])] {
        for d in directions() {
            let s = check("cavity", &[(cube.clone(), 1), (cavity.clone(), -1), (within.clone(), -1)], d, 12);
            assert_eq!(s.warnings().map(|w| w.defect).collect::<Vec<_>>(), [Defect::Backward]);
        }
    }
    // filled by another part
    let plug = cuboid([2.0, 0.5, 0.5], [6.0, 3.5, 3.5]);
    let cavity = cuboid([2.5, 1.0, 1.0], [5.0, 3.0, 3.0]);
    let s = check("plug", &[(cube, 1), (cavity, -1), (plug, 1)], DVec3::new(0.31, 0.52, 0.8), 12);
    assert_eq!(s.warnings().count(), 0);
}

#[test]
fn three_parts_in_one_place_are_covered_once() {
    let ball = primitives::geodesic_sphere(5);
    let cube = cuboid([-0.2, -0.3, -0.4], [1.1, 1.2, 1.3]);
    let tilted = moved(&cube, [0.3, -0.4, 0.1]).transformed(&DAffine3::from_quat(DQuat::from_rotation_y(0.7)));
    for d in directions() {
        check("three", &[(ball.clone(), 1), (cube.clone(), 1), (tilted.clone(), 1)], d, 11);
        check("three cubes", &[[0.0; 3], [1.0, 0.0, 1.0], [0.5, 1.0, 1.0]].map(|by| (moved(&cube, by), 1)), d, 11);
    }
}

#[test]
fn random_convex_parts_are_covered_once() {
    let mut random = Random(1);
    let shapes = [
        cuboid([-1.0; 3], [1.0; 3]),
        primitives::geodesic_sphere(1),
        primitives::geodesic_sphere(4),
        primitives::cylinder(0.8, 1.5, 17),
    ];
    for round in 0..12 {
        let count = 2 + round % 4;
        let parts: Vec<(TriMesh, i32)> = (0..count)
            .map(|_| {
                let shape = &shapes[(random.next() * 4.0) as usize];
                let turn = DQuat::from_axis_angle((random.vector() - 0.5).normalize(), 6.0 * random.next());
                let map = DAffine3::from_scale_rotation_translation(
                    0.4 + random.vector(),
                    turn,
                    // so near that they meet
                    0.5 * random.vector(),
                );
                (shape.transformed(&map), if random.next() < 0.8 { 1 } else { -1 })
            })
            .collect();
        if parts.iter().all(|(_, sign)| *sign < 0) {
            continue;
        }
        let faced =
            joined(&parts.iter().map(|(p, s)| if *s < 0 { reversed(p) } else { p.clone() }).collect::<Vec<_>>());
        if faced.volume() > 0.0 && overlaps(&slicing_defects(&faced)) {
            check(&format!("round {round}"), &parts, random.vector() - 0.4, 7);
        }
    }
}

#[test]
fn what_faces_inward_as_a_whole_is_taken_the_other_way_round() {
    let cube = cuboid([0.0; 3], [2.0; 3]);
    let mesh = joined([&cube, &moved(&cube, [0.5, 1.0, 0.25])]);
    let planes = planes(&mesh, DVec3::new(0.31, 0.52, 0.8), 20);
    let (s, t) = (sections(&mesh, &planes, true), sections(&reversed(&mesh), &planes, true));
    for k in 0..20 {
        assert!((s.plane_area(k) - t.plane_area(k)).abs() < 1e-12 && s.plane_counts(k) == t.plane_counts(k));
    }
    assert!(s.warnings().count() == 0);
    assert_eq!(t.warnings().map(|w| w.defect).collect::<Vec<_>>(), [Defect::Orientation]);
    // where triangles disagree, contours have no direction to unite them by
    let mut mixed = mesh;
    mixed.triangles[3].swap(0, 1);
    let defects = slicing_defects(&mixed);
    assert!(defects.iter().any(|d| d.kind == DefectKind::SelfIntersection) && !overlaps(&defects));
}

#[test]
fn uniting_changes_nothing_in_clean_meshes() {
    for mesh in [
        primitives::cavity_sphere(10),
        primitives::torus(1.0, 0.4, 40, 20),
        primitives::bumpy_sphere(10),
        cuboid([0.0; 3], [1.0; 3]),
    ] {
        assert!(slicing_defects(&mesh).is_empty());
        for d in directions() {
            let planes = planes(&mesh, d, 30);
            let (nested, united) = (sections(&mesh, &planes, false), sections(&mesh, &planes, true));
            for k in 0..30 {
                assert_eq!(nested.plane_counts(k), united.plane_counts(k));
                assert!((nested.plane_area(k) - united.plane_area(k)).abs() < 1e-12);
            }
            assert_eq!(nested.points.len(), united.points.len());
            assert_eq!(united.warnings().count(), 0);
        }
    }
    let none = sections(&TriMesh::default(), &planes(&cuboid([0.0; 3], [1.0; 3]), DVec3::Z, 3), true);
    assert_eq!((none.planes(), none.loops()), (3, 0));
}

/// Outlines that cross although nobody united them (a mesh that was bent later): the tessellators' last resort.
#[test]
fn outlines_of_one_polygon_that_cross_are_covered_once() {
    let ring = |center: DVec2, n: u32| -> Vec<DVec2> {
        (0..n).map(|i| center + DVec2::from_angle(std::f64::consts::TAU * f64::from(i) / f64::from(n))).collect()
    };
    let loops = [ring(DVec2::ZERO, 40), ring(DVec2::new(0.9, 0.3), 31)];
    let points: Vec<DVec2> = loops.concat();
    let area = loops.each_ref().map(|l| shoelace(l));
    let outlines =
        Outlines { points: &points, loop_start: &[0, 40, 71], plane_start: &[0, 2], area: &area, owner: &[0, 0] };
    let expected = covered_area(&loops.clone().map(|l| (l, 1)));
    let inside = |l: &[DVec2], p: DVec2| (0..l.len()).all(|i| (l[(i + 1) % l.len()] - l[i]).perp_dot(p - l[i]) > 0.0);
    let mut random = Random(3);
    let samples = (0..500)
        .map(|_| {
            let p = DVec2::new(-1.1 + 3.2 * random.next(), -1.1 + 2.5 * random.next());
            (p, loops.iter().any(|l| inside(l, p)))
        })
        .collect();
    // the sweep takes them for polygons side by side
    for method in [Method::Lyon, Method::Quality(Limits::default())] {
        let mut tessellator = Tessellator::default();
        let t = tessellator.run(&outlines, method);
        assert_eq!((t.made_by.mismatched, t.made_by.spade), (1, 1));
        let triangles: Vec<Triangle> = t.triangles.iter().map(|t2| t2.map(|i| t.point(&outlines, i))).collect();
        check_cover(&format!("{method:?}"), &triangles, expected, 2.0, &samples);
    }
}

/// Two boxes in one file that overlap in the middle third, and the box that they are together, in the middle of a volume.
fn boxes(dir: &Path) -> [Document; 2] {
    let source = VolumeSource::Phantom { name: "sphere".into(), size: 32 };
    let grid = load(&Document::new(source.clone()), Path::new("")).unwrap().volume.grid;
    let at = |x: f64, y: f64, z: f64| grid.world_from_texture().transform_point3(DVec3::new(x, y, z));
    let part = |from: f64, to: f64| primitives::aligned_box(at(from, 0.25, 0.3), at(to, 0.75, 0.7));
    let meshes = [("two.obj", joined([&part(0.2, 0.6), &part(0.4, 0.8)])), ("one.obj", part(0.2, 0.8))];
    meshes.map(|(name, mesh)| {
        write_surface(&dir.join(name), &mesh).unwrap();
        let point = |at| ControlPoint { at, color: [0.9, 0.6, 0.3], opacity: 0.02 };
        let points = vec![point(0.0), point(1.0)];
        let glass = TransferFunction { name: "glass".into(), window: Window::Auto, points, regions: vec![] };
        Document {
            proxy: ProxySource::Mesh(name.into()),
            transfer_function: Some(glass),
            ..Document::new(source.clone())
        }
    })
}

fn area_of_slices(g: &SliceGeometry) -> Vec<f64> {
    let place = |i: &u32| DVec3::from(g.vertices[*i as usize].position.map(f64::from));
    g.slices
        .iter()
        .map(|range| {
            let indices = &g.indices[range.start as usize..range.end as usize];
            let area = |t: &[u32]| (place(&t[1]) - place(&t[0])).cross(place(&t[2]) - place(&t[0])).length() / 2.0;
            indices.chunks_exact(3).map(area).sum()
        })
        .collect()
}

#[test]
fn slices_of_boxes_that_overlap_are_those_of_the_box_that_they_are() {
    let dir = tempfile::tempdir().unwrap();
    let [mut two, mut one] = boxes(dir.path());
    let grid = load(&one, dir.path()).unwrap().volume.grid;
    let radius = 0.1 * (grid.world_from_texture().matrix3 * DVec3::X).length();
    let stroke =
        DisplacementVolume::from_drag(grid.center(), DVec3::new(0.3, 0.5, 0.2) * radius, 2.0 * radius).unwrap();
    for document in [&mut two, &mut one] {
        let stroke = Deformation::new("pull", Deformer::Displacement(stroke));
        document.stack.items = vec![Deformation { moves_shape: false, ..stroke }];
    }
    let [two, one] = [two, one].map(|d| load(&d, dir.path()).unwrap());
    assert!(two.overlaps && !one.overlaps && one.warnings.is_empty());
    assert!(two.warnings.len() == 1 && two.warnings[0].contains("two.obj: "), "{:?}", two.warnings);
    assert!(two.warnings[0].contains("cut through other parts of the surface, the first at ("), "{:?}", two.warnings);
    for (yaw, pitch) in [(0.0, 0.0), (90.0, 0.0), (30.0, 20.0), (200.0, -70.0)] {
        let camera = one.camera(&CameraSpec { yaw, pitch, ..CameraSpec::default() });
        for (refinement, subdivide) in [
            (Refinement::Draft, false),
            (Refinement::Draft, true),
            (Refinement::Depth(2), true),
            (Refinement::Tolerance(0.25), true),
        ] {
            let options = GeometryOptions { slices: Some(25), refinement, subdivide, size: (256, 256) };
            let make = |object: &Object| slices_with_warnings(object, &camera, &options).unwrap();
            let ((a, said), (b, _)) = (make(&two), make(&one));
            assert!(said.is_empty(), "{said:?}");
            let (a, b) = (area_of_slices(&a), area_of_slices(&b));
            let most = b.iter().copied().fold(0.0, f64::max);
            assert_eq!((a.len(), b.len()), (25, 25));
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-5 * most), "{yaw} {refinement:?}: {a:?} {b:?}");
        }
    }
}

#[test]
fn translucent_boxes_are_no_darker_where_they_overlap() {
    let dir = tempfile::tempdir().unwrap();
    let [two, one] = boxes(dir.path()).map(|d| load(&d, dir.path()).unwrap());
    let drawn_twice = Object { overlaps: false, ..two.clone() };
    let options = ViewOptions {
        size: (96, 96),
        slices: Some(40),
        mode: Mode::Slicing,
        refinement: Refinement::Tolerance(0.25),
        backend: Backend::Cpu,
        transparent: true,
        corrections: None,
    };
    let camera = one.camera(&CameraSpec { yaw: 25.0, pitch: 15.0, ..CameraSpec::default() });
    let mut renderer = Renderer::new(Backend::Cpu).unwrap();
    let mut picture = |o: &Object| renderer.picture(o, &camera, &Look::default(), &options).unwrap().0;
    let (expected, ours, twice) = (picture(&one), picture(&two), picture(&drawn_twice));
    let (good, bad) = (difference(&expected, &ours), difference(&expected, &twice));
    assert!(good.max <= 2.0, "{good:?}");
    assert!(bad.max > 20.0, "{bad:?}");
}

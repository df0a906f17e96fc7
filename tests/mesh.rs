//! Checks of surface meshes: shapes with a known answer, every kind of defect, and the real meshes.

use glam::{DAffine3, DVec3};
use voxclay::mesh::check::{DefectKind, MeshReport, overlaps, slicing_defects};
use voxclay::mesh::{TriMesh, primitives};

fn kinds(report: &MeshReport) -> Vec<(DefectKind, usize)> {
    report.defects().iter().map(|d| (d.kind, d.count)).collect()
}

fn moved(mesh: &TriMesh, by: [f64; 3]) -> TriMesh {
    mesh.transformed(&DAffine3::from_translation(DVec3::from_array(by)))
}

#[test]
fn clean_solids_have_no_defect() {
    for (mesh, components, euler) in [
        (primitives::aligned_box(DVec3::ZERO, DVec3::ONE), 1, 2),
        (primitives::torus(2.0, 0.7, 30, 12), 1, 0),
        (primitives::cylinder(1.0, 2.0, 17), 1, 2),
        (primitives::bumpy_sphere(12), 1, 2),
        (primitives::cavity_sphere(12), 2, 4),
    ] {
        let r = MeshReport::of(&mesh);
        assert!(r.is_clean_solid(), "{:?}", r.defects());
        assert_eq!(
            (r.components, r.euler, r.vertices, r.triangles),
            (components, euler, mesh.positions.len(), mesh.triangles.len())
        );
        assert!(r.closed && r.manifold && r.oriented && !r.inside_out);
        assert_eq!((r.volume, r.area, r.bounds), (mesh.volume(), mesh.area(), mesh.bounds()));
    }
}

#[test]
fn an_empty_mesh_and_one_triangle_are_no_solids() {
    let r = MeshReport::of(&TriMesh::default());
    assert!(!r.closed && !r.is_clean_solid() && r.bounds.is_none());
    assert_eq!((r.vertices, r.components, r.euler, r.area), (0, 0, 0, 0.0));
    let one = TriMesh { positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y], triangles: vec![[0, 1, 2]] };
    let r = MeshReport::of(&one);
    assert_eq!(kinds(&r), [(DefectKind::Boundary, 3)]);
    assert_eq!((r.euler, r.components, r.area), (1, 1, 0.5));
    assert_eq!(
        r.defects()[0].to_string(),
        "3 edges have a triangle on one side only (holes), the first at (0.500000, 0.000000, 0.000000)"
    );
}

#[test]
fn a_hole_is_named_with_its_place() {
    let mut ball = moved(&primitives::geodesic_sphere(6), [10.0, 20.0, 30.0]);
    let gone = ball.triangles.remove(40);
    let hole = gone.map(|v| ball.positions[v as usize]).iter().sum::<DVec3>() / 3.0;
    let r = MeshReport::of(&ball);
    assert_eq!(kinds(&r), [(DefectKind::Boundary, 3)]);
    assert!(r.defects()[0].place.distance(hole) < 0.2 && r.defects()[0].kind.spoils_slices());
    assert!(!r.closed && r.manifold && r.oriented);
    assert_eq!(slicing_defects(&ball), r.defects());
    assert!(!overlaps(r.defects()));
    // parts that overlap are named, too: they are drawn as one
    ball.triangles.insert(40, gone);
    assert!(slicing_defects(&ball).is_empty());
    ball.append(&moved(&ball, [0.5, 0.0, 0.0]));
    let r = MeshReport::of(&ball);
    assert!(r.self_intersections > 0 && slicing_defects(&ball) == r.defects() && overlaps(r.defects()));
    assert!(MeshReport::of_connectivity(&ball).defects().is_empty());
}

#[test]
fn turned_triangles_and_turned_solids_are_told_apart() {
    let mut ball = primitives::geodesic_sphere(5);
    ball.triangles[7].swap(0, 1);
    let r = MeshReport::of(&ball);
    assert_eq!(kinds(&r), [(DefectKind::Misoriented, 3)]);
    assert!(r.closed && !r.oriented && !r.inside_out);
    let mut ball = primitives::geodesic_sphere(5);
    ball.flip();
    let r = MeshReport::of(&ball);
    assert_eq!(kinds(&r), [(DefectKind::InsideOut, 1)]);
    assert!(r.inside_out && r.oriented && r.volume < 0.0);
    assert!(r.defects()[0].to_string().starts_with("the triangles face inward"));
}

#[test]
fn boxes_that_touch_in_a_vertex_or_an_edge_are_not_manifold() {
    let unit = primitives::aligned_box(DVec3::ZERO, DVec3::ONE);
    let mut corner = unit.clone();
    corner.append(&moved(&unit, [1.0, 1.0, 1.0]));
    let r = MeshReport::of(&corner);
    // they share a vertex after welding, so nothing cuts anything
    assert_eq!(kinds(&r), [(DefectKind::NonManifoldVertex, 1)]);
    assert_eq!((r.vertices, r.welded_vertices, r.components, r.closed), (16, 15, 1, true));
    assert_eq!(r.defects()[0].place, DVec3::ONE);
    let mut edge = unit.clone();
    edge.append(&moved(&unit, [1.0, 1.0, 0.0]));
    let r = MeshReport::of(&edge);
    assert_eq!((r.non_manifold_edges, r.boundary_edges, r.closed, r.manifold), (1, 0, false, false));
    assert_eq!(r.defects()[0].place, DVec3::new(1.0, 1.0, 0.5));
    assert_eq!(r.welded_vertices, 14);
}

#[test]
fn copies_and_flat_triangles_are_counted() {
    let mut mesh = primitives::aligned_box(DVec3::ZERO, DVec3::ONE);
    mesh.triangles.push([0, 0, 1]);
    let first = mesh.triangles[0];
    mesh.triangles.push([first[1], first[0], first[2]]);
    mesh.positions.push(DVec3::splat(0.5));
    let r = MeshReport::of(&mesh);
    assert_eq!((r.degenerate_triangles, r.duplicate_triangles, r.unreferenced_vertices), (1, 1, 1));
    assert_eq!(r.self_intersections, 2, "a copy lies in its original");
    assert_eq!(r.welded_vertices, 8);
    let line = TriMesh {
        positions: vec![DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, 4.0, 6.0)],
        triangles: vec![[0, 1, 2]],
    };
    assert_eq!(MeshReport::of(&line).degenerate_triangles, 1);
}

#[test]
fn positions_that_are_not_finite_are_counted_and_nothing_panics() {
    let mut ball = primitives::geodesic_sphere(3);
    ball.positions[5].y = f64::NAN;
    ball.positions[9].z = f64::INFINITY;
    let r = MeshReport::of(&ball);
    assert_eq!(r.non_finite_vertices, 2);
    assert!(r.defects().iter().any(|d| d.kind == DefectKind::NonFinite && d.count == 2));
}

#[test]
fn solids_that_overlap_cut_each_other_where_their_surfaces_cross() {
    let one = primitives::aligned_box(DVec3::ZERO, DVec3::splat(4.0));
    // a needle through two opposite sides, away from edges and diagonals: its 8 long triangles and 4 of the box's 12... or
    // fewer, as each side is two triangles and the needle crosses one of them
    let mut cut = one.clone();
    cut.append(&primitives::aligned_box(DVec3::new(1.0, 2.5, -1.0), DVec3::new(1.1, 2.6, 5.0)));
    let r = MeshReport::of(&cut);
    assert_eq!((r.self_intersections, r.closed, r.components), (8 + 2, true, 2));
    // inside one another without touching: nothing cuts
    let mut nested = one.clone();
    nested.append(&primitives::aligned_box(DVec3::ONE, DVec3::splat(2.0)));
    assert_eq!(MeshReport::of(&nested).self_intersections, 0);
    // touching from outside in a common part of a side, without common vertices
    let mut stacked = one.clone();
    stacked.append(&primitives::aligned_box(DVec3::new(1.0, 1.25, 4.0), DVec3::new(2.0, 2.0, 5.0)));
    assert!(MeshReport::of(&stacked).self_intersections >= 4);
}

#[test]
fn the_welded_mesh_keeps_order_and_triangles() {
    let p = [DVec3::X, DVec3::ZERO, DVec3::X, DVec3::new(0.0, -0.0, 0.0), DVec3::Y];
    let mesh = TriMesh { positions: p.to_vec(), triangles: vec![[0, 1, 4], [2, 3, 4], [1, 3, 0]] };
    let w = mesh.welded();
    assert_eq!(w.positions, [DVec3::X, DVec3::ZERO, DVec3::Y]);
    assert_eq!(w.triangles, [[0, 1, 2], [0, 1, 2], [1, 1, 0]]);
    let ball = primitives::geodesic_sphere(4);
    assert_eq!(ball.welded(), ball);
}

struct Fact {
    file: &'static str,
    vertices: usize,
    welded: usize,
    triangles: usize,
    watertight: bool,
    euler: i64,
    components: usize,
    boundary: usize,
    non_manifold: usize,
    intersecting: usize,
    /// To four digits, as the README has it.
    volume: f64,
    size: [f64; 3],
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn real_meshes_are_what_their_readme_says() {
    let facts = readme_facts();
    assert_eq!(facts.len(), 12);
    for f in facts {
        let path = std::path::Path::new("../shared/data/meshes").join(f.file);
        let stored = voxclay::io::read_surface_as_stored(&path).expect(f.file);
        let r = MeshReport::of(&stored);
        assert_eq!((r.vertices, r.welded_vertices, r.triangles), (f.vertices, f.welded, f.triangles), "{}", f.file);
        assert_eq!((r.closed, r.euler, r.components), (f.watertight, f.euler, f.components), "{}", f.file);
        assert_eq!((r.boundary_edges, r.non_manifold_edges), (f.boundary, f.non_manifold), "{}", f.file);
        assert_eq!(r.self_intersections, f.intersecting, "{}", f.file);
        assert!((r.volume / f.volume - 1.0).abs() < 7e-4, "{}: volume {}", f.file, r.volume);
        let (lo, hi) = r.bounds.expect("not empty");
        for (a, b) in (hi - lo).to_array().iter().zip(f.size) {
            assert!((a / b - 1.0).abs() < 7e-4, "{}: size {}", f.file, hi - lo);
        }
        assert_eq!(r.is_clean_solid(), f.watertight && f.intersecting == 0, "{}: {:?}", f.file, r.defects());
        assert_eq!(r.defects().is_empty(), r.is_clean_solid());
    }
}

#[rustfmt::skip]
fn readme_facts() -> Vec<Fact> {
    let clean = |file, vertices, triangles, euler, components, volume, size| Fact {
        file, vertices, welded: vertices, triangles, watertight: true, euler, components, boundary: 0, non_manifold: 0,
        intersecting: 0, volume, size,
    };
    vec![
        clean("spot.obj", 2930, 5856, 2, 1, 0.7183, [0.9431, 1.69, 1.718]),
        clean("bunny.obj", 14290, 28576, 2, 1, 1.598, [1.999, 1.973, 1.546]),
        Fact { intersecting: 4, ..clean("armadillo.obj", 12602, 25200, 2, 1, 237.8, [12.7, 15.13, 11.54]) },
        Fact { welded: 4350, ..clean("torus.stl", 26100, 8700, 0, 1, 4.918, [2.999, 2.999, 0.998]) },
        clean("three_holes.obj", 1987, 3982, -4, 1, 0.09613, [0.9955, 0.4631, 0.3327]),
        clean("fixed_top.ply", 2374, 4772, -12, 1, 2.645e4, [120.0, 10.0, 120.0]),
        clean("two_balls.obj", 1284, 2560, 4, 2, 8.305, [4.0, 2.0, 2.0]),
        clean("pelvis_f.obj", 4884, 9768, 0, 1, 0.2308, [1.222, 1.454, 1.993]),
        Fact {
            welded: 8146, watertight: false, boundary: 123, non_manifold: 150, intersecting: 170,
            ..clean("dirty_bunny_open.ply", 8171, 16301, 84, 1, 0.0007689, [0.1555, 0.1533, 0.1206])
        },
        Fact { intersecting: 147, ..clean("dirty_two_spheres.obj", 1060, 2112, 4, 2, 1.026, [1.51, 0.9941, 0.9941]) },
        Fact {
            welded: 146, watertight: false, boundary: 9,
            ..clean("dirty_sphere_with_hole.stl", 855, 285, -1, 1, 13.6, [3.0, 3.0, 3.0])
        },
        Fact {
            watertight: false, non_manifold: 64, intersecting: 2767,
            ..clean("dirty_brain_mni152.obj", 4553, 9064, 85, 4, 1.034e6, [138.0, 172.4, 131.4])
        },
    ]
}

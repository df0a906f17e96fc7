//! Deformations as tetrahedral meshes: the error of the interpolated backward map, and where the mesh is fine.

use glam::{DAffine3, DMat3, DVec3};
use voxclay::deform::{Deformation, Deformer, DisplacementVolume, Extent, Stack};
use voxclay::math::{BackwardMap, Identity, OrientedBox};
use voxclay::mesh::tet_faces::TetFaces;
use voxclay::mesh::tet_map::{MapError, MapOptions, MapReport, from_backward_map, uniform_from_backward_map};
use voxclay::mesh::tet_quality::TetQuality;
use voxclay::mesh::tets::TetMesh;

/// A volume of 64^3 voxels of unit size.
fn region() -> DAffine3 {
    DAffine3::from_scale(DVec3::splat(63.0))
}

fn stroke(point: DVec3, vector: DVec3, radius: f64) -> Deformation {
    let d = DisplacementVolume::from_drag(point, vector, radius).unwrap();
    Deformation::new("stroke", Deformer::Displacement(d))
}

fn one_stroke() -> Stack {
    Stack { items: vec![stroke(DVec3::new(22.0, 30.0, 35.0), DVec3::new(3.0, 1.0, -2.0), 12.0)] }
}

fn three_strokes() -> Stack {
    let mut stack = one_stroke();
    stack.items.push(stroke(DVec3::new(26.0, 33.0, 30.0), DVec3::new(-1.0, 2.0, 2.0), 9.0));
    stack.items.push(stroke(DVec3::new(50.0, 12.0, 12.0), DVec3::new(0.0, 0.0, 2.0), 7.0));
    stack
}

/// What must hold of every mesh made from a map.
fn check(mesh: &TetMesh, report: &MapReport, map: &dyn BackwardMap, region: &DAffine3) {
    let deformed = mesh.vectors("deformed").unwrap();
    assert_eq!((deformed.len(), mesh.points.len()), (report.points, report.points));
    assert_eq!(mesh.tets.len(), report.tets);
    for (rest, p) in mesh.points.iter().zip(deformed) {
        assert_eq!(*rest, map.backward(*p));
    }
    let there = TetMesh::new(deformed.to_vec(), mesh.tets.clone());
    let quality = TetQuality::of(&there);
    let volume = region.matrix3.determinant().abs();
    assert!(quality.inverted == 0 && quality.conforming && quality.manifold, "{quality:?}");
    assert!((quality.volume - volume).abs() < 1e-12 * volume, "{} of {volume}", quality.volume);
    // faces without a partner all lie in the sides of the region
    let unit: Vec<DVec3> = deformed.iter().map(|p| region.inverse().transform_point3(*p)).collect();
    for f in &TetFaces::of(&mesh.tets).boundary {
        let p = f.map(|v| unit[v as usize]);
        let on = |a: usize, x: f64| p.iter().all(|q| (q[a] - x).abs() < 1e-9);
        assert!((0..3).any(|a| on(a, 0.0) || on(a, 1.0)), "a crack at {p:?}");
    }
    let folded = (0..mesh.tets.len()).filter(|&t| !(mesh.tet_volume(t) > 0.0)).count();
    assert_eq!(report.inverted, folded);
}

/// The largest error on points that have nothing to do with those of the library.
fn error_of(mesh: &TetMesh, map: &dyn BackwardMap) -> f64 {
    let deformed = mesh.vectors("deformed").unwrap();
    let mut seed = 12345u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as f64 / (1u64 << 31) as f64
    };
    let mut largest: f64 = 0.0;
    for t in &mesh.tets {
        for _ in 0..4 {
            let mut w = [random(), random(), random(), random()];
            let sum: f64 = w.iter().sum();
            w.iter_mut().for_each(|x| *x /= sum);
            let mix = |p: &[DVec3]| (0..4).map(|c| p[t[c] as usize] * w[c]).sum::<DVec3>();
            largest = largest.max(map.backward(mix(deformed)).distance(mix(&mesh.points)));
        }
    }
    largest
}

#[test]
fn halving_a_uniform_lattice_takes_the_error_to_a_quarter() {
    let large = stroke(DVec3::new(30.0, 32.0, 34.0), DVec3::new(4.0, 1.0, -2.0), 28.0);
    let map = Stack { items: vec![large] }.prepared();
    let at = |level| {
        let made = uniform_from_backward_map(&map, &region(), [8; 3], level, &MapOptions::default()).unwrap();
        check(&made.0, &made.1, &map, &region());
        assert_eq!((made.1.tets, made.1.levels), ((6 * 512) << (3 * level), 3 * level));
        made.1
    };
    let reports = [0, 1, 2].map(at);
    for pair in reports.windows(2) {
        for (coarse, fine) in [(pair[0].max_error, pair[1].max_error), (pair[0].mean_error, pair[1].mean_error)] {
            let ratio = coarse / fine;
            assert!((3.0..5.2).contains(&ratio), "{coarse} to {fine}");
        }
    }
    assert!(reports[2].mean_error < reports[2].max_error && reports[2].samples > 1000);
}

#[test]
fn refinement_reaches_the_tolerance_with_far_fewer_tetrahedra_than_halving_all() {
    for stack in [one_stroke(), three_strokes()] {
        let map = stack.prepared();
        let mut counts = Vec::new();
        for tolerance in [0.4, 0.1, 0.03] {
            let options = MapOptions { tolerance, ..MapOptions::default() };
            let (mesh, report) = from_backward_map(&map, &region(), &options).unwrap();
            check(&mesh, &report, &map, &region());
            assert!(report.converged && report.max_error <= tolerance && report.inverted == 0, "{report:?}");
            let other = error_of(&mesh, &map);
            assert!(other <= 1.05 * tolerance && other > 0.2 * tolerance, "{other} for {tolerance}");
            assert!(report.max_error > 0.5 * other && report.mean_error < report.max_error);
            assert!(map.backward(report.max_at).distance(report.max_at) > 0.0);
            counts.push(report.tets);
        }
        // the count grows like the inverse of the tolerance to the power 1.5
        assert!(counts[0] < counts[1] && counts[1] < counts[2] && counts[2] < 20 * counts[1], "{counts:?}");
        let mut uniform = 0;
        for cells in (8..).step_by(4) {
            let options = MapOptions { tolerance: 0.1, ..MapOptions::default() };
            let (_, report) = uniform_from_backward_map(&map, &region(), [cells; 3], 0, &options).unwrap();
            uniform = report.tets;
            if report.converged {
                break;
            }
        }
        assert!(counts[1] * 3 < uniform, "{} against {uniform}", counts[1]);
    }
}

#[test]
fn tolerances_in_voxels_are_those_of_the_grid() {
    let map = one_stroke().prepared();
    // voxels of a quarter by half by one unit
    let metric = DMat3::from_diagonal(DVec3::new(4.0, 2.0, 1.0));
    let voxels = MapOptions { tolerance: 0.4, metric, ..MapOptions::default() };
    let (mesh, report) = from_backward_map(&map, &region(), &voxels).unwrap();
    check(&mesh, &report, &map, &region());
    let world = MapOptions { tolerance: 0.4, ..MapOptions::default() };
    let (_, coarser) = from_backward_map(&map, &region(), &world).unwrap();
    assert!(report.converged && report.tets > 2 * coarser.tets, "{} {}", report.tets, coarser.tets);
    assert!(error_of(&mesh, &map) < 0.25, "0.4 voxels along y are 0.2 units, along x 0.1");
}

#[test]
fn small_strokes_in_large_tetrahedra_are_not_missed() {
    // a hundredth of the region across, between all points of the first lattice
    let stack = Stack { items: vec![stroke(DVec3::new(13.7, 41.3, 27.9), DVec3::new(0.1, 0.0, 0.05), 0.4)] };
    let map = stack.prepared();
    let options = MapOptions { tolerance: 0.005, start_tets: 6, ..MapOptions::default() };
    let (mesh, report) = from_backward_map(&map, &region(), &options).unwrap();
    check(&mesh, &report, &map, &region());
    assert!(report.converged && report.levels > 15 && report.tets < 60_000, "{report:?}");
    assert!(error_of(&mesh, &map) <= 0.0055);
    assert!(mesh.points.iter().zip(mesh.vectors("deformed").unwrap()).any(|(q, p)| p.distance(*q) > 0.05));
}

#[test]
fn skewed_and_mirrored_regions_are_as_good() {
    let m = DMat3::from_cols(DVec3::new(60.0, 5.0, 0.0), DVec3::new(-4.0, 55.0, 6.0), DVec3::new(3.0, -2.0, -50.0));
    let region = DAffine3::from_mat3_translation(m, DVec3::new(2.0, 1.0, 60.0));
    assert!(m.determinant() < 0.0);
    let map = three_strokes().prepared();
    let (mesh, report) = from_backward_map(&map, &region, &MapOptions::default()).unwrap();
    check(&mesh, &report, &map, &region);
    assert!(report.converged, "{report:?}");
    let (mesh, report) = uniform_from_backward_map(&map, &region, [3, 2, 1], 1, &MapOptions::default()).unwrap();
    check(&mesh, &report, &map, &region);
}

#[test]
fn where_nothing_is_deformed_the_first_lattice_is_enough() {
    for map in [&Identity as &dyn BackwardMap, &Stack::default().prepared()] {
        let options = MapOptions { tolerance: 1e-9, start_tets: 6, ..MapOptions::default() };
        let (mesh, report) = from_backward_map(map, &region(), &options).unwrap();
        check(&mesh, &report, map, &region());
        assert_eq!((report.tets, report.levels, report.max_error, report.converged), (6, 0, 0.0, true));
        assert_eq!(mesh.points, mesh.vectors("deformed").unwrap());
    }
}

#[test]
fn limits_are_kept_and_said() {
    let map = one_stroke().prepared();
    let few = MapOptions { tolerance: 0.01, most_tets: 3000, ..MapOptions::default() };
    let (mesh, report) = from_backward_map(&map, &region(), &few).unwrap();
    check(&mesh, &report, &map, &region());
    assert!(!report.converged && report.tets <= 3000 && report.tets > 2000, "{report:?}");
    assert!(report.max_error > 0.01 && error_of(&mesh, &map) < 1.6 * report.max_error);
    let shallow = MapOptions { tolerance: 0.01, most_levels: 6, ..MapOptions::default() };
    let (mesh, report) = from_backward_map(&map, &region(), &shallow).unwrap();
    check(&mesh, &report, &map, &region());
    assert!(!report.converged && report.levels == 6, "{report:?}");
}

#[test]
fn folds_are_counted() {
    // twice as long as the longest that does not fold
    let extent = Extent { u: 20.0, v: 20.0, length: 30.0 };
    let d = DisplacementVolume::new(DVec3::splat(30.0), DVec3::X * 10.0, extent, None).unwrap();
    assert!(d.steepness() > 1.9);
    let map = Stack { items: vec![Deformation::new("", Deformer::Displacement(d))] }.prepared();
    let (mesh, report) = from_backward_map(&map, &region(), &MapOptions::default()).unwrap();
    check(&mesh, &report, &map, &region());
    assert!(report.converged && report.inverted > 10, "{report:?}");
}

/// Not a number in one half.
struct Broken;

impl BackwardMap for Broken {
    fn backward(&self, p: DVec3) -> DVec3 {
        if p.x > 40.0 { DVec3::NAN } else { p }
    }

    fn backward_with_jacobian(&self, p: DVec3) -> (DVec3, DMat3) {
        (self.backward(p), DMat3::IDENTITY)
    }

    fn supports(&self) -> Vec<OrientedBox> {
        vec![OrientedBox { center: DVec3::splat(32.0), axes: DMat3::IDENTITY, half: DVec3::splat(32.0) }]
    }
}

#[test]
fn what_cannot_be_made_is_refused_with_a_sentence() {
    let map = one_stroke().prepared();
    let by = |options: MapOptions| from_backward_map(&map, &region(), &options).unwrap_err().to_string();
    let base = MapOptions::default();
    let cases = [
        (by(MapOptions { tolerance: 0.0, ..base }), "tolerance of 0"),
        (by(MapOptions { tolerance: f64::NAN, ..base }), "tolerance of NaN"),
        (by(MapOptions { metric: DMat3::ZERO, ..base }), "singular"),
        (by(MapOptions { feature: Some(-1.0), ..base }), "feature size of -1"),
        (by(MapOptions { start_tets: 0, ..base }), "ask for at least 1"),
        (by(MapOptions { start_tets: usize::MAX, ..base }), "at most"),
        (by(MapOptions { most_tets: 100, ..base }), "at most 100 tetrahedra are allowed, but the lattice has 384"),
        (by(MapOptions { most_levels: 61, ..base }), "at most 60"),
    ];
    for (error, words) in cases {
        assert!(error.contains(words), "{error}");
    }
    let flat = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0));
    assert!(from_backward_map(&map, &flat, &base).is_err());
    let deep = uniform_from_backward_map(&map, &region(), [4; 3], 40, &base).unwrap_err();
    assert!(deep.to_string().contains("at most"), "{deep}");
    let broken = from_backward_map(&Broken, &region(), &base).unwrap_err();
    assert!(matches!(broken, MapError::NotFinite { at } if at.x > 40.0), "{broken}");
}

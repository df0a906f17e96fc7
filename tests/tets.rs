//! Tetrahedral meshes: lattices of boxes, and meshes of the inside of a surface.

use glam::{DAffine3, DMat3, DVec3};
use voxclay::mesh::TriMesh;
use voxclay::mesh::locate::Locator;
use voxclay::mesh::primitives;
use voxclay::mesh::stuffing::{Fineness, StuffingError, StuffingOptions, StuffingReport, stuff};
use voxclay::mesh::tet_faces::{TetFaces, boundary};
use voxclay::mesh::tet_lattice::{Split, TetLatticeError, cells_for, sample_extent, tet_lattice};
use voxclay::mesh::tet_quality::TetQuality;
use voxclay::mesh::tets::TetMesh;

/// Sheared, turned and of three lengths.
fn skewed() -> DAffine3 {
    let m = DMat3::from_cols(DVec3::new(3.0, 0.5, 0.1), DVec3::new(-0.4, 2.0, 0.3), DVec3::new(0.2, 0.7, 5.0));
    DAffine3::from_mat3_translation(m, DVec3::new(10.0, -20.0, 30.0))
}

fn mirrored() -> DAffine3 {
    DAffine3::from_scale(DVec3::new(-1.0, 2.0, 3.0))
}

#[test]
fn lattices_fill_their_region_and_meet_face_to_face() {
    for region in [DAffine3::IDENTITY, skewed(), mirrored()] {
        for cells in [[1, 1, 1], [2, 1, 3], [4, 5, 3]] {
            for (split, each) in [(Split::Five, 5), (Split::Six, 6)] {
                let mesh = tet_lattice(&region, cells, split).unwrap();
                let [nx, ny, nz] = cells;
                assert_eq!(mesh.tets.len(), nx * ny * nz * each);
                assert_eq!(mesh.points.len(), (nx + 1) * (ny + 1) * (nz + 1));
                let quality = TetQuality::of(&mesh);
                let volume = region.matrix3.determinant().abs();
                assert!((quality.volume - volume).abs() < 1e-12 * volume, "{} of {volume}", quality.volume);
                assert!(quality.inverted == 0 && quality.conforming && quality.manifold, "{quality:?}");
                // a hanging point would show as faces within
                let faces = TetFaces::of(&mesh.tets);
                let outer = 4 * (nx * ny + ny * nz + nz * nx);
                assert_eq!(faces.boundary.len(), outer);
                assert_eq!(faces.shared, (4 * mesh.tets.len() - outer) / 2);
                assert!((boundary(&mesh).volume() - volume).abs() < 1e-12 * volume);
                // the corners are those of the region
                for c in 0..8 {
                    let corner = DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64);
                    assert!(mesh.points.contains(&region.transform_point3(corner)));
                }
            }
        }
    }
}

#[test]
fn cubes_of_five_hold_a_regular_tetrahedron_and_those_of_six_are_congruent() {
    let five = TetQuality::of(&tet_lattice(&DAffine3::IDENTITY, [2, 2, 2], Split::Five).unwrap());
    assert!((five.dihedral[0] - (1.0 / 3f64.sqrt()).acos().to_degrees()).abs() < 1e-10, "{five:?}");
    assert!((five.dihedral[1] - 90.0).abs() < 1e-10);
    let six = TetQuality::of(&tet_lattice(&DAffine3::IDENTITY, [2, 2, 2], Split::Six).unwrap());
    assert!((six.dihedral[0] - 45.0).abs() < 1e-10 && (six.dihedral[1] - 90.0).abs() < 1e-10, "{six:?}");
    assert!((six.least_radius_ratio - six.mean_radius_ratio).abs() < 1e-12);
}

#[test]
fn the_wanted_number_is_met_with_boxes_as_cubic_as_can_be() {
    let long = DAffine3::from_scale(DVec3::new(400.0, 100.0, 90.0));
    for region in [DAffine3::IDENTITY, long, skewed()] {
        for wanted in [1, 5, 48, 700, 20_000, 1_000_000] {
            for split in [Split::Five, Split::Six] {
                let cells = cells_for(&region, wanted, split).unwrap();
                let count = cells.iter().product::<usize>() * split.tets_per_box();
                let ratio = count as f64 / wanted as f64;
                let m = region.matrix3;
                let edges = [m.x_axis, m.y_axis, m.z_axis].map(|e| e.length());
                let edges: Vec<f64> = edges.iter().zip(cells).map(|(l, n)| l / n as f64).collect();
                let shape = edges.iter().copied().fold(0.0, f64::max) / edges.iter().copied().fold(f64::MAX, f64::min);
                if wanted >= 700 {
                    assert!((0.75..1.33).contains(&ratio) && shape < 1.6, "{cells:?} for {wanted}: {ratio} {shape}");
                }
                if wanted >= 20_000 {
                    assert!((0.93..1.08).contains(&ratio) && shape < 1.15, "{cells:?} for {wanted}: {ratio} {shape}");
                }
            }
        }
    }
    assert_eq!(cells_for(&DAffine3::IDENTITY, 1, Split::Six), Ok([1, 1, 1]));
    assert_eq!(cells_for(&DAffine3::IDENTITY, 6 * 64, Split::Six), Ok([4, 4, 4]));
}

#[test]
fn the_extent_of_the_samples_goes_from_the_first_to_the_last() {
    let frame = DAffine3::from_scale_rotation_translation(
        DVec3::new(0.5, 1.0, 2.0),
        glam::DQuat::from_rotation_y(0.4),
        DVec3::new(7.0, 8.0, 9.0),
    );
    let dims = [65, 48, 2];
    let region = sample_extent(dims, &frame).unwrap();
    let mesh = tet_lattice(&region, [3, 4, 1], Split::Five).unwrap();
    let back = frame.inverse();
    let voxels: Vec<DVec3> = mesh.points.iter().map(|p| back.transform_point3(*p)).collect();
    let (lo, hi) = voxclay::mesh::tets::bounds(&voxels).unwrap();
    assert!(lo.abs().max_element() < 1e-12 && hi.distance(DVec3::new(64.0, 47.0, 1.0)) < 1e-12, "{lo} {hi}");
    assert_eq!(sample_extent([65, 1, 4], &frame), Err(TetLatticeError::Flat(65, 1, 4)));
}

#[test]
fn impossible_lattices_are_refused_with_a_sentence() {
    let unit = DAffine3::IDENTITY;
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let cases = [
        (tet_lattice(&unit, [0, 1, 1], Split::Six).unwrap_err(), "0x1x1 boxes is empty"),
        (tet_lattice(&unit, [usize::MAX; 3], Split::Six).unwrap_err(), "at most"),
        (tet_lattice(&unit, [4000, 4000, 4000], Split::Five).unwrap_err(), "320000000000 tetrahedra; at most"),
        (tet_lattice(&flat, [1, 1, 1], Split::Five).unwrap_err(), "lies in one plane"),
        (cells_for(&unit, 0, Split::Six).unwrap_err(), "ask for at least 1"),
        (cells_for(&unit, usize::MAX, Split::Six).unwrap_err(), "at most"),
        (cells_for(&DAffine3::from_scale(DVec3::NAN), 5, Split::Six).unwrap_err(), "not finite"),
    ];
    for (error, words) in cases {
        assert!(error.to_string().contains(words), "{error}");
    }
}

#[test]
fn what_is_wrong_with_a_mesh_shows_in_its_quality() {
    let none = TetQuality::of(&TetMesh::default());
    assert_eq!((none.tets, none.inverted, none.dihedral, none.conforming), (0, 0, [0.0; 2], true));
    assert!(!none.manifold, "nothing is no solid");
    let mut mesh = tet_lattice(&DAffine3::IDENTITY, [2, 2, 2], Split::Six).unwrap();
    mesh.tets[7].swap(0, 1);
    let turned = TetQuality::of(&mesh);
    assert!(turned.inverted == 1 && !turned.conforming, "{turned:?}");
    mesh.tets[7].swap(0, 1);
    mesh.tets.push(mesh.tets[3]);
    assert!(!TetQuality::of(&mesh).conforming);
    // two tetrahedra that touch at an edge
    let p = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, -DVec3::Y, -DVec3::Z];
    let touching = TetMesh::new(p.to_vec(), vec![[0, 1, 2, 3], [0, 1, 4, 5]]);
    let quality = TetQuality::of(&touching);
    assert!(quality.inverted == 0 && quality.conforming && !quality.manifold, "{quality:?}");
}

fn options(fineness: Fineness, enclose: bool) -> StuffingOptions {
    StuffingOptions { fineness, enclose }
}

/// Shapes with bumps, a hole, a cavity, sharp edges, and two parts.
fn bodies() -> Vec<(&'static str, TriMesh)> {
    let turn = DAffine3::from_rotation_x(0.3) * DAffine3::from_rotation_z(0.7);
    let mut two = primitives::geodesic_sphere(6);
    two.append(&two.transformed(&DAffine3::from_translation(DVec3::new(2.5, 0.3, -0.2))));
    vec![
        ("ball", primitives::geodesic_sphere(12)),
        ("bumps", primitives::bumpy_sphere(20)),
        ("ring", primitives::torus(1.0, 0.4, 48, 24)),
        ("cavity", primitives::cavity_sphere(8)),
        ("two balls", two),
        ("box", primitives::aligned_box(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.5))),
        ("turned box", primitives::aligned_box(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.5)).transformed(&turn)),
    ]
}

#[test]
fn stuffed_meshes_keep_the_angles_of_the_paper() {
    for (name, surface) in bodies() {
        // the coarse ones cut the surface in every way there is
        for spacing in [0.9, 0.61, 0.43, 0.3, 0.17, 0.101] {
            let made = stuff(&surface, &options(Fineness::Spacing(spacing), false));
            let (mesh, report) = match made {
                Err(StuffingError::TooCoarse(_)) if spacing > 0.4 => continue,
                made => made.unwrap(),
            };
            let q = report.quality;
            assert!(q.inverted == 0 && q.conforming, "{name} at {spacing}: {q:?}");
            assert!(q.dihedral[0] >= 10.78 - 0.01 && q.dihedral[1] <= 164.75, "{name} at {spacing}: {:?}", q.dihedral);
            assert_eq!((q.tets, q.points), (mesh.tets.len(), mesh.points.len()));
            let used = mesh.tets.iter().flatten().collect::<std::collections::HashSet<_>>().len();
            assert_eq!(used, mesh.points.len(), "{name} at {spacing}: points that no tetrahedron uses");
        }
    }
}

#[test]
fn stuffed_meshes_follow_smooth_surfaces_in_second_order() {
    let ball = primitives::geodesic_sphere(60);
    let at = |spacing: f64| stuff(&ball, &options(Fineness::Spacing(spacing), false)).unwrap().1;
    let reports: Vec<StuffingReport> = [0.4, 0.2, 0.1].map(at).to_vec();
    // two halvings; the surface itself is flat between its vertices, by less than 0.0003
    let ratio = reports[0].deviation / reports[2].deviation;
    assert!((9.0..30.0).contains(&ratio), "{} to {}", reports[0].deviation, reports[2].deviation);
    let fine = reports[2];
    assert!(fine.quality.manifold && fine.deviation < 0.005 && fine.farthest_outside < 0.005, "{fine:?}");
    assert!((fine.quality.volume - ball.volume()).abs() < 0.01 * ball.volume(), "{}", fine.quality.volume);
    assert!(fine.samples_inside > 0.99, "{fine:?}");
}

#[test]
fn enclosing_meshes_contain_everything() {
    for (name, surface) in bodies() {
        for spacing in [3.0, 0.5, 0.25, 0.2] {
            let (mesh, report) = stuff(&surface, &options(Fineness::Spacing(spacing), true)).unwrap();
            let q = report.quality;
            assert!(q.inverted == 0 && q.conforming, "{name} at {spacing}: {q:?}");
            assert!((q.dihedral[0] - 60.0).abs() < 1e-6 && (q.dihedral[1] - 90.0).abs() < 1e-6, "{:?}", q.dihedral);
            assert_eq!((report.vertices_inside, report.samples_inside), (1.0, 1.0), "{name} at {spacing}");
            assert_eq!(report.farthest_outside, 0.0);
            // no farther than a tetrahedron is long, where no gaps are filled
            if ["ball", "box", "turned box"].contains(&name) {
                assert!(report.deviation <= spacing * 1.0001, "{name} at {spacing}: {}", report.deviation);
            }
            // middles of edges and triangles are held, too
            let hull = boundary(&mesh);
            let hull = Locator::new(&hull);
            for t in &surface.triangles {
                let [a, b, c] = t.map(|v| surface.positions[v as usize]);
                assert!([(a + b) / 2.0, (a + b + c) / 3.0].iter().all(|p| hull.winding_number(*p) == 1), "{name}");
            }
        }
    }
}

#[test]
fn the_wanted_number_of_tetrahedra_is_met() {
    for (name, surface) in bodies() {
        for enclose in [false, true] {
            for wanted in [3000, 20_000] {
                let (mesh, report) = stuff(&surface, &options(Fineness::Tets(wanted), enclose)).unwrap();
                let ratio = mesh.tets.len() as f64 / wanted as f64;
                assert!(report.reached && (0.83..1.21).contains(&ratio), "{name} {wanted}: {}", mesh.tets.len());
            }
        }
    }
    // what cannot be met is said, not hidden
    let (mesh, report) = stuff(&primitives::geodesic_sphere(4), &options(Fineness::Tets(2), true)).unwrap();
    assert!(!report.reached && mesh.tets.len() > 4, "{}", mesh.tets.len());
}

#[test]
fn a_tolerance_is_kept_or_said_to_be_missed() {
    let ball = primitives::geodesic_sphere(20);
    for enclose in [false, true] {
        let tolerance = if enclose { 0.15 } else { 0.02 };
        let fineness = Fineness::Tolerance { distance: tolerance, most_tets: 200_000 };
        let (_, report) = stuff(&ball, &options(fineness, enclose)).unwrap();
        assert!(report.reached && report.deviation <= tolerance, "{report:?}");
        let fineness = Fineness::Tolerance { distance: 1e-5, most_tets: 3000 };
        let (mesh, report) = stuff(&ball, &options(fineness, enclose)).unwrap();
        assert!(!report.reached && report.deviation > 1e-5 && mesh.tets.len() <= 3000, "{report:?}");
    }
}

#[test]
fn surfaces_without_an_inside_are_refused_with_a_sentence() {
    let ball = primitives::geodesic_sphere(4);
    let mut open = ball.clone();
    open.triangles.pop();
    let mut turned = ball.clone();
    turned.triangles[0].reverse();
    let mut broken = ball.clone();
    broken.positions[3].x = f64::NAN;
    let flat = ball.transformed(&DAffine3::from_scale(DVec3::new(1.0, 1.0, 1e-14)));
    let by = |surface: &TriMesh, fineness| stuff(surface, &options(fineness, true)).unwrap_err().to_string();
    let spacing = Fineness::Spacing(0.5);
    let cases = [
        (by(&TriMesh::default(), spacing), "no triangles"),
        (by(&open, spacing), "one side only (holes)"),
        (by(&turned, spacing), "face opposite ways"),
        (by(&broken, spacing), "not finite"),
        (by(&flat, spacing), "encloses no volume"),
        (by(&ball, Fineness::Spacing(0.0)), "spacing of 0"),
        (by(&ball, Fineness::Spacing(f64::NAN)), "spacing of NaN"),
        (by(&ball, Fineness::Spacing(1e-9)), "cubes; at most"),
        (by(&ball, Fineness::Tets(0)), "0 tetrahedra are wanted; ask for 1 to"),
        (by(&ball, Fineness::Tets(usize::MAX)), "tetrahedra are wanted; ask for 1 to"),
        (by(&ball, Fineness::Tolerance { distance: -1.0, most_tets: 10 }), "tolerance of -1"),
        (by(&ball, Fineness::Tolerance { distance: 1.0, most_tets: 0 }), "0 tetrahedra are wanted"),
    ];
    for (error, words) in cases {
        assert!(error.contains(words), "{error}");
    }
    let coarse = stuff(&ball, &options(Fineness::Spacing(100.0), false)).unwrap_err();
    assert_eq!(coarse, StuffingError::TooCoarse(100.0));
    // turned inside out as a whole, it has the same inside
    let mut inward = ball.clone();
    inward.flip();
    let count = |m: &TriMesh| stuff(m, &options(Fineness::Spacing(0.3), true)).unwrap().0.tets.len();
    assert_eq!(count(&inward), count(&ball));
}

//! Tetrahedral meshes: the split of other cells, and the report.

use glam::DVec3;
use proptest::prelude::*;
use voxclay::mesh::cells::{CellError, CellKind, CellMesh};
use voxclay::mesh::tet_report::TetReport;
use voxclay::mesh::tets::{PointVectors, TetMesh};

const CUBE: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [0.0, 1.0, 1.0],
];

/// The 24 ways to number a hexahedron without turning it inside out.
fn rotations() -> Vec<[usize; 8]> {
    // about z, and about x
    let (about_z, about_x) = ([1, 2, 3, 0, 5, 6, 7, 4], [3, 2, 6, 7, 0, 1, 5, 4]);
    let mut all = vec![[0, 1, 2, 3, 4, 5, 6, 7]];
    let mut at = 0;
    while at < all.len() {
        let from = all[at];
        for turn in [about_z, about_x] {
            let next = turn.map(|i: usize| from[i]);
            if !all.contains(&next) {
                all.push(next);
            }
        }
        at += 1;
    }
    assert_eq!(all.len(), 24);
    all
}

/// `n`^3 hexahedra in a cube, each numbered in a way of its own, with `shape` for the place of each point.
fn lattice(n: usize, numbering: impl Fn(usize) -> usize, shape: impl Fn(DVec3) -> DVec3) -> CellMesh {
    let rotations = rotations();
    let at = |i: usize, j: usize, k: usize| (i + (n + 1) * (j + (n + 1) * k)) as u32;
    let mut mesh = CellMesh::default();
    for k in 0..=n {
        for j in 0..=n {
            mesh.points.extend((0..=n).map(|i| shape(DVec3::new(i as f64, j as f64, k as f64) / n as f64)));
        }
    }
    for cell in 0..n * n * n {
        let [i, j, k] = [cell % n, cell / n % n, cell / n / n];
        let corners = CUBE.map(|c| at(i + c[0] as usize, j + c[1] as usize, k + c[2] as usize));
        mesh.kinds.push(CellKind::Hexahedron);
        mesh.corners.extend(rotations[numbering(cell) % 24].map(|c| corners[c]));
    }
    mesh
}

#[test]
fn a_hexahedron_becomes_24_tetrahedra_around_its_centre() {
    let mesh = lattice(1, |_| 0, |p| p).into_tets(0).unwrap();
    assert_eq!((mesh.tets.len(), mesh.points.len()), (24, 8 + 6 + 1));
    assert!(mesh.points.contains(&DVec3::splat(0.5)));
    for axis in DVec3::AXES {
        for side in [0.0, 1.0] {
            assert!(mesh.points.contains(&((DVec3::ONE - axis) * 0.5 + axis * side)));
        }
    }
    assert!((0..24).all(|t| (mesh.tet_volume(t) - 1.0 / 24.0).abs() < 1e-15));
    // given points keep their numbers, and every numbering gives the same points
    for r in 0..24 {
        let other = lattice(1, |_| r, |p| p).into_tets(0).unwrap();
        assert_eq!(other.points[..8], mesh.points[..8]);
        let r = TetReport::of(&other);
        assert_eq!((r.inverted, r.boundary_faces, r.boundary_euler, r.non_conforming_faces), (0, 24, 2, 0));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    /// However cells number their corners, the tetrahedra of neighbours meet in whole faces.
    #[test]
    fn hexahedra_conform_in_any_numbering(numbering in proptest::collection::vec(0usize..24, 27), bend in -0.3f64..0.3) {
        let curved = |p: DVec3| p + bend * DVec3::new(p.y * p.z, p.x * p.z * p.z, p.x * p.y);
        let mesh = lattice(3, |c| numbering[c], curved).into_tets(0).unwrap();
        let r = TetReport::of(&mesh);
        prop_assert_eq!((r.tets, r.nodes), (27 * 24, 64 + 27 + 3 * 4 * 9));
        prop_assert_eq!((r.boundary_faces, r.boundary_euler, r.components, r.non_conforming_faces), (6 * 9 * 4, 2, 1, 0));
        prop_assert_eq!((r.inverted, r.unused_points), (0, 0));
        // the same positions, to the last bit, as from any other numbering
        let plain = lattice(3, |_| 0, curved).into_tets(0).unwrap();
        let sorted = |m: &TetMesh| {
            let mut p: Vec<[u64; 3]> = m.points.iter().map(|p| p.to_array().map(f64::to_bits)).collect();
            p.sort_unstable();
            p
        };
        prop_assert_eq!(sorted(&mesh), sorted(&plain));
    }
}

/// A pyramid and a wedge on two sides of a cube, and a tetrahedron on the pyramid.
fn mixed(wedge: [u32; 6]) -> CellMesh {
    let mut points: Vec<DVec3> = CUBE.map(DVec3::from_array).to_vec();
    points.extend([
        DVec3::new(0.5, 0.5, 2.0),
        DVec3::new(0.0, 2.0, 0.5),
        DVec3::new(1.0, 2.0, 0.5),
        DVec3::new(2.0, 0.3, 2.0),
    ]);
    CellMesh {
        points,
        kinds: vec![CellKind::Hexahedron, CellKind::Pyramid, CellKind::Wedge, CellKind::Tet],
        corners: [&[0, 1, 2, 3, 4, 5, 6, 7][..], &[4, 5, 6, 7, 8], &wedge, &[5, 11, 6, 8]].concat(),
        regions: vec![1, 2, 3, 4],
        vectors: vec![],
    }
}

#[test]
fn cells_of_all_kinds_conform_and_wedges_run_either_way() {
    // as Gmsh numbers the wedge, and as VTK does
    for wedge in [[3, 7, 9, 2, 6, 10], [3, 9, 7, 2, 10, 6]] {
        let mesh = mixed(wedge).into_tets(0).unwrap();
        let r = TetReport::of(&mesh);
        assert_eq!(
            (r.tets, r.inverted, r.non_conforming_faces, r.boundary_euler),
            (24 + 8 + 14 + 1, 0, 0, 2),
            "{wedge:?}"
        );
        // of 6 + 1 + 3 quadrilaterals two pairs are inside, and one pair of the 4 + 2 + 4 triangles
        assert_eq!(r.boundary_faces, 4 * (10 - 4) + 10 - 2);
        let tet = mesh.tet_volume(46);
        assert!((r.volume - (1.0 + 1.0 / 3.0 + 0.5 + tet)).abs() < 1e-14);
        let of = |region: i32| mesh.regions.iter().filter(|r| **r == region).count();
        assert_eq!([1, 2, 3, 4].map(of), [24, 8, 14, 1]);
        assert_eq!(*mesh.tets.last().unwrap(), [5, 11, 6, 8]);
    }
}

#[test]
fn what_is_turned_over_stays_turned_over() {
    // a mirrored hexahedron has 24 negative tetrahedra
    let mesh = lattice(1, |_| 5, |p| p * DVec3::new(-1.0, 1.0, 1.0)).into_tets(0).unwrap();
    assert_eq!(TetReport::of(&mesh).inverted, 24);
}

#[test]
fn only_hexahedra_can_be_refined_and_not_without_end() {
    assert_eq!(mixed([3, 7, 9, 2, 6, 10]).into_tets(1), Err(CellError::NotHexahedra));
    for levels in [9, 10, 11, 30, u32::MAX] {
        assert_eq!(lattice(2, |_| 0, |p| p).into_tets(levels), Err(CellError::TooMany));
    }
    let refined = lattice(2, |c| c, |p| p).into_tets(1).unwrap();
    let r = TetReport::of(&refined);
    assert_eq!((r.tets, r.nodes), (64 * 24, 125 + 64 + 3 * 5 * 16));
    assert_eq!((r.inverted, r.boundary_faces, r.non_conforming_faces, r.unused_points), (0, 6 * 16 * 4, 0, 0));
    assert!((r.volume - 1.0).abs() < 1e-13 && (r.size_ratio - 1.0).abs() < 1e-9);
}

/// The value at `p` of the piecewise linear map from the points to the vectors.
fn mapped(mesh: &TetMesh, p: DVec3) -> DVec3 {
    let values = &mesh.vectors[0].values;
    let weights = |t: [u32; 4]| {
        let [a, b, c, d] = TetMesh::corners(t, &mesh.points);
        let six = (b - a).cross(c - a).dot(d - a);
        let part = |x: DVec3, y: DVec3, z: DVec3| (x - p).cross(y - p).dot(z - p) / six;
        [part(b, c, d), part(a, d, c), part(a, b, d), part(a, c, b)]
    };
    let lowest = |t: [u32; 4]| weights(t).into_iter().fold(f64::INFINITY, f64::min);
    let best = mesh.tets.iter().max_by(|s, t| lowest(**s).total_cmp(&lowest(**t))).unwrap();
    assert!(lowest(*best) > -1e-9, "{p} is in no tetrahedron");
    weights(*best).iter().zip(best).map(|(w, v)| *w * values[*v as usize]).sum()
}

/// The piecewise linear map meets the trilinear one at corners, centres of faces and the centre, and comes nearer to it by a
/// factor of four with each level.
#[test]
fn the_split_converges_to_the_trilinear_map() {
    let moved: Vec<DVec3> = CUBE
        .iter()
        .enumerate()
        .map(|(i, c)| {
            DVec3::from_array(*c) + 0.3 * DVec3::new((i as f64).sin(), (2.0 * i as f64).cos(), (3.0 * i as f64).sin())
        })
        .collect();
    let trilinear = |p: DVec3| -> DVec3 {
        let weight = |c: &[f64; 3]| (0..3).map(|a| if c[a] > 0.0 { p[a] } else { 1.0 - p[a] }).product::<f64>();
        CUBE.iter().zip(&moved).map(|(c, m)| weight(c) * *m).sum()
    };
    let mut errors = Vec::new();
    for levels in 0..4 {
        let mut cell = CellMesh {
            points: CUBE.map(DVec3::from_array).to_vec(),
            kinds: vec![CellKind::Hexahedron],
            corners: (0..8).collect(),
            ..CellMesh::default()
        };
        cell.vectors.push(PointVectors { name: "deformed".into(), values: moved.clone() });
        let mesh = cell.into_tets(levels).unwrap();
        for (p, v) in mesh.points.iter().zip(&mesh.vectors[0].values) {
            assert!((trilinear(*p) - *v).length() < 1e-14, "level {levels}: {p}");
        }
        let sample = |i: usize| DVec3::new(0.819172513, 0.671043607, 0.549700478) * i as f64;
        let squares = (1..=500).map(|i| sample(i).fract()).map(|p| (mapped(&mesh, p) - trilinear(p)).length_squared());
        errors.push((squares.sum::<f64>() / 500.0).sqrt());
    }
    assert!(errors[0] > 0.01, "{errors:?}");
    for pair in errors.windows(2) {
        let rate = pair[0] / pair[1];
        assert!((3.7..4.3).contains(&rate), "{errors:?}");
    }
    assert!((58.0..70.0).contains(&(errors[0] / errors[3])), "{errors:?}");
}

#[test]
fn the_report_counts_what_is_wrong() {
    let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let points = vec![
        DVec3::ZERO,
        DVec3::X,
        DVec3::Y,
        DVec3::Z,
        p(1.0, 1.0, 1.0),
        p(0.0, 0.0, -2.0),
        p(5.0, 5.0, 5.0),
        p(0.5, 0.5, 0.0),
        // the same place as the first, but another point
        DVec3::ZERO,
        p(-1.0, 0.0, 0.0),
        p(0.0, -1.0, 0.0),
        p(0.0, 0.0, -1.0),
    ];
    let mesh = |tets: Vec<[u32; 4]>| TetReport::of(&TetMesh::new(points.clone(), tets));
    let one = mesh(vec![[0, 1, 2, 3]]);
    assert_eq!((one.nodes, one.tets, one.unused_points, one.components), (12, 1, 8, 1));
    assert_eq!((one.boundary_faces, one.boundary_euler, one.boundary_components), (4, 2, 1));
    assert_eq!((one.inverted, one.degenerate, one.volume, one.signed_volume), (0, 0, 1.0 / 6.0, 1.0 / 6.0));
    assert_eq!((one.size_ratio, one.regions), (1.0, 0));
    assert_eq!(one.bounds, Some((p(-1.0, -1.0, -2.0), p(5.0, 5.0, 5.0))));
    // turned over
    let turned = mesh(vec![[0, 2, 1, 3]]);
    assert_eq!((turned.inverted, turned.volume, turned.signed_volume), (1, 1.0 / 6.0, -1.0 / 6.0));
    // in one plane: exactly so
    let flat = mesh(vec![[0, 1, 2, 3], [0, 1, 2, 7]]);
    assert_eq!((flat.inverted, flat.degenerate, flat.size_ratio), (0, 1, f64::INFINITY));
    // two at a face, then three
    let two = mesh(vec![[0, 1, 2, 3], [0, 2, 1, 5]]);
    assert_eq!((two.boundary_faces, two.non_conforming_faces, two.inverted, two.size_ratio), (6, 0, 0, 2.0));
    let three = mesh(vec![[0, 1, 2, 3], [0, 2, 1, 5], [0, 1, 2, 4]]);
    assert_eq!((three.boundary_faces, three.non_conforming_faces), (9, 1));
    // joined in a point, then not: points are told apart by their numbers
    let joined = mesh(vec![[0, 1, 2, 3], [0, 9, 11, 10]]);
    assert_eq!((joined.components, joined.boundary_components, joined.boundary_euler), (1, 1, 3));
    let apart = mesh(vec![[0, 1, 2, 3], [8, 9, 11, 10]]);
    assert_eq!((apart.components, apart.boundary_components, apart.boundary_euler), (2, 2, 4));
    let none = TetReport::of(&TetMesh::default());
    assert_eq!((none.tets, none.volume, none.size_ratio, none.components, none.bounds), (0, 0.0, 1.0, 0, None));
    let regions = TetMesh { regions: vec![5, 5], ..TetMesh::new(points.clone(), vec![[0, 1, 2, 3], [0, 2, 1, 5]]) };
    assert_eq!(TetReport::of(&regions).regions, 1);
}

#[test]
fn a_cavity_is_a_second_part_of_the_boundary() {
    let mut cells = lattice(3, |c| 7 * c, |p| p);
    // without the cell in the middle
    cells.kinds.remove(13);
    cells.corners.drain(13 * 8..14 * 8);
    let r = TetReport::of(&cells.into_tets(0).unwrap());
    assert_eq!((r.components, r.boundary_components, r.boundary_euler, r.boundary_faces), (1, 2, 4, 60 * 4));
    assert!((r.volume - 26.0 / 27.0).abs() < 1e-14);
}

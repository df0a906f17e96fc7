//! Files of tetrahedral meshes, and VTK's volumes and surfaces: what is written comes back, what other programs wrote is
//! understood, damaged files are refused.
//!
//! The files in `tests/fixtures` were written by VTK 9.7 and Gmsh 4.15.

mod damage;
mod foreign;
mod images;
mod real;
mod round_trip;

use std::path::{Path, PathBuf};

use glam::DVec3;
use voxclay::io::{IoError, gmsh, medit, tetgen, vtk, vtu};
use voxclay::mesh::cells::CellMesh;
use voxclay::mesh::tet_report::TetReport;
use voxclay::mesh::tets::{PointVectors, TetMesh};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

fn fixture_bytes(name: &str) -> Vec<u8> {
    std::fs::read(fixture(name)).expect(name)
}

/// Reads a file of one of the formats from memory. TetGen's two files stand one behind the other, parted by a zero.
fn parse(name: &str, bytes: &[u8]) -> Result<CellMesh, IoError> {
    let path = Path::new(name);
    match path.extension().and_then(|e| e.to_str()) {
        Some("vtu") => vtu::parse(path, bytes),
        Some("vtk") => vtk::parse_cells(path, bytes),
        Some("msh") => gmsh::parse(path, bytes),
        Some("mesh" | "meshb") => medit::parse(path, bytes),
        _ => {
            let mut parts = bytes.splitn(2, |b| *b == 0);
            let (node, ele) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
            tetgen::parse([path, path], node, ele)
        }
    }
}

fn tets(name: &str, bytes: &[u8]) -> TetMesh {
    parse(name, bytes).unwrap_or_else(|e| panic!("{e}")).into_tets(0).expect("splits")
}

fn message(name: &str, bytes: &[u8]) -> String {
    let said = parse(name, bytes).expect_err("should be refused").to_string();
    assert!(said.starts_with(&format!("{name}: ")) && !said.contains('\n'), "{said}");
    said
}

/// Sound as a mesh: every index has its point, every coordinate is finite, every list has its length.
fn sound(mesh: CellMesh) {
    assert!(mesh.points.iter().all(|p| p.is_finite()) && !mesh.kinds.is_empty());
    assert!(mesh.cells().all(|(kind, cell)| {
        cell.len() == kind.corners() && cell.iter().all(|v| (*v as usize) < mesh.points.len())
    }));
    assert!(mesh.regions.is_empty() || mesh.regions.len() == mesh.kinds.len());
    assert!(mesh.vectors.iter().all(|v| v.values.len() == mesh.points.len()));
    TetReport::of(&mesh.into_tets(0).expect("splits"));
}

/// Five tetrahedra of a cube, one turned over, a point that none uses, numbers that are hard to write, regions and vectors.
fn sample() -> TetMesh {
    let points = vec![
        DVec3::ZERO,
        DVec3::new(1.0, -0.0, f64::MIN_POSITIVE),
        DVec3::new(1.0 / 3.0, 1.0, 1e-310),
        DVec3::Y,
        DVec3::new(0.1, 0.2, 1.0 + f64::EPSILON),
        DVec3::new(1.0, 0.0, 1.0),
        DVec3::ONE,
        DVec3::new(-1e-17, 1.0, std::f64::consts::PI / 3.0),
        DVec3::new(1e80, -7.0, 123456789.125),
    ];
    let tets = vec![[0, 1, 3, 4], [1, 2, 3, 6], [1, 6, 4, 5], [3, 6, 7, 4], [1, 4, 3, 6]];
    let moved = |f: fn(DVec3) -> DVec3| points.iter().map(|p| f(*p)).collect();
    TetMesh {
        vectors: vec![
            PointVectors { name: "deformed".into(), values: moved(|p| p * 1.1 + DVec3::new(0.0, 1.0 / 7.0, 0.0)) },
            PointVectors { name: "a <b> & 'ü' 100%".into(), values: moved(|p| p - DVec3::splat(0.3)) },
        ],
        points,
        tets,
        regions: vec![3, -2, 0, 2147483647, 3],
    }
}

/// All bits, so that -0 and NaN count.
fn bits(points: &[DVec3]) -> Vec<[u64; 3]> {
    points.iter().map(|p| p.to_array().map(f64::to_bits)).collect()
}

fn same_bits(a: &TetMesh, b: &TetMesh, what: &str) {
    assert_eq!(bits(&a.points), bits(&b.points), "points of {what}");
    assert_eq!((&a.tets, &a.regions), (&b.tets, &b.regions), "{what}");
    let names = |m: &TetMesh| m.vectors.iter().map(|v| v.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(a), names(b), "{what}");
    for (v, w) in a.vectors.iter().zip(&b.vectors) {
        assert_eq!(bits(&v.values), bits(&w.values), "'{}' of {what}", v.name);
    }
}

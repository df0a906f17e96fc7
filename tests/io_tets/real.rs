//! The real files, with the facts that other programs found in them.

use std::path::{Path, PathBuf};

use voxclay::io::{
    FileKind, TetWriteOptions, is_tets_path, keeps_vectors, kind_of, read_surface, read_tets, read_volume, write_tets,
};
use voxclay::mesh::check::MeshReport;
use voxclay::mesh::tet_report::TetReport;
use voxclay::mesh::tets::TetMesh;
use voxclay::volume::ScalarType;
use voxclay::volume::statistics::statistics;

use super::{parse, same_bits};

fn data(name: &str) -> PathBuf {
    Path::new("../shared/data").join(name)
}

struct Facts {
    file: &'static str,
    nodes: usize,
    tets: usize,
    inverted: usize,
    boundary: (usize, i64),
    volume: f64,
    size_ratio: f64,
    extent: [f64; 3],
}

const CUBE: Facts = Facts {
    file: "cube_mmg.mesh",
    nodes: 152,
    tets: 373,
    inverted: 0,
    boundary: (300, 2),
    volume: 1.0,
    size_ratio: 36.0,
    extent: [1.0; 3],
};

#[rustfmt::skip]
const FILES: [Facts; 11] = [
    Facts { file: "bunny_v41.msh", nodes: 4670, tets: 19379, inverted: 0, boundary: (6266, 2), volume: 6.01, size_ratio: 2.22e4, extent: [3.11, 3.079, 2.416] },
    Facts { file: "nested_cubes_v22.msh", nodes: 138, tets: 520, inverted: 0, boundary: (156, 2), volume: 1.0, size_ratio: 16.6, extent: [1.0; 3] },
    CUBE,
    Facts { file: "cube_mmg.msh", ..CUBE },
    Facts { file: "cube_mmg.vtk", ..CUBE },
    Facts { file: "cube_mmg.vtu", ..CUBE },
    Facts { file: "armadillo_4406.vtu", nodes: 1446, tets: 4406, inverted: 0, boundary: (2532, 1), volume: 231.2, size_ratio: 2.8e3, extent: [12.67, 15.1, 11.52] },
    Facts { file: "armadillo_4k.node", nodes: 1180, tets: 3717, inverted: 0, boundary: (2102, 2), volume: 1.86, size_ratio: 9.21e3, extent: [2.538, 3.029, 2.315] },
    Facts { file: "armadillo_4k.ele", nodes: 1180, tets: 3717, inverted: 0, boundary: (2102, 2), volume: 1.86, size_ratio: 9.21e3, extent: [2.538, 3.029, 2.315] },
    Facts { file: "sphere.mesh", nodes: 4505, tets: 24013, inverted: 0, boundary: (2880, 2), volume: 0.1004, size_ratio: 18.6, extent: [0.5774; 3] },
    Facts { file: "torus_binary.vtk", nodes: 6647, tets: 28625, inverted: 28625, boundary: (7938, 0), volume: 6.056, size_ratio: 427.0, extent: [3.9, 1.0, 3.0] },
];

/// Equal to as many digits as the fact was given with.
fn about(value: f64, fact: f64, what: &str) {
    assert!((value - fact).abs() <= 2.5e-3 * fact.abs(), "{what}: {value}, not {fact}");
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn every_mesh_has_its_facts() {
    let mut there: Vec<String> = std::fs::read_dir(data("tets"))
        .expect("there")
        .map(|e| e.expect("readable").file_name().to_string_lossy().into_owned())
        .collect();
    there.sort();
    let mut listed: Vec<&str> = FILES.iter().map(|f| f.file).collect();
    listed.sort_unstable();
    assert_eq!(there, listed);
    for f in FILES {
        let path = data("tets").join(f.file);
        assert!(is_tets_path(&path) && kind_of(&path).expect("readable") == Some(FileKind::Tets));
        let mesh = read_tets(&path).unwrap_or_else(|e| panic!("{e}"));
        let r = TetReport::of(&mesh);
        assert_eq!((r.nodes, r.tets, r.inverted), (f.nodes, f.tets, f.inverted), "{}", f.file);
        assert_eq!((r.boundary_faces, r.boundary_euler), f.boundary, "{}", f.file);
        assert_eq!((r.boundary_components, r.components), (1, 1), "{}", f.file);
        assert_eq!((r.degenerate, r.non_conforming_faces, r.unused_points), (0, 0, 0), "{}", f.file);
        about(r.volume, f.volume, f.file);
        about(r.signed_volume, if f.inverted > 0 { -f.volume } else { f.volume }, f.file);
        about(r.size_ratio, f.size_ratio, f.file);
        let (lo, hi) = r.bounds.expect("there are points");
        for axis in 0..3 {
            about((hi - lo)[axis], f.extent[axis], f.file);
        }
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn two_regions_and_vectors() {
    let nested = read_tets(&data("tets/nested_cubes_v22.msh")).expect("reads");
    assert_eq!(TetReport::of(&nested).regions, 2);
    // the inner cube has sides of a half
    for region in [1, 2] {
        let volume: f64 =
            (0..nested.tets.len()).filter(|t| nested.regions[*t] == region).map(|t| nested.tet_volume(t)).sum();
        about(volume, if (volume - 0.125).abs() < 0.1 { 0.125 } else { 0.875 }, "nested cubes");
    }
    let torus = read_tets(&data("tets/torus_binary.vtk")).expect("reads");
    assert_eq!(torus.vectors("ref").expect("there").len(), 6647);
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn the_same_cube_in_four_formats() {
    let read = |ending: &str| read_tets(&data(&format!("tets/cube_mmg.{ending}"))).expect("reads");
    let first = read("mesh");
    for ending in ["msh", "vtk", "vtu"] {
        let other = read(ending);
        assert_eq!((&other.tets, &other.regions), (&first.tets, &first.regions), "{ending}");
        for (p, q) in first.points.iter().zip(&other.points) {
            // two of them have 32-bit numbers
            assert_eq!(p.as_vec3(), q.as_vec3(), "{ending}");
            assert!((*p - *q).length() < 1e-14);
        }
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn real_meshes_go_through_every_format() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    for f in FILES {
        let mesh = read_tets(&data("tets").join(f.file)).expect("reads");
        for name in ["a.vtu", "a.vtk", "a.msh", "a.mesh", "a.node"] {
            let path = dir.path().join(name);
            let vectors = if keeps_vectors(&path) { mesh.vectors.clone() } else { vec![] };
            let mesh = TetMesh { vectors, ..mesh.clone() };
            write_tets(&path, &mesh, &TetWriteOptions::default()).expect("written");
            same_bits(&read_tets(&path).expect("reads"), &mesh, &format!("{} as {name}", f.file));
        }
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn real_meshes_cut_anywhere_are_refused() {
    for f in FILES.iter().filter(|f| !f.file.starts_with("armadillo_4k")) {
        let bytes = std::fs::read(data("tets").join(f.file)).expect("there");
        for i in 0..14 {
            let cut = &bytes[..bytes.len() * i / 15 + i];
            // what follows the elements, such as data or a surface, is no part of the mesh
            if let Ok(mesh) = parse(f.file, cut) {
                let tets = mesh.into_tets(0).expect("splits").tets.len();
                assert!(tets == f.tets && i > 5 && !f.file.ends_with("vtu"), "{} cut at {}", f.file, cut.len());
            }
        }
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn vtk_volumes_have_their_facts() {
    let heart = read_volume(&data("volumes/heart_ascii.vti")).expect("reads");
    assert_eq!(read_volume(&data("volumes/heart_ascii.vtk")).expect("reads"), heart);
    assert_eq!((heart.grid.dims, heart.samples.scalar_type()), ([32, 32, 12], ScalarType::F32));
    assert_eq!(heart.grid.spacing().to_array(), [1.0, 1.0, 4.0]);
    let s = statistics(&heart);
    assert_eq!((s.min, s.max), (0.0, 255.0));
    about(s.mean, 67.73, "heart");
    let aneurism = read_volume(&data("volumes/aneurism.vti")).expect("reads");
    assert_eq!((aneurism.grid.dims, aneurism.samples.scalar_type()), ([256; 3], ScalarType::U8));
    let s = statistics(&aneurism);
    assert_eq!((s.min, s.max), (0.0, 255.0));
    about(s.mean, 1.069, "aneurism");
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn a_vessel_of_strips_has_its_facts() {
    let path = data("meshes/avf_vessel.vtk");
    assert_eq!(kind_of(&path).expect("readable"), Some(FileKind::Surface));
    let r = MeshReport::of(&read_surface(&path).expect("reads"));
    assert_eq!((r.vertices, r.welded_vertices, r.triangles), (4754, 4661, 9314));
    assert_eq!((r.closed, r.euler, r.components, r.self_intersections), (true, 4, 2, 0));
    about(r.volume, 2655.0, "vessel");
    let said = read_tets(&path).expect_err("refused").to_string();
    assert!(said.contains("holds a surface (POLYDATA), but a mesh of solid cells is wanted here"), "{said}");
}

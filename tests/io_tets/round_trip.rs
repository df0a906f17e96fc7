//! What is written comes back.

use std::path::Path;

use glam::DVec3;
use voxclay::io::{
    Encoding, FileKind, GmshVersion, IoError, TetWriteOptions, is_tets_path, keeps_vectors, kind_of, read_tets,
    write_tets,
};
use voxclay::mesh::tets::TetMesh;

use super::{same_bits, sample};

fn every_option() -> impl Iterator<Item = TetWriteOptions> {
    [Encoding::Raw, Encoding::Compressed, Encoding::Text]
        .into_iter()
        .flat_map(|encoding| [GmshVersion::V22, GmshVersion::V41].map(|gmsh| TetWriteOptions { encoding, gmsh }))
}

#[test]
fn every_format_brings_every_bit_back() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let full = sample();
    let no_vectors = TetMesh { vectors: vec![], ..full.clone() };
    let bare = TetMesh { regions: vec![], ..no_vectors.clone() };
    for name in ["a.vtu", "a.vtk", "a.msh", "a.mesh", "a.node", "b.ele", "C.VTU", "D.NODE"] {
        let path = dir.path().join(name);
        assert!(is_tets_path(&path));
        for options in every_option() {
            for mesh in if keeps_vectors(&path) { [&full, &bare] } else { [&no_vectors, &bare] } {
                write_tets(&path, mesh, &options).unwrap_or_else(|e| panic!("{e}"));
                let back = read_tets(&path).unwrap_or_else(|e| panic!("{e}"));
                same_bits(&back, mesh, &format!("{name} {options:?}"));
                assert_eq!(kind_of(&path).expect("readable"), Some(FileKind::Tets));
            }
        }
    }
}

#[test]
fn a_mesh_of_many_blocks_comes_back_and_is_smaller_compressed() {
    let mut mesh = TetMesh::default();
    for i in 0..20_000u32 {
        let p = DVec3::new(f64::from(i % 29), f64::from(i % 31), f64::from(i % 37));
        mesh.points.push(p + DVec3::new(0.0, 0.0, 40.0 * f64::from(i / 29)));
    }
    mesh.tets = (0..19_990u32).map(|i| [i, i + 1, i + 3, i + 7]).collect();
    let dir = tempfile::tempdir().expect("a temporary folder");
    let size = |encoding| {
        let path = dir.path().join("a.vtu");
        write_tets(&path, &mesh, &TetWriteOptions { encoding, ..Default::default() }).expect("written");
        same_bits(&read_tets(&path).expect("reads"), &mesh, "vtu");
        std::fs::metadata(&path).expect("there").len()
    };
    let (raw, compressed) = (size(Encoding::Raw), size(Encoding::Compressed));
    assert!(compressed < raw / 2, "{compressed} of {raw}");
}

/// Zero is the word of Gmsh and Medit for no region at all.
#[test]
fn regions_of_zero_alone_are_none_in_gmsh_and_medit() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let zeros = TetMesh { regions: vec![0; 5], vectors: vec![], ..sample() };
    for (name, kept) in [("a.msh", false), ("a.mesh", false), ("a.vtu", true), ("a.vtk", true), ("a.node", true)] {
        for options in every_option() {
            let path = dir.path().join(name);
            write_tets(&path, &zeros, &options).expect("written");
            assert_eq!(read_tets(&path).expect("reads").regions.is_empty(), !kept, "{name}");
        }
    }
}

#[test]
fn what_cannot_be_written_leaves_nothing_behind() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let fails = |name: &str, mesh: &TetMesh, part: &str| {
        let m = write_tets(&dir.path().join(name), mesh, &TetWriteOptions::default()).expect_err("refused").to_string();
        assert!(m.contains(name) && m.contains(part) && !m.contains('\n'), "{m}");
    };
    let good = sample();
    fails("a.txt", &good, "does not end in a format of tetrahedral meshes; use .vtu");
    fails("a.meshb", &good, "is only read; write .mesh instead");
    fails("a.mesh", &good, "cannot hold the vectors 'deformed' of the mesh; use .vtu");
    fails("a.ele", &good, "cannot hold the vectors");
    fails("missing/a.vtu", &good, "cannot write");
    let with = |change: fn(&mut TetMesh)| {
        let mut mesh = sample();
        change(&mut mesh);
        mesh
    };
    fails("a.vtk", &with(|m| m.points[2].y = f64::NAN), "point 3 is not finite");
    fails("a.msh", &with(|m| m.regions.truncate(3)), "has 3 regions for 5 tetrahedra");
    fails("a.msh", &with(|m| m.vectors[0].values.truncate(3)), "has 3 vectors 'deformed' for 9 points");
    for name in ["", "a\nb", "say \"x\""] {
        let mut mesh = sample();
        mesh.vectors[1].name = name.to_owned();
        fails("a.msh", &mesh, "give them a plain one");
    }
    assert_eq!(std::fs::read_dir(dir.path()).expect("there").count(), 0);
    assert!(matches!(read_tets(Path::new("a.obj")), Err(IoError::Unsupported { .. })));
}

/// Either file of TetGen's pair may be named, but both must be there.
#[test]
fn half_a_pair_is_not_enough() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let mesh = TetMesh { vectors: vec![], ..sample() };
    let path = |name: &str| dir.path().join(name);
    write_tets(&path("a.1.node"), &mesh, &TetWriteOptions::default()).expect("written");
    same_bits(&read_tets(&path("a.1.ele")).expect("reads"), &mesh, "the other half");
    std::fs::remove_file(path("a.1.ele")).expect("removed");
    let said = read_tets(&path("a.1.node")).expect_err("refused").to_string();
    assert!(said.contains("a.1.node: has no a.1.ele beside it"), "{said}");
    let said = read_tets(&path("a.1.ele")).expect_err("refused").to_string();
    assert!(said.contains("a.1.ele: cannot read"), "{said}");
}

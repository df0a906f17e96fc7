//! What other programs write, and forms of the formats that they do not.

use glam::DVec3;
use voxclay::io::{FileKind, kind_of, read_surface, read_tets};
use voxclay::mesh::cells::CellKind;
use voxclay::mesh::check::MeshReport;
use voxclay::mesh::tet_report::TetReport;
use voxclay::mesh::tets::TetMesh;

use super::{fixture, fixture_bytes, message, parse, same_bits, tets};

/// The mesh of VTK's fixtures: a hexahedron and a voxel beside it, a pyramid and a wedge on the hexahedron, a tetrahedron at
/// the pyramid, and some cells that are not solid.
fn is_the_zoo(mesh: &TetMesh, tolerance: f64, what: &str) {
    let report = TetReport::of(mesh);
    let facts = (report.nodes, report.tets, report.inverted, report.boundary_faces, report.boundary_euler);
    assert_eq!(facts, (33, 71, 0, 48, 2), "{what}");
    assert_eq!((report.components, report.non_conforming_faces, report.unused_points), (1, 0, 0), "{what}");
    let tet = 0.25 / 3.0 * 3.0;
    assert!((report.volume - (2.0 + 1.0 / 3.0 + 0.5 + tet)).abs() < 1e-9, "{what}: {}", report.volume);
    // a hexahedron, a voxel, a pyramid, a wedge, a tetrahedron, in the order of the file
    let regions: Vec<(i32, usize)> = mesh.regions.chunk_by(|a, b| a == b).map(|r| (r[0], r.len())).collect();
    assert_eq!(regions, [(1, 24), (2, 24), (-3, 8), (4, 14), (70000, 1)], "{what}");
    assert_eq!(mesh.vectors.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(), ["deformed", "u v"], "{what}");
    for (i, p) in mesh.points.iter().enumerate() {
        let deformed = mesh.vectors[0].values[i] - (*p * 2.0 + DVec3::new(0.0, 0.0, 1.0 / 3.0));
        let u = mesh.vectors[1].values[i] - *p * 3.0;
        assert!(deformed.length() < tolerance && u.length() < 1e-6, "{what}: point {i} {deformed} {u}");
    }
}

#[test]
fn vtu_is_read_in_every_encoding() {
    let first = tets("raw_le32.vtu", &fixture_bytes("raw_le32.vtu"));
    is_the_zoo(&first, 1e-15, "raw_le32.vtu");
    for name in ["inline_be32.vtu", "inline_zlib64.vtu", "raw_zlib_be64.vtu", "base64_zlib32.vtu", "base64_le64.vtu"] {
        same_bits(&read_tets(&fixture(name)).expect(name), &first, name);
    }
    // text has 12 digits
    is_the_zoo(&tets("ascii.vtu", &fixture_bytes("ascii.vtu")), 1e-10, "ascii.vtu");
}

#[test]
fn compressors_that_are_not_read_are_named() {
    for (name, compressor) in [("lz4.vtu", "vtkLZ4DataCompressor"), ("lzma.vtu", "vtkLZMADataCompressor")] {
        let said = message(name, &fixture_bytes(name));
        assert!(
            said.contains(&format!("is compressed by '{compressor}'; Voxclay reads vtkZLibDataCompressor")),
            "{said}"
        );
    }
    // nothing needs the compressor of a file of text
    let text = String::from_utf8(fixture_bytes("ascii.vtu")).expect("text");
    let named = text.replacen(" byte_order", " compressor=\"vtkLZ4DataCompressor\" byte_order", 1);
    assert_ne!(named, text);
    is_the_zoo(&tets("a.vtu", named.as_bytes()), 1e-10, "named");
}

#[test]
fn pieces_of_a_vtu_are_one_mesh() {
    let text = String::from_utf8(fixture_bytes("ascii.vtu")).expect("text");
    let (start, end) = (text.find("<Piece").expect("there"), text.find("</UnstructuredGrid>").expect("there"));
    let piece = &text[start..end];
    let empty = "<Piece NumberOfPoints=\"0\" NumberOfCells=\"0\"><Points/><Cells/></Piece>";
    let with = |pieces: &[&str]| [&text[..start], &pieces.concat(), &text[end..]].concat();
    let two = tets("a.vtu", with(&[piece, empty, piece]).as_bytes());
    let one = tets("a.vtu", text.as_bytes());
    let report = TetReport::of(&two);
    assert_eq!((report.tets, report.nodes, report.components, report.boundary_euler), (142, 66, 2, 4));
    assert_eq!(two.regions, [one.regions.clone(), one.regions.clone()].concat());
    assert_eq!(two.vectors.len(), 2);
    // vectors that one piece lacks are left out, regions are 0 there
    let poor = piece.replace("Name=\"deformed\"", "Name=\"other\"").replace("Name=\"Region\"", "Name=\"none\"");
    for pieces in [[piece, &poor], [&poor, piece]] {
        let mixed = tets("a.vtu", with(&pieces).as_bytes());
        assert_eq!(mixed.vectors.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(), ["u v"]);
        assert_eq!((mixed.regions.len(), mixed.regions.iter().filter(|r| **r == 0).count()), (142, 71));
    }
    assert!(tets("a.vtu", with(&[&poor]).as_bytes()).regions.is_empty());
}

#[test]
fn legacy_files_are_read_in_both_layouts() {
    for (name, tolerance) in [
        ("legacy42_ascii.vtk", 1e-9),
        ("legacy42_binary.vtk", 1e-15),
        ("legacy51_ascii.vtk", 1e-9),
        ("legacy51_binary.vtk", 1e-15),
    ] {
        let mesh = read_tets(&fixture(name)).expect(name);
        is_the_zoo(&mesh, tolerance, name);
        assert_eq!(kind_of(&fixture(name)).expect(name), Some(FileKind::Tets));
    }
}

#[test]
fn strips_of_triangles_are_a_surface() {
    for name in ["strips42.vtk", "strips51.vtk"] {
        let path = fixture(name);
        assert_eq!(kind_of(&path).expect(name), Some(FileKind::Surface));
        let report = MeshReport::of(&read_surface(&path).expect(name));
        assert!(report.is_clean_solid(), "{:?}", report.defects());
        assert_eq!((report.vertices, report.triangles, report.euler), (20, 36, 2));
        let said = message(name, &fixture_bytes(name));
        assert!(said.contains("holds a surface (POLYDATA), but a mesh of solid cells is wanted here"), "{said}");
    }
    let polygons = "# vtk DataFile Version 2.0\nx\nascii\ndataset polydata\npoints 5 float\n0 0 0 1 0 0 1 1 0 0 1 0 0 0 1\n\
                    LINES 1 3\n2 0 1\nPOLYGONS 2 9\n4 0 1 2 3\n3 0 4 1\n";
    let dir = tempfile::tempdir().expect("a temporary folder");
    let path = dir.path().join("a.VTK");
    std::fs::write(&path, polygons).expect("written");
    assert_eq!(read_surface(&path).expect("reads").triangles, [[0, 1, 2], [0, 2, 3], [0, 4, 1]]);
    std::fs::write(&path, polygons.replace("3 0 4 1", "3 0 5 1")).expect("written");
    assert!(read_surface(&path).expect_err("refused").to_string().contains("face 2 names vertex 6 of only 5"));
}

#[test]
fn every_attribute_of_a_legacy_file_is_passed_or_kept() {
    let text = "# vtk DataFile Version 3.0\n\nASCII\n\nDATASET UNSTRUCTURED_GRID\nFIELD FieldData 2\nTIME 1 1 double\n0.5\nwords 1 2 string\n\
                one word\nPOINTS too many\n\nPOINTS 4 int\n0 0 0\n1 0 0\n0 1 0\n0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n\
                CELL_DATA 1\nSCALARS quality float\nLOOKUP_TABLE mine\n0.5\nLOOKUP_TABLE mine 2\n0 0 0 1 1 1 1 1\nSCALARS material unsigned_char 1\n\
                LOOKUP_TABLE default\n200\nPOINT_DATA 4\nSCALARS three float 3\nLOOKUP_TABLE default\n1 2 3 1 2 3 1 2 3 1 2 3\n\
                COLOR_SCALARS rgb 3\n0 0 0 1 1 1 0 0 0 1 1 1\nNORMALS n float\n0 0 1 0 0 1 0 0 1 0 0 1\nTENSORS t float\n\
                1 0 0 0 1 0 0 0 1 1 0 0 0 1 0 0 0 1 1 0 0 0 1 0 0 0 1 1 0 0 0 1 0 0 0 1\nTEXTURE_COORDINATES tc 2 float\n0 0 1 1 0 0 1 1\n\
                VECTORS moved%20by short\n0 0 1 0 0 2 0 0 3 0 0 4\nGLOBAL_IDS id int\n4 3 2 1\nFIELD more 3\nflags 1 4 bit\n0 1 0 1\n\
                w 3 4 double\n0 0 0 0 0 0 0 0 0 0 0 1e-3\nof_other_size 3 1 float\n1 2 3\n";
    let mesh = tets("a.vtk", text.as_bytes());
    assert_eq!((mesh.tets.as_slice(), mesh.regions.as_slice()), (&[[0, 1, 2, 3]][..], &[200][..]));
    let names: Vec<&str> = mesh.vectors.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["three", "rgb", "moved by", "w"]);
    assert_eq!(mesh.vectors("moved by").expect("there")[3], DVec3::new(0.0, 0.0, 4.0));
    assert_eq!(mesh.vectors("w").expect("there")[3], DVec3::new(0.0, 0.0, 1e-3));
}

#[test]
fn regions_go_by_several_names() {
    let file = |name: &str, kind: &str, value: &str| {
        format!(
            "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 2 7\n\
             1 0 4 0 1 2 3\nCELL_TYPES 2\n1 10\nCELL_DATA 2\nFIELD f 1\n{name} 1 2 {kind}\n-9 {value}\n"
        )
    };
    for (name, kind, value, expected) in [
        ("region", "int", "7", vec![7]),
        ("Material", "double", "3.0", vec![3]),
        ("MaterialIDs", "vtktypeint64", "5", vec![5]),
        // not what tells bodies apart
        ("material", "double", "0.5", vec![]),
        ("region", "vtktypeint64", "5000000000", vec![]),
        ("pressure", "int", "7", vec![]),
    ] {
        assert_eq!(tets("a.vtk", file(name, kind, value).as_bytes()).regions, expected, "{name} {value}");
    }
}

#[test]
fn gmsh_reads_what_gmsh_writes() {
    for name in ["gmsh22_binary.msh", "gmsh41_binary.msh", "gmsh41_partitioned.msh"] {
        let mesh = tets(name, &fixture_bytes(name));
        let report = TetReport::of(&mesh);
        assert_eq!((report.nodes, report.tets, report.inverted), (23, 48, 0), "{name}");
        assert_eq!((report.boundary_faces, report.boundary_euler, report.components), (40, 2, 1), "{name}");
        assert!((report.volume - 2.0).abs() < 1e-12, "{name}");
        // two unit cubes beside one another along x, of physical groups 7 and 8
        for (t, region) in mesh.tets.iter().zip(&mesh.regions) {
            let x = TetMesh::corners(*t, &mesh.points).map(|p| p.x).iter().sum::<f64>() / 4.0;
            assert_eq!(*region, if x < 1.0 { 7 } else { 8 }, "{name}");
        }
        if name != "gmsh41_partitioned.msh" {
            // two steps of one view
            let names: Vec<&str> = mesh.vectors.iter().map(|v| v.name.as_str()).collect();
            assert_eq!(names, ["deformed", "deformed#2"], "{name}");
            for (i, p) in mesh.points.iter().enumerate() {
                assert!((mesh.vectors[0].values[i] - (*p * 2.0 + DVec3::Z)).length() < 1e-12, "{name}");
                assert!((mesh.vectors[1].values[i] - *p * 3.0).length() < 1e-12, "{name}");
            }
        }
    }
}

/// A mesh in Gmsh's binary format of either version and byte order, with numbers of nodes far apart.
fn gmsh_binary(version: &str, big: bool, wide: bool) -> Vec<u8> {
    let mut out = format!("$MeshFormat\n{version} 1 {}\n", if version == "2.2" || wide { 8 } else { 4 }).into_bytes();
    let int = |out: &mut Vec<u8>, x: i32| out.extend(if big { x.to_be_bytes() } else { x.to_le_bytes() });
    let size = |out: &mut Vec<u8>, x: u64| match (wide, big) {
        (true, true) => out.extend(x.to_be_bytes()),
        (true, false) => out.extend(x.to_le_bytes()),
        (false, true) => out.extend((x as u32).to_be_bytes()),
        (false, false) => out.extend((x as u32).to_le_bytes()),
    };
    let real = |out: &mut Vec<u8>, x: f64| out.extend(if big { x.to_be_bytes() } else { x.to_le_bytes() });
    let nodes = [(70, [0.0, 0.0, 0.0]), (5, [1.0, 0.0, 0.0]), (9000, [0.0, 1.0, 0.0]), (6, [0.0, 0.0, 1.5])];
    int(&mut out, 1);
    out.extend(b"\n$EndMeshFormat\n$PhysicalNames\n1\n3 4 \"a $End b\"\n$EndPhysicalNames\n");
    if version == "2.2" {
        out.extend(b"$Nodes\n4\n");
        for (id, p) in nodes {
            int(&mut out, id);
            p.iter().for_each(|x| real(&mut out, *x));
        }
        out.extend(b"\n$EndNodes\n$Elements\n3\n");
        // a point, and two tetrahedra in a group
        for x in [15, 1, 2, 1, 4, 4, 5, 4, 2, 2, 2, 4, 4, 70, 5, 9000, 6, 3, 4, 4, 5, 70, 9000, 6] {
            int(&mut out, x);
        }
        out.extend(b"\n$EndElements\n");
    } else {
        out.extend(b"$Entities\n");
        [0, 0, 0, 1].iter().for_each(|x| size(&mut out, *x));
        int(&mut out, 2);
        (0..6).for_each(|_| real(&mut out, 0.0));
        size(&mut out, 2);
        [4, 9].iter().for_each(|x| int(&mut out, *x));
        size(&mut out, 1);
        int(&mut out, -3);
        out.extend(b"\n$EndEntities\n$Nodes\n");
        [2, 4, 5, 9000].iter().for_each(|x| size(&mut out, *x));
        for part in nodes.chunks(2) {
            // with a parameter of a curve, which is passed over
            [1, 1, 1].iter().for_each(|x| int(&mut out, *x));
            size(&mut out, 2);
            part.iter().for_each(|n| size(&mut out, n.0 as u64));
            part.iter().for_each(|n| n.1.iter().chain(&[0.25]).for_each(|x| real(&mut out, *x)));
        }
        out.extend(b"\n$EndNodes\n$Elements\n");
        [2, 3, 1, 3].iter().for_each(|x| size(&mut out, *x));
        [0, 1, 15].iter().for_each(|x| int(&mut out, *x));
        [1, 1, 5].iter().for_each(|x| size(&mut out, *x));
        [3, 2, 4].iter().for_each(|x| int(&mut out, *x));
        [2, 2, 70, 5, 9000, 6, 3, 5, 70, 9000, 6].iter().for_each(|x| size(&mut out, *x));
        out.extend(b"\n$EndElements\n");
    }
    out.extend(b"$NodeData\n2\n\"part of it\"\n\"scheme\"\n1\n0.5\n4\n0\n3\n2\n0\n");
    for id in [6, 70] {
        int(&mut out, id);
        [f64::from(id), 0.0, -1.0].iter().for_each(|x| real(&mut out, *x));
    }
    out.extend(b"\n$EndNodeData\n$NodeData\n1\n\"temperature\"\n0\n3\n0\n1\n1\n");
    int(&mut out, 5);
    real(&mut out, 300.0);
    out.extend(b"\n$EndNodeData\n$Junk\n\0\x01$En\n$EndJunk\n");
    out
}

#[test]
fn gmsh_binary_has_two_byte_orders_and_sparse_numbers() {
    for (version, big, wide) in [
        ("2.2", false, true),
        ("2.2", true, true),
        ("4.1", false, true),
        ("4.1", true, true),
        ("4.1", true, false),
        ("4.1", false, false),
    ] {
        let what = format!("{version} {big} {wide}");
        let mesh = tets("a.msh", &gmsh_binary(version, big, wide));
        assert_eq!(mesh.points, [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z * 1.5], "{what}");
        assert_eq!(
            (mesh.tets.as_slice(), mesh.regions.as_slice()),
            (&[[0, 1, 2, 3], [1, 0, 2, 3]][..], &[4, 4][..]),
            "{what}"
        );
        assert_eq!(mesh.vectors.len(), 1, "{what}");
        let values = mesh.vectors("part of it").expect("there");
        assert_eq!((values[0], values[3]), (DVec3::new(70.0, 0.0, -1.0), DVec3::new(6.0, 0.0, -1.0)), "{what}");
        // nobody knows the others
        assert!(values[1].is_nan() && values[2].is_nan(), "{what}");
    }
}

#[test]
fn gmsh_text_of_older_minor_versions_entities_and_comments() {
    let file = |version: &str, tags: [&str; 2]| {
        format!(
            "$Comments\nby hand $Nodes\n$EndComments\n$MeshFormat\n{version} 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n\
             $EndNodes\n$Elements\n3\n1 2 2 9 9 1 2 3\n2 4 {} 1 2 3 4\n3 4 {} 2 3 4 5\n$EndElements\n",
            tags[0], tags[1]
        )
    };
    for (tags, regions) in [
        (["2 6 1", "2 8 1"], vec![6, 8]),
        (["2 6 1", "3 0 1 77"], vec![6, 0]),
        // no groups at all, but two entities
        (["2 0 11", "2 0 12"], vec![11, 12]),
        (["2 0 11", "2 0 11"], vec![]),
        (["0", "0"], vec![]),
    ] {
        for version in ["2", "2.0", "2.1", "2.2"] {
            let mesh = tets("a.msh", file(version, tags).as_bytes());
            assert_eq!((mesh.tets.len(), &mesh.regions), (2, &regions), "{version} {tags:?}");
        }
    }
}

/// The corners of cells of higher order come first; the points between them are left out, but not those that nothing names.
#[test]
fn cells_of_higher_order_are_taken_by_their_corners() {
    let points: String = (1..=12).map(|i| format!("{i} {} {} {}\n", i % 3, i % 4, i % 5)).collect();
    let list = "1 2 3 4 5 6 7 8 9 10";
    let gmsh = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n12\n{points}$EndNodes\n$Elements\n2\n1 11 2 0 1 {list}\n2 4 2 0 1 1 2 3 9\n$EndElements\n\
         $NodeData\n1\n\"d\"\n1\n0\n3\n0\n3\n12\n{points}$EndNodeData\n"
    );
    let xyz: String = points.lines().map(|l| l.split_once(' ').map_or("", |p| p.1).to_owned() + " 0\n").collect();
    let medit = format!(
        "MeshVersionFormatted 2\nDimension 3\nVertices\n12\n{xyz}TetrahedraP2\n1\n{list} 0\nTetrahedra\n1\n1 2 3 9 0\nEnd\n"
    );
    for (name, text) in [("a.msh", gmsh), ("a.mesh", medit)] {
        let mesh = tets(name, text.as_bytes());
        // 5 to 8 and 10 are gone, 9 is a corner of another, 11 and 12 are of no cell
        let left: Vec<DVec3> = [1, 2, 3, 4, 9, 11, 12]
            .map(|i: i32| DVec3::new(f64::from(i % 3), f64::from(i % 4), f64::from(i % 5)))
            .to_vec();
        assert_eq!(mesh.points, left, "{name}");
        let mut sorted = mesh.tets.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, [[0, 1, 2, 3], [0, 1, 2, 4]], "{name}");
        if let Some(d) = mesh.vectors("d") {
            assert_eq!(d, left);
        }
    }
    let tetgen = format!("12 3 0 0\n{points}\n\0 1 10 0\n1 {list}\n");
    assert_eq!(tets("a.node", tetgen.as_bytes()).points.len(), 6);
}

#[test]
fn medit_text_has_comments_and_many_keywords() {
    let text = "MeshVersionFormatted\n2 # a comment 5\nDimension 3\nVertices 7 0 0 0 1\n1 0 0 1\n0 1 0 1\n0 0 1 1\n1 0 1 1\n0 1 1 1 # the last but one\n\
                -1e0 .5 +0.5 0\nEdges 1\n1 2 5\nTriangles\n1\n1 2 3 4\nRidges 1 1\nCorners\n0\nNormals 1\n0.5 0.5 0.7\nSoSo 1 2 -3.5e2\n\
                Tetrahedra 1\n1 4 3 7 6\npentahedra\n1\n1 2 3 4 5 6 8\nRequiredVertices\n1\n1\nEnd\nwhat follows does not count";
    let mesh = parse("a.mesh", text.as_bytes()).expect("reads");
    assert_eq!(mesh.kinds, [CellKind::Tet, CellKind::Wedge]);
    assert_eq!(mesh.regions, [6, 8]);
    let split = mesh.into_tets(0).expect("splits");
    assert_eq!((split.tets.len(), split.points.len()), (15, 7 + 4));
    let report = TetReport::of(&split);
    assert_eq!((report.inverted, report.components), (0, 1));
    // End may be missing if the last line is whole
    let short = "MeshVersionFormatted 1\nDimension\n3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\nTetrahedra\n1\n1 2 3 4 0\n";
    assert_eq!(tets("a.mesh", short.as_bytes()).tets, [[0, 1, 2, 3]]);
    assert!(message("a.mesh", short.trim_end().as_bytes()).contains("ends in the middle of a line"));
}

/// A `.meshb` of any version in either byte order, with a keyword to pass over.
pub fn meshb(version: i32, big: bool) -> Vec<u8> {
    let mut out = Vec::new();
    let int = |out: &mut Vec<u8>, x: i64, wide: bool| match (wide, big) {
        (false, false) => out.extend((x as i32).to_le_bytes()),
        (false, true) => out.extend((x as i32).to_be_bytes()),
        (true, false) => out.extend(x.to_le_bytes()),
        (true, true) => out.extend(x.to_be_bytes()),
    };
    let wide = version == 4;
    int(&mut out, 1, false);
    int(&mut out, version.into(), false);
    let mut section = |keyword: i64, body: &mut dyn FnMut(&mut Vec<u8>)| {
        int(&mut out, keyword, false);
        let mut inside = Vec::new();
        body(&mut inside);
        let next = out.len() + if version >= 3 { 8 } else { 4 } + inside.len();
        int(&mut out, next as i64, version >= 3);
        out.extend(inside);
    };
    section(3, &mut |o| int(o, 3, false));
    section(4, &mut |o| {
        int(o, 5, wide);
        for p in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.5, 0.75]] {
            for x in p {
                match (version, big) {
                    (1, false) => o.extend((x as f32).to_le_bytes()),
                    (1, true) => o.extend((x as f32).to_be_bytes()),
                    (_, false) => o.extend(f64::to_le_bytes(x)),
                    (_, true) => o.extend(f64::to_be_bytes(x)),
                }
            }
            int(o, 0, wide);
        }
    });
    section(5, &mut |o| [1, 1, 2, 0].iter().for_each(|x| int(o, *x, wide)));
    section(8, &mut |o| [2, 1, 2, 3, 4, 5, 2, 4, 3, 5, -6].iter().for_each(|x| int(o, *x, wide)));
    section(54, &mut |_| {});
    out
}

#[test]
fn medit_binary_is_read_in_every_version() {
    for version in 1..=4 {
        for big in [false, true] {
            let mesh = tets("a.meshb", &meshb(version, big));
            assert_eq!(mesh.points.last(), Some(&DVec3::new(0.5, 0.5, 0.75)), "{version} {big}");
            assert_eq!(
                (mesh.tets.as_slice(), mesh.regions.as_slice()),
                (&[[0, 1, 2, 3], [1, 3, 2, 4]][..], &[5, -6][..])
            );
        }
    }
}

#[test]
fn tetgen_counts_from_0_or_1_and_has_comments() {
    let node = |first: usize| {
        let points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]];
        let lines: String = (points.iter().enumerate())
            .map(|(i, [x, y, z])| format!("  {}   {x}.0 {y} {z}e0  0.5 0.25  1 # point\n", i + first))
            .collect();
        format!("# Generated by hand\n\n4 3 2 1 # count\n{lines}# the end")
    };
    for first in [0, 1] {
        let corners = [0, 1, 2, 3].map(|v| (v + first).to_string()).join(" ");
        for (attributes, values, regions) in
            [(0, "", vec![]), (1, "7", vec![7]), (2, "0.5 -3", vec![-3]), (1, "2.5", vec![]), (1, "1e10", vec![])]
        {
            let ele = format!("1 4 {attributes}\n1 {corners} {values}\n");
            let mesh = tets("a.node", format!("{}\0{ele}", node(first)).as_bytes());
            assert_eq!((mesh.tets.as_slice(), &mesh.regions), (&[[0, 1, 2, 3]][..], &regions), "{first} {values}");
        }
    }
}

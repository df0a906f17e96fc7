//! Files that are cut off, damaged, or say what is not so.

use std::path::Path;

use proptest::prelude::*;
use voxclay::io::{
    Encoding, GmshVersion, IoError, TetWriteOptions, kind_of, read_tets, read_volume, vti, vtk, write_tets,
};
use voxclay::mesh::tets::TetMesh;

use super::foreign::meshb;
use super::{fixture_bytes, message, parse, sample, sound};

/// What the writers make of a mesh.
fn written(name: &str, encoding: Encoding, gmsh: GmshVersion) -> Vec<u8> {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let path = dir.path().join(name);
    let mut mesh = sample();
    if !voxclay::io::keeps_vectors(&path) {
        mesh.vectors.clear();
    }
    write_tets(&path, &mesh, &TetWriteOptions { encoding, gmsh }).expect("written");
    let mut bytes = std::fs::read(&path).expect("there");
    if name.ends_with("node") {
        bytes.push(0);
        bytes.extend(std::fs::read(path.with_extension("ele")).expect("there"));
    }
    bytes
}

/// Name, content, and whether every cut is noticed.
fn files() -> Vec<(&'static str, Vec<u8>, bool)> {
    let (raw, zlib, text) = (Encoding::Raw, Encoding::Compressed, Encoding::Text);
    let (v2, v4) = (GmshVersion::V22, GmshVersion::V41);
    let mut all = vec![
        ("a.vtu", written("a.vtu", raw, v4), true),
        ("b.vtu", written("b.vtu", zlib, v4), true),
        ("c.vtu", written("c.vtu", text, v4), true),
        ("d.vtu", fixture_bytes("base64_zlib32.vtu"), true),
        ("e.vtu", fixture_bytes("inline_be32.vtu"), true),
        // arrays and sections that follow the mesh may be missing
        ("a.vtk", written("a.vtk", raw, v4), false),
        ("b.vtk", written("b.vtk", text, v4), false),
        ("c.vtk", fixture_bytes("legacy51_binary.vtk"), false),
        ("a.msh", written("a.msh", raw, v2), false),
        ("b.msh", written("b.msh", text, v2), false),
        ("c.msh", written("c.msh", raw, v4), false),
        ("d.msh", written("d.msh", text, v4), false),
        ("a.mesh", written("a.mesh", text, v4), false),
        ("a.meshb", meshb(2, true), true),
        ("a.node", written("a.node", text, v4), true),
    ];
    for (_, bytes, _) in &mut all {
        // so that every cut takes something away
        bytes.truncate(bytes.trim_ascii_end().len() + usize::from(bytes.ends_with(b"\n")));
    }
    all
}

#[test]
fn every_cut_is_sound_or_refused() {
    for (name, bytes, noticed) in files() {
        sound(parse(name, &bytes).unwrap_or_else(|e| panic!("{e}")));
        let mut refused = 0;
        for len in 0..bytes.len() {
            match parse(name, &bytes[..len]) {
                Ok(mesh) => sound(mesh),
                Err(e) => {
                    refused += 1;
                    assert!(e.to_string().starts_with(name) && !e.to_string().contains('\n'), "{e}");
                }
            }
        }
        // all but the line end behind the last word, or what follows the last keyword of Medit
        let least = if noticed { bytes.len() - 4 } else { bytes.len() / 3 };
        assert!(refused >= least, "{name}: {refused} of {}", bytes.len());
    }
}

#[test]
fn every_flipped_byte_is_sound_or_refused() {
    for (name, bytes, _) in files() {
        for at in (0..bytes.len()).filter(|at| *at < 900 || at % 5 == 0) {
            for flip in [0x01, 0x10, 0x80, 0xFF] {
                let mut bad = bytes.clone();
                bad[at] ^= flip;
                if let Ok(mesh) = parse(name, &bad) {
                    sound(mesh);
                }
            }
        }
    }
}

#[test]
fn images_cut_or_flipped_are_sound_or_refused() {
    let images = ["image_inline_be32.vti", "image_raw_zlib64.vti", "image_base64.vti", "image_ascii.vti"];
    for name in images.into_iter().chain(["points_ascii.vtk", "points_binary.vtk"]) {
        let bytes = fixture_bytes(name);
        let parse = |b: &[u8]| {
            let parse = if name.ends_with("vti") { vti::parse } else { vtk::parse_volume };
            parse(Path::new(name), b).map(|v| assert_eq!(v.samples.len(), v.grid.len() * v.channels))
        };
        let end = bytes.trim_ascii_end().len();
        for len in 0..end {
            let cut = parse(&bytes[..len]);
            // the last number of a text may lose digits
            assert!(cut.is_err() || name == "points_ascii.vtk" && len + 2 >= end, "{name} cut at {len}");
        }
        for at in 0..bytes.len() {
            for flip in [0x01, 0x10, 0xFF] {
                let mut bad = bytes.clone();
                bad[at] ^= flip;
                let _ = parse(&bad);
            }
        }
    }
}

fn vtu(points: &str, cells: &str) -> String {
    format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\"><UnstructuredGrid>\
         <Piece NumberOfPoints=\"4\" NumberOfCells=\"1\"><Points>{points}</Points><Cells>{cells}</Cells></Piece></UnstructuredGrid></VTKFile>"
    )
}

fn array(name: &str, kind: &str, attributes: &str, content: &str) -> String {
    format!("<DataArray type=\"{kind}\" Name=\"{name}\" {attributes}>{content}</DataArray>")
}

#[test]
fn a_bad_vtu_is_refused_in_one_sentence() {
    let ascii = "format=\"ascii\"";
    let points = |text: &str| array("p", "Float64", "NumberOfComponents=\"3\" format=\"ascii\"", text);
    let cells = |connectivity: &str, offsets: &str, types: &str| {
        [
            array("connectivity", "Int32", ascii, connectivity),
            array("offsets", "Int32", ascii, offsets),
            array("types", "UInt8", ascii, types),
        ]
        .concat()
    };
    let (p, c) = (points("0 0 0 1 0 0 0 1 0 0 0 1"), cells("0 1 2 3", "4", "10"));
    assert!(parse("a.vtu", vtu(&p, &c).as_bytes()).is_ok());
    let with = |attribute: &str| vtu(&p, &c).replacen("version=\"1.0\"", attribute, 1);
    let binary = |content: &str| vtu(&array("p", "Float64", "NumberOfComponents=\"3\" format=\"binary\"", content), &c);
    for (text, part) in [
        (String::new(), "holds no element of XML"),
        ("not XML".to_owned(), "holds no element of XML"),
        ("<html></html>".to_owned(), "does not begin with an element VTKFile"),
        ("<VTKFile type=\"PolyData\"></VTKFile>".to_owned(), "holds 'PolyData', but UnstructuredGrid is wanted"),
        ("<VTKFile type=\"UnstructuredGrid\"></VTKFile>".to_owned(), "has no element UnstructuredGrid"),
        (vtu(&p, &c).replace("</Piece>", ""), "its XML is broken near byte"),
        (vtu(&p, &c).replace("NumberOfCells=\"1\"", ""), "an element Piece has no NumberOfCells"),
        (
            vtu(&p, &c).replace("NumberOfCells=\"1\"", "NumberOfCells=\"-1\""),
            "has NumberOfCells '-1', which must be a number",
        ),
        (
            vtu(&p, &c).replace("NumberOfCells=\"1\"", "NumberOfCells=\"2\""),
            "says that it has 2 cells, but 1 are there",
        ),
        (
            vtu(&p, &c).replace("NumberOfPoints=\"4\"", "NumberOfPoints=\"99999999999\""),
            "99999999999 points, but 4 are there",
        ),
        (with("byte_order=\"Middle\""), "bad attribute"),
        (vtu(&p, &c).replace("LittleEndian", "Middle"), "must be LittleEndian or BigEndian"),
        (with("header_type=\"UInt16\""), "must be UInt32 or UInt64"),
        (vtu(&points("0 0 0 1 0 0 0 1 0 0 0"), &c), "do not come in threes"),
        (vtu(&points("0 0 0 1 0 0 0 x 0 0 0 1"), &c), "the array 'p': line 1 has 'x' where a number should stand"),
        (vtu(&points("0 0 0 1 0 0 0 nan 0 0 0 1"), &c), "point 2 lies at (0, NaN, 0); coordinates must be finite"),
        (vtu(&points("0 0 0 1 0 0 0 1e99 0 0 0 1"), &c), "below 1e90"),
        (vtu(&p, &cells("0 1 2 4", "4", "10")), "cell 0 names point 4 of only 4 from 0"),
        (vtu(&p, &cells("0 1 2 -1", "4", "10")), "cell 0 names point -1 of only 4"),
        (vtu(&p, &cells("0 1 2 2", "4", "10")), "solid cell 1 names point 2 twice; its corners must differ"),
        (vtu(&p, &cells("0 1 2 3", "5", "10")), "the list of points of cell 0 ends at 5; it must lie between 0 and 4"),
        (vtu(&p, &cells("0 1 2 3", "-4", "10")), "ends at -4"),
        (vtu(&p, &cells("0 1 2 3", "3", "5")), "its cells have 3 points in all, but 4 are listed"),
        (vtu(&p, &cells("0 1 2", "3", "10")), "cell 0 of VTK's type 10 has 3 points; it needs 4"),
        (vtu(&p, &cells("0 1 2", "3", "5")), "there are 4 points but no solid cell in it"),
        (vtu(&p, &cells("0 1 2 3", "4", "42")), "cell 0 is of VTK's type 42, which Voxclay cannot split"),
        (vtu(&p, &cells("0 1 2 3", "4", "10 10")), "it has 1 cells, but the types of 2"),
        (vtu(&p, &array("offsets", "Int32", ascii, "4")), "a piece of 1 cells has no array 'connectivity'"),
        (vtu(&p, &c.replace("Int32", "Float96")), "its type 'Float96' is none of VTK's"),
        (vtu(&p, &c.replace("\"ascii\"", "\"hex\"")), "its format is 'hex'; it must be ascii, binary or appended"),
        (vtu(&p, &c.replace("\"ascii\"", "\"appended\" offset=\"0\"")), "it is appended, but nothing is"),
        (binary("AAAA"), "its base64 data break off"),
        (binary("A?AA"), "it has characters that are not base64"),
        // a length of 2^31, and then nothing
        (binary("AAAAgA=="), "it should have 2147483648 bytes of data, but only 3 follow"),
    ] {
        let m = message("a.vtu", text.as_bytes());
        assert!(m.contains(part), "{part}: {m}");
    }
}

#[test]
fn a_bad_legacy_file_is_refused_in_one_sentence() {
    let good = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n";
    assert!(parse("a.vtk", good.as_bytes()).is_ok());
    let five = good
        .replace("CELLS 1 5\n4 0 1 2 3", "CELLS 2 4\nOFFSETS vtktypeint64\n0 4\nCONNECTIVITY vtktypeint64\n0 1 2 3");
    assert!(parse("a.vtk", five.as_bytes()).is_ok());
    for (text, part) in [
        ("".to_owned(), "does not begin with '# vtk DataFile Version'"),
        (good.replace("ASCII", "TEXT"), "line 3 should be ASCII or BINARY"),
        (good.replace("DATASET", "DATA"), "line 4 should begin with DATASET"),
        (good.replace("UNSTRUCTURED_GRID", "RECTILINEAR_GRID"), "holds a data set of type 'RECTILINEAR_GRID'"),
        (good.replace("POINTS 4", "POINTS 400000"), "it says that it has 1200000 numbers, but only"),
        (good.replace("POINTS 4", "POINTS -4"), "line 5 has '-4' where a whole number should stand"),
        (good.replace("0 1 0 0 0 1", "0 1 0 0 0 inf"), "point 2 lies at (0, inf, 0); coordinates must be finite"),
        (good.replace("4 0 1 2 3", "5 0 1 2 3"), "cell 0 is said to have 5 points; there are 4"),
        (good.replace("4 0 1 2 3", "-1 0 1 2 3"), "cell 0 is said to have -1 points"),
        (good.replace("CELLS 1 5", "CELLS 2 5"), "it says that it has 2 cells, but 1 are listed"),
        (good.replace("4 0 1 2 3", "4 0 1 2 9"), "cell 0 names point 9 of only 4"),
        (good.replace("4 0 1 2 3", "4 0 1 2 1"), "solid cell 1 names point 1 twice"),
        (good.replace("CELL_TYPES 1\n10\n", ""), "it has 1 cells, but the types of 0"),
        (good.replace("CELL_TYPES", "KINDS"), "line 9 has 'KINDS', which is no keyword"),
        (good.replace("POINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n", ""), "there are no POINTS in it"),
        (
            format!("{good}POINT_DATA 3\nVECTORS v float\n1 2 3 4 5 6 7 8 9\n"),
            "has 9 numbers for 4 points of 3 components",
        ),
        (five.replace("\n0 4\n", "\n1 4\n"), "the offsets of its cells do not begin at 0"),
        (five.replace("\n0 4\n", "\n0 5\n"), "ends at 5; it must lie between 0 and 4"),
        (five.replace("CONNECTIVITY", "CONNECT"), "should begin with CONNECTIVITY"),
        (five.replace("OFFSETS vtktypeint64", "OFFSETS double").replace("0 4\n", "0.5 4\n"), "are not whole numbers"),
    ] {
        let m = message("a.vtk", text.as_bytes());
        assert!(m.contains(part), "{part}: {m}");
    }
}

#[test]
fn a_bad_gmsh_file_is_refused_in_one_sentence() {
    let two = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n$Elements\n1\n1 4 2 0 1 1 2 3 4\n$EndElements\n";
    let four = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n$Elements\n1 1 1 1\n3 1 4 1\n1 1 2 3 4\n$EndElements\n";
    assert!(parse("a.msh", two.as_bytes()).is_ok() && parse("a.msh", four.as_bytes()).is_ok());
    let data = "$NodeData\n1\n\"d\"\n0\n3\n0\n3\n1\n9 1 2 3\n$EndNodeData\n";
    for (text, part) in [
        ("".to_owned(), "does not begin with $MeshFormat"),
        ("$NOD\n1\n".to_owned(), "is of version 1 of Gmsh's format; save it as version 2.2 or 4.1"),
        (two.replace("2.2 0", "4 0"), "is of version '4' of Gmsh's format; Voxclay reads 2.2 and 4.1"),
        (two.replace("2.2 0 8", "2.2 1 4\n\u{1}\0\0\0"), "its numbers are said to take 4 bytes; it must be 8"),
        (two.replace("2.2 0 8", "2.2 1 8\nabcd"), "its byte order cannot be told"),
        (
            two.replace("$Nodes\n4", "$Nodes\n4000000000"),
            "it says that it has 4000000000 nodes, but only 86 bytes follow in $Nodes",
        ),
        (two.replace("$Nodes\n4", "$Nodes\n3"), "line 9 has '4' where $EndNodes should stand"),
        (two.replace("$Nodes\n4", "$Nodes\n5"), "line 10 has '$EndNodes' where a whole number should stand in $Nodes"),
        (two.replace("\n3 0 1 0", "\n2 0 1 0"), "point 2 is there twice; each point needs a number of its own"),
        (two.replace("\n3 0 1 0", "\n-3 0 1 0"), "there is a node with the number -3"),
        (two.replace("\n3 0 1 0", "\n3 0 nan 0"), "point 3 lies at (0, NaN, 0)"),
        (two.replace("1 2 3 4\n", "1 2 3 7\n"), "solid cell 1 names point 7, but there are only the points 1 to 4"),
        (two.replace("\n4 0 0 1", "\n44 0 0 1"), "solid cell 1 names point 4, which is not there"),
        (two.replace("1 2 3 4\n", "1 2 3 3\n"), "solid cell 1 names point 3 twice"),
        (two.replace("1 4 2 0 1", "1 99999 2 0 1"), "there is an element of type 99999, which Voxclay does not know"),
        (two.replace("1 4 2 0 1 1 2 3 4", "1 2 2 0 1 1 2 3"), "there are 4 points but no solid cell"),
        (
            two.replace("$Elements", "$Stuff").replace("$EndElements", "$EndStuff"),
            "there is no section $Elements in it",
        ),
        (two.replace("$Nodes", "$Stuff").replace("$EndNodes", "$EndStuff"), "there is no section $Nodes in it"),
        (two.replace("$Elements", "$Stuff"), "the section $Stuff has no $EndStuff"),
        (format!("{two}junk"), "line 15 has 'junk' where a section such as $Nodes should begin"),
        (format!("{two}{data}"), "the data 'd' name node 9, which is not there"),
        (format!("{two}{}", data.replace("\n3\n1\n9", "\n3\n8888\n9")), "it says that it has 8888 values, but only"),
        (format!("{two}{}", data.replace("3\n0\n3\n1\n", "1\n0\n")), "the number of components"),
        (four.replace("1 4 1 4", "1 5 1 4"), "it says that it has 5 nodes, but its blocks hold 4"),
        (four.replace("1 4 1 4", "2 4 1 4"), "line 15 has '$EndNodes' where a whole number should stand"),
        (four.replace("3 1 0 4", "3 1 0 4000000000"), "it says that it has 4000000000 nodes, but only"),
        (four.replace("1 1 1 1", "1 2 1 1"), "it says that it has 2 elements, but its blocks hold 1"),
        (four.replace("3 1 4 1\n", "3 1 4 18446744073709551615\n"), "18446744073709551615 elements, but only"),
        (four.replace("1 1 2 3 4", "1 1 2 3 0"), "solid cell 1 names point 0, but there are only the points 1 to 4"),
    ] {
        let m = message("a.msh", text.as_bytes());
        assert!(m.contains(part), "{part}: {m}");
    }
}

#[test]
fn a_bad_medit_file_is_refused_in_one_sentence() {
    let good = "MeshVersionFormatted 2\nDimension 3\nVertices 4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\nTetrahedra 1\n1 2 3 4 5\nEnd\n";
    assert!(parse("a.mesh", good.as_bytes()).is_ok());
    for (text, part) in [
        ("", "does not begin with MeshVersionFormatted"),
        (&good.replace("Dimension 3", "Dimension 2"), "has 2 dimensions; a mesh of solid cells needs 3"),
        (&good.replace("Vertices 4", "Vertices 4444"), "it says that it has 4444 vertices, but only"),
        (&good.replace("Vertices 4", "Vertices 5"), "line 8 has 'Tetrahedra' where a number should stand, in Vertices"),
        (&good.replace("Vertices 4", "Vertices 3"), "line 7 has '0' where a keyword such as Vertices should stand"),
        (&good.replace("Tetrahedra 1", "Tetrahedra 9999999999999"), "it says that it has 9999999999999 cells"),
        (&good.replace("1 2 3 4 5", "0 2 3 4 5"), "solid cell 1 names point 0, but there are only the points 1 to 4"),
        (&good.replace("1 2 3 4 5", "-1 2 3 4 5"), "a cell names point -1; points count from 1"),
        (&good.replace("1 2 3 4 5", "1 2 3 2 5"), "solid cell 1 names point 2 twice"),
        (&good.replace("1 2 3 4 5", "1 2 3 4 5e9"), "line 9 has '5e9' where a whole number should stand"),
        (&good.replace("1 2 3 4 5", "1 2 3 4 5000000000"), "the reference 5000000000, which does not fit 32 bits"),
        (&good.replace("0 1 0 0", "0 NaN 0 0"), "point 3 lies at (0, NaN, 0)"),
    ] {
        let m = message("a.mesh", text.as_bytes());
        assert!(m.contains(part), "{part}: {m}");
    }
    let good = meshb(3, false);
    let with = |at: usize, value: i64, wide: bool| {
        let mut bytes = good.clone();
        let new = value.to_le_bytes();
        bytes[at..at + if wide { 8 } else { 4 }].copy_from_slice(&new[..if wide { 8 } else { 4 }]);
        bytes
    };
    // 0: order, 4: version, 8: Dimension with its end at 12 and the dimension at 20, 24: Vertices, end at 28, count at 36
    for (bytes, part) in [
        (with(4, 9, false), "is of version 9 of Medit's binary format; it must be 1 to 4"),
        (with(20, 2, false), "has 2 dimensions"),
        (with(12, -8, true), "its keyword 3 is said to end at byte -8"),
        (with(12, 1 << 40, true), "is said to end at byte 1099511627776"),
        (with(28, 30, true), "its keyword 4 is said to end at byte 30"),
        (with(36, i64::from(i32::MAX), false), "it says that it has 2147483647 vertices, but only"),
        (with(36, -1, false), "it says that it has -1 vertices"),
    ] {
        let m = message("a.meshb", &bytes);
        assert!(m.contains(part), "{part}: {m}");
    }
}

#[test]
fn a_bad_tetgen_pair_is_refused_in_one_sentence() {
    let (node, ele) = ("4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n", "1 4 0\n0 0 1 2 3\n");
    assert!(parse("a.node", format!("{node}\0{ele}").as_bytes()).is_ok());
    let nodes = |from: &str, to: &str| format!("{}\0{ele}", node.replacen(from, to, 1));
    let eles = |from: &str, to: &str| format!("{node}\0{}", ele.replacen(from, to, 1));
    for (text, part) in [
        (nodes("4 3", "4 2"), "has points of 2 dimensions; a mesh of tetrahedra needs 3"),
        (nodes("0 0\n", "0 2\n"), "says that each point has 2 boundary markers"),
        (nodes("4 3", "4000000000 3"), "it says that it has 4000000000 points, but only"),
        (nodes("3 0 0", "3 18446744073709551615 0"), "it says that it has 4 points, but only"),
        (nodes("4 3", "5 3"), "it says that it has 5 points, but only"),
        (nodes("4 3", "3 3"), "line 5 has '3' behind the last of its points"),
        (nodes("\n2 0", "\n1 0"), "line 4 has the number 1 for a point where it must be 2"),
        (nodes("\n0 0", "\n7 0"), "line 2 has the number 7 for a point where it must be 0 or 1"),
        (nodes("1 1 0 0", "1 inf 0 0"), "point 1 lies at (inf, 0, 0)"),
        (eles("1 4 0", "1 8 0"), "has elements of 8 points; tetrahedra have 4 or 10"),
        (eles("1 4 0", "99999999999999 4 0"), "it says that it has 99999999999999 tetrahedra, but only"),
        (eles("1 2 3\n", "1 2 4\n"), "solid cell 1 names point 4, but there are only the points 0 to 3"),
        (eles("1 2 3\n", "1 2 1\n"), "solid cell 1 names point 1 twice"),
        (eles("1 2 3\n", "1 2 -3\n"), "line 2 has '-3' where a whole number should stand"),
        (eles("1 2 3\n", "1 2 3"), "ends in the middle of a line; the file is cut off"),
    ] {
        let m = message("a.node", text.as_bytes());
        assert!(m.contains(part), "{part}: {m}");
    }
}

#[test]
fn missing_empty_and_foreign_files_are_named() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    for name in ["a.vtu", "a.vtk", "a.msh", "a.mesh", "a.meshb", "a.node", "a.ele"] {
        let path = dir.path().join(name);
        let e = read_tets(&path).expect_err("refused");
        assert!(matches!(e, IoError::System { .. }) && e.to_string().contains(": cannot read"), "{e}");
        std::fs::write(&path, b"").expect("written");
        let e = read_tets(&path).expect_err("refused").to_string();
        assert!(e.contains("the file is empty; a mesh needs points and cells") || e.contains("beside it"), "{e}");
        std::fs::remove_file(&path).expect("removed");
    }
    assert!(kind_of(&dir.path().join("none.vtk")).is_err());
    assert!(kind_of(Path::new("none.doc")).expect("by name alone").is_none());
    assert!(matches!(read_volume(&dir.path().join("none.vti")), Err(IoError::System { .. })));
    assert!(TetMesh::default().bounds().is_none());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn noise_never_panics(noise in proptest::collection::vec(any::<u8>(), 0..300)) {
        for (name, prefix) in [
            ("a.vtu", "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"4\" NumberOfCells=\"1\"><Points><DataArray type=\"Float32\" format=\"binary\">"),
            ("a.vtu", "<VTKFile type=\"UnstructuredGrid\" "),
            ("a.vtk", "# vtk DataFile Version 3.0\nx\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 2 unsigned_char\n"),
            ("a.vtk", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nCELLS "),
            ("a.msh", "$MeshFormat\n4.1 1 8\n\u{1}\0\0\0\n$EndMeshFormat\n$Nodes\n"),
            ("a.msh", "$MeshFormat\n2.2 1 8\n\u{1}\0\0\0\n$EndMeshFormat\n$Elements\n3\n"),
            ("a.msh", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Elements\n"),
            ("a.mesh", "MeshVersionFormatted 1\nVertices "),
            ("a.meshb", "\u{1}\0\0\0\u{2}\0\0\0"),
            ("a.node", "2 3 0 0\n"),
        ] {
            let mut bytes = prefix.as_bytes().to_vec();
            bytes.extend_from_slice(&noise);
            if let Ok(mesh) = parse(name, &bytes) {
                sound(mesh);
            }
        }
    }
}

//! VTK's volumes: XML images and legacy structured points.

use std::path::Path;

use glam::{DAffine3, DMat3, DVec3};
use voxclay::io::{FileKind, kind_of, read_grid, read_volume, vti, vtk};
use voxclay::volume::{Samples, ScalarType};

use super::{fixture, fixture_bytes};

/// The samples of the fixtures count up by three from one.
fn counts_up(samples: &Samples, what: &str) {
    for i in 0..samples.len() {
        let expected = (3 * i + 1) as f64;
        assert_eq!(samples.get(i), expected, "{what}: sample {i}");
    }
}

#[test]
fn images_of_every_encoding_have_their_samples_and_frame() {
    // rows 0 -1 0, 1 0 0, 0 0 1: the first axis runs along y, the second against x
    let turned = DMat3::from_cols(0.5 * DVec3::Y, -DVec3::X, 2.0 * DVec3::Z);
    let straight = DMat3::from_diagonal(DVec3::new(0.5, 1.0, 2.0));
    let origin = DVec3::new(1.0, 2.0, 3.0);
    for (name, kind, channels, dims, axes, origin) in [
        ("image_ascii.vti", ScalarType::F32, 1, [4, 3, 2], turned, origin),
        ("image_inline_be32.vti", ScalarType::I16, 1, [4, 3, 2], turned, origin),
        // the extent is 2 5 -1 1 4 5
        ("image_raw_zlib64.vti", ScalarType::U8, 3, [4, 3, 2], turned, origin + turned * DVec3::new(2.0, -1.0, 4.0)),
        // at the cells
        ("image_base64.vti", ScalarType::F64, 1, [3, 2, 1], turned, origin + turned * DVec3::splat(0.5)),
        ("points_ascii.vtk", ScalarType::I16, 1, [4, 3, 2], straight, origin),
        ("points_binary.vtk", ScalarType::I16, 1, [4, 3, 2], straight, origin),
    ] {
        let path = fixture(name);
        assert_eq!(kind_of(&path).expect(name), Some(FileKind::Volume), "{name}");
        let volume = read_volume(&path).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((volume.grid.dims, volume.channels, volume.samples.scalar_type()), (dims, channels, kind), "{name}");
        assert_eq!(volume.grid.world_from_voxel, DAffine3::from_mat3_translation(axes, origin), "{name}");
        assert_eq!(read_grid(&path).expect(name), volume.grid);
        if kind == ScalarType::U8 {
            assert_eq!((volume.samples.len(), volume.samples.get(71)), (72, 214.0));
        }
        counts_up(&volume.samples, name);
    }
}

#[test]
fn pieces_of_an_image_are_put_together() {
    let whole = read_volume(&fixture("image_whole.vti")).expect("reads");
    assert_eq!((whole.grid.dims, whole.grid.origin()), ([4, 3, 5], DVec3::new(-1.0, 0.0, 3.0)));
    assert_eq!(read_volume(&fixture("image_pieces.vti")).expect("reads"), whole);
    // without the last; those before it reach to where it begins
    let text = String::from_utf8(fixture_bytes("image_pieces.vti")).expect("text");
    let pieces: Vec<usize> = text.match_indices("<Piece").map(|(i, _)| i).collect();
    assert_eq!(pieces.len(), 3);
    let end = text.find("</ImageData>").expect("there");
    let holed = [&text[..pieces[2]], &text[end..]].concat();
    let said = |text: &str| vti::parse(Path::new("a.vti"), text.as_bytes()).expect_err("refused").to_string();
    assert!(said(&holed).contains("its pieces do not fill its extent"));
    let beyond = text.replace("-1 2 0 2 5 7", "-1 2 0 2 6 8");
    assert!(said(&beyond).contains("a piece reaches out of the whole extent"));
    let short = text.replace("-1 2 0 2 5 7", "-1 2 0 2 5 6");
    assert!(said(&short).contains("has 36 numbers for 24 voxels of 1 channels"), "{}", said(&short));
}

#[test]
fn images_choose_their_array_and_refuse_what_they_cannot_hold() {
    let image = |body: &str| {
        format!(
            "<VTKFile type=\"ImageData\"><ImageData WholeExtent=\"0 1 0 1 0 0\"><Piece Extent=\"0 1 0 1 0 0\">{body}</Piece></ImageData></VTKFile>"
        )
    };
    let array = |name: &str, kind: &str, n: usize, text: &str| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{n}\" format=\"ascii\">{text}</DataArray>"
        )
    };
    let parse = |text: &str| vti::parse(Path::new("a.vti"), text.as_bytes());
    let (nine, a, b) = (
        array("nine", "Float32", 9, &"1 ".repeat(36)),
        array("a", "UInt8", 1, "1 2 3 4"),
        array("b", "Int8", 2, "-1 2 -3 4 -5 6 -7 8"),
    );
    let first = parse(&image(&format!("<PointData>{nine}{a}{b}</PointData>"))).expect("reads");
    assert_eq!(first.samples, Samples::U8(vec![1, 2, 3, 4]));
    let named = parse(&image(&format!("<PointData Scalars=\"b\">{nine}{a}{b}</PointData>"))).expect("reads");
    assert_eq!((named.channels, named.samples), (2, Samples::I8(vec![-1, 2, -3, 4, -5, 6, -7, 8])));
    for (body, part) in [
        (format!("<PointData>{nine}</PointData>"), "has no array of 1 to 4 numbers for each point or each cell"),
        (format!("<PointData>{}</PointData>", array("a", "UInt8", 1, "1 2 3")), "has 3 numbers for 4 voxels"),
        (format!("<PointData>{}</PointData>", array("a", "UInt8", 1, "1 2 3 256")), "has '256' where a whole number"),
        (format!("<PointData>{}</PointData>", array("a", "Int64", 1, "1 2 3 4")), "has 64-bit integers"),
        (format!("<CellData>{a}</CellData>"), "a grid of 1x1x0 voxels is empty"),
    ] {
        let said = parse(&image(&body)).expect_err("refused").to_string();
        assert!(said.contains(part), "{said}");
    }
    let long = read_volume(&fixture("image_long.vti")).expect_err("refused").to_string();
    assert!(long.contains("its array 's' has 64-bit integers; Voxclay reads integers of up to 32 bits"), "{long}");
    let mesh = read_volume(&fixture("legacy42_ascii.vtk")).expect_err("refused").to_string();
    assert!(mesh.contains("holds cells (UNSTRUCTURED_GRID), but a volume is wanted here"), "{mesh}");
    let grid = vti::parse(Path::new("a.vti"), &fixture_bytes("ascii.vtu")).expect_err("refused").to_string();
    assert!(grid.contains("holds 'UnstructuredGrid', but ImageData is wanted here"), "{grid}");
}

#[test]
fn structured_points_of_cells_and_of_lying_sizes() {
    let file = |rest: &str| {
        format!(
            "# vtk DataFile Version 2.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 2 2\nASPECT_RATIO 2 1 1\nORIGIN 0 0 5\n{rest}"
        )
    };
    let parse = |rest: &str| vtk::parse_volume(Path::new("a.vtk"), file(rest).as_bytes());
    let cells = parse("CELL_DATA 2\nSCALARS s unsigned_char\nLOOKUP_TABLE default\n7 9\n").expect("reads");
    assert_eq!((cells.grid.dims, cells.grid.origin()), ([2, 1, 1], DVec3::new(1.0, 0.5, 5.5)));
    assert_eq!(cells.samples, Samples::U8(vec![7, 9]));
    // scalars come before other arrays
    let twelve = "1 2 3 4 5 6 7 8 9 10 11 12\n";
    let both =
        format!("POINT_DATA 12\nFIELD f 1\nother 1 12 float\n{twelve}SCALARS s short\nLOOKUP_TABLE default\n{twelve}");
    assert_eq!(parse(&both).expect("reads").samples.scalar_type(), ScalarType::I16);
    for (rest, part) in [
        (
            "POINT_DATA 11\nSCALARS s int\nLOOKUP_TABLE default\n1 2 3 4 5 6 7 8 9 10 11\n",
            "has 11 numbers for 12 voxels",
        ),
        ("", "a volume needs samples"),
        ("POINT_DATA 12\nSCALARS s int\n1 2 3", "should name a LOOKUP_TABLE"),
        ("SCALARS s int\nLOOKUP_TABLE default\n1 2 3", "it comes before POINT_DATA or CELL_DATA"),
        ("POINT_DATA 99999999999\nSCALARS s int 4\nLOOKUP_TABLE default\n1 2 3", "only 6 bytes follow"),
        (
            "POINT_DATA 12\nSCALARS s complex\nLOOKUP_TABLE default\n1 2 3",
            "numbers of type 'complex', which is none of VTK's",
        ),
    ] {
        let said = parse(rest).expect_err("refused").to_string();
        assert!(said.contains(part), "{rest}: {said}");
    }
}

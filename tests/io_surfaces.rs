//! Reading and writing surfaces: variants of the formats, bad files, and the real meshes.

use std::path::{Path, PathBuf};

use glam::DVec3;
use proptest::prelude::*;
use voxclay::io::{IoError, is_surface_path, obj, ply, read_surface, read_surface_as_stored, stl, write_surface};
use voxclay::mesh::{Topology, TriMesh, primitives};

type Parse = fn(&Path, &[u8]) -> Result<TriMesh, IoError>;

fn parse(name: &str, bytes: &[u8]) -> Result<TriMesh, IoError> {
    let path = Path::new(name);
    match path.extension().and_then(|e| e.to_str()) {
        Some("obj") => obj::parse(path, bytes),
        Some("stl") => stl::parse(path, bytes),
        _ => ply::parse(path, bytes),
    }
}

fn message(name: &str, bytes: &[u8]) -> String {
    parse(name, bytes).expect_err("should be refused").to_string()
}

fn tetrahedron() -> TriMesh {
    TriMesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
    }
}

/// Sound as a mesh: every index has its vertex, every coordinate is finite.
fn sound(mesh: &TriMesh) {
    assert!(mesh.positions.iter().all(|p| p.is_finite()) && !mesh.triangles.is_empty());
    Topology::build(mesh.positions.len(), &mesh.triangles).sanity_check(&mesh.triangles);
}

fn bytes_of(name: &str, mesh: &TriMesh) -> Vec<u8> {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let path = dir.path().join(name);
    write_surface(&path, mesh).expect("written");
    std::fs::read(&path).expect("there")
}

// ---------------------------------------------------------------- OBJ

#[test]
fn obj_takes_every_form_of_a_corner_and_several_objects() {
    let text = "\u{feff}# a comment\nmtllib none.mtl\no first\r\nv 0 0 0\nv 1 0 0 1.0\nv\t0 1 0 0.5 0.5 0.5\nvt 0 0\nvn 0 0 1\n\
                usemtl red\ns off\nf 1 3/1 2/1/1\n  o second\nv 0 0 1e0\nf 1//1 2 -1\nf -3/-1/-1 -2/1 -1 # tail\n\
                f 3 1 \\\n 4\nl 1 2\nunknown x\n";
    assert_eq!(parse("a.obj", text.as_bytes()).expect("reads"), tetrahedron());
    // no newline at the end
    assert_eq!(parse("a.obj", text.trim_end().as_bytes()).expect("reads"), tetrahedron());
    // faces may come before their vertices
    let turned = "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
    assert_eq!(parse("a.obj", turned.as_bytes()).expect("reads"), tetrahedron());
}

#[test]
fn polygons_become_triangles_that_tile_them() {
    let square = parse("a.obj", b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n").expect("reads");
    assert_eq!(square.triangles, [[0, 1, 2], [0, 2, 3]]);
    // an L, where a fan from the first corner would leave the face
    let l = b"v 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nv 0 0 0\nf 1 2 3 4 5 6\n";
    let l = parse("a.obj", l).expect("reads");
    assert_eq!((l.triangles.len(), l.area()), (4, 3.0));
}

#[test]
fn a_bad_obj_is_refused_in_one_sentence() {
    for (text, part) in [
        ("", "a.obj: there is no vertex"),
        ("hello world\n", "there is no vertex"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "3 vertices but no face"),
        ("v 0 0\nf 1 1 1\n", "line 1: a vertex needs three coordinates"),
        ("v 0 0 0\nv 0 x 0\n", "line 2: 'x' is not a coordinate"),
        ("v 0 0 0\nf 1 1 2\n", "face 1 names vertex 2 of only 1"),
        ("v 0 0 0\nf 1 1 -2\n", "line 2: '-2' names no vertex"),
        ("v 0 0 0\nf 0 1 1\n", "'0' names no vertex; a corner is an index from 1"),
        ("v 0 0 0\nf 1 1 99999999999\n", "face 1 names vertex 4294967296 of only 1"),
        ("v 0 0 0\nf 1 1 99999999999999999999\n", "names no vertex"),
        ("v 0 0 0\nf 1 a 1\n", "'a' names no vertex"),
        ("v 0 0 0\nf 1 1\n", "line 2: face 1 has 2 corners; a face needs at least 3"),
        ("v nan 0 0\nf 1 1 1\n", "vertex 1 lies at (NaN, 0, 0); coordinates must be finite"),
        ("v 0 1e999 0\nf 1 1 1\n", "coordinates must be finite"),
        ("v 0 1e95 0\nf 1 1 1\n", "below 1e90"),
    ] {
        let m = message("a.obj", text.as_bytes());
        assert!(m.contains(part), "{text:?}: {m}");
        assert!(!m.contains('\n'));
    }
}

// ---------------------------------------------------------------- STL

const FACET: &str =
    "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 0 1 0\n endloop\nendfacet\n";

#[test]
fn ascii_stl_takes_tabs_capitals_several_solids_and_no_name() {
    let one = [DVec3::ZERO, DVec3::X, DVec3::Y];
    for text in [
        format!("solid\n{FACET}endsolid\n"),
        format!("solid\tmany words facet vertex\n{FACET}endsolid many words"),
        format!("SOLID X\r\n{}ENDSOLID", FACET.to_uppercase().replace('\n', "\r\n")),
        format!("\n  solid a\n{}endsolid a\n", FACET.replace("normal 0 0 1", "normal nan nan nan")),
    ] {
        let m = parse("a.stl", text.as_bytes()).expect(&text);
        assert_eq!((m.positions.as_slice(), m.triangles.as_slice()), (&one[..], &[[0, 1, 2]][..]));
    }
    let two = format!("solid a\n{FACET}endsolid a\nsolid b\n{FACET}{FACET}endsolid b\n");
    assert_eq!(parse("a.stl", two.as_bytes()).expect("reads").triangles, [[0, 1, 2], [3, 4, 5], [6, 7, 8]]);
}

#[test]
fn binary_stl_is_known_by_its_size_not_by_its_first_word() {
    let mut bytes = bytes_of("a.stl", &tetrahedron());
    assert_eq!(bytes.len(), 84 + 4 * 50);
    assert!(!bytes.starts_with(b"solid"));
    bytes[..5].copy_from_slice(b"solid");
    let m = parse("a.stl", &bytes).expect("reads");
    assert_eq!(
        (m.positions.len(), m.welded()),
        (12, {
            let mut t = tetrahedron();
            // in the order in which the triangles name them
            t.positions.swap(1, 2);
            t.triangles.iter_mut().flatten().for_each(|v| *v = [0, 2, 1, 3][*v as usize]);
            t
        })
    );
    // the stored normal is that of the triangle
    let normal: Vec<f32> = bytes[84..96].chunks(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    assert_eq!(normal, [0.0, 0.0, -1.0]);
}

#[test]
fn reading_stl_welds_and_as_stored_does_not() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let path = dir.path().join("ball.STL");
    let ball = primitives::geodesic_sphere(3);
    write_surface(&path, &ball).expect("written");
    let (welded, stored) = (read_surface(&path).expect("reads"), read_surface_as_stored(&path).expect("reads"));
    assert_eq!((welded.positions.len(), stored.positions.len()), (92, 540));
    assert!(Topology::build(92, &welded.triangles).is_closed());
    assert!(is_surface_path(&path));
}

#[test]
fn a_bad_stl_is_refused_in_one_sentence() {
    let binary = bytes_of("a.stl", &tetrahedron());
    let mut lying = binary.clone();
    lying[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let mut none = binary[..84].to_vec();
    none[80..84].fill(0);
    let mut nan = binary.clone();
    nan[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
    let broken = format!("solid a\n{FACET}{}", &FACET[..60]);
    for (bytes, part) in [
        (&binary[..200], "says 4 triangles, which take 284 bytes, but the file has 200"),
        (&lying, "says 4294967295 triangles, which take 214748364834 bytes"),
        (&none, "there is no vertex"),
        (&nan, "vertex 1 lies at (NaN, 0, 0)"),
        (&binary[..20], "neither binary STL (too short"),
        (b"solid\n", "there is no vertex"),
        (broken.as_bytes(), "breaks off in the facet at line 9"),
        (b"solid a\nfacet normal 0 0 1\nvertex 1 2\nendfacet", "line 4 has 'endfacet' where a number should stand"),
        (b"solid a\nfacet normal 0 0 1\nvertex 1 2 3\nendfacet", "face 1 has 1 corner; a face needs at least 3"),
        (b"solid a\nvertex 1 2", "breaks off at line 2"),
        (b"solid a\nfacet\nfacet", "the facet at line 2 has no 'endfacet'"),
        (b"solid a\nendfacet", "line 2 ends a facet that was not begun"),
        (b"solid a\nv 1 2 3", "line 2 has 'v', which is no word of ascii STL"),
    ] {
        let m = message("a.stl", bytes);
        assert!(m.starts_with("a.stl: ") && m.contains(part), "{m}");
    }
}

// ---------------------------------------------------------------- PLY

/// A PLY file with awkward properties and elements; `put` writes a number of a type.
fn ply_of(format: &str) -> Vec<u8> {
    let mut out = format!(
        "ply\nformat {format} 1.0\ncomment a b c\nobj_info d\nelement camera 2\nproperty float f\nproperty list short double d\n\
         element nothing 1000000000000\nelement vertex 5\nproperty uchar red\nproperty double z\nproperty list uchar int skip\nproperty short y\n\
         property float32 x\nelement edge 0\nproperty int a\nelement face 2\nproperty float quality\nproperty list uint16 uint vertex_index\n\
         property list uchar float texcoord\nend_header\n"
    )
    .into_bytes();
    let mut put = |kind: &str, x: f64| match (format, kind) {
        ("ascii", _) => out.extend(format!("{x} ").bytes()),
        ("binary_big_endian", "u8") => out.push(x as u8),
        ("binary_big_endian", "u16") => out.extend((x as u16).to_be_bytes()),
        ("binary_big_endian", "i16") => out.extend((x as i16).to_be_bytes()),
        ("binary_big_endian", "i32") => out.extend((x as i32).to_be_bytes()),
        ("binary_big_endian", "f32") => out.extend((x as f32).to_be_bytes()),
        ("binary_big_endian", _) => out.extend(x.to_be_bytes()),
        (_, "u8") => out.push(x as u8),
        (_, "u16") => out.extend((x as u16).to_le_bytes()),
        (_, "i16") => out.extend((x as i16).to_le_bytes()),
        (_, "i32") => out.extend((x as i32).to_le_bytes()),
        (_, "f32") => out.extend((x as f32).to_le_bytes()),
        _ => out.extend(x.to_le_bytes()),
    };
    for n in [3, 0] {
        put("f32", 0.5);
        put("i16", f64::from(n));
        (0..n).for_each(|i| put("f64", f64::from(i) * 1e10));
    }
    for (x, y, z) in [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, -300.0, 0.0), (0.0, -300.0, 0.0), (0.5, 0.0, 0.1)] {
        put("u8", 200.0);
        put("f64", z);
        put("u8", 2.0);
        put("i32", -7.0);
        put("i32", 70000.0);
        put("i16", y);
        put("f32", x);
    }
    for face in [&[0.0, 1.0, 2.0, 3.0][..], &[4.0, 1.0, 0.0]] {
        put("f32", 1.0);
        put("u16", face.len() as f64);
        face.iter().for_each(|&v| put("i32", v));
        put("u8", 1.0);
        put("f32", 0.25);
    }
    out
}

#[test]
fn ply_reads_the_same_from_text_and_both_byte_orders() {
    let expected = TriMesh {
        positions: [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, -300.0, 0.0], [0.0, -300.0, 0.0], [0.5, 0.0, 0.1]]
            .map(DVec3::from_array)
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [4, 1, 0]],
    };
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        assert_eq!(parse("a.ply", &ply_of(format)).expect(format), expected, "{format}");
    }
    // lines may end in CR LF and CR as well
    let text = String::from_utf8(ply_of("ascii")).expect("text");
    for newline in ["\r\n", "\r"] {
        assert_eq!(parse("a.ply", text.replace('\n', newline).as_bytes()).expect("reads"), expected);
    }
}

#[test]
fn a_bad_ply_is_refused_in_one_sentence() {
    let head = "ply\nformat ascii 1.0\n";
    let vertex = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
    let face = "element face 1\nproperty list uchar int vertex_indices\n";
    for (text, part) in [
        ("ply".to_owned(), "breaks off at line 1; a PLY file begins with the line 'ply'"),
        ("v 0 0 0\n".to_owned(), "line 1 of the header reads 'v 0 0 0'"),
        (head.to_owned(), "the header breaks off at line 3; it must end in 'end_header'"),
        (format!("{head}end_header\n"), "no element 'vertex'"),
        (format!("ply\n{vertex}{face}end_header\n"), "no line 'format'"),
        ("ply\nformat binary 1.0\n".to_owned(), "should be ascii, binary_little_endian"),
        (format!("{head}element vertex -1\n"), "the count should be a whole number"),
        (format!("{head}property float x\n"), "no element comes before it"),
        (format!("{head}element vertex 1\nproperty float128 x\n"), "that is no type of PLY"),
        (format!("{head}element vertex 1\nproperty float x\n{face}end_header\n0"), "no property 'y'"),
        (format!("{head}{vertex}end_header\n0 0 0"), "no element 'face'"),
        (format!("{head}{vertex}element face 1\nproperty int a\nend_header\n"), "no list 'vertex_indices'"),
        (
            format!("{head}{}{face}end_header\n0 0 0\n", vertex.replace('1', "4000000000")),
            "says 4000000000 of element 'vertex', but only 6 bytes follow",
        ),
        (format!("{head}{vertex}{face}end_header\n0 0 0\n"), "at face 1: the file breaks off at line 10"),
        (
            format!("{head}{vertex}{face}end_header\n0 0 zero\n3 0 0 0\n"),
            "at vertex 1: line 10 has 'zero' where a number",
        ),
        (format!("{head}{vertex}{face}end_header\n0 0 0\n3 0 0 1\n"), "face 1 names vertex 2 of only 1"),
        (format!("{head}{vertex}{face}end_header\n0 0 0\n3 0 0 -1\n"), "a corner names vertex -1"),
        (format!("{head}{vertex}{face}end_header\n0 0 0\n-3 0 0 0\n"), "a list has the length -3"),
        (format!("{head}{vertex}{face}end_header\n0 0 0\n2 0 0\n"), "face 1 has 2 corners"),
        (format!("{head}{vertex}{face}end_header\n0 0 nan\n3 0 0 0\n"), "coordinates must be finite"),
        (format!("{head}{vertex}{}end_header\n0 0 0\n", face.replace("face 1", "face 0")), "1 vertices but no face"),
    ] {
        let m = message("a.ply", text.as_bytes());
        assert!(m.starts_with("a.ply: ") && m.contains(part), "{text:?}: {m}");
        assert!(!m.contains('\n'));
    }
}

// ---------------------------------------------------------------- all

#[test]
fn what_is_written_reads_back_bit_for_bit() {
    let mut odd = primitives::bumpy_sphere(3);
    odd.positions[0] = DVec3::new(-0.0, f64::MIN_POSITIVE, 1e-310);
    odd.positions[1] = DVec3::new(1e89, -1.0 / 3.0, std::f64::consts::PI);
    odd.positions.push(DVec3::splat(7.0));
    let bits = |m: &TriMesh| m.positions.iter().map(|p| p.to_array().map(f64::to_bits)).collect::<Vec<_>>();
    for name in ["a.obj", "a.ply"] {
        let back = parse(name, &bytes_of(name, &odd)).expect(name);
        assert_eq!((bits(&back), &back.triangles), (bits(&odd), &odd.triangles), "{name}");
    }
    // STL keeps what fits 32 bits
    let mut single = primitives::bumpy_sphere(3);
    single.positions.iter_mut().for_each(|p| *p = p.as_vec3().as_dvec3());
    let soup: Vec<DVec3> = single.triangles.iter().flatten().map(|&v| single.positions[v as usize]).collect();
    let back = parse("a.stl", &bytes_of("a.stl", &single)).expect("reads");
    assert_eq!(back.positions, soup);
}

#[test]
fn what_cannot_be_written_leaves_nothing_behind() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let mut mesh = tetrahedron();
    let fails = |name: &str, mesh: &TriMesh, part: &str| {
        let m = write_surface(&dir.path().join(name), mesh).expect_err("refused").to_string();
        assert!(m.contains(part), "{m}");
    };
    fails("a.txt", &mesh, "the name does not end in a surface format; use .obj, .stl, .ply or .glb");
    fails("missing/a.obj", &mesh, "cannot write");
    mesh.positions[2].x = 1e40;
    fails("a.stl", &mesh, "vertex 3 is too large for the 32-bit numbers of STL");
    mesh.positions[2].x = f64::NAN;
    for name in ["a.obj", "a.stl", "a.ply"] {
        fails(name, &mesh, "vertex 3 is not finite");
    }
    assert_eq!(std::fs::read_dir(dir.path()).expect("there").count(), 0);
}

#[test]
fn missing_empty_and_foreign_files_are_named() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let m = read_surface(&dir.path().join("none.ply")).expect_err("refused");
    assert!(matches!(m, IoError::System { .. }) && m.to_string().contains("none.ply: cannot read"));
    for name in ["empty.obj", "empty.stl", "empty.ply"] {
        let path = dir.path().join(name);
        std::fs::write(&path, b"").expect("written");
        let m = read_surface(&path).expect_err("refused").to_string();
        assert!(m.contains("the file is empty; a surface needs vertices and faces"), "{m}");
    }
    assert!(
        !is_surface_path(Path::new("a.nii"))
            && !is_surface_path(Path::new("obj"))
            && is_surface_path(Path::new("A.Ply"))
    );
    assert!(matches!(read_surface(Path::new("a.nii")), Err(IoError::Unsupported { .. })));
}

fn fixtures() -> Vec<(&'static str, Vec<u8>)> {
    let ball = primitives::geodesic_sphere(1);
    vec![
        ("a.obj", bytes_of("a.obj", &ball)),
        ("a.stl", bytes_of("a.stl", &ball)),
        ("b.stl", format!("solid a\n{FACET}{FACET}endsolid\n").into_bytes()),
        ("a.ply", bytes_of("a.ply", &ball)),
        ("b.ply", ply_of("ascii")),
        ("c.ply", ply_of("binary_big_endian")),
    ]
}

#[test]
fn every_cut_of_every_format_is_sound_or_refused() {
    for (name, bytes) in fixtures() {
        let mut refused = 0;
        for len in 0..bytes.len() {
            match parse(name, &bytes[..len]) {
                Ok(mesh) => sound(&mesh),
                Err(e) => {
                    refused += 1;
                    assert!(e.to_string().starts_with(name) && !e.to_string().contains('\n'), "{e}");
                }
            }
        }
        // text may be cut between two faces without a trace; what states its counts may not (but for unused bytes)
        let binary = ["a.stl", "a.ply", "c.ply"].contains(&name);
        assert!(if binary { refused == bytes.len() } else { refused > bytes.len() / 4 }, "{name} {refused}");
    }
}

#[test]
fn every_flipped_byte_is_sound_or_refused() {
    for (name, bytes) in fixtures() {
        // all of the header, and every seventh byte of the rest
        for at in (0..bytes.len()).filter(|at| *at < 400 || at % 7 == 0) {
            for flip in [0x01, 0x10, 0x80, 0xFF] {
                let mut bad = bytes.clone();
                bad[at] ^= flip;
                if let Ok(mesh) = parse(name, &bad) {
                    sound(&mesh);
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn noise_never_panics(noise in proptest::collection::vec(any::<u8>(), 0..300)) {
        for (name, prefix) in [
            ("a.obj", "v 1 2 3\nf "),
            ("a.stl", "solid "),
            ("a.stl", ""),
            ("a.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"),
            ("a.ply", "ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty char x\nproperty char y\nproperty char z\n\
                       element face 9\nproperty list char char vertex_indices\nend_header\n"),
        ] {
            let mut bytes = prefix.as_bytes().to_vec();
            bytes.extend_from_slice(&noise);
            if let Ok(mesh) = parse(name, &bytes) {
                sound(&mesh);
            }
        }
    }
}

#[test]
fn a_header_that_lies_about_its_size_costs_no_memory() {
    // would be 96 GB if it were believed; refused before anything is set aside
    let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 4294967295\nproperty double x\nproperty double y\nproperty double z\n\
               element face 4294967295\nproperty list uint int vertex_indices\nend_header\n0123456789";
    assert!(message("a.ply", ply.as_bytes()).contains("only 10 bytes follow it"));
    // a list that claims four billion entries ends where the file does
    let list = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty char x\nproperty char y\nproperty char z\n\
                element face 1\nproperty list uint int vertex_indices\nend_header\nxyz\u{7f}\u{7f}\u{7f}\u{7f}0123";
    assert!(message("a.ply", list.as_bytes()).contains("at face 1: the file breaks off in its data"));
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn real_meshes_write_and_read_back() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let mut files: Vec<PathBuf> = std::fs::read_dir("../shared/data/meshes")
        .expect("there")
        .map(|e| e.expect("readable").path())
        .filter(|p| is_surface_path(p))
        .collect();
    files.sort();
    assert_eq!(files.len(), 12);
    for file in files {
        let mesh = read_surface(&file).expect("reads");
        for name in ["back.obj", "back.ply"] {
            let path = dir.path().join(name);
            write_surface(&path, &mesh).expect("written");
            assert_eq!(read_surface(&path).expect("reads"), mesh, "{} as {name}", file.display());
        }
        let path = dir.path().join("back.stl");
        write_surface(&path, &mesh).expect("written");
        let mut single = mesh.clone();
        single.positions.iter_mut().for_each(|p| *p = p.as_vec3().as_dvec3());
        let soup: Vec<DVec3> = single.triangles.iter().flatten().map(|&v| single.positions[v as usize]).collect();
        assert_eq!(read_surface_as_stored(&path).expect("reads").positions, soup, "{}", file.display());
        // and STL read from STL comes back as it was
        let once = read_surface(&path).expect("reads");
        write_surface(&path, &once).expect("written");
        assert_eq!(read_surface(&path).expect("reads"), once, "{}", file.display());
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn real_meshes_cut_anywhere_are_sound_or_refused() {
    for file in ["two_balls.obj", "torus.stl", "fixed_top.ply", "dirty_sphere_with_hole.stl", "dirty_bunny_open.ply"] {
        let bytes = std::fs::read(Path::new("../shared/data/meshes").join(file)).expect("there");
        let parse: Parse = if file.ends_with("obj") {
            obj::parse
        } else if file.ends_with("stl") {
            stl::parse
        } else {
            ply::parse
        };
        for i in 0..12 {
            if let Ok(mesh) = parse(Path::new(file), &bytes[..bytes.len() * i / 12 + i]) {
                assert!(!file.ends_with("torus.stl") && !file.ends_with("ply"), "{file}");
                sound(&mesh);
            }
        }
    }
}

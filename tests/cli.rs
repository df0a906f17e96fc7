//! The command line as a contract: JSON keys, exit codes, one sentence for what is wrong, nothing half-written.

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn voxclay(dir: &TempDir, args: &[&str]) -> Output {
    Command::cargo_bin("voxclay").unwrap().current_dir(dir.path()).args(args).output().unwrap()
}

fn json(dir: &TempDir, args: &[&str]) -> Value {
    let mut all = args.to_vec();
    all.push("--json");
    let out = voxclay(dir, &all);
    assert!(out.status.success(), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap_or_else(|e| panic!("{args:?}: not one JSON object: {e}"))
}

/// The work fails with exit code 1 and one sentence that holds all of `words`.
fn fails(dir: &TempDir, args: &[&str], words: &[&str]) {
    let out = voxclay(dir, args);
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(1), "{args:?}: {said}");
    assert!(out.stdout.is_empty(), "{args:?} wrote to stdout");
    let lines: Vec<&str> = said.lines().filter(|l| l.starts_with("voxclay:")).collect();
    assert_eq!(lines.len(), 1, "{args:?}: {said}");
    for word in words {
        assert!(lines[0].contains(word), "{args:?}: '{}' does not say '{word}'", lines[0]);
    }
    assert!(!said.contains("panicked") && !said.contains("internal error"), "{args:?}: {said}");
}

fn exists(dir: &TempDir, name: &str) -> bool {
    dir.path().join(name).exists()
}

fn left_over(dir: &TempDir) -> Vec<String> {
    let names = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
    names.filter(|n| n.contains(".part")).collect()
}

fn has_keys(value: &Value, keys: &[&str]) {
    for key in keys {
        assert!(!value[key].is_null(), "no key '{key}' in {value}");
    }
}

const PROJECT: &str = r#"{ "voxclay": 1, "document": {
    "volume": { "phantom": { "name": "sphere", "size": 40 } },
    "stack": [ { "name": "pull", "deformer": { "tool": "displacement",
        "point": [0, 0, 0], "vector": [6, 0, 3], "extent": { "u": 30, "v": 30, "length": 90 } } } ] } }"#;

#[test]
fn every_verb_has_help_with_an_example() {
    let dir = TempDir::new().unwrap();
    for verb in ["app", "info", "convert", "slice", "render", "export", "surface", "compare", "demo"] {
        let out = voxclay(&dir, &[verb, "--help"]);
        assert_eq!(out.status.code(), Some(0));
        let text = String::from_utf8_lossy(&out.stdout).into_owned();
        assert!(text.contains("Example: voxclay"), "{verb}: {text}");
    }
}

/// Where there is no display the modeller says so in a sentence that tells what works all the same.
#[cfg(target_os = "linux")]
#[test]
fn a_window_without_a_display_is_one_sentence() {
    for args in [&["app"][..], &[]] {
        let mut command = Command::cargo_bin("voxclay").unwrap();
        for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
            command.env_remove(name);
        }
        let out = command.args(args).timeout(std::time::Duration::from_secs(60)).output().unwrap();
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(1), "{said}");
        assert!(said.contains("voxclay demo") && !said.contains("panicked"), "{said}");
    }
}

#[test]
fn bad_usage_is_2() {
    let dir = TempDir::new().unwrap();
    for args in [
        &["frobnicate"][..],
        &["info"],
        &["render", "phantom:sphere:24", "--size", "0x10", "-o", "a.png"],
        &["render", "phantom:sphere:24", "--size", "10", "-o", "a.png"],
        &["render", "phantom:sphere:24", "--slices", "0", "-o", "a.png"],
        &["slice", "x.obj", "--direction", "1,2"],
        &["slice", "x.obj", "--planes", "-1"],
    ] {
        assert_eq!(voxclay(&dir, args).status.code(), Some(2), "{args:?}");
    }
    assert!(!exists(&dir, "a.png"));
}

#[test]
fn info_convert_and_back() {
    let dir = TempDir::new().unwrap();
    let first = json(&dir, &["info", "phantom:head:40"]);
    has_keys(&first, &["kind", "dims", "type", "channels", "spacing", "origin", "direction", "min", "max", "mean"]);
    assert_eq!(first["kind"], "volume");
    let mut from = "phantom:head:40".to_owned();
    for to in ["a.nrrd", "b.nii.gz", "c.mha", "d.nhdr", "e.nii", "f.mhd", "g.raw"] {
        json(&dir, &["convert", &from, to]);
        let facts = json(&dir, &["info", to]);
        for key in ["dims", "type", "channels", "min", "max", "mean"] {
            assert_eq!(facts[key], first[key], "{key} of {to}");
        }
        from = to.to_owned();
    }
    let both = json(&dir, &["info", "a.nrrd", "c.mha"]);
    assert_eq!(both["files"].as_array().unwrap().len(), 2);
    assert!(left_over(&dir).is_empty());
}

/// Facts of a tetrahedral mesh stay the same through all formats; vectors are left out with a warning where they must be.
#[test]
fn tetrahedral_meshes_have_facts_and_change_format() {
    let dir = TempDir::new().unwrap();
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n$EndNodes\n\
                $Elements\n2\n1 4 2 7 1 1 2 3 4\n2 4 2 8 1 2 3 4 5\n$EndElements\n\
                $NodeData\n1\n\"deformed\"\n0\n3\n0\n3\n5\n1 0 0 1\n2 1 0 1\n3 0 1 1\n4 0 0 2\n5 1 1 2\n$EndNodeData\n";
    std::fs::write(dir.path().join("two.msh"), text).unwrap();
    let first = json(&dir, &["info", "two.msh"]);
    has_keys(&first, &["kind", "nodes", "tets", "inverted", "volume", "boundary_faces", "components", "bounds"]);
    assert_eq!((&first["kind"], &first["nodes"], &first["tets"]), (&"tets".into(), &5.into(), &2.into()));
    assert_eq!((&first["inverted"], &first["boundary_faces"], &first["regions"]), (&0.into(), &6.into(), &2.into()));
    assert!((first["volume"].as_f64().unwrap() - 0.5).abs() < 1e-15);
    assert_eq!(first["vectors"], serde_json::json!(["deformed"]));
    let mut from = "two.msh".to_owned();
    for to in ["a.vtu", "b.vtk", "c.msh", "d.mesh", "e.node", "f.ele"] {
        let out = voxclay(&dir, &["convert", &from, to]);
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(0), "{said}");
        assert_eq!(said.contains("cannot hold the vectors deformed"), to == "d.mesh", "{to}: {said}");
        let facts = json(&dir, &["info", to]);
        for key in ["kind", "nodes", "tets", "inverted", "volume", "boundary_faces", "components", "regions", "bounds"]
        {
            assert_eq!(facts[key], first[key], "{key} of {to}");
        }
        from = to.to_owned();
    }
    assert!(exists(&dir, "e.ele") && exists(&dir, "f.node"));
    let text = voxclay(&dir, &["info", "a.vtu"]);
    assert!(String::from_utf8_lossy(&text.stdout).contains("2 tetrahedra"));
    fails(&dir, &["convert", "a.vtu", "a.obj"], &["a tetrahedral mesh", "a surface", "one kind"]);
    fails(&dir, &["convert", "a.vtu", "a.meshb"], &["a.meshb", "write .mesh instead"]);
    fails(&dir, &["convert", "a.vtu", "a.vti"], &["a.vti", "expected"]);
    std::fs::write(dir.path().join("cut.vtu"), "<VTKFile type=\"UnstructuredGrid\"><Unstr").unwrap();
    fails(&dir, &["info", "cut.vtu"], &["cut.vtu"]);
    assert!(left_over(&dir).is_empty() && !exists(&dir, "a.obj"));
}

/// A `.vtk` file is a volume, a surface or a mesh by what it holds.
#[test]
fn a_vtk_file_is_what_it_holds() {
    let dir = TempDir::new().unwrap();
    let head = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET";
    let put = |name: &str, text: String| std::fs::write(dir.path().join(name), text).unwrap();
    put(
        "v.vtk",
        format!(
            "{head} STRUCTURED_POINTS\nDIMENSIONS 2 2 1\nPOINT_DATA 4\nSCALARS s short\nLOOKUP_TABLE default\n1 2 3 4\n"
        ),
    );
    put(
        "s.vtk",
        format!(
            "{head} POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\nPOLYGONS 4 16\n3 0 2 1 3 0 1 3 3 1 2 3 3 2 0 3\n"
        ),
    );
    put("t.vtk", format!("{head} RECTILINEAR_GRID\n"));
    assert_eq!(json(&dir, &["info", "v.vtk"])["dims"], serde_json::json!([2, 2, 1]));
    assert_eq!(json(&dir, &["info", "s.vtk"])["euler"], 2);
    json(&dir, &["convert", "v.vtk", "v.nrrd"]);
    json(&dir, &["convert", "s.vtk", "s.ply"]);
    fails(&dir, &["info", "t.vtk"], &["t.vtk", "RECTILINEAR_GRID"]);
    fails(&dir, &["convert", "s.vtk", "o.nrrd"], &["a surface", "a volume"]);
    fails(&dir, &["convert", "v.nrrd", "o.vtk"], &["a volume", "a tetrahedral mesh"]);
    fails(&dir, &["info", "none.vtk"], &["none.vtk"]);
    assert!(!exists(&dir, "o.nrrd") && !exists(&dir, "o.vtk"));
}

#[test]
fn slice_has_the_keys_of_the_contract() {
    let dir = TempDir::new().unwrap();
    cube(dir.path());
    for tessellator in ["lyon", "spade", "none"] {
        let s =
            json(&dir, &["slice", "cube.obj", "--planes", "7", "--direction", "0,0,2", "--tessellator", tessellator]);
        has_keys(&s, &["planes", "area", "outer", "holes", "triangles"]);
        has_keys(&s["ms"], &["build", "contours", "nesting", "tessellate", "total"]);
        let area = s["area"].as_array().unwrap();
        assert_eq!(area.len(), 7);
        assert!(area.iter().all(|a| (a.as_f64().unwrap() - 4.0).abs() < 1e-12), "{area:?}");
        assert!(s["outer"].as_array().unwrap().iter().all(|n| n == 1));
    }
    fails(&dir, &["slice", "cube.obj", "--direction", "0,0,0"], &["no length"]);
}

#[test]
fn render_draws_each_shading() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("p.voxclay"), PROJECT).unwrap();
    for shading in ["volume", "iso", "mip"] {
        for mode in ["slicing", "slicing-exact", "tets"] {
            let r = json(
                &dir,
                &[
                    "render",
                    "p.voxclay",
                    "--backend",
                    "cpu",
                    "--shading",
                    shading,
                    "--mode",
                    mode,
                    "--size",
                    "64x48",
                    "-o",
                    "a.png",
                ],
            );
            has_keys(&r, &["slices", "triangles", "ms"]);
            assert_eq!(r["lattice"]["tets"].is_u64(), mode == "tets");
            assert!(r["slices"].as_u64().unwrap() > 20);
            let png = std::fs::read(dir.path().join("a.png")).unwrap();
            assert_eq!(&png[1..4], b"PNG");
            assert_eq!(u32::from_be_bytes(png[16..20].try_into().unwrap()), 64);
            assert_eq!(u32::from_be_bytes(png[20..24].try_into().unwrap()), 48);
        }
    }
    assert!(left_over(&dir).is_empty());
}

#[test]
fn export_writes_the_deformed_volume() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("p.voxclay"), PROJECT).unwrap();
    for mode in ["slicing", "tets", "reference"] {
        let e = json(&dir, &["export", "p.voxclay", "-o", "o.nrrd", "--mode", mode, "--field", "f.nrrd"]);
        has_keys(&e, &["dims", "mode", "ms", "backend"]);
        assert_eq!(e["mode"], mode);
        if mode == "tets" {
            has_keys(&e["lattice"], &["tets", "max_error", "mean_error"]);
            assert_eq!(e["lattice"]["converged"], true);
        } else {
            assert!(e["moved"].as_u64().unwrap() > 0);
        }
        let volume = json(&dir, &["info", "o.nrrd"]);
        assert_eq!(volume["dims"], e["dims"]);
        assert_eq!(json(&dir, &["info", "f.nrrd"])["channels"], 3);
    }
    // nothing deformed, nothing changed
    json(&dir, &["convert", "phantom:engine:40", "rest.nrrd"]);
    json(&dir, &["export", "rest.nrrd", "-o", "same.raw"]);
    json(&dir, &["convert", "rest.nrrd", "rest.raw"]);
    let read = |n: &str| std::fs::read(dir.path().join(n)).unwrap();
    assert_eq!(read("same.raw"), read("rest.raw"));
}

/// The GPU fills the same grid with the same values, to a grey level, and what it cannot do is done by the CPU, and said.
#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn exports_of_the_gpu_are_those_of_the_cpu() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("p.voxclay"), PROJECT.replace("[6, 0, 3]", "[22, 0, 0]")).unwrap();
    let export = |out: &str, args: &[&str]| json(&dir, &[&["export", "p.voxclay", "-o", out], args].concat());
    let read = |n: &str| std::fs::read(dir.path().join(n)).unwrap();
    for more in [&[][..], &["--same-grid"], &["--spacing", "1.7"]] {
        let cpu = export("cpu.raw", more);
        let gpu = export("gpu.raw", &[more, &["--backend", "gpu"]].concat());
        assert_eq!((&cpu["backend"], &gpu["backend"]), (&"cpu".into(), &"gpu".into()));
        assert!(gpu["device"].is_string() && gpu["remark"].is_null() && cpu["device"].is_null());
        for key in ["dims", "clipped", "outside_mesh"] {
            assert_eq!(cpu[key], gpu[key], "{key}");
        }
        for key in ["moved", "outside"] {
            let [a, b] = [&cpu, &gpu].map(|e| e[key].as_f64().unwrap());
            assert!((a - b).abs() <= 0.002 * a, "{key}: {a} on the CPU, {b} on the GPU");
        }
        let [a, b] = ["cpu.raw", "gpu.raw"].map(|n| voxclay::io::read_volume(&dir.path().join(n)).unwrap().samples);
        assert_eq!((a.len(), a.scalar_type()), (b.len(), b.scalar_type()));
        let off = (0..a.len()).filter(|&i| (a.get(i) - b.get(i)).abs() > 1.0).count();
        assert!(off * 10_000 < a.len(), "{off} of {} samples differ by more than a grey level", a.len());
    }
    for (args, why) in [(&["--interpolation", "cubic"][..], "linearly"), (&["--mode", "reference"], "f64")] {
        let cpu = export("cpu.raw", args);
        let gpu = export("gpu.raw", &[args, &["--backend", "gpu"]].concat());
        assert!(gpu["backend"] == "cpu" && gpu["remark"].as_str().unwrap().contains(why), "{gpu}");
        assert!(cpu["remark"].is_null() && read("cpu.raw") == read("gpu.raw"));
    }
}

/// What is wrong with the sections of a mesh is said of pictures too, and fragments are counted.
#[test]
fn pictures_tell_of_the_mesh_they_are_cut_from() {
    let dir = TempDir::new().unwrap();
    // a cube through a face of an octahedron
    let mut text = String::new();
    for i in 0..8 {
        let at = |bit: usize| if i >> bit & 1 == 0 { 1 } else { 5 };
        text.push_str(&format!("v {} {} {}\n", at(0), at(1), at(2)));
    }
    for [a, b, c, d] in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
        text.push_str(&format!("f {a} {b} {c}\nf {a} {c} {d}\n"));
    }
    text.push_str("v -10 0 0\nv 10 0 0\nv 0 -10 0\nv 0 10 0\nv 0 0 -10\nv 0 0 10\n");
    for [x, y, z] in [[10, 12, 14], [12, 9, 14], [9, 11, 14], [11, 10, 14]] {
        text.push_str(&format!("f {x} {y} {z}\nf {y} {x} {}\n", z - 1));
    }
    std::fs::write(dir.path().join("crossed.obj"), text).unwrap();
    let args = ["render", "phantom:sphere:24", "--backend", "cpu", "--size", "64x64", "--slices", "40", "-o", "o.png"];
    let said = json(&dir, &[&args[..], &["--mesh", "crossed.obj"]].concat());
    let warnings = said["warnings"].as_array().unwrap();
    let words = "triangles cut through other parts of the surface, the first at (";
    assert!(warnings.len() == 1 && warnings[0].as_str().unwrap().contains(words), "{said}");
    let out = voxclay(&dir, &[&args[..], &["--mesh", "crossed.obj"]].concat());
    assert!(String::from_utf8_lossy(&out.stderr).contains(words));
    // sections are those of both together
    let slice = ["slice", "crossed.obj", "--planes", "20", "--direction", "0,0,1"];
    let said = json(&dir, &slice);
    let areas: Vec<f64> = said["area"].as_array().unwrap().iter().map(|a| a.as_f64().unwrap()).collect();
    // at z = 1.5, and at z = 4.5
    let [near, far] = [11, 14].map(|k| areas[k]);
    assert!((near - (2.0 * 8.5 * 8.5 + 16.0 - 0.5 * 6.5 * 6.5 + 2.5 * 2.5)).abs() < 1e-9, "{near}");
    assert!((far - (2.0 * 5.5 * 5.5 + 16.0 - 0.5 * 3.5 * 3.5)).abs() < 1e-9, "{far}");
    assert!(String::from_utf8_lossy(&voxclay(&dir, &slice).stderr).contains(words));
    let said = json(&dir, &args);
    assert!(said["warnings"].as_array().unwrap().is_empty() && said["fragments"].as_u64().unwrap() > 1000, "{said}");
}

/// A certificate is written beside the volume, whatever made it, and names what is wrong.
#[test]
fn surface_writes_each_format_and_render_its_picture() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("p.voxclay"), PROJECT.replace("sphere", "gaussian")).unwrap();
    for name in ["a.obj", "a.stl", "a.ply", "a.glb"] {
        let made = json(&dir, &["surface", "phantom:gaussian:24", "--iso", "0.5", "-o", name]);
        has_keys(&made, &["vertices", "triangles", "iso", "method"]);
        has_keys(&made["ms"], &["spline", "mesh", "total"]);
        assert!(exists(&dir, name));
        if name != "a.glb" {
            let facts = json(&dir, &["info", name]);
            assert_eq!((&facts["closed"], &facts["manifold"]), (&Value::from(true), &Value::from(true)));
            assert_eq!(facts["triangles"], made["triangles"]);
        }
    }
    let cells = json(&dir, &["surface", "phantom:gaussian:24", "--method", "cells", "-o", "c.ply"]);
    assert_eq!(cells["method"], "cells");
    let fine = json(&dir, &["surface", "p.voxclay", "--iso", "0.5", "--refine", "0.02", "-o", "f.obj"]);
    assert_eq!(fine["resampled"], true);
    has_keys(&fine["refined"], &["levels", "left", "worst"]);
    let drawn =
        json(&dir, &["render", "p.voxclay", "--mode", "spline", "--iso", "0.5", "--size", "64x48", "-o", "p.png"]);
    assert!(drawn["fragments"].as_u64().unwrap() > 100);
    let tinted = ["--curvature", "gaussian", "--caps", "volume", "--size", "64x48", "-o", "t.png"];
    json(&dir, &[&["render", "p.voxclay", "--mode", "spline", "--iso", "0.5"][..], &tinted].concat());
    assert_ne!(std::fs::read(dir.path().join("t.png")).unwrap(), std::fs::read(dir.path().join("p.png")).unwrap());
    fails(&dir, &[&["render", "p.voxclay"][..], &tinted].concat(), &["--curvature", "--mode spline"]);
    let chosen = ["--coefficients", "fly", "--backend", "cpu", "--size", "64x48", "-o", "n.png"];
    fails(&dir, &[&["render", "p.voxclay"][..], &chosen].concat(), &["--coefficients", "--mode spline"]);
    let chosen = [&["render", "p.voxclay", "--mode", "spline"][..], &chosen].concat();
    fails(&dir, &chosen, &["--coefficients", "--backend gpu"]);
    fails(&dir, &["surface", "phantom:gaussian:24", "--iso", "9", "-o", "n.ply"], &["no surface at 9", "0"]);
    fails(&dir, &["surface", "phantom:gaussian:24", "-o", "n.nrrd"], &["n.nrrd", ".glb"]);
    fails(&dir, &["surface", "phantom:gaussian:24", "--refine", "0", "-o", "n.ply"], &["--refine"]);
    fails(&dir, &["render", "p.voxclay", "--mode", "spline", "--shading", "mip", "-o", "n.png"], &["iso"]);
    assert!(!exists(&dir, "n.ply") && left_over(&dir).is_empty());
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn splines_are_measured_and_drawn_by_the_gpu() {
    let dir = TempDir::new().unwrap();
    let view = ["--mode", "spline", "--backend", "gpu", "--size", "64x48", "-o", "g.png"];
    let drawn = json(&dir, &[&["render", "phantom:gaussian:24"][..], &view].concat());
    assert_eq!(drawn["backend"], "gpu");
    assert!(drawn["triangles"].as_u64().unwrap() > 1000);
    let made = json(&dir, &["bench", "spline", "phantom:gaussian:24", "--size", "48x48", "--repeat", "1"]);
    let volume = &made["volumes"][0];
    has_keys(&volume["ms"], &["spline", "mesh"]);
    let ways = volume["ways"].as_array().unwrap();
    assert_eq!(ways.len(), 6);
    for way in ways {
        has_keys(way, &["way", "backend", "ms"]);
        assert!(way["ms"]["frame"].as_f64().unwrap() > 0.0 && way["ms"]["change"].as_f64().unwrap() > 0.0);
        let tets = way["way"].as_str().unwrap().starts_with("spline,");
        assert_eq!(way["tets"].as_u64().is_some_and(|n| n > 1000), tets);
        assert_eq!(way["tets_per_second"].is_number() && way["bytes"].is_number(), tets);
        let stored = match way["way"].as_str().unwrap() {
            "spline, stored" => Some(80 * way["tets"].as_u64().unwrap()),
            "spline, determining" => Some(224 * way["cubes"].as_u64().unwrap()),
            _ => tets.then_some(0),
        };
        assert_eq!(way["coefficient_bytes"].as_u64(), stored);
    }
    for chosen in ["stored", "determining", "fly"] {
        let options = ["--coefficients", chosen];
        let drawn = json(&dir, &[&["render", "phantom:gaussian:24"][..], &view, &options].concat());
        assert_eq!(drawn["spline"]["coefficients"], chosen);
        assert!(drawn["spline"]["list_bytes"].as_u64() > drawn["spline"]["coefficient_bytes"].as_u64());
    }
}

#[test]
fn exports_are_certified() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("p.voxclay"), PROJECT).unwrap();
    let certified = |args: &[&str]| -> (Value, Value) {
        let all = [&["export", "p.voxclay", "-o", "o.nrrd", "--certificate", "c.json"], args].concat();
        let said = json(&dir, &all);
        let text = std::fs::read_to_string(dir.path().join("c.json")).unwrap();
        (said, serde_json::from_str(&text).unwrap())
    };
    for mode in ["slicing", "tets", "reference"] {
        let (said, c) = certified(&["--mode", mode]);
        has_keys(
            &c,
            &["sound", "faults", "coverage", "jacobian", "inverse", "values_clipped", "material_clipped", "mass"],
        );
        assert_eq!((&c["mode"], &c["dims"], &c["sound"]), (&said["mode"], &said["dims"], &Value::Bool(true)), "{c}");
        assert_eq!(c["coverage"]["tets"].is_object(), mode == "tets");
        assert!(c["jacobian"]["min"].as_f64().unwrap() > 0.0 && c["material_clipped"] == 0);
    }
    // pulled over the border, and kept in
    std::fs::write(dir.path().join("p.voxclay"), PROJECT.replace("[6, 0, 3]", "[26, 0, 0]")).unwrap();
    for mode in ["slicing", "tets"] {
        let (said, c) = certified(&["--mode", mode, "--same-grid"]);
        assert_eq!((&said["sound"], &c["sound"]), (&Value::Bool(false), &Value::Bool(false)), "{mode}: {c}");
        assert!(c["faults"][0].as_str().unwrap().contains("beyond the grid"), "{c}");
    }
    // a tolerance that is kept
    let (_, c) = certified(&["--mode", "tets", "--tolerance", "0.02"]);
    assert!(c["lattice"]["max_error"].as_f64().unwrap() <= 0.02);
    assert!(left_over(&dir).is_empty());
}

/// A cube of the phantom's voxels in six tetrahedra that share a diagonal, a little larger when deformed.
fn six_tets(dir: &TempDir, name: &str, corner: f64, extra: &str, count: usize) {
    let mut text = String::from("MeshVersionFormatted 2\nDimension 3\nVertices\n8\n");
    for i in 0..8 {
        let at = |bit: usize| if i >> bit & 1 == 0 { 4.0 - corner } else { 20.0 + corner };
        text.push_str(&format!("{} {} {} 0\n", at(0), at(1), at(2)));
    }
    text.push_str(&format!("Tetrahedra\n{count}\n"));
    for t in ["1 2 4 8", "1 4 3 8", "1 3 7 8", "1 7 5 8", "1 5 6 8", "1 6 2 8"] {
        text.push_str(&format!("{t} 0\n"));
    }
    std::fs::write(dir.path().join(name), format!("{text}{extra}End\n")).unwrap();
}

/// A warp is certified as an export is, and a tetrahedron that is there twice is found.
#[test]
fn warps_are_certified() {
    let dir = TempDir::new().unwrap();
    let certified = |extra: &str, count: usize| -> (Value, Value) {
        six_tets(&dir, "rest.mesh", 0.0, extra, count);
        six_tets(&dir, "bent.mesh", 1.25, extra, count);
        let args = ["warp", "phantom:sphere:24", "--tets", "rest.mesh", "--deformed", "bent.mesh", "--units", "voxel"];
        let more = ["--backend", "cpu", "-o", "o.nrrd", "--certificate", "c.json"];
        let said = json(&dir, &[&args[..], &more[..]].concat());
        (said, serde_json::from_str(&std::fs::read_to_string(dir.path().join("c.json")).unwrap()).unwrap())
    };
    let (said, c) = certified("", 6);
    has_keys(&c, &["sound", "faults", "coverage", "jacobian", "inverse", "values_clipped", "material_clipped", "mass"]);
    assert_eq!((&said["sound"], &c["sound"]), (&Value::Bool(true), &Value::Bool(true)), "{c}");
    assert_eq!((&c["dims"], &c["tets"], &said["certificate"]), (&said["dims"], &6.into(), &"c.json".into()));
    let jacobian = c["jacobian"]["min"].as_f64().unwrap();
    assert!((jacobian - (18.5f64 / 16.0).powi(3)).abs() < 1e-9, "{jacobian}");
    // the same tetrahedron twice: everything in it is there twice
    let (said, c) = certified("1 2 4 8 0\n", 7);
    assert_eq!((&said["sound"], &c["sound"]), (&Value::Bool(false), &Value::Bool(false)), "{c}");
    assert!(c["faults"][0].as_str().unwrap().contains("overlaps itself"), "{c}");
    assert!(c["coverage"]["tets"]["more"].as_u64().unwrap() > 100, "{c}");
    let out = voxclay(
        &dir,
        &[
            "warp",
            "phantom:sphere:24",
            "--tets",
            "rest.mesh",
            "--deformed",
            "bent.mesh",
            "--units",
            "voxel",
            "--backend",
            "cpu",
            "-o",
            "o.nrrd",
            "--certificate",
            "c.json",
        ],
    );
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(text.contains("c.json: not sound") && text.contains("overlaps itself"), "{text}");
    assert!(left_over(&dir).is_empty());
}

#[test]
fn compare_has_the_keys_of_the_contract_and_writes_a_report() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("p.voxclay"), PROJECT).unwrap();
    let modes = "slicing:1,slicing:2,slicing:0.25,slicing-exact,export,tets:0,tets:0.2";
    let args = ["compare", "p.voxclay", "--backend", "cpu", "--size", "96x64", "--modes", modes, "-o", "out"];
    let c = json(&dir, &args);
    let pairs = c["pairs"].as_array().unwrap();
    assert_eq!(pairs.len(), 8);
    for pair in pairs {
        has_keys(pair, &["mode", "setting", "rmse", "ssim", "max", "ms"]);
        has_keys(&pair["ms"], &["frame", "change"]);
        assert!(pair.get("psnr").is_some());
    }
    assert_eq!(
        (&pairs[3]["mode"], &pairs[3]["max"], &pairs[3]["psnr"]),
        (&"slicing-exact".into(), &0.0.into(), &Value::Null)
    );
    assert!(pairs[1]["coordinate"]["falls"]["mean"].as_f64().unwrap() > 2.0);
    has_keys(&pairs[7], &["tets", "volume", "drawn", "coordinate"]);
    has_keys(&pairs[7]["volume"]["interior"], &["rms", "max", "above", "voxels"]);
    for file in c["files"].as_array().unwrap() {
        assert!(exists(&dir, file.as_str().unwrap()), "{file}");
    }
    let page = std::fs::read_to_string(dir.path().join("out/report.html")).unwrap();
    assert!(page.contains("p.voxclay") && page.contains("data:image/png;base64,"));
    let numbers = std::fs::read_to_string(dir.path().join("out/report.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&numbers).unwrap(), c);
    let out = voxclay(&dir, &["compare", "p.voxclay", "--backend", "cpu", "--size", "32x32", "--modes", "tets:1"]);
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(out.status.success() && text.contains("tets           level 1"), "{text}");
    for (word, says) in [
        ("slicing,frob", "'frob' is no mode"),
        ("", "expected slicing"),
        ("slicing:9", "from 0 to 8"),
        ("tets:7", "from 0 to 6"),
        ("tets:-0.5", "tolerance in voxels"),
        ("export:1", "is no mode"),
    ] {
        fails(&dir, &["compare", "p.voxclay", "--modes", word, "-o", "no"], &["--modes", says]);
    }
    fails(&dir, &["compare", "nowhere.voxclay", "-o", "no"], &["nowhere.voxclay"]);
    assert!(!exists(&dir, "no"));
}

#[test]
fn bad_input_gets_one_sentence_and_leaves_nothing() {
    let dir = TempDir::new().unwrap();
    let put = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).unwrap();
    put("empty.nrrd", b"");
    put("cut.nrrd", b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 4 4 4\nencoding: raw\n\nabc");
    put("huge.nrrd", b"NRRD0004\ntype: double\ndimension: 3\nsizes: 99999999 99999999 99999\nencoding: raw\n\nabc");
    put(
        "zero.mha",
        b"ObjectType = Image\nNDims = 3\nDimSize = 0 4 4\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n",
    );
    put("empty.obj", b"");
    put("one.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    put("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    put("not.voxclay", b"{ \"voxclay\": 1, \"document\": 7 }");
    put("newer.voxclay", b"{ \"voxclay\": 99, \"document\": {} }");
    put("fold.voxclay", PROJECT.replace("[6, 0, 3]", "[0, 0, 0]").as_bytes());
    put("bad.tf", b"voxclay transfer function 1\nwindow 3 1\n");
    for (args, words) in [
        (&["info", "nowhere.nrrd"][..], &["nowhere.nrrd"][..]),
        (&["info", "empty.nrrd"], &["empty.nrrd"]),
        (&["info", "cut.nrrd"], &["cut.nrrd"]),
        (&["info", "huge.nrrd"], &["huge.nrrd"]),
        (&["info", "zero.mha"], &["zero.mha"]),
        (&["info", "empty.obj"], &["empty.obj"]),
        (&["info", "readme.txt"], &["readme.txt", "expected"]),
        (&["info", "phantom:nobody"], &["nobody", "head"]),
        (&["info", "phantom:head:x"], &["phantom:NAME"]),
        (&["convert", "cut.nrrd", "o.nii"], &["cut.nrrd"]),
        (&["convert", "phantom:sphere:24", "o.obj"], &["one kind"]),
        (&["convert", "phantom:sphere:24", "o.xyz"], &["o.xyz", "expected"]),
        (&["convert", "phantom:sphere:24", "no/such/folder/o.nrrd"], &["o.nrrd"]),
        // what could not be written is said before any work
        (&["convert", "cut.nrrd", "o.hdr"], &["o.hdr", "expected"]),
        (&["convert", "cut.nrrd", "o.img.gz"], &["o.img.gz", "expected"]),
        (&["export", "cut.nrrd", "-o", "o.img"], &["o.img", "expected"]),
        (&["export", "cut.nrrd", "-o", "o.nrrd", "--field", "f.hdr"], &["f.hdr", "expected"]),
        (&["export", "cut.nrrd", "-o", "no/such/folder/o.nrrd"], &["folder/o.nrrd"]),
        (&["warp", "cut.nrrd", "--tets", "nowhere.vtk", "-o", "o.hdr"], &["o.hdr", "expected"]),
        (&["export", "phantom:sphere:24", "-o", "o.nrrd", "--mode", "tets", "--backend", "gpu"], &["--backend gpu"]),
        (&["render", "cut.nrrd", "-o", "o.png"], &["cut.nrrd"]),
        (&["render", "not.voxclay", "-o", "o.png"], &["not.voxclay"]),
        (&["render", "newer.voxclay", "-o", "o.png"], &["newer.voxclay", "99"]),
        (&["render", "fold.voxclay", "-o", "o.png"], &["fold.voxclay", "vector"]),
        (&["render", "phantom:sphere:24", "--mesh", "empty.obj", "-o", "o.png"], &["empty.obj"]),
        (&["render", "phantom:sphere:24", "--mesh", "auto:1e9", "-o", "o.png"], &["isovalue"]),
        (&["render", "phantom:sphere:24", "--transfer", "lilac", "-o", "o.png"], &["lilac", "auto"]),
        (&["render", "phantom:sphere:24", "--transfer", "bad.tf", "-o", "o.png"], &["bad.tf", "line 2"]),
        (&["render", "phantom:sphere:24", "--iso", "nan", "-o", "o.png"], &["--iso"]),
        (&["export", "phantom:sphere:24", "-o", "o.nrrd", "--spacing", "0"], &["--spacing"]),
        (&["export", "phantom:sphere:24", "-o", "o.nrrd", "--spacing", "1e-9"], &["voxels"]),
        (&["export", "phantom:sphere:24", "-o", "o.png"], &["o.png", "expected"]),
        (&["export", "phantom:sphere:24", "-o", "o.nrrd", "--tolerance", "0.1"], &["--tolerance", "--mode tets"]),
        (&["export", "phantom:sphere:24", "-o", "o.nrrd", "--mode", "tets", "--tolerance", "0"], &["--tolerance"]),
        (&["render", "phantom:sphere:24", "-o", "o.png", "--mode", "tets", "--tolerance", "-1"], &["--tolerance"]),
    ] {
        fails(&dir, args, words);
    }
    for name in ["o.nii", "o.obj", "o.xyz", "o.png", "o.nrrd"] {
        assert!(!exists(&dir, name), "{name} was written");
    }
    assert!(left_over(&dir).is_empty());
}

/// What is not a clean solid is drawn as far as it can be.
#[test]
fn defective_meshes_are_drawn_with_a_warning() {
    let dir = TempDir::new().unwrap();
    let put = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    put("one.obj", "v -1 -1 0\nv 1 0 0.2\nv 0 1 0.1\nf 1 2 3\n");
    let out = voxclay(
        &dir,
        &["render", "phantom:sphere:24", "--backend", "cpu", "--mesh", "one.obj", "--size", "32x32", "-o", "a.png"],
    );
    assert_eq!(out.status.code(), Some(0));
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(said.contains("one.obj") && said.contains("triangle on one side only"), "{said}");
    assert!(exists(&dir, "a.png"));
}

/// A stroke that would fold is shortened and says so, unless it is let through.
#[test]
fn strokes_that_fold_are_held_back() {
    let dir = TempDir::new().unwrap();
    let fold = PROJECT.replace("[6, 0, 3]", "[30, 0, 0]");
    std::fs::write(dir.path().join("fold.voxclay"), &fold).unwrap();
    std::fs::write(dir.path().join("let.voxclay"), fold.replace("\"stack\"", "\"allow_folds\": true, \"stack\""))
        .unwrap();
    let run = |name: &str, out: &str| {
        let out = voxclay(&dir, &["export", name, "-o", out, "--mode", "reference"]);
        assert_eq!(out.status.code(), Some(0));
        String::from_utf8_lossy(&out.stderr).into_owned()
    };
    let held = run("fold.voxclay", "a.raw");
    assert!(held.contains("'pull' is held back") && held.contains("of 30.000"), "{held}");
    let free = run("let.voxclay", "b.raw");
    assert!(!free.contains("held back"), "{free}");
    let read = |n: &str| std::fs::read(dir.path().join(n)).unwrap();
    assert_ne!(read("a.raw"), read("b.raw"));
}

/// A failed write leaves what was there before.
#[test]
fn an_old_file_survives_a_failure() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("o.png"), b"old").unwrap();
    std::fs::write(dir.path().join("cut.nrrd"), b"NRRD0004\ntype: uchar\n").unwrap();
    fails(&dir, &["render", "cut.nrrd", "-o", "o.png"], &["cut.nrrd"]);
    assert_eq!(std::fs::read(dir.path().join("o.png")).unwrap(), b"old");
}

fn cube(dir: &Path) {
    let mut text = String::new();
    for i in 0..8 {
        let c = |bit: usize| if i >> bit & 1 == 0 { -1 } else { 1 };
        text += &format!("v {} {} {}\n", c(0), c(1), c(2));
    }
    text += "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    std::fs::write(dir.join("cube.obj"), text).unwrap();
}

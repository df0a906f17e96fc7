//! A module imports only from lower layers; siblings of one layer do not know each other. See the table in `src/lib.rs`.

use std::fs;
use std::path::{Path, PathBuf};

/// Layer of each top-level module; modules of one layer with the same group may import each other.
const LAYERS: &[(&str, u8)] = &[
    ("math", 0),
    ("volume", 1),
    ("mesh", 1),
    ("io", 2),
    ("deform", 2),
    ("slice", 2),
    ("tessellate", 2),
    ("subdivide", 2),
    ("render", 2),
    ("compare", 2),
    ("warp", 2),
    ("spline", 2),
    ("scene", 3),
    ("gpu", 3),
    ("evaluate", 4),
    ("app", 5),
    ("cli", 5),
    // of the program, not the library
    ("memory", 6),
];

/// Crates that only these modules may name.
const RESERVED: &[(&str, &[&str])] = &[
    ("wgpu", &["gpu", "evaluate", "app"]),
    ("clap", &["cli", "main"]),
    ("egui", &["app"]),
    ("winit", &["app"]),
    ("eframe", &["app"]),
];

fn layer(module: &str) -> Option<u8> {
    LAYERS.iter().find(|(m, _)| *m == module).map(|(_, l)| *l)
}

fn sources(dir: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

/// Code with comments taken out, so that doc links do not count as imports.
fn code(text: &str) -> String {
    text.lines().map(|l| l.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// First path segments after `crate::`, also those in a group such as `crate::{a, b::c}`.
fn imports(code: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        if code[..at].ends_with('$') {
            continue;
        }
        let rest = &code[at + "crate::".len()..];
        if let Some(group) = rest.strip_prefix('{') {
            let mut depth = 0;
            let mut item = String::new();
            for c in group.chars() {
                match c {
                    '{' => depth += 1,
                    '}' if depth == 0 => break,
                    '}' => depth -= 1,
                    ',' if depth == 0 => found.push(std::mem::take(&mut item)),
                    c if depth == 0 => item.push(c),
                    _ => {}
                }
            }
            found.push(item);
        } else {
            found.push(rest.to_owned());
        }
    }
    found
        .into_iter()
        .map(|s| s.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect())
        .filter(|s: &String| !s.is_empty())
        .collect()
}

#[test]
fn no_import_climbs() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&src, &mut files);
    assert!(files.len() > 20, "the sources were not found");
    let mut wrong = Vec::new();
    for file in files {
        let relative = file.strip_prefix(&src).unwrap();
        let first = relative.components().next().unwrap().as_os_str().to_string_lossy();
        let module = first.trim_end_matches(".rs");
        let text = code(&fs::read_to_string(&file).unwrap());
        if let Some(own) = layer(module) {
            for import in imports(&text) {
                if import != module && layer(&import).is_some_and(|l| l >= own) {
                    wrong.push(format!("{}: crate::{import}", relative.display()));
                }
            }
        } else {
            assert!(matches!(module, "lib" | "main"), "{module} has no layer: add it to LAYERS");
        }
        for (krate, allowed) in RESERVED {
            if text.contains(&format!("{krate}::")) && !allowed.contains(&module) {
                wrong.push(format!("{}: {krate}", relative.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "imports that climb or are reserved:\n{}", wrong.join("\n"));
}

#[test]
fn the_reader_of_imports_reads_groups() {
    let found = imports("use crate::{math::{Plane, Box}, volume, mesh::TriMesh};\nlet x = crate::io::read();");
    assert_eq!(found, ["math", "volume", "mesh", "io"]);
}

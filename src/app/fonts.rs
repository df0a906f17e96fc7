//! Letters of other scripts, from the fonts of the system: names of files are in any language.

use std::path::{Path, PathBuf};

use eframe::egui::epaint::text::{FontInsert, FontPriority, InsertFontFamily};
use eframe::egui::{self, FontData, FontFamily};

/// Files to look for, the widest first; one of each group is enough.
const GROUPS: [&[&str]; 2] = [
    // Chinese, Japanese, Korean
    &[
        "NotoSansCJK-Regular.ttc",
        "NotoSansCJKsc-Regular.otf",
        "NotoSansCJK-VF.otf.ttc",
        "SourceHanSans.ttc",
        "DroidSansFallbackFull.ttf",
        "DroidSansFallback.ttf",
        "wqy-microhei.ttc",
        "wqy-zenhei.ttc",
        "Hiragino Sans GB.ttc",
        "Arial Unicode.ttf",
        "msyh.ttc",
    ],
    // Greek, Cyrillic, Hebrew, Arabic, Armenian, Georgian
    &["DejaVuSans.ttf", "NotoSans-Regular.ttf", "FreeSans.ttf", "Arial.ttf", "arial.ttf"],
];

/// Folders within folders that are looked into.
const DEEPEST: usize = 4;
/// No honest font is larger.
const LARGEST: u64 = 64 << 20;

/// Looks for fonts in the background and puts them behind those that are there.
pub fn look_for_more(ctx: &egui::Context) {
    let ctx = ctx.clone();
    // without them names show boxes, which is no reason to stop
    let _ = std::thread::Builder::new().name("fonts".to_owned()).spawn(move || {
        let mut files = Vec::new();
        for folder in folders() {
            list(&folder, DEEPEST, &mut files);
        }
        for group in GROUPS {
            let Some(path) = first(group, &files) else { continue };
            let Ok(bytes) = std::fs::read(path) else { continue };
            let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
            let last = |family| InsertFontFamily { family, priority: FontPriority::Lowest };
            let families = vec![last(FontFamily::Proportional), last(FontFamily::Monospace)];
            ctx.add_font(FontInsert::new(&name, FontData::from_owned(bytes), families));
        }
        ctx.request_repaint();
    });
}

/// Where systems keep fonts.
fn folders() -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> =
        ["/usr/share/fonts", "/usr/local/share/fonts", "/System/Library/Fonts", "/Library/Fonts"]
            .map(PathBuf::from)
            .into();
    if let Some(home) = std::env::var_os("HOME").map(PathBuf::from) {
        folders.extend([".local/share/fonts", ".fonts", "Library/Fonts"].map(|f| home.join(f)));
    }
    folders.extend(std::env::var_os("WINDIR").map(|w| PathBuf::from(w).join("Fonts")));
    folders
}

fn list(folder: &Path, deep: usize, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let Ok(kind) = entry.file_type() else { continue };
        if kind.is_dir() {
            if deep > 0 {
                list(&entry.path(), deep - 1, files);
            }
        } else if entry.metadata().is_ok_and(|m| m.len() <= LARGEST) {
            files.push(entry.path());
        }
    }
}

/// The first of these names that is there.
fn first<'a>(names: &[&str], files: &'a [PathBuf]) -> Option<&'a PathBuf> {
    names.iter().find_map(|name| files.iter().find(|f| f.file_name().is_some_and(|n| n == *name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_name_that_is_there_is_taken() {
        let folder = tempfile::tempdir().unwrap();
        let deep = folder.path().join("truetype/other");
        std::fs::create_dir_all(&deep).unwrap();
        for name in ["FreeSans.ttf", "DejaVuSans.ttf", "readme.txt"] {
            std::fs::write(deep.join(name), b"x").unwrap();
        }
        let mut files = Vec::new();
        list(folder.path(), DEEPEST, &mut files);
        assert_eq!(files.len(), 3);
        assert_eq!(first(GROUPS[1], &files), Some(&deep.join("DejaVuSans.ttf")));
        assert_eq!(first(GROUPS[0], &files), None);
        files.clear();
        list(folder.path(), 1, &mut files);
        assert!(files.is_empty());
    }
}

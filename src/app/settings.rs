//! What is kept between sessions: preferences and recent files. A broken settings file is as good as none.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::navigate::Orbit;

/// More than this nobody looks for in a menu.
const MOST_RECENT: usize = 10;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    pub theme: ThemeChoice,
    /// Size of the interface, 1 as the system says.
    pub zoom: f32,
    /// How a drag turns the view.
    pub orbit: Orbit,
    /// Milliseconds that a picture may take while something moves.
    pub preview_ms: f32,
    /// Seconds of rest before unsaved work is put aside.
    pub autosave_seconds: f32,
    /// Megabytes of undo steps.
    pub undo_megabytes: usize,
    /// Newest first.
    pub recent: Vec<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ThemeChoice {
    #[default]
    Dark,
    Light,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            theme: ThemeChoice::Dark,
            zoom: 1.0,
            orbit: Orbit::Turntable,
            preview_ms: 25.0,
            autosave_seconds: 2.0,
            undo_megabytes: 64,
            recent: Vec::new(),
        }
    }
}

impl Settings {
    pub fn load(home: &Home) -> Self {
        std::fs::read(home.settings()).ok().and_then(|t| serde_json::from_slice(&t).ok()).unwrap_or_default()
    }

    /// Nothing is lost if this fails but preferences.
    pub fn save(&self, home: &Home) {
        let Ok(text) = serde_json::to_vec_pretty(self) else { return };
        let path = home.settings();
        if std::fs::create_dir_all(&home.folder).is_ok() {
            let _ = crate::io::write_atomic(&path, |w| std::io::Write::write_all(w, &text));
        }
    }

    pub fn remember(&mut self, path: &Path) {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        self.recent.retain(|p| *p != path);
        self.recent.insert(0, path);
        self.recent.truncate(MOST_RECENT);
    }
}

/// The folder for settings and recovered work: `VOXCLAY_HOME`, or where the system keeps such things.
#[derive(Debug, Clone)]
pub struct Home {
    folder: PathBuf,
}

impl Home {
    pub fn find() -> Self {
        let var = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
        let folder = var("VOXCLAY_HOME")
            .or_else(|| var("XDG_STATE_HOME").map(|p| p.join("voxclay")))
            .or_else(|| var("LOCALAPPDATA").map(|p| p.join("Voxclay")))
            .or_else(|| var("HOME").map(|p| p.join(".local/state/voxclay")))
            .unwrap_or_else(|| std::env::temp_dir().join("voxclay"));
        Self { folder }
    }

    /// A folder of one's own, for tests.
    pub fn at(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    fn settings(&self) -> PathBuf {
        self.folder.join("settings.json")
    }

    /// Where unsaved work is put aside.
    pub fn recovery(&self) -> PathBuf {
        self.folder.join("recovery")
    }
}

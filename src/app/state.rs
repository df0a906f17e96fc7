//! What the modeller is doing and showing, beside the document.

use std::sync::Arc;
use std::time::{Duration, Instant};

use eframe::egui::{TextureHandle, Vec2};
use glam::DVec3;

use super::cube::Placing;
use super::grips::GripDrag;
use super::sculpt::{Made, Stroke};
use super::settings::Home;
use super::worker::Other;
use crate::evaluate::picture::{Backend, Mode};
use crate::scene::Document;

/// How the modeller begins.
#[derive(Debug, Clone)]
pub struct Start {
    /// Projects, volumes or `phantom:NAME[:SIZE]`; the first is opened, a surface becomes its shape.
    pub files: Vec<String>,
    pub backend: Backend,
    pub home: Home,
}

impl Default for Start {
    fn default() -> Self {
        Self { files: Vec::new(), backend: Backend::Auto, home: Home::find() }
    }
}

/// What is opened when nothing is named.
pub const FIRST: &str = "phantom:head:192";

/// Pause after which a movement counts as over.
pub const REST: Duration = Duration::from_millis(110);

/// How two pictures are laid against each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Layout {
    #[default]
    Wipe,
    SideBySide,
    Difference,
}

/// What is seen, beside the document.
#[derive(Debug, Clone)]
pub struct ViewState {
    pub mode: Mode,
    pub compare: bool,
    pub other: Other,
    pub layout: Layout,
    /// Part of the view left of the wipe.
    pub wipe: f32,
    pub cube: bool,
    pub overlays: bool,
    pub proxy: bool,
    pub boxes: bool,
    pub tessellation: bool,
    /// Tetrahedra of the lattice, in a layer through the cursor.
    pub tets: bool,
    /// Growth and folds on the visible surface.
    pub heat: bool,
    /// Growth and folds in the sections.
    pub growth: bool,
    /// World point of the sections.
    pub cursor: DVec3,
    /// Grey window of the sections, real values.
    pub window: [f64; 2],
}

impl Default for ViewState {
    fn default() -> Self {
        Self {
            mode: Mode::Slicing,
            compare: false,
            other: Other::Original,
            layout: Layout::Wipe,
            wipe: 0.5,
            cube: false,
            overlays: true,
            proxy: false,
            boxes: true,
            tessellation: false,
            tets: false,
            heat: false,
            growth: false,
            cursor: DVec3::ZERO,
            window: [0.0, 1.0],
        }
    }
}

/// A question that must be answered before anything else.
#[derive(Debug, Clone, PartialEq)]
pub enum Question {
    Open {
        word: String,
        wrong: Option<String>,
    },
    Save {
        word: String,
        embed: bool,
        then: After,
    },
    Screenshot {
        word: String,
        transparent: bool,
    },
    Turntable {
        word: String,
        frames: usize,
        seconds: f64,
    },
    /// There is unsaved work.
    Unsaved(After),
    Recover,
    Keys,
    Preferences,
    About,
}

/// What to do once the work is safe.
#[derive(Debug, Clone, PartialEq)]
pub enum After {
    Nothing,
    Open(String),
    Quit,
}

/// What the pointer is doing in the main view.
#[derive(Debug, Clone)]
pub enum Doing {
    Nothing,
    Orbit,
    Pan,
    Stroke {
        stroke: Box<Stroke>,
        made: Made,
    },
    Smooth {
        base: Arc<Document>,
    },
    Handle {
        item: usize,
        handle: usize,
        start: DVec3,
        scale: f64,
        drag: Vec2,
    },
    /// A part of the gizmo in the texture cube.
    Placing(Placing),
    /// A handle of the selected deformation.
    Grip(Box<GripDrag>),
    Wipe,
    Radius {
        start: f64,
        from: f32,
    },
    Strength {
        start: f64,
        from: f32,
    },
}

/// A sentence in the corner, for a while.
#[derive(Debug, Clone)]
pub struct Notice {
    pub text: String,
    pub error: bool,
    pub since: Instant,
}

#[derive(Default)]
pub struct Textures {
    pub main: Option<TextureHandle>,
    pub other: Option<TextureHandle>,
    pub difference: Option<TextureHandle>,
    pub sections: [Option<TextureHandle>; 3],
    /// What the sections' textures were coloured with.
    pub window: [f64; 2],
}

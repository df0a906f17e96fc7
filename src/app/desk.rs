use std::path::{Path, PathBuf};
use std::sync::Arc;

use eframe::egui;

use crate::evaluate::load::{Data, Object};
use crate::evaluate::masked::ValueMask;
use crate::scene::{Document, History, VolumeSource};
use crate::volume::joint::JointHistogram;

/// The document that is open, with its samples.
pub struct Desk {
    pub history: History,
    /// The project file.
    pub path: Option<PathBuf>,
    /// Folder that relative paths start from.
    pub base: PathBuf,
    /// Of a series the step that was read last.
    pub data: Arc<Data>,
    /// The newest that the worker made, and the document it is of.
    pub object: Option<(Arc<Document>, Arc<Object>)>,
    /// What is shown while a stroke is under way, before it is a step.
    pub preview: Option<Arc<Document>>,
    /// What strokes take hold of, for the range it was made for.
    pub mask: Option<Arc<ValueMask>>,
    /// Of values and steepness, once it was asked for.
    pub joint: Option<Arc<JointHistogram>>,
}

impl Desk {
    /// What is to be seen.
    pub fn shown(&self) -> &Arc<Document> {
        self.preview.as_ref().unwrap_or(self.history.document())
    }

    /// The same of the step that is at hand: another one may still be on its way.
    pub fn at_hand(&self) -> Arc<Document> {
        let (document, step) = (self.shown(), self.data.step);
        if document.step == step { document.clone() } else { Arc::new(Document { step, ..(**document).clone() }) }
    }

    pub fn title(&self) -> String {
        let name = match (&self.path, &self.history.document().volume) {
            (Some(path), _) | (None, VolumeSource::File(path) | VolumeSource::Embedded(path)) => file_name(path),
            (None, VolumeSource::Phantom { name, .. }) => format!("{name} (built in)"),
        };
        format!("{}{name}", if self.history.is_dirty() { "* " } else { "" })
    }

    /// The unit of world coordinates.
    pub fn unit(&self) -> &'static str {
        match self.data.volume.grid.space {
            crate::volume::Space::Unknown => "units",
            _ => "mm",
        }
    }
}

/// The last part of a path, to be shown.
pub fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

/// A name beside the file that is open.
pub fn suggested(desk: &Desk, extension: &str) -> String {
    let from = match (&desk.path, &desk.history.document().volume) {
        (Some(path), _) => path.clone(),
        (None, VolumeSource::File(p) | VolumeSource::Embedded(p)) => desk.base.join(p),
        (None, VolumeSource::Phantom { name, .. }) => PathBuf::from(name),
    };
    // `.nii.gz` is one ending
    let stem = from.file_stem().map(PathBuf::from).unwrap_or_default();
    let stem = stem.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let name = format!("{stem}-sculpted.{extension}");
    let folder = from.parent().filter(|p| !p.as_os_str().is_empty()).map(Path::to_path_buf);
    folder.map_or(name.clone(), |f| f.join(&name).to_string_lossy().into_owned())
}

/// At most 256 pixels along the longer side.
pub fn thumbnail(image: &egui::ColorImage) -> Option<Vec<u8>> {
    let [w, h] = image.size;
    let longest = w.max(h).max(1);
    let (tw, th) = ((w * 256 / longest).max(1), (h * 256 / longest).max(1));
    let pixels = (0..th)
        .flat_map(|y| (0..tw).map(move |x| (x, y)))
        .map(|(x, y)| image.pixels[(y * h / th) * w + x * w / tw].to_srgba_unmultiplied())
        .collect();
    crate::render::Picture { width: tw as u32, height: th as u32, pixels }.png().ok()
}

//! Long work beside the window: reading, saving, exporting, asking for a file. Each is a line in the status bar.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Instant;

use eframe::egui;

use super::desk::file_name;
use super::guard::guarded;
use super::turntable::{self, Turntable};
use crate::evaluate::certificate::{self, Certificate, Subject, TetField};
use crate::evaluate::export::{ExportError, ExportOptions, Precision, stored_outside};
use crate::evaluate::load::{self, Data, Object, Workspace};
use crate::evaluate::masked::ValueMask;
use crate::evaluate::picture::{Backend, Mode, Refinement, Renderer, ViewOptions};
use crate::evaluate::{EvaluateError, resample, tets};
use crate::io;
use crate::render::Look;
use crate::scene::{self, Document, Kept, VolumeSource};
use crate::volume::Volume;
use crate::volume::joint::{self, JointHistogram};

/// A document with its samples, ready to be worked on.
#[derive(Debug)]
pub struct Loaded {
    /// The project file, if it is one.
    pub path: Option<PathBuf>,
    pub base: PathBuf,
    pub document: Document,
    pub data: Arc<Data>,
    /// Something the user should know.
    pub warnings: Vec<String>,
    /// It was put aside by a modeller that is gone; the file to remove when it is safe.
    pub aside: Option<PathBuf>,
}

/// What an export is asked to do.
#[derive(Debug, Clone)]
pub struct ExportJob {
    pub path: PathBuf,
    pub mode: ExportMode,
    pub options: ExportOptions,
    pub certificate: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExportMode {
    Slicing,
    Tets,
    Reference,
}

#[derive(Debug)]
pub struct Exported {
    pub path: PathBuf,
    pub dims: [usize; 3],
    pub ms: f64,
    pub notes: Vec<String>,
    pub certificate: Option<Certificate>,
}

/// What a file was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    Open,
    Save,
    Export,
    Screenshot,
    Proxy,
}

/// How a task ended.
#[derive(Debug)]
pub enum Outcome {
    Loaded(Box<Loaded>),
    Saved {
        path: PathBuf,
        document: Arc<Document>,
    },
    Exported(Box<Exported>),
    Written(PathBuf),
    Chosen(Purpose, PathBuf),
    /// A mask by value, of this volume.
    Masked(Arc<Data>, Arc<ValueMask>),
    /// The joint histogram of this volume.
    Counted(Arc<Data>, Arc<JointHistogram>),
    /// Nothing was chosen, or it was cancelled: nothing more to say.
    Nothing,
    Failed(String),
}

#[derive(Debug, Default)]
struct State {
    /// Per mille; 0 where nobody knows.
    progress: AtomicU32,
    cancelled: AtomicBool,
}

/// One piece of work under way.
#[derive(Debug)]
pub struct Task {
    pub name: String,
    pub started: Instant,
    /// Stopping it makes sense.
    pub can_cancel: bool,
    state: Arc<State>,
    outcome: Receiver<Outcome>,
}

impl Task {
    fn start(
        ctx: &egui::Context,
        name: impl Into<String>,
        can_cancel: bool,
        work: impl FnOnce(&Watch) -> Result<Outcome, String> + Send + 'static,
    ) -> Self {
        let state = Arc::new(State::default());
        let (send, outcome) = channel();
        let watch = Watch { state: state.clone(), ctx: ctx.clone() };
        let spawned = std::thread::Builder::new().name("task".to_owned()).spawn(move || {
            let outcome = match guarded(|| work(&watch)) {
                Ok(Ok(outcome)) => outcome,
                Ok(Err(_)) if watch.state.cancelled.load(Ordering::Relaxed) => Outcome::Nothing,
                Ok(Err(what)) | Err(what) => Outcome::Failed(what),
            };
            let _ = send.send(outcome);
            watch.ctx.request_repaint();
        });
        let name = name.into();
        let name = if spawned.is_err() { format!("{name}: no thread could be started") } else { name };
        Self { name, started: Instant::now(), can_cancel, state, outcome }
    }

    /// Part done, 0 to 1, where it is known.
    pub fn progress(&self) -> Option<f32> {
        let p = self.state.progress.load(Ordering::Relaxed);
        (p > 0).then_some(p as f32 / 1000.0)
    }

    pub fn cancel(&self) {
        self.state.cancelled.store(true, Ordering::Relaxed);
    }

    /// How it ended, once.
    pub fn poll(&self) -> Option<Outcome> {
        match self.outcome.try_recv() {
            Ok(outcome) => Some(outcome),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Outcome::Nothing),
        }
    }
}

struct Watch {
    state: Arc<State>,
    ctx: egui::Context,
}

impl Watch {
    fn report(&self, done: f64) -> ControlFlow<()> {
        let now = (done * 1000.0) as u32;
        if self.state.progress.swap(now, Ordering::Relaxed) / 20 != now / 20 {
            self.ctx.request_repaint();
        }
        if self.state.cancelled.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Reads a project, a volume or a phantom.
pub fn open(ctx: &egui::Context, word: &str) -> Task {
    let word = word.to_owned();
    let name = Path::new(&word).file_name().map_or(word.clone(), |n| n.to_string_lossy().into_owned());
    Task::start(ctx, format!("Opening {name}"), false, move |_| {
        let path = Path::new(&word);
        let is_project = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("voxclay"));
        if is_project {
            let project = scene::read_project(path).map_err(|e| e.to_string())?;
            let base = path.parent().map(Path::to_path_buf).unwrap_or_default();
            let mut loaded = read(project.document, base)?;
            if project.checksum.is_some_and(|sum| sum != loaded.data.volume.checksum()) {
                loaded.warnings.push("the volume has changed since the project was saved".to_owned());
            }
            loaded.path = Some(path.to_owned());
            return Ok(Outcome::Loaded(Box::new(loaded)));
        }
        let (document, base) = crate::evaluate::open(&word).map_err(|e| e.to_string())?;
        Ok(Outcome::Loaded(Box::new(read(document, base)?)))
    })
}

/// Goes on with work that was put aside.
pub fn recover(ctx: &egui::Context, file: PathBuf, aside: super::recovery::Aside) -> Task {
    Task::start(ctx, "Recovering unsaved work", false, move |_| {
        let mut loaded = read(aside.document, aside.base)?;
        loaded.path = aside.path;
        loaded.aside = Some(file);
        Ok(Outcome::Loaded(Box::new(loaded)))
    })
}

fn read(mut document: Document, base: PathBuf) -> Result<Loaded, String> {
    let mut warnings = Vec::new();
    let data = match Data::read_step(&document.volume, &base, document.step) {
        // the series has become shorter: the rest of the document is worth opening
        Err(e @ EvaluateError::Io(io::IoError::NoStep { .. })) => {
            warnings.push(format!("{e}; step 0 is shown instead"));
            document.step = 0;
            Data::read(&document.volume, &base)
        }
        read => read,
    };
    let data = Arc::new(data.map_err(|e| e.to_string())?);
    Ok(Loaded { path: None, base, document, data, warnings, aside: None })
}

/// Writes the project. Files below the project's folder are kept by relative paths.
pub fn save(
    ctx: &egui::Context,
    path: PathBuf,
    document: Arc<Document>,
    base: PathBuf,
    data: Arc<Data>,
    thumbnail: Option<Vec<u8>>,
    embed: bool,
) -> Task {
    let name = file_name(&path);
    Task::start(ctx, format!("Saving {name}"), false, move |_| {
        let mut stored = (*document).clone();
        let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
        relocate(&mut stored, &base, &folder);
        // samples that came out of a project go into the next one
        let embed = embed || matches!(document.volume, VolumeSource::Embedded(_));
        // another step may have been on its way
        let data = Workspace::with_data(&base, document.volume.clone(), data)
            .data(&document.volume, document.step)
            .map_err(|e| e.to_string())?;
        let kept = Kept {
            checksum: Some(data.volume.checksum()),
            thumbnail: thumbnail.as_deref(),
            embed: embed.then_some(&*data.volume),
        };
        scene::write_project(&path, &stored, &kept).map_err(|e| e.to_string())?;
        Ok(Outcome::Saved { path, document })
    })
}

/// Lets relative paths start at another folder.
fn relocate(document: &mut Document, base: &Path, folder: &Path) {
    let absolute = |p: &Path| std::path::absolute(p).unwrap_or_else(|_| p.to_owned());
    let folder = absolute(folder);
    let moved = |p: &mut PathBuf| {
        let full = absolute(&base.join(&*p));
        *p = full.strip_prefix(&folder).map(Path::to_path_buf).unwrap_or(full);
    };
    match &mut document.volume {
        VolumeSource::File(p) => moved(p),
        VolumeSource::Embedded(_) | VolumeSource::Phantom { .. } => {}
    }
    if let scene::ProxySource::Mesh(p) = &mut document.proxy {
        moved(p);
    }
}

/// Resamples and writes the deformed volume, as `voxclay export` does.
pub fn export(ctx: &egui::Context, document: Arc<Document>, base: PathBuf, data: Arc<Data>, job: ExportJob) -> Task {
    let name = file_name(&job.path);
    Task::start(ctx, format!("Exporting {name}"), true, move |watch| {
        let started = Instant::now();
        let object =
            Workspace::with_data(&base, document.volume.clone(), data).object(&document).map_err(|e| e.to_string())?;
        let (volume, certificate, notes) = exported(&object, &job, watch).map_err(|e| e.to_string())?;
        if watch.state.cancelled.load(Ordering::Relaxed) {
            return Ok(Outcome::Nothing);
        }
        io::write_volume(&job.path, &volume, &io::WriteOptions::default()).map_err(|e| e.to_string())?;
        Ok(Outcome::Exported(Box::new(Exported {
            path: job.path,
            dims: volume.grid.dims,
            ms: started.elapsed().as_secs_f64() * 1e3,
            notes,
            certificate,
        })))
    })
}

fn exported(
    object: &Object,
    job: &ExportJob,
    watch: &Watch,
) -> Result<(Volume, Option<Certificate>, Vec<String>), EvaluateError> {
    let mut notes = Vec::new();
    let prepared = object.stack.prepared();
    let subject = |output, outside| Subject {
        input: &object.volume,
        output,
        interpolation: job.options.interpolation,
        outside,
        density: false,
    };
    match job.mode {
        ExportMode::Slicing | ExportMode::Reference => {
            let precision = if job.mode == ExportMode::Reference { Precision::Reference } else { Precision::Fast };
            let options = ExportOptions { precision, ..job.options };
            let made = resample::export_watched(object, &options, Backend::Cpu, &|done| watch.report(done))?;
            if made.report.clipped > 0 {
                notes.push(format!(
                    "{} voxels were pulled out of the grid and are not in the file",
                    made.report.clipped
                ));
            }
            let certificate = if job.certificate {
                let outside = stored_outside(&object.volume, options.outside);
                Some(certificate::of_map(&subject(&made.volume, outside), &prepared)?)
            } else {
                None
            };
            Ok((made.volume, certificate, notes))
        }
        ExportMode::Tets => {
            let made = tets::resample(object, &job.options, Refinement::Tolerance(tets::TOLERANCE))?;
            if watch.report(0.9).is_break() {
                return Err(ExportError::Cancelled.into());
            }
            let lattice = &made.lattice.report;
            notes.push(format!("{} tetrahedra, right to {:.3} voxels", lattice.tets, lattice.max_error));
            let certificate = if job.certificate {
                let field = TetField {
                    tets: &made.lattice.mesh.tets,
                    rest: &made.lattice.mesh.points,
                    deformed: made.lattice.deformed(),
                    fills: true,
                    exact: Some(&prepared),
                };
                Some(certificate::of_lattice(&subject(&made.volume, made.outside), &field, &prepared)?)
            } else {
                None
            };
            Ok((made.volume, certificate, notes))
        }
    }
}

/// A picture for others: any size, transparent if wanted, drawn twice as fine and averaged.
pub struct Screenshot {
    pub path: PathBuf,
    pub size: (u32, u32),
    pub mode: Mode,
    pub transparent: bool,
    pub background: [[f32; 3]; 2],
}

pub fn screenshot(
    ctx: &egui::Context,
    document: Arc<Document>,
    base: PathBuf,
    data: Arc<Data>,
    backend: Backend,
    shot: Screenshot,
) -> Task {
    Task::start(ctx, "Taking a picture", false, move |_| {
        let object =
            Workspace::with_data(&base, document.volume.clone(), data).object(&document).map_err(|e| e.to_string())?;
        let options = ViewOptions {
            size: (shot.size.0 * 2, shot.size.1 * 2),
            slices: document.look.slices,
            mode: shot.mode,
            refinement: Refinement::Tolerance(crate::evaluate::geometry::TOLERANCE),
            backend,
            transparent: shot.transparent,
            corrections: None,
        };
        let background = document.look.background.unwrap_or(shot.background);
        let look = Look { background, ..document.look.look(object.iso) };
        let mut renderer = Renderer::new(backend).map_err(|e| e.to_string())?;
        let camera = object.camera(&document.camera);
        let (picture, _) = renderer.picture(&object, &camera, &look, &options).map_err(|e| e.to_string())?;
        let png = picture.halved().png().map_err(|e| e.to_string())?;
        io::write_atomic(&shot.path, |w| std::io::Write::write_all(w, &png)).map_err(|e| e.to_string())?;
        Ok(Outcome::Written(shot.path))
    })
}

/// The object on a turntable.
pub fn turntable(
    ctx: &egui::Context,
    document: Arc<Document>,
    base: PathBuf,
    data: Arc<Data>,
    options: ViewOptions,
    ground: [[f32; 3]; 2],
    table: Turntable,
) -> Task {
    Task::start(ctx, "Turning", true, move |watch| {
        let object =
            Workspace::with_data(&base, document.volume.clone(), data).object(&document).map_err(|e| e.to_string())?;
        let look = Look { background: document.look.background.unwrap_or(ground), ..document.look.look(object.iso) };
        let made = turntable::make(&object, &document.camera, &look, &options, &table, &|done| watch.report(done))?;
        Ok(Outcome::Written(made))
    })
}

/// What masks are called in the status bar.
pub const MASKING: &str = "Preparing the mask";

/// Finds out where values within a range are.
pub fn mask(ctx: &egui::Context, data: Arc<Data>, range: [f64; 2]) -> Task {
    Task::start(ctx, MASKING, false, move |_| {
        let mask = ValueMask::of(&data.volume, range);
        Ok(Outcome::Masked(data, Arc::new(mask)))
    })
}

/// What the joint histogram is called in the status bar.
pub const COUNTING: &str = "Counting values and steepness";

/// Counts how often values meet steepness.
pub fn joint(ctx: &egui::Context, data: Arc<Data>) -> Task {
    Task::start(ctx, COUNTING, false, move |_| {
        let made = joint::joint(&data.volume, data.volume.channels - 1, data.field.range);
        Ok(Outcome::Counted(data, Arc::new(made)))
    })
}

/// Asks the system for a file name. Where there is no dialog service nothing is chosen, and the typed path remains.
pub fn choose(ctx: &egui::Context, purpose: Purpose, start: Option<PathBuf>) -> Task {
    Task::start(ctx, "Choosing a file", false, move |_| {
        let mut dialog = rfd::FileDialog::new();
        if let Some(folder) = start.as_ref().and_then(|s| s.parent()).filter(|f| f.is_dir()) {
            dialog = dialog.set_directory(folder);
        }
        if let Some(name) = start.as_ref().and_then(|s| s.file_name()) {
            dialog = dialog.set_file_name(name.to_string_lossy());
        }
        let volumes = ["nrrd", "nhdr", "nii", "gz", "mha", "mhd", "raw", "vti", "vtk"];
        let chosen = match purpose {
            Purpose::Open => dialog
                .add_filter("Projects and volumes", &[&["voxclay"], &volumes[..]].concat())
                .add_filter("All files", &["*"])
                .pick_file(),
            Purpose::Proxy => dialog.add_filter("Surfaces", &["obj", "stl", "ply", "vtk"]).pick_file(),
            Purpose::Save => dialog.add_filter("Voxclay project", &["voxclay"]).save_file(),
            Purpose::Export => dialog.add_filter("Volumes", &volumes[..7]).save_file(),
            Purpose::Screenshot => dialog.add_filter("PNG", &["png"]).save_file(),
        };
        Ok(chosen.map_or(Outcome::Nothing, |path| Outcome::Chosen(purpose, path)))
    })
}

/// The file a word stands for, with `~` for the home folder.
pub fn typed_path(word: &str) -> PathBuf {
    let word = word.trim().trim_matches('"');
    match (word.strip_prefix("~/"), std::env::var_os("HOME")) {
        (Some(rest), Some(home)) => PathBuf::from(home).join(rest),
        _ => PathBuf::from(word),
    }
}

/// Whether a word names something that can be opened; a plain reason if not.
pub fn can_open(word: &str) -> Result<(), String> {
    if word.starts_with("phantom:") {
        return load::parse_source(word).map(|_| ()).map_err(|e| e.to_string());
    }
    let path = typed_path(word);
    if path.is_file() { Ok(()) } else { Err(format!("{}: there is no such file", path.display())) }
}

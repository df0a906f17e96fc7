//! From a document to the data that every picture and export of it needs: samples, proxy mesh, deformation.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use crate::deform::{Deformer, Limit, Stack};
use crate::io;
use crate::mesh::check;
use crate::mesh::{self, Topology, TriMesh};
use crate::render::{Camera, Field, TexelSlice};
use crate::scene::{CameraSpec, CutPlane, Document, Placement, ProxySource, VolumeSource, read_embedded};
use crate::volume::phantom::Phantom;
use crate::volume::pyramid::BLOCK;
use crate::volume::statistics::{Histogram, histogram};
use crate::volume::transfer::TransferFunction;
use crate::volume::{Grid, Scalar, Volume};

use super::EvaluateError;
use super::series::{self, Basis};
use crate::with_samples;

const HISTOGRAM_BINS: usize = 256;

/// A document with its data at hand.
#[derive(Debug, Clone)]
pub struct Object {
    pub volume: Arc<Volume>,
    /// The samples as renderers read them.
    pub field: Field,
    pub transfer: TransferFunction,
    /// Real values that the transfer function's window `[0, 1]` stands for.
    pub window: [f64; 2],
    /// A real value that separates object from surroundings.
    pub iso: f64,
    /// Centre and radius, in the world, of a ball around what stands out from the surroundings.
    pub focus: (DVec3, f64),
    /// The proxy mesh in the world, moved by the shape tools.
    pub mesh: TriMesh,
    pub topology: Arc<Topology>,
    /// Whether parts of the mesh were found to overlap when it was read, so that its sections are to be united.
    pub overlaps: bool,
    /// What the placement turns and scales about, before it moves: the middle of the undeformed mesh, in the world.
    pub pivot: DVec3,
    /// Whether the mesh is more than the volume's box.
    pub shaped: bool,
    pub stack: Stack,
    /// What is cut away from view, with unit normals.
    pub clip: Vec<CutPlane>,
    /// Plain sentences for the user.
    pub warnings: Vec<String>,
}

/// What depends on nothing but the volume, of a series one step.
#[derive(Debug, Clone)]
pub struct Data {
    pub volume: Arc<Volume>,
    /// The samples as renderers read them.
    pub field: Field,
    /// Which step it is.
    pub step: usize,
    /// What it has in common with all steps: the scale that values are shown on.
    pub basis: Arc<Basis>,
    /// Of the channel that carries the opacity: the only one, or the last.
    pub histogram: Histogram,
    /// A real value that separates object from surroundings.
    pub iso: f64,
    /// Centre and radius, in the world, of a ball around what stands out from the surroundings.
    pub focus: (DVec3, f64),
}

impl Data {
    /// Reads or makes a volume, of a series its first step, and prepares it.
    ///
    /// # Errors
    /// As [`read_source`].
    pub fn read(source: &VolumeSource, base: &Path) -> Result<Self, EvaluateError> {
        Self::read_step(source, base, 0)
    }

    /// Reads a step of a series, and before it the first one, on whose scale it is shown.
    ///
    /// # Errors
    /// If there is no such step, it is not like the first, and as [`read_source`].
    pub fn read_step(source: &VolumeSource, base: &Path, step: usize) -> Result<Self, EvaluateError> {
        let (series, name) = (series::files(source, base)?, series::name(source, base));
        let steps = series.as_ref().map_or(1, io::Series::steps);
        if step >= steps {
            return Err(series::no_step(&name, step, steps));
        }
        let volume = match &series {
            Some(series) => series.read(0)?,
            None => read_source(source, base)?,
        };
        let first = Self::first(volume, phantom(source).map(|p| p.suggested().iso), series, name);
        if step == 0 {
            return Ok(first);
        }
        // or both would be held at once
        let Self { basis, .. } = first;
        Self::at_step(&basis, step)
    }

    /// Reads a step of a series whose first is known.
    ///
    /// # Errors
    /// As [`Data::read_step`].
    pub fn at_step(basis: &Arc<Basis>, step: usize) -> Result<Self, EvaluateError> {
        let Some(series) = basis.series.as_ref().filter(|series| step < series.steps()) else {
            return Err(series::no_step(&basis.path, step, basis.steps));
        };
        let volume = Arc::new(basis.fit(&series.file(step), series.read(step)?)?);
        let field = Field::from_volume(Arc::clone(&volume));
        let histogram = counted(&volume, &field);
        let Basis { iso, focus, .. } = **basis;
        Ok(Self { volume, field, step, basis: Arc::clone(basis), histogram, iso, focus })
    }

    /// Prepares a volume; the isovalue is found in the histogram where none is given.
    pub fn new(volume: Volume, iso: Option<f64>) -> Self {
        Self::first(volume, iso, None, PathBuf::new())
    }

    fn first(volume: Volume, iso: Option<f64>, series: Option<io::Series>, path: PathBuf) -> Self {
        let volume = Arc::new(volume);
        let field = Field::from_volume(Arc::clone(&volume));
        let histogram = counted(&volume, &field);
        let iso = iso.unwrap_or_else(|| threshold(&histogram));
        let focus = focus(&field, iso);
        let basis = Basis {
            path,
            steps: series.as_ref().map_or(1, io::Series::steps),
            series,
            grid: volume.grid,
            scalar: volume.samples.scalar_type(),
            channels: volume.channels,
            range: field.range,
            counts: histogram.counts.clone(),
            iso,
            focus,
        };
        Self { volume, field, step: 0, basis: Arc::new(basis), histogram, iso, focus }
    }
}

fn counted(volume: &Volume, field: &Field) -> Histogram {
    let [lo, hi] = field.range;
    histogram(volume, volume.channels - 1, lo, hi, HISTOGRAM_BINS)
}

/// What was read and made for a document, kept from change to change: a stroke reads nothing and makes no mesh again.
#[derive(Debug, Default)]
pub struct Workspace {
    base: PathBuf,
    data: Option<(VolumeSource, Arc<Data>)>,
    /// The undeformed mesh where it is more than a box, and what it was made for.
    shape: Option<(ProxySource, Shape)>,
}

#[derive(Debug, Clone)]
struct Shape {
    mesh: Arc<TriMesh>,
    topology: Arc<Topology>,
    overlaps: bool,
    warnings: Vec<String>,
}

impl Workspace {
    /// Relative paths of documents start at `base`.
    pub fn new(base: &Path) -> Self {
        Self { base: base.to_owned(), ..Self::default() }
    }

    /// With a volume, of a series one step, that was read before.
    pub fn with_data(base: &Path, source: VolumeSource, data: Arc<Data>) -> Self {
        Self { base: base.to_owned(), data: Some((source, data)), shape: None }
    }

    /// A step of the volume of a document; read if it is another one than last time.
    ///
    /// # Errors
    /// As [`Data::read_step`].
    pub fn data(&mut self, source: &VolumeSource, step: usize) -> Result<Arc<Data>, EvaluateError> {
        // taken out before another is read, or both would be held at once
        let data = match self.data.take() {
            Some((known, data)) if known == *source && data.step == step => data,
            Some((known, data)) if known == *source => {
                self.forget_hull();
                let basis = Arc::clone(&data.basis);
                drop(data);
                Arc::new(Data::at_step(&basis, step)?)
            }
            other => {
                drop(other);
                self.shape = None;
                Arc::new(Data::read_step(source, &self.base, step)?)
            }
        };
        self.data = Some((source.clone(), data.clone()));
        Ok(data)
    }

    /// Goes on with another step of the same series, read elsewhere.
    pub fn go_on_with(&mut self, data: Arc<Data>) {
        if let Some((_, known)) = &mut self.data {
            *known = data;
            self.forget_hull();
        }
    }

    /// A hull is of the values of one step; other shapes stay.
    fn forget_hull(&mut self) {
        if matches!(self.shape, Some((ProxySource::Auto { .. }, _))) {
            self.shape = None;
        }
    }

    /// Everything a document refers to.
    ///
    /// # Errors
    /// If a file is missing or wrong, a name is unknown, or the shape tools fold the mesh.
    pub fn object(&mut self, document: &Document) -> Result<Object, EvaluateError> {
        let data = self.data(&document.volume, document.step)?;
        let Data { volume, field, iso, focus, basis, .. } = &*data;
        let transfer = match &document.transfer_function {
            Some(own) => own.clone(),
            None => transfer(&document.transfer, &self.base, basis.range, &basis.counts)?,
        };
        let window = transfer.resolve(basis.range);
        let mut warnings = Vec::new();
        let stack = unfolded(document, &mut warnings);
        let (mesh, topology, overlaps, pivot) = self.proxy(document, &stack, volume, *iso, &mut warnings)?;
        let shaped = document.proxy != ProxySource::Box || document.placement != Placement::default();
        Ok(Object {
            volume: volume.clone(),
            field: field.clone(),
            transfer,
            window,
            iso: *iso,
            focus: *focus,
            mesh,
            topology,
            overlaps,
            pivot,
            shaped,
            stack,
            clip: document.clip.planes(&volume.grid.world_from_texture()),
            warnings,
        })
    }

    /// The proxy mesh in the world, placed and moved by the shape tools, whether parts of it overlap, and what it was
    /// placed about.
    fn proxy(
        &mut self,
        document: &Document,
        stack: &Stack,
        volume: &Volume,
        iso: f64,
        warnings: &mut Vec<String>,
    ) -> Result<(TriMesh, Arc<Topology>, bool, DVec3), EvaluateError> {
        if document.proxy == ProxySource::Box {
            // a box that holds the volume must also hold what was pulled out of it
            let grown = grown_box(&volume.grid, stack);
            let mesh = placed(&grown, &document.placement)?;
            let topology = Topology::build(mesh.positions.len(), &mesh.triangles);
            return Ok((mesh, Arc::new(topology), false, middle(&grown)));
        }
        let shape = match &self.shape {
            Some((known, shape)) if *known == document.proxy => shape.clone(),
            _ => {
                let shape = shape(&document.proxy, &self.base, volume, iso)?;
                self.shape = Some((document.proxy.clone(), shape.clone()));
                shape
            }
        };
        warnings.extend_from_slice(&shape.warnings);
        let placed = placed(&shape.mesh, &document.placement)?;
        let mesh = if matches!(document.proxy, ProxySource::Auto { .. }) {
            // the hull was made for the volume at rest, so it follows everything that moves
            let mut all = stack.clone();
            all.items.iter_mut().for_each(|i| i.moves_shape = true);
            all.move_mesh(&placed)?
        } else {
            stack.move_mesh(&placed)?
        };
        Ok((mesh, shape.topology, shape.overlaps, middle(&shape.mesh)))
    }
}

/// Reads a volume file, of a series the first step, or makes the phantom a name such as `phantom:head` or `phantom:head:192`
/// stands for.
///
/// # Errors
/// If the file cannot be read, or there is no such phantom.
pub fn read_source(source: &VolumeSource, base: &Path) -> Result<Volume, EvaluateError> {
    match source {
        VolumeSource::File(path) => Ok(io::read_volume(&base.join(path))?),
        VolumeSource::Embedded(project) => Ok(read_embedded(&base.join(project))?),
        VolumeSource::Phantom { name, size } => {
            let phantom = Phantom::from_name(name).ok_or_else(|| EvaluateError::NoSuchPhantom(name.clone()))?;
            if !(1..=2048).contains(size) {
                return Err(EvaluateError::PhantomSize(*size));
            }
            Ok(phantom.generate(*size))
        }
    }
}

/// What the word on the command line stands for: `phantom:NAME[:SIZE]` or a file.
///
/// # Errors
/// If the size of a phantom is no number.
pub fn parse_source(word: &str) -> Result<VolumeSource, EvaluateError> {
    let Some(rest) = word.strip_prefix("phantom:") else {
        return Ok(VolumeSource::File(PathBuf::from(word)));
    };
    let (name, size) = match rest.split_once(':') {
        None => (rest, 256),
        Some((name, size)) => (name, size.parse().map_err(|_| EvaluateError::PhantomWord(word.to_owned()))?),
    };
    Ok(VolumeSource::Phantom { name: name.to_owned(), size })
}

/// Fills in what suits a volume that comes without a project: a phantom knows its own best look.
pub fn suggest(document: &mut Document) {
    if let Some(phantom) = phantom(&document.volume) {
        let suggested = phantom.suggested();
        document.transfer = suggested.transfer.to_owned();
        document.camera.yaw = suggested.yaw;
        document.camera.pitch = suggested.pitch;
    }
}

/// Brings everything a document refers to into memory.
///
/// # Errors
/// If a file is missing or wrong, a name is unknown, or the shape tools fold the mesh.
pub fn load(document: &Document, base: &Path) -> Result<Object, EvaluateError> {
    Workspace::new(base).object(document)
}

impl Object {
    /// The camera a document asks for. It does not depend on the deformation, so that the object does not jump in view.
    pub fn camera(&self, spec: &CameraSpec) -> Camera {
        let (center, radius) = self.focus;
        spec.camera(self.volume.grid.space, center, radius)
    }

    /// Whether it is anything else than its volume as a whole, where it lies.
    pub fn is_sculpted(&self) -> bool {
        self.shaped || self.stack.active().next().is_some()
    }
}

/// A ball around all blocks that reach the isovalue; around everything if there are none.
fn focus(field: &Field, iso: f64) -> (DVec3, f64) {
    let level = &field.pyramid.levels[0];
    let [nx, ny, _] = level.dims;
    let mut bounds: Option<(DVec3, DVec3)> = None;
    // the pyramid holds integers as stored, the field's scale is for 0..1
    let unit = match field.texels.slice() {
        TexelSlice::U8(_) => 255.0,
        TexelSlice::U16(_) => 65535.0,
        TexelSlice::F32(_) => 1.0,
    };
    for (b, [low, high]) in level.bounds.iter().enumerate() {
        let real = [low, high].map(|v| f64::from(*v) / unit * field.scale + field.offset);
        if real[0].max(real[1]) >= iso {
            let at = DVec3::new((b % nx) as f64, (b / nx % ny) as f64, (b / (nx * ny)) as f64);
            bounds = Some(bounds.map_or((at, at), |(lo, hi)| (lo.min(at), hi.max(at))));
        }
    }
    let size = field.grid.size();
    let edge = BLOCK as f64;
    let (lo, hi) = bounds.map_or((DVec3::ZERO, size), |(lo, hi)| (lo * edge, ((hi + 1.0) * edge).min(size)));
    let world = |v: DVec3| field.grid.world_from_voxel.transform_point3(v - 0.5);
    let (a, b) = (world(lo), world(hi));
    // objects rarely fill the corners of their box
    (0.5 * (a + b), 0.5 * 0.95 * (b - a).length())
}

/// The stack with every stroke shortened that would fold space, and a sentence about each.
fn unfolded(document: &Document, warnings: &mut Vec<String>) -> Stack {
    let mut stack = document.stack.clone();
    if document.allow_folds {
        return stack;
    }
    for (i, item) in stack.items.iter_mut().enumerate() {
        let Some(effect) = item.effect() else { continue };
        let limited = effect.limited(Limit::default());
        if limited.held_back() > 0.0 {
            let name = if item.name.is_empty() { format!("stroke {}", i + 1) } else { format!("'{}'", item.name) };
            warnings.push(format!(
                "{name} is held back: {:.3} of {:.3} units, longer would fold (widen its extent, or set \"allow_folds\": true)",
                limited.kept, limited.asked
            ));
            (item.deformer, item.opacity) = (limited.deformer, 1.0);
        }
    }
    stack
}

fn phantom(source: &VolumeSource) -> Option<Phantom> {
    match source {
        VolumeSource::Phantom { name, .. } => Phantom::from_name(name),
        VolumeSource::File(_) | VolumeSource::Embedded(_) => None,
    }
}

/// The value that best splits a histogram in two classes (Otsu 1979): the surroundings and the object.
fn threshold(histogram: &Histogram) -> f64 {
    let Histogram { lo, hi, counts, .. } = histogram;
    let total: f64 = counts.iter().map(|&c| c as f64).sum();
    let moment: f64 = counts.iter().enumerate().map(|(i, &c)| i as f64 * c as f64).sum();
    let (mut below, mut moment_below) = (0.0, 0.0);
    let mut best = (0.0, 0);
    for (i, &c) in counts.iter().enumerate() {
        below += c as f64;
        moment_below += i as f64 * c as f64;
        let above = total - below;
        if below > 0.0 && above > 0.0 {
            let apart = moment_below / below - (moment - moment_below) / above;
            let between = below * above * apart * apart;
            if between > best.0 {
                best = (between, i);
            }
        }
    }
    lo + (hi - lo) * (best.1 as f64 + 1.0) / counts.len() as f64
}

fn transfer(name: &str, base: &Path, range: [f64; 2], counts: &[u64]) -> Result<TransferFunction, EvaluateError> {
    if let Some(preset) = TransferFunction::for_volume(name, range, counts) {
        return Ok(preset);
    }
    let path = base.join(name);
    if !path.is_file() {
        let presets = TransferFunction::presets().iter().map(|p| p.name).collect::<Vec<_>>().join(", ");
        return Err(EvaluateError::NoSuchTransfer { name: name.to_owned(), presets });
    }
    // control points are few; what is longer is something else
    let text = io::read_text(&path, 1 << 20)?;
    TransferFunction::parse(&text).map_err(|source| EvaluateError::Transfer { path, source })
}

/// A mesh put where the document says.
fn placed(mesh: &TriMesh, placement: &Placement) -> Result<TriMesh, EvaluateError> {
    let s = placement.scale;
    if let Some(flat) = s.to_array().into_iter().find(|f| !f.is_finite() || *f == 0.0) {
        return Err(EvaluateError::FlatPlacement(flat));
    }
    if *placement == Placement::default() {
        return Ok(mesh.clone());
    }
    Ok(mesh.transformed(&placement.world_from_mesh(middle(mesh))))
}

/// The middle of a mesh's bounds.
fn middle(mesh: &TriMesh) -> DVec3 {
    mesh.bounds().map_or(DVec3::ZERO, |(lo, hi)| 0.5 * (lo + hi))
}

/// A proxy mesh as it was made or read.
fn shape(source: &ProxySource, base: &Path, volume: &Volume, iso: f64) -> Result<Shape, EvaluateError> {
    let mut warnings = Vec::new();
    let mut overlaps = false;
    let mesh = match source {
        ProxySource::Mesh(path) => {
            let path = base.join(path);
            // seams between equal positions are not holes
            let mesh = io::read_surface(&path)?.welded();
            if mesh.triangles.is_empty() {
                return Err(EvaluateError::EmptyMesh(path));
            }
            let defects = check::slicing_defects(&mesh);
            warnings.extend(defects.iter().map(|defect| format!("{}: {defect}", path.display())));
            overlaps = check::overlaps(&defects);
            mesh
        }
        ProxySource::Auto { iso: given } => {
            let iso = given.unwrap_or(iso);
            let stored = volume.rescale;
            let channel = volume.channels - 1;
            with_samples!(&volume.samples, samples => mesh::proxy::enclose(
                volume.grid.dims,
                &volume.grid.world_from_voxel,
                |i| stored.real(samples[i * volume.channels + channel].to_f64()) >= iso,
                &mesh::proxy::ProxyOptions::default(),
            ))?
        }
        ProxySource::Box => grown_box(&volume.grid, &Stack::default()),
    };
    let topology = Arc::new(Topology::build(mesh.positions.len(), &mesh.triangles));
    Ok(Shape { mesh: Arc::new(mesh), topology, overlaps, warnings })
}

/// The box of the texture cube along the voxel axes, grown to hold what the stack pulls out of it.
fn grown_box(grid: &Grid, stack: &Stack) -> TriMesh {
    let texture_from_world = grid.texture_from_world();
    let (mut lo, mut hi) = (DVec3::ZERO, DVec3::ONE);
    for deformer in stack.active() {
        // the displacement is a convex combination of nothing and these vectors, and stays inside the support
        let texture = |v: DVec3| texture_from_world.transform_vector3(v);
        let moves: Vec<DVec3> = match &*deformer {
            Deformer::Displacement(d) => vec![texture(d.vector())],
            Deformer::Grab(g) => vec![texture(g.vector())],
            Deformer::Brush(b) => {
                // in any direction: the corners of the box around a ball
                let rows = texture_from_world.matrix3.transpose();
                let most = DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length()) * b.reach();
                vec![most, -most]
            }
            Deformer::Lattice(l) => l.handles().iter().map(|v| texture(*v)).collect(),
        };
        let (least, most) = moves.into_iter().fold((DVec3::ZERO, DVec3::ZERO), |(a, b), v| (a.min(v), b.max(v)));
        let corners = deformer.support().corners().map(|c| texture_from_world.transform_point3(c));
        let (from, to) = corners.iter().fold((corners[0], corners[0]), |(a, b), c| (a.min(*c), b.max(*c)));
        (lo, hi) = (lo.min((lo + least).max(from)), hi.max((hi + most).min(to)));
    }
    let world = grid.world_from_texture();
    let corner = |i: usize| {
        let pick = |bit: usize, a: f64, b: f64| if i >> bit & 1 == 0 { a } else { b };
        world.transform_point3(DVec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z)))
    };
    mesh::primitives::cuboid(&std::array::from_fn(corner))
}

//! VTK's XML format of images (`.vti`), read in every encoding that VTK 9 writes (see [`super::vtu`]).
//!
//! The volume is the array that `Scalars` names, else the first of 1 to 4 components, at the points; where there is none, at
//! the cells, which lie between the points. `Origin` is the place of index 0, whether or not the extent begins there; `Direction`
//! holds the rows of a matrix. Several pieces are put together.

use std::path::Path;

use glam::{DMat3, DVec3};

use super::error::Fault;
use super::vtk_xml::{Document, Element};
use super::words::show;
use super::{IoError, header};
use crate::volume::{Grid, Samples, Scalar, Space, Volume};
use crate::with_samples;

/// Lower and upper index along each axis.
type Extent = [[i64; 2]; 3];

/// Reads a `.vti` file; `path` is for messages only.
///
/// # Errors
/// As [`super::read_volume`], or if it is compressed by LZ4 or LZMA.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Volume, IoError> {
    let document = Document::parse(bytes, "ImageData").map_err(|fault| fault.of(path))?;
    let frame = Frame::read(&document).map_err(|what| IoError::malformed(path, what))?;
    let grid = frame.grid(path)?;
    let (samples, channels) = frame.samples(&document).map_err(|fault| fault.of(path))?;
    if Some(samples.len()) != grid.len().checked_mul(channels) {
        return Err(IoError::malformed(path, "its pieces do not fill its extent"));
    }
    Ok(Volume::new(grid, channels, samples))
}

/// Reads the grid of a `.vti` file.
pub(super) fn parse_grid(path: &Path, bytes: &[u8]) -> Result<Grid, IoError> {
    let document = Document::parse(bytes, "ImageData").map_err(|fault| fault.of(path))?;
    Frame::read(&document).map_err(|what| IoError::malformed(path, what))?.grid(path)
}

/// Where the samples lie, and which array they are.
struct Frame {
    /// Of the samples, be they at points or at cells.
    extent: Extent,
    origin: DVec3,
    axes: DMat3,
    /// `PointData` or `CellData`.
    group: &'static str,
    /// Index of the array among those of the group.
    array: usize,
}

impl Frame {
    fn read(document: &Document) -> Result<Self, String> {
        let image = document.body()?;
        let whole = extent(image, "WholeExtent")?;
        let spacing: [f64; 3] = numbers(image, "Spacing", [1.0; 3])?;
        let origin = DVec3::from_array(numbers(image, "Origin", [0.0; 3])?);
        let direction: [f64; 9] = numbers(image, "Direction", [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])?;
        let axes = DMat3::from_cols_array(&direction).transpose() * DMat3::from_diagonal(DVec3::from_array(spacing));
        let first = image.child("Piece").ok_or("has no element Piece")?;
        let found = ["PointData", "CellData"].into_iter().find_map(|group| Some((group, choice(first.child(group)?)?)));
        let (group, array) = found.ok_or("has no array of 1 to 4 numbers for each point or each cell")?;
        let at_cells = group == "CellData";
        let low = DVec3::from_array(whole.map(|e| e[0] as f64)) + DVec3::splat(if at_cells { 0.5 } else { 0.0 });
        Ok(Self { extent: of_samples(whole, at_cells), origin: origin + axes * low, axes, group, array })
    }

    fn grid(&self, path: &Path) -> Result<Grid, IoError> {
        header::grid(path, size(&self.extent), self.axes, self.origin, Space::Unknown)
    }

    fn samples(&self, document: &Document) -> Result<(Samples, usize), Fault> {
        let mut pieces = Vec::new();
        for piece in document.body()?.all("Piece") {
            let extent = of_samples(extent(piece, "Extent")?, self.group == "CellData");
            if (0..3).any(|a| extent[a][0] < self.extent[a][0] || extent[a][1] > self.extent[a][1]) {
                return Err("a piece reaches out of the whole extent".into());
            }
            let element = piece.child(self.group).and_then(|g| g.all("DataArray").nth(self.array));
            let array = element.map(|e| document.array(e)).transpose()?.flatten();
            let array = array.ok_or("a piece lacks the array of the others")?;
            let n = size(&extent).iter().fold(1usize, |n, s| n.saturating_mul(*s));
            if array.numbers.len() != n.saturating_mul(array.components) {
                let (name, have) = (show(array.name.as_bytes()), array.numbers.len());
                return Err(format!(
                    "the array '{name}' has {have} numbers for {n} voxels of {} channels",
                    array.components
                )
                .into());
            }
            let Some(samples) = array.numbers.samples() else {
                let name = show(array.name.as_bytes());
                let what = format!("its array '{name}' has 64-bit integers; Voxclay reads integers of up to 32 bits");
                return Err(Fault::Unsupported(what));
            };
            pieces.push((extent, samples, array.components));
        }
        if pieces.len() == 1 && pieces[0].0 == self.extent {
            return Ok(pieces.pop().map(|(_, samples, channels)| (samples, channels)).ok_or("has no element Piece")?);
        }
        let channels = pieces[0].2;
        let held: usize = pieces.iter().map(|p| p.1.len()).sum();
        let whole = size(&self.extent).iter().fold(channels, |n, s| n.saturating_mul(*s));
        // what the extent claims is believed as far as there are samples
        if whole > held {
            return Err("its pieces do not fill its extent".into());
        }
        let joined = with_samples!(&pieces[0].1, v => self.joined(v, &pieces, channels, whole));
        Ok((joined?, channels))
    }

    /// Puts pieces of one type together.
    fn joined<T: Scalar>(
        &self,
        _: &[T],
        pieces: &[(Extent, Samples, usize)],
        channels: usize,
        whole: usize,
    ) -> Result<Samples, Fault> {
        let mut out = vec![T::zeroed(); whole];
        let mut filled = vec![false; whole / channels];
        let [nx, ny, _] = size(&self.extent);
        for (extent, samples, c) in pieces.iter().filter(|p| !p.1.is_empty()) {
            if samples.scalar_type() != T::TYPE || *c != channels {
                return Err("its pieces have samples of different types".into());
            }
            let samples: &[T] = bytemuck::cast_slice(samples.bytes());
            let row = size(extent)[0];
            let mut rows = samples.chunks_exact((row * channels).max(1));
            for k in extent[2][0]..=extent[2][1] {
                for j in extent[1][0]..=extent[1][1] {
                    let place = [extent[0][0], j, k];
                    let at: [usize; 3] = std::array::from_fn(|a| (place[a] - self.extent[a][0]) as usize);
                    let start = (at[2] * ny + at[1]) * nx + at[0];
                    if let Some(line) = rows.next() {
                        out[start * channels..(start + row) * channels].copy_from_slice(line);
                        filled[start..start + row].fill(true);
                    }
                }
            }
        }
        if filled.contains(&false) {
            return Err("its pieces do not fill its extent".into());
        }
        Ok(T::wrap(out))
    }
}

/// The array of a group to be read, by its index among all: the one that `Scalars` names, else the first that will do.
fn choice(group: &Element) -> Option<usize> {
    let components = |e: &Element| e.get("NumberOfComponents").map_or(Some(1), |n| n.trim().parse().ok());
    let usable = |e: &Element| matches!(components(e), Some(1..=4)) && !matches!(e.get("type"), Some("String" | "Bit"));
    let scalars = group.get("Scalars").filter(|s| !s.is_empty());
    let named = group.all("DataArray").position(|e| usable(e) && scalars.is_some() && e.get("Name") == scalars);
    named.or_else(|| group.all("DataArray").position(usable))
}

fn extent(element: &Element, attribute: &str) -> Result<Extent, String> {
    let [a, b, c, d, e, f]: [i64; 6] = numbers(element, attribute, [0; 6])?;
    // far beyond what VTK can index, and safe to calculate with
    if [a, b, c, d, e, f].iter().any(|x| x.abs() > i64::from(i32::MAX)) {
        return Err(format!("its {attribute} is beyond 32 bits"));
    }
    Ok([[a, b], [c, d], [e, f]])
}

/// Cells are one fewer than points along each axis.
fn of_samples(extent: Extent, at_cells: bool) -> Extent {
    extent.map(|[low, high]| [low, high - i64::from(at_cells)])
}

fn size(extent: &Extent) -> [usize; 3] {
    extent.map(|[low, high]| (high - low + 1).max(0) as usize)
}

fn numbers<T: std::str::FromStr + Copy, const N: usize>(
    element: &Element,
    attribute: &str,
    default: [T; N],
) -> Result<[T; N], String> {
    let Some(text) = element.get(attribute) else {
        let needed = attribute.ends_with("Extent");
        return if needed { Err(format!("an element {} has no {attribute}", element.name)) } else { Ok(default) };
    };
    let list: Option<Vec<T>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
    list.and_then(|l| l.try_into().ok()).ok_or_else(|| {
        format!("an element {} has {attribute} '{}'; it must be {N} numbers", element.name, show(text.as_bytes()))
    })
}

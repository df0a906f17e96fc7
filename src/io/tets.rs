//! Tetrahedral meshes by file extension, and what their readers share.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use super::surface::LARGEST;
use super::volume::Encoding;
use super::{IoError, gmsh, medit, tetgen, vtk, vtu};
use crate::mesh::cells::{CellKind, CellMesh};
use crate::mesh::tets::{PointVectors, TetMesh};

/// Version of Gmsh's file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GmshVersion {
    /// 2.2, which nearly every program reads.
    V22,
    /// 4.1, what Gmsh itself writes.
    #[default]
    V41,
}

/// Choices for [`write_tets`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TetWriteOptions {
    /// Only `.vtu` is compressed; elsewhere [`Encoding::Compressed`] is the same as [`Encoding::Raw`]. Medit and TetGen are
    /// always written as text.
    pub encoding: Encoding,
    /// For `.msh`.
    pub gmsh: GmshVersion,
}

/// Whether the name ends as tetrahedral meshes do: `vtk`, `vtu`, `msh`, `mesh`, `meshb`, `node` or `ele` in any case. A
/// `.vtk` file may hold something else too (see [`super::kind_of`]).
pub fn is_tets_path(path: &Path) -> bool {
    extension(path).is_some_and(|e| matches!(e.as_str(), "vtk" | "vtu" | "msh" | "mesh" | "meshb" | "node" | "ele"))
}

/// Whether the format of this name stores vectors at the points.
pub fn keeps_vectors(path: &Path) -> bool {
    extension(path).is_some_and(|e| matches!(e.as_str(), "vtk" | "vtu" | "msh"))
}

/// Reads a tetrahedral mesh. Points keep their order, and tetrahedra theirs. Vertices, lines, triangles and quadrilaterals are
/// passed over; pyramids, wedges and hexahedra are split ([`CellMesh::into_tets`]). Cells of higher order are taken by their
/// corners; their other points are left out where nothing else uses them. Vectors are as stored, finite or not.
///
/// # Errors
/// If the file cannot be read, is not what its extension says, breaks off, has no solid cell, names points that it does not
/// have or one point twice in a cell, or has coordinates that are not finite.
pub fn read_tets(path: &Path) -> Result<TetMesh, IoError> {
    read_cells(path)?.into_tets(0).map_err(|e| IoError::unsupported(path, e.to_string()))
}

/// Like [`read_tets`], but with the cells as they are stored.
///
/// # Errors
/// As [`read_tets`].
pub fn read_cells(path: &Path) -> Result<CellMesh, IoError> {
    let parse = match extension(path).as_deref() {
        Some("vtk") => vtk::parse_cells,
        Some("vtu") => vtu::parse,
        Some("msh") => gmsh::parse,
        Some("mesh" | "meshb") => medit::parse,
        Some("node" | "ele") => return tetgen::read(path),
        _ => return Err(unknown(path)),
    };
    parse(path, &read_whole(path)?)
}

/// All bytes of a file.
pub(super) fn read_whole(path: &Path) -> Result<Vec<u8>, IoError> {
    let bytes = std::fs::read(path).map_err(|e| IoError::system(path, "read", e))?;
    if bytes.is_empty() {
        return Err(IoError::malformed(path, "the file is empty; a mesh needs points and cells"));
    }
    Ok(bytes)
}

/// Writes a tetrahedral mesh: positions, vectors and regions come back as they were, except that a mesh of Gmsh or Medit whose
/// regions are all 0 comes back without (0 is their word for none).
///
/// # Errors
/// If the extension is none that [`is_tets_path`] knows or `meshb`, the format cannot hold the mesh (vectors in Medit and
/// TetGen, see [`keeps_vectors`]), a position is not finite, or the file cannot be written.
pub fn write_tets(path: &Path, mesh: &TetMesh, options: &TetWriteOptions) -> Result<(), IoError> {
    let write = match extension(path).as_deref() {
        Some("vtk") => vtk::write,
        Some("vtu") => vtu::write,
        Some("msh") => gmsh::write,
        Some("mesh") => medit::write,
        Some("node" | "ele") => tetgen::write,
        Some("meshb") => return Err(IoError::unsupported(path, "is only read; write .mesh instead")),
        _ => return Err(unknown(path)),
    };
    let refuse = |what: String| Err(IoError::unsupported(path, what));
    if let Some(v) = mesh.points.iter().position(|p| !p.is_finite()) {
        return refuse(format!("point {} is not finite, so it cannot be written", v + 1));
    }
    if mesh.points.len() > i32::MAX as usize || mesh.tets.len() > i32::MAX as usize / 5 {
        return refuse("has too many points or tetrahedra for 32-bit numbers, which these formats keep".to_owned());
    }
    if !mesh.regions.is_empty() && mesh.regions.len() != mesh.tets.len() {
        return refuse(format!(
            "has {} regions for {} tetrahedra; each needs one",
            mesh.regions.len(),
            mesh.tets.len()
        ));
    }
    for v in &mesh.vectors {
        if v.values.len() != mesh.points.len() {
            let (n, points) = (v.values.len(), mesh.points.len());
            return refuse(format!("has {n} vectors '{}' for {points} points; each needs one", v.name));
        }
        if v.name.is_empty() || v.name.contains(|c: char| c.is_control() || c == '"') {
            return refuse(
                "has vectors whose name is empty or holds quotes or line ends; give them a plain one".to_owned(),
            );
        }
    }
    if !mesh.vectors.is_empty() && !keeps_vectors(path) {
        return refuse(format!(
            "cannot hold the vectors '{}' of the mesh; use .vtu, .vtk or .msh, or write it without them",
            mesh.vectors[0].name
        ));
    }
    write(path, mesh, options)
}

pub(super) fn extension(path: &Path) -> Option<String> {
    Some(path.extension()?.to_str()?.to_ascii_lowercase())
}

fn unknown(path: &Path) -> IoError {
    IoError::unsupported(
        path,
        "the name does not end in a format of tetrahedral meshes; use .vtu, .vtk, .msh, .mesh or .node",
    )
}

/// Points and solid cells as they come out of a file, before anything is known to be sound.
#[derive(Default)]
pub(super) struct Solids {
    pub points: Vec<DVec3>,
    /// The numbers of the points in the file; empty if they are counted from `first`.
    pub ids: Vec<u64>,
    pub first: u64,
    kinds: Vec<CellKind>,
    /// As numbered in the file.
    corners: Vec<u64>,
    /// Points of cells of higher order, as numbered in the file.
    between: Vec<u64>,
    pub regions: Vec<i32>,
    vectors: Vec<PointVectors>,
    names: HashMap<String, Name>,
}

/// A name of vectors.
struct Name {
    index: usize,
    /// Vectors that should have had this name.
    copies: u32,
}

impl Solids {
    pub fn counted_from(first: u64) -> Self {
        Self { first, ..Self::default() }
    }

    /// Adds a cell by its points, the corners first.
    pub fn cell(&mut self, kind: CellKind, points: &[u64]) {
        let (corners, between) = points.split_at(kind.corners());
        self.kinds.push(kind);
        self.corners.extend_from_slice(corners);
        self.between.extend_from_slice(between);
    }

    /// Number of cells so far.
    pub fn cells(&self) -> usize {
        self.kinds.len()
    }

    /// Adds vectors, one for each point; a name that is there already gets a number behind it.
    pub fn add_vectors(&mut self, name: &str, values: Vec<DVec3>) {
        let mut free = name.to_owned();
        let mut copies = self.names.get(name).map_or(1, |place| place.copies);
        while self.names.contains_key(&free) {
            copies += 1;
            free = format!("{name}#{copies}");
        }
        if let Some(place) = self.names.get_mut(name) {
            place.copies = copies;
        }
        self.names.insert(free.clone(), Name { index: self.vectors.len(), copies: 1 });
        self.vectors.push(PointVectors { name: free, values });
    }

    /// The vectors of this name.
    pub fn vectors_mut(&mut self, name: &str) -> Option<&mut Vec<DVec3>> {
        self.names.get(name).map(|place| &mut self.vectors[place.index].values)
    }

    /// What only some of the parts of a file had is left out.
    pub fn drop_partial_vectors(&mut self) {
        let points = self.points.len();
        self.vectors.retain(|v| v.values.len() == points);
        self.names.clear();
    }

    /// Checks everything.
    pub fn finish(mut self, path: &Path) -> Result<CellMesh, IoError> {
        let n = self.points.len();
        let fail = |what: String| Err(IoError::malformed(path, what));
        if n == 0 {
            return fail("there is no point in it; a mesh needs points and solid cells".to_owned());
        }
        if self.kinds.is_empty() {
            return fail(format!(
                "there are {n} points but no solid cell in it; a mesh needs tetrahedra, pyramids, wedges or hexahedra"
            ));
        }
        if n >= u32::MAX as usize || self.corners.len() >= u32::MAX as usize {
            return Err(IoError::unsupported(path, "it has more than 4 billion points or corners, too many to index"));
        }
        let numbers = Numbering::of(&self).map_err(|what| IoError::malformed(path, what))?;
        if let Some(v) = self.points.iter().position(|p| !(p.abs().max_element() <= LARGEST && p.is_finite())) {
            let (p, id) = (self.points[v], numbers.id(v));
            return fail(format!(
                "point {id} lies at ({}, {}, {}); coordinates must be finite and below {LARGEST:e}",
                p.x, p.y, p.z
            ));
        }
        let mut corners = Vec::with_capacity(self.corners.len());
        let mut rest = self.corners.as_slice();
        for (c, kind) in self.kinds.iter().enumerate() {
            let (cell, after) = rest.split_at(kind.corners());
            rest = after;
            for (i, id) in cell.iter().enumerate() {
                let Some(index) = numbers.index(*id) else {
                    return fail(format!("solid cell {} names point {id}, {}", c + 1, numbers.range()));
                };
                if cell[..i].contains(id) {
                    return fail(format!("solid cell {} names point {id} twice; its corners must differ", c + 1));
                }
                corners.push(index);
            }
        }
        if !self.between.is_empty() {
            let mut between = Vec::with_capacity(self.between.len());
            for id in &self.between {
                let Some(index) = numbers.index(*id) else {
                    return fail(format!("a solid cell names point {id}, {}", numbers.range()));
                };
                between.push(index);
            }
            self.leave_out(&between, &mut corners);
        }
        let Self { points, kinds, regions, vectors, .. } = self;
        Ok(CellMesh { points, kinds, corners, regions, vectors })
    }

    /// Leaves out these points where they are no corner.
    fn leave_out(&mut self, between: &[u32], corners: &mut [u32]) {
        let mut kept = vec![true; self.points.len()];
        between.iter().for_each(|&v| kept[v as usize] = false);
        corners.iter().for_each(|&v| kept[v as usize] = true);
        let mut new = Vec::with_capacity(kept.len());
        let mut count = 0;
        for &k in &kept {
            new.push(count);
            count += u32::from(k);
        }
        corners.iter_mut().for_each(|v| *v = new[*v as usize]);
        let thin = |values: &mut Vec<DVec3>| {
            let mut flags = kept.iter();
            values.retain(|_| flags.next() == Some(&true));
        };
        thin(&mut self.points);
        self.vectors.iter_mut().for_each(|v| thin(&mut v.values));
    }
}

/// How a file numbers its points.
pub(super) struct Numbering {
    /// The number of the first point, if the others follow it one by one.
    first: u64,
    count: usize,
    /// Number and index, ascending; empty if they follow one another.
    sparse: Vec<(u64, u32)>,
    ids: Vec<u64>,
}

impl Numbering {
    /// The error says which number is there twice.
    pub fn of(solids: &Solids) -> Result<Self, String> {
        let count = solids.points.len();
        let first = solids.ids.first().copied().unwrap_or(solids.first);
        let mut out = Self { first, count, sparse: Vec::new(), ids: Vec::new() };
        let one_by_one = solids.ids.iter().enumerate().all(|(i, id)| first.checked_add(i as u64) == Some(*id));
        if !one_by_one {
            out.ids = solids.ids.clone();
            out.sparse = solids.ids.iter().copied().zip(0..).collect();
            out.sparse.sort_unstable();
            if let Some(twice) = out.sparse.windows(2).find(|w| w[0].0 == w[1].0) {
                return Err(format!("point {} is there twice; each point needs a number of its own", twice[0].0));
            }
        }
        Ok(out)
    }

    pub fn index(&self, id: u64) -> Option<u32> {
        if self.sparse.is_empty() {
            return id.checked_sub(self.first).filter(|i| *i < self.count as u64).map(|i| i as u32);
        }
        let at = self.sparse.binary_search_by_key(&id, |s| s.0).ok()?;
        Some(self.sparse[at].1)
    }

    fn id(&self, index: usize) -> u64 {
        self.ids.get(index).copied().unwrap_or(self.first + index as u64)
    }

    /// "but there are only the points 1 to 8".
    fn range(&self) -> String {
        if self.sparse.is_empty() {
            format!("but there are only the points {} to {}", self.first, self.first + self.count as u64 - 1)
        } else {
            "which is not there".to_owned()
        }
    }
}

//! L2: sections of a triangle mesh with a family of parallel planes.
//!
//! # Theory
//!
//! Westermann and Rezk-Salama 2001, section 2.4: space is cut into slabs parallel to the view plane; for each edge the
//! first and the last slab are determined; going from plane to plane, an *active edge list* holds the edges that the
//! current plane crosses. From any entry not yet tagged, a walk over the adjacency of the mesh follows the contour until
//! it meets a tag. The contours are then classified by what encloses them.
//!
//! One rule replaces all special cases: **a vertex whose height is at least that of the plane lies above it.** No vertex
//! is ever *on* a plane, so each plane cuts a triangle in one segment or not at all, each contour of a closed mesh
//! closes, and a face in a plane belongs to the solid on its lower side only. The rule is decided once per vertex, as
//! the whole number of planes at or below it ([`SlabIndex`]); everything after that compares these numbers, so that
//! rounding cannot make two triangles disagree.
//!
//! # Practice
//!
//! [`SlabIndex::build`] does what depends on mesh and view and not on anything else, in linear time; [`SlabIndex::contours`]
//! walks, in time proportional to the number of crossings, in parallel over runs of consecutive planes, each with an
//! active edge list of its own; [`Slices::nest`] classifies. Hold all three results while neither view nor mesh moves.
//! All buffers are kept from view to view.
//!
//! Contours of a mesh that meets itself may cross, or run round what another one has round already. For these,
//! [`Slices::unite`] takes the place of the nesting: what contours wind round together gets one outline, so that whoever
//! comes after need not know.
//!
//! Departures from the paper: entries of the active list carry what the walk needs, so that it stays within the list and
//! one word per triangle, in which the positions of the triangle's two active edges are exclusive-ored: coming from one
//! gives the other, in whichever direction the triangle is oriented. Tags are numbers of planes, so that they need not
//! be cleared. How many points each plane has is known before the walk (crossings are counted with the slabs), so that
//! all threads write into one flat array.

mod index;
mod nest;
mod section;
mod unite;
mod walk;

pub use index::{Planes, SlabIndex, SliceError};
pub use section::BoxSections;

use glam::{DVec2, DVec3};

use crate::mesh::Topology;

/// The sections of all planes, flat. Loops of plane k are `plane_start[k]..plane_start[k + 1]`, points of loop l are
/// `loop_start[l]..loop_start[l + 1]`; a loop is closed from its last point to its first.
///
/// After [`Slices::nest`] or [`Slices::unite`], outer loops run anticlockwise seen from the tip of the normal and holes
/// clockwise.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Slices {
    /// In-plane coordinates along `e1`, `e2` of the planes' frame.
    pub points: Vec<DVec2>,
    /// First point of each loop, and the number of points at the end.
    pub loop_start: Vec<u32>,
    /// First loop of each plane, and the number of loops at the end.
    pub plane_start: Vec<u32>,
    /// Signed area of each loop.
    pub area: Vec<f64>,
    /// For each loop: itself if it is an outer loop, the outer loop around it if it is a hole, [`Slices::NONE`] if it
    /// encloses nothing (its area is within rounding of zero). Empty before [`Slices::nest`] or [`Slices::unite`].
    pub owner: Vec<u32>,
    /// What was wrong with the mesh at these planes; see [`Slices::warnings`].
    defects: [Option<Warning>; Defect::ALL.len()],
    scratch: nest::Scratch,
}

impl Slices {
    /// Stands for "belongs to no outer loop".
    pub const NONE: u32 = u32::MAX;

    pub fn planes(&self) -> usize {
        self.plane_start.len().saturating_sub(1)
    }

    pub fn loops(&self) -> usize {
        self.loop_start.len().saturating_sub(1)
    }

    /// Indices of the loops of plane `k`.
    pub fn plane_loops(&self, k: usize) -> std::ops::Range<usize> {
        self.plane_start[k] as usize..self.plane_start[k + 1] as usize
    }

    /// The points of loop `l`.
    pub fn loop_points(&self, l: usize) -> &[DVec2] {
        &self.points[self.loop_start[l] as usize..self.loop_start[l + 1] as usize]
    }

    /// Area of the section with plane `k`: outer loops less holes.
    pub fn plane_area(&self, k: usize) -> f64 {
        self.plane_loops(k).filter(|&l| self.owner.get(l) != Some(&Self::NONE)).map(|l| self.area[l]).sum()
    }

    /// Numbers of outer loops and of holes in plane `k`. Needs [`Slices::nest`].
    pub fn plane_counts(&self, k: usize) -> (usize, usize) {
        self.plane_loops(k).fold((0, 0), |(outer, holes), l| match self.owner[l] {
            Self::NONE => (outer, holes),
            o if o as usize == l => (outer + 1, holes),
            _ => (outer, holes + 1),
        })
    }

    /// What was wrong, one entry per kind of defect.
    pub fn warnings(&self) -> impl Iterator<Item = &Warning> {
        self.defects.iter().flatten()
    }

    fn warn(&mut self, defect: Defect, plane: u32, at: DVec2, count: u32) {
        note(&mut self.defects, defect, plane, at, count);
    }
}

/// A kind of defect that shows in the sections.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Defect {
    /// The mesh is open: a contour ends at a boundary edge.
    Open,
    /// A vertex is not finite.
    NotFinite,
    /// A contour runs against its nesting depth: triangles point the wrong way.
    Orientation,
    /// Contours of one plane cross each other: the surface intersects itself.
    Crossing,
    /// Contours of a surface that intersects itself run the wrong way round what nothing else encloses.
    Backward,
}

impl Defect {
    const ALL: [Self; 5] = [Self::Open, Self::NotFinite, Self::Orientation, Self::Crossing, Self::Backward];
}

/// A counted defect and where it was met first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Warning {
    pub defect: Defect,
    /// How many contours show it, over all planes.
    pub count: u32,
    /// The first plane that shows it.
    pub plane: u32,
    /// In-plane coordinates of the place.
    pub at: DVec2,
}

impl Warning {
    /// One plain sentence; `planes` gives the place in space.
    pub fn sentence(&self, planes: &Planes) -> String {
        let p: DVec3 = planes.frame.lift(self.at, planes.height(self.plane as usize));
        let contours = if self.count == 1 { "1 contour".into() } else { format!("{} contours", self.count) };
        let what = match self.defect {
            Defect::Open => {
                "the mesh has holes in its surface, so that contours are open; they were closed by straight lines"
            }
            Defect::NotFinite => "the mesh has vertices that are not finite numbers; contours pass them by",
            Defect::Orientation => {
                "triangles of the mesh point the wrong way; contours were classified by what encloses them"
            }
            Defect::Crossing => "the surface intersects itself; parts inside twice count twice",
            Defect::Backward => {
                "a part of the surface faces inward where nothing is around it (a cavity that reaches out of its solid, \
                 perhaps); what lies there was left out"
            }
        };
        format!("{what} ({contours}, first in plane {} near {:.6} {:.6} {:.6})", self.plane, p.x, p.y, p.z)
    }
}

type Defects = [Option<Warning>; Defect::ALL.len()];

fn note(defects: &mut Defects, defect: Defect, plane: u32, at: DVec2, count: u32) {
    match &mut defects[defect as usize] {
        Some(w) => {
            w.count += count;
            if plane < w.plane {
                (w.plane, w.at) = (plane, at);
            }
        }
        none => *none = Some(Warning { defect, count, plane, at }),
    }
}

/// Preparation, contours and nesting in one, with the buffers they need.
#[derive(Debug, Default)]
pub struct Slicer {
    pub index: SlabIndex,
    pub slices: Slices,
    /// Whether parts of the mesh are known to overlap: then [`Slices::unite`] is asked, else [`Slices::nest`], which is
    /// faster.
    pub overlaps: bool,
}

impl Slicer {
    /// The nested sections of a mesh with all planes.
    ///
    /// # Errors
    /// [`SliceError`] if planes or points are too many.
    ///
    /// # Panics
    /// If `topology` has more vertices than there are positions.
    pub fn slice(&mut self, positions: &[DVec3], topology: &Topology, planes: &Planes) -> Result<&Slices, SliceError> {
        self.index.build(positions, topology, planes)?;
        self.index.contours(&mut self.slices);
        self.classify();
        Ok(&self.slices)
    }

    /// The last step of [`Slicer::slice`].
    pub fn classify(&mut self) {
        if self.overlaps { self.slices.unite() } else { self.slices.nest() }
    }
}

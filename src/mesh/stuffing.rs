//! Tetrahedral meshes of the inside of a closed surface: isosurface stuffing, and whole lattice tetrahedra around it.
//!
//! # Theory
//!
//! *Stuffing* (Labelle and Shewchuk 2007). A body-centred cubic lattice covers the surface. Where an edge of it goes through
//! the surface there is a cut point; lattice points that are too near to one move there, so that what the surface
//! leaves of the tetrahedra (`stencils.rs`) never is a sliver. The mesh follows the surface, but cuts off what is finer
//! than the lattice: edges, corners, thin parts.
//!
//! *Enclosing.* To warp a volume, the mesh must contain the object. All tetrahedra of the lattice are kept that share a
//! point with the surface or its inside. Signs are exact, so nothing of the object is outside, and all angles are 60 or
//! 90 degrees; the boundary is ragged, and parts of it may touch at an edge or a point only.
//!
//! *Departures from the paper.* The surface is a triangle mesh: inside is where the winding number is not 0, and cut points
//! are where edges meet triangles (the middle one of several), not zeros of an interpolated function. A lattice point
//! on the surface counts as inside or outside and is then moved by nothing. The thresholds are those that make the
//! smallest angle of all stencils as large as can be, searched numerically with these stencils: 0.28512 of a long edge
//! and 0.3987 of a short one, which gives the paper's bounds of 10.7 and 164.8 degrees. (With 0.24999 and 0.41189,
//! often seen, the same search finds 9.32 and 161.65.) There is no grading: all of the inside is of one size.
//!
//! # Practice
//!
//! The spacing is that wanted, or is found by trying: a mesh of N tetrahedra at spacing h has about N (h / k)^3 of them
//! at spacing k, or fewer where the boundary is a large part. What came out is measured and reported, not assumed.

use glam::DVec3;
use rayon::prelude::*;

use super::TriMesh;
use super::bcc::Bcc;
use super::check::MeshReport;
use super::fill::{enclosing, stuffed};
use super::locate::Locator;
use super::random::Random;
use super::tet_faces::{TetFaces, surface as surface_of};
use super::tet_quality::TetQuality;
use super::tets::TetMesh;

/// Tetrahedra that may be wanted, at most.
pub const MOST_TETS: usize = 1 << 25;
/// Cubes of the lattice, at most.
const MOST_CELLS: f64 = (1u64 << 25) as f64;
/// Tetrahedra for each cube of the lattice.
const TETS_PER_CELL: f64 = 12.0;
/// Meshes made in search of a spacing, at most.
const TRIES: usize = 14;
/// How far from the wanted number the search ends, as a part of it.
const CLOSE: f64 = 0.05;
/// Points inside by which containment is measured.
const SAMPLES: usize = 4096;

/// How fine the mesh is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fineness {
    /// Edge of the lattice's cubes, in world units.
    Spacing(f64),
    /// Number of tetrahedra, met within about a fifth where the shape allows.
    Tets(usize),
    /// How far the mesh may be from the surface, in world units, up to this many tetrahedra.
    Tolerance { distance: f64, most_tets: usize },
}

/// What is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StuffingOptions {
    pub fineness: Fineness,
    /// Whole lattice tetrahedra that contain the object, instead of ones that end at its surface.
    pub enclose: bool,
}

/// Why there is no mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StuffingError {
    #[error("the surface has no triangles, so there is nothing to fill")]
    NoSurface,
    #[error("the surface has no clear inside: {0}; repair it first")]
    Unclear(String),
    #[error("the surface encloses no volume")]
    Flat,
    #[error("the {what} of {value} is not possible; it must be a positive number")]
    NotPositive { what: &'static str, value: f64 },
    #[error("{0} tetrahedra are wanted; ask for 1 to {MOST_TETS}")]
    Wanted(usize),
    #[error("a spacing of {spacing} makes a lattice of {cells:.3e} cubes; at most {MOST_CELLS} are possible")]
    TooFine { spacing: f64, cells: f64 },
    #[error("at a spacing of {0} no point of the lattice is inside of the surface; make it finer")]
    TooCoarse(f64),
}

/// What was made, measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StuffingReport {
    /// Edge of the lattice's cubes.
    pub spacing: f64,
    /// Whether the wanted number was met within a fifth, or the tolerance kept; always for a given spacing.
    pub reached: bool,
    pub quality: TetQuality,
    /// The part of the surface's vertices inside the mesh: of a mesh that ends at the surface about a half.
    pub vertices_inside: f64,
    /// The part of random points inside the surface that are inside the mesh.
    pub samples_inside: f64,
    /// The largest distance of a surface vertex outside from the mesh; 0 if all are inside.
    pub farthest_outside: f64,
    /// The largest distance found between the two surfaces: of a surface vertex from the mesh's boundary, and of a
    /// vertex or a face's middle of that from the surface.
    pub deviation: f64,
}

/// The mesh of the inside of a closed surface; see [`Fineness`] and [`StuffingOptions::enclose`]. All tetrahedra are
/// positive.
///
/// # Errors
/// If the surface is not closed and consistently oriented, or the fineness is not possible.
pub fn stuff(surface: &TriMesh, options: &StuffingOptions) -> Result<(TetMesh, StuffingReport), StuffingError> {
    let body = Body::new(surface, options.enclose)?;
    match options.fineness {
        Fineness::Spacing(spacing) => {
            let mesh = body.mesh(positive("spacing", spacing)?)?;
            let report = body.report(&mesh, spacing);
            Ok((mesh, report))
        }
        Fineness::Tets(wanted) => body.with_count(wanted),
        Fineness::Tolerance { distance, most_tets } => body.within(positive("tolerance", distance)?, most_tets),
    }
}

fn positive(what: &'static str, value: f64) -> Result<f64, StuffingError> {
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err(StuffingError::NotPositive { what, value }) }
}

fn check_wanted(tets: usize) -> Result<f64, StuffingError> {
    if (1..=MOST_TETS).contains(&tets) { Ok(tets as f64) } else { Err(StuffingError::Wanted(tets)) }
}

struct Body<'a> {
    surface: Locator<'a>,
    lo: DVec3,
    hi: DVec3,
    volume: f64,
    enclose: bool,
}

impl<'a> Body<'a> {
    fn new(surface: &'a TriMesh, enclose: bool) -> Result<Self, StuffingError> {
        let Some((lo, hi)) = surface.bounds().filter(|_| !surface.triangles.is_empty()) else {
            return Err(StuffingError::NoSurface);
        };
        // what is inside is clear where the surface only cuts through itself
        if let Some(defect) = MeshReport::of_connectivity(surface).defects().iter().find(|d| d.kind.spoils_slices()) {
            return Err(StuffingError::Unclear(defect.to_string()));
        }
        let volume = surface.volume().abs();
        if !(volume > 1e-12 * (hi - lo).max_element().powi(3)) {
            return Err(StuffingError::Flat);
        }
        Ok(Self { surface: Locator::new(surface), lo, hi, volume, enclose })
    }

    fn mesh(&self, spacing: f64) -> Result<TetMesh, StuffingError> {
        let cells: f64 = Bcc::cells_around(self.lo, self.hi, spacing).iter().product();
        if !(cells <= MOST_CELLS) {
            return Err(StuffingError::TooFine { spacing, cells });
        }
        let lattice = Bcc::around(self.lo, self.hi, spacing);
        let mesh = if self.enclose { enclosing(&self.surface, &lattice) } else { stuffed(&self.surface, &lattice) };
        if mesh.tets.is_empty() { Err(StuffingError::TooCoarse(spacing)) } else { Ok(mesh) }
    }

    /// The finest spacing that [`MOST_CELLS`] allow, more or less.
    fn finest(&self) -> f64 {
        let size = self.hi - self.lo;
        let rough = (size.element_product() / MOST_CELLS).cbrt().max(size.max_element() / MOST_CELLS);
        let fits = |s: &f64| Bcc::cells_around(self.lo, self.hi, *s).iter().product::<f64>() <= MOST_CELLS;
        std::iter::successors(Some(rough), |s| Some(s * 1.1)).find(fits).unwrap_or(rough)
    }

    fn with_count(&self, wanted: usize) -> Result<(TetMesh, StuffingReport), StuffingError> {
        let target = check_wanted(wanted)?;
        let finest = self.finest();
        let mut spacing = (TETS_PER_CELL * self.volume / target).cbrt().max(finest);
        // spacings known to be too fine and too coarse
        let (mut fine, mut coarse) = (0.0, f64::INFINITY);
        let mut best: Option<(f64, TetMesh, f64)> = None;
        for _ in 0..TRIES {
            let count = match self.mesh(spacing) {
                Ok(mesh) => {
                    let count = mesh.tets.len() as f64;
                    let off = (count / target).ln().abs();
                    if best.as_ref().is_none_or(|b| off < b.0) {
                        best = Some((off, mesh, spacing));
                    }
                    if off <= CLOSE {
                        break;
                    }
                    count
                }
                Err(StuffingError::TooCoarse(_)) => 0.25,
                Err(other) => return Err(other),
            };
            if count > target {
                fine = spacing;
            } else {
                coarse = spacing;
            }
            if coarse <= finest {
                break;
            }
            let next = spacing * (count / target).cbrt().clamp(0.25, 4.0);
            spacing = if next > fine && next < coarse { next } else { f64::sqrt(fine * coarse) }.max(finest);
        }
        let (off, mesh, spacing) = best.ok_or(StuffingError::TooCoarse(spacing))?;
        let mut report = self.report(&mesh, spacing);
        report.reached = off.exp() <= 1.2;
        Ok((mesh, report))
    }

    fn within(&self, tolerance: f64, most_tets: usize) -> Result<(TetMesh, StuffingReport), StuffingError> {
        let most = check_wanted(most_tets)?;
        let finest = self.finest().max((TETS_PER_CELL * self.volume / most).cbrt());
        let mut spacing = ((self.hi - self.lo).max_element() / 4.0).max(finest);
        let mut last: Option<(TetMesh, StuffingReport)> = None;
        for _ in 0..TRIES {
            let step = match self.mesh(spacing) {
                Ok(mesh) if mesh.tets.len() > most_tets => break,
                Ok(mesh) => {
                    let mut report = self.report(&mesh, spacing);
                    report.reached = report.deviation <= tolerance;
                    let off = report.deviation / tolerance;
                    last = Some((mesh, report));
                    if off <= 1.0 {
                        break;
                    }
                    // between the second order of smooth surfaces and the first of edges
                    off.powf(-0.7).clamp(0.4, 0.85)
                }
                Err(StuffingError::TooCoarse(_)) => 0.5,
                Err(other) => return Err(other),
            };
            if spacing <= finest {
                break;
            }
            spacing = (spacing * step).max(finest);
        }
        last.ok_or(StuffingError::TooCoarse(spacing))
    }

    fn report(&self, mesh: &TetMesh, spacing: f64) -> StuffingReport {
        let faces = TetFaces::of(&mesh.tets);
        let boundary = surface_of(mesh, &faces.boundary);
        let hull = Locator::new(&boundary);
        let vertices = self.used_vertices();
        // for each vertex: whether it is inside, and how far from the boundary
        let places: Vec<(bool, f64)> = vertices.par_iter().map(|v| (hull.contains(*v), hull.distance(*v))).collect();
        let samples = self.samples();
        let held = samples.par_iter().filter(|p| hull.contains(**p)).count();
        let middles = boundary.triangles.iter().map(|t| t.map(|v| boundary.positions[v as usize]));
        let middles = middles.map(|[a, b, c]| (a + b + c) / 3.0);
        let probes: Vec<DVec3> = boundary.positions.iter().copied().chain(middles).collect();
        let away: Vec<f64> = probes.par_iter().map(|p| self.surface.distance(*p)).collect();
        let farthest = |d: &mut dyn Iterator<Item = f64>| d.fold(0.0, f64::max);
        StuffingReport {
            spacing,
            reached: true,
            quality: TetQuality::with_faces(mesh, &faces),
            vertices_inside: places.iter().filter(|p| p.0).count() as f64 / vertices.len() as f64,
            samples_inside: held as f64 / samples.len().max(1) as f64,
            farthest_outside: farthest(&mut places.iter().filter(|p| !p.0).map(|p| p.1)),
            deviation: farthest(&mut places.iter().map(|p| p.1)).max(farthest(&mut away.into_iter())),
        }
    }

    fn used_vertices(&self) -> Vec<DVec3> {
        let mesh = self.surface.mesh;
        let mut used = vec![false; mesh.positions.len()];
        mesh.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
        mesh.positions.iter().zip(used).filter(|(_, used)| *used).map(|(p, _)| *p).collect()
    }

    /// Random points inside the surface.
    fn samples(&self) -> Vec<DVec3> {
        let tries = (SAMPLES as f64 * (self.hi - self.lo).element_product() / self.volume).min(64.0 * SAMPLES as f64);
        let place = |i: u64| Random::new(1, i).in_box(self.lo, self.hi);
        (0..tries as u64).into_par_iter().map(place).filter(|p| self.surface.contains(*p)).collect()
    }
}

//! A deformation as a tetrahedral mesh: its points are in the rest state where a backward map takes the deformed ones.
//!
//! # Theory
//!
//! A lattice fills a parallelepiped of the deformed space. At its points p the rest position is b(p); within a
//! tetrahedron it is interpolated linearly. For a map with a bounded second derivative the error is at most a multiple
//! of the square of the edges, so that it falls to a quarter when they are halved. Strokes touch only a part of the
//! space: tetrahedra are cut by bisection (`bisection.rs`, Maubach 1995) where the error is too large, and stay
//! conforming, because a point within a neighbour's edge would open a crack between the two.
//!
//! # Practice
//!
//! The error of a tetrahedron is the largest at its middle, the middles of its edges and faces and a few random points;
//! where it is large beside the features of the map, at a lattice of points as well, so that a small stroke within a
//! large tetrahedron is not missed. Outside of the map's supports the error is 0, and nothing is evaluated.
//!
//! What is reported is measured anew when the mesh is done, at other random points. Where one of these is beyond the
//! tolerance, refinement goes on, and other points are drawn, some times at most. So the figure is never one that the
//! mesh was fitted to; and being a sample, it may miss a little.

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use super::bisection::Bisection;
use super::bvh::{Aabb, Bvh};
use super::random::Random;
use super::tet_lattice::{MOST_TETS, Split, TetLatticeError, cells_for, check_region, tet_lattice};
use super::tets::{PointVectors, TetMesh, signed_volume};
use crate::math::{BackwardMap, OrientedBox};

/// Errors are driven this far below the tolerance, as few points see the largest.
const SAFETY: f64 = 0.9;
/// Random points of a tetrahedron while it is refined, and when all is done.
const LOOKS: usize = 3;
const CHECKS: usize = 8;
/// How often refinement may go on after a measurement.
const MOST_ROUNDS: u64 = 8;
/// Steps between points along the longest edge, at most; larger tetrahedra are cut unseen.
const MOST_STEPS: f64 = 10.0;
/// Bisections, at most; three of them halve the edges.
const MOST_LEVELS: u8 = 60;

/// How a map is turned into a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapOptions {
    /// Largest distance between the map and what the mesh interpolates, after `metric`.
    pub tolerance: f64,
    /// In what distances are measured: the identity for world units, the linear part of a grid's `voxel_from_world` for
    /// its voxels.
    pub metric: DMat3,
    /// Size of the smallest feature of the map in world units, if that is known; otherwise half the smallest side of
    /// each of its supports is taken.
    pub feature: Option<f64>,
    /// Tetrahedra before refinement, about.
    pub start_tets: usize,
    /// Refinement ends before there are more.
    pub most_tets: usize,
    /// No tetrahedron is cut more often for its own error; three bisections halve the edges. At most 60.
    pub most_levels: u8,
}

impl Default for MapOptions {
    fn default() -> Self {
        Self {
            tolerance: 0.1,
            metric: DMat3::IDENTITY,
            feature: None,
            start_tets: 384,
            most_tets: 2_000_000,
            most_levels: 36,
        }
    }
}

/// What was made, measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapReport {
    /// The most bisections that any tetrahedron has behind it; three halve the edges.
    pub levels: u32,
    pub points: usize,
    pub tets: usize,
    /// Tetrahedra whose rest volume is not positive: the map folds there, or nearly does.
    pub inverted: usize,
    /// Random points at which the error was measured.
    pub samples: usize,
    /// Largest error among them, and where in the deformed space.
    pub max_error: f64,
    pub max_at: DVec3,
    /// Mean over the volume of the region.
    pub mean_error: f64,
    /// Whether the largest error is within the tolerance.
    pub converged: bool,
}

/// Why a map cannot be made a mesh.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum MapError {
    #[error(transparent)]
    Lattice(#[from] TetLatticeError),
    #[error("the tolerance of {0} is not possible; it must be a positive number")]
    Tolerance(f64),
    #[error("the feature size of {0} is not possible; it must be a positive number")]
    Feature(f64),
    #[error("the matrix that turns world distances into those of the tolerance is not finite or singular")]
    Metric,
    #[error("at most {most} tetrahedra are allowed, but the lattice has {start} before refinement")]
    Limit { start: usize, most: usize },
    #[error("{0} levels of bisection are not possible; at most {MOST_LEVELS} are")]
    Levels(u32),
    #[error("the map takes ({:.6}, {:.6}, {:.6}) to a place that is not finite", at.x, at.y, at.z)]
    NotFinite { at: DVec3 },
}

/// The mesh of a backward map over a parallelepiped of the deformed space (the image of the unit cube), fine enough for
/// the tolerance. Its points are the rest positions, its vectors `deformed` the deformed ones, in which all tetrahedra
/// are positive.
///
/// # Errors
/// See [`MapError`]. That a limit kept the tolerance from being reached is no error: the report says so.
pub fn from_backward_map(
    map: &dyn BackwardMap,
    region: &DAffine3,
    options: &MapOptions,
) -> Result<(TetMesh, MapReport), MapError> {
    let probe = Probe::new(map, options)?;
    let cells = cells_for(region, options.start_tets, Split::Six)?;
    let start = cells.iter().product::<usize>() * Split::Six.tets_per_box();
    if start > options.most_tets.min(MOST_TETS) {
        return Err(MapError::Limit { start, most: options.most_tets.min(MOST_TETS) });
    }
    let size = DVec3::from_array(cells.map(|n| n as f64));
    let mut mesh = Bisection::new(cells);
    let mut state = State::default();
    let mut errors = Vec::new();
    let mut new: Vec<u32> = (0..mesh.tets.len() as u32).collect();
    let mut round = 0;
    let grow = |state: &mut State, mesh: &Bisection| {
        let points = mesh.points[state.deformed.len()..].iter();
        state.extend(map, points.map(|p| region.transform_point3(*p / size)).collect())
    };
    let measure = |state: &State, mesh: &Bisection, round: u64| {
        let corners: Vec<[u32; 4]> = mesh.tets.iter().map(|t| t.corners).collect();
        probe.measure(state, &corners, round)
    };
    let measured = loop {
        grow(&mut state, &mesh)?;
        let found: Vec<f64> = new.par_iter().map(|&t| probe.look(&state, mesh.tets[t as usize].corners, t)).collect();
        errors.resize(mesh.tets.len(), 0.0);
        new.iter().zip(found).for_each(|(&t, e)| errors[t as usize] = e);

        let may = |t: &u32| mesh.tets[*t as usize].level < options.most_levels;
        let beyond = |limit: f64, errors: &[f64]| -> Vec<u32> {
            (0..errors.len() as u32).filter(|t| errors[*t as usize] > limit).filter(may).collect()
        };
        let mut marked = beyond(SAFETY * options.tolerance, &errors);
        if marked.is_empty() {
            let measured = measure(&state, &mesh, round);
            errors.iter_mut().zip(&measured.each).for_each(|(e, m)| *e = e.max(*m));
            marked = beyond(options.tolerance, &errors);
            round += 1;
            if marked.is_empty() || round == MOST_ROUNDS {
                break measured;
            }
        }
        marked.sort_by(|a, b| errors[*b as usize].total_cmp(&errors[*a as usize]));
        let most = options.most_tets.min(MOST_TETS);
        let mut refined = mesh.refine(&marked, most);
        // where not all have room, the worst
        let cramped = refined.is_none();
        while refined.is_none() && marked.len() > 1 {
            marked.truncate(marked.len() / 2);
            refined = mesh.refine(&marked, most);
        }
        new = refined.unwrap_or_default();
        if cramped {
            grow(&mut state, &mesh)?;
            break measure(&state, &mesh, round);
        }
    };
    let levels = mesh.tets.iter().map(|t| u32::from(t.level)).max().unwrap_or(0);
    let tets = mesh.tets.iter().map(|t| t.corners).collect();
    Ok(finish(state, tets, measured, levels, options))
}

/// The same with a lattice of `cells` boxes, halved `level` times everywhere: for studies of convergence. Of the
/// options only the tolerance, the metric and the feature size matter.
///
/// # Errors
/// See [`MapError`].
pub fn uniform_from_backward_map(
    map: &dyn BackwardMap,
    region: &DAffine3,
    cells: [usize; 3],
    level: u32,
    options: &MapOptions,
) -> Result<(TetMesh, MapReport), MapError> {
    let probe = Probe::new(map, options)?;
    let halved = cells.map(|n| n.saturating_mul(1usize.checked_shl(level).unwrap_or(usize::MAX)));
    let lattice = tet_lattice(region, halved, Split::Six)?;
    let mut state = State::default();
    state.extend(map, lattice.points)?;
    let measured = probe.measure(&state, &lattice.tets, 0);
    Ok(finish(state, lattice.tets, measured, 3 * level, options))
}

fn finish(
    state: State,
    mut tets: Vec<[u32; 4]>,
    measured: Measured,
    levels: u32,
    options: &MapOptions,
) -> (TetMesh, MapReport) {
    for t in &mut tets {
        if signed_volume(TetMesh::corners(*t, &state.deformed)) < 0.0 {
            t.swap(1, 2);
        }
    }
    let mut mesh = TetMesh::new(state.rest, tets);
    mesh.vectors = vec![PointVectors { name: "deformed".to_owned(), values: state.deformed }];
    let report = MapReport {
        levels,
        points: mesh.points.len(),
        tets: mesh.tets.len(),
        inverted: (0..mesh.tets.len()).filter(|&t| !(mesh.tet_volume(t) > 0.0)).count(),
        samples: measured.samples,
        max_error: measured.max,
        max_at: measured.at,
        mean_error: measured.mean,
        converged: measured.max <= options.tolerance,
    };
    (mesh, report)
}

/// The points of the mesh in both states.
#[derive(Default)]
struct State {
    deformed: Vec<DVec3>,
    rest: Vec<DVec3>,
}

impl State {
    fn extend(&mut self, map: &dyn BackwardMap, deformed: Vec<DVec3>) -> Result<(), MapError> {
        let rest: Vec<DVec3> = deformed.par_iter().map(|p| map.backward(*p)).collect();
        if let Some(bad) = rest.iter().position(|p| !p.is_finite()) {
            return Err(MapError::NotFinite { at: deformed[bad] });
        }
        self.deformed.extend(deformed);
        self.rest.extend(rest);
        Ok(())
    }
}

struct Measured {
    /// The largest error in each tetrahedron.
    each: Vec<f64>,
    samples: usize,
    max: f64,
    at: DVec3,
    mean: f64,
}

/// Looks at the difference between a map and its interpolation.
struct Probe<'a> {
    map: &'a dyn BackwardMap,
    metric: DMat3,
    supports: Vec<OrientedBox>,
    tree: Bvh,
    feature: Option<f64>,
}

impl<'a> Probe<'a> {
    fn new(map: &'a dyn BackwardMap, options: &MapOptions) -> Result<Self, MapError> {
        let MapOptions { tolerance, metric, feature, most_levels, .. } = *options;
        if !(tolerance > 0.0 && tolerance.is_finite()) {
            return Err(MapError::Tolerance(tolerance));
        }
        if let Some(size) = feature.filter(|s| !(*s > 0.0)) {
            return Err(MapError::Feature(size));
        }
        if check_region(&DAffine3::from_mat3(metric)).is_err() {
            return Err(MapError::Metric);
        }
        if most_levels > MOST_LEVELS {
            return Err(MapError::Levels(most_levels.into()));
        }
        let supports = map.supports();
        let boxes = supports.iter().map(|b| {
            let (lo, hi) = b.bounds();
            Aabb { lo, hi }
        });
        Ok(Self { map, metric, tree: Bvh::new(boxes.collect()), supports, feature })
    }

    /// How far apart the points may be at which the map is looked at in this tetrahedron; `None` if it touches no
    /// support.
    fn spacing(&self, corners: [DVec3; 4]) -> Option<f64> {
        let mut least: Option<f64> = None;
        self.tree.overlapping(&Aabb::around(&corners), |b| {
            let support = &self.supports[b as usize];
            let local = corners.map(|p| support.local(p));
            let apart = (0..3).any(|a| local.iter().all(|p| p[a] > 1.0) || local.iter().all(|p| p[a] < -1.0));
            if !apart {
                let feature = self.feature.unwrap_or(support.half.min_element());
                least = Some(least.unwrap_or(f64::INFINITY).min(feature / 2.0));
            }
        });
        least
    }

    fn error(&self, deformed: &[DVec3; 4], rest: &[DVec3; 4], weights: [f64; 4]) -> (f64, DVec3) {
        let mix = |p: &[DVec3; 4]| p[0] * weights[0] + p[1] * weights[1] + p[2] * weights[2] + p[3] * weights[3];
        let at = mix(deformed);
        let error = (self.metric * (self.map.backward(at) - mix(rest))).length();
        (if error.is_nan() { f64::INFINITY } else { error }, at)
    }

    /// The error by which a tetrahedron is judged; infinite if it is too large to tell.
    fn look(&self, state: &State, tet: [u32; 4], seed: u32) -> f64 {
        let (deformed, rest) = (TetMesh::corners(tet, &state.deformed), TetMesh::corners(tet, &state.rest));
        let Some(spacing) = self.spacing(deformed) else { return 0.0 };
        let edges = (0..4).flat_map(|i| (0..i).map(move |j| (i, j)));
        let longest = edges.clone().map(|(i, j)| deformed[i].distance(deformed[j])).fold(0.0, f64::max);
        let steps = (longest / spacing).ceil();
        if steps > MOST_STEPS {
            return f64::INFINITY;
        }
        let mut largest: f64 = 0.0;
        let mut at = |weights: [f64; 4]| largest = largest.max(self.error(&deformed, &rest, weights).0);
        at([0.25; 4]);
        for corner in 0..4 {
            at(std::array::from_fn(|c| if c == corner { 0.0 } else { 1.0 / 3.0 }));
        }
        for (i, j) in edges {
            at(std::array::from_fn(|c| if c == i || c == j { 0.5 } else { 0.0 }));
        }
        let mut random = Random::new(u64::from(seed), state.deformed.len() as u64);
        (0..LOOKS).for_each(|_| at(random.barycentric()));
        // with two steps there would only be the middles of the edges
        let n = if steps > 2.0 { steps as usize } else { return largest };
        for i in 0..=n {
            for j in 0..=n - i {
                for k in 0..=n - i - j {
                    at([i, j, k, n - i - j - k].map(|x| x as f64 / n as f64));
                }
            }
        }
        largest
    }

    /// The errors at random points of all tetrahedra that touch a support, other points in each round.
    fn measure(&self, state: &State, tets: &[[u32; 4]], round: u64) -> Measured {
        // largest error and where, sum of errors times volume, volume, number of points
        type Sum = (f64, DVec3, f64, f64, usize);
        let one = |t: usize| -> Sum {
            let (deformed, rest) = (TetMesh::corners(tets[t], &state.deformed), TetMesh::corners(tets[t], &state.rest));
            let volume = signed_volume(deformed).abs();
            if self.spacing(deformed).is_none() {
                return (0.0, deformed[0], 0.0, volume, 0);
            }
            let mut random = Random::new(!round, t as u64);
            let mut sum = (0.0, deformed[0], 0.0, volume, CHECKS);
            for _ in 0..CHECKS {
                let (error, at) = self.error(&deformed, &rest, random.barycentric());
                sum.2 += error * volume / CHECKS as f64;
                if error > sum.0 {
                    (sum.0, sum.1) = (error, at);
                }
            }
            sum
        };
        let sums: Vec<Sum> = (0..tets.len()).into_par_iter().map(one).collect();
        let worst = sums.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
        let volume: f64 = sums.iter().map(|s| s.3).sum();
        Measured {
            samples: sums.iter().map(|s| s.4).sum(),
            max: worst.0,
            at: worst.1,
            mean: sums.iter().map(|s| s.2).sum::<f64>() / volume,
            each: sums.into_iter().map(|s| s.0).collect(),
        }
    }
}

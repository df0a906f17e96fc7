//! What lies outside a grid: how far it must grow, and what it clips.
//!
//! Only the support boxes of the map can hold material outside the input. They are searched with the same code that fills
//! the output. Boxes can be far larger than the volume, so a search looks at no more points than a budget: where there are
//! more voxels, at every s-th along each axis.

use glam::{DAffine3, DMat3};

use super::ExportError;
use super::grid::{Span, vector};
use super::run::Job;
use crate::volume::Grid;
use crate::volume::fetch::Fetch;

/// At least this many points are looked at, if there are as many.
const LEAST_BUDGET: f64 = 1e6;

/// Otherwise at most this part of the voxels of the output.
const SHARE: f64 = 0.125;

/// Layers about the output that count separately: most clipped material lies close to the grid.
const SKIN: i64 = 3;

/// So many times the budget of voxels may be screened for those that need a look.
const SCREENED: f64 = 64.0;

/// The greatest step from one looked-at voxel to the next.
const LARGEST_STEP: i64 = 1 << 40;

/// The parts of `region` outside `hole`, as at most six boxes.
fn around(mut region: Span, hole: &Span) -> Vec<Span> {
    let mut parts = Vec::new();
    for a in (0..3).rev() {
        if region.lo[a] < hole.lo[a] {
            let mut part = region;
            part.hi[a] = part.hi[a].min(hole.lo[a] - 1);
            parts.push(part);
        }
        if region.hi[a] > hole.hi[a] {
            let mut part = region;
            part.lo[a] = part.lo[a].max(hole.hi[a] + 1);
            parts.push(part);
        }
        region.lo[a] = region.lo[a].max(hole.lo[a]);
        region.hi[a] = region.hi[a].min(hole.hi[a]);
        if region.lo[a] > region.hi[a] {
            break;
        }
    }
    parts
}

/// The step at which parts are searched so that at most `budget` points are looked at.
fn step(parts: &[Span], budget: f64) -> i64 {
    let points = |s: i64| -> f64 {
        parts.iter().map(|p| p.edges().iter().map(|e| (e / s as f64).ceil()).product::<f64>()).sum()
    };
    let mut s = 1;
    while s < LARGEST_STEP && points(s) > budget {
        s = (s * 3 + 1) / 2;
    }
    s
}

/// What is in a region but not in a hole, on the lattice of a grid, as boxes with a step.
struct Search<'a> {
    grid: &'a Grid,
    parts: Vec<Span>,
    step: i64,
}

/// One box of a search on its coarser lattice.
struct Coarse {
    part: Span,
    grid: Grid,
    /// Voxels along each axis for which a voxel of the coarse lattice speaks.
    edges: [i64; 3],
}

impl<'a> Search<'a> {
    fn new<T: Fetch>(job: &Job<'_, T>, grid: &'a Grid, region: Span, hole: &Span) -> Self {
        let parts = around(region, hole);
        let budget = (SHARE * grid.len() as f64).max(LEAST_BUDGET);
        let mut search = Self { grid, step: step(&parts, budget), parts };
        // most of what is far from the input needs no look
        if search.step > 1 && step(&search.parts, SCREENED * budget) == 1 {
            let fine = Self { grid, step: 1, parts: search.parts };
            let candidates: u64 = fine.boxes().map(|b| job.on(&b.grid).candidates(b.grid.dims)).sum();
            search = Self { step: if candidates as f64 <= budget { 1 } else { search.step }, ..fine };
        }
        search
    }

    fn boxes(&self) -> impl Iterator<Item = Coarse> {
        let s = self.step;
        self.parts.iter().map(move |part| {
            // each looked-at voxel stands in the middle of those it speaks for
            let edges: [i64; 3] = std::array::from_fn(|a| s.min(part.hi[a] - part.lo[a] + 1));
            let dims: [usize; 3] = std::array::from_fn(|a| ((part.hi[a] - part.lo[a]) / edges[a] + 1) as usize);
            let corner = vector(part.lo) + vector(edges.map(|e| e / 2));
            let lattice = DAffine3::from_mat3_translation(
                self.grid.world_from_voxel.matrix3 * DMat3::from_diagonal(vector(edges)),
                self.grid.world_from_voxel.transform_point3(corner),
            );
            Coarse { part: *part, grid: Grid { dims, world_from_voxel: lattice, ..*self.grid }, edges }
        })
    }

    /// Voxels with material; an estimate if the step is not 1.
    fn voxels<T: Fetch>(&self, job: &Job<'_, T>) -> u64 {
        self.boxes().fold(0, |all, b| {
            let count = job.on(&b.grid).material(b.grid.dims);
            // the last voxel of an axis may speak for fewer
            let share = b.part.edges().iter().zip(b.grid.dims).map(|(e, n)| e / n as f64).product::<f64>();
            all.saturating_add((count as f64 * share).round() as u64)
        })
    }

    /// The box around what was found, widened by what was not looked at.
    fn hull<T: Fetch>(&self, job: &Job<'_, T>) -> Option<Span> {
        self.boxes().fold(None, |all: Option<Span>, b| {
            let shifted = |s: Span, sign: i64| Span {
                lo: std::array::from_fn(|a| s.lo[a] + sign * b.part.lo[a]),
                hi: std::array::from_fn(|a| s.hi[a] + sign * b.part.lo[a]),
            };
            if self.step == 1 {
                let known = all.map(|s| shifted(s, -1));
                return job.on(&b.grid).hull(b.grid.dims, known).map(|s| shifted(s, 1));
            }
            let Some(found) = job.on(&b.grid).hull(b.grid.dims, None) else { return all };
            let rim = self.step - 1;
            let wide = Span {
                lo: std::array::from_fn(|a| found.lo[a] * b.edges[a] - rim),
                hi: std::array::from_fn(|a| (found.hi[a] + 1) * b.edges[a] - 1 + rim),
            };
            let wide = shifted(wide, 1);
            Some(all.map_or(wide, |all| all.hull(wide)))
        })
    }
}

/// The voxels on the lattice of `grid` to which it must grow, within `candidate`, to hold all material.
///
/// # Errors
/// If that is more than `limit` voxels.
pub(super) fn grow<T: Fetch>(job: &Job<'_, T>, grid: &Grid, candidate: Span, limit: u64) -> Result<Span, ExportError> {
    let own = Span::of(grid);
    let mut region = candidate;
    loop {
        let search = Search::new(job, grid, region, &own);
        let step = search.step;
        // material hangs together: what was not looked at is not far from the grid or from what was found
        let near = if step == 1 { own } else { own.widened(step).within(&region) };
        let smaller = search.hull(job).map_or(near, |span| near.hull(span.within(&region)));
        if step == 1 || smaller == region {
            return match smaller.voxels() {
                Some(n) if n <= limit => Ok(smaller),
                n => Err(ExportError::TooLarge { voxels: n.unwrap_or(u64::MAX), limit }),
            };
        }
        region = smaller;
    }
}

/// Voxels in `reached`, on the lattice of `grid` but outside it, that hold material.
pub(super) fn clipped<T: Fetch>(job: &Job<'_, T>, grid: &Grid, reached: Span) -> u64 {
    let own = Span::of(grid);
    let skin = own.widened(SKIN).within(&reached);
    let count = |region: Span, hole: &Span| Search::new(job, grid, region, hole).voxels(job);
    // a grid apart from all material has no skin
    if skin.voxels().is_none() { count(reached, &own) } else { count(skin, &own) + count(reached, &own.widened(SKIN)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn the_parts_around_a_hole_fill_the_region_once() {
        let span = |lo, hi| Span { lo, hi };
        let region = span([-3, 0, -2], [6, 5, 9]);
        for hole in [
            span([0, 0, 0], [4, 4, 4]),
            span([-9, -9, -9], [20, 20, 20]),
            span([7, 0, 0], [9, 3, 3]),
            span([-9, 2, 3], [0, 9, 3]),
        ] {
            let parts = around(region, &hole);
            let holds = |s: &Span, p: [i64; 3]| (0..3).all(|a| s.lo[a] <= p[a] && p[a] <= s.hi[a]);
            for z in -3..11 {
                for y in -1..7 {
                    for x in -4..8 {
                        let p = [x, y, z];
                        let want = usize::from(holds(&region, p) && !holds(&hole, p));
                        assert_eq!(parts.iter().filter(|s| holds(s, p)).count(), want, "{hole:?} {p:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_step_keeps_the_budget() {
        let part = |n: i64| Span { lo: [0; 3], hi: [n - 1; 3] };
        assert_eq!(step(&[part(90), part(50)], LEAST_BUDGET), 1);
        assert_eq!(step(&[part(200)], 8e6), 1);
        let s = step(&[part(10_000)], LEAST_BUDGET);
        assert!((100..=160).contains(&s), "{s}");
        assert!(step(&[part(1 << 41)], LEAST_BUDGET) < LARGEST_STEP);
        assert_eq!(vector([1, -2, 3]), DVec3::new(1.0, -2.0, 3.0));
    }
}

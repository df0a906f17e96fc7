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

/// Material found in a search.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Found {
    /// Voxels; an estimate if not every one was looked at.
    pub voxels: u64,
    /// Around them, widened by what was not looked at.
    pub span: Option<Span>,
}

/// At least this many points are looked at, if there are as many.
const LEAST_BUDGET: f64 = 1e6;

/// Otherwise at most this part of the voxels of the output.
const SHARE: f64 = 0.125;

/// Layers about the output that count separately: most clipped material lies close to the grid.
const SKIN: i64 = 3;

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

/// The step at which a region is searched: 1 if the budget allows.
fn step(parts: &[Span], budget: f64) -> i64 {
    let points = |s: i64| -> f64 {
        parts.iter().map(|p| p.edges().iter().map(|e| (e / s as f64).ceil()).product::<f64>()).sum()
    };
    let mut s = 1;
    while s < LARGEST_STEP && points(s) > budget.max(LEAST_BUDGET) {
        s = (s * 3 + 1) / 2;
    }
    s
}

/// Searches what is in `region` but not in `hole`, both on the lattice of `grid`; returns also the step.
fn search<T: Fetch>(job: &Job<'_, T>, grid: &Grid, region: Span, hole: &Span) -> (Found, i64) {
    let parts = around(region, hole);
    let s = step(&parts, SHARE * grid.len() as f64);
    let mut all = Found::default();
    for part in parts {
        // each looked-at voxel stands in the middle of those it speaks for
        let edges: [i64; 3] = std::array::from_fn(|a| s.min(part.hi[a] - part.lo[a] + 1));
        let dims: [usize; 3] = std::array::from_fn(|a| ((part.hi[a] - part.lo[a]) / edges[a] + 1) as usize);
        let corner = vector(part.lo) + vector(edges.map(|e| e / 2));
        let lattice = DAffine3::from_mat3_translation(
            grid.world_from_voxel.matrix3 * DMat3::from_diagonal(vector(edges)),
            grid.world_from_voxel.transform_point3(corner),
        );
        let coarse = Grid { dims, world_from_voxel: lattice, ..*grid };
        let (count, span) = job.on(&coarse).material(dims);
        // the last voxel of an axis may speak for fewer
        let share = part.edges().iter().zip(dims).map(|(e, n)| e / n as f64).product::<f64>();
        all.voxels = all.voxels.saturating_add((count as f64 * share).round() as u64);
        if let Some(found) = span {
            let widened = Span {
                lo: std::array::from_fn(|a| part.lo[a] + found.lo[a] * edges[a] - (s - 1)),
                hi: std::array::from_fn(|a| part.lo[a] + (found.hi[a] + 1) * edges[a] - 1 + (s - 1)),
            };
            all.span = Some(all.span.map_or(widened, |span| span.hull(widened)));
        }
    }
    (all, s)
}

/// The voxels on the lattice of `grid` to which it must grow, within `candidate`, to hold all material.
///
/// # Errors
/// If that is more than `limit` voxels.
pub(super) fn grow<T: Fetch>(job: &Job<'_, T>, grid: &Grid, candidate: Span, limit: u64) -> Result<Span, ExportError> {
    let own = Span::of(grid);
    let mut region = candidate;
    loop {
        let (found, step) = search(job, grid, region, &own);
        // material hangs together: what was not looked at is not far from the grid or from what was found
        let near = if step == 1 { own } else { own.widened(step).within(&region) };
        let smaller = found.span.map_or(near, |span| near.hull(span.within(&region)));
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
    let count = |region: Span, hole: &Span| search(job, grid, region, hole).0.voxels;
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
        assert_eq!(step(&[part(90), part(50)], 0.0), 1);
        assert_eq!(step(&[part(200)], 8e6), 1);
        let s = step(&[part(10_000)], 0.0);
        assert!((100..=160).contains(&s), "{s}");
        assert!(step(&[part(1 << 41)], 0.0) < LARGEST_STEP);
        assert_eq!(vector([1, -2, 3]), DVec3::new(1.0, -2.0, 3.0));
    }
}

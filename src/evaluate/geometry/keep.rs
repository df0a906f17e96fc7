//! What the last slices were made of, so that a stroke makes only those again that it changes.

use glam::{DVec2, DVec3};

use super::{GeometryOptions, Part, Scratch, reach};
use crate::deform::Deformer;
use crate::math::parallel::Pool;
use crate::render::Projection;
use crate::slice::{Planes, Slicer, Slices};
use crate::tessellate::Tessellator;
use crate::volume::Grid;

/// Slices and their buffers, kept from picture to picture. One for each view, or they take turns in vain.
#[derive(Debug, Default)]
pub struct Keeper {
    pub(super) slicer: Slicer,
    /// The sections of the last call.
    pub(super) before: Slices,
    pub(super) tessellator: Tessellator,
    pub(super) last: Option<Last>,
    pub(super) scratch: Pool<Scratch>,
    pub(super) kept: usize,
}

impl Keeper {
    /// Planes that the last call did not make again.
    pub fn kept(&self) -> usize {
        self.kept
    }
}

/// What all planes depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct View {
    pub planes: Planes,
    pub eye: DVec3,
    pub projection: Projection,
    pub options: GeometryOptions,
    pub pixel: f64,
    pub grid: Grid,
}

/// What the last call made, and of what.
#[derive(Debug)]
pub(super) struct Last {
    pub view: View,
    pub deformers: Vec<Deformer>,
    /// For each plane, the sections of the support boxes.
    pub cuts: Vec<Vec<Vec<DVec2>>>,
    pub parts: Vec<Part>,
}

impl Last {
    /// The parts of planes that would be made again as they are.
    pub fn unchanged(
        self,
        view: &View,
        deformers: &[Deformer],
        before: &Slices,
        sections: &Slices,
        cuts: &[Vec<Vec<DVec2>>],
    ) -> Vec<Option<Part>> {
        if self.view != *view {
            return Vec::new();
        }
        // what an older deformation does is seen through all newer ones: these count as changed with it
        let same = self.deformers.iter().zip(deformers).take_while(|(a, b)| a == b).count();
        let changed = self.deformers[same..].iter().chain(&deformers[same..]);
        let reaches: Vec<[f64; 2]> = changed.map(|d| reach(d, &view.planes)).collect();
        let keep = |k: usize| {
            let height = view.planes.height(k);
            !reaches.iter().any(|[lo, hi]| (*lo..=*hi).contains(&height))
                && self.cuts[k] == cuts[k]
                && same_sections(before, sections, k)
        };
        let kept: Vec<bool> = (0..self.parts.len()).map(keep).collect();
        self.parts.into_iter().zip(kept).map(|(part, kept)| kept.then_some(part)).collect()
    }
}

/// Whether plane `k` has the same contours in both.
fn same_sections(a: &Slices, b: &Slices, k: usize) -> bool {
    let (la, lb) = (a.plane_loops(k), b.plane_loops(k));
    if la.len() != lb.len() {
        return false;
    }
    let first = |s: &Slices, l: usize| s.loop_start[l] as usize;
    let relative = |owner: u32, first: usize| if owner == Slices::NONE { owner } else { owner - first as u32 };
    la.clone().zip(lb.clone()).all(|(i, j)| {
        a.points[first(a, i)..first(a, i + 1)] == b.points[first(b, j)..first(b, j + 1)]
            && relative(a.owner[i], la.start) == relative(b.owner[j], lb.start)
    })
}

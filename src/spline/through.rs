//! The isosurface of a spline seen through a backward map: the roots of `s(D(p))` along a ray, without resampling.
//!
//! A straight ray is bent by the map, so there is no cubic along it. Space is cut into blocks of 8 x 8 x 8 voxels. Bounds of
//! the map tell which of them lie still: there, rays are followed exactly, as without a map. Where things moved, a block is
//! left out if all that it can show lies in blocks without the surface; in the others the ray goes in steps of half a voxel of
//! the undeformed volume, and a change of sides is narrowed down. Only sheets thinner than that can be missed.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::DVec3;

use super::level::{BLOCK, Classes};
use super::ray::{Span, Walk, clip_to};
use super::{Crossing, Level, Ray, Spline};
use crate::math::parallel;

/// A backward map in voxel indices.
pub trait VoxelMap: Send + Sync {
    /// Where in the undeformed volume a point comes from.
    fn backward(&self, p: DVec3) -> DVec3;

    /// Corners of a box around the images of all points between two corners; `None` if none of these is moved.
    fn sources(&self, lower: DVec3, upper: DVec3) -> Option<[DVec3; 2]>;
}

/// A spline and a backward map: what does not depend on the isovalue.
pub struct Through {
    spline: Arc<Spline>,
    map: Box<dyn VoxelMap>,
    /// The first block, counted from that of voxel 0.
    first: [isize; 3],
    blocks: [usize; 3],
    /// What each block can show, if anything in it moved.
    images: Vec<Option<[DVec3; 2]>>,
}

/// An isovalue of it, classified.
pub struct ThroughLevel<'a> {
    through: &'a Through,
    level: Level<'a>,
    blocks: Vec<Block>,
}

/// What a ray does in a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Block {
    /// Nothing of the volume is here.
    Outside,
    /// No surface.
    Empty,
    /// Nothing moved.
    Still,
    Moved,
}

impl std::fmt::Debug for Through {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Through").field("first", &self.first).field("blocks", &self.blocks).finish_non_exhaustive()
    }
}

impl Through {
    /// Everything that is seen lies in voxels from `lower` to `upper`.
    pub fn new(spline: Arc<Spline>, map: Box<dyn VoxelMap>, lower: [isize; 3], upper: [isize; 3]) -> Self {
        let size = BLOCK as isize;
        let first = lower.map(|v| v.div_euclid(size));
        let blocks: [usize; 3] = std::array::from_fn(|a| (upper[a].div_euclid(size) - first[a] + 1).max(1) as usize);
        let images = parallel::map(blocks[2], &|k| {
            let mut plane = Vec::with_capacity(blocks[0] * blocks[1]);
            for j in 0..blocks[1] {
                for i in 0..blocks[0] {
                    let at = [i, j, k].map(|v| v as isize);
                    let lower = DVec3::from(std::array::from_fn(|a| ((first[a] + at[a]) * size) as f64 - 0.5));
                    plane.push(map.sources(lower, lower + size as f64));
                }
            }
            plane
        });
        Self { spline, map, first, blocks, images: images.concat() }
    }

    pub fn spline(&self) -> &Spline {
        &self.spline
    }

    /// Where in the undeformed volume a point comes from, in voxels.
    pub fn backward(&self, p: DVec3) -> DVec3 {
        self.map.backward(p)
    }

    fn is_inside(&self, q: DVec3) -> bool {
        let n = DVec3::from(self.spline.dims().map(|n| n as f64));
        q.cmpge(DVec3::splat(-0.5)).all() && q.cmple(n - 0.5).all()
    }
}

impl<'a> ThroughLevel<'a> {
    pub fn new(through: &'a Through, iso: f64) -> Self {
        Self::of(through, Arc::new(Classes::new(&through.spline, iso)))
    }

    /// With what was found before, for the same spline: whatever the map is.
    pub fn of(through: &'a Through, classes: Arc<Classes>) -> Self {
        let level = Level::of(&through.spline, classes);
        let [nx, ny, _] = through.blocks;
        let blocks = parallel::map(through.blocks[2], &|k| {
            let block = |n: usize| {
                let at = [n % nx, n / nx, k];
                let own: [isize; 3] = std::array::from_fn(|a| through.first[a] + at[a] as isize);
                classify(&level, own, through.images[k * nx * ny + n])
            };
            (0..nx * ny).map(block).collect::<Vec<_>>()
        });
        Self { through, level, blocks: blocks.concat() }
    }

    pub fn iso(&self) -> f64 {
        self.level.iso()
    }

    /// Calls `found` for each place where a ray meets the surface, in order, until it breaks. As [`Level::crossings`]; the
    /// border of the domain, wherever it was moved to, is [`Crossing::Start`] and [`Crossing::End`].
    pub fn crossings(&self, ray: &Ray, range: [f64; 2], mut found: impl FnMut(f64, Crossing) -> ControlFlow<()>) {
        let Through { first, blocks, .. } = *self.through;
        let size = BLOCK as f64;
        let lower = DVec3::from(first.map(|v| v as f64 * size));
        let local = Ray { origin: ray.origin - lower, ..*ray };
        let Some([start, end]) = clip_to(&local, blocks.map(|n| n as f64 * size), range) else { return };
        let mut walk = Walk::new(&self.level, ray);
        let span = Span::of(&local, size);
        let mut at = span.cell(local.at(start), [0; 3], blocks);
        let mut t = start;
        loop {
            let (exit, axis) = span.exit(at);
            let to = exit.clamp(t, end);
            let goes_on = match self.blocks[(at[2] * blocks[1] + at[1]) * blocks[0] + at[0]] {
                Block::Outside => {
                    let ends = walk.above.take() == Some(true);
                    !ends || found(t, Crossing::End).is_continue()
                }
                Block::Empty => {
                    walk.above.is_some() || {
                        let above = self.is_above(self.through.backward(ray.at(0.5 * (t + to))));
                        walk.begin(above, t, &mut found)
                    }
                }
                Block::Still => {
                    let own = std::array::from_fn(|a| (first[a] + at[a] as isize) as usize);
                    walk.block(own, t, to, &mut found)
                }
                Block::Moved => self.march(&mut walk, ray, t, to, &mut found),
            };
            if !goes_on {
                return;
            }
            t = to;
            if exit >= end || !span.advance(&mut at, axis, [0; 3], blocks) {
                break;
            }
        }
        if walk.above == Some(true) {
            let _ = found(end, Crossing::End);
        }
    }

    /// Whether the value at a point of the undeformed volume is at or above the isovalue; beyond the volume it is not.
    #[inline(always)]
    fn is_above(&self, q: DVec3) -> bool {
        if !self.through.is_inside(q) {
            return false;
        }
        let spline = self.level.spline;
        let dims = spline.dims();
        let cube: [usize; 3] = std::array::from_fn(|a| ((q[a] + 0.5) as usize).min(dims[a] - 1));
        if self.level.is_active(cube) {
            spline.value(q) >= self.level.iso()
        } else {
            // all of the cube is on one side
            f64::from(spline.sample(cube)) >= self.level.iso()
        }
    }

    /// Through a block where things moved; `false` if nothing more is wanted.
    fn march(
        &self,
        walk: &mut Walk<'_>,
        ray: &Ray,
        from: f64,
        end: f64,
        found: &mut impl FnMut(f64, Crossing) -> ControlFlow<()>,
    ) -> bool {
        let unit = 1.0 / ray.direction.length();
        let (mut t, mut q) = (from, self.through.backward(ray.at(from)));
        let mut above = match walk.above {
            Some(above) => above,
            None => {
                let above = self.is_above(q);
                if !walk.begin(above, t, found) {
                    return false;
                }
                above
            }
        };
        let mut step = 0.5 * unit;
        while t < end {
            let to = (t + step).min(end);
            let next = self.through.backward(ray.at(to));
            let gap = next.distance(q);
            if gap > 0.75 && to - t > 1e-3 * unit {
                step = (to - t) * (0.5 / gap);
                continue;
            }
            let there = self.is_above(next);
            if there != above {
                let (at, crossing) = self.narrow(ray, [t, to], [q, next], there);
                above = there;
                walk.above = Some(there);
                if found(at, crossing).is_break() {
                    return false;
                }
            }
            step = ((to - t) * (0.5 / gap.max(0.125))).min(2.0 * unit).max(1e-3 * unit);
            (t, q) = (to, next);
        }
        true
    }

    /// Where between two places of a ray, with their images, its side becomes `there`.
    fn narrow(&self, ray: &Ray, [mut lo, mut hi]: [f64; 2], images: [DVec3; 2], there: bool) -> (f64, Crossing) {
        let spline = self.level.spline;
        let through = self.through;
        let value = |t: f64| spline.value(through.backward(ray.at(t))) - self.level.iso();
        let inner = images.map(|q| through.is_inside(q)) == [true; 2];
        let crossing = if there { Crossing::In } else { Crossing::Out };
        let (mut a, mut b) = (spline.value(images[0]) - self.level.iso(), spline.value(images[1]) - self.level.iso());
        if !inner || (a >= 0.0) == (b >= 0.0) {
            // the border, or a side that was known from one sample: by halves
            for _ in 0..40 {
                let middle = 0.5 * (lo + hi);
                if self.is_above(through.backward(ray.at(middle))) == there { hi = middle } else { lo = middle }
            }
            let border = if there { Crossing::Start } else { Crossing::End };
            return (hi, if inner { crossing } else { border });
        }
        // regula falsi that halves the value of an end which stays (Illinois)
        let close = 1e-9 * (hi - lo) + 1e-15 * hi.abs();
        let mut stayed = 0;
        for _ in 0..40 {
            let t = (a * hi - b * lo) / (a - b);
            let v = value(t);
            if (v >= 0.0) == (b >= 0.0) {
                (hi, b) = (t, v);
                if stayed == 1 {
                    a *= 0.5;
                }
                stayed = 1;
            } else {
                (lo, a) = (t, v);
                if stayed == -1 {
                    b *= 0.5;
                }
                stayed = -1;
            }
            if v == 0.0 || hi - lo < close {
                break;
            }
        }
        ((a * hi - b * lo) / (a - b), crossing)
    }
}

/// What a block shows, by its place in blocks of the volume.
fn classify(level: &Level<'_>, own: [isize; 3], images: Option<[DVec3; 2]>) -> Block {
    let dims = level.spline.dims();
    let Some([lower, upper]) = images else {
        if (0..3).any(|a| own[a] < 0 || own[a] as usize >= level.classes.blocks[a]) {
            return Block::Outside;
        }
        let own = own.map(|v| v as usize);
        if (0..3).any(|a| (own[a] + 1) * BLOCK > dims[a]) {
            // the domain ends in it
            return Block::Moved;
        }
        return if level.block_is_active(own) { Block::Still } else { Block::Empty };
    };
    let ends: [f64; 3] = dims.map(|n| n as f64 - 0.5);
    if (0..3).any(|a| upper[a] < -0.5 || lower[a] > ends[a]) {
        return Block::Outside;
    }
    // not where anything is NaN
    if !(0..3).all(|a| lower[a] >= -0.5 && upper[a] <= ends[a]) {
        return Block::Moved;
    }
    let cell = |v: f64, a: usize| (((v + 0.5) / BLOCK as f64) as usize).min(level.classes.blocks[a] - 1);
    let range: [_; 3] = std::array::from_fn(|a| cell(lower[a], a)..=cell(upper[a], a));
    for k in range[2].clone() {
        for j in range[1].clone() {
            for i in range[0].clone() {
                if level.block_is_active([i, j, k]) {
                    return Block::Moved;
                }
            }
        }
    }
    Block::Empty
}

//! The work itself: slabs of the output in parallel, block by block.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::math::parallel;
use glam::DVec3;

use super::grid::{Frame, Link, Span};
use super::kernel::{Line, ROW, Scratch, Window};
use super::shift::{Block, EDGE, Shifts, Supports};
use super::{ExportError, ExportMap, Precision, Progress};
use crate::math::OrientedBox;
use crate::volume::Grid;
use crate::volume::fetch::Fetch;
use crate::volume::sampling::{Interpolation, Sampler};

/// A displacement from which a voxel counts as moved, in voxels of the input.
pub(super) const MOVED: f64 = 1e-3;

/// What happened to the voxels of a part of the output.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tally {
    pub moved: u64,
    pub outside: u64,
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.moved += other.moved;
        self.outside += other.outside;
    }
}

/// Counts finished slabs and asks whether to go on.
pub(super) struct Watch<'a> {
    progress: Progress<'a>,
    done: AtomicUsize,
    total: usize,
    stopped: AtomicBool,
}

impl<'a> Watch<'a> {
    pub fn new(progress: Progress<'a>, total: usize) -> Self {
        Self { progress, done: AtomicUsize::new(0), total: total.max(1), stopped: AtomicBool::new(false) }
    }

    pub fn stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    pub fn step(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        if (self.progress)(done as f64 / self.total as f64) == ControlFlow::Break(()) {
            self.stopped.store(true, Ordering::Relaxed);
        }
    }

    pub fn finish(&self) -> Result<(), ExportError> {
        if self.stopped() { Err(ExportError::Cancelled) } else { Ok(()) }
    }
}

/// Everything the voxels of an output need.
pub(super) struct Job<'a, T> {
    pub input: &'a Grid,
    /// The support boxes of the map, in the world.
    pub boxes: &'a [OrientedBox],
    pub sampler: Sampler<'a, T>,
    pub map: &'a dyn ExportMap,
    pub frame: Frame,
    pub supports: Supports,
    pub interpolation: Interpolation,
    pub precision: Precision,
    /// One value for each channel.
    pub outside: Vec<T>,
}

/// The arrays of one thread.
struct Work<T> {
    shifts: Shifts,
    scratch: Scratch<T>,
    at: [[f32; ROW]; 3],
    row: Vec<T>,
}

impl<T: Fetch> Job<'_, T> {
    fn work(&self) -> Work<T> {
        Work {
            shifts: Shifts::new(),
            scratch: Scratch::new(),
            at: [[0.0; ROW]; 3],
            row: vec![T::zeroed(); ROW * self.sampler.channels()],
        }
    }

    /// Fills the samples of the output grid.
    pub fn fill(&self, output: &Grid, samples: &mut [T], progress: Progress<'_>) -> Result<Tally, ExportError> {
        let [nx, ny, nz] = output.dims;
        let channels = self.sampler.channels();
        let watch = Watch::new(progress, nz.div_ceil(EDGE));
        let scratch = parallel::Pool::default();
        let tallies = parallel::chunks_mut(samples, EDGE * nx * ny * channels, &|index, chunk| {
            scratch.with(
                || self.work(),
                |work| {
                    let mut tally = Tally::default();
                    if watch.stopped() {
                        return tally;
                    }
                    let bottom = index * EDGE;
                    self.blocks(&slab(output.dims, index), work, &mut tally, |i, j, k, row| {
                        let at = (((k as usize - bottom) * ny + j as usize) * nx + i as usize) * channels;
                        chunk[at..at + row.len()].copy_from_slice(row);
                    });
                    watch.step();
                    tally
                },
            )
        });
        let mut tally = Tally::default();
        tallies.into_iter().for_each(|t| tally += t);
        watch.finish()?;
        Ok(tally)
    }

    /// The same volume and map on another grid.
    pub fn on(&self, output: &Grid) -> Self {
        let frame = Frame::new(self.input, output);
        let supports = Supports::new(output, self.boxes);
        Self { frame, supports, outside: self.outside.clone(), ..*self }
    }

    /// How many voxels of the grid, of these dimensions, hold something other than the outside value, and the box around
    /// them.
    pub fn material(&self, dims: [usize; 3]) -> (u64, Option<Span>) {
        let channels = self.sampler.channels();
        let join = |a: (u64, Option<Span>), b: (u64, Option<Span>)| {
            let span = match (a.1, b.1) {
                (Some(a), Some(b)) => Some(a.hull(b)),
                (a, b) => a.or(b),
            };
            (a.0 + b.0, span)
        };
        let scratch = parallel::Pool::default();
        let found = parallel::map(dims[2].div_ceil(EDGE), &|index| {
            scratch.with(
                || self.work(),
                |work| {
                    let mut found = (0, None);
                    let slab = slab(dims, index);
                    self.blocks(&slab, work, &mut Tally::default(), |i, j, k, row| {
                        let differs = |v: &[T]| v.iter().zip(&self.outside).any(|(a, b)| a != b);
                        for (l, _) in row.chunks_exact(channels).enumerate().filter(|(_, v)| differs(v)) {
                            let at = [i + l as i64, j, k];
                            found = join(found, (1, Some(Span { lo: at, hi: at })));
                        }
                    });
                    found
                },
            )
        });
        found.into_iter().fold((0, None), join)
    }

    /// Hands every row of every block in a slab (at most [`EDGE`] layers) to the sink as `(i, j, k, samples)`.
    fn blocks(&self, slab: &Span, work: &mut Work<T>, tally: &mut Tally, mut sink: impl FnMut(i64, i64, i64, &[T])) {
        let depth = (slab.hi[2] - slab.lo[2] + 1) as usize;
        for j in (slab.lo[1]..=slab.hi[1]).step_by(EDGE) {
            for i in (slab.lo[0]..=slab.hi[0]).step_by(ROW) {
                let size = [((slab.hi[0] - i + 1) as usize).min(ROW), ((slab.hi[1] - j + 1) as usize).min(EDGE), depth];
                let block = Block { lo: [i, j, slab.lo[2]], size };
                if self.precision == Precision::Reference {
                    self.reference(&block, work, tally, &mut sink);
                } else if self.supports.touch(&block) {
                    work.shifts.fill(&self.frame, self.map, &self.supports, &block);
                    self.displaced(&block, true, work, tally, &mut sink);
                } else if let Link::Lattice(offset) = self.frame.link {
                    self.copy(&block, offset, work, tally, &mut sink);
                } else {
                    self.displaced(&block, false, work, tally, &mut sink);
                }
            }
        }
    }

    /// Every voxel by itself in `f64`, whether a support is near or not.
    fn reference(
        &self,
        block: &Block,
        work: &mut Work<T>,
        tally: &mut Tally,
        sink: &mut impl FnMut(i64, i64, i64, &[T]),
    ) {
        let channels = self.sampler.channels();
        for k in 0..block.size[2] {
            for j in 0..block.size[1] {
                let row = &mut work.row[..block.size[0] * channels];
                for (i, value) in row.chunks_exact_mut(channels).enumerate() {
                    let voxel = block.voxel(i, j, k);
                    let source = self.frame.source(self.map, voxel);
                    let shift = source - self.frame.undisplaced(voxel);
                    tally.moved += u64::from(!(shift.abs().max_element() <= MOVED));
                    if !self.sampler.sample(self.interpolation, source, value) {
                        value.copy_from_slice(&self.outside);
                        tally.outside += 1;
                    }
                }
                sink(block.lo[0], block.lo[1] + j as i64, block.lo[2] + k as i64, row);
            }
        }
    }

    /// Nothing moves and the lattices are the same: samples are copied.
    fn copy(
        &self,
        block: &Block,
        offset: [i64; 3],
        work: &mut Work<T>,
        tally: &mut Tally,
        sink: &mut impl FnMut(i64, i64, i64, &[T]),
    ) {
        let channels = self.sampler.channels();
        let dims = self.sampler.dims().map(|n| n as i64);
        let samples = self.sampler.samples();
        let from: [i64; 3] = std::array::from_fn(|a| block.lo[a].saturating_add(offset[a]));
        let width = block.size[0] as i64;
        // the part of the row that lies in the input
        let (begin, end) = ((-from[0]).clamp(0, width), (dims[0] - from[0]).clamp(0, width));
        for k in 0..block.size[2] {
            for j in 0..block.size[1] {
                let (y, z) = (from[1] + j as i64, from[2] + k as i64);
                let at = (block.lo[0], block.lo[1] + j as i64, block.lo[2] + k as i64);
                let inside = (0..dims[1]).contains(&y) && (0..dims[2]).contains(&z) && begin < end;
                let line = if inside { ((z * dims[1] + y) * dims[0]) as usize } else { 0 };
                if inside && begin == 0 && end == width {
                    let start = (line + from[0] as usize) * channels;
                    sink(at.0, at.1, at.2, &samples[start..start + block.size[0] * channels]);
                    continue;
                }
                let row = &mut work.row[..block.size[0] * channels];
                for voxel in row.chunks_exact_mut(channels) {
                    voxel.copy_from_slice(&self.outside);
                }
                let mut found = 0;
                if inside {
                    let start = (line + (from[0] + begin) as usize) * channels;
                    found = (end - begin) as usize;
                    row[begin as usize * channels..end as usize * channels]
                        .copy_from_slice(&samples[start..start + found * channels]);
                }
                tally.outside += (block.size[0] - found) as u64;
                sink(at.0, at.1, at.2, row);
            }
        }
    }

    /// Looks the samples up at the undisplaced coordinates plus, if `shifted`, the block's shifts.
    fn displaced(
        &self,
        block: &Block,
        shifted: bool,
        work: &mut Work<T>,
        tally: &mut Tally,
        sink: &mut impl FnMut(i64, i64, i64, &[T]),
    ) {
        let channels = self.sampler.channels();
        let steps = self.frame.steps();
        let first = self.frame.undisplaced(block.first());
        let window = Window::new(self.sampler, first.floor());
        let base = window.base();
        let count = block.size[0];
        for k in 0..block.size[2] {
            for j in 0..block.size[1] {
                let start = first - base + steps.y_axis * j as f64 + steps.z_axis * k as f64;
                let line = Line {
                    start: start.as_vec3().to_array(),
                    step: steps.x_axis.as_vec3().to_array(),
                    shift: shifted.then_some(&work.shifts.rows[k * EDGE + j]),
                    count,
                    threshold: MOVED as f32,
                    at: &mut work.at,
                };
                tally.moved += line.fill();
                let row = &mut work.row[..count * channels];
                let outside = if self.interpolation == Interpolation::Linear {
                    window.linear(&work.at, &self.outside, &mut work.scratch, row)
                } else {
                    self.single(&work.at, base, row)
                };
                tally.outside += outside as u64;
                sink(block.lo[0], block.lo[1] + j as i64, block.lo[2] + k as i64, row);
            }
        }
    }

    /// A row of look-ups by the reference sampler.
    fn single(&self, at: &[[f32; ROW]; 3], base: DVec3, row: &mut [T]) -> usize {
        let mut outside = 0;
        for (l, value) in row.chunks_exact_mut(self.sampler.channels()).enumerate() {
            let p = base + DVec3::new(f64::from(at[0][l]), f64::from(at[1][l]), f64::from(at[2][l]));
            if !self.sampler.sample(self.interpolation, p, value) {
                value.copy_from_slice(&self.outside);
                outside += 1;
            }
        }
        outside
    }
}

/// The layers of one parallel piece of a grid.
fn slab(dims: [usize; 3], index: usize) -> Span {
    let bottom = index * EDGE;
    let top = (bottom + EDGE).min(dims[2]);
    Span { lo: [0, 0, bottom as i64], hi: [dims[0] as i64 - 1, dims[1] as i64 - 1, top as i64 - 1] }
}

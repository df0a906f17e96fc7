//! The work itself: slabs of the output in parallel, block by block.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::math::parallel;
use glam::DVec3;

use super::grid::{self, Frame, Link, Span};
use super::kernel::{Counted, LARGEST_EDGE, Points, ROW, ROWS, Rows, Scratch, Window, shift};
use super::shift::{Block, EDGE, Shifts, Supports};
use super::{ExportError, ExportMap, ExportOptions, Precision, Progress, beyond};
use crate::deform::{Framed, Near};
use crate::math::OrientedBox;
use crate::volume::fetch::Fetch;
use crate::volume::sampling::{Interpolation, Sampler};
use crate::volume::{Grid, Volume};

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
    /// The map in voxels of the input, if it can be written so.
    pub framed: Option<&'a Framed>,
    pub frame: Frame,
    pub supports: Supports,
    pub interpolation: Interpolation,
    pub precision: Precision,
    /// One value for each channel.
    pub outside: Vec<T>,
}

impl<'a, T: Fetch> Job<'a, T> {
    /// A job on `base`, a grid that has not grown yet; `outside` as stored, not yet rounded.
    pub fn new(
        volume: &'a Volume,
        samples: &'a [T],
        (map, framed, boxes): (&'a dyn ExportMap, Option<&'a Framed>, &'a [OrientedBox]),
        base: &Grid,
        options: &ExportOptions,
        outside: f64,
    ) -> Self {
        let input = &volume.grid;
        Self {
            input,
            boxes,
            sampler: Sampler::new(samples, input.dims, volume.channels),
            map,
            framed,
            frame: Frame::new(input, base),
            supports: Supports::new(base, boxes),
            interpolation: options.interpolation,
            precision: options.precision,
            outside: vec![T::from_f64(outside); volume.channels],
        }
    }

    /// The grid grown to hold what was pulled out of `base`.
    pub fn grown(&self, base: &Grid, limit: u64) -> Result<Grid, ExportError> {
        let candidate = Span::of(base).hull(grid::reached(self.input, base, self.boxes));
        grid::cut(base, &beyond::grow(self, base, candidate, limit)?)
    }
}

/// The arrays of one thread.
struct Work<T> {
    shifts: Shifts,
    scratch: Scratch<T>,
    /// The coordinates of a layer of a block.
    points: Vec<Points>,
    /// Its samples.
    rows: Vec<T>,
    /// Steps of the map that act on it.
    acting: Vec<usize>,
    /// So many times the outside value.
    nothing: Vec<T>,
}

/// How a block is displaced.
enum Way<'a> {
    /// Not at all.
    Still,
    /// By the shifts in the scratch.
    Shifts,
    Near(&'a Near),
}

impl<T: Fetch> Job<'_, T> {
    fn work(&self) -> Work<T> {
        Work {
            shifts: Shifts::new(),
            scratch: Scratch::new(),
            points: vec![Points::default(); EDGE / ROWS],
            rows: vec![T::zeroed(); ROW * EDGE * self.sampler.channels()],
            acting: Vec::new(),
            nothing: self.outside.repeat(ROW),
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
                    self.blocks(
                        &slab(output.dims, index),
                        work,
                        Some(&mut tally),
                        |_| false,
                        |i, j, k, row| {
                            let at = (((k as usize - bottom) * ny + j as usize) * nx + i as usize) * channels;
                            copy(row, &mut chunk[at..at + row.len()]);
                        },
                    );
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

    /// How many voxels of the grid, of these dimensions, hold something other than the outside value.
    pub fn material(&self, dims: [usize; 3]) -> u64 {
        let channels = self.sampler.channels();
        let differs = |v: &[T]| u64::from(v.iter().zip(&self.outside).any(|(a, b)| a != b));
        let found = self.visit(
            dims,
            |block| self.is_barren(block),
            |found: &mut u64, _, row| {
                *found += match self.outside[..] {
                    // without an early end, for vector units
                    [outside] => row.iter().map(|v| u64::from(*v != outside)).sum::<u64>(),
                    _ => row.chunks_exact(channels).map(differs).sum::<u64>(),
                };
            },
        );
        found.into_iter().sum()
    }

    /// The box around all voxels of the grid, of these dimensions, that hold something other than the outside value, and
    /// `known`.
    pub fn hull(&self, dims: [usize; 3], known: Option<Span>) -> Option<Span> {
        let channels = self.sampler.channels();
        let hull = Mutex::new(known);
        let join = |a: Option<Span>, b: Option<Span>| match (a, b) {
            (Some(a), Some(b)) => Some(a.hull(b)),
            (a, b) => a.or(b),
        };
        let share = |found: Option<Span>| {
            let mut hull = hull.lock().unwrap_or_else(PoisonError::into_inner);
            *hull = join(*hull, found);
            *hull
        };
        // what lies in the hull already can add nothing, so that the result is the same in any order
        let skip = |block: &Block| {
            let hi = std::array::from_fn(|a| block.lo[a] + block.size[a] as i64 - 1);
            share(None).is_some_and(|h| h.hull(Span { lo: block.lo, hi }) == h) || self.is_barren(block)
        };
        self.visit(dims, skip, |_: &mut (), [i, j, k], row| {
            let mut voxels = row.chunks_exact(channels).map(|v| v.iter().zip(&self.outside).any(|(a, b)| a != b));
            if let Some(first) = voxels.position(|differs| differs) {
                let last = voxels.rposition(|differs| differs).map_or(first, |behind| first + 1 + behind);
                share(Some(Span { lo: [i + first as i64, j, k], hi: [i + last as i64, j, k] }));
            }
        });
        share(None)
    }

    /// Samples those blocks of the grid that are not skipped; every slab has a result of its own.
    fn visit<R: Default + Send>(
        &self,
        dims: [usize; 3],
        skip: impl Fn(&Block) -> bool + Sync,
        see: impl Fn(&mut R, [i64; 3], &[T]) + Sync,
    ) -> Vec<R> {
        let scratch = parallel::Pool::default();
        parallel::map(dims[2].div_ceil(EDGE), &|index| {
            scratch.with(
                || self.work(),
                |work| {
                    let mut result = R::default();
                    self.blocks(&slab(dims, index), work, None, &skip, |i, j, k, row| {
                        see(&mut result, [i, j, k], row);
                    });
                    result
                },
            )
        })
    }

    /// Voxels of the grid, of these dimensions, in blocks that may hold something other than the outside value.
    pub fn candidates(&self, dims: [usize; 3]) -> u64 {
        let found = parallel::map(dims[2].div_ceil(EDGE), &|index| {
            let blocks = tiles(&slab(dims, index)).filter(|b| !self.is_barren(b));
            blocks.map(|b| b.size.iter().product::<usize>() as u64).sum::<u64>()
        });
        found.into_iter().sum()
    }

    /// Whether all of a block surely comes from beyond the input.
    fn is_barren(&self, block: &Block) -> bool {
        let (mut lo, mut hi) = self.undisplaced_bounds(block);
        if self.supports.touch(block) {
            let Some(framed) = self.framed else { return false };
            (lo, hi) = framed.sources(lo, hi);
        }
        // with room for the rounding of coordinates
        let size = DVec3::from(self.sampler.dims().map(|n| n as f64));
        hi.min_element() < -0.51 || (lo - size).max_element() > -0.49
    }

    /// Hands the voxels of a slab (at most [`EDGE`] layers) to the sink, in pieces of rows as `(i, j, k, samples)`: all of
    /// the blocks that are not skipped or, if nobody counts, all but those that surely come from beyond the input.
    fn blocks(
        &self,
        slab: &Span,
        work: &mut Work<T>,
        mut tally: Option<&mut Tally>,
        skip: impl Fn(&Block) -> bool,
        mut sink: impl FnMut(i64, i64, i64, &[T]),
    ) {
        // blocks side by side that are copied
        let mut still: Option<Block> = None;
        for block in tiles(slab).filter(|b| !skip(b)) {
            let moves = self.precision == Precision::Reference || self.supports.touch(&block);
            let copied = !moves && matches!(self.frame.link, Link::Lattice(_));
            if let Some(run) = &mut still {
                if copied && run.lo[1] == block.lo[1] && run.lo[0] + run.size[0] as i64 == block.lo[0] {
                    run.size[0] += block.size[0];
                    continue;
                }
                self.copy(run, work, &mut tally, &mut sink);
                still = None;
            }
            if copied {
                still = Some(block);
            } else {
                self.one(&block, moves, work, &mut tally, &mut sink);
            }
        }
        if let Some(run) = still {
            self.copy(&run, work, &mut tally, &mut sink);
        }
    }

    /// A block that is not just copied.
    fn one(
        &self,
        block: &Block,
        moves: bool,
        work: &mut Work<T>,
        tally: &mut Option<&mut Tally>,
        sink: &mut impl FnMut(i64, i64, i64, &[T]),
    ) {
        let first = self.frame.undisplaced(block.first());
        let window = Window::new(self.sampler, first.floor());
        // so far from the volume coordinates in `f32` are too coarse
        let far = window.base() != first.floor();
        if self.precision == Precision::Reference || moves && far {
            self.reference(block, work, tally, sink);
        } else if !moves {
            self.look_up(block, &window, Way::Still, work, tally, sink);
        } else if let Some(framed) = self.framed {
            let (lo, hi) = self.undisplaced_bounds(block);
            let near = framed.near(lo, hi, window.base());
            self.look_up(block, &window, Way::Near(&near), work, tally, sink);
        } else {
            work.shifts.fill(&self.frame, self.map, &self.supports, block);
            self.look_up(block, &window, Way::Shifts, work, tally, sink);
        }
    }

    /// Corners of the box around the undisplaced input coordinates of a block.
    fn undisplaced_bounds(&self, block: &Block) -> (DVec3, DVec3) {
        let (middle, half) = block.middle();
        let steps = self.frame.steps();
        let reach = steps.x_axis.abs() * half.x + steps.y_axis.abs() * half.y + steps.z_axis.abs() * half.z;
        let middle = self.frame.undisplaced(middle);
        (middle - reach, middle + reach)
    }

    /// Every voxel by itself in `f64`, whether a support is near or not.
    fn reference(
        &self,
        block: &Block,
        work: &mut Work<T>,
        tally: &mut Option<&mut Tally>,
        sink: &mut impl FnMut(i64, i64, i64, &[T]),
    ) {
        let channels = self.sampler.channels();
        let mut sum = Tally::default();
        for k in 0..block.size[2] {
            for j in 0..block.size[1] {
                let row = &mut work.rows[..block.size[0] * channels];
                for (i, value) in row.chunks_exact_mut(channels).enumerate() {
                    let voxel = block.voxel(i, j, k);
                    let source = self.frame.source(self.map, voxel);
                    let shift = source - self.frame.undisplaced(voxel);
                    sum.moved += u64::from(!(shift.abs().max_element() <= MOVED));
                    if !self.sampler.sample(self.interpolation, source, value) {
                        value.copy_from_slice(&self.outside);
                        sum.outside += 1;
                    }
                }
                sink(block.lo[0], block.lo[1] + j as i64, block.lo[2] + k as i64, row);
            }
        }
        add(tally, sum);
    }

    /// Nothing moves and the lattices are the same: samples are copied.
    fn copy(
        &self,
        block: &Block,
        work: &Work<T>,
        tally: &mut Option<&mut Tally>,
        sink: &mut impl FnMut(i64, i64, i64, &[T]),
    ) {
        let Link::Lattice(offset) = self.frame.link else { return };
        let channels = self.sampler.channels();
        let dims = self.sampler.dims().map(|n| n as i64);
        let samples = self.sampler.samples();
        let from: [i64; 3] = std::array::from_fn(|a| block.lo[a].saturating_add(offset[a]));
        let width = block.size[0] as i64;
        // the part of a row that lies in the input
        let (begin, end) = ((-from[0]).clamp(0, width), (dims[0] - from[0]).clamp(0, width));
        for k in 0..block.size[2] as i64 {
            for j in 0..block.size[1] as i64 {
                let (y, z) = (from[1] + j, from[2] + k);
                let inside = (0..dims[1]).contains(&y) && (0..dims[2]).contains(&z) && begin < end;
                let (begin, end) = if inside { (begin, end) } else { (width, width) };
                let [x0, y0, z0] = block.lo;
                for (from, to) in [(0, begin), (end, width)] {
                    add(tally, Tally { moved: 0, outside: (to - from) as u64 });
                    for at in (from..to).step_by(ROW) {
                        let count = ((to - at) as usize).min(ROW);
                        sink(x0 + at, y0 + j, z0 + k, &work.nothing[..count * channels]);
                    }
                }
                if inside {
                    let start = ((z * dims[1] + y) * dims[0] + from[0] + begin) as usize * channels;
                    let row = &samples[start..start + (end - begin) as usize * channels];
                    sink(x0 + begin, y0 + j, z0 + k, row);
                }
            }
        }
    }

    /// Looks the samples of a block up, layer by layer.
    fn look_up(
        &self,
        block: &Block,
        window: &Window<'_, T>,
        way: Way<'_>,
        work: &mut Work<T>,
        tally: &mut Option<&mut Tally>,
        sink: &mut impl FnMut(i64, i64, i64, &[T]),
    ) {
        let channels = self.sampler.channels();
        let by_blocks =
            self.interpolation == Interpolation::Linear && self.sampler.dims().iter().all(|n| *n < LARGEST_EDGE);
        let steps = self.frame.steps();
        let base = window.base();
        let origin = self.frame.undisplaced(block.first()) - base;
        let step = steps.x_axis.as_vec3().to_array();
        let counted = Counted { rows: block.size[1], points: block.size[0] };
        let blocks = counted.rows.div_ceil(ROWS);
        if let Way::Near(near) = way {
            let (lo, hi) = self.undisplaced_bounds(block);
            let (lo, hi) = ((lo - base).as_vec3(), (hi - base).as_vec3());
            window.read_ahead(&near.acting(std::array::from_fn(|a| [lo[a], hi[a]]), &mut work.acting));
        }
        for k in 0..block.size[2] {
            // beyond the last row, the last row again
            let start: [[f32; 3]; EDGE] = std::array::from_fn(|j| {
                let j = j.min(counted.rows - 1) as f64;
                (origin + steps.y_axis * j + steps.z_axis * k as f64).as_vec3().to_array()
            });
            let rows = Rows { start: &start[..blocks * ROWS], step, counted };
            let (mut sources, mut moves) = (bounds(&rows), true);
            match way {
                Way::Still => moves = false,
                Way::Near(near) => {
                    sources = near.acting(sources, &mut work.acting);
                    moves = !work.acting.is_empty();
                }
                Way::Shifts => sources = [[f32::NEG_INFINITY, f32::INFINITY]; 3],
            }
            if tally.is_none() && window.misses(&sources) {
                continue;
            }
            if !moves && matches!(self.frame.link, Link::Lattice(_)) {
                let lo = [block.lo[0], block.lo[1], block.lo[2] + k as i64];
                self.copy(&Block { lo, size: [counted.points, counted.rows, 1] }, work, tally, sink);
                continue;
            }
            let points = &mut work.points[..blocks];
            rows.fill(points);
            match way {
                Way::Still => {}
                Way::Near(near) => near.backward(&work.acting, points),
                Way::Shifts => {
                    for j in 0..counted.rows {
                        shift(&mut points[j / ROWS], j % ROWS, &work.shifts.rows[k * EDGE + j]);
                    }
                }
            }
            let mut sum = Tally::default();
            if moves && tally.is_some() {
                sum.moved = rows.moved(points, MOVED as f32);
            }
            sum.outside = if by_blocks {
                let contained = window.contains(&sources);
                window.linear(points, contained, counted, &self.outside, &mut work.scratch, &mut work.rows)
            } else {
                self.single(points, counted, base, &mut work.rows)
            };
            add(tally, sum);
            for (j, row) in work.rows.chunks_exact(ROW * channels).take(counted.rows).enumerate() {
                let row = &row[..counted.points * channels];
                sink(block.lo[0], block.lo[1] + j as i64, block.lo[2] + k as i64, row);
            }
        }
    }

    /// Look-ups by the reference sampler. Returns how many were outside.
    fn single(&self, points: &[Points], counted: Counted, base: DVec3, rows: &mut [T]) -> u64 {
        let channels = self.sampler.channels();
        let mut outside = 0;
        for (j, row) in rows.chunks_exact_mut(ROW * channels).take(counted.rows).enumerate() {
            for (l, value) in row.chunks_exact_mut(channels).take(counted.points).enumerate() {
                let (points, l) = (&points[j / ROWS], j % ROWS * ROW + l);
                let p = base + DVec3::new(f64::from(points.x[l]), f64::from(points.y[l]), f64::from(points.z[l]));
                if !self.sampler.sample(self.interpolation, p, value) {
                    value.copy_from_slice(&self.outside);
                    outside += 1;
                }
            }
        }
        outside
    }
}

fn add(tally: &mut Option<&mut Tally>, more: Tally) {
    if let Some(tally) = tally {
        **tally += more;
    }
}

/// Ends along each axis of the points of rows.
fn bounds(rows: &Rows<'_>) -> [[f32; 2]; 3] {
    std::array::from_fn(|a| {
        let along = rows.step[a] * (rows.counted.points - 1) as f32;
        // starts are in equal steps as well
        let (first, last) = (rows.start[0][a], rows.start[rows.start.len() - 1][a]);
        [first.min(last) + along.min(0.0), first.max(last) + along.max(0.0)]
    })
}

/// Copies a piece of a row.
#[inline]
fn copy<T: Copy>(from: &[T], to: &mut [T]) {
    match (<&[T; ROW]>::try_from(from), <&mut [T; ROW]>::try_from(&mut *to)) {
        // most pieces, and of a length that the compiler knows
        (Ok(from), Ok(to)) => *to = *from,
        _ => to.copy_from_slice(from),
    }
}

/// The blocks of a slab.
fn tiles(slab: &Span) -> impl Iterator<Item = Block> + use<> {
    let Span { lo, hi } = *slab;
    let size = move |i: i64, a: usize, most: usize| ((hi[a] - i + 1) as usize).min(most);
    (lo[1]..=hi[1]).step_by(EDGE).flat_map(move |j| {
        let row = (lo[0]..=hi[0]).step_by(ROW);
        row.map(move |i| Block { lo: [i, j, lo[2]], size: [size(i, 0, ROW), size(j, 1, EDGE), size(lo[2], 2, EDGE)] })
    })
}

/// The layers of one parallel piece of a grid.
fn slab(dims: [usize; 3], index: usize) -> Span {
    let bottom = index * EDGE;
    let top = (bottom + EDGE).min(dims[2]);
    Span { lo: [0, 0, bottom as i64], hi: [dims[0] as i64 - 1, dims[1] as i64 - 1, top as i64 - 1] }
}

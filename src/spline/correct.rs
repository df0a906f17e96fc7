//! The spline's values at the samples, and the correction that brings them back to the data.
//!
//! At a sample the spline has the value `A f`: 3/8 of the sample, 1/12 of each of its 6 neighbours across faces and 1/96 of
//! each of the 12 across edges. Steps `c <- c + (f - A c)` from `c = f` lead to coefficients `c` whose spline nearly passes
//! through `f`. `A` vanishes at the highest frequency, so no exact inverse is wanted.

use pulp::WithSimd;

use crate::math::{lanes, parallel};

/// A volume with one more layer of samples on every side, which repeats the outermost.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Padded {
    /// Samples without the extra layers.
    pub dims: [usize; 3],
    pub values: Vec<f32>,
}

impl Padded {
    /// Fills rows by `row(j, k, out)` with one value for each sample along the first axis, and takes `steps` corrections.
    pub fn from_rows(dims: [usize; 3], row: Rows, steps: u32) -> Self {
        let [nx, ny, nz] = dims;
        let (width, height) = (nx + 2, ny + 2);
        let layer = width * height;
        let mut values = vec![0.0; layer * (nz + 2)];
        // long pieces, because each works off a few layers more on both sides
        let piece = (nz + 2).div_ceil(4 * rayon::current_num_threads()).max(8 * steps as usize).max(4);
        parallel::chunks_mut(&mut values, piece * layer, &|n, planes| {
            let mut pipe = Pipe::new(dims, row, steps as usize);
            for (k, plane) in planes.chunks_exact_mut(layer).enumerate() {
                pipe.finish((n * piece + k).clamp(1, nz) - 1, plane);
            }
        });
        Self { dims, values }
    }

    /// Steps in memory along the axes.
    pub fn strides(&self) -> [usize; 3] {
        [1, self.dims[0] + 2, (self.dims[0] + 2) * (self.dims[1] + 2)]
    }

    /// Where sample (i, j, k) lies.
    #[inline(always)]
    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        ((k + 1) * (self.dims[1] + 2) + j + 1) * (self.dims[0] + 2) + i + 1
    }
}

/// Writes a row of samples.
pub(crate) type Rows<'a> = &'a (dyn Fn(usize, usize, &mut [f32]) + Sync);

/// Corrects layer after layer, holding of each step only the last few, so that all of it stays in the cache.
struct Pipe<'a> {
    dims: [usize; 3],
    row: Rows<'a>,
    /// Of the data and of each step but the last, the layers that are held: layer k at `k % HELD`.
    held: Vec<Vec<f32>>,
    /// The next layer of each.
    next: Vec<Option<usize>>,
    sums: Sums,
}

impl<'a> Pipe<'a> {
    fn new(dims: [usize; 3], row: Rows<'a>, steps: usize) -> Self {
        let layer = (dims[0] + 2) * (dims[1] + 2);
        // of the data, the last step still needs the layer that all steps have passed
        let kept = steps + 3;
        Self {
            dims,
            row,
            held: (0..steps).map(|_| vec![0.0; kept * layer]).collect(),
            next: vec![None; steps],
            sums: Sums::new(dims[0] + 2),
        }
    }

    /// Layer `k` after all steps. Layers must be asked for in order.
    fn finish(&mut self, k: usize, out: &mut [f32]) {
        match self.held.len() {
            0 => self.read(k, out),
            steps => self.make(steps, k, out),
        }
    }

    /// Layer `k` of the data.
    fn read(&self, k: usize, out: &mut [f32]) {
        let [nx, ny, _] = self.dims;
        for j in 0..ny {
            (self.row)(j, k, &mut out[(j + 1) * (nx + 2) + 1..][..nx]);
        }
        close(out, nx, ny);
    }

    /// Sees to it that layers up to `k` of a step (0: the data) are held.
    fn hold(&mut self, step: usize, k: usize) {
        let layer = (self.dims[0] + 2) * (self.dims[1] + 2);
        let kept = self.held.len() + 3;
        let first = self.next[step].unwrap_or(k.saturating_sub(2));
        for k in first..=k {
            // taken out while it is filled
            let mut own = std::mem::take(&mut self.held[step]);
            let plane = &mut own[k % kept * layer..][..layer];
            if step == 0 {
                self.read(k, plane)
            } else {
                self.make(step, k, plane)
            }
            self.held[step] = own;
        }
        self.next[step] = Some(first.max(k + 1));
    }

    /// Layer `k` of a step above 0.
    fn make(&mut self, step: usize, k: usize, out: &mut [f32]) {
        let [nx, ny, nz] = self.dims;
        let width = nx + 2;
        let layer = width * (ny + 2);
        let (below, above) = (k.saturating_sub(1), (k + 1).min(nz - 1));
        self.hold(step - 1, above);
        let kept = self.held.len() + 3;
        let at = |k: usize| k % kept * layer;
        let (from, data) = (&self.held[step - 1], &self.held[0]);
        let planes = [below, k, above].map(|k| &from[at(k)..][..layer]);
        for j in 1..=ny {
            let smooth = self.sums.row(planes, j * width, width);
            let (now, data) = (&planes[1][j * width + 1..][..nx], &data[at(k) + j * width + 1..][..nx]);
            for (((out, s), c), f) in out[j * width + 1..][..nx].iter_mut().zip(smooth).zip(now).zip(data) {
                *out = c + (f - s);
            }
        }
        close(out, nx, ny);
    }
}

/// Repeats the outermost samples of a layer in its extra rows and columns.
fn close(plane: &mut [f32], nx: usize, ny: usize) {
    let width = nx + 2;
    for row in plane.chunks_exact_mut(width).skip(1).take(ny) {
        row[0] = row[1];
        row[nx + 1] = row[nx];
    }
    plane.copy_within(width..2 * width, 0);
    plane.copy_within(ny * width..(ny + 1) * width, (ny + 1) * width);
}

/// Scratch rows for `A`.
pub(crate) struct Sums {
    ends: Vec<f32>,
    middle: Vec<f32>,
    smooth: Vec<f32>,
}

impl Sums {
    pub fn new(width: usize) -> Self {
        Self { ends: vec![0.0; width], middle: vec![0.0; width], smooth: vec![0.0; width - 2] }
    }

    /// `A c` along the row that starts (with its extra sample) at `at`, from the layers below, own and above.
    #[inline(always)]
    pub fn row(&mut self, [below, own, above]: [&[f32]; 3], at: usize, width: usize) -> &[f32] {
        let corners = [
            &below[at - width..][..width],
            &below[at + width..][..width],
            &above[at - width..][..width],
            &above[at + width..][..width],
        ];
        let (left, right) = (&own[at - width..][..width], &own[at + width..][..width]);
        let (below, own, above) = (&below[at..][..width], &own[at..][..width], &above[at..][..width]);
        lanes::dispatch(Row { sums: self, below, own, above, left, right, corners });
        &self.smooth
    }
}

/// A row of `A c`, from the rows around it.
struct Row<'a> {
    sums: &'a mut Sums,
    below: &'a [f32],
    own: &'a [f32],
    above: &'a [f32],
    left: &'a [f32],
    right: &'a [f32],
    corners: [&'a [f32]; 4],
}

impl WithSimd for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { sums, below, own, above, left, right, corners } = self;
        let width = own.len();
        let (ends, middle) = (&mut sums.ends[..width], &mut sums.middle[..width]);
        for i in 0..width {
            let lateral = (left[i] + right[i]) + (below[i] + above[i]);
            let diagonal = (corners[0][i] + corners[1][i]) + (corners[2][i] + corners[3][i]);
            ends[i] = own[i] * (1.0 / 12.0) + lateral * (1.0 / 96.0);
            middle[i] = own[i] * (3.0 / 8.0) + lateral * (1.0 / 12.0) + diagonal * (1.0 / 96.0);
        }
        let n = width - 2;
        let smooth = &mut sums.smooth[..n];
        let (before, middle, after) = (&ends[..n], &middle[1..][..n], &ends[2..][..n]);
        for i in 0..n {
            smooth[i] = middle[i] + (before[i] + after[i]);
        }
    }
}

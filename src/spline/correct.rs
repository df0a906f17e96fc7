//! The spline's values at the samples, and the correction that brings them back to the data.
//!
//! At a sample the spline has the value `A f`: 3/8 of the sample, 1/12 of each of its 6 neighbours across faces and 1/96 of
//! each of the 12 across edges. Steps `c <- c + (f - A c)` from `c = f` lead to coefficients `c` whose spline nearly passes
//! through `f`. `A` vanishes at the highest frequency, so no exact inverse is wanted.

use crate::math::parallel;

/// A volume with one more layer of samples on every side, which repeats the outermost.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Padded {
    /// Samples without the extra layers.
    pub dims: [usize; 3],
    pub values: Vec<f32>,
}

impl Padded {
    /// Fills rows by `row(j, k, out)` with one value for each sample along the first axis.
    pub fn from_rows(dims: [usize; 3], row: &(dyn Fn(usize, usize, &mut [f32]) + Sync)) -> Self {
        let [nx, ny, nz] = dims;
        let (width, height) = (nx + 2, ny + 2);
        let mut values = vec![0.0; width * height * (nz + 2)];
        parallel::chunks_mut(&mut values, width * height, &|k, plane| {
            let k = k.clamp(1, nz) - 1;
            for j in 0..ny {
                row(j, k, &mut plane[(j + 1) * width + 1..][..nx]);
            }
            close(plane, nx, ny);
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

    /// The coefficients after `steps` corrections.
    pub fn corrected(self, steps: u32) -> Self {
        if steps == 0 {
            return self;
        }
        let data = self;
        let mut now = data.values.clone();
        let mut next = vec![0.0; now.len()];
        for _ in 0..steps {
            data.step(&now, &mut next);
            std::mem::swap(&mut now, &mut next);
        }
        Self { dims: data.dims, values: now }
    }

    /// `next = now + (data - A now)`.
    fn step(&self, now: &[f32], next: &mut [f32]) {
        let [nx, ny, nz] = self.dims;
        let [_, width, layer] = self.strides();
        parallel::chunks_mut(next, layer, &|k, plane| {
            let k = k.clamp(1, nz);
            let mut sums = Sums::new(width);
            for j in 1..=ny {
                let at = k * layer + j * width;
                let smooth = sums.row(now, at, width, layer);
                let (now, data) = (&now[at + 1..][..nx], &self.values[at + 1..][..nx]);
                for (((out, s), c), f) in plane[j * width + 1..][..nx].iter_mut().zip(smooth).zip(now).zip(data) {
                    *out = c + (f - s);
                }
            }
            close(plane, nx, ny);
        });
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

    /// `A c` along the row that starts (with its extra sample) at `at`.
    #[inline(always)]
    pub fn row(&mut self, c: &[f32], at: usize, width: usize, layer: usize) -> &[f32] {
        let row = |from: usize| &c[from..from + width];
        let (own, below, above) = (row(at), row(at - layer), row(at + layer));
        let (left, right) = (row(at - width), row(at + width));
        let corners =
            [row(at - layer - width), row(at - layer + width), row(at + layer - width), row(at + layer + width)];
        let (ends, middle) = (&mut self.ends[..width], &mut self.middle[..width]);
        for i in 0..width {
            let lateral = (left[i] + right[i]) + (below[i] + above[i]);
            let diagonal = (corners[0][i] + corners[1][i]) + (corners[2][i] + corners[3][i]);
            ends[i] = own[i] * (1.0 / 12.0) + lateral * (1.0 / 96.0);
            middle[i] = own[i] * (3.0 / 8.0) + lateral * (1.0 / 12.0) + diagonal * (1.0 / 96.0);
        }
        let n = width - 2;
        let smooth = &mut self.smooth[..n];
        let (before, middle, after) = (&ends[..n], &middle[1..][..n], &ends[2..][..n]);
        for i in 0..n {
            smooth[i] = middle[i] + (before[i] + after[i]);
        }
        smooth
    }
}

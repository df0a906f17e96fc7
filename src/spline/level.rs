//! One isovalue of a spline: which cubes its surface may pass through.
//!
//! Each coefficient of a cube is a weighted mean of the 27 samples around it, so a cube whose 27 are all on one side is left
//! out without looking at its coefficients. The signs of a row are bits of words, and 64 cubes are judged at a time.

use std::sync::Arc;

use super::Spline;
use crate::math::parallel;

/// Cubes along each side of a block.
pub(super) const BLOCK: usize = 8;

/// An isovalue of a spline, classified.
#[derive(Debug, Clone)]
pub struct Level<'a> {
    pub(super) spline: &'a Spline,
    pub(super) classes: Arc<Classes>,
}

/// What a classification found. It can be kept and [used again](Level::of) as long as the spline is the same.
#[derive(Debug)]
pub struct Classes {
    pub(super) iso: f64,
    words: usize,
    /// A bit for each cube that may hold the surface; rows of `words`.
    cubes: Vec<u64>,
    pub(super) blocks: [usize; 3],
    active: Vec<bool>,
}

/// Bits of a row's values that are at or above a limit.
#[inline(always)]
pub(super) fn signs(row: &[f32], limit: f32, out: &mut [u64]) {
    for (values, word) in row.chunks(64).zip(out) {
        let mut bits = 0;
        if let Ok(values) = <&[f32; 64]>::try_from(values) {
            for (i, eight) in values.as_chunks::<8>().0.iter().enumerate() {
                let mut byte = 0u32;
                for l in 0..8 {
                    byte |= u32::from(eight[l] >= limit) << l;
                }
                bits |= u64::from(byte) << (8 * i);
            }
        } else {
            for (l, v) in values.iter().enumerate() {
                bits |= u64::from(*v >= limit) << l;
            }
        }
        *word = bits;
    }
}

/// The smallest `f32` that is not below `v`: values are at or above either alike.
pub(super) fn limit(v: f64) -> f32 {
    let near = v as f32;
    if f64::from(near) < v { near.next_up() } else { near }
}

impl Classes {
    /// Looks at every sample once.
    pub fn new(spline: &Spline, iso: f64) -> Self {
        let c = &spline.coefficients;
        let [nx, ny, nz] = c.dims;
        let [_, width, layer] = c.strides();
        let at = limit(iso);
        let words = width.div_ceil(64);
        let mut above = vec![0; words * (ny + 2) * (nz + 2)];
        parallel::chunks_mut(&mut above, words * (ny + 2), &|k, rows| {
            for (j, out) in rows.chunks_exact_mut(words).enumerate() {
                signs(&c.values[k * layer + j * width..][..width], at, out);
            }
        });
        let blocks = c.dims.map(|n| n.div_ceil(BLOCK));
        let mut cubes = vec![0; words * ny * nz];
        parallel::chunks_mut(&mut cubes, words * ny, &|k, rows| {
            let (mut any, mut all) = (vec![0; words + 1], vec![0; words + 1]);
            for (j, out) in rows.chunks_exact_mut(words).enumerate() {
                for w in 0..words {
                    let (mut or, mut and) = (0, u64::MAX);
                    for dk in 0..3 {
                        for dj in 0..3 {
                            let bits = above[((k + dk) * (ny + 2) + j + dj) * words + w];
                            or |= bits;
                            and &= bits;
                        }
                    }
                    (any[w], all[w]) = (or, and);
                }
                for (w, out) in out.iter_mut().enumerate() {
                    let next = |v: &[u64], n: u32| v[w] >> n | v[w + 1] << (64 - n);
                    let mixed = (any[w] | next(&any, 1) | next(&any, 2)) & !(all[w] & next(&all, 1) & next(&all, 2));
                    let left = nx.saturating_sub(64 * w);
                    *out = if left >= 64 { mixed } else { mixed & ((1 << left) - 1) };
                }
            }
        });
        let active = parallel::map(blocks[2], &|bk| {
            let mut plane = vec![false; blocks[0] * blocks[1]];
            for k in bk * BLOCK..((bk + 1) * BLOCK).min(nz) {
                for j in 0..ny {
                    for i in 0..blocks[0] {
                        let byte = cubes[(k * ny + j) * words + i / 8] >> (8 * (i % 8)) & 255;
                        plane[j / BLOCK * blocks[0] + i] |= byte != 0;
                    }
                }
            }
            plane
        });
        Self { iso, words, cubes, blocks, active: active.concat() }
    }

    pub fn iso(&self) -> f64 {
        self.iso
    }
}

impl<'a> Level<'a> {
    /// Classifies an isovalue.
    pub fn new(spline: &'a Spline, iso: f64) -> Self {
        Self::of(spline, Arc::new(Classes::new(spline, iso)))
    }

    /// With what was found before, for the same spline.
    pub fn of(spline: &'a Spline, classes: Arc<Classes>) -> Self {
        debug_assert_eq!(classes.blocks, spline.dims().map(|n| n.div_ceil(BLOCK)));
        Self { spline, classes }
    }

    pub fn spline(&self) -> &'a Spline {
        self.spline
    }

    pub fn iso(&self) -> f64 {
        self.classes.iso
    }

    /// Whether the surface may pass through a cube.
    #[inline(always)]
    pub fn is_active(&self, [i, j, k]: [usize; 3]) -> bool {
        let Classes { words, cubes, .. } = &*self.classes;
        cubes[(k * self.spline.coefficients.dims[1] + j) * words + i / 64] >> (i % 64) & 1 == 1
    }

    #[inline(always)]
    pub(super) fn block_is_active(&self, [i, j, k]: [usize; 3]) -> bool {
        let Classes { blocks, active, .. } = &*self.classes;
        active[(k * blocks[1] + j) * blocks[0] + i]
    }

    /// Number of cubes that the surface may pass through.
    pub fn active_cubes(&self) -> usize {
        self.classes.cubes.iter().map(|w| w.count_ones() as usize).sum()
    }
}

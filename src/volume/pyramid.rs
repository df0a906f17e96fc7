//! Smallest and largest values of blocks of a volume, for skipping what is empty.
//!
//! A *cell* is the space between neighbouring texels, where trilinear interpolation mixes only its corners. A block of the
//! finest level holds 8 x 8 x 8 cells and therefore looks at 9 x 9 x 9 texels: neighbouring blocks share a layer, and the
//! interpolated value anywhere in the block lies between its bounds. Each further level joins 2 x 2 x 2 blocks.

use crate::math::parallel;

use super::Scalar;

/// Cells along each side of a block of the finest level.
pub const BLOCK: usize = 8;

/// Bounds of the blocks of one level, x fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Blocks along i, j, k.
    pub dims: [usize; 3],
    /// Smallest and largest stored value of each block.
    pub bounds: Vec<[f32; 2]>,
}

/// Bounds of a volume's blocks: `levels[0]` has blocks of [`BLOCK`] cells, each next level twice that, the last one block.
#[derive(Debug, Clone, PartialEq)]
pub struct Pyramid {
    pub levels: Vec<Level>,
}

impl Pyramid {
    /// Bounds of channel `channel` of texels with `channels` interleaved channels on a grid of `dims`. Values that do not
    /// compare (NaN) are left out; a block of nothing else has the bounds 0, 0.
    ///
    /// # Panics
    /// If the texels do not fill the grid or there is no such channel.
    pub fn build<T: Scalar>(dims: [usize; 3], texels: &[T], channels: usize, channel: usize) -> Self {
        assert!(channel < channels && texels.len() == dims.iter().product::<usize>() * channels);
        let blocks = dims.map(|n| (n.saturating_sub(1)).div_ceil(BLOCK).max(1));
        let layers_of_blocks = parallel::map(blocks[2], &|bz| {
            let mut plane: Vec<Option<(T, T)>> = vec![None; blocks[0] * blocks[1]];
            for z in layers(bz, dims[2]) {
                for y in 0..dims[1] {
                    let start = (z * dims[1] + y) * dims[0] * channels;
                    let row = &texels[start..start + dims[0] * channels];
                    // a layer between two blocks belongs to both
                    let last = (y / BLOCK).min(blocks[1] - 1);
                    let first = if y % BLOCK == 0 { last.min((y / BLOCK).saturating_sub(1)) } else { last };
                    for bx in 0..blocks[0] {
                        let span = layers(bx, dims[0]);
                        let texels = &row[span.start * channels..span.end * channels];
                        let Some(bounds) = bounds_of(texels, channels, channel) else { continue };
                        for by in first..=last {
                            let at = &mut plane[by * blocks[0] + bx];
                            *at = Some(at.map_or(bounds, |b| join(b, bounds)));
                        }
                    }
                }
            }
            let bounds = plane.into_iter().map(|b| b.map_or([0.0; 2], |(lo, hi)| [lo.to_f32(), hi.to_f32()]));
            bounds.collect::<Vec<_>>()
        });
        let mut levels = vec![Level { dims: blocks, bounds: layers_of_blocks.concat() }];
        while let Some(coarser) = levels.last().and_then(Level::coarser) {
            levels.push(coarser);
        }
        Self { levels }
    }

    /// Bounds of the whole volume.
    pub fn bounds(&self) -> [f32; 2] {
        self.levels.last().map_or([0.0; 2], |top| top.bounds[0])
    }
}

impl Level {
    /// The next level, `None` after a single block.
    fn coarser(&self) -> Option<Self> {
        if self.dims == [1; 3] {
            return None;
        }
        let dims = self.dims.map(|n| n.div_ceil(2));
        let mut bounds = Vec::with_capacity(dims.iter().product());
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                for x in 0..dims[0] {
                    let mut b = [f32::INFINITY, f32::NEG_INFINITY];
                    for k in 2 * z..(2 * z + 2).min(self.dims[2]) {
                        for j in 2 * y..(2 * y + 2).min(self.dims[1]) {
                            for i in 2 * x..(2 * x + 2).min(self.dims[0]) {
                                let c = self.bounds[(k * self.dims[1] + j) * self.dims[0] + i];
                                b = [b[0].min(c[0]), b[1].max(c[1])];
                            }
                        }
                    }
                    bounds.push(b);
                }
            }
        }
        Some(Self { dims, bounds })
    }
}

/// Texels that the cells of block `b` touch along an axis of `n` texels.
fn layers(b: usize, n: usize) -> std::ops::Range<usize> {
    b * BLOCK..(b * BLOCK + BLOCK + 1).min(n)
}

fn join<T: Scalar>(a: (T, T), b: (T, T)) -> (T, T) {
    (if b.0 < a.0 { b.0 } else { a.0 }, if b.1 > a.1 { b.1 } else { a.1 })
}

fn bounds_of<T: Scalar>(row: &[T], channels: usize, channel: usize) -> Option<(T, T)> {
    let comparable = |v: &&T| v.partial_cmp(v).is_some();
    // what does not compare is neither below nor above
    let widen = |b: (T, T), v: &T| join(b, (*v, *v));
    if channels == 1 {
        let first = *row.iter().find(comparable)?;
        return Some(row.iter().fold((first, first), widen));
    }
    let values = || row.iter().skip(channel).step_by(channels);
    let first = *values().find(comparable)?;
    Some(values().fold((first, first), widen))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hashed(n: usize) -> Vec<u8> {
        (0..n as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect()
    }

    #[test]
    fn blocks_bound_every_cell_they_hold() {
        for dims in [[1, 1, 1], [2, 3, 1], [8, 9, 10], [17, 25, 33], [40, 16, 9]] {
            let texels = hashed(dims[0] * dims[1] * dims[2]);
            let p = Pyramid::build(dims, &texels, 1, 0);
            let at = |x: usize, y: usize, z: usize| f32::from(texels[(z * dims[1] + y) * dims[0] + x]);
            for (l, level) in p.levels.iter().enumerate() {
                let side = BLOCK << l;
                for (i, b) in level.bounds.iter().enumerate() {
                    let c = [i % level.dims[0], i / level.dims[0] % level.dims[1], i / level.dims[0] / level.dims[1]];
                    let mut want = [f32::INFINITY, f32::NEG_INFINITY];
                    for z in c[2] * side..(c[2] * side + side + 1).min(dims[2]) {
                        for y in c[1] * side..(c[1] * side + side + 1).min(dims[1]) {
                            for x in c[0] * side..(c[0] * side + side + 1).min(dims[0]) {
                                want = [want[0].min(at(x, y, z)), want[1].max(at(x, y, z))];
                            }
                        }
                    }
                    assert_eq!(*b, want, "dims {dims:?} level {l} block {c:?}");
                }
            }
            assert_eq!(p.levels.last().unwrap().dims, [1; 3]);
        }
    }

    #[test]
    fn one_channel_of_many_without_nan() {
        let texels = [0.0f32, 5.0, 1.0, f32::NAN, 2.0, -3.0];
        assert_eq!(Pyramid::build([3, 1, 1], &texels, 2, 1).bounds(), [-3.0, 5.0]);
        assert_eq!(Pyramid::build([1, 1, 1], &[f64::NAN], 1, 0).bounds(), [0.0, 0.0]);
    }
}

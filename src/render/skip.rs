//! Which parts of a field a picture can leave out, from the bounds of its blocks.

use super::{ClassTable, Field, Frame, TexelSlice};
use crate::volume::pyramid::BLOCK;

/// For each block of each level of the pyramid: whether anything in it can be seen.
pub struct Skip {
    levels: Vec<([usize; 3], Vec<bool>)>,
    /// No block can be left out.
    pub full: bool,
}

impl Skip {
    pub fn new(field: &Field, table: &ClassTable, frame: &Frame) -> Self {
        let unit = match field.texels.slice() {
            TexelSlice::U8(_) => 255.0,
            TexelSlice::U16(_) => 65535.0,
            TexelSlice::F32(_) => 1.0,
        };
        let [scale, bias, iso, _] = frame.window;
        let seen = |[lo, hi]: [f32; 2]| {
            let (a, b) = (lo / unit * scale + bias, hi / unit * scale + bias);
            // interpolation rounds
            let (lo, hi) = (a.min(b) - 1e-5, a.max(b) + 1e-5);
            match frame.size[2] {
                Frame::VOLUME => table.is_visible(lo, hi),
                Frame::ISO => hi >= iso,
                _ => true,
            }
        };
        let finest = &field.pyramid.levels[0];
        let mut levels = vec![(finest.dims, finest.bounds.iter().map(|b| seen(*b)).collect::<Vec<bool>>())];
        // joined from the finest level: bounds of coarser ones are wider than what their blocks hold
        for level in &field.pyramid.levels[1..] {
            let (below, flags) = &levels[levels.len() - 1];
            let mut joined = vec![false; level.bounds.len()];
            for (i, seen) in flags.iter().enumerate() {
                let (x, y, z) = (i % below[0], i / below[0] % below[1], i / below[0] / below[1]);
                joined[((z / 2) * level.dims[1] + y / 2) * level.dims[0] + x / 2] |= seen;
            }
            levels.push((level.dims, joined));
        }
        let full = levels[0].1.iter().all(|seen| *seen);
        Self { levels, full }
    }

    #[inline]
    fn blocks(&self, v: [f32; 3]) -> [usize; 3] {
        let dims = &self.levels[0].0;
        let block = |axis: usize| (v[axis] as i32 as usize / BLOCK).min(dims[axis] - 1);
        [block(0), block(1), block(2)]
    }

    /// Whether no block between the texel coordinates `lo` and `hi` can be left out (true only if it is certain): then it
    /// is no use to look at parts of that box.
    pub fn is_full(&self, lo: [f32; 3], hi: [f32; 3]) -> bool {
        let (dims, flags) = &self.levels[0];
        let (lo, hi) = (self.blocks(lo), self.blocks(hi));
        // blocks of a larger box take longer to look at than they save
        (0..3).all(|axis| hi[axis] < lo[axis] + 4)
            && (lo[2]..=hi[2]).all(|z| {
                (lo[1]..=hi[1]).all(|y| {
                    let row = (z * dims[1] + y) * dims[0];
                    flags[row + lo[0]..=row + hi[0]].iter().all(|seen| *seen)
                })
            })
    }

    /// Whether nothing between the texel coordinates `lo` and `hi` can be seen (true only if it is certain).
    pub fn is_empty(&self, lo: [f32; 3], hi: [f32; 3]) -> bool {
        if self.full {
            return false;
        }
        let (lo, hi) = (self.blocks(lo), self.blocks(hi));
        let width = |axis: usize| hi[axis].saturating_sub(lo[axis]);
        let widest = width(0).max(width(1)).max(width(2));
        // the finest level at which the box touches at most 2 blocks along each axis, and one finer
        let coarse = ((usize::BITS - widest.saturating_sub(1).leading_zeros()) as usize).min(self.levels.len() - 1);
        self.is_empty_at(coarse, lo, hi) || (coarse > 0 && self.is_empty_at(coarse - 1, lo, hi))
    }

    fn is_empty_at(&self, level: usize, lo: [usize; 3], hi: [usize; 3]) -> bool {
        let (dims, flags) = &self.levels[level];
        let up = |v: [usize; 3]| [v[0] >> level, v[1] >> level, v[2] >> level];
        let (lo, hi) = (up(lo), up(hi));
        for z in lo[2]..=hi[2] {
            for y in lo[1]..=hi[1] {
                let row = (z * dims[1] + y) * dims[0];
                if flags[row + lo[0]..=row + hi[0]].contains(&true) {
                    return false;
                }
            }
        }
        true
    }
}

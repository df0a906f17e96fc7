//! Which parts of the volume can be seen at all.
//!
//! A software adapter draws some 50 million lit fragments a second, and most fragments of most volumes are air. The bounds of
//! the field's blocks and the transfer function tell which; a fragment in such a block is left out after one look at a
//! small texture. The value behind a fragment counts too: bounds are widened by the blocks that it can lie in.

use crate::render::{ClassTable, Field, Frame, TexelSlice};
use crate::volume::pyramid::{BLOCK, Level};

/// How far the next slice may lie away, in blocks, for the test to be worth its while.
const FAR: usize = 2;

/// For each block of the finest level of the field's pyramid, 1 if something in it can be seen and 0 if not; `None` if
/// nothing can be left out.
pub fn occupancy(field: &Field, table: &ClassTable, frame: &Frame, reach: [usize; 3]) -> Option<Vec<u8>> {
    let level = field.pyramid.levels.first()?;
    if frame.size[2] == Frame::MIP || reach.iter().any(|&r| r > FAR) {
        return None;
    }
    let one = match field.texels.slice() {
        TexelSlice::U8(_) => 255.0,
        TexelSlice::U16(_) => 65535.0,
        TexelSlice::F32(_) => 1.0,
    };
    let value = |v: f32| (v / one * frame.window[0] + frame.window[1]).clamp(0.0, 1.0);
    let bounds: Vec<[f32; 2]> = level
        .bounds
        .iter()
        .map(|b| {
            let (a, b) = (value(b[0]), value(b[1]));
            [a.min(b), a.max(b)]
        })
        .collect();
    let seen = |[lo, hi]: [f32; 2]| match frame.size[2] {
        // half a step of an 8-bit texture filter
        Frame::ISO => hi + 1.0 / 512.0 >= frame.window[2],
        _ => table.is_visible(lo, hi),
    };
    Some(widened(level, bounds, reach).into_iter().map(|b| u8::from(seen(b))).collect())
}

/// Bounds of each block joined with those up to `reach` blocks away.
fn widened(level: &Level, mut bounds: Vec<[f32; 2]>, reach: [usize; 3]) -> Vec<[f32; 2]> {
    let mut stride = 1;
    for (axis, &r) in reach.iter().enumerate() {
        let n = level.dims[axis];
        if r > 0 {
            bounds = (0..bounds.len())
                .map(|i| {
                    let at = i / stride % n;
                    (at.saturating_sub(r)..=(at + r).min(n - 1)).fold([f32::INFINITY, f32::NEG_INFINITY], |b, k| {
                        let c = bounds[i - at * stride + k * stride];
                        [b[0].min(c[0]), b[1].max(c[1])]
                    })
                })
                .collect();
        }
        stride *= n;
    }
    bounds
}

/// Blocks between a fragment and the point behind it, at most, along each axis; `far` in texture units.
pub fn reach(far: [f32; 3], dims: [usize; 3]) -> [usize; 3] {
    std::array::from_fn(|i| (f64::from(far[i]) * dims[i] as f64 / BLOCK as f64).ceil() as usize)
}

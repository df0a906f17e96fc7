//! Whether anything can be seen in a part of a volume.

use crate::render::{ClassTable, Field, Frame, SliceVertex, TexelSlice};
use crate::volume::pyramid::{BLOCK, Pyramid};

/// What decides whether values can be seen.
#[derive(Debug, Clone, Copy)]
pub struct Visibility<'a> {
    pyramid: &'a Pyramid,
    dims: [f32; 3],
    /// Scale and bias from stored values to window values.
    window: [f32; 2],
    seen: Seen<'a>,
}

#[derive(Debug, Clone, Copy)]
enum Seen<'a> {
    Table(&'a ClassTable),
    Above(f32),
}

impl<'a> Visibility<'a> {
    /// `None` where everything drawn counts, as with the maximum.
    pub fn new(field: &'a Field, table: &'a ClassTable, frame: &Frame) -> Option<Self> {
        let seen = match frame.size[2] {
            Frame::VOLUME => Seen::Table(table),
            Frame::ISO => Seen::Above(frame.window[2]),
            _ => return None,
        };
        let one = match field.texels.slice() {
            TexelSlice::U8(_) => 255.0,
            TexelSlice::U16(_) => 65535.0,
            TexelSlice::F32(_) => 1.0,
        };
        let [scale, bias, ..] = frame.window;
        let dims = field.grid.dims.map(|n| n as f32);
        Some(Self { pyramid: &field.pyramid, dims, window: [scale / one, bias], seen })
    }

    /// Voxels along i, j, k.
    pub fn dims(&self) -> [f32; 3] {
        self.dims
    }

    /// The longest side of the volume in voxels.
    pub fn largest(&self) -> f32 {
        self.dims.into_iter().fold(1.0, f32::max)
    }

    /// Extent of a triangle in voxels, in front or behind, and whether anything in it can be seen. The way from front to back
    /// does not count: no split makes it shorter.
    pub fn look(&self, corners: [&SliceVertex; 3]) -> (f32, bool) {
        let mut lo = [f32::INFINITY; 3];
        let mut hi = [f32::NEG_INFINITY; 3];
        let mut outside = false;
        let mut size = 0.0f32;
        for i in 0..3 {
            let bounds = |at: [f32; 3]| {
                at.into_iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)])
            };
            let (front, back) = (bounds(corners.map(|c| c.front[i])), bounds(corners.map(|c| c.back[i])));
            outside |= front[1] < 0.0 || front[0] > 1.0;
            size = size.max((front[1] - front[0]) * self.dims[i]).max((back[1] - back[0]) * self.dims[i]);
            lo[i] = front[0].min(back[0]) * self.dims[i] - 0.5;
            hi[i] = front[1].max(back[1]) * self.dims[i] - 0.5;
        }
        // NaN coordinates are not drawn, and compare as neither
        if outside || !size.is_finite() {
            return (0.0, false);
        }
        (size, self.between(lo, hi))
    }

    /// Whether the values between two points in voxel coordinates can be seen.
    pub fn between(&self, lo: [f32; 3], hi: [f32; 3]) -> bool {
        let extent = (0..3).fold(0.0f32, |e, i| e.max(hi[i] - lo[i]));
        if !extent.is_finite() {
            return false;
        }
        // the level whose blocks are half the extent or more: at most three along each axis
        let mut level = 0;
        while level + 1 < self.pyramid.levels.len() && extent > 2.0 * (BLOCK << level) as f32 {
            level += 1;
        }
        let blocks = &self.pyramid.levels[level];
        let side = 1.0 / (BLOCK << level) as f32;
        // beyond the edge the edge's value continues; `as` saturates
        let first: [usize; 3] = std::array::from_fn(|i| ((lo[i] * side) as usize).min(blocks.dims[i] - 1));
        let last: [usize; 3] = std::array::from_fn(|i| ((hi[i] * side) as usize).min(blocks.dims[i] - 1));
        let mut bounds = [f32::INFINITY, f32::NEG_INFINITY];
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                let row = (z * blocks.dims[1] + y) * blocks.dims[0];
                for b in &blocks.bounds[row + first[0]..=row + last[0]] {
                    bounds = [bounds[0].min(b[0]), bounds[1].max(b[1])];
                }
            }
        }
        let [a, b] = bounds.map(|v| (v * self.window[0] + self.window[1]).clamp(0.0, 1.0));
        let (least, most) = (a.min(b), a.max(b));
        match self.seen {
            Seen::Table(table) => table.is_visible(least, most),
            // a texture filter may round up by half a step of 8 bits
            Seen::Above(iso) => most + 1.0 / 512.0 >= iso,
        }
    }
}

//! Slices without the parts in which nothing can be seen.
//!
//! # Theory
//!
//! Most of most volumes is air. The texture coordinates of a triangle's fragments lie in the box around those of its
//! corners, for the front as for the back, so the bounds of the field's blocks that the box touches bound every value pair in
//! the triangle; the transfer function tells whether any of these can be seen. A triangle that can be seen only in part is
//! split 1 -> 4 down to a few blocks. New corners are means of old ones, so the picture stays the same up to rounding.
//!
//! # Practice
//!
//! The test is made here and not per fragment, because a software adapter runs both sides of a branch: a fragment costs
//! the same there whether it is discarded first or last. Where all four parts stay, the triangle stays whole.

use rayon::prelude::*;

use crate::render::{ClassTable, Field, Frame, SliceGeometry, SliceVertex, TexelSlice};
use crate::volume::pyramid::{BLOCK, Pyramid};

/// Triangles below this extent, in voxels, are not split further: twice a block, since a triangle that is much smaller
/// costs more to set up than its fragments.
const LEAF: f32 = 2.0 * BLOCK as f32;

/// Triangles that can be seen: corners to append to the geometry's own, and all indices with the range of each slice.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Culled {
    pub added: Vec<SliceVertex>,
    pub indices: Vec<u32>,
    pub slices: Vec<std::ops::Range<u32>>,
}

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

    /// Extent of a triangle in voxels, and whether anything in it can be seen.
    fn look(&self, corners: [&SliceVertex; 3]) -> (f32, bool) {
        let mut lo = [f32::INFINITY; 3];
        let mut hi = [f32::NEG_INFINITY; 3];
        let mut outside = false;
        for i in 0..3 {
            for c in corners {
                lo[i] = lo[i].min(c.front[i]);
                hi[i] = hi[i].max(c.front[i]);
            }
            outside |= hi[i] < 0.0 || lo[i] > 1.0;
            for c in corners {
                lo[i] = lo[i].min(c.back[i]);
                hi[i] = hi[i].max(c.back[i]);
            }
            lo[i] = lo[i] * self.dims[i] - 0.5;
            hi[i] = hi[i] * self.dims[i] - 0.5;
        }
        let extent = (0..3).fold(0.0f32, |e, i| e.max(hi[i] - lo[i]));
        // NaN coordinates are not drawn, and compare as neither
        if outside || !extent.is_finite() {
            return (0.0, false);
        }
        (extent, self.visible(lo, hi, extent))
    }

    /// Whether the values between two points in voxel coordinates can be seen.
    fn visible(&self, lo: [f32; 3], hi: [f32; 3], extent: f32) -> bool {
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

/// How much of a triangle stayed.
#[derive(PartialEq)]
enum Stayed {
    Nothing,
    Part,
    Whole,
}

/// One slice on its way.
struct Splitter<'a> {
    visibility: Visibility<'a>,
    given: &'a [SliceVertex],
    added: Vec<SliceVertex>,
    indices: Vec<u32>,
}

impl Splitter<'_> {
    fn vertex(&self, i: u32) -> &SliceVertex {
        let i = i as usize;
        self.given.get(i).unwrap_or_else(|| &self.added[i - self.given.len()])
    }

    /// Emits what stays of a triangle.
    fn triangle(&mut self, t: [u32; 3]) -> Stayed {
        let (extent, visible) = self.visibility.look(t.map(|i| self.vertex(i)));
        if !visible {
            return Stayed::Nothing;
        }
        if extent <= LEAF {
            self.indices.extend(t);
            return Stayed::Whole;
        }
        let before = (self.added.len(), self.indices.len());
        let [a, b, c] = t;
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[p, q]| self.between(p, q));
        let parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]].map(|part| self.triangle(part));
        if parts.iter().all(|p| *p == Stayed::Nothing) {
            self.added.truncate(before.0);
            return Stayed::Nothing;
        }
        if parts.iter().all(|p| *p == Stayed::Whole) {
            self.added.truncate(before.0);
            self.indices.truncate(before.1);
            self.indices.extend(t);
            return Stayed::Whole;
        }
        Stayed::Part
    }

    fn between(&mut self, p: u32, q: u32) -> u32 {
        let mut v = *self.vertex(p);
        let w: [f32; 18] = bytemuck::cast(*self.vertex(q));
        let mean: &mut [f32; 18] = bytemuck::cast_mut(&mut v);
        mean.iter_mut().zip(w).for_each(|(a, b)| *a = 0.5 * (*a + b));
        self.added.push(v);
        (self.given.len() + self.added.len() - 1) as u32
    }
}

/// The triangles of the geometry that can be seen, slices in parallel.
pub fn cull(geometry: &SliceGeometry, visibility: Visibility<'_>) -> Culled {
    let given = geometry.vertices.len() as u32;
    let parts: Vec<(Vec<SliceVertex>, Vec<u32>)> = geometry
        .slices
        .par_iter()
        .map(|slice| {
            let mut s = Splitter { visibility, given: &geometry.vertices, added: Vec::new(), indices: Vec::new() };
            for t in geometry.indices[slice.start as usize..slice.end as usize].as_chunks::<3>().0 {
                s.triangle(*t);
            }
            (s.added, s.indices)
        })
        .collect();
    let mut culled = Culled::default();
    for (added, indices) in parts {
        let shift = culled.added.len() as u32;
        let start = culled.indices.len() as u32;
        culled.indices.extend(indices.into_iter().map(|i| if i < given { i } else { i + shift }));
        culled.slices.push(start..culled.indices.len() as u32);
        culled.added.extend(added);
    }
    culled
}

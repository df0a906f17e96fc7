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

    /// The longest side of the volume in voxels.
    fn largest(&self) -> f32 {
        self.dims.into_iter().fold(1.0, f32::max)
    }

    /// Extent of a triangle in voxels, in front or behind, and whether anything in it can be seen. The way from front to back
    /// does not count: no split makes it shorter.
    fn look(&self, corners: [&SliceVertex; 3]) -> (f32, bool) {
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
        let extent = (0..3).fold(0.0f32, |e, i| e.max(hi[i] - lo[i]));
        // NaN coordinates are not drawn, and compare as neither
        if outside || !extent.is_finite() {
            return (0.0, false);
        }
        (size, self.visible(lo, hi, extent))
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
        // far beyond the volume coordinates are not those of slices, and splitting might not end
        if extent <= LEAF || extent > 4.0 * self.visibility.largest() {
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec3;

    use super::*;
    use crate::render::{Camera, Look, Projection, Shading};
    use crate::volume::transfer::{ControlPoint, TransferFunction, Window};
    use crate::volume::{Grid, Samples, Volume};

    const N: usize = 64;
    const RADIUS: f64 = 9.0;

    /// A ball of 200 off the middle of 64^3 voxels of 10.
    fn ball() -> Field {
        let inside = |i: usize| {
            let p = DVec3::new((i % N) as f64, (i / N % N) as f64, (i / N / N) as f64);
            p.distance(DVec3::new(20.0, 30.0, 40.0)) <= RADIUS
        };
        let samples = Samples::U8((0..N * N * N).map(|i| if inside(i) { 200 } else { 10 }).collect());
        let grid = Grid::aligned([N; 3], DVec3::ONE, DVec3::ZERO).unwrap();
        Field::from_volume(Arc::new(Volume::new(grid, 1, samples)))
    }

    fn table() -> ClassTable {
        let point = |at, opacity| ControlPoint { at, color: [1.0; 3], opacity };
        let points = vec![point(0.0, 0.0), point(0.3, 0.0), point(0.5, 0.4)];
        ClassTable::build(
            &TransferFunction { name: "ball".into(), window: Window::Auto, points, regions: vec![] },
            1.0,
            true,
        )
    }

    /// Slices across y, each of two triangles, as texture coordinates (x, z).
    fn slices() -> SliceGeometry {
        let mut g = SliceGeometry { distance: 1.0, ..SliceGeometry::default() };
        for k in 0..N {
            let y = (k as f32 + 0.5) / N as f32;
            let first = g.vertices.len() as u32;
            for (x, z) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                let (front, back) = ([x, y, z], [x, y + 1.0 / N as f32, z]);
                g.vertices.push(SliceVertex { position: front, front, back, jacobian: [0.0; 9] });
            }
            g.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
            g.slices.push(6 * k as u32..6 * (k as u32 + 1));
        }
        g
    }

    fn frame(field: &Field, g: &SliceGeometry, shading: Shading) -> Frame {
        let camera = Camera {
            target: field.grid.center(),
            yaw: 0.0,
            pitch: 0.0,
            roll: 0.0,
            radius: 60.0,
            zoom: 1.0,
            projection: Projection::Orthographic,
        };
        Frame::new(&camera, &Look { shading, ..Look::default() }, field, [0.0, 255.0], g, 8, 8)
    }

    fn holds(t: [[f32; 3]; 3], x: f32, z: f32) -> bool {
        let side = |a: [f32; 3], b: [f32; 3]| (b[0] - a[0]) * (z - a[2]) - (b[2] - a[2]) * (x - a[0]) > 0.0;
        let s = [side(t[0], t[1]), side(t[1], t[2]), side(t[2], t[0])];
        s == [true; 3] || s == [false; 3]
    }

    #[test]
    fn what_can_be_seen_is_drawn_once_and_air_is_not() {
        let (field, table, g) = (ball(), table(), slices());
        for shading in [Shading::Volume, Shading::Iso { value: 100.0, color: [1.0; 3] }] {
            let frame = frame(&field, &g, shading);
            let culled = cull(&g, Visibility::new(&field, &table, &frame).unwrap());
            assert_eq!(culled.slices.len(), g.slices.len());
            let front = |i: u32| g.vertices.get(i as usize).unwrap_or_else(|| &culled.added[i as usize - 4 * N]).front;
            let mut drawn = 0;
            for (k, slice) in culled.slices.iter().enumerate() {
                let triangles: Vec<_> = culled.indices[slice.start as usize..slice.end as usize]
                    .as_chunks::<3>()
                    .0
                    .iter()
                    .map(|t| t.map(front))
                    .collect();
                for at in 0..50 * 50 {
                    // off every edge that splitting makes
                    let [i, j] = [at % 50, at / 50].map(|i| (i as f32 + 0.317) / 50.0);
                    let (x, z) = (i, j + 0.000_71);
                    let times = triangles.iter().filter(|t| holds(**t, x, z)).count();
                    let p = DVec3::new(f64::from(x), (k as f64 + 0.5) / N as f64, f64::from(z)) * N as f64 - 0.5;
                    // the value behind counts too
                    let near = p.distance(DVec3::new(20.0, 30.0, 40.0)) < RADIUS - 1.0;
                    assert!(times <= 1 && (times == 1 || !near), "slice {k} at {x} {z}: {times} times");
                    drawn += times;
                }
            }
            let share = drawn as f64 / (2500 * N) as f64;
            // the ball fills 1.2 % of the box; leaves of 16 voxels that touch a block of it fill 48 x 25 x 64 of 64^3 at most
            assert!((0.012..0.29).contains(&share), "{share}");
        }
    }

    #[test]
    fn nothing_is_split_in_vain() {
        let (field, g) = (ball(), slices());
        let point = |at| ControlPoint { at, color: [1.0; 3], opacity: 0.5 };
        let all =
            TransferFunction { name: "all".into(), window: Window::Auto, points: vec![point(0.0)], regions: vec![] };
        let table = ClassTable::build(&all, 1.0, true);
        let culled = cull(&g, Visibility::new(&field, &table, &frame(&field, &g, Shading::Volume)).unwrap());
        assert_eq!(culled, Culled { added: Vec::new(), indices: g.indices.clone(), slices: g.slices.clone() });
        assert!(Visibility::new(&field, &table, &frame(&field, &g, Shading::Mip)).is_none());
    }

    #[test]
    fn slices_far_apart_are_split_as_little_as_others() {
        let (field, table) = (ball(), table());
        let mut g = slices();
        let near = cull(&g, Visibility::new(&field, &table, &frame(&field, &g, Shading::Volume)).unwrap());
        // a leaf and a half from slice to slice
        g.vertices.iter_mut().for_each(|v| v.back[1] = v.front[1] + 1.5 * LEAF / N as f32);
        let far = cull(&g, Visibility::new(&field, &table, &frame(&field, &g, Shading::Volume)).unwrap());
        assert!(!far.indices.is_empty() && far.indices.len() < 10 * near.indices.len());
    }

    #[test]
    fn odd_coordinates_do_no_harm() {
        let (field, table) = (ball(), table());
        let mut g = slices();
        for (v, odd) in g.vertices.iter_mut().zip([f32::NAN, f32::INFINITY, -1e30, 5.0, -3.0].into_iter().cycle()) {
            v.front[0] = odd;
        }
        let culled = cull(&g, Visibility::new(&field, &table, &frame(&field, &g, Shading::Volume)).unwrap());
        assert!(culled.indices.iter().all(|i| (*i as usize) < g.vertices.len() + culled.added.len()));
    }
}

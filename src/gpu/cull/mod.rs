//! Slices without the parts in which nothing can be seen.
//!
//! # Theory
//!
//! Most of most volumes is air. The texture coordinates of a triangle's fragments lie in the box around those of its
//! corners, for the front as for the back, so the bounds of the field's blocks that the box touches bound every value pair in
//! the triangle; the transfer function tells whether any of these can be seen. The same holds for any part of a slice.
//!
//! # Practice
//!
//! Where nothing displaces a slice, everything about its points is linear in the pixel (`plane`), however its triangles lie.
//! So cells of the picture are tested instead of triangles, and what can be seen is drawn as few rectangles (`rectangles`);
//! at the slice's rim its triangles are clipped to them. Edges of cells lie between pixels, so that rounding leaves no gaps
//! where the corner of one lies on the edge of another, and between the blocks of pixels that devices shade at once.
//!
//! A displaced triangle that can be seen only in part is split 1 -> 4 down to a few blocks (`split`). New corners are means of
//! old ones, so the picture stays the same up to rounding. Where all four parts stay, the triangle stays whole.
//!
//! The tests are made here and not per fragment, because a software adapter runs both sides of a branch: a fragment costs
//! the same there whether it is discarded first or last.

mod cells;
mod plane;
mod rectangles;
mod split;
mod visibility;

use rayon::prelude::*;

use crate::render::{ClassTable, Field, Frame, SliceGeometry, SliceVertex};
use plane::{Plane, View};
use split::Splitter;
use visibility::Visibility;

/// Triangles that can be seen: corners to append to the geometry's own, and all indices with the range of each slice.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Culled {
    pub added: Vec<SliceVertex>,
    pub indices: Vec<u32>,
    pub slices: Vec<std::ops::Range<u32>>,
}

/// The triangles of the geometry that can be seen, slices in parallel. `None` where everything drawn counts, as with the maximum.
pub fn cull(geometry: &SliceGeometry, field: &Field, table: &ClassTable, frame: &Frame) -> Option<Culled> {
    let visibility = Visibility::new(field, table, frame)?;
    let given = geometry.vertices.len() as u32;
    let view = View::new(frame, field);
    let parts: Vec<(Vec<SliceVertex>, Vec<u32>)> = geometry
        .slices
        .par_iter()
        .map(|slice| {
            let mut s = Splitter { visibility, given: &geometry.vertices, added: Vec::new(), indices: Vec::new() };
            let triangles = geometry.indices[slice.start as usize..slice.end as usize].as_chunks::<3>().0;
            for t in still(&mut s, &view, triangles) {
                s.triangle(t);
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
    Some(culled)
}

/// Emits what can be seen of the triangles that nothing displaces, and returns the others.
fn still(s: &mut Splitter<'_>, view: &View, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let vertex = |i: u32| &s.given[i as usize];
    let (still, mut others): (Vec<_>, Vec<_>) =
        triangles.iter().partition(|t| t.iter().all(|i| view.is_still(vertex(*i))));
    let vertices: Vec<_> = still.iter().flatten().map(|i: &u32| vertex(*i)).collect();
    let Some((plane, pixels)) = Plane::through(view, &s.visibility, &vertices) else {
        others.extend(still);
        return others;
    };
    let Some(drawn) = cells::draw(view, &s.visibility, &plane, pixels.as_chunks::<3>().0) else {
        s.indices.extend(still.into_iter().flatten());
        return others;
    };
    s.indices.extend(drawn.kept.into_iter().flat_map(|i| still[i]));
    let first = (s.given.len() + s.added.len()) as u32;
    s.indices.extend((0..3 * drawn.triangles.len() as u32).map(|i| first + i));
    s.added.extend(drawn.triangles.into_iter().flatten());
    others
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

    /// Slices across y, each of two triangles. Those that lie still are drawn by cells of the picture, others are split.
    fn slices(still: bool) -> SliceGeometry {
        let middle = DVec3::splat(0.5 * N as f64 - 0.5);
        let mut g = SliceGeometry { distance: 1.0, center: middle, ..SliceGeometry::default() };
        let mut jacobian = [0.0; 9];
        if still {
            [0, 4, 8].into_iter().for_each(|i| jacobian[i] = 1.0 / N as f32);
        }
        for k in 0..N {
            let y = (k as f32 + 0.5) / N as f32;
            let first = g.vertices.len() as u32;
            for (x, z) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                let (front, back) = ([x, y, z], [x, y + 1.0 / N as f32, z]);
                let position = front.map(|x| (x - 0.5) * N as f32);
                g.vertices.push(SliceVertex { position, front, back, jacobian });
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
        Frame::new(&camera, &Look { shading, ..Look::default() }, field, [0.0, 255.0], g, 200, 180)
    }

    fn holds(t: [[f32; 3]; 3], x: f32, z: f32) -> bool {
        let side = |a: [f32; 3], b: [f32; 3]| (b[0] - a[0]) * (z - a[2]) - (b[2] - a[2]) * (x - a[0]) > 0.0;
        let s = [side(t[0], t[1]), side(t[1], t[2]), side(t[2], t[0])];
        s == [true; 3] || s == [false; 3]
    }

    /// What is left of slices, and the front coordinate of each of its vertices.
    fn culled(g: &SliceGeometry, field: &Field, table: &ClassTable, shading: Shading) -> (Culled, Vec<[f32; 3]>) {
        let frame = frame(field, g, shading);
        let culled = cull(g, field, table, &frame).unwrap();
        let fronts = g.vertices.iter().chain(&culled.added).map(|v| v.front).collect();
        (culled, fronts)
    }

    #[test]
    fn what_can_be_seen_is_drawn_once_and_air_is_not() {
        let (field, table) = (ball(), table());
        let shadings = [Shading::Volume, Shading::Iso { value: 100.0, color: [1.0; 3] }];
        for (still, shading) in [true, false].into_iter().flat_map(|s| shadings.map(|shading| (s, shading))) {
            let g = slices(still);
            let (culled, fronts) = culled(&g, &field, &table, shading);
            assert_eq!(culled.slices.len(), g.slices.len());
            let mut drawn = 0;
            for (k, slice) in culled.slices.iter().enumerate() {
                let triangles: Vec<_> = culled.indices[slice.start as usize..slice.end as usize]
                    .as_chunks::<3>()
                    .0
                    .iter()
                    .map(|t| t.map(|i| fronts[i as usize]))
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
            // the ball fills 1.2 % of the box; leaves of 16 voxels that touch a block of it fill 48 x 25 x 64 of 64^3 at most,
            // cells of 16 pixels, 11 voxels, 32 x 25 x 32
            assert!((0.012..if still { 0.13 } else { 0.29 }).contains(&share), "{share}");
        }
    }

    #[test]
    fn nothing_is_split_in_vain() {
        let field = ball();
        let point = |at| ControlPoint { at, color: [1.0; 3], opacity: 0.5 };
        let all =
            TransferFunction { name: "all".into(), window: Window::Auto, points: vec![point(0.0)], regions: vec![] };
        let table = ClassTable::build(&all, 1.0, true);
        for g in [true, false].map(slices) {
            let left = culled(&g, &field, &table, Shading::Volume).0;
            assert_eq!(left, Culled { added: Vec::new(), indices: g.indices.clone(), slices: g.slices.clone() });
            assert!(cull(&g, &field, &table, &frame(&field, &g, Shading::Mip)).is_none());
        }
    }

    #[test]
    fn slices_far_apart_are_split_as_little_as_others() {
        let (field, table) = (ball(), table());
        for mut g in [true, false].map(slices) {
            let near = culled(&g, &field, &table, Shading::Volume).0;
            // a leaf and a half from slice to slice
            g.vertices.iter_mut().for_each(|v| v.back[1] = v.front[1] + 24.0 / N as f32);
            let far = culled(&g, &field, &table, Shading::Volume).0;
            assert!(!far.indices.is_empty() && far.indices.len() < 10 * near.indices.len());
        }
    }

    #[test]
    fn odd_coordinates_do_no_harm() {
        let (field, table) = (ball(), table());
        let odd = || [f32::NAN, f32::INFINITY, -1e30, 5.0, -3.0].into_iter().cycle();
        for g in [true, false].map(slices) {
            let (mut texture, mut place) = (g.clone(), g);
            texture.vertices.iter_mut().zip(odd()).for_each(|(v, odd)| v.front[0] = odd);
            place.vertices.iter_mut().zip(odd()).for_each(|(v, odd)| v.position[0] = odd);
            for g in [texture, place] {
                let (culled, fronts) = culled(&g, &field, &table, Shading::Volume);
                assert!(culled.indices.iter().all(|i| (*i as usize) < fronts.len()));
            }
        }
    }

    /// A ring with an uneven rim, in many triangles, a part of which is displaced; seen from nearer than it is large.
    #[test]
    fn rims_and_displaced_parts_are_drawn_once() {
        let (field, table) = (ball(), table());
        let mut g = slices(true);
        let vertices = std::mem::take(&mut g.vertices);
        let still = vertices[0].jacobian;
        g.indices.clear();
        g.slices.clear();
        let ring = 90;
        for k in 0..N {
            let y = vertices[4 * k].front[1];
            let first = g.vertices.len() as u32;
            for i in 0..2 * ring {
                let (angle, outer) = ((i / 2) as f32 / ring as f32 * std::f32::consts::TAU, i % 2);
                let r = if outer == 1 { 0.4 + 0.07 * (7.0 * angle).sin() } else { 0.09 + 0.03 * (5.0 * angle).cos() };
                let front = [0.35 + r * angle.cos(), y, 0.62 + r * angle.sin()];
                let position = front.map(|x| (x - 0.5) * N as f32);
                let back = [front[0], y + 1.0 / N as f32, front[2]];
                g.vertices.push(SliceVertex { position, front, back, jacobian: still });
            }
            let start = g.indices.len() as u32;
            for i in 0..ring as u32 {
                let n = 2 * ring as u32;
                let [a, b, c, d] = [2 * i, 2 * i + 1, (2 * i + 2) % n, (2 * i + 3) % n].map(|j| first + j);
                g.indices.extend([a, b, c, c, b, d]);
                if i < 11 {
                    // here the map is another one, though it has the same values at the corners
                    [a, b].into_iter().for_each(|j| g.vertices[j as usize].jacobian[1] = 1.0);
                }
            }
            g.slices.push(start..g.indices.len() as u32);
        }
        let (left, fronts) = culled(&g, &field, &table, Shading::Volume);
        let triangles = |indices: &[u32], slice: &std::ops::Range<u32>| -> Vec<[[f32; 3]; 3]> {
            let all = indices[slice.start as usize..slice.end as usize].as_chunks::<3>().0;
            all.iter().map(|t| t.map(|i| fronts[i as usize])).collect()
        };
        let (mut seen, mut ways) = (0, [0, 0]);
        for (k, (before, after)) in g.slices.iter().zip(&left.slices).enumerate() {
            let (before, after) = (triangles(&g.indices, before), triangles(&left.indices, after));
            for at in 0..60 * 60 {
                let (x, z) = ((at % 60) as f32 / 60.0 + 0.005_17, (at / 60) as f32 / 60.0 + 0.004_71);
                let [was, is] = [&before, &after].map(|t| t.iter().filter(|t| holds(**t, x, z)).count());
                let p = DVec3::new(f64::from(x), (k as f64 + 0.5) / N as f64, f64::from(z)) * N as f64 - 0.5;
                let near = p.distance(DVec3::new(20.0, 30.0, 40.0)) < RADIUS - 1.0;
                assert!(is <= was && (!near || is == was), "slice {k} at {x} {z}: {is} times of {was}");
                seen += usize::from(near && is == 1);
            }
        }
        for v in &left.added {
            ways[usize::from(v.jacobian == still)] += 1;
        }
        assert!(seen > 500 && ways[0] > 100 && ways[1] > 100, "{seen} {ways:?}");
    }
}

//! Slices of a box, refined evenly: stands in for `slice` and `subdivide` where only drawing is looked at.

use glam::{DAffine3, DMat3, DVec3};
use voxclay::math::{BackwardMap, PlaneFrame};
use voxclay::render::{Camera, SliceGeometry, SliceVertex};
use voxclay::volume::Grid;

/// Corners of the convex polygon in which the plane `normal . p = height` meets the box, in order.
fn polygon(corners: &[DVec3; 8], frame: &PlaneFrame, height: f64) -> Vec<DVec3> {
    let mut found = Vec::new();
    for a in 0..8usize {
        for bit in [1, 2, 4] {
            let b = a | bit;
            if b == a {
                continue;
            }
            let (ha, hb) = (frame.height(corners[a]) - height, frame.height(corners[b]) - height);
            if (ha >= 0.0) != (hb >= 0.0) {
                found.push(corners[a].lerp(corners[b], ha / (ha - hb)));
            }
        }
    }
    let middle = found.iter().sum::<DVec3>() / found.len().max(1) as f64;
    let angle = |p: &DVec3| {
        let q = frame.project(*p - middle);
        q.y.atan2(q.x)
    };
    found.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    found
}

/// Slices of the grid's box across the view, `distance` apart, each triangle split 1 -> 4 `levels` times.
pub fn box_slices(grid: &Grid, camera: &Camera, map: &dyn BackwardMap, distance: f64, levels: u32) -> SliceGeometry {
    let frame = PlaneFrame::across(camera.to_eye()).unwrap();
    let corners = grid.corners();
    let heights = corners.map(|c| frame.height(c));
    let lo = heights.iter().copied().fold(f64::INFINITY, f64::min);
    let hi = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let count = ((hi - lo) / distance).ceil() as usize;
    let mut geometry = SliceGeometry { center: grid.center(), distance, ..SliceGeometry::default() };
    let texture_from_world: DAffine3 = grid.texture_from_world();
    let vertex = |p: DVec3| {
        let ray = camera.ray(p);
        let q = p + ray * (distance / -ray.dot(camera.to_eye()));
        let (undeformed, jacobian) = map.backward_with_jacobian(p);
        let j: DMat3 = texture_from_world.matrix3 * jacobian;
        SliceVertex {
            position: (p - geometry.center).as_vec3().to_array(),
            front: texture_from_world.transform_point3(undeformed).as_vec3().to_array(),
            back: texture_from_world.transform_point3(map.backward(q)).as_vec3().to_array(),
            jacobian: j.as_mat3().to_cols_array(),
        }
    };
    let (mut vertices, mut indices, mut slices) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..count {
        let first = indices.len() as u32;
        let outline = polygon(&corners, &frame, lo + (k as f64 + 0.5) * distance);
        let n = 1u32 << levels;
        for i in 1..outline.len().saturating_sub(1) {
            let (a, b, c) = (outline[0], outline[i], outline[i + 1]);
            let base = vertices.len() as u32;
            // row r has r + 1 vertices
            for r in 0..=n {
                for s in 0..=r {
                    let (u, v) = (f64::from(r - s) / f64::from(n), f64::from(s) / f64::from(n));
                    vertices.push(vertex(a + (b - a) * u + (c - a) * v));
                }
            }
            let at = |r: u32, s: u32| base + r * (r + 1) / 2 + s;
            for r in 0..n {
                for s in 0..=r {
                    indices.extend([at(r, s), at(r + 1, s), at(r + 1, s + 1)]);
                    if s < r {
                        indices.extend([at(r, s), at(r + 1, s + 1), at(r, s + 1)]);
                    }
                }
            }
        }
        slices.push(first..indices.len() as u32);
    }
    geometry.vertices = vertices;
    geometry.indices = indices;
    geometry.slices = slices;
    geometry
}

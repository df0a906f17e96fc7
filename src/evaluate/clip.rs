//! Slices cut by planes: triangles beyond are left out, those across are cut, with everything their corners carry.

use std::collections::HashMap;

use glam::DVec3;

use crate::render::{SliceGeometry, SliceVertex};
use crate::scene::CutPlane;

/// Cuts away what lies beyond any of the planes. Slices keep their order and their number.
pub fn clip(geometry: &mut SliceGeometry, planes: &[CutPlane]) {
    for plane in planes {
        cut(geometry, plane);
    }
}

fn cut(geometry: &mut SliceGeometry, plane: &CutPlane) {
    // relative to the geometry's centre, as the vertices are
    let (normal, offset) = (plane.normal, (plane.point - geometry.center).dot(plane.normal));
    let beyond: Vec<f64> =
        geometry.vertices.iter().map(|v| DVec3::from(v.position.map(f64::from)).dot(normal) - offset).collect();
    if beyond.iter().all(|d| *d <= 0.0) {
        return;
    }
    let mut indices = Vec::with_capacity(geometry.indices.len());
    // the same edge is cut in the same place for both of its triangles
    let mut cuts: HashMap<(u32, u32), u32> = HashMap::new();
    for slice in &mut geometry.slices {
        let start = indices.len() as u32;
        cuts.clear();
        let range = slice.start as usize..slice.end as usize;
        for &triangle in geometry.indices[range].as_chunks::<3>().0 {
            let inside = triangle.map(|i| beyond[i as usize] <= 0.0);
            match inside {
                [true, true, true] => indices.extend_from_slice(&triangle),
                [false, false, false] => {}
                _ => {
                    // the corners that are left, in order: three or four
                    let mut left = [0; 4];
                    let mut count = 0;
                    for k in 0..3 {
                        let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                        if inside[k] {
                            left[count] = a;
                            count += 1;
                        }
                        if inside[k] != inside[(k + 1) % 3] {
                            let (a, b) = (a.min(b), a.max(b));
                            left[count] = *cuts.entry((a, b)).or_insert_with(|| {
                                let (da, db) = (beyond[a as usize], beyond[b as usize]);
                                let t = (da / (da - db)) as f32;
                                let (va, vb) = (geometry.vertices[a as usize], geometry.vertices[b as usize]);
                                geometry.vertices.push(mixed(&va, &vb, t));
                                (geometry.vertices.len() - 1) as u32
                            });
                            count += 1;
                        }
                    }
                    for k in 2..count {
                        indices.extend_from_slice(&[left[0], left[k - 1], left[k]]);
                    }
                }
            }
        }
        *slice = start..indices.len() as u32;
    }
    geometry.indices = indices;
}

fn mixed(a: &SliceVertex, b: &SliceVertex, t: f32) -> SliceVertex {
    fn mix<const N: usize>(a: [f32; N], b: [f32; N], t: f32) -> [f32; N] {
        std::array::from_fn(|i| a[i] + t * (b[i] - a[i]))
    }
    SliceVertex {
        position: mix(a.position, b.position, t),
        front: mix(a.front, b.front, t),
        back: mix(a.back, b.back, t),
        jacobian: mix(a.jacobian, b.jacobian, t),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(g: &SliceGeometry) -> f64 {
        let p = |i: u32| DVec3::from(g.vertices[i as usize].position.map(f64::from));
        g.indices.as_chunks::<3>().0.iter().map(|&[a, b, c]| 0.5 * (p(b) - p(a)).cross(p(c) - p(a)).length()).sum()
    }

    /// Squares of side 2 about the z axis, at heights 0 to 4, their texture coordinates their positions.
    fn squares() -> SliceGeometry {
        let mut g = SliceGeometry { center: DVec3::new(10.0, 0.0, 0.0), distance: 1.0, ..SliceGeometry::default() };
        for k in 0..5 {
            let base = g.vertices.len() as u32;
            for [x, y] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
                let position = [x, y, k as f32];
                g.vertices.push(SliceVertex { position, front: position, ..SliceVertex::default() });
            }
            let at = g.indices.len() as u32;
            g.indices.extend([0, 1, 2, 0, 2, 3].map(|i| base + i));
            g.slices.push(at..at + 6);
        }
        g
    }

    #[test]
    fn what_is_beyond_goes_and_the_rest_stays() {
        let plane = |point: [f64; 3], normal: [f64; 3]| CutPlane {
            point: DVec3::new(10.0, 0.0, 0.0) + DVec3::from(point),
            normal: DVec3::from(normal).normalize(),
        };
        let mut g = squares();
        clip(&mut g, &[plane([0.5, 0.0, 0.0], [1.0, 0.0, 0.0])]);
        assert!((area(&g) - 5.0 * 3.0).abs() < 1e-5 && g.slices.len() == 5);
        // whole slices go where the plane lies along them
        let mut g = squares();
        clip(&mut g, &[plane([0.0, 0.0, 1.5], [0.0, 0.0, 1.0])]);
        assert!((area(&g) - 8.0).abs() < 1e-5);
        assert!(g.slices.len() == 5 && g.slices[4].is_empty());
        // two planes through the middle leave a quarter, or nothing
        let mut g = squares();
        let half = plane([0.0; 3], [1.0, 1.0, 0.0]);
        clip(&mut g, &[half, plane([0.0; 3], [1.0, -1.0, 0.0])]);
        assert!((area(&g) - 5.0).abs() < 1e-5);
        for v in &g.vertices {
            assert_eq!(v.position, v.front);
        }
        clip(&mut g, &[plane([0.0; 3], [-1.0, 0.0, 0.0]), half]);
        assert!(area(&g) < 1e-5);
    }
}

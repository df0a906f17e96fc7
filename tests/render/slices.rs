//! View-aligned slices of a box, by hand: each is a convex polygon, as a fan or cut into many triangles.

use glam::{DAffine3, DMat3, DVec3};
use voxclay::render::{Camera, SliceGeometry, SliceVertex};
use voxclay::volume::Grid;

/// The vertex at world point `p`, with `texture` the map from the world to texture space and its derivative.
pub fn vertex(
    p: DVec3,
    center: DVec3,
    camera: &Camera,
    distance: f64,
    texture: &dyn Fn(DVec3) -> (DVec3, DMat3),
) -> SliceVertex {
    let ray = camera.ray(p);
    let q = p + ray * (distance / -ray.dot(camera.to_eye()));
    let (front, jacobian) = texture(p);
    SliceVertex {
        position: (p - center).as_vec3().to_array(),
        front: front.as_vec3().to_array(),
        back: texture(q).0.as_vec3().to_array(),
        jacobian: jacobian.to_cols_array().map(|v| v as f32),
    }
}

/// Corners, in order, of the cut through the box `corners` (as [`Grid::corners`]) at `height` along `normal`.
pub fn cut(corners: &[DVec3; 8], normal: DVec3, height: f64) -> Vec<DVec3> {
    let mut points = Vec::new();
    for a in 0..8usize {
        for bit in [1, 2, 4] {
            let b = a | bit;
            let (ha, hb) = (normal.dot(corners[a]) - height, normal.dot(corners[b]) - height);
            if a != b && (ha >= 0.0) != (hb >= 0.0) {
                points.push(corners[a].lerp(corners[b], ha / (ha - hb)));
            }
        }
    }
    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let e1 = normal.any_orthonormal_vector();
    let e2 = normal.cross(e1);
    points.sort_by(|a, b| {
        let angle = |p: &DVec3| e2.dot(*p - middle).atan2(e1.dot(*p - middle));
        angle(a).total_cmp(&angle(b))
    });
    points
}

/// Slices of a grid's box at `distance`, back to front, with `rings` rings of slivers along the rim of each polygon.
pub fn box_slices(grid: &Grid, camera: &Camera, distance: f64, rings: usize) -> SliceGeometry {
    let m: DAffine3 = grid.texture_from_world();
    mapped_slices(grid, camera, distance, rings, &|p| (m.transform_point3(p), m.matrix3))
}

/// The same with any map to texture space.
pub fn mapped_slices(
    grid: &Grid,
    camera: &Camera,
    distance: f64,
    rings: usize,
    texture: &dyn Fn(DVec3) -> (DVec3, DMat3),
) -> SliceGeometry {
    let (corners, normal, center) = (grid.corners(), camera.to_eye(), grid.center());
    let heights = corners.map(|c| normal.dot(c));
    let (lo, hi) = heights.iter().fold((f64::MAX, f64::MIN), |(lo, hi), h| (lo.min(*h), hi.max(*h)));
    let count = ((hi - lo) / distance).ceil() as usize;
    let first = 0.5 * (lo + hi) - 0.5 * distance * (count as f64 - 1.0);
    let mut geometry = SliceGeometry { center, distance, ..Default::default() };
    for k in 0..count {
        let start = geometry.indices.len() as u32;
        let rim = cut(&corners, normal, first + k as f64 * distance);
        if rim.len() >= 3 {
            add_polygon(&mut geometry, &rim, rings, &|p| vertex(p, center, camera, distance, texture));
        }
        geometry.slices.push(start..geometry.indices.len() as u32);
    }
    geometry
}

fn add_polygon(geometry: &mut SliceGeometry, rim: &[DVec3], rings: usize, vertex: &dyn Fn(DVec3) -> SliceVertex) {
    if rings == 0 {
        let base = geometry.vertices.len() as u32;
        geometry.vertices.extend(rim.iter().map(|p| vertex(*p)));
        geometry.indices.extend((2..rim.len() as u32).flat_map(|i| [base, base + i - 1, base + i]));
        return;
    }
    // concentric rings of quads, each rim edge in 24 parts, and a fan in the middle
    let middle = rim.iter().sum::<DVec3>() / rim.len() as f64;
    let parts = 24;
    let points: Vec<DVec3> = (0..rim.len() * parts)
        .map(|i| rim[i / parts].lerp(rim[(i / parts + 1) % rim.len()], (i % parts) as f64 / parts as f64))
        .collect();
    let n = points.len() as u32;
    let base = geometry.vertices.len() as u32;
    for ring in 0..=rings {
        let shrink = ring as f64 / (rings + 1) as f64;
        geometry.vertices.extend(points.iter().map(|p| vertex(p.lerp(middle, shrink))));
    }
    geometry.vertices.push(vertex(middle));
    let last = geometry.vertices.len() as u32 - 1;
    for ring in 0..rings as u32 {
        for i in 0..n {
            let (a, b) = (base + ring * n + i, base + ring * n + (i + 1) % n);
            geometry.indices.extend([a, b, a + n, b, b + n, a + n]);
        }
    }
    let inner = base + rings as u32 * n;
    geometry.indices.extend((0..n).flat_map(|i| [inner + i, inner + (i + 1) % n, last]));
}

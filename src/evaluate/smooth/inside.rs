//! Where a ray through a pixel is inside the mesh that gives an object its shape.

use std::ops::ControlFlow;

use glam::{DMat4, DVec3, DVec4};

use crate::mesh::TriMesh;

/// Pixels along each side of a tile.
const TILE: usize = 16;

/// The triangles of a mesh, by the tiles of a picture that they may cover.
pub(super) struct Inside {
    mesh: TriMesh,
    across: usize,
    /// For each tile, where its triangles begin in the list.
    start: Vec<u32>,
    list: Vec<u32>,
}

impl Inside {
    pub fn new(mesh: &TriMesh, clip_from_world: &DMat4, (width, height): (u32, u32)) -> Self {
        let tiles = [width, height].map(|n| (n as usize).div_ceil(TILE));
        let corners: Vec<DVec4> = mesh.positions.iter().map(|p| *clip_from_world * p.extend(1.0)).collect();
        let size = [f64::from(width), f64::from(height)];
        // a range of tiles along each axis; everywhere if a corner lies behind the eye
        let covered = |t: &[u32; 3]| -> [std::ops::Range<usize>; 2] {
            let corners = t.map(|i| corners[i as usize]);
            if corners.iter().any(|c| !(c.w > 1e-9)) {
                return tiles.map(|n| 0..n);
            }
            std::array::from_fn(|a| {
                let at = corners.map(|c| {
                    let ndc = if a == 0 { c.x } else { -c.y } / c.w;
                    (0.5 * (ndc + 1.0) * size[a] / TILE as f64).clamp(-1.0, tiles[a] as f64)
                });
                let [lo, hi] = [at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2])];
                // a little more, for pixels on a border
                let first = (lo - 0.01).max(0.0) as usize;
                first..((hi + 0.01).max(0.0) as usize + usize::from(hi > -0.01)).min(tiles[a])
            })
        };
        let ranges: Vec<_> = mesh.triangles.iter().map(covered).collect();
        let mut start = vec![0u32; tiles[0] * tiles[1] + 1];
        let each = |work: &mut dyn FnMut(usize, u32)| {
            for (n, [columns, rows]) in ranges.iter().enumerate() {
                for row in rows.clone() {
                    for column in columns.clone() {
                        work(row * tiles[0] + column, n as u32);
                    }
                }
            }
        };
        each(&mut |tile, _| start[tile + 1] += 1);
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let mut list = vec![0; start[start.len() - 1] as usize];
        let mut next = start.clone();
        each(&mut |tile, n| {
            list[next[tile] as usize] = n;
            next[tile] += 1;
        });
        Self { mesh: mesh.clone(), across: tiles[0], start, list }
    }

    /// Calls `found` for each part of a pixel's ray inside the mesh and within a range, in order, with the normal of the triangle
    /// that it begins at, until it breaks.
    pub fn spans(
        &self,
        [x, y]: [usize; 2],
        origin: DVec3,
        direction: DVec3,
        range: [f64; 2],
        mut found: impl FnMut([f64; 2], Option<DVec3>) -> ControlFlow<()>,
    ) {
        let tile = y / TILE * self.across + x / TILE;
        let list = &self.list[self.start[tile] as usize..self.start[tile + 1] as usize];
        let crossing = |n: &u32| self.mesh.crossing(&self.mesh.triangles[*n as usize], origin, direction);
        let mut crossings: Vec<(f64, DVec3)> = list.iter().filter_map(crossing).collect();
        crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
        // a ray through an edge can miss both of its triangles: then the span between the outermost is what counts
        if crossings.len() % 2 == 1 {
            crossings.drain(1..(crossings.len() - 1).max(1));
        }
        for pair in crossings.chunks_exact(2) {
            let span = [pair[0].0.max(range[0]), pair[1].0.min(range[1])];
            if span[0] < span[1] && found(span, Some(pair[0].1)).is_break() {
                return;
            }
        }
    }
}

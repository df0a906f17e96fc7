//! The proxy mesh as a mask on a grid: slice by slice, the rows of each layer are cut by the mesh's contours.

use crate::math::parallel;
use glam::{DVec2, DVec3};

use crate::math::PlaneFrame;
use crate::mesh::{Topology, TriMesh};
use crate::slice::{Planes, SliceError, Slicer, Slices};
use crate::volume::{Grid, Scalar, Volume};
use crate::with_samples;

/// Sets every voxel whose centre lies outside the mesh (nonzero winding; a centre on the surface may count either way) to
/// the stored value nearest to `outside`, in all channels. Returns how many voxels that were. Of a mesh with parts that
/// are known to overlap, the sections are united first.
///
/// # Errors
/// If the sections are too large to count.
pub fn clear_outside(
    volume: &mut Volume,
    mesh: &TriMesh,
    topology: &Topology,
    overlaps: bool,
    outside: f64,
) -> Result<usize, SliceError> {
    let sections = layers(&volume.grid, mesh, topology, overlaps)?;
    let [nx, ny, _] = volume.grid.dims;
    let channels = volume.channels;
    let stored = volume.rescale.stored(outside);
    Ok(with_samples!(&mut volume.samples, samples => clear(samples, [nx, ny], channels, &sections, stored)))
}

/// The contours of the mesh in each layer of the grid, in voxel coordinates.
fn layers(grid: &Grid, mesh: &TriMesh, topology: &Topology, overlaps: bool) -> Result<Slices, SliceError> {
    let voxel_from_world = grid.voxel_from_world();
    let positions: Vec<DVec3> = mesh.positions.iter().map(|p| voxel_from_world.transform_point3(*p)).collect();
    let planes = Planes {
        frame: PlaneFrame { normal: DVec3::Z, e1: DVec3::X, e2: DVec3::Y },
        first: 0.0,
        step: 1.0,
        count: grid.dims[2],
    };
    let mut slicer = Slicer { overlaps, ..Slicer::default() };
    slicer.slice(&positions, topology, &planes)?;
    Ok(slicer.slices)
}

fn clear<T: Scalar>(samples: &mut [T], [nx, ny]: [usize; 2], channels: usize, sections: &Slices, stored: f64) -> usize {
    let value = T::from_f64(stored);
    let cleared = parallel::chunks_mut(samples, nx * ny * channels, &|k, layer| {
        let mut crossings = vec![Vec::new(); ny];
        for l in sections.plane_loops(k) {
            cross_rows(sections.loop_points(l), &mut crossings);
        }
        let mut cleared = 0;
        for (row, crossings) in layer.chunks_exact_mut(nx * channels).zip(&mut crossings) {
            crossings.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            let mut from = 0;
            let mut winding = 0;
            for &(x, turn) in crossings.iter() {
                // voxel i lies after the crossing if i >= x
                let i = x.ceil().clamp(0.0, nx as f64) as usize;
                if winding == 0 {
                    row[from * channels..i.max(from) * channels].fill(value);
                    cleared += i.saturating_sub(from);
                }
                from = i.max(from);
                winding += turn;
            }
            row[from * channels..].fill(value);
            cleared += nx - from;
        }
        cleared
    });
    cleared.iter().sum()
}

/// Notes where the sides of a loop cross the rows `y = 0, 1, ...`, with the sense of the crossing.
fn cross_rows(points: &[DVec2], rows: &mut [Vec<(f64, i32)>]) {
    let Some(mut p) = points.last().copied() else { return };
    for &q in points {
        let (lo, hi, turn) = if p.y < q.y { (p, q, 1) } else { (q, p, -1) };
        // rows with lo.y < y <= hi.y: a corner on a row belongs to one of its two sides only
        let first = (lo.y.floor() + 1.0).max(0.0);
        let last = hi.y.floor().min(rows.len() as f64 - 1.0);
        if first <= last && hi.y > lo.y {
            for (y, row) in rows.iter_mut().enumerate().take(last as usize + 1).skip(first as usize) {
                let t = (y as f64 - lo.y) / (hi.y - lo.y);
                row.push((lo.x + t * (hi.x - lo.x), turn));
            }
        }
        p = q;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::primitives;
    use crate::volume::Samples;

    #[test]
    fn a_sphere_keeps_its_voxels() {
        let grid = Grid::aligned([40, 36, 30], DVec3::new(1.0, 1.2, 1.5), DVec3::new(-20.0, -21.0, -22.0)).unwrap();
        let mut volume = Volume::new(grid, 1, Samples::U8(vec![200; grid.len()]));
        let (center, radius) = (DVec3::new(0.3, -0.4, 0.7), 15.0);
        let mut mesh = primitives::geodesic_sphere(24);
        mesh.positions.iter_mut().for_each(|p| *p = center + *p * radius);
        let topology = Topology::build(mesh.positions.len(), &mesh.triangles);
        let cleared = clear_outside(&mut volume, &mesh, &topology, false, 7.0).unwrap();
        let mut count = 0;
        for k in 0..30 {
            for j in 0..36 {
                for i in 0..40 {
                    let p = grid.world_from_voxel.transform_point3(DVec3::new(i as f64, j as f64, k as f64));
                    let d = (p - center).length();
                    let v = volume.samples.get(volume.index(i, j, k));
                    count += usize::from(v == 7.0);
                    // the facets lie within 0.5 % of the sphere
                    if d < radius * 0.995 {
                        assert_eq!(v, 200.0, "inside at {i} {j} {k}");
                    } else if d > radius {
                        assert_eq!(v, 7.0, "outside at {i} {j} {k}");
                    }
                }
            }
        }
        assert_eq!(cleared, count);
    }

    #[test]
    fn what_misses_the_grid_clears_everything() {
        let grid = Grid::aligned([4, 3, 2], DVec3::ONE, DVec3::ZERO).unwrap();
        let mut volume = Volume::new(grid, 1, Samples::U8(vec![1; 24]));
        let mut mesh = primitives::geodesic_sphere(2);
        mesh.positions.iter_mut().for_each(|p| p.x += 100.0);
        let topology = Topology::build(mesh.positions.len(), &mesh.triangles);
        assert_eq!(clear_outside(&mut volume, &mesh, &topology, false, 0.0).unwrap(), 24);
    }
}

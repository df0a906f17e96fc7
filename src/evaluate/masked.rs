//! Strokes that only take hold of some values.
//!
//! # Theory
//!
//! What has a value within a range follows the stroke, the rest stays: at every handle of a lattice over the stroke's support
//! the displacement is that of the stroke times the part of the material there that is within the range. The material is looked
//! up where it was before any deformation, so a mask goes by the values of the data, however they have been moved since.
//!
//! The result is a free-form deformation like any other: the volume is not asked again, so that every mode, the export and the
//! certificate treat it alike, and it does not change when the range or the volume does. Between what moves and what stays
//! material is stretched over about two steps of the lattice; it cannot tear. A sharp border therefore allows less of a pull
//! before it would fold.
//!
//! # Practice
//!
//! A [`ValueMask`] is made once for a range, in one pass over the samples; [`masked`] is quick enough for every event of a drag.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::deform::{DeformError, Deformer, Lattice, Prepared};
use crate::math::BackwardMap;
use crate::volume::{Scalar, Volume};
use crate::with_samples;

/// Cells along the longest side of a mask.
const CELLS: usize = 128;
/// Handles along each side of a masked stroke.
const HANDLES: usize = 16;

/// What part of the material has a value within a range, in cells of one or more voxels.
#[derive(Debug, Clone)]
pub struct ValueMask {
    pub range: [f64; 2],
    dims: [usize; 3],
    parts: Vec<f32>,
    /// The middle of the first cell at 0.
    cell_from_world: DAffine3,
}

impl ValueMask {
    /// The mask of real values from `lo` to `hi`, both included, of the channel that carries the opacity.
    pub fn of(volume: &Volume, [lo, hi]: [f64; 2]) -> Self {
        let size = volume.grid.dims;
        let step = size.iter().max().map_or(1, |n| n.div_ceil(CELLS)).max(1);
        let dims = size.map(|n| n.div_ceil(step).max(1));
        let [nx, ny, _] = size;
        let channels = volume.channels;
        let mut parts = vec![0.0; dims.iter().product()];
        let rescale = volume.rescale;
        with_samples!(&volume.samples, samples => {
            let inside = |x: usize, y: usize, z: usize| {
                let v = rescale.real(samples[((z * ny + y) * nx + x) * channels + channels - 1].to_f64());
                lo <= v && v <= hi
            };
            parts.par_chunks_mut(dims[0] * dims[1]).enumerate().for_each(|(k, layer)| {
                for (n, part) in layer.iter_mut().enumerate() {
                    let at = [n % dims[0], n / dims[0], k];
                    let [xs, ys, zs] = [0, 1, 2].map(|a| at[a] * step..((at[a] + 1) * step).min(size[a]));
                    let all = xs.len() * ys.len() * zs.len();
                    let mut count = 0_usize;
                    for z in zs {
                        for y in ys.clone() {
                            count += xs.clone().filter(|x| inside(*x, y, z)).count();
                        }
                    }
                    *part = count as f32 / all.max(1) as f32;
                }
            });
        });
        let s = step as f64;
        // voxels are counted from the middle of the first, as cells are
        let cell_from_voxel =
            DAffine3::from_scale(DVec3::splat(1.0 / s)) * DAffine3::from_translation(DVec3::splat(0.5 - 0.5 * s));
        Self { range: [lo, hi], dims, parts, cell_from_world: cell_from_voxel * volume.grid.voxel_from_world() }
    }

    /// The part within the range at a point of the undeformed world, 0 to 1; nothing lies beyond the volume.
    pub fn at(&self, rest: DVec3) -> f64 {
        let p = self.cell_from_world.transform_point3(rest);
        let base = p.floor();
        let t = p - base;
        let mut sum = 0.0;
        for corner in 0..8_usize {
            let bit = DVec3::new((corner & 1) as f64, (corner >> 1 & 1) as f64, (corner >> 2) as f64);
            let at = base + bit;
            let inside = (0..3).all(|a| at[a] >= 0.0 && at[a] < self.dims[a] as f64);
            if !inside {
                continue;
            }
            let near = DVec3::ONE - (bit - t).abs();
            let [x, y, z] = at.to_array().map(|v| v as usize);
            let part = self.parts[(z * self.dims[1] + y) * self.dims[0] + x];
            sum += near.x * near.y * near.z * f64::from(part);
        }
        sum
    }
}

/// A stroke on top of `before` that moves only what is within the mask; `None` if there is nothing of it.
///
/// # Errors
/// If the stroke's support is too thin for a lattice.
pub fn masked(stroke: &Deformer, before: &Prepared, mask: &ValueMask) -> Result<Option<Deformer>, DeformError> {
    let lattice = Lattice::new(stroke.support(), [HANDLES; 3])?;
    let places: Vec<DVec3> = lattice.indices().map(|i| lattice.place(i)).collect();
    let (vectors, free): (Vec<DVec3>, Vec<f64>) = places
        .par_iter()
        .map(|p| {
            // the material that the stroke brings here, and where it was at first
            let from = stroke.backward(*p);
            let free = *p - from;
            // most of a box does not move
            let part = if free == DVec3::ZERO { 0.0 } else { mask.at(before.backward(from)) };
            (free * part, free.length())
        })
        .unzip();
    let most = vectors.iter().map(|v| v.length()).fold(0.0, f64::max);
    let free = free.into_iter().fold(0.0, f64::max);
    if most <= 1e-3 * free {
        return Ok(None);
    }
    Ok(Some(Deformer::Lattice(lattice.with_handles(vectors)?)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deform::{DisplacementVolume, Falloff, Grab, Stack};
    use crate::volume::phantom::Phantom;
    use crate::volume::{Grid, Rescale, Samples};

    /// Left half 10, right half 200, a voxel a millimetre.
    fn halves() -> Volume {
        let mut volume = Phantom::from_name("orange").unwrap().generate(40);
        let dims = volume.grid.dims;
        let [nx, ny, nz] = dims;
        let samples = (0..nx * ny * nz).map(|i| if i % nx < nx / 2 { 10_u8 } else { 200 }).collect();
        volume.samples = Samples::U8(samples);
        volume.channels = 1;
        volume.rescale = Rescale::default();
        volume.grid = Grid { world_from_voxel: DAffine3::IDENTITY, ..volume.grid };
        volume
    }

    #[test]
    fn a_mask_is_the_part_within_the_range() {
        let volume = halves();
        let mask = ValueMask::of(&volume, [100.0, 255.0]);
        let middle = volume.grid.size() * 0.5;
        for dx in [-15.0, -4.0, 4.0, 15.0] {
            let want = if dx > 0.0 { 1.0 } else { 0.0 };
            assert!((mask.at(middle + DVec3::X * dx) - want).abs() < 1e-6, "{dx}");
        }
        assert_eq!(mask.at(DVec3::splat(-50.0)), 0.0);
        // everything and nothing
        assert!((ValueMask::of(&volume, [0.0, 255.0]).at(middle) - 1.0).abs() < 1e-6);
        assert_eq!(ValueMask::of(&volume, [50.0, 60.0]).at(middle), 0.0);
    }

    #[test]
    fn what_is_outside_the_range_stays() {
        let volume = halves();
        let middle = volume.grid.size() * 0.5;
        let pull = DVec3::new(0.0, 2.0, 0.0);
        let stroke = Deformer::Grab(Grab::new(middle, pull, 16.0, Falloff::Smooth).unwrap());
        let none = Stack::default().prepared();
        let mask = ValueMask::of(&volume, [100.0, 255.0]);
        let made = masked(&stroke, &none, &mask).unwrap().unwrap();
        for (dx, follows) in [(-7.0, 0.0), (7.0, 1.0)] {
            let p = middle + pull + DVec3::X * dx;
            let (free, got) = (p - stroke.backward(p), p - made.backward(p));
            assert!((got - free * follows).length() < 0.08 * pull.length(), "{dx}: {got} of {free}");
        }
        assert!(masked(&stroke, &none, &ValueMask::of(&volume, [50.0, 60.0])).unwrap().is_none());
        // with everything within it, it is the stroke itself, but for what the lattice cannot follow
        let all = masked(&stroke, &none, &ValueMask::of(&volume, [0.0, 255.0])).unwrap().unwrap();
        for i in 0..200 {
            let p = middle
                + 12.0
                    * DVec3::new((f64::from(i) * 0.7).sin(), (f64::from(i) * 1.3).cos(), (f64::from(i) * 0.41).sin());
            assert!((all.backward(p) - stroke.backward(p)).length() < 0.03 * pull.length(), "{p}");
        }
    }

    #[test]
    fn a_mask_follows_material_that_was_moved_before() {
        let volume = halves();
        let middle = volume.grid.size() * 0.5;
        // everything near the middle goes to the right: what is left of it now is bright no more
        let first = DisplacementVolume::from_drag(middle, DVec3::X * 4.0, 30.0).unwrap();
        let mut before = Stack::default();
        before.items.push(crate::deform::Deformation::new("", Deformer::Displacement(first)));
        let stroke = Deformer::Grab(Grab::new(middle, DVec3::Y, 14.0, Falloff::Smooth).unwrap());
        let mask = ValueMask::of(&volume, [100.0, 255.0]);
        let p = middle + DVec3::new(2.0, 1.0, 0.0);
        let moved = |before: &Stack| {
            let made = masked(&stroke, &before.prepared(), &mask).unwrap().unwrap();
            (p - made.backward(p)).length()
        };
        assert!(moved(&Stack::default()) > 2.0 * moved(&before));
    }
}

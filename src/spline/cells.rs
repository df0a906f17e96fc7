//! The plain alternative: the trilinear iso-surface, by marching cubes.
//!
//! On a face whose corners alternate, the asymptotic decider (Nielson and Hamann 1991) says what is joined: the trilinear
//! function there is a saddle, and the sign at its middle decides. Normals are central differences, interpolated along the
//! edges. Samples repeat beyond the border, as they do for the spline.

use glam::{DAffine3, DVec3, Vec3};

use super::correct::Padded;
use super::level::{limit, signs};
use super::real_values;
use super::surface::{CLEAR, Frame};
use crate::mesh::contour::{Contour, Edge, Placer, Sides, contour};
use crate::volume::Volume;

/// The trilinear iso-surface of one channel of a volume, in the world. Inside is what is at or above `iso`.
///
/// # Panics
/// If there is no such channel.
pub fn surface(volume: &Volume, channel: usize, iso: f64) -> Contour {
    assert!(channel < volume.channels);
    of_samples(&real_values(volume, channel, 0), iso, &volume.grid.world_from_voxel)
}

fn of_samples(samples: &Padded, iso: f64, world_from_voxel: &DAffine3) -> Contour {
    let at = limit(iso);
    let nx = samples.dims[0];
    let sides = Sides::new(samples.dims, &|j, k, out| {
        signs(&samples.values[samples.index([0, j, k])..][..nx], at, out);
    });
    let strides = samples.strides();
    contour(&sides, &Cells { samples, strides, iso, frame: Frame::new(world_from_voxel) })
}

struct Cells<'a> {
    samples: &'a Padded,
    strides: [usize; 3],
    iso: f64,
    frame: Frame,
}

impl Cells<'_> {
    /// Twice the central differences at a sample.
    #[inline(always)]
    fn differences(&self, at: usize) -> DVec3 {
        let v = &self.samples.values;
        DVec3::from(self.strides.map(|s| f64::from(v[at + s]) - f64::from(v[at - s])))
    }
}

impl Placer for Cells<'_> {
    fn vertex(&self, edge: Edge, _: bool) -> (DVec3, Vec3) {
        let at = self.samples.index(edge.node);
        let next = at + self.strides[edge.axis];
        let (a, b) = (f64::from(self.samples.values[at]), f64::from(self.samples.values[next]));
        let t = ((self.iso - a) / (b - a)).clamp(CLEAR, 1.0 - CLEAR);
        let mut p = DVec3::from(edge.node.map(|v| v as f64));
        p[edge.axis] += t;
        let gradient = self.differences(at).lerp(self.differences(next), t);
        (self.frame.place(p), self.frame.normal(gradient))
    }

    fn border(&self, p: DVec3, outward: DVec3) -> (DVec3, Vec3) {
        (self.frame.place(p), self.frame.normal(-outward))
    }

    fn middle(&self, _: [i64; 3], ring: &[(DVec3, Vec3)]) -> (DVec3, Vec3) {
        let n = ring.len() as f64;
        let normal = ring.iter().map(|r| r.1).sum::<Vec3>();
        (ring.iter().map(|r| r.0).sum::<DVec3>() / n, normal.normalize_or(ring[0].1))
    }

    fn joined(&self, node: [usize; 3], axis: usize) -> bool {
        let (u, v) = (self.strides[(axis + 1) % 3], self.strides[(axis + 2) % 3]);
        let at = self.samples.index(node);
        let [a, b, c, d] = [at, at + u, at + u + v, at + v].map(|i| f64::from(self.samples.values[i]) - self.iso);
        // the saddle's value is (a c - b d) / (a + c - b - d)
        if a >= 0.0 { a * c >= b * d } else { a * c <= b * d }
    }

    fn mirrors(&self) -> bool {
        self.frame.mirrors
    }
}

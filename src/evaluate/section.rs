//! Planar sections of the deformed volume, for views along the axes (multiplanar reformatting).
//!
//! Every pixel is a point of the deformed world; the backward map tells which value is there.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::load::Object;
use super::pick::Probe;

/// A rectangle in the world, as a grid of pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// The middle of the upper left pixel.
    pub corner: DVec3,
    /// Steps from pixel to pixel, to the right and down.
    pub right: DVec3,
    pub down: DVec3,
    pub size: [usize; 2],
}

impl Section {
    /// The section through `point` across one of the volume's own axes (0, 1, 2 for i, j, k), over the whole volume, with
    /// square pixels, `longest` along the longer side.
    ///
    /// Along i the second axis lies to the right and the third up; along j the first and the third; along k the first to the
    /// right and the second down, as radiologists look.
    pub fn across(object: &Object, axis: usize, point: DVec3, longest: usize) -> Self {
        let grid = &object.volume.grid;
        let frame = grid.world_from_voxel;
        let size = grid.size();
        let (a, b) = [(1, 2), (0, 2), (0, 1)][axis.min(2)];
        let column = |i: usize| frame.matrix3.col(i);
        let (la, lb) = (column(a).length() * size[a], column(b).length() * size[b]);
        let pixel = la.max(lb) / longest.max(1) as f64;
        let [w, h] = [la, lb].map(|l| ((l / pixel).round() as usize).max(1));
        let right = column(a).normalize() * (la / w as f64);
        let up = if b == 2 { 1.0 } else { -1.0 };
        let down = column(b).normalize() * (-up * lb / h as f64);
        // where the plane meets the corner of the texture cube
        let mut start = DVec3::splat(-0.5);
        start[axis.min(2)] = grid.voxel_from_world().transform_point3(point)[axis.min(2)];
        if up > 0.0 {
            start[b] = size[b] - 0.5;
        }
        Self { corner: frame.transform_point3(start) + 0.5 * (right + down), right, down, size: [w, h] }
    }

    /// Pixel coordinates (the middle of the upper left pixel at 0) of the world point, in the plane.
    pub fn pixel(&self, point: DVec3) -> [f64; 2] {
        let normal = self.right.cross(self.down);
        let local = DMat3::from_cols(self.right, self.down, normal).inverse() * (point - self.corner);
        [local.x, local.y]
    }

    /// World point of pixel coordinates.
    pub fn point(&self, [x, y]: [f64; 2]) -> DVec3 {
        self.corner + self.right * x + self.down * y
    }

    /// Real values of all pixels, rows top down; NaN beyond the volume.
    pub fn values(&self, object: &Object) -> Vec<f32> {
        let probe = Probe::new(object);
        self.pixels(|p| probe.value(p).map_or(f32::NAN, |v| v as f32))
    }

    /// How many times larger material is than it was, at all pixels; not positive where space is folded.
    pub fn growth(&self, object: &Object) -> Vec<f32> {
        let probe = Probe::new(object);
        self.pixels(|p| probe.growth(p) as f32)
    }

    fn pixels(&self, of: impl Fn(DVec3) -> f32 + Sync) -> Vec<f32> {
        let [w, h] = self.size;
        let mut values = vec![0.0; w * h];
        values.par_chunks_mut(w).enumerate().for_each(|(y, row)| {
            for (x, v) in row.iter_mut().enumerate() {
                *v = of(self.point([x as f64, y as f64]));
            }
        });
        values
    }
}

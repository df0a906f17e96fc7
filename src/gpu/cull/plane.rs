//! A slice that is flat in the picture: everything about its points follows from the pixel.

use glam::{DMat4, DVec2, DVec3};

use super::visibility::Visibility;
use crate::render::{Field, Frame, SliceVertex};

/// Where vertices lie in the picture, and what those look like that nothing displaces.
#[derive(Debug, Clone, Copy)]
pub struct View {
    clip_from_local: DMat4,
    /// Pixels across and down.
    pub size: DVec2,
    jacobian: [f32; 9],
}

impl View {
    pub fn new(frame: &Frame, field: &Field) -> Self {
        Self {
            clip_from_local: glam::Mat4::from_cols_array_2d(&frame.clip_from_local).as_dmat4(),
            size: DVec2::new(f64::from(frame.size[0]), f64::from(frame.size[1])),
            jacobian: field.grid.texture_from_world().matrix3.as_mat3().to_cols_array(),
        }
    }

    /// Whether the slices' map may be the identity around this vertex.
    pub fn is_still(&self, v: &SliceVertex) -> bool {
        v.jacobian == self.jacobian
    }

    /// Pixels from the upper left corner of the picture, and the distance they were divided by.
    fn pixel(&self, v: &SliceVertex) -> (DVec2, f64) {
        let p = DVec3::from_array(v.position.map(f64::from));
        let clip = self.clip_from_local * p.extend(1.0);
        let at = DVec2::new(0.5 + 0.5 * clip.x / clip.w, 0.5 - 0.5 * clip.y / clip.w);
        (at * self.size, clip.w)
    }
}

/// Position, front and back.
type Values = [f64; 9];

fn values(v: &SliceVertex) -> Values {
    std::array::from_fn(|i| f64::from([v.position, v.front, v.back][i / 3][i % 3]))
}

/// What vertices of a slice hold, by the pixel.
#[derive(Debug)]
pub struct Plane {
    /// At the upper left corner of the picture, by pixel across and by pixel down.
    origin: Values,
    across: Values,
    down: Values,
    jacobian: [f32; 9],
    dims: [f64; 3],
}

/// Largest difference of texture coordinates of points on one plane, in voxels: a hundred times the rounding in the largest
/// volume that a device takes.
const LEVEL: f64 = 1e-3;

impl Plane {
    /// The plane through the vertices, and where these are in the picture. `None` if there is none: they lie on one line,
    /// or at different depths, or are displaced.
    pub fn through(view: &View, visibility: &Visibility<'_>, vertices: &[&SliceVertex]) -> Option<(Self, Vec<DVec2>)> {
        let (pixels, depths): (Vec<_>, Vec<_>) = vertices.iter().map(|v| view.pixel(v)).unzip();
        let depth = *depths.first()?;
        // what is not a number compares as neither
        if depth <= 0.0 || !depths.iter().all(|d| (d - depth).abs() <= 1e-5 * depth) {
            return None;
        }
        // far apart, so that rounding is not enlarged
        let farthest = |from: &dyn Fn(DVec2) -> f64| {
            (0..pixels.len()).max_by(|&a, &b| from(pixels[a]).total_cmp(&from(pixels[b])))
        };
        let a = 0;
        let b = farthest(&|p| p.distance_squared(pixels[a]))?;
        let u = pixels[b] - pixels[a];
        let c = farthest(&|p| u.perp_dot(p - pixels[a]).abs())?;
        let v = pixels[c] - pixels[a];
        let area = u.perp_dot(v);
        if area.is_nan() || area.abs() < 1e-6 {
            return None;
        }
        let [at, along_u, along_v] = [a, b, c].map(|i| values(vertices[i]));
        let across: Values = std::array::from_fn(|i| ((along_u[i] - at[i]) * v.y - (along_v[i] - at[i]) * u.y) / area);
        let down: Values = std::array::from_fn(|i| ((along_v[i] - at[i]) * u.x - (along_u[i] - at[i]) * v.x) / area);
        let origin = std::array::from_fn(|i| at[i] - across[i] * pixels[a].x - down[i] * pixels[a].y);
        let dims = visibility.dims().map(f64::from);
        let plane = Self { origin, across, down, jacobian: vertices[a].jacobian, dims };
        let fits = |(p, v): (&DVec2, &&SliceVertex)| {
            let (is, should) = (plane.values(*p), values(v));
            (3..9).all(|i| ((is[i] - should[i]) * dims[i % 3]).abs() <= LEVEL)
        };
        pixels.iter().zip(vertices).all(fits).then_some((plane, pixels))
    }

    fn values(&self, p: DVec2) -> Values {
        std::array::from_fn(|i| self.origin[i] + self.across[i] * p.x + self.down[i] * p.y)
    }

    /// The vertex of a pixel.
    pub fn vertex(&self, p: DVec2) -> SliceVertex {
        let v = self.values(p).map(|v| v as f32);
        let at = |i: usize| [v[i], v[i + 1], v[i + 2]];
        SliceVertex { position: at(0), front: at(3), back: at(6), jacobian: self.jacobian }
    }

    /// Voxels from one pixel to the next, at most.
    pub fn voxels_per_pixel(&self) -> f64 {
        (3..9).map(|i| self.across[i].abs().max(self.down[i].abs()) * self.dims[i % 3]).fold(0.0, f64::max)
    }

    /// Whether anything can be seen between two corners of a rectangle of pixels.
    pub fn is_visible(&self, visibility: &Visibility<'_>, lo: DVec2, hi: DVec2) -> bool {
        let (middle, half) = (self.values(0.5 * (lo + hi)), 0.5 * (hi - lo));
        let mut bounds = [[0.0f32; 3]; 2];
        for i in 0..3 {
            let reach = |j: usize| self.across[j].abs() * half.x + self.down[j].abs() * half.y;
            let (front, back) = ((middle[3 + i], reach(3 + i)), (middle[6 + i], reach(6 + i)));
            if front.0 + front.1 < 0.0 || front.0 - front.1 > 1.0 {
                return false;
            }
            bounds[0][i] = ((front.0 - front.1).min(back.0 - back.1) * self.dims[i] - 0.5) as f32;
            bounds[1][i] = ((front.0 + front.1).max(back.0 + back.1) * self.dims[i] - 0.5) as f32;
        }
        visibility.between(bounds[0], bounds[1])
    }
}

use glam::{DAffine3, DVec3};

use crate::math::{BLOCK, Block, BlockMap, JacobianBlock};

/// What is known at a corner of a refined triangle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Corner {
    /// World position relative to the map's centre.
    pub position: [f32; 3],
    /// Texture coordinate of the value here.
    pub front: [f32; 3],
    /// Texture coordinate where the viewing ray meets the next slice.
    pub back: [f32; 3],
    /// Derivative of the texture coordinate by world position, column by column.
    pub jacobian: [f32; 9],
}

/// Where the viewing ray through a point of the slice meets the next slice: `scale * p + shift`, in world space.
///
/// Seen along parallel rays the scale is 1 and the shift one slice distance along the ray. From an eye at distance `h` before
/// the slice, with slices `d` apart, `q = p + (p - eye) d / h`: scale `1 + d / h`, shift `-eye d / h`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NextSlice {
    pub scale: f64,
    pub shift: DVec3,
}

impl NextSlice {
    /// Along parallel rays: `step` leads from slice to slice.
    pub fn parallel(step: DVec3) -> Self {
        Self { scale: 1.0, shift: step }
    }

    /// Seen from `eye`, which lies `height` before the slice; the next slice lies `distance` behind it.
    pub fn from_eye(eye: DVec3, height: f64, distance: f64) -> Self {
        Self { scale: 1.0 + distance / height, shift: -eye * (distance / height) }
    }
}

/// How texture coordinates are made from the backward map.
#[derive(Debug, Clone, Copy)]
pub struct Texturing {
    /// Relative to the map's centre.
    columns: [[f32; 3]; 4],
    next: Option<([f32; 3], f32)>,
}

impl Texturing {
    /// `next` for the back coordinate; without it, `back` equals `front`. `center` is the map's ([`BlockMap::center`]).
    pub fn new(texture_from_world: &DAffine3, next: Option<NextSlice>, center: DVec3) -> Self {
        let m = texture_from_world.matrix3;
        let columns = [m.x_axis, m.y_axis, m.z_axis, texture_from_world.transform_point3(center)];
        let next = next.map(|n| {
            // relative: scale (c + x) + shift - c
            let shift = center * (n.scale - 1.0) + n.shift;
            (shift.as_vec3().to_array(), n.scale as f32)
        });
        Self { columns: columns.map(|c| c.as_vec3().to_array()), next }
    }

    /// Turns undeformed points into texture coordinates.
    #[inline(always)]
    fn texture(&self, b: &mut Block<f32>) {
        let [u, v, w, o] = self.columns;
        for i in 0..BLOCK {
            let (x, y, z) = (b.x[i], b.y[i], b.z[i]);
            b.x[i] = u[0] * x + v[0] * y + w[0] * z + o[0];
            b.y[i] = u[1] * x + v[1] * y + w[1] * z + o[1];
            b.z[i] = u[2] * x + v[2] * y + w[2] * z + o[2];
        }
    }

    /// Turns derivatives of the undeformed point into those of the texture coordinate.
    #[inline(always)]
    fn texture_jacobian(&self, j: &mut JacobianBlock<f32>) {
        let [u, v, w, _] = self.columns;
        for column in j.entry.chunks_exact_mut(3) {
            let [x, y, z] = column else { continue };
            for i in 0..BLOCK {
                let d = [x[i], y[i], z[i]];
                x[i] = u[0] * d[0] + v[0] * d[1] + w[0] * d[2];
                y[i] = u[1] * d[0] + v[1] * d[1] + w[1] * d[2];
                z[i] = u[2] * d[0] + v[2] * d[1] + w[2] * d[2];
            }
        }
    }
}

/// Evaluates `map` at `positions` and hands every corner to `put`, in order. `jacobians`: whether they are wanted (else zero).
pub fn corners(
    positions: &[DVec3],
    map: &impl BlockMap<f32>,
    texturing: &Texturing,
    jacobians: bool,
    mut put: impl FnMut(Corner),
) {
    let center = map.center();
    let [mut here, mut front, mut back] = [(); 3].map(|()| Block::<f32>::default());
    let mut jacobian = JacobianBlock::<f32> { entry: [[0.0; BLOCK]; 9] };
    for chunk in positions.chunks(BLOCK) {
        for (i, p) in chunk.iter().enumerate() {
            let r = *p - center;
            (here.x[i], here.y[i], here.z[i]) = (r.x as f32, r.y as f32, r.z as f32);
        }
        // the rest repeats the last point, so that the block's bounds stay tight
        let n = chunk.len();
        for lane in [&mut here.x, &mut here.y, &mut here.z] {
            let last = lane[n - 1];
            lane[n..].fill(last);
        }
        front.clone_from(&here);
        if jacobians {
            map.backward_block_with_jacobian(&mut front, &mut jacobian);
            texturing.texture_jacobian(&mut jacobian);
        } else {
            map.backward_block(&mut front);
        }
        texturing.texture(&mut front);
        if let Some((shift, scale)) = texturing.next {
            for i in 0..BLOCK {
                back.x[i] = here.x[i] * scale + shift[0];
                back.y[i] = here.y[i] * scale + shift[1];
                back.z[i] = here.z[i] * scale + shift[2];
            }
            map.backward_block(&mut back);
            texturing.texture(&mut back);
        } else {
            back.clone_from(&front);
        }
        for i in 0..n.min(BLOCK) {
            put(Corner {
                position: [here.x[i], here.y[i], here.z[i]],
                front: [front.x[i], front.y[i], front.z[i]],
                back: [back.x[i], back.y[i], back.z[i]],
                jacobian: std::array::from_fn(|e| jacobian.entry[e][i]),
            });
        }
    }
}

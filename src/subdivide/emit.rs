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

    #[inline(always)]
    fn coordinate(&self, x: f32, y: f32, z: f32) -> [f32; 3] {
        let [a, b, c, o] = self.columns;
        std::array::from_fn(|i| a[i] * x + b[i] * y + c[i] * z + o[i])
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
    let mut here = Block::<f32>::default();
    let mut jacobian = JacobianBlock::<f32>::default();
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
        let mut front = here.clone();
        if jacobians {
            map.backward_block_with_jacobian(&mut front, &mut jacobian);
        } else {
            map.backward_block(&mut front);
        }
        let mut back = front.clone();
        if let Some((shift, scale)) = texturing.next {
            for i in 0..BLOCK {
                back.x[i] = here.x[i] * scale + shift[0];
                back.y[i] = here.y[i] * scale + shift[1];
                back.z[i] = here.z[i] * scale + shift[2];
            }
            map.backward_block(&mut back);
        }
        let [a, b, c, _] = texturing.columns;
        for i in 0..n {
            let mut corner = Corner {
                position: [here.x[i], here.y[i], here.z[i]],
                front: texturing.coordinate(front.x[i], front.y[i], front.z[i]),
                back: texturing.coordinate(back.x[i], back.y[i], back.z[i]),
                jacobian: [0.0; 9],
            };
            if jacobians {
                for column in 0..3 {
                    let [x, y, z] = std::array::from_fn(|r| jacobian.entry[3 * column + r][i]);
                    for r in 0..3 {
                        corner.jacobian[3 * column + r] = a[r] * x + b[r] * y + c[r] * z;
                    }
                }
            }
            put(corner);
        }
    }
}

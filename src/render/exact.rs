use glam::{DAffine3, DMat3, DVec3};

use super::Frame;
use crate::math::BackwardMap;

/// The map from the deformed world to texture space, to be evaluated at every fragment instead of interpolated
/// (`slicing-exact`): the reference for subdivided slices.
#[derive(Clone, Copy)]
pub struct Exact<'a> {
    pub map: &'a dyn BackwardMap,
    /// From the undeformed world.
    pub texture_from_world: DAffine3,
}

/// What a fragment samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fragment {
    pub front: DVec3,
    pub back: DVec3,
    /// Derivative of the texture coordinate by world position.
    pub jacobian: DMat3,
}

impl Exact<'_> {
    /// The fragment at `p`, a position relative to `center`.
    pub fn fragment(&self, p: [f32; 3], center: DVec3, frame: &Frame) -> Fragment {
        let p = DVec3::from(p.map(f64::from));
        let [eye, axis] = [frame.eye, frame.axis].map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into()));
        let to_eye = (eye - f64::from(frame.eye[3]) * p).normalize();
        let q = p - to_eye * (f64::from(frame.axis[3]) / axis.dot(to_eye));
        let (front, jacobian) = self.map.backward_with_jacobian(center + p);
        Fragment {
            front: self.texture_from_world.transform_point3(front),
            back: self.texture_from_world.transform_point3(self.map.backward(center + q)),
            jacobian: self.texture_from_world.matrix3 * jacobian,
        }
    }
}

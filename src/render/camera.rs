use glam::{DMat3, DMat4, DVec3, DVec4};

/// How depth is projected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    Orthographic,
    /// Vertical field of view in degrees, above 0 and below 170.
    Perspective {
        fov_y: f64,
    },
}

/// An orbiting camera: it looks at `target` from a direction given by yaw and pitch. Without roll the world's z axis is up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    pub target: DVec3,
    /// Degrees; 0 looks along +y (from the front for LPS data), positive turns the eye towards +x.
    pub yaw: f64,
    /// Degrees; positive raises the eye. Beyond 90 it looks from behind, with the world on its head.
    pub pitch: f64,
    /// Degrees by which the picture is turned clockwise.
    pub roll: f64,
    /// Radius of the sphere that fills the picture's smaller side, in world units, before `zoom`.
    pub radius: f64,
    pub zoom: f64,
    pub projection: Projection,
}

impl Camera {
    /// World axes of the view: columns are right, up, and towards the eye.
    pub fn axes(&self) -> DMat3 {
        let (sy, cy) = self.yaw.to_radians().sin_cos();
        let (sp, cp) = self.pitch.to_radians().sin_cos();
        let to_eye = DVec3::new(cp * sy, -cp * cy, sp);
        let right = DVec3::new(cy, sy, 0.0);
        let up = to_eye.cross(right);
        if self.roll == 0.0 {
            return DMat3::from_cols(right, up, to_eye);
        }
        let (sr, cr) = self.roll.to_radians().sin_cos();
        DMat3::from_cols(right * cr + up * sr, up * cr - right * sr, to_eye)
    }

    /// Yaw, pitch and roll in degrees of such axes; pitch within -90 to 90. Seen from a pole, yaw and roll are the same turn:
    /// then yaw is `yaw`.
    pub fn angles_of(axes: &DMat3, yaw: f64) -> [f64; 3] {
        let e = axes.z_axis;
        let level = e.x.hypot(e.y);
        let yaw = if level > 1e-9 { e.x.atan2(-e.y) } else { yaw.to_radians() };
        // the axes without roll, by which the roll is measured
        let (sy, cy) = yaw.sin_cos();
        let right = DVec3::new(cy, sy, 0.0);
        let up = e.cross(right);
        let roll = axes.x_axis.dot(up).atan2(axes.x_axis.dot(right));
        [yaw, e.z.atan2(level), roll].map(f64::to_degrees)
    }

    /// Unit vector from the target to the eye: the normal of the slices.
    pub fn to_eye(&self) -> DVec3 {
        self.axes().z_axis
    }

    /// Distance of the eye from the target. For an orthographic view the eye lies far enough outside to see everything.
    pub fn eye_distance(&self) -> f64 {
        match self.projection {
            Projection::Orthographic => 4.0 * self.radius,
            Projection::Perspective { fov_y } => self.radius / self.zoom / (0.5 * fov_y.to_radians()).sin(),
        }
    }

    pub fn eye(&self) -> DVec3 {
        self.target + self.to_eye() * self.eye_distance()
    }

    /// Unit direction in which the ray through world point `p` runs, away from the eye.
    pub fn ray(&self, p: DVec3) -> DVec3 {
        match self.projection {
            Projection::Orthographic => -self.to_eye(),
            Projection::Perspective { .. } => (p - self.eye()).normalize(),
        }
    }

    /// Clip space (wgpu: x right, y up, depth 0 near to 1 far) from the world.
    pub fn clip_from_world(&self, width: u32, height: u32) -> DMat4 {
        let axes = self.axes();
        let view_rot = axes.transpose();
        let eye = self.eye();
        let view = DMat4::from_mat3(view_rot) * DMat4::from_translation(-eye);
        let (w, h) = (f64::from(width.max(1)), f64::from(height.max(1)));
        let (ax, ay) = (w / w.min(h), h / w.min(h));
        let d = self.eye_distance();
        let (near, far) = ((d - 3.0 * self.radius).max(0.01 * self.radius), d + 3.0 * self.radius);
        let proj = match self.projection {
            Projection::Orthographic => {
                let r = self.radius / self.zoom;
                DMat4::from_cols(
                    DVec4::new(1.0 / (r * ax), 0.0, 0.0, 0.0),
                    DVec4::new(0.0, 1.0 / (r * ay), 0.0, 0.0),
                    DVec4::new(0.0, 0.0, -1.0 / (far - near), 0.0),
                    DVec4::new(0.0, 0.0, -near / (far - near), 1.0),
                )
            }
            Projection::Perspective { fov_y } => {
                // the field of view belongs to the smaller side
                let f = 1.0 / (0.5 * fov_y.to_radians()).tan();
                DMat4::from_cols(
                    DVec4::new(f / ax, 0.0, 0.0, 0.0),
                    DVec4::new(0.0, f / ay, 0.0, 0.0),
                    DVec4::new(0.0, 0.0, -far / (far - near), -1.0),
                    DVec4::new(0.0, 0.0, -near * far / (far - near), 0.0),
                )
            }
        };
        proj * view
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_lead_to_axes_and_back() {
        let camera = |[yaw, pitch, roll]: [f64; 3]| Camera {
            target: DVec3::ZERO,
            yaw,
            pitch,
            roll,
            radius: 1.0,
            zoom: 1.0,
            projection: Projection::Orthographic,
        };
        for i in 0..400 {
            let t = |k: f64| (f64::from(i) * k).fract() * 2.0 - 1.0;
            let given = [180.0 * t(0.754_877), 89.0 * t(0.569_840), 180.0 * t(0.430_159)];
            let back = Camera::angles_of(&camera(given).axes(), 7.0);
            for (a, b) in given.into_iter().zip(back) {
                assert!((a - b).abs() < 1e-9, "{given:?} {back:?}");
            }
        }
        // what the angles of a view on its head or from a pole are called does not matter
        for given in [[30.0, 120.0, 0.0], [-70.0, -170.0, 40.0], [25.0, 90.0, 15.0], [25.0, -90.0, 0.0]] {
            let axes = camera(given).axes();
            let back = camera(Camera::angles_of(&axes, 25.0));
            assert!(back.pitch.abs() <= 90.0);
            let off = (back.axes() - axes).to_cols_array().into_iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            assert!(off < 1e-9, "{given:?} {off}");
        }
        // clockwise: what is up leans to the right
        let axes = camera([0.0, 0.0, 30.0]).axes();
        assert!((DVec3::Z.dot(axes.x_axis) - 0.5).abs() < 1e-12);
    }
}

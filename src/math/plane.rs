use glam::{DVec2, DVec3};

/// A family of parallel planes `normal . p = height`, with in-plane axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneFrame {
    /// Unit normal.
    pub normal: DVec3,
    /// In-plane unit axes; `e1 x e2 = normal`.
    pub e1: DVec3,
    pub e2: DVec3,
}

impl PlaneFrame {
    /// The frame of planes across `direction`; `None` if the direction has no length or is not finite.
    pub fn across(direction: DVec3) -> Option<Self> {
        let normal = direction.try_normalize()?;
        // the axis least along the normal, so that the cross product is well conditioned
        let helper = if normal.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
        let e1 = normal.cross(helper).normalize();
        Some(Self { normal, e1, e2: normal.cross(e1) })
    }

    /// Height of a point along the normal.
    pub fn height(&self, p: DVec3) -> f64 {
        self.normal.dot(p)
    }

    /// In-plane coordinates of a point.
    pub fn project(&self, p: DVec3) -> DVec2 {
        DVec2::new(self.e1.dot(p), self.e2.dot(p))
    }

    /// The point with in-plane coordinates `q` on the plane at `height`.
    pub fn lift(&self, q: DVec2, height: f64) -> DVec3 {
        self.e1 * q.x + self.e2 * q.y + self.normal * height
    }
}

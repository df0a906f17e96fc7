use glam::{DMat3, DVec3};

/// A box with any orientation, in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrientedBox {
    pub center: DVec3,
    /// Columns are the unit axes u, v, w of the box, right-handed.
    pub axes: DMat3,
    /// Half of the edge lengths along u, v, w; all positive.
    pub half: DVec3,
}

impl OrientedBox {
    /// The edges, by the numbers of their corners.
    pub const EDGES: [[usize; 2]; 12] =
        [[0, 1], [0, 2], [0, 4], [1, 3], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 6], [5, 7], [6, 7]];

    /// Coordinates of `point` in `[-1,1]^3` for points inside the box.
    pub fn local(&self, point: DVec3) -> DVec3 {
        self.axes.transpose() * (point - self.center) / self.half
    }

    /// Whether `point` lies in the closed box.
    pub fn contains(&self, point: DVec3) -> bool {
        self.local(point).abs().max_element() <= 1.0
    }

    /// The eight corners; bit 0, 1, 2 of the index choose the upper side along u, v, w.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let sign = DVec3::new(
                if i & 1 == 0 { -1.0 } else { 1.0 },
                if i & 2 == 0 { -1.0 } else { 1.0 },
                if i & 4 == 0 { -1.0 } else { 1.0 },
            );
            self.center + self.axes * (sign * self.half)
        })
    }

    /// Lower and upper corner of the axis-aligned box around this one.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let reach = self.axes.x_axis.abs() * self.half.x
            + self.axes.y_axis.abs() * self.half.y
            + self.axes.z_axis.abs() * self.half.z;
        (self.center - reach, self.center + reach)
    }
}

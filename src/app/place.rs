//! The parts of the gizmo that places the shape, and what dragging them does. Pure: nothing here knows of windows.

use glam::{DMat3, DQuat, DVec3, EulerRot};

use crate::scene::Placement;

/// What can be taken hold of; the axis is 0, 1 or 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Along an axis of the world.
    Move(usize),
    /// About an axis of the world.
    Turn(usize),
    /// Along an axis of the mesh itself.
    Scale(usize),
    ScaleAll,
}

impl Part {
    /// In the order in which they are drawn: the last is on top.
    pub const ALL: [Self; 10] = [
        Self::Turn(0),
        Self::Turn(1),
        Self::Turn(2),
        Self::Move(0),
        Self::Move(1),
        Self::Move(2),
        Self::Scale(0),
        Self::Scale(1),
        Self::Scale(2),
        Self::ScaleAll,
    ];

    pub fn name(self) -> String {
        let axis = |k: usize| ["X", "Y", "Z"][k.min(2)];
        match self {
            Self::Move(k) => format!("Move the shape along {}", axis(k)),
            Self::Turn(k) => format!("Turn the shape about {}", axis(k)),
            Self::Scale(k) => format!("Scale the shape along its {}", axis(k)),
            Self::ScaleAll => "Scale the shape".to_owned(),
        }
    }

    /// Colours go by axes; all of them together have none.
    pub fn axis(self) -> Option<usize> {
        match self {
            Self::Move(k) | Self::Turn(k) | Self::Scale(k) => Some(k),
            Self::ScaleAll => None,
        }
    }
}

/// A world axis.
pub fn axis(k: usize) -> DVec3 {
    DVec3::AXES[k.min(2)]
}

/// The placement after a part was dragged: by world units, degrees, or a factor.
pub fn dragged(start: &Placement, part: Part, by: f64) -> Placement {
    let mut p = *start;
    match part {
        Part::Move(k) => p.translate += axis(k) * by,
        Part::Turn(k) => {
            let turned = DMat3::from_quat(DQuat::from_axis_angle(axis(k), by.to_radians())) * start.turn();
            let (z, y, x) = turned.to_euler(EulerRot::ZYX);
            p.rotate = DVec3::new(x, y, z).map(f64::to_degrees);
        }
        Part::Scale(k) => p.scale[k.min(2)] *= factor(by),
        Part::ScaleAll => p.scale *= factor(by),
    }
    p
}

/// A mesh of no size could not be taken hold of again.
fn factor(by: f64) -> f64 {
    by.clamp(0.02, 50.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_add_up_about_the_axes_of_the_world() {
        let start = Placement { rotate: DVec3::new(20.0, -35.0, 50.0), ..Placement::default() };
        for k in 0..3 {
            let once = dragged(&start, Part::Turn(k), 77.0);
            let want = DMat3::from_axis_angle(axis(k), 77.0_f64.to_radians()) * start.turn();
            assert!((once.turn() - want).to_cols_array().iter().all(|e| e.abs() < 1e-12), "{k}");
            let back = dragged(&once, Part::Turn(k), -77.0);
            assert!((back.turn() - start.turn()).to_cols_array().iter().all(|e| e.abs() < 1e-12), "{k}");
        }
    }

    #[test]
    fn parts_change_what_they_say() {
        let start = Placement { scale: DVec3::new(1.0, 2.0, 0.5), ..Placement::default() };
        assert_eq!(dragged(&start, Part::Move(1), 3.0).translate, DVec3::new(0.0, 3.0, 0.0));
        assert_eq!(dragged(&start, Part::Scale(2), 2.0).scale, DVec3::new(1.0, 2.0, 1.0));
        assert_eq!(dragged(&start, Part::ScaleAll, 2.0).scale, DVec3::new(2.0, 4.0, 1.0));
        // however far it is dragged there is something left
        assert!(dragged(&start, Part::ScaleAll, -9.0).scale.min_element() > 0.0);
    }
}

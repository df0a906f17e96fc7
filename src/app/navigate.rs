//! The camera in the hand: orbit, pan, zoom, standard views. Pure functions of a saved camera.

use eframe::egui::{Rect, Vec2};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::render::{Camera, Projection};
use crate::scene::CameraSpec;

/// Degrees for a drag over the smaller side of the view.
const TURN: f64 = 180.0;
const STEEPEST: f64 = 89.9;

/// How a drag turns the view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Orbit {
    /// Up stays up.
    #[default]
    Turntable,
    /// Over the poles and on, until the object stands on its head.
    Free,
}

impl Orbit {
    pub const ALL: [Self; 2] = [Self::Turntable, Self::Free];

    pub fn name(self) -> &'static str {
        match self {
            Self::Turntable => "Turntable",
            Self::Free => "Free, over the poles",
        }
    }
}

/// Right drags the front to the right, down shows more of the top.
pub fn orbit(camera: &CameraSpec, how: Orbit, drag: Vec2, view: Rect) -> CameraSpec {
    let side = f64::from(view.width().min(view.height()).max(1.0));
    let pitch = camera.pitch + f64::from(drag.y) / side * TURN;
    // on its head, what is in front goes the other way round
    let upright = if camera.pitch.to_radians().cos() < 0.0 { -1.0 } else { 1.0 };
    CameraSpec {
        yaw: wrap(camera.yaw - upright * f64::from(drag.x) / side * TURN),
        pitch: match how {
            Orbit::Turntable => pitch.clamp(-STEEPEST, STEEPEST),
            Orbit::Free => wrap(pitch),
        },
        ..*camera
    }
}

/// The picture follows the hand in the plane of the target.
pub fn pan(spec: &CameraSpec, camera: &Camera, drag: Vec2, view: Rect) -> CameraSpec {
    let scale = world_per_point(camera, view, camera.target);
    let axes = camera.axes();
    let shift = axes.x_axis * (-f64::from(drag.x) * scale) + axes.y_axis * (f64::from(drag.y) * scale);
    CameraSpec { offset: spec.offset + shift, ..*spec }
}

/// Magnifies by `factor`; what lies under the pointer (in the target's plane) stays there.
pub fn zoom(spec: &CameraSpec, camera: &Camera, factor: f64, pointer: Option<Vec2>, view: Rect) -> CameraSpec {
    let zoom = (spec.zoom * factor).clamp(0.05, 200.0);
    let Some(p) = pointer else { return CameraSpec { zoom, ..*spec } };
    let from_middle = p - view.size() * 0.5;
    let scale = world_per_point(camera, view, camera.target) * (1.0 - spec.zoom / zoom);
    let axes = camera.axes();
    let shift = axes.x_axis * (f64::from(from_middle.x) * scale) + axes.y_axis * (-f64::from(from_middle.y) * scale);
    CameraSpec { zoom, offset: spec.offset + shift, ..*spec }
}

/// Everything in view, from where it is seen now.
pub fn frame(spec: &CameraSpec) -> CameraSpec {
    CameraSpec { zoom: 1.0, offset: DVec3::ZERO, ..*spec }
}

/// The standard views.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standard {
    Front,
    Back,
    Right,
    Left,
    Top,
    Bottom,
}

impl Standard {
    pub const ALL: [Self; 6] = [Self::Front, Self::Back, Self::Right, Self::Left, Self::Top, Self::Bottom];

    pub fn name(self) -> &'static str {
        match self {
            Self::Front => "Front",
            Self::Back => "Back",
            Self::Right => "Right",
            Self::Left => "Left",
            Self::Top => "Top",
            Self::Bottom => "Bottom",
        }
    }

    pub fn key(self) -> &'static str {
        match self {
            Self::Front => "Ctrl 1",
            Self::Back => "Ctrl Shift 1",
            Self::Right => "Ctrl 3",
            Self::Left => "Ctrl Shift 3",
            Self::Top => "Ctrl 7",
            Self::Bottom => "Ctrl Shift 7",
        }
    }

    pub fn of(self, spec: &CameraSpec) -> CameraSpec {
        let (yaw, pitch) = match self {
            Self::Front => (0.0, 0.0),
            Self::Back => (180.0, 0.0),
            Self::Right => (90.0, 0.0),
            Self::Left => (-90.0, 0.0),
            Self::Top => (0.0, STEEPEST),
            Self::Bottom => (0.0, -STEEPEST),
        };
        CameraSpec { yaw, pitch, ..*spec }
    }
}

/// World units that one point of the screen covers at the depth of `at`.
pub fn world_per_point(camera: &Camera, view: Rect, at: DVec3) -> f64 {
    let side = f64::from(view.width().min(view.height()).max(1.0));
    match camera.projection {
        Projection::Orthographic => 2.0 * camera.radius / camera.zoom / side,
        Projection::Perspective { fov_y } => {
            let depth = (camera.eye() - at).dot(camera.to_eye()).max(1e-9);
            2.0 * depth * (0.5 * fov_y.to_radians()).tan() / side
        }
    }
}

/// From the world to the screen, for overlays.
#[derive(Debug, Clone, Copy)]
pub struct Projector {
    clip_from_world: glam::DMat4,
    view: Rect,
}

impl Projector {
    pub fn new(camera: &Camera, view: Rect) -> Self {
        // only the ratio of the sides counts
        let (w, h) = ((view.width() * 16.0).max(1.0) as u32, (view.height() * 16.0).max(1.0) as u32);
        Self { clip_from_world: camera.clip_from_world(w, h), view }
    }

    /// The place on the screen; `None` behind the eye.
    pub fn project(&self, p: DVec3) -> Option<eframe::egui::Pos2> {
        let c = self.clip_from_world * p.extend(1.0);
        if c.w <= 1e-9 {
            return None;
        }
        let (x, y) = (c.x / c.w, c.y / c.w);
        let at = self.view.min
            + Vec2::new((0.5 * (x + 1.0)) as f32 * self.view.width(), (0.5 * (1.0 - y)) as f32 * self.view.height());
        (at.x.is_finite() && at.y.is_finite()).then_some(at)
    }
}

/// Position in a view in the pixels of a picture of `size`.
pub fn pixels(at: Vec2, view: Rect, size: (u32, u32)) -> DVec2 {
    DVec2::new(
        f64::from(at.x / view.width().max(1.0)) * f64::from(size.0),
        f64::from(at.y / view.height().max(1.0)) * f64::from(size.1),
    )
}

fn wrap(degrees: f64) -> f64 {
    (degrees + 180.0).rem_euclid(360.0) - 180.0
}

#[cfg(test)]
mod tests {
    use eframe::egui::pos2;

    use super::*;

    fn camera(spec: &CameraSpec) -> Camera {
        spec.camera(crate::volume::Space::Lps, DVec3::new(3.0, -4.0, 5.0), 100.0)
    }

    fn view() -> Rect {
        Rect::from_min_max(pos2(40.0, 20.0), pos2(840.0, 620.0))
    }

    #[test]
    fn zoom_keeps_what_is_under_the_pointer() {
        for fov_y in [None, Some(28.0)] {
            let spec = CameraSpec { fov_y, ..CameraSpec::default() };
            let before = camera(&spec);
            let axes = before.axes();
            // a point in the plane of the target
            let p = before.target + axes.x_axis * 31.0 - axes.y_axis * 17.0;
            let at = Projector::new(&before, view()).project(p).unwrap();
            let after = camera(&zoom(&spec, &before, 1.7, Some(at - view().min), view()));
            let moved = Projector::new(&after, view()).project(p).unwrap();
            assert!((moved - at).length() < 0.02, "{at} {moved}");
        }
    }

    #[test]
    fn pan_follows_the_hand() {
        let spec = CameraSpec::default();
        let before = camera(&spec);
        let drag = Vec2::new(35.0, -22.0);
        let at = Projector::new(&before, view()).project(before.target).unwrap();
        let after = camera(&pan(&spec, &before, drag, view()));
        let moved = Projector::new(&after, view()).project(before.target).unwrap();
        assert!((moved - at - drag).length() < 0.3, "{at} {moved}");
    }

    #[test]
    fn orbit_stays_in_range() {
        let mut spec = CameraSpec::default();
        for _ in 0..50 {
            spec = orbit(&spec, Orbit::Turntable, Vec2::new(-333.0, 500.0), view());
        }
        assert!(spec.pitch <= STEEPEST && (-180.0..=180.0).contains(&spec.yaw));
    }

    #[test]
    fn a_free_orbit_goes_over_the_pole_without_a_jump() {
        let mut spec = CameraSpec { pitch: 80.0, ..CameraSpec::default() };
        let mut before = camera(&spec).axes();
        let mut least = f64::MAX;
        for _ in 0..60 {
            spec = orbit(&spec, Orbit::Free, Vec2::new(0.0, 20.0), view());
            let axes = camera(&spec).axes();
            // no axis of the view turns by more than the drag does
            for (a, b) in [(axes.x_axis, before.x_axis), (axes.y_axis, before.y_axis), (axes.z_axis, before.z_axis)] {
                least = least.min(a.dot(b));
            }
            before = axes;
        }
        let step: f64 = 20.0 / 600.0 * TURN;
        assert!(least > step.to_radians().cos() - 1e-9, "{least}");
        // on its head, what is in front still follows the hand
        let spec = CameraSpec { pitch: 170.0, ..CameraSpec::default() };
        let front = camera(&spec).to_eye() * 50.0 + camera(&spec).target;
        let seen = |spec: &CameraSpec| Projector::new(&camera(spec), view()).project(front).unwrap();
        assert!(seen(&orbit(&spec, Orbit::Free, Vec2::new(10.0, 0.0), view())).x > seen(&spec).x);
    }
}

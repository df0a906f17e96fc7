//! The camera in the hand: orbit, pan, zoom, standard views. Pure functions of a saved camera.

use eframe::egui::{Pos2, Rect, Vec2};
use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::render::{Camera, Projection};
use crate::scene::CameraSpec;
use crate::volume::Space;

/// Degrees for a drag over the smaller side of the view.
const TURN: f64 = 180.0;
const STEEPEST: f64 = 89.9;
/// Radius of the trackball, in parts of the view's smaller side.
const BALL: f32 = 0.4;

/// How a drag turns the view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Orbit {
    /// Up stays up.
    #[default]
    Turntable,
    /// As if the object were a ball under the hand; round its rim it rolls.
    #[serde(alias = "free")]
    Trackball,
}

impl Orbit {
    pub const ALL: [Self; 2] = [Self::Turntable, Self::Trackball];

    pub fn name(self) -> &'static str {
        match self {
            Self::Turntable => "Turntable",
            Self::Trackball => "Trackball",
        }
    }

    /// What it does.
    pub fn hint(self) -> &'static str {
        match self {
            Self::Turntable => "What is up stays up",
            Self::Trackball => {
                "The object turns as a ball under the hand; round its rim it rolls. Home makes it upright"
            }
        }
    }
}

/// A drag of `drag` that ended at `at`. Right drags the front to the right, down shows more of the top.
pub fn orbit(camera: &CameraSpec, how: Orbit, at: Pos2, drag: Vec2, view: Rect) -> CameraSpec {
    match how {
        Orbit::Turntable => turntable(&upright(camera), drag, view),
        Orbit::Trackball => trackball(camera, at - drag, at, view),
    }
}

fn turntable(camera: &CameraSpec, drag: Vec2, view: Rect) -> CameraSpec {
    let side = f64::from(view.width().min(view.height()).max(1.0));
    // along the world's up and across it, where a roll was left
    let (s, c) = camera.roll.to_radians().sin_cos();
    let (x, y) = (f64::from(drag.x), f64::from(drag.y));
    let (x, y) = (x * c + y * s, y * c - x * s);
    CameraSpec {
        yaw: wrap(camera.yaw - x / side * TURN),
        pitch: (camera.pitch + y / side * TURN).clamp(-STEEPEST, STEEPEST),
        ..*camera
    }
}

/// What lies on a ball round the middle follows the pointer. Outside the ball goes on as a hyperbola (Bell), so that a drag round
/// the rim rolls the picture.
fn trackball(camera: &CameraSpec, from: Pos2, to: Pos2, view: Rect) -> CameraSpec {
    let radius = BALL * view.width().min(view.height()).max(1.0);
    let on_ball = |p: Pos2| {
        let v = (p - view.center()) / radius;
        let (x, y) = (f64::from(v.x), f64::from(-v.y));
        let far = x * x + y * y;
        DVec3::new(x, y, if far < 0.5 { (1.0 - far).sqrt() } else { 0.5 / far.sqrt() })
    };
    let (p, q) = (on_ball(from), on_ball(to));
    let Some(axis) = p.cross(q).try_normalize() else { return *camera };
    let angle = 2.0 * (0.5 * (q - p).length()).min(1.0).asin();
    // the camera goes the other way
    turned(camera, DMat3::from_axis_angle(axis, -angle))
}

/// The camera turned in its own axes.
fn turned(camera: &CameraSpec, turn: DMat3) -> CameraSpec {
    let axes = camera.camera(Space::Unknown, DVec3::ZERO, 1.0).axes() * turn;
    let [yaw, pitch, roll] = Camera::angles_of(&axes, camera.yaw);
    CameraSpec { yaw, pitch, roll, ..*camera }
}

/// The same view with a pitch within -90 to 90: on its head by its roll.
fn upright(camera: &CameraSpec) -> CameraSpec {
    if camera.pitch.abs() <= 90.0 { *camera } else { turned(camera, DMat3::IDENTITY) }
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

/// Everything in view and upright, from where it is seen now.
pub fn frame(spec: &CameraSpec) -> CameraSpec {
    CameraSpec { zoom: 1.0, offset: DVec3::ZERO, roll: 0.0, ..upright(spec) }
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
        CameraSpec { yaw, pitch, roll: 0.0, ..*spec }
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
            spec = orbit(&spec, Orbit::Turntable, view().center(), Vec2::new(-333.0, 500.0), view());
        }
        assert!(spec.pitch <= STEEPEST && (-180.0..=180.0).contains(&spec.yaw) && spec.roll == 0.0);
    }

    /// The largest angle between the axes of two views, in degrees.
    fn apart(a: &CameraSpec, b: &CameraSpec) -> f64 {
        let (a, b) = (camera(a).axes(), camera(b).axes());
        (0..3).map(|i| a.col(i).angle_between(b.col(i)).to_degrees()).fold(0.0, f64::max)
    }

    #[test]
    fn a_trackball_follows_the_hand_in_any_position() {
        let fov_y = None;
        // from the front, over a pole, rolled, and on its head as older files have it
        for (yaw, pitch, roll) in [(20.0, 10.0, 0.0), (0.0, 89.99, 0.0), (-130.0, -60.0, 75.0), (40.0, 170.0, 0.0)] {
            let spec = CameraSpec { yaw, pitch, roll, fov_y, zoom: 1.0, offset: DVec3::ZERO };
            let seen = camera(&spec);
            let (axes, radius) = (seen.axes(), 100.0 * 2.0 * f64::from(BALL));
            // a point of the ball, and where it is seen
            let on_ball = |x: f64, y: f64| seen.target + axes * DVec3::new(x, y, (1.0 - x * x - y * y).sqrt()) * radius;
            let at = |spec: &CameraSpec, p: DVec3| Projector::new(&camera(spec), view()).project(p).unwrap();
            let p = on_ball(0.3, -0.2);
            let from = at(&spec, p);
            for way in [Vec2::new(60.0, 0.0), Vec2::new(0.0, 40.0), Vec2::new(-25.0, -35.0)] {
                let after = orbit(&spec, Orbit::Trackball, from + way, way, view());
                assert!((at(&after, p) - from - way).length() < 0.2, "{spec:?}: {}", at(&after, p) - from);
                assert!(after.pitch.abs() <= 90.0);
                let back = orbit(&after, Orbit::Trackball, from, -way, view());
                assert!(apart(&back, &spec) < 1e-3, "{spec:?}");
            }
        }
    }

    #[test]
    fn a_drag_round_the_rim_rolls_and_home_makes_upright() {
        let start = CameraSpec { yaw: 30.0, pitch: 20.0, ..CameraSpec::default() };
        let mut spec = start;
        let place = |degrees: f32| view().center() + Vec2::angled(degrees.to_radians()) * 290.0;
        // the screen's y points down: this is clockwise
        for degrees in 0..30 {
            let (from, to) = (place(degrees as f32), place(degrees as f32 + 1.0));
            spec = orbit(&spec, Orbit::Trackball, to, to - from, view());
        }
        // on the hyperbola a degree of the pointer is nearly one of the picture
        assert!((20.0..35.0).contains(&spec.roll), "{spec:?}");
        let before = camera(&start).to_eye();
        assert!(camera(&spec).to_eye().angle_between(before).to_degrees() < 15.0);
        // a turntable keeps the roll, and what is in front follows the hand
        let front = camera(&spec).target + camera(&spec).to_eye() * 50.0;
        let seen = |spec: &CameraSpec| Projector::new(&camera(spec), view()).project(front).unwrap();
        for way in [Vec2::new(9.0, 0.0), Vec2::new(0.0, 9.0)] {
            let after = orbit(&spec, Orbit::Turntable, view().center(), way, view());
            let moved = seen(&after) - seen(&spec);
            assert!(after.roll == spec.roll && moved.dot(way) > 0.0 && moved.normalized().dot(way.normalized()) > 0.9);
        }
        let home = frame(&spec);
        assert!(home.roll == 0.0 && home.yaw == spec.yaw && home.pitch == spec.pitch);
        for standard in Standard::ALL {
            assert_eq!(standard.of(&spec).roll, 0.0);
        }
        // on its head as older files have it: the same view first, and upright at home
        let head = CameraSpec { pitch: 170.0, ..start };
        let still = orbit(&head, Orbit::Turntable, view().center(), Vec2::ZERO, view());
        assert!(apart(&still, &head) < 1e-6 && still.pitch.abs() < 90.0);
        assert!(camera(&frame(&head)).axes().y_axis.z > 0.0);
    }

    #[test]
    fn a_trackball_goes_over_the_pole_without_a_jump() {
        let mut spec = CameraSpec { pitch: 80.0, ..CameraSpec::default() };
        for _ in 0..60 {
            let before = spec;
            spec = orbit(&spec, Orbit::Trackball, view().center(), Vec2::new(0.0, 8.0), view());
            let turn = f64::from(8.0 / (BALL * 600.0)).to_degrees();
            assert!(apart(&spec, &before) < 1.05 * turn, "{before:?} {spec:?}");
        }
        // over the top and past what was behind
        assert!(apart(&spec, &CameraSpec::default()) > 90.0);
    }

    #[test]
    fn settings_of_before_are_read() {
        let orbit: Orbit = serde_json::from_str("\"free\"").unwrap();
        assert_eq!(orbit, Orbit::Trackball);
        let spec: CameraSpec = serde_json::from_str(r#"{"yaw": 12.0, "pitch": 3.0}"#).unwrap();
        assert_eq!((spec.yaw, spec.pitch, spec.roll), (12.0, 3.0, 0.0));
        assert!(!serde_json::to_string(&spec).unwrap().contains("roll"));
    }
}

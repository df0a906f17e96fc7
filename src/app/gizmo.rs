//! Handles of a deformation: where they lie, and what the deformation is once one was moved. Nothing here knows of windows.

use glam::DVec3;

use crate::deform::{Action, Brush, Deformer, DisplacementVolume, Extent, Grab, Lattice};
use crate::math::{OrientedBox, PlaneFrame};
use crate::render::Camera;

/// What can be taken hold of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Grip {
    /// Moves the whole of it.
    Point,
    /// Changes the vector.
    Tip,
    /// One of the box's half-widths; 2 is along the vector.
    Extent(usize),
    Radius,
    /// How much a ball grows or is drawn together.
    Amount,
    /// Of a twist.
    Angle,
}

/// A grip with its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Handle {
    pub grip: Grip,
    /// In the world.
    pub at: DVec3,
    /// The only direction it moves in, of unit length; none: anywhere.
    pub along: Option<DVec3>,
}

/// Nothing shrinks to less than this part of what it was in one drag.
const LEAST: f64 = 0.05;
/// Where on the ball's radius the handle of a twist lies.
const TWIST_AT: f64 = 0.7;

impl Grip {
    pub fn name(self) -> &'static str {
        match self {
            Self::Point => "Point",
            Self::Tip => "Tip",
            Self::Extent(0) => "Half-width u",
            Self::Extent(1) => "Half-width v",
            Self::Extent(_) => "Length",
            Self::Radius => "Radius",
            Self::Amount => "Amount",
            Self::Angle => "Angle",
        }
    }

    /// What dragging it does.
    pub fn hint(self) -> &'static str {
        match self {
            Self::Point => "Drag to move it",
            Self::Tip => "Drag to pull farther or elsewhere",
            Self::Extent(_) | Self::Radius => "Drag to reach farther or less far",
            Self::Amount => "Drag for more or less",
            Self::Angle => "Drag round for the angle",
        }
    }
}

/// The handles of a deformer as this camera sees it: those of balls lie beside them.
pub fn handles(deformer: &Deformer, camera: &Camera) -> Vec<Handle> {
    let axes = camera.axes();
    let free = |grip, at| Handle { grip, at, along: None };
    let on = |grip, from: DVec3, along: DVec3, far: f64| Handle { grip, at: from + along * far, along: Some(along) };
    match deformer {
        Deformer::Displacement(d) => {
            let (peak, frame, e) = (d.displaced(), d.axes(), d.extent());
            vec![
                on(Grip::Extent(0), peak, frame.x_axis, e.u),
                on(Grip::Extent(1), peak, frame.y_axis, e.v),
                on(Grip::Extent(2), peak, frame.z_axis, e.length * 2.0 / 3.0),
                free(Grip::Point, d.point()),
                free(Grip::Tip, peak),
            ]
        }
        Deformer::Grab(g) => vec![
            on(Grip::Radius, g.displaced(), axes.x_axis, g.radius()),
            free(Grip::Point, g.center()),
            free(Grip::Tip, g.displaced()),
        ],
        Deformer::Brush(b) => {
            let how = match b.action() {
                Action::Inflate { amount } | Action::Pinch { amount, .. } => {
                    on(Grip::Amount, b.center(), axes.y_axis, amount * b.radius())
                }
                Action::Twist { axis, degrees } => free(Grip::Angle, turned(b, axis, degrees)),
            };
            vec![on(Grip::Radius, b.center(), axes.x_axis, b.radius()), free(Grip::Point, b.center()), how]
        }
        Deformer::Lattice(l) => {
            let b = l.support();
            let side = |k: usize| on(Grip::Extent(k), b.center, b.axes.col(k), b.half[k]);
            vec![side(0), side(1), side(2), free(Grip::Point, b.center)]
        }
    }
}

/// Where the handle of a twist by so many degrees lies.
fn turned(b: &Brush, axis: DVec3, degrees: f64) -> DVec3 {
    let Some(frame) = PlaneFrame::across(axis) else { return b.center() };
    let (s, c) = degrees.to_radians().sin_cos();
    b.center() + (frame.e1 * c + frame.e2 * s) * (TWIST_AT * b.radius())
}

/// The deformer after a handle was moved by `shift` (in the world); `None` where that makes none.
///
/// `last` is what the drag has made so far: an angle goes on from there, over any number of turns.
pub fn moved(deformer: &Deformer, handle: &Handle, shift: DVec3, last: &Deformer) -> Option<Deformer> {
    let far = handle.along.map_or(0.0, |a| a.dot(shift));
    // a length after the drag
    let longer = |l: f64, by: f64| (l + by).max(LEAST * l);
    match (deformer, handle.grip) {
        (Deformer::Displacement(d), grip) => {
            let (mut point, mut vector, mut e) = (d.point(), d.vector(), d.extent());
            match grip {
                Grip::Point => point += shift,
                Grip::Tip => vector += shift,
                Grip::Extent(0) => e.u = longer(e.u, far),
                Grip::Extent(1) => e.v = longer(e.v, far),
                // two thirds of the length lie beyond the peak
                _ => e.length = longer(e.length, 1.5 * far),
            }
            // the box keeps its side where it can
            let across = Some(d.axes().x_axis);
            let extent = Extent { ..e };
            DisplacementVolume::new(point, vector, extent, across).ok().map(Deformer::Displacement)
        }
        (Deformer::Grab(g), grip) => {
            let (mut center, mut vector, mut radius) = (g.center(), g.vector(), g.radius());
            match grip {
                Grip::Point => center += shift,
                Grip::Tip => vector += shift,
                _ => radius = longer(radius, far),
            }
            Grab::new(center, vector, radius, g.falloff()).ok().map(Deformer::Grab)
        }
        (Deformer::Brush(b), grip) => {
            let (mut center, mut radius, mut action) = (b.center(), b.radius(), b.action());
            match (grip, &mut action) {
                (Grip::Point, _) => center += shift,
                (Grip::Radius, _) => radius = longer(radius, far),
                (_, Action::Inflate { amount } | Action::Pinch { amount, .. }) => *amount += far / radius,
                (_, Action::Twist { axis, degrees }) => {
                    let frame = PlaneFrame::across(*axis)?;
                    let angle = |p: DVec3| {
                        let p = p - center;
                        p.dot(frame.e2).atan2(p.dot(frame.e1)).to_degrees()
                    };
                    let to = *degrees + angle(handle.at + shift) - angle(handle.at);
                    let before = match last {
                        Deformer::Brush(l) => match l.action() {
                            Action::Twist { degrees, .. } => degrees,
                            _ => *degrees,
                        },
                        _ => *degrees,
                    };
                    *degrees = (to + 360.0 * ((before - to) / 360.0).round()).clamp(-720.0, 720.0);
                }
            }
            Brush::new(center, radius, b.falloff(), action).ok().map(Deformer::Brush)
        }
        (Deformer::Lattice(l), grip) => {
            let mut b = l.support();
            match grip {
                Grip::Point => b.center += shift,
                Grip::Extent(k) if k < 3 => b.half[k] = longer(b.half[k], far),
                _ => return None,
            }
            resized(l, b).map(Deformer::Lattice)
        }
    }
}

/// The same handles over another box.
fn resized(l: &Lattice, support: OrientedBox) -> Option<Lattice> {
    Lattice::new(support, l.dims()).ok()?.with_handles(l.handles().to_vec()).ok()
}

/// What a handle stands for, as text.
pub fn reading(deformer: &Deformer, grip: Grip, unit: &str) -> String {
    let length = |l: f64| format!("{l:.1} {unit}");
    match (deformer, grip) {
        (Deformer::Displacement(d), Grip::Tip) => length(d.vector().length()),
        (Deformer::Grab(g), Grip::Tip) => length(g.vector().length()),
        (Deformer::Displacement(d), Grip::Extent(k)) => {
            let e = d.extent();
            length([e.u, e.v, e.length][k.min(2)])
        }
        (Deformer::Lattice(l), Grip::Extent(k)) => length(l.support().half[k.min(2)]),
        (Deformer::Grab(g), Grip::Radius) => length(g.radius()),
        (Deformer::Brush(b), Grip::Radius) => length(b.radius()),
        (Deformer::Brush(b), Grip::Amount | Grip::Angle) => match b.action() {
            Action::Inflate { amount } | Action::Pinch { amount, .. } => format!("{amount:.2}"),
            Action::Twist { degrees, .. } => format!("{degrees:.0}°"),
        },
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deform::Falloff;
    use crate::render::Projection;

    fn camera() -> Camera {
        Camera {
            target: DVec3::ZERO,
            yaw: 25.0,
            pitch: 15.0,
            roll: 0.0,
            radius: 100.0,
            zoom: 1.0,
            projection: Projection::Orthographic,
        }
    }

    fn all() -> Vec<Deformer> {
        let (p, v) = (DVec3::new(3.0, -2.0, 5.0), DVec3::new(4.0, 1.0, -2.0));
        let extent = Extent { u: 20.0, v: 25.0, length: 70.0 };
        let axis = DVec3::new(0.2, 0.3, 1.0);
        let brush = |action| Deformer::Brush(Brush::new(p, 18.0, Falloff::Smooth, action).unwrap());
        let support = OrientedBox { center: p, axes: glam::DMat3::IDENTITY, half: DVec3::new(10.0, 20.0, 30.0) };
        vec![
            Deformer::Displacement(DisplacementVolume::new(p, v, extent, None).unwrap()),
            Deformer::Grab(Grab::new(p, v, 30.0, Falloff::Smooth).unwrap()),
            brush(Action::Inflate { amount: 0.3 }),
            brush(Action::Pinch { axis, amount: -0.2 }),
            brush(Action::Twist { axis, degrees: 70.0 }),
            Deformer::Lattice(Lattice::new(support, [3, 4, 5]).unwrap()),
        ]
    }

    fn at(d: &Deformer, grip: Grip) -> Handle {
        *handles(d, &camera()).iter().find(|h| h.grip == grip).unwrap()
    }

    #[test]
    fn a_handle_goes_where_it_is_dragged_and_back() {
        for d in all() {
            for h in handles(&d, &camera()) {
                // what moves along a line is dragged along it, an angle on its circle
                let shift = match (h.along, h.grip) {
                    (Some(a), _) => a * 3.0,
                    (None, Grip::Angle) => {
                        let Deformer::Brush(b) = &d else { panic!() };
                        let Action::Twist { axis, .. } = b.action() else { panic!() };
                        turned(b, axis, 110.0) - h.at
                    }
                    _ => DVec3::new(1.0, -2.0, 0.5),
                };
                let to = moved(&d, &h, shift, &d).unwrap();
                let there = at(&to, h.grip);
                assert!((there.at - h.at - shift).length() < 1e-9, "{:?} of {d:?}", h.grip);
                assert!(to != d, "{:?} of {d:?}", h.grip);
                let back = at(&moved(&to, &there, -shift, &to).unwrap(), h.grip);
                assert!((back.at - h.at).length() < 1e-9, "{:?} of {d:?}", h.grip);
            }
        }
    }

    #[test]
    fn a_twist_goes_on_over_whole_turns() {
        let d = all().remove(4);
        let Deformer::Brush(b) = &d else { panic!() };
        let Action::Twist { axis, .. } = b.action() else { panic!() };
        let h = at(&d, Grip::Angle);
        let mut last = d.clone();
        for degrees in (70..600).step_by(20) {
            let shift = turned(b, axis, f64::from(degrees)) - h.at;
            last = moved(&d, &h, shift, &last).unwrap();
            let Deformer::Brush(now) = &last else { panic!() };
            let Action::Twist { degrees: got, .. } = now.action() else { panic!() };
            assert!((got - f64::from(degrees)).abs() < 1e-6, "{got} for {degrees}");
        }
    }

    #[test]
    fn nothing_is_turned_inside_out() {
        for d in all() {
            for h in handles(&d, &camera()) {
                if let Some(a) = h.along
                    && matches!(h.grip, Grip::Extent(_) | Grip::Radius)
                {
                    let to = moved(&d, &h, a * -1e4, &d).unwrap();
                    let there = at(&to, h.grip);
                    let middle = at(
                        &d,
                        if matches!(d, Deformer::Lattice(_) | Deformer::Brush(_)) { Grip::Point } else { Grip::Tip },
                    );
                    assert!((there.at - middle.at).dot(a) > 0.0, "{:?} of {d:?}", h.grip);
                }
            }
        }
    }
}

//! Tools: from what the hand does to deformations. Nothing here knows of windows.

use eframe::egui::{Pos2, Vec2};
use glam::DVec3;

use crate::deform::{Action, Brush, DeformError, Deformation, Deformer, DisplacementVolume, Falloff, Grab, Limit};
use crate::evaluate::masked::{ValueMask, masked};
use crate::evaluate::pick::Hit;
use crate::render::Camera;
use crate::scene::Document;

/// What the left button does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tool {
    #[default]
    Grab,
    Push,
    Pinch,
    Inflate,
    Twist,
    Smooth,
    Lattice,
    Place,
    Pick,
    Measure,
}

impl Tool {
    pub const ALL: [Self; 10] = [
        Self::Grab,
        Self::Push,
        Self::Pinch,
        Self::Inflate,
        Self::Twist,
        Self::Smooth,
        Self::Lattice,
        Self::Place,
        Self::Pick,
        Self::Measure,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Grab => "Grab",
            Self::Push => "Push",
            Self::Pinch => "Pinch",
            Self::Inflate => "Inflate",
            Self::Twist => "Twist",
            Self::Smooth => "Smooth",
            Self::Lattice => "Lattice",
            Self::Place => "Place",
            Self::Pick => "Pick value",
            Self::Measure => "Measure",
        }
    }

    pub fn key(self) -> &'static str {
        match self {
            Self::Grab => "G",
            Self::Push => "D",
            Self::Pinch => "P",
            Self::Inflate => "I",
            Self::Twist => "T",
            Self::Smooth => "S",
            Self::Lattice => "L",
            Self::Place => "O",
            Self::Pick => "V",
            Self::Measure => "R",
        }
    }

    /// What the mouse does now.
    pub fn hint(self) -> &'static str {
        match self {
            Self::Grab => "Drag the object to pull it; Shift pulls along its normal",
            Self::Push => "Drag to press in; Ctrl pulls out",
            Self::Pinch => "Drag to draw together; Ctrl spreads",
            Self::Inflate => "Drag to inflate; Ctrl deflates",
            Self::Twist => "Drag left or right to twist round the line of sight",
            Self::Smooth => "Drag over strokes to let them give way",
            Self::Lattice => "Drag a handle of the lattice",
            Self::Place => "In the texture cube: arrows move the shape, rings turn it, boxes scale it",
            Self::Pick => "Click the object to take its value as isovalue",
            Self::Measure => "Click two points to measure their distance",
        }
    }

    /// Whether it works with a ball on the surface.
    pub fn is_brush(self) -> bool {
        matches!(self, Self::Grab | Self::Push | Self::Pinch | Self::Inflate | Self::Twist | Self::Smooth)
    }
}

/// How a grab fades.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shape {
    /// The paper's displacement volume: a box along the pull.
    #[default]
    Volume,
    Smooth,
    Pointed,
    Core,
}

impl Shape {
    pub const ALL: [Self; 4] = [Self::Volume, Self::Smooth, Self::Pointed, Self::Core];

    pub fn name(self) -> &'static str {
        match self {
            Self::Volume => "Displacement volume",
            Self::Smooth => "Smooth ball",
            Self::Pointed => "Pointed ball",
            Self::Core => "Ball with a core",
        }
    }

    fn falloff(self) -> Falloff {
        match self {
            Self::Volume | Self::Smooth => Falloff::Smooth,
            Self::Pointed => Falloff::Spline,
            Self::Core => Falloff::Core(0.5),
        }
    }
}

/// Settings of the brush.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hand {
    pub tool: Tool,
    /// World units.
    pub radius: f64,
    /// 0 to 1.
    pub strength: f64,
    pub shape: Shape,
    /// Mirror across the middle of the volume, per world axis.
    pub mirror: [bool; 3],
    /// A grab moves the object's outline too, where that is a mesh of its own.
    pub moves_shape: bool,
    /// Only material with real values from the first to the second follows.
    pub mask: Option<[f64; 2]>,
}

impl Hand {
    pub const LEAST_RADIUS: f64 = 1e-3;

    /// A brush that suits an object of this radius.
    pub fn for_size(radius: f64) -> Self {
        Self {
            tool: Tool::Grab,
            radius: 0.28 * radius,
            strength: 1.0,
            shape: Shape::Volume,
            mirror: [false; 3],
            moves_shape: true,
            mask: None,
        }
    }
}

/// A drag under way.
#[derive(Debug, Clone)]
pub struct Stroke {
    pub hit: Hit,
    /// World units that a point of the screen covers at the hit.
    pub scale: f64,
    pub camera: Camera,
    /// Middle of the volume, for mirror images.
    pub center: DVec3,
    /// Where the button went down.
    pub from: Pos2,
    /// The whole way since then, in points.
    pub drag: Vec2,
    /// The other way round.
    pub inverse: bool,
    /// Along the normal.
    pub along: bool,
}

/// What a stroke makes.
#[derive(Debug, Clone, Default)]
pub struct Made {
    pub items: Vec<Deformation>,
    /// World units of the pull, as asked for and as kept.
    pub asked: f64,
    pub kept: f64,
    /// From here to there, for the arrow.
    pub arrow: Option<(DVec3, DVec3)>,
}

impl Stroke {
    /// The drag in the plane of the view.
    fn world(&self) -> DVec3 {
        let axes = self.camera.axes();
        (axes.x_axis * f64::from(self.drag.x) - axes.y_axis * f64::from(self.drag.y)) * self.scale
    }

    /// The deformations of the stroke so far; none if it does nothing yet. With a mask, only what it holds follows.
    ///
    /// # Errors
    /// If the numbers make no deformation.
    pub fn make(&self, hand: &Hand, document: &Document, mask: Option<&ValueMask>) -> Result<Made, DeformError> {
        let number = document.stack.items.len() + 1;
        let length = f64::from(self.drag.length()) * self.scale;
        if length < 1e-3 * hand.radius {
            return Ok(Made::default());
        }
        let signed = if self.inverse { -1.0 } else { 1.0 };
        // how far the hand went, in radii, up to one
        let far = (length / hand.radius).min(1.0) * hand.strength;
        let falloff = hand.shape.falloff();
        let point = self.hit.point;
        let mut arrow = None;
        let deformer = match hand.tool {
            Tool::Grab => {
                let pull =
                    if self.along { self.hit.normal * (-f64::from(self.drag.y) * self.scale) } else { self.world() }
                        * hand.strength;
                if pull.length() < 1e-3 * hand.radius {
                    return Ok(Made::default());
                }
                arrow = Some((point, pull));
                match hand.shape {
                    Shape::Volume => Deformer::Displacement(DisplacementVolume::from_drag(point, pull, hand.radius)?),
                    _ => Deformer::Grab(Grab::new(point, pull, hand.radius, falloff)?),
                }
            }
            Tool::Push => {
                let pull = self.hit.normal * (-signed * far * 0.5 * hand.radius);
                arrow = Some((point, pull));
                Deformer::Grab(Grab::new(point, pull, hand.radius, falloff)?)
            }
            Tool::Pinch => Deformer::Brush(Brush::new(
                point,
                hand.radius,
                falloff,
                Action::Pinch { axis: self.hit.normal, amount: signed * far },
            )?),
            Tool::Inflate => Deformer::Brush(Brush::new(
                point,
                hand.radius,
                falloff,
                Action::Inflate { amount: signed * 0.8 * far },
            )?),
            Tool::Twist => {
                // a radius of the hand is a right angle
                let degrees = f64::from(self.drag.x) * self.scale / hand.radius * 90.0 * hand.strength;
                Deformer::Brush(Brush::new(
                    point,
                    hand.radius,
                    falloff,
                    // to the right is clockwise for the eye
                    Action::Twist { axis: self.camera.to_eye(), degrees: -degrees.clamp(-720.0, 720.0) },
                )?)
            }
            Tool::Smooth | Tool::Lattice | Tool::Place | Tool::Pick | Tool::Measure => return Ok(Made::default()),
        };
        let limit = if document.allow_folds { Limit::LetThrough } else { Limit::default() };
        let mut item = Deformation::new(format!("{} {number}", hand.tool.name()), deformer);
        item.moves_shape = hand.moves_shape && hand.tool == Tool::Grab;
        let mut items = vec![item];
        for (on, axis) in hand.mirror.iter().zip([DVec3::X, DVec3::Y, DVec3::Z]) {
            if *on {
                let images: Result<Vec<_>, _> = items.iter().map(|i| i.mirrored(self.center, axis)).collect();
                items.extend(images?);
            }
        }
        if let Some(mask) = mask {
            // each image by what is there
            let before = document.stack.prepared();
            let mut held = Vec::with_capacity(items.len());
            for mut item in items {
                if let Some(deformer) = masked(&item.deformer, &before, mask)? {
                    item.deformer = deformer;
                    item.name.push_str(", masked");
                    held.push(item);
                }
            }
            items = held;
        }
        let (mut asked, mut part) = (0.0_f64, 1.0_f64);
        for item in &mut items {
            let limited = item.deformer.limited(limit);
            asked = asked.max(limited.asked);
            part = part.min(if limited.asked > 0.0 { limited.kept / limited.asked } else { 1.0 });
            item.deformer = limited.deformer;
        }
        Ok(Made { items, asked, kept: asked * part, arrow: arrow.map(|(p, v)| (p, p + v * part)) })
    }
}

/// The strokes under a ball give way: each loses a part of its effect, the more the nearer its middle is.
///
/// `amount` is 0 to 1. None if no stroke is near.
pub fn smoothed(document: &Document, point: DVec3, radius: f64, amount: f64) -> Option<Document> {
    let mut changed = document.clone();
    let mut any = false;
    for item in &mut changed.stack.items {
        if !item.enabled {
            continue;
        }
        let support = item.deformer.support();
        let local = support.axes.transpose() * (point - support.center);
        // distance from the box, then falloff as a brush has it
        let beyond = (local.abs() - support.half * 0.5).max(DVec3::ZERO).length();
        let t = beyond / radius;
        if t < 1.0 {
            let weight = (1.0 - t * t).powi(3);
            item.opacity = (item.opacity * (1.0 - amount * weight)).max(0.0);
            any = true;
        }
    }
    any.then_some(changed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::BackwardMap;
    use crate::scene::VolumeSource;

    fn document() -> Document {
        Document::new(VolumeSource::Phantom { name: "head".to_owned(), size: 32 })
    }

    fn stroke(drag: Vec2) -> Stroke {
        let camera = Camera {
            target: DVec3::ZERO,
            yaw: 20.0,
            pitch: 10.0,
            roll: 0.0,
            radius: 100.0,
            zoom: 1.0,
            projection: crate::render::Projection::Orthographic,
        };
        let point = DVec3::new(3.0, 4.0, 5.0);
        let hit = Hit { point, rest: point, voxel: point, value: 1.0, normal: camera.to_eye() };
        Stroke { hit, scale: 0.5, camera, center: DVec3::ZERO, from: Pos2::ZERO, drag, inverse: false, along: false }
    }

    #[test]
    fn a_grab_brings_what_was_taken_to_the_hand() {
        let hand = Hand { radius: 40.0, ..Hand::for_size(100.0) };
        for shape in Shape::ALL {
            let hand = Hand { shape, ..hand };
            let s = stroke(Vec2::new(12.0, -9.0));
            let made = s.make(&hand, &document(), None).unwrap();
            assert_eq!(made.items.len(), 1);
            let (from, to) = made.arrow.unwrap();
            assert!((made.items[0].deformer.backward(to) - from).length() < 1e-9, "{shape:?}");
            assert!((made.kept - 7.5).abs() < 1e-9 && made.kept == made.asked, "{shape:?}");
        }
    }

    #[test]
    fn no_stroke_folds_and_mirrors_double() {
        for tool in Tool::ALL {
            let hand = Hand { tool, radius: 20.0, mirror: [true, false, true], ..Hand::for_size(100.0) };
            let made = stroke(Vec2::new(300.0, -500.0)).make(&hand, &document(), None).unwrap();
            assert!(made.items.iter().all(|i| i.deformer.steepness() < 1.0), "{tool:?}");
            assert!(made.items.is_empty() || made.items.len() == 4, "{tool:?}");
        }
        assert!(stroke(Vec2::ZERO).make(&Hand::for_size(10.0), &document(), None).unwrap().items.is_empty());
    }

    #[test]
    fn smoothing_weakens_what_is_near() {
        let mut d = document();
        let near = stroke(Vec2::new(20.0, 0.0)).make(&Hand::for_size(100.0), &d, None).unwrap();
        d.stack.items.extend(near.items);
        let point = DVec3::new(3.0, 4.0, 5.0);
        let after = smoothed(&d, point, 30.0, 0.5).unwrap();
        assert!(after.stack.items[0].opacity < 0.6);
        assert!(smoothed(&d, DVec3::splat(1e4), 30.0, 0.5).is_none());
    }
}

use std::borrow::Cow;

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Deserializer, Serialize};

use super::brush_kernel::BrushKernel;
use super::error::check_range;
use super::kernel::Kernel;
use super::lattice_kernel::LatticeKernel;
use super::{Brush, DeformError, DisplacementVolume, Grab, Lattice, Limit, Limited, Prepared};
use crate::math::{BackwardMap, OrientedBox};
use crate::mesh::TriMesh;

/// One of the tools.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "tool", rename_all = "lowercase")]
pub enum Deformer {
    Displacement(DisplacementVolume),
    Grab(Grab),
    Brush(Brush),
    Lattice(Lattice),
}

impl Deformer {
    /// The box outside which nothing moves.
    pub fn support(&self) -> OrientedBox {
        match self {
            Self::Displacement(d) => d.support(),
            Self::Grab(g) => g.support(),
            Self::Brush(b) => b.support(),
            Self::Lattice(l) => l.support(),
        }
    }

    /// How close to folding: below 1 the map is injective; for all but lattices it folds at 1 and above.
    pub fn steepness(&self) -> f64 {
        match self {
            Self::Displacement(d) => d.steepness(),
            Self::Grab(g) => g.steepness(),
            Self::Brush(b) => b.steepness(),
            Self::Lattice(l) => l.steepness(),
        }
    }

    /// The size of the smallest feature of the field, in world units: a polynomial piece of its splines, the width of a slope, a
    /// radian of a twist.
    pub fn feature_size(&self) -> f64 {
        match self {
            Self::Displacement(d) => {
                let e = d.extent();
                // every piece of a bump is two thirds of its half-width; that of the rise is a third of the length
                e.u.min(e.v).min(e.length / 3.0) * 2.0 / 3.0
            }
            Self::Grab(g) => g.radius() / g.falloff().steepest(),
            Self::Brush(b) => b.feature_size(),
            Self::Lattice(l) => l.step().min_element(),
        }
    }

    /// The same, shortened if the limit says so.
    pub fn limited(&self, limit: Limit) -> Limited<Self> {
        match (limit, self) {
            (Limit::Clamp { margin }, Self::Displacement(d)) => d.clamp_to_injective(margin).map(Self::Displacement),
            (Limit::Clamp { margin }, Self::Grab(g)) => g.clamp_to_injective(margin).map(Self::Grab),
            (Limit::Clamp { margin }, Self::Brush(b)) => b.clamp_to_injective(margin).map(Self::Brush),
            (Limit::Clamp { margin }, Self::Lattice(l)) => l.clamp_to_injective(margin).map(Self::Lattice),
            (Limit::LetThrough, _) => {
                let length = match self {
                    Self::Displacement(d) => d.vector().length(),
                    Self::Grab(g) => g.vector().length(),
                    Self::Brush(b) => b.reach(),
                    Self::Lattice(l) => l.largest_vector(),
                };
                Limited { deformer: self.clone(), asked: length, kept: length }
            }
        }
    }

    /// The same with its vector (a lattice: all of them; a brush: its amount or angle) times `scale`; `None` if nothing is
    /// left to do.
    pub fn scaled(&self, scale: f64) -> Option<Self> {
        if scale == 0.0 {
            return None;
        }
        match self {
            Self::Displacement(d) => d.scaled(scale).ok().map(Self::Displacement),
            Self::Grab(g) => g.scaled(scale).ok().map(Self::Grab),
            Self::Brush(b) => b.scaled(scale).ok().map(Self::Brush),
            Self::Lattice(l) => l.scaled(scale).ok().map(Self::Lattice),
        }
    }

    /// The same on the other side of the plane through `origin` across `normal`.
    ///
    /// # Errors
    /// If the normal has no direction.
    pub fn mirrored(&self, origin: DVec3, normal: DVec3) -> Result<Self, DeformError> {
        Ok(match self {
            Self::Displacement(d) => Self::Displacement(d.mirrored(origin, normal)?),
            Self::Grab(g) => Self::Grab(g.mirrored(origin, normal)?),
            Self::Brush(b) => Self::Brush(b.mirrored(origin, normal)?),
            Self::Lattice(l) => Self::Lattice(l.mirrored(origin, normal)?),
        })
    }
}

/// Undoes one displacement at a point. Everything is worked out anew: for many points use [`Stack::prepared`].
impl BackwardMap for Deformer {
    fn backward(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Displacement(d) => p - d.vector() * d.kernel(DVec3::ZERO).value(p.to_array()),
            Self::Grab(g) => p - g.vector() * g.kernel(DVec3::ZERO).value(p.to_array()),
            Self::Brush(b) => p - DVec3::from(b.kernel(DVec3::ZERO).displacement(p.to_array())),
            Self::Lattice(l) => p - DVec3::from(l.kernel().displacement(p.to_array())),
        }
    }

    fn backward_with_jacobian(&self, p: DVec3) -> (DVec3, DMat3) {
        let along = |d: DVec3, (v, g): (f64, [f64; 3])| (d * v, outer(d, DVec3::from(g)));
        let (displacement, gradient) = match self {
            Self::Displacement(d) => along(d.vector(), d.kernel(DVec3::ZERO).value_and_gradient(p.to_array())),
            Self::Grab(g) => along(g.vector(), g.kernel(DVec3::ZERO).value_and_gradient(p.to_array())),
            Self::Brush(b) => brushed(&b.kernel(DVec3::ZERO), p),
            Self::Lattice(l) => with_gradient(&l.kernel(), p),
        };
        (p - displacement, DMat3::IDENTITY - gradient)
    }

    fn supports(&self) -> Vec<OrientedBox> {
        vec![self.support()]
    }
}

/// `a b^T`.
pub(super) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// A lattice's displacement and its derivative.
pub(super) fn with_gradient(kernel: &LatticeKernel<f64>, p: DVec3) -> (DVec3, DMat3) {
    let (d, gradient) = kernel.displacement_with_gradient(p.to_array());
    (d.into(), DMat3::from_cols_array_2d(&gradient))
}

/// The same of a brush.
pub(super) fn brushed(kernel: &BrushKernel<f64>, p: DVec3) -> (DVec3, DMat3) {
    let (d, gradient) = kernel.displacement_with_gradient(p.to_array());
    (d.into(), DMat3::from_cols_array_2d(&gradient).transpose())
}

/// A deformer in a document.
///
/// An opacity of 1 is not written, so that files from before there was one read and are written as they were.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Deformation {
    #[serde(default)]
    pub name: String,
    pub deformer: Deformer,
    /// The mesh moves along, so the object's shape changes too.
    #[serde(default)]
    pub moves_shape: bool,
    #[serde(default = "enabled")]
    pub enabled: bool,
    /// How much of it takes effect, 0 to 1: the deformer is [scaled](Deformer::scaled) by it.
    #[serde(default = "whole", skip_serializing_if = "is_whole", deserialize_with = "opacity")]
    pub opacity: f64,
}

fn enabled() -> bool {
    true
}

fn whole() -> f64 {
    1.0
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands over a reference")]
fn is_whole(opacity: &f64) -> bool {
    *opacity == 1.0
}

fn opacity<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    let opacity = f64::deserialize(from)?;
    check_range("opacity", opacity, 0.0, 1.0).map_err(serde::de::Error::custom)?;
    Ok(opacity)
}

impl Deformation {
    /// Enabled, of the interior only, with its whole effect.
    pub fn new(name: impl Into<String>, deformer: Deformer) -> Self {
        Self { name: name.into(), deformer, moves_shape: false, enabled: true, opacity: 1.0 }
    }

    /// What takes effect; `None` if it is disabled or of no effect. An opacity out of its range counts as the nearest in it.
    pub fn effect(&self) -> Option<Cow<'_, Deformer>> {
        match self.opacity.clamp(0.0, 1.0) {
            _ if !self.enabled => None,
            1.0 => Some(Cow::Borrowed(&self.deformer)),
            opacity => self.deformer.scaled(opacity).map(Cow::Owned),
        }
    }

    /// The same on the other side of the plane through `origin` across `normal`; the name says so.
    ///
    /// # Errors
    /// If the normal has no direction.
    pub fn mirrored(&self, origin: DVec3, normal: DVec3) -> Result<Self, DeformError> {
        let name = format!("{} (mirrored)", self.name).trim_start().to_owned();
        Ok(Self { name, deformer: self.deformer.mirrored(origin, normal)?, ..*self })
    }
}

/// Deformations, the oldest first.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Stack {
    pub items: Vec<Deformation>,
}

impl Stack {
    /// What takes effect, by as much as it does, oldest first.
    pub fn active(&self) -> impl DoubleEndedIterator<Item = Cow<'_, Deformer>> {
        self.items.iter().filter_map(Deformation::effect)
    }

    /// The part of the stack that moves the mesh.
    pub fn shape(&self) -> Self {
        Self { items: self.items.iter().filter(|i| i.enabled && i.moves_shape).cloned().collect() }
    }

    /// An evaluator for many points.
    pub fn prepared(&self) -> Prepared {
        Prepared::new(self.active())
    }

    /// Where the undeformed point `q` is seen: the inverse of the backward map, oldest deformation first.
    ///
    /// Accurate to about 1e-12 of each deformer's size.
    ///
    /// # Errors
    /// If a deformation folds over there, so that there is no single answer.
    pub fn forward(&self, q: DVec3) -> Result<DVec3, DeformError> {
        self.prepared().forward(q)
    }

    /// The mesh moved by the deformations that move the shape. Connectivity stays.
    ///
    /// # Errors
    /// If one of them folds over at a vertex.
    pub fn move_mesh(&self, mesh: &TriMesh) -> Result<TriMesh, DeformError> {
        let shape = self.shape().prepared();
        let positions = mesh.positions.par_iter().map(|p| shape.forward(*p)).collect::<Result<_, _>>()?;
        Ok(TriMesh { positions, triangles: mesh.triangles.clone() })
    }
}

/// For single points; for many use [`Stack::prepared`].
impl BackwardMap for Stack {
    fn backward(&self, p: DVec3) -> DVec3 {
        self.active().rev().fold(p, |p, d| d.backward(p))
    }

    fn backward_with_jacobian(&self, p: DVec3) -> (DVec3, DMat3) {
        self.active().rev().fold((p, DMat3::IDENTITY), |(p, jacobian), d| {
            let (q, step) = d.backward_with_jacobian(p);
            (q, step * jacobian)
        })
    }

    fn supports(&self) -> Vec<OrientedBox> {
        self.active().map(|d| d.support()).collect()
    }
}

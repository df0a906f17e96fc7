//! L1: triangle meshes: positions, triangles, connectivity, checks and primitives; tetrahedral meshes, their reports, and
//! how to make them: lattices of boxes ([`tet_lattice`]), the inside of a surface ([`stuffing`]), a deformation
//! ([`tet_map`]).
//!
//! Connectivity never sees positions.

mod bcc;
mod bisection;
mod bvh;
pub mod cells;
pub mod check;
pub mod contour;
mod contour_table;
mod distance;
mod exact;
mod fill;
pub mod locate;
mod nets;
pub mod primitives;
pub mod proxy;
mod random;
mod stencils;
pub mod stuffing;
pub mod tet_faces;
pub mod tet_lattice;
pub mod tet_map;
pub mod tet_quality;
pub mod tet_report;
pub mod tets;
mod topology;

pub use topology::{EdgeId, Topology, TriangleId, VertexId};

use std::collections::HashMap;

use glam::{DAffine3, DVec3};

/// A triangle mesh. A clean solid is closed, and its triangles run anticlockwise seen from outside.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TriMesh {
    pub positions: Vec<DVec3>,
    /// Indices into `positions`, each below its length.
    pub triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// Lower and upper corner; `None` without vertices.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let first = *self.positions.first()?;
        Some(self.positions.iter().fold((first, first), |(lo, hi), p| (lo.min(*p), hi.max(*p))))
    }

    /// Where the line `origin + t * direction` passes through a triangle, and the triangle's normal (twice its area long).
    #[inline]
    pub fn crossing(&self, triangle: &[u32; 3], origin: DVec3, direction: DVec3) -> Option<(f64, DVec3)> {
        let [a, b, c] = triangle.map(|i| self.positions[i as usize]);
        let (e1, e2) = (b - a, c - a);
        let p = direction.cross(e2);
        let det = e1.dot(p);
        if det == 0.0 {
            return None;
        }
        let s = origin - a;
        let u = s.dot(p) / det;
        let q = s.cross(e1);
        let v = direction.dot(q) / det;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| (e2.dot(q) / det, e1.cross(e2)))
    }

    /// Every vertex moved by `map`; triangles are turned round if the map mirrors.
    pub fn transformed(&self, map: &DAffine3) -> Self {
        let positions = self.positions.iter().map(|p| map.transform_point3(*p)).collect();
        let mut mesh = Self { positions, triangles: self.triangles.clone() };
        if map.matrix3.determinant() < 0.0 {
            mesh.flip();
        }
        mesh
    }

    /// Signed volume by the divergence theorem; negative if the mesh is inside-out, meaningless if it is open.
    pub fn volume(&self) -> f64 {
        let Some(&o) = self.positions.first() else { return 0.0 };
        let p = |i: u32| self.positions[i as usize] - o;
        self.triangles.iter().map(|t| p(t[0]).cross(p(t[1])).dot(p(t[2]))).sum::<f64>() / 6.0
    }

    /// Sum of the triangles' areas.
    pub fn area(&self) -> f64 {
        let p = |i: u32| self.positions[i as usize];
        self.triangles.iter().map(|t| (p(t[1]) - p(t[0])).cross(p(t[2]) - p(t[0])).length()).sum::<f64>() / 2.0
    }

    /// Turns every triangle round, and with them inside and outside.
    pub fn flip(&mut self) {
        self.triangles.iter_mut().for_each(|t| t.reverse());
    }

    /// Adds the vertices and triangles of `other` behind the own ones.
    pub fn append(&mut self, other: &Self) {
        let first = self.positions.len() as u32;
        self.positions.extend_from_slice(&other.positions);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    }

    /// The same surface with each position only once: vertices at exactly equal places become one, in order of first
    /// appearance. Triangles stay as many as they are, also where two of their corners have become one.
    pub fn welded(&self) -> Self {
        let mut ids = HashMap::with_capacity(self.positions.len());
        let mut positions = Vec::new();
        // adding zero makes -0 equal to 0
        let new_id: Vec<u32> = (self.positions.iter())
            .map(|p| {
                *ids.entry((*p + DVec3::ZERO).to_array().map(f64::to_bits)).or_insert_with(|| {
                    positions.push(*p);
                    positions.len() as u32 - 1
                })
            })
            .collect();
        Self { positions, triangles: self.triangles.iter().map(|t| t.map(|v| new_id[v as usize])).collect() }
    }
}

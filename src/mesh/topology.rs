//! The edge list with adjacency (Westermann and Rezk-Salama 2001, section 2.4).
//!
//! Each triangle refers to its three vertices and three edges, each edge to its two vertices and the triangles on both
//! sides. Where more than two triangles meet at an edge, they are paired in order of appearance, so that every walk
//! still ends; [`Topology::defects`] counts what is not a clean solid.

/// Index of a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct VertexId(pub u32);
/// Index of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TriangleId(pub u32);
/// Index of an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EdgeId(pub u32);

/// Connectivity of a triangle mesh.
#[derive(Debug, Clone, Default)]
pub struct Topology;

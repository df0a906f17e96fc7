//! L2: refinement of slice triangles where the map displaces, and the displaced texture coordinates.
//!
//! # Theory
//!
//! A graphics card interpolates texture coordinates linearly over a triangle, so a curved backward map needs small triangles:
//! each is split into four by its edges' midpoints, again and again (Westermann and Rezk-Salama 2001, section 3.2.1). The
//! error of linear interpolation falls by four per level.
//!
//! Whether an *edge* is split depends on nothing but its two end points. So the triangles on both sides always agree, and no
//! vertex of one lies on an edge of the other (no T-junction, no crack). A triangle with three, two, one split edges falls into
//! four, three, two. An edge is split as long as it passes through the inside of a support box, is longer than the smallest
//! that shows, and either no tolerance is asked for, or
//!
//! - it is longer than the smallest feature of a box that it passes (so that nothing is stepped over), or
//! - the map at its midpoint, evaluated exactly, is off the mean of its ends by more than 3/4 of the tolerance (over a
//!   triangle a quadratic map is off by at most 4/3 of the largest error at the midpoints), or
//! - the slopes of the map at its ends are off the chord by as much as they would be for such an error: an S-shaped edge may
//!   have its midpoint in the right place.
//!
//! A box whose section lies within one triangle touches no edge; that triangle is split at its centroid first.
//!
//! For a draft, an edge is split while it is longer than so many features of a box that it passes, whatever the error.
//!
//! Without a tolerance, and where every part of an edge shows, an edge is split into all its `2^depth` parts at once, and a
//! triangle with three such edges gets the same pattern always. Along the border of the boxes, where a triangle has both
//! kinds of edges, the levels do the rest.
//!
//! # Practice
//!
//! [`Refiner`] works level by level: all edges of a level, then all triangles. Edges have numbers, and a split edge knows its
//! halves, so that only the input needs a hash table. [`corners`] then evaluates the map at the vertices, in blocks of `f32`,
//! and hands out what a slice vertex is made of.

mod edges;
mod emit;
mod levels;
mod pattern;
mod refine;
mod supports;

pub use emit::{Corner, NextSlice, Texturing, corners};
pub use refine::{Refiner, Rule, Smallest};
pub use supports::Supports;

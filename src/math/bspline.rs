//! Uniform quadratic B-splines.

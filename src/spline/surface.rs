//! The plain alternative: the trilinear iso-surface, by marching cubes.

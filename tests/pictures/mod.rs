//! Pictures against each other.

use voxclay::compare::{self, Difference};
use voxclay::render::Picture;

/// Over all four channels.
pub fn difference(a: &Picture, b: &Picture) -> Difference {
    let size = [a.width as usize, a.height as usize, 1];
    compare::difference(a.pixels.as_flattened(), b.pixels.as_flattened(), size, 4, 255.0).expect("pictures of one size")
}

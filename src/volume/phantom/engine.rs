use super::Model;
use super::sdf::*;
use glam::Vec3;
pub struct Engine {
    shapes: Vec<Shape>,
}
impl Engine {
    pub fn new() -> Self {
        Self { shapes: vec![Shape::new(1.0).add(0.0, ball(Vec3::ZERO, 10.0))] }
    }
}
impl Model for Engine {
    fn bounds(&self) -> [Vec3; 2] {
        [v(-20.0, -20.0, -20.0), v(20.0, 20.0, 20.0)]
    }
    fn shapes(&self) -> &[Shape] {
        &self.shapes
    }
    fn value(&self, p: Vec3, at: &Block, w: f32) -> f32 {
        cover(at.d(0, p), w)
    }
}

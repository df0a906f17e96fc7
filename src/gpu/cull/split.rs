//! Triangles split where only a part of them can be seen.

use super::visibility::Visibility;
use crate::render::SliceVertex;
use crate::volume::pyramid::BLOCK;

/// Triangles below this extent, in voxels, are not split further: twice a block, since a triangle that is much smaller
/// costs more to set up than its fragments.
const LEAF: f32 = 2.0 * BLOCK as f32;

/// How much of a triangle stayed.
#[derive(PartialEq)]
pub enum Stayed {
    Nothing,
    Part,
    Whole,
}

/// One slice on its way.
pub struct Splitter<'a> {
    pub visibility: Visibility<'a>,
    pub given: &'a [SliceVertex],
    pub added: Vec<SliceVertex>,
    pub indices: Vec<u32>,
}

impl Splitter<'_> {
    fn vertex(&self, i: u32) -> &SliceVertex {
        let i = i as usize;
        self.given.get(i).unwrap_or_else(|| &self.added[i - self.given.len()])
    }

    /// Emits what stays of a triangle.
    pub fn triangle(&mut self, t: [u32; 3]) -> Stayed {
        let (extent, visible) = self.visibility.look(t.map(|i| self.vertex(i)));
        if !visible {
            return Stayed::Nothing;
        }
        // far beyond the volume coordinates are not those of slices, and splitting might not end
        if extent <= LEAF || extent > 4.0 * self.visibility.largest() {
            self.indices.extend(t);
            return Stayed::Whole;
        }
        let before = (self.added.len(), self.indices.len());
        let [a, b, c] = t;
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[p, q]| self.between(p, q));
        let parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]].map(|part| self.triangle(part));
        if parts.iter().all(|p| *p == Stayed::Nothing) {
            self.added.truncate(before.0);
            return Stayed::Nothing;
        }
        if parts.iter().all(|p| *p == Stayed::Whole) {
            self.added.truncate(before.0);
            self.indices.truncate(before.1);
            self.indices.extend(t);
            return Stayed::Whole;
        }
        Stayed::Part
    }

    fn between(&mut self, p: u32, q: u32) -> u32 {
        let mut v = *self.vertex(p);
        let w: [f32; 18] = bytemuck::cast(*self.vertex(q));
        let mean: &mut [f32; 18] = bytemuck::cast_mut(&mut v);
        mean.iter_mut().zip(w).for_each(|(a, b)| *a = 0.5 * (*a + b));
        self.added.push(v);
        (self.given.len() + self.added.len() - 1) as u32
    }
}

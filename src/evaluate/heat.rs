//! How much material has grown, on what is seen and in the tetrahedra: for overlays of a view.
//!
//! Growth is the volume of material over what it was at rest, `1 / det J` of the backward map: 2 is twice as large, 1/2 is
//! squeezed to half, and where it is not positive space is folded.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::load::Object;
use super::pick::{Probe, Ray};
use super::tets::Lattice;
use crate::mesh::tets::{TetMesh, signed_volume};
use crate::render::{Camera, Look, Stop};

/// The visible surface as a mesh of a few pixels' step, with the growth at its points.
#[derive(Debug, Clone, Default)]
pub struct HeatSurface {
    /// In the deformed world.
    pub points: Vec<DVec3>,
    pub growth: Vec<f32>,
    /// Anticlockwise for the eye that saw them.
    pub triangles: Vec<[u32; 3]>,
}

/// Neighbours farther apart in depth than so many steps belong to different surfaces.
const APART: f64 = 8.0;

impl HeatSurface {
    /// What a picture of `size` pixels shows, looked at every `step` pixels; `None` if it was stopped.
    pub fn of(
        object: &Object,
        camera: &Camera,
        look: &Look,
        size: (u32, u32),
        step: f64,
        stop: Stop<'_>,
    ) -> Option<Self> {
        let (columns, rows) = ((f64::from(size.0) / step) as usize + 1, (f64::from(size.1) / step) as usize + 1);
        let probe = Probe::new(object).seeing(look);
        let lines: Vec<Option<Vec<Option<DVec3>>>> = (0..rows)
            .into_par_iter()
            .map(|y| {
                if stop() {
                    return None;
                }
                let look = |x: usize| {
                    let at = DVec2::new(x as f64, y as f64) * step;
                    Some(probe.first(&Ray::through(camera, size, at), look.shading)?.point)
                };
                Some((0..columns).map(look).collect())
            })
            .collect();
        let lines: Option<Vec<Vec<Option<DVec3>>>> = lines.into_iter().collect();
        let found: Vec<Option<DVec3>> = lines?.into_iter().flatten().collect();
        let mut surface = Self::default();
        let ids: Vec<Option<u32>> = found
            .iter()
            .map(|p| {
                let p = (*p)?;
                surface.points.push(p);
                Some(surface.points.len() as u32 - 1)
            })
            .collect();
        surface.growth = surface.points.par_iter().map(|p| probe.growth(*p) as f32).collect();
        let toward = camera.to_eye();
        // of a pixel at the target's depth
        let pixel = 2.0 * camera.radius / camera.zoom / f64::from(size.0.min(size.1).max(1));
        let near = |corners: [u32; 3]| {
            let depth = corners.map(|i| surface.points[i as usize].dot(toward));
            let (lo, hi) = depth.iter().fold((f64::MAX, f64::MIN), |(a, b), d| (a.min(*d), b.max(*d)));
            hi - lo <= APART * step * pixel
        };
        let mut triangles = Vec::new();
        for y in 0..rows.saturating_sub(1) {
            for x in 0..columns.saturating_sub(1) {
                let id = |dx: usize, dy: usize| ids[(y + dy) * columns + x + dx];
                for corners in [[id(0, 0), id(0, 1), id(1, 0)], [id(1, 0), id(0, 1), id(1, 1)]] {
                    if let [Some(a), Some(b), Some(c)] = corners
                        && near([a, b, c])
                    {
                        triangles.push([a, b, c]);
                    }
                }
            }
        }
        surface.triangles = triangles;
        Some(surface)
    }
}

/// Edges of the tetrahedra that a plane cuts.
#[derive(Debug, Clone, Default)]
pub struct TetLayer {
    /// Ends in the deformed world, with the growth of the tetrahedron that is farthest from 1.
    pub edges: Vec<([DVec3; 2], f32)>,
    /// Of the whole lattice.
    pub tets: usize,
    /// Tetrahedra that are turned inside out, wherever they lie.
    pub folded: usize,
}

impl TetLayer {
    /// The layer of a lattice at the plane through `point` across `normal`. Folded tetrahedra are in it wherever they lie.
    pub fn of(lattice: &Lattice, point: DVec3, normal: DVec3) -> Self {
        let places = lattice.deformed();
        let mut layer = Self { tets: lattice.mesh.tets.len(), ..Self::default() };
        let side: Vec<f64> = places.iter().map(|p| (*p - point).dot(normal)).collect();
        let mut edges: Vec<([u32; 2], f32)> = Vec::new();
        for tet in &lattice.mesh.tets {
            let d = tet.map(|i| side[i as usize]);
            let cut = d.iter().any(|d| *d > 0.0) && d.iter().any(|d| *d <= 0.0);
            let rest = signed_volume(TetMesh::corners(*tet, &lattice.mesh.points));
            let folded = rest <= 0.0;
            layer.folded += usize::from(folded);
            if !cut && !folded {
                continue;
            }
            let growth = (signed_volume(TetMesh::corners(*tet, places)) / rest) as f32;
            for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
                let (a, b) = (tet[i].min(tet[j]), tet[i].max(tet[j]));
                edges.push(([a, b], if folded { f32::NEG_INFINITY } else { growth }));
            }
        }
        let off = |g: f32| if g > 0.0 { g.ln().abs() } else { f32::INFINITY };
        edges.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(off(b.1).total_cmp(&off(a.1))));
        edges.dedup_by_key(|e| e.0);
        layer.edges = edges.into_iter().map(|([a, b], g)| ([places[a as usize], places[b as usize]], g)).collect();
        layer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deform::{Action, Brush, Deformation, Deformer, Falloff};
    use crate::evaluate::geometry::Refinement;
    use crate::evaluate::{load, tets};
    use crate::render::Shading;
    use crate::scene::{CameraSpec, Document, VolumeSource};

    /// A ball that was inflated in its middle, without and with folds.
    fn object(amount: f64) -> Object {
        let mut document = Document::new(VolumeSource::Phantom { name: "orange".to_owned(), size: 32 });
        document.allow_folds = true;
        let rest = load::load(&document, std::path::Path::new("")).unwrap();
        let (center, radius) = rest.focus;
        let brush = Brush::new(center, radius, Falloff::Smooth, Action::Inflate { amount }).unwrap();
        document.stack.items.push(Deformation::new("", Deformer::Brush(brush)));
        load::load(&document, std::path::Path::new("")).unwrap()
    }

    #[test]
    fn the_surface_lies_where_rays_hit_and_tells_the_growth_there() {
        let object = object(0.5);
        let camera = object.camera(&CameraSpec::default());
        let look = &Look { shading: Shading::Iso { value: object.iso, color: [1.0; 3] }, ..Look::default() };
        let surface = HeatSurface::of(&object, &camera, look, (120, 90), 6.0, &|| false).unwrap();
        assert!(surface.points.len() > 40 && surface.triangles.len() > 40);
        let probe = Probe::new(&object);
        for (p, g) in surface.points.iter().zip(&surface.growth) {
            assert!((probe.growth(*p) - f64::from(*g)).abs() < 1e-5 * f64::from(g.abs()));
        }
        let toward = camera.to_eye();
        for t in &surface.triangles {
            let [a, b, c] = t.map(|i| surface.points[i as usize]);
            assert!((b - a).cross(c - a).dot(toward) > 0.0);
        }
        assert!(HeatSurface::of(&object, &camera, look, (120, 90), 6.0, &|| true).is_none());
    }

    #[test]
    fn a_layer_has_the_edges_that_are_cut_and_all_folds() {
        for (amount, folds) in [(0.5, false), (1.6, true)] {
            let object = object(amount);
            let lattice = tets::lattice(&object, Refinement::Tolerance(0.5)).unwrap();
            let (center, _) = object.focus;
            let layer = TetLayer::of(&lattice, center, DVec3::Y);
            assert_eq!(layer.folded > 0, folds, "{amount}");
            assert!(layer.edges.iter().any(|e| e.1 > 1.2), "{amount}");
            for ([a, b], growth) in &layer.edges {
                // every tetrahedron of a layer reaches the plane, so no edge is farther away than it is long, nor the longest one
                let longest = layer.edges.iter().map(|e| (e.0[0] - e.0[1]).length()).fold(0.0, f64::max);
                let far = (*a - center).y.abs().min((*b - center).y.abs());
                assert!(*growth <= 0.0 || far <= longest, "{far} {longest}");
            }
            // a plane beyond everything cuts nothing
            let beyond = TetLayer::of(&lattice, center + DVec3::Y * 1e6, DVec3::Y);
            assert_eq!(beyond.edges.is_empty(), !folds);
            assert_eq!(beyond.tets, lattice.mesh.tets.len());
        }
    }
}

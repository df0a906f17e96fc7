//! Iso-surfaces of objects: meshes and pictures, against formulas and against slices.

use std::path::Path;

use glam::DVec3;
use voxclay::deform::{Deformation, Deformer, DisplacementVolume};
use voxclay::evaluate::EvaluateError;
use voxclay::evaluate::load::{Object, load};
use voxclay::evaluate::picture::{Backend, Mode, Refinement, Renderer, ViewOptions};
use voxclay::evaluate::surface::{Method, SurfaceOptions, surface};
use voxclay::math::BackwardMap;
use voxclay::mesh::check::MeshReport;
use voxclay::render::{Look, Shading};
use voxclay::scene::{CameraSpec, Document, VolumeSource};

mod pictures;
use pictures::difference;

/// exp(-|p|^2 / 2 s^2) in millimetres, with s a sixth of the side.
const SIGMA: f64 = 100.0 / 6.0;

fn ball(size: usize) -> Document {
    Document::new(VolumeSource::Phantom { name: "gaussian".into(), size })
}

fn pulled(size: usize) -> Document {
    let mut document = ball(size);
    let pull =
        DisplacementVolume::from_drag(DVec3::new(0.0, -12.0, 0.0), DVec3::new(3.0, -9.0, 4.0), 26.0).expect("a stroke");
    document.stack.items = vec![Deformation::new("pull", Deformer::Displacement(pull))];
    document
}

fn options(method: Method, tolerance: Option<f64>) -> SurfaceOptions {
    SurfaceOptions { iso: Some(0.5), method, tolerance }
}

const SPLINE: Method = Method::Spline { corrections: None };

#[test]
fn a_ball_has_its_volume() {
    let object = load(&ball(48), Path::new("")).unwrap();
    let radius = SIGMA * (2.0 * 2f64.ln()).sqrt();
    for (method, tolerance, off) in [(SPLINE, None, 0.01), (SPLINE, Some(0.02), 0.002), (Method::Cells, None, 0.02)] {
        let made = surface(&object, &options(method, tolerance)).unwrap();
        let report = MeshReport::of(&made.contour.mesh);
        assert!(report.is_clean_solid() && report.components == 1 && !made.resampled, "{report:?}");
        let ratio = report.volume / (4.0 / 3.0 * std::f64::consts::PI * radius.powi(3));
        assert!((ratio - 1.0).abs() < off, "{method:?} {ratio}");
        for (p, n) in made.contour.mesh.positions.iter().zip(&made.contour.normals) {
            assert!(p.normalize().dot(n.as_dvec3()) > 0.999);
        }
    }
    let none = surface(&object, &SurfaceOptions { iso: Some(7.0), method: SPLINE, tolerance: None });
    assert!(matches!(none, Err(EvaluateError::NoSurface { .. })));
}

#[test]
fn strokes_move_the_surface() {
    let object = load(&pulled(64), Path::new("")).unwrap();
    let made = surface(&object, &options(SPLINE, None)).unwrap();
    assert!(made.resampled && MeshReport::of(&made.contour.mesh).is_clean_solid());
    let map = object.stack.prepared();
    let voxel = object.volume.grid.finest();
    let mut farthest = 0.0f64;
    for p in &made.contour.mesh.positions {
        // where the value seen here comes from, the undeformed field has the isovalue
        let source = map.backward(*p);
        farthest = farthest.max((source.length() - SIGMA * (2.0 * 2f64.ln()).sqrt()).abs() / voxel);
    }
    let moved = made.contour.mesh.positions.iter().map(|p| (map.backward(*p) - *p).length()).fold(0.0, f64::max);
    assert!(farthest < 0.1 && moved > 5.0, "{farthest} {moved}");
}

fn view(mode: Mode) -> ViewOptions {
    ViewOptions {
        size: (120, 100),
        slices: Some(400),
        mode,
        refinement: Refinement::Tolerance(0.1),
        backend: Backend::Cpu,
        transparent: false,
        corrections: None,
    }
}

fn shot(object: &Object, mode: Mode, fov_y: Option<f64>) -> voxclay::render::Picture {
    let look = Look { shading: Shading::Iso { value: 0.5, color: [0.8, 0.6, 0.4] }, ..Look::default() };
    let camera = object.camera(&CameraSpec { yaw: 30.0, pitch: 20.0, fov_y, ..CameraSpec::default() });
    let (picture, report) = Renderer::new(Backend::Cpu).unwrap().picture(object, &camera, &look, &view(mode)).unwrap();
    assert_eq!(report.backend, "cpu");
    picture
}

#[test]
fn pictures_agree_with_those_of_slices() {
    for document in [ball(64), pulled(64)] {
        let object = load(&document, Path::new("")).unwrap();
        for fov_y in [Some(30.0), None] {
            let (ours, slices) = (shot(&object, Mode::Spline, fov_y), shot(&object, Mode::SlicingExact, fov_y));
            let alike = difference(&ours, &slices).psnr;
            assert!(alike > 30.0, "{alike}");
        }
    }
}

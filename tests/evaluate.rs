//! From a document to slices: whatever the view, a point of the deformed object shows the same place of the volume.

use std::path::Path;

use glam::DVec3;
use voxclay::deform::{Action, Brush, Deformation, Deformer, DisplacementVolume, Falloff, Grab};
use voxclay::evaluate::geometry::{GeometryOptions, Keeper, Refinement, slices};
use voxclay::evaluate::load::{Object, load};
use voxclay::math::BackwardMap;
use voxclay::render::{Camera, Projection, SliceGeometry};
use voxclay::scene::{CameraSpec, Document, ProxySource, VolumeSource};

fn document(moves_shape: bool) -> Document {
    let mut document = Document::new(VolumeSource::Phantom { name: "sphere".into(), size: 40 });
    document.proxy = ProxySource::Auto { iso: None };
    let object = load(&document, Path::new("")).unwrap();
    let (center, radius) = object.focus;
    let grab = Grab::new(
        center + DVec3::X * 0.5 * radius,
        DVec3::new(0.2, 0.1, -0.1) * radius,
        0.8 * radius,
        Falloff::default(),
    );
    let pull = DisplacementVolume::from_drag(
        center - DVec3::Y * 0.3 * radius,
        DVec3::new(0.05, -0.2, 0.1) * radius,
        0.6 * radius,
    );
    document.stack.items = vec![
        Deformation { moves_shape, ..Deformation::new("grab", Deformer::Grab(grab.unwrap())) },
        Deformation { moves_shape, ..Deformation::new("pull", Deformer::Displacement(pull.unwrap())) },
    ];
    document
}

fn cameras(object: &Object, projection: impl Fn(usize) -> Projection) -> Vec<Camera> {
    (0..20)
        .map(|i| {
            let spec =
                CameraSpec { yaw: 17.0 + 73.0 * i as f64, pitch: -80.0 + 8.4 * i as f64, ..CameraSpec::default() };
            Camera { projection: projection(i), ..object.camera(&spec) }
        })
        .collect()
}

fn options(refinement: Refinement) -> GeometryOptions {
    GeometryOptions { slices: Some(30), refinement, subdivide: true, size: (4096, 4096) }
}

/// Largest error of the interpolated texture coordinate at seven points of every triangle, in voxels.
fn worst(object: &Object, geometry: &SliceGeometry) -> f64 {
    let grid = &object.volume.grid;
    let texture = grid.texture_from_world();
    let vec = |v: [f32; 3]| DVec3::from(v.map(f64::from));
    let weights = [
        [1.0, 1.0, 1.0],
        [4.0, 1.0, 1.0],
        [1.0, 4.0, 1.0],
        [1.0, 1.0, 4.0],
        [1.0, 1.0, 0.0],
        [1.0, 0.0, 1.0],
        [0.0, 1.0, 1.0],
    ];
    let mut worst = 0.0f64;
    for t in geometry.indices.chunks_exact(3) {
        let corners: Vec<_> = t.iter().map(|&i| &geometry.vertices[i as usize]).collect();
        for w in weights {
            let sum: f64 = w.iter().sum();
            let mix = |f: &dyn Fn(usize) -> DVec3| (0..3).map(|i| f(i) * w[i]).sum::<DVec3>() / sum;
            let p = geometry.center + mix(&|i| vec(corners[i].position));
            let shown = mix(&|i| vec(corners[i].front));
            let right = texture.transform_point3(object.stack.backward(p));
            worst = worst.max(((shown - right) * grid.size()).length());
        }
    }
    worst
}

fn volume_of(geometry: &SliceGeometry) -> f64 {
    let vec = |i: u32| DVec3::from(geometry.vertices[i as usize].position.map(f64::from));
    let area: f64 = geometry
        .indices
        .chunks_exact(3)
        .map(|t| 0.5 * (vec(t[1]) - vec(t[0])).cross(vec(t[2]) - vec(t[0])).length())
        .sum();
    area * geometry.distance
}

/// Section 3.1, cured: 20 views of one deformed shape agree on where each point comes from, and on what the shape is.
#[test]
fn the_picture_does_not_depend_on_the_view() {
    let object = load(&document(true), Path::new("")).unwrap();
    let tolerance = 0.1;
    let solid = object.mesh.volume();
    for (i, camera) in cameras(&object, |_| Projection::Orthographic).iter().enumerate() {
        let geometry = slices(&object, camera, &options(Refinement::Tolerance(tolerance))).unwrap();
        assert!(geometry.indices.len() > 3000, "view {i} has few triangles");
        let worst = worst(&object, &geometry);
        assert!(worst < tolerance, "view {i}: {worst} voxels");
        // thirty slabs do not give the volume exactly, but every point of a slice is drawn exactly once
        let share = volume_of(&geometry) / solid;
        assert!((share - 1.0).abs() < 0.01, "view {i}: {share} of the volume");
    }
}

/// What moves under the hand: every point once, and about where it belongs, also where strokes are of many sizes.
#[test]
fn a_draft_is_whole_and_about_right() {
    let mut document = document(true);
    let (center, radius) = load(&document, Path::new("")).unwrap().focus;
    for size in [1.0, 0.2, 0.04] {
        let at = center + DVec3::new(0.4, 0.3, -0.2) * radius;
        let grab = Grab::new(at, DVec3::splat(0.1 * size * radius), 0.5 * size * radius, Falloff::default()).unwrap();
        document.stack.items.push(Deformation::new("grab", Deformer::Grab(grab)));
        let object = load(&document, Path::new("")).unwrap();
        for camera in cameras(&object, |_| Projection::Orthographic).iter().take(4) {
            let geometry = slices(&object, camera, &options(Refinement::Draft)).unwrap();
            let share = volume_of(&geometry) / object.mesh.volume();
            assert!((share - 1.0).abs() < 0.01, "{share} of the volume");
            let [draft, plain] = [Refinement::Draft, Refinement::Depth(0)]
                .map(|r| worst(&object, &slices(&object, camera, &options(r)).unwrap()));
            assert!(draft < 0.3 * plain, "{draft} voxels, without any split {plain}");
        }
    }
}

/// A test of the test: without refinement, views do not agree.
#[test]
fn without_subdivision_views_disagree() {
    let object = load(&document(true), Path::new("")).unwrap();
    let camera = &cameras(&object, |_| Projection::Orthographic)[3];
    let geometry = slices(&object, camera, &options(Refinement::Depth(0))).unwrap();
    assert!(worst(&object, &geometry) > 0.5);
}

/// Each level of subdivision takes the error down by four, once triangles are small against the displacement volumes.
#[test]
fn the_error_falls_by_four_per_level() {
    let object = load(&document(true), Path::new("")).unwrap();
    let camera = &cameras(&object, |_| Projection::Orthographic)[5];
    let errors: Vec<f64> = (3..6)
        .map(|d| GeometryOptions { slices: Some(8), ..options(Refinement::Depth(d)) })
        .map(|o| worst(&object, &slices(&object, camera, &o).unwrap()))
        .collect();
    for pair in errors.windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((3.2..4.8).contains(&ratio), "{errors:?}");
    }
}

/// Slices are parallel to the view plane and run back to front; ranges are contiguous and cover all indices.
#[test]
fn slices_run_back_to_front() {
    let object = load(&document(false), Path::new("")).unwrap();
    let perspective = |_| Projection::Perspective { fov_y: 40.0 };
    for camera in cameras(&object, perspective) {
        let geometry = slices(&object, &camera, &options(Refinement::Depth(1))).unwrap();
        let mut at = 0;
        let mut last = f64::NEG_INFINITY;
        for range in &geometry.slices {
            assert_eq!(range.start, at);
            at = range.end;
            let heights: Vec<f64> = geometry.indices[range.start as usize..range.end as usize]
                .iter()
                .map(|&i| DVec3::from(geometry.vertices[i as usize].position.map(f64::from)).dot(camera.to_eye()))
                .collect();
            let Some(&h) = heights.first() else { continue };
            assert!(heights.iter().all(|x| (x - h).abs() < 1e-3 * camera.radius), "a slice is not plane");
            assert!(h > last);
            last = h;
        }
        assert_eq!(at as usize, geometry.indices.len());
    }
}

/// An eye inside the volume sees only what lies before it.
#[test]
fn what_is_kept_from_stroke_to_stroke_is_what_would_be_made() {
    keeps(Refinement::Depth(2));
    keeps(Refinement::Draft);
}

fn keeps(coarse: Refinement) {
    let mut document = document(true);
    let (center, radius) = load(&document, Path::new("")).unwrap().focus;
    let ball = |at: DVec3, pull: f64| {
        let grab = Grab::new(at, DVec3::new(0.1, pull, 0.0) * radius, 0.3 * radius, Falloff::default()).unwrap();
        Deformation::new("ball", Deformer::Grab(grab))
    };
    let mut keeper = Keeper::default();
    let mut kept = Vec::new();
    let mut step = |document: &Document, refinement, yaw: f64| {
        let object = load(document, Path::new("")).unwrap();
        let spec = CameraSpec { yaw, pitch: 20.0, ..CameraSpec::default() };
        let camera = object.camera(&spec);
        let (got, _) = keeper.slices(&object, &camera, &options(refinement)).unwrap();
        let want = slices(&object, &camera, &options(refinement)).unwrap();
        assert!(got == want, "step {}", kept.len());
        kept.push(keeper.kept());
    };
    step(&document, coarse, 30.0);
    // the same again
    step(&document, coarse, 30.0);
    // a small stroke deep inside, that moves no mesh; pulled on, and on
    document.stack.items.push(Deformation { moves_shape: false, ..ball(center, 0.05) });
    step(&document, coarse, 30.0);
    document.stack.items[2] = Deformation { moves_shape: false, ..ball(center + 0.1 * radius, 0.1) };
    step(&document, coarse, 30.0);
    // an older one is moved, one is switched off, on again, the order changes, all go
    document.stack.items[1] = ball(center - 0.5 * radius, 0.1);
    step(&document, coarse, 30.0);
    document.stack.items[2].enabled = false;
    step(&document, coarse, 30.0);
    document.stack.items[2].enabled = true;
    step(&document, coarse, 30.0);
    document.stack.items.swap(1, 2);
    step(&document, coarse, 30.0);
    document.stack.items.truncate(1);
    step(&document, coarse, 30.0);
    // another view, another refinement, and a cut
    step(&document, coarse, 31.0);
    step(&document, Refinement::Tolerance(0.5), 31.0);
    step(&document, Refinement::Tolerance(0.5), 31.0);
    document.clip.region = [[0.0, 0.6], [0.0, 1.0], [0.2, 1.0]];
    step(&document, Refinement::Tolerance(0.5), 31.0);
    assert_eq!((kept[0], kept[1], kept[9], kept[10], kept[11], kept[12]), (0, 30, 0, 0, 30, 30), "{kept:?}");
    assert!((2..9).all(|i| kept[i] < 30) && kept[2] > 5 && kept[3] > 5, "{kept:?}");
}

#[test]
fn planes_behind_the_eye_are_left_out() {
    let object = load(&document(false), Path::new("")).unwrap();
    let spec = CameraSpec { zoom: 60.0, ..CameraSpec::default() };
    let camera = object.camera(&spec);
    assert!(camera.eye_distance() < camera.radius);
    let geometry = slices(&object, &camera, &options(Refinement::Depth(1))).unwrap();
    let eye = (camera.eye() - geometry.center).dot(camera.to_eye());
    assert!(!geometry.indices.is_empty());
    for v in &geometry.vertices {
        assert!(DVec3::from(v.position.map(f64::from)).dot(camera.to_eye()) < eye);
    }
}

/// What a brush pushes out of the volume stays in the picture, and a faint stroke is judged by what is left of it.
#[test]
fn the_box_holds_what_brushes_move_and_only_what_folds_is_held_back() {
    let mut document = Document::new(VolumeSource::Phantom { name: "sphere".into(), size: 24 });
    let grid = load(&document, Path::new("")).unwrap().volume.grid;
    let corner = grid.world_from_texture().transform_point3(DVec3::new(0.9, 0.5, 0.1));
    let radius = 0.5 * (grid.world_from_texture().matrix3 * DVec3::X).length();
    let axis = DVec3::new(1.0, 2.0, -1.0);
    for (action, opacity, held) in [
        (Action::Inflate { amount: 0.8 }, 1.0, false),
        (Action::Inflate { amount: 1.6 }, 0.5, false),
        (Action::Inflate { amount: 1.6 }, 1.0, true),
        (Action::Pinch { axis, amount: -0.8 }, 1.0, false),
        (Action::Twist { axis, degrees: 200.0 }, 1.0, false),
    ] {
        let brush = Deformer::Brush(Brush::new(corner, radius, Falloff::Smooth, action).unwrap());
        document.stack.items = vec![Deformation { opacity, ..Deformation::new("blow", brush) }];
        let object = load(&document, Path::new("")).unwrap();
        assert_eq!(object.warnings.iter().any(|w| w.contains("'blow' is held back")), held, "{:?}", object.warnings);
        let (lo, hi) = object.mesh.bounds().unwrap();
        let mut outside = 0;
        for i in 0..1000 {
            let on = DVec3::new(f64::from(i % 10), f64::from(i / 10 % 10), f64::from(i / 100)) / 9.0;
            let seen = object.stack.forward(grid.world_from_texture().transform_point3(on)).unwrap();
            assert!(seen.cmpge(lo - 1e-9).all() && seen.cmple(hi + 1e-9).all(), "{action:?}: {seen} {lo} {hi}");
            let at = grid.texture_from_world().transform_point3(seen);
            outside += usize::from(at.max_element() > 1.01 || at.min_element() < -0.01);
        }
        assert!(outside > 0, "{action:?} moves nothing out of the volume");
    }
}

//! The deformed volume on a grid: bit-exactness, analytic fields, frames, growth, clipping, and the fast path against the
//! reference.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DAffine3, DMat3, DQuat, DVec3};
use voxclay::deform::{Deformation, Deformer, DisplacementVolume, Extent, Prepared, Stack};
use voxclay::evaluate::export::{
    ExportError, ExportMap, ExportOptions, ExportReport, GridChoice, Precision, export, export_field, unwatched,
};
use voxclay::math::{BackwardMap, Identity, OrientedBox};
use voxclay::volume::sampling::{Interpolation, Sampler, value_at};
use voxclay::volume::{Grid, Rescale, Samples, Scalar, Space, Volume};

// ------------------------------------------------------------------------------------------------ maps

/// A box around a grid with some room.
fn around(grid: &Grid, room: f64) -> Vec<OrientedBox> {
    let (lo, hi) = grid.bounds();
    vec![OrientedBox { center: 0.5 * (lo + hi), axes: DMat3::IDENTITY, half: 0.5 * (hi - lo) + room }]
}

/// A map of its own formula; the export does not ask for derivatives.
struct Formula<F> {
    backward: F,
    supports: Vec<OrientedBox>,
}

impl<F: Fn(DVec3) -> DVec3 + Sync> BackwardMap for Formula<F> {
    fn backward(&self, p: DVec3) -> DVec3 {
        (self.backward)(p)
    }
    fn backward_with_jacobian(&self, _: DVec3) -> (DVec3, DMat3) {
        unreachable!()
    }
    fn supports(&self) -> Vec<OrientedBox> {
        self.supports.clone()
    }
}

impl<F: Fn(DVec3) -> DVec3 + Sync> ExportMap for Formula<F> {}

/// What is at p is seen at p + vector.
fn shift(grid: &Grid, vector: DVec3) -> impl ExportMap + use<> {
    Formula { backward: move |p| p - vector, supports: around(grid, vector.length() + 1.0) }
}

fn turn(grid: &Grid, backward: DMat3) -> impl ExportMap + use<> {
    let about = grid.center();
    Formula { backward: move |p| about + backward * (p - about), supports: around(grid, 10.0) }
}

/// Smooth pulls inside oriented boxes, the last undone first: vector * product of (1 - t^2)^3.
fn pulls(list: Vec<(OrientedBox, DVec3)>) -> impl ExportMap {
    let supports = list.iter().map(|p| p.0).collect();
    let backward = move |p| {
        list.iter().rev().fold(p, |p, (support, vector)| {
            let t = support.local(p);
            let w = (DVec3::ONE - t * t).max(DVec3::ZERO);
            p - vector * (w * w * w).to_array().iter().product::<f64>()
        })
    };
    Formula { backward, supports }
}

fn tilted(center: DVec3, half: DVec3) -> OrientedBox {
    OrientedBox { center, axes: DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.4, -0.3, 0.7))), half }
}

/// Displacement volumes of different directions that overlap, about the middle of a grid.
fn stack(grid: &Grid) -> Prepared {
    let size = grid.size().min_element() * grid.finest();
    let mut random = Random(77);
    let items = (0..6)
        .map(|_| {
            let mut v = || DVec3::new(random.unit(), random.unit(), random.unit()) - 0.5;
            let (point, vector, wide) = (grid.center() + v() * size, v() * 0.2 * size, v() + 1.0);
            let extent = Extent { u: 0.3 * size * wide.x, v: 0.3 * size * wide.y, length: 0.9 * size };
            let pull = DisplacementVolume::new(point, vector, extent, None).unwrap().clamp_to_injective(0.1);
            Deformation::new("", Deformer::Displacement(pull.deformer))
        })
        .collect();
    Stack { items }.prepared()
}

// ------------------------------------------------------------------------------------------------ volumes

struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 16
    }
    fn unit(&mut self) -> f64 {
        self.next() as f64 / (1u64 << 48) as f64
    }
}

/// Oblique, sheared, left-handed, anisotropic.
fn skew(dims: [usize; 3]) -> Grid {
    let turn = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.5, 0.2, -0.8)));
    let shear = DMat3::from_cols(DVec3::new(0.7, 0.0, 0.0), DVec3::new(0.2, -1.1, 0.0), DVec3::new(-0.1, 0.3, 1.9));
    Grid::new(dims, DAffine3::from_mat3_translation(turn * shear, DVec3::new(-31.7, 12.3, 5.9)), Space::Lps).unwrap()
}

fn plain(dims: [usize; 3]) -> Grid {
    Grid::aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap()
}

/// Isotropic voxels of 0.9 in some orientation, `size` voxels on a side, about the same centre.
fn rotated(about: DVec3, size: usize) -> Grid {
    let matrix = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(-0.3, 0.6, 0.1))) * 0.9;
    let origin = about - matrix * DVec3::splat(0.5 * size as f64 + 0.2);
    Grid::new([size; 3], DAffine3::from_mat3_translation(matrix, origin), Space::Unknown).unwrap()
}

/// Random bits of a type; floats with some NaN, infinities and negative zeros.
fn noise(grid: Grid, channels: usize, kind: usize, seed: u64) -> Volume {
    let mut random = Random(seed);
    let n = grid.len() * channels;
    macro_rules! ints {
        ($t:ty) => {
            <$t>::wrap((0..n).map(|_| random.next() as $t).collect())
        };
    }
    macro_rules! floats {
        ($t:ty) => {
            <$t>::wrap(
                (0..n)
                    .map(|_| match random.next() % 50 {
                        0 => <$t>::NAN,
                        1 => <$t>::INFINITY,
                        2 => -0.0,
                        _ => (random.unit() - 0.5) as $t * 1e6,
                    })
                    .collect(),
            )
        };
    }
    let samples = match kind {
        0 => ints!(u8),
        1 => ints!(i8),
        2 => ints!(u16),
        3 => ints!(i16),
        4 => ints!(u32),
        5 => ints!(i32),
        6 => floats!(f32),
        _ => floats!(f64),
    };
    Volume::new(grid, channels, samples)
}

fn make(grid: Grid, f: impl Fn(DVec3) -> f64) -> Volume {
    let samples = voxels(&grid).map(|v| f(grid.world_from_voxel.transform_point3(v))).collect();
    Volume::new(grid, 1, Samples::F64(samples))
}

fn voxels(grid: &Grid) -> impl Iterator<Item = DVec3> + use<> {
    let [nx, ny, nz] = grid.dims;
    (0..nx * ny * nz).map(move |n| DVec3::new((n % nx) as f64, (n / nx % ny) as f64, (n / nx / ny) as f64))
}

/// A smooth blob with ripples a few voxels long, as u8.
fn blob(grid: Grid) -> Volume {
    let (center, size) = (grid.center(), grid.size().min_element() * grid.finest());
    let real = make(grid, |p| {
        let r = (p - center).length() / size;
        let p = p / grid.finest();
        90.0 + 80.0 * (-8.0 * r * r).exp() + 50.0 * (0.9 * p.x).sin() * (0.8 * p.y).cos()
    });
    let Samples::F64(v) = &real.samples else { unreachable!() };
    Volume::new(grid, 1, Samples::U8(v.iter().map(|v| u8::from_f64(*v)).collect()))
}

fn run(volume: &Volume, map: &dyn ExportMap, options: ExportOptions) -> (Volume, ExportReport) {
    export(volume, map, &options, &unwatched).unwrap()
}

fn same() -> ExportOptions {
    ExportOptions { grid: GridChoice::Same, ..ExportOptions::default() }
}

const BOTH: [Precision; 2] = [Precision::Fast, Precision::Reference];

// ------------------------------------------------------------------------------------------------ bit-exactness

#[test]
fn the_identity_is_bit_exact_for_all_types_channels_and_ways() {
    for kind in 0..8 {
        for channels in 1..=4 {
            let volume = noise(skew([37, 11, 9]), channels, kind, 7);
            for interpolation in Interpolation::ALL {
                for precision in BOTH {
                    let options = ExportOptions { interpolation, precision, ..same() };
                    // once without supports, and once with a box that moves nothing
                    let (a, report) = run(&volume, &Identity, options);
                    let (b, _) = run(&volume, &shift(&volume.grid, DVec3::ZERO), options);
                    for made in [a, b] {
                        assert_eq!(made.samples.bytes(), volume.samples.bytes(), "{kind} {channels} {interpolation:?}");
                        assert_eq!((made.grid, made.channels), (volume.grid, channels));
                    }
                    assert_eq!((report.moved, report.outside, report.clipped), (0, 0, 0));
                }
            }
        }
    }
}

#[test]
fn shifts_by_whole_voxels_are_bit_exact_and_leave_the_outside_value() {
    let dims = [35, 12, 10];
    let by = [3i64, -2, 4];
    for kind in 0..8 {
        for channels in [1, 3] {
            let volume = noise(skew(dims), channels, kind, 11);
            let vector = volume.grid.world_from_voxel.transform_vector3(DVec3::new(3.0, -2.0, 4.0));
            for interpolation in Interpolation::ALL {
                for precision in BOTH {
                    let options = ExportOptions { interpolation, precision, outside: Some(9.0), ..same() };
                    let (made, report) = run(&volume, &shift(&volume.grid, vector), options);
                    let mut outside = 0;
                    for (n, at) in voxels(&volume.grid).enumerate() {
                        let from: [i64; 3] = std::array::from_fn(|a| at[a] as i64 - by[a]);
                        let inside = (0..3).all(|a| (0..dims[a] as i64).contains(&from[a]));
                        outside += u64::from(!inside);
                        for c in 0..channels {
                            let got = made.samples.get(n * channels + c);
                            let [x, y, z] = from.map(|v| v as usize);
                            let want = if inside { volume.samples.get(volume.index(x, y, z) + c) } else { 9.0 };
                            assert_eq!(got.to_bits(), want.to_bits(), "{kind} {interpolation:?} {precision:?} {at}");
                        }
                    }
                    assert_eq!(report.outside, outside);
                    assert_eq!(report.moved, report.voxels);
                }
            }
        }
    }
}

#[test]
fn voxels_that_a_stack_leaves_alone_keep_their_bits() {
    let grid = skew([64, 40, 30]);
    let map = stack(&grid);
    for kind in [0, 3, 5, 6, 7] {
        let volume = noise(grid, 1, kind, 2);
        let (made, report) = run(&volume, &map, same());
        let (mut touched, mut moved) = (0, 0);
        for (n, at) in voxels(&grid).enumerate() {
            let p = grid.world_from_voxel.transform_point3(at);
            let d = grid.voxel_from_world().transform_vector3(map.backward(p) - p);
            if d == DVec3::ZERO {
                assert_eq!(made.samples.get(n).to_bits(), volume.samples.get(n).to_bits());
            } else {
                touched += 1;
                moved += u64::from(d.abs().max_element() > 1e-3);
            }
        }
        assert!(touched > 10_000 && grid.len() - touched > 10_000, "{touched}");
        assert!(moved.abs_diff(report.moved) < moved / 500, "{moved} {}", report.moved);
    }
}

#[test]
fn a_grown_grid_keeps_all_of_a_shifted_volume_and_clips_nothing() {
    let volume = noise(skew([20, 14, 9]), 1, 2, 3);
    let vector = volume.grid.world_from_voxel.transform_vector3(DVec3::new(-5.0, 2.0, 0.0));
    for precision in BOTH {
        let options = ExportOptions { grid: GridChoice::SameGrown, precision, outside: Some(0.0), ..same() };
        let (made, report) = run(&volume, &shift(&volume.grid, vector), options);
        assert_eq!(made.grid.dims, [25, 16, 9]);
        assert_eq!(report.clipped, 0);
        assert_eq!(report.after.max, report.before.max);
        assert!((report.mass_after / report.mass_before - 1.0).abs() < 1e-12);
        for (i, j, k) in [(0, 0, 0), (19, 13, 8), (7, 5, 3)] {
            assert_eq!(made.samples.get(made.index(i, j + 2, k)), volume.samples.get(volume.index(i, j, k)));
        }
        // the same on the volume's own grid: five columns to the left and two rows above are lost
        let options = ExportOptions { grid: GridChoice::Same, ..options };
        let (_, report) = run(&volume, &shift(&volume.grid, vector), options);
        let mut lost = 0;
        for (n, at) in voxels(&volume.grid).enumerate() {
            lost += u64::from((at.x < 5.0 || at.y >= 12.0) && volume.samples.get(n) != 0.0);
        }
        assert_eq!(report.clipped, lost);
    }
}

#[test]
fn labels_stay_labels() {
    let grid = skew([24, 22, 18]);
    let labels = [3u16, 17, 40_000];
    let mut random = Random(5);
    let samples = (0..grid.len()).map(|_| labels[random.next() as usize % 3]).collect();
    let volume = Volume::new(grid, 1, Samples::U16(samples));
    let map = turn(&grid, DMat3::from_rotation_z(0.3));
    for precision in BOTH {
        let options = ExportOptions { interpolation: Interpolation::Nearest, precision, outside: Some(0.0), ..same() };
        let (made, report) = run(&volume, &map, options);
        let Samples::U16(v) = &made.samples else { panic!("the type changed") };
        assert!(v.iter().all(|v| *v == 0 || labels.contains(v)));
        assert_eq!(v.iter().filter(|v| **v == 0).count() as u64, report.outside);
        assert!(report.outside > 0 && report.moved > report.voxels / 2);
    }
}

// ------------------------------------------------------------------------------------------------ analytic fields

#[test]
fn a_ramp_under_a_smooth_map_takes_the_analytic_value() {
    let grid = skew([40, 36, 20]);
    let (slope, offset) = (DVec3::new(3.0, -5.0, 2.0), 17.0);
    let volume = make(grid, |p| slope.dot(p) + offset);
    let pulled = pulls(vec![
        (tilted(grid.center(), DVec3::new(14.0, 12.0, 16.0)), DVec3::new(2.0, -1.5, 1.0)),
        (tilted(grid.center() + DVec3::new(3.0, 4.0, -2.0), DVec3::new(11.0, 9.0, 10.0)), DVec3::new(-1.0, 1.2, 1.4)),
    ]);
    let turned = turn(&grid, DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.1, 0.25, -0.2))));
    let strokes = stack(&grid);
    let maps: [&dyn ExportMap; 3] = [&pulled, &turned, &strokes];
    for choice in [GridChoice::Same, GridChoice::Given(rotated(grid.center(), 25))] {
        for (precision, tolerance) in [(Precision::Reference, 1e-9), (Precision::Fast, 1e-3)] {
            for interpolation in [Interpolation::Linear, Interpolation::Cubic] {
                let options = ExportOptions { grid: choice, precision, interpolation, ..same() };
                for (m, map) in maps.iter().enumerate() {
                    let (made, report) = export(&volume, *map, &options, &unwatched).unwrap();
                    let (mut checked, mut worst) = (0, 0.0f64);
                    for (n, at) in voxels(&made.grid).enumerate() {
                        let q = map.backward(made.grid.world_from_voxel.transform_point3(at));
                        let from = grid.voxel_from_world().transform_point3(q);
                        // Catmull-Rom needs one more sample than linear on each side
                        let rim = if interpolation == Interpolation::Cubic { 1.0 } else { 0.0 };
                        if from.cmpge(DVec3::splat(rim)).all() && (from + 1.0 + rim).cmple(grid.size()).all() {
                            worst = worst.max((made.samples.get(n) - slope.dot(q) - offset).abs());
                            checked += 1;
                        }
                    }
                    // the field rises by up to 12 per voxel
                    assert!(worst < 12.0 * tolerance, "{choice:?} {precision:?} {interpolation:?} {m}: {worst}");
                    assert!(checked > made.grid.len() / 4 && report.moved > 1000, "{checked} {report:?}");
                }
            }
        }
    }
}

#[test]
fn a_finer_spacing_fills_the_same_cube_and_the_same_spacing_is_the_same_grid() {
    let volume = blob(skew([20, 16, 12]));
    let spacing = volume.grid.spacing();
    let at = |spacing| ExportOptions { grid: GridChoice::Spacing { spacing, grown: false }, ..same() };
    let (made, _) = run(&volume, &Identity, at(spacing));
    assert_eq!((made.grid.dims, &made.samples), (volume.grid.dims, &volume.samples));
    let (made, report) = run(&volume, &Identity, at(spacing / DVec3::new(2.0, 3.0, 1.0)));
    assert_eq!(made.grid.dims, [40, 48, 12]);
    assert_eq!((report.outside, report.clipped, report.moved), (0, 0, 0));
    for (a, b) in made.grid.corners().iter().zip(volume.grid.corners()) {
        assert!((*a - b).length() < 1e-9);
    }
    // every third row's middle one lies on a row of the input; the two columns of a voxel lie a quarter beside it
    for (i, j, k) in [(7, 5, 3), (19, 0, 11), (0, 15, 0)] {
        for (column, side) in [(2 * i, -0.25), (2 * i + 1, 0.25)] {
            let p = DVec3::new(i as f64 + side, j as f64, k as f64);
            let want = value_at(&volume, Interpolation::Linear, p, 0.0)[0];
            assert!((made.samples.get(made.index(column, 3 * j + 1, k)) - want).abs() <= 0.5 + 1e-4);
        }
    }
    // a spacing that does not divide the edge covers it
    let (made, _) = run(&volume, &Identity, at(spacing * 1.7));
    assert_eq!(made.grid.dims, [12, 10, 8]);
}

// ------------------------------------------------------------------------------------------------ fast against reference

/// Greatest and mean difference, in grey levels.
fn differences(a: &Volume, b: &Volume) -> (f64, f64) {
    assert_eq!(a.samples.len(), b.samples.len());
    let (mut worst, mut sum) = (0.0f64, 0.0);
    for i in 0..a.samples.len() {
        let d = (a.samples.get(i) - b.samples.get(i)).abs();
        worst = worst.max(d);
        sum += d;
    }
    (worst, sum / a.samples.len() as f64)
}

#[test]
fn the_fast_path_is_within_a_grey_level_of_the_reference() {
    for grid in [plain([67, 60, 45]), skew([67, 50, 35])] {
        let volume = blob(grid);
        let far = grid.world_from_voxel.transform_point3(DVec3::new(5.0, 40.0, 20.0));
        let pulled = pulls(vec![
            (tilted(grid.center(), DVec3::new(22.0, 30.0, 26.0)), DVec3::new(4.0, -3.0, 5.0)),
            (tilted(far, DVec3::new(14.0, 12.0, 15.0)), DVec3::new(-4.0, 1.0, 0.5)),
            // smaller than a cell
            (tilted(grid.center(), DVec3::splat(3.0)), DVec3::new(0.5, 0.0, 0.3)),
        ]);
        let strokes = stack(&grid);
        let maps: [&dyn ExportMap; 2] = [&pulled, &strokes];
        for map in maps {
            for choice in [GridChoice::Same, GridChoice::SameGrown, GridChoice::Given(rotated(grid.center(), 47))] {
                for interpolation in [Interpolation::Linear, Interpolation::Cubic] {
                    let fast = ExportOptions { grid: choice, interpolation, ..same() };
                    let exact = ExportOptions { precision: Precision::Reference, ..fast };
                    let (a, ra) = export(&volume, map, &fast, &unwatched).unwrap();
                    let (b, rb) = export(&volume, map, &exact, &unwatched).unwrap();
                    assert_eq!(a.grid, b.grid);
                    let (worst, mean) = differences(&a, &b);
                    assert!(worst <= 1.0 && mean < 2e-3, "{choice:?} {interpolation:?}: {worst} {mean}");
                    let close = |x: u64, y: u64| x.abs_diff(y) <= 3 + y / 200;
                    assert!(close(ra.moved, rb.moved) && close(ra.outside, rb.outside), "{ra:?} {rb:?}");
                    assert!(close(ra.clipped, rb.clipped), "{ra:?} {rb:?}");
                    assert!(ra.moved > 5000);
                }
            }
        }
    }
}

/// A stack that does not tell that it can be written in voxel coordinates.
struct Opaque(Prepared);

impl BackwardMap for Opaque {
    fn backward(&self, p: DVec3) -> DVec3 {
        self.0.backward(p)
    }
    fn backward_with_jacobian(&self, p: DVec3) -> (DVec3, DMat3) {
        self.0.backward_with_jacobian(p)
    }
    fn supports(&self) -> Vec<OrientedBox> {
        self.0.supports()
    }
}

impl ExportMap for Opaque {}

#[test]
fn what_a_search_skips_holds_no_material() {
    for grid in [plain([44, 40, 31]), skew([40, 36, 30])] {
        let mut volume = blob(grid);
        // out through five of the faces
        let strokes = (0..5).map(|face| {
            let mut out = DVec3::ZERO;
            out[face / 2] = if face % 2 == 0 { 1.0 } else { -1.0 };
            let half = grid.world_from_voxel.transform_vector3(out * 0.5 * grid.size());
            let wide = half.length();
            let extent = Extent { u: 0.8 * wide, v: 0.6 * wide, length: 3.0 * wide };
            let pull = DisplacementVolume::new(grid.center() + 0.8 * half, 0.3 * half, extent, None).unwrap();
            Deformation::new("", Deformer::Displacement(pull))
        });
        let map = Stack { items: strokes.collect() }.prepared();
        let opaque = Opaque(map.clone());
        // a hole in the middle, so that not all of a pull is material
        let Samples::U8(v) = &mut volume.samples else { panic!("the type") };
        v.iter_mut().step_by(3).for_each(|v| *v = 20);
        let shifted = Grid { dims: [30, 50, 20], ..rotated(grid.center() + DVec3::new(8.0, -3.0, 5.0), 30) };
        for choice in [GridChoice::Same, GridChoice::SameGrown, GridChoice::Given(shifted)] {
            for outside in [20.0, 90.0] {
                let options = ExportOptions { grid: choice, outside: Some(outside), ..same() };
                let (a, ra) = run(&volume, &map, options);
                let (b, rb) = run(&volume, &opaque, options);
                assert_eq!(a.grid, b.grid, "{choice:?}");
                assert!(differences(&a, &b).0 <= 1.0);
                assert!(ra.clipped.abs_diff(rb.clipped) <= 1 + rb.clipped / 500, "{choice:?} {ra:?} {rb:?}");
                assert_eq!(rb.clipped > 100, choice != GridChoice::SameGrown, "{choice:?} {rb:?}");
            }
        }
    }
}

#[test]
fn a_pull_over_more_voxels_than_f32_can_count_arrives() {
    let volume = blob(plain([24, 20, 16]));
    let center = volume.grid.center();
    let vector = DVec3::new(3e5, 1e5, -2e5);
    let extent = Extent { u: 2e6, v: 2e6, length: 6e6 };
    let pull = DisplacementVolume::new(center, vector, extent, None).unwrap();
    let map = Stack { items: vec![Deformation::new("", Deformer::Displacement(pull))] }.prepared();
    let there = Grid::aligned([30, 26, 22], DVec3::ONE, vector - 3.0).unwrap();
    let options = ExportOptions { grid: GridChoice::Given(there), outside: Some(0.0), ..same() };
    let (made, report) = run(&volume, &map, options);
    let (want, reference) = run(&volume, &map, ExportOptions { precision: Precision::Reference, ..options });
    assert!(differences(&made, &want).0 <= 1.0);
    assert_eq!((report.moved, report.outside), (reference.moved, reference.outside));
    assert!(report.voxels - report.outside > 20 * 16 * 12, "{report:?}");
}

#[test]
fn all_types_and_channels_agree_with_the_reference_within_rounding() {
    let grid = skew([45, 20, 18]);
    let map = stack(&grid);
    for kind in 0..8 {
        for channels in [1, 2, 3, 4] {
            // noise is the worst case: a voxel is as steep as the type allows
            let volume = noise(grid, channels, kind, 4);
            let (a, _) = run(&volume, &map, same());
            let (b, _) = run(&volume, &map, ExportOptions { precision: Precision::Reference, ..same() });
            let mut one_sided = 0;
            let scale = [256.0, 256.0, 65536.0, 65536.0, 2f64.powi(32), 2f64.powi(32), 1e6, 1e6][kind];
            for i in 0..a.samples.len() {
                let (x, y) = (a.samples.get(i), b.samples.get(i));
                if x.is_finite() && y.is_finite() {
                    // coordinates are good to 1e-5 voxel on three axes
                    assert!((x - y).abs() <= 1.0 + 3e-5 * scale, "{kind} {channels} {i}: {x} {y}");
                } else {
                    // a weight of 1e-9 lets a NaN through where one rounded to zero does not
                    one_sided += usize::from(x.is_finite() != y.is_finite());
                }
            }
            assert!(one_sided <= a.samples.len() / 1000, "{one_sided}");
        }
    }
}

#[test]
fn a_pull_through_the_face_grows_the_grid_or_is_counted() {
    let mut volume = blob(plain([40, 40, 40]));
    volume.rescale = Rescale { slope: 0.5, intercept: -10.0 };
    // the upper x face is pulled out by six voxels
    let support =
        OrientedBox { center: DVec3::new(36.0, 20.0, 20.0), axes: DMat3::IDENTITY, half: DVec3::new(20.0, 12.0, 12.0) };
    let map = pulls(vec![(support, DVec3::new(6.0, 0.0, 0.0))]);
    let options = ExportOptions { outside: Some(-10.0), ..same() };
    let (_, clipped) = run(&volume, &map, options);
    let (grown, report) = run(&volume, &map, ExportOptions { grid: GridChoice::SameGrown, ..options });
    assert_eq!(&grown.grid.dims[1..], &[40, 40]);
    assert!((44..=46).contains(&grown.grid.dims[0]), "{:?}", grown.grid.dims);
    assert_eq!(grown.rescale, volume.rescale);
    assert_eq!(report.clipped, 0);
    let width = grown.grid.dims[0];
    let material = |i: &usize| i % width >= 40 && grown.samples.get(*i) != 0.0;
    let beyond = (0..grown.samples.len()).filter(material).count() as u64;
    assert_eq!(clipped.clipped, beyond);
    assert!(beyond > 500);
    // the last layer is not idle
    assert!((0..40 * 40).any(|row| grown.samples.get((row + 1) * width - 1) != 0.0));
    // the statistics are of real values
    let lowest = (0..volume.samples.len()).map(|i| volume.samples.get(i)).fold(f64::INFINITY, f64::min);
    assert_eq!(report.before.min, 0.5 * lowest - 10.0);
    let sum: f64 = (0..grown.samples.len()).map(|i| 0.5 * grown.samples.get(i) - 10.0).sum();
    assert!((report.mass_after - sum).abs() < 1e-6 * sum.abs());
}

#[test]
fn the_default_outside_value_is_the_lowest_of_a_scalar_volume_and_nothing_elsewhere() {
    let grid = plain([4, 4, 4]);
    // near enough that every voxel beyond the grid is looked at, so that the count is exact
    let away = shift(&grid, DVec3::splat(20.0));
    let mut volume = Volume::new(grid, 1, Samples::I16((0..64).map(|i| i - 1024).collect()));
    let (made, _) = run(&volume, &away, same());
    assert!((0..64).all(|i| made.samples.get(i) == -1024.0));
    volume.rescale = Rescale { slope: -2.0, intercept: 1.0 };
    let (made, _) = run(&volume, &away, same());
    assert!((0..64).all(|i| made.samples.get(i) == -1024.0 + 63.0));
    let (made, _) = run(&volume, &away, ExportOptions { outside: Some(21.0), ..same() });
    assert!((0..64).all(|i| made.samples.get(i) == -10.0));
    let rgba = noise(grid, 4, 0, 1);
    let (made, report) = run(&rgba, &away, same());
    assert!((0..256).all(|i| made.samples.get(i) == 0.0));
    assert_eq!(report.clipped, 64);
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let volume = blob(skew([50, 40, 41]));
    let pulled = pulls(vec![(tilted(volume.grid.center(), DVec3::splat(25.0)), DVec3::new(3.0, 4.0, -2.0))]);
    let strokes = stack(&volume.grid);
    let maps: [&dyn ExportMap; 2] = [&pulled, &strokes];
    for map in maps {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| export(&volume, map, &ExportOptions::default(), &unwatched).unwrap())
        };
        let ((a, ra), (b, rb)) = (with(1), with(2));
        assert_eq!(a, b);
        assert_eq!(ExportReport { ms: 0.0, ..ra }, ExportReport { ms: 0.0, ..rb });
    }
}

// ------------------------------------------------------------------------------------------------ odd input

#[test]
fn nan_does_not_spread_beyond_its_neighbours() {
    let grid = plain([40, 16, 16]);
    let mut volume = Volume::new(grid, 1, Samples::F32(vec![5.0; grid.len()]));
    let hole = volume.index(9, 8, 7);
    if let Samples::F32(v) = &mut volume.samples {
        v[hole] = f32::NAN;
    }
    for precision in BOTH {
        // half a voxel along i only: the two voxels beside the hole and nothing else
        let options = ExportOptions { precision, ..same() };
        let (made, report) = run(&volume, &shift(&volume.grid, DVec3::new(0.5, 0.0, 0.0)), options);
        let bad: Vec<usize> = (0..made.samples.len()).filter(|i| made.samples.get(*i).is_nan()).collect();
        assert_eq!(bad, vec![hole, hole + 1], "{precision:?}");
        assert_eq!((report.before.nan, report.after.nan), (1, 2));
        assert_eq!((report.after.min, report.after.max), (5.0, 5.0));
    }
}

#[test]
fn a_map_that_fails_gives_the_outside_value() {
    let fails = |p: DVec3| {
        if p.x > 8.0 {
            DVec3::NAN
        } else if p.y > 8.0 {
            DVec3::splat(1e300)
        } else {
            p
        }
    };
    let broken = Formula { backward: fails, supports: around(&plain([17, 17, 5]), 1.0) };
    let volume = noise(plain([17, 17, 5]), 1, 0, 1);
    for precision in BOTH {
        for interpolation in Interpolation::ALL {
            let options = ExportOptions { precision, interpolation, outside: Some(77.0), ..same() };
            let (made, report) = run(&volume, &broken, options);
            assert_eq!(report.outside, (17 * 17 - 81) * 5);
            assert_eq!(made.samples.get(made.index(8, 8, 2)), volume.samples.get(volume.index(8, 8, 2)));
            assert_eq!(made.samples.get(made.index(9, 0, 2)), 77.0);
        }
    }
}

#[test]
fn one_voxel_and_one_layer() {
    for dims in [[1, 1, 1], [1, 40, 3], [33, 1, 1], [2, 2, 1]] {
        let volume = noise(skew(dims), 2, 1, 9);
        let part = volume.grid.world_from_voxel.transform_vector3(DVec3::new(0.3, 0.2, -0.4));
        for precision in BOTH {
            for interpolation in Interpolation::ALL {
                let options = ExportOptions { precision, interpolation, ..same() };
                let (made, _) = run(&volume, &Identity, options);
                assert_eq!(made.samples, volume.samples);
                let (made, _) = run(&volume, &shift(&volume.grid, part), options);
                let p = DVec3::new(-0.3, -0.2, 0.4);
                for c in 0..2 {
                    let want = value_at(&volume, interpolation, p, 0.0)[c];
                    let got = made.samples.get(c);
                    assert!((got - want).abs() <= 0.5 + 1e-4, "{dims:?} {interpolation:?} {got} {want}");
                }
            }
        }
    }
}

#[test]
fn senseless_wishes_are_refused_in_one_sentence() {
    let volume = noise(plain([8, 8, 8]), 1, 0, 1);
    let refused = |grid, limit| {
        let options = ExportOptions { grid, limit, ..ExportOptions::default() };
        export(&volume, &shift(&volume.grid, DVec3::X), &options, &unwatched).unwrap_err()
    };
    for spacing in [DVec3::ZERO, DVec3::new(1.0, -1.0, 1.0), DVec3::NAN, DVec3::splat(f64::INFINITY)] {
        let error = refused(GridChoice::Spacing { spacing, grown: true }, 1 << 30);
        assert!(matches!(error, ExportError::Spacing(_)));
        assert!(!error.to_string().contains('\n'));
    }
    assert!(matches!(
        refused(GridChoice::Spacing { spacing: DVec3::splat(1e-3), grown: false }, 1 << 30),
        ExportError::TooLarge { voxels: 512_000_000_000, .. }
    ));
    let tiny = GridChoice::Spacing { spacing: DVec3::splat(1e-300), grown: false };
    assert!(matches!(refused(tiny, 1 << 30), ExportError::Grid(_) | ExportError::TooLarge { .. }));
    assert!(matches!(refused(GridChoice::SameGrown, 520), ExportError::TooLarge { .. }));
    let flat = Grid { dims: [0, 4, 4], ..volume.grid };
    assert!(matches!(refused(GridChoice::Given(flat), 1 << 30), ExportError::Grid(_)));
    // a box beyond all measure, and one that is no number
    for half in [1e300, f64::NAN, f64::INFINITY] {
        let support = OrientedBox { half: DVec3::splat(half), ..around(&volume.grid, 0.0)[0] };
        let map = Formula { backward: |p| p, supports: vec![support] };
        let (made, report) = run(&volume, &map, same());
        assert_eq!(made.samples, volume.samples);
        assert_eq!(report.clipped, 0);
    }
}

#[test]
fn a_stop_is_heeded_and_progress_reaches_the_end() {
    let volume = noise(plain([20, 20, 80]), 1, 0, 1);
    let calls = AtomicUsize::new(0);
    let stop = |_| {
        calls.fetch_add(1, Ordering::Relaxed);
        ControlFlow::Break(())
    };
    assert_eq!(export(&volume, &Identity, &same(), &stop).unwrap_err(), ExportError::Cancelled);
    assert!((1..10).contains(&calls.load(Ordering::Relaxed)));
    let last = AtomicUsize::new(0);
    let watch = |done: f64| {
        last.fetch_max((done * 1000.0) as usize, Ordering::Relaxed);
        ControlFlow::Continue(())
    };
    export(&volume, &Identity, &same(), &watch).unwrap();
    assert_eq!(last.load(Ordering::Relaxed), 1000);
}

// ------------------------------------------------------------------------------------------------ the field

#[test]
fn the_field_leads_every_voxel_to_its_source() {
    let volume = blob(skew([30, 22, 17]));
    let map = pulls(vec![(tilted(volume.grid.center(), DVec3::splat(9.0)), DVec3::new(3.0, 2.0, -2.0))]);
    let field = export_field(&volume.grid, &map, &unwatched).unwrap();
    assert_eq!((field.channels, field.grid), (3, volume.grid));
    let (made, report) = run(&volume, &map, ExportOptions { precision: Precision::Reference, ..same() });
    let (Samples::F32(v), Samples::U8(input)) = (&field.samples, &volume.samples) else { panic!("types") };
    let sampler = Sampler::new(input, volume.grid.dims, 1);
    let mut moved = 0;
    for ((n, at), d) in voxels(&volume.grid).enumerate().zip(v.chunks_exact(3)) {
        let d = DVec3::new(f64::from(d[0]), f64::from(d[1]), f64::from(d[2]));
        moved += u64::from(d.length() > 1e-3);
        let q = volume.grid.world_from_voxel.transform_point3(at) + d;
        if let Some(value) = sampler.linear(volume.grid.voxel_from_world().transform_point3(q)) {
            assert!((made.samples.get(n) - value[0]).abs() <= 0.5 + 1e-3);
        }
    }
    assert!(moved > 1000 && moved.abs_diff(report.moved) < report.moved / 20);
}

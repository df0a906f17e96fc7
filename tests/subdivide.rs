//! Refinement of slice triangles: no cracks, no lost area, second order, the tolerance met, and f32 corners against f64.

use std::collections::HashMap;

use glam::{DAffine3, DMat3, DVec2, DVec3};
use voxclay::deform::{Deformation, Deformer, DisplacementVolume, Extent, Falloff, Grab, Lattice, Prepared, Stack};
use voxclay::math::{BackwardMap, Identity, OrientedBox, PlaneFrame};
use voxclay::subdivide::{Corner, NextSlice, Refiner, Rule, Smallest, Supports, Texturing, corners};

/// A small generator, so that every run sees the same numbers.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// The square [-50,50]^2 of a plane as a bumpy triangulation, n x n cells.
struct Sheet {
    frame: PlaneFrame,
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl Sheet {
    fn new(normal: DVec3, n: u32, r: &mut Random) -> Self {
        let frame = PlaneFrame::across(normal).unwrap();
        let mut points = Vec::new();
        for j in 0..=n {
            for i in 0..=n {
                let mut q = DVec2::new(f64::from(i), f64::from(j)) * (100.0 / f64::from(n)) - 50.0;
                let inner = |k: u32| k != 0 && k != n;
                let wobble = DVec2::new(r.unit() - 0.5, r.unit() - 0.5) * (60.0 / f64::from(n));
                q += DVec2::new(if inner(i) { wobble.x } else { 0.0 }, if inner(j) { wobble.y } else { 0.0 });
                points.push(frame.lift(q, 1.7));
            }
        }
        let mut triangles = Vec::new();
        for j in 0..n {
            for i in 0..n {
                let at = |di: u32, dj: u32| (j + dj) * (n + 1) + i + di;
                let [a, b, c, d] = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
                let halves = if r.unit() < 0.5 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
                // any corner may come first
                triangles.extend(halves.map(|mut t| {
                    t.rotate_left((r.unit() * 3.0) as usize);
                    t
                }));
            }
        }
        Self { frame, points, triangles }
    }
}

fn area(p: &[DVec3], t: [u32; 3], normal: DVec3) -> f64 {
    let [a, b, c] = t.map(|i| p[i as usize]);
    0.5 * (b - a).cross(c - a).dot(normal)
}

/// Every edge belongs to two triangles, one each way, or lies on the border of the square; the area is all there.
fn check_sound(sheet: &Sheet, refined: &Refiner) {
    let (positions, triangles) = (refined.positions(), refined.triangles());
    assert_eq!(&positions[..sheet.points.len()], &sheet.points[..]);
    let mut sides: HashMap<(u32, u32), u32> = HashMap::new();
    for t in triangles {
        for i in 0..3 {
            *sides.entry((t[i], t[(i + 1) % 3])).or_default() += 1;
        }
    }
    for (&(a, b), &count) in &sides {
        assert_eq!(count, 1, "an edge is used twice in the same direction");
        if !sides.contains_key(&(b, a)) {
            let [p, q] = [a, b].map(|i| sheet.frame.project(positions[i as usize]));
            let on_border = (0..2).any(|k| (p[k].abs() - 50.0).abs() < 1e-9 && (p[k] - q[k]).abs() < 1e-9);
            assert!(on_border, "a crack from {p} to {q}");
        }
    }
    let total: f64 = triangles.iter().map(|t| area(positions, *t, sheet.frame.normal)).sum();
    assert!((total - 1e4).abs() < 1e-8, "{total}");
    assert!(triangles.iter().all(|t| area(positions, *t, sheet.frame.normal) > 0.0));
    // no vertex is there twice or for nothing
    let mut seen = vec![false; positions.len()];
    triangles.iter().flatten().for_each(|i| seen[*i as usize] = true);
    assert!(seen.iter().all(|s| *s));
    let mut sorted: Vec<_> = positions.iter().map(|p| p.to_array().map(f64::to_bits)).collect();
    sorted.sort_unstable();
    sorted.dedup();
    assert_eq!(sorted.len(), positions.len());
}

/// Overlapping strokes of all tools round the middle of the sheet.
fn strokes() -> Stack {
    let displacement = |point: DVec3, vector: DVec3, radius: f64| {
        Deformer::Displacement(DisplacementVolume::from_drag(point, vector, radius).unwrap())
    };
    let axes = DMat3::from_rotation_z(0.4) * DMat3::from_rotation_x(0.3);
    let support = OrientedBox { center: DVec3::new(-15.0, 12.0, 4.0), axes, half: DVec3::new(14.0, 17.0, 12.0) };
    let lattice = Lattice::new(support, [3, 4, 3])
        .unwrap()
        .with_vectors(|[i, j, k], _| DVec3::new(1.0 - i as f64, j as f64 - 1.5, k as f64 - 0.5))
        .unwrap();
    let all = [
        displacement(DVec3::new(5.0, 3.0, 0.0), DVec3::new(6.0, 2.0, 3.0), 18.0),
        displacement(DVec3::new(12.0, -3.0, 2.0), DVec3::new(-1.0, 5.0, -3.0), 15.0),
        Deformer::Grab(
            Grab::new(DVec3::new(-8.0, -20.0, 3.0), DVec3::new(3.0, 2.0, -2.0), 12.0, Falloff::Core(0.3)).unwrap(),
        ),
        Deformer::Lattice(lattice),
    ];
    Stack { items: all.into_iter().map(|d| Deformation::new("stroke", d)).collect() }
}

fn supports(map: &Prepared) -> Supports {
    Supports::new(map, Some(map.feature_size()))
}

/// Largest error of the interpolated map at random points of all triangles, in voxels.
fn worst(
    refined: &Refiner,
    map: &impl BackwardMap,
    voxel_from_world: DMat3,
    per_triangle: usize,
    r: &mut Random,
) -> f64 {
    let images: Vec<DVec3> = refined.positions().iter().map(|p| map.backward(*p)).collect();
    let mut worst = 0.0_f64;
    for t in refined.triangles() {
        let [p, q] = [refined.positions(), &images].map(|of| t.map(|i| of[i as usize]));
        for _ in 0..per_triangle {
            let (mut a, mut b) = (r.unit(), r.unit());
            if a + b > 1.0 {
                (a, b) = (1.0 - a, 1.0 - b);
            }
            let mix = |v: [DVec3; 3]| v[0] * (1.0 - a - b) + v[1] * a + v[2] * b;
            worst = worst.max((voxel_from_world * (map.backward(mix(p)) - mix(q))).length());
        }
    }
    worst
}

/// World to texture for a volume of 128 x 96 x 160 voxels, skewed a little.
fn placement() -> (DAffine3, DVec3) {
    let m = DMat3::from_cols(DVec3::new(0.01, 0.001, 0.0), DVec3::new(0.0, 0.012, 0.0), DVec3::new(0.001, 0.0, 0.009));
    (DAffine3::from_mat3_translation(m, DVec3::new(0.5, 0.5, 0.5)), DVec3::new(128.0, 96.0, 160.0))
}

const NORMALS: [DVec3; 3] = [DVec3::Z, DVec3::new(0.3, -0.5, 0.8), DVec3::new(-1.0, 0.2, 0.1)];

#[test]
fn refinement_leaves_no_crack_and_no_area() {
    let mut r = Random(1);
    let map = strokes().prepared();
    let (texture, size) = placement();
    let mut refiner = Refiner::default();
    for normal in NORMALS {
        for n in [1, 2, 7, 20] {
            let sheet = Sheet::new(normal, n, &mut r);
            for depth in 0..5 {
                refiner.refine(
                    sheet.points.iter().copied(),
                    &sheet.triangles,
                    &map,
                    &supports(&map),
                    &Rule::uniform(depth),
                );
                check_sound(&sheet, &refiner);
            }
            for tolerance in [3.0, 0.3, 0.05] {
                let rule = Rule::within(tolerance, 12, &texture, size);
                refiner.refine(sheet.points.iter().copied(), &sheet.triangles, &map, &supports(&map), &rule);
                check_sound(&sheet, &refiner);
            }
        }
    }
}

#[test]
fn where_everything_is_displaced_each_level_makes_four_of_one() {
    let mut r = Random(2);
    let sheet = Sheet::new(DVec3::Z, 8, &mut r);
    let huge = Extent { u: 500.0, v: 500.0, length: 1000.0 };
    let volume = DisplacementVolume::new(DVec3::ZERO, DVec3::X * 20.0, huge, None).unwrap();
    let map = Stack { items: vec![Deformation::new("", Deformer::Displacement(volume))] }.prepared();
    let mut refiner = Refiner::default();
    for depth in 0..5 {
        refiner.refine(sheet.points.iter().copied(), &sheet.triangles, &map, &supports(&map), &Rule::uniform(depth));
        assert_eq!(refiner.triangles().len(), sheet.triangles.len() << (2 * depth));
        // a grid of n cells has (n+1)^2 vertices
        assert_eq!(refiner.positions().len(), ((8 << depth) + 1) * ((8 << depth) + 1));
        check_sound(&sheet, &refiner);
    }
}

#[test]
fn nothing_is_split_outside_the_boxes_nor_along_their_faces() {
    let mut refiner = Refiner::default();
    // two triangles share the edge x = 0; the box begins there
    let volume = DisplacementVolume::new(
        DVec3::new(9.0, 0.0, 0.0),
        DVec3::Z,
        Extent { u: 10.0, v: 10.0, length: 30.0 },
        Some(DVec3::X),
    )
    .unwrap();
    // u axis along x: from -1 to 19; put the seam at its face
    let face = volume.support().center.x - 10.0;
    let map = Stack { items: vec![Deformation::new("", Deformer::Displacement(volume))] }.prepared();
    let p = |x: f64, y: f64| DVec3::new(face + x, y, 1.0);
    let points = [p(0.0, -20.0), p(0.0, 20.0), p(-30.0, 0.0), p(60.0, 0.0)];
    let triangles = [[0, 1, 2], [0, 3, 1]];
    refiner.refine(points, &triangles, &map, &supports(&map), &Rule::uniform(3));
    // the outer one is whole, and no vertex lies on the seam but its ends
    assert!(refiner.triangles().contains(&[0, 1, 2]));
    assert!(refiner.triangles().len() > 10, "{:?} {:?}", refiner.triangles(), refiner.positions());
    assert_eq!(refiner.positions().iter().filter(|q| (q.x - face).abs() < 1e-12).count(), 2);
    // far away: as it was
    let far = points.map(|q| q + DVec3::Y * 300.0);
    refiner.refine(far, &triangles, &map, &supports(&map), &Rule::uniform(3));
    assert_eq!((refiner.triangles(), refiner.positions().len()), (&triangles[..], 4));
    // no deformation at all
    refiner.refine(points, &triangles, &Identity, &Supports::new(&Identity, None), &Rule::uniform(3));
    assert_eq!((refiner.triangles(), refiner.positions().len()), (&triangles[..], 4));
}

#[test]
fn the_error_falls_by_four_per_level() {
    let mut r = Random(3);
    let sheet = Sheet::new(DVec3::new(0.3, -0.5, 0.8), 24, &mut r);
    let map = strokes().prepared();
    let mut refiner = Refiner::default();
    let errors: Vec<f64> = (0..5)
        .map(|depth| {
            refiner.refine(
                sheet.points.iter().copied(),
                &sheet.triangles,
                &map,
                &supports(&map),
                &Rule::uniform(depth),
            );
            worst(&refiner, &map, DMat3::IDENTITY, if depth < 4 { 200 } else { 60 }, &mut r)
        })
        .collect();
    println!("{errors:?}");
    for pair in errors[1..].windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((3.2..5.0).contains(&ratio), "{errors:?}");
    }
    // and the total over four levels is that of second order
    assert!((errors[0] / errors[4]).log2() > 7.2, "{errors:?}");
}

#[test]
fn the_tolerance_is_met_everywhere() {
    let mut r = Random(4);
    let map = strokes().prepared();
    let (texture, size) = placement();
    let mut refiner = Refiner::default();
    for normal in NORMALS {
        for n in [1, 2, 6, 20] {
            let sheet = Sheet::new(normal, n, &mut r);
            let mut last = 0;
            for tolerance in [2.0, 0.5, 0.1, 0.02] {
                let rule = Rule::within(tolerance, 20, &texture, size);
                refiner.refine(sheet.points.iter().copied(), &sheet.triangles, &map, &supports(&map), &rule);
                let error = worst(&refiner, &map, rule.voxel_from_world, 30, &mut r);
                println!("n {n} tolerance {tolerance}: {error:.4} {} triangles", refiner.triangles().len());
                assert!(error <= tolerance, "{error} > {tolerance} with {} triangles", refiner.triangles().len());
                assert!(refiner.triangles().len() >= last);
                last = refiner.triangles().len();
            }
            // not by splitting everything: with the finest tolerance the error is not idle
            let rule = Rule::within(0.02, 20, &texture, size);
            assert!(worst(&refiner, &map, rule.voxel_from_world, 30, &mut r) > 0.2 * 0.02);
        }
    }
}

#[test]
fn a_box_within_one_triangle_is_found() {
    let volume = DisplacementVolume::from_drag(DVec3::new(3.0, -2.0, 0.0), DVec3::new(0.4, 0.1, 0.3), 1.0).unwrap();
    let map = Stack { items: vec![Deformation::new("", Deformer::Displacement(volume))] }.prepared();
    let points = [DVec3::new(-60.0, -50.0, 0.3), DVec3::new(70.0, -50.0, 0.3), DVec3::new(0.0, 80.0, 0.3)];
    let mut refiner = Refiner::default();
    let rule = Rule::within(0.02, 20, &DAffine3::from_scale(DVec3::splat(0.01)), DVec3::splat(100.0));
    refiner.refine(points, &[[0, 1, 2]], &map, &supports(&map), &rule);
    let mut r = Random(5);
    assert!(refiner.triangles().len() > 50);
    // samples where the box is
    let images: Vec<DVec3> = refiner.positions().iter().map(|p| map.backward(*p)).collect();
    let (mut inside, mut error) = (0, 0.0_f64);
    for t in refiner.triangles() {
        let p = t.map(|i| refiner.positions()[i as usize]);
        let q = t.map(|i| images[i as usize]);
        for _ in 0..20 {
            let (a, b) = (r.unit(), r.unit());
            let w = if a + b > 1.0 { [a + b - 1.0, 1.0 - a, 1.0 - b] } else { [1.0 - a - b, a, b] };
            let mix = |v: [DVec3; 3]| v[0] * w[0] + v[1] * w[1] + v[2] * w[2];
            inside += u32::from(map.backward(mix(p)) != mix(p));
            error = error.max((map.backward(mix(p)) - mix(q)).length());
        }
    }
    assert!(inside > 500 && error < 0.02, "{inside} {error}");
}

#[test]
fn edges_that_do_not_show_stay_whole() {
    let mut r = Random(6);
    let sheet = Sheet::new(DVec3::Z, 10, &mut r);
    let map = strokes().prepared();
    let (texture, size) = placement();
    let mut refiner = Refiner::default();
    let mut counts = Vec::new();
    for limit in [20.0, 6.0, 2.0, 0.5] {
        let rule = Rule { smallest: Smallest::Length(limit), ..Rule::within(1e-3, 9, &texture, size) };
        refiner.refine(sheet.points.iter().copied(), &sheet.triangles, &map, &supports(&map), &rule);
        check_sound(&sheet, &refiner);
        counts.push(refiner.triangles().len());
        // by place: the same where the function is constant, finer on one side where it is not
        let constant = |_: DVec3| limit;
        let triangles = refiner.triangles().to_vec();
        let rule = Rule { smallest: Smallest::At(&constant), ..rule };
        refiner.refine(sheet.points.iter().copied(), &sheet.triangles, &map, &supports(&map), &rule);
        assert_eq!(triangles, refiner.triangles());
        let sided = |p: DVec3| if p.x < 5.0 { limit } else { 1e9 };
        let rule = Rule { smallest: Smallest::At(&sided), ..rule };
        refiner.refine(sheet.points.iter().copied(), &sheet.triangles, &map, &supports(&map), &rule);
        check_sound(&sheet, &refiner);
        assert!(refiner.triangles().len() < triangles.len() || limit > 10.0);
        assert!(refiner.positions()[sheet.points.len()..].iter().all(|p| p.x < 5.0));
    }
    assert!(counts.windows(2).all(|c| c[0] < c[1]), "{counts:?}");
    // sides of 16 in the middle of a wide box: 16 and 8 and 4 are split, 2 is not
    let huge = Extent { u: 500.0, v: 500.0, length: 1000.0 };
    let volume = DisplacementVolume::new(DVec3::ZERO, DVec3::X * 20.0, huge, None).unwrap();
    let map = Stack { items: vec![Deformation::new("", Deformer::Displacement(volume))] }.prepared();
    let corners = [0.0, 120.0, 240.0]
        .map(|a: f64| DVec3::new(a.to_radians().cos(), a.to_radians().sin(), 0.0) * (16.0 / 3.0_f64.sqrt()));
    let rule = Rule { smallest: Smallest::Length(3.0), ..Rule::uniform(9) };
    refiner.refine(corners, &[[0, 1, 2]], &map, &supports(&map), &rule);
    assert_eq!(refiner.triangles().len(), 64);
}

#[test]
fn degenerate_triangles_pass_through() {
    let map = strokes().prepared();
    let (texture, size) = placement();
    let p = DVec3::new(8.0, 3.0, 1.0);
    let points = [p, p + DVec3::X * 10.0, p + DVec3::X * 4.0, p, p + DVec3::Y * 9.0, DVec3::splat(f64::NAN)];
    // collinear, with a doubled corner, a point, with NaN, the same vertex twice
    let triangles = [[0, 1, 2], [0, 3, 4], [0, 0, 0], [0, 1, 5], [1, 1, 4]];
    let mut refiner = Refiner::default();
    for rule in [Rule::uniform(4), Rule::within(0.01, 9, &texture, size)] {
        refiner.refine(points, &triangles, &map, &supports(&map), &rule);
        assert!(refiner.triangles().len() >= triangles.len());
        assert!(refiner.triangles().len() < 5 << 18);
        assert!(refiner.triangles().iter().flatten().all(|i| (*i as usize) < refiner.positions().len()));
    }
    refiner.refine([], &[], &map, &supports(&map), &Rule::uniform(3));
    assert!(refiner.triangles().is_empty() && refiner.positions().is_empty());
}

/// The corners in f64.
fn reference(p: DVec3, map: &impl BackwardMap, texture: &DAffine3, next: Option<NextSlice>) -> (DVec3, DVec3, DMat3) {
    let (image, jacobian) = map.backward_with_jacobian(p);
    let front = texture.transform_point3(image);
    let back = next.map_or(front, |n| texture.transform_point3(map.backward(p * n.scale + n.shift)));
    (front, back, texture.matrix3 * jacobian)
}

#[test]
fn corners_agree_with_the_reference() {
    let mut r = Random(7);
    let stack = strokes();
    let map = stack.prepared();
    let (texture, _) = placement();
    let center = DVec3::new(4.0, -3.0, 1.0);
    let blocks = map.blocks::<f32>(center);
    let sheet = Sheet::new(DVec3::new(0.3, -0.5, 0.8), 20, &mut r);
    let eye = sheet.frame.normal * 200.0 + DVec3::X * 10.0;
    let height = sheet.frame.height(eye) - 1.7;
    let nexts =
        [None, Some(NextSlice::parallel(sheet.frame.normal * -0.9)), Some(NextSlice::from_eye(eye, height, 0.9))];
    for next in nexts {
        let texturing = Texturing::new(&texture, next, center);
        let mut got: Vec<Corner> = Vec::new();
        corners(&sheet.points, &blocks, &texturing, true, |c| got.push(c));
        assert_eq!(got.len(), sheet.points.len());
        for (c, p) in got.iter().zip(&sheet.points) {
            let (front, back, jacobian) = reference(*p, &map, &texture, next);
            let near = |a: [f32; 3], b: DVec3, e: f64| (DVec3::from(a.map(f64::from)) - b).abs().max_element() < e;
            assert!(near(c.position, *p - center, 1e-5) && near(c.front, front, 1e-6) && near(c.back, back, 1e-6));
            let columns = jacobian.to_cols_array();
            assert!(c.jacobian.iter().zip(columns).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-6));
        }
        // without derivatives all else is the same
        let mut plain: Vec<Corner> = Vec::new();
        corners(&sheet.points, &blocks, &texturing, false, |c| plain.push(c));
        assert!(plain.iter().zip(&got).all(|(a, b)| a.front == b.front && a.back == b.back && a.jacobian == [0.0; 9]));
    }
    // the eye's ray meets the next slice there
    let next = NextSlice::from_eye(eye, height, 0.9);
    let q = sheet.points[7] * next.scale + next.shift;
    assert!((sheet.frame.height(q) - (1.7 - 0.9)).abs() < 1e-12);
    assert!((q - eye).normalize().distance((sheet.points[7] - eye).normalize()) < 1e-12);
}

#[test]
fn an_affine_map_of_texture_is_exact_where_nothing_is_displaced() {
    let mut r = Random(8);
    let sheet = Sheet::new(DVec3::X, 9, &mut r);
    let (texture, _) = placement();
    let none = Stack::default().prepared();
    let center = DVec3::ZERO;
    corners(&sheet.points, &none.blocks(center), &Texturing::new(&texture, None, center), true, |c| {
        let p = DVec3::from(c.position.map(f64::from));
        let expected = texture.transform_point3(p);
        assert!((DVec3::from(c.front.map(f64::from)) - expected).abs().max_element() < 2e-7);
        assert_eq!(c.jacobian, texture.matrix3.to_cols_array().map(|e| e as f32));
        assert_eq!(c.back, c.front);
    });
    // and refinement of a linear map needs no split: a lattice's core with linear handles
    let support = OrientedBox { center: DVec3::ZERO, axes: DMat3::IDENTITY, half: DVec3::splat(100.0) };
    let m = DMat3::from_cols(DVec3::new(0.05, 0.0, 0.02), DVec3::new(0.0, -0.03, 0.0), DVec3::new(0.01, 0.02, 0.0));
    let lattice = Lattice::new(support, [6, 6, 6]).unwrap().with_vectors(|_, place| m * place).unwrap();
    let core = lattice.core().unwrap().half.x;
    let map = Stack { items: vec![Deformation::new("", Deformer::Lattice(lattice))] }.prepared();
    let s = 0.2 * core;
    let points = [DVec3::new(-s, -s, 0.0), DVec3::new(s, -s, 0.0), DVec3::new(0.0, s, 0.0)];
    let mut refiner = Refiner::default();
    let (texture, size) = placement();
    refiner.refine(points, &[[0, 1, 2]], &map, &Supports::new(&map, Some(1e9)), &Rule::within(1e-6, 9, &texture, size));
    assert_eq!(refiner.triangles(), &[[0, 1, 2]]);
}

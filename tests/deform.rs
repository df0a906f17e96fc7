//! Deformers against their definitions: B-spline fields, derivatives, the bound of folding, order and inverse.

use glam::{DAffine3, DMat3, DVec3};
use voxclay::deform::{
    Action, Brush, DeformError, Deformation, Deformer, DisplacementVolume, Extent, Falloff, Grab, Lattice, Limit, Stack,
};
use voxclay::math::{BLOCK, BackwardMap, Block, BlockMap, JacobianBlock, OrientedBox, Real};
use voxclay::mesh::TriMesh;

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

    /// In the cube [-1,1]^3.
    fn cube(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.cube();
            if (0.1..1.0).contains(&v.length()) {
                return v.normalize();
            }
        }
    }

    fn frame(&mut self) -> DMat3 {
        let w = self.direction();
        let u = w.cross(self.direction()).normalize();
        DMat3::from_cols(u, w.cross(u), w)
    }

    /// In the box.
    fn inside(&mut self, b: &OrientedBox) -> DVec3 {
        b.center + b.axes * (self.cube() * b.half)
    }
}

/// A displacement volume of this steepness.
fn displacement(r: &mut Random, steepness: f64) -> DisplacementVolume {
    let extent = Extent { u: 4.0 + r.unit() * 8.0, v: 4.0 + r.unit() * 8.0, length: 12.0 + 20.0 * r.unit() };
    let vector = r.direction() * (steepness * extent.length / 6.0);
    DisplacementVolume::new(r.cube() * 20.0, vector, extent, Some(r.direction())).unwrap()
}

const FALLOFFS: [Falloff; 5] =
    [Falloff::Smooth, Falloff::Spline, Falloff::Core(0.0), Falloff::Core(0.4), Falloff::Core(0.9)];

fn grab(r: &mut Random, falloff: Falloff, steepness: f64) -> Grab {
    let radius = 3.0 + 9.0 * r.unit();
    Grab::new(r.cube() * 20.0, r.direction() * (steepness * radius / falloff.steepest()), radius, falloff).unwrap()
}

/// A lattice with random handles, of this steepness.
fn lattice(r: &mut Random, dims: [usize; 3], steepness: f64) -> Lattice {
    let support = OrientedBox { center: r.cube() * 20.0, axes: r.frame(), half: DVec3::splat(8.0) + r.cube() * 4.0 };
    let handles: Vec<DVec3> = (0..dims.iter().product()).map(|_| r.cube()).collect();
    let rough = Lattice::new(support, dims).unwrap().with_handles(handles.clone()).unwrap();
    let scale = steepness / rough.steepness();
    rough.with_handles(handles.into_iter().map(|h| h * scale).collect()).unwrap()
}

/// Growing and shrinking, pinching and spreading brushes of this steepness.
fn brushes(r: &mut Random, falloff: Falloff, steepness: f64) -> Vec<Brush> {
    let (grow, shrink) = (steepness, -steepness / falloff.steepest_return());
    let axis = r.direction() * 3.0;
    [
        Action::Inflate { amount: grow },
        Action::Inflate { amount: shrink },
        Action::Pinch { axis, amount: -shrink },
        Action::Pinch { axis, amount: -grow },
    ]
    .map(|action| Brush::new(r.cube() * 20.0, 3.0 + 9.0 * r.unit(), falloff, action).unwrap())
    .to_vec()
}

fn twist(r: &mut Random, falloff: Falloff, degrees: f64) -> Brush {
    let action = Action::Twist { axis: r.direction() * 2.0, degrees };
    Brush::new(r.cube() * 20.0, 4.0 + 8.0 * r.unit(), falloff, action).unwrap()
}

/// One of each, all injective.
fn deformers(r: &mut Random) -> Vec<Deformer> {
    let mut all: Vec<Deformer> =
        (0..4).map(|i| Deformer::Displacement(displacement(r, 0.3 + 0.2 * f64::from(i)))).collect();
    all.extend(FALLOFFS.map(|f| Deformer::Grab(grab(r, f, 0.85))));
    all.extend([[2, 2, 2], [3, 4, 5], [7, 3, 2]].map(|d| Deformer::Lattice(lattice(r, d, 0.9))));
    for (i, falloff) in FALLOFFS.into_iter().take(4).enumerate() {
        all.push(Deformer::Brush(brushes(r, falloff, 0.7)[i]));
        all.push(Deformer::Brush(twist(r, falloff, [40.0, -110.0, 75.0, -20.0][i])));
    }
    all
}

fn stack(deformers: impl IntoIterator<Item = Deformer>) -> Stack {
    Stack { items: deformers.into_iter().map(|d| Deformation::new("stroke", d)).collect() }
}

/// The derivative by central differences.
fn differences(map: &impl BackwardMap, p: DVec3, h: f64) -> DMat3 {
    let column = |e: DVec3| (map.backward(p + e * h) - map.backward(p - e * h)) / (2.0 * h);
    DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
}

fn apart(a: DMat3, b: DMat3) -> f64 {
    (a - b).to_cols_array().iter().fold(0.0, |m, e| m.max(e.abs()))
}

#[test]
fn the_displaced_position_shows_the_point() {
    let mut r = Random(1);
    for _ in 0..50 {
        let d = displacement(&mut r, 0.5);
        assert!((Deformer::Displacement(d).backward(d.point() + d.vector()) - d.point()).length() < 1e-14 * 50.0);
        let g = grab(&mut r, Falloff::Core(0.3), 0.5);
        assert!((Deformer::Grab(g).backward(g.center() + g.vector()) - g.center()).length() < 1e-14 * 50.0);
    }
}

#[test]
fn the_displacement_volume_is_the_tensor_product_of_the_paper() {
    // axis-aligned, so that the formula can be written out: w along z
    let e = Extent { u: 3.0, v: 5.0, length: 12.0 };
    let d = DisplacementVolume::new(DVec3::new(1.0, 2.0, 3.0), DVec3::Z * 1.5, e, Some(DVec3::X)).unwrap();
    let b = |t: f64| match t.abs() {
        t if t <= 1.0 / 3.0 => 1.0 - 3.0 * t * t,
        t if t < 1.0 => 1.5 * (1.0 - t) * (1.0 - t),
        _ => 0.0,
    };
    let mut r = Random(2);
    for _ in 0..2000 {
        let p = r.cube() * DVec3::new(3.5, 5.5, 9.0) + DVec3::new(1.0, 2.0, 4.5);
        let (u, v, w) = (p.x - 1.0, p.y - 2.0, p.z - 4.5);
        let along = if w < 0.0 { b(w / 4.0) } else { b(w / 8.0) };
        let expected = p - DVec3::Z * (1.5 * b(u / 3.0) * b(v / 5.0) * along);
        assert!((Deformer::Displacement(d).backward(p) - expected).length() < 1e-14, "{p}");
    }
    // a third of the length before the displaced position, two thirds beyond
    let (lower, upper) = d.support().bounds();
    assert!((lower - DVec3::new(-2.0, -3.0, 0.5)).length() < 1e-14, "{lower}");
    assert!((upper - DVec3::new(4.0, 7.0, 12.5)).length() < 1e-14, "{upper}");
}

#[test]
fn derivatives_agree_with_differences_everywhere_also_on_composed_maps() {
    let mut r = Random(3);
    let all = deformers(&mut r);
    for d in &all {
        for _ in 0..200 {
            let p = r.inside(&d.support());
            let (image, jacobian) = d.backward_with_jacobian(p);
            assert!((image - d.backward(p)).length() < 1e-13);
            // second derivatives jump between the pieces of the splines, so differences are good to O(h)
            assert!(apart(jacobian, differences(d, p, 1e-5)) < 2e-5, "{d:?} at {p}");
        }
    }
    let s = stack(all);
    for i in 0..400 {
        let p = r.inside(&s.items[i % s.items.len()].deformer.support());
        assert!(apart(s.backward_with_jacobian(p).1, differences(&s, p, 1e-5)) < 1e-4);
    }
}

#[test]
fn the_field_and_its_slope_vanish_at_all_faces_and_outside() {
    let mut r = Random(4);
    for d in deformers(&mut r) {
        let b = d.support();
        for _ in 0..200 {
            let mut local = r.cube();
            let axis = (r.unit() * 3.0) as usize % 3;
            local[axis] = local[axis].signum();
            let face = b.center + b.axes * (local * b.half);
            let (image, jacobian) = d.backward_with_jacobian(face);
            assert!((image - face).length() < 1e-12, "{d:?}");
            assert!(apart(jacobian, DMat3::IDENTITY) < 1e-10);
            // the slope is continuous there: just inside it is as small as the distance
            let inside = b.center + b.axes * (local * (1.0 - 1e-6) * b.half);
            assert!(apart(d.backward_with_jacobian(inside).1, DMat3::IDENTITY) < 1e-3);
            let outside = b.center + b.axes * (local * (1.0 + 1e-9 + r.unit()) * b.half);
            assert_eq!(d.backward_with_jacobian(outside), (outside, DMat3::IDENTITY));
        }
    }
}

#[test]
fn the_slope_is_continuous_across_the_joint_and_between_all_pieces() {
    let mut r = Random(5);
    for d in deformers(&mut r) {
        let b = d.support();
        // along lines through the box in steps too small to miss a jump
        for _ in 0..10 {
            let (from, to) = (r.inside(&b), r.inside(&b));
            let mut last = d.backward_with_jacobian(from).1;
            for i in 1..=4000 {
                let next = d.backward_with_jacobian(from.lerp(to, f64::from(i) / 4000.0)).1;
                assert!(apart(last, next) < 0.02, "{d:?}");
                last = next;
            }
        }
    }
}

#[test]
fn the_bound_of_folding_is_sharp() {
    let mut r = Random(6);
    let cases = |r: &mut Random, s: f64| {
        let mut all = vec![Deformer::Displacement(displacement(r, s))];
        all.extend(FALLOFFS.map(|f| Deformer::Grab(grab(r, f, s))));
        all
    };
    for _ in 0..10 {
        for d in cases(&mut r, 0.999) {
            assert!((d.steepness() - 0.999).abs() < 1e-12);
            let s = stack([d.clone()]);
            for _ in 0..100 {
                let p = r.inside(&d.support());
                let (q, jacobian) = s.backward_with_jacobian(p);
                assert!(jacobian.determinant() > 0.0009, "{d:?}");
                // near the fold the root is as flat as 1 / 0.001
                assert!((s.forward(q).unwrap() - p).length() < 1e-10, "{d:?}");
            }
        }
        for d in cases(&mut r, 1.02) {
            // the steepest place lies on the axis through the middle of the field, before the displaced position
            let (peak, vector, reach) = match &d {
                Deformer::Displacement(d) => (d.displaced(), d.vector(), d.extent().length / 3.0),
                Deformer::Grab(g) => (g.displaced(), g.vector(), g.radius()),
                Deformer::Brush(_) | Deformer::Lattice(_) => unreachable!(),
            };
            let w = vector.normalize();
            let at = |t: f64| peak - w * (reach * t);
            let worst = (0..=1000)
                .map(|i| d.backward_with_jacobian(at(f64::from(i) / 1000.0)).1.determinant())
                .fold(1.0, f64::min);
            assert!((worst + 0.02).abs() < 3e-3, "{worst} {d:?}");
            // and the line is folded: its images go back somewhere
            let back = (1..=1000).any(|i| {
                w.dot(d.backward(at(f64::from(i) / 1000.0)) - d.backward(at(f64::from(i - 1) / 1000.0))) > 0.0
            });
            assert!(back, "{d:?}");
            // so the inverse there has more than one answer and says so
            let steepest = (0..=1000)
                .map(|i| at(f64::from(i) / 1000.0))
                .min_by(|a, b| {
                    let det = |p: &DVec3| d.backward_with_jacobian(*p).1.determinant();
                    det(a).total_cmp(&det(b))
                })
                .unwrap();
            let s = stack([d.clone()]);
            let answer = s.forward(d.backward(steepest));
            assert!(matches!(answer, Err(DeformError::Folded { .. })), "{answer:?} {d:?}");
        }
    }
}

#[test]
fn a_stroke_beyond_the_bound_is_held_back_and_says_so() {
    let mut r = Random(7);
    let mut all: Vec<Deformer> = vec![Deformer::Displacement(displacement(&mut r, 2.0))];
    all.extend(FALLOFFS.map(|f| Deformer::Grab(grab(&mut r, f, 2.0))));
    all.push(Deformer::Lattice(lattice(&mut r, [4, 3, 5], 2.0)));
    for d in all {
        let clamped = d.limited(Limit::Clamp { margin: 0.1 });
        assert!((clamped.deformer.steepness() - 0.9).abs() < 1e-12);
        assert!((clamped.kept / clamped.asked - 0.45).abs() < 1e-12);
        assert!((clamped.held_back() - 0.55 * clamped.asked).abs() < 1e-12);
        let free = d.limited(Limit::LetThrough);
        assert_eq!((free.held_back(), &free.deformer), (0.0, &d));
        // once within the bound nothing more is taken
        let again = clamped.deformer.limited(Limit::Clamp { margin: 0.1 - 1e-9 });
        assert_eq!((again.held_back(), again.deformer), (0.0, clamped.deformer));
        assert!(d.limited(Limit::Clamp { margin: 0.0 }).deformer.steepness() < 1.0);
    }
}

#[test]
fn a_drag_has_an_extent_that_does_not_fold() {
    for (pull, radius) in [(0.01, 10.0), (3.0, 10.0), (10.0, 10.0), (300.0, 10.0)] {
        let d = DisplacementVolume::from_drag(DVec3::ONE, DVec3::new(0.0, pull * 0.6, pull * 0.8), radius).unwrap();
        assert!(d.steepness() <= 0.8 + 1e-12);
        assert!(d.extent().length >= 3.0 * radius && d.extent().u == radius);
        // the point itself lies in the box
        assert!(d.support().contains(d.point()));
    }
    let d = DisplacementVolume::strongest(DVec3::ONE, DVec3::new(0.0, 0.0, 9.0), 5.0).unwrap();
    assert!((d.vector() - DVec3::Z * 2.0).length() < 1e-14 && (d.steepness() - 0.8).abs() < 1e-12);
    // the most that material is stretched is fivefold
    let stretch = (0..1000).map(|i| d.displaced() - DVec3::Z * (0.005 * f64::from(i)));
    let least = stretch.map(|p| Deformer::Displacement(d).backward_with_jacobian(p).1.z_axis.z).fold(1.0, f64::min);
    assert!((least - 0.2).abs() < 1e-2, "{least}");
}

#[test]
fn a_lattice_below_its_bound_does_not_fold_and_far_beyond_it_does() {
    let mut r = Random(8);
    for dims in [[2, 2, 2], [3, 3, 3], [4, 2, 6]] {
        for _ in 0..5 {
            let l = lattice(&mut r, dims, 0.999);
            assert!(l.smallest_determinant(4) > 0.0);
            let wild = l.clone().with_handles(l.handles().iter().map(|h| *h * 12.0).collect()).unwrap();
            assert!(wild.smallest_determinant(4) < 0.0, "the bound is more than twelve times too careful");
        }
    }
    // one handle pulled along an axis: the exact limit can be worked out, and the bound must not be above it
    let support = OrientedBox { center: DVec3::ZERO, axes: DMat3::IDENTITY, half: DVec3::splat(5.0) };
    let one = |h: f64| {
        Lattice::new(support, [3, 3, 3])
            .unwrap()
            .with_vectors(|i, _| if i == [1, 1, 1] { DVec3::X * h } else { DVec3::ZERO })
            .unwrap()
    };
    // the steepest slope of B(x) B(0) B(0) per knot interval 2 is 1 * 0.75 * 0.75 / 2
    let limit = 2.0 / (0.75 * 0.75);
    assert!(one(limit * 0.99).smallest_determinant(8) > 0.0);
    assert!(one(limit * 1.2).smallest_determinant(9) < 0.0);
    assert!(one(limit).steepness() >= 1.0 && one(limit).steepness() < 3.0, "{}", one(limit).steepness());
}

#[test]
fn equal_handles_translate_the_core_and_nothing_outside() {
    let mut r = Random(9);
    let support = OrientedBox { center: r.cube(), axes: r.frame(), half: DVec3::new(10.0, 14.0, 7.0) };
    let shift = DVec3::new(0.3, -0.2, 0.1);
    let l = Lattice::new(support, [6, 5, 3]).unwrap().with_vectors(|_, _| shift).unwrap();
    let core = l.core().unwrap();
    let d = Deformer::Lattice(l.clone());
    for _ in 0..500 {
        let p = r.inside(&core);
        let (image, jacobian) = d.backward_with_jacobian(p);
        assert!((image - (p - shift)).length() < 1e-13 && apart(jacobian, DMat3::IDENTITY) < 1e-13);
        let beyond = support.center + support.axes * (r.direction() * 40.0);
        assert_eq!(d.backward(beyond), beyond);
    }
    // handles whose vectors are linear in their places give a linear field in the core: splines reproduce planes
    let m = DMat3::from_cols(DVec3::new(0.02, 0.01, 0.0), DVec3::new(-0.01, 0.03, 0.02), DVec3::new(0.0, 0.02, -0.04));
    let linear = Deformer::Lattice(l.clone().with_vectors(|_, place| m * place).unwrap());
    for _ in 0..500 {
        let p = r.inside(&core);
        assert!((linear.backward(p) - (p - m * p)).length() < 1e-13);
    }
    assert!(Lattice::new(support, [2, 5, 3]).unwrap().core().is_none());
    // handles lie where it is said: first and last one and a half intervals from the faces
    let first = support.axes.transpose() * (l.place([0, 0, 0]) - support.center);
    assert!((first + support.half - 1.5 * l.step()).length() < 1e-13);
}

#[test]
fn a_stack_is_undone_newest_first_and_order_matters() {
    let mut r = Random(10);
    let a = DisplacementVolume::from_drag(DVec3::ZERO, DVec3::X * 3.0, 8.0).unwrap();
    let b = DisplacementVolume::from_drag(DVec3::new(2.0, 1.0, 0.0), DVec3::Y * 3.0, 8.0).unwrap();
    let c = grab(&mut r, Falloff::Smooth, 0.5);
    let (a, b, c) = (Deformer::Displacement(a), Deformer::Displacement(b), Deformer::Grab(c));
    let s = stack([a.clone(), b.clone(), c.clone()]);
    let other = stack([b.clone(), a.clone(), c.clone()]);
    let prepared = s.prepared();
    let mut most = 0.0_f64;
    for _ in 0..2000 {
        let p = r.cube() * 20.0;
        let by_hand = a.backward(b.backward(c.backward(p)));
        assert_eq!(s.backward(p), by_hand);
        assert!((prepared.backward(p) - by_hand).length() < 1e-13);
        most = most.max((other.backward(p) - by_hand).length());
    }
    assert!(most > 0.5, "the two orders differ by no more than {most}");
    // a disabled item does nothing
    let mut off = s.clone();
    off.items[1].enabled = false;
    let p = DVec3::new(4.0, 3.0, 0.0);
    assert_eq!(off.backward(p), a.backward(c.backward(p)));
    assert_eq!(off.supports().len(), 2);
}

#[test]
fn forward_is_the_inverse_of_backward() {
    let mut r = Random(11);
    let all = deformers(&mut r);
    let s = stack(all.clone());
    let prepared = s.prepared();
    for i in 0..1500 {
        let p = if i % 10 == 0 { r.cube() * 60.0 } else { r.inside(&all[i % all.len()].support()) };
        let there = prepared.forward(prepared.backward(p)).unwrap();
        assert!((there - p).length() < 1e-10, "{}", (there - p).length());
        let back = prepared.backward(prepared.forward(p).unwrap());
        assert!((back - p).length() < 1e-10, "{}", (back - p).length());
        assert!(prepared.backward_with_jacobian(p).1.determinant() > 0.0);
    }
}

#[test]
fn the_prepared_stack_and_its_blocks_agree_with_the_reference() {
    let mut r = Random(12);
    let all = deformers(&mut r);
    let s = stack(all.clone());
    let prepared = s.prepared();
    let center = DVec3::new(3.0, -2.0, 5.0);
    fn check<T: Real>(map: &impl BlockMap<T>, s: &Stack, all: &[Deformer], r: &mut Random, tolerance: f64) {
        let mut most = 0.0_f64;
        for n in 0..200 {
            let mut block = Block::<T>::default();
            let around = r.inside(&all[n % all.len()].support());
            for i in 0..BLOCK {
                let p = around + r.cube() * if n % 3 == 0 { 30.0 } else { 2.0 } - map.center();
                (block.x[i], block.y[i], block.z[i]) = (T::of(p.x), T::of(p.y), T::of(p.z));
            }
            let start = block.clone();
            let mut jacobian = JacobianBlock::default();
            jacobian.entry[3] = [T::of(9.0); BLOCK]; // whatever it held
            let mut with = block.clone();
            map.backward_block(&mut block);
            map.backward_block_with_jacobian(&mut with, &mut jacobian);
            let point = |b: &Block<T>, i: usize| DVec3::new(b.x[i].wide(), b.y[i].wide(), b.z[i].wide()) + map.center();
            for i in 0..BLOCK {
                let (image, derivative) = s.backward_with_jacobian(point(&start, i));
                most = most.max((point(&block, i) - image).length());
                assert!((point(&block, i) - image).length() < tolerance, "{}", (point(&block, i) - image).length());
                assert!((point(&with, i) - image).length() < tolerance);
                let got = DMat3::from_cols_array(&std::array::from_fn(|e| jacobian.entry[e][i].wide()));
                assert!(apart(got, derivative) < tolerance, "{}", apart(got, derivative));
            }
        }
        assert!(most > 0.0);
    }
    check(&prepared.blocks::<f64>(center), &s, &all, &mut r, 1e-11);
    check(&prepared.blocks::<f32>(center), &s, &all, &mut r, 3e-5);
    // arrays of any length
    let blocks = prepared.blocks::<f64>(DVec3::ZERO);
    for n in [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 300] {
        let points: Vec<DVec3> = (0..n).map(|i| r.inside(&all[i % all.len()].support())).collect();
        let mut lanes = [0, 1, 2].map(|a| points.iter().map(|p| p[a]).collect::<Vec<f64>>());
        let [x, y, z] = &mut lanes;
        blocks.backward_batch(x, y, z);
        for (i, p) in points.iter().enumerate() {
            assert!((DVec3::new(lanes[0][i], lanes[1][i], lanes[2][i]) - s.backward(*p)).length() < 1e-12);
        }
    }
}

#[test]
fn a_stack_in_oblique_coordinates_is_the_same_map_and_keeps_its_bounds() {
    let mut r = Random(31);
    let all = deformers(&mut r);
    let s = stack(all.clone());
    let matrix = DMat3::from_cols(DVec3::new(0.8, 0.3, -0.1), DVec3::new(-0.2, -0.5, 0.1), DVec3::new(0.1, 0.2, 1.7));
    let world_from_local = DAffine3::from_mat3_translation(matrix, DVec3::new(4.0, -7.0, 1.0));
    let local_from_world = world_from_local.inverse();
    let framed = s.prepared().in_frame(&world_from_local);
    let (mut moved, mut acting) = (0, Vec::new());
    for n in 0..300 {
        let middle = local_from_world.transform_point3(r.inside(&all[n % all.len()].support()));
        let half = DVec3::new(r.unit(), r.unit(), r.unit()).abs() * if n % 4 == 0 { 30.0 } else { 3.0 };
        let (lower, upper) = (middle - half, middle + half);
        let origin = lower.floor();
        let near = framed.near(lower, upper, origin);
        let mut block = Block::<f32>::default();
        for i in 0..BLOCK {
            let p = middle + r.cube() * half - origin;
            (block.x[i], block.y[i], block.z[i]) = (p.x as f32, p.y as f32, p.z as f32);
        }
        let point = |b: &Block<f32>, i: usize| DVec3::new(b.x[i].into(), b.y[i].into(), b.z[i].into()) + origin;
        let start = block.clone();
        let ends = std::array::from_fn(|a| [(lower - origin)[a] as f32, (upper - origin)[a] as f32]);
        let images = near.acting(ends, &mut acting);
        near.backward(&acting, std::slice::from_mut(&mut block));
        let (lo, hi) = framed.sources(lower, upper);
        for i in 0..BLOCK {
            let from = point(&start, i);
            let want = local_from_world.transform_point3(s.backward(world_from_local.transform_point3(from)));
            let got = point(&block, i);
            assert!((got - want).length() < 1e-4, "{n}: {got} {want}");
            assert!(want.cmpge(lo - 1e-9).all() && want.cmple(hi + 1e-9).all(), "{n}: {want} not from {lo} to {hi}");
            for a in 0..3 {
                let at = (want - origin)[a] as f32;
                assert!(images[a][0] - 1e-4 <= at && at <= images[a][1] + 1e-4, "{n}: {at} not in {:?}", images[a]);
            }
            moved += usize::from((want - from).length() > 1e-3);
        }
    }
    assert!(moved > 300 * BLOCK / 4, "{moved}");
    // bounds of a small box far inside a stroke are not those of the whole stroke
    let pull = DisplacementVolume::from_drag(DVec3::ZERO, DVec3::Z * 4.0, 20.0).unwrap();
    let framed = stack([Deformer::Displacement(pull)]).prepared().in_frame(&DAffine3::IDENTITY);
    let (lo, hi) = framed.sources(DVec3::new(-0.1, -0.1, 3.9), DVec3::new(0.1, 0.1, 4.1));
    assert!(hi.z - lo.z < 0.4 && lo.z < 0.0 && hi.z > 0.0, "{lo} {hi}");
    let away = DVec3::splat(300.0);
    assert_eq!(framed.sources(away, away + 1.0), (away, away + 1.0));
    assert!(
        framed.near(away, away + 1.0, away).acting([[0.0, 1.0]; 3], &mut acting) == [[0.0, 1.0]; 3]
            && acting.is_empty()
    );
}

#[test]
fn moving_the_shape_moves_the_interior_along() {
    let mut r = Random(13);
    let mut s = stack([
        Deformer::Grab(Grab::new(DVec3::ZERO, DVec3::X * 3.0, 8.0, Falloff::Smooth).unwrap()),
        Deformer::Displacement(DisplacementVolume::from_drag(DVec3::ZERO, DVec3::Z, 6.0).unwrap()),
        Deformer::Lattice(lattice(&mut r, [3, 3, 3], 0.7)),
    ]);
    s.items[0].moves_shape = true;
    s.items[2].moves_shape = true;
    let positions: Vec<DVec3> = (0..300).map(|_| r.cube() * 12.0).collect();
    let mesh = TriMesh { positions: positions.clone(), triangles: vec![[0, 1, 2]] };
    let moved = s.move_mesh(&mesh).unwrap();
    assert_eq!(moved.triangles, mesh.triangles);
    let shape = s.shape();
    assert_eq!(shape.items.len(), 2);
    let mut most = 0.0_f64;
    for (from, to) in positions.iter().zip(&moved.positions) {
        // the texture seen at the moved vertex is the vertex's own
        assert!((shape.backward(*to) - *from).length() < 1e-10);
        most = most.max(from.distance(*to));
    }
    assert!(most > 1.0);
}

#[test]
fn a_mirrored_stroke_is_the_mirror_image_of_the_stroke() {
    let mut r = Random(14);
    for d in deformers(&mut r) {
        let (origin, normal) = (r.cube() * 5.0, r.direction());
        let flip = |p: DVec3| p - normal * (2.0 * normal.dot(p - origin));
        let twin = d.mirrored(origin, normal * 3.0).unwrap();
        for _ in 0..100 {
            let p = r.inside(&d.support());
            assert!((flip(d.backward(p)) - twin.backward(flip(p))).length() < 1e-12, "{d:?}");
        }
        assert!((twin.steepness() - d.steepness()).abs() < 1e-12);
        let item =
            Deformation { moves_shape: true, ..Deformation::new("pull", d.clone()) }.mirrored(origin, normal).unwrap();
        assert!(
            item.moves_shape
                && item.enabled
                && item.name == "pull (mirrored)"
                && item.deformer == d.mirrored(origin, normal).unwrap()
        );
        assert_eq!(d.mirrored(origin, DVec3::ZERO).unwrap_err(), DeformError::NoDirection);
    }
}

#[test]
fn bad_parameters_are_refused_in_plain_words() {
    let e = Extent { u: 1.0, v: 1.0, length: 1.0 };
    let volume = |p, v, e| DisplacementVolume::new(p, v, e, None).map(|_| ());
    assert_eq!(volume(DVec3::ZERO, DVec3::ZERO, e), Err(DeformError::NoDirection));
    assert_eq!(DisplacementVolume::from_drag(DVec3::ZERO, DVec3::ZERO, 1.0).unwrap_err(), DeformError::NoDirection);
    assert!(matches!(volume(DVec3::splat(f64::NAN), DVec3::X, e), Err(DeformError::NotFinite { what: "point" })));
    assert!(matches!(volume(DVec3::ZERO, DVec3::X * f64::INFINITY, e), Err(DeformError::NotFinite { .. })));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300] {
        assert!(volume(DVec3::ZERO, DVec3::X, Extent { u: bad, ..e }).is_err());
        assert!(volume(DVec3::ZERO, DVec3::X, Extent { v: bad, ..e }).is_err());
        assert!(volume(DVec3::ZERO, DVec3::X, Extent { length: bad, ..e }).is_err());
        assert!(Grab::new(DVec3::ZERO, DVec3::X, bad, Falloff::Smooth).is_err());
        assert!(DisplacementVolume::from_drag(DVec3::ZERO, DVec3::X, bad).is_err());
    }
    let error = Grab::new(DVec3::ZERO, DVec3::X, -2.0, Falloff::Smooth).unwrap_err();
    assert_eq!(error.to_string(), "the radius is -2; it must be between 0.000000000001 and 1000000000000");
    assert!(Grab::new(DVec3::ZERO, DVec3::X, 1.0, Falloff::Core(1.0)).is_err());
    let cube = OrientedBox { center: DVec3::ZERO, axes: DMat3::IDENTITY, half: DVec3::ONE };
    for dims in [[0, 3, 3], [1, 3, 3], [3, 3, 33], [usize::MAX, usize::MAX, usize::MAX]] {
        assert!(matches!(Lattice::new(cube, dims), Err(DeformError::LatticeSize { .. })));
    }
    let axes = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::NEG_Z);
    assert_eq!(Lattice::new(OrientedBox { axes, ..cube }, [2, 2, 2]).unwrap_err(), DeformError::Axes);
    let wrong = Lattice::new(cube, [2, 2, 2]).unwrap().with_handles(vec![DVec3::ZERO; 7]).unwrap_err();
    assert_eq!(wrong, DeformError::LatticeHandles { expected: 8, got: 7 });
    let bad = Lattice::new(cube, [2, 2, 2]).unwrap().with_handles(vec![DVec3::splat(f64::NAN); 8]);
    assert!(matches!(bad, Err(DeformError::NotFinite { .. })));
}

#[test]
fn json_is_readable_round_trips_and_is_checked() {
    let mut r = Random(15);
    let s = stack(deformers(&mut r));
    let text = serde_json::to_string_pretty(&s).unwrap();
    assert!(serde_json::from_str::<Stack>(&text).unwrap() == s, "{text}");
    let typed = r#"[{"name": "jaw", "moves_shape": true, "deformer": {"tool": "displacement", "point": [0, 1, 2], "vector": [0, 0, 5],
        "extent": {"u": 10, "v": 12, "length": 60}}},
        {"deformer": {"tool": "grab", "center": [0, 1, 2], "vector": [1, 0, 0], "radius": 4, "falloff": {"core": 0.5}}, "enabled": false}]"#;
    let read: Stack = serde_json::from_str(typed).unwrap();
    assert!(read.items[0].enabled && read.items[0].moves_shape && !read.items[1].enabled);
    assert_eq!(read.active().count(), 1);
    for (good, bad, says) in [
        ("[0, 0, 5]", "[0, 0, 0]", "no direction"),
        ("\"u\": 10", "\"u\": 0", "extent along u"),
        ("\"radius\": 4", "\"radius\": -4", "radius"),
        ("0.5}", "1.5}", "core"),
    ] {
        let error = serde_json::from_str::<Stack>(&typed.replacen(good, bad, 1)).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn an_empty_stack_is_the_identity() {
    let s = Stack::default();
    let p = DVec3::new(1.0, 2.0, 3.0);
    assert_eq!((s.backward(p), s.forward(p).unwrap()), (p, p));
    assert_eq!(s.prepared().backward_with_jacobian(p), (p, DMat3::IDENTITY));
    assert!(s.supports().is_empty() && s.prepared().is_empty() && s.prepared().bounds().is_none());
    let mut block = Block::<f32>::default();
    let mut jacobian = JacobianBlock::default();
    jacobian.entry[1] = [5.0; BLOCK];
    s.prepared().blocks::<f32>(p).backward_block_with_jacobian(&mut block, &mut jacobian);
    assert_eq!((jacobian.entry[0][3], jacobian.entry[1][3]), (1.0, 0.0));
}

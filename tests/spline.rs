//! The C1 spline: its weights derived again, its smoothness, rays, and meshes of its surface.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

use glam::{DVec3, IVec3};
use voxclay::spline::{Crossing, DOMAIN, Determining, Kind, Level, Ray, Spline, VERTICES, barycentric};

/// Numbers in -1..1 that are the same in every run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

fn noise(dims: [usize; 3], seed: u64) -> Vec<f32> {
    let mut numbers = Numbers(seed);
    (0..dims.iter().product()).map(|_| numbers.next() as f32).collect()
}

fn sampled(dims: [usize; 3], f: impl Fn(DVec3) -> f64) -> Vec<f32> {
    let at =
        |n: usize| DVec3::new((n % dims[0]) as f64, (n / dims[0] % dims[1]) as f64, (n / dims[0] / dims[1]) as f64);
    (0..dims.iter().product()).map(|n| f(at(n)) as f32).collect()
}

/// Several balls that run into each other: closed, with handles and cavities, inside the grid.
fn blobs(n: usize) -> Vec<f32> {
    let mut numbers = Numbers(5);
    let half = 0.5 * (n - 1) as f64;
    let centers: Vec<(DVec3, f64)> =
        (0..14).map(|_| (half + 0.55 * half * numbers.vector(), half * (0.12 + 0.08 * numbers.next()))).collect();
    sampled([n; 3], |p| centers.iter().map(|(c, r)| (-(p - *c).length_squared() / (2.0 * r * r)).exp()).sum())
}

/// A place in a volume, in voxels.
fn within(numbers: &mut Numbers, dims: [usize; 3]) -> DVec3 {
    let size = DVec3::from(dims.map(|n| n as f64));
    (0.5 + 0.5 * numbers.vector()) * size - 0.5
}

// ---- weights ----

/// Domain points of a cube, in eighteenths of a voxel from its centre.
fn domain_point(kind: Kind, i: usize) -> IVec3 {
    let local = DOMAIN[i].iter().map(|&v| VERTICES[v]).sum::<DVec3>() * 6.0;
    kind.cube(local).round().as_ivec3()
}

/// The 48 symmetries of the cube.
fn symmetries() -> Vec<[IVec3; 3]> {
    let axes = [IVec3::X, IVec3::Y, IVec3::Z];
    let mut all = Vec::new();
    for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        for signs in 0..8 {
            all.push(std::array::from_fn(|i| axes[order[i]] * (1 - 2 * (signs >> i & 1))));
        }
    }
    all
}

fn apply(m: &[IVec3; 3], p: IVec3) -> IVec3 {
    p.x * m[0] + p.y * m[1] + p.z * m[2]
}

fn neighbourhood(reach: i32) -> impl Iterator<Item = IVec3> {
    let range = -reach..=reach;
    range.clone().flat_map(move |z| range.clone().flat_map(move |y| (-reach..=reach).map(move |x| IVec3::new(x, y, z))))
}

/// The cubes that hold a domain point.
fn cubes_of(p: IVec3) -> Vec<IVec3> {
    neighbourhood(1).filter(|c| (p - 18 * *c).abs().max_element() <= 9).collect()
}

/// The samples a domain point may depend on: those around every cube that holds it.
fn support(p: IVec3) -> Vec<IVec3> {
    let cubes = cubes_of(p);
    neighbourhood(2).filter(|n| cubes.iter().all(|c| (*n - *c).abs().max_element() <= 1)).collect()
}

/// A weight is the same for a point and a sample that a symmetry or a shift takes there.
fn class(p: IVec3, n: IVec3, symmetries: &[[IVec3; 3]]) -> [i32; 6] {
    let mut best = [i32::MIN; 6];
    for m in symmetries {
        let (q, s) = (apply(m, p), apply(m, n));
        for c in cubes_of(q) {
            let (a, b) = (q - 18 * c, s - c);
            best = best.max([a.x, a.y, a.z, b.x, b.y, b.z]);
        }
    }
    best
}

const PRIME: i64 = 2_147_483_647;

fn inverse(a: i64) -> i64 {
    let (mut base, mut power, mut out) = (a.rem_euclid(PRIME), PRIME - 2, 1);
    while power > 0 {
        if power & 1 == 1 {
            out = out * base % PRIME;
        }
        base = base * base % PRIME;
        power >>= 1;
    }
    out
}

/// Rows of a homogeneous system in echelon form.
#[derive(Default)]
struct System(BTreeMap<usize, Vec<i64>>);

impl System {
    fn add(&mut self, mut row: Vec<i64>) {
        for i in 0..row.len() {
            if row[i] == 0 {
                continue;
            }
            match self.0.get(&i) {
                Some(pivot) => {
                    let factor = row[i];
                    row.iter_mut().zip(pivot).for_each(|(r, p)| *r = (*r - factor * p % PRIME).rem_euclid(PRIME));
                }
                None => {
                    let factor = inverse(row[i]);
                    row.iter_mut().for_each(|r| *r = *r * factor % PRIME);
                    self.0.insert(i, row);
                    return;
                }
            }
        }
    }
}

/// The weights that the program uses, by 192, from its own coefficients of unit samples.
fn used_weight(kind: Kind, i: usize, n: IVec3) -> i64 {
    let mut samples = vec![0.0; 27];
    samples[((n.z + 1) * 9 + (n.y + 1) * 3 + n.x + 1) as usize] = 192.0;
    let weight = Spline::new([3; 3], &samples, 0).piece([1; 3], kind).0[i];
    assert!((weight - weight.round()).abs() < 1e-10 && weight > -1e-10);
    weight.round() as i64
}

#[test]
fn smoothness_alone_gives_the_weights() {
    let symmetries = symmetries();
    // all domain points of a cube, and one way to name each
    let mut points = BTreeMap::new();
    let key = |p: IVec3| p.to_array();
    for kind in Kind::all() {
        (0..20).for_each(|i| {
            points.entry(key(domain_point(kind, i))).or_insert((kind, i));
        });
    }
    assert_eq!(points.len(), 175);
    let mut classes = BTreeMap::new();
    let mut used = Vec::new();
    for (p, &(kind, i)) in &points {
        let p = IVec3::from_array(*p);
        let mut sum = 0;
        for n in neighbourhood(1) {
            let weight = used_weight(kind, i, n);
            sum += weight;
            if !support(p).contains(&n) {
                assert_eq!(weight, 0, "{p} {n}: a sample that not all cubes of the point know");
                continue;
            }
            let next = classes.len();
            let v = *classes.entry(class(p, n, &symmetries)).or_insert(next);
            if v == next {
                used.push(weight);
            }
            assert_eq!(used[v], weight, "{p} {n}: not symmetric");
        }
        assert_eq!(sum, 192);
    }
    // C1 across all faces of the cube's tetrahedra, between them and to the six cubes around
    let corners = |cube: IVec3, kind: Kind| VERTICES.map(|v| (kind.cube(v) * 6.0).round().as_ivec3() + 6 * cube);
    let around = [IVec3::ZERO, IVec3::X, IVec3::Y, IVec3::Z, -IVec3::X, -IVec3::Y, -IVec3::Z];
    let mut faces: BTreeMap<BTreeSet<[i32; 3]>, Vec<[IVec3; 4]>> = BTreeMap::new();
    for cube in around {
        for kind in Kind::all() {
            let c = corners(cube, kind);
            for apex in 0..4 {
                let face = (0..4).filter(|i| *i != apex).map(|i| key(c[i])).collect();
                let mut own = c;
                own.swap(0, apex);
                faces.entry(face).or_default().push(own);
            }
        }
    }
    // points as they are in the one cube that is looked at
    let home = |p: IVec3| -> (IVec3, IVec3) {
        let c = neighbourhood(1).find(|c| points.contains_key(&key(p - 18 * *c))).expect("a domain point");
        (p - 18 * c, c)
    };
    let mut system = System::default();
    let mut seen = BTreeSet::new();
    for pair in faces.values().filter(|v| v.len() == 2) {
        let [ours, theirs] = [pair[0], pair[1]];
        let face = [ours[1], ours[2], ours[3]];
        // barycentric coordinates of their apex, by ratios of determinants
        let volume = |a: IVec3, b: IVec3, c: IVec3, d: IVec3| i64::from((b - a).dot((c - a).cross(d - a)));
        let (apex, all) = (theirs[0], volume(ours[0], face[0], face[1], face[2]));
        let coordinates = [
            volume(apex, face[0], face[1], face[2]),
            volume(ours[0], apex, face[1], face[2]),
            volume(ours[0], face[0], apex, face[2]),
            volume(ours[0], face[0], face[1], apex),
        ];
        for i in 0..3 {
            for j in i..3 {
                // the condition of one domain point next to the face
                let base = face[i] + face[j];
                let terms = [(base + apex, -all), (base + ours[0], coordinates[0])]
                    .into_iter()
                    .chain((0..3).map(|m| (base + face[m], coordinates[m + 1])));
                let mut rows: BTreeMap<[i32; 3], Vec<i64>> = BTreeMap::new();
                for (p, factor) in terms {
                    let (p, cube) = home(p);
                    for n in support(p) {
                        let v = classes[&class(p, n, &symmetries)];
                        let row = rows.entry(key(n + cube)).or_insert_with(|| vec![0; classes.len()]);
                        row[v] = (row[v] + factor).rem_euclid(PRIME);
                    }
                }
                for row in rows.into_values().filter(|r| r.iter().any(|v| *v != 0)) {
                    let residual = row.iter().zip(&used).fold(0, |s, (r, w)| (s + r * w) % PRIME);
                    assert_eq!(residual, 0, "not C1 with the weights that are used");
                    if seen.insert(row.clone()) {
                        system.add(row);
                    }
                }
            }
        }
    }
    assert_eq!(classes.len() - system.0.len(), 1, "the weights would not be the only ones");
}

/// Kalbe et al.'s subset.
#[test]
fn fifty_six_coefficients_of_a_cube_determine_all() {
    let dims = [5, 4, 6];
    for steps in [0, 3] {
        let spline = Spline::new(dims, &noise(dims, 31), steps);
        for n in 0..dims.iter().product() {
            let cube = [n % 5, n / 5 % 4, n / 20];
            let part = Determining::new(|kind| spline.piece(cube, kind));
            for kind in Kind::all() {
                let pairs = part.piece(kind).0.into_iter().zip(spline.piece(cube, kind).0);
                for (i, (ours, expected)) in pairs.enumerate() {
                    assert!((ours - expected).abs() < 1e-14, "{cube:?} {kind:?} {i}: {ours} {expected}");
                }
            }
        }
    }
}

// ---- smoothness ----

#[test]
fn value_and_gradient_do_not_jump() {
    let dims = [9, 8, 7];
    for steps in [0, 3] {
        let spline = Spline::new(dims, &noise(dims, 1), steps);
        let mut numbers = Numbers(2);
        let mut faces = 0;
        for _ in 0..20_000 {
            // a point on a face: of a cube, or of a diagonal plane
            let mut p = within(&mut numbers, dims);
            let cube = (p + 0.5).floor();
            let (a, b) = ((numbers.next().abs() * 3.0) as usize, (numbers.next().abs() * 3.0) as usize);
            if a == b {
                p[a] = cube[a] + 0.5 * numbers.next().signum();
            } else {
                p[a] = cube[a] + numbers.next().signum() * (p[b] - cube[b]);
            }
            let mut values = Vec::new();
            for step in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|e| [e, -e]) {
                let place = spline.locate(p + 1e-9 * step);
                let piece = spline.piece(place.cube, place.kind);
                let at = barycentric(place.kind.local(p - DVec3::from(place.cube.map(|c| c as f64))));
                if at.iter().all(|v| *v > -1e-8) {
                    values.push((piece.value(at), place.kind.cube(piece.gradient(at)), (place.cube, place.kind)));
                }
            }
            for v in &values[1..] {
                faces += usize::from(v.2 != values[0].2);
                assert!((v.0 - values[0].0).abs() < 1e-13, "{p}: {} {}", v.0, values[0].0);
                assert!((v.1 - values[0].1).abs().max_element() < 1e-12, "{p}: {} {}", v.1, values[0].1);
            }
        }
        assert!(faces > 20_000, "{faces}");
    }
}

#[test]
fn linear_functions_come_out_exactly() {
    let dims = [14, 13, 15];
    // steps of 1/8 are exact in f32
    let f = |p: DVec3| 0.5 * p.x - 1.25 * p.y + 0.375 * p.z + 3.0;
    for steps in [0, 1, 3] {
        let spline = Spline::new(dims, &sampled(dims, f), steps);
        let mut numbers = Numbers(3);
        let margin = f64::from(steps) + 1.5;
        for _ in 0..5000 {
            let size = DVec3::from(dims.map(|n| (n - 1) as f64)) - 2.0 * margin;
            let p = margin + (0.5 + 0.5 * numbers.vector()) * size;
            let tolerance = if steps == 0 { 1e-13 } else { 1e-5 };
            assert!((spline.value(p) - f(p)).abs() < tolerance, "{steps} {p}");
            let off = spline.gradient(p) - DVec3::new(0.5, -1.25, 0.375);
            assert!(off.abs().max_element() < tolerance, "{steps} {p} {off}");
            assert!(spline.hessian(p).to_cols_array().iter().all(|v| v.abs() < 10.0 * tolerance));
        }
    }
}

#[test]
fn pieces_stay_in_their_hull_and_among_the_samples() {
    let dims = [6, 7, 8];
    let data = noise(dims, 4);
    let spline = Spline::new(dims, &data, 0);
    let mut numbers = Numbers(5);
    for _ in 0..50_000 {
        let place = spline.locate(within(&mut numbers, dims));
        let piece = spline.piece(place.cube, place.kind);
        let (v, [lo, hi]) = (piece.value(place.at), piece.hull());
        assert!(v >= lo - 1e-14 && v <= hi + 1e-14);
        let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
        for n in neighbourhood(1) {
            let at: [usize; 3] =
                std::array::from_fn(|a| (place.cube[a] as i32 + n[a]).clamp(0, dims[a] as i32 - 1) as usize);
            let v = data[(at[2] * dims[1] + at[1]) * dims[0] + at[0]];
            (least, most) = (least.min(v), most.max(v));
        }
        assert!(lo >= f64::from(least) - 1e-14 && hi <= f64::from(most) + 1e-14);
    }
}

#[test]
fn derivatives_are_those_of_the_value() {
    let dims = [8, 8, 8];
    let spline = Spline::new(dims, &noise(dims, 6), 3);
    let mut numbers = Numbers(7);
    let h = 1e-5;
    for _ in 0..2000 {
        let p = within(&mut numbers, dims).clamp(DVec3::ZERO, DVec3::splat(7.0));
        let same = |q: DVec3| {
            let (a, b) = (spline.locate(p), spline.locate(q));
            (a.cube, a.kind) == (b.cube, b.kind)
        };
        let (g, hessian) = (spline.gradient(p), spline.hessian(p));
        assert_eq!(spline.value_and_gradient(p), (spline.value(p), g));
        for e in [DVec3::X, DVec3::Y, DVec3::Z] {
            if same(p + h * e) && same(p - h * e) {
                let slope = (spline.value(p + h * e) - spline.value(p - h * e)) / (2.0 * h);
                assert!((slope - g.dot(e)).abs() < 1e-7, "{slope} {}", g.dot(e));
                let bend = (spline.gradient(p + h * e) - spline.gradient(p - h * e)) / (2.0 * h);
                assert!((bend - hessian * e).abs().max_element() < 1e-7);
            }
        }
    }
}

#[test]
fn corrections_bring_the_samples_back() {
    let dims = [20, 20, 20];
    let data = sampled(dims, |p| (0.9 * p.x).sin() + (0.7 * p.y + 0.2 * p.z).cos());
    let off = |steps: u32| {
        let spline = Spline::new(dims, &data, steps);
        let all = (0..data.len()).map(|n| {
            let p = DVec3::new((n % 20) as f64, (n / 20 % 20) as f64, (n / 400) as f64);
            (spline.value(p) - f64::from(data[n])).abs()
        });
        all.fold(0.0, f64::max)
    };
    let errors = [0, 1, 2, 3].map(off);
    assert!(errors.windows(2).all(|e| e[1] < 0.4 * e[0]), "{errors:?}");
}

// ---- rays ----

/// Marches rays through a closed surface: in and out must alternate and come out even, and every crossing must lie on the
/// surface. Returns how many met it.
fn check_rays(spline: &Spline, iso: f64, rays: usize, seed: u64) -> usize {
    let level = Level::new(spline, iso);
    let dims = spline.dims();
    let size = DVec3::from(dims.map(|n| n as f64));
    let mut numbers = Numbers(seed);
    let mut met = 0;
    for n in 0..rays {
        let origin = 0.5 * size + size * numbers.vector().normalize_or(DVec3::X);
        let mut target = within(&mut numbers, dims);
        let mut direction = target - origin;
        let mut from = origin;
        match n % 8 {
            // along axes and diagonals, through sample centres and cube faces, where ties are
            0 => {
                let a = n / 8 % 3;
                target = (2.0 * target).round() / 2.0;
                from = target;
                from[a] = -3.0;
                direction = DVec3::ZERO;
                direction[a] = 1.0;
            }
            1 => {
                let signs = DVec3::from([0, 1, 2].map(|b| if n >> (3 + b) & 1 == 1 { 1.0 } else { -1.0 }));
                direction = if n / 64 % 2 == 0 { signs } else { DVec3::new(signs.x, signs.y, 0.0) };
                target = target.round();
                from = target - 64.0 * direction;
            }
            _ => {}
        }
        let ray = Ray { origin: from, direction };
        let mut inside = false;
        let mut last = f64::NEG_INFINITY;
        let mut any = false;
        level.crossings(&ray, [0.0, 1e9], |t, crossing| {
            assert!(t >= last, "{ray:?}: out of order");
            last = t;
            match crossing {
                Crossing::In => assert!(!std::mem::replace(&mut inside, true), "{ray:?}: twice in"),
                Crossing::Out => assert!(std::mem::replace(&mut inside, false), "{ray:?}: twice out"),
                Crossing::Graze => {}
                Crossing::Start | Crossing::End => panic!("{ray:?}: the surface is closed"),
            }
            any = true;
            if n % 16 == 3 {
                assert!((spline.value(ray.at(t)) - iso).abs() < 1e-9, "{ray:?} {t}");
            }
            ControlFlow::Continue(())
        });
        assert!(!inside, "{ray:?}: does not leave");
        met += usize::from(any);
    }
    met
}

#[test]
fn every_ray_that_enters_leaves() {
    let n = 40;
    let data = blobs(n);
    let rays = std::env::var("RAYS").ok().and_then(|v| v.parse().ok()).unwrap_or(400_000);
    for (steps, seed) in [(0, 11), (3, 12)] {
        let spline = Spline::new([n; 3], &data, steps);
        let met = check_rays(&spline, 0.3, rays, seed);
        eprintln!("{met} of {rays} rays met the surface, none was lost");
        assert!(met > rays / 6);
    }
    // noise: hundreds of crossings close together, zero outside
    let dims = [24; 3];
    let mut data = noise(dims, 8);
    for (i, v) in data.iter_mut().enumerate() {
        let at = [i % 24, i / 24 % 24, i / 576];
        if at.iter().any(|&a| !(2..22).contains(&a)) {
            *v = -1.0;
        }
    }
    assert!(check_rays(&Spline::new(dims, &data, 0), 0.1, rays / 2, 13) > rays / 8);
}

#[test]
fn no_crossing_is_missed() {
    // against fine steps along the ray
    let dims = [12; 3];
    let spline = Spline::new(dims, &noise(dims, 9), 0);
    let level = Level::new(&spline, 0.05);
    let mut numbers = Numbers(10);
    for _ in 0..400 {
        let (a, b) = (within(&mut numbers, dims), within(&mut numbers, dims));
        let ray = Ray { origin: a, direction: b - a };
        let mut found = Vec::new();
        level.crossings(&ray, [0.0, 1.0], |t, c| {
            if matches!(c, Crossing::In | Crossing::Out) {
                found.push(t);
            }
            ControlFlow::Continue(())
        });
        let steps = 4000;
        let above = |i: usize| spline.value(ray.at(i as f64 / steps as f64)) >= 0.05;
        for i in 0..steps {
            let (from, to) = (i as f64 / steps as f64, (i + 1) as f64 / steps as f64);
            let n = found.iter().filter(|t| **t > from && **t <= to).count();
            assert_eq!(n % 2 == 1, above(i) != above(i + 1), "{ray:?} {from} {n}");
        }
    }
}

#[test]
fn a_ray_that_only_touches_is_seen() {
    // a parabola along x that reaches its top of the isovalue between two samples
    let dims = [9, 5, 5];
    let spline = Spline::new(dims, &sampled(dims, |p| -(p.x - 4.0) * (p.x - 4.0)), 0);
    let top = spline.value(DVec3::new(4.0, 2.0, 2.0));
    let level = Level::new(&spline, top);
    let ray = Ray { origin: DVec3::new(-2.0, 2.1, 1.8), direction: DVec3::X };
    let mut found = Vec::new();
    level.crossings(&ray, [0.0, 100.0], |t, c| {
        found.push((t, c));
        ControlFlow::Continue(())
    });
    assert!(!found.is_empty() && found.iter().all(|(t, _)| (t - 6.0).abs() < 1e-6), "{found:?}");
    assert!(Level::new(&spline, top + 1e-6).first_hit(&ray, [0.0, 100.0]).is_none());
    let ball = Spline::new([5; 3], &[1.0; 125], 0);
    let ray = Ray { origin: DVec3::new(-3.0, 2.0, 2.0), direction: DVec3::X };
    assert_eq!(Level::new(&ball, 0.5).first_hit(&ray, [0.0, 9.0]), Some((2.5, Crossing::Start)));
}

// ---- meshes ----

mod meshes {
    use glam::{DAffine3, DMat3, DVec3};
    use voxclay::mesh::check::MeshReport;
    use voxclay::mesh::contour::Contour;
    use voxclay::spline::{Spline, cells, refine, surface};
    use voxclay::volume::{Grid, Samples, Space, Volume};

    use super::{blobs, noise, sampled};

    fn sound(contour: &Contour) -> MeshReport {
        let report = MeshReport::of(&contour.mesh);
        assert!(report.closed && report.manifold && report.oriented && !report.inside_out, "{report:?}");
        assert_eq!((report.duplicate_triangles, report.unreferenced_vertices), (0, 0));
        assert_eq!(contour.normals.len(), contour.mesh.positions.len());
        assert!(contour.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
        report
    }

    /// A skewed left-handed frame with unequal spacing.
    fn skewed() -> DAffine3 {
        let axes = DMat3::from_cols(DVec3::new(0.0, 1.5, 0.1), DVec3::new(0.8, 0.0, 0.0), DVec3::new(0.1, 0.0, 2.0));
        assert!(axes.determinant() < 0.0);
        DAffine3::from_mat3_translation(axes, DVec3::new(5.0, -7.0, 100.0))
    }

    #[test]
    fn vertices_lie_on_the_surface_with_its_normals() {
        let n = 32;
        for (steps, frame) in [(0, DAffine3::IDENTITY), (3, skewed())] {
            let spline = Spline::new([n; 3], &blobs(n), steps);
            let voxel = frame.inverse();
            for mesh in [surface::surface(&spline, 0.3, &frame), refine::surface(&spline, 0.3, &frame, 0.02).0] {
                let report = sound(&mesh);
                assert!(report.volume > 0.0 && report.is_clean_solid(), "{report:?}");
                for (p, normal) in mesh.mesh.positions.iter().zip(&mesh.normals) {
                    let (value, gradient) = spline.value_and_gradient(voxel.transform_point3(*p));
                    let far = (value - 0.3).abs() / gradient.length();
                    assert!(far < 1e-9 || (far < 1.1 * surface::CLEAR), "{far}");
                    let down = -(frame.matrix3.inverse().transpose() * gradient).normalize();
                    assert!(down.dot(normal.as_dvec3()) > 1.0 - 1e-6, "{down} {normal}");
                }
            }
        }
    }

    #[test]
    fn noise_and_borders_make_manifolds() {
        for (dims, seed) in [([9, 8, 7], 21), ([20, 5, 3], 22), ([1, 1, 1], 23), ([66, 2, 4], 24)] {
            let data = noise(dims, seed);
            let grid = Grid::aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap();
            let volume = Volume::new(grid, 1, Samples::F32(data.clone()));
            for iso in [-0.2, 0.0, 0.1] {
                let level = if dims == [1; 3] { f64::from(data[0]) - 0.1 } else { 0.25 * iso };
                sound(&cells::surface(&volume, 0, level));
                for steps in [0, 3] {
                    let spline = Spline::new(dims, &data, steps);
                    sound(&surface::surface(&spline, level, &DAffine3::IDENTITY));
                    if dims != [1; 3] {
                        sound(&refine::surface(&spline, level, &DAffine3::IDENTITY, 0.05).0);
                    }
                }
            }
        }
    }

    #[test]
    fn samples_of_just_the_isovalue_are_no_trouble() {
        let n = 12;
        let whole: Vec<u8> = sampled([n; 3], |p| (8.0 - (p - 5.5).length()).round()).iter().map(|v| *v as u8).collect();
        let grid = Grid::aligned([n; 3], DVec3::ONE, DVec3::ZERO).unwrap();
        let volume = Volume::new(grid, 1, Samples::U8(whole));
        for iso in [4.0, 5.0, 6.0] {
            let plain = sound(&cells::surface(&volume, 0, iso));
            assert_eq!((plain.components, plain.degenerate_triangles), (1, 0));
            sound(&surface::surface(&Spline::of_volume(&volume, 0, 3), iso, &DAffine3::IDENTITY));
        }
    }

    #[test]
    fn refined_meshes_come_closer_to_a_ball() {
        let n = 24;
        let data = sampled([n; 3], |p| 7.0 - (p - 11.5).length());
        let spline = Spline::new([n; 3], &data, 3);
        let off = |mesh: &Contour| {
            let middle = |t: &[u32; 3]| t.iter().map(|v| mesh.mesh.positions[*v as usize]).sum::<DVec3>() / 3.0;
            let far = |t| (spline.value(middle(t))).abs();
            mesh.mesh.triangles.iter().map(far).fold(0.0, f64::max)
        };
        let plain = surface::surface(&spline, 0.0, &DAffine3::IDENTITY);
        let (fine, report) = refine::surface(&spline, 0.0, &DAffine3::IDENTITY, 0.002);
        assert!(report.worst < 0.02 && 3.0 * off(&fine) < off(&plain), "{report:?} {} {}", off(&fine), off(&plain));
        let volume = sound(&fine).volume;
        assert!((volume / (4.0 / 3.0 * std::f64::consts::PI * 343.0) - 1.0).abs() < 2e-3, "{volume}");
    }

    #[test]
    fn real_values_and_what_is_not_a_number() {
        let dims = [8; 3];
        let mut data = sampled(dims, |p| 3.0 - (p - 3.5).length());
        data[9] = f32::NAN;
        data[10] = f32::INFINITY;
        let grid = Grid::new(dims, skewed(), Space::Unknown).unwrap();
        let mut volume = Volume::new(grid, 1, Samples::F32(data));
        let plain = surface::surface(&Spline::of_volume(&volume, 0, 0), 1.0, &skewed());
        assert!(sound(&plain).components == 1);
        volume.rescale.slope = 2.0;
        volume.rescale.intercept = -7.0;
        let scaled = surface::surface(&Spline::of_volume(&volume, 0, 0), -5.0, &skewed());
        assert_eq!(plain.mesh.triangles, scaled.mesh.triangles);
    }

    #[test]
    fn threads_do_not_change_the_mesh() {
        let n = 24;
        let data = blobs(n);
        let run = |threads: usize| {
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
                let spline = Spline::new([n; 3], &data, 3);
                (surface::surface(&spline, 0.3, &skewed()), refine::surface(&spline, 0.3, &skewed(), 0.05).0)
            })
        };
        let one = run(1);
        assert!(one == run(2) && one == run(5));
    }
}

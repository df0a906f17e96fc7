//! Triangulations against the outlines that they fill.

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use proptest::prelude::*;
use voxclay::evaluate::geometry::outlines;
use voxclay::math::{OrientedBox, PlaneFrame};
use voxclay::mesh::{Topology, TriMesh, primitives};
use voxclay::slice::{BoxSections, Planes, Slicer, Slices};
use voxclay::tessellate::regions::{Cutter, Region, cut_planes};
use voxclay::tessellate::{Limits, Method, Outlines, Tessellator, Triangulation};

const QUALITY: Method = Method::Quality(Limits { min_angle: 0.0, max_area: 0.0, keep_outline: false });

/// Outlines that own their arrays.
#[derive(Debug, Default, Clone)]
struct Owned {
    points: Vec<DVec2>,
    loop_start: Vec<u32>,
    plane_start: Vec<u32>,
    area: Vec<f64>,
    owner: Vec<u32>,
}

impl Owned {
    /// Polygons of one plane, each an outer loop and its holes.
    fn plane(polygons: &[&[Vec<DVec2>]]) -> Self {
        let mut s = Self { loop_start: vec![0], ..Self::default() };
        for polygon in polygons {
            let outer = s.owner.len() as u32;
            for l in *polygon {
                s.points.extend_from_slice(l);
                s.loop_start.push(s.points.len() as u32);
                s.area.push(shoelace(l));
                s.owner.push(outer);
            }
        }
        s.plane_start = vec![0, s.owner.len() as u32];
        s
    }

    fn outlines(&self) -> Outlines<'_> {
        Outlines {
            points: &self.points,
            loop_start: &self.loop_start,
            plane_start: &self.plane_start,
            area: &self.area,
            owner: &self.owner,
        }
    }
}

fn shoelace(p: &[DVec2]) -> f64 {
    (0..p.len()).map(|i| (p[i] - p[0]).perp_dot(p[(i + 1) % p.len()] - p[0])).sum::<f64>() / 2.0
}

fn ring(n: usize, radius: impl Fn(usize) -> f64, center: DVec2) -> Vec<DVec2> {
    (0..n).map(|i| center + DVec2::from_angle(TAU * i as f64 / n as f64) * radius(i)).collect()
}

fn backwards(mut l: Vec<DVec2>) -> Vec<DVec2> {
    l.reverse();
    l
}

fn points(l: &[(f64, f64)]) -> Vec<DVec2> {
    l.iter().map(|&p| p.into()).collect()
}

fn tessellate(outlines: &Outlines, method: Method) -> Triangulation {
    let mut t = Tessellator::default();
    t.run(outlines, method).clone()
}

fn area_of_plane(o: &Outlines, k: usize) -> f64 {
    (o.plane_start[k]..o.plane_start[k + 1])
        .map(|l| l as usize)
        .filter(|&l| o.owner[l] != u32::MAX)
        .map(|l| o.area[l])
        .sum()
}

/// The triangles of each plane have the area of its outline, none is upside down, and edges with one triangle only are
/// those of the outline: so nothing is covered twice and nothing is left out.
fn check(o: &Outlines, t: &Triangulation, tolerance: f64) {
    assert_eq!(t.plane_start.len(), o.plane_start.len());
    assert_eq!(t.plane_start.last().map_or(0, |n| *n as usize), t.triangles.len());
    assert!(t.triangles.iter().flatten().all(|&i| (i as usize) < o.points.len() + t.extra.len()));
    for k in 0..o.plane_start.len() - 1 {
        let expected = area_of_plane(o, k);
        let measured = t.plane_area(o, k);
        assert!(
            (measured - expected).abs() <= tolerance * expected.abs() + 1e-300,
            "plane {k}: {measured}, not {expected}"
        );
        for tri in &t.triangles[t.plane_triangles(k)] {
            let [a, b, c] = tri.map(|i| t.point(o, i));
            let at = |p: DVec2| robust::Coord { x: p.x, y: p.y };
            let turn = robust::orient2d(at(a), at(b), at(c));
            assert!(turn >= -1e-12 * expected.abs(), "plane {k}: {a} {b} {c} is upside down by {turn}");
        }
    }
}

/// Sums of edges, each counted against its reverse, by position; zero sums left out.
fn rim(triangles: impl Iterator<Item = [DVec2; 3]>) -> HashMap<[[u64; 2]; 2], i32> {
    let mut sums = HashMap::new();
    for [a, b, c] in triangles {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            add_edge(&mut sums, p, q);
        }
    }
    sums.retain(|_, n| *n != 0);
    sums
}

fn add_edge(sums: &mut HashMap<[[u64; 2]; 2], i32>, p: DVec2, q: DVec2) {
    let bits = |p: DVec2| [(p.x + 0.0).to_bits(), (p.y + 0.0).to_bits()];
    let (p, q) = (bits(p), bits(q));
    if p < q {
        *sums.entry([p, q]).or_insert(0) += 1;
    } else if q < p {
        *sums.entry([q, p]).or_insert(0) -= 1;
    }
}

fn rim_of_outline(o: &Outlines) -> HashMap<[[u64; 2]; 2], i32> {
    let mut sums = HashMap::new();
    for l in 0..o.owner.len() {
        let p = &o.points[o.loop_start[l] as usize..o.loop_start[l + 1] as usize];
        if o.owner[l] != u32::MAX {
            (0..p.len()).for_each(|i| add_edge(&mut sums, p[i], p[(i + 1) % p.len()]));
        }
    }
    sums.retain(|_, n| *n != 0);
    sums
}

/// All that must hold for an outline that does not touch itself.
fn check_simple(o: &Outlines) {
    for method in [Method::Fast, Method::Lyon, QUALITY] {
        let t = tessellate(o, method);
        check(o, &t, 1e-5);
        assert_eq!(t.made_by.mismatched, 0);
        assert!(t.extra.is_empty());
        if method == Method::Fast {
            assert_eq!((t.made_by.lyon, t.made_by.spade), (0, 0), "the sweep does simple outlines");
            check(o, &t, 1e-12);
            let measured = rim(t.triangles.iter().map(|t| t.map(|i| o.points[i as usize])));
            assert_eq!(measured, rim_of_outline(o));
        }
    }
}

fn sections(mesh: &TriMesh, direction: DVec3, n: usize) -> (Planes, Slices) {
    let planes = Planes::across(PlaneFrame::across(direction).expect("a direction"), &mesh.positions, n);
    let topology = Topology::build(mesh.positions.len(), &mesh.triangles);
    let mut slicer = Slicer::default();
    slicer.slice(&mesh.positions, &topology, &planes).expect("not too many points");
    (planes, slicer.slices)
}

#[test]
fn simple_polygons() {
    let square = points(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]);
    check_simple(&Owned::plane(&[std::slice::from_ref(&square)]).outlines());
    check_simple(&Owned::plane(&[&[points(&[(0.0, 0.0), (1.0, 0.5), (0.3, 2.0)])]]).outlines());
    // collinear points on every side
    let dense: Vec<DVec2> = (0..4)
        .flat_map(|i| (0..5).map(move |j| (i, j)))
        .map(|(i, j)| square[i].lerp(square[(i + 1) % 4], f64::from(j) / 5.0))
        .collect();
    check_simple(&Owned::plane(&[&[dense]]).outlines());
    // a comb with teeth up and a comb with teeth down
    let comb = |flip: bool| -> Vec<DVec2> {
        let mut l = vec![DVec2::new(20.0, -1.0), DVec2::new(20.0, 0.0)];
        for i in (0..20).rev() {
            l.extend([DVec2::new(f64::from(i) + 0.5, 5.0 + f64::from(i % 3)), DVec2::new(f64::from(i), 0.0)]);
        }
        l.push(DVec2::new(0.0, -1.0));
        if flip { l.iter().map(|p| DVec2::new(-p.x, -p.y)).collect() } else { l }
    };
    check_simple(&Owned::plane(&[&[comb(false)]]).outlines());
    check_simple(&Owned::plane(&[&[comb(true)]]).outlines());
    // a spiral
    let arm = |r: f64| (0..60).map(move |i| DVec2::from_angle(f64::from(i) * 0.3) * (1.0 + f64::from(i) * 0.1 + r));
    let spiral: Vec<DVec2> = arm(0.5).chain(arm(0.0).collect::<Vec<_>>().into_iter().rev()).collect();
    check_simple(&Owned::plane(&[&[spiral]]).outlines());
}

#[test]
fn holes_and_islands() {
    let outer = ring(40, |i| 3.0 + (i % 3) as f64 * 0.2, DVec2::ZERO);
    let hole = |x: f64, y: f64| backwards(ring(17, |_| 0.4, DVec2::new(x, y)));
    let holes = [hole(1.0, 0.0), hole(-1.0, 0.0), hole(0.0, 1.3), hole(0.0, -1.3), hole(0.0, 0.0)];
    let polygon: Vec<Vec<DVec2>> = [outer].into_iter().chain(holes).collect();
    let island = [ring(9, |_| 0.2, DVec2::ZERO)];
    check_simple(&Owned::plane(&[&polygon, &island]).outlines());
    // a grid of holes: many intervals at once
    let mut sieve = vec![points(&[(-1.0, -1.0), (10.0, -1.0), (10.0, 10.0), (-1.0, 10.0)])];
    sieve.extend((0..100).map(|i| backwards(ring(5 + i % 4, |_| 0.3, DVec2::new((i % 10) as f64, (i / 10) as f64)))));
    check_simple(&Owned::plane(&[&sieve]).outlines());
}

#[test]
fn far_from_the_origin_and_at_any_scale() {
    let shape = ring(50, |i| if i % 2 == 0 { 1.0 } else { 0.7 }, DVec2::ZERO);
    for (scale, offset) in [(1.0, 0.0), (1e-9, 0.0), (1e12, 0.0), (1.0, 1e5), (1e-3, 1e4)] {
        let moved = shape.iter().map(|p| *p * scale + DVec2::splat(offset)).collect();
        check_simple(&Owned::plane(&[&[moved]]).outlines());
    }
}

#[test]
fn slivers() {
    let needle = points(&[(0.0, 0.0), (1e6, 0.0), (1e6, 1e-3)]);
    let o = Owned::plane(&[&[needle]]);
    let t = tessellate(&o.outlines(), Method::Fast);
    check(&o.outlines(), &t, 1e-12);
    // a ring almost as wide as its hole
    let thin = Owned::plane(&[&[ring(200, |_| 1.0, DVec2::ZERO), backwards(ring(200, |_| 1.0 - 1e-9, DVec2::ZERO))]]);
    let t = tessellate(&thin.outlines(), Method::Fast);
    check(&thin.outlines(), &t, 1e-6);
    let t = tessellate(&thin.outlines(), Method::Lyon);
    assert_eq!((t.made_by.spade, t.made_by.mismatched), (1, 0), "f32 cannot tell the rings apart, the area can");
    check(&thin.outlines(), &t, 1e-5);
}

#[test]
fn outlines_that_touch_themselves() {
    // two squares that share a corner, as one loop
    let eight =
        points(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0), (1.0, 1.0), (0.0, 1.0)]);
    // a hole that touches the outer loop in a corner, and repeated points
    let outer = points(&[(0.0, 0.0), (0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (4.0, 4.0), (4.0, 4.0), (0.0, 4.0)]);
    let hole = points(&[(0.0, 0.0), (1.0, 2.0), (2.0, 1.0)]);
    for o in [Owned::plane(&[&[eight]]), Owned::plane(&[&[outer, hole]])] {
        for method in [Method::Fast, Method::Lyon, QUALITY] {
            let t = tessellate(&o.outlines(), method);
            assert_eq!(t.made_by.mismatched, 0, "{method:?}");
            check(&o.outlines(), &t, 1e-5);
        }
    }
}

#[test]
fn outlines_that_cross_themselves_are_filled_where_they_wind() {
    // a bow tie: one wing is turned the right way
    let tie = Owned::plane(&[&[points(&[(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 3.0)])]]);
    for method in [Method::Fast, Method::Lyon, QUALITY] {
        let t = tessellate(&tie.outlines(), method);
        assert_eq!(t.made_by.mismatched, 1);
        assert!(t.plane_area(&tie.outlines(), 0) > 0.0);
    }
    // a pentagram: its middle is wound round twice and drawn once
    let star: Vec<DVec2> = (0..5).map(|i| DVec2::from_angle(TAU * 0.4 * f64::from(i) + 0.1)).collect();
    let o = Owned::plane(&[&[star]]);
    let t = tessellate(&o.outlines(), QUALITY);
    // its tips and where its edges cross
    assert_eq!((t.extra.len(), t.made_by.mismatched), (10, 1));
    let inner = (TAU / 10.0).cos().recip() * (TAU / 5.0).cos();
    let expected = 5.0 * inner * (TAU / 10.0).sin();
    assert!((t.plane_area(&o.outlines(), 0) - expected).abs() < 1e-9, "{} {expected}", t.plane_area(&o.outlines(), 0));
}

#[test]
fn nothing_comes_of_nothing_and_of_nan() {
    let empty = Owned { loop_start: vec![0], plane_start: vec![0, 0, 0], ..Owned::default() };
    let line = Owned::plane(&[&[points(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)])]]);
    let dot = Owned::plane(&[&[points(&[(1.0, 1.0), (1.0, 1.0), (1.0, 1.0)])]]);
    let nan = Owned::plane(&[&[points(&[(0.0, 0.0), (f64::NAN, 1.0), (2.0, 2.0)])]]);
    let infinite = Owned::plane(&[&[points(&[(0.0, 0.0), (f64::INFINITY, 1.0), (2.0, 2.0)])]]);
    let huge = Owned::plane(&[&[points(&[(0.0, 0.0), (1e200, 1.0), (2.0, 1e200)])]]);
    for o in [empty, line, dot, nan, infinite, huge] {
        for method in [Method::Fast, Method::Lyon, QUALITY] {
            let t = tessellate(&o.outlines(), method);
            let area: f64 = (0..o.plane_start.len() - 1).map(|k| t.plane_area(&o.outlines(), k)).sum();
            assert!(area.is_finite(), "{o:?} {method:?}");
        }
    }
}

#[test]
fn all_tessellators_agree_on_sections() {
    for mesh in [primitives::bumpy_sphere(14), primitives::cavity_sphere(14), primitives::torus(1.0, 0.4, 50, 30)] {
        for d in [DVec3::Z, DVec3::new(0.31, 0.52, 0.8), DVec3::X] {
            let (_, s) = sections(&mesh, d, 41);
            let o = outlines(&s);
            check_simple(&o);
        }
    }
}

#[test]
fn sections_of_a_box_at_its_faces_and_edges() {
    let unit = primitives::aligned_box(DVec3::ZERO, DVec3::ONE);
    for seed in 0..40 {
        let x = |i: i32| (f64::from(seed * 13 + i) * 78.233).sin();
        let turn = DAffine3::from_quat(DQuat::from_xyzw(x(0), x(1), x(2), x(3)).normalize());
        let (_, s) = sections(&unit.transformed(&turn), DVec3::new(x(4), x(5), x(6)), 25);
        check_simple(&outlines(&s));
    }
    let frame = PlaneFrame::across(DVec3::Z).expect("a direction");
    let planes = Planes { frame, first: 0.0, step: 0.5, count: 3 };
    let mut slicer = Slicer::default();
    let s = slicer.slice(&unit.positions, &Topology::build(8, &unit.triangles), &planes).expect("few points");
    check_simple(&outlines(s));
    assert_eq!(tessellate(&outlines(s), Method::Fast).plane_area(&outlines(s), 2), 1.0);
}

#[test]
fn refined_triangles_keep_their_limits() {
    let square = points(&[(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]);
    let hole = points(&[(1.0, 1.0), (1.0, 3.0), (3.0, 3.0), (3.0, 1.0)]);
    let o = Owned::plane(&[&[square, hole]]);
    for keep_outline in [false, true] {
        let limits = Limits { min_angle: 20.0, max_area: 0.05, keep_outline };
        let t = tessellate(&o.outlines(), Method::Quality(limits));
        check(&o.outlines(), &t, 1e-9);
        assert!(!t.extra.is_empty());
        let areas = t.triangles.iter().map(|tri| shoelace(&tri.map(|i| t.point(&o.outlines(), i))));
        let largest = areas.fold(0.0, f64::max);
        assert!(keep_outline || largest <= 0.05 * (1.0 + 1e-9), "{largest}");
        let inner = t.triangles.iter().filter(|tri| tri.iter().all(|&i| i >= 8));
        let of_inner = inner.map(|tri| shoelace(&tri.map(|i| t.point(&o.outlines(), i)))).fold(0.0, f64::max);
        assert!(of_inner > 0.0 && of_inner <= 0.05 * (1.0 + 1e-9), "{of_inner}");
        if keep_outline {
            let measured = rim(t.triangles.iter().map(|tri| tri.map(|i| t.point(&o.outlines(), i))));
            assert_eq!(measured, rim_of_outline(&o.outlines()));
            assert!(t.extra.len() > 60, "{}", t.extra.len());
        }
    }
}

#[test]
fn results_do_not_depend_on_what_was_before() {
    let mut kept = Tessellator::default();
    for mesh in
        [primitives::cavity_sphere(30), primitives::aligned_box(DVec3::ZERO, DVec3::ONE), primitives::bumpy_sphere(9)]
    {
        let (_, s) = sections(&mesh, DVec3::new(0.2, 0.3, 0.9), 77);
        for method in [Method::Fast, QUALITY, Method::Lyon] {
            assert_eq!(*kept.run(&outlines(&s), method), tessellate(&outlines(&s), method));
        }
    }
}

fn region_view<'a>(r: &'a Region, plane_start: &'a [u32; 2]) -> Outlines<'a> {
    Outlines { points: &r.points, loop_start: &r.loop_start, plane_start, area: &r.area, owner: &r.owner }
}

/// Inside and outside cover the section exactly once, and fit together along the cut edge by edge.
fn check_regions(o: &Outlines, k: usize, convex: &[Vec<DVec2>], method: Method) -> (f64, f64) {
    let regions = Cutter::default().cut(o, k, convex, method);
    let section = area_of_plane(o, k);
    let mut all = Vec::new();
    for r in [&regions.outside, &regions.inside] {
        assert!((r.area() - r.outline_area()).abs() <= 1e-9 * section, "{} {}", r.area(), r.outline_area());
        assert_eq!(r.made_by.mismatched, 0);
        let starts = [0, r.owner.len() as u32];
        let corners: Vec<[DVec2; 3]> = r.triangles.iter().map(|t| t.map(|i| r.point(i))).collect();
        assert!(corners.iter().all(|c| shoelace(c) >= -1e-12 * section));
        if r.made_by.lyon + r.made_by.spade == 0 {
            assert_eq!(rim(corners.iter().copied()), rim_of_outline(&region_view(r, &starts)));
        }
        all.extend(corners);
    }
    let sum = regions.inside.area() + regions.outside.area();
    assert!((sum - section).abs() <= 1e-9 * section, "{sum} {section}");
    // edges of the cut are in both parts, with the same ends: what is left is the outline of the section
    let left = rim(all.into_iter());
    let length: f64 = left.keys().map(|e| (bits(e[0]) - bits(e[1])).length()).sum();
    let outline: f64 = (o.plane_start[k]..o.plane_start[k + 1])
        .map(|l| &o.points[o.loop_start[l as usize] as usize..o.loop_start[l as usize + 1] as usize])
        .map(|p| (0..p.len()).map(|i| (p[i] - p[(i + 1) % p.len()]).length()).sum::<f64>())
        .sum();
    assert!((length - outline).abs() <= 1e-9 * outline, "open edges of length {length} around {outline}");
    (regions.inside.area(), regions.outside.area())
}

fn bits(p: [u64; 2]) -> DVec2 {
    DVec2::new(f64::from_bits(p[0]), f64::from_bits(p[1]))
}

#[test]
fn a_square_parted_by_squares() {
    let square = |x: f64, y: f64, h: f64| points(&[(x - h, y - h), (x + h, y - h), (x + h, y + h), (x - h, y + h)]);
    let o = Owned::plane(&[&[square(0.0, 0.0, 2.0), backwards(square(1.0, 1.0, 0.25))]]);
    let o = o.outlines();
    let near = |a: (f64, f64), inside: f64| {
        assert!((a.0 - inside).abs() < 1e-12 && (a.1 - (15.75 - inside)).abs() < 1e-12, "{a:?} {inside}");
    };
    for method in
        [Method::Fast, QUALITY, Method::Quality(Limits { min_angle: 20.0, max_area: 0.1, keep_outline: false })]
    {
        near(check_regions(&o, 0, &[], method), 0.0);
        near(check_regions(&o, 0, &[square(9.0, 0.0, 1.0)], method), 0.0);
        near(check_regions(&o, 0, &[square(0.0, 0.0, 9.0)], method), 15.75);
        near(check_regions(&o, 0, &[square(-1.0, -1.0, 0.5)], method), 1.0);
        // half outside, over the hole, overlapping, the same twice, the other way round, edge on edge
        near(check_regions(&o, 0, &[square(-2.0, 0.0, 1.0)], method), 2.0);
        near(check_regions(&o, 0, &[square(1.0, 1.0, 0.5)], method), 0.75);
        near(check_regions(&o, 0, &[square(-1.0, -1.0, 0.5), square(-0.5, -0.5, 0.5)], method), 1.75);
        near(check_regions(&o, 0, &[square(-1.0, -1.0, 0.5), square(-1.0, -1.0, 0.5)], method), 1.0);
        near(check_regions(&o, 0, &[square(-1.0, -1.0, 0.5), backwards(square(-0.5, -0.5, 0.5))], method), 1.75);
        near(check_regions(&o, 0, &[square(-1.5, -1.5, 0.5), square(-0.5, -1.5, 0.5)], method), 2.0);
        near(check_regions(&o, 0, &[square(1.0, 1.0, 0.25)], method), 0.0);
        near(check_regions(&o, 0, &[square(0.0, 0.0, 2.0)], method), 15.75);
        near(check_regions(&o, 0, &[points(&[(f64::NAN, 0.0), (1.0, 0.0), (0.0, 1.0)])], method), 0.0);
    }
}

#[test]
fn sections_parted_by_boxes() {
    for mesh in [primitives::bumpy_sphere(10), primitives::cavity_sphere(12)] {
        let (planes, s) = sections(&mesh, DVec3::new(0.31, 0.52, 0.8), 31);
        let turned = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(0.6, 0.8, 0.0), 0.7));
        let boxes = [
            OrientedBox { center: DVec3::new(0.3, 0.2, 0.1), axes: turned, half: DVec3::new(0.4, 0.3, 0.5) },
            OrientedBox { center: DVec3::new(0.1, 0.4, 0.2), axes: DMat3::IDENTITY, half: DVec3::new(0.5, 0.2, 0.3) },
            OrientedBox {
                center: DVec3::new(-0.8, 0.0, -0.2),
                axes: turned.transpose(),
                half: DVec3::new(0.6, 0.3, 0.2),
            },
        ];
        let convex_of = |k: usize| {
            boxes.iter().map(|b| BoxSections::new(b, &planes.frame).at(planes.height(k))).collect::<Vec<_>>()
        };
        let mut inside = 0.0;
        for k in 0..31 {
            inside += check_regions(&outlines(&s), k, &convex_of(k), Method::Fast).0;
        }
        assert!(inside > 1.0);
        let all = cut_planes(&outlines(&s), convex_of, Method::Fast);
        let together: f64 = all.iter().map(|r| r.inside.area()).sum();
        assert!((together - inside).abs() < 1e-9);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Stars of random radii with a star in the middle of them.
    #[test]
    fn random_stars(radii in proptest::collection::vec(0.4..1.0f64, 3..60), hole in proptest::collection::vec(0.05..0.15f64, 3..20)) {
        let n = radii.len();
        // a triangle of small radii may not enclose the hole
        prop_assume!(n > 6);
        let outer = ring(n, |i| radii[i], DVec2::new(0.3, -0.2));
        let hole = backwards(ring(hole.len(), |i| hole[i], DVec2::new(0.3, -0.2)));
        check_simple(&Owned::plane(&[&[outer, hole]]).outlines());
    }

    /// Random integer loops: touching, overlapping and crossing themselves. No panic, and never more than is wound round.
    #[test]
    fn random_loops(p in proptest::collection::vec((0i32..6, 0i32..6), 3..14), q in proptest::collection::vec((0i32..6, 0i32..6), 3..6)) {
        let to_loop = |p: &[(i32, i32)]| -> Vec<DVec2> {
            let l: Vec<DVec2> = p.iter().map(|&(x, y)| DVec2::new(x.into(), y.into())).collect();
            if shoelace(&l) < 0.0 { backwards(l) } else { l }
        };
        let o = Owned::plane(&[&[to_loop(&p)], &[to_loop(&q)]]);
        let o = o.outlines();
        for method in [Method::Fast, Method::Lyon, QUALITY] {
            let t = tessellate(&o, method);
            let area = t.plane_area(&o, 0);
            prop_assert!((-1e-9..=50.0 + 1e-9).contains(&area), "{area}");
            if t.made_by.mismatched == 0 {
                prop_assert!((area - area_of_plane(&o, 0)).abs() <= 1e-5 * area.abs());
            }
        }
    }

    /// The same with points off by rounding, so that edges cross at angles of rounding.
    #[test]
    fn almost_parallel_edges(p in proptest::collection::vec((0i32..5, 0i32..5, -9i32..9, -9i32..9), 8..60), size in -52i32..-40) {
        let hair = f64::from(size).exp2();
        let l: Vec<DVec2> = p
            .iter()
            .map(|&(x, y, dx, dy)| DVec2::new(f64::from(x) + f64::from(dx) * hair, f64::from(y) + f64::from(dy) * hair) * 18.7)
            .collect();
        let l = if shoelace(&l) < 0.0 { backwards(l) } else { l };
        let o = Owned::plane(&[&[l]]);
        let o = o.outlines();
        for method in [Method::Fast, QUALITY, Method::Quality(Limits::default())] {
            let area = tessellate(&o, method).plane_area(&o, 0);
            prop_assert!((-1e-9..=16.1 * 18.7 * 18.7).contains(&area), "{area}");
        }
    }

    /// Sections of random blobs parted by random boxes.
    #[test]
    fn random_cuts(
        radii in proptest::collection::vec(0.5..1.0f64, 92),
        boxes in proptest::collection::vec((-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64, 0.1..0.8f64, 0.0..6.0f64), 1..4),
    ) {
        let mut mesh = primitives::geodesic_sphere(3);
        mesh.positions.iter_mut().zip(&radii).for_each(|(p, r)| *p *= *r);
        let (planes, s) = sections(&mesh, DVec3::new(0.1, 0.7, 0.3), 5);
        for k in 0..5 {
            let convex: Vec<Vec<DVec2>> = boxes.iter().map(|&(x, y, z, h, angle)| {
                let axes = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), angle);
                let b = OrientedBox { center: DVec3::new(x, y, z), axes, half: DVec3::new(h, 0.5 * h, h) };
                BoxSections::new(&b, &planes.frame).at(planes.height(k))
            }).collect();
            check_regions(&outlines(&s), k, &convex, Method::Fast);
        }
    }
}

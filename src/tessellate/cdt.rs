//! spade's constrained Delaunay triangulation.

use std::collections::HashMap;

use glam::DVec2;
use spade::{
    AngleLimit, ConstrainedDelaunayTriangulation, HasPosition, Point2, RefinementParameters, Triangulation as _,
};

use super::{Limits, Polygon};
use crate::math::winding::{FillRule, shapes};

/// A vertex that knows which point of the outline it is.
#[derive(Debug, Clone, Copy)]
struct Vertex {
    at: Point2<f64>,
    id: u32,
}

/// Stands for a vertex that the outline does not have.
const ADDED: u32 = u32::MAX;

impl HasPosition for Vertex {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.at
    }
}

impl From<Point2<f64>> for Vertex {
    fn from(at: Point2<f64>) -> Self {
        Self { at, id: ADDED }
    }
}

type Cdt = ConstrainedDelaunayTriangulation<Vertex>;

/// More refinement than this many points for each point of the outline, and this many at all, is not asked for.
const MOST_ADDED: (usize, usize) = (200, 20_000);

/// Triangulates what the outline winds round. Points may touch, edges may cross. Leaves nothing out but what spade
/// cannot represent (coordinates beyond 1e60).
pub(super) fn run(polygon: &Polygon, limits: Limits, triangles: &mut Vec<[u32; 3]>, extra: &mut Vec<DVec2>) {
    let given = polygon.loops().map(|(points, first)| points.iter().copied().zip(first..));
    let Some((mut cdt, crossed)) = load(given) else { return };
    if crossed {
        // spade can split edges where they cross, but fails where rounding puts the place beyond other edges
        let loops: Vec<Vec<[f64; 2]>> =
            polygon.loops().map(|(points, _)| points.iter().map(|p| p.to_array()).collect()).collect();
        let united = shapes(&loops, FillRule::Positive).into_iter().flatten();
        let added = united.map(|points| points.into_iter().map(|p| (DVec2::from(p), ADDED)));
        if let Some((without, _)) = load(added) {
            cdt = without;
        }
    }
    if limits.min_angle > 0.0 || limits.max_area > 0.0 && limits.max_area.is_finite() {
        if limits.keep_outline {
            fill(&mut cdt, limits, polygon);
        } else {
            refine(&mut cdt, limits, polygon.area());
        }
    }

    let inside = inside(&cdt, polygon);
    let mut ids: Vec<u32> = cdt.vertices().map(|v| v.data().id).collect();
    for face in cdt.inner_faces() {
        if inside[face.fix().index()] {
            triangles.push(face.vertices().map(|v| {
                let id = &mut ids[v.fix().index()];
                if *id == ADDED {
                    *id = (polygon.outlines.points.len() + extra.len()) as u32;
                    extra.push(to_dvec(v.position()));
                }
                *id
            }));
        }
    }
}

/// Closed loops of points, each with its id, as constraints; and whether some were left out, since they cross others.
fn load(loops: impl Iterator<Item = impl Iterator<Item = (DVec2, u32)>>) -> Option<(Cdt, bool)> {
    // spade takes each place once; -0 is 0
    let mut place_of = HashMap::new();
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut edges = Vec::new();
    for points in loops {
        let mut places = points.map(|(p, id)| {
            let p = p + DVec2::ZERO;
            *place_of.entry([p.x.to_bits(), p.y.to_bits()]).or_insert_with(|| {
                vertices.push(Vertex { at: spade::mitigate_underflow(Point2::new(p.x, p.y)), id });
                vertices.len() - 1
            })
        });
        let Some(start) = places.next() else { continue };
        let mut from = start;
        for to in places.chain([start]) {
            if from != to {
                edges.push([from, to]);
            }
            from = to;
        }
    }
    let mut crossed = false;
    let cdt = Cdt::try_bulk_load_cdt(vertices, edges, |_| crossed = true).ok()?;
    Some((cdt, crossed))
}

fn refine(cdt: &mut Cdt, limits: Limits, area: f64) {
    let mut parameters = RefinementParameters::new()
        .exclude_outer_faces(true)
        .with_angle_limit(AngleLimit::from_deg(limits.min_angle.clamp(0.0, 30.0)))
        // slivers between almost parallel edges of the outline cannot be cured
        .with_min_required_area(1e-9 * area.abs())
        .with_max_additional_vertices((MOST_ADDED.0 * cdt.num_vertices()).min(MOST_ADDED.1));
    if limits.max_area.is_finite() && limits.max_area > 0.0 {
        parameters = parameters.with_max_allowed_area(limits.max_area.max(1e-8 * area.abs()));
    }
    cdt.refine(parameters);
}

/// Points inside only, in a triangular pattern as dense as the largest area asks for. (spade's refinement gives up on
/// every triangle at an edge that must not be split.)
fn fill(cdt: &mut Cdt, limits: Limits, polygon: &Polygon) {
    let area = polygon.area().abs();
    let most = (MOST_ADDED.0 * cdt.num_vertices()).min(MOST_ADDED.1);
    // one point goes with two triangles
    let largest = limits.max_area.max(area / (2 * most) as f64);
    let step = (largest * 4.0 / 3f64.sqrt()).sqrt();
    if !(step.is_finite() && step > 0.0) {
        return;
    }
    let (lo, hi) = polygon
        .loops()
        .flat_map(|(points, _)| points)
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
    let row = 0.5 * 3f64.sqrt() * step;
    let mut added = 0;
    for j in 0..(((hi.y - lo.y) / row) as usize).min(most) {
        for i in 0..(((hi.x - lo.x) / step) as usize).min(most) {
            let offset = if j % 2 == 0 { 0.25 } else { 0.75 };
            let p = lo + DVec2::new((i as f64 + offset) * step, (j as f64 + 0.5) * row);
            let is_clear = || clearance(polygon, p) > 0.25 * step * step;
            if winding(polygon, p) > 0 && is_clear() && added < most && cdt.insert(Point2::new(p.x, p.y).into()).is_ok()
            {
                added += 1;
            }
        }
    }
}

/// The square of the distance of a point from the outline.
fn clearance(polygon: &Polygon, p: DVec2) -> f64 {
    let mut least = f64::INFINITY;
    for (points, _) in polygon.loops() {
        let Some(mut a) = points.last().copied() else { continue };
        for &b in points {
            let along = b - a;
            let t = ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            least = least.min((a + along * if t.is_nan() { 0.0 } else { t }).distance_squared(p));
            a = b;
        }
    }
    least
}

/// For each face whether the outline winds round it. Faces that no constraint parts have the same answer, so that it is
/// found once for each such patch, in the middle of its largest face.
fn inside(cdt: &Cdt, polygon: &Polygon) -> Vec<bool> {
    let mut inside = vec![false; cdt.num_all_faces()];
    let mut seen = inside.clone();
    let mut patch = Vec::new();
    for start in cdt.inner_faces() {
        if std::mem::replace(&mut seen[start.fix().index()], true) {
            continue;
        }
        patch.clear();
        patch.push(start);
        let mut next = 0;
        while let Some(&face) = patch.get(next) {
            next += 1;
            for edge in face.adjacent_edges() {
                if let Some(other) = edge.rev().face().as_inner()
                    && !edge.is_constraint_edge()
                    && !std::mem::replace(&mut seen[other.fix().index()], true)
                {
                    patch.push(other);
                }
            }
        }
        let largest = patch.iter().max_by(|a, b| a.area().total_cmp(&b.area()));
        if largest.is_some_and(|f| winding(polygon, to_dvec(f.center())) > 0) {
            patch.iter().for_each(|f| inside[f.fix().index()] = true);
        }
    }
    inside
}

/// How often the loops run anticlockwise round a point.
fn winding(polygon: &Polygon, p: DVec2) -> i32 {
    let mut n = 0;
    for (points, _) in polygon.loops() {
        let Some(mut a) = points.last().copied() else { continue };
        for &b in points {
            if (a.y > p.y) != (b.y > p.y) {
                let left = (b - a).perp_dot(p - a) > 0.0;
                if left == (b.y > a.y) {
                    n += if left { 1 } else { -1 };
                }
            }
            a = b;
        }
    }
    n
}

fn to_dvec(p: Point2<f64>) -> DVec2 {
    DVec2::new(p.x, p.y)
}

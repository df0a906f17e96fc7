//! Intersection tests that are right for every input: signs of determinants by adaptive arithmetic (Shewchuk 1997).
//!
//! Sets are closed: what touches, meets. Triangles must not be degenerate ([`degenerate`]).

use glam::DVec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

pub(super) type Triangle = [DVec3; 3];

/// Positive if `d` lies on the side of the plane `abc` from which a, b, c run anticlockwise, zero in the plane. Only the
/// sign is exact.
pub(super) fn side([a, b, c]: Triangle, d: DVec3) -> f64 {
    let coord = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    -orient3d(coord(a), coord(b), coord(c), coord(d))
}

/// Positive if a, b, c run anticlockwise when the two coordinates that `axis` leaves are drawn as x and y. Only the sign
/// is exact.
pub(super) fn turn(axis: usize, a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let coord = |p: DVec3| Coord { x: p[(axis + 1) % 3], y: p[(axis + 2) % 3] };
    orient2d(coord(a), coord(b), coord(c))
}

/// Whether the corners lie on one line (or in one point).
pub(super) fn degenerate([a, b, c]: Triangle) -> bool {
    (0..3).all(|axis| turn(axis, a, b, c) == 0.0)
}

/// Whether two triangles without a common corner share a point.
pub(super) fn triangles_meet(s: Triangle, t: Triangle) -> bool {
    let apart = |t: Triangle, s: Triangle| {
        let d = s.map(|p| side(t, p));
        d.iter().all(|&d| d > 0.0) || d.iter().all(|&d| d < 0.0)
    };
    if apart(s, t) || apart(t, s) {
        return false;
    }
    let edges = |t: Triangle| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    edges(s).iter().any(|&e| segment_meets_triangle(e, t)) || edges(t).iter().any(|&e| segment_meets_triangle(e, s))
}

/// Whether the segment shares a point with the triangle.
pub(super) fn segment_meets_triangle([p, q]: [DVec3; 2], t: Triangle) -> bool {
    let (above, below) = (side(t, p), side(t, q));
    if (above > 0.0 && below > 0.0) || (above < 0.0 && below < 0.0) {
        return false;
    }
    if above == 0.0 && below == 0.0 {
        return segment_meets_triangle_in_plane([p, q], t);
    }
    let [a, b, c] = t;
    let around = [side([p, q, a], b), side([p, q, b], c), side([p, q, c], a)];
    around.iter().all(|&s| s >= 0.0) || around.iter().all(|&s| s <= 0.0)
}

fn segment_meets_triangle_in_plane([p, q]: [DVec3; 2], t: Triangle) -> bool {
    // any projection in which the triangle keeps an area tells the truth
    let Some(axis) = (0..3).find(|&axis| turn(axis, t[0], t[1], t[2]) != 0.0) else { return false };
    let inside = |x: DVec3| {
        let s = [turn(axis, t[0], t[1], x), turn(axis, t[1], t[2], x), turn(axis, t[2], t[0], x)];
        s.iter().all(|&s| s >= 0.0) || s.iter().all(|&s| s <= 0.0)
    };
    let crosses = |a: DVec3, b: DVec3| {
        let (pa, pb) = (turn(axis, p, q, a), turn(axis, p, q, b));
        let (ap, aq) = (turn(axis, a, b, p), turn(axis, a, b, q));
        // strictly, or with an end of ab on pq; ends of pq on ab are found by `inside`
        (pa * pb < 0.0 || (pa > 0.0) != (pb > 0.0)) && ((ap > 0.0) != (aq > 0.0) || (ap < 0.0) != (aq < 0.0))
    };
    inside(p) || inside(q) || crosses(t[0], t[1]) || crosses(t[1], t[2]) || crosses(t[2], t[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn p(x: f64, y: f64, z: f64) -> DVec3 {
        DVec3::new(x, y, z)
    }

    #[test]
    fn signs_are_those_of_the_right_hand_rule() {
        let t = [p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(0.0, 1.0, 0.0)];
        assert!(side(t, p(0.2, 0.2, 1e-300)) > 0.0);
        assert!(side(t, p(5.0, 7.0, -1.0)) < 0.0);
        assert_eq!(side(t, p(5.0, 7.0, 0.0)), 0.0);
        assert!(turn(2, t[0], t[1], t[2]) > 0.0 && turn(0, t[0], t[1], t[2]) == 0.0);
        assert!(degenerate([p(1.0, 2.0, 3.0), p(2.0, 4.0, 6.0), p(3.0, 6.0, 9.0)]));
    }

    /// Exact in integers: separating axes over all edge directions and normals, the two planes' in-plane axes included.
    fn meet_in_integers(s: [[i64; 3]; 3], t: [[i64; 3]; 3]) -> bool {
        let sub = |a: [i64; 3], b: [i64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let cross = |a: [i64; 3], b: [i64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let dot = |a: [i64; 3], b: [i64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let edges = |t: [[i64; 3]; 3]| [sub(t[1], t[0]), sub(t[2], t[1]), sub(t[0], t[2])];
        let (es, et) = (edges(s), edges(t));
        let (ns, nt) = (cross(es[0], es[1]), cross(et[0], et[1]));
        let mut axes = vec![ns, nt];
        for a in es {
            axes.push(cross(ns, a));
            axes.extend(et.iter().map(|&b| cross(a, b)));
        }
        axes.extend(et.iter().map(|&b| cross(nt, b)));
        axes.iter().all(|&axis| {
            let range = |t: [[i64; 3]; 3]| {
                let d = t.map(|p| dot(p, axis));
                (d.iter().copied().min(), d.iter().copied().max())
            };
            let ((a0, a1), (b0, b1)) = (range(s), range(t));
            a0 <= b1 && b0 <= a1
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        #[test]
        fn triangles_on_a_coarse_lattice_meet_as_in_integers(
            s in proptest::array::uniform3(proptest::array::uniform3(0i64..5)),
            t in proptest::array::uniform3(proptest::array::uniform3(0i64..5)),
            flat in any::<bool>(),
        ) {
            // many cases touch or lie in one plane
            let flatten = |t: [[i64; 3]; 3]| t.map(|p| if flat { [p[0], p[1], p[0] + p[1]] } else { p });
            let (s, t) = (flatten(s), flatten(t));
            let real = |t: [[i64; 3]; 3]| t.map(|p| DVec3::new(p[0] as f64, p[1] as f64, p[2] as f64) * 0.125);
            let (a, b) = (real(s), real(t));
            prop_assume!(!degenerate(a) && !degenerate(b));
            prop_assert_eq!(triangles_meet(a, b), meet_in_integers(s, t));
            prop_assert_eq!(triangles_meet(b, a), meet_in_integers(s, t));
        }
    }
}

//! Sections laid out in squares: every point is covered once, whatever the outline.

use std::collections::HashMap;

use glam::DVec2;
use voxclay::tessellate::Outlines;
use voxclay::tessellate::squares::Squares;

fn shoelace(points: &[DVec2]) -> f64 {
    0.5 * points.windows(2).map(|w| (w[0] - points[0]).perp_dot(w[1] - points[0])).sum::<f64>()
}

fn area(points: &[DVec2], triangles: &[[u32; 3]]) -> f64 {
    triangles.iter().map(|t| shoelace(&t.map(|i| points[i as usize]))).sum()
}

fn ring(center: DVec2, radius: f64, n: usize, turn: f64) -> Vec<DVec2> {
    let angle = |i: usize| turn * i as f64 / n as f64 * std::f64::consts::TAU;
    (0..n).map(|i| center + radius * DVec2::from_angle(angle(i))).collect()
}

/// Lays squares over a plane with these loops, and checks that every point is covered once.
fn laid(loops: &[Vec<DVec2>], convex: &[Vec<DVec2>], step: f64) -> Squares {
    let mut start = vec![0];
    for l in loops {
        start.push(start[start.len() - 1] + l.len() as u32);
    }
    let areas: Vec<f64> = loops.iter().map(|l| shoelace(l)).collect();
    let mut outer = 0;
    let owner: Vec<u32> = (0..loops.len())
        .map(|l| {
            outer = if areas[l] > 0.0 { l } else { outer };
            outer as u32
        })
        .collect();
    let points: Vec<DVec2> = loops.iter().flatten().copied().collect();
    let plane_start = [0, loops.len() as u32];
    let outlines =
        Outlines { points: &points, loop_start: &start, plane_start: &plane_start, area: &areas, owner: &owner };
    let mut squares = Squares::default();
    squares.lay(&outlines, 0, convex, step);
    let all: f64 = areas.iter().sum();
    let sum = area(&squares.points, &squares.inside) + area(&squares.points, &squares.rest);
    assert!((sum - all).abs() < 1e-9 * all, "{sum} of {all}");
    // every side belongs to two triangles, or to the outline
    let mut count = HashMap::new();
    for t in squares.inside.iter().chain(&squares.rest) {
        for i in 0..3 {
            *count.entry((t[i], t[(i + 1) % 3])).or_insert(0) += 1;
        }
    }
    assert!(count.values().all(|n| *n == 1));
    let border = count.keys().filter(|(a, b)| !count.contains_key(&(*b, *a))).count();
    assert_eq!(border, points.len());
    squares
}

#[test]
fn every_point_is_covered_once_and_boxes_are_in_squares() {
    let disc = ring(DVec2::new(0.3, -0.2), 10.0, 200, 1.0);
    let hole = ring(DVec2::new(2.0, 1.0), 2.0, 50, -1.0);
    let island = ring(DVec2::new(2.1, 1.0), 1.0, 30, 1.0);
    let other = ring(DVec2::new(15.0, 0.0), 3.0, 40, 1.0);
    let loops = [disc, hole, island, other];
    let boxes = |at: [f64; 2], turn: f64, size: f64| -> Vec<DVec2> {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.5], [-1.0, 1.5]];
        let turn = DVec2::from_angle(turn);
        corners.iter().map(|c| DVec2::from(at) + turn.rotate(size * DVec2::from(*c))).collect()
    };
    let plain = laid(&loops, &[], 0.5);
    assert!(plain.inside.is_empty());
    let away = laid(&loops, &[boxes([40.0, 0.0], 0.3, 3.0)], 0.5);
    assert!(away.inside.is_empty());
    let convex = [boxes([0.0, 0.0], 0.3, 3.0), boxes([-4.0, 2.0], 1.3, 4.0), boxes([15.0, 0.0], 0.7, 1.0)];
    for step in [0.1, 0.37, 0.5, 1.0, 2.0, 7.0, 50.0] {
        let s = laid(&loops, &convex, step);
        assert!(s.step >= step);
        assert_eq!(s.inside.is_empty(), step > 10.0, "{step}");
    }
    // around the hole, and over everything: squares everywhere but along the outline
    let all = laid(&loops, &[boxes([0.0, 0.0], 0.1, 30.0)], 0.5);
    assert!(area(&all.points, &all.inside) > 0.7 * area(&all.points, &all.rest));
    // an outline along the sides of squares
    let square = boxes([0.5, 0.25], 0.0, 1.5);
    laid(std::slice::from_ref(&square), &[boxes([0.0, 0.0], 0.0, 1.0)], 0.25);
}

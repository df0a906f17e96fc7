//! An orange: dimpled peel, pith, eleven segments of pulp, seeds.
//!
//! Values (u8): air 0, pith about 75, pulp 105 to 150, membranes 170, peel 190 to 225, seeds 240. The stalk is at +z.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use super::Model;
use super::noise::{cells, hash, noise, unit};
use super::sdf::*;

/// Segments around the axis.
pub const SEGMENTS: usize = 11;

/// Radius of the fruit, thickness of the coloured peel and of the white pith, in millimetres.
const RADIUS: f32 = 38.0;
const PEEL: f32 = 1.7;
const PITH: f32 = 3.2;
/// Half thickness of the walls between segments.
const WALL: f32 = 0.42;
const CORE: f32 = 3.4;

const BODY: usize = 0;
const STALK: usize = 1;
const SEEDS: usize = 2;

pub struct Orange {
    shapes: Vec<Shape>,
}

impl Orange {
    pub fn new() -> Self {
        let body = Shape::new(12.0)
            .add(0.0, ellipsoid(Vec3::ZERO, v(RADIUS, RADIUS, RADIUS * 0.95)))
            .cut(9.0, ball(v(0.0, 0.0, RADIUS * 0.95 + 6.5), 8.0))
            .cut(5.0, ball(v(0.0, 0.0, -RADIUS * 0.95 - 3.4), 4.2));
        let top = RADIUS * 0.95 - 2.2;
        let mut stalk = Shape::new(3.0).add(0.0, cone(v(0.0, 0.0, top - 4.0), v(0.0, 0.0, top + 1.6), 1.6, 2.0));
        for i in 0..5 {
            let a = TAU * i as f32 / 5.0;
            stalk = stalk.add(1.5, cone(v(0.0, 0.0, top + 0.6), v(4.2 * a.cos(), 4.2 * a.sin(), top + 1.1), 1.5, 0.8));
        }
        let mut seeds = Shape::new(3.0);
        for i in 0..SEGMENTS {
            let h = hash(glam::IVec3::new(i as i32, 7, 3));
            // two segments in three carry a seed, close to the core
            if h.is_multiple_of(3) {
                continue;
            }
            let a = segment_middle(i) + 0.12 * (unit(h, 0) - 0.5);
            let z = 12.0 * (unit(h, 1) - 0.5);
            let at = |r: f32, z: f32| v(r * a.cos(), r * a.sin(), z);
            seeds = seeds.add(0.3, cone(at(7.6, z - 3.0), at(8.4, z + 2.8), 2.4, 1.2));
        }
        Self { shapes: vec![body, stalk, seeds] }
    }
}

/// The walls stand a little irregularly.
fn wall(i: usize) -> f32 {
    let i = i % SEGMENTS;
    let h = hash(glam::IVec3::new(i as i32, 1, 2));
    TAU * (i as f32 + 0.36 * (unit(h, 0) - 0.5)) / SEGMENTS as f32 - PI
}

fn segment_middle(i: usize) -> f32 {
    let (a, b) = (wall(i), wall(i + 1));
    0.5 * (a + if b < a { b + TAU } else { b })
}

/// The segment that holds `p`: distance in from its nearest wall, angle from its middle, and its number.
fn segment(p: Vec3) -> (f32, f32, usize) {
    let angle = p.y.atan2(p.x);
    let r = p.truncate().length();
    for i in 0..SEGMENTS {
        let (a, b) = (wall(i), wall(i + 1));
        let width = (b - a).rem_euclid(TAU);
        let t = (angle - a).rem_euclid(TAU);
        if t <= width {
            // chord distances to both walls; a wedge wider than a quarter turn does not occur
            return ((r * t.sin()).min(r * (width - t).sin()), t - 0.5 * width, i);
        }
    }
    // rounding at a wall
    (0.0, 0.0, 0)
}

impl Model for Orange {
    fn bounds(&self) -> [Vec3; 2] {
        let r = RADIUS + 2.5;
        [v(-r, -r, -r), v(r, r, r)]
    }

    fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    fn value(&self, p: Vec3, at: &Block, h: f32) -> f32 {
        let (wide, w) = (1.5 * h, h);
        let smooth = at.d(BODY, p);
        let stalk = at.d(STALK, p);
        if smooth >= wide + 0.4 && stalk >= w {
            return 0.0;
        }
        // pores: the peel dips at each oil gland, and swells slowly
        let mut body = smooth + 0.35 * noise(p * 0.09);
        let mut glands = 0.0;
        if smooth > -PEEL - 2.0 * w {
            let (near, _, _) = cells(p.normalize_or_zero() * (RADIUS / 2.3) + 100.0);
            body += 0.55 * step(0.55, 0.05, near);
            let (near, _, _) = cells(p * 0.62 + 31.0);
            glands = step(0.5, 0.2, near);
        }
        let depth = -body;
        let peel = mix(222.0, 178.0, glands);
        let pith = 74.0 + 14.0 * noise(p * 0.8) + 9.0 * noise(p * 1.9);
        let mut x = mix(peel, pith, step(PEEL - 0.6, PEEL + 0.6, depth));
        if depth > PEEL {
            x = self.flesh(p, depth, x, w);
            x = mix(x, 240.0, cover(at.d(SEEDS, p), w));
        }
        x = mix(0.0, x, cover(body, wide));
        mix(x, 150.0 + 20.0 * noise(p * 0.9), cover(stalk, w))
    }
}

impl Orange {
    /// Segments of pulp vesicles between membranes, around a spongy core.
    fn flesh(&self, p: Vec3, depth: f32, around: f32, w: f32) -> f32 {
        let r = p.truncate().length();
        let (side, turn, number) = segment(p);
        // rounded wedges: in from the pith, from the walls and from the core
        let inner = depth - (PEEL + PITH);
        let round = smin(smin(inner, side - WALL, 4.0), r - CORE, 3.0);
        let skin = smin(smin(inner + 0.6, side, 4.0), r - CORE + 0.6, 3.0);
        let mut x = mix(around, 172.0, step(-w, w, skin) * 0.9);
        if round > -w {
            // vesicles: cells drawn out towards the core, different in each segment
            let q = v(turn * 11.0, r * 0.17, p.z * 0.42) + number as f32 * 9.7;
            let (a, b, id) = cells(q + 0.25 * noise(p * 0.2));
            let juice = mix(112.0, 150.0, unit(id, 0));
            let sac = step(0.02, 0.22, b - a);
            let pulp = mix(88.0, juice, sac);
            x = mix(x, pulp, step(-w, w, round));
        }
        x
    }
}

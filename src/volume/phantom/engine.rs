//! An industrial CT of a two-cylinder engine block.
//!
//! Values (u8): air 0, aluminium 135, cast liners 190, steel 235. Millimetres of the model: the cylinders stand along z in a
//! row along x; intake is at -y, exhaust at +y.

use glam::Vec3;

use super::Model;
use super::noise::grain;
use super::sdf::*;

/// Where the cylinders' axes stand, and their bore and length.
pub const CYLINDERS: [f32; 2] = [-34.0, 34.0];
const BORE: f32 = 22.0;

/// Where the head bolts stand.
const BOLTS: (&[f32], &[f32]) = (&[-60.5, 0.0, 60.5], &[-29.0, 29.0]);

const CASTING: usize = 0;
const LINERS: usize = 1;
const STEEL: usize = 2;

const ALUMINIUM: f32 = 135.0;
const LINER: f32 = 192.0;
const HARD: f32 = 236.0;

pub struct Engine {
    shapes: Vec<Shape>,
}

impl Engine {
    pub fn new() -> Self {
        Self { shapes: vec![casting(), liners(), steel()] }
    }
}

fn casting() -> Shape {
    let mut s = Shape::new(4.0)
        // crankcase skirt, cylinder block, deck, head
        .add(0.0, cuboid(v(0.0, 0.0, -50.0), v(72.0, 42.0, 22.0), 7.0))
        .add(8.0, cuboid(v(0.0, 0.0, -4.0), v(66.5, 34.5, 44.0), 6.0))
        .add(5.0, cuboid(v(0.0, 0.0, 26.0), v(72.0, 40.0, 4.0), 2.5))
        .add(4.0, cuboid(v(0.0, 0.0, 46.0), v(69.0, 38.0, 19.0), 6.0))
        .add(4.0, cuboid(v(0.0, 0.0, -69.0), v(78.0, 48.0, 3.5), 2.5));
    // ribs on the sides of the block
    for i in 0..5 {
        let x = -52.0 + 26.0 * i as f32;
        s = s.add(3.0, cuboid(v(x, 0.0, -14.0), v(2.2, 38.5, 33.0), 2.0));
    }
    for x in [-56.0, 56.0] {
        s = s.add(4.0, cylinder(v(x, -47.0, 46.0), v(x, -30.0, 46.0), 9.0, 2.0));
    }
    // ports: intake flanges in front, exhaust behind
    for x in CYLINDERS {
        s = s
            .add(5.0, cylinder(v(x, -50.0, 44.0), v(x, -20.0, 44.0), 14.0, 2.0))
            .add(5.0, cylinder(v(x, 50.0, 40.0), v(x, 20.0, 40.0), 13.0, 2.0));
    }
    // end covers and the water pump's snout
    s = s
        .add(4.0, cylinder(v(-80.0, 0.0, -52.0), v(-60.0, 0.0, -52.0), 17.0, 3.0))
        .add(4.0, cylinder(v(60.0, 0.0, -52.0), v(80.0, 0.0, -52.0), 17.0, 3.0))
        .add(4.0, cylinder(v(-82.0, 0.0, 8.0), v(-60.0, 0.0, 8.0), 11.0, 2.5));
    // hollow: crank room, cylinders, combustion rooms, water jackets
    s = s.cut(3.0, cuboid(v(0.0, 0.0, -58.0), v(64.0, 33.0, 22.0), 6.0));
    for x in CYLINDERS {
        s = s
            .cut(1.0, cylinder(v(x, 0.0, -60.0), v(x, 0.0, 30.0), BORE, 0.0))
            .cut(2.0, ellipsoid(v(x, 0.0, 29.0), v(BORE, BORE, 12.0)));
        // valve seats and ports, bent upwards
        s = s
            .cut(1.5, cone(v(x, -10.0, 32.0), v(x, -15.0, 42.0), 8.5, 7.5))
            .cut(3.0, cone(v(x, -15.0, 42.0), v(x, -56.0, 44.0), 8.0, 9.5))
            .cut(1.5, cone(v(x, 10.0, 32.0), v(x, 15.0, 41.0), 7.5, 7.0))
            .cut(3.0, cone(v(x, 15.0, 41.0), v(x, 56.0, 40.0), 7.0, 8.5));
        // spark plug wells
        s = s
            .cut(1.5, cylinder(v(x, 0.0, 44.0), v(x, 0.0, 70.0), 7.0, 0.0))
            .cut(1.0, rod(v(x, 0.0, 30.0), v(x, 0.0, 50.0), 3.2));
    }
    // the jackets are rings around the bores, joined to each other and to the pump
    for x in CYLINDERS {
        s = s.cut(1.5, cylinder(v(x, 0.0, -24.0), v(x, 0.0, 19.0), 30.0, 3.0));
    }
    s = s.cut(2.0, rod(v(-90.0, 0.0, 8.0), v(-60.0, 0.0, 8.0), 6.0));
    for x in CYLINDERS {
        s = s
            .add(1.5, cylinder(v(x, 0.0, -36.0), v(x, 0.0, 24.0), 26.0, 0.0))
            .cut(0.5, cylinder(v(x, 0.0, -70.0), v(x, 0.0, 34.0), BORE, 0.0));
    }
    // water passages to the head, oil gallery, cam tunnel
    for (i, x) in [-60.0, -34.0, 0.0, 34.0, 60.0].into_iter().enumerate() {
        let y = if i % 2 == 0 { 22.0 } else { 28.5 };
        for y in [-y, y] {
            s = s.cut(1.0, rod(v(x, y, 12.0), v(x, y, 56.0), 2.6));
        }
    }
    s = s
        .cut(2.0, cuboid(v(0.0, 0.0, 57.0), v(60.0, 26.0, 3.0), 2.5))
        .cut(1.0, rod(v(-90.0, -36.5, -38.0), v(90.0, -36.5, -38.0), 3.2))
        .cut(1.0, rod(v(-90.0, 0.0, -52.0), v(90.0, 0.0, -52.0), 11.0));
    // bolt holes: deck, foot, flanges
    for &x in BOLTS.0 {
        for &y in BOLTS.1 {
            s = s
                .cut(0.8, rod(v(x, y, -16.0), v(x, y, 80.0), 3.1))
                .cut(0.8, cylinder(v(x, y, 61.0), v(x, y, 80.0), 6.0, 0.0));
        }
    }
    for x in [-70.0, -35.0, 0.0, 35.0, 70.0] {
        for y in [-42.5, 42.5] {
            s = s.cut(0.8, rod(v(x, y, -90.0), v(x, y, -60.0), 2.8));
        }
    }
    s
}

fn liners() -> Shape {
    let mut s = Shape::new(3.0);
    for x in CYLINDERS {
        s = s.add(0.0, cylinder(v(x, 0.0, -40.0), v(x, 0.0, 27.0), BORE + 0.5, 0.5));
    }
    for x in CYLINDERS {
        s = s.cut(0.3, cylinder(v(x, 0.0, -60.0), v(x, 0.0, 60.0), BORE - 2.6, 0.0));
        for y in [-1.0, 1.0] {
            // valve seats
            let (c, tilt) = (v(x, 10.0 * y, 32.5), turn(26.0 * y, 0.0, 0.0));
            s = s.add(0.2, torus(c, tilt, 8.2, 1.5));
        }
    }
    s
}

fn steel() -> Shape {
    let mut s = Shape::new(3.0);
    for (i, x) in CYLINDERS.into_iter().enumerate() {
        for y in [-1.0f32, 1.0] {
            // valves: head, stem, spring; one pair is open
            let axis = v(0.0, 0.44 * y, 0.9).normalize();
            let lift = if (i == 0) == (y < 0.0) { 5.0 } else { 0.0 };
            let seat = v(x, 9.6 * y, 31.0) - axis * lift;
            s = s
                .add(0.5, cylinder(seat - axis * 0.8, seat + axis * 1.2, 8.0, 0.6))
                .add(4.0, cone(seat + axis, seat + axis * 9.0, 4.2, 1.7))
                .add(1.0, rod(seat, seat + axis * 46.0, 1.7))
                .add(0.5, cylinder(seat + axis * 42.5, seat + axis * 45.0, 6.2, 0.6));
            for turn_at in 0..4 {
                let c = seat + axis * (29.0 + 4.0 * turn_at as f32 - 0.5 * lift);
                s = s.add(0.3, torus(c, turn(-26.0 * y, 0.0, 0.0), 5.0, 0.95));
            }
        }
    }
    // head bolts, and the crankshaft's bearings
    for &x in BOLTS.0 {
        for &y in BOLTS.1 {
            s = s
                .add(0.5, rod(v(x, y, -12.0), v(x, y, 62.0), 2.3))
                .add(0.5, cylinder(v(x, y, 61.0), v(x, y, 66.5), 5.0, 0.8));
        }
    }
    for x in [-72.0, 72.0] {
        s = s
            .add(0.3, cylinder(v(x - 4.0, 0.0, -52.0), v(x + 4.0, 0.0, -52.0), 12.5, 0.6))
            .cut(0.3, cylinder(v(x - 12.0, 0.0, -52.0), v(x + 12.0, 0.0, -52.0), 9.0, 0.0));
    }
    s
}

impl Model for Engine {
    fn bounds(&self) -> [Vec3; 2] {
        [v(-88.0, -56.0, -78.0), v(88.0, 56.0, 84.0)]
    }

    fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    fn value(&self, p: Vec3, at: &Block, h: f32) -> f32 {
        let w = 1.2 * h;
        let mut x = cover(at.d(CASTING, p), w);
        if x > 0.0 {
            x *= ALUMINIUM + 5.0 * grain(p * 0.35);
        }
        for (id, value) in [(LINERS, LINER), (STEEL, HARD)] {
            let d = at.d(id, p);
            if d < w {
                x = mix(x, value, cover(d, w));
            }
        }
        x
    }
}

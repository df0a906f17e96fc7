//! A CT of a chest with contrast in the blood, in Hounsfield units.
//!
//! Millimetres of the model: x to the left, y to the back, z up; the heart's apex points to the left.

use glam::Vec3;

use super::Model;
use super::noise::{grain, hash, noise, unit};
use super::sdf::*;

const SKIN: usize = 0;
const BONES: usize = 1;
const CARTILAGE: usize = 2;
const LUNGS: usize = 3;
const AIRWAYS: usize = 4;
const VESSELS: usize = 5;
const HEART: usize = 6;
const CHAMBERS: usize = 7;
const AORTA: usize = 8;
const LIVER: usize = 9;
const KIDNEYS: usize = 10;
const SPLEEN: usize = 11;
const BELLY: usize = 12;
const GAS: usize = 13;
const WINDPIPE: usize = 14;

const AIR: f32 = -1000.0;

pub struct Torso {
    shapes: Vec<Shape>,
}

impl Torso {
    pub fn new() -> Self {
        let (bones, cartilage) = bones();
        let (airways, vessels) = trees();
        let heart = || turned_ellipsoid(v(20.0, -34.0, 8.0), v(43.0, 40.0, 58.0), turn(-18.0, 34.0, 0.0));
        let lungs = Shape::new(4.0)
            .pair(0.0, ellipsoid(v(60.0, 4.0, 48.0), v(53.0, 72.0, 128.0)))
            .keep(6.0, ellipsoid(v(0.0, 0.0, 30.0), v(118.0, 77.0, 190.0)))
            .cut(6.0, turned_ellipsoid(v(20.0, -34.0, 8.0), v(46.0, 43.0, 61.0), turn(-18.0, 34.0, 0.0)))
            .cut(8.0, ellipsoid(v(-58.0, 4.0, -92.0), v(84.0, 94.0, 88.0)))
            .cut(8.0, ellipsoid(v(62.0, 4.0, -102.0), v(84.0, 94.0, 88.0)))
            .cut(8.0, rod(v(0.0, 40.0, 240.0), v(0.0, 52.0, -200.0), 27.0))
            .cut(8.0, rod(v(0.0, 0.0, 220.0), v(0.0, 4.0, 60.0), 17.0))
            // fissures between the lobes
            .cut(1.0, turned_cuboid(v(60.0, 4.0, 48.0), v(60.0, 100.0, 0.5), 0.4, turn(38.0, 0.0, 0.0)))
            .cut(1.0, turned_cuboid(v(-60.0, 4.0, 48.0), v(60.0, 100.0, 0.5), 0.4, turn(38.0, 0.0, 0.0)));
        let chambers = Shape::new(3.0)
            .add(0.0, turned_ellipsoid(v(34.0, -30.0, -4.0), v(15.0, 15.0, 36.0), turn(-18.0, 34.0, 0.0)))
            .add(0.3, turned_ellipsoid(v(6.0, -52.0, 0.0), v(24.0, 12.0, 36.0), turn(-18.0, 34.0, 0.0)))
            .add(0.3, ellipsoid(v(10.0, -10.0, 38.0), v(24.0, 15.0, 17.0)))
            .add(0.3, ellipsoid(v(-17.0, -34.0, 24.0), v(15.0, 17.0, 24.0)));
        let aorta = Shape::new(3.0)
            .chain(
                2.0,
                false,
                &[
                    (v(10.0, -28.0, 36.0), 13.0),
                    (v(-6.0, -30.0, 70.0), 14.5),
                    (v(-4.0, -18.0, 100.0), 14.5),
                    (v(6.0, 8.0, 113.0), 14.0),
                    (v(16.0, 30.0, 100.0), 13.0),
                    (v(18.0, 36.0, 70.0), 12.5),
                    (v(13.0, 32.0, -40.0), 11.5),
                    (v(6.0, 22.0, -205.0), 9.5),
                ],
            )
            // to the neck and the arms, and the lungs' trunk
            .chain(
                1.5,
                false,
                &[(v(-4.0, -14.0, 104.0), 6.5), (v(-16.0, -14.0, 140.0), 6.0), (v(-26.0, -6.0, 215.0), 4.0)],
            )
            .chain(1.5, false, &[(v(4.0, 2.0, 112.0), 5.0), (v(14.0, -4.0, 150.0), 4.5), (v(26.0, -6.0, 215.0), 4.0)])
            .chain(
                1.5,
                false,
                &[
                    (v(12.0, 14.0, 110.0), 5.5),
                    (v(26.0, 12.0, 150.0), 5.0),
                    (v(100.0, 0.0, 152.0), 4.0),
                    (v(160.0, 4.0, 110.0), 3.5),
                ],
            )
            .chain(
                1.5,
                false,
                &[
                    (v(-16.0, -14.0, 142.0), 5.0),
                    (v(-34.0, 0.0, 156.0), 5.0),
                    (v(-100.0, 0.0, 152.0), 4.0),
                    (v(-160.0, 4.0, 110.0), 3.5),
                ],
            )
            .chain(
                2.0,
                false,
                &[(v(12.0, -48.0, 42.0), 12.0), (v(16.0, -32.0, 72.0), 11.0), (v(12.0, -6.0, 82.0), 10.0)],
            )
            .chain(2.0, false, &[(v(-40.0, 10.0, 66.0), 7.0), (v(10.0, -4.0, 80.0), 9.0), (v(44.0, 14.0, 70.0), 7.0)])
            // caval veins
            .chain(2.0, false, &[(v(-24.0, -26.0, 40.0), 8.5), (v(-26.0, -22.0, 120.0), 8.5)])
            .chain(
                2.0,
                false,
                &[(v(-18.0, -12.0, 0.0), 9.0), (v(-18.0, 8.0, -60.0), 9.5), (v(-16.0, 22.0, -205.0), 10.0)],
            );
        let mut shapes = vec![
            skin(),
            bones,
            cartilage,
            lungs,
            airways,
            vessels,
            Shape::new(3.0).add(0.0, heart()).add(12.0, ellipsoid(v(0.0, -14.0, 42.0), v(28.0, 20.0, 18.0))),
            chambers,
            cut(aorta, 3.0),
            Shape::new(3.0)
                .add(0.0, ellipsoid(v(-56.0, -4.0, -92.0), v(72.0, 70.0, 58.0)))
                .add(24.0, ellipsoid(v(8.0, -34.0, -76.0), v(56.0, 38.0, 28.0)))
                .keep(6.0, ellipsoid(v(-58.0, 4.0, -92.0), v(80.0, 90.0, 84.0)))
                .cut(14.0, ellipsoid(v(-30.0, 14.0, -150.0), v(60.0, 40.0, 40.0))),
            Shape::new(3.0)
                .pair(0.0, turned_ellipsoid(v(62.0, 38.0, -150.0), v(21.0, 18.0, 44.0), turn(0.0, 12.0, 0.0)))
                .cut_pair(6.0, ellipsoid(v(40.0, 30.0, -150.0), v(12.0, 8.0, 12.0))),
            Shape::new(3.0)
                .add(0.0, turned_ellipsoid(v(92.0, 30.0, -82.0), v(22.0, 40.0, 34.0), turn(20.0, 0.0, 20.0))),
            Shape::new(3.0)
                .add(0.0, ellipsoid(v(0.0, -14.0, -150.0), v(108.0, 62.0, 78.0)))
                .add(10.0, ellipsoid(v(0.0, 0.0, -96.0), v(112.0, 76.0, 66.0))),
            Shape::new(3.0).add(0.0, ellipsoid(v(52.0, -42.0, -84.0), v(20.0, 14.0, 17.0))).chain(
                2.0,
                false,
                &[
                    (v(86.0, -30.0, -130.0), 9.0),
                    (v(40.0, -48.0, -142.0), 10.0),
                    (v(-20.0, -50.0, -150.0), 9.0),
                    (v(-80.0, -34.0, -140.0), 11.0),
                ],
            ),
        ];
        shapes.push(windpipe());
        Self { shapes }
    }
}

/// Neck and waist end in clean cuts.
fn cut(s: Shape, k: f32) -> Shape {
    s.keep(k, half(v(0.0, 0.0, 206.0), v(0.0, -0.25, 1.0))).keep(k, half(v(0.0, 0.0, -192.0), v(0.0, 0.0, -1.0)))
}

fn skin() -> Shape {
    let mut s = Shape::new(16.0)
        .add(0.0, ellipsoid(v(0.0, 0.0, 30.0), v(140.0, 98.0, 210.0)))
        .add(50.0, ellipsoid(v(0.0, -2.0, -150.0), v(120.0, 82.0, 120.0)))
        // neck, trapezius, shoulders, arms
        .add(40.0, cone(v(0.0, 12.0, 130.0), v(0.0, -6.0, 240.0), 58.0, 54.0))
        .pair(34.0, cone(v(26.0, 26.0, 186.0), v(120.0, 18.0, 146.0), 22.0, 24.0))
        .pair(36.0, cone(v(96.0, 10.0, 128.0), v(158.0, 6.0, 128.0), 38.0, 42.0))
        .pair(26.0, cone(v(164.0, 6.0, 122.0), v(180.0, 6.0, 44.0), 41.0, 37.0))
        .pair(30.0, ellipsoid(v(96.0, 34.0, 40.0), v(42.0, 56.0, 100.0)))
        .pair(24.0, cone(v(32.0, 62.0, -230.0), v(34.0, 66.0, 60.0), 36.0, 30.0))
        .pair(30.0, ellipsoid(v(74.0, 40.0, 104.0), v(58.0, 52.0, 64.0)))
        .pair(28.0, turned_ellipsoid(v(62.0, -76.0, 92.0), v(60.0, 22.0, 44.0), turn(-8.0, 0.0, 20.0)))
        .pair(22.0, cone(v(16.0, -72.0, 161.0), v(56.0, -70.0, 169.0), 9.0, 8.0))
        .pair(24.0, cone(v(56.0, -70.0, 169.0), v(128.0, -16.0, 166.0), 8.0, 9.0));
    // muscles of the belly
    for (i, z) in [4.0, -40.0, -84.0, -132.0].into_iter().enumerate() {
        let y = [-88.0, -84.0, -76.0, -68.0][i];
        s = s.pair(12.0, ellipsoid(v(27.0, y, z), v(25.0, 16.0, 24.0)));
    }
    let s = s
        .cut(20.0, rod(v(0.0, -119.0, 130.0), v(0.0, -118.0, 30.0), 6.0))
        .cut(16.0, rod(v(0.0, -110.0, 20.0), v(0.0, -94.0, -170.0), 4.0))
        .cut(8.0, ball(v(0.0, -88.0, -140.0), 5.0))
        .cut(30.0, rod(v(0.0, 130.0, 150.0), v(0.0, 122.0, -160.0), 10.0))
        .cut(14.0, ball(v(0.0, -84.0, 176.0), 9.0));
    cut(s, 4.0)
}

/// The middle of the vertebral body at height `z`.
fn spine_at(z: f32) -> Vec3 {
    let t = (z + 190.0) / 390.0;
    v(0.0, 40.0 + 20.0 * (std::f32::consts::PI * t).sin() - 14.0 * t, z)
}

/// Points and radii along a rod.
type Course = Vec<(Vec3, f32)>;

/// Points of rib `i` (0 to 11) on the left, from the spine to its front end; and from there to the breastbone.
fn rib(i: usize) -> (Course, Course) {
    const WIDTH: [f32; 12] = [56.0, 80.0, 97.0, 109.0, 117.0, 123.0, 126.0, 127.0, 125.0, 119.0, 108.0, 96.0];
    const DEPTH: [f32; 12] = [46.0, 60.0, 69.0, 75.0, 79.0, 82.0, 83.0, 83.0, 81.0, 77.0, 72.0, 68.0];
    const DROP: [f32; 12] = [26.0, 42.0, 52.0, 60.0, 66.0, 72.0, 76.0, 76.0, 72.0, 60.0, 40.0, 26.0];
    const END: [f32; 12] = [0.86, 0.86, 0.86, 0.85, 0.84, 0.82, 0.80, 0.75, 0.70, 0.64, 0.46, 0.34];
    let z = 172.0 - 24.6 * i as f32;
    let root = spine_at(z);
    let point = |t: f32| {
        let a = t * std::f32::consts::PI;
        // behind, the arch begins at the spine and swings back before it turns forward
        let x = 20.0 * (1.0 - t) * step(0.25, 0.0, t) + WIDTH[i] * a.sin();
        let back = root.y + 6.0;
        let y = mix(back, -1.0 + DEPTH[i] * a.cos() * 1.02, step(0.0, 0.3, t));
        v(x, y, z - DROP[i] * t.powf(1.25) - 4.0 * step(0.0, 0.2, t))
    };
    let n = 11;
    let bone: Vec<_> = (0..=n)
        .map(|k| {
            let t = END[i] * k as f32 / n as f32;
            (point(t), mix(4.6, 5.2, k as f32 / n as f32))
        })
        .collect();
    let tip = bone[n].0;
    let mut front = Vec::new();
    if i < 10 {
        // the false ribs join the seventh
        let z = [128.0f32, 108.0, 88.0, 68.0, 50.0, 34.0, 22.0, 8.0, -6.0, -20.0][i];
        let join = v(
            [13.0, 13.0, 13.0, 13.0, 13.0, 12.0, 11.0, 24.0, 40.0, 56.0][i],
            -82.0 + 0.08 * (z - 60.0).abs() + [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 4.0, 8.0][i],
            z,
        );
        front = vec![(tip, 5.2), (0.5 * (tip + join) + v(0.0, -4.0, -5.0), 4.8), (join, 4.6)];
    }
    (bone, front)
}

fn bones() -> (Shape, Shape) {
    let mut s = Shape::new(9.0)
        // breastbone
        .add(0.0, turned_cuboid(v(0.0, -76.0, 140.0), v(21.0, 5.0, 22.0), 4.5, turn(-12.0, 0.0, 0.0)))
        .add(5.0, cuboid(v(0.0, -82.0, 70.0), v(13.0, 4.6, 50.0), 4.4))
        .add(4.0, cone(v(0.0, -82.0, 22.0), v(0.0, -80.0, 6.0), 5.0, 2.5));
    let mut cartilage = Shape::new(3.0);
    for i in 0..16 {
        let z = 186.0 - 24.6 * i as f32;
        let c = spine_at(z);
        let big = 1.0 + 0.25 * i as f32 / 15.0;
        s = s
            .add(1.5, cylinder(c - v(0.0, 0.0, 9.6), c + v(0.0, 0.0, 9.6), 15.5 * big, 3.5))
            .pair(3.0, cone(c + v(10.0, 14.0, 4.0), c + v(13.0, 26.0, 2.0), 5.0, 5.0))
            .pair(3.0, cone(c + v(13.0, 25.0, 2.0), c + v(31.0, 32.0, 4.0), 4.6, 4.0))
            .pair(3.0, cone(c + v(12.0, 26.0, 10.0), c + v(11.0, 27.0, -12.0), 4.5, 4.5))
            .pair(3.0, cone(c + v(12.0, 27.0, 0.0), c + v(1.0, 34.0, -5.0), 4.2, 4.2))
            .pair(3.0, cone(c + v(0.5, 34.0, -5.0), c + v(0.5, 47.0, -18.0), 4.0, 3.4));
    }
    for i in 0..12 {
        let (bone, front) = rib(i);
        s = s.chain(1.2, true, &bone);
        if !front.is_empty() {
            cartilage = cartilage.chain(1.2, true, &front);
        }
    }
    s = s
        // collar bones
        .chain(
            2.0,
            true,
            &[
                (v(15.0, -80.0, 157.0), 7.5),
                (v(46.0, -80.0, 166.0), 6.0),
                (v(92.0, -44.0, 173.0), 6.0),
                (v(138.0, -8.0, 168.0), 7.0),
            ],
        )
        // shoulder blades
        .pair(3.0, turned_ellipsoid(v(86.0, 72.0, 96.0), v(34.0, 4.2, 58.0), turn(10.0, 16.0, -24.0)))
        .chain(
            3.0,
            true,
            &[
                (v(60.0, 80.0, 118.0), 4.0),
                (v(110.0, 66.0, 142.0), 6.0),
                (v(146.0, 26.0, 168.0), 6.5),
                (v(142.0, 2.0, 168.0), 6.0),
            ],
        )
        .pair(4.0, cone(v(112.0, 58.0, 124.0), v(132.0, 22.0, 132.0), 8.0, 13.0))
        .pair(2.0, cone(v(126.0, 16.0, 148.0), v(122.0, -16.0, 146.0), 6.0, 5.0))
        // upper arms
        .pair(1.0, ball(v(156.0, 8.0, 132.0), 23.0))
        .pair(8.0, cone(v(164.0, 8.0, 120.0), v(178.0, 6.0, 32.0), 15.0, 12.5));
    // canal
    for i in 0..8 {
        let (a, b) = (186.0 - 49.2 * i as f32 + 25.0, 186.0 - 49.2 * (i + 1) as f32 + 25.0);
        s = s.cut(1.5, rod(spine_at(a) + v(0.0, 24.0, 0.0), spine_at(b) + v(0.0, 24.0, 0.0), 8.5));
    }
    (cut(s, 1.0), cartilage)
}

/// Bronchi and vessels: trees that branch until they are thin.
fn trees() -> (Shape, Shape) {
    let mut air = Shape::new(3.0);
    let mut blood = Shape::new(3.0);
    for side in [1.0f32, -1.0] {
        let hilum = v(side * HILUM.x, HILUM.y, HILUM.z);
        let seeds =
            [(v(side * 0.45, -0.25, 0.85), 5.0), (v(side * 0.7, -0.6, -0.15), 4.6), (v(side * 0.5, 0.35, -0.8), 5.4)];
        for (n, (dir, r)) in seeds.into_iter().enumerate() {
            grow(
                &mut air,
                &mut blood,
                hilum,
                dir.normalize(),
                r,
                5,
                (n as i32 + 1) * if side > 0.0 { 101 } else { 211 },
            );
        }
    }
    (air, blood)
}

/// Where the main bronchus enters the left lung.
const HILUM: Vec3 = Vec3::new(42.0, 16.0, 62.0);

fn windpipe() -> Shape {
    let fork = v(0.0, 14.0, 92.0);
    let s = Shape::new(3.0).add(0.0, cone(v(0.0, 4.0, 240.0), fork, 9.5, 9.0)).pair(2.0, cone(fork, HILUM, 7.8, 6.0));
    cut(s, 1.0)
}

fn grow(air: &mut Shape, blood: &mut Shape, from: Vec3, dir: Vec3, r: f32, left: usize, seed: i32) {
    let h = hash(glam::IVec3::new(seed, left as i32, 5));
    let length = r * (6.4 + 2.4 * unit(h, 0)) + 3.0;
    let to = from + dir * length;
    let beside = v(3.0, -4.5, 3.0) * (0.35 + 0.12 * r);
    *air = std::mem::replace(air, Shape::new(3.0)).add(1.0, cone(from, to, r * 0.9, r * 0.72));
    *blood = std::mem::replace(blood, Shape::new(3.0)).add(1.0, cone(from + beside, to + beside, r * 0.95, r * 0.75));
    if left == 0 {
        return;
    }
    let across = dir.any_orthonormal_vector();
    let spin = std::f32::consts::TAU * unit(h, 1);
    let across = across * spin.cos() + dir.cross(across) * spin.sin();
    for (k, s) in [0.62f32, -0.72].into_iter().enumerate() {
        let bend = s * (0.8 + 0.4 * unit(h, 2));
        grow(air, blood, to, (dir + across * bend).normalize(), r * 0.76, left - 1, seed * 2 + k as i32 + 7);
    }
}

impl Model for Torso {
    fn bounds(&self) -> [Vec3; 2] {
        [v(-228.0, -122.0, -202.0), v(228.0, 122.0, 222.0)]
    }

    fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    fn value(&self, p: Vec3, at: &Block, h: f32) -> f32 {
        let (wide, w) = (1.5 * h, h);
        let skin = at.d(SKIN, p);
        if skin >= wide {
            return AIR;
        }
        let mut x = mix(35.0, -95.0, step(1.6, 2.6 + w, -skin));
        let inner = step(6.0, 8.0 + w, -skin);
        if inner > 0.0 {
            x = mix(x, 56.0 + 9.0 * noise(p * v(0.12, 0.2, 0.05)), inner);
            x = mix(x, -100.0 + 12.0 * grain(p * 0.09), cover(at.d(BELLY, p), w));
            for (id, value) in [(LIVER, 108.0), (SPLEEN, 116.0), (KIDNEYS, 165.0), (HEART, 92.0)] {
                let d = at.d(id, p);
                if d < w {
                    x = mix(x, value + 5.0 * grain(p * 0.2), cover(d, w));
                }
            }
            let lung = at.d(LUNGS, p);
            if lung < w {
                let tissue = -860.0 + 25.0 * noise(p * 0.11) + 45.0 * noise(p * 0.5).max(0.0);
                let vessel = cover(at.d(VESSELS, p), w);
                x = mix(x, mix(tissue, 150.0, vessel), cover(lung, w));
            }
            x = mix(x, 210.0, cover(at.d(CHAMBERS, p), w));
            x = mix(x, 230.0, cover(at.d(AORTA, p), w));
            // branches stay in the lungs
            let airway = at.d(AIRWAYS, p).max(lung + 2.5).min(at.d(WINDPIPE, p));
            x = mix(x, 20.0, cover(airway - 1.3, w));
            x = mix(x, AIR, cover(airway, w));
            x = mix(x, -900.0, cover(at.d(GAS, p), w));
        }
        let cartilage = at.d(CARTILAGE, p);
        if cartilage < w {
            x = mix(x, 150.0, cover(cartilage, w));
        }
        let bone = at.d(BONES, p);
        if bone < wide {
            let core = step(1.6 - 0.5 * w, 1.6 + w, -bone);
            let spongy = 330.0 + 110.0 * grain(p * 0.45);
            x = mix(x, mix(1050.0, spongy, core), cover(bone, wide));
        }
        mix(AIR, x, cover(skin, wide))
    }
}

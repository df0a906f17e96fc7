//! A CT of a human head and neck, in Hounsfield units.
//!
//! Millimetres of the model: x to the left, y to the back, z up; the middle between the eyes lies near (0, -90, 0), the ear
//! canals near (+-70, 4, -16). The skin, the bones and the teeth are symmetric about x = 0, the brain's folds are not.

use glam::{Mat3, Vec3};

use super::Model;
use super::noise::{grain, noise};
use super::sdf::*;

const SKIN: usize = 0;
const SKULL: usize = 1;
const JAW: usize = 2;
const SPINE: usize = 3;
const TEETH: usize = 4;
const PULP: usize = 5;
const AIR: usize = 6;
const MUSCLE: usize = 7;
const CAVITY: usize = 8;
const CEREBRUM: usize = 9;
const CEREBELLUM: usize = 10;
const STEM: usize = 11;
const VENTRICLES: usize = 12;
const NUCLEI: usize = 13;
const EYES: usize = 14;
const LENSES: usize = 15;
const NERVES: usize = 16;
const CARTILAGE: usize = 17;
const OPENINGS: usize = 18;

/// Hounsfield units of the materials.
pub mod hu {
    pub const AIR: f32 = -1000.0;
    pub const FAT: f32 = -85.0;
    pub const SKIN: f32 = 35.0;
    pub const MUSCLE: f32 = 58.0;
    pub const FLUID: f32 = 6.0;
    pub const WHITE: f32 = 27.0;
    pub const GREY: f32 = 40.0;
    pub const LENS: f32 = 95.0;
    pub const CARTILAGE: f32 = 130.0;
    pub const SPONGY: f32 = 420.0;
    pub const CORTICAL: f32 = 1250.0;
    pub const DENTINE: f32 = 1750.0;
    pub const ENAMEL: f32 = 2600.0;
}

pub struct Head {
    shapes: Vec<Shape>,
}

impl Head {
    pub fn new() -> Self {
        let (teeth, pulp) = teeth();
        let shapes = vec![
            skin(),
            skull(),
            jaw(),
            spine(),
            teeth,
            pulp,
            air(),
            muscle(),
            cavity(0.0, Shape::new(6.0)),
            cerebrum(),
            cerebellum(),
            stem(),
            ventricles(),
            nuclei(),
            Shape::new(3.0).pair(0.0, ball(EYE, 12.0)).pair(3.0, ball(EYE + v(0.0, -6.0, 0.0), 7.2)),
            Shape::new(3.0).pair(0.0, ellipsoid(EYE + v(0.0, -8.5, 0.0), v(4.6, 2.3, 4.6))),
            nerves(),
            cartilage(),
            openings(),
        ];
        Self { shapes }
    }
}

const EYE: Vec3 = Vec3::new(31.5, -78.0, 0.0);

/// The neck ends in a clean cut.
fn cut_neck(shape: Shape, inset: f32) -> Shape {
    shape.keep(2.0, half(v(0.0, 0.0, -166.0 + inset), v(0.0, 0.0, -1.0)))
}

fn skin() -> Shape {
    let s = Shape::new(16.0)
        // cranium, forehead, face
        .add(0.0, ellipsoid(v(0.0, 8.0, 42.0), v(75.0, 90.0, 75.0)))
        .add(25.0, ellipsoid(v(0.0, -38.0, 36.0), v(57.0, 57.5, 60.0)))
        .add(20.0, ellipsoid(v(0.0, -40.0, -28.0), v(57.0, 54.0, 62.0)))
        // neck: column, throat, nape, shoulders' beginning
        .pair(18.0, ellipsoid(v(38.0, 2.0, -18.0), v(33.0, 52.0, 40.0)))
        .pair(14.0, cone(v(51.0, -54.0, -22.0), v(59.0, -6.0, -18.0), 12.0, 12.0))
        .add(18.0, ellipsoid(v(0.0, 42.0, -12.0), v(54.0, 49.0, 40.0)))
        .add(24.0, cone(v(0.0, 30.0, -40.0), v(0.0, 36.0, -180.0), 49.0, 50.0))
        .add(16.0, cone(v(0.0, -10.0, -112.0), v(0.0, -8.0, -180.0), 17.0, 22.0))
        .pair(24.0, cone(v(24.0, 54.0, -60.0), v(50.0, 54.0, -196.0), 18.0, 36.0))
        .pair(10.0, cone(v(55.0, 20.0, -44.0), v(15.0, -16.0, -172.0), 11.0, 9.0))
        .add(9.0, ellipsoid(v(0.0, -28.0, -128.0), v(8.0, 7.0, 12.0)))
        // jaw, chin, floor of the mouth, cheeks
        .pair(16.0, cone(v(53.0, -10.0, -46.0), v(47.0, -26.0, -76.0), 15.0, 14.0))
        .pair(14.0, cone(v(47.0, -26.0, -76.0), v(17.0, -82.0, -98.0), 14.0, 13.0))
        .add(14.0, ellipsoid(v(0.0, -86.0, -100.0), v(19.0, 16.0, 14.0)))
        .add(14.0, ellipsoid(v(0.0, -46.0, -88.0), v(40.0, 44.0, 20.0)))
        .pair(18.0, turned_ellipsoid(v(43.0, -65.0, -20.0), v(18.0, 18.0, 13.0), turn(0.0, 0.0, 35.0)))
        .pair(20.0, ellipsoid(v(35.0, -60.0, -50.0), v(25.0, 30.0, 29.0)))
        .add(12.0, ellipsoid(v(0.0, -77.0, -66.0), v(28.0, 25.5, 23.0)))
        .pair(16.0, ellipsoid(v(42.0, -50.0, 12.0), v(23.0, 28.0, 26.0)))
        // brows, sockets, lids
        .pair(12.0, cone(v(9.0, -91.5, 18.5), v(28.0, -91.5, 21.0), 6.5, 6.0))
        .pair(16.0, cone(v(28.0, -91.5, 21.0), v(51.0, -66.0, 10.0), 6.0, 5.0))
        .cut_pair(14.0, turned_ellipsoid(v(31.0, -101.0, 2.0), v(19.0, 14.0, 10.5), turn(0.0, 0.0, 18.0)))
        .pair(6.0, ellipsoid(EYE, v(15.0, 14.6, 13.2)))
        // nose
        .add(9.0, cone(v(0.0, -90.0, 12.0), v(0.0, -99.0, -8.0), 6.0, 6.2))
        .add(7.0, cone(v(0.0, -99.0, -8.0), v(0.0, -111.5, -34.0), 6.2, 9.2))
        .pair(10.0, cone(v(4.5, -92.0, -6.0), v(9.0, -97.0, -34.0), 5.0, 6.5))
        .pair(8.0, turned_ellipsoid(v(10.5, -103.0, -38.5), v(6.2, 9.5, 7.2), turn(-15.0, 0.0, -12.0)))
        .add(5.0, cone(v(0.0, -111.0, -38.5), v(0.0, -100.0, -45.0), 4.4, 4.0))
        .cut_pair(2.5, turned_ellipsoid(v(6.6, -108.0, -47.5), v(3.2, 6.5, 5.0), turn(0.0, 0.0, -18.0)))
        // lips
        .pair(5.0, cone(v(4.0, -101.5, -62.5), v(14.0, -98.5, -64.0), 4.6, 4.2))
        .pair(4.0, cone(v(14.0, -98.5, -64.0), v(25.0, -89.5, -68.0), 4.2, 2.5))
        .pair(5.0, cone(v(0.0, -99.0, -73.5), v(12.0, -96.8, -72.6), 5.4, 4.9))
        .pair(4.0, cone(v(12.0, -96.8, -72.6), v(24.0, -89.5, -68.4), 4.9, 2.5))
        .cut_pair(2.0, cone(v(0.0, -107.0, -68.0), v(13.0, -103.0, -67.6), 1.1, 1.0))
        .cut_pair(2.0, cone(v(13.0, -103.0, -67.6), v(27.5, -91.0, -67.8), 1.0, 0.9))
        .cut(5.0, cone(v(0.0, -108.5, -51.0), v(0.0, -108.0, -59.0), 2.0, 2.4))
        .cut_pair(9.0, cone(v(0.0, -106.0, -84.5), v(15.0, -101.0, -83.5), 4.5, 4.0))
        // a crease between the closed lids
        .cut_pair(1.6, torus(EYE + v(0.0, -0.4, 6.0), turn(30.0, 0.0, 0.0), 15.0, 0.9));
    cut_neck(ears(s), 0.0)
}

/// Ears: a shell with helix, antihelix, concha, tragus and lobe.
fn ears(mut s: Shape) -> Shape {
    let frame = turn(-10.0, 0.0, -24.0);
    // in the plane of the ear: `b` to the back, `u` up, `o` outwards
    let at = |o: f32, b: f32, u: f32| v(72.5, 6.0, -14.0) + frame * v(o, b, u);
    s = s.pair(5.0, turned_ellipsoid(at(1.5, 9.0, 3.0), v(3.6, 17.0, 27.0), frame));
    s = s.pair(4.0, turned_ellipsoid(at(1.0, 3.0, -25.0), v(3.6, 8.0, 9.5), frame));
    s = s.cut_pair(3.0, turned_ellipsoid(at(6.5, 6.5, -2.0), v(6.0, 8.5, 13.0), frame));
    let helix: Vec<(Vec3, f32)> = (0..=14)
        .map(|i| {
            let a = (205.0f32 - 260.0 * i as f32 / 14.0).to_radians();
            // from the crus in front, over the top, down the back to the lobe
            let (b, u) = (9.0 + 16.0 * a.cos(), 5.0 + 26.0 * a.sin());
            (at(3.8, b, u), 2.9)
        })
        .collect();
    s = s.chain(1.0, true, &helix);
    let antihelix: Vec<(Vec3, f32)> = (0..=5)
        .map(|i| {
            let a = (100.0f32 - 170.0 * i as f32 / 5.0).to_radians();
            (at(3.0, 6.0 + 10.0 * a.cos(), 1.0 + 15.0 * a.sin()), 2.2)
        })
        .collect();
    s = s.chain(1.2, true, &antihelix);
    s.pair(3.0, ball(at(2.5, -4.5, -6.0), 3.8)).pair(2.5, ball(at(3.0, 4.5, -16.0), 3.2))
}

/// The inside of the braincase, grown by `g`.
fn cavity(g: f32, s: Shape) -> Shape {
    s.add(0.0, ellipsoid(v(0.0, 8.0, 42.0), v(62.5, 78.0, 63.0) + g))
        .add(20.0, ellipsoid(v(0.0, -36.0, 36.0), v(46.0, 46.5, 46.0) + g))
        .pair(14.0, ellipsoid(v(40.0, -12.0, -2.0), v(20.0, 30.0, 19.0) + g))
        .add(12.0, ellipsoid(v(0.0, 40.0, -8.0), v(45.0, 35.0, 22.0) + g))
}

fn skull() -> Shape {
    let mut s = cavity(6.5, Shape::new(9.0))
        // base: clivus, petrous bones, mastoids, condyles
        .add(8.0, cone(v(0.0, -28.0, -12.0), v(0.0, 14.0, -30.0), 13.0, 9.0))
        .pair(6.0, cone(v(54.0, 16.0, -20.0), v(53.0, 17.0, -46.0), 12.0, 6.0))
        .pair(5.0, cone(v(16.0, 22.0, -34.0), v(14.0, 28.0, -42.0), 7.0, 6.0));
    s = cavity_cut(s)
        .pair(6.0, cone(v(54.0, 8.0, -16.0), v(14.0, -6.0, -18.0), 10.0, 6.0))
        .pair(5.0, cone(v(10.0, -36.0, 2.0), v(46.0, -46.0, 8.0), 4.0, 3.0))
        .cut(5.0, cylinder(v(0.0, 30.0, -14.0), v(0.0, 34.0, -70.0), 17.0, 0.0))
        // face: brow, lateral rim, cheekbone, lower rim, nasal bones
        .chain(
            7.0,
            true,
            &[
                (v(7.0, -85.0, 14.0), 6.0),
                (v(28.0, -86.0, 18.5), 5.0),
                (v(45.0, -75.0, 13.0), 5.0),
                (v(50.5, -66.0, -2.0), 4.6),
                (v(47.0, -68.0, -19.0), 6.5),
                (v(32.0, -80.0, -19.0), 5.0),
                (v(15.0, -87.0, -9.0), 3.8),
                (v(8.5, -90.0, 6.0), 3.8),
            ],
        )
        .add(4.0, cone(v(0.0, -87.0, 12.0), v(0.0, -99.5, -11.0), 6.5, 4.0))
        .chain(
            4.0,
            true,
            &[
                (v(5.0, -91.0, 2.0), 4.2),
                (v(9.5, -92.0, -14.0), 4.2),
                (v(14.5, -87.0, -32.0), 4.5),
                (v(12.0, -89.0, -46.0), 5.0),
            ],
        )
        // zygomatic arch
        .chain(
            5.0,
            true,
            &[
                (v(47.0, -68.0, -20.0), 6.5),
                (v(57.0, -52.0, -21.0), 4.4),
                (v(62.5, -32.0, -20.0), 3.4),
                (v(63.5, -12.0, -16.0), 3.6),
                (v(60.0, 2.0, -11.0), 5.5),
            ],
        )
        // upper jaw, palate, pterygoids
        .pair(12.0, ellipsoid(v(21.0, -66.0, -38.0), v(16.5, 20.0, 18.0)))
        .pair(10.0, cone(v(43.0, -66.0, -24.0), v(27.0, -60.0, -48.0), 6.0, 5.0))
        .pair(6.0, cone(v(19.0, -42.0, -24.0), v(18.0, -42.0, -54.0), 6.0, 3.5))
        .add(5.0, cuboid(v(0.0, -64.0, -49.0), v(20.0, 26.0, 2.6), 2.0))
        .add(6.0, cone(v(0.0, -88.0, -46.0), v(0.0, -88.0, -52.0), 4.0, 5.0));
    s = s.chain(6.0, true, &arch(-52.0, 5.0, 0.0));
    // orbits, nose, sinuses
    s.cut_pair(4.0, cone(v(33.0, -88.0, 0.5), v(11.0, -38.0, 0.0), 17.0, 3.0))
        .cut_pair(5.0, ellipsoid(v(33.0, -95.0, 0.0), v(19.0, 16.0, 16.5)))
        .cut_pair(3.0, cone(v(2.5, -112.0, -20.0), v(5.0, -106.0, -37.0), 4.0, 7.0))
        .cut_pair(4.0, cone(v(5.0, -106.0, -36.5), v(6.5, -12.0, -36.0), 7.0, 8.5))
        .cut_pair(4.0, cone(v(4.0, -92.0, -20.0), v(4.0, -40.0, -16.0), 5.5, 5.5))
        .cut_pair(2.0, ellipsoid(v(26.0, -66.0, -33.0), v(12.5, 15.5, 14.0)))
        .cut_pair(2.0, ellipsoid(v(8.0, -81.5, 23.0), v(8.0, 3.0, 8.0)))
        .cut_pair(2.0, ellipsoid(v(7.0, -30.0, -11.0), v(6.0, 9.5, 7.5)))
        .cut_pair(2.0, ellipsoid(v(8.5, -62.0, -6.0), v(4.0, 18.0, 9.0)))
        // septum and turbinates
        .add(1.0, cuboid(v(0.3, -64.0, -27.0), v(1.0, 29.0, 18.0), 0.9))
        .pair(1.0, cone(v(8.5, -88.0, -40.0), v(8.5, -46.0, -39.0), 2.2, 2.0))
        .pair(1.0, cone(v(7.5, -80.0, -29.0), v(7.5, -46.0, -28.0), 1.9, 1.8))
}

fn cavity_cut(s: Shape) -> Shape {
    s.cut(3.0, ellipsoid(v(0.0, 8.0, 42.0), v(62.5, 78.0, 63.0)))
        .cut(5.0, ellipsoid(v(0.0, -36.0, 36.0), v(46.0, 46.5, 46.0)))
        .cut_pair(5.0, ellipsoid(v(40.0, -12.0, -2.0), v(20.0, 30.0, 19.0)))
        .cut(5.0, ellipsoid(v(0.0, 40.0, -8.0), v(45.0, 35.0, 22.0)))
}

/// The dental arch as a chain at height `z`, moved back by `back`.
fn arch(z: f32, r: f32, back: f32) -> Vec<(Vec3, f32)> {
    (0..=7)
        .map(|i| {
            let (p, _) = along_arch(9.0 * i as f32 * 0.98);
            (v(p.x, p.y + back, z), r)
        })
        .collect()
}

/// Point and unit tangent on the left half of the dental arch, `s` millimetres from the middle: a quarter of an ellipse, then
/// straight back.
fn along_arch(s: f32) -> (Vec3, Vec3) {
    let (a, b, c) = (25.5, 36.0, -55.0);
    let n = 64;
    let point = |i: usize| {
        let t = (i as f32 / n as f32) * std::f32::consts::FRAC_PI_2;
        v(a * t.sin(), c - b * t.cos(), 0.0)
    };
    let mut left = s;
    for i in 0..n {
        let (p, q) = (point(i), point(i + 1));
        let len = p.distance(q);
        if left <= len {
            return (p + (q - p) * (left / len), (q - p) / len);
        }
        left -= len;
    }
    (v(a + 0.06 * left, c + left, 0.0), v(0.06, 1.0, 0.0).normalize())
}

fn jaw() -> Shape {
    Shape::new(9.0)
        // ramus with condyle and coronoid process
        .pair(0.0, cone(v(55.0, -7.0, -18.0), v(46.0, -5.0, -19.0), 4.4, 4.0))
        .pair(6.0, cone(v(50.0, -7.0, -20.0), v(49.0, -15.0, -44.0), 4.2, 5.2))
        .pair(7.0, cone(v(47.5, -36.0, -27.0), v(48.0, -32.0, -50.0), 2.2, 5.0))
        .pair(9.0, turned_cuboid(v(48.5, -25.0, -56.0), v(3.8, 15.0, 18.0), 3.5, turn(12.0, 0.0, 4.0)))
        .pair(10.0, cone(v(48.5, -16.0, -62.0), v(46.5, -24.0, -76.0), 5.5, 6.5))
        // body and chin
        .chain(
            14.0,
            true,
            &[
                (v(46.0, -26.0, -75.0), 6.5),
                (v(42.0, -42.0, -83.0), 7.2),
                (v(34.0, -60.0, -89.5), 7.4),
                (v(22.0, -77.0, -93.5), 7.6),
                (v(8.0, -86.5, -96.0), 7.8),
                (v(0.0, -88.0, -96.5), 7.8),
            ],
        )
        .add(9.0, ellipsoid(v(0.0, -90.0, -101.0), v(13.0, 6.0, 5.5)))
        .chain(9.0, true, &arch(-84.0, 5.2, 3.0))
        .chain(10.0, true, &[(v(29.0, -50.0, -81.0), 5.0), (v(38.0, -40.0, -78.0), 5.0), (v(47.0, -32.0, -66.0), 5.0)])
}

/// Sixteen upper and sixteen lower teeth (crown and roots), and their pulp.
fn teeth() -> (Shape, Shape) {
    let upper = [8.4, 6.6, 7.6, 7.0, 6.8, 10.0, 9.6, 8.4];
    let lower = [5.5, 6.0, 6.9, 7.0, 7.1, 10.8, 10.2, 9.0];
    let mut enamel = Shape::new(4.0).fold(0.05);
    let mut pulp = Shape::new(2.0).fold(0.05);
    for (widths, up, back, edge) in [(upper, 1.0, 0.0, -67.6), (lower, -1.0, 2.6, -68.4)] {
        let mut s = 0.1;
        for (i, w) in widths.into_iter().enumerate() {
            let (p, t) = along_arch(s + 0.5 * w);
            s += w;
            let rot = Mat3::from_cols(t, v(-t.y, t.x, 0.0), Vec3::Z);
            let height = [10.0, 9.0, 10.5, 8.5, 8.2, 7.6, 7.2, 6.8][i];
            let molar = i > 4;
            let depth = if molar {
                5.0
            } else if i > 2 {
                4.2
            } else {
                3.2
            };
            let neck = v(p.x, p.y + back, edge + up * height);
            let crown = v(p.x, p.y + back, edge + up * 0.5 * height);
            let half = v(0.485 * w, depth, 0.5 * height);
            enamel = enamel.pair(0.3, turned_cuboid(crown, half, 2.1, rot));
            // incisors are chisels
            if i < 3 {
                let front = rot * v(0.0, 1.0, 0.0);
                let (n, out) = (if front.y > 0.0 { front } else { -front }, v(0.0, 0.0, -up));
                enamel =
                    enamel.pair(1.5, turned_cuboid(crown - n * 1.2 + out * 0.1, half * v(0.99, 0.5, 1.0), 1.2, rot));
            }
            let length = [12.5, 12.0, 16.0, 13.0, 13.0, 12.0, 11.5, 10.0][i];
            let tip = v(0.0, 0.8, up * length);
            if molar {
                for side in [-0.24, 0.24] {
                    let o = t * (side * w);
                    enamel = enamel.pair(1.2, cone(neck + o - v(0.0, 0.0, up), neck + 1.3 * o + tip, 2.5, 1.0));
                    pulp = pulp.pair(0.5, cone(neck + o, neck + 1.3 * o + 0.8 * tip, 0.8, 0.4));
                }
            } else {
                enamel = enamel.pair(1.2, cone(neck - v(0.0, 0.0, up), neck + tip, 0.38 * w, 1.1));
                pulp = pulp.pair(0.5, cone(neck - v(0.0, 0.0, 2.0 * up), neck + 0.85 * tip, 0.9, 0.4));
            }
        }
    }
    (enamel, pulp)
}

/// Where the neck's vertebrae sit: the middle of the vertebral body at height `z`.
fn spine_at(z: f32) -> Vec3 {
    let t = (z + 50.0) / -116.0;
    v(0.0, 25.0 + 6.0 * t - 7.0 * (std::f32::consts::PI * t).sin(), z)
}

fn spine() -> Shape {
    let mut s = Shape::new(9.0)
        // atlas, and the tooth of the axis
        .add(0.0, torus(v(0.0, 32.0, -53.0), turn(-6.0, 0.0, 0.0), 17.0, 4.0))
        .pair(4.0, cone(v(20.0, 29.0, -52.0), v(36.0, 31.0, -54.0), 5.5, 3.5))
        .pair(3.0, ball(v(17.0, 27.0, -51.0), 6.5))
        .add(2.0, cone(spine_at(-52.0) + v(0.0, -5.0, 0.0), spine_at(-68.0), 4.0, 6.5));
    for i in 0..6 {
        let z = -70.0 - 18.5 * i as f32;
        let c = spine_at(z);
        let tail = 12.0 + if i == 0 { 6.0 } else { 2.0 * i as f32 };
        s = s
            .add(2.0, turned_ellipsoid(c + v(0.0, -1.0, 0.0), v(11.5, 9.0, 11.0), turn(-4.0, 0.0, 0.0)))
            .pair(3.0, cone(c + v(9.0, 2.0, 1.0), c + v(24.0, 5.0, -2.0), 4.2, 3.4))
            .pair(3.0, cone(c + v(17.0, 10.0, 7.5), c + v(17.0, 13.0, -7.5), 5.2, 5.0))
            .pair(3.0, cone(c + v(16.0, 14.0, -1.0), c + v(2.0, 27.0, -3.0), 3.6, 3.6))
            .pair(3.0, cone(c + v(0.0, 27.0, -3.0), c + v(2.0, 28.0 + tail, -9.0), 3.4, 3.0));
        // bodies are flat above and below, and end before the next disc
        s = s.cut(1.5, cuboid(c + v(0.0, -2.0, -9.25), v(13.0, 12.0, 2.0), 0.5));
    }
    s = s.cut(2.0, cone(v(0.0, 36.0, -40.0), spine_at(-70.0) + v(0.0, 15.5, 0.0), 11.0, 8.5));
    for i in 0..6 {
        let z = -70.0 - 18.5 * i as f32;
        let c = |z| spine_at(z) + v(0.0, 16.0, 0.0);
        s = s.cut(1.0, rod(c(z), c(z - 18.5), 8.0));
    }
    // the hyoid bone
    let s = s.chain(
        2.0,
        true,
        &[(v(0.0, -33.0, -104.0), 3.4), (v(10.0, -29.0, -103.0), 2.6), (v(20.0, -8.0, -100.0), 1.9)],
    );
    cut_neck(s, 0.0)
}

fn air() -> Shape {
    let s = Shape::new(3.0)
        // nose to throat
        .pair(0.0, cone(v(5.5, -100.0, -40.0), v(5.5, -88.0, -36.0), 4.0, 5.0))
        .pair(3.0, cone(v(5.6, -88.0, -36.0), v(6.2, -18.0, -36.0), 5.2, 6.6))
        .pair(3.0, cone(v(3.6, -88.0, -22.0), v(3.8, -44.0, -18.0), 2.6, 3.0))
        .add(5.0, cone(v(0.0, -8.0, -34.0), v(0.0, 0.0, -60.0), 9.0, 8.0))
        .add(5.0, ellipsoid(v(0.0, -2.0, -82.0), v(13.0, 6.5, 26.0)))
        .add(5.0, cone(v(0.0, -4.0, -98.0), v(0.0, -9.0, -122.0), 5.5, 6.0))
        .add(3.0, cone(v(0.0, -9.0, -122.0), v(0.0, -3.0, -190.0), 6.5, 8.6))
        // a sliver between tongue and palate
        .add(3.0, ellipsoid(v(0.0, -58.0, -55.5), v(19.0, 26.0, 2.4)))
        .add(4.0, cone(v(0.0, -32.0, -57.0), v(0.0, -4.0, -70.0), 2.5, 4.0))
        // sinuses, inner end of the ear canals
        .pair(1.0, ellipsoid(v(26.0, -66.0, -33.0), v(11.0, 14.0, 12.5)))
        .pair(1.0, ellipsoid(v(8.0, -81.5, 23.0), v(7.2, 2.3, 7.2)))
        .pair(1.0, ellipsoid(v(7.0, -30.0, -11.0), v(5.2, 8.7, 6.7)))
        .pair(1.0, ellipsoid(v(8.5, -62.0, -6.0), v(3.2, 17.0, 8.0)))
        .pair(1.0, cone(v(66.0, 3.0, -16.0), v(46.0, 2.0, -15.0), 3.2, 3.0));
    cut_neck(s, 0.0)
}

/// Nostrils and ear canals: air that breaks through the skin.
fn openings() -> Shape {
    Shape::new(3.0)
        .pair(0.0, turned_ellipsoid(v(6.6, -106.0, -47.0), v(2.8, 6.0, 7.0), turn(0.0, 0.0, -18.0)))
        .pair(1.0, cone(v(80.0, 8.0, -17.0), v(66.0, 3.0, -16.0), 3.6, 3.2))
}

fn muscle() -> Shape {
    let s = Shape::new(3.0)
        .pair(0.0, cone(v(56.0, -42.0, -24.0), v(51.0, -27.0, -74.0), 9.0, 8.0))
        .pair(3.0, ellipsoid(v(63.0, -20.0, 24.0), v(9.5, 40.0, 36.0)))
        .pair(2.0, cone(v(59.0, 22.0, -44.0), v(15.0, -18.0, -172.0), 9.5, 7.5))
        .add(3.0, cone(v(0.0, 34.0, -58.0), v(0.0, 40.0, -180.0), 43.0, 46.0))
        .pair(6.0, cone(v(24.0, 56.0, -40.0), v(62.0, 56.0, -196.0), 18.0, 36.0))
        .pair(4.0, cone(v(30.0, -30.0, -40.0), v(40.0, -28.0, -70.0), 10.0, 8.0))
        // tongue and floor of the mouth, throat
        .add(4.0, ellipsoid(v(0.0, -54.0, -74.0), v(22.0, 32.0, 18.0)))
        .add(6.0, ellipsoid(v(0.0, -22.0, -92.0), v(24.0, 30.0, 26.0)))
        .add(6.0, cone(v(0.0, -10.0, -118.0), v(0.0, -8.0, -180.0), 17.0, 19.0))
        // lips and the muscles of expression
        .add(4.0, torus(v(0.0, -94.0, -68.0), turn(90.0, 0.0, 0.0), 12.0, 5.0))
        .pair(3.0, cone(v(42.0, -78.0, -22.0), v(24.0, -92.0, -62.0), 3.0, 3.0))
        // behind the eyes
        .pair(2.0, cone(v(38.0, -74.0, 1.0), v(13.0, -42.0, 0.0), 2.4, 1.6))
        .pair(2.0, cone(v(22.0, -76.0, 1.0), v(11.0, -44.0, 0.0), 2.2, 1.6));
    cut_neck(s, 0.0)
}

fn cerebrum() -> Shape {
    cavity(-2.6, Shape::new(22.0).fold(0.4))
        // the temporal lobe lies under a deep fissure
        .cut_pair(4.0, turned_cuboid(v(58.0, -24.0, 14.0), v(18.0, 32.0, 0.8), 0.5, turn(14.0, 0.0, 0.0)))
        .cut_pair(5.0, turned_cuboid(v(40.0, -62.0, -6.0), v(40.0, 20.0, 7.0), 4.0, turn(-12.0, 0.0, 0.0)))
        // cisterns around the stem, tentorium
        .cut(6.0, ellipsoid(v(0.0, 0.0, -8.0), v(17.0, 24.0, 20.0)))
        .cut(4.0, ellipsoid(v(0.0, 46.0, -16.0), v(62.0, 42.0, 26.0)))
        // between the hemispheres, down to the corpus callosum
        .cut(2.0, cuboid(v(0.0, 0.0, 98.0), v(1.1, 120.0, 46.0), 0.5))
        .cut(2.0, cuboid(v(0.0, -70.0, 60.0), v(1.1, 36.0, 80.0), 0.5))
        .cut(2.0, cuboid(v(0.0, 90.0, 40.0), v(1.1, 46.0, 50.0), 0.5))
}

fn cerebellum() -> Shape {
    Shape::new(14.0)
        .fold(3.0)
        .pair(0.0, ellipsoid(v(20.0, 44.0, -11.0), v(25.0, 29.0, 18.0)))
        .add(6.0, ellipsoid(v(0.0, 46.0, -8.0), v(9.0, 25.0, 16.0)))
        .keep(2.0, ellipsoid(v(0.0, 40.0, -8.0), v(45.0, 35.0, 20.0)))
}

fn stem() -> Shape {
    let mut s = Shape::new(4.0)
        .add(0.0, cone(v(0.0, 6.0, 16.0), v(0.0, 8.0, -6.0), 13.0, 13.0))
        .add(6.0, cone(v(0.0, 10.0, -8.0), v(0.0, 34.0, -46.0), 12.0, 7.0));
    for i in 0..6 {
        let z = -46.0 - 22.0 * i as f32;
        let c = |z: f32| spine_at(z) + v(0.0, 16.0, 0.0);
        s = s.add(2.0, rod(if i == 0 { v(0.0, 34.0, -46.0) } else { c(z) }, c(z - 22.0), 5.0));
    }
    cut_neck(s, 0.0)
}

fn ventricles() -> Shape {
    Shape::new(3.0)
        .chain(
            3.0,
            true,
            &[
                (v(7.0, -26.0, 40.0), 4.5),
                (v(8.0, -6.0, 44.0), 5.0),
                (v(11.0, 20.0, 44.0), 5.5),
                (v(19.0, 38.0, 34.0), 6.5),
                (v(28.0, 22.0, 14.0), 3.5),
                (v(32.0, -4.0, 2.0), 2.5),
            ],
        )
        .pair(3.0, cone(v(19.0, 38.0, 34.0), v(18.0, 58.0, 28.0), 4.5, 2.0))
        .add(2.0, cuboid(v(0.0, 4.0, 28.0), v(1.8, 13.0, 9.0), 1.5))
        .add(2.0, cone(v(0.0, 16.0, 20.0), v(0.0, 26.0, -6.0), 1.4, 2.0))
        .add(2.0, ellipsoid(v(0.0, 26.0, -12.0), v(6.0, 5.0, 8.0)))
}

fn nuclei() -> Shape {
    Shape::new(3.0)
        .pair(0.0, ellipsoid(v(11.0, 8.0, 28.0), v(8.0, 14.0, 8.0)))
        .pair(1.0, ellipsoid(v(24.0, -8.0, 24.0), v(6.0, 16.0, 9.0)))
        .pair(1.0, cone(v(11.0, -22.0, 34.0), v(16.0, 16.0, 40.0), 6.0, 3.0))
}

fn nerves() -> Shape {
    Shape::new(3.0).pair(0.0, cone(v(30.0, -66.0, 0.0), v(6.0, -34.0, 0.0), 2.2, 2.2))
}

fn cartilage() -> Shape {
    let s = Shape::new(3.0)
        .pair(0.0, turned_cuboid(v(10.0, -20.0, -126.0), v(1.2, 14.0, 12.0), 1.0, turn(0.0, 0.0, -40.0)))
        .add(2.0, torus(v(0.0, -8.0, -144.0), turn(4.0, 0.0, 0.0), 10.5, 2.4))
        .add(2.0, torus(v(0.0, -7.0, -153.0), turn(4.0, 0.0, 0.0), 10.4, 1.6))
        .add(2.0, torus(v(0.0, -6.0, -160.0), turn(4.0, 0.0, 0.0), 10.4, 1.6));
    cut_neck(s, 0.0)
}

/// Bone by depth below its surface: a dense rind around a spongy core.
fn bone(d: f32, p: Vec3, w: f32, rind: f32) -> f32 {
    let core = step(rind - 0.5 * w, rind + w, -d);
    if core <= 0.0 {
        return hu::CORTICAL;
    }
    mix(hu::CORTICAL, hu::SPONGY + 160.0 * grain(p * 0.55), core)
}

/// The folded cortex: how much of fluid, and of grey against white matter.
fn cortex(d: f32, p: Vec3, w: f32, size: f32) -> (f32, f32) {
    let q = p / size;
    let warp = v(noise(q * 0.62 + 3.1), noise(q * 0.62 + 41.7), noise(q * 0.62 + 87.3));
    let n = noise(q + 0.9 * warp);
    // roughly the distance from the middle of a sulcus
    let sulcus = n.abs() * size * 0.52;
    let depth = -d;
    let open = 1.5 * step(15.0, 2.0, depth);
    let fluid = step(open + w, open - w, sulcus) * step(16.0, 12.0, depth);
    let ribbon = (sulcus - open + 3.0 * step(10.0, 17.0, depth)).min(depth);
    (fluid, step(4.2, 2.6, ribbon))
}

impl Model for Head {
    fn bounds(&self) -> [Vec3; 2] {
        [v(-102.0, -130.0, -172.0), v(102.0, 110.0, 124.0)]
    }

    fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    fn value(&self, p: Vec3, at: &Block, h: f32) -> f32 {
        // bones and skin are wider ramps, for clean normals; small parts are sharper
        let (wide, w) = (1.5 * h, h);
        let skin = at.d(SKIN, p);
        if skin >= wide {
            return hu::AIR;
        }
        // fat under the skin, streaked by connective tissue
        let below = step(1.6 - 0.5 * w, 1.6 + w, -skin);
        let mut x = hu::SKIN;
        let cavity = at.d(CAVITY, p);
        if below > 0.0 && cavity > -w {
            let muscle = cover(at.d(MUSCLE, p), w.max(1.2));
            let fat = hu::FAT + 22.0 * grain(p * 0.16);
            let flesh =
                if muscle > 0.0 { mix(fat, hu::MUSCLE + 10.0 * noise(p * v(0.5, 0.5, 0.12)), muscle) } else { fat };
            x = mix(x, flesh, below);
            x = mix(x, hu::CARTILAGE, cover(at.d(CARTILAGE, p), w));
            x = mix(x, hu::MUSCLE, cover(at.d(NERVES, p), w));
            x = mix(x, hu::FLUID + 6.0, cover(at.d(EYES, p), w));
            x = mix(x, hu::LENS, cover(at.d(LENSES, p), w));
        }
        if cavity < w {
            let brain = self.brain(p, at, w);
            x = mix(x, brain, cover(cavity, w));
        }
        let stem = at.d(STEM, p);
        if stem < w {
            x = mix(x, hu::WHITE + 4.0, cover(stem, w));
        }
        // mucosa and skin close the cavities but at the openings
        let air = at.d(AIR, p).max(skin + 2.5).min(at.d(OPENINGS, p));
        let air = cover(air, w);
        x = mix(x, hu::AIR, air);
        for (id, rind) in [(SKULL, 1.9), (JAW, 2.4), (SPINE, 1.4)] {
            let d = at.d(id, p);
            if d < wide {
                x = mix(x, bone(d, p, w, rind), cover(d, wide));
            }
        }
        let tooth = at.d(TEETH, p);
        if tooth < w {
            let dentine = step(1.2, 2.2, -tooth);
            let mut t = mix(hu::ENAMEL, hu::DENTINE, dentine);
            // roots carry no enamel
            let root = step(8.5, 10.0, (p.z + 68.0).abs());
            t = mix(t, hu::DENTINE, root);
            t = mix(t, 300.0, cover(at.d(PULP, p), 0.6 * w));
            x = mix(x, t, cover(tooth, w));
        }
        mix(hu::AIR, x, cover(skin, wide))
    }
}

impl Head {
    fn brain(&self, p: Vec3, at: &Block, w: f32) -> f32 {
        let mut x = hu::FLUID;
        let cerebrum = at.d(CEREBRUM, p);
        if cerebrum < w {
            let (fluid, grey) = if cerebrum > -18.0 { cortex(cerebrum, p, 0.7 * w, 15.0) } else { (0.0, 0.0) };
            let tissue = mix(mix(hu::WHITE, hu::GREY, grey), hu::FLUID, fluid);
            let tissue = mix(tissue, hu::GREY - 2.0, cover(at.d(NUCLEI, p), w));
            x = mix(x, tissue, cover(cerebrum, w));
        }
        let cerebellum = at.d(CEREBELLUM, p);
        if cerebellum < w {
            // leaves: nearly level sheets, closer than the folds of the cerebrum
            let sheet = (p.z * 0.9 + 0.012 * (p.y - 46.0).powi(2) + 2.0 * noise(p * 0.09)) * 1.25;
            let leaf = sheet.sin() * step(12.0, 1.0, -cerebellum);
            let tissue = mix(hu::WHITE + 3.0, hu::GREY, step(-0.2, 0.5, leaf));
            let tissue = mix(tissue, hu::FLUID + 6.0, step(-0.45, -0.95, leaf) * step(7.0, 1.0, -cerebellum));
            x = mix(x, tissue, cover(cerebellum, w));
        }
        mix(x, hu::FLUID, cover(at.d(VENTRICLES, p), w))
    }
}

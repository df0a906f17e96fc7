//! A CT of a carp.
//!
//! Values (u16, Hounsfield units plus 1000): air 0, swim bladder 20, flesh about 1060, scales 1300, bone 1700 to 2600.
//! Millimetres of the model: the snout lies at -y, the back up.

use glam::Vec3;

use super::Model;
use super::noise::{grain, noise};
use super::sdf::*;

const LENGTH: f32 = 320.0;
const SNOUT: f32 = -160.0;

const FINS: usize = 0;
const BLADDER: usize = 1;
const HEADBONES: usize = 2;
const EYES: usize = 3;
const TRIM: usize = 4;

const FLESH: f32 = 1060.0;
const BONE: f32 = 2000.0;

/// Profile of the body: height of the back, of the belly, and half width, at 15 stations from the snout to the tail.
const PROFILE: [[f32; 3]; 15] = [
    [-3.0, -11.0, 4.0],
    [13.0, -21.0, 14.0],
    [25.0, -30.0, 21.0],
    [36.0, -37.0, 25.5],
    [45.0, -43.0, 28.5],
    [51.0, -47.0, 30.0],
    [54.0, -49.0, 30.0],
    [53.0, -49.0, 29.0],
    [49.0, -46.0, 27.0],
    [42.0, -41.0, 23.5],
    [34.0, -33.0, 19.0],
    [25.0, -23.0, 14.0],
    [18.5, -15.5, 9.5],
    [16.0, -12.0, 6.5],
    [16.5, -12.5, 4.5],
];

/// Where the profile ends and the tail fin takes over, in millimetres from the snout.
const BODY: f32 = 276.0;

pub struct Carp {
    shapes: Vec<Shape>,
}

impl Carp {
    pub fn new() -> Self {
        let fins = Shape::new(2.0)
            .pair(0.0, turned_ellipsoid(v(29.0, -74.0, -36.0), v(2.0, 22.0, 10.0), turn(-28.0, 0.0, -38.0)))
            .pair(0.0, turned_ellipsoid(v(17.0, -4.0, -54.0), v(1.9, 19.0, 9.0), turn(-26.0, 24.0, -14.0)));
        let bladder = Shape::new(3.0)
            .add(0.0, ellipsoid(v(0.0, -34.0, 9.0), v(12.0, 25.0, 13.0)))
            .add(4.0, ellipsoid(v(0.0, 16.0, 12.0), v(10.0, 31.0, 10.5)));
        let mut bones = Shape::new(4.0)
            // roof and floor of the skull, jaws
            .add(0.0, turned_ellipsoid(v(0.0, -112.0, 14.0), v(11.0, 34.0, 7.0), turn(29.0, 0.0, 0.0)))
            .add(3.0, cone(v(0.0, -140.0, -4.0), v(0.0, -86.0, 4.0), 2.4, 4.0))
            .cut(2.0, turned_ellipsoid(v(0.0, -104.0, 13.0), v(5.5, 18.0, 3.6), turn(22.0, 0.0, 0.0)))
            .pair(2.0, cone(v(1.5, -157.0, -4.0), v(10.0, -140.0, -9.0), 1.8, 1.5))
            .pair(2.0, cone(v(1.0, -155.0, -13.0), v(11.0, -132.0, -17.0), 1.9, 2.2))
            .pair(2.0, cone(v(11.0, -132.0, -17.0), v(14.0, -118.0, 4.0), 1.8, 1.6))
            // the girdle behind the gills
            .chain(
                2.0,
                true,
                &[
                    (v(12.0, -82.0, 30.0), 1.8),
                    (v(24.0, -80.0, 6.0), 2.4),
                    (v(22.0, -82.0, -22.0), 2.6),
                    (v(5.0, -96.0, -40.0), 2.2),
                ],
            );
        // gill arches
        for i in 0..4 {
            let y = -108.0 + 6.0 * i as f32;
            bones = bones.chain(
                1.0,
                true,
                &[
                    (v(3.0, y - 8.0, -22.0), 1.0),
                    (v(11.0, y - 2.0, -18.0), 1.0),
                    (v(14.0, y + 3.0, -7.0), 1.0),
                    (v(8.0, y + 4.0, 3.0), 0.9),
                ],
            );
        }
        // throat teeth
        for i in 0..3 {
            bones = bones.pair(0.5, ball(v(4.0, -90.0 + 4.0 * i as f32, -14.0), 2.1));
        }
        let eyes = Shape::new(3.0).pair(0.0, ellipsoid(v(14.5, -131.0, 5.0), v(5.6, 6.6, 6.6)));
        // lips and barbels
        let trim = Shape::new(3.0)
            .pair(0.0, cone(v(0.0, -160.0, -6.0), v(8.0, -152.0, -9.0), 3.2, 2.2))
            .pair(1.5, cone(v(0.0, -157.0, -12.5), v(8.0, -151.0, -11.0), 2.8, 2.0))
            .pair(1.5, cone(v(8.0, -151.0, -10.0), v(14.0, -149.0, -20.0), 1.6, 0.8))
            .pair(1.5, cone(v(4.0, -156.0, -4.0), v(8.0, -160.0, -7.0), 1.3, 0.7));
        Self { shapes: vec![fins, bladder, bones, eyes, trim] }
    }
}

/// Back, belly and half width at `y`, smoothly between the stations (Catmull and Rom).
fn profile(y: f32) -> [f32; 3] {
    let n = PROFILE.len() - 1;
    let s = ((y - SNOUT) / BODY * n as f32).clamp(0.0, n as f32 - 1e-3);
    let (i, t) = (s as usize, s.fract());
    let at = |k: usize| PROFILE[k.min(n)];
    let (a, b, c, d) = (at(i.saturating_sub(1)), at(i), at(i + 1), at(i + 2));
    std::array::from_fn(|q| {
        let (a, b, c, d) = (a[q], b[q], c[q], d[q]);
        b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
    })
}

/// What the parts share at one point.
struct Place {
    /// 0 at the snout, 1 at the tip of the tail.
    s: f32,
    top: f32,
    bottom: f32,
    /// Height of the backbone.
    spine: f32,
    /// Distance to the skin, without scales.
    body: f32,
}

fn place(p: Vec3) -> Place {
    let [top, bottom, width] = profile(p.y);
    let (mid, half) = (0.5 * (top + bottom), 0.5 * (top - bottom));
    let q = v(p.x / width, 0.0, (p.z - mid) / half);
    let (k0, k1) = (q.length(), v(q.x / width, 0.0, q.z / half).length());
    let round = if k1 > 0.0 { (k0 * (k0 - 1.0) / k1).max(-width) } else { -width };
    let end = (SNOUT - p.y).max(p.y - SNOUT - BODY);
    let body =
        if end > 0.0 { (round.max(0.0).powi(2) + end * end).sqrt() } else { round.max(-4.0 - 1.2 * (p.y - SNOUT)) };
    Place { s: (p.y - SNOUT) / LENGTH, top, bottom, spine: mix(mid, top, 0.24), body }
}

/// Rows of overlapping scales: how far the skin stands out.
fn scales(p: Vec3, at: &Place) -> f32 {
    let shown = step(0.235, 0.27, at.s) * step(0.86, 0.80, at.s);
    if shown <= 0.0 {
        return 0.0;
    }
    let round = (p.z - at.spine).atan2(p.x.abs());
    let row = round * 9.0 * 0.75;
    let (u, mut best) = (p.y / 10.0, 0.0f32);
    // two staggered lattices; each scale is a tilted disc, highest at its hind edge
    for odd in [0.0f32, 0.5] {
        let (cu, cv) = ((u - odd).round() + odd, (row - odd).round() + odd);
        let (du, dv) = (u - cu, row - cv);
        let r = ((du + 0.08).powi(2) + dv * dv).sqrt();
        best = best.max((0.55 + 0.9 * du) * step(0.62, 0.5, r));
    }
    0.9 * shown * best
}

/// Unpaired fins as sheets in the plane x = 0: signed distance within the plane, and the rays' pattern.
fn sheet(p: Vec3, at: &Place) -> (f32, f32) {
    let y = p.y - SNOUT;
    // back fin: steep in front, long and low behind
    let up = p.z - at.top;
    let t = (y - 112.0) / 104.0;
    let edge = if t < 0.0 {
        -1.0
    } else {
        34.0 * step(0.0, 0.12, t) * mix(1.0, 0.42, step(0.1, 0.6, t)) * step(1.06, 0.94, t)
    };
    let back =
        (up - edge).max(-8.0 - up).max(112.0 - 0.5 * up.max(0.0) - y).max(0.35 * (y - 0.5 * up.max(0.0) - 216.0));
    let back_rays = (y - 0.55 * up) * 1.45;
    // anal fin
    let down = at.bottom - p.z;
    let t = (y - 206.0) / 30.0;
    let edge = 26.0 * step(0.0, 0.25, t) * mix(1.0, 0.35, step(0.3, 1.0, t));
    let anal = (down - edge).max(-6.0 - down).max(206.0 - y).max(y - 0.45 * down.max(0.0) - 232.0);
    let anal_rays = (y - 0.7 * down) * 1.45;
    // forked tail
    let z = p.z - 2.0;
    let t = ((y - 262.0) / 56.0).clamp(0.0, 1.0);
    let lobe = 13.0 + 40.0 * t.powf(0.85);
    let fork = 284.0 + 34.0 * (z.abs() / 50.0).min(1.0).powf(1.1);
    let tail = (z.abs() - lobe).max(262.0 - y).max(y - fork);
    let tail_rays = z / (y - 215.0).max(10.0) * 92.0;
    let all = [(back, back_rays), (anal, anal_rays), (tail, tail_rays)];
    all.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((FAR, 0.0))
}

/// Backbone, its spines and the ribs.
fn skeleton(p: Vec3, at: &Place) -> f32 {
    const PITCH: f32 = 6.6;
    let y = p.y - SNOUT;
    if !(66.0..272.0).contains(&y) {
        return FAR;
    }
    let axis = (p.x * p.x + (p.z - at.spine).powi(2)).sqrt();
    // vertebrae are hourglasses
    let phase = (y / PITCH * std::f32::consts::TAU).cos();
    let size = mix(4.3, 2.6, step(190.0, 270.0, y));
    let mut d = axis - size - 0.7 * phase;
    let nearest = |t: f32| (t - (t / PITCH).round() * PITCH).abs();
    // spines above, and behind the belly below, lean back
    let up = p.z - at.spine;
    let side = p.x.abs();
    let thin = |a: f32, b: f32, r: f32| (a * a + b * b).sqrt() - r;
    if up > 0.0 && up < 0.66 * (at.top - at.spine) {
        let split = 1.8 * step(9.0, 3.0, up);
        d = d.min(thin(0.87 * nearest(y - 0.55 * up), side - split, 1.05));
    }
    let tail = y > 172.0;
    if up < 0.0 && tail && up > -0.68 * (at.spine - at.bottom) {
        d = d.min(thin(0.87 * nearest(y + 0.55 * up), side, 1.05));
    }
    // ribs follow the wall of the belly
    if up < 1.0 && (76.0..172.0).contains(&y) && p.z > at.bottom + 13.0 {
        let reach = step(0.0, 9.0, -up);
        let wall = at.body + mix(18.0, 6.5, reach);
        d = d.min(thin(0.9 * nearest(y + 0.42 * up), wall, 1.25));
    }
    d
}

impl Model for Carp {
    fn bounds(&self) -> [Vec3; 2] {
        [v(-56.0, -170.0, -90.0), v(56.0, 170.0, 104.0)]
    }

    fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    fn value(&self, p: Vec3, at: &Block, h: f32) -> f32 {
        let (wide, w) = (1.5 * h, h);
        let here = place(p);
        let body = if here.body.abs() < 4.0 + wide { here.body - scales(p, &here) } else { here.body };
        // the edge of the gill cover is a groove
        let cover_edge = ((p.y + 108.0).powi(2) + (0.8 * (p.z + 4.0)).powi(2)).sqrt() - 27.0;
        let groove = if p.y > -110.0 && p.x.abs() > 9.0 { 1.8 * step(2.0, 0.4, cover_edge.abs()) } else { 0.0 };
        let mouth = 1.6 * step(1.8, 0.4, (p.z + 9.5).abs()) * step(-146.0, -150.0, p.y);
        let eye = ((p.y + 131.0).powi(2) + (p.z - 5.0).powi(2)).sqrt();
        let rim = if p.x.abs() > 8.0 { 1.3 * step(1.6, 0.3, (eye - 7.6).abs()) } else { 0.0 };
        let skin = smin(body + groove + mouth + rim, at.d(TRIM, p).min(at.d(EYES, p)), 1.2);
        let (fin, rays) = sheet(p, &here);
        // never so thin that the grid could miss them
        let thick = 0.85f32.max(0.9 * h) + 0.25 * (rays * 2.4).sin() + 0.04 * (-here.body).max(0.0);
        let fin = smax(fin, p.x.abs() - thick, 1.0).min(at.d(FINS, p));
        if skin > wide && fin > wide {
            return 0.0;
        }
        let mut x = 0.0;
        if skin < wide {
            let mut flesh = FLESH + 14.0 * grain(p * 0.12);
            // sheets between the muscles fold in zigzags
            let zig = ((p.z - here.spine).abs() * 0.09).sin().abs() * 9.0;
            flesh -= 55.0 * step(0.75, 1.0, ((p.y - zig + 0.4 * p.x.abs()) * 0.95).cos());
            x = mix(1290.0, flesh, step(0.7, 0.9 + w, -body));
            // gills: loose and full of air
            let gills = smax(((p.y + 96.0).powi(2) + (p.z + 8.0).powi(2)).sqrt() - 19.0, 6.0 - p.x.abs(), 2.0)
                .max(here.body + 5.0);
            x = mix(x, 700.0 + 150.0 * (p.y * 2.2 + p.z).sin() + 60.0 * noise(p * 0.4), cover(gills, w));
            x = mix(x, 20.0, cover(at.d(BLADDER, p), w));
            x = mix(x, 1110.0, cover(at.d(EYES, p), w));
            let lens = ball(v(17.0, -131.5, 5.0), 2.4).distance(v(p.x.abs(), p.y, p.z));
            x = mix(x, 1500.0, cover(lens, w));
            let mut bone = skeleton(p, &here).min(at.d(HEADBONES, p));
            // plates under the skin of the head: gill cover, cheek, with a window for the eye
            let plate = ((here.body + 3.4).abs() - 1.1)
                .max(cover_edge + 1.2)
                .max(-146.0 - p.y)
                .max(9.0 - eye)
                .max(4.0 - p.x.abs());
            bone = bone.min(plate);
            x = mix(x, BONE + 300.0 * step(-1.0, -3.0, bone), cover(bone, w));
            x = mix(0.0, x, cover(skin, wide));
        }
        let rays = 1100.0 + 480.0 * step(0.1, 0.9, (rays * 2.4).sin());
        mix(x, rays.max(x), cover(fin, w))
    }
}

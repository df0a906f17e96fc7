//! The CPU renderer against a direct integrator in f64 that follows the contract in `voxclay::render`, and against analytic answers.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use voxclay::math::{BackwardMap, Identity, OrientedBox};
use voxclay::render::{
    Camera, ClassTable, Exact, Field, Frame, Gradient, Look, Picture, Projection, Second, Shading, SliceGeometry,
    SliceVertex, render,
};
use voxclay::volume::transfer::{ControlPoint, Region, TransferFunction, Window, linear_from_srgb, srgb_from_linear};
use voxclay::volume::{Grid, Samples, Space, Volume};

mod pictures;
use pictures::difference;
#[path = "render/slices.rs"]
mod slices;
use slices::{box_slices, mapped_slices};

fn transfer(points: &[(f32, [f32; 3], f32)]) -> TransferFunction {
    let points = points.iter().map(|&(at, color, opacity)| ControlPoint { at, color, opacity }).collect();
    TransferFunction { name: "test".into(), window: Window::Auto, points, regions: vec![] }
}

fn clay() -> TransferFunction {
    transfer(&[
        (0.0, [0.1, 0.1, 0.3], 0.0),
        (0.3, [0.9, 0.5, 0.3], 0.0),
        (0.45, [0.9, 0.6, 0.4], 0.06),
        (0.7, [0.3, 0.8, 0.5], 0.1),
        (1.0, [1.0, 1.0, 0.9], 0.5),
    ])
}

/// A smooth blob with some structure, values 0 to 1.
fn blob(p: DVec3) -> f64 {
    let q = p * 2.0 - 1.0;
    let wave = 0.15 * (9.0 * q.x).sin() * (7.0 * q.y + 1.0).cos() * (8.0 * q.z).sin();
    (1.15 - 1.2 * q.length() + wave).clamp(0.0, 1.0)
}

fn volume(dims: [usize; 3], world: DAffine3, make: impl Fn(DVec3) -> f64, samples: fn(Vec<f64>) -> Samples) -> Field {
    let grid = Grid::new(dims, world, Space::Unknown).unwrap();
    let at = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
    let values = (0..grid.len())
        .map(|i| {
            let (x, y, z) = (i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]);
            make(DVec3::new(at(x, dims[0]), at(y, dims[1]), at(z, dims[2])))
        })
        .collect();
    Field::from_volume(Arc::new(Volume::new(grid, 1, samples(values))))
}

fn as_u8(v: Vec<f64>) -> Samples {
    Samples::U8(v.iter().map(|v| (v * 255.0).round() as u8).collect())
}

fn as_u16(v: Vec<f64>) -> Samples {
    Samples::U16(v.iter().map(|v| (v * 65535.0).round() as u16).collect())
}

fn as_f32(v: Vec<f64>) -> Samples {
    Samples::F32(v.iter().map(|v| *v as f32).collect())
}

fn tilted() -> DAffine3 {
    let turn = DMat3::from_rotation_z(0.3) * DMat3::from_rotation_x(0.2);
    DAffine3::from_mat3_translation(
        turn * DMat3::from_diagonal(DVec3::new(1.0, 1.2, 0.9)),
        DVec3::new(100.0, -40.0, 7.0),
    )
}

fn camera(grid: &Grid, projection: Projection) -> Camera {
    let radius = 0.5 * (grid.corners()[7] - grid.corners()[0]).length();
    Camera { target: grid.center(), yaw: 30.0, pitch: 20.0, roll: 0.0, radius, zoom: 1.0, projection }
}

const PERSPECTIVE: Projection = Projection::Perspective { fov_y: 30.0 };

// ---- the reference ----

/// The undeformed or deformed map that the reference and the geometry use.
type Map<'a> = &'a dyn Fn(DVec3) -> (DVec3, DMat3);

struct Reference<'a> {
    field: &'a Field,
    values: Vec<f64>,
    table: &'a ClassTable,
    look: &'a Look,
    window: [f64; 2],
    camera: &'a Camera,
    map: Map<'a>,
    heights: Vec<f64>,
    distance: f64,
}

impl Reference<'_> {
    fn real(&self, i: usize) -> f64 {
        self.values[i]
    }

    /// Trilinear at texel centres, clamped, in the window.
    fn value(&self, t: DVec3) -> f64 {
        let dims = self.field.grid.dims;
        let mut low = [0usize; 3];
        let mut part = [0.0; 3];
        let mut high = [0usize; 3];
        for a in 0..3 {
            let c = (t[a] * dims[a] as f64 - 0.5).clamp(0.0, (dims[a] - 1) as f64);
            low[a] = c.floor() as usize;
            high[a] = (low[a] + 1).min(dims[a] - 1);
            part[a] = c - c.floor();
        }
        let mut sum = 0.0;
        for corner in 0..8 {
            let (mut w, mut at) = (1.0, [0; 3]);
            for a in 0..3 {
                let up = corner >> a & 1 == 1;
                w *= if up { part[a] } else { 1.0 - part[a] };
                at[a] = if up { high[a] } else { low[a] };
            }
            sum += w * self.real((at[2] * dims[1] + at[1]) * dims[0] + at[0]);
        }
        let window = if matches!(self.look.shading, Shading::Iso { .. }) { self.field.range } else { self.window };
        ((sum - window[0]) / (window[1] - window[0])).clamp(0.0, 1.0)
    }

    /// How steep the undeformed values are, in parts of the window per voxel.
    fn steepness(&self, x: DVec3) -> f64 {
        let size = self.field.grid.size();
        let d =
            DVec3::from([DVec3::X, DVec3::Y, DVec3::Z].map(|e| self.value(x + e / size) - self.value(x - e / size)));
        0.5 * d.length()
    }

    /// What is left of an opacity by the steepness.
    fn part_by_steepness(&self, x: DVec3) -> f64 {
        let Some([from, to]) = self.look.gradient_opacity.map(|g| g.map(f64::from)) else { return 1.0 };
        ((self.steepness(x) - from) / (to - from)).clamp(0.0, 1.0)
    }

    /// Factor of the colour and what is added per opacity.
    fn light(&self, x: DVec3, p: DVec3, jacobian: DMat3, surface: bool) -> (f64, f64) {
        let look = self.look;
        if !look.lit {
            return (1.0, 0.0);
        }
        let (ambient, diffuse, specular) = (f64::from(look.ambient), f64::from(look.diffuse), f64::from(look.specular));
        let light = (self.camera.axes() * look.light).normalize();
        let h = self.field.grid.finest();
        if look.gradient == Gradient::Forward {
            let d = self.value(x) - self.value(x + h * (jacobian * light));
            return (ambient + diffuse * (12.0 * d).clamp(0.0, 1.0), 0.0);
        }
        let size = self.field.grid.size();
        let mut g = DVec3::ZERO;
        for a in 0..3 {
            let mut step = DVec3::ZERO;
            step[a] = 1.0 / size[a];
            g[a] = (self.value(x + step) - self.value(x - step)) * 0.5 * size[a];
        }
        let g = h * (jacobian.transpose() * g);
        let v = -self.camera.ray(p);
        let n = if g.length() < 1e-5 { v } else { g.normalize() };
        let n = if n.dot(v) < 0.0 { -n } else { n };
        let w = if surface { 1.0 } else { (g.length() * 12.0).min(1.0) };
        let shine = n.dot((light + v).normalize()).max(0.0).powf(look.shininess.into());
        (1.0 + w * (ambient + diffuse * n.dot(light).max(0.0) - 1.0), w * specular * shine)
    }

    /// Premultiplied linear colour along the ray through a point of the view plane; MIP: the value in the first channel.
    fn ray(&self, near: DVec3) -> [f64; 4] {
        let (dir, axis) = (self.camera.ray(near), self.camera.to_eye());
        let stretch = 1.0 / -dir.dot(axis);
        let mut sum = [0.0; 4];
        for height in self.heights.iter().rev() {
            let p = near + dir * ((axis.dot(near) - height) * stretch);
            let q = p + dir * (self.distance * stretch);
            let ((front, jacobian), back) = ((self.map)(p), (self.map)(q).0);
            if front.min_element() < 0.0 || front.max_element() > 1.0 {
                continue;
            }
            let (sf, sb) = (self.value(front), self.value(back));
            match self.look.shading {
                Shading::Mip => sum = [sf.max(sum[0]), 0.0, 0.0, 1.0],
                Shading::Iso { value, color } => {
                    let [lo, hi] = self.field.range;
                    let iso = (value - lo) / (hi - lo);
                    if sf.max(sb) >= iso {
                        let x = if sf >= iso { front } else { front.lerp(back, (iso - sf) / (sb - sf)) };
                        let (factor, shine) = self.light(x, p, jacobian, true);
                        let c = color.map(|c| f64::from(linear_from_srgb(c)) * factor + shine);
                        return [c[0], c[1], c[2], 1.0];
                    }
                }
                Shading::Volume => {
                    let by_steepness = self.table.second == Second::Steepness;
                    let second = if by_steepness { 1.0 - self.steepness(front).sqrt() } else { sb };
                    let e = self.table.lookup(sf as f32, second as f32).map(f64::from);
                    let part = self.part_by_steepness(front);
                    if e[3] * part > 0.0 {
                        let a = 1.0 - (1.0 - e[3] * part).powf(stretch);
                        let (factor, shine) = self.light(front, p, jacobian, false);
                        let through = 1.0 - sum[3];
                        (0..3).for_each(|c| sum[c] += through * (e[c] * a / e[3] * factor + a * shine));
                        sum[3] += through * a;
                    }
                }
            }
        }
        sum
    }

    fn picture(&self, width: u32, height: u32) -> Picture {
        let world = self.camera.clip_from_world(width, height).inverse();
        let mut pixels = Vec::new();
        for y in 0..height {
            let t = (y as f32 + 0.5) / height as f32;
            let [top, bottom] = self.look.background;
            let ground: [f64; 3] =
                std::array::from_fn(|c| f64::from(linear_from_srgb(top[c] + t * (bottom[c] - top[c]))));
            for x in 0..width {
                let ndc = DVec3::new(
                    2.0 * (f64::from(x) + 0.5) / f64::from(width) - 1.0,
                    1.0 - 2.0 * (f64::from(y) + 0.5) / f64::from(height),
                    0.3,
                );
                let s = self.ray(world.project_point3(ndc));
                let code = |v: f64| (srgb_from_linear(v.clamp(0.0, 1.0) as f32) * 255.0).round() as u8;
                pixels.push(if self.look.shading == Shading::Mip && s[3] > 0.0 {
                    let grey = (s[0] * 255.0).round() as u8;
                    [grey, grey, grey, 255]
                } else if self.look.transparent {
                    if s[3] == 0.0 {
                        [0; 4]
                    } else {
                        let c = |i: usize| code(s[i] / s[3]);
                        [c(0), c(1), c(2), (s[3] * 255.0).round() as u8]
                    }
                } else {
                    let c = |i: usize| code(s[i] + (1.0 - s[3]) * ground[i]);
                    [c(0), c(1), c(2), 255]
                });
            }
        }
        Picture { width, height, pixels }
    }
}

struct Case<'a> {
    field: &'a Field,
    tf: TransferFunction,
    look: Look,
    camera: Camera,
    distance: f64,
    size: [u32; 2],
    rings: usize,
    map: Option<Map<'a>>,
}

impl<'a> Case<'a> {
    fn new(field: &'a Field) -> Self {
        let camera = camera(&field.grid, PERSPECTIVE);
        let distance = field.grid.finest();
        Self { field, tf: clay(), look: Look::default(), camera, distance, size: [56, 48], rings: 0, map: None }
    }

    fn geometry(&self) -> SliceGeometry {
        match self.map {
            Some(map) => mapped_slices(&self.field.grid, &self.camera, self.distance, self.rings, map),
            None => box_slices(&self.field.grid, &self.camera, self.distance, self.rings),
        }
    }

    fn table(&self) -> ClassTable {
        ClassTable::build(&self.tf, self.distance / self.field.grid.finest(), self.look.preintegrated)
    }

    fn window(&self) -> [f64; 2] {
        let [lo, hi] = self.field.range;
        [lo + 0.05 * (hi - lo), hi - 0.1 * (hi - lo)]
    }

    fn render_with(&self, geometry: &SliceGeometry, exact: Option<Exact<'_>>) -> Picture {
        let [width, height] = self.size;
        let frame = Frame::new(&self.camera, &self.look, self.field, self.window(), geometry, width, height);
        render(geometry, self.field, &self.table(), &frame, exact)
    }

    fn render(&self) -> Picture {
        self.render_with(&self.geometry(), None)
    }

    fn reference(&self) -> Picture {
        let geometry = self.geometry();
        let m = self.field.grid.texture_from_world();
        let plain = move |p: DVec3| (m.transform_point3(p), m.matrix3);
        let axis = self.camera.to_eye();
        let heights = geometry
            .slices
            .iter()
            .filter(|s| !s.is_empty())
            .map(|s| {
                let v = &geometry.vertices[geometry.indices[s.start as usize] as usize];
                axis.dot(geometry.center + DVec3::from(v.position.map(f64::from)))
            })
            .collect();
        let reference = Reference {
            field: self.field,
            values: real_values(self.field),
            table: &self.table(),
            look: &self.look,
            window: self.window(),
            camera: &self.camera,
            map: self.map.unwrap_or(&plain),
            heights,
            distance: self.distance,
        };
        reference.picture(self.size[0], self.size[1])
    }

    fn agrees(&self, least: f64, what: &str) {
        let (got, want) = (self.render(), self.reference());
        let p = psnr_inside(&got, &want);
        let drawn = got.pixels.iter().filter(|p| **p != got.pixels[0]).count();
        assert!(drawn * 8 > got.pixels.len(), "{what}: nearly empty, {drawn} pixels");
        assert!(p >= least, "{what}: {p:.1} dB, largest difference {}", difference(&got, &want).max);
    }
}

/// PSNR without the worst thousandth of the pixels: a ray within rounding of a silhouette may hit or miss.
fn psnr_inside(got: &Picture, want: &Picture) -> f64 {
    let off = |i: &usize| got.pixels[*i].iter().zip(want.pixels[*i]).map(|(a, b)| a.abs_diff(b)).max();
    let mut order: Vec<usize> = (0..got.pixels.len()).collect();
    order.sort_by_key(|i| std::cmp::Reverse(off(i)));
    let mut got = got.clone();
    for i in order.drain(..got.pixels.len().div_ceil(1000)) {
        got.pixels[i] = want.pixels[i];
    }
    difference(&got, want).psnr
}

fn real_values(field: &Field) -> Vec<f64> {
    use voxclay::render::TexelSlice::{F32, U8, U16};
    let real = |t: f64| t * field.scale + field.offset;
    match field.texels.slice() {
        U8(t) => t.iter().map(|&t| real(f64::from(t) / 255.0)).collect(),
        U16(t) => t.iter().map(|&t| real(f64::from(t) / 65535.0)).collect(),
        F32(t) => t.iter().map(|&t| real(f64::from(t))).collect(),
    }
}

// ---- against the reference ----

#[test]
fn volumes_agree_with_the_reference() {
    let field = volume([24, 20, 26], tilted(), blob, as_u8);
    for projection in [PERSPECTIVE, Projection::Orthographic, Projection::Perspective { fov_y: 75.0 }] {
        for preintegrated in [false, true] {
            for (lit, gradient) in [(false, Gradient::Central), (true, Gradient::Central), (true, Gradient::Forward)] {
                let mut case = Case::new(&field);
                case.camera = camera(&field.grid, projection);
                case.look = Look { lit, gradient, preintegrated, ..case.look };
                case.agrees(50.0, &format!("{projection:?} {preintegrated} {lit} {gradient:?}"));
            }
        }
    }
}

#[test]
fn opacity_by_steepness_agrees_with_the_reference() {
    let field = volume([24, 20, 26], tilted(), blob, as_u16);
    for (i, lit) in [false, true].into_iter().enumerate() {
        let mut case = Case::new(&field);
        let plain = case.render();
        case.look = Look { lit, gradient_opacity: Some([0.02, [0.05, 0.2][i]]), ..case.look };
        case.agrees(50.0, &format!("steep, lit {lit}"));
        assert!(case.render() != plain);
        // everything is steep enough, and nothing
        case.look = Look { gradient_opacity: Some([-2.0, -1.0]), lit: true, ..case.look };
        assert_eq!(case.render().pixels, plain.pixels);
        case.look = Look { gradient_opacity: Some([5.0, 6.0]), transparent: true, ..case.look };
        assert!(case.render().pixels.iter().all(|p| p[3] == 0));
    }
}

#[test]
fn regions_agree_with_the_reference() {
    let field = volume([24, 20, 26], tilted(), blob, as_u16);
    let region = |value, steepness, color| Region { value, steepness, foot: 0.4, soft: 0.6, opacity: 0.35, color };
    let regions = vec![region([0.2, 0.7], [0.01, 0.2], None), region([0.5, 1.0], [0.0, 0.06], Some([0.3, 0.7, 1.0]))];
    for (lit, gradient_opacity) in [(false, None), (true, None), (true, Some([0.02, 0.1]))] {
        let mut case = Case::new(&field);
        let plain = case.render();
        case.tf.regions.clone_from(&regions);
        case.look = Look { lit, gradient_opacity, ..case.look };
        case.agrees(50.0, &format!("regions, lit {lit}, {gradient_opacity:?}"));
        assert!(case.render() != plain);
    }
}

#[test]
fn types_and_shapes_agree_with_the_reference() {
    let makes: [fn(Vec<f64>) -> Samples; 3] = [as_u8, as_u16, as_f32];
    for (i, make) in makes.into_iter().enumerate() {
        for dims in [[17, 9, 30], [1, 12, 12], [2, 2, 2], [1, 1, 1], [40, 3, 1]] {
            let field = volume(dims, tilted(), |p| 0.8 - 0.5 * (p.x - p.y * p.z).abs(), make);
            let mut case = Case::new(&field);
            case.size = [[56, 48], [90, 20], [21, 77]][i];
            case.distance *= 0.6;
            if dims == [1, 1, 1] {
                // its range has no width: everything is 0
                case.tf = transfer(&[(0.0, [0.8, 0.4, 0.2], 0.3)]);
                assert!(case.render().pixels.iter().filter(|p| p[0] > p[2]).count() > 20);
                continue;
            }
            case.agrees(48.0, &format!("{dims:?} type {i}"));
        }
    }
}

#[test]
fn surfaces_and_maxima_agree_with_the_reference() {
    let field = volume([24, 22, 26], tilted(), blob, as_f32);
    for (name, shading, lit, gradient, least) in [
        ("iso", Shading::Iso { value: 0.5, color: [0.9, 0.8, 0.6] }, true, Gradient::Central, 45.0),
        ("iso forward", Shading::Iso { value: 0.5, color: [0.9, 0.8, 0.6] }, true, Gradient::Forward, 45.0),
        ("iso flat", Shading::Iso { value: 0.4, color: [0.9, 0.8, 0.6] }, false, Gradient::Central, 45.0),
        ("mip", Shading::Mip, true, Gradient::Central, 45.0),
    ] {
        let mut case = Case::new(&field);
        case.look = Look { shading, lit, gradient, ..case.look };
        case.agrees(least, name);
        case.camera = camera(&field.grid, Projection::Orthographic);
        case.rings = 3;
        case.agrees(least, &format!("{name} orthographic"));
    }
}

#[test]
fn transparent_pictures_agree_with_the_reference() {
    let field = volume([20; 3], tilted(), blob, as_u8);
    let mut case = Case::new(&field);
    case.look.transparent = true;
    let (got, want) = (case.render(), case.reference());
    // colours of nearly clear pixels are coarse: compare premultiplied
    for (g, w) in got.pixels.iter().zip(&want.pixels) {
        assert!(g[3].abs_diff(w[3]) <= 1, "{g:?} {w:?}");
        for c in 0..3 {
            assert!((f64::from(g[c]) - f64::from(w[c])).abs() * f64::from(w[3]) <= 3.0 * 255.0, "{g:?} {w:?}");
        }
    }
    assert!(got.pixels.contains(&[0; 4]) && got.pixels.iter().any(|p| p[3] > 200));
}

/// A bend, as a backward map of the world.
struct Bend {
    center: DVec3,
    strength: f64,
}

impl BackwardMap for Bend {
    fn backward(&self, p: DVec3) -> DVec3 {
        let q = p - self.center;
        p + DVec3::new(0.0, self.strength * (0.25 * q.x).sin(), self.strength * (0.2 * q.y).cos())
    }

    fn backward_with_jacobian(&self, p: DVec3) -> (DVec3, DMat3) {
        let q = p - self.center;
        let (dy, dz) = (self.strength * 0.25 * (0.25 * q.x).cos(), -self.strength * 0.2 * (0.2 * q.y).sin());
        let j = DMat3::from_cols(DVec3::new(1.0, dy, 0.0), DVec3::new(0.0, 1.0, dz), DVec3::Z);
        (self.backward(p), j)
    }

    fn supports(&self) -> Vec<OrientedBox> {
        Vec::new()
    }
}

#[test]
fn deformed_fields_agree_with_the_reference() {
    let field = volume([24; 3], tilted(), blob, as_f32);
    let bend = Bend { center: field.grid.center(), strength: 2.0 };
    let m = field.grid.texture_from_world();
    let map = |p: DVec3| {
        let (q, j) = bend.backward_with_jacobian(p);
        (m.transform_point3(q), m.matrix3 * j)
    };
    for shading in [Shading::Volume, Shading::Iso { value: 0.5, color: [0.9, 0.8, 0.6] }] {
        let mut case = Case::new(&field);
        case.look.shading = shading;
        case.map = Some(&map);
        let want = case.reference();
        let exact = Exact { map: &bend, texture_from_world: m };
        // exact per fragment, whatever the vertices say
        case.rings = 0;
        let got = case.render_with(&box_slices(&field.grid, &case.camera, case.distance, 0), Some(exact));
        let p = psnr_inside(&got, &want);
        assert!(p >= 45.0, "exact {shading:?}: {p:.1} dB");
        // interpolated: better with more triangles
        let coarse = difference(&case.render(), &want).psnr;
        case.rings = 12;
        let fine = difference(&case.render(), &want).psnr;
        assert!(fine > coarse + 3.0 && fine >= 38.0, "{shading:?}: {coarse:.1} then {fine:.1} dB");
    }
    // the identity changes nothing
    let case = Case::new(&field);
    let exact = case.render_with(&case.geometry(), Some(Exact { map: &Identity, texture_from_world: m }));
    assert!(difference(&exact, &case.render()).psnr >= 50.0);
}

// ---- analytic ----

fn axis_aligned(n: usize) -> DAffine3 {
    DAffine3::from_translation(DVec3::splat(-0.5 * n as f64))
}

/// Looks along y at a block from the front.
fn frontal(field: &Field) -> Camera {
    let n = field.grid.dims[0] as f64;
    Camera { yaw: 0.0, pitch: 0.0, radius: 0.6 * n, ..camera(&field.grid, Projection::Orthographic) }
}

#[test]
fn a_constant_block_lets_through_what_it_should() {
    let n = 16;
    let field = volume([n; 3], axis_aligned(n), |p| if p.x < 0.01 { 0.0 } else { 0.5 }, as_f32);
    let (opacity, layers) = (0.07f32, n as i32);
    for (k, preintegrated) in [(1.0, false), (0.25, false), (0.5, true), (2.0, true)] {
        let mut case = Case::new(&field);
        case.tf = transfer(&[(0.0, [1.0; 3], opacity)]);
        case.camera = frontal(&field);
        case.distance = k;
        case.look = Look { lit: false, preintegrated, transparent: true, ..case.look };
        let picture = case.render();
        let middle = picture.pixels[picture.pixels.len() / 2 + 28];
        let want = (1.0 - (1.0 - opacity).powi(layers)) * 255.0;
        assert!((f32::from(middle[3]) - want).abs() <= 1.0, "{middle:?} {want}");
        assert_eq!(middle[..3], [255; 3]);
    }
}

#[test]
fn a_ramp_is_the_integral() {
    // values run from 0 in front to 1 at the back, extinction grows linearly with them
    let n = 64;
    let field = volume([8, n, 8], DAffine3::from_translation(DVec3::new(-4.0, -32.0, -4.0)), |p| p.y, as_f32);
    let points: Vec<_> = (0..=64)
        .map(|i| {
            let s = i as f32 / 64.0;
            (s, [1.0; 3], 1.0 - (-0.05 * s).exp())
        })
        .collect();
    let mut case = Case::new(&field);
    case.tf = transfer(&points);
    case.camera = Camera { radius: 50.0, zoom: 10.0, ..frontal(&field) };
    case.look = Look { lit: false, transparent: true, ..case.look };
    // half a voxel at each end is constant; the window cuts 5 % below and 10 % above
    let [lo, hi] = case.window();
    // the segments of the slices begin half a distance behind the face and end as much behind the block
    let integral = |distance: f64| -> f64 {
        (0..64_000)
            .map(|i| {
                let y = (f64::from(i) + 0.5) / 64_000.0 + 0.5 * distance / 64.0;
                let v = y.clamp(0.5 / 64.0, 63.5 / 64.0);
                0.05 * ((v - lo) / (hi - lo)).clamp(0.0, 1.0) * 64.0 / 64_000.0
            })
            .sum()
    };
    for distance in [0.5, 1.0, 4.0] {
        case.distance = distance;
        let want = (1.0 - (-integral(distance)).exp()) * 255.0;
        let picture = case.render();
        let middle = picture.pixels[picture.pixels.len() / 2 + 28];
        assert!((f64::from(middle[3]) - want).abs() <= 1.0, "{distance}: {middle:?} {want}");
    }
}

#[test]
fn the_number_of_slices_does_not_change_the_brightness() {
    let field = volume([32; 3], tilted(), blob, as_u8);
    let mut case = Case::new(&field);
    case.look.lit = false;
    case.distance = 0.25;
    let fine = case.render();
    case.distance = 1.0;
    let coarse = case.render();
    assert!(difference(&fine, &coarse).psnr > 38.0, "{:.1} dB", difference(&fine, &coarse).psnr);
}

#[test]
fn preintegration_reduces_wood_grain() {
    // a thin shell in value: slices alone miss it or hit it
    let n = 48;
    let field = volume([n; 3], axis_aligned(n), |p| 1.0 - (p - 0.5).length() * 1.1, as_f32);
    let shell = [(0.0, 0.0), (0.68, 0.0), (0.7, 0.9), (0.72, 0.0), (1.0, 0.0)].map(|(s, o)| (s, [1.0; 3], o));
    let mut case = Case::new(&field);
    case.tf = transfer(&shell);
    case.look = Look { lit: false, transparent: true, ..case.look };
    case.size = [64, 64];
    let mut error = |preintegrated, distance| {
        case.look.preintegrated = preintegrated;
        case.distance = distance;
        case.render().pixels.iter().map(|p| f64::from(p[3])).collect::<Vec<_>>()
    };
    let truth = error(true, 0.05);
    let rms = |v: &[f64]| (v.iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / v.len() as f64).sqrt();
    let (with, without) = (rms(&error(true, 1.0)), rms(&error(false, 1.0)));
    assert!(truth.iter().any(|a| *a > 60.0));
    assert!(with * 4.0 < without, "banding {with:.2} with, {without:.2} without");
}

#[test]
fn a_sphere_has_the_light_of_a_sphere() {
    let n = 48;
    let field = volume([n; 3], axis_aligned(n), |p| 1.0 - (p - 0.5).length(), as_f32);
    let mut case = Case::new(&field);
    // radius 0.3 of the edge
    case.look.shading = Shading::Iso { value: 0.7, color: [1.0; 3] };
    case.look = Look { ambient: 0.0, diffuse: 1.0, specular: 0.0, light: DVec3::new(0.3, 0.4, 1.0), ..case.look };
    case.look.background = [[0.0; 3]; 2];
    case.camera = frontal(&field);
    case.size = [96, 96];
    let picture = case.render();
    let (r, scale) = (0.3 * n as f64, case.camera.radius / 48.0);
    let light = case.look.light.normalize();
    let mut worst: f64 = 0.0;
    for y in 0..96 {
        for x in 0..96 {
            let p = glam::DVec2::new(x as f64 - 47.5, 47.5 - y as f64) * scale;
            let got = linear_from_srgb(f32::from(picture.pixels[y * 96 + x][0]) / 255.0);
            if p.length() < 0.93 * r {
                let n = p.extend((r * r - p.length_squared()).sqrt()) / r;
                worst = worst.max((f64::from(got) - n.dot(light).max(0.0)).abs());
            } else if p.length() > r + 1.5 * scale {
                assert_eq!(picture.pixels[y * 96 + x], [0, 0, 0, 255]);
            }
        }
    }
    assert!(worst < 0.02, "{worst}");
}

#[test]
fn rgba_fields_show_their_own_colours() {
    let n = 12;
    let grid = Grid::new([n; 3], axis_aligned(n), Space::Unknown).unwrap();
    let texels: Vec<u8> =
        (0..n * n * n).flat_map(|i| if i % n < n / 2 { [200, 30, 60, 255] } else { [20, 180, 90, 255] }).collect();
    let field = Field::from_volume(Arc::new(Volume::new(grid, 4, Samples::U8(texels.clone()))));
    let mut case = Case::new(&field);
    case.camera = frontal(&field);
    case.tf = transfer(&[(0.0, [0.0; 3], 0.9)]);
    case.look.lit = false;
    let frame = Frame::new(&case.camera, &case.look, &field, [0.0, 255.0], &case.geometry(), 64, 64);
    let u8_picture = render(&case.geometry(), &field, &case.table(), &frame, None);
    let at = |x: usize| u8_picture.pixels[32 * 64 + x];
    for (got, want) in [(at(16), [200, 30, 60]), (at(48), [20, 180, 90])] {
        assert!((0..3).all(|c| got[c].abs_diff(want[c]) <= 1), "{got:?} {want:?}");
    }
    let wide = texels.iter().map(|t| u16::from(*t) * 257).collect();
    let wide = Field::from_volume(Arc::new(Volume::new(grid, 4, Samples::U16(wide))));
    let frame = Frame::new(&case.camera, &case.look, &wide, [0.0, 65535.0], &case.geometry(), 64, 64);
    assert!(difference(&render(&case.geometry(), &wide, &case.table(), &frame, None), &u8_picture).max <= 1.0);
}

// ---- coverage ----

/// One slice of the given points (in -1..1 of the picture) and triangles through a constant field, and the alpha of each pixel.
fn one_slice(points: &[[f64; 2]], indices: Vec<u32>, size: u32, projection: Projection) -> Vec<u8> {
    let field = volume([2; 3], axis_aligned(2), |p| 0.5 + 0.1 * p.x, as_f32);
    let camera = Camera { radius: 1.0, ..camera(&field.grid, projection) };
    let axes = camera.axes();
    let reach = match projection {
        Projection::Orthographic => 1.0,
        Projection::Perspective { fov_y } => camera.eye_distance() * (0.5 * fov_y).to_radians().tan(),
    };
    let vertices = points
        .iter()
        .map(|[x, y]| SliceVertex {
            position: (axes.x_axis * (x * reach) + axes.y_axis * (y * reach)).as_vec3().to_array(),
            front: [0.5; 3],
            back: [0.5; 3],
            jacobian: [0.0; 9],
        })
        .collect();
    let all = 0..indices.len() as u32;
    let slices = [all].to_vec();
    let geometry = SliceGeometry { center: camera.target, vertices, indices, slices, distance: 1.0 };
    let look = Look { lit: false, transparent: true, preintegrated: false, ..Default::default() };
    let frame = Frame::new(&camera, &look, &field, [0.0, 1.0], &geometry, size, size);
    let table = ClassTable::build(&transfer(&[(0.0, [1.0; 3], 0.4)]), 1.0, false);
    render(&geometry, &field, &table, &frame, None).pixels.iter().map(|p| p[3]).collect()
}

/// A lattice of points, shaken, with its triangles; the rim lies outside the picture.
fn shaken(n: usize, seed: u64, on_lattice: bool) -> (Vec<[f64; 2]>, Vec<u32>) {
    let mut state = seed;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1u64 << 31) as f64
    };
    let mut points = Vec::new();
    for j in 0..=n {
        for i in 0..=n {
            let shake = if on_lattice { 0.0 } else { 0.9 / n as f64 };
            let at = |v: usize, r: f64| 2.4 * v as f64 / n as f64 - 1.2 + shake * (r - 0.5);
            points.push([at(i, random()), at(j, random())]);
        }
    }
    let mut indices = Vec::new();
    let at = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    for j in 0..n {
        for i in 0..n {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            // both diagonals and both turns
            match (random() * 4.0) as u32 {
                0 => indices.extend([a, b, c, a, c, d]),
                1 => indices.extend([a, c, b, a, d, c]),
                2 => indices.extend([a, b, d, b, c, d]),
                _ => indices.extend([a, d, b, b, c, d]),
            }
        }
    }
    (points, indices)
}

#[test]
fn every_pixel_is_covered_exactly_once() {
    for projection in [Projection::Orthographic, PERSPECTIVE] {
        let whole = one_slice(&[[-1.5, -1.5], [4.5, -1.5], [-1.5, 4.5]], vec![0, 1, 2], 80, projection);
        assert!(whole.iter().all(|a| (102..=110).contains(a)));
        for (seed, n) in [(1, 3), (2, 17), (3, 40), (4, 150)] {
            for on_lattice in [false, true] {
                let (points, indices) = shaken(n, seed, on_lattice);
                let alpha = one_slice(&points, indices, 80, projection);
                let bad = alpha.iter().zip(&whole).filter(|(a, b)| a != b).count();
                assert_eq!(bad, 0, "{projection:?} {n} {on_lattice}");
            }
        }
    }
}

#[test]
fn centres_on_edges_belong_to_one_triangle() {
    // edges through pixel centres: a 64-pixel picture cut at centres 16.5, 32.5, 48.5 both ways
    let cuts = [-1.2, 16.5 / 32.0 - 1.0, 32.5 / 32.0 - 1.0, 48.5 / 32.0 - 1.0, 1.2];
    let points: Vec<_> = cuts.iter().flat_map(|y| cuts.iter().map(move |x| [*x, -*y])).collect();
    let mut indices = Vec::new();
    for j in 0..4 {
        for i in 0..4 {
            let [a, b, c, d] = [j * 5 + i, j * 5 + i + 1, (j + 1) * 5 + i + 1, (j + 1) * 5 + i];
            indices.extend([a, b, c, a, c, d]);
        }
    }
    let alpha = one_slice(&points, indices, 64, Projection::Orthographic);
    assert!(alpha.iter().all(|a| *a == 102), "{alpha:?}");
    // a lone square whose sides run through centres: the top and left rows belong to it, the others do not
    let at = |v: f64| v / 32.0 - 1.0;
    let square = [[at(16.5), -at(16.5)], [at(48.5), -at(16.5)], [at(48.5), -at(48.5)], [at(16.5), -at(48.5)]];
    let alpha = one_slice(&square, vec![0, 1, 2, 0, 2, 3], 64, Projection::Orthographic);
    for y in 0..64 {
        for x in 0..64 {
            let within = (16..48).contains(&x) && (16..48).contains(&y);
            assert_eq!(alpha[y * 64 + x] > 0, within, "{x} {y}");
        }
    }
}

#[test]
fn overlapping_triangles_all_count() {
    let all = [[-1.5, -1.5], [4.5, -1.5], [-1.5, 4.5]];
    let alpha = one_slice(&all, [0, 1, 2].repeat(3), 16, Projection::Orthographic);
    let want = ((1.0 - 0.6f32.powi(3)) * 255.0).round() as u8;
    assert!(alpha.iter().all(|a| a.abs_diff(want) <= 1), "{} {want}", alpha[0]);
}

// ---- odd input ----

#[test]
fn odd_geometry_draws_nothing_or_what_it_can() {
    let field = volume([8; 3], tilted(), blob, as_u8);
    let mut case = Case::new(&field);
    let empty = case.render_with(&SliceGeometry::default(), None);
    assert_eq!(empty.pixels.len(), 56 * 48);
    assert_eq!(empty.pixels[0][..3], empty.pixels[55][..3]);
    case.size = [0, 0];
    assert!(case.render().pixels.is_empty());
    case.size = [33, 17];
    let good = case.geometry();
    let mut broken = good.clone();
    broken.indices.extend([0, 1]);
    broken.indices.truncate(broken.indices.len() / 3 * 3);
    broken.indices.extend([0, 0, 0, 1, 2, u32::MAX]);
    assert_eq!(case.render_with(&broken, None), case.render_with(&good, None));
    for bad in [f32::NAN, f32::INFINITY, 1e30, -1e30] {
        let mut broken = good.clone();
        broken.vertices.iter_mut().step_by(5).for_each(|v| v.position[0] = bad);
        broken.vertices.iter_mut().step_by(7).for_each(|v| v.front[1] = bad);
        broken.vertices.iter_mut().step_by(3).for_each(|v| v.back[2] = bad);
        broken.vertices.iter_mut().step_by(4).for_each(|v| v.jacobian[2] = bad);
        case.render_with(&broken, None);
    }
    // the eye inside the volume
    case.camera.zoom = 8.0;
    let inside = case.render();
    assert!(inside.pixels.iter().any(|p| *p != inside.pixels[0]));
}

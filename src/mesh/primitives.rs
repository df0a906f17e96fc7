//! Closed meshes made by formula: the boxes, balls and rings that stand in for scanned shapes, and the test shapes of the
//! benchmarks. All are manifold and face outward (the wall of a cavity faces into the cavity).

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::DVec3;

use super::TriMesh;
use super::nets::Lattice;

/// The hull of a box given by its eight corners, of which bits 0, 1, 2 of the index choose the upper side along its three
/// axes (as [`crate::volume::Grid::corners`] returns them): 12 triangles, facing outward also where the axes are
/// left-handed.
pub fn cuboid(corners: &[DVec3; 8]) -> TriMesh {
    const QUADS: [[u32; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = QUADS.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let mut mesh = TriMesh { positions: corners.to_vec(), triangles };
    if mesh.volume() < 0.0 {
        mesh.flip();
    }
    mesh
}

/// A box along the world's axes.
pub fn aligned_box(lo: DVec3, hi: DVec3) -> TriMesh {
    cuboid(&std::array::from_fn(|i| {
        DVec3::new(
            if i & 1 == 0 { lo.x } else { hi.x },
            if i & 2 == 0 { lo.y } else { hi.y },
            if i & 4 == 0 { lo.z } else { hi.z },
        )
    }))
}

/// The unit sphere about the origin: an icosahedron whose faces are cut into `frequency^2` triangles each, thus
/// `20 frequency^2` triangles on `10 frequency^2 + 2` vertices. A frequency of 0 counts as 1.
pub fn geodesic_sphere(frequency: u32) -> TriMesh {
    const FACES: [[u32; 3]; 20] = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let f = frequency.max(1);
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    // (0, +-1, +-g) and its cyclic shifts
    let corner = |v: u32| {
        let (s, l) = (if v & 1 == 0 { -1.0 } else { 1.0 }, if v & 2 == 0 { g } else { -g });
        match v / 4 {
            0 => DVec3::new(s, l, 0.0),
            1 => DVec3::new(0.0, s, l),
            _ => DVec3::new(l, 0.0, s),
        }
    };
    let mut ids: HashMap<[(u32, u32); 3], u32> = HashMap::new();
    let mut positions = Vec::with_capacity(10 * (f * f) as usize + 2);
    // a point is known by the corners that it mixes and their weights, so that faces share the points on their borders
    let mut id = |weights: [(u32, u32); 3]| {
        let mut key = weights.map(|(v, w)| if w == 0 { (u32::MAX, 0) } else { (v, w) });
        key.sort_unstable();
        *ids.entry(key).or_insert_with(|| {
            let sum = key.iter().filter(|k| k.1 > 0).map(|&(v, w)| f64::from(w) * corner(v)).sum::<DVec3>();
            positions.push(sum / sum.length());
            positions.len() as u32 - 1
        })
    };
    let mut triangles = Vec::with_capacity(20 * (f * f) as usize);
    for [a, b, c] in FACES {
        let mut at = |i: u32, j: u32| id([(a, f - i - j), (b, i), (c, j)]);
        for i in 0..f {
            for j in 0..f - i {
                triangles.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j < f - 1 {
                    triangles.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
    TriMesh { positions, triangles }
}

/// The frequency of a [`geodesic_sphere`] of about `triangles` triangles, at least 2.
pub fn frequency_for(triangles: usize) -> u32 {
    ((triangles as f64 / 20.0).sqrt().round_ties_even() as u32).max(2)
}

/// A ring about the z axis: circles of radius `minor` whose centres lie on a circle of radius `major > minor` in the xy
/// plane, in `around` and `across` segments (at least 3 each).
pub fn torus(major: f64, minor: f64, around: u32, across: u32) -> TriMesh {
    let (n, m) = (around.max(3), across.max(3));
    let mut positions = Vec::with_capacity((n * m) as usize);
    let mut triangles = Vec::with_capacity(2 * (n * m) as usize);
    for i in 0..n {
        let (su, cu) = (TAU * f64::from(i) / f64::from(n)).sin_cos();
        for j in 0..m {
            let (sv, cv) = (TAU * f64::from(j) / f64::from(m)).sin_cos();
            let r = major + minor * cv;
            positions.push(DVec3::new(r * cu, r * su, minor * sv));
            let at = |i: u32, j: u32| (i % n) * m + j % m;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    TriMesh { positions, triangles }
}

/// A solid cylinder about the z axis from `-height / 2` to `height / 2`, in `segments` segments (at least 3), with a
/// vertex in the middle of each cap.
pub fn cylinder(radius: f64, height: f64, segments: u32) -> TriMesh {
    let n = segments.max(3);
    let h = height / 2.0;
    let mut positions = vec![DVec3::new(0.0, 0.0, -h), DVec3::new(0.0, 0.0, h)];
    let mut triangles = Vec::with_capacity(4 * n as usize);
    for i in 0..n {
        let (s, c) = (TAU * f64::from(i) / f64::from(n)).sin_cos();
        positions.extend([-h, h].map(|z| DVec3::new(radius * c, radius * s, z)));
        let (low, high) = (2 + 2 * i, 3 + 2 * i);
        let (low2, high2) = (2 + 2 * ((i + 1) % n), 3 + 2 * ((i + 1) % n));
        triangles.extend([[low, low2, high2], [low, high2, high], [0, low2, low], [1, high, high2]]);
    }
    TriMesh { positions, triangles }
}

/// A unit sphere with deep bumps, which many planes cut in several contours: `20 frequency^2` triangles.
pub fn bumpy_sphere(frequency: u32) -> TriMesh {
    let mut mesh = geodesic_sphere(frequency);
    for p in &mut mesh.positions {
        let deep = (5.0 * p.x + 0.4).sin() * (6.0 * p.y - 0.2).sin() * (5.0 * p.z + 0.9).sin();
        let fine = (9.0 * p.z + 2.0 * p.x).cos() * (8.0 * p.y).cos();
        *p *= 1.0 + (0.30 * deep + 0.16 * fine);
    }
    mesh
}

/// A [`bumpy_sphere`] with a bumpy cavity, together about `20 frequency^2` triangles in two shells.
pub fn cavity_sphere(frequency: u32) -> TriMesh {
    let f = f64::from(frequency);
    let inner = ((f * 0.55).round_ties_even() as u32).max(2);
    let rest = f64::from(frequency * frequency) - f64::from(inner * inner);
    let outer = (rest.max(0.0).sqrt().round_ties_even() as u32).max(2);
    let mut mesh = bumpy_sphere(outer);
    let mut cavity = geodesic_sphere(inner);
    for q in &mut cavity.positions {
        let r = 0.42 + 0.05 * (4.0 * q.x).sin() * (5.0 * q.y).sin();
        *q = *q * r + DVec3::new(0.03, -0.02, 0.04);
    }
    cavity.flip();
    mesh.append(&cavity);
    mesh
}

/// Three fused rings, a closed surface of genus 3 about the origin, of about `triangles` triangles (at least about 2000):
/// the level 0.3 of a sum of Gaussian rings, as the benchmarks have it, as a relaxed surface net.
pub fn genus3(triangles: usize) -> TriMesh {
    let level = |p: DVec3| {
        let ring = |k: u32| {
            let (s, c) = (TAU * f64::from(k) / 3.0 + 0.3).sin_cos();
            let q = (p.x - 0.52 * c).hypot(p.y - 0.52 * s) - 0.46;
            (-(q * q + p.z * p.z) / (2.0 * 0.085 * 0.085)).exp()
        };
        0.30 - (0..3).map(ring).sum::<f64>()
    };
    let lattice = |n: usize| {
        // the middle of the lattice at the origin; cells nearly cubes
        let nz = (n as f64 * 0.36).round() as usize | 1;
        let step = DVec3::new(2.5, 2.5, 0.9) / DVec3::new(n as f64 - 1.0, n as f64 - 1.0, nz as f64 - 1.0);
        let place = move |q: DVec3| q * step - DVec3::new(1.25, 1.25, 0.45);
        let dims = [n, n, nz];
        let values: Vec<f64> = (0..n * n * nz)
            .map(|i| level(place(DVec3::new((i % n) as f64, (i / n % n) as f64, (i / (n * n)) as f64))))
            .collect();
        let mut lattice = Lattice { dims, inside: values.iter().map(|&v| v < 0.0).collect() };
        lattice.make_well_composed();
        (lattice, values, place)
    };
    let mut n = 48;
    for _ in 0..6 {
        let count = 2 * lattice(n).0.quad_count();
        let ratio = triangles as f64 / count.max(1) as f64;
        if (ratio - 1.0).abs() < 0.02 {
            break;
        }
        n = ((n as f64 * ratio.sqrt()).round() as usize).clamp(28, 2000);
    }
    let (lattice, values, place) = lattice(n);
    let net = lattice.net();
    let mut positions: Vec<DVec3> = net.mean_of_crossings(&lattice, |i| values[i]).into_iter().map(place).collect();
    for _ in 0..4 {
        let means = net.neighbour_means(&positions);
        positions.iter_mut().zip(means).for_each(|(p, mean)| *p = p.lerp(mean, 0.5));
    }
    TriMesh { triangles: net.triangles(&positions), positions }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Topology;
    use std::f64::consts::PI;

    /// Closed, every edge run once each way, Euler number, and outward.
    fn clean(mesh: &TriMesh, euler: i64) {
        let t = Topology::build(mesh.positions.len(), &mesh.triangles);
        t.sanity_check(&mesh.triangles);
        assert!(t.is_closed());
        assert!(t.edge_vertices.windows(2).all(|w| w[0] != w[1]), "manifold");
        for (h, &o) in t.opposite.iter().enumerate() {
            let from = |h: usize| mesh.triangles[h / 3][h % 3];
            assert_eq!(from(h), mesh.triangles[o as usize / 3][(o as usize % 3 + 1) % 3], "consistent");
        }
        assert_eq!(mesh.positions.len() as i64 - t.edge_count() as i64 + t.triangle_count() as i64, euler);
        assert!(mesh.volume() > 0.0);
    }

    #[test]
    fn boxes_have_their_volume_and_area_also_when_left_handed() {
        for x in [2.0, -2.0] {
            let b = cuboid(&std::array::from_fn(|i| {
                DVec3::new(x * (i & 1) as f64, 3.0 * (i >> 1 & 1) as f64, 5.0 * (i >> 2) as f64)
                    + DVec3::new(7.0, 1.0, -9.0)
            }));
            clean(&b, 2);
            assert_eq!((b.positions.len(), b.triangles.len()), (8, 12));
            assert!((b.volume() - 30.0).abs() < 1e-12 && (b.area() - 62.0).abs() < 1e-12);
        }
        let b = aligned_box(DVec3::new(-1.0, 0.0, 2.0), DVec3::new(1.0, 1.0, 3.0));
        assert_eq!(b.bounds(), Some((DVec3::new(-1.0, 0.0, 2.0), DVec3::new(1.0, 1.0, 3.0))));
        assert!((b.volume() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_sphere_converges_by_the_square_of_the_frequency() {
        let error = |f| {
            let s = geodesic_sphere(f);
            clean(&s, 2);
            assert_eq!((s.positions.len() as u32, s.triangles.len() as u32), (10 * f * f + 2, 20 * f * f));
            assert!(s.positions.iter().all(|p| (p.length() - 1.0).abs() < 1e-15));
            4.0 / 3.0 * PI - s.volume()
        };
        let icosahedron = 5.0 * (3.0 + 5f64.sqrt()) / 12.0 * (4.0 / (10.0 + 2.0 * 5f64.sqrt()).sqrt()).powi(3);
        assert!((error(1) - (4.0 / 3.0 * PI - icosahedron)).abs() < 1e-12);
        let ratio = error(8) / error(16);
        assert!((ratio - 4.0).abs() < 0.1, "{ratio}");
    }

    #[test]
    fn rings_and_cylinders_have_the_volume_of_their_polygons() {
        let t = torus(2.0, 0.5, 400, 200);
        clean(&t, 0);
        assert!((t.volume() / (2.0 * PI * PI * 2.0 * 0.25) - 1.0).abs() < 1e-3);
        let c = cylinder(2.0, 3.0, 7);
        clean(&c, 2);
        assert!((c.volume() - 3.0 * 0.5 * 7.0 * 4.0 * (TAU / 7.0).sin()).abs() < 1e-12);
    }

    #[test]
    fn bumpy_and_cavity_are_those_of_the_benchmarks() {
        // figures of the same shapes made by the benchmark's own script
        let bumpy = bumpy_sphere(16);
        clean(&bumpy, 2);
        assert_eq!((bumpy.positions.len(), bumpy.triangles.len()), (2562, 5120));
        assert!((bumpy.volume() - 4.315_314_219_322_926).abs() < 1e-12);
        let p = DVec3::new(-0.687_507_246_139_943_6, 0.666_272_211_198_277_5, 0.331_322_417_089_433_05);
        assert!((bumpy.positions[77] - p).length() < 1e-14);
        assert_eq!(bumpy.triangles[333], [205, 206, 192]);
        let cavity = cavity_sphere(16);
        clean(&cavity, 4);
        assert_eq!((cavity.positions.len(), cavity.triangles.len()), (2504, 5000));
        assert!((cavity.volume() - 3.988_831_894_259_201_6).abs() < 1e-12);
        let p = DVec3::new(0.402_318_106_453_543_05, 0.023_202_209_104_718_37, -0.120_202_601_694_776_7);
        assert!((*cavity.positions.last().expect("not empty") - p).length() < 1e-14);
        assert_eq!(cavity.triangles[4999], [2113, 2114, 2363]);
        assert_eq!((frequency_for(5000), frequency_for(100_000), frequency_for(0)), (16, 71, 2));
    }

    #[test]
    fn three_rings_have_three_handles_at_any_size() {
        for (n, tolerance) in [(2000, 0.1), (5000, 0.05), (20_000, 0.03)] {
            let mesh = genus3(n);
            clean(&mesh, -4);
            assert!(
                (mesh.triangles.len() as f64 / n as f64 - 1.0).abs() < tolerance,
                "{} of {n}",
                mesh.triangles.len()
            );
            let report = crate::mesh::check::MeshReport::of(&mesh);
            assert!(report.is_clean_solid(), "{:?}", report.defects());
        }
    }
}

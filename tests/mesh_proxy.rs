//! The automatic proxy: whatever the voxels, a clean solid that encloses them.

use glam::{DAffine3, DMat3, DVec3};
use voxclay::mesh::TriMesh;
use voxclay::mesh::check::MeshReport;
use voxclay::mesh::locate::Locator;
use voxclay::mesh::proxy::{ProxyError, ProxyOptions, enclose};

fn voxel(dims: [usize; 3], i: usize) -> DVec3 {
    DVec3::new((i % dims[0]) as f64, (i / dims[0] % dims[1]) as f64, (i / (dims[0] * dims[1])) as f64)
}

/// Small, so that the tests are quick.
fn options() -> ProxyOptions {
    ProxyOptions { target_triangles: 1500, ..ProxyOptions::default() }
}

/// Makes the proxy and checks what must hold for each: a clean solid around every voxel centre and, unless they lie beyond
/// the volume's side, around the centres of all neighbours within the margin.
fn proxy(
    dims: [usize; 3],
    frame: &DAffine3,
    inside: impl Fn(DVec3) -> bool + Sync,
    options: &ProxyOptions,
) -> (TriMesh, MeshReport) {
    let held = |i: usize| inside(voxel(dims, i));
    let mesh = enclose(dims, frame, held, options).expect("a proxy");
    let r = MeshReport::of(&mesh);
    assert!(r.is_clean_solid(), "{:?}", r.defects());
    let locator = Locator::new(&mesh);
    let m = options.margin_voxels * 0.999;
    let size = DVec3::from_array(dims.map(|n| n as f64));
    for p in (0..dims[0] * dims[1] * dims[2]).filter(|&i| held(i)).map(|i| voxel(dims, i)) {
        for corner in 0..9 {
            let sign = DVec3::from_array([0, 1, 2].map(|a| if corner >> a & 1 == 0 { -m } else { m }));
            let q = if corner == 8 { p } else { p + sign };
            let beyond = q.cmplt(DVec3::splat(-0.498)).any() || q.cmpgt(size - 0.502).any();
            if !(options.clip && beyond) {
                assert_eq!(locator.winding_number(frame.transform_point3(q)), 1, "{q}");
            }
        }
    }
    if options.clip {
        let (lo, hi) = (DVec3::splat(-0.5), size - 0.5);
        let back = frame.inverse();
        for p in mesh.positions.iter().map(|p| back.transform_point3(*p)) {
            assert!(p.cmpge(lo - 1e-9).all() && p.cmple(hi + 1e-9).all(), "{p} lies outside of the volume");
        }
    }
    (mesh, r)
}

#[test]
fn a_ball_is_enclosed_closely_by_about_the_wanted_number_of_triangles() {
    let c = DVec3::splat(31.5);
    for target in [500, 2000, 6000] {
        let o = ProxyOptions { target_triangles: target, ..ProxyOptions::default() };
        let (mesh, r) = proxy([64; 3], &DAffine3::IDENTITY, |p| p.distance(c) < 20.0, &o);
        let ratio = r.triangles as f64 / target as f64;
        assert!((0.75..1.35).contains(&ratio), "{} of {target}", r.triangles);
        assert_eq!((r.euler, r.components), (2, 1));
        // the lattice step is about sqrt(3 area / triangles); the proxy should not be farther than that
        let step = (3.0 * 4.0 * std::f64::consts::PI * 400.0 / target as f64).sqrt();
        let far = mesh.positions.iter().map(|p| p.distance(c)).fold(0.0, f64::max);
        assert!(far > 20.0 && far < 21.8 + step, "{far} with steps of {step}");
        // smooth: neighbours of a ball's triangle are nearly in its plane
        let n = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            (b - a).cross(c - a).normalize()
        };
        let topology = voxclay::mesh::Topology::build(mesh.positions.len(), &mesh.triangles);
        let bends: Vec<f64> = topology
            .edge_triangles
            .iter()
            .map(|t| n(&mesh.triangles[t[0] as usize]).dot(n(&mesh.triangles[t[1] as usize])))
            .collect();
        let mean = bends.iter().sum::<f64>() / bends.len() as f64;
        assert!(mean > 1.0 - 8.0 / target as f64, "{mean}");
    }
}

#[test]
fn one_voxel_and_a_full_volume() {
    for clip in [true, false] {
        let o = ProxyOptions { clip, ..options() };
        let id = DAffine3::IDENTITY;
        for (mesh, volume) in [
            (proxy([1; 3], &id, |_| true, &o).1, if clip { 0.999..1.001 } else { 8.0..20.0 }),
            (proxy([40; 3], &id, |p| p == DVec3::new(5.0, 6.0, 7.0), &o).1, 8.0..20.0),
            (proxy([16, 12, 20], &id, |_| true, &o).1, if clip { 3839.0..3841.0 } else { 5000.0..10000.0 }),
            (proxy([1, 30, 1], &id, |_| true, &o).1, if clip { 29.9..30.1 } else { 124.0..600.0 }),
        ] {
            assert!(volume.contains(&mesh.volume), "{}", mesh.volume);
            assert_eq!((mesh.euler, mesh.components), (2, 1));
        }
    }
}

#[test]
fn parts_rings_and_cavities_keep_their_number_but_cavities_are_filled() {
    let id = DAffine3::IDENTITY;
    let c = DVec3::splat(23.5);
    let o = options();
    let (_, two) = proxy([48; 3], &id, |p| p.distance(c + 11.0) < 8.0 || p.distance(c - 11.0) < 8.0, &o);
    assert_eq!((two.components, two.euler), (2, 4));
    let ring = |p: DVec3| {
        let q = p - c;
        (q.truncate().length() - 15.0).hypot(q.z) < 4.0
    };
    assert_eq!(proxy([48; 3], &id, ring, &o).1.euler, 0);
    let (mesh, shell) = proxy([48; 3], &id, |p| (p.distance(c) - 16.0).abs() < 1.5, &o);
    assert_eq!((shell.components, shell.euler), (1, 2));
    assert_eq!(Locator::new(&mesh).winding_number(c), 1);
}

#[test]
fn what_lies_at_the_sides_is_cut_flat_or_gone_round() {
    let corner = DVec3::new(0.0, 10.0, 47.0);
    for clip in [true, false] {
        let o = ProxyOptions { clip, ..options() };
        let (_, r) = proxy([48; 3], &DAffine3::IDENTITY, |p| p.distance(corner) < 20.0, &o);
        let (lo, hi) = r.bounds.expect("not empty");
        assert_eq!((r.euler, r.components), (2, 1));
        if clip {
            assert_eq!((lo.x, lo.y, hi.z), (-0.5, -0.5, 47.5));
        } else {
            assert!(lo.x < -1.0 && lo.y < -1.0 && hi.z > 48.0);
        }
    }
}

#[test]
fn thin_spikes_noise_and_touching_corners_are_enclosed() {
    let id = DAffine3::IDENTITY;
    let o = options();
    // three thin bars, a checkerboard, single voxels scattered, a thin diagonal line, and a slab one voxel thick
    let thin = |x: f64| usize::from(x.abs() < 1.0);
    proxy([41; 3], &id, |p| thin(p.x - 20.0) + thin(p.y - 20.0) + thin(p.z - 20.0) >= 2, &o);
    proxy([12; 3], &id, |p| (p.x + p.y + p.z) % 2.0 == 0.0, &o);
    let hash = |p: DVec3| {
        ((p.x * 7919.0 + p.y * 104_729.0 + p.z * 1_299_709.0) as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40
    };
    proxy([30; 3], &id, |p| hash(p) % 500 == 0, &o);
    proxy([40; 3], &id, |p| p.x == p.y && p.y == p.z, &o);
    proxy([40, 40, 1], &id, |p| p.x + p.y < 30.0, &o);
    proxy([40, 40, 1], &id, |p| p.x + p.y < 30.0, &ProxyOptions { clip: false, ..o });
}

#[test]
fn thick_oblique_and_mirrored_frames_give_the_same_solidity() {
    let shape = |p: DVec3| ((p - DVec3::new(30.0, 25.0, 6.0)) / DVec3::new(26.0, 20.0, 5.0)).length() < 1.0;
    for (z, shear) in [(6.5, 0.0), (-6.5, 0.0), (6.5, 0.3)] {
        let m = DMat3::from_cols(DVec3::new(0.7, 0.0, 0.0), DVec3::new(shear, 0.8, 0.0), DVec3::new(0.0, 0.0, z));
        let frame = DAffine3::from_mat3_translation(DMat3::from_rotation_x(0.3) * m, DVec3::new(5.0, 6.0, 7.0));
        let (mesh, r) = proxy([61, 51, 13], &frame, shape, &options());
        assert!(mesh.volume() > 0.0 && r.euler == 2);
    }
}

#[test]
fn the_margin_and_the_smoothing_do_what_they_say() {
    let c = DVec3::splat(20.0);
    let ball = |p: DVec3| p.distance(c) < 8.0;
    let volume = |o: ProxyOptions| proxy([41; 3], &DAffine3::IDENTITY, ball, &o).1.volume;
    let o = options();
    let near = volume(ProxyOptions { margin_voxels: 0.0, ..o });
    let far = volume(ProxyOptions { margin_voxels: 4.0, ..o });
    assert!(near < volume(o) && volume(o) < far, "{near} {far}");
    let rough = proxy([41; 3], &DAffine3::IDENTITY, ball, &ProxyOptions { smoothing: 0, ..o }).1;
    let smooth = proxy([41; 3], &DAffine3::IDENTITY, ball, &o).1;
    // of two closed surfaces the rougher has more area for its volume
    let excess = |r: &MeshReport| r.area.powi(3) / (36.0 * std::f64::consts::PI * r.volume.powi(2));
    assert!(excess(&rough) > excess(&smooth) && excess(&smooth) < 1.05, "{} {}", excess(&rough), excess(&smooth));
}

#[test]
fn the_same_voxels_give_the_same_mesh() {
    let make = || proxy([30; 3], &DAffine3::IDENTITY, |p| p.x * p.y > 200.0, &options()).0;
    assert_eq!(make(), make());
}

#[test]
fn what_cannot_be_enclosed_is_a_plain_error() {
    let id = DAffine3::IDENTITY;
    let o = options();
    let e = enclose([4; 3], &id, |_| false, &o).expect_err("nothing");
    assert_eq!(e, ProxyError::NothingInside);
    assert_eq!(
        e.to_string(),
        "no voxel is above the isovalue, so there is nothing to enclose; choose a lower isovalue"
    );
    assert_eq!(enclose([4, 0, 4], &id, |_| true, &o), Err(ProxyError::EmptyGrid(4, 0, 4)));
    for margin in [-1.0, f64::INFINITY] {
        let o = ProxyOptions { margin_voxels: margin, ..o };
        assert_eq!(enclose([4; 3], &id, |_| true, &o), Err(ProxyError::Margin(margin)));
    }
    let flat = DAffine3::from_mat3(DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0)));
    assert_eq!(enclose([4; 3], &flat, |_| true, &o), Err(ProxyError::Singular));
    let nan = DAffine3::from_translation(DVec3::new(f64::NAN, 0.0, 0.0));
    assert_eq!(enclose([4; 3], &nan, |_| true, &o), Err(ProxyError::Singular));
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn real_volumes_are_enclosed() {
    // raw data read plainly, so that this test does not depend on the readers of volumes
    let frame = DAffine3::from_mat3(DMat3::from_diagonal(DVec3::new(0.0078, 0.0078, 0.0247)));
    let values = std::fs::read("../shared/data/volumes/pelvis_f.raw").expect("there");
    let dims = [221, 271, 69];
    let mesh = enclose(dims, &frame, |i| values[i] > 100, &options()).expect("a proxy");
    let r = MeshReport::of(&mesh);
    assert!(r.is_clean_solid(), "{:?}", r.defects());
    let locator = Locator::new(&mesh);
    for i in (0..values.len()).filter(|&i| values[i] > 100).step_by(101) {
        assert_eq!(locator.winding_number(frame.transform_point3(voxel(dims, i))), 1);
    }
}

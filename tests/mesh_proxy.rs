//! The automatic proxy.

use glam::{DAffine3, DMat3, DVec3};
use voxclay::mesh::TriMesh;
use voxclay::mesh::check::MeshReport;
use voxclay::mesh::locate::Locator;
use voxclay::mesh::proxy::{ProxyError, ProxyOptions, enclose};

fn voxel(dims: [usize; 3], i: usize) -> DVec3 {
    DVec3::new((i % dims[0]) as f64, (i / dims[0] % dims[1]) as f64, (i / (dims[0] * dims[1])) as f64)
}

fn proxy(
    name: &str,
    dims: [usize; 3],
    frame: &DAffine3,
    inside: impl Fn(DVec3) -> bool + Sync,
    options: &ProxyOptions,
) -> (TriMesh, MeshReport) {
    let t = std::time::Instant::now();
    let held = |i: usize| inside(voxel(dims, i));
    let mesh = enclose(dims, frame, held, options).expect("a proxy");
    let t = t.elapsed();
    let r = MeshReport::of(&mesh);
    println!(
        "{name}: {t:?} {} triangles, euler {} comps {} volume {:.1} {:?}",
        r.triangles, r.euler, r.components, r.volume, r.bounds
    );
    assert!(r.is_clean_solid(), "{:?}", r.defects());
    let locator = Locator::new(&mesh);
    for i in 0..dims[0] * dims[1] * dims[2] {
        if held(i) {
            assert_eq!(locator.winding_number(frame.transform_point3(voxel(dims, i))), 1);
        }
    }
    (mesh, r)
}

#[test]
fn try_some() {
    let id = DAffine3::IDENTITY;
    let o = ProxyOptions::default();
    let c = DVec3::splat(31.5);
    let (m, _) = proxy("ball", [64; 3], &id, |p| p.distance(c) < 20.0, &o);
    voxclay::io::write_surface(std::path::Path::new("/tmp/ball.obj"), &m).unwrap();
    for clip in [true, false] {
        let o = ProxyOptions { clip, ..o };
        proxy("one voxel", [1; 3], &id, |_| true, &o);
        proxy("one voxel in 64", [64; 3], &id, |p| p == DVec3::new(5.0, 6.0, 7.0), &o);
        proxy("full", [32; 3], &id, |_| true, &o);
        proxy("slab", [64, 64, 1], &id, |p| p.x + p.y < 50.0, &o);
        proxy("border ball", [64; 3], &id, |p| p.distance(DVec3::new(0.0, 10.0, 63.0)) < 30.0, &o);
        proxy("two", [64; 3], &id, |p| p.distance(c + 15.0) < 10.0 || p.distance(c - 15.0) < 10.0, &o);
        proxy("shell", [64; 3], &id, |p| (p.distance(c) - 20.0).abs() < 2.0, &o);
        proxy(
            "ring",
            [64; 3],
            &id,
            |p| {
                let q = p - c;
                let r = q.truncate().length() - 20.0;
                r * r + q.z * q.z < 16.0
            },
            &o,
        );
        proxy(
            "noise",
            [40; 3],
            &id,
            |p| (p.x * 12.9898 + p.y * 78.233 + p.z * 37.719).sin() * 43758.5453 % 1.0 > 0.98,
            &o,
        );
        proxy(
            "cross",
            [80; 3],
            &id,
            |p| {
                let q = p - 40.0;
                (q.x.abs() < 2.0) as u8 + (q.y.abs() < 2.0) as u8 + (q.z.abs() < 2.0) as u8 >= 2
            },
            &o,
        );
    }
    let frame = DAffine3::from_mat3_translation(
        DMat3::from_rotation_x(0.3) * DMat3::from_diagonal(DVec3::new(0.7, 0.8, -6.5)),
        DVec3::new(5.0, 6.0, 7.0),
    );
    proxy(
        "thick",
        [100, 90, 12],
        &frame,
        |p| ((p - DVec3::new(50.0, 45.0, 6.0)) / DVec3::new(45.0, 40.0, 5.0)).length() < 1.0,
        &o,
    );
    let _ = ProxyError::NothingInside;
}

//! The warp through a deformed tetrahedral mesh: against a search over all tetrahedra in `f64`, and by its properties.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use voxclay::mesh::tet_lattice::{Split, tet_lattice};
use voxclay::mesh::tets::{TetMesh, signed_volume};
use voxclay::volume::sampling::{Interpolation, Sampler};
use voxclay::volume::{Grid, Rescale, Samples, Volume};
use voxclay::warp::{Culling, Tally, Warp, WarpError, WarpOptions};

fn grid(dims: [usize; 3], origin: [f64; 3]) -> Grid {
    Grid::aligned(dims, DVec3::ONE, DVec3::from(origin)).unwrap()
}

/// Numbers in -1..1 that are the same in every run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

fn noise(dims: [usize; 3], seed: u64) -> Volume {
    let mut numbers = Numbers(seed);
    let samples = (0..dims.iter().product()).map(|_| (20_000.0 + 20_000.0 * numbers.next()) as u16 + 1).collect();
    Volume::new(grid(dims, [0.0; 3]), 1, Samples::U16(samples))
}

/// A lattice over all samples of a volume.
fn over(dims: [usize; 3], cells: [usize; 3], split: Split) -> TetMesh {
    let size = DVec3::from(dims.map(|n| (n.max(2) - 1) as f64));
    tet_lattice(&DAffine3::from_scale(size), cells, split).unwrap()
}

fn turned(mesh: &TetMesh, about: DVec3, degrees: [f64; 2]) -> Vec<DVec3> {
    let turn = DQuat::from_rotation_x(degrees[1].to_radians()) * DQuat::from_rotation_z(degrees[0].to_radians());
    mesh.points.iter().map(|p| turn * (*p - about) + about).collect()
}

/// The grid around points, of unit spacing at whole coordinates.
fn around(points: &[DVec3]) -> Grid {
    let (lo, hi) = voxclay::mesh::tets::bounds(points).unwrap();
    let (lo, hi) = (lo.floor() - 1.0, hi.ceil() + 1.0);
    grid((hi - lo).to_array().map(|v| v as usize + 1), lo.to_array())
}

fn samples(v: &Volume) -> Vec<f64> {
    (0..v.samples.len()).map(|i| v.samples.get(i)).collect()
}

/// For each voxel of the output the lowest tetrahedron that holds it and the rest position there.
fn search(output: &Grid, mesh: &TetMesh, moved: &[DVec3]) -> Vec<Option<(usize, DVec3)>> {
    let inverse: Vec<_> = mesh
        .tets
        .iter()
        .map(|t| {
            let p = TetMesh::corners(*t, moved);
            let edges = DMat3::from_cols(p[1] - p[0], p[2] - p[0], p[3] - p[0]);
            (edges.determinant().abs() > 1e-12).then(|| (p[0], edges.inverse(), TetMesh::corners(*t, &mesh.points)))
        })
        .collect();
    let [nx, ny, nz] = output.dims;
    let voxel = |i: usize| DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / nx / ny) as f64);
    (0..nx * ny * nz)
        .map(|i| {
            let p = output.world_from_voxel.transform_point3(voxel(i));
            inverse.iter().enumerate().find_map(|(t, tet)| {
                let (corner, inverse, rest) = tet.as_ref()?;
                let b = *inverse * (p - *corner);
                let inside = b.min_element() >= -1e-9 && b.element_sum() <= 1.0 + 1e-9;
                let at = rest[0] + (rest[1] - rest[0]) * b.x + (rest[2] - rest[0]) * b.y + (rest[3] - rest[0]) * b.z;
                inside.then_some((t, at))
            })
        })
        .collect()
}

/// Warps, and compares every voxel with the search.
fn check(volume: &Volume, mesh: &TetMesh, moved: &[DVec3], output: &Grid) -> Tally {
    let warp = Warp::new(&volume.grid, output, &mesh.tets, &mesh.points, moved).unwrap();
    let options = WarpOptions::default();
    let (made, tally) = warp.volume(volume, output, &options).unwrap();
    let Samples::U16(stored) = &volume.samples else { panic!("the tests' volumes are u16") };
    let sampler = Sampler::new(stored, volume.grid.dims, volume.channels);
    let found = search(output, mesh, moved);
    let from_world = volume.grid.voxel_from_world();
    for (i, (value, found)) in samples(&made).into_iter().zip(&found).enumerate() {
        let expected = found.and_then(|(_, p)| {
            // what rounding moved just out of the texture cube is at its edge
            let p = from_world.transform_point3(p);
            let last = DVec3::from(volume.grid.dims.map(|n| n as f64 - 0.5));
            let edge = p.max(DVec3::splat(-0.5)).min(last);
            sampler.linear(if p.distance(edge) < 1e-9 { edge } else { p })
        });
        let expected = expected.map_or(0.0, |v| v[0]);
        assert!((value - expected).abs() < 2.5, "voxel {i}: {value} instead of {expected}");
    }
    assert_eq!(tally.written, found.iter().flatten().count() as u64);
    // the paper's ways of finding voxels give the same picture
    for culling in [Culling::None, Culling::Cells { size: 8 }, Culling::Cells { size: 3 }] {
        let (same, other) = warp.volume(volume, output, &WarpOptions { culling, ..options }).unwrap();
        // rows that are cut in another way round differently
        let off = samples(&made).iter().zip(samples(&same)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off <= 1.0, "{culling:?} differs by {off}");
        let blank = |v: &Volume| samples(v).iter().map(|v| *v == 0.0).collect::<Vec<_>>();
        assert!(blank(&made) == blank(&same), "{culling:?} writes other voxels");
        assert_eq!((other.written, other.covered_twice), (tally.written, tally.covered_twice));
        assert!(other.candidates >= other.written + other.repeated);
        if let Culling::Cells { .. } = culling {
            assert!(other.cells_kept <= other.cells);
        }
    }
    let (reference, _) = warp.volume(volume, output, &WarpOptions { reference: true, ..options }).unwrap();
    let off = samples(&made).iter().zip(samples(&reference)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off <= 2.0, "{off} from the f64 look-ups");
    tally
}

#[test]
fn nothing_moved_is_a_copy() {
    // every face, edge and corner of the lattice lies on voxels
    for split in [Split::Five, Split::Six] {
        let volume = noise([13, 9, 17], 5);
        let mesh = over(volume.grid.dims, [3, 2, 4], split);
        let tally = check(&volume, &mesh, &mesh.points, &volume.grid);
        assert_eq!((tally.written, tally.covered_twice, tally.beyond), (13 * 9 * 17, 0, 0));
        let warp = Warp::new(&volume.grid, &volume.grid, &mesh.tets, &mesh.points, &mesh.points).unwrap();
        let (made, _) = warp.volume(&volume, &volume.grid, &WarpOptions::default()).unwrap();
        assert!(made.samples == volume.samples);
        let jacobian = warp.facts().jacobian.unwrap();
        assert!(jacobian.iter().all(|j| (j - 1.0).abs() < 1e-12));
    }
}

#[test]
fn whole_voxel_shifts_are_copies() {
    let volume = noise([8, 7, 6], 6);
    let mesh = over(volume.grid.dims, [2, 2, 2], Split::Six);
    let shift = DVec3::new(3.0, -2.0, 5.0);
    let moved: Vec<_> = mesh.points.iter().map(|p| *p + shift).collect();
    let output = grid(volume.grid.dims, shift.to_array());
    let warp = Warp::new(&volume.grid, &output, &mesh.tets, &mesh.points, &moved).unwrap();
    let (made, tally) = warp.volume(&volume, &output, &WarpOptions::default()).unwrap();
    assert!(made.samples == volume.samples);
    assert_eq!(tally.written, 8 * 7 * 6);
    check(&volume, &mesh, &moved, &grid([14, 12, 15], [0.0, -3.0, 0.0]));
}

#[test]
fn turned_by_45_degrees_twice() {
    let volume = noise([16, 16, 16], 1);
    for split in [Split::Five, Split::Six] {
        let mesh = over(volume.grid.dims, [3, 3, 3], split);
        let moved = turned(&mesh, DVec3::splat(7.5), [45.0, 45.0]);
        let tally = check(&volume, &mesh, &moved, &around(&moved));
        assert_eq!(tally.covered_twice, 0);
    }
}

#[test]
fn jittered_lattices_leave_no_crack() {
    let mut numbers = Numbers(77);
    for round in 0..6 {
        let volume = noise([14, 11, 12], round);
        let mesh = over(volume.grid.dims, [3, 2, 3], if round % 2 == 0 { Split::Five } else { Split::Six });
        let moved: Vec<_> = mesh
            .points
            .iter()
            .map(|p| {
                let q = *p + 0.9 * numbers.vector();
                // quarters: many faces run through voxel centres
                if round < 3 { (q * 4.0).round() / 4.0 } else { q }
            })
            .collect();
        let output = around(&moved);
        let tally = check(&volume, &mesh, &moved, &output);
        assert_eq!(tally.covered_twice, 0, "round {round}");
        let solid: f64 = mesh.tets.iter().map(|t| signed_volume(TetMesh::corners(*t, &moved))).sum();
        assert!((tally.written as f64 - solid).abs() < 0.2 * solid + 300.0);
    }
}

#[test]
fn oblique_grids_on_both_sides() {
    let mut volume = noise([12, 10, 9], 3);
    let turn = DQuat::from_scaled_axis(DVec3::new(0.3, -0.5, 0.8));
    let frame = DAffine3::from_scale_rotation_translation(DVec3::new(0.7, 1.3, 2.0), turn, DVec3::new(5.0, -3.0, 40.0));
    volume.grid = Grid::new(volume.grid.dims, frame, volume.grid.space).unwrap();
    let size = DAffine3::from_scale(DVec3::new(11.0, 9.0, 8.0));
    let mesh = tet_lattice(&(frame * size), [2, 3, 2], Split::Five).unwrap();
    let moved: Vec<_> = mesh.points.iter().map(|p| *p + DVec3::new(0.2 * p.y, 0.0, 0.1 * p.x)).collect();
    let tilt = DQuat::from_scaled_axis(DVec3::new(-0.2, 0.1, 0.4));
    // mirrored: a left-handed output
    let scale = DVec3::new(-0.9, 0.8, 1.1);
    let center = moved.iter().sum::<DVec3>() / moved.len() as f64;
    let out = DAffine3::from_scale_rotation_translation(scale, tilt, DVec3::ZERO);
    let out = DAffine3::from_translation(center - out.transform_vector3(DVec3::splat(12.0))) * out;
    let output = Grid::new([25, 25, 25], out, volume.grid.space).unwrap();
    let tally = check(&volume, &mesh, &moved, &output);
    assert!(tally.written > 1000);
}

#[test]
fn a_mesh_reaching_beyond_the_volume_and_the_grid() {
    let volume = noise([10, 10, 10], 9);
    let mesh = tet_lattice(
        &DAffine3::from_scale_rotation_translation(DVec3::splat(20.0), DQuat::IDENTITY, DVec3::splat(-5.3)),
        [2, 2, 2],
        Split::Six,
    )
    .unwrap();
    let moved = turned(&mesh, DVec3::splat(4.7), [20.0, 10.0]);
    let tally = check(&volume, &mesh, &moved, &grid([9, 12, 10], [1.0, -4.0, 2.0]));
    assert!(tally.beyond > 0 && tally.beyond < tally.written);
    // what lies in a tetrahedron but comes from beyond the volume gets the outside value like what lies in none
    let output = grid([9, 12, 10], [1.0, -4.0, 2.0]);
    let warp = Warp::new(&volume.grid, &output, &mesh.tets, &mesh.points, &moved).unwrap();
    let by =
        |outside| samples(&warp.volume(&volume, &output, &WarpOptions { outside, ..Default::default() }).unwrap().0);
    let (low, high) = (by(7.0), by(9.0));
    assert!(low.iter().zip(&high).all(|(a, b)| a == b || (*a == 7.0 && *b == 9.0)));
    let missed = low.iter().zip(&high).filter(|(a, b)| a != b).count() as u64;
    assert_eq!(missed, tally.beyond + output.len() as u64 - tally.written);
    // no voxel at all
    let warp = Warp::new(&volume.grid, &grid([3, 3, 3], [90.0; 3]), &mesh.tets, &mesh.points, &moved).unwrap();
    let (made, tally) =
        warp.volume(&volume, &grid([3, 3, 3], [90.0; 3]), &WarpOptions { outside: 7.0, ..Default::default() }).unwrap();
    assert!(samples(&made).iter().all(|v| *v == 7.0));
    assert_eq!(tally, Tally::default());
}

#[test]
fn overlaps_and_inside_out_are_counted() {
    let volume = noise([12, 12, 12], 4);
    let mut mesh = over(volume.grid.dims, [2, 2, 2], Split::Six);
    let sound = check(&volume, &mesh, &mesh.points.clone(), &volume.grid);
    assert_eq!(sound.covered_twice, 0);
    // one more tetrahedron, in the midst of the others
    let first = mesh.points.len() as u32;
    let corners = [[3.2, 3.1, 3.3], [8.2, 3.4, 3.2], [3.1, 8.3, 3.4], [3.3, 3.2, 8.1]].map(DVec3::from);
    mesh.points.extend(corners);
    mesh.tets.push([first, first + 1, first + 2, first + 3]);
    let tally = check(&volume, &mesh, &mesh.points.clone(), &volume.grid);
    let within = search(&volume.grid, &TetMesh::new(corners.to_vec(), vec![[0, 1, 2, 3]]), &corners);
    assert_eq!(tally.covered_twice, within.iter().flatten().count() as u64);
    mesh.tets.pop();
    // the middle point is pulled through the wall
    let mut moved = mesh.points.clone();
    let middle = moved.iter().position(|p| *p == DVec3::splat(5.5)).unwrap();
    moved[middle] = DVec3::new(5.5, 5.5, 15.0);
    let output = around(&moved);
    let warp = Warp::new(&volume.grid, &output, &mesh.tets, &mesh.points, &moved).unwrap();
    assert!(warp.facts().inverted > 0 && warp.facts().jacobian.unwrap()[0] < 0.0);
    assert!(check(&volume, &mesh, &moved, &output).covered_twice > 0);
    // without volume: left out, and what it held is not covered
    moved[middle] = DVec3::new(5.5, 5.5, 11.0);
    let warp = Warp::new(&volume.grid, &output, &mesh.tets, &mesh.points, &moved).unwrap();
    assert!(warp.facts().degenerate > 0);
    check(&volume, &mesh, &moved, &output);
}

#[test]
fn every_type_and_channel() {
    let dims = [9, 8, 7];
    let count = dims.iter().product::<usize>();
    let mesh = over(dims, [2, 2, 2], Split::Five);
    let moved = turned(&mesh, DVec3::splat(4.0), [25.0, -35.0]);
    let output = around(&moved);
    let mut numbers = Numbers(12);
    for channels in [1, 2, 3, 4] {
        let values: Vec<f64> = (0..count * channels).map(|_| (100.0 * numbers.next()).round()).collect();
        let whole = |v: &f64| v.abs();
        for stored in [
            Samples::U8(values.iter().map(|v| whole(v) as u8).collect()),
            Samples::I8(values.iter().map(|v| *v as i8).collect()),
            Samples::U16(values.iter().map(|v| whole(v) as u16 * 600).collect()),
            Samples::I16(values.iter().map(|v| *v as i16 * 300).collect()),
            Samples::U32(values.iter().map(|v| whole(v) as u32 * 40_000_000).collect()),
            Samples::I32(values.iter().map(|v| *v as i32 * 20_000_000).collect()),
            Samples::F32(values.iter().map(|v| *v as f32 * 0.01).collect()),
            Samples::F64(values.iter().map(|v| *v * 1e9).collect()),
        ] {
            let largest = (0..stored.len()).map(|i| stored.get(i).abs()).fold(0.0, f64::max);
            let volume = Volume::new(grid(dims, [0.0; 3]), channels, stored);
            let warp = Warp::new(&volume.grid, &output, &mesh.tets, &mesh.points, &moved).unwrap();
            for interpolation in Interpolation::ALL {
                let options = WarpOptions { interpolation, ..Default::default() };
                let (fast, tally) = warp.volume(&volume, &output, &options).unwrap();
                let (reference, _) =
                    warp.volume(&volume, &output, &WarpOptions { reference: true, ..options }).unwrap();
                let off =
                    samples(&fast).iter().zip(samples(&reference)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                let step = if volume.samples.scalar_type().name().starts_with('f') { 0.0 } else { 1.0 };
                assert!(off <= step + 1e-5 * largest, "{:?} {channels}: {off}", volume.samples.scalar_type());
                assert!(tally.written > 300);
            }
        }
    }
}

#[test]
fn labels_stay_labels_and_cubic_does_not_overshoot() {
    let dims = [15, 14, 13];
    let labels: Vec<u8> = (0..dims.iter().product::<usize>()).map(|i| if i / 5 % 3 == 0 { 200 } else { 17 }).collect();
    let volume = Volume::new(grid(dims, [0.0; 3]), 1, Samples::U8(labels));
    let mesh = over(dims, [3, 3, 3], Split::Six);
    let moved = turned(&mesh, DVec3::splat(7.0), [31.0, 12.0]);
    let output = around(&moved);
    let warp = Warp::new(&volume.grid, &output, &mesh.tets, &mesh.points, &moved).unwrap();
    let options = |interpolation| WarpOptions { interpolation, ..Default::default() };
    let (made, _) = warp.volume(&volume, &output, &options(Interpolation::Nearest)).unwrap();
    assert!(samples(&made).iter().all(|v| [0.0, 17.0, 200.0].contains(v)));
    let (made, _) = warp.volume(&volume, &output, &options(Interpolation::Cubic)).unwrap();
    assert!(samples(&made).iter().all(|v| *v == 0.0 || (17.0..=200.0).contains(v)));
}

#[test]
fn density_keeps_the_sum() {
    // a smooth blob well inside, stretched by 1.7 and squeezed by 0.8: the sum of values times voxel volume stays
    let dims = [24, 24, 24];
    let blob = |i: usize| {
        let p = DVec3::new((i % 24) as f64, (i / 24 % 24) as f64, (i / 576) as f64) - 11.5;
        (1000.0 * (-p.length_squared() / 18.0).exp()) as f32
    };
    let volume = Volume::new(grid(dims, [0.0; 3]), 1, Samples::F32((0..24 * 24 * 24).map(blob).collect()));
    let mesh = over(dims, [4, 4, 4], Split::Five);
    let moved: Vec<_> = mesh.points.iter().map(|p| DVec3::new(1.7 * p.x, 0.8 * p.y, p.z + 0.3 * p.x)).collect();
    let output = around(&moved);
    let warp = Warp::new(&volume.grid, &output, &mesh.tets, &mesh.points, &moved).unwrap();
    let (made, _) = warp.volume(&volume, &output, &WarpOptions { density: true, ..Default::default() }).unwrap();
    let sum = |v: &Volume| samples(v).iter().sum::<f64>();
    assert!((sum(&made) / sum(&volume) - 1.0).abs() < 2e-3, "{} {}", sum(&made), sum(&volume));
    let (plain, _) = warp.volume(&volume, &output, &WarpOptions::default()).unwrap();
    assert!((sum(&plain) / sum(&volume) - 1.36).abs() < 5e-3);
}

#[test]
fn what_is_not_a_number_stays_where_it_is() {
    let mut values = vec![1.0f32; 10 * 10 * 10];
    values[555] = f32::NAN;
    let volume = Volume::new(grid([10, 10, 10], [0.0; 3]), 1, Samples::F32(values));
    let mesh = over([10, 10, 10], [2, 2, 2], Split::Six);
    let warp = Warp::new(&volume.grid, &volume.grid, &mesh.tets, &mesh.points, &mesh.points).unwrap();
    let (made, _) = warp.volume(&volume, &volume.grid, &WarpOptions::default()).unwrap();
    let Samples::F32(made) = made.samples else { panic!() };
    assert_eq!(made.iter().filter(|v| v.is_nan()).count(), 1);
    assert!(made[555].is_nan());
}

#[test]
fn threads_do_not_change_the_result() {
    let volume = noise([30, 20, 40], 8);
    let mesh = over(volume.grid.dims, [4, 3, 5], Split::Five);
    let moved = turned(&mesh, DVec3::splat(12.0), [33.0, 21.0]);
    let output = around(&moved);
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let warp = Warp::new(&volume.grid, &output, &mesh.tets, &mesh.points, &moved).unwrap();
            warp.volume(&volume, &output, &WarpOptions::default()).unwrap()
        })
    };
    let (one, tally) = run(1);
    for threads in [2, 3, 7] {
        let (other, same) = run(threads);
        assert!(one.samples == other.samples);
        assert_eq!(tally, same);
    }
}

#[test]
fn tiny_volumes_and_slivers() {
    for dims in [[1, 1, 1], [2, 1, 3], [1, 5, 1]] {
        let volume = noise(dims, 2);
        let mesh = tet_lattice(
            &DAffine3::from_scale_rotation_translation(
                DVec3::from(dims.map(|n| n as f64)),
                DQuat::IDENTITY,
                DVec3::splat(-0.5),
            ),
            [1, 1, 1],
            Split::Five,
        )
        .unwrap();
        let tally = check(&volume, &mesh, &mesh.points, &volume.grid);
        assert_eq!(tally.written, dims.iter().product::<usize>() as u64);
    }
    // needles and flat ones: lattice points pushed almost onto each other
    let volume = noise([12, 12, 12], 21);
    let mesh = over(volume.grid.dims, [3, 3, 3], Split::Six);
    let mut numbers = Numbers(5);
    let moved: Vec<_> = mesh
        .points
        .iter()
        .map(|p| {
            let inner = p.min_element() > 0.1 && p.max_element() < 10.9;
            let flat = if inner { DVec3::new(p.x, p.y, 5.5 + 1e-5 * (p.z - 5.5)) } else { *p };
            flat + 1e-7 * numbers.vector()
        })
        .collect();
    check(&volume, &mesh, &moved, &around(&moved));
}

#[test]
fn slope_and_intercept_go_along() {
    let mut volume = noise([5, 5, 5], 1);
    volume.rescale = Rescale { slope: -2.0, intercept: 9.0 };
    let mesh = over([5, 5, 5], [1, 1, 1], Split::Five);
    let warp = Warp::new(&volume.grid, &volume.grid, &mesh.tets, &mesh.points, &mesh.points).unwrap();
    let (made, _) = warp.volume(&volume, &volume.grid, &WarpOptions::default()).unwrap();
    assert_eq!(made.rescale, volume.rescale);
    assert!(made.samples == volume.samples);
}

#[test]
fn impossible_input_is_named() {
    let g = grid([4, 4, 4], [0.0; 3]);
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let fails =
        |tets: &[[u32; 4]], rest: &[DVec3], moved: &[DVec3]| Warp::new(&g, &g, tets, rest, moved).err().unwrap();
    assert_eq!(fails(&[], &points, &points), WarpError::Empty);
    assert_eq!(fails(&[[0, 1, 2, 3]], &points, &points[1..]), WarpError::Points { rest: 4, deformed: 3 });
    assert_eq!(fails(&[[0, 1, 2, 4]], &points, &points), WarpError::Index { tet: 0, point: 4, points: 4 });
    let mut bad = points.clone();
    bad[2].y = f64::NAN;
    assert_eq!(fails(&[[0, 1, 2, 3]], &points, &bad), WarpError::NotFinite(2));
    let warp = Warp::new(&g, &g, &[[0, 1, 2, 3]], &points, &points).unwrap();
    let volume = noise([4, 4, 4], 1);
    let options = WarpOptions { culling: Culling::Cells { size: 0 }, ..Default::default() };
    assert_eq!(warp.volume(&volume, &g, &options).err(), Some(WarpError::CellSize(0)));
    let Samples::U16(stored) = &volume.samples else { panic!() };
    let input = Sampler::new(stored, [4, 4, 4], 1);
    let exact = warp.candidates(Culling::Exact).unwrap();
    let short = warp.run(&exact, input, &WarpOptions::default(), &mut [0u16; 5]);
    assert_eq!(short.err(), Some(WarpError::Output { voxels: 64, channels: 1, samples: 5 }));
    // points flung to the end of the world: nothing is drawn, and nothing breaks
    let far: Vec<_> = points.iter().map(|p| *p * 1e300).collect();
    let warp = Warp::new(&g, &g, &[[0, 1, 2, 3]], &points, &far).unwrap();
    let (_, tally) = warp.volume(&volume, &g, &WarpOptions::default()).unwrap();
    assert!(tally.written == 0 || warp.facts().degenerate == 0);
}

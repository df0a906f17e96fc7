//! The warp on the GPU against the CPU's: the same voxels, the same counts, and values that differ by one unit at most.
//!
//! Without a graphics driver these tests show as ignored (see `build.rs`); with one that does not open they fail.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use glam::{DAffine3, DQuat, DVec3};
use voxclay::gpu::{Gpu, Preference, WarpGpuError, WarpLimits, WarpPass};
use voxclay::mesh::tet_lattice::{Split, tet_lattice};
use voxclay::mesh::tets::{TetMesh, bounds};
use voxclay::volume::sampling::Interpolation;
use voxclay::volume::{Grid, Rescale, Samples, Scalar, ScalarType, Volume};
use voxclay::warp::{Culling, Tally, Warp, WarpOptions};

fn gpu() -> Arc<Gpu> {
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    GPU.get_or_init(|| Arc::new(Gpu::open(Preference::Any).expect("a graphics driver is installed"))).clone()
}

fn pass() -> &'static WarpPass {
    static PASS: OnceLock<WarpPass> = OnceLock::new();
    PASS.get_or_init(|| WarpPass::new(&gpu()).unwrap())
}

const CULLINGS: [Culling; 4] = [Culling::Exact, Culling::None, Culling::Cells { size: 8 }, Culling::Cells { size: 3 }];

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

fn grid(dims: [usize; 3], origin: [f64; 3]) -> Grid {
    Grid::aligned(dims, DVec3::ONE, DVec3::from(origin)).unwrap()
}

/// Noise over most of a type's range, and never 0: neighbours have nothing to do with each other.
fn noise(dims: [usize; 3], t: ScalarType, channels: usize) -> Volume {
    fn fill<T: Scalar>(count: usize, [lo, hi]: [f64; 2]) -> Samples {
        let mut numbers = Numbers(count as u64);
        let value = |_| {
            let v = (0.5 * (lo + hi) + 0.5 * (hi - lo) * numbers.next()).round();
            T::from_f64(if v == 0.0 { 1.0 } else { v })
        };
        T::wrap((0..count).map(value).collect())
    }
    let count = dims.iter().product::<usize>() * channels;
    let samples = match t {
        ScalarType::U8 => fill::<u8>(count, [1.0, 255.0]),
        ScalarType::I8 => fill::<i8>(count, [-128.0, 127.0]),
        ScalarType::U16 => fill::<u16>(count, [1.0, 65535.0]),
        ScalarType::I16 => fill::<i16>(count, [-32768.0, 32767.0]),
        ScalarType::U32 => fill::<u32>(count, [1.0, 1e6]),
        ScalarType::I32 => fill::<i32>(count, [-1e6, 1e6]),
        ScalarType::F32 => fill::<f32>(count, [-1000.0, 1000.0]),
        ScalarType::F64 => fill::<f64>(count, [-1000.0, 1000.0]),
    };
    let mut made = Volume::new(grid(dims, [0.0; 3]), channels, samples);
    made.rescale = Rescale { slope: 0.5, intercept: -3.0 };
    made
}

/// A lattice over all samples of a volume.
fn over(dims: [usize; 3], cells: [usize; 3], split: Split) -> TetMesh {
    let size = DVec3::from(dims.map(|n| (n.max(2) - 1) as f64));
    tet_lattice(&DAffine3::from_scale(size), cells, split).unwrap()
}

/// The grid around points, of unit spacing at whole coordinates.
fn around(points: &[DVec3]) -> Grid {
    let (lo, hi) = bounds(points).unwrap();
    let (lo, hi) = (lo.floor() - 1.0, hi.ceil() + 1.0);
    grid((hi - lo).to_array().map(|v| v as usize + 1), lo.to_array())
}

fn turned(mesh: &TetMesh, about: DVec3, degrees: [f64; 2]) -> Vec<DVec3> {
    let turn = DQuat::from_rotation_x(degrees[1].to_radians()) * DQuat::from_rotation_z(degrees[0].to_radians());
    mesh.points.iter().map(|p| turn * (*p - about) + about).collect()
}

/// Warps on both, and compares every sample and every count.
fn same(pass: &WarpPass, volume: &Volume, warp: &Warp, output: &Grid, options: &WarpOptions) -> Tally {
    let (cpu, want) = warp.volume(volume, output, &WarpOptions { reference: true, ..*options }).unwrap();
    let (made, tally) = pass.volume(&gpu(), warp, volume, output, options).unwrap();
    assert_eq!(tally, want, "{options:?}");
    assert_eq!((made.grid, made.channels, made.rescale), (cpu.grid, cpu.channels, cpu.rescale));
    assert_eq!(made.samples.scalar_type(), cpu.samples.scalar_type());
    let label = options.interpolation == Interpolation::Nearest && !options.density;
    for i in 0..cpu.samples.len() {
        let (a, b) = (made.samples.get(i), cpu.samples.get(i));
        let limit = match volume.samples {
            _ if label => 0.0,
            // values of a thousand, to the rounding of `f32`, and so much more as densities scale them
            Samples::F32(_) | Samples::F64(_) => 1e-3 * (1.0 + 1e-3 * b.abs()),
            _ => 1.0,
        };
        assert!((a - b).abs() <= limit, "sample {i} is {a} instead of {b} with {options:?}");
    }
    tally
}

/// With every culling and both look-ups; the last tally of [`Culling::Exact`].
fn all_the_same(pass: &WarpPass, volume: &Volume, mesh: &TetMesh, moved: &[DVec3], output: &Grid) -> Tally {
    let warp = Warp::new(&volume.grid, output, &mesh.tets, &mesh.points, moved).unwrap();
    let mut exact = None;
    for culling in CULLINGS {
        for interpolation in [Interpolation::Linear, Interpolation::Nearest] {
            // not a value of the noise, so that what is written in only one of both stands out
            let options = WarpOptions { culling, interpolation, outside: 0.0, ..WarpOptions::default() };
            let tally = same(pass, volume, &warp, output, &options);
            let exact = exact.get_or_insert(tally);
            let counts = |t: &Tally| (t.written, t.repeated, t.covered_twice, t.beyond);
            assert_eq!(counts(&tally), counts(exact));
        }
    }
    exact.unwrap()
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn nothing_moved_is_a_copy() {
    // every face, edge and corner of the lattice lies on voxels
    for split in [Split::Five, Split::Six] {
        for t in ScalarType::ALL {
            let volume = noise([13, 9, 17], t, 1);
            let mesh = over(volume.grid.dims, [3, 2, 4], split);
            let warp = Warp::new(&volume.grid, &volume.grid, &mesh.tets, &mesh.points, &mesh.points).unwrap();
            let (made, tally) = pass().volume(&gpu(), &warp, &volume, &volume.grid, &WarpOptions::default()).unwrap();
            assert!(made.samples == volume.samples, "{t:?}");
            assert_eq!((tally.written, tally.covered_twice, tally.beyond), (13 * 9 * 17, 0, 0));
        }
        let volume = noise([13, 9, 17], ScalarType::U16, 1);
        let mesh = over(volume.grid.dims, [3, 2, 4], split);
        let tally = all_the_same(pass(), &volume, &mesh, &mesh.points, &volume.grid);
        assert!(tally.repeated > 500, "ties were met");
    }
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn half_voxels_are_ties_of_the_look_up() {
    // at half the spacing, and moved by half a voxel: nearest samples and the edge of the input hang on a rounding
    let volume = noise([11, 12, 9], ScalarType::U16, 1);
    let region = DAffine3::from_scale_rotation_translation(DVec3::splat(12.0), DQuat::IDENTITY, DVec3::splat(-0.5));
    let mesh = tet_lattice(&region, [3, 3, 3], Split::Six).unwrap();
    let third = DVec3::new(1.0 / 3.0, 0.1, 0.7);
    let moved: Vec<_> = mesh.points.iter().map(|p| *p + third).collect();
    let output = Grid::aligned([27, 27, 27], DVec3::splat(0.5), third - 0.5).unwrap();
    let tally = all_the_same(pass(), &volume, &mesh, &moved, &output);
    assert!(tally.beyond > 0 && tally.written > tally.beyond);
    // of 25 voxels each, those from -1/2 to n - 1/2
    assert_eq!(tally.written - tally.beyond, 23 * 25 * 19);
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn turned_and_jittered_lattices_agree() {
    let mut numbers = Numbers(77);
    for round in 0..6 {
        let volume = noise([19, 14, 16], ScalarType::U16, 1);
        let mesh = over(volume.grid.dims, [3, 2, 3], if round % 2 == 0 { Split::Five } else { Split::Six });
        let mut moved = turned(&mesh, DVec3::splat(7.5), [[45.0, 45.0], [0.0, 0.0], [90.0, 0.0]][round % 3]);
        for p in &mut moved {
            let q = *p + 0.9 * numbers.vector();
            // quarters: many faces run through voxel centres
            *p = if round < 3 { (q * 4.0).round() / 4.0 } else { q };
        }
        let tally = all_the_same(pass(), &volume, &mesh, &moved, &around(&moved));
        assert_eq!(tally.covered_twice, 0, "round {round}");
        assert!(tally.written > 2000);
    }
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn slivers_overlaps_and_inside_out_agree() {
    let volume = noise([16, 16, 16], ScalarType::I16, 1);
    let mut mesh = over(volume.grid.dims, [3, 3, 3], Split::Six);
    let mut numbers = Numbers(5);
    // points pulled through the walls: folds, some of them nearly flat
    let moved: Vec<_> = mesh.points.iter().map(|p| *p + 5.0 * numbers.vector()).collect();
    let tally = all_the_same(pass(), &volume, &mesh, &moved, &around(&moved));
    assert!(tally.covered_twice > 500);

    // slivers: needles and flat ones, down to no volume at all, in the midst of the others
    let mut moved = mesh.points.clone();
    for i in 0..40 {
        let first = moved.len() as u32;
        let thin = 10f64.powi(-(i % 10));
        let [a, b, c, d] = std::array::from_fn(|_| DVec3::splat(7.5) + 7.0 * numbers.vector());
        // half of them on whole voxels
        let snap = |p: DVec3| if i % 2 == 0 { p.round() } else { p };
        let (a, b) = (snap(a), snap(b));
        let flat = [a, b, snap(c), snap(a + b - c) + thin * d];
        let needle = [a, a + thin * (c - a), a + thin * (d - a), b];
        let corners = if i % 4 < 2 { flat } else { needle };
        mesh.points.extend([a, b, c, d]);
        moved.extend(corners);
        // the first to be found, so that their voxels are theirs
        mesh.tets.insert(0, std::array::from_fn(|k| first + k as u32));
    }
    let output = around(&moved);
    let warp = Warp::new(&volume.grid, &output, &mesh.tets, &mesh.points, &moved).unwrap();
    for culling in CULLINGS {
        // what is stretched a million times magnifies the rounding of positions: which voxels, not which values
        let options = WarpOptions { culling, outside: 0.0, ..WarpOptions::default() };
        let (cpu, want) = warp.volume(&volume, &output, &options).unwrap();
        let (made, tally) = pass().volume(&gpu(), &warp, &volume, &output, &options).unwrap();
        assert_eq!(tally, want, "{culling:?}");
        let off = |i: usize| (made.samples.get(i) - cpu.samples.get(i)).abs() > 1.0;
        let wrong = (0..cpu.samples.len()).filter(|i| off(*i)).count();
        assert!(wrong <= 2, "{wrong} values differ with {culling:?}");
    }
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn beyond_the_volume_and_the_grid() {
    let volume = noise([10, 10, 10], ScalarType::U8, 1);
    let region = DAffine3::from_scale_rotation_translation(DVec3::splat(20.0), DQuat::IDENTITY, DVec3::splat(-5.3));
    let mesh = tet_lattice(&region, [2, 2, 2], Split::Six).unwrap();
    let moved = turned(&mesh, DVec3::splat(4.7), [20.0, 10.0]);
    let tally = all_the_same(pass(), &volume, &mesh, &moved, &grid([9, 12, 10], [1.0, -4.0, 2.0]));
    assert!(tally.beyond > 0 && tally.beyond < tally.written);
    // no tetrahedron reaches the grid
    let far = grid([3, 3, 3], [90.0; 3]);
    let warp = Warp::new(&volume.grid, &far, &mesh.tets, &mesh.points, &moved).unwrap();
    let options = WarpOptions { outside: 7.0, ..WarpOptions::default() };
    let (made, tally) = pass().volume(&gpu(), &warp, &volume, &far, &options).unwrap();
    assert!((0..27).all(|i| made.samples.get(i) == 7.0) && tally == Tally::default());
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn flat_and_single_voxel_volumes() {
    for dims in [[1, 1, 1], [1, 6, 1], [5, 1, 4], [2, 2, 2]] {
        let volume = noise(dims, ScalarType::F32, 1);
        let region = DAffine3::from_scale_rotation_translation(DVec3::splat(7.0), DQuat::IDENTITY, DVec3::splat(-1.0));
        let mesh = tet_lattice(&region, [2, 1, 2], Split::Five).unwrap();
        let moved = turned(&mesh, DVec3::ZERO, [30.0, 0.0]);
        let tally = all_the_same(pass(), &volume, &mesh, &moved, &around(&moved));
        assert!(tally.written > tally.beyond);
        all_the_same(pass(), &volume, &mesh, &mesh.points, &grid([1, 1, 1], [0.0; 3]));
    }
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn every_type_and_number_of_channels() {
    for t in ScalarType::ALL {
        for channels in 1..=4 {
            let volume = noise([9, 8, 7], t, channels);
            let mesh = over(volume.grid.dims, [2, 2, 2], Split::Five);
            // odd sizes, so that the last word is not full
            let moved: Vec<_> = turned(&mesh, DVec3::splat(4.0), [20.0, 35.0]).iter().map(|p| *p * 1.1).collect();
            let output = around(&moved);
            let warp = Warp::new(&volume.grid, &output, &mesh.tets, &mesh.points, &moved).unwrap();
            for interpolation in [Interpolation::Linear, Interpolation::Nearest] {
                let options = WarpOptions { interpolation, outside: 3.0, ..WarpOptions::default() };
                let tally = same(pass(), &volume, &warp, &output, &options);
                assert!(tally.written > 300);
                let whole = matches!(t, ScalarType::U32 | ScalarType::I32 | ScalarType::F64);
                if !whole {
                    same(pass(), &volume, &warp, &output, &WarpOptions { density: true, ..options });
                }
            }
        }
    }
}

/// A NaN stays where it is, and does not spread to voxels that lie on its neighbours.
#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn samples_without_weight_are_not_read() {
    let mut volume = noise([6, 6, 6], ScalarType::F32, 1);
    let Samples::F32(v) = &mut volume.samples else { panic!("floats were asked for") };
    v[2 * 36 + 2 * 6 + 2] = f32::INFINITY;
    v[3 * 36 + 3 * 6 + 4] = f32::NAN;
    let mesh = over([6, 6, 6], [2, 2, 2], Split::Six);
    let warp = Warp::new(&volume.grid, &volume.grid, &mesh.tets, &mesh.points, &mesh.points).unwrap();
    let (made, _) = pass().volume(&gpu(), &warp, &volume, &volume.grid, &WarpOptions::default()).unwrap();
    for i in 0..216 {
        let (a, b) = (made.samples.get(i), volume.samples.get(i));
        assert!(a == b || a.is_nan() && b.is_nan(), "sample {i} is {a} instead of {b}");
    }
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn bricks_and_windows_make_the_same_volume() {
    let all = WarpLimits::of(gpu().limits());
    let narrow = [
        // slabs, cut rows, few tetrahedra
        WarpLimits { voxels: 3000, ..all },
        WarpLimits { side: 7, tets: 60, ..all },
        // the input in pieces, of which few fit on the device
        WarpLimits { texture_side: 9, ..all },
        WarpLimits { texture_bytes: 700, resident_bytes: 1500, voxels: 4000, ..all },
        // many small dispatches
        WarpLimits { dispatch: Duration::ZERO, ..all },
    ];
    for (t, channels) in [(ScalarType::U8, 1), (ScalarType::U8, 3), (ScalarType::U16, 1), (ScalarType::F32, 4)] {
        let volume = noise([17, 19, 13], t, channels);
        let mesh = over(volume.grid.dims, [4, 3, 2], Split::Six);
        let moved = turned(&mesh, DVec3::splat(8.0), [25.0, 40.0]);
        let output = around(&moved);
        let warp = Warp::new(&volume.grid, &output, &mesh.tets, &mesh.points, &moved).unwrap();
        for limits in narrow {
            let small = WarpPass::with_limits(&gpu(), limits).unwrap();
            for culling in [Culling::Exact, Culling::Cells { size: 8 }] {
                let interpolation = if channels == 1 { Interpolation::Linear } else { Interpolation::Nearest };
                let options = WarpOptions { culling, interpolation, outside: 2.0, ..WarpOptions::default() };
                let (whole, want) = pass().volume(&gpu(), &warp, &volume, &output, &options).unwrap();
                let (made, tally) = small.volume(&gpu(), &warp, &volume, &output, &options).unwrap();
                assert_eq!(tally, want);
                assert!(made.samples == whole.samples, "{t:?} x{channels} within {limits:?}");
            }
        }
    }
}

/// The share of tested voxels that are written, and what the masks leave of the cells.
#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn most_tested_voxels_are_written() {
    for n in [24, 48, 96] {
        let volume = noise([n; 3], ScalarType::U8, 1);
        let mesh = over(volume.grid.dims, [4, 4, 4], Split::Six);
        let moved = turned(&mesh, DVec3::splat(n as f64 / 2.0), [45.0, 45.0]);
        let output = around(&moved);
        let warp = Warp::new(&volume.grid, &output, &mesh.tets, &mesh.points, &moved).unwrap();
        let rate = |culling| {
            let options = WarpOptions { culling, ..WarpOptions::default() };
            let tally = same(pass(), &volume, &warp, &output, &options);
            println!("{n}: {culling:?} {tally:?}");
            tally.written as f64 / tally.candidates as f64
        };
        let [exact, cells, none] = [Culling::Exact, Culling::Cells { size: 4 }, Culling::None].map(rate);
        // cells are whole, and larger than the smallest tetrahedra here
        assert!(exact >= 0.9 && exact > 2.0 * none && (n < 96 || cells > 1.5 * none), "{exact} {cells} {none}");
    }
}

#[test]
#[cfg_attr(not(gpu_adapter), ignore = "needs a graphics driver (Mesa's lavapipe will do)")]
fn what_is_left_to_the_cpu_is_refused() {
    let dims = [4, 4, 4];
    let mesh = over(dims, [1, 1, 1], Split::Six);
    let refused = |volume: &Volume, options: WarpOptions| {
        let warp = Warp::new(&volume.grid, &volume.grid, &mesh.tets, &mesh.points, &mesh.points).unwrap();
        pass().volume(&gpu(), &warp, volume, &volume.grid, &options).map(|_| ()).unwrap_err()
    };
    let plain = WarpOptions::default();
    let fine = noise(dims, ScalarType::U8, 1);
    let cubic = refused(&fine, WarpOptions { interpolation: Interpolation::Cubic, ..plain });
    assert_eq!(cubic.to_string(), "cubic interpolation is not done on the GPU; use --backend cpu");
    assert!(matches!(refused(&fine, WarpOptions { reference: true, ..plain }), WarpGpuError::Unsupported(_)));
    let mut values = vec![0i32; 64];
    values[50] = -2_000_000;
    let coarse = Volume::new(grid(dims, [0.0; 3]), 1, Samples::I32(values));
    assert!(matches!(refused(&coarse, plain), WarpGpuError::Unsupported(_)));
    let cells = refused(&fine, WarpOptions { culling: Culling::Cells { size: 0 }, ..plain });
    assert!(matches!(cells, WarpGpuError::Warp(_)));
    // an output of another size than was prepared
    let warp = Warp::new(&fine.grid, &fine.grid, &mesh.tets, &mesh.points, &mesh.points).unwrap();
    let other = grid([4, 4, 5], [0.0; 3]);
    assert!(matches!(pass().volume(&gpu(), &warp, &fine, &other, &plain), Err(WarpGpuError::Warp(_))));
}

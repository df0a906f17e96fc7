//! Export of 256^3 through displacement volumes on the CPU, two threads. Run it beside
//! `../shared/peers/job_e_dense.py --n 256 --only "numba B-spline FFD + trilinear x2"`.
//!
//! `cargo bench --bench export [-- EDGE [ROUNDS [reference]]]`

use glam::{DMat3, DQuat, DVec3};
use voxclay::deform::{Deformation, Deformer, DisplacementVolume, Extent, Prepared, Stack};
use voxclay::evaluate::export::{ExportOptions, ExportReport, GridChoice, Precision, export, unwatched};
use voxclay::math::Identity;
use voxclay::volume::{Grid, Samples, Volume};

/// Eight overlapping displacement volumes, one for each octant of a cube of `n` voxels, tilted, each `reach` times as
/// wide as the octant.
fn eight(n: f64, reach: f64) -> Prepared {
    let items = (0..8)
        .map(|o| {
            let sign = |bit: i32| if o >> bit & 1 == 0 { -1.0 } else { 1.0 };
            let center = DVec3::splat(0.5 * (n - 1.0)) + 0.25 * n * DVec3::new(sign(0), sign(1), sign(2));
            let turn = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.1, 0.2, 0.15) * (o as f64 - 3.5)));
            let half = 0.25 * n * reach;
            // the box reaches a third of its length before the displaced position and two thirds beyond
            let axis = turn * DVec3::Z;
            let vector = axis * (0.7 * 2.0 * half / 6.0);
            let displaced = center - axis * (half / 3.0);
            let extent = Extent { u: half, v: half, length: 2.0 * half };
            let pull = DisplacementVolume::new(displaced - vector, vector, extent, Some(turn * DVec3::X));
            Deformation::new("", Deformer::Displacement(pull.expect("a sound displacement volume")))
        })
        .collect();
    Stack { items }.prepared()
}

/// Waves with some noise, like the peers' volumes: the full range of u16.
fn waves(n: usize) -> Vec<u16> {
    let mut noise = 1u32;
    (0..n * n * n)
        .map(|v| {
            let (x, y, z) = ((v % n) as f32, (v / n % n) as f32, (v / n / n) as f32);
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let wave = (0.11 * x + 0.05 * z).sin() * (0.07 * y).cos() + (0.09 * z - 0.03 * x).sin();
            (20_000.0 + 8_000.0 * wave + (noise >> 20) as f32) as u16
        })
        .collect()
}

/// Processor time of this process in milliseconds: what counts where other programs share the machine. Linux only.
fn processor_ms() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
    let ticks: f64 = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    Some(ticks * 10.0)
}

fn report(
    name: &str,
    volume: &Volume,
    map: &dyn voxclay::evaluate::export::ExportMap,
    options: &ExportOptions,
    rounds: usize,
) {
    let run = || export(volume, map, options, &unwatched).expect("the export runs").1;
    run();
    let before = processor_ms();
    let mut runs: Vec<ExportReport> = (0..rounds).map(|_| run()).collect();
    let processor = processor_ms().zip(before).map_or(f64::NAN, |(a, b)| (a - b) / rounds as f64);
    runs.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    let (least, median) = (runs[0].ms, runs[runs.len() / 2].ms);
    let (moved, voxels) = (runs[0].moved as f64, runs[0].voxels as f64);
    println!(
        "{name:<44} median {median:7.1} ms, least {least:7.1} ms, processor {processor:7.1} ms; moved {:5.1} % of {:.1} M voxels, {:5.2} processor ns a voxel, {:6.2} a moved one, clipped {}",
        100.0 * moved / voxels,
        voxels * 1e-6,
        1e6 * processor / voxels,
        1e6 * processor / moved.max(1.0),
        runs[0].clipped
    );
}

fn main() {
    let numbers: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let n = numbers.first().copied().unwrap_or(256);
    let rounds = numbers.get(1).copied().unwrap_or(7).max(1);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("two threads");
    let grid = Grid::aligned([n; 3], DVec3::ONE, DVec3::ZERO).expect("a grid");
    let wide = waves(n);
    let narrow = Volume::new(grid, 1, Samples::U8(wide.iter().map(|v| (v >> 8) as u8).collect()));
    let wide = Volume::new(grid, 1, Samples::U16(wide));
    let same = ExportOptions { grid: GridChoice::Same, ..ExportOptions::default() };
    let edge = n as f64;
    pool.install(|| {
        report("identity, u16", &wide, &Identity, &same, rounds);
        report("eight volumes, half the grid, u16", &wide, &eight(edge, 0.8), &same, rounds);
        report("eight volumes, all of the grid, u8", &narrow, &eight(edge, 1.3), &same, rounds);
        report("eight volumes, all of the grid, u16", &wide, &eight(edge, 1.3), &same, rounds);
        let grown = ExportOptions { grid: GridChoice::SameGrown, ..same };
        report("  the same, grown", &wide, &eight(edge, 1.3), &grown, rounds);
        if !std::env::args().any(|a| a == "reference") {
            return;
        }
        let exact = ExportOptions { precision: Precision::Reference, ..same };
        report("  the same, reference", &wide, &eight(edge, 1.3), &exact, 1);
    });
}

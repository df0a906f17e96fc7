//! Reading and writing volumes of 256^3: median and minimum of a few rounds, beside the plain file copy of the same size.
//!
//! `cargo bench --bench io_volumes [-- ROUNDS]`

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use glam::DVec3;
use voxclay::io::{Encoding, WriteOptions, read_volume, write_volume};
use voxclay::volume::statistics::{histogram, statistics};
use voxclay::volume::{Grid, Samples, Volume};

fn time(label: &str, bytes: usize, rounds: usize, mut work: impl FnMut()) {
    let mut times: Vec<f64> = (0..rounds)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let median = times[times.len() / 2];
    let speed = bytes as f64 / 1e6 / median;
    println!("{label:<34} min {:8.2} ms  median {median:8.2} ms  {speed:7.2} GB/s", times[0]);
}

fn main() {
    // cargo passes --bench
    let rounds = std::env::args().skip(1).find_map(|a| a.parse().ok()).unwrap_or(7);
    let folder = tempfile::tempdir().expect("a folder for the files");
    let n = 256usize;
    // smooth with a little noise, as scans are
    let value = |i: usize| {
        let (x, y, z) = (i % n, i / n % n, i / n / n);
        let r = ((x.abs_diff(128).pow(2) + y.abs_diff(128).pow(2) + z.abs_diff(128).pow(2)) as f64).sqrt();
        let noise = (i as u32).wrapping_mul(2_654_435_761) >> 29;
        (1000.0 * (r / 9.0).sin().max(0.0)) as u16 + noise as u16
    };
    let grid = Grid::aligned([n; 3], DVec3::ONE, DVec3::ZERO).expect("a sound grid");
    let u16s = Volume::new(grid, 1, Samples::U16((0..grid.len()).map(value).collect()));
    let u8s = Volume::new(grid, 1, Samples::U8((0..grid.len()).map(|i| (value(i) / 5) as u8).collect()));
    for (kind, volume) in [("u8", &u8s), ("u16", &u16s)] {
        let bytes = volume.samples.bytes().len();
        let plain = folder.path().join("plain");
        std::fs::write(&plain, volume.samples.bytes()).expect("room for a file");
        time(&format!("{kind} std::fs::read"), bytes, rounds, || {
            drop(black_box(std::fs::read(&plain).expect("readable")))
        });
        for (name, encoding) in [
            ("v.raw", Encoding::Raw),
            ("v.nrrd", Encoding::Raw),
            ("v.nii", Encoding::Raw),
            ("v.nrrd", Encoding::Compressed),
            ("v.mha", Encoding::Compressed),
            ("v.nii.gz", Encoding::Compressed),
            ("v.nrrd", Encoding::Text),
        ] {
            let path = folder.path().join(name);
            let path: &Path = &path;
            let rounds = if encoding == Encoding::Raw { rounds } else { rounds.min(3) };
            time(&format!("{kind} write {name} {encoding:?}"), bytes, rounds, || {
                write_volume(path, volume, &WriteOptions { encoding }).expect("written");
            });
            let size = std::fs::metadata(path).expect("there").len();
            time(&format!("{kind} read  {name} ({} MB)", size / 1_000_000), bytes, rounds, || {
                black_box(read_volume(path).expect("read"));
            });
        }
        time(&format!("{kind} statistics"), bytes, rounds, || _ = black_box(statistics(volume)));
        time(&format!("{kind} histogram"), bytes, rounds, || drop(black_box(histogram(volume, 0, 0.0, 1010.0, 256))));
    }
}

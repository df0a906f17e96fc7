//! Volume files: what is written comes back, foreign files are understood, damaged ones are refused.

mod damage;
mod foreign;
mod real;
mod round_trip;
mod series;

use std::io::Write;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DQuat, DVec3};
use voxclay::volume::{Grid, Samples, Scalar, ScalarType, Space, Volume};

/// A folder that goes away with the test.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        // over the old content: a file emptied first is flushed to the disk by some systems, which takes long
        let mut file = std::fs::OpenOptions::new().write(true).create(true).truncate(false).open(&path).unwrap();
        file.write_all(content.as_ref()).unwrap();
        file.set_len(content.as_ref().len() as u64).unwrap();
        path
    }

    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            std::fs::read_dir(self.0.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

/// Samples with every bit drawn by chance, so that NaNs of all kinds come up.
fn random_samples(scalar: ScalarType, count: usize, seed: u64) -> Samples {
    let mut state = seed;
    let mut next = move || {
        // splitmix64
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    };
    match scalar {
        ScalarType::U8 => Samples::U8((0..count).map(|_| next() as u8).collect()),
        ScalarType::I8 => Samples::I8((0..count).map(|_| next() as i8).collect()),
        ScalarType::U16 => Samples::U16((0..count).map(|_| next() as u16).collect()),
        ScalarType::I16 => Samples::I16((0..count).map(|_| next() as i16).collect()),
        ScalarType::U32 => Samples::U32((0..count).map(|_| next() as u32).collect()),
        ScalarType::I32 => Samples::I32((0..count).map(|_| next() as i32).collect()),
        ScalarType::F32 => Samples::F32(
            (0..count)
                .map(|i| if i % 5 == 0 { f32::from_bits(0x7fa0_0001) } else { f32::from_bits(next() as u32) })
                .collect(),
        ),
        ScalarType::F64 => Samples::F64(
            (0..count)
                .map(|i| if i % 5 == 0 { f64::from_bits(0xfff4_0000_0000_0007) } else { f64::from_bits(next()) })
                .collect(),
        ),
    }
}

/// A turned, mirrored or sheared frame.
fn frame(kind: usize, spacing: DVec3, origin: DVec3) -> DAffine3 {
    let rotation = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.7, 2.9));
    let axes = match kind % 5 {
        0 => DMat3::IDENTITY,
        1 => DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0)),
        2 => rotation,
        3 => rotation * DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0)),
        _ => rotation * DMat3::from_cols(DVec3::X, DVec3::new(0.6, 0.8, 0.0), DVec3::new(0.0, -0.28, 0.96)),
    };
    DAffine3::from_mat3_translation(axes * DMat3::from_diagonal(spacing), origin)
}

fn volume(scalar: ScalarType, channels: usize, dims: [usize; 3], frame: DAffine3, space: Space, seed: u64) -> Volume {
    let grid = Grid::new(dims, frame, space).unwrap();
    Volume::new(grid, channels, random_samples(scalar, grid.len() * channels, seed))
}

/// The plainest volume there is, for tests of something else.
fn plain<T: Scalar>(dims: [usize; 3], samples: Vec<T>) -> Volume {
    Volume::new(Grid::aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap(), 1, T::wrap(samples))
}

/// Largest difference of two frames' entries.
fn frame_gap(a: &Grid, b: &Grid) -> f64 {
    let (a, b) = (a.world_from_voxel.to_cols_array(), b.world_from_voxel.to_cols_array());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Largest entry of a frame.
fn frame_scale(g: &Grid) -> f64 {
    g.world_from_voxel.to_cols_array().iter().fold(0.0, |m: f64, v| m.max(v.abs()))
}

/// An error must be one line that begins with a file's path and then says something.
fn check_sentence(error: &voxclay::io::IoError, folder: &Path) {
    let text = error.to_string();
    assert!(text.starts_with(folder.to_str().unwrap()), "names no file: {text}");
    assert!(!text.contains('\n') && !text.contains('\0'), "not one line: {text:?}");
    let (_, what) = text.split_once(": ").expect("says what is wrong");
    assert!(what.len() > 15 && what.len() < 400, "too short or too long: {text}");
}

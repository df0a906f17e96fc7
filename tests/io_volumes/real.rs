//! The real volumes: their facts as other programs found them, and the way through every format and back.

use std::path::PathBuf;

use glam::{DMat3, DVec3};
use voxclay::io::{Encoding, WriteOptions, read_grid, read_volume, write_volume};
use voxclay::volume::statistics::statistics;
use voxclay::volume::{ScalarType, Space, Volume};

use super::{Folder, frame_gap, frame_scale};

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data/volumes").join(name)
}

struct Facts {
    name: &'static str,
    dims: [usize; 3],
    scalar: ScalarType,
    space: Space,
    spacing: [f64; 3],
    /// Where the README gives it; a digit of it is enough.
    origin: Option<[f64; 3]>,
    /// Diagonal signs of an axis-aligned direction, or `None` for an oblique one.
    signs: Option<[f64; 3]>,
    min: f64,
    max: f64,
    mean: f64,
}

const fn facts(
    name: &'static str,
    dims: [usize; 3],
    scalar: ScalarType,
    space: Space,
    spacing: [f64; 3],
    [min, max, mean]: [f64; 3],
) -> Facts {
    Facts { name, dims, scalar, space, spacing, origin: None, signs: Some([1.0; 3]), min, max, mean }
}

/// From the README of the data: min, max and mean are real values.
fn all() -> Vec<Facts> {
    use ScalarType::{F32, I16, U8};
    use Space::{Lps, Ras};
    let one = [1.0; 3];
    vec![
        Facts {
            origin: Some([-104.0, -128.0, -112.0]),
            ..facts("ct_head.nii.gz", [208, 256, 225], U8, Ras, one, [0.0, 0.9996, 0.13])
        },
        Facts {
            signs: None,
            ..facts("ct_head_tilted.nii.gz", [175, 248, 58], U8, Ras, [0.8125, 0.8125, 2.397], [0.0, 255.0, 38.01])
        },
        Facts {
            origin: Some([-152.461, -148.986, -1432.0]),
            ..facts("ct_lung_hu_small.mha", [57, 78, 64], I16, Lps, [2.732, 2.732, 5.0], [-1130.0, 1379.0, -350.0])
        },
        facts("mri_head.nii.gz", [160, 232, 160], U8, Ras, [1.0, 0.8984, 0.8984], [0.0, 512.0, 111.8]),
        Facts { signs: None, ..facts("flair_oblique.nii.gz", [124, 160, 140], U8, Ras, one, [0.0, 255.0, 41.49]) },
        Facts { signs: None, ..facts("flair_oblique.nrrd", [124, 160, 140], U8, Lps, one, [0.0, 255.0, 41.49]) },
        facts("mni152_template.nii.gz", [193, 229, 193], I16, Ras, one, [0.0, 1570.0, 167.1]),
        Facts {
            signs: Some([1.0, -1.0, 1.0]),
            ..facts("mri_brain_thick.nrrd", [256, 256, 25], I16, Lps, [0.7812, 0.7812, 6.5], [0.0, 3057.0, 385.7])
        },
        Facts {
            origin: Some([-1.865, -0.969, -0.082]),
            ..facts("pelvis_f.mhd", [221, 271, 69], U8, Lps, [0.0078, 0.0078, 0.0247], [0.0, 226.0, 61.32])
        },
        facts("engine.nii.gz", [256, 256, 128], U8, Ras, one, [0.0, 255.0, 20.69]),
        Facts { origin: Some([0.0; 3]), ..facts("fuel.mha", [68, 68, 68], U8, Lps, one, [0.0, 255.0, 1.621]) },
        Facts { origin: Some([0.0; 3]), ..facts("nucleon.mha", [41, 41, 41], U8, Lps, one, [0.0, 249.0, 39.4]) },
        facts("avf_float32.nii.gz", [74, 93, 20], F32, Ras, [0.7227, 0.7227, 1.0], [0.0, 2510.0, 184.3]),
        facts("BallBinary30x30x30.nhdr", [30, 30, 30], I16, Lps, one, [0.0, 257.0, 136.4]),
    ]
}

/// Equal to the digits that the README prints.
fn printed(value: f64, fact: f64) -> bool {
    let digits = format!("{fact}").split_once('.').map_or(0, |(_, d)| d.len());
    // four significant digits at most
    let step = 10f64.powi(-(digits as i32)).max(10f64.powf(fact.abs().max(1e-9).log10().floor() - 3.0));
    (value - fact).abs() <= 0.51 * step
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn agree_with_their_facts() {
    for f in all() {
        let v = read_volume(&path(f.name)).unwrap();
        let name = f.name;
        assert_eq!((v.grid.dims, v.samples.scalar_type(), v.channels), (f.dims, f.scalar, 1), "{name}");
        assert_eq!(v.grid.space, f.space, "{name}");
        assert_eq!(read_grid(&path(f.name)).unwrap(), v.grid, "{name}");
        for i in 0..3 {
            let spacing = v.grid.spacing()[i];
            assert!((spacing - f.spacing[i]).abs() < 6e-5, "{name}: spacing {spacing}");
            if let Some(origin) = f.origin {
                assert!((v.grid.origin()[i] - origin[i]).abs() < 6e-4, "{name}: origin {}", v.grid.origin());
            }
        }
        let direction = v.grid.direction();
        match f.signs {
            Some(signs) => assert!(
                direction.abs_diff_eq(DMat3::from_diagonal(DVec3::from_array(signs)), 1e-7),
                "{name}: {direction}"
            ),
            None => assert!(!direction.abs_diff_eq(DMat3::IDENTITY, 0.1), "{name}"),
        }
        let s = statistics(&v);
        assert!(printed(s.min, f.min) && printed(s.max, f.max) && printed(s.mean, f.mean), "{name}: {s:?}");
        assert_eq!((s.count, s.nan), (v.samples.len() as u64, 0), "{name}");
    }
    // 16.5 and 19.0 degrees, as found by others
    let tilt = |name: &str| {
        let d = read_grid(&path(name)).unwrap().direction();
        // the largest angle between an axis of the grid and the nearest of the world
        (0..3).map(|i| d.col(i).abs().max_element().acos().to_degrees()).fold(0.0, f64::max)
    };
    assert!((tilt("ct_head_tilted.nii.gz") - 16.5).abs() < 0.06);
    assert!((tilt("flair_oblique.nii.gz") - 19.0).abs() < 0.06);
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn one_volume_in_two_formats_lies_in_one_place() {
    let (nii, nrrd) =
        (read_volume(&path("flair_oblique.nii.gz")).unwrap(), read_volume(&path("flair_oblique.nrrd")).unwrap());
    assert!(nii.samples == nrrd.samples);
    let gap = frame_gap(&nii.grid, &nrrd.grid.in_space(Space::Ras));
    assert!(gap < 5e-8, "{gap}");
    assert!(frame_gap(&nii.grid, &nrrd.grid) > 1.0, "the spaces differ");
}

fn same_samples(a: &Volume, b: &Volume) -> bool {
    a.grid.dims == b.grid.dims
        && a.samples.scalar_type() == b.samples.scalar_type()
        && a.samples.bytes() == b.samples.bytes()
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn go_through_every_format_and_back() {
    let folder = Folder::new();
    for f in all() {
        let v = read_volume(&path(f.name)).unwrap();
        for (name, encoding, precision) in [
            ("v.nrrd", Encoding::Compressed, 0.0),
            ("v.nhdr", Encoding::Raw, 0.0),
            ("v.mha", Encoding::Compressed, 1e-15),
            ("v.mhd", Encoding::Raw, 1e-15),
            ("v.nii", Encoding::Raw, 6e-8),
            ("v.nii.gz", Encoding::Compressed, 6e-8),
            ("v.raw", Encoding::Raw, 1e-15),
        ] {
            // compressing everything is for the small ones
            if encoding == Encoding::Compressed && v.samples.len() > 3_000_000 && name != "v.nii.gz" {
                continue;
            }
            let out = folder.path(name);
            write_volume(&out, &v, &WriteOptions { encoding }).unwrap();
            let back = read_volume(&out).unwrap();
            assert!(same_samples(&v, &back), "{} through {name}", f.name);
            // slopes of these files have 32 bits from the start
            assert_eq!(back.rescale, v.rescale, "{} through {name}", f.name);
            let wanted = v.grid.in_space(back.grid.space);
            let gap = frame_gap(&back.grid, &wanted);
            // what came from 32 bits goes into them again
            let precision = if f.name.contains(".nii") && name.starts_with("v.nii") { 0.0 } else { precision };
            assert!(gap <= precision * frame_scale(&wanted), "{} through {name}: {gap}", f.name);
        }
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn cut_at_any_length_they_are_refused() {
    let folder = Folder::new();
    for f in all() {
        let bytes = std::fs::read(path(f.name)).unwrap();
        let detached = f.name.ends_with("hdr") || f.name.ends_with("mhd");
        let n = bytes.len();
        let mut lengths = vec![0, 1, 2, 9, 10, 100, 200, 265, 300, 340, 352, 400, 600, 1000, n / 7, n - 9, n - 1];
        if n > 2_000_000 {
            // the long ones take long to inflate
            lengths.drain(14..16);
        }
        for length in lengths {
            // a detached header may do without its last line end
            if length >= n || detached && length > n - 3 {
                continue;
            }
            let file = folder.file(f.name, &bytes[..length]);
            let error = read_volume(&file).expect_err(&format!("{} cut to {length}", f.name));
            super::check_sentence(&error, folder.0.path());
        }
    }
    // data files shorter and longer than their headers say
    for (header, data) in [("pelvis_f.mhd", "pelvis_f.raw"), ("BallBinary30x30x30.nhdr", "BallBinary30x30x30.raw")] {
        folder.file(header, std::fs::read(path(header)).unwrap());
        let bytes = std::fs::read(path(data)).unwrap();
        for length in [0, 1, bytes.len() / 2, bytes.len() - 1] {
            folder.file(data, &bytes[..length]);
            let error = read_volume(&folder.path(header)).unwrap_err().to_string();
            assert!(error.contains("end after"), "{error}");
        }
        folder.file(data, [bytes.as_slice(), &[0; 3]].concat());
        let longer = read_volume(&folder.path(header));
        // HeaderSize = -1 says that the samples are the end of the file, whatever comes before
        assert_eq!(longer.is_ok(), header == "pelvis_f.mhd");
    }
}

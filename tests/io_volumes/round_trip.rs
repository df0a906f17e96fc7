//! What is written comes back: every sample bit for bit, the frame exactly or as near as the format allows.

use glam::DVec3;
use proptest::prelude::*;
use voxclay::io::{Encoding, WriteOptions, is_volume_path, read_grid, read_volume, write_volume};
use voxclay::volume::{Rescale, Samples, ScalarType, Space, Volume};

use super::{Folder, frame, frame_gap, frame_scale, plain, volume};

fn raw() -> WriteOptions {
    WriteOptions { encoding: Encoding::Raw }
}

fn compressed() -> WriteOptions {
    WriteOptions { encoding: Encoding::Compressed }
}

/// What a format keeps.
struct Keeps {
    name: &'static str,
    options: WriteOptions,
    /// The space that volumes of the format lie in, where it has only one.
    space: Option<Space>,
    /// Relative error of the frame's entries.
    frame: f64,
    /// Whether slope and intercept are kept in 32 bits.
    single: bool,
}

fn formats() -> Vec<Keeps> {
    let keeps = |name, options, space, frame, single| Keeps { name, options, space, frame, single };
    vec![
        keeps("v.nrrd", raw(), None, 0.0, false),
        keeps("v.nrrd", compressed(), None, 0.0, false),
        keeps("v.nhdr", raw(), None, 0.0, false),
        keeps("v.nhdr", compressed(), None, 0.0, false),
        keeps("v.mha", raw(), Some(Space::Lps), 1e-15, false),
        keeps("v.mha", compressed(), Some(Space::Lps), 1e-15, false),
        keeps("v.mhd", raw(), Some(Space::Lps), 1e-15, false),
        keeps("v.mhd", compressed(), Some(Space::Lps), 1e-15, false),
        // 24 bits, rounded
        keeps("v.nii", raw(), Some(Space::Ras), 6e-8, true),
        keeps("v.nii.gz", compressed(), Some(Space::Ras), 6e-8, true),
        keeps("v.raw", raw(), None, 1e-15, false),
        keeps("v.json", compressed(), None, 1e-15, false),
    ]
}

fn check(volume: &Volume, back: &Volume, keeps: &Keeps) {
    let name = keeps.name;
    assert_eq!(back.grid.dims, volume.grid.dims, "{name}");
    assert_eq!(back.channels, volume.channels, "{name}");
    assert_eq!(back.samples.scalar_type(), volume.samples.scalar_type(), "{name}");
    assert!(back.samples.bytes() == volume.samples.bytes(), "{name}: samples differ");
    if keeps.single {
        assert_eq!(back.rescale.slope as f32, volume.rescale.slope as f32);
        assert_eq!(back.rescale.intercept as f32, volume.rescale.intercept as f32);
    } else {
        assert_eq!(back.rescale, volume.rescale, "{name}");
    }
    let space = keeps.space.unwrap_or(volume.grid.space);
    assert_eq!(back.grid.space, space, "{name}");
    let wanted = volume.grid.in_space(space);
    let gap = frame_gap(&back.grid, &wanted);
    assert!(gap <= keeps.frame * frame_scale(&wanted), "{name}: frame is off by {gap}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn every_format_gives_back_what_was_written(
        scalar in 0usize..8,
        channels in 1usize..5,
        dims in prop::array::uniform3(1usize..9),
        spacing in prop::array::uniform3(1e-3f64..50.0),
        origin in prop::array::uniform3(-2e3f64..2e3),
        kind in 0usize..5,
        space in 0usize..3,
        rescale in prop::option::of((1e-4f64..50.0, -2e3f64..2e3)),
        seed in any::<u64>(),
    ) {
        let folder = Folder::new();
        let space = [Space::Unknown, Space::Ras, Space::Lps][space];
        let frame = frame(kind, DVec3::from_array(spacing), DVec3::from_array(origin));
        let mut v = volume(ScalarType::ALL[scalar], channels, dims, frame, space, seed);
        if let Some((slope, intercept)) = rescale {
            v.rescale = Rescale { slope, intercept };
        }
        for keeps in formats() {
            let path = folder.path(keeps.name);
            write_volume(&path, &v, &keeps.options).unwrap();
            check(&v, &read_volume(&path).unwrap(), &keeps);
            prop_assert_eq!(read_grid(&path).unwrap().dims, v.grid.dims);
        }
    }

    #[test]
    fn text_gives_back_every_value(
        scalar in 0usize..8, channels in 1usize..5, dims in prop::array::uniform3(1usize..6), seed in any::<u64>(),
    ) {
        let folder = Folder::new();
        let frame = frame(2, DVec3::ONE, DVec3::ZERO);
        let v = volume(ScalarType::ALL[scalar], channels, dims, frame, Space::Lps, seed);
        for name in ["v.nrrd", "v.nhdr", "v.mha", "v.mhd"] {
            let path = folder.path(name);
            let written = write_volume(&path, &v, &WriteOptions { encoding: Encoding::Text });
            if channels > 1 && name.starts_with("v.mh") {
                prop_assert!(written.unwrap_err().to_string().contains("several channels"));
                continue;
            }
            written.unwrap();
            let back = read_volume(&path).unwrap();
            // all bits but those of NaNs
            let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
            prop_assert!((0..v.samples.len()).all(|i| same(v.samples.get(i), back.samples.get(i))), "{}", name);
            prop_assert_eq!(back.samples.len(), v.samples.len());
        }
    }
}

/// The quaternion form that is written beside the matrix says the same; a sheared frame has none.
#[test]
fn both_forms_of_nifti_agree() {
    let folder = Folder::new();
    for kind in 0..5 {
        let frame = frame(kind, DVec3::new(0.7, 1.5, 2.25), DVec3::new(-20.0, 30.0, 5.5));
        let v = volume(ScalarType::U8, 1, [3, 4, 5], frame, Space::Lps, 5);
        let path = folder.path("v.nii");
        write_volume(&path, &v, &raw()).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        assert_eq!(bytes[254], 1);
        bytes[254] = 0;
        let back = read_volume(&folder.file("v.nii", bytes)).unwrap();
        if kind == 4 {
            assert_eq!(back.grid.space, Space::Unknown);
        } else {
            let gap = frame_gap(&back.grid, &v.grid.in_space(Space::Ras));
            assert!(gap < 3e-6, "kind {kind}: {gap}");
        }
    }
}

/// More than one piece of the parallel deflater, and of a size that is not a multiple of it.
#[test]
fn large_streams_are_whole() {
    let folder = Folder::new();
    let samples: Vec<u16> =
        (0..130 * 129 * 101u32).map(|i| (i / 7) as u16 ^ (i.wrapping_mul(2_654_435_761) >> 28) as u16).collect();
    let v = plain([130, 129, 101], samples);
    for name in ["v.nrrd", "v.mha", "v.nii.gz"] {
        let path = folder.path(name);
        write_volume(&path, &v, &compressed()).unwrap();
        assert!(
            std::fs::metadata(&path).unwrap().len() < v.samples.bytes().len() as u64 * 3 / 4,
            "{name} is compressed"
        );
        assert!(read_volume(&path).unwrap().samples == v.samples, "{name}");
    }
}

/// The streams are the same on any machine, and end where they should for a decoder that takes one member only.
#[test]
fn a_stream_does_not_depend_on_the_number_of_threads() {
    let folder = Folder::new();
    let v = plain([128, 128, 160], (0..128 * 128 * 160u32).map(|i| (i >> 5) as u8).collect());
    let on = |threads: usize| {
        let path = folder.path("v.nii.gz");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| write_volume(&path, &v, &compressed())).unwrap();
        std::fs::read(path).unwrap()
    };
    let stream = on(1);
    assert_eq!(stream, on(3));
    let mut out = Vec::new();
    let mut decoder = flate2::bufread::GzDecoder::new(stream.as_slice());
    std::io::Read::read_to_end(&mut decoder, &mut out).unwrap();
    assert_eq!(&out[352..], v.samples.bytes());
    assert!(decoder.into_inner().is_empty());
}

#[test]
fn what_a_format_cannot_hold_is_said_and_nothing_is_written() {
    let folder = Folder::new();
    let long = plain([32768, 1, 1], vec![0u8; 32768]);
    let text = WriteOptions { encoding: Encoding::Text };
    let mut faint = plain([1, 1, 1], vec![0u8]);
    faint.rescale.slope = 1e-60;
    for (name, v, options) in [
        ("v.nii", &long, raw()),
        ("v.nii.gz", &long, raw()),
        ("v.nii", &faint, raw()),
        ("v.nii", &plain([1, 1, 1], vec![0u8]), text),
        ("v.raw", &plain([1, 1, 1], vec![0u8]), text),
        ("v.hdr", &plain([1, 1, 1], vec![0u8]), raw()),
        ("v.vti", &plain([1, 1, 1], vec![0u8]), raw()),
        ("v", &plain([1, 1, 1], vec![0u8]), raw()),
        ("a\nb.mhd", &plain([1, 1, 1], vec![0u8]), raw()),
    ] {
        let error = write_volume(&folder.path(name), v, &options).unwrap_err();
        if !name.contains('\n') {
            super::check_sentence(&error, folder.0.path());
        }
    }
    assert!(folder.names().is_empty(), "{:?}", folder.names());
}

/// A pair of files appears whole or not at all.
#[test]
fn a_failed_pair_leaves_what_was_there() {
    let folder = Folder::new();
    let v = plain([2, 1, 1], vec![1u8, 2]);
    for (header, data) in [("v.nhdr", "v.raw"), ("v.mhd", "v.raw"), ("v.json", "v.raw")] {
        folder.file(header, "before");
        // a folder in the way of the data file
        std::fs::create_dir(folder.path(data)).unwrap();
        let error = write_volume(&folder.path(header), &v, &raw()).unwrap_err();
        assert!(error.to_string().contains(data), "{error}");
        assert_eq!(std::fs::read(folder.path(header)).unwrap(), b"before");
        assert_eq!(
            folder.names(),
            {
                let mut n = vec![header, data];
                n.sort();
                n
            },
            "nothing is left lying about"
        );
        std::fs::remove_dir(folder.path(data)).unwrap();
        std::fs::remove_file(folder.path(header)).unwrap();
    }
    let error = write_volume(&folder.path("nowhere/v.nrrd"), &v, &raw()).unwrap_err();
    assert!(error.to_string().contains("cannot write"), "{error}");
}

#[test]
fn names_tell_volumes() {
    for name in
        ["a.nrrd", "A.NRRD", "a.nhdr", "a.nii", "a.nii.gz", "a.hdr", "a.img", "a.mha", "a.MHD", "a.raw", "a.json"]
    {
        assert!(is_volume_path(name.as_ref()), "{name}");
    }
    for name in ["a.gz", "a.obj", "a.jsonl", "nrrd", "a.vti", "", "a.png"] {
        assert!(!is_volume_path(name.as_ref()), "{name}");
    }
}

#[test]
fn content_counts_where_a_name_misleads() {
    let folder = Folder::new();
    let v = plain([2, 2, 2], (1..9).map(|x| x as f32).collect());
    for (written, named) in [
        ("v.nrrd", "x.mha"),
        ("v.mha", "x.nii"),
        ("v.nii.gz", "x.nii"),
        ("v.nii", "x.nii.gz"),
        ("v.nii", "x.nrrd"),
        ("v.nii.gz", "x"),
    ] {
        let path = folder.path(written);
        write_volume(&path, &v, &compressed()).unwrap();
        std::fs::rename(path, folder.path(named)).unwrap();
        let back = read_volume(&folder.path(named)).unwrap();
        assert!(back.samples == v.samples, "{written} named {named}");
    }
}

#[test]
fn spaces_turn_into_each_other() {
    let v = volume(
        ScalarType::U8,
        1,
        [2, 3, 4],
        frame(4, DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)),
        Space::Ras,
        1,
    );
    let lps = v.grid.in_space(Space::Lps);
    let p = DVec3::new(0.5, 1.0, 2.5);
    let (a, b) = (v.grid.world_from_voxel.transform_point3(p), lps.world_from_voxel.transform_point3(p));
    assert!((a * DVec3::new(-1.0, -1.0, 1.0) - b).length() < 1e-14);
    assert_eq!(lps.in_space(Space::Ras), v.grid);
    assert_eq!(lps.in_space(Space::Unknown).world_from_voxel, lps.world_from_voxel);
    assert!(matches!(v.samples, Samples::U8(_)));
}

//! Steps in time: each is read alone, from files that hold several or lie beside each other.

use glam::DVec3;
use voxclay::io::{IoError, Series, WriteOptions, read_grid, read_volume, write_volume};
use voxclay::volume::{Rescale, Samples};

use super::foreign::{Nifti, gzip, nrrd};
use super::{Folder, check_sentence, plain};

/// 2 x 1 x 3 voxels in 4 steps: sample n of step t is 10 t + n.
fn step(t: usize) -> Vec<u8> {
    (0..6).map(|n| (10 * t + n) as u8).collect()
}

fn all() -> Vec<u8> {
    (0..4).flat_map(step).collect()
}

/// Samples of every step, as they are read.
fn steps(f: &Folder, name: &str, content: &[u8]) -> Vec<Samples> {
    let path = f.file(name, content);
    let series = Series::open(&path).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(read_volume(&path).unwrap().samples, series.read(0).unwrap().samples, "the first without a step");
    assert_eq!(read_grid(&path).unwrap(), series.read(0).unwrap().grid);
    let past = series.read(series.steps()).unwrap_err();
    check_sentence(&past, f.0.path());
    assert!(matches!(past, IoError::NoStep { .. }), "{past}");
    let all: Vec<Samples> = (0..series.steps()).map(|t| series.read(t).unwrap().samples).collect();
    // in any order: forth over some, back, the same again
    for t in [0, 2, 3, 1, 1, 0].into_iter().filter(|t| *t < all.len()) {
        assert_eq!(series.read(t).unwrap().samples, all[t], "step {t} of {name}");
    }
    all
}

#[test]
fn nifti_in_four_dimensions() {
    let f = Folder::new();
    let wanted: Vec<Samples> = (0..4).map(|t| Samples::U8(step(t))).collect();
    let file = Nifti::new(false, 2, &[2, 1, 3, 4]).with(&all());
    assert_eq!(steps(&f, "a.nii", &file), wanted);
    assert_eq!(steps(&f, "a.nii.gz", &gzip(&file)), wanted);
    // slope and intercept are those of all steps; samples of two bytes, the larger first
    let mut h = Nifti::new(true, 4, &[2, 1, 3, 4]);
    h.f32(112, &[0.5, -3.0]);
    let words: Vec<i16> = all().iter().map(|v| i16::from(*v) - 20).collect();
    let bytes: Vec<u8> = words.iter().flat_map(|v| v.to_be_bytes()).collect();
    let wanted: Vec<Samples> = words.chunks(6).map(|w| Samples::I16(w.to_vec())).collect();
    assert_eq!(steps(&f, "b.nii", &h.with(&bytes)), wanted);
    let v = Series::open(&f.path("b.nii")).unwrap().read(3).unwrap();
    assert_eq!(v.rescale, Rescale { slope: 0.5, intercept: -3.0 });
    assert_eq!(v.grid.dims, [2, 1, 3]);
    // header and samples apart
    let mut pair = Nifti::new(false, 2, &[2, 1, 3, 4]);
    pair.bytes[344..348].copy_from_slice(b"ni1\0");
    pair.f32(108, &[0.0]);
    f.file("c.img", all());
    assert_eq!(steps(&f, "c.hdr", &pair.bytes[..348])[2], Samples::U8(step(2)));
    // colours have their three values together in each step
    let colors = Nifti::new(false, 128, &[2, 1, 1, 4]).with(&all());
    assert_eq!(steps(&f, "d.nii", &colors)[1], Samples::U8(step(1)));
    let both = f.file("e.nii", Nifti::new(false, 2, &[2, 1, 1, 4, 3]).with(&all()));
    assert!(Series::open(&both).unwrap_err().to_string().contains("series in time of vectors"));
}

#[test]
fn nrrd_with_an_axis_of_time() {
    let f = Folder::new();
    let wanted: Vec<Samples> = (0..4).map(|t| Samples::U8(step(t))).collect();
    let last = "type: uchar\ndimension: 4\nsizes: 2 1 3 4\nkinds: domain domain domain time\n";
    let first = "type: uchar\ndimension: 4\nsizes: 4 2 1 3\nkinds: time domain domain domain\n";
    let middle = "type: uchar\ndimension: 4\nsizes: 2 1 4 3\nkinds: space space time space\n";
    // steps take turns, sample by sample or in runs of two
    let turns = |run: usize| -> Vec<u8> {
        (0..6 / run).flat_map(|r| (0..4).flat_map(move |t| step(t)[r * run..(r + 1) * run].to_vec())).collect()
    };
    for (fields, data) in [(last, all()), (first, turns(1)), (middle, turns(2))] {
        let words: String = data.iter().map(|v| format!("{v} ")).collect();
        let hex: String = data.iter().map(|v| format!("{v:02x}")).collect();
        for (encoding, content) in
            [("raw", data.clone()), ("gzip", gzip(&data)), ("text", words.into_bytes()), ("hex", hex.into_bytes())]
        {
            let file = nrrd(&format!("{fields}encoding: {encoding}\n"), &content);
            assert_eq!(steps(&f, "a.nrrd", &file), wanted, "{fields}{encoding}");
        }
    }
    // with a frame, bytes to skip and at the end of the file
    let frame = "space: LPS\nspace directions: (2,0,0) (0,3,0) (0,0,4) none\nspace origin: (1,2,3)\n";
    let skipped = nrrd(&format!("{last}{frame}encoding: raw\nbyte skip: 3\n"), &[&[9; 3], &all()[..]].concat());
    assert_eq!(steps(&f, "a.nrrd", &skipped), wanted);
    assert_eq!(read_grid(&f.path("a.nrrd")).unwrap().spacing(), DVec3::new(2.0, 3.0, 4.0));
    let tail = nrrd(&format!("{last}encoding: raw\nbyte skip: -1\n"), &[&[9; 7], &all()[..]].concat());
    assert_eq!(steps(&f, "a.nrrd", &tail), wanted);
    // a list is one of steps where it cannot be one of channels
    let list = "type: uchar\ndimension: 4\nsizes: 6 2 1 2\nkinds: list domain domain domain\nencoding: raw\n";
    assert_eq!(steps(&f, "a.nrrd", &nrrd(list, &all())).len(), 6);
    let none = last.replace("1 3 4", "1 3 0");
    let path = f.file("a.nrrd", nrrd(&format!("{none}encoding: raw\n"), &[]));
    assert!(Series::open(&path).unwrap_err().to_string().contains("without a step"));
}

/// Whole steps are read; of one that is not all there it is said.
#[test]
fn a_series_that_is_cut_off() {
    let f = Folder::new();
    let nifti = Nifti::new(false, 2, &[2, 1, 3, 4]);
    let fields = "type: uchar\ndimension: 4\nsizes: 2 1 3 4\nkinds: domain domain domain time\n";
    let words: String = all()[..15].iter().map(|v| format!("{v} ")).collect();
    for (name, content) in [
        ("a.nii", nifti.with(&all()[..15])),
        ("a.nii.gz", gzip(&nifti.with(&all()[..15]))),
        ("a.nrrd", nrrd(&format!("{fields}encoding: raw\n"), &all()[..15])),
        ("b.nrrd", nrrd(&format!("{fields}encoding: gzip\n"), &gzip(&all()[..15]))),
        ("c.nrrd", nrrd(&format!("{fields}encoding: text\n"), words.as_bytes())),
    ] {
        let path = f.file(name, content);
        let series = Series::open(&path).unwrap();
        assert_eq!(series.read(1).unwrap().samples, Samples::U8(step(1)), "{name}");
        for t in [2, 3] {
            let error = series.read(t).unwrap_err();
            check_sentence(&error, f.0.path());
            // of text, too few characters are enough to know
            let known = name == "c.nrrd" && error.to_string().contains("cannot hold the 24 numbers");
            assert!(known || error.to_string().contains("data end after 15 of"), "{error}");
        }
        if name != "c.nrrd" {
            assert!(series.read(2).unwrap_err().to_string().contains("step 2 is not all there"));
        }
    }
    // the middle of compressed data
    let mut packed = gzip(&nifti.with(&all()));
    packed.truncate(packed.len() - 12);
    let series = Series::open(&f.file("d.nii.gz", packed)).unwrap();
    assert!(series.read(3).unwrap_err().to_string().contains("cut off"));
    // more than there should be
    let more = f.file("e.nii", nifti.with(&[all(), vec![0; 6]].concat()));
    assert!(Series::open(&more).unwrap().read(0).unwrap_err().to_string().contains("30 bytes of data"));
    let more = f.file("f.nii.gz", gzip(&nifti.with(&[all(), vec![0; 6]].concat())));
    assert!(Series::open(&more).unwrap().read(3).unwrap_err().to_string().contains("more data than the 24 bytes"));
}

/// Numbers of steps that are not true: nothing is allocated for them.
#[test]
fn lies() {
    let f = Folder::new();
    let lie = Nifti::new(false, 2, &[2, 1, 3, 32767]).with(&all());
    for (name, content) in [("a.nii", lie.clone()), ("a.nii.gz", gzip(&lie))] {
        let series = Series::open(&f.file(name, content)).unwrap();
        assert_eq!(series.steps(), 32767);
        assert_eq!(series.read(3).unwrap().samples, Samples::U8(step(3)));
        assert!(series.read(4).unwrap_err().to_string().contains("data end after 24 of 30 bytes"));
        assert!(series.read(32766).is_err());
    }
    let huge = Nifti::new(false, 64, &[32767; 4]).with(&all());
    assert!(read_volume(&f.file("b.nii", &huge)).unwrap_err().to_string().contains("data end after 24 of"));
    assert!(read_volume(&f.file("b.nii.gz", gzip(&huge))).unwrap_err().to_string().contains("cannot hold"));
    for (encoding, words) in [("raw", "data end after 24 of"), ("gzip", "cannot hold"), ("text", "cannot hold")] {
        let fields = "type: double\ndimension: 4\nendian: little\n";
        for sizes in ["60000 60000 60000 60000", "18446744073709551615 2 2 2"] {
            for kinds in ["domain domain domain time", "time domain domain domain"] {
                let head = format!("{fields}sizes: {sizes}\nkinds: {kinds}\nencoding: {encoding}\n");
                let error = Series::open(&f.file("c.nrrd", nrrd(&head, &all()))).and_then(|s| s.read(0)).unwrap_err();
                check_sentence(&error, f.0.path());
                let text = error.to_string();
                assert!(
                    text.contains(words) || text.contains("too large") || text.contains("must be smaller"),
                    "{text}"
                );
            }
        }
    }
}

#[test]
fn numbered_files_beside_each_other() {
    let f = Folder::new();
    let options = WriteOptions::default();
    for name in ["n_008.nrrd", "n_009.nrrd", "n_010.nrrd", "n_012.nrrd", "n_8.nrrd", "m-1.raw", "m-2.raw", "k_0.nii.gz"]
    {
        let number: u8 =
            name.trim_start_matches(|c: char| !c.is_ascii_digit()).split('.').next().unwrap().parse().unwrap();
        write_volume(&f.path(name), &plain([2, 1, 1], vec![number, 0]), &options).unwrap();
    }
    let numbers = |name: &str| -> Vec<u8> {
        let series = Series::open(&f.path(name)).unwrap();
        let of = |t: usize| match series.read(t).unwrap().samples {
            Samples::U8(v) => v[0],
            other => panic!("{other:?}"),
        };
        (0..series.steps()).map(of).collect()
    };
    // up to the number that is missing, from the file that is named
    assert_eq!(numbers("n_008.nrrd"), [8, 9, 10]);
    assert_eq!(numbers("n_010.nrrd"), [10]);
    assert_eq!(numbers("n_8.nrrd"), [8]);
    assert_eq!(numbers("m-1.raw"), [1, 2]);
    assert_eq!(numbers("k_0.nii.gz"), [0]);
    let series = Series::open(&f.path("n_008.nrrd")).unwrap();
    assert!(!series.is_one_file() && series.file(2) == f.path("n_010.nrrd"));
    assert!(series.read(3).unwrap_err().to_string().contains("its 3 steps in time are counted from 0 to 2"));
    // steps inside of a file come before files beside it
    f.file("s_0.nii", Nifti::new(false, 2, &[2, 1, 3, 4]).with(&all()));
    f.file("s_1.nii", Nifti::new(false, 2, &[2, 1, 3]).with(&step(1)));
    let series = Series::open(&f.path("s_0.nii")).unwrap();
    assert!(series.is_one_file() && series.steps() == 4);
}

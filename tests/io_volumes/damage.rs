//! Cut, bent and lying files: one sentence or a volume, never a panic, and no memory that the file does not account for.

use std::time::Duration;

use voxclay::io::{Encoding, WriteOptions, read_grid, read_volume, write_volume};
use voxclay::volume::{Rescale, ScalarType, Space};

use super::foreign::{META, Nifti, gzip, nrrd, zlib};
use super::{Folder, check_sentence, frame, volume};

/// A small volume in a form of a format: the file to bend, how it is named, and the files beside it.
struct Fixture {
    name: &'static str,
    bytes: Vec<u8>,
    beside: Vec<(&'static str, Vec<u8>)>,
    /// Most bytes of samples that a byte of file may become.
    gain: usize,
    /// Whether a shorter file can be known to be short.
    sealed: bool,
}

fn fixture(name: &'static str, bytes: Vec<u8>, gain: usize, sealed: bool) -> Fixture {
    Fixture { name, bytes, beside: Vec::new(), gain, sealed }
}

fn fixtures() -> Vec<Fixture> {
    let data: Vec<u8> = (0..48).map(|i| i * 5).collect();
    let space = "space: LPS\nspace directions: (1,0,0) (0,1.5,0) (0,0.5,2)\nspace origin: (-1,2,3)\n";
    let fields = format!("type: short\ndimension: 3\nsizes: 4 3 2\nendian: big\n{space}");
    let raw = nrrd(&format!("{fields}encoding: raw\n"), &data);
    let vectors = "type: uchar\ndimension: 4\nsizes: 3 2 4 2\nspace: LAS\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\nkinds: vector domain domain domain\nencoding: gzip\n";
    let text = nrrd(
        "type: float\ndimension: 3\nsizes: 2 2 2\nspacings: 1 2 3\naxis mins: 0 0 0\nencoding: ascii\n",
        b"0 1.5 -2 nan 4 5e3 6 7\n",
    );
    let hex = nrrd("type: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: hex\n", b"00112233445566ff\n");
    let mut sform = Nifti::new(true, 4, &[4, 3, 2]);
    sform.i16(254, 1);
    sform.f32(280, &[1.0, 0.0, 0.0, 5.0, 0.0, 2.0, 0.5, 6.0, 0.0, 0.0, 3.0, 7.0]);
    let mut qform = Nifti::new(false, 2, &[4, 3, 2, 1, 2]);
    qform.i16(252, 1);
    qform.f32(256, &[0.1, 0.2, 0.3, 1.0, 2.0, 3.0]);
    qform.f32(112, &[0.5, 1.0]);
    let meta = META.replace("2 2 2", "4 3 2");
    let frame = "Offset = 1 2 3\nElementSpacing = 1 2 3\nTransformMatrix = 1 0 0 0 0 1 0 -1 0\n";
    let packed = zlib(&data);
    let local =
        |extra: &str, data: &[u8]| [format!("{meta}{frame}{extra}ElementDataFile = LOCAL\n").as_bytes(), data].concat();
    let json =
        br#"{"dims":[4,3,2],"type":"u16","origin":[1,2,3],"spacing":[1,2,3],"direction":[[1,0,0],[0,0,-1],[0,1,0]]}"#;
    let mut list = vec![
        fixture("a.nrrd", raw, 1, true),
        fixture("a.nrrd", nrrd(vectors, &gzip(&data)), 1032, true),
        fixture("a.nrrd", text, 8, false),
        fixture("a.nrrd", hex, 1, false),
        fixture("a.nii", sform.with(&data), 1, true),
        fixture("a.nii.gz", gzip(&qform.with(&data)), 1032, true),
        fixture("a.mha", local("BinaryDataByteOrderMSB = True\n", &data), 1, true),
        fixture(
            "a.mha",
            local(&format!("CompressedData = True\nCompressedDataSize = {}\n", packed.len()), &packed),
            1032,
            true,
        ),
        fixture("a.mha", local("HeaderSize = -1\n", &data), 1, false),
        fixture(
            "a.mha",
            [format!("{META}BinaryData = False\nElementDataFile = LOCAL\n").as_bytes(), b"1 2 3 4 5 6 7 8\n"].concat(),
            8,
            false,
        ),
    ];
    for (name, header, beside) in [
        (
            "a.nhdr",
            format!("NRRD0004\n{fields}encoding: raw\nbyte skip: 0\ndata file: a.raw\n").into_bytes(),
            data.clone(),
        ),
        ("a.mhd", format!("{meta}{frame}ElementDataFile = a.raw\n").into_bytes(), data.clone()),
        ("a.json", json.to_vec(), data.clone()),
    ] {
        let gain = 1000;
        list.push(Fixture { name, bytes: header, beside: vec![("a.raw", beside)], gain, sealed: false });
    }
    let mut pair = sform;
    pair.bytes[344..348].copy_from_slice(b"ni1\0");
    pair.f32(108, &[0.0]);
    list.push(Fixture {
        name: "a.hdr",
        bytes: pair.bytes[..348].to_vec(),
        beside: vec![("a.img", data.clone())],
        gain: 1000,
        sealed: true,
    });
    list.push(Fixture { name: "a.img", bytes: data, beside: vec![("a.hdr", pair.bytes)], gain: 1, sealed: true });
    list
}

/// Reads a file that may be anything; what comes of it must be sound. Says whether a volume came out.
fn attempt(folder: &Folder, fixture: &Fixture, bytes: &[u8]) -> bool {
    let path = folder.file(fixture.name, bytes);
    match read_volume(&path) {
        Err(error) => {
            check_sentence(&error, folder.0.path());
            false
        }
        Ok(v) => {
            assert_eq!(v.samples.len(), v.grid.len() * v.channels);
            assert!(
                v.samples.bytes().len() <= fixture.gain * bytes.len().max(1),
                "{} bytes of samples",
                v.samples.bytes().len()
            );
            assert!(v.grid.voxel_from_world().is_finite() && v.grid.bounds().0.is_finite());
            assert!(v.rescale.slope != 0.0 && v.rescale.slope.is_finite() && v.rescale.intercept.is_finite());
            true
        }
    }
}

fn ready(fixture: &Fixture) -> Folder {
    let folder = Folder::new();
    for (name, bytes) in &fixture.beside {
        folder.file(name, bytes);
    }
    assert!(attempt(&folder, fixture, &fixture.bytes), "{} is sound before it is bent", fixture.name);
    folder
}

#[test]
fn every_length() {
    for fixture in fixtures() {
        let folder = ready(&fixture);
        for length in 0..fixture.bytes.len() {
            let sound = attempt(&folder, &fixture, &fixture.bytes[..length]);
            let _ = read_grid(&folder.path(fixture.name)).map_err(|e| check_sentence(&e, folder.0.path()));
            assert!(!(sound && fixture.sealed), "{} cut to {length} bytes is taken for a whole", fixture.name);
        }
        // and too long
        if fixture.sealed && fixture.name != "a.hdr" {
            for tail in [b"\0".as_slice(), b"\n", &[0xff; 100]] {
                let longer = [fixture.bytes.as_slice(), tail].concat();
                assert!(!attempt(&folder, &fixture, &longer), "{} with {} bytes more", fixture.name, tail.len());
            }
        }
    }
}

#[test]
fn every_byte_changed() {
    for fixture in fixtures() {
        let folder = ready(&fixture);
        let mut bytes = fixture.bytes.clone();
        for at in 0..bytes.len() {
            let old = bytes[at];
            // text suffers from other bytes than numbers do
            let text = old.is_ascii_graphic() || old.is_ascii_whitespace();
            let others = if text { [b'9', b'-', b' ', b'\n'] } else { [0x7f, 0x80, old ^ 0x80, old.wrapping_sub(1)] };
            for new in [0, 0xff, old ^ 1].into_iter().chain(others) {
                bytes[at] = new;
                attempt(&folder, &fixture, &bytes);
            }
            bytes[at] = old;
        }
    }
}

/// Lines of text headers lost, doubled and exchanged.
#[test]
fn every_line_moved() {
    for fixture in fixtures().iter().filter(|f| !f.name.contains(".nii") && f.name != "a.hdr" && f.name != "a.img") {
        let folder = ready(fixture);
        let lines: Vec<&[u8]> = fixture.bytes.split_inclusive(|b| *b == b'\n').collect();
        for i in 0..lines.len() {
            let mut less = lines.clone();
            less.remove(i);
            attempt(&folder, fixture, &less.concat());
            let mut more = lines.clone();
            more.insert(i, lines[i]);
            attempt(&folder, fixture, &more.concat());
            for j in 0..i {
                let mut swapped = lines.clone();
                swapped.swap(i, j);
                attempt(&folder, fixture, &swapped.concat());
            }
        }
    }
}

/// Little data that inflate to much: refused after as much as was promised.
#[test]
fn bombs() {
    let folder = Folder::new();
    let zeros = vec![0u8; 64 << 20];
    let bomb = gzip(&zeros);
    assert!(bomb.len() < 1 << 17);
    let small = "type: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: gzip\n";
    let path = folder.file("a.nrrd", nrrd(small, &bomb));
    assert!(read_volume(&path).unwrap_err().to_string().contains("more data than the 8 bytes"));
    // a promise that these bytes could not keep even if they were the best compressed ever
    let large = "type: double\ndimension: 3\nsizes: 30000 30000 30000\nendian: little\nencoding: gzip\n";
    let path = folder.file("a.nrrd", nrrd(large, &bomb));
    assert!(read_volume(&path).unwrap_err().to_string().contains("cannot hold"));
    // one that they might, but do not
    let close = "type: uchar\ndimension: 3\nsizes: 1024 1024 64\nbyte skip: 1\nencoding: gzip\n";
    let path = folder.file("a.nrrd", nrrd(close, &bomb));
    assert!(read_volume(&path).unwrap_err().to_string().contains("end after 67108863 of 67108864"));
    let path = folder.file("a.nii.gz", gzip(&[Nifti::new(false, 2, &[2, 2, 2]).bytes, zeros].concat()));
    assert!(read_volume(&path).unwrap_err().to_string().contains("more data than the 8 bytes"));
}

/// The tests of lying headers once more, in a process that may not have 400 MB: what a header promises is not allocated.
#[cfg(target_os = "linux")]
#[test]
fn lies_in_little_memory() {
    let program = std::env::current_exe().unwrap();
    let limited = |kib: &str, test: &str| {
        let script = format!("ulimit -v {kib} && exec \"$0\" --exact {test} --test-threads 1");
        std::process::Command::new("sh").arg("-c").arg(script).arg(&program).output().unwrap()
    };
    for test in [
        "damage::bombs",
        "foreign::nrrd_refusals",
        "foreign::raw_volumes",
        "foreign::nifti_channels_and_dimensions",
        "series::lies",
    ] {
        let run = limited("400000", test);
        let said = String::from_utf8_lossy(&run.stdout);
        assert!(
            run.status.success() && said.contains("1 passed"),
            "{test}: {said}{}",
            String::from_utf8_lossy(&run.stderr)
        );
    }
    // the limit does bite: this test holds 64 MiB itself
    assert!(!limited("60000", "damage::bombs").status.success());
}

/// Pieces cut out, doubled, exchanged between files, and overwritten, by a fixed course of chance.
#[test]
fn surgery() {
    let mut state = 12345u64;
    let mut chance = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below.max(1)
    };
    let rounds = std::env::var("VOXCLAY_SURGERY").ok().and_then(|n| n.parse().ok()).unwrap_or(100);
    let fixtures = fixtures();
    let values = [
        "-1",
        "0",
        "1e400",
        "nan",
        "99999999999999999999",
        "inf",
        "",
        "(",
        "none",
        "4294967296",
        "0.0000001",
        ":",
        "=",
        "\n\n",
    ];
    for fixture in &fixtures {
        let folder = ready(fixture);
        for _ in 0..rounds {
            let mut bytes = fixture.bytes.clone();
            for _ in 0..1 + chance(3) {
                let (at, reach) = (chance(bytes.len()), chance(40));
                let end = (at + reach).min(bytes.len());
                match chance(5) {
                    0 => drop(bytes.drain(at..end)),
                    1 => drop(bytes.splice(at..at, bytes[at..end].to_vec())),
                    2 => bytes[at..end].iter_mut().for_each(|b| *b = chance(256) as u8),
                    3 => {
                        // a word becomes another
                        let word = bytes[at..].iter().position(|b| b.is_ascii_whitespace()).unwrap_or(0);
                        bytes.splice(at..at + word, values[chance(values.len())].bytes());
                    }
                    _ => {
                        let other = &fixtures[chance(fixtures.len())].bytes;
                        let from = chance(other.len());
                        bytes.splice(at..end, other[from..(from + reach).min(other.len())].iter().copied());
                    }
                }
            }
            attempt(&folder, fixture, &bytes);
        }
    }
}

/// A damaged checksum is damage, though every sample is there.
#[test]
fn checksums_count() {
    let folder = Folder::new();
    let v = volume(ScalarType::U8, 1, [9, 9, 9], frame(0, glam::DVec3::ONE, glam::DVec3::ZERO), Space::Unknown, 3);
    for name in ["a.nrrd", "a.mha", "a.nii.gz"] {
        let path = folder.path(name);
        write_volume(&path, &v, &WriteOptions { encoding: Encoding::Compressed }).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        let at = bytes.len() - if name == "a.mha" { 2 } else { 6 };
        bytes[at] ^= 0x10;
        folder.file(name, bytes);
        let error = read_volume(&path).unwrap_err().to_string();
        assert!(error.contains("damaged"), "{error}");
    }
}

#[test]
fn what_is_no_file() {
    let folder = Folder::new();
    for name in ["none.nrrd", "none.nii.gz", "none.mha", "none.raw", "none.json", "none"] {
        let error = read_volume(&folder.path(name)).unwrap_err();
        check_sentence(&error, folder.0.path());
        assert!(error.to_string().contains("cannot open"), "{error}");
        let dir = folder.path(&format!("dir-{name}"));
        std::fs::create_dir(&dir).unwrap();
        check_sentence(&read_volume(&dir).unwrap_err(), folder.0.path());
        let empty = folder.file(&format!("empty-{name}"), "");
        check_sentence(&read_volume(&empty).unwrap_err(), folder.0.path());
        let other = folder.file(&format!("other-{name}"), [0x89, b'P', b'N', b'G', 13, 10, 26, 10].repeat(100));
        check_sentence(&read_volume(&other).unwrap_err(), folder.0.path());
    }
    // an endless device has no length that a header could be compared with
    #[cfg(unix)]
    for device in ["/dev/zero", "/dev/urandom"] {
        let error = read_volume(device.as_ref()).unwrap_err().to_string();
        assert!(error.contains("not a regular file"), "{error}");
    }
}

/// A pipe with no writer would be waited for until the end of days.
#[cfg(unix)]
#[test]
fn a_pipe_is_refused_without_waiting() {
    let folder = Folder::new();
    let pipe = folder.path("pipe.nrrd");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    if !made.is_ok_and(|s| s.success()) {
        return;
    }
    let (tell, told) = std::sync::mpsc::channel();
    std::thread::spawn(move || tell.send(read_volume(&pipe).unwrap_err().to_string()));
    let error = told.recv_timeout(Duration::from_secs(20)).expect("the reader does not wait");
    assert!(error.contains("not a regular file"), "{error}");
}

/// Headers that our own writers make, bent too: they hold every field there is.
#[test]
fn own_files_changed() {
    let folder = Folder::new();
    let mut v = volume(ScalarType::I16, 2, [2, 3, 2], frame(3, glam::DVec3::ONE, glam::DVec3::ONE), Space::Lps, 9);
    v.rescale = Rescale { slope: 0.5, intercept: -7.0 };
    for name in ["a.nrrd", "a.mha", "a.nii"] {
        let path = folder.path(name);
        write_volume(&path, &v, &WriteOptions { encoding: Encoding::Raw }).unwrap();
        let fixture = fixture(name, std::fs::read(&path).unwrap(), 1, true);
        for at in 0..fixture.bytes.len() {
            assert!(!attempt(&folder, &fixture, &fixture.bytes[..at]), "{name} cut to {at} bytes");
            let mut bytes = fixture.bytes.clone();
            for new in [0, b'7', 0xff] {
                bytes[at] = new;
                attempt(&folder, &fixture, &bytes);
            }
        }
    }
}

//! Files as other programs write them, put together by hand.

use std::io::Write;

use glam::{DMat3, DVec3};
use voxclay::io::{read_grid, read_volume};
use voxclay::volume::{Rescale, Samples, Space, Volume};

use super::Folder;

const I16: [i16; 8] = [-1130, 1379, 0, 1, -1, 256, -32768, 32767];

fn i16_bytes(big: bool) -> Vec<u8> {
    I16.iter().flat_map(|x| if big { x.to_be_bytes() } else { x.to_le_bytes() }).collect()
}

pub fn gzip(data: &[u8]) -> Vec<u8> {
    let mut w = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    w.write_all(data).unwrap();
    w.finish().unwrap()
}

pub fn zlib(data: &[u8]) -> Vec<u8> {
    let mut w = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    w.write_all(data).unwrap();
    w.finish().unwrap()
}

pub fn nrrd(fields: &str, data: &[u8]) -> Vec<u8> {
    [format!("NRRD0004\n{fields}\n").as_bytes(), data].concat()
}

const CUBE: &str = "type: short\ndimension: 3\nsizes: 2 2 2\n";

#[track_caller]
fn read(folder: &Folder, name: &str, content: impl AsRef<[u8]>) -> Volume {
    read_volume(&folder.file(name, content)).unwrap()
}

#[track_caller]
fn refused(folder: &Folder, name: &str, content: impl AsRef<[u8]>, words: &str) {
    let error = read_volume(&folder.file(name, content)).unwrap_err();
    super::check_sentence(&error, folder.0.path());
    assert!(error.to_string().contains(words), "{error}");
}

#[test]
fn nrrd_encodings_and_byte_orders() {
    let f = Folder::new();
    for big in [false, true] {
        let endian = if big { "big" } else { "little" };
        let data = i16_bytes(big);
        let hex: String = data.iter().map(|b| format!("{b:02X}")).collect::<Vec<_>>().join("\n");
        let cases: [(&str, Vec<u8>); 3] = [("raw", data.clone()), ("gz", gzip(&data)), ("hex", hex.into())];
        for (encoding, bytes) in cases {
            let v = read(&f, "a.nrrd", nrrd(&format!("{CUBE}endian: {endian}\nencoding: {encoding}\n"), &bytes));
            assert_eq!(v.samples, Samples::I16(I16.to_vec()), "{encoding} {endian}");
        }
    }
    for encoding in ["ascii", "text", "txt"] {
        let text = "-1130,1379 0\n1 -1\t256, -32768 32767";
        let v = read(&f, "a.nrrd", nrrd(&format!("{CUBE}encoding: {encoding}\n"), text.as_bytes()));
        assert_eq!(v.samples, Samples::I16(I16.to_vec()));
    }
    // several gzip members are one stream
    let halves = [gzip(&i16_bytes(false)[..7]), gzip(&i16_bytes(false)[7..])].concat();
    let v = read(&f, "a.nrrd", nrrd(&format!("{CUBE}endian: little\nencoding: gzip\n"), &halves));
    assert_eq!(v.samples, Samples::I16(I16.to_vec()));
}

#[test]
fn nrrd_loose_headers() {
    let f = Folder::new();
    let header = "NRRD0005\r\n# a comment: with colons\r\nTYPE: int16\r\ndimension: 3\r\ncontent: M\u{fc}ller\r\nsizes:2   2 2\r\n\
                  key:=a value: with colons\r\nEndian: LITTLE\r\nencoding: RAW\r\naxismins: nan nan nan\r\n\r\n";
    let mut bytes = header.as_bytes().to_vec();
    // Latin-1 in the place of UTF-8
    let at = header.find('\u{fc}').unwrap();
    bytes.splice(at..at + 2, [0xfc]);
    bytes.extend(i16_bytes(false));
    let v = read(&f, "a.nrrd", bytes);
    assert_eq!(v.samples, Samples::I16(I16.to_vec()));
    assert_eq!(v.grid.space, Space::Unknown);
    assert_eq!(v.grid.world_from_voxel, glam::DAffine3::IDENTITY);
}

#[test]
fn nrrd_frames() {
    let f = Folder::new();
    let grid = |fields: &str| {
        read(&f, "a.nrrd", nrrd(&format!("{CUBE}endian: little\nencoding: raw\n{fields}"), &i16_bytes(false))).grid
    };
    let g =
        grid("space: left-anterior-superior\nspace directions: (1,2,0) (0,3,0) (0.5,0,4)\nspace origin: (10,20,30)\n");
    assert_eq!(g.space, Space::Ras);
    let wanted = DMat3::from_cols(DVec3::new(-1.0, 2.0, 0.0), DVec3::new(0.0, 3.0, 0.0), DVec3::new(-0.5, 0.0, 4.0));
    assert_eq!(g.world_from_voxel.matrix3, wanted);
    assert_eq!(g.origin(), DVec3::new(-10.0, 20.0, 30.0));
    for (name, space) in [
        ("RAS", Space::Ras),
        ("right-anterior-superior", Space::Ras),
        ("LPS", Space::Lps),
        ("Left-Posterior-Superior", Space::Lps),
        ("scanner-xyz", Space::Unknown),
        ("3D-right-handed", Space::Unknown),
    ] {
        let g = grid(&format!("space: {name}\nspace directions: (1, 0, 0) ( 0,1,0)(0,0,1)\nspace origin: (1,2,3)\n"));
        assert_eq!((g.space, g.origin()), (space, DVec3::new(1.0, 2.0, 3.0)), "{name}");
    }
    assert_eq!(grid("spacings: 0.5 2 nan\n").spacing(), DVec3::new(0.5, 2.0, 1.0));
    // as teem: at the edge of the first sample, unless the samples are at the nodes
    let g = grid("spacings: 2 2 2\naxis mins: 10 20 30\n");
    assert_eq!(g.origin(), DVec3::new(11.0, 21.0, 31.0));
    let g = grid("spacings: 2 2 2\naxis mins: 10 20 30\ncenters: node node node\n");
    assert_eq!(g.origin(), DVec3::new(10.0, 20.0, 30.0));
    let g = grid("axis mins: 0 0 0\naxis maxs: 8 8 8\ncenterings: cell node cell\n");
    assert_eq!((g.spacing(), g.origin()), (DVec3::new(4.0, 8.0, 4.0), DVec3::new(2.0, 0.0, 2.0)));
}

#[test]
fn nrrd_channels_stand_anywhere() {
    let f = Folder::new();
    // two channels over 2x1x3: voxel n has the values 10 n and 10 n + 1
    let wanted: Vec<u8> = (0..6).flat_map(|n| [10 * n, 10 * n + 1]).collect();
    let at = |order: [usize; 3]| -> Vec<u8> {
        // sizes of (channel, i, k) in file order, first fastest
        let sizes = [2usize, 2, 3];
        let mut out = Vec::new();
        for c in 0..sizes[order[2]] {
            for b in 0..sizes[order[1]] {
                for a in 0..sizes[order[0]] {
                    let mut at = [0; 3];
                    (at[order[0]], at[order[1]], at[order[2]]) = (a, b, c);
                    out.push((10 * (at[1] + 2 * at[2]) + at[0]) as u8);
                }
            }
        }
        out
    };
    let head = "type: uchar\ndimension: 4\nencoding: raw\n";
    for (fields, data) in [
        ("sizes: 2 2 1 3\nkinds: vector domain domain domain\n", at([0, 1, 2])),
        (
            "sizes: 2 2 1 3\nspace: LPS\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n",
            at([0, 1, 2]),
        ),
        ("sizes: 2 2 1 3\nspace dimension: 3\nspace directions: (1,0,0) none (0,1,0) (0,0,1)\n", at([1, 0, 2])),
        ("sizes: 2 1 3 2\nkinds: space space space list\n", at([1, 2, 0])),
    ] {
        let v = read(&f, "a.nrrd", nrrd(&format!("{head}{fields}"), &data));
        assert_eq!((v.grid.dims, v.channels), ([2, 1, 3], 2), "{fields}");
        assert_eq!(v.samples, Samples::U8(wanted.clone()), "{fields}");
    }
    // a lone axis of at most four samples must be the one
    let rgba: Vec<u8> = (0..4 * 5 * 5 * 5).map(|i| i as u8).collect();
    let v = read(&f, "a.nrrd", nrrd(&format!("{head}sizes: 4 5 5 5\n"), &rgba));
    assert_eq!((v.channels, v.samples), (4, Samples::U8(rgba)));
    // a fourth axis of one sample is nothing
    let v = read(&f, "a.nrrd", nrrd(&format!("{head}sizes: 5 5 5 1\nkinds: domain domain domain time\n"), &[7; 125]));
    assert_eq!(v.channels, 1);
    refused(
        &f,
        "a.nrrd",
        nrrd(&format!("{head}sizes: 5 5 5 9\nkinds: domain domain domain vector\n"), &[7; 1125]),
        "9 values in each voxel",
    );
    refused(&f, "a.nrrd", nrrd(&format!("{head}sizes: 2 2 2 2\n"), &[7; 16]), "which one holds channels");
    let picture = "type: uchar\ndimension: 3\nencoding: raw\nsizes: 3 2 2\nkinds: RGB-color domain domain\n";
    refused(&f, "a.nrrd", nrrd(picture, &[7; 12]), "only 2 axes in space");
}

#[test]
fn nrrd_detached_and_skips() {
    let f = Folder::new();
    let fields = format!("{CUBE}endian: little\n");
    let data = i16_bytes(false);
    f.file("d.raw", &data);
    let wanted = Samples::I16(I16.to_vec());
    assert_eq!(read(&f, "a.nhdr", format!("NRRD0004\n{fields}encoding: raw\ndata file: d.raw\n")).samples, wanted);
    assert_eq!(read(&f, "a.nhdr", format!("NRRD0004\n{fields}encoding: raw\ndatafile: ./d.raw")).samples, wanted);
    f.file("lines.raw", [b"P5 a\nb\nc\n".as_slice(), &data].concat());
    let lines = format!("NRRD0004\n{fields}encoding: raw\nline skip: 3\ndata file: lines.raw\n");
    assert_eq!(read(&f, "a.nhdr", lines).samples, wanted);
    let both = format!("NRRD0004\n{fields}encoding: raw\nline skip: 2\nbyte skip: 2\ndata file: lines.raw\n");
    assert_eq!(read(&f, "a.nhdr", both).samples, wanted);
    let tail = format!("NRRD0004\n{fields}encoding: raw\nbyte skip: -1\ndata file: lines.raw\n");
    assert_eq!(read(&f, "a.nhdr", tail).samples, wanted);
    // of compressed data, bytes are skipped behind the decoder
    f.file("z.gz", gzip(&[b"12345".as_slice(), &data].concat()));
    let inside = format!("NRRD0004\n{fields}encoding: gzip\nbyte skip: 5\ndata file: z.gz\n");
    assert_eq!(read(&f, "a.nhdr", inside).samples, wanted);

    for (extra, words) in [
        ("encoding: raw\ndata file: LIST\nx.raw\n", "several data files"),
        ("encoding: raw\ndata file: x%03d.raw 1 2 1\n", "several data files"),
        ("encoding: raw\ndata file: a.nhdr\n", "names itself"),
        ("encoding: raw\ndata file: .\n", "is a folder"),
        ("encoding: raw\ndata file: ../\n", "is a folder"),
        ("encoding: raw\ndata file: missing.raw\n", "missing.raw: cannot open the data file"),
        ("encoding: raw\nline skip: 99\ndata file: lines.raw\n", "fewer than the 99 lines"),
        ("encoding: raw\nbyte skip: -2\ndata file: d.raw\n", "byte skip"),
        ("encoding: gzip\nbyte skip: -1\ndata file: z.gz\n", "byte skip"),
        ("encoding: raw\nbyte skip: 18446744073709551615\ndata file: d.raw\n", "byte skip"),
        ("encoding: raw\nbyte skip: 9223372036854775807\ndata file: d.raw\n", "end after"),
        ("encoding: raw\ndata file: lines.raw\n", "holds 25 bytes"),
        ("encoding: bzip2\ndata file: d.raw\n", "raw, gzip, text and hex"),
    ] {
        refused(&f, "a.nhdr", format!("NRRD0004\n{fields}{extra}"), words);
    }
}

#[test]
fn nrrd_refusals() {
    let f = Folder::new();
    let data = i16_bytes(false);
    for (fields, words) in [
        ("type: short\ndimension: 3\nsizes: 0 2 2\nendian: little\nencoding: raw\n", "is empty"),
        ("type: short\ndimension: 3\nsizes: -2 2 2\nendian: little\nencoding: raw\n", "'-2 2 2'"),
        ("type: short\ndimension: 3\nsizes: 2 2\nendian: little\nencoding: raw\n", "3 numbers"),
        (
            "type: short\ndimension: 3\nsizes: 4294967296 4294967296 4294967296\nendian: little\nencoding: raw\n",
            "too large",
        ),
        ("type: short\ndimension: 3\nsizes: 65536 65536 65536\nendian: little\nencoding: raw\n", "end after 16 of"),
        ("type: short\ndimension: 3\nsizes: 65536 65536 65536\nendian: little\nencoding: gzip\n", "cannot hold"),
        ("type: short\ndimension: 3\nsizes: 65536 65536 65536\nencoding: text\n", "cannot hold"),
        ("type: short\ndimension: 3\nsizes: 65536 65536 65536\nendian: little\nencoding: hex\n", "pairs of digits"),
        ("type: short\ndimension: 2\nsizes: 2 2\nendian: little\nencoding: raw\n", "2 axes"),
        ("type: int64\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: raw\n", "'int64'"),
        ("type: block\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: raw\n", "'block'"),
        ("type: short\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n", "no field 'endian'"),
        ("type: short\ndimension: 3\nsizes: 2 2 2\nendian: middle\nencoding: raw\n", "little or big"),
        ("type: short\ndimension: 3\nsizes: 2 2 2\nendian: little\n", "no field 'encoding'"),
        ("type: short\ndimension: 3\nsizes: 2 2 2\nsizes: 2 2 2\nendian: little\nencoding: raw\n", "twice"),
        ("type: short\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: raw\nspacings: 1 0 1\n", "one plane"),
        ("type: short\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: raw\nspacings: 1 inf 1\n", "not finite"),
        (
            "type: short\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: raw\nspace directions: (1,0,0) (2,0,0) (0,0,1)\n",
            "one plane",
        ),
        (
            "type: short\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: raw\nspace directions: (1,0,0) none (0,0,1)\n",
            "each axis of space",
        ),
        (
            "type: short\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: raw\nspace directions: (1,0,0) (0,1) (0,0,1)\n",
            "space directions",
        ),
        (
            "type: short\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: raw\nspace directions: (1,0,0) (0,1,0) (0,0,1\n",
            "space directions",
        ),
        (
            "type: short\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: raw\nspace: LPST\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n",
            "with time",
        ),
        ("type: short\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: raw\nspace dimension: 4\n", "dimensions"),
        (
            "type: short\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: raw\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: 0,0,0\n",
            "space origin",
        ),
        ("no colon\n", "not 'field: value'"),
    ] {
        refused(&f, "a.nrrd", nrrd(fields, &data), words);
    }
    let text =
        |t: &str, words: &str| refused(&f, "a.nrrd", nrrd(&format!("{CUBE}encoding: text\n"), t.as_bytes()), words);
    text("1 2 3 4 5 6 7 x2345", "'x2345' (number 8");
    text("1 2 3 4 5 6 7 40000", "not a value of type i16");
    text("1 2 3 4 5 6 7 8.5", "not a value of type i16");
    text("1 2 3 4 5 6 7              ", "end after 7 of 8");
    text("1 2 3 4 5 6 7 8 9", "more than the 8");
    refused(&f, "a.nrrd", "", "");
    refused(&f, "a.nrrd", "NRRD0004\n", "no field");
    // a header without an end
    refused(&f, "a.nrrd", [b"NRRD0004\n# ".as_slice(), &vec![b'x'; 3 << 20]].concat(), "1 MiB");
    refused(&f, "a.nrrd", [b"NRRD0004\n".as_slice(), &b"# x\n".repeat(1 << 19)].concat(), "1 MiB");
}

/// A header of NIfTI-1 by offsets of `nifti1.h`.
pub struct Nifti {
    pub bytes: Vec<u8>,
    big: bool,
}

impl Nifti {
    pub fn new(big: bool, datatype: i16, dims: &[i16]) -> Self {
        let mut h = Self { bytes: vec![0; 352], big };
        h.i32(0, 348);
        h.i16(40, dims.len() as i16);
        for i in 0..7 {
            h.i16(42 + 2 * i, dims.get(i).copied().unwrap_or(1));
        }
        h.i16(70, datatype);
        h.f32(76, &[1.0; 8]);
        h.f32(108, &[352.0]);
        h.bytes[344..348].copy_from_slice(b"n+1\0");
        h
    }

    fn put(&mut self, at: usize, mut little: Vec<u8>) {
        if self.big {
            little.reverse();
        }
        self.bytes[at..at + little.len()].copy_from_slice(&little);
    }

    pub fn i32(&mut self, at: usize, v: i32) {
        self.put(at, v.to_le_bytes().to_vec());
    }

    pub fn i16(&mut self, at: usize, v: i16) {
        self.put(at, v.to_le_bytes().to_vec());
    }

    pub fn f32(&mut self, at: usize, values: &[f32]) {
        for (i, v) in values.iter().enumerate() {
            self.put(at + 4 * i, v.to_le_bytes().to_vec());
        }
    }

    pub fn with(&self, data: &[u8]) -> Vec<u8> {
        [self.bytes.as_slice(), data].concat()
    }
}

#[test]
fn nifti_byte_orders_and_pairs() {
    let f = Folder::new();
    for big in [false, true] {
        let mut h = Nifti::new(big, 4, &[2, 2, 2]);
        h.i16(254, 1);
        h.f32(280, &[0.0, -2.0, 0.0, 5.0, 3.0, 0.0, 0.0, 6.0, 0.0, 0.0, 4.0, 7.0]);
        h.f32(112, &[0.5, -3.0]);
        let v = read(&f, "a.nii", h.with(&i16_bytes(big)));
        assert_eq!(v.samples, Samples::I16(I16.to_vec()));
        assert_eq!(v.rescale, Rescale { slope: 0.5, intercept: -3.0 });
        assert_eq!(v.grid.space, Space::Ras);
        let columns = [DVec3::new(0.0, 3.0, 0.0), DVec3::new(-2.0, 0.0, 0.0), DVec3::new(0.0, 0.0, 4.0)];
        assert_eq!(v.grid.world_from_voxel.matrix3, DMat3::from_cols(columns[0], columns[1], columns[2]));
        assert_eq!(v.grid.origin(), DVec3::new(5.0, 6.0, 7.0));
        assert_eq!(read(&f, "a.nii.gz", gzip(&h.with(&i16_bytes(big)))), v);

        // an extension between header and samples
        h.f32(108, &[368.0]);
        assert_eq!(read(&f, "a.nii", h.with(&[&[9; 16], i16_bytes(big).as_slice()].concat())), v);
        assert_eq!(read(&f, "a.nii.gz", gzip(&h.with(&[&[9; 16], i16_bytes(big).as_slice()].concat()))), v);

        // the pair, by either name, compressed or not
        h.f32(108, &[0.0]);
        h.bytes[344..348].copy_from_slice(b"ni1\0");
        f.file("pair.hdr", &h.bytes[..348]);
        assert_eq!(read(&f, "pair.img", i16_bytes(big)), v);
        assert_eq!(read_volume(&f.path("pair.hdr")).unwrap(), v);
        std::fs::remove_file(f.path("pair.img")).unwrap();
        f.file("pair.img.gz", gzip(&i16_bytes(big)));
        assert_eq!(read_volume(&f.path("pair.hdr")).unwrap(), v);
        std::fs::remove_file(f.path("pair.img.gz")).unwrap();
        let error = read_volume(&f.path("pair.hdr")).unwrap_err().to_string();
        assert!(error.contains("no .img file"), "{error}");
    }
}

#[test]
fn nifti_forms() {
    let f = Folder::new();
    let data = i16_bytes(false);
    let mut h = Nifti::new(false, 4, &[2, 2, 2]);
    h.f32(76, &[1.0, 2.0, 3.0, 4.0]);
    let g = read(&f, "a.nii", h.with(&data)).grid;
    assert_eq!((g.space, g.spacing(), g.origin()), (Space::Unknown, DVec3::new(2.0, 3.0, 4.0), DVec3::ZERO));

    // a quarter turn about z takes i to y and j to -x
    h.i16(252, 1);
    let half = 0.5f32.sqrt();
    h.f32(256, &[0.0, 0.0, half, 10.0, 20.0, 30.0]);
    let g = read(&f, "a.nii", h.with(&data)).grid;
    let close = |a: DVec3, b: DVec3| assert!((a - b).length() < 1e-6, "{a} {b}");
    assert_eq!((g.space, g.origin()), (Space::Ras, DVec3::new(10.0, 20.0, 30.0)));
    close(g.world_from_voxel.matrix3.x_axis, DVec3::new(0.0, 2.0, 0.0));
    close(g.world_from_voxel.matrix3.y_axis, DVec3::new(-3.0, 0.0, 0.0));
    close(g.world_from_voxel.matrix3.z_axis, DVec3::new(0.0, 0.0, 4.0));
    // qfac turns the third axis
    h.f32(76, &[-1.0]);
    let g = read(&f, "a.nii", h.with(&data)).grid;
    close(g.world_from_voxel.matrix3.z_axis, DVec3::new(0.0, 0.0, -4.0));
    // half a turn about x, where a is 0 and b a little above 1
    h.f32(76, &[1.0]);
    h.f32(256, &[1.000_000_1, 0.0, 0.0]);
    let g = read(&f, "a.nii", h.with(&data)).grid;
    close(g.world_from_voxel.matrix3.y_axis, DVec3::new(0.0, -3.0, 0.0));
    // the matrix goes first
    h.i16(254, 2);
    h.f32(280, &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    assert_eq!(read(&f, "a.nii", h.with(&data)).grid.world_from_voxel, glam::DAffine3::IDENTITY);
}

#[test]
fn nifti_channels_and_dimensions() {
    let f = Folder::new();
    let rgb: Vec<u8> = (0..24).collect();
    let v = read(&f, "a.nii", Nifti::new(false, 128, &[2, 2, 2]).with(&rgb));
    assert_eq!((v.channels, v.samples), (3, Samples::U8(rgb)));
    let rgba: Vec<u8> = (0..32).collect();
    let mut h = Nifti::new(false, 2304, &[2, 2, 2]);
    h.f32(112, &[7.0, 7.0]);
    let v = read(&f, "a.nii", h.with(&rgba));
    assert_eq!((v.channels, v.rescale, v.samples), (4, Rescale::default(), Samples::U8(rgba)));
    // vectors lie one component after the other
    let v =
        read(&f, "a.nii", Nifti::new(false, 2, &[2, 1, 2, 1, 3]).with(&[0, 1, 2, 3, 10, 11, 12, 13, 20, 21, 22, 23]));
    assert_eq!((v.channels, v.samples), (3, Samples::U8(vec![0, 10, 20, 1, 11, 21, 2, 12, 22, 3, 13, 23])));
    // what is beyond the file's dimensions does not count
    let mut h = Nifti::new(false, 2, &[4, 2]);
    h.i16(46, 77);
    h.f32(88, &[0.0]);
    assert_eq!(read(&f, "a.nii", h.with(&[5; 8])).grid.dims, [4, 2, 1]);
    let v = read(&f, "a.nii", Nifti::new(false, 2, &[2, 2, 2, 1]).with(&[5; 8]));
    assert_eq!((v.grid.dims, v.channels), ([2, 2, 2], 1));

    let code = |c: i16| Nifti::new(false, c, &[2, 2, 2]).with(&[0; 64]);
    refused(&f, "a.nii", Nifti::new(false, 2, &[2, 2, 2, 1, 6]).with(&[5; 48]), "6 values");
    refused(&f, "a.nii", Nifti::new(false, 2, &[2, 0, 2]).with(&[5; 8]), "dimension 2 is 0");
    refused(&f, "a.nii", Nifti::new(false, 2, &[2, -5, 2]).with(&[5; 8]), "dimension 2 is -5");
    refused(&f, "a.nii", Nifti::new(false, 2, &[32767; 3]).with(&[5; 8]), "end after 8 of");
    refused(&f, "a.nii.gz", gzip(&Nifti::new(false, 2, &[32767; 3]).with(&[5; 8])), "cannot hold");
    refused(&f, "a.nii", code(32), "complex");
    refused(&f, "a.nii", code(1792), "complex");
    refused(&f, "a.nii", code(1), "single bits");
    refused(&f, "a.nii", code(1024), "64-bit integers");
    refused(&f, "a.nii", code(1280), "64-bit integers");
    refused(&f, "a.nii", code(1536), "128-bit floats");
    refused(&f, "a.nii", code(77), "does not define");
    refused(&f, "a.nii", Nifti::new(false, 128, &[2, 2, 2, 1, 2]).with(&[0; 48]), "vectors of colours");

    let change = |change: &dyn Fn(&mut Nifti)| {
        let mut h = Nifti::new(true, 2, &[2, 2, 2]);
        change(&mut h);
        h.with(&[1; 8])
    };
    refused(&f, "a.nii", change(&|h| h.i16(40, 9)), "9 dimensions");
    refused(&f, "a.nii", change(&|h| h.f32(80, &[0.0])), "must be above 0");
    refused(&f, "a.nii", change(&|h| h.f32(80, &[-1.0])), "must be above 0");
    refused(&f, "a.nii", change(&|h| h.f32(80, &[f32::NAN])), "must be above 0");
    refused(&f, "a.nii", change(&|h| h.f32(108, &[f32::NAN])), "vox_offset");
    refused(&f, "a.nii", change(&|h| h.f32(108, &[1e30])), "vox_offset");
    refused(&f, "a.nii", change(&|h| h.f32(108, &[400.0])), "end after");
    refused(&f, "a.nii", change(&|h| h.i16(254, 1)), "one plane");
    refused(&f, "a.nii", change(&|h| h.f32(112, &[1.0, f32::INFINITY])), "scl_inter");
    refused(&f, "a.nii", change(&|h| h.bytes[344] = 0), "ANALYZE");
    refused(&f, "a.nii", change(&|h| h.i32(0, 540)), "NIfTI-2");
    refused(&f, "a.nii", change(&|h| h.i32(0, 7)), "348");
    let none = read(&f, "a.nii", change(&|h| h.f32(112, &[0.0, 5.0])));
    assert_eq!(none.rescale, Rescale::default());
    assert_eq!(read(&f, "a.nii", change(&|h| h.f32(108, &[0.0]))).samples, Samples::U8(vec![1; 8]), "offset 0");
}

pub const META: &str = "ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\nElementType = MET_SHORT\n";

#[test]
fn metaimage_data() {
    let f = Folder::new();
    let wanted = Samples::I16(I16.to_vec());
    let local =
        |fields: &str, data: &[u8]| [format!("{META}{fields}ElementDataFile = LOCAL\n").as_bytes(), data].concat();
    let samples = |content: Vec<u8>| read(&f, "a.mha", content).samples;
    assert_eq!(samples(local("", &i16_bytes(false))), wanted);
    assert_eq!(samples(local("BinaryDataByteOrderMSB = True\n", &i16_bytes(true))), wanted);
    assert_eq!(samples(local("ElementByteOrderMSB = true\n", &i16_bytes(true))), wanted);
    let packed = zlib(&i16_bytes(false));
    assert_eq!(samples(local("CompressedData = True\n", &packed)), wanted);
    assert_eq!(
        samples(local(&format!("CompressedData = True\nCompressedDataSize = {}\n", packed.len()), &packed)),
        wanted
    );
    assert_eq!(samples(local("CompressedData = True\n", &gzip(&i16_bytes(false)))), wanted);
    assert_eq!(samples(local("BinaryData = False\n", b"-1130 1379 0 1\n-1 256 -32768 32767\n")), wanted);
    assert_eq!(samples(local("HeaderSize = 3\n", &[&[1, 2, 3], i16_bytes(false).as_slice()].concat())), wanted);
    assert_eq!(samples(local("HeaderSize = -1\n", &[&[1; 50], i16_bytes(false).as_slice()].concat())), wanted);
    let tail = format!("CompressedData = True\nHeaderSize = -1\nCompressedDataSize = {}\n", packed.len());
    assert_eq!(samples(local(&tail, &[b"junk", packed.as_slice()].concat())), wanted);

    f.file("d.raw", i16_bytes(false));
    assert_eq!(read(&f, "a.mhd", format!("{META}ElementDataFile = d.raw")).samples, wanted);
    assert_eq!(read(&f, "a.mhd", format!("{META}ElementDataFile = d.raw").replace('\n', "\r\n")).samples, wanted);
    let two = "NDims = 3\nDimSize = 2 1 1\nElementNumberOfChannels = 4\nElementType = MET_SHORT_ARRAY\nElementDataFile = d.raw\n";
    let v = read(&f, "a.mhd", two);
    assert_eq!((v.channels, v.samples), (4, wanted));

    for (fields, words) in [
        ("ElementDataFile = LIST\nx.raw\n", "several data files"),
        ("ElementDataFile = x%02d.raw 1 2 1\n", "several data files"),
        ("ElementDataFile = a.mhd\n", "names itself"),
        ("ElementDataFile = /\n", "is a folder"),
        ("ElementDataFile = missing.raw\n", "missing.raw: cannot open"),
        ("ElementDataFile =\n", "names ''"),
        ("", "no line 'ElementDataFile"),
        ("HeaderSize = 2\nElementDataFile = d.raw\n", "end after 14 of 16"),
        ("HeaderSize = -7\nElementDataFile = d.raw\n", "HeaderSize"),
        ("CompressedData = True\nElementDataFile = d.raw\n", "damaged"),
        ("CompressedData = perhaps\nElementDataFile = d.raw\n", "True or False"),
        ("CompressedData = True\nBinaryData = False\nElementDataFile = d.raw\n", "one of the two"),
        ("HeaderSize = -1\nCompressedData = True\nElementDataFile = d.raw\n", "CompressedDataSize"),
        ("HeaderSize = -1\nCompressedDataSize = 99\nCompressedData = True\nElementDataFile = d.raw\n", "end after"),
        ("ElementNumberOfChannels = 5\nElementDataFile = d.raw\n", "5 values"),
        ("ElementNumberOfChannels = 2\nElementDataFile = d.raw\n", "end after 16 of 32"),
        ("ElementSpacing = 1 0 1\nElementDataFile = d.raw\n", "above 0"),
        ("ElementSpacing = 1 -1 1\nElementDataFile = d.raw\n", "above 0"),
        ("ElementSpacing = 1 nan 1\nElementDataFile = d.raw\n", "above 0"),
        ("ElementSpacing = 1e308 1e308 1e308\nElementDataFile = d.raw\n", "not finite"),
        ("ElementSpacing = 1 1\nElementDataFile = d.raw\n", "3 numbers"),
        ("TransformMatrix = 1 0 0 1 0 0 0 0 1\nElementDataFile = d.raw\n", "one plane"),
        ("Offset = 1 2 inf\nElementDataFile = d.raw\n", "not finite"),
        ("NDims = 3\nElementDataFile = d.raw\n", "twice"),
        ("hello\n", "not 'Key = Value'"),
        ("ElementToIntensityFunctionSlope = 0\nElementDataFile = d.raw\n", "zero"),
    ] {
        refused(&f, "a.mhd", format!("{META}{fields}"), words);
    }
    refused(&f, "a.mha", local("", &[&i16_bytes(false)[..], &[0]].concat()), "holds 17 bytes");
    refused(&f, "a.mha", local("CompressedData = True\n", &[&packed[..], &[0]].concat()), "goes on after");
    refused(&f, "a.mha", local("CompressedData = True\n", &zlib(&[0; 17])), "more data than the 16");
    refused(&f, "a.mha", local("CompressedData = True\n", &zlib(&[0; 15])), "end after 15 of 16");
    refused(&f, "a.mha", META.replace("MET_SHORT", "MET_LONG_LONG") + "ElementDataFile = LOCAL\n", "MET_LONG_LONG");
    refused(&f, "a.mha", "ObjectType = Tube\nNDims = 3\nElementDataFile = LOCAL\n", "'Tube'");
    refused(&f, "a.mha", "NDims = 2\nDimSize = 2 2\nElementDataFile = LOCAL\n", "2 dimensions");
    refused(&f, "a.mha", "NDims = 3\nDimSize = 3 3 0\nElementType = MET_CHAR\nElementDataFile = LOCAL\n", "is empty");
    refused(&f, "a.mha", format!("NDims = 3\n{}", "x".repeat(2 << 20)), "1 MiB");
}

#[test]
fn metaimage_frames() {
    let f = Folder::new();
    f.file("d.raw", i16_bytes(false));
    let grid = |fields: &str| read(&f, "a.mhd", format!("{META}{fields}ElementDataFile = d.raw\n")).grid;
    // a row is the direction of an axis: i runs along +y here, j along -x
    for name in ["TransformMatrix", "Rotation", "Orientation"] {
        let g = grid(&format!("{name} = 0 1 0 -1 0 0 0 0 1\nOffset = 1 2 3\nElementSpacing = 2 3 4\n"));
        assert_eq!(g.space, Space::Lps);
        assert_eq!(g.world_from_voxel.transform_point3(DVec3::X), DVec3::new(1.0, 4.0, 3.0), "{name}");
        assert_eq!(g.world_from_voxel.transform_point3(DVec3::Y), DVec3::new(-2.0, 2.0, 3.0), "{name}");
        assert_eq!(g.world_from_voxel.transform_point3(DVec3::Z), DVec3::new(1.0, 2.0, 7.0), "{name}");
    }
    for name in ["Offset", "Position", "Origin"] {
        assert_eq!(grid(&format!("{name} = 1 2 3\n")).origin(), DVec3::new(1.0, 2.0, 3.0), "{name}");
    }
    assert_eq!(grid("ElementSize = 2 3 4\n").spacing(), DVec3::new(2.0, 3.0, 4.0));
    assert_eq!(grid("ElementSize = 9 9 9\nElementSpacing = 2 3 4\n").spacing(), DVec3::new(2.0, 3.0, 4.0));
}

#[test]
fn raw_volumes() {
    let f = Folder::new();
    // as the peers write them
    let json = r#"{"dims": [2, 2, 2], "endian": "little", "file": "a.raw", "note": "rest volume", "order": "x fastest",
        "origin": [-1.5, 0.0, 2.0], "spacing": [1.0, 2.0, 3], "type": "u16"}"#;
    f.file("a.json", json);
    f.file("a.raw", i16_bytes(false));
    for name in ["a.raw", "a.json"] {
        let v = read_volume(&f.path(name)).unwrap();
        assert_eq!(v.samples, Samples::U16(I16.iter().map(|x| *x as u16).collect()));
        assert_eq!((v.grid.spacing(), v.grid.origin()), (DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.5, 0.0, 2.0)));
        assert_eq!(v.grid.space, Space::Unknown);
    }
    let field =
        r#"{"dims":[2,1,1],"components":3,"type":"f32","order":"component fastest, then x","meaning":"position"}"#;
    f.file("field.json", field);
    let values = [1.5f32, 2.0, 3.0, 4.0, 5.0, f32::NAN];
    let v = read(&f, "field.raw", values.map(f32::to_le_bytes).concat());
    assert_eq!((v.channels, v.grid.dims, v.samples.bytes()), (3, [2, 1, 1], bytemuck::cast_slice(&values)));

    f.file("big.json", r#"{"dims":[2,2,2],"type":"i16","endian":"big","file":"elsewhere.bin"}"#);
    f.file("elsewhere.bin", i16_bytes(true));
    assert_eq!(read_volume(&f.path("big.json")).unwrap().samples, Samples::I16(I16.to_vec()));

    let turned =
        r#"{"dims":[3,4,5],"origin":[1,2,3],"spacing":[2,3,4],"direction":[[0,-1,0],[1,0,0],[0,0,1]],"space":"LPS"}"#;
    let g = read_grid(&f.file("grid.json", turned)).unwrap();
    assert_eq!((g.dims, g.space), ([3, 4, 5], Space::Lps));
    assert_eq!(g.world_from_voxel.transform_point3(DVec3::X), DVec3::new(1.0, 4.0, 3.0));
    assert_eq!(g.world_from_voxel.transform_point3(DVec3::Y), DVec3::new(-2.0, 2.0, 3.0));

    f.file("b.raw", [0; 8]);
    for (json, words) in [
        ("", "is not JSON"),
        ("[]", "not a JSON object"),
        (r#"{"type":"u8"}"#, "no key 'dims'"),
        (r#"{"dims":[2,2],"type":"u8"}"#, "3 whole numbers"),
        (r#"{"dims":[2,2,2.5],"type":"u8"}"#, "3 whole numbers"),
        (r#"{"dims":[2,2,-2],"type":"u8"}"#, "3 whole numbers"),
        (r#"{"dims":[2,2,0],"type":"u8"}"#, "is empty"),
        (r#"{"dims":[2,2,2]}"#, "no key 'type'"),
        (r#"{"dims":[2,2,2],"type":"u64"}"#, "u8, i8"),
        (r#"{"dims":[2,2,2],"type":"u16"}"#, "end after 8 of 16"),
        (r#"{"dims":[2,2,1],"type":"u8"}"#, "holds 8 bytes"),
        (r#"{"dims":[4294967295,4294967295,4294967295],"type":"u8"}"#, "too large"),
        (r#"{"dims":[1000000,1000000,100000],"type":"u8"}"#, "end after 8 of"),
        (r#"{"dims":[2,2,2],"type":"u8","spacing":[1,1,0]}"#, "above 0"),
        (r#"{"dims":[2,2,2],"type":"u8","spacing":[1,1,-1]}"#, "above 0"),
        (r#"{"dims":[2,2,2],"type":"u8","spacing":[1,1]}"#, "3 numbers"),
        (r#"{"dims":[2,2,2],"type":"u8","origin":[1,1,"x"]}"#, "3 numbers"),
        (r#"{"dims":[2,2,2],"type":"u8","origin":[1,1,1e400]}"#, "not JSON"),
        (r#"{"dims":[2,2,2],"type":"u8","direction":[[1,0,0],[1,0,0],[0,0,1]]}"#, "one plane"),
        (r#"{"dims":[2,2,2],"type":"u8","direction":[[1,0,0],[1,0,0]]}"#, "3 rows"),
        (r#"{"dims":[2,2,2],"type":"u8","channels":5}"#, "1 to 4"),
        (r#"{"dims":[2,2,2],"type":"u8","endian":"pdp"}"#, "little"),
        (r#"{"dims":[2,2,2],"type":"u8","space":"XYZ"}"#, "RAS"),
        (r#"{"dims":[2,2,2],"type":"u8","slope":0}"#, "slope"),
    ] {
        refused(&f, "b.json", json, words);
    }
    let deep = format!("{{\"a\":{}", "[".repeat(100_000));
    refused(&f, "b.json", deep, "is not JSON");
    std::fs::remove_file(f.path("b.json")).unwrap();
    let lone = |words: &str| {
        let error = read_volume(&f.path("b.raw")).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    lone("no b.json beside it");
    f.file("b.mhd", "");
    lone("b.mhd instead");
    refused(&f, "c.json", r#"{"dims":[2,2,2],"type":"u8"}"#, "no c.raw beside it");
    refused(&f, "c.json", r#"{"dims":[2,2,2],"type":"u8","file":"c.json"}"#, "names itself");
    refused(&f, "c.json", r#"{"dims":[2,2,2],"type":"u8","file":7}"#, "name of a file");
}

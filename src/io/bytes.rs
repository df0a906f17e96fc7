//! Sample data on disk: raw, deflated or written out, in either byte order.
//!
//! Nothing is allocated on a header's word alone. A raw block is compared with the length of the file first; a deflated one
//! grows with what arrives and is read to one byte beyond its promised end; text is counted against its characters.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use flate2::bufread::ZlibDecoder;

use super::IoError;
use super::steps::{Runs, Steps, Stream, pass};
use crate::volume::{Grid, Rescale, Samples, Scalar, ScalarType, Volume};
use crate::with_samples;

/// Runs an expression with the Rust type of a [`ScalarType`].
macro_rules! by_type {
    ($scalar:expr, $t:ident => $body:expr) => {
        match $scalar {
            ScalarType::U8 => {
                type $t = u8;
                $body
            }
            ScalarType::I8 => {
                type $t = i8;
                $body
            }
            ScalarType::U16 => {
                type $t = u16;
                $body
            }
            ScalarType::I16 => {
                type $t = i16;
                $body
            }
            ScalarType::U32 => {
                type $t = u32;
                $body
            }
            ScalarType::I32 => {
                type $t = i32;
                $body
            }
            ScalarType::F32 => {
                type $t = f32;
                $body
            }
            ScalarType::F64 => {
                type $t = f64;
                $body
            }
        }
    };
}

/// Which end of a number comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ByteOrder {
    Little,
    Big,
}

impl ByteOrder {
    pub const NATIVE: Self = if cfg!(target_endian = "big") { Self::Big } else { Self::Little };
}

/// How samples are laid down in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coding {
    Raw,
    Gzip,
    /// zlib, or gzip where the data begin like gzip.
    Zlib,
    /// Numbers separated by white space or commas.
    Text,
    /// Two hexadecimal digits a byte, white space ignored.
    Hex,
}

/// Where a block of samples begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Start {
    /// At this byte of the file.
    At(u64),
    /// This many bytes (`None`: as many as the samples take) before the end of the file.
    Tail(Option<u64>),
}

/// A block of samples in a file.
#[derive(Debug, Clone)]
pub(super) struct Block {
    pub path: PathBuf,
    pub start: Start,
    pub coding: Coding,
    /// Bytes to pass over after decoding (raw, deflated and hex data).
    pub skip: u64,
    pub order: ByteOrder,
    pub scalar: ScalarType,
}

/// Everything a header says, checked; the samples are still in the file.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub grid: Grid,
    /// 1 to 4.
    pub channels: usize,
    /// Samples between one channel and the next of the same voxel: 1 where channels are interleaved.
    pub channel_stride: usize,
    pub rescale: Rescale,
    /// Each has the samples of a whole volume.
    pub steps: Steps,
    pub block: Block,
}

impl Plan {
    /// Reads the samples, of a series those of its first step.
    pub fn load(self) -> Result<Volume, IoError> {
        self.load_step(0, &mut None)
    }

    /// Reads the samples of one step; those of others are passed over. Compressed data go on where `stream` stands, if it
    /// stands before the step.
    pub fn load_step(self, step: usize, stream: &mut Option<Stream>) -> Result<Volume, IoError> {
        if step >= self.steps.count {
            return Err(IoError::NoStep { path: self.block.path, step, steps: self.steps.count });
        }
        let samples = self.block.read(self.grid.len() * self.channels, self.steps, step, stream)?;
        let samples = if self.channels > 1 && self.channel_stride > 1 {
            with_samples!(&samples, v => Scalar::wrap(interleave(v, self.channels, self.channel_stride)))
        } else {
            samples
        };
        let mut volume = Volume::new(self.grid, self.channels, samples);
        volume.rescale = self.rescale;
        Ok(volume)
    }
}

/// Brings channels that lie `stride` samples apart together.
fn interleave<T: Scalar>(source: &[T], channels: usize, stride: usize) -> Vec<T> {
    let mut out = vec![T::zeroed(); source.len()];
    for (to, from) in out.chunks_exact_mut(channels * stride).zip(source.chunks_exact(channels * stride)) {
        for (c, plane) in from.chunks_exact(stride).enumerate() {
            to[c..].iter_mut().step_by(channels).zip(plane).for_each(|(t, f)| *t = *f);
        }
    }
    out
}

/// The samples of one channel after another, each as a whole volume.
pub(super) fn planar(samples: &Samples, channels: usize) -> Samples {
    fn split<T: Scalar>(source: &[T], channels: usize) -> Samples {
        T::wrap((0..channels).flat_map(|c| source[c..].iter().step_by(channels).copied()).collect())
    }
    with_samples!(samples, v => split(v, channels))
}

/// Opens a file whose length is known.
pub(super) fn open(path: &Path) -> Result<(File, u64), IoError> {
    // asked before opening: to open a pipe would wait for a writer
    let meta = fs::metadata(path).map_err(|e| IoError::system(path, "open", e))?;
    if meta.is_dir() {
        return Err(IoError::malformed(path, "is a folder; a file is needed here"));
    }
    if !meta.is_file() {
        return Err(IoError::unsupported(path, "is not a regular file, so its size cannot be known; copy it to one"));
    }
    let file = File::open(path).map_err(|e| IoError::system(path, "open", e))?;
    Ok((file, meta.len()))
}

/// The data file a header names, which must be a file other than the header.
pub(super) fn detached(header: &Path, name: &str) -> Result<PathBuf, IoError> {
    if name.is_empty() || name.contains(char::is_control) {
        return Err(IoError::malformed(
            header,
            format!("names {} as its data file; it must name the file that holds the samples", quote(name)),
        ));
    }
    let path = header.parent().unwrap_or(Path::new("")).join(name);
    let meta =
        fs::metadata(&path).map_err(|e| IoError::system(&path, "open the data file that its header names", e))?;
    if meta.is_dir() {
        return Err(IoError::malformed(
            header,
            format!(
                "names {} as its data file, which is a folder; it must name the file that holds the samples",
                path.display()
            ),
        ));
    }
    let same = |a: &Path, b: &Path| matches!((fs::canonicalize(a), fs::canonicalize(b)), (Ok(a), Ok(b)) if a == b);
    if same(header, &path) {
        return Err(IoError::malformed(
            header,
            "names itself as its data file; it must name the file that holds the samples",
        ));
    }
    Ok(path)
}

/// What is read of a block.
struct Piece {
    /// Samples of a step.
    count: usize,
    /// Bytes to pass over before it.
    before: u64,
    step: usize,
    steps: Steps,
    /// Bytes of a step that lie together, where steps take turns.
    run: Option<u64>,
}

impl Piece {
    /// Whether the block ends with it.
    fn ends(&self) -> bool {
        self.steps.count == 1 || (self.run.is_none() && self.step + 1 == self.steps.count)
    }
}

/// Why decoded data do not fill a block.
enum Fault {
    /// Ended after this many bytes.
    Short(u64),
    /// Went on after the last sample.
    Long,
    Damaged(io::Error),
    Memory,
}

impl From<io::Error> for Fault {
    fn from(e: io::Error) -> Self {
        Self::Damaged(e)
    }
}

impl Block {
    /// Reads the `count` samples of one step. A series that is cut off is read as far as whole steps reach.
    fn read(&self, count: usize, steps: Steps, step: usize, stream: &mut Option<Stream>) -> Result<Samples, IoError> {
        let path = self.path.as_path();
        let (mut file, len) = open(path)?;
        let bytes = self.scalar.bytes() as u64;
        let expected = count as u64 * bytes;
        let promised = expected.saturating_mul(steps.count as u64);
        // bytes before the step, and those that must be there for it
        let (before, needed) = match steps.run {
            None => (expected.saturating_mul(step as u64), expected.saturating_mul(step as u64 + 1)),
            Some(_) => (0, promised),
        };
        let short = |got, expected| short(path, (steps.count > 1).then_some(step), got, expected);
        let start = match self.start {
            Start::At(at) => at.min(len),
            Start::Tail(held) => {
                let held = held.unwrap_or(promised);
                len.checked_sub(held).ok_or_else(|| short(len, held))?
            }
        };
        let held = len - start;
        let fail = |e| IoError::system(path, "read", e);
        file.seek(SeekFrom::Start(start)).map_err(fail)?;
        let piece = Piece { count, before, step, steps, run: steps.run.map(|run| run as u64 * bytes) };
        let fault = |fault| match fault {
            Fault::Short(got) => short(got, if steps.run.is_some() { expected } else { needed }),
            Fault::Long => IoError::malformed(
                path,
                format!(
                    "holds more data than the {promised} bytes that the header promises; its sizes or its type must be wrong"
                ),
            ),
            Fault::Memory => {
                IoError::unsupported(path, format!("needs {expected} bytes of memory, which are not there"))
            }
            Fault::Damaged(e) => match e.kind() {
                io::ErrorKind::UnexpectedEof => {
                    IoError::malformed(path, "ends in the middle of its compressed data; the file is cut off")
                }
                io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput => IoError::malformed(
                    path,
                    format!("its compressed data are damaged or followed by something else ({e})"),
                ),
                _ => fail(e),
            },
        };
        match self.coding {
            Coding::Raw => {
                let wanted = promised.saturating_add(self.skip);
                if held < needed.saturating_add(self.skip) {
                    return Err(short(held, needed.saturating_add(self.skip)));
                }
                if held > wanted {
                    return Err(IoError::malformed(
                        path,
                        format!(
                            "holds {held} bytes of data where the header promises {wanted}; its sizes, its type or the bytes to skip must be wrong"
                        ),
                    ));
                }
                file.seek(SeekFrom::Start(start + self.skip + before)).map_err(fail)?;
                let mut runs;
                let source: &mut dyn Read = match piece.run {
                    None => &mut file,
                    Some(run) => {
                        runs = Runs::new(BufReader::with_capacity(1 << 18, file), run, steps.count, step);
                        &mut runs
                    }
                };
                let samples = by_type!(self.scalar, T => read_exact::<T>(source, count).map(T::wrap));
                Ok(self.native(samples.map_err(fault)?))
            }
            Coding::Gzip | Coding::Zlib => {
                // deflate makes at most 1032 bytes of one
                if needed / 1032 > held {
                    return Err(IoError::malformed(
                        path,
                        format!(
                            "its {held} bytes of compressed data cannot hold the {needed} bytes that the header promises; the file is cut off or its sizes are wrong"
                        ),
                    ));
                }
                let mut reader = BufReader::with_capacity(1 << 18, file);
                let gzip = self.coding == Coding::Gzip || reader.fill_buf().map_err(fail)?.starts_with(&[0x1f, 0x8b]);
                let samples = if gzip {
                    let begin = self.skip.saturating_add(before);
                    let mut from = stream.take().filter(|s| s.at <= begin).unwrap_or_else(|| Stream::new(reader));
                    let samples = self.inflate(&mut from.source, from.at, &piece).map_err(fault)?;
                    if piece.run.is_none() && !piece.ends() {
                        from.at = begin + expected;
                        *stream = Some(from);
                    }
                    samples
                } else {
                    let mut decoder = BufReader::new(ZlibDecoder::new(reader));
                    let samples = self.inflate(&mut decoder, 0, &piece).map_err(fault)?;
                    if piece.ends() && !decoder.into_inner().into_inner().fill_buf().map_err(fail)?.is_empty() {
                        return Err(IoError::malformed(
                            path,
                            "goes on after the end of its compressed data; the file must end there",
                        ));
                    }
                    samples
                };
                Ok(self.native(samples))
            }
            Coding::Text => {
                // a number and a separator take two characters at least
                let numbers = needed / bytes;
                if numbers.saturating_sub(1) > held / 2 {
                    return Err(IoError::malformed(
                        path,
                        format!(
                            "its {held} characters of data cannot hold the {numbers} numbers that the header promises; the file is cut off or its sizes are wrong"
                        ),
                    ));
                }
                let mut text = Vec::new();
                file.read_to_end(&mut text).map_err(fail)?;
                by_type!(self.scalar, T => parse_text::<T>(&text, &piece, self.scalar).map(T::wrap))
                    .map_err(|what| IoError::malformed(path, what))
            }
            Coding::Hex => {
                let digits = HexReader { inner: BufReader::with_capacity(1 << 18, file) };
                self.inflate(&mut BufReader::new(digits), 0, &piece).map(|s| self.native(s)).map_err(|f| match f {
                    Fault::Damaged(e) if e.kind() == io::ErrorKind::InvalidData => IoError::malformed(
                        path,
                        "has characters in its hexadecimal data that are not in pairs of digits 0-9, a-f",
                    ),
                    f => fault(f),
                })
            }
        }
    }

    /// Reads a piece of decoded data, of which `at` bytes were read before.
    fn inflate(&self, mut source: &mut dyn BufRead, at: u64, piece: &Piece) -> Result<Samples, Fault> {
        let over = self.skip.saturating_add(piece.before) - at;
        let passed = pass(source, over)?;
        if passed < over {
            return Err(Fault::Short((at + passed).saturating_sub(self.skip)));
        }
        let mut runs;
        let mut source: &mut dyn Read = match piece.run {
            None => &mut source,
            Some(run) => {
                runs = Runs::new(source, run, piece.steps.count, piece.step);
                &mut runs
            }
        };
        let samples = by_type!(self.scalar, T => read_growing::<T>(&mut source, piece.count).map(T::wrap));
        let samples = samples.map_err(|fault| match fault {
            Fault::Short(got) => Fault::Short(piece.before.saturating_add(got)),
            fault => fault,
        })?;
        // one byte more: shows that the data end here, and makes the decoder check its sum
        if piece.ends() && source.take(1).read_to_end(&mut Vec::new())? > 0 {
            return Err(Fault::Long);
        }
        Ok(samples)
    }

    /// Turns the bytes of each sample round where the file's order is not the machine's.
    fn native(&self, mut samples: Samples) -> Samples {
        if self.order != ByteOrder::NATIVE {
            swap(&mut samples);
        }
        samples
    }
}

/// Turns round the bytes of every sample.
fn swap(samples: &mut Samples) {
    // as integers, so that no bit of a NaN is touched
    fn two(v: &mut [u16]) {
        v.iter_mut().for_each(|x| *x = x.swap_bytes());
    }
    fn four(v: &mut [u32]) {
        v.iter_mut().for_each(|x| *x = x.swap_bytes());
    }
    match samples {
        Samples::U8(_) | Samples::I8(_) => {}
        Samples::U16(v) => two(v),
        Samples::I16(v) => two(bytemuck::cast_slice_mut(v)),
        Samples::U32(v) => four(v),
        Samples::I32(v) => four(bytemuck::cast_slice_mut(v)),
        Samples::F32(v) => four(bytemuck::cast_slice_mut(v)),
        Samples::F64(v) => bytemuck::cast_slice_mut::<f64, u64>(v).iter_mut().for_each(|x| *x = x.swap_bytes()),
    }
}

/// `step`: of a series.
fn short(path: &Path, step: Option<usize>, got: u64, expected: u64) -> IoError {
    let part = step.map_or(String::new(), |step| format!("step {step} is not all there: "));
    IoError::malformed(
        path,
        format!(
            "{part}its data end after {got} of {expected} bytes; the file is cut off or its header promises too much"
        ),
    )
}

/// `count` samples that are known to be there.
fn read_exact<T: Scalar>(source: &mut dyn Read, count: usize) -> Result<Vec<T>, Fault> {
    // asked first, because `vec!` ends the program where memory is short; it alone takes pages that are zero already
    Vec::<T>::new().try_reserve_exact(count).map_err(|_| Fault::Memory)?;
    let mut data = vec![T::zeroed(); count];
    source.read_exact(bytemuck::cast_slice_mut(&mut data))?;
    Ok(data)
}

/// `count` samples from a source that may hold fewer or more: memory grows with what arrives.
fn read_growing<T: Scalar>(source: &mut impl Read, count: usize) -> Result<Vec<T>, Fault> {
    let mut data: Vec<T> = Vec::new();
    let mut filled = 0;
    loop {
        if filled == size_of_val(data.as_slice()) {
            if data.len() == count {
                break;
            }
            let next = (2 * data.len()).max((1 << 18) / size_of::<T>()).min(count);
            data.try_reserve_exact(next - data.len()).map_err(|_| Fault::Memory)?;
            data.resize(next, T::zeroed());
        }
        match source.read(&mut bytemuck::cast_slice_mut(&mut data)[filled..]) {
            Ok(0) => return Err(Fault::Short(filled as u64)),
            Ok(n) => filled += n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e.into()),
        }
    }
    Ok(data)
}

/// Numbers in text; what is wrong as a sentence.
fn parse_text<T: Scalar + FromStr>(text: &[u8], piece: &Piece, scalar: ScalarType) -> Result<Vec<T>, String> {
    let Piece { count, step, steps, .. } = *piece;
    let promised = count.saturating_mul(steps.count);
    let mut data = Vec::with_capacity(count);
    let words = text.split(|b| b.is_ascii_whitespace() || *b == b',').filter(|w| !w.is_empty());
    let mut read = 0;
    for word in words {
        if read == promised {
            return Err(format!(
                "holds more than the {promised} numbers that the header promises; its sizes must be wrong"
            ));
        }
        read += 1;
        if !steps.holds(step, count, read - 1) {
            continue;
        }
        let value = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
        let value = value.ok_or_else(|| {
            let word = quote(&String::from_utf8_lossy(word));
            format!("{word} (number {read} of its data) is not a value of type {}", scalar.name())
        })?;
        data.push(value);
    }
    if data.len() < count {
        return Err(format!(
            "its data end after {read} of {promised} numbers; the file is cut off or its header promises too much"
        ));
    }
    Ok(data)
}

/// Bytes from pairs of hexadecimal digits.
struct HexReader<R> {
    inner: R,
}

impl<R: BufRead> HexReader<R> {
    fn digit(&mut self) -> io::Result<Option<u8>> {
        loop {
            let Some(&c) = self.inner.fill_buf()?.first() else { return Ok(None) };
            self.inner.consume(1);
            if !c.is_ascii_whitespace() {
                let value = (c as char).to_digit(16).ok_or(io::ErrorKind::InvalidData)?;
                return Ok(Some(value as u8));
            }
        }
    }
}

impl<R: BufRead> Read for HexReader<R> {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        for (n, byte) in buf.iter_mut().enumerate() {
            let Some(high) = self.digit()? else { return Ok(n) };
            let low = self.digit()?.ok_or(io::ErrorKind::InvalidData)?;
            *byte = high << 4 | low;
        }
        Ok(buf.len())
    }
}

/// A part of a file, fit for a message: short, and without control characters.
pub(super) fn quote(text: &str) -> String {
    let mut shown: String = text.chars().take(40).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if text.chars().nth(40).is_some() {
        shown.push_str("...");
    }
    format!("'{shown}'")
}

/// The samples in little-endian order.
pub(super) fn little_endian(samples: &Samples) -> std::borrow::Cow<'_, [u8]> {
    if ByteOrder::NATIVE == ByteOrder::Little {
        samples.bytes().into()
    } else {
        let mut turned = samples.clone();
        swap(&mut turned);
        turned.bytes().to_vec().into()
    }
}

/// Writes numbers in text, `row` of them on a line. They read back to the same value (of NaNs, only that they are).
pub(super) fn write_text(w: &mut dyn Write, samples: &Samples, row: usize) -> io::Result<()> {
    fn rows<T: Scalar>(w: &mut dyn Write, v: &[T], row: usize) -> io::Result<()> {
        for line in v.chunks(row) {
            for (i, x) in line.iter().enumerate() {
                let gap = if i == 0 { "" } else { " " };
                // unlike `{}`, not hundreds of digits for large and small numbers
                write!(w, "{gap}{x:?}")?;
            }
            writeln!(w)?;
        }
        Ok(())
    }
    with_samples!(samples, v => rows(w, v, row))
}

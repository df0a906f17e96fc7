//! The XML files of VTK: elements, and arrays in all encodings.
//!
//! After "VTK File Formats" and what VTK 9 writes. An array is text, or bytes inline in base64, or bytes in the section
//! `AppendedData`, which follows all elements as base64 or as it is. Bytes begin with their number; compressed ones with the
//! number of blocks, the size of a block, the size of the last if it is not whole (else 0), and the compressed size of each.
//! These numbers take 4 bytes or 8 (`header_type`) in the byte order of the file. Base64 may be padded in its middle, because
//! the numbers and the data are encoded one after the other.

use std::borrow::Cow;
use std::cell::Cell;
use std::io::Read;

use flate2::read::ZlibDecoder;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use rayon::prelude::*;

use super::bytes::ByteOrder;
use super::error::Fault;
use super::numbers::{Kind, Numbers};
use super::vtk_cells::Array;
use super::words::{Words, show};

/// Elements in elements after which a file is not believed.
const DEEPEST: usize = 64;
/// Attributes of one element, each of which is compared with all others.
const MOST_ATTRIBUTES: usize = 64;
/// How often all appended data may be read: arrays may share data, but not without end.
const MOST_SHARED: u64 = 4;

/// An element with what is in it.
#[derive(Default)]
pub(super) struct Element<'a> {
    pub name: String,
    attributes: Vec<(String, String)>,
    text: Cow<'a, [u8]>,
    pub children: Vec<Element<'a>>,
}

impl<'a> Element<'a> {
    fn open(start: &BytesStart) -> Result<Self, String> {
        let name = String::from_utf8_lossy(start.name().as_ref()).into_owned();
        let mut attributes = Vec::new();
        for (i, attribute) in start.attributes().enumerate() {
            let bad =
                |e: &dyn std::fmt::Display| format!("the element {} has a bad attribute ({e})", show(name.as_bytes()));
            if i == MOST_ATTRIBUTES {
                return Err(bad(&format!("there are more than {MOST_ATTRIBUTES}")));
            }
            let attribute = attribute.map_err(|e| bad(&e))?;
            let value = attribute.unescape_value().map_err(|e| bad(&e))?.into_owned();
            attributes.push((String::from_utf8_lossy(attribute.key.as_ref()).into_owned(), value));
        }
        Ok(Self { name, attributes, ..Self::default() })
    }

    pub fn get(&self, attribute: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == attribute).map(|(_, value)| value.as_str())
    }

    /// A number of an attribute that must be there.
    pub fn number<T: std::str::FromStr>(&self, attribute: &str) -> Result<T, String> {
        let value = self.get(attribute).ok_or_else(|| format!("an element {} has no {attribute}", self.name))?;
        value.trim().parse().map_err(|_| {
            format!("an element {} has {attribute} '{}', which must be a number", self.name, show(value.as_bytes()))
        })
    }

    pub fn child(&self, name: &str) -> Option<&Element<'a>> {
        self.children.iter().find(|c| c.name == name)
    }

    pub fn all<'e>(&'e self, name: &'e str) -> impl Iterator<Item = &'e Element<'a>> {
        self.children.iter().filter(move |c| c.name == name)
    }
}

/// A file taken apart; the numbers of its arrays are still encoded.
pub(super) struct Document<'a> {
    pub root: Element<'a>,
    order: ByteOrder,
    /// Bytes of the numbers before data.
    header: usize,
    compressor: Option<String>,
    appended: Option<Stream<'a>>,
    /// Encoded bytes that arrays have taken so far, and how many they may.
    taken: Cell<u64>,
    most: u64,
}

impl<'a> Document<'a> {
    /// Reads the elements of a file of this type.
    pub fn parse(bytes: &'a [u8], kind: &str) -> Result<Self, Fault> {
        // what follows need not be XML
        let mark = b"<AppendedData";
        let cut = bytes.windows(mark.len()).position(|w| w == mark);
        let root = elements(&bytes[..cut.unwrap_or(bytes.len())], cut.is_some())?;
        if root.name != "VTKFile" {
            return Err("does not begin with an element VTKFile, as XML files of VTK do".into());
        }
        let found = root.get("type").unwrap_or_default();
        if found != kind {
            return Err(Fault::Unsupported(format!("holds '{}', but {kind} is wanted here", show(found.as_bytes()))));
        }
        let order = match root.get("byte_order") {
            None | Some("LittleEndian") => ByteOrder::Little,
            Some("BigEndian") => ByteOrder::Big,
            Some(other) => {
                let other = show(other.as_bytes());
                return Err(format!("its byte_order is '{other}'; it must be LittleEndian or BigEndian").into());
            }
        };
        let header = match root.get("header_type") {
            None | Some("UInt32") => 4,
            Some("UInt64") => 8,
            Some(other) => {
                let other = show(other.as_bytes());
                return Err(format!("its header_type is '{other}'; it must be UInt32 or UInt64").into());
            }
        };
        let compressor = root.get("compressor").filter(|c| !c.is_empty()).map(str::to_owned);
        let appended = cut.map(|at| appended(&bytes[at..])).transpose()?;
        let most = MOST_SHARED * bytes.len() as u64;
        Ok(Self { root, order, header, compressor, appended, taken: Cell::new(0), most })
    }

    /// The element that the type of the file is named after.
    pub fn body(&self) -> Result<&Element<'a>, String> {
        let kind = self.root.get("type").unwrap_or_default();
        self.root.child(kind).ok_or_else(|| format!("has no element {kind}"))
    }

    /// Reads an array; `None` if it holds strings or bits.
    pub fn array(&self, element: &Element<'a>) -> Result<Option<Array>, Fault> {
        let name = element.get("Name").unwrap_or_default().to_owned();
        let at = |what: String| format!("the array '{}': {what}", show(name.as_bytes()));
        let kind = match element.get("type").unwrap_or_default() {
            "Int8" => Kind::I8,
            "UInt8" => Kind::U8,
            "Int16" => Kind::I16,
            "UInt16" => Kind::U16,
            "Int32" => Kind::I32,
            "UInt32" => Kind::U32,
            "Int64" => Kind::I64,
            "UInt64" => Kind::U64,
            "Float32" => Kind::F32,
            "Float64" => Kind::F64,
            "String" | "Bit" => return Ok(None),
            other => return Err(at(format!("its type '{}' is none of VTK's", show(other.as_bytes()))).into()),
        };
        let components = components(element)?;
        let numbers = match element.get("format").unwrap_or("ascii") {
            "ascii" => {
                let mut words = Words::new(&element.text, 1);
                let count = element.text.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).count();
                Numbers::from_words(kind, &mut words, count).map_err(at)?
            }
            "binary" => self.decode(kind, Stream::Base64(Base64::new(&element.text)), &at)?,
            "appended" => {
                let offset: u64 = element.number("offset")?;
                let data = self.appended.clone().ok_or_else(|| at("it is appended, but nothing is".to_owned()))?;
                let data = data.skip(offset).ok_or_else(|| at(format!("its offset {offset} lies beyond the data")))?;
                self.decode(kind, data, &at)?
            }
            other => {
                let other = show(other.as_bytes());
                return Err(at(format!("its format is '{other}'; it must be ascii, binary or appended")).into());
            }
        };
        Ok(Some(Array { name, components, numbers }))
    }

    /// The arrays of an element such as `PointData` whose name and number of components are `wanted`.
    pub fn arrays(
        &self,
        element: Option<&Element<'a>>,
        wanted: impl Fn(&str, usize) -> bool,
    ) -> Result<Vec<Array>, Fault> {
        let mut out = Vec::new();
        for e in element.map(|e| e.all("DataArray")).into_iter().flatten() {
            if wanted(e.get("Name").unwrap_or_default(), components(e)?) {
                out.extend(self.array(e)?);
            }
        }
        Ok(out)
    }

    fn decode(&self, kind: Kind, mut data: Stream, at: &dyn Fn(String) -> String) -> Result<Numbers, Fault> {
        let bytes = match self.compressor.as_deref() {
            None => {
                let size = self.size(&mut data).map_err(at)?;
                let taken = data.take(size).map_err(at)?;
                self.share(size).map_err(at)?;
                taken.into_owned()
            }
            Some("vtkZLibDataCompressor") => self.inflated(&mut data).map_err(at)?,
            Some(other) => {
                return Err(Fault::Unsupported(at(format!(
                    "it is compressed by '{}'; Voxclay reads vtkZLibDataCompressor, so save it with that or none",
                    show(other.as_bytes())
                ))));
            }
        };
        Ok(Numbers::from_bytes(kind, bytes, self.order))
    }

    /// Counts bytes that an array takes. Of arrays that all name the same data there could be as many as fit the file.
    fn share(&self, bytes: u64) -> Result<(), String> {
        self.taken.set(self.taken.get().saturating_add(bytes));
        if self.taken.get() <= self.most {
            return Ok(());
        }
        Err("with it the arrays take more data than the file has; its length or offset must be wrong".to_owned())
    }

    /// One of the numbers before data.
    fn size(&self, data: &mut Stream) -> Result<u64, String> {
        let taken = data.take(self.header as u64)?;
        let add = |n: u64, b: &u8| n << 8 | u64::from(*b);
        Ok(if self.order == ByteOrder::Big { taken.iter().fold(0, add) } else { taken.iter().rev().fold(0, add) })
    }

    fn inflated(&self, data: &mut Stream) -> Result<Vec<u8>, String> {
        let (blocks, size, last) = (self.size(data)?, self.size(data)?, self.size(data)?);
        if blocks == 0 {
            return Ok(Vec::new());
        }
        data.room(blocks.saturating_mul(self.header as u64))?;
        let sizes = (0..blocks).map(|_| self.size(data)).collect::<Result<Vec<u64>, String>>()?;
        let packed = sizes.iter().fold(0u64, |sum, s| sum.saturating_add(*s));
        let packed = data.take(packed)?;
        self.share(packed.len() as u64)?;
        let whole = if last == 0 { blocks } else { blocks - 1 };
        let total = whole.checked_mul(size).and_then(|n| n.checked_add(last));
        // deflate makes at most 1032 bytes of one
        let total = total.filter(|n| size > 0 && last <= size && n / 1032 <= packed.len() as u64).ok_or_else(|| {
            format!("its {} compressed bytes cannot hold {blocks} blocks of {size} bytes", packed.len())
        })?;
        let mut rest = &*packed;
        let mut inputs = Vec::with_capacity(sizes.len());
        for s in sizes {
            let (block, after) = rest.split_at(s as usize);
            inputs.push(block);
            rest = after;
        }
        let mut out = vec![0; total as usize];
        out.par_chunks_mut(size as usize).zip(inputs).try_for_each(|(to, from)| {
            let mut decoder = ZlibDecoder::new(from);
            decoder.read_exact(to).map_err(|e| format!("its compressed data are damaged or cut off ({e})"))?;
            // one byte more makes the decoder check its sum
            match decoder.read(&mut [0]) {
                Ok(0) => Ok(()),
                _ => Err("its compressed data are damaged or hold more than they should".to_owned()),
            }
        })?;
        Ok(out)
    }
}

fn components(array: &Element) -> Result<usize, String> {
    if array.get("NumberOfComponents").is_some() { array.number("NumberOfComponents") } else { Ok(1) }
}

/// The outermost element; where the rest of the file is `cut` away, elements may be open at the end.
fn elements(text: &[u8], cut: bool) -> Result<Element<'_>, String> {
    let mut reader = Reader::from_reader(text);
    let mut open: Vec<Element> = Vec::new();
    let mut root = None;
    loop {
        let event = reader.read_event();
        let event = event.map_err(|e| format!("its XML is broken near byte {} ({e})", reader.error_position()))?;
        match event {
            Event::Start(start) => {
                if open.len() == DEEPEST {
                    return Err(format!("its elements lie deeper than {DEEPEST} in one another"));
                }
                open.push(Element::open(&start)?);
            }
            Event::Empty(start) => {
                open.push(Element::open(&start)?);
                close(&mut open, &mut root);
            }
            Event::End(_) => close(&mut open, &mut root),
            Event::Text(text) => {
                if let Some(element) = open.last_mut().filter(|e| e.name == "DataArray") {
                    let text = text.into_inner();
                    // elements may stand between stretches of text
                    if element.text.trim_ascii().is_empty() {
                        element.text = text;
                    } else if !text.trim_ascii().is_empty() {
                        element.text.to_mut().extend_from_slice(&text);
                    }
                }
            }
            Event::Eof => break,
            _ => {}
        }
    }
    while cut && !open.is_empty() {
        close(&mut open, &mut root);
    }
    match open.pop() {
        Some(element) => Err(format!("the file breaks off in the element {}", show(element.name.as_bytes()))),
        None => root.ok_or_else(|| "holds no element of XML".to_owned()),
    }
}

/// Ends the innermost open element.
fn close<'a>(open: &mut Vec<Element<'a>>, root: &mut Option<Element<'a>>) {
    let Some(element) = open.pop() else { return };
    match open.last_mut() {
        Some(parent) => parent.children.push(element),
        None => *root = Some(element),
    }
}

/// What `AppendedData` holds, from its tag to the end of the file.
fn appended(bytes: &[u8]) -> Result<Stream<'_>, String> {
    let open = bytes.iter().position(|b| *b == b'>').ok_or("the file breaks off in the element AppendedData")?;
    let tag = elements(&bytes[..=open], true)?;
    let rest = &bytes[open + 1..];
    let end = rest.trim_ascii_end();
    if !end.ends_with(b"</VTKFile>") {
        return Err("the file breaks off in its appended data; it must end in </VTKFile>".to_owned());
    }
    let start = rest.iter().position(|b| !b.is_ascii_whitespace()).filter(|&at| rest[at] == b'_');
    let data = &rest[start.ok_or("its appended data do not begin with '_'")? + 1..];
    match tag.get("encoding") {
        Some("raw") => Ok(Stream::Raw(data)),
        Some("base64") => Ok(Stream::Base64(Base64::new(data))),
        other => {
            let other = show(other.unwrap_or_default().as_bytes());
            Err(format!("its appended data are encoded as '{other}'; it must be raw or base64"))
        }
    }
}

/// Bytes, be they encoded or not.
#[derive(Clone)]
enum Stream<'a> {
    Raw(&'a [u8]),
    Base64(Base64<'a>),
}

impl<'a> Stream<'a> {
    /// Goes forward by so many bytes of the file.
    fn skip(self, offset: u64) -> Option<Self> {
        let offset = usize::try_from(offset).ok()?;
        Some(match self {
            Self::Raw(data) => Self::Raw(data.get(offset..)?),
            Self::Base64(data) => Self::Base64(Base64::new(data.text.get(offset..)?)),
        })
    }

    /// Whether so many bytes can follow.
    fn room(&self, count: u64) -> Result<(), String> {
        let left = match self {
            Self::Raw(data) => data.len(),
            Self::Base64(data) => data.text.len() / 4 * 3 + 3,
        };
        if count > left as u64 {
            return Err(format!("it should have {count} bytes of data, but only {left} follow"));
        }
        Ok(())
    }

    fn take(&mut self, count: u64) -> Result<Cow<'a, [u8]>, String> {
        self.room(count)?;
        let count = count as usize;
        match self {
            Self::Raw(data) => {
                let (taken, rest) = data.split_at(count);
                *data = rest;
                Ok(taken.into())
            }
            Self::Base64(data) => data.take(count).map(Cow::Owned),
        }
    }
}

/// Base64 that is decoded as far as it is needed.
#[derive(Clone)]
struct Base64<'a> {
    text: &'a [u8],
    /// Decoded bytes that are not taken yet, at the end.
    held: [u8; 3],
    count: usize,
}

impl<'a> Base64<'a> {
    fn new(text: &'a [u8]) -> Self {
        Self { text, held: [0; 3], count: 0 }
    }

    fn take(&mut self, count: usize) -> Result<Vec<u8>, String> {
        let mut out = Vec::with_capacity(count + 3);
        out.extend_from_slice(&self.held[3 - self.count..]);
        while out.len() < count {
            self.group(&mut out)?;
        }
        self.count = out.len() - count;
        self.held[3 - self.count..].copy_from_slice(&out[count..]);
        out.truncate(count);
        Ok(out)
    }

    /// Decodes four characters to one, two or three bytes.
    fn group(&mut self, out: &mut Vec<u8>) -> Result<(), String> {
        let mut digits = [0u32; 4];
        let mut padding = 0;
        let mut found = 0;
        while found < 4 {
            let (&c, rest) = self.text.split_first().ok_or("its base64 data break off")?;
            let digit = match c {
                b'A'..=b'Z' => c - b'A',
                b'a'..=b'z' => c - b'a' + 26,
                b'0'..=b'9' => c - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                b'=' => 0,
                _ if c.is_ascii_whitespace() => {
                    self.text = rest;
                    continue;
                }
                b'<' => return Err("its base64 data break off".to_owned()),
                _ => return Err("it has characters that are not base64".to_owned()),
            };
            if c != b'=' && padding > 0 || c == b'=' && found < 2 {
                return Err("its base64 data are padded where they must not be".to_owned());
            }
            padding += usize::from(c == b'=');
            digits[found] = u32::from(digit);
            found += 1;
            self.text = rest;
        }
        let bits = digits.iter().fold(0, |bits, d| bits << 6 | d);
        out.extend_from_slice(&bits.to_be_bytes()[1..4 - padding]);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_decoded_piece_by_piece_and_across_padding() {
        // "Man" "M" "Ma", the latter two padded
        let mut stream = Base64::new(b"TW\n FuTQ==TWE=TWFu<");
        assert_eq!(stream.take(2), Ok(b"Ma".to_vec()));
        assert_eq!(stream.take(0), Ok(Vec::new()));
        assert_eq!(stream.take(3), Ok(b"nMM".to_vec()));
        assert_eq!(stream.take(4), Ok(b"aMan".to_vec()));
        assert_eq!(stream.take(1), Err("its base64 data break off".to_owned()));
        for bad in [&b"T=Fu"[..], b"TW=u", b"TW\xff=", b"TWF", b"=TWF"] {
            assert!(Base64::new(bad).take(3).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn elements_hold_their_own_text_only() {
        let text = b"<?xml version='1.0'?><!-- x --><a k='1 &quot;2&quot;'><DataArray>\n <Value>9</Value> 1 2 </DataArray><b/></a>";
        let root = elements(text, false).expect("reads");
        assert_eq!((root.name.as_str(), root.get("k"), root.children.len()), ("a", Some("1 \"2\""), 2));
        assert_eq!(root.child("DataArray").expect("there").text.trim_ascii(), b"1 2");
        assert!(elements(b"<a><b>", false).is_err_and(|e| e.contains("breaks off in the element b")));
        assert!(elements(b"<a><b></a>", false).is_err() && elements(b"", false).is_err());
        assert!(elements("<a>".repeat(100).as_bytes(), true).is_err_and(|e| e.contains("deeper than 64")));
    }
}

//! Raw volumes: `NAME.raw`, samples only, with `NAME.json` beside it to say what they are.
//!
//! The JSON object has `dims` `[x, y, z]` and `type` (u8, i8, u16, i16, u32, i32, f32, f64); `spacing` and `origin` are 1 and 0
//! where they are not given. Voxel (i,j,k) has its centre at `origin + direction * (spacing * (i,j,k))`; `direction`, three
//! rows, is the identity where it is not given. Also understood: `channels` (or `components`), `endian`, `space` (RAS, LPS),
//! `slope` and `intercept`, and `file`, which names the samples where `NAME.raw` is not there. Other keys are passed over.
//! The same object without samples describes a grid ([`read_grid`]).

use std::io::Read;
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};
use serde_json::{Value, json};

use super::IoError;
use super::bytes::{self, Block, ByteOrder, Coding, Plan, Start, quote};
use super::deflate::Wrapper;
use super::header;
use super::steps::Steps;
use super::store::{self, Body};
use super::volume::{Encoding, WriteOptions};
use crate::volume::{Grid, Rescale, ScalarType, Space, Volume};

/// Reads a raw volume; either of its two files may be named.
///
/// # Errors
/// If one of the files cannot be read, or they do not fit each other.
pub fn read(path: &Path) -> Result<Volume, IoError> {
    plan(path)?.load()
}

/// Reads a grid from JSON. A `type` or samples are not needed.
///
/// # Errors
/// If the file cannot be read, or does not describe a grid.
pub fn read_grid(path: &Path) -> Result<Grid, IoError> {
    Description::read(path)?.grid()
}

/// Reads the header.
pub(super) fn plan(path: &Path) -> Result<Plan, IoError> {
    let named_header = store::ends_with(path, ".json");
    let header_path = if named_header { path.to_owned() } else { path.with_extension("json") };
    if !header_path.exists() && path.exists() {
        let others = ["nhdr", "mhd"].map(|e| path.with_extension(e));
        let hint = match others.iter().find(|o| o.exists()) {
            Some(other) => format!("; open {} instead", other.display()),
            None => String::new(),
        };
        return Err(IoError::malformed(
            path,
            format!("has no {} beside it to say its size and type{hint}", store::file_name(&header_path)),
        ));
    }
    let description = Description::read(&header_path)?;
    let grid = description.grid()?;
    let channels = description.channels()?;
    let data = if named_header { description.data_file()? } else { path.to_owned() };
    let block = Block {
        path: data,
        start: Start::At(0),
        coding: Coding::Raw,
        skip: 0,
        order: description.order()?,
        scalar: description.scalar()?,
    };
    Ok(Plan { grid, channels, channel_stride: 1, rescale: description.rescale()?, steps: Steps::ONE, block })
}

/// The JSON object.
struct Description<'a> {
    path: &'a Path,
    json: Value,
}

impl<'a> Description<'a> {
    fn read(path: &'a Path) -> Result<Self, IoError> {
        let (file, _) = bytes::open(path)?;
        let mut text = Vec::new();
        file.take(header::LONGEST + 1).read_to_end(&mut text).map_err(|e| IoError::system(path, "read", e))?;
        if text.len() as u64 > header::LONGEST {
            return Err(IoError::malformed(
                path,
                "is longer than 1 MiB; the header of a raw volume is a short JSON object",
            ));
        }
        let json: Value = serde_json::from_slice(&text).map_err(|e| {
            IoError::malformed(path, format!("is not JSON ({e}); it must describe a raw volume or a grid"))
        })?;
        if !json.is_object() {
            return Err(IoError::malformed(path, "is not a JSON object such as {\"dims\":[4,4,4],\"type\":\"u8\"}"));
        }
        Ok(Self { path, json })
    }

    /// A key that is there and not null.
    fn get(&self, key: &str) -> Option<&Value> {
        self.json.get(key).filter(|v| !v.is_null())
    }

    fn bad(&self, key: &str, value: &Value, right: &str) -> IoError {
        IoError::malformed(self.path, format!("its key '{key}' is {}; it must be {right}", quote(&value.to_string())))
    }

    fn vec3(&self, key: &str, default: DVec3) -> Result<DVec3, IoError> {
        match self.get(key) {
            None => Ok(default),
            Some(value) => vec3(value).ok_or_else(|| self.bad(key, value, "a list of 3 numbers")),
        }
    }

    fn grid(&self) -> Result<Grid, IoError> {
        let dims = self.get("dims").ok_or_else(|| {
            IoError::malformed(self.path, "has no key 'dims', which must give the voxels along x, y, z")
        })?;
        let sizes: Option<Vec<usize>> =
            dims.as_array().and_then(|l| l.iter().map(|n| n.as_u64().and_then(|n| n.try_into().ok())).collect());
        let sizes: [usize; 3] =
            sizes.and_then(|s| s.try_into().ok()).ok_or_else(|| self.bad("dims", dims, "a list of 3 whole numbers"))?;
        let spacing = self.vec3("spacing", DVec3::ONE)?;
        if !spacing.cmpgt(DVec3::ZERO).all() {
            let value = self.get("spacing").unwrap_or(&Value::Null);
            return Err(self.bad("spacing", value, "3 numbers above 0 (a mirrored axis belongs into 'direction')"));
        }
        let direction = match self.get("direction") {
            None => DMat3::IDENTITY,
            Some(value) => {
                let rows: Option<Vec<DVec3>> = value.as_array().and_then(|rows| rows.iter().map(vec3).collect());
                let [x, y, z] = rows
                    .and_then(|r| r.try_into().ok())
                    .ok_or_else(|| self.bad("direction", value, "3 rows of 3 numbers"))?;
                DMat3::from_cols(x, y, z).transpose()
            }
        };
        let space = match self.get("space") {
            None => Space::Unknown,
            Some(value) => match value.as_str().map(str::to_ascii_lowercase).as_deref() {
                Some("ras") => Space::Ras,
                Some("lps") => Space::Lps,
                _ => return Err(self.bad("space", value, "\"RAS\" or \"LPS\", or not given")),
            },
        };
        let origin = self.vec3("origin", DVec3::ZERO)?;
        header::grid(self.path, sizes, direction * DMat3::from_diagonal(spacing), origin, space)
    }

    fn scalar(&self) -> Result<ScalarType, IoError> {
        let right = "one of u8, i8, u16, i16, u32, i32, f32, f64";
        let value = self
            .get("type")
            .ok_or_else(|| IoError::malformed(self.path, format!("has no key 'type', which must be {right}")))?;
        let found = ScalarType::ALL.into_iter().find(|t| value.as_str() == Some(t.name()));
        found.ok_or_else(|| self.bad("type", value, right))
    }

    fn channels(&self) -> Result<usize, IoError> {
        for key in ["channels", "components"] {
            if let Some(value) = self.get(key) {
                let n = value.as_u64().filter(|n| (1..=4).contains(n));
                return n.map(|n| n as usize).ok_or_else(|| self.bad(key, value, "a whole number from 1 to 4"));
            }
        }
        Ok(1)
    }

    fn order(&self) -> Result<ByteOrder, IoError> {
        match self.get("endian") {
            None => Ok(ByteOrder::Little),
            Some(value) => match value.as_str() {
                Some("little") => Ok(ByteOrder::Little),
                Some("big") => Ok(ByteOrder::Big),
                _ => Err(self.bad("endian", value, "\"little\" or \"big\"")),
            },
        }
    }

    fn rescale(&self) -> Result<Rescale, IoError> {
        let number = |key: &str, default: f64| match self.get(key) {
            None => Ok(default),
            Some(value) => value.as_f64().ok_or_else(|| self.bad(key, value, "a number")),
        };
        let rescale = Rescale { slope: number("slope", 1.0)?, intercept: number("intercept", 0.0)? };
        if rescale.slope == 0.0 || !rescale.slope.is_finite() || !rescale.intercept.is_finite() {
            return Err(IoError::malformed(
                self.path,
                "its key 'slope' is 0 or not finite; it must be a number by which samples can be scaled",
            ));
        }
        Ok(rescale)
    }

    /// `NAME.raw`, or what `file` names.
    fn data_file(&self) -> Result<PathBuf, IoError> {
        let usual = self.path.with_extension("raw");
        match self.get("file").map(|v| v.as_str().ok_or_else(|| self.bad("file", v, "the name of a file"))) {
            Some(name) if !usual.exists() => bytes::detached(self.path, name?),
            _ if !usual.exists() => Err(IoError::malformed(
                self.path,
                format!("has no {} beside it that holds the samples", store::file_name(&usual)),
            )),
            _ => Ok(usual),
        }
    }
}

fn vec3(value: &Value) -> Option<DVec3> {
    let numbers: Option<Vec<f64>> = value.as_array()?.iter().map(Value::as_f64).collect();
    <[f64; 3]>::try_from(numbers?).ok().map(DVec3::from_array)
}

/// Writes `NAME.raw` and `NAME.json`, whichever of the two is named; little endian.
///
/// # Errors
/// If text is asked for, or a file cannot be written; what was there before is left.
pub fn write(path: &Path, volume: &Volume, options: &WriteOptions) -> Result<(), IoError> {
    if options.encoding == Encoding::Text {
        return Err(IoError::unsupported(
            path,
            "a raw volume cannot be written as text; use .nrrd or .mha, or another encoding",
        ));
    }
    let (header_path, data_path) = (store::beside(path, "json")?, store::beside(path, "raw")?);
    let grid = &volume.grid;
    let (spacing, direction) = header::spacing_and_direction(grid);
    let mut object = json!({
        "file": store::file_name(&data_path),
        "dims": grid.dims,
        "type": volume.samples.scalar_type().name(),
        "order": if volume.channels > 1 { "component fastest, then x" } else { "x fastest" },
        "endian": "little",
        "origin": grid.origin().to_array(),
        "spacing": spacing.to_array(),
    });
    if direction != DMat3::IDENTITY {
        object["direction"] = json!(direction.transpose().to_cols_array_2d());
    }
    if volume.channels > 1 {
        object["channels"] = json!(volume.channels);
    }
    match grid.space {
        Space::Unknown => {}
        Space::Ras => object["space"] = json!("RAS"),
        Space::Lps => object["space"] = json!("LPS"),
    }
    if volume.rescale != Rescale::default() {
        object["slope"] = json!(volume.rescale.slope);
        object["intercept"] = json!(volume.rescale.intercept);
    }
    let text = format!("{object:#}\n");
    let body = Body::new(volume, Encoding::Raw, Wrapper::Zlib);
    store::write_pair(&header_path, text.as_bytes(), &data_path, |w| body.write(w))
}

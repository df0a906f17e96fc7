//! Shaders are put together from the shared pieces in `shaders/`, headed by the constants of a variant.
//!
//! WGSL has no preprocessor. Branches on the constants below are gone after the driver's constant folding, so a variant
//! costs nothing where it does not apply. `tests/shaders.rs` parses and validates every one of them.

use std::fmt::Write;

use super::{Coefficients, Shade};
use crate::render::{FINISHED, Second};
use crate::warp::SNAP;

const COMMON: &str = include_str!("../../shaders/common.wgsl");
const FIELD: &str = include_str!("../../shaders/field.wgsl");
const SHADE: &str = include_str!("../../shaders/shade.wgsl");
const DEFORM: &str = include_str!("../../shaders/deform.wgsl");
const PLACE_MESH: &str = include_str!("../../shaders/place_mesh.wgsl");
const PLACE_EXACT: &str = include_str!("../../shaders/place_exact.wgsl");
const RESAMPLE: &str = include_str!("../../shaders/resample.wgsl");
const WARP: &str = include_str!("../../shaders/warp.wgsl");
const WARP_CLAIM: &str = include_str!("../../shaders/warp_claim.wgsl");
const WARP_SAMPLE: &str = include_str!("../../shaders/warp_sample.wgsl");
const FULLSCREEN: &str = include_str!("../../shaders/fullscreen.wgsl");
const SPLINE: &str = include_str!("../../shaders/spline.wgsl");
const SPLINE_SCAN: &str = include_str!("../../shaders/spline_scan.wgsl");
const SPLINE_CLASSIFY: &str = include_str!("../../shaders/spline_classify.wgsl");
const SPLINE_EMIT: &str = include_str!("../../shaders/spline_emit.wgsl");
const SPLINE_VIEW: &str = include_str!("../../shaders/spline_view.wgsl");
const SPLINE_TEXELS: &str = include_str!("../../shaders/spline_texels.wgsl");
const SPLINE_DETERMINING: &str = include_str!("../../shaders/spline_determining.wgsl");
const SPLINE_DRAW: &str = include_str!("../../shaders/spline_draw.wgsl");
const SPLINE_CAP: &str = include_str!("../../shaders/spline_cap.wgsl");
const SPLINE_LAYER: &str = include_str!("../../shaders/spline_layer.wgsl");
const SLICING: &str = include_str!("../../shaders/slicing.wgsl");
const OPAQUE: &str = include_str!("../../shaders/opaque.wgsl");
const RESOLVE: &str = include_str!("../../shaders/resolve.wgsl");

/// How fragments end up in the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Mode {
    Volume,
    Iso,
    Mip,
}

impl Mode {
    pub const ALL: [Self; 3] = [Self::Volume, Self::Iso, Self::Mip];

    /// The fragment entry point.
    pub fn entry(self) -> &'static str {
        match self {
            Self::Volume => "volume_main",
            Self::Iso => "iso_main",
            Self::Mip => "mip_main",
        }
    }
}

/// A variant of the slicing shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Variant {
    pub mode: Mode,
    pub lit: bool,
    /// What the table's second axis is.
    pub second: Second,
    /// Opacity goes by the steepness, too.
    pub steep: bool,
    /// Forward differences towards the light instead of central ones.
    pub forward: bool,
    pub perspective: bool,
    pub rgba: bool,
    /// The Jacobian is the same everywhere: nothing is deformed.
    pub affine: bool,
    /// The backward map is evaluated per fragment instead of interpolated.
    pub exact: bool,
}

impl Variant {
    /// The shader's source.
    pub fn source(&self) -> String {
        let mut source = String::new();
        for (name, on) in [
            ("ISO", self.mode == Mode::Iso),
            ("LIT", self.lit),
            ("PREINTEGRATED", self.second == Second::Behind),
            ("REGIONS", self.second == Second::Steepness),
            ("STEEP", self.steep),
            ("FORWARD", self.forward),
            ("PERSPECTIVE", self.perspective),
            ("RGBA", self.rgba),
            ("AFFINE", self.affine),
        ] {
            // writing to a string cannot fail
            let _ = writeln!(source, "const {name}: bool = {on};");
        }
        let place = if self.exact { [DEFORM, PLACE_EXACT] } else { ["", PLACE_MESH] };
        source + COMMON + FIELD + SHADE + SLICING + place[0] + place[1]
    }

    /// Every variant, for the test that validates them.
    pub fn all() -> impl Iterator<Item = Self> {
        let kinds = Mode::ALL.into_iter().flat_map(|mode| Second::ALL.map(|second| (mode, second)));
        kinds.flat_map(|(mode, second)| {
            (0..1 << 7).map(move |i| Self {
                mode,
                second,
                lit: i & 1 != 0,
                forward: i & 2 != 0,
                perspective: i & 4 != 0,
                rgba: i & 8 != 0,
                affine: i & 16 != 0,
                exact: i & 32 != 0,
                steep: i & 64 != 0,
            })
        })
    }
}

/// The shader that turns the accumulated picture into pixels.
pub fn resolve(mip: bool) -> String {
    format!("const MIP: bool = {mip};\nconst FINISHED: f32 = {FINISHED:?};\n{COMMON}{FULLSCREEN}{RESOLVE}")
}

/// The shader that marks pixels behind which nothing can be seen.
pub fn opaque() -> String {
    format!("const FINISHED: f32 = {FINISHED:?};\n{FULLSCREEN}{OPAQUE}")
}

/// The shader that resamples the deformed volume.
pub fn resample() -> String {
    [DEFORM, RESAMPLE].concat()
}

/// What a texture's samples are read as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Texel {
    Unsigned,
    Signed,
    Float,
}

impl Texel {
    pub const ALL: [Self; 3] = [Self::Unsigned, Self::Signed, Self::Float];
}

/// The shader that finds the tetrahedron of each voxel.
pub fn warp_claim() -> String {
    [WARP, WARP_CLAIM].concat()
}

/// The shader that samples the input where the voxels come from.
pub fn warp_sample(texel: Texel) -> String {
    let scalar = match texel {
        Texel::Unsigned => "u32",
        Texel::Signed => "i32",
        Texel::Float => "f32",
    };
    // with 44 bits behind the point
    let snap = (SNAP * (1u64 << 44) as f64).round();
    format!("alias Texel = {scalar};\nconst SNAP = {snap}u;\n{WARP}{WARP_SAMPLE}")
}

/// The shader of prefix sums.
pub fn spline_scan() -> &'static str {
    SPLINE_SCAN
}

/// The shader that finds the tetrahedra of an isovalue.
pub fn spline_classify() -> String {
    [SPLINE, SPLINE_CLASSIFY].concat()
}

/// The shader that lists them, with what is stored of their coefficients.
pub fn spline_emit(coefficients: Coefficients) -> String {
    format!("{}{SPLINE}{SPLINE_CLASSIFY}{SPLINE_EMIT}", ways(coefficients))
}

/// What both shaders know of where coefficients come from.
fn ways(coefficients: Coefficients) -> String {
    format!(
        "const STORED: bool = {};\nconst DETERMINING: bool = {};\n",
        coefficients == Coefficients::Stored,
        coefficients == Coefficients::Determining
    )
}

/// What fragments of smooth surfaces do once the surface is found. Constants of the shader, since a software adapter runs both
/// sides of a branch, and others keep registers for them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct SplinePaint {
    /// Which light the surroundings take away.
    pub shade: Shade,
    /// The surface is coloured by its curvature.
    pub curvature: bool,
}

impl SplinePaint {
    pub fn all() -> impl Iterator<Item = Self> {
        (0..8).map(|i| Self { shade: Shade { ambient: i & 1 != 0, light: i & 2 != 0 }, curvature: i & 4 != 0 })
    }

    fn constants(self) -> String {
        let Self { shade: Shade { ambient: occlusion, light: shadows }, curvature } = self;
        format!(
            "const OCCLUSION: bool = {occlusion};\nconst SHADOWS: bool = {shadows};\nconst CURVATURE: bool = {curvature};\n"
        )
    }
}

/// The shader that draws them; `early`: what lies behind what was drawn before is left out before its fragments look for the
/// surface.
pub fn spline_draw(coefficients: Coefficients, paint: SplinePaint, early: bool) -> String {
    let (cones, paint) = (cones(), paint.constants());
    let draw = if early {
        SPLINE_DRAW.replace("@fragment\n", "@fragment\n@early_depth_test(greater_equal)\n")
    } else {
        SPLINE_DRAW.to_owned()
    };
    format!(
        "{}const EARLY: bool = {early};\n\
         {paint}{cones}{COMMON}{SPLINE_VIEW}{SPLINE_TEXELS}{SPLINE}{SPLINE_DETERMINING}{draw}",
        ways(coefficients)
    )
}

/// The shader that draws caps.
pub fn spline_cap(paint: SplinePaint) -> String {
    [&paint.constants(), &cones(), COMMON, FULLSCREEN, SPLINE_VIEW, SPLINE_TEXELS, SPLINE, SPLINE_CAP].concat()
}

/// The shader that puts layers of surfaces together.
pub fn spline_layer() -> String {
    [FULLSCREEN, SPLINE_LAYER].concat()
}

/// What both renderers know of the cones that shade surfaces.
fn cones() -> String {
    use crate::spline::occupancy::{DIRECTIONS, FLAT, GROWTH, LEVELS, OFFSET, PENUMBRA, SHADOW_STEPS, STEPS};
    let directions = DIRECTIONS.map(|[x, y, z]| format!("vec3f({x:?}, {y:?}, {z:?})")).join(", ");
    format!(
        "const LEVELS: i32 = {LEVELS};\nconst DIRECTIONS = array<vec3f, 12>({directions});\nconst OFFSET: f32 = {OFFSET:?};\n\
         const STEPS: i32 = {STEPS};\nconst GROWTH: f32 = {GROWTH:?};\nconst FLAT: f32 = {FLAT:?};\n\
         const PENUMBRA: f32 = {PENUMBRA:?};\nconst SHADOW_STEPS: i32 = {SHADOW_STEPS};\n"
    )
}

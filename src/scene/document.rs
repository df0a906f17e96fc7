use std::path::PathBuf;

use glam::{DAffine3, DMat3, DVec3, EulerRot};
use serde::{Deserialize, Serialize};

use crate::deform::Stack;
use crate::render::{Camera, Gradient, Look, Projection, Shading};
use crate::spline::paint::SmoothLook;
use crate::volume::Space;
use crate::volume::transfer::TransferFunction;

/// Everything that makes a sculpted object and its view, but for the samples themselves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Document {
    pub volume: VolumeSource,
    /// Which step of a series in time is shown, counted from 0.
    #[serde(default, skip_serializing_if = "is_first")]
    pub step: usize,
    #[serde(default)]
    pub proxy: ProxySource,
    #[serde(default)]
    pub placement: Placement,
    #[serde(default)]
    pub stack: Stack,
    /// Let strokes through that fold space; else they are shortened until they do not.
    #[serde(default)]
    pub allow_folds: bool,
    /// Name of a preset, a path of a transfer function file, or `auto`.
    #[serde(default = "auto")]
    pub transfer: String,
    /// A transfer function of the document's own, in its text form; it takes the place of `transfer`.
    #[serde(default, with = "own_transfer", skip_serializing_if = "Option::is_none")]
    pub transfer_function: Option<TransferFunction>,
    #[serde(default)]
    pub look: LookSpec,
    /// Of smooth surfaces.
    #[serde(default, skip_serializing_if = "SmoothLook::is_plain")]
    pub surface: SmoothLook,
    #[serde(default, skip_serializing_if = "Clip::is_nothing")]
    pub clip: Clip,
    #[serde(default)]
    pub camera: CameraSpec,
}

fn is_first(step: &usize) -> bool {
    *step == 0
}

fn auto() -> String {
    "auto".to_owned()
}

impl Document {
    /// The undeformed volume in its bounding box, with everything else by default.
    pub fn new(volume: VolumeSource) -> Self {
        Self {
            volume,
            step: 0,
            proxy: ProxySource::default(),
            placement: Placement::default(),
            stack: Stack::default(),
            allow_folds: false,
            transfer: auto(),
            transfer_function: None,
            look: LookSpec::default(),
            surface: SmoothLook::default(),
            clip: Clip::default(),
            camera: CameraSpec::default(),
        }
    }
}

/// A transfer function as its readable text.
mod own_transfer {
    use serde::{Deserialize, Deserializer, Serializer};

    use super::TransferFunction;

    pub fn serialize<S: Serializer>(t: &Option<TransferFunction>, s: S) -> Result<S::Ok, S::Error> {
        match t {
            Some(t) => s.serialize_some(&t.to_string()),
            None => s.serialize_none(),
        }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<Option<TransferFunction>, D::Error> {
        let text = Option::<String>::deserialize(d)?;
        text.map(|t| TransferFunction::parse(&t).map_err(serde::de::Error::custom)).transpose()
    }
}

/// Where the samples come from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum VolumeSource {
    /// A file; relative paths start at the project file's folder.
    File(PathBuf),
    /// The samples inside this project file.
    Embedded(PathBuf),
    /// A built-in phantom, its longest side in voxels.
    Phantom { name: String, size: usize },
}

/// The closed mesh that gives the object its shape.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ProxySource {
    /// The volume's bounding box.
    #[default]
    Box,
    /// A smooth hull around every voxel at or above a real value (`None`: chosen from the histogram).
    Auto { iso: Option<f64> },
    /// A mesh file in the volume's world.
    Mesh(PathBuf),
}

/// Where the mesh lies in the texture cube (section 2.2): scaled and turned about its own centre, then moved.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Placement {
    /// World units.
    pub translate: DVec3,
    /// Degrees about the world's x, y, z axes, applied in this order.
    pub rotate: DVec3,
    /// Factors along the mesh's own axes; none may be zero.
    pub scale: DVec3,
}

impl Default for Placement {
    fn default() -> Self {
        Self { translate: DVec3::ZERO, rotate: DVec3::ZERO, scale: DVec3::ONE }
    }
}

impl Placement {
    /// How the mesh is turned.
    pub fn turn(&self) -> DMat3 {
        let r = self.rotate * std::f64::consts::PI / 180.0;
        DMat3::from_euler(EulerRot::ZYX, r.z, r.y, r.x)
    }

    /// The map from the mesh's coordinates to the world, about `center` (in the mesh's coordinates).
    pub fn world_from_mesh(&self, center: DVec3) -> DAffine3 {
        DAffine3::from_translation(center + self.translate)
            * DAffine3::from_mat3(self.turn() * DMat3::from_diagonal(self.scale))
            * DAffine3::from_translation(-center)
    }
}

/// The saved part of a [`Look`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LookSpec {
    pub shading: ShadingSpec,
    pub lit: bool,
    /// Direction to the light: right, up, towards the eye.
    pub light: DVec3,
    pub forward_gradient: bool,
    pub preintegrated: bool,
    /// Only where values change is something seen: from the first steepness on, wholly at the second, in parts of the transfer
    /// function's window per voxel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gradient_opacity: Option<[f64; 2]>,
    /// Number of slices; `None`: one per finest voxel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slices: Option<usize>,
    /// sRGB at the top and the bottom of the picture; `None`: a soft dark grey.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub background: Option<[[f32; 3]; 2]>,
}

/// What is shown.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShadingSpec {
    #[default]
    Volume,
    /// Real value; `None`: chosen from the histogram.
    Iso {
        value: Option<f64>,
    },
    Mip,
}

impl Default for LookSpec {
    fn default() -> Self {
        let look = Look::default();
        Self {
            shading: ShadingSpec::Volume,
            lit: look.lit,
            light: look.light,
            forward_gradient: false,
            preintegrated: look.preintegrated,
            gradient_opacity: None,
            slices: None,
            background: None,
        }
    }
}

impl LookSpec {
    /// The full look; `iso` is taken where none is saved.
    pub fn look(&self, iso: f64) -> Look {
        let shading = match self.shading {
            ShadingSpec::Volume => Shading::Volume,
            ShadingSpec::Iso { value } => Shading::Iso { value: value.unwrap_or(iso), color: [0.87, 0.80, 0.70] },
            ShadingSpec::Mip => Shading::Mip,
        };
        Look {
            shading,
            lit: self.lit,
            light: self.light,
            gradient: if self.forward_gradient { Gradient::Forward } else { Gradient::Central },
            preintegrated: self.preintegrated,
            gradient_opacity: self.gradient_opacity.map(|g| g.map(|v| v as f32)),
            background: self.background.unwrap_or(Look::default().background),
            ..Look::default()
        }
    }
}

/// What is cut away from view, so that one sees inside. It is a matter of looking: an export is not clipped.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Clip {
    /// The part of the texture cube that is shown: from and to along each of its axes, 0 to 1. Beyond 0 and 1 nothing is cut,
    /// so that what was pulled out of the cube stays.
    pub region: [[f64; 2]; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plane: Option<CutPlane>,
}

/// What lies on the side of the plane that the normal points to is cut away.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CutPlane {
    /// In the deformed world.
    pub point: DVec3,
    /// Need not have unit length.
    pub normal: DVec3,
}

impl Default for Clip {
    fn default() -> Self {
        Self { region: [[0.0, 1.0]; 3], plane: None }
    }
}

impl Clip {
    /// Whether everything is shown.
    pub fn is_nothing(&self) -> bool {
        *self == Self::default()
    }

    /// The planes of a volume's clipping, normals outwards, of unit length. Planes that are none cut nothing.
    pub fn planes(&self, world_from_texture: &DAffine3) -> Vec<CutPlane> {
        let mut planes = Vec::new();
        for (axis, [lo, hi]) in self.region.iter().enumerate() {
            // the face of the cube, as a gradient in the world
            let normal = world_from_texture.matrix3.inverse().transpose().col(axis);
            for (at, side, cuts) in [(*lo, -1.0, *lo > 0.0), (*hi, 1.0, *hi < 1.0)] {
                if cuts {
                    let mut t = DVec3::splat(0.5);
                    t[axis] = at;
                    planes.push(CutPlane { point: world_from_texture.transform_point3(t), normal: normal * side });
                }
            }
        }
        planes.extend(self.plane);
        planes.retain_mut(|p| {
            p.normal = p.normal.normalize_or_zero();
            p.normal != DVec3::ZERO && p.point.is_finite()
        });
        planes
    }
}

impl CutPlane {
    /// How far a point lies beyond the plane, in world units (of a unit normal).
    pub fn beyond(&self, p: DVec3) -> f64 {
        (p - self.point).dot(self.normal)
    }
}

/// The saved part of a [`Camera`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraSpec {
    /// Degrees, from the front of the volume.
    pub yaw: f64,
    /// Degrees, positive from above; beyond 90 the object stands on its head.
    pub pitch: f64,
    /// Degrees by which the picture is turned clockwise.
    #[serde(skip_serializing_if = "is_zero")]
    pub roll: f64,
    /// 1 shows everything visible.
    pub zoom: f64,
    /// World units added to the middle of what is visible.
    pub offset: DVec3,
    /// Vertical field of view in degrees; `None`: orthographic.
    pub fov_y: Option<f64>,
}

fn is_zero(v: &f64) -> bool {
    *v == 0.0
}

impl Default for CameraSpec {
    fn default() -> Self {
        // three-quarters, as a portrait is taken
        Self { yaw: 30.0, pitch: 12.0, roll: 0.0, zoom: 1.0, offset: DVec3::ZERO, fov_y: Some(28.0) }
    }
}

impl CameraSpec {
    /// The camera that frames a ball, seen from the front (the face, where the file says which way that is).
    pub fn camera(&self, space: Space, center: DVec3, radius: f64) -> Camera {
        let front = match space {
            Space::Ras => 180.0,
            Space::Lps | Space::Unknown => 0.0,
        };
        Camera {
            target: center + self.offset,
            yaw: self.yaw + front,
            pitch: self.pitch,
            roll: self.roll,
            radius,
            zoom: self.zoom,
            projection: match self.fov_y {
                Some(fov_y) => Projection::Perspective { fov_y },
                None => Projection::Orthographic,
            },
        }
    }
}

use glam::DVec3;

/// What a picture shows of the field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shading {
    /// Emission and absorption through the transfer function.
    Volume,
    /// The lit surface of one real value.
    Iso { value: f64, color: [f32; 3] },
    /// The largest value along each ray.
    Mip,
}

/// How the gradient of the deformed field is taken (section 3.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gradient {
    Central,
    Forward,
}

/// How a picture is lit and composed. Lights are fixed to the view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    pub shading: Shading,
    pub lit: bool,
    /// Direction to the light in view axes (right, up, towards the eye); need not have unit length.
    pub light: DVec3,
    pub gradient: Gradient,
    pub ambient: f32,
    pub diffuse: f32,
    pub specular: f32,
    pub shininess: f32,
    pub preintegrated: bool,
    /// Opacity by steepness: nothing is seen where the values change by less than the first, everything where they change by the
    /// second or more; in parts of the window per voxel of the undeformed volume. Of [`Shading::Volume`].
    pub gradient_opacity: Option<[f32; 2]>,
    /// sRGB at the top and the bottom of the picture.
    pub background: [[f32; 3]; 2],
    /// Leave the background transparent.
    pub transparent: bool,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            shading: Shading::Volume,
            lit: true,
            light: DVec3::new(-0.5, 0.7, 1.0),
            gradient: Gradient::Central,
            ambient: 0.35,
            diffuse: 0.75,
            specular: 0.25,
            shininess: 24.0,
            preintegrated: true,
            gradient_opacity: None,
            background: [[0.215, 0.235, 0.262], [0.09, 0.098, 0.11]],
            transparent: false,
        }
    }
}

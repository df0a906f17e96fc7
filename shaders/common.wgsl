// What all passes of a picture share: the GPU's copy of `render::Frame`. "Local" is the world minus the centre of the slice
// geometry.

struct Frame {
    clip_from_local: mat4x4f,
    // perspective: the eye, and 1; orthographic: the direction to the eye, and 0
    eye: vec4f,
    // unit direction to the eye along the view axis; slice distance
    axis: vec4f,
    // unit direction to the light; finest voxel spacing
    light: vec4f,
    // texels along i, j, k; channels
    dims: vec4f,
    // scale and bias of the window value; the iso-value in window units; the steepness above which something is seen
    window: vec4f,
    // ambient, diffuse, specular, shininess
    material: vec4f,
    // linear light; how fast opacity rises with the steepness
    iso_color: vec4f,
    // sRGB at the top and the bottom
    background: array<vec4f, 2>,
    // width, height, mode, flags
    size: vec4u,
}

@group(0) @binding(0) var<uniform> frame: Frame;

const TRANSPARENT: u32 = 4u;

fn linear_from_srgb(v: vec3f) -> vec3f {
    let low = v / 12.92;
    let high = pow((max(v, vec3f(0.0)) + 0.055) / 1.055, vec3f(2.4));
    return select(high, low, v <= vec3f(0.04045));
}

fn srgb_from_linear(v: vec3f) -> vec3f {
    let low = v * 12.92;
    let high = 1.055 * pow(max(v, vec3f(0.0)), vec3f(1.0 / 2.4)) - 0.055;
    return select(high, low, v <= vec3f(0.0031308));
}

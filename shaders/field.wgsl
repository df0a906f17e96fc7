// The undeformed volume and its transfer function.

struct Object {
    // 1 / texels along i, j, k
    texel: vec3f,
    pad: f32,
    // derivative of the texture coordinate by world position, where it is the same everywhere (AFFINE), by columns
    jacobian: mat3x3f,
}

@group(1) @binding(0) var<uniform> object: Object;
@group(1) @binding(1) var volume: texture_3d<f32>;
@group(1) @binding(2) var volume_sampler: sampler;
@group(1) @binding(3) var table: texture_2d<f32>;
@group(1) @binding(4) var table_sampler: sampler;

fn texels(x: vec3f) -> vec4f {
    return textureSampleLevel(volume, volume_sampler, x, 0.0);
}

// the scalar at a texture coordinate, 0 to 1 in the window
fn value(x: vec3f) -> f32 {
    let t = texels(x);
    return saturate(select(t.r, t.a, RGBA) * frame.window.x + frame.window.y);
}

// linear light, premultiplied, for one slice distance along the view axis
fn classify(front: f32, second: f32) -> vec4f {
    return textureSampleLevel(table, table_sampler, (vec2f(front, second) * 255.0 + 0.5) / 256.0, 0.0);
}

// A layer, premultiplied, goes behind those before it.

@group(0) @binding(0) var layer: texture_2d<f32>;

@vertex
fn vertex_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    // one triangle over everything
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn layer_main(@builtin(position) at: vec4f) -> @location(0) vec4f {
    return textureLoad(layer, vec2i(at.xy), 0);
}

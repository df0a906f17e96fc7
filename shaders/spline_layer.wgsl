// A layer, premultiplied, goes behind those before it.

@group(0) @binding(0) var layer: texture_2d<f32>;

@fragment
fn layer_main(@builtin(position) at: vec4f) -> @location(0) vec4f {
    return textureLoad(layer, vec2i(at.xy), 0);
}

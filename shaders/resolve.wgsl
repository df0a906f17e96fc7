// The accumulated picture (linear light, premultiplied) over the background, encoded to sRGB.

@group(2) @binding(0) var accumulated: texture_2d<f32>;

@fragment
fn resolve_main(@builtin(position) at: vec4f) -> @location(0) vec4f {
    var color = textureLoad(accumulated, vec2i(at.xy), 0);
    if color.a > 1.0 - FINISHED {
        // what lies behind was not drawn
        color /= color.a;
    }
    if MIP {
        // the value as grey, where anything was drawn
        if color.a > 0.0 {
            return vec4f(color.rgb, 1.0);
        }
    }
    if (frame.size.w & TRANSPARENT) != 0u {
        if color.a <= 0.0 {
            return vec4f(0.0);
        }
        return vec4f(srgb_from_linear(color.rgb / color.a), color.a);
    }
    let t = at.y / f32(frame.size.y);
    let background = linear_from_srgb(mix(frame.background[0].rgb, frame.background[1].rgb, t));
    return vec4f(srgb_from_linear(color.rgb + (1.0 - color.a) * background), 1.0);
}

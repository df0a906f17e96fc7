// Pixels behind which nothing can be seen get the nearest depth there is.

@group(2) @binding(0) var accumulated: texture_2d<f32>;

@fragment
fn opaque_main(@builtin(position) at: vec4f) {
    if textureLoad(accumulated, vec2i(at.xy), 0).a <= 1.0 - FINISHED {
        discard;
    }
}

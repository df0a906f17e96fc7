// Samples around a cube, straight from the texture.

struct Near {
    // in texels
    center: vec3i,
    x: vec3i,
    y: vec3i,
    z: vec3i,
}

fn near(at: Near, x: i32, y: i32, z: i32) -> f32 {
    let texel = at.center + x * at.x + y * at.y + z * at.z;
    return (textureLoad(samples, texel, 0).x - view.iso.x) - view.iso.y;
}

fn near_texels(cube: vec3u, axes: mat3x3f) -> Near {
    return Near(vec3i(cube) + 1, vec3i(axes[0]), vec3i(axes[1]), vec3i(axes[2]));
}

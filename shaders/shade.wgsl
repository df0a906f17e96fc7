// Gradient of the field and the light that falls on it.

// over two texels
fn differences(x: vec3f) -> vec3f {
    let t = object.texel;
    return vec3f(
        value(x + vec3f(t.x, 0.0, 0.0)) - value(x - vec3f(t.x, 0.0, 0.0)),
        value(x + vec3f(0.0, t.y, 0.0)) - value(x - vec3f(0.0, t.y, 0.0)),
        value(x + vec3f(0.0, 0.0, t.z)) - value(x - vec3f(0.0, 0.0, t.z)),
    );
}

// of the undeformed volume, in window units per voxel
fn steepness(x: vec3f) -> f32 {
    return 0.5 * length(differences(x));
}

// of the deformed field by central differences, in window units per voxel; `jacobian` is dT/dp
fn gradient(x: vec3f, jacobian: mat3x3f) -> vec3f {
    let d = differences(x);
    // a vector times a matrix is the transpose times the vector
    return (d * (0.5 * frame.dims.xyz)) * jacobian * frame.light.w;
}

// `color` under the light: at texture coordinate `x` with value `here`, seen from the unit direction `view`
fn lit(color: vec4f, x: vec3f, here: f32, jacobian: mat3x3f, view: vec3f) -> vec3f {
    let ambient = frame.material.x;
    if FORWARD {
        let d = here - value(x + frame.light.w * (jacobian * frame.light.xyz));
        return color.rgb * (ambient + frame.material.y * saturate(12.0 * d));
    }
    let g = gradient(x, jacobian);
    let steep = length(g);
    var n = view;
    if steep > 0.0 {
        n = g / steep;
    }
    n = select(n, -n, dot(n, view) < 0.0);
    let h = normalize(frame.light.xyz + view);
    let diffuse = frame.material.y * max(dot(n, frame.light.xyz), 0.0);
    let specular = frame.material.z * pow(max(dot(n, h), 0.0), frame.material.w);
    let w = select(min(steep * 12.0, 1.0), 1.0, ISO);
    return color.rgb * mix(1.0, ambient + diffuse, w) + color.a * w * specular;
}

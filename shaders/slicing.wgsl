// View-aligned slices; src/render/mod.rs says what a fragment is.

struct Fragment {
    @builtin(position) clip: vec4f,
    @location(0) front: vec3f,
    @location(1) back: vec3f,
    @location(2) local: vec3f,
    @location(3) jacobian_x: vec3f,
    @location(4) jacobian_y: vec3f,
    @location(5) jacobian_z: vec3f,
}

@vertex
fn vertex_main(
    @location(0) position: vec3f,
    @location(1) front: vec3f,
    @location(2) back: vec3f,
    @location(3) jacobian_x: vec3f,
    @location(4) jacobian_y: vec3f,
    @location(5) jacobian_z: vec3f,
) -> Fragment {
    let clip = frame.clip_from_local * vec4f(position, 1.0);
    return Fragment(clip, front, back, position, jacobian_x, jacobian_y, jacobian_z);
}

// what the fragment samples
struct Place {
    front: vec3f,
    back: vec3f,
    jacobian: mat3x3f,
}

fn view(in: Fragment) -> vec3f {
    if PERSPECTIVE {
        return normalize(frame.eye.xyz - in.local);
    }
    return frame.axis.xyz;
}

@fragment
fn volume_main(in: Fragment) -> @location(0) vec4f {
    let v = view(in);
    let place = locate(in, v);
    if any(place.front != saturate(place.front)) {
        discard;
    }
    let here = value(place.front);
    var second = here;
    if PREINTEGRATED {
        second = value(place.back);
    }
    if REGIONS {
        // the first row has the most there can be for the value
        if classify(here, 0.0).a <= 1e-6 {
            discard;
        }
        second = 1.0 - sqrt(steepness(place.front));
    }
    var color = classify(here, second);
    if color.a <= 1e-6 {
        discard;
    }
    // a constant: software adapters run both sides of a branch, and this one looks up six more values
    if STEEP {
        color *= saturate((steepness(place.front) - frame.window.w) * frame.iso_color.w);
        if color.a <= 1e-6 {
            discard;
        }
    }
    if RGBA {
        color = vec4f(linear_from_srgb(texels(place.front).rgb) * color.a, color.a);
    }
    if PERSPECTIVE {
        color *= (1.0 - pow(1.0 - color.a, 1.0 / dot(v, frame.axis.xyz))) / color.a;
    }
    if LIT {
        color = vec4f(lit(color, place.front, here, place.jacobian, v), color.a);
    }
    return color;
}

@fragment
fn iso_main(in: Fragment) -> @location(0) vec4f {
    let v = view(in);
    let place = locate(in, v);
    if any(place.front != saturate(place.front)) {
        discard;
    }
    let iso = frame.window.z;
    let here = value(place.front);
    let behind = value(place.back);
    if max(here, behind) < iso {
        discard;
    }
    var x = place.front;
    var at = here;
    if here < iso {
        x = mix(place.front, place.back, (iso - here) / (behind - here));
        at = iso;
    }
    var color = vec4f(frame.iso_color.rgb, 1.0);
    if LIT {
        color = vec4f(lit(color, x, at, place.jacobian, v), 1.0);
    }
    return color;
}

@fragment
fn mip_main(in: Fragment) -> @location(0) vec4f {
    let v = view(in);
    let place = locate(in, v);
    if any(place.front != saturate(place.front)) {
        discard;
    }
    return vec4f(vec3f(value(place.front)), 1.0);
}

// Where rays begin above the isovalue: flat caps on planes that cut, and on the faces of the domain.

struct Cap {
    hit: Hit,
    met: bool,
}

fn cap(at: vec2f) -> Cap {
    var found: Cap;
    let pixel = pixel_ray(at);
    let size = vec3f(view.dims.xyz);
    let center = 0.5 * size - 0.5;
    let ray = local_ray(pixel, center);
    // the domain, relative to its middle
    let safe = select(ray.direction, vec3f(1e-20), abs(ray.direction) < vec3f(1e-20));
    let u = (-0.5 * size - ray.origin) / safe;
    let v = (0.5 * size - ray.origin) / safe;
    let enters = min(u, v);
    let leaves = max(u, v);
    let entry = max(max(enters.x, enters.y), enters.z);
    let range = uncut(ray, center);
    let start = max(entry, range.start);
    let end = min(min(leaves.x, leaves.y), min(leaves.z, range.end));
    if !(start < end) {
        return found;
    }
    let place = center + (ray.origin + start * ray.direction);
    let cube = clamp(floor(place + 0.5), vec3f(0.0), size - 1.0);
    let inside = clamp(place - cube, vec3f(-0.5), vec3f(0.5));
    // the tetrahedron: the coordinate farthest from the middle, then the next
    let m = abs(inside);
    var first = 2u;
    if m.x >= m.y && m.x >= m.z {
        first = 0u;
    } else if m.y >= m.z {
        first = 1u;
    }
    let low = select(0u, 1u, first == 0u);
    let high = select(2u, 1u, first == 2u);
    let odd = dot(m, unit(high)) > dot(m, unit(low));
    let second = select(low, high, odd);
    let back = u32(dot(inside, unit(first)) < 0.0) + 2u * u32(dot(inside, unit(second)) < 0.0);
    let axes = kind_axes(8u * first + 4u * u32(odd) + back);
    let t = piece(near_texels(vec3u(cube), axes));
    let p = barycentric(inside * axes);
    let value = cubic(t, p);
    if value < 0.0 {
        return found;
    }
    found.met = true;
    found.hit.to_eye = -normalize(view.world_from_voxel * ray.direction);
    found.hit.color = view.shell.rgb;
    var normal = vec3f(0.0);
    if range.start > entry {
        let n = view.normals[range.plane];
        normal = n.xyz * n.w;
        if n.w != 0.0 && view.tint.z != 0.0 {
            found.hit.color = cap_color(value);
        }
    } else {
        normal = view.covariant * (sign(ray.direction) * vec3f(enters >= vec3f(entry - 1e-6)));
    }
    found.hit.normal = faced(normal, found.hit.to_eye);
    found.hit.depth = ray.depth + start;
    found.hit.place = place;
    return found;
}

// by the value less the isovalue
fn cap_color(value: f32) -> vec3f {
    let x = clamp(value * view.window.x + view.window.y, 0.0, 1.0) * 255.0;
    let i = min(u32(x), 254u);
    return mix(view.caps[i].rgb, view.caps[i + 1u].rgb, x - f32(i));
}

// by de Casteljau's algorithm, written out
fn cubic(t: Piece, p: vec4f) -> f32 {
    let q = p * p;
    let x = dot(p, t.a);
    let y0 = dot(p, vec4f(t.a.y, t.b.x, t.b.y, t.b.z));
    let z0 = dot(p, vec4f(t.a.z, t.b.y, t.b.w, t.c.x));
    let w0 = dot(p, vec4f(t.a.w, t.b.z, t.c.x, t.c.y));
    let yy = dot(p, vec4f(t.b.x, t.c.z, t.c.w, t.d.x));
    let yz = dot(p, vec4f(t.b.y, t.c.w, t.d.y, t.d.z));
    let yw = dot(p, vec4f(t.b.z, t.d.x, t.d.z, t.d.w));
    let zz = dot(p, vec4f(t.b.w, t.d.y, t.e.x, t.e.y));
    let zw = dot(p, vec4f(t.c.x, t.d.z, t.e.y, t.e.z));
    let ww = dot(p, vec4f(t.c.y, t.d.w, t.e.z, t.e.w));
    return q.x * x + q.y * yy + q.z * zz + q.w * ww
        + 2.0 * (p.x * (p.y * y0 + p.z * z0 + p.w * w0) + p.y * (p.z * yz + p.w * yw) + p.z * p.w * zw);
}

struct Shaded {
    @location(0) color: vec4f,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn picture_main(@builtin(position) at: vec4f) -> Shaded {
    let found = cap(at.xy);
    if !found.met {
        discard;
    }
    return Shaded(shaded(found.hit), buffer_depth(found.hit.depth));
}

// normal and depth instead of a colour
@fragment
fn probe_main(@builtin(position) at: vec4f) -> Shaded {
    let found = cap(at.xy);
    if !found.met {
        discard;
    }
    return Shaded(vec4f(found.hit.normal, found.hit.depth), buffer_depth(found.hit.depth));
}

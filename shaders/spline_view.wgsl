// The viewing ray of a pixel in voxels, and how what it meets is lit. Numbers that would lose digits come in two parts: the
// upper ones are few enough bits that sums and products of them are exact.

struct View {
    clip_from_voxel: mat4x4f,
    // columns: a direction in the world from voxels; a gradient in the world from one per voxel
    world_from_voxel: mat3x3f,
    covariant: mat3x3f,
    // on a plane across the view: the corner of the picture, and the steps to the next pixel; upper and lower bits
    origin: vec4f,
    origin_low: vec4f,
    across: vec4f,
    across_low: vec4f,
    down: vec4f,
    down_low: vec4f,
    // perspective: the eye, and 1; orthographic: the direction of the rays, and 0
    eye: vec4f,
    eye_low: vec4f,
    // samples along i, j, k; planes
    dims: vec4u,
    // the isovalue, upper and lower bits; a depth of the picture from one in voxels; voxels that a pixel covers where w is 1
    iso: vec4f,
    // of what is cut away: outward normal and value at 0, per voxel
    planes: array<vec4f, 12>,
    // in the world; 1 where a cut is seen, 0 where the eye's own plane cuts
    normals: array<vec4f, 12>,
    // 1 for mean and 2 for Gaussian curvature; strength; 1 if caps have colours of their own
    tint: vec4f,
    positive: vec4f,
    negative: vec4f,
    // place in the table from a value less the isovalue: factor and summand
    window: vec4f,
    // of the surface, linear light; opacity
    shell: vec4f,
    // layers: 1 if only what lies behind the layer before is drawn; by how many voxels; the last two are unused
    peel: vec4f,
    // `[0, 1]^3` over all cells from a voxel that is counted from the corner of the first; size of a cell in the world
    unit: vec4f,
    caps: array<vec4f, 256>,
}

@group(1) @binding(0) var<uniform> view: View;
// with one more sample on every side
@group(1) @binding(1) var samples: texture_3d<f32>;

// of the layer before
@group(1) @binding(5) var before: texture_depth_2d;
// how full space is, finest level first
@group(1) @binding(6) var occupancy: texture_3d<f32>;
@group(1) @binding(7) var between: sampler;

const LIT_FLAG: u32 = 1u;

fn chopped(v: vec3f) -> vec3f {
    return bitcast<vec3f>(bitcast<vec3u>(v) & vec3u(0xfffff000u));
}

// sum of both parts: `origin + depth * direction`; `length` is that of the direction
struct PixelRay {
    origin: vec3f,
    origin_low: vec3f,
    direction: vec3f,
    direction_low: vec3f,
    length: f32,
}

fn pixel_ray(at: vec2f) -> PixelRay {
    var r: PixelRay;
    r.origin = view.origin.xyz + at.x * view.across.xyz + at.y * view.down.xyz;
    r.origin_low = view.origin_low.xyz + at.x * view.across_low.xyz + at.y * view.down_low.xyz;
    var d = view.eye.xyz;
    var low = view.eye_low.xyz;
    if view.eye.w != 0.0 {
        d = r.origin - d;
        low = r.origin_low - low;
    }
    r.direction = chopped(d);
    r.direction_low = (d - r.direction) + low;
    r.length = length(d + low);
    return r;
}

// a ray near a point: where it passes there, relative to the point, its direction for a step of one voxel, and how many
// voxels lie before it
struct LocalRay {
    origin: vec3f,
    direction: vec3f,
    depth: f32,
}

fn local_ray(r: PixelRay, center: vec3f) -> LocalRay {
    let d = r.direction + r.direction_low;
    let steps = dot(center - (r.origin + r.origin_low), d) / (r.length * r.length);
    let s = chopped(vec3f(steps)).x;
    return LocalRay(
        ((r.origin - center) + s * r.direction) + (r.origin_low + s * r.direction_low),
        d / r.length,
        s * r.length,
    );
}

// what no plane cuts away of a local ray: from where to where, and the plane that it begins at, or -1
struct Uncut {
    start: f32,
    end: f32,
    plane: i32,
}

fn uncut(r: LocalRay, center: vec3f) -> Uncut {
    var u = Uncut(-1e30, 1e30, -1);
    for (var i = 0; i < i32(view.dims.w); i++) {
        let plane = view.planes[i];
        let beyond = dot(plane.xyz, center + r.origin) + plane.w;
        let rate = dot(plane.xyz, r.direction);
        if rate == 0.0 {
            if beyond > 0.0 {
                u.end = -1e30;
            }
            continue;
        }
        let at = -beyond / rate;
        if rate < 0.0 {
            if at > u.start {
                u.start = at;
                u.plane = i;
            }
        } else {
            u.end = min(u.end, at);
        }
    }
    return u;
}

struct Hit {
    // towards the eye
    normal: vec3f,
    to_eye: vec3f,
    // linear light
    color: vec3f,
    // along the ray from the plane across the view, in voxels
    depth: f32,
    // in voxels
    place: vec3f,
}

// turned to the eye, or the direction to the eye where there is none
fn faced(normal: vec3f, to_eye: vec3f) -> vec3f {
    let square = dot(normal, normal);
    if !(square > 0.0) {
        return to_eye;
    }
    let n = normal * inverseSqrt(square);
    return select(n, -n, dot(n, to_eye) < 0.0);
}

fn buffer_depth(depth: f32) -> f32 {
    return clamp(0.5 + depth * view.iso.z, 0.0, 1.0);
}

// where on the ray of a pixel the layer before is; far in front of everything if there is none
fn layer_before(at: vec2f) -> f32 {
    if view.peel.x == 0.0 {
        return -1e30;
    }
    let depth = textureLoad(before, vec2i(at), 0);
    return select((depth - 0.5) / view.iso.z + view.peel.y, -1e30, depth <= 0.0);
}

// as `spline::occupancy`
fn full(at: vec3f, level: f32) -> f32 {
    if any(at < vec3f(0.0)) || any(at > vec3f(1.0)) {
        return 0.0;
    }
    return textureSampleLevel(occupancy, between, at, clamp(level, 0.0, f32(LEVELS - 1))).x;
}

// a direction in the world, one cell long, in units
fn cell_step(direction: vec3f) -> vec3f {
    // a vector times a matrix is the transpose times the vector
    return ((direction * view.unit.w) * view.covariant) * view.unit.xyz;
}

fn ambient_light(start: vec3f, normal: vec3f) -> f32 {
    var open = 0.0;
    var all = 0.0;
    for (var i = 0; i < 12; i++) {
        let direction = DIRECTIONS[i];
        let weight = dot(normal, direction);
        if weight <= 0.0 {
            continue;
        }
        let step = cell_step(direction);
        var through = 1.0;
        var distance = 1.0;
        for (var k = 0; k < STEPS; k++) {
            let near = 1.0 - f32(k) / f32(STEPS);
            through *= 1.0 - near * full(start + distance * step, log2(distance));
            distance *= GROWTH;
        }
        open += weight * through;
        all += weight;
    }
    return min(open / (all * FLAT), 1.0);
}

fn direct_light(start: vec3f, light: vec3f) -> f32 {
    let step = cell_step(light);
    var through = 1.0;
    var distance = 1.0;
    for (var i = 0; i < SHADOW_STEPS; i++) {
        let at = start + distance * step;
        if any(at < vec3f(0.0)) || any(at > vec3f(1.0)) || through < 0.01 {
            break;
        }
        let width = max(PENUMBRA * distance, 1.0);
        through *= 1.0 - full(at, log2(width));
        distance += 0.7 * width;
    }
    return through;
}

// as the surfaces of slices are lit, less what the surroundings take away; premultiplied
fn shaded(hit: Hit) -> vec4f {
    let opacity = view.shell.a;
    if (frame.size.w & LIT_FLAG) == 0u {
        return vec4f(hit.color * opacity, opacity);
    }
    let light = frame.light.xyz;
    let both = light + hit.to_eye;
    let half_way = select(normalize(both), hit.to_eye, dot(both, both) == 0.0);
    var diffuse = max(dot(hit.normal, light), 0.0);
    var specular = pow(max(dot(hit.normal, half_way), 1e-6), frame.material.w);
    var ambient = 1.0;
    let start = (hit.place + 0.5) * view.unit.xyz + OFFSET * cell_step(hit.normal);
    if SHADOWS && diffuse > 0.0 {
        let lit = direct_light(start, light);
        diffuse *= lit;
        specular *= lit;
    }
    if OCCLUSION {
        let open = ambient_light(start, hit.normal);
        ambient = open * open;
        diffuse *= 0.3 + 0.7 * open;
    }
    let color = hit.color * (frame.material.x * ambient + frame.material.y * diffuse) + frame.material.z * specular;
    return vec4f(color * opacity, opacity);
}

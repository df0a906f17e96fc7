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
    caps: array<vec4f, 256>,
}

@group(1) @binding(0) var<uniform> view: View;
// with one more sample on every side
@group(1) @binding(1) var samples: texture_3d<f32>;

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

// as the surfaces of slices are lit
fn shaded(hit: Hit) -> vec4f {
    let color = hit.color;
    if (frame.size.w & LIT_FLAG) == 0u {
        return vec4f(color, 1.0);
    }
    let light = frame.light.xyz;
    let both = light + hit.to_eye;
    let half_way = select(normalize(both), hit.to_eye, dot(both, both) == 0.0);
    let diffuse = max(dot(hit.normal, light), 0.0);
    let specular = pow(max(dot(hit.normal, half_way), 1e-6), frame.material.w);
    return vec4f(color * (frame.material.x + frame.material.y * diffuse) + frame.material.z * specular, 1.0);
}

// The surface in a tetrahedron: its back faces are drawn, so that the eye may be within, and each fragment looks for the first
// place where the ray comes above the isovalue.

// number of the cube; or its place in the store, and from the end of the list, by place, the number
@group(1) @binding(2) var<storage, read> tets: array<u32>;
@group(1) @binding(3) var<storage, read> store: array<vec4f>;
struct Lists {
    first: array<u32, 24>,
    count: array<u32, 24>,
}
@group(1) @binding(4) var<storage, read> lists: Lists;

const BATCH: u32 = 64u;
// how far a place may lie outside, in barycentric coordinates: f32 knows where a ray is to about a millionth of a voxel
const SLACK: f32 = 4e-6;
// the rasterizer knows where corners are to 1/256 of a pixel: tetrahedra are drawn larger by this many pixels on every side
const MARGIN: f32 = 1.0 / 100.0;
// the middle of the sphere that touches all faces, and its radius
const INCENTER: vec3f = vec3f(0.3693981, 0.1846990, 0.0);
const INRADIUS: f32 = 0.1306019;

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) a: vec4f,
    @location(1) @interpolate(flat) b: vec4f,
    @location(2) @interpolate(flat) c: vec4f,
    @location(3) @interpolate(flat) d: vec4f,
    @location(4) @interpolate(flat) e: vec4f,
    // the cube
    @location(5) @interpolate(flat) center: vec3f,
    @location(6) @interpolate(flat) kind: u32,
}

// no point of a cube has a smaller depth than this: that of its middle less the reach of the cube, times the steepness of depths
fn nearest(center: vec3f) -> f32 {
    let reach = 1.25 * 0.8661 + 0.02;
    let across = normalize(cross(view.across.xyz, view.down.xyz));
    let origin = view.origin.xyz + view.origin_low.xyz;
    let eye = view.eye.xyz + view.eye_low.xyz;
    if view.eye.w == 0.0 {
        let rate = dot(across, eye);
        return dot(across, center - origin) / rate - reach / abs(rate);
    }
    let way = center - eye;
    let distance = length(way);
    let cosine = dot(across, way) / distance;
    // next to the eye, and beside it, depths are steep
    if distance < 8.0 || abs(cosine) < 0.1 {
        return -1e30;
    }
    let plane = dot(across, origin - eye) / cosine;
    let tangent = sqrt(max(1.0 - cosine * cosine, 0.0)) / abs(cosine);
    return distance - plane - reach * (1.0 + abs(plane) * tangent / distance);
}

@vertex
fn vertex_main(@builtin(vertex_index) vertex: u32, @builtin(instance_index) batch: u32) -> Corner {
    var out: Corner;
    let kind = vertex / (4u * BATCH);
    let own = batch * BATCH + (vertex / 4u) % BATCH;
    if own >= lists.count[kind] {
        // all corners alike: nothing is drawn
        out.position = vec4f(0.0, 0.0, 0.0, 1.0);
        return out;
    }
    let at = lists.first[kind] + own;
    var number = tets[at];
    let place = number;
    if DETERMINING {
        number = tets[arrayLength(&tets) - 1u - place];
    }
    let cube = vec3u(number % view.dims.x, (number / view.dims.x) % view.dims.y, number / (view.dims.x * view.dims.y));
    let axes = kind_axes(kind);
    var p: Piece;
    if STORED {
        p = Piece(store[5u * at], store[5u * at + 1u], store[5u * at + 2u], store[5u * at + 3u], store[5u * at + 4u]);
    } else if DETERMINING {
        p = determined(place, kind);
    } else {
        p = piece(near_texels(cube, axes));
    }
    out.a = p.a;
    out.b = p.b;
    out.c = p.c;
    out.d = p.d;
    out.e = p.e;

    // faces turn the same way in all kinds if those of the mirrored ones have two corners exchanged
    let mirrored = (dot(cross(axes[0], axes[1]), axes[2]) < 0.0) != (determinant(view.world_from_voxel) < 0.0);
    let corner = vertex % 4u;
    var local = vec3f(0.5, 0.5, select(-0.5, 0.5, (corner == 2u) != mirrored));
    if corner == 0u {
        local = vec3f(0.0);
    } else if corner == 1u {
        local = vec3f(0.5, 0.0, 0.0);
    }
    let center = vec3f(cube);
    let pixel = view.iso.w * abs((view.clip_from_voxel * vec4f(center, 1.0)).w);
    local += (local - INCENTER) * (MARGIN * pixel / INRADIUS);
    let clip = view.clip_from_voxel * vec4f(center + axes * local, 1.0);
    // the fragments find their own depth: no face is cut off by the near or the far plane
    var depth = 0.5;
    if EARLY {
        depth = buffer_depth(nearest(center));
    }
    out.position = vec4f(clip.xy, depth * clip.w, clip.w);
    out.center = center;
    out.kind = kind;
    return out;
}

struct Quadratic {
    // 00, 01, 02, 03; 11, 12, 13; 22, 23, 33
    x: vec4f,
    y: vec3f,
    z: vec3f,
}

// a step of blossoming
fn quadratic(t: Corner, p: vec4f) -> Quadratic {
    return Quadratic(
        vec4f(
            dot(p, t.a),
            dot(p, vec4f(t.a.y, t.b.x, t.b.y, t.b.z)),
            dot(p, vec4f(t.a.z, t.b.y, t.b.w, t.c.x)),
            dot(p, vec4f(t.a.w, t.b.z, t.c.x, t.c.y)),
        ),
        vec3f(
            dot(p, vec4f(t.b.x, t.c.z, t.c.w, t.d.x)),
            dot(p, vec4f(t.b.y, t.c.w, t.d.y, t.d.z)),
            dot(p, vec4f(t.b.z, t.d.x, t.d.z, t.d.w)),
        ),
        vec3f(
            dot(p, vec4f(t.b.w, t.d.y, t.e.x, t.e.y)),
            dot(p, vec4f(t.c.x, t.d.z, t.e.y, t.e.z)),
            dot(p, vec4f(t.c.y, t.d.w, t.e.z, t.e.w)),
        ),
    );
}

fn linear(q: Quadratic, p: vec4f) -> vec4f {
    return vec4f(
        dot(p, q.x),
        dot(p, vec4f(q.x.y, q.y)),
        dot(p, vec4f(q.x.z, q.y.y, q.z.x, q.z.y)),
        dot(p, vec4f(q.x.w, q.y.z, q.z.y, q.z.z)),
    );
}

// a cubic by its Bernstein coefficients
fn value(b: vec4f, t: f32) -> f32 {
    let s = 1.0 - t;
    return s * s * (s * b.x + 3.0 * t * b.y) + t * t * (3.0 * s * b.z + t * b.w);
}

fn slope(b: vec4f, t: f32) -> f32 {
    let s = 1.0 - t;
    return 3.0 * (s * s * (b.y - b.x) + 2.0 * s * t * (b.z - b.y) + t * t * (b.w - b.z));
}

// where a cubic that begins below zero first comes above it, in 0..1; -1 if it does not. Within `slack` above zero counts as
// below
fn rise(b: vec4f, slack: f32) -> f32 {
    if b.x >= 0.0 {
        return select(-1.0, 0.0, b.x <= slack);
    }
    if max(max(b.y, b.z), b.w) < 0.0 {
        return -1.0;
    }
    // turning points: a t^2 + 2 h t + c
    let c = b.y - b.x;
    let h = (b.z - b.y) - c;
    let a = (b.w - b.z) - (b.z - b.y) - h;
    var lo = 0.0;
    var hi = 1.0;
    var end = b.w;
    let under = h * h - a * c;
    if under > 0.0 {
        // without cancellation
        let q = -(h + select(-sqrt(under), sqrt(under), h >= 0.0));
        let r = q / a;
        let s = c / q;
        // a turn from rising to falling comes first, if the cubic ever rises: there it is highest
        let first = min(r, s);
        let second = max(r, s);
        for (var i = 0; i < 2; i++) {
            let turn = select(second, first, i == 0);
            if turn > lo && turn < hi {
                let there = value(b, turn);
                if there >= 0.0 {
                    hi = turn;
                    end = there;
                } else {
                    lo = turn;
                }
            }
        }
    }
    if end < 0.0 {
        return -1.0;
    }
    // Newton's method kept within a shrinking bracket
    let begin = value(b, lo);
    var t = lo + (hi - lo) * clamp(begin / (begin - end), 0.0, 1.0);
    for (var i = 0; i < 12; i++) {
        let v = value(b, t);
        if v < 0.0 {
            lo = t;
        } else {
            hi = t;
        }
        let next = t - v / slope(b, t);
        // before the bracket is asked: rounding may have put its end on the root
        if abs(next - t) < 1e-6 {
            t = next;
            break;
        }
        t = select(0.5 * (lo + hi), next, next > lo && next < hi);
    }
    return t;
}

// the local axes in barycentric coordinates
const AXIS_U: vec4f = vec4f(-2.0, 2.0, 0.0, 0.0);
const AXIS_V: vec4f = vec4f(0.0, -2.0, 1.0, 1.0);
const AXIS_W: vec4f = vec4f(0.0, 0.0, 1.0, -1.0);

fn slopes(l: vec4f) -> vec3f {
    return vec3f(dot(l, AXIS_U), dot(l, AXIS_V), dot(l, AXIS_W));
}

// as in `spline::paint`
fn curvature(g: vec3f, h: mat3x3f) -> f32 {
    let square = dot(g, g);
    if !(square > 0.0) {
        return 0.0;
    }
    if view.tint.x == 1.0 {
        let trace = h[0].x + h[1].y + h[2].z;
        return (dot(g, h * g) - square * trace) / (2.0 * square * sqrt(square));
    }
    let adjugate = mat3x3f(cross(h[1], h[2]), cross(h[2], h[0]), cross(h[0], h[1]));
    let product = dot(g, adjugate * g);
    return sign(product) * sqrt(abs(product)) / square;
}

struct Found {
    hit: Hit,
    // in the depth buffer
    depth: f32,
    met: bool,
}

fn find(t: Corner) -> Found {
    var found: Found;
    let axes = kind_axes(t.kind);
    let pixel = pixel_ray(t.position.xy);
    let ray = local_ray(pixel, t.center);
    // a vector times a matrix is the transpose times the vector
    let at = barycentric(ray.origin * axes);
    let rate = barycentric_direction(ray.direction * axes);
    // where none of the four is below -SLACK; a ray along a face is on one side of it for ever
    let level = abs(rate) < vec4f(1e-20);
    let crossing = -(at + SLACK) / select(rate, vec4f(1e-20), level);
    let falls = rate < vec4f(0.0) & !level;
    let enters = select(crossing, vec4f(-1e30), falls);
    let leaves = select(vec4f(1e30), crossing, falls);
    var start = max(max(enters.x, enters.y), max(enters.z, enters.w));
    var end = min(min(leaves.x, leaves.y), min(leaves.z, leaves.w));
    if view.dims.w > 0u {
        let range = uncut(ray, t.center);
        start = max(start, range.start);
        end = min(end, range.end);
    }
    start = max(start, layer_before(t.position.xy) - ray.depth);
    if !(start < end) {
        return found;
    }
    let p = at + start * rate;
    let q = at + end * rate;
    let at_p = quadratic(t, p);
    let at_q = quadratic(t, q);
    let pp = linear(at_p, p);
    let pq = linear(at_p, q);
    let qq = linear(at_q, q);
    let b = vec4f(dot(pp, p), dot(pp, q), dot(pq, q), dot(qq, q));
    let slack = 1e-6 * max(max(abs(b.x), abs(b.y)), max(abs(b.z), abs(b.w)));
    var u = -1.0;
    if view.peel.x == 0.0 {
        u = rise(b, slack);
    } else if abs(b.x) <= slack {
        // what is met twice has the same depth
        u = 0.0;
    } else {
        // layers are behind, too
        u = rise(select(b, -b, b.x > 0.0), slack);
    }
    if u < 0.0 {
        return found;
    }
    let here = start + u * (end - start);
    let place = mix(p, q, u);
    // blossoming is linear in the place
    let left = Quadratic(mix(at_p.x, at_q.x, u), mix(at_p.y, at_q.y, u), mix(at_p.z, at_q.z, u));
    let l = linear(left, place);
    let gradient = axes * vec3f(2.0 * (l.y - l.x), l.z + l.w - 2.0 * l.y, l.z - l.w);
    found.met = true;
    found.hit.to_eye = -normalize(view.world_from_voxel * ray.direction);
    found.hit.normal = faced(view.covariant * gradient, found.hit.to_eye);
    found.hit.color = view.shell.rgb;
    if CURVATURE {
        // derivatives along the local axes, three times smaller than they are
        let h = mat3x3f(slopes(linear(left, AXIS_U)), slopes(linear(left, AXIS_V)), slopes(linear(left, AXIS_W)));
        let turn = view.covariant * axes;
        let strength = curvature(3.0 * (view.covariant * gradient), 6.0 * (turn * h * transpose(turn))) * view.tint.y;
        let end = select(view.negative.rgb, view.positive.rgb, strength > 0.0);
        found.hit.color = mix(found.hit.color, end, min(abs(strength), 1.0));
    }
    found.hit.depth = ray.depth + here;
    found.hit.place = t.center + (ray.origin + here * ray.direction);
    found.depth = buffer_depth(found.hit.depth);
    return found;
}

struct Shaded {
    @location(0) color: vec4f,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn picture_main(t: Corner) -> Shaded {
    let found = find(t);
    if !found.met {
        discard;
    }
    return Shaded(shaded(found.hit), found.depth);
}

// normal and depth instead of a colour
@fragment
fn probe_main(t: Corner) -> Shaded {
    let found = find(t);
    if !found.met {
        discard;
    }
    return Shaded(vec4f(found.hit.normal, found.hit.depth), found.depth);
}

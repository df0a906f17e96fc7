// The values: each thread samples a few voxels of the brick that fill whole words.

// ~ of the tetrahedron; 0 for none
@group(1) @binding(0) var<storage, read> owner: array<u32>;
@group(1) @binding(1) var<storage, read_write> values: array<u32>;
@group(2) @binding(0) var volume: texture_3d<Texel>;

const NEAREST = 1u;
const DENSITY = 2u;
// the first texture that is read from: what comes from none is written now
const FIRST = 4u;
const FLOAT = 8u;

// half a voxel and what counts as nothing, 44 bits behind the point
const HALF = vec2u(0x800u, SNAP);

// voxels of the input, rounded down
fn whole(base: vec3i, p: Fixed4) -> vec3i {
    return base + (bitcast<vec4i>(p.hi) >> vec4u(12u)).xyz;
}

fn texel(cell: vec3i) -> vec4f {
    return vec4f(textureLoad(volume, min(cell, vec3i(job.input.xyz) - 1) - vec3i(job.first.xyz), 0));
}

// what has no weight is not looked at: NaN and infinity stay where they are
fn blend(a: vec4f, b: vec4f, t: f32) -> vec4f {
    return select(a + t * (b - a), a, t == 0.0);
}

// trilinear by hand: the weights of a texture filter have 8 bits
fn linear(i: vec3i, t: vec3f) -> vec4f {
    let near = blend(
        blend(texel(i), texel(i + vec3i(1, 0, 0)), t.x),
        blend(texel(i + vec3i(0, 1, 0)), texel(i + vec3i(1, 1, 0)), t.x),
        t.y,
    );
    let far = blend(
        blend(texel(i + vec3i(0, 0, 1)), texel(i + vec3i(1, 0, 1)), t.x),
        blend(texel(i + vec3i(0, 1, 1)), texel(i + vec3i(1, 1, 1)), t.x),
        t.y,
    );
    return blend(near, far, t.z);
}

const OUTSIDE = 0u;
const INSIDE = 1u;
const ELSEWHERE = 2u;

struct Sample {
    kind: u32,
    value: vec4f,
}

// the value of a voxel that belongs to a tetrahedron
fn sample(tet: u32, voxel: u32) -> Sample {
    let row = voxel / job.brick.x;
    let place = vec3u(voxel % job.brick.x, row % job.brick.y, row / job.brick.y);
    let p = at(tets[tet].rest, place - tets[tet].lo);
    let base = tets[tet].base;
    let last = vec3i(job.input.xyz) - 1;
    let q = plus(p, Fixed4(vec4u(HALF.x), vec4u(HALF.y)));
    let index = whole(base, q);
    let least = whole(base, plus(q, negated(Fixed4(vec4u(0u), vec4u(2u * SNAP)))));
    if any(index < vec3i(0)) || any(least > last) {
        return Sample(OUTSIDE, vec4f(0.0));
    }
    var cell = min(index, last);
    var t = vec3f(0.0);
    if (job.chunk.w & NEAREST) == 0u {
        // 24 bits behind the point, rounded
        let r = plus(p, Fixed4(vec4u(0u), vec4u(0x80000u)));
        cell = whole(base, r);
        t = vec3f((((r.hi & vec4u(0xfffu)) << vec4u(12u)) | (r.lo >> vec4u(20u))).xyz) * 5.9604645e-8;
        t = select(t, vec3f(0.0), (cell < vec3i(0)) | (cell >= last));
        cell = clamp(cell, vec3i(0), last);
    }
    if any(cell < vec3i(job.first.xyz)) || any(cell >= vec3i(job.end.xyz)) {
        return Sample(ELSEWHERE, vec4f(0.0));
    }
    var value: vec4f;
    if (job.chunk.w & NEAREST) == 0u {
        value = linear(cell, t);
    } else {
        value = texel(cell);
    }
    if (job.chunk.w & DENSITY) != 0u {
        value *= tets[tet].weight;
    }
    return Sample(INSIDE, value);
}

// the stored sample in the lowest bits: whole numbers are rounded, halves away from zero
fn code(value: f32) -> u32 {
    if (job.chunk.w & FLOAT) != 0u {
        return bitcast<u32>(value);
    }
    let v = clamp(value, job.range.x, job.range.y);
    return bitcast<u32>(i32(sign(v) * floor(abs(v) + 0.5)));
}

@compute @workgroup_size(64)
fn sample_main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let i = number(group) * 64u + thread;
    if i >= job.chunk.y {
        return;
    }
    let unit = job.chunk.x + i;
    let bits = job.end.w;
    let ones = 0xffffffffu >> (32u - bits);
    let first_pass = (job.chunk.w & FIRST) != 0u;
    var to = unit * job.first.w;
    var word = 0u;
    var written = 0u;
    var shift = 0u;
    var missed = 0u;
    for (var v = 0u; v < job.input.w; v++) {
        let voxel = unit * job.input.w + v;
        var found = Sample(OUTSIDE, vec4f(0.0));
        if voxel < job.outside.y {
            let mark = owner[voxel];
            if mark != 0u {
                found = sample(~mark, voxel);
                missed += u32(found.kind == OUTSIDE && first_pass);
            }
        }
        let put = found.kind == INSIDE || (found.kind == OUTSIDE && first_pass);
        for (var c = 0u; c < job.brick.w; c++) {
            let value = select(job.outside.x, code(found.value[c]), found.kind == INSIDE);
            word |= select(0u, (value & ones) << shift, put);
            written |= select(0u, ones << shift, put);
            shift += bits;
            if shift == 32u {
                if written == 0xffffffffu {
                    values[to] = word;
                } else if written != 0u {
                    values[to] = (values[to] & ~written) | word;
                }
                to += 1u;
                word = 0u;
                written = 0u;
                shift = 0u;
            }
        }
    }
    if missed > 0u {
        count(group, 3u, missed);
    }
}

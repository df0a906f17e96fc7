// Shared by the two halves of the warp: tetrahedra of a brick of the output, and numbers of 64 bits.
//
// Faces and rest positions are affine functions of voxel indices, with whole coefficients of 64 bits, worked out in u32:
// integers wrap, are never reordered and never fused, so every device decides in the same way which voxels are inside.

// four numbers in two's complement
struct Fixed4 {
    hi: vec4u,
    lo: vec4u,
}

struct Affine4 {
    x: Fixed4,
    y: Fixed4,
    z: Fixed4,
    at: Fixed4,
}

struct Tet {
    // not negative inside
    bary: Affine4,
    // voxels of the input relative to `base`, 44 bits behind the point
    rest: Affine4,
    // added to `bary`, not negative well within
    inner: Fixed4,
    // lowest voxel, in voxels of the brick; `bary` and `rest` are relative to it
    lo: vec3u,
    // factor of densities
    weight: f32,
    size: vec3u,
    pad0: u32,
    base: vec3i,
    pad1: u32,
}

struct Warp {
    // voxels of the brick along i, j, k; channels
    brick: vec4u,
    // first and number of what is worked off; workgroups along x; flags
    chunk: vec4u,
    // voxels of the whole input along i, j, k; voxels that one thread samples
    input: vec4u,
    // lowest cell of the texture; words that one thread writes
    first: vec4u,
    // one beyond its last cell; bits of a sample
    end: vec4u,
    // smallest and largest stored value
    range: vec4f,
    // bits of the outside value; voxels of the brick
    outside: vec4u,
}

@group(0) @binding(0) var<uniform> job: Warp;
@group(0) @binding(1) var<storage, read> tets: array<Tet>;
// for each of 64 slots: voxels inside, met again, covered twice, beyond the input
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>, 256>;

fn count(group: vec3u, what: u32, n: u32) {
    atomicAdd(&counters[((group.x + group.y) % 64u) * 4u + what], n);
}

// number of the thread or workgroup
fn number(group: vec3u) -> u32 {
    return group.y * job.chunk.z + group.x;
}

fn plus(a: Fixed4, b: Fixed4) -> Fixed4 {
    let lo = a.lo + b.lo;
    return Fixed4(a.hi + b.hi + select(vec4u(0u), vec4u(1u), lo < b.lo), lo);
}

fn negated(a: Fixed4) -> Fixed4 {
    return Fixed4(~a.hi + select(vec4u(0u), vec4u(1u), a.lo == vec4u(0u)), ~a.lo + 1u);
}

// n below 2^16
fn times(a: Fixed4, n: vec4u) -> Fixed4 {
    let low = (a.lo & vec4u(0xffffu)) * n;
    let high = (a.lo >> vec4u(16u)) * n + (low >> vec4u(16u));
    return Fixed4(a.hi * n + (high >> vec4u(16u)), (high << vec4u(16u)) | (low & vec4u(0xffffu)));
}

fn negative(a: Fixed4) -> vec4<bool> {
    return a.hi >= vec4u(0x80000000u);
}

fn at(f: Affine4, voxel: vec3u) -> Fixed4 {
    let xy = plus(times(f.x, vec4u(voxel.x)), times(f.y, vec4u(voxel.y)));
    return plus(plus(xy, times(f.z, vec4u(voxel.z))), f.at);
}

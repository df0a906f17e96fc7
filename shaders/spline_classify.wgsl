// Which tetrahedra an isosurface may pass through: blocks of 4 x 4 x 4 cubes by the range of their samples, cubes by the signs
// of the 27 samples around them, tetrahedra by the hull of their coefficients. Lists are made by prefix sums.

struct Level {
    // samples along i, j, k
    dims: vec4u,
    // blocks along i, j, k, and all
    blocks: vec4u,
    // the isovalue, upper and lower bits
    iso: vec4f,
    // blocks and tetrahedra that there is room for; workgroups along x; cubes that there is room for
    room: vec4u,
}

struct Draw {
    index_count: u32,
    instance_count: u32,
    first_index: u32,
    base_vertex: u32,
    first_instance: u32,
}

struct Head {
    // workgroups of the passes over active blocks
    over_blocks: array<u32, 3>,
    // blocks that are worked off
    blocks: u32,
    // workgroups of the scan
    over_chunks: array<u32, 3>,
    // numbers to scan
    numbers: u32,
    // blocks, tetrahedra, and cubes with such, that there should be room for
    wanted_blocks: u32,
    wanted_tets: u32,
    wanted_cubes: u32,
    // of each kind, where its tetrahedra begin, and how many there are
    first: array<u32, 24>,
    count: array<u32, 24>,
    draws: array<Draw, 24>,
}

@group(0) @binding(0) var<uniform> level: Level;
// with one more sample on every side
@group(0) @binding(1) var samples: texture_3d<f32>;
// smallest and largest sample that the cubes of a block depend on
@group(0) @binding(2) var<storage, read> ranges: array<vec2f>;
// whether a block is active; after the scan, how many before it are
@group(0) @binding(3) var<storage, read_write> places: array<u32>;
@group(0) @binding(4) var<storage, read_write> list: array<u32>;
// for each cube of an active block, a bit for each kind
@group(0) @binding(5) var<storage, read_write> masks: array<u32>;
// by kind, then block: tetrahedra, and last, cubes with such; after the scan, how many before
@group(0) @binding(6) var<storage, read_write> counts: array<u32>;
@group(0) @binding(7) var<storage, read_write> head: Head;

const KINDS: u32 = 24u;
// of counts
const ROWS: u32 = 25u;
const SIDE: u32 = 6u;
// tetrahedra in an instance
const BATCH: u32 = 64u;
const SCAN_CHUNK: u32 = 2048u;

fn is_active(block: u32) -> bool {
    let r = (ranges[block] - level.iso.x) - level.iso.y;
    return r.x < 0.0 && r.y >= 0.0;
}

fn row_of(id: vec3u) -> u32 {
    return id.y * level.room.z + id.x;
}

@compute @workgroup_size(64)
fn blocks_main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) group: vec3u) {
    let block = row_of(group) * 64u + thread;
    if block < level.blocks.w {
        places[block] = u32(is_active(block));
    }
}

@compute @workgroup_size(64)
fn list_main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) group: vec3u) {
    let block = row_of(group) * 64u + thread;
    if block >= level.blocks.w {
        return;
    }
    if is_active(block) && places[block] < level.room.x {
        list[places[block]] = block;
    }
    if block == 0u {
        let wanted = places[level.blocks.w];
        let n = min(wanted, level.room.x);
        let wide = min(n, level.room.z);
        head.over_blocks = array<u32, 3>(wide, select(0u, (n + wide - 1u) / max(wide, 1u), n > 0u), 1u);
        head.blocks = n;
        head.numbers = ROWS * n;
        head.over_chunks = array<u32, 3>((ROWS * n + SCAN_CHUNK - 1u) / SCAN_CHUNK, 1u, 1u);
        head.wanted_blocks = wanted;
    }
}

var<workgroup> around: array<f32, 216>;
var<workgroup> cubes: array<u32, 64>;
var<workgroup> cube_count: atomic<u32>;
var<workgroup> cube_masks: array<atomic<u32>, 64>;

// where a cube lies in `around`, and the steps along the local axes of a kind
struct Near {
    center: i32,
    step: vec3i,
}

fn near(at: Near, x: i32, y: i32, z: i32) -> f32 {
    return around[at.center + x * at.step.x + y * at.step.y + z * at.step.z];
}

fn place(cube: u32) -> i32 {
    return i32(((cube / 16u + 1u) * SIDE + (cube / 4u) % 4u + 1u) * SIDE + cube % 4u + 1u);
}

fn near_of(cube: u32, kind: u32) -> Near {
    return Near(place(cube), vec3i(vec3f(1.0, f32(SIDE), f32(SIDE * SIDE)) * kind_axes(kind)));
}

fn corner(block: u32) -> vec3u {
    let b = level.blocks;
    return 4u * vec3u(block % b.x, (block / b.x) % b.y, block / (b.x * b.y));
}

// takes the samples around a block
fn gather(block: u32, thread: u32) {
    let low = corner(block);
    let last = level.dims.xyz + 1u;
    for (var i = thread; i < SIDE * SIDE * SIDE; i += 64u) {
        let at = min(low + vec3u(i % SIDE, (i / SIDE) % SIDE, i / (SIDE * SIDE)), last);
        around[i] = (textureLoad(samples, at, 0).x - level.iso.x) - level.iso.y;
    }
}

@compute @workgroup_size(64)
fn tets_main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) group: vec3u) {
    let slot = row_of(group);
    // the same for all threads, so that barriers may follow
    let here = slot < head.blocks;
    var block = 0u;
    if here {
        block = list[slot];
    }
    gather(block, thread);
    atomicStore(&cube_masks[thread], 0u);
    if thread == 0u {
        atomicStore(&cube_count, 0u);
    }
    workgroupBarrier();

    let cube = corner(block) + vec3u(thread % 4u, (thread / 4u) % 4u, thread / 16u);
    var lo = 1e38;
    var hi = -1e38;
    for (var z = -1; z <= 1; z++) {
        for (var y = -1; y <= 1; y++) {
            let row = place(thread) + (z * i32(SIDE) + y) * i32(SIDE);
            let three = vec3f(around[row - 1], around[row], around[row + 1]);
            lo = min(min(lo, three.x), min(three.y, three.z));
            hi = max(max(hi, three.x), max(three.y, three.z));
        }
    }
    if here && all(cube < level.dims.xyz) && lo < 0.0 && hi >= 0.0 {
        cubes[atomicAdd(&cube_count, 1u)] = thread;
    }
    workgroupBarrier();

    let pairs = atomicLoad(&cube_count) * KINDS;
    for (var i = thread; i < pairs; i += 64u) {
        let kind = i % KINDS;
        let own = cubes[i / KINDS];
        if has_zero(piece(near_of(own, kind))) {
            atomicOr(&cube_masks[own], 1u << kind);
        }
    }
    workgroupBarrier();

    if here {
        masks[slot * 64u + thread] = atomicLoad(&cube_masks[thread]);
        if thread < ROWS {
            var count = 0u;
            for (var i = 0u; i < 64u; i++) {
                let mask = atomicLoad(&cube_masks[i]);
                count += select((mask >> thread) & 1u, u32(mask != 0u), thread == KINDS);
            }
            counts[thread * head.blocks + slot] = count;
        }
    }
}

// what is drawn
@compute @workgroup_size(32)
fn draws_main(@builtin(local_invocation_index) kind: u32) {
    if kind >= KINDS {
        return;
    }
    let n = head.blocks;
    var first = 0u;
    var next = 0u;
    var all = 0u;
    var all_cubes = 0u;
    if n > 0u {
        first = counts[kind * n];
        next = counts[(kind + 1u) * n];
        all = counts[KINDS * n];
        all_cubes = counts[ROWS * n] - all;
    }
    // what there is no room for is not drawn: the host sees that it is missing, and does it again
    let count = select(0u, next - first, all <= level.room.y && all_cubes <= level.room.w);
    head.first[kind] = first;
    head.count[kind] = count;
    head.draws[kind] = Draw(12u * BATCH, (count + BATCH - 1u) / BATCH, 0u, 4u * BATCH * kind, 0u);
    if kind == 0u {
        head.wanted_tets = all;
        head.wanted_cubes = all_cubes;
    }
}

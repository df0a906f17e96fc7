// Writes the lists of tetrahedra: with STORED their coefficients, too, with DETERMINING those that determine a cube's.

// numbers of their cubes; with DETERMINING places of the cubes in the store, and from the end of the list, by place, the numbers
@group(1) @binding(0) var<storage, read_write> tets: array<u32>;
@group(1) @binding(1) var<storage, read_write> store: array<vec4f>;

// a bit for each cube of the block, by kind, and last of those that have any
var<workgroup> members: array<atomic<u32>, 50>;

fn number_of(cube: vec3u) -> u32 {
    return (cube.z * level.dims.y + cube.y) * level.dims.x + cube.x;
}

fn join(row: u32, thread: u32) {
    atomicOr(&members[2u * row + thread / 32u], 1u << (thread % 32u));
}

// members of the block before a cube
fn rank(row: u32, thread: u32) -> u32 {
    let own = atomicLoad(&members[2u * row + thread / 32u]) & ((1u << (thread % 32u)) - 1u);
    var before = countOneBits(own);
    if thread >= 32u {
        before += countOneBits(atomicLoad(&members[2u * row]));
    }
    return before;
}

// the sum of two samples on both sides of a face
fn pair(at: i32, across: i32) -> f32 {
    return around[at] + around[at + across];
}

// four of the coefficients that determine a cube's, in the order of `spline::Determining`
fn record(center: i32, row: u32) -> vec4f {
    let size = i32(SIDE);
    let stride = vec3i(1, size, size * size);
    if row < 8u {
        let back = (vec3u(row) & vec3u(1u, 2u, 4u)) != vec3u(0u);
        let step = select(stride, -stride, back);
        // the samples around the corner
        let c = around[center];
        let x = around[center + step.x];
        let y = around[center + step.y];
        let z = around[center + step.z];
        let yz = around[center + step.y + step.z];
        let xz = around[center + step.x + step.z];
        let xy = around[center + step.x + step.y];
        let near = vec3f((c + y) + (z + yz), (c + x) + (z + xz), (c + x) + (y + xy));
        let all = near.z + ((z + xz) + (yz + around[center + step.x + step.y + step.z]));
        return vec4f(all / 8.0, (all + 4.0 * near) / 24.0);
    }
    let axis = (row - 8u) / 2u;
    let across = select(stride, -stride, vec3<bool>(row % 2u == 1u))[axis];
    let low = stride[select(0u, 1u, axis == 0u)];
    let high = stride[select(2u, 1u, axis == 2u)];
    let middle = pair(center, across);
    let next = vec4f(
        pair(center + low, across),
        pair(center - low, across),
        pair(center + high, across),
        pair(center - high, across),
    );
    let pp = pair(center + low + high, across);
    let pm = pair(center + low - high, across);
    let mp = pair(center - low + high, across);
    let mm = pair(center - low - high, across);
    let beside = vec2f(next.z + next.w, next.x + next.y).xxyy;
    let diagonal = vec4f(pp + pm, mp + mm, pp + mp, pm + mm);
    return 13.0 / 48.0 * middle + (7.0 / 48.0 * next + (beside / 32.0 + diagonal / 96.0));
}

@compute @workgroup_size(64)
fn emit_main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) group: vec3u) {
    let slot = row_of(group);
    let n = head.blocks;
    let here = slot < n && head.wanted_tets <= level.room.y && head.wanted_cubes <= level.room.w;
    var block = 0u;
    var mask = 0u;
    // cubes with tetrahedra in the blocks before
    var cubes_before = 0u;
    if here {
        block = list[slot];
        mask = masks[slot * 64u + thread];
        cubes_before = counts[KINDS * n + slot] - counts[KINDS * n];
    }
    if STORED || DETERMINING {
        gather(block, thread);
    }
    if thread < 2u * ROWS {
        atomicStore(&members[thread], 0u);
    }
    workgroupBarrier();
    if mask != 0u {
        join(KINDS, thread);
    }
    for (var rest = mask; rest != 0u; rest &= rest - 1u) {
        join(countTrailingZeros(rest), thread);
    }
    workgroupBarrier();
    var entry = number_of(corner(block) + vec3u(thread % 4u, (thread / 4u) % 4u, thread / 16u));
    if DETERMINING {
        if mask != 0u {
            let own = rank(KINDS, thread);
            cubes[own] = thread;
            tets[arrayLength(&tets) - 1u - (cubes_before + own)] = entry;
            entry = cubes_before + own;
        }
        workgroupBarrier();
        // by all threads, so that few idle
        let found = countOneBits(atomicLoad(&members[2u * KINDS])) + countOneBits(atomicLoad(&members[2u * KINDS + 1u]));
        for (var i = thread; i < RECORD * found; i += 64u) {
            store[RECORD * cubes_before + i] = record(place(cubes[i / RECORD]), i % RECORD);
        }
    }
    for (var rest = mask; rest != 0u; rest &= rest - 1u) {
        let kind = countTrailingZeros(rest);
        let at = counts[kind * n + slot] + rank(kind, thread);
        tets[at] = entry;
        if STORED {
            let p = piece(near_of(thread, kind));
            store[5u * at] = p.a;
            store[5u * at + 1u] = p.b;
            store[5u * at + 2u] = p.c;
            store[5u * at + 3u] = p.d;
            store[5u * at + 4u] = p.e;
        }
    }
}

// Which voxels each tetrahedron holds, and of several tetrahedra the first: solved for row by row (`solve_main`, then
// `claim_main`), or tested (`test_main`).

// a pair for up to eight rows of a layer, two pairs for a block of voxels; see `src/gpu/warp/bricks.rs`
@group(1) @binding(0) var<storage, read> items: array<vec2u>;
// first and one beyond the last voxel of a row, 16 bits each
@group(1) @binding(1) var<storage, read_write> spans: array<u32>;
// ~ of the tetrahedron; 0 for none
@group(1) @binding(2) var<storage, read_write> owner: array<atomic<u32>>;

const ROWS = 8u;

struct Rows {
    tet: u32,
    y: u32,
    z: u32,
    count: u32,
}

fn rows_of(item: vec2u) -> Rows {
    return Rows(item.x, item.y & 0x7ffu, (item.y >> 11u) & 0x7ffu, (item.y >> 22u) + 1u);
}

fn real(a: Fixed4) -> vec4f {
    return vec4f(bitcast<vec4i>(a.hi)) * 4294967296.0 + vec4f(a.lo);
}

// the smallest n in 0..=width with `start + n * step` not negative (width if there is none), for steps that are not
// negative
fn crossing(step: Fixed4, start: Fixed4, width: u32) -> vec4u {
    let w = vec4u(width);
    let none = vec4u(0u);
    // a guess that is right but near whole numbers; a row along a face is inside or outside as a whole
    let guess = ceil(-real(start) / max(real(step), vec4f(1.0)) - 1e-3);
    let along = (step.hi | step.lo) == none;
    let ends = select(none, w, negative(start));
    var n = select(vec4u(clamp(guess, vec4f(0.0), vec4f(f32(width)))), ends, along);
    let before = negative(plus(start, times(step, n - min(n, vec4u(1u))))) | (n == none);
    let here = !negative(plus(start, times(step, n))) | (n == w);
    if !all(before & here) {
        var lo = none;
        n = w;
        while any(lo < n) {
            let middle = (lo + n) >> vec4u(1u);
            let open = lo < n;
            let below = negative(plus(start, times(step, middle)));
            lo = select(lo, middle + 1u, below & open);
            n = select(n, middle, !below & open);
        }
    }
    return n;
}

// one thread a row
@compute @workgroup_size(64)
fn solve_main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let i = number(group) * 64u + thread;
    if i / ROWS >= job.chunk.y {
        return;
    }
    let rows = rows_of(items[i / ROWS]);
    if i % ROWS >= rows.count {
        return;
    }
    let width = tets[rows.tet].size.x;
    let start = at(tets[rows.tet].bary, vec3u(0u, rows.y + i % ROWS, rows.z));
    let step = tets[rows.tet].bary.x;
    // where coordinates fall from left to right the row is looked at from its other end
    let falling = negative(step);
    let last = plus(start, times(step, vec4u(width - 1u)));
    let back = negated(step);
    let n = crossing(
        Fixed4(select(step.hi, back.hi, falling), select(step.lo, back.lo, falling)),
        Fixed4(select(start.hi, last.hi, falling), select(start.lo, last.lo, falling)),
        width,
    );
    let lower = select(n, vec4u(0u), falling);
    let upper = select(vec4u(width), vec4u(width) - n, falling);
    let first = max(max(lower.x, lower.y), max(lower.z, lower.w));
    let beyond = max(first, min(min(upper.x, upper.y), min(upper.z, upper.w)));
    spans[i] = first | (beyond << 16u);
    if beyond > first {
        count(group, 0u, beyond - first);
    }
}

// `voxel` relative to the tetrahedron
fn claim(group: vec3u, tet: u32, voxel: vec3u) {
    let place = voxel + tets[tet].lo;
    let before = atomicMax(&owner[(place.z * job.brick.y + place.y) * job.brick.x + place.x], ~tet);
    if before != 0u {
        // of the two that meet, the later one loses; every loser loses once
        count(group, 1u, 1u);
        let loser = max(tet, ~before);
        let seen = place - tets[loser].lo;
        if !any(negative(plus(at(tets[loser].bary, seen), tets[loser].inner))) {
            count(group, 2u, 1u);
        }
    }
}

// eight threads a row
@compute @workgroup_size(64)
fn claim_main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let item = number(group);
    if item >= job.chunk.y {
        return;
    }
    let rows = rows_of(items[item]);
    let row = thread / 8u;
    if row >= rows.count {
        return;
    }
    let span = spans[item * ROWS + row];
    for (var x = (span & 0xffffu) + thread % 8u; x < (span >> 16u); x += 8u) {
        claim(group, rows.tet, vec3u(x, rows.y + row, rows.z));
    }
}

// one workgroup a block, one thread a column
@compute @workgroup_size(64)
fn test_main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let item = number(group);
    if item >= job.chunk.y {
        return;
    }
    let head = items[2u * item];
    let tail = items[2u * item + 1u];
    let tet = head.x;
    let lo = vec3u(head.y & 0xffffu, head.y >> 16u, tail.x & 0xffffu);
    let size = vec3u(tail.x >> 16u, tail.y & 0xffffu, tail.y >> 16u);
    let up = tets[tet].bary.z;
    var met = 0u;
    for (var y = thread / 8u; y < size.y; y += 8u) {
        for (var x = thread % 8u; x < size.x; x += 8u) {
            var b = at(tets[tet].bary, lo + vec3u(x, y, 0u));
            for (var z = 0u; z < size.z; z++) {
                if !any(negative(b)) {
                    claim(group, tet, lo + vec3u(x, y, z));
                    met += 1u;
                }
                b = plus(b, up);
            }
        }
    }
    if met > 0u {
        count(group, 0u, met);
    }
}

// The sums of all numbers before each, in place: chunks are added up, then their sums are scanned by one workgroup, then each
// chunk is scanned from there on. Nothing is atomic, so the result is always the same.

@group(0) @binding(0) var<storage, read_write> numbers: array<u32>;
@group(0) @binding(1) var<storage, read_write> sums: array<u32>;
// how many numbers; their sum is written behind them
@group(0) @binding(2) var<storage, read> count: array<u32>;

const THREADS: u32 = 256u;
const EACH: u32 = 8u;
const CHUNK: u32 = THREADS * EACH;

var<workgroup> partial: array<u32, 256>;

// the sum of what threads below have; `partial[THREADS - 1]` is that of all
fn before(thread: u32, own: u32) -> u32 {
    partial[thread] = own;
    workgroupBarrier();
    for (var reach = 1u; reach < THREADS; reach *= 2u) {
        var left = 0u;
        if thread >= reach {
            left = partial[thread - reach];
        }
        workgroupBarrier();
        partial[thread] += left;
        workgroupBarrier();
    }
    return partial[thread] - own;
}

fn number(i: u32) -> u32 {
    if i < count[0] {
        return numbers[i];
    }
    return 0u;
}

@compute @workgroup_size(256)
fn reduce_main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) group: vec3u) {
    var own = 0u;
    for (var i = 0u; i < EACH; i++) {
        own += number(group.x * CHUNK + i * THREADS + thread);
    }
    let left = before(thread, own);
    if thread == THREADS - 1u {
        sums[group.x] = left + own;
    }
}

@compute @workgroup_size(256)
fn sums_main(@builtin(local_invocation_index) thread: u32) {
    let chunks = (count[0] + CHUNK - 1u) / CHUNK;
    var base = 0u;
    for (var at = 0u; at < chunks; at += THREADS) {
        let i = at + thread;
        var own = 0u;
        if i < chunks {
            own = sums[i];
        }
        let left = before(thread, own);
        if i < chunks {
            sums[i] = base + left;
        }
        base += partial[THREADS - 1u];
        workgroupBarrier();
    }
}

@compute @workgroup_size(256)
fn scan_main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) group: vec3u) {
    let first = group.x * CHUNK + thread * EACH;
    var own = 0u;
    for (var i = 0u; i < EACH; i++) {
        own += number(first + i);
    }
    var sum = sums[group.x] + before(thread, own);
    for (var i = first; i < first + EACH; i++) {
        let here = number(i);
        if i < count[0] {
            numbers[i] = sum;
        }
        sum += here;
        if i + 1u == count[0] {
            numbers[i + 1u] = sum;
        }
    }
}

// The deformed volume on another grid: one thread per voxel of the output.

struct Resample {
    // voxel coordinates
    input_from_output: mat4x4f,
    // the world minus the centre that the deformers are relative to
    local_from_output: mat4x4f,
    // voxels along i, j, k; channels
    input: vec4u,
    // voxels along i, j, k; 1 for the nearest sample
    output: vec4u,
    // first row, voxels, workgroups along x
    chunk: vec4u,
    // factor from a texel to a stored value; outside value
    value: vec4f,
}

@group(0) @binding(0) var<uniform> job: Resample;
@group(1) @binding(0) var volume: texture_3d<f32>;
@group(2) @binding(3) var<storage, read_write> values: array<f32>;
// voxels that come from elsewhere, and those that come from beyond the input
@group(2) @binding(4) var<storage, read_write> counts: array<atomic<u32>, 2>;

// of the workgroup
var<workgroup> moved_here: atomic<u32>;
var<workgroup> outside_here: atomic<u32>;

// displacements of fewer voxels of the input do not count as moves
const MOVED = 1e-3;

fn texel(at: vec3i) -> vec4f {
    return textureLoad(volume, clamp(at, vec3i(0), vec3i(job.input.xyz) - 1), 0);
}

// trilinear by hand: the weights of a texture filter have 8 bits
fn linear(p: vec3f) -> vec4f {
    let x = clamp(p, vec3f(0.0), vec3f(job.input.xyz - 1u));
    let i = vec3i(x);
    let t = x - vec3f(i);
    let near = mix(
        mix(texel(i), texel(i + vec3i(1, 0, 0)), t.x),
        mix(texel(i + vec3i(0, 1, 0)), texel(i + vec3i(1, 1, 0)), t.x),
        t.y,
    );
    let far = mix(
        mix(texel(i + vec3i(0, 0, 1)), texel(i + vec3i(1, 0, 1)), t.x),
        mix(texel(i + vec3i(0, 1, 1)), texel(i + vec3i(1, 1, 1)), t.x),
        t.y,
    );
    return mix(near, far, t.z);
}

@compute @workgroup_size(64)
fn resample_main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let i = (group.y * job.chunk.z + group.x) * 64u + thread;
    if i < job.chunk.y {
        resample(i);
    }
    workgroupBarrier();
    if thread == 0u {
        atomicAdd(&counts[0], atomicLoad(&moved_here));
        atomicAdd(&counts[1], atomicLoad(&outside_here));
    }
}

fn resample(i: u32) {
    let row = job.chunk.x + i / job.output.x;
    let voxel = vec4f(vec3f(vec3u(i % job.output.x, row % job.output.y, row / job.output.y)), 1.0);
    // the displacement is a difference, so that what is not moved stays exactly where it is
    let moved = displaced_by((job.local_from_output * voxel).xyz);
    let shift = (map.target_from_local * vec4f(moved, 0.0)).xyz;
    if any(abs(shift) > vec3f(MOVED)) {
        atomicAdd(&moved_here, 1u);
    }
    var p = (job.input_from_output * voxel).xyz - shift;
    let whole = round(p);
    p = select(p, whole, abs(p - whole) < vec3f(1e-4));
    var value = vec4f(job.value.y);
    if all(p >= vec3f(-0.5)) && all(p <= vec3f(job.input.xyz) - 0.5) {
        if job.output.w == 1u {
            value = texel(vec3i(floor(p + 0.5))) * job.value.x;
        } else {
            value = linear(p) * job.value.x;
        }
    } else {
        atomicAdd(&outside_here, 1u);
    }
    let channels = job.input.w;
    for (var c = 0u; c < channels; c++) {
        values[i * channels + c] = value[c];
    }
}

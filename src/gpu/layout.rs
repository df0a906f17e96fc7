//! What is shared with the shaders, and sizes as pure functions.

use bytemuck::{Pod, Zeroable};

/// `Object` of `shaders/field.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct ObjectUniform {
    /// 1 / texels along i, j, k.
    pub texel: [f32; 4],
    /// Columns of the derivative of the texture coordinate by world position, each padded.
    pub jacobian: [[f32; 4]; 3],
}

/// `Map` of `shaders/deform.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct MapUniform {
    pub target_from_local: [[f32; 4]; 4],
    /// Number of steps; the rest is unused.
    pub count: [u32; 4],
}

/// `Step` of `shaders/deform.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct StepRecord {
    pub kind: u32,
    pub falloff: u32,
    pub first: u32,
    pub core: f32,
    pub center: [f32; 3],
    pub inverse_radius: f32,
    pub vector: [f32; 3],
    pub turns: f32,
    pub axis_u: [f32; 3],
    pub cells_u: f32,
    pub axis_v: [f32; 3],
    pub cells_v: f32,
    pub axis_w: [f32; 3],
    pub cells_w: f32,
}

/// `Resample` of `shaders/resample.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct ResampleUniform {
    pub input_from_output: [[f32; 4]; 4],
    pub local_from_output: [[f32; 4]; 4],
    /// Voxels of the input along i, j, k; channels.
    pub input: [u32; 4],
    /// Voxels of the output along i, j, k; 1 for the nearest sample.
    pub output: [u32; 4],
    /// First row of the chunk, its voxels, and its workgroups along x; the rest is unused.
    pub chunk: [u32; 4],
    /// Factor from a texel to a stored value; the outside value; the rest is unused.
    pub value: [f32; 4],
}

/// `Fixed4` of `shaders/warp.wgsl`: four numbers in two's complement, upper and lower halves.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct Fixed4 {
    pub hi: [u32; 4],
    pub lo: [u32; 4],
}

/// `Affine4` of `shaders/warp.wgsl`: `n.x * x + n.y * y + n.z * z + at`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct Affine4 {
    pub x: Fixed4,
    pub y: Fixed4,
    pub z: Fixed4,
    pub at: Fixed4,
}

/// `Tet` of `shaders/warp.wgsl`: a tetrahedron in a brick of the output.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct WarpTet {
    /// Not negative inside, each of the four with a scale of its own; by voxels relative to `lo`.
    pub bary: Affine4,
    /// Voxels of the input relative to `base`, with 44 bits behind the point; the fourth is unused.
    pub rest: Affine4,
    /// Added to `bary`, not negative where the voxel lies well within.
    pub inner: Fixed4,
    /// Its lowest voxel, in voxels of the brick.
    pub lo: [u32; 3],
    /// Factor of densities.
    pub weight: f32,
    /// Voxels along i, j, k.
    pub size: [u32; 3],
    pub pad0: u32,
    pub base: [i32; 3],
    pub pad1: u32,
}

/// `Warp` of `shaders/warp.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct WarpUniform {
    /// Voxels of the brick along i, j, k; channels.
    pub brick: [u32; 4],
    /// First and number of what is worked off; workgroups along x; flags.
    pub chunk: [u32; 4],
    /// Voxels of the whole input along i, j, k; voxels that one thread samples.
    pub input: [u32; 4],
    /// Lowest cell of the texture; words that one thread writes.
    pub first: [u32; 4],
    /// One beyond its last cell; bits of a sample.
    pub end: [u32; 4],
    /// Smallest and largest stored value; the rest is unused.
    pub range: [f32; 4],
    /// Bits of the outside value; voxels of the brick; the rest is unused.
    pub outside: [u32; 4],
}

/// `Level` of `shaders/spline_classify.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct SplineLevelUniform {
    /// Samples along i, j, k; the fourth is unused.
    pub dims: [u32; 4],
    /// Blocks along i, j, k, and all.
    pub blocks: [u32; 4],
    /// The isovalue, upper and lower bits; the rest is unused.
    pub iso: [f32; 4],
    /// Blocks and tetrahedra that there is room for; workgroups along x; cubes that there is room for.
    pub room: [u32; 4],
}

/// `Head` of `shaders/spline_classify.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct SplineHead {
    pub over_blocks: [u32; 3],
    pub blocks: u32,
    pub over_chunks: [u32; 3],
    pub numbers: u32,
    pub wanted_blocks: u32,
    pub wanted_tets: u32,
    pub wanted_cubes: u32,
    pub first: [u32; 24],
    pub count: [u32; 24],
    /// Arguments of indexed indirect draws.
    pub draws: [[u32; 5]; 24],
}

/// Planes that a spline's picture may be cut by.
pub const SPLINE_PLANES: usize = 12;
/// Entries of its table of colours.
pub const SPLINE_COLORS: usize = crate::spline::paint::Colors::ENTRIES;

/// `View` of `shaders/spline_view.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct SplineViewUniform {
    pub clip_from_voxel: [[f32; 4]; 4],
    /// Columns, each padded.
    pub world_from_voxel: [[f32; 4]; 3],
    pub covariant: [[f32; 4]; 3],
    pub origin: [f32; 4],
    pub origin_low: [f32; 4],
    pub across: [f32; 4],
    pub across_low: [f32; 4],
    pub down: [f32; 4],
    pub down_low: [f32; 4],
    pub eye: [f32; 4],
    pub eye_low: [f32; 4],
    /// Samples along i, j, k; planes.
    pub dims: [u32; 4],
    /// The isovalue, upper and lower bits; scale of depths; voxels that a pixel covers where w is 1.
    pub iso: [f32; 4],
    pub planes: [[f32; 4]; SPLINE_PLANES],
    pub normals: [[f32; 4]; SPLINE_PLANES],
    /// 1 for mean and 2 for Gaussian curvature; strength; 1 if caps have colours of their own; the fourth is unused.
    pub tint: [f32; 4],
    pub positive: [f32; 4],
    pub negative: [f32; 4],
    /// Place in the table from a value less the isovalue: factor and summand; the rest is unused.
    pub window: [f32; 4],
    /// Linear colour of the surface, and its opacity.
    pub shell: [f32; 4],
    /// 1 if only what lies behind the layer before is drawn; by how many voxels; the rest is unused.
    pub peel: [f32; 4],
    /// `[0, 1]^3` over all cells of the occupancy from a voxel; size of a cell in the world.
    pub unit: [f32; 4],
    pub caps: [[f32; 4]; SPLINE_COLORS],
}

/// Bytes from one row to the next when a texture is copied to a buffer.
pub fn padded_row(width: u32, texel_bytes: u32) -> u32 {
    (width * texel_bytes).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}

/// The size a buffer of `have` bytes is given so that it holds `need`: unchanged if it does, else with room to grow, so
/// that a slowly growing load does not allocate each frame.
pub fn grown(have: u64, need: u64, limit: u64) -> u64 {
    if need <= have { have } else { (need + need / 4).next_multiple_of(256).min(limit).max(need) }
}

/// Layers of a 3D texture uploaded at once so that a chunk stays near `budget` bytes; at least one.
pub fn layers_per_chunk(layer_bytes: u64, layers: u32, budget: u64) -> u32 {
    ((budget / layer_bytes.max(1)) as u32).clamp(1, layers.max(1))
}

/// Threads of a workgroup of `shaders/resample.wgsl`.
pub const RESAMPLE_GROUP: u32 = 64;

/// Rows of an output grid that are resampled at once, so that a chunk stays within `budget` bytes; at least one, and never
/// more than one dispatch holds.
pub fn rows_per_chunk(width: usize, channels: usize, budget: u64) -> usize {
    let row = (width * channels * 4) as u64;
    ((budget / row.max(1)) as usize).max(1)
}

/// Workgroups along x and y for so many threads, if one dimension holds `limit`.
pub fn workgroups(threads: u32, limit: u32) -> [u32; 2] {
    let groups = threads.div_ceil(RESAMPLE_GROUP).max(1);
    let x = groups.min(limit);
    [x, groups.div_ceil(x)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_padded_to_what_copies_want() {
        assert_eq!([1, 64, 65, 512].map(|w| padded_row(w, 4)), [256, 256, 512, 2048]);
    }

    #[test]
    fn buffers_grow_with_room_and_never_shrink() {
        assert_eq!(grown(1024, 1000, 1 << 20), 1024);
        assert_eq!(grown(1024, 2000, 1 << 20), 2560);
        // near the limit there is no room to grow, but what is needed is had
        assert_eq!(grown(1024, 1_000_000, 1 << 20), 1 << 20);
        let mut size = 0;
        let steps = (0..1000u64).filter(|n| {
            let next = grown(size, n * 1000, u64::MAX >> 1);
            std::mem::replace(&mut size, next) != next
        });
        assert!(steps.count() < 40, "a slowly growing load must not allocate each frame");
    }

    #[test]
    fn chunks_stay_within_their_budget() {
        assert_eq!(layers_per_chunk(1 << 20, 100, 32 << 20), 32);
        assert_eq!(layers_per_chunk(1 << 30, 100, 32 << 20), 1);
        assert_eq!(layers_per_chunk(10, 3, 32 << 20), 3);
        assert_eq!(rows_per_chunk(256, 1, 1 << 20), 1024);
        assert_eq!(rows_per_chunk(1 << 20, 4, 1 << 20), 1);
    }

    #[test]
    fn workgroups_cover_every_thread() {
        for threads in [1, 63, 64, 65, 4_194_240, 4_194_241, 30_000_000] {
            let [x, y] = workgroups(threads, 65_535);
            assert!(x <= 65_535 && y <= 65_535);
            assert!(u64::from(x) * u64::from(y) * u64::from(RESAMPLE_GROUP) >= u64::from(threads));
            assert!(u64::from(x) * u64::from(y - 1) * u64::from(RESAMPLE_GROUP) < u64::from(threads));
        }
    }
}

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

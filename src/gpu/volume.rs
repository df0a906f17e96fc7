//! Volumes as 3D textures.
//!
//! Not storage buffers: Mesa's software Vulkan binds 128 MiB of one at most, and the filter of a texture is free on a
//! graphics card.

use half::f16;

use super::layout::layers_per_chunk;
use super::{Capabilities, Gpu, GpuError};
use crate::render::{Field, TexelSlice};

/// Bytes handed to the driver at once while uploading.
pub(super) const CHUNK: u64 = 32 << 20;

/// The most bytes of a volume that is widened for the sake of speed.
const WIDE: u64 = 512 << 20;

/// How texels are kept on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Storage {
    AsIs,
    Float32,
    Float16,
}

/// The texture format for texels of a type, and whether they must be converted.
///
/// A software adapter filters 32-bit floats faster than 8 bits, and to their full precision: `wide` asks for that.
fn format(texels: TexelSlice<'_>, channels: usize, can: Capabilities, wide: bool) -> (wgpu::TextureFormat, Storage) {
    use wgpu::TextureFormat as F;
    let rgba = channels == 4;
    let float = if can.filter_float32 {
        (if rgba { F::Rgba32Float } else { F::R32Float }, Storage::Float32)
    } else {
        (if rgba { F::Rgba16Float } else { F::R16Float }, Storage::Float16)
    };
    match texels {
        TexelSlice::U8(_) if !wide => (if rgba { F::Rgba8Unorm } else { F::R8Unorm }, Storage::AsIs),
        TexelSlice::U16(_) if can.unorm16 && !wide => (if rgba { F::Rgba16Unorm } else { F::R16Unorm }, Storage::AsIs),
        TexelSlice::F32(_) if can.filter_float32 => (float.0, Storage::AsIs),
        _ => float,
    }
}

/// A field's texels on the device.
#[derive(Debug)]
pub struct VolumeTexture {
    pub(crate) view: wgpu::TextureView,
}

impl VolumeTexture {
    /// Uploads the texels in chunks, so that little more than the texture itself is allocated.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] beyond the adapter's largest 3D texture, [`GpuError::OutOfMemory`].
    pub fn upload(gpu: &Gpu, field: &Field) -> Result<Self, GpuError> {
        let dims = texture_size(field.grid.dims, gpu.limits().max_texture_dimension_3d)?;
        let texels = field.texels.slice();
        let wide_bytes = field.grid.len() as u64 * field.channels as u64 * 4;
        let wide = gpu.is_software() && gpu.capabilities().filter_float32 && wide_bytes <= WIDE;
        let (format, storage) = format(texels, field.channels, gpu.capabilities(), wide);
        let texel_bytes = format.block_copy_size(None).unwrap_or(16);
        let layer_bytes = u64::from(dims[0]) * u64::from(dims[1]) * u64::from(texel_bytes);
        let texture = texture(gpu, "the volume", dims, format, layer_bytes)?;
        let step = layers_per_chunk(layer_bytes, dims[2], CHUNK);
        let layer = dims[0] as usize * dims[1] as usize * field.channels;
        for z in (0..dims[2]).step_by(step as usize) {
            let depth = step.min(dims[2] - z);
            let range = z as usize * layer..(z + depth) as usize * layer;
            write_layers(gpu, &texture, z, depth, &encode(texels, range, storage))?;
        }
        Ok(Self { view: texture.create_view(&wgpu::TextureViewDescriptor::default()) })
    }
}

/// An empty 3D texture.
pub(super) fn texture(
    gpu: &Gpu,
    what: &'static str,
    dims: [u32; 3],
    format: wgpu::TextureFormat,
    layer_bytes: u64,
) -> Result<wgpu::Texture, GpuError> {
    gpu.allocate(what, layer_bytes * u64::from(dims[2]), || {
        gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(what),
            size: wgpu::Extent3d { width: dims[0], height: dims[1], depth_or_array_layers: dims[2] },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D3,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        })
    })
}

/// Writes whole layers from `z` on, and waits, so that the driver frees what it staged.
pub(super) fn write_layers(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    z: u32,
    depth: u32,
    bytes: &[u8],
) -> Result<(), GpuError> {
    let size = texture.size();
    gpu.queue.write_texture(
        wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x: 0, y: 0, z },
            aspect: wgpu::TextureAspect::All,
        },
        bytes,
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some((bytes.len() as u64 / u64::from(depth) / u64::from(size.height)) as u32),
            rows_per_image: Some(size.height),
        },
        wgpu::Extent3d { depth_or_array_layers: depth, ..size },
    );
    gpu.queue.submit([]);
    gpu.wait()
}

/// The size of a texture that holds a grid, if the adapter allows it.
pub(super) fn texture_size(dims: [usize; 3], limit: u32) -> Result<[u32; 3], GpuError> {
    if dims.iter().any(|&n| n > limit as usize) {
        let [x, y, z] = dims;
        return Err(GpuError::TooLarge {
            what: "a volume",
            size: format!("{x}x{y}x{z} voxels"),
            limit: format!("{limit} voxels along each side"),
        });
    }
    Ok(dims.map(|n| n as u32))
}

/// A range of texels as bytes of the texture.
fn encode(texels: TexelSlice<'_>, range: std::ops::Range<usize>, storage: Storage) -> std::borrow::Cow<'_, [u8]> {
    use std::borrow::Cow;
    fn floats(values: impl Iterator<Item = f32>, storage: Storage) -> Vec<u8> {
        match storage {
            Storage::Float16 => values.flat_map(|v| f16::from_f32(v).to_ne_bytes()).collect(),
            _ => values.flat_map(f32::to_ne_bytes).collect(),
        }
    }
    match (texels, storage) {
        (TexelSlice::U8(t), Storage::AsIs) => Cow::Borrowed(&t[range]),
        (TexelSlice::U8(t), _) => Cow::Owned(floats(t[range].iter().map(|&v| f32::from(v) / 255.0), storage)),
        (TexelSlice::U16(t), Storage::AsIs) => Cow::Borrowed(bytemuck::cast_slice(&t[range])),
        (TexelSlice::F32(t), Storage::AsIs) => Cow::Borrowed(bytemuck::cast_slice(&t[range])),
        (TexelSlice::U16(t), _) => Cow::Owned(floats(t[range].iter().map(|&v| f32::from(v) / 65535.0), storage)),
        (TexelSlice::F32(t), _) => Cow::Owned(floats(t[range].iter().copied(), storage)),
    }
}

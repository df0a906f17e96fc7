//! The input as 3D textures: one if it fits, else windows of it that overlap by a sample.

use crate::gpu::layout::layers_per_chunk;
use crate::gpu::shader::Texel;
use crate::gpu::volume::{CHUNK, texture, write_layers};
use crate::gpu::{Gpu, GpuError};
use crate::volume::{Samples, ScalarType, Volume};
use crate::warp::Tet;

use super::WarpLimits;

/// How samples of a type lie in textures and in the values that come back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coding {
    pub texel: Texel,
    /// Bits of a sample that comes back; an `f64` comes as an `f32`.
    pub bits: u32,
    /// What whole numbers are cut to.
    pub range: [f32; 2],
}

impl Coding {
    pub fn of(t: ScalarType) -> Self {
        let (texel, bits, range) = match t {
            ScalarType::U8 => (Texel::Unsigned, 8, [0.0, 255.0]),
            ScalarType::I8 => (Texel::Signed, 8, [-128.0, 127.0]),
            ScalarType::U16 => (Texel::Unsigned, 16, [0.0, 65535.0]),
            ScalarType::I16 => (Texel::Signed, 16, [-32768.0, 32767.0]),
            // checked to be small enough for `f32`
            ScalarType::U32 => (Texel::Unsigned, 32, [0.0, 16_777_216.0]),
            ScalarType::I32 => (Texel::Signed, 32, [-16_777_216.0, 16_777_216.0]),
            ScalarType::F32 | ScalarType::F64 => (Texel::Float, 32, [0.0; 2]),
        };
        Self { texel, bits, range }
    }

    /// Voxels that fill whole words, and how many words.
    pub fn unit(&self, channels: usize) -> [u32; 2] {
        let bits = self.bits * channels as u32;
        // 8, 16 or 32 bits, times 1 to 4
        let voxels = [1, 2, 4].into_iter().find(|n| (bits * n).is_multiple_of(32)).unwrap_or(4);
        [voxels, voxels * bits / 32]
    }

    /// The texture format for so many channels, and how many it has: three are padded to four.
    fn format(&self, channels: usize) -> (wgpu::TextureFormat, usize) {
        use wgpu::TextureFormat as F;
        let formats = match (self.texel, self.bits) {
            (Texel::Unsigned, 8) => [F::R8Uint, F::Rg8Uint, F::Rgba8Uint],
            (Texel::Signed, 8) => [F::R8Sint, F::Rg8Sint, F::Rgba8Sint],
            (Texel::Unsigned, 16) => [F::R16Uint, F::Rg16Uint, F::Rgba16Uint],
            (Texel::Signed, 16) => [F::R16Sint, F::Rg16Sint, F::Rgba16Sint],
            (Texel::Unsigned, _) => [F::R32Uint, F::Rg32Uint, F::Rgba32Uint],
            (Texel::Signed, _) => [F::R32Sint, F::Rg32Sint, F::Rgba32Sint],
            (Texel::Float, _) => [F::R32Float, F::Rg32Float, F::Rgba32Float],
        };
        match channels {
            1 => (formats[0], 1),
            2 => (formats[1], 2),
            _ => (formats[2], 4),
        }
    }
}

/// Cells `first..end` of the input. Its texture has one sample more along each axis, where there is one.
#[derive(Debug)]
pub struct Window {
    pub first: [u32; 3],
    pub end: [u32; 3],
    view: Option<wgpu::TextureView>,
}

/// The input on its way to the device.
pub struct Input<'a> {
    volume: &'a Volume,
    coding: Coding,
    windows: Vec<Window>,
    /// Windows along each axis, and cells of all but the last of them.
    along: [usize; 3],
    step: [u32; 3],
    /// Windows on the device, the oldest first, and what they may have in all.
    resident: Vec<usize>,
    most: u64,
}

/// Cells of a window along each axis: within the limits, and as many as possible.
fn window_step(dims: [u32; 3], texel_bytes: u64, limits: &WarpLimits) -> [u32; 3] {
    let side = limits.texture_side.max(2);
    // all but the last window have a sample of the next one
    let cut = |n: u32, most: u32| if n <= most { n } else { most - 1 };
    let mut step = dims.map(|n| cut(n, side));
    let bytes = |step: [u32; 3]| (0..3).map(|a| u64::from((step[a] + 1).min(dims[a]))).product::<u64>() * texel_bytes;
    while bytes(step) > limits.texture_bytes && step.iter().any(|n| *n > 1) {
        // whole layers are written fastest
        let axis = if step[2] > 1 { 2 } else { usize::from(step[1] > 1) };
        step[axis] = step[axis].div_ceil(2);
    }
    step
}

impl<'a> Input<'a> {
    /// # Errors
    /// If the grid has more voxels along a side than can be counted.
    pub fn new(volume: &'a Volume, limits: &WarpLimits) -> Result<Self, GpuError> {
        let dims = crate::gpu::volume::texture_size(volume.grid.dims, 1 << 30)?;
        let coding = Coding::of(volume.samples.scalar_type());
        let (format, _) = coding.format(volume.channels);
        let step = window_step(dims, u64::from(format.block_copy_size(None).unwrap_or(16)), limits);
        let along: [usize; 3] = std::array::from_fn(|a| dims[a].div_ceil(step[a]) as usize);
        let windows = (0..along.iter().product()).map(|i| {
            let n = [i % along[0], i / along[0] % along[1], i / along[0] / along[1]];
            let first: [u32; 3] = std::array::from_fn(|a| n[a] as u32 * step[a]);
            let end = std::array::from_fn(|a| (first[a] + step[a]).min(dims[a]));
            Window { first, end, view: None }
        });
        let windows = windows.collect();
        Ok(Self { volume, coding, windows, along, step, resident: Vec::new(), most: limits.resident_bytes })
    }

    /// Numbers of the windows that tetrahedra come from; at least one.
    pub fn needed<'t>(&self, tets: impl Iterator<Item = &'t Tet>) -> Vec<usize> {
        if self.windows.len() == 1 {
            return vec![0];
        }
        let mut wanted = vec![false; self.windows.len()];
        for tet in tets {
            let range = |a: usize| {
                // a voxel more on both sides, for what rounds up or down
                let last = self.volume.grid.dims[a] as f64 - 1.0;
                let [lo, hi] = [tet.rest_bounds[0][a] - 1.0, tet.rest_bounds[1][a] + 1.0];
                let window = |p: f64| p.clamp(0.0, last) as usize / self.step[a] as usize;
                window(lo)..=window(hi)
            };
            for z in range(2) {
                for y in range(1) {
                    for x in range(0) {
                        wanted[(z * self.along[1] + y) * self.along[0] + x] = true;
                    }
                }
            }
        }
        let needed: Vec<_> = (0..wanted.len()).filter(|i| wanted[*i]).collect();
        if needed.is_empty() { vec![0] } else { needed }
    }

    pub fn window(&self, index: usize) -> &Window {
        &self.windows[index]
    }

    /// A window's texture; it is uploaded if it is not there, and others may go for it.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] if there is no room even for this one alone.
    pub fn view(&mut self, gpu: &Gpu, index: usize) -> Result<wgpu::TextureView, GpuError> {
        if let Some(view) = &self.windows[index].view {
            return Ok(view.clone());
        }
        let wanted = self.bytes(index);
        let mut held: u64 = self.resident.iter().map(|i| self.bytes(*i)).sum();
        while held + wanted > self.most && !self.resident.is_empty() {
            let oldest = self.resident.remove(0);
            held -= self.bytes(oldest);
            self.windows[oldest].view = None;
        }
        let texture = match self.upload(gpu, &self.windows[index]) {
            Err(GpuError::OutOfMemory { .. }) if !self.resident.is_empty() => {
                self.resident.drain(..).for_each(|i| self.windows[i].view = None);
                gpu.wait()?;
                self.upload(gpu, &self.windows[index])?
            }
            made => made?,
        };
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        self.windows[index].view = Some(view.clone());
        self.resident.push(index);
        Ok(view)
    }

    fn bytes(&self, window: usize) -> u64 {
        self.texels(&self.windows[window]).iter().map(|n| u64::from(*n)).product::<u64>() * self.texel_bytes()
    }

    fn texel_bytes(&self) -> u64 {
        let (format, _) = self.coding.format(self.volume.channels);
        u64::from(format.block_copy_size(None).unwrap_or(16))
    }

    /// Samples of a window's texture along each axis.
    fn texels(&self, window: &Window) -> [u32; 3] {
        std::array::from_fn(|a| (window.end[a] + 1).min(self.volume.grid.dims[a] as u32) - window.first[a])
    }

    fn upload(&self, gpu: &Gpu, window: &Window) -> Result<wgpu::Texture, GpuError> {
        let size = self.texels(window);
        let (format, lanes) = self.coding.format(self.volume.channels);
        let layer_bytes = u64::from(size[0]) * u64::from(size[1]) * self.texel_bytes();
        let texture = texture(gpu, "the volume", size, format, layer_bytes)?;
        let step = layers_per_chunk(layer_bytes, size[2], CHUNK);
        let [nx, ny, _] = self.volume.grid.dims;
        let channels = self.volume.channels;
        let sample = self.volume.samples.scalar_type().bytes();
        let narrow = self.volume.samples.scalar_type() == ScalarType::F64;
        let [fx, fy, fz] = window.first.map(|v| v as usize);
        for z in (0..size[2]).step_by(step as usize) {
            let depth = step.min(size[2] - z);
            let whole = [nx, ny] == [size[0] as usize, size[1] as usize];
            if whole && lanes == channels && !narrow {
                let layer = nx * ny * channels * sample;
                let range = (fz + z as usize) * layer..(fz + (z + depth) as usize) * layer;
                write_layers(gpu, &texture, z, depth, &self.volume.samples.bytes()[range])?;
                continue;
            }
            let mut bytes = Vec::with_capacity((layer_bytes * u64::from(depth)) as usize);
            for k in 0..depth as usize {
                for j in 0..size[1] as usize {
                    let row = ((fz + z as usize + k) * ny + fy + j) * nx + fx;
                    let range = row * channels..(row + size[0] as usize) * channels;
                    self.row(range, lanes, &mut bytes);
                }
            }
            write_layers(gpu, &texture, z, depth, &bytes)?;
        }
        Ok(texture)
    }

    /// Adds samples, padded to `lanes` a voxel.
    fn row(&self, range: std::ops::Range<usize>, lanes: usize, out: &mut Vec<u8>) {
        let channels = self.volume.channels;
        let floats: Vec<f32>;
        let (bytes, sample) = if let Samples::F64(v) = &self.volume.samples {
            floats = v[range].iter().map(|v| *v as f32).collect();
            (bytemuck::cast_slice(&floats), 4)
        } else {
            let sample = self.volume.samples.scalar_type().bytes();
            (&self.volume.samples.bytes()[range.start * sample..range.end * sample], sample)
        };
        if lanes == channels {
            out.extend_from_slice(bytes);
            return;
        }
        for voxel in bytes.chunks_exact(channels * sample) {
            out.extend_from_slice(voxel);
            out.resize(out.len() + (lanes - channels) * sample, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::Grid;
    use glam::DVec3;

    #[test]
    fn voxels_fill_whole_words() {
        for t in ScalarType::ALL {
            let coding = Coding::of(t);
            for channels in 1..=4 {
                let [voxels, words] = coding.unit(channels);
                assert_eq!(voxels * channels as u32 * coding.bits, words * 32, "{t:?} x{channels}");
                let (format, lanes) = coding.format(channels);
                assert_eq!(format.block_copy_size(None).unwrap() * 8, lanes as u32 * coding.bits);
                assert!(lanes >= channels && lanes <= 4);
            }
        }
        assert_eq!(Coding::of(ScalarType::U8).unit(1), [4, 1]);
        assert_eq!(Coding::of(ScalarType::U16).unit(3), [2, 3]);
    }

    #[test]
    fn windows_share_the_cells() {
        let dims = [20, 7, 33];
        let grid = Grid::aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap();
        let volume = Volume::new(grid, 1, Samples::U16(vec![0; grid.len()]));
        let all = WarpLimits::of(&wgpu::Limits::default());
        for (side, bytes, one) in [(2048, 1 << 20, true), (8, 1 << 20, false), (2048, 900, false), (2, 1, false)] {
            let limits = WarpLimits { texture_side: side, texture_bytes: bytes, ..all };
            let input = Input::new(&volume, &limits).unwrap();
            assert_eq!(input.windows.len() == 1, one);
            let mut seen = vec![0; grid.len()];
            for w in &input.windows {
                let texels = input.texels(w);
                assert!(texels.iter().all(|n| *n <= side));
                let size: u64 = texels.iter().map(|n| u64::from(*n)).product();
                assert!(size * 2 <= bytes.max(16));
                for z in w.first[2]..w.end[2] {
                    for y in w.first[1]..w.end[1] {
                        for x in w.first[0]..w.end[0] {
                            seen[(z as usize * dims[1] + y as usize) * dims[0] + x as usize] += 1;
                        }
                    }
                }
            }
            assert!(seen.iter().all(|n| *n == 1));
        }
    }
}

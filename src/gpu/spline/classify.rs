//! From an isovalue to lists of tetrahedra.

use super::Coefficients;
use super::size::{KINDS, Room, SCAN_CHUNK, blocks};
use crate::gpu::bind::{SAMPLES, buffer_type, compute_pipelines, group, group_layout};
use crate::gpu::layout::{SplineHead, SplineLevelUniform, workgroups};
use crate::gpu::volume::{CHUNK, texture, texture_size, write_layers};
use crate::gpu::{Gpu, GpuError, layout, shader};
use crate::math::parallel;
use crate::spline::Spline;

/// Pipelines of the classification.
#[derive(Debug)]
pub struct Classifier {
    group_layout: wgpu::BindGroupLayout,
    lists_layout: wgpu::BindGroupLayout,
    scan_layout: wgpu::BindGroupLayout,
    blocks: wgpu::ComputePipeline,
    list: wgpu::ComputePipeline,
    tets: wgpu::ComputePipeline,
    draws: wgpu::ComputePipeline,
    /// By where coefficients come from.
    emit: [wgpu::ComputePipeline; 3],
    /// Chunks are added up, their sums scanned, then each.
    scan: [wgpu::ComputePipeline; 3],
}

/// A spline on the device: what does not depend on the isovalue.
#[derive(Debug)]
pub struct Samples {
    pub dims: [usize; 3],
    pub view: wgpu::TextureView,
    /// The largest value on the faces of the domain.
    pub border: f32,
    ranges: wgpu::Buffer,
    blocks: [usize; 3],
    pub bytes: u64,
}

/// The lists of an isovalue.
#[derive(Debug)]
pub struct Lists {
    pub room: Room,
    uniform: wgpu::Buffer,
    head: wgpu::Buffer,
    /// Arguments of dispatches, and of draws.
    dispatch: wgpu::Buffer,
    pub draws: wgpu::Buffer,
    /// Where the tetrahedra of each kind begin, and how many there are.
    pub kinds: wgpu::Buffer,
    pub tets: wgpu::Buffer,
    pub store: wgpu::Buffer,
    /// How many numbers are scanned: blocks, and counts.
    block_count: wgpu::Buffer,
    tally_count: wgpu::Buffer,
    readback: wgpu::Buffer,
    group: wgpu::BindGroup,
    emit_group: wgpu::BindGroup,
    scan_blocks: wgpu::BindGroup,
    scan_tally: wgpu::BindGroup,
    pub bytes: u64,
}

const HEAD: u64 = size_of::<SplineHead>() as u64;
const DISPATCH: u64 = 32;
/// Of the numbers of the scan, what there should be room for, the lists of kinds, and the draws.
const NUMBERS: u64 = std::mem::offset_of!(SplineHead, numbers) as u64;
const WANTED: u64 = std::mem::offset_of!(SplineHead, wanted_blocks) as u64;
const WANTED_BYTES: u64 = 3 * 4;
const FIRST: u64 = std::mem::offset_of!(SplineHead, first) as u64;
const DRAWS: u64 = std::mem::offset_of!(SplineHead, draws) as u64;
/// Bytes of the arguments of a draw.
pub const DRAW: u64 = 20;

impl Classifier {
    /// # Errors
    /// [`GpuError::Refusal`].
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let stage = wgpu::ShaderStages::COMPUTE;
        let uniform = buffer_type(wgpu::BufferBindingType::Uniform);
        let [read, write] = [true, false].map(|read_only| buffer_type(wgpu::BufferBindingType::Storage { read_only }));
        let common = [uniform, SAMPLES, read, write, write, write, write, write];
        let own_layout = group_layout(gpu, "spline level", stage, &common);
        let lists_layout = group_layout(gpu, "spline lists", stage, &[write, write]);
        let scan_layout = group_layout(gpu, "spline scan", stage, &[write, write, read]);
        let [blocks, list, tets, draws] = compute_pipelines(
            gpu,
            &shader::spline_classify(),
            ["blocks_main", "list_main", "tets_main", "draws_main"],
            &[Some(&own_layout)],
        )?;
        let scan = compute_pipelines(
            gpu,
            shader::spline_scan(),
            ["reduce_main", "sums_main", "scan_main"],
            &[Some(&scan_layout)],
        )?;
        let emit = |coefficients| {
            let groups = [Some(&own_layout), Some(&lists_layout)];
            let [emit] = compute_pipelines(gpu, &shader::spline_emit(coefficients), ["emit_main"], &groups)?;
            Ok::<_, GpuError>(emit)
        };
        let [fly, stored, determining] = Coefficients::ALL.map(emit);
        let emit = [fly?, stored?, determining?];
        Ok(Self { group_layout: own_layout, lists_layout, scan_layout, blocks, list, tets, draws, emit, scan })
    }

    /// Records the classification of an isovalue, and the copy of what was wanted to the host.
    pub fn run(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, samples: &Samples, lists: &Lists, iso: f64) {
        let most = gpu.limits().max_compute_workgroups_per_dimension;
        let [nx, ny, nz] = samples.dims.map(|n| n as u32);
        let [bx, by, bz] = samples.blocks.map(|n| n as u32);
        let all = bx * by * bz;
        let upper = iso as f32;
        let uniform = SplineLevelUniform {
            dims: [nx, ny, nz, 0],
            blocks: [bx, by, bz, all],
            iso: [upper, (iso - f64::from(upper)) as f32, 0.0, 0.0],
            room: [lists.room.blocks, lists.room.tets, most, lists.room.most_cubes()],
        };
        gpu.queue.write_buffer(&lists.uniform, 0, bytemuck::bytes_of(&uniform));
        gpu.queue.write_buffer(&lists.block_count, 0, bytemuck::bytes_of(&all));
        let groups = workgroups(all, most);
        let chunks = u64::from(all).div_ceil(SCAN_CHUNK) as u32;
        {
            let mut pass = begin(encoder);
            pass.set_bind_group(0, &lists.group, &[]);
            pass.set_pipeline(&self.blocks);
            pass.dispatch_workgroups(groups[0], groups[1], 1);
            pass.set_bind_group(0, &lists.scan_blocks, &[]);
            for (pipeline, count) in self.scan.iter().zip([chunks, 1, chunks]) {
                pass.set_pipeline(pipeline);
                pass.dispatch_workgroups(count, 1, 1);
            }
            pass.set_bind_group(0, &lists.group, &[]);
            pass.set_pipeline(&self.list);
            pass.dispatch_workgroups(groups[0], groups[1], 1);
        }
        encoder.copy_buffer_to_buffer(&lists.head, 0, &lists.dispatch, 0, DISPATCH);
        encoder.copy_buffer_to_buffer(&lists.head, NUMBERS, &lists.tally_count, 0, 4);
        {
            let mut pass = begin(encoder);
            pass.set_bind_group(0, &lists.group, &[]);
            pass.set_pipeline(&self.tets);
            pass.dispatch_workgroups_indirect(&lists.dispatch, 0);
            pass.set_bind_group(0, &lists.scan_tally, &[]);
            pass.set_pipeline(&self.scan[0]);
            pass.dispatch_workgroups_indirect(&lists.dispatch, 16);
            pass.set_pipeline(&self.scan[1]);
            pass.dispatch_workgroups(1, 1, 1);
            pass.set_pipeline(&self.scan[2]);
            pass.dispatch_workgroups_indirect(&lists.dispatch, 16);
            pass.set_bind_group(0, &lists.group, &[]);
            pass.set_pipeline(&self.draws);
            pass.dispatch_workgroups(1, 1, 1);
            pass.set_bind_group(1, &lists.emit_group, &[]);
            pass.set_pipeline(&self.emit[lists.room.coefficients as usize]);
            pass.dispatch_workgroups_indirect(&lists.dispatch, 0);
        }
        encoder.copy_buffer_to_buffer(&lists.head, DRAWS, &lists.draws, 0, KINDS * DRAW);
        encoder.copy_buffer_to_buffer(&lists.head, FIRST, &lists.kinds, 0, 2 * KINDS * 4);
        encoder.copy_buffer_to_buffer(&lists.head, WANTED, &lists.readback, 0, WANTED_BYTES);
    }
}

fn begin(encoder: &mut wgpu::CommandEncoder) -> wgpu::ComputePass<'_> {
    encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("spline classify"), timestamp_writes: None })
}

impl Samples {
    /// # Errors
    /// [`GpuError::TooLarge`] or [`GpuError::OutOfMemory`].
    pub fn upload(gpu: &Gpu, spline: &Spline) -> Result<Self, GpuError> {
        let dims = spline.dims();
        let size = texture_size(dims.map(|n| n + 2), gpu.limits().max_texture_dimension_3d)?;
        let blocks = blocks(dims);
        // cubes are numbered by 32 bits
        let cubes = dims.iter().map(|n| *n as u64).product::<u64>();
        if cubes > u64::from(u32::MAX) {
            return Err(GpuError::TooLarge {
                what: "a volume",
                size: format!("{cubes} voxels"),
                limit: format!("{} voxels", u32::MAX),
            });
        }
        let values = spline.padded();
        let layer = size[0] as usize * size[1] as usize;
        let texture = texture(gpu, "the spline", size, wgpu::TextureFormat::R32Float, 4 * layer as u64)?;
        let step = layout::layers_per_chunk(4 * layer as u64, size[2], CHUNK);
        for z in (0..size[2]).step_by(step as usize) {
            let depth = step.min(size[2] - z);
            let range = z as usize * layer..(z + depth) as usize * layer;
            write_layers(gpu, &texture, z, depth, bytemuck::cast_slice(&values[range]))?;
        }
        let ranges = block_ranges(values, size.map(|n| n as usize), blocks);
        let bytes = (ranges.len() * 8) as u64;
        let ranges = filled(gpu, "spline ranges", bytemuck::cast_slice(&ranges))?;
        Ok(Self {
            dims,
            view: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            border: border(values, size.map(|n| n as usize)),
            ranges,
            blocks,
            bytes: bytes + 4 * values.len() as u64,
        })
    }

    /// Blocks of cubes.
    pub fn block_count(&self) -> u64 {
        self.blocks.iter().map(|n| *n as u64).product()
    }
}

/// Smallest and largest of the samples that the cubes of each block depend on.
fn block_ranges(values: &[f32], [width, height, depth]: [usize; 3], blocks: [usize; 3]) -> Vec<[f32; 2]> {
    let mut ranges = vec![[f32::INFINITY, f32::NEG_INFINITY]; blocks.iter().product()];
    parallel::chunks_mut(&mut ranges, blocks[0] * blocks[1], &|bk, plane| {
        for z in 4 * bk..(4 * bk + 6).min(depth) {
            for (bj, row) in plane.chunks_exact_mut(blocks[0]).enumerate() {
                for y in 4 * bj..(4 * bj + 6).min(height) {
                    let from = &values[(z * height + y) * width..][..width];
                    for (bi, range) in row.iter_mut().enumerate() {
                        for v in &from[4 * bi..(4 * bi + 6).min(width)] {
                            *range = [range[0].min(*v), range[1].max(*v)];
                        }
                    }
                }
            }
        }
    });
    ranges
}

/// The largest of the outermost samples.
fn border(values: &[f32], [width, height, depth]: [usize; 3]) -> f32 {
    let rows = values.chunks_exact(width).enumerate().map(|(n, row)| {
        let (j, k) = (n % height, n / height);
        if j == 0 || k == 0 || j + 1 == height || k + 1 == depth {
            row.iter().copied().fold(f32::NEG_INFINITY, f32::max)
        } else {
            row[0].max(row[width - 1])
        }
    });
    rows.fold(f32::NEG_INFINITY, f32::max)
}

fn empty(gpu: &Gpu, label: &'static str, size: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, GpuError> {
    gpu.allocate(label, size, || {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: size.next_multiple_of(4),
            usage,
            mapped_at_creation: false,
        })
    })
}

fn filled(gpu: &Gpu, label: &'static str, bytes: &[u8]) -> Result<wgpu::Buffer, GpuError> {
    use wgpu::BufferUsages as U;
    let limit = super::binding_limit(gpu);
    if bytes.len() as u64 > limit {
        return Err(GpuError::TooLarge {
            what: "a volume",
            size: format!("{} bytes of blocks", bytes.len()),
            limit: format!("{limit} bytes"),
        });
    }
    let buffer = empty(gpu, label, bytes.len() as u64, U::STORAGE | U::COPY_DST)?;
    gpu.queue.write_buffer(&buffer, 0, bytes);
    Ok(buffer)
}

impl Lists {
    /// # Errors
    /// [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, classifier: &Classifier, samples: &Samples, room: Room) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as U;
        let mut bytes = 0;
        let mut make = |label, size: u64, usage| {
            bytes += size;
            empty(gpu, label, size, usage)
        };
        let [list, masks, counts, tets, store] = room.bytes();
        let all = samples.block_count();
        let uniform = make("spline level", size_of::<SplineLevelUniform>() as u64, U::UNIFORM | U::COPY_DST)?;
        let head = make("spline head", HEAD, U::STORAGE | U::COPY_SRC)?;
        let dispatch = make("spline dispatches", DISPATCH, U::INDIRECT | U::COPY_DST)?;
        let draws = make("spline draws", KINDS * DRAW, U::INDIRECT | U::COPY_DST)?;
        let kinds = make("spline kinds", 2 * KINDS * 4, U::STORAGE | U::COPY_DST)?;
        let places = make("spline blocks", 4 * (all + 1), U::STORAGE)?;
        let list = make("spline blocks", list, U::STORAGE)?;
        let masks = make("spline masks", masks, U::STORAGE)?;
        let counts = make("spline counts", counts, U::STORAGE)?;
        let sums = make("spline sums", room.sums(all), U::STORAGE)?;
        let tets = make("spline tetrahedra", tets, U::STORAGE)?;
        let store = make("spline coefficients", store, U::STORAGE)?;
        let block_count = make("spline scan", 4, U::STORAGE | U::COPY_DST)?;
        let tally_count = make("spline scan", 4, U::STORAGE | U::COPY_DST)?;
        let readback = make("spline head", WANTED_BYTES, U::COPY_DST | U::MAP_READ)?;
        let view = wgpu::BindingResource::TextureView(&samples.view);
        let whole = wgpu::Buffer::as_entire_binding;
        let own = [
            whole(&uniform),
            view,
            whole(&samples.ranges),
            whole(&places),
            whole(&list),
            whole(&masks),
            whole(&counts),
            whole(&head),
        ];
        let scan = |numbers, count| {
            group(gpu, "spline scan", &classifier.scan_layout, &[whole(numbers), whole(&sums), whole(count)])
        };
        let made = Self {
            group: group(gpu, "spline level", &classifier.group_layout, &own),
            emit_group: group(gpu, "spline lists", &classifier.lists_layout, &[whole(&tets), whole(&store)]),
            scan_blocks: scan(&places, &block_count),
            scan_tally: scan(&counts, &tally_count),
            room,
            uniform,
            head,
            dispatch,
            draws,
            kinds,
            tets,
            store,
            block_count,
            tally_count,
            readback,
            bytes,
        };
        gpu.check()?;
        Ok(made)
    }

    /// Blocks, tetrahedra, and cubes with such, that the last classification wanted room for.
    ///
    /// # Errors
    /// What the device reported.
    pub fn wanted(&self, gpu: &Gpu) -> Result<[u32; 3], GpuError> {
        gpu.read(&self.readback, bytemuck::pod_read_unaligned)
    }
}

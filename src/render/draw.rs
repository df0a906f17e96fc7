use glam::DMat4;
use rayon::prelude::*;

use super::picture::srgb_code;
use super::raster::{Bins, project};
use super::sampler::{Sampler, Texel};
use super::shade::FINISHED;
use super::skip::Skip;
use super::tile::{HEIGHT, Scene, Tile, WIDTH};
use super::{ClassTable, Exact, Field, Frame, Picture, Second, SliceGeometry, TexelSlice};
use crate::math::lanes::Best;
use crate::volume::transfer::linear_from_srgb;

/// Whether the work is no longer wanted; asked now and then, from any thread.
pub type Stop<'a> = &'a (dyn Fn() -> bool + Sync);

/// Draws slices. With `exact`, the map is evaluated at every fragment and the vertices' texture coordinates are not used.
///
/// The slices must lie parallel to the view plane (those of another view are drawn with affine, not perspective,
/// interpolation). Triangles of one slice should not overlap; if they do, the later one lies in front.
pub fn render(
    geometry: &SliceGeometry,
    field: &Field,
    table: &ClassTable,
    frame: &Frame,
    exact: Option<Exact<'_>>,
) -> Picture {
    render_until(geometry, field, table, frame, exact, &|| false)
        .map_or_else(|| Picture::filled(frame.size[0], frame.size[1], [0; 4]), |(picture, _)| picture)
}

/// As [`render`], and how many fragments were shaded (those behind opaque ones and where nothing can be seen are not). Given
/// up soon after `stop` says so: then there is no picture.
pub fn render_until(
    geometry: &SliceGeometry,
    field: &Field,
    table: &ClassTable,
    frame: &Frame,
    exact: Option<Exact<'_>>,
    stop: Stop<'_>,
) -> Option<(Picture, u64)> {
    match (field.texels.slice(), field.channels) {
        (TexelSlice::U8(t), 4) => draw::<u8, 4>(t, geometry, field, table, frame, exact, stop),
        (TexelSlice::U8(t), _) => draw::<u8, 1>(t, geometry, field, table, frame, exact, stop),
        (TexelSlice::U16(t), 4) => draw::<u16, 4>(t, geometry, field, table, frame, exact, stop),
        (TexelSlice::U16(t), _) => draw::<u16, 1>(t, geometry, field, table, frame, exact, stop),
        (TexelSlice::F32(t), 4) => draw::<f32, 4>(t, geometry, field, table, frame, exact, stop),
        (TexelSlice::F32(t), _) => draw::<f32, 1>(t, geometry, field, table, frame, exact, stop),
    }
}

fn draw<T: Texel, const C: usize>(
    texels: &[T],
    geometry: &SliceGeometry,
    field: &Field,
    table: &ClassTable,
    frame: &Frame,
    exact: Option<Exact<'_>>,
    stop: Stop<'_>,
) -> Option<(Picture, u64)> {
    let [width, height, mode, _] = frame.size;
    let mut picture = Picture::filled(width, height, [0; 4]);
    let corners = project(geometry, frame);
    let bins = Bins::new(geometry, &corners, frame, [WIDTH, HEIGHT]);
    let clip = DMat4::from_cols_array_2d(&frame.clip_from_local.map(|c| c.map(f64::from)));
    let h = frame.light[3];
    let texels = Sampler::<T, C>::memory(field, texels);
    let scene = Scene {
        geometry,
        corners: &corners,
        sampler: Sampler::<T, C>::new(field, &texels, frame),
        table,
        skip: Skip::new(field, table, frame),
        frame,
        exact,
        back: mode == Frame::ISO || (mode == Frame::VOLUME && table.second == Second::Behind),
        per_voxel: [0, 1, 2].map(|a: usize| 0.5 * frame.dims[a] * h),
        local_from_clip: clip.inverse(),
        best: Best::new(),
    };
    let across = (width as usize).div_ceil(WIDTH);
    let down = (height as usize).div_ceil(HEIGHT);
    type Rows = Vec<(usize, Vec<[u8; 4]>)>;
    let tiles: Vec<(Rows, u64)> = (0..across * down)
        .into_par_iter()
        .with_max_len(1)
        .map_init(Tile::new, |tile, i| {
            if stop() {
                return (Rows::new(), 0);
            }
            tile.start(&scene, i % across, i / across);
            for t in bins.front_to_back(i) {
                if tile.is_done() {
                    break;
                }
                tile.draw(&scene, t);
            }
            tile.shade(&scene);
            let rows = tile.rows().map(|(y, x, sums)| (y * width as usize + x, finish(sums, y, frame))).collect();
            (rows, tile.fragments)
        })
        .collect();
    if stop() {
        return None;
    }
    let mut fragments = 0;
    for (rows, shaded) in tiles {
        fragments += shaded;
        for (at, row) in rows {
            picture.pixels[at..at + row.len()].copy_from_slice(&row);
        }
    }
    Some((picture, fragments))
}

/// Puts sums of row `y` over the background and encodes them.
fn finish(sums: impl Iterator<Item = [f32; 4]>, y: usize, frame: &Frame) -> Vec<[u8; 4]> {
    let [top, bottom] = frame.background;
    let t = (y as f32 + 0.5) / frame.size[1] as f32;
    let ground = [0, 1, 2].map(|c: usize| linear_from_srgb(top[c] + t * (bottom[c] - top[c])));
    let transparent = frame.has(Frame::TRANSPARENT);
    let ground_code = if transparent { [0; 4] } else { coded(ground, 255) };
    let pixel = |[r, g, b, a]: [f32; 4]| {
        if a <= 0.0 {
            ground_code
        } else if frame.size[2] == Frame::MIP {
            let grey = (r * 255.0 + 0.5) as u8;
            [grey, grey, grey, 255]
        } else if a > 1.0 - FINISHED {
            coded([r / a, g / a, b / a], 255)
        } else if transparent {
            coded([r / a, g / a, b / a], (a.min(1.0) * 255.0 + 0.5) as u8)
        } else {
            let through = (1.0 - a).max(0.0);
            coded([r + through * ground[0], g + through * ground[1], b + through * ground[2]], 255)
        }
    };
    sums.map(pixel).collect()
}

fn coded(rgb: [f32; 3], alpha: u8) -> [u8; 4] {
    let [r, g, b] = rgb.map(srgb_code);
    [r, g, b, alpha]
}

//! Opacity by value and steepness: what analysis says, in pictures, under the pointer, in the joint histogram and in files.

use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DVec2, DVec3};
use voxclay::evaluate::load::{Data, Workspace};
use voxclay::evaluate::pick::{Probe, Ray};
use voxclay::io;
use voxclay::render::{Camera, ClassTable, Field, Frame, Look, Projection, render};
use voxclay::scene::{Document, Edit, History, VolumeSource};
use voxclay::volume::joint::{ROWS, joint};
use voxclay::volume::transfer::{ControlPoint, Region, TransferFunction, Window, height_of};
use voxclay::volume::{Grid, Samples, Space, Volume};

#[path = "render/slices.rs"]
mod slices;
use slices::box_slices;

const N: usize = 64;
/// Voxels of the two slopes: both have the same values.
const GENTLE: usize = 32;
const STEEP: usize = 8;

/// Along x up a gentle slope from 0 to 1, down a steep one, then 0.
fn hill(x: usize) -> f32 {
    let up = x as f32 / GENTLE as f32;
    let down = (GENTLE + STEEP) as f32 - x as f32;
    up.min(down / STEEP as f32).clamp(0.0, 1.0)
}

fn volume() -> Volume {
    let grid = Grid::new([N, 16, 16], DAffine3::IDENTITY, Space::Unknown).unwrap();
    Volume::new(grid, 1, Samples::F32((0..grid.len()).map(|i| hill(i % N)).collect()))
}

/// Everything of a steepness between the two slopes' and above.
fn steep_ones(opacity: f32) -> TransferFunction {
    TransferFunction {
        name: "steep".into(),
        window: Window::Auto,
        points: vec![ControlPoint { at: 0.0, color: [1.0; 3], opacity: 0.9 }],
        regions: vec![Region {
            value: [0.0, 1.0],
            steepness: [0.06, 1.0],
            foot: 1.0,
            soft: 0.0,
            opacity,
            color: Some([0.0, 1.0, 0.0]),
        }],
    }
}

/// Looks along y.
fn frontal(grid: &Grid) -> Camera {
    Camera {
        target: grid.center(),
        yaw: 0.0,
        pitch: 0.0,
        roll: 0.0,
        radius: 32.0,
        zoom: 1.0,
        projection: Projection::Orthographic,
    }
}

#[test]
fn only_the_steep_slope_is_seen_and_as_opaque_as_it_is_thick() {
    let field = Field::from_volume(Arc::new(volume()));
    let camera = frontal(&field.grid);
    let look = Look { lit: false, transparent: true, ..Look::default() };
    for (opacity, distance) in [(0.05f32, 1.0), (0.1, 0.5), (0.03, 2.0)] {
        let geometry = box_slices(&field.grid, &camera, distance, 0);
        let frame = Frame::new(&camera, &look, &field, [0.0, 1.0], &geometry, N as u32, N as u32);
        let table = ClassTable::build(&steep_ones(opacity), distance, look.preintegrated);
        let picture = render(&geometry, &field, &table, &frame, None);
        let row = &picture.pixels[N / 2 * N..][..N];
        // sixteen voxels deep
        let want = (1.0 - (1.0 - opacity).powi(16)) * 255.0;
        for (x, pixel) in row.iter().enumerate() {
            // at the ends of slopes differences are of both sides
            if x + 2 < GENTLE || (GENTLE + STEEP + 2..N).contains(&x) {
                assert_eq!(*pixel, [0; 4], "{x}");
            } else if (GENTLE + 2..GENTLE + STEEP - 2).contains(&x) {
                assert!((f32::from(pixel[3]) - want).abs() <= 1.0, "{x}: {pixel:?}, not {want}");
                assert_eq!(pixel[..3], [0, 255, 0]);
            }
        }
    }
}

#[test]
fn the_pointer_takes_hold_of_what_is_seen() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("hill.nrrd");
    io::write_volume(&path, &volume(), &io::WriteOptions::default()).unwrap();
    let source = VolumeSource::File(path);
    let data = Arc::new(Data::read(&source, Path::new("")).unwrap());
    let mut document = Document::new(source.clone());
    document.transfer_function = Some(steep_ones(0.3));
    let object = Workspace::with_data(Path::new(""), source, data).object(&document).unwrap();
    let probe = Probe::new(&object).seeing(&Look::default());
    let camera = frontal(&object.volume.grid);
    let hit = |x: usize| {
        let ray = Ray::through(&camera, (N as u32, N as u32), DVec2::new(x as f64 + 0.5, N as f64 / 2.0));
        probe.first(&ray, Look::default().shading)
    };
    for x in [4, GENTLE / 2, GENTLE - 3, GENTLE + STEEP + 3, N - 4] {
        assert_eq!(hit(x), None, "{x}");
    }
    for x in GENTLE + 2..GENTLE + STEEP - 2 {
        let hit = hit(x).unwrap();
        // 0.3 of a voxel: half of the light is gone after two
        assert!((hit.point - DVec3::new(x as f64, 1.5, 7.5)).length() < 1.5, "{x}: {:?}", hit.point);
    }
}

#[test]
fn the_joint_histogram_has_two_slopes_and_what_is_flat() {
    let volume = volume();
    let made = joint(&volume, 0, [0.0, 1.0]);
    let columns = made.counts.len() / ROWS;
    assert_eq!(made.counts.iter().sum::<u64>(), volume.grid.len() as u64);
    let row = |steepness: f32| ((height_of(steepness) * ROWS as f32) as usize).min(ROWS - 1);
    let sum = |row: usize| made.counts[row * columns..][..columns].iter().sum::<u64>();
    // 16 by 16 voxels of each kind, but for ends, feet and the top, where differences are of both sides
    let square = 256;
    let count = |from: usize, to: usize| (to - from) as u64 * square;
    assert_eq!(sum(row(1.0 / GENTLE as f32)), count(1, GENTLE));
    assert_eq!(sum(row(1.0 / STEEP as f32)), count(GENTLE + 1, GENTLE + STEEP));
    assert_eq!(sum(0), count(GENTLE + STEEP + 1, N));
    // a value in the middle lies on both slopes
    let middle = columns / 2;
    for steepness in [1.0 / GENTLE as f32, 1.0 / STEEP as f32] {
        let near = &made.counts[row(steepness) * columns..][middle - 4..middle + 4];
        assert_eq!(near.iter().sum::<u64>(), square, "{steepness}");
    }
    // twice the range: everything is half as steep, in the lower half of the columns
    let wide = joint(&volume, 0, [0.0, 2.0]);
    let sum = |row: usize| wide.counts[row * columns..][..columns / 2 + 1].iter().sum::<u64>();
    assert_eq!(sum(row(0.5 / STEEP as f32)), count(GENTLE + 1, GENTLE + STEEP));
}

#[test]
fn regions_are_kept_in_text_in_projects_and_in_steps() {
    let mut function = steep_ones(0.25);
    function.window = Window::Values { lo: -1000.0, hi: 3000.0 };
    function.regions[0].value = [0.25, 0.3];
    function.regions.push(Region { color: None, soft: 0.7, ..function.regions[0] });
    let text = function.to_string();
    assert!(text.contains("region 0 200  0.06 1  1 0  0.25  0 1 0\nregion 0 200  0.06 1  1 0.7  0.25\n"), "{text}");
    assert_eq!(TransferFunction::parse(&text), Ok(function.clone()));
    // as it was before there were regions
    let before = TransferFunction { regions: vec![], ..function.clone() };
    assert!(!before.to_string().contains("region"));

    let mut history = History::new(Document::new(VolumeSource::Phantom { name: "head".into(), size: 32 }), 1 << 20);
    history.apply(Edit::SetTransferFunction(function.clone())).unwrap();
    let saved = serde_json::to_string(&**history.document()).unwrap();
    let back: Document = serde_json::from_str(&saved).unwrap();
    assert_eq!(back.transfer_function, Some(function.clone()));
    assert!(history.undo() && history.document().transfer_function.is_none());

    let mut wrong = function.clone();
    wrong.regions[1].steepness = [0.5, 0.5];
    assert!(history.apply(Edit::SetTransferFunction(wrong)).is_err());
    for (line, says) in [
        ("region 0 200 0.06 1 1 0", "has 6 numbers"),
        ("region 200 0 0.06 1 1 0 0.5", "the lower value"),
        ("region 0 200 0.06 1.5 1 0 0.5", "steepness"),
        ("region 0 9000 0.06 1 1 0 0.5", "outside the window"),
    ] {
        let text = format!("voxclay transfer function 1\nwindow -1000 3000\n0 1 1 1 0.5\n{line}\n");
        let error = TransferFunction::parse(&text).unwrap_err().to_string();
        assert!(error.starts_with("line 4: ") && error.contains(says), "{error}");
    }
}

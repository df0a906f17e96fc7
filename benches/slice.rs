//! Contours, nesting and tessellation of 200 planes, median and minimum in milliseconds:
//! `cargo bench --bench slice -- [MESH ...]`, by default shapes of about 5000 and 100000 triangles, and a box.

use std::path::Path;
use std::time::Instant;

use glam::DVec3;
use voxclay::evaluate::geometry::outlines;
use voxclay::io::read_surface;
use voxclay::math::PlaneFrame;
use voxclay::mesh::{Topology, TriMesh, primitives};
use voxclay::slice::{Planes, Slicer};
use voxclay::tessellate::{Limits, Method, Tessellator};

const PLANES: usize = 200;

fn shapes() -> Vec<(String, TriMesh)> {
    let mut shapes = vec![("box 12".into(), primitives::aligned_box(DVec3::ZERO, DVec3::ONE))];
    for n in [5_000, 100_000] {
        let f = primitives::frequency_for(n);
        shapes.push((format!("bumpy {n}"), primitives::bumpy_sphere(f)));
        shapes.push((format!("cavity {n}"), primitives::cavity_sphere(f)));
        let around = (n as f64).sqrt() as u32;
        shapes.push((format!("torus {n}"), primitives::torus(1.0, 0.4, around, around / 2)));
    }
    shapes
}

/// Median and minimum.
fn summary(mut times: Vec<f64>) -> String {
    times.sort_by(f64::total_cmp);
    format!("{:7.2} {:7.2}", times[times.len() / 2], times[0])
}

fn time<T>(list: &mut Vec<f64>, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    list.push(start.elapsed().as_secs_f64() * 1e3);
    result
}

fn main() {
    let files: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let shapes = if files.is_empty() {
        shapes()
    } else {
        files.iter().map(|f| (f.clone(), read_surface(Path::new(f)).expect("a surface"))).collect()
    };
    println!("{} threads; median and minimum in ms; contours: slabs and walk", rayon::current_num_threads());
    println!(
        "{:14} {:>8} {:>8} {:>15} {:>15} {:>15} {:>15} {:>15} {:>15}",
        "mesh", "points", "holes", "edge list", "contours", "nesting", "sweep", "lyon", "spade"
    );
    for (name, mesh) in shapes {
        let frame = PlaneFrame::across(DVec3::new(0.31, 0.52, 0.80)).expect("a direction");
        let planes = Planes::across(frame, &mesh.positions, PLANES);
        let mut slicer = Slicer::default();
        let [mut edges, mut contours, mut nesting] = [(); 3].map(|()| Vec::new());
        let mut fill = [(); 3].map(|()| Vec::new());
        let methods = [Method::Fast, Method::Lyon, Method::Quality(Limits::default())];
        let mut tessellators = methods.map(|_| Tessellator::default());
        for round in 0..31 {
            let topology = time(&mut edges, || Topology::build(mesh.positions.len(), &mesh.triangles));
            for _ in 0..3 {
                time(&mut contours, || {
                    slicer.index.build(&mesh.positions, &topology, &planes).expect("not too many points");
                    slicer.index.contours(&mut slicer.slices);
                });
                time(&mut nesting, || slicer.slices.nest());
                time(&mut fill[0], || tessellators[0].run(&outlines(&slicer.slices), methods[0]).triangles.len());
            }
            if round < 9 {
                time(&mut fill[1], || tessellators[1].run(&outlines(&slicer.slices), methods[1]).triangles.len());
            }
            if round < 3 {
                time(&mut fill[2], || tessellators[2].run(&outlines(&slicer.slices), methods[2]).triangles.len());
            }
        }
        let s = &slicer.slices;
        let area: f64 = (0..PLANES).map(|k| s.plane_area(k)).sum();
        let holes: usize = (0..PLANES).map(|k| s.plane_counts(k).1).sum();
        let name = Path::new(&name).file_stem().map_or(name.clone(), |n| n.to_string_lossy().into_owned());
        let [sweep, lyon, spade] = fill.map(summary);
        println!(
            "{name:14} {:8} {holes:8} {} {} {} {sweep} {lyon} {spade}",
            s.points.len(),
            summary(edges),
            summary(contours),
            summary(nesting)
        );
        for (t, method) in tessellators.iter().zip(methods) {
            let of_triangles: f64 = (0..PLANES).map(|k| t.result().plane_area(&outlines(s), k)).sum();
            assert!((of_triangles / area - 1.0).abs() < 1e-9, "{name} {method:?}: {of_triangles} of {area}");
        }
        s.warnings().for_each(|w| println!("  {}", w.sentence(&planes)));
    }
}

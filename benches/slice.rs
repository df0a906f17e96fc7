//! Contours, nesting and tessellation of 200 planes: `cargo bench --bench slice -- [MESH.obj ...] [--repeat R]`.
use std::time::Instant;

use glam::DVec3;
use voxclay::math::PlaneFrame;
use voxclay::mesh::{Topology, TriMesh};
use voxclay::slice::{Planes, SlabIndex, Slices};
use voxclay::tessellate::{Limits, Method, Outlines, Tessellator};

fn read_obj(path: &str) -> TriMesh {
    let text = std::fs::read_to_string(path).expect("the OBJ file is readable");
    let mut mesh = TriMesh::default();
    for line in text.lines() {
        let mut w = line.split_whitespace();
        match w.next() {
            Some("v") => {
                let v: Vec<f64> = w.map(|x| x.parse().expect("a number")).collect();
                mesh.positions.push(DVec3::new(v[0], v[1], v[2]));
            }
            Some("f") => {
                let i: Vec<u32> =
                    w.map(|x| x.split('/').next().expect("an index").parse::<u32>().expect("an index") - 1).collect();
                mesh.triangles.push([i[0], i[1], i[2]]);
            }
            _ => {}
        }
    }
    mesh
}

fn outlines(s: &Slices) -> Outlines<'_> {
    Outlines {
        points: &s.points,
        loop_start: &s.loop_start,
        plane_start: &s.plane_start,
        area: &s.area,
        owner: &s.owner,
    }
}

fn median(times: &mut [f64]) -> (f64, f64) {
    times.sort_by(f64::total_cmp);
    (times[times.len() / 2], times[0])
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let repeat = 51;
    for path in args.iter().filter(|a| a.ends_with(".obj")) {
        let mesh = read_obj(path);
        let topology = Topology::build(mesh.positions.len(), &mesh.triangles);
        let frame = PlaneFrame::across(DVec3::new(0.31, 0.52, 0.80)).expect("a direction");
        let planes = Planes::across(frame, &mesh.positions, 200);
        let (mut index, mut slices) = (SlabIndex::default(), Slices::default());
        let (mut build, mut walk, mut nest) = (vec![], vec![], vec![]);
        for _ in 0..repeat {
            let t = Instant::now();
            index.build(&mesh.positions, &topology, &planes).expect("not too many points");
            build.push(t.elapsed().as_secs_f64() * 1e3);
            let t = Instant::now();
            index.contours(&mut slices);
            walk.push(t.elapsed().as_secs_f64() * 1e3);
            let t = Instant::now();
            slices.nest();
            nest.push(t.elapsed().as_secs_f64() * 1e3);
        }
        let outlines = outlines(&slices);
        let contours: f64 = (0..200).map(|k| slices.plane_area(k)).sum();
        for (name, method) in
            [("fast", Method::Fast), ("lyon", Method::Lyon), ("spade", Method::Quality(Limits::default()))]
        {
            let mut tessellator = Tessellator::default();
            let mut times = vec![];
            for _ in 0..if name == "fast" { repeat } else { repeat / 4 } {
                let t = Instant::now();
                tessellator.run(&outlines, method);
                times.push(t.elapsed().as_secs_f64() * 1e3);
            }
            let r = tessellator.result();
            let area: f64 = (0..200).map(|k| r.plane_area(&outlines, k)).sum();
            println!(
                "  {name} {:.3?} ms, {} triangles, {:?}, area off by {:.1e}",
                median(&mut times),
                r.triangles.len(),
                r.made_by,
                area / contours - 1.0
            );
        }
        let area: f64 = (0..200).map(|k| slices.plane_area(k)).sum();
        let (o, h) = (0..200).map(|k| slices.plane_counts(k)).fold((0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        println!(
            "{path}: points {} loops {} outer {o} holes {h} area {area:.12} volume {:.6}/{:.6}",
            slices.points.len(),
            slices.loops(),
            area * planes.step,
            mesh.volume()
        );
        println!(
            "  build {:.3?} walk {:.3?} nest {:.3?} (median, min)",
            median(&mut build),
            median(&mut walk),
            median(&mut nest)
        );
        slices.warnings().for_each(|w| println!("  {}", w.sentence(&planes)));
    }
}

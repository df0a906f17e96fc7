use glam::DVec3;
use std::path::Path;
use std::time::Instant;
use voxclay::deform::{Deformation, Deformer, DisplacementVolume};
use voxclay::evaluate::geometry::{GeometryOptions, Keeper, Refinement};
use voxclay::evaluate::load::load;
use voxclay::scene::{Document, ProxySource, VolumeSource};
fn faults() -> u64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    s.rsplit(')').next().unwrap().split_whitespace().nth(7).unwrap().parse().unwrap()
}
fn main() {
    let mut d = Document::new(VolumeSource::Phantom { name: "head".into(), size: 256 });
    d.proxy = ProxySource::Auto { iso: None };
    let mut o = load(&d, Path::new(".")).unwrap();
    let (center, radius) = o.focus;
    let items: Vec<_> = (0..10)
        .filter_map(|i| {
            let a = f64::from(i) * 0.628;
            let at = center + radius * DVec3::new(0.5 * a.cos(), 0.5 * a.sin(), 0.4 - 0.08 * f64::from(i));
            let pull = radius * 0.08 * DVec3::new(a.sin(), a.cos(), 0.5);
            DisplacementVolume::from_drag(at, pull, 0.3 * radius).ok()
        })
        .map(|d| Deformation::new("", Deformer::Displacement(d)))
        .collect();
    o.stack.items = items;
    let camera = o.camera(&d.camera);
    let options =
        GeometryOptions { slices: Some(66), refinement: Refinement::Draft, subdivide: true, size: (196, 160) };
    let mut keeper = Keeper::default();
    let start = center + camera.to_eye() * radius * 0.6;
    let mut times = Vec::new();
    let mut f0 = 0;
    o.stack.items.push(o.stack.items[0].clone());
    for e in 0..300 {
        let a = f64::from(e) * 0.05;
        let pull = 0.25 * radius * DVec3::new(a.sin(), 0.3, 1.0 - a.cos());
        if let Ok(v) = DisplacementVolume::from_drag(start, pull + DVec3::splat(1e-3), 0.25 * radius) {
            *o.stack.items.last_mut().unwrap() = Deformation::new("", Deformer::Displacement(v));
        }
        let t = Instant::now();
        let (g, _) = keeper.slices(&o, &camera, &options).unwrap();
        times.push(t.elapsed().as_secs_f64() * 1e3);
        if e == 10 {
            f0 = faults();
        }
        if e == 299 {
            println!("{} vertices {} triangles, {} slices", g.vertices.len(), g.indices.len() / 3, g.slices.len());
        }
    }
    println!("faults an event {}", (faults() - f0) / 289);
    times.sort_by(f64::total_cmp);
    println!("median {:.2} 95 {:.2} min {:.2}", times[150], times[285], times[0]);
}

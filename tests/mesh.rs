//! Checks of surface meshes: shapes with a known answer, every kind of defect, and the real meshes.

use std::path::Path;

use voxclay::io::{read_surface, read_surface_as_stored};
use voxclay::mesh::check::MeshReport;

#[test]
#[cfg_attr(not(shared_data), ignore = "needs ../shared/data")]
fn real_meshes_are_what_their_readme_says() {
    for f in [
        "spot.obj",
        "bunny.obj",
        "armadillo.obj",
        "torus.stl",
        "three_holes.obj",
        "fixed_top.ply",
        "two_balls.obj",
        "pelvis_f.obj",
        "dirty_bunny_open.ply",
        "dirty_two_spheres.obj",
        "dirty_sphere_with_hole.stl",
        "dirty_brain_mni152.obj",
    ] {
        let m = read_surface_as_stored(&Path::new("../shared/data/meshes").join(f)).unwrap();
        let t = std::time::Instant::now();
        let r = MeshReport::of(&m);
        println!("{f} {:?}\n{r:?}", t.elapsed());
        for d in r.defects() {
            println!("   {d}");
        }
    }
}

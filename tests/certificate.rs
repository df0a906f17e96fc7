//! Certificates: what is sound passes, and every planted fault is found and counted.

use glam::DVec3;
use voxclay::deform::{Deformation, Deformer, DisplacementVolume, Extent, Prepared, Stack};
use voxclay::evaluate::certificate::{Certificate, CertificateError, Subject, TetField, of_map, of_tets};
use voxclay::evaluate::export::{ExportOptions, GridChoice, Precision, export, output_grid, stored_outside, unwatched};
use voxclay::evaluate::picture::Refinement;
use voxclay::evaluate::tets::Lattice;
use voxclay::math::BackwardMap;
use voxclay::mesh::tets::{TetMesh, signed_volume};
use voxclay::volume::sampling::Interpolation;
use voxclay::volume::{Grid, Samples, Scalar, Volume};
use voxclay::warp::{Warp, WarpOptions};

fn grid() -> Grid {
    Grid::aligned([36, 32, 28], DVec3::new(1.0, 1.1, 1.3), DVec3::new(-5.0, 3.0, 2.0)).unwrap()
}

fn filled<T: Scalar>(value: impl Fn(DVec3) -> f64) -> Volume {
    let grid = grid();
    let [nx, ny, nz] = grid.dims;
    let voxel = |i: usize| DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
    let samples = (0..nx * ny * nz).map(|i| T::from_f64(value(voxel(i)))).collect();
    Volume::new(grid, 1, T::wrap(samples))
}

/// A soft ball in nothing.
fn ball() -> Volume {
    filled::<i16>(|p| 1000.0 * (-(p - DVec3::new(17.5, 15.5, 13.5)).length_squared() / 60.0).exp())
}

/// Layers of four labels, multiples of `step`; neighbours are not those that follow each other.
fn labels(step: f64) -> Volume {
    filled::<u8>(|p| step * [0.0, 3.0, 1.0, 2.0, 0.0][((p.x + 0.4 * p.y) / 10.0) as usize])
}

fn stroke(vector: DVec3, wide: f64) -> Prepared {
    let extent = Extent { u: wide, v: wide, length: 3.0 * wide };
    let d = DisplacementVolume::new(grid().center(), vector, extent, None).unwrap();
    Stack { items: vec![Deformation::new("", Deformer::Displacement(d))] }.prepared()
}

fn pull() -> Prepared {
    let map = stroke(DVec3::new(4.0, 1.0, -2.0), 14.0);
    assert!(map.supports()[0].half.max_element() > 10.0);
    map
}

fn by(interpolation: Interpolation) -> ExportOptions {
    ExportOptions { interpolation, ..ExportOptions::default() }
}

fn subject<'a>(input: &'a Volume, output: &'a Volume, options: &ExportOptions) -> Subject<'a> {
    let outside = stored_outside(input, options.outside);
    Subject { input, output, interpolation: options.interpolation, outside, density: false }
}

fn mapped(input: &Volume, map: &Prepared, options: &ExportOptions) -> (Volume, Certificate) {
    let (output, report) = export(input, map, options, &unwatched).unwrap();
    let certificate = of_map(&subject(input, &output, options), map).unwrap();
    assert_eq!(certificate.material_clipped, report.clipped);
    assert!((certificate.mass.after - report.mass_after).abs() <= 1e-9 * report.mass_after.abs());
    (output, certificate)
}

/// A lattice in two states, which faults are planted into.
#[derive(Clone)]
struct Mesh {
    tets: Vec<[u32; 4]>,
    rest: Vec<DVec3>,
    deformed: Vec<DVec3>,
}

impl Mesh {
    fn of(map: &Prepared, input: &Grid, output: &Grid, tolerance: f64) -> Self {
        let lattice = Lattice::of(map, input, output, Refinement::Tolerance(tolerance)).unwrap();
        assert!(lattice.report.converged);
        Self { deformed: lattice.deformed().to_vec(), tets: lattice.mesh.tets, rest: lattice.mesh.points }
    }

    fn field(&self, fills: bool) -> TetField<'_> {
        TetField { tets: &self.tets, rest: &self.rest, deformed: &self.deformed, fills, exact: None }
    }

    fn warped(&self, input: &Volume, output: &Grid, options: &WarpOptions) -> Volume {
        let warp = Warp::new(&input.grid, output, &self.tets, &self.rest, &self.deformed).unwrap();
        warp.volume(input, output, options).unwrap().0
    }

    /// The certificate of a plain linear warp.
    fn certified(&self, fills: bool) -> Certificate {
        let input = ball();
        let output = self.warped(&input, &grid(), &WarpOptions::default());
        of_tets(&subject(&input, &output, &ExportOptions::default()), &self.field(fills)).unwrap()
    }

    /// A tetrahedron near the middle that holds many voxels.
    fn middle(&self) -> usize {
        let center = grid().center();
        let near = |t: &usize| {
            let p = TetMesh::corners(self.tets[*t], &self.deformed);
            (0.25 * (p[0] + p[1] + p[2] + p[3])).distance(center) < 8.0
        };
        let volume = |t: &usize| signed_volume(TetMesh::corners(self.tets[*t], &self.deformed));
        (0..self.tets.len()).filter(near).max_by(|a, b| volume(a).total_cmp(&volume(b))).unwrap()
    }

    /// Voxels strictly inside a tetrahedron, by its definition.
    fn voxels(&self, tet: usize) -> u64 {
        let [a, b, c, d] = TetMesh::corners(self.tets[tet], &self.deformed);
        let all = signed_volume([a, b, c, d]);
        let g = grid();
        let mut count = 0;
        for k in 0..g.dims[2] {
            for j in 0..g.dims[1] {
                for i in 0..g.dims[0] {
                    let p = g.world_from_voxel.transform_point3(DVec3::new(i as f64, j as f64, k as f64));
                    let parts = [[p, b, c, d], [a, p, c, d], [a, b, p, d], [a, b, c, p]].map(signed_volume);
                    count += u64::from(parts.iter().all(|v| v / all > 1e-7));
                }
            }
        }
        count
    }
}

/// A coarse one, with some voxels in each tetrahedron.
fn lattice() -> Mesh {
    Mesh::of(&pull(), &grid(), &grid(), 0.6)
}

fn says(certificate: &Certificate, words: &str) {
    assert!(!certificate.sound && certificate.faults.iter().any(|f| f.contains(words)), "{:?}", certificate.faults);
}

#[test]
fn what_is_sound_passes_with_its_facts() {
    let (input, map) = (ball(), pull());
    for precision in [Precision::Fast, Precision::Reference] {
        let (output, c) = mapped(&input, &map, &ExportOptions { precision, ..ExportOptions::default() });
        assert!(c.sound && c.faults.is_empty(), "{:?}", c.faults);
        assert_eq!(c.coverage.voxels, output.grid.len() as u64);
        assert_eq!(c.coverage.inside_input + c.coverage.outside_input, c.coverage.voxels);
        assert!(c.coverage.tets.is_none() && c.labels.is_none() && c.inverse.failed == 0);
        assert!(c.inverse.samples > 1000 && c.inverse.max < 1e-8, "{:?}", c.inverse);
        // stretched behind the stroke, squeezed before it
        let (min, max) = (c.jacobian.min.unwrap(), c.jacobian.max.unwrap());
        assert!(c.jacobian.not_positive == 0 && 0.5 < min && min < 0.9 && 1.1 < max && max < 4.0, "{min} {max}");
    }
    // the lattice: the determinants of its tetrahedra lie within those of the map, nearly
    let exact = mapped(&input, &map, &ExportOptions::default()).1.jacobian;
    let output = output_grid(&input, &map, &ExportOptions::default()).unwrap();
    let mesh = Mesh::of(&map, &input.grid, &output, 0.1);
    let volume = mesh.warped(&input, &output, &WarpOptions::default());
    let of = |exact| {
        let field = TetField { exact, ..mesh.field(true) };
        of_tets(&subject(&input, &volume, &ExportOptions::default()), &field).unwrap()
    };
    let c = of(Some(&map));
    assert!(c.sound, "{:?}", c.faults);
    let t = c.coverage.tets.unwrap();
    assert_eq!((t.none, t.once, t.more, t.enclosed, t.degenerate), (0, volume.grid.len() as u64, 0, 0, 0));
    assert_eq!(c.jacobian.samples, mesh.tets.len() as u64);
    let (min, max) = (c.jacobian.min.unwrap(), c.jacobian.max.unwrap());
    assert!(min > exact.min.unwrap() - 0.05 && max < exact.max.unwrap() + 0.2, "{min} {max} {exact:?}");
    // against the exact forward map the inverse is off by about the tolerance, against its own not at all
    assert!(c.inverse.max > 0.01 && c.inverse.max < 0.3 && c.inverse.mean < 0.1, "{:?}", c.inverse);
    let own = of(None).inverse;
    assert!(own.samples == c.inverse.samples && own.max < 1e-9, "{own:?}");
}

#[test]
fn a_fold_is_found() {
    // of a map: a stroke twice as long as the longest that does not fold
    let map = stroke(DVec3::new(14.0, 0.0, 0.0), 11.0);
    let (_, c) = mapped(&ball(), &map, &ExportOptions::default());
    says(&c, "folds at");
    says(&c, "no single inverse");
    assert!(c.jacobian.not_positive > 10 && c.jacobian.min.unwrap() < 0.0 && c.inverse.failed > 0);
    // of a mesh: one point pulled through the opposite faces of its tetrahedra
    let mut mesh = lattice();
    let tet = mesh.tets[mesh.middle()];
    let [a, b, c, d] = TetMesh::corners(tet, &mesh.deformed);
    mesh.deformed[tet[0] as usize] = a + 2.0 * ((b + c + d) / 3.0 - a);
    let c = mesh.certified(true);
    says(&c, "inside out");
    assert!(c.jacobian.not_positive > 0 && c.jacobian.min.unwrap() < 0.0);
    // what folds over lies on what is there
    assert!(c.coverage.tets.unwrap().more > 0);
}

#[test]
fn a_hole_is_found_and_counted() {
    let mut mesh = lattice();
    let tet = mesh.middle();
    let voxels = mesh.voxels(tet);
    assert!(voxels > 3, "{voxels}");
    mesh.tets.remove(tet);
    let c = mesh.certified(true);
    says(&c, "it has a hole");
    let t = c.coverage.tets.unwrap();
    assert_eq!((t.none, t.enclosed, t.more), (voxels, voxels, 0));
    assert_eq!(t.none + t.once, c.coverage.voxels);
    // also where the mesh is not known to fill the grid
    says(&mesh.certified(false), "it has a hole");
    // but not what lies about a mesh
    let center = grid().center();
    let near = |t: &[u32; 4]| t.iter().all(|v| lattice().deformed[*v as usize].distance(center) < 12.0);
    let whole = lattice();
    let part = Mesh { tets: whole.tets.iter().copied().filter(near).collect(), ..whole };
    let c = part.certified(false);
    let t = c.coverage.tets.unwrap();
    assert!(t.none > 1000 && t.enclosed == 0 && c.sound, "{:?} {t:?}", c.faults);
    says(&part.certified(true), "it has a hole");
}

#[test]
fn an_overlap_is_found_and_counted() {
    // the same tetrahedron twice
    let mut mesh = lattice();
    let tet = mesh.middle();
    mesh.tets.push(mesh.tets[tet]);
    let c = mesh.certified(true);
    says(&c, "overlaps itself");
    assert_eq!(c.coverage.tets.unwrap().more, mesh.voxels(tet));
    // one of its own points moved over others, with the right side out
    let mut mesh = lattice();
    let corners = mesh.tets[mesh.middle()];
    let first = mesh.rest.len() as u32;
    for v in corners {
        mesh.rest.push(mesh.rest[v as usize]);
        mesh.deformed.push(mesh.deformed[v as usize] + DVec3::new(2.0, 1.5, 0.0));
    }
    mesh.tets.push(std::array::from_fn(|i| first + i as u32));
    let c = mesh.certified(true);
    says(&c, "overlaps itself");
    assert_eq!(c.coverage.tets.unwrap().more, mesh.voxels(mesh.tets.len() - 1));
    assert_eq!(c.faults.len(), 1, "{:?}", c.faults);
}

#[test]
fn a_clipped_export_is_found() {
    // something up to the border, and pulled over it
    let input = filled::<u8>(|p| if p.x > 20.0 { 90.0 + 5.0 * p.y } else { p.z });
    let extent = Extent { u: 14.0, v: 14.0, length: 60.0 };
    let d = DisplacementVolume::new(DVec3::new(28.0, 20.0, 20.0), DVec3::X * 6.0, extent, None).unwrap();
    let map = Stack { items: vec![Deformation::new("", Deformer::Displacement(d))] }.prepared();
    let same = ExportOptions { grid: GridChoice::Same, ..ExportOptions::default() };
    let (_, c) = mapped(&input, &map, &same);
    says(&c, "beyond the grid");
    assert!(c.material_clipped > 100);
    let (output, kept) = mapped(&input, &map, &ExportOptions::default());
    assert!(kept.sound && kept.material_clipped == 0, "{:?}", kept.faults);
    assert!(output.grid.dims[0] > input.grid.dims[0]);
    // the lattice of the larger grid, warped onto the smaller: it loses the same voxels, but for those at the very surface
    let mesh = Mesh::of(&map, &input.grid, &output.grid, 0.1);
    let cut = mesh.warped(&input, &input.grid, &WarpOptions::default());
    let lost = of_tets(&subject(&input, &cut, &same), &mesh.field(true)).unwrap();
    says(&lost, "beyond the grid");
    let (a, b) = (lost.material_clipped as f64, c.material_clipped as f64);
    assert!((a - b).abs() < 0.1 * b, "{a} {b}");
}

#[test]
fn labels_changed_by_interpolation_are_found() {
    let map = pull();
    for (step, name) in [(10.0, "apart"), (1.0, "in a row")] {
        let input = labels(step);
        let mesh = Mesh::of(&map, &input.grid, &input.grid, 0.1);
        for interpolation in [Interpolation::Nearest, Interpolation::Linear] {
            let options = ExportOptions { grid: GridChoice::Same, ..by(interpolation) };
            let (_, by_map) = mapped(&input, &map, &options);
            let warp = WarpOptions { interpolation, ..WarpOptions::default() };
            let output = mesh.warped(&input, &input.grid, &warp);
            let by_tets = of_tets(&subject(&input, &output, &options), &mesh.field(true)).unwrap();
            for c in [by_map, by_tets] {
                let l = c.labels.clone().unwrap();
                if interpolation == Interpolation::Nearest {
                    assert_eq!((l.added_voxels, l.blended_voxels, l.added.len()), (0, 0, 0), "{name}");
                    assert!(l.after <= l.before && !c.faults.iter().any(|f| f.contains("label")), "{:?}", c.faults);
                    continue;
                }
                says(&c, "use nearest interpolation");
                assert!(l.blended_voxels > 50, "{name} {l:?}");
                if step > 1.0 {
                    says(&c, "the input does not have");
                    assert!(l.added_voxels > 50 && l.added.iter().all(|v| v % 10.0 != 0.0) && l.after > l.before);
                }
            }
        }
    }
    // values are many, and to be changed
    let (_, c) = mapped(&ball(), &map, &by(Interpolation::Linear));
    assert!(c.labels.is_none());
    // but not by nearest
    let (mut output, c) = mapped(&ball(), &map, &by(Interpolation::Nearest));
    assert_eq!(c.labels.unwrap().added_voxels, 0);
    let Samples::I16(v) = &mut output.samples else { panic!("the type stays") };
    v[5] = -77;
    let c = of_map(&subject(&ball(), &output, &by(Interpolation::Nearest)), &map).unwrap();
    says(&c, "1 voxels have values that the input does not have");
    assert_eq!(c.labels.unwrap().added, [-77.0]);
}

#[test]
fn values_that_do_not_fit_are_counted() {
    let input = filled::<u8>(|p| 150.0 + p.x);
    let map = pull();
    // an outside value of which u8 keeps something else
    let options = ExportOptions { outside: Some(-1000.0), ..ExportOptions::default() };
    let (_, c) = mapped(&input, &map, &options);
    says(&c, "cannot hold");
    assert_eq!(c.values_clipped, c.coverage.outside_input);
    assert!(c.values_clipped > 0);
    // pressed to half its length, and twice as dense
    let scale = DVec3::new(0.5, 1.0, 1.0);
    let mut mesh = lattice();
    mesh.rest = mesh.deformed.clone();
    mesh.deformed.iter_mut().for_each(|p| *p *= scale);
    let dense = WarpOptions { density: true, ..WarpOptions::default() };
    let output = mesh.warped(&input, &grid(), &dense);
    let subject = Subject { density: true, ..subject(&input, &output, &ExportOptions::default()) };
    let c = of_tets(&subject, &mesh.field(false)).unwrap();
    assert!(c.jacobian.min.is_some_and(|j| (j - 0.5).abs() < 1e-9), "{:?}", c.jacobian);
    // all values are above 127.5 but beyond the input
    assert_eq!(c.values_clipped, c.coverage.inside_input);
    says(&c, "cannot hold");
    // f32 has room, and the mass stays where nothing leaves the grid
    let wide = filled::<f32>(|p| if p.distance(DVec3::new(17.0, 15.0, 13.0)) < 9.0 { 150.0 } else { 0.0 });
    mesh.deformed.iter_mut().for_each(|p| p.x += 8.0);
    let output = mesh.warped(&wide, &grid(), &dense);
    let c = of_tets(&Subject { input: &wide, output: &output, ..subject }, &mesh.field(false)).unwrap();
    assert!(c.values_clipped == 0 && c.material_clipped == 0, "{:?}", c.faults);
    assert!((c.mass.after / c.mass.before - 1.0).abs() < 0.03, "{:?}", c.mass);
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let input = ball();
    let colors = Volume::new(grid(), 4, Samples::U8(vec![0; grid().len() * 4]));
    let subject = subject(&input, &colors, &ExportOptions::default());
    assert_eq!(of_map(&subject, &pull()), Err(CertificateError::Channels { input: 1, output: 4 }));
    let good = Subject { output: &input, ..subject };
    let empty = TetField { tets: &[], rest: &[], deformed: &[], fills: false, exact: None };
    assert!(matches!(of_tets(&good, &empty), Err(CertificateError::Warp(_))));
    let nan = [DVec3::NAN; 4];
    let broken = TetField { tets: &[[0, 1, 2, 3]], rest: &nan, deformed: &nan, fills: false, exact: None };
    assert!(of_tets(&good, &broken).unwrap_err().to_string().contains("not a finite number"));
}

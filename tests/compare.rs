//! All modes against the reference: second order, agreement inside, and a report that stands by itself.

use std::path::Path;

use voxclay::deform::{Deformation, Deformer, DisplacementVolume};
use voxclay::evaluate::compare::{Comparison, STEP, Way, compare, html};
use voxclay::evaluate::export::{ExportOptions, Precision, export, unwatched};
use voxclay::evaluate::load::{Object, load};
use voxclay::evaluate::picture::{Backend, Mode, Refinement, Renderer, ViewOptions};
use voxclay::evaluate::tets;
use voxclay::scene::{Document, ProxySource, VolumeSource};

mod pictures;
use pictures::difference;

fn object(shaped: bool) -> (Document, Object) {
    let mut document = Document::new(VolumeSource::Phantom { name: "orange".into(), size: 48 });
    document.proxy = if shaped { ProxySource::Auto { iso: None } } else { ProxySource::Box };
    let rest = load(&document, Path::new("")).unwrap();
    let (center, radius) = rest.focus;
    let drag = |at: glam::DVec3, vector: glam::DVec3, wide: f64| {
        let d = DisplacementVolume::from_drag(center + at * radius, vector * radius, wide * radius).unwrap();
        Deformation::new("", Deformer::Displacement(d))
    };
    document.stack.items = vec![
        drag(glam::DVec3::new(0.3, 0.0, 0.1), glam::DVec3::new(0.25, 0.05, -0.1), 0.8),
        drag(glam::DVec3::new(-0.2, 0.2, 0.3), glam::DVec3::new(-0.1, 0.0, 0.2), 0.6),
    ];
    let object = load(&document, Path::new("")).unwrap();
    assert!(object.warnings.is_empty());
    (document, object)
}

fn view() -> ViewOptions {
    ViewOptions {
        size: (160, 120),
        slices: None,
        mode: Mode::Slicing,
        refinement: Refinement::Tolerance(0.25),
        backend: Backend::Cpu,
        transparent: false,
        corrections: None,
    }
}

fn compared(ways: &[Way]) -> Comparison {
    let (document, object) = object(false);
    let camera = object.camera(&document.camera);
    compare(&object, &camera, &document.look.look(object.iso), &view(), ways, &|_| {}).unwrap()
}

#[test]
fn coordinates_converge_to_second_order_and_pictures_and_volumes_follow() {
    let depths = [1, 2, 3, 4].map(|d| Way::Slicing(Refinement::Depth(d)));
    let levels = [1, 2, 3].map(|l| Way::Tets(Refinement::Depth(l)));
    let c = compared(&[depths.as_slice(), &levels].concat());
    let (slicing, tets) = c.pairs.split_at(4);
    assert!(slicing[0].falls.is_none() && tets[0].falls.is_none());
    for series in [slicing, tets] {
        let last = series.last().unwrap();
        let [max, mean] = last.falls.unwrap();
        assert!((3.0..5.0).contains(&max) && (3.6..4.4).contains(&mean), "{max} {mean}");
        for pair in series.windows(2) {
            let errors = |i: usize| pair[i].coordinate.unwrap();
            let falls = pair[1].falls.unwrap();
            assert_eq!(falls, [errors(0).max / errors(1).max, errors(0).mean / errors(1).mean]);
            assert!(errors(1).max > errors(1).mean && errors(1).samples > 1000);
        }
    }
    // pictures of slices come to the reference, volumes to the reference volume
    for pair in slicing.windows(2) {
        assert!(pair[1].difference.rmse < 0.6 * pair[0].difference.rmse && pair[0].volume.is_none());
    }
    for pair in tets.windows(2) {
        let of = |i: usize| pair[i].volume.unwrap();
        assert!(of(1).all.rmse < 0.5 * of(0).all.rmse && of(1).drawn.rmse < of(0).drawn.rmse);
        assert!(of(1).interior.rms < 0.5 * of(0).interior.rms && of(1).all.ssim > of(0).all.ssim);
        assert_eq!(pair[1].tets, pair[0].tets.map(|t| 8 * t));
    }
    assert!(c.scale.top() >= slicing[0].map.max() && slicing[0].map.max() == slicing[0].difference.max as u8);
}

#[test]
fn lattices_of_the_default_tolerance_agree_inside_to_a_grey() {
    let c = compared(&[Way::Export(Precision::Fast), Way::Tets(Refinement::Tolerance(tets::TOLERANCE))]);
    for pair in &c.pairs {
        let inside = pair.volume.unwrap().interior;
        assert!(inside.voxels > 50_000 && inside.rms < STEP && inside.max < 0.05, "{inside:?}");
        assert!(inside.above < 0.1 && inside.rms <= inside.max, "{inside:?}");
    }
    // the fast export is right to 1/1000 voxel
    assert!(c.pairs[0].volume.unwrap().interior.max < STEP);
    assert!(c.pairs[1].coordinate.unwrap().max <= tets::TOLERANCE);
}

#[test]
fn the_reference_is_itself() {
    let c = compared(&[Way::SlicingExact, Way::Export(Precision::Reference)]);
    let [exact, volume] = &c.pairs[..] else { panic!("two pairs") };
    assert_eq!((exact.difference.max, exact.map.max(), exact.difference.psnr), (0.0, 0, f64::INFINITY));
    assert_eq!(exact.picture, c.reference);
    let v = volume.volume.unwrap();
    assert_eq!((v.all.max, v.interior.max, v.drawn.max), (0.0, 0.0, 0.0));
    // but a volume that is sampled twice is not drawn quite the same
    assert!(volume.difference.max > 0.0 && volume.difference.psnr > 30.0, "{:?}", volume.difference);
}

#[test]
fn reports_stand_by_themselves() {
    let c = compared(&[
        Way::Slicing(Refinement::Depth(0)),
        Way::Slicing(Refinement::Depth(1)),
        Way::Tets(Refinement::Depth(0)),
        Way::Tets(Refinement::Tolerance(0.5)),
    ]);
    let page = html(&c, "a <project> & more", &[("voxels".to_owned(), "48 x 48 x 48".to_owned())]).unwrap();
    assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
    assert!(page.contains("a &lt;project&gt; &amp; more") && !page.contains("<project>"));
    // the reference, and two pictures a mode
    assert_eq!(page.matches("data:image/png;base64,iVBORw0KGgo").count(), 9);
    for outside in ["http", "<script", "<link", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
    for words in ["depth 1", "level 0", "0.5 voxel", "<svg", "Resampled volumes", "Second order is 4"] {
        assert!(page.contains(words), "{words}");
    }
    for tag in ["table", "figure", "svg", "div", "tr", "p"] {
        let open = page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
        assert_eq!(open, page.matches(&format!("</{tag}>")).count(), "{tag}");
    }
}

#[test]
fn what_went_through_a_lattice_is_drawn_and_exported_like_the_rest() {
    for shaped in [false, true] {
        let (document, object) = object(shaped);
        let camera = object.camera(&document.camera);
        let look = document.look.look(object.iso);
        let mut renderer = Renderer::new(Backend::Cpu).unwrap();
        let mut draw = |mode, refinement| {
            renderer.picture(&object, &camera, &look, &ViewOptions { mode, refinement, ..view() }).unwrap()
        };
        let (exact, report) = draw(Mode::SlicingExact, Refinement::Depth(0));
        assert!(report.tets.is_none());
        let (warped, report) = draw(Mode::Tets, Refinement::Tolerance(0.1));
        let tets = report.tets.unwrap();
        assert!(tets.lattice.converged && tets.lattice.max_error <= 0.1 && report.ms_total > tets.ms_warp);
        assert!(difference(&exact, &warped).psnr > 28.0, "{}", difference(&exact, &warped).psnr);
        // and it is not the picture of what is not deformed
        let (flat, _) =
            renderer.picture(&tets::undeformed(&object, (*object.volume).clone()), &camera, &look, &view()).unwrap();
        assert!(
            difference(&flat, &warped).psnr < difference(&exact, &warped).psnr - 8.0,
            "{}",
            difference(&flat, &warped).psnr
        );

        let options = ExportOptions::default();
        let made = tets::resample(&object, &options, Refinement::Tolerance(0.1)).unwrap();
        let (reference, _) = export(
            &object.volume,
            &object.stack.prepared(),
            &ExportOptions { precision: Precision::Reference, ..options },
            &unwatched,
        )
        .unwrap();
        assert_eq!(made.volume.grid, reference.grid);
        assert_eq!(made.outside_mesh > 0, shaped);
        assert_eq!(made.tally.written, reference.grid.len() as u64);
    }
}

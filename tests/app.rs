//! The modeller, driven through its window's interface: by pointer, by keys and by accessible name.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use eframe::egui::{self, Key, Modifiers, PointerButton, Pos2, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use voxclay::app::settings::Home;
use voxclay::app::{Modeller, Start};
use voxclay::evaluate::picture::{Backend, Mode};
use voxclay::io;
use voxclay::scene::read_project;

mod window;
use window::{Bench, key, m, modeller, until};

fn settled(h: &mut Bench) {
    until(h, "the full picture", |m| {
        let document = m.desk.as_ref().map(|d| d.shown().clone());
        let object = m.desk.as_ref().and_then(|d| d.object.as_ref()).map(|(d, _)| d.clone());
        m.tasks.is_empty()
            && m.shown.as_ref().is_some_and(|s| s.last)
            && document.map(|d| d.stack.clone()) == object.map(|d| d.stack.clone())
    });
}

/// Presses at `from`, moves by `way` in steps, and lets go.
fn drag(h: &mut Bench, from: Pos2, way: Vec2, button: PointerButton, modifiers: Modifiers) {
    let press = |pressed, pos| egui::Event::PointerButton { pos, button, pressed, modifiers };
    h.hover_at(from);
    h.step();
    h.event_modifiers(press(true, from), modifiers);
    h.step();
    for i in 1..=6 {
        h.event_modifiers(egui::Event::PointerMoved(from + way * (i as f32 / 6.0)), modifiers);
        h.step();
    }
    h.event_modifiers(press(false, from + way), modifiers);
    h.step();
}

fn middle(h: &Bench) -> Pos2 {
    h.get_by_label("Main view").rect().center()
}

fn strokes(h: &Bench) -> usize {
    h.state().as_ref().unwrap().desk.as_ref().unwrap().history.document().stack.items.len()
}

#[test]
fn a_stroke_is_a_step_that_can_be_undone() {
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:head:40", home.path());
    let at = middle(&h);
    drag(&mut h, at, Vec2::new(40.0, 25.0), PointerButton::Primary, Modifiers::NONE);
    assert_eq!(strokes(&h), 1);
    settled(&mut h);
    // what was at the start of the drag is at its end
    for (name, k, count) in [("Push", Key::D, 2), ("Twist", Key::T, 3), ("Inflate", Key::I, 4), ("Pinch", Key::P, 5)] {
        key(&mut h, Modifiers::NONE, k);
        settled(&mut h);
        drag(&mut h, at, Vec2::new(30.0, 0.0), PointerButton::Primary, Modifiers::NONE);
        assert_eq!(strokes(&h), count, "{name}");
        let items = &m(&mut h).desk.as_ref().unwrap().history.document().stack.items;
        assert!(items[count - 1].name.starts_with(name), "{}", items[count - 1].name);
        assert!(items.iter().all(|i| i.deformer.steepness() < 1.0));
    }
    for left in (3..5).rev() {
        key(&mut h, Modifiers::COMMAND, Key::Z);
        assert_eq!(strokes(&h), left);
    }
    key(&mut h, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert_eq!(strokes(&h), 4);
    // a drag beside the object turns it and is no step
    let steps = m(&mut h).desk.as_ref().unwrap().history.steps().len();
    let yaw = m(&mut h).desk.as_ref().unwrap().history.document().camera.yaw;
    let corner = h.get_by_label("Main view").rect().left_top() + Vec2::splat(20.0);
    drag(&mut h, corner, Vec2::new(60.0, 0.0), PointerButton::Primary, Modifiers::NONE);
    let desk = m(&mut h).desk.as_ref().unwrap();
    assert!(desk.history.document().camera.yaw != yaw && desk.history.steps().len() == steps);
    // undoing keeps the camera
    let yaw = desk.history.document().camera.yaw;
    key(&mut h, Modifiers::COMMAND, Key::Z);
    assert_eq!(m(&mut h).desk.as_ref().unwrap().history.document().camera.yaw, yaw);
}

#[test]
fn panels_answer_to_their_names() {
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:orange:40", home.path());
    settled(&mut h);
    let at = middle(&h);
    drag(&mut h, at, Vec2::new(-30.0, 30.0), PointerButton::Primary, Modifiers::NONE);
    // the stack
    h.get_by_label("Switch off Grab 1").click();
    h.step();
    h.step();
    let enabled =
        |h: &Bench| h.state().as_ref().unwrap().desk.as_ref().unwrap().history.document().stack.items[0].enabled;
    assert!(!enabled(&h));
    h.get_by_label("Switch on Grab 1").click();
    h.step();
    h.step();
    assert!(enabled(&h));
    h.get_by_label("Duplicate Grab 1").click();
    h.step();
    assert_eq!(strokes(&h), 2);
    key(&mut h, Modifiers::COMMAND, Key::Z);
    // the look
    h.get_by_label("Look").click();
    h.step();
    h.step();
    h.get_by_label("MIP").click();
    h.step();
    h.step();
    let look = m(&mut h).desk.as_ref().unwrap().history.document().look;
    assert_eq!(look.shading, voxclay::scene::ShadingSpec::Mip);
    h.get_by_label("Lit").click();
    h.step();
    assert!(!m(&mut h).desk.as_ref().unwrap().history.document().look.lit);
    // of volumes only
    h.get_by_label("Volume").click();
    h.run_steps(3);
    h.get_by_label("Gradient opacity").click();
    h.run_steps(3);
    assert!(m(&mut h).desk.as_ref().unwrap().history.document().look.gradient_opacity.is_some());
    h.get_by_role_and_label(egui::accesskit::Role::Slider, "Nothing below");
    key(&mut h, Modifiers::COMMAND, Key::Z);
    assert!(m(&mut h).desk.as_ref().unwrap().history.document().look.gradient_opacity.is_none());
    // a double click on the curve makes a point, which is a step
    let curve = h.get_by_label("Curve of the transfer function").rect();
    let at = curve.left_top() + Vec2::new(0.37 * curve.width(), 20.0);
    h.hover_at(at);
    // or the clicks before would make it a triple click
    h.run_steps(60);
    let points = |h: &Bench| {
        let object = &h.state().as_ref().unwrap().desk.as_ref().unwrap();
        object.history.document().transfer_function.as_ref().map_or(0, |t| t.points.len())
    };
    assert_eq!(points(&h), 0);
    for _ in 0..2 {
        for pressed in [true, false] {
            let button = PointerButton::Primary;
            h.event(egui::Event::PointerButton { pos: at, button, pressed, modifiers: Modifiers::NONE });
            h.step();
        }
    }
    h.step();
    assert!(points(&h) > 1);
    key(&mut h, Modifiers::COMMAND, Key::Z);
    assert_eq!(points(&h), 0);
    // the object
    h.get_by_label("Object").click();
    h.step();
    h.step();
    h.get_by_label("Hull").click();
    h.step();
    settled(&mut h);
    let object = m(&mut h).desk.as_ref().unwrap().object.as_ref().unwrap().1.clone();
    assert!(object.shaped && object.mesh.triangles.len() > 100);
    // modes by name and by key
    h.get_by_label("Exact").click();
    h.step();
    assert_eq!(m(&mut h).view.mode, Mode::SlicingExact);
    key(&mut h, Modifiers::NONE, Key::Num1);
    assert_eq!(m(&mut h).view.mode, Mode::Slicing);
    // every widget that can be seen has a name
    h.check_accessibility();
}

#[test]
fn regions_are_added_moved_and_taken_away_in_steps() {
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:orange:40", home.path());
    // all of the panel at once
    h.set_size(Vec2::new(1200.0, 1400.0));
    settled(&mut h);
    h.get_by_label("Look").click();
    h.run_steps(3);
    let regions = |h: &Bench| {
        let document = h.state().as_ref().unwrap().desk.as_ref().unwrap().history.document().clone();
        document.transfer_function.as_ref().map_or_else(Vec::new, |t| t.regions.clone())
    };
    h.get_by_label("Value and steepness").click();
    until(&mut h, "the joint histogram", |m| m.desk.as_ref().is_some_and(|d| d.joint.is_some()));
    assert_eq!(regions(&h).len(), 1);
    // beside it a double click makes another
    let plot = h.get_by_label("Regions over value and steepness").rect();
    let at = plot.left_bottom() + Vec2::new(14.0, -12.0);
    h.hover_at(at);
    h.run_steps(60);
    for _ in 0..2 {
        for pressed in [true, false] {
            let button = PointerButton::Primary;
            h.event(egui::Event::PointerButton { pos: at, button, pressed, modifiers: Modifiers::NONE });
            h.step();
        }
    }
    h.run_steps(60);
    let made = regions(&h);
    assert!(made.len() == 2 && made[1].value[0] == 0.0 && made[1].steepness[0] == 0.0, "{made:?}");
    // it is moved in one step, open sides stay
    let count = steps(&h);
    drag(&mut h, at, Vec2::new(30.0, 0.0), PointerButton::Primary, Modifiers::NONE);
    let moved = regions(&h)[1];
    assert!(steps(&h) == count + 1 && moved.value[1] > made[1].value[1] + 0.05, "{moved:?}");
    assert_eq!(moved.steepness, made[1].steepness);
    key(&mut h, Modifiers::COMMAND, Key::Z);
    assert_eq!(regions(&h), made);
    h.get_by_label("Region, highest steepness");
    h.get_by_label("its own").click();
    h.run_steps(3);
    assert!(regions(&h)[1].color.is_some());
    h.check_accessibility();
    h.get_by_label("Delete the region").click();
    h.run_steps(3);
    assert_eq!(regions(&h), made[..1]);
    // opacity by value puts them away, and back
    h.get_by_label("Value").click();
    h.run_steps(3);
    assert!(regions(&h).is_empty());
    h.get_by_label("Value and steepness").click();
    h.run_steps(3);
    assert_eq!(regions(&h), made[..1]);
    settled(&mut h);
}

/// The deformations as they are in the document.
fn items(h: &Bench) -> Vec<voxclay::deform::Deformation> {
    h.state().as_ref().unwrap().desk.as_ref().unwrap().history.document().stack.items.clone()
}

/// The number of the step that is shown.
fn steps(h: &Bench) -> usize {
    h.state().as_ref().unwrap().desk.as_ref().unwrap().history.at()
}

#[test]
fn handles_of_a_deformation_are_dragged_in_one_step_each() {
    use voxclay::deform::Deformer;
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:head:40", home.path());
    let at = middle(&h);
    drag(&mut h, at, Vec2::new(30.0, 15.0), PointerButton::Primary, Modifiers::NONE);
    settled(&mut h);
    // nothing is in the way until it is selected
    assert!(h.query_by_label("Tip of Grab 1").is_none());
    h.get_by_label("Grab 1").click();
    h.run_steps(3);
    let numbers = |h: &Bench| match &items(h)[0].deformer {
        Deformer::Displacement(d) => (d.point(), d.vector(), d.extent()),
        other => panic!("{other:?}"),
    };
    for (what, way) in [("Tip", Vec2::new(10.0, -14.0)), ("Point", Vec2::new(-20.0, 8.0)), ("Half-width u", Vec2::ZERO)]
    {
        let label = format!("{what} of Grab 1");
        let from = h.get_by_label(&label).rect().center();
        let away = (from - h.get_by_label("Tip of Grab 1").rect().center()).normalized() * 25.0;
        let (before, count) = (numbers(&h), steps(&h));
        drag(&mut h, from, if way == Vec2::ZERO { away } else { way }, PointerButton::Primary, Modifiers::NONE);
        let after = numbers(&h);
        assert_eq!(steps(&h), count + 1, "{what}");
        match what {
            "Tip" => assert!(after.1 != before.1 && after.0 == before.0 && after.2 == before.2),
            "Point" => assert!(after.0 != before.0 && after.1 == before.1 && after.2 == before.2),
            _ => assert!(after.2.u > 1.05 * before.2.u && after.2.v == before.2.v && after.1 == before.1),
        }
        // it has gone along with the hand
        h.run_steps(2);
        let there = h.get_by_label(&label).rect().center();
        let want = from + if way == Vec2::ZERO { away } else { way };
        assert!((there - want).length() < 2.0, "{what}: {there} instead of {want}");
        key(&mut h, Modifiers::COMMAND, Key::Z);
        assert_eq!(numbers(&h), before, "{what}");
    }
    assert!(items(&h)[0].deformer.steepness() < 1.0);
    // Esc gives a drag up
    let from = h.get_by_label("Tip of Grab 1").rect().center();
    let (before, count) = (numbers(&h), steps(&h));
    let button = PointerButton::Primary;
    h.hover_at(from);
    h.step();
    h.event(egui::Event::PointerButton { pos: from, button, pressed: true, modifiers: Modifiers::NONE });
    h.step();
    h.event(egui::Event::PointerMoved(from + Vec2::splat(20.0)));
    h.step();
    assert!(m(&mut h).desk.as_ref().unwrap().preview.is_some());
    key(&mut h, Modifiers::NONE, Key::Escape);
    let pos = from + Vec2::splat(20.0);
    h.event(egui::Event::PointerButton { pos, button, pressed: false, modifiers: Modifiers::NONE });
    h.step();
    assert_eq!((numbers(&h), steps(&h)), (before, count));
}

#[test]
fn the_shape_is_moved_turned_and_scaled_in_the_texture_cube() {
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:orange:40", home.path());
    key(&mut h, Modifiers::NONE, Key::O);
    settled(&mut h);
    let placement = |h: &Bench| h.state().as_ref().unwrap().desk.as_ref().unwrap().history.document().placement;
    let rest = placement(&h);
    for (part, what) in [
        ("Move the shape along X", 0),
        ("Turn the shape about Z", 1),
        ("Scale the shape along its Y", 2),
        ("Scale the shape", 3),
    ] {
        let count = steps(&h);
        let from = h.get_by_label(part).rect().center();
        let middle = h.get_by_label("Scale the shape").rect().center();
        let way = if what == 3 { Vec2::new(15.0, -15.0) } else { (from - middle).normalized() * 18.0 };
        let way = if what == 1 { way.rot90() } else { way };
        drag(&mut h, from, way, PointerButton::Primary, Modifiers::NONE);
        let p = placement(&h);
        assert_eq!(steps(&h), count + 1, "{part}");
        let changed = [p.translate != rest.translate, p.rotate != rest.rotate, p.scale != rest.scale];
        assert_eq!(changed, [what == 0, what == 1, what >= 2], "{part}: {p:?}");
        match what {
            0 => assert!(p.translate.x > 0.0 && p.translate.y == 0.0 && p.translate.z == 0.0),
            1 => assert!(p.rotate.z.abs() > 3.0 && p.rotate.x.abs() < 1e-9 && p.rotate.y.abs() < 1e-9),
            2 => assert!(p.scale.y > 1.05 && p.scale.x == 1.0),
            _ => assert!(p.scale.x > 1.05 && p.scale.x == p.scale.y && p.scale.x == p.scale.z),
        }
        key(&mut h, Modifiers::COMMAND, Key::Z);
        assert_eq!(placement(&h), rest);
    }
    // beside the gizmo, both views turn
    let corner = h.get_by_label("Texture cube").rect().right_top() + Vec2::new(-12.0, 12.0);
    let yaw = m(&mut h).desk.as_ref().unwrap().history.document().camera.yaw;
    drag(&mut h, corner, Vec2::new(-30.0, 0.0), PointerButton::Primary, Modifiers::NONE);
    assert!(m(&mut h).desk.as_ref().unwrap().history.document().camera.yaw != yaw);
    assert_eq!(placement(&h), rest);
    h.check_accessibility();
}

/// What is outside the range stays: the displacement of a masked stroke is a lattice that holds still there.
#[test]
fn a_mask_by_value_holds_back_what_it_does_not_hold() {
    use voxclay::deform::Deformer;
    use voxclay::math::BackwardMap;
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:head:48", home.path());
    let at = middle(&h);
    h.get_by_label("Only values").click();
    h.run_steps(3);
    h.get_by_label("Mask, from");
    until(&mut h, "the mask", |m| m.desk.as_ref().is_some_and(|d| d.mask.is_some()));
    drag(&mut h, at, Vec2::new(30.0, 10.0), PointerButton::Primary, Modifiers::NONE);
    let made = items(&h);
    assert!(made.len() == 1 && made[0].name == "Grab 1, masked", "{made:?}");
    let deformer = &made[0].deformer;
    assert!(matches!(deformer, Deformer::Lattice(_)) && deformer.steepness() < 1.0);
    settled(&mut h);
    // air moves much less than what is within the range
    let desk = m(&mut h).desk.as_ref().unwrap();
    let mask = desk.mask.clone().unwrap();
    let support = deformer.support();
    let (mut inside, mut outside) = (0.0_f64, 0.0_f64);
    for i in 0..4000 {
        let t = |k: f64| 2.0 * (f64::from(i) * k).fract() - 1.0;
        let p =
            support.center + support.axes * (support.half * glam::DVec3::new(t(0.754_877), t(0.569_840), t(0.430_159)));
        let from = deformer.backward(p);
        let most = if mask.at(from) > 0.99 { &mut inside } else { &mut outside };
        if !(0.01..=0.99).contains(&mask.at(from)) {
            *most = most.max((p - from).length());
        }
    }
    assert!(inside > 0.0 && outside < inside, "{outside} {inside}");
    // a range that nothing has
    let top = m(&mut h).desk.as_ref().unwrap().data.field.range[1];
    m(&mut h).hand.mask = Some([top, top]);
    until(&mut h, "the mask", |m| m.desk.as_ref().is_some_and(|d| d.mask.as_ref().is_some_and(|k| k.range[0] == top)));
    drag(&mut h, at, Vec2::new(30.0, 10.0), PointerButton::Primary, Modifiers::NONE);
    assert_eq!(strokes(&h), 1);
    assert!(m(&mut h).notices.iter().any(|n| n.text.contains("within the mask")));
}

#[test]
fn overlays_come_and_need_no_new_picture() {
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:head:40", home.path());
    let at = middle(&h);
    drag(&mut h, at, Vec2::new(40.0, 20.0), PointerButton::Primary, Modifiers::NONE);
    settled(&mut h);
    let generation = m(&mut h).shown.as_ref().unwrap().generation;
    key(&mut h, Modifiers::NONE, Key::J);
    key(&mut h, Modifiers::NONE, Key::K);
    until(&mut h, "growth and tetrahedra", |m| m.panels.heat.is_some() && m.panels.tets.is_some());
    h.run_steps(20);
    assert_eq!(m(&mut h).shown.as_ref().unwrap().generation, generation);
    let heat = m(&mut h).panels.heat.clone().unwrap();
    assert!(heat.growth.iter().any(|g| *g > 1.2) && heat.growth.iter().any(|g| (g - 1.0).abs() < 1e-6));
    let layer = m(&mut h).panels.tets.clone().unwrap();
    assert!(layer.tets > 384 && layer.folded == 0 && layer.edges.len() > 50);
}

#[test]
fn a_trackball_goes_over_the_pole_and_home_makes_upright() {
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:orange:32", home.path());
    let corner = h.get_by_label("Main view").rect().left_top() + Vec2::splat(20.0);
    let pitch = |h: &Bench| h.state().as_ref().unwrap().desk.as_ref().unwrap().history.document().camera.pitch;
    let turn = |h: &mut Bench| drag(h, corner, Vec2::new(0.0, 560.0), PointerButton::Middle, Modifiers::NONE);
    turn(&mut h);
    assert!((80.0..90.0).contains(&pitch(&h)));
    h.get_by_label("View").click();
    h.run_steps(4);
    h.get_by_label("Orbit: Trackball").click();
    h.run_steps(4);
    key(&mut h, Modifiers::NONE, Key::Escape);
    // on from nearly above, through the middle of the ball
    let rect = h.get_by_label("Main view").rect();
    drag(
        &mut h,
        rect.center_top() + Vec2::new(0.0, 20.0),
        Vec2::new(0.0, 560.0),
        PointerButton::Middle,
        Modifiers::NONE,
    );
    let roll = |h: &Bench| h.state().as_ref().unwrap().desk.as_ref().unwrap().history.document().camera.roll;
    assert!(pitch(&h) < 60.0 && roll(&h).abs() > 170.0, "{} {}", pitch(&h), roll(&h));
    key(&mut h, Modifiers::NONE, Key::Home);
    assert_eq!(roll(&h), 0.0);
}

/// Longer than any 3D texture, though small: half of it is drawn, with a word about it, and nothing of the document changes.
#[test]
fn a_volume_that_the_device_does_not_take_is_shown_coarser() {
    use voxclay::gpu::{Gpu, Preference};
    // without any graphics driver there is nothing to be too large for
    let Ok(gpu) = Gpu::open(Preference::Any) else { return };
    let long = gpu.limits().max_texture_dimension_3d as usize + 1000;
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("long.nrrd");
    let grid =
        voxclay::volume::Grid::new([long, 4, 4], glam::DAffine3::IDENTITY, voxclay::volume::Space::Unknown).unwrap();
    let samples = (0..16 * long).map(|i| if i % long % 500 < 250 { 0 } else { 200 }).collect();
    let volume = voxclay::volume::Volume::new(grid, 1, voxclay::volume::Samples::U8(samples));
    io::write_volume(&path, &volume, &io::WriteOptions::default()).unwrap();
    let start =
        Start { files: vec![path.to_string_lossy().into_owned()], backend: Backend::Gpu, home: Home::at(dir.path()) };
    let mut h = Harness::builder().with_size([900.0, 600.0]).with_step_dt(1.0 / 60.0).build_ui_state(
        move |ui: &mut egui::Ui, m: &mut Option<Modeller>| {
            m.get_or_insert_with(|| Modeller::new(ui.ctx(), start.clone())).ui(ui);
        },
        None,
    );
    until(&mut h, "a picture", |m| m.shown.as_ref().is_some_and(|s| s.last));
    let m = m(&mut h);
    assert!(m.notices.iter().any(|n| !n.error && n.text.contains("1/2 of its resolution")), "{:?}", m.notices);
    assert_eq!(m.shown.as_ref().unwrap().report.backend, "gpu");
    assert_eq!(m.desk.as_ref().unwrap().data.volume.grid.dims, [long, 4, 4]);
}

/// A slider that is dragged twice makes two steps.
#[test]
fn letting_go_ends_a_step() {
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:orange:32", home.path());
    let at = middle(&h);
    drag(&mut h, at, Vec2::new(-30.0, 30.0), PointerButton::Primary, Modifiers::NONE);
    h.get_by_label("Grab 1").click();
    h.run_steps(3);
    let count = steps(&h);
    for way in [-20.0, 10.0] {
        let slider = h.get_by_role_and_label(egui::accesskit::Role::Slider, "Effect");
        let at = slider.rect().center();
        drag(&mut h, at, Vec2::new(way, 0.0), PointerButton::Primary, Modifiers::NONE);
    }
    assert_eq!(steps(&h), count + 2);
}

#[test]
fn two_modes_side_by_side_come_with_numbers() {
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:head:40", home.path());
    let at = middle(&h);
    drag(&mut h, at, Vec2::new(30.0, 20.0), PointerButton::Primary, Modifiers::NONE);
    key(&mut h, Modifiers::NONE, Key::A);
    until(&mut h, "both pictures", |m| m.shown.as_ref().is_some_and(|s| s.last && s.other.is_some()));
    let shown = m(&mut h).shown.as_ref().unwrap();
    let other = shown.other.as_ref().unwrap();
    // against the original: it was deformed
    assert!(other.metrics.max > 20.0 && other.metrics.psnr < 45.0, "{:?}", other.metrics);
    assert_eq!(shown.image.size, other.image.size);
}

/// Exports through the panel, then the same project by the command line: the files are the same to the byte.
#[test]
fn the_panel_exports_what_the_command_line_does() {
    let dir = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:torso:48", dir.path());
    let at = middle(&h);
    drag(&mut h, at, Vec2::new(45.0, -20.0), PointerButton::Primary, Modifiers::NONE);
    settled(&mut h);
    key(&mut h, Modifiers::NONE, Key::T);
    drag(&mut h, at + Vec2::new(0.0, 40.0), Vec2::new(60.0, 0.0), PointerButton::Primary, Modifiers::NONE);
    assert_eq!(strokes(&h), 2);
    let project = dir.path().join("torso.voxclay");
    let ctx = h.ctx.clone();
    m(&mut h).save_as(&ctx, project.clone(), false, voxclay::app::After::Nothing);
    until(&mut h, "the project", |m| m.tasks.is_empty());
    assert!(!m(&mut h).desk.as_ref().unwrap().history.is_dirty());
    assert_eq!(read_project(&project).unwrap().document.stack.items.len(), 2);
    assert!(read_project(&project).unwrap().thumbnail.is_some());

    let by_hand = dir.path().join("by-hand.nrrd");
    h.get_by_label("Export").click();
    h.step();
    h.step();
    m(&mut h).panels.export_path = by_hand.to_string_lossy().into_owned();
    h.step();
    h.get_by_label("Export volume").click();
    h.step();
    h.step();
    until(&mut h, "the export", |m| m.panels.exported.is_some());
    assert!(m(&mut h).panels.exported.as_ref().unwrap().certificate.as_ref().unwrap().sound);

    let by_command = dir.path().join("by-command.nrrd");
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_voxclay"))
        .args(["export", project.to_str().unwrap(), "-o", by_command.to_str().unwrap()])
        .status()
        .unwrap();
    assert!(status.success());
    assert!(std::fs::read(by_hand).unwrap() == std::fs::read(by_command).unwrap(), "the two exports differ");
}

#[test]
fn a_project_with_its_volume_inside_opens_anywhere() {
    let dir = tempfile::tempdir().unwrap();
    let volume = dir.path().join("v.nrrd");
    let phantom = voxclay::volume::phantom::Phantom::from_name("orange").unwrap().generate(32);
    io::write_volume(&volume, &phantom, &io::WriteOptions::default()).unwrap();
    let mut h = modeller(volume.to_str().unwrap(), dir.path());
    let at = middle(&h);
    drag(&mut h, at, Vec2::new(20.0, 20.0), PointerButton::Primary, Modifiers::NONE);
    let ctx = h.ctx.clone();
    let (inside, beside) = (dir.path().join("inside.voxclay"), dir.path().join("beside.voxclay"));
    for (path, embed) in [(&inside, true), (&beside, false)] {
        m(&mut h).save_as(&ctx, path.clone(), embed, voxclay::app::After::Nothing);
        until(&mut h, "the project", |m| m.tasks.is_empty());
    }
    std::fs::remove_file(&volume).unwrap();
    let moved = dir.path().join("moved.voxclay");
    std::fs::rename(&inside, &moved).unwrap();
    drop(h);
    let mut h = modeller(moved.to_str().unwrap(), dir.path());
    assert_eq!(strokes(&h), 1);
    assert_eq!(m(&mut h).desk.as_ref().unwrap().data.volume.checksum(), phantom.checksum());
    // the other one misses its volume, says which, and loses nothing
    let ctx = h.ctx.clone();
    m(&mut h).open(&ctx, beside.to_str().unwrap());
    until(&mut h, "the failure", |m| m.notices.iter().any(|n| n.error));
    assert!(m(&mut h).notices.iter().any(|n| n.error && n.text.contains("v.nrrd")), "{:?}", m(&mut h).notices);
    assert_eq!(strokes(&h), 1);
}

#[test]
fn unsaved_work_is_found_again() {
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:head:32", home.path());
    m(&mut h).settings.autosave_seconds = 0.2;
    let at = middle(&h);
    drag(&mut h, at, Vec2::new(25.0, 25.0), PointerButton::Primary, Modifiers::NONE);
    let folder = home.path().join("recovery");
    let files = || -> Vec<PathBuf> {
        std::fs::read_dir(&folder).map(|d| d.flatten().map(|e| e.path()).collect()).unwrap_or_default()
    };
    let started = Instant::now();
    while files().is_empty() {
        h.step();
        std::thread::sleep(Duration::from_millis(10));
        assert!(started.elapsed() < Duration::from_secs(30), "nothing was put aside");
    }
    let stack = m(&mut h).desk.as_ref().unwrap().history.document().stack.clone();
    // as if the process had been killed: the file stays, with the number of a process that is gone
    drop(h);
    let file = files().remove(0);
    let mut aside: serde_json::Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    aside["process"] = serde_json::json!(u32::MAX);
    std::fs::write(folder.join("4294967295.json"), aside.to_string()).unwrap();
    std::fs::remove_file(&file).unwrap();

    let mut h = modeller("phantom:orange:16", home.path());
    h.get_by_label("Recover head (1 deformations)").click();
    h.step();
    until(&mut h, "the recovered work", |m| m.desk.as_ref().is_some_and(|d| d.history.document().stack == stack));
    assert!(m(&mut h).desk.as_ref().unwrap().history.is_dirty());
}

/// The window as a picture, against one that was looked at. Times in the status bar are masked. After a wanted change:
/// `UPDATE_SNAPSHOTS=true cargo test --test app looks`, then look at `tests/snapshots`.
#[test]
fn the_window_looks_as_it_did() {
    let home = tempfile::tempdir().unwrap();
    let start = Start { files: vec!["phantom:head:48".to_owned()], backend: Backend::Cpu, home: Home::at(home.path()) };
    let mut h = Harness::builder().with_size([1000.0, 640.0]).with_step_dt(1.0 / 60.0).wgpu().build_ui_state(
        move |ui: &mut egui::Ui, m: &mut Option<Modeller>| {
            m.get_or_insert_with(|| Modeller::new(ui.ctx(), start.clone())).ui(ui);
        },
        None,
    );
    until(&mut h, "the object", |m| m.desk.as_ref().is_some_and(|d| d.object.is_some()));
    settled(&mut h);
    let at = middle(&h);
    drag(&mut h, at, Vec2::new(-40.0, 30.0), PointerButton::Primary, Modifiers::NONE);
    for page in ["Deform", "Look"] {
        h.get_by_label(page).click();
        h.hover_at(Pos2::new(5.0, 5.0));
        h.run_steps(8);
        settled(&mut h);
        // cursors, hovers and tooltips have come to rest
        h.run_steps(90);
        h.mask(egui::Rect::from_min_max(Pos2::new(0.0, 614.0), Pos2::new(1000.0, 640.0)));
        let name = format!("modeller-{}", page.to_lowercase());
        // other drivers round other ways; a misplaced widget is thousands of pixels
        let options = egui_kittest::SnapshotOptions::new().threshold(3.0).max_failed_pixels(400);
        h.snapshot_options(name, &options);
    }
}

/// Random strokes, undo, redo and modes: no panic, no growth beyond the budget. `VOXCLAY_MONKEY_SECONDS` makes it longer.
#[test]
fn a_monkey_breaks_nothing() {
    let seconds = std::env::var("VOXCLAY_MONKEY_SECONDS").ok().and_then(|s| s.parse().ok()).unwrap_or(60);
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:head:40", home.path());
    m(&mut h).settings.undo_megabytes = 1;
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = move |n: u64| {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        seed % n
    };
    let view = h.get_by_label("Main view").rect();
    let started = Instant::now();
    let mut early = None;
    let mut done = 0;
    while started.elapsed() < Duration::from_secs(seconds) {
        let at = view.min + Vec2::new(random(view.width() as u64) as f32, random(view.height() as u64) as f32);
        let way = Vec2::new(random(160) as f32 - 80.0, random(160) as f32 - 80.0);
        match random(16) {
            0..=4 => drag(&mut h, at, way, PointerButton::Primary, Modifiers::NONE),
            5 => drag(&mut h, at, way, PointerButton::Primary, Modifiers::CTRL),
            6 => drag(&mut h, at, way, PointerButton::Middle, Modifiers::NONE),
            7 | 8 => key(&mut h, Modifiers::COMMAND, Key::Z),
            9 => key(&mut h, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z),
            10 => {
                let mode = [Key::Num1, Key::Num2, Key::Num3, Key::Num4][random(4) as usize];
                key(&mut h, Modifiers::NONE, mode);
            }
            11 | 12 => {
                let tools = [Key::G, Key::D, Key::P, Key::I, Key::T, Key::S, Key::L, Key::V, Key::R];
                key(&mut h, Modifiers::NONE, tools[random(tools.len() as u64) as usize]);
            }
            13 => {
                let flags = [Key::X, Key::A, Key::W, Key::M, Key::H, Key::Tab, Key::Home, Key::F12];
                key(&mut h, Modifiers::NONE, flags[random(flags.len() as u64) as usize]);
            }
            14 => std::thread::sleep(Duration::from_millis(random(120))),
            _ => {
                // keep the stack short enough for the software renderer
                if strokes(&h) > 24 {
                    let m = m(&mut h);
                    m.edit(voxclay::scene::Edit::ReplaceAll(voxclay::deform::Stack::default()));
                }
            }
        }
        done += 1;
        if early.is_none() && started.elapsed() > Duration::from_secs(seconds) / 3 {
            early = resident();
        }
    }
    assert!(done > 20, "only {done} actions");
    let history = &m(&mut h).desk.as_ref().unwrap().history;
    assert!(history.bytes() <= 2 << 20, "{} bytes of history", history.bytes());
    if let (Some(early), Some(late)) = (early, resident()) {
        assert!(late < early + (300 << 20), "grew from {early} to {late} bytes in {done} actions");
    }
}

/// Resident bytes of this process, where the system says so.
fn resident() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    text.split_whitespace().nth(1)?.parse::<u64>().ok().map(|pages| pages * 4096)
}

#[test]
fn the_smooth_surface_has_a_look_of_its_own() {
    let home = tempfile::tempdir().unwrap();
    let mut h = modeller("phantom:gaussian:24", home.path());
    h.get_by_label("Look").click();
    settled(&mut h);
    // dim while another mode shows
    h.get_by_label("hollows").scroll_to_me();
    h.run_steps(20);
    h.get_by_label("hollows").click();
    h.run_steps(3);
    let surface = |h: &Bench| h.state().as_ref().unwrap().desk.as_ref().unwrap().history.document().surface.clone();
    assert!(surface(&h).is_plain());
    key(&mut h, Modifiers::NONE, Key::Num4);
    until(&mut h, "the surface", |m| m.shown.as_ref().is_some_and(|s| s.last && s.report.slices == 0));
    let plain = m(&mut h).shown.as_ref().unwrap().image.clone();
    // it follows the hand itself
    let at = middle(&h);
    let press = |pressed| egui::Event::PointerButton {
        pos: at,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    h.event(press(true));
    h.step();
    h.event(egui::Event::PointerMoved(at + Vec2::new(30.0, 10.0)));
    until(&mut h, "the surface under the hand", |m| {
        m.shown.as_ref().is_some_and(|s| s.moving && s.report.slices == 0 && s.image.pixels != plain.pixels)
    });
    h.event(press(false));
    h.step();
    assert_eq!(strokes(&h), 1);
    settled(&mut h);
    key(&mut h, Modifiers::COMMAND, Key::Z);
    until(&mut h, "the surface", |m| m.shown.as_ref().is_some_and(|s| s.last && s.image.pixels == plain.pixels));
    h.get_by_label("hollows").scroll_to_me();
    h.run_steps(5);
    h.get_by_label("hollows").click();
    h.run_steps(3);
    h.get_by_label("mean").click();
    until(&mut h, "its colours", |m| {
        m.shown.as_ref().is_some_and(|s| s.last && s.report.slices == 0 && s.image.pixels != plain.pixels)
    });
    assert!(surface(&h).occlusion && surface(&h).curvature.is_some());
    h.get_by_label("Add a surface").click();
    h.run_steps(3);
    assert_eq!(surface(&h).shells.len(), 1);
    h.get_by_label("Opacity of surface 2");
    key(&mut h, Modifiers::COMMAND, Key::Z);
    assert!(surface(&h).shells.is_empty());
}

//! A series in time: one step is shown at a time, all on the scale of the first, in documents, by commands and in the modeller.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use assert_cmd::Command;
use eframe::egui::{self, Key, Modifiers, PointerButton, Vec2};
use egui_kittest::kittest::Queryable;
use glam::DVec3;
use voxclay::app::Modeller;
use voxclay::evaluate::load::{Data, Workspace};
use voxclay::evaluate::picture::Mode;
use voxclay::evaluate::{open, series};
use voxclay::io::{self, WriteOptions};
use voxclay::scene::{Document, Edit, History, Kept, ProxySource, VolumeSource, read_project, write_project};
use voxclay::volume::{Grid, Samples, Volume};

mod window;
use window::{Bench, key, m, modeller, until};

const N: usize = 24;
const STEPS: usize = 5;
/// Longer than a movement is waited for.
const REST: Duration = Duration::from_millis(150);

/// A soft ball that moves along x and gets brighter.
fn ball(step: usize) -> Vec<u8> {
    let center = DVec3::new(6.0 + 3.0 * step as f64, 12.0, 12.0);
    let value = |i: usize| {
        let p = DVec3::new((i % N) as f64, (i / N % N) as f64, (i / (N * N)) as f64);
        ((6.0 - (p - center).length()).clamp(0.0, 1.0) * (120.0 + 25.0 * step as f64)) as u8
    };
    (0..N * N * N).map(value).collect()
}

/// All steps in one NIfTI file.
fn nifti(folder: &Path) -> PathBuf {
    let mut file = vec![0u8; 352];
    let mut put = |at: usize, bytes: &[u8]| file[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348i32.to_le_bytes());
    for (i, n) in [4, N, N, N, STEPS, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * i, &(n as i16).to_le_bytes());
    }
    put(70, &2i16.to_le_bytes());
    for i in 0..8 {
        put(76 + 4 * i, &1f32.to_le_bytes());
    }
    put(108, &352f32.to_le_bytes());
    put(344, b"n+1\0");
    (0..STEPS).for_each(|t| file.extend(ball(t)));
    let path = folder.join("ball.nii");
    std::fs::write(&path, file).unwrap();
    path
}

fn volume(dims: [usize; 3], samples: Vec<u8>) -> Volume {
    Volume::new(Grid::aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap(), 1, Samples::U8(samples))
}

/// Each step in a file of its own; the last one has another size.
fn numbered(folder: &Path) -> PathBuf {
    let name = |t: usize| folder.join(format!("ball_{t:03}.nrrd"));
    for t in 0..STEPS - 1 {
        io::write_volume(&name(t), &volume([N; 3], ball(t)), &WriteOptions::default()).unwrap();
    }
    io::write_volume(&name(STEPS - 1), &volume([4; 3], vec![1; 64]), &WriteOptions::default()).unwrap();
    name(0)
}

fn samples(volume: &Volume) -> &[u8] {
    volume.samples.bytes()
}

#[test]
fn every_step_is_shown_on_the_scale_of_the_first() {
    let folder = tempfile::tempdir().unwrap();
    let source = VolumeSource::File(nifti(folder.path()));
    assert_eq!(series::steps(&source, Path::new("")).unwrap(), STEPS);
    let first = Data::read(&source, Path::new("")).unwrap();
    let third = Data::read_step(&source, Path::new(""), 3).unwrap();
    assert_eq!(samples(&third.volume), ball(3));
    assert_eq!((third.iso, third.focus, third.basis.range), (first.iso, first.focus, [0.0, 120.0]));
    // what the step holds is known, too
    assert_eq!(third.field.range, [0.0, 195.0]);
    let past = Data::read_step(&source, Path::new(""), STEPS).unwrap_err().to_string();
    assert!(past.contains("ball.nii: there is no step 5; its 5 steps in time are counted from 0 to 4"), "{past}");

    // one workspace goes through them; strokes, camera, window and isovalue stay, a hull follows the values
    let mut document = Document::new(source.clone());
    document.proxy = ProxySource::Auto { iso: None };
    document.transfer = "ct-bone".to_owned();
    let mut workspace = Workspace::new(Path::new(""));
    let middle = |o: &voxclay::evaluate::load::Object| o.mesh.bounds().map(|(lo, hi)| 0.5 * (lo + hi)).unwrap();
    let objects: Vec<_> = [0, 4, 0]
        .map(|step| {
            document.step = step;
            workspace.object(&document).unwrap()
        })
        .into();
    assert_eq!(samples(&objects[1].volume), ball(4));
    assert_eq!(
        (objects[1].window, objects[1].iso, objects[1].focus),
        (objects[0].window, objects[0].iso, objects[0].focus)
    );
    assert_eq!(objects[1].transfer, objects[0].transfer);
    assert!((middle(&objects[1]) - middle(&objects[0]) - DVec3::X * 12.0).length() < 1.0);
    assert_eq!(middle(&objects[2]), middle(&objects[0]));
    // the same from the step itself
    document.step = 4;
    let alone = Workspace::new(Path::new("")).object(&document).unwrap();
    assert_eq!((alone.window, alone.iso, alone.focus), (objects[1].window, objects[1].iso, objects[1].focus));
}

#[test]
fn steps_of_another_size_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let source = VolumeSource::File(numbered(folder.path()));
    assert_eq!(samples(&Data::read_step(&source, Path::new(""), 2).unwrap().volume), ball(2));
    let said = Data::read_step(&source, Path::new(""), 4).unwrap_err().to_string();
    assert!(said.contains("ball_004.nrrd: is 4 x 4 x 4 u8 and step 0 is 24 x 24 x 24 u8"), "{said}");
    // nor elsewhere; rounding of a header is let pass
    for (shift, fits) in [(0.001, true), (0.5, false)] {
        let grid = Grid::aligned([N; 3], DVec3::ONE, DVec3::splat(shift)).unwrap();
        let moved = Volume::new(grid, 1, Samples::U8(ball(1)));
        io::write_volume(&folder.path().join("ball_001.nrrd"), &moved, &WriteOptions::default()).unwrap();
        match Data::read_step(&source, Path::new(""), 1) {
            Ok(data) => assert!(fits && data.volume.grid == data.basis.grid),
            Err(e) => assert!(!fits && e.to_string().contains("lies elsewhere than step 0"), "{e}"),
        }
    }
}

#[test]
fn a_project_keeps_its_step() {
    let folder = tempfile::tempdir().unwrap();
    let source = VolumeSource::File(nifti(folder.path()));
    let mut history = History::new(Document::new(source.clone()), 1 << 20);
    for step in [1, 2, 3] {
        history.apply(Edit::SetStep(step)).unwrap();
    }
    assert_eq!((history.steps().len(), history.document().step), (2, 3), "a slider being dragged is one step");
    let path = folder.path().join("a.voxclay");
    write_project(&path, history.document(), &Kept::default()).unwrap();
    assert_eq!(read_project(&path).unwrap().document, **history.document());
    assert!(history.undo() && history.document().step == 0);
    // the first is not written, so that older programs read it; old projects show the first
    let text = serde_json::to_string(&**history.document()).unwrap();
    assert!(!text.contains("step"), "{text}");
    std::fs::write(&path, r#"{ "voxclay": 1, "document": { "volume": { "file": "ball.nii" } } }"#).unwrap();
    assert_eq!(read_project(&path).unwrap().document.step, 0);
    let (document, base) = open(path.to_str().unwrap()).unwrap();
    assert_eq!(samples(&Workspace::new(&base).object(&document).unwrap().volume), ball(0));
    // a step that is embedded is a volume of its own
    let data = Data::read_step(&source, Path::new(""), 3).unwrap();
    let kept = Kept { embed: Some(&data.volume), ..Kept::default() };
    write_project(&path, &Document { step: 3, ..document }, &kept).unwrap();
    let (document, base) = open(path.to_str().unwrap()).unwrap();
    assert_eq!(document.step, 0);
    assert_eq!(samples(&Workspace::new(&base).object(&document).unwrap().volume), ball(3));
}

fn voxclay(folder: &Path, line: &str) -> (Option<i32>, String, String) {
    let words: Vec<&str> = line.split_whitespace().collect();
    let out = Command::cargo_bin("voxclay").unwrap().current_dir(folder).args(words).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (out.status.code(), text(&out.stdout), text(&out.stderr))
}

#[test]
fn commands_take_a_step() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    nifti(dir);
    numbered(dir);
    let run = |line: &str| {
        let (code, out, said) = voxclay(dir, line);
        assert_eq!(code, Some(0), "{line}: {said}");
        (out, said)
    };
    let (facts, _) = run("info ball.nii ball_000.nrrd phantom:sphere:16 --json");
    let facts: serde_json::Value = serde_json::from_str(&facts).unwrap();
    let steps: Vec<u64> = facts["files"].as_array().unwrap().iter().map(|f| f["steps"].as_u64().unwrap()).collect();
    assert_eq!(steps, [5, 5, 1]);
    assert!(run("info ball.nii").0.contains("5 in time, 0 to 4"));
    assert!(!run("info phantom:sphere:16").0.contains("in time"));

    // extracting
    assert!(run("convert ball.nii --step 3 three.nrrd").1.is_empty());
    assert_eq!(samples(&io::read_volume(&dir.join("three.nrrd")).unwrap()), ball(3));
    assert!(run("convert ball.nii zero.nrrd").1.contains("of its 5 steps in time the first is written"));
    assert_eq!(samples(&io::read_volume(&dir.join("zero.nrrd")).unwrap()), ball(0));
    run("convert ball_000.nrrd --step 2 two.nrrd");
    assert_eq!(samples(&io::read_volume(&dir.join("two.nrrd")).unwrap()), ball(2));
    run("export ball.nii --step 4 --same-grid -o four.nrrd");
    assert_eq!(samples(&io::read_volume(&dir.join("four.nrrd")).unwrap()), ball(4));
    let middle = |step: usize| {
        run(&format!("surface ball.nii --step {step} --iso 60 --method cells -o ball.obj"));
        let (lo, hi) = io::read_surface(&dir.join("ball.obj")).unwrap().bounds().unwrap();
        0.5 * (lo + hi).x
    };
    assert!((middle(2) - 12.0).abs() < 0.1 && (middle(0) - 6.0).abs() < 0.1);

    // a warp that moves nothing
    let corners: String =
        (0..8).map(|i| [1, 2, 4].map(|bit| if i & bit == 0 { "-0.5" } else { "23.5" }).join(" ") + " 0\n").collect();
    let tets = ["1 2 4 8", "1 2 6 8", "1 3 4 8", "1 3 7 8", "1 5 6 8", "1 5 7 8"].map(|t| format!("{t} 0\n")).concat();
    let mesh = format!("MeshVersionFormatted 2\nDimension 3\nVertices\n8\n{corners}Tetrahedra\n6\n{tets}End\n");
    std::fs::write(dir.join("box.mesh"), mesh).unwrap();
    let warp = "--tets box.mesh --deformed box.mesh --units voxel --backend cpu";
    for step in [0, 3] {
        run(&format!("warp ball.nii --step {step} {warp} -o warped.nrrd"));
        assert_eq!(samples(&io::read_volume(&dir.join("warped.nrrd")).unwrap()), ball(step));
    }
    let compared = |step: usize| {
        run(&format!("compare ball.nii --step {step} --modes export --size 32x32 --iso 60 -o compared{step}"));
        let files = std::fs::read_dir(dir.join(format!("compared{step}"))).unwrap().map(|f| f.unwrap().path());
        let mut pictures: Vec<_> = files.filter(|f| f.extension().is_some_and(|e| e == "png")).collect();
        pictures.sort();
        pictures.into_iter().map(|f| std::fs::read(f).unwrap()).collect::<Vec<_>>()
    };
    let (first, later) = (compared(0), compared(3));
    assert!(!first.is_empty() && first.len() == later.len() && first != later);

    // pictures of all steps are those of each
    let look = "--backend cpu --size 48x48 --iso 60";
    let (all, _) = run(&format!("render ball.nii --step all {look} -o all_##.png --json"));
    let all: serde_json::Value = serde_json::from_str(&all).unwrap();
    assert_eq!((all["steps"].as_u64(), all["files"].as_array().unwrap().len()), (Some(5), 5));
    let picture = |name: &str| std::fs::read(dir.join(name)).unwrap();
    for step in [0, 3] {
        run(&format!("render ball.nii --step {step} {look} -o one.png"));
        assert_eq!(picture("one.png"), picture(&format!("all_0{step}.png")));
    }
    assert_ne!(picture("all_00.png"), picture("all_03.png"));

    for (line, words) in [
        (
            "render ball.nii --step 5 -o p.png",
            "ball.nii: there is no step 5; its 5 steps in time are counted from 0 to 4",
        ),
        ("convert ball.nii --step 5 p.nrrd", "counted from 0 to 4"),
        ("surface ball.nii --step 9 -o p.obj", "there is no step 9"),
        ("export phantom:sphere:16 --step 1 -o p.nrrd", "its only step is 0"),
        ("compare ball.nii --step 6", "there is no step 6"),
        ("warp ball.nii --step 8 --tets box.mesh --deformed box.mesh -o p.nrrd", "there is no step 8"),
        ("render ball_000.nrrd --step 4 -o p.png", "is 4 x 4 x 4 u8 and step 0 is 24 x 24 x 24 u8"),
        ("render ball.nii --step all -o p.png", "needs a name with #"),
        ("convert ball.obj --step 1 p.stl", "--step goes with volumes only"),
    ] {
        let (code, out, said) = voxclay(dir, line);
        assert_eq!((code, out.as_str()), (Some(1), ""), "{line}: {said}");
        assert!(said.starts_with("voxclay: ") && said.lines().count() == 1 && said.contains(words), "{line}: {said}");
        assert!(!dir.join("p.png").exists() && !dir.join("p.nrrd").exists() && !dir.join("p.obj").exists());
    }
    assert_eq!(voxclay(dir, "render ball.nii --step last -o p.png").0, Some(2));
}

/// On a series, with the panel that has its slider.
fn on_series(path: &Path, home: &Path) -> Bench {
    let mut h = modeller(&path.to_string_lossy(), home);
    h.get_by_label("Object").click();
    h.run_steps(3);
    h
}

/// The step that the object in view is of.
fn in_view(m: &Modeller) -> Option<usize> {
    let (document, object) = m.desk.as_ref()?.object.as_ref()?;
    let step = document.step;
    assert!(samples(&object.volume) == ball(step), "not the samples of step {step}");
    Some(step)
}

fn settled(h: &mut Bench, step: usize) {
    until(h, "the step", |m| in_view(m) == Some(step));
    let since = Instant::now();
    until(h, "its full picture", |m| m.shown.as_ref().is_some_and(|s| s.last) && since.elapsed() > REST);
}

#[test]
fn the_modeller_goes_through_a_series() {
    let home = tempfile::tempdir().unwrap();
    let mut h = on_series(&nifti(home.path()), home.path());
    settled(&mut h, 0);
    let window = |m: &Modeller| m.desk.as_ref().unwrap().object.as_ref().map(|(_, o)| (o.window, o.iso)).unwrap();
    let shown = window(m(&mut h));
    let before = m(&mut h).shown.as_ref().unwrap().image.clone();
    // the slider, by its name
    let slider = h.get_by_role_and_label(egui::accesskit::Role::Slider, "Step").rect();
    let press = |pressed, pos| egui::Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    let from = slider.left_center() + Vec2::new(8.0, 0.0);
    h.hover_at(from);
    h.step();
    h.event(press(true, from));
    h.step();
    for i in 1..=6 {
        h.event(egui::Event::PointerMoved(from + Vec2::new(50.0 * i as f32, 0.0)));
        h.step();
    }
    h.event(press(false, from + Vec2::new(300.0, 0.0)));
    settled(&mut h, STEPS - 1);
    until(&mut h, "another picture", |m| m.shown.as_ref().is_some_and(|s| s.last && s.image.pixels != before.pixels));
    assert_eq!(window(m(&mut h)), shown, "window and isovalue stay");
    // a step of the history, one for the whole drag
    let steps = |h: &mut Bench| m(h).desk.as_ref().unwrap().history.steps().len();
    assert_eq!(steps(&mut h), 2);
    key(&mut h, Modifiers::COMMAND, Key::Z);
    settled(&mut h, 0);
    until(&mut h, "the picture from before", |m| m.shown.as_ref().is_some_and(|s| s.image.pixels == before.pixels));

    // keys, round the ends
    for (k, step) in
        [(Key::ArrowRight, 1), (Key::ArrowRight, 2), (Key::ArrowLeft, 1), (Key::ArrowLeft, 0), (Key::ArrowLeft, 4)]
    {
        key(&mut h, Modifiers::NONE, k);
        settled(&mut h, step);
    }
    // what was seen is in memory: it is there in the same pass
    m(&mut h).show_step(1);
    h.step();
    assert_eq!(m(&mut h).desk.as_ref().unwrap().data.step, 1);

    // the smooth surface follows, at the same isovalue
    settled(&mut h, 1);
    key(&mut h, Modifiers::NONE, Key::Num4);
    assert_eq!(m(&mut h).view.mode, Mode::Spline);
    let spline = |m: &Modeller| m.shown.as_ref().filter(|s| s.last && s.report.slices == 0).map(|s| s.image.clone());
    until(&mut h, "the surface", |m| spline(m).is_some());
    let first = spline(m(&mut h)).unwrap();
    h.get_by_label("The next step (Right)").click();
    until(&mut h, "its next step", |m| in_view(m) == Some(2) && spline(m).is_some_and(|s| s.pixels != first.pixels));
    assert_eq!(window(m(&mut h)), shown);

    // playing comes round; strokes stay, and undoing ends it
    key(&mut h, Modifiers::NONE, Key::Num1);
    m(&mut h).player.rate = 60.0;
    key(&mut h, Modifiers::NONE, Key::Space);
    assert!(m(&mut h).player.playing);
    for step in [4, 0, 1, 3] {
        until(&mut h, "the steps in turn", |m| in_view(m) == Some(step));
    }
    // each step of a smooth surface is one
    key(&mut h, Modifiers::NONE, Key::Num4);
    for step in [2, 4] {
        until(&mut h, "its surface", |m| m.player.playing && in_view(m) == Some(step) && spline(m).is_some());
    }
    h.get_by_label("Pause (Space)").click();
    h.run_steps(3);
    assert!(!m(&mut h).player.playing);
    h.get_by_label("Play (Space)");
}

#[test]
fn a_step_that_does_not_fit_leaves_the_picture() {
    let home = tempfile::tempdir().unwrap();
    let mut h = on_series(&numbered(home.path()), home.path());
    settled(&mut h, 0);
    m(&mut h).show_step(3);
    settled(&mut h, 3);
    m(&mut h).show_step(4);
    until(&mut h, "a sentence", |m| m.notices.iter().any(|n| n.error && n.text.contains("and step 0 is 24 x 24 x 24")));
    h.run_steps(5);
    let desk = m(&mut h).desk.as_ref().unwrap();
    assert_eq!((desk.data.step, desk.history.document().step), (3, 3));
    assert_eq!(in_view(m(&mut h)), Some(3));
    assert_eq!(m(&mut h).notices.iter().filter(|n| n.error).count(), 1);
    // a stroke while a step is on its way goes on what is there, and stays
    let data = m(&mut h).desk.as_ref().unwrap().data.clone();
    m(&mut h).show_step(1);
    let brush = voxclay::deform::DisplacementVolume::from_drag(DVec3::splat(12.0), DVec3::X, 6.0).unwrap();
    let stroke = voxclay::deform::Deformation::new("pull", voxclay::deform::Deformer::Displacement(brush));
    m(&mut h).edit(Edit::Push(vec![stroke]));
    settled(&mut h, 1);
    let desk = m(&mut h).desk.as_ref().unwrap();
    assert!(!Arc::ptr_eq(&desk.data, &data) && desk.object.as_ref().unwrap().1.stack.items.len() == 1);
}

#[test]
fn one_volume_has_no_slider() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("one.nrrd");
    io::write_volume(&path, &volume([N; 3], ball(0)), &WriteOptions::default()).unwrap();
    let mut h = on_series(&path, home.path());
    assert!(h.query_by_label("Step").is_none() && h.query_by_label("Play (Space)").is_none());
    key(&mut h, Modifiers::NONE, Key::Space);
    assert!(!m(&mut h).player.playing);
}

/// A series that has become shorter since a project was saved opens at its first step.
#[test]
fn a_project_of_a_lost_step_opens() {
    let home = tempfile::tempdir().unwrap();
    nifti(home.path());
    let path = home.path().join("a.voxclay");
    std::fs::write(&path, r#"{ "voxclay": 1, "document": { "volume": { "file": "ball.nii" }, "step": 7 } }"#).unwrap();
    let mut h = on_series(&path, home.path());
    assert_eq!(in_view(m(&mut h)), Some(0));
    assert!(m(&mut h).notices.iter().any(|n| n.text.contains("there is no step 7")));
}

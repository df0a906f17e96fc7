//! The object on a turntable, as a row of pictures, a GIF, or a film where ffmpeg is there to make one.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::evaluate::load::Object;
use crate::evaluate::picture::{Renderer, ViewOptions};
use crate::io;
use crate::render::{Look, Picture};
use crate::scene::CameraSpec;

/// What a turntable makes.
#[derive(Debug, Clone)]
pub struct Turntable {
    /// `NAME.gif`, `NAME.mp4`, or `NAME.png` for `NAME-000.png` and so on.
    pub path: PathBuf,
    pub frames: usize,
    /// Of a whole turn.
    pub seconds: f64,
}

/// Draws all frames and writes them. What was begun is removed if it is stopped.
pub fn make(
    object: &Object,
    camera: &CameraSpec,
    look: &Look,
    options: &ViewOptions,
    table: &Turntable,
    report: &dyn Fn(f64) -> ControlFlow<()>,
) -> Result<PathBuf, String> {
    let kind = table.path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if !matches!(kind.as_str(), "gif" | "mp4" | "png") {
        return Err(format!("{}: a turntable's name must end in .gif, .mp4 or .png", table.path.display()));
    }
    let frames = table.frames.clamp(2, 3600);
    let mut renderer = Renderer::new(options.backend).map_err(|e| e.to_string())?;
    let mut next = |i: usize| -> Result<Picture, String> {
        if report(i as f64 / frames as f64).is_break() {
            return Err("stopped".to_owned());
        }
        let turned = CameraSpec { yaw: camera.yaw + 360.0 * i as f64 / frames as f64, ..*camera };
        let (picture, _) =
            renderer.picture(object, &object.camera(&turned), look, options).map_err(|e| e.to_string())?;
        Ok(picture)
    };
    match kind.as_str() {
        "gif" => gif(table, frames, &mut next)?,
        "mp4" => {
            let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
            row(&folder.path().join("frame.png"), frames, &mut next)?;
            film(folder.path(), table, frames)?;
        }
        _ => row(&table.path, frames, &mut next)?,
    }
    Ok(table.path.clone())
}

fn row(path: &Path, frames: usize, next: &mut dyn FnMut(usize) -> Result<Picture, String>) -> Result<(), String> {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    for i in 0..frames {
        let png = next(i)?.png().map_err(|e| e.to_string())?;
        let file = path.with_file_name(format!("{stem}-{i:03}.png"));
        io::write_atomic(&file, |w| std::io::Write::write_all(w, &png)).map_err(|e| e.to_string())?;
    }
    Ok(())
}

fn gif(table: &Turntable, frames: usize, next: &mut dyn FnMut(usize) -> Result<Picture, String>) -> Result<(), String> {
    let mut bytes = Vec::new();
    let mut encoder: Option<gif::Encoder<&mut Vec<u8>>> = None;
    let mut store = Some(&mut bytes);
    // hundredths of a second
    let delay = (100.0 * table.seconds / frames as f64).round().clamp(2.0, 1000.0) as u16;
    for i in 0..frames {
        let mut picture = next(i)?;
        let (Ok(w), Ok(h)) = (u16::try_from(picture.width), u16::try_from(picture.height)) else {
            return Err("a GIF has at most 65535 pixels along a side".to_owned());
        };
        if let Some(store) = store.take() {
            let mut e = gif::Encoder::new(store, w, h, &[]).map_err(|e| e.to_string())?;
            e.set_repeat(gif::Repeat::Infinite).map_err(|e| e.to_string())?;
            encoder = Some(e);
        }
        let mut frame = gif::Frame::from_rgba_speed(w, h, picture.pixels.as_flattened_mut(), 10);
        frame.delay = delay;
        if let Some(e) = &mut encoder {
            e.write_frame(&frame).map_err(|e| e.to_string())?;
        }
    }
    drop(encoder);
    io::write_atomic(&table.path, |w| std::io::Write::write_all(w, &bytes)).map_err(|e| e.to_string())
}

fn film(folder: &Path, table: &Turntable, frames: usize) -> Result<(), String> {
    let rate = format!("{:.4}", frames as f64 / table.seconds.max(0.1));
    let made = folder.join("film.mp4");
    let status = Command::new("ffmpeg")
        .args(["-y", "-loglevel", "error", "-framerate", &rate, "-i"])
        .arg(folder.join("frame-%03d.png"))
        // even sides, as the common pixel format needs
        .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"])
        .arg(&made)
        .status();
    match status {
        Ok(s) if s.success() => {
            let bytes = std::fs::read(&made).map_err(|e| e.to_string())?;
            io::write_atomic(&table.path, |w| std::io::Write::write_all(w, &bytes)).map_err(|e| e.to_string())
        }
        Ok(_) => Err("ffmpeg could not make the film; a .gif or .png needs no ffmpeg".to_owned()),
        Err(_) => Err("ffmpeg is not installed; a turntable as .gif or .png needs none".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::picture::{Backend, Mode, Refinement};

    #[test]
    fn a_turn_as_gif_and_as_pictures() {
        let folder = tempfile::tempdir().unwrap();
        let (document, base) = crate::evaluate::open("phantom:orange:16").unwrap();
        let object = crate::evaluate::load::load(&document, &base).unwrap();
        let options = ViewOptions {
            size: (24, 20),
            slices: Some(12),
            mode: Mode::Slicing,
            refinement: Refinement::Depth(1),
            backend: Backend::Cpu,
            transparent: false,
            corrections: None,
        };
        let go = |name: &str| {
            let table = Turntable { path: folder.path().join(name), frames: 3, seconds: 1.0 };
            make(&object, &document.camera, &Look::default(), &options, &table, &|_| ControlFlow::Continue(()))
        };
        let file = std::fs::File::open(go("t.gif").unwrap()).unwrap();
        let mut gif = gif::DecodeOptions::new().read_info(file).unwrap();
        assert_eq!((gif.width(), gif.height()), (24, 20));
        let mut count = 0;
        while gif.read_next_frame().unwrap().is_some() {
            count += 1;
        }
        assert_eq!(count, 3);
        go("p.png").unwrap();
        assert!(folder.path().join("p-002.png").is_file());
        assert!(go("t.avi").unwrap_err().contains(".gif"));
    }
}

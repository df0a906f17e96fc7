//! Steps of a series in time: the thread that reads them, what is kept of them, and playing.
//!
//! The document says which step is to be seen; what is at hand follows as soon as it is read, and until then the step before
//! stays. Only the newest wish counts. Steps that were seen and those that come next are kept in memory.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use eframe::egui;

use super::guard::guarded;
use super::mailbox::Mailbox;
use super::modeller::Modeller;
use super::state::Doing;
use crate::evaluate::load::Data;
use crate::evaluate::series::Basis;
use crate::render::Texels;
use crate::scene::Edit;

/// Bytes of all steps that are kept.
const BUDGET: usize = 1 << 30;
/// Steps that are read before they are wanted.
const AHEAD: usize = 2;

/// A step to be read.
#[derive(Debug, Clone)]
struct Wish {
    basis: Arc<Basis>,
    step: usize,
}

/// A step that was read, or why it could not be.
#[derive(Debug)]
pub struct Arrival {
    basis: Arc<Basis>,
    step: usize,
    data: Result<Arc<Data>, String>,
}

#[derive(Default)]
struct Shared {
    wishes: Mailbox<Wish>,
    kept: Mutex<Kept>,
}

impl Shared {
    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Steps in memory, those used last at the end.
#[derive(Default)]
struct Kept(Vec<Arc<Data>>);

impl Kept {
    fn get(&mut self, basis: &Arc<Basis>, step: usize) -> Option<Arc<Data>> {
        let at = self.0.iter().position(|d| d.step == step && Arc::ptr_eq(&d.basis, basis))?;
        let data = self.0.remove(at);
        self.0.push(data.clone());
        Some(data)
    }

    /// Keeps a step; what is of another series goes, and what was not used for longest if all together need more than
    /// `budget` bytes.
    fn put(&mut self, data: Arc<Data>, budget: usize) {
        self.0.retain(|d| d.step != data.step && Arc::ptr_eq(&d.basis, &data.basis));
        self.0.push(data);
        let mut sum: usize = self.0.iter().map(|d| bytes(d)).sum();
        while sum > budget && self.0.len() > 1 {
            sum -= bytes(&self.0.remove(0));
        }
    }
}

/// What a step takes in memory, but for small things.
fn bytes(data: &Data) -> usize {
    let texels = match &data.field.texels {
        Texels::Shared(_) => 0,
        Texels::F32(t) => size_of_val(t.as_slice()),
    };
    data.volume.samples.bytes().len() + texels
}

/// The window's end of the thread that reads.
pub struct Reader {
    shared: Arc<Shared>,
    arrivals: Receiver<Arrival>,
}

impl Reader {
    /// Starts the thread; `ctx` is woken whenever a step has come.
    pub fn new(ctx: &egui::Context) -> Self {
        let shared = Arc::new(Shared::default());
        let (send, arrivals) = channel();
        let (theirs, ctx) = (shared.clone(), ctx.clone());
        // where no thread can be started, the step at hand stays
        let _ = std::thread::Builder::new().name("steps".to_owned()).spawn(move || run(&theirs, &send, &ctx));
        Self { shared, arrivals }
    }

    /// Asks for a step in place of what was asked for before. What is in memory is returned at once.
    fn want(&self, wish: Wish) -> Option<Arc<Data>> {
        let found = self.shared.kept().get(&wish.basis, wish.step);
        // also where it is there: the thread reads on
        self.shared.wishes.put(wish);
        found
    }

    fn keep(&self, data: Arc<Data>) {
        self.shared.kept().put(data, BUDGET);
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        // the thread is not waited for: a step of a large file may take long
        self.shared.wishes.close();
    }
}

fn run(shared: &Shared, send: &Sender<Arrival>, ctx: &egui::Context) {
    while let Some(wish) = shared.wishes.wait() {
        let data = read(shared, &wish, wish.step);
        let room = data.as_ref().map_or(0, |d| BUDGET / bytes(d).max(1));
        let _ = send.send(Arrival { basis: wish.basis.clone(), step: wish.step, data });
        ctx.request_repaint();
        // what cannot be read is said when it is wanted
        for ahead in 1..=AHEAD.min(room.saturating_sub(1)) {
            if shared.wishes.calls() {
                break;
            }
            let _ = read(shared, &wish, (wish.step + ahead) % wish.basis.steps);
        }
    }
}

/// A step from memory or from its file.
fn read(shared: &Shared, wish: &Wish, step: usize) -> Result<Arc<Data>, String> {
    if let Some(data) = shared.kept().get(&wish.basis, step) {
        return Ok(data);
    }
    let read = || Data::at_step(&wish.basis, step).map_err(|e| e.to_string());
    let data = guarded(read).map_err(|what| format!("step {step} could not be read: {what}"))??;
    let data = Arc::new(data);
    shared.kept().put(data.clone(), BUDGET);
    Ok(data)
}

/// How the steps of a series are being shown.
#[derive(Debug, Clone, Copy)]
pub struct Player {
    pub playing: bool,
    /// Steps in a second, at most.
    pub rate: f32,
    /// What was asked of the reader last.
    asked: Option<usize>,
    /// When the step at hand came, and the first picture of it that was asked for.
    came: Instant,
    pub(super) picture: u64,
}

impl Default for Player {
    fn default() -> Self {
        Self { playing: false, rate: 8.0, asked: None, came: Instant::now(), picture: 0 }
    }
}

impl Modeller {
    /// Steps of the series that is open; 1 if it is none.
    pub fn steps(&self) -> usize {
        self.desk.as_ref().map_or(1, |d| d.data.basis.steps)
    }

    /// Shows a step, counted from 0; the last one if there are not so many.
    pub fn show_step(&mut self, step: usize) {
        self.edit(Edit::SetStep(step.min(self.steps() - 1)));
    }

    /// So many steps on, or back; at the ends round to the other.
    pub fn move_step(&mut self, by: isize) {
        let Some(desk) = &self.desk else { return };
        let now = desk.history.document().step as isize;
        self.show_step((now + by).rem_euclid(self.steps() as isize) as usize);
    }

    /// Brings the step that the document shows to the desk, and goes on where steps are being played.
    pub(super) fn follow_step(&mut self, ctx: &egui::Context) {
        while let Ok(arrival) = self.reader.arrivals.try_recv() {
            let Some(desk) = &self.desk else { continue };
            let wanted = desk.history.document().step == arrival.step && desk.data.step != arrival.step;
            if !wanted || !Arc::ptr_eq(&desk.data.basis, &arrival.basis) {
                continue;
            }
            match arrival.data {
                Ok(data) => self.put_step(data),
                Err(what) => {
                    let back = desk.data.step;
                    self.player.playing = false;
                    self.tell(what, true);
                    self.edit(Edit::SetStep(back));
                }
            }
        }
        self.play(ctx);
        let Some(desk) = &self.desk else { return };
        let step = desk.history.document().step;
        if step == desk.data.step {
            self.player.asked = None;
        } else if self.player.asked != Some(step) {
            let wish = Wish { basis: desk.data.basis.clone(), step };
            self.player.asked = Some(step);
            self.reader.keep(desk.data.clone());
            if let Some(data) = self.reader.want(wish) {
                self.put_step(data);
            }
        }
    }

    fn put_step(&mut self, data: Arc<Data>) {
        let Some(desk) = &mut self.desk else { return };
        desk.data = data;
        // they are of the values of another step
        (desk.mask, desk.joint) = (None, None);
        self.player.came = Instant::now();
        self.player.picture = u64::MAX;
    }

    /// The next step, once this one was seen for its time.
    fn play(&mut self, ctx: &egui::Context) {
        let Some(desk) = &self.desk else { return };
        if !self.player.playing || desk.data.basis.steps < 2 {
            self.player.playing = false;
            return;
        }
        let seen = desk.data.step == desk.history.document().step
            && self.shown.as_ref().is_some_and(|s| s.generation >= self.player.picture);
        // the arrival of what is missing wakes the window, and the end of a stroke does
        if !seen || desk.preview.is_some() || !matches!(self.doing, Doing::Nothing | Doing::Orbit | Doing::Pan) {
            return;
        }
        let time = Duration::from_secs_f32(1.0 / self.player.rate.clamp(0.1, 60.0));
        match time.checked_sub(self.player.came.elapsed()).filter(|left| !left.is_zero()) {
            Some(left) => ctx.request_repaint_after(left),
            None => self.move_step(1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Grid, Samples, Volume};
    use glam::DVec3;

    #[test]
    fn what_was_not_used_for_longest_goes_first() {
        let grid = Grid::aligned([10, 10, 10], DVec3::ONE, DVec3::ZERO).unwrap();
        let first = Data::new(Volume::new(grid, 1, Samples::U8(vec![7; 1000])), None);
        let step = |step: usize| Arc::new(Data { step, ..first.clone() });
        let basis = first.basis.clone();
        let mut kept = Kept::default();
        for n in 0..3 {
            kept.put(step(n), 3000);
        }
        assert!(kept.get(&basis, 0).is_some());
        kept.put(step(3), 3000);
        let there: Vec<bool> = (0..4).map(|n| kept.get(&basis, n).is_some()).collect();
        assert_eq!(there, [true, false, true, true]);
        // one always stays, however large
        kept.put(step(4), 10);
        assert_eq!(kept.0.len(), 1);
        assert!(kept.get(&basis, 4).is_some());
        // another series takes the place of all
        let other = Data::new(Volume::new(grid, 1, Samples::U8(vec![9; 1000])), None);
        kept.put(Arc::new(other), 3000);
        assert_eq!(kept.0.len(), 1);
        assert!(kept.get(&basis, 4).is_none());
    }
}

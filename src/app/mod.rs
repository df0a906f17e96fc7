//! L5: the modeller: a window in which a volume is sculpted by hand.
//!
//! # Theory
//!
//! The window holds no geometry. It turns what the user does into [`Edit`](crate::scene::Edit)s of a small document with a
//! [`History`](crate::scene::History), asks the [`worker`] for pictures of it, and shows what comes: coarse while the
//! hand moves, finer when it rests. Only the newest wish counts; answers carry a generation. Long work is a [task](tasks)
//! with a line in the status bar; the steps of a series in time come from a reader of their own. So a pass of the interface
//! never waits: for the device, the disk or a lock that is held long.
//!
//! # Practice
//!
//! [`Modeller`] is the whole program but for its window, so that tests can drive it; [`run`] opens the window. The tools are
//! pure ([`sculpt`], [`navigate`]); panels read the modeller and push edits.

mod asking;
mod cube;
mod desk;
mod fonts;
mod gizmo;
mod grips;
mod guard;
mod heat;
mod keys;
mod mailbox;
mod menu;
mod modeller;
pub mod navigate;
mod news;
mod overlay;
mod pace;
mod panels;
mod pass;
mod place;
mod questions;
pub mod recovery;
pub mod sculpt;
pub mod settings;
pub mod shown;
mod slices;
mod soften;
mod state;
mod steps;
pub mod tasks;
mod theme;
pub mod trace;
mod turntable;
mod view;
mod window;
pub mod worker;

pub use desk::Desk;
pub use modeller::Modeller;
pub use state::{After, Start};
pub use window::run;

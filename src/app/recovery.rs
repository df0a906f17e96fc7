//! Work put aside: what was not saved survives a crash.
//!
//! While a document is dirty, it is written to the recovery folder under the process's number, after every short rest. Saving
//! or closing removes the file. At the start, files of processes that are gone are offered.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};

use serde::{Deserialize, Serialize};

use super::settings::Home;
use crate::scene::Document;

/// Unsaved work with what is needed to go on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Aside {
    /// The process that worked on it.
    pub process: u32,
    /// The project file it belongs to, if it had one.
    pub path: Option<PathBuf>,
    /// Folder that relative paths start from.
    pub base: PathBuf,
    pub document: Document,
}

enum Order {
    Keep(Box<Aside>),
    Drop,
}

/// Writes in the background.
#[derive(Debug)]
pub struct Recovery {
    orders: Sender<Order>,
    worker: Option<std::thread::JoinHandle<()>>,
}

impl Recovery {
    pub fn new(home: &Home) -> Self {
        let (orders, inbox) = channel();
        let path = file(home, std::process::id());
        let worker = std::thread::Builder::new().name("recovery".to_owned()).spawn(move || {
            while let Ok(order) = inbox.recv() {
                // a disk that fails here must not disturb the work; saving will say so
                match order {
                    Order::Keep(aside) => {
                        if let (Ok(text), Some(folder)) = (serde_json::to_vec(&*aside), path.parent())
                            && std::fs::create_dir_all(folder).is_ok()
                        {
                            let _ = crate::io::write_atomic(&path, |w| std::io::Write::write_all(w, &text));
                        }
                    }
                    Order::Drop => {
                        let _ = std::fs::remove_file(&path);
                    }
                }
            }
        });
        Self { orders, worker: worker.ok() }
    }

    pub fn keep(&self, document: &Arc<Document>, path: Option<&Path>, base: &Path) {
        let _ = self.orders.send(Order::Keep(Box::new(Aside {
            process: std::process::id(),
            path: path.map(Path::to_owned),
            base: std::path::absolute(base).unwrap_or_else(|_| base.to_owned()),
            document: (**document).clone(),
        })));
    }

    /// There is nothing to lose any more.
    pub fn clear(&self) {
        let _ = self.orders.send(Order::Drop);
    }
}

impl Drop for Recovery {
    fn drop(&mut self) {
        // closes the channel; what was ordered is still done
        self.orders = channel().0;
        if let Some(worker) = self.worker.take() {
            let _ = worker.join();
        }
    }
}

/// Work of processes that are gone, the newest first, with their files.
pub fn found(home: &Home) -> Vec<(PathBuf, Aside)> {
    let Ok(entries) = std::fs::read_dir(home.recovery()) else { return Vec::new() };
    let mut found: Vec<_> = entries
        .flatten()
        .map(|e| e.path())
        .filter(|p| p.extension().is_some_and(|e| e == "json"))
        .filter_map(|p| {
            let aside: Aside = serde_json::from_slice(&std::fs::read(&p).ok()?).ok()?;
            let time = std::fs::metadata(&p).and_then(|m| m.modified()).ok();
            (!is_running(aside.process)).then_some((time, p, aside))
        })
        .collect();
    found.sort_by_key(|(time, ..)| std::cmp::Reverse(*time));
    found.into_iter().map(|(_, path, aside)| (path, aside)).collect()
}

fn file(home: &Home, process: u32) -> PathBuf {
    home.recovery().join(format!("{process}.json"))
}

/// Whether another modeller has this number. Where the system does not say, only our own is known.
fn is_running(process: u32) -> bool {
    if process == std::process::id() {
        return true;
    }
    // number (name) state ...; one that was killed may wait to be buried by its parent
    let Ok(stat) = std::fs::read_to_string(format!("/proc/{process}/stat")) else { return false };
    let Some((name, rest)) = stat.rsplit_once(')') else { return false };
    let dead = matches!(rest.trim_start().chars().next(), Some('Z' | 'X') | None);
    !dead && name.contains("(voxclay")
}

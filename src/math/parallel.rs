//! Parallel loops over pieces of work.
//!
//! Iterator chains of rayon are compiled anew for each closure and type they meet; a loop for eight sample types costs
//! seconds of build time. Here the loop is compiled once and calls its body through a reference, which costs nothing where
//! a piece is a row, a layer or a block.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Calls `work` once for each index below `count`. Each thread takes the next one when it is done with one: pieces may cost
/// very different time, and rayon's halves of halves would leave threads without work at the end.
pub fn each(count: usize, work: &(dyn Fn(usize) + Sync)) {
    let next = AtomicUsize::new(0);
    rayon::scope(|scope| {
        for _ in 0..count.min(rayon::current_num_threads()) {
            scope.spawn(|_| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= count {
                        break;
                    }
                    work(index);
                }
            });
        }
    });
}

/// The results of `work` for each index below `count`, in order.
pub fn map<R: Send>(count: usize, work: &(dyn Fn(usize) -> R + Sync)) -> Vec<R> {
    let results: Vec<Mutex<Option<R>>> = (0..count).map(|_| Mutex::new(None)).collect();
    each(count, &|i| {
        let result = work(i);
        *results[i].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
    });
    results.into_iter().filter_map(|r| r.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

/// Gives `work` each piece of `len` items (the last may be shorter) together with its number; returns the results in order.
///
/// # Panics
/// If `len` is 0.
pub fn chunks_mut<T: Send, R: Send>(
    items: &mut [T],
    len: usize,
    work: &(dyn Fn(usize, &mut [T]) -> R + Sync),
) -> Vec<R> {
    let pieces: Vec<Mutex<&mut [T]>> = items.chunks_mut(len).map(Mutex::new).collect();
    map(pieces.len(), &|i| work(i, &mut pieces[i].lock().unwrap_or_else(PoisonError::into_inner)))
}

/// Scratch memory that passes from one piece of work to the next: as many are made as run at the same time.
#[derive(Debug)]
pub struct Pool<W> {
    idle: Mutex<Vec<W>>,
}

impl<W> Default for Pool<W> {
    fn default() -> Self {
        Self { idle: Mutex::new(Vec::new()) }
    }
}

impl<W> Pool<W> {
    /// Runs `body` with an idle scratch, or a new one if there is none.
    pub fn with<R>(&self, make: impl FnOnce() -> W, body: impl FnOnce(&mut W) -> R) -> R {
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut scratch = idle.unwrap_or_else(make);
        let result = body(&mut scratch);
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_order_and_pieces_are_disjoint() {
        assert_eq!(map(1000, &|i| i * i), (0..1000).map(|i| i * i).collect::<Vec<_>>());
        let mut items = vec![0; 103];
        let lengths = chunks_mut(&mut items, 10, &|piece, items| {
            items.iter_mut().for_each(|v| *v += piece);
            items.len()
        });
        assert_eq!(lengths, [[10; 10].as_slice(), &[3]].concat());
        assert!(items.iter().enumerate().all(|(i, v)| *v == i / 10));
        assert!(map(0, &|i| i).is_empty());
    }

    #[test]
    fn scratch_is_used_again() {
        let pool = Pool::default();
        let made = std::cell::Cell::new(0);
        for i in 0..5 {
            let uses = pool.with(
                || {
                    made.set(made.get() + 1);
                    0
                },
                |uses| {
                    *uses += 1;
                    *uses
                },
            );
            assert_eq!(uses, i + 1);
        }
        assert_eq!(made.get(), 1);
    }
}

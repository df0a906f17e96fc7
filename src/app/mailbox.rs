//! From the window to a thread that works for it: only the newest wish counts.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// Room for one wish. A new one takes the place of what was not fetched.
#[derive(Debug)]
pub struct Mailbox<T> {
    state: Mutex<State<T>>,
    awake: Condvar,
}

#[derive(Debug)]
struct State<T> {
    wish: Option<T>,
    /// There will be no more.
    closed: bool,
}

impl<T> Default for Mailbox<T> {
    fn default() -> Self {
        Self { state: Mutex::new(State { wish: None, closed: false }), awake: Condvar::new() }
    }
}

impl<T> Mailbox<T> {
    fn state(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Never waits for the thread's work.
    pub fn put(&self, wish: T) {
        self.state().wish = Some(wish);
        self.awake.notify_one();
    }

    /// The next wish, as soon as there is one; `None` when the box was closed.
    pub fn wait(&self) -> Option<T> {
        let mut state = self.state();
        loop {
            if state.closed {
                return None;
            }
            if let Some(wish) = state.wish.take() {
                return Some(wish);
            }
            state = self.awake.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Whether [`Mailbox::wait`] would return at once.
    pub fn calls(&self) -> bool {
        let state = self.state();
        state.closed || state.wish.is_some()
    }

    pub fn close(&self) {
        // with the lock, so that a thread is either before its look at it or waiting
        self.state().closed = true;
        self.awake.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_wish_counts_until_the_box_is_closed() {
        let mailbox = Mailbox::default();
        assert!(!mailbox.calls());
        mailbox.put(1);
        mailbox.put(2);
        assert!(mailbox.calls());
        assert_eq!(mailbox.wait(), Some(2));
        assert!(!mailbox.calls());
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| (mailbox.wait(), mailbox.wait()));
            mailbox.put(3);
            while mailbox.calls() {
                std::thread::yield_now();
            }
            mailbox.close();
            assert_eq!(waiting.join().unwrap(), (Some(3), None));
        });
        mailbox.put(4);
        assert_eq!((mailbox.wait(), mailbox.calls()), (None, true));
    }
}

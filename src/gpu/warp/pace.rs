//! How much goes into one dispatch: systems stop what keeps a graphics card for seconds.

use std::time::Duration;

/// Work of one kind, measured as it goes.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// What a dispatch may take.
    budget: Duration,
    next: usize,
    most: usize,
}

/// What a dispatch begins with: little enough for a slow device.
const BEGIN: usize = 256;
const LEAST: usize = 16;

impl Pace {
    /// At most `most` (at least 1) in one dispatch.
    pub fn new(budget: Duration, most: usize) -> Self {
        Self { budget, next: BEGIN.min(most), most }
    }

    /// How many items the next dispatch may have.
    pub fn next(&self) -> usize {
        self.next
    }

    /// A dispatch of `items` took `time`: half the budget is aimed at, so that costlier items do not break it, and growth
    /// is bounded, as small dispatches say little.
    pub fn took(&mut self, items: usize, time: Duration) {
        if items < self.next && time <= self.budget {
            // the rest of something: mostly overhead
            return;
        }
        let wanted = 0.5 * self.budget.as_secs_f64() / time.as_secs_f64().max(1e-6) * items as f64;
        self.next = (wanted as usize).min(self.next.saturating_mul(4)).max(LEAST).min(self.most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dispatches_stay_within_the_budget() {
        let budget = Duration::from_millis(100);
        // seconds for an item: fast, slow, and slower all of a sudden
        for (first, then) in [(1e-9, 1e-9), (1e-6, 1e-6), (1e-6, 1.9e-6), (3e-4, 2e-4)] {
            let mut pace = Pace::new(budget, 1 << 20);
            let mut sizes = Vec::new();
            for i in 0..40 {
                let n = pace.next();
                let time = Duration::from_secs_f64(n as f64 * if i < 20 { first } else { then });
                assert!(time <= budget, "{n} items in {time:?}");
                sizes.push(n);
                pace.took(n, time);
            }
            let settled = 0.05 / then;
            let last = sizes[39] as f64;
            assert!((last - settled.clamp(LEAST as f64, (1 << 20) as f64)).abs() <= 0.02 * settled + 16.0);
        }
        assert_eq!(Pace::new(budget, 7).next(), 7);
    }
}

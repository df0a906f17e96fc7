//! How long the steps of the window take: what the debug overlay shows.

use std::collections::VecDeque;
use std::time::Duration;

const KEPT: usize = 600;

/// The last times of one kind of step, in milliseconds.
#[derive(Debug, Clone, Default)]
pub struct Series {
    times: VecDeque<f32>,
    /// Since the start.
    pub worst: f32,
    pub count: u64,
}

impl Series {
    pub fn add(&mut self, time: Duration) {
        let ms = time.as_secs_f32() * 1e3;
        if self.times.len() == KEPT {
            self.times.pop_front();
        }
        self.times.push_back(ms);
        self.worst = self.worst.max(ms);
        self.count += 1;
    }

    /// The time that a part (0 to 1) of the last steps did not exceed.
    pub fn quantile(&self, part: f32) -> Option<f32> {
        let mut sorted: Vec<f32> = self.times.iter().copied().collect();
        sorted.sort_by(f32::total_cmp);
        let at = ((sorted.len() as f32 * part).ceil() as usize).clamp(1, sorted.len().max(1)) - 1;
        sorted.get(at).copied()
    }
}

#[derive(Debug, Clone, Default)]
pub struct Trace {
    /// One pass of the user interface.
    pub pass: Series,
    /// From a moved pointer to the request for a picture: picking, deformers, snapshots.
    pub stroke: Series,
    /// On the worker: object and slices of a picture.
    pub geometry: Series,
    /// On the worker: a whole picture while something moves.
    pub coarse: Series,
    /// On the worker: a whole picture at rest.
    pub full: Series,
    /// From a request to the picture that answers it, while something moves.
    pub latency: Series,
}

impl Trace {
    pub fn rows(&self) -> [(&'static str, &Series); 6] {
        [
            ("interface pass", &self.pass),
            ("stroke event", &self.stroke),
            ("slices", &self.geometry),
            ("picture, moving", &self.coarse),
            ("picture, at rest", &self.full),
            ("latency, moving", &self.latency),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_what_was_added() {
        let mut s = Series::default();
        assert_eq!(s.quantile(0.95), None);
        for i in 1..=100 {
            s.add(Duration::from_millis(i));
        }
        assert_eq!((s.quantile(0.95), s.quantile(0.5), s.worst), (Some(95.0), Some(50.0), 100.0));
    }
}

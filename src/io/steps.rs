//! Where the samples of one step of a series lie among those of all steps.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};

use flate2::bufread::MultiGzDecoder;

/// The steps of a series inside one block of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Steps {
    /// At least 1.
    pub count: usize,
    /// Samples of a step that lie together; then as many of every other step follow. `None`: a step lies in one piece.
    pub run: Option<usize>,
}

impl Steps {
    /// Of a volume that is no series.
    pub const ONE: Self = Self { count: 1, run: None };

    /// Whether sample `at` of all belongs to a step of `count` samples.
    pub fn holds(&self, step: usize, count: usize, at: usize) -> bool {
        at / self.run.unwrap_or(count).max(1) % self.count == step
    }
}

/// Compressed data that were read up to the end of a step: a later one need not pass over all of them again.
#[derive(Debug)]
pub(super) struct Stream {
    pub source: BufReader<MultiGzDecoder<BufReader<File>>>,
    /// Decoded bytes that were read.
    pub at: u64,
}

impl Stream {
    /// From the beginning.
    pub fn new(file: BufReader<File>) -> Self {
        Self { source: BufReader::with_capacity(1 << 16, MultiGzDecoder::new(file)), at: 0 }
    }
}

/// The bytes of one step where steps take turns.
pub(super) struct Runs<R> {
    inner: R,
    /// Bytes of a run.
    run: u64,
    /// Bytes of the runs of all other steps.
    others: u64,
    /// Bytes to pass over before the next run.
    gap: u64,
    /// Bytes of the run at hand that are left.
    left: u64,
}

impl<R: BufRead> Runs<R> {
    /// `inner` begins with the first run of step 0; runs have `run` bytes.
    pub fn new(inner: R, run: u64, steps: usize, step: usize) -> Self {
        let gap = run.saturating_mul(step as u64);
        Self { inner, run, others: run.saturating_mul(steps as u64 - 1), gap, left: 0 }
    }
}

impl<R: BufRead> Read for Runs<R> {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while filled < buf.len() {
            if self.left == 0 {
                if pass(&mut self.inner, self.gap)? < self.gap {
                    return Ok(filled);
                }
                (self.left, self.gap) = (self.run, self.others);
            }
            let most = (buf.len() - filled).min(usize::try_from(self.left).unwrap_or(usize::MAX));
            let n = self.inner.read(&mut buf[filled..filled + most])?;
            if n == 0 {
                return Ok(filled);
            }
            filled += n;
            self.left -= n as u64;
        }
        Ok(filled)
    }
}

/// Passes over so many bytes, or as many as there are; says how many.
pub(super) fn pass(source: &mut (impl BufRead + ?Sized), count: u64) -> io::Result<u64> {
    let mut left = count;
    while left > 0 {
        let there = match source.fill_buf() {
            Ok(there) => there.len(),
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(e) => return Err(e),
        };
        if there == 0 {
            break;
        }
        let n = there.min(usize::try_from(left).unwrap_or(usize::MAX));
        source.consume(n);
        left -= n as u64;
    }
    Ok(count - left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_a_step_come_together() {
        let all: Vec<u8> = (0..24).collect();
        let of = |run: u64, steps: usize, step: usize| {
            let mut found = Vec::new();
            // a small buffer, so that runs end in its middle
            Runs::new(io::BufReader::with_capacity(5, &all[..]), run, steps, step).read_to_end(&mut found).unwrap();
            found
        };
        assert_eq!(of(2, 3, 1), [2, 3, 8, 9, 14, 15, 20, 21]);
        assert_eq!(of(1, 12, 11), [11, 23]);
        assert_eq!(of(24, 1, 0), all);
        // an end within a run gives what is there
        assert_eq!(of(7, 2, 1), [7, 8, 9, 10, 11, 12, 13, 21, 22, 23]);
        let steps = Steps { count: 3, run: Some(2) };
        let held: Vec<u8> = (0..24).filter(|i| steps.holds(1, 8, *i)).map(|i| all[i]).collect();
        assert_eq!(held, of(2, 3, 1));
        assert!(Steps { count: 3, run: None }.holds(2, 8, 23) && !Steps { count: 3, run: None }.holds(1, 8, 16));
    }
}

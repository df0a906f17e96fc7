//! A transfer function from the histogram alone.
//!
//! # Theory
//!
//! Otsu's criterion (1979) with two thresholds splits the histogram into background, body and core, by the largest variance
//! between the classes of `sqrt(count)`: the root keeps a huge background from outvoting the rest. The background becomes
//! clear, the body a veil whose opacity falls with the number of its voxels, the core solid.

use super::{ControlPoint, TransferFunction, Window};

/// Bins that the search works on.
const BINS: usize = 128;

pub fn ramp() -> Vec<ControlPoint> {
    points(0.25, 0.6, 0.06)
}

fn points(low: f32, high: f32, veil: f32) -> Vec<ControlPoint> {
    let at = |at: f32, color, opacity| ControlPoint { at: at.clamp(0.0, 1.0), color, opacity };
    let edge = (0.25 * (high - low)).min(0.5 * low).max(1e-3);
    let rise = (0.2 * (1.0 - high)).max(1e-3);
    vec![
        at(0.0, [0.52, 0.42, 0.36], 0.0),
        at(low - 0.5 * edge, [0.64, 0.51, 0.42], 0.0),
        at(low + 0.5 * edge, [0.85, 0.69, 0.56], veil),
        at(high - 0.15 * (high - low), [0.80, 0.61, 0.48], 0.5 * veil),
        at(high + rise, [0.94, 0.87, 0.74], 0.5),
        at(1.0, [1.0, 0.98, 0.93], 0.95),
    ]
}

/// `counts` in equal bins over the volume's range; without usable counts, a plain ramp.
pub fn from_histogram(counts: &[u64]) -> TransferFunction {
    let points = thresholds(counts).map_or_else(ramp, |(low, high, veil)| points(low, high, veil));
    TransferFunction { name: "auto".to_owned(), window: Window::Auto, points, regions: Vec::new() }
}

/// Fractions of the range where the body and the core begin, and the body's opacity.
fn thresholds(counts: &[u64]) -> Option<(f32, f32, f32)> {
    if counts.len() < 8 {
        return None;
    }
    let mut bins = vec![0.0f64; BINS.min(counts.len())];
    let n = bins.len();
    for (i, &c) in counts.iter().enumerate() {
        bins[i * n / counts.len()] += c as f64;
    }
    let total: f64 = bins.iter().sum();
    let weights: Vec<f64> = bins.iter().map(|c| c.sqrt()).collect();
    // prefix sums of weight and of weight times position
    let mut w = vec![0.0; n + 1];
    let mut m = vec![0.0; n + 1];
    for i in 0..n {
        w[i + 1] = w[i] + weights[i];
        m[i + 1] = m[i] + weights[i] * i as f64;
    }
    let part = |a: usize, b: usize| {
        let (dw, dm) = (w[b] - w[a], m[b] - m[a]);
        if dw > 0.0 { dm * dm / dw } else { 0.0 }
    };
    let mut best = (0.0, 1, 2);
    for a in 1..n - 1 {
        for b in a + 1..n {
            let score = part(0, a) + part(a, b) + part(b, n);
            if score > best.0 {
                best = (score, a, b);
            }
        }
    }
    let (_, a, b) = best;
    if total <= 0.0 || a == 0 {
        return None;
    }
    let share = bins[a..b].iter().sum::<f64>() / total;
    // a body of a fifth of the volume gets 0.05 a voxel, a thin one more
    let veil = (0.012 / share.max(0.01)).clamp(0.02, 0.3);
    Some((a as f32 / n as f32, b as f32 / n as f32, veil as f32))
}

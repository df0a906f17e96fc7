use crate::volume::transfer::TransferFunction;

/// Values along each axis of a [`ClassTable`].
pub const SIZE: usize = 256;

/// Samples of the transfer function per step between two values of the table.
const FINE: usize = 4;

/// Segments of at most this many steps resolve those samples; in longer ones each step is too thin to matter.
const RESOLVED: usize = 8;

/// An opacity of 1 stands for this optical depth per voxel, so that depths can be added up: e^-16 is less than half a step of
/// a 16-bit picture.
const OPAQUE: f64 = 16.0;

/// Opacity below which a fragment is left out: 1000 slices of it stay below half a step of an 8-bit picture.
pub(super) const INVISIBLE: f32 = 1e-6;

/// Colour and opacity of the ray segment between two slices, by the values at its front and back.
///
/// # Theory
///
/// The transfer function gives a colour `c(s)` and, by its opacity `o` of a layer of the reference thickness (the finest voxel
/// spacing), an extinction `tau(s) = -ln(1 - o)`. Along the segment the value runs linearly from `f` to `b`
/// (pre-integration: Engel, Kraus and Ertl 2001), so the segment's opacity is `1 - exp(-integral of tau)` and its colour the
/// integral of `tau c`, each part dimmed by what lies in front of it. Between neighbouring values of the table extinction and
/// colour are constant (the mean of four samples, colour weighted by extinction; short segments resolve the four). Then a segment that spans n steps is the
/// `over` of n layers of thickness `distance / n`: for each n that is a sliding window over the row of layers,
/// and `over` is associative, so prefixes and suffixes of blocks of n give every window in constant time
/// (van Herk 1992). The whole table costs 256^2 exponentials and is exact up to the constant layers.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassTable {
    /// Premultiplied linear-light RGBA: the entry for values `f / 255` in front and `b / 255` behind is at `b * 256 + f`.
    pub entries: Vec<[f32; 4]>,
    pub preintegrated: bool,
    /// At `hi * 256 + lo`: whether any segment with both values in `lo / 255 ..= hi / 255` can be seen.
    visible: Vec<bool>,
}

impl ClassTable {
    /// The table for slices at `distance_over_reference` times the reference thickness of the transfer function.
    pub fn build(tf: &TransferFunction, distance_over_reference: f64, preintegrated: bool) -> Self {
        let depth = if distance_over_reference > 0.0 { distance_over_reference } else { 0.0 };
        let mut entries = vec![[0.0f32; 4]; SIZE * SIZE];
        for i in 0..SIZE {
            let (tau, color) = extinction(tf, i as f32 / 255.0);
            let entry = layer(tau * depth, color).map(|v| v as f32);
            if preintegrated {
                entries[i * SIZE + i] = entry;
            } else {
                entries.iter_mut().skip(i).step_by(SIZE).for_each(|e| *e = entry);
            }
        }
        if preintegrated {
            preintegrate(tf, depth, &mut entries);
        }
        let visible = visibility(&entries);
        Self { entries, preintegrated, visible }
    }

    /// Bilinear look-up for the values `front` and `back` in 0..=1.
    pub fn lookup(&self, front: f32, back: f32) -> [f32; 4] {
        let (f, b) = (front.clamp(0.0, 1.0) * 255.0, back.clamp(0.0, 1.0) * 255.0);
        let (i, j) = ((f as usize).min(SIZE - 2), (b as usize).min(SIZE - 2));
        let (x, y) = (f - i as f32, b - j as f32);
        let row = |j: usize| {
            let (a, b) = (self.entries[j * SIZE + i], self.entries[j * SIZE + i + 1]);
            std::array::from_fn::<f32, 4, _>(|c| a[c] + x * (b[c] - a[c]))
        };
        let (a, b) = (row(j), row(j + 1));
        std::array::from_fn(|c| a[c] + y * (b[c] - a[c]))
    }

    /// Whether a segment with both values in `lo..=hi` can be seen. Never wrongly false.
    pub fn is_visible(&self, lo: f32, hi: f32) -> bool {
        let lo = (lo.clamp(0.0, 1.0) * 255.0) as usize;
        let hi = (hi.clamp(0.0, 1.0) * 255.0).ceil() as usize;
        self.visible[hi * SIZE + lo]
    }
}

/// Extinction per reference thickness and linear-light colour.
fn extinction(tf: &TransferFunction, s: f32) -> (f64, [f64; 3]) {
    let [r, g, b, opacity] = tf.classify(s).map(f64::from);
    ((-(-opacity).ln_1p()).clamp(0.0, OPAQUE), [r, g, b])
}

/// Premultiplied colour and opacity of a layer of optical depth `depth`.
fn layer(depth: f64, [r, g, b]: [f64; 3]) -> [f64; 4] {
    let a = -(-depth).exp_m1();
    [r * a, g * a, b * a, a]
}

fn over(front: [f64; 4], back: [f64; 4]) -> [f64; 4] {
    let t = 1.0 - front[3];
    std::array::from_fn(|i| front[i] + t * back[i])
}

fn preintegrate(tf: &TransferFunction, depth: f64, entries: &mut [[f32; 4]]) {
    const STEPS: usize = SIZE - 1;
    let fine: Vec<[(f64, [f64; 3]); FINE]> = (0..STEPS)
        .map(|i| std::array::from_fn(|k| extinction(tf, (i as f32 + (k as f32 + 0.5) / FINE as f32) / 255.0)))
        .collect();
    let mean: Vec<(f64, [f64; 3])> = fine
        .iter()
        .map(|fine| {
            let tau: f64 = fine.iter().map(|(tau, _)| tau).sum();
            let weight = if tau > 0.0 { 1.0 / tau } else { 0.0 };
            let color = std::array::from_fn(|j| weight * fine.iter().map(|(tau, c)| tau * c[j]).sum::<f64>());
            (tau / FINE as f64, color)
        })
        .collect();
    const CLEAR: [f64; 4] = [0.0; 4];
    let (mut up, mut down) = ([CLEAR; STEPS], [CLEAR; STEPS]);
    // of the layers from the start of a block of n to i, and from i to the end of its block; for rising and falling values
    let (mut up_to, mut up_from) = ([CLEAR; STEPS], [CLEAR; STEPS]);
    let (mut down_to, mut down_from) = ([CLEAR; STEPS], [CLEAR; STEPS]);
    for n in 1..=STEPS {
        let depth = depth / n as f64;
        for i in 0..STEPS {
            if n <= RESOLVED {
                let parts = fine[i].map(|(tau, c)| layer(tau * depth / FINE as f64, c));
                up[i] = parts.iter().fold(CLEAR, |sum, part| over(sum, *part));
                down[i] = parts.iter().rev().fold(CLEAR, |sum, part| over(sum, *part));
            } else {
                (up[i], down[i]) = ([layer(mean[i].0 * depth, mean[i].1); 2]).into();
            }
        }
        for i in 0..STEPS {
            let first = i % n == 0;
            up_to[i] = if first { up[i] } else { over(up_to[i - 1], up[i]) };
            down_to[i] = if first { down[i] } else { over(down[i], down_to[i - 1]) };
        }
        for i in (0..STEPS).rev() {
            let last = i % n == n - 1 || i == STEPS - 1;
            up_from[i] = if last { up[i] } else { over(up[i], up_from[i + 1]) };
            down_from[i] = if last { down[i] } else { over(down_from[i + 1], down[i]) };
        }
        for lo in 0..SIZE - n {
            let end = lo + n - 1;
            let (rise, fall) = if lo % n == 0 {
                (up_to[end], down_to[end])
            } else {
                (over(up_from[lo], up_to[end]), over(down_to[end], down_from[lo]))
            };
            entries[(lo + n) * SIZE + lo] = rise.map(|v| v as f32);
            entries[lo * SIZE + lo + n] = fall.map(|v| v as f32);
        }
    }
}

fn visibility(entries: &[[f32; 4]]) -> Vec<bool> {
    let mut visible = vec![false; SIZE * SIZE];
    for width in 0..SIZE {
        for lo in 0..SIZE - width {
            let hi = lo + width;
            let inside = width > 0 && (visible[(hi - 1) * SIZE + lo] || visible[hi * SIZE + lo + 1]);
            let seen = |f: usize, b: usize| entries[b * SIZE + f][3] > INVISIBLE;
            visible[hi * SIZE + lo] = inside || seen(lo, hi) || seen(hi, lo);
        }
    }
    visible
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::transfer::{ControlPoint, Window};

    fn tf(points: &[(f32, [f32; 3], f32)]) -> TransferFunction {
        TransferFunction {
            name: "test".into(),
            window: Window::Auto,
            points: points.iter().map(|&(at, color, opacity)| ControlPoint { at, color, opacity }).collect(),
        }
    }

    fn colourful() -> TransferFunction {
        tf(&[
            (0.0, [0.0, 0.0, 0.0], 0.0),
            (0.2, [1.0, 0.2, 0.1], 0.0),
            (0.35, [0.9, 0.7, 0.2], 0.4),
            (0.36, [0.1, 0.9, 0.2], 0.05),
            (0.8, [0.2, 0.3, 0.9], 0.9),
            (1.0, [1.0, 1.0, 1.0], 0.6),
        ])
    }

    /// Marches the segment in many small steps.
    fn march(tf: &TransferFunction, f: f32, b: f32, depth: f64) -> [f64; 4] {
        let n = 4000;
        (0..n).fold([0.0; 4], |acc, i| {
            let s = f + (b - f) * (i as f32 + 0.5) / n as f32;
            let (tau, c) = extinction(tf, s);
            over(acc, layer(tau * depth / f64::from(n), c))
        })
    }

    #[test]
    fn entries_are_the_integral_along_the_segment() {
        let tf = colourful();
        for depth in [0.25, 1.0, 3.0] {
            let table = ClassTable::build(&tf, depth, true);
            for (f, b) in
                [(0, 255), (255, 0), (40, 41), (90, 30), (30, 90), (200, 200), (91, 92), (10, 250), (254, 255)]
            {
                let want = march(&tf, f as f32 / 255.0, b as f32 / 255.0, depth);
                let got = table.entries[b * SIZE + f];
                for c in 0..4 {
                    assert!((f64::from(got[c]) - want[c]).abs() < 2e-3, "{f} {b} {depth}: {got:?} {want:?}");
                }
            }
        }
    }

    #[test]
    fn every_window_is_the_over_of_its_layers() {
        // brute force for all pairs of a few widths, with the same layers
        let tf = colourful();
        let table = ClassTable::build(&tf, 1.0, true);
        for n in [1usize, 2, 3, 7, 64, 100, 127, 128, 129, 254, 255] {
            for lo in 0..SIZE - n {
                let whole: f64 = (lo..lo + n)
                    .map(|i| {
                        (0..FINE)
                            .map(|k| extinction(&tf, (i as f32 + (k as f32 + 0.5) / FINE as f32) / 255.0).0)
                            .sum::<f64>()
                            / (FINE * n) as f64
                    })
                    .sum();
                let want = -(-whole).exp_m1();
                for e in [table.entries[(lo + n) * SIZE + lo], table.entries[lo * SIZE + lo + n]] {
                    assert!((f64::from(e[3]) - want).abs() < 1e-6, "{lo} {n}");
                }
            }
        }
    }

    #[test]
    fn opacity_follows_the_slice_distance() {
        let tf = tf(&[(0.0, [1.0, 0.5, 0.25], 0.3)]);
        for preintegrated in [false, true] {
            for n in [1, 2, 5] {
                let table = ClassTable::build(&tf, 1.0 / f64::from(n), preintegrated);
                for e in [table.lookup(0.1, 0.1), table.lookup(0.2, 0.9), table.lookup(1.0, 0.0)] {
                    let a = 1.0 - (1.0 - e[3]).powi(n);
                    assert!((a - 0.3).abs() < 1e-6, "{n} {preintegrated}: {a}");
                    assert!((e[0] - e[3]).abs() < 1e-6);
                }
            }
        }
        let solid = self::tf(&[(0.0, [1.0; 3], 1.0)]);
        assert!(ClassTable::build(&solid, 1.0, true).lookup(0.5, 0.5)[3] > 0.999_999);
        assert_eq!(ClassTable::build(&solid, 0.0, false).lookup(0.5, 0.5), [0.0; 4]);
        assert!(ClassTable::build(&solid, f64::NAN, true).entries.iter().flatten().all(|v| *v == 0.0));
    }

    #[test]
    fn lookup_is_bilinear_at_texel_centres() {
        let table = ClassTable::build(&colourful(), 1.0, true);
        for (f, b) in [(0usize, 0usize), (255, 255), (0, 255), (17, 200), (254, 1)] {
            let got = table.lookup(f as f32 / 255.0, b as f32 / 255.0);
            let want = table.entries[b * SIZE + f];
            assert!((0..4).all(|c| (got[c] - want[c]).abs() < 1e-4));
        }
        let flat = ClassTable::build(&colourful(), 1.0, false);
        assert_eq!(flat.lookup(0.4, 0.0), flat.lookup(0.4, 1.0));
    }

    #[test]
    fn nothing_visible_is_called_empty() {
        let table = ClassTable::build(&colourful(), 1.0, true);
        assert!(!table.is_visible(0.0, 0.19));
        assert!(table.is_visible(0.0, 0.21) && table.is_visible(0.0, 1.0) && table.is_visible(0.5, 0.5));
        for lo in (0..SIZE).step_by(5) {
            for hi in (lo..SIZE).step_by(3) {
                let any = (lo..=hi).any(|f| (lo..=hi).any(|b| table.entries[b * SIZE + f][3] > INVISIBLE));
                assert_eq!(table.visible[hi * SIZE + lo], any, "{lo} {hi}");
            }
        }
    }
}

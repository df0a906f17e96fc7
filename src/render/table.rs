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

/// Rows of a table by steepness that no steepness reaches: half the length of differences of at most 1 along three axes is
/// below 0.8661. They hold the most opaque entry of each column, so that one look-up tells where nothing can be seen.
const UNREACHED: usize = 17;

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
    /// Premultiplied linear-light RGBA: the entry for the value `f / 255` in front and `b / 255` along the second axis is at
    /// `b * 256 + f`. 1 MiB.
    pub entries: Vec<[f32; 4]>,
    pub second: Second,
    /// At `hi * 256 + lo`: whether any segment with both values in `lo / 255 ..= hi / 255` can be seen.
    visible: Vec<bool>,
}

/// What the second axis of a [`ClassTable`] stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Second {
    /// Nothing: all rows are the same.
    Nothing,
    /// The value at the back: pre-integration.
    Behind,
    /// 1 less the root of the steepness at the front, in window units per voxel.
    Steepness,
}

impl Second {
    pub const ALL: [Self; 3] = [Self::Nothing, Self::Behind, Self::Steepness];
}

impl ClassTable {
    /// The table for slices at `distance_over_reference` times the reference thickness of the transfer function. With regions it
    /// is by steepness, never pre-integrated.
    pub fn build(tf: &TransferFunction, distance_over_reference: f64, preintegrated: bool) -> Self {
        let depth = if distance_over_reference > 0.0 { distance_over_reference } else { 0.0 };
        let mut entries = vec![[0.0f32; 4]; SIZE * SIZE];
        let second = match (tf.regions.is_empty(), preintegrated) {
            (false, _) => Second::Steepness,
            (true, true) => Second::Behind,
            (true, false) => Second::Nothing,
        };
        for i in 0..SIZE {
            let curve = tf.classify(i as f32 / 255.0);
            let entry = entry_of(curve, depth);
            match second {
                Second::Nothing => entries.iter_mut().skip(i).step_by(SIZE).for_each(|e| *e = entry),
                Second::Behind => entries[i * SIZE + i] = entry,
                Second::Steepness => column(tf, i, curve, depth, &mut entries),
            }
        }
        if second == Second::Behind {
            preintegrate(tf, depth, &mut entries);
        }
        let visible = match second {
            Second::Steepness => visibility(|lo, hi| [entries[lo][3], entries[hi][3]]),
            _ => visibility(|lo, hi| [entries[hi * SIZE + lo][3], entries[lo * SIZE + hi][3]]),
        };
        Self { entries, second, visible }
    }

    /// Bilinear look-up for the value `front` and `second`, in 0..=1.
    pub fn lookup(&self, front: f32, second: f32) -> [f32; 4] {
        let (f, b) = (front.clamp(0.0, 1.0) * 255.0, second.clamp(0.0, 1.0) * 255.0);
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
    extinction_of(tf.classify(s))
}

fn extinction_of(color: [f32; 4]) -> (f64, [f64; 3]) {
    let [r, g, b, opacity] = color.map(f64::from);
    ((-(-opacity).ln_1p()).clamp(0.0, OPAQUE), [r, g, b])
}

/// The entry of a layer of one colour and opacity.
fn entry_of(color: [f32; 4], depth: f64) -> [f32; 4] {
    let (tau, color) = extinction_of(color);
    layer(tau * depth, color).map(|v| v as f32)
}

/// The entries of one value by steepness.
fn column(tf: &TransferFunction, i: usize, curve: [f32; 4], depth: f64, entries: &mut [[f32; 4]]) {
    let mut most = [0.0f32; 4];
    for row in UNREACHED..SIZE {
        let entry = entry_of(tf.over_regions(curve, i as f32 / 255.0, 1.0 - row as f32 / 255.0), depth);
        most = if entry[3] > most[3] { entry } else { most };
        entries[row * SIZE + i] = entry;
    }
    (0..UNREACHED).for_each(|row| entries[row * SIZE + i] = most);
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

/// Which ranges of values can be seen, from the opacities of two values that are met together.
fn visibility(opacities: impl Fn(usize, usize) -> [f32; 2]) -> Vec<bool> {
    let mut visible = vec![false; SIZE * SIZE];
    for width in 0..SIZE {
        for lo in 0..SIZE - width {
            let hi = lo + width;
            let inside = width > 0 && (visible[(hi - 1) * SIZE + lo] || visible[hi * SIZE + lo + 1]);
            visible[hi * SIZE + lo] = inside || opacities(lo, hi).into_iter().any(|a| a > INVISIBLE);
        }
    }
    visible
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::transfer::{ControlPoint, Region, Window};

    fn tf(points: &[(f32, [f32; 3], f32)]) -> TransferFunction {
        TransferFunction {
            name: "test".into(),
            window: Window::Auto,
            points: points.iter().map(|&(at, color, opacity)| ControlPoint { at, color, opacity }).collect(),
            regions: vec![],
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

    #[test]
    fn with_regions_the_second_axis_is_the_steepness() {
        let region = Region {
            value: [0.3, 0.6],
            steepness: [0.01, 0.3],
            foot: 0.6,
            soft: 0.7,
            opacity: 0.3,
            color: Some([0.2, 0.9, 0.4]),
        };
        let soft = Region { value: [0.5, 1.0], soft: 1.0, opacity: 0.1, color: None, ..region };
        let tf = TransferFunction { regions: vec![region, soft], ..colourful() };
        for depth in [0.5, 1.0, 2.0] {
            let table = ClassTable::build(&tf, depth, true);
            assert_eq!(table.second, Second::Steepness);
            for (s, row) in [(120, 150), (110, 200), (140, 220), (200, 190), (20, 150), (120, 250)] {
                let (s, second) = (s as f32 / 255.0, row as f32 / 255.0);
                let [r, g, b, a] = tf.at(s, (1.0 - second).powi(2));
                let opacity = 1.0 - (1.0 - a).powf(depth as f32);
                let want = [r * opacity, g * opacity, b * opacity, opacity];
                let got = table.lookup(s, second);
                assert!((0..4).all(|c| (got[c] - want[c]).abs() < 1e-5), "{s} {second}: {got:?}, not {want:?}");
            }
            // the steepest there can be reads none of the rows above
            let steepest = 1.0 - 0.75f32.sqrt().sqrt();
            assert!((steepest * 255.0) as usize >= UNREACHED);
            for s in 0..SIZE {
                let most = (UNREACHED..SIZE).map(|row| table.entries[row * SIZE + s][3]).fold(0.0, f32::max);
                assert_eq!(table.lookup(s as f32 / 255.0, 0.0)[3], most);
            }
            assert!(!table.is_visible(0.0, 0.29) && table.is_visible(0.0, 0.4) && table.is_visible(0.99, 1.0));
            assert!(table.is_visible(0.0, 1.0));
        }
    }
}

/// How a triangle looks after it was split a fixed number of times: the places of its vertices and its small triangles.
///
/// Vertices are numbered: the three corners; the points between the ends of edge 0 (from corner 0 to 1), edge 1 (1 to 2)
/// and edge 2 (2 to 0), `parts - 1` each; the points inside.
#[derive(Debug)]
pub(super) struct Pattern {
    /// Weights of the corners at the points inside; none is 0.
    pub inside: Vec<[f64; 3]>,
    pub triangles: Vec<[u16; 3]>,
}

/// The deepest pattern: 1024 triangles for one.
pub(super) const DEEPEST: u32 = 5;

/// No pattern has more vertices (the deepest has 561); a power of two, so that a masked index needs no check.
pub(super) const VERTICES: usize = 1024;

impl Pattern {
    /// For a triangle that is split `depth` times, at most [`DEEPEST`].
    pub fn new(depth: u32) -> Self {
        let n = 1_u32 << depth.min(DEEPEST);
        let share = 1.0 / f64::from(n);
        let mut pattern = Self { inside: Vec::new(), triangles: Vec::new() };
        for k in 0..n {
            for j in 0..n - k {
                if j > 0 && k > 0 {
                    pattern.inside.push([n - j - k, j, k].map(|w| f64::from(w) * share));
                }
                let at = |j: u32, k: u32| vertex(n, [n - j - k, j, k]);
                pattern.triangles.push([at(j, k), at(j + 1, k), at(j, k + 1)]);
                if j + k + 1 < n {
                    pattern.triangles.push([at(j + 1, k), at(j + 1, k + 1), at(j, k + 1)]);
                }
            }
        }
        pattern
    }
}

/// The number of the vertex with these weights, in `n` parts.
fn vertex(n: u32, [i, j, k]: [u32; 3]) -> u16 {
    let number = match [i == 0, j == 0, k == 0] {
        [false, true, true] => 0,
        [true, false, true] => 1,
        [true, true, false] => 2,
        [false, false, true] => 3 + j - 1,
        [true, false, false] => 3 + (n - 1) + k - 1,
        [false, true, false] => 3 + 2 * (n - 1) + i - 1,
        // rows of constant k hold n - 1 - k points
        _ => 3 + 3 * (n - 1) + (1..k).map(|r| n - 1 - r).sum::<u32>() + j - 1,
    };
    number as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn every_pattern_fills_the_triangle_without_cracks() {
        for depth in 0..=DEEPEST {
            let pattern = Pattern::new(depth);
            let n = 1_i64 << depth;
            // exact integer places
            let mut places = vec![[0, 0], [n, 0], [0, n]];
            places.extend((1..n).map(|s| [s, 0]));
            places.extend((1..n).map(|s| [n - s, s]));
            places.extend((1..n).map(|s| [0, n - s]));
            places.extend(pattern.inside.iter().map(|w| [(w[1] * n as f64) as i64, (w[2] * n as f64) as i64]));
            assert!(places.len() <= VERTICES);
            assert!(pattern.inside.iter().all(|w| w.iter().sum::<f64>() == 1.0));
            let mut sides: HashMap<(u16, u16), u32> = HashMap::new();
            for t in &pattern.triangles {
                let [a, b, c] = t.map(|i| places[i as usize]);
                assert_eq!((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]), 1, "depth {depth}: {t:?}");
                for i in 0..3 {
                    *sides.entry((t[i], t[(i + 1) % 3])).or_default() += 1;
                }
            }
            assert_eq!(pattern.triangles.len() as i64, n * n);
            assert!(sides.values().all(|c| *c == 1));
            let border = sides.keys().filter(|(a, b)| !sides.contains_key(&(*b, *a))).count() as i64;
            assert_eq!(border, 3 * n);
        }
    }
}

/// How a triangle looks after it was split a fixed number of times: the places of its vertices and its small triangles.
///
/// Vertices are numbered: the three corners; the points between the ends of edge 0 (from corner 0 to 1), edge 1 (1 to 2)
/// and edge 2 (2 to 0), `parts - 1` each; the points inside. An edge may stay whole, then its points are not used.
#[derive(Debug)]
pub(super) struct Pattern {
    /// Parts of an edge.
    pub parts: u32,
    /// Weights of the corners at the points inside, in parts; none is 0.
    pub inside: Vec<[u32; 3]>,
    /// By the edges that are split, bit i for edge i.
    pub triangles: [Vec<[u16; 3]>; 8],
}

/// The deepest pattern: 1024 triangles for one.
pub(super) const DEEPEST: u32 = 5;

impl Pattern {
    /// For a triangle that is split `depth` times, 1 to [`DEEPEST`].
    pub fn new(depth: u32) -> Self {
        let n = 1_u32 << depth.clamp(1, DEEPEST);
        let mut pattern = Self { parts: n, inside: Vec::new(), triangles: Default::default() };
        for k in 1..n {
            for j in 1..n - k {
                pattern.inside.push([n - j - k, j, k]);
            }
        }
        for mask in 0..8 {
            pattern.triangles[mask] = if mask == 7 { pattern.regular() } else { pattern.bordered(mask) };
        }
        pattern
    }

    /// Number of vertices, used or not.
    pub fn vertices(&self) -> usize {
        3 + 3 * (self.parts as usize - 1) + self.inside.len()
    }

    /// The number of the vertex with these weights, in parts.
    fn vertex(&self, [i, j, k]: [u32; 3]) -> u16 {
        let n = self.parts;
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

    /// All edges are split: the triangular grid.
    fn regular(&self) -> Vec<[u16; 3]> {
        let n = self.parts;
        let at = |j: u32, k: u32| self.vertex([n - j - k, j, k]);
        let mut triangles = Vec::with_capacity((n * n) as usize);
        for k in 0..n {
            for j in 0..n - k {
                triangles.push([at(j, k), at(j + 1, k), at(j, k + 1)]);
                if j + k + 1 < n {
                    triangles.push([at(j + 1, k), at(j + 1, k + 1), at(j, k + 1)]);
                }
            }
        }
        triangles
    }

    /// Some edges stay whole: the grid of the points inside, and a strip along each edge that zips it to that grid.
    fn bordered(&self, mask: usize) -> Vec<[u16; 3]> {
        let n = self.parts;
        if n == 2 {
            return halved(mask);
        }
        let mut triangles = Vec::new();
        let at = |j: u32, k: u32| self.vertex([n - j - k, j, k]);
        for k in 1..n - 2 {
            for j in 1..n - 1 - k {
                triangles.push([at(j, k), at(j + 1, k), at(j, k + 1)]);
                if j + k + 2 < n {
                    triangles.push([at(j + 1, k), at(j + 1, k + 1), at(j, k + 1)]);
                }
            }
        }
        for side in 0..3 {
            let weights = |along: u32, in_from: u32| {
                let mut w = [0; 3];
                w[(side + 1) % 3] = along;
                w[(side + 2) % 3] = in_from;
                w[side] = n - along - in_from;
                self.vertex(w)
            };
            // places along the edge, in half parts
            let outer: Vec<(u32, u16)> = if mask >> side & 1 == 1 {
                (0..=n).map(|s| (2 * s, weights(s, 0))).collect()
            } else {
                [0, n].map(|s| (2 * s, weights(s, 0))).to_vec()
            };
            let inner: Vec<(u32, u16)> = (1..n - 1).map(|s| (2 * s + 1, weights(s, 1))).collect();
            let (mut o, mut i) = (0, 0);
            while o + 1 < outer.len() || i + 1 < inner.len() {
                let step_outer = match (outer.get(o + 1), inner.get(i + 1)) {
                    (Some(a), Some(b)) => outer[o].0 + a.0 <= inner[i].0 + b.0,
                    (next, _) => next.is_some(),
                };
                if step_outer {
                    triangles.push([outer[o].1, outer[o + 1].1, inner[i].1]);
                    o += 1;
                } else {
                    triangles.push([outer[o].1, inner[i + 1].1, inner[i].1]);
                    i += 1;
                }
            }
        }
        triangles
    }
}

/// A triangle with some of its edges halved, and no point inside.
fn halved(mask: usize) -> Vec<[u16; 3]> {
    let ring: Vec<u16> =
        (0..3).flat_map(|i| [Some(i as u16), (mask >> i & 1 == 1).then_some(3 + i as u16)]).flatten().collect();
    match ring.len() {
        3 => vec![[0, 1, 2]],
        // turned so that a midpoint comes first, each ring is a fan round it
        n => {
            let first = ring.iter().position(|v| *v >= 3).unwrap_or(0);
            let at = |i: usize| ring[(first + i) % n];
            (1..n - 1).map(|i| [at(0), at(i), at(i + 1)]).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    /// Twice the area of a small triangle in units of parts, from exact integer places.
    fn doubled_area(p: &[[i64; 2]], t: [u16; 3]) -> i64 {
        let [a, b, c] = t.map(|i| p[i as usize]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    }

    #[test]
    fn every_pattern_fills_the_triangle_without_cracks() {
        for depth in 1..=DEEPEST {
            let pattern = Pattern::new(depth);
            let n = i64::from(pattern.parts);
            let mut places = vec![[0, 0], [n, 0], [0, n]];
            places.extend((1..n).map(|s| [s, 0]));
            places.extend((1..n).map(|s| [n - s, s]));
            places.extend((1..n).map(|s| [0, n - s]));
            places.extend(pattern.inside.iter().map(|w| [i64::from(w[1]), i64::from(w[2])]));
            assert_eq!(places.len(), pattern.vertices());
            for (mask, triangles) in pattern.triangles.iter().enumerate() {
                let mut sides: HashMap<(u16, u16), u32> = HashMap::new();
                for t in triangles {
                    assert!(doubled_area(&places, *t) > 0, "depth {depth} mask {mask}: {t:?}");
                    for i in 0..3 {
                        *sides.entry((t[i], t[(i + 1) % 3])).or_default() += 1;
                    }
                }
                assert_eq!(triangles.iter().map(|t| doubled_area(&places, *t)).sum::<i64>(), n * n);
                assert!(sides.values().all(|c| *c == 1));
                // what has one side only is the border: each edge whole or in all its parts
                let border = sides.keys().filter(|(a, b)| !sides.contains_key(&(*b, *a))).count();
                let split = mask.count_ones() as usize;
                assert_eq!(border, split * n as usize + 3 - split, "depth {depth} mask {mask}");
                let used = |v: u16| triangles.iter().flatten().any(|i| *i == v);
                for edge in 0..3 {
                    for s in 0..n as u16 - 1 {
                        assert_eq!(used(3 + edge * (n as u16 - 1) + s), mask >> edge & 1 == 1);
                    }
                }
            }
            assert_eq!(pattern.triangles[7].len(), (n * n) as usize);
        }
    }
}

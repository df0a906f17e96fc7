//! A tetrahedron's outline in layers of the output: which rows it reaches, and where in them it begins and ends.

use super::setup::{PAD, Tet};
use crate::math::lanes::{COUNT, Doubles, LANES};

/// Faces that rows may begin at, or end at.
const FACES: usize = 3;

/// Something linear in rows and layers: `at + z * rise + y * slope`.
#[derive(Clone, Copy, Default)]
pub(super) struct Linear {
    pub at: f64,
    pub rise: f64,
    pub slope: f64,
}

impl Linear {
    /// In row 0 of a layer.
    #[inline(always)]
    pub fn level(&self, z: f64) -> f64 {
        self.at + self.rise * z
    }

    /// In eight rows of a layer.
    #[inline(always)]
    pub fn rows<M: Doubles>(&self, m: M, y: M::Double, z: f64) -> M::Double {
        m.times_plus(y, m.all(self.slope), m.all(self.level(z)))
    }
}

/// What is the same in all layers. Coordinates are relative to the tetrahedron's anchor, those of rows and layers are voxels
/// of the output.
pub(crate) struct Outline<M: Doubles> {
    machine: M,
    anchor: [i32; 3],
    /// The first and last voxel of any row.
    bounds: [f64; 2],
    /// The first and last row of any layer.
    rows: [i32; 2],
    /// Where rows cross faces: they begin behind all of these and end before all of those; where there are fewer faces, the
    /// bounds are meant.
    begin: [Linear; FACES],
    end: [Linear; FACES],
    /// Faces along the rows, not negative on their inner sides, and how many there are.
    sides: [Linear; 4],
    count: usize,
    edges: Edges<M>,
}

/// Six edges, in eight lanes.
struct Edges<M: Doubles> {
    /// Heights between which each is met.
    low: M::Double,
    high: M::Double,
    /// Where it starts, as the first and as the last row of a layer, and how far it goes with each layer.
    foot: M::Double,
    first: M::Double,
    last: M::Double,
    slope: M::Double,
    /// Its ends.
    least: M::Double,
    most: M::Double,
}

/// One layer.
pub(crate) struct Layer<M: Doubles> {
    machine: M,
    /// First and last row that may hold voxels, in the output; there are none if the first is behind the last.
    pub rows: [i32; 2],
    anchor: i32,
    bounds: [f64; 2],
    /// Where row 0 crosses the faces, and how far from there the next.
    begin: [[M::Double; 2]; FACES],
    end: [[M::Double; 2]; FACES],
}

/// Eight rows.
pub(crate) struct Spans<M: Doubles> {
    pub y: M::Double,
    /// First and last voxel of each; a row is empty if the first is behind the last.
    pub first: M::Double,
    pub last: M::Double,
}

impl<M: Doubles> Outline<M> {
    #[inline(always)]
    pub fn new(machine: M, tet: &Tet) -> Self {
        let bounds = [tet.lo[0], tet.hi[0]].map(|x| f64::from(x - tet.anchor[0]));
        let [mut begin, mut end] = bounds.map(|at| [Linear { at, ..Linear::default() }; FACES]);
        let mut sides = [Linear::default(); 4];
        let (mut begins, mut ends, mut count) = (0, 0, 0);
        for b in &tet.bary {
            let at = b[3] + tet.slack;
            // less than this changes a coordinate by no more than the slack across a thousand voxels
            if b[0].abs() < 1e-12 {
                sides[count] = Linear { at, rise: b[2], slope: b[1] };
                count += 1;
                continue;
            }
            let inverse = -1.0 / b[0];
            let crossing = Linear { at: at * inverse, rise: b[2] * inverse, slope: b[1] * inverse };
            // four cannot be on one side: the coordinates' sum is 1 everywhere
            if b[0] > 0.0 {
                begin[begins % FACES] = crossing;
                begins += 1;
            } else {
                end[ends % FACES] = crossing;
                ends += 1;
            }
        }
        let edges = Edges::new(machine, tet);
        let rows = [tet.lo[1], tet.hi[1]];
        Self { machine, anchor: tet.anchor, bounds, rows, begin, end, sides, count, edges }
    }

    /// Layer `z` of the output.
    #[inline(always)]
    pub fn layer(&self, z: i32) -> Layer<M> {
        let m = self.machine;
        let height = f64::from(z - self.anchor[2]);
        let [first, last] = self.edges.rows(m, height);
        let row = |y: f64| self.anchor[1].saturating_add(y as i32);
        // at the pad an inclined edge may leave the layer sideways by more than the pad: the bounds catch what is outside
        let mut top = row((first - PAD).ceil()).max(self.rows[0]);
        let mut bottom = row((last + PAD).floor()).min(self.rows[1]);
        for side in &self.sides[..self.count] {
            let at = side.level(height);
            if side.slope.abs() < 1e-12 {
                bottom = if at >= 0.0 { bottom } else { i32::MIN };
            } else if side.slope > 0.0 {
                top = top.max(row((-at / side.slope).ceil()));
            } else {
                bottom = bottom.min(row((-at / side.slope).floor()));
            }
        }
        let mut layer = Layer {
            machine: m,
            rows: [top, bottom],
            anchor: self.anchor[1],
            bounds: self.bounds,
            begin: [[m.all(0.0); 2]; FACES],
            end: [[m.all(0.0); 2]; FACES],
        };
        for f in 0..FACES {
            let (begin, end) = (&self.begin[f], &self.end[f]);
            layer.begin[f] = [m.all(begin.level(height)), m.all(begin.slope)];
            layer.end[f] = [m.all(end.level(height)), m.all(end.slope)];
        }
        layer
    }
}

impl<M: Doubles> Edges<M> {
    #[inline(always)]
    fn new(m: M, tet: &Tet) -> Self {
        const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
        let (mut low, mut high) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
        let [mut foot, mut first, mut last, mut slope, mut least, mut most] = [[0.0; LANES]; 6];
        for (i, [p, q]) in EDGES.into_iter().enumerate() {
            let (p, q) = (tet.corners[p], tet.corners[q]);
            (low[i], high[i]) = (p.z.min(q.z) - PAD, p.z.max(q.z) + PAD);
            (least[i], most[i]) = (p.y.min(q.y), p.y.max(q.y));
            foot[i] = p.z;
            // an edge in the layer is met as a whole
            let flat = (q.z - p.z).abs() <= 2.0 * PAD;
            slope[i] = if flat { 0.0 } else { (q.y - p.y) / (q.z - p.z) };
            (first[i], last[i]) = if flat { (least[i], most[i]) } else { (p.y, p.y) };
        }
        Self {
            low: m.of(low),
            high: m.of(high),
            foot: m.of(foot),
            first: m.of(first),
            last: m.of(last),
            slope: m.of(slope),
            least: m.of(least),
            most: m.of(most),
        }
    }

    /// The first and last place along y where edges are met at a height; nowhere, if the first is behind the last.
    #[inline(always)]
    fn rows(&self, m: M, height: f64) -> [f64; 2] {
        let height = m.all(height);
        let up = m.minus(height, self.foot);
        let first = m.greater(m.times_plus(up, self.slope, self.first), self.least);
        let last = m.lesser(m.times_plus(up, self.slope, self.last), self.most);
        let (none, all) = (m.all(f64::INFINITY), m.all(f64::NEG_INFINITY));
        let first = m.where_up_to(self.low, height, m.where_up_to(height, self.high, first, none), none);
        let last = m.where_up_to(self.low, height, m.where_up_to(height, self.high, last, all), all);
        [m.least(first), m.most(last)]
    }
}

impl<M: Doubles> Layer<M> {
    /// Eight rows from `row` on.
    #[inline(always)]
    pub fn spans(&self, row: i32) -> Spans<M> {
        let m = self.machine;
        let y = m.plus(m.all(f64::from(row - self.anchor)), m.of(COUNT));
        let (mut first, mut last) = (m.all(self.bounds[0]), m.all(self.bounds[1]));
        for [at, slope] in self.begin {
            first = m.greater(first, m.times_plus(y, slope, at));
        }
        for [at, slope] in self.end {
            last = m.lesser(last, m.times_plus(y, slope, at));
        }
        Spans { y, first: m.ceil(first), last: m.floor(last) }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::math::lanes::Plain;

    /// All voxels that a test finds in a tetrahedron, and no others, are in its spans.
    fn check(moved: [DVec3; 4], dims: [usize; 3]) -> usize {
        let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let Ok(tet) = Tet::new(0, rest, moved, 1.0, dims) else { return 0 };
        let outline = Outline::new(Plain, &tet);
        let mut found = 0;
        for z in 0..dims[2] as i32 {
            let layer = outline.layer(z);
            let mut inside = vec![false; dims[0] * dims[1]];
            if (tet.lo[2]..=tet.hi[2]).contains(&z) {
                for row in layer.rows[0]..=layer.rows[1] {
                    let spans = layer.spans(row);
                    for x in spans.first[0] as i32..=spans.last[0] as i32 {
                        inside[row as usize * dims[0] + (x + tet.anchor[0]) as usize] = true;
                    }
                }
            }
            for (i, inside) in inside.into_iter().enumerate() {
                let voxel = [(i % dims[0]) as i32, (i / dims[0]) as i32, z];
                let least = tet.barycentric(voxel).into_iter().fold(f64::INFINITY, f64::min);
                // what rounding decides may go either way
                if (least + tet.slack).abs() > 1e-12 {
                    assert_eq!(inside, least > -tet.slack, "{voxel:?} of {moved:?}: {least:e}");
                }
                found += usize::from(inside);
            }
        }
        found
    }

    #[test]
    fn spans_hold_what_a_test_of_each_voxel_finds() {
        let mut state = 3u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut found = 0;
        for i in 0..600 {
            // some on whole voxels, with faces and edges along the axes, and some that reach out of the grid
            let mut corner = || {
                let p = DVec3::new(random(), random(), random()) * 16.0 - 2.0;
                match i % 3 {
                    0 => p,
                    1 => p.round(),
                    _ => (p / 5.0).round() * 5.0,
                }
            };
            found += check([corner(), corner(), corner(), corner()], [13, 11, 12]);
        }
        assert!(found > 10_000, "{found}");
        // one voxel high, and a sliver
        let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        assert!(check([p(0.0, 0.0, 3.0), p(9.0, 0.0, 3.0), p(0.0, 9.0, 3.0), p(4.0, 4.0, 4.0)], [13, 11, 12]) > 40);
        check([p(0.0, 0.0, 0.0), p(12.0, 10.0, 11.0), p(12.0, 10.0, 11.000_001), p(0.5, 0.5, 11.0)], [13, 11, 12]);
    }
}

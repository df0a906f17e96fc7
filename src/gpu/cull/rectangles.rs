//! A set of cells as few rectangles.

/// Columns of a grid at most: a row is one word.
pub const COLUMNS: usize = 64;

/// Cells `x0..x1` by `y0..y1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rectangle {
    pub x: [usize; 2],
    pub y: [usize; 2],
}

impl Rectangle {
    /// The bits of a row that lie in it.
    pub fn columns(&self) -> u64 {
        columns(self.x)
    }
}

/// Bits `x[0]..x[1]`.
pub fn columns(x: [usize; 2]) -> u64 {
    let below = |n: usize| if n >= COLUMNS { u64::MAX } else { (1 << n) - 1 };
    below(x[1]) & !below(x[0])
}

/// What a rectangle costs, counted in blocks of 4 x 4 pixels, of which software adapters shade whole ones.
#[derive(Debug, Clone, Copy)]
pub struct Cost {
    /// Blocks along the side of a cell.
    pub blocks: usize,
    /// What setting up two triangles costs.
    pub setup: usize,
}

impl Cost {
    fn of(self, r: &Rectangle) -> usize {
        let [w, h] = [r.x, r.y].map(|[a, b]| (b - a) * self.blocks);
        // blocks on the diagonal are shaded for both triangles
        w * h + w + h - gcd(w, h) + self.setup
    }
}

fn gcd(mut a: usize, mut b: usize) -> usize {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// Rectangles without overlap that hold every cell of `wanted` and none of `forbidden`, and others where that is cheaper.
/// Bit `x` of word `y` is cell `(x, y)`; both have as many rows.
pub fn cover(wanted: &[u64], forbidden: &[u64], cost: Cost) -> Vec<Rectangle> {
    let mut found = Vec::new();
    let cutter = Cutter { wanted, forbidden, cost };
    cutter.cover(&Rectangle { x: [0, COLUMNS], y: [0, wanted.len()] }, &mut found);
    found
}

struct Cutter<'a> {
    wanted: &'a [u64],
    forbidden: &'a [u64],
    cost: Cost,
}

impl Cutter<'_> {
    /// The least rectangle around what is wanted in `of`.
    fn bounds(&self, of: &Rectangle) -> Option<Rectangle> {
        let columns = of.columns();
        let mut all = 0;
        let mut y = [usize::MAX, 0];
        for row in of.y[0]..of.y[1] {
            let bits = self.wanted[row] & columns;
            if bits != 0 {
                all |= bits;
                y = [y[0].min(row), row + 1];
            }
        }
        (all != 0).then(|| Rectangle { x: [all.trailing_zeros() as usize, 64 - all.leading_zeros() as usize], y })
    }

    /// Appends the rectangles of what is wanted in `of`, and returns their cost.
    fn cover(&self, of: &Rectangle, found: &mut Vec<Rectangle>) -> usize {
        let Some(all) = self.bounds(of) else { return 0 };
        let columns = all.columns();
        let mut full = true;
        let mut allowed = true;
        for row in all.y[0]..all.y[1] {
            full &= self.wanted[row] & columns == columns;
            allowed &= self.forbidden[row] & columns == 0;
        }
        let whole = self.cost.of(&all);
        if full {
            found.push(all);
            return whole;
        }
        let before = found.len();
        let [a, b] = self.split(&all);
        let parts = self.cover(&a, found) + self.cover(&b, found);
        if allowed && whole <= parts {
            found.truncate(before);
            found.push(all);
            return whole;
        }
        parts
    }

    /// Where to cut a rectangle of several cells in two, so that the bounds of both parts cost least.
    fn split(&self, all: &Rectangle) -> [Rectangle; 2] {
        let halves = |axis: usize, at: usize| {
            let mut parts = [*all; 2];
            let side = |r: &mut Rectangle, end: usize| if axis == 0 { r.x[end] = at } else { r.y[end] = at };
            side(&mut parts[0], 1);
            side(&mut parts[1], 0);
            parts
        };
        let cost = |parts: &[Rectangle; 2]| -> usize {
            parts.iter().map(|p| self.bounds(p).map_or(0, |b| self.cost.of(&b))).sum()
        };
        let cuts = (all.x[0] + 1..all.x[1]).map(|at| (0, at)).chain((all.y[0] + 1..all.y[1]).map(|at| (1, at)));
        let middle = |&(axis, at): &(usize, usize)| {
            let [lo, hi] = [all.x, all.y][axis];
            (2 * at).abs_diff(lo + hi)
        };
        // of cuts that cost the same the one nearest to the middle: fewer steps
        cuts.min_by_key(|c| (cost(&halves(c.0, c.1)), middle(c))).map_or([*all; 2], |(axis, at)| halves(axis, at))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const COST: Cost = Cost { blocks: 4, setup: 16 };

    /// How often each cell is covered.
    fn times(found: &[Rectangle], rows: usize) -> Vec<[u32; COLUMNS]> {
        let mut times = vec![[0; COLUMNS]; rows];
        for r in found {
            times[r.y[0]..r.y[1]].iter_mut().for_each(|row| row[r.x[0]..r.x[1]].iter_mut().for_each(|n| *n += 1));
        }
        times
    }

    proptest! {
        #[test]
        fn all_is_covered_once_and_nothing_forbidden(
            cells in proptest::collection::vec((any::<u64>(), any::<u64>(), any::<u64>()), 0..64),
        ) {
            // few bits are rarer among three words
            let wanted: Vec<_> = cells.iter().map(|c| c.0 & c.1).collect();
            let forbidden: Vec<_> = cells.iter().map(|c| c.1 & c.2 & !c.0).collect();
            let found = cover(&wanted, &forbidden, COST);
            for (y, row) in times(&found, wanted.len()).iter().enumerate() {
                for (x, n) in row.iter().enumerate() {
                    prop_assert!(*n <= 1);
                    prop_assert!(*n == 1 || wanted[y] >> x & 1 == 0, "{} {} is missing", x, y);
                    prop_assert!(*n == 0 || forbidden[y] >> x & 1 == 0, "{} {} is forbidden", x, y);
                }
            }
        }
    }

    #[test]
    fn few_are_enough() {
        let block = |x: [usize; 2], y: [usize; 2]| -> Vec<u64> {
            (0..20).map(|row| if (y[0]..y[1]).contains(&row) { columns(x) } else { 0 }).collect()
        };
        let none = vec![0; 20];
        assert_eq!(cover(&none, &none, COST), []);
        assert_eq!(cover(&block([3, 64], [2, 20]), &none, COST), [Rectangle { x: [3, 64], y: [2, 20] }]);
        // a hole of one cell is not worth more rectangles, unless it must not be drawn
        let mut holed = block([0, 10], [0, 10]);
        holed[4] &= !(1 << 5);
        assert_eq!(cover(&holed, &none, COST).len(), 1);
        let hole: Vec<_> = (0..20).map(|y| u64::from(y == 4) << 5).collect();
        assert_eq!(cover(&holed, &hole, COST).len(), 4);
        // two things far apart
        let both: Vec<_> = block([0, 9], [0, 9]).iter().zip(block([40, 50], [12, 20])).map(|(a, b)| a | b).collect();
        assert_eq!(cover(&both, &none, COST).len(), 2);
    }
}

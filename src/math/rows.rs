//! Rows that sides of polygons pass.

use glam::DVec2;

/// Rows of unit height, one above the other.
#[derive(Debug, Clone, Copy)]
pub struct Rows {
    /// Where the first begins.
    pub bottom: f64,
    pub count: usize,
    /// What lies no farther from a row counts as being in it.
    pub hair: f64,
}

impl Rows {
    /// Calls `visit` for each row that the side from `a` to `b` passes, with the least and the largest place along the row.
    #[inline]
    pub fn passed(&self, a: DVec2, b: DVec2, mut visit: impl FnMut(usize, f64, f64)) {
        let (low, high) = if a.y <= b.y { (a, b) } else { (b, a) };
        let Self { bottom, count, hair } = *self;
        if !(high.y + hair >= bottom && low.y - hair <= bottom + count as f64) {
            return;
        }
        // both are positive, so that the cast rounds down
        let from = (low.y - hair - bottom).max(0.0) as usize;
        let end = ((high.y + hair - bottom) as usize + 1).min(count);
        let slope = (high.x - low.x) / (high.y - low.y);
        let (left, right) = (low.x.min(high.x), low.x.max(high.x));
        let at = |y: f64| (low.x + slope * (y - low.y)).max(left).min(right);
        for row in from..end {
            let y = bottom + row as f64;
            let (x0, x1) = if slope.is_finite() { (at(y - hair), at(y + 1.0 + hair)) } else { (a.x, b.x) };
            visit(row, x0.min(x1), x0.max(x1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_side_is_met_in_the_rows_it_passes() {
        let rows = Rows { bottom: -2.0, count: 4, hair: 1e-6 };
        let passed = |a: [f64; 2], b: [f64; 2]| {
            let mut all = Vec::new();
            rows.passed(a.into(), b.into(), |row, lo, hi| {
                all.push((row, (lo * 100.0).round() / 100.0, (hi * 100.0).round() / 100.0));
            });
            all
        };
        let rising = vec![(0, 0.5, 1.0), (1, 1.0, 2.0), (2, 2.0, 2.5)];
        assert_eq!(passed([0.5, -1.5], [2.5, 0.5]), rising);
        assert_eq!(passed([2.5, 0.5], [0.5, -1.5]), rising);
        // along a row, straight up, on the border between two, beyond
        assert_eq!(passed([3.0, 1.5], [1.0, 1.5]), [(3, 1.0, 3.0)]);
        assert_eq!(passed([1.0, -9.0], [1.0, 9.0]), [0, 1, 2, 3].map(|row| (row, 1.0, 1.0)));
        assert_eq!(passed([0.0, 0.0], [1.0, 0.0]), [(1, 0.0, 1.0), (2, 0.0, 1.0)]);
        assert_eq!(passed([0.0, 3.0], [1.0, 2.5]), []);
        assert_eq!(passed([0.0, -2.5], [1.0, f64::NAN]), []);
    }
}

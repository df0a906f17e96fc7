//! Finds the edges of an indexed triangle list: every pair of vertices gets one number.

/// Open addressing on the packed pair of vertices. Kept between slices; an old entry is known by its stamp.
#[derive(Debug, Default)]
pub(super) struct EdgeTable {
    /// Smaller vertex, larger vertex, stamp, edge.
    slots: Vec<[u32; 4]>,
    stamp: u32,
}

impl EdgeTable {
    /// Empties the table and makes room for the edges of `triangles` triangles.
    pub fn clear(&mut self, triangles: usize) {
        // at most three edges each, filled to at most three quarters
        let wanted = (triangles * 4).next_power_of_two().max(16);
        if self.slots.len() < wanted || self.stamp == u32::MAX {
            self.slots.clear();
            self.slots.resize(wanted, [0; 4]);
            self.stamp = 0;
        }
        self.stamp += 1;
    }

    /// The number of the edge between `a` and `b`, and whether it is new; then it gets the number `next`.
    pub fn find_or_insert(&mut self, a: u32, b: u32, next: u32) -> (u32, bool) {
        let (lo, hi) = if a < b { (a, b) } else { (b, a) };
        let key = u64::from(lo) << 32 | u64::from(hi);
        let mask = self.slots.len() - 1;
        // Fibonacci hashing: the high bits of the product are well mixed
        let mut i = (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as usize & mask;
        loop {
            let slot = &mut self.slots[i];
            if slot[2] != self.stamp {
                *slot = [lo, hi, self.stamp, next];
                return (next, true);
            }
            if slot[0] == lo && slot[1] == hi {
                return (slot[3], false);
            }
            i = (i + 1) & mask;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::EdgeTable;

    #[test]
    fn every_pair_has_one_number_whichever_way_round_and_clearing_forgets() {
        let mut table = EdgeTable::default();
        for round in 0..3 {
            table.clear(50 * 50);
            let mut next = 0;
            for a in 0..70_u32 {
                for b in 0..a {
                    assert_eq!(table.find_or_insert(a, b, next), (next, true), "{round}");
                    assert_eq!(table.find_or_insert(b, a, 999_999), (next, false));
                    next += 1;
                }
            }
        }
    }
}

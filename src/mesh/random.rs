//! Random numbers that are the same in every run.

use glam::DVec3;

/// SplitMix64 (Steele, Lea and Flood 2014).
pub(super) struct Random(u64);

impl Random {
    /// Different for each pair of numbers.
    pub fn new(seed: u64, item: u64) -> Self {
        let mut random = Self(seed);
        random.0 = random.bits() ^ item;
        random.0 = random.bits();
        random
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// In the box, evenly.
    pub fn in_box(&mut self, lo: DVec3, hi: DVec3) -> DVec3 {
        lo + (hi - lo) * DVec3::new(self.unit(), self.unit(), self.unit())
    }

    /// Barycentric coordinates in a tetrahedron, evenly: the gaps between three numbers in order.
    pub fn barycentric(&mut self) -> [f64; 4] {
        let mut t = [self.unit(), self.unit(), self.unit()];
        t.sort_unstable_by(f64::total_cmp);
        [t[0], t[1] - t[0], t[2] - t[1], 1.0 - t[2]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn barycentric_coordinates_are_even_and_repeatable() {
        let mut mean = [0.0; 4];
        for item in 0..4000 {
            let b = Random::new(7, item).barycentric();
            assert!(b.iter().all(|&x| (0.0..=1.0).contains(&x)) && (b.iter().sum::<f64>() - 1.0).abs() < 1e-15);
            assert_eq!(b, Random::new(7, item).barycentric());
            (0..4).for_each(|i| mean[i] += b[i] / 4000.0);
        }
        assert!(mean.iter().all(|m| (m - 0.25).abs() < 0.01), "{mean:?}");
    }
}

//! Arrays, for processors without the vector registers that there is a machine for.

use super::{LANES, Lanes, Machine};

/// Arrays.
#[derive(Debug, Clone, Copy)]
pub struct Plain;

// Loops without closures or iterators, and calls where the compiler prefers them: all work is compiled for this machine too,
// which should not take longer than for the better one.

macro_rules! by_lane {
    ($l:ident => $of:expr) => {{
        let mut out = [Default::default(); LANES];
        let mut $l = 0;
        while $l < LANES {
            out[$l] = $of;
            $l += 1;
        }
        out
    }};
}

impl Machine for Plain {
    type Float = Lanes;
    type Int = [i32; LANES];
    fn splat(self, v: f32) -> Lanes {
        [v; LANES]
    }
    #[inline]
    fn load(self, v: Lanes) -> Lanes {
        v
    }
    #[inline]
    fn store(self, v: Lanes) -> Lanes {
        v
    }
    fn add(self, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => a[l] + b[l])
    }
    fn sub(self, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => a[l] - b[l])
    }
    fn mul(self, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => a[l] * b[l])
    }
    fn div(self, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => a[l] / b[l])
    }
    fn mul_add(self, a: Lanes, b: Lanes, c: Lanes) -> Lanes {
        // not fused: where there is no instruction for it, that is a function of the system
        by_lane!(l => a[l] * b[l] + c[l])
    }
    fn min(self, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => if a[l] < b[l] { a[l] } else { b[l] })
    }
    fn max(self, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => if a[l] > b[l] { a[l] } else { b[l] })
    }
    fn sqrt(self, v: Lanes) -> Lanes {
        by_lane!(l => v[l].sqrt())
    }
    fn below(self, a: Lanes, b: Lanes) -> u32 {
        let bits: [u32; LANES] = by_lane!(l => u32::from(a[l] < b[l]) << l);
        bits.iter().sum()
    }
    fn pick(self, mask: u32, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => if mask >> l & 1 == 1 { a[l] } else { b[l] })
    }
    fn pick_below(self, x: Lanes, y: Lanes, a: Lanes, b: Lanes) -> Lanes {
        by_lane!(l => if x[l] < y[l] { a[l] } else { b[l] })
    }
    fn truncate(self, v: Lanes) -> [i32; LANES] {
        by_lane!(l => v[l] as i32)
    }
    fn to_float(self, v: [i32; LANES]) -> Lanes {
        by_lane!(l => v[l] as f32)
    }
    fn bits(self, v: Lanes) -> [i32; LANES] {
        by_lane!(l => v[l].to_bits() as i32)
    }
    fn of_bits(self, v: [i32; LANES]) -> Lanes {
        by_lane!(l => f32::from_bits(v[l] as u32))
    }
    fn int_splat(self, v: i32) -> [i32; LANES] {
        [v; LANES]
    }
    #[inline]
    fn int_load(self, v: [i32; LANES]) -> [i32; LANES] {
        v
    }
    #[inline]
    fn int_store(self, v: [i32; LANES]) -> [i32; LANES] {
        v
    }
    fn int_add(self, a: [i32; LANES], b: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => a[l].wrapping_add(b[l]))
    }
    fn int_sub(self, a: [i32; LANES], b: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => a[l].wrapping_sub(b[l]))
    }
    fn int_mul(self, a: [i32; LANES], b: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => a[l].wrapping_mul(b[l]))
    }
    fn int_and(self, a: [i32; LANES], b: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => a[l] & b[l])
    }
    fn shift_right<const N: i32>(self, v: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => (v[l] as u32 >> N) as i32)
    }
    fn shift_left<const N: i32>(self, v: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => v[l] << N)
    }
    fn arithmetic_right<const N: i32>(self, v: [i32; LANES]) -> [i32; LANES] {
        by_lane!(l => v[l] >> N)
    }
    fn along(self, rows: [[&[f32; 4]; 2]; LANES], part: Lanes) -> [Lanes; 4] {
        let mut out = [[0.0; LANES]; 4];
        for (c, out) in out.iter_mut().enumerate() {
            *out = by_lane!(l => rows[l][0][c] + (rows[l][1][c] - rows[l][0][c]) * part[l]);
        }
        out
    }
}

//! Voxels without a tetrahedron that are shut in by others: holes, as against what lies about a mesh.

const COVERED: u8 = 0;
const OPEN: u8 = 1;
const REACHED: u8 = 2;

/// How many of the voxels without a tetrahedron cannot be reached from the border of the grid through faces of others.
/// `uncovered`: for each layer the numbers of its uncovered voxels.
pub(super) fn enclosed([nx, ny, nz]: [usize; 3], uncovered: &[Vec<u32>]) -> u64 {
    let mut state = vec![COVERED; nx * ny * nz];
    for (z, layer) in uncovered.iter().enumerate() {
        layer.iter().for_each(|i| state[z * nx * ny + *i as usize] = OPEN);
    }
    let border = |i: usize| {
        let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
        x == 0 || y == 0 || z == 0 || x + 1 == nx || y + 1 == ny || z + 1 == nz
    };
    let steps = [1, nx, nx * ny];
    // sweeps to and fro, until nothing more is reached; only voxels that are no border look at neighbours
    loop {
        let mut changed = false;
        let count = state.len();
        for up in [true, false] {
            for n in 0..count {
                let i = if up { n } else { count - 1 - n };
                let reaches =
                    |s: &[u8]| border(i) || steps.iter().any(|d| s[if up { i - d } else { i + d }] == REACHED);
                if state[i] == OPEN && reaches(&state) {
                    state[i] = REACHED;
                    changed = true;
                }
            }
        }
        if !changed {
            return state.iter().filter(|s| **s == OPEN).count() as u64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn caves_with_a_way_out_are_no_holes() {
        // a cave of two voxels, a winding way in to another
        let dims = [7, 7, 7];
        let at = |x: usize, y: usize| (y * 7 + x) as u32;
        let mut layers = vec![Vec::new(); 7];
        layers[2] = vec![at(2, 2), at(3, 2)];
        assert_eq!(enclosed(dims, &layers), 2);
        layers[4] = vec![at(3, 3), at(4, 3), at(4, 4)];
        layers[5] = vec![at(4, 4)];
        layers[6] = vec![at(4, 4)];
        assert_eq!(enclosed(dims, &layers), 2);
        layers[3] = vec![at(3, 2), at(3, 3)];
        assert_eq!(enclosed(dims, &layers), 0);
        assert_eq!(enclosed([1, 1, 1], &[vec![0]]), 0);
    }
}

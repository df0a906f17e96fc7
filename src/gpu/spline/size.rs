//! Sizes of what is on the device, as pure functions.

use super::Coefficients;
use crate::gpu::GpuError;
use crate::gpu::layout::grown;

/// Cubes along each side of a block; its 64 cubes are worked off by a workgroup.
pub const SIDE: usize = 4;
pub const KINDS: u64 = 24;
/// Counts of a block: tetrahedra of each kind, and cubes with such.
const ROWS: u64 = KINDS + 1;
/// Tetrahedra that one instance draws: an instance for each alone would cost more than its triangles.
pub const BATCH: u32 = 64;
/// Numbers that a workgroup scans.
pub const SCAN_CHUNK: u64 = 2048;
/// Bytes of the masks and of the counts of an active block.
const MASKS: u64 = 64 * 4;
/// Bytes of a tetrahedron in its list (of a cube, too), of its coefficients, and of those that determine a cube's.
const TET: u64 = 4;
const PIECE: u64 = 20 * 4;
const CUBE: u64 = 56 * 4;

/// Blocks along i, j, k.
pub fn blocks(dims: [usize; 3]) -> [usize; 3] {
    dims.map(|n| n.div_ceil(SIDE))
}

/// What there is room for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room {
    /// Active blocks.
    pub blocks: u32,
    pub tets: u32,
    /// Cubes with tetrahedra; none where nothing is stored of them.
    pub cubes: u32,
    pub coefficients: Coefficients,
}

impl Room {
    /// For a surface of the usual size; `limit`: bytes of a buffer.
    pub fn first(blocks: u64, coefficients: Coefficients, limit: u64) -> Self {
        // a few times as many blocks as a plane through the volume meets
        let wanted = blocks.min((8.0 * (blocks as f64).powf(2.0 / 3.0)) as u64 + 64);
        let blocks = wanted.min(limit / MASKS);
        // about 20 cubes of a block that the surface passes through, with a third of their tetrahedra
        let [each, most] = of_tets(coefficients, limit);
        let tets = (blocks * 64).max(1 << 16).min(most / each);
        let cubes = match coefficients {
            Coefficients::Determining => (blocks * 8).max(1 << 13).min(limit / CUBE),
            Coefficients::OnTheFly | Coefficients::Stored => 0,
        };
        Self { blocks: blocks as u32, tets: tets as u32, cubes: cubes as u32, coefficients }
    }

    /// Room for the blocks, tetrahedra and cubes that were wanted.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if no buffer holds that.
    pub fn grown(self, [blocks, tets, cubes]: [u32; 3], limit: u64) -> Result<Self, GpuError> {
        let grow = |have: u32, want: u32, [each, limit]: [u64; 2], what| {
            let (need, most) = (u64::from(want) * each, limit / each * each);
            if need > most {
                return Err(GpuError::TooLarge {
                    what: "an isosurface",
                    size: format!("{want} {what}"),
                    limit: format!("{} {what}", limit / each),
                });
            }
            Ok((grown(u64::from(have) * each, need, most) / each) as u32)
        };
        Ok(Self {
            blocks: grow(self.blocks, blocks, [MASKS, limit], "blocks")?,
            tets: grow(self.tets, tets, of_tets(self.coefficients, limit), "tetrahedra")?,
            cubes: match self.coefficients {
                Coefficients::Determining => grow(self.cubes, cubes, [CUBE, limit], "cubes")?,
                Coefficients::OnTheFly | Coefficients::Stored => 0,
            },
            coefficients: self.coefficients,
        })
    }

    /// Cubes with tetrahedra that there may be.
    pub fn most_cubes(self) -> u32 {
        match self.coefficients {
            Coefficients::Determining => self.cubes,
            Coefficients::OnTheFly | Coefficients::Stored => u32::MAX,
        }
    }

    /// Bytes of the lists of blocks, masks, counts, tetrahedra (and cubes) and coefficients.
    pub fn bytes(self) -> [u64; 5] {
        let [blocks, tets, cubes] = [self.blocks, self.tets, self.cubes].map(u64::from);
        // a sum stands behind the counts; a buffer is never empty
        let store = coefficient_bytes(self.coefficients, self.tets, self.cubes).max(PIECE);
        [4 * blocks, MASKS * blocks, 4 * (ROWS * blocks + 1), TET * (tets + cubes), store]
    }

    /// Bytes of the sums of scanned chunks, for the counts and for all blocks of the volume.
    pub fn sums(self, all_blocks: u64) -> u64 {
        4 * (ROWS * u64::from(self.blocks)).max(all_blocks).div_ceil(SCAN_CHUNK).max(1)
    }
}

/// Bytes of what is stored of so many tetrahedra in so many cubes.
pub fn coefficient_bytes(coefficients: Coefficients, tets: u32, cubes: u32) -> u64 {
    match coefficients {
        Coefficients::OnTheFly => 0,
        Coefficients::Stored => PIECE * u64::from(tets),
        Coefficients::Determining => CUBE * u64::from(cubes),
    }
}

/// Bytes of a tetrahedron in the buffer that holds fewest of them, and most of all.
fn of_tets(coefficients: Coefficients, limit: u64) -> [u64; 2] {
    match coefficients {
        Coefficients::OnTheFly => [TET, limit],
        Coefficients::Stored => [PIECE, limit],
        // their list has room for the numbers of as many cubes as can be stored
        Coefficients::Determining => [TET, limit - TET * (limit / CUBE)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: u64 = 128 << 20;

    #[test]
    fn rooms_hold_what_is_wanted_and_fit_in_buffers() {
        for coefficients in Coefficients::ALL {
            for all in [1, 8, 1000, 32_768, 262_144, 2_097_152, 134_217_728] {
                let room = Room::first(all, coefficients, LIMIT);
                assert!(room.blocks > 0 && u64::from(room.blocks) <= all && room.tets > 0, "{room:?}");
                assert!(room.bytes().iter().all(|b| *b <= LIMIT && *b > 0), "{room:?}");
                let most = (LIMIT / MASKS) as u32;
                for wanted in [[1, 1, 1], [(room.blocks + 1).min(most), 3, 2], [500_000, 1_600_000, 590_000]] {
                    let more = room.grown(wanted, LIMIT).unwrap();
                    let [blocks, tets, cubes] = wanted;
                    assert!(more.blocks >= blocks.max(room.blocks) && more.tets >= tets.max(room.tets), "{more:?}");
                    assert!(more.most_cubes() >= cubes.max(room.cubes), "{more:?}");
                    assert!(more.bytes().iter().all(|b| *b <= LIMIT), "{more:?}");
                }
            }
        }
        let [fly, stored, determining] = Coefficients::ALL.map(|c| Room::first(1 << 21, c, LIMIT));
        let fails = |room: Room, wanted| matches!(room.grown(wanted, LIMIT), Err(GpuError::TooLarge { .. }));
        for (wanted, failing) in [
            ([600_000, 1, 1], [true, true, true]),
            ([1, 1_700_000, 1], [false, true, false]),
            ([1, 1, 600_000], [false, false, true]),
            ([1, 33_300_000, 1], [false, true, true]),
        ] {
            assert_eq!([fly, stored, determining].map(|room| fails(room, wanted)), failing, "{wanted:?}");
        }
    }

    #[test]
    fn every_chunk_has_a_sum() {
        let room = Room { blocks: 1000, tets: 1, cubes: 0, coefficients: Coefficients::OnTheFly };
        assert_eq!(room.sums(1), 4 * 13);
        assert_eq!(room.sums(1 << 21), 4 * 1024);
        assert_eq!(blocks([1, 4, 5]), [1, 1, 2]);
    }
}

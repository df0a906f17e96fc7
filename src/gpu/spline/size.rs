//! Sizes of what is on the device, as pure functions.

use crate::gpu::GpuError;
use crate::gpu::layout::grown;

/// Cubes along each side of a block; its 64 cubes are worked off by a workgroup.
pub const SIDE: usize = 4;
pub const KINDS: u64 = 24;
/// Tetrahedra that one instance draws: an instance for each alone would cost more than its triangles.
pub const BATCH: u32 = 64;
/// Numbers that a workgroup scans.
pub const SCAN_CHUNK: u64 = 2048;
/// Bytes of the masks and of the counts of an active block.
const MASKS: u64 = 64 * 4;
/// Bytes of a tetrahedron in its list, and of its coefficients.
const TET: u64 = 4;
const PIECE: u64 = 20 * 4;

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
    /// Whether coefficients are stored.
    pub stored: bool,
}

impl Room {
    /// For a surface of the usual size; `limit`: bytes of a buffer.
    pub fn first(blocks: u64, stored: bool, limit: u64) -> Self {
        // a few times as many blocks as a plane through the volume meets
        let wanted = blocks.min((8.0 * (blocks as f64).powf(2.0 / 3.0)) as u64 + 64);
        let blocks = wanted.min(limit / MASKS);
        // about 20 cubes of a block that the surface passes through, with a third of their tetrahedra
        let tets = (blocks * 64).max(1 << 16).min(limit / tet_bytes(stored));
        Self { blocks: blocks as u32, tets: tets as u32, stored }
    }

    /// Room for what was wanted.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if no buffer holds that.
    pub fn grown(self, blocks: u32, tets: u32, limit: u64) -> Result<Self, GpuError> {
        let grow = |have: u32, want: u32, each: u64, what| {
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
            blocks: grow(self.blocks, blocks, MASKS, "blocks")?,
            tets: grow(self.tets, tets, tet_bytes(self.stored), "tetrahedra")?,
            stored: self.stored,
        })
    }

    /// Bytes of the lists of blocks, masks, counts, tetrahedra and coefficients.
    pub fn bytes(self) -> [u64; 5] {
        let (blocks, tets) = (u64::from(self.blocks), u64::from(self.tets));
        // a sum stands behind the counts; a buffer is never empty
        [
            4 * blocks,
            MASKS * blocks,
            4 * (KINDS * blocks + 1),
            TET * tets,
            if self.stored { PIECE * tets } else { PIECE },
        ]
    }

    /// Bytes of the sums of scanned chunks, for the counts and for all blocks of the volume.
    pub fn sums(self, all_blocks: u64) -> u64 {
        4 * (KINDS * u64::from(self.blocks)).max(all_blocks).div_ceil(SCAN_CHUNK).max(1)
    }
}

fn tet_bytes(stored: bool) -> u64 {
    if stored { PIECE } else { TET }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: u64 = 128 << 20;

    #[test]
    fn rooms_hold_what_is_wanted_and_fit_in_buffers() {
        for stored in [false, true] {
            for all in [1, 8, 1000, 32_768, 262_144, 2_097_152, 134_217_728] {
                let room = Room::first(all, stored, LIMIT);
                assert!(room.blocks > 0 && u64::from(room.blocks) <= all && room.tets > 0, "{room:?}");
                assert!(room.bytes().iter().all(|b| *b <= LIMIT && *b > 0), "{room:?}");
                let most = (LIMIT / MASKS) as u32;
                for (blocks, tets) in [(1, 1), ((room.blocks + 1).min(most), 3), (500_000, 1_600_000)] {
                    let more = room.grown(blocks, tets, LIMIT).unwrap();
                    assert!(more.blocks >= blocks.max(room.blocks) && more.tets >= tets.max(room.tets), "{more:?}");
                    assert!(more.bytes().iter().all(|b| *b <= LIMIT), "{more:?}");
                }
            }
        }
        let room = Room::first(1 << 21, true, LIMIT);
        assert!(matches!(room.grown(600_000, 1, LIMIT), Err(GpuError::TooLarge { .. })));
        assert!(matches!(room.grown(1, 1_700_000, LIMIT), Err(GpuError::TooLarge { .. })));
        assert!(Room { stored: false, ..room }.grown(1, 1_700_000, LIMIT).is_ok());
    }

    #[test]
    fn every_chunk_has_a_sum() {
        let room = Room { blocks: 1000, tets: 1, stored: false };
        assert_eq!(room.sums(1), 4 * 12);
        assert_eq!(room.sums(1 << 21), 4 * 1024);
        assert_eq!(blocks([1, 4, 5]), [1, 1, 2]);
    }
}

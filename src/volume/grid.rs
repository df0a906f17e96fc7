use glam::{DAffine3, DMat3, DVec3};

/// What the axes of the world stand for, where a file says so. Coordinates are always kept as written in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Space {
    /// Not said (raw, simulation data).
    #[default]
    Unknown,
    /// x to the patient's right, y to the front, z up (NIfTI).
    Ras,
    /// x to the patient's left, y to the back, z up (DICOM, MetaImage, many NRRDs).
    Lps,
}

/// Why a grid cannot be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GridError {
    #[error("a grid of {0}x{1}x{2} voxels is empty; every size must be at least 1")]
    Empty(usize, usize, usize),
    #[error("a grid of {0}x{1}x{2} voxels is too large to address")]
    TooLarge(usize, usize, usize),
    #[error("the voxel axes are not finite or lie in one plane, so no point could be found in the volume")]
    Singular,
}

/// A regular grid of voxels in the world: its size and the full affine frame (spacing, direction, origin).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Voxels along i, j, k.
    pub dims: [usize; 3],
    /// Maps a voxel index (the centre of voxel 0 at 0) to the world. Its columns are direction * spacing.
    pub world_from_voxel: DAffine3,
    pub space: Space,
}

impl Grid {
    /// # Errors
    /// If a size is zero, the number of voxels does not fit `isize`, or the frame cannot be inverted.
    pub fn new(dims: [usize; 3], world_from_voxel: DAffine3, space: Space) -> Result<Self, GridError> {
        let [x, y, z] = dims;
        if x == 0 || y == 0 || z == 0 {
            return Err(GridError::Empty(x, y, z));
        }
        x.checked_mul(y)
            .and_then(|n| n.checked_mul(z))
            .filter(|&n| n <= isize::MAX as usize / 32)
            .ok_or(GridError::TooLarge(x, y, z))?;
        let m = world_from_voxel.matrix3;
        let scale = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
        let sound = world_from_voxel.is_finite() && scale > 0.0 && m.determinant().abs() > 1e-9 * scale;
        if !sound {
            return Err(GridError::Singular);
        }
        Ok(Self { dims, world_from_voxel, space })
    }

    /// An axis-aligned grid.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn aligned(dims: [usize; 3], spacing: DVec3, origin: DVec3) -> Result<Self, GridError> {
        Self::new(dims, DAffine3::from_mat3_translation(DMat3::from_diagonal(spacing), origin), Space::Unknown)
    }

    /// The same grid with its coordinates in another space. Between RAS and LPS the first two world axes turn round; from or
    /// to [`Space::Unknown`] only the tag changes, because nothing is known about the coordinates. This is about where voxels
    /// lie: samples that are themselves vectors in the world are not turned.
    pub fn in_space(&self, space: Space) -> Self {
        let turned = matches!((self.space, space), (Space::Ras, Space::Lps) | (Space::Lps, Space::Ras));
        let mut frame = self.world_from_voxel;
        if turned {
            let half_turn = DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0));
            frame = DAffine3::from_mat3_translation(half_turn * frame.matrix3, half_turn * frame.translation);
        }
        Self { world_from_voxel: frame, space, ..*self }
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.dims[0] * self.dims[1] * self.dims[2]
    }

    /// Never: a grid has at least one voxel.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// The sizes as a vector.
    pub fn size(&self) -> DVec3 {
        DVec3::new(self.dims[0] as f64, self.dims[1] as f64, self.dims[2] as f64)
    }

    /// Distance of neighbouring voxel centres along i, j, k.
    pub fn spacing(&self) -> DVec3 {
        let m = self.world_from_voxel.matrix3;
        DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
    }

    /// World position of the centre of voxel (0,0,0).
    pub fn origin(&self) -> DVec3 {
        self.world_from_voxel.translation
    }

    /// Unit world directions in which i, j, k grow, as columns.
    pub fn direction(&self) -> DMat3 {
        let m = self.world_from_voxel.matrix3;
        DMat3::from_cols(m.x_axis.normalize(), m.y_axis.normalize(), m.z_axis.normalize())
    }

    pub fn voxel_from_world(&self) -> DAffine3 {
        self.world_from_voxel.inverse()
    }

    /// Texture space is `[0,1]^3` over the whole voxels: the centre of voxel i lies at (i + 1/2) / n.
    pub fn texture_from_voxel(&self) -> DAffine3 {
        let inv = self.size().recip();
        DAffine3::from_mat3_translation(DMat3::from_diagonal(inv), 0.5 * inv)
    }

    pub fn texture_from_world(&self) -> DAffine3 {
        self.texture_from_voxel() * self.voxel_from_world()
    }

    pub fn world_from_texture(&self) -> DAffine3 {
        self.world_from_voxel * self.texture_from_voxel().inverse()
    }

    /// Corners of the texture cube in the world; bits 0, 1, 2 of the index choose the upper side along i, j, k.
    pub fn corners(&self) -> [DVec3; 8] {
        let m = self.world_from_texture();
        std::array::from_fn(|i| {
            m.transform_point3(DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64))
        })
    }

    /// Lower and upper corner, in the world, of the box around the texture cube.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let c = self.corners();
        c.iter().fold((c[0], c[0]), |(lo, hi), p| (lo.min(*p), hi.max(*p)))
    }

    /// Middle of the texture cube in the world.
    pub fn center(&self) -> DVec3 {
        self.world_from_texture().transform_point3(DVec3::splat(0.5))
    }

    /// The smallest spacing: the "voxel" in which tolerances and slice distances are given.
    pub fn finest(&self) -> f64 {
        self.spacing().min_element()
    }
}

//! Lattices of boxes, each cut into five or six tetrahedra, over a parallelepiped.
//!
//! # Theory
//!
//! A box of five tetrahedra has a regular one in its middle, whose edges are diagonals of the six faces; neighbours are
//! cut the other way round, so that the diagonals meet. A box of six is cut along the paths from its lowest to its
//! highest corner (Kuhn 1960): all boxes are cut in the same way, the tetrahedra are congruent, and halving the boxes
//! halves them.
//!
//! # Practice
//!
//! Box (i, j, k) has its corners at the fractions i / cells.x .. (i + 1) / cells.x of the parallelepiped and so on, so
//! that the outer faces are exact. Points are in order of k, j, i with i fastest, tetrahedra in the order of their
//! boxes.

use glam::{DAffine3, DMat3, DVec3};

use super::tets::TetMesh;

/// Tetrahedra of a lattice, at most.
pub const MOST_TETS: usize = 1 << 27;

/// How much a step away from cubes weighs against one away from the wanted number, both as logarithms.
const SHAPE_WEIGHT: f64 = 0.5;

/// Into how many tetrahedra each box is cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Split {
    Five,
    #[default]
    Six,
}

/// Why there is no lattice.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TetLatticeError {
    #[error("a lattice of {0}x{1}x{2} boxes is empty; every side must have at least 1")]
    Empty(usize, usize, usize),
    #[error("the lattice would have {0} tetrahedra; at most {MOST_TETS} are possible")]
    TooMany(u128),
    #[error("no tetrahedra are wanted; ask for at least 1")]
    NoneWanted,
    #[error("the region of the lattice is not finite or lies in one plane")]
    Singular,
    #[error("a volume of {0}x{1}x{2} samples has no inside to be filled; every size must be at least 2")]
    Flat(usize, usize, usize),
}

/// Corners are numbered x + 2 y + 4 z; for boxes with an even i + j + k, and for odd ones.
const FIVE: [[[usize; 4]; 5]; 2] = [
    [[0, 1, 2, 4], [3, 2, 1, 7], [5, 4, 7, 1], [6, 7, 4, 2], [1, 2, 4, 7]],
    [[1, 0, 5, 3], [2, 3, 6, 0], [4, 5, 0, 6], [7, 6, 3, 5], [0, 3, 5, 6]],
];
/// The paths from corner 0 to corner 7; every other one is negative.
pub(super) const SIX: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 6, 7], [0, 4, 5, 7], [0, 1, 5, 7]];

impl Split {
    pub fn tets_per_box(self) -> usize {
        match self {
            Self::Five => 5,
            Self::Six => 6,
        }
    }
}

/// A lattice of `cells` boxes over the image of the unit cube. All tetrahedra are positive, also where the axes are
/// left-handed.
///
/// # Errors
/// See [`TetLatticeError`].
pub fn tet_lattice(world_from_unit: &DAffine3, cells: [usize; 3], split: Split) -> Result<TetMesh, TetLatticeError> {
    check_region(world_from_unit)?;
    check_cells(cells, split)?;
    let [nx, ny, nz] = cells;
    let size = DVec3::from_array(cells.map(|n| n as f64));
    let mut points = Vec::with_capacity((nx + 1) * (ny + 1) * (nz + 1));
    let mut tets = Vec::with_capacity(nx * ny * nz * split.tets_per_box());
    for k in 0..=nz {
        for j in 0..=ny {
            for i in 0..=nx {
                let unit = DVec3::new(i as f64, j as f64, k as f64) / size;
                points.push(world_from_unit.transform_point3(unit));
            }
        }
    }
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let pattern: &[[usize; 4]] = match split {
                    Split::Five => &FIVE[(i + j + k) % 2],
                    Split::Six => &SIX,
                };
                let corner = |c: usize| point_id(cells, [i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)]);
                tets.extend(pattern.iter().map(|t| t.map(corner)));
            }
        }
    }
    let mut mesh = TetMesh::new(points, tets);
    // paths are of both signs, and a map that mirrors turns all round
    for t in 0..mesh.tets.len() {
        if mesh.tet_volume(t) < 0.0 {
            mesh.tets[t].swap(1, 2);
        }
    }
    Ok(mesh)
}

/// Number of a lattice point.
pub(super) fn point_id(cells: [usize; 3], [i, j, k]: [usize; 3]) -> u32 {
    (i + (cells[0] + 1) * (j + (cells[1] + 1) * k)) as u32
}

pub(super) fn check_region(world_from_unit: &DAffine3) -> Result<(), TetLatticeError> {
    let m = world_from_unit.matrix3;
    let scale = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    if world_from_unit.is_finite() && scale > 0.0 && m.determinant().abs() > 1e-9 * scale {
        Ok(())
    } else {
        Err(TetLatticeError::Singular)
    }
}

pub(super) fn check_cells(cells: [usize; 3], split: Split) -> Result<(), TetLatticeError> {
    if cells.contains(&0) {
        return Err(TetLatticeError::Empty(cells[0], cells[1], cells[2]));
    }
    let tets = cells.iter().try_fold(split.tets_per_box() as u128, |p, &n| p.checked_mul(n as u128));
    match tets {
        Some(tets) if tets <= MOST_TETS as u128 => Ok(()),
        tets => Err(TetLatticeError::TooMany(tets.unwrap_or(u128::MAX))),
    }
}

/// Boxes along the three axes so that their edges are about equal in the world and there are about `wanted` tetrahedra.
///
/// # Errors
/// If none or too many are wanted, or the region is singular.
pub fn cells_for(world_from_unit: &DAffine3, wanted: usize, split: Split) -> Result<[usize; 3], TetLatticeError> {
    check_region(world_from_unit)?;
    if wanted == 0 {
        return Err(TetLatticeError::NoneWanted);
    }
    if wanted > MOST_TETS {
        return Err(TetLatticeError::TooMany(wanted as u128));
    }
    let m = world_from_unit.matrix3;
    let lengths = [m.x_axis.length(), m.y_axis.length(), m.z_axis.length()];
    let boxes = (wanted as f64 / split.tets_per_box() as f64).max(1.0);
    let along = |edge: f64| lengths.map(|l| (l / edge).clamp(1.0, MOST_TETS as f64));
    // the edge at which the boxes, counted in fractions, are as many as wanted
    let (mut fine, mut coarse) = (lengths.iter().copied().fold(0.0, f64::max) / boxes, lengths.iter().sum());
    for _ in 0..60 {
        let middle = f64::sqrt(fine * coarse);
        if along(middle).iter().product::<f64>() > boxes {
            fine = middle;
        } else {
            coarse = middle;
        }
    }
    let exact = along(coarse);
    let candidates = (0..8).map(|up| std::array::from_fn::<usize, 3, _>(|a| exact[a].floor() as usize + (up >> a & 1)));
    let cost = |cells: &[usize; 3]| {
        let edges: [f64; 3] = std::array::from_fn(|a| lengths[a] / cells[a] as f64);
        let count: f64 = cells.iter().map(|&n| n as f64).product();
        let (lo, hi) = edges.iter().fold((f64::INFINITY, 0.0f64), |(lo, hi), &e| (lo.min(e), hi.max(e)));
        (count / boxes).ln().abs() + SHAPE_WEIGHT * (hi / lo).ln()
    };
    let fitting = candidates.filter(|c| check_cells(*c, split).is_ok());
    fitting.min_by(|a, b| cost(a).total_cmp(&cost(b))).ok_or(TetLatticeError::TooMany(wanted as u128))
}

/// The parallelepiped from the first to the last sample along each axis of a grid: `[0, n - 1]^3` in voxels.
///
/// # Errors
/// If a side has less than two samples, or the frame is singular.
pub fn sample_extent(dims: [usize; 3], world_from_voxel: &DAffine3) -> Result<DAffine3, TetLatticeError> {
    if dims.iter().any(|&n| n < 2) {
        return Err(TetLatticeError::Flat(dims[0], dims[1], dims[2]));
    }
    let size = DMat3::from_diagonal(DVec3::from_array(dims.map(|n| (n - 1) as f64)));
    let region = *world_from_voxel * DAffine3::from_mat3(size);
    check_region(&region)?;
    Ok(region)
}

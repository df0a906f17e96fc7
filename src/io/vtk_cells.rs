//! What VTK's formats share: named arrays, lists of points, and cells by their types.

use glam::DVec3;

use super::error::Fault;
use super::numbers::Numbers;
use super::tets::Solids;
use crate::mesh::cells::CellKind;

/// A named array of points, cells or voxels.
pub(super) struct Array {
    pub name: String,
    pub components: usize,
    pub numbers: Numbers,
}

/// Lists of points, one for each cell.
#[derive(Default)]
pub(super) struct Lists {
    /// Where each list ends in `points`.
    ends: Vec<usize>,
    points: Vec<i64>,
}

impl Lists {
    /// From lists one behind another and where each of them ends.
    pub fn from_ends(points: Option<Vec<i64>>, ends: Option<Vec<i64>>) -> Result<Self, String> {
        let (Some(points), Some(ends)) = (points, ends) else {
            return Err("the points or the offsets of its cells are not whole numbers".to_owned());
        };
        let mut before = 0;
        for (i, &end) in ends.iter().enumerate() {
            if end < before || end as u64 > points.len() as u64 {
                return Err(format!(
                    "the list of points of cell {i} ends at {end}; it must lie between {before} and {}",
                    points.len()
                ));
            }
            before = end;
        }
        if before as usize != points.len() {
            return Err(format!("its cells have {before} points in all, but {} are listed", points.len()));
        }
        Ok(Self { ends: ends.into_iter().map(|e| e as usize).collect(), points })
    }

    /// From `cells` lists that each begin with their length.
    pub fn from_lengths(numbers: Vec<i64>, cells: u64) -> Result<Self, String> {
        let mut out = Self::default();
        let mut rest = numbers.as_slice();
        while let Some((&length, after)) = rest.split_first() {
            let list = usize::try_from(length).ok().and_then(|n| after.split_at_checked(n));
            let Some((list, after)) = list else {
                return Err(format!(
                    "cell {} is said to have {length} points; there are {}",
                    out.ends.len(),
                    after.len()
                ));
            };
            out.points.extend_from_slice(list);
            out.ends.push(out.points.len());
            rest = after;
        }
        if out.len() as u64 != cells {
            return Err(format!("it says that it has {cells} cells, but {} are listed", out.len()));
        }
        Ok(out)
    }

    pub fn len(&self) -> usize {
        self.ends.len()
    }

    pub fn iter(&self) -> impl Iterator<Item = &[i64]> {
        let mut start = 0;
        self.ends.iter().map(move |&end| {
            let list = &self.points[start..end];
            start = end;
            list
        })
    }
}

/// A part of an unstructured grid, with its own numbering of points.
pub(super) struct Piece {
    pub points: Vec<DVec3>,
    pub cells: Lists,
    pub types: Vec<i64>,
    pub point_data: Vec<Array>,
    pub cell_data: Vec<Array>,
}

/// How a cell is read.
enum Shape {
    /// Vertices, lines and surfaces.
    Skipped,
    Solid(CellKind),
    /// A hexahedron whose corners run x fastest, then y, then z.
    Voxel,
}

fn shape(kind: i64) -> Option<Shape> {
    Some(match kind {
        // with their variants of second order, of Lagrange and of Bezier
        0..=9 | 21..=23 | 28 | 30 | 34..=36 | 60..=62 | 68..=70 | 75..=77 => Shape::Skipped,
        10 | 24 | 71 | 78 => Shape::Solid(CellKind::Tet),
        11 => Shape::Voxel,
        12 | 25 | 29 | 33 | 72 | 79 => Shape::Solid(CellKind::Hexahedron),
        13 | 26 | 31 | 32 | 73 | 80 => Shape::Solid(CellKind::Wedge),
        14 | 27 | 37 | 74 => Shape::Solid(CellKind::Pyramid),
        _ => return None,
    })
}

/// Names under which programs keep the region of a cell, without regard to capitals, the likeliest first.
const REGIONS: [&str; 12] = [
    "region",
    "regions",
    "material",
    "materials",
    "materialids",
    "material_id",
    "region_id",
    "regionid",
    "gmsh:physical",
    "medit:ref",
    "physical",
    "cellentityids",
];

impl Piece {
    /// Adds the points, the solid cells, their regions and the vectors behind what is there.
    pub fn add_to(self, solids: &mut Solids) -> Result<(), Fault> {
        let Self { points, cells, types, point_data, cell_data } = self;
        if types.len() != cells.len() {
            return Err(format!("it has {} cells, but the types of {}", cells.len(), types.len()).into());
        }
        for array in &point_data {
            if array.numbers.len() != array.components * points.len() {
                return Err(format!(
                    "the array '{}' has {} numbers for {} points of {} components",
                    array.name,
                    array.numbers.len(),
                    points.len(),
                    array.components
                )
                .into());
            }
        }
        let regions = regions(&cell_data, cells.len());
        let first = solids.points.len() as u64;
        let had_regions = !solids.regions.is_empty();
        let cells_before = solids.cells();
        let mut nodes = Vec::new();
        for (c, (list, kind)) in cells.iter().zip(types).enumerate() {
            let Some(shape) = shape(kind) else {
                return Err(Fault::Unsupported(format!(
                    "cell {c} is of VTK's type {kind}, which Voxclay cannot split into tetrahedra"
                )));
            };
            let solid = match shape {
                Shape::Skipped => continue,
                Shape::Solid(solid) => solid,
                Shape::Voxel => CellKind::Hexahedron,
            };
            let linear = (10..=14).contains(&kind);
            if list.len() < solid.corners() || linear && list.len() > solid.corners() {
                return Err(format!(
                    "cell {c} of VTK's type {kind} has {} points; it needs {}",
                    list.len(),
                    solid.corners()
                )
                .into());
            }
            nodes.clear();
            for &v in list {
                if v < 0 || v as u64 >= points.len() as u64 {
                    return Err(format!("cell {c} names point {v} of only {} from 0", points.len()).into());
                }
                nodes.push(first + v as u64);
            }
            if let Shape::Voxel = shape {
                nodes.swap(2, 3);
                nodes.swap(6, 7);
            }
            solids.cell(solid, &nodes);
            if let Some(regions) = &regions {
                // pieces before this one may have had none
                solids.regions.resize(solids.cells() - 1, 0);
                solids.regions.push(regions[c]);
            }
        }
        if had_regions || regions.is_some() && solids.cells() > cells_before {
            solids.regions.resize(solids.cells(), 0);
        }
        solids.points.extend(points);
        for array in point_data.into_iter().filter(|a| a.components == 3) {
            let values = array.numbers.points();
            match solids.vectors_mut(&array.name) {
                // pieces before this one had it, too
                Some(list) if first > 0 && list.len() as u64 == first => list.extend(values),
                _ if first == 0 => solids.add_vectors(&array.name, values),
                _ => {}
            }
        }
        Ok(())
    }
}

/// Whether an array of the cells by this name may hold their regions.
pub(super) fn is_region(name: &str) -> bool {
    REGIONS.iter().any(|r| name.eq_ignore_ascii_case(r))
}

/// The regions of all cells, if there is an array of whole numbers by one of the names for them.
fn regions(cell_data: &[Array], cells: usize) -> Option<Vec<i32>> {
    let named = |name: &str| cell_data.iter().find(|a| a.components == 1 && a.name.eq_ignore_ascii_case(name));
    REGIONS.iter().find_map(|name| {
        let whole = named(name)?.numbers.whole().filter(|w| w.len() == cells)?;
        whole.into_iter().map(|r| i32::try_from(r).ok()).collect()
    })
}

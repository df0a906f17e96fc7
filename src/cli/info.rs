//! `voxclay info`: facts of volumes, surfaces and tetrahedral meshes.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use serde_json::{Value, json};

use super::Answer;
use crate::evaluate::{load, series};
use crate::io::{self, FileKind};
use crate::mesh::check::MeshReport;
use crate::mesh::tet_report::TetReport;
use crate::mesh::tets::TetMesh;
use crate::volume::statistics::statistics;
use crate::volume::{Space, Volume};

/// Facts of a volume, a surface, a tetrahedral mesh or several files.
///
/// Example: voxclay info head.nii.gz skull.stl
#[derive(clap::Args)]
pub struct Args {
    /// Volumes (.nrrd .nhdr .nii .nii.gz .mha .mhd .raw .json .vti .vtk, or phantom:NAME[:SIZE]), surfaces (.obj .stl .ply .vtk)
    /// and tetrahedral meshes (.vtu .vtk .msh .mesh .meshb .node .ele).
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
}

pub fn run(args: &Args) -> Result<Answer> {
    let mut all = Vec::new();
    let mut text = String::new();
    for file in &args.files {
        let (json, lines) = facts(file)?;
        let _ = writeln!(text, "{}\n{lines}", file.display());
        all.push(json);
    }
    let json = if all.len() == 1 { all.remove(0) } else { json!({ "files": all }) };
    Ok(Answer { json, text })
}

fn facts(file: &Path) -> Result<(Value, String)> {
    let word = file.to_string_lossy();
    let kind = if word.starts_with("phantom:") { Some(FileKind::Volume) } else { io::kind_of(file)? };
    match kind {
        Some(FileKind::Volume) => {
            let source = load::parse_source(&word)?;
            let volume = load::read_source(&source, Path::new("."))?;
            Ok(volume_facts(file, &volume, series::steps(&source, Path::new("."))?))
        }
        Some(FileKind::Surface) => Ok(mesh_facts(file, &MeshReport::of(&io::read_surface_as_stored(file)?))),
        Some(FileKind::Tets) => Ok(tet_facts(file, &io::read_tets(file)?)),
        None => bail!(
            "{}: no known format by this name; expected a volume (.nrrd .nhdr .nii .nii.gz .mha .mhd .raw .json .vti .vtk), a surface (.obj .stl .ply .vtk) or a tetrahedral mesh (.vtu .vtk .msh .mesh .meshb .node .ele)",
            file.display()
        ),
    }
}

/// Of a series the facts are those of its first step.
fn volume_facts(file: &Path, volume: &Volume, steps: usize) -> (Value, String) {
    let stats = statistics(volume);
    let grid = &volume.grid;
    let rows = grid.direction().transpose();
    let direction = [rows.x_axis, rows.y_axis, rows.z_axis].map(|r| r.to_array());
    let space = match grid.space {
        Space::Unknown => "unknown",
        Space::Ras => "RAS",
        Space::Lps => "LPS",
    };
    let (spacing, origin) = (grid.spacing().to_array(), grid.origin().to_array());
    let json = json!({
        "file": file.to_string_lossy(),
        "kind": "volume",
        "dims": grid.dims,
        "type": volume.samples.scalar_type().name(),
        "channels": volume.channels,
        "steps": steps,
        "spacing": spacing,
        "origin": origin,
        "direction": direction,
        "space": space,
        "slope": volume.rescale.slope,
        "intercept": volume.rescale.intercept,
        "min": stats.min,
        "max": stats.max,
        "mean": stats.mean,
        "nan": stats.nan,
    });
    let [x, y, z] = grid.dims;
    let mut text = format!(
        "  volume     {x} x {y} x {z} {}, {} channel{}\n  spacing    {} {} {}\n  origin     {} {} {} ({space})\n  values     {} to {}, mean {:.6}\n",
        volume.samples.scalar_type().name(),
        volume.channels,
        if volume.channels == 1 { "" } else { "s" },
        spacing[0],
        spacing[1],
        spacing[2],
        origin[0],
        origin[1],
        origin[2],
        stats.min,
        stats.max,
        stats.mean,
    );
    if steps > 1 {
        let _ = writeln!(text, "  steps      {steps} in time, 0 to {}; values are those of step 0", steps - 1);
    }
    for (i, r) in direction.iter().enumerate() {
        let _ = writeln!(
            text,
            "  {} {:>9.6} {:>9.6} {:>9.6}",
            if i == 0 { "direction" } else { "         " },
            r[0],
            r[1],
            r[2]
        );
    }
    if stats.nan > 0 {
        let _ = writeln!(text, "  {} samples are not a number", stats.nan);
    }
    (json, text)
}

fn mesh_facts(file: &Path, r: &MeshReport) -> (Value, String) {
    let bounds = r.bounds.map(|(lo, hi)| [lo.to_array(), hi.to_array()]);
    let json = json!({
        "file": file.to_string_lossy(),
        "kind": "mesh",
        "vertices": r.vertices,
        "welded_vertices": r.welded_vertices,
        "triangles": r.triangles,
        "components": r.components,
        "closed": r.closed,
        "manifold": r.manifold,
        "oriented": r.oriented,
        "euler": r.euler,
        "boundary_edges": r.boundary_edges,
        "non_manifold_edges": r.non_manifold_edges,
        "degenerate_triangles": r.degenerate_triangles,
        "self_intersections": r.self_intersections,
        "volume": r.volume,
        "area": r.area,
        "bounds": bounds,
        "defects": r.defects().iter().map(ToString::to_string).collect::<Vec<_>>(),
    });
    let yes = |b: bool| if b { "yes" } else { "no" };
    let mut text = format!(
        "  mesh       {} vertices ({} different), {} triangles, {} component{}\n  closed     {}; manifold {}; Euler number {}\n  volume     {:.6}; area {:.6}\n",
        r.vertices,
        r.welded_vertices,
        r.triangles,
        r.components,
        if r.components == 1 { "" } else { "s" },
        yes(r.closed),
        yes(r.manifold),
        r.euler,
        r.volume,
        r.area,
    );
    if let Some((lo, hi)) = r.bounds {
        let _ =
            writeln!(text, "  bounds     {:.6} {:.6} {:.6} to {:.6} {:.6} {:.6}", lo.x, lo.y, lo.z, hi.x, hi.y, hi.z);
    }
    for defect in r.defects() {
        let _ = writeln!(text, "  defect     {defect}");
    }
    (json, text)
}

fn tet_facts(file: &Path, mesh: &TetMesh) -> (Value, String) {
    let r = TetReport::of(mesh);
    let bounds = r.bounds.map(|(lo, hi)| [lo.to_array(), hi.to_array()]);
    let vectors: Vec<&str> = mesh.vectors.iter().map(|v| v.name.as_str()).collect();
    let json = json!({
        "file": file.to_string_lossy(),
        "kind": "tets",
        "nodes": r.nodes,
        "tets": r.tets,
        "unused_points": r.unused_points,
        "inverted": r.inverted,
        "degenerate": r.degenerate,
        "volume": r.volume,
        "signed_volume": r.signed_volume,
        "size_ratio": r.size_ratio,
        "boundary_faces": r.boundary_faces,
        "boundary_euler": r.boundary_euler,
        "boundary_components": r.boundary_components,
        "components": r.components,
        "non_conforming_faces": r.non_conforming_faces,
        "regions": r.regions,
        "vectors": vectors,
        "bounds": bounds,
    });
    let mut text = format!(
        "  tets       {} nodes ({} unused), {} tetrahedra, {} component{}\n  boundary   {} faces, Euler number {}, {} component{}\n  volume     {:.6}; largest by smallest {:.4}\n",
        r.nodes,
        r.unused_points,
        r.tets,
        r.components,
        if r.components == 1 { "" } else { "s" },
        r.boundary_faces,
        r.boundary_euler,
        r.boundary_components,
        if r.boundary_components == 1 { "" } else { "s" },
        r.volume,
        r.size_ratio,
    );
    if let Some((lo, hi)) = r.bounds {
        let _ =
            writeln!(text, "  bounds     {:.6} {:.6} {:.6} to {:.6} {:.6} {:.6}", lo.x, lo.y, lo.z, hi.x, hi.y, hi.z);
    }
    if r.regions > 0 {
        let _ = writeln!(text, "  regions    {}", r.regions);
    }
    if !vectors.is_empty() {
        let _ = writeln!(text, "  vectors    {}", vectors.join(", "));
    }
    for (count, what) in [
        (r.inverted, "tetrahedra have negative volume"),
        (r.degenerate, "tetrahedra have no volume"),
        (r.non_conforming_faces, "faces belong to more than two tetrahedra"),
    ] {
        if count > 0 {
            let _ = writeln!(text, "  defect     {count} {what}");
        }
    }
    (json, text)
}

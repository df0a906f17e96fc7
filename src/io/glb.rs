//! Binary glTF 2.0, written only: one mesh with positions, normals if there are any, and triangles.
//!
//! Positions are 32-bit numbers relative to the middle of the mesh; the node that holds it brings them back, and turns the
//! world's z axis to glTF's y, which points up.

use std::io::Write;
use std::path::Path;

use glam::{DVec3, Vec3};
use serde_json::json;

use super::{IoError, write_atomic};
use crate::mesh::TriMesh;

const MAGIC: u32 = 0x4654_6c67;
const JSON: u32 = 0x4e4f_534a;
const BIN: u32 = 0x004e_4942;

/// Writes a binary glTF file.
///
/// # Errors
/// If a position does not fit 32 bits, the file would have 4 GiB or more, there is no triangle, or it cannot be written.
pub fn write(path: &Path, mesh: &TriMesh, normals: &[Vec3]) -> Result<(), IoError> {
    let Some((lo, hi)) = mesh.bounds().filter(|_| !mesh.triangles.is_empty()) else {
        return Err(IoError::unsupported(path, "glTF has no empty meshes; there must be a triangle"));
    };
    let center = 0.5 * (lo + hi);
    let local = |p: DVec3| (p - center).as_vec3();
    if !(local(lo).is_finite() && local(hi).is_finite()) {
        return Err(IoError::unsupported(
            path,
            "the mesh is too large for the 32-bit numbers of glTF; write .ply or .obj",
        ));
    }
    let lit = normals.len() == mesh.positions.len();
    let (points, corners) = (12 * mesh.positions.len(), 12 * mesh.triangles.len());
    let bytes = points * (1 + usize::from(lit)) + corners;
    // the lowest and the highest of what is stored, which rounding keeps in order
    let [low, high] = [lo, hi].map(|p| local(p).to_array());
    let mut views = vec![json!({ "buffer": 0, "byteOffset": 0, "byteLength": points, "target": 34962 })];
    let mut accessors = vec![json!({
        "bufferView": 0, "componentType": 5126, "count": mesh.positions.len(), "type": "VEC3", "min": low, "max": high,
    })];
    let mut attributes = json!({ "POSITION": 0 });
    if lit {
        attributes["NORMAL"] = json!(1);
        views.push(json!({ "buffer": 0, "byteOffset": points, "byteLength": points, "target": 34962 }));
        accessors.push(json!({ "bufferView": 1, "componentType": 5126, "count": normals.len(), "type": "VEC3" }));
    }
    let indices = views.len();
    views.push(json!({ "buffer": 0, "byteOffset": bytes - corners, "byteLength": corners, "target": 34963 }));
    accessors.push(json!({
        "bufferView": indices, "componentType": 5125, "count": 3 * mesh.triangles.len(), "type": "SCALAR",
    }));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mut head = serde_json::to_vec(&json!({
        "asset": { "version": "2.0", "generator": "Voxclay" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{
            "mesh": 0,
            "rotation": [-half, 0.0, 0.0, half],
            "translation": [center.x, center.z, -center.y],
        }],
        "meshes": [{ "primitives": [{ "attributes": attributes, "indices": indices }] }],
        "buffers": [{ "byteLength": bytes }],
        "bufferViews": views,
        "accessors": accessors,
    }))
    .map_err(|e| IoError::unsupported(path, e.to_string()))?;
    head.resize(head.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + head.len() + 8 + bytes;
    let sizes = [total, head.len(), bytes].map(u32::try_from);
    let [Ok(total), Ok(head_size), Ok(bytes)] = sizes else {
        return Err(IoError::unsupported(path, "the mesh needs 4 GiB or more, too much for glTF; write .ply"));
    };
    write_atomic(path, |w| {
        for word in [MAGIC, 2, total, head_size, JSON] {
            w.write_all(&word.to_le_bytes())?;
        }
        w.write_all(&head)?;
        for word in [bytes, BIN] {
            w.write_all(&word.to_le_bytes())?;
        }
        let normals = if lit { normals } else { &[] };
        for v in mesh.positions.iter().map(|p| local(*p)).chain(normals.iter().copied()) {
            for x in v.to_array() {
                w.write_all(&x.to_le_bytes())?;
            }
        }
        for v in mesh.triangles.as_flattened() {
            w.write_all(&v.to_le_bytes())?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::primitives::geodesic_sphere;

    #[test]
    fn what_is_written_reads_back() {
        let mut mesh = geodesic_sphere(4);
        mesh.positions.iter_mut().for_each(|p| *p += DVec3::new(1000.0, -20.0, 3.0));
        let normals: Vec<Vec3> = mesh.positions.iter().map(|p| p.as_vec3().normalize()).collect();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.glb");
        for normals in [&normals[..], &[]] {
            write(&path, &mesh, normals).unwrap();
            let file = std::fs::read(&path).unwrap();
            let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
            assert_eq!((word(0), word(4), word(8)), (MAGIC as usize, 2, file.len()));
            let json_size = word(12);
            assert!(json_size % 4 == 0 && word(16) == JSON as usize);
            let head: serde_json::Value = serde_json::from_slice(&file[20..20 + json_size]).unwrap();
            let bin = 28 + json_size;
            assert_eq!((word(bin - 8), word(bin - 4)), (file.len() - bin, BIN as usize));
            let view = |accessor: &serde_json::Value| {
                let a = &head["accessors"][accessor.as_u64().unwrap() as usize];
                let v = &head["bufferViews"][a["bufferView"].as_u64().unwrap() as usize];
                (bin + v["byteOffset"].as_u64().unwrap() as usize, a["count"].as_u64().unwrap() as usize)
            };
            let vectors = |(from, count): (usize, usize)| -> Vec<Vec3> {
                let float = |at: usize| f32::from_le_bytes(file[at..at + 4].try_into().unwrap());
                (0..count).map(|i| Vec3::from(std::array::from_fn(|a| float(from + 12 * i + 4 * a)))).collect()
            };
            let primitive = &head["meshes"][0]["primitives"][0];
            let points = vectors(view(&primitive["attributes"]["POSITION"]));
            assert_eq!(points.len(), mesh.positions.len());
            let number = |v: &serde_json::Value| v.as_f64().unwrap();
            let node = &head["nodes"][0];
            let turn = glam::DQuat::from_array(std::array::from_fn(|i| number(&node["rotation"][i])));
            let shift = DVec3::from(std::array::from_fn(|i| number(&node["translation"][i])));
            for (stored, p) in points.iter().zip(&mesh.positions) {
                let up = turn * stored.as_dvec3() + shift;
                assert!((DVec3::new(up.x, -up.z, up.y) - *p).length() < 1e-6, "{up} {p}");
                for a in 0..3 {
                    let range = [&head["accessors"][0]["min"][a], &head["accessors"][0]["max"][a]].map(number);
                    assert!(f64::from(stored[a]) >= range[0] && f64::from(stored[a]) <= range[1]);
                }
            }
            let (from, count) = view(&primitive["indices"]);
            assert!(count == 3 * mesh.triangles.len() && from + 4 * count == file.len());
            let corners: Vec<u32> = (0..count).map(|i| word(from + 4 * i) as u32).collect();
            assert_eq!(corners, mesh.triangles.as_flattened());
            if !normals.is_empty() {
                assert_eq!(vectors(view(&primitive["attributes"]["NORMAL"])), normals);
            }
        }
        assert!(write(&path, &TriMesh::default(), &[]).is_err());
    }
}

//! What a file claims costs no memory: readers take no more than a multiple of the bytes that are there.

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use voxclay::io::{gmsh, medit, tetgen, vti, vtk, vtu};

static NOW: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);
/// One measurement at a time.
static TURN: Mutex<()> = Mutex::new(());

struct Counting;

fn grown(by: usize) {
    MOST.fetch_max(NOW.fetch_add(by, Relaxed) + by, Relaxed);
}

// SAFETY: every call is handed on to the system's allocator as it came
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grown(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, p: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(p, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Bytes in use at the worst moment, beyond those before.
fn most_of(read: impl FnOnce()) -> usize {
    let before = NOW.load(Relaxed);
    MOST.store(before, Relaxed);
    read();
    MOST.load(Relaxed) - before
}

#[test]
fn lying_counts_cost_no_memory() {
    let _turn = TURN.lock();
    let filler = "1 ".repeat(2000);
    let binary = "$MeshFormat\n4.1 1 8\n\u{1}\0\0\0\n$EndMeshFormat\n$Nodes\n";
    let sizes = |list: &[u64]| list.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let path = Path::new("a");
    let vtu_head = "<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\
                    <UnstructuredGrid><Piece NumberOfPoints=\"4000000000\" NumberOfCells=\"4000000000\"><Points>\
                    <DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/></Points></Piece></UnstructuredGrid>\
                    <AppendedData encoding=\"raw\">_";
    let vtu_file = |numbers: &[u64]| {
        let mut bytes = vtu_head.as_bytes().to_vec();
        bytes.extend(sizes(numbers));
        bytes.extend(filler.as_bytes());
        bytes.extend(b"</AppendedData></VTKFile>");
        bytes
    };
    let mut gmsh_nodes = binary.as_bytes().to_vec();
    gmsh_nodes.extend(sizes(&[1, u64::MAX, 1, 4, 3, 0, u64::MAX / 3]));
    gmsh_nodes.extend(filler.as_bytes());
    type Refused<'a> = Box<dyn Fn(&[u8]) -> bool + 'a>;
    let cases: Vec<(&str, Vec<u8>, Refused)> = vec![
        ("blocks", vtu_file(&[u64::MAX, 1 << 40, 0]), Box::new(|b| vtu::parse(path, b).is_err())),
        ("a block", vtu_file(&[1, 1 << 50, 0, 1000]), Box::new(|b| vtu::parse(path, b).is_err())),
        ("compressed", vtu_file(&[2, 1 << 20, 0, u64::MAX, 2]), Box::new(|b| vtu::parse(path, b).is_err())),
        (
            "image",
            vtu_file(&[1, 8, 0, 8])
                .split(|b| *b == b'<')
                .map(|part| {
                    let text = String::from_utf8_lossy(part).into_owned();
                    let text = text.replace("UnstructuredGrid\" byte", "ImageData\" byte");
                    let text = text.replace("UnstructuredGrid>", "ImageData WholeExtent=\"0 99999 0 99999 0 999\">");
                    text.replace("Piece Number", "Piece Extent=\"0 99999 0 99999 0 999\" Number").replace("Points>", "PointData>")
                })
                .collect::<Vec<_>>()
                .join("<")
                .into_bytes(),
            Box::new(|b| vti::parse(path, b).is_err()),
        ),
        (
            "legacy points",
            format!("# vtk DataFile Version 3.0\nx\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 4000000000 double\n{filler}").into_bytes(),
            Box::new(|b| vtk::parse_cells(path, b).is_err()),
        ),
        (
            "legacy volume",
            format!("# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 99999 99999 999\nPOINT_DATA 9999\nSCALARS a int\nLOOKUP_TABLE b\n{filler}")
                .into_bytes(),
            Box::new(|b| vtk::parse_volume(path, b).is_err()),
        ),
        ("gmsh nodes", gmsh_nodes, Box::new(|b| gmsh::parse(path, b).is_err())),
        (
            "gmsh elements",
            format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Elements\n4000000000\n{filler}").into_bytes(),
            Box::new(|b| gmsh::parse(path, b).is_err()),
        ),
        (
            "medit",
            format!("MeshVersionFormatted 2\nDimension 3\nVertices\n4000000000\n{filler}").into_bytes(),
            Box::new(|b| medit::parse(path, b).is_err()),
        ),
        (
            "tetgen",
            format!("4000000000 3 0 0\n{filler}").into_bytes(),
            Box::new(|b| tetgen::parse([path, path], b, b"1 4 0\n").is_err()),
        ),
    ];
    for (name, bytes, refused) in cases {
        let used = most_of(|| assert!(refused(&bytes), "{name} is read"));
        assert!(used < 16 * bytes.len() + (64 << 10), "{name}: {used} bytes for a file of {}", bytes.len());
    }
}

/// Small things that each refer to large ones: memory must not grow with their product.
#[test]
fn sharing_costs_no_memory() {
    let _turn = TURN.lock();
    let path = Path::new("a");
    let nodes: String = (1..=4000).map(|i| format!("{i} 0 0 {i}\n")).collect();
    let data = "$NodeData\n1\n\"d\"\n0\n3\n0\n3\n1\n1 1 2 3\n$EndNodeData\n".repeat(2000);
    let gmsh_file = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4000\n{nodes}$EndNodes\n$Elements\n1\n1 4 0 1 2 3 4\n$EndElements\n{data}"
    );
    let used = most_of(|| assert!(gmsh::parse(path, gmsh_file.as_bytes()).is_ok_and(|m| m.vectors.is_empty())));
    assert!(used < 16 * gmsh_file.len(), "{used} of {}", gmsh_file.len());

    // two thousand arrays that are all the same appended data
    let (points, arrays) = (4000, 2000);
    let array = "<DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/>";
    let mut vtu_file = format!(
        "<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\"><UnstructuredGrid><Piece NumberOfPoints=\"{points}\" NumberOfCells=\"0\">\
         <Points>{array}</Points><PointData>{}</PointData></Piece></UnstructuredGrid><AppendedData encoding=\"raw\">_",
        array.repeat(arrays)
    )
    .into_bytes();
    vtu_file.extend((24 * points as u32).to_le_bytes());
    vtu_file.extend(vec![0; 24 * points]);
    vtu_file.extend(b"</AppendedData></VTKFile>");
    let mut said = String::new();
    let used = most_of(|| said = vtu::parse(path, &vtu_file).expect_err("refused").to_string());
    assert!(said.contains("take more data than the file has"), "{said}");
    assert!(used < 32 * vtu_file.len(), "{used} of {}", vtu_file.len());
}

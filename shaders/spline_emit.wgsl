// Writes the lists of tetrahedra, and with STORED their coefficients.

// number of the cube
@group(1) @binding(0) var<storage, read_write> tets: array<u32>;
@group(1) @binding(1) var<storage, read_write> store: array<Piece>;

// a bit for each cube of the block, by kind
var<workgroup> members: array<atomic<u32>, 48>;

fn number_of(cube: vec3u) -> u32 {
    return (cube.z * level.dims.y + cube.y) * level.dims.x + cube.x;
}

@compute @workgroup_size(64)
fn emit_main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) group: vec3u) {
    let slot = row_of(group);
    let here = slot < head.blocks && head.wanted_tets <= level.room.y;
    var block = 0u;
    var mask = 0u;
    if here {
        block = list[slot];
        mask = masks[slot * 64u + thread];
    }
    if STORED {
        gather(block, thread);
    }
    if thread < 2u * KINDS {
        atomicStore(&members[thread], 0u);
    }
    workgroupBarrier();
    for (var rest = mask; rest != 0u; rest &= rest - 1u) {
        atomicOr(&members[2u * countTrailingZeros(rest) + thread / 32u], 1u << (thread % 32u));
    }
    workgroupBarrier();
    let cube = number_of(corner(block) + vec3u(thread % 4u, (thread / 4u) % 4u, thread / 16u));
    for (var rest = mask; rest != 0u; rest &= rest - 1u) {
        let kind = countTrailingZeros(rest);
        // cubes of the block before this one
        let own = atomicLoad(&members[2u * kind + thread / 32u]) & ((1u << (thread % 32u)) - 1u);
        var rank = countOneBits(own);
        if thread >= 32u {
            rank += countOneBits(atomicLoad(&members[2u * kind]));
        }
        let at = counts[kind * head.blocks + slot] + rank;
        tets[at] = cube;
        if STORED {
            store[at] = piece(near_of(thread, kind));
        }
    }
}

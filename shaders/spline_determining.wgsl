// The coefficients of a tetrahedron from those that are stored of its cube, as `spline::Determining` has them. Whoever includes
// this has `store`. Corners are named by their sides along the local axes, p before and m behind the centre.

// its own, then those next to it along the local axes
fn corner_at(at: u32, turn: mat3x3f) -> vec4f {
    let own = store[at];
    return vec4f(own.x, own.yzw * turn);
}

// towards the edges before and behind along the two other local axes; `ordered`: the first of them is the lower one
fn face_at(at: u32, ordered: bool, first_back: bool, second_back: bool) -> vec4f {
    let own = store[at];
    let pairs = select(own.zwxy, own, ordered);
    return vec4f(select(pairs.xy, pairs.yx, first_back), select(pairs.zw, pairs.wz, second_back));
}

fn below_corner(corner: vec4f) -> f32 {
    return 0.5 * ((corner.y + corner.z + corner.w) - corner.x);
}

// `place`: of the cube in the store
fn determined(place: u32, kind: u32) -> Piece {
    let axes = local_axes(kind);
    let back = vec2u(kind & 1u, (kind >> 1u) & 1u);
    let turn = mat3x3f(unit(axes.x), unit(axes.y), unit(axes.z));
    let base = RECORD * place;
    let side = vec3u(1u) << axes;
    let start = back.x * side.x + back.y * side.y;
    let ppp = corner_at(base + start, turn);
    let ppm = corner_at(base + (start ^ side.z), turn);
    let pmp = corner_at(base + (start ^ side.y), turn);
    let pmm = corner_at(base + (start ^ side.y ^ side.z), turn);
    let mpp = corner_at(base + (start ^ side.x), turn);
    let mpm = corner_at(base + (start ^ side.x ^ side.z), turn);
    let mmp = corner_at(base + (start ^ side.x ^ side.y), turn);
    let mmm = corner_at(base + (start ^ side.x ^ side.y ^ side.z), turn);
    let all_corners = ((ppp + ppm) + (pmp + pmm)) + ((mpp + mpm) + (mmp + mmm));

    // the faces before and behind along each axis
    let at = base + 8u + 2u * axes;
    let x_back = back.x == 1u;
    let y_back = back.y == 1u;
    let up = face_at(at.x + back.x, axes.y < axes.z, y_back, false);
    let um = store[at.x + 1u - back.x];
    let vp = face_at(at.y + back.y, axes.x < axes.z, x_back, false);
    let vm = face_at(at.y + 1u - back.y, axes.x < axes.z, x_back, false);
    let wp = face_at(at.z, axes.x < axes.y, x_back, y_back);
    let wm = face_at(at.z + 1u, axes.x < axes.y, x_back, y_back);
    let all_faces = (up + um) + ((vp + vm) + (wp + wm));

    // below the middles of edges: of the face before along the first axis, and three across it
    let ends = vec4f(ppp.w, pmp.w, ppp.z, ppm.z) + vec4f(ppm.w, pmm.w, pmp.z, pmm.z);
    let g = (up + vec4f(vp.x, vm.x, wp.x, wm.x)) - 0.5 * ends;
    let across = vec3f(vp.z, vp.w, vm.w) + vec3f(wp.z, wm.z, wm.w);
    let s = across - 0.5 * (vec3f(ppp.y, ppm.y, pmm.y) + vec3f(mpp.y, mpm.y, mmm.y));
    let h2 = below_corner(ppp);
    let h3 = below_corner(ppm);
    let k2 = 0.5 * ((g.x + g.z + s.x) - h2);
    let k3 = 0.5 * ((g.x + g.w + s.y) - h3);
    let opposite = 0.5 * ((g.y + g.w + s.z) - below_corner(pmm));

    return Piece(
        vec4f(
            dot(all_faces, vec4f(0.125)) + dot(all_corners, vec4f(1.0, -3.0, -3.0, -3.0) / 32.0),
            0.5 * (k2 + opposite),
            k2,
            k3,
        ),
        vec4f(dot(g, vec4f(0.25)), 0.5 * (g.x + g.z), 0.5 * (g.x + g.w), h2),
        vec4f(g.x, h3, dot(up, vec4f(0.25)), 0.5 * (up.x + up.z)),
        vec4f(0.5 * (up.x + up.w), 0.5 * (ppp.z + ppp.w), up.x, 0.5 * (ppm.z + ppm.w)),
        vec4f(ppp.x, ppp.w, ppm.w, ppm.x),
    );
}

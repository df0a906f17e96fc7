// Cubics in Bernstein-Bezier form on the tetrahedra of a cube, as `spline::Piece` has them. Whoever includes this says what
// `Near` is, and what `near(at, x, y, z)` holds so many samples along the local axes away: the sample less the isovalue.

// vectors that are stored of a cube
const RECORD: u32 = 14u;

// the axes of the cube that the local ones of a kind run along; kinds are numbered as `spline::Kind::all` lists them
fn local_axes(kind: u32) -> vec3u {
    let first = kind / 8u;
    // of the two others, the lower one second in even orders
    let low = select(0u, 1u, first == 0u);
    let high = select(2u, 1u, first == 2u);
    let odd = (kind / 4u) % 2u == 1u;
    return vec3u(first, select(low, high, odd), select(high, low, odd));
}

// unit vectors along the three local axes of a kind
fn kind_axes(kind: u32) -> mat3x3f {
    let axes = local_axes(kind);
    let back = vec2f(select(1.0, -1.0, (kind & 1u) != 0u), select(1.0, -1.0, (kind & 2u) != 0u));
    return mat3x3f(unit(axes.x) * back.x, unit(axes.y) * back.y, unit(axes.z));
}

fn unit(axis: u32) -> vec3f {
    return vec3f(vec3u(axis) == vec3u(0u, 1u, 2u));
}

// barycentric coordinates along the local axes: of a point, and of a direction
fn barycentric(p: vec3f) -> vec4f {
    return vec4f(1.0 - 2.0 * p.x, 2.0 * (p.x - p.y), p.y + p.z, p.y - p.z);
}

fn barycentric_direction(d: vec3f) -> vec4f {
    return vec4f(-2.0 * d.x, 2.0 * (d.x - d.y), d.y + d.z, d.y - d.z);
}

// 20 coefficients in the order of `spline::DOMAIN`
struct Piece {
    a: vec4f,
    b: vec4f,
    c: vec4f,
    d: vec4f,
    e: vec4f,
}

fn piece(at: Near) -> Piece {
    // named by their place: first axis -, 0, +; then u, d along the second, f, b along the third
    let cm = near(at, -1, 0, 0);
    let c0 = near(at, 0, 0, 0);
    let cp = near(at, 1, 0, 0);
    let um = near(at, -1, 1, 0);
    let u0 = near(at, 0, 1, 0);
    let up = near(at, 1, 1, 0);
    let dm = near(at, -1, -1, 0);
    let d0 = near(at, 0, -1, 0);
    let dp = near(at, 1, -1, 0);
    let fm = near(at, -1, 0, 1);
    let f0 = near(at, 0, 0, 1);
    let fp = near(at, 1, 0, 1);
    let bm = near(at, -1, 0, -1);
    let b0 = near(at, 0, 0, -1);
    let bp = near(at, 1, 0, -1);
    let uf0 = near(at, 0, 1, 1);
    let ufp = near(at, 1, 1, 1);
    let ub0 = near(at, 0, 1, -1);
    let ubp = near(at, 1, 1, -1);
    let df0 = near(at, 0, -1, 1);
    let dfp = near(at, 1, -1, 1);
    let db0 = near(at, 0, -1, -1);
    let dbp = near(at, 1, -1, -1);

    let lateral0 = (u0 + d0) + (f0 + b0);
    let lateralp = (up + dp) + (fp + bp);
    let lateralm = (um + dm) + (fm + bm);
    let diagonal0 = (uf0 + ub0) + (df0 + db0);
    let diagonalp = (ufp + ubp) + (dfp + dbp);
    let face = c0 + cp;
    let up2 = u0 + up;
    let f2 = f0 + fp;
    let b2 = b0 + bp;
    let d2 = d0 + dp;
    let uf2 = uf0 + ufp;
    let ub2 = ub0 + ubp;
    let df2 = df0 + dfp;
    let db2 = db0 + dbp;
    let quad = face + up2;
    let front = f2 + uf2;
    let behind = b2 + ub2;

    let third = 1.0 / 3.0;
    let center = 0.375 * c0;
    var p: Piece;
    p.a = vec4f(
        center + (cm + cp + lateral0) / 12.0 + (lateralm + lateralp + diagonal0) / 96.0,
        center + 7.0 / 48.0 * cp + lateral0 / 12.0 + cm / 48.0 + lateralp / 64.0 + diagonal0 / 96.0 + lateralm / 192.0,
        center + 7.0 / 48.0 * (f0 + u0 + cp) + (cm + d0 + b0 + uf0 + fp + up) / 48.0 + (fm + um + df0 + ub0 + dp + bp) / 96.0,
        center + 7.0 / 48.0 * (b0 + u0 + cp) + (cm + d0 + f0 + ub0 + bp + up) / 48.0 + (bm + um + db0 + uf0 + dp + fp) / 96.0,
    );
    let far = third * c0 + 5.0 / 24.0 * cp;
    p.b = vec4f(
        far + 7.0 / 96.0 * lateral0 + lateralp / 32.0 + diagonal0 / 96.0,
        far + (f0 + u0) / 8.0 + 5.0 / 96.0 * (fp + up) + (d0 + b0 + uf0) / 48.0 + (df0 + ub0 + dp + bp) / 96.0,
        far + (b0 + u0) / 8.0 + 5.0 / 96.0 * (bp + up) + (d0 + f0 + ub0) / 48.0 + (db0 + uf0 + dp + fp) / 96.0,
        0.25 * c0 + (f0 + u0 + cp) / 6.0 + (uf0 + fp + up) / 12.0,
    );
    let wide = 13.0 / 48.0 * face;
    p.c = vec4f(
        third * c0 + 5.0 / 24.0 * (u0 + cp) + up / 12.0 + (b0 + f0) / 24.0 + (ub0 + uf0 + bp + fp) / 48.0,
        0.25 * c0 + (b0 + u0 + cp) / 6.0 + (ub0 + bp + up) / 12.0,
        wide + 5.0 / 96.0 * (lateral0 + lateralp) + (diagonal0 + diagonalp) / 192.0,
        wide + 17.0 / 192.0 * (f2 + up2) + (d2 + b2) / 64.0 + uf2 / 96.0 + (df2 + ub2) / 192.0,
    );
    p.d = vec4f(
        wide + 17.0 / 192.0 * (b2 + up2) + (d2 + f2) / 64.0 + ub2 / 96.0 + (db2 + uf2) / 192.0,
        5.0 / 24.0 * face + (f2 + up2) / 8.0 + uf2 / 24.0,
        wide + 7.0 / 48.0 * up2 + (b2 + f2) / 32.0 + (ub2 + uf2) / 96.0,
        5.0 / 24.0 * face + (b2 + up2) / 8.0 + ub2 / 24.0,
    );
    p.e = vec4f(
        (quad + front) / 8.0,
        5.0 / 24.0 * quad + front / 24.0,
        5.0 / 24.0 * quad + behind / 24.0,
        (quad + behind) / 8.0,
    );
    return p;
}

// smallest and largest coefficient
fn hull(p: Piece) -> vec2f {
    let lo = min(min(min(p.a, p.b), min(p.c, p.d)), p.e);
    let hi = max(max(max(p.a, p.b), max(p.c, p.d)), p.e);
    return vec2f(min(min(lo.x, lo.y), min(lo.z, lo.w)), max(max(hi.x, hi.y), max(hi.z, hi.w)));
}

// whether a piece may have a zero; its coefficients are right to a few units in the last place
fn has_zero(p: Piece) -> bool {
    let h = hull(p);
    let slack = 2e-6 * (abs(h.x) + abs(h.y));
    return h.x <= slack && h.y >= -slack;
}

// The backward map: a stack of deformers, the newest undone first. The formulas are those of src/deform.

struct Step {
    // 0: displacement volume, 1: grab, 2: lattice, 3: brush that inflates or pinches, 4: brush that twists
    kind: u32,
    // of a grab or brush: 0: (1 - t^2)^3, 1: quadratic B-spline, 2: smoothstep beyond the core
    falloff: u32,
    // the lattice's first coefficient
    first: u32,
    core: f32,
    // peak of the displacement, centre of the brush, or the lattice's lower corner; local
    center: vec3f,
    inverse_radius: f32,
    vector: vec3f,
    // angle of a twist in full turns
    turns: f32,
    // axes divided by their length scale, or columns of the brush's matrix; knot intervals along each
    axis_u: vec3f,
    cells_u: f32,
    axis_v: vec3f,
    cells_v: f32,
    axis_w: vec3f,
    cells_w: f32,
}

struct Map {
    // from the undeformed local world to what is sampled
    target_from_local: mat4x4f,
    // number of steps; the rest unused
    count: vec4u,
}

@group(2) @binding(0) var<uniform> map: Map;
@group(2) @binding(1) var<storage, read> steps: array<Step>;
// vectors of the lattices' handles with two layers of zeros all round
@group(2) @binding(2) var<storage, read> coefficients: array<vec4f>;

// the quadratic B-spline with support [-1,1] and peak 1, and its slope
fn bump(t: f32) -> vec2f {
    let outer = max(1.0 - abs(t), 0.0);
    let inner = max(1.0 - 3.0 * abs(t), 0.0);
    let steep = 3.0 * (inner - outer);
    return vec2f(1.5 * outer * outer - 0.5 * inner * inner, select(steep, -steep, t < 0.0));
}

fn rise_and_fall(t: f32) -> vec2f {
    let b = bump(min(t, 0.5 * t));
    return vec2f(b.x, select(0.5 * b.y, b.y, t < 0.0));
}

// profile of a grab or brush: f(t), and f'(t)/t, from t^2
fn profile(s: Step, squared: f32) -> vec2f {
    if s.falloff == 0u {
        let rest = max(1.0 - squared, 0.0);
        return vec2f(rest * rest * rest, -6.0 * rest * rest);
    }
    let t = sqrt(squared);
    if s.falloff == 1u {
        let b = bump(t);
        return vec2f(b.x, b.y / max(t, 1e-12));
    }
    let width = 1.0 / (1.0 - s.core);
    let x = saturate((t - s.core) * width);
    return vec2f(1.0 - x * x * (3.0 - 2.0 * x), -6.0 * x * (1.0 - x) * width / max(t, 1e-12));
}

struct Displacement {
    value: vec3f,
    // by world position, by columns
    gradient: mat3x3f,
}

fn outer(a: vec3f, b: vec3f) -> mat3x3f {
    return mat3x3f(a * b.x, a * b.y, a * b.z);
}

// weights of the three coefficients at x in a knot interval, and their slopes
fn basis(x: f32) -> vec3f {
    let y = 1.0 - x;
    return vec3f(0.5 * y * y, 0.5 + x * y, 0.5 * x * x);
}

fn basis_slope(x: f32) -> vec3f {
    return vec3f(x - 1.0, 1.0 - 2.0 * x, x);
}

fn lattice(s: Step, knots: vec3f) -> Displacement {
    let cells = vec3f(s.cells_u, s.cells_v, s.cells_w);
    var d = Displacement(vec3f(0.0), mat3x3f(vec3f(0.0), vec3f(0.0), vec3f(0.0)));
    if any(knots <= vec3f(0.0)) || any(knots >= cells) {
        return d;
    }
    let cell = floor(knots);
    let f = knots - cell;
    let at = vec3u(cell);
    let m = vec2u(cells.xy) + 2u;
    let bx = basis(f.x);
    let sx = basis_slope(f.x);
    var by = basis(f.y);
    var sy = basis_slope(f.y);
    var bz = basis(f.z);
    var sz = basis_slope(f.z);
    for (var k = 0u; k < 3u; k++) {
        for (var j = 0u; j < 3u; j++) {
            let row = s.first + ((at.z + k) * m.y + at.y + j) * m.x + at.x;
            let c = mat3x3f(coefficients[row].xyz, coefficients[row + 1u].xyz, coefficients[row + 2u].xyz);
            let along = c * bx;
            d.value += along * (by[j] * bz[k]);
            d.gradient += outer((c * sx) * (by[j] * bz[k]), s.axis_u)
                + outer(along * (sy[j] * bz[k]), s.axis_v)
                + outer(along * (by[j] * sz[k]), s.axis_w);
        }
    }
    return d;
}

// sin a and 1 - cos a of an angle in full turns: from a quarter of it, doubled twice
fn turn(turns: f32) -> vec2f {
    let x = 1.5707963 * (turns - round(turns));
    let y = x * x;
    let s = x * (1.0 + y * (-0.16666667 + y * (8.3333333e-3 + y * (-1.9841270e-4 + y * 2.7557319e-6))));
    let c = 1.0 + y * (-0.5 + y * (0.041666667 + y * (-1.3888889e-3 + y * 2.4801587e-5)));
    let half = vec2f(2.0 * s * c, 1.0 - 2.0 * s * s);
    return vec2f(2.0 * half.x * half.y, 2.0 * half.x * half.x);
}

fn brush(s: Step, r: vec3f) -> Displacement {
    let x = r * s.inverse_radius;
    let f = profile(s, dot(x, x));
    let slope = x * (f.y * s.inverse_radius);
    let a = mat3x3f(s.axis_u, s.axis_v, s.axis_w);
    let u = a * r;
    if s.kind == 3u {
        return Displacement(u * f.x, a * f.x + outer(u, slope));
    }
    let v = a * u;
    let t = turn(s.turns * f.x);
    let by_angle = (u * (1.0 - t.y) - v * t.x) * (6.2831853 * s.turns);
    return Displacement(u * t.x - v * t.y, a * t.x - (a * a) * t.y + outer(by_angle, slope));
}

fn displacement(s: Step, p: vec3f) -> Displacement {
    let r = p - s.center;
    if s.kind == 1u {
        let x = r * s.inverse_radius;
        let f = profile(s, dot(x, x));
        return Displacement(s.vector * f.x, outer(s.vector, x * (f.y * s.inverse_radius)));
    }
    if s.kind >= 3u {
        return brush(s, r);
    }
    let local = vec3f(dot(s.axis_u, r), dot(s.axis_v, r), dot(s.axis_w, r));
    if s.kind == 2u {
        return lattice(s, local);
    }
    let u = bump(local.x);
    let v = bump(local.y);
    let w = rise_and_fall(local.z);
    let gradient = s.axis_u * (u.y * v.x * w.x) + s.axis_v * (u.x * v.y * w.x) + s.axis_w * (u.x * v.x * w.y);
    return Displacement(s.vector * (u.x * v.x * w.x), outer(s.vector, gradient));
}

// how far the value at `p` has come: p - backward(p)
fn displaced_by(p: vec3f) -> vec3f {
    var sum = vec3f(0.0);
    for (var i = 0u; i < map.count.x; i++) {
        sum += displacement(steps[i], p - sum).value;
    }
    return sum;
}

struct Mapped {
    at: vec3f,
    // d target / d local, by columns
    jacobian: mat3x3f,
}

fn to_target(p: vec3f) -> vec3f {
    return (map.target_from_local * vec4f(p, 1.0)).xyz;
}

fn backward_with_jacobian(local: vec3f) -> Mapped {
    var p = local;
    var j = mat3x3f(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), vec3f(0.0, 0.0, 1.0));
    for (var i = 0u; i < map.count.x; i++) {
        let d = displacement(steps[i], p);
        p -= d.value;
        j -= d.gradient * j;
    }
    let m = map.target_from_local;
    return Mapped(to_target(p), mat3x3f(m[0].xyz, m[1].xyz, m[2].xyz) * j);
}

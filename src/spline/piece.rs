//! One tetrahedron's cubic in Bernstein-Bezier form.
//!
//! The tetrahedron is always the same, `v0 = 0`, `v1 = (1/2, 0, 0)`, `v2 = (1/2, 1/2, 1/2)`, `v3 = (1/2, 1/2, -1/2)`, in
//! coordinates along three *local* axes: the first is the one in which the point lies farthest from the cube's centre, with
//! the sign of that coordinate; the second is the next, with its sign; the third keeps its own direction. [`Kind`] says
//! which they are.

use glam::{DMat3, DVec3};

/// One of the 24 tetrahedra of a cube, by its local axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Kind {
    /// Axes of the cube that the local ones run along.
    pub axes: [usize; 3],
    /// Whether the first and the second run backwards. The third never does.
    pub back: [bool; 2],
}

impl Kind {
    /// All 24.
    pub fn all() -> impl Iterator<Item = Self> {
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        ORDERS.into_iter().flat_map(|axes| {
            [[false, false], [true, false], [false, true], [true, true]].map(|back| Self { axes, back })
        })
    }

    /// The tetrahedron that holds a point, relative to the cube's centre; on a face between several, one of them.
    #[inline(always)]
    pub fn of(p: DVec3) -> Self {
        let m = p.abs();
        let a = if m.x >= m.y && m.x >= m.z {
            0
        } else if m.y >= m.z {
            1
        } else {
            2
        };
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        let (b, c) = if m[b] >= m[c] { (b, c) } else { (c, b) };
        Self { axes: [a, b, c], back: [p[a] < 0.0, p[b] < 0.0] }
    }

    /// A point or direction of the cube along the local axes.
    #[inline(always)]
    pub fn local(self, p: DVec3) -> DVec3 {
        let [a, b, c] = self.axes;
        DVec3::new(if self.back[0] { -p[a] } else { p[a] }, if self.back[1] { -p[b] } else { p[b] }, p[c])
    }

    /// The inverse of [`Kind::local`].
    #[inline(always)]
    pub fn cube(self, local: DVec3) -> DVec3 {
        let [a, b, c] = self.axes;
        let mut p = DVec3::ZERO;
        p[a] = if self.back[0] { -local.x } else { local.x };
        p[b] = if self.back[1] { -local.y } else { local.y };
        p[c] = local.z;
        p
    }

    /// Steps in memory along the local axes, from those along the cube's.
    #[inline(always)]
    pub fn strides(self, along: [isize; 3]) -> [isize; 3] {
        let [a, b, c] = self.axes.map(|a| along[a]);
        [if self.back[0] { -a } else { a }, if self.back[1] { -b } else { b }, c]
    }
}

/// Barycentric coordinates of a point along the local axes.
#[inline(always)]
pub fn barycentric(p: DVec3) -> [f64; 4] {
    [1.0 - 2.0 * p.x, 2.0 * (p.x - p.y), p.y + p.z, p.y - p.z]
}

/// The vertices along the local axes.
pub const VERTICES: [DVec3; 4] =
    [DVec3::ZERO, DVec3::new(0.5, 0.0, 0.0), DVec3::new(0.5, 0.5, 0.5), DVec3::new(0.5, 0.5, -0.5)];

/// The vertices, lowest first, that each coefficient belongs to: that of `[i, j, k]` lies at `(vi + vj + vk) / 3`.
pub const DOMAIN: [[usize; 3]; 20] = [
    [0, 0, 0],
    [0, 0, 1],
    [0, 0, 2],
    [0, 0, 3],
    [0, 1, 1],
    [0, 1, 2],
    [0, 1, 3],
    [0, 2, 2],
    [0, 2, 3],
    [0, 3, 3],
    [1, 1, 1],
    [1, 1, 2],
    [1, 1, 3],
    [1, 2, 2],
    [1, 2, 3],
    [1, 3, 3],
    [2, 2, 2],
    [2, 2, 3],
    [2, 3, 3],
    [3, 3, 3],
];

/// Cubic coefficients behind the ten of a quadratic, in the order 00, 01, 02, 03, 11, 12, 13, 22, 23, 33.
const STEP: [[usize; 4]; 10] = [
    [0, 1, 2, 3],
    [1, 4, 5, 6],
    [2, 5, 7, 8],
    [3, 6, 8, 9],
    [4, 10, 11, 12],
    [5, 11, 13, 14],
    [6, 12, 14, 15],
    [7, 13, 16, 17],
    [8, 14, 17, 18],
    [9, 15, 18, 19],
];

/// Quadratic coefficients behind the four of a linear function.
const LAST: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]];

/// The coefficients of a tetrahedron's cubic, in the order of [`DOMAIN`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece(pub [f64; 20]);

impl Piece {
    /// From the samples `at` holds around index `center`, `strides` apart along the local axes.
    #[inline(always)]
    pub fn new(at: &[f32], center: usize, strides: [isize; 3]) -> Self {
        let [x, y, z] = strides;
        let get = |offset: isize| f64::from(at[center.wrapping_add_signed(offset)]);
        // named by their place: first axis -, 0, +; then u, d along the second, f, b along the third
        let (cm, c0, cp) = (get(-x), get(0), get(x));
        let (um, u0, up) = (get(y - x), get(y), get(y + x));
        let (dm, d0, dp) = (get(-y - x), get(-y), get(-y + x));
        let (fm, f0, fp) = (get(z - x), get(z), get(z + x));
        let (bm, b0, bp) = (get(-z - x), get(-z), get(-z + x));
        let (uf0, ufp, ub0, ubp) = (get(y + z), get(y + z + x), get(y - z), get(y - z + x));
        let (df0, dfp, db0, dbp) = (get(-y + z), get(-y + z + x), get(-y - z), get(-y - z + x));

        let lateral0 = u0 + d0 + f0 + b0;
        let lateralp = up + dp + fp + bp;
        let lateralm = um + dm + fm + bm;
        let diagonal0 = uf0 + ub0 + df0 + db0;
        let diagonalp = ufp + ubp + dfp + dbp;
        let face = c0 + cp;
        let (up2, f2, b2, d2) = (u0 + up, f0 + fp, b0 + bp, d0 + dp);
        let (uf2, ub2) = (uf0 + ufp, ub0 + ubp);

        let near = |f0: f64, fp: f64, fm: f64, b0: f64, bp: f64, uf0: f64, df0: f64, ub0: f64| {
            3.0 / 8.0 * c0
                + 7.0 / 48.0 * (f0 + u0 + cp)
                + 1.0 / 48.0 * (cm + d0 + b0 + uf0 + fp + up)
                + 1.0 / 96.0 * (fm + um + df0 + ub0 + dp + bp)
        };
        let side = |f0: f64, fp: f64, b0: f64, bp: f64, uf0: f64, df0: f64, ub0: f64| {
            1.0 / 3.0 * c0
                + 5.0 / 24.0 * cp
                + 1.0 / 8.0 * (f0 + u0)
                + 5.0 / 96.0 * (fp + up)
                + 1.0 / 48.0 * (d0 + b0 + uf0)
                + 1.0 / 96.0 * (df0 + ub0 + dp + bp)
        };
        let third = |f0: f64, fp: f64, uf0: f64| c0 / 4.0 + (f0 + u0 + cp) / 6.0 + (uf0 + fp + up) / 12.0;
        let on_face = |f2: f64, b2: f64, uf2: f64, ub2: f64, df2: f64| {
            13.0 / 48.0 * face
                + 17.0 / 192.0 * (f2 + up2)
                + 1.0 / 64.0 * (d2 + b2)
                + 1.0 / 96.0 * uf2
                + 1.0 / 192.0 * (df2 + ub2)
        };
        let outer = |f2: f64, uf2: f64| 5.0 / 24.0 * face + (f2 + up2) / 8.0 + uf2 / 24.0;
        let quad = face + up2;
        let (front, behind) = (f2 + uf2, b2 + ub2);
        Self([
            3.0 / 8.0 * c0 + (cm + cp + lateral0) / 12.0 + (lateralm + lateralp + diagonal0) / 96.0,
            3.0 / 8.0 * c0
                + 7.0 / 48.0 * cp
                + lateral0 / 12.0
                + cm / 48.0
                + lateralp / 64.0
                + diagonal0 / 96.0
                + lateralm / 192.0,
            near(f0, fp, fm, b0, bp, uf0, df0, ub0),
            near(b0, bp, bm, f0, fp, ub0, db0, uf0),
            c0 / 3.0 + 5.0 / 24.0 * cp + 7.0 / 96.0 * lateral0 + lateralp / 32.0 + diagonal0 / 96.0,
            side(f0, fp, b0, bp, uf0, df0, ub0),
            side(b0, bp, f0, fp, ub0, db0, uf0),
            third(f0, fp, uf0),
            c0 / 3.0 + 5.0 / 24.0 * (u0 + cp) + up / 12.0 + (b0 + f0) / 24.0 + (ub0 + uf0 + bp + fp) / 48.0,
            third(b0, bp, ub0),
            13.0 / 48.0 * face + 5.0 / 96.0 * (lateral0 + lateralp) + (diagonal0 + diagonalp) / 192.0,
            on_face(f2, b2, uf2, ub2, df0 + dfp),
            on_face(b2, f2, ub2, uf2, db0 + dbp),
            outer(f2, uf2),
            13.0 / 48.0 * face + 7.0 / 48.0 * up2 + (b2 + f2) / 32.0 + (ub2 + uf2) / 96.0,
            outer(b2, ub2),
            (quad + front) / 8.0,
            5.0 / 24.0 * quad + front / 24.0,
            5.0 / 24.0 * quad + behind / 24.0,
            (quad + behind) / 8.0,
        ])
    }

    /// Smallest and largest coefficient: the piece lies between them.
    #[inline(always)]
    pub fn hull(&self) -> [f64; 2] {
        self.0.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(*v), hi.max(*v)])
    }

    /// One step of blossoming (the de Casteljau step with a point of its own).
    #[inline(always)]
    pub fn step(&self, p: [f64; 4]) -> Quadratic {
        Quadratic(STEP.map(|c| p[0] * self.0[c[0]] + p[1] * self.0[c[1]] + p[2] * self.0[c[2]] + p[3] * self.0[c[3]]))
    }

    /// By de Casteljau's algorithm.
    #[inline(always)]
    pub fn value(&self, p: [f64; 4]) -> f64 {
        self.step(p).step(p).value(p)
    }

    /// Along the local axes.
    #[inline(always)]
    pub fn gradient(&self, p: [f64; 4]) -> DVec3 {
        self.step(p).step(p).gradient()
    }

    /// Along the local axes.
    pub fn hessian(&self, p: [f64; 4]) -> DMat3 {
        let q = self.step(p);
        // the local axes in barycentric coordinates
        const AXES: [[f64; 4]; 3] = [[-2.0, 2.0, 0.0, 0.0], [0.0, -2.0, 1.0, 1.0], [0.0, 0.0, 1.0, -1.0]];
        let rows = AXES.map(|u| DVec3::from(AXES.map(|v| 6.0 * q.step(u).value(v))));
        DMat3::from_cols(rows[0], rows[1], rows[2])
    }

    /// The Bernstein coefficients of the cubic from `p` to `q`, and the gradient (along the local axes) at `p`.
    #[inline(always)]
    pub fn along(&self, p: [f64; 4], q: [f64; 4]) -> [f64; 4] {
        let (at_p, at_q) = (self.step(p), self.step(q));
        let (pp, pq, qq) = (at_p.step(p), at_p.step(q), at_q.step(q));
        [pp.value(p), pp.value(q), pq.value(q), qq.value(q)]
    }
}

/// What is left of a cubic after one step.
pub struct Quadratic([f64; 10]);

impl Quadratic {
    #[inline(always)]
    pub fn step(&self, p: [f64; 4]) -> Linear {
        Linear(LAST.map(|c| p[0] * self.0[c[0]] + p[1] * self.0[c[1]] + p[2] * self.0[c[2]] + p[3] * self.0[c[3]]))
    }
}

/// What is left after two.
pub struct Linear([f64; 4]);

impl Linear {
    #[inline(always)]
    pub fn value(&self, p: [f64; 4]) -> f64 {
        p[0] * self.0[0] + p[1] * self.0[1] + p[2] * self.0[2] + p[3] * self.0[3]
    }

    /// Of the cubic, along the local axes, if both steps were at the same point.
    #[inline(always)]
    pub fn gradient(&self) -> DVec3 {
        let [a, b, c, d] = self.0;
        3.0 * DVec3::new(2.0 * (b - a), c + d - 2.0 * b, c - d)
    }
}

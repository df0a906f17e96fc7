//! The 56 coefficients of a cube that the others follow from.
//!
//! # Theory
//!
//! The 24 pieces of a cube have 175 coefficients between them. Kalbe, Koch and Goesele store only a part, from which the
//! conditions of C1 smoothness give the rest (their Gamma_Q). Ours is: at each of the 8 corners the coefficient there and the
//! three a third of the way along the edges, and on each face the four at `(1/2, 1/3, 0)` from the middle of the cube.
//!
//! Across the planes within a cube the conditions are means, or sums and differences, of neighbours. Written for the cube's
//! symmetries (`C` the coefficient of a corner, `E` of the edges, `F` of the faces), with the coefficient of `[i, j, k]` at
//! `(vi + vj + vk) / 3`:
//!
//! - on a face, next to a corner: the mean of its two `E` there; nearer the middle: the mean of two `F`; the middle: of four;
//! - `G`, below the middle of an edge (`[0, 2, 3]`): the `F` on both sides of the edge, less the mean of its two `E`;
//! - `H`, below a corner (`[0, 2, 2]`): half of its three `E` less `C`;
//! - below a face (`[0, 1, 2]`): the mean of two `G`; below its middle (`[0, 1, 1]`): of four;
//! - `K`, next to the centre (`[0, 0, 2]`): half of the three `G` of a corner's edges less its `H`;
//! - `[0, 0, 1]`: the mean of `K` at opposite corners of a face;
//! - the centre: the mean of all `K`, which is `F / 8 - 3/32 E + C / 32` summed over the cube.
//!
//! Sums of absolute weights stay below 6, so that `f32` loses no more than three bits.

use super::{Kind, Piece};

/// What determines all pieces of a cube.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Determining {
    /// By signs (1, 2 and 4 for below the centre along i, j, k): that of the corner, then those next to it along i, j, k.
    pub corners: [[f64; 4]; 8],
    /// By twice the axis (and 1 for below): those towards the edges, first those of the lower of the other axes, above then
    /// below.
    pub faces: [[f64; 4]; 6],
}

/// One of two opposite sides of a cube along a local axis.
type Side = (usize, bool);

impl Determining {
    /// A part of the coefficients of a cube.
    pub fn new(piece: impl Fn(Kind) -> Piece) -> Self {
        let mut made = Self { corners: [[0.0; 4]; 8], faces: [[0.0; 4]; 6] };
        for kind in Kind::all() {
            let own = piece(kind).0;
            let [u, v, w] = kind.axes;
            let signs = usize::from(kind.back[0]) << u | usize::from(kind.back[1]) << v;
            for (back, corner, next) in [(0, 16, 17), (1, 19, 18)] {
                let corners = &mut made.corners[signs | back << w];
                corners[0] = own[corner];
                corners[1 + w] = own[next];
            }
            let at = |a: usize, back: bool| 2 * a + usize::from(back);
            made.faces[at(u, kind.back[0])][at(usize::from(v > w), kind.back[1])] = own[14];
        }
        made
    }

    /// All coefficients of a tetrahedron.
    pub fn piece(&self, kind: Kind) -> Piece {
        let side = |(a, back): Side| (kind.axes[a], back != (a < 2 && kind.back[a]));
        // of a corner, then towards the others along the local axes
        let corner = |sides: [bool; 3]| {
            let signs =
                (0..3).map(|a| side((a, sides[a]))).fold(0, |sum, (axis, back)| sum | usize::from(back) << axis);
            let own = self.corners[signs];
            [own[0], own[1 + kind.axes[0]], own[1 + kind.axes[1]], own[1 + kind.axes[2]]]
        };
        let on_face = |face: Side, edge: Side| {
            let ((a, back_a), (b, back_b)) = (side(face), side(edge));
            let higher = b != usize::from(a == 0);
            self.faces[2 * a + usize::from(back_a)][2 * usize::from(higher) + usize::from(back_b)]
        };
        let below_edge = |p: Side, q: Side| {
            let r = 3 - p.0 - q.0;
            let end = |back| {
                let mut sides = [back; 3];
                (sides[p.0], sides[q.0]) = (p.1, q.1);
                corner(sides)[1 + r]
            };
            on_face(p, q) + on_face(q, p) - 0.5 * (end(false) + end(true))
        };
        let below_corner = |sides| {
            let [c, u, v, w] = corner(sides);
            0.5 * (u + v + w - c)
        };
        let next_to_center = |[u, v, w]: [bool; 3]| {
            let [u_side, v_side, w_side] = [(0, u), (1, v), (2, w)];
            let edges = below_edge(u_side, v_side) + below_edge(u_side, w_side) + below_edge(v_side, w_side);
            0.5 * (edges - below_corner([u, v, w]))
        };

        let [front, behind] = [[false; 3], [false, false, true]];
        let ([c2, e2u, e2v, e2w], [c3, e3u, e3v, e3w]) = (corner(front), corner(behind));
        let around = [(1, false), (1, true), (2, false), (2, true)];
        let f = around.map(|edge| on_face((0, false), edge));
        let g = around.map(|edge| below_edge((0, false), edge));
        let (k2, k3) = (next_to_center(front), next_to_center(behind));
        let sum = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>();
        let corners = sum(&mut self.corners.iter().map(|c| c[0]));
        let edges = sum(&mut self.corners.iter().flat_map(|c| &c[1..]).copied());
        let faces = sum(&mut self.faces.iter().flatten().copied());
        Piece([
            faces / 8.0 - 3.0 / 32.0 * edges + corners / 32.0,
            0.5 * (k2 + next_to_center([false, true, true])),
            k2,
            k3,
            0.25 * (g[0] + g[1] + g[2] + g[3]),
            0.5 * (g[0] + g[2]),
            0.5 * (g[0] + g[3]),
            0.5 * (e2u + e2v + e2w - c2),
            g[0],
            0.5 * (e3u + e3v + e3w - c3),
            0.25 * (f[0] + f[1] + f[2] + f[3]),
            0.5 * (f[0] + f[2]),
            0.5 * (f[0] + f[3]),
            0.5 * (e2v + e2w),
            f[0],
            0.5 * (e3v + e3w),
            c2,
            e2w,
            e3w,
            c3,
        ])
    }
}

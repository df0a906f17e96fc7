//! The pass over all voxels of an output and of what lies about it.

use glam::DVec3;

use super::layers::{Layers, SLAB, STRIPE, Spot, View};
use super::values::{Range, Values};
use super::{Inverse, Jacobian, Subject};
use crate::math::parallel;
use crate::volume::Volume;
use crate::volume::sampling::value_at;

/// Samples of the determinant and of the inverse, at most.
const DETERMINANTS: usize = 4 << 20;
const INVERSES: usize = 1 << 18;

/// What was counted.
#[derive(Debug, Default)]
pub(super) struct Tally {
    pub uncovered: u64,
    pub more: u64,
    /// Voxels whose value comes from within the input.
    pub inside: u64,
    pub values_clipped: u64,
    pub material_clipped: u64,
    /// Voxels whose value is none of those about the place it comes from.
    pub blended: u64,
    /// Voxels whose value does not occur in the input.
    pub added: u64,
    pub jacobian: Jacobian,
    pub inverse: Inverse,
    /// For each layer of the output the numbers of its voxels in no tetrahedron.
    pub holes: Vec<Vec<u32>>,
}

impl Tally {
    fn add(&mut self, other: Self) {
        self.uncovered += other.uncovered;
        self.more += other.more;
        self.inside += other.inside;
        self.values_clipped += other.values_clipped;
        self.material_clipped += other.material_clipped;
        self.blended += other.blended;
        self.added += other.added;
        self.jacobian.join(&other.jacobian);
        self.inverse.join(&other.inverse);
        self.holes.extend(other.holes);
    }
}

/// Everything the pass needs.
pub(super) struct Audit<'a> {
    pub subject: &'a Subject<'a>,
    pub view: &'a View,
    pub layers: &'a dyn Layers,
    /// The values of the input, if they are to be kept.
    pub values: Option<&'a Values>,
}

/// Every n-th voxel along each axis, so that there are at most so many.
fn stride(dims: [usize; 3], most: usize) -> usize {
    let count = |n: usize| dims.iter().map(|d| d.div_ceil(n)).product::<usize>();
    (1..).find(|n| count(*n) <= most).unwrap_or(1)
}

impl Audit<'_> {
    pub fn run(&self) -> Tally {
        let [nx, ny, nz] = self.view.grid.dims;
        let checks = Checks::new(self);
        let pool = parallel::Pool::default();
        let parts = parallel::map(nz.div_ceil(SLAB), &|slab| {
            pool.with(
                || vec![Spot::NOTHING; nx * STRIPE],
                |spots| {
                    let mut tally = Tally::default();
                    for z in slab * SLAB..nz.min((slab + 1) * SLAB) {
                        let inner = self.view.voxel([self.view.first[0], self.view.first[1], z]).is_some();
                        if inner {
                            tally.holes.push(Vec::new());
                        }
                        for y in (0..ny).step_by(STRIPE) {
                            let spots = &mut spots[..nx * STRIPE.min(ny - y)];
                            self.layers.rows(y, z, spots);
                            for (i, spot) in spots.iter().enumerate() {
                                checks.spot([i % nx, y + i / nx, z], spot, &mut tally);
                            }
                        }
                    }
                    tally
                },
            )
        });
        let mut tally = Tally::default();
        parts.into_iter().for_each(|p| tally.add(p));
        tally
    }
}

struct Checks<'a> {
    audit: &'a Audit<'a>,
    input: &'a Volume,
    output: &'a Volume,
    range: Range,
    /// Whether values can leave the range at all: averages of samples of the same type cannot.
    scaled: bool,
    /// The outside value as stored.
    outside: f64,
    outside_clips: bool,
    /// Every so many voxels.
    determinants: usize,
    inverses: usize,
}

impl<'a> Checks<'a> {
    fn new(audit: &'a Audit<'a>) -> Self {
        let Subject { input, output, outside, density, .. } = *audit.subject;
        let range = Range::of(&output.samples);
        Self {
            audit,
            input,
            output,
            range,
            scaled: density || input.samples.scalar_type() != output.samples.scalar_type(),
            outside: range.stored(outside),
            outside_clips: range.clips(outside),
            determinants: stride(output.grid.dims, DETERMINANTS),
            inverses: stride(output.grid.dims, INVERSES),
        }
    }

    fn in_input(&self, p: DVec3) -> bool {
        let size = self.input.grid.size();
        p.cmpge(DVec3::splat(-0.5)).all() && p.cmple(size - 0.5).all()
    }

    /// The value that belongs to a spot in the input, before it is stored.
    fn expected(&self, spot: &Spot) -> [f64; 4] {
        let Subject { interpolation, density, outside, .. } = *self.audit.subject;
        let values = value_at(self.input, interpolation, spot.at, outside);
        let thinned = if density { spot.jacobian.abs() } else { 1.0 };
        values.map(|v| v / thinned)
    }

    fn spot(&self, place: [usize; 3], spot: &Spot, tally: &mut Tally) {
        let view = self.audit.view;
        let inside = spot.is_covered() && self.in_input(spot.at);
        let channels = self.input.channels;
        let Some([x, y, z]) = view.voxel(place) else {
            if inside {
                let values = self.expected(spot);
                let seen = values[..channels].iter().any(|v| self.range.stored(*v) != self.outside);
                tally.material_clipped += u64::from(seen);
            }
            return;
        };
        tally.more += u64::from(spot.within > 1);
        tally.inside += u64::from(inside);
        if !spot.is_covered() {
            tally.uncovered += 1;
            if let Some(layer) = tally.holes.last_mut() {
                layer.push((y * view.inner[0] + x) as u32);
            }
        }
        if !inside {
            tally.values_clipped += u64::from(self.outside_clips);
        } else if self.scaled {
            let clipped = self.expected(spot)[..channels].iter().any(|v| self.range.clips(*v));
            tally.values_clipped += u64::from(clipped);
        }
        if let Some(values) = self.audit.values {
            let v = self.output.samples.get(self.output.index(x, y, z));
            if v != self.outside {
                tally.added += u64::from(!values.has(v));
                tally.blended += u64::from(!(spot.is_covered() && self.is_about(spot.at, v)));
            }
        }
        let every = |n: usize| x % n == 0 && y % n == 0 && z % n == 0;
        if every(self.determinants)
            && let Some(d) = self.audit.layers.determinant(view.world(place))
        {
            tally.jacobian.take(d);
        }
        if spot.is_covered() && every(self.inverses) {
            let to = view.grid.voxel_from_world();
            let here = DVec3::from_array(place.map(|v| v as f64));
            let residual = self.audit.layers.forward(spot).map(|p| (to.transform_point3(p) - here).length());
            tally.inverse.take(residual);
        }
    }

    /// Whether a value is one of the samples about a place. The place may be off by as much as the fast export is.
    fn is_about(&self, p: DVec3, v: f64) -> bool {
        const OFF: f64 = 2e-3;
        let last = self.input.grid.size() - 1.0;
        let lo = (p - OFF).floor().clamp(DVec3::ZERO, last).to_array().map(|v| v as usize);
        let hi = (p + OFF).ceil().clamp(DVec3::ZERO, last).to_array().map(|v| v as usize);
        (lo[2]..=hi[2]).any(|k| {
            (lo[1]..=hi[1]).any(|j| (lo[0]..=hi[0]).any(|i| self.input.samples.get(self.input.index(i, j, k)) == v))
        })
    }
}

//! lyon, with the numbers of the outline's points carried through it.

use glam::DVec2;
use lyon_tessellation::geometry_builder::GeometryBuilderError;
use lyon_tessellation::math::{Point, point};
use lyon_tessellation::path::{ControlPointId, EndpointId, IdEvent, PositionStore};
use lyon_tessellation::{
    FillGeometryBuilder, FillOptions, FillRule, FillTessellator, FillVertex, GeometryBuilder, VertexId, VertexSource,
};

use super::Polygon;

/// lyon's tessellator and the points it is given.
pub(super) struct Fill {
    tessellator: FillTessellator,
    /// Centred and scaled.
    points: Vec<Point>,
    ids: Vec<u32>,
    /// First point of each loop, and the number of points.
    starts: Vec<u32>,
    /// Number of the outline's point for each vertex that lyon made.
    vertices: Vec<u32>,
}

impl Default for Fill {
    fn default() -> Self {
        Self {
            tessellator: FillTessellator::new(),
            points: Vec::new(),
            ids: Vec::new(),
            starts: Vec::new(),
            vertices: Vec::new(),
        }
    }
}

/// Writes down triangles as numbers of points.
struct Record<'a> {
    polygon: &'a Polygon<'a>,
    ids: &'a [u32],
    vertices: &'a mut Vec<u32>,
    triangles: &'a mut Vec<[u32; 3]>,
    extra: &'a mut Vec<DVec2>,
    first_triangle: usize,
}

struct Positions<'a>(&'a [Point]);

impl PositionStore for Positions<'_> {
    fn get_endpoint(&self, id: EndpointId) -> Point {
        self.0[id.0 as usize]
    }

    fn get_control_point(&self, _: ControlPointId) -> Point {
        // there are no curves
        Point::zero()
    }
}

impl Fill {
    /// Whether lyon came to an end. Triangles are anticlockwise as far as lyon's `f32` can tell.
    pub fn run(&mut self, polygon: &Polygon, triangles: &mut Vec<[u32; 3]>, extra: &mut Vec<DVec2>) -> bool {
        let (lo, hi) = polygon
            .loops()
            .flat_map(|(points, _)| points)
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
        let middle = 0.5 * (lo + hi);
        let scale = 2.0 / (hi - lo).max_element();
        if !scale.is_finite() {
            return false;
        }
        self.points.clear();
        self.ids.clear();
        self.starts.clear();
        self.vertices.clear();
        for (points, first) in polygon.loops() {
            self.starts.push(self.points.len() as u32);
            for (p, id) in points.iter().zip(first..) {
                let q = ((*p - middle) * scale).as_vec2();
                self.points.push(point(q.x, q.y));
                self.ids.push(id);
            }
        }
        self.starts.push(self.points.len() as u32);
        let events =
            self.starts.windows(2).flat_map(|w| {
                let (a, b) = (w[0], w[1]);
                let lines = (a + 1..b).map(|i| IdEvent::Line { from: EndpointId(i - 1), to: EndpointId(i) });
                std::iter::once(IdEvent::Begin { at: EndpointId(a) })
                    .chain(lines)
                    .chain(std::iter::once(IdEvent::End { last: EndpointId(b - 1), first: EndpointId(a), close: true }))
            });
        let first_triangle = triangles.len();
        // the tolerance is also the distance within which lyon takes points for one
        let options = FillOptions::default().with_fill_rule(FillRule::NonZero).with_tolerance(1e-6);
        let mut record =
            Record { polygon, ids: &self.ids, vertices: &mut self.vertices, triangles, extra, first_triangle };
        self.tessellator.tessellate_with_ids(events, &Positions(&self.points), None, &options, &mut record).is_ok()
    }
}

impl GeometryBuilder for Record<'_> {
    fn add_triangle(&mut self, a: VertexId, b: VertexId, c: VertexId) {
        // lyon's triangles run clockwise where y points up
        self.triangles.push([a, c, b].map(|v| self.vertices[v.0 as usize]));
    }

    fn abort_geometry(&mut self) {
        self.triangles.truncate(self.first_triangle);
    }
}

impl FillGeometryBuilder for Record<'_> {
    fn add_fill_vertex(&mut self, vertex: FillVertex) -> Result<VertexId, GeometryBuilderError> {
        let id = match vertex.as_endpoint_id() {
            Some(e) => self.ids[e.0 as usize],
            None => {
                // a crossing: its place on the first edge, in f64
                let points = self.polygon.outlines.points;
                let at = vertex.sources().find_map(|s| match s {
                    VertexSource::Edge { from, to, t } => {
                        let (a, b) =
                            (points[self.ids[from.0 as usize] as usize], points[self.ids[to.0 as usize] as usize]);
                        Some(a.lerp(b, f64::from(t)))
                    }
                    VertexSource::Endpoint { .. } => None,
                });
                self.extra.push(at.ok_or(GeometryBuilderError::InvalidVertex)?);
                (points.len() + self.extra.len() - 1) as u32
            }
        };
        self.vertices.push(id);
        Ok(VertexId(self.vertices.len() as u32 - 1))
    }
}

//! A tree of boxes, to find which of many boxes overlap one.

use glam::DVec3;

const LEAF: usize = 4;

/// Fewer items than this are not worth another thread.
const ITEMS_PER_TASK: usize = 2048;

/// An axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Aabb {
    pub lo: DVec3,
    pub hi: DVec3,
}

impl Aabb {
    pub fn around(points: &[DVec3]) -> Self {
        let none = Self { lo: DVec3::INFINITY, hi: DVec3::NEG_INFINITY };
        points.iter().fold(none, |b, p| Self { lo: b.lo.min(*p), hi: b.hi.max(*p) })
    }

    /// Whether the closed boxes share a point.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.lo.cmple(other.hi).all() && other.lo.cmple(self.hi).all()
    }

    /// The point of the box nearest to `p`: `p` itself if inside.
    pub fn nearest(&self, p: DVec3) -> DVec3 {
        p.clamp(self.lo, self.hi)
    }

    fn union(&self, other: &Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }
}

struct Node {
    bounds: Aabb,
    /// A leaf holds `items[first..first + count]`; an inner node (count 0) has its children right behind it and at `first`.
    first: u32,
    count: u32,
}

pub(super) struct Bvh {
    nodes: Vec<Node>,
    items: Vec<u32>,
    boxes: Vec<Aabb>,
}

/// An item and the middle of its box (twice that), side by side while they are sorted.
type Placed = (DVec3, u32);

/// Adds the node of `items`, the first of which is number `start` of all, and those below it; returns its box. Halves the
/// items in the middle of the longest side that their places take up, so that the depth is logarithmic for any input.
fn build(boxes: &[Aabb], items: &mut [Placed], start: usize, nodes: &mut Vec<Node>) -> Aabb {
    let (at, n) = (nodes.len(), items.len());
    if n <= LEAF {
        let bounds = items.iter().fold(Aabb::around(&[]), |b, i| b.union(&boxes[i.1 as usize]));
        nodes.push(Node { bounds, first: start as u32, count: n as u32 });
        return bounds;
    }
    nodes.push(Node { bounds: Aabb::around(&[]), first: 0, count: 0 });
    let places = items.iter().fold(Aabb::around(&[]), |b, i| b.union(&Aabb { lo: i.0, hi: i.0 }));
    let size = places.hi - places.lo;
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    let middle = n / 2;
    items.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]));
    let (left, right) = items.split_at_mut(middle);
    let (left, right) = if n < ITEMS_PER_TASK {
        let left = build(boxes, left, start, nodes);
        nodes[at].first = nodes.len() as u32;
        (left, build(boxes, right, start + middle, nodes))
    } else {
        let mut others = Vec::new();
        let both =
            rayon::join(|| build(boxes, left, start, nodes), || build(boxes, right, start + middle, &mut others));
        let shift = nodes.len() as u32;
        others.iter_mut().filter(|node| node.count == 0).for_each(|node| node.first += shift);
        nodes.append(&mut others);
        nodes[at].first = shift;
        both
    };
    nodes[at].bounds = left.union(&right);
    nodes[at].bounds
}

impl Bvh {
    pub fn new(boxes: Vec<Aabb>) -> Self {
        let mut placed: Vec<Placed> = boxes.iter().zip(0..).map(|(b, i)| (b.lo + b.hi, i)).collect();
        let mut nodes = Vec::new();
        if !placed.is_empty() {
            build(&boxes, &mut placed, 0, &mut nodes);
        }
        Self { nodes, items: placed.into_iter().map(|p| p.1).collect(), boxes }
    }

    pub fn bounds_of(&self, item: u32) -> &Aabb {
        &self.boxes[item as usize]
    }

    /// The point nearest to `p` in any box, if it is less than `reach` away (or `p` lies in a box).
    pub fn nearest(&self, p: DVec3, reach: f64) -> Option<DVec3> {
        let mut best = (reach * reach, None);
        let mut stack = if self.nodes.is_empty() { Vec::new() } else { vec![0u32] };
        while let Some(at) = stack.pop() {
            let node = &self.nodes[at as usize];
            let distance = |b: &Aabb| b.nearest(p).distance_squared(p);
            let d = distance(&node.bounds);
            if d >= best.0 && d > 0.0 {
                continue;
            }
            if node.count == 0 {
                let (left, right) = (at + 1, node.first);
                let far_left =
                    distance(&self.nodes[left as usize].bounds) > distance(&self.nodes[right as usize].bounds);
                stack.extend(if far_left { [left, right] } else { [right, left] });
                continue;
            }
            for &i in &self.items[node.first as usize..(node.first + node.count) as usize] {
                let q = self.boxes[i as usize].nearest(p);
                let d = q.distance_squared(p);
                if d < best.0 || d == 0.0 {
                    best = (d, Some(q));
                    if d == 0.0 {
                        return Some(q);
                    }
                }
            }
        }
        best.1
    }

    /// The item with the smallest `distance_squared` from `p`, and that; each item lies in its box.
    pub fn nearest_item(&self, p: DVec3, mut distance_squared: impl FnMut(u32) -> f64) -> Option<(u32, f64)> {
        let mut best = None;
        let mut least = f64::INFINITY;
        let mut stack = if self.nodes.is_empty() { Vec::new() } else { vec![0u32] };
        while let Some(at) = stack.pop() {
            let node = &self.nodes[at as usize];
            let to_box = |b: &Aabb| b.nearest(p).distance_squared(p);
            if to_box(&node.bounds) >= least {
                continue;
            }
            if node.count == 0 {
                let (left, right) = (at + 1, node.first);
                let far_left = to_box(&self.nodes[left as usize].bounds) > to_box(&self.nodes[right as usize].bounds);
                stack.extend(if far_left { [left, right] } else { [right, left] });
                continue;
            }
            for &i in &self.items[node.first as usize..(node.first + node.count) as usize] {
                if to_box(&self.boxes[i as usize]) < least {
                    let d = distance_squared(i);
                    if d < least {
                        (least, best) = (d, Some((i, d)));
                    }
                }
            }
        }
        best
    }

    /// Calls `found` for every item whose box overlaps `query`, in no order.
    pub fn overlapping(&self, query: &Aabb, mut found: impl FnMut(u32)) {
        if self.nodes.is_empty() {
            return;
        }
        let mut stack = vec![0u32];
        while let Some(at) = stack.pop() {
            let node = &self.nodes[at as usize];
            if !node.bounds.overlaps(query) {
                continue;
            }
            if node.count == 0 {
                stack.extend([at + 1, node.first]);
                continue;
            }
            for &i in &self.items[node.first as usize..(node.first + node.count) as usize] {
                if self.boxes[i as usize].overlaps(query) {
                    found(i);
                }
            }
        }
    }

    /// Calls `found` once for every two items whose boxes overlap, in no order and from several threads.
    pub fn overlapping_pairs(&self, found: &(impl Fn(u32, u32) + Sync)) {
        if !self.nodes.is_empty() {
            self.pairs_within(0, self.items.len(), found);
        }
    }

    /// The pairs of items below one node, which has about so many.
    fn pairs_within(&self, at: u32, items: usize, found: &(impl Fn(u32, u32) + Sync)) {
        let node = &self.nodes[at as usize];
        if node.count > 0 {
            let leaf = self.leaf(node);
            for (n, &i) in leaf.iter().enumerate() {
                leaf[..n].iter().filter(|&&j| self.overlap(i, j)).for_each(|&j| found(i, j));
            }
            return;
        }
        let (left, right) = (at + 1, node.first);
        if items < ITEMS_PER_TASK {
            self.pairs_within(left, items / 2, found);
            self.pairs_within(right, items / 2, found);
            self.pairs_between(left, right, found);
        } else {
            rayon::join(
                || {
                    rayon::join(
                        || self.pairs_within(left, items / 2, found),
                        || self.pairs_within(right, items / 2, found),
                    )
                },
                || self.pairs_between(left, right, found),
            );
        }
    }

    /// The pairs of an item below one node and an item below another.
    fn pairs_between(&self, a: u32, b: u32, found: &(impl Fn(u32, u32) + Sync)) {
        let (na, nb) = (&self.nodes[a as usize], &self.nodes[b as usize]);
        if !na.bounds.overlaps(&nb.bounds) {
            return;
        }
        let below =
            |at: u32, node: &Node| if node.count > 0 { [Some(at), None] } else { [Some(at + 1), Some(node.first)] };
        if na.count > 0 && nb.count > 0 {
            for &i in self.leaf(na) {
                if self.boxes[i as usize].overlaps(&nb.bounds) {
                    self.leaf(nb).iter().filter(|&&j| self.overlap(i, j)).for_each(|&j| found(i, j));
                }
            }
            return;
        }
        for a in below(a, na).into_iter().flatten() {
            for b in below(b, nb).into_iter().flatten() {
                self.pairs_between(a, b, found);
            }
        }
    }

    fn leaf(&self, node: &Node) -> &[u32] {
        &self.items[node.first as usize..(node.first + node.count) as usize]
    }

    fn overlap(&self, i: u32, j: u32) -> bool {
        self.boxes[i as usize].overlaps(&self.boxes[j as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_is_that_of_a_full_search() {
        let boxes: Vec<Aabb> = (0..200)
            .map(|i| {
                let lo = DVec3::new((i * 37 % 101) as f64, (i * 53 % 97) as f64, (i * 71 % 89) as f64);
                Aabb { lo, hi: lo + DVec3::new((i % 3) as f64, 1.0, (i % 5) as f64) }
            })
            .collect();
        let tree = Bvh::new(boxes.clone());
        for i in 0..300 {
            let p =
                DVec3::new((i * 29 % 120) as f64 - 10.0, (i * 31 % 117) as f64 - 10.0, (i * 41 % 113) as f64 - 10.0);
            let full = boxes.iter().map(|b| b.nearest(p).distance(p)).fold(f64::INFINITY, f64::min);
            let found = tree.nearest(p, f64::INFINITY).map(|q| q.distance(p));
            assert_eq!(found, Some(full));
            assert_eq!(tree.nearest(p, full * 0.999).is_some(), full == 0.0);
        }
        assert_eq!(Bvh::new(Vec::new()).nearest(DVec3::ZERO, f64::INFINITY), None);
    }

    #[test]
    fn finds_what_a_full_search_finds() {
        let mut seed = 1u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((seed >> 33) % 50) as f64
        };
        for n in [0, 1, 4, 5, 300, 3000] {
            let boxes: Vec<Aabb> = (0..n)
                .map(|_| {
                    let lo = DVec3::new(random(), random(), random());
                    Aabb { lo, hi: lo + DVec3::new(random(), random(), random()) * 0.1 }
                })
                .collect();
            let tree = Bvh::new(boxes.clone());
            for q in &boxes {
                let mut found = Vec::new();
                tree.overlapping(q, |i| found.push(i as usize));
                found.sort_unstable();
                assert_eq!(found, (0..n).filter(|&i| boxes[i].overlaps(q)).collect::<Vec<_>>());
            }
            let pairs = std::sync::Mutex::new(Vec::new());
            tree.overlapping_pairs(&|i, j| pairs.lock().unwrap().push([i.min(j) as usize, i.max(j) as usize]));
            let mut pairs = pairs.into_inner().unwrap();
            pairs.sort_unstable();
            let all = (0..n).flat_map(|i| (i + 1..n).map(move |j| [i, j]));
            assert_eq!(pairs, all.filter(|&[i, j]| boxes[i].overlaps(&boxes[j])).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_thousand_equal_boxes_make_no_deep_tree() {
        let tree = Bvh::new(vec![Aabb { lo: DVec3::ZERO, hi: DVec3::ONE }; 1000]);
        let mut n = 0;
        tree.overlapping(&Aabb { lo: DVec3::ONE, hi: DVec3::ONE }, |_| n += 1);
        assert_eq!(n, 1000);
    }
}

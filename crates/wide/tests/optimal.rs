//! The optimal collapse against every collapse that there is.

use fastrand::Rng;
use niwaki_core::{Aabb, Bvh, BvhNode, glam::Vec3, to_u32};
use niwaki_wide::{CollapseSettings, WideBvh, WideCosts};

/// A random binary tree with `leaves` leaves of 1 to 3 references in random boxes.
fn random_tree(leaves: usize, rng: &mut Rng) -> Bvh {
    let mut bvh = Bvh { nodes: vec![BvhNode::leaf(Aabb::EMPTY, 0, 1)], prim_ids: Vec::new() };
    let mut open = vec![(0, leaves)];
    while let Some((node, leaves)) = open.pop() {
        if leaves == 1 {
            let (first, count) = (bvh.prim_ids.len(), rng.usize(1..4));
            bvh.prim_ids.extend((first..first + count).map(to_u32));
            let mut point = || Vec3::new(rng.f32(), rng.f32(), rng.f32());
            let (min, extent) = (point() * 4.0, point());
            let bounds = Aabb::new(min, min + extent);
            bvh.nodes[node] = BvhNode::leaf(bounds, to_u32(first), to_u32(count));
        } else {
            let (first, left) = (bvh.nodes.len(), rng.usize(1..leaves));
            bvh.nodes[node] = BvhNode::inner(Aabb::EMPTY, to_u32(first));
            bvh.nodes.extend([BvhNode::leaf(Aabb::EMPTY, 0, 1); 2]);
            open.extend([(first, left), (first + 1, leaves - left)]);
        }
    }
    // Children stand behind their parents.
    for i in (0..bvh.nodes.len()).rev() {
        if !bvh.nodes[i].is_leaf() {
            let [a, b] = bvh.nodes[i].children();
            let bounds = bvh.nodes[a].aabb().union(bvh.nodes[b].aabb());
            bvh.nodes[i] = BvhNode::inner(bounds, bvh.nodes[i].first);
        }
    }
    bvh
}

/// Looks at every collapse, without the recurrence of the paper.
struct Exhaustive<'a, const W: usize> {
    bvh: &'a Bvh,
    max_leaf: usize,
    costs: WideCosts,
}

impl<const W: usize> Exhaustive<'_, W> {
    fn refs(&self, node: usize) -> usize {
        let n = &self.bvh.nodes[node];
        if n.is_leaf() { n.count as usize } else { n.children().map(|c| self.refs(c)).iter().sum() }
    }

    fn area(&self, node: usize) -> f64 {
        self.bvh.nodes[node].aabb().area()
    }

    /// Every set of at most `W` nodes that has everything below `node` below it once.
    fn cuts(&self, node: usize) -> Vec<Vec<usize>> {
        let mut cuts = vec![vec![node]];
        if !self.bvh.nodes[node].is_leaf() {
            let [a, b] = self.bvh.nodes[node].children();
            for left in self.cuts(a) {
                for right in self.cuts(b) {
                    if left.len() + right.len() <= W {
                        cuts.push([left.clone(), right].concat());
                    }
                }
            }
        }
        cuts
    }

    /// The least cost of `node` as a wide node.
    fn as_node(&self, node: usize) -> f64 {
        let cuts = self.cuts(node).into_iter();
        let below = cuts
            .filter(|cut| *cut != [node])
            .map(|cut| cut.into_iter().map(|child| self.as_child(child)).sum::<f64>())
            .fold(f64::INFINITY, f64::min);
        f64::from(self.costs.node) * self.area(node) + below
    }

    fn as_child(&self, node: usize) -> f64 {
        let refs = self.refs(node);
        let leaf = f64::from(self.costs.leaf) + f64::from(self.costs.reference) * refs as f64;
        let as_leaf = if refs <= self.max_leaf { leaf * self.area(node) } else { f64::INFINITY };
        let is_leaf = self.bvh.nodes[node].is_leaf();
        if is_leaf { as_leaf } else { as_leaf.min(self.as_node(node)) }
    }
}

#[test]
fn no_collapse_costs_less() {
    let mut rng = Rng::with_seed(7);
    let mut better_than_greedy = 0;
    for round in 0..120 {
        let bvh = random_tree(rng.usize(2..13), &mut rng);
        let costs = WideCosts { node: rng.f32(), leaf: rng.f32(), reference: rng.f32() * 0.5 };
        let settings =
            CollapseSettings { max_leaf: rng.usize(3..7), costs, ..CollapseSettings::optimal() };
        let wide = WideBvh::<4>::collapse(&bvh, &settings).unwrap();
        let cost = wide.cost(&costs);
        let all = Exhaustive::<4> { bvh: &bvh, max_leaf: settings.max_leaf.min(4), costs };
        let least = all.as_node(0) / all.area(0);
        assert!((cost - least).abs() <= 1e-5 * least, "round {round}: {cost} is not {least}");
        let greedy =
            CollapseSettings { costs, max_leaf: settings.max_leaf, ..CollapseSettings::greedy() };
        let greedy = WideBvh::<4>::collapse(&bvh, &greedy).unwrap().cost(&costs);
        better_than_greedy += usize::from(cost < greedy * (1.0 - 1e-5));
    }
    assert!(better_than_greedy > 30, "the trees must leave a choice: {better_than_greedy}");
}

#[test]
fn the_cost_of_a_small_tree_is_as_computed_by_hand() {
    // Two unit cubes that fill a box of 2 × 1 × 1, of area 10; each has an area of 6.
    let cube = |x: f32| Aabb::new(Vec3::new(x, 0.0, 0.0), Vec3::new(x + 1.0, 1.0, 1.0));
    let bvh = Bvh {
        nodes: vec![
            BvhNode::inner(cube(0.0).union(cube(1.0)), 1),
            BvhNode::leaf(cube(0.0), 0, 1),
            BvhNode::leaf(cube(1.0), 1, 3),
        ],
        prim_ids: vec![0, 1, 2, 3],
    };
    let costs = WideCosts { node: 2.0, leaf: 1.0, reference: 0.5 };
    for settings in [CollapseSettings::greedy(), CollapseSettings::optimal()] {
        let wide = WideBvh::<8>::collapse(&bvh, &settings).unwrap();
        let expected = 2.0 + 0.6 * 1.5 + 0.6 * 2.5;
        assert!((wide.cost(&costs) - expected).abs() < 1e-12);
    }
    assert_eq!(WideBvh::<4>::default().cost(&costs), 0.0);
    // Points have no area: every box counts as much as the root.
    let point = Aabb::new(Vec3::ONE, Vec3::ONE);
    let bvh = Bvh { nodes: vec![BvhNode::leaf(point, 0, 2)], prim_ids: vec![0, 1] };
    let wide = WideBvh::<16>::collapse(&bvh, &CollapseSettings::default()).unwrap();
    assert_eq!(wide.cost(&costs), 4.0);
}

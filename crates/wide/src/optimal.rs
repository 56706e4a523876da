//! Children that give the least expected cost, by dynamic programming.

use crate::{
    CollapseError, WideCosts,
    bottom_up::bottom_up,
    collapse::{Collapse, Item, Slots},
};
use niwaki_core::memory::prefer_large_pages;

/// Least costs of a node, at `i − 1` those of representing everything below it in at most `i`
/// slots of a wide node: C(n, i) of Ylitie, Karras and Laine 2017, section 3.1.
pub(crate) type Costs<const W: usize> = [f32; W];

impl<const W: usize> Collapse<'_, W> {
    /// C(n, i) for every node of the binary tree.
    pub(crate) fn least_costs(&self) -> Vec<Costs<W>> {
        let nodes = &self.bvh.nodes;
        let mut table = vec![[0.0; W]; nodes.len()];
        prefer_large_pages(&table);
        // Areas beyond f32 may give NaN as well, which only costs time.
        let is_pending = |costs: &Costs<W>| costs[0].is_nan();
        bottom_up(nodes, &mut table, [f32::NAN; W], is_pending, |i, children| match children {
            Some([a, b]) => self.inner_costs(i, a, b),
            None if nodes[i].is_leaf() => [self.leaf_cost(i); W],
            None => [f32::INFINITY; W],
        });
        table
    }

    /// What visits of a node are weighted by: its area and a trifle more, so that among boxes
    /// without area the fewest visits are the best.
    #[inline]
    fn weight(&self, node: usize) -> f32 {
        self.area(node) + self.least_weight
    }

    /// [`Collapse::least_weight`]: far below the area of any box that matters.
    pub(crate) fn find_least_weight(&self) -> f32 {
        let root = self.area(0);
        if root > 0.0 { root * f32::from_bits((127 - 40) << 23) } else { 1.0 }
    }

    fn inner_costs(&self, node: usize, a: &Costs<W>, b: &Costs<W>) -> Costs<W> {
        // C_distribute(n, j + 1), the least of C(a, k) + C(b, j + 1 − k), for all j at once: where
        // b's costs moved by k have no value, they are infinite.
        let mut moved = [[f32::INFINITY; W]; 2];
        moved[1] = *b;
        let moved = moved.as_flattened();
        let mut costs = [f32::INFINITY; W];
        for k in 1..W {
            let cost = a[k - 1];
            for (least, b) in costs.iter_mut().zip(&moved[W - k..]) {
                *least = smaller(*least, cost + b);
            }
        }
        let as_node = costs[W - 1] + self.weight(node) * self.settings.costs.node;
        costs[0] = if self.fits(node) { smaller(as_node, self.leaf_cost(node)) } else { as_node };
        for i in 1..W {
            costs[i] = smaller(costs[i - 1], costs[i]);
        }
        costs
    }

    /// What a node costs that becomes a leaf, or, if it is one too large for that, nodes of equal
    /// boxes over several.
    #[inline]
    fn leaf_cost(&self, node: usize) -> f32 {
        let WideCosts { leaf, reference, .. } = self.settings.costs;
        let count = self.counts[node];
        if usize::from(count) <= self.max_leaf {
            return self.weight(node) * (leaf + reference * f32::from(count));
        }
        self.large_leaf_cost(node)
    }

    #[cold]
    fn large_leaf_cost(&self, node: usize) -> f32 {
        let WideCosts { node: inner, leaf, reference } = self.settings.costs;
        let refs = self.bvh.nodes[node].count;
        let leaves = (refs as usize).div_ceil(self.max_leaf);
        let nodes = (leaves - 1).div_ceil(W - 1);
        let cost = inner * nodes as f32 + leaf * leaves as f32 + reference * refs as f32;
        self.weight(node) * cost
    }

    /// Retraces how `table` reaches its cost for the children of the wide node that stands for
    /// `root`.
    pub(crate) fn choose_optimally(
        &self,
        root: Item,
        table: &[Costs<W>],
    ) -> Result<Slots<W>, CollapseError> {
        let mut slots = Slots::default();
        // Nodes with the number of slots for each; these numbers always add up to W at most.
        let mut pending = [(0, 0); W];
        let mut count = 0;
        let mut next = Some((root.node as usize, W));
        while let Some((node, mut room)) = next {
            if node != root.node as usize {
                let costs = &table[node];
                let fewer = (1..room).rev().find(|&i| costs[i] < costs[i - 1]);
                room = fewer.map_or(1, |i| i + 1);
            }
            if room > 1 {
                let [a, b] = self.children(node)?;
                let (mut best, mut least) = (1, f32::INFINITY);
                for k in 1..room {
                    let cost = table[a][k - 1] + table[b][room - k - 1];
                    if cost < least {
                        (best, least) = (k, cost);
                    }
                }
                pending[count] = (b, room - best);
                count += 1;
                next = Some((a, best));
                continue;
            }
            let mut item = self.item(node)?;
            if item.is_leaf && table[node][0] < self.leaf_cost(node) {
                item.is_leaf = false;
            }
            slots.push(item);
            next = count.checked_sub(1).map(|last| {
                count = last;
                pending[last]
            });
        }
        Ok(slots)
    }
}

/// The smaller of two numbers, `a` if one is NaN: one instruction, unlike [`f32::min`].
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

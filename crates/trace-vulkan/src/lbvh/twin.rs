//! What the kernels do, step by step, in plain Rust: each function is the twin of the entry points
//! that it names. Tests compare it with the CPU builder, and the kernels with it, buffer by buffer, so
//! that a device that goes wrong is caught at the stage where it does.

use super::LbvhConfig;
use niwaki_core::morton::{Quantizer, common_prefix};
use niwaki_core::{Aabb, AreaScale, BuildError, Bvh, BvhNode, PrimRef, SceneBounds, scene_bounds};

/// Items of a tile, as `TILE` in `lbvh/state.wgsl`.
const TILE: usize = 2048;
const DIGITS: usize = 256;
pub(crate) const NONE: u32 = u32::MAX;
pub(crate) const IS_LEAF: u32 = 1 << 31;

/// What the primitives are quantised by: the words from `S_LOW` on (`bounds.wgsl:settle`).
pub(crate) fn settle(scene: &SceneBounds, code_bits: u32) -> [u32; 9] {
    let cells = (1_u32 << (code_bits / 3)) as f32;
    let bounds = &scene.centroid2_bounds;
    let pre = AreaScale::of(bounds).get();
    let scale = (bounds.extent() * pre).to_array().map(|edge| {
        let scale = cells / edge;
        if edge > 0.0 && scale.is_finite() { scale } else { 0.0 }
    });
    let [x, y, z] = bounds.min.to_array();
    let [sx, sy, sz] = scale;
    [x, y, z, pre, sx, sy, sz, cells - 1.0, scene.area_scale.get()].map(f32::to_bits)
}

/// One pass of the sort by the digit at `shift` (`sort.wgsl`): the items in their new order.
pub(crate) fn sort_pass(items: &[(u64, u32)], shift: u32) -> Vec<(u64, u32)> {
    let digit = |item: &(u64, u32)| (item.0 >> shift & 255) as usize;
    let tiles = items.len().div_ceil(TILE);
    let mut table = vec![0_u32; DIGITS * tiles + DIGITS];
    for (tile, items) in items.chunks(TILE).enumerate() {
        for item in items {
            table[digit(item) * tiles + tile] += 1;
        }
    }
    for d in 0..DIGITS {
        let mut sum = 0;
        for count in &mut table[d * tiles..(d + 1) * tiles] {
            (*count, sum) = (sum, sum + *count);
        }
        table[DIGITS * tiles + d] = sum;
    }
    let mut sorted = vec![(0, 0); items.len()];
    for (tile, items) in items.chunks(TILE).enumerate() {
        // Where the next item of each digit goes: after all smaller digits, and after the same digit
        // in the tiles before.
        let mut next = [0_u32; DIGITS];
        let mut smaller = 0;
        for d in 0..DIGITS {
            next[d] = smaller + table[d * tiles + tile];
            smaller += table[DIGITS * tiles + d];
        }
        for item in items {
            let place = &mut next[digit(item)];
            sorted[*place as usize] = *item;
            *place += 1;
        }
    }
    sorted
}

/// The radix tree: its arrays as in `lbvh/tree.wgsl`.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Tree {
    pub(crate) other: Vec<u32>,
    /// With [`IS_LEAF`] after [`collapse`].
    pub(crate) split: Vec<u32>,
    pub(crate) parent: Vec<u32>,
    pub(crate) leaf_parent: Vec<u32>,
}

impl Tree {
    /// First and last place of an inner node.
    fn range(&self, node: u32) -> (u32, u32) {
        let other = self.other[node as usize];
        (node.min(other), node.max(other))
    }

    fn count(&self, node: u32) -> u32 {
        let (first, last) = self.range(node);
        last - first + 1
    }
}

/// All inner nodes, each from its own position (`karras.wgsl:hierarchy`).
pub(crate) fn hierarchy(codes: &[u64]) -> Tree {
    let count = codes.len();
    let inner = count.saturating_sub(1);
    let mut tree = Tree {
        other: vec![0; inner],
        split: vec![0; inner],
        parent: vec![NONE; inner],
        leaf_parent: vec![NONE; count],
    };
    for i in 0..inner {
        let prefix = |j: Option<usize>| match j {
            Some(j) if j < count => i64::from(common_prefix(codes, i, j)),
            _ => -1,
        };
        let (after, before) = (prefix(Some(i + 1)), prefix(i.checked_sub(1)));
        let at = |offset: usize| {
            if after > before { Some(i + offset) } else { i.checked_sub(offset) }
        };
        let behind = after.min(before);
        let mut bound = 2;
        while prefix(at(bound)) > behind {
            bound *= 2;
        }
        let mut extent = 0;
        while bound > 1 {
            bound /= 2;
            if prefix(at(extent + bound)) > behind {
                extent += bound;
            }
        }
        let whole = prefix(at(extent));
        let (mut half, mut step) = (0, extent);
        loop {
            step = step.div_ceil(2);
            if prefix(at(half + step)) > whole {
                half += step;
            }
            if step <= 1 {
                break;
            }
        }
        let (first, split, last) =
            if after > before { (i, i + half, i + extent) } else { (i - extent, i - half - 1, i) };
        let word = |place: usize| u32::try_from(place).unwrap();
        tree.other[i] = word(first + last - i);
        tree.split[i] = word(split);
        let left = if split == first { &mut tree.leaf_parent } else { &mut tree.parent };
        left[split] = word(i);
        let right = if split + 1 == last { &mut tree.leaf_parent } else { &mut tree.parent };
        right[split + 1] = word(i);
    }
    tree
}

/// Boxes of inner nodes: a leaf goes up, leaves its box at nodes where it comes first, and goes on
/// with both where it comes second (`boxes.wgsl:bottom_up`).
pub(crate) fn bottom_up(tree: &Tree, leaves: &[Aabb]) -> Vec<Aabb> {
    let mut boxes: Vec<Option<Aabb>> = vec![None; tree.other.len()];
    for (place, &leaf) in leaves.iter().enumerate() {
        let (mut child, mut bounds, mut node) = (place, leaf, tree.leaf_parent[place]);
        while node != NONE {
            let at = node as usize;
            let Some(other) = boxes[at] else {
                boxes[at] = Some(bounds);
                break;
            };
            let is_left = child == tree.split[at] as usize;
            bounds = if is_left { bounds.union(other) } else { other.union(bounds) };
            boxes[at] = Some(bounds);
            (child, node) = (at, tree.parent[at]);
        }
    }
    boxes.into_iter().map(|b| b.unwrap()).collect()
}

/// Marks the subtrees that are no dearer as one leaf (`boxes.wgsl:collapse`).
pub(crate) fn collapse(
    tree: &mut Tree,
    boxes: &[Aabb],
    leaves: &[Aabb],
    config: &LbvhConfig,
    scale: AreaScale,
) {
    let leaf_cost = |bounds: &Aabb, count: u32| {
        (config.sah.leaf + config.sah.triangle * count as f32) * bounds.half_area(scale)
    };
    let mut costs: Vec<Option<f32>> = vec![None; boxes.len()];
    for (place, bounds) in leaves.iter().enumerate() {
        let (mut cost, mut node) = (leaf_cost(bounds, 1), tree.leaf_parent[place]);
        while node != NONE {
            let (at, count) = (node as usize, tree.count(node));
            if count as usize > config.max_leaf_size {
                break;
            }
            let Some(other) = costs[at] else {
                costs[at] = Some(cost);
                break;
            };
            let inner = config.sah.inner * boxes[at].half_area(scale) + (cost + other);
            let leaf = leaf_cost(&boxes[at], count);
            cost = inner;
            if leaf <= inner {
                cost = leaf;
                tree.split[at] |= IS_LEAF;
            }
            node = tree.parent[at];
        }
    }
}

/// C and E for each place (`mark.wgsl`, `rank.wgsl`).
pub(crate) fn ranks(tree: &Tree, places: usize, max_leaf_size: usize) -> (Vec<u32>, Vec<u32>) {
    let (mut closed, mut open) = (vec![0; places], vec![0; places]);
    'nodes: for i in 0..u32::try_from(tree.other.len()).unwrap() {
        let mut node = i;
        while node != NONE && tree.count(node) as usize <= max_leaf_size {
            if tree.split[node as usize] & IS_LEAF != 0 {
                continue 'nodes;
            }
            node = tree.parent[node as usize];
        }
        closed[tree.split[i as usize] as usize] = 1;
        open[tree.range(i).0 as usize] += 1;
    }
    let (mut c, mut o) = (0, 0);
    for (closed, open) in closed.iter_mut().zip(&mut open) {
        o += *open;
        *open = o - c;
        (*closed, c) = (c, c + *closed);
    }
    (closed, open)
}

/// The nodes at their places (`emit.wgsl`).
pub(crate) fn emit(
    tree: &Tree,
    boxes: &[Aabb],
    leaves: &[Aabb],
    (closed, open): &(Vec<u32>, Vec<u32>),
) -> Vec<BvhNode> {
    let Some(last) = leaves.len().checked_sub(1) else { return Vec::new() };
    let split_of = |node: usize| (tree.split[node] & !IS_LEAF) as usize;
    let is_inner = |node: usize| closed[split_of(node) + 1] != closed[split_of(node)];
    let pair_of = |first: usize, last: usize| 1 + 2 * (closed[first] + open[last]);
    let node = |node: usize, first: usize, last: usize| {
        let (from, count) =
            (u32::try_from(first).unwrap(), u32::try_from(last - first + 1).unwrap());
        if first == last {
            BvhNode::leaf(leaves[first], from, 1)
        } else if is_inner(node) {
            BvhNode::inner(boxes[node], pair_of(first, last))
        } else {
            BvhNode::leaf(boxes[node], from, count)
        }
    };
    let mut nodes = vec![BvhNode::leaf(Aabb::EMPTY, NONE, 1); 1 + 2 * closed[last] as usize];
    nodes[0] = node(0, 0, last);
    for i in (0..tree.other.len()).filter(|&i| is_inner(i)) {
        let (first, last) = tree.range(u32::try_from(i).unwrap());
        let (first, last, split) = (first as usize, last as usize, split_of(i));
        let pair = pair_of(first, last) as usize;
        nodes[pair] = node(split, first, split);
        nodes[pair + 1] = node(split + 1, split + 1, last);
    }
    nodes
}

/// Everything, stage by stage.
pub(crate) struct Stages {
    pub(crate) record: [u32; 9],
    /// Codes and places in the input, in order.
    pub(crate) sorted: Vec<(u64, u32)>,
    pub(crate) tree: Tree,
    pub(crate) boxes: Vec<Aabb>,
    pub(crate) ranks: (Vec<u32>, Vec<u32>),
    pub(crate) bvh: Bvh,
}

/// Builds the tree of at least one primitive as the kernels do.
pub(crate) fn build(prims: &[PrimRef], config: &LbvhConfig) -> Result<Stages, BuildError> {
    let scene = scene_bounds(prims)?;
    let quantizer = Quantizer::new(&scene, config.code_bits);
    let mut sorted: Vec<(u64, u32)> = prims.iter().map(|p| quantizer.code(p)).zip(0..).collect();
    for shift in (0..config.code_bits).step_by(8) {
        sorted = sort_pass(&sorted, shift);
    }
    let codes: Vec<u64> = sorted.iter().map(|item| item.0).collect();
    let leaves: Vec<Aabb> = sorted.iter().map(|item| prims[item.1 as usize].aabb()).collect();
    let mut tree = hierarchy(&codes);
    let boxes = bottom_up(&tree, &leaves);
    collapse(&mut tree, &boxes, &leaves, config, scene.area_scale);
    let ranks = ranks(&tree, leaves.len(), config.max_leaf_size);
    let nodes = emit(&tree, &boxes, &leaves, &ranks);
    let prim_ids = sorted.iter().map(|item| prims[item.1 as usize].prim_id).collect();
    let record = settle(&scene, config.code_bits);
    Ok(Stages { record, sorted, tree, boxes, ranks, bvh: Bvh { nodes, prim_ids } })
}

//! Mini tree pruning as a pass over any tree (thesis paper IV, section 5.4).

use crate::pass::{Outcome, improve, rearrange_memory};
use crate::tree::Tree;
use crate::{OptimizeError, Optimizer, Report};
use niwaki_core::glam::Vec4Swizzles;
use niwaki_core::{Aabb, BuildError, Builder, Bvh, BvhNode, PrimRef, SahConstants, to_u32};
use std::ops::Range;

/// Cuts a tree into small subtrees, cuts those up that are large compared with the others, and
/// builds a new top over the pieces (thesis paper IV, section 5.4, last paragraph: pruning can
/// start "at any node with less than a user defined number of triangles referenced by the sub
/// tree").
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prune<B> {
    /// Builds the top over the roots of the pieces. Must not split what it is given.
    pub builder: B,
    /// The first subtrees from the root down with at most so many references are the mini trees;
    /// at least 1, 512 by default.
    pub mini_tree_size: u32,
    /// T as a fraction of the *mean* surface area of the mini tree roots: a mini tree larger than
    /// T is replaced by the first nodes below its root that are not, or are leaves. Finite, not
    /// negative; 0.1 by default.
    pub threshold: f32,
    /// Costs of [`Report`].
    pub constants: SahConstants,
}

impl<B: Builder> Prune<B> {
    /// Mini trees of 512 references and a threshold of 0.1.
    #[must_use]
    pub fn new(builder: B) -> Self {
        let constants = SahConstants::default();
        Self { builder, mini_tree_size: 512, threshold: 0.1, constants }
    }

    fn check(&self) -> Result<(), OptimizeError> {
        if self.mini_tree_size == 0 {
            return Err(OptimizeError::BadSetting {
                setting: "mini_tree_size",
                value: "0".into(),
                remedy: "at least 1 reference",
            });
        }
        if !(self.threshold.is_finite() && self.threshold >= 0.0) {
            return Err(OptimizeError::BadSetting {
                setting: "threshold",
                value: self.threshold.to_string(),
                remedy: "a finite number, not negative",
            });
        }
        Ok(())
    }

    /// The nodes that the new top is built over, from left to right.
    fn roots(&self, tree: &Tree) -> Vec<u32> {
        let nodes = tree.nodes();
        let mut counts = vec![0_u32; nodes.len()];
        for i in (0..nodes.len()).rev().filter(|&i| i != 1) {
            let [a, b] = [nodes[i].first() as usize, nodes[i].first() as usize + 1];
            counts[i] = if nodes[i].is_leaf() { nodes[i].count() } else { counts[a] + counts[b] };
        }
        let minis = first_below(tree, 0, |i| counts[i as usize] <= self.mini_tree_size);
        let area = |i: u32| f64::from(nodes[i as usize].bounds().area(tree.scale));
        let mean = minis.iter().map(|&i| area(i)).sum::<f64>() / minis.len() as f64;
        let threshold = f64::from(self.threshold) * mean;
        minis.iter().flat_map(|&mini| first_below(tree, mini, |i| area(i) <= threshold)).collect()
    }
}

/// The first nodes from `root` down, from left to right, that fulfil `end` or are leaves.
fn first_below(tree: &Tree, root: u32, end: impl Fn(u32) -> bool) -> Vec<u32> {
    let mut found = Vec::new();
    let mut stack = vec![root];
    while let Some(i) = stack.pop() {
        let node = &tree.nodes()[i as usize];
        if node.is_leaf() || end(i) {
            found.push(i);
        } else {
            stack.extend([node.first() + 1, node.first()]);
        }
    }
    found
}

/// What a node of the result is made from.
#[derive(Clone, Debug)]
enum Source {
    /// A node of the new top.
    Top(usize),
    /// Several roots that are one leaf of the new top: a range of its ids.
    Roots(Range<usize>),
    /// A node of the old tree.
    Below(u32),
}

struct Assembly<'a> {
    tree: &'a Tree,
    top: &'a Bvh,
    roots: &'a [u32],
}

impl Assembly<'_> {
    fn bounds(&self, source: &Source) -> Aabb {
        match source {
            Source::Top(i) => self.top.nodes[*i].aabb(),
            Source::Roots(range) => self.top.prim_ids[range.clone()]
                .iter()
                .map(|&id| self.bounds(&Source::Below(self.roots[id as usize])))
                .fold(Aabb::EMPTY, Aabb::union),
            Source::Below(i) => {
                let node = &self.tree.nodes()[*i as usize];
                Aabb::new(node.min.xyz(), node.max.xyz())
            }
        }
    }

    /// Both children, or the references of a leaf.
    fn open(&self, source: Source) -> Result<[Source; 2], Range<usize>> {
        match source {
            Source::Top(i) => {
                let node = &self.top.nodes[i];
                if node.is_leaf() {
                    return self.open(Source::Roots(node.prim_range()));
                }
                Ok(node.children().map(Source::Top))
            }
            Source::Roots(range) if range.len() == 1 => {
                let id = self.top.prim_ids[range.start];
                self.open(Source::Below(self.roots[id as usize]))
            }
            Source::Roots(range) => {
                let middle = range.start + range.len() / 2;
                Ok([Source::Roots(range.start..middle), Source::Roots(middle..range.end)])
            }
            Source::Below(i) => {
                let node = &self.tree.nodes()[i as usize];
                let first = node.first();
                if node.is_leaf() {
                    return Err(first as usize..first as usize + node.count() as usize);
                }
                Ok([Source::Below(first), Source::Below(first + 1)])
            }
        }
    }

    fn run(&self, source: &Bvh) -> Bvh {
        let mut nodes = Vec::with_capacity(source.nodes.len());
        let mut prim_ids = Vec::with_capacity(source.prim_ids.len());
        nodes.push(BvhNode::inner(source.bounds(), 0));
        let mut stack = vec![(Source::Top(0), 0_usize)];
        while let Some((from, place)) = stack.pop() {
            let bounds = nodes[place].aabb();
            match self.open(from) {
                Err(ids) => {
                    nodes[place] = BvhNode::leaf(bounds, to_u32(prim_ids.len()), to_u32(ids.len()));
                    prim_ids.extend_from_slice(&source.prim_ids[ids]);
                }
                Ok([left, right]) => {
                    let first = nodes.len();
                    nodes[place].first = to_u32(first);
                    nodes.push(BvhNode::inner(self.bounds(&left), 0));
                    nodes.push(BvhNode::inner(self.bounds(&right), 0));
                    stack.push((right, first + 1));
                    stack.push((left, first));
                }
            }
        }
        Bvh { nodes, prim_ids }
    }
}

impl<B: Builder> Optimizer for Prune<B> {
    fn name(&self) -> &str {
        "prune"
    }

    /// One iteration; changes are the roots below the new top.
    ///
    /// # Errors
    /// As [`Optimizer::optimize`], and [`OptimizeError::Build`] if the builder fails or splits.
    fn optimize(&self, bvh: &mut Bvh) -> Result<Report, OptimizeError> {
        self.check()?;
        improve(bvh, &self.constants, |source| {
            let Some(tree) = Tree::new(source)? else { return Ok(None) };
            let roots = self.roots(&tree);
            let bounds = |i: u32| {
                let node = &tree.nodes()[i as usize];
                Aabb::new(node.min.xyz(), node.max.xyz())
            };
            let refs: Vec<PrimRef> =
                roots.iter().zip(0..).map(|(&root, id)| PrimRef::new(bounds(root), id)).collect();
            let top = self.builder.build(&refs)?;
            let mut seen = vec![false; roots.len()];
            let once = |&id: &u32| !std::mem::replace(&mut seen[id as usize], true);
            if top.prim_ids.len() != roots.len() || !top.prim_ids.iter().all(once) {
                return Err(OptimizeError::Build(BuildError::BadSetting {
                    setting: "builder",
                    value: self.builder.name().into(),
                    remedy: "a builder that puts each primitive into one leaf",
                }));
            }
            let bvh = Assembly { tree: &tree, top: &top, roots: &roots }.run(source);
            Ok(Some(Outcome { iterations: 1, changes: roots.len() as u64, bvh: Some(bvh) }))
        })
    }

    fn memory_bound(&self, nodes: usize, references: usize) -> usize {
        // Counts; roots with their references; the assembly's stack.
        let own = 4 * nodes + (8 + 32 + 8) * references + 48 * nodes;
        let top = self.builder.memory_bound(references);
        rearrange_memory(nodes, references) + own + top
    }
}

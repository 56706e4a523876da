//! Moving one subtree to another place: the step of all insertion-based passes.

use crate::tree::{Bounds, NONE, Node, Tree};

/// Deeper targets are refused: the way up from one is walked to rule out cycles. Trees of builders
/// are some 100 deep at most, chains made by hand can be 1,000,000 deep.
pub(crate) const MAX_DEPTH: usize = 1024;

impl Tree {
    /// Takes `node` out, lets its sibling take the place of their parent, and inserts `node` as a
    /// sibling of `target`, as long as that lowers the sum of the areas of inner nodes; otherwise
    /// everything stays. Returns by how much the sum fell, more than 0, or `None` if the move is
    /// impossible or does not pay.
    pub(crate) fn try_move(&mut self, node: u32, target: u32) -> Option<f32> {
        let (sibling, parent) = (node ^ 1, self.parent(node));
        if node < 2 || target == node || target == sibling || target == parent || target == 1 {
            return None;
        }
        if self.is_within(target, node) {
            return None;
        }
        let gain = self.remove(node) + self.insert(node, target);
        if gain > 0.0 {
            return Some(gain);
        }
        // Back to where it was: the parent's slot holds what was the sibling.
        self.remove(node);
        self.insert(node, parent);
        None
    }

    /// Whether `node` is `ancestor` or below it; true as well if it is too deep to tell.
    pub(crate) fn is_within(&self, mut node: u32, ancestor: u32) -> bool {
        for _ in 0..MAX_DEPTH {
            if node == ancestor {
                return true;
            }
            if node == 0 {
                return false;
            }
            node = self.parent(node);
        }
        true
    }

    /// Takes `node` out; its pair stays reserved for [`Tree::insert`]. Returns by how much the
    /// sum of inner areas fell.
    pub(crate) fn remove(&mut self, node: u32) -> f32 {
        let parent = self.parent(node);
        let old = self.nodes()[parent as usize];
        let mut moved = self.nodes()[node as usize ^ 1];
        let mut gain = old.bounds().area(self.scale);
        if parent == 0 {
            // The root's box never changes, because what is below is the same in the end.
            if !moved.is_leaf() {
                gain = moved.bounds().area(self.scale);
            }
            moved.set_bounds(old.bounds());
        }
        self.put(parent, moved);
        gain + self.refit_from(self.parent(parent))
    }

    /// Makes `node`, which was taken out, the sibling of `target`.
    pub(crate) fn insert(&mut self, node: u32, target: u32) -> f32 {
        let pair = node & !1;
        let mut moved = self.nodes()[target as usize];
        let mut gain = 0.0;
        let mut inner = moved;
        inner.make_inner(pair);
        if target == 0 {
            let kept = if moved.is_leaf() {
                moved.bounds()
            } else {
                let tight = self.pair_bounds(moved.first());
                gain += moved.bounds().area(self.scale) - tight.area(self.scale);
                tight
            };
            moved.set_bounds(kept);
        } else {
            let whole = moved.bounds().union(self.nodes()[node as usize].bounds());
            inner.set_bounds(whole);
        }
        gain -= inner.bounds().area(self.scale);
        self.put(node ^ 1, moved);
        self.nodes_mut()[target as usize] = inner;
        self.parents[pair as usize / 2] = target;
        gain + self.refit_from(self.parent(target))
    }

    /// Writes a node and tells its children where it is.
    fn put(&mut self, place: u32, node: Node) {
        self.nodes_mut()[place as usize] = node;
        if !node.is_leaf() {
            self.parents[node.first() as usize / 2] = place;
        }
    }

    /// Makes boxes fit their children from `node` up to the first that already does, the root
    /// left out. Returns by how much the sum of areas fell.
    fn refit_from(&mut self, mut node: u32) -> f32 {
        let mut gain = 0.0;
        while node != NONE && node != 0 {
            let old = self.nodes()[node as usize].bounds();
            let new: Bounds = self.pair_bounds(self.nodes()[node as usize].first());
            if new.same(old) {
                break;
            }
            gain += old.area(self.scale) - new.area(self.scale);
            self.nodes_mut()[node as usize].set_bounds(new);
            node = self.parent(node);
        }
        gain
    }
}

//! Wide trees from nodes that were laid out before.

use crate::{Child, WideBvh, WideNode};
use niwaki_core::Aabb;

/// Why nodes and references are no wide tree. Nodes are named by index.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PartsError {
    /// A node has no child, or more than fit. Remedy: 1 to the width of the tree.
    #[error("node {node} uses {used} slots")]
    Slots {
        /// The node.
        node: usize,
        /// How many it says.
        used: u32,
    },
    /// A used slot's box is inverted or not finite. Remedy: give every child its bounds.
    #[error("slot {slot} of node {node} has a box that is not finite or inverted")]
    Box {
        /// The node.
        node: usize,
        /// The slot.
        slot: usize,
    },
    /// A slot past the used ones is not as [`WideNode`] wants it: an empty box, and the word of a
    /// leaf that exists.
    #[error("slot {slot} of node {node} is unused but not empty")]
    Unused {
        /// The node.
        node: usize,
        /// The slot.
        slot: usize,
    },
    /// A child is not the next node, level by level. Remedy: number nodes in the order in which
    /// slots name them.
    #[error("slot {slot} of node {node} leads to node {child}, not to {expected}")]
    Order {
        /// The parent.
        node: usize,
        /// The slot.
        slot: usize,
        /// What it names.
        child: u32,
        /// What is next.
        expected: usize,
    },
    /// A leaf's references are not the next ones, or the node counts them wrongly. Remedy: store
    /// references in the order of the leaves.
    #[error("the references of node {node} do not follow those before it")]
    References {
        /// The node.
        node: usize,
    },
    /// There are nodes or references that nothing names, or names without them.
    #[error(
        "slots name {named_nodes} nodes and {named_references} references, \
         but there are {nodes} and {references}"
    )]
    Count {
        /// Nodes that slots lead to, the root included.
        named_nodes: usize,
        /// References in leaves.
        named_references: usize,
        /// Nodes given.
        nodes: usize,
        /// References given.
        references: usize,
    },
    /// The box around everything is not finite, or does not enclose the root's children.
    #[error("the bounds of the tree do not enclose its root")]
    Bounds,
}

impl<const W: usize> WideBvh<W> {
    /// A tree of nodes and references as [`WideBvh::nodes`], [`WideBvh::prim_ids`] and
    /// [`WideBvh::bounds`] gave them, perhaps long ago. Checks all that a collapse guarantees, in
    /// time linear in both and without memory of its own.
    ///
    /// # Errors
    /// [`PartsError`] names the first fault.
    pub fn from_parts(
        nodes: Vec<WideNode<W>>,
        prim_ids: Vec<u32>,
        bounds: Aabb,
    ) -> Result<Self, PartsError> {
        if nodes.is_empty() && prim_ids.is_empty() {
            return if bounds == Aabb::EMPTY {
                Ok(Self::default())
            } else {
                Err(PartsError::Bounds)
            };
        }
        let mut next_node = 1;
        let mut next_prim = 0;
        let (mut levels, mut level_end) = (0, 0);
        for (i, node) in nodes.iter().enumerate() {
            if i >= next_node {
                // Nothing leads here, unless from itself.
                break;
            }
            if i == level_end {
                levels += 1;
                level_end = next_node;
            }
            if node.used == 0 || node.used as usize > W {
                return Err(PartsError::Slots { node: i, used: node.used });
            }
            let first_prim = next_prim;
            for slot in 0..W {
                let bounds = node.aabb(slot);
                let Some(child) = node.child(slot) else {
                    let empty = WideNode::<W>::empty(0);
                    if bounds != Aabb::EMPTY || node.children[slot] != empty.children[slot] {
                        return Err(PartsError::Unused { node: i, slot });
                    }
                    continue;
                };
                if !bounds.is_finite() || bounds.is_empty() {
                    return Err(PartsError::Box { node: i, slot });
                }
                match child {
                    Child::Node(child) if child as usize == next_node => next_node += 1,
                    Child::Node(child) => {
                        return Err(PartsError::Order {
                            node: i,
                            slot,
                            child,
                            expected: next_node,
                        });
                    }
                    Child::Leaf { first, count } => {
                        if first as usize != next_prim {
                            return Err(PartsError::References { node: i });
                        }
                        next_prim += count as usize;
                    }
                }
            }
            if node.first_prim as usize != first_prim
                || node.prim_count as usize != next_prim - first_prim
            {
                return Err(PartsError::References { node: i });
            }
        }
        if next_node != nodes.len() || next_prim != prim_ids.len() {
            return Err(PartsError::Count {
                named_nodes: next_node,
                named_references: next_prim,
                nodes: nodes.len(),
                references: prim_ids.len(),
            });
        }
        let root = &nodes[0];
        let encloses = (0..root.used as usize).all(|slot| bounds.contains(&root.aabb(slot)));
        if !bounds.is_finite() || !encloses {
            return Err(PartsError::Bounds);
        }
        Ok(Self { nodes, prim_ids, bounds: Some(bounds), levels })
    }
}

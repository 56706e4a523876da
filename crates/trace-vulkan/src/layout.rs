//! Trees as the kernels read them.

use bytemuck::{Pod, Zeroable};
use niwaki_core::{
    Bvh, BvhNode,
    glam::{BVec3, Vec3},
    to_u32,
};
use niwaki_wide::{Bvh8, Child, QuantisedNode, WideNode};
use rayon::prelude::*;

/// Nodes that wait at most in the kernel of binary trees, `STACK` of `trace_binary.wgsl`.
const BINARY_STACK: usize = 64;

/// Groups that wait at most in the kernel of wide trees, `STACK` of `trace_wide.wgsl`.
const WIDE_STACK: usize = 32;

/// Nodes that a task packs at least.
const CHUNK: usize = 512;

/// A tree on its way to the device.
pub(crate) struct Packed<N> {
    pub(crate) nodes: Vec<N>,
    /// Of each node; with the slot in the parent in the lowest three bits for wide trees.
    pub(crate) parents: Vec<u32>,
    /// Paths may be longer than the stack of the kernel.
    pub(crate) is_deep: bool,
}

/// The nodes of a binary tree that was checked, multiplied by `factor`.
pub(crate) fn pack_binary(bvh: &Bvh, factor: f32) -> Packed<BvhNode> {
    let scaled = |n: &BvhNode| BvhNode { min: n.min * factor, max: n.max * factor, ..*n };
    let nodes = bvh.nodes.par_iter().with_min_len(CHUNK).map(scaled).collect();
    let mut parents = vec![0; bvh.nodes.len()];
    let mut depths = vec![0_u32; bvh.nodes.len()];
    let mut deepest = 0;
    for (i, node) in bvh.nodes.iter().enumerate() {
        if !node.is_leaf() {
            for child in node.children() {
                parents[child] = to_u32(i);
                depths[child] = depths[i] + 1;
                deepest = deepest.max(depths[child]);
            }
        }
    }
    Packed { nodes, parents, is_deep: deepest as usize > BINARY_STACK }
}

/// A node of 96 bytes with up to eight children, `Node8` of `boxes.wgsl`: three sectors of a GPU's
/// memory, which is what a node of 80 bytes (Ylitie, Karras and Laine 2017) touches on average too.
///
/// Like theirs, it stores a first child and a first reference instead of eight words, and its slots
/// are arranged so that their order, seen from a ray's octant, is nearly that of the distance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Node8 {
    origin: [f32; 3],
    /// Bits 0 to 7 for inner children, 8 to 15 for used slots.
    masks: u32,
    step: [f32; 3],
    first_node: u32,
    first_reference: u32,
    /// Three bits a slot: references less one.
    counts: u32,
    /// A byte a slot: where the leaf begins, from `first_reference` on.
    offsets: [u8; 8],
    planes: [[u8; 8]; 6],
}

const _: () = assert!(size_of::<Node8>() == 96);

/// The nodes of a wide tree, multiplied by `factor`.
pub(crate) fn pack_wide(bvh: &Bvh8, factor: f32) -> Packed<Node8> {
    let nodes = bvh.nodes();
    let slots: Vec<[u8; 8]> = nodes.par_iter().with_min_len(CHUNK).map(arranged).collect();
    // Siblings stay together, so numbers change within a group only. Parents come first.
    let mut places: Vec<u32> = (0..to_u32(nodes.len())).collect();
    let mut parents = vec![0; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        let Some(first) = first_node(node) else { continue };
        let inner = inner_slots(node, &slots[i]);
        for (slot, child) in children(node) {
            if let Child::Node(child) = child {
                let new_slot = slots[i][slot];
                let below = inner & ((1 << new_slot) - 1);
                let place = first + below.count_ones();
                places[child as usize] = place;
                parents[place as usize] = places[i] << 3 | u32::from(new_slot);
            }
        }
    }
    let packed: Vec<Node8> = nodes
        .par_iter()
        .with_min_len(CHUNK)
        .zip(&slots)
        .map(|(node, slots)| pack(node, slots, factor))
        .collect();
    let mut arranged = vec![Node8::default(); packed.len()];
    for (node, &place) in packed.iter().zip(&places) {
        arranged[place as usize] = *node;
    }
    Packed { nodes: arranged, parents, is_deep: bvh.levels() > WIDE_STACK }
}

/// The used slots and what they lead to.
fn children(node: &WideNode<8>) -> impl Iterator<Item = (usize, Child)> {
    (0..8).filter_map(|slot| Some((slot, node.child(slot)?)))
}

/// The first inner child: in a breadth-first tree the others follow.
fn first_node(node: &WideNode<8>) -> Option<u32> {
    children(node).find_map(|(_, child)| match child {
        Child::Node(index) => Some(index),
        Child::Leaf { .. } => None,
    })
}

/// The new slots of inner children, one bit each.
fn inner_slots(node: &WideNode<8>, slots: &[u8; 8]) -> u32 {
    let inner = children(node).filter(|(_, child)| matches!(child, Child::Node(_)));
    inner.fold(0, |mask, (slot, _)| mask | 1 << slots[slot])
}

/// The new slot of each slot: bit i of it says that a child lies on the upper side of axis i. Pairs
/// of child and corner are chosen greedily, the clearest first (Ylitie, Karras and Laine 2017,
/// section 3.3, by an auction).
fn arranged(node: &WideNode<8>) -> [u8; 8] {
    let centroids: Vec<Vec3> = (0..8)
        .filter(|&slot| slot < node.used as usize)
        .map(|slot| {
            let bounds = node.aabb(slot);
            // Halves first: the sum of two large coordinates may be none.
            bounds.min * 0.5 + bounds.max * 0.5
        })
        .collect();
    let used = centroids.len();
    let middle = centroids.iter().fold(Vec3::ZERO, |sum, &c| sum + c / used.max(1) as f32);
    let corners: [Vec3; 8] = std::array::from_fn(|corner| {
        let upper = BVec3::new(corner & 1 != 0, corner & 2 != 0, corner & 4 != 0);
        Vec3::select(upper, Vec3::ONE, Vec3::NEG_ONE)
    });
    let mut slots: [u8; 8] = std::array::from_fn(|_| u8::MAX);
    let mut is_taken = [false; 8];
    for _ in 0..used {
        let mut best: Option<(usize, usize, f32)> = None;
        for (child, &centroid) in centroids.iter().enumerate() {
            if slots[child] != u8::MAX {
                continue;
            }
            for (corner, &direction) in corners.iter().enumerate() {
                let gain = (centroid - middle).dot(direction);
                if !is_taken[corner] && best.is_none_or(|(_, _, most)| gain > most) {
                    best = Some((child, corner, gain));
                }
            }
        }
        let Some((child, corner, _)) = best else { break };
        #[expect(clippy::cast_possible_truncation, reason = "below 8")]
        let slot = corner as u8;
        slots[child] = slot;
        is_taken[corner] = true;
    }
    // What is unused gets the rest.
    let mut rest = (0..8_u8).filter(|&slot| !is_taken[slot as usize]);
    for slot in slots.iter_mut().filter(|slot| **slot == u8::MAX) {
        *slot = rest.next().unwrap_or_default();
    }
    slots
}

fn pack(node: &WideNode<8>, slots: &[u8; 8], factor: f32) -> Node8 {
    let mut scaled = *node;
    for plane in scaled.bounds.as_flattened_mut() {
        *plane *= factor;
    }
    let quantised = QuantisedNode::from(&scaled);
    let mut packed = Node8 {
        origin: quantised.origin,
        step: quantised.scale,
        first_node: first_node(node).unwrap_or_default(),
        first_reference: node.first_prim,
        masks: inner_slots(node, slots),
        ..Node8::default()
    };
    for (slot, child) in children(node) {
        let to = slots[slot] as usize;
        packed.masks |= 1 << (8 + to);
        for (row, planes) in packed.planes.iter_mut().zip(&quantised.planes) {
            row[to] = planes[slot];
        }
        if let Child::Leaf { first, count } = child {
            packed.counts |= (count - 1) << (3 * to);
            #[expect(clippy::cast_possible_truncation, reason = "eight leaves of eight at most")]
            let offset = (first - node.first_prim) as u8;
            packed.offsets[to] = offset;
        }
    }
    packed
}

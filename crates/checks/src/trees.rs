//! Equality of trees to the last bit.

use niwaki_core::{Bvh, BvhNode};
use niwaki_wide::{WideBvh, WideNode};

/// Equality of bytes: unlike `==`, −0.0 and 0.0 differ and a NaN equals itself.
#[must_use]
pub fn same_bytes(a: &Bvh, b: &Bvh) -> bool {
    a.prim_ids == b.prim_ids
        && a.nodes.len() == b.nodes.len()
        && a.nodes.iter().zip(&b.nodes).all(|(a, b)| {
            let bits = |n: &BvhNode| {
                (
                    n.min.to_array().map(f32::to_bits),
                    n.max.to_array().map(f32::to_bits),
                    n.first,
                    n.count,
                )
            };
            bits(a) == bits(b)
        })
}

/// As [`same_bytes`], for wide trees.
#[must_use]
pub fn same_wide<const W: usize>(a: &WideBvh<W>, b: &WideBvh<W>) -> bool {
    a == b
        && a.nodes().iter().zip(b.nodes()).all(|(a, b)| {
            let bits = |n: &WideNode<W>| n.bounds.map(|row| row.map(f32::to_bits));
            bits(a) == bits(b)
        })
}

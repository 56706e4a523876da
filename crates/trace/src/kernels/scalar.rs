//! The scalar twin of the SIMD kernels: same layout, same arithmetic, safe code.

use crate::{
    counts::Counter,
    mode::Mode,
    query::visitor::{Found, Visitor},
    setup::{RaySetup, Slabs},
    triangle::{Fast, TriangleTest, no_hit},
    watertight::Sheared,
    wide::{Layout, WORDS},
};
use niwaki_core::glam::Vec3;
use niwaki_wide::{Child, WideNode};

/// Shows hits to a visitor, nearest boxes first, or until it sets a limit if `ANY`. The scene must
/// have nodes.
pub(crate) fn trace<const W: usize, const ANY: bool, V: Visitor, C: Counter>(
    scene: &Layout<W>,
    setup: &RaySetup,
    visitor: V,
    counter: &mut C,
) -> V::Answer {
    match scene.mode {
        Mode::Fast => dispatch::<W, ANY, Fast, V, C>(scene, setup, visitor, counter),
        Mode::Watertight => dispatch::<W, ANY, Sheared, V, C>(scene, setup, visitor, counter),
    }
}

fn dispatch<const W: usize, const ANY: bool, T: TriangleTest, V: Visitor, C: Counter>(
    scene: &Layout<W>,
    setup: &RaySetup,
    visitor: V,
    counter: &mut C,
) -> V::Answer {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("fma") {
        // SAFETY: the processor has the instructions, as just checked.
        return unsafe { traverse_fma::<W, ANY, T, V, C>(scene, setup, visitor, counter) };
    }
    traverse::<W, ANY, T, V, C>(scene, setup, visitor, counter)
}

/// The same code with hardware multiply-adds, whose results are the same by definition.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "fma")]
fn traverse_fma<const W: usize, const ANY: bool, T: TriangleTest, V: Visitor, C: Counter>(
    scene: &Layout<W>,
    setup: &RaySetup,
    visitor: V,
    counter: &mut C,
) -> V::Answer {
    traverse::<W, ANY, T, V, C>(scene, setup, visitor, counter)
}

#[inline(always)]
fn traverse<const W: usize, const ANY: bool, T: TriangleTest, V: Visitor, C: Counter>(
    scene: &Layout<W>,
    setup: &RaySetup,
    mut visitor: V,
    counter: &mut C,
) -> V::Answer {
    let slabs = T::slabs(setup, &scene.scale);
    let test = T::new(setup);
    let mut limit = setup.t_max;
    let mut stack = Vec::with_capacity(scene.stack_bound.min(64));
    stack.push((Child::Node(0), setup.t_min));
    while let Some((child, t)) = stack.pop() {
        if t > limit {
            continue;
        }
        match child {
            Child::Leaf { first, count } => {
                counter.leaf(count);
                let (first, count) = (first as usize, count as usize);
                let t_min = setup.t_min;
                let found = (&mut visitor, &mut limit);
                if visit_leaf::<W, ANY, T, V>(scene, first, count, &test, t_min, found) {
                    return visitor.answer();
                }
            }
            Child::Node(index) => {
                let node = &scene.nodes[index as usize];
                counter.node(node.used);
                let base = stack.len();
                for slot in 0..W {
                    if let Some(entry) = entry(node, slot, &slabs, setup.t_min, limit) {
                        stack.push((Child::from_word::<W>(node.children[slot]), entry));
                    }
                }
                // Nearest last, to be popped first.
                stack[base..].sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
            }
        }
    }
    visitor.answer()
}

/// Where the ray enters a slot's box, if it does between `t_min` and `t_max`.
#[inline(always)]
fn entry<const W: usize>(
    node: &WideNode<W>,
    slot: usize,
    slabs: &Slabs,
    t_min: f32,
    t_max: f32,
) -> Option<f32> {
    let mut near = t_min;
    let mut far = t_max;
    for axis in 0..3 {
        let inverse = slabs.inverse[axis];
        let negative = usize::from(inverse.is_sign_negative());
        let first = node.bounds[2 * axis + negative][slot];
        let last = node.bounds[2 * axis + 1 - negative][slot];
        near = near.max(first.mul_add(inverse, slabs.near_offset[axis]));
        far = far.min(last.mul_add(inverse, slabs.far_offset[axis]));
    }
    (near <= far).then_some(near)
}

/// True if the traversal is to end.
#[inline(always)]
fn visit_leaf<const W: usize, const ANY: bool, T: TriangleTest, V: Visitor>(
    scene: &Layout<W>,
    first: usize,
    n: usize,
    test: &T,
    t_min: f32,
    (visitor, limit): (&mut V, &mut f32),
) -> bool {
    let rows = &scene.triangles[WORDS * first..WORDS * (first + n)];
    for i in 0..n {
        let vec = |row: usize| {
            Vec3::new(rows[row * n + i], rows[(row + 1) * n + i], rows[(row + 2) * n + i])
        };
        let mut hit = no_hit(*limit);
        let id = scene.prim_ids[first + i];
        test.intersect([vec(0), vec(3), vec(6)], id, t_min, &mut hit);
        if hit.is_hit() && visitor.wants(hit.t, id) {
            let found = Found { t: hit.t, u: hit.u, v: hit.v, det: 1.0, prim_id: id };
            if let Some(t) = visitor.take(found) {
                *limit = t;
                if ANY {
                    return true;
                }
            }
        }
    }
    false
}

//! The scalar twin of the SIMD kernels: same layout, same arithmetic, safe code.

use crate::{
    counts::Counter,
    mode::Mode,
    setup::{RaySetup, Slabs},
    triangle::{Fast, TriangleTest, no_hit, settle},
    watertight::Sheared,
    wide::{Layout, WORDS},
};
use niwaki_core::{Hit, glam::Vec3};
use niwaki_wide::{Child, WideNode};

/// The closest hit in scaled distance, or any if `ANY`. The scene must have nodes.
pub(crate) fn trace<const W: usize, const ANY: bool, C: Counter>(
    scene: &Layout<W>,
    setup: &RaySetup,
    counter: &mut C,
) -> Hit {
    match scene.mode {
        Mode::Fast => dispatch::<W, ANY, Fast, C>(scene, setup, counter),
        Mode::Watertight => dispatch::<W, ANY, Sheared, C>(scene, setup, counter),
    }
}

fn dispatch<const W: usize, const ANY: bool, T: TriangleTest, C: Counter>(
    scene: &Layout<W>,
    setup: &RaySetup,
    counter: &mut C,
) -> Hit {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("fma") {
        // SAFETY: the processor has the instructions, as just checked.
        return unsafe { traverse_fma::<W, ANY, T, C>(scene, setup, counter) };
    }
    traverse::<W, ANY, T, C>(scene, setup, counter)
}

/// The same code with hardware multiply-adds, whose results are the same by definition.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "fma")]
fn traverse_fma<const W: usize, const ANY: bool, T: TriangleTest, C: Counter>(
    scene: &Layout<W>,
    setup: &RaySetup,
    counter: &mut C,
) -> Hit {
    traverse::<W, ANY, T, C>(scene, setup, counter)
}

#[inline(always)]
fn traverse<const W: usize, const ANY: bool, T: TriangleTest, C: Counter>(
    scene: &Layout<W>,
    setup: &RaySetup,
    counter: &mut C,
) -> Hit {
    let slabs = T::slabs(setup, &scene.scale);
    let test = T::new(setup);
    let mut hit = no_hit(setup.t_max);
    let mut stack = Vec::with_capacity(scene.stack_bound.min(64));
    stack.push((Child::Node(0), setup.t_min));
    while let Some((child, t)) = stack.pop() {
        if t > hit.t {
            continue;
        }
        match child {
            Child::Leaf { first, count } => {
                counter.leaf(count);
                intersect_leaf(scene, first as usize, count as usize, &test, setup.t_min, &mut hit);
                if ANY && hit.is_hit() {
                    return hit;
                }
            }
            Child::Node(index) => {
                let node = &scene.nodes[index as usize];
                counter.node(node.used);
                let base = stack.len();
                for slot in 0..W {
                    if let Some(entry) = entry(node, slot, &slabs, setup.t_min, hit.t) {
                        stack.push((Child::from_word::<W>(node.children[slot]), entry));
                    }
                }
                // Nearest last, to be popped first.
                stack[base..].sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
            }
        }
    }
    settle(hit)
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

#[inline(always)]
fn intersect_leaf<const W: usize, T: TriangleTest>(
    scene: &Layout<W>,
    first: usize,
    n: usize,
    test: &T,
    t_min: f32,
    hit: &mut Hit,
) {
    let rows = &scene.triangles[WORDS * first..WORDS * (first + n)];
    for i in 0..n {
        let vec = |row: usize| {
            Vec3::new(rows[row * n + i], rows[(row + 1) * n + i], rows[(row + 2) * n + i])
        };
        let id = scene.prim_ids[first + i];
        test.intersect([vec(0), vec(3), vec(6)], id, t_min, hit);
    }
}

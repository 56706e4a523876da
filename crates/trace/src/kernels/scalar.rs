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
use niwaki_wide::{Child, QuantisedNode, WideNode};

/// Shows hits to a visitor, nearest boxes first, or until it sets a limit if `ANY`. The scene must
/// have nodes.
pub(crate) fn trace<const W: usize, const ANY: bool, N: Boxes<W>, V: Visitor, C: Counter>(
    scene: &Layout<W, N>,
    setup: &RaySetup,
    visitor: V,
    counter: &mut C,
) -> V::Answer {
    match scene.mode {
        Mode::Fast => dispatch::<W, ANY, N, Fast, V, C>(scene, setup, visitor, counter),
        Mode::Watertight => dispatch::<W, ANY, N, Sheared, V, C>(scene, setup, visitor, counter),
    }
}

fn dispatch<
    const W: usize,
    const ANY: bool,
    N: Boxes<W>,
    T: TriangleTest,
    V: Visitor,
    C: Counter,
>(
    scene: &Layout<W, N>,
    setup: &RaySetup,
    visitor: V,
    counter: &mut C,
) -> V::Answer {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("fma") {
        // SAFETY: the processor has the instructions, as just checked.
        return unsafe { traverse_fma::<W, ANY, N, T, V, C>(scene, setup, visitor, counter) };
    }
    traverse::<W, ANY, N, T, V, C>(scene, setup, visitor, counter)
}

/// The same code with hardware multiply-adds, whose results are the same by definition.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "fma")]
fn traverse_fma<
    const W: usize,
    const ANY: bool,
    N: Boxes<W>,
    T: TriangleTest,
    V: Visitor,
    C: Counter,
>(
    scene: &Layout<W, N>,
    setup: &RaySetup,
    visitor: V,
    counter: &mut C,
) -> V::Answer {
    traverse::<W, ANY, N, T, V, C>(scene, setup, visitor, counter)
}

#[inline(always)]
fn traverse<
    const W: usize,
    const ANY: bool,
    N: Boxes<W>,
    T: TriangleTest,
    V: Visitor,
    C: Counter,
>(
    scene: &Layout<W, N>,
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
                counter.at_leaf(first);
                counter.leaf(count);
                if V::COUNTS {
                    visitor.leaf(first, count);
                }
                let (first, count) = (first as usize, count as usize);
                let t_min = setup.t_min;
                let found = (&mut visitor, &mut limit);
                if visit_leaf::<W, ANY, N, T, V>(scene, first, count, &test, t_min, found) {
                    return visitor.answer();
                }
            }
            Child::Node(index) => {
                let node = &scene.nodes[index as usize];
                counter.at(u64::from(index));
                counter.node(node.used());
                if V::COUNTS {
                    visitor.node(index, node.used());
                }
                let base = stack.len();
                node.entries(&slabs, setup.t_min, limit, |slot, entry| {
                    stack.push((Child::from_word::<W>(node.children()[slot]), entry));
                });
                // Nearest last, to be popped first.
                stack[base..].sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
            }
        }
    }
    visitor.answer()
}

/// How many boxes a node of either kind has.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(crate) fn used_boxes<const W: usize, N: Boxes<W>>(node: &N) -> u32 {
    node.used()
}

/// The boxes of a node of either kind.
pub(crate) trait Boxes<const W: usize> {
    /// How many slots are used.
    fn used(&self) -> u32;

    /// The words of the children.
    fn children(&self) -> &[u32; W];

    /// Tells the slots whose boxes the ray meets between `t_min` and `t_max`, and where it enters
    /// them.
    fn entries(&self, slabs: &Slabs, t_min: f32, t_max: f32, meet: impl FnMut(usize, f32));
}

impl<const W: usize> Boxes<W> for WideNode<W> {
    #[inline(always)]
    fn used(&self) -> u32 {
        self.used
    }

    #[inline(always)]
    fn children(&self) -> &[u32; W] {
        &self.children
    }

    #[inline(always)]
    fn entries(&self, slabs: &Slabs, t_min: f32, t_max: f32, mut meet: impl FnMut(usize, f32)) {
        for slot in 0..W {
            let mut near = t_min;
            let mut far = t_max;
            for axis in 0..3 {
                let inverse = slabs.inverse[axis];
                let negative = usize::from(inverse.is_sign_negative());
                let first = self.bounds[2 * axis + negative][slot];
                let last = self.bounds[2 * axis + 1 - negative][slot];
                near = near.max(first.mul_add(inverse, slabs.near_offset[axis]));
                far = far.min(last.mul_add(inverse, slabs.far_offset[axis]));
            }
            if near <= far {
                meet(slot, near);
            }
        }
    }
}

impl<const W: usize> Boxes<W> for QuantisedNode<W> {
    #[inline(always)]
    fn used(&self) -> u32 {
        self.used()
    }

    #[inline(always)]
    fn children(&self) -> &[u32; W] {
        &self.children
    }

    /// The grid is folded into the ray: a plane q is crossed at q·(scale·r) + (origin·r + offset).
    #[inline(always)]
    fn entries(&self, slabs: &Slabs, t_min: f32, t_max: f32, mut meet: impl FnMut(usize, f32)) {
        let axes = [0, 1, 2].map(|axis| {
            let inverse = slabs.inverse[axis];
            let step = self.scale[axis] * inverse;
            let near = self.origin[axis].mul_add(inverse, slabs.near_offset[axis]);
            let far = self.origin[axis].mul_add(inverse, slabs.far_offset[axis]);
            (usize::from(inverse.is_sign_negative()), step, near, far)
        });
        for slot in 0..self.used() as usize {
            let mut near = t_min;
            let mut far = t_max;
            for (axis, &(negative, step, near_offset, far_offset)) in axes.iter().enumerate() {
                let first = self.planes[2 * axis + negative][slot];
                let last = self.planes[2 * axis + 1 - negative][slot];
                near = near.max(f32::from(first).mul_add(step, near_offset));
                far = far.min(f32::from(last).mul_add(step, far_offset));
            }
            if near <= far {
                meet(slot, near);
            }
        }
    }
}

/// True if the traversal is to end.
#[inline(always)]
fn visit_leaf<const W: usize, const ANY: bool, N, T: TriangleTest, V: Visitor>(
    scene: &Layout<W, N>,
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
                if ANY || V::ENDS_AT_LIMIT {
                    return true;
                }
            }
        }
    }
    false
}

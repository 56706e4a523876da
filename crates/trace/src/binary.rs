//! The scalar reference kernel over the binary tree.

use crate::{
    Counts, HitQueries, Mode, SceneError, Walk,
    counts::Counter,
    prepare::scaled_words,
    query::{
        hits::Traverse,
        visitor::{Closest, First, Found, Visitor},
    },
    scale::SceneScale,
    setup::RaySetup,
    triangle::{Fast, TriangleTest, no_hit},
    watertight::Sheared,
};
use niwaki_core::{
    Bvh, BvhNode, Hit, Intersector, Ray, TriangleMesh, float::ROBUST_SLAB, glam::Vec3,
};
use niwaki_wide::CollapseError;
use rayon::prelude::*;

/// A binary tree with its triangles, traced by plain scalar code: the reference for every other
/// kernel, and the one whose [`Counts`] match the binary tree's expected costs.
///
/// Owns a copy of all that it needs.
#[derive(Clone, Debug)]
pub struct BinaryScene {
    nodes: Vec<BvhNode>,
    prim_ids: Vec<u32>,
    /// One a reference, in leaf order.
    triangles: Vec<[Vec3; 3]>,
    mode: Mode,
    scale: SceneScale,
}

impl BinaryScene {
    /// Lays a tree and its triangles out for tracing, on the current rayon pool.
    ///
    /// # Errors
    /// [`SceneError::NoSuchTriangle`] if the tree is not of this mesh, or
    /// [`CollapseError::Malformed`] if it is not a tree.
    pub fn new(bvh: &Bvh, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        Self::new_in(Mode::default(), bvh, mesh)
    }

    /// [`BinaryScene::new`] in another mode than [`Mode::Watertight`], the default.
    ///
    /// # Errors
    /// As [`BinaryScene::new`].
    pub fn new_in(mode: Mode, bvh: &Bvh, mesh: &TriangleMesh) -> Result<Self, SceneError> {
        check_tree(bvh)?;
        check_ids(&bvh.prim_ids, mesh)?;
        let scale = SceneScale::of(&bvh.bounds());
        let nodes = bvh.nodes.par_iter().with_min_len(4096).map(|node| {
            let bounds = scale.aabb(node.aabb());
            BvhNode { min: bounds.min, max: bounds.max, ..*node }
        });
        let triangles = scaled_words(mode, scale, &bvh.prim_ids, mesh);
        Ok(Self { nodes: nodes.collect(), prim_ids: bvh.prim_ids.clone(), triangles, mode, scale })
    }

    /// Bytes that nodes, ids and triangles take.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        size_of::<BvhNode>() * self.nodes.len()
            + size_of::<u32>() * self.prim_ids.len()
            + size_of::<[Vec3; 3]>() * self.triangles.len()
    }

    /// [`Intersector::closest_hit`] with the work it took.
    #[must_use]
    pub fn closest_hit_counted(&self, ray: &Ray) -> (Hit, Counts) {
        let mut counts = Counts::default();
        (self.closest(ray, &mut counts), counts)
    }

    /// [`Intersector::closest_hit`] with the work it took and where it ended.
    #[must_use]
    pub fn closest_hit_walked(&self, ray: &Ray) -> (Hit, Walk) {
        let mut walk = Walk::default();
        (self.closest(ray, &mut walk), walk)
    }

    /// [`Intersector::any_hit`] with the work it took.
    #[must_use]
    pub fn any_hit_counted(&self, ray: &Ray) -> (bool, Counts) {
        let mut counts = Counts::default();
        (self.any(ray, &mut counts), counts)
    }

    fn closest<C: Counter>(&self, ray: &Ray, counter: &mut C) -> Hit {
        let Some(setup) = RaySetup::new(ray, self.scale) else { return Hit::MISS };
        let closest = Closest::new(setup.t_max);
        setup.finish(self.show::<false, _, _>(&setup, closest, counter))
    }

    fn any<C: Counter>(&self, ray: &Ray, counter: &mut C) -> bool {
        let Some(setup) = RaySetup::new(ray, self.scale) else { return false };
        self.show::<true, _, _>(&setup, First::default(), counter)
    }

    /// [`trace`] in the mode of the scene.
    #[inline]
    fn show<const ANY: bool, V: Visitor, C: Counter>(
        &self,
        setup: &RaySetup,
        visitor: V,
        counter: &mut C,
    ) -> V::Answer {
        match self.mode {
            Mode::Fast => {
                let leaves = Tested { scene: self, test: Fast::new(setup) };
                trace::<ANY, _, _, _>(&self.nodes, &leaves, setup, visitor, counter)
            }
            Mode::Watertight => {
                let leaves = Tested { scene: self, test: <Sheared as TriangleTest>::new(setup) };
                trace::<ANY, _, _, _>(&self.nodes, &leaves, setup, visitor, counter)
            }
        }
    }
}

impl Intersector for BinaryScene {
    fn closest_hit(&self, ray: &Ray) -> Hit {
        self.closest(ray, &mut ())
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        self.any(ray, &mut ())
    }
}

/// The triangles as a test prepared for one ray meets them.
struct Tested<'a, T> {
    scene: &'a BinaryScene,
    test: T,
}

impl<T: TriangleTest> Leaves for Tested<'_, T> {
    #[inline(always)]
    fn intersect(&self, reference: usize, setup: &RaySetup, limit: f32) -> Hit {
        let mut hit = no_hit(limit);
        let (triangle, id) = (self.scene.triangles[reference], self.scene.prim_ids[reference]);
        self.test.intersect(triangle, id, setup.t_min, &mut hit);
        hit
    }

    #[inline(always)]
    fn pads(&self, setup: &RaySetup) -> [f32; 2] {
        T::pads(setup, &self.scene.scale)
    }
}

impl Traverse for BinaryScene {
    fn visit<V: Visitor>(
        &self,
        ray: &Ray,
        visitor: impl FnOnce(RaySetup) -> V,
    ) -> Option<V::Answer> {
        let setup = RaySetup::new(ray, self.scale)?;
        Some(self.show::<false, _, _>(&setup, visitor(setup), &mut ()))
    }

    fn visit_until_limit<V: Visitor>(
        &self,
        ray: &Ray,
        visitor: impl FnOnce(RaySetup) -> V,
    ) -> Option<V::Answer> {
        let setup = RaySetup::new(ray, self.scale)?;
        Some(self.show::<true, _, _>(&setup, visitor(setup), &mut ()))
    }
}

impl HitQueries for BinaryScene {}

/// What the leaves of a binary tree refer to.
pub(crate) trait Leaves {
    /// The hit of a reference at `limit` or before, in scaled distance; anything that is no hit
    /// otherwise.
    fn intersect(&self, reference: usize, setup: &RaySetup, limit: f32) -> Hit;

    /// How much larger boxes must be where the ray enters and where it leaves
    /// ([`TriangleTest::pads`]).
    #[inline(always)]
    fn pads(&self, _: &RaySetup) -> [f32; 2] {
        [0.0; 2]
    }
}

/// Shows hits to a visitor, nearest boxes first, or until it sets a limit if `ANY`. The tree must
/// have passed [`check_tree`].
#[inline]
pub(crate) fn trace<const ANY: bool, L: Leaves, V: Visitor, C: Counter>(
    nodes: &[BvhNode],
    leaves: &L,
    setup: &RaySetup,
    visitor: V,
    counter: &mut C,
) -> V::Answer {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("fma") {
        // SAFETY: the processor has the instructions, as just checked.
        return unsafe { traverse_fma::<ANY, L, V, C>(nodes, leaves, setup, visitor, counter) };
    }
    traverse::<ANY, L, V, C>(nodes, leaves, setup, visitor, counter)
}

/// The same code with hardware multiply-adds, whose results are the same by definition.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "fma")]
fn traverse_fma<const ANY: bool, L: Leaves, V: Visitor, C: Counter>(
    nodes: &[BvhNode],
    leaves: &L,
    setup: &RaySetup,
    visitor: V,
    counter: &mut C,
) -> V::Answer {
    traverse::<ANY, L, V, C>(nodes, leaves, setup, visitor, counter)
}

#[inline(always)]
fn traverse<const ANY: bool, L: Leaves, V: Visitor, C: Counter>(
    nodes: &[BvhNode],
    leaves: &L,
    setup: &RaySetup,
    mut visitor: V,
    counter: &mut C,
) -> V::Answer {
    let Some(root) = nodes.first() else { return visitor.answer() };
    let slabs = RobustSlabs::new(setup, leaves.pads(setup));
    let mut limit = setup.t_max;
    counter.boxes(1);
    if slabs.entry(root, setup.t_min, limit).is_none() {
        return visitor.answer();
    }
    let mut stack = Stack::new();
    let mut index = 0;
    loop {
        let node = &nodes[index];
        counter.at(index as u64);
        if node.is_leaf() {
            counter.leaf(node.count);
            for reference in node.prim_range() {
                let hit = leaves.intersect(reference, setup, limit);
                if hit.is_hit() && visitor.wants(hit.t, hit.prim_id) {
                    let Hit { t, u, v, prim_id } = hit;
                    if let Some(t) = visitor.take(Found { t, u, v, det: 1.0, prim_id }) {
                        limit = t;
                        if ANY {
                            return visitor.answer();
                        }
                    }
                }
            }
        } else {
            counter.node(2);
            let [a, b] = node.children();
            let entry_a = slabs.entry(&nodes[a], setup.t_min, limit);
            let entry_b = slabs.entry(&nodes[b], setup.t_min, limit);
            match (entry_a, entry_b) {
                (Some(ta), Some(tb)) => {
                    let (near, far, t_far) = if ta <= tb { (a, b, tb) } else { (b, a, ta) };
                    stack.push(far, t_far);
                    index = near;
                    continue;
                }
                (Some(_), None) => {
                    index = a;
                    continue;
                }
                (None, Some(_)) => {
                    index = b;
                    continue;
                }
                (None, None) => {}
            }
        }
        loop {
            let Some((popped, t)) = stack.pop() else { return visitor.answer() };
            // Boxes at the same distance as the hit may hold one with a smaller id.
            if t <= limit {
                index = popped;
                break;
            }
        }
    }
}

/// The slab test with a conservative far distance (Ize 2013, section 3), of boxes that are
/// larger by what the triangle test needs.
struct RobustSlabs {
    /// How much larger where the ray enters and where it leaves.
    pads: [f32; 2],
    origin: Vec3,
    /// ±∞ where the direction is ±0.
    inverse: Vec3,
    /// By the sign bit, so that −0.0 enters at the upper plane.
    negative: [bool; 3],
}

impl RobustSlabs {
    #[inline(always)]
    fn new(ray: &RaySetup, pads: [f32; 2]) -> Self {
        let d = Vec3::from(ray.direction);
        Self {
            pads,
            origin: ray.origin.into(),
            inverse: 1.0 / d,
            negative: [d.x.is_sign_negative(), d.y.is_sign_negative(), d.z.is_sign_negative()],
        }
    }

    /// Where the ray enters the box, if it does between `t_min` and `t_max`.
    #[inline(always)]
    fn entry(&self, node: &BvhNode, t_min: f32, t_max: f32) -> Option<f32> {
        let mut near = t_min;
        let mut far = t_max;
        for axis in 0..3 {
            let (low, high) = (node.min[axis], node.max[axis]);
            let (first, last) = if self.negative[axis] { (high, low) } else { (low, high) };
            // 0·∞ is NaN where a parallel ray lies in a plane; min and max drop it, so that the
            // axis does not exclude the box.
            let sign = if self.negative[axis] { -1.0 } else { 1.0 };
            let first = first - self.origin[axis] - sign * self.pads[0];
            let last = last - self.origin[axis] + sign * self.pads[1];
            near = near.max(first * self.inverse[axis]);
            far = far.min(last * self.inverse[axis] * ROBUST_SLAB);
        }
        (near <= far).then_some(near)
    }
}

/// Pending nodes with the distance of their boxes: an array, and the heap for what goes past it.
struct Stack {
    array: [(u32, f32); Self::ARRAY],
    len: usize,
    heap: Vec<(u32, f32)>,
}

impl Stack {
    const ARRAY: usize = 64;

    #[inline(always)]
    fn new() -> Self {
        Self { array: [(0, 0.0); Self::ARRAY], len: 0, heap: Vec::new() }
    }

    #[inline(always)]
    fn push(&mut self, node: usize, t: f32) {
        let entry = (niwaki_core::to_u32(node), t);
        if let Some(slot) = self.array.get_mut(self.len) {
            *slot = entry;
            self.len += 1;
        } else {
            self.heap.push(entry);
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<(usize, f32)> {
        // The heap is used only while the array is full.
        let (node, t) = if self.heap.is_empty() {
            self.len = self.len.checked_sub(1)?;
            self.array[self.len]
        } else {
            self.heap.pop()?
        };
        Some((node as usize, t))
    }
}

/// Every inner node has two children after it and every leaf a range that exists.
pub(crate) fn check_tree(bvh: &Bvh) -> Result<(), CollapseError> {
    let nodes = bvh.nodes.len();
    // Where every node but the root has one parent, traversal visits each at most once; the root
    // cannot be a child, as children come after their parents.
    let mut has_parent = vec![false; nodes];
    for (i, node) in bvh.nodes.iter().enumerate() {
        let fault = || CollapseError::Malformed { node: i, nodes };
        if node.is_leaf() {
            let end = (node.first as usize).saturating_add(node.count as usize);
            if end > bvh.prim_ids.len() {
                return Err(fault());
            }
        } else {
            let [a, b] = node.children();
            if a <= i || b >= nodes || has_parent[a] || has_parent[b] {
                return Err(fault());
            }
            has_parent[a] = true;
            has_parent[b] = true;
        }
    }
    Ok(())
}

/// Every id names a triangle.
pub(crate) fn check_ids(ids: &[u32], mesh: &TriangleMesh) -> Result<(), SceneError> {
    let triangles = mesh.len();
    match ids.par_iter().with_min_len(1 << 16).find_first(|&&id| id as usize >= triangles) {
        None => Ok(()),
        Some(&prim_id) => Err(SceneError::NoSuchTriangle { prim_id, triangles }),
    }
}

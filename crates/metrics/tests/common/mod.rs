//! Trees to be judged. Each test binary uses a part of this.
#![allow(dead_code, reason = "every test binary compiles its own copy and uses a part")]

use niwaki_core::{Aabb, Bvh, BvhNode, Triangle, TriangleMesh, glam::Vec3, to_u32};

/// A small generator of reproducible numbers (`SplitMix64`).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * 0.5_f64.powi(53)
    }

    /// In [0, 1), with 16 bits.
    fn coarse(&mut self) -> f32 {
        f32::from(self.bits().to_le_bytes()[0]) / 256.0
            + f32::from(self.bits().to_le_bytes()[0]) / 65536.0
    }

    /// In a cube from −1 to 1.
    pub(crate) fn point(&mut self) -> Vec3 {
        let mut c = || self.coarse() * 2.0 - 1.0;
        Vec3::new(c(), c(), c())
    }
}

/// `count` random triangles whose corners are up to `size` from their middle.
pub(crate) fn soup(count: usize, size: f32, seed: u64) -> TriangleMesh {
    let mut random = Random(seed);
    let triangles: Vec<_> = (0..count)
        .map(|_| {
            let middle = random.point();
            let [a, b, c] = std::array::from_fn(|_| middle + random.point() * size);
            Triangle::new(a, b, c)
        })
        .collect();
    TriangleMesh::from_triangles(&triangles).unwrap()
}

/// Where [`build`] cuts triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Split {
    Never,
    /// At every other level, until there are four references a triangle.
    Sometimes,
    /// Until there are 64 references a triangle.
    Always,
}

/// Halves the longest axis of the bounds. Triangles that reach across the plane are cut or go to
/// the side of their centre.
pub(crate) fn build(mesh: &TriangleMesh, leaf_size: usize, split: Split) -> Bvh {
    let mut bvh = Bvh::default();
    let all: Vec<(u32, Aabb)> =
        mesh.triangles().enumerate().map(|(i, t)| (to_u32(i), t.bounds())).collect();
    if all.is_empty() {
        return bvh;
    }
    bvh.nodes.push(BvhNode::leaf(Aabb::EMPTY, 0, 1));
    let mut cuts_left = mesh.len() * if split == Split::Always { 63 } else { 3 };
    let mut stack = vec![(0_usize, 0_u32, all)];
    while let Some((slot, depth, items)) = stack.pop() {
        let bounds = items.iter().fold(Aabb::EMPTY, |b, item| b.union(item.1));
        let axis = bounds.longest_axis();
        let plane = bounds.center()[axis];
        let may_cut = split == Split::Always || split == Split::Sometimes && depth % 2 == 0;
        let (mut lower, mut upper) = (Vec::new(), Vec::new());
        for &(id, part) in &items {
            let crosses = part.min[axis] < plane && part.max[axis] > plane;
            if may_cut && crosses && cuts_left > 0 {
                cuts_left -= 1;
                let (a, b) = mesh.triangle(id as usize).split(&part, axis, plane);
                lower.extend((!a.is_empty()).then_some((id, a)));
                upper.extend((!b.is_empty()).then_some((id, b)));
            } else if part.center()[axis] < plane {
                lower.push((id, part));
            } else {
                upper.push((id, part));
            }
        }
        let stuck = lower.is_empty() || upper.is_empty() || depth >= 18;
        if items.len() <= leaf_size || stuck {
            bvh.nodes[slot] =
                BvhNode::leaf(bounds, to_u32(bvh.prim_ids.len()), to_u32(items.len()));
            bvh.prim_ids.extend(items.iter().map(|item| item.0));
            continue;
        }
        let first = bvh.nodes.len();
        bvh.nodes[slot] = BvhNode::inner(bounds, to_u32(first));
        bvh.nodes.extend([BvhNode::leaf(Aabb::EMPTY, 0, 1); 2]);
        stack.push((first + 1, depth + 1, upper));
        stack.push((first, depth + 1, lower));
    }
    bvh
}

/// One triangle a leaf, peeled off one by one: `count − 1` deep.
pub(crate) fn chain(count: usize) -> (Bvh, TriangleMesh) {
    let triangles: Vec<_> = (0..count)
        .map(|i| {
            let x = Vec3::X * i as f32;
            Triangle::new(x, x + Vec3::Y, x + Vec3::Z)
        })
        .collect();
    let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
    let last = Vec3::new((count - 1) as f32, 1.0, 1.0);
    let mut nodes = vec![BvhNode::leaf(mesh.bounds(), 0, 1)];
    for i in 0..count - 1 {
        let slot = nodes.len() - 1;
        let start = Vec3::X * i as f32;
        nodes[slot] = BvhNode::inner(Aabb::new(start, last), to_u32(nodes.len()));
        nodes.push(BvhNode::leaf(triangles[i].bounds(), to_u32(i), 1));
        nodes.push(BvhNode::leaf(triangles[i + 1].bounds(), to_u32(i + 1), 1));
    }
    (Bvh { nodes, prim_ids: (0..to_u32(count)).collect() }, mesh)
}

//! The slab test of quantised nodes in all lanes.

/// Defines the struct `Boxes` of `define_traversal` for [`niwaki_wide::QuantisedNode`]. Needs, in
/// scope, `load_bytes`, which makes numbers of a row of bytes, and `FUSED`.
macro_rules! define_quantised_boxes {
    ($features:literal) => {
        /// Where the rows of steps begin in a node, each of `W` bytes.
        const PLANES: usize = std::mem::offset_of!(Node, planes);

        /// A ray in every lane, as the slab test wants it.
        struct Boxes {
            /// Offsets of the rows of steps that the ray enters through.
            near: [usize; 3],
            /// Offsets of the rows of steps that the ray leaves through.
            far: [usize; 3],
            inverse: [Floats; 3],
            near_offset: [Floats; 3],
            far_offset: [Floats; 3],
        }

        /// What [`Boxes`] are made of.
        struct PreparedBoxes {
            near: [usize; 3],
            far: [usize; 3],
            slabs: Slabs,
        }

        impl Boxes {
            #[inline(always)]
            fn prepare(slabs: Slabs, setup: &RaySetup, scale: &SceneScale) -> PreparedBoxes {
                let slabs = if FUSED { slabs } else { slabs.unfused(setup, scale.magnitude) };
                let row = |axis: usize, side: bool| PLANES + W * (2 * axis + usize::from(side));
                let near = |axis: usize| row(axis, slabs.inverse[axis].is_sign_negative());
                let far = |axis: usize| row(axis, slabs.inverse[axis].is_sign_positive());
                PreparedBoxes {
                    near: [near(0), near(1), near(2)],
                    far: [far(0), far(1), far(2)],
                    slabs,
                }
            }

            #[target_feature(enable = $features)]
            #[inline]
            fn new(ray: &PreparedBoxes) -> Self {
                let all = |v: Vec3A| [splat(v.x), splat(v.y), splat(v.z)];
                Self {
                    near: ray.near,
                    far: ray.far,
                    inverse: all(ray.slabs.inverse),
                    near_offset: all(ray.slabs.near_offset),
                    far_offset: all(ray.slabs.far_offset),
                }
            }

            /// Where the ray enters the boxes, and those that it meets.
            ///
            /// # Safety
            /// `node` must point to a node.
            #[target_feature(enable = $features)]
            #[inline]
            unsafe fn test(&self, node: *const u8, t_min: Floats, t_max: Floats) -> (Floats, u32) {
                // SAFETY: as promised.
                let grid = unsafe { &*node.cast::<Node>() };
                // SAFETY: the offsets are those of rows of a node.
                let row = |offset: usize| unsafe { load_bytes(node.add(offset)) };
                // The grid is folded into the ray.
                let axis = |axis: usize| {
                    let inverse = self.inverse[axis];
                    let step = mul(splat(grid.scale[axis]), inverse);
                    let origin = splat(grid.origin[axis]);
                    let near_offset = loose_mul_add(origin, inverse, self.near_offset[axis]);
                    let far_offset = loose_mul_add(origin, inverse, self.far_offset[axis]);
                    let near = loose_mul_add(row(self.near[axis]), step, near_offset);
                    let far = loose_mul_add(row(self.far[axis]), step, far_offset);
                    (near, far)
                };
                let ((x0, x1), (y0, y1), (z0, z1)) = (axis(0), axis(1), axis(2));
                let enter = max(max(x0, y0), max(z0, t_min));
                let leave = min(min(x1, y1), min(z1, t_max));
                // Inverted boxes alone do not keep unused slots out: the ray's rounding errors may
                // be larger than the node.
                (enter, low_lanes(hit_mask(enter, leave), grid.used()))
            }
        }
    };
}

pub(crate) use define_quantised_boxes;

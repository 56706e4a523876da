//! The slab test in all lanes.

/// Defines the struct `Boxes` of `define_traversal` for [`niwaki_wide::WideNode`].
macro_rules! define_full_boxes {
    ($features:literal) => {
        /// Bytes of a row of planes.
        const ROW: usize = 4 * W;

        /// A ray in every lane, as the slab test wants it.
        struct Boxes {
            /// Offsets of the rows of planes that the ray enters through.
            near: [usize; 3],
            inverse: [Floats; 3],
            near_offset: [Floats; 3],
            far_offset: [Floats; 3],
        }

        /// What [`Boxes`] are made of.
        struct PreparedBoxes {
            near: [usize; 3],
            slabs: Slabs,
        }

        impl Boxes {
            #[inline(always)]
            fn prepare(slabs: Slabs, _: &RaySetup, _: &SceneScale) -> PreparedBoxes {
                let row = |axis: usize| {
                    2 * ROW * axis + ROW * usize::from(slabs.inverse[axis].is_sign_negative())
                };
                PreparedBoxes { near: [row(0), row(1), row(2)], slabs }
            }

            #[target_feature(enable = $features)]
            #[inline]
            fn new(ray: &PreparedBoxes) -> Self {
                let all = |v: Vec3A| [splat(v.x), splat(v.y), splat(v.z)];
                Self {
                    near: ray.near,
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
                // SAFETY: `near` holds the offsets of rows of a node, or those with one bit
                // changed that leads to the other row of the axis; rows are aligned.
                let row = |offset: usize| unsafe { load(node.add(offset).cast()) };
                let near = |axis: usize| {
                    let row = row(self.near[axis]);
                    loose_mul_add(row, self.inverse[axis], self.near_offset[axis])
                };
                let far = |axis: usize| {
                    let row = row(self.near[axis] ^ ROW);
                    loose_mul_add(row, self.inverse[axis], self.far_offset[axis])
                };
                let enter = max(max(near(0), near(1)), max(near(2), t_min));
                let leave = min(min(far(0), far(1)), min(far(2), t_max));
                (enter, hit_mask(enter, leave))
            }
        }
    };
}

pub(crate) use define_full_boxes;

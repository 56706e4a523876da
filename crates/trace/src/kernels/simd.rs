//! The traversal that the x86-64 kernels share, as a macro: code compiled with target features
//! must carry them in every function, so generics cannot share it.

/// Defines `closest` and `any` for one instruction set, width, box test and triangle test. The
/// macro `$define_boxes` defines a struct `Boxes` (see `define_full_boxes` and
/// `define_quantised_boxes`), the macro `$define_corners` a struct `Corners` (see
/// `define_fast_corners` and `define_watertight_corners`).
///
/// Needs, in scope: `used_boxes` of the scalar kernel; the type `Node`, whose field `children` is aligned for vectors; the vector types `Floats` and `Ints` of as many lanes as the tree is wide, the
/// intrinsics for them under the short names of `vectors128`, `vectors256` or `vectors512`; and
/// with the same features `hit_mask(enter, leave) -> u32`, the lanes with `enter ≤ leave`;
/// `sorted_keys(keys, mask) -> Ints`, the keys of the lanes in a mask of at least two, sorted
/// upwards as signed integers; and `compacted(children, mask) -> Ints`, the children of the lanes
/// in a mask, moved to the front.
macro_rules! define_traversal {
    ($features:literal, $width:literal, $define_boxes:ident, $define_corners:ident) => {
        /// The width of the tree, and the lanes of a vector.
        const W: usize = $width;
        /// Where the words of the children stand in a node.
        const CHILDREN: usize = std::mem::offset_of!(Node, children);
        /// The bits of a key that hold the lane.
        const LANE: u32 = $width - 1;
        /// Where the count of a leaf's word begins.
        const SHIFT: u32 = 31 - W.trailing_zeros();

        /// A ray in every lane.
        struct Lanes {
            boxes: Boxes,
            t_min: Floats,
            corners: Corners,
        }

        /// What the test of a leaf's triangles gave, lane by lane.
        struct LeafHits {
            /// Lanes with a hit.
            mask: u32,
            t: Floats,
            /// Times `det`.
            u: Floats,
            /// Times `det`.
            v: Floats,
            det: Floats,
            /// The first reference.
            first: usize,
            /// Some lane could not be decided; never so if asked to take care.
            doubt: bool,
        }

        /// A ray before it is in every lane: what [`Lanes`] are made of at the cost of a load each.
        struct Prepared {
            boxes: PreparedBoxes,
            t_min: f32,
            corners: PreparedCorners,
        }

        impl Prepared {
            #[inline(always)]
            fn new(setup: &RaySetup, scale: &SceneScale) -> Self {
                Self {
                    boxes: Boxes::prepare(Corners::slabs(setup, scale), setup, scale),
                    t_min: setup.t_min,
                    corners: Corners::prepare(setup),
                }
            }
        }

        impl Lanes {
            #[target_feature(enable = $features)]
            #[inline]
            fn new(ray: &Prepared) -> Self {
                Self {
                    boxes: Boxes::new(&ray.boxes),
                    t_min: splat(ray.t_min),
                    corners: Corners::new(&ray.corners),
                }
            }

            /// Where the ray enters a node's boxes, and those that it meets.
            ///
            /// # Safety
            /// `node` must point to a node.
            #[target_feature(enable = $features)]
            #[inline]
            unsafe fn boxes(&self, node: *const u8, t_max: Floats) -> (Floats, u32) {
                // SAFETY: as promised.
                unsafe { self.boxes.test(node, self.t_min, t_max) }
            }

            /// Tests the triangles of a leaf.
            ///
            /// # Safety
            /// `word` must be a leaf of the scene whose triangles are given.
            #[target_feature(enable = $features)]
            #[inline]
            unsafe fn leaf<const CAREFUL: bool>(
                &self,
                triangles: *const f32,
                word: u32,
                t_max: Floats,
            ) -> LeafHits {
                let first = (word & ((1 << SHIFT) - 1)) as usize;
                let count = (word >> SHIFT & LANE) + 1;
                // SAFETY: nine rows of as many words begin here; the last row's vector ends at
                // most W − count words behind the leaf, and the array has that much padding at
                // its end.
                let base = unsafe { triangles.add(WORDS * first) };
                // SAFETY: as just said.
                unsafe { self.corners.test::<CAREFUL>(base, first, count, self.t_min, t_max) }
            }
        }

        $define_boxes!($features);
        $define_corners!($features);

        /// Lane `i` of a vector.
        #[target_feature(enable = $features)]
        #[inline]
        fn lane(v: Floats, i: u32) -> f32 {
            first_lane(permute_floats(v, splat_int(i.cast_signed())))
        }

        /// Fetches a child that will be visited soon: most rays in large scenes wait for memory.
        #[target_feature(enable = $features)]
        #[inline]
        fn prefetch(nodes: *const u8, triangles: *const f32, word: u32) {
            let leaf = triangles.wrapping_add(WORDS * (word & ((1 << SHIFT) - 1)) as usize).cast();
            let node = nodes.wrapping_add(word as usize * size_of::<Node>());
            let address: *const i8 = if word.cast_signed() < 0 { leaf } else { node.cast() };
            // SAFETY: prefetching reads nothing and cannot fault.
            #[allow(unused_unsafe, reason = "safe since Rust 1.90 or later, unsafe before")]
            unsafe {
                for line in 0..size_of::<Node>() / 64 {
                    _mm_prefetch::<_MM_HINT_T0>(address.wrapping_add(64 * line));
                }
            }
        }

        /// Shows hits to a visitor, nearest boxes first. The visitor is made here: one that was handed
        /// over would be in memory, and its state would stay there.
        ///
        /// # Safety
        /// The processor must have the instructions, and the scene nodes.
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn closest<V: Visitor>(
            scene: &Layout<W, Node>,
            setup: &RaySetup,
            visitor: impl FnOnce() -> V,
        ) -> V::Answer {
            // SAFETY: the same promise.
            unsafe { closest_as::<false, V>(scene, setup, visitor) }
        }

        /// As [`closest`], from the start, for a ray that met a triangle that needs care. The
        /// visitor sees hits again that it saw before.
        ///
        /// That is a traversal of its own, and not a call where the care is needed, because
        /// around a call in the loop the compiler would move every register to memory and back.
        #[target_feature(enable = $features)]
        #[cold]
        #[inline(never)]
        unsafe fn closest_with_care<V: Visitor>(
            scene: &Layout<W, Node>,
            setup: &RaySetup,
            visitor: V,
        ) -> V::Answer {
            // SAFETY: the same promise.
            unsafe { closest_as::<true, V>(scene, setup, || visitor) }
        }

        #[target_feature(enable = $features)]
        #[inline]
        unsafe fn closest_as<const CAREFUL: bool, V: Visitor>(
            scene: &Layout<W, Node>,
            setup: &RaySetup,
            visitor: impl FnOnce() -> V,
        ) -> V::Answer {
            let mut visitor = visitor();
            let ray = Lanes::new(&Prepared::new(setup, &scene.scale));
            let nodes: *const u8 = scene.nodes.as_ptr().cast();
            let triangles = scene.triangles.as_ptr();
            let prim_ids = scene.prim_ids.as_ptr();
            let (mut child_array, mut key_array) = (UNINIT, UNINIT);
            let (mut child_heap, mut key_heap) = (Heap::new(), Heap::new());
            let stack_child = room(scene.stack_bound, &mut child_array, &mut child_heap);
            let stack_key = room(scene.stack_bound, &mut key_array, &mut key_heap).cast::<i32>();
            let mut depth = 0_usize;
            let mut t_max = splat(setup.t_max);
            // A child's key is its distance, which is not negative, so that its bits sort like
            // integers, with the lane in the lowest bits. This is the largest key of a box
            // that is worth a visit.
            let mut last_key = (setup.t_max.to_bits() | LANE).cast_signed();
            let lane_ids = lane_ids();
            let distance_bits = splat_int((!LANE).cast_signed());
            let mut word = 0_u32;
            'visit: loop {
                while word.cast_signed() >= 0 {
                    // SAFETY: the words of nodes in a tree are indices of its nodes.
                    let node = unsafe { nodes.add((word as usize) * size_of::<Node>()) };
                    if V::COUNTS {
                        // SAFETY: a node, as above.
                        let boxes = used_boxes::<W, Node>(unsafe { &*node.cast::<Node>() });
                        visitor.node(word, boxes);
                    }
                    // SAFETY: as above.
                    let (enter, mask) = unsafe { ray.boxes(node, t_max) };
                    if mask == 0 {
                        break;
                    }
                    // SAFETY: the words of a node's children.
                    let children = unsafe { load_ints(node.add(CHILDREN).cast()) };
                    if mask & (mask - 1) == 0 {
                        // SAFETY: a lane below eight.
                        word = unsafe {
                            *node.add(CHILDREN).cast::<u32>().add(mask.trailing_zeros() as usize)
                        };
                        continue;
                    }
                    // Fetch what will be visited while it is being sorted.
                    let mut rest = mask;
                    while rest != 0 {
                        // SAFETY: a lane below the width.
                        let child = unsafe {
                            *node.add(CHILDREN).cast::<u32>().add(rest.trailing_zeros() as usize)
                        };
                        prefetch(nodes, triangles, child);
                        rest &= rest - 1;
                    }
                    let keys = and_ints(as_ints(enter), distance_bits);
                    let keys = sorted_keys(or_ints(keys, lane_ids), mask);
                    // The permutation reads the lowest bits: the lane.
                    let near_first = permute(children, keys);
                    word = _mm_cvtsi128_si32(low(near_first)).cast_unsigned();
                    // All but the nearest, the farthest first.
                    let left = mask.count_ones() - 1;
                    let reverse = sub_ints(splat_int(left.cast_signed()), lane_ids);
                    let keys = permute(keys, reverse);
                    let children = permute(near_first, reverse);
                    // SAFETY: the stack has room for all entries that the depth of the tree
                    // allows, and a vector more.
                    unsafe {
                        store_ints(stack_child.add(depth).cast(), children);
                        store_ints(stack_key.add(depth).cast(), keys);
                    }
                    depth += left as usize;
                }
                if word.cast_signed() < 0 {
                    if V::COUNTS {
                        visitor.leaf(word & ((1 << SHIFT) - 1), (word >> SHIFT & LANE) + 1);
                    }
                    // SAFETY: the word of a leaf of this scene.
                    let hits = unsafe { ray.leaf::<CAREFUL>(triangles, word, t_max) };
                    if hits.doubt {
                        visitor.restart();
                        // SAFETY: the same promise.
                        return unsafe { closest_with_care(scene, setup, visitor) };
                    }
                    let mut mask = hits.mask;
                    while mask != 0 {
                        let i = mask.trailing_zeros();
                        mask &= mask - 1;
                        let t = lane(hits.t, i);
                        // SAFETY: a reference of the leaf.
                        let prim_id = unsafe { *prim_ids.add(hits.first + i as usize) };
                        if visitor.wants(t, prim_id) {
                            let (u, v) = (lane(hits.u, i), lane(hits.v, i));
                            let det = lane(hits.det, i);
                            if let Some(t) = visitor.take(Found { t, u, v, det, prim_id }) {
                                if V::ENDS_AT_LIMIT {
                                    return visitor.answer();
                                }
                                t_max = splat(t);
                                // Without the sign of −0.0, which is as far as 0.0.
                                last_key = (t.abs().to_bits() | LANE).cast_signed();
                            }
                        }
                    }
                }
                loop {
                    if depth == 0 {
                        break 'visit;
                    }
                    depth -= 1;
                    // SAFETY: an entry that was stored.
                    let key = unsafe { *stack_key.add(depth) };
                    if key <= last_key {
                        // SAFETY: as above, and the first entry, which was stored as well.
                        unsafe {
                            word = *stack_child.add(depth);
                            prefetch(nodes, triangles, *stack_child.add(depth.saturating_sub(1)));
                        }
                        break;
                    }
                }
            }
            visitor.answer()
        }

        /// Shows hits to a visitor until it sets a limit.
        ///
        /// # Safety
        /// As for [`closest`].
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn any<V: Visitor>(
            scene: &Layout<W, Node>,
            setup: &RaySetup,
            visitor: impl FnOnce() -> V,
        ) -> V::Answer {
            // SAFETY: the same promise.
            unsafe { any_as::<false, V>(scene, setup, visitor) }
        }

        /// As [`any`], for a ray that met a triangle that needs care.
        #[target_feature(enable = $features)]
        #[cold]
        #[inline(never)]
        unsafe fn any_with_care<V: Visitor>(
            scene: &Layout<W, Node>,
            setup: &RaySetup,
            visitor: V,
        ) -> V::Answer {
            // SAFETY: the same promise.
            unsafe { any_as::<true, V>(scene, setup, || visitor) }
        }

        #[target_feature(enable = $features)]
        #[inline]
        unsafe fn any_as<const CAREFUL: bool, V: Visitor>(
            scene: &Layout<W, Node>,
            setup: &RaySetup,
            visitor: impl FnOnce() -> V,
        ) -> V::Answer {
            let mut visitor = visitor();
            let ray = Lanes::new(&Prepared::new(setup, &scene.scale));
            let nodes: *const u8 = scene.nodes.as_ptr().cast();
            let triangles = scene.triangles.as_ptr();
            let prim_ids = scene.prim_ids.as_ptr();
            let (mut array, mut heap) = (UNINIT, Heap::new());
            let stack = room(scene.stack_bound, &mut array, &mut heap);
            let mut depth = 0_usize;
            let t_max = splat(setup.t_max);
            let mut word = 0_u32;
            loop {
                if word.cast_signed() >= 0 {
                    // SAFETY: the words of nodes in a tree are indices of its nodes.
                    let node = unsafe { nodes.add((word as usize) * size_of::<Node>()) };
                    // SAFETY: as above.
                    let (_, mask) = unsafe { ray.boxes(node, t_max) };
                    // SAFETY: a node's words; the stack has room for all entries that the depth of the tree allows, and a vector more.
                    unsafe {
                        let children = load_ints(node.add(CHILDREN).cast());
                        let hit = compacted(children, mask);
                        store_ints(stack.add(depth).cast(), hit);
                    }
                    depth += mask.count_ones() as usize;
                } else {
                    // SAFETY: the word of a leaf of this scene.
                    let hits = unsafe { ray.leaf::<CAREFUL>(triangles, word, t_max) };
                    let mut mask = hits.mask;
                    while mask != 0 {
                        let i = mask.trailing_zeros();
                        mask &= mask - 1;
                        let (t, det) = (lane(hits.t, i), lane(hits.det, i));
                        let (u, v) = (lane(hits.u, i), lane(hits.v, i));
                        // SAFETY: a reference of the leaf.
                        let prim_id = unsafe { *prim_ids.add(hits.first + i as usize) };
                        if visitor.take(Found { t, u, v, det, prim_id }).is_some() {
                            return visitor.answer();
                        }
                    }
                    if hits.doubt {
                        // SAFETY: the same promise.
                        return unsafe { any_with_care(scene, setup, visitor) };
                    }
                }
                if depth == 0 {
                    return visitor.answer();
                }
                depth -= 1;
                // SAFETY: entries that were stored.
                unsafe {
                    word = *stack.add(depth);
                    prefetch(nodes, triangles, *stack.add(depth.saturating_sub(1)));
                }
            }
        }
    };
}

pub(crate) use define_traversal;

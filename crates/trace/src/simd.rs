//! The traversal that the x86-64 kernels share, as a macro: code compiled with target features
//! must carry them in every function, so generics cannot share it.

/// Defines `closest` and `any` for one instruction set.
///
/// Needs, in scope and with the same features: `hit_mask(enter, leave) -> u32`, the lanes with
/// `enter ≤ leave`; `sorted_keys(keys, mask) -> __m256i`, the keys of the lanes in a mask of at
/// least two, sorted upwards as signed integers; and `compacted(children, mask) -> __m256i`, the
/// children of the lanes in a mask, moved to the front.
macro_rules! define_traversal {
    ($features:literal) => {
        /// A ray in every lane.
        struct Lanes {
            /// Offsets of the rows of planes that the ray enters through.
            near: [usize; 3],
            inverse: [__m256; 3],
            near_offset: [__m256; 3],
            far_offset: [__m256; 3],
            t_min: __m256,
            origin: [__m256; 3],
            direction: [__m256; 3],
        }

        /// What the test of a leaf's triangles gave, lane by lane.
        struct LeafHits {
            /// Lanes with a hit.
            mask: u32,
            t: __m256,
            /// Times `det`.
            u: __m256,
            /// Times `det`.
            v: __m256,
            det: __m256,
            /// The first reference.
            first: usize,
        }

        impl Lanes {
            #[target_feature(enable = $features)]
            #[inline]
            fn new(setup: &RaySetup, magnitude: f32) -> Self {
                let slabs = Slabs::new(setup, magnitude);
                let row = |axis: usize, inverse: f32| {
                    64 * axis + 32 * usize::from(inverse.is_sign_negative())
                };
                let (i, n, f) = (slabs.inverse, slabs.near_offset, slabs.far_offset);
                let (o, d) = (setup.origin, setup.direction);
                Self {
                    near: [row(0, i.x), row(1, i.y), row(2, i.z)],
                    inverse: [_mm256_set1_ps(i.x), _mm256_set1_ps(i.y), _mm256_set1_ps(i.z)],
                    near_offset: [_mm256_set1_ps(n.x), _mm256_set1_ps(n.y), _mm256_set1_ps(n.z)],
                    far_offset: [_mm256_set1_ps(f.x), _mm256_set1_ps(f.y), _mm256_set1_ps(f.z)],
                    t_min: _mm256_set1_ps(setup.t_min),
                    origin: [_mm256_set1_ps(o.x), _mm256_set1_ps(o.y), _mm256_set1_ps(o.z)],
                    direction: [_mm256_set1_ps(d.x), _mm256_set1_ps(d.y), _mm256_set1_ps(d.z)],
                }
            }

            /// Entry and exit distances of a node's boxes.
            ///
            /// # Safety
            /// `node` must point to a node.
            #[target_feature(enable = $features)]
            #[inline]
            unsafe fn boxes(&self, node: *const u8, t_max: __m256) -> (__m256, __m256) {
                // SAFETY: `near` holds the offsets of rows of a node, or those with one bit
                // changed that leads to the other row of the axis; rows are aligned.
                let row = |offset: usize| unsafe { _mm256_load_ps(node.add(offset).cast()) };
                let near = |axis: usize| {
                    let row = row(self.near[axis]);
                    _mm256_fmadd_ps(row, self.inverse[axis], self.near_offset[axis])
                };
                let far = |axis: usize| {
                    let row = row(self.near[axis] ^ 32);
                    _mm256_fmadd_ps(row, self.inverse[axis], self.far_offset[axis])
                };
                let enter = _mm256_max_ps(
                    _mm256_max_ps(near(0), near(1)),
                    _mm256_max_ps(near(2), self.t_min),
                );
                let leave =
                    _mm256_min_ps(_mm256_min_ps(far(0), far(1)), _mm256_min_ps(far(2), t_max));
                (enter, leave)
            }

            /// Tests the triangles of a leaf: `triangle::intersect` in eight lanes.
            ///
            /// # Safety
            /// `word` must be a leaf of the scene whose triangles are given.
            #[target_feature(enable = $features)]
            #[inline]
            unsafe fn leaf(&self, triangles: *const f32, word: u32, t_max: __m256) -> LeafHits {
                let first = (word & ((1 << 28) - 1)) as usize;
                let count = (word >> 28 & 7) + 1;
                let n = count as usize;
                // SAFETY: nine rows of n words begin here.
                let base = unsafe { triangles.add(WORDS * first) };
                // SAFETY: the last row's vector ends at most 8 − n words behind the leaf, and the
                // array has that much padding at its end.
                let row = |i: usize| unsafe { _mm256_loadu_ps(base.add(i * n)) };
                let [ox, oy, oz] = self.origin;
                let [dx, dy, dz] = self.direction;
                let cx = _mm256_sub_ps(row(0), ox);
                let cy = _mm256_sub_ps(row(1), oy);
                let cz = _mm256_sub_ps(row(2), oz);
                let (ax, ay, az) = (row(3), row(4), row(5));
                let (bx, by, bz) = (row(6), row(7), row(8));
                let det2 = |a, b, c, d| _mm256_fmsub_ps(a, b, _mm256_mul_ps(c, d));
                let r = [det2(cy, dz, cz, dy), det2(cz, dx, cx, dz), det2(cx, dy, cy, dx)];
                let n3 = [det2(ay, bz, az, by), det2(az, bx, ax, bz), det2(ax, by, ay, bx)];
                let dot = |a: [__m256; 3], b: [__m256; 3]| {
                    let z = _mm256_mul_ps(a[2], b[2]);
                    _mm256_fmadd_ps(a[0], b[0], _mm256_fmadd_ps(a[1], b[1], z))
                };
                let sign_bit = _mm256_set1_ps(-0.0);
                let zero = _mm256_setzero_ps();
                let signed_det = dot(n3, self.direction);
                let sign = _mm256_and_ps(signed_det, sign_bit);
                let det = _mm256_andnot_ps(sign_bit, signed_det);
                let u = _mm256_xor_ps(dot([bx, by, bz], r), sign);
                let v = _mm256_xor_ps(dot([ax, ay, az], r), _mm256_xor_ps(sign, sign_bit));
                let inside = hit_mask(zero, u)
                    & hit_mask(zero, v)
                    & hit_mask(_mm256_add_ps(u, v), det)
                    & _bzhi_u32(0xff, count);
                if inside == 0 {
                    return LeafHits { mask: 0, t: zero, u, v, det, first };
                }
                let t = _mm256_div_ps(_mm256_xor_ps(dot(n3, [cx, cy, cz]), sign), det);
                let in_range = hit_mask(self.t_min, t) & hit_mask(t, t_max);
                // 0 < det, as opposed to ≤.
                let not_zero = !hit_mask(det, zero);
                LeafHits { mask: inside & in_range & not_zero, t, u, v, det, first }
            }
        }

        /// Lane `i` of a vector.
        #[target_feature(enable = $features)]
        #[inline]
        fn lane(v: __m256, i: u32) -> f32 {
            _mm256_cvtss_f32(_mm256_permutevar8x32_ps(v, _mm256_set1_epi32(i.cast_signed())))
        }

        /// Fetches a child that will be visited soon: most rays in large scenes wait for memory.
        #[target_feature(enable = $features)]
        #[inline]
        fn prefetch(nodes: *const u8, triangles: *const f32, word: u32) {
            let leaf = triangles.wrapping_add(WORDS * (word & ((1 << 28) - 1)) as usize).cast();
            let node = nodes.wrapping_add(word as usize * size_of::<Node8>());
            let address: *const i8 = if word.cast_signed() < 0 { leaf } else { node.cast() };
            // SAFETY: prefetching reads nothing and cannot fault.
            #[allow(unused_unsafe, reason = "safe since Rust 1.90 or later, unsafe before")]
            unsafe {
                _mm_prefetch::<_MM_HINT_T0>(address);
                _mm_prefetch::<_MM_HINT_T0>(address.wrapping_add(64));
                _mm_prefetch::<_MM_HINT_T0>(address.wrapping_add(128));
                _mm_prefetch::<_MM_HINT_T0>(address.wrapping_add(192));
            }
        }

        /// Sorts all lanes upwards, as signed integers, by a bitonic network.
        #[target_feature(enable = $features)]
        #[inline]
        fn sort8(v: __m256i) -> __m256i {
            let (lo, hi) = (|a, b| _mm256_min_epi32(a, b), |a, b| _mm256_max_epi32(a, b));
            let p = _mm256_shuffle_epi32::<0b10_11_00_01>(v);
            let v = _mm256_blend_epi32::<0b1010_1010>(lo(v, p), hi(v, p));
            let p = _mm256_shuffle_epi32::<0b00_01_10_11>(v);
            let v = _mm256_blend_epi32::<0b1100_1100>(lo(v, p), hi(v, p));
            let p = _mm256_shuffle_epi32::<0b10_11_00_01>(v);
            let v = _mm256_blend_epi32::<0b1010_1010>(lo(v, p), hi(v, p));
            let p = _mm256_permutevar8x32_epi32(v, _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0));
            let v = _mm256_blend_epi32::<0b1111_0000>(lo(v, p), hi(v, p));
            let p = _mm256_shuffle_epi32::<0b01_00_11_10>(v);
            let v = _mm256_blend_epi32::<0b1100_1100>(lo(v, p), hi(v, p));
            let p = _mm256_shuffle_epi32::<0b10_11_00_01>(v);
            _mm256_blend_epi32::<0b1010_1010>(lo(v, p), hi(v, p))
        }

        /// The closest hit in scaled distance.
        ///
        /// # Safety
        /// The processor must have the instructions, and the scene nodes.
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn closest(scene: &Layout<8>, setup: &RaySetup) -> Hit {
            let ray = Lanes::new(setup, scene.scale.magnitude);
            let nodes: *const u8 = scene.nodes.as_ptr().cast();
            let triangles = scene.triangles.as_ptr();
            let prim_ids = scene.prim_ids.as_ptr();
            let (mut child_array, mut key_array) = (UNINIT, UNINIT);
            let (mut child_heap, mut key_heap) = (Heap::new(), Heap::new());
            let stack_child = room(scene.stack_bound, &mut child_array, &mut child_heap);
            let stack_key = room(scene.stack_bound, &mut key_array, &mut key_heap).cast::<i32>();
            let mut depth = 0_usize;
            let mut best = no_hit(setup.t_max);
            let mut best_det = 1.0_f32;
            let mut t_max = _mm256_set1_ps(best.t);
            // A child's key is its distance, which is not negative, so that its bits sort like
            // integers, with the lane in the three lowest bits. This is the largest key of a box
            // that is worth a visit.
            let mut last_key = (best.t.to_bits() | 7).cast_signed();
            let lane_ids = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let distance_bits = _mm256_set1_epi32(!7);
            let mut word = 0_u32;
            'visit: loop {
                while word.cast_signed() >= 0 {
                    // SAFETY: the words of nodes in a tree are indices of its nodes.
                    let node = unsafe { nodes.add((word as usize) * size_of::<Node8>()) };
                    // SAFETY: as above.
                    let (enter, leave) = unsafe { ray.boxes(node, t_max) };
                    let mask = hit_mask(enter, leave);
                    if mask == 0 {
                        break;
                    }
                    // SAFETY: the children's words follow six rows of 32 bytes.
                    let children = unsafe { _mm256_load_si256(node.add(192).cast()) };
                    if mask & (mask - 1) == 0 {
                        // SAFETY: a lane below eight.
                        word = unsafe {
                            *node.add(192).cast::<u32>().add(mask.trailing_zeros() as usize)
                        };
                        continue;
                    }
                    let keys = _mm256_and_si256(_mm256_castps_si256(enter), distance_bits);
                    let keys = sorted_keys(_mm256_or_si256(keys, lane_ids), mask);
                    // The permutation reads the three lowest bits: the lane.
                    let near_first = _mm256_permutevar8x32_epi32(children, keys);
                    word = _mm256_cvtsi256_si32(near_first).cast_unsigned();
                    let lane = _mm256_extract_epi32::<1>(near_first).cast_unsigned();
                    prefetch(nodes, triangles, lane);
                    if mask.count_ones() > 2 {
                        let lane = _mm256_extract_epi32::<2>(near_first).cast_unsigned();
                        prefetch(nodes, triangles, lane);
                    }
                    // All but the nearest, the farthest first.
                    let left = mask.count_ones() - 1;
                    let reverse = _mm256_sub_epi32(_mm256_set1_epi32(left.cast_signed()), lane_ids);
                    let keys = _mm256_permutevar8x32_epi32(keys, reverse);
                    let children = _mm256_permutevar8x32_epi32(near_first, reverse);
                    // SAFETY: the stack has room for all entries that the depth of the tree
                    // allows, and eight more.
                    unsafe {
                        _mm256_storeu_si256(stack_child.add(depth).cast(), children);
                        _mm256_storeu_si256(stack_key.add(depth).cast(), keys);
                    }
                    depth += left as usize;
                }
                if word.cast_signed() < 0 {
                    // SAFETY: the word of a leaf of this scene.
                    let hits = unsafe { ray.leaf(triangles, word, t_max) };
                    let mut mask = hits.mask;
                    while mask != 0 {
                        let i = mask.trailing_zeros();
                        mask &= mask - 1;
                        let t = lane(hits.t, i);
                        // SAFETY: a reference of the leaf.
                        let prim_id = unsafe { *prim_ids.add(hits.first + i as usize) };
                        if t < best.t || (t == best.t && prim_id < best.prim_id) {
                            best = Hit { t, u: lane(hits.u, i), v: lane(hits.v, i), prim_id };
                            best_det = lane(hits.det, i);
                            t_max = _mm256_set1_ps(t);
                            last_key = (t.to_bits() | 7).cast_signed();
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
            if !best.is_hit() {
                return Hit::MISS;
            }
            Hit { u: best.u / best_det, v: best.v / best_det, ..best }
        }

        /// True if anything is hit.
        ///
        /// # Safety
        /// As for [`closest`].
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn any(scene: &Layout<8>, setup: &RaySetup) -> bool {
            let ray = Lanes::new(setup, scene.scale.magnitude);
            let nodes: *const u8 = scene.nodes.as_ptr().cast();
            let triangles = scene.triangles.as_ptr();
            let (mut array, mut heap) = (UNINIT, Heap::new());
            let stack = room(scene.stack_bound, &mut array, &mut heap);
            let mut depth = 0_usize;
            let t_max = _mm256_set1_ps(setup.t_max);
            let mut word = 0_u32;
            loop {
                if word.cast_signed() >= 0 {
                    // SAFETY: the words of nodes in a tree are indices of its nodes.
                    let node = unsafe { nodes.add((word as usize) * size_of::<Node8>()) };
                    // SAFETY: as above.
                    let (enter, leave) = unsafe { ray.boxes(node, t_max) };
                    let mask = hit_mask(enter, leave);
                    // SAFETY: the children's words follow six rows of 32 bytes; the stack has
                    // room for all entries that the depth of the tree allows, and eight more.
                    unsafe {
                        let children = _mm256_load_si256(node.add(192).cast());
                        let hit = compacted(children, mask);
                        _mm256_storeu_si256(stack.add(depth).cast(), hit);
                    }
                    depth += mask.count_ones() as usize;
                // SAFETY: the word of a leaf of this scene.
                } else if unsafe { ray.leaf(triangles, word, t_max) }.mask != 0 {
                    return true;
                }
                if depth == 0 {
                    return false;
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

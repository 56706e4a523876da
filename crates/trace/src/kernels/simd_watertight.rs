//! The watertight triangle test in all lanes: `watertight::Sheared::intersect`.

/// Defines the struct `Corners` of `define_traversal`.
macro_rules! define_watertight_corners {
    ($features:literal) => {
        /// A ray in every lane, as the triangle test wants it.
        struct Corners {
            /// Which rows of a corner are across the ray and which along it.
            axes: [usize; 3],
            /// In the order of `axes`.
            origin: [Floats; 3],
            shear: [Floats; 2],
            along: Floats,
        }

        /// What [`Corners`] are made of.
        type PreparedCorners = Sheared;

        impl Corners {
            #[inline(always)]
            fn prepare(setup: &RaySetup) -> PreparedCorners {
                Sheared::new(setup)
            }

            #[target_feature(enable = $features)]
            #[inline]
            fn new(s: &PreparedCorners) -> Self {
                Self {
                    axes: s.axes,
                    origin: [splat(s.origin[0]), splat(s.origin[1]), splat(s.origin[2])],
                    shear: [splat(s.shear[0]), splat(s.shear[1])],
                    along: splat(s.along),
                }
            }

            /// The slabs that go with the test.
            #[inline(always)]
            fn slabs(setup: &RaySetup, scale: &SceneScale) -> Slabs {
                watertight::slabs(setup, scale)
            }

            /// Tests the `count` triangles whose rows begin at `base`.
            ///
            /// # Safety
            /// Nine rows of `count` words and a vector more must be readable at `base`.
            #[target_feature(enable = $features)]
            #[inline]
            unsafe fn test<const CAREFUL: bool>(
                &self,
                base: *const f32,
                first: usize,
                count: u32,
                t_min: Floats,
                t_max: Floats,
            ) -> LeafHits {
                let n = count as usize;
                // SAFETY: as promised.
                let axes = self.axes.map(|axis| unsafe { base.add(axis * n) });
                // SAFETY: as promised.
                let row = |i: usize, k: usize| unsafe { load_unaligned(axes[k].add(3 * i * n)) };
                let corner = |i: usize| {
                    let z = sub(row(i, 2), self.origin[2]);
                    let x = sub(row(i, 0), self.origin[0]);
                    let y = sub(row(i, 1), self.origin[1]);
                    [neg_mul_add(self.shear[0], z, x), neg_mul_add(self.shear[1], z, y), z]
                };
                let ([ax, ay, az], [bx, by, bz], [cx, cy, cz]) = (corner(0), corner(1), corner(2));
                let det2 = |a, b, c, d| {
                    let q = mul(c, d);
                    add(mul_sub(a, b, q), neg_mul_add(c, d, q))
                };
                let wa = det2(bx, cy, by, cx);
                let wb = det2(cx, ay, cy, ax);
                let wc = det2(ax, by, ay, bx);
                let least = min(wa, min(wb, wc));
                let most = max(wa, max(wb, wc));
                let certain = splat(CERTAIN);
                let sign_bit = splat(-0.0);
                let minus_certain = xor(certain, sign_bit);
                // Lanes in which no two weights have opposite signs for certain.
                let candidates = (hit_mask(minus_certain, least) | hit_mask(most, certain))
                    & low_lanes(u32::MAX, count);
                let zeros = zero();
                if candidates == 0 {
                    return LeafHits {
                        mask: 0,
                        t: zeros,
                        u: zeros,
                        v: zeros,
                        det: zeros,
                        first,
                        doubt: false,
                    };
                }
                let (wa, wb, wc) =
                    (and_not(sign_bit, wa), and_not(sign_bit, wb), and_not(sign_bit, wc));
                let det = add(wa, add(wb, wc));
                let depth = mul_add(wa, az, mul_add(wb, bz, mul(wc, cz)));
                // Adding a positive zero leaves no negative one, whose bits sort wrong.
                let t = add(div(depth, mul(det, self.along)), zeros);
                let sure = hit_mask(certain, min(wa, min(wb, wc)))
                    & hit_mask(and_not(sign_bit, depth), splat(f32::MAX));
                let doubtful = candidates & !sure;
                let mut hits =
                    LeafHits { mask: candidates, t, u: wb, v: wc, det, first, doubt: false };
                if CAREFUL {
                    if doubtful != 0 {
                        let corners = [ax, ay, az, bx, by, bz, cx, cy, cz];
                        hits = self.decide(corners, doubtful, hits);
                    }
                } else {
                    hits.mask &= sure;
                    hits.doubt = doubtful != 0;
                }
                hits.mask &= hit_mask(t_min, hits.t) & hit_mask(hits.t, t_max);
                hits
            }

            /// Decides lanes in `f64`.
            #[target_feature(enable = $features)]
            #[cold]
            #[inline(never)]
            fn decide(&self, corners: [Floats; 9], lanes: u32, hits: LeafHits) -> LeafHits {
                let mut mask = hits.mask;
                let [mut t, mut u, mut v, mut det] =
                    [hits.t, hits.u, hits.v, hits.det].map(|v| to_array(v));
                let corners = corners.map(|v| to_array(v));
                let along = first_lane(self.along);
                let mut rest = lanes;
                while rest != 0 {
                    let i = rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    match watertight::decide(corners.map(|row| row[i]), along) {
                        Some(hit) => [t[i], u[i], v[i], det[i]] = [hit.t, hit.u, hit.v, 1.0],
                        None => mask &= !(1 << i),
                    }
                }
                let [t, u, v, det] = [t, u, v, det].map(|v| from_array(v));
                LeafHits { mask, t, u, v, det, ..hits }
            }
        }

        /// The lanes of a vector.
        #[target_feature(enable = $features)]
        #[inline]
        fn to_array(v: Floats) -> [f32; W] {
            let mut lanes = [0.0; W];
            // SAFETY: as many words as lanes.
            unsafe { store_unaligned(lanes.as_mut_ptr(), v) };
            lanes
        }

        /// A vector of its lanes.
        #[target_feature(enable = $features)]
        #[inline]
        fn from_array(lanes: [f32; W]) -> Floats {
            // SAFETY: as many words as lanes.
            unsafe { load_unaligned(lanes.as_ptr()) }
        }
    };
}

pub(crate) use define_watertight_corners;

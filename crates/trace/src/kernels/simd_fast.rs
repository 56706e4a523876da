//! The fast triangle test in all lanes: `triangle::intersect`.

/// Defines the struct `Corners` of `define_traversal`.
macro_rules! define_fast_corners {
    ($features:literal) => {
        /// A ray in every lane, as the triangle test wants it.
        struct Corners {
            origin: [Floats; 3],
            direction: [Floats; 3],
        }

        /// What [`Corners`] are made of.
        struct PreparedCorners {
            origin: Vec3A,
            direction: Vec3A,
        }

        impl Corners {
            #[inline(always)]
            fn prepare(setup: &RaySetup) -> PreparedCorners {
                PreparedCorners { origin: setup.origin, direction: setup.direction }
            }

            #[target_feature(enable = $features)]
            #[inline]
            fn new(ray: &PreparedCorners) -> Self {
                let (o, d) = (ray.origin, ray.direction);
                Self {
                    origin: [splat(o.x), splat(o.y), splat(o.z)],
                    direction: [splat(d.x), splat(d.y), splat(d.z)],
                }
            }

            /// The slabs that go with the test.
            #[inline(always)]
            fn slabs(setup: &RaySetup, scale: &SceneScale) -> Slabs {
                Slabs::new(setup, scale.magnitude)
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
                let row = |i: usize| unsafe { load_unaligned(base.add(i * n)) };
                let [ox, oy, oz] = self.origin;
                let [dx, dy, dz] = self.direction;
                let cx = sub(row(0), ox);
                let cy = sub(row(1), oy);
                let cz = sub(row(2), oz);
                let (ax, ay, az) = (row(3), row(4), row(5));
                let (bx, by, bz) = (row(6), row(7), row(8));
                let det2 = |a, b, c, d| mul_sub(a, b, mul(c, d));
                let r = [det2(cy, dz, cz, dy), det2(cz, dx, cx, dz), det2(cx, dy, cy, dx)];
                let n3 = [det2(ay, bz, az, by), det2(az, bx, ax, bz), det2(ax, by, ay, bx)];
                let dot = |a: [Floats; 3], b: [Floats; 3]| {
                    let z = mul(a[2], b[2]);
                    mul_add(a[0], b[0], mul_add(a[1], b[1], z))
                };
                let sign_bit = splat(-0.0);
                let zeros = zero();
                let signed_det = dot(n3, self.direction);
                let sign = and(signed_det, sign_bit);
                let det = and_not(sign_bit, signed_det);
                let u = xor(dot([bx, by, bz], r), sign);
                let v = xor(dot([ax, ay, az], r), xor(sign, sign_bit));
                let inside = hit_mask(zeros, u)
                    & hit_mask(zeros, v)
                    & hit_mask(add(u, v), det)
                    & low_lanes(u32::MAX, count);
                if inside == 0 {
                    return LeafHits { mask: 0, t: zeros, u, v, det, first, doubt: false };
                }
                let t = div(xor(dot(n3, [cx, cy, cz]), sign), det);
                let in_range = hit_mask(t_min, t) & hit_mask(t, t_max);
                // 0 < det, as opposed to ≤.
                let not_zero = !hit_mask(det, zeros);
                LeafHits { mask: inside & in_range & not_zero, t, u, v, det, first, doubt: false }
            }
        }
    };
}

pub(crate) use define_fast_corners;

//! Triangles without area: three corners on a line, to the last bit.
//!
//! The exact ray meets them nowhere but where it meets the edge of something else, or in a point
//! without a normal, and determinant tests reject them (a determinant of zero is a miss: Woop,
//! Benthin and Wald 2013). Rounding gives some of them an area, though, as seen along a ray. So
//! scenes keep them out, by corners that are NaN, which no test hits, at no cost per ray.
//!
//! All but those that close a seam: where a long edge meets two shorter ones in a corner on it, a
//! triangle without area is what makes the surface closed. Rounding moves that corner off the long
//! edge as seen along a ray, by an ulp, and the gap is what the triangle then covers.

use niwaki_core::{
    Triangle, TriangleMesh,
    glam::{DVec3, Vec3},
    to_u32,
};
use rayon::prelude::*;
use std::collections::HashMap;

/// Corners that nothing hits.
pub(crate) const NEVER_HIT: [Vec3; 3] = [Vec3::NAN; 3];

/// True if the corners lie on one line, or in a point. Exact.
#[inline]
pub(crate) fn is_flat(triangle: &Triangle) -> bool {
    // Differences and products have relative errors of 2⁻²⁴, unless they underflow.
    const ERROR: f32 = 1.0 / (1 << 20) as f32;
    let (e1, e2) = (triangle.v1 - triangle.v0, triangle.v2 - triangle.v0);
    let size = e1.abs().max_element() * e2.abs().max_element();
    let normal = e1.cross(e2).abs().max_element();
    // NaN, from an overflow, is not greater.
    let has_area = normal > size * ERROR + f32::MIN_POSITIVE && size <= f32::MAX;
    !has_area && on_a_line(triangle.vertices().map(|v| v.as_dvec3()))
}

/// [`is_flat`] in double precision: exact for scenes whose longest edge is near 1, apart from
/// coordinates below 2⁻⁴⁰⁰.
#[inline]
pub(crate) fn is_flat_double(corners: &[DVec3; 3]) -> bool {
    const ERROR: f64 = 1.0 / (1_u64 << 49) as f64;
    let [a, b, c] = *corners;
    let (e1, e2) = (b - a, c - a);
    let size = e1.abs().max_element() * e2.abs().max_element();
    let normal = e1.cross(e2).abs().max_element();
    let has_area = normal > size * ERROR + f64::MIN_POSITIVE && size <= f64::MAX;
    !has_area && on_a_line(*corners)
}

/// True if no projection along an axis has an area.
#[cold]
fn on_a_line([a, b, c]: [DVec3; 3]) -> bool {
    (0..3).all(|axis| {
        let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut sum = Expansion::default();
        for (p, q) in [(a, b), (b, c), (c, a)] {
            sum.add_product(p[x], q[y]);
            sum.add_product(-p[y], q[x]);
        }
        sum.is_zero()
    })
}

/// A sum of products without rounding, as an expansion of parts that do not overlap (Shewchuk
/// 1997, grow-expansion).
#[derive(Default)]
struct Expansion {
    parts: [f64; 12],
    len: usize,
}

impl Expansion {
    fn add_product(&mut self, a: f64, b: f64) {
        let product = a * b;
        self.add(a.mul_add(b, -product));
        self.add(product);
    }

    fn add(&mut self, term: f64) {
        let mut carry = term;
        for part in &mut self.parts[..self.len] {
            let sum = carry + *part;
            let of_part = sum - carry;
            *part = (carry - (sum - of_part)) + (*part - of_part);
            carry = sum;
        }
        self.parts[self.len] = carry;
        self.len += 1;
    }

    fn is_zero(&self) -> bool {
        self.parts.iter().all(|&part| part == 0.0)
    }
}

/// A position by the bits of its coordinates, without negative zeros.
type Corner = [u64; 3];

/// The third corners of the triangles that share an edge.
#[derive(Clone, Copy, Default)]
struct Users {
    first: Option<Corner>,
    /// There is one that differs from the first.
    others: bool,
}

/// Those of the `flat` triangles of a mesh that close a seam, in ascending order.
pub(crate) fn closing(flat: &[u32], mesh: &TriangleMesh) -> Vec<u32> {
    let corner = |v: Vec3| v.to_array().map(|x| u64::from((x + 0.0).to_bits()));
    closing_among(flat, mesh.len(), |id| mesh.triangle(id).vertices().map(corner))
}

/// [`closing`] in double precision.
pub(crate) fn closing_double(flat: &[u32], triangles: &[[DVec3; 3]]) -> Vec<u32> {
    let corner = |v: DVec3| v.to_array().map(|x| (x + 0.0).to_bits());
    closing_among(flat, triangles.len(), |id| triangles[id].map(corner))
}

/// A triangle closes a seam if each of its edges is an edge of another, with another third corner.
fn closing_among(
    flat: &[u32],
    count: usize,
    corners: impl Fn(usize) -> [Corner; 3] + Sync,
) -> Vec<u32> {
    let mut edges: HashMap<(Corner, Corner), Users> = HashMap::new();
    let mut filter = Filter::default();
    for &id in flat {
        let corners = corners(id as usize);
        if is_distinct(&corners) {
            edges.extend(edges_of(&corners).map(|(edge, _)| (edge, Users::default())));
            corners.iter().for_each(|corner| filter.add(corner));
        }
    }
    if edges.is_empty() {
        return Vec::new();
    }
    let may_share = |id: &u32| {
        corners(*id as usize).iter().filter(|corner| filter.may_have(corner)).count() >= 2
    };
    let candidates: Vec<u32> =
        (0..to_u32(count)).into_par_iter().with_min_len(1 << 12).filter(may_share).collect();
    for id in candidates {
        let corners = corners(id as usize);
        if !is_distinct(&corners) {
            continue;
        }
        for (edge, third) in edges_of(&corners) {
            if let Some(users) = edges.get_mut(&edge) {
                users.others |= *users.first.get_or_insert(third) != third;
            }
        }
    }
    let closes = |id: &u32| {
        let corners = corners(*id as usize);
        is_distinct(&corners)
            && edges_of(&corners).iter().all(|(edge, _)| edges.get(edge).is_some_and(|u| u.others))
    };
    let mut closing: Vec<u32> = flat.iter().copied().filter(closes).collect();
    closing.sort_unstable();
    closing.dedup();
    closing
}

fn is_distinct([a, b, c]: &[Corner; 3]) -> bool {
    a != b && b != c && c != a
}

/// The edges, each with the corner opposite.
fn edges_of([a, b, c]: &[Corner; 3]) -> [((Corner, Corner), Corner); 3] {
    let edge = |p: &Corner, q: &Corner| (*p.min(q), *p.max(q));
    [(edge(a, b), *c), (edge(b, c), *a), (edge(c, a), *b)]
}

/// Tells most corners from those that were added, at once.
struct Filter(Vec<u64>);

impl Default for Filter {
    fn default() -> Self {
        Self(vec![0; 1 << 12])
    }
}

impl Filter {
    /// Word and bit of a corner.
    fn place([x, y, z]: &Corner) -> (usize, u64) {
        let mixed = x.wrapping_mul(0x9e37_79b9_7f4a_7c15)
            ^ y.wrapping_mul(0xc2b2_ae3d_27d4_eb4f).rotate_left(21)
            ^ z.wrapping_mul(0x1656_67b1_9e37_79f9).rotate_left(42);
        let hash = mixed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((hash >> 52) as usize, 1 << (hash >> 46 & 63))
    }

    fn add(&mut self, corner: &Corner) {
        let (word, bit) = Self::place(corner);
        self.0[word] |= bit;
    }

    fn may_have(&self, corner: &Corner) -> bool {
        let (word, bit) = Self::place(corner);
        self.0[word] & bit != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// By integers: coordinates are `mantissa · 2^exponent` with exponents from 0 to 32.
    fn is_flat_by_integers(corners: [[(i32, u32); 3]; 3]) -> bool {
        let [a, b, c] = corners.map(|v| v.map(|(m, e)| i128::from(m) << e));
        (0..3).all(|axis| {
            let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
            (b[x] - a[x]) * (c[y] - a[y]) == (b[y] - a[y]) * (c[x] - a[x])
        })
    }

    fn triangle(corners: [[(i32, u32); 3]; 3], scale: f32) -> Triangle {
        let [a, b, c] = corners
            .map(|v| Vec3::from(v.map(|(m, e)| m as f32 * 2.0_f32.powi(e.cast_signed()) * scale)));
        Triangle::new(a, b, c)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4_000))]

        #[test]
        fn flatness_is_exact(
            start in prop::array::uniform3((-0x7f_ffff..0x7f_ffff, 0_u32..32)),
            step in prop::array::uniform3(-5_i32..6),
            (j, k) in (-9_i32..10, -9_i32..10),
            change in (0_usize..3, 0_usize..3, -1_i32..2),
            power in -110_i32..60,
        ) {
            // Steps of the last bit where mantissas are large: as near to a line as can be.
            let at = |n: i32| [0, 1, 2].map(|i| (start[i].0 + step[i] * n, start[i].1));
            let mut corners = [at(0), at(j), at(k)];
            corners[change.0][change.1].0 += change.2;
            let expected = is_flat_by_integers(corners);
            let flat = triangle(corners, 2.0_f32.powi(power));
            prop_assert_eq!(is_flat(&flat), expected);
            prop_assert_eq!(is_flat_double(&flat.vertices().map(|v| v.as_dvec3())), expected);
        }
    }

    #[test]
    fn sizes_from_denormal_to_huge() {
        let corners = [[(1, 0); 3], [(5, 0), (1, 0), (1, 0)], [(2, 0), (3, 0), (1, 0)]];
        let line = [[(1, 0); 3], [(5, 0); 3], [(2, 0); 3]];
        for power in [-149, -140, -126, -80, 0, 80, 120] {
            let scale = 2.0_f32.powi(power.max(-126)) * 2.0_f32.powi((power + 126).min(0));
            assert!(!is_flat(&triangle(corners, scale)), "{power}");
            assert!(is_flat(&triangle(line, scale)), "{power}");
        }
    }

    #[test]
    fn a_seam_is_closed_where_all_edges_have_other_users() {
        let [a, b, m] = [0.0, 2.0, 1.0].map(|x| Vec3::new(x, 0.0, 0.0));
        let (up, down) = (Vec3::Y, -Vec3::Y);
        let all = [[a, b, m], [a, m, up], [m, b, up], [b, a, down]];
        let mesh = |triangles: &[[Vec3; 3]]| {
            let triangles: Vec<_> =
                triangles.iter().map(|&[a, b, c]| Triangle::new(a, b, c)).collect();
            TriangleMesh::from_triangles(&triangles).unwrap()
        };
        assert_eq!(closing(&[0], &mesh(&all)), [0]);
        let negative = all.map(|t| t.map(|v| Vec3::new(v.x, v.y, -0.0)));
        assert_eq!(closing(&[0], &mesh(&[&all[..1], &negative[1..]].concat())), [0]);
        for missing in 1..4 {
            let rest: Vec<_> = (0..4).filter(|&i| i != missing).map(|i| all[i]).collect();
            assert!(closing(&[0], &mesh(&rest)).is_empty());
        }
        // Copies of it, however they are turned, are no neighbours.
        assert!(closing(&[0, 1, 2], &mesh(&[[a, b, m], [b, m, a], [b, a, m]])).is_empty());
        // Two corners on an edge take two triangles, which share an edge.
        let n = Vec3::new(1.5, 0.0, 0.0);
        let chain = [[a, b, m], [m, b, n], [a, m, up], [m, n, up], [n, b, up], [b, a, down]];
        assert_eq!(closing(&[0, 1], &mesh(&chain)), [0, 1]);
    }
}

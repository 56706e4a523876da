//! Split clipping is conservative: the two boxes cover the clipped parts, against exact
//! rational arithmetic (stricter than `f64`, whose own rounding long thin triangles magnify).

use glam::Vec3;
use niwaki_core::{Aabb, Clip, PrimRef, Triangle, TriangleMesh};
use num_rational::BigRational;
use proptest::prelude::*;

fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => -10.0_f32..10.0,
        1 => (-30_i32..30, -1.0_f32..1.0).prop_map(|(e, m)| m * 10.0_f32.powi(e)),
        1 => (0_i32..6).prop_map(|i| i as f32),
        1 => (-8.0_f32..8.0).prop_map(|x| x + 1e7),
    ]
}

fn triangle() -> impl Strategy<Value = Triangle> {
    prop::array::uniform9(coordinate()).prop_map(|c| {
        Triangle::new(
            Vec3::from_slice(&c[0..3]),
            Vec3::from_slice(&c[3..6]),
            Vec3::from_slice(&c[6..9]),
        )
    })
}

type Exact = BigRational;
type Point = [Exact; 3];

fn exact(x: f32) -> Exact {
    BigRational::from_float(x).expect("finite")
}

fn polygon(t: &Triangle) -> Vec<Point> {
    t.vertices().iter().map(|v| v.to_array().map(exact)).collect()
}

/// The corners of the part of the polygon below or above the plane.
fn clip(polygon: &[Point], axis: usize, plane: f32, above: bool) -> Vec<Point> {
    let plane = exact(plane);
    let zero = Exact::from_integer(0.into());
    let height = |p: &Point| if above { &p[axis] - &plane } else { &plane - &p[axis] };
    let mut out = Vec::new();
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        let (da, db) = (height(a), height(b));
        if da >= zero {
            out.push(a.clone());
        }
        if (da < zero && db > zero) || (da > zero && db < zero) {
            let t = &da / (&da - &db);
            out.push(std::array::from_fn(|k| &a[k] + (&b[k] - &a[k]) * &t));
        }
    }
    out
}

fn covers(b: &Aabb, p: &Point) -> bool {
    !b.is_empty() && (0..3).all(|k| exact(b.min[k]) <= p[k] && p[k] <= exact(b.max[k]))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3_000))]

    #[test]
    fn both_boxes_cover_their_parts(t in triangle(), axis in 0_usize..3, f in -0.1_f32..1.1) {
        let bounds = t.bounds();
        let position = bounds.min[axis] + (bounds.max[axis] - bounds.min[axis]) * f;
        let (lower, upper) = t.split(&bounds, axis, position);
        for p in clip(&polygon(&t), axis, position, false) {
            prop_assert!(covers(&lower, &p), "{p:?} outside {lower:?}");
        }
        for p in clip(&polygon(&t), axis, position, true) {
            prop_assert!(covers(&upper, &p), "{p:?} outside {upper:?}");
        }
        prop_assert!(bounds.contains(&lower) && bounds.contains(&upper));
        // No box reaches over the plane, and none is larger than it need be by more than a bit.
        prop_assert!(lower.is_empty() || lower.max[axis] <= position);
        prop_assert!(upper.is_empty() || upper.min[axis] >= position);
    }

    #[test]
    fn repeated_splits_keep_covering_and_stay_inside(t in triangle(), cuts in prop::collection::vec((0_usize..3, 0.0_f32..1.0), 1..6)) {
        // Follow one side in turn; compare with the exact polygon clipped by the same planes.
        let mut b = t.bounds();
        let mut part = polygon(&t);
        for (i, (axis, f)) in cuts.into_iter().enumerate() {
            let position = b.min[axis] + (b.max[axis] - b.min[axis]) * f;
            let (lower, upper) = t.split(&b, axis, position);
            let above = i % 2 == 1;
            let next = if above { upper } else { lower };
            part = clip(&part, axis, position, above);
            for p in &part {
                prop_assert!(covers(&next, p), "{p:?} outside {next:?}");
            }
            if next.is_empty() {
                break;
            }
            prop_assert!(b.contains(&next));
            b = next;
        }
    }

    #[test]
    fn shared_edges_are_cut_alike(t in triangle(), axis in 0_usize..3, f in 0.0_f32..1.0) {
        // Two flat triangles on one edge: the crossing of that edge must not depend on winding.
        let (a, b) = (t.v0, t.v1);
        let flat = Triangle::new(a, b, a);
        let turned = Triangle::new(b, a, b);
        let bounds = flat.bounds();
        let position = bounds.min[axis] + (bounds.max[axis] - bounds.min[axis]) * f;
        prop_assert_eq!(flat.split(&bounds, axis, position), turned.split(&bounds, axis, position));
    }
}

#[test]
fn a_plane_through_a_corner_or_beside_the_triangle() {
    let t = Triangle::new(Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), Vec3::new(1.0, 1.0, 0.0));
    let (lower, upper) = t.split(&t.bounds(), 0, 1.0);
    assert_eq!(lower, Aabb::new(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
    assert_eq!(upper, Aabb::new(Vec3::new(1.0, 0.0, 0.0), Vec3::new(2.0, 1.0, 0.0)));
    let (lower, upper) = t.split(&t.bounds(), 0, 5.0);
    assert_eq!((lower, upper), (t.bounds(), Aabb::EMPTY));
}

/// Hands on [`Clip::clip`] alone, so that parts are chopped one after the other.
struct OneByOne<'a>(&'a TriangleMesh);

impl Clip for OneByOne<'_> {
    fn clip(&self, prim: &PrimRef, axis: usize, position: f32) -> [Aabb; 2] {
        self.0.clip(prim, axis, position)
    }
}

proptest! {
    /// Chopping all at once gives the parts that exact clipping gives, but for rounding.
    #[test]
    fn chopped_parts_are_the_clipped_ones(
        corners in prop::array::uniform9(-1.0_f32..1.0),
        axis in 0_usize..3,
        mut positions in prop::collection::vec(-1.0_f32..1.0, 1..8),
    ) {
        positions.sort_by(f32::total_cmp);
        let [a, b, c] = [0, 3, 6].map(|i| Vec3::from_slice(&corners[i..i + 3]));
        let mesh = TriangleMesh::from_triangles(&[Triangle::new(a, b, c)]).unwrap();
        let prim = mesh.prim_refs()[0];
        let mut exact = vec![None; positions.len() + 1];
        OneByOne(&mesh).chop(&prim, axis, &positions, |i, part| exact[i] = Some(part));
        let mut chopped = exact.clone();
        chopped.fill(None);
        mesh.chop(&prim, axis, &positions, |i, part| chopped[i] = Some(part));
        // An edge that is nearly parallel to the plane is cut nowhere in particular.
        let edges = [a - b, b - c, c - a];
        prop_assume!(edges.iter().all(|e| e[axis].abs() > 1e-2));
        for (exact, chopped) in exact.iter().zip(&chopped) {
            match (exact, chopped) {
                (Some(exact), Some(chopped)) => {
                    for (e, c) in exact.iter().zip(chopped) {
                        prop_assert!((e.truncate() - c.truncate()).abs().max_element() < 1e-4);
                    }
                }
                (None, None) => {}
                // Parts no wider than rounding may be left out.
                (Some([low, high]), None) | (None, Some([low, high])) => {
                    prop_assert!((*high - *low)[axis].abs() < 1e-5);
                }
            }
        }
    }
}

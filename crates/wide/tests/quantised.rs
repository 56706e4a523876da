//! Quantised boxes contain those that they were made from, in exact arithmetic, and not much more.

use niwaki_core::{Aabb, Bvh, BvhNode, glam::Vec3};
use niwaki_hard_cases::{self as hard, median_tree};
use niwaki_wide::{CollapseSettings, QuantisedNode, WideBvh, WideNode};
use proptest::prelude::*;
use std::cmp::Ordering;

/// `origin + step·scale` compared with `x`, exactly.
fn compare(origin: f32, step: u8, scale: f32, x: f32) -> Ordering {
    // The product is exact, and the sum is that of two numbers (Knuth's two-sum).
    let (a, b) = (f64::from(origin), f64::from(step) * f64::from(scale));
    let sum = a + b;
    let b_part = sum - a;
    let error = (a - (sum - b_part)) + (b - b_part);
    // Not by `total_cmp`, for which −0.0 differs from 0.0; nothing is NaN.
    let compare = |a: f64, b: f64| a.partial_cmp(&b).unwrap();
    compare(sum, f64::from(x)).then(compare(error, 0.0))
}

/// Asserts all that is promised of a node whose boxes are proper ones.
fn check<const W: usize>(node: &WideNode<W>) {
    let quantised = QuantisedNode::from(node);
    assert_eq!(quantised.used(), node.used);
    assert_eq!(quantised.children, node.children);
    for axis in 0..3 {
        let (origin, scale) = (quantised.origin[axis], quantised.scale[axis]);
        assert!(scale.abs() >= f32::MIN_POSITIVE && scale.is_finite(), "{scale}");
        let down = scale < 0.0;
        let used = node.used as usize;
        let first = node.bounds[2 * axis][..used].iter().fold(f32::INFINITY, |a, b| a.min(*b));
        let last = node.bounds[2 * axis + 1][..used].iter().fold(-f32::INFINITY, |a, b| a.max(*b));
        assert_eq!(origin, if down { last } else { first });
        let extent = f64::from(last) - f64::from(first);
        // The scale is the extent's 255th part, but for rounding and the bits of `used`.
        if extent > 0.0 {
            assert!(f64::from(scale.abs()) * 255.0 <= extent * (1.0 + 2.0_f64.powi(-17)) + 1e-35);
        }
        for slot in 0..W {
            let [min, max] = [0, 1].map(|row| quantised.planes[2 * axis + row][slot]);
            if slot >= used {
                assert_eq!([min, max], if down { [0, 255] } else { [255, 0] });
                assert_eq!(quantised.child(slot), None);
                assert_eq!(quantised.aabb(slot), Aabb::EMPTY);
                continue;
            }
            let [lower, upper] = [0, 1].map(|row| node.bounds[2 * axis + row][slot]);
            assert_ne!(compare(origin, min, scale, lower), Ordering::Greater);
            assert_ne!(compare(origin, max, scale, upper), Ordering::Less);
            // No step is given away.
            let inward =
                |step: u8, by: i16| u8::try_from(i16::from(step) + if down { -by } else { by });
            let is_above = |q| compare(origin, q, scale, lower) == Ordering::Greater;
            let is_below = |q| compare(origin, q, scale, upper) == Ordering::Less;
            assert!(
                inward(min, 1).map_or(true, is_above) && inward(max, -1).map_or(true, is_below)
            );
            let (outer, inner) = (quantised.aabb(slot), node.aabb(slot));
            assert!(outer.contains(&inner), "{outer:?} {inner:?}");
        }
    }
    for slot in 0..W {
        assert_eq!(quantised.child(slot), node.child(slot));
    }
}

fn check_tree<const W: usize>(bvh: &Bvh) {
    let wide = WideBvh::<W>::collapse(bvh, &CollapseSettings::default()).unwrap();
    wide.nodes().iter().for_each(check);
}

#[test]
fn boxes_of_every_hard_case_are_contained() {
    for case in hard::meshes() {
        let bvh = median_tree(&case.mesh, 1);
        check_tree::<4>(&bvh);
        check_tree::<8>(&bvh);
        check_tree::<16>(&bvh);
    }
}

/// A tree of one wide node with these boxes.
fn node_of(boxes: &[Aabb]) -> WideNode<8> {
    let all = boxes.iter().fold(Aabb::EMPTY, |a, b| a.union(*b));
    let mut nodes = vec![BvhNode::inner(all, 1)];
    for (i, bounds) in (0..).zip(boxes) {
        // A chain: each inner node has a leaf and the rest.
        let leaf = BvhNode::leaf(*bounds, i, 1);
        nodes.push(leaf);
        if i as usize + 2 == boxes.len() {
            nodes.push(BvhNode::leaf(boxes[boxes.len() - 1], i + 1, 1));
            break;
        }
        let next = nodes.len() + 1;
        nodes.push(BvhNode::inner(all, u32::try_from(next).unwrap()));
    }
    let count = u32::try_from(boxes.len()).unwrap();
    let bvh = Bvh { nodes, prim_ids: (0..count).collect() };
    let settings = CollapseSettings { max_leaf: 1, ..CollapseSettings::greedy() };
    let wide = WideBvh::<8>::collapse(&bvh, &settings).unwrap();
    assert_eq!(wide.nodes().len(), 1);
    wide.nodes()[0]
}

#[test]
fn what_lies_on_the_first_plane_stays_exact_and_flat() {
    let flat = |x: f32| Aabb::new(Vec3::new(x, 5.0, 1.0), Vec3::new(x, 5.0, 2.0));
    let node = QuantisedNode::from(&node_of(&[flat(0.25), flat(7.0)]));
    assert_eq!((node.planes[0][0], node.planes[1][0]), (0, 0));
    assert_eq!((node.planes[2][1], node.planes[3][1]), (0, 0));
    assert_eq!(node.origin, [0.25, 5.0, 1.0]);
    // More of the flat boxes are on the last plane.
    let wide = Aabb::new(Vec3::new(7.3, 0.0, 1.0), Vec3::new(7.3, 9.0, 2.0));
    let node = QuantisedNode::from(&node_of(&[flat(0.1), wide, flat(1.0)]));
    assert!(node.scale[0] < 0.0 && node.origin[0] == 7.3);
    let slot = (0..3).find(|&slot| node.aabb(slot).contains(&wide)).unwrap();
    assert_eq!((node.planes[0][slot], node.planes[1][slot]), (0, 0));
    // One point.
    let point = Aabb::new(Vec3::splat(-3.0), Vec3::splat(-3.0));
    let node = QuantisedNode::from(&node_of(&[point, point]));
    assert_eq!(node.planes.map(|row| [row[0], row[1]]), [[0; 2]; 6]);
}

#[test]
fn boxes_that_are_no_boxes_do_no_harm() {
    let good = Aabb::new(Vec3::ZERO, Vec3::ONE);
    let mut node = node_of(&[good, good, good]);
    node.bounds[0][1] = f32::NEG_INFINITY;
    node.bounds[3][1] = f32::NAN;
    node.bounds[4][2] = f32::INFINITY;
    let quantised = QuantisedNode::from(&node);
    assert!(quantised.aabb(0).contains(&good) && quantised.aabb(1).contains(&good));
    assert!(quantised.planes[0][2] > quantised.planes[1][2]);
    assert_eq!(quantised.used(), 3);
    // A count that is none.
    node.used = 99;
    assert!(QuantisedNode::from(&node).used() <= 31);
}

fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        -1.0_f32..1.0,
        (-3_i32..4).prop_map(|i| i as f32),
        (-1.0_f32..1.0, -126_i32..127).prop_map(|(x, e)| x * 2.0_f32.powi(e)),
        any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |x| x.is_finite()),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4_000))]

    #[test]
    fn any_boxes_are_contained(
        corners in prop::collection::vec(
            (prop::array::uniform3(coordinate()), prop::array::uniform3(coordinate())), 2..=8),
        offset in coordinate(),
        shrink in -40_i32..1,
    ) {
        let at = |c: [f32; 3]| {
            let p = Vec3::from(c) * 2.0_f32.powi(shrink) + Vec3::splat(offset);
            p.clamp(Vec3::splat(-f32::MAX), Vec3::splat(f32::MAX))
        };
        let boxes: Vec<Aabb> =
            corners.iter().map(|&(a, b)| Aabb::new(at(a).min(at(b)), at(a).max(at(b)))).collect();
        check(&node_of(&boxes));
    }
}

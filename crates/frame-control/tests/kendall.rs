//! Kendall's tau against its definition over all pairs.

use niwaki_frame_control::kendall_tau_b;
use proptest::prelude::*;

/// τ-b by looking at every pair.
fn by_pairs(x: &[f64], y: &[f64]) -> Option<f64> {
    let (mut agree, mut in_x, mut in_y) = (0.0, 0.0_f64, 0.0_f64);
    for i in 0..x.len() {
        for j in 0..i {
            let sign = |v: &[f64]| f64::from(v[i] > v[j]) - f64::from(v[i] < v[j]);
            agree += sign(x) * sign(y);
            in_x += sign(x).abs();
            in_y += sign(y).abs();
        }
    }
    (in_x * in_y > 0.0).then(|| agree / (in_x * in_y).sqrt())
}

/// The example in SciPy's documentation of `kendalltau`.
#[test]
fn published_value() {
    let tau = kendall_tau_b(&[12.0, 2.0, 1.0, 12.0, 2.0], &[1.0, 4.0, 7.0, 1.0, 0.0]).unwrap();
    assert!((tau + 0.471_404_520_791_031_7).abs() < 1e-15, "{tau}");
}

#[test]
fn no_order_no_correlation() {
    assert_eq!(kendall_tau_b(&[], &[]), None);
    assert_eq!(kendall_tau_b(&[1.0], &[1.0]), None);
    assert_eq!(kendall_tau_b(&[1.0, 2.0], &[1.0]), None);
    assert_eq!(kendall_tau_b(&[1.0, f64::NAN], &[1.0, 2.0]), None);
    assert_eq!(kendall_tau_b(&[0.0, -0.0], &[1.0, 2.0]), None, "zeros of both signs tie");
    let inf = f64::INFINITY;
    assert_eq!(kendall_tau_b(&[-inf, 0.0, inf], &[1.0, 2.0, 3.0]), Some(1.0));
}

proptest! {
    #[test]
    fn agrees_with_all_pairs(pairs in prop::collection::vec((-6_i32..6, -6_i32..6), 0..80)) {
        let x: Vec<f64> = pairs.iter().map(|p| f64::from(p.0)).collect();
        let y: Vec<f64> = pairs.iter().map(|p| f64::from(p.1)).collect();
        match (kendall_tau_b(&x, &y), by_pairs(&x, &y)) {
            (Some(a), Some(b)) => prop_assert!((a - b).abs() < 1e-12, "{a} {b}"),
            (a, b) => prop_assert_eq!(a, b),
        }
    }
}

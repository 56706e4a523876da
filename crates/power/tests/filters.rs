//! Filters against SciPy 1.17, and the stream against the whole signal.

#![cfg(feature = "analysis")]

use niwaki_power::{Butterworth, Decimated, Decimator, PowerBlock, ZeroPhase};
use proptest::prelude::*;

/// Coefficients of the product of all sections.
fn transfer(filter: &Butterworth) -> (Vec<f64>, Vec<f64>) {
    let times = |p: &[f64], q: &[f64]| {
        let mut product = vec![0.0; p.len() + q.len() - 1];
        for (i, a) in p.iter().enumerate() {
            for (j, b) in q.iter().enumerate() {
                product[i + j] += a * b;
            }
        }
        product
    };
    filter.sections().iter().fold((vec![1.0], vec![1.0]), |(b, a), section| {
        (times(&b, &section.b), times(&a, &[1.0, section.a[0], section.a[1]]))
    })
}

#[test]
fn designs_are_those_of_scipy() {
    // scipy.signal.butter(order, cutoff), cutoff relative to half the rate.
    let cases: [(u32, f64, &[f64], &[f64]); 3] = [
        (
            4,
            0.1,
            &[
                0.00041659920440659937,
                0.0016663968176263975,
                0.002499595226439596,
                0.0016663968176263975,
                0.00041659920440659937,
            ],
            &[1.0, -3.180638548874719, 3.8611943489942133, -2.112155355110969, 0.43826514226197977],
        ),
        (
            5,
            0.25,
            &[
                0.003279216306360205,
                0.016396081531801027,
                0.03279216306360205,
                0.03279216306360205,
                0.016396081531801027,
                0.003279216306360205,
            ],
            &[
                1.0,
                -2.4744161749781632,
                2.8110063119115827,
                -1.7037722409154687,
                0.5444326948885343,
                -0.07231566910295853,
            ],
        ),
        (
            2,
            0.05,
            &[0.005542717210280682, 0.011085434420561363, 0.005542717210280682],
            &[1.0, -1.7786317778245846, 0.8008026466657073],
        ),
    ];
    for (order, cutoff, b, a) in cases {
        let (found_b, found_a) = transfer(&Butterworth::low_pass(order, cutoff, 2.0).unwrap());
        for (found, expected) in found_b.iter().zip(b).chain(found_a.iter().zip(a)) {
            assert!((found - expected).abs() < 1e-13, "{order}: {found} {expected}");
        }
        // An odd order ends with a section of first order, whose last coefficients are 0.
        assert!(found_b[b.len()..].iter().chain(&found_a[a.len()..]).all(|x| *x == 0.0));
    }
}

#[test]
fn both_ways_is_sosfiltfilt_without_padding() {
    let x: Vec<f64> = (0..64)
        .map(|i| {
            f64::from(i * 37 % 101) / 101.0 * 10.0 + if (20..40).contains(&i) { 50.0 } else { 0.0 }
        })
        .collect();
    // scipy.signal.sosfiltfilt(butter(4, 0.1, output='sos'), x, padtype=None)[::7]
    let expected = [
        3.05343266880803,
        2.693461482465161,
        6.60638863904827,
        36.78404376608694,
        61.46923726627338,
        50.68666130344116,
        16.681677294619192,
        1.8761005633332044,
        4.026097315755573,
        4.5268808810231995,
    ];
    let y = Butterworth::low_pass(4, 0.1, 2.0).unwrap().filter_both_ways(&x);
    for (found, expected) in y.iter().step_by(7).zip(expected) {
        assert!((found - expected).abs() < 1e-10, "{found} {expected}");
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    for (order, cutoff, rate) in [
        (0, 1.0, 10.0),
        (17, 1.0, 10.0),
        (4, 0.0, 10.0),
        (4, 5.0, 10.0),
        (4, f64::NAN, 10.0),
        (4, 1.0, f64::INFINITY),
    ] {
        assert!(Butterworth::low_pass(order, cutoff, rate).is_err(), "{order} {cutoff} {rate}");
    }
    let filter = Butterworth::low_pass(4, 1.0, 10.0).unwrap();
    assert!(ZeroPhase::new(filter, 0.0).is_err());
    assert!(Decimator::new(0).is_err());
    // Hours to settle, at this rate.
    let slow = Butterworth::low_pass(2, 1e-4, 40e3).unwrap();
    assert!(ZeroPhase::new(slow, 1e-6).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_stream_is_as_good_as_the_whole(
        order in 1u32..=8,
        cutoff in 0.01f64..0.45,
        tolerance in prop::sample::select(vec![1e-3, 1e-6, 1e-9]),
        seed in any::<u64>(),
        count in 1usize..30_000,
    ) {
        let filter = Butterworth::low_pass(order, cutoff, 1.0).unwrap();
        let mut random = fastrand::Rng::with_seed(seed);
        // Steps and noise: the worst that power does.
        let mut level = 100.0;
        let x: Vec<f64> = (0..count)
            .map(|_| {
                if random.u32(..200) == 0 {
                    level = 300.0 * random.f64();
                }
                level + 20.0 * random.f64()
            })
            .collect();
        let expected = filter.filter_both_ways(&x);
        let mut stream = ZeroPhase::new(filter, tolerance).unwrap();
        let mut y = Vec::new();
        let mut rest = &x[..];
        while !rest.is_empty() {
            let (now, later) = rest.split_at(random.usize(1..=rest.len().min(5000)));
            stream.push(now, &mut y);
            rest = later;
        }
        stream.finish(&mut y);
        prop_assert_eq!(y.len(), x.len());
        prop_assert!(stream.error_bound() <= tolerance);
        let range = x.iter().copied().fold(f64::MIN, f64::max) - x.iter().copied().fold(f64::MAX, f64::min);
        // And some room for rounding.
        let bound = stream.error_bound() * range + 1e-9 * range.max(1.0);
        for (a, b) in y.iter().zip(&expected) {
            prop_assert!((a - b).abs() <= bound, "{} {} {}", a, b, bound);
        }
    }
}

#[test]
fn decimation_keeps_time_and_level_and_stops_aliases() {
    let rows = 400_000i64;
    // 5 Hz within, 1.3 kHz which would alias to somewhere, at 40 kHz.
    let watts = |i: i64| {
        let t = i as f64 / 40e3;
        100.0 + 10.0 * (31.4159 * t).sin() + 30.0 * (8168.14 * t).sin()
    };
    let mut decimator = Decimator::new(512).unwrap();
    assert_eq!(decimator.factor(), 512);
    let mut out = Decimated::default();
    for start in (0..rows).step_by(9973) {
        let range = start..(start + 9973).min(rows);
        let block = PowerBlock {
            times_ns: range.clone().map(|i| i * 25_000).collect(),
            #[expect(clippy::cast_possible_truncation, reason = "what the trace holds")]
            watts: range.map(|i| watts(i) as f32).collect(),
            ..PowerBlock::default()
        };
        decimator.push(&block, &mut out);
    }
    decimator.flush(&mut out);
    assert_eq!(out.times_ns.len(), 400_000usize.div_ceil(512));
    for (i, (&time, watts)) in out.times_ns.iter().zip(&out.watts).enumerate() {
        assert_eq!(time, i as i64 * 512 * 25_000);
        let expected = 100.0 + 10.0 * (31.4159 * time as f64 * 1e-9).sin();
        // Ends see half of the signal only.
        if (10..out.watts.len() - 10).contains(&i) {
            assert!((watts - expected).abs() < 0.3, "{i}: {watts} {expected}");
        }
    }
}

//! What the cost model chooses, whatever its numbers.

use niwaki_presets::{BuildCost, CostModel, Preset, RayCost};
use proptest::prelude::*;

/// Models that no machine would give, too.
fn models() -> impl Strategy<Value = CostModel> {
    let line = (-50.0_f64..500.0, 0.0_f64..100.0).prop_map(|(base, doubling)| BuildCost {
        base,
        doubling,
        residual: 0.1,
    });
    let ratio = (0.1_f64..2.0).prop_map(|ratio| RayCost { ratio, spread: 1.1 });
    (prop::array::uniform5(line.clone()), line, prop::array::uniform5(ratio))
        .prop_map(|(builds, ray, rays)| CostModel { builds, ray, rays })
}

proptest! {
    #[test]
    fn the_choice_has_the_least_total(
        model in models(),
        rays in 0_u64..1 << 50,
        triangles in 0_usize..100_000_000,
    ) {
        let chosen = model.total_ms(model.best(rays, triangles), rays, triangles);
        for preset in Preset::ALL {
            prop_assert!(chosen <= model.total_ms(preset, rays, triangles), "{}", preset);
        }
    }

    #[test]
    fn more_rays_never_choose_slower_rays(
        model in models(),
        fewer in 0_u64..1 << 50,
        more in 0_u64..1 << 50,
        triangles in 0_usize..100_000_000,
    ) {
        let (fewer, more) = (fewer.min(more), fewer.max(more));
        let [a, b] = [fewer, more].map(|rays| model.best(rays, triangles));
        let [slow, fast] = [a, b].map(|preset| model.ray_ns(preset, triangles));
        // Sums of f64 may round a tie to either side.
        prop_assert!(fast <= slow * (1.0 + 1e-9), "{} then {}: {} then {} ns", a, b, slow, fast);
    }

    #[test]
    fn models_survive_a_file(model in models()) {
        let text = model.to_csv();
        let read = CostModel::from_csv(&text).unwrap();
        // Four decimals are kept, of which a second writing loses nothing.
        prop_assert_eq!(read.to_csv(), text);
        let count = 100_000;
        for preset in Preset::ALL {
            let (a, b) = (model.build_ms(preset, count), read.build_ms(preset, count));
            prop_assert!((a - b).abs() < 1e-3, "{}: {} and {}", preset, a, b);
        }
    }
}

//! The equations of section 4.3, by hand, and what holds of them.

use niwaki_gpu_model::{
    Constants, Device, Form, FrameModel, Instructions, KernelCounts, RaySettings, Workload,
    hong_kim::Model,
};
use proptest::prelude::*;

const COUNTS: KernelCounts = KernelCounts {
    compute_per_traversal: 38.0,
    compute_per_intersection: 23.0,
    compute_constant: 60.0,
    memory_per_traversal: 5.0,
    memory_per_intersection: 3.0,
    memory_constant: 4.0,
    bytes_per_memory_instruction: 16.0,
};

const VIEW: Workload = Workload {
    primary_traversals: 30.0,
    primary_intersections: 4.0,
    visible_triangles: 0.5,
    ao_traversals: 16.0,
    ao_intersections: 2.0,
    coalescing: 0.5,
    shadow_traversals: 7.0,
    shadow_intersections: 1.0,
    shadow_rays: 0.25,
    primary_divergence: 0.5,
    secondary_divergence: 2.0,
    samples: 576,
};

#[test]
fn the_equations_by_hand() {
    let settings = RaySettings { ao_rays: 8.0, shadows: false };
    let i = Instructions::of(&COUNTS, &VIEW, &settings, &Constants::default()).unwrap();
    // 38·(16·8 + 30) + 23·(4 + 2·0.5·8) + 60.
    assert_eq!(i.compute, 38.0 * 158.0 + 23.0 * 12.0 + 60.0);
    // (5·30 + 3·4 + 4)·(1 − 0.25).
    assert_eq!(i.initial_memory, 166.0 * 0.75);
    // a_t + p_t = 46 = 2·23: half is in the cache.
    assert_eq!(i.ao_cache, 0.5);
    // 0.5·(5·16·8 + 0.5·3·8/2).
    assert_eq!(i.ao_memory, 0.5 * (640.0 + 6.0));
    assert_eq!(i.uncoalesced, 124.5 * 0.5 + 323.0);
    assert_eq!(i.coalesced, 62.25);
    assert_eq!(i.memory(), 124.5 + 323.0);
}

#[test]
fn shadows_count_like_primary_rays() {
    let on = RaySettings { ao_rays: 0.0, shadows: true };
    let i = Instructions::of(&COUNTS, &VIEW, &on, &Constants::default()).unwrap();
    assert_eq!(i.compute, 38.0 * 37.0 + 23.0 * 5.0 + 60.0);
    assert_eq!(i.initial_memory, (5.0 * 37.0 + 3.0 * 5.0 + 4.0) * 0.75);
}

/// Kernels that trace one ray an invocation set each ray up.
#[test]
fn secondary_rays_have_a_set_up() {
    let settings = RaySettings { ao_rays: 8.0, shadows: true };
    let without = Instructions::of(&COUNTS, &VIEW, &settings, &Constants::default()).unwrap();
    let constants = Constants::for_single_rays(&COUNTS);
    let with = Instructions::of(&COUNTS, &VIEW, &settings, &constants).unwrap();
    // Half of the pixels send 8 AO rays, a quarter a shadow ray.
    assert_eq!(with.compute - without.compute, 60.0 * 4.25);
    assert_eq!(with.initial_memory - without.initial_memory, 4.0 * 0.25 * 0.75);
    assert_eq!(with.ao_memory - without.ao_memory, 0.5 * 4.0 * 4.0);
}

#[test]
fn few_traversals_are_all_in_the_cache() {
    let view = Workload { primary_traversals: 10.0, ao_traversals: 13.0, ..VIEW };
    let settings = RaySettings { ao_rays: 64.0, shadows: false };
    let i = Instructions::of(&COUNTS, &view, &settings, &Constants::default()).unwrap();
    assert_eq!((i.ao_cache, i.ao_memory), (0.0, 0.0));
}

/// An empty view costs its constant part, and is finite.
#[test]
fn an_empty_view_has_a_time() {
    let model = FrameModel::new(Device::builtin("geforce-8800").unwrap(), COUNTS, 640 * 480);
    let view = Workload::default();
    assert!(view.is_empty());
    let made = model.predict(&view, &RaySettings { ao_rays: 32.0, shadows: true }).unwrap();
    assert_eq!(made.instructions.compute, 60.0);
    assert!(made.seconds > 0.0 && made.seconds < 1.0);
}

#[test]
fn counters_that_overflow_and_nan_are_refused_by_name() {
    let model = FrameModel::new(Device::builtin("geforce-8800").unwrap(), COUNTS, 640 * 480);
    let settings = RaySettings::default();
    let message = |view: Workload| model.predict(&view, &settings).unwrap_err().to_string();
    let overflow = Workload { primary_traversals: u64::MAX as f64, ..VIEW };
    assert!(message(overflow).contains("primary_traversals"));
    assert!(message(Workload { coalescing: f64::NAN, ..VIEW }).contains("coalescing is NaN"));
    assert!(message(Workload { coalescing: 1.5, ..VIEW }).contains("between 0 and 1"));
    let absurd = RaySettings { ao_rays: f64::INFINITY, shadows: false };
    assert!(model.predict(&VIEW, &absurd).is_err());
}

proptest! {
    #[test]
    fn more_ao_rays_take_longer(
        a_t in 0.0..100.0, a_w in 0.0..50.0, p_t in 0.0..200.0, p_i in 0.0..50.0, t_v in 0.0..1.0,
        m in 0.0..1.0, rays in 0.0..64.0, more in 0.0..64.0,
        name in prop::sample::select(Device::builtin_names().collect::<Vec<_>>()),
    ) {
        let view = Workload {
            primary_traversals: p_t, primary_intersections: p_i, visible_triangles: t_v,
            ao_traversals: a_t, ao_intersections: a_w, coalescing: m, ..VIEW
        };
        // Settings change the mix of loads, which the published cases answer with jumps; the
        // instructions themselves are monotone, and so is time where the mix stays.
        let mut model = FrameModel::new(Device::builtin(name).unwrap(), COUNTS, 1 << 20);
        model.form = Form::HongKim(Model::continuous());
        let few = model.predict(&view, &RaySettings { ao_rays: rays, shadows: false }).unwrap();
        let many = model.predict(&view, &RaySettings { ao_rays: rays + more, shadows: false }).unwrap();
        prop_assert!(many.instructions.compute >= few.instructions.compute);
        prop_assert!(many.instructions.memory() >= few.instructions.memory());
        prop_assert!(few.seconds.is_finite() && few.seconds > 0.0);
        if m == 0.0 || few.instructions.coalesced == 0.0 {
            prop_assert!(many.seconds >= few.seconds * (1.0 - 1e-9));
        }
        // In every share of the cache that can be.
        prop_assert!((0.0..=1.0).contains(&few.instructions.ao_cache));
        let all = few.instructions.coalesced + few.instructions.uncoalesced;
        prop_assert!((all - few.instructions.memory()).abs() < 1e-9);
    }
}

/// Threads that wait for others compute as long as those.
#[test]
fn divergence_multiplies_computation() {
    let settings = RaySettings { ao_rays: 8.0, shadows: true };
    let with = |divergence| {
        let constants =
            Constants { divergence, compute_per_secondary_ray: 3.0, ..Constants::default() };
        Instructions::of(&COUNTS, &VIEW, &settings, &constants).unwrap()
    };
    let (none, half) = (with(0.0), with(0.5));
    let per_step = (COUNTS.compute_per_traversal, COUNTS.compute_per_intersection);
    let primary = per_step.0 * 30.0 + per_step.1 * 4.0;
    let rays = 0.5 * 8.0 + 0.25;
    let secondary =
        per_step.0 * (16.0 * 8.0 + 7.0) + per_step.1 * (2.0 * 0.5 * 8.0 + 1.0) + 3.0 * rays;
    let wanted = none.compute + 0.5 * (0.5 * primary + 2.0 * secondary);
    assert!((half.compute - wanted).abs() < 1e-9 * wanted, "{} {wanted}", half.compute);
    assert_eq!(half.memory(), none.memory());
    let bad = Constants { divergence: -1.0, ..Constants::default() };
    assert!(Instructions::of(&COUNTS, &VIEW, &settings, &bad).is_err());
}

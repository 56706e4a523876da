//! What holds for any device and any program.

use niwaki_gpu_model::{
    Device, ModelError, Program,
    hong_kim::{Case, CaseRule, Model, Parallelism},
    shortened,
};
use proptest::prelude::*;

fn device() -> impl Strategy<Value = Device> {
    (
        (0.1..4.0, 1.0..5000.0, 1_u32..200, prop::sample::select(vec![1_u32, 8, 32, 64])),
        (0.05..16.0, 10.0..2000.0, 0.01..100.0, 0.01..50.0, 1.0..64.0),
        (1_u32..33, 1_u32..65),
    )
        .prop_map(|((clock, bandwidth, cores, warp), (issue, latency, dc, du, n), (b, w))| {
            Device {
                name: "any".to_owned(),
                source: "proptest".to_owned(),
                clock_ghz: clock,
                bandwidth_gb_s: bandwidth,
                cores,
                warp_size: warp,
                issue_cycles: issue,
                memory_latency_cycles: latency,
                departure_delay_coalesced_cycles: dc,
                departure_delay_uncoalesced_cycles: du,
                transactions_per_uncoalesced_load: n,
                max_blocks_per_core: b,
                max_warps_per_core: w,
            }
        })
}

fn instructions() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), 0.001..1.0, 1.0..1e5]
}

fn program() -> impl Strategy<Value = Program> {
    (
        (instructions(), instructions(), instructions(), prop_oneof![Just(0.0), 0.0..100.0]),
        (1.0..4096.0, 1_u32..1025, 0_u64..1_000_000, 1_u32..33),
    )
        .prop_map(|((compute, coalesced, uncoalesced, barriers), (bytes, t, blocks, b))| {
            Program {
                compute_instructions: compute,
                coalesced_loads: coalesced,
                uncoalesced_loads: uncoalesced,
                synchronizations: barriers,
                bytes_per_warp_load: bytes,
                threads_per_block: t,
                blocks,
                blocks_per_core: b,
            }
        })
}

const RULES: [CaseRule; 3] = [CaseRule::Printed, CaseRule::ThreeCases, CaseRule::Continuous];

fn cycles(rule: CaseRule, device: &Device, program: &Program) -> f64 {
    Model { cases: rule }.predict(device, program).unwrap().execution.cycles
}

/// `a` is at most `b`, but for rounding.
fn at_most(a: f64, b: f64) -> bool {
    a <= b * (1.0 + 1e-9) + 1e-9
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn never_negative_and_finite(device in device(), program in program()) {
        for cases in RULES {
            let made = Model { cases }.predict(&device, &program).unwrap();
            let e = made.execution;
            for value in [
                e.cycles_without_barriers, e.barrier_cycles, e.cycles,
                made.seconds, made.cycles_per_instruction,
            ] {
                prop_assert!(value >= 0.0 && value.is_finite(), "{made:?}");
            }
            prop_assert!(made.parallelism.mwp > 0.0);
        }
        prop_assert!(shortened::predict(&device, &program).unwrap().seconds.is_finite());
    }

    #[test]
    fn the_shortened_form_is_the_full_one_without_barriers(device in device(), program in program()) {
        let short = shortened::predict(&device, &program).unwrap();
        let full = Model::three_cases().predict(&device, &program).unwrap();
        let (a, b) = (short.cycles, full.execution.cycles_without_barriers);
        prop_assert!((a - b).abs() <= 1e-9 * b.max(1e-9), "{a} {b}");
        prop_assert_eq!(short.case, full.execution.case);
    }

    /// Without jumps more work takes longer, whatever the work.
    #[test]
    fn the_continuous_model_is_monotone(device in device(), program in program(), factor in 1.0..20.0) {
        let base = cycles(CaseRule::Continuous, &device, &program);
        let more_compute =
            Program { compute_instructions: program.compute_instructions * factor + 1.0, ..program };
        prop_assert!(at_most(base, cycles(CaseRule::Continuous, &device, &more_compute)));
        let more_barriers =
            Program { synchronizations: program.synchronizations * factor + 1.0, ..program };
        prop_assert!(at_most(base, cycles(CaseRule::Continuous, &device, &more_barriers)));
        // Of the same mix, from one load on: below one, `Comp/#Mem` counts more computation than there is.
        let loads = Program {
            coalesced_loads: program.coalesced_loads * factor,
            uncoalesced_loads: program.uncoalesced_loads * factor,
            synchronizations: 0.0,
            ..program
        };
        let without = Program { synchronizations: 0.0, ..program };
        if program.memory_instructions() >= 1.0 {
            let (a, b) = (
                cycles(CaseRule::Continuous, &device, &without),
                cycles(CaseRule::Continuous, &device, &loads),
            );
            prop_assert!(at_most(a, b), "{a} {b}");
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and positive")]
        let blocks = (program.blocks as f64 * factor) as u64 + 1;
        let more_blocks = Program { blocks, ..without };
        let (a, b) = (
            cycles(CaseRule::Continuous, &device, &without),
            cycles(CaseRule::Continuous, &device, &more_blocks),
        );
        prop_assert!(at_most(a, b), "{a} {b} {without:?} {blocks}");
    }

    /// By three cases, more computation always takes longer; more loads may take less, by no more
    /// than the jump that the documentation states.
    #[test]
    fn three_cases_fall_by_the_jump_at_most(device in device(), program in program(), factor in 1.0..3.0) {
        let program = Program { synchronizations: 0.0, ..program };
        let base = cycles(CaseRule::ThreeCases, &device, &program);
        let more_compute =
            Program { compute_instructions: program.compute_instructions * factor + 0.1, ..program };
        prop_assert!(at_most(base, cycles(CaseRule::ThreeCases, &device, &more_compute)));
        if program.memory_instructions() >= 1.0 {
            let loads = Program {
                coalesced_loads: program.coalesced_loads * factor,
                uncoalesced_loads: program.uncoalesced_loads * factor,
                ..program
            };
            let after = cycles(CaseRule::ThreeCases, &device, &loads);
            let jump = Parallelism::of(&device, &loads).unwrap().jump();
            prop_assert!(at_most(base, after + jump), "{base} {after} {jump}");
        }
    }

    /// Where the cases meet: continuous where it is said to be, and a jump of the stated size where not.
    #[test]
    fn where_cases_meet(device in device(), program in program(), warps in 2_u32..64) {
        let device = Device { transactions_per_uncoalesced_load: 1.0, bandwidth_gb_s: 1e8, cores: 1, ..device };
        // N warps, one load each, repeated once: MWP is latency over departure delay, CWP 1 + Mem/Comp.
        let program = Program {
            coalesced_loads: 1.0, uncoalesced_loads: 0.0, synchronizations: 0.0,
            threads_per_block: device.warp_size, blocks: u64::from(warps), blocks_per_core: warps,
            compute_instructions: program.compute_instructions + 1.0, ..program
        };
        let n = f64::from(warps);
        let mem = device.memory_latency_cycles;
        let at = |mwp: f64, cwp: f64| {
            let device = Device {
                departure_delay_coalesced_cycles: mem / mwp,
                issue_cycles: mem / (cwp - 1.0) / program.total_instructions(),
                ..device.clone()
            };
            Parallelism::of(&device, &program).unwrap()
        };
        let e = 1e-7;
        // Memory to compute, at MWP = CWP < N.
        let meet = 1.0 + (n - 1.0) * 0.6;
        let (below, above) = (at(meet, meet * (1.0 + e)), at(meet, meet * (1.0 - e)));
        prop_assert_eq!(below.case(CaseRule::ThreeCases), Case::Memory);
        prop_assert_eq!(above.case(CaseRule::ThreeCases), Case::Compute);
        let step = |rule, a: &Parallelism, b: &Parallelism| b.execution(rule).cycles - a.execution(rule).cycles;
        let jump = step(CaseRule::ThreeCases, &below, &above);
        prop_assert!((jump - above.jump()).abs() <= 1e-4 * above.execution(CaseRule::ThreeCases).cycles);
        prop_assert!(step(CaseRule::Continuous, &below, &above).abs() <= 1e-4 * above.execution(CaseRule::Continuous).cycles);
        // Balanced to memory, at MWP = N < CWP.
        let (below, above) = (at(n * (1.0 + e), 2.0 * n), at(n * (1.0 - e), 2.0 * n));
        prop_assert_eq!(below.case(CaseRule::ThreeCases), Case::Balanced);
        prop_assert_eq!(above.case(CaseRule::ThreeCases), Case::Memory);
        let jump = step(CaseRule::ThreeCases, &below, &above);
        prop_assert!((jump + above.jump()).abs() <= 1e-4 * below.execution(CaseRule::ThreeCases).cycles);
        prop_assert!(step(CaseRule::Continuous, &below, &above).abs() <= 1e-4 * above.execution(CaseRule::Continuous).cycles);
        // Balanced to compute, at CWP = N < MWP: all rules agree.
        let (below, above) = (at(2.0 * n, n * (1.0 + e)), at(2.0 * n, n * (1.0 - e)));
        prop_assert_eq!(below.case(CaseRule::ThreeCases), Case::Balanced);
        prop_assert_eq!(above.case(CaseRule::ThreeCases), Case::Compute);
        prop_assert!(step(CaseRule::ThreeCases, &below, &above).abs() <= 1e-4 * above.execution(CaseRule::ThreeCases).cycles);
    }

    /// Seconds do not depend on the unit of cycles: a clock that is wrong by a factor does no harm if
    /// everything was measured in it.
    #[test]
    fn the_clock_is_a_unit(device in device(), program in program(), factor in 0.1..10.0) {
        let scaled = Device {
            clock_ghz: device.clock_ghz * factor,
            issue_cycles: device.issue_cycles * factor,
            memory_latency_cycles: device.memory_latency_cycles * factor,
            departure_delay_coalesced_cycles: device.departure_delay_coalesced_cycles * factor,
            departure_delay_uncoalesced_cycles: device.departure_delay_uncoalesced_cycles * factor,
            ..device.clone()
        };
        let model = Model::continuous();
        let (a, b) = (model.predict(&device, &program).unwrap(), model.predict(&scaled, &program).unwrap());
        prop_assert!((a.seconds - b.seconds).abs() <= 1e-9 * a.seconds, "{} {}", a.seconds, b.seconds);
    }

    #[test]
    fn what_is_no_number_is_refused(device in device(), program in program(), which in 0..5_usize,
        bad in prop::sample::select(vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 1e300])) {
        let mut program = program;
        *[
            &mut program.compute_instructions, &mut program.coalesced_loads, &mut program.uncoalesced_loads,
            &mut program.synchronizations, &mut program.bytes_per_warp_load,
        ][which] = bad;
        let error = Model::default().predict(&device, &program).unwrap_err();
        let is_named = matches!(error, ModelError::OutOfRange { .. });
        prop_assert!(is_named);
        prop_assert!(shortened::predict(&device, &program).is_err());
    }
}

/// The printed rule's second condition: time falls where computation comes to exceed memory.
#[test]
fn the_printed_rule_is_not_monotone() {
    let device = Device::builtin("quadro-fx-5600").unwrap();
    let program = |compute: f64| Program {
        compute_instructions: compute,
        coalesced_loads: 10.0,
        threads_per_block: 256,
        blocks: 160,
        blocks_per_core: 3,
        ..Program::empty()
    };
    let predict =
        |cases, compute| Model { cases }.predict(&device, &program(compute)).unwrap().execution;
    // Mem is 4200 cycles: 1040 and 10 instructions of 4 cycles are as many.
    let (before, after) = (predict(CaseRule::Printed, 1039.0), predict(CaseRule::Printed, 1041.0));
    assert_eq!((before.case, after.case), (Case::Compute, Case::Memory));
    assert!(after.cycles < before.cycles);
    let thesis = |compute| predict(CaseRule::ThreeCases, compute);
    assert!(thesis(1041.0).cycles > thesis(1039.0).cycles);
}

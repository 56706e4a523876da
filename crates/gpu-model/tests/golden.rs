//! The worked example of the literature, to its digits.

use niwaki_gpu_model::{
    Device, Program,
    hong_kim::{Case, CaseRule, Model, Parallelism},
    shortened,
};

/// Tiled matrix multiplication on a device of 1 GHz: Hong and Kim 2009, Table 3 and their example.
fn matrix_multiplication() -> (Device, Program) {
    let device = Device {
        name: "golden".to_owned(),
        source: "Hong and Kim 2009".to_owned(),
        clock_ghz: 1.0,
        bandwidth_gb_s: 80.0,
        cores: 16,
        warp_size: 32,
        issue_cycles: 4.0,
        memory_latency_cycles: 420.0,
        departure_delay_coalesced_cycles: 4.0,
        departure_delay_uncoalesced_cycles: 10.0,
        transactions_per_uncoalesced_load: 32.0,
        max_blocks_per_core: 8,
        max_warps_per_core: 24,
    };
    let program = Program {
        compute_instructions: 27.0,
        coalesced_loads: 0.0,
        uncoalesced_loads: 6.0,
        synchronizations: 6.0,
        bytes_per_warp_load: 128.0,
        threads_per_block: 128,
        blocks: 80,
        blocks_per_core: 5,
    };
    (device, program)
}

#[track_caller]
fn close(value: f64, expected: f64, within: f64) {
    assert!((value - expected).abs() <= within, "{value} is not {expected} ± {within}");
}

#[test]
fn every_intermediate_value_is_the_printed_one() {
    let (device, program) = matrix_multiplication();
    let made = Model::default().predict(&device, &program).unwrap();
    let p = made.parallelism;
    assert_eq!(p.occupancy.warps, 20.0);
    assert_eq!(p.occupancy.repetitions, 1.0);
    assert_eq!(p.latency, 730.0);
    assert_eq!(p.departure_delay, 320.0);
    assert_eq!(p.mwp, 2.281_25);
    close(p.mwp_bandwidth, 28.5156, 5e-5);
    assert_eq!(p.compute_cycles, 132.0);
    assert_eq!(p.memory_cycles, 4380.0);
    assert_eq!(p.cwp, 20.0);
    close(p.cwp_full, 34.18, 5e-3);
    assert_eq!(made.execution.case, Case::Memory);
    close(made.execution.cycles_without_barriers, 38_428.19, 5e-3);
    close(made.execution.barrier_cycles, 12_300.0, 1e-9);
    close(made.execution.cycles, 50_728.19, 5e-3);
    close(made.seconds, 50_728.19e-9, 5e-12);
    // CPI: per instruction of the 20 warps of a core.
    close(made.cycles_per_instruction, 38_428.187_5 / (33.0 * 20.0), 1e-9);
}

#[test]
fn the_printed_sum_comes_from_a_rounded_mwp() {
    let (device, program) = matrix_multiplication();
    let mut p = Parallelism::of(&device, &program).unwrap();
    p.mwp = 2.28;
    let execution = p.execution(CaseRule::Printed);
    close(execution.cycles_without_barriers, 38_450.0, 1.0);
    close(execution.barrier_cycles, 12_288.0, 1.0);
    close(execution.cycles, 50_738.0, 1.0);
}

#[test]
fn the_shortened_form_leaves_out_barriers_only() {
    let (device, program) = matrix_multiplication();
    let made = shortened::predict(&device, &program).unwrap();
    close(made.cycles, 38_428.187_5, 1e-9);
    assert_eq!((made.mwp, made.cwp, made.case), (2.281_25, 20.0, Case::Memory));
    // Table 3, memory: w_t = (MWP − 1)/i_m, c_b = W_d·c_m/MWP.
    close(made.compute_warps, 1.281_25 / 6.0, 1e-12);
    close(made.memory_cycles_per_block, 20.0 * 4380.0 / 2.281_25, 1e-9);
}

/// The three equations by hand, on a device of round numbers: latency 100, departure delay 10,
/// bandwidth without end.
#[test]
fn each_case_by_hand() {
    let (device, program) = matrix_multiplication();
    let device = Device {
        bandwidth_gb_s: 1e6,
        issue_cycles: 1.0,
        memory_latency_cycles: 100.0,
        departure_delay_coalesced_cycles: 10.0,
        cores: 1,
        ..device
    };
    let with = |compute: f64, warps: u32| Program {
        compute_instructions: compute,
        coalesced_loads: 2.0,
        uncoalesced_loads: 0.0,
        synchronizations: 0.0,
        threads_per_block: 32,
        blocks: u64::from(warps) * 3,
        blocks_per_core: warps,
        ..program
    };
    let cycles = |program: &Program| {
        let made = Model::three_cases().predict(&device, program).unwrap().execution;
        (made.case, made.cycles)
    };
    // Comp 20, Mem 200, N 4: MWP 10 and CWP 11 are 4. 200 + 20 + 20/2·3, three times.
    assert_eq!(cycles(&with(18.0, 4)), (Case::Balanced, 750.0));
    // N 20: MWP 10, CWP 11. 200·20/10 + 20/2·9.
    assert_eq!(cycles(&with(18.0, 20)), (Case::Memory, 1470.0));
    // Comp 100: CWP 3. 100 + 100·20.
    assert_eq!(cycles(&with(98.0, 20)), (Case::Compute, 6300.0));
    // Without loads there is arithmetic alone.
    let bare = Program { coalesced_loads: 0.0, ..with(98.0, 20) };
    assert_eq!(cycles(&bare), (Case::Compute, 5880.0));
}

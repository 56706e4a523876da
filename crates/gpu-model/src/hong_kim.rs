//! The analytical model of Hong and Kim 2009, in full.
//!
//! Hong, S. and Kim, H.: An analytical model for a GPU architecture with memory-level and
//! thread-level parallelism awareness. ISCA 36, 2009. Equation numbers are the paper's.

use crate::{
    Device,
    program::{ModelError, Occupancy, Program},
};

/// Which of the three equations of execution time holds when.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum CaseRule {
    /// As printed: *balanced* if MWP = CWP = N, else *memory* if CWP ≥ MWP **or** the computation
    /// cycles exceed the memory cycles, else *compute*.
    ///
    /// The second condition sends kernels with much arithmetic to the equation for memory, whose
    /// only arithmetic is `Comp/#Mem·(MWP − 1)`: their time then grows with a part of the work only,
    /// and falls where computation cycles come to exceed memory cycles.
    #[default]
    Printed,
    /// By MWP and CWP alone, as the thesis gives it (Paper I, section 3): *balanced* if both are N,
    /// else *memory* if CWP ≥ MWP, else *compute*.
    ///
    /// Time still jumps where the cases meet, by `Comp·N/MWP` cycles a repetition: up from memory
    /// to compute, and down from balanced to memory.
    ThreeCases,
    /// [`CaseRule::ThreeCases`] with the missing `Comp·N/MWP` added to the memory case: each of the
    /// N/MWP groups of warps computes once before it waits. Ours, not published; continuous
    /// everywhere, which a search over settings wants.
    Continuous,
}

/// What bounds a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Case {
    /// MWP = CWP = N: there are too few warps to fill either (equation 22).
    Balanced,
    /// Warps wait for memory (equation 23).
    Memory,
    /// Memory is hidden behind computation (equation 24).
    Compute,
}

impl Case {
    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Balanced => "balanced",
            Self::Memory => "memory",
            Self::Compute => "compute",
        }
    }
}

/// All that lies between the input and the cycles.
///
/// A plain value: change a field and ask [`Parallelism::execution`] what it would mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parallelism {
    /// How the launch fills the device, with N and `#Rep`.
    pub occupancy: Occupancy,
    /// Share of uncoalesced memory instructions, 0 to 1 (`Weight_uncoal`, equation 7).
    pub uncoalesced_share: f64,
    /// Latency of an uncoalesced load, cycles (`Mem_L_Uncoal`, equation 4).
    pub latency_uncoalesced: f64,
    /// Latency of a coalesced load, cycles (`Mem_L_Coal`, equation 5).
    pub latency_coalesced: f64,
    /// Mean latency of a load, cycles (`Mem_L`, equation 6); 0 without loads.
    pub latency: f64,
    /// Mean cycles from one warp's load to the next's (`Departure_delay`, equation 9); 0 without
    /// loads.
    pub departure_delay: f64,
    /// Bandwidth that a waiting warp uses, GB/s (`BW_per_warp`, equation 3); 0 without loads.
    pub bandwidth_per_warp: f64,
    /// Warps of a core that the bandwidth feeds (`MWP_peak_BW`, equation 2); ∞ without loads.
    pub mwp_bandwidth: f64,
    /// Warps whose loads leave during one latency (`MWP_Without_BW_full`, equation 10); ∞ without
    /// loads.
    pub mwp_departure: f64,
    /// Memory warp parallelism: the least of the two and N (`MWP`, equation 1).
    pub mwp: f64,
    /// Cycles in which a warp computes (`Comp_cycles`, equation 19).
    pub compute_cycles: f64,
    /// Cycles in which a warp waits (`Mem_cycles`, equation 18).
    pub memory_cycles: f64,
    /// Warps that could compute while one waits (`CWP_full`, equation 8).
    pub cwp_full: f64,
    /// Computation warp parallelism: no more than N (`CWP`).
    pub cwp: f64,
    /// Memory instructions of a warp (`#Mem_insts`).
    pub memory_instructions: f64,
    /// Barriers of a warp (`#Synch_insts`).
    pub synchronizations: f64,
}

/// Cycles of a core for a launch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Execution {
    /// Which equation held.
    pub case: Case,
    /// Without barriers (`Exec_cycles_app`, equations 22 to 24).
    pub cycles_without_barriers: f64,
    /// What barriers add (`Synch_cost`, equation 25).
    pub barrier_cycles: f64,
    /// All (equation 26).
    pub cycles: f64,
}

/// A prediction with all that led to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// The intermediate values.
    pub parallelism: Parallelism,
    /// The cycles.
    pub execution: Execution,
    /// Cycles an instruction of a warp, on one core (`CPI`, equation 27), without barriers; 0
    /// without instructions.
    pub cycles_per_instruction: f64,
    /// Seconds, by the device's clock.
    pub seconds: f64,
}

/// Hong and Kim's model.
///
/// ```
/// use niwaki_gpu_model::{Device, Program, hong_kim::{Case, Model}};
///
/// let device = Device::builtin("gtx-280")?;
/// let program = Program {
///     compute_instructions: 200.0,
///     coalesced_loads: 10.0,
///     threads_per_block: 256,
///     blocks: 1000,
///     blocks_per_core: device.blocks_per_core(256),
///     ..Program::empty()
/// };
/// let prediction = Model::default().predict(&device, &program)?;
/// println!("{:.3} ms, {}", prediction.seconds * 1e3, prediction.execution.case.name());
/// # Ok::<(), niwaki_gpu_model::ModelError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Model {
    /// Which equation holds when. Default [`CaseRule::Printed`].
    pub cases: CaseRule,
}

impl Model {
    /// The model without jumps.
    #[must_use]
    pub const fn continuous() -> Self {
        Self { cases: CaseRule::Continuous }
    }

    /// The model with the thesis's conditions.
    #[must_use]
    pub const fn three_cases() -> Self {
        Self { cases: CaseRule::ThreeCases }
    }

    /// How long a launch takes.
    ///
    /// # Errors
    /// [`ModelError`] if a number of either is not one that a launch or a device can have.
    pub fn predict(&self, device: &Device, program: &Program) -> Result<Prediction, ModelError> {
        let parallelism = Parallelism::of(device, program)?;
        let execution = parallelism.execution(self.cases);
        let warps = f64::from(program.threads_per_block.div_ceil(device.warp_size));
        let per_core = program.blocks as f64 / parallelism.occupancy.active_cores;
        let instructions = program.total_instructions() * warps * per_core;
        let cycles_per_instruction =
            if instructions > 0.0 { execution.cycles_without_barriers / instructions } else { 0.0 };
        let seconds = execution.cycles / (device.clock_ghz * 1e9);
        Ok(Prediction { parallelism, execution, cycles_per_instruction, seconds })
    }
}

impl Parallelism {
    /// Everything up to MWP and CWP.
    ///
    /// # Errors
    /// As [`Model::predict`].
    pub fn of(device: &Device, program: &Program) -> Result<Self, ModelError> {
        device.check()?;
        program.check()?;
        let occupancy = Occupancy::of(device, program);
        let memory_instructions = program.memory_instructions();
        let latency_coalesced = device.memory_latency_cycles;
        let latency_uncoalesced = latency_coalesced
            + (device.transactions_per_uncoalesced_load - 1.0)
                * device.departure_delay_uncoalesced_cycles;
        let compute_cycles = device.issue_cycles * program.total_instructions();
        let memory_cycles = latency_uncoalesced * program.uncoalesced_loads
            + latency_coalesced * program.coalesced_loads;
        // Without loads nothing waits, and nothing bounds how many warps could.
        let mut made = Self {
            occupancy,
            uncoalesced_share: 0.0,
            latency_uncoalesced,
            latency_coalesced,
            latency: 0.0,
            departure_delay: 0.0,
            bandwidth_per_warp: 0.0,
            mwp_bandwidth: f64::INFINITY,
            mwp_departure: f64::INFINITY,
            mwp: occupancy.warps,
            compute_cycles,
            memory_cycles,
            cwp_full: 1.0,
            cwp: 1.0,
            memory_instructions,
            synchronizations: program.synchronizations,
        };
        if memory_instructions > 0.0 {
            let share = program.uncoalesced_loads / memory_instructions;
            made.uncoalesced_share = share;
            made.latency = latency_uncoalesced * share + latency_coalesced * (1.0 - share);
            made.departure_delay = device.departure_delay_uncoalesced_cycles
                * device.transactions_per_uncoalesced_load
                * share
                + device.departure_delay_coalesced_cycles * (1.0 - share);
            made.bandwidth_per_warp = device.clock_ghz * program.bytes_per_warp_load / made.latency;
            made.mwp_bandwidth =
                device.bandwidth_gb_s / (made.bandwidth_per_warp * occupancy.active_cores);
            made.mwp_departure = made.latency / made.departure_delay;
            made.mwp = made.mwp_departure.min(made.mwp_bandwidth).min(occupancy.warps);
            made.cwp_full = (memory_cycles + compute_cycles) / compute_cycles;
            made.cwp = made.cwp_full.min(occupancy.warps);
        }
        Ok(made)
    }

    /// Which equation holds.
    #[must_use]
    pub fn case(&self, rule: CaseRule) -> Case {
        let n = self.occupancy.warps;
        let is_printed = rule == CaseRule::Printed;
        if self.memory_instructions <= 0.0 {
            Case::Compute
        } else if self.mwp >= n && self.cwp >= n {
            Case::Balanced
        } else if self.cwp >= self.mwp || is_printed && self.compute_cycles > self.memory_cycles {
            Case::Memory
        } else {
            Case::Compute
        }
    }

    /// The cycles of the launch on a core.
    #[must_use]
    pub fn execution(&self, rule: CaseRule) -> Execution {
        let Occupancy { warps: n, repetitions, active_blocks, .. } = self.occupancy;
        let case = self.case(rule);
        // MWP is below 1 where bandwidth does not even feed one warp: nothing overlaps then, which
        // is no negative cost.
        let others = (self.mwp - 1.0).max(0.0);
        // Comp_p, the computation between two loads.
        let period = if case == Case::Compute {
            0.0
        } else {
            self.compute_cycles / self.memory_instructions
        };
        let per_repetition = match case {
            Case::Balanced => self.memory_cycles + self.compute_cycles + period * others,
            Case::Memory => {
                let rounds = n / self.mwp;
                let computing =
                    if rule == CaseRule::Continuous { self.compute_cycles * rounds } else { 0.0 };
                self.memory_cycles * rounds + computing + period * others
            }
            Case::Compute => self.latency + self.compute_cycles * n,
        };
        let cycles_without_barriers = per_repetition * repetitions;
        let barrier_cycles =
            self.departure_delay * others * self.synchronizations * active_blocks * repetitions;
        let cycles = cycles_without_barriers + barrier_cycles;
        Execution { case, cycles_without_barriers, barrier_cycles, cycles }
    }

    /// Cycles by which [`CaseRule::ThreeCases`] jumps where cases meet, for these MWP and
    /// computation cycles: `Comp·N/MWP` a repetition.
    #[must_use]
    pub fn jump(&self) -> f64 {
        self.compute_cycles * self.occupancy.warps / self.mwp * self.occupancy.repetitions
    }
}

//! Instructions of a ray-traced frame from its workload: Paper I of the thesis, section 4.3, with
//! the names of its Table 5.

use crate::{
    Device, Program, Workload, hong_kim,
    program::{COUNT, ModelError, check},
    shortened,
};
use serde::{Deserialize, Serialize};

/// Instructions of a thread of the ray tracing kernel, by the loops that they are in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KernelCounts {
    /// `i_ct`: compute instructions a traversal step.
    pub compute_per_traversal: f64,
    /// `i_ci`: compute instructions an intersection.
    pub compute_per_intersection: f64,
    /// `i_cco`: compute instructions outside of both loops.
    pub compute_constant: f64,
    /// `i_mt`: memory instructions a traversal step.
    pub memory_per_traversal: f64,
    /// `i_mi`: memory instructions an intersection.
    pub memory_per_intersection: f64,
    /// `i_mco`: memory instructions outside of both loops.
    pub memory_constant: f64,
    /// Mean bytes that a thread moves by a memory instruction; 16 for a row of four words.
    pub bytes_per_memory_instruction: f64,
}

/// What a frame's quality settings ask of each visible point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RaySettings {
    /// `a_r`: ambient occlusion rays.
    pub ao_rays: f64,
    /// A shadow ray to each light. The paper switches shadows but has no term for them; ours
    /// charges [`Workload::shadow_traversals`] like primary rays.
    pub shadows: bool,
}

/// Numbers of the paper that were fitted to its trees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Constants {
    /// The 23 in `a_ca`: traversals of a primary and an AO ray together up to which all memory of
    /// AO rays is in the cache; each further 23 halve what is. Above 0. Default 23.
    pub cached_traversals: f64,
    /// The ½ in `a_m`: intersections of an AO ray that read memory. At least 0. Default 0.5.
    pub ao_intersections: f64,
    /// Compute instructions of an AO or shadow ray outside of both loops: its set-up. At least 0.
    /// Default 0, as the paper has none.
    pub compute_per_secondary_ray: f64,
    /// Memory instructions of an AO or shadow ray outside of both loops. At least 0. Default 0, as
    /// the paper has none.
    pub memory_per_secondary_ray: f64,
    /// The share of [`Workload::primary_divergence`] and [`Workload::secondary_divergence`] that adds to
    /// compute instructions of traversal and intersection. At least 0. Default 0, as in the paper, by
    /// which threads of a warp do not wait for each other.
    pub divergence: f64,
}

impl Default for Constants {
    fn default() -> Self {
        Self {
            cached_traversals: 23.0,
            ao_intersections: 0.5,
            compute_per_secondary_ray: 0.0,
            memory_per_secondary_ray: 0.0,
            divergence: 0.0,
        }
    }
}

impl Constants {
    /// For kernels whose invocations trace one ray of any kind each, such as those of
    /// `niwaki-trace-vulkan`: the set-up of every ray is that of the first.
    #[must_use]
    pub fn for_single_rays(counts: &KernelCounts) -> Self {
        Self {
            compute_per_secondary_ray: counts.compute_constant,
            memory_per_secondary_ray: counts.memory_constant,
            ..Self::default()
        }
    }

    /// By how much instructions of primary and of secondary rays are more, for threads that wait for
    /// others of their warp.
    #[must_use]
    pub const fn waiting(&self, workload: &Workload) -> [f64; 2] {
        [
            1.0 + self.divergence * workload.primary_divergence,
            1.0 + self.divergence * workload.secondary_divergence,
        ]
    }
}

/// Instructions of a thread, on average: the left sides of section 4.3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instructions {
    /// `i_c`: compute instructions.
    pub compute: f64,
    /// `i_t`: memory instructions of primary (and shadow) rays that miss the cache.
    pub initial_memory: f64,
    /// `a_ca`: share of AO memory instructions that miss the cache, 0 to 1.
    pub ao_cache: f64,
    /// `a_m`: memory instructions of AO rays that miss the cache.
    pub ao_memory: f64,
    /// `i_mu`: uncoalesced memory instructions.
    pub uncoalesced: f64,
    /// `i_mc`: coalesced memory instructions.
    pub coalesced: f64,
}

impl Instructions {
    /// The equations.
    ///
    /// `i_c = i_ct·(a_t·a_r + p_t) + i_ci·(p_i + a_w·t_v·a_r) + i_cco`,
    /// `i_t = (i_mt·p_t + i_mi·p_i + i_mco)·(1 − m²)`,
    /// `a_ca = 1 − min(1, 2^−((a_t + p_t)/23 − 1))`,
    /// `a_m = a_ca·(i_mt·a_t·a_r + t_v·i_mi·a_r/2)`,
    /// `i_mu = i_t·(1 − m) + a_m`, `i_mc = i_t·m`. With shadows, `p_t` and `p_i` include the shadow
    /// rays', but for the `p_t` of `a_ca`. What [`Constants`] give for each secondary ray is added to
    /// `i_c`, `i_t` and the bracket of `a_m`; their divergence multiplies instructions of `i_c`.
    ///
    /// # Errors
    /// [`ModelError::OutOfRange`] for numbers that are negative, NaN or above 10¹⁵, and for an m
    /// above 1.
    pub fn of(
        counts: &KernelCounts,
        workload: &Workload,
        settings: &RaySettings,
        constants: &Constants,
    ) -> Result<Self, ModelError> {
        counts.check()?;
        workload.check()?;
        check("ao_rays", settings.ao_rays, 0.0, 1e9, "between 0 and 1e9")?;
        check("cached_traversals", constants.cached_traversals, 1e-6, 1e15, "above 0")?;
        check("ao_intersections", constants.ao_intersections, 0.0, 1e15, COUNT)?;
        let (per_ray, loads_per_ray) =
            (constants.compute_per_secondary_ray, constants.memory_per_secondary_ray);
        check("divergence", constants.divergence, 0.0, 1e9, "between 0 and 1e9")?;
        check("compute_per_secondary_ray", per_ray, 0.0, 1e6, "between 0 and 1e6")?;
        check("memory_per_secondary_ray", loads_per_ray, 0.0, 1e6, "between 0 and 1e6")?;
        let [s_t, s_i, s_r] = if settings.shadows {
            [workload.shadow_traversals, workload.shadow_intersections, workload.shadow_rays]
        } else {
            [0.0; 3]
        };
        let (p_t, p_i) = (workload.primary_traversals, workload.primary_intersections);
        let (a_t, a_w) = (workload.ao_traversals, workload.ao_intersections);
        let (t_v, a_r, m) = (workload.visible_triangles, settings.ao_rays, workload.coalescing);
        let [primary, secondary] = constants.waiting(workload);
        let compute = counts.compute_per_traversal
            * (p_t * primary + (a_t * a_r + s_t) * secondary)
            + counts.compute_per_intersection
                * (p_i * primary + (s_i + a_w * t_v * a_r) * secondary)
            + counts.compute_constant
            + per_ray * (t_v * a_r + s_r) * secondary;
        let initial_memory = (counts.memory_per_traversal * (p_t + s_t)
            + counts.memory_per_intersection * (p_i + s_i)
            + counts.memory_constant
            + loads_per_ray * s_r)
            * (1.0 - m * m);
        let cached = (-((a_t + p_t) / constants.cached_traversals - 1.0)).exp2().min(1.0);
        let ao_cache = 1.0 - cached;
        let ao_memory = ao_cache
            * (counts.memory_per_traversal * a_t * a_r
                + t_v * counts.memory_per_intersection * a_r * constants.ao_intersections
                + loads_per_ray * t_v * a_r);
        let uncoalesced = initial_memory * (1.0 - m) + ao_memory;
        let coalesced = initial_memory * m;
        Ok(Self { compute, initial_memory, ao_cache, ao_memory, uncoalesced, coalesced })
    }

    /// `i_m`: all memory instructions.
    #[must_use]
    pub const fn memory(&self) -> f64 {
        self.coalesced + self.uncoalesced
    }
}

impl KernelCounts {
    fn check(&self) -> Result<(), ModelError> {
        for (field, value) in [
            ("compute_per_traversal", self.compute_per_traversal),
            ("compute_per_intersection", self.compute_per_intersection),
            ("compute_constant", self.compute_constant),
            ("memory_per_traversal", self.memory_per_traversal),
            ("memory_per_intersection", self.memory_per_intersection),
            ("memory_constant", self.memory_constant),
            ("bytes_per_memory_instruction", self.bytes_per_memory_instruction),
        ] {
            check(field, value, 0.0, 1e6, "between 0 and 1e6")?;
        }
        Ok(())
    }
}

/// Which form of the model turns instructions into seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The thesis's ([`shortened`]).
    Shortened,
    /// Hong and Kim's ([`hong_kim`]).
    HongKim(hong_kim::Model),
}

/// How long a frame will take: device, kernel and launch, to be asked again and again.
///
/// ```
/// use niwaki_gpu_model::{Device, FrameModel, KernelCounts, RaySettings, Workload};
///
/// let counts = KernelCounts {
///     compute_per_traversal: 38.0,
///     compute_per_intersection: 23.0,
///     compute_constant: 60.0,
///     memory_per_traversal: 5.0,
///     memory_per_intersection: 3.0,
///     memory_constant: 3.0,
///     bytes_per_memory_instruction: 16.0,
/// };
/// let model = FrameModel::new(Device::builtin("geforce-580")?, counts, 1280 * 720);
/// let workload = Workload {
///     primary_traversals: 30.0,
///     primary_intersections: 4.0,
///     visible_triangles: 0.9,
///     ao_traversals: 18.0,
///     ao_intersections: 3.0,
///     coalescing: 0.6,
///     ..Workload::default()
/// };
/// let few = model.predict(&workload, &RaySettings { ao_rays: 4.0, shadows: false })?;
/// let many = model.predict(&workload, &RaySettings { ao_rays: 16.0, shadows: false })?;
/// assert!(many.seconds > few.seconds);
/// # Ok::<(), niwaki_gpu_model::ModelError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FrameModel {
    /// Where the kernel runs.
    pub device: Device,
    /// What the kernel does.
    pub counts: KernelCounts,
    /// Fitted numbers.
    pub constants: Constants,
    /// The form of the model. Default [`Form::Shortened`].
    pub form: Form,
    /// Pixels of the frame, a thread each.
    pub pixels: u64,
    /// Threads of a block. Default 64.
    pub threads_per_block: u32,
    /// Blocks that a core has at once, where registers or workgroup memory allow fewer than the
    /// device does. Default `None`: as many as the device allows.
    pub blocks_per_core: Option<u32>,
}

/// A predicted frame, with all that led to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramePrediction {
    /// Instructions of a thread.
    pub instructions: Instructions,
    /// The launch as the model of the device saw it.
    pub program: Program,
    /// What bounds it.
    pub case: hong_kim::Case,
    /// Cycles of a core.
    pub cycles: f64,
    /// Seconds.
    pub seconds: f64,
}

impl FrameModel {
    /// A model of frames of so many pixels, with defaults for the rest.
    #[must_use]
    pub fn new(device: Device, counts: KernelCounts, pixels: u64) -> Self {
        Self {
            device,
            counts,
            constants: Constants::default(),
            form: Form::Shortened,
            pixels,
            threads_per_block: 64,
            blocks_per_core: None,
        }
    }

    /// How long a frame takes. Less than a microsecond.
    ///
    /// # Errors
    /// [`ModelError`] if a number is not one that a device, kernel, launch or workload can have.
    pub fn predict(
        &self,
        workload: &Workload,
        settings: &RaySettings,
    ) -> Result<FramePrediction, ModelError> {
        let instructions = Instructions::of(&self.counts, workload, settings, &self.constants)?;
        let program = self.program(&instructions);
        let (case, cycles, seconds) = match self.form {
            Form::Shortened => {
                let made = shortened::predict(&self.device, &program)?;
                (made.case, made.cycles, made.seconds)
            }
            Form::HongKim(model) => {
                let made = model.predict(&self.device, &program)?;
                (made.execution.case, made.execution.cycles, made.seconds)
            }
        };
        Ok(FramePrediction { instructions, program, case, cycles, seconds })
    }

    /// The launch of so many instructions a thread.
    #[must_use]
    pub fn program(&self, instructions: &Instructions) -> Program {
        let threads = self.threads_per_block.max(1);
        let bytes = self.counts.bytes_per_memory_instruction;
        // A kernel without memory instructions has no bytes; any number will do.
        let bytes = if bytes > 0.0 { bytes } else { 4.0 };
        Program {
            compute_instructions: instructions.compute,
            coalesced_loads: instructions.coalesced,
            uncoalesced_loads: instructions.uncoalesced,
            synchronizations: 0.0,
            bytes_per_warp_load: bytes * f64::from(self.device.warp_size),
            threads_per_block: threads,
            blocks: self.pixels.div_ceil(u64::from(threads)),
            blocks_per_core: self
                .blocks_per_core
                .unwrap_or_else(|| self.device.blocks_per_core(threads))
                .max(1),
        }
    }
}

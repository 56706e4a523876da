//! The plant: a device with laws and parameters of its own.

use serde::{Deserialize, Serialize};

use super::random::Random;
use super::{Hidden, View};
use crate::error::within;
use crate::{Error, RenderSettings};

/// Parameters of a simulated device. None of them is what a predictor is told.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceSpec {
    /// Name.
    pub name: String,
    /// Cores.
    pub cores: f64,
    /// Threads of a warp.
    pub lanes: f64,
    /// Clock in GHz.
    pub clock_ghz: f64,
    /// Cycles a core takes to issue one instruction of a warp.
    pub issue_cycles: f64,
    /// Share of the issue slots that real code fills, above 0 and up to 1.
    pub efficiency: f64,
    /// Memory bandwidth in GB/s.
    pub bandwidth_gbs: f64,
    /// Share of the bandwidth that scattered accesses reach, above 0 and up to 1.
    pub scatter: f64,
    /// Bytes that caches hold, textures' included.
    pub cache_bytes: f64,
    /// Length of a path, in nodes, at which half of what neighbouring rays fetched is evicted before
    /// it is used again, in a view whose working set is as large as the caches.
    pub reuse_nodes: f64,
    /// Cycles that a miss takes.
    pub latency_cycles: f64,
    /// Warps that a core keeps in flight.
    pub resident_warps: f64,
    /// Warps of a block.
    pub block_warps: f64,
    /// Time of launches, uploads and presentation, in milliseconds a frame.
    pub overhead_ms: f64,
    /// How much longer a warp takes where the work of its lanes spreads: factor on the spread.
    pub divergence: f64,
    /// Levels of the tree that the traversal stack holds in registers; deeper ones spill.
    pub stack_levels: f64,
    /// Cost of each spilled level as a share of the frame.
    pub spill: f64,
    /// Relative deviation of the time of equal frames.
    pub noise: f64,
    /// Share of frames that something else interrupts.
    pub spike_rate: f64,
    /// How many times longer such a frame takes, at least 1.
    pub spike_factor: f64,
    /// Warming above the surroundings at full power, in kelvin.
    pub heating_kelvin: f64,
    /// Time constant of warming in milliseconds.
    pub heat_ms: f64,
    /// Temperature from which the clock is lowered, in °C.
    pub throttle_celsius: f64,
}

impl DeviceSpec {
    /// Like an NVIDIA GeForce 8800 GTX: no cache for global memory but small texture caches.
    pub fn geforce_8800() -> Self {
        Self {
            name: "GeForce 8800".into(),
            cores: 16.0,
            lanes: 32.0,
            clock_ghz: 1.35,
            issue_cycles: 4.0,
            efficiency: 0.9,
            bandwidth_gbs: 86.4,
            scatter: 0.145,
            cache_bytes: 200e3,
            reuse_nodes: 60.0,
            latency_cycles: 460.0,
            resident_warps: 12.0,
            block_warps: 2.0,
            overhead_ms: 3.5,
            divergence: 0.3,
            stack_levels: 40.0,
            spill: 0.0,
            noise: 0.006,
            spike_rate: 0.0,
            spike_factor: 1.0,
            heating_kelvin: 45.0,
            heat_ms: 60_000.0,
            throttle_celsius: 100.0,
        }
    }

    /// Like an NVIDIA GeForce GTX 580: L1 and L2 caches.
    pub fn geforce_580() -> Self {
        Self {
            name: "GeForce 580".into(),
            clock_ghz: 1.54,
            issue_cycles: 1.7,
            efficiency: 0.9,
            bandwidth_gbs: 192.4,
            scatter: 0.37,
            cache_bytes: 1.5e6,
            reuse_nodes: 50.0,
            latency_cycles: 600.0,
            resident_warps: 24.0,
            overhead_ms: 1.2,
            divergence: 0.3,
            ..Self::geforce_8800()
        }
    }

    /// Like an AMD Radeon HD 5870: wide wavefronts, and a stack that spills for deep trees.
    pub fn radeon_5870() -> Self {
        Self {
            name: "Radeon 5870".into(),
            cores: 20.0,
            lanes: 64.0,
            clock_ghz: 0.85,
            issue_cycles: 3.1,
            efficiency: 0.95,
            bandwidth_gbs: 153.6,
            scatter: 0.26,
            cache_bytes: 700e3,
            reuse_nodes: 55.0,
            latency_cycles: 520.0,
            resident_warps: 12.0,
            block_warps: 1.0,
            overhead_ms: 4.0,
            divergence: 0.25,
            stack_levels: 21.0,
            spill: 0.03,
            ..Self::geforce_8800()
        }
    }

    /// Fails at the first parameter that is no such device's.
    pub fn validate(&self) -> Result<(), Error> {
        const ABOVE: &str = "above 0 and finite";
        for (name, value) in [
            ("cores", self.cores),
            ("lanes", self.lanes),
            ("clock_ghz", self.clock_ghz),
            ("issue_cycles", self.issue_cycles),
            ("bandwidth_gbs", self.bandwidth_gbs),
            ("cache_bytes", self.cache_bytes),
            ("reuse_nodes", self.reuse_nodes),
            ("latency_cycles", self.latency_cycles),
            ("resident_warps", self.resident_warps),
            ("block_warps", self.block_warps),
            ("stack_levels", self.stack_levels),
            ("heat_ms", self.heat_ms),
        ] {
            within(name, value, 1e-9, 1e12, ABOVE)?;
        }
        within("efficiency", self.efficiency, 1e-3, 1.0, "within 0.001 and 1")?;
        within("scatter", self.scatter, 1e-3, 1.0, "within 0.001 and 1")?;
        within("overhead_ms", self.overhead_ms, 0.0, 1e6, "within 0 and 1e6")?;
        within("divergence", self.divergence, 0.0, 100.0, "within 0 and 100")?;
        within("spill", self.spill, 0.0, 10.0, "within 0 and 10")?;
        within("noise", self.noise, 0.0, 0.1, "within 0 and 0.1")?;
        within("spike_rate", self.spike_rate, 0.0, 1.0, "within 0 and 1")?;
        within("spike_factor", self.spike_factor, 1.0, 1e3, "within 1 and 1000")?;
        within("heating_kelvin", self.heating_kelvin, 0.0, 1e3, "within 0 and 1000")?;
        within("throttle_celsius", self.throttle_celsius, 0.0, 1e3, "within 0 and 1000")
    }

    /// Cost of one kind of rays: warp instructions, 32-byte sectors that caches do not hold, and
    /// warps that wait. `path` is how many nodes a ray's pixel has visited when it is done, `alike`
    /// how much the rays of a warp have in common, 0 to 1.
    fn rays(
        &self,
        rays: f64,
        steps: f64,
        tests: f64,
        path: f64,
        alike: f64,
        hidden: &Hidden,
    ) -> Cost {
        if rays <= 0.0 {
            return Cost::default();
        }
        // A warp runs until its last lane is done.
        let lanes = (self.lanes / 32.0).sqrt();
        let apart = 1.0 + self.divergence * lanes * (hidden.spread + 1.0 - alike);
        let instructions = rays / self.lanes * (steps * 30.0 + tests * 22.0 + 30.0) * apart;
        // What the lanes of a warp ask for together, or each for itself.
        let shared = 1.0 / (1.0 + (self.lanes - 1.0) * alike.powi(4));
        let requests = rays * (steps * 2.0 + tests * 1.5) * shared;
        // Long paths evict what neighbours would have used again, the sooner the more there is.
        let crowding = (hidden.working_set / self.cache_bytes).max(1e-3).powf(0.06);
        let length = (path * crowding / self.reuse_nodes).powf(2.5);
        let missed = 0.02 + 0.98 * length / (1.0 + length);
        Cost {
            instructions,
            sectors: requests * missed,
            waits: rays / self.lanes * (steps + tests) * missed.sqrt(),
        }
    }

    /// Milliseconds of a frame without noise, with the clocks of cores and memory over nominal.
    fn time_ms(
        &self,
        view: &View,
        settings: &RenderSettings,
        clock: f64,
        memory_clock: f64,
    ) -> f64 {
        let (seen, hidden) = (&view.counters, &view.hidden);
        let pixels = seen.pixels * settings.render_scale * settings.render_scale;
        let shown = pixels * seen.visible;
        let visible = seen.visible.max(1e-9);
        let m = seen.coalescing.clamp(0.0, 1.0);
        let (nodes, tests) = (seen.primary_traversals, seen.primary_intersections);
        let mut cost = self.rays(pixels, nodes, tests, nodes, 0.3 + 0.7 * m, hidden);
        if settings.shadows {
            let steps = seen.shadow_traversals / visible;
            let tests = seen.shadow_intersections / visible;
            cost += self.rays(shown, steps, tests, nodes + steps, 0.2 + 0.7 * m, hidden);
        }
        let ao_rays = f64::from(settings.ao_rays);
        let reach = (settings.ao_radius / seen.ao_radius.max(1e-9)).max(0.0);
        // Longer rays pass more boxes, and meet something sooner or later.
        let grown = reach.powf(0.4).min(3.0);
        let (steps, tests) = (seen.ao_traversals / visible * grown, seen.ao_intersections * grown);
        // Later rays of a pixel find in caches some of what the first ones fetched.
        let alike = 0.15 + 0.3 * m + 0.1 * ao_rays / (ao_rays + 12.0);
        cost += self.rays(shown * ao_rays, steps, tests, nodes + steps, alike, hidden);
        let near = settings.near_region.clamp(0.0, 1.0).sqrt();
        for bounce in 0..settings.reflection_depth {
            let left = 0.55_f64.powi(i32::from(bounce));
            let steps = nodes * (0.5 + near);
            cost += self.rays(pixels * seen.mirrors * left, steps, 3.0, nodes + steps, 0.2, hidden);
        }
        let hertz = self.clock_ghz * clock * 1e6;
        let compute =
            cost.instructions * self.issue_cycles / (self.cores * self.efficiency) / hertz;
        let memory = cost.sectors * 32.0 / (self.bandwidth_gbs * memory_clock * self.scatter * 1e6);
        let latency = cost.waits * self.latency_cycles / (self.cores * self.resident_warps) / hertz;
        // They overlap, but never wholly.
        let p = 2.5;
        let busy = (compute.powf(p) + memory.powf(p) + latency.powf(p)).powf(1.0 / p);
        // The last blocks run on a device that is emptying.
        let blocks = pixels / (self.lanes * self.block_warps);
        let waves = blocks * self.block_warps / (self.cores * self.resident_warps);
        let tail = (waves.ceil() / waves.max(1e-9)).min(4.0)
            * (1.0 + (0.5 + hidden.spread) / waves.max(1.0));
        let spilled = 1.0 + self.spill * (hidden.depth - self.stack_levels).max(0.0);
        self.overhead_ms + busy * tail * spilled
    }
}

/// What rays ask of the device.
#[derive(Clone, Copy, Default)]
struct Cost {
    instructions: f64,
    sectors: f64,
    waits: f64,
}

impl core::ops::AddAssign for Cost {
    fn add_assign(&mut self, other: Self) {
        self.instructions += other.instructions;
        self.sectors += other.sectors;
        self.waits += other.waits;
    }
}

/// A device in use: its temperature, its clock, who else is on it.
#[derive(Clone, Debug)]
pub struct Device {
    spec: DeviceSpec,
    random: Random,
    celsius: f64,
    /// Clock of the cores over the nominal one, as throttling leaves it; memory is not throttled.
    throttled: f64,
    /// What scripts change.
    pub(super) surroundings: Surroundings,
}

/// What scripts change of a device.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surroundings {
    pub(super) clock: f64,
    pub(super) competing: f64,
    pub(super) celsius: f64,
}

const IDLE: Surroundings = Surroundings { clock: 1.0, competing: 0.0, celsius: 25.0 };

impl Device {
    /// A cool device. Fails for parameters that are no device's.
    pub fn new(spec: DeviceSpec, seed: u64) -> Result<Self, Error> {
        spec.validate()?;
        let random = Random::new(seed);
        Ok(Self { spec, random, celsius: IDLE.celsius, throttled: 1.0, surroundings: IDLE })
    }

    /// Its parameters.
    pub fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    /// Temperature in °C.
    pub fn celsius(&self) -> f64 {
        self.celsius
    }

    /// Milliseconds that a frame would take on the cool, idle device without noise.
    pub fn ideal_ms(&self, view: &View, settings: &RenderSettings) -> f64 {
        self.spec.time_ms(view, settings, 1.0, 1.0)
    }

    /// Draws a frame: its time in milliseconds. Warms the device.
    pub fn draw(&mut self, view: &View, settings: &RenderSettings) -> f64 {
        let spec = &self.spec;
        let clock = self.throttled * self.surroundings.clock;
        let alone = spec.time_ms(view, settings, clock, self.surroundings.clock);
        let mut time = alone / (1.0 - self.surroundings.competing.clamp(0.0, 0.95));
        time *= (1.0 + spec.noise * self.random.normal()).max(0.5);
        if self.random.uniform() < spec.spike_rate {
            time *= 1.0 + (spec.spike_factor - 1.0) * self.random.uniform();
        }
        // Power goes with the cube of the clock; a tenth is left when idle.
        let busy = ((time - spec.overhead_ms) / time).clamp(0.0, 1.0);
        let power = 0.1 + 0.9 * busy * clock.powi(3);
        let settles = self.surroundings.celsius + spec.heating_kelvin * power;
        self.celsius += (settles - self.celsius) * (1.0 - (-time / spec.heat_ms).exp());
        // Firmware takes small steps down at once, and goes up only well below the limit.
        if self.celsius > spec.throttle_celsius {
            self.throttled = (self.throttled - 0.01).max(0.5);
        } else if self.celsius < spec.throttle_celsius - 3.0 {
            self.throttled = (self.throttled + 0.005).min(1.0);
        }
        time
    }
}

//! The measurements.

use super::{Fit, MicrobenchError, Settings};
use niwaki_core::to_u32;
use niwaki_trace_vulkan::{Buffer, Device, DeviceKind, Kernel};

/// Bytes between elements of the chase and lines of the uncoalesced loads: two lines of most
/// caches, as neighbours are often fetched together.
const STRIDE: u64 = 128;

/// Instructions of a turn of `chain` and of `issue`, loads of a turn of `loads.wgsl`.
const CHAIN: f64 = 16.0;
const ISSUE: f64 = 32.0;
const LOADS: f64 = 16.0;

/// Turns of a loop at most, as software drivers end long ones.
const MOST_TURNS: u32 = 8192;

/// Residuals above this are measured again, with longer runs, so many times at most.
const RESTLESS: f64 = 0.05;
const ATTEMPTS: usize = 5;

/// Immediates of `arithmetic.wgsl`.
#[derive(Clone, Copy)]
struct Arithmetic {
    turns: u32,
}

impl Arithmetic {
    /// Turns and operands: factors just below 1, so that numbers stay numbers.
    const fn words(self) -> [u32; 5] {
        [self.turns, 0x9e37_79b9, 0x85eb_ca6b, 0.999_f32.to_bits(), 0.001_f32.to_bits()]
    }
}

pub(super) struct Runs<'a> {
    gpu: &'a Device,
    repeats: u32,
    lengths: u32,
    /// Holds one cycle over words that lie `STRIDE` apart.
    memory: Buffer,
    results: Buffer,
    position: Buffer,
    workgroup: u32,
    /// Where the next run reads, so that it finds no line of the one before.
    start: u32,
}

impl<'a> Runs<'a> {
    pub(super) fn new(gpu: &'a Device, settings: &Settings) -> Result<Self, MicrobenchError> {
        let info = gpu.info();
        let bytes = settings.working_set_bytes.unwrap_or(match info.kind {
            DeviceKind::Discrete | DeviceKind::Virtual => 256 << 20,
            _ => 64 << 20,
        });
        let limit = info.max_binding_bytes.min(info.max_buffer_bytes).clamp(1 << 16, 1 << 31);
        // The largest power of two that the device can bind.
        let limit = 1 << limit.ilog2();
        let bytes = bytes.clamp(1 << 16, limit).next_power_of_two().min(limit);
        Ok(Self {
            gpu,
            repeats: settings.repeats.max(1),
            lengths: settings.lengths.max(3),
            memory: gpu.upload(&cycle(bytes))?,
            results: gpu.buffer(16)?,
            position: gpu.upload(&[0_u32])?,
            workgroup: info.max_group_invocations.clamp(1, 1024),
            start: 0,
        })
    }

    pub(super) fn bytes(&self) -> u64 {
        self.memory.size()
    }

    /// Seconds of a dispatch, the shortest of several.
    fn seconds(
        &mut self,
        kernel: &Kernel,
        buffers: &[&Buffer],
        groups: u32,
        immediates: &mut dyn FnMut() -> [u32; 5],
        words: usize,
    ) -> Result<f64, MicrobenchError> {
        let mut least = f64::INFINITY;
        for _ in 0..self.repeats {
            let values = immediates();
            let mut batch = self.gpu.batch()?;
            batch.mark("begin")?;
            match words {
                1 => batch.dispatch(kernel, buffers, &[values[0]], [groups, 1, 1])?,
                3 => batch.dispatch(
                    kernel,
                    buffers,
                    &[values[0], values[1], values[2]],
                    [groups, 1, 1],
                )?,
                _ => batch.dispatch(kernel, buffers, &values, [groups, 1, 1])?,
            };
            batch.mark("end")?;
            if let Some(seconds) = batch.submit()?.total() {
                least = least.min(seconds);
            }
        }
        Ok(least)
    }

    /// Times of growing lengths, of which the longest takes some milliseconds.
    fn fit(
        &mut self,
        what: &'static str,
        (kernel, buffers, groups, words): (&Kernel, &[&Buffer], u32, usize),
        immediates: &mut dyn FnMut(u32) -> [u32; 5],
        units_of_turn: f64,
    ) -> Result<Fit, MicrobenchError> {
        // Drivers compile at the first dispatch.
        self.seconds(kernel, buffers, groups, &mut || immediates(1), words)?;
        let mut most = 16;
        while most < MOST_TURNS
            && self.seconds(kernel, buffers, groups, &mut || immediates(most), words)? < 2e-3
        {
            most *= 2;
        }
        let mut fastest = vec![f64::INFINITY; self.lengths as usize];
        let mut best: Result<Fit, MicrobenchError> = Fit::of(what, Vec::new());
        for _ in 0..ATTEMPTS {
            let mut samples = Vec::with_capacity(fastest.len());
            for (i, fastest) in (1..=self.lengths).zip(&mut fastest) {
                let turns = (most * i / self.lengths).max(1);
                let time =
                    self.seconds(kernel, buffers, groups, &mut || immediates(turns), words)?;
                *fastest = fastest.min(time);
                samples.push((f64::from(turns) * units_of_turn, *fastest));
            }
            let residual = best.as_ref().map_or(f64::INFINITY, |fit| fit.residual);
            match Fit::of(what, samples) {
                Ok(fit) if fit.residual <= RESTLESS => return Ok(fit),
                Ok(fit) if fit.residual < residual => best = Ok(fit),
                Err(error) if best.is_err() => best = Err(error),
                _ => {}
            }
            // Something else used the device: it weighs less in longer runs.
            if most < MOST_TURNS {
                most *= 2;
                fastest.fill(f64::INFINITY);
            }
        }
        best
    }

    /// An operation that needs the one before.
    pub(super) fn chain(&mut self) -> Result<Fit, MicrobenchError> {
        let kernel = self.gpu.kernel("microbench/arithmetic", "chain", &[])?;
        let results = self.results.clone();
        let mut immediates = |turns| Arithmetic { turns }.words();
        self.fit("a chain of sums", (&kernel, &[&results], 1, 5), &mut immediates, CHAIN)
    }

    /// A multiply-add of a warp, with so many workgroups.
    pub(super) fn issue(&mut self, groups: u32) -> Result<Fit, MicrobenchError> {
        let kernel = self.kernel("microbench/arithmetic", "issue")?;
        let results = self.results.clone();
        let mut immediates = |turns| Arithmetic { turns }.words();
        let units = ISSUE * self.warps() * f64::from(groups);
        self.fit("arithmetic", (&kernel, &[&results], groups, 5), &mut immediates, units)
    }

    /// A load that needs the one before.
    pub(super) fn latency(&mut self) -> Result<Fit, MicrobenchError> {
        let kernel = self.gpu.kernel("microbench/chase", "main", &[])?;
        let (memory, position) = (self.memory.clone(), self.position.clone());
        // Each run goes on where the last one ended.
        let mut immediates = |turns: u32| [8 * turns, 0, 0, 0, 0];
        self.fit("pointer chasing", (&kernel, &[&memory, &position], 1, 1), &mut immediates, 8.0)
    }

    /// A load of a warp, from one core.
    pub(super) fn loads(&mut self, entry: &'static str) -> Result<Fit, MicrobenchError> {
        let kernel = self.kernel("microbench/loads", entry)?;
        let mask = to_u32(usize::try_from(self.bytes() / 4).unwrap_or_default()) - 1;
        let what = if entry == "coalesced" { "coalesced loads" } else { "uncoalesced loads" };
        let step = self.workgroup;
        self.streams(what, &kernel, 1, mask, step, LOADS * self.warps())
    }

    /// A byte, with all cores reading.
    pub(super) fn bandwidth(&mut self, groups: u32) -> Result<Fit, MicrobenchError> {
        let kernel = self.kernel("microbench/loads", "bandwidth")?;
        let mask = to_u32(usize::try_from(self.bytes() / 16).unwrap_or_default()) - 1;
        let threads = f64::from(groups) * f64::from(self.workgroup);
        self.streams("bandwidth", &kernel, groups, mask, 0, LOADS * 16.0 * threads)
    }

    fn streams(
        &mut self,
        what: &'static str,
        kernel: &Kernel,
        groups: u32,
        mask: u32,
        step: u32,
        units: f64,
    ) -> Result<Fit, MicrobenchError> {
        let (memory, results) = (self.memory.clone(), self.results.clone());
        let buffers: Vec<&Buffer> = kernel
            .bindings()
            .iter()
            .map(|binding| if binding.name == "results" { &results } else { &memory })
            .collect();
        let mut start = self.start;
        let mut immediates = |turns: u32| {
            let values = [turns, mask, start, 0, 0];
            start = start.wrapping_add(turns.wrapping_mul(16).wrapping_mul(step)) & mask;
            values
        };
        let fit = self.fit(what, (kernel, &buffers, groups, 3), &mut immediates, units);
        self.start = start;
        fit
    }

    fn kernel(&self, module: &str, entry: &str) -> Result<Kernel, MicrobenchError> {
        let constants = [("WORKGROUP", f64::from(self.workgroup))];
        Ok(self.gpu.kernel(module, entry, &constants)?)
    }

    /// Warps of a workgroup.
    fn warps(&self) -> f64 {
        f64::from(self.workgroup.div_ceil(self.gpu.info().subgroup_size.max(1)))
    }
}

/// Words of which those that lie `STRIDE` apart lead to each other in one cycle at random (Sattolo
/// 1986).
fn cycle(bytes: u64) -> Vec<u32> {
    let step = (STRIDE / 4) as usize;
    let mut words = vec![0_u32; usize::try_from(bytes / 4).unwrap_or_default()];
    let places = words.len() / step;
    let mut order: Vec<u32> = (0..to_u32(places)).collect();
    let mut state = 1_u64;
    for i in (1..places).rev() {
        // The upper half of a linear congruential generator (Knuth's MMIX).
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let other = (state >> 33) as usize % i;
        order.swap(i, other);
    }
    for (place, &next) in order.iter().enumerate() {
        words[place * step] = next * to_u32(step);
    }
    words
}

#[cfg(test)]
mod tests {
    use super::cycle;

    #[test]
    fn the_cycle_visits_every_line_once() {
        let words = cycle(1 << 16);
        let (mut at, mut steps) = (0, 0);
        loop {
            at = words[at] as usize;
            steps += 1;
            if at == 0 {
                break;
            }
        }
        assert_eq!(steps, (1 << 16) / 128);
    }
}

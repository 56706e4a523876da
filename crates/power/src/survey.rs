//! The first pass over a trace: what synchronisation and thresholds need, in memory that does not grow
//! with its length.

use crate::edges::{Edge, EdgeFinder};
use crate::{Mark, PowerBlock, PowerError, PowerStream};
use serde::Serialize;

/// Width of a bin to begin with, in nanoseconds.
const BIN_NS: i64 = 500_000;
/// Bins before their width doubles.
const MAX_BINS: usize = 1 << 22;
/// Classes of the distribution of power.
const CLASSES: usize = 4096;

/// Levels of power that a trace shows, in watts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Levels {
    /// Mean of the lowest tenth of the range: idle, if the device was ever idle.
    pub low_w: f64,
    /// The level that only one in twenty moments exceeds.
    pub high_w: f64,
    /// Deviation of a sample about a steady level.
    pub noise_w: f64,
}

impl Levels {
    /// A power that tells idle from busy: a quarter of the way up.
    #[must_use]
    pub fn idle_limit_w(&self) -> f64 {
        self.low_w + 0.25 * (self.high_w - self.low_w)
    }
}

/// Mean power over even bins of time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bins {
    /// Start of the first bin in nanoseconds of the trace.
    pub start_ns: i64,
    /// Width of a bin in nanoseconds.
    pub width_ns: i64,
    /// Mean power in watts; NaN where there are no samples.
    pub watts: Vec<f32>,
}

/// What the first pass finds.
#[derive(Debug)]
pub(crate) struct Survey {
    pub(crate) bins: Bins,
    pub(crate) levels: Levels,
    pub(crate) edges: Vec<Edge>,
    pub(crate) marks: Vec<Mark>,
    pub(crate) span_ns: (i64, i64),
    /// All power, if it was small enough to keep.
    pub(crate) kept: Option<Vec<PowerBlock>>,
    /// Energy of the whole trace without its holes, in joules, and the time that it was measured over.
    pub(crate) energy_j: f64,
    pub(crate) measured_s: f64,
    /// The usual time between rows.
    pub(crate) period_ns: f64,
}

impl Survey {
    /// When marks were given. They stand with the first sample after that, so on average half a period
    /// late.
    pub(crate) fn mark_times(&self) -> Vec<f64> {
        self.marks.iter().map(|m| m.time_ns as f64 - 0.5 * self.period_ns).collect()
    }
}

/// Surveys a stream. Power is kept if it takes no more than `keep_bytes`.
pub(crate) fn survey(
    stream: &mut impl PowerStream,
    keep_bytes: usize,
) -> Result<Survey, PowerError> {
    let mut bins: Option<Binner> = None;
    let mut spread = Spread::new();
    let mut edges = EdgeFinder::new();
    let mut marks = Vec::new();
    let mut kept = Some(Vec::new());
    let mut room = keep_bytes;
    let mut span = None;
    let (mut energy_j, mut measured_s) = (0.0, 0.0);
    let mut before: Option<(i64, f32)> = None;
    while let Some(block) = stream.next_power()? {
        let (Some(&first), Some(&last)) = (block.times_ns.first(), block.times_ns.last()) else {
            continue;
        };
        span = Some((span.map_or(first, |(start, _)| start), last));
        if block.follows_hole {
            before = None;
        }
        // Trapezoids over even steps share the step, but steps differ; half the sum of neighbours.
        let mut previous = before.unwrap_or((block.times_ns[0], block.watts[0]));
        measured_s += (last - previous.0) as f64 * 1e-9;
        let mut sum = 0.0;
        for (&time, &watts) in block.times_ns.iter().zip(&block.watts) {
            sum += (time - previous.0) as f64 * f64::from(watts + previous.1);
            previous = (time, watts);
        }
        energy_j += 0.5e-9 * sum;
        before = Some(previous);
        bins.get_or_insert_with(|| Binner::new(first)).push(&block);
        spread.push(&block);
        edges.push(&block);
        marks.extend_from_slice(&block.marks);
        let bytes = block.times_ns.len() * 12 + 256;
        room = room.saturating_sub(bytes);
        match &mut kept {
            Some(blocks) if room > 0 => blocks.push(block),
            kept => *kept = None,
        }
    }
    let (Some(bins), Some(span_ns)) = (bins, span) else { return Err(PowerError::Empty) };
    Ok(Survey {
        bins: bins.finish(),
        levels: spread.levels(),
        edges: edges.finish(),
        marks,
        span_ns,
        kept,
        energy_j,
        measured_s,
        period_ns: 0.0,
    })
}

struct Binner {
    start_ns: i64,
    width_ns: i64,
    sums: Vec<f32>,
    counts: Vec<u32>,
}

impl Binner {
    const fn new(start_ns: i64) -> Self {
        Self { start_ns, width_ns: BIN_NS, sums: Vec::new(), counts: Vec::new() }
    }

    fn push(&mut self, block: &PowerBlock) {
        let mut at = 0;
        let times = &block.times_ns;
        while at < times.len() {
            let bin = (times[at] - self.start_ns) / self.width_ns;
            let end_ns = self.start_ns + (bin + 1) * self.width_ns;
            let end = at + times[at..].partition_point(|&t| t < end_ns);
            let sum: f32 = block.watts[at..end].iter().sum();
            let mut bin = usize::try_from(bin).unwrap_or(0);
            while bin >= MAX_BINS {
                self.merge();
                bin /= 2;
            }
            if bin >= self.sums.len() {
                self.sums.resize(bin + 1, 0.0);
                self.counts.resize(bin + 1, 0);
            }
            self.sums[bin] += sum;
            self.counts[bin] += u32::try_from(end - at).unwrap_or(u32::MAX);
            at = end;
        }
    }

    fn merge(&mut self) {
        self.sums = self.sums.chunks(2).map(|pair| pair.iter().sum()).collect();
        self.counts = self.counts.chunks(2).map(|pair| pair.iter().sum()).collect();
        self.width_ns *= 2;
    }

    fn finish(self) -> Bins {
        let mean = |(sum, count): (&f32, &u32)| sum / *count as f32;
        let watts = self.sums.iter().zip(&self.counts).map(mean).collect();
        Bins { start_ns: self.start_ns, width_ns: self.width_ns, watts }
    }
}

/// The distribution of power, in classes whose width doubles as the range grows.
struct Spread {
    low: f64,
    width: f64,
    counts: Vec<u64>,
    noise: Vec<f32>,
}

impl Spread {
    fn new() -> Self {
        Self { low: 0.0, width: 0.0, counts: vec![0; CLASSES], noise: Vec::new() }
    }

    fn push(&mut self, block: &PowerBlock) {
        // Means of eight samples: noise would widen the levels.
        for chunk in block.watts.chunks(8) {
            self.add(f64::from(chunk.iter().sum::<f32>()) / chunk.len() as f64);
        }
        if self.noise.len() < 1 << 16 {
            // Second differences do not see slopes.
            let bends = block.watts.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs());
            self.noise.extend(bends.step_by(3).take(1 << 12));
        }
    }

    fn add(&mut self, watts: f64) {
        if self.width == 0.0 {
            self.width = (watts.abs() * 1e-3).max(1e-6);
            self.low = watts - 0.5 * self.width * CLASSES as f64;
        }
        loop {
            let class = (watts - self.low) / self.width;
            if class >= 0.0 && class < CLASSES as f64 {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "in range"
                )]
                let class = class as usize;
                self.counts[class] += 1;
                return;
            }
            // Twice as wide, to the side where the sample is.
            let mut counts = vec![0; CLASSES];
            let shift = if class < 0.0 { CLASSES } else { 0 };
            for (class, count) in self.counts.iter().enumerate() {
                counts[(class + shift) / 2] += count;
            }
            if class < 0.0 {
                self.low -= self.width * CLASSES as f64;
            }
            self.width *= 2.0;
            self.counts = counts;
        }
    }

    fn levels(mut self) -> Levels {
        let all: u64 = self.counts.iter().sum();
        let mid = |class: usize| self.low + (class as f64 + 0.5) * self.width;
        let quantile = |share: f64| {
            let mut below = 0;
            let wanted = share * all as f64;
            let class = self.counts.iter().position(|&count| {
                below += count;
                below as f64 >= wanted
            });
            mid(class.unwrap_or(0))
        };
        let (least, most) = (quantile(0.001), quantile(0.999));
        let limit = least + 0.1 * (most - least);
        let (mut sum, mut count) = (0.0, 0.0);
        for (class, &n) in self.counts.iter().enumerate() {
            if mid(class) <= limit {
                sum += mid(class) * n as f64;
                count += n as f64;
            }
        }
        let low_w = if count > 0.0 { sum / count } else { least };
        let noise_w = if self.noise.is_empty() {
            0.0
        } else {
            let middle = self.noise.len() / 2;
            let median = *self.noise.select_nth_unstable_by(middle, f32::total_cmp).1;
            f64::from(median) / (0.6745 * 6f64.sqrt())
        };
        Levels { low_w, high_w: quantile(0.95), noise_w }
    }
}

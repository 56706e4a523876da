//! Commands of a frame, stage by stage, with the time that the GPU takes for each.

use crate::{FrameError, Gpu};
use niwaki_core::to_u32;
use std::time::Duration;
use wgpu::BufferUsages;

/// A part of a frame's commands that was timed as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timed<S> {
    /// What it is.
    pub stage: S,
    /// Draw commands.
    pub draws: u32,
    /// Dispatches of kernels.
    pub dispatches: u32,
    /// When the GPU began and ended it, in nanoseconds of the GPU's clock, whose zero means
    /// nothing; `None` on devices without timestamps.
    pub span: Option<[f64; 2]>,
}

impl<S> Timed<S> {
    /// Time on the GPU; `None` on devices without timestamps.
    #[must_use]
    pub fn gpu_time(&self) -> Option<Duration> {
        self.span.map(|[begin, end]| Duration::from_secs_f64((end - begin).max(0.0) * 1e-9))
    }
}

/// Records stages one after another and submits them together.
#[derive(Debug)]
pub struct Recorder<'a, S> {
    gpu: &'a Gpu,
    encoder: wgpu::CommandEncoder,
    queries: Option<wgpu::QuerySet>,
    most: usize,
    stages: Vec<Timed<S>>,
}

impl<'a, S> Recorder<'a, S> {
    /// A recorder for up to `most` stages (at most 2,048); those after are recorded and not timed.
    #[must_use]
    pub fn new(gpu: &'a Gpu, most: u32) -> Self {
        let most = most.clamp(1, 2048);
        let queries = gpu.has_timestamps().then(|| {
            gpu.device().create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("stages"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * most,
            })
        });
        let encoder = gpu.device().create_command_encoder(&Default::default());
        Self { gpu, encoder, queries, most: most as usize, stages: Vec::new() }
    }

    /// The commands recorded so far, to add some that are not timed.
    pub const fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        &mut self.encoder
    }

    /// Records a stage; `work` returns how many draws and dispatches it recorded.
    pub fn stage(&mut self, stage: S, work: impl FnOnce(&mut wgpu::CommandEncoder) -> [u32; 2]) {
        let timed = self.stages.len() < self.most;
        let index = 2 * to_u32(self.stages.len());
        if let Some(queries) = self.queries.as_ref().filter(|_| timed) {
            self.encoder.write_timestamp(queries, index);
        }
        let [draws, dispatches] = work(&mut self.encoder);
        if let Some(queries) = self.queries.as_ref().filter(|_| timed) {
            self.encoder.write_timestamp(queries, index + 1);
        }
        self.stages.push(Timed { stage, draws, dispatches, span: None });
    }

    /// Submits everything, waits and reads the times.
    ///
    /// # Errors
    /// Faults of the recorded work, and the loss of the device.
    pub fn finish(mut self) -> Result<Vec<Timed<S>>, FrameError> {
        let count = 2 * self.stages.len().min(self.most);
        let resolved = match &self.queries {
            Some(queries) if count > 0 => {
                let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
                let buffer = self.gpu.buffer("times", 8 * count as u64, usage)?;
                self.encoder.resolve_query_set(queries, 0..to_u32(count), &buffer, 0);
                Some(buffer)
            }
            _ => None,
        };
        self.gpu.queue().submit([self.encoder.finish()]);
        self.gpu.wait()?;
        if let Some(buffer) = resolved {
            let ticks: Vec<u64> = self.gpu.read(&buffer, count)?;
            let period = f64::from(self.gpu.queue().get_timestamp_period());
            for (stage, pair) in self.stages.iter_mut().zip(ticks.chunks_exact(2)) {
                stage.span = Some([pair[0] as f64 * period, pair[1] as f64 * period]);
            }
        }
        Ok(self.stages)
    }
}

//! Timestamps.

use crate::{GpuError, device::DeviceInner};
use ash::vk;

/// Marks of a query pool.
const MARKS: u32 = 64;

/// Marks that were recorded and not yet read.
#[derive(Default)]
pub(crate) struct Marks {
    labels: Vec<String>,
    pools: Vec<vk::QueryPool>,
}

impl Marks {
    pub(crate) fn add(
        &mut self,
        device: &DeviceInner,
        commands: vk::CommandBuffer,
        label: String,
    ) -> Result<(), GpuError> {
        if device.info.timestamp_ns == 0.0 {
            return Ok(());
        }
        let index = niwaki_core::to_u32(self.labels.len()) % MARKS;
        if index == 0 {
            let create = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::TIMESTAMP)
                .query_count(MARKS);
            // SAFETY: plain numbers.
            let pool = unsafe { device.handle.create_query_pool(&create, None) }
                .map_err(|code| device.error("vkCreateQueryPool", code))?;
            self.pools.push(pool);
            // SAFETY: commands are being recorded, outside of a render pass.
            unsafe { device.handle.cmd_reset_query_pool(commands, pool, 0, MARKS) };
        }
        let Some(&pool) = self.pools.last() else { return Ok(()) };
        // SAFETY: as above; each query of the pool is used once after its reset.
        unsafe {
            let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
            device.handle.cmd_write_timestamp(commands, stage, pool, index);
        }
        self.labels.push(label);
        Ok(())
    }

    /// The marks, after the device has answered.
    pub(crate) fn read(&mut self, device: &DeviceInner) -> Result<Timings, GpuError> {
        let labels = std::mem::take(&mut self.labels);
        let mut marks = Vec::with_capacity(labels.len());
        for (labels, &pool) in labels.chunks(MARKS as usize).zip(&self.pools) {
            let mut ticks = vec![0_u64; labels.len()];
            // SAFETY: the pool has as many queries, and all were written.
            unsafe {
                let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
                device.handle.get_query_pool_results(pool, 0, &mut ticks, flags)
            }
            .map_err(|code| device.error("vkGetQueryPoolResults", code))?;
            let mask = device.timestamp_mask();
            marks.extend(labels.iter().cloned().zip(ticks.iter().map(|tick| tick & mask)));
        }
        Ok(Timings { marks, mask: device.timestamp_mask(), tick_ns: device.info.timestamp_ns })
    }

    /// # Safety
    /// The device must have answered, and the marks may not be used afterwards.
    pub(crate) unsafe fn destroy(&self, device: &ash::Device) {
        for &pool in &self.pools {
            // SAFETY: as the caller promises.
            unsafe { device.destroy_query_pool(pool, None) };
        }
    }
}

/// When the marks of a batch were reached.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timings {
    /// Labels and ticks.
    marks: Vec<(String, u64)>,
    mask: u64,
    tick_ns: f64,
}

impl Timings {
    /// Seconds from each mark to the next, with the label of the latter: what a pass took that ends
    /// with a mark. Empty on a device without timestamps.
    pub fn passes(&self) -> impl Iterator<Item = (&str, f64)> {
        self.marks.windows(2).map(|pair| (pair[1].0.as_str(), self.between(pair[0].1, pair[1].1)))
    }

    /// Seconds from the first mark to the last; `None` unless there are two.
    #[must_use]
    pub fn total(&self) -> Option<f64> {
        match self.marks.as_slice() {
            [(_, first), .., (_, last)] => Some(self.between(*first, *last)),
            _ => None,
        }
    }

    /// Counters wrap around.
    fn between(&self, a: u64, b: u64) -> f64 {
        (b.wrapping_sub(a) & self.mask) as f64 * self.tick_ns * 1e-9
    }
}

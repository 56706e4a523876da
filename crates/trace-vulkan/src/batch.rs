//! Commands for a device, recorded and then submitted together.

mod bind;

use crate::{
    Buffer, Device, GpuError, Kernel,
    memory::Allocation,
    timing::{Marks, Timings},
};
use ash::vk;
use bytemuck::NoUninit;
use std::{any::Any, sync::Arc};

/// Commands that run one after the other when they are submitted.
///
/// Every command sees what those before it wrote: there is a barrier between any two, unless
/// [`Batch::overlap`] says that the next one needs nothing of it. The batch keeps what its commands
/// use.
pub struct Batch {
    pub(crate) device: Device,
    pool: vk::CommandPool,
    pub(crate) commands: vk::CommandBuffer,
    descriptors: Vec<vk::DescriptorPool>,
    kept: Kept,
    marks: Marks,
    /// There is a command that no barrier follows.
    is_dirty: bool,
    /// Stages other than compute and transfer that have written since the last barrier.
    written_by: vk::PipelineStageFlags,
}

/// What is bound.
#[derive(Clone, Copy)]
pub(crate) enum Resource<'a> {
    Buffer(&'a Buffer),
    Structure(vk::AccelerationStructureKHR),
}

/// What the device reads and writes until it has answered.
#[derive(Default)]
struct Kept {
    memory: Vec<Arc<Allocation>>,
    kernels: Vec<Kernel>,
    others: Vec<Arc<dyn Any + Send + Sync>>,
}

impl std::fmt::Debug for Batch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Batch").field("kernels", &self.kept.kernels).finish_non_exhaustive()
    }
}

impl Drop for Batch {
    fn drop(&mut self) {
        let device = &self.device.inner;
        if device.is_hung() {
            return;
        }
        // SAFETY: the commands were never submitted, or the device has answered: `submit` waits. A
        // pool frees what is from it.
        unsafe {
            for &pool in &self.descriptors {
                device.handle.destroy_descriptor_pool(pool, None);
            }
            self.marks.destroy(&device.handle);
            device.handle.destroy_command_pool(self.pool, None);
        }
    }
}

impl Device {
    /// A batch without commands.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] and [`GpuError::DeviceLost`].
    pub fn batch(&self) -> Result<Batch, GpuError> {
        let device = &self.inner;
        device.check()?;
        let create = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(device.queue_family);
        // SAFETY: the family is that of the device's queue.
        let pool = unsafe { device.handle.create_command_pool(&create, None) }
            .map_err(|code| device.error("vkCreateCommandPool", code))?;
        let mut batch = Batch {
            device: self.clone(),
            pool,
            commands: vk::CommandBuffer::null(),
            descriptors: Vec::new(),
            kept: Kept::default(),
            marks: Marks::default(),
            is_dirty: false,
            written_by: vk::PipelineStageFlags::empty(),
        };
        let allocate = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool was just made.
        let made = unsafe { device.handle.allocate_command_buffers(&allocate) }
            .map_err(|code| device.error("vkAllocateCommandBuffers", code))?;
        batch.commands = made.first().copied().unwrap_or_default();
        let begin = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer is new.
        unsafe { device.handle.begin_command_buffer(batch.commands, &begin) }
            .map_err(|code| device.error("vkBeginCommandBuffer", code))?;
        Ok(batch)
    }
}

impl Batch {
    /// The next command neither reads nor overwrites what the one before it writes, so that both
    /// may run at the same time.
    pub fn overlap(&mut self) -> &mut Self {
        self.is_dirty = false;
        self
    }

    /// Runs `groups` workgroups of a kernel along x, y and z; nothing if one of the numbers is 0.
    ///
    /// `buffers` are bound in the order of [`Kernel::bindings`], and `immediates` is the value of
    /// the shader's `var<immediate>`, `()` without one.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] for a part of a buffer or a number of workgroups that the device does
    /// not allow, [`GpuError::Mismatch`] for buffers or immediates other than the shader declares,
    /// and [`GpuError::OutOfMemory`].
    pub fn dispatch<T: NoUninit>(
        &mut self,
        kernel: &Kernel,
        buffers: &[&Buffer],
        immediates: &T,
        groups: [u32; 3],
    ) -> Result<&mut Self, GpuError> {
        let resources: Vec<_> = buffers.iter().map(|&buffer| Resource::Buffer(buffer)).collect();
        self.dispatch_resources(kernel, &resources, immediates, groups)
    }

    /// [`Batch::dispatch`] with acceleration structures among what is bound, which the caller keeps.
    pub(crate) fn dispatch_resources<T: NoUninit>(
        &mut self,
        kernel: &Kernel,
        resources: &[Resource<'_>],
        immediates: &T,
        groups: [u32; 3],
    ) -> Result<&mut Self, GpuError> {
        let limits = self.device.info().max_groups;
        for (n, limit) in groups.into_iter().zip(limits) {
            if n > limit {
                return Err(GpuError::TooLarge {
                    what: format!("the number of workgroups of {}", kernel.inner.pipeline.label),
                    wanted: u64::from(n),
                    limit: u64::from(limit),
                    remedy: "use two dimensions (DeviceInfo::groups_for) or several dispatches",
                });
            }
        }
        if groups.contains(&0) {
            return Ok(self);
        }
        self.bind_kernel(kernel, resources, immediates)?;
        let [x, y, z] = groups;
        // SAFETY: commands are being recorded, everything is bound, and the numbers are within the
        // limits.
        unsafe { self.device.inner.handle.cmd_dispatch(self.commands, x, y, z) };
        Ok(self)
    }

    /// [`Batch::dispatch`] of as many workgroups as three `u32` at byte `start` of `groups` say
    /// when the command runs. They have to be within the device's limits.
    ///
    /// # Errors
    /// As [`Batch::dispatch`], and [`GpuError::OutOfRange`] if the three are not there.
    pub fn dispatch_indirect<T: NoUninit>(
        &mut self,
        kernel: &Kernel,
        buffers: &[&Buffer],
        immediates: &T,
        (groups, start): (&Buffer, u64),
    ) -> Result<&mut Self, GpuError> {
        let groups = groups.view(start, start.saturating_add(12))?;
        let resources: Vec<_> = buffers.iter().map(|&buffer| Resource::Buffer(buffer)).collect();
        self.bind_kernel(kernel, &resources, immediates)?;
        // SAFETY: commands are being recorded, everything is bound, and the three numbers are in
        // the buffer.
        unsafe {
            let (buffer, start) = (groups.allocation.buffer, groups.start);
            self.device.inner.handle.cmd_dispatch_indirect(self.commands, buffer, start);
        }
        self.keep(&groups.allocation);
        Ok(self)
    }

    /// Sets every word of a buffer.
    pub fn fill(&mut self, buffer: &Buffer, word: u32) -> &mut Self {
        let bytes = buffer.bound() / 4 * 4;
        self.barrier();
        // SAFETY: commands are being recorded; the part lies in the buffer and begins and ends at
        // multiples of 4.
        unsafe {
            self.device.inner.handle.cmd_fill_buffer(
                self.commands,
                buffer.allocation.buffer,
                buffer.start,
                bytes,
                word,
            );
        }
        self.keep(&buffer.allocation);
        self
    }

    /// Copies a buffer to another of the same size; the two may not overlap.
    ///
    /// # Errors
    /// [`GpuError::OutOfRange`] if the sizes differ or both are the same bytes.
    pub fn copy(&mut self, from: &Buffer, to: &Buffer) -> Result<&mut Self, GpuError> {
        let overlap = Arc::ptr_eq(&from.allocation, &to.allocation)
            && from.start < to.start + to.size()
            && to.start < from.start + from.size();
        if from.size() != to.size() || overlap {
            return Err(GpuError::OutOfRange { start: 0, end: from.size(), size: to.size() });
        }
        if from.size() > 0 {
            self.copy_raw((&from.allocation, from.start), (&to.allocation, to.start), from.size());
        }
        Ok(self)
    }

    /// Copies bytes that are there.
    pub(crate) fn copy_raw(
        &mut self,
        (from, from_start): (&Arc<Allocation>, u64),
        (to, to_start): (&Arc<Allocation>, u64),
        bytes: u64,
    ) {
        self.barrier();
        let region =
            vk::BufferCopy::default().src_offset(from_start).dst_offset(to_start).size(bytes);
        // SAFETY: commands are being recorded, and callers checked that both parts exist and do not
        // overlap.
        unsafe {
            let device = &self.device.inner.handle;
            device.cmd_copy_buffer(self.commands, from.buffer, to.buffer, &[region]);
        }
        self.keep(from);
        self.keep(to);
    }

    /// Notes when all commands so far have ended. Nothing on a device without timestamps.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`].
    pub fn mark(&mut self, label: impl Into<String>) -> Result<&mut Self, GpuError> {
        self.marks.add(&self.device.inner, self.commands, label.into())?;
        Ok(self)
    }

    /// Runs the commands and waits until they have ended.
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`], also if they take longer than [`crate::DeviceOptions::timeout`];
    /// [`GpuError::OutOfMemory`].
    pub fn submit(mut self) -> Result<Timings, GpuError> {
        let device = self.device.inner.clone();
        device.check()?;
        // What the commands wrote becomes visible to the host.
        self.is_dirty = true;
        self.barrier();
        // SAFETY: commands are being recorded.
        unsafe { device.handle.end_command_buffer(self.commands) }
            .map_err(|code| device.error("vkEndCommandBuffer", code))?;
        // SAFETY: no parameters.
        let fence = unsafe { device.handle.create_fence(&vk::FenceCreateInfo::default(), None) }
            .map_err(|code| device.error("vkCreateFence", code))?;
        let commands = [self.commands];
        let submits = [vk::SubmitInfo::default().command_buffers(&commands)];
        let submitted = {
            let queue = device.queue();
            // SAFETY: the queue is locked, the commands are complete and the fence is new.
            unsafe { device.handle.queue_submit(*queue, &submits, fence) }
        };
        let timeout = u64::try_from(device.timeout.as_nanos()).unwrap_or(u64::MAX);
        let ended = match submitted {
            // SAFETY: the fence was just submitted.
            Ok(()) => unsafe { device.handle.wait_for_fences(&[fence], true, timeout) }
                .map_err(|code| ("vkWaitForFences", code)),
            Err(code) => Err(("vkQueueSubmit", code)),
        };
        if let Err((_, vk::Result::TIMEOUT)) = ended {
            // Neither fence nor memory may be freed: `hang` sees to the latter.
            return Err(device.hang());
        }
        // SAFETY: the device has answered, or never got the fence, or is lost, after which it may
        // be freed too.
        unsafe { device.handle.destroy_fence(fence, None) };
        ended.map_err(|(call, code)| device.error(call, code))?;
        self.marks.read(&device)
    }

    /// Orders the next command after those before it.
    pub(crate) fn barrier(&mut self) {
        if std::mem::replace(&mut self.is_dirty, true) {
            let written_by = std::mem::take(&mut self.written_by);
            let all = vk::PipelineStageFlags::ALL_COMMANDS | vk::PipelineStageFlags::HOST;
            let mut from = vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE;
            let mut to = vk::AccessFlags::SHADER_READ
                | vk::AccessFlags::SHADER_WRITE
                | vk::AccessFlags::UNIFORM_READ
                | vk::AccessFlags::TRANSFER_READ
                | vk::AccessFlags::TRANSFER_WRITE
                | vk::AccessFlags::INDIRECT_COMMAND_READ
                | vk::AccessFlags::HOST_READ;
            if self.device.inner.ray_tracing.is_some() {
                to |= vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR
                    | vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR;
            }
            if written_by.contains(vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR) {
                from |= vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR;
            }
            let barrier = vk::MemoryBarrier::default().src_access_mask(from).dst_access_mask(to);
            let stages = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
            // SAFETY: commands are being recorded, outside of a render pass; stages and accesses of
            // ray tracing are named where its features are enabled.
            unsafe {
                self.device.inner.handle.cmd_pipeline_barrier(
                    self.commands,
                    stages | written_by,
                    all,
                    vk::DependencyFlags::empty(),
                    &[barrier],
                    &[],
                    &[],
                );
            }
        }
    }

    /// Says that the command that was just recorded writes in another stage than compute and
    /// transfer.
    pub(crate) fn note_stage(&mut self, stage: vk::PipelineStageFlags) {
        self.written_by |= stage;
    }

    /// Keeps what a command uses until the device has answered.
    pub(crate) fn keep_other(&mut self, other: Arc<dyn Any + Send + Sync>) {
        self.kept.others.push(other);
    }

    pub(crate) fn keep(&mut self, allocation: &Arc<Allocation>) {
        if !self.kept.memory.iter().rev().take(16).any(|kept| Arc::ptr_eq(kept, allocation)) {
            self.kept.memory.push(allocation.clone());
        }
    }
}

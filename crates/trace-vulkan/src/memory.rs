//! Buffers with memory of their own, freed together.

use crate::{GpuError, device::DeviceInner};
use ash::vk;
use std::sync::Arc;

/// Smallest size of a buffer: bindings may not be empty.
const SMALLEST: u64 = 16;

/// What memory is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// Read and written by kernels.
    Device,
    /// Mapped into the memory of the process.
    Host,
    /// Has an address that the driver's own ray tracing is given, for these uses and by kernels.
    /// Only on devices that have ray tracing.
    Addressed(vk::BufferUsageFlags),
}

/// A buffer and its memory.
pub(crate) struct Allocation {
    pub(crate) device: Arc<DeviceInner>,
    pub(crate) buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    /// Bytes of the buffer.
    pub(crate) size: u64,
}

impl Allocation {
    pub(crate) fn new(
        device: &Arc<DeviceInner>,
        size: u64,
        place: Place,
    ) -> Result<Self, GpuError> {
        device.check()?;
        let limit = device.info.max_buffer_bytes;
        if size > limit {
            return Err(GpuError::TooLarge {
                what: "a buffer, in bytes,".to_owned(),
                wanted: size,
                limit,
                remedy: "use several smaller ones",
            });
        }
        let size = size.next_multiple_of(SMALLEST).max(SMALLEST);
        let usage = match place {
            Place::Device => {
                vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::UNIFORM_BUFFER
                    | vk::BufferUsageFlags::INDIRECT_BUFFER
                    | vk::BufferUsageFlags::TRANSFER_SRC
                    | vk::BufferUsageFlags::TRANSFER_DST
            }
            Place::Host => vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST,
            Place::Addressed(uses) => {
                uses | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
                    | vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::TRANSFER_SRC
                    | vk::BufferUsageFlags::TRANSFER_DST
            }
        };
        let create = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: the device lives, and the size is neither zero nor above the limit.
        let buffer = unsafe { device.handle.create_buffer(&create, None) }.map_err(|code| {
            device.note(GpuError::of_memory("vkCreateBuffer", code, "a buffer", size))
        })?;
        // From here on, dropping this frees the buffer; null memory is ignored.
        let mut allocation =
            Self { device: device.clone(), buffer, memory: vk::DeviceMemory::null(), size };
        // SAFETY: the buffer was just made.
        let needs = unsafe { device.handle.get_buffer_memory_requirements(buffer) };
        let Some(memory_type) = memory_type(&device.memory, needs.memory_type_bits, place) else {
            return Err(GpuError::OutOfMemory {
                what: "memory of a kind it has not".into(),
                wanted: size,
            });
        };
        let mut flags =
            vk::MemoryAllocateFlagsInfo::default().flags(vk::MemoryAllocateFlags::DEVICE_ADDRESS);
        let mut allocate = vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(memory_type);
        if matches!(place, Place::Addressed(_)) {
            allocate = allocate.push_next(&mut flags);
        }
        // SAFETY: the type is one that the buffer allows.
        let memory = unsafe { device.handle.allocate_memory(&allocate, None) };
        allocation.memory = memory.map_err(|code| {
            device.note(GpuError::of_memory("vkAllocateMemory", code, "a buffer", size))
        })?;
        // SAFETY: both are new, the memory is large enough, and its type fits.
        unsafe { device.handle.bind_buffer_memory(buffer, allocation.memory, 0) }.map_err(
            |code| device.note(GpuError::of_memory("vkBindBufferMemory", code, "a buffer", size)),
        )?;
        Ok(allocation)
    }
}

impl Drop for Allocation {
    fn drop(&mut self) {
        if self.device.is_hung() {
            return;
        }
        // SAFETY: batches hold what they use until the device has answered, so nothing uses the
        // buffer any more.
        unsafe {
            self.device.handle.destroy_buffer(self.buffer, None);
            self.device.handle.free_memory(self.memory, None);
        }
    }
}

/// The best of the types that a buffer allows.
fn memory_type(
    memory: &vk::PhysicalDeviceMemoryProperties,
    allowed: u32,
    place: Place,
) -> Option<u32> {
    use vk::MemoryPropertyFlags as Flags;
    let types = memory.memory_types_as_slice();
    let with = |wanted: Flags| {
        let fits = |i: usize| allowed >> i & 1 == 1 && types[i].property_flags.contains(wanted);
        (0..types.len()).find(|&i| fits(i)).map(niwaki_core::to_u32)
    };
    let mapped = Flags::HOST_VISIBLE | Flags::HOST_COHERENT;
    match place {
        Place::Device | Place::Addressed(_) => {
            with(Flags::DEVICE_LOCAL).or_else(|| with(Flags::empty()))
        }
        // Uncached memory is read at a fraction of the speed.
        Place::Host => with(mapped | Flags::HOST_CACHED).or_else(|| with(mapped)),
    }
}

/// Memory that the process and the device both see, for copies.
pub(crate) struct Staging {
    pub(crate) allocation: Arc<Allocation>,
    address: *mut u8,
}

impl Staging {
    /// Most bytes of a copy: larger ones are done piece by piece.
    pub(crate) const PIECE: u64 = 32 << 20;

    /// Room for a copy of `size` bytes, or for a piece of it.
    pub(crate) fn new(device: &Arc<DeviceInner>, size: u64) -> Result<Self, GpuError> {
        let allocation = Allocation::new(device, size.min(Self::PIECE), Place::Host)?;
        // SAFETY: the memory is host-visible, bound, not mapped yet, and unmapped by being freed.
        let address = unsafe {
            device.handle.map_memory(
                allocation.memory,
                0,
                vk::WHOLE_SIZE,
                vk::MemoryMapFlags::empty(),
            )
        };
        let address = address.map_err(|code| {
            device.note(GpuError::of_memory("vkMapMemory", code, "a copy", size))
        })?;
        Ok(Self { allocation: Arc::new(allocation), address: address.cast() })
    }

    /// Puts bytes there; no more than fit.
    pub(crate) fn write(&mut self, bytes: &[u8]) {
        assert!(bytes.len() as u64 <= self.allocation.size, "a piece fits");
        // SAFETY: the memory is mapped and as long as just checked, and the device does not use it
        // now, as every submission is waited for.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), self.address, bytes.len()) };
    }

    /// Takes bytes from there; no more than are there.
    pub(crate) fn read(&self, bytes: &mut [u8]) {
        assert!(bytes.len() as u64 <= self.allocation.size, "a piece fits");
        // SAFETY: as in `write`.
        unsafe { std::ptr::copy_nonoverlapping(self.address, bytes.as_mut_ptr(), bytes.len()) };
    }
}

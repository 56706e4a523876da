//! Memory of a device.

use crate::{
    Device, GpuError,
    memory::{Allocation, Place, Staging},
};
use bytemuck::{AnyBitPattern, NoUninit};
use std::sync::Arc;

/// A part of the memory of a [`Device`], which kernels read and write.
///
/// Clones and [views](Buffer::view) share the memory.
#[derive(Clone)]
pub struct Buffer {
    pub(crate) allocation: Arc<Allocation>,
    pub(crate) device: Device,
    pub(crate) start: u64,
    size: u64,
}

impl std::fmt::Debug for Buffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Buffer").field("start", &self.start).field("size", &self.size).finish()
    }
}

impl Device {
    /// A buffer of `size` bytes with any contents.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`], [`GpuError::TooLarge`] and [`GpuError::DeviceLost`].
    pub fn buffer(&self, size: u64) -> Result<Buffer, GpuError> {
        let allocation = Arc::new(Allocation::new(&self.inner, size, Place::Device)?);
        Ok(Buffer { allocation, device: self.clone(), start: 0, size })
    }

    /// A buffer with an address, for the driver's own ray tracing; on devices that have it.
    pub(crate) fn addressed(
        &self,
        size: u64,
        uses: ash::vk::BufferUsageFlags,
    ) -> Result<Buffer, GpuError> {
        let place = Place::Addressed(uses);
        let allocation = Arc::new(Allocation::new(&self.inner, size, place)?);
        Ok(Buffer { allocation, device: self.clone(), start: 0, size })
    }

    /// A buffer with these contents.
    ///
    /// # Errors
    /// As [`Device::buffer`].
    pub fn upload<T: NoUninit>(&self, contents: &[T]) -> Result<Buffer, GpuError> {
        let buffer = self.buffer(size_of_val(contents) as u64)?;
        buffer.write(0, contents)?;
        Ok(buffer)
    }
}

impl Buffer {
    /// Its size in bytes.
    #[must_use]
    pub const fn size(&self) -> u64 {
        self.size
    }

    /// Its address, if it is of [`Device::addressed`].
    pub(crate) fn address(&self) -> u64 {
        let info = ash::vk::BufferDeviceAddressInfo::default().buffer(self.allocation.buffer);
        // SAFETY: callers give buffers that were made for it, on a device with the feature.
        let first = unsafe { self.device.inner.handle.get_buffer_device_address(&info) };
        first + self.start
    }

    /// Bytes that are bound: never none, whatever the size.
    pub(crate) fn bound(&self) -> u64 {
        self.size.next_multiple_of(4).max(4).min(self.allocation.size - self.start)
    }

    /// The bytes from `start` to `end` as a buffer of its own, in the same memory.
    ///
    /// # Errors
    /// [`GpuError::OutOfRange`] unless the part lies inside and begins at a multiple of 4.
    pub fn view(&self, start: u64, end: u64) -> Result<Self, GpuError> {
        if start > end || end > self.size || !start.is_multiple_of(4) {
            return Err(GpuError::OutOfRange { start, end, size: self.size });
        }
        let start_inside = self.start + start;
        Ok(Self {
            allocation: self.allocation.clone(),
            device: self.device.clone(),
            start: start_inside,
            size: end - start,
        })
    }

    /// Replaces the contents from byte `start` on. Returns when the device has them.
    ///
    /// # Errors
    /// [`GpuError::OutOfRange`] if they do not fit, and as [`Device::buffer`].
    pub fn write<T: NoUninit>(&self, start: u64, contents: &[T]) -> Result<(), GpuError> {
        let bytes: &[u8] = bytemuck::cast_slice(contents);
        let target = self.view(start, start.saturating_add(bytes.len() as u64))?;
        if bytes.is_empty() {
            return Ok(());
        }
        let mut staging = Staging::new(&self.device.inner, bytes.len() as u64)?;
        let mut done = 0;
        #[expect(clippy::cast_possible_truncation, reason = "32 MiB")]
        for piece in bytes.chunks(Staging::PIECE as usize) {
            staging.write(piece);
            let mut batch = self.device.batch()?;
            batch.copy_raw(
                (&staging.allocation, 0),
                (&target.allocation, target.start + done),
                piece.len() as u64,
            );
            batch.submit()?;
            done += piece.len() as u64;
        }
        Ok(())
    }

    /// The contents, as many whole values as there are.
    ///
    /// # Errors
    /// As [`Device::buffer`].
    pub fn read<T: AnyBitPattern + NoUninit>(&self) -> Result<Vec<T>, GpuError> {
        let count = usize::try_from(self.size).unwrap_or(usize::MAX) / size_of::<T>().max(1);
        let mut contents = vec![T::zeroed(); count];
        self.read_into(&mut contents)?;
        Ok(contents)
    }

    /// Reads the first values into a slice.
    ///
    /// # Errors
    /// [`GpuError::OutOfRange`] if there are not as many, and as [`Device::buffer`].
    pub fn read_into<T: AnyBitPattern + NoUninit>(
        &self,
        contents: &mut [T],
    ) -> Result<(), GpuError> {
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(contents);
        let source = self.view(0, bytes.len() as u64)?;
        if bytes.is_empty() {
            return Ok(());
        }
        let staging = Staging::new(&self.device.inner, bytes.len() as u64)?;
        let mut done = 0;
        #[expect(clippy::cast_possible_truncation, reason = "32 MiB")]
        for piece in bytes.chunks_mut(Staging::PIECE as usize) {
            let mut batch = self.device.batch()?;
            batch.copy_raw(
                (&source.allocation, source.start + done),
                (&staging.allocation, 0),
                piece.len() as u64,
            );
            batch.submit()?;
            staging.read(piece);
            done += piece.len() as u64;
        }
        Ok(())
    }
}

//! Short ways to make what passes are made of, and to read what they made.

use super::Gpu;
use crate::{FrameError, Slot};

impl Gpu {
    /// A buffer of at least `size` bytes, and at least one element of whatever it holds, as kernels
    /// cannot bind less.
    ///
    /// # Errors
    /// [`FrameError::TooLarge`] and [`FrameError::OutOfMemory`].
    pub fn buffer(
        &self,
        label: &str,
        size: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, FrameError> {
        let size = size.max(256).next_multiple_of(16);
        let mut limit = self.limits.max_buffer_size;
        if usage.contains(wgpu::BufferUsages::STORAGE) {
            limit = limit.min(self.limits.max_storage_buffer_binding_size);
        }
        if size > limit {
            return Err(FrameError::TooLarge {
                what: format!("the buffer of {label}"),
                wanted: size,
                limit,
                remedy: "use a smaller image or a scene of fewer triangles, or a device with \
                         larger storage buffers",
            });
        }
        let descriptor = wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        };
        let buffer = self.device.create_buffer(&descriptor);
        self.check()?;
        Ok(buffer)
    }

    /// A buffer that holds `data`.
    ///
    /// # Errors
    /// As [`Gpu::buffer`].
    pub fn upload<T: bytemuck::Pod>(
        &self,
        label: &str,
        data: &[T],
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, FrameError> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let buffer = self.buffer(label, bytes.len() as u64, usage)?;
        self.queue.write_buffer(&buffer, 0, bytes);
        Ok(buffer)
    }

    /// A texture of `layers` layers that can be bound and, unless it holds an upload, drawn to.
    ///
    /// # Errors
    /// [`FrameError::TooLarge`] and [`FrameError::OutOfMemory`].
    pub fn texture(
        &self,
        label: &str,
        size: [u32; 3],
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> Result<wgpu::Texture, FrameError> {
        self.mipped_texture(label, size, 1, format, usage)
    }

    /// A texture as [`Gpu::texture`] with this many mip levels.
    ///
    /// # Errors
    /// As [`Gpu::texture`].
    pub fn mipped_texture(
        &self,
        label: &str,
        size: [u32; 3],
        levels: u32,
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> Result<wgpu::Texture, FrameError> {
        let [width, height, layers] = size.map(|n| n.max(1));
        self.fits(label, width.max(height))?;
        if layers > self.limits.max_texture_array_layers {
            return Err(FrameError::TooLarge {
                what: format!("the layers of {label}"),
                wanted: layers.into(),
                limit: self.limits.max_texture_array_layers.into(),
                remedy: "use fewer lights or smaller textures",
            });
        }
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: layers },
            mip_level_count: levels,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: usage | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        self.check()?;
        Ok(texture)
    }

    /// Refuses images with a side longer than the device allows.
    ///
    /// # Errors
    /// [`FrameError::TooLarge`].
    pub fn fits(&self, what: &str, side: u32) -> Result<(), FrameError> {
        let limit = self.limits.max_texture_dimension_2d;
        if side <= limit {
            return Ok(());
        }
        Err(FrameError::TooLarge {
            what: what.into(),
            wanted: side.into(),
            limit: limit.into(),
            remedy: "use a smaller image or map",
        })
    }

    /// Compiles a module; faults name it.
    ///
    /// # Errors
    /// [`FrameError::Shader`].
    pub fn module(&self, name: &str, source: String) -> Result<wgpu::ShaderModule, FrameError> {
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let descriptor = wgpu::ShaderModuleDescriptor {
            label: Some(name),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        };
        let module = self.device.create_shader_module(descriptor);
        match pollster::block_on(scope.pop()) {
            None => Ok(module),
            Some(error) => {
                Err(FrameError::Shader { module: name.into(), message: error.to_string() })
            }
        }
    }

    /// The layout of a bind group, bindings numbered in order.
    #[must_use]
    pub fn layout(&self, label: &str, slots: &[Slot]) -> wgpu::BindGroupLayout {
        let entries: Vec<_> = (0..).zip(slots).map(|(i, slot)| slot.entry(i)).collect();
        self.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(label),
            entries: &entries,
        })
    }

    /// A bind group with these resources, in order.
    #[must_use]
    pub fn bind(
        &self,
        layout: &wgpu::BindGroupLayout,
        resources: &[wgpu::BindingResource<'_>],
    ) -> wgpu::BindGroup {
        let entries: Vec<_> = (0..)
            .zip(resources)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout,
            entries: &entries,
        })
    }

    /// A compute pipeline.
    ///
    /// # Errors
    /// [`FrameError::Gpu`].
    pub fn compute(
        &self,
        module: &wgpu::ShaderModule,
        entry: &str,
        layouts: &[&wgpu::BindGroupLayout],
        constants: &[(&str, f64)],
    ) -> Result<wgpu::ComputePipeline, FrameError> {
        let layout = self.pipeline_layout(layouts);
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: Some(&layout),
            module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                ..wgpu::PipelineCompilationOptions::default()
            },
            cache: None,
        });
        self.check()?;
        Ok(pipeline)
    }

    /// The layout of a pipeline that takes groups of these layouts, in order.
    #[must_use]
    pub fn pipeline_layout(&self, layouts: &[&wgpu::BindGroupLayout]) -> wgpu::PipelineLayout {
        let layouts: Vec<_> = layouts.iter().map(|l| Some(*l)).collect();
        self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &layouts,
            immediate_size: 0,
        })
    }

    /// Copies the first layer and level of a texture to the CPU, rows from the top and without
    /// gaps, and waits for it. A pixel of the copied aspect must have the size of `T`.
    ///
    /// # Errors
    /// As [`Gpu::buffer`] and [`Gpu::wait`].
    pub fn read_texture<T: bytemuck::Pod>(
        &self,
        texture: &wgpu::Texture,
        aspect: wgpu::TextureAspect,
    ) -> Result<Vec<T>, FrameError> {
        let (width, height) = (texture.width(), texture.height());
        let row = width as usize * size_of::<T>();
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT as usize);
        let bytes = padded * height as usize;
        let buffer =
            self.buffer("copy of a texture", bytes as u64, wgpu::BufferUsages::COPY_SRC)?;
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                texture,
                mip_level: 0,
                origin: wgpu::Origin3d::ZERO,
                aspect,
            },
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(niwaki_core::to_u32(padded)),
                    rows_per_image: Some(height),
                },
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
        self.queue.submit([encoder.finish()]);
        let all: Vec<u8> = self.read(&buffer, bytes)?;
        let rows = all.chunks_exact(padded.max(1)).flat_map(|r| r.split_at(row).0);
        Ok(bytemuck::pod_collect_to_vec(&rows.copied().collect::<Vec<u8>>()))
    }

    /// Copies a buffer to the CPU and waits for it.
    ///
    /// # Errors
    /// As [`Gpu::wait`].
    pub fn read<T: bytemuck::Pod>(
        &self,
        buffer: &wgpu::Buffer,
        count: usize,
    ) -> Result<Vec<T>, FrameError> {
        if count == 0 {
            return Ok(Vec::new());
        }
        let bytes = (count * size_of::<T>()) as u64;
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size: bytes.next_multiple_of(4),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes.next_multiple_of(4));
        self.queue.submit([encoder.finish()]);
        staging.slice(..).map_async(wgpu::MapMode::Read, |_| {});
        self.wait()?;
        let mapped = staging
            .slice(..)
            .get_mapped_range()
            .map_err(|e| FrameError::DeviceLost(e.to_string()))?;
        let (bytes, _) = mapped.split_at(count * size_of::<T>());
        Ok(bytemuck::pod_collect_to_vec(bytes))
    }
}

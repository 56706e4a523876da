//! The renderer's image on a window, under text.

use super::text::{Page, font};
use anyhow::{Result, bail};
use bytemuck::{Pod, Zeroable};
use wgpu::{BufferUsages, ShaderStages};

/// A window's surface and what draws on it.
pub(super) struct Presenter {
    device: wgpu::Device,
    queue: wgpu::Queue,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    layout: wgpu::BindGroupLayout,
    meter_layout: wgpu::BindGroupLayout,
    meter: wgpu::ComputePipeline,
    show: wgpu::RenderPipeline,
    uniform: wgpu::Buffer,
    exposure: wgpu::Buffer,
    font: wgpu::Buffer,
}

/// The renderer's image and how it is shown.
#[derive(Clone, Copy)]
pub(super) struct Shown<'a> {
    /// A vector of four a pixel, rows from the top.
    pub(super) image: &'a wgpu::Buffer,
    pub(super) size: [u32; 2],
    /// Brightness in stops; with `None` that of middle grey and `bias` stops more.
    pub(super) stops: Option<f32>,
    pub(super) bias: f32,
    /// Compress highlights.
    pub(super) shoulder: bool,
}

/// The twin of `Show` in `present.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Uniform {
    image: [u32; 2],
    window: [u32; 2],
    factor: f32,
    automatic: u32,
    shoulder: u32,
    linear: u32,
    panels: u32,
    pad: u32,
}

impl Presenter {
    /// Takes over a surface that the adapter can present to.
    pub(super) fn new(
        adapter: &wgpu::Adapter,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        surface: wgpu::Surface<'static>,
        size: [u32; 2],
    ) -> Result<Self> {
        let offered = surface.get_capabilities(adapter).formats;
        // The shader encodes, so that text is mixed with the picture as it is seen.
        let plain = offered.iter().find(|format| {
            matches!(format, wgpu::TextureFormat::Bgra8Unorm | wgpu::TextureFormat::Rgba8Unorm)
        });
        let Some(format) = plain.or(offered.first()).copied() else {
            bail!(
                "{} cannot draw on this window; leave --window out for pictures in files",
                adapter.get_info().name
            );
        };
        let Some(mut config) = surface.get_default_config(adapter, size[0].max(1), size[1].max(1))
        else {
            bail!("this window offers no way to draw; leave --window out for pictures in files");
        };
        config.format = format;
        config.present_mode = wgpu::PresentMode::AutoVsync;
        let module = device.create_shader_module(wgpu::include_wgsl!("present.wgsl"));
        let entry = |binding, visibility, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let read = wgpu::BufferBindingType::Storage { read_only: true };
        let write = wgpu::BufferBindingType::Storage { read_only: false };
        let uniform = wgpu::BufferBindingType::Uniform;
        let make = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            let label = Some(label);
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries })
        };
        let (fragment, compute) = (ShaderStages::FRAGMENT, ShaderStages::COMPUTE);
        let layout = make(
            "present",
            &[
                entry(0, fragment, uniform),
                entry(1, fragment, read),
                entry(3, fragment, read),
                entry(4, fragment, read),
                entry(5, fragment, read),
                entry(6, fragment, read),
            ],
        );
        let meter_layout = make(
            "meter",
            &[entry(0, compute, uniform), entry(1, compute, read), entry(2, compute, write)],
        );
        let pipeline_layout = |layout| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: None,
                bind_group_layouts: &[Some(layout)],
                immediate_size: 0,
            })
        };
        let meter = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("meter"),
            layout: Some(&pipeline_layout(&meter_layout)),
            module: &module,
            entry_point: Some("meter"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let show = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("present"),
            layout: Some(&pipeline_layout(&layout)),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("corner"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("shown"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(config.format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let buffer = |label, size, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let uniform = buffer(
            "present",
            size_of::<Uniform>() as u64,
            BufferUsages::UNIFORM | BufferUsages::COPY_DST,
        );
        let exposure = buffer("exposure", 16, BufferUsages::STORAGE);
        let font = upload(device, "font", bytemuck::cast_slice(&font()));
        let mut presenter = Self {
            device: device.clone(),
            queue: queue.clone(),
            surface,
            config,
            layout,
            meter_layout,
            meter,
            show,
            uniform,
            exposure,
            font,
        };
        presenter.resize(size);
        Ok(presenter)
    }

    /// The window has another size. A minimised one has none, and keeps what it had.
    pub(super) fn resize(&mut self, size: [u32; 2]) {
        if size.contains(&0) {
            return;
        }
        let most = self.device.limits().max_texture_dimension_2d;
        [self.config.width, self.config.height] = size.map(|side| side.min(most));
        self.surface.configure(&self.device, &self.config);
    }

    /// Draws the image and text over it. False if the window could not take it now.
    pub(super) fn present(&mut self, shown: Option<Shown<'_>>, page: &Page) -> Result<bool> {
        use wgpu::CurrentSurfaceTexture as Current;
        let frame = match self.surface.get_current_texture() {
            Current::Success(frame) => frame,
            Current::Suboptimal(frame) => {
                // It would be stretched; the next one fits.
                drop(frame);
                self.surface.configure(&self.device, &self.config);
                return Ok(false);
            }
            Current::Outdated => {
                self.surface.configure(&self.device, &self.config);
                return Ok(false);
            }
            Current::Timeout | Current::Occluded => return Ok(false),
            Current::Lost => bail!("the window's surface was lost; start again"),
            Current::Validation => bail!("the graphics library refused the window's surface"),
        };
        if let Some(shown) = shown {
            self.draw(&frame, shown, page);
        }
        self.queue.present(frame);
        Ok(true)
    }

    fn draw(&self, frame: &wgpu::SurfaceTexture, shown: Shown<'_>, page: &Page) {
        let view = frame.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let uniform = Uniform {
            image: shown.size,
            window: [frame.texture.width(), frame.texture.height()],
            factor: shown.stops.unwrap_or(shown.bias).exp2(),
            automatic: shown.stops.is_none().into(),
            shoulder: shown.shoulder.into(),
            linear: self.config.format.is_srgb().into(),
            panels: niwaki_core::to_u32(page.panels.len()),
            pad: 0,
        };
        self.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
        let panels = upload(&self.device, "panels", bytemuck::cast_slice(&page.panels));
        let cells = upload(&self.device, "cells", bytemuck::cast_slice(&page.cells));
        let bind = |layout, buffers: &[(u32, &wgpu::Buffer)]| {
            let entries: Vec<_> = buffers
                .iter()
                .map(|(binding, buffer)| wgpu::BindGroupEntry {
                    binding: *binding,
                    resource: buffer.as_entire_binding(),
                })
                .collect();
            self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout,
                entries: &entries,
            })
        };
        let mut encoder = self.device.create_command_encoder(&Default::default());
        if shown.stops.is_none() {
            let buffers = [(0, &self.uniform), (1, shown.image), (2, &self.exposure)];
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.meter);
            pass.set_bind_group(0, &bind(&self.meter_layout, &buffers), &[]);
            pass.dispatch_workgroups(1, 1, 1);
        }
        let buffers = [
            (0, &self.uniform),
            (1, shown.image),
            (3, &self.exposure),
            (4, &panels),
            (5, &cells),
            (6, &self.font),
        ];
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("present"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_pipeline(&self.show);
        pass.set_bind_group(0, &bind(&self.layout, &buffers), &[]);
        pass.draw(0..3, 0..1);
        drop(pass);
        self.queue.submit([encoder.finish()]);
    }
}

/// A buffer that fragments read; never empty, as nothing else can be bound.
fn upload(device: &wgpu::Device, label: &str, bytes: &[u8]) -> wgpu::Buffer {
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: (bytes.len().max(64) as u64).next_multiple_of(4),
        usage: BufferUsages::STORAGE,
        mapped_at_creation: true,
    });
    if let Ok(mut mapped) = buffer.slice(..).get_mapped_range_mut() {
        mapped.slice(..bytes.len()).copy_from_slice(bytes);
    }
    buffer.unmap();
    buffer
}

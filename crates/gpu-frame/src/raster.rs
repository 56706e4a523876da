//! The passes that rasterise a scene's triangles: the G-buffer, shadow maps, depth alone.

use crate::{FrameError, Gpu};

/// Format of a G-buffer's surfaces: `x` normal, `y` base colour, `z` material, metallic and
/// roughness, `w` emission (`frame/gbuffer.wgsl`).
pub const SURFACE: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;
/// Format of a G-buffer's triangles: their numbers from 1, 0 is background.
pub const TRIANGLE: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;
/// Format of depth, 1 at the near plane and 0 infinitely far.
pub const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// A pipeline that draws a scene's triangles, both sides of them.
#[derive(Debug)]
pub struct RasterPipeline<'a> {
    /// What it is called in error messages.
    pub label: &'a str,
    /// The module of both stages.
    pub module: &'a wgpu::ShaderModule,
    /// Layouts of what it binds, in order.
    pub layouts: &'a [&'a wgpu::BindGroupLayout],
    /// Entry of the vertex stage.
    pub vertex: &'a str,
    /// Entry of the fragment stage, if there is one.
    pub fragment: Option<&'a str>,
    /// Constants of the fragment stage.
    pub constants: &'a [(&'a str, f64)],
    /// What it writes.
    pub targets: &'a [Option<wgpu::ColorTargetState>],
    /// Depth and stencil, if it has any.
    pub depth: Option<wgpu::DepthStencilState>,
    /// Vertices come from the buffers of [`Surfaces`](crate::Surfaces), not from the shader alone.
    pub reads_vertices: bool,
    /// Which side is left out.
    pub cull: Option<wgpu::Face>,
}

/// A target that is written as it is.
#[must_use]
pub const fn opaque(format: wgpu::TextureFormat) -> Option<wgpu::ColorTargetState> {
    Some(wgpu::ColorTargetState { format, blend: None, write_mask: wgpu::ColorWrites::ALL })
}

/// Depth that is compared and, if `write`, written.
#[must_use]
pub fn depth_state(compare: wgpu::CompareFunction, write: bool) -> wgpu::DepthStencilState {
    wgpu::DepthStencilState {
        format: DEPTH,
        depth_write_enabled: Some(write),
        depth_compare: Some(compare),
        stencil: wgpu::StencilState::default(),
        bias: wgpu::DepthBiasState::default(),
    }
}

impl RasterPipeline<'_> {
    /// Makes the pipeline.
    ///
    /// # Errors
    /// [`FrameError::Gpu`] for what does not fit together.
    pub fn make(&self, gpu: &Gpu) -> Result<wgpu::RenderPipeline, FrameError> {
        let attribute = |offset, shader_location, format| wgpu::VertexAttribute {
            format,
            offset,
            shader_location,
        };
        let attributes = [
            attribute(0, 0, wgpu::VertexFormat::Float32x3),
            attribute(12, 1, wgpu::VertexFormat::Float32),
            attribute(16, 2, wgpu::VertexFormat::Float32x3),
            attribute(28, 3, wgpu::VertexFormat::Float32),
        ];
        let buffers = [Some(wgpu::VertexBufferLayout {
            array_stride: 32,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &attributes,
        })];
        let layout = gpu.pipeline_layout(self.layouts);
        let options = wgpu::PipelineCompilationOptions {
            constants: self.constants,
            ..wgpu::PipelineCompilationOptions::default()
        };
        let pipeline = gpu.device().create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(self.label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: self.module,
                entry_point: Some(self.vertex),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: if self.reads_vertices { &buffers } else { &[] },
            },
            primitive: wgpu::PrimitiveState {
                cull_mode: self.cull,
                ..wgpu::PrimitiveState::default()
            },
            depth_stencil: self.depth.clone(),
            multisample: wgpu::MultisampleState::default(),
            fragment: self.fragment.map(|entry| wgpu::FragmentState {
                module: self.module,
                entry_point: Some(entry),
                compilation_options: options,
                targets: self.targets,
            }),
            multiview_mask: None,
            cache: None,
        });
        gpu.check()?;
        Ok(pipeline)
    }
}

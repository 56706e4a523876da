//! Shader modules and pipelines, made when a frame first needs them.

use crate::{
    Behind, DebugView, Effect, EffectPlan, Gpu, HybridError, SampleRule, Settings, gpu::Slot,
};
use std::collections::HashMap;

/// Formats of a G-buffer: the surface, and in the primary view the triangle.
pub(crate) const SURFACE: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;
pub(crate) const TRIANGLE: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;
pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// What is rasterised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Target {
    Primary,
    Face,
    Shadow,
}

/// What a kernel leaves out or puts in; parts that do not differ share a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Variant {
    pub(crate) alpha: bool,
    pub(crate) trace_shadows: bool,
    pub(crate) map_shadows: bool,
    pub(crate) holds_all: bool,
    pub(crate) follow: bool,
    pub(crate) reflect: bool,
    pub(crate) refract: bool,
    pub(crate) use_map: bool,
    pub(crate) as_printed: bool,
    pub(crate) go_on: bool,
    pub(crate) debug_view: u32,
}

impl Variant {
    pub(crate) fn new(plan: &EffectPlan, settings: &Settings) -> Self {
        let faces = crate::Face::ALL.iter().any(|f| plan.uses(Effect::CubeFace(*f)));
        Self {
            alpha: plan.uses(Effect::Alpha),
            trace_shadows: plan.uses(Effect::ShadowRays),
            map_shadows: plan.uses(Effect::ShadowMaps),
            holds_all: plan.region_holds_all,
            follow: plan.follows_rays(),
            reflect: plan.uses(Effect::ReflectionRays),
            refract: plan.uses(Effect::RefractionRays),
            use_map: faces,
            as_printed: settings.march.rule == SampleRule::AsPrinted,
            go_on: settings.behind == Behind::GoOn,
            debug_view: match settings.debug_view {
                DebugView::None => 0,
                DebugView::HitSource => 1,
                DebugView::Normal => 2,
                DebugView::MarchSteps => 3,
            },
        }
    }

    /// Constants of `hybrid/primary.wgsl`.
    fn primary(&self) -> Vec<(&'static str, f64)> {
        let flag = |b: bool| f64::from(u8::from(b));
        vec![
            ("ALPHA", flag(self.alpha)),
            ("TRACE_SHADOWS", flag(self.trace_shadows)),
            ("MAP_SHADOWS", flag(self.map_shadows)),
            ("HOLDS_ALL", flag(self.holds_all)),
            ("DEBUG_VIEW", f64::from(self.debug_view)),
        ]
    }
}

/// All modules and the pipelines that were needed so far.
pub(crate) struct Pipelines {
    raster: wgpu::ShaderModule,
    primary: wgpu::ShaderModule,
    trace: wgpu::ShaderModule,
    deform: wgpu::ShaderModule,
    size: wgpu::ShaderModule,
    pub(crate) view_layout: wgpu::BindGroupLayout,
    pub(crate) kernel_layout: wgpu::BindGroupLayout,
    pub(crate) deform_layout: wgpu::BindGroupLayout,
    pub(crate) size_layout: wgpu::BindGroupLayout,
    rasters: HashMap<(Target, bool), wgpu::RenderPipeline>,
    primaries: HashMap<Variant, wgpu::ComputePipeline>,
    traces: HashMap<Variant, wgpu::ComputePipeline>,
    deformer: Option<wgpu::ComputePipeline>,
    sizer: Option<wgpu::ComputePipeline>,
}

fn module(gpu: &Gpu, name: &str) -> Result<wgpu::ShaderModule, HybridError> {
    let source = niwaki_shaders::source(name)
        .map_err(|e| HybridError::Shader { module: name.into(), message: e.to_string() })?;
    gpu.module(name, source)
}

impl Pipelines {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, HybridError> {
        Ok(Self {
            raster: module(gpu, "hybrid/gbuffer")?,
            primary: module(gpu, "hybrid/primary")?,
            trace: module(gpu, "hybrid/trace")?,
            deform: module(gpu, "hybrid/deform")?,
            size: module(gpu, "hybrid/size")?,
            view_layout: gpu.layout("view", &[Slot::DynamicUniform]),
            kernel_layout: gpu.layout(
                "kernel",
                &[
                    Slot::Read,
                    Slot::Read,
                    Slot::Read,
                    Slot::Read,
                    Slot::DEPTH_ARRAY,
                    Slot::DEPTH_ARRAY,
                    Slot::UINT_ARRAY,
                    Slot::UINT,
                    Slot::UINT,
                    Slot::Write,
                    Slot::Write,
                    Slot::Write,
                ],
            ),
            deform_layout: gpu.layout("deform", &[Slot::Read, Slot::Read, Slot::Write]),
            size_layout: gpu.layout("size", &[Slot::Read, Slot::Write]),
            rasters: HashMap::new(),
            primaries: HashMap::new(),
            traces: HashMap::new(),
            deformer: None,
            sizer: None,
        })
    }

    /// The pipeline that draws to a target, with or without tests of alpha.
    pub(crate) fn raster(
        &mut self,
        gpu: &Gpu,
        scene: &wgpu::BindGroupLayout,
        target: Target,
        alpha: bool,
    ) -> Result<wgpu::RenderPipeline, HybridError> {
        if let Some(pipeline) = self.rasters.get(&(target, alpha)) {
            return Ok(pipeline.clone());
        }
        let layout = gpu.pipeline_layout(&[scene, &self.view_layout]);
        let color = |format| {
            Some(wgpu::ColorTargetState { format, blend: None, write_mask: wgpu::ColorWrites::ALL })
        };
        let (entry, targets, compare) = match target {
            Target::Primary => (
                Some("primary_main"),
                vec![color(SURFACE), color(TRIANGLE)],
                wgpu::CompareFunction::Greater,
            ),
            Target::Face => (Some("face_main"), vec![color(SURFACE)], wgpu::CompareFunction::Less),
            Target::Shadow => {
                (alpha.then_some("shadow_main"), vec![], wgpu::CompareFunction::Greater)
            }
        };
        let constants = [("ALPHA", f64::from(u8::from(alpha)))];
        let options = wgpu::PipelineCompilationOptions {
            constants: &constants,
            ..wgpu::PipelineCompilationOptions::default()
        };
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
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("raster"),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &self.raster,
                entry_point: Some("vertex_main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[Some(wgpu::VertexBufferLayout {
                    array_stride: 32,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: &attributes,
                })],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(true),
                depth_compare: Some(compare),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: entry.map(|entry| wgpu::FragmentState {
                module: &self.raster,
                entry_point: Some(entry),
                compilation_options: options,
                targets: &targets,
            }),
            multiview_mask: None,
            cache: None,
        });
        gpu.check()?;
        self.rasters.insert((target, alpha), pipeline.clone());
        Ok(pipeline)
    }

    /// The kernel that shades the primary view.
    pub(crate) fn primary(
        &mut self,
        gpu: &Gpu,
        scene: &wgpu::BindGroupLayout,
        variant: Variant,
    ) -> Result<wgpu::ComputePipeline, HybridError> {
        // What only the other kernel knows does not make another pipeline.
        let variant = Variant {
            reflect: false,
            refract: false,
            use_map: false,
            as_printed: false,
            go_on: false,
            ..variant
        };
        if let Some(pipeline) = self.primaries.get(&variant) {
            return Ok(pipeline.clone());
        }
        let mut constants = variant.primary();
        constants.push(("FOLLOW", f64::from(u8::from(variant.follow))));
        let layouts = [scene, &self.kernel_layout];
        let pipeline = gpu.compute(&self.primary, "primary", &layouts, &constants)?;
        self.primaries.insert(variant, pipeline.clone());
        Ok(pipeline)
    }

    /// The kernel that follows rays.
    pub(crate) fn trace(
        &mut self,
        gpu: &Gpu,
        scene: &wgpu::BindGroupLayout,
        variant: Variant,
    ) -> Result<wgpu::ComputePipeline, HybridError> {
        if let Some(pipeline) = self.traces.get(&variant) {
            return Ok(pipeline.clone());
        }
        let mut constants = variant.primary();
        let flag = |b: bool| f64::from(u8::from(b));
        constants.extend([
            ("REFLECT", flag(variant.reflect)),
            ("REFRACT", flag(variant.refract)),
            ("USE_MAP", flag(variant.use_map)),
            ("AS_PRINTED", flag(variant.as_printed)),
            ("GO_ON", flag(variant.go_on)),
        ]);
        let layouts = [scene, &self.kernel_layout];
        let pipeline = gpu.compute(&self.trace, "trace", &layouts, &constants)?;
        self.traces.insert(variant, pipeline.clone());
        Ok(pipeline)
    }

    /// The kernel that moves vertices.
    pub(crate) fn deformer(&mut self, gpu: &Gpu) -> Result<wgpu::ComputePipeline, HybridError> {
        let made = match self.deformer.take() {
            Some(made) => made,
            None => gpu.compute(&self.deform, "deform", &[&self.deform_layout], &[])?,
        };
        Ok(self.deformer.insert(made).clone())
    }

    /// The kernel that sizes the following of rays.
    pub(crate) fn sizer(&mut self, gpu: &Gpu) -> Result<wgpu::ComputePipeline, HybridError> {
        let made = match self.sizer.take() {
            Some(made) => made,
            None => gpu.compute(&self.size, "size", &[&self.size_layout], &[])?,
        };
        Ok(self.sizer.insert(made).clone())
    }
}

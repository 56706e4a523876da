//! Shader modules and pipelines, made when a frame first needs them and shared by all renderers on
//! a device.

use niwaki_gpu_frame::{
    DEPTH, FrameError, Gpu, RasterPipeline, SURFACE, Slot, TRIANGLE, depth_state, opaque, wgpu,
};
use std::{
    collections::HashMap,
    sync::{Mutex, PoisonError},
};
use wgpu::{CompareFunction, StencilOperation};

/// Format of pictures for the display.
pub(crate) const OUTPUT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// Format of variance shadow maps: depth and its square.
pub(crate) const MOMENTS: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Float;
/// Format of depth where there is a stencil.
pub(crate) const DEPTH_STENCIL: wgpu::TextureFormat = wgpu::TextureFormat::Depth32FloatStencil8;

/// A pipeline that is rasterised with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Draw {
    /// Surfaces; `triangles` too.
    GBuffer { triangles: bool, stencil: bool },
    /// Depth alone, for a light or for the prepass.
    Depth,
    /// Shading; `after` a prepass.
    Forward { after: bool },
    /// The environment behind what was shaded forward.
    Sky,
    /// What there is without lights.
    Base,
    /// The picture.
    Resolve,
    /// Lights without shadows, or those that a stencil lets through.
    Light { stencil: bool, share: bool },
    /// A light with a shadow map.
    Mapped { variance: bool, share: bool },
    /// Depth and its square.
    Moment,
    /// A level from the one below.
    Level,
    /// Caps of shadow volumes; `far`: at infinity; `reversed`: of triangles with their back to the
    /// light.
    Cap { far: bool, reversed: bool },
    /// Walls of shadow volumes.
    Wall,
}

/// What of a scene pipelines depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Variant {
    pub(crate) alpha: bool,
    pub(crate) textures: bool,
}

/// Layouts, and what was made so far.
pub(crate) struct Pipelines {
    pub(crate) view: wgpu::BindGroupLayout,
    pub(crate) lights: wgpu::BindGroupLayout,
    pub(crate) gbuffer: wgpu::BindGroupLayout,
    pub(crate) sum: wgpu::BindGroupLayout,
    pub(crate) light_view: wgpu::BindGroupLayout,
    pub(crate) maps: wgpu::BindGroupLayout,
    pub(crate) level: wgpu::BindGroupLayout,
    pub(crate) volumes: wgpu::BindGroupLayout,
    pub(crate) casters: wgpu::BindGroupLayout,
    /// Format of sums of light.
    pub(crate) sum_format: wgpu::TextureFormat,
    modules: Mutex<HashMap<&'static str, wgpu::ShaderModule>>,
    draws: Mutex<HashMap<(Draw, Variant), wgpu::RenderPipeline>>,
    kernels: Mutex<HashMap<&'static str, wgpu::ComputePipeline>>,
}

impl Pipelines {
    #[expect(clippy::unnecessary_wraps, reason = "as `Gpu::shared` takes it")]
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, FrameError> {
        let filtered = Slot::Texture(
            wgpu::TextureSampleType::Float { filterable: true },
            wgpu::TextureViewDimension::D2,
        );
        let plain = Slot::Texture(
            wgpu::TextureSampleType::Float { filterable: false },
            wgpu::TextureViewDimension::D2,
        );
        let blends = gpu.device().features().contains(wgpu::Features::FLOAT32_BLENDABLE);
        Ok(Self {
            view: gpu.layout("view", &[Slot::DynamicUniform]),
            lights: gpu.layout("lights", &[Slot::Read]),
            gbuffer: gpu.layout("G-buffer", &[Slot::UINT, Slot::DEPTH]),
            sum: gpu.layout("sum", &[plain]),
            light_view: gpu.layout("view of volumes", &[Slot::Uniform]),
            maps: gpu.layout(
                "maps",
                &[
                    Slot::Uniform,
                    Slot::DEPTH,
                    Slot::ComparingSampler,
                    filtered,
                    Slot::FilteringSampler,
                ],
            ),
            level: gpu.layout("level", &[plain, Slot::Uniform]),
            volumes: gpu.layout("volumes", &[Slot::Uniform, Slot::Uniform, Slot::Read, Slot::Read]),
            casters: gpu.layout(
                "casters",
                &[
                    Slot::Uniform,
                    Slot::Read,
                    Slot::Read,
                    Slot::Write,
                    Slot::Write,
                    Slot::Write,
                    Slot::Write,
                    Slot::Write,
                ],
            ),
            sum_format: if blends {
                wgpu::TextureFormat::Rgba32Float
            } else {
                wgpu::TextureFormat::Rgba16Float
            },
            modules: Mutex::default(),
            draws: Mutex::default(),
            kernels: Mutex::default(),
        })
    }

    fn module(&self, gpu: &Gpu, name: &'static str) -> Result<wgpu::ShaderModule, FrameError> {
        let mut modules = self.modules.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(module) = modules.get(name) {
            return Ok(module.clone());
        }
        let source = niwaki_shaders::source(name)
            .map_err(|e| FrameError::Shader { module: name.into(), message: e.to_string() })?;
        let module = gpu.module(name, source)?;
        modules.insert(name, module.clone());
        Ok(module)
    }

    /// A kernel of `raster/silhouettes`.
    pub(crate) fn kernel(
        &self,
        gpu: &Gpu,
        scene: &wgpu::BindGroupLayout,
        entry: &'static str,
    ) -> Result<wgpu::ComputePipeline, FrameError> {
        let mut kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kernel) = kernels.get(entry) {
            return Ok(kernel.clone());
        }
        let module = self.module(gpu, "raster/silhouettes")?;
        let kernel = gpu.compute(&module, entry, &[scene, &self.casters], &[])?;
        kernels.insert(entry, kernel.clone());
        Ok(kernel)
    }

    /// A pipeline.
    pub(crate) fn draw(
        &self,
        gpu: &Gpu,
        scene: &wgpu::BindGroupLayout,
        draw: Draw,
        variant: Variant,
    ) -> Result<wgpu::RenderPipeline, FrameError> {
        let mut draws = self.draws.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = draws.get(&(draw, variant)) {
            return Ok(pipeline.clone());
        }
        let pipeline = self.make(gpu, scene, draw, variant)?;
        draws.insert((draw, variant), pipeline.clone());
        Ok(pipeline)
    }

    fn make(
        &self,
        gpu: &Gpu,
        scene: &wgpu::BindGroupLayout,
        draw: Draw,
        variant: Variant,
    ) -> Result<wgpu::RenderPipeline, FrameError> {
        let flag = |b: bool| f64::from(u8::from(b));
        let surface = [("ALPHA", flag(variant.alpha)), ("TEXTURES", flag(variant.textures))];
        let plan = self.plan(scene, draw, variant);
        let module = self.module(gpu, plan.module)?;
        let share = [("SHOW_SHARE", flag(plan.share))];
        RasterPipeline {
            label: plan.module,
            module: &module,
            layouts: &plan.layouts,
            vertex: plan.vertex,
            fragment: plan.fragment,
            constants: match draw {
                Draw::Light { .. } | Draw::Mapped { .. } => &share,
                Draw::GBuffer { .. } | Draw::Depth | Draw::Forward { .. } | Draw::Moment => {
                    &surface
                }
                _ => &[],
            },
            targets: &plan.targets,
            depth: plan.depth,
            reads_vertices: plan.reads_vertices,
            cull: plan.cull,
        }
        .make(gpu)
    }

    fn plan<'a>(
        &'a self,
        scene: &'a wgpu::BindGroupLayout,
        draw: Draw,
        variant: Variant,
    ) -> Plan<'a> {
        let geometry = Plan {
            module: "frame/gbuffer",
            layouts: vec![scene, &self.view],
            vertex: "vertex_main",
            fragment: None,
            targets: vec![],
            depth: Some(depth_state(CompareFunction::Greater, true)),
            reads_vertices: true,
            cull: None,
            share: false,
        };
        let screen = |fragment, target| Plan {
            module: "raster/screen",
            layouts: vec![scene, &self.gbuffer, &self.lights, &self.sum],
            vertex: "screen_main",
            fragment: Some(fragment),
            targets: vec![opaque(target)],
            depth: None,
            reads_vertices: false,
            cull: None,
            share: false,
        };
        // Back faces behind what is seen there: right from inside the volume too.
        let light = |module, fragment, last, stencil: bool, share| Plan {
            module,
            layouts: vec![scene, &self.gbuffer, &self.lights, last],
            vertex: "cone_main",
            fragment: Some(fragment),
            targets: vec![Some(wgpu::ColorTargetState {
                format: self.sum_format,
                blend: Some(wgpu::BlendState { color: ADD, alpha: ADD }),
                write_mask: wgpu::ColorWrites::ALL,
            })],
            depth: Some(wgpu::DepthStencilState {
                format: if stencil { DEPTH_STENCIL } else { DEPTH },
                stencil: if stencil { outside() } else { wgpu::StencilState::default() },
                ..depth_state(CompareFunction::LessEqual, false)
            }),
            reads_vertices: false,
            cull: Some(wgpu::Face::Front),
            share,
        };
        let volume = |vertex, reversed, reads_vertices| Plan {
            module: "raster/volumes",
            layouts: vec![&self.volumes],
            vertex,
            fragment: None,
            targets: vec![],
            depth: Some(wgpu::DepthStencilState {
                format: DEPTH_STENCIL,
                stencil: counting(reversed),
                ..depth_state(CompareFunction::Greater, false)
            }),
            reads_vertices,
            cull: None,
            share: false,
        };
        match draw {
            Draw::GBuffer { triangles, stencil } => Plan {
                fragment: Some(if triangles { "facing_primary_main" } else { "facing_main" }),
                targets: if triangles {
                    vec![opaque(SURFACE), opaque(TRIANGLE)]
                } else {
                    vec![opaque(SURFACE)]
                },
                depth: Some(wgpu::DepthStencilState {
                    format: if stencil { DEPTH_STENCIL } else { DEPTH },
                    ..depth_state(CompareFunction::Greater, true)
                }),
                ..geometry
            },
            Draw::Depth => Plan { fragment: variant.alpha.then_some("shadow_main"), ..geometry },
            Draw::Forward { after } => Plan {
                module: "raster/forward",
                layouts: vec![scene, &self.view, &self.lights],
                fragment: Some("forward_main"),
                targets: vec![opaque(OUTPUT)],
                depth: Some(if after {
                    depth_state(CompareFunction::GreaterEqual, false)
                } else {
                    depth_state(CompareFunction::Greater, true)
                }),
                ..geometry
            },
            Draw::Moment => Plan {
                module: "raster/moments",
                layouts: vec![scene, &self.view, &self.light_view],
                fragment: Some("moment_main"),
                targets: vec![opaque(MOMENTS)],
                ..geometry
            },
            Draw::Sky => Plan {
                layouts: vec![scene],
                depth: Some(depth_state(CompareFunction::Equal, false)),
                ..screen("sky_main", OUTPUT)
            },
            Draw::Base => {
                Plan { layouts: vec![scene, &self.gbuffer], ..screen("base_main", self.sum_format) }
            }
            Draw::Resolve => screen("resolve_main", OUTPUT),
            Draw::Level => Plan {
                module: "raster/mips",
                layouts: vec![&self.level],
                vertex: "level_main",
                ..screen("reduce_main", MOMENTS)
            },
            Draw::Light { stencil, share } => {
                light("raster/light", "light_main", &self.light_view, stencil, share)
            }
            Draw::Mapped { variance, share } => {
                let fragment = if variance { "moments_main" } else { "mapped_main" };
                light("raster/mapped", fragment, &self.maps, false, share)
            }
            Draw::Cap { far, reversed } => {
                // A far cap is seen from its other side.
                volume(if far { "far_main" } else { "near_main" }, far != reversed, true)
            }
            Draw::Wall => volume("wall_main", false, false),
        }
    }
}

/// What a pipeline is made from.
struct Plan<'a> {
    module: &'static str,
    layouts: Vec<&'a wgpu::BindGroupLayout>,
    vertex: &'static str,
    fragment: Option<&'static str>,
    targets: Vec<Option<wgpu::ColorTargetState>>,
    depth: Option<wgpu::DepthStencilState>,
    reads_vertices: bool,
    cull: Option<wgpu::Face>,
    share: bool,
}

const ADD: wgpu::BlendComponent = wgpu::BlendComponent {
    src_factor: wgpu::BlendFactor::One,
    dst_factor: wgpu::BlendFactor::One,
    operation: wgpu::BlendOperation::Add,
};

/// Counts how many volumes a visible point lies in, by what lies behind it: Carmack's reverse. The
/// count wraps, so only a multiple of 256 volumes is mistaken for none.
const fn counting(reversed: bool) -> wgpu::StencilState {
    const fn face(depth_fail_op: StencilOperation) -> wgpu::StencilFaceState {
        wgpu::StencilFaceState {
            compare: CompareFunction::Always,
            fail_op: StencilOperation::Keep,
            depth_fail_op,
            pass_op: StencilOperation::Keep,
        }
    }
    let enter = face(StencilOperation::DecrementWrap);
    let leave = face(StencilOperation::IncrementWrap);
    let (front, back) = if reversed { (leave, enter) } else { (enter, leave) };
    wgpu::StencilState { front, back, read_mask: 255, write_mask: 255 }
}

/// Passes where the count is 0.
const fn outside() -> wgpu::StencilState {
    const FACE: wgpu::StencilFaceState = wgpu::StencilFaceState {
        compare: CompareFunction::Equal,
        fail_op: StencilOperation::Keep,
        depth_fail_op: StencilOperation::Keep,
        pass_op: StencilOperation::Keep,
    };
    wgpu::StencilState { front: FACE, back: FACE, read_mask: 255, write_mask: 0 }
}

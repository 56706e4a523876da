//! Shader modules and pipelines, made when a frame first needs them.

use crate::{Behind, DebugView, Effect, EffectPlan, Gpu, HybridError, March, SampleRule, Settings};
use niwaki_gpu_frame::{RasterPipeline, SURFACE, Slot, TRIANGLE, depth_state, opaque};
use std::{
    collections::HashMap,
    hash::Hash,
    sync::{Mutex, PoisonError},
};

/// Of cells of the depth pyramid: least and greatest.
pub(crate) const RANGE: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Float;

/// What is rasterised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Target {
    Primary,
    Face,
    /// A face's second layer.
    Second,
    Shadow,
}

/// What a kernel leaves out or puts in; parts that do not differ share a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Variant {
    pub(crate) alpha: bool,
    pub(crate) textures: bool,
    pub(crate) trace_shadows: bool,
    pub(crate) map_shadows: bool,
    pub(crate) occlusion: bool,
    pub(crate) holds_all: bool,
    pub(crate) follow: bool,
    pub(crate) reflect: bool,
    pub(crate) refract: bool,
    pub(crate) use_map: bool,
    pub(crate) as_printed: bool,
    pub(crate) go_on: bool,
    /// Marches go from pixel to pixel.
    pub(crate) walk: bool,
    /// Rays look through glass and blended surfaces of the map.
    pub(crate) look_through: bool,
    /// The second layer has only what is seen through the first.
    pub(crate) through_only: bool,
    /// Layers of the cube map that rays look at.
    pub(crate) layers: u32,
    pub(crate) debug_view: u32,
}

impl Variant {
    pub(crate) fn new(plan: &EffectPlan, settings: &Settings, textures: bool) -> Self {
        let faces = crate::Face::ALL.iter().any(|f| plan.uses(Effect::CubeFace(*f)));
        Self {
            alpha: plan.uses(Effect::Alpha),
            textures,
            trace_shadows: plan.uses(Effect::ShadowRays),
            map_shadows: plan.uses(Effect::ShadowMaps),
            // Forcing traces them where the settings ask for some.
            occlusion: plan.uses(Effect::OcclusionRays)
                && settings.occlusion_rays > 0
                && settings.occlusion_radius > 0.0,
            holds_all: plan.region_holds_all,
            follow: plan.follows_rays(),
            reflect: plan.uses(Effect::ReflectionRays),
            refract: plan.uses(Effect::RefractionRays),
            use_map: faces,
            as_printed: matches!(settings.march, March::Linear { rule: SampleRule::AsPrinted, .. }),
            go_on: settings.behind == Behind::GoOn,
            walk: !matches!(settings.march, March::Linear { .. }),
            look_through: settings.look_through,
            through_only: plan.layers > settings.layers,
            // Forcing draws the second layer, but what rays look at is as planned.
            layers: if plan.uses(Effect::SecondLayer) { plan.layers } else { 1 },
            debug_view: match settings.debug_view {
                DebugView::None => 0,
                DebugView::HitSource => 1,
                DebugView::Normal => 2,
                DebugView::MarchSteps => 3,
                DebugView::Occlusion => 4,
            },
        }
    }

    /// Constants of `hybrid/primary.wgsl`.
    fn primary(&self) -> Vec<(&'static str, f64)> {
        let flag = |b: bool| f64::from(u8::from(b));
        vec![
            ("ALPHA", flag(self.alpha)),
            ("TEXTURES", flag(self.textures)),
            ("TRACE_SHADOWS", flag(self.trace_shadows)),
            ("MAP_SHADOWS", flag(self.map_shadows)),
            ("OCCLUSION", flag(self.occlusion)),
            ("HOLDS_ALL", flag(self.holds_all)),
            ("DEBUG_VIEW", f64::from(self.debug_view)),
        ]
    }
}

/// All modules and the pipelines that were needed so far, for all renderers on a device.
pub(crate) struct Pipelines {
    raster: wgpu::ShaderModule,
    primary: wgpu::ShaderModule,
    /// By size of the stack of pending rays.
    trace: Made<u32, wgpu::ShaderModule>,
    deform: wgpu::ShaderModule,
    pyramid: wgpu::ShaderModule,
    size: wgpu::ShaderModule,
    pub(crate) view_layout: wgpu::BindGroupLayout,
    pub(crate) first_layer_layout: wgpu::BindGroupLayout,
    pub(crate) pyramid_layout: wgpu::BindGroupLayout,
    pub(crate) kernel_layout: wgpu::BindGroupLayout,
    pub(crate) deform_layout: wgpu::BindGroupLayout,
    pub(crate) size_layout: wgpu::BindGroupLayout,
    rasters: Made<(Target, [bool; 3]), wgpu::RenderPipeline>,
    primaries: Made<Variant, wgpu::ComputePipeline>,
    traces: Made<(Variant, u32), wgpu::ComputePipeline>,
    movers: Made<(), wgpu::ComputePipeline>,
    sizers: Made<(), wgpu::ComputePipeline>,
    reducers: Made<&'static str, wgpu::ComputePipeline>,
}

/// What was made so far, by what it is made for.
struct Made<K, V>(Mutex<HashMap<K, V>>);

impl<K: Copy + Eq + Hash, V: Clone> Made<K, V> {
    fn new() -> Self {
        Self(Mutex::new(HashMap::new()))
    }

    fn get(&self, key: K, make: impl FnOnce() -> Result<V, HybridError>) -> Result<V, HybridError> {
        let mut made = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(value) = made.get(&key) {
            return Ok(value.clone());
        }
        let value = make()?;
        made.insert(key, value.clone());
        Ok(value)
    }
}

fn source(name: &str) -> Result<String, HybridError> {
    niwaki_shaders::source(name)
        .map_err(|e| HybridError::Shader { module: name.into(), message: e.to_string() })
}

fn module(gpu: &Gpu, name: &str) -> Result<wgpu::ShaderModule, HybridError> {
    gpu.module(name, source(name)?)
}

/// The line of `hybrid/trace.wgsl` that sizes the stack of pending rays; arrays in functions take
/// no `override`.
const STACK_LINE: &str = "const RAY_STACK = 35u;";

/// `hybrid/trace` with room for `stack` pending rays.
fn trace_module(gpu: &Gpu, stack: u32) -> Result<wgpu::ShaderModule, HybridError> {
    const NAME: &str = "hybrid/trace";
    let text = source(NAME)?;
    if !text.contains(STACK_LINE) {
        let message = format!("it has no line `{STACK_LINE}`");
        return Err(HybridError::Shader { module: NAME.into(), message });
    }
    gpu.module(NAME, text.replace(STACK_LINE, &format!("const RAY_STACK = {stack}u;")))
}

impl Pipelines {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, HybridError> {
        Ok(Self {
            raster: module(gpu, "hybrid/gbuffer")?,
            primary: module(gpu, "hybrid/primary")?,
            trace: Made::new(),
            deform: module(gpu, "hybrid/deform")?,
            pyramid: module(gpu, "hybrid/pyramid")?,
            size: module(gpu, "hybrid/size")?,
            view_layout: gpu.layout("view", &[Slot::DynamicUniform]),
            first_layer_layout: gpu.layout("first layer", &[Slot::DEPTH, Slot::UINT]),
            pyramid_layout: gpu.layout(
                "pyramid",
                &[
                    Slot::Uniform,
                    Slot::DEPTH_ARRAY,
                    Slot::UINT_ARRAY,
                    Slot::COLOR_ARRAY,
                    Slot::Storage(RANGE),
                    Slot::Storage(RANGE),
                    Slot::Storage(RANGE),
                    Slot::Storage(RANGE),
                ],
            ),
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
                    Slot::COLOR_ARRAY,
                ],
            ),
            deform_layout: gpu.layout(
                "deform",
                &[
                    Slot::Read,
                    Slot::Read,
                    Slot::Write,
                    Slot::Read,
                    Slot::Read,
                    Slot::Read,
                    Slot::Read,
                    Slot::Read,
                ],
            ),
            size_layout: gpu.layout("size", &[Slot::Read, Slot::Write]),
            rasters: Made::new(),
            primaries: Made::new(),
            traces: Made::new(),
            movers: Made::new(),
            sizers: Made::new(),
            reducers: Made::new(),
        })
    }

    /// The pipeline that draws to a target.
    pub(crate) fn raster(
        &self,
        gpu: &Gpu,
        scene: &wgpu::BindGroupLayout,
        target: Target,
        variant: Variant,
    ) -> Result<wgpu::RenderPipeline, HybridError> {
        let Variant { alpha, textures, .. } = variant;
        let through_only = variant.through_only && target == Target::Second;
        let key = (target, [alpha, textures, through_only]);
        self.rasters.get(key, || self.make_raster(gpu, scene, key))
    }

    fn make_raster(
        &self,
        gpu: &Gpu,
        scene: &wgpu::BindGroupLayout,
        (target, [alpha, textures, through_only]): (Target, [bool; 3]),
    ) -> Result<wgpu::RenderPipeline, HybridError> {
        let (entry, targets, compare) = match target {
            Target::Primary => (
                Some("primary_main"),
                vec![opaque(SURFACE), opaque(TRIANGLE)],
                wgpu::CompareFunction::Greater,
            ),
            Target::Face => (Some("face_main"), vec![opaque(SURFACE)], wgpu::CompareFunction::Less),
            Target::Second => {
                (Some("second_main"), vec![opaque(SURFACE)], wgpu::CompareFunction::Less)
            }
            Target::Shadow => {
                (alpha.then_some("shadow_main"), vec![], wgpu::CompareFunction::Greater)
            }
        };
        let mut layouts = vec![scene, &self.view_layout];
        if target == Target::Second {
            layouts.push(&self.first_layer_layout);
        }
        let flag = |b: bool| f64::from(u8::from(b));
        RasterPipeline {
            label: "raster",
            module: &self.raster,
            layouts: &layouts,
            vertex: "vertex_main",
            fragment: entry,
            constants: &[
                ("ALPHA", flag(alpha)),
                ("TEXTURES", flag(textures)),
                ("THROUGH_ONLY", flag(through_only)),
            ],
            targets: &targets,
            depth: Some(depth_state(compare, true)),
            reads_vertices: true,
            cull: None,
        }
        .make(gpu)
    }

    /// The kernel that shades the primary view.
    pub(crate) fn primary(
        &self,
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
            walk: false,
            look_through: false,
            through_only: false,
            layers: 1,
            ..variant
        };
        let mut constants = variant.primary();
        constants.push(("FOLLOW", f64::from(u8::from(variant.follow))));
        let layouts = [scene, &self.kernel_layout];
        let make = || gpu.compute(&self.primary, "primary", &layouts, &constants);
        self.primaries.get(variant, make)
    }

    /// The kernel that follows rays, with room for `stack` of them to wait.
    pub(crate) fn trace(
        &self,
        gpu: &Gpu,
        scene: &wgpu::BindGroupLayout,
        variant: Variant,
        stack: u32,
    ) -> Result<wgpu::ComputePipeline, HybridError> {
        let mut constants = variant.primary();
        let flag = |b: bool| f64::from(u8::from(b));
        constants.extend([
            ("REFLECT", flag(variant.reflect)),
            ("REFRACT", flag(variant.refract)),
            ("USE_MAP", flag(variant.use_map)),
            ("AS_PRINTED", flag(variant.as_printed)),
            ("GO_ON", flag(variant.go_on)),
            ("WALK", flag(variant.walk)),
            ("LOOK_THROUGH", flag(variant.look_through)),
            ("THROUGH_ONLY", flag(variant.through_only && variant.layers > 1)),
            ("LAYERS", f64::from(variant.layers)),
        ]);
        let layouts = [scene, &self.kernel_layout];
        self.traces.get((variant, stack), || {
            let module = self.trace.get(stack, || trace_module(gpu, stack))?;
            gpu.compute(&module, "trace", &layouts, &constants)
        })
    }

    /// A kernel that makes levels of depth pyramids: `from_map` or `from_level`.
    pub(crate) fn reducer(
        &self,
        gpu: &Gpu,
        scene: &wgpu::BindGroupLayout,
        entry: &'static str,
    ) -> Result<wgpu::ComputePipeline, HybridError> {
        let layouts = [scene, &self.pyramid_layout];
        self.reducers.get(entry, || gpu.compute(&self.pyramid, entry, &layouts, &[]))
    }

    /// The kernel that moves vertices.
    pub(crate) fn deformer(&self, gpu: &Gpu) -> Result<wgpu::ComputePipeline, HybridError> {
        self.movers.get((), || gpu.compute(&self.deform, "deform", &[&self.deform_layout], &[]))
    }

    /// The kernel that sizes the following of rays.
    pub(crate) fn sizer(&self, gpu: &Gpu) -> Result<wgpu::ComputePipeline, HybridError> {
        self.sizers.get((), || gpu.compute(&self.size, "size", &[&self.size_layout], &[]))
    }
}

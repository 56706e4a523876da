//! Recording the commands of a frame, stage by stage.

use super::{HybridRenderer, Scenery};
use crate::{
    Effect, Face, FrameReport, Gpu, HybridError, Region,
    layout::ViewMatrix,
    pipelines::Target,
    report::{Stage, StageReport},
    targets::Screen,
    tree::NearInput,
    views::{camera_view, may_show},
};
use glam::{Mat4, Vec3};
use std::{ops::Range, time::Duration};
use wgpu::BufferUsages;

/// Bytes from one view to the next: what every device can bind.
const VIEW_STRIDE: u32 = 256;

/// Commands with their timing.
pub(super) struct Recorder<'a> {
    gpu: &'a Gpu,
    encoder: wgpu::CommandEncoder,
    queries: Option<wgpu::QuerySet>,
    stages: Vec<StageReport>,
}

/// Most stages of a frame.
const MOST_STAGES: u32 = 32;

impl<'a> Recorder<'a> {
    fn new(gpu: &'a Gpu) -> Self {
        let queries = gpu.has_timestamps().then(|| {
            gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("stages"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * MOST_STAGES,
            })
        });
        let encoder = gpu.device.create_command_encoder(&Default::default());
        Self { gpu, encoder, queries, stages: Vec::new() }
    }

    /// Records a stage; `work` returns how many draws and dispatches it recorded.
    pub(super) fn stage(
        &mut self,
        stage: Stage,
        work: impl FnOnce(&mut wgpu::CommandEncoder) -> [u32; 2],
    ) {
        let index = 2 * niwaki_core::to_u32(self.stages.len());
        if let Some(queries) = &self.queries {
            self.encoder.write_timestamp(queries, index);
        }
        let [draws, dispatches] = work(&mut self.encoder);
        if let Some(queries) = &self.queries {
            self.encoder.write_timestamp(queries, index + 1);
        }
        self.stages.push(StageReport { stage, draws, dispatches, gpu_time: None });
    }

    /// Submits everything, waits and reads the times.
    fn finish(mut self) -> Result<Vec<StageReport>, HybridError> {
        let count = 2 * self.stages.len();
        let resolved = match &self.queries {
            Some(queries) if count > 0 => {
                let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
                let buffer = self.gpu.buffer("times", 8 * count as u64, usage)?;
                let range = 0..niwaki_core::to_u32(count);
                self.encoder.resolve_query_set(queries, range, &buffer, 0);
                Some(buffer)
            }
            _ => None,
        };
        self.gpu.queue.submit([self.encoder.finish()]);
        self.gpu.wait()?;
        if let Some(buffer) = resolved {
            let ticks: Vec<u64> = self.gpu.read(&buffer, count)?;
            let period = f64::from(self.gpu.queue.get_timestamp_period());
            for (stage, pair) in self.stages.iter_mut().zip(ticks.chunks_exact(2)) {
                let nanoseconds = pair[1].saturating_sub(pair[0]) as f64 * period;
                stage.gpu_time = Some(Duration::from_secs_f64(nanoseconds * 1e-9));
            }
        }
        Ok(self.stages)
    }
}

/// Views in one buffer, bound by offset.
pub(super) struct Views {
    group: wgpu::BindGroup,
}

/// What a raster pass draws into and how.
pub(super) struct Raster<'a> {
    pub(super) pipeline: &'a wgpu::RenderPipeline,
    pub(super) colors: &'a [&'a wgpu::TextureView],
    pub(super) depth: &'a wgpu::TextureView,
    pub(super) clear_depth: f32,
    pub(super) view: u32,
    pub(super) draws: &'a [Range<u32>],
    /// What else the fragment shader reads.
    pub(super) inputs: Option<&'a wgpu::BindGroup>,
}

impl HybridRenderer {
    /// Runs the stages that the plan names and waits for them.
    pub(super) fn record(&mut self, scenery: &Scenery) -> Result<FrameReport, HybridError> {
        self.make_room(scenery)?;
        let plan = &scenery.plan;
        let gpu = self.gpu.clone();
        self.uploaded.write_frame(&gpu, &self.uniform(scenery));
        let views = self.views(scenery)?;
        let mut recorder = Recorder::new(&gpu);

        if plan.runs(Effect::Deformation) {
            self.deform(&mut recorder, scenery)?;
        }
        if plan.runs(Effect::ShadowMaps) {
            self.draw_shadows(&mut recorder, scenery, &views)?;
        }
        self.draw_primary(&mut recorder, scenery, &views)?;
        self.draw_cube(&mut recorder, scenery, &views)?;
        if plan.runs(Effect::NearRegion) {
            self.build_tree(&mut recorder, scenery)?;
        }
        self.shade_and_trace(&mut recorder, scenery)?;
        let stages = recorder.finish()?;
        if plan.runs(Effect::NearRegion) {
            self.tree.check(&gpu)?;
        }
        let Some(screen) = &self.screen else { return Ok(FrameReport::default()) };
        let counters = self.counters(screen)?;
        let region_triangles = if plan.uses(Effect::NearRegion) { self.tree.count } else { 0 };
        Ok(FrameReport { stages, counters, region_triangles, total: Duration::ZERO })
    }

    /// All views of the frame: the camera's, the faces', the lights'.
    fn views(&self, scenery: &Scenery) -> Result<Views, HybridError> {
        let [width, height] = scenery.size;
        let region = &scenery.plan.region;
        let near = region.far * 1e-6;
        // The camera's first, then those of faces and of lights.
        let mut views = vec![camera_view(&scenery.camera, width, height, near)];
        let local = Region { center: Vec3::ZERO, ..*region };
        views.extend(Face::ALL.map(|face| ViewMatrix {
            matrix: local.view_projection(face),
            eye: region.center,
            pad: 0.0,
        }));
        views.extend(scenery.lights.iter().flat_map(|l| l.views.iter().copied()));
        let mut bytes = vec![0_u8; views.len() * VIEW_STRIDE as usize];
        for (slot, view) in bytes.chunks_exact_mut(VIEW_STRIDE as usize).zip(&views) {
            slot[..size_of::<ViewMatrix>()].copy_from_slice(bytemuck::bytes_of(view));
        }
        let buffer = self.gpu.upload("views", &bytes, BufferUsages::UNIFORM)?;
        let one = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &buffer,
            offset: 0,
            size: std::num::NonZeroU64::new(size_of::<ViewMatrix>() as u64),
        });
        Ok(Views { group: self.gpu.bind(&self.pipelines.view_layout, &[one]) })
    }

    fn deform(
        &mut self,
        recorder: &mut Recorder<'_>,
        scenery: &Scenery,
    ) -> Result<(), HybridError> {
        let pipeline = self.pipelines.deformer(&self.gpu)?;
        let moved = self.uploaded.moved(&self.scene, &scenery.pose.objects);
        let Some((rest, moved)) = moved else {
            recorder.stage(Stage::Effect(Effect::Deformation), |_| [0, 0]);
            return Ok(());
        };
        let longest = moved.iter().map(|m| m.count).max().unwrap_or(0);
        let objects = self.gpu.upload("moved objects", &moved, BufferUsages::STORAGE)?;
        let joints = self.gpu.upload("joints", &scenery.pose.joints, BufferUsages::STORAGE)?;
        let group = self.gpu.bind(
            &self.pipelines.deform_layout,
            &[
                objects.as_entire_binding(),
                rest.vertices.as_entire_binding(),
                self.uploaded.vertices.as_entire_binding(),
                rest.influences.as_entire_binding(),
                joints.as_entire_binding(),
            ],
        );
        // Kernels step on by the size of the grid, so a smaller grid is right too.
        let x = longest.div_ceil(64).clamp(1, 4096);
        let y = niwaki_core::to_u32(moved.len()).clamp(1, 65_535);
        recorder.stage(Stage::Effect(Effect::Deformation), |encoder| {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(x, y, 1);
            [0, 1]
        });
        Ok(())
    }

    /// Ranges of triangles of these objects, neighbours joined.
    pub(super) fn ranges(scenery: &Scenery, objects: impl Iterator<Item = u32>) -> Vec<Range<u32>> {
        let mut ranges: Vec<Range<u32>> = Vec::new();
        for i in objects {
            let Some(object) = scenery.objects.get(i as usize) else { continue };
            let range = object.triangles.clone();
            match ranges.last_mut() {
                _ if range.is_empty() => {}
                Some(last) if last.end == range.start => last.end = range.end,
                _ => ranges.push(range),
            }
        }
        ranges
    }

    pub(super) fn raster(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        views: &Views,
        r: &Raster<'_>,
    ) -> u32 {
        let colors: Vec<_> = r
            .colors
            .iter()
            .map(|view| {
                Some(wgpu::RenderPassColorAttachment {
                    view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Store,
                    },
                })
            })
            .collect();
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: None,
            color_attachments: &colors,
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: r.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(r.clear_depth),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        if r.draws.is_empty() {
            return 0;
        }
        pass.set_pipeline(r.pipeline);
        pass.set_bind_group(0, &self.uploaded.group, &[]);
        pass.set_bind_group(1, &views.group, &[r.view * VIEW_STRIDE]);
        if let Some(inputs) = r.inputs {
            pass.set_bind_group(2, inputs, &[]);
        }
        pass.set_vertex_buffer(0, self.uploaded.vertices.slice(..));
        pass.set_index_buffer(self.uploaded.indices.slice(..), wgpu::IndexFormat::Uint32);
        for range in r.draws {
            // The number of the instance tells the shader which triangle is the draw's first.
            let instance = range.start..range.start + 1;
            pass.draw_indexed(3 * range.start..3 * range.end, 0, instance);
        }
        niwaki_core::to_u32(r.draws.len())
    }

    fn draw_shadows(
        &mut self,
        recorder: &mut Recorder<'_>,
        scenery: &Scenery,
        views: &Views,
    ) -> Result<(), HybridError> {
        let variant = scenery.variant;
        let layout = &self.uploaded.layout;
        let pipeline = self.pipelines.raster(&self.gpu, layout, Target::Shadow, variant)?;
        recorder.stage(Stage::Effect(Effect::ShadowMaps), |encoder| {
            let mut draws = 0;
            let all = scenery.lights.iter().flat_map(|l| &l.views);
            for ((view, number), depth) in all.zip(7..).zip(&self.shadows.each) {
                let shown = (0..).zip(&scenery.objects);
                let shown = shown.filter(|(_, o)| may_show(view, o.bounds)).map(|(i, _)| i);
                draws += self.raster(
                    encoder,
                    views,
                    &Raster {
                        pipeline: &pipeline,
                        colors: &[],
                        depth,
                        clear_depth: 0.0,
                        view: number,
                        draws: &Self::ranges(scenery, shown),
                        inputs: None,
                    },
                );
            }
            [draws, 0]
        });
        Ok(())
    }

    fn draw_primary(
        &mut self,
        recorder: &mut Recorder<'_>,
        scenery: &Scenery,
        views: &Views,
    ) -> Result<(), HybridError> {
        let variant = scenery.variant;
        let layout = &self.uploaded.layout;
        let pipeline = self.pipelines.raster(&self.gpu, layout, Target::Primary, variant)?;
        let Some(screen) = &self.screen else { return Ok(()) };
        let runs = scenery.plan.runs(Effect::PrimaryView);
        let shown = scenery.plan.visible.iter().copied().filter(|_| runs);
        let ranges = Self::ranges(scenery, shown);
        let raster = Raster {
            pipeline: &pipeline,
            colors: &[&screen.surface, &screen.triangle],
            depth: &screen.depth,
            clear_depth: 0.0,
            view: 0,
            draws: &ranges,
            inputs: None,
        };
        if runs {
            recorder.stage(Stage::Effect(Effect::PrimaryView), |encoder| {
                [self.raster(encoder, views, &raster), 0]
            });
        } else {
            // Nothing is drawn, but the images of the last frame must go.
            self.raster(&mut recorder.encoder, views, &raster);
        }
        Ok(())
    }

    fn build_tree(
        &mut self,
        recorder: &mut Recorder<'_>,
        scenery: &Scenery,
    ) -> Result<(), HybridError> {
        let ranges = Self::ranges(scenery, scenery.plan.in_region.iter().copied());
        let region = &scenery.plan.region;
        let input = NearInput { ranges: &ranges, region };
        let build = self.tree.prepare(&self.gpu, &input)?;
        let mut outcome = Ok(0);
        recorder.stage(Stage::Effect(Effect::NearRegion), |encoder| {
            outcome = self.tree.record(&self.gpu, encoder, &self.uploaded, &build);
            [0, *outcome.as_ref().unwrap_or(&0)]
        });
        outcome.map(|_| ())
    }

    /// Most rays that wait at once: a surface sends two and one of them is followed at once, so
    /// each depth leaves one; blended surfaces leave another. Depths that share a size share a
    /// kernel.
    fn pending(&self, scenery: &Scenery) -> u32 {
        let depth = self.settings.max_depth;
        let blended = scenery.plan.uses(Effect::TransparencyRays);
        let most = if blended { 2 * depth + 3 } else { depth + 2 };
        most.next_multiple_of(4)
    }

    fn kernel_group(
        &self,
        scenery: &Scenery,
        screen: &Screen,
    ) -> Result<wgpu::BindGroup, HybridError> {
        let lights = self.gpu.upload("lights", &self.gpu_lights(scenery), BufferUsages::STORAGE)?;
        let mut views: Vec<ViewMatrix> =
            scenery.lights.iter().flat_map(|l| l.views.iter().copied()).collect();
        if views.is_empty() {
            views.push(ViewMatrix { matrix: Mat4::IDENTITY, eye: Vec3::ZERO, pad: 0.0 });
        }
        let views = self.gpu.upload("views of lights", &views, BufferUsages::STORAGE)?;
        Ok(self.gpu.bind(
            &self.pipelines.kernel_layout,
            &[
                self.tree.nodes.as_entire_binding(),
                self.tree.triangles.as_entire_binding(),
                lights.as_entire_binding(),
                views.as_entire_binding(),
                wgpu::BindingResource::TextureView(&self.shadows.all),
                wgpu::BindingResource::TextureView(&self.cube.depth.all),
                wgpu::BindingResource::TextureView(&self.cube.surface.all),
                wgpu::BindingResource::TextureView(&screen.surface),
                wgpu::BindingResource::TextureView(&screen.triangle),
                screen.image.as_entire_binding(),
                screen.pixels.as_entire_binding(),
                screen.counters.as_entire_binding(),
                wgpu::BindingResource::TextureView(&self.pyramid.all),
            ],
        ))
    }

    fn shade_and_trace(
        &mut self,
        recorder: &mut Recorder<'_>,
        scenery: &Scenery,
    ) -> Result<(), HybridError> {
        let layout = &self.uploaded.layout;
        let variant = scenery.variant;
        let primary = self.pipelines.primary(&self.gpu, layout, variant)?;
        let tracing = if variant.follow {
            Some((
                self.pipelines.sizer(&self.gpu)?,
                self.pipelines.trace(&self.gpu, layout, variant, self.pending(scenery))?,
            ))
        } else {
            None
        };
        let Some(screen) = &self.screen else { return Ok(()) };
        let group = self.kernel_group(scenery, screen)?;
        let size_group = self.gpu.bind(
            &self.pipelines.size_layout,
            &[screen.pixels.as_entire_binding(), screen.args.as_entire_binding()],
        );
        recorder.encoder.clear_buffer(&screen.counters, 0, None);
        recorder.encoder.clear_buffer(&screen.pixels, 0, Some(4));
        let [width, height] = scenery.size;
        recorder.stage(Stage::PrimaryShading, |encoder| {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&primary);
            pass.set_bind_group(0, &self.uploaded.group, &[]);
            pass.set_bind_group(1, &group, &[]);
            pass.dispatch_workgroups(width.div_ceil(8), height.div_ceil(8), 1);
            [0, 1]
        });
        if let Some((sizer, trace)) = tracing {
            recorder.stage(Stage::RayTraversal, |encoder| {
                let mut pass = encoder.begin_compute_pass(&Default::default());
                pass.set_pipeline(&sizer);
                pass.set_bind_group(0, &size_group, &[]);
                pass.dispatch_workgroups(1, 1, 1);
                drop(pass);
                let mut pass = encoder.begin_compute_pass(&Default::default());
                pass.set_pipeline(&trace);
                pass.set_bind_group(0, &self.uploaded.group, &[]);
                pass.set_bind_group(1, &group, &[]);
                pass.dispatch_workgroups_indirect(&screen.args, 0);
                drop(pass);
                [0, 2]
            });
        }
        Ok(())
    }
}

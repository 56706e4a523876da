//! Recording the commands of a frame, stage by stage.

use super::{HybridRenderer, Scenery};
use crate::{
    Effect, Face, FrameReport, HybridError, Region,
    pipelines::Target,
    report::{Stage, StageReport},
    targets::Screen,
    tree::NearInput,
};
use glam::{Mat4, Vec3};
use niwaki_gpu_frame::{ViewMatrix, camera_view, may_show};
use std::{ops::Range, time::Duration};
use wgpu::BufferUsages;

/// Bytes from one view to the next: what every device can bind.
const VIEW_STRIDE: u32 = 256;

/// Most stages of a frame.
const MOST_STAGES: u32 = 32;

/// Commands with their timing.
pub(super) type Recorder<'a> = niwaki_gpu_frame::Recorder<'a, Stage>;

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
        let mut recorder = Recorder::new(&gpu, MOST_STAGES);

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
        let stages = recorder.finish()?.into_iter().map(StageReport::from).collect();
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
        let weights = self.gpu.upload("weights", &scenery.pose.weights, BufferUsages::STORAGE)?;
        let group = self.gpu.bind(
            &self.pipelines.deform_layout,
            &[
                objects.as_entire_binding(),
                rest.vertices.as_entire_binding(),
                self.uploaded.surfaces.vertices.as_entire_binding(),
                rest.influences.as_entire_binding(),
                joints.as_entire_binding(),
                rest.starts.as_entire_binding(),
                rest.differences.as_entire_binding(),
                weights.as_entire_binding(),
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
        pass.set_vertex_buffer(0, self.uploaded.surfaces.vertices.slice(..));
        pass.set_index_buffer(self.uploaded.surfaces.indices.slice(..), wgpu::IndexFormat::Uint32);
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
        let layout = &self.uploaded.surfaces.layout;
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
        let layout = &self.uploaded.surfaces.layout;
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
            self.raster(recorder.encoder(), views, &raster);
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
        let layout = &self.uploaded.surfaces.layout;
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
        recorder.encoder().clear_buffer(&screen.counters, 0, None);
        recorder.encoder().clear_buffer(&screen.pixels, 0, Some(4));
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

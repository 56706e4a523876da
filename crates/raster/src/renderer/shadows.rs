//! Recording the lights that cast shadows, one after another.

use super::{
    Frame, Renderer, Show,
    record::{CONE_VERTICES, DepthUse, Recorder, begin, color, depth},
};
use crate::{
    Algorithm, Pass,
    layout::Caster,
    pipelines::Draw,
    targets::{Deferred, Maps, Screen},
    volumes::{BACKS, WALLS},
};
use niwaki_core::to_u32;
use niwaki_gpu_frame::{FrameError, wgpu};
use wgpu::{BindingResource, BufferUsages, IndexFormat};

/// Workgroups at most; kernels step on by the size of the grid.
const MOST_GROUPS: u32 = 16_384;

impl Renderer {
    pub(super) fn shadowed_lights(
        &self,
        recorder: &mut Recorder<'_>,
        frame: &Frame,
        screen: &Screen,
        deferred: &Deferred,
        group: &wgpu::BindGroup,
    ) -> Result<(), FrameError> {
        let share = frame.show != Show::Picture;
        let view =
            self.gpu.bind(&self.pipelines.light_view, &[frame.view_buffer.as_entire_binding()]);
        for light in self.shown(frame) {
            let (pipeline, last) = match (self.settings.algorithm, &self.maps) {
                (Algorithm::ShadowMaps, Some(maps)) => {
                    self.shadow_map(recorder, frame, light, maps)?;
                    let pipeline = self.pipeline(Draw::Mapped { variance: false, share })?;
                    (pipeline, self.maps_group(frame, maps))
                }
                (Algorithm::VarianceShadowMaps, Some(maps)) => {
                    self.moments(recorder, frame, light, maps)?;
                    let pipeline = self.pipeline(Draw::Mapped { variance: true, share })?;
                    (pipeline, self.maps_group(frame, maps))
                }
                _ => {
                    self.count_volumes(recorder, frame, light, screen)?;
                    (self.pipeline(Draw::Light { stencil: true, share })?, view.clone())
                }
            };
            recorder.stage(Pass::Light(light), |encoder| {
                let colors = [color(&deferred.sum_view, false)];
                let mut pass = begin(encoder, &colors, Some(depth(&screen.depth, DepthUse::Read)));
                pass.set_pipeline(&pipeline);
                pass.set_stencil_reference(0);
                pass.set_bind_group(0, &self.group, &[]);
                pass.set_bind_group(1, group, &[]);
                pass.set_bind_group(2, &frame.light_group, &[]);
                pass.set_bind_group(3, &last, &[]);
                pass.draw(0..CONE_VERTICES, light..light + 1);
                [1, 0]
            });
        }
        Ok(())
    }

    fn maps_group(&self, frame: &Frame, maps: &Maps) -> wgpu::BindGroup {
        self.gpu.bind(
            &self.pipelines.maps,
            &[
                frame.view_buffer.as_entire_binding(),
                BindingResource::TextureView(&maps.depth),
                BindingResource::Sampler(&maps.comparing),
                BindingResource::TextureView(&maps.moments),
                BindingResource::Sampler(&maps.filtering),
            ],
        )
    }

    fn shadow_map(
        &self,
        recorder: &mut Recorder<'_>,
        frame: &Frame,
        light: u32,
        maps: &Maps,
    ) -> Result<(), FrameError> {
        let pipeline = self.pipeline(Draw::Depth)?;
        recorder.stage(Pass::ShadowMap(light), |encoder| {
            let used = DepthUse::Begin { stencil: false };
            let mut pass = begin(encoder, &[], Some(depth(&maps.depth, used)));
            pass.set_pipeline(&pipeline);
            [self.triangles(&mut pass, frame, light as usize + 1), 0]
        });
        Ok(())
    }

    fn moments(
        &self,
        recorder: &mut Recorder<'_>,
        frame: &Frame,
        light: u32,
        maps: &Maps,
    ) -> Result<(), FrameError> {
        let Some(base) = maps.levels.first() else { return Ok(()) };
        let (fill, reduce) = (self.pipeline(Draw::Moment)?, self.pipeline(Draw::Level)?);
        let number = light as usize;
        let near = frame.lights[number].near / self.lights[number].range;
        let uniform = BufferUsages::UNIFORM;
        let params = self.gpu.upload("moments", &[[near, 0.0, 0.0, 0.0]], uniform)?;
        let params = self.gpu.bind(&self.pipelines.light_view, &[params.as_entire_binding()]);
        let mut steps = Vec::new();
        for (i, pair) in maps.levels.windows(2).enumerate() {
            let side = maps.level_side(i + 1);
            let size = self.gpu.upload("size of a level", &[[side, side, 0, 0]], uniform)?;
            let below = BindingResource::TextureView(&pair[0]);
            let bound = self.gpu.bind(&self.pipelines.level, &[below, size.as_entire_binding()]);
            steps.push((&pair[1], bound));
        }
        recorder.stage(Pass::Moments(light), |encoder| {
            let used = DepthUse::Begin { stencil: false };
            // Nothing is as far as the range.
            let mut far = color(base, true);
            if let Some(far) = &mut far {
                far.ops.load = wgpu::LoadOp::Clear(wgpu::Color::WHITE);
            }
            let mut pass = begin(encoder, &[far], Some(depth(&maps.depth, used)));
            pass.set_pipeline(&fill);
            pass.set_bind_group(2, &params, &[]);
            let draws = self.triangles(&mut pass, frame, number + 1);
            drop(pass);
            for (target, bound) in &steps {
                let mut pass = begin(encoder, &[color(target, true)], None);
                pass.set_pipeline(&reduce);
                pass.set_bind_group(0, bound, &[]);
                pass.draw(0..3, 0..1);
            }
            [draws + to_u32(steps.len()), 0]
        });
        Ok(())
    }

    fn count_volumes(
        &self,
        recorder: &mut Recorder<'_>,
        frame: &Frame,
        light: u32,
        screen: &Screen,
    ) -> Result<(), FrameError> {
        let Some(volumes) = &self.volumes else { return Ok(()) };
        let (gpu, layout) = (&self.gpu, &self.surfaces.layout);
        let classify = self.pipelines.kernel(gpu, layout, "classify")?;
        let silhouettes = self.pipelines.kernel(gpu, layout, "silhouettes")?;
        let spot = &self.lights[light as usize];
        let caster = Caster {
            matrix: frame.lights[light as usize].matrix,
            position: spot.position,
            range: spot.range,
            triangles: volumes.triangles,
            edges: volumes.edges,
            pad: [0; 2],
        };
        let bound = volumes.bind(
            gpu,
            &self.pipelines,
            &self.surfaces,
            &frame.view_buffer,
            &caster,
            self.settings.one_sided.then_some(light as usize),
        )?;
        recorder.stage(Pass::Silhouettes(light), |encoder| {
            volumes.reset(encoder, &bound);
            for (kernel, items) in [(&classify, volumes.triangles), (&silhouettes, volumes.edges)] {
                let mut pass = encoder.begin_compute_pass(&Default::default());
                pass.set_pipeline(kernel);
                pass.set_bind_group(0, &self.group, &[]);
                pass.set_bind_group(1, &bound.casters, &[]);
                pass.dispatch_workgroups(items.div_ceil(64).clamp(1, MOST_GROUPS), 1, 1);
            }
            [0, 2]
        });
        let cap = |far, reversed| self.pipeline(Draw::Cap { far, reversed });
        let caps = [
            (cap(false, false)?, &volumes.fronts, 0),
            (cap(false, true)?, &volumes.backs, BACKS),
            (cap(true, false)?, &volumes.fronts, 0),
            (cap(true, true)?, &volumes.backs, BACKS),
        ];
        let wall = self.pipeline(Draw::Wall)?;
        recorder.stage(Pass::Volumes(light), |encoder| {
            let mut pass = begin(encoder, &[], Some(depth(&screen.depth, DepthUse::Count)));
            pass.set_bind_group(0, &bound.volumes, &[]);
            pass.set_vertex_buffer(0, self.surfaces.vertices.slice(..));
            for (pipeline, list, arguments) in &caps {
                pass.set_pipeline(pipeline);
                pass.set_index_buffer(list.slice(..), IndexFormat::Uint32);
                pass.draw_indexed_indirect(&volumes.draws, *arguments);
            }
            pass.set_pipeline(&wall);
            pass.draw_indirect(&volumes.draws, WALLS);
            [5, 0]
        });
        Ok(())
    }
}

//! Recording the passes of a frame that cast no shadows.

use super::{Frame, Renderer, Show, VIEW_STRIDE};
use crate::{
    Algorithm, Pass, PassReport,
    layout::CONE_SIDES,
    pipelines::Draw,
    targets::{Deferred, Screen},
};
use niwaki_core::to_u32;
use niwaki_gpu_frame::{FrameError, may_show, wgpu};
use std::ops::Range;

pub(super) type Recorder<'a> = niwaki_gpu_frame::Recorder<'a, Pass>;

/// Passes that are timed: those of some hundreds of lights.
const MOST_PASSES: u32 = 2048;

/// Vertices of the volume of a light.
pub(super) const CONE_VERTICES: u32 = 6 * CONE_SIDES;

/// An attachment that is cleared or kept, and written.
pub(super) fn color(
    view: &wgpu::TextureView,
    clear: bool,
) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    let load =
        if clear { wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT) } else { wgpu::LoadOp::Load };
    Some(wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
    })
}

/// What a pass does with depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DepthUse {
    /// Cleared to infinity and written, the stencil with it.
    Begin { stencil: bool },
    /// Compared, not written; the stencil too.
    Read,
    /// Compared; the stencil is cleared and written.
    Count,
}

pub(super) fn depth(
    view: &wgpu::TextureView,
    used: DepthUse,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    let store = wgpu::StoreOp::Store;
    let clear = |b: bool| wgpu::Operations { load: wgpu::LoadOp::Clear(u32::from(b)), store };
    let (depth_ops, stencil_ops) = match used {
        DepthUse::Begin { stencil } => (
            Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store }),
            stencil.then(|| clear(false)),
        ),
        DepthUse::Read => (None, None),
        DepthUse::Count => (None, Some(clear(false))),
    };
    wgpu::RenderPassDepthStencilAttachment { view, depth_ops, stencil_ops }
}

pub(super) fn begin<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    colors: &[Option<wgpu::RenderPassColorAttachment<'_>>],
    depth: Option<wgpu::RenderPassDepthStencilAttachment<'_>>,
) -> wgpu::RenderPass<'a> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: None,
        color_attachments: colors,
        depth_stencil_attachment: depth,
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    })
}

impl Renderer {
    /// Records all passes, submits them and waits.
    pub(super) fn record(&self, frame: &Frame) -> Result<Vec<PassReport>, FrameError> {
        let Some(screen) = &self.screen else { return Ok(Vec::new()) };
        let mut recorder = Recorder::new(&self.gpu, MOST_PASSES);
        match (self.settings.algorithm, &screen.deferred) {
            (_, None) => self.forward(&mut recorder, frame, screen)?,
            (Algorithm::Forward | Algorithm::ZPrepass, Some(_)) => {}
            (algorithm, Some(deferred)) => {
                self.gbuffer(&mut recorder, frame, screen, deferred)?;
                let group = self.gpu.bind(
                    &self.pipelines.gbuffer,
                    &[
                        wgpu::BindingResource::TextureView(&deferred.surface),
                        wgpu::BindingResource::TextureView(&deferred.depth),
                    ],
                );
                self.base(&mut recorder, frame, deferred, &group)?;
                if algorithm.has_shadows() {
                    self.shadowed_lights(&mut recorder, frame, screen, deferred, &group)?;
                } else {
                    self.plain_lights(&mut recorder, frame, screen, deferred, &group)?;
                }
                self.resolve(&mut recorder, frame, screen, deferred, &group)?;
            }
        }
        Ok(recorder.finish()?.into_iter().map(PassReport::from).collect())
    }

    /// Ranges of triangles of the objects that a view may show, neighbours joined.
    fn ranges(&self, frame: &Frame, view: usize) -> Vec<Range<u32>> {
        let mut ranges: Vec<Range<u32>> = Vec::new();
        let shown = self.objects.iter().filter(|o| may_show(&frame.views[view], o.bounds));
        for range in shown.map(|o| o.triangles.clone()).filter(|r| !r.is_empty()) {
            match ranges.last_mut() {
                Some(last) if last.end == range.start => last.end = range.end,
                _ => ranges.push(range),
            }
        }
        ranges
    }

    /// Draws what a view may show with a pipeline that is set and bound but for group 1; returns
    /// how many draws that took.
    pub(super) fn triangles(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        frame: &Frame,
        view: usize,
    ) -> u32 {
        pass.set_bind_group(0, &self.group, &[]);
        pass.set_bind_group(1, &frame.view_group, &[to_u32(view * VIEW_STRIDE)]);
        pass.set_vertex_buffer(0, self.surfaces.vertices.slice(..));
        pass.set_index_buffer(self.surfaces.indices.slice(..), wgpu::IndexFormat::Uint32);
        let ranges = self.ranges(frame, view);
        for range in &ranges {
            // The number of the instance tells the shader which triangle is the draw's first.
            let instance = range.start..range.start + 1;
            pass.draw_indexed(3 * range.start..3 * range.end, 0, instance);
        }
        to_u32(ranges.len())
    }

    fn forward(
        &self,
        recorder: &mut Recorder<'_>,
        frame: &Frame,
        screen: &Screen,
    ) -> Result<(), FrameError> {
        let after = self.settings.algorithm == Algorithm::ZPrepass;
        let (depth_pipeline, shade) =
            (self.pipeline(Draw::Depth)?, self.pipeline(Draw::Forward { after })?);
        let sky = self.pipeline(Draw::Sky)?;
        let cleared = DepthUse::Begin { stencil: false };
        if after {
            recorder.stage(Pass::DepthPrepass, |encoder| {
                let mut pass = begin(encoder, &[], Some(depth(&screen.depth, cleared)));
                pass.set_pipeline(&depth_pipeline);
                [self.triangles(&mut pass, frame, 0), 0]
            });
        }
        recorder.stage(Pass::Forward, |encoder| {
            let used = if after { DepthUse::Read } else { cleared };
            let colors = [color(&screen.output_view, true)];
            let mut pass = begin(encoder, &colors, Some(depth(&screen.depth, used)));
            pass.set_pipeline(&shade);
            pass.set_bind_group(2, &frame.light_group, &[]);
            [self.triangles(&mut pass, frame, 0), 0]
        });
        recorder.stage(Pass::Sky, |encoder| {
            let colors = [color(&screen.output_view, false)];
            let mut pass = begin(encoder, &colors, Some(depth(&screen.depth, DepthUse::Read)));
            pass.set_pipeline(&sky);
            pass.set_bind_group(0, &self.group, &[]);
            pass.draw(0..3, 0..1);
            [1, 0]
        });
        Ok(())
    }

    fn gbuffer(
        &self,
        recorder: &mut Recorder<'_>,
        frame: &Frame,
        screen: &Screen,
        deferred: &Deferred,
    ) -> Result<(), FrameError> {
        let stencil = screen.kind.stencil;
        let triangles = deferred.triangle.is_some();
        let pipeline = self.pipeline(Draw::GBuffer { triangles, stencil })?;
        let mut colors = vec![color(&deferred.surface, true)];
        colors.extend(deferred.triangle.iter().map(|(_, view)| color(view, true)));
        recorder.stage(Pass::GBuffer, |encoder| {
            let used = DepthUse::Begin { stencil };
            let mut pass = begin(encoder, &colors, Some(depth(&screen.depth, used)));
            pass.set_pipeline(&pipeline);
            [self.triangles(&mut pass, frame, 0), 0]
        });
        Ok(())
    }

    fn base(
        &self,
        recorder: &mut Recorder<'_>,
        frame: &Frame,
        deferred: &Deferred,
        group: &wgpu::BindGroup,
    ) -> Result<(), FrameError> {
        let pipeline = self.pipeline(Draw::Base)?;
        recorder.stage(Pass::Base, |encoder| {
            let mut pass = begin(encoder, &[color(&deferred.sum_view, true)], None);
            if frame.show != Show::Picture {
                return [0, 0];
            }
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &self.group, &[]);
            pass.set_bind_group(1, group, &[]);
            pass.draw(0..3, 0..1);
            [1, 0]
        });
        Ok(())
    }

    /// The lights that a frame shows.
    pub(super) fn shown(&self, frame: &Frame) -> Range<u32> {
        match frame.show {
            Show::Picture => 0..to_u32(self.lights.len()),
            Show::Share(light) => light..light + 1,
        }
    }

    fn plain_lights(
        &self,
        recorder: &mut Recorder<'_>,
        frame: &Frame,
        screen: &Screen,
        deferred: &Deferred,
        group: &wgpu::BindGroup,
    ) -> Result<(), FrameError> {
        let share = frame.show != Show::Picture;
        let pipeline = self.pipeline(Draw::Light { stencil: false, share })?;
        let view =
            self.gpu.bind(&self.pipelines.light_view, &[frame.view_buffer.as_entire_binding()]);
        let shown = self.shown(frame);
        recorder.stage(Pass::Lights, |encoder| {
            let colors = [color(&deferred.sum_view, false)];
            let mut pass = begin(encoder, &colors, Some(depth(&screen.depth, DepthUse::Read)));
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &self.group, &[]);
            pass.set_bind_group(1, group, &[]);
            pass.set_bind_group(2, &frame.light_group, &[]);
            pass.set_bind_group(3, &view, &[]);
            pass.draw(0..CONE_VERTICES, shown);
            [1, 0]
        });
        Ok(())
    }

    fn resolve(
        &self,
        recorder: &mut Recorder<'_>,
        frame: &Frame,
        screen: &Screen,
        deferred: &Deferred,
        group: &wgpu::BindGroup,
    ) -> Result<(), FrameError> {
        let pipeline = self.pipeline(Draw::Resolve)?;
        let sum = self
            .gpu
            .bind(&self.pipelines.sum, &[wgpu::BindingResource::TextureView(&deferred.sum_view)]);
        recorder.stage(Pass::Resolve, |encoder| {
            let mut pass = begin(encoder, &[color(&screen.output_view, true)], None);
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &self.group, &[]);
            pass.set_bind_group(1, group, &[]);
            pass.set_bind_group(2, &frame.light_group, &[]);
            pass.set_bind_group(3, &sum, &[]);
            pass.draw(0..3, 0..1);
            [1, 0]
        });
        Ok(())
    }
}

//! Recording what makes the cube map: its faces, their second layer and the pyramid over their
//! depth.

use super::{
    HybridRenderer, Scenery,
    record::{Raster, Recorder, Views},
};
use crate::{Effect, Face, HybridError, ObjectFacts, pipelines::Target, report::Stage};
use niwaki_core::to_u32;

impl HybridRenderer {
    /// The faces that the plan names, and what is made from them.
    pub(super) fn draw_cube(
        &self,
        recorder: &mut Recorder<'_>,
        scenery: &Scenery,
        views: &Views,
    ) -> Result<(), HybridError> {
        let plan = &scenery.plan;
        let drawn: Vec<Face> =
            Face::ALL.into_iter().filter(|f| plan.runs(Effect::CubeFace(*f))).collect();
        if drawn.is_empty() {
            return Ok(());
        }
        self.draw_faces(recorder, scenery, views, &drawn)?;
        if plan.runs(Effect::SecondLayer) {
            self.draw_second(recorder, scenery, views, &drawn)?;
        }
        if plan.runs(Effect::DepthPyramid) {
            let layers = 0..self.cube.layers;
            let layers: Vec<u32> = layers
                .flat_map(|layer| drawn.iter().map(move |f| 6 * layer + to_u32(f.index())))
                .collect();
            let build = self.pyramid.prepare(
                &self.gpu,
                &self.pipelines,
                &self.uploaded,
                &self.cube,
                &layers,
            )?;
            recorder.stage(Stage::Effect(Effect::DepthPyramid), |encoder| {
                [0, build.record(encoder, &self.uploaded.group)]
            });
        }
        Ok(())
    }

    fn draw_faces(
        &self,
        recorder: &mut Recorder<'_>,
        scenery: &Scenery,
        views: &Views,
        drawn: &[Face],
    ) -> Result<(), HybridError> {
        let layout = &self.uploaded.surfaces.layout;
        let pipeline = self.pipelines.raster(&self.gpu, layout, Target::Face, scenery.variant)?;
        for face in drawn {
            let i = face.index();
            recorder.stage(Stage::Effect(Effect::CubeFace(*face)), |encoder| {
                [self.draw_face(encoder, scenery, views, &pipeline, i, None), 0]
            });
        }
        Ok(())
    }

    /// Draws the faces again, without what the first layer shows and its thickness (depth peeling,
    /// Everitt 2001).
    fn draw_second(
        &self,
        recorder: &mut Recorder<'_>,
        scenery: &Scenery,
        views: &Views,
        drawn: &[Face],
    ) -> Result<(), HybridError> {
        let layout = &self.uploaded.surfaces.layout;
        let pipeline = self.pipelines.raster(&self.gpu, layout, Target::Second, scenery.variant)?;
        recorder.stage(Stage::Effect(Effect::SecondLayer), |encoder| {
            let mut draws = 0;
            for face in drawn {
                let i = face.index();
                let first = self.gpu.bind(
                    &self.pipelines.first_layer_layout,
                    &[
                        wgpu::BindingResource::TextureView(&self.cube.depth.each[i]),
                        wgpu::BindingResource::TextureView(&self.cube.surface.each[i]),
                    ],
                );
                draws += self.draw_face(encoder, scenery, views, &pipeline, i, Some(&first));
            }
            [draws, 0]
        });
        Ok(())
    }

    /// Draws a face's first layer, or behind what `first` shows its second.
    fn draw_face(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        scenery: &Scenery,
        views: &Views,
        pipeline: &wgpu::RenderPipeline,
        face: usize,
        first: Option<&wgpu::BindGroup>,
    ) -> u32 {
        let target = if first.is_some() { 6 + face } else { face };
        let in_face = &scenery.plan.in_faces[face];
        let clear = |i: &u32| scenery.objects.get(*i as usize).is_some_and(ObjectFacts::is_clear);
        // Where nothing is seen through, a layer that holds nothing else stays empty.
        let is_empty =
            first.is_some() && scenery.variant.through_only && !in_face.iter().any(clear);
        let shown = in_face.iter().copied().filter(|_| !is_empty);
        let raster = Raster {
            pipeline,
            colors: &[&self.cube.surface.each[target]],
            depth: &self.cube.depth.each[target],
            clear_depth: 1.0,
            view: 1 + to_u32(face),
            draws: &Self::ranges(scenery, shown),
            inputs: first,
        };
        self.raster(encoder, views, &raster)
    }
}

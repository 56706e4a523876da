//! The rules.

use super::{
    Decision, Effect, EffectPlan, FrameFacts, Kept, ObjectFacts, PlannedPass, Quality, counted,
};
use crate::{Face, Region, Settings, Shadows};
use glam::DVec3;
use niwaki_core::{Aabb, to_u32};
use niwaki_scene::Camera;

/// What the rules need to know of a frame, found once.
struct Frame<'a> {
    facts: &'a FrameFacts<'a>,
    settings: Settings,
    region: Region,
    bounds: Aabb,
    visible: Vec<u32>,
    in_faces: [Vec<u32>; 6],
    in_region: Vec<u32>,
    moved: bool,
}

pub(super) fn decide(facts: &FrameFacts<'_>) -> EffectPlan {
    let settings = facts.settings.sanitized();
    let bounds = facts.objects.iter().fold(Aabb::EMPTY, |b, o| b.union(o.bounds));
    let rest = facts.scene.worn().fold(Aabb::EMPTY, |b, m| b.union(m.bounds));
    let region = Region::new(facts.camera, bounds, rest, &settings);
    let frustum = Frustum::new(facts.camera, facts.width, facts.height);
    let pick = |test: &dyn Fn(Aabb) -> bool| -> Vec<u32> {
        (0..to_u32(facts.objects.len()))
            .filter(|&i| test(facts.objects[i as usize].bounds))
            .collect()
    };
    let frame = Frame {
        visible: pick(&|b| frustum.may_show(b)),
        in_faces: Face::ALL.map(|face| pick(&|b| region.seen_by(face, b))),
        in_region: pick(&|b| region.meets(b)),
        moved: facts.objects.iter().any(|o| o.moved_from.is_some()),
        facts,
        settings,
        region,
        bounds,
    };
    frame.plan()
}

type Ruling = (Decision, String);

fn run(quality: Quality, reason: impl Into<String>) -> Ruling {
    (Decision::Run { quality }, reason.into())
}

fn keep(reason: impl Into<String>) -> Ruling {
    (Decision::Keep, reason.into())
}

fn skip(reason: impl Into<String>) -> Ruling {
    (Decision::Skip, reason.into())
}

fn going_on(objects: usize) -> String {
    format!("rays go on from {}", counted(to_u32(objects), "visible object"))
}

fn faces_are(n: usize) -> String {
    if n == 1 { "1 face is".into() } else { format!("{n} faces are") }
}

impl Frame<'_> {
    fn plan(self) -> EffectPlan {
        let mut passes: Vec<PlannedPass> = Vec::new();
        for effect in Effect::ALL {
            let ruling = self.rule(effect);
            let (decision, reason) = match ruling {
                (Decision::Skip | Decision::Keep, reason) if self.settings.force_all => {
                    (Decision::Run { quality: self.quality(effect) }, format!("forced; {reason}"))
                }
                ruling => ruling,
            };
            passes.push(PlannedPass { effect, decision, reason });
        }
        let region_holds_all = self.holds_all();
        let layers = self.layers();
        let mut plan = EffectPlan {
            passes,
            region: self.region,
            visible: self.visible,
            in_faces: self.in_faces,
            layers,
            in_region: self.in_region,
            region_holds_all,
            kept: Kept::default(),
        };
        plan.kept = remaining(&plan, &self.settings, self.moved, self.facts.kept);
        plan
    }

    fn quality(&self, effect: Effect) -> Quality {
        let (width, height) = (self.facts.width, self.facts.height);
        let side = self.settings.face_resolution;
        match effect {
            Effect::Deformation => {
                Quality::Objects(to_u32(self.facts.objects.iter().filter(|o| o.dynamic).count()))
            }
            Effect::PrimaryView => {
                Quality::View { width, height, objects: to_u32(self.visible.len()) }
            }
            Effect::ShadowMaps => Quality::Maps {
                layers: self.shadow_layers(),
                resolution: self.settings.shadow_resolution,
            },
            Effect::CubeFace(face) => {
                let objects = to_u32(self.in_faces[face.index()].len());
                Quality::View { width: side, height: side, objects }
            }
            Effect::SecondLayer | Effect::DepthPyramid => {
                let drawn = |f: &&Face| self.settings.force_all || self.draws(**f);
                let faces = to_u32(Face::ALL.iter().filter(drawn).count());
                Quality::Faces { faces, resolution: side }
            }
            Effect::NearRegion => Quality::Objects(to_u32(self.in_region.len())),
            Effect::ReflectionRays | Effect::RefractionRays => {
                Quality::Depth(self.settings.max_depth)
            }
            Effect::OcclusionRays => Quality::Rays(self.settings.occlusion_rays),
            Effect::Alpha | Effect::ShadowRays | Effect::TransparencyRays | Effect::Sky => {
                Quality::Full
            }
        }
    }

    fn rule(&self, effect: Effect) -> Ruling {
        if self.facts.width == 0 || self.facts.height == 0 {
            return skip("the image has no pixels");
        }
        match effect {
            Effect::Deformation => self.deformation(),
            Effect::PrimaryView => match self.visible.len() {
                0 => skip("the camera sees no object"),
                n => run(self.quality(effect), format!("{n} of {} in view", self.all_objects())),
            },
            Effect::Alpha => match self.facts.objects.iter().filter(|o| o.alpha).count() {
                0 => skip("no surface is cut out or blended"),
                1 => run(Quality::Full, "1 object has cut-out or blended surfaces"),
                n => run(Quality::Full, format!("{n} objects have cut-out or blended surfaces")),
            },
            Effect::ShadowMaps => self.shadow_maps(),
            Effect::CubeFace(face) => self.face(face),
            Effect::SecondLayer if self.settings.layers >= 2 => {
                self.of_faces(effect, "rays may pass behind what they show")
            }
            Effect::SecondLayer if self.layers() < 2 => {
                skip("the settings ask for one layer, and the map shows nothing to look through")
            }
            Effect::SecondLayer => {
                self.of_faces(effect, "glass, blended or cut-out surfaces hide something")
            }
            Effect::DepthPyramid if !self.settings.march.needs_pyramid() => {
                skip("the settings march without it")
            }
            Effect::DepthPyramid => self.of_faces(effect, "rays may cross them"),
            Effect::NearRegion => self.near_region(),
            Effect::ShadowRays => self.shadow_rays(),
            Effect::OcclusionRays => self.occlusion_rays(),
            Effect::ReflectionRays | Effect::RefractionRays => self.secondary(effect),
            Effect::TransparencyRays => self.transparency(),
            Effect::Sky => {
                if self.facts.scene.lights.environment {
                    run(Quality::Full, "light comes from outside")
                } else {
                    skip("no light comes from outside")
                }
            }
        }
    }

    fn deformation(&self) -> Ruling {
        match self.facts.objects.iter().filter(|o| o.dynamic).count() {
            0 => skip("every object is static"),
            _ if !self.moved && self.facts.kept.is_some_and(|k| k.deformed) => {
                keep("no object has moved since the last frame")
            }
            1 => run(self.quality(Effect::Deformation), "1 object morphs, moves or bends"),
            n => run(self.quality(Effect::Deformation), format!("{n} objects morph, move or bend")),
        }
    }

    /// Why no ray goes on from what is visible, if none does; otherwise from how many objects.
    ///
    /// Which kinds of rays run is a matter of the whole scene: a mirror may show glass that the
    /// camera does not see, and what is blended may show both.
    fn sending(&self) -> Result<usize, &'static str> {
        let sends = |o: &ObjectFacts| o.blended || (o.is_specular() && self.settings.max_depth > 0);
        let visible = self.visible.iter().map(|&i| &self.facts.objects[i as usize]);
        match visible.filter(|o| sends(o)).count() {
            0 => Err("no mirror, glass or blended surface is in view"),
            n => Ok(n),
        }
    }

    fn secondary(&self, effect: Effect) -> Ruling {
        let refraction = effect == Effect::RefractionRays;
        let objects = self.facts.objects;
        let exists = objects.iter().any(|o| if refraction { o.transmissive } else { o.reflective });
        if !exists {
            return skip(if refraction {
                "no surface transmits light"
            } else {
                "no surface is a mirror"
            });
        }
        if self.settings.max_depth == 0 {
            return skip("the settings allow no recursion");
        }
        match self.sending() {
            Err(reason) => skip(reason),
            Ok(n) => run(self.quality(effect), going_on(n)),
        }
    }

    fn transparency(&self) -> Ruling {
        if !self.facts.objects.iter().any(|o| o.blended) {
            return skip("no surface is blended");
        }
        match self.sending() {
            Err(reason) => skip(reason),
            Ok(n) => run(Quality::Full, going_on(n)),
        }
    }

    fn follows_rays(&self) -> bool {
        [Effect::ReflectionRays, Effect::RefractionRays, Effect::TransparencyRays]
            .iter()
            .any(|e| matches!(self.rule(*e).0, Decision::Run { .. }))
    }

    /// True if no surface beyond the near region exists, so that the map is empty.
    fn holds_all(&self) -> bool {
        self.region.holds(self.bounds)
    }

    /// Layers of the cube map.
    fn layers(&self) -> u32 {
        let clear = |i: &u32| self.facts.objects[*i as usize].is_clear();
        let seen = self.settings.look_through && self.in_faces.iter().flatten().any(clear);
        if seen { 2 } else { self.settings.layers }
    }

    fn face(&self, face: Face) -> Ruling {
        if !self.follows_rays() {
            return skip("no ray would enter it");
        }
        let shown = &self.in_faces[face.index()];
        if shown.is_empty() {
            return skip(if self.holds_all() {
                "the near region holds the whole scene"
            } else {
                "no object reaches into it"
            });
        }
        let last = self.facts.kept.and_then(|k| k.faces[face.index()]);
        let layers = self.facts.kept.map(|k| k.layers);
        if last == Some((self.region, self.settings.face_resolution))
            && layers == Some(self.layers())
        {
            let touched = |i: usize| {
                let object = &self.facts.objects[i];
                object.moved_from.is_some_and(|from| {
                    self.region.seen_by(face, object.bounds) || self.region.seen_by(face, from)
                })
            };
            if !(0..self.facts.objects.len()).any(touched) {
                return keep("neither camera nor objects in it have moved");
            }
        }
        run(
            self.quality(Effect::CubeFace(face)),
            match shown.len() {
                1 => "rays may enter it, 1 object reaches into it".into(),
                n => format!("rays may enter it, {n} objects reach into it"),
            },
        )
    }

    /// True if a face is drawn in this frame.
    fn draws(&self, face: Face) -> bool {
        matches!(self.face(face).0, Decision::Run { .. })
    }

    /// What is made from the faces that are drawn, and kept with those that are kept.
    fn of_faces(&self, effect: Effect, why: &str) -> Ruling {
        let drawn = Face::ALL.iter().filter(|f| self.draws(**f)).count();
        if drawn > 0 {
            return run(self.quality(effect), format!("{} drawn anew, {why}", faces_are(drawn)));
        }
        if Face::ALL.iter().any(|f| self.face(*f).0 == Decision::Keep) {
            return keep("no face is drawn anew");
        }
        skip("no face of the cube map is in use")
    }

    fn all_objects(&self) -> String {
        match self.facts.objects.len() {
            1 => "1 object is".into(),
            n => format!("{n} objects are"),
        }
    }

    fn traces_shadows(&self) -> bool {
        matches!(self.shadow_rays().0, Decision::Run { .. })
    }

    fn shadow_rays(&self) -> Ruling {
        match self.without_shadows() {
            Some(reason) => skip(reason),
            None if self.settings.shadows != Shadows::Traced => {
                skip("the settings use shadow maps")
            }
            None if self.in_region.is_empty() => skip("nothing lies in the near region"),
            None => run(Quality::Full, "surfaces and occluders lie in the near region"),
        }
    }

    fn traces_occlusion(&self) -> bool {
        matches!(self.occlusion_rays().0, Decision::Run { .. })
    }

    fn occlusion_rays(&self) -> Ruling {
        if self.settings.occlusion_rays == 0 {
            return skip("the settings ask for none");
        }
        if self.settings.occlusion_radius <= 0.0 {
            return skip("the settings give them no length");
        }
        if !self.facts.scene.lights.environment || self.settings.ambient <= 0.0 {
            return skip("there is no ambient light to hold back");
        }
        if !self.facts.objects.iter().any(|o| o.lit) {
            return skip("no surface scatters ambient light");
        }
        if self.visible.is_empty() {
            return skip("the camera sees no object");
        }
        if self.in_region.is_empty() {
            return skip("nothing lies in the near region");
        }
        run(
            self.quality(Effect::OcclusionRays),
            "surfaces in the near region scatter ambient light",
        )
    }

    /// Why no shadow matters, if none does.
    fn without_shadows(&self) -> Option<&'static str> {
        if self.facts.scene.lights.punctual() == 0 {
            return Some("no lamp casts shadows");
        }
        if self.settings.shadows == Shadows::None {
            return Some("the settings ask for no shadows");
        }
        if !self.facts.objects.iter().any(|o| o.lit) {
            return Some("no surface scatters the light of lamps");
        }
        if self.visible.is_empty() {
            return Some("the camera sees no object");
        }
        None
    }

    fn shadow_layers(&self) -> u32 {
        let lights = self.facts.scene.lights;
        let in_one = lights.directional + lights.spot - lights.wide_spot;
        to_u32(6 * (lights.point + lights.wide_spot) + in_one)
    }

    fn shadow_maps(&self) -> Ruling {
        if let Some(reason) = self.without_shadows() {
            return skip(reason);
        }
        if self.settings.shadows == Shadows::Traced && self.holds_all() {
            return skip("the near region holds the whole scene: rays find every occluder");
        }
        let wanted = (self.shadow_layers(), self.settings.shadow_resolution);
        if !self.moved && self.facts.kept.and_then(|k| k.shadow_maps) == Some(wanted) {
            return keep("no object has moved since the last frame");
        }
        let reason = match self.facts.scene.lights.punctual() {
            1 => "1 lamp casts shadows".into(),
            n => format!("{n} lamps cast shadows"),
        };
        run(self.quality(Effect::ShadowMaps), reason)
    }

    fn near_region(&self) -> Ruling {
        if !self.follows_rays() && !self.traces_shadows() && !self.traces_occlusion() {
            return skip("no ray would be traced in it");
        }
        if self.in_region.is_empty() {
            return skip("no object meets it");
        }
        let meeting = to_u32(self.in_region.len());
        let verb = if meeting == 1 { "meets" } else { "meet" };
        let all = counted(to_u32(self.facts.objects.len()), "object");
        let reason = format!("{meeting} of {all} {verb} it");
        let Some(kept) = self.facts.kept else {
            return run(self.quality(Effect::NearRegion), reason);
        };
        let touched = self.facts.objects.iter().any(|object| {
            object
                .moved_from
                .is_some_and(|from| self.region.meets(object.bounds) || self.region.meets(from))
        });
        if touched {
            return run(self.quality(Effect::NearRegion), format!("{reason} and some have moved"));
        }
        if kept.tree.is_some() && kept.tree_holds_all && self.holds_all() {
            return keep("it holds the whole scene, and nothing in it has moved");
        }
        if kept.tree == Some(self.region) {
            return keep("neither camera nor objects in it have moved");
        }
        run(self.quality(Effect::NearRegion), reason)
    }
}

/// What holds after a frame with this plan.
fn remaining(plan: &EffectPlan, settings: &Settings, moved: bool, before: Option<&Kept>) -> Kept {
    // What was not looked at in this frame may be out of date if something moved.
    let before = if moved { None } else { before };
    let mut kept = before.cloned().unwrap_or_default();
    kept.deformed |= plan.uses(Effect::Deformation);
    for face in Face::ALL {
        if plan.uses(Effect::CubeFace(face)) {
            kept.faces[face.index()] = Some((plan.region, settings.face_resolution));
        } else if kept.layers != plan.layers {
            // Another number of layers is another map.
            kept.faces[face.index()] = None;
        }
    }
    kept.layers = plan.layers;
    match plan.decision(Effect::NearRegion) {
        Decision::Run { .. } => {
            kept.tree = Some(plan.region);
            kept.tree_holds_all = plan.region_holds_all;
        }
        // With everything inside, the tree is that of an earlier region.
        Decision::Keep if moved => {
            kept.tree = Some(plan.region);
            kept.tree_holds_all = plan.region_holds_all;
        }
        _ => {}
    }
    if plan.uses(Effect::ShadowMaps)
        && let Some(PlannedPass { decision, .. }) = plan.pass(Effect::ShadowMaps)
    {
        kept.shadow_maps = match decision {
            Decision::Run { quality: Quality::Maps { layers, resolution } } => {
                Some((*layers, *resolution))
            }
            _ => kept.shadow_maps,
        };
    }
    kept
}

/// The camera's view as planes through its position.
struct Frustum {
    position: DVec3,
    /// Normals that point into the view.
    normals: [DVec3; 5],
}

impl Frustum {
    fn new(camera: &Camera, width: u32, height: u32) -> Self {
        let tangent = (0.5 * f64::from(camera.vertical_fov)).tan();
        let aspect = f64::from(width.max(1)) / f64::from(height.max(1));
        let forward = camera.forward.as_dvec3();
        let (right, up) = (camera.right().as_dvec3(), camera.up.as_dvec3());
        Self {
            position: camera.position.as_dvec3(),
            normals: [
                forward,
                forward * (tangent * aspect) + right,
                forward * (tangent * aspect) - right,
                forward * tangent + up,
                forward * tangent - up,
            ],
        }
    }

    /// False only if no point of the box is in view. A view that is not finite shows everything.
    fn may_show(&self, bounds: Aabb) -> bool {
        if bounds.is_empty() {
            return false;
        }
        let (min, max) =
            (bounds.min.as_dvec3() - self.position, bounds.max.as_dvec3() - self.position);
        // Slack for the rounding of matrices and vertices on the GPU.
        let slack = 1e-5 * min.abs().max(max.abs()).max_element();
        !self.normals.iter().any(|n| (*n * min).max(*n * max).element_sum() < -slack)
    }
}

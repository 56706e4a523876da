//! The thesis's model as a predictor, its three devices, and every controller on them.

use niwaki_frame_control::sim::{
    Counters, Device, DeviceSpec, Run, Scene, Script, View, tune_by_hand,
};
use niwaki_frame_control::{
    Config, Controller, FixedRung, FrameController, FrameRecord, FrozenWorkload, Ladder,
    RegressionConfig, RegressionController, RenderSettings, Summary, frames_off, kendall_tau_b,
};
use niwaki_gpu_model::{FrameModel, KernelCounts, RaySettings, Workload};

/// Instructions of a traversal kernel, of the size that compilers make of one.
const KERNEL: KernelCounts = KernelCounts {
    compute_per_traversal: 38.0,
    compute_per_intersection: 23.0,
    compute_constant: 60.0,
    memory_per_traversal: 5.0,
    memory_per_intersection: 3.0,
    memory_constant: 3.0,
    bytes_per_memory_instruction: 16.0,
};

/// Pixels of the simulated image.
const PIXELS: u64 = 786_432;
/// Frames before the controllers are judged.
pub(crate) const SETTLING: usize = 10;
/// Frames of the scripts with a turn, and the frame before which it comes.
pub(crate) const TURN: (usize, usize) = (80, 40);

/// The thesis's scale, up to 64 rays.
pub(crate) fn ladder() -> Ladder<RenderSettings> {
    Ladder::ray_tracing(64, 0.1).expect("64 rays are in range")
}

/// The thesis's three parameter sets (its Table 4) with a simulated device for each.
pub(crate) fn devices() -> [(&'static str, DeviceSpec); 3] {
    [
        ("geforce-580", DeviceSpec::geforce_580()),
        ("geforce-8800", DeviceSpec::geforce_8800()),
        ("radeon-5870", DeviceSpec::radeon_5870()),
    ]
}

/// The thesis's model of a device, in milliseconds; "I don't know" where it has no answer.
pub(crate) fn model(device: &str) -> impl Fn(&RenderSettings, &Counters) -> f64 + Clone + use<> {
    let device = niwaki_gpu_model::Device::builtin(device).expect("a built-in device");
    let model = FrameModel::new(device, KERNEL, PIXELS);
    move |settings, seen| {
        let workload = Workload {
            primary_traversals: seen.primary_traversals,
            primary_intersections: seen.primary_intersections,
            visible_triangles: seen.visible,
            ao_traversals: seen.ao_traversals,
            ao_intersections: seen.ao_intersections,
            coalescing: seen.coalescing,
            shadow_traversals: seen.shadow_traversals,
            shadow_intersections: seen.shadow_intersections,
            ..Workload::default()
        };
        let rays = RaySettings { ao_rays: f64::from(settings.ao_rays), shadows: settings.shadows };
        let frame = if settings.render_scale == 1.0 {
            model.predict(&workload, &rays)
        } else {
            let pixels = PIXELS as f64 * settings.render_scale * settings.render_scale;
            #[expect(clippy::cast_possible_truncation, reason = "fewer than 4 times the pixels")]
            FrameModel { pixels: pixels.round() as u64, ..model.clone() }.predict(&workload, &rays)
        };
        frame.map_or(f64::NAN, |frame| frame.seconds * 1e3)
    }
}

/// The thesis's model where it goes, and guesses for what it has no terms for: longer rays of ambient
/// occlusion visit more nodes, and each bounce of the pixels that mirror is a primary ray again, the
/// longer the larger the near region.
pub(crate) fn hybrid_model(
    device: &str,
) -> impl Fn(&RenderSettings, &Counters) -> f64 + Clone + use<> {
    let model = model(device);
    move |settings, seen| {
        let longer = (settings.ao_radius / seen.ao_radius).powf(0.3);
        let seen_by_ao = Counters { ao_traversals: seen.ao_traversals * longer, ..*seen };
        let scale =
            RenderSettings { render_scale: settings.render_scale, ..RenderSettings::PRIMARY };
        let bounces: f64 = (0..settings.reflection_depth).map(|b| 0.5_f64.powi(b.into())).sum();
        model(settings, &seen_by_ao)
            + model(&scale, seen) * seen.mirrors * bounces * (0.6 + settings.near_region)
    }
}

/// What a regression may use: the counters of each kind of rays, those that miss weighted apart.
pub(crate) fn features(settings: &RenderSettings, seen: &Counters) -> [f64; 6] {
    let shadows = f64::from(u8::from(settings.shadows));
    let ao = f64::from(settings.ao_rays);
    let first = seen.primary_traversals + shadows * seen.shadow_traversals;
    let tests = seen.primary_intersections + shadows * seen.shadow_intersections;
    let ao_steps = ao * seen.ao_traversals;
    let long = seen.primary_traversals + seen.ao_traversals;
    let ao_tests = ao * seen.visible * seen.ao_intersections;
    [1.0, first * (1.0 - seen.coalescing), tests, ao_steps, ao_steps * long, ao_tests]
}

/// A device, its model, a script and a target: everything that a run needs.
pub(crate) struct Case {
    pub(crate) device: &'static str,
    pub(crate) spec: DeviceSpec,
    pub(crate) script: Script,
    pub(crate) target_ms: f64,
    pub(crate) run: Run,
}

impl Case {
    /// The target is what 30 rays take in the view of frame `at`.
    pub(crate) fn new(device: &'static str, spec: DeviceSpec, script: Script, at: usize) -> Self {
        let simulated = Device::new(spec.clone(), 0).expect("a valid device");
        let target_ms = simulated.ideal_ms(&script.view(at), &ladder().rungs()[31]);
        Self { device, spec, script, target_ms, run: Run::default() }
    }

    pub(crate) fn path(device: &'static str, spec: DeviceSpec, script: Script) -> Self {
        let middle = script.frames() / 2;
        Self::new(device, spec, script, middle)
    }

    /// A turn from the wall to the scene, with the target of 30 rays in the scene.
    pub(crate) fn turn(device: &'static str, spec: DeviceSpec, scene: Scene) -> Self {
        Self::new(device, spec, Script::turn(scene, TURN.0, TURN.1), TURN.1)
    }

    /// A cut to another view every ten frames.
    pub(crate) fn cuts(device: &'static str, spec: DeviceSpec, scene: Scene) -> Self {
        Self::new(device, spec, Script::cuts(scene, 100, 10), 0)
    }

    fn first_view(&self) -> View {
        self.script.view(0)
    }

    /// Every controller of the comparison, by name.
    pub(crate) fn controllers(&self) -> Vec<(&'static str, Box<dyn Controller<Counters>>)> {
        let simulated = Device::new(self.spec.clone(), 0).expect("a valid device");
        let first = self.first_view();
        let tuned = tune_by_hand(&simulated, &first, &ladder(), self.target_ms);
        let model = model(self.device);
        let frozen = FrozenWorkload { predictor: model.clone(), workload: first.counters };
        let target = self.target_ms;
        let message = "valid settings";
        let mut feedback =
            FrameController::new(ladder(), frozen, target, Config::feedback()).expect(message);
        feedback.start_at(tuned).expect(message);
        let config = RegressionConfig::default();
        vec![
            ("no tuning", Box::new(FixedRung::new(&ladder(), tuned).expect(message))),
            ("feedback", Box::new(feedback)),
            (
                "regression",
                Box::new(
                    RegressionController::new(ladder(), features, target, tuned, config)
                        .expect(message),
                ),
            ),
            (
                "feedforward",
                Box::new(
                    FrameController::new(ladder(), model.clone(), target, Config::feedforward())
                        .expect(message),
                ),
            ),
            (
                "both",
                Box::new(
                    FrameController::new(ladder(), model, target, Config::default())
                        .expect(message),
                ),
            ),
        ]
    }

    /// Runs a controller on a fresh device.
    pub(crate) fn frames(&self, controller: &mut dyn Controller<Counters>) -> Vec<FrameRecord> {
        let mut device = Device::new(self.spec.clone(), 11).expect("a valid device");
        self.run.frames(controller, &ladder(), &mut device, &self.script, self.target_ms)
    }

    /// How well the model orders settings by cost: mean τ over the script's frames, of settings of
    /// which few are above one another in everything, so that the order is no foregone conclusion.
    pub(crate) fn ranking(&self) -> f64 {
        let device = Device::new(self.spec.clone(), 0).expect("a valid device");
        let model = model(self.device);
        let mut grid = Vec::new();
        for render_scale in [0.5, 0.6, 0.7, 0.8, 0.9, 1.0] {
            for ao_rays in [0, 1, 2, 4, 8, 16, 24, 32, 48, 64] {
                for shadows in [false, true] {
                    let rung = RenderSettings { shadows, ao_rays, ..RenderSettings::PRIMARY };
                    grid.push(RenderSettings { render_scale, ..rung });
                }
            }
        }
        let taus: Vec<f64> = (0..self.script.frames())
            .step_by(5)
            .filter_map(|frame| {
                let view = self.script.view(frame);
                let (predicted, real): (Vec<f64>, Vec<f64>) = grid
                    .iter()
                    .map(|rung| (model(rung, &view.counters), device.ideal_ms(&view, rung)))
                    .unzip();
                kendall_tau_b(&predicted, &real)
            })
            .collect();
        taus.iter().sum::<f64>() / taus.len() as f64
    }
}

/// A controller in one row of the comparison.
pub(crate) struct Row {
    pub(crate) controller: &'static str,
    /// The whole path.
    pub(crate) all: Summary,
    /// After the first ten frames.
    pub(crate) settled: Summary,
    /// Frames off by more than 10 % after the turn.
    pub(crate) off_after_turn: usize,
    /// Largest error from the target after the turn, as a share of the target.
    pub(crate) worst_after_turn: f64,
    /// Share of the frames on target where the view is cut every ten frames, but for the first ten.
    pub(crate) on_target_cuts: f64,
}

/// All controllers on one device and one scene: the thesis's path, a turn and cuts in that scene.
pub(crate) fn compare(path: &Case, turn: &Case, cuts: &Case) -> Vec<Row> {
    path.controllers()
        .into_iter()
        .zip(turn.controllers())
        .zip(cuts.controllers())
        .map(|(((controller, mut on_path), (_, mut on_turn)), (_, mut on_cuts))| {
            let sum = |records: &[FrameRecord]| Summary::of(records).expect("frames");
            let records = path.frames(&mut *on_path);
            let turned = &turn.frames(&mut *on_turn)[TURN.1..];
            let cut = cuts.frames(&mut *on_cuts);
            Row {
                controller,
                all: sum(&records),
                settled: sum(&records[SETTLING..]),
                off_after_turn: frames_off(turned, 0.1),
                worst_after_turn: sum(turned).worst,
                on_target_cuts: sum(&cut[SETTLING..]).on_target,
            }
        })
        .collect()
}

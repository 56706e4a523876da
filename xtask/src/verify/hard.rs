//! Hard cases: every builder × kernel against brute force, and that against the exact answer.

use super::{
    Options,
    ledger::{Culprit, Ledger, Row},
    trees::build_and_check,
};
use crate::judge::{Reference, any, closest, each_kernel};
use niwaki_checks::exact_answers;
use niwaki_core::{Builder, Hit, Ray};
use niwaki_hard_cases::{Case, bad_rays, rays};
use niwaki_trace::{BruteForce, Mode};

/// Triangle tests a case may spend on exact answers.
const EXACT_TESTS: usize = 20_000_000;

/// Runs the catalogue.
pub(crate) fn run(
    options: &Options,
    builders: &[Box<dyn Builder>],
    ledger: &mut Ledger,
    mut progress: impl FnMut(&str),
) -> anyhow::Result<()> {
    for case in niwaki_hard_cases::meshes() {
        progress(case.name);
        run_case(&case, options, builders, ledger)?;
    }
    Ok(())
}

fn run_case(
    case: &Case,
    options: &Options,
    builders: &[Box<dyn Builder>],
    ledger: &mut Ledger,
) -> anyhow::Result<()> {
    let mesh = &case.mesh;
    let affordable = options.hard_tests / mesh.len().max(1) / 11;
    let rays = rays(mesh, options.hard_rays.min(affordable).max(8), options.seed);
    let affordable = (EXACT_TESTS / mesh.len().max(1)).max(8);
    let truth = exact_answers(mesh, &rays[..rays.len().min(affordable)]);
    let references = Mode::ALL.map(|mode| {
        let brute = BruteForce::new(mode, mesh);
        against_exact(case, &brute, &truth, ledger);
        let hits = Reference::new(mesh, &rays, closest(&brute, &rays));
        (mode, hits, Reference::new(mesh, &rays, any(&brute, &rays)))
    });
    let bad = bad_rays(mesh);
    for builder in builders {
        let Some(bvh) =
            build_and_check(case.name, mesh, builder.as_ref(), options.threads, ledger)?
        else {
            continue;
        };
        each_kernel(&bvh, mesh, |kernel, mode, scene| {
            let mut add = |query, (tally, wrong): (_, Vec<String>)| {
                ledger.rows.push(Row {
                    scene: case.name.to_owned(),
                    triangles: mesh.len(),
                    builder: builder.name().to_owned(),
                    kernel: kernel.to_owned(),
                    against: "brute_force".to_owned(),
                    query,
                    tally,
                });
                ledger.culprits.extend(wrong.into_iter().map(|what| Culprit {
                    scene: case.name.to_owned(),
                    builder: builder.name().to_owned(),
                    check: kernel.to_owned(),
                    what,
                }));
            };
            for (_, hits, flags) in references.iter().filter(|reference| reference.0 == mode) {
                add("closest", hits.compare(&closest(scene, &rays)));
                add("any", flags.compare(&any(scene, &rays)));
            }
            for (i, ray) in bad.iter().enumerate() {
                if scene.closest_hit(ray).is_hit() || scene.any_hit(ray) {
                    ledger.culprits.push(Culprit {
                        scene: case.name.to_owned(),
                        builder: builder.name().to_owned(),
                        check: kernel.to_owned(),
                        what: format!("illegal ray {i} hits: {ray:?}"),
                    });
                }
            }
        })?;
    }
    Ok(())
}

/// Brute force against the exact answer: the kernels of a mode share one triangle test, so a fault
/// of that test would not show between them.
fn against_exact(
    case: &Case,
    brute: &BruteForce<'_>,
    (rays, hits): &(Vec<Ray>, Vec<Hit>),
    ledger: &mut Ledger,
) {
    let mesh = &case.mesh;
    let occluded = hits.iter().map(Hit::is_hit).collect();
    let (tally, wrong) = Reference::new(mesh, rays, hits.clone()).compare(&closest(brute, rays));
    let (any_tally, any_wrong) = Reference::new(mesh, rays, occluded).compare(&any(brute, rays));
    for (query, tally) in [("closest", tally), ("any", any_tally)] {
        ledger.rows.push(Row {
            scene: case.name.to_owned(),
            triangles: mesh.len(),
            builder: "none".to_owned(),
            kernel: format!("brute_force_{}", brute.mode()),
            against: "exact".to_owned(),
            query,
            tally,
        });
    }
    ledger.culprits.extend(wrong.into_iter().chain(any_wrong).map(|what| Culprit {
        scene: case.name.to_owned(),
        builder: "none".to_owned(),
        check: format!("{} triangle test against the exact answer", brute.mode()),
        what,
    }));
}

//! Hard cases: every builder × kernel against brute force, and leaks against the exact answer.

use super::{
    Options,
    compare::{Reference, any, closest},
    full::Failed,
    kernels::{BruteForce, Named, each_kernel},
    ledger::{Absent, Culprit, LeakRow, Ledger, Row},
    trees::build_and_check,
};
use niwaki_core::{Builder, Hit, Intersector, Ray, TriangleMesh, float::round_down};
use niwaki_exact::closest_in_mesh;
use niwaki_hard_cases::{Case, bad_rays, closed_star, rays};
use niwaki_trace::{Mode, WideScene};

/// Triangle tests a case may spend on brute force.
const BRUTE_FORCE_TESTS: usize = 40_000_000;

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
    let affordable = BRUTE_FORCE_TESTS / mesh.len().max(1) / 11;
    let rays = rays(mesh, options.hard_rays.min(affordable).max(8), options.seed);
    let truth = Truth::of(mesh, &rays);
    let references = Mode::ALL.map(|mode| {
        let brute = BruteForce(mode, mesh);
        against_exact(case, &brute, &truth, ledger);
        let hits = Reference::new(mesh, &rays, closest(&brute, &rays));
        (mode, hits, Reference::new(mesh, &rays, any(&brute, &rays)))
    });
    let bad = bad_rays(mesh);
    for builder in builders {
        let Some(bvh) = build_and_check(case.name, mesh, builder.as_ref(), ledger)? else {
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

/// Exact answers to some rays.
struct Truth {
    rays: Vec<Ray>,
    hits: Vec<Hit>,
}

impl Truth {
    /// Of as many of the rays as can be afforded.
    fn of(mesh: &TriangleMesh, rays: &[Ray]) -> Self {
        let affordable = EXACT_TESTS / mesh.len().max(1);
        // A distance past the normal range of f32 has no f32 to full precision, so no kernel that
        // returns one can be held to it.
        let normal =
            |t: f64| t == 0.0 || (f64::from(f32::MIN_POSITIVE)..=f64::from(f32::MAX)).contains(&t);
        let mut truth = Self { rays: Vec::new(), hits: Vec::new() };
        for ray in rays.iter().take(affordable.max(8)) {
            match closest_in_mesh(ray, mesh) {
                None => truth.hits.push(Hit::MISS),
                Some(closest) if normal(closest.t) => truth.hits.push(Hit {
                    t: round_down(closest.t),
                    u: 0.0,
                    v: 0.0,
                    prim_id: closest.ties.first().map_or(Hit::NO_PRIM, |tie| tie.0),
                }),
                Some(_) => continue,
            }
            truth.rays.push(*ray);
        }
        truth
    }
}

/// Brute force against the exact answer: the kernels of a mode share one triangle test, so a fault
/// of that test would not show between them.
fn against_exact(case: &Case, brute: &BruteForce<'_>, truth: &Truth, ledger: &mut Ledger) {
    let mesh = &case.mesh;
    let Truth { rays, hits } = truth;
    let occluded = hits.iter().map(Hit::is_hit).collect();
    let (tally, wrong) = Reference::new(mesh, rays, hits.clone()).compare(&closest(brute, rays));
    let (any_tally, any_wrong) = Reference::new(mesh, rays, occluded).compare(&any(brute, rays));
    for (query, tally) in [("closest", tally), ("any", any_tally)] {
        ledger.rows.push(Row {
            scene: case.name.to_owned(),
            triangles: mesh.len(),
            builder: "none".to_owned(),
            kernel: format!("brute_force_{}", brute.0),
            against: "exact".to_owned(),
            query,
            tally,
        });
    }
    ledger.culprits.extend(wrong.into_iter().chain(any_wrong).map(|what| Culprit {
        scene: case.name.to_owned(),
        builder: "none".to_owned(),
        check: format!("{} triangle test against the exact answer", brute.0),
        what,
    }));
}

/// Counts leaks of our fastest kernels and of `peers` on closed surfaces of several sizes and
/// places. Those of fast kernels are counted, not judged, ours and the peers'; a watertight one
/// must have none.
pub(crate) fn leaks(
    options: &Options,
    builder: &dyn Builder,
    peers: &dyn Fn(&TriangleMesh) -> (Named, Failed),
    ledger: &mut Ledger,
) -> anyhow::Result<()> {
    for (name, size, offset) in [
        ("size 1", 1.0, [0.0; 3]),
        ("size 1 at (1e3, 7e2, -1.3e3)", 1.0, [1e3, 7e2, -1.3e3]),
        ("size 1e4 at (1e7, 7e6, -1.3e7)", 1e4, [1e7, 7e6, -1.3e7]),
        ("size 1e-6", 1e-6, [0.0; 3]),
        ("size 1e6", 1e6, [0.0; 3]),
        ("size 1e-30", 1e-30, [0.0; 3]),
        ("size 1e30", 1e30, [0.0; 3]),
    ] {
        let mesh = closed_star(6, size, offset.into(), options.seed);
        let rays = from_inside(&mesh, size, offset.into(), options.leak_rays);
        let mut add = |kernel: &str, scene: &dyn Intersector| {
            let leaks = closest(scene, &rays).iter().filter(|hit| !hit.is_hit()).count();
            let scene = name.to_owned();
            ledger.leaks.push(LeakRow {
                scene,
                kernel: kernel.to_owned(),
                rays: rays.len(),
                leaks,
            });
            leaks
        };
        let bvh = builder.build_mesh(&mesh)?;
        add("niwaki fast", &WideScene::new_in(Mode::Fast, &bvh, &mesh)?);
        let watertight = WideScene::new_in(Mode::Watertight, &bvh, &mesh)?;
        let leaks = add("niwaki watertight", &watertight);
        let (kernels, absent) = peers(&mesh);
        for (name, scene) in kernels {
            add(&name, scene.as_ref());
        }
        let absent = absent.iter().map(|(peer, error)| Absent::new(name, peer, error));
        ledger.absent.extend(absent);
        if leaks > 0 {
            ledger.culprits.push(Culprit {
                scene: name.to_owned(),
                builder: builder.name().to_owned(),
                check: "watertight".to_owned(),
                what: format!("{leaks} of {} rays left a closed surface", rays.len()),
            });
        }
    }
    Ok(())
}

/// Rays from points well inside the star, aimed exactly at corners and at points on edges.
fn from_inside(
    mesh: &TriangleMesh,
    size: f32,
    offset: niwaki_core::glam::Vec3,
    count: usize,
) -> Vec<Ray> {
    let inner = 0.5 * size;
    niwaki_hard_cases::aimed_at_borders(mesh, 2 * count, 11)
        .into_iter()
        .enumerate()
        .filter(|(i, _)| i % 3 != 2)
        .take(count)
        .map(|(_, ray)| {
            // Keep the target, pull the origin into the sphere that the surface encloses.
            let target = ray.origin + ray.direction;
            let from_center = (ray.origin - offset).clamp_length_max(inner);
            let origin = offset + from_center;
            Ray::new(origin, target - origin)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_from_inside_start_inside() {
        let mesh = closed_star(2, 2.0, [5.0, 0.0, 0.0].into(), 1);
        let rays = from_inside(&mesh, 2.0, [5.0, 0.0, 0.0].into(), 500);
        assert_eq!(rays.len(), 500);
        assert!(
            rays.iter().all(|r| (r.origin - niwaki_core::glam::Vec3::X * 5.0).length() <= 1.001)
        );
        let hits = closest(&BruteForce(Mode::Fast, &mesh), &rays);
        let lost = hits.iter().filter(|h| !h.is_hit()).count();
        assert!(lost < 100, "most rays must hit, {lost} of 500 did not");
    }
}

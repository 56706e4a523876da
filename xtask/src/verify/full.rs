//! Full scenes: every builder × kernel against Embree and obvhs.

use super::{
    Options,
    ledger::{Absent, Culprit, Ledger, Row},
    trees::{build_and_check, check_peer},
};
use crate::judge::{Reference, Tally, any, closest, each_kernel};
use niwaki_core::{Builder, Hit, Intersector, Ray};
use niwaki_peers::{
    Embree, EmbreeScene, ObvhsKernel, ObvhsPreset, ObvhsScene, PeerBuild, PeerError, Quality,
};
use niwaki_render::{RayKind, RecordSettings, random_rays, record_rays};
use niwaki_scene::Scene;

/// The rays of a scene, by what is asked.
struct Rays {
    closest: Vec<Ray>,
    any: Vec<Ray>,
}

/// Records rays as a path tracer casts them and adds random ones: `options.rays` in all, of which
/// a quarter are asked for any hit. The mix is camera and bounce rays in what the scene gives,
/// filled up with random rays.
fn rays(scene: &Scene, tracer: &dyn Intersector, options: &Options) -> Rays {
    let total = options.rays;
    let settings =
        RecordSettings { max_rays: total / 4, seed: options.seed, ..RecordSettings::default() };
    let sets = record_rays(scene, tracer, &settings);
    let mut rays = Rays { closest: Vec::new(), any: Vec::new() };
    for (_, kind, set) in sets.sets {
        let (into, room) = match kind {
            RayKind::ClosestHit => (&mut rays.closest, total * 5 / 8),
            RayKind::AnyHit => (&mut rays.any, total / 8),
        };
        let room = room.saturating_sub(into.len());
        into.extend(set.into_iter().take(room));
    }
    let bounds = scene.mesh.bounds();
    let missing = |wanted: usize, len: usize| wanted.saturating_sub(len);
    let (closest, any) =
        (missing(total * 3 / 4, rays.closest.len()), missing(total / 4, rays.any.len()));
    rays.closest.extend(random_rays(&bounds, closest, options.seed ^ 1));
    rays.any.extend(random_rays(&bounds, any, options.seed ^ 2));
    rays
}

/// One peer's answers.
struct PeerAnswers<'a> {
    name: String,
    hits: Reference<'a, Hit>,
    flags: Reference<'a, bool>,
}

/// Checks every builder and kernel on a scene against every peer.
pub(crate) fn run(
    name: &str,
    scene: &Scene,
    options: &Options,
    builders: &[Box<dyn Builder>],
    embree: Option<&Embree>,
    ledger: &mut Ledger,
    mut progress: impl FnMut(&str),
) -> anyhow::Result<()> {
    let mesh = &scene.mesh;
    let recorder = niwaki_trace::AutoScene::new(&builders[0].build_mesh(mesh)?, mesh)?;
    progress("recording rays");
    let rays = rays(scene, &recorder, options);
    drop(recorder);

    let mut peers = Vec::new();
    // A peer that cannot build a scene is left out and named; it says nothing about us.
    let mut add_peer = |kernel: &str, peer: Result<Box<dyn Intersector>, PeerError>| match peer {
        Ok(peer) => peers.push(PeerAnswers {
            name: kernel.to_owned(),
            hits: Reference::new(mesh, &rays.closest, closest(peer.as_ref(), &rays.closest)),
            flags: Reference::new(mesh, &rays.any, any(peer.as_ref(), &rays.any)),
        }),
        Err(error) => ledger.absent.push(Absent::new(name, kernel, &error)),
    };
    progress("peers' own kernels");
    if let Some(embree) = embree {
        for (kernel, robust) in [("embree", false), ("embree_robust", true)] {
            let scene = EmbreeScene::new(embree, mesh, Quality::Medium, robust);
            add_peer(kernel, scene.map(|s| Box::new(s) as Box<dyn Intersector>));
        }
    }
    let scene = ObvhsScene::new(mesh, ObvhsPreset::Medium, ObvhsKernel::CwBvh);
    add_peer("obvhs", scene.map(|s| Box::new(s) as Box<dyn Intersector>));

    let mut check = |source, builder: &str, tree: Result<PeerBuild, PeerError>| match tree {
        Ok(tree) => check_peer(name, mesh, source, builder, &tree.bvh, ledger),
        Err(error) => ledger.absent.push(Absent::new(name, builder, &error)),
    };
    for quality in embree.map_or(&[][..], |_| &Quality::ALL) {
        progress(&format!("embree {}", quality.name()));
        if let Some(embree) = embree {
            check("embree", quality.name(), embree.build_bvh(*quality, mesh));
        }
    }
    for preset in options.obvhs_presets() {
        progress(&format!("obvhs {}", preset.name()));
        check("obvhs", preset.name(), preset.build(mesh));
    }

    for builder in builders {
        progress(builder.name());
        let Some(bvh) = build_and_check(name, mesh, builder.as_ref(), options.threads, ledger)?
        else {
            continue;
        };
        each_kernel(&bvh, mesh, |kernel, _, scene| {
            progress(&format!("{} {kernel}", builder.name()));
            let hits = closest(scene, &rays.closest);
            let flags = any(scene, &rays.any);
            for peer in &peers {
                let row = |query, tally: Tally| Row {
                    scene: name.to_owned(),
                    triangles: mesh.len(),
                    builder: builder.name().to_owned(),
                    kernel: kernel.to_owned(),
                    against: peer.name.clone(),
                    query,
                    tally,
                };
                let (tally, wrong) = peer.hits.compare(&hits);
                ledger.rows.push(row("closest", tally));
                let (tally, more) = peer.flags.compare(&flags);
                ledger.rows.push(row("any", tally));
                ledger.culprits.extend(wrong.into_iter().chain(more).map(|what| Culprit {
                    scene: name.to_owned(),
                    builder: builder.name().to_owned(),
                    check: format!("{kernel} against {}", peer.name),
                    what,
                }));
            }
        })?;
    }
    Ok(())
}

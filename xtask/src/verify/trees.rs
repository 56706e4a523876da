//! Checks of trees: structure, determinism, and the metrics that we compute for peers.

use super::ledger::{Culprit, Ledger, TreeRow};
use anyhow::Context;
use niwaki_checks::{same_bytes, same_wide};
use niwaki_core::{Builder, Bvh, SahConstants, TriangleMesh};
use niwaki_metrics::{ValidateOptions, sah, validate_with};
use niwaki_wide::{Bvh8, CollapseSettings};
use rayon::ThreadPoolBuilder;

/// Builds with one of ours on each number of threads, checks and records the tree. `None`, with a
/// culprit in the ledger, if there is no tree to go on with.
pub(crate) fn build_and_check(
    scene: &str,
    mesh: &TriangleMesh,
    builder: &dyn Builder,
    threads: &[usize],
    ledger: &mut Ledger,
) -> anyhow::Result<Option<Bvh>> {
    let mut first: Option<(Bvh, Bvh8)> = None;
    let mut deterministic = true;
    for &count in threads {
        let pool = ThreadPoolBuilder::new()
            .num_threads(count)
            .build()
            .with_context(|| format!("cannot start {count} threads"))?;
        let built = pool.install(|| -> anyhow::Result<_> {
            let bvh = builder.build_mesh(mesh)?;
            let wide = Bvh8::collapse(&bvh, &CollapseSettings::default())?;
            Ok((bvh, wide))
        });
        match built {
            Ok((bvh, wide)) => match &first {
                None => first = Some((bvh, wide)),
                Some(expected) => {
                    deterministic &= same_bytes(&bvh, &expected.0) && same_wide(&wide, &expected.1);
                }
            },
            Err(error) => {
                ledger.culprits.push(culprit(scene, builder.name(), "build", error.to_string()));
                return Ok(None);
            }
        }
    }
    if !deterministic {
        let what = format!("trees differ between {threads:?} threads");
        ledger.culprits.push(culprit(scene, builder.name(), "determinism", what));
    }
    let Some((bvh, _)) = first else { return Ok(None) };
    let exact = ValidateOptions::default();
    record(scene, mesh, "niwaki", builder.name(), &bvh, Some(deterministic), &exact, ledger);
    Ok(Some(bvh))
}

/// Validates and records a tree of a peer.
pub(crate) fn check_peer(
    scene: &str,
    mesh: &TriangleMesh,
    source: &'static str,
    name: &str,
    bvh: &Bvh,
    ledger: &mut Ledger,
) {
    // Peers clip in f32 without rounding outward, which is theirs to decide.
    let rounded = ValidateOptions::rounded_clipping();
    record(scene, mesh, source, name, bvh, None, &rounded, ledger);
}

#[expect(clippy::too_many_arguments, reason = "a row has that many columns")]
fn record(
    scene: &str,
    mesh: &TriangleMesh,
    source: &'static str,
    builder: &str,
    bvh: &Bvh,
    deterministic: Option<bool>,
    options: &ValidateOptions,
    ledger: &mut Ledger,
) {
    let violations = validate_with(bvh, mesh, options).err().unwrap_or_default();
    if source == "niwaki"
        && let Some(first) = violations.first()
    {
        let what = format!("{first} ({} violations)", violations.len());
        ledger.culprits.push(culprit(scene, builder, "validate", what));
    }
    ledger.trees.push(TreeRow {
        scene: scene.to_owned(),
        triangles: mesh.len(),
        source,
        builder: builder.to_owned(),
        nodes: bvh.nodes.len(),
        references: bvh.prim_ids.len(),
        sah: sah(bvh, &SahConstants::THESIS_IV),
        valid: violations.is_empty(),
        deterministic,
    });
}

fn culprit(scene: &str, builder: &str, check: &str, what: String) -> Culprit {
    Culprit { scene: scene.to_owned(), builder: builder.to_owned(), check: check.to_owned(), what }
}

//! Every builder with its knobs swept.

use crate::registry::TreeBuilder;
use anyhow::{Result, bail};
use niwaki_build_aac::Aac;
use niwaki_build_binned::Binned;
use niwaki_build_bonsai::{Bonsai, Pruning};
use niwaki_build_lbvh::{Hlbvh, Lbvh};
use niwaki_build_median::{ObjectMedian, SpatialMedian};
use niwaki_build_ploc::Ploc;
use niwaki_build_sbvh::Sbvh;
use niwaki_build_sweep::Sweep;
use niwaki_core::{BuildError, Builder, Bvh, PrimRef, TriangleMesh};
use niwaki_optimize::{
    Annealing, Budget, Chain, CollapseLeaves, Insertion, Optimized, Reinsertion, Rotations,
    Treelets,
};
use niwaki_peers::{ObvhsPreset, Quality};
use niwaki_presets::Preset;
use niwaki_split::{EarlySplit, EdgeVolume, KarrasAila, PreSplit, SplitPartition};

/// A builder with one setting of its knobs.
pub(crate) struct Variant {
    /// Builders with the same knobs; a line in plots.
    pub(crate) family: &'static str,
    pub(crate) builder: TreeBuilder,
}

/// A builder under another name.
struct Named {
    name: String,
    builder: Box<dyn Builder + Send>,
}

impl Builder for Named {
    fn name(&self) -> &str {
        &self.name
    }

    fn build(&self, prims: &[PrimRef]) -> Result<Bvh, BuildError> {
        self.builder.build(prims)
    }

    fn build_mesh(&self, mesh: &TriangleMesh) -> Result<Bvh, BuildError> {
        self.builder.build_mesh(mesh)
    }

    fn memory_bound(&self, count: usize) -> usize {
        self.builder.memory_bound(count)
    }
}

/// A builder followed by rounds of reinsertion, and leaves where they cost least.
fn reinserted(builder: impl Builder + Send + 'static, iterations: u32) -> Box<dyn Builder + Send> {
    let pass = Reinsertion { budget: Budget::iterations(iterations), ..Reinsertion::default() };
    let passes = Chain::new(vec![Box::new(pass), Box::<CollapseLeaves>::default()]);
    Box::new(Optimized::new(builder, passes))
}

/// Bonsai with one primitive a leaf.
fn single(bonsai: Bonsai) -> Bonsai {
    Bonsai { max_leaf_size: 1, ..bonsai }
}

/// All values of a sweep; with `quick` its ends.
fn some<T: Copy>(values: &[T], quick: bool) -> Vec<T> {
    match values {
        [first, .., last] if quick => vec![*first, *last],
        _ => values.to_vec(),
    }
}

/// Takes the family, the name and the builder of each variant.
type Add<'a> = &'a mut dyn FnMut(&'static str, String, Box<dyn Builder + Send>);

/// All variants in the order of tables; with `quick` only the ends of long sweeps.
fn all(quick: bool) -> Vec<Variant> {
    let mut list = Vec::new();
    let mut add = |family, name: String, builder: Box<dyn Builder + Send>| {
        let builder = TreeBuilder::Ours(Box::new(Named { name, builder }));
        list.push(Variant { family, builder });
    };
    unsplit(quick, &mut add);
    split(quick, &mut add);
    optimized(quick, &mut add);
    for preset in Preset::ALL {
        add("preset", preset.name().to_owned(), Box::new(preset));
    }
    for quality in [Quality::Medium, Quality::High] {
        list.push(Variant { family: "embree", builder: TreeBuilder::Embree(quality) });
    }
    let obvhs: &[_] = if quick {
        &[ObvhsPreset::Medium]
    } else {
        &[ObvhsPreset::Fastest, ObvhsPreset::Medium, ObvhsPreset::VerySlow]
    };
    for &preset in obvhs {
        list.push(Variant { family: "obvhs", builder: TreeBuilder::Obvhs(preset) });
    }
    list
}

/// Builders that refer to each triangle once.
fn unsplit(quick: bool, add: Add<'_>) {
    add("median", "median_object".into(), Box::<ObjectMedian>::default());
    add("median", "median_spatial".into(), Box::<SpatialMedian>::default());
    for code_bits in [30, 63] {
        let lbvh = Lbvh { code_bits, ..Lbvh::default() };
        add("lbvh", format!("lbvh bits={code_bits}"), Box::new(lbvh));
    }
    for treelet_bits in some(&[9, 12, 15, 18, 21], quick) {
        let hlbvh = Hlbvh { treelet_bits, ..Hlbvh::default() };
        add("hlbvh", format!("hlbvh bits={treelet_bits}"), Box::new(hlbvh));
    }
    for radius in some(&[2, 4, 8, 14, 25, 50], quick) {
        let ploc = Ploc { radius, ..Ploc::default() };
        add("ploc", format!("ploc radius={radius}"), Box::new(ploc));
    }
    // From the paper's LQ to its HQ, and past it.
    for (delta, epsilon) in some(&[(4, 0.2), (8, 0.2), (20, 0.2), (20, 0.1), (40, 0.1)], quick) {
        let aac = Aac { delta, epsilon, ..Aac::hq() };
        add("aac", format!("aac δ={delta} ε={epsilon}"), Box::new(aac));
    }
    for bins in some(&[4, 8, 16, 32, 64], quick) {
        let binned = Binned { bins, ..Binned::default() };
        add("binned", format!("binned bins={bins}"), Box::new(binned));
    }
    add("sweep", "sweep".into(), Box::<Sweep>::default());
    for mini_tree_size in some(&[64, 128, 256, 512, 1024, 4096, 16384], quick) {
        let bonsai = Bonsai { mini_tree_size, ..Bonsai::bonsai() };
        add("bonsai", format!("bonsai N={mini_tree_size}"), Box::new(bonsai));
    }
    for fraction in some(&[1.0, 0.3, 0.1, 0.03, 0.01], quick) {
        let bonsai = Bonsai { pruning: Pruning::Mean(fraction), ..Bonsai::bonsai_p() };
        add("pruning", format!("bonsai_p T={fraction}"), Box::new(bonsai));
    }
    add("pruning", "bonsai_p_star".into(), Box::new(Bonsai::bonsai_p_star()));
}

/// Builders that split triangles.
fn split(quick: bool, add: Add<'_>) {
    let split = Bonsai::bonsai_s();
    let default = split.split.unwrap_or_default();
    // 0 is the paper's rule.
    for reference_cost in some(&[0.0, 1.0, 1.25, 1.5, 2.0, 4.0], quick) {
        let partition = SplitPartition { reference_cost, ..default };
        let builder = Bonsai { split: Some(partition), ..split };
        add("bonsai_s", format!("bonsai_s cost={reference_cost}"), Box::new(builder));
    }
    for max_extra in some(&[0.05, 0.1, 0.2, 0.5, 1.0], quick) {
        let partition = SplitPartition { max_extra, ..default };
        let builder = Bonsai { split: Some(partition), ..split };
        add("bonsai_s budget", format!("bonsai_s extra={max_extra}"), Box::new(builder));
    }
    let pre = PreSplit::new(Sweep::default(), SplitPartition::default());
    add("pre-split", "sweep_pre".into(), Box::new(pre));
    for exponent in some(&[8, 10, 12, 14, 16], quick) {
        let early = EarlySplit { max_area: 0.5_f32.powi(exponent), ..EarlySplit::default() };
        let pre = PreSplit::new(Sweep::default(), early);
        add("early split", format!("sweep_esc area=2^-{exponent}"), Box::new(pre));
    }
    for exponent in some(&[10, 12, 14, 16, 18], quick) {
        let edge = EdgeVolume { max_volume: 0.5_f32.powi(exponent), ..EdgeVolume::default() };
        let pre = PreSplit::new(Sweep::default(), edge);
        add("edge volume", format!("sweep_evh volume=2^-{exponent}"), Box::new(pre));
    }
    for max_extra in some(&[0.1, 0.3, 0.5], quick) {
        let pre = PreSplit::new(Sweep::default(), KarrasAila { max_extra });
        add("karras-aila", format!("sweep_ka extra={max_extra}"), Box::new(pre));
    }
    for alpha in some(&[1e-2, 1e-3, 1e-4, 1e-5, 0.0], quick) {
        let sbvh = Sbvh { alpha, ..Sbvh::default() };
        add("sbvh alpha", format!("sbvh alpha={alpha:e}"), Box::new(sbvh));
    }
    for spatial_bins in some(&[8, 16, 32, 64], quick) {
        let sbvh = Sbvh { spatial_bins, ..Sbvh::default() };
        add("sbvh bins", format!("sbvh bins={spatial_bins}"), Box::new(sbvh));
    }
    for max_references in some(&[1.1, 1.25, 1.5, 2.0, 4.0], quick) {
        let sbvh = Sbvh { max_references, ..Sbvh::default() };
        add("sbvh budget", format!("sbvh references={max_references}"), Box::new(sbvh));
    }
    for count_exponent in some(&[0.6, 0.8, 1.0], quick) {
        let sbvh = Sbvh { count_exponent, ..Sbvh::default() };
        add("sbvh exponent", format!("sbvh exponent={count_exponent}"), Box::new(sbvh));
    }
    add("sbvh", "sbvh_sweep".into(), Box::new(Sbvh::sweep()));
}

/// Trees that are improved after they were built.
fn optimized(quick: bool, add: Add<'_>) {
    for iterations in some(&[1, 2, 4, 8, 16], quick) {
        let name = format!("bonsai_p+reinsert {iterations}");
        add("reinsertion", name, reinserted(Bonsai::bonsai_p(), iterations));
    }
    for iterations in some(&[1, 2, 4, 8, 16], quick) {
        // One primitive a leaf while nodes move, and leaves where they pay at the end.
        let name = format!("bonsai_p/1+reinsert {iterations}");
        add("reinsertion single", name, reinserted(single(Bonsai::bonsai_p()), iterations));
    }
    for iterations in some(&[2, 8], quick) {
        let name = format!("bonsai_s/1+reinsert {iterations}");
        add("reinsertion split", name, reinserted(single(Bonsai::bonsai_s()), iterations));
        for max_extra in some(&[0.02, 0.1], quick) {
            let pre = PreSplit::new(single(Bonsai::bonsai_p()), KarrasAila { max_extra });
            let name = format!("ka {max_extra}+bonsai_p/1+reinsert {iterations}");
            add("reinsertion split", name, reinserted(pre, iterations));
        }
        let sbvh = Sbvh { max_leaf_size: 1, ..Sbvh::default() };
        let name = format!("sbvh/1+reinsert {iterations}");
        add("reinsertion split", name, reinserted(sbvh, iterations));
    }
    for iterations in some(&[1, 2, 3], quick) {
        let pass = Treelets { budget: Budget::iterations(iterations), ..Treelets::default() };
        let name = format!("bonsai_p+treelets {iterations}");
        add("treelets", name, Box::new(Optimized::new(Bonsai::bonsai_p(), pass)));
    }
    for iterations in some(&[1, 3, 10], quick) {
        let pass = Rotations { budget: Budget::iterations(iterations), ..Rotations::default() };
        let name = format!("bonsai_p+rotations {iterations}");
        add("rotations", name, Box::new(Optimized::new(Bonsai::bonsai_p(), pass)));
    }
    for iterations in some(&[10, 50, 100], quick) {
        let pass = Annealing { budget: Budget::iterations(iterations), ..Annealing::default() };
        let name = format!("bonsai_p+annealing {iterations}");
        add("annealing", name, Box::new(Optimized::new(Bonsai::bonsai_p(), pass)));
    }
    for iterations in some(&[10, 25, 50], quick) {
        let pass = Insertion { budget: Budget::iterations(iterations), ..Insertion::default() };
        let name = format!("bonsai_p+insertion {iterations}");
        add("insertion", name, Box::new(Optimized::new(Bonsai::bonsai_p(), pass)));
    }
}

/// The variants of some families; of all without names.
pub(crate) fn select(families: &[String], quick: bool) -> Result<Vec<Variant>> {
    let mut known: Vec<&str> = all(false).iter().map(|variant| variant.family).collect();
    known.dedup();
    for name in families {
        if !known.contains(&name.as_str()) {
            bail!("`{name}` is no family of builders; known are {}", known.join(", "));
        }
    }
    let selected = |variant: &Variant| {
        families.is_empty() || families.iter().any(|name| name == variant.family)
    };
    Ok(all(quick).into_iter().filter(selected).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn names_are_unique_and_families_are_known() {
        for quick in [false, true] {
            let variants = all(quick);
            let names: HashSet<_> = variants.iter().map(|v| v.builder.full_name()).collect();
            assert_eq!(names.len(), variants.len());
        }
        assert_eq!(select(&["preset".into()], false).unwrap().len(), Preset::ALL.len());
        let error = select(&["presets".into()], false).err().unwrap().to_string();
        assert!(error.contains("presets") && error.contains("bonsai_s"), "{error}");
    }
}

//! All builders of ours.

use niwaki_build_aac::Aac;
use niwaki_build_binned::Binned;
use niwaki_build_bonsai::Bonsai;
use niwaki_build_lbvh::{Hlbvh, Lbvh};
use niwaki_build_median::{ObjectMedian, SpatialMedian};
use niwaki_build_ploc::Ploc;
use niwaki_build_sbvh::Sbvh;
use niwaki_build_sweep::Sweep;
use niwaki_core::Builder;
use niwaki_presets::Preset;
use niwaki_split::{EarlySplit, EdgeVolume, KarrasAila, PreSplit, SplitPartition};

/// Our builders, in the order of tables. The first is what others are compared with.
#[must_use]
pub fn builders() -> Vec<Box<dyn Builder>> {
    vec![
        Box::new(Sweep::default()),
        Box::new(Binned::default()),
        Box::new(Lbvh::default()),
        Box::new(Hlbvh::default()),
        Box::new(Ploc::default()),
        Box::new(Aac::lq()),
        Box::new(Aac::hq()),
        Box::new(ObjectMedian::default()),
        Box::new(SpatialMedian::default()),
        Box::new(Bonsai::bonsai()),
        Box::new(Bonsai::bonsai_p()),
        Box::new(Bonsai::bonsai_p_star()),
        Box::new(Bonsai::bonsai_s()),
        Box::new(PreSplit::new(Sweep::default(), SplitPartition::default())),
        Box::new(PreSplit::new(Binned::default(), SplitPartition::default())),
        Box::new(PreSplit::new(Sweep::default(), EarlySplit::default())),
        Box::new(PreSplit::new(Sweep::default(), EdgeVolume::default())),
        Box::new(PreSplit::new(Sweep::default(), KarrasAila::default())),
        Box::new(Sbvh::default()),
        Box::new(Sbvh::sweep()),
        Box::new(Preset::Fastest),
        Box::new(Preset::Fast),
        Box::new(Preset::Balanced),
        Box::new(Preset::High),
        Box::new(Preset::Best),
    ]
}

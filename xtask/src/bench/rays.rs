//! Recording the ray sets that all trees answer.

use niwaki_build_bonsai::Bonsai;
use niwaki_core::{Intersector, Ray};
use niwaki_render::{RayKind, RecordSettings, record_rays};
use niwaki_scene::Scene;

/// A set of rays.
#[derive(Clone, Debug)]
pub(crate) struct RaySet {
    pub(crate) name: String,
    /// Whether anything is hit, instead of what is hit first.
    pub(crate) any_hit: bool,
    pub(crate) rays: Vec<Ray>,
}

/// Builds the tree through which rays are recorded and pictures are made: a good one that takes
/// no longer than what is measured.
pub(crate) fn recorder() -> Bonsai {
    Bonsai::bonsai_p_star()
}

/// Scattering events that are followed.
pub(crate) const DEPTH: u32 = 4;

/// The sets that a list of names selects, each once; `all` means the four main ones.
pub(crate) fn names(asked: &[String]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for name in asked {
        let expanded: &[&str] =
            if name == "all" { &["camera", "shadow", "ao", "bounce"] } else { &[name] };
        for name in expanded {
            if !names.iter().any(|known| known == name) {
                names.push((*name).to_owned());
            }
        }
    }
    names
}

/// Records the named sets, in this order, each of at most `count` rays. Sets without rays (shadow
/// rays in a scene without lights) are left out.
pub(crate) fn record(
    scene: &Scene,
    intersector: &impl Intersector,
    names: &[String],
    count: usize,
    seed: u64,
) -> Vec<RaySet> {
    let settings =
        RecordSettings { max_rays: count, seed, depth: DEPTH, ..RecordSettings::default() };
    let recorded = record_rays(scene, intersector, &settings);
    let mut sets = Vec::new();
    for name in names {
        let (any_hit, rays) = if name == "bounce" {
            let share = count / DEPTH as usize;
            let bounces = recorded.sets.iter().filter(|(name, ..)| name.starts_with("bounce"));
            (false, bounces.flat_map(|(_, _, rays)| thinned(rays, share)).collect())
        } else {
            match recorded.sets.iter().find(|(known, ..)| known == name) {
                Some((_, kind, rays)) => (*kind == RayKind::AnyHit, rays.clone()),
                None => continue,
            }
        };
        let set = RaySet { name: name.clone(), any_hit, rays };
        if !set.rays.is_empty() {
            sets.push(set);
        }
    }
    sets
}

/// At most `most` of the rays, spread evenly, in order.
pub(crate) fn thinned(rays: &[Ray], most: usize) -> impl Iterator<Item = Ray> + '_ {
    let kept = rays.len().min(most);
    (0..kept).map(move |i| rays[i * rays.len() / kept])
}

/// Every so many rays in blocks, so that neighbours stay neighbours: at most about `most`, but at
/// least a block.
pub(crate) fn blocks_of(rays: &[Ray], most: usize) -> Vec<Ray> {
    const BLOCK: usize = 256;
    if rays.len() <= most {
        return rays.to_vec();
    }
    let blocks = rays.len().div_ceil(BLOCK);
    let kept = (most / BLOCK).clamp(1, blocks);
    (0..kept)
        .flat_map(|i| {
            let start = i * blocks / kept * BLOCK;
            &rays[start..rays.len().min(start + BLOCK)]
        })
        .copied()
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_core::glam::Vec3;

    fn numbered(count: u16) -> Vec<Ray> {
        (0..count).map(|i| Ray::new(Vec3::X * f32::from(i), Vec3::Z)).collect()
    }

    #[test]
    fn all_means_the_main_sets_once() {
        let asked = ["camera", "all", "bounce2"].map(String::from);
        assert_eq!(names(&asked), ["camera", "shadow", "ao", "bounce", "bounce2"]);
    }

    #[test]
    fn thinning_spreads_evenly() {
        let rays = numbered(10);
        let xs: Vec<_> = thinned(&rays, 5).map(|r| r.origin.x).collect();
        assert_eq!(xs, [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert_eq!(thinned(&rays, 99).count(), 10);
        assert_eq!(thinned(&[], 5).count(), 0);
    }

    #[test]
    fn blocks_keep_neighbours_together() {
        let rays = numbered(10_000);
        assert_eq!(blocks_of(&rays, 20_000).len(), 10_000);
        let some = blocks_of(&rays, 2_600);
        assert_eq!(some.len(), 2_560);
        assert!(
            some.chunks(256).all(|b| b.windows(2).all(|w| w[0].origin.x + 1.0 == w[1].origin.x))
        );
        assert!(some[2559].origin.x > 8_000.0, "the blocks reach to the end");
        assert_eq!(blocks_of(&rays, 1).len(), 256);
    }
}

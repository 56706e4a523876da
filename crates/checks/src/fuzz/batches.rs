//! Batches of rays against one ray at a time.

use super::{
    bytes::Bytes,
    kernels::{self, World, bits},
    pool,
};
use niwaki_core::{Hit, Ray};
use niwaki_trace::{Batches, Mode};

/// The most rays of a batch: more than kernels keep in flight, and than a thread takes at once.
const MOST: usize = 2100;

/// Every scene's batches have the bits of its single rays, in whatever number and order.
pub(crate) fn check(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    // Mostly short ones, up to the length at which work is divided.
    let len = match bytes.below(8) {
        7 => usize::from(bytes.byte()) * 8 + usize::from(bytes.byte()) % 64,
        _ => bytes.below(70),
    };
    let stride = 1 + bytes.below(7);
    let world = World::of(&mut bytes);
    let len = if world.rays.is_empty() { 0 } else { len.min(MOST) };
    let chosen = |i: usize| i * stride % world.rays.len();
    let rays: Vec<Ray> = (0..len).map(|i| world.rays[chosen(i)]).collect();
    for mode in Mode::ALL {
        world.each_scene(mode, |name, scene| {
            let singles: Vec<Hit> = world.rays.iter().map(|ray| scene.closest_hit(ray)).collect();
            let anys: Vec<bool> = world.rays.iter().map(|ray| scene.any_hit(ray)).collect();
            let mut hits = vec![Hit { t: 1.0, u: 2.0, v: 3.0, prim_id: 4 }; len];
            let mut flags: Vec<bool> = (0..len).map(|i| !anys[chosen(i)]).collect();
            scene.closest_hits(&rays, &mut hits);
            scene.any_hits(&rays, &mut flags);
            let same = |what: &str, hits: &[Hit], flags: &[bool]| {
                for (i, (hit, flag)) in hits.iter().zip(flags).enumerate() {
                    let (single, any) = (&singles[chosen(i)], anys[chosen(i)]);
                    assert_eq!(bits(hit), bits(single), "{name}: {what}, {:?}", rays[i]);
                    assert_eq!(*flag, any, "{name}: any hits {what}, {:?}", rays[i]);
                }
            };
            same("in one batch", &hits, &flags);
            hits.fill(Hit::MISS);
            flags.fill(false);
            pool(3).install(|| {
                scene.par_closest_hits(&rays, &mut hits).expect("lengths are equal");
                scene.par_any_hits(&rays, &mut flags).expect("lengths are equal");
            });
            same("on three threads", &hits, &flags);
            if let Some(fewer) = len.checked_sub(1) {
                assert!(scene.try_closest_hits(&rays, &mut hits[..fewer]).is_err());
                assert!(scene.try_any_hits(&rays, &mut flags[..fewer]).is_err());
            }
        });
    }
}

/// The kernels' worlds with batches of several lengths.
pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let lengths: [&[u8]; 5] = [&[0, 0, 0], &[0, 17, 2], &[0, 64, 0], &[7, 255, 63, 4], &[0, 33, 6]];
    kernels::seeds()
        .into_iter()
        .zip(lengths.iter().cycle())
        .map(|(world, length)| [length, world.as_slice()].concat())
        .collect()
}

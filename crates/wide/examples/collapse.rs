//! Collapses a tree over a row of boxes in every way and prints the shapes of the results.

use niwaki_core::{Aabb, Bvh, BvhNode, glam::Vec3, to_u32};
use niwaki_wide::{CollapseError, CollapseSettings, WideBvh};

fn main() -> Result<(), CollapseError> {
    // A balanced tree over 4096 unit boxes along x.
    let bounds = |first: u32, count: u32| {
        Aabb::new(Vec3::new(first as f32, 0.0, 0.0), Vec3::new((first + count) as f32, 1.0, 1.0))
    };
    let mut nodes = vec![BvhNode::leaf(bounds(0, 4096), 0, 4096)];
    let mut open = 0;
    while open < nodes.len() {
        let BvhNode { first, count, .. } = nodes[open];
        if count > 1 {
            let half = count / 2;
            nodes[open] = BvhNode::inner(bounds(first, count), to_u32(nodes.len()));
            nodes.push(BvhNode::leaf(bounds(first, half), first, half));
            nodes.push(BvhNode::leaf(bounds(first + half, half), first + half, half));
        }
        open += 1;
    }
    let bvh = Bvh { nodes, prim_ids: (0..4096).collect() };
    for settings in [CollapseSettings::greedy(), CollapseSettings::optimal()] {
        print::<4>(&bvh, &settings)?;
        print::<8>(&bvh, &settings)?;
        print::<16>(&bvh, &settings)?;
    }
    Ok(())
}

fn print<const W: usize>(bvh: &Bvh, settings: &CollapseSettings) -> Result<(), CollapseError> {
    let wide = WideBvh::<W>::collapse(bvh, settings)?;
    println!(
        "{:?}, {W} wide: {} binary nodes became {} on {} levels, {:.0} % of slots used, cost {:.1}",
        settings.method,
        bvh.nodes.len(),
        wide.nodes().len(),
        wide.levels(),
        100.0 * wide.fill(),
        wide.cost(&settings.costs)
    );
    Ok(())
}

//! Children by opening the one that gains most.

use crate::{
    CollapseError, WideCosts,
    collapse::{Collapse, Item, Slots},
};

impl<const W: usize> Collapse<'_, W> {
    /// Opens the item with the largest gain, from `root` on, until all slots are used or nothing
    /// gains.
    pub(crate) fn choose_greedily(&self, root: Item) -> Result<Slots<W>, CollapseError> {
        let mut slots = Slots::default();
        let mut gains = [0.0_f32; W];
        slots.push(root);
        gains[0] = f32::INFINITY;
        while slots.used < W {
            let mut best = 0;
            for i in 1..slots.used {
                if gains[i] > gains[best] {
                    best = i;
                }
            }
            if gains[best] <= 0.0 {
                break;
            }
            let [a, b] = self.children(slots.items[best].node as usize)?;
            let (a, b) = (self.item(a)?, self.item(b)?);
            slots.items[best] = a;
            gains[best] = self.gain(&a)?;
            gains[slots.used] = self.gain(&b)?;
            slots.push(b);
        }
        Ok(slots)
    }

    /// What is gained by opening an item where it stands; not positive if it should stay.
    fn gain(&self, item: &Item) -> Result<f32, CollapseError> {
        let node = item.node as usize;
        if self.bvh.nodes[node].is_leaf() {
            return Ok(0.0);
        }
        let area = self.area(node);
        if !item.is_leaf {
            // Opened by area alone; a degenerate box still has to be opened some time.
            return Ok(area.max(f32::MIN_POSITIVE));
        }
        let WideCosts { leaf, reference, .. } = self.settings.costs;
        let cost = |area: f32, refs: u32| area * (leaf + reference * refs as f32);
        let mut gain = cost(area, item.refs);
        for child in self.children(node)? {
            gain -= cost(self.area(child), u32::from(self.counts[child]));
        }
        // Areas beyond f32 give NaN: no gain.
        Ok(gain.max(0.0))
    }
}

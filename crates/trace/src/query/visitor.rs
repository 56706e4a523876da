//! What a traversal does with the hits that it finds.

use crate::{counts::Counter, setup::RaySetup, triangle::no_hit};
use niwaki_core::Hit;

/// A hit as a kernel finds it.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// In the scaled distance of [`RaySetup`].
    pub t: f32,
    /// The barycentric weight of the second vertex, times `det`.
    pub u: f32,
    /// The barycentric weight of the third vertex, times `det`.
    pub v: f32,
    /// What both weights are divided by.
    pub det: f32,
    /// The primitive.
    pub prim_id: u32,
}

impl Found {
    /// The hit in the ray's own distance.
    #[inline]
    fn finish(self, setup: &RaySetup) -> Hit {
        let Self { t, u, v, det, prim_id } = self;
        setup.finish(Hit { t, u: u / det, v: v / det, prim_id })
    }
}

/// Decides about the hits of one ray.
///
/// Kernels are generic over it and pass it by value, so that the state of the plain queries stays
/// in registers and they pay nothing for the others. A primitive that a tree refers to more than
/// once may come more than once, each time with the same bits.
pub trait Visitor: Sized {
    /// What it makes of the hits. Formed inside the kernel: a state that were returned instead would
    /// live in memory from its first change on, and the reader would wait for it.
    type Answer;

    /// Whether it wants to know of every node and leaf. Kernels tell it nothing otherwise.
    const COUNTS: bool = false;

    /// Whether its first limit ends a traversal by distance too.
    const ENDS_AT_LIMIT: bool = false;

    /// Before a node with so many boxes is tested, by its number.
    #[inline(always)]
    fn node(&mut self, _index: u32, _boxes: u32) {}

    /// Before a leaf of so many triangles is tested, by the number of the first.
    #[inline(always)]
    fn leaf(&mut self, _first: u32, _count: u32) {}

    /// The traversal begins anew: what was told of nodes and leaves no longer counts.
    #[inline(always)]
    fn restart(&mut self) {}

    /// Whether a hit is of interest that lies in the ray's range and not past the last limit.
    fn wants(&self, t: f32, prim_id: u32) -> bool;

    /// Takes a hit that it wants. `Some` is a new limit: what lies farther is of no interest any
    /// more; kernels that look for any hit stop there.
    fn take(&mut self, hit: Found) -> Option<f32>;

    /// After the last hit.
    fn answer(self) -> Self::Answer;
}

/// `true` where a hit at `t` is to be preferred: nearer, or as near and of a smaller id.
#[inline(always)]
fn is_better(t: f32, prim_id: u32, than: &Hit) -> bool {
    t < than.t || (t == than.t && prim_id < than.prim_id)
}

/// Keeps the closest hit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Closest {
    best: Hit,
    /// Divides the weights, once, at the end.
    det: f32,
}

impl Closest {
    #[inline(always)]
    pub(crate) const fn new(t_max: f32) -> Self {
        Self { best: no_hit(t_max), det: 1.0 }
    }
}

impl Visitor for Closest {
    /// The hit, still in scaled distance.
    type Answer = Hit;

    #[inline(always)]
    fn wants(&self, t: f32, prim_id: u32) -> bool {
        is_better(t, prim_id, &self.best)
    }

    #[inline(always)]
    fn take(&mut self, Found { t, u, v, det, prim_id }: Found) -> Option<f32> {
        self.best = Hit { t, u, v, prim_id };
        self.det = det;
        Some(t)
    }

    #[inline(always)]
    fn answer(self) -> Hit {
        if !self.best.is_hit() {
            return Hit::MISS;
        }
        Hit { u: self.best.u / self.det, v: self.best.v / self.det, ..self.best }
    }
}

/// Is content with the first hit that it is shown.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct First {
    is_hit: bool,
}

impl Visitor for First {
    type Answer = bool;

    #[inline(always)]
    fn wants(&self, _: f32, _: u32) -> bool {
        true
    }

    #[inline(always)]
    fn take(&mut self, hit: Found) -> Option<f32> {
        self.is_hit = true;
        Some(hit.t)
    }

    #[inline(always)]
    fn answer(self) -> bool {
        self.is_hit
    }
}

/// Another visitor, and the work on the way; `END` to stop at its first limit although nodes are visited
/// by distance.
pub(crate) struct Counted<V, C, const END: bool> {
    visitor: V,
    counter: C,
}

impl<V: Visitor, C: Counter + Default, const END: bool> Counted<V, C, END> {
    #[inline(always)]
    pub(crate) fn new(visitor: V) -> Self {
        Self { visitor, counter: C::default() }
    }
}

impl<V: Visitor, C: Counter + Default, const END: bool> Visitor for Counted<V, C, END> {
    type Answer = (V::Answer, C);

    const COUNTS: bool = true;
    const ENDS_AT_LIMIT: bool = END;

    #[inline(always)]
    fn node(&mut self, index: u32, boxes: u32) {
        self.counter.at(u64::from(index));
        self.counter.node(boxes);
    }

    #[inline(always)]
    fn leaf(&mut self, first: u32, count: u32) {
        self.counter.at_leaf(first);
        self.counter.leaf(count);
    }

    #[inline(always)]
    fn restart(&mut self) {
        self.counter = C::default();
    }

    #[inline(always)]
    fn wants(&self, t: f32, prim_id: u32) -> bool {
        self.visitor.wants(t, prim_id)
    }

    #[inline(always)]
    fn take(&mut self, hit: Found) -> Option<f32> {
        self.visitor.take(hit)
    }

    #[inline(always)]
    fn answer(self) -> Self::Answer {
        (self.visitor.answer(), self.counter)
    }
}

/// Keeps the closest hit that a filter accepts.
pub(crate) struct ClosestAccepted<F> {
    setup: RaySetup,
    filter: F,
    best: Hit,
    /// `best` in the ray's own distance.
    hit: Hit,
}

impl<F> ClosestAccepted<F> {
    pub(crate) const fn new(setup: RaySetup, filter: F) -> Self {
        Self { setup, filter, best: no_hit(setup.t_max), hit: Hit::MISS }
    }
}

impl<F: FnMut(u32, f32, f32, f32) -> bool> Visitor for ClosestAccepted<F> {
    /// The hit in the ray's own distance.
    type Answer = Hit;

    #[inline(always)]
    fn wants(&self, t: f32, prim_id: u32) -> bool {
        is_better(t, prim_id, &self.best)
    }

    #[inline]
    fn take(&mut self, found: Found) -> Option<f32> {
        let hit = found.finish(&self.setup);
        if !(self.filter)(hit.prim_id, hit.t, hit.u, hit.v) {
            return None;
        }
        self.best = Hit { t: found.t, ..hit };
        self.hit = hit;
        Some(found.t)
    }

    #[inline(always)]
    fn answer(self) -> Hit {
        self.hit
    }
}

/// Is content with the first hit that a filter accepts.
pub(crate) struct FirstAccepted<F> {
    setup: RaySetup,
    filter: F,
    is_hit: bool,
}

impl<F> FirstAccepted<F> {
    pub(crate) const fn new(setup: RaySetup, filter: F) -> Self {
        Self { setup, filter, is_hit: false }
    }
}

impl<F: FnMut(u32, f32, f32, f32) -> bool> Visitor for FirstAccepted<F> {
    type Answer = bool;

    #[inline(always)]
    fn wants(&self, _: f32, _: u32) -> bool {
        true
    }

    #[inline]
    fn take(&mut self, found: Found) -> Option<f32> {
        let hit = found.finish(&self.setup);
        self.is_hit = (self.filter)(hit.prim_id, hit.t, hit.u, hit.v);
        self.is_hit.then_some(found.t)
    }

    #[inline(always)]
    fn answer(self) -> bool {
        self.is_hit
    }
}

/// Collects the nearest hits into a list, or all of them.
pub(crate) struct Collect<'a> {
    setup: RaySetup,
    hits: &'a mut Vec<Hit>,
    /// How many are asked for.
    most: usize,
    /// The list is put in order when it is as long as this.
    room: usize,
    /// In scaled distance.
    limit: f32,
}

impl<'a> Collect<'a> {
    /// Empties the list.
    pub(crate) fn new(setup: RaySetup, hits: &'a mut Vec<Hit>, most: usize) -> Self {
        hits.clear();
        // To sort whenever an eighth more has come costs a constant number of comparisons a hit
        // and level of the sort, and lets the limit lag little.
        let room = most.saturating_add(most / 8 + 1);
        Self { setup, hits, most, room, limit: setup.t_max }
    }
}

impl Visitor for Collect<'_> {
    /// The list, in order.
    type Answer = ();

    #[inline(always)]
    fn wants(&self, t: f32, _: u32) -> bool {
        t <= self.limit
    }

    #[inline]
    fn take(&mut self, Found { t, u, v, det, prim_id }: Found) -> Option<f32> {
        self.hits.push(Hit { t, u: u / det, v: v / det, prim_id });
        if self.hits.len() < self.room {
            return None;
        }
        put_in_order(self.hits, self.most);
        if self.hits.len() < self.most {
            return None;
        }
        self.limit = self.hits.last()?.t;
        Some(self.limit)
    }

    fn answer(self) {
        // In their own distance, in which two scaled ones may fall together.
        for hit in &mut *self.hits {
            *hit = self.setup.finish(*hit);
        }
        put_in_order(self.hits, self.most);
    }
}

/// Sorts by distance, then id, drops what came twice, and keeps the first `most`.
fn put_in_order(hits: &mut Vec<Hit>, most: usize) {
    // Not by `total_cmp`: −0.0 is as near as 0.0. No t is NaN.
    hits.sort_by(|a, b| {
        a.t.partial_cmp(&b.t).unwrap_or(std::cmp::Ordering::Equal).then(a.prim_id.cmp(&b.prim_id))
    });
    hits.dedup_by_key(|hit| hit.prim_id);
    hits.truncate(most);
}

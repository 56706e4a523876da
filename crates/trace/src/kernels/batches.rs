//! Batches on one thread: the rays of a batch take turns, a step at a time.
//!
//! A ray alone waits: for the node that it needs next, which is often not in the nearest cache,
//! and for the processor to recover from branches that nobody can predict (how many children are
//! hit, node or leaf, whether anything is left within reach). Here the step through a node has no
//! branch: it sorts all children, pushes those that are hit and pops one, and the ray joins those
//! at nodes or those at leaves by arithmetic on the sign bit of what it popped. So the steps of
//! several rays overlap, and what a step reads was asked for a round earlier.

use niwaki_core::Ray;

use crate::{scale::SceneScale, setup::RaySetup};

/// Rays that take turns. Enough that a round lasts about as long as memory takes to answer; few
/// enough that their state and the nodes that they are at stay in the nearest cache.
pub(crate) const RAYS: usize = 16;

/// Batches of fewer rays are answered one by one: starting costs more than turns gain.
pub(crate) const LEAST: usize = 4;

/// The largest stack, in entries, that each ray of a batch gets. Deeper trees are traced one ray
/// after the other.
pub(crate) const DEEPEST: usize = 1024;

/// The entry below all others of a stack. No leaf has this word: its range would end beyond the
/// most references that a tree can have.
pub(crate) const DONE: u32 = u32::MAX;

/// Places of a list: one more than there are rays, and a power of two.
const ROOM: usize = 2 * RAYS;

/// Which rays are at nodes, and which at leaves or at their end.
///
/// A ray's number is written behind both lists, and the length of one grows: no branch.
pub(crate) struct Queues {
    rays: [[usize; ROOM]; 2],
    len: [usize; 2],
}

impl Queues {
    pub(crate) const fn new() -> Self {
        Self { rays: [[0; ROOM]; 2], len: [0; 2] }
    }

    /// Adds a ray whose next node or leaf is `word`.
    #[inline(always)]
    pub(crate) fn push(&mut self, ray: usize, word: u32) {
        let at_leaf = (word >> 31) as usize;
        // Never more than there are rays.
        self.rays[0][self.len[0] % ROOM] = ray;
        self.rays[1][self.len[1] % ROOM] = ray;
        self.len[0] += 1 - at_leaf;
        self.len[1] += at_leaf;
    }

    /// Empties a list, and says how many rays were on it: they are still there, each until as
    /// many have been pushed as have been looked at.
    #[inline(always)]
    pub(crate) fn begin<const LIST: usize>(&mut self) -> usize {
        std::mem::take(&mut self.len[LIST])
    }

    /// A ray on a list.
    #[inline(always)]
    pub(crate) fn ray<const LIST: usize>(&self, at: usize) -> usize {
        self.rays[LIST][at % ROOM]
    }
}

/// The list of rays at nodes.
pub(crate) const AT_NODES: usize = 0;
/// The list of rays at leaves, or done.
pub(crate) const AT_LEAVES: usize = 1;

/// The rays of a batch that have not started yet.
pub(crate) struct Waiting<'a> {
    rays: std::iter::Enumerate<std::slice::Iter<'a, Ray>>,
    scale: SceneScale,
}

impl<'a> Waiting<'a> {
    pub(crate) fn new(rays: &'a [Ray], scale: SceneScale) -> Self {
        Self { rays: rays.iter().enumerate(), scale }
    }

    /// The next ray that could hit anything, with its index.
    #[inline(always)]
    pub(crate) fn next(&mut self) -> Option<(usize, RaySetup)> {
        self.rays.find_map(|(index, ray)| Some((index, RaySetup::new(ray, self.scale)?)))
    }
}

/// Defines `closest_batch` and `any_batch` in a module in which `define_traversal` was used.
///
/// Needs besides, with the same features: `sorted_where(keys, mask) -> Ints`, the keys of the
/// lanes in a mask, which are negative, sorted upwards as signed integers, and behind them, for the
/// other lanes, the largest integer.
macro_rules! define_batches {
    ($features:literal) => {
        /// A ray on its way.
        struct InFlight<V> {
            ray: Prepared,
            /// Farther is of no interest.
            t_max: f32,
            /// What comes next: a node, a leaf, or [`DONE`].
            word: u32,
            /// Entries on its stack.
            depth: usize,
            /// Its place in the batch.
            index: usize,
            setup: RaySetup,
            visitor: V,
        }

        impl<V> InFlight<V> {
            #[inline(always)]
            fn new(scale: &SceneScale, index: usize, setup: RaySetup, visitor: V) -> Self {
                let ray = Prepared::new(&setup, scale);
                Self { ray, t_max: setup.t_max, word: 0, depth: 1, index, setup, visitor }
            }
        }

        /// The closest hit of each ray.
        ///
        /// # Safety
        /// The processor must have the instructions, and the scene nodes; there must be as many
        /// hits as rays.
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn closest_batch(
            scene: &Layout<W, Node>,
            rays: &[Ray],
            hits: &mut [Hit],
        ) {
            let nodes: *const u8 = scene.nodes.as_ptr().cast();
            let triangles = scene.triangles.as_ptr();
            let prim_ids = scene.prim_ids.as_ptr();
            hits.fill(Hit::MISS);
            // For each ray a stack of children and one of keys. What lies below the first entry of
            // the children ends the ray.
            let room = 1 + scene.stack_bound + W;
            let mut stacks = vec![DONE; 2 * RAYS * room];
            let stacks = stacks.as_mut_ptr();
            let mut waiting = Waiting::new(rays, scene.scale);
            let mut queues = Queues::new();
            let mut flights = Vec::with_capacity(RAYS);
            while flights.len() < RAYS
                && let Some((index, setup)) = waiting.next()
            {
                queues.push(flights.len(), 0);
                let visitor = Closest::new(setup.t_max);
                flights.push(InFlight::new(&scene.scale, index, setup, visitor));
            }
            let flights = flights.as_mut_ptr();
            let lane_ids = lane_ids();
            let distance_bits = splat_int((!LANE).cast_signed());
            loop {
                let count = queues.begin::<AT_NODES>();
                for at in 0..count {
                    let i = queues.ray::<AT_NODES>(at);
                    // SAFETY: queues hold numbers of flights, which have two stacks each.
                    let (flight, children_at, keys_at) = unsafe {
                        let stack = stacks.add(2 * room * i);
                        (&mut *flights.add(i), stack, stack.add(room))
                    };
                    // SAFETY: the words of nodes in a tree are indices of its nodes.
                    let node = unsafe { nodes.add(flight.word as usize * size_of::<Node>()) };
                    let (ray, t_max) = (Lanes::new(&flight.ray), splat(flight.t_max));
                    // SAFETY: as above.
                    let (enter, mask) = unsafe { ray.boxes(node, t_max) };
                    // Complements, so that the farthest sorts first and the nearest is popped.
                    let keys = or_ints(and_not_ints(as_ints(enter), distance_bits), lane_ids);
                    let keys = sorted_where(keys, mask);
                    let depth = flight.depth;
                    // SAFETY: the children's words follow six rows; the stacks have room for all
                    // entries that the depth of the tree allows, and a vector more.
                    let word = unsafe {
                        let children = permute(load_ints(node.add(CHILDREN).cast()), keys);
                        store_ints(children_at.add(depth).cast(), children);
                        store_ints(keys_at.add(depth).cast(), keys);
                        let depth = depth + mask.count_ones() as usize - 1;
                        flight.depth = depth;
                        *children_at.add(depth)
                    };
                    flight.word = word;
                    prefetch(nodes, triangles, word);
                    queues.push(i, word);
                }
                let leaf_count = queues.begin::<AT_LEAVES>();
                if count + leaf_count == 0 {
                    return;
                }
                for at in 0..leaf_count {
                    let i = queues.ray::<AT_LEAVES>(at);
                    // SAFETY: as above.
                    let (flight, children_at, keys_at) = unsafe {
                        let stack = stacks.add(2 * room * i);
                        (&mut *flights.add(i), stack, stack.add(room))
                    };
                    let mut doubt = false;
                    if flight.word != DONE {
                        // SAFETY: the word of a leaf of this scene.
                        let leaf = unsafe {
                            let ray = Lanes::new(&flight.ray);
                            ray.leaf::<false>(triangles, flight.word, splat(flight.t_max))
                        };
                        if leaf.mask != 0 {
                            // SAFETY: the ray's own stacks.
                            unsafe { flight.take(&leaf, prim_ids, children_at, keys_at) };
                        }
                        doubt = leaf.doubt;
                        if !doubt {
                            flight.depth -= 1;
                            // SAFETY: an entry that was stored, or the one that ends the ray.
                            let word = unsafe { *children_at.add(flight.depth) };
                            flight.word = word;
                            prefetch(nodes, triangles, word);
                            queues.push(i, word);
                            continue;
                        }
                    }
                    let hit = if doubt {
                        // SAFETY: the same promise.
                        unsafe { closest_with_care(scene, &flight.setup, flight.visitor) }
                    } else {
                        flight.visitor.answer()
                    };
                    hits[flight.index] = flight.setup.finish(hit);
                    if let Some((index, setup)) = waiting.next() {
                        let visitor = Closest::new(setup.t_max);
                        *flight = InFlight::new(&scene.scale, index, setup, visitor);
                        queues.push(i, 0);
                    }
                }
            }
        }

        impl InFlight<Closest> {
            /// Takes the hits of a leaf, and drops what lies behind the nearest from the stacks.
            ///
            /// # Safety
            /// The stacks must be the ray's own, and the leaf one of the scene whose ids are
            /// given.
            #[target_feature(enable = $features)]
            #[inline]
            unsafe fn take(
                &mut self,
                leaf: &LeafHits,
                prim_ids: *const u32,
                children: *mut u32,
                keys: *mut u32,
            ) {
                let mut mask = leaf.mask;
                let mut limit = None;
                while mask != 0 {
                    let i = mask.trailing_zeros();
                    mask &= mask - 1;
                    let t = lane(leaf.t, i);
                    // SAFETY: a reference of the leaf.
                    let prim_id = unsafe { *prim_ids.add(leaf.first + i as usize) };
                    if self.visitor.wants(t, prim_id) {
                        let (u, v, det) = (lane(leaf.u, i), lane(leaf.v, i), lane(leaf.det, i));
                        limit = self.visitor.take(Found { t, u, v, det, prim_id });
                    }
                }
                let Some(t) = limit else { return };
                self.t_max = t;
                // Without the sign of −0.0, which is as far as 0.0. A key is the complement of a
                // distance's bits, with a lane.
                let least = !(t.abs().to_bits() | LANE);
                let mut kept = 1;
                for at in 1..self.depth {
                    // SAFETY: entries that were stored, and places below them.
                    unsafe {
                        let (child, key) = (*children.add(at), *keys.add(at));
                        *children.add(kept) = child;
                        *keys.add(kept) = key;
                        kept += usize::from(key.cast_signed() >= least.cast_signed());
                    }
                }
                self.depth = kept;
            }
        }

        /// Whether each ray hits anything.
        ///
        /// # Safety
        /// As for [`closest_batch`].
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn any_batch(
            scene: &Layout<W, Node>,
            rays: &[Ray],
            occluded: &mut [bool],
        ) {
            let nodes: *const u8 = scene.nodes.as_ptr().cast();
            let triangles = scene.triangles.as_ptr();
            occluded.fill(false);
            let room = 1 + scene.stack_bound + W;
            let mut stacks = vec![DONE; RAYS * room];
            let stacks = stacks.as_mut_ptr();
            let mut waiting = Waiting::new(rays, scene.scale);
            let mut queues = Queues::new();
            let mut flights = Vec::with_capacity(RAYS);
            while flights.len() < RAYS
                && let Some((index, setup)) = waiting.next()
            {
                queues.push(flights.len(), 0);
                flights.push(InFlight::new(&scene.scale, index, setup, ()));
            }
            let flights = flights.as_mut_ptr();
            loop {
                let count = queues.begin::<AT_NODES>();
                for at in 0..count {
                    let i = queues.ray::<AT_NODES>(at);
                    // SAFETY: queues hold numbers of flights, which have a stack each.
                    let (flight, stack) = unsafe { (&mut *flights.add(i), stacks.add(room * i)) };
                    // SAFETY: the words of nodes in a tree are indices of its nodes.
                    let node = unsafe { nodes.add(flight.word as usize * size_of::<Node>()) };
                    let (ray, t_max) = (Lanes::new(&flight.ray), splat(flight.t_max));
                    // SAFETY: as above.
                    let (_, mask) = unsafe { ray.boxes(node, t_max) };
                    let depth = flight.depth;
                    // SAFETY: the children's words follow six rows; the stack has room for all
                    // entries that the depth of the tree allows, and a vector more.
                    let word = unsafe {
                        let hit = compacted(load_ints(node.add(CHILDREN).cast()), mask);
                        store_ints(stack.add(depth).cast(), hit);
                        let depth = depth + mask.count_ones() as usize - 1;
                        flight.depth = depth;
                        *stack.add(depth)
                    };
                    flight.word = word;
                    prefetch(nodes, triangles, word);
                    queues.push(i, word);
                }
                let leaf_count = queues.begin::<AT_LEAVES>();
                if count + leaf_count == 0 {
                    return;
                }
                for at in 0..leaf_count {
                    let i = queues.ray::<AT_LEAVES>(at);
                    // SAFETY: as above.
                    let (flight, stack) = unsafe { (&mut *flights.add(i), stacks.add(room * i)) };
                    if flight.word != DONE {
                        // SAFETY: the word of a leaf of this scene.
                        let leaf = unsafe {
                            let ray = Lanes::new(&flight.ray);
                            ray.leaf::<false>(triangles, flight.word, splat(flight.t_max))
                        };
                        if leaf.mask != 0 {
                            occluded[flight.index] = true;
                        } else if leaf.doubt {
                            let first = First::default();
                            // SAFETY: the same promise.
                            let hit = unsafe { any_with_care(scene, &flight.setup, first) };
                            occluded[flight.index] = hit;
                        } else {
                            flight.depth -= 1;
                            // SAFETY: an entry that was stored, or the one that ends the ray.
                            let word = unsafe { *stack.add(flight.depth) };
                            flight.word = word;
                            prefetch(nodes, triangles, word);
                            queues.push(i, word);
                            continue;
                        }
                    }
                    if let Some((index, setup)) = waiting.next() {
                        *flight = InFlight::new(&scene.scale, index, setup, ());
                        queues.push(i, 0);
                    }
                }
            }
        }
    };
}

pub(crate) use define_batches;

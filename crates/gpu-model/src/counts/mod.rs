//! Instructions of a kernel, counted in the SPIR-V that runs.
//!
//! Loops are those of the module's structured control flow, callees are charged where they are
//! called, and code that constants switch off is left out, as every driver leaves it out. The paper
//! counts in the maker's assembler (Paper I, section 4.3); SPIR-V is the same on every device, and
//! at hand at run time.
//!
//! # What counts as an instruction
//!
//! Components of a result, as GPUs compute them one by one: a sum of two `vec3f` is three
//! instructions, a dot product of them three (a product and two fused), a cross product six. What
//! only names or moves values (loads and stores of variables, composites, bit casts, address
//! chains, φ) is free. A conditional branch is one. A load or store of a buffer is one for each 16
//! bytes begun, the widest that GPUs have. Divisions and square roots are one for each component,
//! though devices take several.
//!
//! Both arms of a branch count: that is what a warp executes whose threads disagree, and more than
//! what one thread does. Blocks that lead out of a loop (a `break` with what comes before it, a
//! `return`) run once, so they belong to what is around the loop.

mod cost;
mod function;
mod module;

use crate::KernelCounts;
use std::collections::BTreeMap;

/// Loops and callees of a kernel at most.
const MOST_LOOPS: usize = 10_000;

/// Instructions of a stretch of code, each counted once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InstructionMix {
    /// Arithmetic, comparisons, conversions, conditional branches.
    pub compute: u64,
    /// Loads of storage buffers, of up to 16 bytes each.
    pub loads: u64,
    /// Bytes of these.
    pub load_bytes: u64,
    /// Stores to storage buffers, of up to 16 bytes each.
    pub stores: u64,
    /// Bytes of these.
    pub store_bytes: u64,
    /// Atomic operations on storage buffers, and reads and writes of images.
    pub others: u64,
    /// Loads of uniform buffers and push constants, which have a cache of their own.
    pub uniform_loads: u64,
    /// Reads, writes and atomics of workgroup memory.
    pub workgroup: u64,
    /// Reads and writes of arrays of the thread's own by an index that is known at run time only:
    /// a traversal's stack. These go to memory too, but to lines that are nearly always cached.
    pub local: u64,
    /// Barriers.
    pub barriers: u64,
}

impl InstructionMix {
    /// Adds up, and stays at the most that fits.
    fn add(&mut self, other: &Self) {
        let add = |a: &mut u64, b: u64| *a = a.saturating_add(b);
        add(&mut self.compute, other.compute);
        add(&mut self.loads, other.loads);
        add(&mut self.load_bytes, other.load_bytes);
        add(&mut self.stores, other.stores);
        add(&mut self.store_bytes, other.store_bytes);
        add(&mut self.others, other.others);
        add(&mut self.uniform_loads, other.uniform_loads);
        add(&mut self.workgroup, other.workgroup);
        add(&mut self.local, other.local);
        add(&mut self.barriers, other.barriers);
    }

    /// Instructions that wait for memory: loads, stores and others.
    #[must_use]
    pub const fn memory(&self) -> u64 {
        self.loads.saturating_add(self.stores).saturating_add(self.others)
    }

    /// Instructions that do not: the rest.
    #[must_use]
    pub const fn arithmetic(&self) -> u64 {
        self.compute
            .saturating_add(self.uniform_loads)
            .saturating_add(self.workgroup)
            .saturating_add(self.local)
    }
}

/// A place for a resource: descriptor set and binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Place {
    /// The descriptor set.
    pub group: u32,
    /// The binding in it.
    pub binding: u32,
}

/// Loads and stores of a buffer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BufferAccess {
    /// Loads, of up to 16 bytes each.
    pub loads: u64,
    /// Bytes of these.
    pub load_bytes: u64,
    /// Stores and atomics, of up to 16 bytes each.
    pub stores: u64,
}

/// A loop of a kernel, or what is outside of all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LoopCounts {
    /// The loop around it, by its place in [`Counted::loops`]; `None` for what is outside of all.
    pub parent: Option<usize>,
    /// Instructions of one turn, without those of loops inside.
    pub own: InstructionMix,
    /// Buffers that one turn accesses, without loops inside.
    pub buffers: BTreeMap<Place, BufferAccess>,
}

impl LoopCounts {
    fn add(&mut self, other: &Self) {
        self.own.add(&other.own);
        for (&place, access) in &other.buffers {
            let sum = self.buffers.entry(place).or_default();
            sum.loads = sum.loads.saturating_add(access.loads);
            sum.load_bytes = sum.load_bytes.saturating_add(access.load_bytes);
            sum.stores = sum.stores.saturating_add(access.stores);
        }
    }

    fn loads_of(&self, places: &[Place]) -> bool {
        places.iter().any(|place| self.buffers.get(place).is_some_and(|access| access.loads > 0))
    }
}

/// A kernel, counted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Counted {
    /// What is outside of all loops first; then the loops, each after the one around it. A loop of
    /// a function that is called twice is there twice.
    pub loops: Vec<LoopCounts>,
}

/// Why a kernel cannot be counted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CountError {
    /// The words are no SPIR-V. Remedy: give what a compiler wrote (`niwaki_shaders::compile`).
    #[error("no SPIR-V module: {0}; give the words that a shader compiler wrote")]
    NotSpirv(String),
    /// There is no such entry point. Remedy: one of those that are listed.
    #[error("no entry point {wanted:?}; there are: {known}")]
    NoEntry {
        /// What was asked for.
        wanted: String,
        /// What there is.
        known: String,
    },
    /// The kernel does what SPIR-V does not show the cost of: the driver's own ray tracing. Remedy:
    /// count a kernel that traverses by itself, or measure.
    #[error("{0} cannot be counted: the driver hides what it does; measure it instead")]
    Opaque(String),
    /// Functions call themselves, which shaders may not. Remedy: a valid module.
    #[error("function {0} calls itself, which SPIR-V for shaders forbids")]
    Recursion(u32),
    /// The kernel has more loops, with those of its callees at each call, than can be told apart.
    /// Remedy: count its parts.
    #[error("more than {MOST_LOOPS} loops, with those of each call; count parts of the kernel")]
    TooLarge,
    /// No loop reads what a ray tracing kernel reads. Remedy: name the bindings in which nodes and
    /// triangles lie.
    #[error("no loop loads {0}; name the bindings that hold them")]
    NoLoop(&'static str),
}

/// Counts the instructions of an entry point.
///
/// # Errors
/// [`CountError`].
pub fn count(words: &[u32], entry: &str) -> Result<Counted, CountError> {
    function::count(words, entry)
}

impl Counted {
    /// Everything, each instruction once.
    #[must_use]
    pub fn total(&self) -> InstructionMix {
        let mut total = InstructionMix::default();
        for one in &self.loops {
            total.add(&one.own);
        }
        total
    }

    /// Which loops are traversals: those that load nodes and triangles, themselves or by loops
    /// inside, with none inside that does.
    fn traversals(&self, nodes: &[Place], triangles: &[Place]) -> Vec<bool> {
        let loads = |places| self.loops.iter().map(|one| one.loads_of(places)).collect();
        let (mut has_nodes, mut has_triangles): (Vec<bool>, Vec<bool>) =
            (loads(nodes), loads(triangles));
        let mut is_around = vec![false; self.loops.len()];
        let mut found = vec![false; self.loops.len()];
        // Loops come after those around them: by going backwards, all inside is known.
        for i in (1..self.loops.len()).rev() {
            let is_both = has_nodes[i] && has_triangles[i];
            found[i] = is_both && !is_around[i];
            if let Some(parent) = self.loops[i].parent {
                is_around[parent] |= is_both;
                has_nodes[parent] |= has_nodes[i];
                has_triangles[parent] |= has_triangles[i];
            }
        }
        found
    }

    /// What a ray tracing kernel does for each traversal step, for each intersection, and besides:
    /// the names of the thesis's Paper I, Table 5.
    ///
    /// A step is a turn of an innermost loop around loads of both nodes and triangles, with one
    /// turn of every loop inside but those that load triangles, which are intersections. The rest is
    /// constant, of one turn each. A kernel that traverses in several places (a function that is
    /// called for primary rays and for others) has the mean of its steps.
    ///
    /// # Errors
    /// [`CountError::NoLoop`] if nothing fits that.
    pub fn ray_tracing(
        &self,
        nodes: &[Place],
        triangles: &[Place],
    ) -> Result<KernelCounts, CountError> {
        #[derive(Clone, Copy)]
        enum Part {
            Constant,
            Traversal,
            Intersection,
        }
        let is_step = self.traversals(nodes, triangles);
        let mut parts = vec![Part::Constant; self.loops.len()];
        let mut sums = [InstructionMix::default(); 3];
        let mut times = [1.0, 0.0, 0.0];
        for (i, one) in self.loops.iter().enumerate() {
            let around = one.parent.map_or(Part::Constant, |parent| parts[parent]);
            parts[i] = match around {
                _ if is_step[i] => Part::Traversal,
                Part::Traversal if one.loads_of(triangles) => Part::Intersection,
                other => other,
            };
            let is_first = !matches!(
                (around, parts[i]),
                (Part::Traversal, Part::Traversal) | (Part::Intersection, _) | (_, Part::Constant)
            );
            times[parts[i] as usize] += f64::from(u8::from(is_first));
            sums[parts[i] as usize].add(&one.own);
        }
        let [_, traversals, intersections] = times;
        if traversals == 0.0 {
            return Err(CountError::NoLoop("nodes, with triangles in a loop inside"));
        }
        if intersections == 0.0 {
            return Err(CountError::NoLoop("triangles inside of one that loads nodes"));
        }
        let [constant, traversal, intersection] = sums;
        let sum =
            |of: fn(&InstructionMix) -> u64| sums.iter().map(|mix| of(mix) as f64).sum::<f64>();
        let bytes = sum(|mix| mix.load_bytes) + sum(|mix| mix.store_bytes);
        let memory = sum(|mix| mix.loads) + sum(|mix| mix.stores);
        Ok(KernelCounts {
            compute_per_traversal: traversal.arithmetic() as f64 / traversals,
            compute_per_intersection: intersection.arithmetic() as f64 / intersections,
            compute_constant: constant.arithmetic() as f64,
            memory_per_traversal: traversal.memory() as f64 / traversals,
            memory_per_intersection: intersection.memory() as f64 / intersections,
            memory_constant: constant.memory() as f64,
            bytes_per_memory_instruction: bytes / memory.max(1.0),
        })
    }
}

#[cfg(feature = "vulkan")]
impl KernelCounts {
    /// Of a kernel that `niwaki-shaders` compiled, such as `trace_wide`: bindings whose names begin
    /// with `nodes` and `triangles` hold what their names say.
    ///
    /// ```
    /// use niwaki_gpu_model::KernelCounts;
    ///
    /// // Both arms of branches count, so leave out those that hardly any ray takes.
    /// let constants = [("RARE", 0.0)];
    /// let options = niwaki_shaders::Options { constants: &constants, ..Default::default() };
    /// let counts = KernelCounts::of_shader(&niwaki_shaders::compile("trace_binary", "main", &options)?)?;
    /// // Both children of a node are read, two rows of 16 bytes each.
    /// assert!(counts.memory_per_traversal >= 4.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`CountError`].
    pub fn of_shader(shader: &niwaki_shaders::Shader) -> Result<Self, CountError> {
        let places = |prefix: &str| -> Vec<Place> {
            let named = shader.bindings.iter().filter(|b| b.name.starts_with(prefix));
            named.map(|b| Place { group: b.group, binding: b.binding }).collect()
        };
        let counted = count(&shader.words, &shader.entry)?;
        counted.ray_tracing(&places("nodes"), &places("triangles"))
    }
}

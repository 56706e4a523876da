//! Memory of a build, and the build itself.

use super::{LbvhConfig, LbvhError, LbvhTimes, kernels::Kernels};
use crate::{Batch, Buffer, Device, GpuError, Kernel};
use niwaki_core::builder::MAX_PRIMS;
use niwaki_core::{BuildError, Bvh, BvhNode, PrimRef, to_u32};
use std::sync::Arc;

/// Words of the settings, `LbvhParams` in `lbvh/state.wgsl`.
const PARAMS_WORDS: usize = 8;
/// Items of a tile, `TILE` there.
const TILE: u64 = 2048;
/// Words of the record, `S_WORDS` there, and what some of them are.
pub(super) const RECORD_WORDS: usize = 32;
const COUNT: usize = 0;
const BAD: usize = 1;
const REQUESTED: usize = 2;
const NODES: usize = 3;
const NONE: u32 = u32::MAX;
/// Triples of indirect sizes, the `A_` constants there.
const ARGS: u64 = 5;

/// How many workgroups a stage has.
#[derive(Clone, Copy)]
enum Size {
    One,
    /// What the device has written to this triple.
    Args(u64),
}

const CHECK: Size = Size::Args(0);
const ELEMENTS_TRIPLE: u64 = 1;
const ELEMENTS: Size = Size::Args(ELEMENTS_TRIPLE);
const TILES: Size = Size::Args(2);
const DIGITS: Size = Size::Args(3);
const ONE_IF_ANY: Size = Size::Args(4);

/// Memory for a tree on the device, which is built there as often as wanted; the host need not know
/// anything in between.
///
/// Primitives come from [`LbvhWorkspace::upload`], from a mesh on the device
/// ([`LbvhWorkspace::record_triangles`]), or from any kernel that writes
/// [`LbvhWorkspace::prims`] and [`LbvhWorkspace::count`].
#[derive(Debug)]
pub struct LbvhWorkspace {
    device: Device,
    kernels: Arc<Kernels>,
    capacity: usize,
    prims: Buffer,
    count: Buffer,
    nodes: Buffer,
    prim_ids: Buffer,
    record: Buffer,
    args: Buffer,
    /// Settings, one part for each pass of the sort.
    params: Vec<Buffer>,
    /// Codes and places; the second also has the ranks, once the sort is done.
    pub(super) items: [Buffer; 2],
    pub(super) table: Buffer,
    pub(super) tree: Buffer,
    pub(super) boxes: Buffer,
}

impl LbvhWorkspace {
    pub(super) fn new(
        device: &Device,
        kernels: Arc<Kernels>,
        capacity: usize,
        config: &LbvhConfig,
    ) -> Result<Self, LbvhError> {
        config.check()?;
        if capacity > MAX_PRIMS {
            return Err(BuildError::TooManyPrimitives { count: capacity, max: MAX_PRIMS }.into());
        }
        let places = capacity as u64;
        let node_bytes = (2 * places).saturating_sub(1) * size_of::<BvhNode>() as u64;
        let limit = device.info().max_binding_bytes;
        if node_bytes > limit {
            return Err(LbvhError::Gpu(GpuError::TooLarge {
                what: format!("the size in bytes of a tree over {capacity} primitives"),
                wanted: node_bytes,
                limit,
                remedy: "build several trees, or build on the CPU",
            }));
        }
        let words = |count: u64| device.buffer(4 * count);
        // The settings of each pass of the sort, as far apart as bindings have to be.
        let passes = config.code_bits.div_ceil(8);
        let stride = device.info().binding_alignment.max(4 * PARAMS_WORDS as u64);
        let settings = device.buffer(stride * u64::from(passes))?;
        let mut params = Vec::new();
        for pass in 0..passes {
            let start = stride * u64::from(pass);
            let part = settings.view(start, start + 4 * PARAMS_WORDS as u64)?;
            // Leaves of more than all primitives are no larger.
            let max_leaf_size = to_u32(config.max_leaf_size.min(MAX_PRIMS));
            let sah = &config.sah;
            let costs = [sah.inner, sah.leaf, sah.triangle].map(f32::to_bits);
            let [inner, leaf, triangle] = costs;
            let head = [to_u32(capacity), config.code_bits, max_leaf_size, 8 * pass];
            let words: [u32; PARAMS_WORDS] =
                [head[0], head[1], head[2], head[3], inner, leaf, triangle, 0];
            part.write(0, &words)?;
            params.push(part);
        }
        let tiles = places.div_ceil(TILE);
        Ok(Self {
            device: device.clone(),
            kernels,
            capacity,
            prims: device.buffer(places * size_of::<PrimRef>() as u64)?,
            count: device.upload(&[0_u32])?,
            nodes: device.buffer(node_bytes)?,
            prim_ids: words(places)?,
            record: words(RECORD_WORDS as u64)?,
            args: words(3 * ARGS)?,
            params,
            items: [words(3 * places)?, words(3 * places)?],
            table: words(256 * (tiles + 1))?,
            tree: words(4 * places)?,
            boxes: words(7 * places)?,
        })
    }

    /// How many primitives there is room for.
    #[must_use]
    pub const fn capacity(&self) -> usize {
        self.capacity
    }

    /// The primitives: 32 bytes each, as [`PrimRef`].
    #[must_use]
    pub const fn prims(&self) -> &Buffer {
        &self.prims
    }

    /// The number of primitives: one `u32`.
    #[must_use]
    pub const fn count(&self) -> &Buffer {
        &self.count
    }

    /// The nodes of the tree: 32 bytes each, as [`BvhNode`]; as many as [`LbvhWorkspace::check`] says.
    #[must_use]
    pub const fn nodes(&self) -> &Buffer {
        &self.nodes
    }

    /// Ids of the primitives in the order of the leaves, a `u32` each.
    #[must_use]
    pub const fn prim_ids(&self) -> &Buffer {
        &self.prim_ids
    }

    /// What is known about the build, for other kernels: words of `lbvh/state.wgsl`, of which word 3 is
    /// the number of nodes (0 if there is no tree).
    #[must_use]
    pub const fn record_words(&self) -> &Buffer {
        &self.record
    }

    /// Sets the primitives of the next build.
    ///
    /// # Errors
    /// [`LbvhError::OverCapacity`], or as [`Buffer::write`].
    pub fn upload(&self, prims: &[PrimRef]) -> Result<(), LbvhError> {
        self.set_count(prims.len())?;
        Ok(self.prims.write(0, prims)?)
    }

    /// Sets how many primitives the next build has.
    ///
    /// # Errors
    /// [`LbvhError::OverCapacity`], or as [`Buffer::write`].
    pub fn set_count(&self, count: usize) -> Result<(), LbvhError> {
        if count > self.capacity {
            let count = u32::try_from(count).unwrap_or(u32::MAX);
            return Err(LbvhError::OverCapacity { count, capacity: to_u32(self.capacity) });
        }
        Ok(self.count.write(0, &[to_u32(count)])?)
    }

    /// Records that the primitives become references to as many triangles as [`LbvhWorkspace::count`]
    /// will say. `positions` has three `f32` a vertex, `indices` three `u32` a triangle. A triangle
    /// with a vertex that is not there or not finite is a bad primitive.
    ///
    /// # Errors
    /// As [`Batch::dispatch`].
    pub fn record_triangles(
        &self,
        batch: &mut Batch,
        positions: &Buffer,
        indices: &Buffer,
    ) -> Result<(), GpuError> {
        let groups = self.device.info().groups_for(self.capacity as u64, 256);
        let params = &self.params[0];
        let buffers = [params, &self.count, positions, indices, &self.prims];
        batch.mark("lbvh begin")?;
        batch.dispatch(&self.kernels.triangles, &buffers, &(), groups)?;
        batch.mark("lbvh triangles")?;
        Ok(())
    }

    /// Records a build of the primitives that are there when the batch runs. Nothing of it waits for
    /// the host; with more primitives than fit, or a bad one, there will be no nodes.
    ///
    /// # Errors
    /// As [`Batch::dispatch`].
    pub fn record(&self, batch: &mut Batch) -> Result<(), GpuError> {
        let k = &*self.kernels;
        batch.mark("lbvh begin")?;
        self.stage(batch, &k.begin, Size::One, 0)?;
        self.stage(batch, &k.bounds, CHECK, 0)?;
        self.stage(batch, &k.settle, Size::One, 0)?;
        batch.mark("lbvh bounds")?;
        self.stage(batch, &k.morton, ELEMENTS, 0)?;
        batch.mark("lbvh codes")?;
        for pass in 0..self.params.len() {
            self.stage(batch, &k.count_digits, TILES, pass)?;
            self.stage(batch, &k.scan_digits, DIGITS, pass)?;
            self.stage(batch, &k.scatter, TILES, pass)?;
        }
        batch.mark("lbvh sort")?;
        self.stage(batch, &k.hierarchy, ELEMENTS, 0)?;
        batch.mark("lbvh hierarchy")?;
        self.stage(batch, &k.bottom_up, ELEMENTS, 0)?;
        batch.mark("lbvh boxes")?;
        self.stage(batch, &k.collapse, ELEMENTS, 0)?;
        batch.mark("lbvh leaves")?;
        self.stage(batch, &k.mark, ELEMENTS, 0)?;
        self.stage(batch, &k.sum_tiles, TILES, 0)?;
        self.stage(batch, &k.scan_tiles, ONE_IF_ANY, 0)?;
        self.stage(batch, &k.scan_places, TILES, 0)?;
        batch.mark("lbvh places")?;
        self.stage(batch, &k.emit, ELEMENTS, 0)?;
        batch.mark("lbvh nodes")?;
        Ok(())
    }

    /// Records what traversal needs of the tree over the triangles of
    /// [`LbvhWorkspace::record_triangles`]: `rows` of 48 bytes a triangle and `parents` of 4 bytes a
    /// node, as [`crate::DeviceTree`] has them.
    ///
    /// # Errors
    /// As [`Batch::dispatch`].
    pub fn record_scene(
        &self,
        batch: &mut Batch,
        [positions, indices]: [&Buffer; 2],
        [rows, parents]: [&Buffer; 2],
    ) -> Result<(), GpuError> {
        let buffers =
            [&self.record, &self.prim_ids, &self.nodes, positions, indices, rows, parents];
        let groups = (&self.args, 12 * ELEMENTS_TRIPLE);
        batch.dispatch_indirect(&self.kernels.arrange, &buffers, &(), groups)?;
        Ok(())
    }

    /// Dispatches a kernel with the buffers that its bindings name, in a pass of the sort.
    fn stage(
        &self,
        batch: &mut Batch,
        kernel: &Kernel,
        size: Size,
        pass: usize,
    ) -> Result<(), GpuError> {
        let [even, odd] = &self.items;
        let (source, target) = if pass.is_multiple_of(2) { (even, odd) } else { (odd, even) };
        let mut buffers = Vec::with_capacity(kernel.bindings().len());
        for binding in kernel.bindings() {
            buffers.push(match binding.name.as_str() {
                "params" => &self.params[pass],
                "counts" => &self.count,
                "prims" => &self.prims,
                "state" => &self.record,
                "args" => &self.args,
                // Both numbers of passes are even.
                "items" => even,
                "ranks" => odd,
                "source" => source,
                "target_items" => target,
                "table" => &self.table,
                "tree" => &self.tree,
                "boxes" => &self.boxes,
                "prim_ids" => &self.prim_ids,
                "nodes" => &self.nodes,
                name => {
                    let message = format!("the builder has no buffer for {name}");
                    return Err(GpuError::Mismatch { kernel: format!("{kernel:?}"), message });
                }
            });
        }
        match size {
            Size::One => batch.dispatch(kernel, &buffers, &(), [1; 3])?,
            Size::Args(triple) => {
                batch.dispatch_indirect(kernel, &buffers, &(), (&self.args, 12 * triple))?
            }
        };
        Ok(())
    }

    /// Builds the tree of the primitives that are there, and waits for it.
    ///
    /// # Errors
    /// As [`LbvhWorkspace::check`], and [`GpuError::DeviceLost`].
    pub fn build(&self) -> Result<LbvhTimes, LbvhError> {
        let mut batch = self.device.batch()?;
        self.record(&mut batch)?;
        let times = LbvhTimes::of(&batch.submit()?);
        self.check()?;
        Ok(times)
    }

    /// The number of primitives and of nodes of the last build, read back.
    ///
    /// # Errors
    /// [`BuildError::NonFiniteBounds`] with the first bad primitive, [`LbvhError::OverCapacity`], or as
    /// [`Buffer::read`].
    pub fn check(&self) -> Result<(usize, usize), LbvhError> {
        let record = self.record.read::<u32>()?;
        let (count, nodes) = (record[COUNT] as usize, record[NODES] as usize);
        if record[REQUESTED] as usize > self.capacity {
            let capacity = to_u32(self.capacity);
            return Err(LbvhError::OverCapacity { count: record[REQUESTED], capacity });
        }
        if record[BAD] != NONE {
            let start = u64::from(record[BAD]) * size_of::<PrimRef>() as u64;
            let part = self.prims.view(start, start + size_of::<PrimRef>() as u64)?;
            let mut bad = [<PrimRef as bytemuck::Zeroable>::zeroed()];
            part.read_into(&mut bad)?;
            let [prim] = bad;
            return Err(LbvhError::Build(BuildError::NonFiniteBounds {
                index: record[BAD] as usize,
                prim_id: prim.prim_id,
                bounds: prim.aabb(),
            }));
        }
        Ok((count, nodes))
    }

    /// The tree of the last build.
    ///
    /// # Errors
    /// As [`LbvhWorkspace::check`].
    pub fn download(&self) -> Result<Bvh, LbvhError> {
        let (count, nodes) = self.check()?;
        Ok(Bvh {
            nodes: self.nodes.view(0, (nodes * size_of::<BvhNode>()) as u64)?.read()?,
            prim_ids: self.prim_ids.view(0, (count * size_of::<u32>()) as u64)?.read()?,
        })
    }
}

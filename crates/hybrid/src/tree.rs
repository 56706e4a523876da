//! The tree over the triangles of the near region: culled and built on the GPU in every frame that
//! needs a new one, by the kernels of `niwaki-shaders` that `niwaki-trace-vulkan` dispatches too.

use crate::{Gpu, HybridError, Region, upload::GpuScene};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use niwaki_core::{BvhNode, SahConstants, to_u32};
use niwaki_shaders::BindingKind;
use std::{ops::Range, sync::Arc};
use wgpu::BufferUsages;

/// A box that no ray meets: the root of a tree without triangles.
const NOTHING: BvhNode =
    BvhNode { min: Vec3::splat(1e30), first: 0, max: Vec3::splat(-1e30), count: 1 };

/// Items of a tile, `TILE` in `lbvh/state.wgsl`.
const TILE: u64 = 2048;
/// Words of the record of a build, `S_WORDS` there, and what some of them are.
const RECORD_WORDS: u32 = 32;
const COUNT: usize = 0;
const BAD: usize = 1;
const REQUESTED: usize = 2;
/// Bits of the codes: enough for a region around the camera, and half the passes of 63.
const CODE_BITS: u32 = 30;
const PASSES: usize = 4;

/// How many workgroups a kernel has.
#[derive(Clone, Copy)]
enum Size {
    One,
    /// What the device wrote to this triple, `A_` in `lbvh/state.wgsl`.
    Args(u64),
}

const CHECK: Size = Size::Args(0);
const ELEMENTS: Size = Size::Args(1);
const TILES: Size = Size::Args(2);
const DIGITS: Size = Size::Args(3);
const ONE_IF_ANY: Size = Size::Args(4);

/// The kernels in order; the three of the sort stand in the middle and run once a pass.
const BEFORE: [(&str, &str, Size); 4] = [
    ("lbvh/bounds", "begin", Size::One),
    ("lbvh/bounds", "bounds", CHECK),
    ("lbvh/bounds", "settle", Size::One),
    ("lbvh/morton", "morton", ELEMENTS),
];
const SORT: [(&str, &str, Size); 3] = [
    ("lbvh/sort", "count_digits", TILES),
    ("lbvh/sort", "scan_digits", DIGITS),
    ("lbvh/sort", "scatter", TILES),
];
const AFTER: [(&str, &str, Size); 8] = [
    ("lbvh/karras", "hierarchy", ELEMENTS),
    ("lbvh/boxes", "bottom_up", ELEMENTS),
    ("lbvh/boxes", "collapse", ELEMENTS),
    ("lbvh/mark", "mark", ELEMENTS),
    ("lbvh/rank", "sum_tiles", TILES),
    ("lbvh/rank", "scan_tiles", ONE_IF_ANY),
    ("lbvh/rank", "scan_places", TILES),
    ("lbvh/emit", "emit", ELEMENTS),
];

/// A kernel and the names of what it binds, in order.
struct Kernel {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    bindings: Vec<(u32, String)>,
    size: Size,
}

impl Kernel {
    fn new(gpu: &Gpu, module: &str, entry: &str, size: Size) -> Result<Self, HybridError> {
        let fault = |e: niwaki_shaders::ShaderError| HybridError::Shader {
            module: module.into(),
            message: e.to_string(),
        };
        let source = niwaki_shaders::source(module).map_err(fault)?;
        let options = niwaki_shaders::Options::default();
        let shader = niwaki_shaders::compile(module, entry, &options).map_err(fault)?;
        let entries: Vec<_> = shader
            .bindings
            .iter()
            .map(|binding| wgpu::BindGroupLayoutEntry {
                binding: binding.binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty: match binding.kind {
                        BindingKind::Storage { writable } => {
                            wgpu::BufferBindingType::Storage { read_only: !writable }
                        }
                        _ => wgpu::BufferBindingType::Uniform,
                    },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            })
            .collect();
        let layout = gpu.device().create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(entry),
            entries: &entries,
        });
        let compiled = gpu.module(module, source)?;
        Ok(Self {
            pipeline: gpu.compute(&compiled, entry, &[&layout], &[])?,
            layout,
            bindings: shader.bindings.into_iter().map(|b| (b.binding, b.name)).collect(),
            size,
        })
    }
}

/// All kernels, compiled.
pub(crate) struct TreeKernels {
    cull: Kernel,
    before: Vec<Kernel>,
    sort: Vec<Kernel>,
    after: Vec<Kernel>,
}

impl TreeKernels {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, HybridError> {
        let all = |list: &[(&str, &str, Size)]| -> Result<Vec<Kernel>, HybridError> {
            list.iter()
                .map(|(module, entry, size)| Kernel::new(gpu, module, entry, *size))
                .collect()
        };
        Ok(Self {
            cull: Kernel::new(gpu, "hybrid/cull", "cull", Size::One)?,
            before: all(&BEFORE)?,
            sort: all(&SORT)?,
            after: all(&AFTER)?,
        })
    }
}

/// Settings of a pass: `LbvhParams` in `lbvh/state.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Params {
    capacity: u32,
    code_bits: u32,
    max_leaf_size: u32,
    shift: u32,
    sah: [f32; 3],
    count_word: u32,
}

/// What culling looks at: `Cull` in `hybrid/cull.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Cull {
    low: Vec3,
    capacity: u32,
    high: Vec3,
    pad: u32,
}

/// Memory of builds of up to so many triangles.
struct Workspace {
    capacity: u32,
    named: Vec<(&'static str, wgpu::Buffer)>,
    params: Vec<wgpu::Buffer>,
}

impl Workspace {
    fn new(gpu: &Gpu, capacity: u32) -> Result<Self, HybridError> {
        let places = u64::from(capacity);
        let storage = BufferUsages::STORAGE;
        let words = |name: &'static str, count: u64, usage: BufferUsages| {
            Ok::<_, HybridError>((name, gpu.buffer(name, 4 * count, storage | usage)?))
        };
        let none = BufferUsages::empty();
        let sah = SahConstants::default();
        let params = (0..PASSES).map(|pass| {
            let params = Params {
                capacity,
                code_bits: CODE_BITS,
                max_leaf_size: 4,
                shift: 8 * to_u32(pass),
                sah: [sah.inner, sah.leaf, sah.triangle],
                count_word: 0,
            };
            gpu.upload("settings of the tree", &[params], BufferUsages::UNIFORM)
        });
        Ok(Self {
            capacity,
            named: vec![
                // The largest first, so that what does not fit is refused at once.
                words("nodes", 16 * places, none)?,
                words("prims", 8 * places, none)?,
                words("counts", 4, none)?,
                words("state", RECORD_WORDS.into(), BufferUsages::COPY_SRC)?,
                words("args", 15, BufferUsages::INDIRECT)?,
                words("items", 3 * places, none)?,
                words("ranks", 3 * places, none)?,
                words("table", 256 * (places.div_ceil(TILE) + 1), none)?,
                words("tree", 4 * places, none)?,
                words("boxes", 7 * places, none)?,
                words("prim_ids", places, none)?,
            ],
            params: params.collect::<Result<_, _>>()?,
        })
    }

    fn buffer(&self, name: &str) -> Option<&wgpu::Buffer> {
        self.named.iter().find(|(n, _)| *n == name).map(|(_, buffer)| buffer)
    }

    /// The buffer that a kernel calls so in a pass of the sort.
    fn bound(&self, name: &str, pass: usize) -> Option<&wgpu::Buffer> {
        match name {
            "params" => self.params.get(pass),
            "source" => self.buffer(if pass.is_multiple_of(2) { "items" } else { "ranks" }),
            "target_items" => self.buffer(if pass.is_multiple_of(2) { "ranks" } else { "items" }),
            _ => self.buffer(name),
        }
    }
}

/// The tree on the GPU and the means to build it.
pub(crate) struct NearTree {
    pub(crate) nodes: wgpu::Buffer,
    pub(crate) triangles: wgpu::Buffer,
    kernels: Option<Arc<TreeKernels>>,
    workspace: Option<Workspace>,
    /// Triangles in the tree.
    pub(crate) count: u32,
}

/// What a build works on.
pub(crate) struct NearInput<'a> {
    /// Triangles of the objects that meet the region.
    pub(crate) ranges: &'a [Range<u32>],
    pub(crate) region: &'a Region,
}

impl NearTree {
    /// A tree without triangles.
    pub(crate) fn empty(gpu: &Gpu) -> Result<Self, HybridError> {
        Ok(Self {
            nodes: gpu.upload("nodes", &[NOTHING], BufferUsages::STORAGE)?,
            triangles: gpu.upload("leaves", &[0_u32], BufferUsages::STORAGE)?,
            kernels: None,
            workspace: None,
            count: 0,
        })
    }

    /// Makes room, and uploads what the build's kernels read. Its commands follow by
    /// [`NearTree::record`].
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        input: &NearInput<'_>,
    ) -> Result<PreparedBuild, HybridError> {
        let wanted: u32 = input.ranges.iter().map(|r| r.end - r.start).sum();
        if self.workspace.as_ref().is_none_or(|w| w.capacity < wanted) {
            self.workspace = None;
            // Some more, so that objects that come into the region one by one do not make new
            // room each.
            let roomy = u64::from(wanted).next_power_of_two().max(1024);
            let limit =
                gpu.limits().max_storage_buffer_binding_size / size_of::<[BvhNode; 2]>() as u64;
            let capacity = roomy.min(limit.max(u64::from(wanted)));
            let workspace = Workspace::new(gpu, u32::try_from(capacity).unwrap_or(u32::MAX))?;
            if let (Some(nodes), Some(ids)) =
                (workspace.buffer("nodes"), workspace.buffer("prim_ids"))
            {
                (self.nodes, self.triangles) = (nodes.clone(), ids.clone());
            }
            self.workspace = Some(workspace);
        }
        if self.kernels.is_none() {
            self.kernels = Some(gpu.shared(TreeKernels::new)?);
        }
        // What rays find if there is nothing to build.
        gpu.queue().write_buffer(&self.nodes, 0, bytemuck::bytes_of(&NOTHING));
        let capacity = self.workspace.as_ref().map_or(0, |w| w.capacity);
        let near = input.region.traced_bounds();
        let cull = Cull { low: near.min, capacity, high: near.max, pad: 0 };
        let ranges: Vec<[u32; 2]> =
            input.ranges.iter().map(|r| [r.start, r.end - r.start]).collect();
        let longest = ranges.iter().map(|r| r[1]).max().unwrap_or(0);
        Ok(PreparedBuild {
            cull: gpu.upload("the near region", &[cull], BufferUsages::UNIFORM)?,
            // Kernels step on by the size of the grid, so a smaller one is right too.
            groups: [longest.div_ceil(256).min(4096), to_u32(ranges.len()).min(65_535)],
            ranges: gpu.upload("objects in the near region", &ranges, BufferUsages::STORAGE)?,
        })
    }

    /// Records culling and building; returns how many dispatches that took.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        scene: &GpuScene,
        build: &PreparedBuild,
    ) -> Result<u32, HybridError> {
        let (Some(kernels), Some(workspace)) = (&self.kernels, &self.workspace) else {
            return Ok(0);
        };
        if let Some(counts) = workspace.buffer("counts") {
            encoder.clear_buffer(counts, 0, None);
        }
        let mut dispatches = 0;
        let mut pass = encoder.begin_compute_pass(&Default::default());
        let mut run = |kernel: &Kernel, sort_pass: usize| -> Result<(), HybridError> {
            let mut entries = Vec::new();
            for (binding, name) in &kernel.bindings {
                let buffer = match name.as_str() {
                    "cull_box" => Some(&build.cull),
                    "ranges" => Some(&build.ranges),
                    "vertices" => Some(&scene.surfaces.vertices),
                    "indices" => Some(&scene.surfaces.indices),
                    name => workspace.bound(name, sort_pass),
                };
                let Some(buffer) = buffer else {
                    return Err(HybridError::Gpu(format!("no buffer is called {name}")));
                };
                entries.push(wgpu::BindGroupEntry {
                    binding: *binding,
                    resource: buffer.as_entire_binding(),
                });
            }
            let group = gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &kernel.layout,
                entries: &entries,
            });
            pass.set_pipeline(&kernel.pipeline);
            pass.set_bind_group(0, &group, &[]);
            match (kernel.size, workspace.buffer("args")) {
                (Size::Args(triple), Some(args)) => {
                    pass.dispatch_workgroups_indirect(args, 12 * triple);
                }
                _ if kernel.bindings.iter().any(|(_, name)| name == "cull_box") => {
                    pass.dispatch_workgroups(build.groups[0], build.groups[1], 1);
                }
                _ => pass.dispatch_workgroups(1, 1, 1),
            }
            dispatches += 1;
            Ok(())
        };
        run(&kernels.cull, 0)?;
        for kernel in &kernels.before {
            run(kernel, 0)?;
        }
        for sort_pass in 0..PASSES {
            for kernel in &kernels.sort {
                run(kernel, sort_pass)?;
            }
        }
        for kernel in &kernels.after {
            run(kernel, 0)?;
        }
        drop(pass);
        Ok(dispatches)
    }

    /// Reads how many triangles the last build had.
    pub(crate) fn check(&mut self, gpu: &Gpu) -> Result<(), HybridError> {
        let Some(state) = self.workspace.as_ref().and_then(|w| w.buffer("state")) else {
            return Ok(());
        };
        let record: Vec<u32> = gpu.read(state, RECORD_WORDS as usize)?;
        self.count = record[COUNT];
        if record[BAD] != u32::MAX || record[REQUESTED] != record[COUNT] {
            // Culling leaves out what is not finite and there is room for all: a fault of ours.
            return Err(HybridError::Gpu(format!("the tree was not built: {record:?}")));
        }
        Ok(())
    }
}

/// What a build reads, on the GPU.
pub(crate) struct PreparedBuild {
    cull: wgpu::Buffer,
    ranges: wgpu::Buffer,
    groups: [u32; 2],
}

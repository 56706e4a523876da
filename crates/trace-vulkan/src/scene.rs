//! Trees and triangles on a device.

use crate::{
    Buffer, Device, GpuError,
    layout::{Packed, pack_binary, pack_wide},
};
use bytemuck::{NoUninit, Pod, Zeroable};
use niwaki_core::{Aabb, Bvh, TriangleMesh};
use niwaki_trace::{Mode, Prepared, check_binary};
use niwaki_wide::{Bvh8, CollapseError, CollapseSettings};

/// Bindings that nodes, and triangles, can be spread over.
const PIECES: u64 = 4;

/// Bytes of a node of a binary tree, and of a wide one.
const NODE_BYTES: [u64; 2] = [32, 96];

/// Bytes of a reference's triangle.
const TRIANGLE_BYTES: u64 = 48;

/// How a tree lies in the device's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TreeLayout {
    /// Two children a node, 32 bytes: `niwaki_core::BvhNode` as it is.
    Binary,
    /// Eight children a node with quantised boxes, 96 bytes.
    Wide,
}

impl TreeLayout {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Binary, Self::Wide];

    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Binary => "binary",
            Self::Wide => "wide",
        }
    }

    /// The module of `niwaki-shaders`.
    pub(crate) const fn module(self) -> &'static str {
        match self {
            Self::Binary => "trace_binary",
            Self::Wide => "trace_wide",
        }
    }

    const fn node_bytes(self) -> u64 {
        NODE_BYTES[self as usize]
    }
}

/// `Scene` of `ray.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct SceneWords {
    bounds_min: [f32; 3],
    factor: f32,
    bounds_max: [f32; 3],
    magnitude: f32,
    nodes: u32,
    pub(crate) rays: u32,
    is_moderate: u32,
    shifts: u32,
}

impl SceneWords {
    /// Of a scene that is traced as it is, without being scaled.
    pub(crate) fn unscaled(bounds: Aabb, nodes: u32) -> Self {
        let bounds = if bounds.is_empty() {
            Aabb::new(Default::default(), Default::default())
        } else {
            bounds
        };
        let magnitude = bounds.min.abs().max(bounds.max.abs()).max_element();
        Self {
            bounds_min: bounds.min.into(),
            factor: 1.0,
            bounds_max: bounds.max.into(),
            magnitude,
            nodes,
            rays: 0,
            is_moderate: u32::from(magnitude <= 1e10),
            shifts: 0,
        }
    }
}

/// A buffer of equal elements, as the parts that are bound.
#[derive(Clone, Debug)]
pub(crate) struct Pieces {
    pub(crate) views: Vec<Buffer>,
    /// The binary logarithm of the elements of a part.
    shift: u32,
}

impl Pieces {
    /// The whole if the device can bind it, or up to four parts of as many elements as it can, a
    /// power of two.
    fn new(buffer: &Buffer, element: u64, what: &str) -> Result<Self, GpuError> {
        let info = buffer.device.info();
        let (size, limit) = (buffer.size(), info.max_binding_bytes);
        if size <= limit {
            return Ok(Self { views: vec![buffer.clone()], shift: 31 });
        }
        let too_large = |limit| GpuError::TooLarge {
            what: format!("{what}, in bytes,"),
            wanted: size,
            limit,
            remedy: "split the scene, use trees with larger leaves or fewer references, or use a device with larger bindings",
        };
        let shift = (limit / element).checked_ilog2().ok_or_else(|| too_large(limit))?;
        let part = element << shift;
        if !part.is_multiple_of(info.binding_alignment) || size > PIECES * part {
            return Err(too_large(PIECES * part));
        }
        let views: Result<Vec<_>, _> = (0..size.div_ceil(part))
            .map(|i| buffer.view(i * part, size.min((i + 1) * part)))
            .collect();
        Ok(Self { views: views?, shift })
    }
}

/// A tree with its triangles in the memory of a [`Device`], ready to be traced by a
/// [`crate::Tracer`].
///
/// Answers are those of `niwaki-trace`: in watertight mode every hit has the same bits, as far as
/// the device divides like IEEE 754 says; see the README for the exceptions.
#[derive(Clone, Debug)]
pub struct GpuScene {
    pub(crate) layout: TreeLayout,
    pub(crate) mode: Mode,
    pub(crate) nodes: Pieces,
    pub(crate) triangles: Pieces,
    pub(crate) parents: Option<Buffer>,
    /// Paths may be longer than the stack of the kernel.
    pub(crate) is_deep: bool,
    pub(crate) words: SceneWords,
    bytes: u64,
}

/// A binary tree that was built on the device, for [`GpuScene::adopt`].
#[derive(Clone, Debug)]
pub struct DeviceTree {
    /// Nodes of 32 bytes (`niwaki_core::BvhNode`), root first, children adjacent; none for an empty
    /// scene.
    pub nodes: Buffer,
    /// The parent of each node, one word each; any for the root. Needed for trees that may have
    /// paths of more than 64 nodes, whose rest is lost without, and by drivers that limit loops
    /// ([`crate::DeviceInfo::max_loop_turns`]).
    pub parents: Option<Buffer>,
    /// 48 bytes a reference, in the order of the leaves: three rows of three coordinates and a
    /// word, which in the first row is the id of the triangle. Rows are the corners in
    /// [`Mode::Watertight`]; the first corner and the edges from it to the second and the third in
    /// [`Mode::Fast`]. Three equal corners, or edges of zero, are never hit.
    pub triangles: Buffer,
    /// What the rows hold.
    pub mode: Mode,
    /// The box around everything, or a larger one. Extents between 2⁻²⁰ and 2³⁰ units keep products
    /// in the range of `f32`.
    pub bounds: Aabb,
}

impl GpuScene {
    /// Collapses a binary tree to eight children a node, which is the faster layout, and uploads it
    /// with its triangles for watertight traversal. Trees with split references are welcome.
    ///
    /// # Errors
    /// [`GpuError::Scene`] if it is no tree, or not of this mesh; [`GpuError::TooLarge`]; and as
    /// [`Device::upload`].
    pub fn upload(device: &Device, bvh: &Bvh, mesh: &TriangleMesh) -> Result<Self, GpuError> {
        Self::upload_in(device, TreeLayout::Wide, Mode::Watertight, bvh, mesh)
    }

    /// [`GpuScene::upload`] in any layout and mode.
    ///
    /// # Errors
    /// As [`GpuScene::upload`].
    pub fn upload_in(
        device: &Device,
        layout: TreeLayout,
        mode: Mode,
        bvh: &Bvh,
        mesh: &TriangleMesh,
    ) -> Result<Self, GpuError> {
        match layout {
            TreeLayout::Wide => {
                let wide =
                    Bvh8::collapse(bvh, &CollapseSettings::default()).map_err(scene_error)?;
                Self::upload_wide(device, mode, &wide, mesh)
            }
            TreeLayout::Binary => {
                check_binary(bvh).map_err(scene_error)?;
                let prepared = Prepared::new(mode, &bvh.bounds(), &bvh.prim_ids, mesh)?;
                let packed = pack_binary(bvh, prepared.factor);
                Self::assemble(device, layout, mode, &packed, &bvh.prim_ids, prepared)
            }
        }
    }

    /// Uploads a tree that is eight wide already.
    ///
    /// # Errors
    /// As [`GpuScene::upload`].
    pub fn upload_wide(
        device: &Device,
        mode: Mode,
        bvh: &Bvh8,
        mesh: &TriangleMesh,
    ) -> Result<Self, GpuError> {
        let prepared = Prepared::new(mode, &bvh.bounds(), bvh.prim_ids(), mesh)?;
        let packed = pack_wide(bvh, prepared.factor);
        Self::assemble(device, TreeLayout::Wide, mode, &packed, bvh.prim_ids(), prepared)
    }

    fn assemble<N: NoUninit>(
        device: &Device,
        layout: TreeLayout,
        mode: Mode,
        packed: &Packed<N>,
        prim_ids: &[u32],
        prepared: Prepared,
    ) -> Result<Self, GpuError> {
        let rows: Vec<[[u32; 4]; 3]> = prepared
            .triangles
            .iter()
            .zip(prim_ids)
            .map(|(triangle, &id)| {
                // What is never hit is NaN on the CPU; GPUs need not keep NaN apart.
                let is_hit = triangle.iter().all(|v| v.is_finite());
                triangle.map(|v| {
                    let [x, y, z] = v.to_array().map(|x| if is_hit { x.to_bits() } else { 0 });
                    [x, y, z, id]
                })
            })
            .collect();
        let parents = device.upload(&packed.parents)?;
        let nodes = device.upload(&packed.nodes)?;
        let triangles = device.upload(&rows)?;
        let Prepared { factor, bounds, magnitude, is_moderate, .. } = prepared;
        let scale = SceneWords {
            bounds_min: bounds.min.into(),
            factor,
            bounds_max: bounds.max.into(),
            magnitude,
            nodes: 0,
            rays: 0,
            is_moderate: u32::from(is_moderate),
            shifts: 0,
        };
        Self::from_buffers(layout, mode, &nodes, &triangles, (Some(parents), packed.is_deep), scale)
    }

    /// A binary tree that is on the device already.
    ///
    /// Its contents are not checked: numbers of nodes or references that do not exist make the
    /// device read anything, or be lost.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`].
    pub fn adopt(tree: DeviceTree) -> Result<Self, GpuError> {
        let DeviceTree { nodes, parents, triangles, mode, bounds } = tree;
        let scale = SceneWords::unscaled(bounds, 0);
        let is_deep = parents.is_some();
        Self::from_buffers(TreeLayout::Binary, mode, &nodes, &triangles, (parents, is_deep), scale)
    }

    fn from_buffers(
        layout: TreeLayout,
        mode: Mode,
        nodes: &Buffer,
        triangles: &Buffer,
        (parents, is_deep): (Option<Buffer>, bool),
        scale: SceneWords,
    ) -> Result<Self, GpuError> {
        let count = nodes.size() / layout.node_bytes();
        let bytes = nodes.size() + triangles.size() + parents.as_ref().map_or(0, Buffer::size);
        let nodes = Pieces::new(nodes, layout.node_bytes(), "the nodes of the tree")?;
        let triangles = Pieces::new(triangles, TRIANGLE_BYTES, "the triangles of the tree")?;
        let words = SceneWords {
            nodes: u32::try_from(count).unwrap_or(u32::MAX),
            shifts: nodes.shift | triangles.shift << 8,
            ..scale
        };
        Ok(Self { layout, mode, nodes, triangles, parents, is_deep, words, bytes })
    }

    /// What all rays of a dispatch of `count` have in common.
    pub(crate) const fn words_for(&self, count: u32) -> SceneWords {
        let mut words = self.words;
        words.rays = count;
        words
    }

    /// What the kernels bind under this name of `tracing.wgsl`, as far as it is there.
    pub(crate) fn buffer(&self, name: &str) -> Option<&Buffer> {
        if name == "parents" {
            return self.parents.as_ref();
        }
        let (pieces, part) = match name.rsplit_once('_')? {
            ("nodes", part) => (&self.nodes, part),
            ("triangles", part) => (&self.triangles, part),
            _ => return None,
        };
        pieces.views.get(part.parse::<usize>().ok()?)
    }

    /// True for what may be missing, because kernels bind it whether or not they use it.
    pub(crate) fn is_optional(name: &str) -> bool {
        matches!(name, "parents" | "work")
            || name.starts_with("nodes_")
            || name.starts_with("triangles_")
    }

    /// Bytes of the device's memory that it takes.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        self.bytes
    }

    /// How the tree lies there.
    #[must_use]
    pub const fn layout(&self) -> TreeLayout {
        self.layout
    }

    /// The triangle test that it is for.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// True if nodes or triangles are bound in parts.
    #[must_use]
    pub const fn is_in_pieces(&self) -> bool {
        self.nodes.views.len() > 1 || self.triangles.views.len() > 1
    }
}

fn scene_error(error: CollapseError) -> GpuError {
    GpuError::Scene(error.into())
}

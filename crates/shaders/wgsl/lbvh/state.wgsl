// What all kernels of the LBVH share: settings, the record of a build, and sizes.
//
// A build is these dispatches, each of which sees what those before it wrote. `A_...` is the triple
// of `args` that an indirect dispatch takes; buffers are bound by the names in the files.
//   triangles.wgsl: triangles                    of `capacity` invocations, if primitives are triangles
//   bounds.wgsl: begin                           one workgroup
//   bounds.wgsl: bounds                          A_CHECK
//   bounds.wgsl: settle                          one workgroup
//   morton.wgsl: morton                          A_ELEMENTS
//   for `shift` = 0, 8, ... below `code_bits`, `source` and `target_items` taking turns:
//     sort.wgsl: count_digits, scan_digits, scatter    A_TILES, A_DIGITS, A_TILES
//   karras.wgsl: hierarchy                       A_ELEMENTS, as all up to `mark`
//   boxes.wgsl: bottom_up, collapse
//   mark.wgsl: mark
//   rank.wgsl: sum_tiles, scan_tiles, scan_places    A_TILES, A_ONE, A_TILES
//   emit.wgsl: emit                              A_ELEMENTS
// The sort begins and ends in `items`; its other array is `ranks` from `hierarchy` on.

// Settings of a build; the same for all stages but for `shift`.
struct LbvhParams {
    // Primitives that the buffers have room for.
    capacity: u32,
    // Bits of a Morton code: 30 or 63.
    code_bits: u32,
    max_leaf_size: u32,
    // Where the digit begins that this pass of the sort looks at.
    shift: u32,
    // Costs of the surface area heuristic, as bits.
    sah_inner: u32,
    sah_leaf: u32,
    sah_triangle: u32,
    // Which word of the buffer of counts holds the number of primitives.
    count_word: u32,
}

// Words of the build's record, `state`.
// Primitives of the tree: what was asked for, or 0 after an error.
const S_COUNT = 0u;
// The first primitive whose bounds are not finite or inverted; S_NONE without one.
const S_BAD = 1u;
// What was asked for; over the capacity, nothing is built.
const S_REQUESTED = 2u;
// Nodes of the tree.
const S_NODES = 3u;
// Always 0; see f_opaque_zero.
const S_ZERO = 4u;
// As bits: the smallest coordinates of (twice the) centroids, the power of two that brings tiny or
// huge extents near 1, cells per unit along each axis, the last cell.
const S_LOW = 5u;
const S_PRE = 8u;
const S_SCALE = 9u;
const S_LAST = 12u;
// Power of two by which edges are multiplied before areas are formed, as bits.
const S_AREA_SCALE = 13u;
// Sortable bits of the bounds of all primitives, and of twice their centroids.
const S_BOUNDS = 14u;
const S_CENTROIDS = 20u;
const S_WORDS = 32u;

const S_NONE = 0xffffffffu;

// Threads of a workgroup where each takes one item.
const ELEMENT_THREADS = 256u;
// Threads of a workgroup where each takes several, and how many of those there are together.
const TILE_THREADS = 128u;
const TILE_ITEMS = 16u;
const TILE = 2048u;

// Triples of words in `args`: workgroups of stages that are dispatched indirectly.
const A_CHECK = 0u;
const A_ELEMENTS = 1u;
const A_TILES = 2u;
const A_DIGITS = 3u;
const A_ONE = 4u;
const A_TRIPLES = 5u;

// Words that buffers need for `n` primitives: state 32, args 15, items and the sort's other array 3n
// each, table 256 * (tiles + 1), tree 4n, boxes 7n, prim_ids n, nodes 16n - 8.

fn tile_count(count: u32) -> u32 {
    return (count + TILE - 1u) / TILE;
}

// The number of a workgroup in a grid that may need a second dimension.
fn group_index(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.y * groups.x + id.x;
}

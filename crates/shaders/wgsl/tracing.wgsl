// What the traversal kernels have in common: bindings, the triangles of leaves, the counters, and the
// rays of an invocation.
//!import triangle
//!import boxes

/// Invocations of a workgroup.
override WORKGROUP: u32 = 64;
/// Ends at the first hit.
override ANY: bool = false;
/// Writes the work of each ray.
override COUNT: bool = false;
/// The tree is deeper than the stack, and there are parents.
override DEEP: bool = false;
/// Steps (nodes, triangles, parents) that an invocation does before it leaves the rest of its rays to
/// another dispatch; 0 for no end. Such trees need parents.
override BUDGET: u32 = 0;
/// In how many bindings nodes and triangles lie.
override PIECES: u32 = 1;

var<immediate> scene: Scene;
/// Two rows a ray.
@group(0) @binding(0) var<storage, read> rays: array<vec4f>;
/// One row a ray: t, u, v, id.
@group(0) @binding(1) var<storage, read_write> hits: array<vec4u>;
/// One word a ray: 1 if something is hit.
@group(0) @binding(2) var<storage, read_write> flags: array<u32>;
/// One row a ray: nodes, boxes, leaves, triangles.
@group(0) @binding(3) var<storage, read_write> work: array<vec4u>;
/// The first ray that no workgroup has taken.
@group(0) @binding(4) var<storage, read_write> next_ray: atomic<u32>;
/// The parent of each node.
@group(0) @binding(5) var<storage, read> parents: array<u32>;
@group(0) @binding(6) var<storage, read> nodes_0: array<vec4u>;
@group(0) @binding(7) var<storage, read> nodes_1: array<vec4u>;
@group(0) @binding(8) var<storage, read> nodes_2: array<vec4u>;
@group(0) @binding(9) var<storage, read> nodes_3: array<vec4u>;
@group(0) @binding(10) var<storage, read> triangles_0: array<vec4u>;
@group(0) @binding(11) var<storage, read> triangles_1: array<vec4u>;
@group(0) @binding(12) var<storage, read> triangles_2: array<vec4u>;
@group(0) @binding(13) var<storage, read> triangles_3: array<vec4u>;
/// How far each ray is, if there is a budget: the node to go on with and how many of its triangles are done.
@group(0) @binding(14) var<storage, read_write> progress: array<vec2u>;
/// Rays that are not done.
@group(0) @binding(15) var<storage, read_write> pending: atomic<u32>;

/// A ray that has not begun.
const FRESH: u32 = 0xffffffff;
/// A ray that has ended.
const DONE: u32 = 0xfffffffe;
/// Added to a node that is done, from where the way leads up.
const CLIMBING: u32 = 0x80000000;

/// Steps of this invocation.
var<private> steps: u32;
/// Where the ray at hand ran out of steps; `DONE` if it did not.
var<private> suspended: vec2u;

/// False if the invocation has to end.
fn may_step() -> bool {
    if BUDGET == 0u {
        return true;
    }
    steps++;
    return steps <= BUDGET;
}

/// A row of a node that has `rows` of them.
fn node_row(node: u32, rows: u32, row: u32) -> vec4u {
    if PIECES == 1u {
        return nodes_0[node * rows + row];
    }
    let shift = scene.shifts & 0xffu;
    let i = (node & ((1u << shift) - 1u)) * rows + row;
    switch node >> shift {
        case 0u: { return nodes_0[i]; }
        case 1u: { return nodes_1[i]; }
        case 2u: { return nodes_2[i]; }
        default: { return nodes_3[i]; }
    }
}

fn triangle_row(reference: u32, row: u32) -> vec4u {
    if PIECES == 1u {
        return triangles_0[reference * 3u + row];
    }
    let shift = scene.shifts >> 8u;
    let i = (reference & ((1u << shift) - 1u)) * 3u + row;
    switch reference >> shift {
        case 0u: { return triangles_0[i]; }
        case 1u: { return triangles_1[i]; }
        case 2u: { return triangles_2[i]; }
        default: { return triangles_3[i]; }
    }
}

/// Nodes, boxes, leaves and triangles of the ray at hand.
var<private> counts: vec4u;

fn count(nodes: u32, boxes: u32, leaves: u32, triangles: u32) {
    if COUNT {
        counts += vec4u(nodes, boxes, leaves, triangles);
    }
}

/// The nearest of `hit` and the triangles of a leaf; the first that is hit if `ANY`.
fn leaf_hit(test: Test, t_min: f32, first: u32, n: u32, before: Hit) -> Hit {
    var hit = before;
    count(0u, 0u, 1u, n);
    for (var i = first; i < first + n; i++) {
        hit = intersect(test, t_min, triangle_row(i, 0u), triangle_row(i, 1u), triangle_row(i, 2u), hit);
        if ANY && hit.prim_id != NO_PRIM {
            break;
        }
    }
    return hit;
}

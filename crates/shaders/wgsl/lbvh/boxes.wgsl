// Boxes of inner nodes from the leaves up, and which subtrees become leaves (Karras 2012, section
// 4; the rule is that of the CPU builders, `niwaki_core::bottom_up::LeafRule`).
//
// Karras counts arrivals at a node and lets the second child go on; what the first wrote must then
// be visible to another workgroup, which takes a barrier of the whole device between data and
// counter. WGSL has none outside of uniform control flow. Here each word is its own counter: a child
// exchanges the empty word for its value, and whoever finds the other's value there goes on with
// both. The value passes through the atomic itself, so nothing has to be ordered, and no thread
// ever waits. The words of a box may be won by different children: each goes on with what it won.
//!import lbvh/state
//!import lbvh/float
//!import lbvh/tree

@group(0) @binding(0) var<uniform> params: LbvhParams;
@group(0) @binding(1) var<storage, read> state: array<u32>;
@group(0) @binding(2) var<storage, read> prims: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> items: array<u32>;
@group(0) @binding(4) var<storage, read_write> tree: array<u32>;
@group(0) @binding(5) var<storage, read_write> boxes: array<atomic<u32>>;
// Ids of the primitives in the order of the leaves.
@group(0) @binding(6) var<storage, read_write> prim_ids: array<u32>;

// Brings a value to a node's word. Returns what both children make together, or B_EMPTY if the other
// child is to come. Of zeros of either sign the right one is kept, as on the CPU.
fn meet(at: u32, value: u32, is_left: bool, is_largest: bool) -> u32 {
    if (value == B_EMPTY) {
        return B_EMPTY;
    }
    let other = atomicExchange(&boxes[at], value);
    if (other == B_EMPTY) {
        return B_EMPTY;
    }
    let left = select(other, value, is_left);
    let right = select(value, other, is_left);
    let take_left = select(f_less(left, right), f_less(right, left), is_largest);
    let both = select(right, left, take_left);
    atomicStore(&boxes[at], both);
    return both;
}

@compute @workgroup_size(256)
fn bottom_up(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let place = group_index(group, groups) * ELEMENT_THREADS + thread;
    let stride = params.capacity;
    if (place >= state[S_COUNT]) {
        return;
    }
    let prim = items[2u * stride + place];
    let low = prims[2u * prim];
    prim_ids[place] = low.w;
    var least = low.xyz;
    var most = prims[2u * prim + 1u].xyz;
    var child = place;
    var node = tree[T_LEAF_PARENT * stride + place];
    while (node != S_NONE) {
        let is_left = child == tree[T_SPLIT * stride + node];
        least.x = meet(node, least.x, is_left, false);
        least.y = meet(stride + node, least.y, is_left, false);
        least.z = meet(2u * stride + node, least.z, is_left, false);
        most.x = meet(3u * stride + node, most.x, is_left, true);
        most.y = meet(4u * stride + node, most.y, is_left, true);
        most.z = meet(5u * stride + node, most.z, is_left, true);
        if (all(least == vec3<u32>(B_EMPTY)) && all(most == vec3<u32>(B_EMPTY))) {
            break;
        }
        child = node;
        node = tree[T_PARENT * stride + node];
    }
}

// Half the surface area of a box (bits) after scaling its edges.
fn half_area(least: vec3<u32>, most: vec3<u32>) -> u32 {
    let scale = state[S_AREA_SCALE];
    let x = f_mul(f_sub(most.x, least.x), scale);
    let y = f_mul(f_sub(most.y, least.y), scale);
    let z = f_mul(f_sub(most.z, least.z), scale);
    return f_add(f_mul(x, f_add(y, z)), f_mul(y, z));
}

fn leaf_cost(area: u32, count: u32) -> u32 {
    return f_mul(f_add(params.sah_leaf, f_mul(params.sah_triangle, f_from_u32(count))), area);
}

fn word(array: u32, node: u32) -> u32 {
    return atomicLoad(&boxes[array * params.capacity + node]);
}

// Costs of subtrees that are small enough for a leaf, from the leaves up, and a mark where one leaf
// is no dearer than the inner node.
@compute @workgroup_size(256)
fn collapse(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    f_opaque_zero = state[S_ZERO];
    let place = group_index(group, groups) * ELEMENT_THREADS + thread;
    let stride = params.capacity;
    if (place >= state[S_COUNT] || params.max_leaf_size < 2u) {
        return;
    }
    let prim = items[2u * stride + place];
    var cost = leaf_cost(half_area(prims[2u * prim].xyz, prims[2u * prim + 1u].xyz), 1u);
    var node = tree[T_LEAF_PARENT * stride + place];
    while (node != S_NONE) {
        let other = tree[T_OTHER * stride + node];
        let count = max(node, other) - min(node, other) + 1u;
        if (count > params.max_leaf_size) {
            break;
        }
        let other_cost = atomicExchange(&boxes[B_COST * stride + node], cost);
        if (other_cost == B_EMPTY) {
            break;
        }
        let least = vec3<u32>(word(0u, node), word(1u, node), word(2u, node));
        let most = vec3<u32>(word(3u, node), word(4u, node), word(5u, node));
        let area = half_area(least, most);
        let inner = f_add(f_mul(params.sah_inner, area), f_add(cost, other_cost));
        let leaf = leaf_cost(area, count);
        cost = inner;
        if (f_at_most(leaf, inner)) {
            cost = leaf;
            tree[T_SPLIT * stride + node] |= T_IS_LEAF;
        }
        node = tree[T_PARENT * stride + node];
    }
}

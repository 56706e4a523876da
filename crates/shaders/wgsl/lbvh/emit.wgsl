// Writes the nodes of the tree, as `niwaki_core::BvhNode` has them, at the places that rank.wgsl
// found.
//!import lbvh/state
//!import lbvh/tree

@group(0) @binding(0) var<uniform> params: LbvhParams;
@group(0) @binding(1) var<storage, read> state: array<u32>;
@group(0) @binding(2) var<storage, read> prims: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> items: array<u32>;
@group(0) @binding(4) var<storage, read> tree: array<u32>;
@group(0) @binding(5) var<storage, read> boxes: array<u32>;
@group(0) @binding(6) var<storage, read> ranks: array<u32>;
// Two a node: (min, first), (max, count).
@group(0) @binding(7) var<storage, read_write> nodes: array<vec4<u32>>;

fn closed(place: u32) -> u32 {
    return ranks[R_CLOSED * params.capacity + place];
}

fn split_of(node: u32) -> u32 {
    return tree[T_SPLIT * params.capacity + node] & T_PLACE;
}

// Whether the inner node stayed one.
fn is_inner(node: u32) -> bool {
    let split = split_of(node);
    return closed(split + 1u) != closed(split);
}

// Where the children of the inner node over places `first ..= last` stand.
fn pair_of(first: u32, last: u32) -> u32 {
    return 1u + 2u * (closed(first) + ranks[R_OPEN * params.capacity + last]);
}

// Writes the node over places `first ..= last`, which is inner node `node` of the radix tree if they
// are several.
fn write(at: u32, node: u32, first: u32, last: u32) {
    if (first == last) {
        let prim = items[2u * params.capacity + first];
        nodes[2u * at] = vec4<u32>(prims[2u * prim].xyz, first);
        nodes[2u * at + 1u] = vec4<u32>(prims[2u * prim + 1u].xyz, 1u);
        return;
    }
    let stride = params.capacity;
    let least = vec3<u32>(boxes[node], boxes[stride + node], boxes[2u * stride + node]);
    let most = vec3<u32>(
        boxes[3u * stride + node],
        boxes[4u * stride + node],
        boxes[5u * stride + node],
    );
    if (is_inner(node)) {
        nodes[2u * at] = vec4<u32>(least, pair_of(first, last));
        nodes[2u * at + 1u] = vec4<u32>(most, 0u);
    } else {
        nodes[2u * at] = vec4<u32>(least, first);
        nodes[2u * at + 1u] = vec4<u32>(most, last - first + 1u);
    }
}

@compute @workgroup_size(256)
fn emit(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_index(group, groups) * ELEMENT_THREADS + thread;
    let count = state[S_COUNT];
    if (i >= count) {
        return;
    }
    if (i == 0u) {
        write(0u, 0u, 0u, count - 1u);
    }
    if (i + 1u >= count || !is_inner(i)) {
        return;
    }
    let other = tree[T_OTHER * params.capacity + i];
    let first = min(i, other);
    let last = max(i, other);
    let split = split_of(i);
    let pair = pair_of(first, last);
    write(pair, split, first, split);
    write(pair + 1u, split + 1u, split + 1u, last);
}

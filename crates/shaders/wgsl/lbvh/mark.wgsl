// Which inner nodes stay: those that did not become leaves, and are not inside of one that did.
//!import lbvh/state
//!import lbvh/tree

@group(0) @binding(0) var<uniform> params: LbvhParams;
@group(0) @binding(1) var<storage, read> state: array<u32>;
@group(0) @binding(2) var<storage, read> tree: array<u32>;
@group(0) @binding(3) var<storage, read_write> ranks: array<atomic<u32>>;

// Counts where they begin and split, for rank.wgsl.
@compute @workgroup_size(256)
fn mark(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_index(group, groups) * ELEMENT_THREADS + thread;
    let stride = params.capacity;
    if (i + 1u >= state[S_COUNT]) {
        return;
    }
    // A node goes with any node above it that became a leaf; only small ones can have.
    var node = i;
    while (node != S_NONE) {
        let other = tree[T_OTHER * stride + node];
        if (max(node, other) - min(node, other) >= params.max_leaf_size) {
            break;
        }
        if ((tree[T_SPLIT * stride + node] & T_IS_LEAF) != 0u) {
            return;
        }
        node = tree[T_PARENT * stride + node];
    }
    let first = min(i, tree[T_OTHER * stride + i]);
    let split = tree[T_SPLIT * stride + i];
    atomicStore(&ranks[R_CLOSED * stride + split], 1u);
    atomicAdd(&ranks[R_OPEN * stride + first], 1u);
}
